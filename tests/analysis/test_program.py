"""The nonlinear program: its optima by finite differences, every kind of constraint in its results, least squares beside it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls

import analysis.synthesis as syn
from analysis.numerics.fourier import FourierSeries
from analysis.synthesis.search.fit import fit_least_squares, residuals, sum_of_squares
from analysis.synthesis.search.program import Program, Start, make_linkage, make_start
from analysis.synthesis.search.scan import scan
from analysis.synthesis.task.limits import make_limits
from analysis.synthesis.task.task import Normal
from linkwork.errors import InputError, ParameterError
from tests.linkages import drawn, ellipse

pytest.importorskip("casadi")
FloatArray = NDArray[np.float64]


TASK = syn.TimedPath(points=ellipse(24))
#: Four-bars within which the target, 0.22 m across, can be traced.
SMALL = syn.LargestLink(length=0.5)


FEW = syn.Search(candidates=1 << 13, starts=4)


def best(*constraints: syn.Constraint, task: syn.Task = TASK, search: syn.Search = FEW, **more: Any) -> syn.Solution:
    return syn.synthesize(task, constraints=constraints, search=search, **more).best


class TestOptimum:
    def stationary(self, program: Program, normal: Normal, start: Start, *, rotation: bool) -> float:
        """What is left of the gradient of the quality by finite differences, outside the cone of the active constraints.

        Karush, Kuhn and Tucker: -grad f = sum of multipliers times the gradients of what is active, the multipliers of
        inequalities none below zero. Least squares with such multipliers; as a share of the gradient's parts.
        """
        z = start.q.copy() if not rotation else np.concatenate([start.q, start.rotation])

        def quality(x: FloatArray) -> float:
            at = Start(q=x[:11], branch=start.branch, rotation=x[11:] if rotation else None)
            return sum_of_squares(normal, at)

        limits = program.limits

        def inequalities(x: FloatArray) -> FloatArray:
            l1, l2, l3, l4 = x[2:6]
            product = 2.0 * l3 * l4 * math.cos(limits.turn)
            return np.array(
                [
                    l3 * l3 + l4 * l4 - (l1 - l2) ** 2 - product,
                    (l1 + l2) ** 2 - l3 * l3 - l4 * l4 - product,
                    *(x[:11] - limits.high),
                    *(limits.low - x[:11]),
                ]
            )

        def gradient(f: Any) -> FloatArray:
            h = 1e-6
            columns = [(f(z + h * e) - f(z - h * e)) / (2.0 * h) for e in np.eye(len(z))]
            return np.array(columns)

        slope = gradient(quality)
        values = inequalities(z)
        active = values > -1e-5
        assert (values < 1e-7).all()
        columns = gradient(inequalities)[:, active]
        multipliers, left = nnls(columns, -slope) if active.any() else (None, float(np.linalg.norm(slope)))
        scale = float(np.linalg.norm(columns * multipliers, axis=0).max()) if active.any() else 0.0
        return float(left) / max(scale, 1e-3)

    def test_of_a_timed_path(self) -> None:
        normal = syn.normal_form(TASK)
        limits = make_limits(TASK, normal, None, (SMALL, syn.LeastTransmission(angle=radians(60))))
        program = Program(normal, limits)
        for start in scan(normal, limits, seed=0, candidates=4096, starts=4):
            answer = program.solve(start)
            assert answer.feasible
            assert answer.converged
            assert answer.start.quality == pytest.approx(sum_of_squares(normal, answer.start), rel=1e-9)
            assert answer.start.quality < start.quality
            assert self.stationary(program, normal, answer.start, rotation=False) < 1e-4

    def test_of_poses_without_rotations(self) -> None:
        known = drawn(np.random.default_rng(3), least=0.8)
        rotation = np.linspace(0.0, 3.0, 8)
        noise = np.random.default_rng(0).normal(scale=0.02, size=(8, 2))
        task = syn.Motion(points=known.path(rotation) + noise, angle=known.coupler_angle(rotation))
        normal = syn.normal_form(task)
        limits = make_limits(task, normal, None, syn.USUAL)
        program = Program(normal, limits)
        answer = program.solve(make_start(known, normal, rotation=rotation))
        assert answer.feasible
        assert answer.converged
        assert np.all(np.diff(answer.start.rotation) > 0.01)
        assert self.stationary(program, normal, answer.start, rotation=True) < 1e-4

    def test_of_a_rocker_function(self) -> None:
        angle = 1.2 + 0.5 * np.sin(syn.turn(24)) + 0.1 * np.cos(2.0 * syn.turn(24))
        task = syn.RockerFunction(angle=angle)
        normal = syn.normal_form(task)
        limits = make_limits(task, normal, {"ground_length": (0.1, 0.1)}, syn.USUAL)
        program = Program(normal, limits)
        answer = program.solve(scan(normal, limits, seed=0, candidates=4096, starts=1)[0])
        assert answer.feasible
        assert self.stationary(program, normal, answer.start, rotation=False) < 1e-4


class TestLeastSquares:
    def test_it_agrees_with_ipopt_where_bounds_are_all_that_is_asked(self) -> None:
        normal = syn.normal_form(TASK)
        limits = make_limits(TASK, normal, {"crank_length": (0.02, 0.06), "ground_length": (0.1, 0.4)}, ())
        assert limits.bounds_only
        known = syn.Linkage(
            pivot_x=0.2, pivot_y=-0.1, ground_length=0.3, crank_length=0.05, coupler_length=0.35, rocker_length=0.3,
            point_distance=0.3, ground_angle=0.2, point_angle=0.9, crank_phase=0.4,
        )  # fmt: skip
        program = Program(normal, limits)
        qualities = []
        for start in scan(normal, limits, seed=0, candidates=8192, starts=6):
            squares = fit_least_squares(normal, limits, start)
            ipopt = program.solve(squares.start)
            assert squares.feasible
            assert ipopt.start.quality == pytest.approx(squares.start.quality, rel=1e-5)
            qualities.append(squares.start.quality)
        assert min(qualities) < sum_of_squares(normal, make_start(known, normal))

    @pytest.mark.parametrize("kind", ["path", "rocker", "motion"])
    def test_residuals_have_the_jacobian_that_differences_give(self, kind: str) -> None:
        random = np.random.default_rng(1)
        known = drawn(random, least=0.6)
        rotation = np.linspace(0.0, 4.0, 6)
        tasks: dict[str, syn.Task] = {
            "path": syn.TimedPath(points=known.path(rotation), rotation=rotation, weights=[1, 2, 3, 4, 5, 6]),
            "rocker": syn.RockerFunction(angle=known.rocker_angle(rotation), rotation=rotation, mounting=True),
            "motion": syn.Motion(
                points=known.path(rotation),
                angle=known.coupler_angle(rotation),
                rotation=rotation,
                weights=[1, 2, 3, 4, 5, 6],
            ),
        }
        normal = syn.normal_form(tasks[kind])
        q = make_start(known, normal).q
        residual, jacobian, rate = residuals(normal, known.branch, q, rotation)
        assert np.abs(residual).max() < 1e-12
        q = q + 0.01 * random.normal(size=11)
        residual, jacobian, rate = residuals(normal, known.branch, q, rotation)
        h = 1e-6
        for k, e in enumerate(np.eye(11)):
            ends = [residuals(normal, known.branch, q + step * e, rotation)[0] for step in (h, -h)]
            np.testing.assert_allclose(jacobian[:, k], (ends[0] - ends[1]) / (2.0 * h), atol=1e-8)
        ends = [residuals(normal, known.branch, q, rotation + step)[0] for step in (h, -h)]
        np.testing.assert_allclose(rate, (ends[0] - ends[1]) / (2.0 * h), atol=1e-8)


class TestBounds:
    @pytest.mark.parametrize(
        ("name", "low", "high"),
        [
            ("pivot_x", 0.30, 0.32),
            ("rocker_length", 0.3, 0.31),
            ("point_distance", 0.1, 0.15),
            ("crank_phase", -0.5, -0.4),
        ],
    )
    def test_each_holds(self, name: str, low: float, high: float) -> None:
        solution = best(*syn.USUAL, bounds={name: (low, high)})
        assert low - 1e-9 <= getattr(solution.linkage, name) <= high + 1e-9

    def test_equal_ones_fix(self) -> None:
        for constraints in ((), syn.USUAL):
            solution = best(*constraints, bounds={"crank_length": (0.05, 0.05), "pivot_x": (0.25, 0.25)})
            assert solution.linkage.crank_length == pytest.approx(0.05, abs=1e-12)
            assert solution.linkage.pivot_x == pytest.approx(0.25, abs=1e-12)

    def test_the_size_cap_counts_the_coupler_point_too(self) -> None:
        solution = best(*syn.USUAL, syn.LargestLink(length=0.2))
        assert max(solution.linkage.largest_link, solution.linkage.point_distance) <= 0.2 + 1e-9
        assert solution.error > best(*syn.USUAL, syn.LargestLink(length=0.5)).error


L_SHAPE = np.array([[0.0, -0.3], [0.6, -0.3], [0.6, -0.2], [0.1, -0.2], [0.1, 0.3], [0.0, 0.3]])


class TestConstraints:
    @pytest.mark.parametrize("pivot", ["A", "D"])
    @pytest.mark.parametrize("polygon", [np.array([[0.3, -0.1], [0.5, -0.1], [0.4, 0.05]]), L_SHAPE, L_SHAPE[::-1]])
    def test_a_pivot_stays_in_its_region(self, pivot: Any, polygon: FloatArray) -> None:
        from shapely import Point, Polygon

        solution = best(*syn.USUAL, SMALL, syn.PivotRegion(pivot=pivot, polygon=polygon))
        place = solution.linkage.pins(0.0)[pivot]
        assert Polygon(polygon).distance(Point(place)) < 1e-7

    @pytest.mark.parametrize("type_", ["crank-rocker", "drag-link", "double-rocker", "rocker-crank", "triple-rocker"])
    def test_every_grashof_type_can_be_had(self, type_: Any) -> None:
        # an arc, half a turn of the crank at most: what each type can do
        t = np.linspace(0.0, 1.2, 9)
        task = syn.TimedPath(points=np.column_stack([np.cos(t), np.sin(t) + 0.1 * t * t]), rotation=t)
        solution = best(syn.Grashof(type=type_), task=task)
        assert solution.verdicts.grashof == type_
        assert solution.evaluation.worst < 0.05

    def test_least_transmission_over_a_turn(self) -> None:
        for angle in (20.0, 40.0, 65.0):
            solution = best(SMALL, syn.LeastTransmission(angle=radians(angle)), bounds={"rocker_length": (0.01, 0.12)})
            assert solution.linkage.least_transmission >= radians(angle) - 1e-7
            assert solution.verdicts.full_turn

    def test_least_transmission_over_the_task_alone(self) -> None:
        rotation = np.linspace(0.0, 1.2, 8)
        task = syn.TimedPath(points=np.column_stack([rotation, 0.2 * rotation**2]), rotation=rotation)
        solution = best(
            syn.LeastTransmission(angle=radians(50), over="task"), syn.Grashof(type="triple-rocker"), task=task
        )
        assert solution.linkage.transmission(rotation).min() >= radians(50) - 1e-6
        assert not solution.verdicts.full_turn
        assert solution.linkage.least_transmission == 0.0
        assert solution.verdicts.sound

    @pytest.mark.parametrize("branch", [1, -1])
    def test_assembly(self, branch: int) -> None:
        assert best(*syn.USUAL, syn.Assembly(branch=branch)).linkage.branch == branch

    def test_required_inequality_in_functions_of_math(self) -> None:
        # the height of D above A
        height = syn.Require(function=lambda p: 0.1 - p.ground_length * np.sin(p.ground_angle), name="height of D")
        solution = best(*syn.USUAL, SMALL, height)
        assert solution.linkage.pins(0.0)["D"][1] - solution.linkage.pivot_y >= 0.1 - 1e-8

    def test_required_equality_in_functions_of_numpy(self) -> None:
        # the coupler point on the coupler's own line, in SI and absolute places
        on_line = syn.Require(function=lambda p: np.sin(p.point_angle), equal=True, name="point on the coupler")
        at = syn.Require(function=lambda p: p.pivot_x - p.pivot_y - 0.3, equal=True, scale=0.1)
        solution = best(*syn.USUAL, SMALL, on_line, at)
        assert abs(math.sin(solution.linkage.point_angle)) < 1e-6
        assert solution.linkage.pivot_x - solution.linkage.pivot_y == pytest.approx(0.3, abs=1e-7)

    def test_functions_that_casadi_names_otherwise(self) -> None:
        in_degrees = syn.Require(function=lambda p: np.degrees(p.ground_angle) - 100.0, equal=True, scale=100.0)
        longest = syn.Require(
            function=lambda p: np.maximum(np.power(p.coupler_length, 2.0), p.rocker_length**2) - 0.0225, scale=0.01
        )
        solution = best(*syn.USUAL, SMALL, in_degrees, longest).linkage
        assert math.degrees(solution.ground_angle) == pytest.approx(100.0, abs=1e-4)
        assert max(solution.coupler_length, solution.rocker_length) <= 0.15 + 1e-7

    def test_what_loses_the_symbol_is_refused_by_name(self) -> None:
        # float() of a symbol is NaN, and so would the constraint be
        branching = lambda p: p.pivot_x if p.pivot_x > 0 else 0.0  # noqa: E731
        losing = (lambda p: float(p.pivot_x), lambda p: 1.0, lambda p: math.sin(p.crank_length))
        for function in (branching, *losing):
            with pytest.raises(InputError, match="my rule cannot be traced"):
                best(*syn.USUAL, syn.Require(function=function, name="my rule"))

    def test_what_cannot_be_is_said_by_name(self) -> None:
        impossible = syn.Require(function=lambda p: 2.0 - np.cos(p.point_angle), name="a cosine of two")
        with pytest.raises(syn.InfeasibleError, match=r"searches the nearest violates the a cosine of two by 1"):
            best(*syn.USUAL, impossible)


class TestWeights:
    def test_a_heavy_point_is_met_better(self) -> None:
        plain = best(*syn.USUAL, syn.LargestLink(length=0.2))
        weights = np.ones(24)
        weights[7] = 1000.0
        heavy = best(*syn.USUAL, syn.LargestLink(length=0.2), task=syn.TimedPath(points=ellipse(24), weights=weights))
        assert heavy.evaluation.errors[7] < 0.2 * plain.evaluation.errors[7]
        assert heavy.error == pytest.approx(float(weights @ heavy.evaluation.errors**2))


FOUR_BAR = syn.Linkage(ground_length=0.4, crank_length=0.1, coupler_length=0.35, rocker_length=0.3)


class TestMovedPivot:
    CRANK = syn.CrankUnknown(ratio=2, length=(0.01, 0.05), harmonics=1)

    @pytest.mark.parametrize("unknown", [syn.SliderUnknown(harmonics=2), CRANK])
    def test_starts_and_linkages_are_each_others_inverse(self, unknown: Any) -> None:
        pivot: syn.SliderMotion | syn.SecondCrank
        if isinstance(unknown, syn.SliderUnknown):
            pivot = syn.SliderMotion(FourierSeries(np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.4, 0.5])), 0.7)
        else:
            pivot = syn.SecondCrank(0.02, 2, 0.3, FourierSeries(np.array([0.0, 0.2]), np.array([0.0, 0.4])))
        linkage = FOUR_BAR.with_pivot(pivot)
        normal = syn.normal_form(TASK)
        again = make_linkage(make_start(linkage, normal, unknown), normal, unknown)
        np.testing.assert_allclose(again.displacement(syn.turn(9)), linkage.displacement(syn.turn(9)), atol=1e-14)
        assert again.values() == pytest.approx(linkage.values())


def violations(program: Program, start: Start, *, first: bool = False) -> dict[str, float]:
    """How far a start is outside the constraints, the worst of each name; ``first``: outside those of a first solution."""
    held: dict[str, Any] = {} if first else {"places": program.extremes(start), "share": 1.0}
    _, g = program.evaluate(*program.unknowns_and_parameters(start, **held))
    over = np.maximum(program.g_low - g, g - program.g_high)
    names = [label.name for label in program.labels]
    return {name: max(v for v, own in zip(over, names) if own == name) for name in dict.fromkeys(names)}


def excess(linkage: syn.Linkage, unknown: Any, name: str, *, first: bool = False) -> float:
    """How far a linkage is outside the constraints of one name."""
    normal = syn.normal_form(TASK)
    program = Program(normal, make_limits(TASK, normal, None, syn.USUAL), unknown)
    return violations(program, make_start(linkage, normal, unknown), first=first)[name]


class TestBetween:
    """What is held at places only is held in between: the extremes are put where they are farthest from any place."""

    @pytest.mark.parametrize(
        ("bound", "order", "name"),
        [("stroke", 0, "stroke"), ("speed", 1, "slider speed"), ("acceleration", 2, "slider acceleration")],
    )
    def test_bounds_of_the_slider(self, bound: str, order: int, name: str) -> None:
        harmonics, most = 2, 0.01
        apart = harmonics * 0.5 * (2.0 * math.pi / 96)
        # cos(2 x - apart) has its peak in the middle between two of 96 places; so has what it is the derivative of
        size = most * (0.5 if order == 0 else 1.0) / harmonics**order
        turned = apart + 0.5 * math.pi * order
        for factor in (1.0 - 1e-5, 1.0 + 1e-5):
            cosines, sines = np.zeros(3), np.zeros(3)
            cosines[2], sines[2] = factor * size * math.cos(turned), factor * size * math.sin(turned)
            linkage = FOUR_BAR.with_pivot(syn.SliderMotion(FourierSeries(cosines, sines), 0.3))
            unknown = syn.SliderUnknown(harmonics=harmonics, **{bound: most})
            for first in (False, True):
                assert (excess(linkage, unknown, name, first=first) > 0.0) == (factor > 1.0)

    @pytest.mark.parametrize("u", [0.39, 0.41, -0.39, -0.41])
    def test_a_slider_stays_within_the_ground_link_of_its_middle(self, u: float) -> None:
        pivot = syn.SliderMotion(FourierSeries(np.array([u, 0.0]), np.zeros(2)), 0.3)
        over = excess(FOUR_BAR.with_pivot(pivot), syn.SliderUnknown(harmonics=1), "slider position")
        assert (over > 0.0) == (abs(u) > FOUR_BAR.ground_length)

    @pytest.mark.parametrize(("share", "refused"), [(1.1e-3, False), (0.9e-3, True), (7.9, False), (8.1, True)])
    def test_rotation_from_one_untimed_station_to_the_next(self, share: float, refused: bool) -> None:
        task = syn.UntimedPath(path=syn.TargetPath(points=ellipse(24), closed=True), measure="distance", samples=36)
        normal = syn.normal_form(task)
        gaps = np.full(normal.n, (normal.n - share) / (normal.n - 1.0)) * 2.0 * math.pi / normal.n
        gaps[3] = share * 2.0 * math.pi / normal.n
        start = replace(make_start(FOUR_BAR, normal), rotation=np.append(0.0, np.cumsum(gaps[:-1])))
        over = violations(Program(normal, make_limits(task, normal, None, syn.USUAL)), start)["order of the stations"]
        assert (over > 0.0) == refused

    @pytest.mark.parametrize(
        ("rotation", "along", "off"),
        [
            # in the middle between two of the quarters of a gap
            ((0.0, 0.4, 0.8), 0.25, -1e-5),
            ((0.0, 0.4, 0.8), 0.25, 1e-5),
            # nearer to the station than to the rotation before it; after the station steps are shorter
            ((0.0, 1.6, 1.7), 1.46, 1e-5),
        ],
    )
    def test_transmission_angle_on_the_way(self, rotation: tuple[float, ...], along: float, off: float) -> None:
        """The crank lies along the ground link at the rotation ``along``, between two stations."""
        task = syn.TimedPath(points=ellipse(24)[:3], rotation=rotation)
        linkage = syn.Linkage(
            ground_length=0.4, crank_length=0.1, coupler_length=0.35, rocker_length=0.3, crank_phase=math.pi - along
        )  # fmt: skip
        least = math.asin(math.sqrt(1.0 - ((0.35**2 + 0.3**2 - 0.5**2) / (2.0 * 0.35 * 0.3)) ** 2))
        normal = syn.normal_form(task)
        asked = (syn.LeastTransmission(angle=least + off, over="task"), syn.LargestLink(length=1.0))
        limits = make_limits(task, normal, None, asked)
        over = violations(Program(normal, limits), make_start(linkage, normal))["transmission angle"]
        assert (over > 0.0) == (off > 0.0)

    @pytest.mark.parametrize("judged", [False, True])
    def test_transmission_angle_over_a_turn_with_a_moved_pivot(self, judged: bool) -> None:
        """With gears -3 the angle is extreme between the rotations of the grid; a search has half a degree to spare."""
        unknown = syn.CrankUnknown(ratio=-3, length=(0.01, 0.5))
        normal, spare = syn.normal_form(TASK), math.radians(0.01 if judged else 0.5)
        for phase in (0.0, 1.0, 3.0):
            linkage = syn.FiveBar(
                ground_length=0.6, crank_length=0.2, coupler_length=0.65, rocker_length=0.5, crank_phase=phase,
                pivot=syn.SecondCrank(0.2, -3, 0.3),
            )  # fmt: skip
            cosine = linkage.cosine_at_c(linkage.reach(np.linspace(0.0, 2.0 * math.pi, 100001)))
            least = math.acos(np.abs(cosine).max())
            for off in (1e-4, -spare):
                limits = make_limits(TASK, normal, None, (syn.LeastTransmission(angle=least + off),))
                program = Program(normal, limits, unknown, judged=judged)
                over = violations(program, make_start(linkage, normal, unknown))["transmission angle"]
                assert (over > 0.0) == (off > 0.0)


class TestUntimed:
    def test_program_needs_rotations_to_start_from(self) -> None:
        task = syn.Motion(points=ellipse(6), angle=syn.turn(6))
        normal = syn.normal_form(task)
        limits = make_limits(task, normal, None, syn.USUAL)
        start = make_start(drawn(np.random.default_rng(0)), normal)
        with pytest.raises(InputError, match="needs the crank rotations of its stations"):
            Program(normal, limits).solve(start)
        with pytest.raises(InputError, match="needs the crank rotations of its stations"):
            fit_least_squares(normal, limits, start)


class TestBadUnknowns:
    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: syn.CrankUnknown(ratio=1, length=(0.2, 0.1)), "bounds of the second crank"),
            (lambda: syn.LeastTransmission(angle=2.0), "least transmission angle is 2.0"),
            (lambda: syn.LeastTransmission(over="way"), "over is 'way'"),
            (lambda: syn.Grashof(type="rocker"), "Grashof type is 'rocker'"),
            (lambda: syn.LargestLink(length=0.0), "largest link is 0.0"),
            (lambda: syn.Assembly(branch=2), "branch is 2"),
            (lambda: syn.PivotRegion(pivot="B", polygon=L_SHAPE), "pivot is 'B'"),
        ],
    )
    def test_are_named(self, make: Any, message: str) -> None:
        with pytest.raises(ParameterError, match=message):
            make()

    @pytest.mark.parametrize(
        ("polygon", "message"),
        [
            ([[0, 0], [1, 1]], "at least 3 finite corners"),
            ([[0, 0], [1, 1], [1, 0], [0, 1]], "crosses itself or has no area"),
            ([[0, 0], [1, 1], [2, 2]], "crosses itself or has no area"),
        ],
    )
    def test_regions(self, polygon: Sequence[Sequence[float]], message: str) -> None:
        with pytest.raises(InputError, match=message):
            syn.PivotRegion(pivot="A", polygon=polygon)


@pytest.mark.parametrize(
    "task",
    [
        syn.PrecisionPoints(points=ellipse(12)[:4], angle=np.linspace(0.0, 1.0, 4)),
        syn.Motion(points=ellipse(12)[:6], angle=np.linspace(0.0, 1.0, 6)),
        syn.RockerFunction(angle=1.2 + 0.9 * np.abs(np.sin(0.5 * syn.turn(12))), mounting=True),
    ],
    ids=["poses", "motion", "function"],
)
def test_a_task_without_constraints_is_answered(task: syn.Task) -> None:
    """Least squares come to the limit of assembly, where the slopes are infinite."""
    found = syn.synthesize(task, constraints=[], search=syn.Search(starts=12, candidates=1 << 12))
    assert np.isfinite(found.best.error)
