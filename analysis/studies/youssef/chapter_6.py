"""The figures of chapter VI."""

from __future__ import annotations

from . import (
    fig_6_4,
    fig_6_5,
    fig_6_6,
    fig_6_7,
    fig_6_8,
    fig_6_9,
    fig_6_10,
    fig_6_11,
)

#: The studies by number.
STUDIES = {
    study.number: study
    for study in (
        fig_6_4.STUDY,
        fig_6_5.STUDY,
        fig_6_6.STUDY,
        fig_6_7.STUDY,
        fig_6_8.STUDY,
        fig_6_9.STUDY,
        fig_6_10.STUDY,
        fig_6_11.STUDY,
    )
}
