"""Parse formulas and requirements from text without running it as code; trace users' functions with CasADi symbols."""

from __future__ import annotations

import ast
import builtins
import math
import re
from collections.abc import Callable, Mapping
from math import e, pi, tau
from types import CellType, CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError, ParameterError

from ...files import unknown_name
from ...numerics import symbolic
from ...units import quantity
from .constraint import UNKNOWNS, Require, RotationRequirement
from .target import TargetPath

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
    """Convert a text such as ``"70 + 100*abs(sin(t/2))"`` to a function of one variable.

    The text may contain numbers, ``+ - * / % **``, brackets, ``pi e tau``, ``sin cos tan asin acos atan atan2 sinh cosh tanh
    exp log sqrt abs sign floor ceil hypot min max degrees radians``, and the variable; angles are in radians. `ast` parses the
    text, and anything else in the text is refused, not evaluated.

    Returns
    -------
    callable
        Function of an array, with a result of the same shape; it raises InputError if a value is not finite.

    Raises
    ------
    InputError
        If the text is not a formula of this kind; the message names the wrong part.
    """
    tree = _parse(text)

    def refusal(node: ast.AST, reason: str) -> InputError:
        return InputError(f"in the formula {text!r}: {ast.unparse(node)!r} {reason}")

    def unknown_name_refusal(node: ast.AST, name: str, known: list[str]) -> InputError:
        return refusal(node, f"is not known: {unknown_name(name, known)}")

    def value(node: ast.AST, t: FloatArray) -> Any:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                try:
                    return np.float64(number)
                except OverflowError:
                    raise refusal(node, "is too large") from None
            case ast.Name(id=name):
                if name == variable:
                    return t
                if name not in _CONSTANTS:
                    raise unknown_name_refusal(node, name, [variable, *_CONSTANTS])
                return _CONSTANTS[name]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](value(left, t), value(right, t))
            case ast.BinOp(op=ast.BitXor()):
                raise refusal(node, "has ^, which is no power here: write **")
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](value(operand, t))
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                if name not in _FUNCTIONS:
                    raise unknown_name_refusal(node, name, list(_FUNCTIONS))
                function, count = _FUNCTIONS[name]
                if len(args) != count:
                    raise refusal(node, f"has {len(args)} arguments: {name} takes {count}")
                return function(*(value(arg, t) for arg in args))
            case _:
                raise refusal(node, "is not allowed: a formula has numbers, operators, functions and constants only")

    def evaluate_formula(t: ArrayLike) -> FloatArray:
        t = np.asarray(t, dtype=float)
        with np.errstate(all="ignore"):  # the values are checked below
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
    return evaluate_formula


def _parse(text: str) -> ast.expr:
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
    """Return n evenly spaced values from start to end; ``turn`` leaves the end out."""
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
    """Compute a curve from two formulas, at n equal steps of their parameter.

    Parameters
    ----------
    x, y : str
        See `formula`; for example ``"20 + 10*cos(t)"`` and ``"15 + 5*sin(t)"``.
    n : int
        Number of points.
    unit : str
        Unit of the formulas' values, such as ``"cm"``.
    start, end : float or str
        Range of the parameter, as numbers or formulas such as ``"3*pi/2"``. If the curve ends at its first point (to within
        1e-9 of its extent), it is closed, and that point is not repeated.
    variable : str
        Name of the parameter in the formulas.

    Raises
    ------
    InputError
        If a formula, the range or the curve is not usable.
    ParameterError
        If the unit is not a unit of length.
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
    """Compute angles at n equal steps of the crank angle from a formula such as ``"70 + 100*abs(sin(t/2))"``.

    Parameters
    ----------
    text : str
        See `formula`; its variable is the crank angle omega t (rad).
    n, variable
        As for `path_from_formula`.
    unit : str
        Unit of the formula's value.
    start, end : float or str
        Range of the crank angle. If it is a number of whole turns, the end is left out, because it repeats the start.
    spacing : "even" or "chebyshev"
        "chebyshev" is for precision points: see `chebyshev_spacing`.

    Returns
    -------
    crank_angle, angle : ndarray, shape (n,)
        Crank angles and angles of the formula (rad).

    Raises
    ------
    InputError
        If the formula or the range is not usable.
    ParameterError
        If the unit is not a unit of angle.
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
    """Return n precision points between two limits, spaced so that the error between them is nearly the least possible.

    The points are the roots of Chebyshev's polynomial of degree n, as Freudenstein recommends.

    Raises
    ------
    InputError
        If there is no point, or the limits are not in order.
    """
    if n < 1 or not (np.isfinite([low, high]).all() and low < high):
        raise InputError(f"{n} precision points from {low:g} to {high:g}: at least one, between finite limits in order")
    return 0.5 * (low + high) - 0.5 * (high - low) * np.cos((2.0 * np.arange(1, n + 1) - 1.0) * pi / (2 * n))


