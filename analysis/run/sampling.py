"""Sample the inputs of a run in Python, for co-simulation, SciPy's methods and error messages."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from .inputs import NUMBER, Encoded
from .signals import kloss


class NotFiniteError(InputError):
    """Error for an input that is not a finite number at time t and state x; ``number`` is the index of its channel."""

    def __init__(self, encoded: Encoded, number: int, t: float, x: NDArray[np.float64]) -> None:
        self.number = number
        where = encoded.mechanism.describe_state(x.tolist())
        super().__init__(f"the input {encoded.value_name(number)} is not a finite number at t = {t:.9g} s, {where}")


def sample(
    encoded: Encoded,
    t: float,
    x: NDArray[np.float64],
    laws: NDArray[np.float64],
    *,
    left: bool = False,
    ahead: float = -np.inf,
) -> NDArray[np.float64]:
    """Sample the input channels at time t and state x in Python, calling the user's functions uncompiled.

    Parameters
    ----------
    laws : ndarray, shape (torques, 6)
        Torque laws in their present state, see `signals.Source`; at the start of a run those of ``encoded``.
    left : bool
        Whether to take the limit from the left where an input jumps.
    ahead : float
        Time (s). If it is later than t, the channels are sampled at t and held until ``ahead``: commanded rates change
        linearly, a torsion bar acts with the torque predicted for the middle of the step, and is marked as released in
        ``laws`` once it has unwound.

    Raises
    ------
    NotFiniteError
        If a channel is not a finite number.
    """
    if encoded.constant is not None:
        return encoded.constant.copy()
    x = np.ascontiguousarray(x)
    if ahead > t:
        release(encoded, x, laws)
    source = encoded.source._replace(laws=laws)
    u = np.zeros(len(encoded.mechanism.channels))
    if source.is_constant:
        u[source.places[:, 0]] = source.coefficients[0, :, 0]
    else:
        from .sources import channels  # compiled on its first call

        # all arrays are those of `encode`, or made here
        channels.unchecked(t, ahead, left, x, source, encoded.commands, u, np.empty_like(u))
    here = np.zeros_like(u)
    if encoded.has_functions:
        here = function_values(encoded, t, x)
        u += here
        if ahead > t and len(encoded.commands) and np.isfinite(here).all():
            there = function_values(encoded, ahead, x)
            for value, _, rate in encoded.commands:
                u[rate] += (there[value] - here[value]) / (ahead - t) - here[rate]
    finite = [isfinite(value) for value in u.tolist()]
    if not all(finite):
        lost = finite.index(False)
        # if inputs are held, the derivative of a command is the slope of its secant
        commands = {int(rate): int(value) for value, _, rate in encoded.commands}
        secant = ahead > t and np.isfinite(here[lost])
        raise NotFiniteError(encoded, commands.get(lost, lost) if secant else lost, t, x)
    return u


def name_channels(encoded: Encoded, u: NDArray[np.float64]) -> dict[str, float]:
    """Return the values u of the channels in a mapping, by their FMI names."""
    return dict(zip(encoded.mechanism.input_names, u.tolist()))


def release(encoded: Encoded, x: NDArray[np.float64], laws: NDArray[np.float64]) -> None:
    """Mark in ``laws`` the torsion bars that have unwound at state x as released."""
    laws[x[encoded.source.law_places[:, 1]] >= laws[:, 1], 2] = 0.0


def law_slopes(encoded: Encoded, states: NDArray[np.float64]) -> Iterator[tuple[int, int, NDArray[np.float64]]]:
    """Yield the derivatives of the torques of bars and motors at states, shape (s, size).

    Each is the index of the torque's channel, the index of the component of the state on which it depends, and the derivative
    with respect to this component, shape (s,).
    """
    for law, (channel, angle, speed) in zip(encoded.source.laws, encoded.source.law_places.tolist()):
        if law[2] != 0.0:
            yield channel, angle, np.where(states[:, angle] < law[1], -law[0] / law[1], 0.0)
        if law[3] != 0.0:
            yield channel, speed, kloss(law[3:], states[:, speed] + 1e-30j).imag / 1e-30  # a complex step: exact


def function_values(encoded: Encoded, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values that the user's functions add to the channels at time t and state x, shape (channels,)."""
    added = np.zeros(len(encoded.mechanism.channels))
    state = x[: 2 * len(encoded.mechanism.freedoms)].tolist()
    for functions, places in zip(encoded.functions, encoded.source.places):
        for function, place in zip(functions, places):
            if function is not None:
                value = function(t, *state)
                if not isinstance(value, NUMBER):
                    raise InputError(f"an input function returned {value!r} at t = {t:.9g} s: it must return a float")
                added[place] += float(value)
    return added
