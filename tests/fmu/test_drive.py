"""What the drives mean: commanded speeds over a step and their jumps, torque and forces, the groove, the energy balance.

What is expected of the slider-crank follows from the pins' positions that the FMU itself gives and from the thesis's data:
the rod as one rigid body, its angular velocity from the velocities of its ends. The five-bar's inertia is the program's.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from linkwork.five_bar.dynamics import inertia
from linkwork.five_bar.kinematics import coefficients, position
from linkwork.five_bar.published import TABLE_3_1
from tests.published_rahman import CRANK_IN, CRANK_RADIUS_IN, INCH, MASSES_LB_S2_IN, POUND_FORCE, ROD_IN, ROD_RADIUS_IN

from .models import MODES, each
from .runner import run_in_process

Array = NDArray[np.float64]
Outputs = dict[str, float]

CONSTANTS = TABLE_3_1.constants()

#: A slider-crank with everything that stores, loses and moves energy.
GENERAL = {
    "guide.twist": 4.4,
    "crank.cog_y": 0.03,
    "rod.cog_distance": 0.5,
    "initial.crank_speed": 9.0,
    "slider.stiffness": 150.0,
    "slider.spring_free_position": 1.0,
    "slider.damping": 5.0,
    "slider.coulomb_friction": 2.0,
    "shift.stiffness": 400.0,
    "shift.damping": 10.0,
    "groove.amplitude": 0.08,
    "groove.ratio": 2.0,
    "gravity.y": -9.81,
    "gravity.z": 3.0,
}

CRANK, ROD = CRANK_IN * INCH, ROD_IN * INCH
M1, M2, M3 = (mass * POUND_FORCE / INCH for mass in MASSES_LB_S2_IN)
#: The crank about its axis, the rod transverse about its middle (kg.m2).
CRANK_INERTIA = M1 * (CRANK_RADIUS_IN**2 / 4 + CRANK_IN**2 / 3) * INCH**2
ROD_INERTIA = M2 * (ROD_RADIUS_IN**2 / 4 + ROD_IN**2 / 12) * INCH**2

#: A twist that leaves nothing square; the groove's law is read in axial.mode 2 alone.
TWIST, AMPLITUDE, RATIO = 4.4, 0.07, 2.0
MECHANISM = {
    "guide.twist": TWIST,
    "groove.amplitude": AMPLITUDE,
    "groove.ratio": RATIO,
    "initial.crank_speed": 9.0,
    "initial.shift_velocity": -0.3,
    "drive.speed": 9.0,
    "axial.speed": -0.3,
}


def vector(outputs: Outputs, name: str) -> Array:
    return np.array([outputs[name + axis] for axis in "xyz"])


def rates(outputs: Outputs) -> Array:
    """Velocity coefficients of the slider (m/rad, m/m): the rod's ends have the same velocity along the rod."""
    rod = vector(outputs, "slider_pin.") - vector(outputs, "crank_pin.")
    guide = np.array([0.0, -sin(TWIST), -cos(TWIST)])
    theta = outputs["crank.angle"]
    turning = np.array([-CRANK * sin(theta), CRANK * cos(theta), 0.0])
    return np.array([turning @ rod, rod[2]]) / (guide @ rod)


def slider_crank_masses(outputs: Outputs) -> Array:
    """Inertia matrix of the two freedoms at the configuration of some outputs."""
    crank_pin, slider_pin = vector(outputs, "crank_pin."), vector(outputs, "slider_pin.")
    guide = np.array([0.0, -sin(TWIST), -cos(TWIST)])
    theta = outputs["crank.angle"]
    v2 = np.array([[-CRANK * sin(theta), CRANK * cos(theta), 0.0], [0.0, 0.0, 1.0]])
    v3 = np.outer(rates(outputs), guide)
    middle = 0.5 * (v2 + v3)
    turn = np.cross(slider_pin - crank_pin, v3 - v2) / ROD**2
    moving: Array = M2 * middle @ middle.T + ROD_INERTIA * turn @ turn.T + M3 * v3 @ v3.T
    return np.diag([CRANK_INERTIA, M1]) + moving


