"""Rahman's figures 5 to 38: displacement and all joint forces of the generalised slider-crank, one family of studies.

The mechanism of section 3.1 turns at 50 rpm under a crank torque of 100 lb.in, with the offset a4, the shift S1 or the twist
alpha4 in three sizes, each beside the ideal slider-crank (a4 = 0, S1 = 0, alpha4 = 270 deg). What is sought is the force on
the slider, and with it every joint force and moment. It has no finite value at the dead centres, where it has no lever on
the crank: the curves leave the plot there, and dotted lines of their colour mark the places. The greatest value of a curve
is therefore told at whole degrees that are more than `CLEAR_DEG` from a dead centre.

Our source tells which quantities and cases the figures show, but not which stands under which number: the numbering is our
assignment (`_rahman`). What section 3.2 states is held against the computation where the quantity concerned is shown. All
forces are computed a second time by dual vectors, which share no equation with the plant.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable
from functools import cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from linkwork.slider_crank.mobility import ShiftLaw, assembly_margin, constant_shift, dead_centres, greatest_shift, ranges
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, INCH, POUND_FORCE, POUND_INCH, parameters

from ..figures import COLOURS, Curve, Panel, plot_curves
from ..slider_crank.closure import close
from ..slider_crank.dual_dynamics import JointLoads, joint_loads
from ..slider_crank.forces import ConstantShift, ForceTurn, force_turn
from ._rahman import ASSIGNED, FAMILIES, FIGURES, IDEAL, QUANTITIES, SLIDER_MOMENTS, Case, Component
from .study import BALANCE, REFERENCE, THESIS, Study, StudyResult, Verdict, at_least, at_most, near, padded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

#: Crank angles of the curves (deg): half degrees, the whole ones among them.
ANGLES_DEG = np.linspace(0.0, 360.0, 721)
ANGLE = "crank angle theta1 [deg]"
#: Angle (deg) beyond which a value counts as clear of a dead centre.
CLEAR_DEG = 10.0
#: Largest force or moment (lb, lb.in) that is taken for none, and largest relative difference of two ways of computing.
NOTHING, SAME = 1e-6, 1e-9
#: Torque on the crank (lb.in) and its length (in).
TORQUE, CRANK = 100.0, 12.0
#: Where the thesis sees the spikes (deg): in round hundreds, for the cases of a figure together.
SPIKES, SPIKES_TO = (100.0, 300.0), 25.0
#: Dead centres (deg) and strokes (in) at S1 = 0 and 270 deg by a4 (in); strokes at a4 = 20 in and S1 = 0 by alpha4 (deg).
DEAD_CENTRES = {10.0: (99.28, 285.26), 20.0: (108.82, 301.76), 30.0: (118.94, 322.14)}
STROKES = {0.0: 24.000, 10.0: 24.528, 20.0: 26.375, 30.0: 30.935}
TWISTED_STROKES = {232.0: 21.85, 310.0: 21.39}
#: Greatest shift (in) at which the crank turns fully, by a4 (in); the greatest to which the thesis's iteration converged.
SHIFTS, SHIFT_REACHED = {0.0: 48.539, 10.0: 44.900, 20.0: 38.419, 30.0: 27.129}, 9.0
#: Twists (deg) between which the thesis's iteration converged.
TWISTS_REACHED = (232.0, 310.0)
#: Slider force sought at theta1 = 30 deg (lb), by the family and the case.
SPOTS = {("A", "a4 = 10 in"): 15.328251, ("C", "alpha4 = 310 deg"): 8.206263}
#: Greatest |2F2k| clear of the dead centres (lb), and half a unit of the last figure given, likewise.
AXIAL = {("A", "a4 = 10 in"): (4.1, 0.05), ("C", "alpha4 = 310 deg"): (27.0, 0.5)}

_UNITS = {"lb": POUND_FORCE, "lb.in": POUND_INCH}
_CLEAR = f"more than {CLEAR_DEG:g} deg from a dead centre"
_RAISES = "The offset a4 raises the joint forces."


@cache
def turn(case: Case, given: str = "torque") -> ForceTurn:
    """A turn of the crank, with the ``torque`` given and the slider's force sought, or with no ``load`` on the slider."""
    return force_turn(
        parameters(case.offset_in, case.twist_deg),
        crank_speed=CRANK_SPEED,
        shift=ConstantShift(case.shift_in * INCH),
        angles=np.radians(ANGLES_DEG),
        **{given: CRANK_TORQUE if given == "torque" else 0.0},
    )


def dead_centres_deg(case: Case) -> FloatArray:
    """Crank angles of the dead centres (deg)."""
    return np.degrees([centre.crank_angle for centre in turn(case).dead_centres])


def values(case: Case, component: Component, given: str = "torque") -> FloatArray:
    """A component over the turn in the unit as printed, NaN at a dead centre."""
    found = turn(case, given)
    if component.source in ("axial_force", "slider_force"):
        si = getattr(found, component.source)
    else:
        si = found.vector(component.source, component.frame)[:, component.axis]
    return np.asarray(component.sign * np.ma.filled(si, np.nan) / _UNITS[component.unit])


def position(case: Case) -> FloatArray:
    """Slider position (in)."""
    return turn(case).slider_position / INCH


@cache
def clear(case: Case) -> NDArray[np.bool_]:
    """Which of the angles are whole degrees and clear of the dead centres."""
    away = np.abs((ANGLES_DEG[:, None] - dead_centres_deg(case) + 180.0) % 360.0 - 180.0)
    return np.asarray((ANGLES_DEG % 1.0 == 0.0) & (away.min(axis=1) > CLEAR_DEG))


def greatest(case: Case, quantity: FloatArray) -> float:
    """Greatest magnitude of a quantity over the turn, clear of the dead centres."""
    return float(np.abs(quantity[clear(case)]).max())


def spikes_deg(case: Case, component: Component) -> FloatArray:
    """Crank angles (deg) of the two poles of a component: where its reciprocal, which is smooth there, changes its sign."""
    value = values(case, component)
    low, high = value[:-1], value[1:]
    (changes,) = np.nonzero(low * high < 0.0)
    if not changes.size:
        return np.array([])
    # a zero of the component changes its sign too, between small values
    size = np.minimum(np.abs(low), np.abs(high))[changes]
    at = np.sort(changes[np.argsort(size)[-2:]])
    share = (1.0 / value[at]) / (1.0 / value[at] - 1.0 / value[at + 1])
    return np.asarray(ANGLES_DEG[at] + share * (ANGLES_DEG[at + 1] - ANGLES_DEG[at]))


@cache
def dual(case: Case) -> JointLoads:
    """All joint forces by dual vectors, at the angles that are clear of the dead centres."""
    closed = close(
        parameters(case.offset_in, case.twist_deg), np.radians(ANGLES_DEG[clear(case)]), case.shift_in * INCH
    )
    return joint_loads(closed, speed=CRANK_SPEED, torque=CRANK_TORQUE)


def difference_from_dual(case: Case, component: Component) -> float:
    """Greatest difference between a component and that by dual vectors, relative to the greatest force or moment."""
    loads = dual(case)
    if component.source in ("axial_force", "slider_force"):
        si = loads.axial if component.source == "axial_force" else loads.slider_force
    else:
        si = loads.components(component.source, component.frame)[:, component.axis]
    other = component.sign * si / _UNITS[component.unit]
    scale = TORQUE if component.unit == "lb.in" else TORQUE / CRANK
    return float(np.abs(values(case, component)[clear(case)] - other).max()) / scale
