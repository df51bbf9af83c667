"""Exact sensitivities of the slider-crank: derivatives of motion and joint forces by dimensions, masses and settings.

The nominal mechanism and its motion are a `ForceTurn`; an error adds to one of its dimensions, masses or settings while all the
others, and the motion of the crank, stay. The derivatives are exact: the plant's own equations on dual numbers
(`analysis.numerics.dual`). The same equations on arrays of random samples are the Monte Carlo (`sampling`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType, SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from linkwork.parameters import field_name
from linkwork.slider_crank import parameters, variables
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters

from ..files import unknown_name
from ..numerics.dual import Dual, dual
from ..numerics.dual import variables as independent
from ..numerics.tracing import rebound
from .forces import SLIDER_FORCE, ForceTurn, solve
from .quantities import JOINTS, MaskedArray, masked_array
from .shifts import ShiftMotion, in_the_shaft, on_arrays, with_groove

#: What is in error besides the mechanism's parameters: the crank angle and the axial shift, by the names of their outputs.
ANGLE, SHIFT = "crank.angle", "shift.position"
#: The errors for which sensitivities are computed by default: theta1, S1, a1, a2, a4, alpha4.
DIMENSIONS = (ANGLE, SHIFT, "crank.length", "rod.length", "guide.offset", "guide.twist")
_ERRORS = {
    v.name: v
    for v in variables.VARIABLES
    if v.name in (ANGLE, SHIFT)
    or (
        v.kind == "Real"
        and field_name(v.name) in SliderCrankParameters.__dataclass_fields__
        and not v.name.startswith("groove.")
    )
}
#: Everything that may be in error, with its unit, and the symbols of the thesis.
ERRORS: Mapping[str, str] = MappingProxyType({name: v.unit for name, v in _ERRORS.items()})
SYMBOLS: Mapping[str, str] = MappingProxyType({name: v.symbol for name, v in _ERRORS.items() if v.symbol})

#: Quantities that no force takes part in.
KINEMATIC = ("slider.position", "slider.velocity", "slider.acceleration")
#: Field of `Reactions` and its component by the name of the FMI interface.
_COMPONENTS = {
    f"{vector.removesuffix('_moment')}.{'m' if vector.endswith('_moment') else 'f'}{axis}": (vector, axis)
    for vector in JOINTS
    for axis in "xyz"
}
#: Everything that sensitivities are given of, by the names of the FMI interface, with its unit. Vectors are in the ground
#: frame, the moment of the bearing about O; bearing.fz is the axial force. In the thesis's problem, where the torque is given,
#: drive.applied_torque has no sensitivity and slider.load is the force that is sought.
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        v.name: v.unit
        for v in variables.VARIABLES
        if v.name in (*KINEMATIC, *_COMPONENTS, "drive.applied_torque", "slider.load")
    }
)
#: What does not depend on the load where that is sought, and so is determined at a dead centre too.
FREE_OF_LOAD = (*KINEMATIC, "drive.applied_torque", "guide.mx", "guide.my", "guide.mz")

#: The constants of the equations for arrays or dual numbers in the place of the parameters.
_CONSTANTS: Callable[[Any], Constants] = rebound((parameters,), {"cos": np.cos, "sin": np.sin}).of(
    SliderCrankParameters.constants
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivities:
    """Exact first derivatives over the turn.

    Attributes
    ----------
    turn : ForceTurn
        The nominal mechanism and its motion.
    names : tuple of str
        The m errors by which is derived.
    values : mapping
        Quantity to its nominal values, masked array (n,).
    derivatives : mapping
        Quantity to masked array (m, n): the quantity's unit over the error's. What the load takes part in is masked at the
        dead centres where that is sought.
    """

    turn: ForceTurn
    names: tuple[str, ...]
    values: Mapping[str, MaskedArray]
    derivatives: Mapping[str, MaskedArray]

    def of(self, quantity: str, error: str) -> MaskedArray:
        """Derivative (n,) of a quantity by an error.

        Raises
        ------
        ParameterError
            If it is not among them.
        """
        check_names((quantity,), self.derivatives, "quantity")
        check_names((error,), self.names, "error")
        return cast(MaskedArray, self.derivatives[quantity][self.names.index(error)])


def sensitivities(
    turn: ForceTurn, errors: Sequence[str] = DIMENSIONS, quantities: Sequence[str] = tuple(QUANTITIES)
) -> Sensitivities:
    """Derivatives of motion, torque and joint forces by dimensions, masses and settings, over the turn.

    Parameters
    ----------
    turn : ForceTurn
        The nominal mechanism. The motion of the crank and the rates of the shift are held, and what is given of load and
        torque. An error of the crank angle leaves the shift as it is, unless a groove in the shaft makes it; one of a length
        leaves masses, centres of mass and moments of inertia as they are.
    errors : sequence of str
        Of `ERRORS`; by default `DIMENSIONS`.
    quantities : sequence of str
        Of `QUANTITIES`; by default all.

    Raises
    ------
    ParameterError
        If there is nothing of such a name.
    """
    check_names(errors, ERRORS, "error")
    check_names(quantities, QUANTITIES, "quantity")
    n, m = len(turn), len(errors)
    found, _ = vary(turn, np.arange(n), error_variables(errors, n)).evaluate(quantities)
    values, derivatives = {}, {}
    for name in quantities:
        x, dead = dual(found[name]), undetermined(turn, name)
        values[name] = masked_array(np.broadcast_to(x.real, (n,)), dead)
        derivatives[name] = masked_array(np.broadcast_to(x.dual, (m, n)), dead)
    return Sensitivities(
        turn=turn,
        names=tuple(errors),
        values=MappingProxyType(values),
        derivatives=MappingProxyType(derivatives),
    )


@dataclass(frozen=True, slots=True)
class Varied:
    """Mechanism and motion with errors, at the points ``at`` of a turn: constants, crank angle and shift."""

    turn: ForceTurn
    at: Any
    p: Constants
    angle: Any
    moving: ShiftMotion

    @property
    def square(self) -> Any:
        """What is positive where the rod reaches the guide (m2)."""
        return on_arrays().assembly_square(self.angle, self.moving.shift, self.p)

    def evaluate(self, quantities: Collection[str]) -> tuple[dict[str, Any], Any]:
        """The quantities, and the lever of the slider's force.

        Only what the quantities need is calculated; the lever is zero where no force is asked for.
        """
        turn, p, moving = self.turn, self.p, self.moving
        w, e = turn.speed[self.at], turn.acceleration[self.at]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if set(quantities) <= set(KINEMATIC):
                return self._motion(quantities, w, e), 0.0
            sought = turn.sought == SLIDER_FORCE
            given = (turn.torque if sought else turn.slider_force).data[self.at]
            s = solve(p, self.angle, moving, w, e, given=given, torque=sought, groove=in_the_shaft(turn.law))
        found = {
            "slider.position": s.position.s4,
            "slider.velocity": s.motion.slider_velocity,
            "slider.acceleration": s.motion.slider_acceleration,
            "drive.applied_torque": given if sought else s.motion.torque,
            "slider.load": s.load,
        }
        found |= {name: getattr(getattr(s.reactions, vector), axis) for name, (vector, axis) in _COMPONENTS.items()}
        found["bearing.fz"] = s.reactions.axial
        return {name: found[name] for name in quantities}, s.ratio

    def _motion(self, quantities: Collection[str], w: Any, e: Any) -> dict[str, Any]:
        f, p, moving = on_arrays(), self.p, self.moving
        q = f.position(self.angle, moving.shift, p)
        found = {"slider.position": q.s4}
        if set(quantities) != {"slider.position"}:
            k = f.coefficients(q, p)
            found["slider.velocity"] = k.kth * w + k.ks * moving.velocity
            centripetal = f.centripetal(q, k, w, moving.velocity, p)
            found["slider.acceleration"] = k.kth * e + k.ks * moving.acceleration + centripetal
        return {name: found[name] for name in quantities}


def vary(turn: ForceTurn, at: Any, errors: Mapping[str, Any]) -> Varied:
    """The mechanism with the errors, arrays or dual numbers by name, at the points ``at`` of the turn."""
    nominal = {field.name: getattr(turn.parameters, field.name) for field in fields(turn.parameters)}
    changed = {
        field_name(name): nominal[field_name(name)] + x for name, x in errors.items() if name not in (ANGLE, SHIFT)
    }
    p = with_groove(_CONSTANTS(SimpleNamespace(**nominal | changed)), turn.law)
    angle = turn.angle[at] + errors.get(ANGLE, 0.0)
    if in_the_shaft(turn.law):
        moving = turn.law.at(angle, turn.speed[at], turn.acceleration[at])
    else:
        moving = ShiftMotion(turn.shift[at], turn.shift_velocity[at], turn.shift_acceleration[at])
    return Varied(turn, at, p, angle, moving._replace(shift=moving.shift + errors.get(SHIFT, 0.0)))


def error_variables(names: Sequence[str], n: int, moved: int = 0, step: float = 0.0) -> dict[str, Dual]:
    """Errors at n points as independent variables, all zero but the one that is moved by a step."""
    values = np.zeros((len(names), n))
    values[moved] = step
    return dict(zip(names, independent(*values)))


def undetermined(turn: ForceTurn, quantity: str) -> NDArray[np.bool_]:
    """Where the nominal mechanism is at a dead centre at which the quantity is not determined."""
    dead = np.ma.getmaskarray(turn.slider_force)
    return np.zeros(len(turn), dtype=bool) if quantity in FREE_OF_LOAD else dead


def check_names(names: Sequence[str], known: Collection[str], kind: str) -> None:
    """Make sure that there are quantities or errors of these names.

    Raises UnknownNameError if one is not among the known.
    """
    for name in names:
        if name not in known:
            raise unknown_name(name, known, f"{kind} {name!r}")
