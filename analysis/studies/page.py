"""Write the Markdown page of a thesis: figures with plots and statements, and the number of statements."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from ..figures import Figure, resize
from . import ENTRIES, STUDIES, file_stem, load
from .statements import FAILS, HOLDS, IN_PART, OUTCOMES, TEXT, UNJUDGED, Statement, shortened

#: Folder of the plots beside the page, width of a plot (inches and pixels), and greatest size of its file (bytes).
PLOTS, WIDTH_IN, WIDTH_PX, MOST_BYTES = "theses", 6.4, 480, 30_000
#: A plot at least this wide (in) has three panels side by side.
THREE_PANELS = 11.0
#: Pattern of a statement on a page; its groups are the quote, the kind of source, the place in the thesis and the verdict.
_STATEMENT = re.compile(
    rf"^> (.*)\n> \((text|program), (.*)\)\n\n(?:Measured: .*\n\n)?\*\*({'|'.join(OUTCOMES)})\*\*",
    flags=re.MULTILINE | re.IGNORECASE,
)


def figures(numbers: Iterable[str], folder: Path) -> str:
    """Compute the figures with these numbers and return their Markdown text; the plots go into ``folder``.

    A figure that only shows a mechanism or an apparatus has only its title and place. An assignment that several figures share
    is printed with the first of them.
    """
    lines: list[str] = []
    for number in numbers:
        entry = ENTRIES[number]
        if number not in STUDIES:
            lines += [f"### Fig {number}  {entry.title}", "", f"Nothing to compute ({entry.place}).", ""]
            continue
        study = load(number)
        result = study.compute()
        where = f" ({entry.place})" if entry.place else ""
        lines += [f"### {result.heading}", "", f"{result.claim}{where}", ""]
        if result.assignment and f"*{result.assignment}*" not in lines:
            lines += [f"*{result.assignment}*", ""]
        if study.draw:
            plot = f"{PLOTS}/{file_stem(number).removeprefix('fig_')}.webp"
            save_small(study.draw(result), folder / plot)
            lines += [f"![{result.heading}]({plot})", ""]
        lines += [f"`linkwork figures {number}`", ""]
        if result.see:
            lines += [f"Statements that concern it are judged at Fig{'s' * (' and R' in result.see)} {result.see}.", ""]
        for statement in result.statements:
            lines += block(statement)
    return "\n".join(lines)


def block(statement: Statement) -> Iterator[str]:
    """Yield a statement's lines in Markdown: quote, place, measure, tolerance, verdict, and a table if it has several cases."""
    source, cases = statement.source, statement.cases
    kind = "text" if source.kind == TEXT else "program"
    yield from (f"> {statement.quote}", f"> ({kind}, {source.place})", "")
    if cases:
        yield from (f"Measured: {statement.measure}. Tolerance: {statement.tolerance}.", "")
    reason = f": {statement.reason}" if statement.reason else ""
    yield from (f"**{statement.outcome.capitalize()}**{reason}.", "")
    if len(cases) > 1:
        yield "| case | stated | allowed | computed | |\n| --- | --- | --- | --- | --- |"
        for case in cases:
            why = f": {case.why}" if statement.reasons_differ and not case.holds and case.why else ""
            outcome = case.outcome if case.holds else f"**{case.outcome}**{why}"
            # a bar would end a cell of the table
            cells = [x.replace("|", "\\|") for x in (case.label, case.expected, case.allowed, case.found, outcome)]
            yield f"| {' | '.join(cells)} |"
        yield ""


def save_small(figure: Figure, path: Path) -> None:
    """Save a plot at the page's width, in the best quality that keeps the file within `MOST_BYTES`.

    A plot with three panels side by side keeps its greater width, because narrower panels could not be read.
    """
    path.parent.mkdir(exist_ok=True)
    width, height = figure.get_size_inches()
    if width < THREE_PANELS:
        # panels beside each other need more height for their labels
        resize(figure, WIDTH_IN, height * WIDTH_IN / width * (1.15 if width > 8.0 else 1.0))
    for quality in (80, 60, 40, 20):
        figure.savefig(path, dpi=WIDTH_PX / WIDTH_IN, format="webp", pil_kwargs={"quality": quality, "method": 6})
        if path.stat().st_size <= MOST_BYTES:
            return


def quotes(page: str) -> list[tuple[str, str]]:
    """Return the quote and the verdict of each statement on a page."""
    return [(quote, outcome.lower()) for quote, _, _, outcome in _STATEMENT.findall(page)]


def sentences(page: str) -> dict[str, list[str]]:
    """Return, for each study on a page, its statements, and the figures at which further statements on it are judged.

    The keys are the studies' numbers. Each statement is shortened and has its place in the thesis.
    """
    _, *parts = re.split(r"^`linkwork figures (\S+)`$", page, flags=re.MULTILINE)
    return {
        number: [f"judged at {see}" for see in re.findall(r"are judged at Figs? (.+)\.$", part, flags=re.MULTILINE)]
        + [f'"{shortened(quote)}" ({place})' for quote, _, place, _ in _STATEMENT.findall(part)]
        for number, part in zip(parts[::2], parts[1::2])
    }


def count(page: str) -> str:
    """Return a sentence that counts the statements on a page by verdict."""
    found = _STATEMENT.findall(page)
    number = Counter(outcome.lower() for *_, outcome in found)
    listed = sum(kind == "program" for _, kind, *_ in found)
    origin = f"{listed} of them come from its program when it is run, the others from its text."
    return (
        f"Of {len(found)} statements of the thesis {number[HOLDS]} hold, {number[IN_PART]} hold in part, "
        f"{number[FAILS]} do not hold, and {number[UNJUDGED]} cannot be judged, each with the reason. "
        f"{origin if listed else 'All are judged from its text; its program is missing in our copy.'}"
    )
