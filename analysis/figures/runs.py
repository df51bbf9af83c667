"""Plot runs over time in display units: one run beside a picture of its mechanism, or two runs for comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from linkwork.mechanism import Mechanism
from linkwork.variables import UNITS, Variable

from ..mechanisms import MECHANISMS, find_mechanism, wrapping_outputs
from ..run import Ensemble, Trajectory, require_list
from . import style
from .dispatch import mechanism_drawer, plot

FloatArray: TypeAlias = NDArray[np.float64]

#: Greatest variation of a curve that counts as constant, relative to its largest value or to 1, if that is greater.
_STILL = 1e-9
#: Greatest difference of two runs that counts as rounding, relative to the largest value.
_ROUNDING = 1e-12
#: Inches: width of a panel beside a picture of the mechanism, width without one, and height of a panel.
_BESIDE, _WIDTH, _HEIGHT = 5.3, 6.4, 1.55
#: If a curve has more oscillations than this, a band is drawn instead; greatest number of parts of the band; note about it.
_FAST, _BANDS = 120, 200
BANDS = "Band: range of an oscillation that is too fast to be drawn; its line is the mean."
#: The axis is cut off if the values of all runs span more than this many times the range of 90 % of the runs.
_FAR = 10.0
#: Number of the picture of the mechanism among the numbers of panels.
_DRAWN = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """Content of a panel of a run: name, unit, and curves in that unit by their names in the legend."""

    name: str
    unit: str
    curves: Mapping[str, FloatArray]


@plot.register
@style.figure_style()
def plot_outputs(run: Trajectory, names: Sequence[str] | None = None, *, title: str = "") -> style.Figure:
    """Plot a run: outputs over time, and the mechanism at the start with the paths of its points.

    Lengths are in mm, angles in degrees and speeds in rpm, by the units of the mechanism's table of variables.

    Parameters
    ----------
    run : Trajectory
    names : sequence of str, optional
        Outputs to plot, one panel each, without the mechanism. By default these are plotted: the coordinates except the
        crank's, crank speed, drives, transmission angles and magnitudes of joint forces. Constant ones are stated at the foot.
    title : str
    """
    require_list(names, "names")
    table, drawer = _variables(run), None
    notes: list[str] = []
    if len(run) == 0:
        panels = [_Rows(name="the run has no samples", unit="", curves={})]
    elif names is None:
        panels, notes = _without_constants(_default_rows(run, table))
        drawer = mechanism_drawer(run.parameters)
    else:
        panels = [_output_row(run, table, name) for name in names]
    if run.status:
        notes.append(f"The run ended early: {run.message}.")
    elif run.message:
        notes.append(f"Note: {run.message}.")
    grid = _picture_grid(len(panels)) if drawer else np.arange(len(panels))[:, None]
    width, height = (2 * _BESIDE, 1.15 * _HEIGHT) if drawer else (_WIDTH, _HEIGHT)
    figure = style.Figure(figsize=(width, 1.0 + height * len(grid)))
    cells = figure.add_gridspec(*grid.shape)

    def place(number: int, **options: Any) -> Axes:
        rows, places = np.nonzero(grid == number)
        return figure.add_subplot(cells[rows.min() : rows.max() + 1, places[0]], **options)

    axes: list[Axes] = []
    for number, panel in enumerate(panels):
        axes.append(place(number, sharex=axes[0] if axes else None))
        _draw(axes[-1], run.time, panel)
    for column in grid.T.tolist():
        of_panels = [axes[number] for number in dict.fromkeys(column) if number in range(len(panels))]
        for axis in of_panels[:-1]:
            axis.tick_params(labelbottom=False)
        for axis in of_panels[-1:]:
            axis.set_xlabel("time [s]")
        figure.align_ylabels(of_panels)
    if drawer:
        axis = place(_DRAWN)
        axis.set_title(drawer(run.parameters, axis, run), fontsize=style.SMALL, color=style.MARKED)
    if any(is_fast(values) for panel in panels for values in panel.curves.values()):
        notes.append(BANDS)
    return style.finish(figure, title, notes)


@plot.register
@style.figure_style()
def plot_ensemble(runs: Ensemble, names: Sequence[str] | None = None, *, title: str = "") -> style.Figure:
    """Plot many runs: the median of outputs over time, and the ranges in which 90 % of the runs and all runs are.

    Median and ranges at a time are those of the runs that reach this time; the foot says how many do not reach the end. The
    angle of a link begins, in each run, within half a turn of its angle in the first run.

    Parameters
    ----------
    runs : Ensemble
    names : sequence of str, optional
        Outputs to plot, one panel each; by default the first eight outputs that the ensemble was asked for
        or, if it was asked for none, the coordinates except the first, the crank's.
    title : str
    """
    require_list(names, "names")
    mechanism = find_mechanism(runs.parameters[0])
    if names is None:
        first, *others = mechanism.freedoms
        names = [f.coordinate for f in others or (first,)] if runs.values is None else runs.names[:8]
    known = {v.name: v for v in mechanism.variables}
    missing = int(np.count_nonzero(runs.status))
    notes = [f"{len(runs):,} runs" + (f"; ended early, and left out from there on: {missing:,}." if missing else ".")]
    figure = style.Figure(figsize=(_WIDTH, 1.0 + 1.6 * _HEIGHT * len(names)))
    axes = np.ravel(figure.subplots(len(names), 1, sharex=True))
    for axis, name in zip(axes, names):
        values = np.ma.filled(runs.output(name), np.nan)
        if name in wrapping_outputs():
            for row, count, i in zip(values, runs.counts.tolist(), range(len(runs))):
                row[:count] = runs[i].unwrapped(name)
            values += _whole_turns(values[np.argmax(runs.counts > 0), 0] - values[:, :1])
        unit, factor = display_unit(known[name])
        reached = ~np.isnan(values).all(axis=0)
        least, low, median, high, greatest = factor * np.nanpercentile(
            values[:, reached], (0.0, 5.0, 50.0, 95.0, 100.0), axis=0
        )
        time, shade = runs.time[reached], {"color": style.COLOURS[0], "linewidth": 0.0}
        axis.fill_between(time, least, greatest, alpha=0.15, label="all runs", **shade)
        axis.fill_between(time, low, high, alpha=0.3, label="90 % of the runs", **shade)
        axis.plot(time, median, color=style.COLOURS[0], label="median")
        bottom, top = low.min(initial=np.inf), high.max(initial=-np.inf)
        ends = least.min(initial=np.inf), greatest.max(initial=-np.inf)
        if 0.0 < _FAR * (top - bottom) < ends[1] - ends[0]:
            axis.set_ylim(bottom - (top - bottom), top + (top - bottom))
            notes.append(f"{name} is {ends[0]:.4g} to {ends[1]:.4g} {unit} in all runs, which is cut off.")
        axis.set_ylabel(style.axis_label(name, unit))
    style.legend_above(axes[0])
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels(axes)
    return style.finish(figure, title, notes)


def _picture_grid(count: int) -> NDArray[np.int64]:
    """Return the grid of panel indices in two columns; the picture of the mechanism is at the top of the left one."""
    rows = max(2, ceil((count + 2) / 2))
    right = [min(n, count - 1) for n in range(rows)]
    below = list(range(rows, count))
    left = [_DRAWN] * (rows - len(below)) + below
    return np.array([left, right]).T


def _draw(axis: Axes, time: FloatArray, panel: _Rows) -> None:
    if not panel.curves:
        axis.text(0.5, 0.5, panel.name, transform=axis.transAxes, ha="center", va="center")
        axis.set_axis_off()
        return
    for number, (name, values) in enumerate(panel.curves.items()):
        draw_over_time(axis, time, values, label=name, line=style.LINES[number % len(style.LINES)])
    axis.set_ylabel(style.axis_label(panel.name, panel.unit))
    if any(panel.curves):
        style.legend_above(axis)


def draw_over_time(axis: Axes, time: FloatArray, values: FloatArray, *, label: str = "", line: Any = "-") -> None:
    """Draw a curve over time; if it oscillates too fast to be drawn, draw the band of its values and its mean.

    A curve that varies by rounding only is drawn as constant, and a single sample as a point.
    """
    if not is_fast(values):
        axis.plot(time, _without_rounding(values), line, marker="o" if len(values) == 1 else None, label=label or None)
        return
    parts = np.array_split(np.arange(len(values)), min(_BANDS, _oscillations(values) // 2))
    middle = np.array([time[part].mean() for part in parts])
    ends = np.array([(values[part].min(), values[part].max()) for part in parts])
    # weighted means hardly depend on the phase at which an oscillation is cut off
    means = [np.average(values[part], weights=np.hanning(len(part) + 2)[1:-1]) for part in parts]
    (drawn,) = axis.plot(middle, means, line, label=label or None)
    colour = drawn.get_color()
    # edges tell overlapping bands apart
    axis.fill_between(middle, *ends.T, facecolor=(colour, 0.15), edgecolor=(colour, 0.6), linewidth=style.HAIR)


def is_fast(values: FloatArray) -> bool:
    """Return whether a curve oscillates so often that a panel would show a block of colour."""
    return not _is_constant(values) and _oscillations(values) > _FAST


def _oscillations(values: FloatArray) -> int:
    """Count the oscillations of a curve; an oscillation lower than about a twentieth of the curve's range is ignored."""
    size = float(np.ptp(values)) if len(values) else 0.0
    if not size > 0.0:
        return 0
    steps = np.diff(np.round(20.0 / size * values))
    return int(np.count_nonzero(np.diff(np.sign(steps[steps != 0.0])))) // 2


