"""Describe pictures of curves in panels, and draw them with Matplotlib.

A `Picture` is a description: `draw` makes a figure of it, `html.to_html` a page with values under the pointer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import singledispatch, wraps
from math import ceil
from typing import Any, ParamSpec

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike, NDArray

from . import style
from .dispatch import picture, plot
from .marks import label_place, mark_place, settle

_Arguments = ParamSpec("_Arguments")


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One curve of a panel.

    ``x`` and ``y`` are the coordinates of the points, shape (n,), in the units of the axes. ``label`` is the entry of the
    legend, ``order`` the drawing order (Matplotlib's zorder). If colour, width or order is None, the panel chooses it. For a
    marker such as "$2$" the text between the dollars is drawn. If ``cut`` is true, markers are cut off at the edge of the axes.
    ``hover`` has arrays (n,), by name with unit, that an HTML page shows under the pointer beside x and y.
    """

    x: ArrayLike
    y: ArrayLike
    label: str = ""
    colour: str | None = None
    line: Any = "-"
    marker: str = ""
    hollow: bool = False
    width: float | None = None
    order: float | None = None
    cut: bool = True
    hover: Mapping[str, ArrayLike] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shade:
    """A range along x, shaded over the whole height; ``number`` selects colour and hatching from `style.SHADES`."""

    low: float
    high: float
    label: str
    number: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A text with a line to a point; the text is moved to a place where it covers as little as possible."""

    x: float
    y: float
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrow:
    """A vertical arrow at x, from ``begin`` to ``end`` along y."""

    x: float
    begin: float
    end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One pair of axes of a plot.

    Attributes
    ----------
    x_label, y_label : str
        With units.
    curves : sequence of Curve
        Curves without a colour of their own get the colours of `COLOURS` in order.
    verticals : mapping
        Places along x of dotted vertical lines, by name; the names are written where they cover as little as possible.
    dashed : sequence of float
        Places along x of dashed vertical lines without a name.
    legend : str, optional
        Heading of the legend, which is drawn if any curve has a label.
    legend_at : str
        Place of the legend: one of Matplotlib's, or "outside" (to the right of the axes), or "above" (above the axes).
    x_range, y_range : (float, float), optional
    logarithmic : str
        Axes on a logarithmic scale: "", "x", "y" or "xy".
    equal : bool
        Whether both axes have the same scale.
    filled : sequence of sequence of ndarray, shape (n, 2)
        Areas to shade, each as the list of its closed boundaries; clockwise boundaries are holes.
    x_ticks : sequence of float, optional
    shades : sequence of Shade
    labels : sequence of Label
    arrows : sequence of Arrow
    """

    x_label: str
    y_label: str
    curves: Sequence[Curve] = ()
    verticals: Mapping[str, float] | None = None
    dashed: Sequence[float] = ()
    title: str = ""
    legend: str = ""
    legend_at: str = "best"
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    logarithmic: str = ""
    equal: bool = False
    filled: Sequence[Sequence[NDArray[np.float64]]] = ()
    x_ticks: Sequence[float] | None = None
    shades: Sequence[Shade] = ()
    labels: Sequence[Label] = ()
    arrows: Sequence[Arrow] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """Description of a picture, from which `draw` makes a figure.

    Attributes
    ----------
    parts : sequence of Panel or HeatMap
    title : str
        Title of the figure; for a figure of the thesis its number.
    columns : int
        Number of parts side by side.
    size : (float, float)
        Width and height of a part (inches).
    notes : sequence of str
        Sentences at the foot.
    heights : sequence of float
        Heights of the rows relative to the height in ``size``; the rows then share one x axis. Empty for rows of equal height.
    """

    parts: Sequence[Any]
    title: str
    columns: int = 1
    size: tuple[float, float] = (6.4, 3.7)
    notes: Sequence[str] = ()
    heights: Sequence[float] = ()


def plot_curves(
    panels: Sequence[Any],
    *,
    title: str,
    columns: int = 1,
    size: tuple[float, float] = (6.4, 3.7),
    notes: Sequence[str] = (),
) -> style.Figure:
    """Plot curves and charts for print, one pair of axes each.

    Parameters
    ----------
    panels : sequence of Panel or HeatMap
    title, columns, size, notes
        See `Picture`.
    """
    return draw(Picture(parts=panels, title=title, columns=columns, size=size, notes=notes))


def drawn(describe: Callable[_Arguments, Picture]) -> Callable[_Arguments, style.Figure]:
    """Return a function that draws what ``describe`` returns as a figure."""

    @wraps(describe)
    def plot_picture(*arguments: _Arguments.args, **options: _Arguments.kwargs) -> style.Figure:
        return draw(describe(*arguments, **options))

    plot_picture.__name__ = plot_picture.__qualname__ = describe.__name__.replace("describe", "plot", 1)
    return plot_picture


def register_picture(describe: Callable[_Arguments, Picture]) -> Callable[_Arguments, style.Figure]:
    """Register a function that returns the picture of a result, by the type of its first argument; return it as `drawn`."""
    picture.register(describe)
    plot.register(drawn(describe))
    return drawn(describe)


