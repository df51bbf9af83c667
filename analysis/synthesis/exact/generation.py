"""Find function generators, quick returns and cognates in closed form.

Function generators are the four-bars whose rockers pass exactly through three to five angles. Loop closure without the
coupler's angle is Freudenstein's equation (F. Freudenstein, Approximate synthesis of four-bar linkages, Trans. ASME 77, 1955),
with th2 = phi + th20 and th4 = psi - the output's mounting angle,

    R1 cos th4 - R2 cos th2 + R3 = cos(th2 - th4),   R1 = l1/l2,  R2 = l1/l4,  R3 = (l1^2 + l2^2 - l3^2 + l4^2)/(2 l2 l4).

Three points determine R1, R2, R3 if crank phase and mounting angle are known. With a fourth point one of the two may be
unknown: the determinant of the four equations is a trigonometric polynomial of second degree in that angle. With a fifth point
both may be unknown: relative to the crank the rocker is a body in five poses, and C has a constant distance from B. Module
`burmester` solves this problem. One of the four dyads is always the ground link, with C at D and B at A, so that there are at
most three linkages.

A quick return is the best slider-crank for a stroke, or crank-rocker for a swing, with a given time ratio. In the dead centres
C is at the distances l3 + l2 and l3 - l2 from A. The angle between the two directions of A -> C is the advance
pi (Q - 1)/(Q + 1). The laws of cosines and sines give

    l2^2 (1 + cos advance) = H^2/2 - l3^2 (1 - cos advance),    l1 H = (l3^2 - l2^2) sin advance

with the stroke H, the time ratio Q and the offset l1. One unknown remains, l3: it is chosen so that (l1 + l2)/l3, the cosine
of the least transmission angle, is least. For a crank-rocker the same equations hold, with the chord H = 2 l4 sin(swing/2)
between the two extreme positions of C. D lies on A's side of that chord if, with a counter-clockwise crank, the slow
swing of the rocker is counter-clockwise, too. See R. L. Norton, Design of Machinery, 6th ed., 2020, chapters 3 and 4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import acos, cos, degrees, hypot, inf, isfinite, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, minimize_scalar

from linkwork.errors import InputError, ParameterError

from ...display import format_count
from ...units import Amount, in_si
from ..linkage.linkage import LINKS, Linkage, SliderCrank, wrap_angles
from ..linkage.machine import dead_centres
from ..result.solution import Solution, rank_solutions
from ..task.constraint import Assembly, FullTurn, InfeasibleError, LargestLink, LeastTransmission, crank_advance
from ..task.limits import GROUND, LARGEST, check_bounds, check_greatest_length, check_sequence, complete_bounds
from ..task.task import PrecisionPoints, RockerFunction, SliderFunction, Task, TimedPath, UntimedPath, turn
from .burmester import INDEPENDENT, SAME, Exact, dyads_of_five, exact_solution, pinned_four_bar, real_dyads

FloatArray = NDArray[np.float64]
#: Lengths of crank, coupler and rocker in units of the ground link; crank phase and mounting angle of the output (rad).
Links = tuple[float, float, float, float, float]
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


@in_si(crank_phase="rad")
def function_generators(task: RockerFunction, *, crank_phase: Amount | None = None) -> Generators:
    """Find all four-bars whose rocker passes exactly through the given angles.

    Parameters
    ----------
    task : RockerFunction
        A function with as many points as unknowns. The unknowns are three ratios of lengths, the crank's phase unless it is
        given, and the mounting angle if it is free (``mounting``).
    crank_phase : float, optional
        th20 (rad); unknown by default.

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
    made = [_make_generator(task, *links) for links in found if links is not None]
    return Generators(task=task, solutions=rank_solutions(made))


