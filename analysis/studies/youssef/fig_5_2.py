"""Fig 5.2: damping takes the first region away.

With a damper the region begins at some inertia ratio and not at none; the damping that removes it at a given I4 is about
half the region's width without damping, times the crank speed. The thesis states that omega_c = mu/(m4 + m5) = 0.45 1/s
removes it everywhere up to I4 = 1.5, which its own boundary (5.26) gives (0.459); but with the right width it is 0.167. The
boundaries are traced round their tips; the removing damping is found as a root, and by perturbation. The captions are lost:
that this chart stands under this number is our assignment.
"""

from __future__ import annotations

import numpy as np

from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...youssef import perturbed_removing_damping
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, Verdict, at_most, near
from ._chapter_5 import (
    crank_speed,
    equation,
    first_region,
    hill_region,
    plain,
    removing,
    run_columns,
    run_verdicts,
    with_units,
)

NUMBER = "5.2"

#: Dampings omega_c (1/s) of the charts.
DAMPINGS = (0.0, 0.05, 0.1, 0.15)
#: I4 at which the removing damping is computed.
RATIOS = np.linspace(0.25, 2.0, 8)
#: The thesis's removing damping up to I4 = 1.5 (1/s), as stated and by its own (5.26), and the right one.
STATED, OWN, RIGHT = 0.45, 0.459, 0.167
#: Long runs at I4 = 1.5: omega_c (1/s) and lambda_k^2.
RUNS = ((0.1, 0.2761), (0.1, 0.2785), (0.2, 0.2761))
PLACES = [(f"I4 = 1.5, omega_c = {d:g} 1/s, lambda_k^2 = {x:g}", chapter_4(1.5, d), x) for d, x in RUNS]


def perturbed(inertia_ratio: float) -> float:
    """The removing damping (1/s) by (5.26) to second order, with the right coefficients."""
    parameters = chapter_4(inertia_ratio)
    found, region = equation(parameters), hill_region(parameters)
    damping = perturbed_removing_damping(found.mass, found.stiffness, 1)
    return damping * crank_speed(0.5 * (region.low + region.high))


def compute() -> StudyResult:
    """Boundaries at each damping, and the damping that removes the region."""
    charts = {damping: first_region("orbit", damping) for damping in DAMPINGS}
    ratios = RATIOS.tolist()
    true = np.array([removing("orbit", ratio).damping for ratio in ratios])
    linear = np.array([removing("linear", ratio).damping for ratio in ratios])
    second = np.array([perturbed(ratio) for ratio in ratios])
    columns = {}
    for damping, found in charts.items():
        for number, boundary in enumerate(found.boundaries, start=1):
            columns[f"I4; omega_c = {damping:g}; boundary {number}"] = boundary.points[:, 1]
            columns[f"lambda_k^2; omega_c = {damping:g}; boundary {number}"] = boundary.points[:, 0]
    columns["I4"] = RATIOS
    columns["removing omega_c; true orbit [1/s]"] = true
    columns["removing omega_c; linear equation [1/s]"] = linear
    columns["removing omega_c; second order [1/s]"] = second
    columns["omega_c; long runs at I4 = 1.5 [1/s]"], columns["lambda_k^2; long runs"] = np.array(RUNS).T
    columns["long run grows"] = run_columns(PLACES)
    worst = max(removing("orbit", ratio).damping for ratio in (*ratios, 1.5) if ratio <= 1.5)
    tips = {
        damping: float(found.boundaries[0].points[:, 1].min()) for damping, found in charts.items() if damping > 0.0
    }
    verdicts: list[Verdict] = [
        near("damping that removes the region up to I4 = 1.5", TEXT, STATED, worst, 0.01, "1/s"),
        near("the same, by the thesis's own equation", TEXT, OWN, worst, 0.001, "1/s"),
        near("damping that removes the region up to I4 = 1.5", OURS, RIGHT, worst, 5e-4, "1/s"),
        # a tip is where that damping removes the region; the trace rounds it in short steps
        *(
            near(f"removing damping at the tip of the boundary, I4 = {tip:.4f}", OURS, damping, at_tip, 1e-5, "1/s")
            for damping, tip in tips.items()
            for at_tip in (removing("orbit", tip).damping,)
        ),
        at_most(
            "removing damping of the linear equation less that of second order, relative",
            OURS,
            1e-3,
            np.abs(linear / second - 1.0).max(),
        ),
        *run_verdicts(PLACES),
    ]
    return StudyResult(
        number=NUMBER,
        claim="omega_c = 0.45 1/s removes the first region everywhere up to I4 = 1.5.",
        assignment=ASSIGNED,
        columns=with_units(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The regions at each damping, and the removing damping over I4."""
    c = plain(result)
    boundaries = []
    for colour, level in zip(COLOURS, DAMPINGS):
        for number in (1, 2):
            name = f"omega_c = {level:g}; boundary {number}"
            if f"I4; {name}" in c:
                label = f"{level:g}" if number == 1 else ""
                boundaries.append(Curve(x=c[f"I4; {name}"], y=c[f"lambda_k^2; {name}"], colour=colour, label=label))
    damping, place, grows = (
        c[name][:3] for name in ("omega_c; long runs at I4 = 1.5 [1/s]", "lambda_k^2; long runs", "long run grows")
    )
    names = {
        "true orbit": (COLOURS[0], "-"),
        "linear equation": (COLOURS[2], "--"),
        "second order": (COLOURS[3], ":"),
    }
    removal = [
        Curve(
            x=c["I4"],
            y=c[f"removing omega_c; {name} [1/s]"],
            label={"second order": "second order (5.26), ours"}.get(name, name),
            colour=colour,
            line=line,
        )
        for name, (colour, line) in names.items()
    ]
    removal.append(Curve(x=[1.5], y=[STATED], colour=COLOURS[1], line="", marker="s", label="thesis"))
    # on the left those with the third damping, in its colour; on the right those in the middle of the region
    for state, marker, label in ((0.0, "o", "long run decays"), (1.0, "x", "long run grows")):
        left, right = ((grows == state) & (values == values[0]) for values in (damping, place))
        boundaries.append(
            Curve(x=np.full(left.sum(), 1.5), y=place[left], colour=COLOURS[2], line="", marker=marker, label=label)
        )
        removal.append(
            Curve(x=np.full(right.sum(), 1.5), y=damping[right], colour="0.1", line="", marker=marker, label=label)
        )
    panels = [
        Panel(
            x_label="inertia ratio I4",
            y_label="lambda_k^2",
            curves=boundaries,
            legend="omega_c [1/s], true orbit",
            legend_at="upper left",
            x_range=(0.25, 2.0),
            y_range=(0.25, 0.29),
        ),
        Panel(
            x_label="inertia ratio I4",
            y_label="damping omega_c that removes the region [1/s]",
            curves=removal,
            legend_at="upper left",
            x_range=(0.25, 2.0),
            y_range=(0.0, 0.6),
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.8, 4.0))


STUDY = Study(NUMBER, compute, draw)
