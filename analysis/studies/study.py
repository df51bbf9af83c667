"""The parts of a study (claim, computed columns, picture, verdicts) and how one is run."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..figures import Curve, Figure
from ..files import save_figure, write_csv
from . import STUDIES, file_stem, is_figure

#: Kinds of sources: the thesis's text, and its program when run.
TEXT, LISTING = "text", "listing"
#: What a verdict may be.
HOLDS, FAILS, UNJUDGED = "holds", "does not hold", "cannot be judged"


class Source(NamedTuple):
    """Source of a statement: its kind, and its place in the thesis (section, lines L of the scanned text)."""

    kind: str
    place: str = ""

    @property
    def words(self) -> str:
        """The source as a reader without the documentation understands it."""
        kinds = {TEXT: "the thesis", LISTING: "the thesis's program"}
        place = re.sub(r"\bL(?=\d)", "line ", self.place)
        return ", ".join(part for part in (kinds.get(self.kind, "our own check"), place) if part)


#: Our own derivations and checks.
OURS = Source("ours")


def text(place: str) -> Source:
    """Return a place in the thesis's text as a source."""
    return Source(TEXT, place)


def listing(place: str) -> Source:
    """Return the thesis's program when run as a source."""
    return Source(LISTING, place)


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
        source = self.source.words
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


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyResult:
    """Result of a study: what is claimed, the data of the plot, and the verdicts.

    Attributes
    ----------
    number : str
        Number of the thesis's figure, or name of a picture.
    claim : str
        Claim or content of the figure, as far as the thesis's text tells.
    assignment : str
        Our choices in the figure, because the caption is lost; empty if there are none.
    columns : mapping
        Data of the plot by name with unit; all of one length, padded with NaN.
    verdicts : tuple of Verdict
    """

    number: str
    claim: str
    assignment: str = ""
    columns: Mapping[str, NDArray[np.float64]]
    verdicts: tuple[Verdict, ...]

    @property
    def title(self) -> str:
        """Title in the list of studies."""
        return STUDIES[self.number]

    @property
    def heading(self) -> str:
        """Heading of the plot: the figure's number and title."""
        return f"Fig {self.number}  {self.title}" if is_figure(self.number) else self.title


@dataclass(frozen=True, slots=True)
class Study:
    """Figure of a thesis: functions that compute, draw and, for some, animate it."""

    number: str
    compute: Callable[[], StudyResult]
    draw: Callable[[StudyResult], Figure]
    animate: Callable[[StudyResult, Path], Path] | None = None

    def make(self, out: str | Path = "out") -> tuple[StudyResult, tuple[Path, ...]]:
        """Compute it and write ``fig_<number>.png`` and ``.csv`` into a folder; returns the result and the paths."""
        result = self.compute()
        stem = Path(out) / file_stem(self.number)
        paths = [
            save_figure(self.draw(result), stem.with_suffix(".png")),
            write_csv(stem.with_suffix(".csv"), result.columns),
        ]
        if self.animate:
            paths.append(self.animate(result, stem.with_suffix(".gif")))
        return result, tuple(paths)


def padded(columns: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.float64]]:
    """Pad columns with NaN to the length of the longest."""
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    length = max(len(values) for values in arrays.values())
    return {name: np.append(v, np.full(length - len(v), np.nan)) for name, v in arrays.items()}


def curves_of(result: StudyResult, x: str, names: Mapping[str, str]) -> list[Curve]:
    """Return columns of a result as curves over the column ``x``; ``names`` maps each column to its label."""
    return [Curve(x=result.columns[x], y=result.columns[name], label=label) for name, label in names.items()]
