"""Arclength continuation on curves that are known in closed form."""

import numpy as np
import pytest

from analysis.numerics.continuation import ContinuationError, Evaluation, Follower, Point, Reason, Settings
from linkwork.errors import AssemblyError, InputError


def curve(g, gy, gl):
    """G(y, l) of one unknown as the continuation takes it."""

    def evaluate(y: np.ndarray, parameter: float) -> Evaluation:
        v = float(y[0])
        value, by_y, by_l = (f(v, parameter) for f in (g, gy, gl))
        return Evaluation(np.array([value]), np.array([[by_y]]), np.array([by_l]), None)

    return evaluate


CUBIC = curve(lambda y, b: y**3 - y - b, lambda y, b: 3 * y * y - 1, lambda y, b: -1.0)
CIRCLE = curve(lambda y, b: y * y + b * b - 1.0, lambda y, b: 2 * y, lambda y, b: 2 * b)


def follower(evaluate, low, high, scale=1.0, **options):
    return Follower(evaluate, [scale], Settings(low=low, high=high, **options))


def test_an_s_curve_is_followed_through_both_folds() -> None:
    f = follower(CUBIC, -1.0, 1.0)
    result = f.follow(f.start([-1.3], -1.0, 1))
    y, b = (np.array([value(p) for p in result.points]) for value in (lambda p: p.y[0], lambda p: p.parameter))
    assert result.reached
    assert not result.closed
    assert np.abs(y**3 - y - b).max() < 1e-12
    assert b[-1] == pytest.approx(1.0, abs=1e-12)
    assert (np.diff(y) > 0.0).all()
    assert len(result.steps) == len(result.points) - 1


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
def test_a_fold_is_located_where_the_tangent_turns_back(scale: float) -> None:
    f = follower(CUBIC, -1.0, 1.0, scale=scale, first=1e-3)
    points = f.follow(f.start([-1.3], -1.0, 1)).points
    steps = f.follow(f.start([-1.3], -1.0, 1)).steps
    folds = []
    for before, after, length in zip(points, points[1:], steps):
        if before.tangent[-1] * after.tangent[-1] < 0.0:
            point, s = f.locate(before, length, after, lambda p: float(p.tangent[-1]))
            folds.append((point.parameter, point.y[0]))
            assert 0.0 <= s <= length
    exact = 2.0 / np.sqrt(27.0), 1.0 / np.sqrt(3.0)
    assert folds == [pytest.approx((exact[0], -exact[1]), abs=1e-7), pytest.approx((-exact[0], exact[1]), abs=1e-7)]


@pytest.mark.parametrize("below", [1e-9, 1e-6, 1e-3, 3e-3])
@pytest.mark.parametrize("greatest", [2e-2, 0.1, 0.3])
def test_a_fold_beyond_the_end_of_the_range_is_none_of_the_curve(below: float, greatest: float) -> None:
    """A step over it would come in again on the other side."""
    high = 2.0 / np.sqrt(27.0) - below
    f = follower(CUBIC, -1.0, high, greatest=greatest)
    points = f.follow(f.start([-1.3], -1.0, 1)).points
    assert points[-1].parameter == high
    assert points[-1].y[0] < -1.0 / np.sqrt(3.0)
    assert min(point.tangent[-1] for point in points) > 0.0


def test_a_closed_curve_closes() -> None:
    f = follower(CIRCLE, -2.0, 2.0)
    result = f.follow(f.start([1.0], 0.0, 1))
    assert result.closed
    assert result.reached
    turned = np.unwrap([np.arctan2(p.y[0], p.parameter) for p in result.points])
    assert abs(turned[-1] - turned[0]) == pytest.approx(2.0 * np.pi, abs=0.1)


def test_direction_is_kept() -> None:
    f = follower(CUBIC, -10.0, 10.0)
    assert f.follow(f.start([2.0], 6.0, -1)).points[1].parameter < 6.0
    assert f.follow(f.start([2.0], 6.0, 1)).points[1].parameter > 6.0


def test_where_the_equation_ends_the_curve_stalls_at_the_last_good_point() -> None:
    def half(y: np.ndarray, parameter: float) -> Evaluation:
        if parameter > 0.5:
            raise AssemblyError("the links part")
        return CUBIC(y, parameter)

    f = follower(half, -1.0, 1.0)
    # on the upper part of the S, which has no fold before the end of its domain
    result = f.follow(f.start([1.0], 0.0, 1))
    assert not result.reached
    assert "no next point" in result.reason
    assert "the links part" in result.reason
    assert 0.499 < result.points[-1].parameter <= 0.5


