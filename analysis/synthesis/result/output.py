"""Write solutions for CAD and simulation: drawings, plates, and tables of case files."""

from __future__ import annotations

from cmath import rect
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import cos, dist, hypot, isfinite, pi, remainder, sin, tau
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import LineString

from linkwork.errors import AssemblyError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState

from ...files import Circle, Dimension, Drawing, Layer, Line, Polyline, Text
from ...run import Inputs, parameter_tables, simulate
from ...units import with_unit
from ..linkage.linkage import FiveBar, Linkage, SecondCrank, SliderCrank, SliderMotion, format_ratio
from ..linkage.machine import MachineSpec, is_on_line, link_mass_properties
from ..task.task import SliderFunction, UntimedPath
from .solution import CURVE, Solution, angle_at_c, target_points, whole_turn

FloatArray = NDArray[np.float64]

#: Layers in the order in which they are drawn; their colours are visible on white and on black.
LAYERS = {
    "poses": Layer(colour=0x808080, width=0.13e-3),
    "ground": Layer(colour=0x404040, width=0.35e-3, foreground=True),
    "guide": Layer(colour=0x808080, width=0.25e-3),
    "crank": Layer(colour=0xC0392B, width=0.5e-3),
    "coupler": Layer(colour=0x1F6FB4, width=0.5e-3),
    "rocker": Layer(colour=0x2E8B57, width=0.5e-3),
    "slider": Layer(colour=0x8E44AD, width=0.35e-3),
    "coupler-curve": Layer(colour=0x1F6FB4, width=0.25e-3),
    "target": Layer(colour=0xD35400, width=0.25e-3),
    "plate": Layer(colour=0x202020, width=0.5e-3, foreground=True),
    "hole": Layer(colour=0xC0392B, width=0.35e-3),
    "dimension": Layer(colour=0x1F6FB4, width=0.18e-3),
    "text": Layer(colour=0x202020, width=0.18e-3, foreground=True),
}


