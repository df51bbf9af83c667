"""What manufacturing tolerances do to the slider-crank: exact sensitivities, linear estimates, Monte Carlo.

The nominal mechanism and its motion are a `ForceTurn`; an error adds to one of its dimensions, masses or settings while all the
others, and the motion of the crank, stay. Sensitivities are exact derivatives: the plant's own equations on dual numbers
(`analysis.numerics.dual`). The same equations on arrays of random samples are the Monte Carlo.

The linear estimate adds the variances of independent errors, each times the square of its derivative. It fails where the
derivatives vanish: at the ideal mechanism (S1 = a4 = 0, alpha4 = 270 deg) the slider's position is of the second order in S1
and alpha4 at every angle, and in a4 at 90 and 270 deg. So the estimate to second order stands beside it, and a Monte Carlo says
where the linear one is off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import degrees, isfinite, sqrt
from types import FunctionType, MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError
from linkwork.limits import LIMIT_SINE
from linkwork.parameters import POSITIVE, field_name
from linkwork.slider_crank import parameters as parameters_module
from linkwork.slider_crank import variables
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters

from ..figures.slider_crank import ToleranceScene
from ..numerics.dual import Dual, dual
from ..numerics.dual import variables as independent
from .dual_dynamics import DEAD_CENTRE
from .forces import (
    NO_LEVER,
    SLIDER_FORCE,
    ForceTurn,
    MaskedArray,
    solve,
    unit_table,
)
from .shifts import ShiftMotion, in_the_shaft, on_arrays, with_groove

FloatArray: TypeAlias = NDArray[np.float64]

#: What is in error besides the mechanism's parameters: the crank angle and the axial shift, by the names of their outputs.
ANGLE, SHIFT = "crank.angle", "shift.position"
#: The errors whose sensitivities are given where none are named: theta1, S1, a1, a2, a4, alpha4.
DIMENSIONS = (ANGLE, SHIFT, "crank.length", "rod.length", "guide.offset", "guide.twist")
_VARIABLES = {
    v.name: v
    for v in variables.VARIABLES
    if v.name in (ANGLE, SHIFT)
    or (
        v.kind == "Real"
        and field_name(v.name) in SliderCrankParameters.__dataclass_fields__
        and not v.name.startswith("groove.")
    )
}
#: Everything that may be in error, with its unit.
ERRORS: Mapping[str, str] = MappingProxyType({name: v.unit for name, v in _VARIABLES.items()})

_KINEMATIC = ("slider.position", "slider.velocity", "slider.acceleration")
_VECTORS = {
    f"{joint}.{'m' if moment else 'f'}{axis}": (f"{joint}_moment" if moment else joint, axis)
    for joint, moment in (
        ("bearing", False),
        ("bearing", True),
        ("crank_pin", False),
        ("slider_pin", False),
        ("guide", False),
        ("guide", True),
    )
    for axis in "xyz"
}
#: Everything that sensitivities are given of, by the names of the FMI interface, with its unit. Vectors are in the ground
#: frame, the moment of the bearing about O; bearing.fz is the axial force. In the thesis's problem, where the torque is given,
#: drive.applied_torque has no sensitivity and slider.load is the force that is sought.
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        v.name: v.unit
        for v in variables.VARIABLES
        if v.name in (*_KINEMATIC, *_VECTORS, "drive.applied_torque", "slider.load")
    }
)
#: What does not depend on the load where that is sought, and so is determined at a dead centre too.
_FREE_OF_LOAD = (*_KINEMATIC, "drive.applied_torque", "guide.mx", "guide.my", "guide.mz")

#: Standard deviations in the half width of a normal tolerance.
NORMAL_EXTENT = 3.0
#: By distribution: half width over standard deviation, and the fourth moment over the square of the variance.
_DISTRIBUTIONS = {"normal": (NORMAL_EXTENT, 3.0), "uniform": (sqrt(3.0), 1.8), "triangular": (sqrt(6.0), 2.4)}
#: Percentiles that a Monte Carlo gives: the normal distribution's at -3, -2, 0, 2, 3 standard deviations.
PERCENTILES = (0.13498980316300957, 2.275013194817921, 50.0, 97.72498680518208, 99.86501019683699)
#: Share of the standard deviation by which the linear estimate may be off before it is told.
OFF = 0.05
#: Samples that are worked on at once, few enough for the processor's cache.
_CHUNK = 16384
#: Bins of the histograms.
_BINS = 80

#: The constants of the equations for arrays or dual numbers in the place of the parameters.
_CONSTANTS = cast(
    Callable[[Any], Constants],
    FunctionType(
        SliderCrankParameters.constants.__code__, vars(parameters_module) | {"cos": np.cos, "sin": np.sin}, "constants"
    ),
)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """A random error of one dimension, independent of the others and with the mean zero.

    Parameters
    ----------
    name : str
        One of `ERRORS`: a parameter of the mechanism by its FMI name, "shift.position" or "crank.angle".
    half_width : float, optional
        Half the width of the tolerance, in the unit of what is in error. A normal distribution has three standard deviations
        in it and is not cut off there.
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
    half_width: float | None = None
    standard_deviation: float | None = None
    distribution: str = "normal"

    def __post_init__(self) -> None:
        _check_names((self.name,), ERRORS, "error")
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
            return self.standard_deviation
        return cast(float, self.half_width) / _DISTRIBUTIONS[self.distribution][0]

    @property
    def extent(self) -> float:
        """Half width, of a normal distribution three standard deviations."""
        return self.half_width if self.half_width is not None else self.deviation * _DISTRIBUTIONS[self.distribution][0]

    def draw(self, generator: np.random.Generator, samples: int) -> FloatArray:
        """Random errors (samples,)."""
        if self.distribution == "normal":
            return generator.normal(0.0, self.deviation, samples)
        if self.distribution == "uniform":
            return generator.uniform(-self.extent, self.extent, samples)
        return generator.triangular(-self.extent, 0.0, self.extent, samples)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivities:
    """Exact first derivatives over the turn.

    Attributes
    ----------
    turn : ForceTurn
        The nominal mechanism and its motion.
    names : tuple of str
        The m errors by which is derived.
    values : mapping
        Quantity to its nominal values, masked array (n,).
    derivatives : mapping
        Quantity to masked array (m, n): the quantity's unit over the error's. What the load takes part in is masked at the
        dead centres where that is sought.
    """

    turn: ForceTurn
    names: tuple[str, ...]
    values: Mapping[str, MaskedArray]
    derivatives: Mapping[str, MaskedArray]

    def of(self, quantity: str, error: str) -> MaskedArray:
        """Derivative (n,) of a quantity by an error.

        Raises
        ------
        ParameterError
            If it is not among them.
        """
        _check_names((quantity,), self.derivatives, "quantity")
        _check_names((error,), self.names, "error")
        return cast(MaskedArray, self.derivatives[quantity][self.names.index(error)])


