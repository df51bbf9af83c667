"""Cautions about a run: parameters that make it stiff, and a balance of energy that its tolerance does not promise."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
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
#: Radians of the fastest vibration in a step from which on the step follows it: at the usual tolerance it takes about one.
_FOLLOWED = 0.3
#: Residual of the energy balance relative to tolerance and greatest energy, and at most to the greatest energy, beyond which it
#: is reported: a usual run has 2, one of 2000 turns 12.
_RESIDUAL, _MOST = 1e4, 0.05


def disturbance_rates(mechanism: Mechanism, x: NDArray[np.float64], held: Any, p: Any) -> NDArray[np.complex128]:
    """Return the eigenvalues of small disturbances of a state (1/s), by differences of the rates."""
    rates, columns = mechanism.equations.derivative, []
    for i, size in enumerate(np.maximum(np.abs(x), 1e-3) * 1e-6):
        ends = []
        for sign in (1.0, -1.0):
            beside = x.copy()
            beside[i] += sign * size
            ends.append(np.array(rates(tuple(beside.tolist()), held, p)))
        columns.append((ends[0] - ends[1]) / (2.0 * size))
    return np.linalg.eigvals(np.column_stack(columns)).astype(complex)


def stiffness(rates: NDArray[np.complex128], steps: float, duration: float, usual: float) -> str:
    """Return a sentence on a run of many steps because disturbances die out fast or vibrate fast; empty if it is not one.

    A vibration is fast beyond the ``usual`` angular frequency (rad/s), which samples or drive explain.
    """
    step = duration / steps
    decay, vibration = float(-rates.real.min()), float(np.abs(rates.imag).max())
    if decay * step >= _STABLE:
        return (
            f"{steps:.3g} steps of {step:.2g} s, since the run is stiff: a disturbance dies out within "
            f"{1.0 / decay:.2g} s (too small a mass or too great a damping?); the implicit method 'Radau' takes far fewer"
        )
    if vibration * step >= _FOLLOWED and vibration > usual:
        return (
            f"{steps:.3g} steps of {step:.2g} s, since they follow a vibration of {vibration / (2.0 * pi):.3g} Hz, too fast "
            "for the samples to show it (too small a mass or too stiff a spring?); damping would end it"
        )
    return ""


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
