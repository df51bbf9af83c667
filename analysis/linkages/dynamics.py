"""Write the applied forces, the equations of motion and the joint forces of a described linkage."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain, count
from typing import NamedTuple

from linkwork.friction import FRICTION_FORCE

from .description import BODY, GROUND, Spring, is_given
from .equations import Twist
from .laws import expression, with_constants
from .parameters import Interface, length_and_mass
from .structure import Dyad, FreedomStep, GearStep, Joint, Pin, RackStep, Side, Step, sliders
from .writing import function, record, tuple_source


class Reaction(NamedTuple):
    """A joint force that is an output: its name, the joint, the body that exerts the force and the body on which it acts."""

    name: str
    joint: Joint
    by: str
    on: str


class Motion:
    """Writer of the functions that compute forces and motion of one linkage."""

    def __init__(self, interface: Interface, counted: Mapping[str, Twist]) -> None:
        self.description, self.structure, self.interface = interface.description, interface.structure, interface
        self.n = len(interface.drives)
        numbers = {drive.joint: n for n, drive in enumerate(interface.drives)}
        #: for each spring that acts along a freedom: the index of this freedom
        self.along = {name: numbers[s.at] for name, s in self.description.springs.items() if s.at in numbers}
        self.counted, self.centred = counted, interface.centred_springs(counted)
        self.bodies = self.structure.bodies
        self.reactions: list[Reaction] = []
        #: steps with gears, and steps with racks, in the order in which their forces are computed
        steps = self.structure.steps[::-1]
        self.geared = [step for step in steps if isinstance(step, GearStep)]
        self.racked = [step for step in steps if isinstance(step, RackStep)]

    def owner(self, own: str) -> str:
        """Return the body that has the point ``own``: the first moving body with it, or the ground if there is none."""
        having = [body for body in self.description.bodies if own in self.interface.points[body]]
        return having[0] if having else GROUND

    # What acts

    def springs(self) -> Iterator[str]:
        """Write the function that computes the stretch of each spring and its rate of change."""
        rows, fields = [], []
        for name, spring in self.description.springs.items():
            free = f" - p.{name}_free" if is_given(spring.free) else ""
            stretch, rate = f"{name}_stretch", f"{name}_rate"
            if name in self.along:
                kind = "angle" if isinstance(self.structure.joints[spring.at], Pin) else "position"
                suffix = f"{free}_{kind}" if free else ""
                rows.append(f"{stretch}, {rate} = x[{self.along[name]}]{suffix}, x[{self.n + self.along[name]}]")
            elif spring.between:
                p, q = spring.between
                rows.append(f"{name}_length, {rate}, {name}_x, {name}_y = distance(b.at_{p}, b.at_{q})")
                rows.append(f"{stretch} = {name}_length{f'{free}_length' if free else ''}")
                fields += [f"{name}_x", f"{name}_y"]
            else:
                if turned := self.interface.twisted_bodies(spring):
                    first, second = turned
                    one, other = self.interface.turn(first, "b."), self.interface.turn(second, "b.")
                    if name in self.counted:
                        rows.append(f"{stretch} = {self.counted[name].angle}{f'{free}_angle' if free else ''}")
                    else:
                        middle = f"p.{name}_MIDDLE + " if name in self.centred else ""
                        angle = f"p.{name}_COS, p.{name}_SIN" if free or middle else "1.0, 0.0"
                        rows.append(f"{stretch} = {middle}turn_difference({one}, {other}, {angle})")
                    rows.append(f"{rate} = {other}.w - {one}.w")
                else:
                    slide = sliders(self.structure)[spring.at]
                    rows.append(f"{name}_position, {rate} = {self.interface.travel(slide)}")
                    rows.append(f"{stretch} = {name}_position{f'{free}_position' if free else ''}")
            fields += [stretch, rate]
        doc = "Stretches of the springs, their rates, and the directions of those between points."
        yield record("Springs", doc, dict.fromkeys(fields, "float"))
        signature = "springs(b: Places, x: tuple[float, ...], p: Constants) -> Springs"
        yield function(
            signature, "Compute the stretches of all springs.", [*rows, f"return Springs({', '.join(fields)})"]
        )

    def resistance(self, name: str, spring: Spring) -> str:
        """Return the expression of the force of a spring's damper, friction and force law; empty if it has none of these."""
        words = []
        if is_given(spring.damping):
            words.append(f"p.{name}_damping * s.{name}_rate")
        if is_given(spring.friction):
            about = self.interface.twisted_bodies(spring)
            words.append(f"p.{name}_friction * tanh(s.{name}_rate / {'FRICTION_RATE' if about else 'FRICTION_SPEED'})")
        if spring.law:
            words.append(f"{name}_law(s.{name}_stretch, s.{name}_rate{', p' if spring.constants else ''})")
        return " + ".join(words)

    def _pull(self, name: str, spring: Spring) -> str:
        return f"p.{name}_stiffness * s.{name}_stretch" if is_given(spring.stiffness) else ""

    def tension(self, name: str, spring: Spring) -> str:
        """Return the expression of the total force of a spring that is not driven; the force opposes the stretch."""
        return " + ".join(filter(None, (self._pull(name, spring), self.resistance(name, spring))))

    def laws(self) -> Iterator[str]:
        """Write the functions of the springs' force laws."""
        for name, spring in self.description.springs.items():
            if spring.law:
                doc = f"Return the force of {name} at a stretch and its rate (N, N.m)."
                p = ", p: Constants" if spring.constants else ""
                law = expression(spring.law, bool(self.interface.twisted_bodies(spring)), f"linkage.springs.{name}.law")
                text = with_constants(law, spring.constants, name)
                yield function(f"{name}_law(x: float, v: float{p}) -> float", doc, [f"return {text}"])

    def applied_forces(self) -> Iterator[str]:
        """Write the force laws of springs, and the function that computes the forces on all bodies and along all freedoms."""
        on: dict[str, list[str]] = {body: [] for body in self.bodies}
        along: list[list[str]] = [[] for _ in range(self.n)]
        rows, lost, gained = [], [], []
        if self.description.gravity:
            for body in self.interface.centres:
                on[body].append(
                    f"force_wrench(p.{body}_mass * p.gx, p.{body}_mass * p.gy, m[{self.bodies.index(body)}].centre)"
                )
        for name, spring in self.description.springs.items():
            resists, pulls = self.resistance(name, spring), self._pull(name, spring)
            if resists:
                rows.append(f"{name}_resistance = {resists}")
                lost.append(f"{name}_resistance * s.{name}_rate")
            total = " + ".join(filter(None, (pulls, f"{name}_resistance" if resists else ""))) or "0.0"
            if spring.driven:
                named = f"{name}.{'torque' if self.interface.twisted_bodies(spring) else 'force'}"
                drive = next(load for load in self.interface.loads if load.name == named)
                total += f" - i.{drive.field}"
                gained.append(f"i.{drive.field} * s.{name}_rate")
            rows.append(f"{name}_force = {total}")
            if name in self.along:
                along[self.along[name]].append(f"- {name}_force")
                continue
            if spring.between:
                p, q = spring.between
                for own, sign in ((p, ""), (q, "-")):
                    if self.owner(own) != GROUND:
                        f = f"{sign}{name}_force * s."
                        on[self.owner(own)].append(f"force_wrench({f}{name}_x, {f}{name}_y, b.at_{own})")
                continue
            turned = self.interface.twisted_bodies(spring)
            first, second = turned or self.structure.joints[spring.at].bodies
            for body, sign in ((second, "-"), (first, "")):
                if body == GROUND:
                    continue
                if turned:
                    on[body].append(f"torque_wrench({sign}{name}_force)")
                else:
                    line, f = f"b.{spring.at}_line", f"{sign}{name}_force"
                    on[body].append(f"force_wrench({f} * {line}.c, {f} * {line}.s, b.{second}_frame.origin)")
        for load in self.description.loads:
            own = load.point
            if load.frame == BODY:
                turn = self.interface.turn(self.owner(own), "b.")
                rows.append(f"{own}_load_x, {own}_load_y = to_ground_axes({turn}, i.{own}_load_x, i.{own}_load_y)")
            x, y = (f"{'' if load.frame == BODY else 'i.'}{own}_load_{axis}" for axis in "xy")
            on[self.owner(own)].append(f"force_wrench({x}, {y}, b.at_{own})")
            gained += [f"{x} * b.at_{own}.vx", f"{y} * b.at_{own}.vy"]
        for body in self.description.torques:
            on[body].append(f"torque_wrench(i.{body}_torque)")
            gained.append(f"i.{body}_torque * b.{body}_frame.turn.w")
        nothing = "Wrench(0.0, 0.0, 0.0)"
        rows.append("wrenches = (")
        for terms in on.values():
            only = terms[0] if len(terms) == 1 else f"add_wrenches({', '.join(terms)})" if terms else nothing
            rows.append(f"    {only},")
        rows.append(")")
        freedoms = [" ".join(terms) or "0.0" for terms in along]
        rows.append(f"along = ({', '.join(freedoms)},)")
        rows.append(
            f"return AppliedForces(wrenches, along, {' + '.join(lost) or '0.0'}, {' + '.join(gained) or '0.0'})"
        )
        yield from self.laws()
        doc = "Forces on the bodies and along the freedoms, powers (W) lost in dampers and friction and gained from loads."
        fields = {"wrenches": "tuple[Wrench, ...]", "along": "tuple[float, ...]", "lost": "float", "gained": "float"}
        yield record("AppliedForces", doc, fields)
        s = "s: Springs, " if self.description.springs else ""
        signature = f"applied_forces(b: Places, m: tuple[Mass, ...], {s}i: Applied, p: Constants) -> AppliedForces"
        yield function(
            signature, "Compute the forces on the bodies and along the freedoms, except those of the drives.", rows
        )

    def masses(self) -> str:
        """Write the function that returns the mass properties of all bodies."""
        names = {parameter.name for parameter in self.interface.parameters}
        rows = ["return ("]
        for body in self.bodies:
            frame = f"b.{body}_frame"
            if body not in self.interface.centres:
                rows.append(f"    Mass(0.0, 0.0, {frame}.origin, {frame}),")
                continue
            x, y = self.interface.centres[body]
            centre = f"{frame}.origin" if (x, y) == ("0.0", "0.0") else f"point({frame}, {x}, {y})"
            inertia = f"p.{body}_inertia" if f"{body}.inertia" in names else "0.0"
            rows.append(f"    Mass(p.{body}_mass, {inertia}, {centre}, {frame}),")
        signature = "masses(b: Places, p: Constants) -> tuple[Mass, ...]"
        return function(signature, "Compute the masses of the bodies at their places.", [*rows, ")"])

    # Forces in the joints

    def forces(self) -> Iterator[str]:
        """Write the function that computes all joint forces, from the last dyad back to the ground."""
        rows = [f"on_{body} = required_wrench(m[{n}], e, wrenches[{n}])" for n, body in enumerate(self.bodies)]
        taken: set[str] = set()

        def add_reaction(joint: Joint, by: str, on: str, force: str) -> None:
            # the forces in a pin of several bodies are C, C2, C3, without the names of other joints and racks
            others = {*self.structure.joints, *self.description.racks}
            further = (f"{joint.name}{n}" for n in count(2) if f"{joint.name}{n}" not in others)
            name = next(n for n in chain([joint.name], further) if n not in taken)
            taken.add(name)
            self.reactions.append(Reaction(name, joint, by, on))
            rows.append(f"in_{name} = {force}")

        def add_support(joint: Joint, by: str, on: str) -> None:
            add_reaction(joint, by, on, f"on_{on}")
            if by != GROUND:
                rows.append(f"on_{by} = add_wrenches(on_{by}, on_{on})")

        def add_tooth_force(step: GearStep | RackStep, name: str, force: str) -> None:
            rows.append(f"{name} = {force}")
            rows.append(f"on_{step.body} = subtract_wrenches(on_{step.body}, {name})")
            if step.mate != GROUND:
                rows.append(f"on_{step.mate} = add_wrenches(on_{step.mate}, {name})")

        def add_step(step: Step) -> None:
            if isinstance(step, FreedomStep):
                add_support(step.joint, step.parent, step.body)
            elif isinstance(step, GearStep):
                add_tooth_force(step, f"in_{step.gear}", self._mate_force(step))
                add_support(step.pin, step.parent, step.body)
            elif isinstance(step, RackStep):
                add_tooth_force(step, f"in_{step.rack}", self._rack_force(step))
                add_support(step.joint, step.parent, step.body)
            else:
                first, second = step.ends
                add_reaction(step.inner, second, first, self._inner_force(step))
                inner = f"in_{self.reactions[-1].name}"
                rows.append(f"on_{first} = subtract_wrenches(on_{first}, {inner})")
                rows.append(f"on_{second} = add_wrenches(on_{second}, {inner})")
                for side in step.sides:
                    for inside in reversed(side.inside):
                        add_step(inside)
                    add_support(side.joint, side.parent, side.body)

        for step in reversed(self.structure.steps):
            add_step(step)
        teeth = (*(step.gear for step in self.geared), *(step.rack for step in self.racked))
        names = [f"in_{name}" for name in (*(r.name for r in self.reactions), *teeth)]
        doc = "Forces in the joints, each of one body on another, and their moments about the ground's origin."
        yield record("Forces", doc, dict.fromkeys(names, "Wrench"))
        doc = "Compute the forces in all joints, from the last dyad back to the ground."
        arguments = "b: Places, m: tuple[Mass, ...], wrenches: tuple[Wrench, ...], e: tuple[float, ...], p: Constants"
        yield function(f"forces({arguments}) -> Forces", doc, [*rows, f"return Forces({', '.join(names)})"])

    def _mate_force(self, step: GearStep) -> str:
        other = self.structure.common_pin(step.mate, step.parent)
        ratio = f"1.0 / p.{step.gear}_ratio" if step.inverse else f"p.{step.gear}_ratio"
        return f"force_from_mate(b.at_{step.pin.name}, b.at_{other}, {ratio}, on_{step.body})"

    def _rack_force(self, step: RackStep) -> str:
        """Return the expression of the tooth force on the body of a step, a rack or a gear, from its mate."""
        side = "" if step.slide.bodies[0] == step.parent else "-"
        call = "force_on_gear" if step.turns else "force_on_rack"
        line = f"b.{step.slide.name}_line"
        return f"{call}(b.at_{step.pin.name}, {line}, {side}p.{step.rack}_radius, on_{step.body})"

    def _inner_force(self, step: Dyad) -> str:
        def total(side: Side) -> str:
            names = [f"on_{body}" for body in side.bodies]
            return names[0] if len(names) == 1 else f"add_wrenches({', '.join(names)})"

        one, other = (total(side) for side in step.sides)
        outer = [f"b.at_{s.joint.name}" if isinstance(s.joint, Pin) else f"b.{s.joint.name}_line" for s in step.sides]
        inner = f"b.at_{step.inner.name}" if isinstance(step.inner, Pin) else f"b.{step.inner.name}_line"
        p, q = outer
        return {
            "RRR": f"pin_between_pins({p}, {inner}, {q}, {one}, {other})",
            "RRP": f"pin_to_block({p}, {inner}, {q}, {one}, {other})",
            "PRP": f"pin_of_blocks({inner}, {p}, {q}, {one}, {other})",
            "RPR": f"slide_between_pins({p}, {q}, {inner}, {one}, {other})",
            "RPP": f"slide_to_block({p}, {q}, {inner}, {one}, {other})",
        }[step.kind]

    # Equations of motion

    def inputs(self) -> Iterator[str]:
        """Write the record of the acting loads and commanded rates, and the function that computes it from modes and inputs."""
        fields, values, names = [], [], []
        modes = [f"{drive.name}_mode" for drive in self.interface.drives if drive.table]
        for drive in self.interface.drives:
            fields.append(f"{drive.name}_load")
            names.append(f"{drive.name}_load")
            if drive.table:
                names += [f"_{drive.name}_speed", f"{drive.name}_rate"]
                fields += [f"{drive.name}_held", f"{drive.name}_given"]
                mode = f"{drive.name}_mode"
                values += [f"(1.0 - {mode}) * {drive.name}_load", mode, f"{mode} * {drive.name}_rate"]
            else:
                values.append(f"{drive.name}_load")
        loads = [load.field for load in self.interface.loads]
        doc = "For each freedom its load, whether its rate is commanded, the commanded acceleration; then the other loads."
        yield record("Applied", doc, dict.fromkeys((*fields, *loads), "float"))
        rows = [f"{tuple_source(modes)} = modes"] if modes else []
        rows += [f"{tuple_source((*names, *loads))} = u", f"return Applied({', '.join((*values, *loads))})"]
        signature = "apply_inputs(modes: tuple[float, ...], u: tuple[float, ...], p: Constants) -> Applied"
        yield function(
            signature, "Return the loads and the commanded accelerations for values of the modes and the inputs.", rows
        )

    def motion(self) -> Iterator[str]:
        """Write the functions for accelerations, state derivative, energies, speed jumps, initial state and clearance."""
        n, drives = range(self.n), self.interface.drives
        # for each freedom 1 if the rate is commanded, otherwise 0; and the commanded acceleration
        held, known = (
            tuple_source(f"i.{d.name}_{field}" if d.table else "0.0" for d in drives) for field in ("held", "given")
        )
        s = "s, " if self.description.springs else ""
        rows = ["b = places(x, p)", "m = masses(b, p)"]
        if s:
            rows.append("s = springs(b, x, p)")
        rows += [f"a = applied_forces(b, m, {s}i, p)", f"f = generalised_forces(m, a.wrenches, {self.n})"]
        right = [f"f[{k}] + a.along[{k}] + i.{drives[k].name}_load" for k in n]
        rows += [f"right = ({', '.join(right)},)", f"matrix = mass_matrix(m, {self.n})"]
        rows += [f"held_ones = {held}", f"e = accelerations(matrix, right, held_ones, {known})"]
        wrenches, lost = "a.wrenches", "a.lost"
        if self.description.friction:
            # 0.1 N/kg is a hundredth of the weight: 0.01 N would be more than all forces of a microscopic linkage
            rounding = min(FRICTION_FORCE, 0.1 * length_and_mass(self.interface)[1])
            wrenches, lost = "wrenches", "lost"
            rows += [
                "wrenches, lost = a.wrenches, a.lost",
                "if p.rough:",
                "    units = rubbing(b, p)",
                "    without = contacts(forces(b, m, wrenches, e, p), b)",
                f"    sizes = contact_forces(without, responses(b, m, units, matrix, held_ones, p), {rounding})",
                "    wrenches = add_friction(wrenches, units, sizes)",
                "    lost = lost + sum(size * unit.lost for size, unit in zip(sizes, units))",
                f"    f = generalised_forces(m, wrenches, {self.n})",
                f"    right = {tuple_source(right)}",
                f"    e = accelerations(matrix, right, held_ones, {known})",
            ]
        rows.append("inertial = multiply(matrix, e)")
        loads = [
            f"i.{d.name}_load{f' + held_ones[{k}] * (inertial[{k}] - right[{k}])' if d.table else ''}"
            for k, d in enumerate(drives)
        ]
        rows.append(f"loads = ({', '.join(loads)},)")
        power = " + ".join(f"loads[{k}] * x[{self.n + k}]" for k in n)
        rows.append(f"return Motion(b, m, {s}{wrenches}, e, loads, {lost}, {power} + a.gained)")
        numbers = "tuple[float, ...]"
        fields = {"places": "Places", "masses": "tuple[Mass, ...]"} | ({"springs": "Springs"} if s else {})
        fields |= {"wrenches": "tuple[Wrench, ...]"}
        fields |= {"accelerations": numbers, "loads": numbers, "lost": "float", "supplied": "float"}
        doc = "The bodies, forces on them, accelerations of the freedoms and loads on them, power lost and supplied."
        yield record("Motion", doc, fields)
        doc = "Compute the accelerations, and the loads that hold the commanded rates."
        yield function(f"motion(x: {numbers}, i: Applied, p: Constants) -> Motion", doc, rows)
        rates = ", ".join(f"x[{self.n + k}]" for k in n)
        rows = ["m = motion(x, i, p)", f"return ({rates}, *m.accelerations, m.lost, m.supplied)"]
        signature = f"derivative(x: {numbers}, i: Applied, p: Constants) -> {numbers}"
        yield function(signature, "Compute the time derivative of the state.", rows)
        yield from self._energies()
        yield self._jump(held)
        signature = f"start(x: {numbers}, i: Applied, p: Constants) -> {numbers}"
        yield function(signature, "Return the state at the start as it is.", ["return x"])
        yield self._clearance(held)

    def _clearance(self, held: str) -> str:
        rows, margin = ["b = places(x, p)"], "b.clearance"
        if self.description.friction:
            rows += ["if not p.rough:", "    return b.clearance", f"m, held_ones = masses(b, p), {held}"]
            rows.append(f"response = responses(b, m, rubbing(b, p), mass_matrix(m, {self.n}), held_ones, p)")
            margin = "lesser(b.clearance, jamming_margin(response))"
        doc = "Compute the least sine of the transmission angles of all dyads, or the margin to jamming if that is smaller."
        signature = "clearance(x: tuple[float, ...], i: Applied, p: Constants) -> float"
        return function(signature, doc, [*rows, f"return {margin}"])

    def _energies(self) -> Iterator[str]:
        terms = []
        if self.description.gravity:
            for n, body in enumerate(self.bodies):
                if body in self.interface.centres:
                    terms.append(f"- p.{body}_mass * (p.gx * m[{n}].centre.x + p.gy * m[{n}].centre.y)")
        for name, spring in self.description.springs.items():
            if is_given(spring.stiffness):
                terms.append(f"+ 0.5 * p.{name}_stiffness * s.{name}_stretch * s.{name}_stretch")
        s = "s: Springs, " if self.description.springs else ""
        doc = "Compute the energy of the springs, and of gravity with zero at the ground's origin (J)."
        signature = f"potential_energy(m: tuple[Mass, ...], {s}p: Constants) -> float"
        yield function(signature, doc, [f"return {' '.join(terms).removeprefix('+ ') or '0.0'}"])
        s = "springs(b, x, p), " if self.description.springs else ""
        rows = ["b = places(x, p)", "m = masses(b, p)", f"return kinetic_energy(m) + potential_energy(m, {s}p)"]
        yield function(
            "energy(x: tuple[float, ...], p: Constants) -> float", "Compute the mechanical energy (J).", rows
        )

    def _jump(self, held: str) -> str:
        n = range(self.n)
        place, changes = 0, []
        for k, drive in enumerate(self.interface.drives):
            changes.append(f"u[{place + 1}] - x[{self.n + k}]" if drive.table else "0.0")
            place += 3 if drive.table else 1
        rows = [
            f"matrix = mass_matrix(masses(places(x, p), p), {self.n})",
            f"change = accelerations(matrix, ({'0.0, ' * self.n}), {held}, ({', '.join(changes)},))",
            f"before = ({', '.join(f'x[{self.n + k}]' for k in n)},)",
            "after = tuple(a + b for a, b in zip(before, change))",
            "gained = zip(after, multiply(matrix, after), before, multiply(matrix, before))",
            "work = 0.5 * sum(a * b - c * d for a, b, c, d in gained)",
            f"return ({', '.join(f'x[{k}]' for k in n)}, *after, x[{2 * self.n}], x[{2 * self.n + 1}] + work)",
        ]
        signature = "jump(x: tuple[float, ...], i: Applied, u: tuple[float, ...], p: Constants) -> tuple[float, ...]"
        doc = "Return the state after a jump of the commanded rates: the momenta of the other freedoms are conserved."
        return function(signature, doc, rows)


