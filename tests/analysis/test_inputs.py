"""Inputs: what each signal is worth at a time, on which side of a jump, and what is refused."""

from math import cos, inf, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from analysis import simulate, simulate_many
from analysis.linkages import linkage
from analysis.mechanisms import FIVE_BAR
from analysis.run import Function, Harmonics, InductionMotor, Inputs, Piecewise, TorsionBar, ramp, steps, table
from analysis.run.inputs import align, encode
from analysis.run.sampling import function_values, release, sample
from analysis.run.sources import channels
from linkwork.errors import InputError

REST = np.zeros(4)


def value(inputs: Inputs, t: float, *, left: bool = False, x: Any = REST) -> dict[str, float]:
    """All channels at a time, and the acceleration."""
    encoded = encode(inputs, FIVE_BAR)
    names = [channel.argument for channel in FIVE_BAR.channels]
    return dict(zip(names, sample(encoded, t, np.asarray(x, float), encoded.source.laws, left=left).tolist()))


def force(signal: Any, t: float, *, left: bool = False) -> float:
    return value(Inputs(force=signal), t, left=left)["force"]


def test_nothing_given_is_nothing() -> None:
    assert set(value(Inputs(), 0.3).values()) == {0.0}
    assert Inputs().modes(FIVE_BAR) == {"drive.mode": 0}
    assert Inputs(speed=0.0).modes(FIVE_BAR) == {"drive.mode": 1}


def test_constants_of_every_channel_go_where_they_belong() -> None:
    assert value(Inputs(torque=1.0, force=2.0, load_x=3.0, load_y=4), 7.0) == {
        "torque": 1.0,
        "speed": 0.0,
        "acceleration": 0.0,
        "force": 2.0,
        "load_x": 3.0,
        "load_y": 4.0,
    }
    assert value(Inputs(speed=np.float64(5.0)), 7.0)["speed"] == 5.0


@pytest.mark.parametrize(("t", "expected"), [(-5.0, 2.0), (0.1, 2.0), (0.2, 3.0), (0.3, 4.0), (9.0, 4.0)])
def test_ramp(t: float, expected: float) -> None:
    assert force(ramp(2.0, 4.0, 0.1, 0.3), t) == pytest.approx(expected, rel=1e-14)
    assert force(ramp(2.0, 4.0, 0.1, 0.3), t, left=True) == pytest.approx(expected, rel=1e-14)


def test_slope_of_a_ramp_on_both_sides_of_its_kinks() -> None:
    inputs = Inputs(speed=ramp(2.0, 4.0, 0.1, 0.3))
    assert value(inputs, 0.1, left=True)["acceleration"] == 0.0
    assert value(inputs, 0.1)["acceleration"] == pytest.approx(10.0)
    assert value(inputs, 0.3, left=True)["acceleration"] == pytest.approx(10.0)
    assert value(inputs, 0.3)["acceleration"] == 0.0


@pytest.mark.parametrize(
    ("t", "left", "expected"),
    [(-1.0, False, 1.0), (0.0, False, 1.0), (0.5, True, 1.0), (0.5, False, -2.0), (2.0, True, -2.0), (2.0, False, 7.0)],
)
def test_steps_belong_to_what_follows(t: float, left: bool, expected: float) -> None:
    assert force(steps([0.0, 0.5, 2.0], [1.0, -2.0, 7.0]), t, left=left) == expected
    assert force(table([0.0, 0.5, 2.0], [1.0, -2.0, 7.0], "hold"), t, left=left) == expected


def test_linear_and_cubic_tables() -> None:
    t, y = np.array([0.0, 0.2, 0.3, 1.0]), np.array([1.0, -1.0, 4.0, 2.0])
    spline = CubicSpline(t, y)
    for at in (0.0, 0.07, 0.2, 0.25, 0.31, 0.999):
        assert force(table(t, y), at) == pytest.approx(np.interp(at, t, y), rel=1e-13)
        assert force(table(t, y, "cubic"), at) == pytest.approx(float(spline(at)), rel=1e-13)
        assert value(Inputs(speed=table(t, y, "cubic")), at)["acceleration"] == pytest.approx(float(spline(at, 1)))
    for kind in ("linear", "cubic"):
        assert force(table(t, y, kind), -3.0) == 1.0
        assert force(table(t, y, kind), 5.0) == 2.0


