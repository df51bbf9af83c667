"""Fig 7.12: from kinematics to dynamics: what it takes to move the slider, and how well it is followed.

The two harmonics of Fig 7.6 on a real mechanism: the printed links of the weighted rocker function as steel bars of 20 by 5 mm,
a damper and some friction in the guide, 120 rpm. Inverse dynamics gives the force on the slider, its power and the forces in
the pins; the best spring halves the rms force. A controller then has to follow the motion on a plant that it does not know
exactly: twice the friction, coupler and slider a tenth heavier, a load on the rocker pin. Feed-forward alone loses the motion
before the crank has turned once; with feedback it is held to a fraction of a millimetre, and feed-forward halves what is left.
Finally the rocker's angle is given a tolerance: the optimal control problem says how much force each degree of it saves.

The thesis treats the kinematics of the moved slider only. That its dynamics stand under the last number is our assignment;
section, damper, friction, speed, load and gains are our choice.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import degrees, pi, radians
from typing import NamedTuple

import numpy as np

from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...linear import design_pid, linearise_along
from ...motion import (
    Collocation,
    LeastEffort,
    SliderDrive,
    TrackingController,
    TrackingResult,
    best_spring,
    inverse_dynamics,
    least_effort,
    track,
)
from ...numerics.fourier import FourierSeries
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, near, padded
from ._chapter_7 import ASSIGNED, ROCKER, FloatArray, rocker_motion, shown, slider

NUMBER = "7.12"
#: rad/s.
SPEED = 4.0 * pi
#: N.s/m and N, in the guide.
DAMPING, FRICTION = 5.0, 2.0
#: Of the controller: s, rad/s; turns that are run.
PERIOD, BANDWIDTH, TURNS = 1e-3, 120.0, 4.0
#: At the pin of coupler and rocker, unknown to the controller (N).
LOAD = (-5.0, -3.0)
#: Tolerances of the rocker's angle (deg).
TOLERANCES = (0.25, 0.5, 1.0, 2.0, 4.0)
INTERVALS = 30
SHOWN = 1.0
PINS = "ABCD"


class Machine(NamedTuple):
    """The mechanism without a spring and with the best one, and the motion of its slider over the crank angle (m)."""

    bare: FiveBarParameters
    sprung: FiveBarParameters
    motion: FourierSeries


@cache
def machine() -> Machine:
    """The printed links in steel, and the two harmonics: over the crank's angle, where the series is over its rotation."""
    linkage = rocker_motion(2).linkage
    series = slider(linkage).series
    turned = np.arange(series.order + 1) * linkage.crank_phase
    motion = FourierSeries(
        series.cos * np.cos(turned) - series.sin * np.sin(turned),
        series.cos * np.sin(turned) + series.sin * np.cos(turned),
    )
    bare = replace(
        linkage.to_five_bar(slider_damping=DAMPING, slider_coulomb_friction=FRICTION),
        coupler_point_distance=linkage.coupler_length,
    )
    return Machine(bare, best_spring(bare, motion, SPEED).parameters, motion)


@cache
def drives() -> dict[str, SliderDrive]:
    """What the motion takes, without a spring and with it."""
    m = machine()
    return {
        name: inverse_dynamics(p, m.motion, SPEED)
        for name, p in (("without a spring", m.bare), ("with the best spring", m.sprung))
    }


@cache
def runs() -> dict[str, TrackingResult]:
    """The motion followed on a plant that differs from the model, in three ways; and on the model itself."""
    m = machine()
    design = design_pid(linearise_along(m.sprung, drives()["with the best spring"]).mean(), bandwidth=BANDWIDTH)
    plant = replace(
        m.sprung,
        slider_coulomb_friction=2.0 * FRICTION,
        slider_mass=1.1 * m.sprung.slider_mass,
        coupler_mass=1.1 * m.sprung.coupler_mass,
    )

    def run(known: bool = False, feedback: bool = True, feedforward: bool = True) -> TrackingResult:
        controller = TrackingController(
            m.sprung, m.motion, PERIOD, design=design if feedback else None, feedforward=feedforward
        )
        return track(
            controller,
            crank_speed=SPEED,
            revolutions=TURNS,
            plant=m.sprung if known else plant,
            load=(0.0, 0.0) if known else LOAD,
        )

    return {
        "feed-forward": run(feedback=False),
        "feedback": run(feedforward=False),
        "both": run(),
        "both; plant known": run(known=True),
    }


