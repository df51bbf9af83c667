"""The redundant form: its own consistency, and its motions against those of the reduced form.

That both forms agree at random states of random mechanisms is tested in tests/plant/test_dynamics.py.
"""

from __future__ import annotations

import ast
import inspect
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.integrate import solve_ivp

from analysis.run import Hamming
from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests import published
from tests.oracles import multipliers
from tests.oracles.multipliers import (
    FORCE_NAMES,
    RedundantRun,
    SpeedDrive,
    assemble,
    mass_matrix,
    no_inputs,
    rates,
    simulate_redundant,
    solve_multipliers,
)
from tests.published import CM, DYN, DYN_CM
from tests.strategies import Case, cases, seeded

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


@several
@given(case=cases())
def test_assembled_loop_is_closed_on_its_branch(case: Case) -> None:
    par = case.parameters
    q = assemble(par, case.state[0], case.state[1])
    th2, th3, th4, u = q
    loop = par.crank_length * np.exp(1j * th2) + par.coupler_length * np.exp(1j * th3)
    loop -= par.rocker_length * np.exp(1j * th4) + par.ground_length + u * np.exp(1j * par.slider_guide_angle)
    assert abs(loop) < 1e-14 * (par.ground_length + par.coupler_length + par.rocker_length)
    assert np.sin(th4 - th3) * par.assembly_branch > 0.0
    assert (th2, u) == case.state[:2]


@several
@given(case=cases())
def test_accelerations_keep_the_loop_closed(case: Case) -> None:
    # (2.1) differentiated twice, written out
    par = case.parameters
    q = assemble(par, case.state[0], case.state[1])
    qd = rates(par, q, case.state[2], case.state[3])
    arms = np.array([par.crank_length, par.coupler_length, -par.rocker_length]) * np.exp(1j * q[:3])
    guide = np.exp(1j * par.slider_guide_angle)
    rate = (1j * arms * qd[:3]).sum() - guide * qd[3]
    assert abs(rate) <= 1e-13 * np.abs(arms * qd[:3]).max()
    qdd = solution_of(case, speed=False).accelerations
    terms = np.concatenate([1j * arms * qdd[:3], -arms * qd[:3] ** 2, [-guide * qdd[3]]])
    assert abs(terms.sum()) <= 1e-12 * np.abs(terms).max()


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


@several
@given(case=cases())
def test_prescribed_speed_and_its_torque_are_two_sides_of_one_motion(case: Case) -> None:
    # the torque that holds the acceleration, given as a torque, makes that acceleration
    driven = solution_of(case, speed=True)
    assert driven.multipliers.shape == (3,)
    assert driven.torque == driven.multipliers[2]
    assert driven.accelerations[0] == pytest.approx(case.speed_inputs.acceleration, rel=1e-13)
    i = case.speed_inputs
    q = assemble(case.parameters, case.state[0], case.state[1])
    free = solve_multipliers(
        case.parameters,
        q,
        rates(case.parameters, q, case.state[2], case.state[3]),
        torque=driven.torque,
        slider_force=i.force,
        load=(i.load_x, i.load_y),
    )
    scale = np.abs(driven.accelerations).max()
    assert free.accelerations == pytest.approx(driven.accelerations, abs=1e-9 * scale)
    assert free.multipliers.shape == (2,)
    assert free.torque == driven.torque


@several
@given(case=cases())
def test_mass_matrix_is_symmetric_and_positive_definite(case: Case) -> None:
    m = mass_matrix(case.parameters, assemble(case.parameters, case.state[0], case.state[1]))
    assert m == pytest.approx(m.T, rel=0.0, abs=1e-15 * np.abs(m).max())
    assert np.linalg.eigvalsh(m).min() > 0.0


def test_mass_matrix_of_links_with_their_masses_at_the_pins() -> None:
    # the coupler's mass at B, the rocker's at D: no coupling is left between the angles
    par = replace(TABLE_3_1, coupler_cog_distance=0.0, rocker_cog_distance=0.0)
    m = mass_matrix(par, assemble(par, 0.7, 0.01))
    expected = (
        par.crank_inertia + par.coupler_mass * par.crank_length**2,
        par.coupler_inertia,
        par.rocker_inertia,
        par.rocker_mass + par.slider_mass,
    )
    assert m == pytest.approx(np.diag(expected), rel=1e-14, abs=1e-18)


def test_massless_coupler() -> None:
    # chapters IV and V: a zero on the diagonal of the mass matrix is no obstacle
    par = replace(TABLE_3_1, coupler_mass=0.0, coupler_inertia=0.0)
    q = assemble(par, 0.4, -0.002)
    solution = solve_multipliers(par, q, rates(par, q, W, 0.1), crank_acceleration=0.0)
    # a link without mass and load carries force along itself alone
    force = complex(solution.forces["pin.C.fx"], solution.forces["pin.C.fy"])
    assert (force * np.exp(-1j * q[1])).imag == pytest.approx(0.0, abs=1e-13 * abs(force))
    assert complex(solution.forces["pin.B.fx"], solution.forces["pin.B.fy"]) == pytest.approx(-force, rel=1e-13)