@style.figure_style()
def draw(picture: Picture) -> style.Figure:
    """Draw a picture as a figure with one pair of axes for each part."""
    parts, columns, size = picture.parts, picture.columns, picture.size
    rows = ceil(len(parts) / columns)
    heights = picture.heights or [1.0] * rows
    figure = style.Figure(figsize=(size[0] * columns, 0.35 + size[1] * sum(heights)))
    FigureCanvasAgg(figure)  # measures all texts with one renderer
    axes = figure.subplots(
        rows, columns, squeeze=False, height_ratios=heights, sharex="col" if picture.heights else False
    )
    for axis, part in zip(axes.flat, parts):
        draw_part(part, figure, axis)
        if picture.heights:
            axis.label_outer(remove_inner_ticks=False)
    for axis in list(axes.flat)[len(parts) :]:
        axis.remove()
    if picture.heights:
        style.align_labels(list(axes.flat))
    return settle(style.finish(figure, picture.title, picture.notes))


@style.figure_style()
def resize(figure: style.Figure, width: float, height: float) -> style.Figure:
    """Change the size of a drawn figure (inches) and lay it out again."""
    figure.set_layout_engine("constrained")
    figure.set_size_inches(width, height)
    return settle(style.finish(figure, figure.get_suptitle().replace("\n", " ")))


@singledispatch
def draw_part(part: Any, figure: style.Figure, axis: Axes) -> None:
    """Draw a part of a picture on the given axes; a function is registered for each kind of part."""
    raise TypeError(f"a part of a picture is a Panel or a HeatMap, not a {type(part).__name__}")


@draw_part.register
def _(panel: Panel, figure: style.Figure, axis: Axes) -> None:
    draw_panel(axis, panel)


def _name_few_decades(axis: Axis) -> None:
    """Put plain numbers at 1, 2 and 5 times powers of ten if a logarithmic axis covers less than two decades."""
    low, high = axis.get_view_interval()
    if 0.0 < low < high < 100.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def draw_panel(axis: Axes, panel: Panel) -> None:
    for boundaries in panel.filled:
        # clockwise boundaries are holes in the areas of the others
        outline = Outline.make_compound_path(
            *(Outline(np.vstack([ring, ring[:1]]), closed=True) for ring in boundaries)
        )
        axis.add_patch(PathPatch(outline, facecolor=style.SHADE, alpha=0.22, edgecolor="none", zorder=0))
    for number, curve in enumerate(panel.curves):
        _draw_curve(axis, curve, curve.colour or style.COLOURS[number % len(style.COLOURS)])
    for entry, number, those in shades_by_label(panel):
        colour, hatch = style.SHADES[number]
        for shade, name in zip(those, (entry or None, *[None] * len(those))):
            look: dict[str, Any] = {"facecolor": (colour, 0.16), "edgecolor": (colour, 0.45), "linewidth": 0.0}
            axis.axvspan(shade.low, shade.high, hatch=hatch, label=name, zorder=0.5, **look)
    for arrow in panel.arrows:
        head = "-|>,head_width=0.25,head_length=0.5"
        look = {"arrowstyle": head, "color": style.MARKED, "linewidth": style.LINE, "shrinkB": 0.0}
        axis.annotate("", (arrow.x, arrow.end), (arrow.x, arrow.begin), arrowprops=look, zorder=3.5)
    for label in panel.labels:
        label_place(axis, (label.x, label.y), label.text)
    axis.set(xlabel=panel.x_label, ylabel=panel.y_label)
    axis.set_title(panel.title)
    axis.set(**{f"{log}scale": "log" for log in panel.logarithmic})
    if panel.x_ticks is not None:
        axis.set_xticks(panel.x_ticks, [f"{tick:g}" for tick in panel.x_ticks])
        axis.set_xticks([], minor=True)
    if panel.x_range:
        axis.set_xlim(*panel.x_range)
    if panel.y_range and panel.y_range[0] < panel.y_range[1]:
        axis.set_ylim(*panel.y_range)
    for log in panel.logarithmic if panel.x_ticks is None else "":
        _name_few_decades(getattr(axis, f"{log}axis"))
    if panel.equal:
        axis.set_aspect("equal")
    for place in panel.dashed:
        axis.axvline(place, **style.MARK | {"linestyle": (0, (5, 4))})
    for text, place in (panel.verticals or {}).items():
        mark_place(axis, place, text)
    if panel.legend_at == "above" and axis.get_legend_handles_labels()[0]:
        style.legend_above(axis, title=panel.legend or None, ncols=3)
    elif any(curve.label for curve in panel.curves):
        outside: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
        where = outside if panel.legend_at == "outside" else {"loc": panel.legend_at}
        axis.legend(title=panel.legend or None, alignment="left", **where)


def shades_by_label(panel: Panel) -> list[tuple[str, int, list[Shade]]]:
    """Return the shades of a panel grouped by label and number: a list of (label, number, shades)."""
    kinds = dict.fromkeys((shade.label, shade.number) for shade in panel.shades)
    return [(*kind, [shade for shade in panel.shades if (shade.label, shade.number) == kind]) for kind in kinds]


def _draw_curve(axis: Axes, curve: Curve, colour: str) -> None:
    letters = curve.marker.startswith("$")
    axis.plot(
        curve.x,
        curve.y,
        linestyle=curve.line or "none",
        color=colour,
        marker=curve.marker or None,
        markerfacecolor="white" if curve.hollow else colour,
        markersize=6.0 if letters else None,
        label=curve.label or None,
        linewidth=curve.width,
        markeredgewidth=0.3 if letters else style.THIN if curve.hollow else style.LINE,
        zorder=curve.order or (3 if curve.marker else 2),
        clip_on=curve.cut,
        # letters on a line have a white outline, so that they can be read
        path_effects=[withStroke(linewidth=3.0, foreground="white")] if letters else None,
    )
