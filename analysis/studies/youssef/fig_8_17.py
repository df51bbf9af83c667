"""Fig 8.17: whether Coulomb friction in the guide explains what rig 1 does.

The amplitudes that the thesis measures and computes differ, and it blames the Coulomb friction of the guide, which its
equations leave out. Its measured amplitudes are not in the text; the speeds of the maxima and of the minimum are. We look
for a level of friction that brings them.

There is none. Friction that moves one of them to where the thesis has it moves another away or does away with it. The
minimum of spring A would need 1.4 N, its resonance 2.2 N, the local maximum of spring B 7.1 N and its resonance 34.5 N; the
local maximum of spring A, at 296 rpm without friction and at 290 in the thesis, moves up, and it is gone by 2 N. At 1.5 N
the minimum and the resonance of spring A are right to 3 rpm, but the local maxima wrong by 20 and 15. By least squares 1.1
N fit best: they bring the misfit, the root mean square over four speeds, from 3.7 to 3.0 %. With the damping free as well
the fit wants no friction but 15.2 N.s/m in the place of 9, and comes to 2.5 %. And the thesis's speeds contradict each
other: 580 and 1160 rpm as natural frequencies are as 1 to 2, which springs as 3 to 11 on one mass are not.

What friction does: it lowers the maximum at half the natural frequency far more than its share, 1 N by 28 % and the
resonance by 9 %, since small swings feel it most. The resonance moves up from 574 rpm towards the natural frequency of
small swings, 592. With spring B somewhat less than 5 N take away the fold of Fig 8.15, and so the jump with rising speed.
The motion of large amplitude is still there, cut off from the rest: at 1000 rpm it needs 34 N to die out.

The captions are lost: that this stands under this number of 8.14 to 8.17 is our assignment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import Crossing
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, Verdict, at_least, at_most, near, padded
from ._friction import FITTED, RESONANCE_B, about_resonance, fit, misfit, size, speeds, upper_motion
from ._orbits import between, columns_of, curves_over_speed
from ._rig_1 import FASTEST, SLOWEST, natural_speed, slow

NUMBER = "8.17"

#: Levels of friction shown with spring A (N).
LEVELS = (0.0, 1.0, 2.0, 5.0)
#: Levels below and above the one that takes the fold of spring B away (N).
FOLDED, UNFOLDED = 4.5, 5.0
FEATURES = (*FITTED, RESONANCE_B)
READING = (
    "The thesis tells no level of friction. That one level would have to bring all its speeds, to within 5 rpm, and so do away "
    "with their misfit, is our reading of its explanation."
)


def compute() -> StudyResult:
    """Amplitude with each level of friction, the speeds of its maxima and minimum over the friction, and the best fits."""
    columns: dict[str, NDArray[np.float64]] = {}
    for level in LEVELS:
        columns |= columns_of(slow("a", level).branches[0], f"friction {level:g} N")
    alone = []
    for feature in FEATURES:
        levels, places = feature.over_friction()
        columns[f"friction; {feature.name} [N]"] = levels
        columns[f"speed over the thesis's; {feature.name} [1]"] = places / feature.stated
        needed = feature.level(levels, places)
        if needed is not None:
            alone.append(needed)
            columns[f"friction that brings it there; {feature.name} [N]"] = np.array([needed])
    friction, both = fit(False), fit(True)
    columns["friction of the best fit [N]"] = friction.x
    columns["friction of the best fit with free damping [N]"] = both.x[:1]
    columns["damping of the best fit with free damping [N.s/m]"] = both.x[1:]
    without = size(misfit(speeds(0.0)))
    upper = upper_motion()
    end = upper.special[0]
    columns["friction; large motion of spring B at 1000 rpm [N]"] = upper.parameter
    columns["amplitude; large motion of spring B at 1000 rpm [cm]"] = CM_PER_METRE * upper.amplitude
    return StudyResult(
        number=NUMBER,
        claim="Coulomb friction in the guide makes the measured amplitudes differ from the computed ones.",
        assignment=f"{ASSIGNED} {READING}",
        columns=padded(columns),
        verdicts=(
            *_fitted("friction that fits best", speeds(*friction.x)),
            *_fitted("friction and damping that fit best", speeds(*both.x)),
            near("misfit left by the friction that fits best", TEXT, 0.0, size(friction.fun) / without, 0.1),
            near("the same with the damping free", TEXT, 0.0, size(both.fun) / without, 0.1),
            near("levels that bring one speed each, greatest less least", TEXT, 0.0, float(np.ptp(alone)), 0.5, "N"),
            *_effects(),
            near("folds of spring B from below with 4.5 N", OURS, 1.0, _folds(FOLDED), 0.0),
            near("folds of spring B from below with 5 N", OURS, 0.0, _folds(UNFOLDED), 0.0),
            at_least("friction up to which its large motion lives on", OURS, UNFOLDED, end.parameter, "N"),
        ),
    )


def _fitted(what: str, found: NDArray[np.float64]) -> list[Verdict]:
    """Speed by speed, whether a fit brings what the thesis has."""
    return [
        near(f"{feature.name}, with the {what}", TEXT, feature.stated, speed, 5.0, "rpm")
        for feature, speed in zip(FITTED, found)
    ]


def _effects() -> list[Verdict]:
    """That friction lowers the maxima, the one at half the natural frequency most, and moves the resonance up."""
    resonances = [between(slow("a", level).maxima(), 550.0, 620.0) for level in LEVELS]
    halves = [between(slow("a", level).maxima(), 280.0, 340.0)[1] for level in LEVELS[:2]]
    places, peaks = np.array(resonances).T
    left = halves[1] / halves[0] * peaks[0] / peaks[1]
    return [
        at_least("drop of the resonance per level, least; spring A", OURS, 0.0, -np.diff(peaks).max(), "cm"),
        at_most("what 1 N leaves of the local maximum, relative to the resonance; spring A", OURS, 1.0, left),
        at_least("rise of the resonance by 5 N; spring A", OURS, 0.0, places[-1] - places[0], "rpm"),
    ]


def _folds(friction: float) -> int:
    return sum(special.kind is Crossing.FOLD for special in about_resonance(friction).branches[0].special)


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed, one curve a level; and how the speeds stand to the thesis's."""
    natural = natural_speed("a")
    amplitudes = [
        curve
        for level, colour in zip(LEVELS, COLOURS)
        for curve in curves_over_speed(result, f"friction {level:g} N", colour, f"{level:g} N")
    ]
    ratios = [
        Curve(
            x=result.columns[f"friction; {feature.name} [N]"],
            y=result.columns[f"speed over the thesis's; {feature.name} [1]"],
            label=f"{feature.name}, {feature.stated:g} rpm",
            marker="o",
        )
        for feature in FEATURES
    ]
    ratios.append(Curve(x=(0.0, 40.0), y=(1.0, 1.0), label="the thesis", line="--", colour="0.35"))
    panels = [
        Panel(
            x_label="crank speed [rpm]",
            y_label="amplitude of u [cm]",
            title="spring A",
            curves=amplitudes,
            verticals={f"half of it, {natural / 2:.0f}": natural / 2, f"natural frequency, {natural:.0f}": natural},
            legend="Coulomb friction",
            legend_at="upper right",
            x_range=(SLOWEST, FASTEST),
            y_range=(0.0, 4.5),
        ),
        Panel(
            x_label="Coulomb friction [N]",
            y_label="speed / that of the thesis",
            title="each would need another friction",
            curves=ratios,
            x_range=(0.0, 40.0),
            y_range=(0.88, 1.18),
            legend_at="upper right",
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(5.0, 3.9))


STUDY = Study(NUMBER, compute, draw)