def pitch(outputs: Outputs) -> float:
    """dS1/dtheta1 of the groove."""
    return AMPLITUDE * RATIO * cos(RATIO * outputs["crank.angle"])


def five_bar_masses(outputs: Outputs) -> Array:
    g = position(outputs["crank.angle"], outputs["slider.position"], CONSTANTS)
    m11, m12, m22 = inertia(g, coefficients(g, CONSTANTS), CONSTANTS)
    return np.array([[m11, m12], [m12, m22]])


class Mechanics(NamedTuple):
    """What the tests of all drives take of a mechanism."""

    #: Values at the start, number and size of the steps up to a jump, and the jumps to make.
    values: Outputs
    steps: int
    size: float
    commands: list[Outputs]
    #: Inputs to change one by one, the second freedom, and the input that is its force.
    changes: Outputs
    freedom: str
    force: str
    masses: Callable[[Outputs], Array]
    #: Coupling (kg.m) that there has to be for a test.
    coupling: float
    #: Outputs that a jump leaves as they are.
    same: tuple[str, ...]


SAME = ("crank.angle", "slider.position", "energy.potential", "energy.dissipated")
MECHANICS = {
    "FiveBarSlider": Mechanics(
        {"drive.acceleration": 5.0},
        37,
        1e-3,
        [{"drive.speed": speed} for speed in (60.0, 5.0, -30.0)],
        {"drive.torque": 0.7, "drive.acceleration": 25.0, "slider.force": 3.0},
        "slider",
        "slider.force",
        five_bar_masses,
        1e-3,
        (*SAME, "coupler.point.x"),
    ),
    "SliderCrank": Mechanics(
        MECHANISM | {"slider.damping": 4.0, "gravity.y": -9.81},
        7,
        1e-2,
        [
            {"drive.speed": 14.0},
            {"drive.speed": -4.0},
            {"axial.speed": 0.5},
            {"axial.speed": -1.1},
            {"drive.speed": 2.0, "axial.speed": 0.4},
        ],
        {
            "drive.torque": 7.0,
            "drive.acceleration": 25.0,
            "axial.force": 11.0,
            "axial.acceleration": -6.0,
            "slider.load": 9.0,
        },
        "shift",
        "axial.force",
        slider_crank_masses,
        0.05,
        (*SAME, "shift.position"),
    ),
}


def follow(fmu: str, folder: str, name: str, lines: list[list[float]]) -> list[Any]:
    """Steps with a speed and an acceleration commanded; they are set again only before the third step."""
    from bare_master import Fmu

    acceleration = name.replace("speed", "acceleration")
    instance = Fmu(fmu, folder).instantiate().start({name: lines[0][0], acceleration: lines[0][1]})
    rows = [instance.outputs()]
    for k, size in enumerate((0.01, 0.02, 0.01)):
        if k == 2:
            instance.set(name, lines[1][0])
            instance.set(acceleration, lines[1][1])
            rows.append(instance.outputs())
        assert instance.step(sum((0.01, 0.02)[:k]), size) == 0
        rows.append(instance.outputs())
    return rows


#: A commanded speed, its values and accelerations in turn, and what it is the rate of.
TURNING = ("drive.speed", [[40.0, 100.0], [42.0, -50.0]], "crank.angle", "crank.speed")
SHIFTING = ("axial.speed", [[0.4, -2.0], [-0.6, 5.0]], "shift.position", "shift.velocity")
LINES = {"FiveBarSlider": {"crank": TURNING}, "SliderCrank": {"crank": TURNING, "shift": SHIFTING}}


