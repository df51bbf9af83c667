"""The plant's functions traced with CasADi: the same code objects, their globals bound to its sin, cos and so on."""

from __future__ import annotations

from functools import cache
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
import pytest

from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import Constants
from tests.strategies import seeded

casadi = pytest.importorskip("casadi")

ELEMENTARY = {name: getattr(casadi, name) for name in ("sin", "cos", "sqrt", "atan2", "tanh")}


def rebound(module: ModuleType, others: dict[str, Any]) -> dict[str, Any]:
    """The module's namespace with its own functions bound to that namespace instead of the module's."""
    space = dict(vars(module)) | {name: f for name, f in (ELEMENTARY | others).items() if name in vars(module)}
    for name, f in vars(module).items():
        if isinstance(f, FunctionType) and f.__module__ == module.__name__:
            space[name] = FunctionType(f.__code__, space, name, f.__defaults__)
    return space


@cache
def symbolic() -> dict[str, Any]:
    """`dynamics`, traced: CasADi functions of state, inputs and constants."""
    plain = rebound(kinematics, {})
    own = {name: f for name, f in plain.items() if isinstance(f, FunctionType)}
    space = rebound(dynamics, own)
    x, u, p = casadi.SX.sym("x", 6), casadi.SX.sym("u", 6), casadi.SX.sym("p", len(Constants._fields))
    state, inputs, constants = (
        tuple(casadi.vertsplit(x)),
        dynamics.Inputs(*casadi.vertsplit(u)),
        Constants(*casadi.vertsplit(p)),
    )
    derivative = casadi.vertcat(*space["derivative"](state, inputs, constants))
    outputs = casadi.vertcat(*space["outputs"](state, inputs, 0.25, constants))
    jumped = casadi.vertcat(*space["jump_speed"](state, u[0], constants))
    return {
        "derivative": casadi.Function("derivative", [x, u, p], [derivative]),
        "outputs": casadi.Function("outputs", [x, u, p], [outputs]),
        "jump": casadi.Function("jump", [x, u, p], [jumped]),
        "jacobian": casadi.Function("jacobian", [x, u, p], [casadi.jacobian(derivative, x)]),
    }


def numbers(function: str, *arguments: Any) -> np.ndarray:
    return np.asarray(symbolic()[function](*(casadi.DM(list(a)) for a in arguments))).squeeze()


@pytest.mark.parametrize("seed", range(25))
def test_traced_functions_have_the_values_of_the_plain_ones(seed: int) -> None:
    case = seeded(seed)
    p = case.parameters.constants()
    for inputs in (case.torque_inputs, case.speed_inputs):
        plain = dynamics.derivative(case.state, inputs, p)
        assert numbers("derivative", case.state, inputs, p) == pytest.approx(plain, rel=1e-11)
        outputs = dynamics.outputs(case.state, inputs, 0.25, p)
        assert numbers("outputs", case.state, inputs, p) == pytest.approx(outputs, rel=1e-11, abs=1e-13)
        jumped = dynamics.jump_speed(case.state, inputs[0], p)
        assert numbers("jump", case.state, inputs, p) == pytest.approx(jumped, rel=1e-11)


@pytest.mark.parametrize("seed", range(10))
def test_jacobian_is_that_of_differences(seed: int) -> None:
    case = seeded(seed)
    p = case.parameters.constants()
    exact = numbers("jacobian", case.state, case.torque_inputs, p)
    differences = np.empty((6, 6))
    for j, scale in enumerate((1e-5, 1e-6, 1e-3, 1e-6, 1.0, 1.0)):
        sides = []
        for sign in (1.0, -1.0):
            x = list(case.state)
            x[j] += sign * scale
            sides.append(np.array(dynamics.derivative(tuple(x), case.torque_inputs, p)))
        differences[:, j] = (sides[0] - sides[1]) / (2.0 * scale)
    size = np.abs(exact).max(axis=1, keepdims=True)
    assert np.all(np.abs(exact - differences) <= 1e-4 * size + 1e-9)


def test_nothing_of_the_plain_modules_is_changed() -> None:
    symbolic()
    assert kinematics.sin.__module__ == dynamics.tanh.__module__ == "math"
    assert dynamics.position is kinematics.position


def test_traced_function_becomes_c_code(tmp_path: Any) -> None:
    generator = casadi.CodeGenerator("five_bar.c")
    generator.add(symbolic()["derivative"])
    generator.generate(f"{tmp_path}/")
    assert "derivative" in (tmp_path / "five_bar.c").read_text(encoding="utf-8")
