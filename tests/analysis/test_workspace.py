"""Coupler curves and the accessible area: against analytic cases, and against configurations that go forwards."""

from collections.abc import Callable
from dataclasses import replace
from math import hypot, inf, nan, pi

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.youssef import accessible, accessible_area, coupler_curve
from linkwork.errors import InputError
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import TABLE_3_1
from tests.strategies import seeded

WITH_POINT = replace(TABLE_3_1, coupler_point_distance=0.12, coupler_point_angle=0.5)


def scattered(
    parameters: FiveBarParameters, slider_range: tuple[float, float], count: int, seed: int = 1
) -> NDArray[np.float64]:
    """P at random configurations, through the plant's own kinematics, shape (k, 2)."""
    random = np.random.default_rng(seed)
    p = parameters.constants()
    points = []
    for th2, u in zip(random.uniform(0.0, 2.0 * pi, count), random.uniform(*slider_range, count)):
        if kinematics.assembly_square(th2, u, p) > 0.0:
            points.append(kinematics.coupler_point(kinematics.position(th2, u, p), p))
    return np.array(points).reshape(-1, 2)


def raster_area(points: NDArray[np.float64], cell: float) -> float:
    """Area of the square cells that hold a point."""
    return len(np.unique(np.floor(points / cell).astype(int), axis=0)) * cell**2


class TestCouplerCurve:
    def test_it_is_the_plants_coupler_point(self) -> None:
        p = WITH_POINT.constants()
        (arc,) = coupler_curve(WITH_POINT, 0.01, n=24).arcs
        for th2, x, y in zip(arc.crank_angle[:-1], arc.x, arc.y):
            assert (x, y) == kinematics.coupler_point(kinematics.position(th2, 0.01, p), p)

    def test_it_closes_where_the_crank_turns_fully(self) -> None:
        curve = coupler_curve(WITH_POINT, 0.0)
        assert curve.closed
        assert (curve.arcs[0].x[-1], curve.arcs[0].y[-1]) == (curve.arcs[0].x[0], curve.arcs[0].y[0])

    @pytest.mark.parametrize(("slider_position", "arcs"), [(0.12, 1), (0.16, 1), (0.25, 0), (-0.2035, 1)])
    def test_it_is_open_where_the_links_part(self, slider_position: float, arcs: int) -> None:
        # l3 + l4 = 30 cm, l2 = 5 cm: beyond u = 9.65 cm the crank cannot turn fully, beyond 19.65 cm nothing joins
        curve = coupler_curve(WITH_POINT, slider_position)
        assert len(curve.arcs) == arcs
        assert curve.closed == (slider_position < 0.0)
        for arc in curve.arcs:
            assert np.all(np.isfinite([arc.x, arc.y]))

    def test_the_ends_of_an_arc_are_limits_of_assembly(self) -> None:
        p = WITH_POINT.constants()
        (arc,) = coupler_curve(WITH_POINT, 0.14).arcs
        for end in (arc.crank_angle[0], arc.crank_angle[-1]):
            assert abs(min(kinematics.assembly_margin(end, 0.14, p))) < 1e-12
        for inside in arc.crank_angle[1:-1]:
            assert min(kinematics.assembly_margin(inside, 0.14, p)) > 0.0

    def test_two_arcs_where_the_crank_passes_neither_limit(self) -> None:
        # l3 - l4 = 12 cm and l3 + l4 = 18 cm leave BD, of 10 to 20 cm, a stretch on either side
        short = replace(WITH_POINT, ground_length=0.15, coupler_length=0.15, rocker_length=0.03)
        curve = coupler_curve(short, 0.0)
        assert len(curve.arcs) == 2
        assert not curve.closed
        np.testing.assert_allclose(curve.arcs[0].crank_angle, -curve.arcs[1].crank_angle[::-1], atol=1e-15)

    @pytest.mark.parametrize("seed", range(20))
    def test_random_mechanisms(self, seed: int) -> None:
        case = seeded(seed)
        p = case.parameters.constants()
        th2, u = case.state[:2]
        curve = coupler_curve(case.parameters, u, n=60)
        assert any(
            arc.crank_angle[0] <= th2 + turn * 2.0 * pi <= arc.crank_angle[-1]
            for arc in curve.arcs
            for turn in range(-3, 4)
        )
        spans = sum(arc.crank_angle[-1] - arc.crank_angle[0] for arc in curve.arcs)
        grid = np.linspace(0.0, 2.0 * pi, 4000, endpoint=False)
        joined = np.mean([kinematics.assembly_square(angle, u, p) > 0.0 for angle in grid])
        assert spans / (2.0 * pi) == pytest.approx(joined, abs=2e-3)


class TestAccessible:
    @pytest.mark.parametrize("seed", range(20))
    def test_every_configuration_of_a_random_mechanism_is_accessible(self, seed: int) -> None:
        case = seeded(seed)
        u = case.state[1]
        span = (u - 0.05, u + 0.05)
        points = scattered(case.parameters, span, 200)
        assert len(points)
        assert accessible(case.parameters, span, points[:, 0], points[:, 1]).all()

    def test_the_other_assembly_has_other_points(self) -> None:
        points = scattered(replace(WITH_POINT, assembly_branch=-1), (-0.02, 0.02), 200)
        assert not accessible(WITH_POINT, (-0.02, 0.02), points[:, 0], points[:, 1]).any()


