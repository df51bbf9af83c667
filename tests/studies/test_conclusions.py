"""The conclusions of Youssef's thesis, sections 8.0 and 9.1."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from analysis.studies.statements import HOLDS, Statement
from analysis.studies.youssef.conclusions_linear import introduction, linearised

from .results import check, expected


@pytest.mark.long
def test_verdicts() -> None:
    check("conclusions")


@pytest.mark.parametrize("part", [introduction, linearised])
def test_verdicts_on_the_linear_equation(part: Callable[[], tuple[Statement, ...]]) -> None:
    """Those that take no run of the mechanism."""
    for s in part():
        (outcome,) = [verdict for quote, verdict in expected("conclusions").items() if s.quote.startswith(quote)] or [
            HOLDS
        ]
        assert s.outcome == outcome, s.quote
