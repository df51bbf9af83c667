"""Hamming's method: its formulas, its order, its error control, and its manners as a SciPy method."""

from collections.abc import Callable
from itertools import pairwise
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.run import Hamming
from analysis.run.hamming import BACK_VALUES, Point

LOOSE = {"rtol": 1e3, "atol": 1e9}


def pendulum(t: float, y: np.ndarray) -> list[float]:
    return [y[1], -sin(y[0]) + 0.3 * cos(t)]


START = [1.0, 0.2]


def exact_at(t: float) -> np.ndarray:
    return solve_ivp(pendulum, (0.0, t), START, method="DOP853", rtol=3e-14, atol=1e-15).y[:, -1]


EXACT_10 = exact_at(10.0)


def slope(sizes: Any, errors: Any) -> float:
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def fixed(f: Callable[..., Any], span: tuple[float, float], y0: Any, n: int, **options: Any) -> Any:
    h = abs(span[1] - span[0]) / n
    return solve_ivp(f, span, y0, method=Hamming, first_step=h, max_step=h, **LOOSE, **options)


def with_exact_back_values(y: np.poly1d, h: float, t: float = 0.3) -> Hamming:
    """A solver of y' = polynomial in t in the middle of a run of fixed steps, its seven back values exact."""
    dy = y.deriv()
    solver = Hamming(lambda t, _: [dy(t)], t, [y(t)], t + 100 * h, first_step=h, max_step=10 * h, **LOOSE)
    solver._back = [Point(np.array([y(t - k * h)]), np.array([dy(t - k * h)])) for k in range(BACK_VALUES)]
    solver._p_minus_c = solver._estimate()
    return solver


# ------------------------------------------------------------------ the formulas (2.28-2.31)


def test_predictor_and_corrector_have_the_errors_that_the_modifier_takes_out() -> None:
    # on y = t^5, y''''' = 120: p is short by 14/45 h^5 y''''', c long by 1/40
    h, t = 0.25, 0.3
    solver = with_exact_back_values(np.poly1d([1, 0, 0, 0, 0, 0]), h, t)
    error, new, p_minus_c = solver._hamming(t + h)
    unit = 120.0 * h**5
    assert p_minus_c[0] == pytest.approx(-(14 / 45 + 1 / 40) * unit, rel=1e-10)
    assert p_minus_c[0] == pytest.approx(-121 / 360 * unit, rel=1e-10)
    assert new.y[0] == pytest.approx((t + h) ** 5, rel=1e-12)
    # and the local error that is held against the tolerance is the corrector's
    size = LOOSE["atol"] + LOOSE["rtol"] * (t + h) ** 5
    assert error == pytest.approx(unit / 40 / size, rel=1e-9)


@pytest.mark.parametrize("power", range(6))
def test_step_is_exact_on_powers_up_to_the_fifth(power: int) -> None:
    y = np.poly1d([1] + [0] * power)
    solver = with_exact_back_values(y, 0.25)
    _, new, _ = solver._hamming(0.55)
    assert new.y[0] == pytest.approx(y(0.55), rel=1e-12)


@pytest.mark.parametrize("power", range(7))
def test_halving_interpolates_powers_up_to_the_sixth_exactly(power: int) -> None:
    y = np.poly1d([1] + [0] * power)
    h, t = 0.25, 0.3
    solver = with_exact_back_values(y, h, t)
    assert solver._halve()
    assert solver.h == h / 2
    assert [point.y[0] for point in solver._back] == pytest.approx([y(t - k * h / 2) for k in range(4)], abs=1e-13)
    slopes = [y.deriv()(t - k * h / 2) for k in range(4)]
    assert [point.f[0] for point in solver._back] == pytest.approx(slopes, abs=1e-12)


def test_doubling_takes_every_other_back_value() -> None:
    y = np.poly1d([1, 0, 0, 0, 0, 0])
    h, t = 0.25, 0.3
    solver = with_exact_back_values(y, h, t)
    solver._double()
    assert (solver.h, solver.doublings, len(solver._back)) == (2 * h, 1, 4)
    assert [point.y[0] for point in solver._back] == pytest.approx([y(t - 2 * k * h) for k in range(4)], rel=1e-14)
    assert solver._p_minus_c[0] == pytest.approx(-121 / 360 * 120.0 * (2 * h) ** 5, rel=1e-10)


