"""Function generation in closed form: find every four-bar whose rocker passes exactly through three to five angles.

Loop closure without the coupler's angle is Freudenstein's equation (F. Freudenstein, Approximate synthesis of four-bar
linkages, Trans. ASME 77, 1955), with th2 = phi + th20 and th4 = psi - the output's mounting angle,

    R1 cos th4 - R2 cos th2 + R3 = cos(th2 - th4),   R1 = l1/l2,  R2 = l1/l4,  R3 = (l1^2 + l2^2 - l3^2 + l4^2)/(2 l2 l4).

Three points determine R1, R2, R3 if crank phase and mounting angle are known. With a fourth point one of the two may be
unknown: the determinant of the four equations is a trigonometric polynomial of second degree in that angle. With a fifth point
both may be unknown: relative to the crank the rocker is a body in five poses, and C has a constant distance from B. Module
`burmester` solves this problem. One of the four dyads is always the ground link, with C at D and B at A, so that there are at
most three linkages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, ParameterError

from ...display import format_count
from ...units import Amount, in_si
from ..linkage.linkage import Linkage, wrap_angles
from ..result.solution import Solution, rank_solutions
from ..task.task import PrecisionPoints, RockerFunction, Task, TimedPath, UntimedPath, turn
from .burmester import INDEPENDENT, Exact, dyads_of_five, exact_solution, real_dyads

FloatArray = NDArray[np.float64]
#: Lengths of crank, coupler and rocker in units of the ground link; crank phase and mounting angle of the output (rad).
Links = tuple[float, float, float, float, float]
#: Default ground link of a function generator (m), as in a search.
GROUND = 0.1
#: Distance from the unit circle up to which a root of the determinant counts as an angle.
ON_CIRCLE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Generators(Exact):
    """All four-bars that generate a function exactly at its points.

    Attributes
    ----------
    task : RockerFunction
    solutions : tuple of Solution
        Sound linkages first, then by transmission angle.
    """

    task: RockerFunction
    solutions: tuple[Solution, ...]

    def describe(self) -> str:
        """Return a sentence that says how many linkages there are."""
        points = format_count(len(np.asarray(self.task.angle)), "point")
        if not self.solutions:
            return f"no four-bar does the function exactly at these {points}"
        linkages = format_count(len(self.solutions), "four-bar")
        if not self.sound:
            return f"{linkages} through the {points}: each has a defect, so that no sound four-bar exists"
        return f"{linkages} through the {points}: {len(self.sound)} sound"


_DEPENDENT_POINTS = (
    "the points of the function are not independent, such as those of a constant, or of a rocker that turns with the crank: "
    "infinitely many linkages pass through them. Change a point"
)


@in_si(crank_phase="rad", ground_length="m")
def function_generators(
    task: RockerFunction, *, crank_phase: Amount | None = None, ground_length: Amount = GROUND
) -> Generators:
    """Find all four-bars whose rocker passes exactly through the given angles.

    Parameters
    ----------
    task : RockerFunction
        A function with as many points as unknowns. The unknowns are three ratios of lengths, the crank's phase unless it is
        given, and the mounting angle if it is free (``mounting``).
    crank_phase : float, optional
        th20 (rad); unknown by default.
    ground_length : float
        Length of the ground link (m), which scales the linkage and does not affect the function.

    Raises
    ------
    InputError
        If there are more or fewer points than unknowns, or the points leave infinitely many linkages.

    Examples
    --------
    >>> import numpy as np
    >>> from analysis.synthesis import RockerFunction, chebyshev_spacing, function_generators
    >>> x = chebyshev_spacing(0.0, 1.0, 5)
    >>> task = RockerFunction(angle=1.5 + 0.8 * np.sin(0.5 * np.pi * x), rotation=1.6 * (x - x[0]), mounting=True)
    >>> print(function_generators(task).describe())
    """
    phi, psi = np.asarray(task.rotation), np.asarray(task.angle)
    free = 3 + task.mounting + (crank_phase is None)
    if len(phi) != free:
        raise InputError(_count_message(len(phi), free, task.mounting, crank_phase))
    phase = None if crank_phase is None else float(crank_phase)
    if phase is None and task.mounting:
        found = _five_point_links(phi, psi)
    elif phase is None:
        found = [_links(phi + at, psi, at, 0.0) for at in _roots(lambda at: _rows(phi + at, psi))]
    elif task.mounting:
        found = [_links(phi + phase, psi - at, phase, at) for at in _roots(lambda at: _rows(phi + phase, psi - at))]
    else:
        found = [_links(phi + phase, psi, phase, 0.0)]
    made = [_make_generator(task, float(ground_length), *links) for links in found if links is not None]
    return Generators(task=task, solutions=rank_solutions(made))


def _count_message(n: int, free: int, mounting: bool, crank_phase: object) -> str:
    """Return the error message for n points and ``free`` unknowns, if the two numbers differ."""
    unknown = ["three ratios of lengths"]
    unknown += ["the crank's phase"] if crank_phase is None else []
    unknown += ["the output's mounting"] if mounting else []
    more = "Leave points out" if n > free else "Add points, or fix the crank's phase or the mounting"
    return f"{n} points of a function, and {free} unknowns ({', '.join(unknown)}): a closed form needs equal numbers. {more}"


def _rows(th2: FloatArray, th4: FloatArray) -> FloatArray:
    """Return the coefficients of (R1, R2, R3, 1) in Freudenstein's equation at each point, shape (n, 4)."""
    return np.column_stack([np.cos(th4), -np.cos(th2), np.ones(len(th2)), -np.cos(th2 - th4)])