def _count_message(n: int, free: int, mounting: bool, crank_phase: object) -> str:
    """Return the error message for a number n of points that differs from the number ``free`` of unknowns."""
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
    """Compute the links, in units of the ground link, from points with common R1, R2, R3; None if there are no such links.

    ``th2`` and ``th4`` are the angles of crank and rocker at the points, for the given crank phase and mounting angle. A link
    of negative length points in the opposite direction: its length becomes positive, and its angle changes by pi.

    Raises InputError if the points leave infinitely many linkages.
    """
    rows = _rows(th2, th4)
    scales = [np.linalg.svd(one, compute_uv=False) for one in (rows[:, :3], rows)]
    of_links, of_all = (int((scale > INDEPENDENT * scale[0]).sum()) for scale in scales)
    if of_links < min(of_all, 3):
        return None  # the points contradict one another
    if of_links < 3:
        raise InputError(_DEPENDENT_POINTS)
    r1, r2, r3 = np.linalg.lstsq(rows[:, :3], -rows[:, 3], rcond=None)[0].tolist()
    if min(abs(r1), abs(r2)) < INDEPENDENT:
        return None
    l2, l4 = 1.0 / r1, 1.0 / r2
    squared = 1.0 + l2 * l2 + l4 * l4 - 2.0 * l2 * l4 * r3
    if squared <= 0.0:
        return None
    turned, mounted = crank_phase + (pi if l2 < 0.0 else 0.0), mounting + (pi if l4 < 0.0 else 0.0)
    return abs(l2), sqrt(squared), abs(l4), turned, mounted


def _five_point_links(phi: FloatArray, psi: FloatArray) -> list[Links | None]:
    """Compute the links of the four-bars, three at most, that generate a function at five precision points.

    ``phi`` are the crank's rotations, ``psi`` the rocker's angles. Relative to the crank the rocker takes five poses. Each real
    dyad that guides the rocker through these poses, except the ground link, is a coupler, with its pivot at B and its point at
    C.
    """
    places = np.exp(-1j * phi)
    try:
        parts = dyads_of_five(places, psi - phi)
    except InputError:
        raise InputError(_DEPENDENT_POINTS) from None
    real, _ = real_dyads(*parts)
    z, m = (part[real].real @ np.array([1.0, 1j]) for part in parts)
    m = places[0] + m
    # all four dyads may be the ground link, as for a rocker that turns as the crank does, but the other way
    there = np.abs(z) + np.abs(m) > SAME
    return [
        (abs(b), abs(places[0] + c - b), abs(c), float(np.angle(b)), float(psi[0] - phi[0] - np.angle(c)))
        for b, c in zip(m[there], z[there])
    ]