@pytest.mark.parametrize("secant", [False, True])
def test_a_curve_ends_exactly_on_a_bound_beyond_which_nothing_is_evaluated(secant: bool) -> None:
    seen: list[tuple[float, float]] = []

    def evaluate(y: np.ndarray, parameter: float) -> Evaluation:
        seen.append((float(y[0]), parameter))
        return CIRCLE(y, parameter)

    settings = Settings(low=-2.0, high=2.0, bounds={0: (-0.5, 1.5)}, greatest=0.05)
    f = Follower(evaluate, [1.0], settings, (lambda y, b: evaluate(y, b).residual) if secant else None)
    first = f.start([1.0], 0.0, 1)
    for begin, side in ((first, 1.0), (first.with_opposite_tangent(), -1.0)):
        result = f.follow(begin)
        assert result.end is Reason.BOX
        assert result.points[-1].y[0] == -0.5
        assert result.points[-1].parameter == pytest.approx(side * np.sqrt(0.75), abs=1e-9)
    assert all(-0.5 <= y <= 1.5 for y, _ in seen)


def test_an_oriented_curve_ends_where_it_meets_another() -> None:
    lines = curve(lambda y, b: y * y - b * b, lambda y, b: 2 * y, lambda y, b: -2 * b)
    for oriented, end in ((True, Reason.TIP), (False, Reason.BOX)):
        f = follower(lines, -1.0, 1.0, oriented=oriented, least=1e-6)
        result = f.follow(f.start([-0.9], -0.9, 1))
        assert result.end is end
        assert result.points[-1].parameter == pytest.approx(0.0 if oriented else 1.0, abs=1e-3)


def test_a_step_onto_another_curve_is_shortened() -> None:
    """From a trough of a wave the first step leads onto the line below, unless ``foreign`` tells the two apart."""

    def wave(b: float) -> float:
        return 1e-3 * float(1.0 - 0.9 * np.cos(314.0 * b))

    def wave_and_line(y: np.ndarray, b: float) -> Evaluation:
        v, rise = float(y[0]), 1e-3 * 0.9 * 314.0 * np.sin(314.0 * b)
        value, by_y = v * (v - wave(b)), 2.0 * v - wave(b)
        return Evaluation(np.array([value]), np.array([[by_y]]), np.array([-v * rise]), abs(v) < 1e-9)

    least = {}
    for foreign in (None, bool):
        f = Follower(wave_and_line, [1.0], Settings(low=0.0, high=0.1, first=0.1, greatest=0.1), foreign=foreign)
        least[foreign] = min(float(p.y[0]) for p in f.follow(f.start([1e-4], 0.0, 1)).points)
    assert least[None] == pytest.approx(0.0, abs=1e-9)
    assert least[bool] == pytest.approx(1e-4, rel=1e-6)


def test_the_most_points_are_reported() -> None:
    f = follower(CUBIC, -1.0, 1.0, most_points=7)
    result = f.follow(f.start([-1.3], -1.0, 1))
    assert len(result.points) == 7
    assert not result.reached
    assert "7 points" in result.reason


def test_a_reason_to_leave_is_reported() -> None:
    f = follower(CUBIC, -1.0, 1.0)
    seen: list[Point] = []
    result = f.follow(f.start([-1.3], -1.0, 1), watch=seen.append, leave=lambda p: "far enough" if p.y[0] > 0 else "")
    assert result.reason == "far enough"
    assert len(seen) == len(result.points) - 1


def test_a_point_that_is_not_on_the_curve_is_refused() -> None:
    f = follower(CIRCLE, -2.0, 2.0)
    with pytest.raises(ContinuationError, match=r"no solution at the parameter 1\.5"):
        f.start([1.0], 1.5, 1)


@pytest.mark.parametrize("bad", [{"high": 0.0}, {"high": float("inf")}, {"high": 1.0, "first": 1.0}])
def test_bad_settings_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InputError):
        Settings(low=0.0, **bad)


@pytest.mark.parametrize("size", [1e-9, 2e-8])
def test_a_curve_is_followed_whose_values_are_no_more_accurate_than_its_noise(size: float) -> None:
    calls = 0

    def noisy(y: np.ndarray, parameter: float) -> Evaluation:
        nonlocal calls
        calls += 1
        found = CUBIC(y, parameter)
        return found._replace(residual=found.residual + size * (-1.0) ** calls)

    f = follower(noisy, -1.0, 1.0)
    result = f.follow(f.start([-1.3], -1.0, 1))
    assert result.reached
    assert all(abs(p.y[0] ** 3 - p.y[0] - p.parameter) < 10.0 * size for p in result.points)


def test_a_curve_that_is_lost_at_the_end_of_the_range_is_kept_so_far() -> None:
    class Lost(Follower):
        def _find_bound_point(self, last: Point, beyond: Point, length: float) -> tuple[Point, float]:
            raise ContinuationError("no point there")

    f = Lost(CUBIC, [1.0], Settings(low=-1.0, high=1.0))
    result = f.follow(f.start([-1.3], -1.0, 1))
    assert result.end is Reason.TIP
    assert result.reason == "no next point is found: no point there"
    assert result.points[-1].parameter > 0.9
