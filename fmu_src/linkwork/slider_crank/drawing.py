"""Drawing of the generalised slider-crank."""

from __future__ import annotations

from ..mechanism import Drawing, Joint, Part
from .dynamics import Inputs, State, impose_groove
from .kinematics import crank_pin, position, slider_pin
from .parameters import Constants


def positions(x: State, i: Inputs, p: Constants) -> tuple[float, ...]:
    """Compute the positions of the joints, in the order of `DRAWING`, in the ground frame."""
    settled = impose_groove(x, i.groove, p)
    shift = settled[1]
    q = position(settled[0], shift, p)
    b = crank_pin(q, shift, p)
    c = slider_pin(q, p)
    return (
        *(0.0, 0.0, 0.0),
        *(0.0, 0.0, shift),
        *(0.0, 0.0, shift + p.a1),
        *(-p.a4, 0.0, 0.0),
        *(-p.a4, -p.a2 * p.sa, -p.a2 * p.ca),
        *(c.x, c.y, c.z),
        *(b.x, b.y, b.z),
    )


_SLIDE = ("C", "N", "G")
DRAWING = Drawing(
    joints=(
        Joint("O", "foot of the common normal on the crank axis"),
        Joint("A", "centre of the crank", ("initial.shift_position",)),
        Joint("Z", "crank axis"),
        Joint("N", "foot of the common normal on the guide", ("guide.offset",)),
        Joint("G", "direction of the guide", ("guide.twist",)),
        Joint("C", "slider pin", ("rod.length",)),
        Joint("B", "crank pin", ("crank.length", "initial.crank_angle")),
    ),
    positions=positions,
    parts=(
        Part("axis", ("O", "Z"), "crank axis"),
        Part("axis", ("O", "N"), "common normal"),
        Part("guide", ("N", "G"), "guide"),
        Part("spring", _SLIDE, "spring", "slider.stiffness"),
        Part("damper", _SLIDE, "damper", "slider.damping"),
        Part("slider", _SLIDE, "slider"),
        Part("pivot", ("O",), "bearing of the crank"),
        Part("link", ("B", "C"), "rod"),
        Part("link", ("A", "B"), "crank"),
    ),
    paths=("B", "C"),
    planar=False,
)
