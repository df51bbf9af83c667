"""The FMI interface of the five-bar slider: every variable of the contract, in its order.

The start values are the thesis's Table 3.1 at 420 rpm with k = 1e6 dyn/cm and mu = 3e4 dyn.s/cm, in SI.
"""

from __future__ import annotations

from math import pi

from ..parameters import field_name
from ..variables import Variable, output, status_variables, tolerance_parameter
from .published import SETS

_SET = SETS["table-3.1"]


def _parameter(
    name: str, unit: str, description: str, symbol: str = "", *, minimum: float | None = None, display: str = ""
) -> Variable:
    start = getattr(_SET.parameters, field_name(name))
    return Variable(name, "parameter", unit, description, symbol, start, "Real", minimum, None, display)


PARAMETERS = (
    _parameter(
        "ground.length",
        "m",
        "Ground link, from the crank shaft A to the slider's zero; greater than zero",
        "l_1",
        minimum=0.0,
    ),
    _parameter("crank.length", "m", "Crank, A to B; greater than zero", "l_2", minimum=0.0),
    _parameter("coupler.length", "m", "Coupler, B to C; greater than zero", "l_3", minimum=0.0),
    _parameter("rocker.length", "m", "Rocker, D to C; greater than zero", "l_4", minimum=0.0),
    _parameter("crank.mass", "kg", "Mass of the crank", "m_2", minimum=0.0),
    _parameter("coupler.mass", "kg", "Mass of the coupler", "m_3", minimum=0.0),
    _parameter("rocker.mass", "kg", "Mass of the rocker", "m_4", minimum=0.0),
    _parameter("slider.mass", "kg", "Mass of the slider", "m_5", minimum=0.0),
    _parameter(
        "crank.inertia",
        "kg.m2",
        "Moment of inertia of the crank about its shaft A, m lG2^2 included; greater than zero",
        "I_A",
        minimum=0.0,
    ),
    _parameter(
        "coupler.inertia", "kg.m2", "Moment of inertia of the coupler about its centre of mass", "I_{G3}", minimum=0.0
    ),
    _parameter(
        "rocker.inertia", "kg.m2", "Moment of inertia of the rocker about its centre of mass", "I_{G4}", minimum=0.0
    ),
    _parameter("crank.cog_distance", "m", "Centre of mass of the crank, distance from A", "l_{G2}"),
    _parameter("coupler.cog_distance", "m", "Centre of mass of the coupler, distance from the crank pin B", "l_{G3}"),
    _parameter("rocker.cog_distance", "m", "Centre of mass of the rocker, distance from the slider pin D", "l_{G4}"),
    _parameter(
        "crank.cog_angle", "rad", "Direction of the crank's centre of mass from A to B", "\\nu_2", display="deg"
    ),
    _parameter(
        "coupler.cog_angle", "rad", "Direction of the coupler's centre of mass from B to C", "\\nu_3", display="deg"
    ),
    _parameter(
        "rocker.cog_angle", "rad", "Direction of the rocker's centre of mass from D to C", "\\nu_4", display="deg"
    ),
    _parameter(
        "slider.guide_angle", "rad", "Direction of the slider's guide from the ground link", "\\alpha", display="deg"
    ),
    _parameter("slider.stiffness", "N/m", "Stiffness of the spring on the slider", "k", minimum=0.0),
    _parameter("slider.spring_free_position", "m", "Slider position at which the spring is free", "u_0"),
    _parameter("slider.damping", "N.s/m", "Viscous damping of the slider", "\\mu", minimum=0.0),
    _parameter(
        "slider.coulomb_friction", "N", "Level of Coulomb friction in the guide, smooth about rest", "F_c", minimum=0.0
    ),
    _parameter(
        "slider.friction_coefficient",
        "1",
        "Friction of the guide relative to its force, smooth about rest",
        "\\mu_g",
        minimum=0.0,
    )._replace(nominal=0.1),
    *(
        _parameter(
            f"pin.{pin}_friction_radius",
            "m",
            f"Moment of friction in pin {pin} relative to its force: coefficient of friction times radius",
            f"\\rho_{pin}",
            minimum=0.0,
        )._replace(nominal=1e-3)
        for pin in "ABCD"
    ),
    _parameter("coupler.point_distance", "m", "Coupler point P, distance from the crank pin B", "r"),
    _parameter("coupler.point_angle", "rad", "Direction of the coupler point P from B to C", "a_2", display="deg"),
    _parameter("gravity", "m/s2", "Acceleration of gravity", "g", minimum=0.0),
    _parameter(
        "ground.inclination", "rad", "Angle of the ground link above the horizontal", "\\alpha_1", display="deg"
    ),
    Variable(
        "assembly.branch",
        "parameter",
        "",
        "Assembly: sign of sin(rocker.angle - coupler.angle), +1 or -1",
        "",
        _SET.parameters.assembly_branch,
        "Integer",
        -1,
        1,
    ),
    Variable(
        "drive.mode",
        "parameter",
        "",
        "0: drive.torque acts on the crank; 1: the crank turns at drive.speed",
        "",
        1,
        "Integer",
        0,
        1,
    ),
    Variable("initial.crank_angle", "parameter", "rad", "Crank angle at the start", "\\theta_2", 0.0, display="deg"),
    Variable(
        "initial.crank_speed",
        "parameter",
        "rad/s",
        "Crank speed at the start; in speed drive drive.speed takes its place",
        "\\dot\\theta_2",
        _SET.crank_speed,
        display="rpm",
    ),
    Variable("initial.slider_position", "parameter", "m", "Slider position at the start", "u"),
    Variable("initial.slider_velocity", "parameter", "m/s", "Slider velocity at the start", "\\dot u"),
    tolerance_parameter(),
)

