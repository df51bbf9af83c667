"""Define the kinds of linkages, and the motions of the rocker pivot on a guide or a second crank, known or to be found."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import cos, inf, isfinite, pi, sin
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import ParameterError

from ...numerics.fourier import FourierSeries
from ...units import Amount, in_si

FloatArray = NDArray[np.float64]
#: The kinds of linkages; a kind need not be one of the mechanisms that can be simulated.
Kind = Literal["four-bar", "slider-crank", "geared-five-bar"]
#: Greatest number of turns of either crank per period of a geared five-bar.
TEETH = 6


@dataclass(frozen=True, slots=True, eq=False)
class SliderMotion:
    """Motion of the rocker pivot D along a guide: a Fourier series of the crank's rotation phi.

    Attributes
    ----------
    series : FourierSeries
        Position u(phi) on the guide from the end E of the ground link (m); its order is the number of harmonics.
    guide_angle : float
        alpha, the guide's direction from the ground link (rad).

    Raises
    ------
    ParameterError
        If the guide's angle is not finite.
    """

    series: FourierSeries
    guide_angle: float = 0.0

    def __post_init__(self) -> None:
        if not isfinite(self.guide_angle):
            raise ParameterError("guide_angle", self.guide_angle, "be a finite number")

    def displacement(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return x and y of D from the end E of the ground link, in the frame of that link (m)."""
        u = self.series(rotation)
        return u * cos(self.guide_angle), u * sin(self.guide_angle)

    @property
    def stroke(self) -> float:
        """Return the distance between the ends of the slider's travel (m)."""
        return float(np.ptp(self.series(np.linspace(0.0, 2.0 * pi, 1440, endpoint=False))))

    def scale(self, factor: float) -> SliderMotion:
        """Return the motion for the same linkage with all lengths multiplied by the factor."""
        return replace(self, series=self.series * factor)


def gear_turns(ratio: float) -> tuple[int, int]:
    """Return the least whole numbers k and m: the first crank turns k times while the second crank turns m times.

    The quotient m/k is the ratio.

    Raises ParameterError if the ratio is neither zero nor a quotient of whole numbers up to six.
    """
    if isfinite(ratio):
        near = Fraction(ratio).limit_denominator(TEETH)
        if abs(near - Fraction(ratio)) <= 1e-9 and abs(near.numerator) <= TEETH:
            return near.denominator, near.numerator
    raise ParameterError("ratio of the second crank", ratio, f"be a ratio of whole numbers up to {TEETH}")


def format_ratio(ratio: float) -> str:
    """Format a gear ratio, as in "2", "-1" or "1/2"."""
    return str(Fraction(ratio).limit_denominator(TEETH))


