"""Plots and animations: the only module that draws."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

STYLE = {
    "figure.constrained_layout.use": True,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "font.size": 9,
}


def plot_outputs(
    time: ArrayLike, outputs: Mapping[str, tuple[NDArray[np.float64], str]], *, columns: int = 1, title: str = ""
) -> Figure:
    """Plot outputs over time, one panel each.

    Parameters
    ----------
    time : array_like, shape (n,)
        s.
    outputs : mapping
        Name to (values of shape (n,), unit).
    columns : int
        Panels side by side.
    """
    rows = ceil(len(outputs) / columns)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4 * columns, 1.0 + 1.9 * rows))
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
        for axis, (name, (values, unit)) in zip(axes.flat, outputs.items()):
            axis.plot(time, values)
            axis.set_ylabel(f"{name} [{unit}]")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        if title:
            figure.suptitle(title)
    return figure