def sensitivities(
    turn: ForceTurn, errors: Sequence[str] = DIMENSIONS, quantities: Sequence[str] = tuple(QUANTITIES)
) -> Sensitivities:
    """Derivatives of motion, torque and joint forces by dimensions, masses and settings, over the turn.

    Parameters
    ----------
    turn : ForceTurn
        The nominal mechanism. The motion of the crank and the rates of the shift are held, and what is given of load and
        torque. An error of the crank angle leaves the shift as it is, unless a groove in the shaft makes it; one of a length
        leaves masses, centres of mass and moments of inertia as they are.
    errors : sequence of str
        Of `ERRORS`; by default `DIMENSIONS`.
    quantities : sequence of str
        Of `QUANTITIES`; by default all.

    Raises
    ------
    ParameterError
        If there is nothing of such a name.
    """
    _check_names(errors, ERRORS, "error")
    _check_names(quantities, QUANTITIES, "quantity")
    n, m = len(turn), len(errors)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        found, _ = _evaluate(turn, np.arange(n), _varied(turn, np.arange(n), _steps(errors, n)), quantities)
    values, derivatives = {}, {}
    for name in quantities:
        x = dual(found[name])
        dead = _undetermined(turn, name)
        real = np.broadcast_to(x.real, (n,))
        slopes = np.broadcast_to(x.dual, (m, n)).astype(float)
        values[name] = np.ma.MaskedArray(np.where(dead, np.nan, real), mask=dead, fill_value=np.nan)
        derivatives[name] = np.ma.MaskedArray(
            np.where(dead, np.nan, slopes), mask=np.broadcast_to(dead, (m, n)).copy(), fill_value=np.nan
        )
    return Sensitivities(
        turn=turn,
        names=tuple(errors),
        values=MappingProxyType(values),
        derivatives=MappingProxyType(derivatives),
    )


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
    """
    names = _check_tolerances(tolerances)
    first = sensitivities(turn, names, quantities)
    deviations = np.array([t.deviation for t in tolerances])
    extents = np.array([t.extent for t in tolerances])
    kurtoses = np.array([_DISTRIBUTIONS[t.distribution][1] for t in tolerances])
    n, m = len(turn), len(names)
    near_pole = _near_pole(turn, names, extents)
    # half the differences of the derivatives over one standard deviation to either side, times both deviations
    curvature = {name: np.zeros((m, m, n)) for name in quantities}
    reached = np.ones(n, dtype=bool)
    for i, tolerance in enumerate(tolerances):
        for sign in (1.0, -1.0):
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                moved = _varied(turn, np.arange(n), _steps(names, n, i, sign * tolerance.deviation))
                found, _ = _evaluate(turn, np.arange(n), moved, quantities)
            reached &= np.asarray(dual(_square(moved)).real > 0.0)
            for name in quantities:
                curvature[name][i] += 0.5 * sign * np.broadcast_to(dual(found[name]).dual, (m, n)) * deviations[:, None]
    result = {}
    for name in quantities:
        nominal = first.values[name]
        pole = np.zeros(n, dtype=bool) if name in _FREE_OF_LOAD else near_pole
        steps = np.ma.masked_where(np.broadcast_to(pole, (m, n)), first.derivatives[name]) * deviations[:, None]
        variance = (steps**2).sum(axis=0)
        h = 0.5 * (curvature[name] + curvature[name].swapaxes(0, 1))
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
            second_mean=np.ma.MaskedArray(nominal.filled(np.nan) + 0.5 * own.sum(axis=0), mask=lost, fill_value=np.nan),
            second_deviation=np.ma.MaskedArray(np.sqrt(whole), mask=lost, fill_value=np.nan),
            second_shares=_share(np.ma.MaskedArray(second), np.ma.MaskedArray(whole), still),
        )
    return result


def _near_pole(turn: ForceTurn, names: tuple[str, ...], extents: FloatArray) -> NDArray[np.bool_]:
    """Where errors at their extents make nothing of the lever of the slider's force, if that is sought (n,)."""
    n = len(turn)
    if turn.sought != SLIDER_FORCE:
        return np.zeros(n, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        varied = _varied(turn, np.arange(n), _steps(names, n))
        lever = dual(_evaluate(turn, np.arange(n), varied, ("slider.load",))[1])
    change = (np.abs(np.broadcast_to(lever.dual, (len(names), n))) * extents[:, None]).sum(axis=0)
    return np.asarray(np.abs(np.broadcast_to(lever.real, (n,))) <= change)


def _share(parts: MaskedArray, whole: MaskedArray, none: NDArray[np.bool_]) -> MaskedArray:
    """Parts (m, n) of a whole (n,), masked where there is none."""
    shares = np.ma.masked_where(np.broadcast_to(none, parts.shape), parts) / np.ma.masked_where(none, whole)
    shares.fill_value = np.nan
    return cast(MaskedArray, shares)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """The samples of one quantity, angle by angle; n angles.

    Attributes
    ----------
    mean, deviation : masked array, shape (n,)
        Mean and standard deviation; masked where samples fall on both sides of a dead centre and the quantity has its pole
        between them: there they do not exist, whatever a sum says.
    percentiles : masked array, shape (p, n)
        At `PERCENTILES`; masked only where there is no sample.
    least, greatest : masked array, shape (n,)
    edges : ndarray, shape (n, b + 1)
    counts : ndarray, shape (n, b)
        Histograms of the middle 99.9 % of the samples.
    """

    mean: MaskedArray
    deviation: MaskedArray
    percentiles: MaskedArray
    least: MaskedArray
    greatest: MaskedArray
    edges: FloatArray
    counts: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MonteCarlo:
    """Random samples of a mechanism with tolerances, beside the estimates without samples.

    Attributes
    ----------
    turn : ForceTurn
        The nominal mechanism, at the n angles.
    tolerances : tuple of Tolerance
    samples, seed : int
    spreads : mapping
        Quantity to `Spread`.
    estimates : mapping
        Quantity to `Estimate`.
    not_assembled : ndarray of int, shape (n,)
        Samples whose rod does not reach the guide; they are in no mean or percentile.
    undetermined : ndarray of int, shape (n,)
        Samples at a dead centre itself where the slider's force is sought; likewise.
    """

    turn: ForceTurn
    tolerances: tuple[Tolerance, ...]
    samples: int
    seed: int
    spreads: Mapping[str, Spread]
    estimates: Mapping[str, Estimate]
    not_assembled: NDArray[np.int64]
    undetermined: NDArray[np.int64]

    @cached_property
    def messages(self) -> tuple[str, ...]:
        """`notes` in SI."""
        return self.notes()

    def notes(self, units: str = "SI") -> tuple[str, ...]:
        """In sentences: samples that cannot be assembled, poles, and where the linear estimate is off and why.

        Parameters
        ----------
        units : str
            One of `analysis.slider_crank.forces.UNITS`.

        Raises
        ------
        InputError
            If there are no such units.
        """
        known = unit_table(units)
        told = []
        if self.turn.unreachable.size:
            told.append(
                f"{self.turn.unreachable.size} crank angles are left out: the nominal mechanism cannot be assembled there"
            )
        if self.not_assembled.any():
            i = int(np.argmax(self.not_assembled))
            told.append(
                f"{self.not_assembled[i]} of {self.samples} samples ({100.0 * self.not_assembled[i] / self.samples:.3g} %) "
                f"cannot be assembled at {_at(self.turn, i)}, the most of any angle"
            )
        if self.undetermined.any():
            told.append(f"{int(self.undetermined.sum())} samples are at a dead centre: they have no slider force")
        for name, spread in self.spreads.items():
            poles = np.ma.getmaskarray(spread.mean) & ~np.ma.getmaskarray(spread.percentiles)[0]
            near = self._without_estimate(name) & ~poles
            if poles.any():
                places = np.flatnonzero(poles)
                told.append(
                    f"{name} has samples on both sides of a dead centre at {_at(self.turn, int(places[0]))}"
                    f"{_others(places)}: it has no mean and no variance there, only percentiles"
                )
            if near.any():
                places = np.flatnonzero(near)
                told.append(
                    f"the tolerances reach a dead centre from {_at(self.turn, int(places[0]))}{_others(places)}: there is "
                    f"no linear estimate of {name} there"
                )
            told += self._off(name, known)
        return tuple(told)

    def _without_estimate(self, quantity: str) -> NDArray[np.bool_]:
        """Where a quantity is determined and there is no estimate, for the nearness of a dead centre (n,)."""
        linear = self.estimates[quantity]
        return np.asarray(np.ma.getmaskarray(linear.deviation) & ~np.ma.getmaskarray(linear.nominal))

    def linear_is_off(self, quantity: str) -> NDArray[np.bool_]:
        """Where the linear estimate misses mean or standard deviation by more than 5 % of the latter (n,).

        What five standard errors of the samples may account for is allowed on top. Near a dead centre, where there is no
        estimate or there are no mean and deviation to estimate, it is off.
        """
        spread, linear = self._spread(quantity), self.estimates[quantity]
        used = np.maximum(self.samples - self.not_assembled - self.undetermined, 2)
        sd = spread.deviation
        # the standard error of the mean, and of a standard deviation up to a kurtosis of five, is this share of the latter
        allowed = OFF * sd + 5.0 * sd / np.sqrt(used)
        rounding = 1e-9 * np.ma.abs(linear.nominal)
        off = (np.ma.abs(spread.mean - linear.nominal) > allowed + rounding) | (
            np.ma.abs(sd - linear.deviation) > allowed + rounding
        )
        return cast(NDArray[np.bool_], np.ma.filled(off, False)) | self._without_estimate(quantity)

    def scene(self, quantity: str = "slider.position", angle: float = 0.0, *, units: str = "SI") -> ToleranceScene:
        """What `analysis.figures.plot_tolerances` draws, with the histogram at the angle nearest to ``angle`` (rad).

        Its numbers are in SI; ``units`` are those of the notes at its foot.

        Raises
        ------
        ParameterError
            If the quantity was not sampled.
        InputError
            If the quantity is not determined at that angle, or there are no such units.
        """
        spread, linear = self._spread(quantity), self.estimates[quantity]
        i = int(np.argmin(np.abs(self.turn.angle - angle)))
        if np.ma.getmaskarray(spread.percentiles)[0, i] or np.ma.getmaskarray(linear.nominal)[i]:
            if self.turn.without_lever:
                raise InputError(f"{quantity} is not determined: {NO_LEVER}")
            raise InputError(f"{quantity} is not determined at {_at(self.turn, i)}: choose another angle")
        shares = np.column_stack([linear.shares[:, i].filled(np.nan), linear.second_shares[:, i].filled(np.nan)])
        return ToleranceScene(
            quantity=quantity,
            unit=QUANTITIES[quantity],
            angle=self.turn.angle,
            deviation=linear.deviation.filled(np.nan),
            worst=linear.worst.filled(np.nan),
            departures=(spread.percentiles - linear.nominal).filled(np.nan),
            mean=(spread.mean - linear.nominal).filled(np.nan),
            at=i,
            nominal=float(linear.nominal[i]),
            edges=spread.edges[i] - float(linear.nominal[i]),
            counts=spread.counts[i],
            sample_deviation=float(np.ma.filled(spread.deviation[i], np.nan)),
            second_deviation=float(np.ma.filled(linear.second_deviation[i], np.nan)),
            shares={_label(t): (float(a), float(b)) for t, (a, b) in zip(self.tolerances, shares)},
            samples=self.samples,
            not_assembled=int(self.not_assembled.max()),
            singular=()
            if self.turn.sought != SLIDER_FORCE or quantity in _FREE_OF_LOAD
            else tuple(centre.crank_angle for centre in self.turn.singularities),
            breaks=self.turn.breaks,
            notes=self.notes(units),
        )

    def _spread(self, quantity: str) -> Spread:
        _check_names((quantity,), self.spreads, "quantity")
        return self.spreads[quantity]

    def _off(self, name: str, units: Mapping[str, tuple[str, float]]) -> list[str]:
        off = np.flatnonzero(self.linear_is_off(name) & ~self._without_estimate(name))
        if not off.size:
            return []
        spread, linear = self.spreads[name], self.estimates[name]
        unit, one = units[QUANTITIES[name]]
        i = int(off[np.argmax(np.abs(linear.deviation[off] / spread.deviation[off] - 1.0))])
        second = linear.second_deviation[i]
        told = "" if second is np.ma.masked else f", to second order {second / one:.3g} {unit}"
        vanishing = bool(np.ma.getmaskarray(linear.shares)[0, i])
        return [
            f"the linear estimate of {name} is off at {_at(self.turn, i)}{_others(off)}: "
            + (
                "its first derivatives vanish, "
                if vanishing
                else f"standard deviation {linear.deviation[i] / one:.3g} {unit}, "
            )
            + f"the samples' standard deviation is {spread.deviation[i] / one:.3g} {unit}{told}; their mean is "
            f"{(spread.mean[i] - linear.nominal[i]) / one:.3g} {unit} from the nominal value"
        ]


def monte_carlo(
    turn: ForceTurn,
    tolerances: Sequence[Tolerance],
    *,
    quantities: Sequence[str] = ("slider.position",),
    samples: int = 1_000_000,
    seed: int = 0,
) -> MonteCarlo:
    """Sample a mechanism whose dimensions are off by random amounts, at every angle of a turn.

    The same samples are taken at all angles. An angle takes about 0.2 s with a million samples of the slider's motion, and
    about 2 to 3 s with all joint forces.

    Parameters
    ----------
    turn : ForceTurn
        The nominal mechanism; see `sensitivities` for what is held.
    tolerances : sequence of Tolerance
    quantities : sequence of str
        Of `QUANTITIES`.
    samples : int
    seed : int
        Of the random numbers: the same seed gives the same samples.

    Raises
    ------
    InputError
        If there is no tolerance, or two of the same name, or fewer than two samples; if samples are no mechanism: a length
        that is not above zero, or a crank whose inertia is less than its mass requires.
    ParameterError
        If there is no such quantity.
    """
    _check_tolerances(tolerances)
    _check_names(quantities, QUANTITIES, "quantity")
    if samples < 2:
        raise InputError(f"{samples} samples: there must be at least two")
    generator = np.random.default_rng(seed)
    drawn = {t.name: t.draw(generator, samples) for t in tolerances}
    _check_samples(turn.parameters, drawn)
    linear = estimate(turn, tolerances, quantities)
    n = len(turn)
    missed, dead = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    rows: dict[str, list[tuple[Any, ...]]] = {name: [] for name in quantities}
    poles: dict[str, list[bool]] = {name: [] for name in quantities}
    for i in range(n):
        found = {name: np.empty(samples) for name in quantities}
        ratio = np.empty(samples)
        count = 0
        for start in range(0, samples, _CHUNK):
            part = {name: x[start : start + _CHUNK] for name, x in drawn.items()}
            values, kept, lever, lost = _sampled(turn, i, part, quantities)
            missed[i] += lost
            dead[i] += len(next(iter(part.values()))) - lost - kept
            for name in quantities:
                found[name][count : count + kept] = values[name]
            ratio[count : count + kept] = lever
            count += kept
        across = turn.sought == SLIDER_FORCE and count > 0 and ratio[:count].min() < 0.0 < ratio[:count].max()
        for name in quantities:
            pole = bool(across) and name not in _FREE_OF_LOAD
            rows[name].append(_statistics(found[name][:count], pole))
            poles[name].append(pole)
    return MonteCarlo(
        turn=turn,
        tolerances=tuple(tolerances),
        samples=samples,
        seed=seed,
        spreads=MappingProxyType({name: _spread(parts) for name, parts in rows.items()}),
        estimates=MappingProxyType({name: _without(linear[name], np.array(pole)) for name, pole in poles.items()}),
        not_assembled=missed,
        undetermined=dead,
    )


def _without(linear: Estimate, poles: NDArray[np.bool_]) -> Estimate:
    """The estimate without what it says of angles at which the samples have a pole."""
    values = {name: getattr(linear, name) for name in Estimate.__dataclass_fields__ if name != "nominal"}
    return replace(
        linear, **{name: np.ma.masked_where(np.broadcast_to(poles, x.shape), x) for name, x in values.items()}
    )


def _sampled(
    turn: ForceTurn, i: int, errors: Mapping[str, FloatArray], quantities: Sequence[str]
) -> tuple[dict[str, Any], int, Any, int]:
    """Quantities of the samples that can be assembled and are determined at angle i, their number, the lever, and how many
    cannot be assembled."""
    size = len(next(iter(errors.values())))
    varied = _varied(turn, i, errors)
    reached = np.broadcast_to(_square(varied) >= (LIMIT_SINE * varied.p.a2) ** 2, (size,))
    lost = size - int(reached.sum())
    if lost:
        varied = _varied(turn, i, {name: x[reached] for name, x in errors.items()})
    kept = size - lost
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        found, lever = _evaluate(turn, i, varied, quantities)
    if turn.sought == SLIDER_FORCE and not set(quantities) <= set(_KINEMATIC):
        there = np.broadcast_to(np.abs(lever) > DEAD_CENTRE * turn.parameters.crank_length, (kept,))
        if not there.all():
            found = {name: np.broadcast_to(x, (kept,))[there] for name, x in found.items()}
            return found, int(there.sum()), np.broadcast_to(lever, (kept,))[there], lost
    return found, kept, lever, lost


def _statistics(values: FloatArray, pole: bool) -> tuple[Any, ...]:
    """A row of each field of `Spread`, NaN where there is none."""
    if values.size < 2:
        nothing = np.nan
        return (
            nothing,
            nothing,
            np.full(len(PERCENTILES), nothing),
            nothing,
            nothing,
            np.zeros(_BINS + 1),
            np.zeros(_BINS),
        )
    values.sort()
    places = np.array(PERCENTILES) / 100.0 * (values.size - 1)
    below = np.minimum(places.astype(int), values.size - 2)
    percentiles = values[below] + (places - below) * (values[below + 1] - values[below])
    low, high = values[0], values[-1]
    first, last = values[int(0.0005 * values.size)], values[int(0.9995 * (values.size - 1))]
    # all samples alike have a bin of no width: a width that floats can tell is made
    edges = first + np.linspace(0.0, max(last - first, 1e-12 * max(abs(low), abs(high)), 1e-300), _BINS + 1)
    inside = np.searchsorted(values, edges[:-1])
    counts = np.diff(inside, append=np.searchsorted(values, edges[-1], "right"))
    if pole:
        return (np.nan, np.nan, percentiles, low, high, edges, counts)
    return (float(values.mean()), float(values.std(ddof=1)), percentiles, low, high, edges, counts)


def _spread(rows: Sequence[tuple[Any, ...]]) -> Spread:
    mean, deviation, percentiles, least, greatest, edges, counts = (np.array(part) for part in zip(*rows))
    return Spread(
        mean=_masked(mean),
        deviation=_masked(deviation),
        percentiles=_masked(percentiles.T),
        least=_masked(least),
        greatest=_masked(greatest),
        edges=edges,
        counts=counts.astype(np.int64),
    )


def _masked(values: FloatArray) -> MaskedArray:
    return np.ma.MaskedArray(values, mask=np.isnan(values), fill_value=np.nan)


def _steps(names: Sequence[str], n: int, moved: int = 0, step: float = 0.0) -> dict[str, Dual]:
    """Errors at n points as independent variables, all zero but the one that is moved by a step."""
    values = np.zeros((len(names), n))
    values[moved] = step
    return dict(zip(names, independent(*values)))


class _Varied(NamedTuple):
    """Constants, crank angle and shift with errors."""

    p: Constants
    angle: Any
    moving: ShiftMotion


def _varied(turn: ForceTurn, at: Any, errors: Mapping[str, Any]) -> _Varied:
    """The mechanism with the errors, at the points ``at`` of the turn."""
    nominal = {field.name: getattr(turn.parameters, field.name) for field in fields(turn.parameters)}
    changed = {
        field_name(name): nominal[field_name(name)] + x for name, x in errors.items() if name not in (ANGLE, SHIFT)
    }
    p = with_groove(_CONSTANTS(SimpleNamespace(**nominal | changed)), turn.law)
    angle = turn.angle[at] + errors.get(ANGLE, 0.0)
    if in_the_shaft(turn.law):
        moving = turn.law.at(angle, turn.speed[at], turn.acceleration[at])
    else:
        moving = ShiftMotion(turn.shift[at], turn.shift_velocity[at], turn.shift_acceleration[at])
    return _Varied(p, angle, moving._replace(shift=moving.shift + errors.get(SHIFT, 0.0)))


def _square(varied: _Varied) -> Any:
    """What is positive where the rod reaches the guide (m2)."""
    return on_arrays().assembly_square(varied.angle, varied.moving.shift, varied.p)


def _evaluate(turn: ForceTurn, at: Any, varied: _Varied, quantities: Sequence[str]) -> tuple[dict[str, Any], Any]:
    """Quantities at the points ``at`` of the turn, and the lever of the slider's force.

    Only what the quantities need is calculated; the lever is zero where no force is asked for.
    """
    f = on_arrays()
    p, angle, moving = varied
    w, e = turn.speed[at], turn.acceleration[at]
    wanted = set(quantities)
    if wanted <= set(_KINEMATIC):
        q = f.position(angle, moving.shift, p)
        found = {"slider.position": q.s4}
        if wanted != {"slider.position"}:
            k = f.coefficients(q, p)
            found["slider.velocity"] = k.kth * w + k.ks * moving.velocity
            found["slider.acceleration"] = (
                k.kth * e + k.ks * moving.acceleration + f.centripetal(q, k, w, moving.velocity, p)
            )
        return {name: found[name] for name in quantities}, 0.0
    sought = turn.sought == SLIDER_FORCE
    given = (turn.torque if sought else turn.slider_force).data[at]
    s = solve(p, angle, moving, w, e, given=given, torque=sought, groove=in_the_shaft(turn.law))
    whole = {
        "slider.position": s.position.s4,
        "slider.velocity": s.motion.slider_velocity,
        "slider.acceleration": s.motion.slider_acceleration,
        "drive.applied_torque": given if sought else s.motion.torque,
        "slider.load": s.load,
    }
    whole |= {name: getattr(getattr(s.reactions, vector), axis) for name, (vector, axis) in _VECTORS.items()}
    whole["bearing.fz"] = s.reactions.axial
    return {name: whole[name] for name in quantities}, s.ratio


def _undetermined(turn: ForceTurn, quantity: str) -> NDArray[np.bool_]:
    """Where the nominal mechanism is at a dead centre at which the quantity is not determined."""
    dead = np.ma.getmaskarray(turn.slider_force)
    return np.zeros(len(turn), dtype=bool) if quantity in _FREE_OF_LOAD else dead


def _check_names(names: Sequence[str], known: Any, what: str) -> None:
    for name in names:
        if name not in known:
            raise ParameterError(name, name, f"be the name of a known {what}: {', '.join(known)}")


def _check_tolerances(tolerances: Sequence[Tolerance]) -> tuple[str, ...]:
    names = tuple(t.name for t in tolerances)
    if not names:
        raise InputError("there is no tolerance: give at least one")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"there are {names.count(name)} tolerances of {name}: give one")
    return names


