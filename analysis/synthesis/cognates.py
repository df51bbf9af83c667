"""The other four-bars that trace the same coupler curve (S. Roberts, 1875; P. L. Chebyshev, 1878).

With k = (P - B)/(C - B), a complex number of the coupler, the third fixed pivot is G = A + k (D - A). One cognate stands on G
and D; its crank at G is (1 - k)(B - A), which turns with the original one, so that the curve is traced in the same time. The
other stands on A and G; its links at these are k (C - B) and k (C - D), which turn with the original coupler and rocker:
either may drive it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, ParameterError

from .burmester import exact_solution
from .linkage import Linkage
from .solution import Solution, ranked
from .tasks import PrecisionPoints, RockerFunction, Task, TimedPath, UntimedPath

FloatArray = NDArray[np.float64]

#: Rotations between two stations at which a link's angle is followed.
BETWEEN = 90


def cognates(linkage: Linkage, rotation: ArrayLike = 0.0) -> tuple[Linkage, Linkage, Linkage]:
    """The Roberts-Chebyshev cognates of a four-bar.

    Parameters
    ----------
    linkage : Linkage
        With a fixed rocker pivot, its coupler point neither B nor C.
    rotation : float
        Crank rotation (rad) at which the cognates are where theirs is 0, but for the first, whose rotation is the original's.

    Returns
    -------
    tuple of Linkage
        That on G and D, driven at G; that on A and G, driven at A; the same, driven at G.

    Raises
    ------
    ParameterError
        If the rocker pivot moves, or the coupler point's curve is a circle.
    AssemblyError
        If the links cannot be joined at that rotation.

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
    k = _place_on_coupler(linkage)
    pins = {name: complex(*place) for name, place in linkage.pins(float(np.asarray(rotation))).items()}
    a, b, c, d, p = (pins[name] for name in "ABCDP")
    g = a + k * (d - a)
    same = _between(g, g + (1.0 - k) * (b - a), d + (1.0 - k) * (b - c), d, p)
    pin, other = a + k * (c - b), g + k * (c - d)
    return replace(same, crank_phase=linkage.crank_phase), _between(a, pin, other, g, p), _between(g, other, pin, a, p)


def alternatives(solution: Solution) -> tuple[Solution, ...]:
    """The cognates of a solution as solutions of its task: the same curve from other pivots.

    A task with crank rotations keeps the one that turns with the crank; a closed path those that can turn fully.

    Returns
    -------
    tuple of Solution
        Sound ones first.

    Raises
    ------
    InputError
        If the task is not one of a path: the cognates' couplers turn otherwise.
    ParameterError
        As `cognates`.
    AssemblyError
        If the links cannot be joined at the first target.
    """
    task, linkage, rotation = solution.task, solution.linkage, solution.rotation
    if not _of_path(task):
        raise InputError(f"{type(task).__name__}: cognates share the coupler's curve, not its angle nor the rocker's")
    same, *others = cognates(linkage, rotation[0])
    stations = solution.evaluation.rotation
    if isinstance(task, TimedPath) or (isinstance(task, PrecisionPoints) and task.rotation is not None):
        return (Solution.of(task, same),)
    if isinstance(task, UntimedPath) and task.path.closed:
        return ranked([Solution.of(task, cognate) for cognate in (same, *others) if cognate.turns_fully])
    assert stations is not None
    made = [Solution.of(task, same, stations)]
    way = np.interp(np.arange((len(stations) - 1) * BETWEEN + 1) / BETWEEN, np.arange(len(stations)), stations)
    coupler, rocker = linkage.coupler_angle(way), linkage.rocker_angle(way)
    for cognate, angle, sides in zip(others, (coupler, rocker), _sides(linkage, way)):
        made.append(exact_solution(task, cognate, (angle - angle[0])[::BETWEEN], sides))
    return ranked(made)


def _sides(linkage: Linkage, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Assemblies along the way of the cognate on A and G, driven at A and at G: +1 with its C to the left of its B -> D."""
    k = _place_on_coupler(linkage)
    g = linkage.directions(rotation)
    # from A, the ground link along the real axis
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
    """Whether `alternatives` has any: of a path, traced by a four-bar whose coupler point is neither B nor C."""
    linkage = solution.linkage
    return _of_path(solution.task) and linkage.pivot is None and not linkage.slides and _off_pins(linkage)


def _of_path(task: Task) -> bool:
    return not isinstance(task, RockerFunction) and getattr(task, "angle", None) is None


def _off_pins(linkage: Linkage) -> bool:
    return min(abs(k := _ratio(linkage)), abs(1.0 - k)) > 1e-9


def _ratio(linkage: Linkage) -> complex:
    """(P - B)/(C - B)."""
    return linkage.point_distance / linkage.coupler_length * complex(np.exp(1j * linkage.point_angle))


def _place_on_coupler(linkage: Linkage) -> complex:
    """(P - B)/(C - B); raises ParameterError as `cognates`."""
    if linkage.pivot is not None or linkage.slides:
        raise ParameterError("pivot", linkage.pivot, "be fixed: only a four-bar has cognates")
    if not _off_pins(linkage):
        raise ParameterError(
            "point_distance",
            linkage.point_distance,
            "put the coupler point off B and C, whose curves are circles, in m",
        )
    return _ratio(linkage)


def _between(a: complex, b: complex, c: complex, d: complex, p: complex) -> Linkage:
    """The four-bar with these pins at a crank rotation of 0."""
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
