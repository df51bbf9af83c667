"""The classical approximations of the slider's amplitude over the speed, from the linear equation about u = 0."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError
from linkwork.five_bar.parameters import FiveBarParameters, without_friction

from ..periodic import Response
from .equation import Load, Variant
from .harmonics import amplitudes_over
from .stability import load_of


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Approximations:
    """Amplitudes by the classical approximations over the speed, from the linear equation about u = 0.

    Attributes
    ----------
    parameters : FiveBarParameters
        Without Coulomb friction, which a linear equation cannot hold.
    load : Load
        Constant forces.
    speed : ndarray, shape (m,)
        rad/s.
    amplitudes : mapping
        Half the range of u (m) by the name of the approximation, each of shape (m,).
    """

    parameters: FiveBarParameters
    load: Load
    speed: NDArray[np.float64]
    amplitudes: Mapping[str, NDArray[np.float64]]

    def at(self, speed: ArrayLike) -> dict[str, NDArray[np.float64]]:
        """The approximations at speeds (rad/s), of their shape, not interpolated."""
        return _approximate(self.parameters, speed, self.load)

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """As a table, by name with unit."""
        return {"drive.speed [rad/s]": self.speed} | {f"{name} [m]": v for name, v in self.amplitudes.items()}


def approximations(response: Response, points: int = 160) -> Approximations:
    """The classical approximations over the range of a response: two harmonics and ten of equation (4.21) put right.

    Raises
    ------
    InputError
        If it is not the speed that varies.
    """
    if response.family.vary != "drive.speed":
        raise InputError(f"{response.family.name} varies: the approximations are over the speed")
    parameters = without_friction(response.family.parameters)
    load = load_of(response.family.drive)
    speeds = np.linspace(response.low, response.high, points)
    return Approximations(
        parameters=parameters,
        load=load,
        speed=speeds,
        amplitudes=_approximate(parameters, speeds, load),
    )


#: Approximations by name: variant of the linear equation and harmonics balanced.
_APPROXIMATIONS = {
    "two harmonics": (Variant.SECOND_ORDER, 2),
    "ten harmonics": (Variant.EXACT, 10),
}


def _approximate(parameters: FiveBarParameters, speed: ArrayLike, load: Load) -> dict[str, NDArray[np.float64]]:
    return {
        name: amplitudes_over(parameters, speed, order, variant=variant, load=load)
        for name, (variant, order) in _APPROXIMATIONS.items()
    }