@each(LINES, "name", "lines", "place", "rate")
def test_speed_over_a_step_is_the_commanded_line(
    fmu: Path, tmp_path: Path, name: str, lines: list[list[float]], place: str, rate: str
) -> None:
    start, first, second, commanded, third = run_in_process(follow, fmu, tmp_path, name, lines)
    change = rate.replace("speed", "acceleration").replace("velocity", "acceleration")
    (v, a), (new_v, new_a) = lines
    assert start[place] == pytest.approx(3.5 * INCH if name == "axial.speed" else 0.0, rel=1e-15)
    assert start[rate] == v
    assert start[change] == a
    assert first[rate] == pytest.approx(v + a * 0.01, rel=1e-14)
    assert first[place] - start[place] == pytest.approx(v * 0.01 + 0.5 * a * 0.01**2, rel=1e-13)
    # not given again: the next step starts from the same commanded speed
    assert second[rate] == pytest.approx(v + a * 0.02, rel=1e-14)
    assert second[place] - first[place] == pytest.approx(v * 0.02 + 0.5 * a * 0.02**2, rel=1e-13)
    # given anew it holds at once, and the acceleration with it
    assert commanded[rate] == new_v
    assert commanded[change] == new_a
    assert commanded[place] == second[place]
    assert third[rate] == pytest.approx(new_v + new_a * 0.01, rel=1e-14)


