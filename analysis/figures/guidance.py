"""Plot rigid-body guidance in closed form: the poses with every dyad and four-bar, or the Burmester curves of four poses.

Lengths are shown in mm, angles in degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, degrees
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from ..synthesis import Dyad, Guidance, GuidanceMap, Solution
from . import style
from .dispatch import plot
from .marks import label_place, place_marks

MM_PER_METRE = 1e3
#: Length of the long arm that marks a pose, relative to the size of the poses.
ARM = 0.09
#: Least length of the long arm in a picture with curves, relative to the width of the view.
_ARM_IN_VIEW = 0.045
#: Width of the view about the poses, relative to their size.
VIEW = 2.2


@plot.register
@style.figure_style()
def plot_guidance(found: Guidance, *, title: str = "") -> Figure:
    """Plot the poses with all dyads that guide the body through them; in panels below, plot the four-bars and their defects.

    Each four-bar consists of two of the dyads.
    """
    count = len(found.solutions)
    columns = 3
    rows = ceil(count / columns)
    figure = Figure(figsize=(9.0, 4.0 + 3.2 * rows))
    parts: Any = figure.subfigures(2, 1, height_ratios=(4.0, 3.2 * rows)) if rows else [figure]
    poses, axis = parts[0].subplots(1, 2)
    _draw_poses(poses, found, numbered=True)
    poses.margins(0.15)
    poses.set_title("the poses: a long arm along the body, a short one across")
    style.use_one_scale(poses)
    _draw_poses(axis, found)
    for dyad, colour in zip(found.dyads, style.COLOURS):
        x, y = _parts(MM_PER_METRE * np.array([dyad.pivot, dyad.point], dtype=complex))
        axis.plot(x, y, linewidth=2.4, zorder=4, color=colour)
        axis.plot(x[0], y[0], "^", markersize=7.0, zorder=5, color=colour)
        axis.plot(x[1], y[1], "o", markersize=style.DOT, zorder=5, color=colour, markerfacecolor="white")
    axis.set_title("links between a fixed pivot (triangle)\nand a point of the body (circle), in pose 1")
    style.use_one_scale(axis)
    if rows:
        panels = parts[1].subplots(rows, columns, squeeze=False).ravel()
        for panel, (number, solution) in zip(panels, enumerate(found.solutions, start=1)):
            _draw_poses(panel, found)
            _draw_links(panel, solution, found.dyads)
            panel.set_aspect("equal", adjustable="datalim")
            panel.set_title(f"{number}: {_verdict(solution)}", fontsize=style.SMALL)
        for panel in panels[count:]:
            panel.set_visible(False)
    said = "Thick: the crank, in the colour of its link above. Thin triangle: the body with its point. Lengths in mm."
    return place_marks(style.finish(figure, f"{title}: {found.describe()}".removeprefix(": "), [said]))


@plot.register
@style.figure_style()
def plot_guidance_map(found: GuidanceMap, *, title: str = "") -> Figure:
    """Plot the curves of fixed pivots and body points with the best linkage, and beside them the quality of each crank pivot.

    The quality is the least transmission angle of the four-bar with this crank and the rocker that is best for it.
    """
    figure = Figure(figsize=(10.4, 5.4))
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    low, high = _view(found)
    _draw_poses(left, found, numbered=True, arm=_ARM_IN_VIEW * (high - low).real)
    for curve, colour, label in (
        (found.pivots, style.GROUND, "where a fixed pivot can be"),
        (found.points, style.TRACE, "where its point of the body is in pose 1"),
    ):
        left.plot(*_parts(MM_PER_METRE * curve), ".", markersize=3.0, color=colour, zorder=2, label=label)
    if found.solutions:
        _draw_links(left, found.solutions[0], named=True)
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    best = np.degrees(np.where(found.sound, found.transmission, 0.0).max(axis=1, initial=0.0))
    x, y = _parts(MM_PER_METRE * found.pivots)
    right.plot(x[best <= 0.0], y[best <= 0.0], ".", markersize=3.0, color="0.75", label="with a defect")
    order = np.argsort(best)[np.count_nonzero(best <= 0.0) :]
    dots = right.scatter(x[order], y[order], c=best[order], s=16.0, cmap="viridis", zorder=4)
    if found.solutions:
        a = MM_PER_METRE * np.array(found.solutions[0].linkage.pins(0.0)["A"])
        right.plot(
            *a, "o", markersize=13.0, markerfacecolor="none", color=style.CRANK, zorder=5, label="best, as on the left"
        )
    right.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    scale = right.inset_axes((1.03, 0.0, 0.05, 1.0))
    figure.colorbar(dots, cax=scale, label="pivot of the crank: least transmission angle\nwith the best rocker [deg]")
    scale.grid(False)
    for axis in (left, right):
        style.use_one_scale(axis, "box")
        axis.set(xlim=(low.real, high.real), ylim=(low.imag, high.imag))
    number = f"{int(found.sound.sum())} of {found.sound.size - len(found.sound)} pairs of links are sound four-bars"
    return place_marks(style.finish(figure, f"{title}: {number}".removeprefix(": ")))


def _parts(z: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return z.real, z.imag


def _poses(found: Guidance | GuidanceMap) -> tuple[NDArray[np.complex128], NDArray[np.float64], float]:
    """Return positions of the poses (complex, mm), their angles (rad), and the diagonal of the box around them (mm)."""
    points = MM_PER_METRE * np.asarray(found.task.points)
    return points @ np.array([1.0, 1j]), np.asarray(found.task.angle), float(np.hypot(*np.ptp(points, axis=0)))


def _view(found: GuidanceMap) -> tuple[complex, complex]:
    """Return the lower left and upper right corners (complex, mm) of a square around the poses and the best linkage's pins."""
    places, _, size = _poses(found)
    middle = complex(np.mean(places))
    held = [middle - 0.5 * VIEW * size * (1 + 1j), middle + 0.5 * VIEW * size * (1 + 1j)]
    if found.solutions:
        held += _pins(found.solutions[0]).values()
    low, high = (complex(end(z.real for z in held), end(z.imag for z in held)) for end in (min, max))
    half = 0.53 * max((high - low).real, (high - low).imag) * (1 + 1j)
    return 0.5 * (low + high) - half, 0.5 * (low + high) + half


