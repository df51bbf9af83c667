"""Variables of an FMI interface: the record `Variable`, units, and functions that make common variables."""

from __future__ import annotations

from math import pi
from typing import Any, NamedTuple

from .parameters import field_name


class Unit(NamedTuple):
    """A unit as a product of powers of kg, m, s and rad, with the display units that belong to it.

    ``displays`` are pairs (name, factor): value in the display unit = factor * value in the unit.
    """

    kg: int = 0
    m: int = 0
    s: int = 0
    rad: int = 0
    displays: tuple[tuple[str, float], ...] = ()


UNITS = {
    "1": Unit(),
    "s": Unit(s=1),
    "m": Unit(m=1, displays=(("mm", 1e3),)),
    "m/s": Unit(m=1, s=-1),
    "m/s2": Unit(m=1, s=-2),
    "rad": Unit(rad=1, displays=(("deg", 180.0 / pi),)),
    "rad/s": Unit(rad=1, s=-1, displays=(("rpm", 30.0 / pi),)),
    "rad/s2": Unit(rad=1, s=-2),
    "kg": Unit(kg=1),
    "kg.m2": Unit(kg=1, m=2),
    "N": Unit(kg=1, m=1, s=-2),
    "N.m": Unit(kg=1, m=2, s=-2),
    "N/m": Unit(kg=1, s=-2),
    "N.s/m": Unit(kg=1, s=-1),
    "N.m/rad": Unit(kg=1, m=2, s=-2, rad=-1),
    "N.m.s/rad": Unit(kg=1, m=2, s=-1, rad=-1),
    "N/m2": Unit(kg=1, m=-1, s=-2),
    "N/m3": Unit(kg=1, m=-2, s=-2),
    "N.s2/m2": Unit(kg=1, m=-1),
    "m2": Unit(m=2),
    "m3": Unit(m=3),
    "J": Unit(kg=1, m=2, s=-2),
    "W": Unit(kg=1, m=2, s=-3),
}


#: Roles of variables, by name: the causality of a variable with this role, and the meaning of the role.
ROLES = {
    "stiffness": ("parameter", "stiffness of a spring along a coordinate"),
    "damping": ("parameter", "viscous damping along a coordinate"),
    "friction": ("parameter", "level or coefficient of dry friction, which changes fast about rest"),
    "spring": ("parameter", "length, position or angle at which a spring is free"),
    "law": ("parameter", "constant of the force law of a spring"),
    "centre of mass": ("parameter", "coordinate of a centre of mass"),
    "ratio": ("parameter", "ratio of a gear pair, on which the common period of all bodies depends"),
    "gravity": ("parameter", "acceleration of gravity, or a direction that it has"),
    "drive": ("output", "torque or force with which a freedom is driven"),
    "spring force": ("output", "force or torque that a spring exerts"),
    "joint force": ("output", "component of the force in a joint, in the order of the axes"),
    "guide force": ("output", "force of a guide across it"),
    "transmission": ("output", "transmission angle: the links lock where its sine is zero"),
    "twist": (
        "output",
        "angle of a spring whose whole turns are not counted: the torque jumps at half a turn",
    ),
    "residual": ("output", "zero apart from numerical errors"),
}


class Variable(NamedTuple):
    """One scalar variable of an FMI interface.

    Attributes
    ----------
    name : str
        Name in the FMI interface.
    causality : str
        ``parameter``, ``input``, ``output`` or ``local``.
    unit : str
        A key of `UNITS`; empty for Integer and String.
    description : str
    symbol : str
        Symbol in the thesis, in LaTeX; empty if there is none.
    start : float, int or str
        Start value. The start value of an output is only a placeholder: where the true value is needed, it is computed from
        the start values of the parameters and inputs.
    kind : str
        ``Real``, ``Integer`` or ``String``.
    minimum, maximum : float or None
        Bounds of the value; None if there is no bound.
    display : str
        Unit in which the value is shown; empty if it is ``unit``.
    depends : str
        Inputs on which an output depends directly: ``state`` (on no input, only on the state), ``speed`` (only on the
        commanded speeds) or ``all``.
    level : str
        Quantities on which the start value of an output depends: ``position``, ``velocity``, ``all`` or ``none``.
    rate_of : str
        Output whose time derivative this output is; empty if there is none.
    nominal : float or None
        Typical magnitude, given if the start value is 0 and 1 is not typical.
    role : str
        Meaning for the analyses, a key of `ROLES`; empty if they need none.
    of : str
        Owner of the role: the coordinate along which a spring, a damper or a drive acts, or the joint of a force.
    """

    name: str
    causality: str
    unit: str
    description: str
    symbol: str = ""
    start: float | int | str = 0.0
    kind: str = "Real"
    minimum: float | None = None
    maximum: float | None = None
    display: str = ""
    depends: str = "all"
    level: str = "all"
    rate_of: str = ""
    nominal: float | None = None
    role: str = ""
    of: str = ""

    @property
    def tunable(self) -> bool:
        """Return whether the variable is a parameter that may change between steps: stiffness, damping and friction."""
        return self.causality == "parameter" and self.role in ("stiffness", "damping", "friction")

    @property
    def wraps(self) -> bool:
        """Return whether the variable is the angle of a link or of a spring, which may jump by 2 pi."""
        bounded = self.minimum is not None and self.minimum in (-pi, -2.0 * pi) and self.maximum == -self.minimum
        return bounded or self.role == "twist"


