"""Series 1 of chapter VII: a moving slider keeps the coupler point near a desired curve at every crank angle.

The mechanism of Fig 7.2 to 7.10 has links of 0.5 and 1 without a unit: lengths are in units of l3. The desired curve is
lost with its figure; every statement on series 1 is judged with ours, Fig 7.4. The variational motion (a) is nearest at
every crank angle, but has corners that no slider follows at speed. The eleven terms of the direct search (b) have none,
at the cost of an eighth more squared error. Series 2 is in `analysis.studies.youssef.series_2`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from math import degrees, inf, pi, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.fourier import FourierSeries
from ...slider import VariationalMotion, slider_motion, variational_motion
from ...synthesis import Linkage, Search, SliderMotion, SliderUnknown, Solution, TimedPath, turn
from ...youssef import accessible, accessible_area
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, near, padded, text, unjudged

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

TARGET = "0.25"
#: Crank rotations of the curves (rad).
TURN = np.linspace(0.0, 2.0 * pi, 721)
#: l2 = r = 0.5, l3 = l4 = 1, all angles zero; U = u + 1.
LINKAGE = Linkage(ground_length=1.0, crank_length=0.5, coupler_length=1.0, rocker_length=1.0, point_distance=0.5)
#: Values of U of the family; the thesis's are lost.
FAMILY = (0.6, 0.8, 1.0, 1.2, 1.4)
#: Crank angles of the isochronous curves (deg).
ISOCHRONES = range(0, 360, 30)
#: Crank angles of the desired points, and which of them lie on p1 p2.
ROTATION = turn(72)
P1, P2 = radians(150.0), radians(210.0)
WITHIN = (ROTATION > P1 - 1e-9) & (ROTATION < P2 + 1e-9)
#: Weight within p1 p2, of 1 elsewhere, and harmonics of eleven terms.
WEIGHT, HARMONICS = 5.0, 5
#: Error where the links cannot be joined.
NO_LINKAGE = 1e3
SERIES_1 = "Desired curve: ours, see Fig 7.4."


def point(rotation: FloatArray, u: ArrayLike) -> ComplexArray:
    """Return P at crank rotations with the slider at u = U - 1."""
    u = np.asarray(u, dtype=float) + np.zeros_like(rotation)
    return np.asarray(LINKAGE.path(rotation, (u, np.zeros_like(u))) @ np.array([1.0, 1j]))


def desired(rotation: FloatArray = ROTATION) -> ComplexArray:
    """Return the desired points: P at U = 0.8 + 0.4 |sin th2| with the crank advanced by 0.05 sin th2 rad."""
    return point(rotation + 0.05 * np.sin(rotation), 0.4 * np.abs(np.sin(rotation)) - 0.2)


def task(weights: ArrayLike | None = None) -> TimedPath:
    """Return the desired points as a task."""
    return TimedPath(points=np.column_stack([desired().real, desired().imag]), weights=weights)


@cache
def variational(n: int = 72) -> VariationalMotion:
    """Return the slider motion of least error at n crank rotations."""
    wanted = desired(turn(n))
    return variational_motion(LINKAGE, turn(n), np.column_stack([wanted.real, wanted.imag]))


@cache
def direct(
    harmonics: int = HARMONICS, inside: float = 1.0, outside: float = 1.0, acceleration: float = inf
) -> Solution:
    """Return the best Fourier series of the slider, with weights inside and outside p1 p2 and a bound on |d2U/dth2^2|."""
    unknown = SliderUnknown(harmonics=harmonics, guide_angle=(0.0, 0.0), acceleration=acceleration)
    weights = np.where(WITHIN, inside, outside)
    return slider_motion(task(weights), LINKAGE, unknown, search=Search(starts=4)).best


def slider(linkage: Linkage) -> SliderMotion:
    """Return the motion of a linkage's rocker pivot."""
    assert isinstance(linkage.pivot, SliderMotion)
    return linkage.pivot


def squared_errors(found: Solution) -> tuple[float, float]:
    """Return the sums of the squared errors inside and outside p1 p2."""
    squares = found.evaluation.errors**2
    return float(squares[WITHIN].sum()), float(squares[~WITHIN].sum())


