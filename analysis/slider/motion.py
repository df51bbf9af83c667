"""Direct search for the slider's motion as a Fourier series of the crank's rotation (thesis, chapter VII).

The rocker pivot of a given linkage is moved to improve its task: mean, harmonics and guide angle, and the links if they are
free, are optimised with exact Jacobians from several starts, within bounds of stroke, speed and acceleration. The optimum at
each crank angle alone is in `analysis.slider.variational`; it may jump, a Fourier series cannot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted

from ..numerics.fourier import FourierSeries
from ..synthesis import (
    UNITS,
    USUAL_SEARCH,
    Assembly,
    Constraint,
    FullTurn,
    InfeasibleError,
    Linkage,
    PivotUnknown,
    Search,
    SliderMotion,
    SliderUnknown,
    Solution,
    Synthesis,
    SynthesisInterrupted,
    Task,
    improve,
    solve_both_ways,
)
from ..units import Amount, in_si

FloatArray = NDArray[np.float64]


@in_si(bounds=UNITS)
def slider_motion(
    task: Task,
    linkage: Linkage | Solution,
    unknown: PivotUnknown,
    *,
    bounds: Mapping[str, tuple[Amount, Amount]] | None = None,
    constraints: Sequence[Constraint] = (FullTurn(),),
    guesses: Sequence[Linkage | Solution] = (),
    search: Search = USUAL_SEARCH,
) -> Synthesis:
    """Find the motion of the rocker pivot with which a linkage does a task best.

    Parameters
    ----------
    task : Task
        Task of `analysis.synthesis`, with its weights.
    linkage : Linkage or Solution
        Its dimensions are kept except those with ``bounds``. For an open path it must be a solution, which has the crank
        rotations of the stations.
    unknown : SliderUnknown or CrankUnknown
        Harmonics, and bounds of guide angle, stroke, speed and acceleration.
    bounds : mapping, optional
        Dimensions that are optimised together with the motion, (least, greatest) by name (m, rad).
    constraints : sequence
        By default the links stay joined over the turn.
    guesses : sequence of Linkage or Solution
        Further starts of the search: their pivots' motion, and their free dimensions.
    search : Search
        Its starts are random phases and amplitudes of the harmonics and guide angles; there is no scan.

    Returns
    -------
    Synthesis
        Solutions whose linkages have a moved pivot.

    Raises
    ------
    InputError, InfeasibleError, SynthesisInterrupted
        As `synthesize`.

    Examples
    --------
    >>> import numpy as np
    >>> from analysis import slider_motion
    >>> from analysis.synthesis import Linkage, Search, SliderUnknown, TimedPath, turn
    >>> lengths = {"ground_length": "25 cm", "crank_length": "10 cm", "coupler_length": "20 cm", "rocker_length": "22 cm"}
    >>> linkage = Linkage(**lengths, point_distance="15 cm")
    >>> shifted = TimedPath(points=linkage.path(turn(24)) + [0.01, 0.0])
    >>> moved = slider_motion(shifted, linkage, SliderUnknown(harmonics=1, stroke="3 cm"), search=Search(starts=2))
    >>> moved.best.evaluation.worst < 0.01
    True
    """
    given = linkage.linkage if isinstance(linkage, Solution) else linkage
    free = dict(bounds or {})
    kept = {name: value for name, value in given.values().items() if name != "branch" and name not in free}
    asked = {c.branch for c in constraints if isinstance(c, Assembly)}
    if asked - {given.branch}:
        raise InputError(
            f"assembly {asked.pop():+d} is asked of a linkage that is assembled {given.branch:+d}: turn it over first"
        )
    return improve(
        task,
        linkage,
        unknown,
        bounds={name: (value, value) for name, value in kept.items()} | free,
        constraints=(*constraints, *(() if asked else (Assembly(branch=given.branch),))),
        guesses=guesses,
        kept=kept,
        search=search,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothnessCurve:
    """Error of the task over the smoothness of the slider's motion.

    Attributes
    ----------
    acceleration : ndarray, shape (n,)
        Bounds of ``|d2u/dphi2|`` (m/rad2), increasing.
    solutions : tuple of Solution or None
        Best solution for each bound; None if there is none.
    """

    acceleration: FloatArray
    solutions: tuple[Solution | None, ...]

    @property
    def error(self) -> np.ma.MaskedArray:
        """Value of the quality function at each bound, masked where there is no solution; shape (n,)."""
        return np.ma.masked_invalid(np.array([np.nan if s is None else s.error for s in self.solutions]))

    @property
    def attained(self) -> np.ma.MaskedArray:
        """Greatest ``|d2u/dphi2|`` of each motion (m/rad2)."""
        values = [np.nan if s is None else greatest_derivative(s.linkage, 2) for s in self.solutions]
        return np.ma.masked_invalid(np.array(values))


class SmoothnessInterrupted(Interrupted):
    """A smoothness curve was stopped from the keyboard; ``curve`` has the best motion so far at each bound."""

    def __init__(self, curve: SmoothnessCurve, done: int, problems: int) -> None:
        self.curve = curve
        super().__init__(f"stopped after {done} of {problems} problems of the smoothness curve")


def greatest_derivative(linkage: Linkage, order: int) -> float:
    """Return the greatest magnitude over a turn of the slider's position (order 0) or of a derivative by the rotation."""
    if not isinstance(linkage.pivot, SliderMotion):
        return 0.0
    series = linkage.pivot.series
    for _ in range(order):
        series = series.derivative()
    return float(np.abs(series(np.linspace(0.0, 2.0 * pi, 720, endpoint=False))).max())


