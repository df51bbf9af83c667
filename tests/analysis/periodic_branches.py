"""Make branches from formulas, without computing motions, for tests of reading and drawing branches."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from analysis.periodic import Branch, Crossing, Drive, Family, Response, SpecialPoint
from linkwork.five_bar.published import TABLE_3_1

#: Family of motions with a parameter p without a unit.
FAMILY = Family(
    parameters=TABLE_3_1, drive=Drive(speed=30.0), vary=lambda value: (TABLE_3_1, Drive(speed=30.0)), name="p"
)


def orbit(
    amplitude: float, largest: float, start: float | None = None, *, periods: int = 1, crank_turns: int = 1
) -> Any:
    """Return a stand-in for an orbit, with the attributes that branches read."""
    y = np.array([amplitude if start is None else start, 0.0])
    return SimpleNamespace(
        amplitude=amplitude,
        amplitudes=np.array([amplitude]),
        largest=largest,
        start=y,
        swing=("u", "m"),
        swings=(("u", "m"),),
        scale=np.ones(2),
        periods=periods,
        turns=periods,
        crank_turns=crank_turns,
        flow=SimpleNamespace(remove_turns=lambda away: away),
        distance=lambda other: float(np.abs(other - y).max()),
    )


def branch(
    parameter: ArrayLike,
    amplitude: ArrayLike,
    largest: ArrayLike,
    special: Sequence[tuple[Crossing, float, float, int]] = (),
    *,
    turns: int = 1,
    common: int = 1,
) -> Branch:
    """Return a branch of amplitudes (m).

    Each of ``special`` has kind, parameter and amplitude of a special point, and the index of the point before it.
    """
    x, a = np.asarray(parameter, dtype=float), np.asarray(amplitude, dtype=float)
    rho = np.broadcast_to(np.asarray(largest, dtype=float), x.shape)
    made = Branch(
        family=FAMILY,
        turns=turns,
        parameter=x,
        orbits=tuple(
            orbit(*values, periods=turns, crank_turns=common * turns) for values in zip(a.tolist(), rho.tolist())
        ),
        special=tuple(
            SpecialPoint(kind=kind, parameter=value, orbit=orbit(size, 1.0), after=after)
            for kind, value, size, after in special
        ),
        reached=True,
        closed=False,
        reason="",
    )
    table = {"amplitude of u [m]": a, "harmonic 1 of u [m]": 0.9 * a, "harmonic 2 of u [m]": 0.1 * a}
    table |= {"greatest crank torque [N.m]": 2.0 * a, "greatest force in pin A [N]": 3.0 * a}
    made.__dict__["_columns"] = table
    return made


def hysteresis(points: int = 400) -> Branch:
    """Return the curve p = 100 + (a - 2)^3 - 3 (a - 2) over the amplitude a (m); folds at a = 1, p = 102 and a = 3, p = 98."""
    a = np.linspace(-0.3, 4.3, points)
    x = 100.0 + (a - 2.0) ** 3 - 3.0 * (a - 2.0)
    folds = [(Crossing.FOLD, x_, a_, int(np.searchsorted(a, a_)) - 1) for x_, a_ in ((102.0, 1.0), (98.0, 3.0))]
    return branch(x, a, np.where(abs(a - 2.0) < 1.0, 1.5, 0.5), folds)


def response(*branches: Branch) -> Response:
    """Return a response that consists of these branches."""
    every = np.concatenate([b.parameter for b in branches])
    return Response(branches=branches, low=float(every.min()), high=float(every.max()), problems=())
