"""Style of all figures: Matplotlib's settings, and colours, line widths and font sizes.

Figures are made inside ``with figure_style():``, so that the user's own settings of Matplotlib have no effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from textwrap import fill, wrap
from typing import Any

import matplotlib.style
from cycler import cycler
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from matplotlib.transforms import ScaledTranslation

__all__ = ["COLOURS", "STYLE", "Figure", "figure_style", "finish"]

#: Colours of curves in order, which colour-blind readers can tell apart (Okabe and Ito); in grey the first three look alike.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Line styles of curves in order, for curves that may cover each other.
LINES: tuple[Any, ...] = ("-", "--", "-.", ":")
#: Colours of the links in drawings.
CRANK, COUPLER, ROCKER, SLIDER, GROUND, TRACE = "#D55E00", "#0072B2", "#009E73", "#5B6770", "#333333", "#CC79A7"
#: Colour of a block that slides, and size of a marked point in drawings.
BLOCK, DOT = "#C9D1D6", 5.0
#: Colours of targets, of shaded areas, and of the texts of marks.
TARGET, SHADE, MARKED = "#E69F00", "#56B4E9", "0.25"

#: Light colours of classes of points.
LIGHT = ("#C6DFF0", "#F6C99F", "#A8DDB5", "#E7B9D6", "#F2E394", "#E0E0E0")
#: Shades of ranges in order: colour and Matplotlib's hatching.
SHADES = (("#E69F00", ""), ("#56B4E9", "//"), ("#009E73", ".."), ("#D55E00", "xx"), ("#CC79A7", "\\\\"))

#: Font sizes (points): figure titles, drawings, titles of panels and axes, legends and notes, marks in a panel.
TITLE, LETTER, PLAIN, SMALL, TINY = 10.5, 10.5, 9.0, 8.0, 7.5
#: Line widths (points): important curves, curves, secondary curves, reference lines.
BOLD, LINE, THIN, HAIR = 1.8, 1.3, 0.9, 0.7

STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "figure.titlesize": TITLE,
    "figure.titleweight": "bold",
    "font.family": "DejaVu Sans",  # comes with Matplotlib: the same picture on every machine
    "font.size": PLAIN,
    "axes.formatter.limits": (-4, 6),
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,  # 40.362 and 40.364 instead of 2 and 4 and "+4.036e1"
    "axes.grid": True,
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": PLAIN,
    "axes.labelsize": PLAIN,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "legend.fontsize": SMALL,
    "legend.title_fontsize": SMALL,
    "hatch.linewidth": 0.6,
    "lines.linewidth": LINE,
    "lines.markersize": 4.5,
}

#: Looks of a reference line, such as zero, and of a line at a marked place.
REFERENCE: dict[str, Any] = {"color": "0.6", "linewidth": HAIR, "zorder": 1}
MARK: dict[str, Any] = {"color": "0.35", "linewidth": THIN, "linestyle": ":", "zorder": 1}
#: Letters per inch of a figure's title, and of notes.
_LETTERS, _NOTED = 11.6, 15.0
#: Greatest number of times that a figure is laid out, and distance of its numbers and labels from its edge (inches).
_ROUNDS, _EDGE = 4, 0.02


def name_in_words(name: str) -> str:
    """Return a variable's name in words: "crank speed" for ``drive.speed``, "slider damping" for ``slider.damping``."""
    return "crank speed" if name == "drive.speed" else name.replace(".", " ").replace("_", " ")


def axis_label(name: str, unit: str) -> str:
    """Return the label of a y axis of small height: the name in words over its unit, long names in two lines."""
    lines = wrap(name_in_words(name), 22)
    return "\n".join(lines) + (" " if len(lines) > 1 else "\n") + f"[{unit}]"


def label_in_words(label: str) -> str:
    """Return an axis label, "name [unit]", with the name in words, see `name_in_words`."""
    name, bracket, unit = label.partition(" [")
    return name_in_words(name) + bracket + unit


@contextmanager
def figure_style(*, laid_out: bool = True) -> Iterator[None]:
    """Use the style of this module instead of the user's; without ``laid_out`` Matplotlib does not lay out the axes."""
    with matplotlib.style.context(STYLE | {"figure.constrained_layout.use": laid_out}, after_reset=True):
        yield


def write_title(figure: Figure, title: str) -> None:
    """Write the title of a figure over as many lines as it needs; write nothing if the title is empty."""
    if title.strip():
        width = int(_LETTERS * figure.get_figwidth())
        lines, longest = len(wrap(title, width)), max(map(len, title.split()))
        # lines of similar length, so that no word is alone in a line
        narrow = next((w for w in range(longest, width) if len(wrap(title, w)) <= lines), width)
        figure.suptitle(fill(title, narrow))


