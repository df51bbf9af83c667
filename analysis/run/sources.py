"""Evaluate the inputs of a run in compiled code: for a given time and state, or as a master holds them over a step."""

from __future__ import annotations

from math import cos, pi, sin

from numba import boolean, float64, int64, types

from ..numerics.codegen import CUBE, MATRIX, VECTOR, call_user, inner, kernel
from .signals import Source, kloss

_torque_of_motor = inner(kloss)


ADDRESSES = int64[::1]
PLACES = int64[:, ::1]
SOURCE = types.NamedTuple((VECTOR, CUBE, MATRIX, PLACES, MATRIX, PLACES, PLACES), Source)


@inner
def find(t, breaks):
    """Return the index of the polynomial piece that contains t, or begins at t.

    The first and the last piece extend beyond the outer breaks.
    """
    piece, above = 0, breaks.shape[0] - 1
    while above - piece > 1:
        middle = (piece + above) // 2
        if breaks[middle] <= t:
            piece = middle
        else:
            above = middle
    return piece


@inner
def _find_piece(t, breaks):
    """Return the index of the polynomial piece that contains t, or ends at t."""
    piece = find(t, breaks)
    return piece - 1 if piece > 0 and t == breaks[piece] else piece


@inner
def write_channels(begin, elapsed, piece, x, source, u):
    """Write the input channels at state x and time ``begin + elapsed`` into u, with the given piece of the polynomials.

    Polynomials and harmonics are not evaluated at the sum ``begin + elapsed``. At late times the sum is rounded so much that
    the inputs would change in steps, which an integrator would try to follow.
    """
    s = (begin - source.breaks[piece]) + elapsed
    for n in range(source.places.shape[0]):
        c = source.coefficients[piece, n]
        value, rate = source.places[n]
        u[value] = c[0] + s * (c[1] + s * (c[2] + s * c[3]))
        if rate >= 0:
            u[rate] = c[1] + s * (2.0 * c[2] + s * 3.0 * c[3])
    harmonics = source.harmonics
    for k in range(harmonics.shape[0]):
        value, rate = source.places[int(harmonics[k, 0])]
        phase = harmonics[k, 2] * begin + harmonics[k, 3]
        phase -= 2.0 * pi * int(phase / (2.0 * pi))
        phase += harmonics[k, 2] * elapsed
        u[value] += harmonics[k, 1] * cos(phase)
        if rate >= 0:
            u[rate] -= harmonics[k, 1] * harmonics[k, 2] * sin(phase)
    for n in range(source.laws.shape[0]):
        law = source.laws[n]
        channel, coordinate, speed = source.law_places[n]
        if law[2] != 0.0:
            u[channel] += law[0] * (1.0 - x[coordinate] / law[1])
        if law[3] != 0.0:
            u[channel] += _torque_of_motor(law[3:6], x[speed])
    for n in range(source.functions.shape[0]):
        function, of_rate = source.functions[n]
        if function != 0:
            u[source.places[n, 0]] += call_user(function, begin + elapsed, x)
        if of_rate != 0:
            u[source.places[n, 1]] += call_user(of_rate, begin + elapsed, x)


@inner
def is_bar_wound(laws):
    """Return whether any torsion bar acts."""
    for n in range(laws.shape[0]):  # noqa: SIM110 - Numba compiles no generators
        if laws[n, 2] != 0.0:
            return True
    return False


@inner
def is_bar_unwound(n, x, source):
    """Return whether torsion bar n acts and has fully unwound at state x."""
    return source.laws[n, 2] != 0.0 and x[source.law_places[n, 1]] >= source.laws[n, 1]


@inner
def _held_bar_correction(law, angle, speed, step):
    """Return the correction to a torsion bar's torque at the beginning of a step over which the torque is held.

    The held torque is the torque at the angle predicted for the middle of the step. Its impulse is correct to second order,
    whereas the torque at the beginning would lag by half a step. A negative torque is replaced by zero.
    """
    middle = angle + 0.5 * step * speed
    return law[0] * (max(0.0, 1.0 - middle / law[1]) - (1.0 - angle / law[1]))


@kernel(types.void(float64, float64, boolean, VECTOR, SOURCE, PLACES, VECTOR, VECTOR), purpose="the sampling of inputs")
def channels(t, ahead, left, x, source, commands, u, there):
    """Write the input channels at time t and state x into u.

    Where an input jumps, u has the limit from the left if ``left`` is true, else the limit from the right.

    If ``ahead`` is later than t, the channels are those held from t to ``ahead``, see `hold`. ``there`` is a work array for
    channels.
    """
    write_channels(t, 0.0, _find_piece(t, source.breaks) if left else find(t, source.breaks), x, source, u)
    if ahead > t:
        hold(t, ahead, x, source, commands, u, there)


@inner
def hold(t, ahead, x, source, commands, u, there):
    """Replace the input channels u at time t by the values that a master holds until the time ``ahead``.

    A torsion bar acts with the torque predicted for the middle of the step. A commanded rate changes linearly, so that at
    ``ahead`` it is equal to the command.
    """
    for n in range(source.laws.shape[0]):
        if source.laws[n, 2] != 0.0:
            channel, coordinate, speed = source.law_places[n]
            u[channel] += _held_bar_correction(source.laws[n], x[coordinate], x[speed], ahead - t)
    if commands.shape[0] > 0:
        write_channels(ahead, 0.0, _find_piece(ahead, source.breaks), x, source, there)
        for n in range(commands.shape[0]):
            value, rate = commands[n, 0], commands[n, 2]
            u[rate] = (there[value] - u[value]) / (ahead - t)
