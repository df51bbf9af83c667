"""Compute stability charts: the stability of a mechanism over two parameters.

`stability_chart` computes, for one mechanism and two parameters given by their FMI names (the crank speed can be one of them),
a grid of Floquet multipliers, the stability boundaries, the damping that removes each region of instability, and long runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Sized
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError, ParameterError
from linkwork.mechanism import Mechanism

from ...display import NotebookResult, format_count, format_range
from ...files import Whole, write_csv
from ...mechanisms import Parameters, find_mechanism
from ...numerics.boundaries import Box, chart, trace
from ...numerics.continuation import ContinuationError, End, Reason
from ...run import show_progress, takes_published
from ...units import Amount, display_scale, pair
from ..motion import TOLERANCE, Crossing, Drive, PeriodicOrbit, Plane, published_drive, require_drive, variables
from ..response import distance, natural_frequency, oscillating_freedoms
from ..response.branch import motion_sizes
from ..stability import Confirmation, SpecialPoint, confirm
from .boundary import (
    BRANCH_POINTS,
    Monodromy,
    follow_crossing,
    line_branches,
    orbit_monodromy,
    plane_test,
    removing_damping,
)
from .coexistence import Coexistence, coexistence
from .grid import Grid, grid, points_to_confirm

#: Default range of a crank speed relative to the natural frequency, and of another parameter relative to its present value.
_SPEEDS, _OTHERS = (0.3, 2.5), (0.1, 2.0)
#: Numbers of lines x = const and y = const of a chart on which boundaries are sought; number of samples on each line.
LINES, SAMPLES = (2, 5), 120
#: Extent, relative to the chart's ranges, below which a boundary that could not be followed to its end is not drawn.
STUB = 1e-3
#: Distance of two starts, relative to the scale of y or to the size of small motions, below which neighbours on a grid belong
#: to one motion.
SAME_MOTION = 0.4
#: Distance, with the box scaled to 1 by 1, at which a point lies on a boundary.
SAME = 5e-3
#: Names for boundaries of the grid's motion and of other motions.
TRUE_ORBIT, OTHER_ORBIT = "true orbit", "another motion"
#: Codes in files for a boundary's motion (0: the linear equation).
_MOTION = {TRUE_ORBIT: 1.0, OTHER_ORBIT: 2.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """An axis of a chart as it is printed and drawn: in the units of the tables, such as rpm and mm.

    Attributes
    ----------
    name : str
        FMI name.
    unit : str
        Unit for printing and drawing.
    factor : float
        Factor from SI to ``unit``.
    si : str
        SI unit.
    """

    name: str
    unit: str
    factor: float
    si: str

    @property
    def label(self) -> str:
        """Name of the parameter with its unit."""
        return f"{self.name} [{self.unit}]"

    @property
    def column(self) -> tuple[str, float]:
        """Name with unit, and factor from SI, in a CSV file: speeds in rpm, all other quantities in SI."""
        return (self.label, self.factor) if self.si == "rad/s" else (f"{self.name} [{self.si}]", 1.0)

    def format_value(self, value: float) -> str:
        """Return a value, given in SI, as text with the parameter's name and unit."""
        return variables.format_value(self.name, value, self.si)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TracedBoundary:
    """A boundary of instability.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Values of the two parameters along the boundary, in SI.
    motion : str
        The motion that loses stability: `TRUE_ORBIT`, the motion of the grid; `OTHER_ORBIT`, another motion; or the name of a
        motion in the argument ``beside`` of `stability_chart`.
    kind : Crossing
        Period doubling (multiplier -1); fold (+1), beyond which the orbit does not exist; branch point (+1), beyond which it
        exists; or torus (a complex pair on the unit circle).
    ends : (End, End)
        Why the curve ends at its first and at its last point.
    starts : ndarray, shape (n, m), or None
        State y at crank angle 0 of the motion at each point; None if the boundary was traced by a test function alone.
    """

    points: NDArray[np.float64]
    motion: str
    kind: Crossing
    ends: tuple[End, End]
    starts: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """A long nonlinear run at a point (x, y) of a chart, in SI."""

    x: float
    y: float
    confirmation: Confirmation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StabilityChart(NotebookResult):
    """The stability of the periodic motion of one turn over two parameters.

    Attributes
    ----------
    axes : (Axis, Axis)
    box : Box
        Ranges of the two parameters, in SI.
    grid : Grid
        Largest Floquet multiplier of the mechanism's own orbit, called the true orbit, at each point.
    boundaries : tuple of TracedBoundary
        Boundaries of the true orbit, of other motions, and of the motions that `stability_chart` was given in its argument
        ``beside``.
    removals : tuple of str
        One sentence for each region of instability: the damping that removes it. Empty unless one of the axes is the damping.
    runs : tuple of Run
        Long runs at up to three points.
    most : int
        Greatest number of stable motions found at one point of the searched lines or of the grid of ``beside``.
    beside : Coexistence or None
        All motions at every point of the grid; None unless `stability_chart` was called with ``coexisting``.
    problems : tuple of str
        One sentence for each part that could not be computed; empty if there is none.
    """

    axes: tuple[Axis, Axis]
    box: Box
    grid: Grid
    boundaries: tuple[TracedBoundary, ...]
    removals: tuple[str, ...]
    runs: tuple[Run, ...]
    most: int
    beside: Coexistence | None
    problems: tuple[str, ...]

    def __repr__(self) -> str:
        spans = [
            f"{axis.name} {format_range((axis.factor * low, axis.factor * high), axis.unit)}"
            for axis, (low, high) in zip(self.axes, (self.box.x, self.box.y))
        ]
        multipliers = self.grid.largest.compressed()
        share = f", {np.mean(multipliers > 1.0 + TOLERANCE):.1%} unstable" if len(multipliers) else ""
        if any(traced.kind is Crossing.FOLD and traced.motion == TRUE_ORBIT for traced in self.boundaries):
            share += " but with jumps at a fold"
        return (
            f"<StabilityChart: {' by '.join(spans)}, {len(self.grid.x)} x {len(self.grid.y)} points{share}, largest Floquet "
            f"multiplier {format_range(multipliers, '')}; {format_count(len(self.boundaries), 'boundary')}, "
            f"{format_count(len(self.problems), 'problem')}>"
        )

    def to_csv(self, path: str | Path) -> Path:
        """Write the grid as a CSV table with one row per point, and return its path."""
        (x, x_factor), (y, y_factor) = (axis.column for axis in self.axes)
        columns = {
            x: x_factor * np.tile(self.grid.x, len(self.grid.y)),
            y: y_factor * np.repeat(self.grid.y, len(self.grid.x)),
            "largest multiplier [1]": self.grid.largest.filled(np.nan).ravel(),
            "status (0: orbit found)": self.grid.status.ravel().astype(float),
        }
        return write_csv(path, columns)

    def boundaries_to_csv(self, path: str | Path) -> Path:
        """Write the boundaries as a CSV table with one row per point; the first column is the boundary's number."""
        rows = [np.empty((0, 5))]
        for number, traced in enumerate(self.boundaries, start=1):
            points = traced.points * [axis.column[1] for axis in self.axes]
            head = [number, _MOTION.get(traced.motion, 0.0), traced.kind.sign]
            rows.append(np.column_stack([np.tile(head, (len(points), 1)), points]))
        names = (
            "boundary",
            "true orbit (1), another motion (2) or linear equation (0)",
            "multiplier (+1; -1; 0: a complex pair)",
            *(axis.column[0] for axis in self.axes),
        )
        return write_csv(path, dict(zip(names, np.concatenate(rows).T)))


