"""Write output files so that a command overwrites only its own files, unless --force is given.

A folder of results has a file ``.linkwork`` with hash, command and name of each result. If a file was not written by the
command, or was changed later, it is kept and the new file gets another name in the same folder, so that no result is lost. In
Python, outside of commands, a new file replaces an existing file.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from itertools import chain, count
from pathlib import Path

from .paths import write_completely

RECORD = ".linkwork"


@dataclass(slots=True)
class Writing:
    """The command that now writes files, and what it may overwrite."""

    command: str  # name of the command; it may always overwrite its own files
    force: bool = False  # whether the command may also overwrite other files
    # where each file was written: at its path, or beside a file that had to be kept
    paths: dict[Path, Path] = field(default_factory=dict)
    # sentences on the units assumed for files that were read and do not state them
    assumed: dict[Path, str] = field(default_factory=dict)

    @property
    def notes(self) -> list[str]:
        """Sentences on units that were assumed for columns of files, and on old files that were not overwritten."""
        return [f"{path.name}: {text}" for path, text in self.assumed.items()] + self._kept()

    def _kept(self) -> list[str]:
        beside = {path: new for path, new in self.paths.items() if new != path}
        names = ", ".join(path.name for path in beside.values())
        wrote = f"since 'linkwork {self.command}' wrote"
        match list(beside):
            case []:
                return []
            case [one]:
                kept = f"{one} was changed {wrote} it, or is not its file, and is kept: the new file is {names}"
                return [f"{kept}; --force writes over it"]
            case several:
                kept = f"{len(several)} files were changed {wrote} them, or are not its files, and are kept: the new files are"
                return [f"{kept} {names}; --force writes over them"]


_CURRENT: ContextVar[Writing | None] = ContextVar("writing", default=None)


@contextmanager
def attribute_files(command: str, force: bool = False) -> Iterator[Writing]:
    """Record a command as the writer of all files that are written inside this context."""
    token = _CURRENT.set(writing := Writing(command, force))
    try:
        yield writing
    finally:
        _CURRENT.reset(token)


def note_assumed_units(path: Path, units: Sequence[str], si: Sequence[str]) -> None:
    """Have the current command say which SI units were assumed for columns of a file that have no unit in their headings."""
    missing = {place: kind for place, (unit, kind) in enumerate(zip(units, si), start=1) if not unit and kind != "1"}
    if (writing := _CURRENT.get()) is not None and missing:
        columns = " and ".join(f"column {place} in {kind}" for place, kind in missing.items())
        writing.assumed[path] = f"no unit in the heading, so {columns} (a heading such as 'x [mm]' gives the unit)"


@contextmanager
def output(path: str | Path) -> Iterator[tuple[Path, Path]]:
    """Yield a temporary path to write to, and the final path, to which the file is moved when it is complete."""
    path = _free_path(path)
    with write_completely(path) as part:
        yield part, path
    _record_output(path)


def write_text(path: str | Path, text: str) -> Path:
    """Write a text in UTF-8 without changing its line ends, and return its path.

    Characters that UTF-8 cannot encode, such as those of undecodable file names, become escapes such as \\udcff.
    """
    with output(path) as (part, path):
        part.write_bytes(text.encode(errors="backslashreplace"))
    return path


def _free_path(path: str | Path) -> Path:
    """Return the path, or a numbered path in the same folder if the current command may not overwrite the file ``path``."""
    path, writing = Path(path), _CURRENT.get()
    if writing is None or writing.force:
        return path
    # a file of this run may have the number of another one, such as linkage-2
    taken = {new for other, new in writing.paths.items() if other != path}
    names = chain([path], (path.with_stem(f"{path.stem}-{n}") for n in count(2)))
    writing.paths[path] = next(name for name in names if name not in taken and _is_own(name, writing.command))
    return writing.paths[path]


def _record_output(path: Path) -> None:
    """Record in the file ``.linkwork`` of the same folder that the current command wrote the file ``path``."""
    writing = _CURRENT.get()
    if writing is None:
        return
    line = _record_line(path, writing.command)
    if _last_record_line(path) != line:
        # one short line at a time, so that commands in one folder do not disturb each other; if it fails, nothing is lost
        with suppress(OSError), path.with_name(RECORD).open("ab") as file:
            file.write(os.fsencode(f"{line}\n"))


def _is_own(path: Path, command: str) -> bool:
    """Return whether a command may overwrite a path: there is no file, or the command wrote it and it was not changed since."""
    if not os.path.lexists(path):
        return True
    return path.is_file() and _last_record_line(path) == _record_line(path, command)


def _record_line(path: Path, command: str) -> str:
    """Return a line of ``.linkwork`` for a file with its present content: hash, command and name."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return f"{digest} {command}: {path.name}"


def _last_record_line(path: Path) -> str:
    """Return the last line of ``.linkwork`` about a file; empty if there is none."""
    try:
        lines = os.fsdecode(path.with_name(RECORD).read_bytes()).splitlines()
    except (OSError, UnicodeDecodeError):
        return ""
    return next((line for line in reversed(lines) if line.partition(": ")[2] == path.name), "")