def rocker_angle(crank_angle: FloatArray) -> FloatArray:
    """Where the two harmonics bring the rocker (rad), in the plant's own frame."""
    m = machine()
    p = m.bare.constants()
    return np.array(
        [
            kinematics.rocker_angle(kinematics.position(t, float(m.motion(t)), p))
            for t in np.asarray(crank_angle).tolist()
        ]
    )


@cache
def efforts() -> dict[float, LeastEffort]:
    """The motion of least rms force at each tolerance, each sought from the motion itself.

    Without friction, which turns round too quickly for so few intervals.
    """
    m = machine()
    free = replace(m.sprung, slider_coulomb_friction=0.0)
    return {
        tolerance: least_effort(
            free,
            SPEED,
            rocker_angle,
            radians(tolerance),
            collocation=Collocation(intervals=INTERVALS, halvings=0),
            guess=m.motion,
        )
        for tolerance in TOLERANCES
    }


def rms_beside(stiffness: float, free: float) -> float:
    """Root mean square of the force with another spring (N)."""
    m = machine()
    p = replace(m.bare, slider_stiffness=stiffness, slider_spring_free_position=free)
    return inverse_dynamics(p, m.motion, SPEED).rms_force


def spring_verdicts() -> list[Verdict]:
    """That the spring is the best, and what it is worth."""
    m, d = machine(), drives()
    k, free = m.sprung.slider_stiffness, m.sprung.slider_spring_free_position
    rms = {name: drive.rms_force for name, drive in d.items()}
    nearby = min(rms_beside(a * k, free + b) for a, b in ((0.99, 0.0), (1.01, 0.0), (1.0, -5e-4), (1.0, 5e-4)))
    return [
        at_least(
            "rms force without a spring, of that with the best",
            OURS,
            1.5,
            rms["without a spring"] / rms["with the best spring"],
        ),
        at_least(
            f"rms force with a spring nearby, of that with the best; {k:.0f} N/m",
            OURS,
            1.0,
            nearby / rms["with the best spring"],
        ),
    ]


