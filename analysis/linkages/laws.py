"""Read force laws of springs: formulas with constants, or tables, written as arithmetic without branches."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from itertools import pairwise
from math import isfinite
from typing import Any

from linkwork.errors import ParameterError

from ..files import Many, Quantity, as_table
from ..units import quantity

#: Functions of `math` that formulas may use.
FUNCTIONS = ("sin", "cos", "tan", "atan", "tanh", "exp", "log", "sqrt", "fabs")
_NODES = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd)
_ROWS = Many(Many(Quantity("1"), length=2), least=2)
_WANTED = f"be a formula in x, v and the constants with + - * / ** and {', '.join(FUNCTIONS)}, or a table of [x, force]"
#: Units that a constant of a law may have.
_UNITS = ("1", "rad", "m", "rad/s", "m/s", "N", "N.m", "N/m", "N.m/rad", "N.s/m", "N.m.s/rad", "kg", "s")


def law(value: Any, name: str) -> str:
    """Read a force law, a formula or a table of (x, force); return it as an expression in x, v and the constants.

    Raises
    ------
    ParameterError
        If a formula has anything but names, arithmetic and functions of `math`, or the rows of a table are not in order.
    """
    if isinstance(value, list):
        if any(isinstance(number, str) for row in value if isinstance(row, list) for number in row):
            raise ParameterError(name, value, "have rows of numbers without units: m and N, about a pin rad and N.m")
        return _table(_ROWS(value, name), name)
    try:
        tree = ast.parse(str(value), mode="eval")
    except (SyntaxError, ValueError, RecursionError):
        raise ParameterError(name, value, _WANTED) from None
    called = {node.func for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        right = (
            (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and len(node.args) == 1
                and not node.keywords
            )
            or (isinstance(node, ast.Name) and (node.id in FUNCTIONS) == (node in called))
            or (isinstance(node, ast.Constant) and _finite(node.value))
            or isinstance(node, (*_NODES, ast.Load))
        )
        if not right:
            raise ParameterError(name, value, _WANTED)
    return ast.unparse(tree)


def constants(value: Any, name: str) -> dict[str, tuple[float, str]]:
    """Read the constants of a law, quantities of any usual dimension; return their values in SI with their units."""
    return {own: _constant(given, f"{name}.{own}") for own, given in as_table(value, name).items()}


def _constant(value: Any, name: str) -> tuple[float, str]:
    for unit in _UNITS:
        try:
            return quantity(value, unit, name), unit
        except ParameterError:
            continue
    raise ParameterError(name, value, f"be a quantity with a unit, as of {', '.join(_UNITS[1:])}")


def check_law(formula: str, known: Mapping[str, Any], name: str) -> None:
    """Raise ParameterError if a law contains a name that is not a constant, or a constant has a reserved name."""
    names = {node.id for node in ast.walk(ast.parse(formula)) if isinstance(node, ast.Name)}
    if not names <= {"x", "v", *FUNCTIONS, *known}:
        raise ParameterError(name, formula, _WANTED)
    for own in known:
        if own in ("x", "v", *FUNCTIONS) or not re.fullmatch("[a-z][a-z0-9_]*", own):
            where = f"{name.rpartition('.')[0]}.constants.{own}"
            raise ParameterError(where, known[own], "have a name of small letters that is no function, x or v")


def with_constants(formula: str, known: Mapping[str, Any], prefix: str) -> str:
    """Return a law with each constant written as a field of the parameters p."""
    if not known:
        return formula
    return re.sub(rf"\b({'|'.join(known)})\b", rf"p.{prefix}_\1", formula)


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _table(rows: tuple[tuple[float, float], ...], name: str) -> str:
    """Return piecewise linear interpolation, extrapolated at both ends, as a straight line plus terms in abs(x - x_k)."""
    if any(b[0] <= a[0] for a, b in pairwise(rows)):
        raise ParameterError(name, [list(row) for row in rows], "have rows of rising x")
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(rows)]
    bends = [(row[0], 0.5 * (after - before)) for row, before, after in zip(rows[1:], slopes, slopes[1:])]
    slope = 0.5 * (slopes[0] + slopes[-1])
    level = rows[0][1] - slope * rows[0][0] - sum(bend * abs(rows[0][0] - x) for x, bend in bends)
    return " + ".join((f"{level!r} + {slope!r} * x", *(f"{bend!r} * fabs(x - {x!r})" for x, bend in bends)))
