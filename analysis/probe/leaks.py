"""Memory that is not given back over many lives of an instance, and over many steps and saved states of one."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from .context import Context
from .drive import Run, step_size
from .findings import WRONG

#: Growth for each repetition, in bytes, that is called a leak; and the least growth in all, which the allocator may cause.
_EACH, _LEAST = 64, 96 * 1024
#: Seconds and repetitions that a measurement takes at most.
_SECONDS, _MOST = 6.0, 4000


def resident() -> int | None:
    """Resident memory of this process, in bytes; None where the system does not say it simply."""
    status = Path("/proc/self/statm")
    if not status.exists():
        return None
    return int(status.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def leaks(context: Context, case: int) -> None:
    """Case 0: lives of instances. Case 1: steps of one. Case 2: saved states of one."""
    if resident() is None:
        context.say("not made: this system does not say how much memory is used")
        return
    what, repeat, end = (_lives, _steps, _states)[case](context)
    count, grown = _measure(repeat)
    end()
    context.say(f"{what}: {grown / 1024:.0f} KiB over {count}")
    if grown > _LEAST and grown / count > _EACH:
        context.note(WRONG, f"{what}: leak", f"memory grows by {grown / count:.0f} bytes for each of {count} {what}")


def _measure(repeat: Callable[[], None]) -> tuple[int, int]:
    """Repetitions in the second half of a measurement, and by how much the memory grew over them."""
    until = time.monotonic() + _SECONDS / 2
    warm = 0
    while warm < 20 or (warm < _MOST // 2 and time.monotonic() < until):
        repeat()
        warm += 1
    before = resident() or 0
    for _ in range(warm):
        repeat()
    return warm, (resident() or 0) - before


_Repeated = tuple[str, Callable[[], None], Callable[[], None]]


def _lives(context: Context) -> _Repeated:
    def live() -> None:
        run = Run(context.session())
        run.step(step_size(context.model))
        run.session.free()

    return "lives", live, lambda: None


def _steps(context: Context) -> _Repeated:
    run = Run(context.session())

    def step() -> None:
        run.step(step_size(context.model))
        run.values()

    return "steps", step, run.session.free


def _states(context: Context) -> _Repeated:
    run = Run(context.session())
    run.step(step_size(context.model))

    def save() -> None:
        state = run.save()
        run.restore(state, run.time, run.next_event)
        run.forget(state)

    return "saved states", save, run.session.free
