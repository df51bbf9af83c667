"""Elementary functions of vectors of doubles against mpmath, and each lane alone."""

import math
from math import inf, nan, pi
from typing import Any

import mpmath
import numpy as np
import pytest
from numba import int64, types

from analysis.numerics import lanes
from analysis.numerics.codegen import MATRIX, MachineCode, evaluate, kernel
from analysis.numerics.symbolic import ELEMENTARY

casadi = pytest.importorskip("casadi")

pytestmark = pytest.mark.skipif(lanes.width() == 1, reason="the processor has no fused multiplication of vectors")

COUNT = 800


@kernel(types.void(int64, MATRIX, MATRIX, MATRIX), purpose="a test")
def apply(address: Any, a: Any, b: Any, out: Any) -> None:
    """Apply a function of two numbers in lanes, row by row."""
    for i in range(a.shape[0]):
        evaluate(address, 0.0, a[i], b[i], b[i], b[i], out[i])


def values(name: str, *arguments: np.ndarray, width: int = 0) -> np.ndarray:
    """The function of arrays, computed in lanes, as many as the processor has or another number."""
    width = width or lanes.width()
    symbols = [casadi.SX.sym("t"), *(casadi.SX.sym(letter) for letter in "abcd")]
    function = getattr(casadi, name, lambda x, y: x**y)(*symbols[1 : 1 + len(arguments)])
    code = MachineCode([casadi.Function("f", symbols, [function])], width)
    rows = [np.ascontiguousarray(a, float).reshape(-1, width) for a in (arguments[0], arguments[-1])]
    out = np.empty_like(rows[0])
    apply(code.addresses["f"], *rows, out)
    return out.ravel()


def greatest_error(name: str, *arguments: np.ndarray) -> float:
    """Units in the last place."""
    worst = 0.0
    with mpmath.workprec(160):
        for ours, *x in zip(values(name, *arguments).tolist(), *map(np.ndarray.tolist, arguments)):
            exact = getattr(mpmath, name)(*map(mpmath.mpf, x))
            worst = max(worst, float(abs(mpmath.mpf(ours) - exact) / math.ulp(float(exact))))
            assert math.isfinite(ours)
    return worst


def spread(generator: np.random.Generator, low: float, high: float) -> np.ndarray:
    """Numbers of either sign and of all sizes."""
    return np.exp(generator.uniform(math.log(low), math.log(high), COUNT)) * generator.choice([-1.0, 1.0], COUNT)


def arguments_of(name: str) -> list[tuple[np.ndarray, ...]]:
    """Arguments of usual and unusual size, and near those at which a function is small or ill-conditioned."""
    g = np.random.default_rng(3)
    match name:
        case "sin" | "cos" | "tan":
            zeros = [np.round(g.uniform(-turns, turns, COUNT)) * (pi / 2) for turns in (100.0, 1e6, 6e8)]
            beside = [np.nextafter(zero, inf) for zero in zeros]
            return [(x,) for x in (g.uniform(-7.0, 7.0, COUNT), spread(g, 1e-140, 1e9), *zeros, *beside) if x.all()]
        case "asin" | "acos":
            return [(g.uniform(-1.0, 1.0, COUNT),), (spread(g, 1e-140, 1.0),), (1.0 - abs(spread(g, 1e-16, 1.0)),)]
        case "sinh" | "cosh" | "exp":
            return [(g.uniform(-25.0, 25.0, COUNT),), (spread(g, 1e-140, 700.0),)]
        case "log":
            return [(g.uniform(0.4, 2.5, COUNT),), (abs(spread(g, 1e-300, 1e300)),)]
        case "sqrt":
            return [(abs(spread(g, 1e-300, 1e300)),)]
        case "atan2" | "hypot":
            return [(g.normal(size=COUNT), g.normal(size=COUNT)), (spread(g, 1e-70, 1e70), spread(g, 1e-70, 1e70))]
    return [(g.uniform(-3.0, 3.0, COUNT),), (spread(g, 1e-140, 1e140),)]


@pytest.mark.parametrize("name", [name for name in ELEMENTARY if name != "pow"])
def test_functions_err_by_no_more_than_their_bound(name: str) -> None:
    for arguments in arguments_of(name):
        assert greatest_error(name, *arguments) <= lanes.BOUNDS[name]


def test_a_power_is_that_of_the_c_library() -> None:
    g = np.random.default_rng(4)
    x, y = abs(spread(g, 1e-3, 1e3)), g.uniform(-5.0, 5.0, COUNT)
    assert values("pow", x, y).tolist() == list(map(math.pow, x.tolist(), y.tolist()))


@pytest.mark.parametrize("name", [name for name in ELEMENTARY if name not in ("atan2", "hypot", "pow")])
def test_arguments_without_a_straight_line(name: str) -> None:
    """Zeros, infinities, what is no number, angles of astronomical size, one beside the other."""
    x = np.array([0.0, -0.0, inf, -inf, nan, 1e10, -1e300, 0.5])

    def plain(value: float) -> float:
        try:
            return getattr(math, name)(value)
        except OverflowError:
            return math.copysign(inf, value) if name == "sinh" else inf
        except ValueError:
            return -inf if name == "log" and value == 0.0 else nan

    exact = list(map(plain, x.tolist()))
    assert values(name, x) == pytest.approx(exact, rel=1e-15, nan_ok=True)


@pytest.mark.parametrize(("y", "x"), [(0.0, 1.0), (0.0, -1.0), (-1.0, 0.0), (1.0, -0.0), (0.0, 0.0), (inf, 2.0)])
def test_angles_on_the_axes(y: float, x: float) -> None:
    row = np.ones(lanes.width())
    assert values("atan2", y * row, x * row) == pytest.approx(math.atan2(y, x), rel=3e-16)
    assert values("hypot", y * row, x * row).tolist() == [math.hypot(y, x)] * lanes.width()


@pytest.mark.parametrize("name", ELEMENTARY)
def test_a_lane_depends_neither_on_its_neighbours_nor_on_their_number(name: str) -> None:
    g = np.random.default_rng(5)
    arguments = [abs(g.normal(size=8 * lanes.width())) for _ in range(1 + (name in ("atan2", "hypot", "pow")))]
    order = g.permutation(len(arguments[0]))
    once = values(name, *arguments)
    other = g.random(len(order)) < 0.2
    again = values(name, *(np.where(other, 1e12, a[order]) for a in arguments))
    assert np.array_equal(again[~other], once[order][~other], equal_nan=True)
    assert np.array_equal(values(name, *arguments, width=2), once, equal_nan=True)