def ends_of_simplex(starts: int = 6, seed: int = 7) -> list[float]:
    """Return the errors at which the downhill simplex ends from random coefficients of eleven terms."""
    random = np.random.default_rng(seed)

    def error(c: FloatArray) -> float:
        series = FourierSeries(c[: HARMONICS + 1], np.append(0.0, c[HARMONICS + 1 :]))
        missed = np.abs(point(ROTATION, series(ROTATION)) - desired())
        return float(missed @ missed) if np.isfinite(missed).all() else NO_LINKAGE

    guesses = 0.1 * random.normal(size=(starts, 2 * HARMONICS + 1))
    options = {"maxfev": 4000, "xatol": 1e-6, "fatol": 1e-9}
    return [float(minimize(error, c, method="Nelder-Mead", options=options).fun) for c in guesses]


def by_equations(rotation: FloatArray, target: ComplexArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Solve eq (7.14) for U, with both signs of its root, or (7.15) if (7.14) has no root.

    Returns U, shape (n, 2), and a mask of the points that use (7.15).
    """
    l2, l3, l4 = LINKAGE.crank_length, LINKAGE.coupler_length, LINKAGE.rocker_length
    th3 = np.angle(target - l2 * np.exp(1j * rotation))
    first = l2 * np.cos(rotation) + l3 * np.cos(th3)
    square = first**2 - (l2**2 + l3**2 - l4**2 + 2.0 * l2 * l3 * np.cos(rotation - th3))
    upright = square < 0.0
    # (7.15), the rocker at th4 = 90 deg
    second = l2 * np.cos(rotation)
    other = second**2 - (l2**2 + l4**2 - l3**2 - 2.0 * l2 * l4 * np.sin(rotation))
    centre, root = np.where(upright, second, first), np.sqrt(np.where(upright, other, square))
    return np.column_stack([centre + root, centre - root]), upright


def plane(curves: list[Curve], **more: object) -> Panel:
    """Build a panel with curves in the plane of series 1."""
    options = {"legend_at": "outside"} | more
    return Panel(x_label="x / l3", y_label="y / l3", curves=curves, equal=True, **options)  # type: ignore[arg-type]


def xy(name: str, z: ComplexArray) -> dict[str, FloatArray]:
    """Return points of series 1 as two columns."""
    return {f"{name} x [l3]": z.real, f"{name} y [l3]": z.imag}


def curve_of(result: StudyResult, name: str, label: str = "", **look: object) -> Curve:
    """Return two columns of `xy` as a curve."""
    c = result.columns
    return Curve(x=c[f"{name} x [l3]"], y=c[f"{name} y [l3]"], label=label, **look)  # type: ignore[arg-type]


def family() -> StudyResult:
    """Compute Fig 7.2: coupler curves, isochronous curves, and the share of the enclosed area that P reaches."""
    five_bar = LINKAGE.to_five_bar()
    ends = (FAMILY[0] - 1.0, FAMILY[-1] - 1.0)
    area = accessible_area(five_bar, ends, tolerance=1e-4)
    surrounded = area.area + sum(_area(ring) for ring in area.holes)
    columns: dict[str, FloatArray] = {}
    for u in FAMILY:
        columns |= xy(f"U = {u:g}", point(TURN, u - 1.0))
    spread = 0.0
    for angle in ISOCHRONES:
        arc = point(np.full(41, radians(angle)), np.linspace(*ends, 41))
        columns |= xy(f"th2 = {angle} deg", arc)
        pin = LINKAGE.crank_length * np.exp(1j * radians(angle))
        spread = max(spread, float(np.abs(np.abs(arc - pin) - LINKAGE.point_distance).max()))
    for k, ring in enumerate((*area.outer, *area.holes)):
        columns |= xy(f"boundary {k}", ring @ np.array([1.0, 1j]))
    closed = sum(bool(np.isfinite(columns[f"U = {u:g} x [l3]"]).all()) for u in FAMILY)
    random = np.random.default_rng(72)
    sample = point(random.uniform(0.0, 2.0 * pi, 5000), random.uniform(*ends, 5000))
    inside = area.contains(sample.real, sample.imag)
    rings = np.concatenate([*area.outer, *area.holes]) @ np.array([1.0, 1j])
    farthest = max((float(np.abs(rings - z).min()) for z in sample[~inside]), default=0.0)
    return StudyResult(
        number="7.2",
        claim="With the slider free P reaches any point on or within the outer boundaries of the family of coupler curves.",
        assignment="The values of U are lost: 0.6 to 1.4 are our choice; the crank turns fully from 0.5 to 1.5.",
        columns=padded(columns),
        verdicts=(
            near("closed coupler curves, of those of the family", text("7.0, L5234"), len(FAMILY), closed, 0),
            near(
                "share of the area within the outer boundary that P reaches",
                text("7.0, L5242"),
                1.0,
                area.area / surrounded,
                0.01,
                why="what all curves of the family go round is out of reach",
            ),
            near(
                "farthest of an isochronous curve from its circle about B", text("7.0, L5260"), 0.0, spread, 1e-12, "l3"
            ),
            at_most("accessible area, relative error", OURS, 1e-4, area.error / area.area),
            at_most("farthest of 5000 random configurations outside of it", OURS, 2e-3, farthest, "l3"),
        ),
    )


def _area(ring: FloatArray) -> float:
    """Return the area within a closed line."""
    z = ring @ np.array([1.0, 1j])
    return abs(0.5 * float((z.conj() * np.roll(z, -1)).imag.sum()))


def draw_family(result: StudyResult) -> Figure:
    """Draw coupler curves with marks every 30 degrees, isochronous curves dotted, and the accessible area shaded."""
    c = result.columns
    every = slice(None, None, 60)
    curves = [curve_of(result, f"U = {u:g}", f"U = {u:g}", colour=colour) for u, colour in zip(FAMILY, COLOURS)]
    for u, colour in zip(FAMILY, COLOURS):
        x, y = c[f"U = {u:g} x [l3]"][: TURN.size][every], c[f"U = {u:g} y [l3]"][: TURN.size][every]
        curves.append(Curve(x=x, y=y, line="", marker=".", colour=colour))
    for angle in ISOCHRONES:
        label = "isochronous" if angle == 0 else ""
        curves.append(curve_of(result, f"th2 = {angle} deg", label, colour=TARGET, line=":", width=1.0))
    names = [name.removesuffix(" x [l3]") for name in c if name.startswith("boundary") and name.endswith("x [l3]")]
    rings = [np.column_stack([c[f"{name} {axis} [l3]"] for axis in "xy"]) for name in names]
    filled = [[ring[np.isfinite(ring[:, 0])] for ring in rings]]
    return plot_curves([plane(curves, filled=filled)], title=result.heading, size=(6.6, 4.4))


def curve_wanted() -> StudyResult:
    """Compute Fig 7.4: the desired curve, and whether P can reach it."""
    z = desired()
    reached = accessible(LINKAGE.to_five_bar(), (FAMILY[0] - 1.0 - 1e-9, FAMILY[-1] - 1.0 + 1e-9), z.real, z.imag)
    columns = {"crank rotation [deg]": np.degrees(ROTATION), **xy("desired", z)}
    for u in (FAMILY[0], FAMILY[-1]):
        columns |= xy(f"U = {u:g}", point(TURN, u - 1.0))
    why = "the figure is lost, and no number of it is in the text"
    return StudyResult(
        number="7.4",
        claim="The desired curve is given by numbers, depends on time, and lies within the family of Fig 7.2.",
        assignment=(
            "The curve is lost. Ours: where P is at U = 0.8 + 0.4 |sin th2| with the crank 0.05 sin th2 rad ahead, at 72 "
            "crank angles; p1 p2 from 150 to 210 deg. All that is judged of series 1 is judged with it."
        ),
        columns=padded(columns),
        verdicts=(
            unjudged("the desired points", text("7.3.1, L5567"), why),
            near("desired points that P does not reach", OURS, 0, z.size - int(reached.sum()), 0),
        ),
    )


def draw_wanted(result: StudyResult) -> Figure:
    """Draw the desired points between the outer curves of the family."""
    z = desired()
    marks = {"p1": int(np.argmax(WITHIN)), "p2": int(np.nonzero(WITHIN)[0][-1])}
    curves = [
        curve_of(result, f"U = {u:g}", f"U = {u:g}", colour=colour, width=0.9)
        for u, colour in zip((FAMILY[0], FAMILY[-1]), (COLOURS[0], COLOURS[4]))
    ]
    curves.append(curve_of(result, "desired", "desired", colour=TARGET, line="", marker="."))
    for (name, k), marker in zip(marks.items(), "os"):
        curves.append(Curve(x=[z[k].real], y=[z[k].imag], label=name, line="", marker=marker, colour=COLOURS[1]))
    return plot_curves([plane(curves)], title=result.heading, size=(6.6, 4.4))


def two_positions() -> StudyResult:
    """Compute Fig 7.5: both positions of the rocker at a crank angle, and eqs (7.14), (7.15) against the library."""
    found, (u, upright) = variational(), by_equations(ROTATION, desired())
    missed = np.abs(u - 1.0 - found.u[:, None]).min(axis=1)
    k = 60
    pin = LINKAGE.crank_length * np.exp(1j * ROTATION[k])
    joint = pin + LINKAGE.coupler_length * np.exp(1j * np.angle(desired()[k] - pin))
    columns = {"crank rotation [deg]": np.degrees(ROTATION), "U [l3]": found.u + 1.0}
    columns |= xy("links", np.array([0.0, pin, joint])) | xy("desired", desired()[[k]])
    for name, end in zip(("U1", "U2"), u[k]):
        columns |= xy(name, np.array([joint, end + 0j]))
    rocker = np.abs(joint - u[k]) / LINKAGE.rocker_length
    standing = np.sin(found.rocker_angle[upright])
    targets = np.random.default_rng(75).uniform(-1.0, 1.0, (ROTATION.size, 2))
    anywhere = variational_motion(LINKAGE, ROTATION, targets, assemblies=(1, -1), closed=False)
    of_random = np.sin(anywhere.rocker_angle[anywhere.kind == "perpendicular"])
    return StudyResult(
        number="7.5",
        claim="The coupler points at the desired point, the rocker in either of two positions; else the rocker is upright.",
        assignment=f"{SERIES_1} The crank stands at {degrees(ROTATION[k]):.0f} deg.",
        columns=padded(columns),
        verdicts=(
            near(
                "length of the rocker in either position, the coupler in line with the point",
                text("7.3.1, L5656"),
                1.0,
                rocker[np.argmax(np.abs(rocker - 1.0))],
                1e-12,
                "l4",
            ),
            near(
                "U by (7.14) and (7.15): greatest difference from the variational motion",
                text("7.3.1, L5641"),
                0.0,
                missed.max(),
                1e-9,
                "l3",
            ),
            near(
                "upright rockers, of those where (7.14) has no root",
                text("7.3.1, L5687"),
                1.0,
                (standing > 0.999).mean(),
                0.0,
            ),
            near(
                "the same of random desired points",
                text("7.3.1, L5687"),
                1.0,
                (of_random > 0.999).mean(),
                0.0,
                why="it may also hang, th4 = -90 deg",
            ),
            at_least("upright or hanging, of random desired points", OURS, 0.999, np.abs(of_random).min()),
        ),
    )


def draw_positions(result: StudyResult) -> Figure:
    """Draw crank and coupler, both rockers, the desired point, and the slider's line."""
    reach = [result.columns[f"{name} x [l3]"][1] for name in ("U1", "U2")]
    curves = [
        Curve(x=[min(0.0, *reach) - 0.1, max(reach) + 0.1], y=[0.0, 0.0], colour="0.6", line=":"),
        curve_of(result, "links", "crank and coupler", colour="0.25", marker="o"),
        curve_of(result, "U1", "rocker at U1", colour=COLOURS[0], marker="o"),
        curve_of(result, "U2", "rocker at U2", colour=COLOURS[1], marker="o", line="--"),
        curve_of(result, "desired", "desired point", colour=COLOURS[2], marker="s", line=""),
    ]
    return plot_curves([plane(curves)], title=result.heading, size=(6.6, 3.6))


# Motions (a) and (b), unweighted (Fig 7.6 to 7.8) and with p1 p2 weighted (Fig 7.9, 7.10)

MOTIONS = {"variational": "(a) variational", "direct": "(b) eleven terms", "weighted": "eleven terms, p1 p2 weighted"}


@cache
def columns_of_motions() -> dict[str, FloatArray]:
    """Return U, error and path of each motion, and the desired points."""
    fine = variational(720)
    u = {"variational": np.append(fine.u, fine.u[0])}
    errors = {"variational": variational().error}
    for name, found in (("direct", direct()), ("weighted", direct(inside=WEIGHT))):
        u[name], errors[name] = slider(found.linkage).series(TURN), found.evaluation.errors
    columns = {"rotation [deg]": np.degrees(TURN), "points' rotation [deg]": np.degrees(ROTATION)}
    for name in u:
        columns |= {
            f"U {name} [l3]": u[name] + 1.0,
            f"error {name} [l3]": errors[name],
            **xy(name, point(TURN, u[name])),
        }
    return padded(columns | xy("desired", desired()))


def motion_verdicts() -> tuple[Verdict, ...]:
    """Judge Fig 7.6."""
    least, found = variational().squared_error, direct()
    fine = np.append(variational(720).u, variational(720).u[:2])
    corners = np.abs(np.diff(fine, 2)).max() / (2.0 * pi / 720) ** 2
    smooth = np.abs(slider(found.linkage).series.derivative().derivative()(TURN)).max()
    ends = ends_of_simplex()
    distinct = 1 + int((np.diff(np.sort(ends)) > 0.01 * min(ends)).sum())
    positions = np.linspace(-0.9, 0.9, 3601)
    brute = sum(
        float(np.nanmin(np.abs(point(np.full(3601, phi), positions) - z))) ** 2 for phi, z in zip(ROTATION, desired())
    )
    place = "7.3.1, L5743"
    effort = "the effort of neither method is stated, and in this mechanism the equations are solved in closed form"
    return (
        near("least error over all slider positions, of that of (a)", text("7.3.1, L5764"), 1.0, brute / least, 1e-3),
        at_least("error of (b), of that of (a)", text("7.3.1, L5766"), 1.0, found.error / least),
        near("error of 41 terms, of that of (a)", text("7.3.1, L5768"), 1.0, direct(20).error / least, 0.01),
        at_least("optima of the simplex from six random starts", text(place), 2, distinct),
        near("least of these, of that of exact derivatives from any start", OURS, 1.0, min(ends) / found.error, 1e-3),
        at_least(
            "greatest second derivative of U over th2 in (a), of that in (b)",
            text("7.3.1, L5791"),
            1.0,
            corners / smooth,
        ),
        unjudged("the variational method takes far more effort in many cases", text("7.3.1, L5885"), effort),
    )


def error_verdicts() -> tuple[Verdict, ...]:
    """Judge Fig 7.7."""
    excess = float((variational().error - direct().evaluation.errors).max())
    return (at_most("greatest excess of the error of (a) over that of (b)", text("7.3.1, L5764"), 1e-9, excess, "l3"),)


def path_verdicts() -> tuple[Verdict, ...]:
    """Judge Fig 7.8."""
    held = min(float((np.abs(point(ROTATION, u) - desired()) ** 2).sum()) for u in np.linspace(-0.49, 0.49, 197))
    place = "7.0, L5252"
    return tuple(
        at_most(f"squared error of {name}, of that of the best fixed U", text(place), 1.0, error / held)
        for name, error in (("(a)", variational().squared_error), ("(b)", direct().error))
    )


def weighted_verdicts() -> tuple[Verdict, ...]:
    """Judge Fig 7.9: with little weight outside p1 p2, a smoother motion is as accurate on p1 p2."""
    smooth = 1.0
    strict, _ = squared_errors(direct(inside=WEIGHT, acceleration=smooth))
    relaxed, _ = squared_errors(direct(inside=WEIGHT, outside=0.01, acceleration=smooth))
    return (
        at_most(
            "error on p1 p2 with the rest weighted 0.01, of that with 1; second derivative of U at most 1",
            text("7.3.1, L5839"),
            1.0,
            relaxed / strict,
        ),
    )


def weighted_path_verdicts() -> tuple[Verdict, ...]:
    """Judge Fig 7.10."""
    inside, outside = (new / old for new, old in zip(squared_errors(direct(inside=WEIGHT)), squared_errors(direct())))
    return (
        at_most("squared error on p1 p2, of that unweighted", text("7.3.1, L5834"), 1.0, inside),
        at_least("squared error on the rest, of that unweighted", text("7.3.1, L5834"), 1.0, outside),
    )


def draw_motions(result: StudyResult, names: tuple[str, ...], what: str) -> Figure:
    """Draw U or the error over the crank's rotation, or the paths."""
    c = result.columns
    look = {name: {"label": MOTIONS[name], "colour": colour} for name, colour in zip(MOTIONS, COLOURS)}
    if what == "paths":
        target = curve_of(result, "desired", "desired", colour=TARGET, line="", marker=".")
        curves = [target, *(curve_of(result, name, **look[name]) for name in names)]
        ends = np.nonzero(WITHIN)[0][[0, -1]]
        z = desired()[ends]
        curves.append(Curve(x=z.real, y=z.imag, label="p1 and p2", line="", marker="s", colour=COLOURS[3]))
        return plot_curves([plane(curves)], title=result.heading, size=(6.6, 4.2))
    x = c["rotation [deg]" if what == "U" else "points' rotation [deg]"]
    panel = Panel(
        x_label="crank rotation [deg]",
        y_label="U / l3" if what == "U" else "distance from the desired point / l3",
        curves=[Curve(x=x, y=c[f"{what} {name} [l3]"], **look[name]) for name in names],  # type: ignore[arg-type]
        verticals={"p1": degrees(P1), "p2": degrees(P2)},
        x_ticks=range(0, 361, 60),
        legend_at="outside",
    )
    return plot_curves([panel], title=result.heading, size=(7.6, 3.4))


class Motions(NamedTuple):
    """Figure of the motions: its claim, the motions and the quantity that it shows, and its verdicts."""

    claim: str
    names: tuple[str, ...]
    what: str
    verdicts: Callable[[], tuple[Verdict, ...]]


TABLE = {
    "7.6": Motions(
        "The variational motion is the nearest that U can come; eleven terms come near it and can be followed at speed.",
        ("variational", "direct"),
        "U",
        motion_verdicts,
    ),
    "7.7": Motions("The error of the variational motion is least.", ("variational", "direct"), "error", error_verdicts),
    "7.8": Motions(
        "Both motions bring P nearer to the desired curve than a fixed U.",
        ("variational", "direct"),
        "paths",
        path_verdicts,
    ),
    "7.9": Motions(
        "With p1 p2 weighted five times the slider moves otherwise.", ("direct", "weighted"), "U", weighted_verdicts
    ),
    "7.10": Motions(
        "The weighted part p1 p2 is traced more closely, the rest less so.",
        ("direct", "weighted"),
        "paths",
        weighted_path_verdicts,
    ),
}


def compute(number: str) -> StudyResult:
    """Compute the motions of a figure."""
    row = TABLE[number]
    return StudyResult(
        number=number, claim=row.claim, assignment=SERIES_1, columns=columns_of_motions(), verdicts=row.verdicts()
    )


#: The studies by number.
STUDIES = {
    "7.2": Study("7.2", family, draw_family),
    "7.4": Study("7.4", curve_wanted, draw_wanted),
    "7.5": Study("7.5", two_positions, draw_positions),
} | {
    number: Study(number, partial(compute, number), partial(draw_motions, names=row.names, what=row.what))
    for number, row in TABLE.items()
}