def test_harmonics_and_their_rate() -> None:
    signal = Harmonics(0.5, [2.0, -1.0], [3.0, 40.0], [0.1, 2.0])
    at = value(Inputs(speed=signal), 0.7)
    assert at["speed"] == pytest.approx(0.5 + 2.0 * cos(2.2) - cos(30.0), rel=1e-14)
    assert at["acceleration"] == pytest.approx(-6.0 * sin(2.2) + 40.0 * sin(30.0), rel=1e-14)


@pytest.mark.parametrize(("th2", "expected"), [(0.0, 10.0), (0.5, 7.5), (1.5, 2.5), (-1.0, 15.0)])
def test_torsion_bar(th2: float, expected: float) -> None:
    bar = Inputs(torque=TorsionBar(torque=10.0, release_angle=2.0))
    assert value(bar, 3.0, x=[th2, 0, 0, 0])["torque"] == pytest.approx(expected)


def test_a_torsion_bar_that_unwound_in_one_run_acts_in_the_next_with_the_same_inputs() -> None:
    bar = Inputs(torque=TorsionBar(torque=10.0, release_angle=0.1))
    first, second = (simulate("table-3.1", bar, stop_time=0.2) for _ in range(2))
    assert first["crank.angle"][-1] > 0.1
    assert np.array_equal(first.values, second.values)


def test_a_torsion_bar_is_released_where_it_has_turned_as_far_as_it_was_wound() -> None:
    encoded = encode(Inputs(torque=TorsionBar(torque=10.0, release_angle=2.0)), FIVE_BAR)
    laws = encoded.source.laws.copy()
    release(encoded, np.array([1.999, 0, 0, 0]), laws)
    assert laws.tolist() == encoded.source.laws.tolist()
    release(encoded, np.array([2.0, 0, 0, 0]), laws)
    assert laws[0].tolist() == [*encoded.source.laws[0, :2], 0.0, *encoded.source.laws[0, 3:]]


@pytest.mark.parametrize("speed", [-20.0, 0.0, 30.0, 49.9, 50.0, 80.0])
def test_induction_motor_is_kloss_formula(speed: float) -> None:
    motor = Inputs(torque=InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=50.0))
    slip = 1.0 - speed / 50.0
    expected = 2.0 * 5.0 / (slip / 0.2 + 0.2 / slip) if slip else 0.0
    assert value(motor, 3.0, x=[0, 0, speed, 0])["torque"] == pytest.approx(expected, rel=1e-13)


def test_functions_see_time_and_state() -> None:
    at = value(
        Inputs(
            torque=Function(lambda t, th2, u, w2, v: t + 10 * th2),
            force=Function(lambda t, th2, u, w2, v: u),
            load_x=Function(lambda t, th2, u, w2, v: w2),
            load_y=Function(lambda t, th2, u, w2, v: v),
        ),
        0.5,
        x=[1.0, 2.0, 3.0, 4.0],
    )
    assert at == {"torque": 10.5, "speed": 0.0, "acceleration": 0.0, "force": 2.0, "load_x": 3.0, "load_y": 4.0}
    speed = Function(lambda t, th2, u, w2, v: t * t, rate=lambda t, th2, u, w2, v: 2.0 * t)
    at = value(Inputs(speed=speed), 3.0)
    assert (at["speed"], at["acceleration"]) == (9.0, 6.0)


