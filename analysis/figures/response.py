"""Branches of periodic motions over a parameter."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM

from ..periodic import FORCE, Branch, Response
from ..youssef import Approximations
from .dispatch import plot
from .style import COLOURS, STYLE, finish

#: Lines of the approximations beside.
_LINES: tuple[Any, ...] = ("-.", ":", (0, (5, 1)))
#: Signs of the points at which a multiplier crosses the unit circle, by the kind's value.
_MARKERS = {"fold": "s", "period doubling": "D", "torus": "^"}


def plot_branches(
    branches: Sequence[Branch],
    *,
    title: str = "",
    rpm: bool = False,
    beside: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]] | None = None,
) -> Figure:
    """Amplitude, crank torque and pin force along branches: stable parts solid, unstable ones dashed.

    Parameters
    ----------
    branches : sequence of Branch
        Of one family.
    title : str
    rpm : bool
        Whether a speed in rad/s is drawn in rpm.
    beside : mapping, optional
        Amplitudes by approximations: name to (parameter, amplitude in m), shapes (m,).
    """
    family = branches[0].family
    factor = 1.0 / RAD_S_PER_RPM if rpm else 1.0
    unit = "rpm" if rpm else family.unit
    what, si = branches[0].orbits[0].swing
    scale, shown = (CM_PER_METRE, "cm") if si == "m" else (1.0, si)
    rows = _rows(branches[0], f"amplitude of {what} [{shown}]", scale)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.4 + 2.1 * (len(rows) - 1)))
        heights = (2.2, *(1.0 for _ in rows[1:]))
        axes = figure.subplots(len(rows), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0]
        for number, branch in enumerate(branches):
            stable = branch.columns()["stable (1), marginal (0), unstable (-1)"] > 0.0
            x = factor * branch.parameter
            for axis, (_, y) in zip(axes, rows):
                for part, line in ((stable, "-"), (~stable, "--")):
                    # a part reaches to the first point of the next, so that there is no gap between them
                    wide = part | np.append(part[1:], False) & ~part if line == "--" else part
                    axis.plot(x, np.where(wide, y(branch), np.nan), line, color=COLOURS[number % len(COLOURS)])
            for special in branch.special:
                axes[0].plot(
                    factor * special.parameter,
                    scale * special.orbit.amplitude,
                    _MARKERS[special.kind.value],
                    color="black",
                    markersize=4.5,
                    markerfacecolor="white",
                    zorder=4,
                )
        others = dict(beside or {})
        for (parameter, amplitude), line in zip(others.values(), _LINES):
            axes[0].plot(factor * parameter, scale * amplitude, linestyle=line, color="0.45", linewidth=0.9, zorder=1)
        # what is linear has resonances without bound; the true motion sets the scale
        top = max(scale * float(branch.amplitude.max()) for branch in branches)
        axes[0].set_ylim(0.0, 1.15 * top)
        for axis, (label, _) in zip(axes, rows):
            axis.set_ylabel(label)
        axes[-1].set_xlabel(f"{family.name} [{unit}]" if unit else family.name)
        for axis in axes[1:]:
            axis.set_yscale("log")
        axes[0].legend(handles=_legend(branches, tuple(others)), fontsize=8)
        figure.align_ylabels()
        if title:
            figure.suptitle(title, fontsize=10.5, fontweight="bold")
        return finish(figure)


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
    response: Response, *, title: str = "", rpm: bool = False, beside: Approximations | None = None
) -> Figure:
    """All branches of a response, with the classical approximations of the amplitude beside them; see `plot_branches`."""
    others = {} if beside is None else {name: (beside.speed, a) for name, a in beside.amplitudes.items()}
    return plot_branches(response.branches, title=title, rpm=rpm, beside=others)


def _legend(branches: Sequence[Branch], others: Sequence[str]) -> list[Line2D]:
    handles = [
        Line2D([], [], color=COLOURS[i % len(COLOURS)], label=_name(branch)) for i, branch in enumerate(branches)
    ]
    words = {word.value for branch in branches for word in branch.stability()}
    looks: dict[str, Any] = {"stable": "-", "unstable": "--", "marginal": "--"}
    handles += [
        Line2D([], [], color="0.3", linestyle=line, label=word) for word, line in looks.items() if word in words
    ]
    handles += [
        Line2D([], [], color="0.45", linestyle=line, linewidth=0.9, label=name) for name, line in zip(others, _LINES)
    ]
    kinds = {special.kind.value for branch in branches for special in branch.special}
    return handles + [
        Line2D(
            [], [], color="black", linestyle="none", marker=marker, markersize=4.5, markerfacecolor="white", label=kind
        )
        for kind, marker in _MARKERS.items()
        if kind in kinds
    ]


def _name(branch: Branch) -> str:
    if branch.turns > 1:
        return f"period of {branch.turns} turns"
    return f"period of one turn, from the {'low' if branch.parameter[0] < branch.parameter[-1] else 'high'} end"
