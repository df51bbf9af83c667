"""The integrator: its order, its error control, and how it ends, carries on and gives up."""

from collections.abc import Callable
from math import cos, exp, isfinite, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import DOP853, solve_ivp

from linkwork import tableau
from linkwork.errors import AssemblyError, IntegrationError
from linkwork.integrate import Vector, integrate, rk_step

UNIT = (1.0, 1.0)


def pendulum(x: Vector) -> Vector:
    return (x[1], -sin(x[0]))


PENDULUM_START = (1.0, 0.5)


def pendulum_at(t: float) -> np.ndarray:
    result = solve_ivp(lambda _, y: pendulum(y), (0.0, t), PENDULUM_START, method="DOP853", rtol=3e-14, atol=1e-15)
    return result.y[:, -1]


def slope(sizes: np.ndarray, errors: np.ndarray) -> float:
    """Exponent of the error in the step size, by regression."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


# ------------------------------------------------------------------ order and error control


def test_same_numbers_as_in_an_independent_listing() -> None:
    # SciPy's, typed from the same book by others
    full = np.zeros((16, 16))
    for i, row in enumerate(tableau.A):
        for j, a in row:
            full[i, j] = a
    assert full[:12, :12] == pytest.approx(DOP853.A, abs=1e-15)
    assert full[12, :12] == pytest.approx(DOP853.B, abs=1e-15)
    assert full[13:] == pytest.approx(DOP853.A_EXTRA, abs=1e-15)
    assert tableau.C[:12] == pytest.approx(DOP853.C, abs=1e-15)
    assert tableau.C[13:] == pytest.approx(DOP853.C_EXTRA, abs=1e-15)
    assert np.array(tableau.E3) == pytest.approx(DOP853.E3, abs=1e-15)
    assert np.array(tableau.E5) == pytest.approx(DOP853.E5, abs=1e-15)
    assert np.array(tableau.D) == pytest.approx(DOP853.D, abs=1e-12)
    assert DOP853.n_stages == tableau.STAGES


def test_order_is_eight() -> None:
    exact = pendulum_at(10.0)
    counts = np.array([16, 20, 26, 32, 40])
    errors = []
    for n in counts:
        x: Vector = PENDULUM_START
        for _ in range(n):
            x, _ = rk_step(pendulum, x, pendulum(x), 10.0 / n, UNIT)
        errors.append(np.abs(np.array(x) - exact).max())
    assert slope(10.0 / counts, np.array(errors)) == pytest.approx(8.0, abs=0.3)


def test_error_estimate_is_of_order_eight() -> None:
    sizes = np.array([0.15, 0.1, 0.07, 0.05, 0.03])
    estimates = [rk_step(pendulum, PENDULUM_START, pendulum(PENDULUM_START), h, UNIT)[1] for h in sizes]
    assert slope(sizes, np.array(estimates)) == pytest.approx(8.0, abs=0.2)


def test_error_estimate_is_that_of_the_book() -> None:
    # |h| err5^2 / sqrt((err5^2 + 0.01 err3^2) n), from SciPy's arrays, on a step whose stages are plain powers of time
    h = 0.7
    # two components alike: the mean over them is that of one
    _, error = rk_step(lambda x: (-x[0], -x[1]), (1.0, 1.0), (-1.0, -1.0), h, (1.0, 1.0))
    stages = [-1.0]
    for row in [*DOP853.A[1:], DOP853.B]:
        stages.append(-(1.0 + h * float(np.dot(row[: len(stages)], stages))))
    size = 1.0 + max(1.0, abs(stages[-1]))
    e5, e3 = (float(np.dot(e, stages)) / size for e in (DOP853.E5, DOP853.E3))
    assert error == pytest.approx(h * e5**2 / sqrt(e5**2 + 0.01 * e3**2), rel=1e-9)


def test_global_error_falls_with_the_tolerance() -> None:
    exact = pendulum_at(10.0)
    tolerances = 10.0 ** -np.arange(4.0, 13.0)
    errors, evaluations = [], []
    for tolerance in tolerances:
        result = integrate(pendulum, PENDULUM_START, 10.0, tolerance=tolerance, scale=UNIT)
        errors.append(np.abs(np.array(result.x) - exact).max())
        evaluations.append(result.evaluations)
    assert all(e < 30.0 * t for e, t in zip(errors, tolerances))
    assert evaluations == sorted(evaluations)
    assert slope(tolerances, np.array(errors)) == pytest.approx(1.0, abs=0.25)


def test_few_steps_are_refused() -> None:
    accepted = 0

    def accept(x: Vector) -> None:
        nonlocal accepted
        accepted += 1

    result = integrate(pendulum, PENDULUM_START, 50.0, tolerance=1e-9, scale=UNIT, accept=accept)
    assert accepted > 50
    assert result.steps < 1.35 * accepted
    # and the steps are as long as they may be: SciPy's control of the same method takes about as many
    other = solve_ivp(lambda _, y: pendulum(y), (0.0, 50.0), PENDULUM_START, method="DOP853", rtol=1e-9, atol=1e-9)
    assert result.evaluations < 1.1 * other.nfev


def test_polynomials_up_to_the_seventh_power_are_exact() -> None:
    # time is carried as a component; y' = 8 t^7
    result = integrate(lambda x: (1.0, 8.0 * x[0] ** 7), (0.0, 0.0), 2.0, tolerance=1e-6, scale=UNIT)
    assert result.x == pytest.approx((2.0, 256.0), rel=1e-14)


def test_scale_sets_where_an_error_counts_as_absolute() -> None:
    def steps(scale: float) -> int:
        f = lambda x: (cos(100.0 * x[1]), 1.0)  # noqa: E731
        return integrate(f, (0.0, 0.0), 1.0, tolerance=1e-9, scale=(scale, 1.0)).steps

    assert steps(1e-3) > steps(1.0) > steps(1e3)


# ------------------------------------------------------------------ the end, and carrying on


def test_ends_exactly_and_counts_its_evaluations() -> None:
    calls = 0

    def f(x: Vector) -> Vector:
        nonlocal calls
        calls += 1
        return (1.0, x[1])

    accepted: list[Vector] = []
    result = integrate(f, (0.0, 1.0), 3.0, tolerance=1e-10, scale=UNIT, accept=accepted.append)
    assert result.x[0] == pytest.approx(3.0, rel=1e-15)
    assert result.x[1] == pytest.approx(exp(3.0), rel=1e-9)
    assert len(accepted) > 1
    # the start, and that of every step after the first is the end of the one before
    assert result.evaluations == calls == 11 * result.steps + len(accepted)


def test_step_size_is_carried_over_and_not_shortened_by_the_end() -> None:
    natural = integrate(pendulum, PENDULUM_START, 20.0, tolerance=1e-9, scale=UNIT).step
    assert natural > 0.2
    x, step, evaluations = PENDULUM_START, natural, 0
    for _ in range(500):
        result = integrate(pendulum, x, 0.01, tolerance=1e-9, scale=UNIT, step=step)
        x, step = result.x, result.step
        evaluations += result.evaluations
    assert step >= natural
    # one step in each piece: 11 evaluations, and that at its start; nobody asks for that at its end
    assert evaluations == 500 * 12
    assert np.abs(np.array(x) - pendulum_at(5.0)).max() < 1e-12
    # the carried step is tried first, so that the next interval begins where this one left off
    first = integrate(pendulum, PENDULUM_START, 1.5 * natural, tolerance=1e-9, scale=UNIT)
    fresh = integrate(pendulum, first.x, 10.0, tolerance=1e-9, scale=UNIT)
    carried = integrate(pendulum, first.x, 10.0, tolerance=1e-9, scale=UNIT, step=first.step)
    assert carried.steps < fresh.steps


def test_carried_step_that_is_too_long_is_cut() -> None:
    result = integrate(pendulum, PENDULUM_START, 10.0, tolerance=1e-10, scale=UNIT, step=10.0)
    assert np.abs(np.array(result.x) - pendulum_at(10.0)).max() < 1e-8
    assert result.steps > 5


def test_no_sliver_is_left_for_the_last_step() -> None:
    seen: list[Vector] = [(0.0, 0.0)]
    given = {"tolerance": 1e-3, "scale": UNIT, "step": 0.9, "accept": seen.append}
    integrate(lambda x: (1.0, cos(x[0])), seen[0], 1.0, **given)
    assert np.diff([x[0] for x in seen]).min() > 0.3


def test_every_accepted_state_is_reported_and_may_stop_the_run() -> None:
    seen: list[Vector] = []

    def accept(x: Vector) -> None:
        seen.append(x)
        if x[0] > 0.5:
            raise AssemblyError("far enough")

    with pytest.raises(AssemblyError, match="far enough"):
        integrate(lambda x: (1.0, cos(50.0 * x[0])), (0.0, 0.0), 1.0, tolerance=1e-9, scale=UNIT, accept=accept)
    assert len(seen) > 2
    assert [x[0] for x in seen] == sorted(x[0] for x in seen)
    assert all(x[0] <= 0.5 for x in seen[:-1])
    assert seen[-1][0] > 0.5


def test_at_rest_nothing_happens() -> None:
    result = integrate(lambda x: (0.0, 0.0), (1.0, 2.0), 5.0, tolerance=1e-9, scale=UNIT)
    assert (result.x, result.steps) == ((1.0, 2.0), 1)


# ------------------------------------------------------------------ giving up


def refusing(error: Exception) -> Callable[[Vector], Vector]:
    def f(x: Vector) -> Vector:
        if x[0] > 0.7:
            raise error
        return (1.0, 0.0)

    return f


@pytest.mark.parametrize("error", [ValueError("root"), ZeroDivisionError("B on D"), OverflowError("big")])
def test_undefined_right_hand_side_is_approached_and_refused(error: Exception) -> None:
    reached = 0.0

    def accept(x: Vector) -> None:
        nonlocal reached
        reached = x[0]

    with pytest.raises(IntegrationError, match=r"the step size fell to .* 0\.7 s into an interval of 1 s"):
        integrate(refusing(error), (0.0, 0.0), 1.0, tolerance=1e-9, scale=UNIT, accept=accept)
    assert reached == pytest.approx(0.7, abs=1e-9)
    assert reached <= 0.7


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_right_hand_side_that_is_not_finite_is_refused(value: float) -> None:
    def f(x: Vector) -> Vector:
        return (1.0, value if x[0] > 0.7 else 0.0)

    def accept(x: Vector) -> None:
        assert isfinite(x[1])

    with pytest.raises(IntegrationError, match=r"0\.7 s into an interval of 1 s"):
        integrate(f, (0.0, 0.0), 1.0, tolerance=1e-9, scale=UNIT, accept=accept)


def test_right_hand_side_at_the_end_is_not_evaluated() -> None:
    calls = 0

    def f(x: Vector) -> Vector:
        nonlocal calls
        calls += 1
        if calls > 12:
            raise ValueError("not defined at the end")
        return (1.0, 1.0)

    result = integrate(f, (0.0, 0.0), 1.0, tolerance=1e-3, scale=UNIT, step=1.0)
    assert result.x == pytest.approx(UNIT, rel=1e-15)


def test_a_state_that_is_not_finite_is_refused() -> None:
    # its error relative to its size would be zero
    with pytest.raises(IntegrationError, match="step size fell"):
        integrate(lambda x: (1e307,), (1.79e308,), 1.0, tolerance=1e-3, scale=(1.0,), step=1.0)


def test_a_stray_error_is_not_swallowed() -> None:
    with pytest.raises(KeyError):
        integrate(refusing(KeyError("x")), (0.0, 0.0), 1.0, tolerance=1e-9, scale=UNIT)


def test_finite_escape_time_is_refused() -> None:
    # y' = y^2 from 1 has no value beyond t = 1
    with pytest.raises(IntegrationError, match="step size fell"):
        integrate(lambda x: (x[0] ** 2,), (1.0,), 2.0, tolerance=1e-9, scale=(1.0,))


def test_as_many_steps_as_are_needed_suffice() -> None:
    def run(max_steps: int) -> int:
        return integrate(pendulum, PENDULUM_START, 10.0, tolerance=1e-9, scale=UNIT, max_steps=max_steps).steps

    needed = run(1000)
    assert run(needed) == needed
    with pytest.raises(IntegrationError, match=f"{needed - 1} steps did not suffice"):
        run(needed - 1)
