"""The five-bar slider of Youssef's thesis: parameters, kinematics, dynamics, published data; `MECHANISM` combines them."""

from __future__ import annotations

from .. import friction
from ..mechanism import CRANK, CRANK_CHANNELS, Channel, Equations, Freedom, Link, Mechanism
from . import assembly, cases, drawing, dynamics, kinematics, published, variables
from .parameters import FiveBarParameters, InitialState

MECHANISM = Mechanism(
    name="five-bar",
    fmu="FiveBarSlider",
    title="Five-bar slider",
    description="Five-bar slider: a four-bar linkage whose rocker pivot is a sprung, damped, controllable slider",
    notes=(
        "A four-bar linkage whose rocker-to-ground pivot D is a slider on a straight guide, held by a spring, opposed by "
        "a damper and by friction, and driven by a control force. Crank angle and slider position are the two freedoms.",
        "x runs along the ground link from the crank shaft A to the slider's zero, y to its left; angles are "
        "counter-clockwise from x. Gravity is (-g sin, -g cos) of ground.inclination. A positive torque drives the crank "
        "counter-clockwise. Pin forces: A of the ground on the crank, B of the crank on the coupler, C of the rocker on "
        "the coupler, D of the slider on the rocker; slider.guide_force is the guide's force on the slider.",
        "drive.mode 0: drive.torque acts on the crank. drive.mode 1: over a step the crank turns at drive.speed + "
        "drive.acceleration (t - t_n), and drive.applied_torque is the torque that this requires. Where the commanded speed "
        "jumps, the slider's generalised momentum is conserved, and the slider velocity jumps too; if drive.speed is not set "
        "again, the next step starts from the same drive.speed.",
    ),
    parameters=FiveBarParameters,
    initial=InitialState,
    published=published.SETS,
    freedoms=(
        CRANK,
        Freedom("slider.position", "slider.velocity", ("slider_position", "slider_velocity")),
    ),
    channels=(
        *CRANK_CHANNELS,
        Channel("slider.force", "force", freedom=1),
        Channel("load.fx", "load_x", displacement="coupler.point.x"),
        Channel("load.fy", "load_y", displacement="coupler.point.y"),
    ),
    variables=variables.VARIABLES,
    position_parameters=variables.POSITION_PARAMETERS,
    experiment=(0.0, 0.4285714285714286, 1e-3, 1e-9),  # three revolutions at 420 rpm
    modules=(friction, kinematics, dynamics),
    equations=Equations.of(dynamics),
    check_assembly=lambda x, p: assembly.check_assembly(x[0], x[1], p),
    error_scale=assembly.error_scale,
    unjoined=assembly.UNJOINED,
    links=tuple(
        Link(
            name,
            f"{name}.length",
            f"{name}.mass",
            f"{name}.inertia",
            (f"{name}.cog_distance", f"{name}.cog_angle"),
            name == "crank",
        )
        for name in ("crank", "coupler", "rocker")
    ),
    drawing=drawing.DRAWING,
    cases=cases.CASES,
    switch="rough",
)
