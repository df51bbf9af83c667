"""`plot` and `animate`: one name for the picture of any result.

The module that draws a kind of result registers its function::

    @plot.register
    def plot_outputs(run: Trajectory, names: Sequence[str] = ..., *, title: str = "") -> Figure:
        ...

and keeps the function's own name for those who want its signature; users call ``figures.plot(run, title="a run")``. The
modules that draw are imported when a result comes that nothing imported so far can draw.
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

#: The modules that register what they draw, those that import fastest first.
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
#: Those that register the picture of a mechanism.
MECHANISMS = ("linkage", "slider_crank_picture")
#: Samples of a path.
_TRACED = 20_000


class DrawingError(LinkworkError, TypeError):
    """There is no picture of this type of result; ``kind`` is the type."""

    def __init__(self, kind: type, picture: str) -> None:
        self.kind = kind
        super().__init__(f"results of the type {kind.__qualname__} have no {picture}")


def _find(pictures: Any, kind: type, modules: Sequence[str] = MODULES) -> Callable[..., Any] | None:
    """Return the function that draws results of a type from the first module that has one; None if there is none."""
    nothing = pictures.dispatch(object)
    for module in modules:
        import_module(f".{module}", __package__)
        function: Callable[..., Any] = pictures.dispatch(kind)
        if function is not nothing:
            return function
    return None


def _registered(pictures: Any, result: object, name: str) -> Callable[..., Any]:
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
        What the picture of this type takes, such as ``title``: the function registered for the type
        (``plot.dispatch(type(result))``) documents them.

    Returns
    -------
    matplotlib.figure.Figure
        Not shown and not written: `analysis.files` saves it.

    Raises
    ------
    DrawingError
        If nothing draws this type.
    """
    figure: Figure = _registered(plot, result, "plot")(result, *details, **options)
    return figure


@singledispatch
def picture(result: Any, *details: Any, **options: Any) -> Any:
    """Describe the picture of a result: the panels, curves and marks that `plot` draws and `to_html` writes.

    Parameters
    ----------
    result : object
        A response, a branch, a chart, basins.
    *details, **options
        Those of `plot`.

    Returns
    -------
    Picture

    Raises
    ------
    DrawingError
        If the picture of this type has no description, or there is none.
    """
    return _registered(picture, result, "picture to be described")(result, *details, **options)


@singledispatch
def animate(result: Any, path: str | Path, *details: Any, **options: Any) -> Path:
    """Write an animation (GIF) of a result and return its path.

    Parameters
    ----------
    result : object
        What moves: a solution of the synthesis, a mechanism.
    path : str or Path
        The file to write; folders that are missing are made.
    *details, **options
        What the animation of this type takes, such as ``frames``: see ``animate.dispatch(type(result))``.

    Raises
    ------
    DrawingError
        If nothing animates this type.
    """
    written: Path = _registered(animate, result, "animation")(result, path, *details, **options)
    return written


@singledispatch
def draw_mechanism(parameters: Any, axis: Axes, run: Trajectory) -> str:
    """Draw a mechanism on axes as it is at the start of a run, with the paths of its points over the run.

    Returns
    -------
    str
        What is drawn, for a caption.

    Raises
    ------
    DrawingError
        If there is no picture of this mechanism: see `has_picture`.
    """
    if not _from_drawing(parameters):
        raise DrawingError(type(parameters), "picture")
    caption: str = import_module(".scheme", __package__).draw_run(parameters, axis, run)
    return caption


def _from_drawing(parameters: object) -> bool:
    """Return whether parameters are of a mechanism that says how it is drawn, in the plane."""
    kind = next((m for m in REGISTRY.values() if isinstance(parameters, m.parameters)), None)
    return kind is not None and kind.drawing is not None and kind.drawing.planar


def last_samples(run: Trajectory) -> tuple[slice, str]:
    """Return the samples over which paths of a run are drawn, in words too: of a long run the last ones."""
    if len(run) <= _TRACED:
        return slice(None), "over the run"
    return slice(-_TRACED, None), f"over the last {run.time[-1] - run.time[-_TRACED]:.3g} s"


def has_picture(parameters: object) -> bool:
    """Return whether `draw_mechanism` draws the mechanism of these parameters."""
    return _find(draw_mechanism, type(parameters), MECHANISMS) is not None or _from_drawing(parameters)
