"""The figures of chapter VI: synthesis of four-bars."""

from __future__ import annotations

from .results import check_plot_and_data, check_verdicts, every

#: What the thesis states and the right physics does not bear out.
REFUTED = {
    *((number, "error of the printed linkage") for number in ("6.4", "6.5", "6.6", "6.7", "6.8", "6.9")),
    ("6.7", "error of the printed linkage; N = 48"),
}
#: Studies whose results take more than a second or two.
LONG = {"6.7", "6.8", "6.9", "6.10"}


@every("6.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED)


@every("6.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)
