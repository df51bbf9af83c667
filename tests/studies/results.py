"""Compute the results of the studies once for all their tests, and check what must be true of each study."""

import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from analysis import studies
from analysis.studies.statements import HOLDS, LISTING, OUTCOMES, TEXT, Statement
from analysis.studies.study import StudyResult

#: Statements that do not simply hold, by study: the beginning of the quote, and the verdict.
VERDICTS = tomllib.loads(Path(__file__).with_name("verdicts.toml").read_text(encoding="utf-8"))
#: Studies whose results take more than a second or two.
LONG = {
    *("3.2", "4.2", "4.3", "4.4", "4.6", "4.7", "5.1", "5.2", "5.3", "5.4", "6.2", "6.7", "6.8", "6.9", "6.10", "6.11"),
    *("7.2", "7.5"),
    *(f"7.{n}" for n in range(6, 13)),
    *(f"8.{n}" for n in (*range(7, 12), *range(13, 22))),
    *("rig-1-resonance", "rig-1-friction", "rig-2-forces", "rahman-closure", "rahman-rates"),
}
#: Studies of `LONG` that take half a minute and more.
LONGEST = {"6.2", "8.16", "8.19", "8.21", "rig-1-resonance", "rig-1-friction", "rahman-closure"}


@cache
def result(number: str) -> StudyResult:
    """Return the result of a study; it is computed once in a process."""
    return studies.load(number).compute()


def statement(number: str, beginning: str) -> Statement:
    """Return the statement of a study whose quote begins with ``beginning``."""
    (found,) = (s for s in result(number).statements if s.quote.startswith(beginning))
    return found


def every(*beginnings: str) -> pytest.MarkDecorator:
    """Parametrise a test over the studies whose numbers begin with one of the texts; long studies are marked slow or long."""
    numbers = [n for n in studies.STUDIES if n.startswith(beginnings)]
    return pytest.mark.parametrize("number", [pytest.param(n, marks=marks_of(n)) for n in numbers])


def marks_of(number: str) -> tuple[pytest.MarkDecorator, ...]:
    """Return the marks of a test that needs the result of a study: slow, long or none."""
    return (pytest.mark.long,) if number in LONGEST else (pytest.mark.slow,) if number in LONG else ()


def expected(number: str) -> dict[str, str]:
    """Return the verdicts of a study that are not "holds", by the beginning of the quote."""
    return dict(VERDICTS.get(number, {}))


def check(number: str) -> None:
    """Check the verdicts, the plot and the data of a study."""
    check_verdicts(number)
    check_plot_and_data(number)


def check_verdicts(number: str) -> None:
    """Check that the statements that do not simply hold are those in `VERDICTS`, and that all statements are complete."""
    found = result(number).statements
    for s in found:
        assert s.source.kind in (TEXT, LISTING)
        assert "L" in s.source.place
        assert s.cases == () or (s.measure and s.tolerance), s.quote
        assert s.outcome == HOLDS or s.why or all(case.why for case in s.cases if not case.holds), s.quote
        assert all(case.computed is None or np.isfinite(case.computed) for case in s.cases)
        assert len({case.label for case in s.cases}) == len(s.cases)
        assert len([other for other in found if other.quote.startswith(s.quote)]) == 1
    verdicts = {quote: statement(number, quote).outcome for quote in expected(number)}
    assert verdicts == expected(number)
    assert set(verdicts.values()) <= set(OUTCOMES) - {HOLDS}
    assert len(verdicts) == sum(s.outcome != HOLDS for s in found), [s.quote for s in found if s.outcome != HOLDS]


def check_plot_and_data(number: str) -> None:
    """Check that the plot has a heading, labels and curves, and that the data columns have one length and units."""
    study, found = studies.load(number), result(number)
    assert found.claim
    if study.draw is None:
        assert not found.columns
        return
    figure = study.draw(found)
    titles = (figure.get_suptitle(), figure.axes[0].get_title())
    assert found.heading.split() in [title.split() for title in titles], "but for the breaks of its lines"
    assert (found.heading == f"Fig {number}  {studies.STUDIES[number]}") == studies.is_figure(number)
    for axis in figure.axes if number != "linkage" else ():
        assert axis.get_xlabel()
        assert axis.get_ylabel()
        assert axis.lines
    assert len({len(column) for column in found.columns.values()}) == 1
    for name in found.columns:
        assert name.endswith("]"), f"{name} has no unit"
        assert "," not in name
