"""A rotor with an unbalanced mass on a sprung cart: a mechanism that has nothing to do with linkages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from linkwork.mechanism import CRANK, CRANK_CHANNELS, Channel, Equations, Freedom, Mechanism, PublishedSet
from linkwork.parameters import CheckedParameters, CheckedState, Rules
from linkwork.variables import Variable, output, status_variables, tolerance_parameter

from . import equations
from .equations import Constants


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(CheckedParameters):
    """Parameters in SI units."""

    RULES: ClassVar[Rules] = Rules(positive=("rotor_mass", "rotor_radius", "cart_mass"))

    rotor_mass: float
    rotor_radius: float
    rotor_inertia: float
    cart_mass: float
    cart_stiffness: float
    cart_damping: float
    gravity: float = 9.81

    def constants(self) -> Constants:
        """Return the constants of the equations."""
        m, r = self.rotor_mass, self.rotor_radius
        return Constants(
            self.rotor_inertia + m * r * r, m * r, self.cart_mass + m, self.cart_stiffness, self.cart_damping,
            m * self.gravity * r,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Initial(CheckedState):
    """State at the start (rad, rad/s, m, m/s)."""

    rotor_angle: float = 0.0
    rotor_speed: float = 0.0
    cart_position: float = 0.0
    cart_velocity: float = 0.0


_DEMO = Parameters(
    rotor_mass=0.5, rotor_radius=0.05, rotor_inertia=2e-3, cart_mass=2.0, cart_stiffness=1500.0, cart_damping=6.0
)
_SPEED = 20.0


def _p(name: str, unit: str, description: str, role: str = "") -> Variable:
    start, of = getattr(_DEMO, name.replace(".", "_")), "cart.position" if role else ""
    return Variable(name, "parameter", unit, description, start=start, minimum=0.0, role=role, of=of)


VARIABLES = (
    _p("rotor.mass", "kg", "Unbalanced mass"),
    _p("rotor.radius", "m", "Its distance from the axis"),
    _p("rotor.inertia", "kg.m2", "Moment of inertia about the mass"),
    _p("cart.mass", "kg", "Mass of the cart"),
    _p("cart.stiffness", "N/m", "Stiffness of its spring", "stiffness"),
    _p("cart.damping", "N.s/m", "Its viscous damping", "damping"),
    _p("gravity", "m/s2", "Acceleration of gravity"),
    Variable("drive.mode", "parameter", "", "0: torque; 1: speed", "", 1, "Integer", 0, 1),
    Variable("initial.rotor_angle", "parameter", "rad", "Angle at the start"),
    Variable("initial.rotor_speed", "parameter", "rad/s", "Speed at the start", "", _SPEED),
    Variable("initial.cart_position", "parameter", "m", "Position of the cart at the start"),
    Variable("initial.cart_velocity", "parameter", "m/s", "Velocity of the cart at the start"),
    tolerance_parameter(),
    Variable("drive.torque", "input", "N.m", "Torque on the rotor"),
    Variable("drive.speed", "input", "rad/s", "Speed of the rotor", "", _SPEED),
    Variable("drive.acceleration", "input", "rad/s2", "Its rate of change over a step"),
    Variable("cart.force", "input", "N", "Force on the cart"),
    output("rotor.angle", "rad", "Angle, counted on over full turns", "", "state", "position"),
    output("rotor.speed", "rad/s", "Speed", "", "speed", "velocity", rate_of="rotor.angle"),
    output("rotor.acceleration", "rad/s2", "Angular acceleration", rate_of="rotor.speed"),
    output("cart.position", "m", "Position of the cart", "", "state", "position"),
    output("cart.velocity", "m/s", "Velocity of the cart", "", "speed", "velocity", rate_of="cart.position"),
    output("cart.acceleration", "m/s2", "Acceleration of the cart", rate_of="cart.velocity"),
    output("drive.applied_torque", "N.m", "Torque on the rotor", role="drive", of="rotor.angle"),
    output("energy.residual", "J", "Energy balance", "", "speed"),
    *status_variables(),
)

MECHANISM = Mechanism(
    name="rotor-on-cart",
    fmu="RotorOnCart",
    title="Rotor on a sprung cart",
    description="An unbalanced rotor on a sprung, damped cart",
    notes=("The rotor turns in the vertical plane of the cart's motion.",),
    parameters=Parameters,
    initial=Initial,
    published={
        "rotor-demo": PublishedSet(_DEMO, Initial(rotor_speed=_SPEED), {"speed": _SPEED}, "made up for the tests")
    },
    freedoms=(
        CRANK._replace(coordinate="rotor.angle", rate="rotor.speed", initial=("rotor_angle", "rotor_speed")),
        Freedom("cart.position", "cart.velocity", ("cart_position", "cart_velocity")),
    ),
    channels=(*CRANK_CHANNELS, Channel("cart.force", "force", freedom=1)),
    variables=VARIABLES,
    position_parameters=("initial.rotor_angle", "initial.cart_position"),
    experiment=(0.0, 1.0, 1e-3, 1e-9),
    modules=(equations,),
    equations=Equations.of(equations),
    check_assembly=lambda x, p: None,
    error_scale=equations.error_scale,
)
