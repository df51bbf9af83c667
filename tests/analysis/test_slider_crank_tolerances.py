"""Sensitivities of the slider-crank, and what random errors of its dimensions do.

The truth is differences of `force_turn` on changed mechanisms, and distributions that
are known.
"""

from dataclasses import replace
from math import erf, pi, radians, sqrt, tau
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.slider_crank import (
    ANGLE,
    ERRORS,
    PERCENTILES,
    QUANTITIES,
    SHIFT,
    AngleShift,
    ConstantShift,
    ForceTurn,
    GrooveShift,
    ShiftLaw,
    Tolerance,
    force_turn,
    monte_carlo,
    sensitivities,
    tolerance_effects,
)
from analysis.slider_crank.sampling import order_statistics
from linkwork.errors import InputError, ParameterError
from linkwork.parameters import field_name
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, parameters
from tests.refusals import refused

from ..published_rahman import GREATEST_SHIFTS_IN, INCH
from ..slider_cranks import seeded

IDEAL = parameters(0.0)
OFFSET = parameters(10.0)
TOLERANCES = (
    Tolerance("crank.length", 1e-4),
    Tolerance("rod.length", 2e-4, distribution="uniform"),
    Tolerance("guide.offset", 5e-4),
    Tolerance("guide.twist", radians(0.2), distribution="triangular"),
    Tolerance(SHIFT, 5e-4),
    Tolerance(ANGLE, radians(0.05)),
)


#: Angle of a dead centre of the offset mechanism at S1 = 3.5 in.
DEAD = force_turn(OFFSET, crank_speed=CRANK_SPEED, shift=ConstantShift(3.5 * INCH)).dead_centres[0].crank_angle


def offset_turn(angles: Any, **given: Any) -> ForceTurn:
    return force_turn(OFFSET, crank_speed=CRANK_SPEED, shift=ConstantShift(3.5 * INCH), angles=angles, **given)


def slider_position(p: SliderCrankParameters, th: Any, s1: Any, **changes: Any) -> Any:
    """The closed form of the notes, for arrays."""
    names = ("crank_length", "rod_length", "guide_offset", "guide_twist")
    a1, a2, a4, alpha = (changes.get(name, getattr(p, name)) for name in names)
    across = (a1 * np.cos(th) + a4) ** 2 + (a1 * np.sin(th) * np.cos(alpha) - s1 * np.sin(alpha)) ** 2
    return p.assembly_branch * np.sqrt(a2**2 - across) - a1 * np.sin(th) * np.sin(alpha) - s1 * np.cos(alpha)


def changed(p: SliderCrankParameters, name: str, step: float) -> SliderCrankParameters:
    field = field_name(name)
    values: dict[str, Any] = {field: getattr(p, field) + step}
    return replace(p, **values)


def quantities_of(turn: ForceTurn) -> dict[str, Any]:
    """What `QUANTITIES` names, from a force turn."""
    found = {f"slider.{name}": getattr(turn, f"slider_{name}") for name in ("position", "velocity", "acceleration")}
    found |= {"drive.applied_torque": turn.torque, "slider.load": turn.slider_force}
    for joint in ("bearing", "crank_pin", "slider_pin", "guide"):
        for kind, vector in (("f", joint), ("m", f"{joint}_moment")):
            if kind == "f" or joint in ("bearing", "guide"):
                found |= {f"{joint}.{kind}{axis}": turn.vector(vector)[:, i] for i, axis in enumerate("xyz")}
    return found | {"bearing.fz": turn.axial_force}


