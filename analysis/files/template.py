"""Write tables of case files with an explanation of every entry, which comes from the entry's reader and from docstrings."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import partial
from math import degrees, isfinite, pi
from typing import Any

import tomli_w

from ..units import with_unit
from . import reader
from .reader import Choice, Many, Quantity, Range, Reader, Table, Whole

#: Easily read units by SI unit, each with the factor from SI.
_FRIENDLY = {"m": ("mm", 1e3), "rad": ("deg", degrees(1.0)), "rad/s": ("rpm", 30.0 / pi)}
#: Examples of values by SI unit; 1 for other units.
_EXAMPLES = {"m": 0.1, "rad": pi / 6.0}
#: Column at which the explanations start.
_COLUMN = 46


def in_words(value: float, unit: str) -> str:
    """Return a quantity, given in SI, as text with at most ten digits and a common unit such as mm."""
    name, factor = _FRIENDLY.get(unit, (with_unit(value, unit).partition(" ")[2], 1.0))
    return f"{value * factor:.10g} {name}"


def literal(value: Any) -> str:
    """Return a value as TOML in one line."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {literal(inner)}' for key, inner in value.items())} }}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(literal, value))}]"
    return tomli_w.dumps({"x": value}).partition("=")[2].strip()


def requirement(read: Reader) -> str:
    """Return a few words on the values that a reader accepts, such as "a number, above zero"."""
    match read:
        case Quantity(unit=unit, above=above, least=least):
            bounds = "above zero" if above == 0.0 else "not below zero" if least == 0.0 else ""
            return ", ".join(filter(None, ("a number" if unit == "1" else "", bounds)))
        case Whole(least=lower):
            return "a whole number" + (f", at least {lower}" if lower is not None else "")
        case Choice(names=names):
            return f"one of {', '.join(names)}"
        case Many(item=item, length=length):
            inner = requirement(item)
            return f"a list{f' of {length}' if length else ''}{f', each {inner}' if inner else ''}"
        case Range(item=item):
            return ", ".join(filter(None, ("[least, greatest], or one value", requirement(item))))
        case Table(readers=readers):
            return f"a table with {', '.join(readers)}" if readers else "a table"
        case reader.flag:
            return "true or false"
        case reader.text:
            return "a text"
    return ""


def example(read: Reader) -> Any:
    """Return an example of a value that a reader accepts; None if no example is known."""
    match read:
        case Quantity(unit=unit, below=below):
            value = _EXAMPLES.get(unit, min(1.0, 0.5 * below))
            return 1 if unit == "1" else in_words(value, unit)
        case Whole(least=lower):
            return 1 if lower is None else max(lower, 1)
        case Choice(names=names):
            return next(iter(names))
        case Many(item=item, least=least, length=length):
            one = example(item)
            return None if one is None else [one] * max(least, length or 1)
        case Range(item=Quantity(unit="1")):
            return [1, 2]
        case Range(item=Quantity(unit=unit)):
            return [in_words(share * _EXAMPLES.get(unit, 1.0), unit) for share in (0.1, 1.0)]
        case reader.flag:
            return True
    return None


def meanings(kind: Any, *, follow: bool = True) -> dict[str, str]:
    """Return the explanations of a table's entries by name, from the docstring of the class or function ``kind``.

    If ``follow`` is true, the docstrings of all names in backticks in the docstring's first line are used as well.
    """
    doc = inspect.getdoc(kind) or ""
    found: dict[str, str] = {}
    if follow:
        module = sys.modules[kind.__module__]
        for name in re.findall(r"`(\w+)(?:\.(\w+))?`", doc.partition("\n")[0]):
            other = getattr(module, name[0], None)
            other = getattr(other, name[1], None) if name[1] else other
            if other is not None:
                found |= meanings(other, follow=False)
    heads = list(re.finditer(r"^([\w, ]+) : .*\n((?: {4}.*(?:\n|$))+)", doc, re.MULTILINE))
    for head in heads:
        words = " ".join(head[2].split()).removesuffix(".")
        sentence = words if len(words) < 90 else re.split(r"[.;:] ", words)[0]
        # leave out an explanation that is only a unit, which the value shows, or only a reference
        if not re.fullmatch(r"\S{1,6}|(?:As in|See) .*", words):
            sentence = re.sub(r" \([^)]*$", "", sentence.replace("`", ""))
            found |= {name.strip(): sentence for name in head[1].split(",")}
    return found


def line(name: str, value: Any, comment: str, *, active: bool) -> str:
    """Return a line of a TOML file: an entry and its explanation; it is a comment if it is not active or has no value."""
    text = f"{name} = {literal(value)}" if value is not None else f"{name} = ..."
    if value is None or not active:
        text = f"# {text}"
    return f"{text:<{_COLUMN}}  # {comment}" if comment else text


def _default(value: Any, read: Reader) -> Any:
    """Return the default of an entry in the form for a TOML file; None if TOML cannot express it."""
    if isinstance(read, Quantity) and isinstance(value, (int, float)):
        return (float(value) if read.unit == "1" else in_words(value, read.unit)) if isfinite(value) else None
    if isinstance(read, Range) and isinstance(value, tuple):
        ends = [_default(end, read.item) for end in value]
        return None if None in ends else ends
    if isinstance(value, tuple) and value and all(isinstance(item, (int, float, str)) for item in value):
        return list(value)
    return value if isinstance(value, (bool, int, str)) or (isinstance(value, float) and isfinite(value)) else None


def entries(
    kind: Any, given: Mapping[str, Any], *, readers: Mapping[str, Reader] | None = None, active: bool = True
) -> Iterator[str]:
    """Yield a TOML line for each entry of a table: the ``given`` entries, then all others as comments with their defaults.

    Parameters
    ----------
    kind : dataclass, or dict with ``readers``
        Class of the object into which the table is read; the fields of the class are the entries.
    given : mapping
        Values of the given entries by name.
    readers : mapping, optional
        Readers by name, instead of the readers of the dataclass.
    active : bool
        Whether the given entries are active; otherwise they are comments as well.
    """
    about: dict[str, str] = {}
    for base in reversed(kind.__mro__ if isinstance(kind, type) else ()):
        about |= meanings(base) if is_dataclass(base) else {}
    known: dict[str, tuple[Reader, Any, str]] = {name: (read, None, "") for name, read in (readers or {}).items()}
    if is_dataclass(kind):
        for field in fields(kind):
            if "reader" in field.metadata:
                default = None if field.default is MISSING else field.default
                name = field.metadata["key"] or field.name
                read = (readers or {}).get(name, field.metadata["reader"])
                known[name] = (read, default, about.get(field.name) or about.get("n_" + field.name, ""))
    for name, (read, default, meaning) in sorted(known.items(), key=lambda item: item[0] not in given):
        said = [part for part in (meaning, requirement(read)) if part]
        if not said:
            function = read.func if isinstance(read, partial) else read
            words = (inspect.getdoc(function) or "") if inspect.isfunction(function) else ""
            said = [] if function is reader.any_value else [words.partition("\n")[0].removesuffix(".").replace("`", "")]
        value = given.get(name, _default(default, read))
        value = example(read) if value is None else value
        yield line(name, value, "; ".join(said), active=active and name in given)
