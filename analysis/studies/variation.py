"""Parameters of a study's mechanism that its reader varies: ``linkwork figures R5 --set rod.length='45 in'``.

A chapter hands the mechanisms that it builds to `vary`, and takes `cache` from here. A study names in `Study.sweeps` the
parameters whose values it compares itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import wraps
from typing import Any, NamedTuple, ParamSpec, TypeVar

from linkwork.parameters import field_name

from ..mechanisms import mechanism_of
from ..units import quantity

P = ParamSpec("P")
T = TypeVar("T")


class _Variation(NamedTuple):
    """Changed values by the parameter's name, and the names of all parameters of the mechanisms that a study has built."""

    changes: tuple[tuple[str, Any], ...]
    known: set[str]


_CURRENT: ContextVar[_Variation] = ContextVar("_CURRENT")


def _current() -> _Variation:
    return _CURRENT.get(_Variation((), set()))


@contextmanager
def varied(changes: Mapping[str, Any]) -> Iterator[set[str]]:
    """Vary parameters of the studies that are computed inside; yields the names of those that their mechanisms have."""
    variation = _Variation(tuple(changes.items()), set())
    token = _CURRENT.set(variation)
    try:
        yield variation.known
    finally:
        _CURRENT.reset(token)


def vary(parameters: T) -> T:
    """Return the parameters of a study's mechanism with the reader's changes."""
    changes, known = _current()
    variables = mechanism_of(parameters).mechanism_variables
    known.update(variables)
    values = {}
    for name, value in changes:
        if name in variables:
            real = variables[name].kind == "Real"
            values[field_name(name)] = quantity(value, variables[name].unit or "1", name) if real else int(value)
    return replace(parameters, **values) if values else parameters  # type: ignore[type-var]


def compared(name: str, values: tuple[float, ...], unit: str, per: float) -> tuple[float, ...]:
    """Return the values of a parameter that a study compares, or the reader's alone, ``per`` of whose units are one in SI."""
    return next(
        ((per * quantity(value, unit, name),) for changed, value in _current().changes if changed == name), values
    )


def words() -> str:
    """Return the reader's changes in words; empty if there are none."""
    return ", ".join(f"{name} = {value}" for name, value in _current().changes)


def cache(function: Callable[P, T]) -> Callable[P, T]:
    """Keep the results of a function by its arguments and the reader's changes."""
    kept: dict[Any, tuple[T, set[str]]] = {}

    @wraps(function)
    def cached(*args: P.args, **kwargs: P.kwargs) -> T:
        changes, known = _current()
        key = (changes, args, tuple(sorted(kwargs.items())))
        if key not in kept:
            with varied(dict(changes)) as found:
                kept[key] = function(*args, **kwargs), found
        result, found = kept[key]
        known.update(found)
        return result

    return cached


def unvaried(compute: Callable[[], T]) -> Callable[[], T]:
    """Return a study's function for which the reader's changes have no meaning, such as one of numbers in printed equations."""

    @wraps(compute)
    def computed() -> T:
        with varied({}):
            return compute()

    return computed
