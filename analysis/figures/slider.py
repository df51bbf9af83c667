"""Plot slider motions: position, force and power over a crank turn, and the errors of tracking."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..slider import SliderDrive, TrackingResult
from ..units import ROUNDING
from .curves import Curve, Panel, plot_curves
from .dispatch import plot


@plot.register
def plot_drive(drive: SliderDrive, *, title: str = "") -> Figure:
    """Plot slider position, control force and power, crank torque, transmission angle and pin forces over a crank turn."""
    x = np.degrees(np.abs(drive.crank_angle))
    parts = [
        ("slider position [mm]", [Curve(x=x, y=1e3 * drive.states[:, 1])]),
        ("control force [N]", [Curve(x=x, y=drive.force)]),
        ("power of the force [W]", [Curve(x=x, y=drive.power)]),
        ("crank torque [N.m]", [Curve(x=x, y=drive.torque)]),
        ("transmission angle [deg]", [Curve(x=x, y=np.degrees(drive["transmission.angle"]))]),
        ("pin forces [N]", [Curve(x=x, y=drive.pin_force(pin), label=pin) for pin in "ABCD"]),
    ]
    ticks = [0.0, 90.0, 180.0, 270.0, 360.0]
    panels = [
        Panel(x_label="crank rotation [deg]", y_label=label, curves=curves, x_ticks=ticks, legend_at="outside")
        for label, curves in parts
    ]
    return plot_curves(panels, title=title, columns=2, size=(4.4, 2.4))


@plot.register
def plot_tracking(run: TrackingResult, *, title: str = "") -> Figure:
    """Plot the errors of slider and coupler point and the control force over time; curves that are zero are left out."""
    time = run.loop.time
    rows = (
        ("slider error [mm]", 1e3 * run.error),
        ("coupler point error [mm]", 1e3 * run.point_error),
        ("control force [N]", run.loop.force),
    )
    drawn = [label for label, values in rows if np.ptp(values) > ROUNDING]
    panels = [
        Panel(x_label="time [s]", y_label=label, curves=[Curve(x=time, y=values)])
        for label, values in rows
        if label in drawn or not drawn
    ]
    still = [label.partition(" [")[0] for label, _ in rows if drawn and label not in drawn]
    notes = [f"Zero throughout, not drawn: {', '.join(still)}."] if still else []
    return plot_curves(panels, title=title or f"Tracking: {run.method}", size=(6.4, 2.2), notes=notes)
