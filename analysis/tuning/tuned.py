"""What came of a wish: the parameters before and after, requirement by requirement, and what was verified."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..display import Shown, format_count
from ..mechanisms import Parameters
from ..run import parameters_to
from .places import FloatArray
from .requirements import Requirement
from .survey import Survey
from .wish import Wish


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """What was computed anew with the changed parameters.

    Attributes
    ----------
    orbits : int
        Of the response that was followed over the range.
    charted, largest, place : int, float, str
        Points of a chart's row over the range, the largest multiplier there, and where.
    sought : int
        Places at which all motions were sought.
    several : str
        Those with more than one stable motion.
    problems : tuple of str
        What could not be followed or verified; empty where everything was.
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
        several = "one stable motion at most at each"
        if self.several:
            several = f"two stable ones at {self.several}"
        return (
            f"response followed anew over {format_count(self.orbits, 'motion')}; row of a chart at {self.charted} points: "
            f"{chart}; all motions sought at {self.sought}: {several}"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuned(Shown):
    """The least change after which a range of speeds is as it was wished; or, where none is, what comes nearest.

    Attributes
    ----------
    wish : Wish
    x : ndarray, shape (k,)
        The changes in their tolerances.
    requirements : tuple of Requirement
    before, after : Survey
    verification : Verification
    rounds : int
        Times that the program was solved, over all ways that were tried.
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
        """After the change."""
        return self.wish.operation(self.x, self.wish.span[0])[0]

    @property
    def values(self) -> FloatArray:
        """Of what may be changed, after it; shape (k,)."""
        return self.wish.present + self.x * self.wish.tolerance

    @property
    def met(self) -> bool:
        """Whether all of the wish is met, as far as could be verified."""
        return not self.missed

    @property
    def missed(self) -> tuple[str, ...]:
        """What is not met and by how much, a sentence each, and what could not be verified."""
        return (
            *(f"{r.name} cannot be met: {r.after.missed}" for r in self.requirements if not r.met),
            *self.verification.problems,
        )

    def tables(self) -> dict[str, Any]:
        """Everything as nested tables, for a file; numbers in SI."""
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
            "parameters": parameters_to(self.parameters),
        }
