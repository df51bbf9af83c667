"""Run a Monte Carlo analysis of a slider-crank with tolerances, and compare it with the estimates of `tolerances`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from math import degrees, isfinite
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError
from linkwork.limits import LIMIT_SINE
from linkwork.parameters import POSITIVE, field_name
from linkwork.slider_crank.parameters import SliderCrankParameters

from ..display import format_range
from ..files import Whole
from ..numerics.codegen import MAKING, MachineCode
from ..numerics.lanes import width
from ..numerics.symbolic import library, symbolic_functions
from ..numerics.workers import check_jobs, run_in_parallel, worker_count
from ..units import Amount, in_si
from .forces import NO_LEVER, SLIDER_FORCE, ForceTurn
from .kernels import collect_bins, count_in_bins, evaluate_samples
from .quantities import DEAD_CENTRE, FloatArray, MaskedArray, masked_array, shown_units
from .shifts import MODULES, has_shaft_groove
from .tolerances import (
    ANGLE,
    FREE_OF_LOAD,
    KINEMATIC,
    QUANTITIES,
    SHIFT,
    Estimate,
    Instant,
    Tolerance,
    add_errors,
    check_names,
    check_tolerances,
    instant,
    nominal_values,
    require_turn,
    tolerance_effects,
)

#: Percentiles of the samples: the shares (%) of a normal distribution below -3, -2, 0, 2, 3 standard deviations.
PERCENTILES = (0.13498980316300957, 2.275013194817921, 50.0, 97.72498680518208, 99.86501019683699)
#: Error of the linear estimate, relative to the standard deviation, above which it is reported.
OFF = 0.05
#: Number of parts of the turn for each worker.
_PARTS = 4
#: Bins of the histograms, and bins by which the percentiles are found.
_BINS, _FINE_BINS = 80, 8192


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Statistics of the samples of one quantity at n angles.

    Attributes
    ----------
    mean, deviation : masked array, shape (n,)
        Mean and standard deviation; masked if samples fall on both sides of a dead centre at which the quantity has a pole.
        The distribution then has neither mean nor deviation, although the mean of the samples can be computed.
    percentiles : masked array, shape (p, n)
        Values at `PERCENTILES`; masked only if there is no sample.
    least, greatest : masked array, shape (n,)
        Least and greatest value among the samples.
    edges : ndarray, shape (n, b + 1)
        Edges of the bins of the histograms.
    counts : ndarray, shape (n, b)
        Histograms of the middle 99.9 % of the samples: number of samples in each bin.
    """

    mean: MaskedArray
    deviation: MaskedArray
    percentiles: MaskedArray
    least: MaskedArray
    greatest: MaskedArray
    edges: FloatArray
    counts: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MonteCarlo:
    """Statistics of random samples of a mechanism with tolerances, and the estimates of `tolerances` for comparison.

    Attributes
    ----------
    turn : ForceTurn
        The nominal mechanism, at the n angles.
    tolerances : tuple of Tolerance
    samples, seed : int
        Number of samples, and seed of the random numbers.
    spreads : mapping
        `Spread` of each quantity, by name.
    estimates : mapping
        `Estimate` of each quantity, by name.
    not_assembled : ndarray of int, shape (n,)
        Number of samples whose rod does not reach the guide; these samples are left out of the statistics.
    undetermined : ndarray of int, shape (n,)
        Number of samples exactly at a dead centre, if the slider's force is sought; these are left out, too.
    """

    turn: ForceTurn
    tolerances: tuple[Tolerance, ...]
    samples: int
    seed: int
    spreads: Mapping[str, Spread]
    estimates: Mapping[str, Estimate]
    not_assembled: NDArray[np.int64]
    undetermined: NDArray[np.int64]

    def __repr__(self) -> str:
        spreads = ", ".join(
            f"{name} {format_range(spread.deviation.compressed(), QUANTITIES[name])}"
            for name, spread in self.spreads.items()
        )
        lost = int((self.not_assembled + self.undetermined).max(initial=0))
        left_out = f"; up to {lost} samples left out: see notes()" if lost else ""
        return (
            f"<MonteCarlo: {self.samples} samples of seed {self.seed} at {len(self.turn)} crank angles; standard deviations "
            f"{spreads}{left_out}>"
        )

    def notes(self, units: str = "SI") -> tuple[str, ...]:
        """Return sentences about samples that cannot be assembled, poles, and failures of the linear estimate.

        Parameters
        ----------
        units : str
            One of `UNITS`. With "SI" lengths are in mm.

        Raises
        ------
        InputError
            If there are no such units.
        """
        known, turn = shown_units(units), self.turn
        found = []
        if turn.unreachable.size:
            found.append(
                f"{turn.unreachable.size} crank angles are left out: the nominal mechanism cannot be assembled there"
            )
        if self.not_assembled.any():
            i = int(np.argmax(self.not_assembled))
            found.append(
                f"{self.not_assembled[i]} of {self.samples} samples ({100.0 * self.not_assembled[i] / self.samples:.3g} %) "
                f"cannot be assembled at {_angle(turn, i)}, the most of any angle"
            )
        if self.undetermined.any():
            found.append(f"{int(self.undetermined.sum())} samples are at a dead centre: they have no slider force")
        for name, spread in self.spreads.items():
            poles = np.ma.getmaskarray(spread.mean) & ~np.ma.getmaskarray(spread.percentiles)[0]
            near = np.flatnonzero(self._without_estimate(name) & ~poles)
            if poles.any():
                found.append(
                    f"{name} has samples on both sides of a dead centre at {_angles(turn, np.flatnonzero(poles))}: it has no "
                    "mean and no variance there, only percentiles"
                )
            if near.size:
                found.append(
                    f"the tolerances reach a dead centre from {_angles(turn, near)}: there is no linear estimate of {name} "
                    "there"
                )
            found += self._failure_sentence(name, *known[QUANTITIES[name]])
        return tuple(found)

    def _without_estimate(self, quantity: str) -> NDArray[np.bool_]:
        """Return a mask (n,) of the angles at which a determined quantity has no estimate because a dead centre is near."""
        linear = self.estimates[quantity]
        return np.asarray(np.ma.getmaskarray(linear.deviation) & ~np.ma.getmaskarray(linear.nominal))

    def standard_error(self, quantity: str) -> MaskedArray:
        """Return the standard error of the mean of the samples, shape (n,), in the unit of the quantity.

        Raises
        ------
        ParameterError
            If the quantity was not sampled.
        """
        check_names((quantity,), self.spreads, "quantity")
        return cast(MaskedArray, self.spreads[quantity].deviation * self._of_the_mean)

    @property
    def _of_the_mean(self) -> FloatArray:
        """Return the standard error of the mean of the samples divided by their standard deviation, shape (n,)."""
        return 1.0 / np.sqrt(np.maximum(self.samples - self.not_assembled - self.undetermined, 2))

    def linear_misses(self, quantity: str) -> NDArray[np.bool_]:
        """Return a mask (n,) of the angles at which the linear estimate fails.

        The estimate fails if its mean or standard deviation differs from that of the samples by more than 5 % of the standard
        deviation (the greater one of the two) plus five standard errors, or if a dead centre is so near that there is no
        estimate.
        """
        check_names((quantity,), self.spreads, "quantity")
        spread, linear = self.spreads[quantity], self.estimates[quantity]
        sd = spread.deviation
        # a few samples may be close together by chance; up to a kurtosis of five, the standard error of a standard deviation is
        # at most that of the mean
        allowed = (OFF + 5.0 * self._of_the_mean) * np.ma.maximum(sd, linear.deviation)
        rounding = 1e-9 * np.ma.abs(linear.nominal)
        off = (np.ma.abs(spread.mean - linear.nominal) > allowed + rounding) | (
            np.ma.abs(sd - linear.deviation) > allowed + rounding
        )
        return cast(NDArray[np.bool_], np.ma.filled(off, False)) | self._without_estimate(quantity)

    @in_si(angle="rad")
    def place(self, quantity: str, angle: Amount) -> int:
        """Return the index of the crank angle nearest to ``angle`` (rad), at which the quantity must be determined.

        An angle outside the sampled range is reduced by whole turns, if the shift is known to repeat after them.

        Raises
        ------
        ParameterError
            If the quantity was not sampled.
        InputError
            If the quantity is not determined there.
        """
        check_names((quantity,), self.spreads, "quantity")
        away, shift = self.turn.angle - angle, self.turn.law.periodic_shift(self.turn.parameters)
        if shift is not None and (away.min() > 0.0 or away.max() < 0.0):
            away -= shift.span * np.rint(away / shift.span)
        i = int(np.argmin(np.abs(away)))
        spread, linear = self.spreads[quantity], self.estimates[quantity]
        if np.ma.getmaskarray(spread.percentiles)[0, i] or np.ma.getmaskarray(linear.nominal)[i]:
            if self.turn.without_lever:
                raise InputError(f"{quantity} is not determined: {NO_LEVER}")
            raise InputError(f"{quantity} is not determined at {_angle(self.turn, i)}: choose another angle")
        return i

    def poles(self, quantity: str) -> tuple[float, ...]:
        """Return the crank angles (rad) at which a quantity of the nominal mechanism has a pole."""
        free = self.turn.sought != SLIDER_FORCE or quantity in FREE_OF_LOAD
        return () if free else tuple(centre.crank_angle for centre in self.turn.singularities)

    def _failure_sentence(self, name: str, unit: str, one: float) -> list[str]:
        """Return the sentence on the worst failure of the linear estimate, in a list; an empty list if there is no failure.

        ``one`` is the factor from ``unit`` to SI.
        """
        off = np.flatnonzero(self.linear_misses(name) & ~self._without_estimate(name))
        if not off.size:
            return []
        spread, linear = self.spreads[name], self.estimates[name]
        i = int(off[np.argmax(np.abs(linear.deviation[off] / spread.deviation[off] - 1.0))])
        second = linear.second_deviation[i]
        first = f"standard deviation {linear.deviation[i] / one:.3g} {unit}"
        if np.ma.getmaskarray(linear.shares)[0, i]:
            first = "its first derivatives vanish"
        to_second = "" if second is np.ma.masked else f", to second order {second / one:.3g} {unit}"
        return [
            f"the linear estimate of {name} is off at {_angle(self.turn, i)}{_count_others(off)}: {first}, the samples' "
            f"standard deviation is {spread.deviation[i] / one:.3g} {unit}{to_second}; their mean is "
            f"{(spread.mean[i] - linear.nominal[i]) / one:.3g} {unit} from the nominal value"
        ]