_COMPARISONS: Mapping[type[ast.cmpop], tuple[int, bool]] = {
    ast.LtE: (1, False),
    ast.Lt: (1, False),
    ast.GtE: (-1, False),
    ast.Gt: (-1, False),
    ast.Eq: (1, True),
}
#: Longest requirement, in characters.
_LONGEST_TEXT = 1000
_REQUIREMENT_FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log", "hypot")
_MEASURE = re.compile(
    r"(?<![\w.])(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)\s*(um|mm|cm|m|km|in|ft|deg|rad)\b"
)


def requirement(text: Any, name: str = "constraints.require") -> Require:
    """Convert a text such as ``"crank_length + rocker_length <= 300 mm"`` to a constraint.

    The text compares two sides by ``<=``, ``>=`` or ``==``. A side may contain dimensions by their name in `Linkage`, numbers
    with a unit of length or angle or without a unit (SI), ``+ - * / **``, brackets, ``pi`` and functions, nothing else.

    Raises InputError if the text is not a constraint; the message names the wrong part.
    """
    if not isinstance(text, str):
        raise ParameterError(name, text, "be a text such as 'crank_length <= 50 mm'")
    if len(text) > _LONGEST_TEXT:
        raise InputError(
            f"the requirement {text[:40]!r}... has {len(text)} characters: it must have {_LONGEST_TEXT} at most"
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
    if not (isinstance(tree, ast.Compare) and len(tree.ops) == 1 and type(tree.ops[0]) in _COMPARISONS):
        raise InputError(f"the requirement {text!r} is no comparison: it must have two sides about <=, >= or ==")
    numbers: list[float] = []
    sign, equal = _COMPARISONS[type(tree.ops[0])]
    sides = (tree.left, tree.comparators[0])
    try:
        for side in sides:
            _check_side(side, text, numbers)
        function = _compile_dimensions(ast.BinOp(sides[sign < 0], ast.Sub(), sides[sign > 0]))
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
        pass  # it has no value only for these dimensions
    scale = max((abs(number) for number in numbers if number), default=1.0)
    return Require(function=function, equal=equal, name=text, scale=scale)


def _check_side(node: ast.AST, text: str, numbers: list[float]) -> None:
    def refusal(reason: str) -> InputError:
        return InputError(f"in the requirement {text!r}: {ast.unparse(node)!r} {reason}")

    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool) and abs(number) < 1e300:
            numbers.append(float(number))
        case ast.Name(id=name):
            if name not in (*UNKNOWNS, "pi"):
                raise unknown_name(name, (*UNKNOWNS, "pi", *_REQUIREMENT_FUNCTIONS))
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right=right):
            _check_side(left, text, numbers)
            _check_side(right, text, numbers)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check_side(operand, text, numbers)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if args:
            if name not in _REQUIREMENT_FUNCTIONS:
                raise unknown_name(name, _REQUIREMENT_FUNCTIONS)
            for arg in args:
                _check_side(arg, text, numbers)
        case _:
            raise refusal("is not allowed: it must be dimensions, numbers, + - * / ** and functions")


class _Dimensions(ast.NodeTransformer):
    """Syntax transformer: names of dimensions become attributes of the argument, numbers become floats."""

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id not in UNKNOWNS:
            return node
        return ast.Attribute(value=ast.Name(id="p", ctx=ast.Load()), attr=node.id, ctx=ast.Load())

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant(float(node.value))  # type: ignore[arg-type]  # 9**9**9 of integers would never end


def _compile_dimensions(tree: ast.expr) -> Callable[[Any], Any]:
    """Compile an expression of dimensions and functions of `math` to a function of a namespace with the dimensions."""
    argument = ast.arguments(posonlyargs=[], args=[ast.arg(arg="p")], kwonlyargs=[], kw_defaults=[], defaults=[])
    body = ast.Expression(body=ast.Lambda(args=argument, body=_Dimensions().visit(tree)))
    code = compile(ast.fix_missing_locations(body), "<requirement>", "eval")
    inner = next(c for c in code.co_consts if isinstance(c, CodeType))
    space = {"__builtins__": {}, "pi": pi, **{name: getattr(math, name) for name in _REQUIREMENT_FUNCTIONS}}
    return FunctionType(inner, space, "requirement")


#: Number of rotations at which a function is evaluated to find its greatest values.
DENSE = 721
#: Functions that a user's function may take from `math` or NumPy.
TRACED = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh",
    "exp", "log", "sqrt", "hypot", "fabs",
)  # fmt: skip
#: Functions that CasADi has under another name, or not at all.
RENAMED: dict[str, Callable[..., Any]] = {
    "degrees": lambda x: x * (180.0 / pi),
    "radians": lambda x: x * (pi / 180.0),
    "pow": lambda x, y: x**y,
    "power": lambda x, y: x**y,
    "maximum": lambda x, y: symbolic.library().fmax(x, y),
    "minimum": lambda x, y: symbolic.library().fmin(x, y),
}


