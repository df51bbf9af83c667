"""Curves and functions of the crank angle from formulas, which are parsed, never run as code."""

from __future__ import annotations

import ast
from collections.abc import Callable
from math import e, pi, tau
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ..files import unknown_name
from ..units import quantity
from .targets import TargetPath

FloatArray = NDArray[np.float64]
Spacing = Literal["even", "chebyshev"]

_CONSTANTS = {"pi": pi, "e": e, "tau": tau}
_FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    **{name: (getattr(np, name), 1) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")},
    **{name: (getattr(np, name), 1) for name in ("abs", "sign", "floor", "ceil", "degrees", "radians")},
    **{name: (getattr(np, f"arc{name[1:]}"), 1) for name in ("asin", "acos", "atan")},
    "atan2": (np.arctan2, 2),
    "hypot": (np.hypot, 2),
    "min": (np.minimum, 2),
    "max": (np.maximum, 2),
}
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Mod: np.mod,
    ast.Pow: np.power,
    ast.UAdd: np.positive,
    ast.USub: np.negative,
}
#: Longest formula, in characters.
_LONGEST = 1000


def formula(text: str, variable: str = "t") -> Callable[[ArrayLike], FloatArray]:
    """A function of one variable from a text such as ``"70 + 100*abs(sin(t/2))"``.

    Numbers, ``+ - * / % **``, brackets, ``pi e tau``, ``sin cos tan asin acos atan atan2 sinh cosh tanh exp log sqrt abs sign
    floor ceil hypot min max degrees radians``, and the variable; angles in radians. Nothing else is run: the text is parsed
    with `ast`, and each node either stands on this list or is refused.

    Returns
    -------
    callable
        From an array to an array of the same shape; raises InputError where the value is not finite.

    Raises
    ------
    InputError
        If the text is no such formula; the part that is not is named.
    """
    tree = _parsed(text)

    def refused(node: ast.AST, reason: str) -> InputError:
        return InputError(f"in the formula {text!r}: {ast.unparse(node)!r} {reason}")

    def unknown(node: ast.AST, name: str, known: list[str]) -> InputError:
        near = unknown_name(name, known).near
        hint = f"; did you mean {near}?" if near else ""
        return refused(node, f"is not known{hint} (there are {', '.join(known)})")

    def value(node: ast.AST, t: FloatArray) -> Any:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                try:
                    return np.float64(number)
                except OverflowError:
                    raise refused(node, "is too large") from None
            case ast.Name(id=name):
                if name == variable:
                    return t
                if name not in _CONSTANTS:
                    raise unknown(node, name, [variable, *_CONSTANTS])
                return _CONSTANTS[name]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](value(left, t), value(right, t))
            case ast.BinOp(op=ast.BitXor()):
                raise refused(node, "has ^, which is no power here: write **")
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](value(operand, t))
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                if name not in _FUNCTIONS:
                    raise unknown(node, name, list(_FUNCTIONS))
                function, count = _FUNCTIONS[name]
                if len(args) != count:
                    raise refused(node, f"has {len(args)} arguments: {name} takes {count}")
                return function(*(value(arg, t) for arg in args))
            case _:
                raise refused(node, "is not allowed: a formula has numbers, operators, functions and constants only")

    def evaluated(t: ArrayLike) -> FloatArray:
        t = np.asarray(t, dtype=float)
        with np.errstate(all="ignore"):  # what comes out is checked instead
            values: FloatArray = np.array(np.broadcast_to(value(tree, t), t.shape), dtype=float)
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"the formula {text!r} has the value {values.flat[bad[0]]} at {variable} = {t.flat[bad[0]]:.6g}: it must be "
                "finite"
            )
        return values

    try:
        with np.errstate(all="ignore"):
            value(tree, np.zeros(()))
    except RecursionError:
        raise InputError(f"the formula {text[:40]!r}... cannot be read: it is nested too deeply") from None
    return evaluated


