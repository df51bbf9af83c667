"""Pictures of rigid-body guidance in closed form: the poses, every dyad and every four-bar, or the curves of four poses.

Lengths are shown in mm, angles in degrees.
"""

from __future__ import annotations

from math import ceil, degrees
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..synthesis import Guidance, GuidanceMap, Solution
from .dispatch import plot
from .style import (
    COLOURS,
    COUPLER,
    CRANK,
    DOT,
    GROUND,
    LETTER,
    LINE,
    ROCKER,
    SMALL,
    TARGET,
    THIN,
    finish,
    styled,
    write_title,
)

MM_PER_METRE = 1e3
#: Arms of the mark of a pose, as a share of the poses' size.
ARM = 0.09
#: Of a four-bar, what is in view: so many times the poses' size about them.
VIEW = 2.2


@plot.register
def plot_guidance(found: Guidance, *, title: str = "") -> Figure:
    """Plot the poses with every dyad, and beside them every four-bar with its defects."""
    count = len(found.solutions)
    columns = min(4, max(1, count))
    rows = max(1, ceil(count / columns)) if count else 0
    with styled():
        figure = Figure(figsize=(9.6, 4.4 + 2.7 * rows))
        parts: Any = figure.subfigures(2, 1, height_ratios=(4.4, 2.7 * rows)) if rows else [figure]
        axis = parts[0].subplots()
        _draw_poses(axis, found)
        for number, dyad in enumerate(found.dyads):
            x, y = _parts(MM_PER_METRE * np.array([dyad.pivot, dyad.point], dtype=complex))
            colour = COLOURS[number % len(COLOURS)]
            axis.plot(x, y, linewidth=LINE, zorder=4, color=colour, label=f"dyad {number + 1}")
            axis.plot(x[0], y[0], "^", markersize=7.0, zorder=5, color=colour)
            axis.plot(x[1], y[1], "o", markersize=DOT, zorder=5, color=colour, markerfacecolor="white")
        if found.dyads:
            axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="pivot, point in pose 1")
        axis.set_title(found.describe())
        _to_scale(axis)
        if rows:
            panels = parts[1].subplots(rows, columns, squeeze=False).ravel()
            for panel, (number, solution) in zip(panels, enumerate(found.solutions, start=1)):
                _draw_four_bar(panel, solution, found)
                panel.set_title(f"{number}: {_verdict(solution)}", fontsize=SMALL)
            for panel in panels[count:]:
                panel.set_visible(False)
        write_title(figure, title)
        return finish(figure)


@plot.register
def plot_guidance_map(found: GuidanceMap, *, title: str = "") -> Figure:
    """Plot the poses with the curves of pivots and points, the best linkage, and the pairs of dyads that are sound."""
    with styled():
        figure = Figure(figsize=(10.4, 4.8))
        left, right = figure.subplots(1, 2)
        _draw_poses(left, found)
        for curve, colour, label in (
            (found.pivots, GROUND, "pivots"),
            (found.points, COUPLER, "points of the body in pose 1"),
        ):
            left.plot(*_parts(MM_PER_METRE * curve), ".", markersize=2.0, color=colour, zorder=2, label=label)
        if found.solutions:
            _draw_links(left, found.solutions[0])
        _to_scale(left)
        low, high = _view(found)
        left.set_aspect("equal", adjustable="box")
        left.set_xlim(low.real, high.real)
        left.set_ylim(low.imag, high.imag)
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        shown = np.ma.masked_where(~found.sound, np.degrees(found.transmission))
        image = right.imshow(shown, origin="lower", aspect="auto", cmap="viridis", interpolation="nearest")
        figure.colorbar(image, ax=right, label="least transmission angle on the way [deg]")
        right.set_xlabel("dyad that is the rocker")
        right.set_ylabel("dyad that is the crank")
        right.set_title(f"{int(found.sound.sum())} of {found.sound.size - len(found.sound)} pairs are sound")
        right.grid(False)
        write_title(figure, title)
        return finish(figure)


def _parts(z: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return z.real, z.imag


def _poses(found: Guidance | GuidanceMap) -> tuple[NDArray[np.complex128], NDArray[np.float64], float]:
    """Return places (mm), directions (rad) and the size of the poses (mm)."""
    points = MM_PER_METRE * np.asarray(found.task.points)
    return points @ np.array([1.0, 1j]), np.asarray(found.task.angle), float(np.hypot(*np.ptp(points, axis=0)))


def _view(found: Guidance | GuidanceMap) -> tuple[complex, complex]:
    places, _, size = _poses(found)
    middle = complex(np.mean(places))
    return middle - 0.5 * VIEW * size * (1 + 1j), middle + 0.5 * VIEW * size * (1 + 1j)


def _draw_poses(axis: Axes, found: Guidance | GuidanceMap) -> None:
    """Draw each pose as a mark with a long arm along the body and a short one across, with its number."""
    places, angles, size = _poses(found)
    for number, (place, angle) in enumerate(zip(places, angles), start=1):
        along = ARM * size * np.exp(1j * angle)
        mark = place + np.array([along, 0.0, 0.5j * along])
        axis.plot(*_parts(mark), color=TARGET, linewidth=2.2, zorder=3, solid_joinstyle="miter")
        beside = place - 0.45 * (along + 1j * along)
        axis.text(beside.real, beside.imag, str(number), ha="center", va="center", fontsize=LETTER, zorder=6)


def _draw_links(axis: Axes, solution: Solution) -> None:
    """Draw the links in the first pose."""
    assert solution.evaluation.rotation is not None
    pins = {
        name: MM_PER_METRE * complex(*place)
        for name, place in solution.linkage.pins(float(solution.evaluation.rotation[0])).items()
    }
    for ends, colour in (("AB", CRANK), ("BC", COUPLER), ("DC", ROCKER)):
        axis.plot(*_parts(np.array([pins[n] for n in ends])), color=colour, linewidth=2.4, zorder=6)
    axis.plot(*_parts(np.array([pins[n] for n in "BPC"])), color=COUPLER, linewidth=THIN, zorder=6)
    axis.plot(*_parts(np.array([pins[n] for n in "AD"])), "^", color=GROUND, markersize=6.0, zorder=7)


def _draw_four_bar(axis: Axes, solution: Solution, found: Guidance) -> None:
    _draw_poses(axis, found)
    _draw_links(axis, solution)
    axis.set_aspect("equal", adjustable="datalim")
    axis.tick_params(labelsize=7.0)


def _verdict(solution: Solution) -> str:
    v = solution.verdicts
    angle = degrees(min(v.least_transmission, np.pi - v.greatest_transmission))
    wrong = ", ".join(defect.removesuffix(" defect") for defect in v.defects)
    return f"{v.grashof}\n" + (f"defects: {wrong}" if wrong else f"sound, {angle:.0f} deg from a dead centre")


def _to_scale(axis: Axes) -> None:
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("x [mm]")
    axis.set_ylabel("y [mm]")
