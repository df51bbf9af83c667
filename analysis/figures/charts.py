"""Charts over two parameters: a quantity as a colour map, with boundaries drawn over it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import cycle, islice
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap, Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from ..periodic import OTHER_ORBIT, TOLERANCE, TRUE_ORBIT, Basins, Coexistence, Crossing, Outcome, StabilityChart
from ..units import RAD_S_PER_RPM, display_scale
from .curves import Curve, Panel, Picture, draw_panel, draw_part, register_picture
from .style import COLOURS, LIGHT, label_in_words, legend_above, name_in_words

#: Colour of points that have no value.
EMPTY = "0.82"
#: Hatchings of the classes in order, so that they can be told apart without colours; and hatching of unstable points.
_HATCHES, _UNSTABLE = ("", "//", "xx", "..", "--", "||"), "////"
#: Colour of hatchings, darker than all colours of a map except the greatest values.
_HATCHING = "0.2"
#: Size of a chart of a result (inches).
_SIZE = 7.2, 4.6
#: Classes of points by the number of stable motions, with their colours; class numbers for no, one and several stable motions.
_SEVERAL = {"one stable motion": "#C6DFF0", "several stable motions": "#F6C99F", "unstable motions only": "#E58267"}
_BY_COUNT = np.array([2.0, 0.0, 1.0])
#: Legend entries of initial conditions that settle to no known motion, by the number that marks them in `Basins.ends`.
_LOST = {-1: "comes to the limit of assembly", -2: "ends in none of them, as far as it was followed"}
#: Colours in the legend of values below and above the middle of a scale.
_BELOW, _ABOVE = "#6AACD0", "#E58267"

_Masked = np.ma.MaskedArray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeatMap:
    """Colour map of a quantity over a grid, drawn under the curves of a panel.

    Attributes
    ----------
    panel : Panel
        Axes and curves.
    x, y : ndarray, shapes (nx,) and (ny,)
        Coordinates of the grid lines, in the units of the axes.
    values : masked array, shape (ny, nx)
        Masked points have no value and are grey.
    label : str
        Name and unit of the quantity.
    middle : float or None
        Value that is white: smaller values are blue, greater ones red. None for a scale from the least to the greatest value.
    missing : str
        Name of masked points in the legend.
    classes : mapping
        Colours of classes by their names in the legend, if ``values`` are class numbers from 0. Such a map has no colour scale.
    sides : (str, str), optional
        Names in the legend of values below and above the middle; values above the middle are hatched.
    hover : mapping
        Arrays of shape (ny, nx), by name with unit, that an HTML page shows under the pointer beside x and y; by default
        ``values``.
    """

    panel: Panel
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    values: _Masked
    label: str
    middle: float | None = 1.0
    missing: str = "no value"
    classes: Mapping[str, str] = field(default_factory=dict)
    sides: tuple[str, str] | None = None
    hover: Mapping[str, ArrayLike] = field(default_factory=dict)


def colour_scale(chart: HeatMap) -> tuple[Normalize, Colormap]:
    """Return the normalisation of a heat map's values to [0, 1], and the colour map."""
    values = np.ma.masked_invalid(chart.values)
    if chart.classes:
        n = len(chart.classes)
        return Normalize(-0.5, n - 0.5), ListedColormap(list(chart.classes.values()))
    low, high = (float(v) for v in (values.min(), values.max())) if values.count() else (0.0, 1.0)
    if chart.middle is None:
        return Normalize(low, high), colormaps["viridis"]
    # the scale has colours on both sides of the middle, even if all values are on one side
    least = 1e-3 * max(abs(chart.middle), 1e-9)
    low, high = (low, high) if values.count() else (chart.middle, chart.middle)
    norm = TwoSlopeNorm(chart.middle, min(low, chart.middle - least), max(high, chart.middle + least))
    return norm, colormaps["RdBu_r"]


def legend_entries(chart: HeatMap) -> list[tuple[str, str, str]]:
    """Return colour, hatching and name of each legend entry of a heat map, without the entries of its curves."""
    keys = [(colour, hatch, name) for (name, colour), hatch in zip(chart.classes.items(), cycle(_HATCHES))]
    if chart.sides is not None:
        keys += [(_BELOW, "", chart.sides[0]), (_ABOVE, _UNSTABLE, chart.sides[1])]
    if np.ma.getmaskarray(np.ma.masked_invalid(chart.values)).any():
        keys.append((EMPTY, "", chart.missing))
    return keys


