"""Picture and animation of the linkage of Table 3.1.

It runs at 420 rpm from the thesis's start, th2 = u = u' = 0, with a coupler point P that we chose. Within a few turns the
slider reaches its steady motion, and P its steady path.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians
from pathlib import Path

import numpy as np

from ...figures import Figure, animate_linkage, draw_linkage
from ...run import Inputs, Trajectory, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..study import Study, StudyResult
from .runs import PERIOD, SPEED, table_3_1

#: Table 3.1 with P 12 cm from the crank pin and 30 degrees off the coupler.
MECHANISM = replace(table_3_1(1e6), coupler_point_distance=0.12, coupler_point_angle=radians(30.0))
TURNS = 3
#: Crank angle of the picture, in the last turn (rad).
STILL = 2.0 * np.pi * (TURNS - 1) + 1.0


@cache
def run() -> Trajectory:
    """Run three turns from the thesis's start."""
    return simulate(MECHANISM, Inputs(speed=SPEED * RAD_S_PER_RPM), stop_time=TURNS * PERIOD, step=PERIOD / 240)


def compute() -> StudyResult:
    """Compute the positions of slider and coupler point over the run."""
    t = run()
    return StudyResult(
        claim="A five-bar linkage whose rocker pin slides on a sprung and damped guide has two degrees of freedom.",
        assignment="The picture and its coupler point are ours.",
        columns={
            "time [s]": t.time,
            "crank angle [rad]": t["crank.angle"],
            "slider position u [cm]": CM_PER_METRE * t["slider.position"],
            "x of P [cm]": CM_PER_METRE * t["coupler.point.x"],
            "y of P [cm]": CM_PER_METRE * t["coupler.point.y"],
        },
    )


def draw(result: StudyResult) -> Figure:
    """Draw the linkage at one radian of the last turn, with the path of P."""
    angle = result.columns["crank angle [rad]"]
    last = angle >= angle[-1] - 2.0 * np.pi - 1e-9
    trace = np.column_stack([result.columns[f"{axis} of P [cm]"][last] for axis in "xy"]) / CM_PER_METRE
    u = float(np.interp(STILL, angle, result.columns["slider position u [cm]"])) / CM_PER_METRE
    return draw_linkage(MECHANISM, STILL, u, title=result.heading, trace=trace)


def animate(result: StudyResult, path: Path) -> Path:
    """Animate the whole run and write the animation to ``path``."""
    return animate_linkage(MECHANISM, run(), path, frames=72, title=result.heading)


#: The study by its name.
STUDIES = {"linkage": Study(compute, draw, animate)}
