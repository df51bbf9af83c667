"""Write the equations of Coulomb friction in the joints of a described linkage, proportional to the joint forces."""

from __future__ import annotations

from collections.abc import Iterator

from .dynamics import Motion
from .structure import Pin
from .writing import function


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