def write_notes(figure: Any, notes: Sequence[str]) -> None:
    """Write notes, one sentence each, at the foot of a figure."""
    width = int(_NOTED * figure.get_figure(root=True).get_figwidth())
    lines = "\n".join(fill(note, width, subsequent_indent="    ") for note in notes)
    if lines:
        figure.supxlabel(lines, fontsize=SMALL, x=0.02, ha="left", color=MARKED)


def legend_above(axis: Axes, **options: Any) -> None:
    """Place a legend above the axes; ``options`` are those of Matplotlib's ``legend``."""
    where: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1, "ncols": 4}
    axis.legend(**where | {"borderpad": 0.2, "columnspacing": 1.2} | options)


def finish(figure: Figure, title: str = "", notes: Sequence[str] = ()) -> Figure:
    """Write title and notes, lay out the figure, fix the layout and return the figure.

    Call it inside `figure_style`: Matplotlib creates the ticks, and gives them their style, only at the layout.
    """
    write_title(figure, title)
    write_notes(figure, notes)
    if not isinstance(figure.canvas, FigureCanvasAgg):
        FigureCanvasAgg(figure)  # measures all texts with one renderer, instead of a new one each
    for axis in figure.axes:
        for part in (axis.xaxis, axis.yaxis):
            # if no size is set, Matplotlib chooses other ticks when the figure is drawn, by the user's own settings
            if "labelsize" not in part.get_tick_params():
                part.set_tick_params(labelsize=PLAIN)
    engine = figure.get_layout_engine()
    if engine is None:
        figure.draw_without_rendering()
    else:
        for _ in range(_ROUNDS):
            engine.execute(figure)
            if not _has_cut_drawing(figure):
                break
        # with any layout engine, even "none", a figure is drawn twice when it is saved
        with rc_context({"figure.constrained_layout.use": False}):
            figure.set_layout_engine(None)
    return figure


def _has_cut_drawing(figure: Figure) -> bool:
    """Return whether numbers or labels of a drawing to scale are at the left or lower edge of a figure.

    The axes of such a drawing are smaller than the place that a layout gives them; the next layout takes this into account.
    """
    edge = _EDGE * figure.dpi
    drawings = [axis for axis in figure.axes if axis.axison and axis.get_aspect() != "auto"]
    boxes = [part.get_tightbbox() for axis in drawings for part in (axis.xaxis, axis.yaxis)]
    return any(box is not None and min(box.x0, box.y0) < edge for box in boxes)


def frame_drawing(axis: Axes, low: Any, high: Any) -> None:
    """Show the box from ``low`` to ``high`` to scale, without axes."""
    axis.set_aspect("equal")
    axis.set_xlim(low[0], high[0])
    axis.set_ylim(low[1], high[1])
    axis.set_axis_off()


def use_one_scale(axis: Axes, adjustable: Any = "datalim") -> None:
    """Give both axes of a drawing, in mm, the same scale; ``adjustable`` is that of Matplotlib's ``set_aspect``."""
    axis.set_aspect("equal", adjustable=adjustable)
    axis.set(xlabel="x [mm]", ylabel="y [mm]")


def tick_quarter_turns(axis: Axes, low: float, high: float) -> None:
    """Put the ticks of the x axis at quarter turns, if its angles (deg) range over half a turn to two turns."""
    if 180.0 <= high - low <= 720.0:
        axis.xaxis.set_major_locator(MultipleLocator(90.0))


def align_labels(axes: Sequence[Axes]) -> None:
    """Put the y labels of axes in one column, at the distance from the axes that the widest tick labels need.

    `Figure.align_ylabels` is slower: for each label it measures the ticks of all axes, at every drawing and layout.
    """
    reach = 0.0
    for axis in axes:
        axis.yaxis.set_label_coords(0.0, 0.5)
        axis.yaxis.label.set_visible(False)
        box = axis.yaxis.get_tightbbox()
        reach = reach if box is None else max(reach, axis.bbox.x0 - box.x0)
        axis.yaxis.label.set_visible(True)
    for axis in axes:
        points = 72.0 * reach / axis.figure.dpi + axis.yaxis.labelpad
        away = ScaledTranslation(-points / 72.0, 0.0, axis.figure.dpi_scale_trans)
        axis.yaxis.set_label_coords(0.0, 0.5, axis.transAxes + away)
