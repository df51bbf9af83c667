"""Fig 3.2: the slider without a spring drifts.

The thesis takes the spring away (k = 0), drives Table 3.1 at 420 rpm with five dampers, and reads from the figure that
the slider drifts away from its start linearly with time.

It does not. Nothing brings the slider back, gravity and the mean of the inertia forces push it towards the crank, and
the nearer it comes the harder they push. The drift accelerates with every damper; over the first turns it is near enough
to a line with the two strongest, mu >= 5e5 dyn.s/cm. With all but the strongest, coupler and rocker line up within
forty turns, sin(theta4 - theta3) < 0.3, where we stop following it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ..study import OURS, TEXT, Study, StudyResult, at_least, near, padded
from ._runs import DAMPINGS, drift, plain, scientific

NUMBER = "3.2"

#: Turns at which coupler and rocker are collinear, by damping (dyn.s/cm), and half a unit of the last figure given.
COLLINEAR = {1e4: (3.0, 0.05), 5e4: (4.9, 0.05), 1e5: (8.0, 0.05), 5e5: (36.0, 0.5)}


def compute() -> StudyResult:
    """Drift of the slider with the five dampers, and how far from linear it is."""
    runs = {mu: drift(mu) for mu in DAMPINGS}
    columns = {"turns of the crank [1]": max((run.turns for run in runs.values()), key=len)}
    columns |= {f"slider position u; mu = {plain(mu)} dyn.s/cm [cm]": run.until_collinear for mu, run in runs.items()}
    columns |= {
        f"turn of collinear links; mu = {plain(mu)} dyn.s/cm [1]": np.array([runs[mu].collinear_turn])
        for mu in COLLINEAR
    }
    gain = min(abs(run.per_turn(3)) - abs(run.per_turn(1)) for run in runs.values())
    verdicts = [
        near(f"third turn's drift relative to the first's; mu = {plain(mu)} dyn.s/cm", TEXT, 1.0, run.growth, 0.1)
        for mu, run in runs.items()
    ]
    verdicts.append(at_least("third turn's drift less the first's, least of all dampers", OURS, 0.0, gain, "cm"))
    for mu, (stated, tolerance) in COLLINEAR.items():
        statement = f"links collinear; mu = {plain(mu)} dyn.s/cm"
        verdicts.append(near(statement, OURS, stated, runs[mu].collinear_turn, tolerance, "turns"))
    return StudyResult(
        number=NUMBER,
        claim="Without a spring the slider drifts linearly.",
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """Drift over the first turns and over many; a cross where the links line up."""
    turns = result.columns["turns of the crank [1]"]
    curves, crosses = [], []
    for colour, mu in zip(COLOURS, DAMPINGS):
        u = result.columns[f"slider position u; mu = {plain(mu)} dyn.s/cm [cm]"]
        curves.append(Curve(x=turns, y=u, label=scientific(mu), colour=colour))
        if mu in COLLINEAR:
            last = np.flatnonzero(np.isfinite(u))[-1:]
            crosses.append(Curve(x=turns[last], y=u[last], colour=colour, line="", marker="x"))
    key = Curve(x=[], y=[], colour="0.3", line="", marker="x", label="links collinear")
    first = Panel(
        x_label="turns of the crank",
        y_label="slider position u [cm]",
        curves=[replace(curve, label="") for curve in (*curves, *crosses)],
        x_range=(0.0, 10.0),
        y_range=(-8.5, 2.0),
    )
    second = replace(
        first,
        curves=[*curves, *crosses, key],
        legend=r"damping $\mu$ [dyn s/cm]",
        legend_at="lower center",
        x_range=(0.0, 40.0),
    )
    return plot_curves([first, second], title=result.heading, columns=2, size=(4.6, 3.7))


STUDY = Study(NUMBER, compute, draw)
