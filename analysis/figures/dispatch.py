"""Provide `plot`, `picture` and `animate`, which draw or describe any result that has a picture.

The module that draws a kind of result registers its function::

    @plot.register
    def plot_outputs(run: Trajectory, names: Sequence[str] = ..., *, title: str = "") -> Figure:
        ...

Users call ``figures.plot(run, title="a run")``; the registered function keeps its own name, under which its signature is
documented. Modules that draw are imported one after another until one of them can draw the result.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from importlib import import_module
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkwork.errors import LinkworkError

from ..mechanisms import MECHANISMS
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
#: The modules that have a `draw_at_start` for one mechanism, by its name.
_OWN = {"five-bar": "linkage", "slider-crank": "slider_crank_picture"}
#: Greatest number of samples over which the path of a point is drawn.
_TRACED = 20_000


class DrawingError(LinkworkError, TypeError):
    """Error for a result whose type has no picture; ``kind`` is the type."""

    def __init__(self, kind: type, picture: str) -> None:
        self.kind = kind
        super().__init__(f"results of the type {kind.__qualname__} have no {picture}")


def _registered_function(pictures: Any, result: object, name: str) -> Callable[..., Any]:
    """Return the function registered for the type of a result; raise DrawingError if there is none.

    ``pictures`` is a single-dispatch function such as `plot`; `MODULES` are imported until one registers the type.
    ``name`` is what the error says is missing, such as "plot".
    """
    nothing = pictures.dispatch(object)
    for module in MODULES:
        import_module(f".{module}", __package__)
        function: Callable[..., Any] = pictures.dispatch(type(result))
        if function is not nothing:
            return function
    raise DrawingError(type(result), name)


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


def mechanism_drawer(parameters: object) -> Callable[[Any, Axes, Trajectory], str] | None:
    """Return the function that draws a mechanism at the start of a run, with the paths of its points over the run.

    The function takes the parameters, axes and the run, and returns the caption of the drawing. The result is None if there is
    no picture of the mechanism of these parameters.
    """
    kind = next((m for m in MECHANISMS.values() if isinstance(parameters, m.parameters)), None)
    if kind is None or not (kind.name in _OWN or (kind.drawing is not None and kind.drawing.planar)):
        return None
    drawer: Callable[[Any, Axes, Trajectory], str]
    drawer = import_module(f".{_OWN.get(kind.name, 'scheme')}", __package__).draw_at_start
    return drawer


def last_samples(run: Trajectory) -> tuple[slice, str]:
    """Return the slice of a run's samples over which paths are drawn, and a phrase that names these samples.

    For a long run the slice has only the last samples.
    """
    if len(run) <= _TRACED:
        return slice(None), "over the run"
    return slice(-_TRACED, None), f"over the last {run.time[-1] - run.time[-_TRACED]:.3g} s"
