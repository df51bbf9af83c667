"""Rigid-body guidance in closed form: find every four-bar that carries a body exactly through four or five poses.

A dyad is a fixed pivot m and a point of the body whose distance from m is the same in all poses. In pose j let the body's
reference point be at p_j and the body be rotated by e_j = exp(i theta_j) from the first pose. The body's point z has a constant
distance from m if

    |p_j|^2 / 2 + Re(conj(p_j) e_j z) - Re(conj(p_j) m) - Re((e_j - 1) w) = 0,   w = conj(m) z,   j = 2 ... n,

which is linear in (1, z, m, w). Five poses leave a plane of solutions, in which w = conj(m) z represents two conics. These meet
in four points, so that there are four dyads, real or complex (L. Burmester, Lehrbuch der Kinematik, 1888; J. M. McCarthy and
G. S. Soh, Geometric Design of Linkages, 2nd ed., 2011, chapter 5). Two real dyads make a four-bar: there are at most six
four-bars, and either dyad can be the crank. All are checked for defects: if none is sound, there is no sound four-bar
for the poses. Four poses leave a cubic curve of points z, each with its pivot m.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations
from math import pi

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ...display import NotebookResult, format_count
from ..linkage.linkage import Linkage
from ..result.solution import Solution, evaluate, judge, rank_solutions
from ..task.task import Motion, PrecisionPoints, Task, normal_form

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Poses = PrecisionPoints | Motion
#: Singular value, relative to the largest, below which the conditions of the poses are not independent.
INDEPENDENT = 1e-10
#: Largest imaginary part, in units of the poses' size, with which a dyad counts as real.
REAL = 1e-7
#: Distance, in units of the poses' size, beyond which an end of a dyad counts as infinitely far: a slide replaces the dyad.
FAR = 1e3
#: Distance, in the same units, up to which two places count as one: the roots of a multiple dyad differ by rounding.
SAME = 1e-5
#: Number of lines through a pole that sample the curve of four poses: each meets the curve in two further points.
CURVE_POINTS = 180
#: Greatest length of links in the map of four poses, in units of the poses' size; the same as in a search without bounds.
LONGEST = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Dyad:
    """A link that turns about a fixed pivot and guides a point of a body.

    Attributes
    ----------
    pivot : complex
        The link's fixed end (m): a point of the centre-point curve.
    point : complex
        The link's other end with the body in the first pose (m): a point of the circle-point curve.
    """

    pivot: complex
    point: complex

    @property
    def length(self) -> float:
        """Return the length of the link (m)."""
        return abs(self.point - self.pivot)


class Exact(NotebookResult):
    """Linkages found in closed form, with and without defects."""

    __slots__ = ()

    solutions: tuple[Solution, ...]

    @property
    def sound(self) -> tuple[Solution, ...]:
        """Return the solutions without circuit, branch or order defect."""
        return tuple(s for s in self.solutions if s.verdicts.sound)

    def describe(self) -> str:
        """Return a sentence that says how many linkages there are."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.describe()}>"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Guidance(Exact):
    """All four-bars that carry a body exactly through five poses, with and without defects.

    Attributes
    ----------
    task : PrecisionPoints or Motion
    dyads : tuple of Dyad
        The real dyads; five poses have four, two or none.
    complex_dyads : int
        Number of complex dyads, which cannot be built.
    slides : int
        Number of dyads with an end at infinity: a slide replaces such a dyad, and no four-bar contains it.
    nearest_complex : float
        Least imaginary part of the complex dyads, as a fraction of the poses' size. If this number is close to zero, a small
        change of the poses makes a pair of dyads real. Infinite if all dyads are real.
    solutions : tuple of Solution
        The four-bars of all pairs of dyads, with either dyad as the crank; sound linkages first, then by transmission angle.
    """

    task: Poses
    dyads: tuple[Dyad, ...]
    complex_dyads: int
    slides: int
    nearest_complex: float
    solutions: tuple[Solution, ...]

    def describe(self) -> str:
        """Return a sentence that says how many linkages there are."""
        possible = len(self.dyads) + self.complex_dyads + self.slides
        there = f"{len(self.dyads)} of {possible} possible links guide the body"
        if self.slides:
            there += f", and {format_count(self.slides, 'slide')} in place of a link"
        if not self.solutions:
            return f"{there}: no four-bar carries a body through these poses"
        linkages = format_count(len(self.solutions) // 2, "four-bar")
        if not self.sound:
            return f"{there}; {linkages}, driven from either side: each has a defect, so that no sound four-bar exists"
        return f"{there}; {linkages}, driven from either side: {len(self.sound)} of {len(self.solutions)} sound"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuidanceMap(NotebookResult):
    """Four-bars that carry a body exactly through four poses: each consists of two of n sampled dyads.

    Attributes
    ----------
    task : PrecisionPoints or Motion
    pivots, points : ndarray of complex, shape (n,)
        Samples of the centre-point and the circle-point curve (m); each index is a dyad. The points lie on lines through a pole
        of two poses: each line meets the circle-point curve in two further points.
    sound : ndarray of bool, shape (n, n)
        Whether the linkage with the row's dyad as crank and the column's dyad as rocker is free of defects and has no link
        longer than `LONGEST`.
    transmission : ndarray, shape (n, n)
        Least deviation of the same linkage's transmission angle from 0 and pi between the first pose and the last (rad); 0 if
        the linkage is not ``sound``.
    solutions : tuple of Solution
        The linkages with the largest ``transmission`` that differ clearly from one another.
    """

    task: Poses
    pivots: ComplexArray
    points: ComplexArray
    sound: NDArray[np.bool_]
    transmission: FloatArray
    solutions: tuple[Solution, ...]

    def describe(self) -> str:
        """Return a sentence that says how many linkages there are."""
        n = len(self.points)
        return (
            f"{n} links sampled of those that can guide the body: {int(self.sound.sum())} of {n * (n - 1)} pairs make a sound "
            f"four-bar with no link longer than {LONGEST:g} times the poses' size"
        )

    def __repr__(self) -> str:
        return f"<GuidanceMap: {self.describe()}>"


def guidance(task: Task, count: int = 6) -> Guidance | GuidanceMap:
    """Find all four-bars that carry a body exactly through four or five poses, with their defects.

    Parameters
    ----------
    task : PrecisionPoints or Motion
        The poses: points with angles, without crank rotations.
    count : int
        Number of solutions that are returned for four poses.

    Returns
    -------
    Guidance or GuidanceMap
        `Guidance` for five poses, `GuidanceMap` for four.

    Raises
    ------
    InputError
        If there are not four or five poses, crank rotations are given, or the poses are degenerate: two poses are the same, or
        the body does not rotate, or only about one point.

    Examples
    --------
    >>> from analysis.synthesis import PrecisionPoints, guidance
    >>> points = [[1.5, 0.2], [1.4, 0.4], [0.9, 0.8], [-1.2, 0.6], [-1.3, 0.5]]
    >>> found = guidance(PrecisionPoints(points=points, angle=[-0.2, -0.1, 0.1, 0.5, 0.5]))
    >>> print(found.describe())
    4 of 4 possible links guide the body; 6 four-bars, driven from either side: 7 of 12 sound
    """
    task, p, angle = _read_poses(task)
    return _guide_five_poses(task, p, angle) if len(p) == 5 else _guide_four_poses(task, p, angle, count)


def _read_poses(task: Task) -> tuple[Poses, ComplexArray, FloatArray]:
    """Return the task, and the positions and angles of its four or five poses; raise InputError as `guidance` does."""
    if not isinstance(task, PrecisionPoints | Motion) or task.angle is None:
        raise InputError(f"a {type(task).__name__} has no poses: there must be points, with the body's angle at each")
    if task.rotation is not None:
        raise InputError(
            "the poses have crank rotations: closed-form guidance leaves the rotations free, so give poses without"
        )
    points, angle = np.asarray(task.points), np.asarray(task.angle)
    if len(points) not in (4, 5):
        raise InputError(
            f"{len(points)} poses: in closed form there must be five, which have up to six four-bars, or four, which have a "
            "curve of dyads"
        )
    return task, points @ np.array([1.0, 1j]), angle


def dyads_of_five(p: ComplexArray, angle: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Compute the four dyads of five poses, including complex ones; all lengths are in units of the poses' size.

    ``p`` are the positions of the body's reference point as complex numbers; ``angle`` are the body's angles (rad); both have
    the shape (5,). The results z and m, each of shape (4, 2), are the Cartesian coordinates of
    the point and the pivot of each dyad, relative to the first position. They are real for a dyad that can be built.

    Raises InputError if the conditions of the poses are not independent.
    """
    rows = _conditions(p, angle)
    plane = _null_space(rows, 3)
    # a random rotation, always the same, so that no root lies at infinity of the plane's coordinates
    turned, _ = np.linalg.qr(np.random.default_rng(1888).standard_normal((3, 3)))
    plane = plane @ turned
    first, second = (plane.T @ form @ plane for form in _FORMS)
    found = np.array([plane @ root for root in _intersect_conics(first, second)])
    solved = np.array([_refine_dyad(rows, v[1:5] / v[0]) for v in found])
    return solved[:, :2], solved[:, 2:]


def _conditions(p: ComplexArray, angle: FloatArray) -> FloatArray:
    """Return the coefficients of (1, zx, zy, mx, my, wx, wy) in the conditions of all poses but the first, shape (n - 1, 7)."""
    p, e = p[1:] - p[0], np.exp(1j * (angle[1:] - angle[0]))
    seen = np.conj(p) * e
    return np.column_stack([0.5 * np.abs(p) ** 2, seen.real, -seen.imag, -p.real, -p.imag, -(e.real - 1.0), e.imag])


def _forms() -> tuple[FloatArray, FloatArray]:
    """Return the matrices of two quadratic forms in (1, zx, zy, mx, my, wx, wy), both of which are zero if w = conj(m) z."""
    real, imaginary = np.zeros((7, 7)), np.zeros((7, 7))
    real[0, 5], real[3, 1], real[4, 2] = -1.0, 1.0, 1.0
    imaginary[0, 6], imaginary[3, 2], imaginary[4, 1] = -1.0, 1.0, -1.0
    return 0.5 * (real + real.T), 0.5 * (imaginary + imaginary.T)


_FORMS = _forms()


_DEPENDENT_POSES = (
    "the poses are not independent: two of them are the same, or the body does not turn between some of them, or only about "
    "one point; then there are infinitely many dyads. Change a pose, or leave one out"
)


def _null_space(rows: FloatArray, size: int) -> FloatArray:
    """Return a basis of the null space of the matrix ``rows``: ``size`` columns.

    Raises InputError if the rows are linearly dependent, so that the null space has more than ``size`` dimensions.
    """
    _, values, right = np.linalg.svd(rows)
    if values[-1] < INDEPENDENT * values[0]:
        raise InputError(_DEPENDENT_POSES)
    return right[-size:].T


def _intersect_conics(first: FloatArray, second: FloatArray) -> ComplexArray:
    """Intersect two conics by the resultant of their quadratics in x; return the points (x, y, 1) as rows, shape (4, 3)."""

    def quadratics(y: complex) -> list[tuple[complex, complex, complex]]:
        return [
            (a[0, 0], 2.0 * (a[0, 1] * y + a[0, 2]), a[1, 1] * y * y + 2.0 * a[1, 2] * y + a[2, 2])
            for a in (first, second)
        ]

    def sylvester(y: complex) -> ComplexArray:
        (a, b, c), (d, e, f) = quadratics(y)
        return np.array([[a, b, c, 0.0], [0.0, a, b, c], [d, e, f, 0.0], [0.0, d, e, f]], dtype=complex)

    # the resultant is a quartic in y: from its values at the fifth roots of one
    values = [np.linalg.det(sylvester(y)) for y in np.exp(2j * pi * np.arange(5) / 5.0)]
    quartic = np.fft.fft(values) / 5.0
    roots = np.roots(quartic.real[::-1])
    places = []
    for y in roots:
        (a, b, c), (d, e, f) = quadratics(y)
        # the common root of both quadratics
        x = -(a * f - c * d) / (a * e - b * d)
        places.append([x, y, 1.0])
    return np.array(places)


def _refine_dyad(rows: FloatArray, v: ComplexArray) -> ComplexArray:
    """Refine a solution v = (zx, zy, mx, my) of the conditions of five poses by Newton's method."""
    for _ in range(8):
        zx, zy, mx, my = v
        full = np.array([1.0, zx, zy, mx, my, mx * zx + my * zy, mx * zy - my * zx])
        slope = np.zeros((7, 4), dtype=complex)
        slope[1:5] = np.eye(4)
        slope[5] = mx, my, zx, zy
        slope[6] = -my, mx, zy, -zx
        step = np.linalg.lstsq(rows @ slope, rows @ full, rcond=None)[0]
        v = v - step
        if np.abs(step).max() <= 1e-15 * np.abs(v).max():
            break
    return v


def real_dyads(z: ComplexArray, m: ComplexArray) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which dyads of `dyads_of_five` are real and finite, and which are real with an end at infinity."""
    both = np.column_stack([z, m])
    size, off = np.abs(both).max(axis=1), np.abs(both.imag).max(axis=1)
    return (size <= FAR) & (off <= REAL), (size > FAR) & (off <= REAL * size)


def _guide_five_poses(task: Poses, p: ComplexArray, angle: FloatArray) -> Guidance:
    unit = normal_form(task).unit
    z, m = dyads_of_five(p / unit, angle)
    off = np.abs(np.column_stack([z, m]).imag).max(axis=1)
    real, far = real_dyads(z, m)
    dyads = tuple(
        Dyad(pivot=p[0] + unit * complex(mx.real, my.real), point=p[0] + unit * complex(zx.real, zy.real))
        for (zx, zy), (mx, my) in zip(z[real], m[real])
    )
    # two dyads with the same pivot, or the same point of the body, guide it no better than one
    made = [
        build_four_bar(task, a, b)
        for a, b in permutations(dyads, 2)
        if min(abs(a.pivot - b.pivot), abs(a.point - b.point), a.length, b.length) > SAME * unit
    ]
    return Guidance(
        task=task,
        dyads=dyads,
        complex_dyads=int((~real & ~far).sum()),
        slides=int(far.sum()),
        nearest_complex=float(off[~real & ~far].min(initial=np.inf)),
        solutions=rank_solutions(made),
    )


def pinned_four_bar(a: complex, b: complex, c: complex, d: complex, p: complex) -> Linkage:
    """Build the four-bar whose pins A to D and coupler point P have these positions at a crank rotation of 0."""
    ground, arm, coupler, to_point = d - a, b - a, c - b, p - b
    return Linkage(
        pivot_x=a.real,
        pivot_y=a.imag,
        ground_length=abs(ground),
        crank_length=abs(arm),
        coupler_length=abs(coupler),
        rocker_length=abs(c - d),
        point_distance=abs(to_point),
        ground_angle=float(np.angle(ground)),
        crank_phase=float(np.angle(arm * ground.conjugate())),
        point_angle=float(np.angle(to_point * coupler.conjugate())),
        branch=1 if (coupler * (d - b).conjugate()).imag >= 0.0 else -1,
    )


def build_four_bar(task: Poses, crank: Dyad, rocker: Dyad) -> Solution:
    """Build the four-bar from two dyads, and check the linkage for defects from the first pose to the last."""
    points, angle = np.asarray(task.points) @ np.array([1.0, 1j]), np.asarray(task.angle)
    turned = np.exp(1j * (angle - angle[0]))
    b, c = (points + turned * (dyad.point - points[0]) for dyad in (crank, rocker))
    ground, arm, coupler = rocker.pivot - crank.pivot, b - crank.pivot, c - b
    sides = np.sign(np.imag(np.conj(rocker.pivot - b) * coupler))
    made = pinned_four_bar(*map(complex, (crank.pivot, b[0], c[0], rocker.pivot, points[0])))
    linkage = replace(made, output_angle=float(np.angle(np.exp(1j * angle[0]) * np.conj(coupler[0]))))
    if linkage.turns_fully or linkage.grashof == "change-point":
        rotation = unwrap_in_order(np.angle(arm * np.conj(arm[0])))
    else:
        # a crank that swings never points away from D, or never towards D: its angle may jump in that direction
        away = linkage.cosine_at_c(np.array([abs(ground) + abs(arm[0])]))[0] < -1.0
        th2 = np.angle(arm * np.conj(ground))
        th2 = th2 if away else th2 % (2.0 * pi)
        rotation = th2 - th2[0]
    return exact_solution(task, linkage, rotation, sides)


def exact_solution(task: Task, linkage: Linkage, rotation: FloatArray, sides: FloatArray) -> Solution:
    """Return the solution of a linkage that meets all targets of a task exactly, with its defects.

    ``sides`` has the assembly at each target: +1 with C to the left of B -> D, -1 to the right. If the targets need both
    assemblies, there is a branch defect. By Grashof's criterion the two assemblies are two circuits if the crank or the ground
    link is the shortest; if the coupler or the rocker is the shortest, the circuits differ by the side of the ground link on
    which the crank lies. All other linkages have one circuit.
    """
    verdicts = judge(linkage, rotation, closed=False)
    one_side, circuit = bool((sides == sides[0]).all()), True
    if linkage.grashof in ("crank-rocker", "drag-link"):
        circuit = one_side
    elif linkage.grashof in ("double-rocker", "rocker-crank"):
        above = np.sin(linkage.crank_phase + rotation) > 0.0
        circuit = bool((above == above[0]).all())
    verdicts = replace(verdicts, circuit=circuit, branch=verdicts.branch and one_side)
    return Solution(task=task, linkage=linkage, evaluation=evaluate(task, linkage, rotation), verdicts=verdicts)


def unwrap_in_order(turned: FloatArray) -> FloatArray:
    """Convert angles known up to whole turns to rotations from the first angle (rad), monotonic if possible."""
    forward = turned % (2.0 * pi)
    # the first is 0, even if rounding made it a whole turn
    forward[0] = 0.0
    if (np.diff(forward) > 0.0).all():
        return forward
    backward = np.append(0.0, forward[1:] - 2.0 * pi)
    return backward if (np.diff(backward) < 0.0).all() else forward


def dyads_of_four(p: ComplexArray, angle: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Compute points of the circle-point curve of four poses and their pivots, relative to the first position.

    For a point z, each pose after the first gives a line on which the pivot m lies. The condition that the three lines meet is
    a cubic in z, which is zero at the pole of two poses: a line through the pole meets the cubic in two further points. Points
    with an infinite pivot are left out.

    Raises InputError if the poses are not independent.
    """
    rows = _conditions(p, angle)
    _null_space(rows, 4)
    e = np.exp(1j * (angle[1:] - angle[0]))
    chosen = int(np.argmax(np.abs(e - 1.0)))
    if abs(e[chosen] - 1.0) < INDEPENDENT:
        raise InputError(_DEPENDENT_POSES)
    pole = -(p[chosen + 1] - p[0]) / (e[chosen] - 1.0)
    others = [j for j in range(3) if j != chosen]
    nearer: list[complex] = []
    farther: list[complex] = []
    for direction in np.exp(1j * pi * (np.arange(CURVE_POINTS) + 0.5) / CURVE_POINTS):
        # the line of the chosen pose vanishes at the pole, so that it is proportional to the distance from there
        along = _pivot_line(rows[chosen], pole + direction)

        def cubic(way: float, direction: complex = direction, along: FloatArray = along) -> float:
            met = [_pivot_line(rows[j], pole + way * direction) for j in others]
            return float(np.linalg.det(np.array([along, *met])))

        back, here, ahead = cubic(-1.0), cubic(0.0), cubic(1.0)
        ways = np.roots([0.5 * (ahead + back) - here, 0.5 * (ahead - back), here])
        for branch, way in zip((nearer, farther), sorted(ways, key=lambda w: float(w.real))):
            if abs(way.imag) <= REAL:
                branch.append(pole + way.real * direction)
    z = np.array(nearer + farther)
    lines = np.array([[_pivot_line(row, at) for row in rows] for at in z])
    m = np.array([np.linalg.lstsq(a[:, :2], -a[:, 2], rcond=None)[0] for a in lines]) @ np.array([1.0, 1j])
    near = (np.abs(z) < FAR) & (np.abs(m) < FAR)
    return z[near], m[near]


def _pivot_line(row: FloatArray, z: complex) -> FloatArray:
    """Return (a, b, c) of the line a mx + b my + c = 0 on which the pivot m of the moving point z lies, for one pose.

    ``row`` is the pose's row of `_conditions`; a, b and c are linear in z.
    """
    turned = complex(-row[5], row[6]) * z
    constant = row[0] + row[1] * z.real + row[2] * z.imag
    return np.array([row[3] - turned.real, row[4] - turned.imag, constant])


def _guide_four_poses(task: Poses, p: ComplexArray, angle: FloatArray, count: int) -> GuidanceMap:
    unit = normal_form(task).unit
    z, m = dyads_of_four(p / unit, angle)
    if not len(z):
        raise InputError(
            f"each link that guides the body through these poses has an end more than {FAR:g} times their size away, as if the "
            "body hardly turns; a slide is in its place: turn the body farther, or change a pose"
        )
    sound, transmission = _check_pairs(p / unit - p[0] / unit, np.exp(1j * (angle - angle[0])), z, m)
    pivots, points = p[0] + unit * m, p[0] + unit * z
    chosen: list[tuple[int, int]] = []
    for place in np.argsort(-transmission, axis=None)[: int(sound.sum())]:
        i, k = (int(n) for n in np.unravel_index(place, sound.shape))
        # neighbours on the curve give almost the same linkage
        if all(abs(z[i] - z[a]) + abs(z[k] - z[b]) > 0.1 for a, b in chosen):
            chosen.append((i, k))
        if len(chosen) == count:
            break
    dyads = [Dyad(pivot=complex(a), point=complex(b)) for a, b in zip(pivots, points)]
    made = rank_solutions([build_four_bar(task, dyads[i], dyads[k]) for i, k in chosen])
    return GuidanceMap(task=task, pivots=pivots, points=points, sound=sound, transmission=transmission, solutions=made)


def _check_pairs(
    p: ComplexArray, e: ComplexArray, z: ComplexArray, m: ComplexArray
) -> tuple[NDArray[np.bool_], FloatArray]:
    """Check the linkage of every pair of dyads, crank (row) and rocker (column), for defects.

    ``p`` and ``e`` are positions and rotations of the poses, ``z`` and ``m`` points and pivots of the dyads; the result is
    ``sound`` and ``transmission`` of `GuidanceMap`.
    """
    places = p[:, None] + e[:, None] * z
    arms = places - m
    turned = np.array([unwrap_in_order(np.angle(column / column[0])) for column in arms.T])
    steps = np.diff(turned, axis=1)
    order: NDArray[np.bool_] = np.asarray((steps > 0.0).all(axis=1) | (steps < 0.0).all(axis=1))
    ground = m[None, :] - m[:, None]
    l1, l2, l4 = np.abs(ground), np.abs(arms[0])[:, None], np.abs(arms[0])[None, :]
    l3 = np.abs(z[None, :] - z[:, None])
    largest = np.maximum(np.maximum(l1, l2), np.maximum(l3, l4))
    there = (np.minimum(np.minimum(l1, l2), np.minimum(l3, l4)) > 1e-6) & (largest <= LONGEST)
    sides = np.array([np.sign(np.imag(np.conj(m[None, :] - b[:, None]) * (b[None, :] - b[:, None]))) for b in places])
    with np.errstate(divide="ignore", invalid="ignore"):
        begin = np.angle(arms[0][:, None] / ground)
        end = begin + turned[:, -1:]
        low, high = np.minimum(begin, end) / pi, np.maximum(begin, end) / pi
        # distance from crank pin to rocker pivot at both ends, and where the crank passes the direction of the ground link
        even, odd = 2.0 * np.ceil(0.5 * low), 2.0 * np.ceil(0.5 * (low - 1.0)) + 1.0
        distances = [np.abs(m[None, :] - b[:, None]) for b in (places[0], places[-1])]
        distances += [np.where(even <= high, np.abs(l1 - l2), distances[0])]
        distances += [np.where(odd <= high, l1 + l2, distances[0])]
        cosines = [np.abs((l3 * l3 + l4 * l4 - d * d) / (2.0 * l3 * l4)) for d in distances]
        greatest = np.max(cosines, axis=0)
    one_side = np.abs(sides.sum(axis=0)) == float(len(p))
    sound = there & order[:, None] & one_side & (greatest < 1.0)
    return sound, np.where(sound, np.arccos(np.where(sound, greatest, 1.0)), 0.0)