def _mechanism(run: Trajectory) -> Mechanism:
    """Return the mechanism of a run; if the run has no parameters, the mechanism that shares most outputs with the run."""
    if run.parameters is not None:
        return find_mechanism(run.parameters)
    return max(MECHANISMS.values(), key=lambda m: len(set(m.output_names) & set(run.names)))


def _variables(run: Trajectory) -> dict[str, Variable]:
    """Return the variables of a run's outputs by name, even if an output belongs to another mechanism."""
    mechanisms = (*MECHANISMS.values(), _mechanism(run))
    return {v.name: v for m in mechanisms for v in m.variables if v.name in run.names}


def display_unit(variable: Variable) -> tuple[str, float]:
    """Return the display unit of a variable, and the factor from SI to this unit."""
    displays = dict(UNITS[variable.unit].displays)
    unit = variable.display or next(iter(displays), variable.unit)
    return unit, displays.get(unit, 1.0)


def _output_row(run: Trajectory, table: Mapping[str, Variable], name: str) -> _Rows:
    values = run.unwrapped(name)  # raises an error for an unknown name
    unit, factor = display_unit(table[name])
    return _Rows(name=style.name_in_words(name), unit=unit, curves={"": factor * values})


def _default_rows(run: Trajectory, table: Mapping[str, Variable]) -> list[_Rows]:
    """Return the default panels: coordinates except the crank's, crank speed, drives, transmission angle, joint forces."""
    mechanism = _mechanism(run)
    first, *others = mechanism.freedoms
    moving = [freedom.coordinate for freedom in others or (first,)]
    driven, angles = mechanism.names("drive"), mechanism.names("transmission")
    wanted = dict.fromkeys(("slider.position", *moving, first.rate, *driven, *angles))
    panels = [_output_row(run, table, name) for name in wanted if name in run.names]
    forces = _magnitudes(run)
    if forces:
        what = "pin forces" if all(name.startswith("pin ") for name in forces) else "joint forces"
        panels.append(_Rows(name=what, unit="N", curves={name.removeprefix("pin "): f for name, f in forces.items()}))
    return panels or [_output_row(run, table, name) for name in run.names[:4]]