def jumps(
    fmu: str, folder: str, values: dict[str, float], commands: list[dict[str, float]], steps: int, size: float
) -> list[list[Any]]:
    """Outputs before and after each jump of commanded speeds, after a short step on from it, and later."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    found = []
    for command in commands:
        instance = fmu.instantiate().start(values)
        instance.run([size] * steps)
        before = instance.outputs()
        for name, value in command.items():
            instance.set(name, value)
        rows = [before, instance.outputs()]
        assert instance.step(steps * size, 1e-6) == 0
        rows.append(instance.outputs())
        instance.run([size] * 5, steps * size + 1e-6)
        found.append([*rows, instance.outputs()])
        instance.free()
    return found


@each(MODES, "modes")
def test_jumps_of_commanded_speeds(fmu: Path, tmp_path: Path, modes: dict[str, int]) -> None:
    mechanics = MECHANICS[fmu.stem]
    turned, axial = modes["drive.mode"] == 1, modes.get("axial.mode", 0)
    rate = f"{mechanics.freedom}.velocity"
    runs = run_in_process(
        jumps, fmu, tmp_path, mechanics.values | modes, mechanics.commands, mechanics.steps, mechanics.size
    )
    for command, (before, at, after, later) in zip(mechanics.commands, runs):
        jumped = turned * ("drive.speed" in command) or (axial == 1 and "axial.speed" in command)
        if not jumped:
            # what commands nothing changes nothing
            assert at == before
            continue
        w, v = before["crank.speed"], before[rate]
        m = mechanics.masses(before)
        assert abs(m[0, 1]) > mechanics.coupling, "no coupling here: nothing would be tested"
        new = np.array([at["crank.speed"], at[rate]])
        momentum, momentum_before = m @ new, m @ [w, v]
        if turned:
            assert new[0] == command.get("drive.speed", w)
        else:
            assert momentum[0] == pytest.approx(momentum_before[0], rel=1e-12)
            assert abs(new[0] - w) > 1e-3
        if axial == 1:
            assert new[1] == command.get("axial.speed", v)
        elif axial == 2:
            assert new[1] == pytest.approx(pitch(at) * new[0], rel=1e-14)
        else:
            assert momentum[1] == pytest.approx(momentum_before[1], rel=1e-12)
            assert abs(new[1] - v) > 1e-3
        if mechanics.freedom == "shift":
            assert at["slider.velocity"] == pytest.approx(rates(at) @ new, rel=1e-11)
        for same in mechanics.same:
            assert at[same] == before[same]
        # the impulse did the work that the kinetic energy shows
        assert at["energy.kinetic"] == pytest.approx(0.5 * new @ m @ new, rel=1e-11)
        gain = at["energy.kinetic"] - before["energy.kinetic"]
        assert abs(gain) > 0.05
        assert at["energy.supplied"] - before["energy.supplied"] == pytest.approx(gain, rel=1e-12)
        # what the step starts from is what was read
        for name in {"crank.speed", rate, "slider.velocity"}:
            slope = at[name.replace("speed", "acceleration").replace("velocity", "acceleration")]
            assert after[name] == pytest.approx(at[name] + 1e-6 * slope, abs=1e-8)
        for row in (at, after, later):
            assert abs(row["energy.residual"]) < 1e-7 * max(1.0, row["energy.kinetic"])


def balance(fmu: str, folder: str, values: dict[str, float], inputs: dict[str, list[float]]) -> list[Any]:
    """Energies along a run whose inputs swing between two values."""
    from math import sin

    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start(values)
    rows = []
    for k in range(200):
        for name, (low, high) in inputs.items():
            instance.set(name, low + (high - low) * 0.5 * (1.0 + sin(0.1 * k)))
        assert instance.step(k * 2e-3, 2e-3) == 0
        rows.append({n: v for n, v in instance.outputs().items() if n.startswith("energy") or "closure" in n})
    return rows


#: Values at the start, and inputs that swing between two values.
BALANCES = {
    "FiveBarSlider": {
        "torque": ({"drive.mode": 0, "initial.crank_speed": 30.0}, {"drive.torque": [-0.5, 1.0]}),
        "everything": (
            {"drive.mode": 0, "initial.crank_speed": 30.0, "slider.coulomb_friction": 1.0, "slider.guide_angle": 0.3},
            {"drive.torque": [0.0, 0.5], "slider.force": [-2.0, 2.0], "load.fx": [-1.0, 1.0], "load.fy": [0.0, 1.0]},
        ),
        "speed": ({}, {"drive.speed": [40.0, 45.0], "drive.acceleration": [-30.0, 30.0]}),
    },
    "SliderCrank": {
        "forces": (
            {**GENERAL, "drive.mode": 0, "axial.mode": 0},
            {"drive.torque": [-20.0, 40.0], "axial.force": [-30.0, 30.0], "slider.load": [-10.0, 10.0]},
        ),
        "torque, axial speed": (
            {**GENERAL, "drive.mode": 0},
            {"drive.torque": [-20.0, 40.0], "axial.speed": [-0.3, 0.2], "axial.acceleration": [-1.0, 1.0]},
        ),
        "speed, force": (
            {**GENERAL, "axial.mode": 0},
            {"drive.speed": [8.0, 11.0], "drive.acceleration": [-30.0, 30.0], "axial.force": [-30.0, 30.0]},
        ),
        "speeds": (GENERAL, {"drive.speed": [8.0, 11.0], "axial.speed": [-0.3, 0.2], "slider.load": [-10.0, 10.0]}),
        "torque, groove": (
            {**GENERAL, "drive.mode": 0, "axial.mode": 2},
            {"drive.torque": [-20.0, 40.0], "slider.load": [-10.0, 10.0]},
        ),
        "speed, groove": ({**GENERAL, "axial.mode": 2}, {"drive.speed": [8.0, 11.0], "slider.load": [-10.0, 10.0]}),
    },
}


@each(BALANCES, "values", "inputs")
def test_energy_balance(fmu: Path, tmp_path: Path, values: dict[str, float], inputs: dict[str, list[float]]) -> None:
    rows = run_in_process(balance, fmu, tmp_path, values, inputs)
    first = rows[0]
    base = first["energy.kinetic"] + first["energy.potential"] + first["energy.dissipated"] - first["energy.supplied"]
    turnover = max(abs(row["energy.supplied"]) for row in rows)
    assert turnover > 0.1
    for row, previous in zip(rows[1:], rows):
        assert abs(row["energy.residual"]) < 1e-6 * max(1.0, turnover)
        now = row["energy.kinetic"] + row["energy.potential"] + row["energy.dissipated"] - row["energy.supplied"]
        assert now == pytest.approx(base, abs=1e-6 * max(1.0, turnover))
        assert row["energy.dissipated"] > previous["energy.dissipated"]
        assert row["closure.residual"] < 1e-15


def feed_through(
    fmu: str, folder: str, values: dict[str, float], changes: dict[str, float], steps: int, size: float
) -> list[Any]:
    """Outputs read right after an input was set, one input after the other, and after it was set back."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start(values)
    instance.run([size] * steps)
    base = instance.outputs()
    read = {}
    for name, value in changes.items():
        before = instance.get(name)
        instance.set(name, value)
        read[name] = instance.outputs()
        instance.set(name, before)
        assert instance.outputs() == base
    return [base, read]


