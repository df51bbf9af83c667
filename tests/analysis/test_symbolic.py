"""The plant's functions traced with CasADi: the same code objects, their globals bound to its sin, cos and so on."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from analysis.mechanisms import FIVE_BAR
from analysis.run import constants, traced
from linkwork import friction
from linkwork.five_bar import dynamics, kinematics
from tests.strategies import seeded

casadi = pytest.importorskip("casadi")


@cache
def functions() -> dict[str, Any]:
    """CasADi functions of state, inputs and constants."""
    plant = traced(FIVE_BAR)
    x, u = casadi.SX.sym("x", 6), casadi.SX.sym("u", 6)
    p, k = constants(FIVE_BAR)
    state, inputs = tuple(casadi.vertsplit(x)), dynamics.Inputs(*casadi.vertsplit(u))
    derivative = casadi.vertcat(*plant.derivative(state, inputs, k))
    outputs = casadi.vertcat(*plant.outputs(state, inputs, 0.25, k))
    jumped = casadi.vertcat(*plant.jump_speed(state, u[0], k))
    jacobian = casadi.densify(casadi.jacobian(derivative, x))
    return {
        "derivative": casadi.Function("derivative", [x, u, p], [derivative]),
        "outputs": casadi.Function("outputs", [x, u, p], [outputs]),
        "jump": casadi.Function("jump", [x, u, p], [jumped]),
        "jacobian": casadi.Function("jacobian", [x, u, p], [jacobian]),
    }


def numbers(function: str, *arguments: Any) -> np.ndarray:
    return np.asarray(functions()[function](*(casadi.DM(list(a)) for a in arguments))).squeeze()


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
    traced(FIVE_BAR)
    assert kinematics.sin.__module__ == friction.tanh.__module__ == "math"
    assert dynamics.position is kinematics.position


def test_traced_function_becomes_c_code(tmp_path: Any) -> None:
    generator = casadi.CodeGenerator("five_bar.c")
    generator.add(functions()["derivative"])
    generator.generate(f"{tmp_path}/")
    assert "derivative" in (tmp_path / "five_bar.c").read_text(encoding="utf-8")