@takes_published(drive=published_drive)
def stability_chart(
    parameters: Parameters,
    drive: Drive | None = None,
    names: tuple[str, str] | None = None,
    ranges: tuple[tuple[Amount, Amount], tuple[Amount, Amount]] | None = None,
    *,
    points: int = 80,
    start: ArrayLike | None = None,
    beside: Mapping[str, Callable[[Plane], Monodromy]] | None = None,
    coexisting: bool = False,
    n_jobs: int | None = None,
    progress: bool = False,
    first: Callable[[StabilityChart], None] | None = None,
) -> StabilityChart:
    """Chart the stability of the periodic motion of one turn over two parameters.

    Parameters
    ----------
    parameters : parameters of a mechanism
        Parameters, a published set, or the name of a published set.
    drive : Drive, optional
        Crank speed or torque, and constant forces, except those that are axes of the chart. For a published set the drive may
        be omitted: the set is then driven at its own speed.
    names : (str, str), optional
        FMI names of the parameters along x and y; by default the crank speed and the damping of the first degree of freedom
        other than the crank, for a five-bar ``drive.speed`` and ``slider.damping``.
    ranges : ((float, float), (float, float)), optional
        Ranges of the two parameters, in SI or as text such as "420 rpm"; see `default_range`.
    points : int
        Points of the grid along each axis.
    start : array_like, shape (n,), optional
        Guess of the orbits; required if the crank is driven by a torque: see `find_orbit`.
    beside : mapping, optional
        Further motions whose boundaries are traced, by name, such as `analysis.youssef.linear_motion`. Each is a function that
        takes a plane and returns a function of a point of this plane: the monodromy matrix of the motion.
    coexisting : bool
        Whether to find all motions at every point of the grid; this takes about twenty times as long: see `coexistence`.
    n_jobs, progress
        See `grid`.
    first : callable, optional
        Called with the chart as soon as its grid is computed, for example to show the chart before boundaries and long runs.

    Returns
    -------
    StabilityChart
        ``problems`` names the parts that could not be computed.

    Raises
    ------
    InputError, ParameterError
        If the drive, a name, a range or the number of points is not usable.
    GridInterrupted
        On Ctrl-C; the same call, made again, continues from the rows that were finished.

    Examples
    --------
    >>> from analysis import stability_chart
    >>> chart = stability_chart("rig-2-spring-c", ranges=(("550 rpm", "560 rpm"), ("50 N.s/m", "60 N.s/m")), points=3)
    >>> float(chart.grid.largest.max()) < 1.0, chart.boundaries
    (True, ())
    """
    mechanism = find_mechanism(parameters)
    drive = require_drive(drive)
    names = names or (variables.default_variable(mechanism, drive), damping_name(mechanism))
    for what, given in (("names", names), ("ranges", ranges)):
        if given is not None and (isinstance(given, str) or not isinstance(given, Sized) or len(given) != 2):
            raise ParameterError(what, given, "be two, along x and y")
    points = Whole(least=2)(points, "points")
    spans = tuple(
        default_range(parameters, drive, name)
        if ranges is None
        else pair(ranges[n], variables.parameter_unit(mechanism, name), name)
        for n, name in enumerate(names)
    )
    box = Box(x=spans[0], y=spans[1])
    operation = variables.plane(parameters, drive, *names)
    x, y = (np.linspace(low, high, points) for low, high in spans)
    common: dict[str, Any] = {"start": start, "n_jobs": n_jobs, "progress": progress}
    steps = _steps(coexisting)
    found = grid(operation, x, y, what=next(steps), **common)
    damping = damping_name(mechanism) if mechanism.names("damping") else ""
    survey = _Survey(operation, (_axis(mechanism, names[0]), _axis(mechanism, names[1])), box, found, start, damping)
    around = coexistence(operation, x, y, what=next(steps), **common) if coexisting else None
    survey.note_missing_orbits()
    if first is not None:
        first(survey.result(around))
    return survey.chart({name: of(operation) for name, of in (beside or {}).items()}, around, progress, steps)


