"""Plots and animations: the only package that draws."""

from __future__ import annotations

from .curves import Curve, Panel, plot_comparison, plot_curves, plot_outputs
from .linkage import animate_linkage, draw_linkage, icon
from .style import COLOURS, STYLE

__all__ = [
    "COLOURS",
    "STYLE",
    "Curve",
    "Panel",
    "animate_linkage",
    "draw_linkage",
    "icon",
    "plot_comparison",
    "plot_curves",
    "plot_outputs",
]
