"""Fig 3.3: the same drift without gravity.

The thesis switches gravity off to see how much of the drift of Fig 3.2 it causes. Gravity turns out to hold the slider
back: without it the drift grows by about a quarter. That is measured where the drift is near enough to linear to have a
rate, with the dampers mu = 5e5 and 1e6 dyn.s/cm over the first three turns.
"""

from __future__ import annotations

from dataclasses import replace

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ..study import OURS, Study, StudyResult, near, padded
from ._runs import DAMPINGS, drift, plain, scientific

NUMBER = "3.3"

#: Dampers (dyn.s/cm) with which the drift has a rate.
NEAR_LINEAR = (5e5, 1e6)


def compute() -> StudyResult:
    """Drift with and without gravity for the five dampers."""
    columns = {"turns of the crank [1]": max((drift(mu).turns for mu in DAMPINGS), key=len)}
    for mu in DAMPINGS:
        columns[f"slider position u; mu = {plain(mu)} dyn.s/cm [cm]"] = drift(mu).until_collinear
        columns[f"slider position u without gravity; mu = {plain(mu)} dyn.s/cm [cm]"] = drift(mu, 0.0).until_collinear
    return StudyResult(
        number=NUMBER,
        claim="Gravity has a part in the drift: without it the drift grows by about 25 %.",
        columns=padded(columns),
        verdicts=tuple(
            near(
                f"drift over three turns without gravity, relative to that with it; mu = {plain(mu)} dyn.s/cm",
                OURS,
                1.25,
                sum(drift(mu, 0.0).per_turn(n) for n in (1, 2, 3)) / sum(drift(mu).per_turn(n) for n in (1, 2, 3)),
                0.03,
            )
            for mu in NEAR_LINEAR
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Both drifts over the first turns and over many."""
    turns = result.columns["turns of the crank [1]"]

    def pair(mu: float, colour: str) -> list[Curve]:
        name = "slider position u{}; mu = " + f"{plain(mu)} dyn.s/cm [cm]"
        with_gravity, without = result.columns[name.format("")], result.columns[name.format(" without gravity")]
        return [
            Curve(x=turns, y=with_gravity, label=scientific(mu), colour=colour),
            Curve(x=turns, y=without, colour=colour, line="--"),
        ]

    curves = {mu: pair(mu, colour) for mu, colour in zip(DAMPINGS, COLOURS)}
    everything = [curve for both in curves.values() for curve in both]
    key = Curve(x=[], y=[], colour="0.3", line="--", label="without gravity")
    first = Panel(
        x_label="turns of the crank",
        y_label="slider position u [cm]",
        curves=[replace(curve, label="") for curve in everything],
        x_range=(0.0, 10.0),
        y_range=(-8.5, 2.0),
    )
    second = replace(
        first,
        curves=[*everything, key],
        legend=r"damping $\mu$ [dyn s/cm]",
        legend_at="lower center",
        x_range=(0.0, 40.0),
    )
    return plot_curves([first, second], title=result.heading, columns=2, size=(4.6, 3.7))


STUDY = Study(NUMBER, compute, draw)
