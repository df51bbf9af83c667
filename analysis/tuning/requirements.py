"""What was wished, requirement by requirement: what there is of it, and by how much it is missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..mechanisms import mechanism_of
from .survey import MARGINAL, Survey
from .wish import AMPLITUDE, Limit, Wish

#: Names of the requirements; that of a limit is its text.
RESONANCE, JUMP, STABLE = "no resonance", "no jump", "stable motion"
#: Violation of a limit, relative to it, that counts as none.
NO_EXCESS = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What there is of a requirement with some parameters.

    Attributes
    ----------
    text : str
        In words, with units.
    excess : float
        By how much it is missed: of places how far they are from the nearer end, relative to the range's middle, of the largest
        multiplier as it is, of a limit relative to it. Zero where it is met.
    missed : str
        The same in words; empty where it is met.
    """

    text: str
    excess: float = 0.0
    missed: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """A requirement, with what there is of it before and after the change."""

    name: str
    wished: str
    before: Reading
    after: Reading

    @property
    def met(self) -> bool:
        """Whether it is met after the change."""
        return self.after.excess == 0.0


def wished(wish: Wish) -> dict[str, str]:
    """The requirements of a wish and what each asks for, in words."""
    found: dict[str, str] = {}
    if wish.no_resonance:
        found[RESONANCE] = "none"
    if wish.no_jump:
        found[JUMP] = "none"
    if wish.judged:
        found[STABLE] = f"largest multiplier at most {wish.radius:.6g}"
    return found | {str(limit): f"below {limit.below:.6g} {unit(wish, limit)}" for limit in wish.limits}


def unit(wish: Wish, limit: Limit) -> str:
    """Unit of what a limit bounds."""
    mechanism, name = mechanism_of(wish.parameters), limit.output.removeprefix(AMPLITUDE)
    units = {v.name: v.unit for v in mechanism.variables}
    return units[name] if name in units else units[f"{name}.fx"]


def readings(found: Survey, several: Sequence[float] = ()) -> dict[str, Reading]:
    """What there is of each requirement; ``several`` are places at which two stable motions were found."""
    wish, result = found.wish, {}
    if wish.no_resonance:
        result[RESONANCE] = _of_levels(wish, [(s.level, s.level) for s in found.peaks], "at {}")
    if wish.no_jump:
        jumps = [(region.low, region.high) for region in found.folds]
        text = _of_levels(wish, jumps, "between {}")
        if not jumps and several:
            text = Reading(
                text=f"two stable motions at {wish.say(*several)}",
                excess=(wish.span[1] - wish.span[0]) / wish.size,
                missed=f"at {wish.say(*several)} there is a second stable motion",
            )
        result[JUMP] = text
    if wish.judged:
        value, level = found.largest
        over = value - wish.radius if value > wish.radius + MARGINAL else 0.0
        text_of = f"largest multiplier {value:.7g} at {wish.say(level)}"
        result[STABLE] = Reading(text=text_of, excess=over, missed=f"{text_of}, {over:.3g} too much" if over else "")
    for limit in wish.limits:
        greatest = max((top for top in found.greatest if top.limit is limit), key=lambda top: top.value)
        what = unit(wish, limit)
        over = greatest.value / limit.below - 1.0
        over = over if over > NO_EXCESS else 0.0
        text_of = f"{greatest.value:.6g} {what} at {wish.say(greatest.spot.level)}"
        missed = f"{text_of}, {greatest.value - limit.below:.3g} {what} too much" if over else ""
        result[str(limit)] = Reading(text=text_of, excess=over, missed=missed)
    return result


def _of_levels(wish: Wish, intervals: Sequence[tuple[float, float]], words: str) -> Reading:
    """Of what should not lie in the range, by its intervals."""
    if not intervals:
        return Reading(text="none")
    low, high = wish.span
    text = ", ".join(words.format(wish.say(a) if a == b else f"{wish.say(a)} and {wish.say(b)}") for a, b in intervals)
    away = max(min(b - low, high - a) for a, b in intervals)
    return Reading(text=text, excess=away / wish.size, missed=f"{text}, {wish.say(away)} from the nearer end")


def requirements(before: Survey, after: Survey, several: Sequence[float]) -> tuple[Requirement, ...]:
    """Each requirement before and after the change."""
    first, last = readings(before), readings(after, several)
    return tuple(
        Requirement(name=name, wished=text, before=first[name], after=last[name])
        for name, text in wished(before.wish).items()
    )
