"""Branches of periodic motions over a parameter."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from shapely import LineString, distance
from shapely import points as make_points

from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM

from ..periodic import FORCE, Branch, Response
from ..youssef import Approximations
from .dispatch import plot
from .style import COLOURS, LINE, finish, legend_above, styled, write_title

#: Lines of the approximations beside.
_LINES: tuple[Any, ...] = ("-.", ":", (0, (5, 1)))

#: Points of a branch at which approximations are compared with it.
_COMPARED = 360
#: Distance (points) within which a curve is hidden under another.
_HIDDEN = 1.5 * LINE
#: Relative error (%) that counts as none.
_NONE = 1e-3

FloatArray: TypeAlias = NDArray[np.float64]

#: Signs of the points at which a multiplier crosses the unit circle, by the kind's value.
_MARKERS = {"fold": "s", "period doubling": "D", "torus": "^"}
_SPECIAL: dict[str, Any] = {"linestyle": "none", "color": "black", "markerfacecolor": "white", "zorder": 4}


def plot_branches(
    branches: Sequence[Branch],
    *,
    title: str = "",
    rpm: bool = True,
    beside: Callable[[float], Mapping[str, float]] | None = None,
) -> Figure:
    """Amplitude, crank torque and pin force along branches: stable parts solid, unstable ones dashed.

    Of approximations there is a panel of the relative error; those that the true motion covers are drawn only there.

    Parameters
    ----------
    branches : sequence of Branch
        Of one family.
    title : str
    rpm : bool
        Whether a speed in rad/s is drawn in rpm.
    beside : callable, optional
        ``beside(parameter)``: amplitudes (m) by approximations, by their names.
    """
    family = branches[0].family
    rpm &= family.unit == "rad/s"
    factor, unit = (1.0 / RAD_S_PER_RPM, "rpm") if rpm else (1.0, family.unit)
    what, si = branches[0].orbits[0].swing
    scale, shown = (CM_PER_METRE, "cm") if si == "m" else (1.0, si)
    rows = _rows(branches[0], f"amplitude of {what} [{shown}]", scale)
    others = [] if beside is None else [_approximated(branch, beside) for branch in branches if branch.turns == 1]
    with styled():
        size = 7.2, 3.4 + 2.1 * (len(rows) - 1 + bool(others))
        figure = Figure(figsize=size)
        heights = (2.2, *[1.0] * (len(rows) - 1 + bool(others)))
        axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0]
        main, rest = axes[0], axes[2:] if others else axes[1:]
        for number, branch in enumerate(branches):
            x = factor * branch.parameter
            for axis, (label, y) in zip((main, *rest), rows):
                axis.set_ylabel(label)
                _draw_branch(axis, x, y(branch), _stable(branch), color=COLOURS[number % len(COLOURS)])
            for special in branch.special:
                place = factor * special.parameter, scale * special.orbit.amplitude
                main.plot(*place, _MARKERS[special.kind.value], **_SPECIAL)
        # what is linear has resonances without bound; the true motion sets the scale
        top = 1.15 * max(scale * float(branch.amplitude.max()) for branch in branches)
        main.set_ylim(0.0, top)
        seen = _draw_approximations(main, others, factor, scale, size) if others else []
        if others:
            _draw_errors(axes[1], others, factor)
        for axis in rest:
            axis.set_yscale("log")
        axes[-1].set_xlabel(f"{family.name} [{unit}]" if unit else family.name)
        handles = _legend(branches, seen)
        if handles:
            main.legend(handles=handles)
        figure.align_ylabels()
        write_title(figure, title)
        return finish(figure)


@dataclass(frozen=True, slots=True)
class _Approximated:
    """Some of a branch's parameters and amplitudes (n,), and the latter by approximations."""

    parameter: FloatArray
    true: FloatArray
    amplitudes: Mapping[str, FloatArray]


def _approximated(branch: Branch, beside: Callable[[float], Mapping[str, float]]) -> _Approximated:
    # evenly along the curve as it is seen
    steps = [np.diff(v, prepend=v[0]) / (float(np.ptp(v)) or 1.0) for v in (branch.parameter, branch.amplitude)]
    way = np.cumsum(np.hypot(*steps))
    chosen = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], _COMPARED)))
    parameter = branch.parameter[chosen]
    found = [beside(value) for value in parameter.tolist()]
    return _Approximated(
        parameter, branch.amplitude[chosen], {name: np.array([row[name] for row in found]) for name in found[0]}
    )


def _stable(branch: Branch) -> NDArray[np.bool_]:
    return np.asarray(branch.columns()["stable (1), marginal (0), unstable (-1)"] > 0.0)


def _draw_branch(axis: Axes, x: FloatArray, y: FloatArray, stable: NDArray[np.bool_], **look: Any) -> None:
    for part, line in ((stable, "-"), (~stable, "--")):
        # a part reaches to the first point of the next, so that there is no gap between them
        wide = part | np.append(part[1:], False) & ~part if line == "--" else part
        axis.plot(x, np.where(wide, y, np.nan), line, **look)


