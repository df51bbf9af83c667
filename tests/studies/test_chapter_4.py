"""The figures of chapter IV: the linearised equation and its resonances."""

from __future__ import annotations

from .results import check_plot_and_data, check_verdicts, every

#: What the thesis states and the right physics does not bear out.
REFUTED = {
    *(("4.3", f"resonance; I4 = {ratio}") for ratio in ("0.5", "1", "1.5")),
    *(("4.6", f"shift by the crank; I4 = {ratio}") for ratio in ("0.5", "1", "1.5")),
}
#: Studies whose results take more than a second or two.
LONG = {"4.4", "4.5", "4.7"}


@every("4.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED)


@every("4.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)
