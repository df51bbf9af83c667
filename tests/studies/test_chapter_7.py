"""The motions of the slider of chapter VII: the errors that are to be reached, recomputed by the plant's own kinematics."""

from dataclasses import replace
from math import atan2, cos, pi, sin

import numpy as np
import pytest

from analysis.numerics.fourier import FourierSeries
from analysis.slider import best_spring, inverse_dynamics
from analysis.studies.youssef import chapter_7, control, series_1, series_2
from analysis.studies.youssef.problems import PROBLEMS
from analysis.synthesis import Linkage, MachineSpec, SecondCrank, SliderMotion
from analysis.youssef import accessible_area
from linkwork.five_bar import kinematics

from .results import check, every


@every("7.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


@pytest.mark.slow
def test_methods_of_control() -> None:
    check("control")


@pytest.mark.slow
class TestControl:
    """The machine that the methods of control drive."""

    def test_forces(self) -> None:
        m = control.machine()
        bare = inverse_dynamics(m.model, m.motion, control.SPEED).rms_force
        sprung = best_spring(m.model, m.motion, control.SPEED).parameters
        assert inverse_dynamics(sprung, m.motion, control.SPEED).rms_force < bare / 1.5
        assert inverse_dynamics(m.model, m.motion, 2.0 * control.SPEED).rms_force > bare

    @pytest.mark.parametrize("harmonics", control.HARMONICS)
    def test_no_trial_cycle_is_worse_than_the_one_before(self, harmonics: int) -> None:
        errors = [control.rms(deviation) for deviation in control.run_trials(harmonics)]
        assert (np.diff(errors) < 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", [series_2.ROCKER, series_2.PATH])
def test_no_second_crank_nearby_is_better(name: str) -> None:
    """Another length or phase, or another ratio of the gears, of the crank that moves the rocker pivot."""
    found = control.with_second_crank(name)
    assert isinstance(found.pivot, SecondCrank)
    least = series_2.linkage_error(name, found)
    assert least < series_2.linkage_error(name, PROBLEMS[name].linkage)
    others = [replace(found.pivot, ratio=ratio) for ratio in control.GEARS if ratio != found.pivot.ratio]
    for factor, turned in ((0.95, 0.0), (1.05, 0.0), (1.0, -0.05), (1.0, 0.05)):
        others.append(replace(found.pivot, length=factor * found.pivot.length, phase=found.pivot.phase + turned))
    assert all(series_2.linkage_error(name, replace(found, pivot=pivot)) > least for pivot in others)


def test_cam() -> None:
    """Pressure angle and curvature of its pitch curve by finite differences."""
    found = control.cam(FourierSeries(np.array([0.0, 0.02, -0.008]), np.array([0.0, 0.01, 0.003])))
    z = found.curve[:-1]
    tangent = np.roll(z, -1) - np.roll(z, 1)
    # the follower moves along the radius, and the cam presses along the normal
    angle = np.abs(np.angle(tangent / (1j * z)))
    assert np.degrees(angle.max()) == pytest.approx(30.0, abs=0.01)
    turned = np.angle(np.roll(tangent, -1) / np.roll(tangent, 1)) / (2.0 * np.abs(0.5 * tangent))
    assert found.curvature == pytest.approx(1.0 / turned.max(), rel=1e-3)


# Goals: areas (cm2) by the number of harmonics, the printed links kept. The thesis prints 4.3 for two
PATH_GOAL = {2: 4.05, 3: 3.05, 5: 2.35}
# Best known sums of squared errors at N = 24 over the weight (deg2), of which the thesis prints 4.8 for two: a search that
# gets worse shows here first
ROCKER_BEST = {1: 2.334, 2: 0.7221, 3: 0.4896}


def by_the_plant(linkage: Linkage, phi: float, u: float, guide: float) -> tuple[complex, float]:
    """P in the plane (m) and the rocker's angle (rad), by `linkwork.five_bar.kinematics` alone."""
    fixed = replace(linkage, pivot=SliderMotion(series_2.slider(linkage).series, guide) if linkage.pivot else None)
    p = replace(MachineSpec().sliding_five_bar(fixed), slider_guide_angle=guide).constants()
    g = kinematics.position(phi + linkage.crank_phase, u, p)
    place = complex(linkage.pivot_x, linkage.pivot_y)
    turned = complex(cos(linkage.ground_angle), sin(linkage.ground_angle))
    return place + turned * complex(*kinematics.coupler_point(g, p)), atan2(g.s4, g.c4)


def weighted_error(linkage: Linkage) -> float:
    """Sum of the squared errors of the rocker's angle at N = 24, weighted and over the weight (deg2)."""
    total = 0.0
    for k in range(24):
        phi = 2.0 * pi * k / 24
        motion = series_2.slider(linkage)
        _, angle = by_the_plant(linkage, phi, float(motion.series(phi)), motion.guide_angle)
        off = np.degrees(angle) - (70.0 + 100.0 * abs(sin(0.5 * phi)))
        weight = 1000.0 if 60 <= 15 * k <= 260 else 1.0
        total += weight * ((off + 180.0) % 360.0 - 180.0) ** 2
    return float(total / 1000.0)


def area(linkage: Linkage) -> float:
    """Area between coupler curve and ellipse (cm2), both as 720-gons: neither crosses itself."""
    from shapely import Polygon

    motion = series_2.slider(linkage)
    t = np.linspace(0.0, 2.0 * pi, 720, endpoint=False)
    points = [by_the_plant(linkage, phi, float(motion.series(phi)), motion.guide_angle)[0] for phi in t.tolist()]
    curve = Polygon([(100.0 * z.real, 100.0 * z.imag) for z in points])
    ellipse = Polygon(np.column_stack([20.0 + 15.0 * np.cos(t), 15.0 + 5.0 * np.sin(t)]))
    assert curve.is_valid
    return float(curve.symmetric_difference(ellipse).area)


@pytest.mark.slow
class TestGoals:
    """What is to be reached with the printed links kept."""

    @pytest.mark.parametrize("harmonics", ROCKER_BEST)
    def test_the_angle_is_the_best_known(self, harmonics: int) -> None:
        error = series_2.linkage_error(series_2.ROCKER, series_2.rocker_motion(harmonics).linkage)
        assert weighted_error(series_2.rocker_motion(harmonics).linkage) == pytest.approx(error, rel=1e-9)
        assert error <= ROCKER_BEST[harmonics]

    def test_defects_and_strokes(self) -> None:
        motions = [series_2.rocker_motion(n) for n in (1, 2, 3)] + [
            series_2.path_motion(n) for n in series_2.PATH_SEARCHES
        ]
        assert all(s.verdicts.sound for s in motions)
        assert min(s.linkage.least_transmission for s in motions[:3]) > np.radians(20.0)
        for n, (_, stroke) in series_2.PATH_SEARCHES.items():
            assert series_2.slider(series_2.path_motion(n).linkage).stroke <= 1.001 * stroke
        assert series_2.slider(series_2.path_motion(2).linkage).stroke < 0.036

    @pytest.mark.parametrize("harmonics", PATH_GOAL)
    def test_the_path(self, harmonics: int) -> None:
        error = series_2.linkage_error(series_2.PATH, series_2.path_motion(harmonics).linkage)
        assert error <= PATH_GOAL[harmonics]
        # the study's curve is a 360-gon, this one a 720-gon
        assert area(series_2.path_motion(harmonics).linkage) == pytest.approx(error, abs=0.03)
        assert series_2.slider(series_2.path_motion(harmonics).linkage).series.order == harmonics

    def test_a_stroke_beyond_the_limit_reaches_less(self) -> None:
        series = FourierSeries(np.array([1.005, 15.748, -2.555]) / 100.0, np.array([0.0, 27.293, 1.024]) / 100.0)
        longer = replace(PROBLEMS[series_2.PATH].linkage, pivot=SliderMotion(series, 0.163))
        assert series_2.slider(longer).stroke > series_2.PATH_SEARCHES[2][1]
        assert area(longer) < series_2.linkage_error(series_2.PATH, series_2.path_motion(2).linkage) / 1.1
        assert area(longer) == pytest.approx(series_2.linkage_error(series_2.PATH, longer), abs=0.03)

    def test_the_links_are_the_printed_ones(self) -> None:
        for name, motions in (
            (series_2.ROCKER, [series_2.rocker_motion(n) for n in (1, 2, 3)]),
            (series_2.PATH, [series_2.path_motion(n) for n in (2, 3, 5)]),
        ):
            for found in motions:
                assert found.linkage.values() == pytest.approx(PROBLEMS[name].linkage.values(), rel=1e-12)

    def test_no_motion_traces_what_is_out_of_reach(self) -> None:
        # P is l2 + r from A at most: at each y the ellipse ends at the right, and the reach is left of that or not
        k = PROBLEMS[series_2.PATH].linkage
        y = np.linspace(0.10, 0.20, 200_001)
        half = 0.15 * np.sqrt(np.clip(1.0 - ((y - 0.15) / 0.05) ** 2, 0.0, None))
        reach = k.pivot_x + np.sqrt((k.crank_length + k.point_distance) ** 2 - (y - k.pivot_y) ** 2)
        beyond = np.clip(0.20 + half - np.maximum(reach, 0.20 - half), 0.0, None)
        assert series_2.out_of_reach() == pytest.approx(1e4 * beyond.mean() * 0.10, abs=1e-5)


class TestPrintedSeries:
    """The two series of the slider that the thesis prints."""

    def test_path_b_with_a_tenth_of_its_mean_has_the_printed_area(self) -> None:
        linkage = series_2.mended_path_linkage()
        motion = series_2.slider(linkage)
        assert 100.0 * motion.series.cos == pytest.approx([0.31, 0.772, 0.568])
        assert 100.0 * motion.series.sin == pytest.approx([0.0, -0.34, -0.136])
        assert np.degrees(motion.guide_angle) == pytest.approx(-0.9)
        least, greatest = series_2.error_range(series_2.PATH, linkage)
        assert least < area(linkage) < greatest
        # by trying the corners of the rounding one after another, with an area by polygons of shapely
        assert (least, greatest) == pytest.approx((3.933, 4.756), abs=2e-3)

    def test_the_argument_of_the_series_may_be_the_crank_angle(self) -> None:
        k = PROBLEMS[series_2.ROCKER].linkage
        phi = np.linspace(0.0, 2.0 * pi, 9)
        th2 = phi + k.crank_phase
        wanted = 1.46 - 0.425 * np.cos(th2) - 0.256 * np.sin(th2) - 0.855 * np.cos(2 * th2) + 0.569 * np.sin(2 * th2)
        series = series_2.slider(series_2.printed_linkage(series_2.ROCKER, turned=k.crank_phase)).series
        assert 100.0 * series(phi) == pytest.approx(wanted)

    def test_no_reading_of_the_rockers_comes_near_to_its_error(self) -> None:
        best = series_2.readings(series_2.ROCKER)[0]
        least, greatest = series_2.error_range(series_2.ROCKER, best)
        assert 8.0 * 4.8 < least < series_2.linkage_error(series_2.ROCKER, best) < greatest


class TestSeries1:
    """The mechanism with links of 0.5 and 1."""

    def test_the_error_by_the_plant(self) -> None:
        found = series_1.search_directly()
        motion = series_2.slider(found.linkage)
        points = [by_the_plant(found.linkage, t, float(motion.series(t)), 0.0)[0] for t in series_1.ROTATION.tolist()]
        assert (np.abs(np.array(points) - series_1.desired_points()) ** 2).sum() == pytest.approx(found.error, rel=1e-9)

    def test_the_equations_give_stationary_errors(self) -> None:
        targets = series_1.desired_points()
        u, upright = series_1.solve_slider_equations(series_1.ROTATION, targets)
        assert 0 < upright.sum() < len(upright)
        near_by = series_1.variational().u[:, None] + np.array([-1e-6, 0.0, 1e-6])
        assert np.abs(u - 1.0 - near_by[:, [1]]).min(axis=1).max() < 1e-9
        points = [chapter_7.coupler_point(series_1.ROTATION, near_by[:, k]) for k in range(3)]
        errors = np.abs(np.array(points) - targets) ** 2
        assert np.abs(errors[2] - errors[0]).max() / 2e-6 < 1e-5

    def test_tangents_are_vertical_where_the_coupler_ceases_to_point_at_the_target(self) -> None:
        """The equation (7.14) has a root on one side alone; near it U goes as the root of the distance."""
        at = np.radians(series_1.vertical_tangents())
        _, upright = series_1.solve_slider_equations(at + 1e-6, series_1.desired_points(at + 1e-6))
        assert upright.tolist() == [True, False]
        off = np.outer([-1.0, 1.0], [0.0, 1e-8, 4e-8])
        reached = at[:, None] + off
        u, _ = series_1.solve_slider_equations(reached.ravel(), series_1.desired_points(reached.ravel()))
        change = np.ptp(u, axis=1).reshape(reached.shape)
        assert change[:, 2] / change[:, 1] == pytest.approx(2.0, rel=1e-2)

    def test_isochronous_curves_are_circles_about_the_crank_pin(self) -> None:
        for phi in np.radians(chapter_7.ISOCHRONES).tolist():
            arc = chapter_7.coupler_point(np.full(9, phi), np.linspace(-0.4, 0.4, 9))
            assert np.abs(arc - 0.5 * np.exp(1j * phi)) == pytest.approx(0.5, abs=1e-12)

    def test_area_that_is_reached(self) -> None:
        """Against random configurations, and a sum over small squares by the kinematics of the point."""
        area = accessible_area(MachineSpec().sliding_five_bar(chapter_7.LINKAGE), (-0.4, 0.4), tolerance=1e-4)
        random = np.random.default_rng(72)
        z = chapter_7.coupler_point(random.uniform(0.0, 2.0 * pi, 5000), random.uniform(-0.4, 0.4, 5000))
        rings = np.concatenate([*area.outer, *area.holes]) @ np.array([1.0, 1j])
        inside = area.contains(z.real, z.imag)
        assert max((np.abs(rings - p).min() for p in z[~inside]), default=0.0) < 2e-3
        h = 4e-3
        phi, u = np.meshgrid(np.linspace(0.0, 2.0 * pi, 4001), np.linspace(-0.4, 0.4, 801))
        z = chapter_7.coupler_point(phi.ravel(), u.ravel())
        squares = np.unique(np.floor(np.column_stack([z.real, z.imag]) / h), axis=0)
        # squares on the edge count whole
        assert h * h * len(squares) == pytest.approx(area.area, rel=0.04)

    @pytest.mark.parametrize("limits", chapter_7.LIMITS)
    def test_enclosed_area_is_what_is_reached_and_the_hole(self, limits: tuple[float, float]) -> None:
        area = chapter_7.reached_area(*limits)
        holes = 0.0
        for ring in area.holes:
            w = ring @ np.array([1.0, 1j])
            holes += abs(0.5 * (w.conj() * np.roll(w, -1)).imag.sum())
        assert chapter_7.enclosed_area(*limits) == pytest.approx(area.area + holes, rel=2e-3)

    def test_no_motion_is_nearer_than_the_variational_one(self) -> None:
        least = series_1.variational().error
        assert (least <= series_1.search_directly().evaluation.errors + 1e-9).all()
        for k in (0, 20, 41):
            found, _ = series_1.least_distance(float(series_1.ROTATION[k]), complex(series_1.desired_points()[k]))
            assert least[k] == pytest.approx(found, abs=1e-3)

    @pytest.mark.slow
    def test_a_weight_moves_error_out_of_p1_p2(self) -> None:
        found = (series_1.search_directly(5.0), series_1.search_directly())
        (inside, outside), (even, rest) = map(series_1.squared_errors, found)
        assert inside < even
        assert outside > rest

    def test_weights_are_those_of_p1_p2(self) -> None:
        assert series_1.WITHIN.sum() == 13
        assert np.degrees(series_1.ROTATION[series_1.WITHIN])[[0, -1]] == pytest.approx([150.0, 210.0])
