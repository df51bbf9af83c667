"""The stability of a mechanism over two parameters, whole: grid, traced boundaries, removing damping, long runs.

`stability_chart` puts together what `grids`, `boundaries` and `stability` compute, for one mechanism and two parameters by
their FMI names, the crank speed among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import RAD_S_PER_RPM
from linkwork.parameters import field_name

from ..files import write_csv
from ..numerics.boundaries import Box, Test, chart
from ..numerics.continuation import ContinuationError
from ..run import shown
from .branches import OF_THE_DRIVE, Family, SpecialPoint, follow, told, unit_of
from .crossings import COMPLETE, follow_crossing
from .floquet import Crossing
from .grids import Grid, grid
from .orbits import Drive, OrbitError, PeriodicOrbit, orbit_of, scale_of
from .planes import Plane, plane, require_axis
from .resonance import natural_frequency
from .stability import (
    Confirmation,
    Monodromy,
    confirm,
    linear_monodromy,
    orbit_monodromy,
    removing_damping,
    telling_points,
    test_of,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Crank speeds of a chart where none are given, relative to the natural frequency; others, relative to the value there is.
_SPEEDS, _OTHERS = (0.3, 2.5), (0.1, 2.0)
#: Lines of a chart on which boundaries are sought, of either kind, and samples on each.
LINES, SAMPLES = (2, 5), 120
#: Points of a branch at most on which folds are sought.
BRANCH_POINTS = 600
#: Distance of two starts, relative to crank length and speed, up to which neighbours on a grid are of one motion.
SAME_MOTION = 0.4
#: Distance, with the box scaled to 1 by 1, at which a point lies on a boundary.
SAME = 5e-3
DAMPING = "slider.damping"
#: Multiplier on a boundary, as it is written to files.
_MULTIPLIER = {Crossing.FOLD: 1.0, Crossing.PERIOD_DOUBLING: -1.0, Crossing.TORUS: 0.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A parameter of a chart as it is shown: speeds in rpm, all else in SI.

    Attributes
    ----------
    name : str
        FMI name.
    unit : str
        That it is shown in.
    factor : float
        From SI to that unit.
    """

    name: str
    unit: str
    factor: float

    @property
    def label(self) -> str:
        """Name with unit."""
        return f"{self.name} [{self.unit}]"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Traced:
    """A boundary of instability.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        In SI.
    motion : str
        ``true orbit`` or ``linear equation``.
    kind : Crossing
        What the multipliers do there: at -1 a period doubling, at +1 a fold, beyond which the orbit is no more; under a torque
        a complex pair may pass the unit circle, at a torus.
    ends : (str, str)
        Why it ends, at the first and at the last point.
    """

    points: NDArray[np.float64]
    motion: str
    kind: Crossing
    ends: tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """A long nonlinear run at a point (x, y) of a chart, in SI."""

    x: float
    y: float
    confirmation: Confirmation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StabilityChart:
    """Where the periodic motion of one turn is unstable.

    Attributes
    ----------
    axes : (Axis, Axis)
    box : Box
        In SI.
    grid : Grid
        Largest Floquet multiplier of the true orbit.
    boundaries : tuple of Traced
        Of the true orbit, and of the linear equation about u = 0 where there is one.
    removals : tuple of str
        The damping that removes the regions between the ends of the other axis, in words; none unless damping is an axis.
    runs : tuple of Run
        Three points put to the test.
    elsewhere : int
        Folds and period doublings met that belong to other motions than the grid's; `follow_crossing` follows them.
    problems : tuple of str
        What could not be computed, a sentence each; empty where everything was.
    """

    axes: tuple[Axis, Axis]
    box: Box
    grid: Grid
    boundaries: tuple[Traced, ...]
    removals: tuple[str, ...]
    runs: tuple[Run, ...]
    elsewhere: int
    problems: tuple[str, ...]

    def to_csv(self, path: str | Path) -> Path:
        """Write the grid as a table, a row a point."""
        x, y = self.axes
        columns = {
            x.label: x.factor * np.tile(self.grid.x, len(self.grid.y)),
            y.label: y.factor * np.repeat(self.grid.y, len(self.grid.x)),
            "largest multiplier [1]": self.grid.largest.filled(np.nan).ravel(),
            "status (0: orbit found)": self.grid.status.ravel().astype(float),
        }
        return write_csv(path, columns)

    def boundaries_to_csv(self, path: str | Path) -> Path:
        """Write the boundaries as a table, a row a point, numbered in the first column."""
        rows = [np.empty((0, 5))]
        for number, traced in enumerate(self.boundaries, start=1):
            points = traced.points * [axis.factor for axis in self.axes]
            head = [number, float(traced.motion == "true orbit"), _MULTIPLIER[traced.kind]]
            rows.append(np.column_stack([np.tile(head, (len(points), 1)), points]))
        names = (
            "boundary",
            "true orbit (1) or linear equation (0)",
            "multiplier (+1; -1; 0: a complex pair)",
            *(a.label for a in self.axes),
        )
        return write_csv(path, dict(zip(names, np.concatenate(rows).T)))

    def plot(self, *, title: str = "") -> Figure:
        """The largest multiplier in colours, the boundaries, and the points of the long runs."""
        from ..figures import COLOURS, Curve, HeatMap, Panel, plot_charts

        x, y = self.axes
        looks = {
            ("true orbit", Crossing.PERIOD_DOUBLING): ("0.1", "-", "period doubling"),
            ("true orbit", Crossing.FOLD): (COLOURS[3], "-", "fold"),
            ("true orbit", Crossing.TORUS): (COLOURS[1], "-", "torus"),
            ("linear equation", Crossing.PERIOD_DOUBLING): (COLOURS[2], "--", "linear equation, multiplier -1"),
            ("linear equation", Crossing.FOLD): (COLOURS[4], "--", "linear equation, multiplier +1"),
        }
        curves, named = [], set()
        for traced in self.boundaries:
            colour, line, label = looks[traced.motion, traced.kind]
            curves.append(
                Curve(
                    x=x.factor * traced.points[:, 0],
                    y=y.factor * traced.points[:, 1],
                    colour=colour,
                    line=line,
                    label="" if label in named else label,
                )
            )
            named.add(label)
        for outcome in dict.fromkeys(run.confirmation.outcome for run in self.runs):
            those = [run for run in self.runs if run.confirmation.outcome is outcome]
            curves.append(
                Curve(
                    x=[x.factor * run.x for run in those],
                    y=[y.factor * run.y for run in those],
                    colour="0.1",
                    line="",
                    marker={"decays": "o", "grows": "x", "stays bounded": "s"}[outcome.value],
                    label=f"long run {outcome.value}",
                )
            )
        low, high = (np.array([self.box.x[i], self.box.y[i]]) * [x.factor, y.factor] for i in (0, 1))
        panel = Panel(
            x_label=x.label,
            y_label=y.label,
            curves=curves,
            legend_at="upper right",
            x_range=(float(low[0]), float(high[0])),
            y_range=(float(low[1]), float(high[1])),
        )
        map_ = HeatMap(
            panel=panel,
            x=x.factor * self.grid.x,
            y=y.factor * self.grid.y,
            values=self.grid.largest,
            label="largest Floquet multiplier",
            missing="no orbit",
        )
        return plot_charts([map_], title=title, size=(7.2, 5.0))


