"""Move the names of vertical lines, the labels of points and the letters of pins to where they cover as little as possible."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.path import Path
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedLocator
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from .style import HAIR, MARK, MARKED, TINY, Figure

#: Matplotlib's gid of vertical lines and their names, and of the texts of points.
_GID, _LABEL = "mark", "label"
#: Look of the names and texts; the position of each is an offset from its line or point.
_TEXT: dict[str, Any] = {"textcoords": "offset points", "fontsize": TINY, "color": MARKED}
#: Heights of a panel (0 to 1) for the top of a name, the best first; clearance (points) from its line and other things.
_TOPS, _GAP = np.linspace(1.0, 0.2, 33), 2.0
FloatArray: TypeAlias = NDArray[np.float64]
_Side: TypeAlias = Literal["left", "right"]
_SIDES: tuple[_Side, _Side] = ("right", "left")
#: Distances (points) of a text from its point, the best first; and directions (rad) of the text from the point.
_DISTANCES = (10.0, 20.0, 34.0, 52.0, 74.0, 100.0, 130.0)
_DIRECTIONS = np.radians([30.0, -30.0, 150.0, -150.0, 0.0, 180.0, 90.0, 70.0, 110.0, -90.0, -70.0, -110.0])
#: Largest share of the lengthened axis that may be added as room for a legend.
_ROOM = 0.45
#: If the added share is at least this, every other tick of the axis is left out.
_CLOSE = 0.3
#: Weight of a line that crosses a text, or of a text on another, relative to a text that covers a curve.
_CROSSED = 3
#: Directions (rad) from a pin in which its letter may stand.
_ROUND = np.radians(np.arange(0.0, 360.0, 15.0))
#: Half the size of a letter, relative to its distance from its pin.
_LETTER = 0.25


def mark_place(axis: Axes, place: float, text: str) -> None:
    """Draw a vertical dotted line at ``place`` along x with a name, which `place_marks` moves to a free place."""
    axis.axvline(place, gid=_GID, **MARK)
    upright: dict[str, Any] = {"rotation": 90, "ha": "right", "va": "top", "gid": _GID}
    axis.annotate(text, (place, 1.0), (-_GAP, -3.0), xycoords=("data", "axes fraction"), **_TEXT | upright)


def label_place(axis: Axes, place: tuple[float, float], text: str) -> None:
    """Write a text beside a point and a line from it to the point; `place_marks` moves the text to a free place."""
    leader = {"arrowstyle": "-", "color": MARKED, "linewidth": HAIR, "shrinkA": 1.0, "shrinkB": 3.0}
    beside = (_DISTANCES[0], _DISTANCES[0])
    axis.annotate(text, place, beside, arrowprops=leader, va="center", gid=_LABEL, zorder=5, **_TEXT)


@dataclass(frozen=True, slots=True)
class _Scene:
    """Things on laid-out axes that texts must not cover, in pixels.

    These are the edges of the axes, the legend, vertical lines at ``marks``, curves as (path, size of the markers, whether the
    curve has a line), and arrows without a text.
    """

    inside: Bbox
    legend: Bbox | None
    marks: Sequence[float]
    curves: Sequence[tuple[Path, float, bool]]
    arrows: Sequence[Path]

    @classmethod
    def from_axes(cls, axis: Axes) -> _Scene:
        legend = axis.get_legend()
        marks = [line for line in axis.lines if line.get_gid() == _GID]
        curves = [
            (
                line.get_transform().transform_path(line.get_path()),
                line.get_markersize() if line.get_marker() != "None" else 0.0,
                line.get_linestyle() != "None",
            )
            for line in axis.lines
            if line.get_gid() != _GID
        ]
        to_pixels = axis.transData.transform
        bare = [text for text in axis.texts if isinstance(text, Annotation) and not text.get_text()]
        return cls(
            axis.get_window_extent(),
            None if legend is None else legend.get_window_extent(),
            [line.get_window_extent().x0 for line in marks],
            curves,
            [Path(to_pixels([text.xyann, text.xy])) for text in bare],
        )

    def count_covered(self, box: Bbox, others: Sequence[Bbox]) -> int:
        """Return the weighted number of curves, lines, texts (``others``), arrows and edges of the axes that a box covers."""
        inside = self.inside
        count = _CROSSED * sum(box.overlaps(other) for other in others)
        count += 10 * (box.x0 < inside.x0 or box.x1 > inside.x1 or box.y0 < inside.y0 or box.y1 > inside.y1 + _GAP)
        if self.legend is not None:
            count += box.overlaps(self.legend)
        count += sum(box.x0 < place < box.x1 for place in self.marks)
        count += sum(arrow.intersects_bbox(box, filled=False) for arrow in self.arrows)
        return int(count) + self.count_hidden_curves(box)

    def count_hidden_curves(self, box: Bbox) -> int:
        """Count the curves that a box covers; lines and markers of a curve count separately."""
        count = 0
        for path, marker, line in self.curves:
            if marker:
                # the marker size in points is a little more than half of its size in pixels
                count += bool(box.padded(marker).count_contains(path.vertices))
            if line:
                count += bool(path.intersects_bbox(box, filled=False))
        return count

    def count_crossed(self, leader: Path, others: Sequence[Bbox]) -> int:
        """Count the texts (``others``) and arrows that a line from a point to its text crosses."""
        return sum(leader.intersects_bbox(other, filled=True) for other in others) + sum(
            leader.intersects_path(arrow, filled=False) for arrow in self.arrows
        )


def settle(figure: Figure) -> Figure:
    """Make room for legends, leave out ticks whose numbers touch, and place the texts; the figure must be laid out."""
    for axis in figure.axes:
        _thin_ticks(axis)
        _make_room(axis)
    return place_marks(figure)


def _thin_ticks(axis: Axes) -> None:
    """Remove every other tick from an x axis with given ticks, repeatedly, until the numbers do not touch."""
    while isinstance(axis.xaxis.get_major_locator(), FixedLocator) and len(axis.get_xticks()) > 3:
        boxes = [label.get_window_extent() for label in axis.get_xticklabels() if label.get_text()]
        if all(right.x0 - left.x1 > _GAP for left, right in pairwise(boxes)):
            return
        texts = [label.get_text() for label in axis.get_xticklabels()]
        axis.set_xticks(axis.get_xticks()[::2], texts[::2])


def _make_room(axis: Axes) -> None:
    """Extend the y axis upwards by the height of the legend if the legend then covers fewer curves."""
    legend = axis.get_legend()
    if legend is None or axis.get_aspect() != "auto":
        return
    box, inside = legend.get_window_extent(), axis.get_window_extent()
    hidden = _Scene.from_axes(axis).count_hidden_curves(box)
    share = (box.height + 2.0 * _GAP) / inside.height
    if not hidden or not inside.overlaps(box) or box.y0 > inside.y1 - _GAP or share > _ROOM:
        return
    before, scale = axis.get_ylim(), axis.yaxis.get_transform()
    low, high = scale.transform(before)
    ticks = axis.get_yticks()
    axis.set_ylim(before[0], float(scale.inverted().transform(low + (high - low) / (1.0 - share))))
    legend.set_loc("best")
    if _Scene.from_axes(axis).count_hidden_curves(legend.get_window_extent()) >= hidden:
        axis.set_ylim(before)
    else:
        # no numbers in the added room: they might be wider than the layout allows
        kept = [tick for tick in ticks if before[0] <= tick <= before[1]]
        zero = min(range(len(kept)), key=lambda n: abs(kept[n]), default=0)
        axis.set_yticks(kept if share < _CLOSE else kept[zero % 2 :: 2])


def place_marks(figure: Figure) -> Figure:
    """Move the texts of vertical lines and points to where they cover as little as possible; the figure must be laid out."""
    for axis in figure.axes:
        texts = [text for text in axis.texts if isinstance(text, Annotation)]
        moved = [(text, _MOVES[gid]) for gid in _MOVES for text in texts if text.get_gid() == gid]
        if not moved:
            continue
        for text, _ in moved:
            text.get_window_extent()  # tells the text where its point is
        scene = _Scene.from_axes(axis)
        placed: dict[Annotation, Bbox] = {}
        leaders: dict[Annotation, Path] = {}
        # twice, as the first texts may have to make way for later ones
        for text, (move, first, second) in 2 * moved:
            placed.pop(text, None)
            leaders.pop(text, None)
            placed[text] = _place(text, move, product(first, second), scene, [*placed.values()], [*leaders.values()])
            if text.get_gid() == _LABEL:
                leaders[text] = _leader(text, placed[text])
    return figure


def _place(
    text: Annotation,
    move: Callable[[Annotation, float, Any], Bbox],
    places: Iterable[tuple[float, Any]],
    scene: _Scene,
    others: Sequence[Bbox],
    leaders: Sequence[Path],
) -> Bbox:
    """Move a text to where the text and its leader line cover as little as possible, and return the box of the text.

    Of equally good ``places`` the first is taken. ``move`` moves the text and returns its box; ``others`` and ``leaders`` are
    the boxes and leader lines of texts that are placed already.
    """
    least: tuple[int, tuple[float, Any]] | None = None
    for place in places:
        box = move(text, *place).padded(_GAP)
        covered = scene.count_covered(box, others)
        if least is not None and covered >= least[0]:
            continue
        crossed = sum(leader.intersects_bbox(box, filled=False) for leader in leaders)
        if text.get_gid() == _LABEL:
            own = _leader(text, box)
            crossed += scene.count_crossed(own, others) + sum(
                own.intersects_path(other, filled=False) for other in leaders
            )
        covered += _CROSSED * crossed
        if least is None or covered < least[0]:
            least = covered, place
        if covered == 0:
            break
    assert least is not None
    return move(text, *least[1])


def _move_name(mark: Annotation, top: float, side: _Side) -> Bbox:
    """Move a name to a relative height (0 to 1) and a side of its vertical line, and return the box of the name there."""
    mark.xy = (mark.xy[0], top)
    mark.set_horizontalalignment(side)
    mark.set_position((-_GAP if side == "right" else _GAP, -3.0))
    return mark.get_window_extent()


def _move_label(label: Annotation, distance: float, direction: float) -> Bbox:
    """Move the text of a point to a distance (points) and direction (rad) from the point, and return its box there."""
    label.set_position((distance * np.cos(direction), distance * np.sin(direction)))
    across = np.cos(direction)
    label.set_horizontalalignment("center" if abs(across) < 0.1 else "left" if across > 0.0 else "right")
    # the box without the line to the point, whose measurement is slow
    return Text.get_window_extent(label)


def _leader(label: Annotation, box: Bbox) -> Path:
    """Return the leader line of a text: from near its point to the nearest position on its box."""
    point = label.axes.transData.transform(label.xy)  # type: ignore[union-attr]
    end = np.clip(point, (box.x0, box.y0), (box.x1, box.y1))
    return Path([point + 0.1 * (end - point), end])


def roomiest_position(
    pin: FloatArray, reach: float, drawn: Sequence[object], marks: Sequence[FloatArray], away: FloatArray | None = None
) -> FloatArray:
    """Return the position of a letter, at a distance ``reach`` from a pin, that is farthest from other shapes.

    If there is no room for a letter at this distance, the position is farther from the pin. ``drawn`` are Shapely
    geometries. Distances from pins and other letters (``marks``) are multiplied by 0.6. Of positions with equal room the one in
    the direction of the vector ``away`` is preferred; the longer ``away``, the greater its weight.
    """
    import shapely

    for far in (1.0, 1.4, 1.8):
        places: FloatArray = pin + far * reach * np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])
        room = shapely.distance(shapely.GeometryCollection(list(drawn)), shapely.points(places))
        for mark in marks:
            room = np.minimum(room, 0.6 * np.hypot(*(places - mark).T))
        if room.max() >= _LETTER * reach:
            break
    if away is not None:
        room = room + (places - pin) @ away
    return places[int(np.argmax(room))]


#: For each kind of text: the function that moves it, and the two lists of places, the best first.
_MOVES: dict[str | None, tuple[Callable[[Annotation, float, Any], Bbox], Sequence[float], Sequence[Any]]] = {
    _GID: (_move_name, _TOPS.tolist(), _SIDES),
    _LABEL: (_move_label, _DISTANCES, _DIRECTIONS.tolist()),
}
