"""Synthesis in closed form: guidance through poses, precision points of a function, cognates."""

from collections.abc import Callable
from itertools import combinations
from math import pi, radians, sqrt
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

import analysis.synthesis as syn
from analysis import cli, figures
from analysis.run import load_case
from linkwork.errors import InputError, ParameterError

from .conftest import marked, run_case

FloatArray = NDArray[np.float64]
EXAMPLES = Path(__file__).parents[2] / "examples"
#: Seeds of poses that turn one way, for which the closed form has a sound linkage; 1 and 4 besides.
ONE_WAY = (2, 8, 9, 10, 13, 14, 16, 17, 20, 22, 26, 27, 29, 33, 36, 44, 47, 49, 51, 52)


def random_poses(seed: int, n: int) -> syn.PrecisionPoints:
    random = np.random.default_rng(seed)
    return syn.PrecisionPoints(points=random.uniform(-1.0, 1.0, (n, 2)), angle=random.uniform(-1.5, 1.5, n))


def kept_distance(task: syn.PrecisionPoints, pivot: complex, point: complex) -> float:
    """How much the distance from a pivot to a point of the body varies over the poses, relative."""
    p = np.asarray(task.points) @ np.array([1.0, 1j])
    angle = np.asarray(task.angle)
    distance = np.abs(p + np.exp(1j * (angle - angle[0])) * (point - p[0]) - pivot)
    return float(np.ptp(distance) / distance.max())


def poses_of(linkage: syn.Linkage, rotation: FloatArray) -> syn.PrecisionPoints:
    return syn.PrecisionPoints(points=linkage.path(rotation), angle=linkage.coupler_angle(rotation))


@pytest.mark.parametrize(("n", "seed"), [(4, 3), (4, 47), (5, 474), (5, 666)])
def test_a_search_has_the_sound_answers_of_the_closed_form(n: int, seed: int) -> None:
    """Of these, four poses far apart have a wide way between them, and are met with a transmission angle that is small."""
    random = np.random.default_rng(seed)
    assert_met(syn.PrecisionPoints(points=random.uniform(-1.0, 1.0, (n, 2)), angle=random.uniform(-1.0, 1.0, n)))


@pytest.mark.parametrize("seed", [1, 4, *marked("slow", ONE_WAY[:6]), *marked("long", ONE_WAY[6:])])
def test_so_has_a_search_for_poses_that_turn_one_way(seed: int) -> None:
    """The one linkage known for the first two comes to 0.08 and 0.03 deg from the limit of assembly."""
    random = np.random.default_rng([4, seed, 7])
    points, angle = random.uniform(-1.0, 1.0, (4, 2)), np.sort(random.uniform(-1.2, 1.2, 4))
    assert_met(syn.PrecisionPoints(points=points, angle=angle * random.choice([1, -1])))


def assert_met(task: syn.PrecisionPoints) -> None:
    exact = syn.guidance(task).solutions
    assert any(solution.verdicts.sound for solution in exact)
    for s in exact:
        # a wide turn of the crank between two poses is no whole turn
        if s.verdicts.branch and len(np.asarray(task.points)) == 5:
            assert syn.Solution.from_linkage(task, s.linkage, s.evaluation.rotation).verdicts == s.verdicts
    quick = syn.Search(starts=4, candidates=1 << 10)
    best = syn.synthesize(task, constraints=[syn.LeastTransmission(angle=0.0, over="task")], search=quick).best
    assert best.verdicts.sound
    assert best.error < 1e-20


@pytest.mark.parametrize("seed", range(20))
def test_dyads_of_five_poses_keep_their_length(seed: int) -> None:
    found = syn.guidance(random_poses(seed, 5))
    assert isinstance(found, syn.Guidance)
    assert len(found.dyads) + found.complex_dyads == 4
    assert found.complex_dyads % 2 == 0
    for dyad in found.dyads:
        assert kept_distance(found.task, dyad.pivot, dyad.point) < 1e-11
    n = len(found.dyads)
    assert len(found.solutions) == n * (n - 1)


