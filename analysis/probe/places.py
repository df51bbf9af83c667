"""Check that an FMU works in folders with unusual names, and with unusual forms of the resource location."""

from __future__ import annotations

import shutil
from dataclasses import replace
from urllib.parse import quote

from .context import Context
from .drive import Run, step_size
from .findings import QUESTIONABLE, WRONG
from .model import Model
from .session import Library, ProbeError, Session

FOLDERS = (
    *("with space", "Müller", "日本", "(a)", "a#b", "100%", "a%20b"),
    *("a+b", "a&b", "a@b", "it's", "a,b;c=d", "[x]", "~tilde"),
)

#: Unusual forms of the resource location: name, severity of the finding if the FMU refuses, and a function that makes the text
#: from the path and the percent-encoded path.
_URIS = (
    ("file:/path", WRONG, lambda path, quoted: f"file:{quoted}".encode()),
    ("file://localhost/path", WRONG, lambda path, quoted: f"file://localhost{quoted}".encode()),
    (
        "everything percent-encoded",
        WRONG,
        lambda path, quoted: ("file://" + "/".join(map(_all, path.split("/")))).encode(),
    ),
    ("a slash at the end", WRONG, lambda path, quoted: f"file://{quoted}/".encode()),
    ("a plain path", None, lambda path, quoted: path.encode()),
    ("an empty text", None, lambda path, quoted: b""),
    ("http://localhost/nothing", None, lambda path, quoted: b"http://localhost/nothing"),
    ("a folder that does not exist", None, lambda path, quoted: b"file:///no/such/folder"),
    ("a percent sign at the end", None, lambda path, quoted: f"file://{quoted}%".encode()),
    ("NULL", None, lambda path, quoted: None),
)
_PATHS = (
    ("no separator at the end", QUESTIONABLE, lambda path, quoted: path.rstrip("/").encode()),
    ("an empty text", None, lambda path, quoted: b""),
    ("a folder that does not exist", None, lambda path, quoted: b"/no/such/folder/"),
    ("a URI", None, lambda path, quoted: f"file://{quoted}/".encode()),
    ("NULL", None, lambda path, quoted: None),
)


def _all(part: str) -> str:
    return "".join(f"%{byte:02X}" for byte in part.encode())


def count(model: Model) -> int:
    """Return the number of cases of `check_places`: one for each unusual folder and each unusual resource location."""
    return len(FOLDERS) + len(_URIS if model.version == 2 else _PATHS)


def check_places(context: Context, case: int) -> None:
    """Check that the FMU makes a step in a folder with an unusual name, or with an unusual form of the resource location."""
    if case < len(FOLDERS):
        _folder(context, FOLDERS[case])
        return
    name, severity, text = (_URIS if context.model.version == 2 else _PATHS)[case - len(FOLDERS)]
    context.tell(f"{name}: resources")
    session = context.session()
    _, arguments = session.instantiation()
    path = (context.folder / "resources").as_posix()
    arguments[3 if context.model.version == 2 else 2] = text(path, quote(path))
    _try(context, session, severity, f"{name}: resources", arguments)


def _folder(context: Context, name: str) -> None:
    context.tell(f"{name!r}: folder named so")
    folder = context.work / "places" / name
    shutil.copytree(context.folder, folder, dirs_exist_ok=True)
    try:
        library = Library(context.model, folder)
    except Exception as error:  # as FMPy raises it
        context.note(
            WRONG, f"{name!r}: folder named so", f"the library cannot be loaded from a folder named {name!r}: {error}"
        )
        return
    moved = replace(context, folder=folder, library=library)
    _try(context, moved.session(), WRONG, f"{name!r}: folder named so", None)


def _try(context: Context, session: Session, severity: str | None, key: str, arguments: list[object] | None) -> None:
    failed = ""
    if session.instantiate(arguments):
        try:
            run = Run(session, instantiate=False)
            run.step(step_size(context.model))
        except ProbeError as error:
            failed = str(error)
        session.free()
    else:
        failed = "no instance is made" + (f": {session.messages[-1]}" if session.messages else "")
    if failed and severity is not None:
        context.note(severity, key, f"{key}: {failed}")
