"""Units: convert numbers and texts such as "420 rpm" to SI, and SI to the units that tables and figures show."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import lru_cache, wraps
from inspect import signature
from math import inf, isfinite, tau
from numbers import Real
from types import MappingProxyType
from typing import Any, TypeVar, cast

from linkwork.errors import ParameterError
from linkwork.units import CM_PER_METRE as CM_PER_METRE
from linkwork.units import INCH as INCH
from linkwork.units import RAD_S_PER_RPM as RAD_S_PER_RPM
from linkwork.variables import UNITS

#: A number in SI, or a text with its unit such as "420 rpm", which `in_si` converts to a float; also an array or list of them.
Amount = Any
#: Unit of an argument; or the units of a mapping's entries by name, or a function that returns them.
Units = str | Mapping[str, str] | Callable[[], Mapping[str, str]]

_Callable = TypeVar("_Callable", bound=Callable[..., Any])

#: Results below this magnitude in the units of tables and pictures (mm, deg, N) are rounding errors, and are shown as zero.
ROUNDING = 1e-9

#: Units of length (m).
LENGTHS: Mapping[str, float] = MappingProxyType({"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": INCH})


def display_scale(unit: str) -> tuple[str, float]:
    """Return the unit in which tables and pictures show a quantity, such as mm for m, and the factor from SI to this unit."""
    displays = UNITS[unit].displays if unit in UNITS else ()
    return displays[0] if displays else (unit, 1.0)


def display_text(value: float, unit: str, digits: int = 6) -> str:
    """Return a value given in SI as text in the unit in which tables show it, such as "700 rpm" or "3 mm"."""
    shown, factor = display_scale(unit)
    return f"{factor * value:.{digits}g}" + ("" if shown == "1" else f" {shown}")


def _pint_unit(unit: str) -> str:
    """Return a unit of the FMI contract as pint spells it: "kg.m2" becomes "kg*m**2"."""
    return "dimensionless" if unit == "1" else re.sub(r"(?<=[a-z])(\d)", r"**\1", unit.replace(".", "*"))


def with_unit(value: float, unit: str) -> str:
    """Return a number in SI as a text with its unit, which `quantity` reads back exactly."""
    return f"{float(value)!r} {_pint_unit(unit)}"


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def quantity(value: Any, unit: str, name: str, *, bare: str | None = None) -> float:
    """Convert a number or a text with a unit to a number in SI.

    Parameters
    ----------
    value : float or str
        ``0.1535`` or ``"15.35 cm"``. A text needs its unit: a bare "30" for an angle was hardly meant in radians.
    unit : str
        SI unit of the result, such as ``N.s/m``.
    name : str
        Name of the quantity for error messages.
    bare : str, optional
        Unit of numbers without a unit, such as ``mm``; by default SI.

    Raises
    ------
    ParameterError
        If the value is neither a number nor a text, its unit is missing or has another dimension, or the number is not finite.
        Hertz is refused for an angular speed, as a cycle is not a radian. A number of four turns or more is refused for an
        angle, unless ``bare`` gives its unit: it was probably meant in degrees.
    """
    spelled = _pint_unit(unit)
    wanted = f"be a number in {unit}" if unit != "1" else "be a number"
    if unit != "1":
        wanted += f", or a text with a unit of that kind{f', such as {_USUAL[unit]}' if unit in _USUAL else ''}"
    if isinstance(value, bool) or not isinstance(value, (Real, str)):
        raise ParameterError(name, value, wanted)
    if isinstance(value, str):
        if unit == "rad/s" and "hz" in value.lower().replace("hertz", "hz"):
            raise ParameterError(name, value, "be in rad/s or rpm: in Hz it would be ambiguous by a factor of 2 pi")
        number = _convert(value, unit, spelled, name, wanted)
    else:
        try:
            number = float(value)
        except OverflowError:  # a whole number beyond all floats
            number = inf
        if bare is not None:
            number *= quantity(f"1 {bare}", unit, f"unit of {name}")
        elif unit == "rad" and 4.0 * tau <= abs(number) < inf:
            kept = (
                f'be less than four turns, or a text with its unit, such as "{value:g} deg": a number alone is in rad'
            )
            raise ParameterError(name, value, kept)
    if not isfinite(number):
        raise ParameterError(name, value, "be a finite number")
    return number


def pair(value: Any, unit: str, name: str) -> tuple[float, float]:
    """Convert a pair of numbers or texts with a unit, such as the ends of a range, to SI.

    Raises ParameterError if there are not two values; or as for `quantity`.
    """
    ends: Any = () if isinstance(value, (str, Mapping)) else value
    try:
        first, second = ends
    except (TypeError, ValueError):
        raise ParameterError(name, value, "be two values: [least, greatest]") from None
    return quantity(first, unit, name), quantity(second, unit, name)


def si(value: Any, unit: Units, name: str) -> Any:
    """Convert texts with units to numbers in SI, also inside lists, tuples and mappings; return other values unchanged.

    Raises ParameterError as for `quantity`, also for True and False.

    Parameters
    ----------
    value : object
    unit : str, mapping or function
        See `Units`. Entries of a mapping without a known unit are not converted; the caller refuses them.
    name : str
        Name of the value for error messages.
    """
    if isinstance(value, (str, bool)):
        return quantity(value, unit, name) if isinstance(unit, str) else value
    if isinstance(value, Mapping):
        known = unit() if callable(unit) else unit
        units = dict.fromkeys(value, known) if isinstance(known, str) else known
        return {key: si(v, units[key], f"{name} {key}") if key in units else v for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        parts = [si(part, unit, name) for part in value]
        return value if all(a is b for a, b in zip(parts, value)) else type(value)(parts)
    return value


def in_si(**units: Units) -> Callable[[_Callable], _Callable]:
    """Return a decorator that converts arguments of a function, or fields of a dataclass, to SI; see `si`.

    >>> @in_si(speed="rad/s")
    ... def turns(speed: Amount, time: float) -> float:
    ...     return speed * time / (2.0 * pi)
    >>> round(turns("420 rpm", 1.0), 9)
    7.0
    """

    def decorate(made: _Callable) -> _Callable:
        if isinstance(made, type):
            made.__init__ = decorate(made.__init__)  # type: ignore[misc]
            return made
        names = list(signature(made).parameters)
        # arguments in **options have no position
        places = {names.index(name): name for name in units if name in names}

        @wraps(made)
        def converted(*arguments: Any, **options: Any) -> Any:
            for name in units.keys() & options.keys():
                options[name] = si(options[name], units[name], name)
            if len(arguments) > least:
                arguments = tuple(
                    si(value, units[places[n]], places[n]) if n in places else value
                    for n, value in enumerate(arguments)
                )
            return made(*arguments, **options)

        least = min(places)
        return cast(_Callable, converted)

    return decorate


#: A quantity as text: a number with a decimal point, then a product of units, each with at most one small exponent. No other
#: text reaches pint, which would read "1,5 mm" as 15 mm and "1 500 mm" as 500 mm, and compute 9**9**9.
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?"
_FACTOR = r"(?:[^\W\d_]+|[°%])(?:\s*(?:\*\*|\^)\s*-?[0-9]|[²³]|-?[0-9])?"
_PRODUCT = rf"{_FACTOR}(?:(?:\s*[*/·.]\s*|\s+){_FACTOR})*"
_GRAMMAR = re.compile(rf"\s*({_NUMBER})\s*({_PRODUCT}(?:\s*/\s*\({_PRODUCT}\))?)?\s*")
#: Greatest length of a text that is read.
_LONGEST = 100
#: Spellings of revolutions per minute, and of products of units, that machine builders use and pint does not know.
_TURNS = re.compile(r"(?<=[0-9.\s])(?:(?i:rpm|(?:r|rev|U)/min|min\s*(?:\^|\*\*)?\s*-1)|(?<=\s)1/min)(?=\s*$)")
_WITH_NEWTON = re.compile(r"(?<![^\W\d_])([kmM]?N)([cm]?m)?(s)?(?![^\W\d_])")
_WITH_GRAM = re.compile(r"(?<![^\W\d_])(k?g)([cm]?m)(?![^\W\d_²])")
#: By SI unit: patterns of other spellings; and usual units, for error messages.
_SPELLINGS = {
    "rad/s": _TURNS,
    **dict.fromkeys(("N.m", "N.m/rad", "N.m.s/rad", "N.s/m"), _WITH_NEWTON),
    "kg.m2": _WITH_GRAM,
}
_USUAL = {
    "s": "s or ms",
    "m": "mm, cm or in",
    "m/s": "m/s or mm/s",
    "rad": "deg",
    "rad/s": "rpm or deg/s",
    "kg": "kg or g",
    "kg.m2": "kg*m^2 or g*cm^2",
    "N": "N or kN",
    "N.m": "N*m, N*cm or N*mm",
    "N/m": "N/m or N/mm",
    "N.s/m": "N*s/m or N*s/mm",
    "N.m/rad": "N*m/rad or N*m/deg",
    "N.m.s/rad": "N*m*s/rad",
}
_PLAIN = "write a number with a decimal point, without spaces or separators in it"


def _pint_spelling(text: str, unit: str) -> str:
    """Return the text of a quantity in pint's spelling: "200 U/min" becomes "200 rpm", "20 Nmm" becomes "20 N*mm"."""
    if (pattern := _SPELLINGS.get(unit)) is None:
        return text
    return pattern.sub(lambda found: "*".join(part for part in found.groups() if part) or "rpm", text)