class Contacts:
    """Writer of the friction functions of one linkage: `rubbing`, `contacts` and `responses`."""

    def __init__(self, motion: Motion) -> None:
        self.motion, self.interface = motion, motion.interface
        self.joints = [motion.structure.joints[name] for name in motion.description.friction]

    def blocks(self) -> Iterator[str]:
        """Write the functions `rubbing`, `contacts` and `responses`.

        `rubbing` computes the friction for a force of 1 N in each joint, `contacts` the forces in the joints with friction, and
        `responses` the changes of these forces that the friction of `rubbing` causes.
        """
        yield self._unit_friction()
        rows = ["return ("]
        for joint in self.joints:
            f, line = f"f.in_{joint.name}", f"b.{joint.name}_line"
            if isinstance(joint, Pin):
                rows.append(f"    ({f}.x, {f}.y),")
            else:
                rows.append(f"    ({line}.c * {f}.y - {line}.s * {f}.x, 0.0),")
        signature = "contacts(f: Forces, b: Places) -> tuple[tuple[float, float], ...]"
        yield function(signature, "Return the forces in the joints with friction (N).", [*rows, ")"])
        n = self.motion.n
        rows = [
            "bodies = tuple(remove_bias(body) for body in m)",
            "found = []",
            "for unit in units:",
            f"    along = generalised_forces(bodies, unit.wrenches, {n})",
            f"    change = accelerations(matrix, along, held_ones, ({'0.0, ' * n}))",
            "    found.append(contacts(forces(b, bodies, unit.wrenches, change, p), b))",
            "return tuple(found)",
        ]
        arguments = "b: Places, m: tuple[Mass, ...], units: tuple[Rubbing, ...], matrix: tuple[tuple[float, ...], ...]"
        signature = f"responses({arguments}, held_ones: tuple[float, ...], p: Constants)"
        doc = "Return, for a force of 1 N in each joint in turn, the change of all joint forces by its friction."
        yield function(f"{signature} -> tuple[tuple[tuple[float, float], ...], ...]", doc, rows)

    def _unit_friction(self) -> str:
        rows, units = ["none = Wrench(0.0, 0.0, 0.0)"], []
        for joint in self.joints:
            name = joint.name
            first, second = joint.bodies
            slip, rub = f"{name}_slip", f"{name}_rub"
            if isinstance(joint, Pin):
                one, other = self.interface.turn(first, "b."), self.interface.turn(second, "b.")
                rows.append(f"{slip} = {other}.w - {one}.w")
                rows.append(f"{rub} = p.{name}_friction_radius * tanh({slip} / FRICTION_RATE)")
                on = {first: f"torque_wrench({rub})", second: f"torque_wrench(-{rub})"}
            else:
                rows.append(f"{slip} = {self.interface.travel(joint)}[1]")
                rows.append(f"{rub} = p.{name}_friction_coefficient * tanh({slip} / FRICTION_SPEED)")
                at = f"b.{second}_frame.origin"
                one, other = (
                    f"force_wrench({r} * b.{name}_line.c, {r} * b.{name}_line.s, {at})" for r in (rub, f"-{rub}")
                )
                on = {first: one, second: other}
            wrenches = "".join(f"{on.get(body, 'none')}, " for body in self.motion.bodies)
            units.append(f"    Rubbing(({wrenches}), {rub} * {slip}),")
        doc = "Compute the friction that a force of 1 N in each joint causes."
        signature = "rubbing(b: Places, p: Constants) -> tuple[Rubbing, ...]"
        return function(signature, doc, [*rows, "return (", *units, ")"])
