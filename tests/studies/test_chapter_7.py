"""The motions of the slider of chapter VII: the errors that are to be reached, recomputed by the plant's own kinematics."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.studies.study import StudyResult
from analysis.studies.youssef import (
    fig_7_3,
    fig_7_4,
    fig_7_5,
    fig_7_6,
    fig_7_7,
    fig_7_8,
    fig_7_9,
    fig_7_10,
    fig_7_11,
    fig_7_12,
)
from analysis.studies.youssef._chapter_7 import PATH, ROCKER, path_motion, rocker_motion, slider
from analysis.synthesis import Linkage, SliderMotion
from analysis.synthesis.published import PROBLEMS
from linkwork.five_bar import kinematics

from .results import check_plot_and_data, check_verdicts, every

#: What the thesis states and the right physics does not bear out.
REFUTED: set[tuple[str, str]] = set()
#: Studies whose results take more than a second or two.
LONG = {"7.6", "7.7", "7.8", "7.9", "7.10", "7.11", "7.12"}


@every("7.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED)


@every("7.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)


# Goals: sums of squared errors at N = 24 over the weight (deg2), areas (cm2), by the number of harmonics, the printed links
# kept. The thesis prints 4.8 and 4.3 for two
ROCKER_GOAL = {2: 0.76}
PATH_GOAL = {2: 4.05, 3: 3.05, 5: 2.35}
# Best known: a change for the worse of a search shows here first
ROCKER_BEST = {1: 2.334, 2: 0.7221, 3: 0.4896}


@pytest.fixture(scope="module")
def results() -> dict[str, StudyResult]:
    return {module.NUMBER: module.compute() for module in (fig_7_6, fig_7_7, fig_7_8)}


def computed(result: StudyResult, statement: str) -> float:
    """The computed value of a statement, the same for every source."""
    (value,) = {v.computed for v in result.verdicts if v.statement == statement}
    return value


def by_the_plant(linkage: Linkage, phi: float, u: float, guide: float) -> tuple[complex, float]:
    """P in the plane (m) and the rocker's angle (rad), by `linkwork.five_bar.kinematics` alone."""
    fixed = replace(linkage, pivot=SliderMotion(slider(linkage).series, guide) if linkage.pivot else None)
    p = replace(fixed.to_five_bar(), slider_guide_angle=guide).constants()
    g = kinematics.position(phi + linkage.crank_phase, u, p)
    place = complex(linkage.pivot_x, linkage.pivot_y)
    turned = complex(cos(linkage.ground_angle), sin(linkage.ground_angle))
    return place + turned * complex(*kinematics.coupler_point(g, p)), kinematics.rocker_angle(g)


def weighted_error(linkage: Linkage) -> float:
    """Sum of the squared errors of the rocker's angle at N = 24, weighted and over the weight (deg2)."""
    total = 0.0
    for k in range(24):
        phi = 2.0 * pi * k / 24
        motion = slider(linkage)
        _, angle = by_the_plant(linkage, phi, float(motion.series(phi)), motion.guide_angle)
        off = np.degrees(angle) - (70.0 + 100.0 * abs(sin(0.5 * phi)))
        weight = 1000.0 if 60 <= 15 * k <= 260 else 1.0
        total += weight * ((off + 180.0) % 360.0 - 180.0) ** 2
    return float(total / 1000.0)


def area(linkage: Linkage) -> float:
    """Area between coupler curve and ellipse (cm2), both as 720-gons: neither crosses itself."""
    from shapely import Polygon

    motion = slider(linkage)
    t = np.linspace(0.0, 2.0 * pi, 720, endpoint=False)
    points = [by_the_plant(linkage, phi, float(motion.series(phi)), motion.guide_angle)[0] for phi in t.tolist()]
    curve = Polygon([(100.0 * z.real, 100.0 * z.imag) for z in points])
    ellipse = Polygon(np.column_stack([20.0 + 15.0 * np.cos(t), 15.0 + 5.0 * np.sin(t)]))
    assert curve.is_valid
    return float(curve.symmetric_difference(ellipse).area)


@pytest.mark.slow
class TestGoals:
    """What is to be reached with the printed links kept."""

    def test_the_angle_with_two_harmonics(self, results: dict[str, StudyResult]) -> None:
        error = computed(results["7.6"], "error with two harmonics")
        assert error <= ROCKER_GOAL[2]
        assert weighted_error(rocker_motion(2).linkage) == pytest.approx(error, rel=1e-9)

    @pytest.mark.parametrize("harmonics", ROCKER_BEST)
    def test_the_angle_is_the_best_known(self, harmonics: int) -> None:
        assert weighted_error(rocker_motion(harmonics).linkage) <= ROCKER_BEST[harmonics]

    @pytest.mark.parametrize(
        ("number", "word", "harmonics"), [("7.7", "two", 2), ("7.8", "three", 3), ("7.8", "five", 5)]
    )
    def test_the_path(self, results: dict[str, StudyResult], number: str, word: str, harmonics: int) -> None:
        error = computed(results[number], f"area with {word} harmonics")
        assert error <= PATH_GOAL[harmonics]
        # the study's curve is a 360-gon, this one a 720-gon
        assert area(path_motion(harmonics).linkage) == pytest.approx(error, abs=0.03)
        assert slider(path_motion(harmonics).linkage).series.order == harmonics

    def test_the_links_are_the_printed_ones(self) -> None:
        for name, motions in (
            (ROCKER, [rocker_motion(n) for n in (1, 2, 3)]),
            (PATH, [path_motion(n) for n in (2, 3, 5)]),
        ):
            for found in motions:
                assert found.linkage.values() == pytest.approx(PROBLEMS[name].linkage.values(), rel=1e-12)

    def test_no_motion_traces_what_is_out_of_reach(self) -> None:
        # P is l2 + r from A at most; over the ellipse by a sum over small squares
        h = 2e-4
        x, y = np.meshgrid(np.arange(0.05, 0.35, h) + 0.5 * h, np.arange(0.10, 0.20, h) + 0.5 * h)
        k = PROBLEMS[PATH].linkage
        inside = ((x - 0.20) / 0.15) ** 2 + ((y - 0.15) / 0.05) ** 2 <= 1.0
        beyond = np.hypot(x - k.pivot_x, y - k.pivot_y) > k.crank_length + k.point_distance
        assert fig_7_8.out_of_reach() == pytest.approx(1e4 * h * h * (inside & beyond).sum(), abs=5e-3)

    def test_links_and_slider_together(self) -> None:
        assert area(fig_7_9.together(2).linkage) < 0.04


