"""Charts over two parameters: a quantity in colours, boundaries drawn over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..periodic import OTHER_ORBIT, TRUE_ORBIT, Basins, Coexistence, Crossing, Outcome, StabilityChart
from .curves import Curve, Panel, draw_panel, lay_out
from .dispatch import plot
from .style import COLOURS

#: Colour of points that have no value.
_NONE = "0.82"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeatMap:
    """A quantity over a grid, in colours that part at a value, under the curves of a panel.

    Attributes
    ----------
    panel : Panel
        Axes and curves.
    x, y : ndarray, shapes (nx,) and (ny,)
    values : masked array, shape (ny, nx)
        Masked where there is none; drawn in grey.
    label : str
        What it is, with unit.
    middle : float or None
        Value that is white: below it blue, above it red; None for one colour scale from the least to the greatest.
    missing : str
        What the legend calls masked points.
    """

    panel: Panel
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    values: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    label: str
    middle: float | None = 1.0
    missing: str = "no value"


def plot_charts(
    charts: Sequence[Panel | HeatMap], *, title: str, columns: int = 1, size: tuple[float, float] = (5.4, 3.9)
) -> Figure:
    """Plot charts for print, with colours or with curves alone.

    Parameters
    ----------
    charts : sequence of Panel or HeatMap
    title : str
        Above all of it; a figure of the thesis by its number.
    columns : int
        Charts side by side.
    size : (float, float)
        Width and height of a chart (inches).
    """
    return lay_out(charts, _draw, title=title, columns=columns, size=size)


def _draw(figure: Figure, axis: Axes, chart: Panel | HeatMap) -> None:
    if isinstance(chart, HeatMap):
        _draw_map(figure, axis, chart)
    else:
        draw_panel(axis, chart)


def _draw_map(figure: Figure, axis: Axes, chart: HeatMap) -> None:
    values = np.ma.masked_invalid(chart.values)
    look: dict[str, Any] = {"cmap": "viridis"}
    if chart.middle is not None:
        # both sides of the middle in colours, however one-sided the values are
        low, high = (float(v) for v in (values.min(), values.max())) if values.count() else (chart.middle, chart.middle)
        least = 1e-3 * max(abs(chart.middle), 1e-9)
        norm = TwoSlopeNorm(chart.middle, min(low, chart.middle - least), max(high, chart.middle + least))
        look = {"cmap": "RdBu_r", "norm": norm}
    axis.set_facecolor(_NONE)
    mesh = axis.pcolormesh(chart.x, chart.y, values, shading="nearest", rasterized=True, **look)
    axis.grid(False)
    draw_panel(axis, chart.panel)
    # the scale is part of the chart, and no axes of its own
    scale = axis.inset_axes((1.03, 0.0, 0.05, 1.0))
    figure.colorbar(mesh, cax=scale, label=chart.label)
    scale.grid(False)
    legend = axis.get_legend()
    if np.ma.getmaskarray(values).any():
        handles, labels = axis.get_legend_handles_labels()
        handles.append(Patch(facecolor=_NONE))
        where: Any = chart.panel.legend_at if chart.panel.legend_at != "outside" else "best"
        axis.legend(handles, [*labels, chart.missing], loc=where, frameon=True, framealpha=0.9)
    elif legend is not None:
        # over the colours a legend needs a ground
        legend.set_frame_on(True)
        legend.get_frame().set_alpha(0.9)


@plot.register
def plot_stability_chart(chart: StabilityChart, *, title: str = "") -> Figure:
    """The largest multiplier in colours, the boundaries, and the points of the long runs."""
    x, y = chart.axes
    looks = {
        Crossing.PERIOD_DOUBLING: ("0.1", "-", "period doubling"),
        Crossing.FOLD: (COLOURS[3], "-", "fold"),
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
    for outcome in dict.fromkeys(run.confirmation.outcome for run in chart.runs):
        those = [run for run in chart.runs if run.confirmation.outcome is outcome]
        curves.append(
            Curve(
                x=[x.factor * run.x for run in those],
                y=[y.factor * run.y for run in those],
                colour="0.1",
                line="",
                marker={Outcome.DECAYS: "o", Outcome.GROWS: "x", Outcome.BOUNDED: "s"}[outcome],
                label=f"long run {outcome.value}",
            )
        )
    low, high = (np.array([chart.box.x[i], chart.box.y[i]]) * [x.factor, y.factor] for i in (0, 1))
    panel = Panel(
        x_label=x.label,
        y_label=y.label,
        curves=curves,
        legend_at="upper right",
        x_range=(float(low[0]), float(high[0])),
        y_range=(float(low[1]), float(high[1])),
    )
    if chart.beside is not None:
        return _with_coexistence(chart, chart.beside, panel, title)
    map_ = HeatMap(
        panel=panel,
        x=x.factor * chart.grid.x,
        y=y.factor * chart.grid.y,
        values=chart.grid.largest,
        label="largest Floquet multiplier",
        missing="not found",
    )
    return plot_charts([map_], title=title, size=(7.2, 5.0))


def _with_coexistence(chart: StabilityChart, beside: Coexistence, panel: Panel, title: str) -> Figure:
    """How many stable motions there are, and how large the smallest and the largest are, with the boundaries over them."""
    x, y = (axis.factor * values for axis, values in zip(chart.axes, (beside.x, beside.y)))
    what, unit = beside.swing
    factor, shown = (100.0, "cm") if unit == "m" else (1.0, unit)
    bare = replace(panel, curves=[replace(curve, label="") for curve in panel.curves])
    values: dict[str, np.ma.MaskedArray[Any, np.dtype[np.float64]]] = {
        "stable motions found": np.ma.MaskedArray(beside.stable.astype(float), mask=beside.stable == 0),
        f"amplitude of {what}, smallest stable motion [{shown}]": factor * beside.least,
        f"the same, largest stable motion [{shown}]": factor * beside.greatest,
    }
    maps = [
        HeatMap(panel=bare if n else panel, x=x, y=y, values=grid, label=label, middle=None, missing="none found")
        for n, (label, grid) in enumerate(values.items())
    ]
    return plot_charts(maps, title=title, size=(7.2, 4.2))


@plot.register
def plot_basins(found: Basins, *, title: str = "") -> Figure:
    """The motion that each start ends in by its colour, and the motions themselves at the crank angle 0."""
    x_label, y_label = found.labels
    half = len(found.motions[0].start) // 2
    curves = [
        Curve(
            x=[orbit.start[0]],
            y=[orbit.start[half]],
            line="",
            marker="o" if orbit in found.motions else "x",
            colour="0.05",
            label="" if n and (orbit in found.motions) == (found.found.orbits[n - 1] in found.motions) else label,
        )
        for n, orbit in enumerate(found.found.orbits)
        for label in ["stable motion" if orbit in found.motions else "unstable motion"]
    ]
    panel = Panel(
        x_label=x_label,
        y_label=y_label,
        curves=curves,
        legend_at="upper right",
        x_range=(float(found.position[0]), float(found.position[-1])),
        y_range=(float(found.rate[0]), float(found.rate[-1])),
    )
    names = [f"motion {n + 1}" for n in range(len(found.motions))]
    map_ = HeatMap(
        panel=panel,
        x=found.position,
        y=found.rate,
        values=np.ma.MaskedArray(found.ends + 1.0, mask=found.ends < 0),
        label=f"{', '.join(names)}, by amplitude: where a start ends",
        middle=None,
        missing="limit of assembly, or none",
    )
    return plot_charts([map_], title=title, size=(7.2, 5.0))