def _steps(coexisting: bool) -> Iterator[str]:
    """Yield the text of the progress bar for each step of a chart, such as "step 1 of 4, grid"."""
    names = ["grid", *(["all motions"] if coexisting else []), "boundaries", "branches of other motions", "long runs"]
    yield from (f"step {number} of {len(names)}, {name}" for number, name in enumerate(names, start=1))


@dataclass(slots=True)
class _Survey:
    """State of a chart while it is computed."""

    operation: Plane
    axes: tuple[Axis, Axis]
    box: Box
    grid: Grid
    start: ArrayLike | None
    damping: str
    traced: list[TracedBoundary] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)
    most: int = 0
    #: Lines y = const that were searched.
    lines: list[float] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    def chart(
        self, beside: Mapping[str, Monodromy], around: Coexistence | None, progress: bool, steps: Iterator[str]
    ) -> StabilityChart:
        """Return the complete chart: find the boundaries of all motions, make the long runs, and compute removing dampings.

        ``beside`` has the monodromy matrices of further motions, by name; ``around`` are the coexisting motions, if they were
        sought; ``steps`` gives the texts of the progress bars.
        """
        true = self.matrix()
        # at a fold the true orbit ends, and its test function with it: folds are found on branches
        tests = [(TRUE_ORBIT, true, Crossing.PERIOD_DOUBLING)]
        tests += [(name, m, kind) for name, m in beside.items() for kind in (Crossing.PERIOD_DOUBLING, Crossing.FOLD)]
        with show_progress(progress, float(len(tests)), next(steps)) as show:
            for number, test in enumerate(tests, start=1):
                self.trace(*test)
                show(float(number))
        step = next(steps)
        self.follow_lines(np.linspace(*self.box.y, LINES[1]).tolist(), progress, step)
        if around is not None:
            true_ones = [traced.points for traced in self.traced if traced.motion in _MOTION]
            self.follow_lines(unmet_lines(around, self.lines, true_ones), progress, step)
            self.most = max(self.most, int(around.stable.max()))
        with show_progress(progress, 1.0, next(steps)):
            self.run_three_points()
            removals = self.removals(true)
        return self.result(around, removals)

    def matrix(self) -> Monodromy:
        """Return the monodromy matrix of the grid's motion as a function of a point of the plane."""
        return orbit_monodromy(self.operation, start=self.start, near=self.grid)

    def result(self, around: Coexistence | None, removals: tuple[str, ...] = ()) -> StabilityChart:
        """Return the chart as far as it has been computed; ``around`` are the coexisting motions, if they were sought."""
        return StabilityChart(
            axes=self.axes,
            box=self.box,
            grid=self.grid,
            boundaries=tuple(self.traced),
            removals=removals,
            runs=tuple(self.runs),
            most=self.most,
            beside=around,
            problems=tuple(self.problems),
        )

    def place(self, x: float, y: float) -> str:
        """Format a point of the chart, with names and units."""
        return ", ".join(axis.format_value(value) for axis, value in zip(self.axes, (x, y)))

    def note_missing_orbits(self) -> None:
        """Add a sentence to the problems if no orbit was found at some points of the grid."""
        places: NDArray[np.int64] = np.argwhere(np.ma.getmaskarray(self.grid.largest))
        if len(places):
            row, column = places[0].tolist()
            self.problems.append(
                f"a motion is not found at {len(places)} of {self.grid.largest.size} points (grey), the first at "
                f"{self.place(float(self.grid.x[column]), float(self.grid.y[row]))}: {self.grid.reason(row, column)}"
            )

    def trace(self, motion: str, matrix: Monodromy, kind: Crossing) -> None:
        """Find and trace, by a test function, the boundaries of one kind for a motion given by name and monodromy matrix."""
        found = chart(plane_test(matrix, kind), self.box, lines=LINES, samples=SAMPLES)
        self.traced += [
            TracedBoundary(points=b.points, motion=motion, kind=kind, ends=b.ends) for b in found.boundaries
        ]
        if found.gaps:
            first = found.gaps[0]
            self.problems.append(
                f"{motion}, {kind.value}: no value at {len(found.gaps)} points of the lines searched, the first at "
                f"{self.place(*first.point)}: {first.message}"
            )

    def follow_lines(self, ys: Sequence[float], progress: bool, what: str) -> None:
        """Follow the branches of all motions on the lines y = const; follow a boundary from each special point of a branch.

        ``what`` is the text of the progress bar.
        """
        lost: list[str] = []
        with show_progress(progress and bool(ys), float(len(ys)), what) as show:
            for number, y in enumerate(ys):
                # the branches count as one half of the progress on a line, the boundaries as the other
                branches, found, failed = line_branches(
                    self.operation,
                    self.box.x,
                    y,
                    name=self.axes[0].name,
                    unit=self.axes[0].si,
                    start=self.start,
                    watch=lambda share, number=number: show(number + 0.5 * share),  # type: ignore[misc]
                )
                self.lines.append(y)
                self.most = max(self.most, int(found.stable.max()))
                lost += [f"{self.axes[1].format_value(y)}, {failure}" for failure in failed]
                specials = [special for branch in branches for special in branch.special]
                for done, special in enumerate(specials, start=1):
                    self._follow_special(special, (special.parameter, y))
                    show(number + 0.5 + 0.5 * done / len(specials))
                show(number + 1.0)
        if lost:
            self.problems.append(f"{len(lost)} motions on the lines searched are not followed, the first at {lost[0]}")

    def _follow_special(self, special: SpecialPoint, place: tuple[float, float]) -> None:
        """Follow the boundary through a special point of a branch, unless this boundary is already known.

        ``place`` has the values of the two parameters at the point.
        """
        if self._is_known(special, place):
            return
        what, box = f"the {special.kind.value} at {self.place(*place)}", self.box
        if special.kind is Crossing.BRANCH_POINT:
            # the equations of such a curve are singular; the grid's motion goes on beyond it, and with it the test function
            if not _belongs(self.grid, special.orbit, place):
                return
            try:
                found = trace(plane_test(self.matrix(), special.kind), place, box)
            except LinkworkError as error:
                self.problems.append(f"{what} is not followed: {error}")
                return
            traced = TracedBoundary(points=found.points, motion=TRUE_ORBIT, kind=special.kind, ends=found.ends)
            self.traced.append(traced)
            return
        try:
            curve = follow_crossing(
                self.operation, special.orbit, special.kind, place, x=box.x, y=box.y, most_points=BRANCH_POINTS
            )
        except ContinuationError as error:
            self.problems.append(f"{what} is not followed: {error}")
            return
        lost = [end for end in curve.ends if end.reason not in (Reason.BOX, Reason.CLOSED)]
        if lost and (np.ptp(curve.points, axis=0) < STUB * np.ptp([box.x, box.y], axis=1)).all():
            self.problems.append(f"{what} is not followed: {lost[0].message}")
            return
        own = np.mean([_belongs(self.grid, orbit, at) for orbit, at in zip(curve.orbits, curve.points.tolist())])
        # of two folds that meet in a cusp the grid's motion ends at only one: a part of the curve that belongs to it is enough;
        # other curves need more than half, as a coarse grid may contain another motion near a jump
        true = own > 0.0 if curve.kind is Crossing.FOLD else own > 0.5
        self.traced.append(
            TracedBoundary(
                points=curve.points,
                motion=TRUE_ORBIT if true else OTHER_ORBIT,
                kind=curve.kind,
                ends=curve.ends,
                starts=np.array([orbit.start for orbit in curve.orbits]),
            )
        )
        self.problems += [f"{what} is followed to {self.place(*end.point)} only: {end.message}" for end in lost]

    def _is_known(self, special: SpecialPoint, place: tuple[float, float]) -> bool:
        """Return whether a traced boundary of the same kind and motion passes through, or close to, a special point."""
        orbit = special.orbit
        scale = orbit.scale * motion_sizes(orbit, orbit.amplitudes)
        for boundary in self.traced:
            if boundary.kind is not special.kind or boundary.motion not in _MOTION:
                continue
            if distance(boundary.points / self.box.size, place / self.box.size) > SAME:
                continue
            if boundary.starts is None:
                same = _belongs(self.grid, orbit, place)
            else:
                near = int(np.linalg.norm((boundary.points - place) / self.box.size, axis=1).argmin())
                same = float(np.linalg.norm((boundary.starts[near] - orbit.start) / scale)) < SAME_MOTION
            if same:
                return True
        return False

    def run_three_points(self) -> None:
        """Run the mechanism at up to three points, chosen by `points_to_confirm`, to confirm the chart."""
        for row, column in points_to_confirm(self.grid):
            x, y = float(self.grid.x[column]), float(self.grid.y[row])
            try:
                check = confirm(*self.operation(x, y), start=self.grid.starts[row, column])
            except LinkworkError as error:
                self.problems.append(f"no long run at {self.place(x, y)}: {error}")
            else:
                self.runs.append(Run(x=x, y=y, confirmation=check))

    def removals(self, matrix: Monodromy) -> tuple[str, ...]:
        """Return a sentence for each region of instability: which damping removes it. Empty if no axis is the damping."""
        names = [axis.name for axis in self.axes]
        if self.damping not in names:
            return ()
        which = names.index(self.damping)
        return tuple(
            self._removal(matrix, boundary, which)
            for boundary in self.traced
            if boundary.motion in _MOTION and boundary.kind is not Crossing.TORUS and len(boundary.points) > 1
        )

    def _removal(self, matrix: Monodromy, boundary: TracedBoundary, which: int) -> str:
        """Return a sentence that tells which damping removes the region within a boundary.

        ``which`` is the index of the axis along which the damping varies; ``matrix`` gives the monodromy matrix at a point.
        """
        other, up = self.axes[1 - which], self.axes[which]
        spans = (self.box.x, self.box.y)
        (left, right), (least, greatest) = spans[1 - which], spans[which]
        across, dampings = boundary.points[:, 1 - which], boundary.points[:, which]
        low, high, top = float(across.min()), float(across.max()), float(dampings.max())
        whose = "" if boundary.motion == TRUE_ORBIT else f" of {boundary.motion}"
        region = f"{boundary.kind.value}{whose} from {other.format_value(low)} to {other.format_value(high)}"
        if top > greatest - 1e-6 * (greatest - least):
            return f"{region}: still there at {up.format_value(greatest)}"
        by_points = (
            f"{region}: gone from about {self.damping} = {top:.4g} {up.si} on, the greatest on its traced boundary"
        )
        if boundary.motion != TRUE_ORBIT:
            return by_points
        # a range of the other parameter that contains this region and no other
        margin = 0.25 * (high - low)
        x = max(left, low - margin), min(right, high + margin)
        test = plane_test(matrix, boundary.kind)
        try:
            found = removing_damping(
                lambda value, damping: test(value, damping) if which == 1 else test(damping, value),
                x,
                (float(dampings.min()), greatest),
            )
        except LinkworkError:
            # the test function ends at folds: use the greatest damping of the traced boundary
            return by_points
        return f"{region}: gone from {self.damping} = {found.damping:.8g} {up.si} on, last at {other.format_value(found.x)}"


