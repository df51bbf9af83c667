"""Folders for compiled code and other results that are kept between runs."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from filelock import FileLock
from platformdirs import user_cache_dir

#: Free space (bytes) that a folder for code must have.
_LEAST = 1_000_000


def cache_root() -> Path:
    """Return the root folder of the cache: the environment variable LINKWORK_CACHE_DIR, else the user's cache folder."""
    return Path(os.environ.get("LINKWORK_CACHE_DIR") or user_cache_dir("linkwork", appauthor=False))


def code_folder(name: str) -> Path:
    """Return a folder for files that are loaded as code, below `cache_root` or below a temporary folder.

    A folder to which other users can write is not used, because they could make us run their code; a message on standard error
    says so once.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = cache_root() / name
    if _is_usable(folder):
        if _is_safe(folder, user):
            return folder
        _warn_shared(folder.parent)
    folder = Path(tempfile.gettempdir()) / f"linkwork-{user}" / name
    if _is_usable(folder) and _is_safe(folder, user):
        return folder
    return Path(tempfile.mkdtemp(prefix="linkwork-"))


def lock_folder(folder: Path) -> FileLock:
    """Return a lock on a folder of the cache, for a ``with`` statement: only one process at a time can have it."""
    return FileLock(folder.with_suffix(".lock"))


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; its file is renamed to ``path`` at the end: no process sees it half written."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        yield part
        os.replace(part, path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def store_file(path: Path, content: bytes) -> None:
    """Write a file so that no other process sees it half written."""
    with written_whole(path) as part:
        part.write_bytes(content)


def keep(path: Path, content: bytes) -> None:
    """Write a file of the cache as `store_file` does; do nothing if the disk is full or read-only."""
    with suppress(OSError):
        store_file(path, content)


def load_or_make(path: Path, make: Callable[[], bytes]) -> bytes:
    """Return the content kept at a path of the cache; if it is missing or its hash is wrong, make and keep it."""
    with suppress(OSError):
        digest, content = (kept := path.read_bytes())[:32], kept[32:]
        if hashlib.sha256(content).digest() == digest:
            return content
    content = make()
    keep(path, hashlib.sha256(content).digest() + content)
    return content


def hashes_below(folder: Path) -> dict[str, str]:
    """Return the SHA-256 hash of every file below a folder, by the file's path relative to the folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def keep_hashes(path: Path, hashes: Mapping[str, str]) -> None:
    """Write the hashes of files to ``path``, one per line as `sha256sum` does; do nothing if the content is the same."""
    content = "".join(f"{digest}  {name}\n" for name, digest in hashes.items()).encode()
    if not path.is_file() or path.read_bytes() != content:
        keep(path, content)


def read_hashes(path: Path) -> dict[str, str]:
    """Return the hashes that `keep_hashes` wrote; empty if there is no such file."""
    with suppress(OSError):
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
    return {}


@cache
def _warn_shared(folder: Path) -> None:
    sys.stderr.write(
        f"linkwork: others can write to {folder}, or to a folder above it: compiled code is kept elsewhere; "
        "LINKWORK_CACHE_DIR can name a folder of yours alone\n"
    )


def _is_usable(folder: Path) -> bool:
    """Return whether a folder exists or can be made, and has space for code."""
    try:
        for path in (folder.parent, folder):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(_LEAST))  # on a full disk a file can be made, but not filled
            file.flush()
            return True
    except OSError:
        return False


def _is_safe(folder: Path, user: int) -> bool:
    """Return whether only ``user`` and root can change the content of a folder, or replace the folder."""
    if os.name == "nt":
        return True  # user_cache_dir is below the user's profile, which others cannot write to
    folder = folder.resolve()
    for path in (folder, *folder.parents):
        status = path.stat()
        shared = status.st_mode & 0o002 or (status.st_mode & 0o020 and not _is_private(status.st_gid, user))
        # in a folder with the sticky bit others can add files, but not change ours
        if status.st_uid not in (user, 0) or (shared and (path == folder or not status.st_mode & 0o1000)):
            return False
    with os.scandir(folder) as entries:
        return folder.stat().st_uid == user and all(_is_owned(entry, user) for entry in entries)


def _is_owned(entry: os.DirEntry[str], user: int) -> bool:
    """Return whether a user owns a file; True if another process has just renamed or removed it."""
    try:
        return entry.stat(follow_symlinks=False).st_uid == user
    except FileNotFoundError:
        return True


def _is_private(group: int, user: int) -> bool:
    """Return whether a group is a user's private group: it has the user's name and no other members."""
    import grp
    import pwd

    try:
        name = pwd.getpwuid(user).pw_name
        return grp.getgrgid(group).gr_name == name and not set(grp.getgrgid(group).gr_mem) - {name}
    except KeyError:
        return False
