"""Limit positions and pin forces of slider-cranks: against positions by differences, and the equations of the spatial plant."""

from dataclasses import replace
from math import acos, pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import analysis.synthesis as syn
from analysis.run import Inputs, read_case, simulate
from analysis.synthesis.result.report import report
from analysis.synthesis.task.constraint import advance, stroke
from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.slider_crank.parameters import InitialState

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
PHI = np.linspace(0.0, 2.0 * pi, 24, endpoint=False)
TASK = syn.SliderFunction(position=0.04 * np.cos(PHI) + 0.005 * np.cos(2.0 * PHI))
QUICK = syn.Search(starts=3, candidates=1 << 10, solutions=2)
MAKE = syn.MachineSpec(speed="600 rpm", load=("-20 N", "5 N"), slider_mass="0.4 kg")
CLEAR = syn.LeastTransmission(angle=radians(20.0))


@st.composite
def slider_cranks(draw: st.DrawFn) -> syn.SliderCrank:
    offset, crank, coupler = draw(st.floats(-0.6, 0.6)), draw(st.floats(0.1, 1.0)), draw(st.floats(0.1, 1.0))
    # joined somewhere, and not next to where the crank just comes to turn
    assume(abs(offset) < 0.95 * (crank + coupler))
    assume(min(abs(abs(offset) + crank - coupler), abs(abs(abs(offset) - crank) - coupler)) > 0.02)
    links = {"ground_length": offset, "crank_length": crank, "coupler_length": coupler}
    phase, branch = draw(st.floats(-3.0, 3.0)), draw(st.sampled_from([1, -1]))
    return syn.SliderCrank(**links, crank_phase=phase, branch=branch)


def slider(linkage: syn.SliderCrank, rotation: Any) -> FloatArray:
    """Place of C along the guide, by the pins' own places."""
    here = [linkage.pins(float(at)) for at in np.atleast_1d(rotation)]
    return np.array([pins["C"][1] for pins in here])


def advantage(linkage: syn.SliderCrank, rotation: Any) -> FloatArray:
    """Way of the crank pin for the slider's, by differences."""
    phi = np.atleast_1d(np.asarray(rotation, dtype=float))
    turned: FloatArray = replace(linkage, ground_angle=0.0).slider_position(phi + 1e-6)
    with np.errstate(divide="ignore"):
        found: FloatArray = 2e-6 * linkage.crank_length / (turned - linkage.slider_position(phi - 1e-6))
    return found


@settings(max_examples=50, deadline=None)
@given(slider_cranks().filter(lambda linkage: linkage.turns_fully))
def test_stroke_and_advance_are_those_of_the_places_of_the_slider(linkage: syn.SliderCrank) -> None:
    phi = np.linspace(0.0, 2.0 * pi, 7200, endpoint=False)
    u = linkage.slider_position(phi)
    assert stroke(linkage) == pytest.approx(np.ptp(u), rel=1e-5)
    between = abs(phi[u.argmax()] - phi[u.argmin()])
    assert pi + abs(advance(linkage)) == pytest.approx(max(between, 2.0 * pi - between), abs=3e-3)


@settings(max_examples=100, deadline=None)
@given(slider_cranks())
def test_the_slider_rests_in_its_dead_centres_and_the_crank_goes_to_its_toggles(linkage: syn.SliderCrank) -> None:
    phi = np.linspace(0.0, 2.0 * pi, 2881)
    rests, stops = syn.dead_centres(linkage), syn.toggles(linkage)
    assert (len(stops) == 0) == linkage.turns_fully
    for at in rests:
        if np.isfinite(linkage.path([at])).all() and linkage.transmission([at])[0] > 0.05:
            assert np.ptp(slider(linkage, [at - 1e-4, at, at + 1e-4])) < 1e-5
    joined = np.isfinite(linkage.path(phi)).all(axis=1)
    for end in phi[1:][joined[1:] != joined[:-1]]:
        assert min(abs((end - at + pi) % (2.0 * pi) - pi) for at in stops) < 0.01
    u = np.where(joined, linkage.slider_position(phi), np.nan)
    step = np.diff(u)
    turned = phi[1:-1][np.isfinite(step[1:] * step[:-1]) & (step[1:] * step[:-1] < 0.0)]
    for at in turned:
        assert min(abs((at - rest + pi) % (2.0 * pi) - pi) for rest in rests) < 0.01
    if linkage.turns_fully:
        first, second = rests
        ratio = (second - first) / (2.0 * pi - second + first)
        assert syn.time_ratio(linkage) == pytest.approx(max(ratio, 1.0 / ratio))


