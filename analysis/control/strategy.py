"""The simplest mechanism that meets a tolerance (thesis, section 7.4).

A four-bar first; if its best is not good enough, a four-bar whose rocker pivot is moved by a slider, harmonic by harmonic,
links and motion optimised together; then five-bars, whose rocker pivot is on a second crank, geared to the first or turned
independently. Each step starts from the one before, and says why it was not the last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, inf, isfinite
from typing import Literal

import numpy as np

from linkwork.errors import InputError

from ..synthesis.constraints import USUAL, Constraint, InfeasibleError
from ..synthesis.program import CrankUnknown, SliderUnknown
from ..synthesis.solution import Solution
from ..synthesis.solve import Synthesis, synthesize
from ..synthesis.tasks import RockerFunction, Task

Criterion = Literal["error", "worst"]

#: Ratios of the gears that are tried, turns of the second crank for one of the first.
RATIOS = (1, -1, 2, -2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One mechanism that was tried.

    Attributes
    ----------
    mechanism : str
        In words.
    solution : Solution or None
        Its best; None if there is none.
    value : float
        What was compared with the tolerance; infinite without a solution.
    reason : str
        Why it was taken, or why it was not enough.
    """

    mechanism: str
    solution: Solution | None
    value: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strategy:
    """What was tried, in order of simplicity, and what was chosen.

    Attributes
    ----------
    steps : tuple of Step
    met : bool
        Whether the last step meets the tolerance.
    tolerance : float
    criterion : str
    """

    steps: tuple[Step, ...]
    met: bool
    tolerance: float
    criterion: str

    @property
    def chosen(self) -> Step:
        """The step that meets the tolerance; without one, the simplest of those that come nearest."""
        return self.steps[-1] if self.met else min(self.steps, key=lambda step: step.value)

    def __str__(self) -> str:
        return "\n".join(f"{step.mechanism}: {step.reason}" for step in self.steps)


