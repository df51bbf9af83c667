"""Compute Floquet multipliers and judge stability.

The monodromy matrix maps a small deviation from a periodic motion to the deviation one period later; its eigenvalues are the
Floquet multipliers. Orbits of a mechanism and linear equations with periodic coefficients are judged by the same rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import exp, isfinite, pi
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError

#: Distance of the largest multiplier from the unit circle below which a verdict is "marginal" by default.
TOLERANCE = 1e-6
#: Angle from the real axis (rad) below which a multiplier counts as real. A double multiplier on the axis is accurate only to
#: the square root of the rounding errors.
REAL_ANGLE = 1e-5


class VerdictError(LinkworkError, TypeError):
    """A verdict was used as if it were a boolean."""


class Stability(Enum):
    """Stability by linear theory: a small deviation decays, grows, or the theory does not decide."""

    STABLE = "stable"
    UNSTABLE = "unstable"
    MARGINAL = "marginal"


class Crossing(Enum):
    """Kind of bifurcation, given by the place at which a multiplier crosses the unit circle."""

    FOLD = "fold"  # at +1: two motions of the same period meet
    BRANCH_POINT = "branch point"  # at +1: two branches of the same period cross
    PERIOD_DOUBLING = "period doubling"  # at -1
    TORUS = "torus"  # a complex pair

    @property
    def sign(self) -> int:
        """Real multiplier at the crossing, +1 or -1; 0 at a torus point."""
        return {Crossing.PERIOD_DOUBLING: -1, Crossing.TORUS: 0}.get(self, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityVerdict:
    """A verdict on the stability of a periodic motion; it has no truth value: compare ``stability``.

    Attributes
    ----------
    stability : Stability
    margin : float
        1 - ``max |multiplier|``: positive if deviations die out, negative if they grow; dimensionless.
    tolerance : float
        Size of the margin below which the verdict is MARGINAL. A system without damping is never better than MARGINAL.
    largest_multiplier : complex
        The multiplier of the greatest modulus.

    Raises
    ------
    VerdictError
        If the verdict is used as a truth value.
    """

    stability: Stability
    margin: float
    tolerance: float
    largest_multiplier: complex

    def __bool__(self) -> NoReturn:
        raise VerdictError(
            f"a verdict ({self}) has no truth value: compare .stability with STABLE, UNSTABLE or MARGINAL, or use .margin"
        )

    def __str__(self) -> str:
        return f"{self.stability.value}, margin {self.margin:.3g} with tolerance {self.tolerance:.1g}"

    @property
    def crossing(self) -> Crossing:
        """Kind of bifurcation at which the largest multiplier leaves the unit circle, or would leave it if its modulus grew."""
        return crossing(self.largest_multiplier)


def multipliers(monodromy: ArrayLike) -> NDArray[np.complex128]:
    """Return the Floquet multipliers, the largest modulus first.

    Parameters
    ----------
    monodromy : array_like, shape (..., n, n)
        One matrix or many.

    Returns
    -------
    ndarray of complex, shape (..., n)

    Raises
    ------
    InputError
        If an entry is not finite.
    """
    matrix = np.asarray(monodromy, dtype=float)
    if not np.isfinite(matrix).all():
        raise InputError("a monodromy matrix is not finite")
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    order = np.argsort(-np.abs(values), axis=-1, kind="stable")
    return np.take_along_axis(values, order, axis=-1)


def verdict(multipliers: ArrayLike, tolerance: float = TOLERANCE) -> StabilityVerdict:
    """Judge the stability of a periodic motion by its multipliers.

    Parameters
    ----------
    multipliers : array_like of complex, shape (n,)
    tolerance : float
        Size of the margin up to which the verdict is "marginal"; it should not be less than the error of the multipliers.

    Raises
    ------
    InputError
        If there are no multipliers, one is not finite, or the tolerance is negative or not finite.
    """
    values = np.atleast_1d(np.asarray(multipliers, dtype=complex))
    if values.ndim != 1 or len(values) == 0 or not np.isfinite(values).all():
        raise InputError(f"multipliers {values}: they must be finite numbers, at least one")
    if not (isfinite(tolerance) and tolerance >= 0.0):
        raise InputError(f"tolerance is {tolerance}: it must be a finite number, zero or greater")
    largest = complex(values[np.argmax(np.abs(values))])
    margin = 1.0 - abs(largest)
    if margin > tolerance:
        stability = Stability.STABLE
    elif margin < -tolerance:
        stability = Stability.UNSTABLE
    else:
        stability = Stability.MARGINAL
    return StabilityVerdict(stability=stability, margin=margin, tolerance=tolerance, largest_multiplier=largest)


def crossing(multiplier: complex) -> Crossing:
    """Return the kind of bifurcation at which a multiplier crosses the unit circle."""
    if abs(np.angle(multiplier)) <= REAL_ANGLE:
        return Crossing.FOLD
    if abs(np.angle(-multiplier)) <= REAL_ANGLE:
        return Crossing.PERIOD_DOUBLING
    return Crossing.TORUS


def liouville(trace: ArrayLike, period: float = 2.0 * pi) -> float:
    """Return the determinant of the monodromy matrix by Liouville's formula: exp of the integral of the trace over the period.

    Parameters
    ----------
    trace : array_like, shape (n,)
        Trace of the Jacobian matrix at equal steps over one period, the end left out. It is integrated by the trapezoidal
        rule, whose error comes only from harmonics of order n and more.
    period : float
        Period in the unit of the independent variable, rad or s.

    Raises
    ------
    InputError
        If a value is not finite, or there is none.
    """
    values = np.asarray(trace, dtype=float)
    if values.ndim != 1 or len(values) == 0 or not np.isfinite(values).all():
        raise InputError("the traces over a period must be finite numbers, at least one")
    return exp(period * float(values.mean()))


def crossing_test(monodromy: NDArray[np.float64], crossing: Crossing | int) -> NDArray[np.float64]:
    """Return a smooth function of monodromy matrices that is zero where a multiplier crosses the unit circle.

    Parameters
    ----------
    monodromy : ndarray, shape (..., n, n)
    crossing : Crossing or int
        The crossing; the number +1 stands for a fold or branch point, -1 for a period doubling. For these the function is
        det(I - Phi) or det(I + Phi), with the monodromy matrix Phi: positive if all multipliers are inside the unit circle,
        negative if one real multiplier has crossed it at +1 or -1. For a torus the function is the product of
        (mu_i mu_j - 1) over all pairs of multipliers mu_i, mu_j.

    Returns
    -------
    ndarray, shape (...,)
    """
    if crossing is Crossing.TORUS:
        mu = multipliers(monodromy)
        pairs = [mu[..., i] * mu[..., j] - 1.0 for i in range(mu.shape[-1]) for j in range(i)]
        return np.asarray(np.prod(pairs, axis=0).real)
    multiplier = crossing.sign if isinstance(crossing, Crossing) else crossing
    require_sign(multiplier)
    if monodromy.shape[-1] != 2:
        return np.asarray(np.linalg.det(np.eye(monodromy.shape[-1]) - multiplier * monodromy))
    trace = monodromy[..., 0, 0] + monodromy[..., 1, 1]
    det = monodromy[..., 0, 0] * monodromy[..., 1, 1] - monodromy[..., 0, 1] * monodromy[..., 1, 0]
    return np.asarray(1.0 - multiplier * trace + det)


def torus_pair(multipliers: NDArray[np.complex128]) -> tuple[complex, float]:
    """Return one multiplier of the pair mu_i, mu_j whose product is nearest to 1, and the distance ``|mu_i mu_j - 1|``."""
    away = {(i, j): abs(multipliers[i] * multipliers[j] - 1.0) for i in range(len(multipliers)) for j in range(i)}
    nearest = min(away, key=away.__getitem__)
    return complex(multipliers[nearest[0]]), float(away[nearest])


def require_sign(multiplier: int) -> None:
    """Raise `InputError` if a multiplier is neither +1 nor -1."""
    if multiplier not in (1, -1):
        raise InputError(f"multiplier is {multiplier}: it must be +1 or -1")
