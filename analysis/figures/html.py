"""Write pictures as HTML pages that show values under the pointer, with Plotly.

A page contains Plotly's script and all data, so that it opens without a network.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch
from html import escape
from math import ceil, isfinite, log10
from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from numpy.typing import ArrayLike

from ..libraries import require
from .charts import HeatMap, colour_scale, legend_entries
from .curves import Curve, Panel, Picture, shades_by_label
from .dispatch import picture
from .style import COLOURS, LINE, MARKED, SHADE, SHADES

#: Pixels per inch; in pixels: height of the title, margins left and right of a panel, width of the legend, gap below a panel.
_PIXELS, _TITLE, _LEFT, _RIGHT, _LEGEND, _GAP = 105, 50, 85, 85, 300, 55
#: Height of a label above its point, and of a line of text (pixels); share of the axis within which labels are stacked.
_ABOVE, _LINE_HEIGHT, _CLOSE = 35, 15, 0.08
#: Number of colours by which a colour scale is described.
_COLOURS = 65
#: Plotly's names of Matplotlib's lines and markers.
_DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}
_SYMBOLS = {"o": "circle", "s": "square", "D": "diamond", "^": "triangle-up", "x": "x-thin-open", ".": "circle"}

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title>
<script>{script}</script></head>
<body><div id="picture"></div>
<script>Plotly.newPlot("picture", {figure});</script></body>
</html>
"""


def to_html(result: Any, *details: Any, **options: Any) -> str:
    """Return the picture of a result as an HTML page with values under the pointer.

    Parameters
    ----------
    result : object
        A response, a branch, a stability chart, basins; or a `Picture`.
    *details, **options
        As for `plot`.

    Returns
    -------
    str
        The page, of some 5 MB.

    Raises
    ------
    MissingLibraryError
        If Plotly is not installed.
    DrawingError
        If this type has no picture, or its picture has no description.
    """
    require("plotly")
    from plotly.offline import get_plotlyjs

    described = result if isinstance(result, Picture) else picture(result, *details, **options)
    # "</" would end the script
    figure = json.dumps(to_plotly(described), allow_nan=False).replace("</", "<\\/")
    return _PAGE.format(title=escape(described.title), script=get_plotlyjs(), figure=figure)


def to_plotly(picture: Picture) -> dict[str, Any]:
    """Return a picture as Plotly's dictionary of traces (``data``), ``layout`` and ``config``."""
    columns = picture.columns
    heights = list(picture.heights) or [1.0] * ceil(len(picture.parts) / columns)
    figure = _Figure(picture, heights)
    for number, part in enumerate(picture.parts):
        axes = _Axes(figure, number)
        _add_part(part, axes)
        if not picture.heights or number + columns >= len(picture.parts):
            axes.x["title"] = {"text": _line(getattr(part, "panel", part).x_label)}
    return {"data": figure.traces, "layout": figure.layout, "config": {"displaylogo": False}}


class _Figure:
    """Plotly's traces and layout of a picture, filled by `_Axes`; ``heights`` are relative heights of the rows."""

    def __init__(self, picture: Picture, heights: Sequence[float]) -> None:
        self.columns, self.shared = picture.columns, bool(picture.heights)
        self.rows = [_PIXELS * picture.size[1] * height + _GAP for height in heights]
        self.width = _PIXELS * picture.size[0] + _LEFT + _RIGHT
        self.height = sum(self.rows)
        self.traces: list[dict[str, Any]] = []
        self.layout: dict[str, Any] = {
            "title": {"text": escape(picture.title)},
            "height": self.height + _TITLE + 20 * len(picture.notes),
            "width": self.width * self.columns + _LEGEND,
            "margin": {"t": _TITLE, "l": 0, "r": _LEGEND, "b": 20 * len(picture.notes)},
            "hovermode": "closest",
            "plot_bgcolor": "white",
            "font": {"size": 11},
            "legend": {"groupclick": "toggleitem", "tracegroupgap": 14},
            "shapes": [],
            "annotations": [
                {"text": escape(note), "xref": "paper", "yref": "paper", "x": 0, "y": 0, "yshift": -20 * n}
                | {"showarrow": False, "xanchor": "left", "yanchor": "top"}
                for n, note in enumerate(picture.notes)
            ],
        }