@pytest.mark.parametrize("law", ["constant", "groove", "groove in the shaft"])
@pytest.mark.parametrize("problem", [{"load": 7.0}, {"torque": 3.0}], ids=["load given", "torque given"])
def test_everything_by_differences(problem: dict[str, Any], law: str) -> None:
    """All quantities by all errors, against differences of fourth order on mechanisms that are changed."""
    case = seeded(11)
    angles = case.state[0] + np.array([0.0, 0.02])
    amplitude = case.parameters.groove_amplitude
    groove = GrooveShift(amplitude, 0.8, in_shaft=law == "groove in the shaft")
    nominal: ShiftLaw = ConstantShift(case.state[1]) if law == "constant" else groove
    mechanism = replace(case.parameters, rod_length=1.5 * case.parameters.rod_length)

    def at(name: str = "", step: float = 0.0) -> dict[str, Any]:
        # an error of the shift is added to the law's; one of the angle leaves it, but that of a groove in the shaft
        place = angles + (step if name == ANGLE else 0.0)
        held = 0.0 if law == "groove in the shaft" else place - angles
        more = step if name == SHIFT else 0.0
        shifted: ShiftLaw = AngleShift(
            lambda th: nominal.at(th - held, 1.0, 0.0).shift + more,
            lambda th: nominal.at(th - held, 1.0, 0.0).velocity,
            lambda th: nominal.at(th - held, 1.0, 0.0).acceleration,
        )
        return quantities_of(
            force_turn(
                mechanism if name in ("", ANGLE, SHIFT) else changed(mechanism, name, step),
                crank_speed=case.state[2],
                crank_acceleration=case.acceleration,
                # a groove in the shaft has its flank's force, that no other law has
                shift=nominal if groove.in_shaft and name != SHIFT else shifted,
                angles=place,
                **problem,
            )
        )

    names = [name for name in ERRORS if not (law == "groove in the shaft" and name == SHIFT)]
    driven = {"crank_speed": case.state[2], "crank_acceleration": case.acceleration}
    turn = force_turn(mechanism, shift=nominal, angles=angles, **driven, **problem)
    found = sensitivities(turn, names)
    assert tuple(found.derivatives) == tuple(QUANTITIES)
    level = float(np.abs(turn.vector("crank_pin")).max())
    scales = {"m": 1.0, "m/s": 20.0, "m/s2": 400.0, "N": level, "N.m": level}
    for quantity, value in at().items():
        assert np.max(np.abs(value - found.values[quantity])) < 1e-12 * scales[QUANTITIES[quantity]]
    for name in names:
        h = 2e-4 * max(0.3, abs(getattr(mechanism, field_name(name), 0.0)))
        places = [at(name, k * h) for k in (-2.0, -1.0, 1.0, 2.0)]
        for quantity in QUANTITIES:
            a, b, c, d = (x[quantity] for x in places)
            slope = (a - 8.0 * b + 8.0 * c - d) / (12.0 * h)
            allowed = 3e-7 * (np.abs(slope).max() + scales[QUANTITIES[quantity]])
            assert np.max(np.abs(found.derivative(quantity, name) - slope)) < allowed, (quantity, name)


def test_motion_alone_is_the_motion_with_the_forces() -> None:
    """Where no force is asked for the motion is calculated by itself."""
    case = seeded(4)
    driven = {"crank_speed": case.state[2], "crank_acceleration": case.acceleration, "shift": GrooveShift(0.03, 1.3)}
    turn = force_turn(case.parameters, angles=case.state[0] + np.array([0.0, 0.01]), partial=True, **driven)
    motion = ("slider.position", "slider.velocity", "slider.acceleration")
    alone, whole = sensitivities(turn, quantities=motion), sensitivities(turn)
    for name in motion:
        assert alone.values[name].data == pytest.approx(whole.values[name].data, rel=1e-12)
        assert alone.derivatives[name].data == pytest.approx(whole.derivatives[name].data, rel=1e-10)


