"""Chapter VII: the coupler curves at fixed slider positions, and the area that the coupler point reaches (Fig 7.2).

The mechanism of Fig 7.2 to 7.10 has links of 0.5 and 1 without a unit: lengths are in units of l3. Figures 7.4 to 7.10 are in
`series_1`, Figures 7.11 and 7.12 in `series_2`.
"""

from __future__ import annotations

from functools import cache
from math import pi, radians

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...synthesis import Linkage, MachineSpec, SliderMotion
from ...youssef import AccessibleArea, accessible_area
from ..rules import READ
from ..statements import FloatArray, at_least, at_most, near, statement
from ..study import Study, StudyResult, pad_columns

ComplexArray = NDArray[np.complex128]
TARGET = "0.25"
#: Crank rotations of the curves (rad).
TURN = np.linspace(0.0, 2.0 * pi, 721)
#: l2 = r = 0.5, l3 = l4 = 1, all angles zero; U = u + 1.
LINKAGE = Linkage(ground_length=1.0, crank_length=0.5, coupler_length=1.0, rocker_length=1.0, point_distance=0.5)
#: Values of U for the family of coupler curves; the values of the thesis are lost.
FAMILY = (0.6, 0.8, 1.0, 1.2, 1.4)
#: Crank angles of the isochronous curves (deg).
ISOCHRONES = range(0, 360, 30)
#: Limits of U within which the family of coupler curves is drawn; the limits of the thesis are lost.
LIMITS = ((FAMILY[0], FAMILY[-1]), (0.501, 1.499), (-1.499, 1.499))
#: Slider positions u of the isochronous arcs that are judged (l3).
ALONG = np.linspace(0.501, 1.499, 101) - 1.0
#: Number of precision points, and amplitudes of the slider between them.
PRECISION, BETWEEN = 5, (-0.4, -0.2, 0.2, 0.4)


def coupler_point(rotation: FloatArray, u: ArrayLike) -> ComplexArray:
    """Return the coupler point P (l3, complex) at crank rotations (rad) with the slider at u = U - 1."""
    u = np.asarray(u, dtype=float) + np.zeros_like(rotation)
    return np.asarray(LINKAGE.path(rotation, (u, np.zeros_like(u))) @ np.array([1.0, 1j]))