@each(MODES, "modes")
def test_inputs_are_felt_at_once(fmu: Path, tmp_path: Path, modes: dict[str, int]) -> None:
    mechanics = MECHANICS[fmu.stem]
    turned, axial, shifted = modes["drive.mode"] == 1, modes.get("axial.mode", 0), mechanics.freedom == "shift"
    values = (MECHANISM if shifted else {}) | modes
    base, read = run_in_process(feed_through, fmu, tmp_path, values, mechanics.changes, mechanics.steps, mechanics.size)
    m = mechanics.masses(base)
    k, slope = (rates(base), pitch(base)) if shifted else (np.array([0.0, 1.0]), 0.0)
    unused = {
        "drive.torque": turned,
        "drive.acceleration": not turned,
        "axial.force": axial != 0,
        "axial.acceleration": axial != 1,
    }
    for name, row in read.items():
        if unused.get(name, False):
            assert row == base, name
            continue
        value = mechanics.changes[name]
        # unknown: both accelerations, the torque and the axial force; a groove's force works back on the crank
        a = np.zeros((4, 4))
        b = np.zeros(4)
        a[:2, :2] = m
        a[0, 2] = -1.0
        a[0, 3] = slope if axial == 2 else 0.0
        a[1, 3] = -1.0
        b[:2] = k * value if name == "slider.load" else 0.0
        a[2, 0 if turned else 2] = 1.0
        b[2] = value if name == ("drive.acceleration" if turned else "drive.torque") else 0.0
        a[3] = {0: [0.0, 0.0, 0.0, 1.0], 1: [0.0, 1.0, 0.0, 0.0], 2: [-slope, 1.0, 0.0, 0.0]}[axial]
        b[3] = value if name in (mechanics.force, "axial.acceleration") else 0.0
        expected = np.linalg.solve(a, b)
        names = ["crank.acceleration", f"{mechanics.freedom}.acceleration", "drive.applied_torque"]
        names += ["axial.applied_force"] if shifted else []
        found = [row[output] - base[output] for output in names]
        assert found == pytest.approx(expected[: len(names)], rel=1e-9, abs=1e-9), name
        assert row["slider.acceleration"] - base["slider.acceleration"] == pytest.approx(k @ expected[:2], rel=1e-9)


def in_the_groove(fmu: str, folder: str, values: dict[str, float]) -> list[dict[str, float]]:
    """Outputs along a run whose torque and speed swing, in steps of uneven size."""
    from math import sin

    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start(values)
    rows = [instance.outputs()]
    time = 0.0
    for k in range(60):
        instance.set("drive.torque", 60.0 * sin(0.4 * k))
        instance.set("drive.speed", 9.0 + 2.0 * sin(0.3 * k))
        rows.append(instance.outputs())
        size = 1e-2 + 5e-3 * sin(k)
        assert instance.step(time, size) == 0
        time += size
        rows.append(instance.outputs())
    return rows


