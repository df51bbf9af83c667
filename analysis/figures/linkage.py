"""Draw the five-bar: a picture at one configuration, and an animation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, hypot, sin
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc
from numpy.typing import ArrayLike, NDArray
from shapely import MultiLineString, Polygon

from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import FiveBarParameters

from ..run import Trajectory
from ..units import CM_PER_METRE
from . import style, symbols
from .animation import check_frames, gif
from .dispatch import last_samples, plot
from .marks import roomiest_position

#: Least angle (deg) between the letter of the crank angle and the ground link, so that the crank does not cover it.
_LEAST_TURN = 32.0
#: Number of samples of a run that must fit in its picture.
_FRAMED = 200


@dataclass(frozen=True, slots=True)
class _Pins:
    """Positions of the pins (cm), crank angle (rad) and slider position u (cm) at one configuration."""

    b: NDArray[np.float64]
    c: NDArray[np.float64]
    d: NDArray[np.float64]
    p: NDArray[np.float64]
    crank_angle: float
    u: float


def _pins(parameters: FiveBarParameters, crank_angle: float, slider_position: float) -> _Pins:
    """Return the positions of the pins; raise AssemblyError if the links cannot be joined there."""
    k = parameters.constants()
    try:
        g = kinematics.position(crank_angle, slider_position, k)
    except (ValueError, ZeroDivisionError):
        raise AssemblyError(
            f"the links cannot be joined at crank angle {crank_angle:.9g} rad and slider position "
            f"{slider_position:.9g} m: there is nothing to draw"
        ) from None
    b = k.l2 * np.array([g.c2, g.s2])
    return _Pins(
        b=CM_PER_METRE * b,
        c=CM_PER_METRE * (b + k.l3 * np.array([g.c3, g.s3])),
        d=CM_PER_METRE * np.array([k.l1 + slider_position * k.ca, slider_position * k.sa]),
        p=CM_PER_METRE * np.array(kinematics.coupler_point(g, k)),
        crank_angle=crank_angle,
        u=CM_PER_METRE * slider_position,
    )


class _Scene:
    """A mechanism to be drawn at several configurations, with axis limits that contain all of them; lengths in cm."""

    def __init__(
        self, parameters: FiveBarParameters, configurations: Sequence[_Pins], letter: float = style.LETTER
    ) -> None:
        self.parameters, self.letter = parameters, letter
        k = parameters.constants()
        #: Length that scales pins, supports and letters.
        self.unit = CM_PER_METRE * (k.l1 + k.l3 + k.l4) / 45.0
        self.along = np.array([k.ca, k.sa])
        self.left = np.array([-k.sa, k.ca])
        self.zero = np.array([CM_PER_METRE * k.l1, 0.0])
        self.least = min(0.0, *(q.u for q in configurations))
        self.most = max(0.0, *(q.u for q in configurations))
        #: Whether there is a spring and a damper, and the position of the wall that holds them, from the slider's zero.
        self.sprung = k.k > 0.0
        self.damped = k.mu > 0.0
        self.wall = self.most + 8.0 * self.unit
        held = self.sprung or self.damped
        end = self.wall + 1.0 * self.unit if held else self.most + 3.5 * self.unit
        rail = self.least - 3.0 * self.unit, self.wall if held else self.most + 3.0 * self.unit
        #: The ends of the guide, below the slider.
        self.rail = self.point(rail[0], -self.unit), self.point(rail[1], -self.unit)
        corners = [
            self.point(s, n) for s in (self.least - 3.5 * self.unit, end) for n in (-3.2 * self.unit, 1.7 * self.unit)
        ]
        reach = CM_PER_METRE * k.l2
        crank = [np.array([x, y]) for x in (-reach, reach) for y in (-reach, reach)]
        points = np.array(crank + corners + [point for q in configurations for point in (q.b, q.c, q.d, q.p)])
        self.low, self.high = points.min(axis=0) - 1.4 * self.unit, points.max(axis=0) + 1.4 * self.unit

    def point(self, s: float, n: float) -> NDArray[np.float64]:
        """Return the point at a distance s along the guide from the slider's zero, and n to the left of the guide (cm)."""
        return self.zero + s * self.along + n * self.left

    def draw(self, axis: Axes, q: _Pins, *, letters: bool = True, trace: NDArray[np.float64] | None = None) -> None:
        """Draw the whole mechanism at one configuration; ``trace`` is the path of P in cm, shape (n, 2)."""
        self._ground(axis)
        if trace is not None and len(trace):
            axis.plot(*trace.T, color=style.TRACE, linewidth=style.LINE, zorder=2, solid_capstyle="round")
        self._slider(axis, q)
        self._links(axis, q)
        if letters:
            self._letters(axis, q)

    def _ground(self, axis: Axes) -> None:
        symbols.draw_line(axis, [np.zeros(2), self.zero], **symbols.CENTRE_LINE)
        symbols.draw_bearing(axis, np.zeros(2), self.unit)
        # the guide, below the slider, and the wall at its end
        symbols.draw_ground(axis, *self.rail, self.unit, zorder=1)
        if self.sprung or self.damped:
            symbols.draw_ground(
                axis, self.point(self.wall, -self.unit), self.point(self.wall, 1.5 * self.unit), self.unit
            )

    def _slider(self, axis: Axes, q: _Pins) -> None:
        unit, start = self.unit, q.u + 1.5 * self.unit
        symbols.draw_block(axis, self.point(q.u, 0.0), self.along, unit)
        side = 0.55 * unit if self.sprung and self.damped else 0.0
        if self.sprung:
            symbols.draw_spring(axis, self.point(start, side), self.point(self.wall, side), unit)
        if self.damped:
            symbols.draw_damper(axis, self.point(start, -side), self.point(self.wall, -side), unit)

    def _links(self, axis: Axes, q: _Pins) -> None:
        a, traced = np.zeros(2), bool(self.parameters.coupler_point_distance)
        symbols.draw_link(axis, [q.d, q.c], style.ROCKER, zorder=5)
        symbols.draw_link(axis, [q.b, q.c, *([q.p] if traced else [])], style.COUPLER)
        symbols.draw_link(axis, [a, q.b], style.CRANK, zorder=7)
        for pin in (a, q.b, q.c, q.d):
            symbols.draw_pin(axis, pin, self.unit)
        if traced:
            symbols.draw_pin(axis, q.p, self.unit, style.TRACE, zorder=10)

    def _letters(self, axis: Axes, q: _Pins) -> None:
        unit = self.unit
        side = -1.0 if (q.c - q.d) @ self.along > 0.0 else 1.0
        self._write(axis, q.d + 0.95 * side * unit * self.along, "D")
        # the crank angle
        turn = np.degrees(q.crank_angle) % 360.0
        radius = max(0.5 * CM_PER_METRE * self.parameters.crank_length, 1.3 * unit)
        arc: dict[str, Any] = {"color": style.GROUND, "linewidth": style.THIN, "zorder": 3}
        taken: list[NDArray[np.float64]] = []
        if turn > 1.0:
            axis.add_patch(Arc((0, 0), 2 * radius, 2 * radius, theta1=0.0, theta2=turn, **arc))
            half = np.radians(max(0.5 * turn, _LEAST_TURN))
            taken.append((radius + 0.95 * unit) * np.array([cos(half), sin(half)]))
            self._write(axis, taken[0], r"$\theta_2$")
        # each pin's letter goes to the place with most room
        centre = (q.b + q.c + q.d) / 3.0
        a = np.zeros(2)
        foot = np.array([0.0, -2.0 * unit])
        links = [(a, q.b), (q.b, q.c), (q.c, q.d), (q.b, q.p), (q.c, q.p)]
        lines = MultiLineString([*links, (a, foot), (a, self.zero), self.rail])
        block = Polygon(symbols.block_corners(self.point(q.u, 0.0), self.along, unit))
        pins = {"A": a, "B": q.b, "C": q.c} | ({"P": q.p} if self.parameters.coupler_point_distance else {})
        for name, pin in pins.items():
            # of places with equal room one outside the loop is preferred
            outwards = 0.1 * (pin - centre) / max(hypot(*(pin - centre)), 1e-9)
            best = roomiest_position(pin, 1.15 * unit, [lines, block], (*taken, *pins.values()), outwards)
            self._write(axis, best, name)
            taken.append(best)
        # the slider position
        level = -2.35 * unit
        for s in {0.0, q.u}:
            symbols.draw_line(
                axis, [self.point(s, -1.75 * unit), self.point(s, level - 0.4 * unit)], linewidth=style.HAIR
            )
        if abs(q.u) > 1.2 * unit:
            arrow = {"arrowstyle": "-|>", "color": style.GROUND, "shrinkA": 0, "shrinkB": 0, "linewidth": style.HAIR}
            axis.annotate("", tuple(self.point(q.u, level)), tuple(self.point(0.0, level)), arrowprops=arrow)
        slope = (np.degrees(self.parameters.slider_guide_angle) + 90.0) % 180.0 - 90.0
        place = self.point(0.5 * q.u, level - 1.05 * unit)
        self._write(
            axis,
            place,
            f"$u = {10.0 * q.u:.1f}$ mm",
            fontsize=0.86 * self.letter,
            rotation=slope,
            rotation_mode="anchor",
        )

    def _write(self, axis: Axes, point: NDArray[np.float64], words: str, **options: Any) -> None:
        look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": self.letter, "zorder": 11}
        axis.text(point[0], point[1], words, **look | options)


