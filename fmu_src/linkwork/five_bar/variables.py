"""The FMI interface of the five-bar slider: every variable of the contract, in its order.

The start values are the thesis's Table 3.1 at 420 rpm with k = 1e6 dyn/cm and mu = 3e4 dyn.s/cm, in SI.
"""

from __future__ import annotations

from functools import partial
from math import pi

from .. import variables as shared
from .published import SETS

_SET = SETS["table-3.1"]
_parameter, _centre = partial(shared.parameter, _SET.parameters), partial(shared.centre, _SET.parameters)
_SLIDE = "slider.position"

PARAMETERS = (
    _parameter(
        "ground.length", "m", "Ground link, from the crank shaft A to the slider's zero; greater than zero", "l_1"
    ),
    _parameter("crank.length", "m", "Crank, A to B; greater than zero", "l_2"),
    _parameter("coupler.length", "m", "Coupler, B to C; greater than zero", "l_3"),
    _parameter("rocker.length", "m", "Rocker, D to C; greater than zero", "l_4"),
    _parameter("crank.mass", "kg", "Mass of the crank", "m_2"),
    _parameter("coupler.mass", "kg", "Mass of the coupler", "m_3"),
    _parameter("rocker.mass", "kg", "Mass of the rocker", "m_4"),
    _parameter("slider.mass", "kg", "Mass of the slider", "m_5"),
    _parameter(
        "crank.inertia",
        "kg.m2",
        "Moment of inertia of the crank about its shaft A, m lG2^2 included; greater than zero",
        "I_A",
    ),
    _parameter("coupler.inertia", "kg.m2", "Moment of inertia of the coupler about its centre of mass", "I_{G3}"),
    _parameter("rocker.inertia", "kg.m2", "Moment of inertia of the rocker about its centre of mass", "I_{G4}"),
    _centre("crank.cog_distance", "m", "Centre of mass of the crank, distance from A", "l_{G2}"),
    _centre("coupler.cog_distance", "m", "Centre of mass of the coupler, distance from the crank pin B", "l_{G3}"),
    _centre("rocker.cog_distance", "m", "Centre of mass of the rocker, distance from the slider pin D", "l_{G4}"),
    _centre("crank.cog_angle", "rad", "Angle of the crank's centre of mass from the direction A to B", "\\nu_2"),
    _centre("coupler.cog_angle", "rad", "Angle of the coupler's centre of mass from the direction B to C", "\\nu_3"),
    _centre("rocker.cog_angle", "rad", "Angle of the rocker's centre of mass from the direction D to C", "\\nu_4"),
    _parameter("slider.guide_angle", "rad", "Direction of the slider's guide from the ground link", "\\alpha"),
    _parameter("slider.stiffness", "N/m", "Stiffness of the spring on the slider", "k", "stiffness", _SLIDE),
    _parameter("slider.spring_free_position", "m", "Slider position at which the spring is free", "u_0", role="spring"),
    _parameter("slider.damping", "N.s/m", "Viscous damping of the slider", "\\mu", "damping", _SLIDE),
    _parameter(
        "slider.coulomb_friction", "N", "Level of Coulomb friction in the guide, smooth about rest", "F_c", "friction"
    ),
    _parameter(
        "slider.friction_coefficient",
        "1",
        "Friction in the guide per unit of guide force, smooth about rest",
        "\\mu_g",
        "friction",
    )._replace(nominal=0.1),
    *(
        _parameter(
            f"pin.{pin}_friction_radius",
            "m",
            f"Moment of friction in pin {pin} per unit of pin force: coefficient of friction times radius",
            f"\\rho_{pin}",
            "friction",
        )._replace(nominal=1e-3)
        for pin in "ABCD"
    ),
    _parameter("coupler.point_distance", "m", "Coupler point P, distance from the crank pin B", "r"),
    _parameter("coupler.point_angle", "rad", "Angle of the coupler point P from the direction B to C", "a_2"),
    _parameter("gravity", "m/s2", "Acceleration of gravity", "g", role="gravity"),
    _parameter(
        "ground.inclination", "rad", "Angle of the ground link above the horizontal", "\\alpha_1", role="gravity"
    ),
    shared.choice(
        "assembly.branch",
        "Assembly: sign of sin(rocker.angle - coupler.angle), +1 or -1",
        _SET.parameters.assembly_branch,
        -1,
        1,
    ),
    shared.choice("drive.mode", "0: drive.torque acts on the crank; 1: the crank turns at drive.speed", 1, 0, 1),
    *shared.crank_start("\\theta_2", _SET.crank_speed, "in speed drive"),
    shared.Variable("initial.slider_position", "parameter", "m", "Slider position at the start", "u"),
    shared.Variable("initial.slider_velocity", "parameter", "m/s", "Slider velocity at the start", "\\dot u"),
    shared.tolerance_parameter(),
)

