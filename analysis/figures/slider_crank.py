"""Plot the forces of the slider-crank over a turn, and the effect of tolerances, for a design review."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, PercentFormatter
from numpy.typing import NDArray
from scipy.special import ndtr

from linkwork.errors import InputError

from ..slider_crank import JOINTS, QUANTITIES, SLIDER_FORCE, SYMBOLS, ForceTurn, MonteCarlo, shown_units
from ..units import Amount
from . import style
from .curves import Curve, Panel, plot_curves
from .dispatch import plot

FloatArray = NDArray[np.float64]

_LINEAR, _SAMPLES, _SECOND, _WORST = style.COLOURS[0], style.COLOURS[1], style.COLOURS[2], "0.45"
#: If the greatest error over the turn is above the first number times the median, the axis ends at the second number times it.
_PEAK, _CUT = 12.0, 4.0
#: Shares to second order are not drawn if they differ by less than this from the shares to first order.
_SAME_SHARE = 0.02
#: A curve is zero below this share of the largest value with the same unit.
_ZERO = 1e-12
#: Greatest number of letters in a line of the notes at the foot.
_LETTERS = 140


@plot.register
def plot_forces(turn: ForceTurn, frame: int = 1, *, units: str = "SI", title: str = "") -> Figure:
    """Plot slider position, torque and the components of the joint forces in a frame over the crank angle.

    Curves are cut off near poles and limits of assembly, and have gaps where the mechanism cannot be assembled. Dead centres
    and limits are dashed lines, named at the foot. Quantities that are zero or constant are stated there too, without a panel.

    Parameters
    ----------
    turn : ForceTurn
    frame : int
        Number of the frame: 1 ground, 2 crank, 3 rod, 4 guide.
    units : str
        One of `analysis.slider_crank.UNITS`. With "SI" lengths are shown in mm.
    title : str

    Raises
    ------
    InputError
        If the frame or the units do not exist.
    """
    contents: list[tuple[str, str, Mapping[str, Any]]] = [
        ("slider position S4", "m", {"": turn.slider_position}),
        ("crank torque", "N.m", {"": turn.torque}),
        ("slider force, along -k4", "N", {"": turn.slider_force}),
        ("axial force on the crank", "N", {"": turn.axial_force}),
    ]
    for name, joint in JOINTS.items():
        components = {f"{axis}{frame}": values for axis, values in zip("ijk", turn.vector(name, frame).T)}
        contents.append((joint.words, joint.unit, components))
    known = shown_units(units)
    # zero but for rounding, relative to the largest value with the same unit
    sizes = {name: _largest(curves.values()) for name, _, curves in contents}
    scales = {si: max(sizes[name] for name, other, _ in contents if other == si) for _, si, _ in contents}
    zero = [name for name, si, _ in contents if sizes[name] <= _ZERO * scales[si]]
    still = {name: _constant_text(curves, *known[si]) for name, si, curves in contents if name not in zero}
    panels = [
        _force_panel(turn, name, si, *known[si], curves) for name, si, curves in contents if still.get(name) == ""
    ]
    notes = [f"Dashed: {', '.join(_marked_angles(turn))}."] if _marked_angles(turn) else []
    said = [f"{name} {value}" for name, value in still.items() if value]
    notes += [f"Constant, not drawn: {'; '.join(said)}."] if said else []
    notes += [f"Zero throughout, not drawn: {'; '.join(zero)}."] if zero else []
    return plot_curves(panels, title=title, columns=2, size=(5.2, 2.5), notes=notes)


def _largest(curves: Iterable[Any]) -> float:
    """Return the largest magnitude of curves, masked values and NaN ignored."""
    return max(float(np.nanmax(np.abs(np.ma.filled(values, np.nan)), initial=0.0)) for values in curves)


def _constant_text(curves: Mapping[str, Any], unit: str, factor: float) -> str:
    """Return the value of a curve as text with unit if the curve is constant and the only one; otherwise an empty text.

    ``factor`` is the size of ``unit`` in SI.
    """
    values = np.concatenate([np.array(np.ma.filled(given, np.nan)) for given in curves.values()])
    values = values[np.isfinite(values)]
    constant = len(curves) == 1 and len(values) and np.ptp(values) <= _ZERO * np.abs(values).max()
    return f"{values[0] / factor:.4g} {unit}" if constant else ""


def _marked_angles(turn: ForceTurn) -> dict[str, float]:
    """Return the crank angles (deg) of dead centres and limits of assembly by name."""
    marks = {f"dead centre {np.degrees(d.crank_angle):.1f}°": np.degrees(d.crank_angle) for d in turn.dead_centres}
    return marks | {f"limit of assembly {np.degrees(end):.1f}°": np.degrees(end) for end in turn.limits}


def _force_panel(
    turn: ForceTurn, title: str, si: str, unit: str, factor: float, components: Mapping[str, Any]
) -> Panel:
    """Return a panel of the curves ``components``, given in SI by label, over the turn.

    ``si`` is their unit in SI, ``unit`` the unit on the axis, and ``factor`` the size of ``unit`` in SI.
    """
    angle = np.degrees(turn.angle)
    grows = si != "m"
    poles = turn.singularities if grows and turn.sought == SLIDER_FORCE else ()
    curves, inside = [], []
    for (label, given), line in zip(components.items(), style.LINES):
        values = np.array(np.ma.filled(given, np.nan)) / factor
        inside.append(values[np.isfinite(values) & (turn.clear() | (not grows))])
        # a gap at each pole, where a curve changes its sign
        values[[int(np.argmin(np.abs(turn.angle - place.crank_angle))) for place in poles]] = np.nan
        curves.append(
            Curve(
                x=_insert_breaks(angle, turn.breaks, angle),
                y=_insert_breaks(values, turn.breaks),
                label=label,
                line=line,
            )
        )
    limits = None
    if np.concatenate(inside).size:
        low, high = float(np.concatenate(inside).min()), float(np.concatenate(inside).max())
        room = 0.08 * (high - low) or 0.08 * abs(high) or 1.0
        limits = low - room, high + room
    return Panel(
        x_label="crank angle [deg]",
        y_label=f"[{unit}]",
        curves=curves,
        dashed=list(_marked_angles(turn).values()),
        title=title,
        y_range=limits,
        x_ticks=[60.0 * n for n in range(7)],
        legend_at="outside",
    )


@plot.register
@style.figure_style()
def plot_tolerances(
    found: MonteCarlo, quantity: str = "slider.position", angle: Amount = 0.0, *, units: str = "SI", title: str = ""
) -> Figure:
    """Plot the errors that tolerances cause over the turn; at one crank angle, plot the samples and each tolerance's share.

    The upper panel shows the linear estimate (three standard deviations, at most the worst case, filled; worst case dashed) and
    percentiles of the samples. The lower panels show the histogram of the samples that can be assembled with the normal
    distribution of the linear estimate, and the shares of the tolerances in the variance. Notes at the foot state samples that
    cannot be assembled, and where the linear estimate is wrong.

    Parameters
    ----------
    found : MonteCarlo
    quantity : str
        Name of a sampled quantity.
    angle : float or str
        Crank angle (rad, or a text with its unit) of histogram and shares; the nearest sampled angle is used.
    units : str
        One of `analysis.slider_crank.UNITS`. With "SI" lengths are shown in mm.
    title : str

    Raises
    ------
    ParameterError
        If the quantity was not sampled.
    InputError
        If the quantity is not determined at that angle, there are fewer than two angles, or the units do not exist.
    """
    turn = found.turn
    if len(turn) < 2:
        raise InputError(f"a band over the turn needs two angles at least, not {len(turn)}")
    index = found.place(quantity, angle)
    si = QUANTITIES[quantity]
    unit, factor = shown_units(units)[si]
    name = quantity.replace(".", " ").replace("_", " ")
    most = int(found.not_assembled.max())
    lost = f"at worst {most / found.samples:.2%} of them cannot be assembled, and are left out"
    foot = [f"{found.samples:,} samples at each angle; {lost if most else 'all can be assembled'}."]
    foot += [f"{note[0].upper()}{note[1:]}." for note in found.notes(units)]
    lines = sum(len(fill(note, _LETTERS).splitlines()) for note in foot) - 1
    figure = Figure(figsize=(9.6, 7.0 + 0.16 * lines))
    above, below = np.ravel(figure.subfigures(2, 1, squeeze=False, height_ratios=(1.0, 1.0 + 0.03 * lines)))
    band = above.subplots()
    histogram, bars = below.subplots(1, 2, width_ratios=(3, 2))
    _draw_band(band, found, quantity, index, factor)
    _draw_histogram(histogram, found, quantity, index, unit, factor)
    band.set_ylabel(f"error of {name} [{unit}]")
    histogram.set_xlabel(f"error of {name} [{unit}]")
    _draw_shares(bars, found, quantity, index)
    style.write_notes(below, foot)
    return style.finish(figure, title or f"Tolerances: {name}")


def _draw_band(axis: Axes, found: MonteCarlo, quantity: str, index: int, factor: float) -> None:
    turn, spread, linear = found.turn, found.spreads[quantity], found.estimates[quantity]
    angle = np.degrees(turn.angle)
    whole = _insert_breaks(angle, turn.breaks, angle)

    def curve(values: Any) -> FloatArray:
        return _insert_breaks(np.ma.filled(values, np.nan) / factor, turn.breaks)

    # three standard deviations of a bounded distribution can exceed its greatest error
    three = curve(np.ma.minimum(3.0 * linear.deviation, linear.worst))
    axis.fill_between(whole, -three, three, color=_LINEAR, alpha=0.18, linewidth=0.0, label=r"linear, $\pm 3\,\sigma$")
    low, lower, _, upper, high = spread.percentiles - linear.nominal
    dashed: dict[str, Any] = {"color": _WORST, "linewidth": style.THIN, "linestyle": "--"}
    thin: dict[str, Any] = {"color": _SAMPLES, "linewidth": style.HAIR, "alpha": 0.7}
    mean: dict[str, Any] = {"color": "black", "linewidth": style.LINE, "linestyle": ":"}
    for values, look, label in (
        (linear.worst, dashed, "linear, worst case"),
        (-linear.worst, dashed, None),
        (high, {"color": _SAMPLES}, "samples, 0.135 % and 99.865 %"),
        (low, {"color": _SAMPLES}, None),
        (upper, thin, "samples, 2.3 % and 97.7 %"),
        (lower, thin, None),
        (spread.mean - linear.nominal, mean, "mean of the samples"),
    ):
        axis.plot(whole, curve(values), label=label, **look)
    axis.axvline(angle[index], color=style.MARK["color"], linewidth=style.THIN, linestyle="-.")
    for pole in found.poles(quantity):
        axis.axvline(np.degrees(pole), color=style.MARK["color"], linewidth=style.THIN, linestyle=":")
    # at each angle the largest departure that is not NaN, if there is one
    departures = [low, lower, upper, high, linear.worst]
    reach = np.fmax.reduce([np.abs(np.ma.filled(values, np.nan)) for values in departures], axis=0) / factor
    middle = float(np.nanmedian(reach))
    cut = float(np.nanmax(reach)) > _PEAK * middle > 0.0
    if cut:
        axis.set_ylim(-_CUT * middle, _CUT * middle)
    axis.set_xlim(angle.min(), angle.max())
    axis.xaxis.set_major_locator(MultipleLocator(30.0 if np.ptp(angle) > 120.0 else 10.0))
    axis.set_xlabel("crank angle [deg]" + " (dotted: dead centres, cut off)" * cut)
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, borderaxespad=0.2, columnspacing=1.2)


def _insert_breaks(values: FloatArray, breaks: Sequence[int], fill: FloatArray | None = None) -> FloatArray:
    """Return values (n,) with one value inserted after each index of ``breaks``: NaN, or the next value of ``fill`` (n,)."""
    after = np.array(breaks, dtype=int) + 1
    return np.insert(values, after, np.nan if fill is None else fill[after])


def _draw_histogram(axis: Axes, found: MonteCarlo, quantity: str, index: int, unit: str, factor: float) -> None:
    spread, linear = found.spreads[quantity], found.estimates[quantity]
    nominal = float(linear.nominal[index])
    edges = (spread.edges[index] - nominal) / factor
    width = edges[1] - edges[0]
    share = spread.counts[index] / (found.samples - found.not_assembled[index] - found.undetermined[index])
    axis.stairs(share, edges, fill=True, color=_SAMPLES, alpha=0.35, label="samples")
    deviation, of_samples, second = (
        float(np.ma.filled(x[index], np.nan)) / factor
        for x in (linear.deviation, spread.deviation, linear.second_deviation)
    )
    # a distribution narrower than a bin is drawn as a line
    if deviation > width:
        fine = np.linspace(edges[0], edges[-1], 400)
        share_of_bin = ndtr((fine + 0.5 * width) / deviation) - ndtr((fine - 0.5 * width) / deviation)
        axis.plot(fine, share_of_bin, color=_LINEAR, label="linear estimate, normal")
        for place in (-3.0 * deviation, 3.0 * deviation):
            if edges[0] <= place <= edges[-1]:
                axis.axvline(place, ymax=0.55, color=_LINEAR, linewidth=style.THIN, linestyle="--")
                axis.text(
                    place, 0.6, r"$3\,\sigma$", transform=axis.get_xaxis_transform(), ha="center", fontsize=style.SMALL
                )
    elif isfinite(deviation):
        axis.axvline(0.0, ymax=0.72, color=_LINEAR, linewidth=style.BOLD, label="linear estimate: no spread")
    sigmas = {"of the samples": of_samples, "linear": deviation, "to second order": second}
    lines = [f"$\\sigma$ {what} {_number_text(x)} {unit}" for what, x in sigmas.items() if isfinite(x)]
    axis.set_ylabel("share of the samples")
    axis.yaxis.set_major_formatter(PercentFormatter(1.0))
    axis.set_xlim(edges[0], edges[-1])
    axis.set_ylim(0.0, 1.5 * float(share.max()))
    axis.set_title(
        f"at {np.degrees(found.turn.angle[index]):.4g} deg, nominal {_number_text(nominal / factor, 6)} {unit}; "
        f"{share.sum():.1%} of the samples" + " that can be assembled" * bool(found.not_assembled[index]),
        fontsize=style.PLAIN,
    )
    axis.legend(loc="upper left")
    axis.text(0.985, 0.97, "\n".join(lines), transform=axis.transAxes, ha="right", va="top", fontsize=style.SMALL)


def _draw_shares(axis: Axes, found: MonteCarlo, quantity: str, at: int) -> None:
    estimate = found.estimates[quantity]
    both = np.ma.column_stack([estimate.shares[:, at], estimate.second_shares[:, at]]).filled(np.nan)
    linear, second = (bool(np.isfinite(column).all()) for column in both.T)
    order = np.argsort(both[:, 1] if second else both[:, 0], kind="stable")
    shares = both[order]
    names = [found.tolerances[i].name for i in order]
    # the second order is drawn if it differs from the first
    second = second and not (linear and np.abs(shares[:, 1] - shares[:, 0]).max() < _SAME_SHARE)
    orders = [(0, _LINEAR, "linear")] * linear + [(1, _SECOND, "to second order")] * second
    axis.set_title("share in the variance" + ", linear" * (not second))
    if not orders:
        none = "no variance to first or second order"
        if np.ma.getmaskarray(estimate.deviation)[at]:
            none = "no variance: a dead centre is within the tolerances"
        axis.text(0.5, 0.5, none, ha="center", va="center", fontsize=style.PLAIN)
        axis.set_axis_off()
        return
    height = 0.66 / len(orders)
    for number, (column, colour, label) in enumerate(orders):
        places = np.arange(len(names)) + height * (0.5 * (len(orders) - 1) - number)
        bars = axis.barh(places, shares[:, column], color=colour, alpha=0.8, height=height, label=label)
        labels = [f"{share:.1%}" if share >= 5e-4 else "< 0.1%" for share in shares[:, column]]
        axis.bar_label(bars, labels, padding=3, fontsize=style.SMALL)
    if second:
        axis.legend(loc="lower right")
    axis.set_yticks(
        np.arange(len(names)),
        [style.name_in_words(name) + (f" ${SYMBOLS[name]}$" if name in SYMBOLS else "") for name in names],
    )
    axis.set_xlim(0.0, 1.22 * float(np.nanmax(shares)))
    axis.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axis.grid(visible=False, axis="y")


def _number_text(value: float, digits: int = 3) -> str:
    """Return a number as text to some digits; rounding errors give "0"."""
    return f"{value:.{digits}g}" if abs(value) > 1e-12 else "0"
