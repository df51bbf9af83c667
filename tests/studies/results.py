"""What the tests of all studies share: their results, and what must be true of each."""

from __future__ import annotations

from collections.abc import Container
from functools import cache
from importlib import import_module

import numpy as np
import pytest

from analysis import studies
from analysis.studies.study import LISTING, OURS, TEXT, UNJUDGED, StudyResult

#: The files of tests that have the statements that do not hold, and those that cannot be judged.
FILES = (*(f"test_chapter_{n}" for n in range(3, 9)), "test_rahman")

#: A statement: the number of its study, and its words.
Statement = tuple[str, str]


@cache
def result(number: str) -> StudyResult:
    """A study's result, computed once in a process."""
    return studies.load(number).compute()


def computed(number: str, statement: str, source: str = OURS) -> float:
    """The computed value beside a statement."""
    (verdict,) = (v for v in result(number).verdicts if v.statement == statement and v.source == source)
    return verdict.computed


def every(chapter: str, long: Container[str] = ()) -> pytest.MarkDecorator:
    """A parameter: the numbers of a chapter's studies; those whose result takes more than a second or two are slow tests."""
    numbers = [n for n in studies.STUDIES if n.startswith(chapter)]
    return pytest.mark.parametrize(
        "number", [pytest.param(n, marks=pytest.mark.slow) if n in long else n for n in numbers]
    )


def tables(name: str) -> set[Statement]:
    """The statements of all files of tests in their tables of a name: REFUTED or UNJUDGED."""
    return set().union(*(getattr(import_module(f"{__package__}.{file}"), name, ()) for file in FILES))


def check_verdicts(number: str, refuted: set[Statement], cannot: set[Statement] = frozenset()) -> None:
    """What fails and what cannot be judged is what the tables say, and all of it is the thesis's."""
    verdicts = result(number).verdicts
    unjudged = [v for v in verdicts if v.outcome == UNJUDGED]
    assert {(number, v.statement) for v in unjudged} == {entry for entry in cannot if entry[0] == number}
    assert all(v.why for v in unjudged)
    failed = [v for v in verdicts if not v.holds and v not in unjudged]
    assert {(number, v.statement) for v in failed} == {entry for entry in refuted if entry[0] == number}
    assert all(v.source in (TEXT, LISTING) for v in (*failed, *unjudged))
    assert all(v.source in (TEXT, LISTING, OURS) for v in verdicts)
    assert all(np.isfinite(v.computed) for v in verdicts if v not in unjudged)


def check_plot_and_data(number: str) -> None:
    """A heading, labels and curves in the plot; columns of one length with units."""
    study, found = studies.load(number), result(number)
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
    assert found.claim
