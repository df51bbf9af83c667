"""Draw any planar mechanism from its `Drawing`: links, bearings, guides, springs, and the paths of its points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from linkwork.mechanism import Mechanism, Part
from linkwork.parameters import field_name

from ..linkages import Reach, reach
from ..mechanisms import find_mechanism
from ..run import Trajectory
from .animation import check_frames, gif
from .dispatch import animate, last_samples, plot
from .marks import roomiest_position
from .style import (
    BLOCK,
    COLOURS,
    DOT,
    GROUND,
    HAIR,
    LINE,
    MARKED,
    SMALL,
    THIN,
    TRACE,
    Figure,
    figure_style,
    finish,
    write_title,
)

Array = NDArray[np.float64]
_SIDE = 5.0
#: Number of configurations along a path.
_TRACED = 240


def joint_positions(mechanism: Mechanism, parameters: Any, coordinates: Array) -> dict[str, Array]:
    """Return the positions (mm) of a drawing's joints by name, shape (n, 2), for ``coordinates`` of shape (n, freedoms).

    The positions are NaN at configurations at which the mechanism cannot be assembled.
    """
    drawing = mechanism.drawing
    assert drawing is not None
    p = parameters.constants()
    acting = mechanism.idle_inputs(p)
    found = np.full((len(coordinates), len(drawing.joints), 3), np.nan)
    rest = (0.0,) * (mechanism.size - len(mechanism.freedoms))
    for row, q in zip(found, coordinates):
        try:
            row[:] = np.reshape(drawing.positions((*map(float, q), *rest), acting, p), (-1, 3))
        except (ArithmeticError, ValueError):
            continue
    return {joint.name: 1e3 * found[:, n, :2] for n, joint in enumerate(drawing.joints)}


def draw(
    axis: Axes, mechanism: Mechanism, parameters: Any, positions: dict[str, Array], *, letters: bool = True
) -> None:
    """Draw a mechanism at its first configuration, and the paths of its points over all other configurations.

    ``positions`` are the positions of the joints as `joint_positions` returns them.
    """
    drawing = mechanism.drawing
    assert drawing is not None
    now = {name: path[0] for name, path in positions.items()}
    everything = np.concatenate(list(positions.values()))
    unit = 0.03 * float(np.nanmax(np.ptp(everything[np.isfinite(everything).all(axis=1)], axis=0)))
    for name in drawing.paths:
        axis.plot(*positions[name][1:].T, color=TRACE, linewidth=THIN, zorder=2)
    colours = cycle(COLOURS)
    for part in drawing.parts:
        if not part.where or getattr(parameters, field_name(part.where), 0.0) != 0.0:
            _draw_part(axis, part, [now[name] for name in part.joints], unit, colours)
    shown = {name for part in drawing.parts for name in part.joints if part.kind in ("link", "pivot")} | set(
        drawing.paths
    )
    pins = {joint.name: now[joint.name] for joint in drawing.joints if joint.name in shown and not joint.aid}
    for x, y in pins.values():
        axis.plot(x, y, "o", markersize=DOT, markerfacecolor="white", markeredgecolor=GROUND, zorder=6)
    if letters:
        _write_letters(axis, pins, unit)
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.08)
    axis.set_xlabel("x [mm]")
    axis.set_ylabel("y [mm]")


def _write_letters(axis: Axes, pins: dict[str, Array], unit: float) -> None:
    """Write the name of each pin beside it, where it is farthest from lines, pins and other names."""
    from shapely import LineString

    curves = [np.asarray(line.get_xydata()) for line in axis.lines]
    lines = [LineString(curve) for curve in curves if len(curve) > 1]
    edges = [LineString(patch.get_path().vertices) for patch in axis.patches]
    drawn = [shape for shape in (*lines, *edges) if np.isfinite(shape.bounds).all()]
    taken = list(pins.values())
    for name, pin in pins.items():
        place = roomiest_position(pin, 1.3 * unit, drawn, taken)
        taken.append(place)
        axis.text(
            float(place[0]), float(place[1]), name, fontsize=SMALL, color=MARKED, ha="center", va="center", zorder=7
        )


def _draw_part(axis: Axes, part: Part, through: Sequence[Array], unit: float, colours: Any) -> None:
    """Draw a part; ``through`` are the positions of its joints (mm), ``unit`` the size of symbols (mm)."""
    first, last = through[0], through[-1]
    if part.kind == "link":
        colour = next(colours)
        if len(through) > 2:
            axis.add_patch(
                Polygon(
                    _sort_by_angle(through), facecolor=colour, alpha=0.15, edgecolor=colour, linewidth=THIN, zorder=3
                )
            )
        axis.plot(*np.array(through).T, color=colour, linewidth=2.0 * LINE, solid_capstyle="round", zorder=4)
    elif part.kind == "pivot":
        base = np.array([[0.0, 0.0], [-unit, -1.6 * unit], [unit, -1.6 * unit]])
        axis.add_patch(Polygon(first + base, facecolor="0.85", edgecolor=GROUND, linewidth=THIN, zorder=1))
    elif part.kind in ("guide", "axis"):
        style = "-." if part.kind == "guide" else ":"
        axis.plot(*np.array([first, last]).T, color="0.6", linewidth=HAIR, linestyle=style, zorder=1)
    elif part.kind == "gear":
        # the radius to the second point, and the circle through it
        turns = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 73)) * complex(*(last - first))
        rim = first + np.column_stack([turns.real, turns.imag])
        axis.plot(*np.vstack([first, rim]).T, color="0.5", linewidth=THIN, zorder=2)
    elif part.kind in ("slider", "spring"):
        along = (through[2] - through[1]) / np.linalg.norm(through[2] - through[1])
        across = np.array([-along[1], along[0]])
        if part.kind == "slider":
            signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
            corners = [first + 1.5 * a * unit * along + 0.9 * b * unit * across for a, b in signs]
            axis.add_patch(Polygon(corners, facecolor=BLOCK, edgecolor=GROUND, linewidth=THIN, zorder=3))
        else:
            wave = 0.5 * unit * np.array([0.0, 0.0, *([1.0, -1.0] * 5), 0.0, 0.0])
            coil = first + np.outer(np.linspace(0.0, 5.0 * unit, len(wave)), along) + np.outer(wave, across)
            axis.plot(*coil.T, color="0.5", linewidth=THIN, zorder=2)


def _sort_by_angle(points: Sequence[Array]) -> Array:
    """Return points sorted by their angles about their mean."""
    array = np.array(points)
    spread = array - array.mean(axis=0)
    return array[np.argsort(np.arctan2(spread[:, 1], spread[:, 0]))]


def draw_run(parameters: Any, axis: Axes, run: Trajectory) -> str:
    """Draw a mechanism at the start of a run with the paths of its points, and return the caption."""
    mechanism = find_mechanism(parameters)
    samples, words = last_samples(run)
    names = [freedom.coordinate for freedom in mechanism.freedoms]
    coordinates = np.column_stack([run[name][samples] for name in names])
    chosen = np.unique(np.linspace(0, len(coordinates) - 1, min(len(coordinates), 2000)).astype(int))
    at = joint_positions(mechanism, parameters, coordinates[chosen])
    draw(axis, mechanism, parameters, at)
    drawing = mechanism.drawing
    assert drawing is not None
    return f"{mechanism.title} at the start; paths of {', '.join(drawing.paths)} {words}"


def _swept_coordinates(mechanism: Mechanism, found: Reach) -> Array:
    """Return coordinates (n, freedoms): the start, then the range of the first freedom with all others at their start."""
    known = mechanism.first_set
    rows = np.tile(mechanism.state(known.initial)[: len(mechanism.freedoms)], (_TRACED + 1, 1))
    rows[1:, 0] = np.linspace(found.low, found.high, _TRACED)
    return rows


@plot.register
def plot_scheme(mechanism: Mechanism, *, title: str = "") -> Figure:
    """Draw a planar mechanism at its start, and the paths of its points through the range of its first freedom."""
    known = mechanism.first_set
    with figure_style():
        figure = Figure(figsize=(1.3 * _SIDE, _SIDE))
        axis = figure.add_subplot()
        draw(
            axis,
            mechanism,
            known.parameters,
            joint_positions(mechanism, known.parameters, _swept_coordinates(mechanism, reach(mechanism))),
        )
        write_title(figure, title or mechanism.title)
        return finish(figure)


def plot_schemes(mechanisms: Sequence[Mechanism]) -> Figure:
    """Draw several planar mechanisms at their start, with the paths of their points through the range of the first freedom."""
    columns = 4
    rows = -(-len(mechanisms) // columns)
    with figure_style():
        figure = Figure(figsize=(0.5 * _SIDE * columns, 0.5 * _SIDE * rows))
        for number, mechanism in enumerate(mechanisms):
            axis = figure.add_subplot(rows, columns, number + 1)
            known = mechanism.first_set
            at = joint_positions(mechanism, known.parameters, _swept_coordinates(mechanism, reach(mechanism)))
            draw(axis, mechanism, known.parameters, at, letters=False)
            axis.set_axis_off()
            axis.set_title(mechanism.name, fontsize=SMALL)
        return finish(figure)


@animate.register
def animate_scheme(mechanism: Mechanism, path: str | Path, *, frames: int = 60, title: str = "") -> Path:
    """Write an animation (GIF) of a planar mechanism over the range of its first freedom, back and forth if it cannot turn.

    Raises
    ------
    InputError
        If there are fewer than two frames.
    """
    check_frames(frames)
    known = mechanism.first_set
    found = reach(mechanism)
    swept = _swept_coordinates(mechanism, found)[1:]
    at = joint_positions(mechanism, known.parameters, swept)
    order = np.linspace(0, len(swept) - 1, frames).astype(int)
    if not found.turns:
        order = np.concatenate([order, order[::-1]])
    points = np.concatenate(list(at.values()))
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    room = 0.06 * float((high - low).max())
    with figure_style():
        figure = Figure(figsize=(_SIDE, _SIDE))
        axis = figure.add_subplot()
        with gif(figure, path, 25) as (file, add_frame):
            for number in order:
                axis.clear()
                now = {name: np.concatenate([line[number : number + 1], line]) for name, line in at.items()}
                draw(axis, mechanism, known.parameters, now, letters=False)
                axis.set_aspect("equal", adjustable="box")
                axis.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
                axis.set_title(title or mechanism.title)
                add_frame()
    return file
