"""The linkage itself: a still and an animation.

Table 3.1 at 420 rpm from the thesis's start, th2 = u = u' = 0, with the coupler point of our Fig 7.2: the slider swings into
its steady motion within a few turns, and the path of P with it, across the coupler curves.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM

from ...figures import Figure, animate_linkage, draw_linkage
from ...run import Inputs, Trajectory, simulate
from ..study import OURS, Study, StudyResult, at_most
from ._runs import SPEED
from .fig_7_2 import mechanism

NUMBER = "linkage"

TURNS = 3
#: Crank angle of the still, in the last turn (rad).
STILL = 2.0 * np.pi * (TURNS - 1) + 1.0


@cache
def run() -> Trajectory:
    """Three turns from the thesis's start."""
    period = 60.0 / SPEED
    return simulate(mechanism(1), Inputs(speed=SPEED * RAD_S_PER_RPM), stop_time=TURNS * period, step=period / 240)


def compute() -> StudyResult:
    """The run's slider and coupler point."""
    t = run()
    return StudyResult(
        number=NUMBER,
        claim="A five-bar linkage whose rocker pin slides on a sprung and damped guide has two degrees of freedom.",
        assignment="The coupler point is that of our Fig 7.2.",
        columns={
            "time [s]": t.time,
            "crank angle [rad]": t["crank.angle"],
            "slider position u [cm]": CM_PER_METRE * t["slider.position"],
            "x of P [cm]": CM_PER_METRE * t["coupler.point.x"],
            "y of P [cm]": CM_PER_METRE * t["coupler.point.y"],
        },
        verdicts=(at_most("residual of loop closure", OURS, 1e-12, t["closure.residual"].max(), "m"),),
    )


def draw(result: StudyResult) -> Figure:
    """The linkage at one radian of the last turn, with the path of P over it."""
    angle = result.columns["crank angle [rad]"]
    last = angle >= angle[-1] - 2.0 * np.pi - 1e-9
    trace = np.column_stack([result.columns[f"{axis} of P [cm]"][last] for axis in "xy"]) / CM_PER_METRE
    u = float(np.interp(STILL, angle, result.columns["slider position u [cm]"])) / CM_PER_METRE
    return draw_linkage(mechanism(1), STILL, u, title=result.heading, trace=trace)


def animate(result: StudyResult, path: Path) -> Path:
    """All of the run."""
    return animate_linkage(mechanism(1), run(), path, frames=72, title=result.heading)


STUDY = Study(NUMBER, compute, draw, animate)

#: The study by its name.
STUDIES = {NUMBER: STUDY}
