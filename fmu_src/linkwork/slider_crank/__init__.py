"""The generalised slider-crank of Rahman: parameters, kinematics, dynamics, published data; `MECHANISM` combines them."""

from __future__ import annotations

from .. import friction
from ..mechanism import CRANK, CRANK_CHANNELS, Channel, Equations, Freedom, Link, Mechanism, Mode
from . import assembly, cases, drawing, dynamics, kinematics, published, variables, vectors
from .parameters import InitialState, SliderCrankParameters

MECHANISM = Mechanism(
    name="slider-crank",
    fmu="SliderCrank",
    title="Generalised slider-crank",
    description=(
        "Generalised slider-crank: offset and twisted guide, rod on ball joints, crank that turns and shifts axially"
    ),
    notes=(
        "A spatial slider-crank: the crank turns about its axis and shifts along it, a rod between two ball joints moves "
        "a slider on a straight guide that is offset from the crank axis and twisted against it. Crank angle and axial "
        "shift are the two freedoms; the rod's spin about its own line has no effect and is taken as zero.",
        "z runs along the crank axis, x along the common normal of axis and guide, away from the guide where "
        "guide.offset is positive; the crank points along x at crank.angle 0 and turns about z. The guide passes through "
        "(-guide.offset, 0, 0); the slider position increases along (0, -sin, -cos) of guide.twist. bearing: total force "
        "and moment on the crank from the ground, about the origin; crank_pin: force of the crank on the rod; slider_pin: "
        "of the slider on the rod; guide: of the guide on the slider. Vectors are in the ground frame.",
        "drive.mode 0: drive.torque acts on the crank. drive.mode 1: over a step the crank turns at drive.speed + "
        "drive.acceleration (t - t_n), and drive.applied_torque is the torque that this requires. axial.mode 0: axial.force "
        "acts along the axis. axial.mode 1: over a step the crank shifts at axial.speed + axial.acceleration (t - t_n), from "
        "initial.shift_position; axial.applied_force is the force that this requires. axial.mode 2: a groove in the shaft "
        "makes the shift groove.amplitude sin(groove.ratio crank.angle). Where a commanded speed jumps, the generalised "
        "momentum of the other freedom is conserved, unless that freedom is commanded too or coupled by the groove; if a "
        "speed is not set again, the next step starts from the same speed.",
    ),
    parameters=SliderCrankParameters,
    initial=InitialState,
    published=published.SETS,
    freedoms=(
        CRANK,
        Freedom(
            "shift.position",
            "shift.velocity",
            ("shift_position", "shift_velocity"),
            # without any of these inputs the shift keeps its initial value: its commanded speed is zero
            Mode("axial.mode", ("force", "speed", "groove"), ("axial_force", "shift_speed", "groove"), default=1),
        ),
    ),
    channels=(
        *CRANK_CHANNELS,
        Channel("axial.force", "axial_force", freedom=1),
        Channel("axial.speed", "shift_speed", "command", 1),
        Channel("axial.acceleration", "rate of shift_speed", "rate", 1),
        Channel("slider.load", "load", displacement="slider.position"),
    ),
    variables=variables.VARIABLES,
    position_parameters=variables.POSITION_PARAMETERS,
    experiment=(0.0, 2.4, 5e-3, 1e-9),  # two revolutions at 50 rpm
    modules=(friction, vectors, kinematics, dynamics),
    equations=Equations.of(dynamics),
    check_assembly=lambda x, p: assembly.check_assembly(x[0], x[1], p),
    error_scale=assembly.error_scale,
    unjoined=assembly.UNJOINED,
    links=(
        Link("crank", "crank.length", "crank.mass", "crank.inertia", ("crank.cog_x", "crank.cog_y"), True),
        Link("rod", "rod.length", "rod.mass", "rod.inertia", ("rod.cog_distance",)),
    ),
    drawing=drawing.DRAWING,
    cases=cases.CASES,
)