INPUTS = (
    Variable(
        "drive.torque", "input", "N.m", "Torque on the crank, counter-clockwise; used where drive.mode is 0", "T_1"
    ),
    Variable(
        "drive.speed",
        "input",
        "rad/s",
        "Crank speed at the start of a step; used where drive.mode is 1",
        "\\dot\\theta_2",
        _SET.crank_speed,
        display="rpm",
    ),
    Variable(
        "drive.acceleration",
        "input",
        "rad/s2",
        "Rate of change of the crank speed over a step; used where drive.mode is 1",
        "\\ddot\\theta_2",
    ),
    Variable("slider.force", "input", "N", "Control force on the slider, along the guide", "F_2"),
    Variable("load.fx", "input", "N", "Load on the coupler point P, along the ground link", "F_{1x}"),
    Variable("load.fy", "input", "N", "Load on the coupler point P, to the left of the ground link", "F_{1y}"),
)


def _pin(pin: str, description: str) -> tuple[Variable, Variable]:
    return (
        output(f"pin.{pin}.fx", "N", f"Force of {description}, along the ground link"),
        output(f"pin.{pin}.fy", "N", f"Force of {description}, to the left of the ground link"),
    )


#: The real outputs stand in the order of `dynamics.Outputs`.
OUTPUTS = (
    output(
        "crank.angle", "rad", "Crank angle, counted on over full turns", "\\theta_2", "state", "position", display="deg"
    ),
    output(
        "crank.speed",
        "rad/s",
        "Crank speed",
        "\\dot\\theta_2",
        "speed",
        "velocity",
        display="rpm",
        rate_of="crank.angle",
    ),
    output("crank.acceleration", "rad/s2", "Crank acceleration", "\\ddot\\theta_2", rate_of="crank.speed"),
    output(
        "coupler.angle",
        "rad",
        "Coupler angle B to C",
        "\\theta_3",
        "state",
        "position",
        minimum=-pi,
        maximum=pi,
        display="deg",
    ),
    output(
        "rocker.angle",
        "rad",
        "Absolute rocker angle D to C",
        "\\theta_4 + \\alpha",
        "state",
        "position",
        minimum=-pi,
        maximum=pi,
        display="deg",
    ),
    output("slider.position", "m", "Slider position along the guide", "u", "state", "position"),
    output("slider.velocity", "m/s", "Slider velocity", "\\dot u", "speed", "velocity", rate_of="slider.position"),
    output("slider.acceleration", "m/s2", "Slider acceleration", "\\ddot u", rate_of="slider.velocity"),
    output("coupler.point.x", "m", "Coupler point P, along the ground link from A", "x", "state", "position"),
    output("coupler.point.y", "m", "Coupler point P, to the left of the ground link", "y", "state", "position"),
    output("drive.applied_torque", "N.m", "Torque on the crank; in speed drive the torque that holds the speed", "T_1"),
    *_pin("A", "the ground on the crank"),
    *_pin("B", "the crank on the coupler"),
    *_pin("C", "the rocker on the coupler"),
    *_pin("D", "the slider on the rocker"),
    output("slider.guide_force", "N", "Force of the guide on the slider, to the left of its direction of travel"),
    output("energy.kinetic", "J", "Kinetic energy of all links", "", "speed", "velocity", minimum=0.0),
    output(
        "energy.potential",
        "J",
        "Potential energy of spring and gravity, the latter zero with every centre of mass at A",
        "",
        "state",
    ),
    output("energy.dissipated", "J", "Work lost in damper, guide and pins since the start", "", "state"),
    output("energy.supplied", "J", "Work of crank torque, slider force and load since the start", "", "speed"),
    output(
        "energy.residual", "J", "Energy balance: gained plus dissipated less supplied; zero but for error", "", "speed"
    ),
    output("closure.residual", "m", "Length by which the loop fails to close", "", "state", "position", minimum=0.0),
    output(
        "transmission.angle",
        "rad",
        "Angle between coupler and rocker at C",
        "",
        "state",
        "position",
        minimum=0.0,
        maximum=pi,
        display="deg",
    ),
    *status_variables(),
)

VARIABLES = PARAMETERS + INPUTS + OUTPUTS

#: Names of the real outputs, in the order of `dynamics.Outputs`.
OUTPUT_NAMES = tuple(v.name for v in OUTPUTS if v.kind == "Real")

#: Parameters that set the configuration at the start, for the dependencies of the initial outputs.
POSITION_PARAMETERS = (
    "ground.length",
    "crank.length",
    "coupler.length",
    "rocker.length",
    "slider.guide_angle",
    "coupler.point_distance",
    "coupler.point_angle",
    "assembly.branch",
    "initial.crank_angle",
    "initial.slider_position",
)
