"""Write the equations of a described linkage as a Python module that calls `linkwork.planar`.

The pose of a body, its `Frame`, is the position of its origin and its direction. A direction is a `Turn`: cosine and sine
of the angle, with its derivatives. The methods below write lines of the generated module, or return expressions for them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from .description import GROUND
from .parameters import Interface
from .structure import Dyad, FreedomStep, GearStep, Pin, RackStep, Side, Slider, sliders
from .writing import function, record


class Linear(NamedTuple):
    """An angle or a position that is linear in the coordinates: coefficients by index of the coordinate, constant terms."""

    terms: dict[int, str]
    constants: list[str]


class PoseWriter:
    """Writer of the function that computes the poses of all bodies of one linkage.

    Its methods write lines of that function, or return expressions for them.
    """

    def __init__(self, interface: Interface) -> None:
        self.structure, self.interface = interface.structure, interface
        self.n = len(interface.drives)
        self.lines: list[str] = []
        #: variables of the positions of points of the ground and of bodies with known pose, by name of the point
        self.places: dict[str, str] = {}
        #: angles of the bodies, and positions of the slides, that are linear in the coordinates
        self.angles: dict[str, Linear] = {GROUND: Linear({}, [])}
        self.travels: dict[str, Linear] = {}
        self.margins: list[str] = []

    # Places

    def point(self, body: str, own: str, frame: str = "") -> str:
        """Return the expression of the position of a body's point.

        ``frame`` is the variable of the body's pose, by default of its pose in the ground frame. With ``frame="own"`` the
        position is given in the body's own frame.
        """
        x, y = self.interface.coordinates(body, own)
        if body == GROUND or frame == "own":
            return f"fixed_vector({x}, {y}, {self.n})"
        frame = frame or f"{body}_frame"
        return f"{frame}.origin" if (x, y) == ("0.0", "0.0") else f"point({frame}, {x}, {y})"

    def point_variable(self, body: str, own: str) -> str:
        """Return the variable of the position of the body's point ``own``, and write its assignment at the first use."""
        if own not in self.places:
            self.lines.append(f"at_{own} = {self.point(body, own)}")
            self.places[own] = f"at_{own}"
        return self.places[own]

    def pose_at_pin(self, pin: str, turn: str, body: str, own: str) -> str:
        """Return the expression of the pose of a body that has its point ``own`` at ``pin`` and the direction ``turn``."""
        x, y = self.interface.coordinates(body, own)
        if (x, y) == ("0.0", "0.0"):
            return f"Frame({pin}, {turn})"
        return f"Frame(subtract_vectors({pin}, arm({turn}, {x}, {y})), {turn})"

    def incline_turn(self, turn: str, joint: Slider, sign: int = 1) -> str:
        """Return the expression of the direction of a slide's line; ``turn`` is the direction of the body that has the line.

        If ``sign`` is -1, ``turn`` is the direction of the line, and the result is the direction of the body.
        """
        if not joint.inclined:
            return turn
        return f"incline_direction({turn}, p.{joint.name}_COS, {'-' if sign < 0 else ''}p.{joint.name}_SIN)"

    def place_freedom_body(self, step: FreedomStep, lead: str = "") -> None:
        """Write the pose of a body that a freedom joins to a body of known pose.

        The pose is relative to the body ``lead``, or to the ground if no ``lead`` is given.
        """
        suffix = f"in_{lead}" if lead else "frame"
        parent = "" if step.parent in (GROUND, lead) else f"{step.parent}_{suffix}"
        own = "own" if lead and step.parent == lead else parent
        parent_turn = f"{parent}.turn" if parent else f"fixed_direction(1.0, 0.0, {self.n})"
        turn = f"{step.body}_turn"
        joint, drive = step.joint, self.interface.drives[step.freedom]
        parent_angle, sign = self.angles[step.parent], "-" if step.sign < 0 else ""
        terms, constants = dict(parent_angle.terms), list(parent_angle.constants)
        if isinstance(joint, Pin):
            terms[step.freedom] = f"{sign}1.0"
            self.lines.append(f"{turn} = {self.linear_turn(terms, constants)}")
            pin = self.point(step.parent, joint.name, own)
            if not lead:
                pin = self.point_variable(step.parent, joint.name)
            frame = self.pose_at_pin(pin, turn, step.body, joint.name)
        else:
            travel = f"linear_arm({drive.variable}, {self.derivative_tuple({step.freedom: '1.0'})}, v)"
            if joint.inclined:
                constants.append(f"{sign}p.{joint.name}_direction")
            if not lead:
                self.travels[joint.name] = Linear({step.freedom: "1.0"}, [])
            frame = self.slide_pose(step, joint, parent_turn, travel, own)
        self.angles[step.body] = Linear(terms, constants)
        self.lines.append(f"{step.body}_{suffix} = {frame}")

    def slide_pose(
        self, step: FreedomStep | RackStep, joint: Slider, parent_turn: str, travel: str, own: str = ""
    ) -> str:
        """Write the assignment of the direction of ``step.body``; return the expression of the body's pose.

        The body is the block or the guide of the slide ``joint`` on its parent. ``travel`` is the vector from the start of the
        guide line to the block. ``own`` is the variable of the parent's pose, see ``frame`` in `point`.
        """
        turn = f"{step.body}_turn"
        if joint.bodies[1] == step.body:
            self.lines.append(f"{turn} = {self.incline_turn(parent_turn, joint)}")
            return f"Frame(add_vectors({self.point(step.parent, joint.through, own)}, rotate_arm({turn}, {travel})), {turn})"
        self.lines.append(f"{turn} = {self.incline_turn(parent_turn, joint, -1)}")
        through = f"subtract_vectors({self.point(step.parent, '', own)}, rotate_arm({parent_turn}, {travel}))"
        return self.pose_at_pin(through, turn, step.body, joint.through)

    def place_pinion(self, step: RackStep) -> None:
        """Write the pose of a gear from the position of its rack."""
        radius, offset = f"p.{step.rack}_radius", f"p.{step.rack}_offset"
        turn = f"{step.body}_turn"
        if step.linear:
            own_terms, own_constants = self.angles[step.parent]
            travel, start = self.travels[step.slide.name]
            terms = dict(own_terms)
            for number, factor in travel.items():
                terms[number] = f"({terms.get(number, '0.0')} + {factor} / {radius})"
            constants = [*own_constants, f"({' + '.join((*start, f'-{offset}'))}) / {radius}"]
            self.angles[step.body] = Linear(terms, constants)
            self.lines.append(f"{turn} = {self.linear_turn(terms, constants)}")
        else:
            holder, block = step.slide.bodies
            carrier, origin = self.interface.turn(step.parent), self.point_variable(holder, step.slide.through)
            line = self.incline_turn(self.interface.turn(holder), step.slide)
            self.lines.append(
                f"{turn} = gear_direction({carrier}, {line}, {origin}, {block}_frame.origin, {offset}, {radius})"
            )
        pin = self.point_variable(step.parent, step.pin.name)
        self.lines.append(f"{step.body}_frame = {self.pose_at_pin(pin, turn, step.body, step.pin.name)}")

    def place_rack(self, step: RackStep) -> None:
        """Write the pose of a rack from the angle of its gear."""
        radius, offset = f"p.{step.rack}_radius", f"p.{step.rack}_offset"
        (terms, constants), (own_terms, own_constants) = self.angles[step.mate], self.angles[step.parent]
        share = {
            n: f"{radius} * ({terms.get(n, '0.0')} - {own_terms.get(n, '0.0')})"
            for n in terms.keys() | own_terms.keys()
        }
        angle = " + ".join(constants) or "0.0"
        start = [f"{radius} * ({angle} - ({' + '.join(own_constants) or '0.0'}))", offset]
        self.travels[step.slide.name] = Linear(share, start)
        way = " + ".join((*(f"{f} * {self.interface.drives[n].variable}" for n, f in share.items()), *start))
        travel = f"linear_arm({way}, {self.derivative_tuple(share)}, v)"
        frame = self.slide_pose(step, step.slide, self.interface.turn(step.parent), travel)
        sign = "" if step.slide.bodies[1] == step.body else "-"
        inclined = [f"{sign}p.{step.slide.name}_direction"] if step.slide.inclined else []
        self.angles[step.body] = Linear(own_terms, [*own_constants, *inclined])
        self.lines.append(f"{step.body}_frame = {frame}")

    def derivative_tuple(self, terms: dict[int, str]) -> str:
        """Return the source of the tuple of derivatives with respect to the coordinates.

        ``terms`` has the derivatives that are not zero, by index of the coordinate.
        """
        return f"({', '.join(terms.get(n, '0.0') for n in range(self.n))},)"

    def linear_turn(self, terms: dict[int, str], constants: Iterable[str]) -> str:
        """Return the expression of a direction whose angle is linear in the coordinates.

        ``terms`` has the coefficients by index of the freedom, ``constants`` the constant terms of the angle.
        """
        words = []
        for number, factor in terms.items():
            name = self.interface.drives[number].variable
            words.append({"1.0": name, "-1.0": f"-{name}"}.get(factor, f"{factor} * {name}"))
        angle = " + ".join((*words, *constants)) or "0.0"
        return f"linear_direction({angle.replace('+ -', '- ')}, {self.derivative_tuple(terms)}, v)"

    def place_gear(self, step: GearStep) -> None:
        """Write the pose of a gear from the angle of its mate."""
        ratio, phase = f"p.{step.gear}_ratio", f"p.{step.gear}_phase"
        (mate, mate_constants), (carrier, carrier_constants) = self.angles[step.mate], self.angles[step.parent]
        terms: dict[int, str] = {}
        factor = f"1.0 / {ratio}" if step.inverse else ratio
        for number in mate.keys() | carrier.keys():
            seen = f"({mate.get(number, '0.0')} - {carrier.get(number, '0.0')})"
            terms[number] = f"({carrier.get(number, '0.0')} + {factor} * {seen})"
        seen = " + ".join(mate_constants) or "0.0"
        back = " + ".join(carrier_constants) or "0.0"
        angle = f"{back} + {factor} * ({seen} - ({back}){f' - {phase}' if step.inverse else ''})"
        constants = [angle if step.inverse else f"{angle} + {phase}"]
        self.angles[step.body] = Linear(terms, constants)
        turn = f"{step.body}_turn"
        self.lines.append(f"{turn} = {self.linear_turn(terms, constants)}")
        pin = self.point_variable(step.parent, step.pin.name)
        self.lines.append(f"{step.body}_frame = {self.pose_at_pin(pin, turn, step.body, step.pin.name)}")

    # Dyads

    def arm_to_inner_pin(self, side: Side, body: str, joint: Pin) -> str:
        """Return the expression of the vector from a side's outer joint to the dyad's inner pin ``joint``, a point of ``body``.

        The vector is given in the axes of the side's first body or, if this body guides the slide at the outer joint, in the
        axes of the guide line.
        """
        if isinstance(side.joint, Pin):
            start, axes = side.joint.name, ""
        elif side.joint.bodies[1] == side.body:
            start, axes = "", ""
        else:
            start, axes = side.joint.through, side.joint.axes
        return self.own_arm(side, body, joint.name, start, axes)

    def own_arm(self, side: Side, body: str, to: str, start: str, axes: str) -> str:
        """Return the expression of the vector from the point ``start`` of a side's first body to the point ``to`` of ``body``.

        ``body`` is any body of the side. The vector is given in the frame of the first body or, if ``axes`` names a slide on
        this body, in the axes of the slide's line.
        """
        sx, sy = self.interface.coordinates(side.body, start)
        if body == side.body:
            x, y = self.interface.coordinates(body, to)
            result = f"fixed_vector({_difference(x, sx)}, {_difference(y, sy)}, {self.n})"
        else:
            result = self.point(body, to, f"{body}_in_{side.body}")
            if (sx, sy) != ("0.0", "0.0"):
                result = f"subtract_vectors({result}, fixed_vector({sx}, {sy}, {self.n}))"
        return f"rotate_arm(fixed_direction(p.{axes}_COS, -p.{axes}_SIN, {self.n}), {result})" if axes else result

    def guide_line(self, side: Side) -> tuple[str, str]:
        """Write the direction of the guide line along which a side slides; return the variables of its origin and direction."""
        joint = side.joint
        assert isinstance(joint, Slider)
        parent = self.interface.turn(side.parent)
        name = f"{joint.name}_line"
        if joint.bodies[1] == side.body:
            self.lines.append(f"{name} = {self.incline_turn(parent, joint)}")
            return self.point_variable(side.parent, joint.through), name
        self.lines.append(f"{name} = {parent}")
        return f"{side.parent}_frame.origin", name

    def place_side(self, side: Side, turn: str, along: str = "", origin: str = "", line: str = "") -> None:
        """Write the poses of the bodies of one side of a dyad.

        If the outer joint is a pin, ``turn`` is the direction of the first body. If the joint is a slide, ``along`` is the
        vector along the guide line, which starts at ``origin`` and has the direction ``line``.
        """
        joint, body = side.joint, side.body
        if isinstance(joint, Pin):
            frame = self.pose_at_pin(self.point_variable(side.parent, joint.name), turn, body, joint.name)
        else:
            place = f"add_vectors({origin}, rotate_arm({line}, {along}))"
            if joint.bodies[1] == body:
                frame = f"Frame({place}, {line})"
            else:
                self.lines.append(f"{body}_turn = {self.incline_turn(line, joint, -1)}")
                frame = self.pose_at_pin(place, f"{body}_turn", body, joint.through)
        self.lines.append(f"{body}_frame = {frame}")
        for own in side.bodies[1:]:
            self.lines.append(f"{own}_frame = composed_frame({body}_frame, {own}_in_{body})")

    def place_inner_bodies(self, step: Dyad) -> None:
        """Write the poses of the further bodies of both sides of a dyad, relative to the first body of their side."""
        for side in step.sides:
            kept = dict(self.angles)
            self.angles[side.body] = Linear({}, [])
            for inside in side.inside:
                if isinstance(inside, FreedomStep):
                    self.place_freedom_body(inside, side.body)
                else:
                    self.place_nested_dyad(inside, side.body)
            self.angles = kept

    def place_nested_dyad(self, step: Dyad, lead: str) -> None:
        """Write the poses of the bodies of an RRR dyad relative to the body ``lead``, whose own pose is not known yet."""
        name, (one, other) = step.inner.name, step.sides
        assert isinstance(step.inner, Pin)
        self.lines.append(f"# dyad RRR in the {lead}: {one.body} and {other.body}, joined at {name}")
        self.place_inner_bodies(step)
        frames = ["own" if side.parent == lead else f"{side.parent}_in_{lead}" for side in step.sides]
        pins = [self.point(side.parent, side.joint.name, frame) for side, frame in zip(step.sides, frames)]
        turns = [f"{side.body}_turn_in_{lead}" for side in step.sides]
        first, second = (self.arm_to_inner_pin(side, end, step.inner) for side, end in zip(step.sides, step.ends))
        call = f"pin_pin_pin({pins[0]}, {pins[1]}, {first}, {second}, p.{name}_assembly, v)"
        self.lines.append(f"{turns[0]}, {turns[1]}, margin_{name} = {call}")
        self.margins.append(f"margin_{name}")
        for side, pin, turn in zip(step.sides, pins, turns):
            self.lines.append(f"{side.body}_in_{lead} = {self.pose_at_pin(pin, turn, side.body, side.joint.name)}")
            for own in side.bodies[1:]:
                self.lines.append(f"{own}_in_{lead} = composed_frame({side.body}_in_{lead}, {own}_in_{side.body})")

    def place_dyad(self, step: Dyad) -> None:
        """Write the poses of the bodies of a dyad."""
        name = step.inner.name
        self.lines.append(f"# dyad {step.kind}: {' and '.join(s.body for s in step.sides)}, joined at {name}")
        self.place_inner_bodies(step)
        branch, margin = f"p.{name}_assembly", f"margin_{name}"
        turns = [f"{side.body}_turn" for side in step.sides]
        pins = [self.point_variable(s.parent, s.joint.name) if isinstance(s.joint, Pin) else "" for s in step.sides]
        lines = [self.guide_line(s) if isinstance(s.joint, Slider) else ("", "") for s in step.sides]
        along = [f"{s.joint.name}_along" for s in step.sides]
        if isinstance(step.inner, Pin):
            arms = [self.arm_to_inner_pin(side, end, step.inner) for side, end in zip(step.sides, step.ends)]
            if step.kind == "RRR":
                call = f"pin_pin_pin({pins[0]}, {pins[1]}, {arms[0]}, {arms[1]}, {branch}, v)"
                self.lines.append(f"{turns[0]}, {turns[1]}, {margin} = {call}")
            elif step.kind == "RRP":
                (origin, line) = lines[1]
                call = f"pin_pin_slide({pins[0]}, {origin}, {line}, {arms[0]}, {arms[1]}, {branch}, v)"
                self.lines.append(f"{turns[0]}, {along[1]}, {margin} = {call}")
            else:
                ends = ", ".join(f"{origin}, {line}, {arm}" for (origin, line), arm in zip(lines, arms))
                self.lines.append(f"{along[0]}, {along[1]}, {margin} = slide_pin_slide({ends}, v)")
        elif step.kind == "RPR":
            self._place_between_pins(step, step.inner, pins, branch, margin)
        else:
            self._place_on_block(step, step.inner, pins[0], lines[1], margin)
        self.margins.append(margin)
        for side, turn, way, (origin, line) in zip(step.sides, turns, along, lines):
            self.place_side(side, turn, way, origin, line)
        if isinstance(step.inner, Pin):
            self.point_variable(step.ends[0], name)

    def _place_between_pins(self, step: Dyad, inner: Slider, pins: list[str], branch: str, margin: str) -> None:
        sides = list(zip(step.sides, pins))
        # body 1 of `pin_slide_pin` has the line, body 2 is the block
        (first, pin), (second, other_pin) = sides if step.sides[0].body == inner.bodies[0] else sides[::-1]
        a = self.own_arm(first, first.body, first.joint.name, inner.through, inner.axes)
        b = self.own_arm(second, second.body, second.joint.name, "", "")
        call = f"pin_slide_pin({pin}, {other_pin}, {a}, {b}, {branch}, v)"
        self.lines.append(f"{inner.name}_line, {inner.name}_along, {margin} = {call}")
        self.lines.append(f"{first.body}_turn = {self.incline_turn(f'{inner.name}_line', inner, -1)}")
        self.lines.append(f"{second.body}_turn = {inner.name}_line")

    def _place_on_block(self, step: Dyad, inner: Slider, pin: str, line: tuple[str, str], margin: str) -> None:
        first, second = step.sides
        origin, direction = line
        outer = second.joint
        assert isinstance(outer, Slider)
        own = outer.bodies[1] == second.body
        turn = direction if own else self.incline_turn(direction, outer, -1)
        start, axes = ("", "") if own else (outer.through, outer.axes)
        across = f"{inner.name}_line"
        holds = inner.bodies[0] == second.body
        self.lines.append(f"{across} = {self.incline_turn(turn, inner) if holds else turn}")
        if holds:
            a = self.own_arm(first, first.body, first.joint.name, "", "")
            b = self.own_arm(second, second.body, inner.through, start, axes)
            body_turn = across
        else:
            a = self.own_arm(first, first.body, first.joint.name, inner.through, inner.axes)
            b = self.own_arm(second, second.body, "", start, axes)
            body_turn = self.incline_turn(across, inner, -1)
        call = f"pin_slide_slide({pin}, {origin}, {direction}, {across}, {a}, {b}, v)"
        self.lines.append(f"{outer.name}_along, {inner.name}_along, {margin} = {call}")
        self.lines.append(f"{first.body}_turn = {body_turn}")

    # Functions of the module

    def blocks(self) -> Iterator[str]:
        """Write the record of the poses of all bodies and the function that computes it."""
        for n, drive in enumerate(self.interface.drives):
            self.lines.append(f"{drive.variable} = x[{n}]")
        self.lines.append(f"v = ({', '.join(f'x[{self.n + n}]' for n in range(self.n))},)")
        for step in self.structure.steps:
            if isinstance(step, FreedomStep):
                self.lines.append(
                    f"# the freedom {self.interface.drives[step.freedom].name}: {step.body} from {step.parent}"
                )
                self.place_freedom_body(step)
            elif isinstance(step, GearStep):
                self.lines.append(f"# {step.body}, geared to {step.mate}")
                self.place_gear(step)
            elif isinstance(step, RackStep):
                self.lines.append(f"# {step.body}, in the teeth of {step.mate}")
                (self.place_pinion if step.turns else self.place_rack)(step)
            else:
                self.place_dyad(step)
        margin = "1.0"
        for name in self.margins:
            margin = name if margin == "1.0" else f"lesser({margin}, {name})"
        for body in (GROUND, *self.structure.bodies):
            for own in self.interface.points[body]:
                self.point_variable(body, own)
        fields = [f"{body}_frame" for body in self.structure.bodies] + list(self.places.values())
        fields += [f"{name}_line" for name in sliders(self.structure)]
        for name, joint in sliders(self.structure).items():
            if not any(line.startswith(f"{name}_line") for line in self.lines):
                self.lines.append(f"{name}_line = {self.incline_turn(self.interface.turn(joint.bodies[0]), joint)}")
        self.lines += [f"clearance = {margin}", f"return Places({', '.join(fields)}, clearance)"]
        kinds = {"frame": "Frame", "line": "Turn"}
        types = {name: kinds.get(name.rpartition("_")[2], "Vector") for name in fields} | {"clearance": "float"}
        yield record(
            "Places", "The bodies, the points, the lines of slides, and the clearance to the limit of assembly.", types
        )
        doc = "Compute the places of all bodies, freedom after freedom and dyad after dyad."
        yield function("places(x: tuple[float, ...], p: Constants) -> Places", doc, self.lines)