@settings(max_examples=50, deadline=None)
@given(slider_cranks(), st.floats(0.0, 6.0))
def test_the_advantage_is_the_ratio_of_speeds(linkage: syn.SliderCrank, rotation: float) -> None:
    assume(np.isfinite(linkage.path([rotation - 1e-3, rotation + 1e-3])).all())
    assume(linkage.transmission([rotation])[0] > 0.1)
    by_ways = float(advantage(linkage, rotation)[0])
    assume(abs(by_ways) < 1e3)
    assert float(syn.mechanical_advantage(linkage, rotation)) == pytest.approx(by_ways, rel=1e-3)


def best(*constraints: Any, task: Any = TASK) -> syn.Solution:
    return syn.synthesize(task, constraints=constraints, search=QUICK).best


@pytest.mark.parametrize("body", [False, True])
def test_the_greatest_error_of_a_slider_crank_is_made_small(body: bool) -> None:
    """Of a function of the slider, and of a body that is carried by the coupler."""
    points = np.column_stack([0.2 + 0.1 * np.cos(PHI[:8]), 0.15 + 0.05 * np.sin(PHI[:8])])
    task = syn.Motion(points=points, angle=np.linspace(0.0, 0.5, 8), rotation=PHI[:8]) if body else TASK
    tasks = (replace(task, objective=objective) for objective in ("error", "worst"))
    plain, flat = (syn.synthesize(one, kinds=("slider-crank",), search=QUICK).best for one in tasks)
    assert flat.value == pytest.approx(flat.evaluation.worst)
    assert flat.value < 0.99 * plain.evaluation.worst
    # several are the greatest at once
    assert np.sum(flat.evaluation.combined_errors > 0.999 * flat.value) >= 4


def test_an_advantage_and_a_dead_centre_are_kept() -> None:
    turn = np.linspace(0.0, 2.0 * pi, 1441)
    bound = 1.03 * float(np.abs(syn.mechanical_advantage(best(CLEAR).linkage, turn)).min())
    held = best(CLEAR, syn.MechanicalAdvantage(least=bound)).linkage
    assert np.abs(advantage(held, turn)).min() == pytest.approx(bound, rel=1e-4)
    for position, at in (("stretched", 10.0), ("folded", 185.0)):
        made = best(CLEAR, syn.DeadCentre(at=f"{at} deg", position=position)).linkage
        away = [abs((radians(at) - rest + pi) % (2.0 * pi) - pi) for rest in syn.dead_centres(made)]
        assert min(away) < 1e-6
        pins = {name: complex(*place) for name, place in made.pins(radians(at)).items()}
        along = ((pins["C"] - pins["B"]) / (pins["B"] - pins["A"])).real
        assert (along > 0.0) == (position == "stretched")


def test_toggles_are_where_they_are_asked_or_not() -> None:
    way = np.linspace(0.0, radians(80.0), 9)
    part = syn.SliderFunction(position=0.1 * np.cos(way + 0.4), rotation=way)
    joined = syn.LeastTransmission(angle=0.0, over="task")
    made = best(joined, syn.Toggle(at="110 deg"), task=part).linkage
    assert min(abs(at - radians(110.0)) for at in syn.toggles(made)) < 1e-6
    kept = best(joined, syn.Toggle(at="110 deg"), syn.NoToggle(between=("-100 deg", "90 deg")), task=part).linkage
    assert not any(-radians(100.0) <= at - k * 2.0 * pi <= radians(90.0) for at in syn.toggles(kept) for k in (0, 1))
    with pytest.raises(syn.InfeasibleError, match="cannot turn fully"):
        best(CLEAR, syn.Toggle(at="110 deg"), task=part)
    with pytest.raises(ParameterError, match="no link rests"):
        syn.dead_centres(syn.FiveBar(**made.values() | {"rocker_length": 0.2}, pivot=syn.SecondCrank(0.1)))


@pytest.mark.parametrize(("branch", "offset", "angle"), [(1, 0.03, -0.5 * pi), (-1, 0.02, 0.4), (1, -0.01, 2.0)])
def test_the_forces_are_those_of_the_spatial_plant(branch: int, offset: float, angle: float) -> None:
    """The five-bar with its rocker pivot far away against the slider-crank's own equations, and a run of that plant."""
    linkage = syn.SliderCrank(
        pivot_x=0.1, ground_length=offset, crank_length=0.05, coupler_length=0.16,
        point_distance=0.16, ground_angle=angle, crank_phase=0.3, branch=branch,
    )  # fmt: skip
    make = replace(MAKE, load=(0.0, 0.0))
    ran = syn.pin_forces(linkage, make)
    start = InitialState(crank_angle=linkage.crank_phase)
    times = ran.rotation / make.speed
    run = simulate(make.slider_crank(linkage), Inputs(speed=make.speed), initial=start, samples=times)
    np.testing.assert_allclose(run["slider.position"], linkage.slider_position(ran.rotation), atol=1e-9)
    for pin, name in zip("ABCD", ("bearing", "crank_pin", "slider_pin", "guide"), strict=True):
        wanted = np.hypot(run[f"{name}.fx"], run[f"{name}.fy"])
        np.testing.assert_allclose(ran.force[:, "ABCD".index(pin)], wanted, atol=1e-6 * ran.greatest)


