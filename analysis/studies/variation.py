"""Reader's changes to the parameters of a study's mechanism: ``linkwork figures R5 --set rod.length='45 in'``.

Each chapter's module passes the mechanisms that it builds to `vary`, and uses the `cache` of this module. `Study.sweeps` names
the parameters whose values the study itself compares.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import wraps
from typing import Any, NamedTuple, ParamSpec, TypeVar

from linkwork.parameters import field_name

from ..mechanisms import find_mechanism
from ..units import quantity

P = ParamSpec("P")
T = TypeVar("T")


class _Variation(NamedTuple):
    """Changed values by parameter name, and the names of all parameters of the mechanisms that a study has built."""

    changes: tuple[tuple[str, Any], ...]
    known: set[str]


_CURRENT: ContextVar[_Variation] = ContextVar("_CURRENT")


def _current() -> _Variation:
    return _CURRENT.get(_Variation((), set()))


@contextmanager
def varied(changes: Mapping[str, Any]) -> Iterator[set[str]]:
    """Apply changes of parameters to all studies computed inside the context.

    Yields a set that collects the parameter names of the mechanisms that these studies build.
    """
    variation = _Variation(tuple(changes.items()), set())
    token = _CURRENT.set(variation)
    try:
        yield variation.known
    finally:
        _CURRENT.reset(token)


def vary(parameters: T) -> T:
    """Return the parameters of a study's mechanism with the reader's changes."""
    changes, known = _current()
    variables = find_mechanism(parameters).mechanism_variables
    known.update(variables)
    values = {}
    for name, value in changes:
        if name in variables:
            real = variables[name].kind == "Real"
            values[field_name(name)] = quantity(value, variables[name].unit or "1", name) if real else int(value)
    return replace(parameters, **values) if values else parameters  # type: ignore[type-var]


def compared_values(name: str, values: tuple[float, ...], unit: str, per: float) -> tuple[float, ...]:
    """Return the values of a parameter that a study compares, or only the reader's value if the reader has set it.

    ``unit`` is the parameter's SI unit; ``per`` is the factor from this unit to the unit of the values.
    """
    return next(
        ((per * quantity(value, unit, name),) for changed, value in _current().changes if changed == name), values
    )


def words() -> str:
    """Return the reader's changes in words; empty if there are no changes."""
    return ", ".join(f"{name} = {value}" for name, value in _current().changes)


def cache(function: Callable[P, T]) -> Callable[P, T]:
    """Cache the results of a function by its arguments and the reader's changes."""
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


def ignore_changes(compute: Callable[[], T]) -> Callable[[], T]:
    """Wrap a study's function so that it ignores the reader's changes, for instance because it evaluates printed equations."""

    @wraps(compute)
    def computed() -> T:
        with varied({}):
            return compute()

    return computed