@dataclass(frozen=True, eq=False)
class LinkageScene:
    """Geometry of a solution that pictures and drawings show, in m and rad, with a title."""

    solution: Solution
    title: str = ""

    @property
    def linkage(self) -> Linkage:
        """Return the linkage of the solution."""
        return self.solution.linkage

    def pins(self, rotation: float) -> Mapping[str, tuple[float, float]] | None:
        """Return the positions (m) of A to E and, if the task has target points, of P; None if the links cannot be joined."""
        try:
            pins = self.linkage.pins(rotation)
        except AssemblyError:
            return None
        if self.target is None:
            del pins["P"]
        return pins

    @property
    def _closed(self) -> bool:
        return isinstance(self.solution.task, UntimedPath) and self.solution.task.path.closed

    @cached_property
    def turn(self) -> FloatArray:
        """Return evenly spaced crank rotations over a whole turn from the least rotation of the task, shape (n,)."""
        begin = 0.0 if self._closed else float(self.solution.rotation.min())
        return begin + np.linspace(0.0, 2.0 * pi, 2 * CURVE + 1)

    @cached_property
    def task_rotations(self) -> FloatArray:
        """Return closely spaced crank rotations over the range of the task, shape (n,)."""
        at = self.solution.rotation
        if self._closed or whole_turn(self.solution.task, at):
            return self.turn
        return np.linspace(at.min(), at.min() + np.ptp(at), 2 * CURVE + 1)

    @property
    def rotation(self) -> FloatArray:
        """Return the crank rotations of the task's stations or, if the task takes a whole turn, the rotations of `turn`."""
        return self.turn if self.task_rotations is self.turn else self.solution.rotation

    @cached_property
    def target(self) -> FloatArray | None:
        """Return the target points, shape (n, 2); None for a rocker function."""
        return target_points(self.solution.task)

    @property
    def target_closed(self) -> bool | None:
        """Return whether the target is a closed line (True), an open one (False), or only points (None)."""
        task = self.solution.task
        return task.path.closed if isinstance(task, UntimedPath) else None

    @property
    def timed(self) -> bool:
        """Return whether the task gives the crank rotations of its targets."""
        task = self.solution.task
        return not isinstance(task, UntimedPath) and task.rotation is not None

    @cached_property
    def stations(self) -> dict[str, FloatArray]:
        """Return crank rotation, target, traced value and error at each target, by name with unit; see `Solution.columns`."""
        return self.solution.columns()

    @cached_property
    def curves(self) -> tuple[FloatArray, ...]:
        """Return the coupler curve over a whole turn in pieces, each shape (n, 2); empty without target points."""
        if self.target is None:
            return ()
        points = self.linkage.path(self.turn)
        there = np.isfinite(points).all(axis=1)
        pieces = np.split(points, np.flatnonzero(np.diff(there.astype(int))) + 1)
        return tuple(p for p in pieces if np.isfinite(p).all() and len(p) > 1)

    @cached_property
    def traced_curve(self) -> FloatArray | None:
        """Return the coupler curve over the range of the task, shape (n, 2); None for a rocker function."""
        return None if self.target is None else self.linkage.path(self.task_rotations)

    @cached_property
    def function(self) -> FloatArray | None:
        """Return crank rotations and values of a function, shape (2, n); None for any other task.

        The values are the rocker's angles over the task (rad), or the slider's positions along x over a turn (m).
        """
        if self._of_slider:
            return np.vstack([self.turn, self.linkage.path(self.turn)[:, 0]])
        if self.target is not None:
            return None
        at, turned = self.task_rotations, self.linkage.rocker_angle(self.task_rotations)
        # the angle is known up to whole turns: in the turn of the targets
        wanted = np.interp(self.stations["crank rotation [rad]"], at, turned) - self.stations["rocker angle [rad]"]
        return np.vstack([at, turned - tau * np.rint(np.median(wanted) / tau)])

    @cached_property
    def guide(self) -> FloatArray | None:
        """Return the two ends of the slider's travel as points, shape (2, 2); None without a slider."""
        linkage, slider = self.linkage, self.linkage.slider(self.turn)
        if slider is None:
            return None
        u, direction = slider[0], np.exp(1j * slider[1])
        ends = complex(linkage.pivot_x, linkage.pivot_y) + np.exp(1j * linkage.ground_angle) * (
            linkage.ground_length + np.array([np.nanmin(u), np.nanmax(u)]) * direction
        )
        return np.column_stack([ends.real, ends.imag])

    def guide_directions(self) -> tuple[FloatArray, FloatArray]:
        """Return the unit vectors along the guide and to its left; a slider without travel has a level guide."""
        assert self.guide is not None
        way = self.guide[1] - self.guide[0]
        length = hypot(*way)
        along = way / length if length > 0.0 else np.array([1.0, 0.0])
        return along, np.array([-along[1], along[0]])

    @property
    def second_crank(self) -> bool:
        """Return whether D is on a second crank about E."""
        return isinstance(self.linkage, FiveBar)

    @property
    def pin_letters(self) -> str:
        """Return the letters of the pins that are labelled."""
        return self.linkage.letters + ("" if self.linkage.point_is_pin else "P")

    @cached_property
    def transmission(self) -> FloatArray:
        """Return crank rotations over a turn, and the angle between coupler and rocker there, shape (2, n).

        The angle is NaN where the links cannot be joined.
        """
        return np.vstack([self.turn, angle_at_c(self.linkage, self.turn)])

    @property
    def _of_slider(self) -> bool:
        return isinstance(self.solution.task, SliderFunction)

    @property
    def motion(self) -> tuple[str, FloatArray] | None:
        """Return a heading, and the position of second crank or slider at each `turn` rotation.

        The result is None if there is neither, or the slider's position is `function`.
        """
        if self._of_slider:
            return None
        if isinstance(self.linkage, FiveBar):
            return "second crank [rad]", self.linkage.pivot.angle(self.turn)
        slider = self.linkage.slider(self.turn)
        return None if slider is None else ("slider position [m]", slider[0])


#: Greatest number of runs until a slider has settled.
SETTLING = 5
Point = tuple[float, float]
#: Radius of a pin and height of a letter, relative to the drawing's extent.
PIN, LETTER = 0.008, 0.022


