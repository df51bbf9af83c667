"""Fig 3.10: the torque of a launch against the time it takes.

Section 3.2.2 of the thesis sets T0 against the time to th2 = 1 rad and calls the relation hyperbolic, T0 t = const. But a
body that starts from rest under a given torque takes a time that goes as the root of inertia over torque: T0 t^2 should be
nearly constant, and it is. The exponent is -1.95, the mean of -1.92 and -1.98 between the thesis's three torques: it
tends to -2 as gravity, spring and damper cease to matter. The captions are lost: that this relation stands under the
number 3.10 is our assignment.
"""

from __future__ import annotations

import numpy as np

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, at_most, near
from ._runs import TORQUES, launch

NUMBER = "3.10"

#: Torques of the curve (dyn.cm).
RANGE = np.geomspace(TORQUES[0], TORQUES[-1], 14)


def release_time(torque: float) -> float:
    """Time from rest to th2 = 1 rad (s) under T0 in dyn.cm, k = 1e6 dyn/cm."""
    return launch(torque, 1e6).events[0].time


def compute() -> StudyResult:
    """Time to 1 rad over the torque, and the exponent."""
    time = np.array([release_time(float(torque)) for torque in RANGE])
    slopes = np.diff(np.log(TORQUES)) / np.diff(np.log([release_time(torque) for torque in TORQUES]))
    fitted = np.polyfit(np.log(time), np.log(RANGE), 1)[0]
    constant = RANGE * time**2
    return StudyResult(
        number=NUMBER,
        claim="T0 is hyperbolic in the time to 1 rad, exponent -1.",
        assignment=ASSIGNED,
        columns={"T0 [dyn.cm]": RANGE, "time to 1 rad [s]": time, "T0 t^2 [dyn.cm.s2]": constant},
        verdicts=(
            near("exponent of T0 in the time to 1 rad", TEXT, -1.0, slopes.mean(), 0.05),
            near("exponent, mean of the two between the three torques", OURS, -1.95, slopes.mean(), 0.005),
            near("exponent, fitted to all of the curve", OURS, -1.95, fitted, 0.02),
            at_most("spread of T0 t^2 over a factor of 20 in T0", OURS, 0.15, np.ptp(constant) / constant.mean()),
            near("time to 1 rad; T0 = 1e8 dyn.cm", OURS, 0.02137446194, release_time(1e8), 1e-10, "s"),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Torque over time on logarithmic axes, with lines of exponent -1 and -2 through T0 = 1e8."""
    torque, time = result.columns["T0 [dyn.cm]"], result.columns["time to 1 rad [s]"]
    hinge = float(np.interp(1e8, torque, time))
    three = np.interp(TORQUES, torque, time)
    left = Panel(
        x_label="time to 1 rad [s]",
        y_label=r"$T_0$ [dyn cm]",
        curves=[
            Curve(x=time, y=torque, label="computed"),
            Curve(x=three, y=TORQUES, line="", marker="o", colour=COLOURS[0], label="the thesis's torques"),
            Curve(x=time, y=1e8 * (hinge / time) ** 2, label=r"$T_0\,t^2$ constant", line="--", colour="#333333"),
            Curve(x=time, y=1e8 * hinge / time, label=r"$T_0\,t$ constant", line=":", colour="#333333"),
        ],
        logarithmic="xy",
        x_ticks=(0.015, 0.02, 0.03, 0.05, 0.07),
    )
    right = Panel(
        x_label=r"$T_0$ [dyn cm]",
        y_label=r"$T_0\,t^2$ [dyn cm s$^2$]",
        curves=[Curve(x=torque, y=result.columns["T0 t^2 [dyn.cm.s2]"])],
        logarithmic="x",
        y_range=(0.0, 6e4),
    )
    return plot_curves([left, right], title=result.heading, columns=2, size=(4.4, 3.6))


STUDY = Study(NUMBER, compute, draw)
