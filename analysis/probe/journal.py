"""Keep a file of the calls of the current case; each call is written before it is made, so that a crash does not lose it."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path
from typing import NamedTuple

#: Greatest number of bytes of text; if a case has more, only its latest calls are kept.
_ROOM = 1 << 17
_HEADER = struct.Struct("<qqq")


class Entry(NamedTuple):
    """The content of a journal."""

    case: int  # number of the current case
    calls: int  # number of calls that were begun, over all cases
    lines: list[str]  # the latest calls of the current case


class Journal:
    """The journal of the current process, to which calls are written."""

    def __init__(self, path: Path) -> None:
        path.write_bytes(bytes(_HEADER.size + _ROOM))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), 0)
        self.case = -1
        self.calls = 0
        self.fatal = False  # whether a call of this case returned Fatal
        self._end = 0
        self.begin(-1)

    def begin(self, case: int) -> None:
        """Start a case: its calls replace those of the previous case."""
        self.case, self._end, self.fatal = case, 0, False
        self._mark()

    def call(self, text: str) -> None:
        """Write a new line with the next call, before the call is made."""
        self.calls += 1
        self.write("\n" + text)

    def write(self, text: str) -> None:
        """Append text to the line of the latest call."""
        data = text.encode("utf-8", "backslashreplace")[: _ROOM // 4]
        if self._end + len(data) > _ROOM:
            kept = self._text()[-_ROOM // 4 :]
            self._map[_HEADER.size : _HEADER.size + len(kept)] = kept
            self._end = len(kept)
        start = _HEADER.size + self._end
        self._map[start : start + len(data)] = data
        self._end += len(data)
        self._mark()

    def lines(self) -> list[str]:
        """Return the calls of the current case."""
        return _lines(self._text())

    def _text(self) -> bytes:
        return self._map[_HEADER.size : _HEADER.size + self._end]

    def _mark(self) -> None:
        _HEADER.pack_into(self._map, 0, self.case, self.calls, self._end)


def read(path: Path) -> Entry:
    """Read the journal of another process, which may have crashed; the case is -1 if no case was begun."""
    data = path.read_bytes() if path.exists() else b""
    if len(data) < _HEADER.size:
        return Entry(-1, 0, [])
    case, calls, end = _HEADER.unpack_from(data)
    return Entry(case, calls, _lines(data[_HEADER.size : _HEADER.size + end]))


def _lines(text: bytes) -> list[str]:
    return text.decode("utf-8", "replace").strip("\n").split("\n") if text else []
