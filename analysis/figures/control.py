"""Bode diagrams and pole-zero maps of linear systems, from python-control's data."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike, NDArray

from ..libraries import lazy
from ..linear import Design, LinearModel
from .dispatch import plot
from .style import BOLD, COLOURS, DOT, LINE, LINES, REFERENCE, figure_style, finish, legend_above

if TYPE_CHECKING:
    import control
else:
    control = lazy("control")

FloatArray: TypeAlias = NDArray[np.float64]


@figure_style()
def plot_bode(
    systems: Mapping[str, Any],
    *,
    unit: str = "",
    frequencies: ArrayLike | None = None,
    margins: bool = False,
    title: str = "",
) -> Figure:
    """Plot magnitude and phase of several systems, with one input and one output each, in one Bode diagram.

    Parameters
    ----------
    systems : mapping
        Linear systems of python-control, by their names in the legend.
    unit : str
        Unit of the output divided by the unit of the input; the magnitude is not in decibels.
    frequencies : array_like, shape (n,), optional
        Frequencies (rad/s); by default python-control chooses common frequencies for all systems.
    margins : bool
        Whether to mark gain and phase margins and state them in the legend; the systems must be open loops.
    title : str
    """
    responses = control.frequency_response(list(systems.values()), frequencies)
    figure = Figure(figsize=(6.4, 4.8))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for number, ((label, system), response) in enumerate(zip(systems.items(), responses)):
        look = {"color": COLOURS[number % len(COLOURS)], "linestyle": LINES[number % len(LINES)]}
        # python-control squeezes the axes of one input and one output away
        value = np.asarray(response.frdata)[0, 0]
        phase = np.degrees(np.unwrap(np.angle(value)))
        # shifted by whole turns so that the first value is within half a turn
        phase -= 360.0 * round(phase[0] / 360.0)
        words = label
        if margins:
            found = _Margins.from_loop(system)
            words = ": ".join(text for text in (label, found.report()) if text)
            _mark_margins(above, below, found, response.omega, phase, look["color"])
        above.loglog(response.omega, np.abs(value), label=words or None, **look)
        below.semilogx(response.omega, phase, **look)
    if margins:
        above.axhline(1.0, **REFERENCE)
        below.axhline(-180.0, **REFERENCE)
    above.set_ylabel(f"magnitude [{unit}]" if unit else "magnitude")
    below.set_ylabel("phase [deg]")
    below.set_xlabel("frequency [rad/s]")
    below.yaxis.set_major_locator(MultipleLocator(90.0))
    if any(systems) or margins:
        legend_above(above, ncols=1 if margins else 4)
    figure.align_ylabels()
    return finish(figure, title)


class _Margins(NamedTuple):
    """Stability margins of an open loop.

    ``gains`` has pairs (gain factor, frequency in rad/s) at which the closed loop becomes unstable: the nearest factor below 1
    and the nearest above 1, if they exist. ``phase`` is (phase margin in deg, frequency). ``stable`` says whether the closed
    loop is stable without changes.
    """

    gains: tuple[tuple[float, float], ...] = ()
    phase: tuple[float, float] | None = None
    stable: bool = True

    @classmethod
    def from_loop(cls, system: Any) -> _Margins:
        """Find the margins of the open loop ``system``: the changes of gain or of phase that make the closed loop unstable.

        The gain factors are those nearest to 1, and the change of phase is the smallest.
        """
        poles = control.feedback(system, 1).poles()
        if not np.all(np.abs(poles) < 1.0 if system.isdtime(strict=True) else poles.real < 0.0):
            return cls(stable=False)
        gain, phase, _, at_gain, at_phase, _ = control.stability_margins(system, returnall=True)
        pairs = sorted(zip(np.atleast_1d(gain).tolist(), np.atleast_1d(at_gain).tolist()))
        down, up = [p for p in pairs if 0.0 < p[0] < 1.0], [p for p in pairs if 1.0 < p[0] < inf]
        angles = zip(np.atleast_1d(phase).tolist(), np.atleast_1d(at_phase).tolist())
        return cls((*down[-1:], *up[:1]), min(angles, key=lambda pair: abs(pair[0]), default=None))

    def report(self) -> str:
        """Return the margins in words."""
        if not self.stable:
            return "the closed loop is not stable"
        words = [f"gain {'reduction ' if gain < 1.0 else ''}margin {gain:.3g}" for gain, _ in self.gains]
        words += [] if self.phase is None else [f"phase margin {abs(self.phase[0]):.1f} deg"]
        return ", ".join(words) or "stable at any gain"


def _mark_margins(above: Axes, below: Axes, found: _Margins, omega: FloatArray, phase: FloatArray, colour: str) -> None:
    """Draw the gain margin as a bar at the phase -180 deg, and the phase margin as a bar at the magnitude 1."""
    look: dict[str, Any] = {"color": colour, "linewidth": BOLD, "marker": "o", "zorder": 4}
    for gain, at in found.gains:
        above.plot([at, at], [1.0 / gain, 1.0], gid="gain margin", **look)
    if found.phase is not None:
        at = found.phase[1]
        there = float(np.interp(np.log(at), np.log(omega), phase))
        below.plot([at, at], [there, there - found.phase[0]], gid="phase margin", **look)


@plot.register
def plot_design(design: Design, *, frequencies: ArrayLike | None = None, title: str = "") -> Figure:
    """Plot magnitude and phase of a controller's open loop with its margins; see `plot_bode`."""
    return plot_bode({design.method: design.loop}, frequencies=frequencies, margins=True, title=title)


@plot.register
def plot_linear_model(
    model: LinearModel, output: str | None = None, input: str | None = None, **options: Any
) -> Figure:
    """Plot magnitude and phase of a linear model from one input to one output, by FMI names; see `plot_bode`.

    By default the output is the last coordinate that is not commanded, and the input is the force along this coordinate.
    """
    units = {v.name: v.unit for v in model.mechanism.variables}
    source = model.force_channel()[0] if input is None else input
    target = model.state_names[len(model.state_names) // 2 - 1] if output is None else output
    per = f"({units[source]})" if "." in units[source] else units[source]
    return plot_bode({"": model.to_state_space((target,), (source,))}, unit=f"{units[target]}/{per}", **options)


@figure_style()
def plot_poles(systems: Mapping[str, Any], *, title: str = "") -> Figure:
    """Plot poles (crosses) and zeros (circles) of systems in the complex plane, with one scale on both axes.

    Parameters
    ----------
    systems : mapping
        Linear systems of python-control, by their names in the legend.
    """
    figure = Figure(figsize=(6.4, 5.0))
    axis = figure.subplots()
    axis.axhline(0.0, **REFERENCE)
    axis.axvline(0.0, **REFERENCE)
    for number, (label, system) in enumerate(systems.items()):
        points = control.pole_zero_map(system)
        colour = COLOURS[number % len(COLOURS)]
        # systems with a common pole or zero show rings of different sizes there
        size = DOT * (1.0 + 0.5 * number)
        look: dict[str, Any] = {"linestyle": "none", "color": colour, "zorder": 3, "markersize": size}
        for what, places, mark in (
            ("poles", np.asarray(points.poles), {"marker": "x", "markeredgewidth": LINE}),
            ("zeros", np.asarray(points.zeros), {"marker": "o", "fillstyle": "none"}),
        ):
            if len(places) or what == "poles":
                axis.plot(places.real, places.imag, label=f"{label}: {what}".removeprefix(": "), **look | mark)
    axis.set_xlabel("real part [1/s]")
    axis.set_ylabel("imaginary part [rad/s]")
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.12)
    axis.legend()
    return finish(figure, title)