@plot.register
@style.figure_style()
def draw_linkage(
    parameters: FiveBarParameters,
    crank_angle: float,
    slider_position: float,
    *,
    title: str = "",
    trace: ArrayLike | None = None,
) -> style.Figure:
    """Draw the five-bar at one configuration: links, pins, guide, spring, damper, coupler point, crank angle, slider position.

    Parameters
    ----------
    parameters : FiveBarParameters
    crank_angle, slider_position : float
        Crank angle (rad) and slider position (m).
    title : str
    trace : array_like, shape (n, 2), optional
        A path of the coupler point P (m), such as an arc of `analysis.youssef.coupler_curve`.

    Raises
    ------
    AssemblyError
        If the links cannot be joined there.
    """
    q = _pins(parameters, crank_angle, slider_position)
    path = CM_PER_METRE * (np.empty((0, 2)) if trace is None else np.asarray(trace, dtype=float))
    scene = _Scene(parameters, [q, *(replace(q, p=point) for point in path if np.all(np.isfinite(point)))])
    width, height = scene.high - scene.low
    figure = style.Figure(figsize=(6.4, 6.4 * height / width + (0.3 if title else 0.0)))
    axis = figure.subplots()
    style.frame_drawing(axis, scene.low, scene.high)
    scene.draw(axis, q, trace=path)
    if title:
        axis.set_title(title, fontsize=style.TITLE, fontweight="bold")
    return style.finish(figure)