@draw_part.register
def _(chart: HeatMap, figure: Figure, axis: Axes) -> None:
    values = np.ma.masked_invalid(chart.values)
    norm, colours = colour_scale(chart)
    axis.set_facecolor(EMPTY)
    mesh = axis.pcolormesh(chart.x, chart.y, values, shading="nearest", rasterized=True, norm=norm, cmap=colours)
    for points, hatch in _hatched_points(chart, values):
        if points.any() and min(points.shape) > 1:
            # the level 0.5 lies halfway between hatched and other points
            area = axis.contourf(chart.x, chart.y, points, levels=[0.5, 1.5], colors="none", hatches=[hatch])
            # the hatching has the colour of the edge, which is not drawn
            area.set(edgecolor=_HATCHING, linewidth=0.0)
    axis.grid(False)
    draw_panel(axis, chart.panel)
    if not chart.classes:
        # the colour scale is a part of the chart's axes
        scale = axis.inset_axes((1.03, 0.0, 0.05, 1.0))
        figure.colorbar(mesh, cax=scale, label=chart.label, ticks=_ticks(norm), format="%g")
        scale.grid(False)
    handles, labels = axis.get_legend_handles_labels()
    for colour, hatch, name in legend_entries(chart):
        handles.append(Patch(facecolor=colour, hatch=hatch, edgecolor=_HATCHING, linewidth=0.0))
        labels.append(name)
    if not handles:
        return
    if chart.panel.legend_at == "above":
        legend_above(axis, handles=handles, labels=labels, ncols=3 if len(handles) > 4 else 2)
    else:
        # over colours a legend needs a background
        where: Any = chart.panel.legend_at if chart.panel.legend_at != "outside" else "best"
        axis.legend(handles, labels, loc=where, frameon=True, framealpha=0.9)


def _ticks(norm: Normalize) -> list[float] | None:
    """Return about four ticks on each side of the middle of a scale, and the middle; None if the scale has no middle."""
    if not isinstance(norm, TwoSlopeNorm):
        return None
    least, middle, greatest = (float(value or 0.0) for value in (norm.vmin, norm.vcenter, norm.vmax))
    sides = ((least, middle), (middle, greatest))
    ticks = {tick for low, high in sides for tick in MaxNLocator(4).tick_values(low, high) if low <= tick <= high}
    near = 0.1 * min(high - low for low, high in sides)
    return sorted({tick for tick in ticks if abs(tick - middle) > near} | {middle})


def _hatched_points(chart: HeatMap, values: _Masked) -> list[tuple[NDArray[np.float64], str]]:
    """Return, for each hatching, an array that is 1 at the points to be hatched and 0 elsewhere, and the hatching."""
    if chart.sides is not None and chart.middle is not None:
        return [(np.asarray(values.filled(-np.inf) > chart.middle + TOLERANCE, dtype=float), _UNSTABLE)]
    hatches = [_HATCHES[i % len(_HATCHES)] for i in range(len(chart.classes))]
    return [(np.asarray(values.filled(-1.0) == i, dtype=float), hatch) for i, hatch in enumerate(hatches) if hatch]


@register_picture
def plot_stability_chart(chart: StabilityChart, *, title: str = "") -> Picture:
    """Plot the largest Floquet multiplier in colours, the stability boundaries, and the outcomes of long runs.

    If coexisting motions were searched for, their number and amplitudes are plotted instead of the multiplier.
    """
    x, y = chart.axes
    looks = {
        Crossing.PERIOD_DOUBLING: ("0.1", "-", "period doubling"),
        Crossing.FOLD: (COLOURS[3], "-", "fold"),
        Crossing.BRANCH_POINT: (COLOURS[2], "-", "branch point"),
        Crossing.TORUS: (COLOURS[1], "-", "torus"),
    }
    marks = {Crossing.PERIOD_DOUBLING: (COLOURS[2], "-1"), Crossing.FOLD: (COLOURS[4], "+1")}
    curves, named = [], set()
    for traced in chart.boundaries:
        if traced.motion in (TRUE_ORBIT, OTHER_ORBIT):
            colour, line, label = looks[traced.kind]
            if traced.motion == OTHER_ORBIT:
                line, label = ":", f"{label}, another motion"
        else:
            colour, multiplier = marks[traced.kind]
            line, label = "--", f"{traced.motion}, multiplier {multiplier}"
        points = traced.points * [x.factor, y.factor]
        entry = "" if label in named else label
        curves.append(Curve(x=points[:, 0], y=points[:, 1], colour=colour, line=line, label=entry))
        named.add(label)
    look: dict[str, Any] = {"colour": "0.1", "hollow": True, "line": "", "order": 4.0, "cut": False}
    for outcome in dict.fromkeys(run.confirmation.outcome for run in chart.runs):
        those = [run for run in chart.runs if run.confirmation.outcome is outcome]
        at = np.array([(x.factor * run.x, y.factor * run.y) for run in those])
        marker = {Outcome.DECAYS: "o", Outcome.GROWS: "X", Outcome.BOUNDED: "s"}[outcome]
        curves.append(Curve(x=at[:, 0], y=at[:, 1], marker=marker, label=f"long run {outcome.value}", **look))
    low, high = (np.array([chart.box.x[i], chart.box.y[i]]) * [x.factor, y.factor] for i in (0, 1))
    panel = Panel(
        x_label=label_in_words(x.label),
        y_label=label_in_words(y.label),
        curves=curves,
        legend_at="above",
        x_range=(float(low[0]), float(high[0])),
        y_range=(float(low[1]), float(high[1])),
    )
    if chart.beside is not None:
        return _coexistence_picture(chart, chart.beside, panel, title)
    words = [["not found" if word is None else word.value for word in row] for row in chart.grid.stability().tolist()]
    map_ = HeatMap(
        panel=panel,
        x=x.factor * chart.grid.x,
        y=y.factor * chart.grid.y,
        values=chart.grid.largest,
        label="largest Floquet multiplier",
        missing="not found",
        sides=("stable", "unstable"),
        hover={"motion": np.array(words), "largest multiplier": chart.grid.largest.filled(np.nan)},
    )
    return Picture(parts=[map_], title=title, size=_SIZE)


