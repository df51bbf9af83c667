"""Draw any planar mechanism from its `Drawing`: links, bearings, guides, springs, and the paths of its points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from linkwork.mechanism import Mechanism, Part
from linkwork.parameters import field_name

from ..linkages import Reach, reach
from ..mechanisms import find_mechanism
from ..run import Trajectory
from . import style, symbols
from .animation import check_frames, gif
from .dispatch import animate, last_samples, plot
from .marks import roomiest_position

Array = NDArray[np.float64]
_SIDE = 5.0
#: Colours of links by name; other links have the other colours of curves in turn.
_NAMED = {"crank": style.CRANK, "coupler": style.COUPLER, "rod": style.COUPLER, "rocker": style.ROCKER}
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
    # a rotor has all its joints in one place
    unit = 0.03 * float(np.nanmax(np.ptp(everything[np.isfinite(everything).all(axis=1)], axis=0))) or 1.0
    for name in drawing.paths:
        axis.plot(*positions[name][1:].T, color=style.TRACE, linewidth=style.THIN, zorder=2)
    taken = {style.TRACE, *(_NAMED[part.text] for part in drawing.parts if part.text in _NAMED)}
    others = cycle(colour for colour in dict.fromkeys((*_NAMED.values(), *style.COLOURS)) if colour not in taken)
    drawn = [p for p in drawing.parts if not p.where or getattr(parameters, field_name(p.where), 0.0) != 0.0]
    damped = {part.joints for part in drawn if part.kind == "damper"}
    for part in drawn:
        paths = [positions[name] for name in part.joints]
        if part.kind in ("spring", "damper"):
            alone = part.kind == "spring" and part.joints not in damped
            _draw_suspension(axis, part.kind, paths, unit, 0.0 if alone else 0.55)
        else:
            colour = (_NAMED.get(part.text) or next(others)) if part.kind == "link" else ""
            _draw_part(axis, part, [path[0] for path in paths], unit, colour)
    joined = {name for part in drawing.parts for name in part.joints if part.kind in ("link", "pivot")}
    pins = {
        joint.name: now[joint.name]
        for joint in drawing.joints
        if joint.name in joined | set(drawing.paths) and not joint.aid
    }
    carried = [name for part in drawing.parts if part.kind == "link" for name in part.joints]
    for name, pin in pins.items():
        marked = name in drawing.paths and carried.count(name) < 2
        symbols.draw_pin(axis, pin, unit, style.TRACE if marked else "white", zorder=10.0 if marked else 9.0)
    if letters:
        _write_letters(axis, pins, unit)
    style.use_one_scale(axis)
    axis.margins(0.08)


def _write_letters(axis: Axes, pins: dict[str, Array], unit: float) -> None:
    """Write the name of each pin beside it, where it is farthest from lines, pins and other names."""
    from shapely import LineString

    curves = [np.asarray(line.get_xydata()) for line in axis.lines]
    lines = [LineString(curve) for curve in curves if len(curve) > 1]
    edges = [LineString(patch.get_path().vertices) for patch in axis.patches]
    drawn = [shape for shape in (*lines, *edges) if np.isfinite(shape.bounds).all()]
    taken = list(pins.values())
    look: dict[str, Any] = {"fontsize": style.SMALL, "color": style.MARKED, "ha": "center", "va": "center", "zorder": 7}
    for name, pin in pins.items():
        place = roomiest_position(pin, 1.7 * unit, drawn, taken)
        taken.append(place)
        axis.text(float(place[0]), float(place[1]), name, **look)


def _draw_part(axis: Axes, part: Part, through: Sequence[Array], unit: float, colour: str) -> None:
    """Draw a part; ``through`` are the positions of its joints (mm), ``unit`` the size of symbols (mm)."""
    first, last = through[0], through[-1]
    if part.kind == "link":
        # a shorter link over a longer one, which would hide it in a position in which both lie on a line
        length = float(np.linalg.norm(through[1] - first))
        symbols.draw_link(axis, through, colour, zorder=6.0 + unit / (unit + length))
    elif part.kind == "pivot":
        symbols.draw_bearing(axis, first, unit)
    elif part.kind == "slider":
        symbols.draw_block(axis, first, (last - through[1]) / np.linalg.norm(last - through[1]), unit)
    elif part.kind == "gear":
        # the radius to the second point, and the circle through it
        turns = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 73)) * complex(*(last - first))
        rim = first + np.column_stack([turns.real, turns.imag])
        symbols.draw_line(axis, np.vstack([first, rim]), color="0.5", linewidth=style.THIN, zorder=2)
    else:
        symbols.draw_line(axis, [first, last], **symbols.CENTRE_LINE)


def _draw_suspension(axis: Axes, kind: str, paths: Sequence[Array], unit: float, side: float) -> None:
    """Draw a spring or damper from a block to a wall that the block does not reach.

    ``paths`` are the positions (mm), at all configurations, of the block and of two points; the wall lies in the direction
    from the first point to the second. ``side`` times ``unit`` is the distance of a spring to the left of the block's line
    of motion, and of a damper to the right of it.
    """
    block, start, end = (path[0] for path in paths)
    along = (end - start) / np.linalg.norm(end - start)
    across = unit * np.array([-along[1], along[0]])
    travel = np.nanmax((paths[0] - paths[1]) @ along) - (block - start) @ along
    wall = block + (travel + 8.0 * unit) * along
    symbol, shift = (symbols.draw_spring, side * across) if kind == "spring" else (symbols.draw_damper, -side * across)
    symbol(axis, block + 1.5 * unit * along + shift, wall + shift, unit)
    symbols.draw_line(axis, [wall - 1.3 * across, wall + 1.3 * across], zorder=3)


def draw_at_start(parameters: Any, axis: Axes, run: Trajectory) -> str:
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
    noun = "path" if len(drawing.paths) == 1 else "paths"
    return f"{mechanism.title} at the start; {noun} of {', '.join(drawing.paths)} {words}"


def _swept_positions(mechanism: Mechanism, found: Reach) -> dict[str, Array]:
    """Return positions of the joints: at the start, then over the range of the first freedom with all others at their start."""
    known = mechanism.first_set
    rows = np.tile(mechanism.state(known.initial)[: len(mechanism.freedoms)], (_TRACED + 1, 1))
    rows[1:, 0] = np.linspace(found.low, found.high, _TRACED)
    return joint_positions(mechanism, known.parameters, rows)


@plot.register
@style.figure_style()
def plot_scheme(mechanism: Mechanism, *, title: str = "") -> style.Figure:
    """Draw a planar mechanism at its start, and the paths of its points through the range of its first freedom."""
    figure = style.Figure(figsize=(1.3 * _SIDE, _SIDE))
    at = _swept_positions(mechanism, reach(mechanism))
    draw(figure.add_subplot(), mechanism, mechanism.first_set.parameters, at)
    return style.finish(figure, title or mechanism.title)


@style.figure_style()
def plot_schemes(mechanisms: Sequence[Mechanism]) -> style.Figure:
    """Draw several planar mechanisms at their start, with the paths of their points through the range of the first freedom."""
    columns = 4
    rows = -(-len(mechanisms) // columns)
    figure = style.Figure(figsize=(0.5 * _SIDE * columns, 0.5 * _SIDE * rows))
    for number, mechanism in enumerate(mechanisms):
        axis = figure.add_subplot(rows, columns, number + 1)
        at = _swept_positions(mechanism, reach(mechanism))
        draw(axis, mechanism, mechanism.first_set.parameters, at, letters=False)
        axis.set_axis_off()
        axis.set_title(mechanism.name, fontsize=style.SMALL)
    return style.finish(figure)


@animate.register
@style.figure_style()
def animate_scheme(mechanism: Mechanism, path: str | Path, *, frames: int = 60, title: str = "") -> Path:
    """Write an animation (GIF) of a planar mechanism over the range of its first freedom, back and forth if it cannot turn.

    Raises
    ------
    InputError
        If there are fewer than two frames.
    """
    check_frames(frames)
    found = reach(mechanism)
    at = {name: path[1:] for name, path in _swept_positions(mechanism, found).items()}
    order = np.linspace(0, _TRACED - 1, frames).astype(int)
    if not found.turns:
        order = np.concatenate([order, order[::-1]])
    points = np.concatenate(list(at.values()))
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    room = 0.06 * float((high - low).max())
    figure = style.Figure(figsize=(_SIDE, _SIDE))
    axis = figure.add_subplot()
    with gif(figure, path, 25) as (file, add_frame):
        for number in order:
            axis.clear()
            now = {name: np.concatenate([line[number : number + 1], line]) for name, line in at.items()}
            draw(axis, mechanism, mechanism.first_set.parameters, now, letters=False)
            axis.set_aspect("equal", adjustable="box")
            axis.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
            axis.set_title(title or mechanism.title)
            add_frame()
    return file