def test_masked_at_a_dead_centre_but_what_the_load_has_no_part_in() -> None:
    turn = force_turn(IDEAL, crank_speed=CRANK_SPEED, torque=CRANK_TORQUE, angles=[0.3, 0.5 * pi])
    found = sensitivities(turn)
    for name in QUANTITIES:
        free = name.startswith(("slider.p", "slider.v", "slider.a", "drive.", "guide.m"))
        for values in (found.values[name], found.derivatives[name][0], found.derivatives[name][-1]):
            assert np.ma.getmaskarray(values).tolist() == [False, not free]
    assert (found.derivatives["drive.applied_torque"] == 0.0).all()


@pytest.mark.parametrize(
    ("distribution", "ratio", "kurtosis"),
    [("normal", 3.0, 3.0), ("uniform", sqrt(3.0), 9.0 / 5.0), ("triangular", sqrt(6.0), 12.0 / 5.0)],
)
def test_distributions(distribution: str, ratio: float, kurtosis: float) -> None:
    tolerance = Tolerance("rod.length", 0.6, distribution=distribution)
    assert tolerance.deviation == pytest.approx(0.6 / ratio)
    x = tolerance.draw(np.random.default_rng(1), 400_000)
    assert x.mean() == pytest.approx(0.0, abs=5.0 * 0.6 / sqrt(400_000))
    assert x.std() == pytest.approx(0.6 / ratio, rel=0.01)
    assert (x**4).mean() / (x**2).mean() ** 2 == pytest.approx(kurtosis, rel=0.03)
    if distribution != "normal":
        assert 0.59 < np.abs(x).max() <= 0.6
    # the same of the estimate to second order: S4 = sqrt(a2^2 - x^2) at 90 deg, less a constant
    turn = force_turn(IDEAL, crank_speed=1.0, angles=[0.5 * pi])
    deviation = 1e-3
    shift = Tolerance(SHIFT, ratio * deviation, distribution=distribution)
    second = tolerance_effects(turn, [shift])["slider.position"]
    h = IDEAL.rod_length
    assert second.deviation[0] < 1e-18
    assert second.second_mean[0] - second.nominal[0] == pytest.approx(-(deviation**2) / (2.0 * h), rel=1e-6)
    assert second.second_deviation[0] == pytest.approx(deviation**2 / (2.0 * h) * sqrt(kurtosis - 1.0), rel=1e-6)
    assert np.ma.getmaskarray(second.shares).all()
    assert second.second_shares.tolist() == [[1.0]]


def test_two_errors_together() -> None:
    """At theta1 = 90 deg, S1 = 0 and alpha4 = 270 deg: S4 = a1 cos(x) - y sin(x) + sqrt(a2^2 - (a1 sin(x) + y cos(x))^2)
    for errors x of the twist and y of the shift; its second derivatives by hand."""
    dx, dy = 2e-3, 3e-3
    a1, a2 = IDEAL.crank_length, IDEAL.rod_length
    turn = force_turn(IDEAL, crank_speed=1.0, angles=[0.5 * pi])
    tolerances = [Tolerance("guide.twist", 3.0 * dx), Tolerance(SHIFT, 3.0 * dy)]
    found = tolerance_effects(turn, tolerances)["slider.position"]
    hxx, hxy, hyy = (-a1 - a1 * a1 / a2) * dx * dx, (-1.0 - a1 / a2) * dx * dy, -dy * dy / a2
    assert found.second_mean[0] - found.nominal[0] == pytest.approx(0.5 * (hxx + hyy), rel=1e-4)
    variance = 0.5 * hxx**2 + hxy**2 + 0.5 * hyy**2
    assert found.second_deviation[0] == pytest.approx(sqrt(variance), rel=1e-4)
    shares = (0.5 * hxx**2 + 0.5 * hxy**2) / variance, (0.5 * hyy**2 + 0.5 * hxy**2) / variance
    assert found.second_shares[:, 0].tolist() == pytest.approx(shares, rel=1e-3)


