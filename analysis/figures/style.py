"""How every figure looks: one table of Matplotlib's settings, and the colours, widths and sizes that they do not name.

A figure is made within ``with styled():``, which also keeps the user's own settings of Matplotlib out of it.
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
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

__all__ = ["COLOURS", "STYLE", "Figure", "finish", "styled"]

#: Colours that stay apart for colour-blind readers and in grey (Okabe and Ito), in the order of curves.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Line styles in the order of curves that may cover each other.
LINES: tuple[Any, ...] = ("-", "--", "-.", ":")
#: Colours of the links in drawings.
CRANK, COUPLER, ROCKER, SLIDER, GROUND, TRACE = "#D55E00", "#0072B2", "#009E73", "#5B6770", "#333333", "#CC79A7"
#: Colour of a block that slides, and size of a marked point in drawings.
BLOCK, DOT = "#C9D1D6", 5.0
#: Colour of what is asked for, of areas, of the text of marks.
TARGET, SHADE, MARKED = "#E69F00", "#56B4E9", "0.25"

#: Light colours of classes of points.
LIGHT = ("#C6DFF0", "#F6C99F", "#A8DDB5", "#E7B9D6", "#F2E394", "#E0E0E0")
#: Ranges that are shaded, one kind after another: colour, hatching, and the name of it in pages.
SHADES = (("#E69F00", "", ""), ("#56B4E9", "//", "/"), ("#009E73", "..", "."), ("#D55E00", "xx", "x"))

#: Letters: of the figure's title, of drawings, of titles of panels and axes, of legends and notes, of marks in a panel.
TITLE, LETTER, PLAIN, SMALL, TINY = 10.5, 10.5, 9.0, 8.0, 7.5
#: Widths of lines: of a curve that counts more than others, of curves, of those beside, of lines of reference.
BOLD, LINE, THIN, HAIR = 1.8, 1.3, 0.9, 0.7

STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "figure.titlesize": TITLE,
    "figure.titleweight": "bold",
    "font.family": "DejaVu Sans",  # comes with Matplotlib: the same picture on every machine
    "font.size": PLAIN,
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

#: A line at a value that means something, such as zero, and one at a place that is marked.
REFERENCE: dict[str, Any] = {"color": "0.6", "linewidth": HAIR, "zorder": 1}
MARK: dict[str, Any] = {"color": "0.35", "linewidth": THIN, "linestyle": ":", "zorder": 1}
#: Letters to the inch of a figure's title, and of notes.
_LETTERS, _NOTED = 11.6, 15.0


def spoken(name: str) -> str:
    """Return a variable's name as axes have it: "crank speed" of ``drive.speed``, "slider damping" of ``slider.damping``."""
    return "crank speed" if name == "drive.speed" else name.replace(".", " ").replace("_", " ")


def spoken_label(label: str) -> str:
    """Return the label of an axis, a name and a unit in brackets, with the name as `spoken`."""
    name, bracket, unit = label.partition(" [")
    return spoken(name) + bracket + unit


@contextmanager
def styled(*, laid_out: bool = True) -> Iterator[None]:
    """Use this style of Matplotlib whatever the user's is; ``laid_out`` unless the axes are placed by hand."""
    with matplotlib.style.context(STYLE | {"figure.constrained_layout.use": laid_out}, after_reset=True):
        yield


def write_title(figure: Figure, title: str) -> None:
    """Write the title of a figure over as many lines as it needs; write nothing if it is empty."""
    if title.strip():
        width = int(_LETTERS * figure.get_figwidth())
        lines, longest = len(wrap(title, width)), max(map(len, title.split()))
        # over lines of like length, so that none has a word alone
        narrow = next((w for w in range(longest, width) if len(wrap(title, w)) <= lines), width)
        figure.suptitle(fill(title, narrow))


def write_notes(figure: Any, notes: Sequence[str]) -> None:
    """Write notes at the foot of a figure: remarks for its reader, and what was left out of it."""
    width = int(_NOTED * figure.get_figure(root=True).get_figwidth())
    lines = "\n".join(fill(note, width, subsequent_indent="    ") for note in notes)
    if lines:
        figure.supxlabel(lines, fontsize=SMALL, x=0.02, ha="left", color=MARKED)


def legend_above(axis: Axes, **options: Any) -> None:
    """Place a legend above the axes, clear of all curves."""
    where: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1, "ncols": 4}
    axis.legend(**where | {"borderpad": 0.2, "columnspacing": 1.2} | options)


def finish(figure: Figure) -> Figure:
    """Lay the figure out, once for all, while the style is in force: ticks are made, and take their look, only then."""
    engine = figure.get_layout_engine()
    if engine is None:
        figure.draw_without_rendering()
    else:
        engine.execute(figure)
        # with any engine, be it "none", a figure is drawn twice when it is saved
        with rc_context({"figure.constrained_layout.use": False}):
            figure.set_layout_engine(None)
    return figure


def align_labels(axes: Sequence[Axes]) -> None:
    """Put the y labels of axes above each other at one distance from them, as wide as their ticks are now.

    `Figure.align_ylabels` looks at the ticks of all of them for each of them, whenever one is drawn or laid out.
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