def _roots(rows: Callable[[float], FloatArray]) -> list[float]:
    """Return the angles in (-pi/2, pi/2] at which the determinant of four equations is zero.

    ``rows`` returns the matrix (4, 4) for an angle. The determinant is a trigonometric polynomial of first degree in twice the
    angle: an angle half a turn greater means the same link with a negative length.
    """
    samples = [rows(0.5 * at) for at in turn(3)]
    scale = np.linalg.svd(np.array(samples), compute_uv=False)
    if (scale[:, -1] < INDEPENDENT * scale[:, 0]).all():
        raise InputError(_DEPENDENT_POINTS)  # the determinant is zero at every angle
    terms = np.fft.fft(np.linalg.det(samples)) / 3.0
    # the powers -1 ... 1 of exp(2 i angle), the highest first
    found = np.roots(terms[[1, 0, 2]])
    return [0.5 * float(np.angle(root)) for root in found if abs(abs(root) - 1.0) < ON_CIRCLE]


def _links(th2: FloatArray, th4: FloatArray, crank_phase: float, mounting: float) -> Links | None:
    """Compute the links, in units of the ground link, from points with common R1, R2, R3; None if no real links exist.

    A link of negative length points in the opposite direction: its length becomes positive, and its angle changes by pi.

    Raises InputError if the points leave infinitely many linkages.
    """
    rows = _rows(th2, th4)
    scale = np.linalg.svd(rows[:, :3], compute_uv=False)
    if scale[-1] < INDEPENDENT * scale[0]:
        raise InputError(_DEPENDENT_POINTS)
    r1, r2, r3 = np.linalg.lstsq(rows[:, :3], -rows[:, 3], rcond=None)[0].tolist()
    if min(abs(r1), abs(r2)) < INDEPENDENT:
        return None
    l2, l4 = 1.0 / r1, 1.0 / r2
    squared = 1.0 + l2 * l2 + l4 * l4 - 2.0 * l2 * l4 * r3
    if squared <= 0.0:
        return None
    return (
        abs(l2),
        sqrt(squared),
        abs(l4),
        crank_phase + (pi if l2 < 0.0 else 0.0),
        mounting + (pi if l4 < 0.0 else 0.0),
    )


