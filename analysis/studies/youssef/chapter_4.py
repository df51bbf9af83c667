"""The figures of chapter IV."""

from __future__ import annotations

from . import (
    fig_4_3,
    fig_4_4,
    fig_4_5,
    fig_4_6,
    fig_4_7,
)

#: The studies by number.
STUDIES = {
    study.number: study
    for study in (
        fig_4_3.STUDY,
        fig_4_4.STUDY,
        fig_4_5.STUDY,
        fig_4_6.STUDY,
        fig_4_7.STUDY,
    )
}
