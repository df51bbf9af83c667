"""TOML and JSON files as nested tables."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import tomli_w

from linkwork.errors import InputError

from .paths import ending_of, read_text, whole
from .reader import table_of

ENDINGS = (".toml", ".json")


def write_tables(path: str | Path, data: Mapping[str, Any]) -> Path:
    """Write nested tables to a TOML or JSON file, as the path's ending says.

    Raises
    ------
    InputError
        If the ending is another.
    """
    path = Path(path)
    if ending_of(path, ENDINGS) == ".json":
        text = json.dumps(data, indent=2) + "\n"
    else:
        # plain values before tables, as TOML asks
        text = tomli_w.dumps(dict(sorted(data.items(), key=lambda item: isinstance(item[1], dict))))
    with whole(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def read_tables(path: str | Path) -> dict[str, Any]:
    """Nested tables from a TOML or JSON file.

    Raises
    ------
    InputError
        If the file cannot be read, or is not what its ending says.
    """
    path = Path(path)
    ending = ending_of(path, ENDINGS)
    text = read_text(path)
    try:
        data = tomllib.loads(text) if ending == ".toml" else json.loads(text)
    except (tomllib.TOMLDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path} is not valid {ending[1:].upper()}: {error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} must hold tables, not {type(data).__name__}")
    return data


def overridden(
    data: Mapping[str, Any], overrides: Mapping[str, Any], *, exclusive: Collection[str] = ()
) -> dict[str, Any]:
    """Tables with single values replaced.

    Parameters
    ----------
    data : mapping
    overrides : mapping
        Values by dotted name of any depth, such as ``slider.stiffness``.
    exclusive : collection of str, optional
        Tables of which one entry counts: where one is set the others go.

    Raises
    ------
    ParameterError
        If what is to hold a value is no table.
    """
    result = dict(data)
    for name, value in overrides.items():
        *groups, leaf = name.split(".")
        place = result
        for depth, group in enumerate(groups, start=1):
            inner = dict(table_of(place.get(group, {}), ".".join(groups[:depth])))
            if depth == 1 and group in exclusive:
                inner = {key: v for key, v in inner.items() if key == name.split(".")[1]}
            place[group] = inner
            place = inner
        place[leaf] = value
    return result


def flattened(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values of nested tables by dotted name."""
    flat: dict[str, Any] = {}
    for name, value in data.items():
        flat |= flattened(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {prefix + name: value}
    return flat
