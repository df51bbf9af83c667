"""Drawing of the five-bar slider."""

from __future__ import annotations

from ..mechanism import Drawing, Joint, Part
from .dynamics import Inputs, State
from .kinematics import coupler_point, position
from .parameters import Constants


def positions(x: State, i: Inputs, p: Constants) -> tuple[float, ...]:
    """Compute the positions of the joints, in the order of `DRAWING`, in the plane of the mechanism."""
    u = x[1]
    g = position(x[0], u, p)
    px, py = coupler_point(g, p)
    bx = p.l2 * g.c2
    by = p.l2 * g.s2
    return (
        *(0.0, 0.0, 0.0),
        *(p.l1, 0.0, 0.0),
        *(p.l1 + p.l4 * p.ca, p.l4 * p.sa, 0.0),
        *(p.l1 + u * p.ca, u * p.sa, 0.0),
        *(px, py, 0.0),
        *(bx + p.l3 * g.c3, by + p.l3 * g.s3, 0.0),
        *(bx, by, 0.0),
    )


_SLIDE = ("D", "O", "G")
DRAWING = Drawing(
    joints=(
        Joint("A", "crank shaft"),
        Joint("O", "the slider's zero", ("ground.length",)),
        Joint("G", "direction of the guide", ("slider.guide_angle",)),
        Joint("D", "slider pin", ("initial.slider_position",)),
        Joint("P", "coupler point", ("coupler.point_distance", "coupler.point_angle")),
        Joint("C", "pin of coupler and rocker", ("coupler.length", "rocker.length")),
        Joint("B", "crank pin", ("crank.length", "initial.crank_angle")),
    ),
    positions=positions,
    parts=(
        Part("axis", ("A", "O"), "ground link"),
        Part("pivot", ("A",), "bearing of the crank"),
        Part("guide", ("O", "G"), "guide"),
        Part("spring", _SLIDE, "spring", "slider.stiffness"),
        Part("damper", _SLIDE, "damper", "slider.damping"),
        Part("slider", _SLIDE, "slider"),
        Part("link", ("D", "C"), "rocker"),
        Part("link", ("B", "C", "P"), "coupler"),
        Part("link", ("A", "B"), "crank"),
    ),
    paths=("P", "C"),
)
