"""Bode, pole and zero plots of linear systems, from python-control's data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control
import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike

from ..linear import LinearModel
from .dispatch import plot
from .style import COLOURS, STYLE, finish

LINES = ("-", "--", "-.", ":")


def plot_bode(
    systems: Mapping[str, Any], *, unit: str = "", frequencies: ArrayLike | None = None, title: str = ""
) -> Figure:
    """Plot magnitude and phase of systems with one input and one output over each other.

    Parameters
    ----------
    systems : mapping
        What the legend calls it to a linear system of python-control.
    unit : str
        Of the output over the input; the magnitude is not in decibels.
    frequencies : array_like, shape (n,), optional
        rad/s; by default python-control's choice for all of them.
    """
    responses = control.frequency_response(list(systems.values()), frequencies)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 4.8))
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for number, (label, response) in enumerate(zip(systems, responses)):
            look = {"color": COLOURS[number % len(COLOURS)], "linestyle": LINES[number % len(LINES)]}
            # python-control squeezes the axes of one input and one output away
            value = np.asarray(response.frdata)[0, 0]
            phase = np.degrees(np.unwrap(np.angle(value)))
            # from the branch in which the first value is within half a turn
            phase -= 360.0 * round(phase[0] / 360.0)
            above.loglog(response.omega, np.abs(value), label=label or None, **look)
            below.semilogx(response.omega, phase, **look)
        above.set_ylabel(f"magnitude [{unit}]" if unit else "magnitude")
        below.set_ylabel("phase [deg]")
        below.set_xlabel("frequency [rad/s]")
        below.yaxis.set_major_locator(MultipleLocator(90.0))
        if any(systems):
            above.legend(fontsize=8)
        if title:
            figure.suptitle(title, fontsize=10.5, fontweight="bold")
        figure.align_ylabels()
        return finish(figure)


@plot.register
def plot_linear_model(
    model: LinearModel, output: str | None = None, input: str | None = None, **options: Any
) -> Figure:
    """Magnitude and phase of a linear model from one input to one output, by their FMI names; see `plot_bode`.

    By default from the force on the last free freedom to the last free coordinate.
    """
    units = {v.name: v.unit for v in model.mechanism.variables}
    source = model.force_channel()[0] if input is None else input
    target = model.state_names[len(model.state_names) // 2 - 1] if output is None else output
    per = f"({units[source]})" if "." in units[source] else units[source]
    return plot_bode({"": model.to_state_space((target,), (source,))}, unit=f"{units[target]}/{per}", **options)


def plot_poles(systems: Mapping[str, Any], *, title: str = "") -> Figure:
    """Plot poles (crosses) and zeros (circles) of systems, in the complex plane with one scale on both axes.

    Parameters
    ----------
    systems : mapping
        What the legend calls it to a linear system of python-control.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 5.0))
        axis = figure.subplots()
        axis.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
        axis.axvline(0.0, color="0.6", linewidth=0.8, zorder=1)
        for number, (label, system) in enumerate(systems.items()):
            points = control.pole_zero_map(system)
            colour = COLOURS[number % len(COLOURS)]
            look: dict[str, Any] = {"linestyle": "none", "color": colour, "zorder": 3}
            poles, zeros = np.asarray(points.poles), np.asarray(points.zeros)
            axis.plot(poles.real, poles.imag, marker="x", label=f"{label} poles".strip(), markeredgewidth=1.4, **look)
            if len(zeros):
                axis.plot(zeros.real, zeros.imag, marker="o", fillstyle="none", label=f"{label} zeros".strip(), **look)
        axis.set_xlabel("real part [1/s]")
        axis.set_ylabel("imaginary part [rad/s]")
        axis.set_aspect("equal", adjustable="datalim")
        axis.margins(0.12)
        axis.legend(fontsize=8)
        if title:
            figure.suptitle(title, fontsize=10.5, fontweight="bold")
        return finish(figure)
