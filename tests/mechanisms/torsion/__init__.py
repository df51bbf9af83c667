"""A rotor on a torsion spring, excited by a crank: textbook oscillators as one mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

from linkwork.mechanism import Channel, Equations, Freedom, Mechanism, PublishedSet
from linkwork.parameters import CheckedParameters, CheckedState, Rules
from linkwork.variables import Variable, output, status_variables, tolerance_parameter

from . import equations
from .equations import Constants


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(CheckedParameters):
    """Parameters in SI units."""

    RULES: ClassVar[Rules] = Rules(
        positive=("rotor_inertia",),
        free_sign=("rotor_stiffness", "rotor_cubic_stiffness", "rotor_modulation", "rotor_excitation"),
    )

    rotor_inertia: float = 1.0
    rotor_damping: float = 0.0
    rotor_stiffness: float = 0.0
    rotor_cubic_stiffness: float = 0.0
    rotor_modulation: float = 0.0
    rotor_weight: float = 0.0
    rotor_excitation: float = 0.0

    def constants(self) -> Constants:
        """Return the constants of the equations. `astuple` would not do: traced parameters are no dataclass."""
        return Constants(
            self.rotor_inertia, self.rotor_damping, self.rotor_stiffness, self.rotor_cubic_stiffness,
            self.rotor_modulation, self.rotor_weight, self.rotor_excitation,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Initial(CheckedState):
    """State at the start (rad, rad/s)."""

    crank_angle: float = 0.0
    crank_speed: float = 0.0
    rotor_angle: float = 0.0
    rotor_speed: float = 0.0


def _p(name: str, unit: str, description: str, role: str = "") -> Variable:
    return Variable(name, "parameter", unit, description, role=role, of="rotor.angle" if role else "")


VARIABLES = (
    Variable("rotor.inertia", "parameter", "kg.m2", "Moment of inertia", start=1.0, minimum=0.0),
    _p("rotor.damping", "1", "Viscous damping (N.m.s/rad)", "damping"),
    _p("rotor.stiffness", "1", "Stiffness of the torsion spring (N.m/rad)", "stiffness"),
    _p("rotor.cubic_stiffness", "1", "Its torque with the third power of the angle (N.m/rad3)"),
    _p("rotor.modulation", "1", "Amplitude of the stiffness over a turn of the crank (N.m/rad)"),
    _p("rotor.weight", "N.m", "Greatest moment of the rotor's weight"),
    _p("rotor.excitation", "N.m", "Amplitude of the torque over a turn of the crank"),
    *(
        Variable(f"initial.{part}_{what}", "parameter", unit, f"{what.title()} of the {part} at the start")
        for part in ("crank", "rotor")
        for what, unit in (("angle", "rad"), ("speed", "rad/s"))
    ),
    tolerance_parameter(),
    Variable("drive.speed", "input", "rad/s", "Speed of the crank", "", 1.0),
    Variable("drive.acceleration", "input", "rad/s2", "Its rate of change over a step"),
    Variable("rotor.torque", "input", "N.m", "Torque on the rotor"),
    output("crank.angle", "rad", "Angle, counted on over full turns", "", "state", "position"),
    output("crank.speed", "rad/s", "Speed", "", "speed", "velocity", rate_of="crank.angle"),
    output("crank.acceleration", "rad/s2", "Angular acceleration", rate_of="crank.speed"),
    output("rotor.angle", "rad", "Angle", "", "state", "position"),
    output("rotor.speed", "rad/s", "Speed", "", "speed", "velocity", rate_of="rotor.angle"),
    output("rotor.acceleration", "rad/s2", "Angular acceleration", rate_of="rotor.speed"),
    output("energy.residual", "J", "Energy balance", "", "speed"),
    *status_variables(),
)

MECHANISM = Mechanism(
    name="torsion",
    fmu="Torsion",
    title="Rotor on a torsion spring",
    description="A rotor on a torsion spring, excited by a crank",
    notes=("The crank turns at a commanded speed.",),
    parameters=Parameters,
    initial=Initial,
    published={
        "torsion-demo": PublishedSet(
            Parameters(rotor_stiffness=1.0), Initial(), {"speed": 1.0}, "made up for the tests"
        )
    },
    freedoms=(
        Freedom("crank.angle", "crank.speed", ("crank_angle", "crank_speed"), period=2.0 * pi),
        Freedom("rotor.angle", "rotor.speed", ("rotor_angle", "rotor_speed")),
    ),
    channels=(
        Channel("drive.speed", "speed", "command", 0),
        Channel("drive.acceleration", "acceleration", "rate", 0),
        Channel("rotor.torque", "force", freedom=1),
    ),
    variables=VARIABLES,
    position_parameters=("initial.crank_angle", "initial.rotor_angle"),
    experiment=(0.0, 1.0, 1e-3, 1e-9),
    modules=(equations,),
    equations=Equations.of(equations),
    check_assembly=lambda x, p: None,
    error_scale=equations.error_scale,
)