@dataclass(frozen=True, slots=True, eq=False)
class SecondCrank:
    """Motion of the rocker pivot D of a five-bar: on a second crank, geared to the first or turned independently.

    D = E + l5 exp(i psi) about the end E of the ground link, with psi = m phi + phase + series(phi), where m/k is the ratio.
    The input shaft, with the rotation phi, turns once per period of the linkage, in which the first crank turns k times.

    Attributes
    ----------
    length : float
        l5 (m).
    ratio : float
        Turns of the second crank per turn of the first: a quotient of whole numbers up to six.
    phase : float
        psi at phi = 0, without the series (rad).
    series : FourierSeries
        Rotation that is added to the rotation by the gears, a function of phi (rad); zero if gears alone turn the crank.

    Raises
    ------
    ParameterError
        If the length is not greater than zero, the ratio is not a quotient as above, or the phase is not finite.
    """

    length: float
    ratio: float = 1.0
    phase: float = 0.0
    series: FourierSeries = field(default_factory=lambda: FourierSeries.constant(0.0))

    def __post_init__(self) -> None:
        if not (isfinite(self.length) and self.length > 0.0):
            raise ParameterError("second_crank_length", self.length, "be a finite number greater than zero")
        gear_turns(self.ratio)
        if not isfinite(self.phase):
            raise ParameterError("second_crank_phase", self.phase, "be a finite number")

    def angle(self, rotation: ArrayLike) -> FloatArray:
        """Return psi, the angle of the second crank (rad)."""
        phi = np.asarray(rotation, dtype=float)
        return gear_turns(self.ratio)[1] * phi + self.phase + self.series(phi)

    def displacement(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return x and y of D from the end E of the ground link, in the frame of that link (m)."""
        psi = self.angle(rotation)
        return self.length * np.cos(psi), self.length * np.sin(psi)

    def scale(self, factor: float) -> SecondCrank:
        """Return the motion for the same linkage with all lengths multiplied by the factor."""
        return replace(self, length=self.length * factor)


@in_si(guide_angle="rad", position="m", stroke="m", speed="m", acceleration="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class SliderUnknown:
    """A slider whose motion is unknown: a Fourier series with a given number of harmonics.

    Attributes
    ----------
    harmonics : int
        Number of harmonics; 0 for a slider that is adjusted once and does not move.
    guide_angle : (float, float)
        Bounds of the guide's direction from the ground link (rad); equal bounds fix it.
    position : (float, float), optional
        Least and greatest slider position (m); by default minus and plus the ground link's length.
    stroke : float
        Greatest length of the slider's travel (m).
    speed, acceleration : float
        Greatest ``|du/dphi|`` (m/rad) and ``|d2u/dphi2|`` (m/rad2).
    smoothness : float
        Weight of the mean of (d2u/dphi2)^2, which is added to the quality function: a larger weight gives a smoother motion
        and a larger error.
    """

    harmonics: int
    guide_angle: tuple[Amount, Amount] = (-pi, pi)
    position: tuple[Amount, Amount] | None = None
    stroke: Amount = inf
    speed: Amount = inf
    acceleration: Amount = inf
    smoothness: float = 0.0

    def __post_init__(self) -> None:
        if self.harmonics < 0:
            raise ParameterError("harmonics", self.harmonics, "be zero or greater")
        low, high = self.guide_angle
        if not (isfinite(low) and isfinite(high) and low <= high):
            raise ParameterError("bounds of guide_angle", self.guide_angle, "be two finite angles in order (rad)")
        if self.position is not None:
            low, high = self.position
            if not (isfinite(low) and isfinite(high) and low < high):
                raise ParameterError(
                    "bounds of slider position", self.position, "be two finite lengths, increasing (m)"
                )
        for name in ("stroke", "speed", "acceleration"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"greatest {name}", getattr(self, name), "be greater than zero")
        if not (isfinite(self.smoothness) and self.smoothness >= 0.0):
            raise ParameterError("smoothness", self.smoothness, "be a finite number, zero or greater")


@in_si(length="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class CrankUnknown:
    """A second crank whose length, phase and, with ``harmonics``, independent rotation are unknown.

    Attributes
    ----------
    ratio : float
        Turns of the second crank per turn of the first: see `SecondCrank`.
    length : (float, float)
        Bounds of the second crank's length (m).
    harmonics : int
        Number of harmonics of the rotation that is added to the rotation by the gears; 0 for gears alone.
    speed : float
        Greatest magnitude of the derivative of the added rotation with respect to phi.
    """

    ratio: float
    length: tuple[Amount, Amount]
    harmonics: int = 0
    speed: float = inf

    def __post_init__(self) -> None:
        low, high = self.length
        if not (isfinite(low) and isfinite(high) and 0.0 < low <= high):
            raise ParameterError("bounds of the second crank", self.length, "be two lengths above zero, in order (m)")
        gear_turns(self.ratio)
        if self.harmonics < 0:
            raise ParameterError("harmonics", self.harmonics, "be zero or greater")


PivotUnknown = SliderUnknown | CrankUnknown
