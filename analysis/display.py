"""Show results in a notebook with a picture, and format ranges and counts."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping
from html import escape
from io import BytesIO
from math import isfinite
from pkgutil import resolve_name

from linkwork.errors import LinkworkError

#: Name of the function that draws a result; results do not import the package that draws them.
PICTURES = "analysis.figures:plot"
#: Pixels per inch of the picture, which is small enough to be stored in a notebook.
DOTS_PER_INCH = 80


class NotebookResult:
    """Base class of results; a notebook shows their `repr`, and a picture below it if there is one."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        text = f"<code>{escape(repr(self))}</code>"
        written = BytesIO()
        try:
            resolve_name(PICTURES)(self).savefig(written, format="png", dpi=DOTS_PER_INCH)
        except LinkworkError as error:
            return f"{text}<br>{escape(str(error))}"
        data = b64encode(written.getvalue()).decode("ascii")
        return f'{text}<br><img alt="{type(self).__name__}" style="max-width: 100%" src="data:image/png;base64,{data}">'


def format_range(values: Iterable[float], unit: str) -> str:
    """Format the range of finite numbers with their unit: "-0.01 to 0.02 m"."""
    finite = [float(value) for value in values if isfinite(value)]
    if not finite:
        return "no finite value"
    low, high = min(finite), max(finite)
    numbers = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return f"{numbers} {unit}".rstrip()


def format_turns(turns: int) -> str:
    """Format a number of turns: "one turn", "2 turns"."""
    return "one turn" if turns == 1 else f"{turns} turns"


def format_rounds(rounds: Mapping[str, int], before: str) -> str:
    """Format the number of full turns of each link: ", swing.angle goes round +1".

    ``rounds`` are the numbers of turns by coordinate; ``before`` precedes the text for each link.
    """
    return "".join(f"{before}{name} goes round {times:+d}" for name, times in rounds.items())


def format_count(count: int, what: str) -> str:
    """Format a count with its noun: "1 branch", "2 branches", "no branches"."""
    several = (
        f"{what}es" if what.endswith(("ch", "s", "x")) else f"{what[:-1]}ies" if what.endswith("y") else f"{what}s"
    )
    return f"1 {what}" if count == 1 else f"{count or 'no'} {several}"
