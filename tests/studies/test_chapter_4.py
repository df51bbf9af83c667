"""The figures of chapter IV: the linearised equation and its resonances."""

from __future__ import annotations

import pytest

from analysis.studies.study import LISTING
from tests import published

from .results import check, computed, every


@every("4.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


@pytest.mark.slow
def test_published_numbers() -> None:
    for ratio, values in published.RESONANCE.items():
        found = computed("4.3", f"resonance by the listing as transcribed; I4 = {ratio:g}")
        assert found == pytest.approx(values.thesis, abs=5.1e-5)
        assert computed("4.3", f"resonance; I4 = {ratio:g}", LISTING) == pytest.approx(values.right, abs=5.1e-5)