class _Axes:
    """One pair of axes of a figure, with methods that add traces, shapes and arrows to it."""

    def __init__(self, figure: _Figure, number: int) -> None:
        row, column = divmod(number, figure.columns)
        self.figure, self.number = figure, number
        self.suffix = str(number + 1) if number else ""
        top = figure.height - sum(figure.rows[:row])
        # as shares of the figure's height
        self.bottom, self.top = (top - figure.rows[row] + _GAP) / figure.height, top / figure.height
        whole = figure.width * figure.columns
        across = [(column * figure.width + _LEFT) / whole, ((column + 1) * figure.width - _RIGHT) / whole]
        look = {"showline": True, "linecolor": "black", "ticks": "outside", "gridcolor": "#e5e5e5", "zeroline": False}
        self.x: dict[str, Any] = look | {"domain": across, "anchor": f"y{self.suffix}"}
        self.y: dict[str, Any] = look | {"domain": [self.bottom, self.top], "anchor": f"x{self.suffix}"}
        if figure.shared and number:
            self.x["matches"] = "x"
        figure.layout |= {f"xaxis{self.suffix}": self.x, f"yaxis{self.suffix}": self.y}

    def add_trace(self, **trace: Any) -> None:
        """Add a trace to the figure, in these axes."""
        self.figure.traces.append(trace | {"xaxis": f"x{self.suffix}", "yaxis": f"y{self.suffix}"})

    def legend_group(self, title: str) -> dict[str, Any]:
        """Return the entries of a trace that put it into the legend group of these axes, under a title."""
        return {"legendgroup": str(self.number), "legendgrouptitle": {"text": _line(title)}}

    def add_shape(self, low: float, high: float, **shape: Any) -> None:
        """Add a shape over the whole height of the axes, from ``low`` to ``high`` along x."""
        box = {"x0": low, "x1": high, "y0": 0, "y1": 1, "xref": f"x{self.suffix}", "yref": f"y{self.suffix} domain"}
        self.figure.layout["shapes"].append(box | shape)

    def add_arrow(self, x: float, y: float, text: str = "", **look: Any) -> None:
        """Add an arrow to the point (x, y); ``look`` are Plotly's options, such as the start of the arrow."""
        references = {"xref": f"x{self.suffix}", "yref": f"y{self.suffix}"}
        if "ayref" in look:
            look |= {"axref": references["xref"], "ayref": references["yref"]}
        words = {"text": escape(text).replace("\n", "<br>"), "font": {"size": 11, "color": _hex(MARKED)}}
        self.figure.layout["annotations"].append(
            {"x": x, "y": y, "arrowcolor": _hex(MARKED)} | words | references | look
        )


def _line(text: str) -> str:
    """Return a label on one line, escaped for HTML."""
    return escape(text.replace("\n", " "))


def _hex(colour: Any) -> str:
    return str(to_hex(colour))


def _json_values(values: ArrayLike) -> list[Any]:
    """Return values as a list for JSON, with None for those that are not finite."""
    listed = np.atleast_1d(np.asarray(values)).tolist()
    return [None if isinstance(value, float) and not isfinite(value) else value for value in listed]


def _hover_template(title: str, names: Iterable[str], hover: Mapping[str, Any]) -> str:
    """Return Plotly's template of the text under the pointer: x and y by ``names``, then the values of ``hover``."""
    lines = [f"{_line(name)}: %{{{axis}:.10g}}" for name, axis in zip(names, "xy")]
    lines += [f"{_line(name)}: %{{customdata[{n}]}}" for n, name in enumerate(hover)]
    head = [f"<b>{_line(title)}</b>"] if title else []
    return "<br>".join([*head, *lines]) + "<extra></extra>"


@singledispatch
def _add_part(part: Any, axes: _Axes) -> None:
    """Add a part of a picture to axes; a function is registered for each kind of part."""
    raise TypeError(f"a part of a picture is a Panel or a HeatMap, not a {type(part).__name__}")


@_add_part.register
def _(panel: Panel, axes: _Axes) -> None:
    legend = axes.legend_group(panel.legend or panel.title or panel.y_label)
    for boundaries in panel.filled:
        ring = np.vstack([np.vstack([r, r[:1], [[np.nan] * 2]]) for r in boundaries])
        look = {"fill": "toself", "fillcolor": SHADE, "opacity": 0.22, "mode": "none", "hoverinfo": "skip"}
        axes.add_trace(type="scatter", x=_json_values(ring[:, 0]), y=_json_values(ring[:, 1]), showlegend=False, **look)
    for number, curve in enumerate(panel.curves):
        trace = _trace(curve, _hex(curve.colour or COLOURS[number % len(COLOURS)]), panel)
        if trace["mode"] == "text" and trace["showlegend"]:
            # in the legend Plotly shows a text as "Aa": a line is shown instead
            axes.add_trace(**trace | {"x": [None], "y": [None], "mode": "lines"}, **legend)
            trace["showlegend"] = False
        axes.add_trace(**trace, **legend)
    for name, number, those in shades_by_label(panel):
        look = {"type": "rect", "fillcolor": SHADES[number][0], "opacity": 0.18, "line": {"width": 0}, "layer": "below"}
        for n, shade in enumerate(those):
            entry = {"showlegend": True, "name": escape(name)} | legend if name and not n else {}
            axes.add_shape(shade.low, shade.high, **look, **entry)

    def axis_value(axis: str, value: float) -> float:
        """Return a value as Plotly expects it in annotations and ranges: its logarithm if the axis is logarithmic."""
        return log10(value) if axis in panel.logarithmic else value

    for arrow in panel.arrows:
        x, begin, end = axis_value("x", arrow.x), axis_value("y", arrow.begin), axis_value("y", arrow.end)
        axes.add_arrow(x, end, ax=x, ay=begin, ayref="y", arrowhead=2, arrowwidth=1.5)
    along = [float(x) for curve in panel.curves for x in np.ravel(curve.x) if isfinite(x)]
    close = _CLOSE * (max(along) - min(along)) if along else 0.0
    for label in panel.labels:
        # of two labels near each other the higher one has its text above the other's
        level = sum(bool(abs(other.x - label.x) < close and other.y < label.y) for other in panel.labels)
        look = {"ax": 45, "ay": -_ABOVE - _LINE_HEIGHT * level, "arrowhead": 0, "arrowwidth": 1}
        axes.add_arrow(axis_value("x", label.x), axis_value("y", label.y), label.text, **look)
    for text, place in (panel.verticals or {}).items():
        axes.add_shape(place, place, type="line", line={"dash": "dot", "width": 1}, label={"text": escape(text)})
    for place in panel.dashed:
        axes.add_shape(place, place, type="line", line={"dash": "dash", "width": 1})
    for axis, axes_entry, span in (("x", axes.x, panel.x_range), ("y", axes.y, panel.y_range)):
        axes_entry |= {"type": "log", "exponentformat": "power", "dtick": 1} if axis in panel.logarithmic else {}
        axes_entry |= {"range": [axis_value(axis, v) for v in span]} if span is not None else {}
    axes.y["title"] = {"text": _line(panel.y_label)}
    if panel.x_ticks is not None:
        axes.x["tickvals"] = list(panel.x_ticks)
    if panel.equal:
        axes.y |= {"scaleanchor": f"x{axes.suffix}", "scaleratio": 1}


