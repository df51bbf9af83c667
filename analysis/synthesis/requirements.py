"""Constraints written as text, such as ``"crank_length + rocker_length <= 300 mm"``."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping
from math import pi
from types import CodeType, FunctionType, SimpleNamespace
from typing import Any

from linkwork.errors import InputError, LinkworkError, ParameterError

from ..files import unknown_name
from ..units import quantity
from .constraints import UNKNOWNS, Require

_COMPARED: Mapping[type[ast.cmpop], tuple[int, bool]] = {
    ast.LtE: (1, False),
    ast.Lt: (1, False),
    ast.GtE: (-1, False),
    ast.Gt: (-1, False),
    ast.Eq: (1, True),
}
#: Longest text that is read.
_LONGEST = 1000
_REQUIRED = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log", "hypot")
_MEASURE = re.compile(
    r"(?<![\w.])(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)\s*(um|mm|cm|m|km|in|ft|deg|rad)\b"
)


def requirement(text: Any, name: str = "constraints.require") -> Require:
    """A constraint from a text such as ``"crank_length + rocker_length <= 300 mm"``.

    Two sides about ``<=``, ``>=`` or ``==``, of dimensions by their name in `Linkage`, numbers with a unit of length or angle
    or without (SI), ``+ - * / **``, brackets, ``pi`` and functions. It is parsed, and each part either stands on this list or
    is refused.

    Raises InputError if it is none; the part that is not is named.
    """
    if not isinstance(text, str):
        raise ParameterError(name, text, "be a text such as 'crank_length <= 50 mm'")
    if len(text) > _LONGEST:
        raise InputError(
            f"the requirement {text[:40]!r}... has {len(text)} characters: it must have {_LONGEST} at most"
        )
    units = {"deg": "rad", "rad": "rad"}

    def in_si(found: re.Match[str]) -> str:
        return repr(quantity(found[0], units.get(found[2], "m"), name))

    plain = _MEASURE.sub(in_si, text)
    try:
        tree = ast.parse(plain.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error)
        raise InputError(f"the requirement {text!r} cannot be read: {reason}") from None
    if not (isinstance(tree, ast.Compare) and len(tree.ops) == 1 and type(tree.ops[0]) in _COMPARED):
        raise InputError(f"the requirement {text!r} is no comparison: it must have two sides about <=, >= or ==")
    numbers: list[float] = []
    sign, equal = _COMPARED[type(tree.ops[0])]
    sides = (tree.left, tree.comparators[0])
    try:
        for side in sides:
            _check_side(side, text, numbers)
        function = _of_dimensions(ast.BinOp(sides[sign < 0], ast.Sub(), sides[sign > 0]))
        if math.isinf(function(SimpleNamespace(**dict.fromkeys(UNKNOWNS, 0.1)))):
            raise OverflowError
    except RecursionError:
        raise InputError(f"the requirement {text!r} is nested too deeply") from None
    except TypeError as error:
        raise InputError(f"the requirement {text!r} cannot be evaluated: {error}") from None
    except OverflowError:
        raise InputError(f"the requirement {text!r} has a number that is too large") from None
    except LinkworkError:
        raise
    except (ValueError, ArithmeticError):
        pass  # of these dimensions only
    scale = max((abs(number) for number in numbers if number), default=1.0)
    return Require(function=function, equal=equal, name=text, scale=scale)


def _check_side(node: ast.AST, text: str, numbers: list[float]) -> None:
    def refused(reason: str) -> InputError:
        return InputError(f"in the requirement {text!r}: {ast.unparse(node)!r} {reason}")

    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool) and abs(number) < 1e300:
            numbers.append(float(number))
        case ast.Name(id=name):
            if name not in (*UNKNOWNS, "pi"):
                raise unknown_name(name, (*UNKNOWNS, "pi", *_REQUIRED))
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right=right):
            _check_side(left, text, numbers)
            _check_side(right, text, numbers)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check_side(operand, text, numbers)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if args:
            if name not in _REQUIRED:
                raise unknown_name(name, _REQUIRED)
            for arg in args:
                _check_side(arg, text, numbers)
        case _:
            raise refused("is not allowed: it must be dimensions, numbers, + - * / ** and functions")


class _Dimensions(ast.NodeTransformer):
    """Names of dimensions become attributes of the argument, numbers floats."""

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id not in UNKNOWNS:
            return node
        return ast.Attribute(value=ast.Name(id="p", ctx=ast.Load()), attr=node.id, ctx=ast.Load())

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant(float(node.value))  # type: ignore[arg-type]  # 9**9**9 of integers would never end


def _of_dimensions(tree: ast.expr) -> Callable[[Any], Any]:
    """A function of a namespace of dimensions; from `math` as a function written by hand, so that it can be traced."""
    argument = ast.arguments(posonlyargs=[], args=[ast.arg(arg="p")], kwonlyargs=[], kw_defaults=[], defaults=[])
    body = ast.Expression(body=ast.Lambda(args=argument, body=_Dimensions().visit(tree)))
    code = compile(ast.fix_missing_locations(body), "<requirement>", "eval")
    inner = next(c for c in code.co_consts if isinstance(c, CodeType))
    space = {"__builtins__": {}, "pi": pi, **{name: getattr(math, name) for name in _REQUIRED}}
    return FunctionType(inner, space, "requirement")
