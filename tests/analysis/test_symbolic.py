"""The plant's functions traced with CasADi: the same code objects, their globals bound to its sin, cos and so on."""

import cmath
import math
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from analysis.mechanisms import FIVE_BAR, find_mechanism
from analysis.numerics.symbolic import ELEMENTARY, symbolic_functions
from analysis.numerics.tracing import rebind_functions
from analysis.run import symbolic_equations
from linkwork import friction
from linkwork.five_bar import dynamics, kinematics
from tests import slider_cranks, strategies

casadi = pytest.importorskip("casadi")


def atan2(y: complex, x: complex) -> complex:
    """As cmath has none: for parts beside the real axis so small that their squares vanish."""
    slope = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return complex(math.atan2(y.real, x.real), slope)


#: The functions of `ELEMENTARY` that the equations use, on the complex plane.
COMPLEX = {
    **{name: getattr(cmath, name) for name in ELEMENTARY if hasattr(cmath, name)},
    "atan2": atan2,
    "fabs": lambda z: z if z.real >= 0.0 else -z,
    "hypot": lambda a, b: cmath.sqrt(a * a + b * b),
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", [strategies, slider_cranks], ids=["five-bar", "slider-crank"])
def test_derivatives_are_exact(kind: Any, seed: int) -> None:
    """Against a complex step of 1e-30, which subtracts nothing: the same functions by another differentiation."""
    case = kind.seeded(seed)
    mechanism, p = find_mechanism(case.parameters), case.parameters.constants()
    x = np.array(case.state, float)
    u = np.random.default_rng(seed).normal(size=len(mechanism.channels))
    flags = (0.0,) * len(mechanism.modes)
    state = casadi.SX.sym("x", len(x))
    ours = symbolic_equations(mechanism)
    applied = mechanism.equations.apply_inputs(flags, tuple(u), p)
    derivative = ours.find(mechanism.equations.derivative)
    of_state = casadi.vertcat(*derivative(tuple(casadi.vertsplit(state)), applied, p))
    exact = np.array(casadi.Function("jacobian", [state], [casadi.densify(casadi.jacobian(of_state, state))])(x))
    derivative = rebind_functions(mechanism.modules, COMPLEX).find(mechanism.equations.derivative)
    stepped = np.empty((len(x), len(x)))
    for j in range(len(x)):
        shifted = x.astype(complex)
        shifted[j] += 1e-30j
        at = derivative(tuple(shifted.tolist()), mechanism.equations.apply_inputs(flags, tuple(u.tolist()), p), p)
        stepped[:, j] = np.array([complex(value).imag for value in at]) / 1e-30
    size = np.abs(exact).max(axis=1, keepdims=True)
    assert size.max() > 1.0
    assert np.all(np.abs(exact - stepped) <= 1e-11 * size)


def test_nothing_of_the_plain_modules_is_changed() -> None:
    symbolic_equations(FIVE_BAR)
    assert kinematics.sin.__module__ == friction.tanh.__module__ == "math"
    assert dynamics.position is kinematics.position


@pytest.mark.parametrize("written", [True, False])
@pytest.mark.parametrize(
    ("exponent", "slopes"), [(1.0, [0, 1, 0, 0]), (2.0, [0, 0, 2, 0]), (3.0, [0, 0, 0, 6]), (3.5, [0, 0, 0, 0])]
)
def test_powers_have_their_derivatives_at_zero(exponent: float, slopes: list[float], written: bool) -> None:
    """With the exponent as a number in the formula, and as a constant."""
    module = ModuleType("law")
    exec(f"from math import pow\ndef force(x, n):\n    return pow(x, {exponent if written else 'n'})", module.__dict__)
    x, n = casadi.SX.sym("x"), casadi.SX.sym("n")
    found = [symbolic_functions((module,)).find(module.force)(x, n)]
    for _ in range(3):
        found.append(casadi.jacobian(found[-1], x))
    assert [float(value) for value in casadi.Function("slopes", [x, n], found)(0.0, exponent)] == slopes