def _magnitudes(run: Trajectory) -> dict[str, FloatArray]:
    """Return the magnitudes of the joint forces (N) over time, by the names of the joints."""
    return {
        joint.replace(".", " ").replace("_", " "): np.sqrt(sum(run[name] ** 2 for name in names))
        for joint, names in _mechanism(run).joints.items()
    }


def _without_constants(panels: Sequence[_Rows]) -> tuple[list[_Rows], list[str]]:
    """Return the panels without their constant curves, and a list with the sentence that states the constant values."""
    kept, still = [], []
    for panel in panels:
        curves = {name: values for name, values in panel.curves.items() if not _is_constant(values)}
        # "pin force A" of the panel "pin forces"
        names = {name: f"{panel.name.removesuffix('s')} {name}" if name else panel.name for name in panel.curves}
        still += [
            f"{names[name]} {_mean_of_constant(values):.4g} {panel.unit}"
            for name, values in panel.curves.items()
            if name not in curves
        ]
        if curves:
            kept.append(_Rows(name=panel.name, unit=panel.unit, curves=curves))
    if not kept:
        kept = [_Rows(name="nothing changes in this run", unit="", curves={})]
    return kept, [f"Constant, not drawn: {', '.join(still)}."] if still else []


def _is_constant(values: FloatArray) -> bool:
    return len(values) == 0 or bool(np.ptp(values) <= _STILL * max(1.0, float(np.abs(values).max())))


