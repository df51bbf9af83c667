"""Numbers to compare with for the slider-crank: Rahman's data and statements, and an independent derivation.

Source: S. Rahman, "Dynamic analysis of the generalized slider crank", MS thesis, NJIT, May 1991; section 3.1 (data) and 3.2
(statements). The thesis's figures are not legible in the copy there is: spot values, dead centres, strokes and limits of
the shift are from an independent derivation of the closed form, given to the digits shown. Inches, pounds force, seconds
and degrees, as printed; the factors to SI are at the top. Nothing here is the output of this program.
"""

from __future__ import annotations

from analysis.studies.rahman.table import (  # noqa: F401
    DEAD_CENTRES_DEG,
    GREATEST_SHIFTS_IN,
    SPOTS,
    STROKES_BY_TWIST_IN,
    STROKES_IN,
    Spot,
)

# One of the unit, in SI
INCH = 0.0254
POUND_FORCE = 4.4482216152605
POUND_INCH = POUND_FORCE * INCH

# Section 3.1
CRANK_IN, ROD_IN = 12.0, 50.0
OFFSETS_IN = (0.0, 10.0, 20.0, 30.0)
TWISTS_DEG = (232.0, 270.0, 310.0)
SHIFTS_IN = (0.0, 3.0, 3.5, 6.0, 9.0)
MASSES_LB_S2_IN = (0.06146594, 0.11382582, 0.01956522)
CRANK_RADIUS_IN, ROD_RADIUS_IN, SLIDER_SIDE_IN = 1.5, 1.0, 3.0
DENSITY_LB_IN3, GRAVITY_IN_S2 = 0.28, 386.4
SPEED_RPM = 50.0
TORQUE_LB_IN = 100.0