def test_tuple_of_signals_is_their_sum() -> None:
    parts = (
        2.0,
        ramp(0.0, 1.0, 0.0, 1.0),
        Harmonics(0.0, [1.0], [2.0], [0.0]),
        TorsionBar(torque=3.0),
        InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=50.0),
        Function(lambda t, th2, u, w2, v: 7.0),
    )
    x = [0.25, 0.0, 40.0, 0.0]
    single = [value(Inputs(torque=part), 0.3, x=x)["torque"] for part in parts]
    assert value(Inputs(torque=parts), 0.3, x=x)["torque"] == pytest.approx(sum(single), rel=1e-14)


def test_signals_with_breaks_of_their_own_are_not_changed_by_being_brought_together() -> None:
    source = np.random.default_rng(7)
    signals = {}
    for channel in ("torque", "force", "load_x", "load_y"):
        breaks = np.cumsum(source.uniform(0.05, 0.5, 6)) - 1.0
        signals[channel] = Piecewise(breaks, source.normal(size=(5, 4)))
    together = Inputs(**signals)
    for t in source.uniform(-2.0, 4.0, 60):
        at = value(together, t)
        for channel, signal in signals.items():
            i = int(np.clip(np.searchsorted(signal.breaks, t, side="right") - 1, 0, 4))
            expected = np.polyval(signal.coefficients[i][::-1], t - signal.breaks[i])
            assert at[channel] == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_all_breaks_of_a_function_are_breaks_inside() -> None:
    # the outermost of the merged breaks bound nothing: pieces go on beyond them
    for breaks in ([0.3], [0.1, 0.3]):
        encoded = encode(Inputs(force=Function(lambda t, th2, u, w2, v: 0.0, breaks=breaks)), FIVE_BAR)
        assert encoded.source.breaks[1:-1].tolist() == breaks


def test_breaks_that_miss_a_sample_by_rounding_are_moved_onto_it() -> None:
    times = 0.1 * np.arange(11)
    assert times[3] != 0.3
    moved = align(encode(Inputs(force=steps([0.0, 0.3, 0.55], [0.0, 1.0, 2.0])), FIVE_BAR), times)
    assert moved.source.breaks[1] == times[3]
    assert moved.source.breaks[2] == 0.55
    # the last sample too
    beside = np.nextafter(times[-1], 0.0)
    moved = align(encode(Inputs(force=steps([0.0, 0.3, beside], [0.0, 1.0, 2.0])), FIVE_BAR), times)
    assert moved.source.breaks[2] == times[-1] != beside
    # late in the day a float misses by more than a billionth of a step
    late = 1e6 + 1e-3 * np.arange(101)
    breaks = np.nextafter(late[[20, 50, 70]], np.inf)
    moved = align(encode(Inputs(force=steps(breaks, [0.0, 1.0, 2.0])), FIVE_BAR), late)
    assert moved.source.breaks[:3].tolist() == late[[20, 50, 70]].tolist()


@pytest.mark.parametrize(
    ("inputs", "steady"),
    [
        (Inputs(torque=3.0, force=1.0), True),
        (Inputs(torque=steps([0.0, 1.0], [1.0, 2.0])), True),
        (Inputs(speed=ramp(0.0, 1.0, 0.0, 1.0)), True),
        (Inputs(force=ramp(0.0, 1.0, 0.0, 1.0)), False),
        (Inputs(load_x=ramp(0.0, 1.0, 0.0, 1.0)), False),
        (Inputs(load_y=ramp(0.0, 1.0, 0.0, 1.0)), False),
        (Inputs(torque=ramp(0.0, 1.0, 0.0, 1.0)), False),
        (Inputs(speed=table([0.0, 0.5, 1.0], [0.0, 1.0, 0.0], "cubic")), False),
        (Inputs(force=Harmonics(0.0, [1.0], [2.0], [0.0])), False),
        (Inputs(torque=InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=50.0)), False),
        (Inputs(force=Function(lambda t, th2, u, w2, v: 0.0)), False),
    ],
)
def test_inputs_that_are_constant_between_breaks(inputs: Inputs, steady: bool) -> None:
    assert encode(inputs, FIVE_BAR).steady is steady


