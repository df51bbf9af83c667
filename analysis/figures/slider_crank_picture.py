"""Draw the generalised slider-crank: a picture in space, an animation, and its range of assembly.

The projection is orthographic, with the common normal of crank axis and guide upright. Solids are painted face by face from
back to front; centre lines, paths and frames are lines under or over them. Texts are put where there is room for them, so
that they can be read for any dimensions.

Matplotlib's mplot3d could paint the faces too, but it leaves wide margins, and points must be projected here anyway to fill
the sheet and to place the texts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, cos, degrees, isfinite, pi, radians, sin
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import textalloc
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError
from linkwork.slider_crank import kinematics
from linkwork.slider_crank.assembly import check_assembly
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.vectors import Vector

from ..run import Trajectory
from ..slider_crank import PeriodicShift, Range, assembled_ranges, constant_shift, ranges
from ..units import INCH
from . import style
from .animation import check_frames, gif
from .dispatch import animate, last_samples, plot
from .solids import ball, box, cylinder, paint

FloatArray: TypeAlias = NDArray[np.float64]

#: Number of units in a metre, for each unit of a picture.
UNITS = {"mm": 1e3, "cm": 1e2, "m": 1.0, "in": 1.0 / INCH}
#: Elevation and azimuth (deg) from which shift, offset and twist are visible, with the slider to the right of the crank.
VIEW = (22.0, -112.0)
#: Number of crank angles of a full turn at which paths and curves are computed.
_POINTS = 361
#: Distance of the first and last drawn angle from the ends of a range (rad): rounding could make a square root negative there.
_INSET = 1e-6
_DEAD, _LIMIT, _SHIFT, _TWIST = style.COLOURS[2], "#B07700", "#A0527F", "#2478A8"


@dataclass(frozen=True, slots=True)
class _Pose:
    """Crank angle (rad), slider position and positions of the joints at one configuration, in the picture's unit."""

    angle: float
    slide: float
    centre: FloatArray
    crank_pin: FloatArray
    slider_pin: FloatArray


def _pose(parameters: SliderCrankParameters, angle: float, shift: float, factor: float) -> _Pose:
    p = parameters.constants()
    q = kinematics.position(angle, shift, p)
    return _Pose(
        angle,
        factor * q.s4,
        factor * np.array([0.0, 0.0, shift]),
        factor * np.array(kinematics.crank_pin(q, shift, p)),
        factor * np.array(kinematics.slider_pin(q, p)),
    )


def _angles(part: Range, law: PeriodicShift) -> FloatArray:
    """Return crank angles (rad) over a range of assembly, slightly inside its ends unless it is a full turn."""
    inset = min(_INSET, 0.25 * (part.high - part.low)) if not part.full(law.span) else 0.0
    count = max(9, ceil(_POINTS * (part.high - part.low) / (2.0 * pi)))
    return np.linspace(part.low + inset, part.high - inset, count)


def _factor(unit: str) -> float:
    if unit not in UNITS:
        raise InputError(f"the unit of a picture is {unit!r}: it must be one of {', '.join(UNITS)}")
    return UNITS[unit]


@dataclass(frozen=True, slots=True)
class _Part:
    """Poses and paths of the pins over a run or a range of assembly, with dead centres and with limits, if there are any."""

    poses: Sequence[_Pose]
    crank_pins: FloatArray
    slider_pins: FloatArray
    dead: Sequence[_Pose] = ()
    limits: Sequence[_Pose] = ()

    @property
    def angles(self) -> FloatArray:
        return np.array([pose.angle for pose in self.poses])

    @property
    def marks(self) -> list[tuple[_Pose, str, str, str]]:
        """Return the marked poses, dead centres and limits of assembly, as (pose, name, colour, marker)."""
        dead = [(pose, "dead centre", _DEAD, "D") for pose in self.dead]
        return dead + [(pose, "limit", _LIMIT, "s") for pose in self.limits]


