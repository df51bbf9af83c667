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
def jacobian() -> Any:
    """CasADi's derivative of the accelerations with respect to the state, of state, inputs and constants."""
    x, u = casadi.SX.sym("x", 6), casadi.SX.sym("u", 6)
    p, k = constants(FIVE_BAR)
    derivative = traced(FIVE_BAR).derivative(tuple(casadi.vertsplit(x)), dynamics.Inputs(*casadi.vertsplit(u)), k)
    return casadi.Function("jacobian", [x, u, p], [casadi.densify(casadi.jacobian(casadi.vertcat(*derivative), x))])


@pytest.mark.parametrize("seed", range(10))
def test_jacobian_is_that_of_differences(seed: int) -> None:
    case = seeded(seed)
    p = case.parameters.constants()
    exact = np.asarray(jacobian()(*(casadi.DM(list(a)) for a in (case.state, case.torque_inputs, p))))
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
