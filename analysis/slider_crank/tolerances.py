"""What manufacturing tolerances do to the slider-crank, estimated without samples.

The linear estimate adds the variances of independent errors, each times the square of its derivative (`derivatives`). It
fails where the derivatives vanish: at the ideal mechanism (S1 = a4 = 0, alpha4 = 270 deg) the slider's position is of the
second order in S1 and alpha4 at every angle, and in a4 at 90 and 270 deg. So the estimate to second order stands beside it,
and a Monte Carlo (`sampling`) says where the linear one is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import cast

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..numerics.dual import dual
from ..units import Amount, si
from .derivatives import ERRORS, FREE_OF_LOAD, check_names, error_variables, sensitivities, vary
from .forces import SLIDER_FORCE, ForceTurn
from .quantities import FloatArray, MaskedArray, masked_array

#: Standard deviations in the half width of a normal tolerance.
NORMAL_EXTENT = 3.0
#: By distribution: half width over standard deviation, and the fourth moment over the square of the variance.
_DISTRIBUTIONS = {"normal": (NORMAL_EXTENT, 3.0), "uniform": (sqrt(3.0), 1.8), "triangular": (sqrt(6.0), 2.4)}


@dataclass(frozen=True, slots=True)
class Tolerance:
    """A random error of one dimension, independent of the others and with the mean zero.

    Parameters
    ----------
    name : str
        One of `ERRORS`: a parameter of the mechanism by its FMI name, "shift.position" or "crank.angle".
    half_width : float or str, optional
        Half the width of the tolerance, in the SI unit of what is in error or with its unit, such as "0.1 mm". A normal
        distribution has three standard deviations in it and is not cut off there.
    standard_deviation : float, optional
        In place of the half width.
    distribution : str
        "normal", "uniform" or "triangular".

    Raises
    ------
    ParameterError
        If there is nothing of that name to be in error.
    InputError
        If not one of half width and standard deviation is given, if it is not a finite number above zero, or if the
        distribution is none of the three.
    """

    name: str
    half_width: Amount = None
    standard_deviation: Amount = None
    distribution: str = "normal"

    def __post_init__(self) -> None:
        check_names((self.name,), ERRORS, "error")
        for field in ("half_width", "standard_deviation"):
            what = f"{field.replace('_', ' ')} of {self.name}"
            object.__setattr__(self, field, si(getattr(self, field), ERRORS[self.name], what))
        if self.distribution not in _DISTRIBUTIONS:
            raise InputError(
                f"the distribution of {self.name} is {self.distribution!r}: it must be one of {', '.join(_DISTRIBUTIONS)}"
            )
        if (self.half_width is None) == (self.standard_deviation is None):
            raise InputError(f"the tolerance of {self.name} must have either a half width or a standard deviation")
        value = self.half_width if self.half_width is not None else self.standard_deviation
        if value is None or not (isfinite(value) and value > 0.0):
            raise InputError(f"the tolerance of {self.name} is {value!r}: it must be a finite number greater than zero")

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        if self.standard_deviation is not None:
            return float(self.standard_deviation)
        return float(self.half_width) / _DISTRIBUTIONS[self.distribution][0]

    @property
    def extent(self) -> float:
        """Half width, of a normal distribution three standard deviations."""
        if self.half_width is not None:
            return float(self.half_width)
        return self.deviation * _DISTRIBUTIONS[self.distribution][0]

    def draw(self, generator: np.random.Generator, samples: int) -> FloatArray:
        """Random errors (samples,)."""
        if self.distribution == "normal":
            return generator.normal(0.0, self.deviation, samples)
        if self.distribution == "uniform":
            return generator.uniform(-self.extent, self.extent, samples)
        return generator.triangular(-self.extent, 0.0, self.extent, samples)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """What the tolerances do to one quantity over the turn, without samples; masked arrays.

    Attributes
    ----------
    nominal : masked array, shape (n,)
    deviation : masked array, shape (n,)
        Standard deviation to first order: the root of the sum of squares of derivative times standard deviation.
    worst : masked array, shape (n,)
        Greatest departure to first order: every error at its extent, with the sign that makes it worse.
    shares : masked array, shape (m, n)
        Of each tolerance in the variance to first order; masked where that is zero but for rounding.
    second_mean, second_deviation : masked array, shape (n,)
        Mean and standard deviation to second order, from exact derivatives and their differences over one standard
        deviation; masked where the mechanism cannot be assembled there.
    second_shares : masked array, shape (m, n)
        As ``shares``, to second order; what two errors do together counts half for each.

    Where the slider's force is sought and the errors, all at their extents, reach a dead centre, everything but ``nominal``
    is masked: the quantity has a pole there, and neither mean nor variance.
    """

    nominal: MaskedArray
    deviation: MaskedArray
    worst: MaskedArray
    shares: MaskedArray
    second_mean: MaskedArray
    second_deviation: MaskedArray
    second_shares: MaskedArray


def estimate(
    turn: ForceTurn, tolerances: Sequence[Tolerance], quantities: Sequence[str] = ("slider.position",)
) -> dict[str, Estimate]:
    """The effect of tolerances to first and second order over the turn, by quantity.

    Raises
    ------
    InputError
        If there is no tolerance, or two of the same name.
    ParameterError
        If there is no such quantity.

    Examples
    --------
    >>> from analysis import Tolerance, force_turn, tolerance_effects
    >>> turn = force_turn("rahman-a4-10-s1-3.5", angles=["30 deg", "90 deg"])
    >>> effect = tolerance_effects(turn, [Tolerance("rod.length", half_width="0.5 mm")])["slider.position"]
    >>> [f"{1e3 * value:.3f} mm" for value in effect.worst]
    ['0.549 mm', '0.512 mm']
    """
    names = check_tolerances(tolerances)
    first = sensitivities(turn, names, quantities)
    deviations = np.array([t.deviation for t in tolerances])
    extents = np.array([t.extent for t in tolerances])
    kurtoses = np.array([_DISTRIBUTIONS[t.distribution][1] for t in tolerances])
    n, m = len(turn), len(names)
    near_pole = _near_pole(turn, names, extents)
    curvatures, reached = _curvatures(turn, tolerances, quantities)
    result = {}
    for name in quantities:
        nominal = first.values[name]
        pole = np.zeros(n, dtype=bool) if name in FREE_OF_LOAD else near_pole
        steps = np.ma.masked_where(np.broadcast_to(pole, (m, n)), first.derivatives[name]) * deviations[:, None]
        variance = (steps**2).sum(axis=0)
        h = 0.5 * (curvatures[name] + curvatures[name].swapaxes(0, 1))
        own = np.einsum("iin->in", h)
        # the variance of the square of each error, and of the products of two
        pairs = (h**2).sum(axis=1) - own**2
        second = steps.filled(np.nan) ** 2 + 0.25 * (kurtoses - 1.0)[:, None] * own**2 + 0.5 * pairs
        whole = second.sum(axis=0)
        lost = np.ma.getmaskarray(nominal) | ~reached | pole
        # derivatives that are rounding errors share nothing out
        rounding = (1e-15 * nominal.filled(0.0)) ** 2
        vanishing = variance.filled(0.0) <= np.fmax(1e-12 * whole, rounding)
        still = lost | ~(whole > rounding)
        result[name] = Estimate(
            nominal=nominal,
            deviation=np.ma.sqrt(variance),
            worst=np.ma.abs(steps * (extents / deviations)[:, None]).sum(axis=0),
            shares=_share(steps**2, variance, vanishing),
            second_mean=masked_array(nominal.filled(np.nan) + 0.5 * own.sum(axis=0), lost),
            second_deviation=masked_array(np.sqrt(whole), lost),
            second_shares=_share(np.ma.MaskedArray(second), np.ma.MaskedArray(whole), still),
        )
    return result


#: The name of `estimate` at the top of the package.
tolerance_effects = estimate


def check_tolerances(tolerances: Sequence[Tolerance]) -> tuple[str, ...]:
    """Names of the tolerances; raises InputError if there is none, or two of the same name."""
    names = tuple(t.name for t in tolerances)
    if not names:
        raise InputError("there is no tolerance: give at least one")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"there are {names.count(name)} tolerances of {name}: give one")
    return names


def _curvatures(
    turn: ForceTurn, tolerances: Sequence[Tolerance], quantities: Sequence[str]
) -> tuple[dict[str, FloatArray], NDArray[np.bool_]]:
    """Second derivatives (m, m, n) times both standard deviations, and where the mechanism is assembled for all of them.

    They are half the differences of the first derivatives over one standard deviation to either side.
    """
    n, m = len(turn), len(tolerances)
    names, deviations = [t.name for t in tolerances], np.array([t.deviation for t in tolerances])
    curvatures = {name: np.zeros((m, m, n)) for name in quantities}
    reached = np.ones(n, dtype=bool)
    for i, deviation in enumerate(deviations.tolist()):
        for sign in (1.0, -1.0):
            moved = vary(turn, np.arange(n), error_variables(names, n, i, sign * deviation))
            found, _ = moved.evaluate(quantities)
            reached &= np.asarray(dual(moved.square).real > 0.0)
            for name in quantities:
                curvatures[name][i] += (
                    0.5 * sign * np.broadcast_to(dual(found[name]).dual, (m, n)) * deviations[:, None]
                )
    return curvatures, reached


def _near_pole(turn: ForceTurn, names: tuple[str, ...], extents: FloatArray) -> NDArray[np.bool_]:
    """Where errors at their extents make nothing of the lever of the slider's force, if that is sought (n,)."""
    n = len(turn)
    if turn.sought != SLIDER_FORCE:
        return np.zeros(n, dtype=bool)
    lever = dual(vary(turn, np.arange(n), error_variables(names, n)).evaluate(("slider.load",))[1])
    change = (np.abs(np.broadcast_to(lever.dual, (len(names), n))) * extents[:, None]).sum(axis=0)
    return np.asarray(np.abs(np.broadcast_to(lever.real, (n,))) <= change)


def _share(parts: MaskedArray, whole: MaskedArray, none: NDArray[np.bool_]) -> MaskedArray:
    """Parts (m, n) of a whole (n,), masked where there is none."""
    shares = np.ma.masked_where(np.broadcast_to(none, parts.shape), parts) / np.ma.masked_where(none, whole)
    shares.fill_value = np.nan
    return cast(MaskedArray, shares)