def _mean_of_constant(values: FloatArray) -> float:
    """Return the mean of a constant curve; 0 if its magnitude is at most `_STILL`, which is rounding."""
    mean = float(values.mean()) if len(values) else 0.0
    return mean if abs(mean) > _STILL else 0.0


def _without_rounding(values: FloatArray) -> FloatArray:
    """Return the values of a curve in display units; those of a constant curve are its mean, without rounding errors."""
    return np.full_like(values, _mean_of_constant(values)) if _is_constant(values) else values


@style.figure_style()
def plot_comparison(
    first: Trajectory,
    second: Trajectory,
    names: Sequence[str],
    *,
    title: str = "",
    labels: tuple[str, str] = ("first", "second"),
) -> style.Figure:
    """Plot each output of two runs in a row of its own, and beside it the difference: the second run minus the first.

    A difference that is only rounding is stated in words; if all differences are only rounding, this is stated at the foot.

    Parameters
    ----------
    first, second : Trajectory
        Runs with the same sampling times; samples after the end of the shorter run are ignored.
    names : sequence of str
        Outputs to plot.
    title : str
    labels : (str, str)
        Names of the runs.
    """
    n = min(len(first), len(second))
    time, table = first.time[:n], _variables(first)
    units = [display_unit(table[name]) for name in names]
    pairs = [
        [factor * values for values in _side_by_side(first, second, name, n)] for name, (_, factor) in zip(names, units)
    ]
    said = [_rounding_text(a, b, unit) for (a, b), (unit, _) in zip(pairs, units)]
    beside = not all(said)
    figure = style.Figure(figsize=(9.6 if beside else 7.2, 0.9 + 1.8 * len(names)))
    rows = figure.subplots(len(names), 1 + beside, sharex=True, squeeze=False, width_ratios=(3, 2)[: 1 + beside])
    for axes, name, (unit, _), (a, b), size in zip(rows, names, units, pairs, said):
        for values, label, colour, line in zip((a, b), labels, style.COLOURS, style.LINES):
            axes[0].plot(time, _without_rounding(values), line, color=colour, label=label)
        axes[0].set_ylabel(style.axis_label(name, unit))
        if beside:
            _draw_difference(axes[1], time, b - a, unit, size)
    style.legend_above(rows[0, 0])
    notes: list[str] = []
    if beside:
        rows[0, 1].set_title(f"{labels[1]} less {labels[0]}")
    else:
        each = ", ".join(f"{style.name_in_words(name)} by {size}" for name, size in zip(names, said) if size != "0")
        apart = f"differ by rounding only: {each} at most" if each else "are identical"
        notes = [f"{labels[0]} and {labels[1]} {apart}."]
    for axis in rows[-1]:
        axis.set_xlabel("time [s]")
    figure.align_ylabels()
    return style.finish(figure, title, notes)


def _side_by_side(first: Trajectory, second: Trajectory, name: str, n: int) -> tuple[FloatArray, FloatArray]:
    """Return the first n values of an output of two runs; unwrapped angles begin within half a turn of each other."""
    a, b = first.unwrapped(name)[:n], second.unwrapped(name)[:n]
    return a, b + _whole_turns(a[:1] - b[:1]) if name in wrapping_outputs() else b


def _whole_turns(difference: FloatArray) -> FloatArray:
    """Return the whole turns (rad) nearest to a difference of two angles."""
    return 2.0 * pi * np.rint(difference / (2.0 * pi))


def _rounding_text(a: FloatArray, b: FloatArray, unit: str) -> str:
    """Return the largest difference as text if it is only rounding, "0" if there is none; otherwise an empty text."""
    largest = float(np.abs(b - a).max(initial=0.0))
    if largest > _ROUNDING * float(np.abs(a).max(initial=0.0)):
        return ""
    return f"{largest:.1g} {unit}" if largest else "0"


def _draw_difference(axis: Axes, time: FloatArray, difference: FloatArray, unit: str, size: str) -> None:
    if not size:
        axis.plot(time, difference, color=style.MARKED)
        axis.set_ylabel(f"difference\n[{unit}]")
        return
    words = "identical" if size == "0" else f"identical but for rounding,\n{size} at most"
    axis.text(0.5, 0.5, words, transform=axis.transAxes, ha="center", va="center", color=style.MARKED)
    axis.set_yticks([])
    axis.grid(visible=False)
