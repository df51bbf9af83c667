"""Read force laws of springs, formulas with constants or tables, and write them as arithmetic without branches."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import isfinite, tau
from typing import Any, TypeAlias

from linkwork.errors import ParameterError

from ..files import Many, any_value, as_table
from ..units import quantity

#: A formula, or the rows (x, force) of a table as they were given.
Law: TypeAlias = str | tuple[tuple[Any, Any], ...]

#: Functions of `math` that the source of a law may call.
WRITTEN = ("sin", "cos", "tan", "atan", "tanh", "exp", "log", "sqrt", "fabs", "pow")
#: Functions that formulas may use, with the number of their arguments.
FUNCTIONS = {**dict.fromkeys((*WRITTEN[:-1], "abs"), 1), "max": 2, "min": 2}
_NODES = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd)
_ROWS = Many(Many(any_value, length=2), least=2)
_WANTED = f"be a formula in x, v and the constants with + - * / ** and {', '.join(FUNCTIONS)}, or a table of [x, force]"
#: Units that a constant of a law may have.
_UNITS = (
    "1", "rad", "m", "rad/s", "m/s", "N", "N.m", "N/m", "N.m/rad", "N.s/m", "N.m.s/rad", "N/m2", "N/m3", "N.s2/m2", "m2", "m3",
    "kg", "s",
)  # fmt: skip
#: Angles at which the value of a law is compared with its value one turn later (rad).
_ANGLES = (-2.0, -0.7, 0.3, 1.9)


def law(value: Any, name: str) -> Law:
    """Read a force law: a formula, or the rows (x, force) of a table, whose units depend on the joint (see `expression`).

    ParameterError is raised if a formula has anything but names, arithmetic and the known functions, or a table has fewer
    than two rows.
    """
    if isinstance(value, list):
        return _ROWS(value, name)
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
                and len(node.args) == FUNCTIONS.get(node.func.id)
                and not node.keywords
            )
            or (isinstance(node, ast.Name) and (node.id in FUNCTIONS) == (node in called))
            or (isinstance(node, ast.Constant) and _finite(node.value))
            or isinstance(node, (*_NODES, ast.Load))
        )
        if not right:
            raise ParameterError(name, value, _WANTED)
    return ast.unparse(tree)


def expression(law: Law, about: bool, name: str) -> str:
    """Return a force law as an expression in x, v and the constants; ``about`` is true if x is an angle, not a length.

    ParameterError is raised if a quantity in a table has another dimension, or x does not increase from row to row.
    """
    if isinstance(law, str):
        return ast.unparse(_WithoutBranches().visit(ast.parse(law, mode="eval")))
    units = ("rad", "N.m") if about else ("m", "N")
    rows = [[quantity(value, unit, name, bare=unit) for value, unit in zip(row, units)] for row in law]
    return _table(rows, name)


class _WithoutBranches(ast.NodeTransformer):
    """Syntax transformer: max, min and abs become expressions with `math.fabs`, and powers become `math.pow`.

    `math.pow` raises an error where ``**`` gives a complex number. Powers with a whole constant exponent keep ``**``.
    """

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        whole = re.fullmatch(r"-?\d+", ast.unparse(node.right))
        if not isinstance(node.op, ast.Pow) or whole:
            return node
        return ast.Call(ast.Name("pow"), [node.left, node.right], [])

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        name, (a, b, *_) = ast.unparse(node.func), (*(f"({ast.unparse(own)})" for own in node.args), "")
        if name not in ("abs", "max", "min"):
            return node
        sign = "+" if name == "max" else "-"
        written = f"fabs{a}" if name == "abs" else f"0.5 * ({a} + {b} {sign} fabs({a} - {b}))"
        return ast.parse(written, mode="eval").body


def constants(value: Any, name: str) -> dict[str, tuple[float, str]]:
    """Read the constants of a law, quantities of any usual dimension; return their values in SI with their units."""
    return {own: _constant(given, f"{name}.{own}") for own, given in as_table(value, name).items()}


def _constant(value: Any, name: str) -> tuple[float, str]:
    # a radian has no dimension: only the text shows whether it is meant
    angular = bool(re.search("rad|deg|°|rpm|/min|turn|rev|cycle", str(value)))
    for unit in sorted(_UNITS, key=lambda unit: ("rad" in unit) != angular):
        try:
            return quantity(value, unit, name), unit
        except ParameterError:
            continue
    raise ParameterError(name, value, f"be a number in SI, or a quantity of the kind of {', '.join(_UNITS[1:])}")


def check_law(law: Law, known: Mapping[str, Any], name: str) -> None:
    """Raise ParameterError if a formula contains a name that is not a constant, or a constant has a reserved name."""
    formula = law if isinstance(law, str) else ""
    names = {node.id for node in ast.walk(ast.parse(formula)) if isinstance(node, ast.Name)}
    if unknown := sorted(names - {"x", "v", *FUNCTIONS, *known}):
        own = unknown[0]
        wanted = f"have x, v and its constants only: {own} is none of them; give its value, as in constants = {{ {own} = 2.5 }}"
        raise ParameterError(name, formula, wanted)
    for own in known:
        if own in ("x", "v", "pow", *FUNCTIONS) or not re.fullmatch("[a-z][a-z0-9_]*", own):
            where = f"{name.rpartition('.')[0]}.constants.{own}"
            raise ParameterError(
                where, known[own], "have a name of lower-case letters that is neither a function nor x or v"
            )


def is_periodic(law: Law, known: Mapping[str, tuple[float, str]]) -> bool:
    """Return whether a force law about a pin repeats itself after every whole turn.

    It does if the angle x occurs in sin, cos and tan only, and the law has the same values one turn later.
    """
    if not isinstance(law, str) or _has_plain_angle(ast.parse(law, mode="eval")):
        return False
    names = vars(math) | {"abs": abs, "max": max, "min": min} | {name: value for name, (value, _) in known.items()}
    code = compile(law, "law", "eval")
    try:
        turns = [
            [eval(code, {"__builtins__": {}}, names | {"x": x + way, "v": 1.0}) for x in _ANGLES] for way in (0.0, tau)
        ]
    except (ArithmeticError, ValueError, TypeError):
        return False
    return all(abs(b - a) <= 1e-9 * max(map(abs, turns[0])) for a, b in zip(*turns))


def _has_plain_angle(node: ast.AST) -> bool:
    """Return whether x occurs outside of sin, cos and tan."""
    if isinstance(node, ast.Call) and ast.unparse(node.func) in ("sin", "cos", "tan"):
        return False
    return (isinstance(node, ast.Name) and node.id == "x") or any(map(_has_plain_angle, ast.iter_child_nodes(node)))


def with_constants(formula: str, known: Mapping[str, Any], prefix: str) -> str:
    """Return a law with each constant written as a field of the parameters p, whose names begin with ``prefix``."""
    if not known:
        return formula
    return re.sub(rf"\b({'|'.join(known)})\b", rf"p.{prefix}_\1", formula)


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _table(rows: Sequence[Sequence[float]], name: str) -> str:
    """Return the expression of linear interpolation, extrapolated at both ends: a line plus terms in abs(x - x_k)."""
    xs, (force, *_) = zip(*rows)
    if any(after <= before for before, after in pairwise(xs)):
        raise ParameterError(name, [list(row) for row in rows], "have rows of rising x")
    slopes = [(f2 - f1) / (x2 - x1) for (x1, f1), (x2, f2) in pairwise(rows)]
    bends = [(x, 0.5 * (after - before)) for x, before, after in zip(xs[1:], slopes, slopes[1:])]
    slope = 0.5 * (slopes[0] + slopes[-1])
    level = force - slope * xs[0] - sum(bend * abs(xs[0] - x) for x, bend in bends)
    return " + ".join((f"{level!r} + {slope!r} * x", *(f"{bend!r} * fabs(x - {x!r})" for x, bend in bends)))
