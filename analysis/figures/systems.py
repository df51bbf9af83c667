"""Plot systems of FMUs: block diagram, runs with power residuals, and errors of couplings over the communication step."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.patches import FancyBboxPatch

from ..systems import Convergence, SystemRun, Wiring, boxes
from ..units import display_scale
from . import style
from .dispatch import plot
from .runs import BANDS, draw_over_time, is_fast

#: Clearance of connections from parts, and distance between two connections (mm).
_CLEAR, _LANE = 8.0, 5.0


@plot.register
@style.figure_style()
def plot_wiring(wiring: Wiring, *, title: str = "") -> style.Figure:
    """Draw the block diagram of a system: parts, connected ports, and connections."""
    placed = boxes(wiring)
    lowest = min(box.bottom for box in placed.values())
    width = max(box.right for box in placed.values()) + 60.0
    lanes = len(wiring.connections) * _LANE
    figure = style.Figure(figsize=(max(6.0, width / 30.0), max(2.6, (lanes + 40.0 - lowest) / 28.0)))
    axes = figure.add_subplot()
    for name, box in placed.items():
        size = (box.right - box.left, box.top - box.bottom)
        rounded = "round,pad=0,rounding_size=2"
        look: dict[str, Any] = {"fc": "0.96", "ec": "0.3", "lw": style.THIN, "zorder": 3}
        axes.add_patch(FancyBboxPatch((box.left, box.bottom), *size, boxstyle=rounded, **look))
        axes.text(box.left + 0.5 * size[0], box.top - 5.5, name, ha="center", va="center", weight="bold", zorder=4)
        for ports, x, align in ((box.inputs, box.left + 2.0, "left"), (box.outputs, box.right - 2.0, "right")):
            for port in ports:
                axes.text(x, box.port_height(port), port, ha=align, va="center", fontsize=style.TINY, zorder=4)
    for number, (target, source) in enumerate(wiring.connections.items()):
        start, end = placed[source.part], placed[target.part]
        path = _path(
            (start.right, start.port_height(source.port)), (end.left, end.port_height(target.port)), number, lowest
        )
        colour = style.COLOURS[number % len(style.COLOURS)]
        axes.plot(*zip(*path[:-1]), color=colour, lw=style.LINE)
        for (x, y), (to_x, to_y) in pairwise(path[-2:]):
            axes.annotate("", (to_x, to_y), (x, y), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": style.LINE})
    axes.set_aspect("equal")
    axes.axis("off")
    return style.finish(figure, title or wiring.title)


def _path(
    start: tuple[float, float], end: tuple[float, float], number: int, lowest: float
) -> list[tuple[float, float]]:
    """Return the corners of a connection: directly to a part on the right, otherwise round below all parts.

    ``number`` is the index of the connection, which gives it a lane of its own; ``lowest`` is the lower edge of the parts (mm).
    """
    lane = _CLEAR + _LANE * (number % 9)
    if end[0] > start[0]:
        x = end[0] - lane
        return [start, (x, start[1]), (x, end[1]), end]
    below, right, left = lowest - _CLEAR - _LANE * number, start[0] + lane, end[0] - lane
    return [start, (right, start[1]), (right, below), (left, below), (left, end[1]), end]


@plot.register
@style.figure_style()
def plot_system_run(run: SystemRun, names: Sequence[str] = (), *, title: str = "") -> style.Figure:
    """Plot outputs of a run over time, by default all connected outputs except accelerations, and the power residuals."""
    names = names or [name for name in run.connected if not name.endswith("acceleration")]
    rows = len(names) + bool(run.powers)
    figure = style.Figure(figsize=(7.0, 1.4 + 1.5 * rows))
    axes = np.atleast_1d(figure.subplots(rows, sharex=True))
    for place, name in zip(axes, names):
        unit, factor = display_scale(run.units[name])
        draw_over_time(place, run.time, factor * run.unwrapped(name))
        part, _, output = name.rpartition(".")
        place.set_ylabel(f"{style.name_in_words(part)}\n{style.name_in_words(output)}\n[{unit}]", fontsize=style.SMALL)
    for name, power in run.powers.items():
        draw_over_time(axes[-1], run.time, power, label=f"at {style.name_in_words(name.rpartition('.')[0])}")
    if run.powers:
        axes[-1].set_ylabel("power that the\ncoupling adds\n[W]", fontsize=style.SMALL)
        # above the axes, as the curves fill them
        axes[-1].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=style.TINY, borderaxespad=0.2)
    axes[-1].set_xlabel("time [s]")
    fast = any(is_fast(values) for values in (*(run.unwrapped(name) for name in names), *run.powers.values()))
    return style.finish(figure, title or f"{run.title}, coupling: {run.coupling}", [BANDS] if fast else [])


@plot.register
@style.figure_style()
def plot_convergence(found: Convergence, *, title: str = "") -> style.Figure:
    """Plot the error of each coupling over the communication step; the legend states the order of convergence."""
    figure = style.Figure(figsize=(6.0, 4.2))
    axes = figure.add_subplot()
    for number, (way, errors) in enumerate(found.errors.items()):
        # line styles and marker sizes differ, so that covered curves are visible
        look: dict[str, Any] = {"linestyle": style.LINES[number % len(style.LINES)], "marker": "osD^v"[number % 5]}
        size = 7.0 - min(number, 4)
        label = f"{way}: order {found.order(way):.2f}"
        axes.loglog(found.steps, errors, markersize=size, markerfacecolor="none", label=label, **look)
    axes.set(xlabel="communication step [s]", ylabel="greatest relative error of the connected outputs")
    axes.legend()
    return style.finish(figure, title or found.title)
