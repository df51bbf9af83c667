"""Plot a free decay: the record, its turning points and the fitted envelope, or the fitted curve."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..numerics.decay import Decay
from ..units import display_scale
from .curves import Curve, Panel, plot_curves
from .dispatch import plot
from .style import COLOURS, Figure


@plot.register
def plot_decay(
    decay: Decay, record: tuple[ArrayLike, ArrayLike] | None = None, *, unit: str = "", title: str = ""
) -> Figure:
    """Plot the turning points of a free decay with their envelope, and the decrement of each cycle.

    If the whole curve was fitted (see `Decay.whole`), plot the record and the fitted curve instead.

    Parameters
    ----------
    decay : Decay
    record : (array_like, array_like), optional
        Times (s) and positions from which the decay was found.
    unit : str
        Unit of the positions; lengths in m are shown in mm, angles in rad in degrees.
    title : str
    """
    shown, factor = display_scale(unit)
    label = f"position [{shown}]" if unit else "position"
    curves = []
    if record is not None:
        curves.append(Curve(x=record[0], y=factor * np.asarray(record[1]), label="record", colour=COLOURS[0]))
    points: dict[str, Any] = {"line": "", "marker": "o", "colour": COLOURS[1]}
    fit: dict[str, Any] = {"line": "--", "colour": "0.35"}
    if decay.whole:
        curves.append(Curve(x=decay.time, y=factor * decay.fitted, label="fit", **fit))
        panel = Panel(x_label="time [s]", y_label=label, curves=curves)
        return plot_curves([panel], title=title)
    curves.append(Curve(x=decay.time, y=factor * decay.position, label="turning points", **points))
    curves += [
        Curve(x=decay.time[side::2], y=factor * decay.fitted[side::2], label="" if side else "fit", **fit)
        for side in (0, 1)
    ]
    cycles = np.arange(1, len(decay.cycle_decrements) + 1)
    panels = [
        Panel(x_label="time [s]", y_label=label, curves=curves),
        Panel(
            x_label="swing",
            x_ticks=cycles.tolist(),
            y_label="logarithmic decrement of a cycle",
            curves=[
                Curve(x=cycles, y=decay.cycle_decrements, label="from two swings", **points),
                Curve(x=cycles[[0, -1]], y=[decay.decrement] * 2, label="of the damper, by the fit", **fit),
            ],
            y_range=(0.0, 1.3 * max(decay.decrement, float(decay.cycle_decrements.max()))),
        ),
    ]
    return plot_curves(panels, title=title, columns=2, size=(5.0, 3.6))