def test_a_slide_is_no_link() -> None:
    """The poses of a slider-crank's coupler: the pivot of the link in place of its slide is at infinity."""
    made = syn.SliderCrank(
        ground_length=0.02, crank_length=0.05, coupler_length=0.17, point_distance=0.1, point_angle=0.4, crank_phase=0.2
    )
    at = np.array([0.0, 0.4, 0.9, 1.3, 1.9])
    found = syn.guidance(syn.PrecisionPoints(points=made.path(at), angle=made.coupler_angle(at)))
    assert (len(found.dyads), found.slides, len(found.solutions)) == (3, 1, 6)
    assert "3 of 4 possible links guide the body, and 1 slide in place of a link" in found.describe()
    assert max(s.evaluation.worst for s in found.sound) < 1e-12


@pytest.mark.parametrize("seed", [0, 3, 5, 8])
def test_no_dyad_is_missed(seed: int) -> None:
    """SciPy's root finder from 300 places, on the distances themselves, finds the same real dyads."""
    task = random_poses(seed, 5)
    p, angle = np.asarray(task.points) @ np.array([1.0, 1j]), np.asarray(task.angle)

    def lengths(x: FloatArray) -> FloatArray:
        moved = p + np.exp(1j * (angle - angle[0])) * (complex(x[0], x[1]) - p[0])
        squared = np.abs(moved - complex(x[2], x[3])) ** 2
        return np.diff(squared)

    random = np.random.default_rng(seed)
    met = [root(lengths, random.uniform(-3.0, 3.0, 4), tol=1e-13) for _ in range(300)]
    there = {tuple(np.round(m.x, 5)) for m in met if m.success and np.abs(m.fun).max() < 1e-11}
    found = syn.guidance(task)
    mine = {tuple(np.round([d.point.real, d.point.imag, d.pivot.real, d.pivot.imag], 5)) for d in found.dyads}
    assert there <= mine
    # those far away are not hit from these places
    assert {m for m in mine if np.abs(m).max() < 3.0} <= there


FOUR_BAR = syn.Linkage(
    pivot_x=0.1, pivot_y=-0.2, ground_length=0.4, crank_length=0.12, coupler_length=0.35, rocker_length=0.25,
    point_distance=0.3, point_angle=0.6, ground_angle=0.3, crank_phase=0.5, output_angle=0.2,
)  # fmt: skip


def test_a_four_bar_is_found_again_from_its_own_poses() -> None:
    found = syn.guidance(poses_of(FOUR_BAR, np.array([0.0, 0.4, 0.9, 1.5, 2.2])))
    near = min(found.sound, key=lambda s: abs(s.linkage.ground_length - 0.4) + abs(s.linkage.crank_length - 0.12))
    for name, value in FOUR_BAR.values().items():
        assert near.linkage.values()[name] == pytest.approx(value, abs=1e-10), name
    assert near.error < 1e-24
    assert np.allclose(near.evaluation.rotation, [0.0, 0.4, 0.9, 1.5, 2.2], atol=1e-10)


def test_poses_on_both_assemblies_are_a_circuit_defect() -> None:
    """Three poses of one circuit of a crank-rocker and two of the other cannot be joined by any motion of its crank."""
    other = syn.Linkage(**FOUR_BAR.values() | {"branch": -1})
    one, two = np.array([0.0, 0.4, 0.9]), np.array([1.5, 2.2])
    points = np.vstack([FOUR_BAR.path(one), other.path(two)])
    angle = np.concatenate([FOUR_BAR.coupler_angle(one), other.coupler_angle(two)])
    found = syn.guidance(syn.PrecisionPoints(points=points, angle=angle))
    near = min(found.solutions, key=lambda s: abs(s.linkage.ground_length - 0.4) + abs(s.linkage.crank_length - 0.12))
    assert near.linkage.coupler_length == pytest.approx(0.35, abs=1e-9)
    assert set(near.verdicts.defects) >= {"circuit defect", "branch defect"}
    assert near not in found.sound