def drawing(solution: Solution, rotation: float | None = None, *, poses: int = 0, title: str = "") -> Drawing:
    """Draw a linkage: links with their lengths, pins, guide, coupler curve and target, in coordinates of the plane (m).

    Parameters
    ----------
    solution : Solution
    rotation : float, optional
        Crank rotation (rad); by default the first rotation of the task, or else of a turn, at which the links can be joined.
    poses : int
        Number of further positions, in thin lines, at equal steps over the task.
    title : str

    Raises
    ------
    AssemblyError
        If the links cannot be joined at ``rotation``, or at any rotation.
    """
    scene = LinkageScene(solution, title)
    tried = (*scene.rotation, *scene.transmission[0]) if rotation is None else (rotation,)
    pins = next((found for phi in tried if (found := scene.pins(float(phi))) is not None), None)
    if pins is None:
        where = "at any rotation of the crank" if rotation is None else f"at a crank rotation of {rotation:.6g} rad"
        raise AssemblyError(f"the links cannot be joined {where}: there is nothing to draw")
    a, b, c, d, e = (pins[name] for name in "ABCDE")
    p = pins.get("P")
    drawn = [np.array(list(pins.values())), *(q for q in (*scene.curves, scene.target) if q is not None)]
    size = float(np.ptp(np.vstack(drawn), axis=0).max())
    radius, height = PIN * size, LETTER * size
    along = _coupler_line(pins, 1e-9 * size * size)
    bars = solution.linkage.bars
    lines = [Line(layer=layer, start=pins[ends[0]], end=pins[ends[1]]) for layer, ends in bars]
    held = "ground" if scene.guide is None else "slider"
    circles = [
        Circle(layer=layer, centre=pin, radius=radius)
        for layer, pin in (
            ("ground", a),
            ("crank", b),
            *([("rocker", c)] if ("rocker", "DC") in bars else []),
            (held, d),
        )
    ]
    further = np.linspace(
        scene.task_rotations[0], scene.task_rotations[-1], poses, endpoint=scene.task_rotations is not scene.turn
    )
    polylines = [
        Polyline(layer="poses", points=np.array([there[name] for name in names]))
        for phi in further
        if (there := scene.pins(float(phi))) is not None
        for names in (("ABCDE" if scene.second_crank else "ABCD"), *([_BESIDE[along]] if _BESIDE[along] else []))
    ]
    if scene.second_crank:
        circles.append(Circle(layer="ground", centre=e, radius=radius))
    if along:
        lines.append(Line(layer="coupler", start=pins[along[0]], end=pins[along[1]]))
    else:
        polylines.append(Polyline(layer="coupler", points=np.array([b, c, p]), closed=True))
    if p is not None:
        circles.append(Circle(layer="coupler", centre=p, radius=0.7 * radius))
    if scene.guide is not None:
        guide, block = _guide_and_block(scene.guide, scene.guide_directions(), np.array(d), radius)
        lines.append(guide)
        polylines.append(block)
    polylines += [_curve("coupler-curve", piece) for piece in scene.curves]
    if scene.target is not None and scene.target_closed is not None:
        polylines.append(Polyline(layer="target", points=scene.target, closed=scene.target_closed))
    elif scene.target is not None:
        apart = np.linalg.norm(np.diff(scene.target, axis=0), axis=1)
        small = min(0.5 * radius, 0.35 * float(np.median(apart)) or radius)  # dense targets do not hide the curve
        circles += [Circle(layer="target", centre=(x, y), radius=small) for x, y in scene.target.tolist()]
    texts = [
        Text(layer="text", position=(x + 1.5 * radius, y + 1.5 * radius), height=height, text=name)
        for name, (x, y) in pins.items()
        if name in scene.pin_letters
    ]
    return Drawing(
        title=scene.title,
        layers=LAYERS,
        lines=tuple(lines),
        circles=tuple(circles),
        polylines=tuple(polylines),
        dimensions=tuple(
            _link_dimensions(pins, solution.linkage, height, [LineString(one.points) for one in polylines])
        ),
        texts=tuple(texts),
    )


#: Points of the polyline that shows the coupler of a further position in addition to A-B-C-D, for each result of
#: `_coupler_line`; empty if B-C shows the whole coupler.
_BESIDE = {"": "BPC", "BC": "", "BP": "CP", "PC": "BP"}


def _coupler_line(pins: Mapping[str, Point], least: float) -> str:
    """Return the ends of the line on which B, C and the coupler point lie.

    The result is empty if they lie on no line: if twice the area of their triangle is ``least`` (m2) or more.
    """
    b, c, p = pins["B"], pins["C"], pins.get("P", pins["C"])
    if abs((c[0] - b[0]) * (p[1] - b[1]) - (c[1] - b[1]) * (p[0] - b[0])) >= least:
        return ""
    return "BC" if "P" not in pins else max(("BC", "BP", "PC"), key=lambda ends: dist(pins[ends[0]], pins[ends[1]]))