class Twist(NamedTuple):
    """The angle between two bodies, linear in the coordinates, as an expression, and the freedoms on which it depends."""

    angle: str
    freedoms: tuple[int, ...]


def counted_twists(interface: Interface) -> dict[str, Twist]:
    """Return the twist of each torsion spring whose whole turns are counted, by the name of the spring.

    Whole turns are counted if the spring acts about the pin of a freedom, or between two bodies whose angles are linear in the
    coordinates: the ground, bodies that freedoms turn, and gears.
    """
    poses = PoseWriter(interface)
    _ = list(poses.blocks())
    found = {}
    freed = {drive.joint: n for n, drive in enumerate(interface.drives) if drive.turns}
    for name, spring in interface.description.springs.items():
        bodies = interface.twisted_bodies(spring)
        if spring.at in freed:
            found[name] = Twist(f"x[{freed[spring.at]}]", (freed[spring.at],))
        elif bodies and set(bodies) <= poses.angles.keys():
            (first, start), (second, end) = (poses.angles[body] for body in bodies)
            words, freedoms = [], []
            for n in sorted(first.keys() | second.keys()):
                one, other = first.get(n, "0.0"), second.get(n, "0.0")
                if one != other:
                    freedoms.append(n)
                    share = _difference(other, one).replace("--", "")
                    signs = {"1.0": f"x[{n}]", "-1.0": f"-x[{n}]"}
                    words.append(signs.get(share, f"({share}) * x[{n}]"))
            if start != end:
                words += [f"{sign}({' + '.join(own)})" for sign, own in (("", end), ("-", start)) if own]
            found[name] = Twist((" + ".join(words) or "0.0").replace("+ -", "- "), tuple(freedoms))
    return found


def _difference(a: str, b: str) -> str:
    """Return the expression a - b, simplified if a or b is zero."""
    if b == "0.0":
        return a
    return f"-{b}" if a == "0.0" else f"{a} - {b}"