def _parsed(text: str) -> ast.expr:
    if not isinstance(text, str):
        raise InputError(f"a formula must be a text, not {text!r}")
    if len(text) > _LONGEST:
        raise InputError(f"the formula has {len(text)} characters: it must have no more than {_LONGEST}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error)
        raise InputError(f"the formula {text!r} cannot be read: {reason}") from None


def _number(value: float | str) -> float:
    return float(formula(value, "")(0.0)) if isinstance(value, str) else float(value)


def _parameter(start: float | str, end: float | str, n: int, turn: bool) -> FloatArray:
    """n values at equal steps from start to end, the end itself left out for a whole turn."""
    a, b = _number(start), _number(end)
    if not (np.isfinite([a, b]).all() and b > a):
        raise InputError(f"the parameter goes from {start!r} to {end!r}: the end must be greater, and both finite")
    return np.linspace(a, b, n, endpoint=not turn)


def path_from_formula(
    x: str,
    y: str,
    *,
    n: int = 72,
    unit: str = "m",
    start: float | str = 0.0,
    end: float | str = 2.0 * pi,
    variable: str = "t",
) -> TargetPath:
    """A curve from two formulas, at n equal steps of their parameter.

    Parameters
    ----------
    x, y : str
        See `formula`; for example ``"20 + 10*cos(t)"`` and ``"15 + 5*sin(t)"``.
    n : int
        Number of points.
    unit : str
        Unit of what the formulas give, such as ``"cm"``.
    start, end : float or str
        Range of the parameter, as numbers or formulas such as ``"3*pi/2"``. If the curve is back at its first point at the end
        (to within 1e-9 of its extent), it is closed, and that point is not repeated.

    Raises
    ------
    InputError
        If a formula, the range or the curve is not usable.
    ParameterError
        If the unit is not one of length.
    """
    factor = quantity(f"1 {unit}", "m", "unit")
    functions = [formula(text, variable) for text in (x, y)]

    def points(turn: bool, number: int) -> FloatArray:
        t = _parameter(start, end, number, turn)
        return factor * np.column_stack([f(t) for f in functions])

    drawn = points(False, n + 1)
    closed = bool(np.hypot(*(drawn[-1] - drawn[0])) <= 1e-9 * np.ptp(drawn, axis=0).max())
    return TargetPath(points=points(closed, n), closed=closed)


def function_from_formula(
    text: str,
    *,
    n: int = 72,
    unit: str = "rad",
    start: float | str = 0.0,
    end: float | str = 2.0 * pi,
    variable: str = "t",
    spacing: Spacing = "even",
) -> tuple[FloatArray, FloatArray]:
    """Angles at n equal steps of the crank angle from a formula; for example ``"70 + 100*abs(sin(t/2))"`` in ``"deg"``.

    Parameters
    ----------
    text : str
        See `formula`; its variable is the crank angle omega t (rad).
    n, variable
        As for `path_from_formula`.
    unit : str
        Unit of what the formula gives.
    start, end : float or str
        Range of the crank angle; one of whole turns leaves out its end, which is its start again.
    spacing : "even" or "chebyshev"
        The second for precision points: see `chebyshev_spacing`.

    Returns
    -------
    crank_angle, angle : ndarray, shape (n,)
        rad.

    Raises
    ------
    InputError
        If the formula or the range is not usable.
    ParameterError
        If the unit is not one of angle.
    """
    factor = quantity(f"1 {unit}", "rad", "unit")
    if spacing == "chebyshev":
        places = chebyshev_spacing(_number(start), _number(end), n)
        return places, factor * formula(text, variable)(places)
    turns = (_number(end) - _number(start)) / tau
    whole = bool(np.isfinite(turns) and abs(turns - round(turns)) < 1e-9)
    crank_angle = _parameter(start, end, n, whole)
    return crank_angle, factor * formula(text, variable)(crank_angle)


def chebyshev_spacing(low: float, high: float, n: int) -> FloatArray:
    """Places of n precision points between two limits, at which the error between them is about the least.

    The roots of Chebyshev's polynomial of degree n, as Freudenstein recommends.

    Raises
    ------
    InputError
        If there is no point, or the limits are not in order.
    """
    if n < 1 or not (np.isfinite([low, high]).all() and low < high):
        raise InputError(f"{n} precision points from {low:g} to {high:g}: at least one, between finite limits in order")
    places: FloatArray = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(
        (2.0 * np.arange(1, n + 1) - 1.0) * pi / (2 * n)
    )
    return places
