"""The methods of sections 7.1 and 7.4 for driving the slider, applied to a mechanism with masses.

The thesis classifies the methods and computes none: off-line (a spring, a drive without feedback), partial-on-line
(feedback to a stored motion), and adaptive (trial cycles that correct the drive). Here each drives the two harmonics of
Fig 7.11: the printed links of the weighted rocker function as steel bars of 20 by 5 mm, a damper and some friction in the
guide, 120 rpm. The plant differs from the controller's model: twice the friction, coupler and slider a tenth heavier, a
load on the rocker pin. A trial cycle corrects the stored motion by the Fourier series of the last cycle's deviation.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...linear import Design, design_pid, linearise_along
from ...numerics.fourier import FourierSeries
from ...slider import TrackingController, TrackingResult, best_spring, inverse_dynamics, motion_of_plant, track
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, near, padded, text, unjudged
from .series_2 import rocker_motion

NUMBER = "control"
#: Crank speed (rad/s).
SPEED = 4.0 * pi
#: Damping (N.s/m) and friction (N) in the guide.
DAMPING, FRICTION = 5.0, 2.0
#: Sampling period (s) and bandwidth (rad/s) of the controller; turns of a run.
PERIOD, BANDWIDTH, TURNS = 1e-3, 120.0, 3.0
#: Load at the pin of coupler and rocker, unknown to the controller (N).
LOAD = (-5.0, -3.0)
#: Trial cycles, and harmonics of the deviation that they correct.
TRIALS, HARMONICS = 5, 8


class Machine(NamedTuple):
    """Mechanism as modelled and as built, motion of its slider over the crank angle (m), and feedback."""

    model: FiveBarParameters
    plant: FiveBarParameters
    motion: FourierSeries
    design: Design


@cache
def machine() -> Machine:
    """Return the printed links in steel, and the two harmonics over the crank angle."""
    linkage = rocker_motion(2).linkage
    motion = motion_of_plant(linkage)
    model = replace(
        linkage.to_five_bar(slider_damping=DAMPING, slider_coulomb_friction=FRICTION),
        coupler_point_distance=linkage.coupler_length,
    )
    plant = replace(
        model,
        slider_coulomb_friction=2.0 * FRICTION,
        slider_mass=1.1 * model.slider_mass,
        coupler_mass=1.1 * model.coupler_mass,
    )
    mean = linearise_along(model, inverse_dynamics(model, motion, SPEED)).mean()
    return Machine(model, plant, motion, design_pid(mean, bandwidth=BANDWIDTH))


def run(stored: FourierSeries, *, feedback: bool = True) -> TrackingResult:
    """Run the plant along a stored motion."""
    m = machine()
    design = m.design if feedback else None
    controller = TrackingController(m.model, stored, PERIOD, design=design, feedforward=not feedback)
    return track(controller, crank_speed=SPEED, revolutions=TURNS, plant=m.plant, load=LOAD)


@cache
def trials() -> tuple[NDArray[np.float64], ...]:
    """Return the deviation of the slider from the desired motion over the last turn of each trial cycle (m)."""
    turn = round(2.0 * pi / (SPEED * PERIOD))
    stored, deviations = machine().motion, []
    for _ in range(TRIALS):
        loop = run(stored).loop
        # samples at equal steps, the first at a whole number of turns
        last = slice(-turn - 1, -1)
        deviations.append(loop.position[last] - machine().motion(loop.states[last, 0]))
        stored = stored + FourierSeries.from_samples(deviations[-1], HARMONICS) * -1.0
    return tuple(deviations)


def rms(values: NDArray[np.float64]) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def without_counterpart() -> tuple[Verdict, ...]:
    """Return verdicts on the methods that the thesis only names."""
    rows = {
        "secondary linkages and cams drive the slider": (
            "their shape is not computed; what they would have to do is u of Fig 7.6 and 7.11",
            "7.1.1 (a), L5309",
        ),
        "latches hold and release the slider": (
            "only recommended for study (9.2, L7219); the plant's guide has no latch",
            "7.1.1 (a), (b), L5313",
        ),
        "the mechanism is led by hand and its inputs are recorded": (
            "no record is given; one without errors of measurement is the variational motion of Fig 7.6",
            "7.1.2, L5348",
        ),
        "the simplest linkage: a four-bar, then a slider, then a fifth link": (
            "no example is given; `linkwork slider-motion` with a `[strategy]` follows it",
            "7.4, L5998",
        ),
    }
    return tuple(unjudged(statement, text(place), why) for statement, (why, place) in rows.items())


def compute() -> StudyResult:
    """Compute the force with and without a spring, the motion with and without feedback, and the trial cycles."""
    m = machine()
    drives = {"without a spring": inverse_dynamics(m.model, m.motion, SPEED)}
    drives["with the best spring"] = inverse_dynamics(best_spring(m.model, m.motion, SPEED).parameters, m.motion, SPEED)
    bare, sprung = (drive.rms_force for drive in drives.values())
    faster = inverse_dynamics(m.model, m.motion, 2.0 * SPEED).rms_force
    open_loop, closed = run(m.motion, feedback=False), run(m.motion)
    errors = [1e3 * rms(deviation) for deviation in trials()]
    columns = {"crank angle [deg]": np.degrees(drives["without a spring"].crank_angle)}
    columns |= {f"force; {name} [N]": drive.force for name, drive in drives.items()}
    for name, found in (("feed-forward", open_loop), ("feedback", closed)):
        columns |= {
            f"turns; {name} [1]": found.loop.time * SPEED / (2.0 * pi),
            f"error; {name} [mm]": 1e3 * found.error,
        }
    columns |= {"trial cycle [1]": np.arange(1.0, TRIALS + 1.0), "rms deviation [mm]": np.array(errors)}
    for k, deviation in ((1, trials()[0]), (TRIALS, trials()[-1])):
        columns[f"deviation; cycle {k} [mm]"] = 1e3 * deviation
    columns["place in the turn [1]"] = np.arange(len(trials()[0])) / len(trials()[0])
    return StudyResult(
        number=NUMBER,
        claim="The slider may be driven off-line, with feedback to a stored motion, or adaptively in trial cycles.",
        assignment="The thesis computes none of them: masses, damper, friction, load and controller are our choice.",
        columns=padded(columns),
        verdicts=(
            at_least("rms force without a spring, of that with the best", OURS, 1.5, bare / sprung),
            at_least(
                "an accurate motion is difficult for an independent drive without feedback; status of the run",
                text("7.1.1 (c), L5327"),
                1.0,
                open_loop.loop.status,
            ),
            near("feedback keeps it to the stored motion; status", text("7.1.2, L5340"), 0, closed.loop.status, 0),
            at_least("rms force at twice the speed, of that at 120 rpm", text("7.1.2, L5360"), 1.0, faster / bare),
            at_most(
                "rms deviation of the last trial cycle, of that of the first",
                text("7.1.3, L5380; 7.3.1, L5855"),
                1.0,
                errors[-1] / errors[0],
            ),
            at_most(
                "greatest growth of the rms deviation from cycle to cycle",
                text("7.1.3, L5388"),
                0.0,
                np.diff(errors).max(),
                "mm",
            ),
            *without_counterpart(),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Draw force, errors of the runs, and the trial cycles."""
    c = result.columns
    runs = (("feed-forward", "no feedback", COLOURS[1]), ("feedback", "feedback", COLOURS[0]))
    panels = [
        Panel(
            x_label="crank angle [deg]",
            y_label="control force [N]",
            title="force on the slider",
            curves=[
                Curve(x=c["crank angle [deg]"], y=c[f"force; {name} [N]"], label=name)
                for name in ("without a spring", "with the best spring")
            ],
            x_ticks=range(0, 361, 60),
        ),
        Panel(
            x_label="turns of the crank",
            y_label="error of the slider [mm]",
            title="motion followed",
            curves=[
                Curve(x=c[f"turns; {name} [1]"], y=c[f"error; {name} [mm]"], label=label, colour=colour)
                for name, label, colour in runs
            ],
            y_range=(-1.5, 1.5),
        ),
        Panel(
            x_label="trial cycle",
            y_label="rms deviation [mm]",
            title="trial cycles",
            curves=[Curve(x=c["trial cycle [1]"], y=c["rms deviation [mm]"], marker="o")],
            logarithmic="y",
        ),
        Panel(
            x_label="place in the last turn",
            y_label="deviation of the slider [mm]",
            title="first and last trial cycle",
            curves=[
                Curve(x=c["place in the turn [1]"], y=c[f"deviation; cycle {k} [mm]"], label=f"cycle {k}")
                for k in (1, TRIALS)
            ],
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 2.9))


#: The study by its name.
STUDIES = {NUMBER: Study(NUMBER, compute, draw)}
