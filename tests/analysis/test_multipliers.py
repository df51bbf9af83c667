"""The redundant form: its own consistency, and its motions against those of the reduced form.

That both forms agree at random states of random mechanisms is tested in tests/plant/test_dynamics.py.
"""

from __future__ import annotations

import ast
import inspect

import numpy as np
import pytest
from hypothesis import given, settings

from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests import published
from tests.oracles import multipliers
from tests.oracles.multipliers import (
    FORCE_NAMES,
    RedundantRun,
    SpeedDrive,
    assemble,
    no_inputs,
    rates,
    simulate_redundant,
    solve_multipliers,
)
from tests.published import CM, DYN
from tests.strategies import Case, cases

W = SETS["table-3.1"].crank_speed
several = settings(max_examples=100, derandomize=True, deadline=None)


def solution_of(case: Case, speed: bool) -> multipliers.MultiplierSolution:
    q = assemble(case.parameters, case.state[0], case.state[1])
    i = case.speed_inputs if speed else case.torque_inputs
    return solve_multipliers(
        case.parameters,
        q,
        rates(case.parameters, q, case.state[2], case.state[3]),
        torque=i.torque,
        slider_force=i.force,
        load=(i.load_x, i.load_y),
        crank_acceleration=i.acceleration if speed else None,
    )


def test_check_is_independent_of_what_it_checks() -> None:
    # nothing of the reduced form is used but the constant of the regularised friction, and no derived constants
    tree = ast.parse(inspect.getsource(multipliers))
    imported = {
        (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("linkwork")
        for alias in node.names
    }
    assert imported == {
        ("linkwork.friction", "FRICTION_SPEED"),
        ("linkwork.five_bar.parameters", "FiveBarParameters"),
        ("linkwork.five_bar.parameters", "InitialState"),
    }
    assert not any(isinstance(node, ast.Attribute) and node.attr == "constants" for node in ast.walk(tree))


# ------------------------------------------------------------------ one instant


@pytest.mark.parametrize("speed", [False, True])
@several
@given(case=cases())
def test_newtons_laws_of_the_links_find_the_same_forces(case: Case, speed: bool) -> None:
    solution = solution_of(case, speed)
    assert solution.newton_mismatch < 1e-12
    assert solution.residual < 1e-15
    assert solution.closure < 1e-14
    assert tuple(solution.forces) == FORCE_NAMES
    assert (solution.forces["pin.C.fx"], solution.forces["pin.C.fy"]) == tuple(solution.multipliers[:2])


# ------------------------------------------------------------------ motions


def known_run(**options: object) -> RedundantRun:
    degrees = [0, *published.U_CM_AT_CRANK_DEG]
    arguments = {"rtol": 1e-12, "atol": 1e-13, "speed": SpeedDrive(W)} | options
    return simulate_redundant(TABLE_3_1, InitialState(), no_inputs, np.radians(degrees) / W, **arguments)  # type: ignore[arg-type]


def test_known_motion_of_table_3_1_and_its_drift() -> None:
    run = known_run()
    assert run.q[1:, 3] / CM == pytest.approx(list(published.U_CM_AT_CRANK_DEG.values()), abs=1e-9)
    assert run.q[:, 0] == pytest.approx(W * run.t, rel=1e-13)
    assert 0.0 < run.drift < 1e-11
    assert run.drift == run.closure.max()
    assert run.closure_rate.max() < 1e-9
    assert run.q.shape == run.qd.shape == (5, 4)
    # the force at C at 360 degrees
    n = 1 + list(published.U_CM_AT_CRANK_DEG).index(360)
    solution = solve_multipliers(TABLE_3_1, run.q[n], run.qd[n], crank_acceleration=0.0)
    assert solution.multipliers[:2] / DYN == pytest.approx(published.FORCE_AT_C_AT_360_DEG_DYN, abs=3e-3)


def test_drift_is_the_error_of_the_integration() -> None:
    drifts = [known_run(rtol=rtol, atol=1e-2 * rtol).drift for rtol in (1e-4, 1e-6, 1e-8)]
    assert drifts[0] > 10.0 * drifts[1] > 100.0 * drifts[2]
