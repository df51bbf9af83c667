"""The figures of chapter VII."""

from __future__ import annotations

from . import (
    fig_7_2,
    fig_7_3,
    fig_7_4,
    fig_7_5,
    fig_7_6,
    fig_7_7,
    fig_7_8,
    fig_7_9,
    fig_7_10,
    fig_7_11,
    fig_7_12,
)

#: The studies by number.
STUDIES = {
    study.number: study
    for study in (
        fig_7_2.STUDY,
        fig_7_3.STUDY,
        fig_7_4.STUDY,
        fig_7_5.STUDY,
        fig_7_6.STUDY,
        fig_7_7.STUDY,
        fig_7_8.STUDY,
        fig_7_9.STUDY,
        fig_7_10.STUDY,
        fig_7_11.STUDY,
        fig_7_12.STUDY,
    )
}