def test_linear_estimate_is_the_sum_of_variances() -> None:
    turn = offset_turn(np.linspace(0.0, tau, 13))
    quantities = ("slider.position", "crank_pin.fy")
    found = tolerance_effects(turn, TOLERANCES, quantities)
    slopes = sensitivities(turn, [t.name for t in TOLERANCES], quantities)
    for name in quantities:
        parts: Any = [(slopes.derivative(name, t.name) * t.deviation) ** 2 for t in TOLERANCES]
        assert found[name].deviation.data ** 2 == pytest.approx(sum(parts).data)
        assert found[name].shares.sum(axis=0).data == pytest.approx(np.ones(13))
        assert (found[name].shares[3] * sum(parts)).data == pytest.approx(parts[3].data)
        worst: Any = sum(np.abs(slopes.derivative(name, t.name)) * t.half_width for t in TOLERANCES)
        assert found[name].worst.data == pytest.approx(worst.data)
        assert found[name].second_shares.sum(axis=0).data == pytest.approx(np.ones(13))


def test_samples_are_those_of_the_closed_form() -> None:
    """Mean, deviation, percentiles and histogram against NumPy's of the closed form, with the same draws."""
    samples, angles = 40_000, np.array([0.2, 2.0, 5.0])
    twice = ("slider.position", "slider.position")
    result = monte_carlo(offset_turn(angles), TOLERANCES, quantities=twice, samples=samples, seed=5)
    generator = np.random.default_rng(5)
    x = {t.name: t.draw(generator, samples) for t in TOLERANCES}
    spread = result.spreads["slider.position"]
    lengths = {field_name(name): x[name] for name in ("crank.length", "rod.length", "guide.offset", "guide.twist")}
    off = {name: getattr(OFFSET, name) + error for name, error in lengths.items()}
    for i, th in enumerate(angles):
        values = slider_position(OFFSET, th + x[ANGLE], 3.5 * INCH + x[SHIFT], **off)
        assert spread.mean[i] == pytest.approx(values.mean(), abs=1e-13)
        assert spread.deviation[i] == pytest.approx(values.std(ddof=1), rel=1e-9)
        assert result.standard_error("slider.position")[i] == pytest.approx(values.std() / samples**0.5, rel=1e-4)
        assert spread.percentiles[:, i].data == pytest.approx(np.percentile(values, PERCENTILES), abs=1e-13)
        assert (spread.least[i], spread.greatest[i]) == pytest.approx((values.min(), values.max()), abs=1e-13)
        # a value on an edge may fall to either side
        assert np.abs(spread.counts[i] - np.histogram(values, spread.edges[i])[0]).max() <= 2
        assert spread.counts[i].sum() == pytest.approx(0.999 * samples, abs=3)
        assert spread.edges[i, [0, -1]] == pytest.approx(np.percentile(values, [0.05, 99.95]), abs=1e-7)
    assert not result.not_assembled.any()
    assert result.notes() == ()
    same = monte_carlo(offset_turn(angles), TOLERANCES, samples=samples, seed=5)
    other = monte_carlo(offset_turn(angles), TOLERANCES, samples=samples, seed=6)
    assert (same.spreads["slider.position"].mean == spread.mean).all()
    assert (other.spreads["slider.position"].mean != spread.mean).all()


@given(st.lists(st.sampled_from([0.0, 1.0, -3.0, 1e-3, 1e12, 5e-324]) | st.floats(-1e3, 1e3), min_size=2, max_size=300))
def test_order_statistics_are_those_of_the_sorted_values(values: list[float]) -> None:
    found = order_statistics(np.array(values), np.arange(len(values))[::3])
    assert found.tolist() == sorted(values)[::3]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of the linear estimate
@pytest.mark.parametrize("speed", [1e100, 1e160])
def test_samples_with_a_variance_beyond_all_numbers_are_refused(speed: float) -> None:
    turn = force_turn(OFFSET, crank_speed=speed, angles=[0.5])
    with pytest.raises(InputError, match=r"slider.acceleration is .* m/s2"):
        monte_carlo(turn, TOLERANCES, quantities=["slider.acceleration"], samples=50)


