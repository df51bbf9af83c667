"""The FMI interface of the generalised slider-crank: every variable, in its order.

The start values are the case a4 = 10 in, S1 = 3.5 in, alpha4 = 270 deg of Rahman's section 3.1 at 50 rpm, in SI.
"""

from __future__ import annotations

from functools import partial
from math import pi

from ..variables import (
    POSITION,
    RATE,
    Variable,
    centre,
    choice,
    closure_outputs,
    crank_outputs,
    crank_start,
    energy_outputs,
    output,
    parameter,
    speed_inputs,
    status_variables,
    tolerance_parameter,
)
from .published import CRANK_SPEED, OFFSET_CASE

_MECHANISM, _INITIAL = OFFSET_CASE
_parameter, _centre = partial(parameter, _MECHANISM), partial(centre, _MECHANISM)

PARAMETERS = (
    _parameter("crank.length", "m", "Crank, from its axis to the crank pin; greater than zero", "a_1"),
    _parameter("rod.length", "m", "Rod, crank pin to slider pin; greater than zero", "a_2"),
    _parameter("guide.offset", "m", "Offset between crank axis and guide, along their common normal", "a_4"),
    _parameter(
        "guide.twist", "rad", "Twist between crank axis and guide; perpendicular at 90 and 270 deg", "\\alpha_4"
    ),
    _parameter("crank.mass", "kg", "Mass of the crank; greater than zero", "m_1"),
    _parameter("rod.mass", "kg", "Mass of the rod", "m_2"),
    _parameter("slider.mass", "kg", "Mass of the slider", "m_3"),
    _parameter("crank.inertia", "kg.m2", "Moment of inertia of the crank about its axis; greater than zero"),
    _centre("crank.cog_x", "m", "Centre of mass of the crank, from the axis towards the crank pin"),
    _centre("crank.cog_y", "m", "Centre of mass of the crank, across axis and crank"),
    _centre("crank.cog_z", "m", "Centre of mass of the crank, along the axis from the plane of the crank pin"),
    _parameter("crank.product_xz", "kg.m2", "Product of inertia of the crank: integral of x z over its mass"),
    _parameter("crank.product_yz", "kg.m2", "Product of inertia of the crank: integral of y z over its mass"),
    _parameter("rod.inertia", "kg.m2", "Moment of inertia of the rod, transverse, about its centre of mass"),
    _centre("rod.cog_distance", "m", "Centre of mass of the rod, distance from the crank pin"),
    _centre("slider.cog_x", "m", "Centre of mass of the slider from its pin, along the common normal (i of frame 4)"),
    _centre("slider.cog_y", "m", "Centre of mass of the slider from its pin, across guide and common normal (j)"),
    _centre(
        "slider.cog_z", "m", "Centre of mass of the slider from its pin, along the guide, opposite to its position (k)"
    ),
    _parameter("slider.stiffness", "N/m", "Stiffness of the spring on the slider", "", "stiffness", "slider.position"),
    _parameter("slider.spring_free_position", "m", "Slider position at which its spring is free", role="spring"),
    _parameter("slider.damping", "N.s/m", "Viscous damping of the slider", "", "damping", "slider.position"),
    _parameter(
        "slider.coulomb_friction", "N", "Level of Coulomb friction in the guide, smooth about rest", "", "friction"
    ),
    _parameter(
        "shift.stiffness", "N/m", "Stiffness of the spring on the axial shift", "", "stiffness", "shift.position"
    ),
    _parameter("shift.spring_free_position", "m", "Axial shift at which its spring is free", role="spring"),
    _parameter("shift.damping", "N.s/m", "Viscous damping of the axial shift", "", "damping", "shift.position"),
    _parameter("groove.amplitude", "m", "Amplitude of the shift that a groove makes; axial.mode 2", "S_{S1}"),
    _parameter("groove.ratio", "1", "Periods of the groove's shift per turn of the crank; axial.mode 2", "\\alpha"),
    _parameter("gravity.x", "m/s2", "Acceleration of gravity along x of the ground frame", role="gravity"),
    _parameter("gravity.y", "m/s2", "Acceleration of gravity along y of the ground frame", role="gravity"),
    _parameter(
        "gravity.z", "m/s2", "Acceleration of gravity along z of the ground frame, the crank axis", role="gravity"
    ),
    choice(
        "assembly.branch",
        "Assembly: on which side of the crank pin's foot on the guide the slider is, +1 or -1",
        _MECHANISM.assembly_branch,
        -1,
        1,
    ),
    choice("drive.mode", "0: drive.torque acts on the crank; 1: the crank turns at drive.speed", 1, 0, 1),
    choice(
        "axial.mode",
        "0: axial.force acts on the crank; 1: the crank shifts at axial.speed; 2: a groove shifts it",
        1,
        0,
        2,
    ),
    *crank_start("\\theta_1", _INITIAL.crank_speed, "where drive.mode is 1"),
    Variable(
        "initial.shift_position",
        "parameter",
        "m",
        "Axial shift at the start; replaced by the groove's where axial.mode is 2",
        "S_1",
        _INITIAL.shift_position,
    ),
    Variable(
        "initial.shift_velocity",
        "parameter",
        "m/s",
        "Axial velocity at the start; replaced by axial.speed where axial.mode is 1, by the groove's where it is 2",
        "\\dot S_1",
    ),
    tolerance_parameter(),
)