def _five_point_links(phi: FloatArray, psi: FloatArray) -> list[Links | None]:
    """Compute the links of the four-bars, three at most, that generate a function at five precision points.

    Relative to the crank the rocker takes five poses. Each real dyad that guides the rocker through these poses, except the
    ground link, is a coupler, with its pivot at B and its point at C.
    """
    places = np.exp(-1j * phi)
    try:
        parts = dyads_of_five(places, psi - phi)
    except InputError:
        raise InputError(_DEPENDENT_POINTS) from None
    real, _ = real_dyads(*parts)
    z, m = (part[real].real @ np.array([1.0, 1j]) for part in parts)
    m = places[0] + m
    there = np.arange(len(z)) != np.argmin(np.abs(z) + np.abs(m))
    return [
        (abs(b), abs(places[0] + c - b), abs(c), float(np.angle(b)), float(psi[0] - phi[0] - np.angle(c)))
        for b, c in zip(m[there], z[there])
    ]


def _make_generator(
    task: RockerFunction,
    ground: float,
    crank: float,
    coupler: float,
    rocker: float,
    crank_phase: float,
    mounting: float,
) -> Solution:
    """Build the four-bar with these links, in units of the ground link ``ground`` (m), and check it between the end points."""
    th2 = np.asarray(task.rotation) + crank_phase
    th4 = np.asarray(task.angle) - mounting
    b, c = crank * np.exp(1j * th2), 1.0 + rocker * np.exp(1j * th4)
    sides = np.sign(np.imag(np.conj(1.0 - b) * (c - b)))
    linkage = Linkage(
        ground_length=ground,
        crank_length=ground * crank,
        coupler_length=ground * coupler,
        rocker_length=ground * rocker,
        crank_phase=float(wrap_angles(np.asarray(crank_phase))),
        output_angle=float(wrap_angles(np.asarray(mounting))),
        branch=1 if sides[0] >= 0.0 else -1,
    )
    return exact_solution(task, linkage, np.asarray(task.rotation), sides)


#: Number of steps between two stations in which a link's angle is tracked.
BETWEEN = 90


def cognates(linkage: Linkage, rotation: ArrayLike = 0.0) -> tuple[Linkage, Linkage, Linkage]:
    """Compute the Roberts-Chebyshev cognates of a four-bar.

    Parameters
    ----------
    linkage : Linkage
        A four-bar with a fixed rocker pivot whose coupler point is neither B nor C.
    rotation : float
        Crank rotation of the original (rad) at which the crank rotation of the second and third cognate is 0. The first cognate
        has the same crank rotation as the original.

    Returns
    -------
    tuple of Linkage
        Three four-bars with the same coupler curve; G is the third fixed pivot. The first has the pivots G and D and its crank
        at G. The second has the pivots A and G and its crank at A. The third is the second with its crank at G.

    Raises
    ------
    ParameterError
        If the linkage is not a four-bar with a fixed rocker pivot, or the coupler point is B or C.
    AssemblyError
        If the links cannot be joined at ``rotation``.

    Examples
    --------
    >>> import numpy as np
    >>> from analysis.synthesis import Linkage, cognates
    >>> four_bar = Linkage(
    ...     ground_length=0.4, crank_length=0.1, coupler_length=0.3, rocker_length=0.25, point_distance=0.2, point_angle=0.7
    ... )
    >>> phi = np.linspace(0.0, 6.0, 7)
    >>> np.allclose(cognates(four_bar)[0].path(phi), four_bar.path(phi), rtol=0.0, atol=1e-15)
    True
    """
    k = _checked_coupler_ratio(linkage)
    pins = {name: complex(*place) for name, place in linkage.pins(float(np.asarray(rotation))).items()}
    a, b, c, d, p = (pins[name] for name in "ABCDP")
    g = a + k * (d - a)
    same = _pinned_four_bar(g, g + (1.0 - k) * (b - a), d + (1.0 - k) * (b - c), d, p)
    pin, other = a + k * (c - b), g + k * (c - d)
    return (
        replace(same, crank_phase=linkage.crank_phase),
        _pinned_four_bar(a, pin, other, g, p),
        _pinned_four_bar(g, other, pin, a, p),
    )


