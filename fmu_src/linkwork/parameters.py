"""Common parts of the parameters of all mechanisms: their checks, and their names in the FMI contract.

A field ``coupler_point_distance`` is the FMI parameter ``coupler.point_distance``: the first underscore is the dot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from math import isfinite, log10
from numbers import Real
from types import MappingProxyType
from typing import Any, NamedTuple

from .errors import ParameterError

POSITIVE = "be a finite number greater than zero"
NOT_NEGATIVE = "be a finite number, zero or greater"
#: Greatest magnitude of a parameter; its inverse is the least value of a parameter above zero. Their fourth powers are floats.
GREATEST = 1e75
TOO_LARGE = f"be small enough to compute with, at most {GREATEST:g} in magnitude"
TOO_SMALL = f"be large enough to compute with, at least {1.0 / GREATEST:g}"


def fmi_name(field_name: str) -> str:
    """Return the FMI name of a field of a mechanism's parameters: the first underscore becomes the dot."""
    return field_name.replace("_", ".", 1)


def field_name(name: str) -> str:
    """Return the name of the field, of a mechanism's parameters, for the FMI parameter ``name``."""
    return name.replace(".", "_", 1)


class LowerBound(NamedTuple):
    """A lower bound of one parameter; the bound depends on other parameters.

    Attributes
    ----------
    field : str
        Field of the parameter.
    of : callable
        ``of(parameters)`` returns the bound, by arithmetic without branches.
    requirement : str
        The words after "it must" in the error message, with ``%g`` in place of the bound.
    """

    field: str
    of: Callable[[Any], float]
    requirement: str


class Rules(NamedTuple):
    """Rules for the values of a mechanism's parameters: the attribute ``RULES`` of their dataclass.

    All values must also be finite and within the range that `GREATEST` sets.

    Attributes
    ----------
    positive, free_sign : tuple of str
        Fields that must be greater than zero, and fields that may have either sign; all other fields must be zero or greater.
    signs : mapping
        Fields that are +1 or -1, each with the meaning of the sign: the words after "it must be +1 or -1" in the error message.
    least : tuple of LowerBound
        Lower bounds that depend on other parameters.
    """

    positive: tuple[str, ...] = ()
    free_sign: tuple[str, ...] = ()
    signs: Mapping[str, str] = MappingProxyType({})
    least: tuple[LowerBound, ...] = ()


class CheckedParameters:
    """Base of a mechanism's parameters, a frozen dataclass: its fields are checked against ``RULES`` and made plain numbers.

    Raises
    ------
    ParameterError
        For the first field that breaks a rule, or is too large or too small to compute with. If there is no such field, but a
        constant of the equations is not finite: for the field of the most extreme magnitude.
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        parameters: Any = self
        rules: Rules = parameters.RULES
        for field in fields(parameters):
            name = fmi_name(field.name)
            value = getattr(parameters, field.name)
            if isinstance(value, bool) or not isinstance(value, Real):
                raise ParameterError(name, value, "be a number in SI units")
            try:
                number: float = float(value)
                if field.name in rules.signs and number.is_integer():
                    number = int(number)
            except (OverflowError, ValueError):
                raise ParameterError(name, value, "be a finite number") from None
            # plain Python numbers, whatever type was given: the equations and JSON accept no other type
            object.__setattr__(parameters, field.name, number)
            value = number
            if field.name in rules.signs:
                if value not in (1, -1):
                    raise ParameterError(name, value, f"be +1 or -1, {rules.signs[field.name]}")
            elif field.name in rules.positive:
                if not (isfinite(value) and value > 0.0):
                    raise ParameterError(name, value, POSITIVE)
            elif field.name in rules.free_sign:
                if not isfinite(value):
                    raise ParameterError(name, value, "be a finite number")
            elif not (isfinite(value) and value >= 0.0):
                raise ParameterError(name, value, NOT_NEGATIVE)
        for field in fields(parameters):
            value = getattr(parameters, field.name)
            if abs(value) > GREATEST:
                raise ParameterError(fmi_name(field.name), value, TOO_LARGE)
            if field.name in rules.positive and value < 1.0 / GREATEST:
                raise ParameterError(fmi_name(field.name), value, TOO_SMALL)
        for least in rules.least:
            bound, value = least.of(parameters), getattr(parameters, least.field)
            if value < bound:
                raise ParameterError(fmi_name(least.field), value, least.requirement.replace("%g", f"{bound:g}"))
        try:
            finite = all(isfinite(constant) for constant in parameters.constants())
        except ArithmeticError:
            finite = False
        if finite:
            return
        values = {field.name: getattr(parameters, field.name) for field in fields(parameters)}
        extreme = max((name for name in values if values[name]), key=lambda name: abs(log10(abs(values[name]))))
        size = "small" if abs(values[extreme]) > 1.0 else "large"
        raise ParameterError(fmi_name(extreme), values[extreme], f"be {size} enough for finite moments of inertia")


class CheckedState:
    """Base of a mechanism's initial state, a frozen dataclass: its fields must be finite, and are made floats.

    Raises
    ------
    ParameterError
        For the first field that is not a finite number.
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        initial: Any = self
        for field in fields(initial):
            value = getattr(initial, field.name)
            if isinstance(value, bool) or not isinstance(value, Real) or not isfinite(value):
                raise ParameterError(f"initial.{field.name}", value, "be a finite number")
            object.__setattr__(initial, field.name, float(value))