def unmet_lines(beside: Coexistence, lines: Sequence[float], boundaries: Sequence[NDArray[np.float64]]) -> list[float]:
    """Return values of y of further lines to search: one through each region that no searched line or known boundary meets.

    A region is a connected set of grid points of ``beside`` with the same number of stable motions. ``lines`` are the values
    of y of the lines that were searched. A region within one cell of one of the ``boundaries``, of shape (n, 2), needs no
    line.
    """
    cell = [np.diff(axis[:2]).sum() for axis in (beside.x, beside.y)]
    found: list[float] = []
    for number in np.unique(beside.stable):
        labels, count = scipy.ndimage.label(beside.stable == number)
        for label in range(1, count + 1):
            rows, columns = np.nonzero(labels == label)
            if any(beside.y[rows.min()] <= y <= beside.y[rows.max()] for y in (*lines, *found)):
                continue
            cells = np.column_stack([beside.x[columns], beside.y[rows]])
            if not any((np.abs(points[:, None] - cells) <= cell).all(axis=2).any() for points in boundaries):
                found.append(float(beside.y[np.bincount(rows).argmax()]))
    return found


def _belongs(found: Grid, orbit: PeriodicOrbit, place: Sequence[float]) -> bool:
    """Return whether an orbit continues the motion that a grid found around ``place``.

    The orbit continues this motion if its start is near the start of the grid's orbit at one of the grid points around
    ``place``.
    """
    scale = orbit.scale * motion_sizes(orbit, orbit.amplitudes)
    distance = np.linalg.norm((found.nearby_starts(*place) - orbit.start) / scale, axis=1)
    return bool(np.any(distance < SAME_MOTION))