def _make_generator(
    task: RockerFunction, crank: float, coupler: float, rocker: float, crank_phase: float, mounting: float
) -> Solution:
    """Build the four-bar with given links, see `Links`, and check it between the first point and the last."""
    th2 = np.asarray(task.rotation) + crank_phase
    th4 = np.asarray(task.angle) - mounting
    b, c = crank * np.exp(1j * th2), 1.0 + rocker * np.exp(1j * th4)
    sides = np.sign(np.imag(np.conj(1.0 - b) * (c - b)))
    linkage = Linkage(
        ground_length=GROUND,
        crank_length=GROUND * crank,
        coupler_length=GROUND * coupler,
        rocker_length=GROUND * rocker,
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
    k = _coupler_ratio(linkage)
    pins = {name: complex(*place) for name, place in linkage.pins(float(np.asarray(rotation))).items()}
    a, b, c, d, p = (pins[name] for name in "ABCDP")
    g = a + k * (d - a)
    same = pinned_four_bar(g, g + (1.0 - k) * (b - a), d + (1.0 - k) * (b - c), d, p)
    pin, other = a + k * (c - b), g + k * (c - d)
    second, third = pinned_four_bar(a, pin, other, g, p), pinned_four_bar(g, other, pin, a, p)
    return replace(same, crank_phase=linkage.crank_phase), second, third


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
        If the task is not a path: the coupler of a cognate has other angles than the coupler of the original.
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
        return rank_solutions([Solution.from_linkage(task, one) for one in (same, *others) if one.turns_fully])
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
    k = _coupler_ratio(linkage)
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
    try:
        _coupler_ratio(solution.linkage)
    except ParameterError:
        return False
    return _is_path(solution.task)


def _is_path(task: Task) -> bool:
    return not isinstance(task, RockerFunction) and getattr(task, "angle", None) is None


def _coupler_ratio(linkage: Linkage) -> complex:
    """Return (P - B)/(C - B), the complex ratio of coupler point and coupler; raise ParameterError if there are no cognates."""
    if linkage.kind != "four-bar" or linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: only a four-bar has cognates")
    k = linkage.point_distance / linkage.coupler_length * complex(np.exp(1j * linkage.point_angle))
    if min(abs(k), abs(1.0 - k)) <= 1e-9:
        wanted = "put the coupler point off B and C, whose curves are circles, in m"
        raise ParameterError("point_distance", linkage.point_distance, wanted)
    return k


# Quick returns

#: Number of coupler lengths that are tried before the best one is found exactly.
COUPLERS = 2001
#: Dimensions of a slider-crank that may have bounds.
BOUNDED = ("ground_length", "crank_length", "coupler_length")


@in_si(stroke="m")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickReturn(SliderFunction):
    """Task: the slider moves by a stroke along the x axis in the slow part of a turn, and back in the quick part.

    Attributes
    ----------
    stroke : float
        Distance between the ends of the slider's travel (m).
    time_ratio : float
        Duration of the slow stroke divided by the duration of the quick stroke, at constant crank speed: at least 1.
    position, rotation : ndarray, shape (3,)
        Computed from stroke and time ratio: slider positions 0, stroke and 0 (m), and the crank rotations there (rad).
    """

    stroke: Amount
    time_ratio: float = 1.0
    position: ArrayLike = field(init=False)
    rotation: ArrayLike | None = field(init=False)
    weights: ArrayLike | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        if not (isfinite(float(self.stroke)) and float(self.stroke) > 0.0):
            raise ParameterError("stroke", float(self.stroke), "be a finite number above zero (m)")
        slow = pi + _advance(self.time_ratio)
        object.__setattr__(self, "position", np.array([0.0, float(self.stroke), 0.0]))
        object.__setattr__(self, "rotation", np.array([0.0, slow, 2.0 * pi]))
        SliderFunction.__post_init__(self)

    @property
    def advance(self) -> float:
        """Return the crank rotation of the slow part minus half a turn (rad)."""
        return _advance(self.time_ratio)


@in_si(swing="rad")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickSwing(RockerFunction):
    """Task: the rocker of a crank-rocker swings by an angle in the slow part of a turn, and back in the quick part.

    Attributes
    ----------
    swing : float
        Swing of the rocker in the slow part (rad), less than half a turn: counter-clockwise, with a counter-clockwise crank.
        If the swing is negative, rocker and crank turn clockwise, which is the same linkage seen from behind.
    time_ratio : float
        See `QuickReturn`.
    angle, rotation : ndarray, shape (3,)
        Computed from swing and time ratio: rocker angles 0, swing and 0 (rad), relative to a free mounting angle, and the crank
        rotations there (rad).
    """

    swing: Amount
    time_ratio: float = 1.0
    angle: ArrayLike = field(init=False)
    rotation: ArrayLike | None = field(init=False)
    weights: ArrayLike | None = field(init=False, default=None)
    mounting: bool = field(init=False, default=True)

    def __post_init__(self) -> None:
        if not 0.0 < abs(float(self.swing)) < pi:
            raise ParameterError("swing", float(self.swing), "be an angle above zero and below half a turn (rad)")
        object.__setattr__(self, "angle", np.array([0.0, float(self.swing), 0.0]))
        way = 1.0 if float(self.swing) > 0.0 else -1.0
        object.__setattr__(self, "rotation", way * np.array([0.0, pi + _advance(self.time_ratio), 2.0 * pi]))
        RockerFunction.__post_init__(self)


def _advance(time_ratio: float) -> float:
    """Return the advance pi (Q - 1)/(Q + 1) (rad) for a time ratio Q; raise ParameterError if Q is not finite or below 1."""
    if not (isfinite(time_ratio) and time_ratio >= 1.0):
        raise ParameterError("time ratio", time_ratio, "be a finite number of 1 or more")
    return crank_advance(time_ratio)


def quick_returns(
    task: QuickReturn | QuickSwing, bounds: Mapping[str, tuple[float, float]] | None, constraints: Sequence[Any]
) -> tuple[Solution, ...]:
    """Find the linkage whose least transmission angle is greatest; return it in each allowed assembly.

    Raises InputError or ParameterError if a bound or a constraint is not supported here; InfeasibleError if there is no
    linkage, or no linkage has the required transmission angle: the message names the greatest possible angle.
    """
    check_sequence("constraints", constraints)
    for c in constraints:
        if not isinstance(c, LeastTransmission | FullTurn | LargestLink | Assembly):
            other = "SliderFunction" if isinstance(task, QuickReturn) else "RockerFunction"
            raise InputError(
                f"a {type(task).__name__} cannot keep {type(c).__name__}: leave it out, or ask for a {other}"
            )
    branches = {c.branch for c in constraints if isinstance(c, Assembly)}
    if len(branches) > 1:
        raise InfeasibleError("the constraints require both assemblies at once")
    shapes: _StrokeShapes | _SwingShapes
    if isinstance(task, QuickReturn):
        shapes, kind = _StrokeShapes(task, bounds, constraints), "slider-crank"
        asked = f"a stroke of {1e3 * float(task.stroke):g} mm"
    else:
        shapes, kind = _SwingShapes(task, bounds, constraints), "crank-rocker"
        asked = f"a swing of {degrees(float(task.swing)):g} deg"
    asked += f" and a time ratio of {task.time_ratio:g}"
    least = max((float(c.angle) for c in constraints if isinstance(c, LeastTransmission)), default=0.0)
    l3 = _best_coupler(shapes)
    cosine = shapes.cosine(l3)
    if not cosine < 1.0:
        raise InfeasibleError(f"no {kind} with {asked} has a crank that turns fully within these bounds")
    if acos(cosine) < least:
        raise InfeasibleError(
            f"a transmission angle of {degrees(least):g} deg is asked for: with {asked} the best {kind} has "
            f"{degrees(acos(cosine)):.4g} deg"
        )
    return rank_solutions([Solution.from_linkage(task, shapes.linkage(l3, branch)) for branch in branches or (1, -1)])


def _best_coupler(shapes: _StrokeShapes | _SwingShapes) -> float:
    """Find the coupler length, within its bounds, that minimises the cosine of the transmission angle.

    The search includes the lengths at which a bound of another link is reached: these may be the only possible ones if the
    length of the other link is fixed.
    """
    ends, cosine = shapes.couplers, shapes.cosine
    couplers = np.linspace(*ends, COUPLERS)
    values = np.array([shapes.margins(float(l3)) for l3 in couplers])
    reached = [
        brentq(lambda l3, m=m: shapes.margins(l3)[m], *couplers[k : k + 2], xtol=1e-15 * ends[1])
        for k, m in zip(*np.nonzero(values[:-1] * values[1:] < 0.0))
    ]
    couplers = np.sort(np.append(couplers, reached))
    best = int(np.argmin([cosine(float(l3)) for l3 in couplers]))
    low, high = couplers[max(best - 1, 0)], couplers[min(best + 1, len(couplers) - 1)]
    found = minimize_scalar(cosine, bounds=(low, high), method="bounded", options={"xatol": 1e-12 * high})
    return float(min((couplers[best], float(found.x)), key=cosine))


class _StrokeShapes:
    """Slider-cranks with a given stroke and time ratio. ``l3`` is the length of the coupler (m)."""

    def __init__(self, task: QuickReturn, bounds: Any, constraints: Sequence[Any]) -> None:
        self.stroke, self.advance = float(task.stroke), task.advance
        longest = LARGEST * self.stroke
        cap = min((float(c.length) for c in constraints if isinstance(c, LargestLink)), default=longest)
        ends = _read_bounds(bounds, BOUNDED, SliderCrank.links)
        offset, crank, (low, high) = ((least, min(cap, most)) for least, most in ends.values())
        self.bounds = offset, crank
        # the coupler is at least half the stroke, as with a time ratio of 1 and no offset
        most = self.stroke / (2.0 * sin(0.5 * self.advance)) if self.advance > 0.0 else inf
        self.couplers = max(low, 0.5 * self.stroke), min(high, most)
        if not self.couplers[0] <= self.couplers[1]:
            raise InfeasibleError(
                f"the coupler is to be {1e3 * low:g} to {1e3 * high:g} mm: with this stroke and time ratio it is "
                f"{500.0 * self.stroke:g} mm at least" + (f" and {1e3 * most:g} mm at most" if isfinite(most) else "")
            )

    def margins(self, l3: float) -> FloatArray:
        """Return by how much offset and crank exceed each of their bounds (m)."""
        lengths = np.array(_lengths(l3, self.advance, self.stroke))
        return (lengths[:, None] - self.bounds).ravel()

    def cosine(self, l3: float) -> float:
        """Return the cosine of the least transmission angle over a turn.

        The result is 1 if no linkage exists, a bound is violated, or the dead centres need different assemblies.
        """
        l1, l2 = _lengths(l3, self.advance, self.stroke)
        for value, (low, high) in zip((l1, l2), self.bounds):
            if not low * (1.0 - 1e-9) <= value <= high * (1.0 + 1e-9):
                return 1.0
        # both dead centres lie on one side of the offset's foot
        if l2 == 0.0 or (l3 + l2) ** 2 - l1 * l1 <= self.stroke * self.stroke:
            return 1.0
        return min(1.0, (l1 + l2) / l3)

    def linkage(self, l3: float, branch: int) -> SliderCrank:
        """Build the slider-crank, its guide below the shaft: with a counter-clockwise crank the stroke to the right is slow."""
        l1, l2 = _lengths(l3, self.advance, self.stroke)
        far, near = (sqrt(max((l3 + side * l2) ** 2 - l1 * l1, 0.0)) for side in (1.0, -1.0))
        # crank angle with the slider at 0: crank and coupler folded, or stretched on the other side of the shaft
        phase = pi + acos(l1 / (l3 - l2)) if branch > 0 else -acos(l1 / (l3 + l2))
        return SliderCrank(
            pivot_x=-near if branch > 0 else far,
            pivot_y=l1,
            ground_length=l1,
            crank_length=l2,
            coupler_length=l3,
            point_distance=l3,
            ground_angle=-0.5 * pi,
            crank_phase=phase,
            branch=branch,
        )


class _SwingShapes:
    """Crank-rockers with a given swing and time ratio. ``l3`` is the ratio of coupler to rocker; bounds determine the size."""

    def __init__(self, task: QuickSwing, bounds: Any, constraints: Sequence[Any]) -> None:
        self.task, self.advance = task, _advance(task.time_ratio)
        cap = min((float(c.length) for c in constraints if isinstance(c, LargestLink)), default=inf)
        self.least, most = np.array(list(_read_bounds(bounds, LINKS, LINKS).values())).T
        self.most = np.minimum(most, cap)
        chord = 2.0 * sin(0.5 * abs(float(task.swing)))
        longest = chord / (2.0 * sin(0.5 * self.advance)) if self.advance > 0.0 else inf
        self.couplers = 0.5 * chord, min(longest, LARGEST)
        self.chord = chord

    def ratios(self, l3: float) -> tuple[FloatArray, bool]:
        """Return l1 ... l4 divided by l4 for a ratio l3, and whether the dead centres need the same assembly."""
        e, l2 = _lengths(l3, self.advance, self.chord)
        far = sqrt(max((l3 + l2) ** 2 - e * e, 0.0))
        x, y = far - 0.5 * self.chord, sqrt(max(1.0 - 0.25 * self.chord**2, 0.0)) - e
        # side of A -> C on which D lies, for both positions of C
        sides = [x * -e - y * reach for reach in (far, far - self.chord)]
        return np.array([hypot(x, y), l2, l3, 1.0]), l2 > 0.0 and sides[0] * sides[1] > 0.0

    def margins(self, l3: float) -> FloatArray:
        """Return a value for each pair of a lower and an upper bound of links: zero if the pair allows a single size only.

        ``l3`` is the ratio of coupler to rocker.
        """
        found, _ = self.ratios(l3)
        least, most = self.least[:, None] * found, np.where(np.isfinite(self.most), self.most, 0.0)[:, None] * found
        return (least - most.T)[:, np.isfinite(self.most)].ravel()

    def links(self, l3: float) -> tuple[float, float, float, float] | None:
        """Return l1 ... l4 (m) for a ratio l3; None if the dead centres need different assemblies, or a bound is violated."""
        found, joined = self.ratios(l3)
        if not joined:
            return None
        least, most = float((self.least / found).max()), float((self.most / found).min())
        if least > most * (1.0 + 1e-9):
            return None
        # a ground link of 100 mm, or as near to it as the bounds allow
        l1, l2, l3, l4 = (min(max(GROUND / found[0], least), most) * found).tolist()
        return l1, l2, l3, l4

    def cosine(self, l3: float) -> float:
        """Return the cosine of the least transmission angle over a turn; 1 if no linkage exists or a bound is violated."""
        links = self.links(l3)
        if links is None:
            return 1.0
        l1, l2, l3, l4 = links
        both = [abs(l3 * l3 + l4 * l4 - reach * reach) / (2.0 * l3 * l4) for reach in (l1 - l2, l1 + l2)]
        return min(1.0, max(both))

    def linkage(self, l3: float, branch: int) -> Linkage:
        """Build the crank-rocker for a ratio l3; the crank rotation is 0 in the dead centre at which the slow part begins."""
        links = self.links(l3)
        assert links is not None
        l1, l2, l3, l4 = links
        # a clockwise swing is a counter-clockwise one seen from behind
        side = 1 if float(self.task.swing) > 0.0 else -1
        made = Linkage(ground_length=l1, crank_length=l2, coupler_length=l3, rocker_length=l4, branch=side * branch)
        first, second = dead_centres(made)
        slow = [
            (abs((end - start) % (2.0 * pi) - pi - self.advance), start)
            for start, end in ((first, second), (second, first))
        ]
        begun = [replace(made, branch=branch, crank_phase=side * start) for off, start in slow if off < 1e-6]
        begun = [replace(one, output_angle=-float(one.rocker_angle([0.0])[0])) for one in begun]
        return min(begun, key=lambda one: Solution.from_linkage(self.task, one).error)


def _read_bounds(bounds: Any, names: Sequence[str], links: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the least and greatest length of each dimension in ``names`` (m): as given, or zero and infinity.

    ``links`` are the names of the dimensions that cannot be zero.
    """
    given = check_bounds(bounds)
    for name in given:
        if name not in names:
            raise ParameterError(name, given[name], f"bound one of {', '.join(names)}: the other dimensions follow")
    free = 0.0, inf
    both = {name: complete_bounds(name, given.get(name, free), free) for name in names}
    for name in links:
        check_greatest_length(name, both[name][1])
    return {name: (max(low, 0.0), high) for name, (low, high) in both.items()}


def _lengths(l3: float, turned: float, h: float) -> tuple[float, float]:
    """Return offset and crank length (m) for a coupler length l3, a crank advance ``turned`` (rad) and a stroke or chord h."""
    l2 = sqrt(max(0.5 * h * h - l3 * l3 * (1.0 - cos(turned)), 0.0) / (1.0 + cos(turned)))
    return max(l3 * l3 - l2 * l2, 0.0) * sin(turned) / h, l2
