"""Force laws of springs: formulas and tables, as straight lines of arithmetic."""

from __future__ import annotations

import ast
from itertools import pairwise
from math import isfinite
from typing import Any

from linkwork.errors import ParameterError

from ..files import Many, Quantity

#: Functions of `math` that formulas may use.
FUNCTIONS = ("sin", "cos", "tan", "atan", "tanh", "exp", "log", "sqrt", "fabs")
_NODES = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd)
_ROWS = Many(Many(Quantity("1"), length=2), least=2)


def law(value: Any, name: str) -> str:
    """Read a force law, a formula in x and v or a table of (x, force), and return it as an expression in x and v.

    Raises
    ------
    ParameterError
        If a formula has anything but arithmetic and functions of `math`, or the rows of a table are not in order.
    """
    if isinstance(value, list):
        return _table(_ROWS(value, name), name)
    wanted = f"be a formula in x and v with + - * / ** and {', '.join(FUNCTIONS)}, or a table of [x, force]"
    try:
        tree = ast.parse(str(value), mode="eval")
    except (SyntaxError, ValueError, RecursionError):
        raise ParameterError(name, value, wanted) from None
    called = {node.func for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        right = (
            (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and len(node.args) == 1
                and not node.keywords
            )
            or (isinstance(node, ast.Name) and node.id in (FUNCTIONS if node in called else ("x", "v")))
            or (isinstance(node, ast.Constant) and _finite(node.value))
            or isinstance(node, (*_NODES, ast.Load))
        )
        if not right:
            raise ParameterError(name, value, wanted)
    return ast.unparse(tree)


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _table(rows: tuple[tuple[float, float], ...], name: str) -> str:
    """Return a broken line, continued at both ends, as the sum of a straight line and magnitudes."""
    if any(b[0] <= a[0] for a, b in pairwise(rows)):
        raise ParameterError(name, [list(row) for row in rows], "have rows of rising x")
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(rows)]
    bends = [(row[0], 0.5 * (after - before)) for row, before, after in zip(rows[1:], slopes, slopes[1:])]
    slope = 0.5 * (slopes[0] + slopes[-1])
    level = rows[0][1] - slope * rows[0][0] - sum(bend * abs(rows[0][0] - x) for x, bend in bends)
    return " + ".join((f"{level!r} + {slope!r} * x", *(f"{bend!r} * fabs(x - {x!r})" for x, bend in bends)))
