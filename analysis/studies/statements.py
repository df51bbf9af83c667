"""Statements of a thesis with their verdicts: place, what is measured, tolerance, and cases."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from typing import NamedTuple, SupportsFloat

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: Kinds of sources: the thesis's text, and its program when run.
TEXT, LISTING = "text", "listing"
#: Size below which computed values are rounding errors.
ROUNDING_ERROR = 1e-9
#: Possible verdicts.
HOLDS, IN_PART, FAILS, UNJUDGED = OUTCOMES = ("holds", "holds in part", "does not hold", "cannot be judged")


def shortened(quote: str) -> str:
    """Cut a quote at the end of a word so that it fits a line of a terminal."""
    return quote if len(quote) <= 120 else f"{quote[:100].rsplit(' ', 1)[0]} ..."


class Source(NamedTuple):
    """Source of a statement: its kind, and its place in the thesis (section, lines L of the scanned text)."""

    kind: str
    place: str

    @property
    def words(self) -> str:
        """Return the source in words that need no explanation, such as "the thesis, 3.2.1, line 1905"."""
        place = re.sub(r"\bL(?=\d)", "line ", self.place)
        return f"{'the thesis' if self.kind == TEXT else 'the program of the thesis'}, {place}"


def listing(place: str) -> Source:
    """Return the source of a statement that the program of a listing prints."""
    return Source(LISTING, place)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Case of a statement: a computed value with the range in which the statement holds.

    The case holds if ``computed`` lies from ``lower`` to ``upper``.

    Attributes
    ----------
    label : str
        Name of the case within the statement.
    stated : str
        Number as the thesis prints it; empty if the thesis gives it in words. Never a tolerance of ours.
    computed : float or None
        Computed value; None if the case cannot be judged.
    lower, upper : float
        Range that the statement allows, with its tolerance.
    why : str
        Reason why the case fails or cannot be judged.
    """

    label: str
    stated: str = ""
    computed: float | None
    lower: float = -np.inf
    upper: float = np.inf
    unit: str = ""
    why: str = ""

    @property
    def holds(self) -> bool:
        """Return whether the computed value is in the allowed range."""
        return self.computed is not None and bool(self.lower <= self.computed <= self.upper)

    @property
    def outcome(self) -> str:
        """Return the verdict on the case: `HOLDS`, `FAILS` or `UNJUDGED`."""
        return UNJUDGED if self.computed is None else HOLDS if self.holds else FAILS

    @property
    def expected(self) -> str:
        """Return the stated number with its unit; empty if the thesis states no number."""
        return f"{self.stated} {self.unit}".rstrip() if self.stated else ""

    @property
    def allowed(self) -> str:
        """Return the allowed range in words."""
        low, high = (f"{bound:.6g}" for bound in (self.lower, self.upper))
        if self.computed is None or self.lower == self.upper:
            return low if self.computed is not None else ""
        if np.isneginf(self.lower):
            return f"at most {high}"
        return f"at least {low}" if np.isposinf(self.upper) else f"{low} to {high}"

    @property
    def numbers(self) -> list[str]:
        """Return the stated, allowed and computed values in words."""
        named = (("stated", self.expected), ("allowed", self.allowed), ("computed", self.found))
        return [f"{name} {value}" for name, value in named if value]

    @property
    def found(self) -> str:
        """Return the computed value with unit, to four digits or one more than the stated number; empty if there is none.

        A rounding error, below `ROUNDING_ERROR`, has one digit.
        """
        if self.computed is None:
            return ""
        digits = max(4, 1 + len(re.sub(r"e.*|\D", "", self.stated).lstrip("0")))
        return f"{self.computed:.{1 if abs(self.computed) < ROUNDING_ERROR else digits}g} {self.unit}".rstrip()


def near(
    label: str,
    stated: str | float,
    computed: SupportsFloat,
    tolerance: float | None = None,
    unit: str = "",
    *,
    why: str = "",
) -> Case:
    """Return a case that holds if the computed value equals the stated value within a tolerance.

    ``stated`` is a text if the thesis prints the number, and a number if the thesis gives it in words. By default the
    tolerance is half a unit of the last printed digit.
    """
    value = float(stated)
    if tolerance is None:
        tolerance = 0.5 * 10.0 ** int(Decimal(str(stated)).as_tuple().exponent)
    return _case(label, stated, computed, unit, why, lower=value - tolerance, upper=value + tolerance)


