"""The figures of chapter III."""

from __future__ import annotations

from . import (
    fig_3_2,
    fig_3_3,
    fig_3_4,
    fig_3_5,
    fig_3_6,
    fig_3_7,
    fig_3_8,
    fig_3_9,
    fig_3_10,
    fig_3_11,
    fig_3_12,
    fig_3_13,
    fig_3_14,
)

#: The studies by number.
STUDIES = {
    study.number: study
    for study in (
        fig_3_2.STUDY,
        fig_3_3.STUDY,
        fig_3_4.STUDY,
        fig_3_5.STUDY,
        fig_3_6.STUDY,
        fig_3_7.STUDY,
        fig_3_8.STUDY,
        fig_3_9.STUDY,
        fig_3_10.STUDY,
        fig_3_11.STUDY,
        fig_3_12.STUDY,
        fig_3_13.STUDY,
        fig_3_14.STUDY,
    )
}
