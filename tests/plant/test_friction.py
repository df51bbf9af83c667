"""Friction in guide and pins of the five-bar: against multipliers, textbook cases, energy, the limit of jamming."""

import random
from dataclasses import fields, replace
from math import hypot, pi, sqrt, tanh

import numpy as np
import pytest

from linkwork.errors import JammingError
from linkwork.five_bar import MECHANISM as FIVE_BAR
from linkwork.five_bar import dynamics as D
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.friction import FRICTION_FORCE, FRICTION_RATE, FRICTION_SPEED
from linkwork.plant import Plant
from tests.oracles.differences import along
from tests.oracles.five_bar import FORCE_NAMES, solve
from tests.strategies import FRICTION, PINS, rough, seeded

both_drives = pytest.mark.parametrize("drive", ["torque", "speed"])


def forces(o: D.Outputs) -> tuple[float, ...]:
    return tuple(getattr(o, name.replace(".", "_")) for name in FORCE_NAMES)


# ------------------------------------------------------------------ the other formulation


@both_drives
@pytest.mark.parametrize("only", [(), *((name,) for name in FRICTION)], ids=["all", "guide", *"ABCD"])
@pytest.mark.parametrize("seed", range(12))
def test_joint_forces_by_multipliers_agree(seed: int, only: tuple[str, ...], drive: str) -> None:
    case = rough(seed, drive, *only)
    x, i, par = case.state, case.inputs(drive), case.parameters
    o, dx = D.outputs(x, i, 0.0, case.p), D.derivative(x, i, case.p)
    known = solve(par, x, i)
    size = np.abs(known.accelerations[:3]).max()
    assert o.crank_acceleration == pytest.approx(known.accelerations[0], abs=1e-9 * size)
    assert o.slider_acceleration == pytest.approx(known.accelerations[3], abs=1e-9 * size * par.crank_length)
    largest = max(map(abs, known.forces.values()))
    assert forces(o) == pytest.approx(tuple(known.forces.values()), abs=1e-9 * largest)
    assert o.drive_applied_torque == pytest.approx(known.torque, abs=1e-9 * largest * par.crank_length)
    viscous = par.slider_damping * x[3] ** 2 + par.slider_coulomb_friction * x[3] * tanh(x[3] / FRICTION_SPEED)
    assert dx[4] == pytest.approx(known.lost + viscous, rel=1e-9)
    # it is not the motion without friction
    smooth = D.outputs(x, i, 0.0, seeded(seed).p)
    without = pytest.approx((*forces(smooth), smooth.drive_applied_torque), abs=1e-9 * largest * par.crank_length)
    assert (*forces(o), o.drive_applied_torque) != without


@both_drives
@pytest.mark.parametrize("seed", range(10))
def test_energy_balance(seed: int, drive: str) -> None:
    case = rough(seed, drive)
    x, i, p = case.state, case.inputs(drive), case.p
    dx, o = D.derivative(x, i, p), D.outputs(x, i, 0.0, p)
    speed = max(abs(x[2]), abs(o.crank_acceleration) ** 0.5, abs(o.slider_acceleration / p.l2) ** 0.5, 1.0)
    (change,) = along(lambda y: (D.energy(y, p),), x, dx, 1e-4 / speed)
    assert change == pytest.approx(dx[5] - dx[4], abs=1e-6 * max(abs(dx[4]), abs(dx[5])))
    assert dx[4] > D.derivative(x, i, seeded(seed).p)[4] >= 0.0


@both_drives
@pytest.mark.parametrize("seed", range(10))
def test_equations_with_friction_go_over_into_those_without(seed: int, drive: str) -> None:
    case = seeded(seed)
    switched = case.p._replace(rough=1.0)
    for of in (D.derivative, lambda x, i, p: D.outputs(x, i, 0.0, p), lambda x, i, p: (D.clearance(x, i, p),)):
        found = of(case.state, case.inputs(drive), switched)
        known = of(case.state, case.inputs(drive), case.p)
        assert found == pytest.approx(known, rel=1e-12)