@pytest.mark.parametrize("problem", [{"load": 40.0}, {"torque": CRANK_TORQUE}], ids=["load given", "torque given"])
def test_samples_with_a_groove_are_mechanisms_changed(problem: dict[str, Any]) -> None:
    """The error of the crank's angle moves the shift, too, as the groove in the shaft makes it."""
    given_law = {"crank_speed": CRANK_SPEED, "shift": GrooveShift(0.05, 2.0, in_shaft=True), **problem}
    tolerances = Tolerance(ANGLE, 0.01), Tolerance("rod.length", 2e-3)
    turn = force_turn(OFFSET, angles=[0.7], **given_law)
    result = monte_carlo(turn, tolerances, quantities=tuple(QUANTITIES), samples=5)
    generator = np.random.default_rng(0)
    angles, lengths = (t.draw(generator, 5) for t in tolerances)
    mechanisms = [changed(OFFSET, "rod.length", length) for length in lengths]
    turns = [force_turn(m, angles=[0.7 + angle], **given_law) for angle, m in zip(angles, mechanisms)]
    for name in QUANTITIES:
        values = [float(quantities_of(turn)[name][0]) for turn in turns]
        assert result.spreads[name].mean[0] == pytest.approx(np.mean(values), rel=1e-9, abs=1e-12)
        assert result.spreads[name].greatest[0] == pytest.approx(max(values), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("problem", [{"load": 40.0}, {"torque": CRANK_TORQUE}], ids=["load given", "torque given"])
def test_samples_of_forces_are_mechanisms_changed(problem: dict[str, Any]) -> None:
    samples = 7
    tolerances = (*TOLERANCES[:4], Tolerance(SHIFT, 5e-4), Tolerance("rod.mass", 0.5), Tolerance("crank.inertia", 0.01))
    turn = offset_turn([0.7], **problem)
    result = monte_carlo(turn, tolerances, quantities=tuple(QUANTITIES), samples=samples, seed=2)
    generator = np.random.default_rng(2)
    x = {t.name: t.draw(generator, samples) for t in tolerances}
    found = []
    for k in range(samples):
        mechanism = OFFSET
        for name, errors in x.items():
            if name != SHIFT:
                mechanism = changed(mechanism, name, float(errors[k]))
        shift = ConstantShift(3.5 * INCH + float(x[SHIFT][k]))
        driven = {"crank_speed": CRANK_SPEED, "shift": shift}
        found.append(quantities_of(force_turn(mechanism, angles=[0.7], **driven, **problem)))
    for name in QUANTITIES:
        values = np.array([float(f[name][0]) for f in found])
        spread = result.spreads[name]
        assert (spread.least[0], spread.greatest[0]) == pytest.approx((values.min(), values.max()), rel=1e-9, abs=1e-12)
        assert spread.percentiles[2, 0] == pytest.approx(np.median(values), rel=1e-9, abs=1e-12)


def test_where_the_first_derivatives_vanish_a_note_says_so() -> None:
    turn = force_turn(IDEAL, crank_speed=1.0, angles=[0.0, 0.5 * pi])
    tolerances = [Tolerance("guide.offset", 5e-3), Tolerance(SHIFT, 5e-3), Tolerance("guide.twist", radians(0.5))]
    result = monte_carlo(turn, tolerances, samples=200_000)
    spread, found = result.spreads["slider.position"], result.estimates["slider.position"]
    assert result.linear_misses("slider.position").tolist() == [False, True]
    assert spread.deviation.data == pytest.approx(found.second_deviation.data, rel=0.02)
    assert spread.mean[1] == pytest.approx(found.second_mean[1], abs=0.02 * found.second_deviation[1])
    (message,) = result.notes()
    assert "slider.position is off at crank angle 90 deg: its first derivatives vanish" in message


@given(st.integers(0, 3))
def test_samples_that_cannot_be_assembled_are_counted(seed: int) -> None:
    """Ideal but for the shift, which has a normal error around its limit less one standard deviation: 15.9 % are beyond."""
    limit, samples, deviation = GREATEST_SHIFTS_IN[0.0] * INCH, 20_000, 1e-3
    turn = force_turn(IDEAL, crank_speed=1.0, shift=ConstantShift(limit - deviation), angles=[0.0, 0.5 * pi])
    result = monte_carlo(turn, [Tolerance(SHIFT, 3.0 * deviation)], samples=samples, seed=seed)
    # the plant keeps clear of the limit by a sine of 1e-3, which is 0.67 micrometres of shift here; at 90 deg all assemble
    beyond = 0.5 * (1.0 - erf(1.0 / sqrt(2.0))) * samples
    assert abs(result.not_assembled[0] - beyond) < 5.0 * sqrt(beyond) + 0.002 * samples
    assert result.not_assembled[1] == 0
    assert not result.undetermined.any()
    assert result.notes()[0].startswith(f"{result.not_assembled[0]} of 20000 samples (1")
    assert "cannot be assembled at crank angle 0 deg, the most of any angle" in result.notes()[0]
    spread = result.spreads["slider.position"]
    assert spread.least[0] > 0.0
    assert spread.counts[0].sum() <= samples - result.not_assembled[0]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"seed": -1}, "seed is -1: it must be at least 0"),
        ({"seed": 1.5}, "seed is 1.5: it must be a whole number"),
        ({"seed": None}, "seed is None: it must be a whole number"),
        ({"quantities": "slider.position"}, r"it must be a list of names, such as \['slider.position'\]"),
    ],
)
def test_a_sampling_that_cannot_be_repeated_or_has_no_list(options: dict[str, Any], said: str) -> None:
    with pytest.raises((InputError, ParameterError), match=said):
        monte_carlo(offset_turn([0.5]), TOLERANCES, samples=10, **options)