def _draw_poses(axis: Axes, found: Guidance | GuidanceMap, *, numbered: bool = False, arm: float = 0.0) -> None:
    """Draw each pose as two arms at a right angle: a long arm along the body, at least ``arm`` mm long, and a short one."""
    places, angles, size = _poses(found)
    for number, (place, angle) in enumerate(zip(places, angles), start=1):
        along = max(arm, ARM * size) * np.exp(1j * angle)
        mark = place + np.array([along, 0.0, 0.5j * along])
        name = "pose, its long arm along the body" if numbered and number == 1 else None
        axis.plot(*_parts(mark), color=style.TARGET, linewidth=2.2, zorder=3, solid_joinstyle="miter", label=name)
        if numbered:
            label_place(axis, (place.real, place.imag), str(number))


def _pins(solution: Solution) -> dict[str, complex]:
    """Return the pins of a four-bar in the first pose, by name (complex, mm)."""
    assert solution.evaluation.rotation is not None
    pins = solution.linkage.pins(float(solution.evaluation.rotation[0]))
    return {name: MM_PER_METRE * complex(*place) for name, place in pins.items()}


def _draw_links(axis: Axes, solution: Solution, dyads: Sequence[Dyad] = (), *, named: bool = False) -> None:
    """Draw the links in the first pose; the crank is a thick line.

    If ``dyads`` are given, crank and rocker have the colours of their dyads; if ``named`` is true, the links have entries in
    the legend.
    """
    names = ("crank", "rocker", "body with its point, pose 1", "fixed pivots") if named else (None,) * 4
    pins = _pins(solution)
    pivots = np.array([MM_PER_METRE * dyad.pivot for dyad in dyads])
    for ends, colour, width, name in (("AB", style.CRANK, 4.0, names[0]), ("DC", style.ROCKER, 2.0, names[1])):
        if len(pivots):
            colour = style.COLOURS[int(np.abs(pivots - pins[ends[0]]).argmin()) % len(style.COLOURS)]
        axis.plot(*_parts(np.array([pins[n] for n in ends])), color=colour, linewidth=width, zorder=6, label=name)
    corners = np.column_stack(_parts(np.array([pins[n] for n in "BPC"])))
    axis.add_patch(Polygon(corners, facecolor="0.5", alpha=0.15, zorder=4, label=names[2]))
    axis.plot(*_parts(np.array([pins[n] for n in "BPCB"])), color=style.SLIDER, linewidth=style.THIN, zorder=5)
    axis.plot(
        *_parts(np.array([pins[n] for n in "AD"])), "^", color=style.GROUND, markersize=6.0, zorder=7, label=names[3]
    )


def _verdict(solution: Solution) -> str:
    v = solution.verdicts
    wrong = ", ".join(defect.removesuffix(" defect") for defect in v.defects)
    return f"{v.grashof}\n" + (
        f"defects: {wrong}" if wrong else f"sound, {degrees(v.transmission_margin):.0f} deg from a dead centre"
    )