def _link_dimensions(
    pins: Mapping[str, Point], linkage: Linkage, height: float, others: Sequence[LineString]
) -> Iterator[Dimension]:
    """Yield the dimension of each link, placed beside the link with few overlaps; for a slider-crank also the offset.

    ``height`` is the height of a letter (m), and ``others`` are further lines that the dimensions should not overlap.
    """
    named = [ends for _, ends in linkage.bars]
    names: list[str] = [name for name in ("AE", "AB", "BC", "ED", "DC") if name == "BC" or name in named]
    names += ["BP"] if "P" in pins and not linkage.point_is_pin else []
    links = [LineString([pins[name[0]], pins[name[1]]]) for name in names]
    links += [LineString([pins["C"], pins["P"]])] if "P" in pins and pins["P"] != pins["C"] else []
    placed: list[Dimension] = []

    def count_overlaps(one: Dimension) -> tuple[int, int]:
        """Count a dimension's overlaps with links and placed dimensions (these count three times), and with other lines."""
        room, strokes = _number_box(one), _dimension_lines(one)
        count = sum(room.intersects(link) for link in links)
        count += 3 * sum(room.intersects(shape(other)) for other in placed for shape in (_number_box, _dimension_lines))
        count += 3 * sum(strokes.intersects(_number_box(other)) for other in placed)
        return int(count), sum(bool(room.intersects(line)) for line in others)

    # the dimensions of long links are placed first
    for start, end in sorted(((pins[n[0]], pins[n[1]]) for n in names), key=lambda ends: -dist(*ends)):
        if dist(start, end) > height:
            choices = [
                Dimension(layer="dimension", start=start, end=end, offset=side * rank * height, height=0.7 * height)
                for rank in (2.0, 3.5, 5.0, 6.5, 8.0, 9.5, 11.0, 12.5)
                for side in (1.0, -1.0)
            ]
            # the place with the fewest overlaps and, among these, nearest to the link
            placed.append(min(choices, key=count_overlaps))
    yield from placed


def _dimension_lines(dimension: Dimension) -> Any:
    """Return the lines of a dimension: the dimension line and the two extension lines."""
    return LineString([dimension.start, *dimension.line, dimension.end])


def _number_box(dimension: Dimension) -> Any:
    """Return a box about the middle of the dimension line, with room for the text of the dimension on either side."""
    (x0, y0), (x1, y1) = dimension.line
    middle, way = np.array([x0 + x1, y0 + y1]) / 2.0, np.array([x1 - x0, y1 - y0]) / hypot(x1 - x0, y1 - y0)
    return LineString([middle - 2.2 * dimension.height * way, middle + 2.2 * dimension.height * way]).buffer(
        1.3 * dimension.height, cap_style="flat"
    )


def _plate_holes(solution: Solution) -> dict[str, dict[str, complex]]:
    """Return the places of the holes of each plate relative to its first hole (m), by the plate's name and the pin's letter."""
    linkage = solution.linkage
    coupler = {"B": 0j, "C": complex(linkage.coupler_length)}
    if target_points(solution.task) is not None and linkage.point_distance > 0.0 and not linkage.point_is_pin:
        coupler["P"] = linkage.point_distance * np.exp(1j * linkage.point_angle)
    made: dict[str, dict[str, complex]] = {"crank": {"A": 0j, "B": complex(linkage.crank_length)}, "coupler": coupler}
    if not isinstance(linkage, SliderCrank):
        made["rocker"] = {"D": 0j, "C": complex(linkage.rocker_length)}
    if linkage.slider(0.0) is None:
        end = "E" if isinstance(linkage, FiveBar) else "D"
        made = {"ground": {"A": 0j, end: complex(linkage.ground_length)}} | made
    if isinstance(linkage, FiveBar):
        made["second crank"] = {"E": 0j, "D": complex(linkage.pivot.length)}
    return made


def crowded_plates(solution: Solution, pin: float) -> tuple[str, ...]:
    """Return the names of the links whose holes, of the diameter ``pin`` (m), would overlap or touch in a plate."""
    return tuple(
        name
        for name, holes in _plate_holes(solution).items()
        if min(abs(a - b) for a, b in combinations(holes.values(), 2)) <= pin
    )