def circuits(linkage: syn.Linkage, poses: syn.PrecisionPoints) -> set[int]:
    """The circuits on which poses lie: connected parts of the graph of crank angles (1/20 deg apart) and assemblies."""
    n, values = 7200, linkage.values()
    ends = np.exp(2j * pi * np.arange(n) / n) * values["crank_length"]
    reach = np.abs(values["ground_length"] - ends)
    l3, l4 = values["coupler_length"], values["rocker_length"]
    closed = (abs(l3 - l4) < reach) & (reach < l3 + l4)
    here, ahead = np.arange(n), np.roll(np.arange(n), -1)
    on = here[closed & closed[ahead]]
    last = here[closed & ~(closed[ahead] & np.roll(closed, 1))]
    start, end = np.concatenate([on, on + n, last]), np.concatenate([ahead[on], ahead[on] + n, last + n])
    _, part = connected_components(csr_matrix((np.ones(len(start)), (start, end)), shape=(2 * n, 2 * n)))
    e = np.exp(1j * (np.asarray(poses.angle) - values["output_angle"] - values["ground_angle"]))
    arm = values["point_distance"] * np.exp(1j * values["point_angle"])
    from_a = np.asarray(poses.points) @ np.array([1.0, 1j]) - complex(values["pivot_x"], values["pivot_y"])
    b = from_a * np.exp(-1j * values["ground_angle"]) - arm * e
    assert np.allclose(np.abs(b), values["crank_length"])
    left = (np.conj(values["ground_length"] - b) * e).imag > 0.0
    at = [int(np.flatnonzero(closed)[np.abs(ends[closed] - place).argmin()]) for place in b]
    return {int(part[k + n * one]) for k, one in zip(at, left)}


@pytest.mark.parametrize("seed", [0, 5, 22, 31])
def test_a_circuit_defect_is_what_no_drive_can_avoid(seed: int) -> None:
    """Poses on both sides of a dead centre, as of a rocker that drives a crank, lie on one circuit."""
    random = np.random.default_rng(seed)
    points, angle = np.cumsum(random.normal([0.5, 0.0], 0.4, (5, 2)), axis=0), np.cumsum(random.uniform(0.0, 0.5, 5))
    for solution in syn.guidance(syn.PrecisionPoints(points=points, angle=angle)).solutions:
        assert solution.verdicts.circuit == (len(circuits(solution.linkage, solution.task)) == 1)


def test_rotations_beyond_the_swing_of_a_crank_are_a_branch_defect() -> None:
    """A triple-rocker has one circuit: its other links pass from each target to the next, if not by these crank rotations."""
    linkage = syn.Linkage(
        ground_length=1.0, crank_length=0.8, coupler_length=0.7, rocker_length=0.75, crank_phase=np.radians(60.0)
    )
    at = np.radians([0.0, 30.0, 220.0])
    angle = np.concatenate([linkage.rocker_angle(one) for one in at[:, None]])
    task = syn.RockerFunction(angle=angle, rotation=at)
    (solution,) = syn.function_generators(task, crank_phase="60 deg").solutions
    assert solution.linkage.rocker_length == pytest.approx(0.075)
    assert solution.verdicts.grashof == "triple-rocker"
    assert solution.verdicts.defects == ("branch defect",)


@pytest.mark.parametrize("seed", range(6))
def test_curve_of_four_poses(seed: int) -> None:
    found = syn.guidance(random_poses(seed, 4))
    assert isinstance(found, syn.GuidanceMap)
    for pivot, point in zip(found.pivots, found.points):
        assert kept_distance(found.task, complex(pivot), complex(point)) < 1e-10