def _convert(text: str, unit: str, spelled: str, name: str, wanted: str) -> float:
    """Convert a text with a unit to a number in the SI unit ``unit``, with pint.

    ``spelled`` is ``unit`` in pint's spelling; ``wanted`` is the end of the error message "it must ...".
    """
    match = _GRAMMAR.fullmatch(_pint_spelling(text, unit)) if len(text) <= _LONGEST else None
    if match is None:
        shown = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
        raise ParameterError(name, shown, f"{wanted}: {_PLAIN}" + (", and a unit" if unit != "1" else ""))
    number, given = float(match[1]), match[2]
    if given is None:
        if unit == "1":
            return number
        raise ParameterError(
            name, text, f"come with its unit, such as '{text} {spelled}', or be a number, which is in SI"
        )
    given = re.sub(
        r"(?<=[^\W\d_])(-?[0-9])", r"**\1", given.replace("·", "*").replace("^", "**")
    )  # m2 for m**2, as FMI has it
    # most files need only these units: pint, which takes half a second to load, gives the same numbers to the last bit
    if given in (unit, spelled):
        return number
    if unit == "m" and given in LENGTHS:
        return number * LENGTHS[given]
    shown, factor = display_scale(unit)
    if given == shown:
        return number * (1.0 / factor)
    import pint

    try:
        return float(_registry().Quantity(number, given).to(spelled).magnitude)
    except pint.UndefinedUnitError as error:
        raise ParameterError(name, text, f"{wanted} ({error.args[0]!r} is no known unit)") from error
    except pint.DimensionalityError as error:
        raise ParameterError(name, text, f"{wanted} ({match[2]!r} is another kind of quantity)") from error
    except (pint.PintError, ValueError, TypeError, AttributeError, ArithmeticError, LookupError, SyntaxError) as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise ParameterError(name, text, f"{wanted} ({reason})") from error
