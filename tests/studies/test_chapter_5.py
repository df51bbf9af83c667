"""The figures of chapter V: regions of instability."""

from __future__ import annotations

from .results import check_plot_and_data, check_verdicts, every

#: What the thesis states and the right physics does not bear out.
REFUTED = {
    *(
        ("5.1", f"{side} boundary in lambda_k^2; I4 = {ratio}")
        for side in ("lower", "upper")
        for ratio in ("0.5", "1", "1.5")
    ),
    ("5.2", "damping that removes the region up to I4 = 1.5"),
    ("5.2", "the same, by the thesis's own equation"),
}
#: Studies whose results take more than a second or two.
LONG = {"5.1", "5.2", "5.3", "5.4"}


@every("5.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED)


@every("5.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)
