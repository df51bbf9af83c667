"""Fig 7.10: smoothness of the slider's motion traded against the error of the weighted rocker function.

A slider that must be accelerated hard takes force, and wears. The greatest |d2u/dphi2| is bounded more and more tightly, and
the best motion is sought anew each time, from the one before: a curve from which a designer can choose. It leads from the
motions of Fig 7.6 to the fixed pivot. A third harmonic pays only where 2 cm/rad2 and more are allowed.

Whether the thesis shows this is lost: that it stands under this number is our assignment, and the bounds are our choice.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...motion import SmoothnessCurve, smoothness_curve
from ...synthesis import Search, SliderUnknown, evaluate
from ...synthesis.published import PROBLEMS
from ..study import OURS, Study, StudyResult, at_least, at_most
from ._chapter_7 import ASSIGNED, ROCKER, TARGET, TURN, over_turn, rocker_motion, shown, slider, sound

NUMBER = "7.10"
HARMONICS = (2, 3)
#: Bounds of |d2u/dphi2| (cm/rad2), and those whose motions are shown.
BOUNDS = (0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 15.0)
SHOWN = (0.5, 2.0, 5.0)
STARTS = 8


@cache
def curve(harmonics: int) -> SmoothnessCurve:
    """The best motion at each bound."""
    p = PROBLEMS[ROCKER]
    return smoothness_curve(
        p.task,
        p.linkage,
        SliderUnknown(harmonics=harmonics),
        np.array(BOUNDS) / CM_PER_METRE,
        search=Search(starts=STARTS),
    )


def compute() -> StudyResult:
    """Both curves, the fixed pivot, and the unbounded motions."""
    p = PROBLEMS[ROCKER]
    fixed = p.convert(evaluate(p.task, p.linkage).error)
    columns = {"crank rotation [deg]": np.degrees(TURN)}
    fill = np.full(TURN.size - len(BOUNDS), np.nan)
    verdicts = []
    for n in HARMONICS:
        found = curve(n)
        error, attained = p.convert(1.0) * found.error, CM_PER_METRE * found.attained
        columns[f"bound; {n} harmonics [cm/rad2]"] = np.append(BOUNDS, fill)
        columns[f"greatest acceleration; {n} harmonics [cm/rad2]"] = np.append(attained.filled(np.nan), fill)
        columns[f"error; {n} harmonics [deg2]"] = np.append(error.filled(np.nan), fill)
        solutions = [s for s in found.solutions if s is not None]
        verdicts += [
            at_least(f"bounds with a motion; {n} harmonics", OURS, len(BOUNDS), len(solutions)),
            at_most(f"greatest acceleration over its bound; {n} harmonics", OURS, 1.01, (attained / BOUNDS).max()),
            at_most(
                f"greatest growth of the error as the bound is loosened; {n} harmonics",
                OURS,
                1e-6,
                np.diff(error).max(),
                "deg2",
            ),
            at_most(f"error at the tightest bound, of the fixed pivot's; {n} harmonics", OURS, 1.0, error[0] / fixed),
            at_most(
                f"error at the loosest bound, of that without; {n} harmonics",
                OURS,
                1.01,
                error[-1] / shown(ROCKER, rocker_motion(n)),
            ),
            sound(f"no circuit, branch or order defect; {n} harmonics", *solutions),
        ]
    for bound in SHOWN:
        solution = curve(2).solutions[BOUNDS.index(bound)]
        assert solution is not None
        columns[f"slider; bound {bound:g} cm/rad2 [cm]"] = CM_PER_METRE * slider(solution.linkage).series(TURN)
    return StudyResult(
        number=NUMBER,
        claim="The motion of the slider must be smooth; smoothness is bought with error.",
        assignment=ASSIGNED,
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The curves, and motions of two harmonics along theirs."""
    c = result.columns
    curves = [
        Curve(
            x=c[f"greatest acceleration; {n} harmonics [cm/rad2]"],
            y=c[f"error; {n} harmonics [deg2]"],
            label=f"{n} harmonics",
            marker="o",
            colour=colour,
        )
        for n, colour in zip(HARMONICS, COLOURS)
    ]
    curves.append(Curve(x=[0.16, 16.0], y=[35.84, 35.84], label="pivot fixed", colour=TARGET, line="--"))
    panels = [
        Panel(
            x_label="greatest |d$^2$u/d\N{GREEK SMALL LETTER PHI}$^2$| [cm/rad$^2$]",
            y_label="weighted error [deg$^2$]",
            curves=curves,
            logarithmic="xy",
            x_ticks=(0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
            legend_at="outside",
        ),
        over_turn(
            result,
            {f"slider; bound {bound:g} cm/rad2 [cm]": f"2 harmonics, {bound:g} cm/rad$^2$" for bound in SHOWN},
            "slider position u [cm]",
            colours=COLOURS[2:],
        ),
    ]
    return plot_curves(panels, title=result.heading, size=(7.6, 3.2))


STUDY = Study(NUMBER, compute, draw)
