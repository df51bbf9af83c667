"""The simplest mechanism that meets a tolerance (thesis, section 7.4).

A four-bar first; if its best is not good enough, a four-bar whose rocker pivot is moved by a slider, harmonic by harmonic,
links and motion optimised together; then five-bars, whose rocker pivot is on a second crank, geared to the first or turned
independently. Each step starts from the one before, and says why it was not the last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, inf, isfinite
from typing import Literal

import numpy as np

from linkwork.errors import InputError, Interrupted

from ..synthesis.constraints import USUAL, Constraint, InfeasibleError
from ..synthesis.program import CrankUnknown, SliderUnknown
from ..synthesis.report import DEFECTS
from ..synthesis.solution import Solution
from ..synthesis.solve import Synthesis, SynthesisInterrupted, synthesize
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
        Whether the last step meets the tolerance, with no circuit, branch or order defect.
    tolerance : float
    criterion : str
    """

    steps: tuple[Step, ...]
    met: bool
    tolerance: float
    criterion: str

    @property
    def chosen(self) -> Step:
        """The step that meets the tolerance; without one, the simplest of those that come nearest, if any without a defect."""
        if self.met:
            return self.steps[-1]
        return min(self.steps, key=lambda s: (s.solution is None or not s.solution.verdicts.sound, s.value))

    def __str__(self) -> str:
        return "\n".join(f"{step.mechanism}: {step.reason}" for step in self.steps)


