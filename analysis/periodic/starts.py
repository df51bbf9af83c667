"""Starts from which periodic motions are sought: they fill the region in which the mechanism can be assembled."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError
from linkwork.parameters import field_name

from ..mechanisms import Parameters, mechanism_of
from ..numerics.sobol import sobol
from ..run import takes_published
from .drives import Drive
from .flows import Flow

#: Distance of two starts, relative to the scale, below which they are of one motion.
SAME = 1e-6
#: How far starts reach where no limit of assembly is met, in the scale of y, and the step to it.
_WIDEST, _WIDER = 16.0, 1.25
#: Crank speeds of starts under a torque, relative to the guess.
_SPEEDS = (0.25, 1.5)


@takes_published()
def scale_of(parameters: Parameters, drive: Drive, start: ArrayLike) -> NDArray[np.float64]:
    """Magnitudes of y: of a five-bar the crank's length, its speed at the pin, and the crank speed."""
    mechanism = mechanism_of(parameters)
    return scale_in(drive.flow(mechanism), parameters, drive.vector(mechanism), np.asarray(start, dtype=float))


def scale_in(
    flow: Flow, parameters: Parameters, vector: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The same, where the flow and the numbers of the drive are at hand."""
    scale = flow.mechanism.error_scale(parameters, flow.state(start, vector))
    return np.array([scale[place] for place in flow.places])


def is_smooth(parameters: Parameters) -> bool:
    """Whether the rates are smooth over a turn: friction changes fast where a motion turns round, which only an integrator with
    steps of its own is sure to meet."""
    mechanism = mechanism_of(parameters)
    rough = [name for name in mechanism.mechanism_variables if "friction" in name]
    return not any(getattr(parameters, field_name(name)) for name in rough) and not mechanism.switched(
        parameters.constants()
    )


def extent_of(parameters: Parameters, drive: Drive, guess: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each free coordinate can go to both sides of zero at the crank angle 0; shape (free coordinates,)."""
    mechanism = mechanism_of(parameters)
    flow, vector, scale = drive.flow(mechanism), drive.vector(mechanism), scale_of(parameters, drive, guess)
    found = scale[: flow.size // 2].copy()
    for i in range(len(found)):
        while found[i] < _WIDEST * scale[i]:
            try:
                for sign in (-1.0, 1.0):
                    y = guess.copy()
                    y[i] = sign * found[i]
                    mechanism.check_assembly(parameters, flow.state(y, vector))
            except AssemblyError:
                break
            found[i] *= _WIDER
    return found


def starts_of(
    parameters: Parameters, drive: Drive, guess: NDArray[np.float64], count: int, number: int = 0
) -> NDArray[np.float64]:
    """Starts with all amplitudes up to the extent and all phases, by a scrambled Sobol sequence; shape (count, n).

    Parameters
    ----------
    guess : ndarray, shape (n,)
        Its crank speed is the one about which others are taken under a torque.
    count : int
        A power of two.
    number : int
        Of the set; sets of different numbers have different starts.
    """
    flow, scale = drive.flow(mechanism_of(parameters)), scale_of(parameters, drive, guess)
    half = flow.size // 2
    extent = extent_of(parameters, drive, guess)
    sequence = sobol(flow.size, count, number)
    amplitude, phase = sequence[:, :half], 2.0 * pi * sequence[:, half : 2 * half]
    found = np.tile(guess, (count, 1))
    found[:, :half] = extent * amplitude * np.cos(phase)
    found[:, half : 2 * half] = extent * scale[half : 2 * half] / scale[:half] * amplitude * np.sin(phase)
    if flow.torque:
        low, high = _SPEEDS
        found[:, -1] *= low + (high - low) * sequence[:, -1]
    return found
