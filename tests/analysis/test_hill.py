"""Linear equations with periodic coefficients: three ways to their stability, and verdicts on it."""

from collections.abc import Callable
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

from analysis import periodic, youssef
from analysis.numerics.fourier import FourierSeries
from analysis.periodic import Crossing, Stability, crossing_test, liouville, verdict
from analysis.youssef import PeriodicEquation, boundary_stiffnesses, hill_regions, monodromy, perturbed_region
from linkwork.errors import InputError
from linkwork.five_bar.published import chapter_4


def series(*pairs: tuple[float, float]) -> FourierSeries:
    cos, sin = zip(*pairs)
    return FourierSeries(np.array(cos), np.array(sin))


#: Mass, damping and stiffness that all vary, none symmetric, b not a'.
GENERAL = PeriodicEquation(
    a=series((1.3, 0.0), (0.2, -0.1), (0.05, 0.07)),
    b=series((0.15, 0.0), (-0.3, 0.2), (0.0, 0.1), (0.02, 0.0)),
    c=series((0.9, 0.0), (0.3, 0.25), (-0.1, 0.2)),
)


def integrated(equation: PeriodicEquation) -> np.ndarray:
    """Monodromy matrix by SciPy's integrator."""

    def rate(x: float, y: np.ndarray) -> np.ndarray:
        a, b, c = (float(s(x)) for s in (equation.a, equation.b, equation.c))
        return np.concatenate([y[2:], -(b * y[2:] + c * y[:2]) / a])

    end = solve_ivp(rate, (0.0, 2.0 * pi), np.eye(2).ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end.reshape(2, 2)


def slider(inertia_ratio: float, sigma2: float | None = None) -> youssef.SliderEquation:
    """The slider's equation of chapters IV and V, of which M and K do not depend on the speed."""
    mechanism = chapter_4(inertia_ratio)
    if sigma2 is not None:
        mechanism = replace(mechanism, crank_length=sigma2 * mechanism.rocker_length)
    return youssef.slider_equation(mechanism, 60.0)


def without_spring(equation: youssef.SliderEquation, damping: float = 0.0) -> PeriodicEquation:
    return replace(equation, damping=damping).homogeneous()


# Floquet


def test_monodromy_against_scipy() -> None:
    assert monodromy(GENERAL) == pytest.approx(integrated(GENERAL), abs=1e-10)


def test_integration_is_of_order_twelve() -> None:
    steps = np.array([2, 3, 4, 6, 8, 10])
    errors = [np.abs(monodromy(GENERAL, steps=int(n)) - monodromy(GENERAL, steps=60)).max() for n in steps]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(12.0, abs=1.0)


def test_default_steps_leave_rounding() -> None:
    assert monodromy(GENERAL) == pytest.approx(monodromy(GENERAL, steps=60), abs=1e-13)
    fast = GENERAL.stiffened(2000.0)
    assert monodromy(fast) == pytest.approx(monodromy(fast, steps=1000), abs=1e-10)


def test_determinant_is_liouvilles() -> None:
    assert np.linalg.det(monodromy(GENERAL)) == pytest.approx(youssef.determinant(GENERAL), abs=1e-14)
    trace = -GENERAL.b(np.linspace(0.0, 2.0 * pi, 200, endpoint=False))
    assert liouville(trace) == pytest.approx(np.exp(-2.0 * pi * GENERAL.b.mean))


def test_self_adjoint_equation_keeps_the_determinant_in_every_step() -> None:
    equation = without_spring(slider(1.0)).stiffened(0.26)
    assert np.linalg.det(monodromy(equation, steps=2)) == pytest.approx(1.0, abs=1e-14)


def test_many_at_once_are_each_alone() -> None:
    equations = [GENERAL.stiffened(x) for x in np.linspace(-0.5, 1.0, 7)] + [PeriodicEquation.mathieu(1.0, 0.3)]
    together = youssef.monodromies(equations, steps=30)
    for equation, matrix in zip(equations, together):
        assert matrix == pytest.approx(monodromy(equation, steps=30), abs=1e-14)


# Mathieu


@pytest.mark.parametrize("q", [0.05, 0.5, 2.0, 8.0])
@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_mathieus_tongues(q: float, number: int) -> None:
    """By Hill and by integration, against SciPy's characteristic values."""
    expected = sorted([mathieu_a(number, q), mathieu_b(number, q)])
    region = hill_regions(PeriodicEquation.mathieu(0.0, q), 4)[number]
    assert (region.low, region.high) == pytest.approx(expected, abs=1e-10)

    def test(p: float) -> float:
        return float(crossing_test(monodromy(PeriodicEquation.mathieu(p, q)), (-1) ** number))

    # from outside, where the other boundary is far, to the middle of the region
    middle, width = 0.5 * sum(expected), expected[1] - expected[0]
    for boundary, side in zip(expected, (-1.0, 1.0)):
        if width < 1e-4:
            # the test is nearly a square there, and known to rounding only
            assert abs(test(boundary)) < 1e-12
            continue
        assert brentq(test, middle, boundary + side * 0.4 * width, xtol=1e-12) == pytest.approx(boundary, abs=1e-8)


def test_mathieu_below_all_regions() -> None:
    """The least boundary of the multiplier +1 has no partner."""
    values = boundary_stiffnesses(PeriodicEquation.mathieu(0.0, 2.0), 1, count=3)
    assert values == pytest.approx([mathieu_a(0, 2.0), mathieu_b(2, 2.0), mathieu_a(2, 2.0)], abs=1e-10)


# Hill


@pytest.mark.slow
@given(st.integers(0, 10_000))
@settings(max_examples=15)
def test_hills_multipliers_are_those_of_the_monodromy(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b, c = random.uniform(-0.25, 0.25, (3, 2, 4))
    stiffness = FourierSeries(*c) + random.uniform(-1.0, 5.0)
    equation = PeriodicEquation(a=FourierSeries(*a) + 1.5, b=FourierSeries(*b), c=stiffness)
    matrix = monodromy(equation)
    by_hill = youssef.hill_multipliers(equation)
    # sum and product: where two multipliers meet each of them is known to the root of rounding only
    assert by_hill.sum() == pytest.approx(np.trace(matrix), rel=1e-6, abs=1e-6)
    assert by_hill.prod() == pytest.approx(np.linalg.det(matrix), rel=1e-6, abs=1e-6)


def test_boundaries_with_damping_are_where_the_multiplier_is() -> None:
    for multiplier in (1, -1):
        values = boundary_stiffnesses(GENERAL, multiplier, count=5)
        real = values[np.abs(values.imag) < 1e-9].real
        assert len(real) > 0
        assert crossing_test(youssef.monodromies([GENERAL.stiffened(x) for x in real]), multiplier) == pytest.approx(
            np.zeros(len(real)), abs=1e-10
        )


def test_damping_removes_regions_one_by_one() -> None:
    equation = PeriodicEquation.mathieu(0.0, 1.0)
    assert list(hill_regions(equation, 4)) == [1, 2, 3, 4]
    assert list(hill_regions(PeriodicEquation.mathieu(0.0, 1.0, damping=0.5), 4)) == [1]
    assert hill_regions(PeriodicEquation.mathieu(0.0, 1.0, damping=1.2), 4) == {}


# Perturbation


@pytest.mark.parametrize(("order", "rate"), [(1, 2.0), (2, 3.0)])
def test_perturbed_boundaries_approach_the_right_ones(order: int, rate: float) -> None:
    """The error falls with the power of sigma2 that follows the last one taken in."""
    lengths = np.array([0.005, 0.01, 0.02])
    errors = []
    for sigma2 in lengths:
        equation = slider(1.0, sigma2)
        right = hill_regions(without_spring(equation), 1)[1]
        found = perturbed_region(without_spring(equation), 1, order=order)
        errors.append((abs(found.low - right.low), abs(found.high - right.high)))
    rates = np.polyfit(np.log(lengths), np.log(errors), 1)[0]
    assert rates == pytest.approx([rate, rate], abs=0.2)


def test_second_region_needs_the_second_order() -> None:
    """Its width is of second order, and the first harmonics make part of it."""
    equation = slider(1.0, 0.02)
    right = hill_regions(without_spring(equation), 2)[2]
    first, second = (perturbed_region(without_spring(equation), 2, order=order) for order in (1, 2))
    assert second.width == pytest.approx(right.width, rel=2e-5)
    assert abs(first.width / right.width - 1.0) > 5e-3


@pytest.mark.parametrize("factor", [0.0, 0.5, 0.9])
def test_perturbed_boundaries_with_damping(factor: float) -> None:
    equation = slider(1.0)
    damping = factor * youssef.perturbed_removing_damping(without_spring(equation), 1)
    right = hill_regions(without_spring(equation, damping), 1)[1]
    found = perturbed_region(without_spring(equation, damping), 1)
    assert (found.low, found.high) == pytest.approx((right.low, right.high), abs=2e-7)


def test_perturbed_removing_damping() -> None:
    equation = slider(1.0)
    damping = youssef.perturbed_removing_damping(without_spring(equation), 1)
    assert perturbed_region(without_spring(equation, 1.001 * damping), 1) is None
    assert 1 in hill_regions(without_spring(equation, 0.999 * damping), 1)
    assert hill_regions(without_spring(equation, 1.001 * damping), 1) == {}


def periodic_factor(size: float) -> PeriodicEquation:
    """Harmonics of that size in all coefficients, the stiffness's factor among them; undamped."""
    waves = {"a": (1.3, 0.2, -0.1, 0.05), "c": (0.2, 0.3, 0.25, -0.1), "factor": (0.8, -0.3, 0.2, 0.15)}
    made = {}
    for name, (mean, cosine, sine, second) in waves.items():
        made[name] = series((mean, 0.0), (size * cosine, size * sine), (size**2 * second, 0.0))
    return PeriodicEquation(b=FourierSeries.constant(0.0), **made)


@pytest.mark.parametrize("number", [0, 1, 2])
@pytest.mark.parametrize(("order", "rate"), [(1, 2.0), (2, 3.0)])
def test_perturbation_of_a_periodic_stiffness(number: int, order: int, rate: float) -> None:
    """Zeroth boundary and two regions, against Hill's determinant."""
    sizes = np.array([0.005, 0.01, 0.02])
    errors = []
    for size in sizes.tolist():
        equation = periodic_factor(size)
        if number == 0:
            right = float(boundary_stiffnesses(equation, 1, count=1)[0].real)
            errors.append([abs(youssef.perturbed_boundary(equation, order=order) - right)])
        else:
            region, found = hill_regions(equation, 2)[number], perturbed_region(equation, number, order=order)
            errors.append([abs(found.low - region.low), abs(found.high - region.high)])
    rates = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert (rates > rate - 0.2).all()


@pytest.mark.parametrize("multiplier", [1, -1])
def test_boundaries_of_a_periodic_stiffness_are_where_the_multiplier_is(multiplier: int) -> None:
    equation = periodic_factor(0.3)
    values = boundary_stiffnesses(equation, multiplier, count=4).real
    matrices = youssef.monodromies([equation.stiffened(x) for x in values])
    assert crossing_test(matrices, multiplier) == pytest.approx(np.zeros(4), abs=1e-9)


# Verdicts


def test_verdicts() -> None:
    stable = verdict([0.5 + 0.2j, 0.5 - 0.2j])
    assert stable.stability is Stability.STABLE
    assert stable.margin == pytest.approx(1.0 - sqrt(0.29))
    assert stable.crossing is Crossing.TORUS
    unstable = verdict([0.3, -1.2])
    assert unstable.stability is Stability.UNSTABLE
    assert unstable.margin == pytest.approx(-0.2)
    assert unstable.largest_multiplier == -1.2
    assert unstable.crossing is Crossing.PERIOD_DOUBLING
    assert verdict([1.0 + 1e-8, 0.1]).stability is Stability.MARGINAL
    assert verdict([1.0 + 1e-8, 0.1], tolerance=1e-9).stability is Stability.UNSTABLE
    assert periodic.crossing(1.01) is Crossing.FOLD
    assert str(unstable) == "unstable, margin -0.2 with tolerance 1e-06"


def test_verdict_is_no_boolean() -> None:
    with pytest.raises(periodic.VerdictError, match="no truth value"):
        bool(verdict([0.5]))
    with pytest.raises(TypeError):
        assert not verdict([0.5])


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: periodic.multipliers([[np.nan, 0.0], [0.0, 1.0]]), "not finite"),
        (lambda: verdict([]), "finite numbers"),
        (lambda: verdict([0.5], tolerance=-1.0), "tolerance"),
        (lambda: liouville([]), "finite numbers"),
        (lambda: boundary_stiffnesses(GENERAL, 2, count=1), r"\+1 or -1"),
        (lambda: boundary_stiffnesses(GENERAL, 1, count=10, order=2), "count is 10"),
        (lambda: youssef.hill_multipliers(GENERAL, order=0), "order is 0"),
        (lambda: youssef.monodromies([]), "at least one equation"),
        (lambda: youssef.monodromies([GENERAL, replace(GENERAL, a=series((1.0, 0), (1.5, 0)))]), "zero in equation 1"),
        (lambda: monodromy(GENERAL, steps=0), "steps is 0"),
        (lambda: perturbed_region(GENERAL, 0), "count from 1"),
        (lambda: youssef.perturbed_boundary(GENERAL, order=3), "order is 1 or 2"),
        (lambda: perturbed_region(replace(GENERAL, a=FourierSeries.constant(-1.0)), 1), "means of M and S are -1"),
    ],
)
def test_bad_arguments_are_refused(ask: Callable[[], object], said: str) -> None:
    with pytest.raises((InputError, youssef.SingularEquationError), match=said):
        ask()