class TestOneCrankAngle:
    """Fig 7.3."""

    @pytest.mark.parametrize("name", fig_7_3.targets())
    def test_every_candidate_is_stationary(self, name: str) -> None:
        target = fig_7_3.targets()[name]
        for point in fig_7_3.stationary(target):
            u = point.u + np.array([-1e-5, 0.0, 1e-5])
            lower, here, upper = fig_7_3.swept(target, point.branch, u) ** 2
            # dE^2/du, against E^2 over the length of the coupler
            assert abs(upper - lower) / 2e-5 < 1e-4 * here / fig_7_3.LINKAGE.coupler_length

    def test_all_four_perpendicular_ones_are_there(self) -> None:
        for target in fig_7_3.targets().values():
            assert sum(p.what != fig_7_3.KINDS[0] for p in fig_7_3.stationary(target)) == 4


class TestTracedCurve:
    """Fig 7.4."""

    def test_the_curve_touches_both_circles(self) -> None:
        p = fig_7_4.mechanism(1)
        distance = np.abs(fig_7_4.ellipse(np.linspace(0.0, 2.0 * pi, 20001), fig_7_4.centre()))
        assert distance.max() == pytest.approx(p.coupler_point_distance + p.crank_length, abs=1e-9)
        assert distance.min() == pytest.approx(p.coupler_point_distance - p.crank_length, abs=1e-9)

    def test_it_is_that_ellipse(self) -> None:
        z = (fig_7_4.motion().point - fig_7_4.centre()) * np.exp(-1j * fig_7_4.TILT)
        assert (z.real / 0.061) ** 2 + (z.imag / 0.02) ** 2 == pytest.approx(np.ones(z.size), abs=1e-12)

    def test_a_series_follows_the_slider(self) -> None:
        m = fig_7_4.motion()
        assert np.abs(fig_7_4.series()(m.crank_angle) - m.u).max() < 1e-9


class TestVariational:
    """Fig 7.5."""

    def test_the_function_is_met_exactly_with_the_guide_at_30_deg(self) -> None:
        found = fig_7_5.motion("guide at 30 deg")
        linkage = PROBLEMS[ROCKER].linkage
        for phi, u in zip(found.rotation.tolist()[::7], found.u.tolist()[::7]):
            _, angle = by_the_plant(linkage, phi, u, radians(30.0))
            assert np.degrees(angle) == pytest.approx(70.0 + 100.0 * abs(sin(0.5 * phi)), abs=1e-9)

    def test_the_jump_is_one_and_the_continuous_motion_has_none(self) -> None:
        def largest_step(u: NDArray[np.float64]) -> float:
            return float(np.abs(np.diff(np.append(u, u[0]))).max())

        jumping, smooth = (fig_7_5.motion(f"guide at -35 deg{end}") for end in ("", "; continuous"))
        assert largest_step(jumping.u) > 0.05
        assert largest_step(smooth.u) < 0.02
        assert len(jumping.jumps) == 1


@pytest.mark.slow
class TestDynamics:
    """Fig 7.12."""

    def test_the_plant_goes_with_the_linkage(self) -> None:
        linkage, m = rocker_motion(2).linkage, fig_7_12.machine()
        assert m.sprung.slider_stiffness > 0.0
        for phi in (0.0, 1.0, 4.0):
            th2 = phi + linkage.crank_phase
            assert float(m.motion(th2)) == pytest.approx(float(slider(linkage).series(phi)), abs=1e-12)
            wanted = float(linkage.rocker_angle([phi])[0])
            assert cos(float(fig_7_12.rocker_angle(np.array([th2]))[0]) - wanted) == pytest.approx(1.0, abs=1e-12)

    def test_power_is_what_damper_and_friction_take(self) -> None:
        drive = fig_7_12.drives()["without a spring"]
        v = drive.states[:, 3]
        taken = fig_7_12.DAMPING * np.mean(v**2) + fig_7_12.FRICTION * np.mean(np.abs(v))
        crank = drive.balance.torque / drive.period
        assert drive.mean_power + crank == pytest.approx(taken, rel=1e-3)


@pytest.mark.slow
def test_smoothness_and_strategy_say_the_same_as_their_steps() -> None:
    for n in fig_7_10.HARMONICS:
        for bound, solution in zip(fig_7_10.BOUNDS, fig_7_10.curve(n).solutions):
            assert solution is not None
            phi = np.linspace(0.0, 2.0 * pi, 1001)
            curvature = np.gradient(np.gradient(slider(solution.linkage).series(phi), phi), phi)[2:-2]
            assert 100.0 * np.abs(curvature).max() <= 1.01 * bound
    steps = fig_7_11.strategy().steps
    assert [step.value <= radians(fig_7_11.TOLERANCE) for step in steps] == [False] * (len(steps) - 1) + [True]
