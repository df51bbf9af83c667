"""The slider-crank's forces over the turn, and what tolerances do to it, as figures for a design review."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import erf, isfinite, sqrt
from textwrap import fill

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, PercentFormatter
from numpy.typing import NDArray

from linkwork.errors import InputError

from .curves import Curve, Panel, plot_curves
from .style import COLOURS, STYLE, finish

FloatArray = NDArray[np.float64]

#: Units in which departures are shown, and how many of them one of SI is.
_SHOWN = {"m": ("mm", 1e3), "m/s": ("mm/s", 1e3)}
_LINEAR, _SAMPLES, _SECOND, _WORST = COLOURS[0], COLOURS[1], COLOURS[2], "0.45"
#: Greatest and middle departures over the turn: where their ratio is above this, the axis is cut at a multiple of the latter.
_PEAK, _CUT = 12.0, 4.0
#: Difference of shares to first and second order below which the latter are not drawn.
_TOLD = 0.02
#: Letters in a line of the foot.
_LINE = 140


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForcePanel:
    """Curves (n,) over the crank angle by their labels, in one unit, NaN where undetermined.

    ``grows`` says whether they grow without bound towards a pole or a limit of assembly.
    """

    title: str
    unit: str
    curves: Mapping[str, FloatArray]
    grows: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceScene:
    """Motion, forces and moments over the turn.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        Crank angles (rad).
    panels : sequence of ForcePanel
    clear : ndarray of bool, shape (n,)
        Angles at which nothing is near growing without bound: what the axes are scaled to.
    breaks : tuple of int
        Number of each angle between which and the next the mechanism cannot be assembled: a gap in every curve.
    poles : tuple of int
        Numbers of the angles nearest to a pole, across which what grows has no curve.
    marks : mapping
        Crank angles (rad) that are marked, by what they are marked with.
    """

    angle: FloatArray
    panels: Sequence[ForcePanel]
    clear: NDArray[np.bool_]
    breaks: tuple[int, ...] = ()
    poles: tuple[int, ...] = ()
    marks: Mapping[str, float] = field(default_factory=dict)


def plot_forces(scene: ForceScene, *, title: str) -> Figure:
    """Plot forces and moments over the crank angle, one pair of axes for each panel.

    Curves leave their axes towards poles and limits of assembly, and have gaps where there is no mechanism.
    """
    turn = np.degrees(scene.angle)
    angle = _broken(turn, scene.breaks, turn)
    panels = []
    for panel in scene.panels:
        curves, shown = [], []
        for label, given in panel.curves.items():
            values = np.array(given)
            shown.append(values[np.isfinite(values) & (scene.clear | (not panel.grows))])
            # from one side of a pole to the other a curve changes its sign
            values[list(scene.poles) if panel.grows else []] = np.nan
            curves.append(Curve(x=angle, y=_broken(values, scene.breaks), label=label))
        inside = np.concatenate(shown)
        limits = None
        if len(inside):
            low, high = float(inside.min()), float(inside.max())
            room = 0.08 * (high - low) or 0.08 * abs(high) or 1.0
            limits = low - room, high + room
        panels.append(
            Panel(
                x_label="crank angle [deg]",
                y_label=f"[{panel.unit}]",
                curves=curves,
                verticals={text: float(np.degrees(place)) for text, place in scene.marks.items()},
                title=panel.title,
                y_range=limits,
                x_ticks=[60.0 * n for n in range(7)],
                legend_at="outside",
            )
        )
    return plot_curves(panels, title=title, columns=2, size=(5.2, 2.5))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToleranceScene:
    """What tolerances do to one quantity over the turn, and at one angle of it; SI and radians, NaN where undetermined.

    Attributes
    ----------
    quantity, unit : str
        By its FMI name.
    angle : ndarray, shape (n,)
        Crank angles.
    deviation, worst : ndarray, shape (n,)
        Linear estimates: standard deviation, greatest departure.
    departures : ndarray, shape (p, n)
        Percentiles of the samples less the nominal value, those of a normal distribution at -3, -2, 0, 2, 3 standard
        deviations.
    mean : ndarray, shape (n,)
        Mean of the samples less the nominal value.
    at : int
        Number of the angle of histogram and shares.
    nominal : float
        Value there.
    edges, counts : ndarray, shapes (b + 1,) and (b,)
        Histogram of the samples less the nominal value; it need not hold all of them.
    sample_deviation, second_deviation : float
        Standard deviation of the samples, and estimated to second order.
    shares : mapping
        Of each tolerance, by its label, in the variance to first and to second order; NaN where that is zero.
    samples, not_assembled : int
        Samples, and the most at any angle that cannot be assembled.
    singular : tuple of float
        Crank angles at which the quantity has a pole.
    breaks : tuple of int
        Number of each angle between which and the next the mechanism cannot be assembled: a gap in every curve.
    notes : tuple of str
        Sentences for the foot of the figure.
    """

    quantity: str
    unit: str
    angle: FloatArray
    deviation: FloatArray
    worst: FloatArray
    departures: FloatArray
    mean: FloatArray
    at: int
    nominal: float
    edges: FloatArray
    counts: NDArray[np.int64]
    sample_deviation: float
    second_deviation: float
    shares: Mapping[str, tuple[float, float]]
    samples: int
    not_assembled: int
    singular: tuple[float, ...] = ()
    breaks: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()


def plot_tolerances(scene: ToleranceScene, *, title: str = "", shown: tuple[str, float] | None = None) -> Figure:
    """Plot the band of errors over the turn, the samples at one angle, and which tolerance contributes how much there.

    Above, the linear estimate (filled to three standard deviations, dashed the worst case of the signs) and percentiles of the
    samples; below, the histogram of the samples beside the normal distribution of the linear estimate, and shares in the
    variance. The foot tells what a reader must know of it: samples that cannot be assembled, where the estimate is off.

    Parameters
    ----------
    scene : ToleranceScene
        Of `analysis.slider_crank.tolerances.MonteCarlo.scene`.
    title : str
    shown : (str, float), optional
        Unit of the figure and how many of it one of SI is, such as ("in", 1 / 0.0254); by default mm, mm/s, and SI for all
        else.

    Raises
    ------
    InputError
        If there are fewer than two angles.
    """
    if len(scene.angle) < 2:
        raise InputError(f"a band over the turn needs two angles at least, not {len(scene.angle)}")
    unit, factor = shown or _SHOWN.get(scene.unit, (scene.unit, 1.0))
    name = scene.quantity.replace(".", " ").replace("_", " ")
    lost = (
        f"at worst {scene.not_assembled / scene.samples:.2%} of them cannot be assembled, and are left out"
        if scene.not_assembled
        else "all can be assembled"
    )
    foot = [f"{scene.samples:,} samples at each angle; {lost}.", *(f"{note}." for note in scene.notes)]
    lines = "\n".join(fill(note[0].upper() + note[1:], _LINE, subsequent_indent="    ") for note in foot)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 7.0 + 0.16 * lines.count("\n")))
        above, below = np.ravel(
            figure.subfigures(2, 1, squeeze=False, height_ratios=(1.0, 1.0 + 0.03 * lines.count("\n")))
        )
        band = above.subplots()
        histogram, bars = below.subplots(1, 2, width_ratios=(3, 2))
        _draw_band(band, scene, f"error of {name} [{unit}]", factor)
        _draw_histogram(histogram, scene, f"error of {name} [{unit}]", factor, unit)
        _draw_shares(bars, scene)
        below.supxlabel(lines, fontsize=8, x=0.02, ha="left", color="0.25")
        figure.suptitle(fill(title or f"Tolerances: {name}", 110), fontsize=10.5, fontweight="bold")
        return finish(figure)


def _draw_band(axis: Axes, scene: ToleranceScene, label: str, factor: float) -> None:
    turn = np.degrees(scene.angle)
    whole = _broken(turn, scene.breaks, turn)

    def curve(values: FloatArray) -> FloatArray:
        return _broken(values * factor, scene.breaks)

    three = curve(3.0 * scene.deviation)
    axis.fill_between(whole, -three, three, color=_LINEAR, alpha=0.18, linewidth=0.0, label=r"linear, $\pm 3\,\sigma$")
    for sign in (1.0, -1.0):
        axis.plot(
            whole,
            curve(sign * scene.worst),
            "--",
            color=_WORST,
            linewidth=1.0,
            label="linear, worst case" * (sign > 0.0),
        )
    low, lower, _, upper, high = (curve(row) for row in scene.departures)
    axis.plot(whole, high, color=_SAMPLES, label="samples, 0.135 % and 99.865 %")
    axis.plot(whole, low, color=_SAMPLES)
    axis.plot(whole, upper, color=_SAMPLES, linewidth=0.8, alpha=0.7, label="samples, 2.3 % and 97.7 %")
    axis.plot(whole, lower, color=_SAMPLES, linewidth=0.8, alpha=0.7)
    axis.plot(whole, curve(scene.mean), ":", color="black", linewidth=1.2, label="mean of the samples")
    axis.axvline(turn[scene.at], color="0.35", linewidth=0.9, linestyle="-.")
    for angle in np.degrees(scene.singular):
        axis.axvline(angle, color="0.35", linewidth=0.9, linestyle=":")
    # of what is not NaN, if anything
    reach = np.fmax.reduce(np.abs(np.vstack([scene.departures, scene.worst])), axis=0) * factor
    middle = float(np.nanmedian(reach))
    cut = float(np.nanmax(reach)) > _PEAK * middle > 0.0
    if cut:
        axis.set_ylim(-_CUT * middle, _CUT * middle)
    axis.set_xlim(turn.min(), turn.max())
    axis.xaxis.set_major_locator(MultipleLocator(30.0 if np.ptp(turn) > 120.0 else 10.0))
    axis.set_xlabel("crank angle [deg]" + " (dotted: dead centres, cut off)" * cut)
    axis.set_ylabel(label)
    axis.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, borderaxespad=0.2, columnspacing=1.2)


def _broken(values: FloatArray, breaks: Sequence[int], fill: FloatArray | None = None) -> FloatArray:
    """Values (n,) with one more after each of the numbers: NaN, or what ``fill`` (n,) has next."""
    after = np.array(breaks, dtype=int) + 1
    return np.insert(values, after, np.nan if fill is None else fill[after])


def _draw_histogram(axis: Axes, scene: ToleranceScene, label: str, factor: float, unit: str) -> None:
    edges = scene.edges * factor
    width = edges[1] - edges[0]
    share = scene.counts / scene.samples
    axis.stairs(share, edges, fill=True, color=_SAMPLES, alpha=0.35, label="samples")
    deviation = float(scene.deviation[scene.at]) * factor
    # narrower than a bin it is a line
    if deviation > width:
        fine = np.linspace(edges[0], edges[-1], 400)
        curve = [_normal_share(x - 0.5 * width, x + 0.5 * width, deviation) for x in fine]
        axis.plot(fine, curve, color=_LINEAR, label="linear estimate, normal")
        for place in (-3.0 * deviation, 3.0 * deviation):
            if edges[0] <= place <= edges[-1]:
                axis.axvline(place, ymax=0.55, color=_LINEAR, linewidth=0.9, linestyle="--")
                axis.text(place, 0.6, r"$3\,\sigma$", transform=axis.get_xaxis_transform(), ha="center", fontsize=8)
    elif isfinite(deviation):
        axis.axvline(0.0, ymax=0.72, color=_LINEAR, linewidth=2.0, label="linear estimate: no spread")
    told = [
        f"$\\sigma$ {what} {_figure(value * factor)} {unit}"
        for what, value in (
            ("of the samples", scene.sample_deviation),
            ("linear", deviation / factor),
            ("to second order", scene.second_deviation),
        )
        if isfinite(value)
    ]
    axis.set_xlabel(label)
    axis.set_ylabel("share of the samples")
    axis.yaxis.set_major_formatter(PercentFormatter(1.0))
    axis.set_xlim(edges[0], edges[-1])
    axis.set_ylim(0.0, 1.5 * float(share.max()))
    axis.set_title(
        f"at {np.degrees(scene.angle[scene.at]):.4g} deg, nominal {_figure(scene.nominal * factor, 6)} {unit}; "
        f"{scene.counts.sum() / scene.samples:.1%} of the samples",
        fontsize=9,
    )
    axis.legend(fontsize=8, loc="upper left")
    axis.text(0.985, 0.97, "\n".join(told), transform=axis.transAxes, ha="right", va="top", fontsize=8)


def _draw_shares(axis: Axes, scene: ToleranceScene) -> None:
    ordered = sorted(scene.shares.items(), key=lambda item: item[1][1] if isfinite(item[1][1]) else item[1][0])
    names, shares = [name for name, _ in ordered], np.array([both for _, both in ordered])
    linear, second = (bool(np.isfinite(column).all()) for column in shares.T)
    # the second order is drawn where it says something else
    second = second and not (linear and np.abs(shares[:, 1] - shares[:, 0]).max() < _TOLD)
    orders = [(0, _LINEAR, "linear")] * linear + [(1, _SECOND, "to second order")] * second
    axis.set_title("share in the variance" + ", linear" * (not second), fontsize=9)
    if not orders:
        none = "no variance to first or second order"
        if not isfinite(scene.deviation[scene.at]):
            none = "no variance: a dead centre is within the tolerances"
        axis.text(0.5, 0.5, none, ha="center", va="center", fontsize=9)
        axis.set_axis_off()
        return
    height = 0.66 / len(orders)
    for number, (column, colour, label) in enumerate(orders):
        for place, share in enumerate(shares[:, column].tolist()):
            at = place + height * (0.5 * (len(orders) - 1) - number)
            axis.barh(at, share, color=colour, alpha=0.8, height=height, label=label if place == 0 else None)
            axis.text(share + 0.015, at, f"{share:.1%}" if share >= 5e-4 else "< 0.1%", va="center", fontsize=8)
    if second:
        axis.legend(fontsize=8, loc="lower right")
    axis.set_yticks(np.arange(len(names)), names)
    axis.set_xlim(0.0, 1.22 * float(np.nanmax(shares)))
    axis.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axis.grid(visible=False, axis="y")


def _normal_share(low: float, high: float, deviation: float) -> float:
    """Share of a normal distribution of the mean zero between two values."""
    return 0.5 * (erf(high / (deviation * sqrt(2.0))) - erf(low / (deviation * sqrt(2.0))))


def _figure(value: float, digits: int = 3) -> str:
    """A number for print, zeros of rounding as 0."""
    return f"{value:.{digits}g}" if abs(value) > 1e-12 else "0"