def motion_of_plant(linkage: Linkage) -> FourierSeries:
    """Return the slider's position (m) over the plant's crank angle th2 = phi + th20, for `inverse_dynamics` and `track`.

    Raises
    ------
    InputError
        If the rocker pivot is on a second crank.
    """
    if linkage.pivot is None:
        return FourierSeries.constant(0.0)
    if not isinstance(linkage.pivot, SliderMotion):
        raise InputError("the rocker pivot is on a second crank: the plant has none")
    series = linkage.pivot.series
    turned = (series.cos - 1j * series.sin) * np.exp(-1j * linkage.crank_phase * np.arange(series.order + 1))
    return FourierSeries(turned.real, -turned.imag)


def smoothness_curve(
    task: Task,
    linkage: Linkage | Solution,
    unknown: SliderUnknown,
    accelerations: ArrayLike,
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint] = (FullTurn(),),
    search: Search = USUAL_SEARCH,
) -> SmoothnessCurve:
    """Find the best motion for each bound of its second derivative: error against smoothness, warm started.

    From no bound to the tightest, each problem starts from the solutions of the one before, their harmonics scaled down to the
    new bound, and from random starts. Then back: each problem keeps the smoother solution or one refined from it, so that a
    wider bound never has a larger error.

    Parameters
    ----------
    task, linkage, unknown, bounds, constraints, search
        As for `slider_motion`.
    accelerations : array_like, shape (n,)
        Bounds of ``|d2u/dphi2|`` (m/rad2), above zero.

    Raises
    ------
    InputError
        If the bounds are not usable, or the unknown is no slider.
    SmoothnessInterrupted
        On Ctrl-C, with the best so far at each bound.
    """
    if not isinstance(unknown, SliderUnknown):
        raise InputError(f"the unknown is {unknown!r}: a smoothness curve needs a SliderUnknown")
    values = np.sort(np.array(accelerations, dtype=float, ndmin=1))
    if values.ndim != 1 or len(values) < 2 or not (np.isfinite(values).all() and values[0] > 0.0):
        raise InputError("bounds of acceleration must be finite numbers above zero, at least two")

    def best(acceleration: float, guesses: Sequence[Solution], starts: int) -> tuple[Solution, ...]:
        return slider_motion(
            task,
            linkage,
            replace(unknown, acceleration=acceleration),
            bounds=bounds,
            constraints=constraints,
            guesses=[replace(guess, linkage=_shrunk(guess.linkage, acceleration)) for guess in guesses],
            search=replace(search, starts=starts, solutions=3),
        ).solutions

    found: dict[int, Solution] = {}
    done: int | None = 0
    # the best motion without a bound is the start for a wide bound
    with suppress(SynthesisInterrupted, KeyboardInterrupt):
        try:
            widest = best(inf, [], search.starts)
        except InfeasibleError:
            widest = ()
        found, done = solve_both_ways(
            range(len(values))[::-1],
            lambda k, guesses, back: best(float(values[k]), guesses, 0 if back else search.starts),
            widest,
        )
    curve = SmoothnessCurve(acceleration=values, solutions=tuple(found.get(k) for k in range(len(values))))
    if done is not None:
        raise SmoothnessInterrupted(curve, done, 2 * len(values))
    return curve


def _shrunk(linkage: Linkage, acceleration: float) -> Linkage:
    """Return the linkage with the slider's harmonics scaled down to a bound of the second derivative."""
    most = greatest_derivative(linkage, 2)
    if not isinstance(linkage.pivot, SliderMotion) or most <= acceleration:
        return linkage
    series = linkage.pivot.series
    factor = acceleration / most
    mean = series.mean
    return replace(linkage, pivot=replace(linkage.pivot, series=(series + -mean) * factor + mean))