def at_least(label: str, stated: str | float, computed: SupportsFloat, unit: str = "", *, why: str = "") -> Case:
    """Return a case that holds if the computed value is at least the stated one; for ``stated`` see `near`."""
    return _case(label, stated, computed, unit, why, lower=float(stated))


def at_most(label: str, stated: str | float, computed: SupportsFloat, unit: str = "", *, why: str = "") -> Case:
    """Return a case that holds if the computed value is at most the stated one; for ``stated`` see `near`."""
    return _case(label, stated, computed, unit, why, upper=float(stated))


def within(label: str, lower: float, upper: float, computed: SupportsFloat, unit: str = "", *, why: str = "") -> Case:
    """Return a case that holds if the computed value is in a range that the thesis gives in words."""
    return _case(label, "", computed, unit, why, lower=lower, upper=upper)


def unjudged(label: str, why: str) -> Case:
    """Return a case that cannot be judged, with the reason."""
    return Case(label=label, computed=None, why=why)


def _case(label: str, stated: str | float, computed: SupportsFloat, unit: str, why: str, **bounds: float) -> Case:
    printed = stated if isinstance(stated, str) else ""
    return Case(label=label, stated=printed, computed=float(computed), unit=unit, why=why, **bounds)


@dataclass(frozen=True, slots=True)
class Statement:
    """Sentence of the thesis with its verdict.

    Attributes
    ----------
    quote : str
        The sentence exactly as printed: slips of the scan are mended in square brackets, an ellipsis marks omissions.
    source : Source
    measure, tolerance : str
        What is measured; the tolerance and where it comes from. Empty if the statement cannot be judged.
    cases : tuple of Case
        Empty if the statement cannot be judged.
    why : str
        Reason for the verdict. It is needed unless the statement holds or its cases have their own reasons.
    """

    quote: str
    source: Source
    measure: str
    tolerance: str
    cases: tuple[Case, ...]
    why: str

    @property
    def outcome(self) -> str:
        """Return the verdict on the statement, one of `OUTCOMES`; it holds in part if some of its cases hold."""
        if all(case.computed is None for case in self.cases):
            return UNJUDGED
        holding = [case.holds for case in self.cases]
        return HOLDS if all(holding) else IN_PART if any(holding) else FAILS

    @property
    def reason(self) -> str:
        """Return the reason for the verdict: the numbers of a single case, or how many cases hold and why the others do not."""
        parts = []
        if len(self.cases) == 1:
            parts += self.cases[0].numbers
        elif self.outcome == IN_PART:
            parts.append(f"{sum(case.holds for case in self.cases)} of {len(self.cases)} cases")
        shared = {case.why for case in self.cases if not case.holds}
        parts += shared if len(shared) == 1 else ()
        return "; ".join(part for part in (*parts, self.why) if part)

    @property
    def reasons_differ(self) -> bool:
        """Return whether the cases fail for different reasons, so that each case needs its own reason."""
        return len({case.why for case in self.cases if not case.holds}) > 1

    def __str__(self) -> str:
        outcome = self.outcome if self.outcome == HOLDS else self.outcome.upper()
        lines = [f'"{shortened(self.quote)}" ({self.source.words})', f"  {outcome}{self.reason and f': {self.reason}'}"]
        for case in self.cases if len(self.cases) > 1 else ():
            why = [case.why] if self.reasons_differ and not case.holds else []
            lines.append("; ".join([f"    {case.label}: {case.outcome}", *case.numbers, *why]))
        return "\n".join(lines)


def statement(
    quote: str, place: str | Source, measure: str = "", tolerance: str = "", *cases: Case, why: str = ""
) -> Statement:
    """Return a sentence of the thesis with its cases; ``place`` is in the thesis's text, unless it is a `listing`."""
    source = Source(TEXT, place) if isinstance(place, str) else place
    return Statement(quote, source, measure, tolerance, cases, why)
