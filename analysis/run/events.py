"""Events of a run, the error of an interrupted run, and progress bars."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Any

from linkwork.errors import InputError, Interrupted
from linkwork.mechanism import Mechanism

from ..files import unknown_name
from ..mechanisms import output_units
from ..units import Amount, si
from .signals import StateFunction


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """An event of a run: an output crosses a level, or a function crosses zero.

    Parameters
    ----------
    name : str
    output : str, optional
        Output of the FMI contract that crosses ``level``.
    level : float or str
        Level of the output, in its SI unit, or text with a unit, such as "5 mm".
    function : callable, optional
        Function that crosses zero, instead of an output. Its arguments are time, all coordinates and all their rates (floats).
        The compiled solver compiles the function with Numba.
    direction : int
        +1 for rising values, -1 for falling, 0 for rising and falling.
    stop : bool
        Whether the run ends there.

    Notes
    -----
    If the value jumps across the level because an input jumps, the event happens at the jump. A value that starts on the level
    is not an event. Of several crossings within a quarter of an integrator's step some may be missed.
    """

    name: str
    output: str | None = None
    level: Amount = 0.0
    function: StateFunction | None = None
    direction: int = 0
    stop: bool = False

    def __post_init__(self) -> None:
        if (self.output is None) == (self.function is None):
            raise InputError(f"event {self.name!r} needs either an output or a function")
        if self.output is not None and self.output not in output_units():
            raise self._no_output(tuple(output_units()))
        if self.function is not None and not callable(self.function):
            raise InputError(f"event {self.name!r} has the function {self.function!r}: it must be callable")
        if self.direction not in (-1, 0, 1):
            raise InputError(f"event {self.name!r} has direction {self.direction}: it must be -1, 0 or +1")
        if self.output is not None:
            level = si(self.level, output_units()[self.output], f"level of event {self.name!r}")
            object.__setattr__(self, "level", level)
        if not isinstance(self.level, Real) or not isfinite(self.level):
            raise InputError(f"event {self.name!r} has level {self.level}: it must be a finite number")

    def column(self, mechanism: Mechanism) -> int:
        """Return the index of the output among the outputs of a mechanism.

        Raises
        ------
        InputError
            If the mechanism has no such output.
        """
        if self.output not in mechanism.output_names:
            raise self._no_output(mechanism.output_names)
        return mechanism.output_names.index(self.output)

    def _no_output(self, names: tuple[str, ...]) -> InputError:
        return unknown_name(str(self.output), names, f"output {self.output!r} for event {self.name!r}")


class RunInterrupted(Interrupted):
    """Error of a run that Ctrl-C interrupted; ``trajectory``, of a mechanism or of a system, has the results so far."""

    def __init__(self, trajectory: Any) -> None:
        self.trajectory = trajectory
        super().__init__(f"interrupted at t = {trajectory.time[-1]:.6g} s" if len(trajectory) else "interrupted")


#: Function that receives the progress instead of a bar on the terminal.
_LISTENER: ContextVar[Callable[[str, float], None] | None] = ContextVar("listener", default=None)


@contextmanager
def progress_listener(listener: Callable[[str, float], None]) -> Iterator[None]:
    """Report progress inside the context to ``listener(what, share)``, share from 0 to 1, instead of showing a bar."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


@contextmanager
def show_progress(progress: bool, duration: float, what: str = "running") -> Iterator[Callable[[float], None]]:
    """Show a progress bar for a run of a given duration; yield a function to call with the duration done so far."""
    listener = _LISTENER.get()
    if listener is not None:
        yield lambda done: listener(what, done / duration if duration else 1.0)
        return
    if not progress:
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import Progress

    console = Console()
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=duration)
        yield lambda done: bar.update(task, completed=done)
