"""What reading and writing files of every kind share."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from linkwork.errors import InputError


def prepare(path: str | Path) -> Path:
    """The path, its folder made."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def ending_of(path: Path, known: Sequence[str]) -> str:
    """The ending of a path, in small letters.

    Raises
    ------
    InputError
        If it is not one of those known.
    """
    ending = path.suffix.lower()
    if ending not in known:
        endings = f"{', '.join(known[:-1])} or {known[-1]}"
        raise InputError(f"{path.name} ends in {path.suffix!r}: it must end in {endings}")
    return ending


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path to write to instead, which takes the place of ``path`` at the end: the file is there complete, or not at all."""
    part = prepare(path).with_name(f"{path.name}.{os.getpid()}.part")
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def read_text(path: Path) -> str:
    """The text of a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} cannot be read: it is not text in UTF-8") from error


def first_line(error: Exception) -> str:
    """What an error of a library says, in one line."""
    return (str(error) or type(error).__name__).splitlines()[0]
