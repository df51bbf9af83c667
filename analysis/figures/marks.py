"""Places marked along x, with their names where no curve runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from .style import MARK, MARKED, TINY, Figure

#: How marks are known among other texts, and their lines among others.
_GID = "mark"
#: Heights in a panel at which the top of a name may be, the first the best; points that it keeps from its line and the rest.
_TOPS, _GAP = np.linspace(1.0, 0.2, 17), 2.0
_Side: TypeAlias = Literal["left", "right"]
_SIDES: tuple[_Side, _Side] = ("right", "left")


def mark_place(axis: Axes, place: float, text: str) -> None:
    """A dotted line across a panel, and its name along it; `place_marks` puts the name where there is room."""
    axis.axvline(place, gid=_GID, **MARK)
    axis.annotate(
        text,
        (place, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(-_GAP, -3.0),
        textcoords="offset points",
        rotation=90,
        ha="right",
        va="top",
        fontsize=TINY,
        color=MARKED,
        gid=_GID,
    )


def place_marks(figure: Figure) -> Figure:
    """Move the names of marks along their lines to where they cover nothing, or least; the figure must be laid out."""
    for axis in figure.axes:
        marks = [text for text in axis.texts if isinstance(text, Annotation) and text.get_gid() == _GID]
        placed: list[Bbox] = []
        for mark in marks:
            placed.append(_place(axis, mark, placed))
    return figure


def _place(axis: Axes, mark: Annotation, others: Sequence[Bbox]) -> Bbox:
    """Put a name at the first of the places where it covers least, and return the box that it takes."""
    least: tuple[int, float, _Side] | None = None
    for top, side in product(_TOPS.tolist(), _SIDES):
        covered = _covered(axis, _move(mark, top, side).padded(_GAP), others)
        if least is None or covered < least[0]:
            least = covered, top, side
        if covered == 0:
            break
    assert least is not None
    return _move(mark, *least[1:])


def _move(mark: Annotation, top: float, side: _Side) -> Bbox:
    """Move a name to a height and a side of its line, and return the box that it takes there."""
    mark.xy = (mark.xy[0], top)
    mark.set_horizontalalignment(side)
    mark.set_position((-_GAP if side == "right" else _GAP, -3.0))
    return mark.get_window_extent()


def _covered(axis: Axes, box: Bbox, others: Sequence[Bbox]) -> int:
    """How many curves, markers, names, and edges of the axes a box covers."""
    count = sum(box.overlaps(other) for other in others)
    inside = axis.get_window_extent()
    count += 10 * (box.x0 < inside.x0 or box.x1 > inside.x1 or box.y0 < inside.y0)
    legend = axis.get_legend()
    if legend is not None:
        count += box.overlaps(legend.get_window_extent())
    for line in axis.lines:
        if line.get_gid() == _GID:
            count += box.x0 < line.get_window_extent().x0 < box.x1
            continue
        path = line.get_transform().transform_path(line.get_path())
        if line.get_marker() != "None":
            # the size in points is a little more than half of it in pixels
            count += box.padded(line.get_markersize()).count_contains(path.vertices) > 0
        if line.get_linestyle() != "None":
            count += path.intersects_bbox(box, filled=False)
    return int(count)