@pytest.mark.parametrize("drive", [0, 1])
def test_groove_makes_the_shift_at_all_times(slider_crank: Path, tmp_path: Path, drive: int) -> None:
    # given shift and axial velocity at the start are not those of the groove, and of no effect
    given = {"initial.shift_position": 0.5, "initial.crank_angle": 0.3, "drive.mode": drive, "axial.mode": 2}
    stored = {"shift.stiffness": 700.0, "shift.spring_free_position": 0.02, "shift.damping": 12.0, "gravity.z": 4.0}
    rows = run_in_process(in_the_groove, slider_crank, tmp_path, MECHANISM | given | stored)
    assert rows[-1]["crank.angle"] - rows[0]["crank.angle"] > 4.0
    for row in rows:
        phase = RATIO * row["crank.angle"]
        # eq 28 to the last digit
        assert row["shift.position"] == AMPLITUDE * sin(phase)
        assert row["crank_pin.z"] == row["shift.position"]
        assert row["shift.velocity"] == pytest.approx(
            AMPLITUDE * RATIO * cos(phase) * row["crank.speed"], rel=1e-13, abs=1e-15
        )
        turning = AMPLITUDE * RATIO * cos(phase) * row["crank.acceleration"]
        bending = -AMPLITUDE * RATIO**2 * sin(phase) * row["crank.speed"] ** 2
        assert row["shift.acceleration"] == pytest.approx(turning + bending, rel=1e-11, abs=1e-10)
        # the axial force it takes: what the crank's mass and the rod ask for, beyond spring, damper and weight
        asked = M1 * (row["shift.acceleration"] - 4.0) + row["crank_pin.fz"]
        given_back = -700.0 * (row["shift.position"] - 0.02) - 12.0 * row["shift.velocity"]
        assert row["bearing.fz"] == pytest.approx(asked, rel=1e-10, abs=1e-9)
        assert row["axial.applied_force"] == pytest.approx(asked - given_back, rel=1e-9, abs=1e-9)
        assert abs(row["energy.residual"]) < 1e-6
        assert row["closure.residual"] < 1e-15
    assert max(abs(row["axial.applied_force"]) for row in rows) > 10.0


def pushed_out(fmu: str, folder: str, values: dict[str, float]) -> list[Any]:
    """A run out of the rod's reach, in steps until one is refused, and back after both speeds were reversed."""
    from bare_master import DISCARD, OK, Fmu

    instance = Fmu(fmu, folder).instantiate().start(values)
    status, k = OK, 0
    while status == OK and k < 1000:
        last = instance.outputs()
        status = instance.step(k * 1e-2, 1e-2)
        k += 1
    assert status == DISCARD
    trouble, kept = instance.trouble(), instance.outputs()
    state = instance.save()
    for name in ("drive.speed", "axial.speed"):
        instance.set(name, -values[name])
    for n in range(20):
        assert instance.step((k - 1 + n) * 1e-2, 1e-2) == OK
    back = instance.outputs()
    assert instance.restore(state) == 0
    again = instance.step((k - 1) * 1e-2, 1e-2)
    return [trouble, last, kept, back, again, instance.trouble()]


@pytest.mark.parametrize("sign", [1, -1])
def test_crank_pin_shifted_out_of_the_rods_reach(slider_crank: Path, tmp_path: Path, sign: int) -> None:
    values = {"drive.speed": 20.0, "axial.speed": 0.9 * sign, "gravity.x": -9.81}
    trouble, last, kept, back, again, trouble_again = run_in_process(pushed_out, slider_crank, tmp_path, values)
    assert trouble[0] == 3
    assert trouble[1].startswith("in the step from t = ")
    assert "limit of assembly" in trouble[1]
    assert "crank angle" in trouble[1]
    assert "shift" in trouble[1]
    assert kept == last
    assert 0.0 < kept["assembly.margin"] < 0.05
    assert 0.0 < kept["transmission.angle"] < 0.4
    # f^2 + g^2 at 270 deg: sqrt((a1 c + a4)^2 + S1^2), short of the rod's length
    reach = np.hypot(kept["crank_pin.x"] + 10 * INCH, kept["shift.position"])
    assert kept["assembly.margin"] == pytest.approx(ROD - reach, rel=1e-10)
    # back inside it goes on as if nothing had been, and from the saved state it is refused again
    assert abs(back["shift.position"]) == pytest.approx(abs(kept["shift.position"]) - 0.9 * 0.2, rel=1e-10)
    assert back["assembly.margin"] > kept["assembly.margin"]
    assert again == 2
    assert trouble_again == trouble