def alternatives(solution: Solution) -> tuple[Solution, ...]:
    """Return the cognates of a solution as solutions of its task: the same coupler curve with other pivots.

    If the task gives crank rotations, only the cognate with the same crank rotations is returned. For a closed path
    only cognates whose cranks can turn fully are returned.

    Returns
    -------
    tuple of Solution
        Sound linkages first.

    Raises
    ------
    InputError
        If the task is not a path: the coupler of a cognate has other angles than that of the original.
    ParameterError
        As `cognates`.
    AssemblyError
        If the links cannot be joined at the first target.
    """
    task, linkage, rotation = solution.task, solution.linkage, solution.rotation
    if not _is_path(task):
        raise InputError(
            f"a {type(task).__name__} has no cognates: they share the coupler curve, but not the links' angles"
        )
    same, *others = cognates(linkage, rotation[0])
    stations = solution.evaluation.rotation
    if isinstance(task, TimedPath) or (isinstance(task, PrecisionPoints) and task.rotation is not None):
        return (Solution.from_linkage(task, same),)
    if isinstance(task, UntimedPath) and task.path.closed:
        return rank_solutions(
            [Solution.from_linkage(task, cognate) for cognate in (same, *others) if cognate.turns_fully]
        )
    assert stations is not None
    made = [Solution.from_linkage(task, same, stations)]
    way = np.interp(np.arange((len(stations) - 1) * BETWEEN + 1) / BETWEEN, np.arange(len(stations)), stations)
    coupler, rocker = linkage.coupler_angle(way), linkage.rocker_angle(way)
    for cognate, angle, sides in zip(others, (coupler, rocker), _cognate_sides(linkage, way)):
        made.append(exact_solution(task, cognate, (angle - angle[0])[::BETWEEN], sides))
    return rank_solutions(made)


def _cognate_sides(linkage: Linkage, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the assemblies of the second and the third cognate (see `cognates`) at crank rotations of the original.

    An assembly is +1 with C to the left of B -> D, -1 to the right.
    """
    k = _checked_coupler_ratio(linkage)
    g = linkage.directions(rotation)
    # positions relative to A, with the ground link along the real axis
    b = linkage.crank_length * np.exp(1j * (rotation + linkage.crank_phase))
    pin = k * linkage.coupler_length * (g[0] + 1j * g[1])
    pivot = k * linkage.ground_length
    other = pin + k * b
    at_a, at_g = (
        np.sign(np.imag(np.conj(end - crank) * (far - crank)))
        for crank, far, end in ((pin, other, pivot), (other, pin, 0.0))
    )
    return at_a, at_g


def has_cognates(solution: Solution) -> bool:
    """Return whether a solution has cognates: a path traced by a four-bar whose coupler point is neither B nor C."""
    linkage = solution.linkage
    return _is_path(solution.task) and linkage.kind == "four-bar" and linkage.pivot is None and _is_off_pins(linkage)


def _is_path(task: Task) -> bool:
    return not isinstance(task, RockerFunction) and getattr(task, "angle", None) is None


def _is_off_pins(linkage: Linkage) -> bool:
    return min(abs(k := _coupler_ratio(linkage)), abs(1.0 - k)) > 1e-9


def _coupler_ratio(linkage: Linkage) -> complex:
    """Return (P - B)/(C - B), the complex ratio of coupler point and coupler."""
    return linkage.point_distance / linkage.coupler_length * complex(np.exp(1j * linkage.point_angle))


def _checked_coupler_ratio(linkage: Linkage) -> complex:
    """Return `_coupler_ratio` of a linkage that has cognates; raise ParameterError as `cognates` for any other."""
    if linkage.kind != "four-bar" or linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: only a four-bar has cognates")
    if not _is_off_pins(linkage):
        raise ParameterError(
            "point_distance",
            linkage.point_distance,
            "put the coupler point off B and C, whose curves are circles, in m",
        )
    return _coupler_ratio(linkage)


def _pinned_four_bar(a: complex, b: complex, c: complex, d: complex, p: complex) -> Linkage:
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
