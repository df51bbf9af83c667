"""Events: the torsion bar's release, an output that crosses a level, a function that crosses zero, runs that stop."""

import sys
from collections import Counter
from dataclasses import replace
from math import nan, pi
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis import Event, Function, Harmonics, Inputs, TorsionBar, Trajectory, ramp, simulate, steps
from analysis.linkages import linkage
from analysis.run import compiled
from linkwork.errors import InputError, ParameterError
from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1

solver = sys.modules["analysis.run.prepared"]

SPEED = SETS["table-3.1"].crank_speed


@pytest.fixture(params=["compiled", "DOP853"])
def method(request: pytest.FixtureRequest) -> Any:
    return request.param


def run(events: list[Event], inputs: Inputs | None = None, **options: Any) -> Trajectory:
    options = {"stop_time": 0.3, "step": 0.01} | options
    return simulate(TABLE_3_1, inputs or Inputs(speed=SPEED), events=events, **options)


def times(trajectory: Trajectory, name: str = "e") -> list[float]:
    return [event.time for event in trajectory.events if event.name == name]


# --- The release of the torsion bar


def _work(th2: float, torque: float) -> float:
    """Work of the bar from th2 = 0 on (J)."""
    return torque * (th2 - 0.5 * th2 * th2)


@pytest.mark.parametrize("torque", [1.0, 10.0, 20.0])
def test_release_is_located_exactly(torque: float) -> None:
    bar = Inputs(torque=TorsionBar(torque=torque))
    released = Event(name="e", function=lambda t, th2, u, w2, v: th2 - 1.0)
    located = run([released], bar, tolerance=1e-13, stop_time=0.2)
    (time,) = times(located)
    # the same motion without a release, where the torque is a smooth function: stopped at 1 rad by nothing but the event
    smooth = Inputs(torque=Function(lambda t, th2, u, w2, v: torque * (1.0 - th2)))
    events = [replace(released, stop=True)]
    stopped = simulate(TABLE_3_1, smooth, events=events, stop_time=0.2, step=0.2, tolerance=1e-13)
    assert time == pytest.approx(stopped.time[-1], rel=1e-12)
    # the state there carries the whole work of the bar, and what follows takes none
    after = located["crank.angle"] > 1.0
    assert np.all(located["drive.applied_torque"][after] == 0.0)
    assert np.all(located["drive.applied_torque"][~after] > 0.0)
    assert np.ptp(located["energy.supplied"][after]) == 0.0
    assert located["energy.supplied"][-1] == pytest.approx(_work(1.0, torque), rel=1e-12)
    work = _work(located["crank.angle"][~after], torque)
    assert located["energy.supplied"][~after] == pytest.approx(work, rel=1e-10, abs=1e-12)
    assert np.abs(located["energy.residual"]).max() < 1e-11 * _work(1.0, torque)


def test_motion_is_continuous_across_the_release(method: str) -> None:
    bar = Inputs(torque=TorsionBar(torque=10.0))
    (time,) = times(run([Event(name="e", output="crank.angle", level=1.0)], bar, method=method))
    samples = np.array([0.0, time - 1e-9, time + 1e-9, 0.05])
    ours = simulate(TABLE_3_1, bar, stop_time=0.05, samples=samples, method=method)
    for name in ("crank.angle", "crank.speed", "slider.position", "slider.velocity"):
        rates = {"crank.angle": "crank.speed", "slider.position": "slider.velocity"}
        slope = ours[rates.get(name, name.rsplit(".")[0] + ".acceleration")][1]
        assert ours[name][2] - ours[name][1] == pytest.approx(2e-9 * slope, rel=0.01, abs=1e-12)


def test_bar_that_starts_released_gives_no_torque() -> None:
    at = InitialState(crank_angle=1.0)
    ours = run([], Inputs(torque=TorsionBar(torque=10.0)), initial=at)
    assert np.all(ours["drive.applied_torque"] == 0.0)


def test_release_at_an_angle_of_its_own() -> None:
    ours = run([], Inputs(torque=TorsionBar(torque=10.0, release_angle=2.5)), step=1e-3)
    before = ours["crank.angle"] < 2.5
    assert ours["drive.applied_torque"][before] == pytest.approx(10.0 * (1.0 - ours["crank.angle"][before] / 2.5))
    assert np.all(ours["drive.applied_torque"][~before] == 0.0)


# --- Events of the user