def _check_samples(parameters: SliderCrankParameters, drawn: Mapping[str, FloatArray]) -> None:
    """Make sure that every sample is a mechanism, as `SliderCrankParameters` does of one.

    Raises
    ------
    InputError
        If some are none: which tolerances make them, and how many.
    """
    values: dict[str, Any] = {field.name: getattr(parameters, field.name) for field in fields(parameters)}
    for name, x in drawn.items():
        if name in (ANGLE, SHIFT):
            continue
        values[field_name(name)] = varied = values[field_name(name)] + x
        lowest: dict[str, Any] = {field_name(name): float(varied.min())}
        try:
            replace(parameters, **lowest)
        except ParameterError as error:
            if error.name == name and lowest[field_name(name)] <= 0.0:
                positive = error.requirement == POSITIVE
                wrong = np.count_nonzero(varied <= 0.0 if positive else varied < 0.0)
                raise InputError(
                    f"the tolerance of {name} is too wide: in {wrong} of {x.size} samples it is "
                    + ("not above zero" if positive else "below zero")
                ) from None
    steiner = values["crank_mass"] * (values["crank_cog_x"] ** 2 + values["crank_cog_y"] ** 2)
    wrong = np.count_nonzero(values["crank_inertia"] < steiner * (1.0 - 1e-12))
    if wrong:
        names = [n for n in ("crank.inertia", "crank.mass", "crank.cog_x", "crank.cog_y") if n in drawn]
        raise InputError(
            f"the tolerance of {' and that of '.join(names)} is too wide: in {wrong} of {drawn[names[0]].size} samples "
            "crank.inertia is less than crank.mass * (crank.cog_x^2 + crank.cog_y^2), which it holds"
        )


def _label(tolerance: Tolerance) -> str:
    symbol = _VARIABLES[tolerance.name].symbol
    return f"{tolerance.name} ${symbol}$" if symbol else tolerance.name


def _at(turn: ForceTurn, i: int) -> str:
    return f"crank angle {degrees(float(turn.angle[i])):.6g} deg"


def _others(points: NDArray[Any]) -> str:
    return (
        f" and {points.size - 1} other angles" if points.size > 2 else " and another angle" if points.size == 2 else ""
    )
