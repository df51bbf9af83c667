"""Plot periodic motions: coordinates and torque over a period, and Floquet multipliers."""

from __future__ import annotations

import numpy as np

from ..display import format_turns
from ..mechanisms import find_mechanism
from ..periodic import Orbits, PeriodicOrbit, Turn
from ..units import RAD_S_PER_RPM
from .curves import Curve, Panel, plot_curves
from .dispatch import plot
from .runs import display_unit
from .style import Figure, name_in_words

#: Number of samples in a period.
_SAMPLES = 512


@plot.register
def plot_orbit(orbit: PeriodicOrbit, *, title: str = "") -> Figure:
    """Plot a periodic motion over the crank angle and in the phase plane, and its Floquet multipliers.

    The quantities over the crank angle are the coordinates that are not commanded, the crank speed if a torque drives the
    crank, and the driving torques.

    Parameters
    ----------
    orbit : PeriodicOrbit
    title : str
        By default the title states the speed, the period and the stability.
    """
    turn, mechanism = orbit.turn(_SAMPLES), find_mechanism(orbit.parameters)
    variables = {v.name: v for v in mechanism.variables}
    rates = {freedom.coordinate: freedom.rate for freedom in mechanism.freedoms}
    free = [mechanism.freedoms[n] for n in orbit.flow.free]
    crank = mechanism.freedoms[orbit.flow.crank]
    names = [freedom.coordinate for freedom in free]
    if not orbit.drive.speed_drive:
        names.append(crank.rate)
    names += [
        name for n in mechanism.cyclic_freedoms for name in mechanism.names("drive", mechanism.freedoms[n].coordinate)
    ]

    def output_over_period(name: str) -> tuple[np.ndarray, str]:
        """Return an output over the period in display units, with its value at the end of the period, and its axis label."""
        unit, factor = display_unit(variables[name])
        return factor * _output_over_turn(turn, name), f"{name_in_words(name)} [{unit}]"

    angle = np.degrees(np.append(turn.angle, orbit.flow.period * orbit.turns))
    ticks = np.linspace(0.0, angle[-1], 5).tolist()
    panels = []
    for name in names:
        values, label = output_over_period(name)
        panels.append(
            Panel(x_label="crank angle [deg]", y_label=label, curves=[Curve(x=angle, y=values)], x_ticks=ticks)
        )
    if free:
        (x, x_label), (y, y_label) = output_over_period(turn.swings[0]), output_over_period(rates[turn.swings[0]])
        begin = Curve(x=x[:1], y=y[:1], line="", marker="o")
        caption = "point at the crank angle 0"
        panels.append(Panel(x_label=x_label, y_label=y_label, curves=[Curve(x=x, y=y), begin], title=caption))
    panels.append(_multipliers(orbit))
    return plot_curves(panels, title=title or _title(orbit, turn.period), columns=2, size=(4.4, 2.9))


def _output_over_turn(turn: Turn, name: str) -> np.ndarray:
    """Return an output over the period, with its value at the end of the period appended.

    The appended value is the value at the start, for an angle plus whole turns.
    """
    values = turn[name]
    whole = 2.0 * np.pi * np.round((values[-1] - values[0]) / (2.0 * np.pi)) if name in turn.angles else 0.0
    return np.append(values, values[0] + whole)


def _multipliers(orbit: PeriodicOrbit) -> Panel:
    """Return the panel of the Floquet multipliers and the unit circle; a multiplier outside the circle means instability."""
    circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 181))
    return Panel(
        x_label="real part",
        y_label="imaginary part",
        curves=[
            Curve(x=circle.real, y=circle.imag, colour="0.5", line="--"),
            Curve(x=orbit.multipliers.real, y=orbit.multipliers.imag, line="", marker="x"),
        ],
        title="Floquet multipliers, stable inside the circle",
        equal=True,
    )


def _title(orbit: PeriodicOrbit, period: float) -> str:
    speed = orbit.flow.period * orbit.turns / period
    turns = format_turns(orbit.crank_turns)
    return f"Periodic motion of {turns} at {speed / RAD_S_PER_RPM:.5g} rpm, {orbit.verdict().stability.value}"


@plot.register
def plot_orbits(found: Orbits, *, title: str = "") -> Figure:
    """Plot a coordinate of all motions found at one speed over the crank angle; unstable motions are dashed.

    The coordinate is the first that is not commanded.
    """
    curves, label = [], "first free coordinate"
    for orbit in found.orbits:
        turn = orbit.turn(_SAMPLES)
        variable = next(v for v in find_mechanism(orbit.parameters).variables if v.name == turn.swings[0])
        unit, factor = display_unit(variable)
        label = f"{name_in_words(turn.swings[0])} [{unit}]"
        stable = orbit in found.stable
        curves.append(
            Curve(
                x=np.degrees(np.append(turn.angle, orbit.flow.period * orbit.turns)),
                y=factor * _output_over_turn(turn, turn.swings[0]),
                line="-" if stable else "--",
                label=f"{orbit.verdict().stability.value}, largest multiplier {orbit.largest:.3g}",
            )
        )
    if not title and found.orbits:
        orbit = found.orbits[0]
        speed = orbit.flow.period * orbit.turns / orbit.turn(2).period / RAD_S_PER_RPM
        title = f"Periodic motions found at {speed:.5g} rpm"
    ticks = np.linspace(0.0, np.max([curve.x for curve in curves]), 5).tolist() if curves else None
    return plot_curves([Panel(x_label="crank angle [deg]", y_label=label, curves=curves, x_ticks=ticks)], title=title)