def draw_at_start(parameters: FiveBarParameters, axis: Axes, run: Trajectory) -> str:
    """Draw a five-bar at the start of a run with the path of P, or of C if P coincides with B; return the caption."""
    shown = np.linspace(0, len(run) - 1, min(len(run), _FRAMED)).astype(int)
    configurations = [_pins(parameters, run["crank.angle"][i], run["slider.position"][i]) for i in shown]
    if parameters.coupler_point_distance:
        name, path = "P", CM_PER_METRE * np.column_stack([run["coupler.point.x"], run["coupler.point.y"]])
    else:
        k, turned, tilted = parameters.constants(), run["crank.angle"], run["coupler.angle"]
        x, y = (k.l2 * f(turned) + k.l3 * f(tilted) for f in (np.cos, np.sin))
        name, path = "C", CM_PER_METRE * np.column_stack([x, y])
    scene = _Scene(parameters, configurations, style.SMALL)
    style.frame_drawing(axis, scene.low, scene.high)
    samples, when = last_samples(run)
    scene.draw(axis, configurations[0], trace=path[samples])
    return f"at {run.time[0]:.4g} s, with the path of {name} {when}"


@style.figure_style()
def animate_linkage(
    parameters: FiveBarParameters,
    trajectory: Trajectory,
    path: str | Path,
    *,
    frames: int = 60,
    frames_per_second: int = 20,
    title: str = "",
) -> Path:
    """Write a GIF of a run: the moving linkage with the trace of P, and below it the slider position over time.

    Parameters
    ----------
    parameters : FiveBarParameters
        The mechanism of the run.
    trajectory : Trajectory
        At least two samples; the frames are its samples nearest to evenly spaced times.
    path : str or Path
        Path of the GIF.
    frames : int
        Number of frames, at most one per sample.

    Raises
    ------
    InputError
        If the run has fewer than two samples or there are fewer than two frames.
    """
    check_frames(frames)
    if len(trajectory) < 2:
        raise InputError(f"an animation of {len(trajectory)} samples: there must be at least 2")
    time, slides = trajectory.time, trajectory["slider.position"]
    u = 1e3 * slides
    trace = CM_PER_METRE * np.column_stack([trajectory["coupler.point.x"], trajectory["coupler.point.y"]])
    chosen = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], frames)).clip(0, len(time) - 1))
    configurations = [_pins(parameters, float(trajectory["crank.angle"][i]), float(slides[i])) for i in chosen]
    scene = _Scene(parameters, configurations)
    width, height = scene.high - scene.low
    figure = style.Figure(figsize=(5.0, 5.0 * height / width + 1.9))
    above, below = figure.subplots(2, 1, height_ratios=(5.0 * height / width, 1.7))
    style.write_title(figure, title)
    below.plot(time, u, color="0.8")
    (done,) = below.plot([], [], color=style.SLIDER)
    (dot,) = below.plot([], [], "o", color=style.SLIDER, markersize=style.DOT)
    below.set_xlabel("time [s]")
    below.set_ylabel("slider position [mm]")
    with gif(figure, path, frames_per_second) as (file, add_frame):
        for i, q in zip(chosen, configurations):
            above.clear()
            style.frame_drawing(above, scene.low, scene.high)
            scene.draw(above, q, letters=False, trace=trace[: i + 1])
            done.set_data(time[: i + 1], u[: i + 1])
            dot.set_data(time[i : i + 1], u[i : i + 1])
            add_frame()
    return file