def compute() -> StudyResult:
    """Forces, power, tracking and least effort."""
    d, r, e = drives(), runs(), efforts()
    sprung = d["with the best spring"]
    columns = {"crank angle [deg]": np.degrees(sprung.crank_angle)}
    for name, drive in d.items():
        columns[f"force; {name} [N]"] = drive.force
        columns[f"power; {name} [W]"] = drive.power
    for pin in PINS:
        columns[f"pin {pin} [N]"] = np.hypot(sprung[f"pin.{pin}.fx"], sprung[f"pin.{pin}.fy"])
    for name, run in r.items():
        columns[f"turns; {name} [1]"] = run.loop.time * SPEED / (2.0 * pi)
        columns[f"error; {name} [mm]"] = 1e3 * run.error
    columns["tolerance [deg]"] = np.array(TOLERANCES)
    columns["least rms force [N]"] = np.array([found.effort for found in e.values()])
    exact = inverse_dynamics(replace(sprung.parameters, slider_coulomb_friction=0.0), machine().motion, SPEED)
    theta = sprung.crank_angle
    columns[f"force; within {SHOWN:g} deg [N]"] = e[SHOWN].at(theta)[2]
    columns["force; exactly [N]"] = exact.force
    columns[f"slider; within {SHOWN:g} deg [cm]"] = CM_PER_METRE * e[SHOWN].at(theta)[0]
    columns["slider; exactly [cm]"] = CM_PER_METRE * machine().motion(theta)
    metrics = {name: r[name].metrics() for name in ("feedback", "both", "both; plant known")}
    effort = columns["least rms force [N]"]
    verdicts = (
        at_most("weighted error of the motion", OURS, 0.76, shown(ROCKER, rocker_motion(2)), "deg2"),
        *(
            at_most(
                f"energy over a turn that is not accounted for; {name}",
                OURS,
                1e-9,
                abs(drive.balance.residual) / drive.balance.dissipated,
            )
            for name, drive in d.items()
        ),
        near(
            "mean power with the spring, of that without",
            OURS,
            1.0,
            sprung.mean_power / d["without a spring"].mean_power,
            1e-9,
        ),
        *spring_verdicts(),
        at_least("feed-forward alone loses the motion; status of the run", OURS, 1.0, r["feed-forward"].loop.status),
        at_most("rms error of the slider; feed-forward and feedback", OURS, 0.1, 1e3 * metrics["both"].rms_error, "mm"),
        at_least(
            "rms error with feedback alone, of that with both",
            OURS,
            1.5,
            metrics["feedback"].rms_error / metrics["both"].rms_error,
        ),
        at_most(
            "rms error with both on the plant as it is known, of that on the other",
            OURS,
            0.5,
            metrics["both; plant known"].rms_error / metrics["both"].rms_error,
        ),
        at_most(
            "largest error of the rocker's angle on the plant over its tolerance",
            OURS,
            1.05,
            max(degrees(found.attained) / tolerance for tolerance, found in e.items()),
        ),
        at_most("greatest growth of the least force with the tolerance", OURS, 0.0, np.diff(effort).max(), "N"),
        at_most(
            "least rms force within 0.25 deg, of that of the motion itself", OURS, 1.0, effort[0] / exact.rms_force
        ),
    )
    return StudyResult(
        number=NUMBER,
        claim="The slider is to be moved by a control force as the kinematics ask.",
        assignment=f"{ASSIGNED} The masses, the damper, the friction and the controller are our choice.",
        columns=padded(columns),
        verdicts=verdicts,
    )


def draw(result: StudyResult) -> Figure:
    """Force and power, pins, tracking, and what a tolerance saves."""
    c = result.columns
    angle = {"x_label": "crank angle [deg]", "x_ticks": range(0, 361, 60)}
    turn = c["crank angle [deg]"]

    def over(names: dict[str, str], y_label: str, title: str) -> Panel:
        curves = [Curve(x=turn, y=c[name], label=label) for name, label in names.items()]
        return Panel(y_label=y_label, title=title, curves=curves, **angle)  # type: ignore[arg-type]

    springs = list(drives())
    tracked = [
        Curve(x=c[f"turns; {name} [1]"], y=c[f"error; {name} [mm]"], label=label, colour=colour)
        for (name, label), colour in zip(
            {"feed-forward": "feed-forward alone", "feedback": "feedback alone", "both": "both"}.items(),
            (COLOURS[2], COLOURS[1], COLOURS[0]),
        )
    ]
    panels = [
        over({f"force; {name} [N]": name for name in springs}, "control force [N]", "force on the slider"),
        over({f"power; {name} [W]": name for name in springs}, "power [W]", "power of that force"),
        over({f"pin {pin} [N]": f"pin {pin}" for pin in PINS}, "force in the pin [N]", "pins, with the spring"),
        Panel(
            x_label="turns of the crank",
            y_label="error of the slider [mm]",
            title="followed on a plant that is not quite known",
            curves=tracked,
            y_range=(-1.5, 1.5),
        ),
        Panel(
            x_label="tolerance of the rocker's angle [deg]",
            y_label="least rms force [N]",
            title="what a tolerance saves, without friction",
            curves=[Curve(x=c["tolerance [deg]"], y=c["least rms force [N]"], marker="o")],
        ),
        over(
            {"force; exactly [N]": "exactly", f"force; within {SHOWN:g} deg [N]": f"within {SHOWN:g} deg"},
            "control force [N]",
            "the force without friction",
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 2.9))


STUDY = Study(NUMBER, compute, draw)