def test_where_hardly_any_sample_can_be_assembled_nothing_is_made_up() -> None:
    limit = GREATEST_SHIFTS_IN[0.0] * INCH
    turn = force_turn(IDEAL, crank_speed=1.0, shift=ConstantShift(limit - 1e-5), angles=[0.0])
    result = monte_carlo(turn, [Tolerance("rod.length", 1.0, distribution="uniform")], samples=2, seed=3)
    draws = Tolerance("rod.length", 1.0, distribution="uniform").draw(np.random.default_rng(3), 2)
    assert (draws < 0.0).all()
    assert result.not_assembled.tolist() == [2]
    spread = result.spreads["slider.position"]
    assert spread.mean.mask.tolist() == [True]
    assert np.ma.getmaskarray(spread.percentiles).all()
    assert np.ma.getmaskarray(result.estimates["slider.position"].second_deviation).tolist() == [True]


def test_angles_that_the_nominal_mechanism_cannot_reach_are_reported() -> None:
    shift = ConstantShift((GREATEST_SHIFTS_IN[0.0] + 1.0) * INCH)
    turn = force_turn(IDEAL, crank_speed=1.0, shift=shift, angles=[0.0, 1.0, 2.0], partial=True)
    assert turn.unreachable.tolist() == [0.0]
    result = monte_carlo(turn, [Tolerance("rod.length", 1e-5)], samples=10)
    assert result.notes() == ("1 crank angles are left out: the nominal mechanism cannot be assembled there",)