def _coexistence_picture(chart: StabilityChart, beside: Coexistence, panel: Panel, title: str) -> Picture:
    """Return the picture of three maps: number of stable motions, least and greatest amplitude, with the boundaries."""
    x, y = (axis.factor * values for axis, values in zip(chart.axes, (beside.x, beside.y)))
    what, unit = beside.swing
    shown, factor = display_scale(unit)
    sizes = {
        f"amplitude of {name_in_words(what)}, {word} stable motion [{shown}]": factor * amplitude
        for word, amplitude in (("smallest", beside.least), ("largest", beside.greatest))
    }
    hover: dict[str, ArrayLike] = {"motions found": beside.count, "stable motions": beside.stable}
    hover |= {name: values.filled(np.nan) for name, values in sizes.items()}
    # black is not visible over small amplitudes, whose colours are dark
    light = {"0.1": "0.85"}
    curves = [replace(curve, label="", colour=light.get(str(curve.colour), curve.colour)) for curve in panel.curves]
    bare = replace(panel, curves=curves)
    several = HeatMap(
        panel=panel,
        x=x,
        y=y,
        values=np.ma.MaskedArray(_BY_COUNT[np.minimum(beside.stable, 2)], mask=beside.count == 0),
        label="stable motions found",
        middle=None,
        missing="no motion found",
        classes=_SEVERAL,
        hover=hover,
    )
    maps = [
        replace(several, panel=bare, values=values, label=label, classes={}, missing="no stable motion found")
        for label, values in sizes.items()
    ]
    return Picture(parts=[several, *maps], title=title, size=_SIZE)


@register_picture
def plot_basins(found: Basins, *, title: str = "") -> Picture:
    """Plot each initial condition in the colour of the motion it settles to, and mark the motions at crank angle 0."""
    flow, place = found.motions[0].flow, found.place
    half = flow.size // 2
    drawn, scale = display_scale(flow.components[place][1])
    shown, factor = display_scale(found.motions[0].swing[1])
    name, varied = flow.components[0][0], name_in_words(flow.components[place][0])
    curves = []
    for label, marker in (("stable motion", "o"), ("unstable motion", "x")):
        those = [orbit for orbit in found.found.orbits if (orbit in found.motions) == (marker == "o")]
        if those:
            hover = {
                f"amplitude of {name_in_words(name)} [{shown}]": [factor * orbit.amplitude for orbit in those],
                "largest multiplier": [orbit.largest for orbit in those],
            }
            x = [scale * _nearest_turn(found, orbit.start[place]) for orbit in those]
            y = [orbit.start[half + place] for orbit in those]
            curves.append(Curve(x=x, y=y, line="", marker=marker, colour="0.05", label=label, hover=hover))
    panel = Panel(
        x_label=f"{varied} at crank angle 0{', all else as in motion 1' if found.fixed else ''} [{drawn}]",
        y_label=label_in_words(found.labels[1]),
        curves=curves,
        legend_at="above",
        x_range=(scale * float(found.position[0]), scale * float(found.position[-1])),
        y_range=(float(found.rate[0]), float(found.rate[-1])),
    )
    names = [
        f"ends in motion {n}{'' if orbit.periods == 1 else f' of {orbit.crank_turns} turns'}, "
        f"amplitude of {name_in_words(name)} {factor * orbit.amplitude:.3g} {shown}"
        for n, orbit in enumerate(found.motions, start=1)
    ]
    numbers = found.ends.copy()
    for end, words in _LOST.items():
        if (found.ends == end).any():
            numbers[found.ends == end] = len(names)
            names.append(words)
    colours = [*islice(cycle(LIGHT), len(found.motions)), EMPTY, "0.95"]
    orbit = found.motions[0]
    speed = orbit.flow.period * orbit.turns / orbit.turn(2).period / RAD_S_PER_RPM
    title = f"{title}: basins at {speed:.4g} rpm".removeprefix(": ")
    map_ = HeatMap(
        panel=panel,
        x=scale * found.position,
        y=found.rate,
        values=np.ma.MaskedArray(numbers.astype(float)),
        label="where a start ends",
        middle=None,
        classes=dict(zip(names, colours)),
        hover={"it": np.array(names)[numbers]},
    )
    return Picture(parts=[map_], title=title, size=_SIZE)


def _nearest_turn(found: Basins, position: float) -> float:
    """Return the coordinate ``position`` of a motion; an angle is moved by whole turns to within half a turn of the middle."""
    way, middle = found.motions[0].flow.angle_periods[found.place], 0.5 * (found.position[0] + found.position[-1])
    return float(position - way * np.round((position - middle) / way) if way else position)
