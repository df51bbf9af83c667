"""Find the slider's motion as a Fourier series of the crank rotation by direct search (thesis, chapter VII).

A slider moves the rocker pivot of a given linkage, so that the linkage does its task better. The search optimises mean and
harmonics of the motion, guide angle and, if they are free, the links, with exact Jacobians, from several starts and within
bounds of stroke, speed and acceleration. `analysis.slider.variational` finds the optimum at each crank angle separately; that
motion may have jumps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from .. import synthesis as syn
from ..numerics.fourier import FourierSeries
from ..run import require_kind
from ..units import Amount, in_si

FloatArray = NDArray[np.float64]


@in_si(bounds=syn.UNITS)
def slider_motion(
    task: syn.Task,
    linkage: syn.Linkage | syn.Solution,
    unknown: syn.PivotUnknown,
    *,
    bounds: Mapping[str, tuple[Amount, Amount]] | None = None,
    constraints: Sequence[syn.Constraint] = (syn.FullTurn(),),
    guesses: Sequence[syn.Linkage | syn.Solution] = (),
    search: syn.Search = syn.USUAL_SEARCH,
) -> syn.Synthesis:
    """Find the motion of the rocker pivot that minimises the error of a linkage in a task.

    Parameters
    ----------
    task : Task
        Task of `analysis.synthesis`, with its weights.
    linkage : Linkage or Solution
        Linkage whose dimensions are kept, except the dimensions in ``bounds``. For an open path it must be a `Solution`, which
        contains the crank rotations of the stations.
    unknown : SliderUnknown or CrankUnknown
        Harmonics, and bounds of guide angle, stroke, speed and acceleration.
    bounds : mapping, optional
        Dimensions that are optimised together with the motion: (least, greatest) value by name (m, rad).
    constraints : sequence
        Constraints of the search; by default the links must stay joined over the turn.
    guesses : sequence of Linkage or Solution
        Further starts of the search: the motion of their rocker pivots and the dimensions named in ``bounds`` are used.
    search : Search
        Settings of the search, which starts from random harmonics and guide angles, without a scan.

    Returns
    -------
    Synthesis
        Solutions: linkages with a moving rocker pivot.

    Raises
    ------
    InputError, InfeasibleError, SynthesisInterrupted
        As for `synthesize`.

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
    require_kind(linkage, (syn.Linkage, syn.Solution), "linkage", "a Linkage or Solution of analysis.synthesis")
    given = linkage.linkage if isinstance(linkage, syn.Solution) else linkage
    free = dict(bounds or {})
    kept = {name: value for name, value in given.values().items() if name != "branch" and name not in free}
    asked = {c.branch for c in constraints if isinstance(c, syn.Assembly)}
    if asked - {given.branch}:
        raise InputError(
            f"the constraints require assembly {asked.pop():+d}, but the linkage has assembly {given.branch:+d}: turn it over "
            "first"
        )
    return syn.improve(
        task,
        linkage,
        unknown,
        bounds={name: (value, value) for name, value in kept.items()} | free,
        constraints=(*constraints, *(() if asked else (syn.Assembly(branch=given.branch),))),
        guesses=guesses,
        kept=kept,
        search=search,
    )


def greatest_derivative(linkage: syn.Linkage, order: int) -> float:
    """Return the greatest magnitude, over a turn, of the slider position's derivative of the given ``order`` (m/rad^order).

    The derivative is with respect to the crank rotation; order 0 is the position itself. If no slider moves the pivot, the
    result is 0.
    """
    if not isinstance(linkage.pivot, syn.SliderMotion):
        return 0.0
    series = linkage.pivot.series
    for _ in range(order):
        series = series.derivative()
    return float(np.abs(series(np.linspace(0.0, 2.0 * pi, 720, endpoint=False))).max())


def motion_of_plant(linkage: syn.Linkage) -> FourierSeries:
    """Return the slider position (m) as a Fourier series of the plant's crank angle th2 = phi + th20, see `inverse_dynamics`.

    For a fixed rocker pivot the series is 0.

    Raises
    ------
    InputError
        If the rocker pivot is on a second crank.
    """
    if linkage.pivot is None:
        return FourierSeries.constant(0.0)
    if not isinstance(linkage.pivot, syn.SliderMotion):
        raise InputError(
            "the rocker pivot is on a second crank: a five-bar with a geared second crank cannot be simulated yet"
        )
    series = linkage.pivot.series
    turned = (series.cos - 1j * series.sin) * np.exp(-1j * linkage.crank_phase * np.arange(series.order + 1))
    return FourierSeries(turned.real, -turned.imag)
