"""The figures of chapter IV: the linearised equation and its resonances."""

from __future__ import annotations

import pytest

from analysis.studies.study import LISTING
from tests import published

from .results import check_plot_and_data, check_verdicts, computed, every

#: What the thesis states and the right physics does not bear out.
REFUTED = {
    *(("4.3", f"resonance; I4 = {ratio}") for ratio in ("0.5", "1", "1.5")),
    *(("4.3", f"distance of the resonance below omega_k; I4 = {ratio}") for ratio in ("1", "1.5")),
    ("4.4", "range of speeds near omega_k / 2 in which the second harmonic is greater than the first, widest"),
    ("4.4", "second harmonic at its resonance; I4 = 1, omega_c = 0.45 1/s"),
    *((number, "shift of the peak from omega_c = 0.2 to 1.2 1/s") for number in ("4.6", "4.7")),
}
#: Studies whose results take more than a second or two.
LONG = {"4.3", "4.4", "4.6", "4.7"}


@every("4.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED)


@every("4.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)


@pytest.mark.slow
def test_published_numbers() -> None:
    for ratio, values in published.RESONANCE.items():
        found = computed("4.3", f"resonance by the listing as transcribed; I4 = {ratio:g}")
        assert found == pytest.approx(values.thesis, abs=5.1e-5)
        assert computed("4.3", f"resonance; I4 = {ratio:g}", LISTING) == pytest.approx(values.right, abs=5.1e-5)
