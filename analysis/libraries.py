"""Import optional libraries when they are used, and report a missing library with the command that installs it."""

from __future__ import annotations

import re
from collections import defaultdict
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from linkwork.errors import LinkworkError


class MissingLibraryError(LinkworkError, ImportError):
    """Error for a library that is not installed; the message has the command that installs it.

    ``requirement`` is the requirement for pip, such as ``plotly>=5.24``; ``extra`` is Linkwork's extra that the library belongs
    to, empty for a library of the core.
    """

    def __init__(self, library: str) -> None:
        self.requirement, self.extra = _requirements().get(library, (library, ""))
        extra = f" (it is in Linkwork's extra '{self.extra}')" if self.extra else ""
        super().__init__(f"{library} is not installed: python -m pip install '{self.requirement}'{extra}", name=library)


def require(*libraries: str) -> None:
    """Check that libraries are installed, without importing them; a module such as ``lxml.etree`` stands for its library.

    Raises MissingLibraryError for the first library that is not installed.
    """
    for library in (name.partition(".")[0] for name in libraries):
        if find_spec(library) is None:
            raise MissingLibraryError(library)


def lazy(library: str) -> Any:
    """Return an object that imports a library at its first use, and raises `MissingLibraryError` there if it is missing."""
    return _LazyLibrary(library)


class _LazyLibrary(ModuleType):
    def __getattr__(self, name: str) -> Any:
        require(self.__name__)
        return getattr(import_module(self.__name__), name)


@cache
def _requirements() -> dict[str, tuple[str, str]]:
    """Return (requirement, extra) by the name of the library, from the metadata of the installed package."""
    try:
        lines = requires("linkwork") or []
    except PackageNotFoundError:  # a checkout that is only on the path
        lines = []
    extras: dict[str, dict[str, str]] = defaultdict(dict)
    for line in lines:
        requirement, _, marker = (part.strip() for part in line.partition(";"))
        extra = re.search(r"extra == ['\"]([\w-]+)['\"]", marker)
        library = re.match(r"[\w-]+", requirement)
        if library:
            extras[extra[1] if extra else ""][library[0].replace("-", "_")] = requirement
    # if several extras have a library, take the smallest, because 'all' and 'dev' repeat the others; the core precedes all
    order = sorted(extras, key=lambda extra: len(extras[extra]) if extra else 0, reverse=True)
    return {library: (requirement, extra) for extra in order for library, requirement in extras[extra].items()}