INPUTS = (
    Variable("drive.torque", "input", "N.m", "Torque on the crank, about z; used where drive.mode is 0", "T"),
    *speed_inputs("\\theta_1", CRANK_SPEED),
    Variable("axial.force", "input", "N", "Force on the crank along its axis; used where axial.mode is 0"),
    Variable(
        "axial.speed",
        "input",
        "m/s",
        "Axial velocity of the crank at the start of a step; used where axial.mode is 1",
        "\\dot S_1",
    ),
    Variable(
        "axial.acceleration",
        "input",
        "m/s2",
        "Rate of change of the axial velocity over a step; used where axial.mode is 1",
        "\\ddot S_1",
    ),
    Variable("slider.load", "input", "N", "Force on the slider along the guide, positive where its position increases"),
)


def _vector(prefix: str, unit: str, description: str, depends: str = "all", level: str = "all") -> tuple[Variable, ...]:
    """Return three outputs, the components of a vector along x, y and z of the ground frame."""
    joint = prefix.removesuffix(".f")
    role, of = ("joint force", joint) if joint != prefix else ("", "")
    return tuple(
        output(f"{prefix}{axis}", unit, f"{description}, along {axis}", "", depends, level, role=role, of=of)
        for axis in "xyz"
    )


#: The real outputs stand in the order of `dynamics.Outputs`.
OUTPUTS = (
    *crank_outputs("\\theta_1"),
    output("shift.position", "m", "Axial shift of the crank", "S_1", *POSITION),
    output("shift.velocity", "m/s", "Axial velocity of the crank", "\\dot S_1", *RATE, rate_of="shift.position"),
    output("shift.acceleration", "m/s2", "Axial acceleration of the crank", "\\ddot S_1", rate_of="shift.velocity"),
    output("slider.position", "m", "Slider position along the guide, from the common normal", "S_4", *POSITION),
    output("slider.velocity", "m/s", "Slider velocity", "\\dot S_4", *RATE, rate_of="slider.position"),
    output("slider.acceleration", "m/s2", "Slider acceleration", "\\ddot S_4", rate_of="slider.velocity"),
    *_vector("crank_pin.", "m", "Crank pin", *POSITION),
    *_vector("slider_pin.", "m", "Slider pin", *POSITION),
    *_vector("rod.w", "rad/s", "Angular velocity of the rod, without spin about its own line", *RATE),
    output(
        "drive.applied_torque",
        "N.m",
        "Torque of the drive; where drive.mode is 1 the torque that holds the speed",
        "T",
        role="drive",
        of="crank.angle",
    ),
    output(
        "axial.applied_force",
        "N",
        "Axial force of the drive; where axial.mode is 1 or 2 the force that holds the shift",
        role="drive",
        of="shift.position",
    ),
    *_vector("bearing.f", "N", "Total force on the crank of bearing, axial drive, shift spring and damper"),
    *_vector("bearing.m", "N.m", "Total moment about O on the crank of bearing, drive and groove"),
    *_vector("crank_pin.f", "N", "Force of the crank on the rod"),
    *_vector("slider_pin.f", "N", "Force of the slider on the rod"),
    *_vector("guide.f", "N", "Force of the guide on the slider, across the guide"),
    *_vector("guide.m", "N.m", "Moment of the guide on the slider, about the slider pin"),
    *energy_outputs(
        "springs and gravity, the latter zero with every centre of mass at O",
        "dampers and guide",
        "crank torque, axial force and slider load",
    ),
    *closure_outputs("Angle between the rod and the plane normal to the guide; 0 at the limit of assembly", 0.5 * pi),
    output(
        "assembly.margin",
        "m",
        "Rod length less the crank pin's distance from the guide; positive inside the range of assembly",
        "",
        *POSITION,
    ),
    *status_variables(),
)

VARIABLES = PARAMETERS + INPUTS + OUTPUTS

#: Parameters that set the configuration at the start, for the dependencies of the initial outputs.
POSITION_PARAMETERS = (
    "crank.length",
    "rod.length",
    "guide.offset",
    "guide.twist",
    "groove.amplitude",
    "groove.ratio",
    "assembly.branch",
    "axial.mode",
    "initial.crank_angle",
    "initial.shift_position",
)