def test_known_torque_at_the_start_of_table_3_1() -> None:
    q = assemble(TABLE_3_1, 0.0, 0.0)
    solution = solve_multipliers(TABLE_3_1, q, rates(TABLE_3_1, q, W, 0.0), crank_acceleration=0.0)
    assert solution.torque / DYN_CM == pytest.approx(published.CRANK_TORQUE_AT_START_DYN_CM, rel=5e-10)


def test_static_equilibrium_of_a_hanging_rocker() -> None:
    # at rest and held, the ground carries the weights: pin A and the guide together, vertically
    q = assemble(TABLE_3_1, radians(30.0), 0.0)
    hold = TABLE_3_1.slider_stiffness * 0.0
    solution = solve_multipliers(TABLE_3_1, q, np.zeros(4), slider_force=hold, crank_acceleration=0.0)
    total = TABLE_3_1.coupler_mass + TABLE_3_1.rocker_mass + TABLE_3_1.slider_mass
    jacobian = (
        np.diff(  # vertical accelerations of the three centres of mass, by moving the mechanism a little
            [_heights(q + s * 1e-5 * solution.accelerations) for s in (-1.0, 1.0)], axis=0
        ).ravel()
        / 2e-5
    )
    masses = np.array([TABLE_3_1.coupler_mass, TABLE_3_1.rocker_mass])
    expected = total * TABLE_3_1.gravity + masses @ jacobian
    assert solution.forces["pin.A.fy"] + solution.forces["slider.guide_force"] == pytest.approx(expected, rel=1e-7)


def _heights(q: np.ndarray) -> list[float]:
    """Heights of the centres of mass of coupler and rocker of Table 3.1."""
    par = TABLE_3_1
    return [
        par.crank_length * np.sin(q[0]) + par.coupler_cog_distance * np.sin(q[1]),
        par.rocker_cog_distance * np.sin(q[2]),
    ]


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no extended precision on this machine")
def test_refinement_recovers_the_digits_of_an_ill_conditioned_system() -> None:
    # Hilbert's matrix times the common denominator, condition 1.5e7: matrix and right-hand side are whole numbers
    denominators = np.add.outer(np.arange(1, 7), np.arange(6))
    hilbert = 27720.0 / denominators
    assert (hilbert == np.round(hilbert)).all()
    exact = np.arange(1.0, 7.0)
    refined, residual, refinements = multipliers._refined_solve(hilbert, hilbert @ exact)
    plain = np.linalg.solve(hilbert, hilbert @ exact)
    assert refinements >= 1
    assert residual < 1e-18
    assert np.abs(plain - exact).max() > 1e-11
    assert np.abs(refined - exact).max() < 2e-12


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


def test_thesis_method_gives_the_known_motion() -> None:
    run = known_run(method=Hamming, rtol=1e-8, atol=1e-9)
    assert run.q[1:, 3] / CM == pytest.approx(list(published.U_CM_AT_CRANK_DEG.values()), abs=2e-4)
    assert run.drift < 1e-5


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("speed", [False, True])
def test_motions_of_both_forms_are_the_same(seed: int, speed: bool) -> None:
    case = seeded(seed)
    p = case.parameters.constants()
    t = np.linspace(0.0, 4e-3, 5)
    w0 = case.state[2]

    def torque_inputs(t: float) -> dynamics.Inputs:
        i = case.torque_inputs
        return i._replace(
            torque=i.torque * np.cos(300.0 * t), force=i.force * (1.0 - 50.0 * t), load_x=20.0 * np.sin(500.0 * t)
        )

    def speed_inputs(t: float) -> dynamics.Inputs:
        return case.speed_inputs._replace(acceleration=case.speed_inputs.acceleration * np.cos(400.0 * t))

    at = speed_inputs if speed else torque_inputs
    run = simulate_redundant(
        case.parameters,
        case.initial,
        lambda t, q, qd: (at(t).torque, at(t).force, at(t).load_x, at(t).load_y),
        t,
        rtol=1e-11,
        atol=1e-12,
        speed=SpeedDrive(w0, lambda t: speed_inputs(t).acceleration) if speed else None,
    )
    reduced = solve_ivp(
        lambda t, x: dynamics.derivative(tuple(x.tolist()), at(t), p),
        (0.0, t[-1]),
        case.state,
        method="DOP853",
        t_eval=t,
        rtol=1e-11,
        atol=1e-12,
    ).y
    q, qd = run.q[:, [0, 3]].T, run.qd[:, [0, 3]].T
    assert q == pytest.approx(reduced[:2], abs=1e-8)
    assert qd == pytest.approx(reduced[2:4], rel=1e-7, abs=1e-6)
    assert run.drift < 1e-9


def test_torque_law_of_fig_3_6_up_to_one_radian() -> None:
    t0 = published.TORQUE_T0_DYN_CM * DYN_CM
    end = published.TORQUE_END_TIME_S
    run = simulate_redundant(
        TABLE_3_1, InitialState(), lambda t, q, qd: (t0 * (1.0 - q[0]), 0.0, 0.0, 0.0), [0.0, end], rtol=1e-12
    )
    assert run.q[-1, 0] == pytest.approx(1.0, abs=1e-9)