@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_event_on_an_output_with_level_and_direction(method: str, direction: int) -> None:
    event = Event(name="e", output="slider.position", level=-0.002, direction=direction)
    ours = run([event], method=method, tolerance=1e-11)
    fine = run([], samples=np.linspace(0.0, 0.3, 30_001), tolerance=1e-11)
    gap = fine["slider.position"] + 0.002
    change = np.sign(gap[1:]) - np.sign(gap[:-1])
    expected = fine.time[:-1][(change > 0) if direction > 0 else (change < 0) if direction < 0 else (change != 0)]
    assert len(expected) > 0
    assert np.array(times(ours)) == pytest.approx(expected, abs=1.01e-5)
    # the state that is reported lies on the level, and on the motion
    for found in ours.events:
        assert found.state[1] == pytest.approx(-0.002, abs=1e-12)
        assert found.state[0] == pytest.approx(SPEED * found.time, rel=1e-9)
        assert found.state[2] == SPEED
        assert np.sign(found.state[3]) == direction or direction == 0


def test_event_on_a_function(method: str) -> None:
    event = Event(name="e", function=lambda t, th2, u, w2, v: np.sin(th2 - 0.5))
    expected = (0.5 + pi * np.arange(5)) / SPEED
    assert times(run([event], method=method)) == pytest.approx(expected[expected < 0.3], rel=1e-9)


def test_function_of_time_is_located_in_time(method: str) -> None:
    event = Event(name="e", function=lambda t, th2, u, w2, v: t - 1.2345)
    ours = run([event], start_time=1.0, stop_time=1.3, method=method)
    assert times(ours) == pytest.approx([1.2345], rel=1e-13)


@pytest.mark.parametrize("hold", [None, 0.01])
def test_run_stops_at_an_event_and_keeps_what_was_there(method: str, hold: float | None) -> None:
    stop = Event(name="e", output="crank.angle", level=5.0, stop=True)
    ours = run([stop], method=method, hold=hold)
    assert ours.status == 0
    assert ours.message == ""
    assert ours.time[-1] == pytest.approx(5.0 / SPEED, rel=1e-10)
    assert ours["crank.angle"][-1] == pytest.approx(5.0, rel=1e-12)
    assert len(ours) == int(5.0 / SPEED / 0.01) + 2
    assert times(ours) == [ours.time[-1]]
    whole = run([], method=method, hold=hold)
    assert ours.values[:-1] == pytest.approx(whole.values[: len(ours) - 1], rel=1e-6, abs=1e-6)


def test_last_configuration_is_recorded_under_the_inputs_of_its_time(method: str) -> None:
    inputs = Inputs(torque=Harmonics(1.0, [0.5], [300.0], [0.0]))
    ours = run([Event(name="e", output="crank.angle", level=1.0, stop=True)], inputs, method=method)
    assert ours["crank.angle"][-1] == pytest.approx(1.0, rel=1e-12)
    assert ours["drive.applied_torque"] == pytest.approx(1.0 + 0.5 * np.cos(300.0 * ours.time), rel=1e-12)
    slips = replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=10.0)
    pushed = Inputs(speed=SPEED, force=Harmonics(0.0, [5.0], [300.0], [0.0]))
    lost = simulate(slips, pushed, stop_time=3.0, step=0.01, method=method)
    # along the guide act the force, the damper and the pin at D; gravity does not
    force = 5.0 * np.cos(300.0 * lost.time)
    resisted = -10.0 * lost["slider.velocity"] - lost["pin.D.fx"]
    assert force + resisted == pytest.approx(slips.slider_mass * lost["slider.acceleration"], abs=1e-6, rel=1e-9)


def test_first_of_several_stopping_events_counts_and_nothing_happens_after_it(method: str) -> None:
    events = [
        Event(name="late", output="crank.angle", level=5.002, stop=True),
        Event(name="after", output="crank.angle", level=5.0011),
        Event(name="e", output="crank.angle", level=5.001, stop=True),
        Event(name="before", output="crank.angle", level=4.999),
        Event(name="long before", output="crank.angle", level=1.0),
    ]
    ours = run(events, method=method)
    assert [found.name for found in ours.events] == ["long before", "before", "e"]
    assert ours["crank.angle"][-1] == pytest.approx(5.001, rel=1e-12)


def test_many_events_in_one_step_come_in_the_order_of_time(method: str) -> None:
    levels = 3.0 + 1e-3 * np.arange(40)
    events = [Event(name=f"{level:.3f}", output="crank.angle", level=level) for level in levels[::-1]]
    ours = run(events, method=method)
    assert [found.name for found in ours.events] == [f"{level:.3f}" for level in levels]
    assert [found.time for found in ours.events] == pytest.approx(levels / SPEED, rel=1e-10)


def test_two_crossings_in_one_step_are_both_found(method: str) -> None:
    # a function of time that dips below zero for ten milliseconds
    event = Event(name="e", function=lambda t, th2, u, w2, v: (t - 0.1) ** 2 - 2.5e-5)
    options = {"max_step": 5e-3} if method == "DOP853" else {}
    assert times(run([event], method=method, **options)) == pytest.approx([0.095, 0.105], rel=1e-9)


