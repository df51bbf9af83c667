"""The figures of chapter V."""

from __future__ import annotations

from . import (
    fig_5_1,
    fig_5_2,
    fig_5_3,
    fig_5_4,
)

#: The studies by number.
STUDIES = {
    study.number: study
    for study in (
        fig_5_1.STUDY,
        fig_5_2.STUDY,
        fig_5_3.STUDY,
        fig_5_4.STUDY,
    )
}
