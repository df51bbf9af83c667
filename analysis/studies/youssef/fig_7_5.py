"""Fig 7.5: the variational motion of the slider for the weighted rocker function, and where it jumps.

At every crank angle the slider is where the error of the rocker's angle is least, in closed form. The links are those printed
for the weighted rocker function. With the guide along the ground link the coupler cannot bring the rocker all the way at the
start of the turn. With the guide at 30 degrees it can everywhere: the function is met exactly. Nothing in the closed form
ties one crank angle to the next: with the guide at -35 degrees and 6 cm of stroke the best position jumps from one side to
the other, which no slider can follow. The best motion without a jump is found among the same closed-form minima; what it
gives up is told beside.

Which motion the thesis shows is lost: the guide angles, the stroke and the 360 crank rotations are our choice. The thesis
lists no motion that meets the function exactly.
"""

from __future__ import annotations

from functools import cache
from math import cos, degrees, inf, pi, radians, sin
from typing import NamedTuple

import numpy as np

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...motion import VariationalMotion, variational_motion
from ...synthesis import evaluate
from ...synthesis.published import PROBLEMS, WEIGHTED_N, rocker_function
from ..study import OURS, Study, StudyResult, at_least, at_most, near
from ._chapter_7 import ASSIGNED, ROCKER, FloatArray, rocker_motion, shown, slider, wanted_angle, window

NUMBER = "7.5"
N = 360
#: Brute force: positions, the range of them where the stroke has no bound (m), rotations left out in turn, and what a step of
#: the slider may cost (deg).
POSITIONS, WIDE, EVERY, BRUTE_FORCE = 20001, 0.15, 10, 0.02


class Case(NamedTuple):
    """A motion that is shown: guide angle (deg), half the stroke (m), and whether it must not jump."""

    guide: float
    half_stroke: float
    continuous: bool


CASES = {
    "guide along the ground": Case(0.0, inf, False),
    "guide at 30 deg": Case(30.0, inf, False),
    "guide at -35 deg": Case(-35.0, 0.06, False),
    "guide at -35 deg; continuous": Case(-35.0, 0.06, True),
}


@cache
def motion(name: str, n: int = N) -> VariationalMotion:
    """The variational motion of a case, at n crank rotations."""
    case, task = CASES[name], rocker_function(n, weighted=True)
    return variational_motion(
        PROBLEMS[ROCKER].linkage,
        task.rotation,  # type: ignore[arg-type]
        task.angle,
        guide_angle=radians(case.guide),
        stroke=(-case.half_stroke, case.half_stroke),
        weights=task.weights,
        continuous=case.continuous,
    )


def error(name: str, n: int) -> float:
    """Sum of the squared errors (deg2), the heavy ones whole and the others by a thousandth, per 24 rotations."""
    return PROBLEMS[ROCKER].convert(motion(name, n).squared_error) * 24.0 / n


def brute_force(name: str) -> float:
    """Greatest difference (deg) between the least error over a dense range of positions and the closed form's."""
    case, found, linkage = CASES[name], motion(name), PROBLEMS[ROCKER].linkage
    half = min(case.half_stroke, WIDE)
    u = np.linspace(-half, half, POSITIONS)
    guide = radians(case.guide)
    worst = 0.0
    for k in range(0, N, EVERY):
        # the crank stands: one rotation at a time, all positions at once
        phi = np.full(u.size, found.rotation[k])
        out = linkage.directions(phi, (u * cos(guide), u * sin(guide)))
        off = np.arctan2(out[3], out[2]) - radians(float(wanted_angle(found.rotation[k])))
        least = np.nanmin(np.abs((off + pi) % (2.0 * pi) - pi))
        worst = max(worst, abs(float(least) - float(found.error[k])))
    return degrees(worst)


def compute() -> StudyResult:
    """The four motions, their errors, their jumps, and the thousandth-step search beside."""
    columns: dict[str, FloatArray] = {"crank rotation [deg]": np.degrees(motion("guide along the ground").rotation)}
    verdicts = []
    for name in CASES:
        found = motion(name)
        columns[f"slider; {name} [cm]"] = CM_PER_METRE * found.u
        columns[f"error; {name} [deg]"] = np.degrees(found.error)
        if not CASES[name].continuous:
            verdicts.append(
                at_most(f"difference from brute force; {name}", OURS, BRUTE_FORCE, brute_force(name), "deg")
            )
    fixed = PROBLEMS[ROCKER].convert(evaluate(PROBLEMS[ROCKER].task, PROBLEMS[ROCKER].linkage).error)
    along, exact, jumping, smooth = CASES
    two = rocker_motion(2)
    guide = degrees(slider(two.linkage).guide_angle)
    same_guide = variational_motion(
        PROBLEMS[ROCKER].linkage,
        rocker_function(WEIGHTED_N).rotation,  # type: ignore[arg-type]
        rocker_function(WEIGHTED_N).angle,
        guide_angle=radians(guide),
        weights=rocker_function(WEIGHTED_N, weighted=True).weights,
    )
    verdicts += [
        at_most(f"error at N = 24, of the fixed pivot's {fixed:.1f}; {along}", OURS, 0.1, error(along, 24) / fixed),
        at_most(f"error at N = 24; {exact}", OURS, 1e-12, error(exact, 24), "deg2"),
        near(f"jumps; {along}", OURS, 0.0, len(motion(along).jumps), 0.0),
        near(f"jumps; {exact}", OURS, 0.0, len(motion(exact).jumps), 0.0),
        at_least(f"jumps; {jumping}", OURS, 1.0, len(motion(jumping).jumps)),
        near(f"jumps; {smooth}", OURS, 0.0, len(motion(smooth).jumps), 0.0),
        at_least(
            "error of the continuous motion, of that which jumps", OURS, 1.0, error(smooth, N) / error(jumping, N)
        ),
        at_most(
            "variational error, of that of two harmonics on the same guide",
            OURS,
            1.0,
            PROBLEMS[ROCKER].convert(same_guide.squared_error) / shown(ROCKER, two),
        ),
    ]
    return StudyResult(
        number=NUMBER,
        claim="The slider position of least error at every crank angle; it may jump between solutions.",
        assignment=f"{ASSIGNED} Guide angles and stroke are our choice.",
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """Positions and errors, the jump broken off."""
    names = {name: name.replace("-35", "\N{MINUS SIGN}35").replace("; ", ", ") for name in CASES}
    turn = result.columns["crank rotation [deg]"]
    positions: list[Curve] = []
    errors: list[Curve] = []
    for (name, label), colour, line in zip(names.items(), (*COLOURS[:3], COLOURS[4]), ("-", "-", "-", "--")):
        jumps = motion(name).jumps + 1
        for curves, column in ((positions, f"slider; {name} [cm]"), (errors, f"error; {name} [deg]")):
            y = np.insert(result.columns[column], jumps, np.nan)
            curves.append(Curve(x=np.insert(turn, jumps, np.nan), y=y, label=label, colour=colour, line=line))
    low, high = window()
    where = {f"weight 1000 from {low:.0f} deg": low, f"to {high:.0f} deg": high}
    panels = [
        Panel(
            x_label="crank rotation [deg]",
            y_label=y_label,
            curves=curves,
            verticals=verticals,
            x_ticks=range(0, 361, 60),
            legend_at="outside",
        )
        for y_label, curves, verticals in (
            ("slider position u [cm]", positions, None),
            ("error of the rocker's angle [deg]", errors, where),
        )
    ]
    return plot_curves(panels, title=result.heading, size=(7.6, 3.2))


STUDY = Study(NUMBER, compute, draw)
