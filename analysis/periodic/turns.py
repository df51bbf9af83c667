"""One period of a periodic motion: its outputs, amplitudes and harmonics."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Turn:
    """One period of an orbit at equal steps of the crank angle, its end left out.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        Crank angle (rad), from 0.
    time : ndarray, shape (n,)
        s, from 0.
    period : float
        s.
    states, inputs : ndarray, shapes (n, states) and (n, channels)
        States of a run, no work done, and the channels in force.
    values : ndarray, shape (n, outputs)
        Outputs by `names`: all of the FMI interface but the energies that count from the start of a run.
    turns : int
        Turns of the crank in the period.
    modes : tuple of int
        Values of the mechanism's modes.
    names : tuple of str
    swing : str
        The output whose amplitude is meant where none is named: the first free coordinate, such as ``slider.position``, or
        the crank's speed where nothing else is free.

    Notes
    -----
    ``turn["slider.position"]`` is an output over the period, shape (n,).
    """

    angle: NDArray[np.float64]
    time: NDArray[np.float64]
    period: float
    states: NDArray[np.float64]
    inputs: NDArray[np.float64]
    values: NDArray[np.float64]
    turns: int
    modes: tuple[int, ...]
    names: tuple[str, ...]
    swing: str

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        if name not in self.names:
            raise InputError(f"an orbit has no output {name!r}: it has {', '.join(self.names)}")
        return self.values[:, self.names.index(name)]

    @property
    def amplitude(self) -> float:
        """Half the distance between the least and the greatest value of ``swing``, of a slider position (m).

        From the Fourier series of the turn on a grid eight times as fine, and the parabolas through its greatest and its least
        values: good to a millionth of itself, all the samples being enough for the series.
        """
        u = self[self.swing]
        n = 8 * len(u)
        fine = np.fft.irfft(np.fft.rfft(u), n) * (n / len(u))
        top = np.array([fine.argmax(), fine.argmin()])
        before, at, after = fine[top - 1], fine[top], fine[(top + 1) % n]
        bend = before - 2.0 * at + after
        beyond = np.divide((after - before) ** 2, -8.0 * bend, out=np.zeros(2), where=bend != 0.0)
        return 0.5 * float(np.ptp(at + beyond))

    def harmonic(self, name: str, order: float) -> float:
        """Amplitude of a harmonic of an output, its order counted in turns of the crank: 1/2 where the period is two turns.

        Raises
        ------
        InputError
            If the period does not hold the harmonic a whole number of times, or the samples are too few for it.
        """
        number = order * self.turns
        if number != int(number) or not 0 < number < len(self.angle) / 2:
            raise InputError(
                f"order {order} of an orbit of {self.turns} turn(s) with {len(self.angle)} samples: its orders are "
                f"multiples of 1/{self.turns} up to {(len(self.angle) - 1) // 2 / self.turns:g}"
            )
        return 2.0 * float(np.abs(np.fft.rfft(self[name])[int(number)])) / len(self.angle)


def times_of(speed: NDArray[np.float64], way: float) -> tuple[NDArray[np.float64], float]:
    """Time at equal steps of the crank angle over ``way``, and the period, by integrating the Fourier series of 1 / speed."""
    n = len(speed)
    c = np.fft.rfft(1.0 / speed) / n
    angle = np.arange(n) * (way / n)
    k = np.arange(len(c)) * (2.0 * pi / way)
    integral = np.zeros(len(c), dtype=complex)
    integral[1:] = c[1:] / (1j * k[1:])
    if n % 2 == 0:
        integral[-1] = 0.0
    wave = np.fft.irfft(integral * n, n)
    mean = float(c[0].real)
    return mean * angle + wave - wave[0], way * mean
