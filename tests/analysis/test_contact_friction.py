"""Friction in guide and pins by their forces, in runs, ensembles and periodic motions."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from analysis import Inputs, find_orbit, simulate, simulate_many
from analysis.periodic import Drive, OrbitError, Stability
from analysis.periodic.chart.grid import largest_multipliers
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import AssemblyError
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.limits import JAMMING
from tests.strategies import PINS

from .conftest import marked

RIG = {spring: SETS[f"rig-1-spring-{spring}"].parameters for spring in "ab"}
#: Steel on bronze in a dry guide, pins of 5 mm.
ROUGH = {"slider_friction_coefficient": 0.2, **dict.fromkeys(PINS, 5e-4)}
JAMMED = replace(TABLE_3_1, slider_friction_coefficient=4.0)


@pytest.mark.slow
@pytest.mark.parametrize(("spring", "rpm"), [("b", 580.0), *marked("long", [("a", 300.0), ("b", 800.0)])])
def test_a_run_settles_on_the_periodic_motion(spring: str, rpm: float) -> None:
    speed, parameters = rpm * RAD_S_PER_RPM, replace(RIG[spring], **ROUGH)
    orbit = find_orbit(parameters, speed=speed)
    assert orbit.verdict().stability is Stability.STABLE
    turn = 2.0 * pi / speed
    run = simulate(parameters, Inputs(speed=speed), stop_time=60.0 * turn, step=turn, tolerance=1e-10)
    end = [run[name][-1] for name in ("slider.position", "slider.velocity")]
    assert end == pytest.approx(orbit.start, rel=1e-6, abs=1e-7)
    assert abs(run["energy.residual"][-1]) < 1e-7 * run["energy.dissipated"][-1]
    # it takes amplitude away
    assert orbit.amplitude < 0.85 * find_orbit(RIG[spring], speed=speed).amplitude


@pytest.mark.slow
@pytest.mark.parametrize(("spring", "rpm"), [("b", 800.0), *marked("long", [("a", 240.0), ("a", 500.0), ("b", 500.0)])])
def test_rig_1_does_not_jam_with_a_coefficient_of_a_half(spring: str, rpm: float) -> None:
    orbit = find_orbit(replace(RIG[spring], slider_friction_coefficient=0.5), speed=rpm * RAD_S_PER_RPM)
    assert orbit.clearance() > 0.5


def test_an_ensemble_may_have_runs_with_and_without() -> None:
    both = [RIG["a"], replace(RIG["a"], **ROUGH), replace(RIG["a"], slider_friction_coefficient=0.1)]
    found = simulate_many(both, Inputs(speed=30.0), stop_time=0.3, step=0.01)
    for parameters, run in zip(both, found):
        alone = simulate(parameters, Inputs(speed=30.0), stop_time=0.3, step=0.01)
        fine = simulate(parameters, Inputs(speed=30.0), stop_time=0.3, step=0.01, tolerance=1e-12)
        scale = np.abs(alone.values).max(axis=0) + 1e-2
        # where the slider sticks and slips, rounding decides over some steps: the run is no worse than one alone
        error, own = (np.max(np.abs(one.values - fine.values) / scale) for one in (alone, run))
        assert own <= 1e-8 + 1.01 * error


def test_a_row_of_orbits_may_begin_without() -> None:
    rows = [replace(RIG["a"], slider_friction_coefficient=value) for value in (0.0, 0.1, 0.2)]
    drive = Drive(speed=300.0 * RAD_S_PER_RPM)
    largest, starts, status = largest_multipliers(rows, [drive] * 3)
    assert not status.any()
    for parameters, value, start in zip(rows, largest, starts):
        orbit = find_orbit(parameters, speed=drive.speed, start=start)
        assert orbit.start == pytest.approx(start, abs=1e-9)
        assert orbit.largest == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize("method", ["compiled", pytest.param("DOP853", marks=pytest.mark.slow)])
def test_a_run_ends_where_friction_may_jam_the_links(method: str) -> None:
    run = simulate(JAMMED, Inputs(speed=10.0 * pi), stop_time=0.3, step=1e-3, method=method)
    assert run.status == 3
    assert run.message.startswith(f"{JAMMING} at t = ")
    assert 0.0 < run.time[-1] < 0.3
    # well clear of the limit of assembly
    assert run["transmission.angle"].min() > 0.3
    last = run["slider.guide_force"][-1]
    assert np.isfinite(last)


def test_runs_that_end_there_in_ensembles_and_orbits() -> None:
    (run,) = simulate_many([JAMMED], Inputs(speed=10.0 * pi), stop_time=0.3, step=1e-3)
    assert (run.status, run.message.partition(" at t")[0]) == (3, JAMMING)
    with pytest.raises(OrbitError, match="friction may jam"):
        find_orbit(JAMMED, speed=10.0 * pi, settle=False)
    moving = InitialState(slider_velocity=0.1)
    with pytest.raises(AssemblyError, match=JAMMING):
        simulate(replace(TABLE_3_1, slider_friction_coefficient=50.0), Inputs(speed=10.0 * pi), initial=moving)
