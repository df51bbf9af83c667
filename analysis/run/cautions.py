"""Cautions about a run: parameters that make it stiff, and a balance of energy that its tolerance does not promise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.mechanism import Mechanism

#: Steps from which on a run may be stiff: a usual one takes some 50 a turn.
MANY_STEPS = 50_000
#: Steps after which a stiff run ends if it needs more than this share of the most steps.
_PATIENCE, _SHARE = 1_000_000, 0.1
#: Decay rate times step size from which on stability limits the step: explicit methods of this order bear some 5.
_STABLE = 2.0
#: Residual of the energy balance relative to tolerance and greatest energy, and at most to the greatest energy, beyond which it
#: is reported: a usual run has 2, one of 2000 turns 12.
_RESIDUAL, _MOST = 1e4, 0.05


def fastest_decay(mechanism: Mechanism, x: NDArray[np.float64], held: Any, p: Any) -> float:
    """Return the greatest rate at which a small disturbance of a state dies out (1/s), by differences of the rates."""
    rates, columns = mechanism.equations.derivative, []
    for i, size in enumerate(np.maximum(np.abs(x), 1e-3) * 1e-6):
        ends = []
        for sign in (1.0, -1.0):
            beside = x.copy()
            beside[i] += sign * size
            ends.append(np.array(rates(tuple(beside.tolist()), held, p)))
        columns.append((ends[0] - ends[1]) / (2.0 * size))
    return float(-np.linalg.eigvals(np.column_stack(columns)).real.min())


def stiffness(decay_rate: Callable[[], float], steps: float, duration: float) -> str:
    """Return a sentence on a run that takes its many steps only because disturbances die out fast; empty if it does not."""
    if steps < MANY_STEPS or (decay := decay_rate()) * duration < _STABLE * steps:
        return ""
    return (
        f"{steps:.3g} steps of {duration / steps:.2g} s, since the run is stiff: a disturbance dies out within "
        f"{1.0 / decay:.2g} s (too small a mass or too great a damping?); the implicit method 'Radau' takes far fewer"
    )


def too_slow(steps: Any, passed: Any, span: float, most: int) -> Any:
    """Return whether a run, if it is stiff, is to end after so many steps: it would need too many of the most for its span.

    ``steps`` and ``passed``, the time that has passed (s), are of one run or arrays of several.
    """
    return (steps >= _PATIENCE) & (steps * span >= _SHARE * most * passed)


def energy_balance(names: Sequence[str], values: NDArray[np.float64], tolerance: float) -> str:
    """Return a sentence on a residual of the energy balance greater than a tolerance promises; empty if it is not."""
    if "energy.residual" not in names or not len(values):
        return ""
    places = [n for n, name in enumerate(names) if name.startswith("energy.")]
    greatest = dict(zip([names[n] for n in places], np.abs(values[:, places]).max(axis=0).tolist()))
    residual = greatest.pop("energy.residual")
    size = max(greatest.values(), default=0.0)
    if residual <= min(_RESIDUAL * tolerance, _MOST) * size:
        return ""
    return (
        f"the balance of energy misses {residual:.3g} J where the greatest energy is {size:.3g} J, more than the tolerance "
        f"{tolerance:g} promises (masses of very different sizes?): take a smaller tolerance"
    )
