"""How every figure looks."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

__all__ = ["COLOURS", "STYLE", "Figure", "finish"]

STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "font.size": 9,
}

#: Colours that stay apart for colour-blind readers and in grey (Okabe and Ito), in the order of curves.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def finish(figure: Figure) -> Figure:
    """Lay the figure out while the style is in force: ticks are made, and take their look, only then."""
    figure.draw_without_rendering()
    return figure