def test_a_signal_keeps_its_numbers_to_itself() -> None:
    breaks = np.array([0.0, 1.0])
    signal = Piecewise(breaks, [[1.0, 0.0, 0.0, 0.0]])
    breaks[0] = 5.0
    assert signal.breaks[0] == 0.0


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Inputs(speed=1.0, torque=1.0), "both speed and torque"),
        (lambda: Inputs(force=nan), "force is nan"),
        (lambda: Inputs(torque=(1.0, inf)), "torque is inf"),
        (lambda: Inputs(load_x="much"), "load_x is 'much'"),
        (lambda: Inputs(torque=()), "a sum has at least one summand"),
        (lambda: Inputs(torque=[]), r"torque is \[\]"),
        (lambda: Inputs(torque=True), "torque is True: it must be a number"),
        (lambda: simulate_many("table-3.1", vary=(), stop_time=1.0), r"vary is \(\): it must be a mapping"),
        (lambda: Inputs(force=TorsionBar(torque=1.0)), "force is TorsionBar"),
        (lambda: Inputs(torque=(TorsionBar(torque=1.0), TorsionBar(torque=2.0))), "more than one TorsionBar"),
        (lambda: Inputs(force=(Function(force), Function(force))), "force has more than one Function"),
        (lambda: Inputs(speed=Function(force)), "needs its rate"),
        (lambda: Inputs(speed=(1.0, Function(force))), "needs its rate"),
        (lambda: Function(3.0), "must be a function"),
        (lambda: Function(force, breaks=[nan]), "finite times"),
        (lambda: steps([0.0, 0.0], [1.0, 2.0]), "must increase"),
        (lambda: table([0.0, 2.0, 1.0], [1.0, 2.0, 3.0]), "must increase"),
        (lambda: table([0.0, 1.0], [1.0, 2.0, 3.0]), r"not \(2,\) and \(3,\)"),
        (lambda: table([[0.0, 1.0]], [[1.0, 2.0]]), "one dimension"),
        (lambda: table([0.0], [1.0]), "at least 2 points"),
        (lambda: steps([], []), "at least 1 point"),
        (lambda: table([0.0, 1.0], [1.0, nan]), "finite"),
        (lambda: table([0.0, 1.0], [1.0, 2.0], "quintic"), "'quintic'"),
        (lambda: ramp(0.0, 1.0, 2.0, 1.0), "from 2.0 s to 1.0 s: it must end after it begins"),
        (lambda: Piecewise([0.0], np.zeros((0, 4))), "at least two breaks"),
        (lambda: Piecewise([0.0, 1.0], [[1.0, 2.0]]), r"shape \(1, 4\)"),
        (lambda: Harmonics(0.0, [1.0], [2.0], []), "as many amplitudes"),
        (lambda: Harmonics(nan), "finite numbers"),
        (lambda: Harmonics(1.0, 5.0, 30.0, 0.3), "must be lists of numbers"),
        (lambda: Harmonics(0.0, [1.0], [inf], [0.0]), "finite numbers"),
        (lambda: TorsionBar(torque=nan), "finite number of N.m"),
        (lambda: TorsionBar(torque=1.0, release_angle=0.0), "above 0 rad"),
        (lambda: TorsionBar(torque="-1 N.m"), "not below zero"),
        (lambda: InductionMotor(breakdown_torque=nan, breakdown_slip=0.2, synchronous_speed=50.0), "breakdown torque"),
        (lambda: InductionMotor(breakdown_torque=1.0, breakdown_slip=0.0, synchronous_speed=50.0), "breakdown slip"),
        (lambda: InductionMotor(breakdown_torque=1.0, breakdown_slip=0.2, synchronous_speed=0.0), "synchronous speed"),
        (lambda: InductionMotor(breakdown_torque=-1.0, breakdown_slip=0.2, synchronous_speed=50.0), "the same sign"),
    ],
)
def test_what_is_not_usable_is_refused_with_a_sentence(make: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()


def test_function_of_a_wrong_kind_of_value() -> None:
    with pytest.raises(InputError, match=r"returned None at t = 0.5 s"):
        value(Inputs(force=Function(lambda t, th2, u, w2, v: None)), 0.5)


@pytest.mark.parametrize(
    ("inputs", "name"),
    [
        (Inputs(force=Function(lambda t, th2, u, w2, v: nan)), "force"),
        (Inputs(torque=Function(lambda t, th2, u, w2, v: inf)), "torque"),
        (Inputs(speed=Function(lambda *x: 1.0, rate=lambda *x: nan)), "acceleration"),
        (Inputs(load_y=Piecewise([0.0, 1.0], [[0.0, 0.0, 0.0, 1e200]])), "load_y"),
    ],
)
def test_input_that_is_not_finite_is_named_with_its_time(inputs: Inputs, name: str) -> None:
    with pytest.raises(InputError, match=f"the input {name} is not a finite number at t = 1e.40 s"):
        value(inputs, 1e40)


def test_inputs_that_a_master_can_hold_without_loss() -> None:
    assert Inputs(speed=3.0, force=1.0).held_exactly
    assert not Inputs(speed=ramp(0.0, 1.0, 0.0, 1.0)).held_exactly
    assert not Inputs(torque=TorsionBar(torque=1.0)).held_exactly


def test_another_mechanism_does_not_change_what_an_input_may_be() -> None:
    """A linkage whose driven slide has a force or a speed in m/s, beside the five-bar with a force and a speed in rad/s."""
    cart = linkage("lone-cart", ground={"A": (0, 0)}).body("cart", points={"P": (0, 0)}, mass="1 kg")
    cart.slide("G", body="cart", through="A").freedom("cart", "G", driven=True, speed="0.1 m/s").mechanism()
    assert Inputs(speed="60 rpm", force=1.0).speed == pytest.approx(2.0 * pi)
    assert Inputs(speed="100 mm/s").speed == pytest.approx(0.1)
    with pytest.raises(InputError, match="rad/s"):
        simulate("lone-cart", Inputs(speed="60 rpm"), stop_time=0.1)
    with pytest.raises(InputError, match="both speed and force"):
        simulate("lone-cart", Inputs(speed=0.1, force=1.0), stop_time=0.1)
    run = simulate("lone-cart", Inputs(speed="100 mm/s"), stop_time=0.1)
    assert run["cart.position"][-1] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("inputs", "constant"),
    [
        (Inputs(speed=40.0, force=-3.0), True),
        (Inputs(torque=2.0), True),
        (Inputs(force=Function(lambda t, th2, u, w2, v: 5.0 * u)), True),
        (Inputs(speed=ramp(0.0, 40.0, 0.0, 1.0)), False),
        (Inputs(force=Harmonics(1.0, [2.0], [30.0], [0.0])), False),
        (Inputs(torque=TorsionBar(torque=10.0, release_angle=2.0)), False),
        (Inputs(torque=InductionMotor(breakdown_torque=10.0, breakdown_slip=0.2, synchronous_speed=50.0)), False),
    ],
)
@pytest.mark.parametrize("ahead", [-inf, 0.35])
def test_constant_inputs_are_those_of_the_compiled_code(inputs: Inputs, constant: bool, ahead: float) -> None:
    """To the last bit; they are not sent there."""
    encoded = encode(inputs, FIVE_BAR)
    source, x = encoded.source, np.array([0.3, 0.002, 41.0, -0.1])
    assert source.is_constant is constant
    compiled = np.zeros(len(FIVE_BAR.channels))
    channels(0.25, ahead, False, x, source, encoded.commands, compiled, np.empty_like(compiled))
    if constant:
        by_function = function_values(encoded, 0.25, x)
        assert (sample(encoded, 0.25, x, source.laws, ahead=ahead) == compiled + by_function).all()
