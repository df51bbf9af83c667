"""The least change that keeps conditions, by IPOPT with their derivatives; where none does, the nearest to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from linkwork.errors import LinkworkError

from ..numerics import symbolic
from .conditions import Condition
from .places import FloatArray
from .wish import Wish

#: IPOPT's tolerance, iterations at most, and the violation of a condition that counts as none.
_TOLERANCE, _ITERATIONS, VIOLATION = 1e-9, 60, 1e-8
#: Points at which a place was not found, after which a program is given up.
_PATIENCE = 4
#: Weight of the other changes, in the squares of their tolerances, where one parameter is made least, and of all of them where
#: violations are: what does not matter stays as it is.
_REST = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What a program came to.

    Attributes
    ----------
    x : ndarray, shape (k,)
        The changes in their tolerances.
    objective : float
    violations : mapping
        By requirement, the greatest of its conditions' violations.
    """

    x: FloatArray
    objective: float
    violations: dict[str, float]

    @property
    def met(self) -> bool:
        """Whether all conditions are kept."""
        return self.total <= VIOLATION

    @property
    def total(self) -> float:
        """Sum of the violations."""
        return sum(self.violations.values())


def objective(wish: Wish, x: Any) -> Any:
    """What is made least: squares of the changes, or a parameter in its tolerance; of numbers or of symbols."""
    squares = symbolic.library().sumsqr(x)
    if not wish.least:
        return squares
    k = wish.names.index(wish.least)
    return x[k] + _REST * (squares - x[k] ** 2)


def nearest(wish: Wish, conditions: Sequence[Condition], x: FloatArray) -> Answer:
    """Solve from some changes; where no changes keep the conditions, make the sum of the violations least.

    Raises LinkworkError if a place is not found even at the start.
    """
    answer = _solve(wish, conditions, x, elastic=False)
    if not answer.met and isfinite(answer.total):
        softer = _solve(wish, conditions, x, elastic=True)
        if softer.met:
            answer = _solve(wish, conditions, softer.x, elastic=False)
        if not answer.met and softer.total < answer.total:
            answer = softer
    return answer


def _solve(wish: Wish, conditions: Sequence[Condition], x: FloatArray, *, elastic: bool) -> Answer:
    casadi = symbolic.library()
    count, groups = len(x), list(dict.fromkeys(condition.group for condition in conditions))
    low, high = wish.scaled(wish.low), wish.scaled(wish.high)
    z = casadi.MX.sym("z", count + len(groups) * elastic)
    f, lows, highs, start = objective(wish, z[:count]), low, high, np.clip(x, low, high)
    values = _Values(conditions)
    held = values.function(count)
    g = held(z[:count])
    if elastic:
        share = np.zeros((len(conditions), len(groups)))
        for row, condition in enumerate(conditions):
            share[row, groups.index(condition.group)] = 1.0
        over = z[count:]
        f, g = casadi.sum1(over) + _REST * casadi.sumsqr(z[:count]), g + casadi.DM(share) @ over
        first = np.array([max(-v for v, c in zip(values(start)[0], conditions) if c.group == name) for name in groups])
        lows, highs = np.append(low, np.zeros(len(groups))), np.append(high, np.full(len(groups), np.inf))
        start = np.append(start, np.maximum(first, 0.0) + 1e-3)
    solver = symbolic.ipopt(
        "tune",
        {"x": z, "f": f, "g": g},
        tol=_TOLERANCE,
        constr_viol_tol=0.1 * VIOLATION,
        max_iter=_ITERATIONS,
        bound_relax_factor=0.0,
        hessian_approximation="limited-memory",
        # a start in the middle of its bounds is not moved
        bound_push=1e-6,
        bound_frac=1e-6,
        mu_strategy="adaptive",
    )
    found = np.asarray(solver(x0=start, lbx=lows, ubx=highs, lbg=0.0, ubg=np.inf)["x"]).ravel()[:count]
    found = np.clip(found, low, high)
    reached = values(found)[0]
    if not np.isfinite(reached).all():
        found, reached = np.clip(x, low, high), values(np.clip(x, low, high))[0]
    over_by = dict.fromkeys(groups, 0.0)
    for value, condition in zip(reached, conditions):
        over_by[condition.group] = max(over_by[condition.group], -value if np.isfinite(value) else np.inf)
    return Answer(x=found, objective=float(objective(wish, casadi.DM(found))), violations=over_by)


class _Values:
    """The conditions' values and derivatives at the changes, those of the last point remembered; NaN where there are none."""

    def __init__(self, conditions: Sequence[Condition]) -> None:
        self.conditions = conditions
        self._last: tuple[bytes, bool, FloatArray, FloatArray] | None = None
        self._lost = 0

    def __call__(self, x: FloatArray, slopes: bool = False) -> tuple[FloatArray, FloatArray]:
        """Shapes (m,) and (m, k)."""
        key = x.tobytes()
        if self._last is not None and self._last[0] == key and self._last[1] >= slopes:
            return self._last[2:]
        values, rows = np.full(len(self.conditions), np.nan), np.full((len(self.conditions), len(x)), np.nan)
        for row, condition in enumerate(self.conditions if self._lost < _PATIENCE else ()):
            try:
                values[row] = condition.value(x)
                if slopes:
                    rows[row] = condition.slopes(x)
            except LinkworkError:
                self._lost += 1
                break
        self._last = key, slopes, values, rows
        return values, rows

    def function(self, count: int) -> Callable[[Any], Any]:
        """The same for CasADi."""
        function: Callable[[Any], Any] = symbolic.external("conditions", count, len(self.conditions), self.__call__)
        return function