@pytest.mark.parametrize("stop", [False, True])
def test_event_that_starts_on_its_level_has_not_happened(method: str, stop: bool) -> None:
    inputs = Inputs(speed=SPEED)
    for event in (
        Event(name="e", output="crank.angle", level=0.0, stop=stop),
        Event(name="e", output="slider.position", level=0.0, direction=1, stop=stop),
        Event(name="e", function=lambda t, th2, u, w2, v: -th2, stop=stop),
        Event(name="e", function=lambda t, th2, u, w2, v: 0.0, stop=stop),
        Event(name="e", output="crank.acceleration", stop=stop),
    ):
        ours = run([event], inputs, method=method, stop_time=0.02)
        assert ours.events == ()
        assert ours.time[-1] == 0.02


def test_event_that_starts_on_its_level_happens_when_it_comes_back(method: str) -> None:
    ours = run([Event(name="e", output="slider.position", level=0.0)], method=method, stop_time=0.14)
    assert len(times(ours)) > 0
    assert min(times(ours)) > 0.01
    assert [found.state[1] for found in ours.events] == pytest.approx([0.0] * len(ours.events), abs=1e-12)


@pytest.mark.parametrize("stop", [False, True])
def test_output_that_jumps_across_its_level_has_crossed_it(method: str, stop: bool) -> None:
    inputs = Inputs(speed=steps([0.0, 0.05, 0.1], [20.0, 45.0, 10.0]))
    ours = run([Event(name="e", output="crank.speed", level=30.0, stop=stop)], inputs, method=method)
    assert times(ours) == ([0.05] if stop else [0.05, 0.1])
    assert ours.events[0].state[2] == 45.0
    assert ours.time[-1] == (0.05 if stop else 0.3)
    assert ours["crank.speed"][-1] == (45.0 if stop else 10.0)
    falling = run([Event(name="e", output="crank.speed", level=30.0, direction=-1)], inputs, method=method)
    assert times(falling) == [0.1]


def test_events_between_samples_of_held_inputs(method: str) -> None:
    # the torque is held: it crosses the level only at points of the grid
    inputs = Inputs(speed=SPEED, force=Harmonics(0.0, [10.0], [40.0], [0.0]))
    event = Event(name="e", output="slider.guide_force", level=0.0)
    ours = run([event], inputs, hold=0.01, method=method)
    reference = run([], inputs, hold=0.01, step=0.01)
    assert len(times(ours)) >= np.count_nonzero(np.diff(np.sign(reference["slider.guide_force"])))
    ramped = Inputs(torque=ramp(0.0, 3.0, 0.0, 0.3))
    event = Event(name="e", output="drive.applied_torque", level=0.95)
    stepwise = run([event], ramped, hold=0.01, method=method)
    assert times(stepwise) == pytest.approx([0.10])
    ours = run([event], ramped, method=method)
    assert times(ours) == pytest.approx([0.095], rel=1e-12)


def test_output_that_depends_on_changing_inputs_is_located_with_the_inputs_of_its_time(method: str) -> None:
    # no steps are taken for the sake of the torque: it changes much within each
    wave = Harmonics(0.0, [1e-6], [200.0], [-pi / 2.0])
    event = Event(name="e", output="drive.applied_torque", level=0.5e-6, direction=1)
    expected = (np.arcsin(0.5) + 2.0 * pi * np.arange(9)) / 200.0
    quiet = replace(TABLE_3_1, gravity=0.0)
    found = times(simulate(quiet, Inputs(torque=wave), events=[event], stop_time=0.25, step=0.25, method=method))
    assert len(found) > 4
    for time in found:
        assert np.abs(expected - time).min() < 1e-9


def test_event_at_the_time_of_the_release_is_reported_once(method: str) -> None:
    bar = Inputs(torque=TorsionBar(torque=10.0))
    events = [
        Event(name="angle", output="crank.angle", level=1.0),
        Event(name="function", function=lambda t, th2, u, w2, v: 1.0 - th2),
        Event(name="later", output="crank.angle", level=1.0 + 1e-6),
        Event(name="earlier", output="crank.angle", level=1.0 - 1e-6),
        Event(name="later by rounding", output="crank.angle", level=1.0 + 1e-12),
        Event(name="earlier by rounding", output="crank.angle", level=1.0 - 1e-12),
    ]
    ours = run(events, bar, method=method)
    assert Counter(found.name for found in ours.events) == Counter(event.name for event in events)
    assert ours.events[0].name == "earlier"
    assert ours.events[-1].name == "later"


