"""A user's own function of the dimensions, as a constraint: evaluated in SI, or traced for exact derivatives."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable
from math import pi
from types import CellType, CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from linkwork.errors import InputError

from ..numerics import symbolic
from .constraints import UNKNOWNS, Along, FloatArray, Require

#: Rotations among which the greatest values of a function are looked for.
DENSE = 721
#: What a function of the user's may take from `math` or NumPy.
TRACED = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh",
    "exp", "log", "sqrt", "hypot", "fabs",
)  # fmt: skip
#: And what CasADi has under another name, or not at all.
RENAMED: dict[str, Callable[..., Any]] = {
    "degrees": lambda x: x * (180.0 / pi),
    "radians": lambda x: x * (pi / 180.0),
    "pow": lambda x, y: x**y,
    "power": lambda x, y: x**y,
    "maximum": lambda x, y: symbolic.library().fmax(x, y),
    "minimum": lambda x, y: symbolic.library().fmin(x, y),
}


def physical(p: SimpleNamespace, unit: float, origin: complex) -> SimpleNamespace:
    """Dimensions in SI, from those in normal form, for functions of the user's."""
    values = dict(vars(p))
    for name in UNKNOWNS[:7]:
        values[name] = unit * values[name]
    values["pivot_x"], values["pivot_y"] = values["pivot_x"] + origin.real, values["pivot_y"] + origin.imag
    return SimpleNamespace(**values)


def traced(require: Require, values: SimpleNamespace, *rotation: Any) -> Any:
    """Value of a function for CasADi symbols; what one of the user's takes from `math` or NumPy is replaced by CasADi's.

    Raises
    ------
    InputError
        If it branches on its argument, or calls what CasADi cannot.
    """
    casadi = symbolic.library()
    if require.symbolic:
        return casadi.SX(require.function(values, *rotation))
    try:
        value = casadi.SX(_rebound(require.function, {})(values))
    except Exception as error:
        raise InputError(
            f"{require.name} cannot be traced ({type(error).__name__}: {error}): it must be arithmetic and functions of math, "
            "without branches"
        ) from error
    if value.numel() != 1 or value.is_constant():
        # what turns a symbol into a float by itself has lost it: NaN
        raise InputError(
            f"{require.name} cannot be traced (its value is {value}): it must be one number, by arithmetic and functions of "
            "math from the dimensions"
        )
    return value


def peaks_of(along: Along, values: SimpleNamespace, count: int) -> FloatArray:
    """Where a function along the crank's rotation has its greatest values, and how they are curved.

    Returns
    -------
    ndarray, shape (count, 1 + n)
        A rotation (rad), the greatest value first and again where there are fewer, and for each of the n values -1/2 over their
        second derivative there, by which the height of a peak follows from a slope; 0 of what has no peak there.
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
            # the top of the parabola through three
            curved = 2.0 * now - before - after
            off = 0.5 * (after - before) / curved
            bends = [*none[:n], 0.5 * step**2 / curved, *none[n + 1 :]]
            found.append((now + 0.25 * off * (after - before), [rotation[k + 1] + off * step, *bends]))
        found += [(row[end], [rotation[end], *none]) for end in (0, -1)]
    places = [place for _, place in sorted(found, reverse=True)[:count]]
    return np.array(places + places[:1] * (count - len(places)))


def _rebound(value: Any, seen: dict[int, Any]) -> Any:
    """What a function of the user's takes from elsewhere, `math` and NumPy replaced by CasADi, his own functions likewise."""
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
            {name: _rebound(x, seen) for name, x in value.__globals__.items() if name in _names(value.__code__)}
        )
        space["__builtins__"] = value.__globals__.get("__builtins__", builtins)
        for cell, old in zip(cells, value.__closure__ or ()):
            cell.cell_contents = _rebound(old.cell_contents, seen)
    return seen[id(value)]


def _names(code: CodeType) -> set[str]:
    """Global names that code, or code within it, may ask for."""
    return {*code.co_names}.union(*(_names(c) for c in code.co_consts if isinstance(c, CodeType)))