@takes_published()
def default_range(parameters: Parameters, drive: Drive, name: str) -> tuple[float, float]:
    """Return the default range of the parameter ``name`` on an axis of a chart, in SI.

    The range of a crank speed lies around the natural frequency, if `natural_frequency` can compute it. Any other range lies
    around the present value.

    Raises
    ------
    InputError
        If the present value is not above zero, or the parameter cannot vary in this drive.
    """
    variables.require_variable(parameters, drive, name)
    if name in variables.speed_names(find_mechanism(parameters)):
        with suppress(AssemblyError, ParameterError):
            natural = natural_frequency(parameters)
            return (_SPEEDS[0] * natural, _SPEEDS[1] * natural)
    value = variables.parameter_value(parameters, drive, name)
    if value <= 0.0:
        raise InputError(f"{name} is {value:g} here: give the range of the axis")
    return (_OTHERS[0] * value, _OTHERS[1] * value)


def damping_name(mechanism: Mechanism) -> str:
    """Return the FMI name of the damping that is an axis of a chart by default.

    It is the damping of the first degree of freedom other than the crank; if this has no damping, another damping.

    Raises
    ------
    InputError
        If the mechanism has no damping.
    """
    first = [mechanism.freedoms[number].coordinate for number in oscillating_freedoms(mechanism)[:1]]
    own = [name for coordinate in first for name in mechanism.names("damping", coordinate)]
    for name in (*own, *mechanism.names("damping")):
        return name
    raise InputError(f"a {mechanism.name} has no damping: name both parameters of the chart")


def _axis(mechanism: Mechanism, name: str) -> Axis:
    si = variables.parameter_unit(mechanism, name)
    unit, factor = display_scale(si)
    return Axis(name=name, unit=unit, factor=factor, si=si)