@pytest.mark.parametrize("seed", [3, 7, 10])
def test_map_of_four_poses_is_what_each_linkage_is_judged(seed: int) -> None:
    from analysis.synthesis.exact.burmester import Dyad, build_four_bar

    found = syn.guidance(random_poses(seed, 4))
    dyads = [Dyad(pivot=complex(m), point=complex(z)) for m, z in zip(found.pivots, found.points)]
    random = np.random.default_rng(0)
    places = np.argwhere(found.sound)
    assert len(places) > 100
    chosen = [*random.permutation(places)[:40], *random.integers(0, len(dyads), (40, 2))]
    for i, k in chosen:
        if i == k:
            continue
        solution = build_four_bar(found.task, dyads[i], dyads[k])
        if solution.linkage.largest_link < 4.9 * np.hypot(*np.ptp(np.asarray(found.task.points), axis=0)):
            assert solution.verdicts.sound == found.sound[i, k]
            v = solution.verdicts
            if v.sound:
                least = min(v.least_transmission, pi - v.greatest_transmission)
                assert found.transmission[i, k] == pytest.approx(least, abs=2e-5)


def test_the_best_linkage_is_farthest_from_a_dead_centre_on_the_way_through_the_poses() -> None:
    def margins(name: str) -> tuple[syn.Guidance | syn.GuidanceMap, list[float]]:
        found = syn.guidance(syn.load_synthesis_case(EXAMPLES / f"{name}-poses.toml").task)
        ways = [s.verdicts for s in found.solutions if s.verdicts.sound]
        return found, [min(v.least_transmission, pi - v.greatest_transmission) for v in ways]

    found, all_five = margins("five")
    assert all_five == sorted(all_five, reverse=True)
    found, all_four = margins("four")
    # a linkage whose crank swings may be the best
    assert all_four[0] == pytest.approx(found.transmission.max(), abs=1e-9)
    assert all_four == sorted(all_four, reverse=True)


def test_curve_of_four_poses_contains_the_dyads_of_five() -> None:
    """Pose by pose left out, the dyads of five poses lie on the curve of the other four."""
    task = random_poses(0, 5)
    five = syn.guidance(task)
    assert five.dyads
    for out in range(1, 5):
        kept = [k for k in range(5) if k != out]
        points, angle = np.asarray(task.points)[kept], np.asarray(task.angle)[kept]
        four = syn.guidance(syn.PrecisionPoints(points=points, angle=angle))
        for dyad in five.dyads:
            if abs(dyad.point) < 2.0:
                assert np.abs(four.points - dyad.point).min() < 0.15


