"""Folds and period doublings followed through a plane of two parameters."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.numerics.continuation import ContinuationError, Reason
from analysis.periodic import Crossing, CrossingCurve, Drive, Family, SpecialPoint, find_orbit, follow, follow_crossing
from analysis.periodic.motion.discretisation import operating_point
from analysis.periodic.motion.orbit import trial_orbit
from analysis.units import RAD_S_PER_RPM
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SETS

RPM = RAD_S_PER_RPM
RIG_1_B = SETS["rig-1-spring-b"].parameters
SPEEDS = (850.0 * RPM, 1200.0 * RPM)


def specials(parameters: FiveBarParameters, start: float, direction: int) -> tuple[SpecialPoint, ...]:
    orbit = find_orbit(parameters, speed=start)
    family = Family(parameters=parameters, drive=orbit.drive)
    return follow(family, orbit, start, low=SPEEDS[0], high=SPEEDS[1], direction=direction).special


def with_friction(speed: float, friction: float) -> tuple[FiveBarParameters, Drive]:
    return replace(RIG_1_B, slider_coulomb_friction=friction), Drive(speed=speed)


def with_damping(speed: float, damping: float) -> tuple[FiveBarParameters, Drive]:
    return replace(RIG_1_B, slider_damping=damping), Drive(speed=speed)


@pytest.fixture(scope="module")
def folds() -> CrossingCurve:
    """The fold of rig 1 with spring B over friction, from none."""
    (fold,) = specials(RIG_1_B, SPEEDS[0], 1)
    return follow_crossing(with_friction, fold.orbit, Crossing.FOLD, (fold.parameter, 0.0), x=SPEEDS, y=(0.0, 8.0))


def test_every_point_has_its_multiplier_at_one(folds: CrossingCurve) -> None:
    for orbit in folds.orbits:
        assert np.abs(orbit.multipliers - 1.0).min() < 1e-5
        assert orbit.residual < 1e-8


def test_the_curve_passes_the_folds_of_single_branches(folds: CrossingCurve) -> None:
    for friction in (1.0, 3.0):
        (fold,) = specials(replace(RIG_1_B, slider_coulomb_friction=friction), SPEEDS[0], 1)[:1]
        order = np.argsort(folds.points[: np.argmax(folds.points[:, 1]), 1])
        curve = folds.points[: np.argmax(folds.points[:, 1])][order]
        assert np.interp(friction, curve[:, 1], curve[:, 0]) == pytest.approx(fold.parameter, rel=2e-5)


@pytest.mark.slow
def test_beyond_the_greatest_friction_of_the_curve_the_branch_from_below_has_no_fold(folds: CrossingCurve) -> None:
    # the curve rises to the friction at which the rising jump is gone, and goes on through a cusp to larger motions
    falling = np.diff(folds.points[:, 1]) < -1e-9
    top = folds.points[int(np.argmax(falling)), 1]
    assert 4.5 < top < 5.0
    assert specials(replace(RIG_1_B, slider_coulomb_friction=top - 0.05), SPEEDS[0], 1)
    assert not specials(replace(RIG_1_B, slider_coulomb_friction=top + 0.05), SPEEDS[0], 1)
    assert [end.reason for end in folds.ends] == [Reason.BOX, Reason.BOX]


def test_a_doubling_moves_with_the_damping() -> None:
    doubling = next(s for s in specials(RIG_1_B, SPEEDS[1], -1) if s.kind is Crossing.PERIOD_DOUBLING)
    place, ends = (doubling.parameter, 9.0), {"x": SPEEDS, "y": (5.0, 14.0)}
    curve = follow_crossing(with_damping, doubling.orbit, doubling.kind, place, **ends)
    assert all(np.abs(orbit.multipliers + 1.0).min() < 1e-6 for orbit in curve.orbits)
    order = np.argsort(curve.points[:, 1])
    for damping in (6.0, 8.0):
        single = specials(replace(RIG_1_B, slider_damping=damping), SPEEDS[1], -1)
        speeds = [s.parameter for s in single if s.kind is Crossing.PERIOD_DOUBLING]
        there = np.interp(damping, curve.points[order, 1], curve.points[order, 0])
        assert min(abs(there - speed) for speed in speeds) < 1e-4 * there


@pytest.mark.slow
def test_a_fold_of_a_motion_of_many_crank_lengths_is_followed_to_the_edges() -> None:
    rig = SETS["rig-2-spring-c"].parameters

    def at(speed: float, damping: float) -> tuple[FiveBarParameters, Drive]:
        return replace(rig, slider_damping=damping), Drive(speed=speed)

    place = 52.37244008, 0.55
    near, _ = trial_orbit(operating_point(*at(*place)), np.array([-0.20560797, -5.64346183]), 1)
    curve = follow_crossing(at, near, Crossing.FOLD, place, x=(18.4, 153.3), y=(0.55, 11.0))
    assert [end.reason for end in curve.ends] == [Reason.BOX, Reason.BOX]
    assert curve.points[[0, -1], 1] == pytest.approx(0.55)
    assert sorted(curve.points[[0, -1], 0]) == pytest.approx([52.3724, 55.5287], abs=1e-3)
    assert curve.points[:, 1].max() == pytest.approx(2.032, abs=2e-3)


def test_an_orbit_far_from_any_crossing_is_refused() -> None:
    orbit = find_orbit(RIG_1_B, speed=SPEEDS[0])
    with pytest.raises(ContinuationError):
        follow_crossing(with_damping, orbit, Crossing.PERIOD_DOUBLING, (SPEEDS[0], 9.0), x=SPEEDS, y=(5.0, 14.0))