def _parts(parameters: SliderCrankParameters, law: PeriodicShift, factor: float) -> list[_Part]:
    """Return the ranges of assembly, with lengths multiplied by ``factor``."""
    found = []
    for part in ranges(parameters, law):
        poses = [_pose(parameters, float(a), law.at(float(a))[0], factor) for a in _angles(part, law)]
        crank, slider = (np.array(pins) for pins in zip(*((pose.crank_pin, pose.slider_pin) for pose in poses)))
        dead = [_pose(parameters, d.crank_angle, d.shift, factor) for d in part.dead_centres]
        found.append(_Part(poses, crank, slider, dead, [] if part.full(law.span) else [poses[0], poses[-1]]))
    return found


class _Label(NamedTuple):
    """A text to be placed near a point in space."""

    point: FloatArray
    text: str
    colour: str = "black"
    size: float = 8.5


class _Scene:
    """The mechanism in space with the paths of its pins, drawn at one configuration after another. Lengths in ``unit``."""

    def __init__(
        self,
        parameters: SliderCrankParameters,
        parts: Sequence[_Part],
        poses: Sequence[_Pose],
        unit: str,
        view: tuple[float, float],
    ) -> None:
        self.parameters, self.unit = parameters, unit
        factor = _factor(unit)
        p = parameters.constants()
        self.a1, self.a2, self.a4 = factor * p.a1, factor * p.a2, factor * p.a4
        self.parts = parts
        #: Length that scales joints, supports and distances of texts.
        self.size = (self.a1 + self.a2 + abs(self.a4)) / 26.0
        #: Rows: i, j, k of frame 4.
        self.frame4 = np.array([kinematics.from_guide_frame(Vector(*row), p) for row in np.eye(3)])
        self.foot = np.array([-self.a4, 0.0, 0.0])
        everywhere = [*poses, *(pose for part in self.parts for pose in part.poses)]
        self.least = min(pose.slide for pose in everywhere)
        self.most = max(pose.slide for pose in everywhere)
        self.low_shift = float(min(0.0, *(pose.centre[2] for pose in everywhere)))
        self.high_shift = float(max(0.0, *(pose.centre[2] for pose in everywhere)))
        #: Sign along i of frame 4: the slider is on the side of its pin that is away from the crank.
        self.side = -1.0 if self.a4 >= 0.0 else 1.0
        rise, turn = radians(view[0]), radians(view[1])
        towards = np.array([sin(rise), cos(rise) * cos(turn), cos(rise) * sin(turn)])
        right = np.array([0.0, -sin(turn), cos(turn)])
        #: Rows: right and up on the page, and towards the eye, in the ground frame.
        self.view = np.array([right, np.cross(towards, right), towards])
        self.low, self.high = self._extent()
        #: Points (n, 2) and lines (2, n) on the page that texts must not cover.
        self.covered = np.empty((0, 2))
        self.lines: list[FloatArray] = []

    def guide_point(self, slide: float, x: float = 0.0) -> FloatArray:
        """Return the point (3,), in the ground frame, at a slider position, displaced by x along i of frame 4."""
        return np.asarray(self.foot + np.array([x, 0.0, -slide]) @ self.frame4)

    def page(self, points: ArrayLike) -> FloatArray:
        """Project points (..., 3) of the ground frame onto the page, (..., 2)."""
        return np.asarray(np.asarray(points, dtype=float) @ self.view[:2].T)

    def _extent(self) -> tuple[FloatArray, FloatArray]:
        u = self.size
        turn = np.linspace(0.0, 2.0 * pi, 61)
        ring = self.a1 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
        points = [ring + np.array([0.0, 0.0, z]) for z in (self.low_shift, self.high_shift)]
        points += [np.array([[0.0, 0.0, self.low_shift - 3.0 * u], [0.0, 0.0, self.high_shift + 7.0 * u]])]
        points += [np.array([self.guide_point(slide, x) for slide in self._rail for x in (0.0, self.side * 2.6 * u)])]
        points += [self.foot + 2.9 * u * np.vstack([self.frame4, np.eye(3)])]
        shown = self.page(np.concatenate(points))
        room = np.array([3.4 * u, 2.2 * u])
        return shown.min(axis=0) - room, shown.max(axis=0) + room

    @property
    def _rail(self) -> tuple[float, float]:
        return self.least - 2.3 * self.size, self.most + 2.3 * self.size

    def draw(self, axis: Axes, pose: _Pose, *, letters: bool = True) -> None:
        """Draw the whole mechanism at one configuration, with the paths of its pins."""
        self.lines = []
        self._centre_lines(axis, pose)
        self._paths(axis, letters)
        self._solids(axis, pose)
        self._dimensions(axis, pose, letters)
        if letters:
            self._letters(axis, pose)

    def _line(self, axis: Axes, points: ArrayLike, **look: Any) -> None:
        usual: dict[str, Any] = {"color": style.GROUND, "linewidth": style.THIN, "zorder": 4, "solid_capstyle": "round"}
        shown = self.page(points).T
        axis.plot(*shown, **usual | look)
        # about thirty points of a curve are enough to keep texts away
        self.lines.append(shown[:, :: max(1, shown.shape[1] // 30)])

    def _solids(self, axis: Axes, pose: _Pose) -> None:
        u, s, pin = self.size, self.side, pose.slider_pin
        k1 = np.array([0.0, 0.0, 1.0])
        bearing = self.high_shift + 2.2 * u
        arm = (pose.crank_pin - pose.centre) / self.a1
        crank = np.array([arm, np.cross(k1, arm), k1])
        along = (pin - pose.crank_pin) / self.a2
        # along the guide as the slider position increases, across, and away from the crank
        guide = np.array([-self.frame4[2], np.cross(s * self.frame4[0], -self.frame4[2]), s * self.frame4[0]])
        start, end = self._rail
        # the crank ends before the ball, so that the ball seems to lie in a fork
        solids: list[tuple[FloatArray, str]] = [
            (cylinder(bearing * k1, (bearing + 3.2 * u) * k1, 0.95 * u, pieces=3), "#AEB7BE"),
            (cylinder(pose.centre, np.array([0.0, 0.0, self.high_shift + 6.6 * u]), 0.42 * u, pieces=16), style.CRANK),
            (cylinder(pose.centre - 0.42 * u * k1, pose.centre + 0.42 * u * k1, 0.85 * u, sides=24), style.CRANK),
            (box([0.6 * u, -0.45 * u, -0.3 * u], [self.a1 - 0.45 * u, 0.45 * u, 0.3 * u], crank, pose.centre, pieces=6),
             style.CRANK),
            (ball(pose.crank_pin, 0.66 * u), "#F0A57A"),
            (cylinder(pose.crank_pin + 0.5 * u * along, pin - 0.5 * u * along, 0.3 * u, pieces=30), style.COUPLER),
            (ball(pin, 0.66 * u), "#86BFE3"),
            (cylinder(pin + 0.5 * u * guide[2], pin + 0.95 * u * guide[2], 0.34 * u), style.SLIDER),
            (box([-1.6 * u, -1.2 * u, 0.9 * u], [1.6 * u, 1.2 * u, 2.0 * u], guide, pin, pieces=4), "#84929D"),
            (box([start, -0.7 * u, 2.0 * u], [end, 0.7 * u, 2.45 * u], guide, self.foot, pieces=24), "#D9DEE2"),
        ]  # fmt: skip
        self.covered = paint(axis, solids, self.view)

    def _centre_lines(self, axis: Axes, pose: _Pose) -> None:
        u = self.size
        dashes = {"linestyle": (0, (9, 2, 2, 2)), "linewidth": style.HAIR, "color": "0.4", "zorder": 1}
        self._line(axis, [[0, 0, self.low_shift - 4.0 * u], [0, 0, self.high_shift + 8.0 * u]], **dashes)
        ends = min(self.least - 2.3 * u, -1.5 * u), max(self.most + 2.6 * u, 1.5 * u)
        self._line(axis, [self.guide_point(slide) for slide in ends], **dashes)
        turn = np.linspace(0.0, 2.0 * pi, 181)
        ring = self.a1 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
        self._line(axis, ring + pose.centre, color="0.6", linewidth=style.THIN, linestyle=":", zorder=1)

    def _paths(self, axis: Axes, letters: bool) -> None:
        """Draw the paths of the pins, and mark dead centres and limits; with ``letters`` draw crank and rod there, too."""
        for part in self.parts:
            self._line(axis, part.crank_pins, color=style.TRACE, linewidth=style.BOLD, zorder=2)
            self._line(axis, part.slider_pins, color=style.TRACE, linewidth=3.0, zorder=2)
            for place, _, colour, marker in part.marks:
                if letters:
                    joints = [place.centre, place.crank_pin, place.slider_pin]
                    self._line(axis, joints, color=colour, linewidth=style.THIN, linestyle="--", zorder=2)
                pins = self.page([place.crank_pin, place.slider_pin])
                edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": style.HAIR}
                axis.plot(*pins.T, marker, color=colour, markersize=style.DOT, zorder=6, **edge)

    def _dimensions(self, axis: Axes, pose: _Pose, letters: bool) -> None:
        u = self.size
        if self.a4 != 0.0:
            self._line(axis, [np.zeros(3), self.foot], color="black", linewidth=style.LINE, zorder=5)
        if abs(pose.centre[2]) > 1e-9 * self.size:
            self._line(axis, [np.zeros(3), pose.centre], color=_SHIFT, linewidth=2.6, zorder=6)
        if not letters:
            return
        if self.a4 != 0.0:
            # the direction of the crank axis, repeated at the guide
            along = self.foot + np.array([0.0, 0.0, 2.6 * u])
            self._line(axis, [self.foot, along], color="0.4", linewidth=style.HAIR, linestyle="--")
        t = np.linspace(0.0, self.parameters.guide_twist, 121)
        twist = self.foot + 1.5 * u * np.column_stack([0.0 * t, np.sin(t), np.cos(t)])
        self._line(axis, twist, color=_TWIST, linewidth=style.LINE)
        look = {"arrowstyle": "-|>", "color": "black", "linewidth": style.THIN, "mutation_scale": 8}
        for origin, rows in ((np.zeros(3), np.eye(3)), (self.foot, self.frame4)):
            for way in rows:
                start, end = self.page([origin, origin + 2.4 * u * way])
                axis.annotate(
                    "", end.tolist(), start.tolist(), arrowprops=look | {"shrinkA": 0, "shrinkB": 0}, zorder=7
                )
                self.lines.append(np.array([start, end]).T)

    def _letters(self, axis: Axes, pose: _Pose) -> None:
        u, small = self.size, 7.0

        def length(value: float) -> str:
            return f"{value:.4g} {self.unit}"

        labels = [
            _Label(origin + 2.45 * u * way, f"${name}_{number}$")
            for number, origin, rows in ((1, np.zeros(3), np.eye(3)), (4, self.foot, self.frame4))
            for name, way in zip("ijk", rows)
        ]
        if abs(pose.centre[2]) > 1e-9 * u:
            labels.append(_Label(0.5 * pose.centre, f"$S_1$ = {length(pose.centre[2])}", _SHIFT))
        if self.a4 != 0.0:
            labels.append(_Label(0.5 * self.foot, f"$a_4$ = {length(self.a4)}"))
        labels += [
            _Label(0.55 * pose.crank_pin + 0.45 * pose.centre, f"crank $a_1$ = {length(self.a1)}", "#8C3D00"),
            _Label(0.5 * (pose.crank_pin + pose.slider_pin), f"rod $a_2$ = {length(self.a2)}", "#00507F"),
            _Label(
                self.guide_point(pose.slide, self.side * 2.2 * u), f"slider $S_4$ = {length(pose.slide)}", "#3F4A52"
            ),
            _Label(np.array([0.0, 0.0, self.high_shift + 3.8 * u]), "bearing", "#3F4A52"),
            _Label(np.array([0.0, 0.0, self.low_shift - 4.0 * u]), "crank axis", size=small),
            _Label(self.guide_point(max(self.most + 2.6 * u, 1.5 * u)), "guide", size=small),
            _Label(self.foot, rf"$\alpha_4$ = {degrees(self.parameters.guide_twist):.4g}°", _TWIST),
        ]
        for part in self.parts:
            for place, name, colour, _ in part.marks:
                text = f"{name} {degrees(place.angle) % 360.0:.2f}°"
                labels += [_Label(pin, text, colour, small) for pin in (place.slider_pin, place.crank_pin)]
        x, y = self.page([label.point for label in labels]).T
        x_covered, y_covered = self.covered.T
        colours = [label.colour for label in labels]
        textalloc.allocate(
            axis, x, y, [label.text for label in labels], x_scatter=x_covered, y_scatter=y_covered,
            x_lines=[line[0] for line in self.lines], y_lines=[line[1] for line in self.lines],
            xlims=(self.low[0] + 0.5 * u, self.high[0] - 0.5 * u), ylims=(self.low[1], self.high[1]),
            margin=0.003, min_distance=0.005, nbr_candidates=500,
            avoid_label_lines_overlap=True, avoid_crossing_label_lines=True,
            textsize=[label.size for label in labels], textcolor=colours, linecolor=colours, linewidth=style.HAIR,
            plot_kwargs={"zorder": 11}, zorder=12, path_effects=[withStroke(linewidth=2.4, foreground="white")],
        )  # fmt: skip


@plot.register
@style.figure_style(laid_out=False)
def plot_mechanism(
    parameters: SliderCrankParameters,
    crank_angle: float,
    shift: float = 0.0,
    *,
    law: PeriodicShift | None = None,
    unit: str = "mm",
    view: tuple[float, float] = VIEW,
    title: str = "",
) -> Figure:
    """Draw the generalised slider-crank in space at one configuration, in orthographic projection.

    The drawing has the links with their dimensions, frames 1 and 4, the paths of the pins, and, as thin lines, crank and rod at
    the dead centres and at the limits of assembly, if the crank cannot turn fully. The scale is the same in all directions.

    Parameters
    ----------
    parameters : SliderCrankParameters
    crank_angle, shift : float
        Crank angle theta1 (rad) and axial shift S1 (m).
    law : PeriodicShift, optional
        The shift over the crank angle, for the paths; by default it is constant, ``shift``.
    unit : str
        Unit of the lengths in the texts: one of `UNITS`.
    view : (float, float)
        Direction of the eye (deg): elevation above the plane of j and k of frame 1, and azimuth from j towards k.
    title : str

    Raises
    ------
    AssemblyError
        If the rod does not reach the guide at the configuration; the message says by how much it is too short.
    InputError
        If angle or shift are not finite, or the unit is unknown.
    """
    for name, value in (("crank angle", crank_angle), ("shift", shift)):
        if not isfinite(value):
            raise InputError(f"the {name} is {value!r}: it must be a finite number")
    check_assembly(crank_angle, shift, parameters.constants())
    pose = _pose(parameters, crank_angle, shift, _factor(unit))
    parts = _parts(parameters, constant_shift(shift) if law is None else law, _factor(unit))
    scene = _Scene(parameters, parts, [pose], unit, view)
    figure, axis = _sheet(scene, 9.0, head=0.35 if title else 0.0)
    scene.draw(axis, pose)
    return style.finish(figure, title)


def draw_at_start(parameters: SliderCrankParameters, axis: Axes, run: Trajectory) -> str:
    """Draw the slider-crank at the start of a run with the paths of both pins, and return the caption."""
    factor = UNITS["mm"]
    shown = np.linspace(0, len(run) - 1, min(len(run), _POINTS)).astype(int)
    poses = [_pose(parameters, run["crank.angle"][i], run["shift.position"][i], factor) for i in shown]
    crank, slider = (
        factor * np.column_stack([run[f"{pin}.{x}"] for x in "xyz"]) for pin in ("crank_pin", "slider_pin")
    )
    samples, when = last_samples(run)
    scene = _Scene(parameters, [_Part(poses, crank[samples], slider[samples])], poses, "mm", VIEW)
    style.frame_drawing(axis, scene.low, scene.high)
    scene.draw(axis, poses[0], letters=False)
    return f"at {run.time[0]:.4g} s, with the paths of the pins {when}"


def _sheet(scene: _Scene, wide: float, *, head: float, foot: float = 0.0) -> tuple[Figure, Axes]:
    """Return a figure ``wide`` inches wide, and axes for the scene between a head and a foot of these heights (inches)."""
    width, height = scene.high - scene.low
    tall = float(np.clip(wide * height / width, 2.6, 0.9 * wide))
    figure = Figure(figsize=(wide, head + tall + foot))
    FigureCanvasAgg(figure)
    axis = figure.add_axes((0.0, foot / (head + tall + foot), 1.0, tall / (head + tall + foot)))
    style.frame_drawing(axis, scene.low, scene.high)
    axis.apply_aspect()
    return figure, axis


@animate.register
@style.figure_style(laid_out=False)
def animate_mechanism(
    parameters: SliderCrankParameters,
    path: str | Path,
    *,
    law: PeriodicShift | None = None,
    unit: str = "mm",
    view: tuple[float, float] = VIEW,
    frames: int = 48,
    frames_per_second: int = 20,
    title: str = "",
) -> Path:
    """Write a GIF of the mechanism over a period of the shift; a plot below it shows the slider position over the crank angle.

    If the crank cannot turn fully, it moves to and fro in the widest range of assembly.

    Parameters
    ----------
    parameters : SliderCrankParameters
    path : str or Path
        Path of the GIF.
    law : PeriodicShift, optional
        The shift over the crank angle; by default zero.
    unit, view, title
        As for `plot_mechanism`.
    frames : int
        Number of frames.

    Raises
    ------
    AssemblyError
        If the mechanism cannot be assembled at any crank angle.
    InputError
        If there are fewer than two frames, or the unit is unknown.
    """
    check_frames(frames)
    law = constant_shift(0.0) if law is None else law
    factor = _factor(unit)
    widest = max(assembled_ranges(parameters, law), key=lambda part: part.high - part.low)
    ends = _angles(widest, law)[[0, -1]]
    share = np.linspace(0.0, 1.0, frames, endpoint=False)
    if not widest.full(law.span):
        # to and fro, slow at the ends
        share = 0.5 - 0.5 * np.cos(2.0 * pi * share)
    angles = ends[0] + share * (ends[1] - ends[0])
    poses = [_pose(parameters, float(a), law.at(float(a))[0], factor) for a in angles]
    parts = _parts(parameters, law, factor)
    scene = _Scene(parameters, parts, poses, unit, view)
    head, foot = (0.35 if title else 0.0), 1.6
    figure, above = _sheet(scene, 7.0, head=head, foot=foot)
    total = figure.get_figheight()
    below = figure.add_axes((0.11, 0.45 / total, 0.86, (foot - 0.55) / total))
    style.write_title(figure, title)
    _plot_slider_position(below, parts, unit)
    (dot,) = below.plot([], [], "o", color=style.CRANK, markersize=style.DOT, zorder=7)
    with gif(figure, path, frames_per_second) as (file, add_frame):
        for pose in poses:
            scene.draw(above, pose, letters=False)
            dot.set_data([degrees(pose.angle)], [pose.slide])
            add_frame()
            for artist in (*above.lines, *above.collections):
                artist.remove()
    return file


def _plot_slider_position(axis: Axes, parts: Sequence[_Part], unit: str) -> None:
    """Plot the slider position over the crank angle, and mark dead centres and limits of assembly."""
    for part in parts:
        axis.plot(np.degrees(part.angles), [pose.slide for pose in part.poses], color=style.COLOURS[0], zorder=3)
        for place, _, colour, marker in part.marks:
            low, turn = degrees(part.angles[0]), degrees(place.angle)
            # a range may begin before zero and reach beyond a turn
            shown = turn if turn >= low - 1e-6 else turn + 360.0 * ceil((low - 1e-6 - turn) / 360.0)
            axis.plot(shown, place.slide, marker, color=colour, markersize=style.DOT, zorder=6)
    if parts:
        style.tick_quarter_turns(axis, *np.degrees([parts[0].angles[0], parts[-1].angles[-1]]))
    axis.set_xlabel("crank angle [deg]")
    axis.set_ylabel(f"slider position [{unit}]")


@style.figure_style()
def plot_range(
    parameters: SliderCrankParameters, *, law: PeriodicShift | None = None, unit: str = "mm", title: str = ""
) -> Figure:
    """Draw the range of assembly on the crank pin's circle and over the crank angle.

    On the circle, seen along the crank axis, the range of assembly is a solid line and the rest is dotted. Plots beside it show
    the assembly margin (rod length minus distance of the crank pin from the guide) and the slider position, with dead centres
    and limits.

    Parameters
    ----------
    parameters : SliderCrankParameters
    law : PeriodicShift, optional
        The shift over the crank angle; by default zero.
    unit : str
        One of `UNITS`.
    title : str

    Raises
    ------
    InputError
        If the unit is unknown.
    """
    law = constant_shift(0.0) if law is None else law
    factor = _factor(unit)
    p = parameters.constants()
    parts = _parts(parameters, law, factor)
    ends = [*(a for part in parts for a in part.angles[[0, -1]]), 0.0, law.span]
    angles = np.linspace(min(ends), max(ends), 2 * _POINTS)
    square = np.array([kinematics.assembly_square(float(a), law.at(float(a))[0], p) for a in angles])
    margin = factor * (p.a2 - np.sqrt(p.a2 * p.a2 - square))
    figure = Figure(figsize=(9.6, 4.4))
    panels = figure.subplot_mosaic(
        [["circle", "margin"], ["circle", "slider"]], width_ratios=(1.0, 1.35), height_ratios=(1.0, 1.0)
    )
    _draw_circle(panels["circle"], parts, factor * p.a1, unit)
    upper = panels["margin"]
    missing: dict[str, Any] = {"where": (margin < 0.0).tolist(), "label": "the rod does not reach the guide"}
    upper.fill_between(np.degrees(angles), margin, 0.0, color="0.85", linewidth=0.0, **missing)
    if margin.min() < 0.0:
        style.legend_above(upper)
    upper.plot(np.degrees(angles), margin, color=style.COLOURS[0])
    upper.axhline(0.0, color="0.3", linewidth=style.HAIR)
    upper.set_ylabel(f"assembly margin [{unit}]")
    upper.sharex(panels["slider"])
    _plot_slider_position(panels["slider"], parts, unit)
    for angle in (degrees(float(part.angles[end])) for part in parts if part.limits for end in (0, -1)):
        for axis in (upper, panels["slider"]):
            axis.axvline(angle, color=_LIMIT, linewidth=style.THIN, linestyle="--", zorder=1)
    figure.align_ylabels([upper, panels["slider"]])
    return style.finish(figure, title)


def _draw_circle(axis: Axes, parts: Sequence[_Part], radius: float, unit: str) -> None:
    """Draw the crank pin's circle, seen along the crank axis, with the part that the crank can reach as a solid line."""
    turn = np.linspace(0.0, 2.0 * pi, 181)
    axis.plot(radius * np.cos(turn), radius * np.sin(turn), ":", color="0.5", linewidth=style.LINE)
    for part in parts:
        axis.plot(*part.crank_pins[:, :2].T, color=style.TRACE, linewidth=3.5)
        for place, name, colour, marker in part.marks:
            x, y = place.crank_pin[:2]
            axis.plot([0.0, x], [0.0, y], "--", color=colour, linewidth=style.THIN)
            axis.plot(x, y, marker, color=colour, markersize=style.DOT, zorder=5)
            side = "left" if x > 0.3 * radius else "right" if x < -0.3 * radius else "center"
            out = 10.0 * x / radius, 18.0 * y / radius
            text = f"{name}\n{degrees(place.angle) % 360.0:.2f}°"
            look: dict[str, Any] = {"color": colour, "fontsize": style.TINY, "ha": side, "va": "center"}
            axis.annotate(text, (x, y), out, textcoords="offset points", **look)
    axis.plot(0.0, 0.0, "o", color=style.CRANK, markersize=style.DOT)
    axis.set_aspect("equal")
    axis.set_xlim(-1.75 * radius, 1.75 * radius)
    axis.set_ylim(-1.4 * radius, 1.4 * radius)
    axis.set_xlabel(f"$i_1$ [{unit}]")
    axis.set_ylabel(f"$j_1$ [{unit}]")
    axis.set_title("crank pin" if parts else "crank pin: the rod reaches the guide nowhere")