def test_event_that_stops_at_the_release(method: str) -> None:
    bar = Inputs(torque=TorsionBar(torque=10.0))
    ours = run([Event(name="e", output="crank.angle", level=1.0, stop=True)], bar, method=method)
    assert ours.time[-1] == pytest.approx(0.02137446194, abs=1e-10)
    assert len(times(ours)) == 1


def test_event_just_before_the_limit_of_assembly(method: str) -> None:
    slips = replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=10.0)
    levels = {"transmission.angle": 2e-3, "slider.position": -1.0}
    events = [Event(name=name, output=name, level=level) for name, level in levels.items()]
    ours = simulate(slips, Inputs(speed=SPEED), events=events, stop_time=3.0, step=0.01, method=method)
    assert ours.status == 3
    assert [found.name for found in ours.events] == ["transmission.angle"]
    assert ours.events[-1].time < ours.time[-1]


def test_no_event_is_lost_however_many_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    event = Event(name="e", function=lambda t, th2, u, w2, v: np.sin(20.0 * th2))
    monkeypatch.setattr(solver, "EVENTS_PER_CALL", 1 + compiled.EVENTS_PER_STEP)
    ours = run([event], stop_time=6.001, tolerance=1e-13)
    expected = pi / 20.0 * np.arange(1, int(6.001 * SPEED * 20.0 / pi) + 1) / SPEED
    assert len(expected) > 1500
    assert times(ours) == pytest.approx(expected, rel=1e-9)


def test_events_do_not_change_the_motion() -> None:
    events = [Event(name=name, output=name, level=0.1) for name in ("slider.velocity", "pin.C.fx", "rocker.angle")]
    assert np.array_equal(run(events).values, run([]).values)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Event(name="e"), "event 'e' needs either an output or a function"),
        (lambda: Event(name="e", output="crank.angle", function=max), "either an output or a function"),
        (lambda: Event(name="e", output="crank.angel"), "'crank.angel' for event 'e'; did you mean crank.angle"),
        (lambda: Event(name="e", function=3), "it must be callable"),
        (lambda: Event(name="e", output="crank.angle", direction=2), "direction 2"),
        (lambda: Event(name="e", output="crank.angle", level="2 mm"), "level of event 'e' is '2 mm'"),
        (lambda: Event(name="e", function=abs, level="2 mm"), "level 2 mm: it must be a finite number"),
        (lambda: Event(name="e", output="crank.angle", level=nan), "level nan"),
    ],
)
def test_event_that_is_not_usable(make: Any, said: str) -> None:
    with pytest.raises((InputError, ParameterError), match=said):
        make()


def test_a_level_may_have_a_unit() -> None:
    near, same = (Event(name="e", output="slider.position", level=level) for level in ("-2 mm", -0.002))
    assert near == same


def test_event_state_is_a_state_of_the_motion() -> None:
    ours = run([Event(name="e", output="drive.applied_torque", level=0.5)], tolerance=1e-12)
    p = TABLE_3_1.constants()
    assert len(ours.events) > 4
    for found in ours.events:
        inputs = dynamics.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        values = dynamics.outputs((*found.state, 0.0, 0.0), inputs, 0.0, p)
        assert values.drive_applied_torque == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize(("method", "allowed"), [("compiled", 1e-6), ("Radau", 1e-8)])
def test_contacts_of_a_ball_that_bounces_on_a_stop_are_scipys(method: str, allowed: float) -> None:
    """36 events by a law of contact with a kink, each of which hands its error on to the next; SciPy at 1e-12."""
    stiffness, mass, gravity = 3e5, 0.4, 9.81
    made = linkage("bouncing-ball", ground={"A": (0, 0)}, gravity=gravity)
    made.body("ball", points={"B": (0, 0)}, mass=mass, inertia=0)
    made.slide("G", body="ball", through="A", direction="90 deg").freedom("ball", "G", start="5 cm", driven=False)
    made.spring("stop", at="G", law="-c*max(-x, 0)**1.5*(1 - 0.2*v)", constants={"c": stiffness}).mechanism()

    def rates(t: float, y: Any) -> list[float]:
        return [y[1], stiffness * max(-y[0], 0.0) ** 1.5 * (1.0 - 0.2 * y[1]) / mass - gravity]

    exact: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "max_step": 1e-3}
    expected = solve_ivp(rates, (0.0, 2.0), [0.05, 0.0], events=lambda t, y: y[0], **exact)
    touch = Event(name="touch", output="ball.position")
    ours = simulate("bouncing-ball", stop_time=2.0, step=5e-3, tolerance=1e-10, method=method, events=[touch])
    assert len(expected.t_events[0]) == 36
    assert times(ours, "touch") == pytest.approx(expected.t_events[0], abs=allowed)
