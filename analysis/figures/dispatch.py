"""Provide `plot`, `picture` and `animate`, which draw or describe any result that has a picture.

The module that draws a kind of result registers its function::

    @plot.register
    def plot_outputs(run: Trajectory, names: Sequence[str] = ..., *, title: str = "") -> Figure:
        ...

Users call ``figures.plot(run, title="a run")``; the registered function keeps its own name, under which its signature is
documented. Modules that draw are imported one after another until one of them can draw the result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import singledispatch
from importlib import import_module
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkwork.errors import LinkworkError

from ..mechanisms import MECHANISMS as REGISTRY
from ..run import Trajectory

#: The modules that register functions for results, in order of import time.
MODULES = (
    "runs",
    "linkage",
    "orbit",
    "response",
    "charts",
    "decay",
    "control",
    "synthesis",
    "guidance",
    "slider",
    "slider_crank",
    "slider_crank_picture",
    "tuning",
    "scheme",
    "systems",
)
#: The modules that register functions for `draw_mechanism`.
MECHANISMS = ("linkage", "slider_crank_picture")
#: Greatest number of samples over which the path of a point is drawn.
_TRACED = 20_000


class DrawingError(LinkworkError, TypeError):
    """Error for a result whose type has no picture; ``kind`` is the type."""

    def __init__(self, kind: type, picture: str) -> None:
        self.kind = kind
        super().__init__(f"results of the type {kind.__qualname__} have no {picture}")


def _find(pictures: Any, kind: type, modules: Sequence[str] = MODULES) -> Callable[..., Any] | None:
    """Return the function registered for a type of result; None if there is none.

    ``pictures`` is a single-dispatch function such as `plot`; ``modules`` are imported until one registers the type.
    """
    nothing = pictures.dispatch(object)
    for module in modules:
        import_module(f".{module}", __package__)
        function: Callable[..., Any] = pictures.dispatch(kind)
        if function is not nothing:
            return function
    return None


def _registered_function(pictures: Any, result: object, name: str) -> Callable[..., Any]:
    function = _find(pictures, type(result))
    if function is None:
        raise DrawingError(type(result), name)
    return function


@singledispatch
def plot(result: Any, *details: Any, **options: Any) -> Figure:
    """Plot a result: a run, a periodic motion, a chart, a linkage that was found.

    Parameters
    ----------
    result : object
        What an analysis returned.
    *details, **options
        Arguments of the function registered for this type, such as ``title``; ``plot.dispatch(type(result))`` documents
        them.

    Returns
    -------
    matplotlib.figure.Figure
        It is not shown and not written to a file; `analysis.files` saves it.

    Raises
    ------
    DrawingError
        If this type has no picture.
    """
    return _registered_function(plot, result, "plot")(result, *details, **options)


@singledispatch
def picture(result: Any, *details: Any, **options: Any) -> Any:
    """Return the description of a result's picture: panels, curves and marks that `plot` draws and `to_html` writes.

    Parameters
    ----------
    result : object
        A response, a branch, a chart, basins.
    *details, **options
        As for `plot`.

    Returns
    -------
    Picture

    Raises
    ------
    DrawingError
        If this type has no picture, or its picture has no description.
    """
    return _registered_function(picture, result, "picture to be described")(result, *details, **options)


@singledispatch
def animate(result: Any, path: str | Path, *details: Any, **options: Any) -> Path:
    """Write an animation (GIF) of a result and return its path.

    Parameters
    ----------
    result : object
        A solution of the synthesis, or a mechanism.
    path : str or Path
        The file to write; missing folders are made.
    *details, **options
        Arguments of the function registered for this type, such as ``frames``: see ``animate.dispatch(type(result))``.

    Raises
    ------
    DrawingError
        If this type has no animation.
    """
    return _registered_function(animate, result, "animation")(result, path, *details, **options)


@singledispatch
def draw_mechanism(parameters: Any, axis: Axes, run: Trajectory) -> str:
    """Draw a mechanism at the start of a run, with the paths of its points over the run.

    Returns
    -------
    str
        Caption of the drawing.

    Raises
    ------
    DrawingError
        If there is no picture of this mechanism: see `has_picture`.
    """
    if not _has_planar_drawing(parameters):
        raise DrawingError(type(parameters), "picture")
    return import_module(".scheme", __package__).draw_run(parameters, axis, run)


def _has_planar_drawing(parameters: object) -> bool:
    """Return whether the mechanism of these parameters has a planar `Drawing`."""
    kind = next((m for m in REGISTRY.values() if isinstance(parameters, m.parameters)), None)
    return kind is not None and kind.drawing is not None and kind.drawing.planar


def last_samples(run: Trajectory) -> tuple[slice, str]:
    """Return the slice of a run's samples over which paths are drawn, and a phrase that names these samples.

    For a long run the slice has only the last samples.
    """
    if len(run) <= _TRACED:
        return slice(None), "over the run"
    return slice(-_TRACED, None), f"over the last {run.time[-1] - run.time[-_TRACED]:.3g} s"


def has_picture(parameters: object) -> bool:
    """Return whether `draw_mechanism` draws the mechanism of these parameters."""
    return _find(draw_mechanism, type(parameters), MECHANISMS) is not None or _has_planar_drawing(parameters)
