"""Late times, many turns, and the energy that a free mechanism keeps."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from analysis import Inputs, simulate
from analysis.run import Event, Function, TorsionBar, angles, prepared, sample_times
from benchmarks import long_runs
from benchmarks.long_runs import ACTING, FREE, compare_late_run, free_run, plant_run
from linkwork.errors import InputError
from linkwork.five_bar.published import TABLE_3_1, InitialState
from linkwork.slider_crank.published import OFFSET_CASE

TURN = 2.0 * pi
SPEED = 44.0

# --- Late times


@pytest.mark.parametrize("what", ACTING)
def test_a_run_at_a_late_time_is_the_run_at_zero(what: str) -> None:
    difference, steps = compare_late_run(what, tolerance=1e-12)
    # the phase of a harmonic is known as well as the time itself: 30 rad/s times 1.2e-7 s, of 5 of the forces' 50 N
    assert difference < (2e-6 if what == "harmonic force" else 1e-12)
    assert steps == 1.0


def test_steps_that_times_cannot_resolve_are_refused() -> None:
    with pytest.raises(InputError, match=r"step is 1e-08 s, but .* times near 1e\+09 s are 1\.19e-07 s apart"):
        sample_times(1e9 + 1e-6, 1e-8, 1e9)


@pytest.mark.parametrize("step", [2.5e-7, 1e-6, 1e-4, 0.3])
@pytest.mark.parametrize("count", [1, 7, 512])
def test_late_samples_are_as_many_as_early_ones(step: float, count: int) -> None:
    times = sample_times(1e9 + count * step, step, 1e9)
    assert len(times) == count + 1
    # each of them rounded
    assert np.diff(times) == pytest.approx(step, abs=1.2e-7, rel=0.0)


def test_a_message_names_a_late_time_to_the_microsecond() -> None:
    run = simulate(TABLE_3_1, Inputs(torque=2.0), start_time=1e9, stop_time=1e9 + 1.0, step=0.01)
    assert run.status == 3
    at = float(run.message.split(" s,")[0].rsplit("= ", 1)[1])
    assert at == pytest.approx(run.time[-1], abs=1e-6, rel=0.0)


# --- Many turns


@pytest.mark.parametrize("mechanism", FREE)
@pytest.mark.parametrize("tolerance", [1e-9, 1e-12])
def test_a_billion_turns_behind_it_do_not_change_a_run(mechanism: str, tolerance: float) -> None:
    fresh, angle = free_run(mechanism, 20.0, tolerance=tolerance)
    late, late_angle = free_run(mechanism, 20.0, begun=1e9, tolerance=tolerance)
    assert late < 3.0 * fresh
    # an angle of 1e9 turns is rounded to 1e-6 rad, where it is given and where it is reported
    assert late_angle == pytest.approx(angle, abs=2e-5)


@pytest.mark.parametrize("ratio", [2.0, 0.5, 1.0 / 3.0])
def test_a_groove_goes_on_in_its_place(ratio: float) -> None:
    parameters, start = OFFSET_CASE
    grooved, late = replace(parameters, groove_amplitude=0.1, groove_ratio=ratio), 1501.0 * TURN
    initial = replace(start, crank_angle=late)
    run = simulate(grooved, Inputs(speed=5.0, groove=True), initial=initial, stop_time=2.0, step=0.02)
    assert run["crank.angle"] == pytest.approx(late + 5.0 * run.time, abs=1e-9)
    assert run["shift.position"] == pytest.approx(0.1 * np.sin(ratio * run["crank.angle"]), abs=1e-10)


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Turns are taken off after every second turn, and calls are short."""
    monkeypatch.setattr(angles, "TURNS", 2)
    monkeypatch.setattr(prepared, "STEPS_PER_CALL", 10)


def _turning(inputs: Inputs, events: tuple[Event, ...] = ()) -> object:
    return simulate(TABLE_3_1, inputs, initial=InitialState(crank_speed=SPEED), stop_time=1.5, step=1e-2, events=events)


LEVELS = tuple(Event(name=str(n), output="crank.angle", level=n * TURN, direction=1) for n in (1, 4, 7, 8))


@pytest.mark.parametrize(
    "inputs",
    [Inputs(speed=SPEED), Inputs(), Inputs(speed=SPEED, force=Function(lambda t, th, u, w, v: 5.0 * np.sin(0.3 * th)))],
    ids=["speed", "free", "function of the angle"],
)
def test_turns_taken_off_come_back(inputs: Inputs, request: pytest.FixtureRequest) -> None:
    whole = _turning(inputs, LEVELS)
    request.getfixturevalue("often")
    ours = _turning(inputs, LEVELS)
    assert whole["crank.angle"][-1] > 9.0 * TURN
    for name in whole.names:
        least = 1e-7 if name == "energy.residual" else 1e-6 * np.abs(whole[name]).max() + 1e-9
        assert ours[name] == pytest.approx(whole[name], rel=1e-6, abs=least), name
    assert [event.name for event in ours.events] == ["1", "4", "7", "8"]
    for event in ours.events:
        assert event.state[0] == pytest.approx(int(event.name) * TURN, abs=1e-9)
    assert [event.time for event in ours.events] == pytest.approx([event.time for event in whole.events], abs=1e-6)