def simplest_mechanism(
    task: Task,
    tolerance: float,
    *,
    criterion: Criterion = "error",
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint] = USUAL,
    stroke: float | None = None,
    harmonics: int = 3,
    ratios: Sequence[int] = RATIOS,
    second_crank: float | None = None,
    starts: int = 12,
    seed: int = 0,
    n_jobs: int = 1,
    progress: bool = False,
) -> Strategy:
    """The simplest mechanism whose error is within a tolerance.

    Parameters
    ----------
    task : Task
    tolerance : float
        Of the quality function (m2; of a rocker function rad2), or of the worst error (m; rad).
    criterion : "error" or "worst"
        Which of them.
    bounds, constraints
        Of the links, as for `synthesize`: they hold for every mechanism.
    stroke : float, optional
        Greatest stroke of the slider (m); half the ground link of the best four-bar by default.
    harmonics : int
        Up to so many of the slider, and of an independent second crank.
    ratios : sequence of int
        Gears that are tried.
    second_crank : float, optional
        Its greatest length (m); half the stroke by default.
    starts, seed, n_jobs, progress
        As for `synthesize`; of a four-bar twice as many starts.

    Returns
    -------
    Strategy

    Raises
    ------
    InputError
        If the tolerance or another number is not usable.
    InfeasibleError
        If there is not even a four-bar.
    """
    if not (isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance is {tolerance}: it must be a finite number greater than zero")
    if criterion not in ("error", "worst"):
        raise InputError(f"criterion {criterion!r}: it must be 'error' or 'worst'")
    if harmonics < 1:
        raise InputError(f"{harmonics} harmonics: there must be at least one")
    for name, value in (("stroke", stroke), ("length of the second crank", second_crank)):
        if value is not None and not (isfinite(value) and value > 0.0):
            raise InputError(f"greatest {name} is {value} m: it must be a finite number greater than zero")
    for ratio in ratios:
        if ratio != int(ratio):
            raise InputError(f"ratio {ratio} of the gears: it must be a whole number, or the path does not close")
    search = _Search(task, tolerance, criterion, n_jobs, progress)
    four_bar = search.step(
        "four-bar",
        synthesize(task, bounds, constraints, seed=seed, starts=2 * starts, n_jobs=n_jobs, progress=progress),
    )
    if four_bar is None or search.met():
        return search.result()
    ground = four_bar.linkage.ground_length
    reach = 0.5 * ground if stroke is None else stroke
    guesses = [four_bar]
    for count in range(1, harmonics + 1):
        slider = SliderUnknown(harmonics=count, stroke=reach)
        words = f"four-bar with a moved slider, {count} harmonic{'s' if count > 1 else ''}"
        found = search.attempt(words, slider, bounds, constraints, guesses, starts, seed)
        if search.met():
            return search.result()
        guesses += [found] if found else []
    length = (1e-3 * reach, 0.5 * reach if second_crank is None else second_crank)
    geared: dict[int, Solution] = {}
    for ratio in ratios:
        crank = CrankUnknown(ratio=ratio, length=length)
        words = f"five-bar, second crank geared {ratio}:1"
        found = search.attempt(words, crank, bounds, constraints, [four_bar], starts, seed)
        if search.met():
            return search.result()
        if found:
            geared[ratio] = found
    # from the best gears on, the second crank is turned by itself
    ratio = min(geared, key=lambda r: geared[r].error, default=1)
    guesses = [geared.get(ratio, four_bar)]
    for count in range(1, harmonics + 1):
        crank = CrankUnknown(ratio=ratio, length=length, harmonics=count)
        words = f"five-bar, second crank turned independently, {count} harmonic{'s' if count > 1 else ''}"
        found = search.attempt(words, crank, bounds, constraints, guesses, starts, seed)
        if search.met():
            break
        guesses += [found] if found else []
    return search.result()


class _Search:
    """The steps so far."""

    def __init__(self, task: Task, tolerance: float, criterion: Criterion, n_jobs: int, progress: bool) -> None:
        self.task, self.tolerance, self.criterion = task, tolerance, criterion
        self.n_jobs, self.progress = n_jobs, progress
        self.steps: list[Step] = []
        self._met = False

    def met(self) -> bool:
        """Whether the last mechanism will do."""
        return self._met

    def attempt(
        self,
        mechanism: str,
        unknown: SliderUnknown | CrankUnknown,
        bounds: Mapping[str, tuple[float, float]] | None,
        constraints: Sequence[Constraint],
        guesses: Sequence[Solution],
        starts: int,
        seed: int,
    ) -> Solution | None:
        """Links and the pivot's motion together, from a scan and from simpler mechanisms."""
        try:
            found = synthesize(
                self.task,
                bounds,
                constraints,
                seed=seed,
                pivot=unknown,
                guesses=guesses,
                starts=starts,
                n_jobs=self.n_jobs,
                progress=self.progress,
            )
        except InfeasibleError:
            found = None
        return self.step(mechanism, found)

    def step(self, mechanism: str, found: Synthesis | None) -> Solution | None:
        """Enter a mechanism and say whether it will do."""
        if found is None:
            self.steps.append(
                Step(mechanism=mechanism, solution=None, value=inf, reason="none keeps the constraints: moved on")
            )
            return None
        solution = found.best
        value = solution.error if self.criterion == "error" else solution.evaluation.worst
        self._met = value <= self.tolerance
        said = f"{self.criterion} {self._told(value)}"
        if self._met:
            reason = f"{said} is within {self._told(self.tolerance)}: taken"
        else:
            reason = (
                f"{said} is {value / self.tolerance:.3g} times the tolerance {self._told(self.tolerance)}: moved on"
            )
        self.steps.append(Step(mechanism=mechanism, solution=solution, value=value, reason=reason))
        return solution

    def _told(self, value: float) -> str:
        angle = isinstance(self.task, RockerFunction)
        if self.criterion == "worst":
            return f"{degrees(value):.4g} deg" if angle else f"{1e3 * value:.4g} mm"
        return f"{np.degrees(np.degrees(value)):.4g} deg2" if angle else f"{1e6 * value:.4g} mm2"

    def result(self) -> Strategy:
        return Strategy(steps=tuple(self.steps), met=self._met, tolerance=self.tolerance, criterion=self.criterion)