def plates(solution: Solution, *, width: float, thickness: float, pin: float, title: str = "") -> Drawing:
    """Draw the links as plates with round ends and holes for the pins, one below the other, with dimensions.

    The ground link is drawn if both its ends are pivots; the guide of a slider is not drawn. The coupler includes the coupler
    point if the task has one.

    Parameters
    ----------
    width, thickness : float
        Width and thickness of each plate (m).
    pin : float
        Diameter of the holes (m), less than the width.
    title : str

    Raises
    ------
    ParameterError
        If the holes are not narrower than the plates, or a size is not greater than zero.
    """
    for name, value in (("width", width), ("thickness", thickness), ("pin", pin)):
        if not (isfinite(value) and value > 0.0):
            raise ParameterError(name, value, "be a finite number greater than zero (m)")
    if pin >= width:
        raise ParameterError("pin", pin, f"be below the width of the plates, {width:g} m")
    crowded = crowded_plates(solution, pin)
    height = 0.2 * width
    polylines, circles, dimensions, texts = [], [], [], []
    top = 0.0
    linkage = solution.linkage
    for name, holes in _plate_holes(solution).items():
        places = np.array(list(holes.values()))
        places = places + 1j * (top - places.imag.max() - 0.5 * width)
        outline, bulges = rounded_hull(places, 0.5 * width)
        polylines.append(Polyline(layer="plate", points=outline, closed=True, bulges=bulges))
        at = [(float(z.real), float(z.imag)) for z in places]
        circles += [Circle(layer="hole", centre=place, radius=0.5 * pin) for place in at]
        texts += [
            Text(layer="text", position=(x + 0.5 * pin + 0.05 * width, y - 0.5 * height), height=height, text=letter)
            for letter, (x, y) in zip(holes, at)
        ]
        dimensions += [
            Dimension(layer="dimension", start=here, end=there, offset=offset, height=height)
            for here, there, offset in _hole_dimensions(places, width)
        ]
        label = f"{name}: {1e3 * width:g} x {1e3 * thickness:g} mm, holes {1e3 * pin:g} mm"
        label += ", which overlap" if name in crowded else ""
        if name == "second crank" and isinstance(linkage, FiveBar):
            label += f", geared {format_ratio(linkage.pivot.ratio)} : 1 to the first"
        right = float(places.real.max()) + 1.2 * width
        texts.append(Text(layer="text", position=(right, float(places.imag.max())), height=height, text=label))
        top = float(places.imag.min()) - 2.6 * width
    return Drawing(
        title=title,
        layers=LAYERS,
        circles=tuple(circles),
        polylines=tuple(polylines),
        dimensions=tuple(dimensions),
        texts=tuple(texts),
    )


def _hole_dimensions(places: NDArray[np.complex128], width: float) -> Iterator[tuple[Point, Point, float]]:
    """Yield the two end points and the offset (m) of the dimension between each two distinct holes.

    ``places`` are the holes as complex numbers (m), ``width`` is the width of the plate. The dimensions lie outside the plate
    and do not overlap.
    """
    for number, (i, k) in enumerate(combinations(range(len(places)), 2)):
        way = places[k] - places[i]
        if abs(way) <= 1e-9:
            continue
        sides = [float(((z - places[i]) * way.conjugate()).imag) / abs(way) for z in places]
        flat = max(map(abs, sides)) < 0.5 * width
        offset = (0.8 + (0.35 * number if flat else 0.0)) * width
        (x1, y1), (x2, y2) = ((float(z.real), float(z.imag)) for z in (places[i], places[k]))
        yield (x1, y1), (x2, y2), -offset if max(sides, key=abs) > 0.0 and not flat else offset


def rounded_hull(places: NDArray[np.complex128], radius: float) -> tuple[FloatArray, tuple[float, ...]]:
    """Return the outline at a radius (m) around two or three points: its vertices, and its bulges as in `Polyline`."""
    farthest = max(combinations(range(len(places)), 2), key=lambda pair: float(abs(places[pair[0]] - places[pair[1]])))
    ends = places[list(farthest)]
    if len(places) == 3:
        a, b, c = places
        turned = ((b - a).conjugate() * (c - a)).imag
        if abs(turned) > 1e-9 * abs(ends[1] - ends[0]) ** 2:
            ends = places if turned > 0.0 else places[::-1]
    edges = np.roll(ends, -1) - ends
    normals = -1j * edges / np.abs(edges)
    before = np.roll(normals, 1)
    # about each corner an arc from the edge before it to the edge after it, then the edge after it
    points = np.column_stack([ends + radius * before, ends + radius * normals]).ravel()
    turns = np.angle(normals / before) % (2.0 * pi)
    bulges = np.column_stack([np.minimum(np.tan(0.25 * turns), 1.0), np.zeros(len(ends))]).ravel()
    return np.column_stack([points.real, points.imag]), tuple(bulges.tolist())


