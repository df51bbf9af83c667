"""Processes that compute for another one."""

from __future__ import annotations

import os
import threading
import time

_WATCHED: set[int] = set()
#: Seconds between two looks at who the caller is.
_INTERVAL = 0.5


def end_with(caller: int) -> None:
    """End this process soon after its parent, if that is ``caller``: called in a worker, first of all.

    A worker that nobody waits for would go on for minutes. Workers that somebody else started, of a cluster, are left alone,
    and so is the caller's own process; under Windows, which keeps the number of a parent that is gone, so are all.
    """
    if os.getppid() == caller and caller not in _WATCHED:
        _WATCHED.add(caller)
        threading.Thread(target=_watch, args=(caller,), daemon=True).start()


def _watch(caller: int) -> None:
    while os.getppid() == caller:
        time.sleep(_INTERVAL)
    os._exit(1)
