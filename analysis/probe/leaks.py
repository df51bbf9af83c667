"""Check for memory leaks: over many instances that are made and freed, over many steps, and over many saved states."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from .context import Context
from .drive import Run, step_size
from .findings import WRONG

#: Greatest time (s) and number of repetitions of a measurement.
_SECONDS, _MOST = 6.0, 4000


class Memory(NamedTuple):
    """Memory of this process in bytes."""

    heap: int  # memory that the C library has allocated; 0 if this number is not known
    resident: int  # resident memory


#: There is a leak if the growth exceeds both limits: per repetition, and in total. The probe and Python also grow a little.
_EACH = Memory(heap=8, resident=64)
_LEAST = Memory(heap=16 * 1024, resident=192 * 1024)


class _MallInfo(ctypes.Structure):
    """The structure that glibc's mallinfo2 returns; its fields are sizes."""

    _names = "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost"
    _fields_ = [(name, ctypes.c_size_t) for name in _names.split()]


def memory() -> Memory | None:
    """Return the memory of this process; None on a system without ``/proc``."""
    status = Path("/proc/self/statm")
    if not status.exists():
        return None
    resident = int(status.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    try:
        function = ctypes.CDLL(None).mallinfo2
    except AttributeError:  # another C library than glibc 2.33 or newer
        return Memory(0, resident)
    function.restype = _MallInfo
    info = function()
    return Memory(info.uordblks + info.hblkhd, resident)


def check_leaks(context: Context, case: int) -> None:
    """Check the growth of memory over many instances made and freed (case 0), many steps (1), or many saved states (2)."""
    if memory() is None:
        context.say("not made: this system does not say how much memory is used")
        return
    what, repeat, end = (_lives, _steps, _states)[case](context)
    count, grown = _measure(repeat)
    end()
    context.say(f"{what}: {max(grown) / 1024:.0f} KiB over {count}")
    for growth, each, least in zip(grown, _EACH, _LEAST):
        if growth > least and growth / count > each:
            context.note(
                WRONG, f"{what}: leak", f"memory grows by {growth / count:.0f} bytes for each of {count} {what}"
            )
            return


def _measure(repeat: Callable[[], None]) -> tuple[int, Memory]:
    """Call ``repeat`` many times; return the number of calls in the second half, and the growth of memory during this half."""
    until = time.monotonic() + _SECONDS / 2
    warm = 0
    while warm < 20 or (warm < _MOST // 2 and time.monotonic() < until):
        repeat()
        warm += 1
    before = memory()
    for _ in range(warm):
        repeat()
    after = memory()
    assert before is not None
    assert after is not None
    return warm, Memory(*(b - a for a, b in zip(before, after)))


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
