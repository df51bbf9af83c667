"""The thesis's dual-number method held against vector mechanics, quantity by quantity over the turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from linkwork.errors import InputError

from .closure import close
from .dual_dynamics import joint_loads, rates
from .forces import NO_LEVER, SLIDER_FORCE, ForceTurn
from .quantities import JOINTS
from .shifts import in_the_shaft, on_arrays


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How far two ways of finding a quantity are apart at most, in SI.

    ``largest`` is the greatest magnitude of the quantity, ``relative`` the difference over the greatest magnitude of any
    quantity of the same unit.
    """

    quantity: str
    unit: str
    largest: float
    difference: float
    relative: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Dual numbers less vector mechanics.

    Attributes
    ----------
    differences : tuple of Difference
    angles : int
        Crank angles that were compared: those at which everything is determined.
    rotation_residual, length_residual : float
        By how much the loop fails to close at most (rad, m).
    iterations : int
        That closing it took at most.
    rod_moment : float
        Greatest moment about the rod's line (N.m), which no equation asks to be none.
    """

    differences: tuple[Difference, ...]
    angles: int
    rotation_residual: float
    length_residual: float
    iterations: int
    rod_moment: float

    def agrees(self, tolerance: float) -> bool:
        """Whether all relative differences are within the tolerance."""
        return all(d.relative <= tolerance for d in self.differences)


def compare(turn: ForceTurn) -> Comparison:
    """Find motion and forces of a turn again by dual matrices with true ball joints and dual momenta.

    Raises
    ------
    InputError
        If the slider's force is sought and a groove in the shaft makes the shift, which the dual method does not cover, or if
        it is determined at none of the angles.
    """
    sought = turn.sought == SLIDER_FORCE
    if sought and in_the_shaft(turn.law):
        raise InputError(
            "the dual-number method seeks the slider's force of a shift that is driven apart from the crank: give the load, "
            "or a groove that is not in the shaft"
        )
    good = ~np.ma.getmaskarray(turn.slider_force)
    if not good.any():
        none = "the slider's force has no lever on the crank at any of the angles, which are all dead centres"
        raise InputError(f"there is nothing to compare: {NO_LEVER if turn.without_lever else none}; give the load")
    closure = close(turn.parameters, turn.angle[good], turn.shift[good])
    moving: dict[str, Any] = {
        "speed": turn.speed[good],
        "acceleration": turn.acceleration[good],
        "shift_velocity": turn.shift_velocity[good],
        "shift_acceleration": turn.shift_acceleration[good],
    }
    motion = rates(closure, **moving)
    # what the dual vectors call the slider's force is all along the guide, spring, damper and friction included
    pushed = on_arrays().slider_resistance(
        closure.slider_position, motion.slider_velocity, 0.0, turn.parameters.constants()
    )
    if sought:
        loads = joint_loads(closure, torque=turn.torque.data[good], **moving)
    else:
        loads = joint_loads(closure, slider_force=pushed + turn.slider_force.data[good], **moving)
    pairs: list[tuple[str, str, Any, Any]] = [
        ("slider position", "m", closure.slider_position, turn.slider_position),
        ("slider velocity", "m/s", motion.slider_velocity, turn.slider_velocity),
        ("slider acceleration", "m/s2", motion.slider_acceleration, turn.slider_acceleration),
        ("slider force", "N", loads.slider_force - pushed, turn.slider_force),
        ("axial force on the crank", "N", loads.axial, turn.axial_force),
    ]
    pairs += [(joint.words, joint.unit, getattr(loads, name), turn.vector(name)) for name, joint in JOINTS.items()]
    found = [
        (words, unit, float(np.abs(b[good]).max()), float(np.abs(a - np.ma.getdata(b)[good]).max()))
        for words, unit, a, b in pairs
    ]
    scales = {unit: max(size for _, other, size, _ in found if other == unit) or 1.0 for _, unit, _, _ in found}
    return Comparison(
        differences=tuple(
            Difference(
                quantity=words, unit=unit, largest=size, difference=difference, relative=difference / scales[unit]
            )
            for words, unit, size, difference in found
        ),
        angles=int(good.sum()),
        rotation_residual=float(closure.rotation_residual.max()),
        length_residual=float(closure.length_residual.max()),
        iterations=closure.iterations,
        rod_moment=float(np.abs(loads.residual).max()),
    )
