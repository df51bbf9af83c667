"""Problems of chapter VI of the thesis, with the linkages of appendix 5, converted from cm and degrees to SI.

`PROBLEMS` maps a name to a `PublishedProblem`. The thesis bounds the lengths of only one problem. Its other problems are
ill-posed: the error tends to zero as the links grow. Here each of these is therefore stated with two constraints of ours. No
link is longer than the longest of the printed linkage. The transmission angle is at least 40 degrees, or, for rocker functions,
whose target fixes this angle, the crank turns fully.

>>> problem = PROBLEMS["ellipse-a"]
>>> round(problem.linkage_error(problem.linkage), 2)
5.64
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import degrees, radians
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ... import synthesis as syn
from ...units import CM_PER_METRE
from ..statements import FloatArray

CM2_PER_M2 = CM_PER_METRE**2
DEG2_PER_RAD2 = degrees(1.0) ** 2
#: Weight of the weighted rocker function from 60 to 260 degrees; the thesis divides the error by this weight.
WEIGHT = 1000.0
#: Numbers of crank angles for timed paths and the rocker function, and for the weighted one. N is printed for the paths only.
N, WEIGHTED_N = 72, 24
#: Number of points of an ellipse and of a coupler curve for the area between them.
AREA_N = 360


@dataclass(frozen=True, slots=True, eq=False)
class PublishedProblem:
    """Synthesis problem of the thesis with its printed linkage.

    Attributes
    ----------
    task : Task
    printed : Linkage
        Linkage with the printed digits.
    error : float or None
        Printed error, in ``unit``.
    goal : float
        Error to be reached, in ``unit``.
    mended : Linkage, optional
        Linkage with its misprints mended, if it has any.
    bounds : mapping
        Bounds on the dimensions, as `synthesize` takes them.
    limits : tuple, optional
        Constraints; None for the constraints that the property ``constraints`` chooses by the kind of task.
    """

    task: syn.Task
    printed: syn.Linkage
    error: float | None
    goal: float
    mended: syn.Linkage | None = None
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    limits: tuple[syn.Constraint, ...] | None = None

    @property
    def constraints(self) -> tuple[syn.Constraint, ...]:
        """Return the constraints, as `synthesize` takes them; they are ours: the thesis bounds only lengths."""
        if self.limits is not None:
            return self.limits
        if isinstance(self.task, syn.RockerFunction):
            return (syn.FullTurn(),)
        return (syn.LargestLink(length=self.linkage.largest_link), *syn.USUAL)

    @property
    def unit(self) -> str:
        """Return the unit of the error, cm2 for a path and deg2 for a rocker function."""
        return "deg2" if isinstance(self.task, syn.RockerFunction) else "cm2"

    @property
    def per_si(self) -> float:
        """Return the number of ``unit`` in one m2 or rad2; for a rocker function divided by the greatest weight."""
        if not isinstance(self.task, syn.RockerFunction):
            return CM2_PER_M2
        return DEG2_PER_RAD2 / float(np.max(np.asarray(self.task.weights, dtype=float)))

    @property
    def linkage(self) -> syn.Linkage:
        """Return the printed linkage with its misprints mended, if it has any."""
        return self.mended or self.printed

    def convert(self, error: float) -> float:
        """Convert an error from SI to ``unit``."""
        return self.per_si * error

    def linkage_error(self, linkage: syn.Linkage) -> float:
        """Return the error of a linkage in ``unit``, infinite if its links cannot be joined."""
        if isinstance(self.task, syn.UntimedPath):
            curve = linkage.path(syn.turn(AREA_N))
            return self.convert(syn.area_difference(curve, self.task.path)) if np.isfinite(curve).all() else np.inf
        return self.convert(syn.evaluate(self.task, linkage).error)


def ellipse(semi_axis_cm: float, n: int) -> FloatArray:
    """Return n points of the target ellipse about (20, 15) cm, shape (n, 2) in m.

    The semi-axis along x is given in cm, the semi-axis along y is 5 cm.
    """
    phi = syn.turn(n)
    return np.column_stack([20.0 + semi_axis_cm * np.cos(phi), 15.0 + 5.0 * np.sin(phi)]) / CM_PER_METRE


def rocker_angle_deg(rotation: ArrayLike) -> FloatArray:
    """Return the desired rocker angle th4* = 70 + 100 |sin(th/2)| (deg) at crank rotations th (rad)."""
    return np.asarray(70.0 + 100.0 * np.abs(np.sin(0.5 * np.asarray(rotation))))


def rocker_function(n: int, *, weighted: bool = False, mounting: bool = False, end: bool = False) -> syn.RockerFunction:
    """Return the function `rocker_angle_deg` at n crank angles, optionally weighted by `WEIGHT`.

    With ``end`` the end of the turn is counted too. With ``mounting`` the output may be mounted on the rocker at any angle.
    The weighted window is 60 to 260 degrees, with both ends. The thesis prints 60 < omega t < 260 and an error of 35.0 deg2.
    The computed error comes nearest to 35.0 if 60 degrees belongs to the window, with 24 crank angles, and if only the errors
    within the window are added up.
    """
    # in whole numbers, so that the ends of the window are exact
    steps = np.arange(n + end)
    within, rotation = (
        (60 * n <= 360 * steps) & (360 * steps <= 260 * n),
        np.linspace(0.0, 2.0 * np.pi, n + 1)[: n + end],
    )
    return syn.RockerFunction(
        angle=np.radians(rocker_angle_deg(rotation)),
        rotation=rotation,
        weights=np.where(within, WEIGHT, 1.0) if weighted else None,
        mounting=mounting,
    )


#: The ten points of the packaging machine (appendix 5), offset by (51, 350) cm; 160 and the x of (0, 31) are uncertain in the
#: scan. The first points lie on y = 0, the straight part.
PACKAGING_POINTS_CM = (
    (164.0, 8.0),
    (164.0, 0.0),
    (160.0, 0.0),
    (50.0, 0.0),
    (10.0, 0.0),
    (0.0, 31.0),
    (0.0, 61.0),
    (45.0, 61.0),
    (92.0, 61.0),
    (128.0, 34.5),
)
PACKAGING_OFFSET_CM = (51.0, 350.0)
#: Least travel on the straight part, and the greatest deviation from straightness there.
PACKAGING_TRAVEL, PACKAGING_FLATNESS = 144.0 / CM_PER_METRE, 2.5 / CM_PER_METRE
#: Crank rotation of the straight part.
PACKAGING_ROTATION = radians(120.0)


def packaging_path() -> syn.TargetPath:
    """Return the closed polygon of the ten points of the packaging machine."""
    return syn.TargetPath(points=(np.array(PACKAGING_POINTS_CM) + PACKAGING_OFFSET_CM) / CM_PER_METRE, closed=True)


def _packaging() -> syn.UntimedPath:
    # the ends of the straight part replace the points (160, 0) and (50, 0); they are half a centimetre farther apart than the
    # required travel, and clear of the corners, so that the polygon is the same
    points = np.array([*PACKAGING_POINTS_CM[:2], (159.5, 0.0), (15.0, 0.0), *PACKAGING_POINTS_CM[4:]])
    path = syn.TargetPath(points=(points + PACKAGING_OFFSET_CM) / CM_PER_METRE, closed=True)
    # the flatness is constrained at the stations only: keep a reserve for the curve between them
    straight = syn.Straight(start=2, end=3, rotation=PACKAGING_ROTATION, flatness=0.9 * PACKAGING_FLATNESS)
    return syn.UntimedPath(path=path, straight=straight)


def _linkage(
    place_cm: tuple[float, float],
    links_cm: tuple[float, float, float, float],
    point_cm: float,
    angles_deg: tuple[float, float, float],
    branch: int = 1,
) -> syn.Linkage:
    """Build a linkage from the printed numbers: X0, Y0; l1 to l4; r; a1, th20, a2 (cm, deg)."""
    lengths = (x / CM_PER_METRE for x in (*place_cm, *links_cm, point_cm))
    return syn.Linkage.from_vector([*lengths, *map(radians, angles_deg)], branch)


_ELLIPSE_A = _linkage((16.48, -47.89), (65.31, 5.04, 112.85, 104.34), 63.26, (-92.82, 96.26, 114.02))
_ELLIPSE_B = _linkage((-60.48, 169.45), (165.65, 7.95, 179.09, 216.94), 174.32, (-3.44, -27.05, -136.94))
_BOUNDED = _linkage((19.6, 0.03), (16.4, 5.01, 26.5, 22.0), 15.4, (93.8, 93.2, 127.3))
_ROCKER = _linkage((0.0, 0.0), (5.083, 2.615, 4.148, 3.75), 0.0, (0.0, 41.88, 0.0))
_WEIGHTED = _linkage((0.0, 0.0), (15.65, 6.91, 11.77, 11.56), 0.0, (0.0, 42.74, 0.0))
_PATH_A = _linkage((154.85, -62.54), (80.216, 5.03, 139.25, 129.46), 77.75, (-93.22, 100.41, 113.83))
_PATH_B = _linkage((-49.13, 144.98), (142.576, 8.18, 152.743, 183.443), 147.38, (-3.062, -31.19, -136.04))
# no th20 is printed, since an untimed path needs none. This is the only linkage with C to the right of B -> D
_PACKAGING = _linkage((94.53, -48.55), (137.54, 36.05, 134.05, 40.06), 435.15, (116.73, 0.0, 345.01), branch=-1)


PROBLEMS: Mapping[str, PublishedProblem] = MappingProxyType(
    {
        "ellipse-a": PublishedProblem(syn.TimedPath(points=ellipse(10.0, N)), _ELLIPSE_A, 0.889, 0.46),
        "ellipse-b": PublishedProblem(syn.TimedPath(points=ellipse(15.0, N)), _ELLIPSE_B, 4.001, 0.62),
        "ellipse-a-bounded": PublishedProblem(
            syn.TimedPath(points=ellipse(10.0, N)),
            _BOUNDED,
            53.6,
            6.4,
            # ERRATA: a1 = 93.8 deg is printed without its sign
            mended=replace(_BOUNDED, ground_angle=radians(-93.8)),
            bounds=MappingProxyType(
                {
                    **dict.fromkeys(("ground_length", "coupler_length", "rocker_length"), (0.1, 0.3)),
                    # l2 <= 10 cm; the least length excludes a crank of length zero
                    "crank_length": (1e-3, 0.1),
                    "point_distance": (0.0, 0.3),
                }
            ),
            limits=syn.USUAL,
        ),
        "rocker": PublishedProblem(rocker_function(N), _ROCKER, 700.0, 1025.0),
        "rocker-weighted": PublishedProblem(rocker_function(WEIGHTED_N, weighted=True), _WEIGHTED, 35.0, 35.6),
        "path-a": PublishedProblem(
            syn.UntimedPath(path=syn.path_from_formula("0.20 + 0.10*cos(t)", "0.15 + 0.05*sin(t)", n=AREA_N)),
            _PATH_A,
            2.3,
            0.125,
            # ERRATA: X0 = 154.85 cm, the point misplaced by a digit: the curve would lie 139 cm beside its target
            mended=replace(_PATH_A, pivot_x=15.485 / CM_PER_METRE),
        ),
        "path-b": PublishedProblem(
            syn.UntimedPath(path=syn.path_from_formula("0.20 + 0.15*cos(t)", "0.15 + 0.05*sin(t)", n=AREA_N)),
            _PATH_B,
            12.6,
            0.31,
            # ERRATA: l4 = 183.443 cm
            mended=replace(_PATH_B, rocker_length=184.443 / CM_PER_METRE),
        ),
        "packaging": PublishedProblem(
            _packaging(),
            _PACKAGING,
            None,
            620.0,
            # the crank shaft lies below the line, by no more than the coupler point's reach
            bounds=MappingProxyType(
                {"pivot_y": ((PACKAGING_OFFSET_CM[1] - 500.0) / CM_PER_METRE, PACKAGING_OFFSET_CM[1] / CM_PER_METRE)}
            ),
            limits=(syn.LargestLink(length=_PACKAGING.point_distance), *syn.USUAL),
        ),
    }
)
#: The rocker functions at 36 crank angles and the end of the turn. By this number, which the thesis does not print, both
#: printed linkages are minima within the rounding of their digits, and by no other that we tried.
AS_FOUND: Mapping[str, PublishedProblem] = MappingProxyType(
    {
        name: replace(PROBLEMS[name], task=rocker_function(36, weighted=weighted, end=True))
        for name, weighted in (("rocker", False), ("rocker-weighted", True))
    }
)


def pairing_area(desired: FloatArray, actual: FloatArray, *, window: float) -> float:
    """Return the thesis's quality function of path generation, an area (section 6.4.1, listing at L9797).

    The first desired point is paired with the nearest actual point. Each following desired point is paired with the nearest of
    the actual points that follow the previous partner; their number is ``window`` times the actual points per desired point.
    If there are as many actual points as desired ones, they are paired in order, because the program leaves no point without a
    partner (L9894-9898). Two successive pairs span two triangles, whose areas are added up. The lesser result of the two
    senses of rotation is returned.
    """
    span = int(window * len(actual) / len(desired))
    areas = []
    for way in (actual, actual[::-1]):
        curve = np.roll(way, -int(np.argmin(np.hypot(*(way - desired[0]).T))), axis=0)
        partner = list(range(len(curve))) if len(curve) == len(desired) else [0]
        for point in desired[len(partner) :]:
            ahead = curve[partner[-1] : partner[-1] + span + 1]
            partner.append(partner[-1] + int(np.argmin(np.hypot(*(ahead - point).T))))
        d, a = (np.vstack([points, points[:1]]) @ np.array([1.0, 1j]) for points in (desired, curve[partner]))
        triangles = ((a[:-1] - d[:-1], a[1:] - d[:-1]), (d[1:] - d[:-1], a[1:] - d[:-1]))
        areas.append(sum(0.5 * float(np.abs((p.conj() * q).imag).sum()) for p, q in triangles))
    return min(areas)