class StrategyInterrupted(Interrupted):
    """A search for the simplest mechanism was stopped; ``strategy`` holds the steps so far, or is None if there are none."""

    def __init__(self, strategy: Strategy | None) -> None:
        self.strategy = strategy
        super().__init__(f"stopped after {len(strategy.steps) if strategy else 0} mechanisms")


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
    """The simplest mechanism without a circuit, branch or order defect whose error is within a tolerance.

    Parameters
    ----------
    task : Task
    tolerance : float
        Of the quality function (m2; of a rocker function rad2), or of the worst error (m, of a motion with its errors of angle
        times its length; rad).
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
    StrategyInterrupted
        On Ctrl-C, with the steps so far.
    """
    if not (isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance is {tolerance}: it must be a finite number greater than zero")
    if criterion not in ("error", "worst"):
        raise InputError(f"criterion {criterion!r}: it must be 'error' or 'worst'")
    for name, value in (("harmonics", harmonics), ("starts", starts)):
        if not (float(value).is_integer() and value >= 1):
            raise InputError(f"{value} {name}: it must be a whole number, at least one")
    for name, length in (("stroke", stroke), ("length of the second crank", second_crank)):
        if length is not None and not (isfinite(length) and length > 0.0):
            raise InputError(f"greatest {name} is {length} m: it must be a finite number greater than zero")
    for ratio in ratios:
        if not (isfinite(ratio) and ratio == int(ratio)):
            raise InputError(f"ratio {ratio} of the gears: it must be a whole number, or the path does not close")
    harmonics = int(harmonics)
    search = _Search(task, tolerance, criterion, bounds, constraints, int(starts), seed, n_jobs, progress)
    four_bar = search.first()
    if search.met():
        return search.result()
    ground = four_bar.linkage.ground_length
    reach = 0.5 * ground if stroke is None else stroke
    guesses = [four_bar]
    for count in range(1, harmonics + 1):
        slider = SliderUnknown(harmonics=count, stroke=reach)
        words = f"four-bar with a moved slider, {count} harmonic{'s' if count > 1 else ''}"
        found = search.attempt(words, slider, guesses)
        if search.met():
            return search.result()
        guesses += [found] if found else []
    longest = 0.5 * reach if second_crank is None else second_crank
    between = (min(1e-3 * reach, 0.5 * longest), longest)
    geared: dict[int, Solution] = {}
    for ratio in ratios:
        crank = CrankUnknown(ratio=ratio, length=between)
        words = f"five-bar, second crank geared {ratio}:1"
        found = search.attempt(words, crank, [four_bar])
        if search.met():
            return search.result()
        if found:
            geared[ratio] = found
    # from the best gears on, the second crank is turned by itself
    ratio = min(geared, key=lambda r: geared[r].error, default=1)
    guesses = [geared.get(ratio, four_bar)]
    for count in range(1, harmonics + 1):
        crank = CrankUnknown(ratio=ratio, length=between, harmonics=count)
        words = f"five-bar, second crank turned independently, {count} harmonic{'s' if count > 1 else ''}"
        found = search.attempt(words, crank, guesses)
        if search.met():
            break
        guesses += [found] if found else []
    return search.result()


@dataclass(eq=False)
class _Search:
    """The steps so far; fields as the arguments of `simplest_mechanism`."""

    task: Task
    tolerance: float
    criterion: Criterion
    bounds: Mapping[str, tuple[float, float]] | None
    constraints: Sequence[Constraint]
    starts: int
    seed: int
    n_jobs: int
    progress: bool
    steps: list[Step] = field(default_factory=list)
    _met: bool = False

    def met(self) -> bool:
        """Whether the last mechanism will do."""
        return self._met

    def first(self) -> Solution:
        """The best four-bar."""
        solution = self._step("four-bar", self._found("four-bar", 2 * self.starts, None, ()))
        assert solution is not None
        return solution

    def attempt(
        self, mechanism: str, unknown: SliderUnknown | CrankUnknown, guesses: Sequence[Solution]
    ) -> Solution | None:
        """Links and the pivot's motion together, from a scan and from simpler mechanisms."""
        try:
            found = self._found(mechanism, self.starts, unknown, guesses)
        except InfeasibleError:
            found = None
        return self._step(mechanism, found)

    def _found(
        self, mechanism: str, starts: int, pivot: SliderUnknown | CrankUnknown | None, guesses: Sequence[Solution]
    ) -> Synthesis:
        try:
            return synthesize(
                self.task,
                self.bounds,
                self.constraints,
                seed=self.seed,
                pivot=pivot,
                guesses=guesses,
                starts=starts,
                n_jobs=self.n_jobs,
                progress=self.progress,
            )
        except (SynthesisInterrupted, KeyboardInterrupt) as error:
            if isinstance(error, SynthesisInterrupted) and error.synthesis is not None:
                self._step(mechanism, error.synthesis)
            raise StrategyInterrupted(self.result() if self.steps else None) from None

    def _step(self, mechanism: str, found: Synthesis | None) -> Solution | None:
        """Enter a mechanism and say whether it will do."""
        if found is None:
            self.steps.append(
                Step(mechanism=mechanism, solution=None, value=inf, reason="none keeps the constraints: moved on")
            )
            return None
        solution = found.best
        value = solution.error if self.criterion == "error" else solution.evaluation.worst
        defects = " and ".join(f"a {name} defect" for name in DEFECTS if not getattr(solution.verdicts, name))
        within = value <= self.tolerance
        self._met = within and not defects
        said = f"{self.criterion} {self._told(value)}"
        reason = (
            f"{said} is within {self._told(self.tolerance)}"
            if within
            else f"{said} is {value / self.tolerance:.3g} times the tolerance {self._told(self.tolerance)}"
        )
        reason += f", with {defects}" if defects else ""
        reason += ": taken" if self._met else ": moved on" if found.complete else ": stopped"
        self.steps.append(Step(mechanism=mechanism, solution=solution, value=value, reason=reason))
        return solution

    def _told(self, value: float) -> str:
        angle = isinstance(self.task, RockerFunction)
        if self.criterion == "worst":
            return f"{degrees(value):.4g} deg" if angle else f"{1e3 * value:.4g} mm"
        return f"{np.degrees(np.degrees(value)):.4g} deg2" if angle else f"{1e6 * value:.4g} mm2"

    def result(self) -> Strategy:
        return Strategy(steps=tuple(self.steps), met=self._met, tolerance=self.tolerance, criterion=self.criterion)