@pytest.mark.parametrize(
    ("points", "angle", "rotation", "said"),
    [
        ([[0, 0], [1, 0], [2, 1], [3, 1], [4, 0], [5, 0]], [0.0] * 6, None, "6 poses"),
        ([[0, 0], [1, 0], [2, 1]], [0.0, 0.1, 0.2], None, "3 poses"),
        ([[0, 0], [1, 0], [2, 1], [3, 1], [4, 0]], None, None, "there must be points"),
        ([[0, 0], [1, 0], [2, 1], [3, 1], [4, 0]], [0.1] * 5, None, "does not turn"),
        ([[0, 0], [1, 0], [2, 1], [3, 1]], [0.1] * 4, None, "does not turn"),
        ([[0, 0], [1, 0], [0, 0], [3, 1], [4, 0]], [0.1, 0.2, 0.1, 0.4, 0.5], None, "the same"),
        ([[0, 0], [1, 0], [2, 1], [3, 1]], [0.1, 0.2, 0.3, 0.4], [0.0, 0.1, 0.2, 0.3], "give poses without"),
        ([[1, 0], [0, 1], [-1, 0], [0, -1]], [0.0, 0.5 * pi, pi, 1.5 * pi], None, "only about one point"),
        ([[0, 0], [1, 0], [2, 1], [3, 1]], [0.0, 1e-5, 3e-5, 4e-5], None, "a slide is in its place"),
    ],
)
def test_poses_that_cannot_be_taken(points: object, angle: object, rotation: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        syn.guidance(syn.PrecisionPoints(points=points, angle=angle, rotation=rotation))


def test_a_motion_is_poses_too() -> None:
    task = random_poses(5, 5)
    motion = syn.Motion(points=task.points, angle=np.asarray(task.angle))
    assert syn.guidance(motion).describe() == syn.guidance(task).describe()


def exact_at(solution: syn.Solution) -> float:
    return float(np.abs(solution.evaluation.errors).max())


@pytest.mark.parametrize(
    ("n", "mounting", "crank_phase", "most"),
    [(5, True, None, 3), (4, False, None, 2), (4, True, 0.4, 2), (3, False, 0.4, 1)],
)
@pytest.mark.parametrize("seed", range(5))
def test_function_at_its_points(n: int, mounting: bool, crank_phase: float | None, most: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    rotation = np.append(0.0, np.cumsum(random.uniform(0.2, 0.6, n - 1)))
    angle = 1.5 + 0.6 * np.sin(rotation + random.uniform(-1.0, 1.0))
    task = syn.RockerFunction(angle=angle, rotation=rotation, mounting=mounting)
    found = syn.function_generators(task, crank_phase=crank_phase)
    assert len(found.solutions) <= most
    for solution in found.solutions:
        l = solution.linkage  # noqa: E741
        if crank_phase is not None:
            assert np.sin(l.crank_phase - crank_phase) == pytest.approx(0.0, abs=1e-12)
        if not mounting:
            assert np.sin(l.output_angle) == pytest.approx(0.0, abs=1e-12)
        # loop closure by the distance of B and C, whatever the assembly
        th2, th4 = rotation + l.crank_phase, angle - l.output_angle
        b = l.crank_length * np.exp(1j * th2)
        c = l.ground_length + l.rocker_length * np.exp(1j * th4)
        assert np.abs(c - b) == pytest.approx(np.full(n, l.coupler_length), rel=1e-9)
        if solution.verdicts.branch:
            assert exact_at(solution) < 1e-8


@pytest.mark.parametrize("n", [4, 5])
def test_a_function_generator_is_found_again(n: int) -> None:
    made = syn.Linkage(ground_length=0.1, crank_length=0.04, coupler_length=0.12, rocker_length=0.07, crank_phase=0.7)
    rotation = np.linspace(0.0, 1.8, n)
    task = syn.RockerFunction(angle=made.rocker_angle(rotation), rotation=rotation, mounting=n == 5)
    found = syn.function_generators(task)
    assert any(np.allclose(s.linkage.vector, made.vector, rtol=0.0, atol=1e-9) for s in found.sound)


@pytest.mark.parametrize(
    ("n", "mounting", "said"),
    [(6, True, "Leave points out"), (4, True, "the output's mounting.*Add points"), (3, False, "the crank's phase")],
)
def test_points_and_unknowns_are_counted(n: int, mounting: bool, said: str) -> None:
    task = syn.RockerFunction(angle=np.linspace(1.0, 2.0, n) ** 2, rotation=np.linspace(0.0, 1.0, n), mounting=mounting)
    with pytest.raises(InputError, match=said):
        syn.function_generators(task)


def test_a_constant_function_has_no_generator() -> None:
    with pytest.raises(InputError, match="stands still"):
        syn.function_generators(syn.RockerFunction(angle=[1.0, 1.0, 1.0], rotation=[0.0, 0.5, 1.0]), crank_phase=0.0)
    # an output that turns with the crank: the coupler is as long as the ground link, the others as long as one likes
    with pytest.raises(InputError, match="not independent"):
        syn.function_generators(syn.RockerFunction(angle=[0.5, 1.0, 1.5], rotation=[0.0, 0.5, 1.0]), crank_phase=0.5)


@pytest.mark.parametrize("step", [0.1, 1.0 / 3.0, pi / 9.0])
@pytest.mark.parametrize(("count", "mounting", "crank_phase"), [(4, False, None), (4, True, 0.2), (5, True, None)])
def test_a_rocker_that_turns_with_the_crank_is_that_of_every_parallelogram(step, count, mounting, crank_phase) -> None:
    rotation = step * np.arange(count)
    task = syn.RockerFunction(angle=1.0 + rotation, rotation=rotation, mounting=mounting)
    with pytest.raises(InputError, match="points of the function are not independent"):
        syn.function_generators(task, crank_phase=crank_phase)


@pytest.mark.parametrize("ratio", [-1.0, 0.5, 2.0])
def test_a_rocker_at_a_constant_ratio_of_the_crank_has_no_linkage_at_five_points(ratio: float) -> None:
    """All dyads of its poses are the ground link itself, or slides."""
    rotation = np.array([0.0, 0.3, 0.5, 0.8, 1.2])
    task = syn.RockerFunction(angle=1.0 + ratio * rotation, rotation=rotation, mounting=True)
    assert syn.function_generators(task).solutions == ()


@pytest.mark.parametrize(("mounting", "crank_phase"), [(False, None), (True, 0.4)])
def test_a_rocker_that_turns_against_the_crank_has_a_linkage_at_four_points(mounting, crank_phase) -> None:
    """At one of the two angles at which the determinant is zero, crank and rocker mirror each other, and no links do it."""
    rotation = np.array([0.0, 0.4, 0.7, 1.0])
    task = syn.RockerFunction(angle=1.0 - rotation, rotation=rotation, mounting=mounting)
    (found,) = syn.function_generators(task, crank_phase=crank_phase).solutions
    l = found.linkage  # noqa: E741
    b = l.crank_length * np.exp(1j * (rotation + l.crank_phase))
    c = l.ground_length + l.rocker_length * np.exp(1j * (1.0 - rotation - l.output_angle))
    assert np.abs(c - b) == pytest.approx(np.full(4, l.coupler_length), rel=1e-9)


def test_chebyshev_spacing() -> None:
    """The cosines of 30, 90 and 150 degrees; between the points an error that the polynomial through them levels."""
    assert syn.chebyshev_spacing(0.0, 2.0, 3) == pytest.approx([1.0 - sqrt(0.75), 1.0, 1.0 + sqrt(0.75)])
    rotation, angle = syn.function_from_formula("10*t", unit="deg", n=4, start=0.0, end="pi/2", spacing="chebyshev")
    assert rotation == pytest.approx(syn.chebyshev_spacing(0.0, 0.5 * pi, 4))
    assert angle == pytest.approx(radians(10.0) * rotation)
    with pytest.raises(InputError, match="in order"):
        syn.chebyshev_spacing(1.0, 0.0, 3)


@st.composite
def turning(draw: st.DrawFn) -> syn.Linkage:
    """Crank-rockers and drag-links with a coupler point, placed anywhere."""
    lengths = [draw(st.floats(0.2, 1.0)) for _ in range(3)]
    shortest = draw(st.floats(0.05, 0.15))
    rest = sorted(lengths)
    if shortest + rest[2] >= rest[0] + rest[1] - 1e-3:
        rest[2] = 0.9 * (rest[0] + rest[1] - shortest)
    crank = draw(st.booleans())
    ground, crank_length = (rest[2], shortest) if crank else (shortest, rest[2])
    return syn.Linkage(
        pivot_x=draw(st.floats(-1.0, 1.0)),
        pivot_y=draw(st.floats(-1.0, 1.0)),
        ground_length=ground,
        crank_length=crank_length,
        coupler_length=rest[0],
        rocker_length=rest[1],
        point_distance=draw(st.floats(0.1, 1.0)),
        point_angle=draw(st.floats(0.2, 6.0)),
        ground_angle=draw(st.floats(-3.0, 3.0)),
        crank_phase=draw(st.floats(-3.0, 3.0)),
        branch=draw(st.sampled_from([1, -1])),
    )


@settings(max_examples=60)
@given(turning())
def test_cognates_trace_the_same_curve(linkage: syn.Linkage) -> None:
    phi = np.linspace(0.0, 2.0 * pi, 49)
    path = linkage.path(phi)
    if not np.isfinite(path).all() or linkage.least_transmission < 0.02:
        return
    same, at_a, at_g = syn.cognates(linkage)
    assert same.path(phi) == pytest.approx(path, abs=1e-9)
    turned = {id(at_a): linkage.coupler_angle(phi), id(at_g): linkage.rocker_angle(phi)}
    for cognate in (at_a, at_g):
        angle = turned[id(cognate)]
        if cognate.turns_fully and np.abs(np.diff(angle)).min() > 0.0:
            assert cognate.path(angle - angle[0]) == pytest.approx(path, abs=1e-7)
    # the three stand on three pivots, of which each has two
    assert (at_a.pivot_x, at_a.pivot_y) == pytest.approx((linkage.pivot_x, linkage.pivot_y), abs=1e-12)
    assert (at_g.pivot_x, at_g.pivot_y) == pytest.approx((same.pivot_x, same.pivot_y), abs=1e-9)


def test_alternatives_of_a_timed_path() -> None:
    phi = np.linspace(0.0, 2.0 * pi, 24, endpoint=False)
    task = syn.TimedPath(points=FOUR_BAR.path(phi), rotation=phi)
    (other,) = syn.alternatives(syn.Solution.from_linkage(task, FOUR_BAR))
    assert other.error < 1e-25
    assert other.verdicts.sound
    assert other.linkage.pivot_x != pytest.approx(FOUR_BAR.pivot_x, abs=1e-3)


def test_alternatives_of_an_open_path() -> None:
    """Each is judged as it is driven; one that is sound runs through the points in their order."""
    rotation = np.linspace(0.2, 1.4, 15)
    task = syn.UntimedPath(path=syn.TargetPath(points=FOUR_BAR.path(rotation), closed=False))
    found = syn.alternatives(syn.Solution.from_linkage(task, FOUR_BAR, rotation))
    assert len(found) == 3
    for one in found:
        if one.verdicts.sound:
            assert exact_at(one) < 1e-5
    assert sum(one.verdicts.sound for one in found) >= 2


def test_alternatives_of_a_closed_path_turn_fully() -> None:
    points = FOUR_BAR.path(np.linspace(0.0, 2.0 * pi, 72, endpoint=False))
    task = syn.UntimedPath(path=syn.TargetPath(points=points, closed=True))
    own = syn.Solution.from_linkage(task, FOUR_BAR)
    found = syn.alternatives(own)
    assert found
    for one in found:
        assert one.linkage.turns_fully
        assert one.error == pytest.approx(own.error, rel=1e-6)


def test_what_has_no_cognates() -> None:
    task = syn.RockerFunction(angle=[1.0, 1.2, 1.3], rotation=[0.0, 0.2, 0.4])
    with pytest.raises(InputError, match="share the coupler curve"):
        syn.alternatives(syn.Solution.from_linkage(task, FOUR_BAR))
    with pytest.raises(ParameterError, match="point_distance"):
        syn.cognates(syn.Linkage(**FOUR_BAR.values() | {"point_distance": 0.0}))


# The command

POSES = '[task]\nkind = "precision-points"\nunit = "mm"\npoints = {points}\nangle = {angle}\n'


@pytest.fixture
def linkwork(linkwork: Callable[..., Result]) -> Callable[..., Result]:
    return lambda case, *words, **options: linkwork("exact", case, *words, **options)


def test_command_of_five_poses(linkwork: Callable[..., Result], tmp_path: Path) -> None:
    result = linkwork(EXAMPLES / "five-poses.toml", "--no-plots")
    assert "6 four-bars, driven from either side: 7 of 12 sound" in result.output
    assert "its errors are those in the assembly of the first" in result.output
    assert {p.name for p in (tmp_path / "out").iterdir()} - {".linkwork"} == {
        "solutions.csv", "best-curve.csv", "best-report.txt", "best.dxf", "best.svg", "linkage.toml",
        *(f"linkage-{rank}.toml" for rank in range(2, 8)),
    }  # fmt: skip
    assert "rms error 0 mm, worst 0 mm" in (tmp_path / "out" / "best-report.txt").read_text()  # no rounding errors
    case = load_case(tmp_path / "out" / "linkage-7.toml")
    assert run_case(case).status == 0
    rows = (tmp_path / "out" / "solutions.csv").read_text().splitlines()
    assert len(rows) == 13


def test_command_where_none_is_sound(linkwork: Callable[..., Result], tmp_path: Path) -> None:
    task = random_poses(0, 5)
    text = POSES.format(points=np.asarray(task.points).tolist(), angle=np.asarray(task.angle).tolist())
    (tmp_path / "case.toml").write_text(text)
    result = linkwork("case.toml", "--no-plots", code=cli.ENDED_EARLY)
    assert "no sound four-bar exists" in result.output
    assert not (tmp_path / "out" / "best.dxf").exists()


def test_command_of_a_function(linkwork: Callable[..., Result]) -> None:
    result = linkwork(EXAMPLES / "sine-function.toml", "--no-plots")
    assert "1 four-bar through the 5 points: 1 sound" in result.output
    assert "its errors" not in result.output
    result = linkwork(EXAMPLES / "sine-function.toml", "--set", "task.n=4", "--crank-phase", "100 deg", "--no-plots")
    assert "through the 4 points" in result.output
    result = linkwork(EXAMPLES / "sine-function.toml", "--set", "task.n=6", code=cli.WRONG)
    assert "Leave points out" in result.output
    result = linkwork(EXAMPLES / "five-poses.toml", "--crank-phase", "10 deg", code=cli.WRONG)
    assert "poses leave the crank's angle free" in result.output


@pytest.mark.parametrize(
    "task",
    [
        '"quick-return"\nstroke = "8 cm"',
        '"quick-return"\nswing = 0.7',
        '"timed-path"\npoints = [[0, 0], [1, 0], [1, 1]]',
    ],
)
def test_the_command_names_the_one_for_other_tasks(linkwork: Callable[..., Result], tmp_path: Path, task: str) -> None:
    (tmp_path / "case.toml").write_text(f"[task]\nkind = {task}\n")
    result = linkwork("case.toml", code=cli.WRONG)
    assert "linkwork synthesize case.toml" in result.output


def test_pictures_show_every_dyad_and_linkage() -> None:
    found = syn.guidance(random_poses(1, 5))
    figure = figures.plot(found, title="five")
    assert len(figure.axes) >= 1 + len(found.solutions)
    titles = [axis.get_title() for axis in figure.axes]
    for number, solution in enumerate(found.solutions, start=1):
        (title,) = (t for t in titles if t.startswith(f"{number}: "))
        for defect in solution.verdicts.defects:
            assert defect.removesuffix(" defect") in title
    drawn = [line.get_xydata() @ np.array([1.0, 1j]) for line in figure.axes[1].lines]
    for dyad in found.dyads:
        ends = 1e3 * np.array([dyad.pivot, dyad.point])
        assert any(len(line) == 2 and np.allclose(line, ends) for line in drawn)
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) == 5
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_picture_of_four_poses_shows_good_pivots_and_the_whole_of_the_best_linkage() -> None:
    found = syn.guidance(random_poses(3, 4), count=1)
    left, right, *_ = figures.plot(found).axes
    shown = right.collections[0].get_array()
    assert len(shown) == np.count_nonzero(found.sound.any(axis=1))
    best = found.solutions[0]
    (x0, x1), (y0, y1) = left.get_xlim(), left.get_ylim()
    for x, y in best.linkage.pins(float(best.evaluation.rotation[0])).values():
        assert x0 < 1e3 * x < x1
        assert y0 < 1e3 * y < y1
    legend = left.get_legend()
    assert {"crank", "rocker", "fixed pivots"} <= {text.get_text() for text in legend.get_texts()}