def test_across_a_dead_centre_there_is_no_mean() -> None:
    turn = offset_turn([DEAD - 0.5, DEAD + 1e-5], torque=CRANK_TORQUE)
    result = monte_carlo(turn, TOLERANCES, quantities=("slider.load", "guide.mx", "slider.position"), samples=20_000)
    load = result.spreads["slider.load"]
    assert np.ma.getmaskarray(load.mean).tolist() == [False, True]
    assert np.ma.getmaskarray(load.deviation).tolist() == [False, True]
    assert not np.ma.getmaskarray(load.percentiles).any()
    assert load.percentiles[0, 1] < -1e3 < 1e3 < load.percentiles[-1, 1]
    assert load.counts[1].sum() == pytest.approx(0.999 * 20_000, abs=3)
    # neither is there an estimate, and it is reported as off
    assert result.linear_misses("slider.load").tolist() == [False, True]
    linear = result.estimates["slider.load"]
    for values in (linear.deviation, linear.worst, linear.second_mean, linear.second_deviation, *linear.shares):
        assert np.ma.getmaskarray(values).tolist() == [False, True]
    assert not np.ma.getmaskarray(linear.nominal).any()
    for name in ("guide.mx", "slider.position"):
        assert not np.ma.getmaskarray(result.estimates[name].deviation).any()
        assert not np.ma.getmaskarray(result.spreads[name].mean).any()
    assert sum("samples on both sides of a dead centre" in m and "slider.load" in m for m in result.notes()) == 1
    # where the load is given the same place is like any other
    free = offset_turn([DEAD], load=3.0)
    assert monte_carlo(free, TOLERANCES, quantities=("crank_pin.fx",), samples=2000).notes() == ()


def test_an_estimate_ends_where_the_tolerances_reach_the_dead_centre() -> None:
    """An error of the crank angle reaches as far as it is wide, with no samples too."""
    width = 1e-3
    turn = offset_turn(DEAD + width * np.array([-1.05, -0.95, 0.95, 1.05]), torque=CRANK_TORQUE)
    tolerances = [Tolerance(ANGLE, width)]
    found = tolerance_effects(turn, tolerances, ("slider.load", "slider.position"))
    assert np.ma.getmaskarray(found["slider.load"].deviation).tolist() == [False, True, True, False]
    assert not np.ma.getmaskarray(found["slider.position"].deviation).any()
    # hardly a sample of a normal error is as far out as three standard deviations
    few = monte_carlo(turn, tolerances, quantities=("slider.load",), samples=10, seed=1)
    assert not np.ma.getmaskarray(few.spreads["slider.load"].mean).any()
    assert few.linear_misses("slider.load")[1:3].all()
    assert "the tolerances reach a dead centre from crank angle 9" in few.notes()[0]


def test_samples_that_are_no_mechanism_are_reported() -> None:
    turn = offset_turn([0.3])
    count = 2000
    wide = Tolerance("rod.length", 6.0)
    below = int((OFFSET.rod_length + wide.draw(np.random.default_rng(4), count) <= 0.0).sum())
    with pytest.raises(InputError, match=rf"tolerance of rod\.length .* in {below} of {count} samples .* above zero"):
        monte_carlo(turn, [wide], samples=count, seed=4)
    with pytest.raises(InputError, match=r"tolerance of slider\.mass .* it is below zero"):
        monte_carlo(turn, [Tolerance("slider.mass", 50.0)], samples=count)
    # each by itself is a crank, both together are not: inertia against mass times the square of its centre's distance
    steiner = OFFSET.crank_mass * OFFSET.crank_cog_x**2
    slack = OFFSET.crank_inertia - steiner
    inertia = Tolerance("crank.inertia", 0.9 * slack, distribution="uniform")
    apart = 0.9 * (sqrt(OFFSET.crank_inertia / OFFSET.crank_mass) - OFFSET.crank_cog_x)
    centre = Tolerance("crank.cog_x", apart, distribution="uniform")
    for one in (inertia, centre):
        monte_carlo(turn, [one], samples=count)
    generator = np.random.default_rng(0)
    drawn = [t.draw(generator, count) for t in (inertia, centre)]
    bad = int((OFFSET.crank_inertia + drawn[0] < OFFSET.crank_mass * (OFFSET.crank_cog_x + drawn[1]) ** 2).sum())
    assert 0 < bad < count
    with pytest.raises(InputError, match=rf"crank\.inertia and that of crank\.cog_x .* in {bad} of {count} samples"):
        monte_carlo(turn, [inertia, centre], samples=count)


