"""The five-bar slider and the planar slider-crank in words: what the hand-written ones are, at little more cost."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.export import NATIVE, build_native
from analysis.linkages import Package, linkage, read_description
from analysis.linkages.parameters import interface
from analysis.linkages.structure import analyse
from analysis.mechanisms import FIVE_BAR, SLIDER_CRANK
from analysis.run import Inputs, cosimulate
from linkwork.mechanism import Mechanism
from tests import slider_cranks, strategies
from tests.oracles.five_bar import described, spring


def rough(case: Any) -> Any:
    """A case of the five-bar with friction by the forces in its joints."""
    p, radii = case.parameters, {f"pin_{joint}_friction_radius": 3e-4 * n for n, joint in enumerate("DCBA", 1)}
    return case._replace(parameters=replace(p, slider_friction_coefficient=0.1, **radii))


def slider_crank(p: Any) -> dict[str, Any]:
    """The slider-crank of parallel axes in words: the guide is along the y axis, up or down."""
    up = -math.sin(p.guide_twist)
    cog = (p.crank_cog_x, p.crank_cog_y)
    inertia = p.crank_inertia - p.crank_mass * (cog[0] ** 2 + cog[1] ** 2)
    gravity = {
        "gravity": math.hypot(p.gravity_x, p.gravity_y),
        "gravity_direction": math.atan2(p.gravity_y, p.gravity_x),
    }
    ground, more = {"A": (0, 0), "R": (-p.guide_offset, 0.0)}, {"assembly": {"C": p.assembly_branch}, "loads": ["C"]}
    built = linkage("slider-crank-described", ground=ground, **gravity, **more)
    built.body("crank", bar=("A", "B"), length=p.crank_length, mass=p.crank_mass, inertia=inertia, cog=cog)
    rod = {"mass": p.rod_mass, "inertia": p.rod_inertia, "cog": (p.rod_cog_distance, 0)}
    built.body("rod", bar=("B", "C"), length=p.rod_length, **rod)
    built.body("piston", points={"C": (0, 0)}, mass=p.slider_mass, cog=(-p.slider_cog_z, -up * p.slider_cog_x))
    built.slide("G", body="piston", through="R", direction=0.5 * math.pi * up).freedom("crank", "A", speed=5.0)
    return built.spring("spring", **spring(p)).tables


def planar(case: Any, turned: bool) -> Any:
    """A case of the slider-crank in the plane of its crank: axes perpendicular to the guide, no shift."""
    twist = (0.5 if turned else 1.5) * math.pi
    p = replace(case.parameters, guide_twist=twist, gravity_z=0.0, shift_stiffness=0.0)
    th, _, w, _, _, _ = case.state
    return case._replace(parameters=p, state=(th, 0.0, w, 0.0, 0.0, 0.0))


ENERGIES = ("kinetic", "potential")
#: Outputs of the hand-written mechanism and of the described one, by group, which have one scale.
OUTPUTS = {
    "five-bar": (
        {"drive.applied_torque": "drive.applied_torque"},
        {f"pin.{joint}.f{axis}": f"{joint}.f{axis}" for joint in "ABCD" for axis in "xy"}
        | {"slider.guide_force": "G.force"},
        {f"energy.{kind}": f"energy.{kind}" for kind in ENERGIES},
        {"transmission.angle": "C.transmission_angle"} | {name: name for name in ("coupler.angle", "rocker.angle")},
        {"slider.position": "slider.position", "coupler.point.x": "P.x", "coupler.point.y": "P.y"},
    ),
    "slider-crank": (
        {"drive.applied_torque": "drive.applied_torque"},
        {f"bearing.f{axis}": f"A.f{axis}" for axis in "xy"} | {f"crank_pin.f{axis}": f"B.f{axis}" for axis in "xy"},
        {f"energy.{kind}": f"energy.{kind}" for kind in ENERGIES},
        {"slider.position": "G.position", "slider_pin.x": "C.x", "slider_pin.y": "C.y"},
    ),
}
WORDS: dict[str, tuple[Mechanism, Callable[[Any], dict[str, Any]], Callable[[int], Any]]] = {
    "five-bar": (FIVE_BAR, described, strategies.seeded),
    "rough-five-bar": (FIVE_BAR, described, lambda seed: rough(strategies.seeded(seed))),
    "slider-crank": (SLIDER_CRANK, slider_crank, lambda seed: planar(slider_cranks.seeded(seed), seed % 2 == 0)),
}


def given(kind: str, case: Any) -> tuple[dict[str, float], dict[str, float]]:
    """The inputs of the hand-written mechanism and of the described one, by name, the drive by torque or by speed."""
    hand = case.fmi_inputs()
    if kind != "slider-crank":
        loads = {f"P.load_{axis}": hand[f"load.f{axis}"] for axis in "xy"}
        return hand, hand | loads
    hand |= {"axial.speed": 0.0, "axial.acceleration": 0.0}
    return hand, hand | {"C.load_x": 0.0, "C.load_y": -math.sin(case.parameters.guide_twist) * hand["slider.load"]}


@pytest.mark.parametrize("kind", WORDS)
def test_a_described_twin_moves_as_the_hand_written_one(kind, tmp_path):
    """Accelerations, powers, forces and energies of random mechanisms in random states, both ways of driving."""
    hand, words, seeded = WORDS[kind]
    made = Package(read_description(words(seeded(0).parameters))).mechanism(tmp_path)
    free, count = [n for n, f in enumerate(hand.freedoms) if f.coordinate != "shift.position"], len(hand.freedoms)
    kept = [*free, *(count + n for n in free), 2 * count, 2 * count + 1]
    groups, compared = OUTPUTS[kind.removeprefix("rough-")], 0
    for seed in range(100 if kind.startswith("rough") else 300):
        case = seeded(seed)
        d, x = read_description(words(case.parameters)), case.state
        p = made.parameters(**{q.field: q.value for q in interface(d, analyse(d)).parameters}).constants()
        own = tuple(x[n] for n in kept)
        for mode in (0.0, 1.0):
            u, v = given(kind, case)
            modes = (mode, *(1.0 for _ in hand.modes[1:]))
            i = hand.equations.apply_inputs(modes, tuple(u[n] for n in hand.input_names), case.p)
            j = made.equations.apply_inputs((mode,), tuple(v[n] for n in made.input_names), p)
            margin = hand.equations.clearance(x, i, case.p)
            if hand is FIVE_BAR:
                assert made.equations.clearance(own, j, p) == pytest.approx(margin, rel=1e-10, abs=1e-10)
            if margin < 0.1 and kind.startswith("rough"):  # friction may jam the links
                continue
            compared += 1
            rates = np.array(hand.equations.derivative(x, i, case.p))[kept]
            wanted = dict(zip(hand.output_names, hand.equations.outputs(x, i, 0.0, case.p)))
            wanted |= {v.name: math.remainder(wanted[v.name], 2.0 * math.pi) for v in hand.variables if v.wraps}
            found = dict(zip(made.output_names, made.equations.outputs(own, j, 0.0, p)))
            pairs = [(made.equations.derivative(own, j, p), rates)]
            v["drive.speed"] = u["drive.speed"] = 7.0
            after = hand.equations.jump(x, i, tuple(u[n] for n in hand.input_names), case.p)
            jumped = made.equations.jump(own, j, tuple(v[n] for n in made.input_names), p)
            pairs += [(jumped, np.array(after)[kept])]
            pairs += [([found[n] for n in group.values()], np.array([wanted[n] for n in group])) for group in groups]
            for one, other in pairs:
                size = max(1.0, np.abs(other).max())
                np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * size, err_msg=f"{seed}")


@pytest.mark.parametrize(("kind", "switched"), [*((kind, False) for kind in WORDS), ("rough-five-bar", True)])
def test_a_described_twin_costs_little_more(kind, switched):
    """At most 1.3 times the operations of the hand-written equations, with friction by joint forces switched off and on."""
    casadi = pytest.importorskip("casadi")
    from analysis.run.equations import expressions

    def operations(m: Mechanism) -> int:
        traces = expressions(m, switched)
        f = casadi.Function("f", [*traces.symbols], [traces.derivative], {"cse": True})
        ids = [f.instruction_id(n) for n in range(f.n_instructions())]
        return sum(code not in (casadi.OP_INPUT, casadi.OP_OUTPUT, casadi.OP_CONST) for code in ids)

    hand, words, _ = WORDS[kind]
    p = next(iter(hand.published.values())).parameters
    if kind.startswith("rough"):
        p = rough(strategies.seeded(0)._replace(parameters=p)).parameters
    assert operations(Package(read_description(words(p))).mechanism()) <= 1.3 * operations(hand)


@pytest.mark.slow
@pytest.mark.fmu
@pytest.mark.parametrize("kind", ["five-bar", "slider-crank"])
def test_the_fmu_of_a_described_twin_runs_as_that_of_the_hand_written_one(kind, tmp_path):
    hand, words, seeded = WORDS[kind]
    p = FIVE_BAR.published["table-3.1"].parameters
    if kind == "slider-crank":
        p = seeded(1).parameters
        p = replace(p, rod_length=2.0 * (p.crank_length + abs(p.guide_offset)), slider_coulomb_friction=0.0)
    made = Package(read_description(words(p))).mechanism(tmp_path)
    runs = []
    for m, own in ((hand, p), (made, made.parameters())):
        given = {"initial": m.initial(crank_speed=20.0), "stop_time": 0.5, "step": 5e-3, "tolerance": 1e-13}
        runs.append(cosimulate(build_native(m, NATIVE, tmp_path), own, Inputs(torque=0.3), **given))
    for group in OUTPUTS[kind]:
        scale = max(1.0, *(np.abs(runs[0][name]).max() for name in group))
        for name, other in group.items():
            np.testing.assert_allclose(runs[1][other], runs[0][name], rtol=0, atol=1e-9 * scale, err_msg=name)
