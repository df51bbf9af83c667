"""Search for the simplest mechanism that meets a tolerance (thesis, section 7.4).

The search first tries a four-bar. Then a slider moves the rocker pivot of the four-bar, with more and more harmonics; links and
motion are optimised together. Last come five-bars: their rocker pivot is on a second crank, which is geared to the first crank
or turned independently. Each step starts from earlier solutions, and records why its mechanism was accepted or rejected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, inf, isfinite
from typing import Literal

from linkwork.errors import InputError, Interrupted

from .. import synthesis as syn
from ..display import format_count
from ..units import Amount, in_si, si

Criterion = Literal["error", "worst"]

#: Default gear ratios to be tried: turns of the second crank per turn of the first.
RATIOS = (1, -1, 2, -2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One mechanism that the search has tried, with the result.

    Attributes
    ----------
    mechanism : str
        Description of the mechanism.
    solution : Solution or None
        Best solution of the mechanism; None if there is none.
    value : float
        Quality function or worst error, whichever is compared with the tolerance; infinite if there is no solution.
    reason : str
        Reason why the mechanism was accepted or rejected.
    """

    mechanism: str
    solution: syn.Solution | None
    value: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strategy:
    """Result of `simplest_mechanism`: the mechanisms tried, in order of simplicity, and the chosen one.

    Attributes
    ----------
    steps : tuple of Step
    met : bool
        Whether the last step meets the tolerance, with no circuit, branch or order defect.
    tolerance : float
        Greatest allowed value of the criterion, in the unit of the criterion.
    criterion : str
        "error" (the quality function) or "worst" (the worst error).
    """

    steps: tuple[Step, ...]
    met: bool
    tolerance: float
    criterion: str

    @property
    def chosen(self) -> Step:
        """Return the step that meets the tolerance or, if none does, the best step.

        The best step has the least `Step.value` among the steps without defects, or among all steps if all have defects.
        """
        if self.met:
            return self.steps[-1]
        return min(self.steps, key=lambda s: (s.solution is None or not s.solution.verdicts.sound, s.value))

    def __str__(self) -> str:
        return "\n".join(f"{step.mechanism}: {step.reason}" for step in self.steps)


class StrategyInterrupted(Interrupted):
    """Error of a search that was stopped with Ctrl-C; ``strategy`` holds the steps so far, or is None if there is none."""

    def __init__(self, strategy: Strategy | None) -> None:
        self.strategy = strategy
        super().__init__(f"stopped after {format_count(len(strategy.steps) if strategy else 0, 'mechanism')}")