def test_samples_at_a_dead_centre_itself_are_counted() -> None:
    """A tolerance that does not move the crank pin off the guide's foot: at 90 deg the ideal mechanism stays dead."""
    turn = force_turn(IDEAL, crank_speed=CRANK_SPEED, torque=CRANK_TORQUE, angles=[0.5 * pi, 1.0])
    result = monte_carlo(turn, [Tolerance("rod.length", 1e-4)], quantities=("slider.load",), samples=500)
    assert result.undetermined.tolist() == [500, 0]
    assert np.ma.getmaskarray(result.spreads["slider.load"].percentiles)[0].tolist() == [True, False]
    assert "500 samples are at a dead centre" in result.notes()[0]
    with pytest.raises(InputError, match=r"slider\.load is not determined at crank angle 90 deg"):
        result.place("slider.load", 0.5 * pi)


@pytest.mark.parametrize("repeats", [True, False])
def test_the_place_of_an_angle_of_another_turn(repeats: bool) -> None:
    zero = np.zeros_like
    law = ConstantShift(0.0) if repeats else AngleShift(zero, zero, zero)
    turn = force_turn(OFFSET, crank_speed=5.0, shift=law, angles=["10 deg", "30 deg", "350 deg"])
    found = monte_carlo(turn, [Tolerance("rod.length", 1e-5)], samples=10)
    places = [found.place("slider.position", f"{angle} deg") for angle in (32, 355, -10, 370)]
    assert places == ([1, 2, 2, 0] if repeats else [1, 2, 0, 2])


def test_two_samples_do_not_refute_the_linear_estimate() -> None:
    turn, tolerances = offset_turn([0.3, 2.0]), [Tolerance("rod.length", 1e-5)]
    found = [monte_carlo(turn, tolerances, samples=2, seed=seed) for seed in range(40)]
    assert not any(one.linear_misses("slider.position").any() or one.notes() for one in found)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("crank.colour", 1.0), ParameterError, "crank.colour"),
        (("groove.amplitude", 1.0), ParameterError, "groove.amplitude"),
        (("rod.length", None), InputError, "rod.length"),
        (("rod.length", [1e-3]), InputError, "rod.length"),
        (("rod.length", 0.0), InputError, "rod.length"),
        (("rod.length", np.nan), InputError, "rod.length"),
        (("rod.length", 1.0, "cauchy"), InputError, "'cauchy'.*normal, uniform, triangular"),
    ],
)
def test_wrong_tolerances_are_reported(arguments: tuple[Any, ...], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Tolerance(*arguments)


def test_wrong_input_is_reported() -> None:
    turn = offset_turn([0.3])
    refused(ParameterError, r"crank_pin\.f", sensitivities, turn, quantities=["crank_pin.f"])
    refused(ParameterError, r"rod\.colour", sensitivities, turn, ["rod.colour"])
    with pytest.raises(InputError, match=r"rod\.length is given 2 times"):
        sensitivities(turn, ["rod.length", "guide.twist", "rod.length"])
    refused(ParameterError, r"rod\.mass", sensitivities(turn).derivative, "slider.position", "rod.mass")
    refused(InputError, "no tolerance", monte_carlo, turn, [])
    with pytest.raises(InputError, match=r"2 tolerances of rod\.length"):
        tolerance_effects(turn, [Tolerance("rod.length", 1.0), Tolerance("rod.length", 2.0)])
    refused(ParameterError, "samples is 1: it must be at least 2", monte_carlo, turn, TOLERANCES, samples=1)
    refused(ParameterError, r"crank_pin\.fx", monte_carlo(turn, TOLERANCES, samples=10).place, "crank_pin.fx", 0.3)
