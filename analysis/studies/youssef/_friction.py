"""How the speeds at which rig 1 has its maxima and its minimum depend on Coulomb friction and damping; and the best fit.

The thesis gives no measured amplitude of rig 1, only these speeds; a level of friction that explains its measurements
must bring them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares, minimize_scalar

from linkwork.five_bar.parameters import FiveBarParameters

from ...periodic import Branch, Family, Response, follow
from ._orbits import orbit, response
from ._runs import rig_1


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """A maximum (sign +1) or minimum (-1) of the amplitude.

    ``stated`` is where the thesis has it (rpm), ``low`` and ``high`` are the speeds between which it lies, ``levels`` the
    friction (N) up to which it is followed.
    """

    name: str
    spring: str
    stated: float
    sign: int
    low: float
    high: float
    levels: tuple[float, ...]

    def speed(self, friction: float, damping: float | None = None) -> float:
        """Where it is (rpm), by Brent's method on the orbits, with friction (N) and damping (N.s/m, the rig's if not given)."""
        parameters = rig(self.spring, friction, damping)
        start: NDArray[np.float64] | None = None

        def less(speed: float) -> float:
            nonlocal start
            found = orbit(parameters, speed, start)
            start = found.start
            return -self.sign * found.amplitude

        best = minimize_scalar(less, bounds=(self.low, self.high), method="bounded", options={"xatol": 0.05})
        return float(best.x)

    def over_friction(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Levels of friction (N), and where it is with each (rpm)."""
        return np.array(self.levels), np.array([self.speed(level) for level in self.levels])

    def level(self, levels: NDArray[np.float64], speeds: NDArray[np.float64]) -> float | None:
        """Friction that alone brings it to where the thesis has it (N), on a line between levels; None if no level does."""
        above = speeds > self.stated
        crossed = np.flatnonzero(above[1:] != above[:-1])
        if not len(crossed):
            return None
        i = int(crossed[0])
        part = (self.stated - speeds[i]) / (speeds[i + 1] - speeds[i])
        return float(levels[i] + part * (levels[i + 1] - levels[i]))


#: What is fitted. Friction above 1.9 N takes the maximum and the minimum of spring A away, above 8 N the maximum of spring B.
FITTED = (
    Feature(
        name="local maximum; spring A",
        spring="a",
        stated=290.0,
        sign=1,
        low=280.0,
        high=340.0,
        levels=(0.0, 0.5, 1.0, 1.4, 1.7, 1.9),
    ),
    Feature(
        name="minimum; spring A",
        spring="a",
        stated=345.0,
        sign=-1,
        low=305.0,
        high=400.0,
        levels=(0.0, 0.5, 1.0, 1.4, 1.5, 1.6),
    ),
    Feature(
        name="resonance; spring A",
        spring="a",
        stated=580.0,
        sign=1,
        low=550.0,
        high=640.0,
        levels=(0.0, 1.0, 2.0, 2.5, 4.0, 6.0),
    ),
    Feature(
        name="local maximum; spring B",
        spring="b",
        stated=580.0,
        sign=1,
        low=540.0,
        high=640.0,
        levels=(0.0, 2.0, 4.0, 6.0, 7.0, 7.5),
    ),
)
#: Followed from where the jump is gone; below, the greatest amplitude with rising speed is at the jump.
RESONANCE_B = Feature(
    name="resonance; spring B",
    spring="b",
    stated=1160.0,
    sign=1,
    low=1045.0,
    high=1220.0,
    levels=(5.0, 10.0, 20.0, 30.0, 34.0, 36.0),
)
#: Speed at which the upper motion of spring B is followed over the friction (rpm), and the friction followed to (N).
UPPER_SPEED, MOST_FOLLOWED = 1000.0, 60.0
#: Bounds of the fit: friction (N) up to which all that is fitted exists, and damping (N.s/m); the rig has 9.
MOST_FRICTION, LEAST_DAMPING, MOST_DAMPING = 1.5, 7.0, 18.0


def rig(spring: str, friction: float, damping: float | None = None) -> FiveBarParameters:
    """Rig 1 with friction (N) and another damping (N.s/m)."""
    parameters = rig_1(spring, friction)
    return parameters if damping is None else replace(parameters, slider_damping=damping)


def speeds(friction: float, damping: float | None = None) -> NDArray[np.float64]:
    """Speeds of all that is fitted (rpm)."""
    return np.array([feature.speed(friction, damping) for feature in FITTED])


def misfit(found: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Departures of these speeds from the thesis's, relative to them."""
    stated = np.array([feature.stated for feature in FITTED])
    relative: NDArray[np.float64] = (np.asarray(found, dtype=float) - stated) / stated
    return relative


def size(residuals: NDArray[np.float64]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(residuals**2)))


@cache
def fit(damping_too: bool) -> OptimizeResult:
    """Friction (N), and damping (N.s/m) if that is free as well, of least squares of the misfit."""
    # steps of a tenth are well above the tolerance of the speeds
    settings = {"diff_step": 0.1, "xtol": 1e-3, "ftol": 1e-2}
    if not damping_too:
        return least_squares(lambda x: misfit(speeds(x[0])), [1.0], bounds=([0.0], [MOST_FRICTION]), **settings)
    bounds = ([0.0, LEAST_DAMPING], [MOST_FRICTION, MOST_DAMPING])
    start = [0.5, rig_1("a").slider_damping]
    return least_squares(lambda x: misfit(speeds(*x)), start, bounds=bounds, x_scale=[1.0, 10.0], **settings)


def about_resonance(friction: float) -> Response:
    """Periodic motions of spring B about resonance with friction (N); its first branch comes from below."""
    return response(rig_1("b", friction), UPPER_SPEED, 1150.0, 5e-2)


@cache
def upper_motion() -> Branch:
    """Spring B's motion of large amplitude at 1000 rpm as friction grows, to its fold and back on the unstable one."""
    large = about_resonance(0.0).branches[1].orbits[-1]
    family = Family(parameters=large.parameters, drive=large.drive, vary="slider.coulomb_friction")
    return follow(family, large, 0.0, low=0.0, high=MOST_FOLLOWED, greatest=5e-2)
