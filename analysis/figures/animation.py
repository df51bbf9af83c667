"""Writing animations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from matplotlib.animation import PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg

from linkwork.errors import InputError

from ..files import free, record
from .style import Figure


@contextmanager
def gif(
    figure: Figure, path: str | Path, *, frames: int, frames_per_second: int = 20, dpi: int = 80
) -> Iterator[Callable[[], None]]:
    """Write a GIF: each call of the function that this context gives adds the figure, as it is then, as a picture.

    The figure is laid out once, for the first picture: its panels must not move from picture to picture.

    Raises
    ------
    InputError
        If there are fewer than two frames.
    """
    if frames < 2:
        raise InputError(f"an animation in {frames} frames: there must be at least 2")
    path = free(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure)
    writer = PillowWriter(fps=frames_per_second, metadata={})
    with writer.saving(figure, str(path), dpi=dpi):

        def add() -> None:
            if figure.get_layout_engine() is not None:
                figure.draw_without_rendering()
                figure.set_layout_engine("none")
            writer.grab_frame()

        yield add
    record(path)