def pointing_positions(rotation: FloatArray, target: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return a and b of U = a +- sqrt(b), eq (7.14): the slider positions at which the coupler points at the target."""
    l2, l3, l4 = LINKAGE.crank_length, LINKAGE.coupler_length, LINKAGE.rocker_length
    th3 = np.angle(target - l2 * np.exp(1j * rotation))
    centre = l2 * np.cos(rotation) + l3 * np.cos(th3)
    return centre, centre**2 - (l2**2 + l3**2 - l4**2 + 2.0 * l2 * l3 * np.cos(rotation - th3))


def slider(linkage: Linkage) -> SliderMotion:
    """Return the motion of a linkage's moving rocker pivot."""
    assert isinstance(linkage.pivot, SliderMotion)
    return linkage.pivot


def plane(curves: list[Curve], **more: object) -> Panel:
    """Build a panel that draws curves in the plane of series 1."""
    options = {"legend_at": "outside"} | more
    return Panel(x_label="x / l3", y_label="y / l3", curves=curves, equal=True, **options)  # type: ignore[arg-type]


def xy(name: str, z: ComplexArray) -> dict[str, FloatArray]:
    """Return points of series 1 as two columns, whose names begin with ``name``."""
    return {f"{name} x [l3]": z.real, f"{name} y [l3]": z.imag}


def path_curve(result: StudyResult, name: str, label: str = "", **look: object) -> Curve:
    """Return the curve of the points whose two columns `xy` has made under this name."""
    c = result.columns
    return Curve(x=c[f"{name} x [l3]"], y=c[f"{name} y [l3]"], label=label, **look)  # type: ignore[arg-type]


def family() -> StudyResult:
    """Compute Fig 7.2: coupler curves, isochronous curves, and the share of the enclosed area that P reaches."""
    areas = {limits: reached_area(*limits) for limits in LIMITS}
    columns: dict[str, FloatArray] = {}
    for u in FAMILY:
        columns |= xy(f"U = {u:g}", coupler_point(TURN, u - 1.0))
    for angle in ISOCHRONES:
        arc = coupler_point(np.full(41, radians(angle)), np.linspace(FAMILY[0] - 1.0, FAMILY[-1] - 1.0, 41))
        columns |= xy(f"th2 = {angle} deg", arc)
    shown = areas[LIMITS[0]]
    for k, ring in enumerate((*shown.outer, *shown.holes)):
        columns |= xy(f"boundary {k}", ring @ np.array([1.0, 1j]))
    kept, changed = departures_from_path()
    phi, along = (x.ravel() for x in np.meshgrid(TURN, ALONG))
    radii = np.abs(coupler_point(phi, along) - LINKAGE.crank_length * np.exp(1j * phi))
    off_arc = np.abs(radii - LINKAGE.point_distance).max()
    middle, square = pointing_positions(phi, coupler_point(phi, along))
    root = np.sqrt(np.maximum(square, 0.0))
    off_slider = np.abs(np.abs(1.0 + along - middle) - root).max()
    return StudyResult(
        claim="With the slider free, P reaches any point on or within the outer boundaries of the family of coupler curves.",
        assignment="Links of series 1 (L5720): l2 = r = 0.5, l3 = l4 = 1. The values of U are lost: 0.6 to 1.4 are our "
        "choice. The crank turns fully from -1.5 to 1.5 except at +-0.5.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "If, however, a second input is established to which a controller is attached the output may be modified, "
                "anywhere in an infinite variety, yet still prescribing the same originally desired precision points.",
                "7.0, L5203",
                f"distance of P from its place at U = 1 and the same crank angle, with u = a sin^2({PRECISION} theta2 / 2) "
                f"for a = {', '.join(f'{a:g}' for a in BETWEEN)} l3 (all our choice): the greatest at the {PRECISION} "
                "precision points, where u = 0; then the greatest over all a in each interval between two of them, of which "
                "the least is listed",
                f"1e-12 l3, for rounding errors; more than {READ:g} l3, the accuracy to which a graph can be read",
                at_most("at the precision points", 1e-12, kept, "l3"),
                at_least("between the precision points", READ, changed, "l3"),
                why=f"the variety is infinite, since a may have any value from {BETWEEN[0]:g} to {BETWEEN[-1]:g} l3",
            ),
            statement(
                "First, any point lying on or within the outer boundaries of the family is accessible to the chosen "
                "coupler-point by suitable combination of [theta2] and U.",
                "7.0, L5242",
                "area that P reaches, relative to the area within the outer boundary of the family, for three limits of U "
                "(our choice), with the links assembled as in the plot",
                "1 %, our choice, which exceeds the error of the areas",
                *(
                    near(
                        f"U from {low:g} to {high:g}",
                        1.0,
                        area.area / enclosed_area(low, high),
                        0.01,
                        why="the region round which all curves of the family go is out of reach",
                    )
                    for (low, high), area in areas.items()
                ),
            ),
            statement(
                "Such 'isochronous' curves, which are arcs of circles centred at the corresponding fixed position, of B, can "
                "be regarded simply as a reference grid from which the resulting motion can be determined once a particular "
                "continuous variation of U is specified. Alternatively, they may be regarded as[] providing a starting point "
                "from which a desired variation in U may be deduced.",
                "7.0, L5260-5272",
                f"distance of P from B minus r, at {TURN.size - 1} crank angles and {ALONG.size} values of U from "
                f"{1.0 + ALONG[0]:g} to {1.0 + ALONG[-1]:g}; then U deduced from the place of P on its arc, by the nearer root "
                "of (7.14), minus U: the greatest size of each",
                "1e-12 l3, for rounding errors, and 1e-6 l3 for U, which a square root gives",
                at_most("P off its arc", 1e-12, off_arc, "l3"),
                at_most("U deduced from P", 1e-6, off_slider, "l3"),
                why="once theta2 and U are given, P is one point of the arc; the other root of (7.14) puts P at the same point",
            ),
        ),
    )


