"""Write animations as GIF files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from matplotlib.animation import PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg

from linkwork.errors import InputError

from ..files import output
from .style import Figure


def check_frames(frames: int) -> None:
    """Raise InputError if an animation has fewer than two frames."""
    if frames < 2:
        raise InputError(f"an animation in {frames} frames: there must be at least 2")


@contextmanager
def gif(figure: Figure, path: str | Path, frames_per_second: int) -> Iterator[tuple[Path, Callable[[], None]]]:
    """Write a GIF; the context yields the path of the file, and a function that adds the current figure as a frame.

    If the current command may not overwrite the file, the GIF gets another name. The figure is laid out once, for the first
    frame, so that its panels do not move between frames.
    """
    FigureCanvasAgg(figure)
    writer = PillowWriter(fps=frames_per_second, metadata={})

    def add() -> None:
        if figure.get_layout_engine() is not None:
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
        writer.grab_frame()

    # not in the writer's own context manager, which would write an unfinished GIF after an error
    with output(path) as (part, path):
        draft = part.with_suffix(".gif")  # Pillow takes the format from the ending
        writer.setup(figure, str(draft), dpi=80)
        yield path, add
        try:
            writer.finish()
            draft.replace(part)
        finally:
            draft.unlink(missing_ok=True)
