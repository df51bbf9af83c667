"""Read and write nested tables as TOML or JSON files."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from linkwork.errors import InputError

from .outputs import write_text
from .paths import check_ending, first_line, read_text
from .reader import as_table

ENDINGS = (".toml", ".json")
#: Limits of a file of tables: depth of nesting, characters of a text and of a name, bits of a whole number.
_DEPTH, _TEXT, _NAME, _BITS = 50, 10_000, 200, 1024


def write_tables(path: str | Path, data: Mapping[str, Any], *, head: str = "") -> Path:
    """Write nested tables to a TOML or JSON file, according to the path's ending; ``head`` is a comment of a TOML file.

    Raises
    ------
    InputError
        If the path ends neither in .toml nor in .json.
    """
    path = Path(path)
    if check_ending(path, ENDINGS) == ".json":
        text = json.dumps(data, indent=2) + "\n"
    else:
        # TOML needs plain values before tables
        text = f"# {head}\n" if head else ""
        text += tomli_w.dumps(dict(sorted(data.items(), key=lambda item: isinstance(item[1], dict))))
    return write_text(path, text)


def read_tables(path: str | Path) -> dict[str, Any]:
    """Read nested tables from a TOML or JSON file.

    Raises
    ------
    InputError
        If the file cannot be read, or does not have the format of its ending.
    """
    path = Path(path)
    ending = check_ending(path, ENDINGS)
    text = read_text(path)
    try:
        data = tomllib.loads(text) if ending == ".toml" else json.loads(text)
    except RecursionError:
        raise InputError(f"{path} has tables or lists inside each other, deeper than {_DEPTH}") from None
    except ValueError as error:  # wrong syntax, or a whole number with thousands of digits
        raise InputError(
            f"{path} is not valid {ending[1:].upper()}: {first_line(error)[:300]}{_duplicate_in_words(text, error)}"
        ) from error
    if not isinstance(data, dict):
        raise InputError(f"{path} must contain tables, not {type(data).__name__}")
    _check(path, data)
    return data


def _duplicate_in_words(text: str, error: ValueError) -> str:
    """Return in words which entry or table a TOML file defines twice; empty if ``error`` has another cause."""
    if not re.match("Cannot (overwrite|declare)", str(error)):
        return ""
    last = re.search(r"at line (\d+)", str(error))
    lines = text.splitlines()[: int(last[1]) if last else None]
    tables = [found[1] for line in lines if (found := re.match(r"\s*\[+([^]]+)", line))]
    key = re.match(r"\s*([^=\[]+?)\s*=", lines[-1])
    places = [*tables[-1:], *([key[1]] if key else [])]
    return f": {'.'.join(place.strip() for place in places)} is there twice" if places else ""


def _check(path: Path, data: dict[str, Any]) -> None:
    """Raise InputError if a name, a text, a whole number or the depth of nesting in tables exceeds its limit."""
    level: list[tuple[str, Any]] = [("", data)]
    for _ in range(_DEPTH):
        inside: list[tuple[str, Any]] = []
        for name, value in level:
            if isinstance(value, dict):
                for key in value:
                    _check_text(path, f"a name in {name or 'it'}", key, _NAME)
                inside += [(f"{name}.{key}" if name else key, entry) for key, entry in value.items()]
            elif isinstance(value, list):
                inside += [(f"{name}[{number}]", entry) for number, entry in enumerate(value)]
            elif isinstance(value, str):
                _check_text(path, name, value, _TEXT)
            elif isinstance(value, int) and value.bit_length() > _BITS:
                raise InputError(f"{path}: {name} is a whole number of more than {_BITS} bits")
        level = inside
    if level:
        raise InputError(f"{path} has tables or lists inside each other, deeper than {_DEPTH}")


def _check_text(path: Path, name: str, text: str, longest: int) -> None:
    if len(text) > longest:
        raise InputError(f"{path}: {name} has {len(text)} characters: {longest} are the most")
    if any("\ud800" <= character <= "\udfff" for character in text):
        raise InputError(f"{path}: {name} has half a character: \\ud800 to \\udfff come in pairs")


def override(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of nested tables with single values replaced.

    Parameters
    ----------
    data : mapping
    overrides : mapping
        New values by dotted name, such as ``slider.stiffness``; the names may have any number of parts.

    Raises
    ------
    ParameterError
        If a part of a dotted name other than the last names an entry that is not a table.
    """
    result = dict(data)
    for name, value in overrides.items():
        *groups, leaf = name.split(".")
        place = result
        for depth, group in enumerate(groups, start=1):
            place[group] = dict(as_table(place.get(group, {}), ".".join(groups[:depth])))
            place = place[group]
        place[leaf] = value
    return result


def flatten(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values of nested tables in one table, by dotted name."""
    flat: dict[str, Any] = {}
    for name, value in data.items():
        flat |= flatten(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {prefix + name: value}
    return flat
