"""Two unbalanced rotors on a sprung cart: a mechanism with two cranks, each commanded or driven by a torque."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

from linkwork.mechanism import Channel, Drawing, Equations, Freedom, Joint, Mechanism, Mode, Part, PublishedSet
from linkwork.parameters import CheckedParameters, CheckedState, Rules
from linkwork.variables import Variable, output, status_variables, tolerance_parameter

from . import drawing, equations
from .equations import Constants


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(CheckedParameters):
    """Parameters in SI units."""

    RULES: ClassVar[Rules] = Rules(positive=("left_mass", "left_radius", "right_mass", "right_radius", "cart_mass"))

    left_mass: float
    left_radius: float
    right_mass: float
    right_radius: float
    cart_mass: float
    cart_stiffness: float
    cart_damping: float

    def constants(self) -> Constants:
        """Return the constants of the equations.

        The moment of inertia of each rotor is 11 m r^2: m r^2 of the unbalanced mass, and ten times as much of a disc.
        """
        m1, r1, m2, r2 = self.left_mass, self.left_radius, self.right_mass, self.right_radius
        return Constants(
            11.0 * m1 * r1 * r1, 11.0 * m2 * r2 * r2, m1 * r1, m2 * r2, self.cart_mass + m1 + m2, self.cart_stiffness,
            self.cart_damping,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Initial(CheckedState):
    """State at the start (rad, rad/s, m, m/s)."""

    left_angle: float = 0.0
    left_speed: float = 0.0
    right_angle: float = 0.0
    right_speed: float = 0.0
    cart_position: float = 0.0
    cart_velocity: float = 0.0


_DEMO = Parameters(
    left_mass=0.2, left_radius=0.05, right_mass=0.1, right_radius=0.06, cart_mass=4.0, cart_stiffness=3000.0,
    cart_damping=12.0,
)  # fmt: skip
_SPEEDS = {"left": 20.0, "right": 30.0}


def _p(name: str, unit: str, description: str, role: str = "") -> Variable:
    start, of = getattr(_DEMO, name.replace(".", "_")), "cart.position" if role else ""
    return Variable(name, "parameter", unit, description, start=start, minimum=0.0, role=role, of=of)


def _rotor(side: str) -> list[Variable]:
    return [
        output(f"{side}.angle", "rad", f"Angle of the {side} rotor, counted on", "", "state", "position"),
        output(f"{side}.speed_out", "rad/s", "Its speed", "", "speed", "velocity", rate_of=f"{side}.angle"),
        output(f"{side}.acceleration_out", "rad/s2", "Its acceleration", rate_of=f"{side}.speed_out"),
    ]


VARIABLES = (
    _p("left.mass", "kg", "Unbalanced mass of the left rotor"),
    _p("left.radius", "m", "Its distance from the axis"),
    _p("right.mass", "kg", "Unbalanced mass of the right rotor"),
    _p("right.radius", "m", "Its distance from the axis"),
    _p("cart.mass", "kg", "Mass of the cart"),
    _p("cart.stiffness", "N/m", "Stiffness of its spring", "stiffness"),
    _p("cart.damping", "N.s/m", "Its viscous damping", "damping"),
    Variable("left.mode", "parameter", "", "0: torque; 1: speed", "", 1, "Integer", 0, 1),
    Variable("right.mode", "parameter", "", "0: torque; 1: speed", "", 1, "Integer", 0, 1),
    Variable("initial.left_angle", "parameter", "rad", "Angle at the start"),
    Variable("initial.left_speed", "parameter", "rad/s", "Speed at the start", "", _SPEEDS["left"]),
    Variable("initial.right_angle", "parameter", "rad", "Angle at the start"),
    Variable("initial.right_speed", "parameter", "rad/s", "Speed at the start", "", _SPEEDS["right"]),
    Variable("initial.cart_position", "parameter", "m", "Position of the cart at the start"),
    Variable("initial.cart_velocity", "parameter", "m/s", "Velocity of the cart at the start"),
    tolerance_parameter(),
    *(
        Variable(f"{side}.{name}", "input", unit, f"{text} of the {side} rotor", "", start)
        for side in ("left", "right")
        for name, unit, text, start in (
            ("torque", "N.m", "Torque", 0.0),
            ("speed", "rad/s", "Commanded speed", _SPEEDS[side]),
            ("acceleration", "rad/s2", "Rate of the commanded speed over a step", 0.0),
        )
    ),
    Variable("cart.force", "input", "N", "Force on the cart"),
    *_rotor("left"),
    *_rotor("right"),
    output("cart.position", "m", "Position of the cart", "", "state", "position"),
    output("cart.velocity", "m/s", "Velocity of the cart", "", "speed", "velocity", rate_of="cart.position"),
    output("cart.acceleration", "m/s2", "Acceleration of the cart", rate_of="cart.velocity"),
    output("left.applied_torque", "N.m", "Torque on the left rotor", role="drive", of="left.angle"),
    output("right.applied_torque", "N.m", "Torque on the right rotor", role="drive", of="right.angle"),
    output("energy.residual", "J", "Energy balance", "", "speed"),
    *status_variables(),
)

MECHANISM = Mechanism(
    name="two-rotors",
    fmu="TwoRotors",
    title="Two rotors on a sprung cart",
    description="Two unbalanced rotors on one sprung, damped cart",
    notes=("The rotors turn in the horizontal plane of the cart's motion.",),
    parameters=Parameters,
    initial=Initial,
    published={
        "two-rotors-demo": PublishedSet(
            _DEMO,
            Initial(left_speed=_SPEEDS["left"], right_speed=_SPEEDS["right"]),
            {f"{side}_speed": speed for side, speed in _SPEEDS.items()},
            "made up for the tests",
        )
    },
    freedoms=(
        *(
            Freedom(
                f"{side}.angle",
                f"{side}.speed_out",
                (f"{side}_angle", f"{side}_speed"),
                Mode(f"{side}.mode", ("torque", "speed"), (f"{side}_torque", f"{side}_speed")),
                2.0 * pi,
            )
            for side in ("left", "right")
        ),
        Freedom("cart.position", "cart.velocity", ("cart_position", "cart_velocity")),
    ),
    channels=(
        *(
            Channel(f"{side}.{name}", f"{side}_{name}", kind, number)
            for number, side in enumerate(("left", "right"))
            for name, kind in (("torque", "force"), ("speed", "command"), ("acceleration", "rate"))
        ),
        Channel("cart.force", "force", freedom=2),
    ),
    variables=VARIABLES,
    position_parameters=("initial.left_angle", "initial.right_angle", "initial.cart_position"),
    experiment=(0.0, 1.0, 1e-3, 1e-9),
    modules=(equations,),
    equations=Equations.of(equations),
    check_assembly=lambda x, p: None,
    error_scale=equations.error_scale,
    drawing=Drawing(
        (
            Joint("G", "zero of the cart"),
            Joint("E", "end of the guide"),
            Joint("C", "cart"),
            Joint("L", "left rotor's unbalance", ("left.radius",)),
            Joint("R", "right rotor's unbalance", ("right.radius",)),
        ),
        drawing.positions,
        (
            Part("guide", ("G", "E"), "guide"),
            Part("slider", ("C", "G", "E"), "cart"),
            Part("spring", ("C", "G", "E"), "spring of the cart", "cart.stiffness"),
            Part("link", ("C", "L"), "left rotor"),
            Part("link", ("C", "R"), "right rotor"),
        ),
        ("L", "R"),
    ),
)
