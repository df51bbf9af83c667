"""Published numbers on the slider-crank for comparison: Rahman's data and statements, and an independent derivation.

Source: S. Rahman, "Dynamic analysis of the generalized slider crank", MS thesis, NJIT, May 1991; section 3.1 (data) and 3.2
(statements). The thesis's figures are not legible in the copy at hand. Spot values, dead centres, strokes and limits of the
shift are therefore from an independent derivation of the closed form, with the digits shown. Units are inches, pounds force,
seconds and degrees, as printed; the factors to SI are at the top. Nothing here is an output of this program.
"""

from collections.abc import Mapping
from typing import NamedTuple

# One unit in SI
INCH = 0.0254
POUND_FORCE = 4.4482216152605
POUND_INCH = POUND_FORCE * INCH

# Section 3.1
CRANK_IN, ROD_IN = 12.0, 50.0
OFFSETS_IN = (0.0, 10.0, 20.0, 30.0)
TWISTS_DEG = (232.0, 270.0, 310.0)
SHIFTS_IN = (0.0, 3.0, 3.5, 6.0, 9.0)
MASSES_LB_S2_IN = (0.06146594, 0.11382582, 0.01956522)
CRANK_RADIUS_IN, ROD_RADIUS_IN = 1.5, 1.0
SPEED_RPM = 50.0
TORQUE_LB_IN = 100.0


# From the independent derivation


class Spot(NamedTuple):
    """Spot values of the motion at theta1 = 30 deg, 50 rpm, branch +.

    The last two are the slider force along -k4 at a torque of 100 lb.in, and the torque without a slider force.
    """

    offset_in: float
    shift_in: float
    twist_deg: float
    position_in: float
    velocity_in_s: float
    acceleration_in_s2: float
    slider_force_lb: float
    torque_lb_in: float


SPOTS = (
    Spot(10.0, 3.5, 270.0, 51.518171, 68.488429, -62.88695, -15.328251, -100.49853),
    Spot(20.0, 0.0, 310.0, 44.111244, 62.432803, 36.61340, -8.206263, 2.15027),
)
#: Dead centres at S1 = 0 and 270 deg, by the offset in inches.
DEAD_CENTRES_DEG: Mapping[float, tuple[float, float]] = {
    10.0: (99.28, 285.26),
    20.0: (108.82, 301.76),
    30.0: (118.94, 322.14),
}
#: Strokes (in) at S1 = 0 and 270 deg, by the offset in inches.
STROKES_IN: Mapping[float, float] = {0.0: 24.000, 10.0: 24.528, 20.0: 26.375, 30.0: 30.935}
#: Strokes at a4 = 20 in and S1 = 0, by the twist in degrees.
STROKES_BY_TWIST_IN: Mapping[float, float] = {232.0: 21.85, 310.0: 21.39}
#: Greatest shifts at which the crank turns fully at 270 deg, by the offset: sqrt(a2^2 - (a1 + |a4|)^2).
GREATEST_SHIFTS_IN: Mapping[float, float] = {0.0: 48.539, 10.0: 44.900, 20.0: 38.419, 30.0: 27.129}
#: Greatest magnitude of the force 2F2k and half a unit of its last digit (lb), by a4, S1 (in) and alpha4 (deg). We take it as
#: the greatest magnitude more than 10 deg away from a dead centre, since the force is unbounded at a dead centre.
AXIAL_LB: Mapping[tuple[float, float, float], tuple[float, float]] = {
    (10.0, 3.5, 270.0): (4.1, 0.05),
    (20.0, 0.0, 310.0): (27.0, 0.5),
}