# ------------------------------------------------------------------ order


def test_order_with_fixed_steps() -> None:
    # predictor and corrector are of order 4; modifier and final value take the leading error out of them, and what is
    # measured is the next order, over four that are claimed
    counts = np.array([100, 160, 250, 400, 640, 1000])
    errors = [np.abs(fixed(pendulum, (0.0, 10.0), START, n).y[:, -1] - EXACT_10).max() for n in counts]
    assert slope(10.0 / counts, errors) == pytest.approx(5.0, abs=0.35)


def test_start_is_no_worse_than_what_follows() -> None:
    counts = np.array([20, 40, 80, 160])
    ends = [fixed(pendulum, (0.0, 3.0 * 10.0 / n), START, 3).y[:, -1] for n in counts]
    errors = [np.abs(end - exact_at(30.0 / n)).max() for end, n in zip(ends, counts)]
    assert slope(10.0 / counts, errors) == pytest.approx(5.0, abs=0.5)


# ------------------------------------------------------------------ steps and error control


def test_fixed_steps_stay_fixed() -> None:
    result = fixed(pendulum, (0.0, 10.0), START, 200)
    assert len(result.t) == 201
    assert result.t == pytest.approx(0.05 * np.arange(201), rel=1e-14)
    assert result.t[-1] == 10.0
    # three starting steps of 11 evaluations each, then two for every step
    assert result.nfev == 1 + 3 * 11 + 2 * 197


def test_global_error_falls_with_the_tolerance() -> None:
    tolerances = 10.0 ** -np.arange(3.0, 12.0)
    errors, evaluations = [], []
    for tolerance in tolerances:
        result = solve_ivp(pendulum, (0.0, 10.0), START, method=Hamming, rtol=tolerance, atol=tolerance)
        errors.append(np.abs(result.y[:, -1] - EXACT_10).max())
        evaluations.append(result.nfev)
    assert all(e < 50.0 * t for e, t in zip(errors, tolerances))
    assert all(b < a for a, b in pairwise(errors))
    assert slope(tolerances, errors) == pytest.approx(1.0, abs=0.2)
    assert evaluations == sorted(evaluations)


def bump(t: float, y: np.ndarray) -> list[float]:
    """A slow motion with a quick stretch about t = 5."""
    return [-y[0] + 20.0 * np.exp(-50.0 * (t - 5.0) ** 2)]


def test_step_is_halved_where_it_gets_quick_and_doubled_after() -> None:
    solver = Hamming(bump, 0.0, [1.0], 10.0, rtol=1e-7, atol=1e-7)
    steps = []
    while solver.status == "running":
        assert solver.step() is None
        steps.append((solver.t, solver.step_size))
    before, in_it, after = (max(h for t, h in steps if a < t < b) for a, b in ((3.0, 4.4), (4.9, 5.1), (7.0, 9.0)))
    assert in_it < before
    assert in_it < after
    assert solver.halvings >= 2
    assert solver.doublings >= 3
    exact = solve_ivp(bump, (0.0, 10.0), [1.0], method="DOP853", rtol=1e-12, atol=1e-13, max_step=0.1).y[0, -1]
    assert solver.y[0] == pytest.approx(exact, abs=1e-5)


def test_jump_of_the_right_hand_side_starts_anew() -> None:
    def jumping(t: float, y: np.ndarray) -> list[float]:
        return [1.0 if t < pi else -50.0 * y[0]]

    solver = Hamming(jumping, 0.0, [0.0], 4.0, rtol=1e-7, atol=1e-9, first_step=2.0**-6)
    steps = []
    while solver.status == "running":
        assert solver.step() is None
        steps.append(solver.step_size)
    assert solver.starts > 1
    # halved there too, from the step before
    exponents = np.log2(steps[:-1])
    assert exponents == pytest.approx(np.round(exponents), abs=1e-9)
    assert solver.y[0] == pytest.approx(pi * np.exp(-50.0 * (4.0 - pi)), abs=1e-6)


