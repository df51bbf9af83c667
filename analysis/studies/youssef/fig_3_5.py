"""Fig 3.5: the crank torque hardly feels the spring.

The thesis computes the torque that holds 420 rpm for the three springs of Fig 3.4 and finds little difference. In
numbers: between k = 5e5 and 2e6 dyn/cm, a factor of four, it differs by 9.6 % of its peak. With k = 1e6 it swings from
+1.46e7 dyn.cm at 327 degrees to -2.00e7 dyn.cm at 16 degrees: the steep reversal falls in an eighth of a turn.
"""

from __future__ import annotations

import numpy as np

from linkwork.five_bar.published import DYN_CM_PER_NEWTON_METRE

from ...figures import Figure, Panel, plot_curves
from ..study import OURS, Study, StudyResult, curves_of, near
from ._runs import (
    SPEED,
    STIFFNESSES,
    greatest,
    least,
    plain,
    scientific,
    steady_turn,
    table_3_1,
)

NUMBER = "3.5"


def compute() -> StudyResult:
    """The torque over the steady turn with each spring."""
    turns = {k: steady_turn(table_3_1(k), SPEED) for k in STIFFNESSES}
    angle, torque = turns[1e6].angle_deg, turns[1e6].torque
    # in dyn.cm, as stated
    high_at, high = greatest(angle, DYN_CM_PER_NEWTON_METRE * torque)
    low_at, low = least(angle, DYN_CM_PER_NEWTON_METRE * torque)
    difference = np.abs(turns[5e5].torque - turns[2e6].torque).max() / np.abs(torque).max()
    columns = {"crank angle [deg]": angle}
    columns |= {f"crank torque; k = {plain(k)} dyn/cm [N.m]": turn.torque for k, turn in turns.items()}
    return StudyResult(
        number=NUMBER,
        claim="The torque depends little on the spring, and reverses steeply once a turn.",
        columns=columns,
        verdicts=(
            near("difference between k = 5e5 and 2e6, relative to the peak", OURS, 0.096, difference, 5e-4),
            near("greatest torque; k = 1e6 dyn/cm", OURS, 1.46e7, high, 0.005e7, "dyn.cm"),
            near("crank angle of the greatest torque", OURS, 327.0, high_at, 0.5, "deg"),
            near("least torque; k = 1e6 dyn/cm", OURS, -2.00e7, low, 0.005e7, "dyn.cm"),
            near("crank angle of the least torque", OURS, 16.0, low_at, 0.5, "deg"),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """The three torques over a turn."""
    names = {f"crank torque; k = {plain(k)} dyn/cm [N.m]": scientific(k) for k in STIFFNESSES}
    panel = Panel(
        x_label="crank angle [deg]",
        y_label="crank torque [N m]",
        curves=curves_of(result, "crank angle [deg]", names),
        legend="stiffness k [dyn/cm]",
        legend_at="upper center",
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 45),
    )
    return plot_curves([panel], title=result.heading)


STUDY = Study(NUMBER, compute, draw)
