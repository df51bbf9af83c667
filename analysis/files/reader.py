"""Read tables of a file into frozen dataclasses, whose fields declare units, bounds and choices.

A reader is a function that takes a value and its dotted name. It returns the converted value, or raises a ParameterError with
the name. `entry` attaches a reader to a field of a dataclass, and `read` reads a whole table:

>>> @dataclass(frozen=True, slots=True, kw_only=True)
... class Bar:
...     length: float = entry(Quantity("m", above=0.0))
...     holes: int = entry(Whole(least=1), 2)
>>> read(Bar, {"length": "20 mm"}, "bar")
Bar(length=0.02, holes=2)
>>> read(Bar, {"length": "20 mm", "hoels": 3}, "bar")
Traceback (most recent call last):
    ...
linkwork.errors.UnknownNameError: there is no bar.hoels; did you mean bar.holes? (the names are bar.length, bar.holes)
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from math import inf, isfinite
from numbers import Integral
from typing import Any, NamedTuple, TypeVar

from linkwork.errors import MissingParameterError, ParameterError, UnknownNameError

from ..units import quantity

Reader = Callable[[Any, str], Any]
Made = TypeVar("Made")


def unknown_name(name: str, known: Iterable[str], words: str | None = None) -> UnknownNameError:
    """Return the error for a name that is not in ``known``, with the most similar names.

    ``words`` replace the name in the message.
    """
    return UnknownNameError(name, tuple(known), words or "")


def entry(reader: Reader, default: Any = MISSING, *, factory: Any = MISSING, key: str = "") -> Any:
    """Declare a field of a dataclass that `read` fills from a table.

    Parameters
    ----------
    reader : callable
        ``reader(value, name)``.
    default, factory : optional
        As in `dataclasses.field`; if neither is given, the table must have the entry.
    key : str, optional
        Name of the entry in the table, if it differs from the name of the field.
    """
    return field(default=default, default_factory=factory, metadata={"reader": reader, "key": key})


class _Entry(NamedTuple):
    field: str
    read: Reader
    required: bool


def _entries(kind: Callable[..., Any], readers: Mapping[str, Reader], keys: Mapping[str, str]) -> dict[str, _Entry]:
    """Return the entries of a table by name; an entry is required if its field or argument of ``kind`` has no default.

    ``readers`` and ``keys`` are those of `read`.
    """
    needed = set()
    if kind is not dict:
        arguments = inspect.signature(kind).parameters.values()
        needed = {a.name for a in arguments if a.default is a.empty and a.kind is not a.VAR_KEYWORD}
    own = {f.name: f.metadata for f in fields(kind) if "reader" in f.metadata} if is_dataclass(kind) else {}
    named = {name: data["reader"] for name, data in own.items()} | dict(readers)
    keys = {name: data["key"] for name, data in own.items() if data["key"]} | dict(keys)
    return {keys.get(name, name): _Entry(name, reader, name in needed) for name, reader in named.items()}


def entry_names(kind: type) -> tuple[str, ...]:
    """Return the names of the entries of a table that `read` reads into the dataclass ``kind``."""
    return tuple(_entries(kind, {}, {}))


def check_names(table: Mapping[str, Any], name: str, known: Iterable[str]) -> None:
    """Raise UnknownNameError for the first entry of a table whose name is not in ``known``; ``name`` is the table's name."""
    prefix = f"{name}." if name else ""
    known = tuple(known)
    for key in table:
        if key not in known:
            raise unknown_name(prefix + key, [prefix + k for k in known])


def read(
    kind: Callable[..., Made],
    value: Any,
    name: str,
    *,
    readers: Mapping[str, Reader] | None = None,
    keys: Mapping[str, str] | None = None,
    base: Any = None,
) -> Made:
    """Read a table: convert its values and pass them to ``kind``, which makes an object from them.

    Parameters
    ----------
    kind : dataclass, function or dict
        Called with the converted values as keyword arguments; returns the object.
    value : mapping
        The table.
    name : str
        Dotted name of the table; empty for a whole file.
    readers : mapping, optional
        Readers by field; they replace the readers that the fields declare.
    keys : mapping, optional
        Names of entries in the table by field, where they differ from the name of the field.
    base : dataclass instance, optional
        Gives the values of the fields that are not in the table.

    Raises
    ------
    UnknownNameError, MissingParameterError, ParameterError
        If the name of an entry is unknown, an entry is missing, or a value is wrong.
    """
    table = as_table(value, name)
    entries = _entries(kind, readers or {}, keys or {})
    check_names(table, name, entries)
    prefix = f"{name}." if name else ""
    missing = [prefix + key for key, e in entries.items() if e.required and key not in table and base is None]
    if missing:
        raise MissingParameterError(missing[0], tuple(missing[1:]))
    values = {} if base is None else {f.name: getattr(base, f.name) for f in fields(base)}
    for key in table:
        if table[key] is None:  # null of JSON
            raise ParameterError(prefix + key, None, "have a value, or be left out")
    values |= {e.field: e.read(table[key], prefix + key) for key, e in entries.items() if key in table}
    try:
        return kind(**values)
    except ParameterError as error:
        if type(error) is not ParameterError or not prefix or error.name not in table:
            raise
        raise ParameterError(prefix + error.name, error.value, error.requirement) from None


# Readers without options


def any_value(value: Any, name: str) -> Any:
    """Return a value of any type unchanged; it is checked later."""
    return value


def text(value: Any, name: str) -> str:
    """Read a text; a number or a truth value is converted to text."""
    if isinstance(value, (list, Mapping)) or (isinstance(value, float) and not isfinite(value)):
        raise ParameterError(name, value, "be a text")
    return str(value)