class TestAccessibleArea:
    @pytest.mark.parametrize("branch", [1, -1])
    def test_annulus(self, branch: int) -> None:
        # C at the end of crank and coupler, a rocker that reaches everywhere: radii l3 - l2 and l3 + l2
        parameters = replace(TABLE_3_1, rocker_length=1.0, coupler_point_distance=0.15, assembly_branch=branch)
        area = accessible_area(parameters, (-3.0, 3.0))
        exact = pi * ((0.15 + 0.05) ** 2 - (0.15 - 0.05) ** 2)
        assert area.area == pytest.approx(exact, rel=1e-5)
        assert abs(area.area - exact) <= area.error
        assert area.converged
        assert len(area.outer) == len(area.holes) == 1
        np.testing.assert_allclose(np.hypot(*area.outer[0].T), 0.2, rtol=1e-9)
        np.testing.assert_allclose(np.hypot(*area.holes[0].T), 0.1, rtol=1e-9)

    def test_error_falls_with_the_square_of_the_cells(self) -> None:
        parameters = replace(TABLE_3_1, rocker_length=1.0, coupler_point_distance=0.15)
        exact = 4.0 * pi * 0.05 * 0.15
        errors = [
            abs(accessible_area(parameters, (-3.0, 3.0), tolerance=1e-12, finest=cells).area - exact)
            for cells in (128, 256, 512)
        ]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert np.all(orders > 1.5), orders

    def test_a_point_on_the_crank_pin_has_no_area(self) -> None:
        area = accessible_area(replace(TABLE_3_1, coupler_point_distance=0.0), (-0.04, 0.04))
        assert (area.area, area.outer, area.holes) == (0.0, (), ())

    def test_a_mechanism_that_joins_nowhere_has_no_area(self) -> None:
        area = accessible_area(WITH_POINT, (0.5, 0.6))
        assert (area.area, area.converged) == (0.0, True)

    @pytest.mark.parametrize(
        ("parameters", "span"),
        [
            (WITH_POINT, (-0.04, 0.04)),
            (replace(WITH_POINT, assembly_branch=-1), (-0.04, 0.04)),
            (replace(WITH_POINT, slider_guide_angle=0.7), (-0.03, 0.05)),
            (WITH_POINT, (0.05, 0.25)),  # joined on a part of the range only
            (WITH_POINT, (-0.2, 0.2)),  # B passes D, where l3 = l4 folds
            *((seeded(s).parameters, (seeded(s).state[1] - 0.05, seeded(s).state[1] + 0.05)) for s in (3, 6)),
        ],
        ids=["upper", "lower", "inclined", "partly", "folding", "random-3", "random-6"],
    )
    def test_against_random_configurations(self, parameters: FiveBarParameters, span: tuple[float, float]) -> None:
        area = accessible_area(parameters, span)
        assert area.converged
        points = scattered(parameters, span, 4000)
        # all inside, but for those closer to the boundary than its polygon is to it
        rings = np.concatenate([*area.outer, *area.holes])
        size = np.ptp(rings, axis=0).max() / area.cells
        for point in points[~area.contains(*points.T)]:
            assert hypot(*np.abs(rings - point).T[:, np.argmin(np.hypot(*(rings - point).T))]) < size
        # and none of the inside is out of reach, by another count of the area: cells of 4 mm that hold a point
        many = scattered_fast(parameters, span)
        cell = 0.004
        raster = raster_area(many, cell)
        perimeter = sum(np.hypot(*np.diff(ring, axis=0).T).sum() for ring in (*area.outer, *area.holes))
        # cells on the boundary count in full: on average they add half their width along it, in either direction
        assert abs(raster - area.area) < 0.9 * cell * perimeter
        assert raster > area.area * 0.99

    def test_an_area_thinner_than_the_finest_cell_is_told(self) -> None:
        area = accessible_area(WITH_POINT, (-1e-5, 1e-5), finest=256)
        assert not area.converged


@pytest.mark.parametrize(
    ("call", "message"),
    [
        *((lambda u=u: coupler_curve(WITH_POINT, u), "slider position is") for u in (nan, inf)),
        (lambda: coupler_curve(WITH_POINT, 0.0, n=1), "at least 2"),
        *(
            (lambda span=span: accessible_area(WITH_POINT, span), "slider range is")
            for span in ((0.1, 0.1), (0.1, 0.0), (0.0, inf), (nan, 1.0))
        ),
        (lambda: accessible_area(WITH_POINT, (0.0, 0.1), tolerance=0.0), "tolerance is"),
    ],
)
def test_what_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


def scattered_fast(parameters: FiveBarParameters, span: tuple[float, float]) -> NDArray[np.float64]:
    """P over a fine lattice of configurations, by the law of cosines for the triangle BCD, shape (k, 2)."""
    p = parameters.constants()
    th2, u = np.meshgrid(np.linspace(0.0, 2.0 * pi, 1500), np.linspace(*span, 1000))
    b = p.l2 * np.exp(1j * th2)
    to_d = p.l1 + u * complex(p.ca, p.sa) - b
    distance = np.abs(to_d)
    cosine = (distance**2 + p.l3**2 - p.l4**2) / (2.0 * p.l3 * np.maximum(distance, 1e-12))
    joined = np.abs(cosine) <= 1.0
    angle = np.angle(to_d[joined]) + p.branch * np.arccos(cosine[joined])
    point = b[joined] + complex(p.xp, p.yp) * np.exp(1j * angle)
    return np.column_stack([point.real, point.imag])