def _look(number: int) -> dict[str, Any]:
    """How the approximation of a number is drawn."""
    return {"color": COLOURS[(number + 1) % len(COLOURS)], "linestyle": _LINES[number % len(_LINES)], "linewidth": LINE}


def _draw_approximations(
    axis: Axes, others: Sequence[_Approximated], factor: float, scale: float, size: tuple[float, float]
) -> list[Line2D]:
    """Draw the approximations that can be told from the true motion, and return them for the legend."""
    seen = []
    low, high = axis.get_xlim()
    points = 72.0 * np.multiply(axis.get_position().size, size)
    unit = points / (high - low, axis.get_ylim()[1])
    for number, name in enumerate(others[0].amplitudes):
        shown = [np.column_stack([factor * o.parameter, scale * o.amplitudes[name]]) for o in others]
        true = [np.column_stack([factor * o.parameter, scale * o.true]) for o in others]
        apart = max(_apart(unit * a, unit * b, float(points[1])) for a, b in zip(shown, true))
        if apart > _HIDDEN:
            for curve in shown:
                (line,) = axis.plot(*curve.T, label=name, zorder=1.5, **_look(number))
            seen.append(line)
    return seen


def _apart(curve: FloatArray, other: FloatArray, top: float) -> float:
    """Greatest distance of the points of a curve, below ``top``, from another curve."""
    inside = curve[curve[:, 1] < top]
    return float(distance(LineString(other), make_points(inside)).max()) if len(inside) and len(other) > 1 else 0.0


def _draw_errors(axis: Axes, others: Sequence[_Approximated], factor: float) -> None:
    """Relative errors of the approximations against the true motion, in per cent."""
    for number, name in enumerate(others[0].amplitudes):
        for first, o in zip((True, *[False] * len(others)), others):
            error = 100.0 * np.abs(o.amplitudes[name] / o.true - 1.0)
            axis.plot(factor * o.parameter, error, label=name if first else None, **_look(number))
    axis.set_yscale("log")
    axis.set_ylim(bottom=_NONE)
    axis.set_ylabel("relative error of\nthe amplitude [%]")
    legend_above(axis)


def _rows(branch: Branch, label: str, scale: float) -> list[tuple[str, Callable[[Branch], NDArray[np.float64]]]]:
    """Labels of what is drawn, and its values along a branch: amplitude, and crank torque and joint forces if there are any."""
    names = list(branch.columns())
    torque, forces = "greatest crank torque [N.m]", [name for name in names if name.startswith(FORCE)]
    rows: list[tuple[str, Callable[[Branch], NDArray[np.float64]]]] = [(label, lambda b: scale * b.amplitude)]
    if torque in names:
        rows.append(("greatest crank\ntorque [N.m]", lambda b: b.columns()[torque]))
    if forces:
        kind = "pin" if all(name.startswith(f"{FORCE}pin ") for name in forces) else "joint"
        rows.append((f"greatest\n{kind} force [N]", lambda b: np.max([b.columns()[n] for n in forces], axis=0)))
    return rows


@plot.register
def plot_branch(branch: Branch, *, title: str = "") -> Figure:
    """One branch: amplitude, crank torque and pin force over its parameter, with its special points."""
    return plot_branches([branch], title=title)


@plot.register
def plot_response(
    response: Response, *, title: str = "", rpm: bool = True, beside: Approximations | None = None
) -> Figure:
    """All branches of a response, with the classical approximations of the amplitude beside them; see `plot_branches`."""
    return plot_branches(response.branches, title=title, rpm=rpm, beside=None if beside is None else beside.at)


def _legend(branches: Sequence[Branch], seen: Sequence[Line2D]) -> list[Line2D]:
    """What has to be told apart: nothing of a single branch that is stable throughout."""
    handles = [
        Line2D([], [], color=COLOURS[i % len(COLOURS)], label=_name(branch, len(branches)))
        for i, branch in enumerate(branches)
    ]
    words = {word.value for branch in branches for word in branch.stability()}
    looks: dict[str, Any] = {"stable": "-", "unstable": "--", "marginal": "--"}
    lines = [Line2D([], [], color="0.3", linestyle=line, label=word) for word, line in looks.items() if word in words]
    handles += lines if len(lines) > 1 or "stable" not in words else []
    handles += seen
    kinds = {special.kind.value for branch in branches for special in branch.special}
    handles += [
        Line2D([], [], marker=marker, label=kind, **_SPECIAL) for kind, marker in _MARKERS.items() if kind in kinds
    ]
    return handles if len(handles) > 1 else []


def _name(branch: Branch, branches: int) -> str:
    if branches == 1:
        return "periodic motion"
    if branch.turns > 1:
        return f"period of {branch.turns} turns"
    return f"period of one turn, from the {'low' if branch.parameter[0] < branch.parameter[-1] else 'high'} end"