def _curve(layer: str, points: FloatArray) -> Polyline:
    """Return the polyline of a curve, closed if it ends at its first point."""
    closed = len(points) > 3 and hypot(*(points[-1] - points[0])) <= 1e-9 * float(np.ptp(points, axis=0).max())
    return Polyline(layer=layer, points=points[:-1] if closed else points, closed=closed)


def _guide_and_block(
    guide: FloatArray, directions: tuple[FloatArray, FloatArray], d: FloatArray, radius: float
) -> tuple[Line, Polyline]:
    along, left = directions
    ends = [guide[0] - 4.0 * radius * along, guide[1] + 4.0 * radius * along]
    block = np.array([d + radius * (3.0 * s * along + 2.0 * n * left) for s, n in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    start, end = ((float(x), float(y)) for x, y in ends)
    return Line(layer="guide", start=start, end=end), Polyline(layer="slider", points=block, closed=True)


# Tables of a case file, from which the linkage can be simulated, exported as an FMU and shown in the studio


def run_case(solution: Solution, make: MachineSpec, title: str) -> dict[str, Any]:
    """Return the tables of a case file that runs the linkage through its task at constant speed.

    The run takes two turns or, if the crank does not turn fully, goes from the first target to the last.
    A slider-crank runs as the slider-crank mechanism, any other linkage as the five-bar slider; see `docs/case-files.md`.
    The five-bar's slider starts in its steady motion or, if the crank does not turn fully, in equilibrium.
    """
    linkage, at = solution.linkage, solution.evaluation.rotation
    start = (0.0 if at is None else float(at[0])) + linkage.crank_phase
    run: dict[str, Any] = {"revolutions": 2.0}
    if not solution.verdicts.full_turn and at is not None:
        # a crank that cannot turn fully: from the first target to the last
        run = {"stop_time": with_unit(float(np.ptp(at)) / make.speed, "s")}
    across, along = make.load_components(cos(linkage.ground_angle), sin(linkage.ground_angle))
    load: Any = {"fx": with_unit(across, "N"), "fy": with_unit(along, "N")}
    if isinstance(linkage, SliderCrank):
        # at the slider alone, which the plant loads along its guide
        load = with_unit(along if linkage.point_is_pin else 0.0, "N")
    speed, plant, angle = solution.direction * make.speed, make.plant(linkage), remainder(start, tau)
    initial = {"crank_angle": with_unit(angle, "rad")}
    if isinstance(plant, FiveBarParameters):
        turning = Inputs(speed=speed if "revolutions" in run else 0.0, load_x=across, load_y=along)
        position, velocity = settle_slider(plant, turning, angle, tau / make.speed)
        initial |= {"slider_position": with_unit(position, "m"), "slider_velocity": with_unit(velocity, "m/s")}
    return {
        "title": title,
        **parameter_tables(plant),
        "initial": initial,
        "drive": {"speed": with_unit(speed, "rad/s")},
        **({"load": load} if any(make.load) else {}),
        "run": run,
    }


def neglected_load(linkage: Linkage, make: MachineSpec) -> str:
    """Return a sentence that says which part of the load the case of `run_case` leaves out; empty if it leaves out nothing."""
    if not isinstance(linkage, SliderCrank) or not any(make.load):
        return ""
    across, along = make.load_components(cos(linkage.ground_angle), sin(linkage.ground_angle))
    if not linkage.point_is_pin:
        return "slider-crank.toml is without make.load, since its plant has no force at P; linkage.toml has it"
    if abs(across) <= 1e-9 * hypot(across, along):
        return ""
    return (
        f"slider-crank.toml is without the {abs(across):.4g} N of make.load across the guide, "
        "since its plant has only a force along it; linkage.toml has both"
    )


def settle_slider(
    parameters: FiveBarParameters, acting: Inputs, crank_angle: float, duration: float
) -> tuple[float, float]:
    """Find the position (m) and velocity (m/s) to which a slider returns after ``duration`` (s); zeros if it does not return.

    If the run is a turn at constant speed, the result belongs to the steady motion at ``crank_angle``; if the crank is at rest,
    to the equilibrium. The run is repeated, at most `SETTLING` times, until the slider returns to within a millionth of its
    travel. SciPy's method is used: to compile the solver would take longer.
    """
    slider = 0.0, 0.0
    for _ in range(SETTLING):
        start = InitialState(crank_angle=crank_angle, slider_position=slider[0], slider_velocity=slider[1])
        run = simulate(parameters, acting, initial=start, stop_time=duration, step=duration / 64.0, method="LSODA")
        if run.status:
            break
        before, slider = slider, (float(run["slider.position"][-1]), float(run["slider.velocity"][-1]))
        swept = max(np.abs(run["slider.position"]).max(), np.abs(run["slider.velocity"]).max() * duration / (2.0 * pi))
        if max(abs(slider[0] - before[0]), abs(slider[1] - before[1]) * duration / (2.0 * pi)) <= 1e-6 * swept:
            return slider
    return 0.0, 0.0


def described_case(solution: Solution, make: MachineSpec, title: str) -> dict[str, Any]:
    """Return the tables of a case file that describes the linkage and simulates it; see `docs/linkages.md`."""
    linkage, at = solution.linkage, solution.evaluation.rotation
    start = 0.0 if at is None else float(at[0])
    tables = description(linkage, make, rotation=start, direction=solution.direction)
    moved = drives(linkage, make, rotation=start, direction=solution.direction)
    run: dict[str, Any] = {"revolutions": 2.0 * linkage.turns}
    if not solution.verdicts.full_turn and at is not None:
        run = {"stop_time": with_unit(float(np.ptp(at)) * linkage.turns / make.speed, "s")}
    elif moved:
        turn = tau / make.speed
        run = {"stop_time": with_unit(2.0 * linkage.turns * turn, "s"), "step": with_unit(turn / 360.0, "s")}
    return {"title": title, "linkage": tables, **moved, **loads(make), "run": run}


def description(
    linkage: Linkage, make: MachineSpec, *, rotation: float = 0.0, direction: float = 1.0
) -> dict[str, Any]:
    """Return the table ``[linkage]`` with the description of a four-bar, a slider-crank or a five-bar.

    ``make`` has bars, gravity and the speed of the crank. The input shaft starts at ``rotation`` (rad); the crank turns
    counter-clockwise if ``direction`` is +1, clockwise if -1. A rocker pivot that moves on a guide, or on a crank without
    gears, is a second degree of freedom: `drives` returns the speeds of crank and pivot.
    """
    a1, shaft = linkage.ground_angle, complex(linkage.pivot_x, linkage.pivot_y)
    end = shaft + rect(linkage.ground_length, a1)
    bodies = {"crank": _bar_table("AB", linkage.crank_length, make, make.crank_mass)}
    bodies["coupler"] = _bar_table("BC", linkage.coupler_length, make, make.coupler_mass)
    if linkage.point_distance and not linkage.point_is_pin:
        point = rect(linkage.point_distance, linkage.point_angle)
        bodies["coupler"] |= {"points": {"P": _point_entry(point)}, **_coupler_masses(linkage, make)}
        del bodies["coupler"]["section"]
    # the angle is not wrapped to a turn, because the position of gears depends on whole turns
    start = a1 + float(linkage.crank_angle(rotation))
    crank = {"joint": "A", "start": with_unit(start, "rad"), "speed": with_unit(direction * make.speed, "rad/s")}
    tables: dict[str, Any] = {
        "name": "found-linkage",
        "source": "found by synthesis",
        "gravity": with_unit(make.gravity, "m/s2"),
        "ground": {
            "A": _point_entry(shaft),
            "E" if linkage.pivot or isinstance(linkage, SliderCrank) else "D": _point_entry(end),
        },
        "bodies": bodies,
        "freedoms": {"crank": crank},
        "assembly": {"C": linkage.branch},
    }
    second = linkage.pivot
    if not isinstance(linkage, SliderCrank):
        bodies["rocker"] = _bar_table("DC", linkage.rocker_length, make, make.rocker_mass)
    if isinstance(linkage, SliderCrank) or isinstance(second, SliderMotion):
        pin, guide = ("D", second.guide_angle) if isinstance(second, SliderMotion) else ("C", 0.5 * pi)
        bodies["block"] = {"points": {pin: [0, 0]}, "mass": with_unit(make.block_mass, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": with_unit(a1 + guide, "rad")}}
    if linkage.point_is_pin:
        # the load acts on the block, not on the coupler
        bodies["block"]["points"]["P"] = [0, 0]
    if isinstance(second, SliderMotion):
        position = with_unit(float(second.series(rotation)), "m")
        tables["freedoms"]["pivot"] = {"joint": "guide", "start": position, "driven": True}
    elif second is not None:
        bodies["second"] = _bar_table("ED", second.length, make, None)
    if isinstance(second, SecondCrank) and second.series.order:
        angle = with_unit(a1 + float(second.angle(rotation)), "rad")
        tables["freedoms"]["pivot"] = {"joint": "E", "start": angle, "driven": True}
    elif isinstance(second, SecondCrank):
        # angle of the second crank while the first crank points along x
        phase = a1 + second.phase - second.ratio * (a1 + linkage.crank_phase)
        turned = with_unit(remainder(phase, tau), "rad")
        tables["gears"] = {"teeth": {"bodies": ["crank", "second"], "ratio": second.ratio, "phase": turned}}
    if "slides" in tables and (spring := _spring_table(make)):
        tables["springs"] = {"slider": {"at": "guide"} | spring}
    if acting := loads(make):
        tables["loads"] = list(acting)
        if not linkage.point_distance:
            # a load on the pin would act on the crank
            bodies["coupler"]["points"] = {"P": [0, 0]}
    return tables


def _spring_table(make: MachineSpec) -> dict[str, Any]:
    """Return the entries of a description for spring, damper and friction of the slider, without entries that are zero."""
    values = {
        "stiffness": (make.slider_stiffness, "N/m"),
        "free": (make.slider_stiffness and make.slider_spring_free_position, "m"),
        "damping": (make.slider_damping, "N.s/m"),
        "friction": (make.slider_coulomb_friction, "N"),
    }
    return {name: with_unit(value, unit) for name, (value, unit) in values.items() if value}


def loads(make: MachineSpec) -> dict[str, Any]:
    """Return the table with the load of ``make`` at the coupler point P; empty without a load."""
    return {"P": {f"load_{a}": with_unit(force, "N") for a, force in zip("xy", make.load)}} if any(make.load) else {}


def drives(linkage: Linkage, make: MachineSpec, *, rotation: float = 0.0, direction: float = 1.0) -> dict[str, Any]:
    """Return the drive tables of a linkage whose pivot is a second degree of freedom: speeds of crank and pivot over time.

    The arguments are those of `description`. For any other linkage the result is empty, because `description` contains the
    crank speed.
    """
    pivot = linkage.pivot
    sliding = isinstance(pivot, SliderMotion)
    if pivot is None or not (sliding or pivot.series.order):
        return {}
    speed = direction * make.speed
    rate = speed / linkage.turns
    slope, unit = pivot.series.derivative(), "m/s" if sliding else "rad/s"
    k = np.arange(1, slope.order + 1)
    waves = {
        "kind": "harmonics",
        "amplitudes": [with_unit(rate * a, unit) for a in slope.amplitudes[1:]],
        "frequencies": [with_unit(w, "rad/s") for w in rate * k],
        "phases": [with_unit(a, "rad") for a in k * rotation - np.arctan2(slope.sin, slope.cos)[1:]],
    }
    if isinstance(pivot, SecondCrank):
        waves["mean"] = with_unit(speed * pivot.ratio, unit)
    moved = waves if pivot.series.order else with_unit(0.0, unit)
    return {"crankDrive": {"speed": with_unit(speed, "rad/s")}, "pivotDrive": {"speed": moved}}


def _coupler_masses(linkage: Linkage, make: MachineSpec) -> dict[str, Any]:
    """Return mass, centre of mass and moment of inertia of a coupler with an arm to its point; see `link_mass_properties`."""
    straight = is_on_line(linkage.coupler_length, linkage.point_distance, linkage.point_angle)
    made = make.plant_values(linkage, straight, False, link_mass_properties)
    centre = rect(made["coupler_cog_distance"], made["coupler_cog_angle"])
    return {
        "mass": with_unit(made["coupler_mass"], "kg"),
        "cog": _point_entry(centre),
        "inertia": with_unit(made["coupler_inertia"], "kg.m2"),
    }


def _point_entry(z: complex) -> list[Any]:
    """Return a point as a case file gives it, [x, y] with units; exact zeros are the number 0."""
    return [0 if c == 0.0 else with_unit(c, "m") for c in (z.real, z.imag)]


def _bar_table(ends: str, length: float, make: MachineSpec, mass: float | None) -> dict[str, Any]:
    """Return the table of a bar with the section of ``make``, and with ``mass`` (kg) if it is given."""
    section = {"kind": "bar", "width": with_unit(make.width, "m"), "thickness": with_unit(make.thickness, "m")}
    section["material"] = with_unit(make.density, "kg/m3")
    table = {"bar": list(ends), "length": with_unit(length, "m"), "section": section}
    return table if mass is None else table | {"mass": with_unit(mass, "kg")}