def stability_chart(
    parameters: FiveBarParameters,
    drive: Drive,
    names: tuple[str, str] = ("drive.speed", DAMPING),
    ranges: tuple[tuple[float, float], tuple[float, float]] | None = None,
    *,
    points: int = 80,
    start: ArrayLike | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> StabilityChart:
    """Chart the stability of the periodic motion of one turn over two parameters.

    Parameters
    ----------
    parameters : FiveBarParameters
    drive : Drive
        Speed, or torque, and constant forces, where they are no axes.
    names : (str, str)
        FMI names of the parameters along x and y; ``drive.speed`` is the crank speed.
    ranges : ((float, float), (float, float)), optional
        Their ranges in SI; see `default_range`.
    points : int
        Of the grid, along each axis.
    start : array_like, shape (2,) or (3,), optional
        Guess of the orbits; under a torque it is needed: see `find_orbit`.
    n_jobs : int, optional
        Cores, as `joblib.Parallel`.
    progress : bool
        Show a progress bar.

    Returns
    -------
    StabilityChart
        What could not be computed is in ``problems``.

    Raises
    ------
    InputError
        If a name or a range is not usable.
    GridInterrupted
        On Ctrl-C; the same call goes on from the rows that are kept.
    """
    axes = (_axis(names[0]), _axis(names[1]))
    spans = ranges or (default_range(parameters, drive, names[0]), default_range(parameters, drive, names[1]))
    box = Box(x=spans[0], y=spans[1])
    operation = plane(parameters, drive, *names)
    found = grid(
        operation,
        np.linspace(*box.x, points),
        np.linspace(*box.y, points),
        start=start,
        n_jobs=n_jobs,
        progress=progress,
    )
    problems = _missing(found, axes)
    matrices = {"true orbit": orbit_monodromy(operation, start=start)}
    if drive.speed_drive and parameters.slider_coulomb_friction == 0.0 and "slider.coulomb_friction" not in names:
        matrices["linear equation"] = linear_monodromy(operation)
    traced: list[Traced] = []
    for motion, matrix in matrices.items():
        # where the true orbit folds it ends, and a test function with it: its folds are found on its branches
        for kind in (Crossing.PERIOD_DOUBLING, Crossing.FOLD)[: 1 if motion == "true orbit" else 2]:
            result = chart(test_of(matrix, 1 if kind is Crossing.FOLD else -1), box, lines=LINES, samples=SAMPLES)
            traced += [
                Traced(
                    points=boundary.points,
                    motion=motion,
                    kind=kind,
                    ends=(boundary.ends[0].reason.value, boundary.ends[1].reason.value),
                )
                for boundary in result.boundaries
            ]
            if result.gaps:
                first = result.gaps[0]
                problems.append(
                    f"{motion}, {kind.value}: no value at {len(result.gaps)} points of the lines searched, the first at "
                    f"{_place(axes, *first.point)}: {first.message}"
                )
    elsewhere = _add_crossings(operation, found, box, axes, start, traced, problems, progress)
    runs = []
    for row, column in telling_points(found):
        x, y = float(found.x[column]), float(found.y[row])
        try:
            check = confirm(*operation(x, y), start=found.starts[row, column])
        except LinkworkError as error:
            problems.append(f"no long run at {_place(axes, x, y)}: {error}")
        else:
            runs.append(Run(x=x, y=y, confirmation=check))
    return StabilityChart(
        axes=axes,
        box=box,
        grid=found,
        boundaries=tuple(traced),
        removals=_removals(matrices["true orbit"], box, names, traced),
        runs=tuple(runs),
        elsewhere=elsewhere,
        problems=tuple(problems),
    )


def _add_crossings(
    at: Plane,
    found: Grid,
    box: Box,
    axes: tuple[Axis, Axis],
    guess: ArrayLike | None,
    traced: list[Traced],
    problems: list[str],
    progress: bool,
) -> int:
    """Append the boundaries that the branches along lines y = const lead to, folds above all.

    Those of other motions than the grid's are not traced; returns how many were met.
    """
    lost: list[str] = []
    elsewhere = 0
    with shown(progress, float(LINES[1]), "branches") as show:
        for number, y in enumerate(np.linspace(*box.y, LINES[1]).tolist()):
            for start, direction in ((box.x[0], 1), (box.x[1], -1)):
                mechanism, drive = at(start, y)
                family = Family(
                    parameters=mechanism,
                    drive=drive,
                    vary=partial(_along, at, y),
                    name=axes[0].name,
                    unit=unit_of(axes[0].name),
                )
                try:
                    orbit = orbit_of(mechanism, drive, start=guess)
                    branch = follow(
                        family,
                        orbit,
                        start,
                        low=box.x[0],
                        high=box.x[1],
                        direction=direction,
                        most_points=BRANCH_POINTS,
                    )
                except (OrbitError, ContinuationError) as error:
                    lost.append(f"{_place(axes, start, y)}: {error}")
                    continue
                for special in branch.special:
                    place = (special.parameter, y)
                    if _is_known(place, special.kind, box, traced):
                        continue
                    if _is_of(found, special.orbit, place):
                        _append(at, special, place, box, axes, traced, problems)
                    else:
                        elsewhere += 1
                # the branch that goes through needs not be followed backwards
                if branch.reached and not branch.special:
                    break
            show(number + 1.0)
    if lost:
        problems.append(
            f"no branch to seek folds on from {len(lost)} of {2 * LINES[1]} ends of lines, the first {lost[0]}"
        )
    return elsewhere


def _is_of(found: Grid, orbit: PeriodicOrbit, place: tuple[float, float]) -> bool:
    """Whether an orbit is of the motion whose multipliers a grid has, by the points of the grid around its place."""
    column, row = (int(np.abs(axis - value).argmin()) for axis, value in zip((found.x, found.y), place))
    around = found.starts[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].reshape(-1, len(orbit.start))
    scale = scale_of(orbit.parameters, orbit.drive, orbit.start)
    distance = np.linalg.norm((around - orbit.start) / scale, axis=1)
    return bool(np.any(distance < SAME_MOTION))


def _append(
    at: Plane,
    special: SpecialPoint,
    place: tuple[float, float],
    box: Box,
    axes: tuple[Axis, Axis],
    traced: list[Traced],
    problems: list[str],
) -> None:
    what = f"the {special.kind.value} at {_place(axes, *place)}"
    try:
        curve = follow_crossing(at, special.orbit, special.kind, place, x=box.x, y=box.y)
    except ContinuationError as error:
        problems.append(f"{what} is not followed: {error}")
        return
    traced.append(Traced(points=curve.points, motion="true orbit", kind=curve.kind, ends=curve.ends))
    for end, point in zip(curve.ends, (curve.points[0], curve.points[-1])):
        if end not in COMPLETE:
            problems.append(f"{what} is followed to {_place(axes, *point.tolist())} only: {end}")


def _along(at: Plane, y: float, x: float) -> tuple[FiveBarParameters, Drive]:
    return at(x, y)


def _is_known(place: tuple[float, float], kind: Crossing, box: Box, traced: Sequence[Traced]) -> bool:
    """Whether a boundary of the true orbit that has been traced passes through a point, nearly."""
    for boundary in traced:
        if boundary.kind is kind and boundary.motion == "true orbit" and len(boundary.points) > 1:
            s = (boundary.points - np.array(place)) / box.size
            # distance of the point, now the origin, from each piece
            pieces = np.diff(s, axis=0)
            squares = np.maximum((pieces**2).sum(axis=1), 1e-300)
            along = np.clip(-(s[:-1] * pieces).sum(axis=1) / squares, 0.0, 1.0)
            if float(np.hypot(*(s[:-1] + along[:, None] * pieces).T).min()) < SAME:
                return True
    return False


def default_range(parameters: FiveBarParameters, drive: Drive, name: str) -> tuple[float, float]:
    """Range of an axis where none is given: speeds about the natural frequency, others about the value there is.

    Raises
    ------
    InputError
        If there is no value, or no such axis.
    """
    require_axis(drive, name)
    if name == "drive.speed" and parameters.slider_stiffness > 0.0:
        natural = natural_frequency(parameters)
        return (_SPEEDS[0] * natural, _SPEEDS[1] * natural)
    at_drive = OF_THE_DRIVE.get(name)
    value = float(getattr(drive, at_drive) if at_drive else getattr(parameters, field_name(name)))
    if value <= 0.0:
        raise InputError(f"{name} is {value:g} here: give the range of the axis")
    return (_OTHERS[0] * value, _OTHERS[1] * value)


def _axis(name: str) -> Axis:
    unit = unit_of(name)
    return (
        Axis(name=name, unit="rpm", factor=1.0 / RAD_S_PER_RPM)
        if unit == "rad/s"
        else Axis(name=name, unit=unit, factor=1.0)
    )


def _place(axes: tuple[Axis, Axis], x: float, y: float) -> str:
    return ", ".join(told(axis.name, value, unit_of(axis.name)) for axis, value in zip(axes, (x, y)))


def _missing(found: Grid, axes: tuple[Axis, Axis]) -> list[str]:
    places: NDArray[np.int64] = np.argwhere(np.ma.getmaskarray(found.largest))
    if len(places) == 0:
        return []
    row, column = places[0].tolist()
    return [
        f"no orbit was found at {len(places)} of {found.largest.size} points (grey), the first at "
        f"{_place(axes, float(found.x[column]), float(found.y[row]))}: {found.reason(row, column)}"
    ]


def _removals(matrix: Monodromy, box: Box, names: tuple[str, str], traced: Sequence[Traced]) -> tuple[str, ...]:
    """The damping that removes each region, where damping is one of the axes; a sentence a boundary of the true orbit."""
    if DAMPING not in names:
        return ()
    which = names.index(DAMPING)
    other, damping = (box.x, box.y) if which == 1 else (box.y, box.x)
    name, unit = names[1 - which], unit_of(names[1 - which])
    sentences = []
    for boundary in traced:
        if boundary.motion != "true orbit" or boundary.kind is Crossing.TORUS or len(boundary.points) < 2:
            continue
        across, up = boundary.points[:, 1 - which], boundary.points[:, which]
        span = f"{told(name, float(across.min()), unit)} to {told(name, float(across.max()), unit)}"
        region = f"{boundary.kind.value} from {span}"
        top = float(up.max())
        if top > damping[1] - 1e-6 * (damping[1] - damping[0]):
            sentences.append(f"{region}: still there at {DAMPING} = {damping[1]:.6g} {unit_of(DAMPING)}")
            continue
        # this region and no other
        margin = 0.25 * float(np.ptp(across))
        x = (max(other[0], float(across.min()) - margin), min(other[1], float(across.max()) + margin))
        test = test_of(matrix, 1 if boundary.kind is Crossing.FOLD else -1)
        try:
            found = removing_damping(partial(_turned, test, which), x, (float(up.min()), damping[1]))
        except LinkworkError:
            # the test function ends at folds: what the traced boundary tells stands
            sentences.append(f"{region}: goes up to {DAMPING} = {top:.4g} {unit_of(DAMPING)}, by its points")
        else:
            sentences.append(
                f"{region}: gone from {DAMPING} = {found.damping:.8g} {unit_of(DAMPING)} on, last at "
                f"{told(name, found.x, unit)}"
            )
    return tuple(sentences)


def _turned(test: Test, which: int, other: float, damping: float) -> float:
    return test(other, damping) if which == 1 else test(damping, other)