@in_si(bounds=syn.UNITS, stroke="m", second_crank="m")
def simplest_mechanism(
    task: syn.Task,
    tolerance: Amount,
    *,
    criterion: Criterion = "error",
    bounds: Mapping[str, tuple[Amount, Amount]] | None = None,
    constraints: Sequence[syn.Constraint] = syn.USUAL,
    stroke: Amount = None,
    harmonics: int = 3,
    ratios: Sequence[int] = RATIOS,
    second_crank: Amount = None,
    search: syn.Search = syn.QUICK_SEARCH,
) -> Strategy:
    """Find the simplest mechanism whose error is within a tolerance, without circuit, branch or order defect.

    Parameters
    ----------
    task : Task
    tolerance : float
        Bound of the quality function (m2, rad2), or of the worst error (m, rad; for a `Motion`, angles times its ``length``).
    criterion : "error" or "worst"
        Whether the quality function or the worst error is compared with the tolerance. With "worst", the search also minimises
        the worst error.
    bounds, constraints
        Bounds and constraints of the links of every mechanism, as for `synthesize`.
    stroke : float, optional
        Greatest stroke of the slider (m); half the ground link of the best four-bar by default.
    harmonics : int
        Greatest number of harmonics of the slider, and of an independent second crank.
    ratios : sequence of int
        Gear ratios to be tried: turns of the second crank per turn of the first.
    second_crank : float, optional
        Greatest length of the second crank (m); half the stroke by default.
    search : Search
        Settings of the search for each mechanism; the four-bar has twice as many starts.

    Returns
    -------
    Strategy

    Raises
    ------
    InputError
        If the tolerance or another number is invalid.
    InfeasibleError
        If no four-bar satisfies the constraints.
    StrategyInterrupted
        On Ctrl-C, with the steps so far.
    """
    if criterion not in ("error", "worst"):
        raise InputError(f"criterion {criterion!r}: it must be 'error' or 'worst'")
    unit = ("rad" if isinstance(task, syn.RockerFunction) else "m") + "**2" * (criterion == "error")
    tolerance = si(tolerance, unit, "tolerance")
    if not (isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance is {tolerance}: it must be a finite number greater than zero")
    for name, value in (("harmonics", harmonics), ("starts", search.starts)):
        if not (float(value).is_integer() and value >= 1):
            raise InputError(f"{value} {name}: it must be a whole number, at least one")
    for name, length in (("stroke", stroke), ("length of the second crank", second_crank)):
        if length is not None and not (isfinite(length) and length > 0.0):
            raise InputError(f"greatest {name} is {length} m: it must be a finite number greater than zero")
    for ratio in ratios:
        if not (isfinite(ratio) and ratio == int(ratio)):
            raise InputError(f"ratio {ratio} of the gears: it must be a whole number, or the path does not close")
    if criterion == "worst":
        # the worst error is also minimised
        task = replace(task, objective="worst")
    tried = _Trials(task, tolerance, criterion, bounds, constraints, search)
    four_bar = tried.find_four_bar()
    if tried.meets_tolerance():
        return tried.result()
    numbers = range(1, int(harmonics) + 1)
    reach = 0.5 * four_bar.linkage.ground_length if stroke is None else stroke
    guesses = [four_bar]
    for count in numbers:
        slider = syn.SliderUnknown(harmonics=count, stroke=reach)
        found = tried.attempt(f"four-bar with a moved slider, {format_count(count, 'harmonic')}", slider, guesses)
        if tried.meets_tolerance():
            return tried.result()
        guesses += [found] if found else []
    longest = 0.5 * reach if second_crank is None else second_crank
    between = (min(1e-3 * reach, 0.5 * longest), longest)
    geared: dict[int, syn.Solution] = {}
    for ratio in ratios:
        crank = syn.CrankUnknown(ratio=ratio, length=between)
        found = tried.attempt(f"five-bar, second crank geared {ratio}:1", crank, [four_bar])
        if tried.meets_tolerance():
            return tried.result()
        if found:
            geared[ratio] = found
    # the second crank is turned independently, starting from the best gears
    ratio = min(geared, key=lambda r: geared[r].value, default=1)
    guesses = [geared.get(ratio, four_bar)]
    for count in numbers:
        crank = syn.CrankUnknown(ratio=ratio, length=between, harmonics=count)
        found = tried.attempt(
            f"five-bar, second crank turned independently, {format_count(count, 'harmonic')}", crank, guesses
        )
        if tried.meets_tolerance():
            break
        guesses += [found] if found else []
    return tried.result()


@dataclass(eq=False)
class _Trials:
    """State of the search: the mechanisms tried so far, as ``steps``, and the arguments of `simplest_mechanism`."""

    task: syn.Task
    tolerance: float
    criterion: Criterion
    bounds: Mapping[str, tuple[float, float]] | None
    constraints: Sequence[syn.Constraint]
    search: syn.Search
    steps: list[Step] = field(default_factory=list)
    _met: bool = False

    def meets_tolerance(self) -> bool:
        """Return whether the last mechanism meets the tolerance without a defect."""
        return self._met

    def find_four_bar(self) -> syn.Solution:
        """Find the best four-bar with a fixed pivot, record it and return it."""
        search = replace(self.search, starts=2 * int(self.search.starts))
        solution = self._record("four-bar", self._run_search("four-bar", search))
        assert solution is not None
        return solution

    def attempt(
        self, mechanism: str, unknown: syn.SliderUnknown | syn.CrankUnknown, guesses: Sequence[syn.Solution]
    ) -> syn.Solution | None:
        """Optimise links and pivot motion together, record the result and return the best solution; None if there is none."""
        try:
            found = self._run_search(mechanism, self.search, unknown, guesses)
        except syn.InfeasibleError:
            found = None
        return self._record(mechanism, found)

    def _run_search(
        self,
        mechanism: str,
        search: syn.Search,
        pivot: syn.SliderUnknown | syn.CrankUnknown | None = None,
        guesses: Sequence[syn.Solution] = (),
    ) -> syn.Synthesis:
        try:
            return syn.synthesize(self.task, self.bounds, self.constraints, pivot=pivot, guesses=guesses, search=search)
        except (syn.SynthesisInterrupted, KeyboardInterrupt) as error:
            if isinstance(error, syn.SynthesisInterrupted) and error.synthesis is not None:
                self._record(mechanism, error.synthesis)
            raise StrategyInterrupted(self.result() if self.steps else None) from None

    def _record(self, mechanism: str, found: syn.Synthesis | None) -> syn.Solution | None:
        """Record a mechanism and why it is accepted or rejected; return its best solution, None if there is no solution."""
        if found is None:
            reason = "no solution satisfies the constraints: rejected"
            self.steps.append(Step(mechanism=mechanism, solution=None, value=inf, reason=reason))
            return None
        solution = found.best
        value = solution.error if self.criterion == "error" else solution.evaluation.worst
        defects = " and ".join(f"a {defect}" for defect in solution.verdicts.defects)
        within = value <= self.tolerance
        self._met = within and not defects
        compared = "within" if within else f"{value / self.tolerance:.3g} times the tolerance"
        reason = f"{self.criterion} {self._text(value)} is {compared} {self._text(self.tolerance)}"
        reason += f", with {defects}" if defects else ""
        reason += ": accepted" if self._met else ": rejected" if found.complete else ": stopped"
        self.steps.append(Step(mechanism=mechanism, solution=solution, value=value, reason=reason))
        return solution

    def _text(self, value: float) -> str:
        unit = "deg" if isinstance(self.task, syn.RockerFunction) else "mm"
        scale = degrees(1.0) if unit == "deg" else 1e3
        return f"{scale * value:.4g} {unit}" if self.criterion == "worst" else f"{scale * scale * value:.4g} {unit}2"

    def result(self) -> Strategy:
        return Strategy(steps=tuple(self.steps), met=self._met, tolerance=self.tolerance, criterion=self.criterion)