def monte_carlo(
    turn: ForceTurn,
    tolerances: Sequence[Tolerance],
    *,
    quantities: Sequence[str] = ("slider.position",),
    samples: int = 1_000_000,
    seed: int = 0,
    n_jobs: int | None = None,
) -> MonteCarlo:
    """Sample a mechanism with random errors of its dimensions, at every angle of a turn.

    The same samples are used at all angles. A million samples take some hundredths of a second per angle for the slider's
    position, and seven times as long for all quantities.

    Parameters
    ----------
    turn : ForceTurn
        The nominal mechanism; see `sensitivities` for the quantities held constant.
    tolerances : sequence of Tolerance
    quantities : sequence of str
        Names of `QUANTITIES`.
    samples : int
        Number of samples.
    seed : int
        Seed of the random numbers: the same seed gives the same samples.
    n_jobs : int, optional
        Number of threads, -1 for one per core. The default is one thread; inside `joblib.parallel_config` for a cluster the
        default is all cores of the cluster.

    Raises
    ------
    InputError
        If ``turn`` is not a `ForceTurn`; if there is no tolerance, or two of the same name; if samples are invalid: a length
        not above zero, or a crank inertia below the least that its mass allows; or if a variance is too large for a number.
    ParameterError
        If there is no such quantity, ``samples`` is not a whole number of at least 2, or ``seed`` is a negative
        number or not a whole one.

    Examples
    --------
    >>> from analysis import Tolerance, force_turn, monte_carlo
    >>> turn = force_turn("rahman-a4-10-s1-3.5", angles=["30 deg", "90 deg"])
    >>> sampled = monte_carlo(turn, [Tolerance("rod.length", half_width="0.5 mm")], samples=1000)
    >>> sampled.spreads["slider.position"].deviation.round(6).tolist()
    [0.000179, 0.000167]
    """
    require_turn(turn)
    check_tolerances(tolerances)
    check_names(quantities, QUANTITIES, "quantity")
    samples, seed = Whole(least=2)(samples, "samples"), Whole(least=0)(seed, "seed")
    check_jobs(n_jobs)
    quantities = tuple(dict.fromkeys(quantities))
    linear = tolerance_effects(turn, tolerances, quantities)
    _compile(turn, tuple(t.name for t in tolerances), quantities)  # once, before the workers need it
    cores = worker_count(n_jobs)
    size = len(turn) if cores == 1 else -(-len(turn) // (_PARTS * cores))
    parts = [range(k, min(k + size, len(turn))) for k in range(0, len(turn), max(1, size))]
    work = partial(_sample_angles, turn, tuple(tolerances), quantities, samples, seed)
    found = dict(run_in_parallel(work, parts, n_jobs=n_jobs, threads=True))
    drawn = [x for number in sorted(found) for x in found[number]]
    poles = {name: np.array([x.across and name not in FREE_OF_LOAD for x in drawn]) for name in quantities}
    return MonteCarlo(
        turn=turn,
        tolerances=tuple(tolerances),
        samples=samples,
        seed=seed,
        spreads=MappingProxyType(
            {name: _spread([x.statistics[name] for x in drawn], poles[name]) for name in quantities}
        ),
        estimates=MappingProxyType({name: _mask_poles(linear[name], poles[name]) for name in quantities}),
        not_assembled=np.array([x.not_assembled for x in drawn], dtype=np.int64),
        undetermined=np.array([x.undetermined for x in drawn], dtype=np.int64),
    )


def _mask_poles(linear: Estimate, poles: NDArray[np.bool_]) -> Estimate:
    """Return the estimate masked at ``poles``, the angles at which samples fall on both sides of a pole."""
    values = {name: getattr(linear, name) for name in Estimate.__dataclass_fields__ if name != "nominal"}
    return replace(
        linear, **{name: np.ma.masked_where(np.broadcast_to(poles, x.shape), x) for name, x in values.items()}
    )


class _Draws(NamedTuple):
    """Statistics of the samples at one crank angle, and the numbers of samples that are left out."""

    statistics: Mapping[str, tuple[Any, ...]]  # fields of `Spread`, by quantity
    across: bool  # whether samples fall on both sides of a dead centre
    not_assembled: int  # see `MonteCarlo`
    undetermined: int  # see `MonteCarlo`


def _sample_angles(
    turn: ForceTurn,
    tolerances: Sequence[Tolerance],
    quantities: tuple[str, ...],
    samples: int,
    seed: int,
    places: Sequence[int],
) -> list[_Draws]:
    """Draw all samples, the same for each part of the turn, and evaluate them at the angles with the indices ``places``.

    Drawing the samples for each part is faster than sending them to other processes.
    """
    generator = np.random.default_rng(seed)
    errors = {t.name: t.draw(generator, samples) for t in tolerances}
    _check_samples(turn.parameters, errors)
    code, rows = _compile(turn, tuple(errors), quantities).addresses["sample"], np.array(list(errors.values()))
    return [_sample_angle(turn, i, rows, quantities, code) for i in places]


def _sample_angle(turn: ForceTurn, i: int, errors: FloatArray, quantities: tuple[str, ...], code: int) -> _Draws:
    """Evaluate the samples, the columns of ``errors``, at angle i with the compiled function; return their statistics."""
    found = np.empty((len(quantities) + 2, errors.shape[1]))
    with_pole = turn.sought == SLIDER_FORCE and not set(quantities) <= set(KINEMATIC)
    least_lever = DEAD_CENTRE * turn.parameters.crank_length if with_pole else -1.0
    values = np.array(list(nominal_values(turn).values()), dtype=float)
    missed, dead = evaluate_samples(code, width(), np.array(instant(turn, i)), values, errors, least_lever, found)
    found = found[:, : found.shape[1] - missed - dead]
    across = with_pole and found.size > 0 and bool(found[-2].min() < 0.0 < found[-2].max())
    here = _angle(turn, i)
    return _Draws({name: _statistics(name, x, here) for name, x in zip(quantities, found)}, across, missed, dead)


def _compile(turn: ForceTurn, names: tuple[str, ...], quantities: tuple[str, ...]) -> MachineCode:
    """Compile the function of `evaluate_samples` for the force problem of a turn, and errors and quantities of these names."""
    return _compile_problem(turn.sought == SLIDER_FORCE, has_shaft_groove(turn.law), names, quantities)


@lru_cache(maxsize=32)
def _compile_problem(
    load_sought: bool, grooved: bool, names: tuple[str, ...], quantities: tuple[str, ...]
) -> MachineCode:
    casadi, own = library(), fields(SliderCrankParameters)
    sizes = {"nominal": len(Instant._fields), "values": len(own), "errors": len(names)}
    nominal, values, errors = (casadi.SX.sym(name, size) for name, size in sizes.items())
    varied = add_errors(
        symbolic_functions(MODULES, float=lambda x: x),
        load_sought,
        grooved,
        {field.name: x for field, x in zip(own, casadi.vertsplit(values))},
        Instant(*casadi.vertsplit(nominal)),
        dict(zip(names, casadi.vertsplit(errors))),
    )
    found, lever = varied.evaluate(quantities)
    out = casadi.vertcat(*found.values(), lever, varied.assembly_square - (LIMIT_SINE * varied.p.a2) ** 2)
    arguments = [casadi.SX.sym("t"), nominal, errors, values, casadi.SX.sym("unused")]
    with MAKING:
        return MachineCode([casadi.Function("sample", arguments, [casadi.densify(out)], {"cse": True})], width())


def _statistics(name: str, values: FloatArray, here: str) -> tuple[Any, ...]:
    """Return the fields of `Spread` for the samples of a quantity at the angle ``here``; NaN if there are none.

    Raises InputError if the variance is too large for a number.
    """
    if values.size < 2:
        none = np.nan
        return none, none, np.full(len(PERCENTILES), none), none, none, np.zeros(_BINS + 1), np.zeros(_BINS)
    with np.errstate(over="ignore", invalid="ignore"):
        mean, deviation = float(values.mean()), float(values.std(ddof=1))
    # the kernels write outside their arrays if the range of the values is not finite
    if not isfinite(deviation):
        raise InputError(
            f"{name} is {values.min():.3g} to {values.max():.3g} {QUANTITIES[name]} in the samples at {here}: its "
            "variance is too large for a floating-point number; are all values in the right units?"
        )
    places = np.array(PERCENTILES) / 100.0 * (values.size - 1)
    below = np.minimum(places.astype(int), values.size - 2)
    low, first, last, high, *around = order_statistics(
        values,
        np.array([0, int(0.0005 * values.size), int(0.9995 * (values.size - 1)), values.size - 1, *below, *below + 1]),
    )
    lower, upper = np.split(np.array(around), 2)
    end = _upper_end(first, last)
    counts = np.zeros(_BINS, dtype=np.int64)
    count_in_bins(values, first, end, counts)
    percentiles = lower + (places - below) * (upper - lower)
    edges = np.linspace(first, end, _BINS + 1)
    return mean, deviation, percentiles, low, high, edges, counts


def order_statistics(values: FloatArray, places: NDArray[np.int64]) -> FloatArray:
    """Return the values that would be at the indices ``places`` if all values were sorted.

    The values are counted in equal bins, and only those in the bins of the wanted indices are sorted. A partition would take
    four times as long.
    """
    low = float(values.min())
    high = _upper_end(low, float(values.max()))
    counts = np.zeros(_FINE_BINS, dtype=np.int64)
    count_in_bins(values, low, high, counts)
    wanted = np.zeros(_FINE_BINS, dtype=bool)
    bins = np.searchsorted(np.cumsum(counts), places, side="right")
    wanted[bins] = True
    few = np.empty(counts[wanted].sum())
    collect_bins(values, low, high, wanted, few)
    few.sort()
    return np.asarray(few[places - np.cumsum(np.where(wanted, 0, counts))[bins]])


def _upper_end(low: float, high: float) -> float:
    """Return the upper end of bins that begin at ``low``: ``high``, or more if floats could not tell the bins apart."""
    return max(high, low + max(1e-12 * max(abs(low), abs(high)), 1e-300))


def _spread(rows: Sequence[tuple[Any, ...]], poles: NDArray[np.bool_]) -> Spread:
    """Return the `Spread` from the statistics at each angle; mean and deviation are masked at the poles."""
    mean, deviation, percentiles, least, greatest, edges, counts = (np.array(part) for part in zip(*rows))
    return Spread(
        mean=masked_array(mean, poles | np.isnan(mean)),
        deviation=masked_array(deviation, poles | np.isnan(deviation)),
        percentiles=masked_array(percentiles.T, np.isnan(percentiles.T)),
        least=masked_array(least, np.isnan(least)),
        greatest=masked_array(greatest, np.isnan(greatest)),
        edges=edges,
        counts=counts.astype(np.int64),
    )


def _check_samples(parameters: SliderCrankParameters, drawn: Mapping[str, FloatArray]) -> None:
    """Check that every sample is a valid mechanism, by the rules of `SliderCrankParameters`.

    Raises InputError if samples are invalid; the message gives their number and the tolerances that cause it.
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
            "crank.inertia is less than crank.mass * (crank.cog_x^2 + crank.cog_y^2), its least possible value"
        )


def _angle(turn: ForceTurn, i: int) -> str:
    return f"crank angle {degrees(float(turn.angle[i])):.6g} deg"


def _angles(turn: ForceTurn, points: NDArray[Any]) -> str:
    return _angle(turn, int(points[0])) + _count_others(points)


def _count_others(points: NDArray[Any]) -> str:
    others = points.size - 1
    return f" and {others} other angles" if others > 1 else " and another angle" if others else ""
