"""What tolerances do to the slider-crank, as a figure for a design review."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import erf, isfinite, sqrt
from textwrap import fill
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, PercentFormatter
from numpy.typing import NDArray

from linkwork.errors import InputError

from .style import COLOURS, STYLE, finish

FloatArray = NDArray[np.float64]

#: Units in which departures are shown, and how many of them one of SI is.
_SHOWN = {"m": ("mm", 1e3), "m/s": ("mm/s", 1e3)}
_LINEAR, _SAMPLES, _SECOND, _WORST = COLOURS[0], COLOURS[1], COLOURS[2], "0.45"
#: Greatest and middle departures over the turn: where their ratio is above this, the axis is cut at a multiple of the latter.
_PEAK, _CUT = 12.0, 4.0
#: Letters in a line of the foot.
_LINE = 125


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
        Histogram of the samples less the nominal value.
    sample_deviation, second_deviation : float
        Standard deviation of the samples, and estimated to second order.
    shares : mapping
        Of each tolerance, by its label, in the linear estimate of the variance; all zero where that is zero.
    samples, not_assembled : int
        Samples, and the most at any angle that cannot be assembled.
    singular : tuple of float
        Crank angles at which the quantity has a pole.
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
    shares: Mapping[str, float]
    samples: int
    not_assembled: int
    singular: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()


def plot_tolerances(scene: ToleranceScene, *, title: str = "") -> Figure:
    """Plot the band of errors over the turn, the samples at one angle, and which tolerance contributes how much there.

    Above, the linear estimate (filled to three standard deviations, dashed the worst case of the signs) and percentiles of the
    samples; below, the histogram of the samples beside the normal distribution of the linear estimate, and shares in the
    variance. The foot tells what a reader must know of it: samples that cannot be assembled, where the estimate is off.

    Parameters
    ----------
    scene : ToleranceScene
        Of `analysis.slider_crank.tolerances.MonteCarlo.scene`.
    title : str

    Raises
    ------
    InputError
        If there are fewer than two angles.
    """
    if len(scene.angle) < 2:
        raise InputError(f"a band over the turn needs two angles at least, not {len(scene.angle)}")
    unit, factor = _SHOWN.get(scene.unit, (scene.unit, 1.0))
    name = scene.quantity.replace(".", " ").replace("_", " ")
    lost = f"{scene.not_assembled / scene.samples:.2%}" if scene.not_assembled else "none"
    foot = [f"{scene.samples:,} samples at each angle; at worst {lost} cannot be assembled.", *scene.notes]
    lines = "\n".join(fill(note[0].upper() + note[1:], _LINE, subsequent_indent="    ") for note in foot)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 7.0 + 0.16 * lines.count("\n")))
        above, below = figure.subfigures(2, 1, height_ratios=(1.0, 1.0 + 0.03 * lines.count("\n")))
        band = above.subplots()
        histogram, bars = below.subplots(1, 2, width_ratios=(3, 2))
        _draw_band(band, scene, f"error of {name} [{unit}]", factor)
        _draw_histogram(histogram, scene, f"error of {name} [{unit}]", factor, unit)
        _draw_shares(bars, scene)
        below.supxlabel(lines, fontsize=8, x=0.02, ha="left", color="0.25")
        figure.suptitle(title or f"Tolerances: {name}", fontsize=10.5, fontweight="bold")
        return finish(figure)


def _draw_band(axis: Axes, scene: ToleranceScene, label: str, factor: float) -> None:
    turn = np.degrees(scene.angle)
    three = 3.0 * scene.deviation * factor
    axis.fill_between(turn, -three, three, color=_LINEAR, alpha=0.18, linewidth=0.0, label=r"linear, $\pm 3\,\sigma$")
    for sign in (1.0, -1.0):
        axis.plot(
            turn,
            sign * scene.worst * factor,
            "--",
            color=_WORST,
            linewidth=1.0,
            label="linear, worst case" * (sign > 0.0),
        )
    low, lower, _, upper, high = scene.departures * factor
    axis.plot(turn, high, color=_SAMPLES, label="samples, 0.135 % and 99.865 %")
    axis.plot(turn, low, color=_SAMPLES)
    axis.plot(turn, upper, color=_SAMPLES, linewidth=0.8, alpha=0.7, label="samples, 2.3 % and 97.7 %")
    axis.plot(turn, lower, color=_SAMPLES, linewidth=0.8, alpha=0.7)
    axis.plot(turn, scene.mean * factor, ":", color="black", linewidth=1.2, label="mean of the samples")
    axis.axvline(turn[scene.at], color="0.35", linewidth=0.9, linestyle="-.")
    for angle in np.degrees(scene.singular):
        axis.axvline(angle, color="0.35", linewidth=0.9, linestyle=":")
    reach = np.nanmax(np.abs(np.vstack([scene.departures, scene.worst])), axis=0) * factor
    middle = float(np.nanmedian(reach))
    cut = float(np.nanmax(reach)) > _PEAK * middle > 0.0
    if cut:
        axis.set_ylim(-_CUT * middle, _CUT * middle)
    axis.set_xlim(turn.min(), turn.max())
    axis.xaxis.set_major_locator(MultipleLocator(30.0 if np.ptp(turn) > 120.0 else 10.0))
    axis.set_xlabel("crank angle [deg]" + " (dotted: dead centres, cut off)" * cut)
    axis.set_ylabel(label)
    axis.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, borderaxespad=0.2, columnspacing=1.2)


def _draw_histogram(axis: Axes, scene: ToleranceScene, label: str, factor: float, unit: str) -> None:
    edges = scene.edges * factor
    share = scene.counts / scene.samples
    axis.stairs(share, edges, fill=True, color=_SAMPLES, alpha=0.35, label="samples")
    normal = [(scene.deviation[scene.at] * factor, 0.0, _LINEAR, "linear estimate, normal")]
    told = f"$\\sigma$ of the samples {_figure(scene.sample_deviation * factor)} {unit}\n" * isfinite(
        scene.sample_deviation
    )
    told += f"$\\sigma$ linear {_figure(normal[0][0])} {unit}"
    if isfinite(scene.second_deviation):
        told += f"\n$\\sigma$ to second order {_figure(scene.second_deviation * factor)} {unit}"
    for deviation, mean, colour, what in normal:
        # narrower than a bin it is a line at the mean
        if deviation > edges[1] - edges[0]:
            fine = np.linspace(edges[0], edges[-1], 400)
            width = edges[1] - edges[0]
            axis.plot(
                fine,
                [_normal_share(x - 0.5 * width, x + 0.5 * width, mean, deviation) for x in fine],
                color=colour,
                label=what,
            )
            for sign in (-3.0, 3.0):
                if edges[0] <= mean + sign * deviation <= edges[-1]:
                    axis.axvline(mean + sign * deviation, color=colour, linewidth=0.9, linestyle="--")
        else:
            axis.axvline(mean, color=colour, linewidth=2.0, label=f"{what}: no spread")
    axis.set_xlabel(label)
    axis.set_ylabel("share of the samples")
    axis.yaxis.set_major_formatter(PercentFormatter(1.0))
    axis.set_ylim(0.0, 1.45 * float(share.max()))
    axis.set_title(
        f"at {np.degrees(scene.angle[scene.at]):.4g} deg, nominal {_figure(scene.nominal * factor, 6)} {unit}",
        fontsize=9,
    )
    axis.legend(fontsize=8, loc="upper left")
    axis.text(0.985, 0.97, told, transform=axis.transAxes, ha="right", va="top", fontsize=8)


def _draw_shares(axis: Axes, scene: ToleranceScene) -> None:
    ordered = sorted(scene.shares.items(), key=lambda item: item[1])
    names, shares = [name for name, _ in ordered], np.array([share for _, share in ordered])
    axis.set_title("share in the variance, linear", fontsize=9)
    if not shares.any():
        axis.text(
            0.5, 0.5, "the first derivatives vanish:\nno shares to first order", ha="center", va="center", fontsize=9
        )
        axis.set_axis_off()
        return
    places = np.arange(len(names))
    axis.barh(places, shares, color=_LINEAR, alpha=0.8, height=0.62)
    look: dict[str, Any] = {"va": "center", "fontsize": 8}
    for place, share in zip(places, shares):
        axis.text(share + 0.015, place, f"{share:.1%}" if share >= 5e-4 else "< 0.1%", **look)
    axis.set_yticks(places, names)
    axis.set_xlim(0.0, min(1.0, float(shares.max())) * 1.22)
    axis.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axis.grid(visible=False, axis="y")


def _normal_share(low: float, high: float, mean: float, deviation: float) -> float:
    """Share of a normal distribution between two values."""
    return 0.5 * (erf((high - mean) / (deviation * sqrt(2.0))) - erf((low - mean) / (deviation * sqrt(2.0))))


def _figure(value: float, digits: int = 3) -> str:
    """A number for print: no more digits than it takes, zeros of rounding as 0."""
    return f"{value:.{digits}g}" if abs(value) > 1e-12 else "0"