INPUTS = (
    shared.Variable(
        "drive.torque", "input", "N.m", "Torque on the crank, counter-clockwise; used where drive.mode is 0", "T_1"
    ),
    *shared.speed_inputs("\\theta_2", _SET.crank_speed),
    shared.Variable("slider.force", "input", "N", "Control force on the slider, along the guide", "F_2"),
    shared.Variable("load.fx", "input", "N", "Load on the coupler point P, along the ground link", "F_{1x}"),
    shared.Variable("load.fy", "input", "N", "Load on the coupler point P, to the left of the ground link", "F_{1y}"),
)


def _pin(pin: str, description: str) -> tuple[shared.Variable, ...]:
    directions = {"x": "along the ground link", "y": "to the left of the ground link"}
    return tuple(
        shared.output(f"pin.{pin}.f{axis}", "N", f"Force of {description}, {way}", role="joint force", of=f"pin.{pin}")
        for axis, way in directions.items()
    )


def _angle(name: str, description: str, symbol: str) -> shared.Variable:
    text = f"{description}, continuous unless B passes behind D"
    return shared.output(
        name, "rad", text, symbol, *shared.POSITION, minimum=-2.0 * pi, maximum=2.0 * pi, display="deg"
    )


#: The real outputs stand in the order of `dynamics.Outputs`.
OUTPUTS = (
    *shared.crank_outputs("\\theta_2"),
    _angle("coupler.angle", "Coupler angle B to C", "\\theta_3"),
    _angle("rocker.angle", "Absolute rocker angle D to C", "\\theta_4 + \\alpha"),
    shared.output("slider.position", "m", "Slider position along the guide", "u", *shared.POSITION),
    shared.output("slider.velocity", "m/s", "Slider velocity", "\\dot u", *shared.RATE, rate_of="slider.position"),
    shared.output("slider.acceleration", "m/s2", "Slider acceleration", "\\ddot u", rate_of="slider.velocity"),
    shared.output("coupler.point.x", "m", "Coupler point P, along the ground link from A", "x", *shared.POSITION),
    shared.output("coupler.point.y", "m", "Coupler point P, to the left of the ground link", "y", *shared.POSITION),
    shared.output(
        "drive.applied_torque",
        "N.m",
        "Torque on the crank; in speed drive the torque that holds the speed",
        "T_1",
        role="drive",
        of="crank.angle",
    ),
    *_pin("A", "the ground on the crank"),
    *_pin("B", "the crank on the coupler"),
    *_pin("C", "the rocker on the coupler"),
    *_pin("D", "the slider on the rocker"),
    shared.output(
        "slider.guide_force",
        "N",
        "Force of the guide on the slider, to the left of its direction of travel",
        role="guide force",
    ),
    *shared.energy_outputs(
        "spring and gravity, the latter zero with every centre of mass at A",
        "damper, guide and pins",
        "crank torque, slider force and load",
    ),
    *shared.closure_outputs("Angle between coupler and rocker at C", pi),
    *shared.status_variables(),
)

VARIABLES = PARAMETERS + INPUTS + OUTPUTS

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