def test_a_force_is_kept_and_the_case_runs_with_it(tmp_path: Path) -> None:
    free = best(CLEAR)
    loads = syn.pin_forces(free.linkage, MAKE)
    bound = 0.9 * loads.greatest
    held = best(CLEAR, syn.MaxPinForce(force=bound, make=MAKE))
    assert syn.pin_forces(held.linkage, MAKE).greatest == pytest.approx(bound, rel=1e-4)
    assert held.error > free.error
    calm = best(CLEAR, syn.LeastPinForce(error=1.001 * held.evaluation.worst, make=MAKE))
    assert calm.evaluation.worst <= 1.0011 * held.evaluation.worst
    assert syn.pin_forces(calm.linkage, MAKE).greatest <= 1.001 * bound
    case = read_case(syn.run_case(held, MAKE, "runs"), folder=tmp_path)
    run = simulate(case.parameters, case.inputs, initial=case.initial, stop_time=2.0 * pi / MAKE.speed, step=1e-4)
    # the load along the guide acts in the plant, on its slider; that across it is carried by the guide alone
    wanted = syn.pin_forces(held.linkage, MAKE).force.max(axis=0)
    for pin, name in zip("BC", ("crank_pin", "slider_pin"), strict=True):
        most = np.hypot(run[f"{name}.fx"], run[f"{name}.fy"]).max()
        assert most == pytest.approx(wanted["ABCD".index(pin)], rel=1e-4)
    described = read_case(syn.described_case(held, MAKE, "runs"), folder=tmp_path)
    times = {"stop_time": 2.0 * pi / MAKE.speed, "step": 1e-4}
    run = simulate(described.parameters, described.inputs, initial=described.initial, **times)
    assert np.hypot(run["C.fx"], run["C.fy"]).max() == pytest.approx(wanted[2], rel=1e-4)
    text = report(held)
    assert "slider at rest at crank rotations of" in text
    assert "force on the slider per force on the crank pin" in text


def test_a_least_force_is_found_within_every_bound_of_the_error() -> None:
    """The search starts from a linkage that keeps the bound, with a hundredth of the error: a wider bound has a lower force."""
    forces = []
    for error in (2.0112e-3, 2.2101e-3, 14.0e-3, 36.847e-3):
        calm = best(CLEAR, syn.LeastPinForce(error=error, make=MAKE))
        assert calm.evaluation.worst <= error * (1.0 + 1e-6)
        forces.append(syn.pin_forces(calm.linkage, MAKE).greatest)
    assert forces == sorted(forces, reverse=True)


def test_toggles_of_a_geared_five_bar() -> None:
    """A parallelogram's cranks, turning alike, keep B and D as far apart as the shafts; turning against one another, not."""
    links = {"ground_length": 0.2, "crank_length": 0.05, "coupler_length": 0.14, "rocker_length": 0.12}
    assert syn.toggles(syn.FiveBar(**links, pivot=syn.SecondCrank(0.05, 1.0, 0.0))) == ()
    # B and D are 0.2 - 0.1 cos phi apart where they turn in opposite ways from one line, and 0.26 at most
    against = syn.FiveBar(**links, pivot=syn.SecondCrank(0.05, -1.0, pi))
    assert syn.toggles(against) == pytest.approx([pi - acos(0.6), pi + acos(0.6)])
    task = syn.TimedPath(points=against.path(0.5 * PHI[:6]), rotation=0.5 * PHI[:6])
    assert "toggles at crank rotations of 126.87, 233.13 deg" in report(syn.Solution.from_linkage(task, against))


def test_forces_are_those_of_links_that_are_joined() -> None:
    short = syn.SliderCrank(ground_length=0.0, crank_length=0.1, coupler_length=0.05)
    with pytest.raises(AssemblyError, match="cannot be joined"):
        syn.pin_forces(short, MAKE)
    assert np.isfinite(syn.pin_forces(short, MAKE, (radians(70.0), radians(110.0))).force).all()


def test_a_five_bar_says_why_it_keeps_none_of_it() -> None:
    task = syn.TimedPath(points=np.column_stack([0.2 + 0.1 * np.cos(PHI), 0.15 + 0.05 * np.sin(PHI)]))
    for constraint in (syn.DeadCentre(at=0.3), syn.MaxPinForce(force=10.0)):
        with pytest.raises(InputError, match="no link rests, and the plant of the pin forces has no second crank"):
            syn.synthesize(task, constraints=[constraint], kinds=("geared-five-bar",), search=QUICK)
