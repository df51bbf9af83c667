"""The stability of a mechanism over two parameters, whole: grid, traced boundaries, removing damping, long runs.

`stability_chart` puts together what `grids`, `boundaries` and `stability` compute, for one mechanism and two parameters by
their FMI names, the crank speed among them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.parameters import FiveBarParameters, field_name
from linkwork.five_bar.published import RAD_S_PER_RPM

from . import io
from .boundaries import Boundary, Box, Test, chart
from .branches import told, unit_of
from .grids import Grid, grid
from .planes import plane
from .resonance import natural_frequency
from .stability import (
    Confirmation,
    Monodromy,
    RemovalError,
    confirm,
    crossing,
    linear_monodromy,
    orbit_monodromy,
    removing_damping,
    telling_points,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Crank speeds of a chart where none are given, relative to the natural frequency; others, relative to the value there is.
_SPEEDS, _OTHERS = (0.3, 2.5), (0.1, 2.0)
#: Lines of a chart on which boundaries are sought, of either kind, and samples on each.
LINES, SAMPLES = (2, 5), 120
DAMPING = "slider.damping"


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
    boundary : Boundary
    motion : str
        ``true orbit`` or ``linear equation``.
    multiplier : int
        Floquet multiplier on it: -1 or +1.
    """

    boundary: Boundary
    motion: str
    multiplier: int


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
    problems : tuple of str
        What could not be computed, a sentence each; empty where everything was.
    """

    axes: tuple[Axis, Axis]
    box: Box
    grid: Grid
    boundaries: tuple[Traced, ...]
    removals: tuple[str, ...]
    runs: tuple[Run, ...]
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
        return io.write_csv(path, columns)

    def boundaries_to_csv(self, path: str | Path) -> Path:
        """Write the boundaries as a table, a row a point, numbered in the first column."""
        rows = [np.empty((0, 5))]
        for number, traced in enumerate(self.boundaries, start=1):
            points = traced.boundary.points * [axis.factor for axis in self.axes]
            head = [number, float(traced.motion == "true orbit"), traced.multiplier]
            rows.append(np.column_stack([np.tile(head, (len(points), 1)), points]))
        names = ("boundary", "true orbit (1) or linear equation (0)", "multiplier [1]", *(a.label for a in self.axes))
        return io.write_csv(path, dict(zip(names, np.concatenate(rows).T)))

    def plot(self, *, title: str = "") -> Figure:
        """The largest multiplier in colours, the boundaries, and the points of the long runs."""
        from .figures import COLOURS, Curve, HeatMap, Panel, plot_charts

        x, y = self.axes
        looks = {
            ("true orbit", -1): ("0.1", "-", "period doubling"),
            ("true orbit", 1): (COLOURS[3], "-", "fold"),
            ("linear equation", -1): (COLOURS[2], "--", "linear equation, -1"),
            ("linear equation", 1): (COLOURS[4], "--", "linear equation, +1"),
        }
        curves, named = [], set()
        for traced in self.boundaries:
            colour, line, label = looks[traced.motion, traced.multiplier]
            points = traced.boundary.points
            curves.append(
                Curve(
                    x=x.factor * points[:, 0],
                    y=y.factor * points[:, 1],
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
    speed: float,
    names: tuple[str, str] = ("drive.speed", DAMPING),
    ranges: tuple[tuple[float, float], tuple[float, float]] | None = None,
    *,
    points: int = 80,
    n_jobs: int | None = None,
    progress: bool = False,
) -> StabilityChart:
    """Chart the stability of the periodic motion of one turn over two parameters.

    Parameters
    ----------
    parameters : FiveBarParameters
    speed : float
        Crank speed (rad/s) where it is no axis.
    names : (str, str)
        FMI names of the parameters along x and y; ``drive.speed`` is the crank speed.
    ranges : ((float, float), (float, float)), optional
        Their ranges in SI; see `default_range`.
    points : int
        Of the grid, along each axis.
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
    spans = ranges or (default_range(parameters, speed, names[0]), default_range(parameters, speed, names[1]))
    box = Box(x=spans[0], y=spans[1])
    operation = plane(parameters, speed, *names)
    found = grid(operation, np.linspace(*box.x, points), np.linspace(*box.y, points), n_jobs=n_jobs, progress=progress)
    problems = _missing(found, axes)
    traced: list[Traced] = []
    linear = parameters.slider_coulomb_friction == 0.0 and "slider.coulomb_friction" not in names
    matrices = {"true orbit": orbit_monodromy(operation)}
    if linear:
        matrices["linear equation"] = linear_monodromy(operation)
    for motion, matrix in matrices.items():
        for multiplier in (-1, 1):
            result = chart(crossing(matrix, multiplier), box, lines=LINES, samples=SAMPLES)
            traced += [Traced(boundary=b, motion=motion, multiplier=multiplier) for b in result.boundaries]
            if result.gaps:
                first = result.gaps[0]
                problems.append(
                    f"{motion}, multiplier {multiplier:+d}: no value at {len(result.gaps)} points of the lines searched, the "
                    f"first at {_place(axes, *first.point)}: {first.message}"
                )
    runs = []
    for row, column in telling_points(found):
        x, y = float(found.x[column]), float(found.y[row])
        mechanism, own_speed = operation(x, y)
        try:
            check = confirm(mechanism, own_speed, start=found.starts[row, column])
        except LinkworkError as error:
            problems.append(f"no long run at {_place(axes, x, y)}: {error}")
        else:
            runs.append(Run(x=x, y=y, confirmation=check))
    return StabilityChart(
        axes=axes,
        box=box,
        grid=found,
        boundaries=tuple(traced),
        removals=_removals(matrices["true orbit"], box, names),
        runs=tuple(runs),
        problems=tuple(problems),
    )


def default_range(parameters: FiveBarParameters, speed: float, name: str) -> tuple[float, float]:
    """Range of an axis where none is given: speeds about the natural frequency, others about the value there is.

    Raises
    ------
    InputError
        If there is neither.
    """
    unit_of(name)
    if name == "drive.speed":
        natural = natural_frequency(parameters) if parameters.slider_stiffness > 0.0 else speed
        return (_SPEEDS[0] * natural, _SPEEDS[1] * natural)
    value = float(getattr(parameters, field_name(name), 0.0))
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


def _removals(matrix: Monodromy, box: Box, names: tuple[str, str]) -> tuple[str, ...]:
    """The damping that removes the regions, where damping is one of the axes."""
    if DAMPING not in names:
        return ()
    other = 1 - names.index(DAMPING)
    x, damping = (box.x, box.y) if other == 0 else (box.y, box.x)
    told_ones = []
    for multiplier, kind in ((-1, "period doubling"), (1, "fold")):
        test = crossing(matrix, multiplier)

        def turned(s: float, d: float, test: Test = test) -> float:
            return test(s, d) if other == 0 else test(d, s)

        try:
            found = removing_damping(turned, x, damping)
        except RemovalError as error:
            told_ones.append(f"{kind}: {error}")
        except LinkworkError as error:
            told_ones.append(f"{kind}: the removing damping is not found: {error}")
        else:
            last = told(names[other], found.x, unit_of(names[other]))
            told_ones.append(
                f"{kind}: no region is left from {DAMPING} = {found.damping:.8g} {unit_of(DAMPING)} on; the last goes at {last}"
            )
    return tuple(told_ones)