@cache
def reached_area(low: float, high: float) -> AccessibleArea:
    """Return the area that P reaches with U between two limits."""
    return accessible_area(MachineSpec().sliding_five_bar(LINKAGE), (low - 1.0, high - 1.0), tolerance=1e-4)


def enclosed_area(low: float, high: float) -> float:
    """Return the area that the coupler curves for U between two limits enclose together.

    It is the union of the areas within 21 of these curves and of the area that P reaches, which covers the space between the 21
    curves.
    """
    import shapely

    found = reached_area(low, high)
    rings = [shapely.LinearRing(ring) for ring in (*found.outer, *found.holes)]
    shapes = [shapely.build_area(shapely.GeometryCollection(rings))]
    # dense at 0 and 180 deg, where P swings round B within half a degree at U near 0.5 and -0.5, so that a chord would add area
    turn = np.linspace(0.0, 2.0 * pi, 7200, endpoint=False)
    turned = turn - 0.5 * np.sin(2.0 * turn)
    for u in np.linspace(low, high, 21):
        z = coupler_point(turned, u - 1.0)
        line = shapely.LinearRing(np.column_stack([z.real, z.imag]))
        shapes += shapely.get_parts(shapely.polygonize([shapely.node(line)])).tolist()
    return float(shapely.union_all(shapes).area)


def departures_from_path() -> tuple[float, float]:
    """Return how far (in l3) P departs from its path for U = 1 if the slider moves between the precision points.

    The amplitudes of the slider are `BETWEEN`. The first result is the greatest departure at a precision point. For the
    second, the greatest departure over all amplitudes is taken in each interval between two precision points; the result is
    the least of these.
    """
    # finer than the plot: the departures are listed to four digits
    rotation = np.linspace(0.0, 2.0 * pi, 2000 * PRECISION + 1)
    change = np.sin(0.5 * PRECISION * rotation) ** 2
    away = np.max([np.abs(coupler_point(rotation, a * change) - coupler_point(rotation, 0.0)) for a in BETWEEN], axis=0)
    kept = away[::2000].max()
    return float(kept), float(away[:-1].reshape(PRECISION, -1).max(axis=1).min())


def draw_family(result: StudyResult) -> Figure:
    """Draw coupler curves with marks every 30 degrees, isochronous curves dotted, and the accessible area shaded."""
    c = result.columns
    every = slice(None, None, 60)
    curves = [path_curve(result, f"U = {u:g}", f"U = {u:g}", colour=colour) for u, colour in zip(FAMILY, COLOURS)]
    for u, colour in zip(FAMILY, COLOURS):
        x, y = c[f"U = {u:g} x [l3]"][: TURN.size][every], c[f"U = {u:g} y [l3]"][: TURN.size][every]
        curves.append(Curve(x=x, y=y, line="", marker=".", colour=colour))
    for angle in ISOCHRONES:
        label = "isochronous" if angle == 0 else ""
        curves.append(path_curve(result, f"th2 = {angle} deg", label, colour=TARGET, line=":", width=1.0))
    names = [name.removesuffix(" x [l3]") for name in c if name.startswith("boundary") and name.endswith("x [l3]")]
    rings = [np.column_stack([c[f"{name} {axis} [l3]"] for axis in "xy"]) for name in names]
    filled = [[ring[np.isfinite(ring[:, 0])] for ring in rings]]
    return plot_curves([plane(curves, filled=filled)], title=result.heading, size=(6.6, 4.4))


#: The studies by number.
STUDIES = {"7.2": Study(family, draw_family)}
