"""A driven pendulum: a mechanism with one degree of freedom."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

from linkwork.mechanism import Channel, Drawing, Equations, Freedom, Joint, Mechanism, Part, PublishedSet
from linkwork.parameters import CheckedParameters, CheckedState, Rules
from linkwork.variables import Variable, output, status_variables, tolerance_parameter

from . import equations
from .equations import Constants


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(CheckedParameters):
    """Parameters in SI units."""

    RULES: ClassVar[Rules] = Rules(positive=("pendulum_inertia",))

    pendulum_inertia: float
    pendulum_weight: float
    pendulum_damping: float = 0.0

    def constants(self) -> Constants:
        """Return the constants of the equations."""
        return Constants(self.pendulum_inertia, self.pendulum_damping, self.pendulum_weight)


@dataclass(frozen=True, slots=True, kw_only=True)
class Initial(CheckedState):
    """State at the start (rad, rad/s)."""

    pendulum_angle: float = 0.0
    pendulum_speed: float = 0.0


VARIABLES = (
    Variable("pendulum.inertia", "parameter", "kg.m2", "Moment of inertia", start=0.1, minimum=0.0),
    Variable("pendulum.weight", "parameter", "N.m", "Greatest moment of its weight", start=2.0, minimum=0.0),
    Variable(
        "pendulum.damping",
        "parameter",
        "1",
        "Damping (N.m.s/rad)",
        start=0.02,
        minimum=0.0,
        role="damping",
        of="pendulum.angle",
    ),
    Variable("initial.pendulum_angle", "parameter", "rad", "Angle at the start"),
    Variable("initial.pendulum_speed", "parameter", "rad/s", "Speed at the start"),
    tolerance_parameter(),
    Variable("drive.torque", "input", "N.m", "Torque on the pendulum"),
    output("pendulum.angle", "rad", "Angle, counted on over full turns", "", "state", "position"),
    output("pendulum.speed", "rad/s", "Speed", "", "state", "velocity", rate_of="pendulum.angle"),
    output("pendulum.acceleration", "rad/s2", "Angular acceleration", rate_of="pendulum.speed"),
    output("energy.residual", "J", "Energy balance", "", "state"),
    *status_variables(),
)

MECHANISM = Mechanism(
    name="pendulum",
    fmu="Pendulum",
    title="Driven pendulum",
    description="A damped pendulum driven by a torque",
    notes=("One freedom.",),
    parameters=Parameters,
    initial=Initial,
    published={
        "pendulum-demo": PublishedSet(
            Parameters(pendulum_inertia=0.1, pendulum_weight=2.0, pendulum_damping=0.02),
            Initial(pendulum_speed=30.0),
            {},
            "made up for the tests",
        )
    },
    freedoms=(Freedom("pendulum.angle", "pendulum.speed", ("pendulum_angle", "pendulum_speed"), period=2.0 * pi),),
    channels=(Channel("drive.torque", "torque", freedom=0),),
    variables=VARIABLES,
    position_parameters=("initial.pendulum_angle",),
    experiment=(0.0, 1.0, 1e-3, 1e-9),
    modules=(equations,),
    equations=Equations.of(equations),
    check_assembly=lambda x, p: None,
    error_scale=equations.error_scale,
    drawing=Drawing(
        joints=(Joint("A", "pivot"), Joint("B", "end", ("initial.pendulum_angle",))),
        positions=equations.places,
        parts=(Part("pivot", ("A",), "bearing"), Part("link", ("A", "B"), "rod")),
        paths=("B",),
    ),
)
