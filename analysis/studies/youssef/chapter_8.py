"""The figures of chapter VIII."""

from __future__ import annotations

from . import (
    fig_8_7,
    fig_8_8,
    fig_8_9,
    fig_8_10,
    fig_8_11,
    fig_8_12,
    fig_8_13,
    fig_8_14,
    fig_8_15,
    fig_8_16,
    fig_8_17,
    fig_8_18,
    fig_8_19,
    fig_8_20,
    fig_8_21,
)

#: The studies by number.
STUDIES = {
    study.number: study
    for study in (
        fig_8_7.STUDY,
        fig_8_8.STUDY,
        fig_8_9.STUDY,
        fig_8_10.STUDY,
        fig_8_11.STUDY,
        fig_8_12.STUDY,
        fig_8_13.STUDY,
        fig_8_14.STUDY,
        fig_8_15.STUDY,
        fig_8_16.STUDY,
        fig_8_17.STUDY,
        fig_8_18.STUDY,
        fig_8_19.STUDY,
        fig_8_20.STUDY,
        fig_8_21.STUDY,
    )
}
