"""Markdown page of a thesis: each figure, a table of its verdicts, and a count of them at the head."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

from . import ENTRIES, STUDIES, load
from .study import FAILS, HOLDS, LISTING, OURS, TEXT, UNJUDGED

_HEADINGS = "| statement | source | where | stated | computed | verdict |\n| --- | --- | --- | --- | --- | --- |"
#: A row of a table of verdicts: its source and its verdict.
_ROW = re.compile(
    rf"^\| .* \| ({TEXT}|{LISTING}|{OURS.kind}) \| .* \| \**({HOLDS}|{FAILS}|{UNJUDGED})\** \|$", flags=re.MULTILINE
)


def figures(numbers: Iterable[str]) -> str:
    """Compute the figures of these numbers and return them in Markdown.

    A figure that only shows a mechanism or an apparatus has its title alone. An assignment shared by several figures is
    printed with the first.
    """
    lines: list[str] = []
    for number in numbers:
        entry = ENTRIES[number]
        if number not in STUDIES:
            lines += [f"### Fig {number}  {entry.title}", "", f"Nothing to compute ({entry.place}).", ""]
            continue
        result = load(number).compute()
        where = f" ({entry.place})" if entry.place else ""
        lines += [f"### {result.heading}", "", f"{result.claim}{where}", ""]
        if result.assignment and f"*{result.assignment}*" not in lines:
            lines += [f"*{result.assignment}*", ""]
        lines += [f"`linkwork figures {number}`", "", _HEADINGS]
        for v in result.verdicts:
            computed = "; ".join(part for part in (v.found, v.why) if part)
            outcome = v.outcome if v.holds else f"**{v.outcome}**"
            lines.append(
                f"| {v.statement} | {v.source.kind} | {v.source.place} | {v.expected} | {computed} | {outcome} |"
            )
        lines.append("")
    return "\n".join(lines)


def count(page: str) -> str:
    """Return a sentence with the number of statements on a page that hold, fail or cannot be judged, and of our checks."""
    found = Counter(_ROW.findall(page))
    thesis = {outcome: found[TEXT, outcome] + found[LISTING, outcome] for outcome in (HOLDS, FAILS, UNJUDGED)}
    listing = sum(number for (source, _), number in found.items() if source == LISTING)
    ours = sum(number for (source, _), number in found.items() if source == OURS.kind)
    return (
        f"Of {sum(thesis.values())} statements of the thesis {thesis[HOLDS]} hold, {thesis[FAILS]} do not, and "
        f"{thesis[UNJUDGED]} cannot be judged, each with the reason. {listing} of them come from its program when it is run, "
        f"the others from its text. Of {ours} checks of ours {found[OURS.kind, HOLDS]} hold."
    )
