"""Verdicts as rows of a table, of the chapters that are not yet told as `statements`.

To be deleted, with the lines that name it in `study`, `page`, `cli.runs`, `tests.studies.results` and `tests.test_docs`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .statements import FAILS, HOLDS, LISTING, TEXT, UNJUDGED, Source

#: Our own derivations and checks.
OURS = Source("ours", "")

_HEADINGS = "| statement | source | where | stated | computed | verdict |\n| --- | --- | --- | --- | --- | --- |"
#: A row of a table of verdicts: its source and its verdict.
_ROW = re.compile(
    rf"^\| .* \| ({TEXT}|{LISTING}|{OURS.kind}) \| .* \| \**({HOLDS}|{FAILS}|{UNJUDGED})\** \|$", flags=re.MULTILINE
)


def table(verdicts: Iterable[Verdict]) -> list[str]:
    """Return the lines of a table of verdicts."""
    lines = [_HEADINGS]
    for v in verdicts:
        computed = "; ".join(part for part in (v.found, v.why) if part)
        outcome = v.outcome if v.holds else f"**{v.outcome}**"
        lines.append(f"| {v.statement} | {v.source.kind} | {v.source.place} | {v.expected} | {computed} | {outcome} |")
    return [*lines, ""] if lines[1:] else []


def rows(page: str) -> list[tuple[str, str]]:
    """Return source and verdict of each row of the thesis's on a page."""
    return [(source, outcome) for source, outcome in _ROW.findall(page) if source != OURS.kind]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Stated result beside the computed one; it holds if ``computed`` lies from ``lower`` to ``upper``.

    Attributes
    ----------
    statement : str
        The statement in words, without its number.
    source : Source
    stated, computed : float or None
        The two values in ``unit``; None where the statement cannot be judged.
    lower, upper : float
        Range that the source supports.
    why : str
        Reason why the statement cannot be judged, or why it fails.
    """

    statement: str
    source: Source
    stated: float | None = None
    computed: float | None = None
    lower: float = -np.inf
    upper: float = np.inf
    unit: str = ""
    why: str = ""

    def __str__(self) -> str:
        source = self.source.words if self.source.place else "our own check"
        if self.computed is None:
            return f"{self.statement} ({source}): {UNJUDGED}: {self.why}"
        outcome = HOLDS if self.holds else f"{FAILS.upper()}{self.why and f': {self.why}'}"
        return f"{self.statement}: {self.expected} ({source}), computed {self.found}: {outcome}"

    @property
    def expected(self) -> str:
        """The stated value with its unit, and whether it is a bound; empty where there is none."""
        if self.stated is None:
            return ""
        bound = "at most " if np.isneginf(self.lower) else "at least " if np.isposinf(self.upper) else ""
        return f"{bound}{self.stated:.6g} {self.unit}".rstrip()

    @property
    def found(self) -> str:
        """The computed value with its unit; empty where there is none."""
        return "" if self.computed is None else f"{self.computed:.6g} {self.unit}".rstrip()

    @property
    def holds(self) -> bool:
        """Whether the computed value is in the range."""
        return self.computed is not None and bool(self.lower <= self.computed <= self.upper)

    @property
    def outcome(self) -> str:
        """`HOLDS`, `FAILS` or `UNJUDGED`."""
        return UNJUDGED if self.computed is None else HOLDS if self.holds else FAILS


def near(
    statement: str, source: Source, stated: float, computed: float, tolerance: float, unit: str = "", *, why: str = ""
) -> Verdict:
    """Judge a value that is stated to within a tolerance."""
    bounds = {"lower": stated - tolerance, "upper": stated + tolerance}
    return _judged(statement, source, stated, computed, unit, why, **bounds)


def at_least(
    statement: str, source: Source, stated: float, computed: float, unit: str = "", *, why: str = ""
) -> Verdict:
    """Judge a value that is stated as a lower bound."""
    return _judged(statement, source, stated, computed, unit, why, lower=stated)


def at_most(
    statement: str, source: Source, stated: float, computed: float, unit: str = "", *, why: str = ""
) -> Verdict:
    """Judge a value that is stated as an upper bound."""
    return _judged(statement, source, stated, computed, unit, why, upper=stated)


def _judged(
    statement: str, source: Source, stated: float, computed: float, unit: str, why: str, **bounds: float
) -> Verdict:
    return Verdict(
        statement=statement, source=source, stated=stated, computed=float(computed), unit=unit, why=why, **bounds
    )


def unjudged(statement: str, source: Source, why: str) -> Verdict:
    """Record a statement that cannot be judged, with the reason."""
    return Verdict(statement=statement, source=source, why=why)
