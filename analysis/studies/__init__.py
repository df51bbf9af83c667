"""Studies that reproduce the figures of two theses and judge the theses' statements.

Youssef's thesis has a module for each chapter, Rahman's a package. ``linkwork figures 3.2 R5`` makes Youssef's figure 3.2 and
Rahman's figure 5. `STUDIES` lists the studies' titles in order; `load` imports a study, `make` runs it and writes its files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..files import unknown_name
from .contents import Entry
from .rahman import FIGURES as _RAHMAN
from .youssef import FIGURES as _YOUSSEF

if TYPE_CHECKING:
    from .study import Study, StudyResult

#: All figures of both theses by number, in order, including those that only show a mechanism or an apparatus.
ENTRIES: Mapping[str, Entry] = MappingProxyType({**_YOUSSEF, **_RAHMAN})

#: Title of each study by its number; the numbers of Rahman's figures begin with R.
STUDIES: Mapping[str, str] = MappingProxyType(
    {number: entry.title for number, entry in ENTRIES.items() if entry.module}
)


def is_figure(number: str) -> bool:
    """Return whether ``number`` belongs to a figure of a thesis; our own studies have names instead."""
    return number.removeprefix("R")[0].isdigit()


def file_stem(number: str) -> str:
    """Return the name of a study's files without suffix, such as fig_3_2 for study 3.2."""
    return f"fig_{number.replace('.', '_')}" if is_figure(number) else number


def load(number: str) -> Study:
    """Import the study of a figure, given its number, and return it.

    Raises
    ------
    UnknownNameError
        If there is no study of that number.
    """
    if number not in STUDIES:
        raise unknown_name(number, STUDIES, f"study of figure {number!r}")
    study: Study = import_module(f"{__name__}.{ENTRIES[number].module}").STUDIES[number]
    return replace(study, number=number)


def make(
    number: str, out: str | Path = "out", changes: Mapping[str, Any] | None = None
) -> tuple[StudyResult, tuple[Path, ...]]:
    """Run a study and write its plot, its table and its animation, if any, into a folder; return the result and the paths.

    ``changes`` maps names of the mechanism's parameters to new values: numbers in SI units, or texts with a unit.
    """
    return load(number).make(out, changes)