def convert_to_si(p: SimpleNamespace, unit: float, origin: complex) -> SimpleNamespace:
    """Convert dimensions from normal form to SI, the units of users' functions.

    ``unit`` is the size of the target and ``origin`` its centre (m); see `Normal`.
    """
    values = dict(vars(p))
    for name in UNKNOWNS[:7]:
        values[name] = unit * values[name]
    values["pivot_x"], values["pivot_y"] = values["pivot_x"] + origin.real, values["pivot_y"] + origin.imag
    return SimpleNamespace(**values)


def trace_requirement(require: Require, values: SimpleNamespace, *rotation: Any) -> Any:
    """Evaluate a required function with CasADi symbols; functions of `math` and NumPy are replaced by CasADi's functions.

    ``values`` has the dimensions; ``rotation`` are the crank rotations, given only for a `RotationRequirement`.

    Raises
    ------
    InputError
        If the function branches on its argument, or calls a function that CasADi does not have.
    """
    casadi = symbolic.library()
    if require.symbolic:
        return casadi.SX(require.function(values, *rotation))
    try:
        value = casadi.SX(_replace_modules(require.function, {})(values))
    except Exception as error:
        raise InputError(
            f"{require.name} cannot be traced ({type(error).__name__}: {error}): it must be arithmetic and functions of math, "
            "without branches"
        ) from error
    if value.numel() != 1 or value.is_constant():
        # a function that converts a symbol to a float loses the symbol, and its value is NaN
        raise InputError(
            f"{require.name} cannot be traced (its value is {value}): it must be one number, by arithmetic and functions of "
            "math from the dimensions"
        )
    return value


def find_peaks(along: RotationRequirement, values: SimpleNamespace, count: int) -> FloatArray:
    """Find the ``count`` highest peaks of a function of the crank rotation, and their curvatures.

    Returns
    -------
    ndarray, shape (count, 1 + n)
        A row for each peak, the highest first; the ends of the range count as peaks. The first column is the crank rotation
        (rad). Then follows, for each of the n values of the function, -1/2 divided by the second derivative of this value, or
        0 if this value has no peak there; with the slope this number gives the height of a nearby peak. If there are fewer
        peaks, the first row is repeated.
    """
    assert along.ends is not None
    rotation = np.linspace(*along.ends, DENSE)
    columns = np.asarray(along.function(values, symbolic.library().DM(rotation))).reshape(DENSE, -1)
    step, none = rotation[1] - rotation[0], [0.0] * columns.shape[1]
    found: list[tuple[float, list[float]]] = []
    for n, row in enumerate(np.nan_to_num(columns, nan=-np.inf).T):
        inner = row[1:-1]
        for k in np.nonzero((inner >= row[:-2]) & (inner > row[2:]) & np.isfinite(row[:-2] + row[2:]))[0]:
            before, now, after = row[k : k + 3]
            # the vertex of the parabola through three values
            curved = 2.0 * now - before - after
            off = 0.5 * (after - before) / curved
            bends = [*none[:n], 0.5 * step**2 / curved, *none[n + 1 :]]
            found.append((now + 0.25 * off * (after - before), [rotation[k + 1] + off * step, *bends]))
        found += [(row[end], [rotation[end], *none]) for end in (0, -1)]
    places = [place for _, place in sorted(found, reverse=True)[:count]]
    return np.array(places + places[:1] * (count - len(places)))


def _replace_modules(value: Any, seen: dict[int, Any]) -> Any:
    """Return a copy of a user's function, and of all functions called in it, with CasADi instead of `math` and NumPy.

    A value that is no function is returned, or replaced if it is one of these modules. ``seen`` has the copies made so far.
    """
    casadi = symbolic.library()
    if isinstance(value, ModuleType) and value.__name__ in ("math", "numpy"):
        known = {n: getattr(casadi, n) for n in TRACED} | RENAMED
        return SimpleNamespace(**vars(value) | {n: f for n, f in known.items() if hasattr(value, n)})
    if any(getattr(module, getattr(value, "__name__", ""), None) is value for module in (math, np)):
        name = value.__name__
        return RENAMED.get(name, getattr(casadi, name) if name in TRACED else value)
    if not isinstance(value, FunctionType):
        return value
    if id(value) not in seen:
        cells = [CellType() for _ in value.__closure__ or ()]
        space: dict[str, Any] = {}
        f = FunctionType(value.__code__, space, value.__name__, value.__defaults__, tuple(cells))
        f.__kwdefaults__ = value.__kwdefaults__
        seen[id(value)] = f
        space.update(
            {
                name: _replace_modules(x, seen)
                for name, x in value.__globals__.items()
                if name in _global_names(value.__code__)
            }
        )
        space["__builtins__"] = value.__globals__.get("__builtins__", builtins)
        for cell, old in zip(cells, value.__closure__ or ()):
            cell.cell_contents = _replace_modules(old.cell_contents, seen)
    return seen[id(value)]


def _global_names(code: CodeType) -> set[str]:
    """Return the global names that a code object, or a code object nested in it, may use."""
    return {*code.co_names}.union(*(_global_names(c) for c in code.co_consts if isinstance(c, CodeType)))