# ------------------------------------------------------------------ textbook cases

#: A crank that is all that moves, and a slider on which links without mass hang.
_NONE = dict.fromkeys(("coupler_mass", "rocker_mass", "coupler_inertia", "rocker_inertia", "slider_damping"), 0.0)
BARE = replace(TABLE_3_1, **_NONE)
FREE = D.Inputs(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("velocity", [0.2, -0.2])
def test_slider_on_its_guide_is_braked_by_its_weight(velocity: float) -> None:
    par = replace(BARE, slider_stiffness=0.0, slider_friction_coefficient=0.3)
    dx = D.derivative((0.4, 0.0, 0.0, velocity, 0.0, 0.0), FREE, par.constants())
    assert dx[3] == pytest.approx(
        -0.3 * par.gravity * np.sign(velocity), rel=1e-5
    )  # the roundness about zero force: 2e-6
    assert dx[4] == pytest.approx(0.3 * par.slider_mass * par.gravity * 0.2, rel=1e-5)


def test_slider_goes_down_an_inclined_guide_with_the_text_books_acceleration() -> None:
    slope = 0.6
    par = replace(BARE, slider_guide_angle=slope, slider_stiffness=0.0, slider_friction_coefficient=0.2)
    dx = D.derivative((0.4, 0.0, 0.0, -0.2, 0.0, 0.0), FREE, par.constants())
    assert dx[3] == pytest.approx(par.gravity * (-np.sin(slope) + 0.2 * np.cos(slope)), rel=1e-5)


def test_crank_in_its_bearing_is_braked_by_its_weight() -> None:
    par = replace(BARE, crank_mass=2.0, slider_mass=1e-9, slider_stiffness=0.0, pin_A_friction_radius=1e-3)
    turning = (0.4, 0.0, 30.0, 0.0, 0.0, 0.0)
    weight = hypot(2.0 * par.gravity, FRICTION_FORCE)
    acceleration = D.derivative(turning, FREE, par.constants())[2]
    assert acceleration == pytest.approx(-1e-3 * weight / par.crank_inertia, rel=1e-6)
    held = D.outputs(turning, FREE._replace(speed_drive=1.0), 0.0, par.constants())
    assert held.drive_applied_torque == pytest.approx(1e-3 * weight, rel=1e-6)


def test_friction_is_smooth_about_rest() -> None:
    par = replace(TABLE_3_1, slider_damping=0.0, slider_friction_coefficient=0.1, pin_D_friction_radius=1e-3)

    def lost(share: float) -> float:
        x = (0.4, 0.0, 0.0, share * FRICTION_SPEED, 0.0, 0.0)
        o, dx = D.outputs(x, FREE, 0.0, par.constants()), D.derivative(x, FREE, par.constants())
        w4 = D.motion(*_configuration(x, par), x, FREE, par.constants()).w4
        pin = 1e-3 * sqrt(o.pin_D_fx**2 + o.pin_D_fy**2 + FRICTION_FORCE**2) * tanh(w4 / FRICTION_RATE) * w4
        guide = 0.1 * hypot(o.slider_guide_force, FRICTION_FORCE) * tanh(share) * x[3]
        assert dx[4] == pytest.approx(pin + guide, rel=1e-9)
        return dx[4]

    assert lost(0.0) == 0.0
    assert lost(1e-3) == pytest.approx(1e-2 * lost(1e-2), rel=1e-3)  # viscous there: its power goes with the square
    assert lost(-1e-2) == pytest.approx(lost(1e-2), rel=1e-3)


def _configuration(x: D.State, par: FiveBarParameters) -> tuple[D.Position, D.Coefficients]:
    g = D.position(x[0], x[1], par.constants())
    return g, D.coefficients(g, par.constants())


# ------------------------------------------------------------------ motions, and where friction jams

SPEED = 300.0 * pi / 30.0


def started(par: FiveBarParameters) -> Plant:
    return Plant(FIVE_BAR, par, InitialState(), inputs={"drive.speed": SPEED}, drive_mode=1)


def test_energy_account_of_a_run() -> None:
    par = replace(SETS["rig-1-spring-a"].parameters, slider_friction_coefficient=0.2, **dict.fromkeys(PINS, 5e-4))
    ends = []
    for one in (par, replace(par, **dict.fromkeys(FRICTION, 0.0))):
        plant = started(one)
        for n in range(100):
            plant.step(0.002 * n, 0.002)
        o = plant.outputs()
        assert abs(o.energy_residual) < 1e-7 * o.energy_dissipated
        ends.append(o)
    with_friction, without = ends
    assert with_friction.energy_supplied > without.energy_supplied > 0.0


def test_friction_that_would_jam_the_links_is_refused() -> None:
    par = replace(TABLE_3_1, slider_friction_coefficient=4.0)
    plant = Plant(FIVE_BAR, par, InitialState(crank_angle=4.9), inputs={"drive.speed": SPEED}, drive_mode=1)

    def go() -> None:
        for n in range(20):
            plant.step(0.001 * n, 0.001)

    with pytest.raises(JammingError, match="friction so strong that it may jam the links at crank angle"):
        go()
    # the last good state stays, and what is asked of it is right
    before = plant.outputs()
    known = solve(par, plant.state, D.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert forces(before) == pytest.approx(tuple(known.forces.values()), rel=1e-7)
    initial = InitialState(crank_angle=plant.state[0], slider_velocity=plant.state[3])
    with pytest.raises(JammingError):
        Plant(
            FIVE_BAR,
            replace(par, slider_friction_coefficient=9.0),
            initial,
            inputs={"drive.speed": SPEED},
            drive_mode=1,
        )
    # a mass matrix that is singular to rounding has no clearance at all
    with pytest.raises(JammingError):
        Plant(FIVE_BAR, replace(par, rocker_cog_distance=1e11), InitialState())


@both_drives
@pytest.mark.parametrize("seed", range(40))
def test_up_to_its_limit_friction_is_solved_for(seed: int, drive: str) -> None:
    # at the most response that is followed, and with forces without friction that nearly vanish
    case, rng = rough(seed, drive), random.Random(seed)
    x, i = case.state, case.inputs(drive)

    def at(factor: float) -> FiveBarParameters:
        return replace(case.parameters, **{name: factor * getattr(case.parameters, name) for name in FRICTION})

    low, high = 1.0, 1.0
    while D.clearance(x, i, at(high).constants()) > 0.0 and high < 1e6:
        high *= 2.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if D.clearance(x, i, at(middle).constants()) > 0.0 else (low, middle)
    p = at(low).constants()
    g, k = _configuration(x, at(low))
    units = D.unit_friction(g, k, D.inertia(g, k, p), x[2], x[3], i.speed_drive, p)
    response = tuple(D.contacts(unit.response) for unit in units)
    smooth = (*((rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0)) for _ in range(4)), (1e-3 * rng.gauss(0.0, 1.0), 0.0))
    sizes = D.contact_forces(smooth, response)
    for j, (fx, fy) in enumerate(smooth):
        fx += sum(r[j][0] * s for r, s in zip(response, sizes))
        fy += sum(r[j][1] * s for r, s in zip(response, sizes))
        assert sizes[j] == pytest.approx(sqrt(fx * fx + fy * fy + FRICTION_FORCE**2), rel=1e-9)


def test_friction_is_what_the_switch_is_for() -> None:
    for name in (field.name for field in fields(FiveBarParameters) if "friction" in field.name):
        p = replace(TABLE_3_1, **{name: 0.01}).constants()
        assert FIVE_BAR.is_switched_on(p) == (name in FRICTION)
    assert not FIVE_BAR.is_switched_on(TABLE_3_1.constants())
