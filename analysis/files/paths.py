"""Read and write files of any kind safely: limits of size, regular files only, and no incomplete files."""

from __future__ import annotations

import gzip
import io
import os
import re
import stat
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from zipfile import BadZipFile, LargeZipFile, ZipFile

from linkwork.errors import InputError, LinkworkError

from ..numerics.cache import written_whole

#: Greatest size of a text file (MB), by its ending; ``""`` for all others.
_TEXT = {".toml": 16, ".json": 16, ".svg": 8, "": 1024}
#: Greatest size of an FMU (MB), packed and unpacked, and its greatest number of members.
_FMU, _MEMBERS = 4096, 20_000
_MB = 1_000_000
#: Byte order marks of UTF-16, which spreadsheets and editors write.
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


class WritingError(LinkworkError, OSError):
    """Error for a file that cannot be written, for lack of space or of permission; the message names the file."""


def limit(name: str, default: int) -> int:
    """Return a limit for input files: the environment variable ``LINKWORK_MAX_<name>`` if it is set, else ``default``.

    Raises
    ------
    InputError
        If the variable is not a whole number above zero.
    """
    text = os.environ.get(f"LINKWORK_MAX_{name}", "").strip()
    if not text:
        return default
    if not (text.isascii() and text.isdigit() and len(text) <= 15 and int(text) > 0):
        raise InputError(f"LINKWORK_MAX_{name} is {text[:40]!r}: it must be a whole number greater than zero")
    return int(text)


def prepare(path: str | Path) -> Path:
    """Make the folder that will contain the file ``path``, and return the path."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def check_ending(path: Path, known: Sequence[str]) -> str:
    """Return the ending of a path in lower case; raise InputError if it is not one of the endings ``known``."""
    ending = path.suffix.lower()
    if ending not in known:
        endings = f"{', '.join(known[:-1])} or {known[-1]}"
        raise InputError(f"{path.name} ends in {path.suffix!r}: it must end in {endings}")
    return ending


@contextmanager
def write_completely(path: Path) -> Iterator[Path]:
    """Yield a temporary path as `written_whole` does; create the folder; raise WritingError if the file cannot be written."""
    prepare(path)
    try:
        with written_whole(path) as part:
            yield part
    except OSError as error:
        raise WritingError(f"{path} cannot be written: {error.strerror or error}") from error


def read_text(path: Path) -> str:
    """Read a text in UTF-8, or in UTF-16 with a byte order mark; a file that ends in ``.gz`` is unpacked.

    Raises InputError if the file cannot be read, is not a regular file, or is larger than the limit (LINKWORK_MAX_FILE_MB).
    """
    packed = path.suffix.lower() == ".gz"
    most = limit("FILE_MB", _TEXT.get(Path(path.stem if packed else path).suffix.lower(), _TEXT[""]))
    try:
        check_plain(path)
        with gzip.open(path) if packed else path.open("rb") as file:
            content = file.read(most * _MB + 1)
    except InputError:
        raise
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError(f"{path} cannot be read: it is not a whole gzip file ({first_line(error)})") from error
    except (OSError, ValueError) as error:  # ValueError: a name with a null character in it
        raise InputError(f"{_printable(path)} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if len(content) > most * _MB:
        raise InputError(
            f"{path} has more than {most} MB of text: give LINKWORK_MAX_FILE_MB a greater number to read it all the same"
        )
    encoding = "utf-16" if content[:2] in _UTF_16 else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} cannot be read: it is not text in {encoding.removesuffix('-sig').upper()}; save it as UTF-8, in a "
            "spreadsheet as 'CSV UTF-8'"
        ) from error
    return io.StringIO(text, newline=None).getvalue()


def check_plain(path: Path) -> None:
    """Raise InputError if a path is not a regular file, OSError if nothing is there.

    Devices and pipes are refused because reading them might never end.
    """
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        kinds = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))
        what = next((words for is_kind, words in kinds if is_kind(mode)), "a device")
        raise InputError(f"{path} is {what}: it must be a file")


def check_fmu(path: str | Path) -> None:
    """Check that an FMU can be unpacked safely: an archive of limited size that unpacks only into its own folder.

    Raises
    ------
    InputError
        If the FMU cannot be unpacked; if a limit is exceeded, the message says how to raise it.
    """
    path, most, members = Path(path), limit("FMU_MB", _FMU), limit("FMU_MEMBERS", _MEMBERS)
    try:
        check_plain(path)
        if path.stat().st_size > most * _MB:
            raise InputError(f"{path} has more than {most} MB: LINKWORK_MAX_FMU_MB in the environment raises the limit")
        with ZipFile(path) as archive:
            found = archive.infolist()
    except InputError:
        raise
    except (OSError, ValueError, BadZipFile, LargeZipFile, NotImplementedError, EOFError, zlib.error) as error:
        raise InputError(f"{path} is not an FMU: {getattr(error, 'strerror', None) or first_line(error)}") from error
    if len(found) > members:
        raise InputError(
            f"{path} has {len(found)} members, and at most {members} are unpacked: LINKWORK_MAX_FMU_MEMBERS in the "
            "environment raises the limit"
        )
    # a member cannot unpack to more than its declared size
    size = sum(member.file_size for member in found)
    description = sum(member.file_size for member in found if member.filename == "modelDescription.xml")
    for what, amount, allowed in (("unpacked", size, most), ("of modelDescription.xml", description, most // 16)):
        if amount > allowed * _MB:
            raise InputError(
                f"{path} has {amount / _MB:.0f} MB {what}, and at most {allowed} MB are read: LINKWORK_MAX_FMU_MB in the "
                f"environment, now {most}, raises the limit"
            )
    for member in found:
        name = member.filename
        if name.startswith("/") or "\\" in name or ":" in name or ".." in name.split("/"):
            raise InputError(f"{path} has the member {name[:80]!r}, which would be unpacked outside of its folder")


#: Names of variables that are valid in every convention: identifiers with points between them.
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z_0-9]*(\.[A-Za-z_][A-Za-z_0-9]*)*")


def find_problems(fmu: str | Path) -> list[str]:
    """Return the faults that FMPy finds in an FMU; plain names of variables are not parsed, which would take seconds."""
    from fmpy import read_model_description
    from fmpy.validation import validate_fmu

    try:
        found = read_model_description(str(fmu), validate_variable_names=False, validate_model_structure=True)
        plain = all(_PLAIN.fullmatch(variable.name) for variable in found.modelVariables)
        with ZipFile(fmu) as archive:
            plain = plain and not any("\\" in file.orig_filename for file in archive.filelist)
    except Exception:  # FMPy and lxml raise exceptions of their own
        plain = False
    return [] if plain else validate_fmu(str(fmu))


def _printable(path: Path) -> str:
    """Return a path as text for an error message: printable, and of limited length."""
    text = str(path)
    return text if text.isprintable() and len(text) <= 300 else repr(text[:300])


def first_line(error: Exception) -> str:
    """Return the first line of an error's message."""
    return (str(error) or type(error).__name__).splitlines()[0]


def is_number(text: str) -> bool:
    """Return whether Python's ``float`` accepts a text."""
    try:
        float(text)
    except ValueError:
        return False
    return True
