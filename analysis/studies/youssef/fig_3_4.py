"""Fig 3.4: the steady motion of the slider with three springs.

The thesis drives Table 3.1 at 420 rpm with mu = 3e4 dyn.s/cm and reads off that the slider is furthest in at about 22
degrees of crank angle (the scan has "220"). We run to the steady motion and locate the least position: with k = 5e5 dyn/cm
it is at 23.45 degrees, and earlier with the stiffer springs, at 17.5 and 5.2. The mean position is towards the crank and
shrinks as the spring stiffens.
"""

from __future__ import annotations

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ..study import OURS, TEXT, Study, StudyResult, at_most, curves_of, near
from ._runs import SPEED, STIFFNESSES, least, plain, scientific, steady_turn, table_3_1

NUMBER = "3.4"

#: By stiffness (dyn/cm): crank angle of the least position (deg) and mean position (cm).
STATED = {5e5: (23.45, -0.611), 1e6: (17.5, -0.280), 2e6: (5.2, -0.142)}


def compute() -> StudyResult:
    """The steady turn with each spring."""
    turns = {k: steady_turn(table_3_1(k), SPEED) for k in STIFFNESSES}
    minima = {k: least(turn.angle_deg, turn.slider_cm)[0] for k, turn in turns.items()}
    # 22 was read from a figure
    verdicts = [near("crank angle of the least u; k = 5e5 dyn/cm", TEXT, 22.0, minima[5e5], 2.0, "deg")]
    for k, (angle, mean) in STATED.items():
        verdicts += [
            near(f"crank angle of the least u; k = {plain(k)} dyn/cm", OURS, angle, minima[k], 0.05, "deg"),
            near(f"mean of u; k = {plain(k)} dyn/cm", OURS, mean, turns[k].slider_cm[:-1].mean(), 5e-4, "cm"),
        ]
    change = max(turn.change for turn in turns.values())
    verdicts += [
        near("u at crank angle 0; k = 1e6 dyn/cm", OURS, -0.89553115, turns[1e6].slider_cm[0], 2e-8, "cm"),
        at_most("change of u from one turn to the next", OURS, 1e-7, change, "cm"),
    ]
    columns = {"crank angle [deg]": turns[1e6].angle_deg}
    columns |= {f"slider position u; k = {plain(k)} dyn/cm [cm]": turn.slider_cm for k, turn in turns.items()}
    return StudyResult(
        number=NUMBER,
        claim="The slider is furthest in at a crank angle of 22 degrees.",
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The three turns, a cross at each least position."""
    names = {f"slider position u; k = {plain(k)} dyn/cm [cm]": scientific(k) for k in STIFFNESSES}
    angle = result.columns["crank angle [deg]"]
    curves = list(curves_of(result, "crank angle [deg]", names))
    for colour, name in zip(COLOURS, names):
        place, value = least(angle, result.columns[name])
        curves.append(Curve(x=[place], y=[value], colour=colour, line="", marker="x"))
    panel = Panel(
        x_label="crank angle [deg]",
        y_label="slider position u [cm]",
        curves=[*curves, Curve(x=[], y=[], colour="0.3", line="", marker="x", label="least")],
        legend="stiffness k [dyn/cm]",
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 45),
    )
    return plot_curves([panel], title=result.heading)


STUDY = Study(NUMBER, compute, draw)