def _trace(curve: Curve, colour: str, panel: Panel) -> dict[str, Any]:
    """Return a curve as a trace of Plotly; a curve without points gives only an entry of the legend."""
    x, y = (np.atleast_1d(np.asarray(v, dtype=float)) for v in (curve.x, curve.y))
    # one point without a value is enough for a gap
    finite = np.isfinite(y)
    kept = finite | np.insert(finite[:-1], 0, False) if len(y) else finite
    letters = curve.marker.strip("$") if curve.marker.startswith("$") else ""
    has = {"lines": curve.line, "text": letters, "markers": curve.marker and not letters}
    trace: dict[str, Any] = {
        "type": "scatter",
        "x": _json_values(x[kept]) or [None],
        "y": _json_values(y[kept]) or [None],
        "mode": "+".join(word for word, there in has.items() if there),
        "name": escape(curve.label),
        "showlegend": bool(curve.label),
        "line": {"color": colour, "width": 1.5 * (curve.width or LINE), "dash": _DASHES.get(curve.line, "longdash")},
        "hovertemplate": _hover_template(curve.label, (panel.x_label, panel.y_label), curve.hover),
    }
    if curve.hover and kept.any():
        trace["customdata"] = list(zip(*(_json_values(np.asarray(v)[kept]) for v in curve.hover.values())))
    if letters:
        trace |= {"text": [letters] * len(trace["x"]), "textfont": {"color": colour, "size": 13}}
    elif curve.marker:
        look = {"symbol": _SYMBOLS.get(curve.marker, "circle"), "size": 8, "color": "white" if curve.hollow else colour}
        trace["marker"] = look | {"line": {"color": colour, "width": 1.5}}
    return trace


@_add_part.register
def _(part: HeatMap, axes: _Axes) -> None:
    values = np.ma.filled(np.ma.masked_invalid(part.values), np.nan)
    hover = part.hover or {part.label: values}
    columns = [[_json_values(row) for row in np.asarray(v)] for v in hover.values()]
    place = {"x": axes.x["domain"][1] + 0.005, "y": axes.bottom, "yanchor": "bottom", "len": axes.top - axes.bottom}
    axes.add_trace(
        type="heatmap",
        x=_json_values(part.x),
        y=_json_values(part.y),
        z=[_json_values(row) for row in values],
        customdata=[list(zip(*rows)) for rows in zip(*columns)],
        hovertemplate=_hover_template("", (part.panel.x_label, part.panel.y_label), hover),
        showscale=not part.classes,
        # the colour scale is in the margin of its own chart
        colorbar=place | {"thickness": 12, "title": {"text": escape(part.label), "side": "right"}},
        **_colour_scale(part),
    )
    for colour, _, name in legend_entries(part):
        key = {"symbol": "square", "size": 12, "color": _hex(colour), "line": {"width": 1, "color": _hex(MARKED)}}
        legend = axes.legend_group(part.panel.title or part.label)
        axes.add_trace(type="scatter", x=[None], y=[None], mode="markers", marker=key, name=escape(name), **legend)
    _add_part(part.panel, axes)
    axes.x["showgrid"] = axes.y["showgrid"] = False


def _colour_scale(part: HeatMap) -> dict[str, Any]:
    """Return Plotly's colour scale and range of values for a map, with Matplotlib's colours."""
    norm, colours = colour_scale(part)
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
    if part.classes:
        n = len(part.classes)
        steps = [(end, _hex(colours(i))) for i in range(n) for end in (i / n, (i + 1) / n)]
    else:
        places = np.linspace(0.0, 1.0, _COLOURS).tolist()
        steps = [(place, _hex(colours(norm(low + place * (high - low))))) for place in places]
    return {"colorscale": steps, "zmin": low, "zmax": high}
