"""The conclusions of Youssef's thesis, sections 8.0 and 9.1."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from analysis.studies.statements import HOLDS, Statement
from analysis.studies.youssef.conclusions_linear import judge_introduction, judge_linearised
from analysis.studies.youssef.conclusions_motion import decay, maxima_spacings, ranges_of_turns

from .results import check, expected


@pytest.mark.long
def test_verdicts() -> None:
    check("conclusions")


@pytest.mark.parametrize("part", [judge_introduction, judge_linearised])
def test_verdicts_on_the_linear_equation(part: Callable[[], Iterable[Statement]]) -> None:
    """Those that take no run of the mechanism."""
    for s in part():
        (outcome,) = [verdict for quote, verdict in expected("conclusions").items() if s.quote.startswith(quote)] or [
            HOLDS
        ]
        assert s.outcome == outcome, s.quote


def test_spacings_are_those_of_the_maxima_between_the_samples() -> None:
    angle = np.linspace(0.0, 30.0, 700)
    assert maxima_spacings(angle, np.cos(0.9 * angle)) == pytest.approx(400.0, abs=0.01)


def test_the_transient_of_a_launch_is_no_decay() -> None:
    """The ranges of u (cm) in the turns from the third on, by Lagrange's equation derived automatically and LSODA."""
    earlier = (1.100, 1.100, 1.097, 1.097, 1.097, 1.097, 1.097, 1.097, 1.096, 1.095, 1.093)
    later = (1.090, 1.085, 1.079, 1.069, 1.058, 1.043, 1.024, 1.002, 0.976, 0.948, 0.916)
    assert ranges_of_turns(1e8, 1e6, 3e4) == pytest.approx(np.array(earlier + later), abs=1e-3)
    assert decay(1e8, 1e6, 3e4) == pytest.approx(sum(later) / sum(earlier), abs=1e-3)
