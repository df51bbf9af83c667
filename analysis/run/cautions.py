"""Cautions about a run: it is stiff, outputs are not finite, the energy residual is large, or a spring slips a turn."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import isfinite, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.limits import SLIPPED
from linkwork.mechanism import Mechanism

#: Least number of steps at which a run is checked for stiffness: a usual run takes about 50 steps per revolution.
MANY_STEPS = 50_000
#: A stiff run ends after the first number of steps if it would need more steps than the largest number times the second.
_PATIENCE, _SHARE = 1_000_000, 0.1
#: Least decay rate times step size at which stability limits the step: explicit methods of this order are stable up to about 5.
_STABLE = 2.0
#: Least phase angle (rad) of the fastest vibration in a step at which the vibration is taken to limit the step: where it does,
#: the angle is usually about 1.
_FOLLOWED = 0.3
#: Largest residual of the energy balance without a caution: the first number times tolerance times greatest energy, but at most
#: the second times greatest energy. For comparison with the first number: a usual run has 2, a run of 2000 revolutions 12.
_RESIDUAL, _MOST = 1e4, 0.05


def disturbance_rates(mechanism: Mechanism, x: NDArray[np.float64], held: Any, p: Any) -> NDArray[np.complex128]:
    """Return the eigenvalues (1/s) of the equations linearised at the state x with inputs ``held``, by finite differences."""
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
    """Return a caution if small disturbances that decay or vibrate fast make the steps of a run short; else an empty text.

    ``rates`` are the eigenvalues of `disturbance_rates`; ``steps`` is the number of steps in the ``duration`` (s). A vibration
    up to the angular frequency ``usual`` (rad/s) is not reported: the samples show it or the drive excites it.
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


def is_too_slow(steps: Any, passed: Any, span: float, most: int) -> Any:
    """Return whether a stiff run should end now, as it would need too many steps for its duration ``span`` (s).

    ``steps`` is the number of steps so far, ``passed`` the time that they covered (s): numbers for one run, or arrays for
    several runs. ``most`` is the largest number of steps.
    """
    return (steps >= _PATIENCE) & (steps * span >= _SHARE * most * passed)


@lru_cache(maxsize=64)
def _twists(mechanism: Mechanism) -> dict[str, int]:
    """Return, by the name of each spring whose turns are not counted, the index of the output that is its twist."""
    names = mechanism.output_names
    return {v.of: names.index(v.name) for v in mechanism.variables if v.role == "twist"}


def _slipped_springs(mechanism: Mechanism, time: NDArray[np.float64], values: NDArray[np.float64]) -> str:
    """Return a caution that names springs whose torque jumps as their twist passes half a turn; else an empty text.

    ``values`` are the outputs at the samples, shape (n, outputs), and ``time`` the times of the samples (s).
    """
    found = []
    for name, column in _twists(mechanism).items():
        jumps = np.flatnonzero(np.abs(np.diff(values[:, column])) > pi)
        if len(jumps):
            found.append(f"{name} at t = {time[jumps[0] + 1]:.4g} s")
    return f"the torque of {' and '.join(found)} {SLIPPED}" if found else ""


def _undefined_outputs(names: Sequence[str], time: NDArray[np.float64], values: NDArray[np.float64]) -> str:
    """Return a caution that names the outputs that are not finite at a sample; an empty text if there is none.

    ``values`` are the outputs ``names`` at the samples, shape (n, outputs), and ``time`` the times of the samples (s).
    """
    samples, columns = np.nonzero(~np.isfinite(values))
    found = [names[column] for column in dict.fromkeys(columns.tolist())]
    if not found:
        return ""
    more = f" and {len(found) - 3} more outputs" if len(found) > 3 else ""
    verb = "is not a finite number" if len(found) == 1 else "are not finite numbers"
    return f"{', '.join(found[:3])}{more} {verb} at t = {time[samples[0]]:.4g} s: the equations do not determine them there"


@lru_cache(maxsize=64)
def _energies(names: tuple[str, ...]) -> NDArray[np.int64]:
    """Return the indices of the outputs that are energies, first that of the residual of their balance."""
    first = names.index("energy.residual")
    return np.array([first, *(n for n, name in enumerate(names) if name.startswith("energy.") and n != first)])


def _energy_balance(names: tuple[str, ...], greatest: NDArray[np.float64], tolerance: float) -> str:
    """Return a caution if the residual of the energy balance is larger than the tolerance promises; else an empty text.

    ``greatest`` are the greatest magnitudes of the outputs ``names`` in the run.
    """
    if "energy.residual" not in names:
        return ""
    residual, *energies = greatest[_energies(names)].tolist()
    size = max(energies, default=0.0)
    if residual <= min(_RESIDUAL * tolerance, _MOST) * size:
        return ""
    return (
        f"the residual of the energy balance is {residual:.3g} J at a greatest energy of {size:.3g} J, more than the tolerance "
        f"{tolerance:g} promises (masses of very different sizes?): take a smaller tolerance"
    )


def output_cautions(
    mechanism: Mechanism, time: NDArray[np.float64], values: NDArray[np.float64], tolerance: float | None
) -> str:
    """Return the cautions about the outputs of a run, as one text; an empty text if there is none.

    ``values`` are the outputs at the samples, shape (n, outputs), ``time`` the times of the samples (s). Whether outputs are
    finite and energies are balanced is judged by the ``tolerance`` of the run; it is None if the run ended early, or is that of
    an FMU, and both are then not judged.
    """
    doubt, names = "", mechanism.output_names
    if tolerance is not None and len(values):
        greatest = np.maximum(np.maximum.reduce(values), -np.minimum.reduce(values))
        if not isfinite(np.add.reduce(greatest)):
            doubt = _undefined_outputs(names, time, values)
        doubt = doubt or _energy_balance(names, greatest, tolerance)
    return "; ".join(filter(None, (doubt, _slipped_springs(mechanism, time, values))))