def test_longest_step_is_kept_to() -> None:
    result = solve_ivp(pendulum, (0.0, 10.0), START, method=Hamming, max_step=0.03, rtol=1e-3, atol=1e-3)
    assert np.diff(result.t).max() <= 0.03 * (1.0 + 1e-9)


def test_tolerances_by_component() -> None:
    def f(t: float, y: np.ndarray) -> list[float]:
        return [-y[0], 1e6 * cos(5.0 * t)]

    sizes = ([1e-6, 1e-6], [1e-6, 1e6])
    tight, loose = (solve_ivp(f, (0, 3), [1.0, 0.0], method=Hamming, rtol=1e-6, atol=atol).nfev for atol in sizes)
    assert loose < tight


# ------------------------------------------------------------------ manners of a SciPy method


def test_backwards() -> None:
    result = solve_ivp(pendulum, (10.0, 0.0), EXACT_10, method=Hamming, rtol=1e-9, atol=1e-9)
    assert result.t[-1] == 0.0
    assert (np.diff(result.t) < 0.0).all()
    assert result.y[:, -1] == pytest.approx(START, abs=1e-6)
    assert fixed(pendulum, (10.0, 0.0), EXACT_10, 400).y[:, -1] == pytest.approx(START, abs=1e-6)


@pytest.mark.parametrize("span", [(0.0, 10.0), (10.0, 0.0)])
def test_dense_output_is_as_good_as_the_steps(span: tuple[float, float]) -> None:
    start = START if span[0] == 0.0 else EXACT_10
    result = solve_ivp(pendulum, span, start, method=Hamming, rtol=1e-9, atol=1e-9, dense_output=True)
    reference = solve_ivp(pendulum, span, start, method="DOP853", rtol=1e-13, atol=1e-14, dense_output=True)
    assert result.sol(result.t) == pytest.approx(result.y, abs=1e-12)
    t = np.linspace(0.0, 10.0, 997)
    at_steps = np.abs(result.y - reference.sol(result.t)).max()
    assert np.abs(result.sol(t) - reference.sol(t)).max() < 1.5 * at_steps + 1e-12


def test_nothing_to_do() -> None:
    assert solve_ivp(pendulum, (1.0, 1.0), START, method=Hamming).y[:, -1].tolist() == START
    assert solve_ivp(lambda t, y: y, (0.0, 1.0), [], method=Hamming).success
    still = solve_ivp(lambda t, y: [0.0], (0.0, 1.0), [3.0], method=Hamming, dense_output=True)
    assert still.sol(0.4) == pytest.approx([3.0])
    assert len(still.t) < 100


def test_singularity_is_reported() -> None:
    result = solve_ivp(lambda t, y: y**2, (0.0, 2.0), [1.0], method=Hamming)
    assert not result.success
    assert "step size" in result.message
    assert result.t[-1] == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_right_hand_side_that_is_not_finite_is_reported(bad: float) -> None:
    result = solve_ivp(lambda t, y: [1.0 if t < 0.7 else bad], (0.0, 2.0), [0.0], method=Hamming)
    assert not result.success
    assert result.t[-1] == pytest.approx(0.7, abs=1e-9)
    assert np.isfinite(result.y).all()


UNUSABLE = [{"first_step": 0.0}, {"first_step": -1.0}, {"first_step": 20.0}, {"max_step": 0.0}, {"rtol": -1.0}]


@pytest.mark.parametrize("options", [*UNUSABLE, {"rtol": 0.0, "atol": 0.0}])
def test_options_that_are_not_usable(options: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must"):
        solve_ivp(pendulum, (0.0, 10.0), START, method=Hamming, **options)


def test_options_that_it_has_not() -> None:
    with pytest.warns(UserWarning, match="no option lband"):
        solve_ivp(pendulum, (0.0, 0.1), START, method=Hamming, lband=1)