def flag(value: Any, name: str) -> bool:
    """Read true or false."""
    if not isinstance(value, bool):
        raise ParameterError(name, value, "be true or false")
    return value


def as_table(value: Any, name: str) -> Mapping[str, Any]:
    """Read a table without checking its entries."""
    if not isinstance(value, Mapping):
        raise ParameterError(name, value, "be a table")
    return value


# Readers with options


@dataclass(frozen=True, slots=True)
class Quantity:
    """Reader of a quantity: returns its value in SI; see `analysis.units.quantity`.

    Attributes
    ----------
    unit : str
        SI unit of the quantity, which tells its dimension.
    above, least, below : float, optional
        Bounds in SI: greater than, not less than, less than.
    bare : str, optional
        Unit of numbers that are given without a unit; by default SI.
    requirement : str, optional
        End of the error message "it must ..."; by default it states the bounds, such as "be zero or greater".
    """

    unit: str  # SI unit of the quantity, which tells its dimension
    above: float = -inf
    least: float = -inf
    below: float = inf
    bare: str | None = None  # unit of numbers that are given without a unit; by default SI
    requirement: str = ""  # end of the error message "it must ..."; by default the bounds, such as "be zero or greater"

    def __call__(self, value: Any, name: str) -> float:
        number = quantity(value, self.unit, name, bare=self.bare)
        if not (number > self.above and self.least <= number < self.below):
            raise ParameterError(name, value, self.requirement or f"be {self._bounds()}")
        return number

    def _bounds(self) -> str:
        """Return the bounds in words."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        above, least, below = (f"{end:g}{unit}" if end else "zero" for end in (self.above, self.least, self.below))
        said = {
            f"greater than {above}": self.above,
            f"{least} or greater": self.least,
            f"less than {below}": self.below,
        }
        return " and ".join(words for words, end in said.items() if isfinite(end))


#: Greatest whole number: that of an Integer in FMI.
_GREATEST = 2**31 - 1


@dataclass(frozen=True, slots=True)
class Whole:
    """Reader of a whole number, not less than ``least``."""

    least: int | None = None

    def __call__(self, value: Any, name: str) -> int:
        if isinstance(value, bool) or not isinstance(value, Integral):
            raise ParameterError(name, value, "be a whole number")
        whole = int(value)
        if self.least is not None and whole < self.least:
            raise ParameterError(name, value, f"be at least {self.least}")
        if abs(whole) > _GREATEST:
            raise ParameterError(name, value, f"be at most {_GREATEST}")
        return whole


@dataclass(frozen=True, slots=True)
class Choice:
    """Reader of a text that must be one of ``names``."""

    names: Iterable[str]

    def __call__(self, value: Any, name: str) -> str:
        names = tuple(self.names)
        if not isinstance(value, str):
            raise ParameterError(name, value, f"be one of {', '.join(names[:8])}{', ...' if len(names) > 8 else ''}")
        if value not in names:
            raise unknown_name(value, names, f"{name} {value!r}")
        return value


@dataclass(frozen=True, slots=True)
class Many:
    """Reader of a list: returns a tuple of the converted items.

    Attributes
    ----------
    item : callable
        Reader of each item; items have numbered names, such as ``bar.holes[0]``.
    least, length : int, optional
        Least number of items, and exact number of items.
    single : bool
        Whether a single item may be given without a list.
    """

    item: Reader
    least: int = 0
    length: int | None = None  # exact number of items
    single: bool = False  # whether a single item may be given without a list

    def __call__(self, value: Any, name: str) -> tuple[Any, ...]:
        if self.single and not isinstance(value, list):
            return (self.item(value, name),)
        if not isinstance(value, list) or self.length not in (None, len(value)):
            raise ParameterError(
                name, value, "be a list" if self.length is None else f"be a list of {self.length} entries"
            )
        if len(value) < self.least:
            raise ParameterError(name, value, f"have at least {self.least} {'entry' if self.least == 1 else 'entries'}")
        return tuple(self.item(v, f"{name}[{k}]") for k, v in enumerate(value))


@dataclass(frozen=True, slots=True)
class Range:
    """Reader of a range [least, greatest], or of one value for both; if ``ordered``, least must not exceed greatest."""

    item: Reader
    ordered: bool = True

    def __call__(self, value: Any, name: str) -> tuple[Any, Any]:
        ends = value if isinstance(value, list) else [value, value]
        if len(ends) != 2:
            raise ParameterError(name, value, "be one value, or two: [least, greatest]")
        low, high = (self.item(end, name) for end in ends)
        if self.ordered and low > high:
            raise ParameterError(name, value, "be in order: [least, greatest]")
        return low, high


@dataclass(frozen=True, slots=True)
class Table:
    """Reader of a table inside a table; the attributes are the arguments of `read`."""

    kind: Callable[..., Any]
    readers: Mapping[str, Reader] = field(default_factory=dict)

    def __call__(self, value: Any, name: str) -> Any:
        return read(self.kind, value, name, readers=self.readers)


@dataclass(frozen=True, slots=True)
class Kinds:
    """Reader of a table whose entry ``kind`` selects, by name, the reader of its other entries."""

    readers: Mapping[str, Reader]

    def __call__(self, value: Any, name: str) -> Any:
        table = as_table(value, name)
        if "kind" not in table:
            raise MissingParameterError(f"{name}.kind")
        kind = Choice(self.readers)(table["kind"], f"{name}.kind")
        return self.readers[kind]({key: v for key, v in table.items() if key != "kind"}, name)
