"""Plots and animations: the only package that draws."""

from __future__ import annotations

from .charts import HeatMap, plot_charts
from .control import plot_bode, plot_poles
from .curves import Curve, Panel, plot_comparison, plot_curves, plot_outputs
from .dispatch import DrawingError, animate, plot
from .linkage import animate_linkage, draw_linkage, icon
from .response import plot_branches
from .style import COLOURS, STYLE, Figure
from .synthesis import LinkageScene, animate_solution, plot_alternatives, plot_solution, plot_trade_off

__all__ = [
    "COLOURS",
    "STYLE",
    "Curve",
    "DrawingError",
    "Figure",
    "HeatMap",
    "LinkageScene",
    "Panel",
    "animate",
    "animate_linkage",
    "animate_solution",
    "draw_linkage",
    "icon",
    "plot",
    "plot_alternatives",
    "plot_bode",
    "plot_branches",
    "plot_charts",
    "plot_comparison",
    "plot_curves",
    "plot_outputs",
    "plot_poles",
    "plot_solution",
    "plot_trade_off",
]