def parameter(
    start: Any, name: str, unit: str, description: str, symbol: str = "", role: str = "", of: str = ""
) -> Variable:
    """Return the variable of a parameter; ``start`` is an object of the mechanism's parameters with the start values.

    The lower bound follows from the ``RULES`` of this object. Angles are shown in degrees.
    """
    field = field_name(name)
    shown: dict[str, Any] = {
        "minimum": None if field in start.RULES.free_sign else 0.0,
        "display": "deg" if unit == "rad" else "",
    }
    return Variable(name, "parameter", unit, description, symbol, getattr(start, field), **shown, role=role, of=of)


def centre(start: Any, name: str, unit: str, description: str, symbol: str = "") -> Variable:
    """Return the variable of a parameter that places a centre of mass, see `parameter`."""
    return parameter(start, name, unit, description, symbol, "centre of mass")


def choice(name: str, description: str, start: int, least: int, greatest: int) -> Variable:
    """Return the variable of a parameter that is a whole number from ``least`` to ``greatest``."""
    return Variable(name, "parameter", "", description, "", start, "Integer", least, greatest)


def crank_start(angle: str, speed: float, replaced: str) -> tuple[Variable, Variable]:
    """Return the parameters of the crank's angle and speed at the start; ``replaced`` says when drive.speed is used."""
    text = f"Crank speed at the start; replaced by drive.speed {replaced}"
    return (
        Variable("initial.crank_angle", "parameter", "rad", "Crank angle at the start", angle, display="deg"),
        Variable("initial.crank_speed", "parameter", "rad/s", text, rf"\dot{angle}", speed, display="rpm"),
    )


def speed_inputs(angle: str, start: float) -> tuple[Variable, Variable]:
    """Return the inputs of the commanded crank speed and its rate of change; ``angle`` is the symbol of the crank angle."""
    speed = "Crank speed at the start of a step; used where drive.mode is 1"
    rate = "Rate of change of the crank speed over a step; used where drive.mode is 1"
    return (
        Variable("drive.speed", "input", "rad/s", speed, rf"\dot{angle}", start, display="rpm"),
        Variable("drive.acceleration", "input", "rad/s2", rate, rf"\ddot{angle}"),
    )


def crank_outputs(angle: str) -> tuple[Variable, Variable, Variable]:
    """Return the outputs of angle, speed and acceleration of the crank; ``angle`` is the symbol of the crank angle."""
    return (
        output("crank.angle", "rad", "Crank angle, continuous over full turns", angle, *POSITION, display="deg"),
        output("crank.speed", "rad/s", "Crank speed", rf"\dot{angle}", *RATE, display="rpm", rate_of="crank.angle"),
        output("crank.acceleration", "rad/s2", "Crank acceleration", rf"\ddot{angle}", rate_of="crank.speed"),
    )


def energy_outputs(potential: str, dissipated: str, supplied: str) -> tuple[Variable, ...]:
    """Return the outputs of the energies and their balance.

    The arguments say in words where potential energy, dissipated work and supplied work come from.
    """
    balance = "Energy balance: gained plus dissipated less supplied; zero apart from numerical errors"
    return (
        output("energy.kinetic", "J", "Kinetic energy of all links", "", *RATE, minimum=0.0),
        output("energy.potential", "J", f"Potential energy of {potential}", "", "state"),
        output("energy.dissipated", "J", f"Work lost in {dissipated} since the start", "", "state"),
        output("energy.supplied", "J", f"Work of {supplied} since the start", "", "speed"),
        output("energy.residual", "J", balance, "", "speed", role="residual"),
    )


def closure_outputs(transmission: str, greatest: float) -> tuple[Variable, Variable]:
    """Return the outputs of the closure's residual and of the transmission angle.

    ``transmission`` is the description of this angle, ``greatest`` its greatest value (rad).
    """
    text = "Length by which the loop fails to close"
    angle: dict[str, Any] = {"minimum": 0.0, "maximum": greatest, "display": "deg", "role": "transmission"}
    return (
        output("closure.residual", "m", text, "", *POSITION, minimum=0.0, role="residual"),
        output("transmission.angle", "rad", transmission, "", *POSITION, **angle),
    )


def output(
    name: str, unit: str, description: str, symbol: str = "", depends: str = "all", level: str = "all", **rest: Any
) -> Variable:
    """Return a real output; ``rest`` are further fields of `Variable`, such as ``display`` and ``rate_of``."""
    return Variable(name, "output", unit, description, symbol, 0.0, "Real", depends=depends, level=level, **rest)


#: Dependencies (``depends``, ``level``) of outputs that depend on the positions alone, and on positions and rates.
POSITION, RATE = ("state", "position"), ("speed", "velocity")


def tolerance_parameter() -> Variable:
    """Return the variable ``solver.tolerance`` of every FMU, which bounds the local error of a step."""
    text = "Relative bound of the local error of a step; the master's tolerance is taken where it is tighter"
    return Variable("solver.tolerance", "parameter", "1", text, start=1e-9, minimum=1e-13, maximum=1e-2)


def status_variables() -> tuple[Variable, Variable]:
    """Return the two variables of every FMU that say whether and why its last step was refused.

    They are local, because some masters read every output as a Real.
    """
    codes = (
        "0 good; 1 step out of order; 2 input not finite; 3 limit of assembly; 4 tolerance not met; "
        "5 not initialised; 6 bad parameter; 9 internal error"
    )
    text = "Why the last step was refused, in one sentence; empty while solver.status is 0"
    rest: dict[str, Any] = {"depends": "state", "level": "none"}
    return (
        Variable("solver.status", "local", "", codes, "", 0, "Integer", 0, 9, **rest),
        Variable("solver.message", "local", "", text, "", "", "String", **rest),
    )