def test_a_wound_bar_keeps_its_angle(often: None) -> None:
    # wound up by six turns: its torque counts them
    inputs = Inputs(torque=TorsionBar(torque=20.0, release_angle=6.0 * TURN))
    parameters = replace(TABLE_3_1, slider_stiffness=1e5)
    ours = simulate(parameters, inputs, stop_time=0.4, step=2e-3)
    other = simulate(parameters, inputs, stop_time=0.4, step=2e-3, method="DOP853", tolerance=1e-11)
    assert ours["crank.angle"][-1] > 4.0 * TURN
    assert ours["crank.angle"] == pytest.approx(other["crank.angle"], rel=1e-6, abs=1e-6)


# --- The balance of energy


@pytest.mark.parametrize("mechanism", FREE)
def test_the_balanced_method_keeps_energy_and_angle(mechanism: str) -> None:
    _, reference = free_run(mechanism, 200.0, method="compiled", tolerance=1e-13)
    residual, angle = free_run(mechanism, 200.0, tolerance=1e-9)
    kept, kept_angle = free_run(mechanism, 200.0, method="balanced", tolerance=1e-9)
    assert kept < 0.1 * residual
    assert abs(kept_angle - reference) < 0.5 * abs(angle - reference)
    assert kept_angle == pytest.approx(reference, abs=1e-3)


def test_the_balanced_method_with_damping_and_torque() -> None:
    inputs = Inputs(torque=TorsionBar(torque=10.0), force=3.0)
    options = {"stop_time": 0.4, "step": 2e-3}
    reference = simulate(TABLE_3_1, inputs, tolerance=1e-13, **options)
    ours = simulate(TABLE_3_1, inputs, method="balanced", **options)
    assert ours.source == "compiled DOP853, energy balanced"
    assert ours["slider.position"] == pytest.approx(reference["slider.position"], abs=1e-8)
    assert ours["energy.dissipated"][-1] > 0.1


def test_the_balanced_method_at_rest() -> None:
    # without gravity nothing moves it: neither residual nor kinetic energy
    still = simulate(replace(TABLE_3_1, gravity=0.0), stop_time=1.0, step=0.1, method="balanced")
    assert (still.status, np.abs(still["slider.position"]).max()) == (0, 0.0)
    # swings about its rest, with the kinetic energy going through zero
    start = InitialState(slider_position=0.02)
    ours, reference = (
        simulate(replace(TABLE_3_1, slider_damping=0.0), initial=start, stop_time=1.0, step=0.01, method=m, tolerance=t)
        for m, t in (("balanced", 1e-9), ("compiled", 1e-13))
    )
    assert ours["slider.position"] == pytest.approx(reference["slider.position"], abs=1e-6)


@pytest.mark.parametrize(
    ("inputs", "options", "said"),
    [
        (Inputs(speed=SPEED), {}, r"speed is commanded: choose 'compiled'"),
        (Inputs(), {"max_step": 1.0}, "the balanced method takes no options"),
    ],
)
def test_what_the_balanced_method_refuses(inputs: Inputs, options: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        simulate(TABLE_3_1, inputs, stop_time=0.1, step=0.01, method="balanced", **options)


# --- The plant of the FMU


@pytest.mark.parametrize("mechanism", FREE)
def test_the_plant_at_a_late_time_and_after_many_turns(mechanism: str) -> None:
    residual, angle = plant_run(mechanism)
    assert plant_run(mechanism, time=1e9) == (residual, angle)
    late, late_angle = plant_run(mechanism, begun=1e6)
    assert abs(late) < 1e-8
    assert late_angle == pytest.approx(angle, abs=1e-7)


# --- The tables


# the last one builds FMUs: tests/fmu/test_late_start.py has its numbers
@pytest.mark.parametrize("name", [name for name in long_runs.TABLES if name != "built"])
def test_tables_of_the_page(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long_runs, "MANY", 1e3)
    table = long_runs.turns_table(2.0) if name == "turns" else long_runs.TABLES[name]()
    assert table.row_count >= 8


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", FREE)
def test_twenty_thousand_turns(mechanism: str) -> None:
    _, reference = free_run(mechanism, 2e4, method="balanced", tolerance=1e-12)
    drift, angle = free_run(mechanism, 2e4, tolerance=1e-9)
    kept, kept_angle = free_run(mechanism, 2e4, method="balanced", tolerance=1e-9)
    assert 1e-5 < drift < 1e-3
    assert kept < 1e-6
    assert abs(kept_angle - reference) < 0.3 * abs(angle - reference)
