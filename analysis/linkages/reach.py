"""Find the range in which one coordinate can move, and the dead centres of the bodies that it drives."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, pi
from typing import NamedTuple

import numpy as np
import scipy

from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism

from ..mechanisms import variable_unit
from .description import GROUND
from .package import Package
from .structure import Pin, Slider

#: Number of positions tried on each side of the start: for an angle per half turn, for a displacement in all.
_POSITIONS = 360


class Reach(NamedTuple):
    """Range of a freedom about its start in which the linkage can be assembled, with the other freedoms at their start.

    Attributes
    ----------
    freedom : int
        Index of the degree of freedom.
    unit : str
        Unit of the freedom's coordinate, rad or m.
    low, high : float
        Ends of the range (rad, m): limits of assembly, or the ends of a turn or of the search.
    open : (bool, bool)
        For the low and the high end: whether the linkage can move beyond this end.
    turns : bool
        Whether the freedom can make a whole turn.
    least : float
        Least clearance of any dyad in the range; the clearance of a dyad is the sine of its transmission angle.
    """

    freedom: int
    unit: str
    low: float
    high: float
    open: tuple[bool, bool]
    turns: bool
    least: float


def reach(mechanism: Mechanism, freedom: int = 0, *, most: float | None = None) -> Reach:
    """Find the range in which the coordinate of a degree of freedom can move.

    Parameters
    ----------
    mechanism : Mechanism
    freedom : int
        Index of the degree of freedom.
    most : float, optional
        Greatest distance from the start that is searched, in both directions. If an angle has a limit in one direction only,
        the other is searched twice as far. By default half the period of the coordinate; if it is not periodic, four turns
        for an angle, and five times the length of the linkage for a displacement.
    """
    coordinate, period = mechanism.freedoms[freedom].coordinate, mechanism.freedoms[freedom].period
    unit = variable_unit(mechanism, coordinate)
    known = mechanism.first_set
    p = known.parameters.constants()
    acting, x = mechanism.idle_inputs(p), list(mechanism.state(known.initial))
    middle, length = x[freedom], mechanism.error_scale(known.parameters, tuple(x))[freedom]
    if most is None:
        most = 0.5 * period or (8.0 * pi if unit == "rad" else 5.0 * length)
    samples = _POSITIONS * (max(round(most / pi), 1) if unit == "rad" else 1)

    def margin(q: float) -> float:
        """Return the clearance to the limit of assembly at a coordinate; below -1 if the bodies do not reach each other."""
        x[freedom] = q
        try:
            return float(mechanism.equations.clearance(x, acting, p)) - LIMIT_SINE
        except (ArithmeticError, ValueError):
            return -1.0 - LIMIT_SINE

    low, high = (_seek_limit(margin, middle, sign * most, samples) for sign in (-1.0, 1.0))
    if unit == "rad" and low.open != high.open:
        # an angle that cannot turn has both its limits within a turn
        low, high = (
            _seek_limit(margin, middle, 2.0 * sign * most, 2 * samples) if one.open else one
            for sign, one in ((-1.0, low), (1.0, high))
        )
    ends, free, least = (low.at, high.at), (low.open, high.open), min(low.least, high.least)
    whole = ends[1] - ends[0] > period * (1.0 - 1e-9) if period else unit == "rad" and all(free)
    return Reach(freedom, unit, *ends, free, whole, least + LIMIT_SINE)


class _End(NamedTuple):
    """One end of a range: coordinate, whether the linkage can move on, least clearance on the way."""

    at: float
    open: bool
    least: float


def _seek_limit(margin: Callable[[float], float], middle: float, most: float, samples: int) -> _End:
    """Find the limit of assembly nearest to ``middle`` on the way to ``middle + most``; ``margin`` is zero there."""
    # one position more at each end, so that a minimum in the first or the last interval is found
    places = (middle + most * np.arange(-1, samples + 2) / samples).tolist()
    least = margin(middle)
    values, near = [margin(places[0]), least], 1e-9 * abs(most)
    for n, q in enumerate(places[2:], 2):
        values.append(margin(q))
        lowest, at = (values[n], q) if n <= samples + 1 else (inf, q)
        if values[n - 2] > values[n - 1] <= values[n]:
            # a limit may lie between two positions, where the sine of a transmission angle goes through zero
            bounds = sorted((places[n - 2], q))
            dip = scipy.optimize.minimize_scalar(margin, bounds=bounds, method="bounded", options={"xatol": near})
            if dip.fun < min(values[n - 1], lowest) and 0.0 <= (dip.x - middle) / most <= 1.0:
                lowest, at = float(dip.fun), float(dip.x)
        if lowest < 0.0:
            before = places[max(n - 2, 1)]
            end = scipy.optimize.brentq(lambda c: max(margin(c), -1.0), before, at, xtol=near)
            return _End(float(end), False, 0.0)
        least = min(least, lowest)
    return _End(places[samples + 1], True, least)


class DeadCentre(NamedTuple):
    """A position at which a driven body stands still while the freedom moves on.

    Attributes
    ----------
    name : str
        Name of the body if it is pinned to the ground, or of its slide if it slides on the ground.
    at : float
        Coordinate of the freedom (rad, m).
    """

    name: str
    at: float


def dead_centres(package: Package, freedom: int = 0, samples: int = 720) -> list[DeadCentre]:
    """Find the positions of a freedom at which a body that is pinned to the ground, or slides on it, stands still.

    The other freedoms are at their start. At such a position the velocity coefficient of the body changes its sign; this is
    sought in ``samples`` equal intervals of the range.
    """
    made, joints = package.mechanism(), package.structure.joints.values()
    # a spring about its pin counts the turns of a crank, but the bodies are back after one
    turns = package.interface.drives[freedom].turns_back
    found, known = reach(made, freedom, most=pi * turns or None), made.first_set
    p, x = known.parameters.constants(), list(made.state(known.initial))
    own = {drive.joint for drive in package.interface.drives}
    driven = [joint for joint in joints if GROUND in joint.bodies and joint.name not in own]
    outputs: dict[str, Pin | Slider] = {}
    for joint in driven:
        for body in joint.bodies:
            if body in package.description.bodies:
                outputs[body if isinstance(joint, Pin) else joint.name] = joint

    def coefficient(q: float, name: str) -> float:
        x[freedom] = q
        places, joint = made.modules[-1].places(tuple(x), p), outputs[name]
        if isinstance(joint, Pin):
            return float(getattr(places, f"{name}_frame").turn.columns[freedom])
        line, origin = getattr(places, f"{name}_line"), getattr(places, f"{joint.bodies[1]}_frame").origin
        return float(line.c * origin.columns[freedom][0] + line.s * origin.columns[freedom][1])

    span = found.high - found.low
    # clear of the ends, where the bodies cannot be joined; a turn ends where it begins
    margin = 0.0 if found.turns else 1e-6 * span
    at = np.linspace(found.low + margin, found.high - margin, samples + 1) + (
        0.37 * span / samples if found.turns else 0.0
    )
    centres = []
    for name in outputs:
        values = np.array([coefficient(float(q), name) for q in at])
        if np.abs(values).max() < 1e-9:
            continue
        for n in np.flatnonzero(values[:-1] * values[1:] < 0.0):
            place = scipy.optimize.brentq(lambda q, name=name: coefficient(q, name), at[n], at[n + 1], xtol=1e-12)
            centres.append(DeadCentre(name, float(place)))
    return centres
