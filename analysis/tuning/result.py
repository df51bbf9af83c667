"""Describe the result of a tuning: parameters before and after, the state of each requirement, and the verification."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..display import NotebookResult, format_count
from ..mechanisms import Parameters
from ..periodic import Crossing
from ..run import parameter_tables
from ..units import display_text
from .conditions import FloatArray
from .survey import AT_THE_END, MARGINAL, Region, Survey
from .wishes import Wish

#: Names of the requirements; a limit is named by its text.
RESONANCE, JUMP, STABLE = "no resonance", "no jump", "stable motion"
#: Greatest violation of a limit, relative to the limit, that is accepted.
NO_EXCESS = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """State of a requirement for one set of parameters.

    Attributes
    ----------
    text : str
        Description, with units, of what was found.
    excess : float
        Amount by which the requirement is missed; zero if the requirement is met. Resonance or jump: distance from the nearer
        end of the range. Second stable motion: width of the range. Missing stable motion: width of the parts of the range
        without a stable motion. Each of these is divided by the middle of the range. Largest multiplier: excess over its bound.
        Limit: excess relative to the limit.
    missed : str
        Description of the excess; empty if the requirement is met.
    """

    text: str
    excess: float = 0.0
    missed: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """A requirement, with its state before and after the change."""

    name: str
    wished: str
    before: Reading
    after: Reading

    @property
    def met(self) -> bool:
        """Whether the requirement is met after the change."""
        return self.after.excess == 0.0


def describe_wish(wish: Wish) -> dict[str, str]:
    """Describe each requirement of a wish, by its name."""
    found: dict[str, str] = {}
    if wish.no_resonance:
        found[RESONANCE] = f"none from {wish.say(*wish.range_with_margin, joint=' to ')}"
    if wish.no_jump:
        found[JUMP] = "none"
    if wish.judges_stability:
        found[STABLE] = f"largest multiplier at most {wish.radius:.6g}"
    found |= {str(limit): f"below {display_text(limit.below, limit.unit)}" for limit in wish.limits}
    return found if wish.judges_stability else found | {STABLE: "one at each place of the range"}


def readings(found: Survey, several: Sequence[float] = ()) -> dict[str, Reading]:
    """Return the state of each requirement of a survey, by name; ``several`` are levels with two stable motions."""
    wish, result = found.wish, {}
    if wish.no_resonance:
        peaks = [(spot.level, spot.level, f"at {wish.say(spot.level)}") for spot in found.peaks]
        result[RESONANCE] = _interval_reading(wish, peaks, wish.range_with_margin)
    if wish.no_jump:
        folds = (region for region in found.regions if region.kind is Crossing.FOLD)
        jumps = [(region.low, region.high, f"between {_ends_text(wish, region)}") for region in folds]
        text = _interval_reading(wish, jumps, wish.span)
        if not jumps and several:
            text = Reading(
                text=f"two stable motions at {wish.say(*several)}",
                excess=(wish.span[1] - wish.span[0]) / wish.size,
                missed=f"at {wish.say(*several)} there is a second stable motion",
            )
        result[JUMP] = text
    if wish.judges_stability:
        value, level = found.largest
        over = value - wish.radius if value > wish.radius + MARGINAL else 0.0
        text_of = f"largest multiplier {value:.7g} at {wish.say(level)}"
        result[STABLE] = Reading(text=text_of, excess=over, missed=f"{text_of}, {over:.3g} too much" if over else "")
    for limit in wish.limits:
        greatest = max((top for top in found.greatest if top.limit is limit), key=lambda top: top.value)
        over = greatest.value / limit.below - 1.0
        over = over if over > NO_EXCESS else 0.0
        text_of = f"{display_text(greatest.value, limit.unit)} at {wish.say(greatest.spot.level)}"
        missed = f"{text_of}, {display_text(greatest.value - limit.below, limit.unit, 3)} too much" if over else ""
        result[str(limit)] = Reading(text=text_of, excess=over, missed=missed)
    if not wish.judges_stability:
        result[STABLE] = _stability_reading(found)
    return result


def _stability_reading(found: Survey) -> Reading:
    """Return the state of the requirement that there is a stable motion everywhere in the range."""
    if not found.unstable:
        return Reading(text="everywhere")
    wish = found.wish
    text = f"none from {', '.join(wish.say(*ends, joint=' to ') for ends in found.unstable)}"
    width = sum(high - low for low, high in found.unstable)
    return Reading(text=text, excess=width / wish.size, missed=text)


def _ends_text(wish: Wish, region: Region) -> str:
    """Return both ends of a region as text; an end at which the branch was followed no further is only a bound."""
    special = [point.parameter for point in (region.first, region.last) if point is not None]
    low, high = (
        wish.say(level) + ("" if any(abs(level - end) < AT_THE_END * wish.size for end in special) else bound)
        for level, bound in ((region.low, " or less"), (region.high, " or more"))
    )
    return f"{low} and {high}"


def _interval_reading(wish: Wish, intervals: Sequence[tuple[float, float, str]], span: tuple[float, float]) -> Reading:
    """Return the state of the requirement that ``span`` overlaps none of ``intervals`` (low, high, description)."""
    if not intervals:
        return Reading(text="none")
    low, high = span
    text = ", ".join(words for _, _, words in intervals)
    away = max(min(b - low, high - a) for a, b, _ in intervals)
    return Reading(text=text, excess=away / wish.size, missed=f"{text}, {wish.say(away)} from the nearer end")


def requirements(before: Survey, after: Survey, several: Sequence[float]) -> tuple[Requirement, ...]:
    """Return each requirement with its state before and after the change."""
    first, last = readings(before), readings(after, several)
    wishes = describe_wish(before.wish).items()
    return tuple(Requirement(name=name, wished=text, before=first[name], after=last[name]) for name, text in wishes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Independent computations with the changed parameters.

    Attributes
    ----------
    orbits : int
        Number of motions of the response over the range.
    charted, largest, place : int, float, str
        Number of points of a stability chart's row over the range, the largest multiplier at these points, and the level at
        which it occurs.
    sought : int
        Number of levels at which all motions were sought.
    several : str
        Levels with more than one stable motion.
    problems : tuple of str
        Failures of the verification; empty if there were none.
    """

    orbits: int
    charted: int
    largest: float
    place: str
    sought: int
    several: str
    problems: tuple[str, ...]

    def __str__(self) -> str:
        chart = f"largest multiplier {self.largest:.6g} at {self.place}"
        several = "at most one stable motion at each"
        if self.several:
            several = f"two stable ones at {self.several}"
        return (
            f"response followed again over {format_count(self.orbits, 'motion')}; row of a chart at {self.charted} points: "
            f"{chart}; all motions sought at {self.sought}: {several}"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuned(NotebookResult):
    """The least change that meets a wish; if no change does, the change with the least sum of excesses.

    Attributes
    ----------
    wish : Wish
    x : ndarray, shape (k,)
        The changes of the parameters in units of their tolerances.
    requirements : tuple of Requirement
    before, after : Survey
        Surveys of the range before and after the change.
    verification : Verification
    rounds : int
        Number of solutions of the nonlinear program, for all combinations of moves that were tried.
    """

    wish: Wish
    x: FloatArray
    requirements: tuple[Requirement, ...]
    before: Survey
    after: Survey
    verification: Verification
    rounds: int

    def __repr__(self) -> str:
        changed = ", ".join(
            f"{n} {a:.6g} -> {b:.6g}" for n, a, b in zip(self.wish.names, self.wish.present, self.values)
        )
        return f"<Tuned: {changed}; {'met' if self.met else 'not met: ' + '; '.join(self.missed)}>"

    @property
    def parameters(self) -> Parameters:
        """Parameters after the change."""
        return self.wish.operation(self.x, self.wish.span[0])[0]

    @property
    def values(self) -> FloatArray:
        """Values of the changed parameters, in the order of ``wish.names``; shape (k,)."""
        return self.wish.present + self.x * self.wish.tolerance

    @property
    def met(self) -> bool:
        """Whether all requirements are met, as far as could be verified."""
        return not self.missed

    @property
    def missed(self) -> tuple[str, ...]:
        """Sentences about requirements that are missed, and about failures of the verification."""
        return (
            *(f"{r.name} is not met: {r.after.missed}" for r in self.requirements if not r.met),
            *(f"not verified: {sentence}" for sentence in self.verification.problems),
        )

    def tables(self) -> dict[str, Any]:
        """Return the result as nested tables, for a file; numbers are in SI."""
        wish, v = self.wish, self.verification
        return {
            "met": self.met,
            "missed": list(self.missed),
            "over": wish.over,
            "between": list(wish.span),
            "changes": {
                name: {"before": before, "after": after, "tolerance": tolerance, "in tolerances": x}
                for name, before, after, tolerance, x in zip(
                    wish.names, *(a.tolist() for a in (wish.present, self.values, wish.tolerance, self.x))
                )
            },
            "requirements": {
                r.name: {"wished": r.wished, "before": r.before.text, "after": r.after.text, "met": r.met}
                for r in self.requirements
            },
            "verification": {
                "orbits": v.orbits,
                "charted": v.charted,
                "largest multiplier": v.largest,
                "its place": v.place,
                "sought": v.sought,
                "several": v.several,
            },
            "parameters": parameter_tables(self.parameters),
        }
