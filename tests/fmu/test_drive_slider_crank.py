"""What the six ways to drive the slider-crank mean: commanded speeds and their jumps, forces, the groove.

What is expected follows from the pins' positions that the FMU itself gives and from the thesis's data: the rod as one rigid
body, its angular velocity from the velocities of its ends.
"""

from __future__ import annotations

from itertools import product
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.published_rahman import CRANK_IN, CRANK_RADIUS_IN, INCH, MASSES_LB_S2_IN, POUND_FORCE, ROD_IN, ROD_RADIUS_IN

from .runner import run_in_process

Array = NDArray[np.float64]

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
MODES = [{"drive.mode": drive, "axial.mode": axial} for drive, axial in product((0, 1), (0, 1, 2))]
EVERY_MODE = pytest.mark.parametrize("modes", MODES, ids=lambda modes: "-".join(map(str, modes.values())))


def vector(outputs: dict[str, float], name: str) -> Array:
    return np.array([outputs[name + axis] for axis in "xyz"])


def rates(outputs: dict[str, float]) -> Array:
    """Velocity coefficients of the slider (m/rad, m/m): the rod's ends have the same velocity along the rod."""
    rod = vector(outputs, "slider_pin.") - vector(outputs, "crank_pin.")
    guide = np.array([0.0, -sin(TWIST), -cos(TWIST)])
    theta = outputs["crank.angle"]
    turning = np.array([-CRANK * sin(theta), CRANK * cos(theta), 0.0])
    return np.array([turning @ rod, rod[2]]) / (guide @ rod)


def masses(outputs: dict[str, float]) -> Array:
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


def pitch(outputs: dict[str, float]) -> float:
    """dS1/dtheta1 of the groove."""
    return AMPLITUDE * RATIO * cos(RATIO * outputs["crank.angle"])


def jumps(fmu: str, folder: str, values: dict[str, float], commands: list[dict[str, float]]) -> list[list[Any]]:
    """Outputs before and after each jump of commanded speeds, after a short step on from it, and later."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    found = []
    for command in commands:
        instance = fmu.instantiate().start(values)
        instance.run([1e-2] * 7)
        before = instance.outputs()
        for name, value in command.items():
            instance.set(name, value)
        rows = [before, instance.outputs()]
        assert instance.step(0.07, 1e-6) == 0
        rows.append(instance.outputs())
        instance.run([1e-2] * 5, 0.070001)
        found.append([*rows, instance.outputs()])
        instance.free()
    return found


COMMANDS = [
    {"drive.speed": 14.0},
    {"drive.speed": -4.0},
    {"axial.speed": 0.5},
    {"axial.speed": -1.1},
    {"drive.speed": 2.0, "axial.speed": 0.4},
]


@EVERY_MODE
def test_jumps_of_commanded_speeds(slider_crank: Path, tmp_path: Path, modes: dict[str, int]) -> None:
    turned, shifted, grooved = modes["drive.mode"] == 1, modes["axial.mode"] == 1, modes["axial.mode"] == 2
    values = MECHANISM | modes | {"slider.damping": 4.0, "gravity.y": -9.81}
    for command, rows in zip(COMMANDS, run_in_process(jumps, slider_crank, tmp_path, values, COMMANDS)):
        before, at, after, later = rows
        jumped = turned * ("drive.speed" in command) or shifted * ("axial.speed" in command)
        if not jumped:
            # what commands nothing changes nothing
            assert at == before
            continue
        w, v = before["crank.speed"], before["shift.velocity"]
        m = masses(before)
        assert abs(m[0, 1]) > 0.05, "no coupling here: nothing would be tested"
        new = np.array([at["crank.speed"], at["shift.velocity"]])
        momentum, momentum_before = m @ new, m @ [w, v]
        if turned:
            assert new[0] == command.get("drive.speed", w)
        if shifted:
            assert new[1] == command.get("axial.speed", v)
        if not turned:
            assert momentum[0] == pytest.approx(momentum_before[0], rel=1e-11)
            assert abs(new[0] - w) > 1e-3
        if grooved:
            assert new[1] == pytest.approx(pitch(at) * new[0], rel=1e-14)
        elif not shifted:
            assert momentum[1] == pytest.approx(momentum_before[1], rel=1e-11)
            assert abs(new[1] - v) > 1e-3
        assert at["slider.velocity"] == pytest.approx(rates(at) @ new, rel=1e-11)
        for same in ("crank.angle", "shift.position", "slider.position", "energy.potential", "energy.dissipated"):
            assert at[same] == before[same]
        # the impulse did the work that the kinetic energy shows
        assert at["energy.kinetic"] == pytest.approx(0.5 * new @ m @ new, rel=1e-11)
        gain = at["energy.kinetic"] - before["energy.kinetic"]
        assert abs(gain) > 0.05
        assert at["energy.supplied"] - before["energy.supplied"] == pytest.approx(gain, rel=1e-10)
        # what the step starts from is what was read
        for name in ("crank.speed", "shift.velocity", "slider.velocity"):
            rate = at[name.replace("speed", "acceleration").replace("velocity", "acceleration")]
            assert after[name] == pytest.approx(at[name] + 1e-6 * rate, abs=1e-8)
        for row in (at, after, later):
            assert abs(row["energy.residual"]) < 1e-7 * max(1.0, row["energy.kinetic"])


def feed_through(fmu: str, folder: str, values: dict[str, float], changes: dict[str, float]) -> list[Any]:
    """Outputs read right after an input was set, one input after the other, and after it was set back."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start(values)
    instance.run([1e-2] * 7)
    base = instance.outputs()
    read = {}
    for name, value in changes.items():
        before = instance.get(name)
        instance.set(name, value)
        read[name] = instance.outputs()
        instance.set(name, before)
        assert instance.outputs() == base
    return [base, read]


CHANGES = {
    "drive.torque": 7.0,
    "drive.acceleration": 25.0,
    "axial.force": 11.0,
    "axial.acceleration": -6.0,
    "slider.load": 9.0,
}


@EVERY_MODE
def test_inputs_are_felt_at_once(slider_crank: Path, tmp_path: Path, modes: dict[str, int]) -> None:
    turned, axial = modes["drive.mode"] == 1, modes["axial.mode"]
    base, read = run_in_process(feed_through, slider_crank, tmp_path, MECHANISM | modes, CHANGES)
    m, k, slope = masses(base), rates(base), pitch(base)
    for name, row in read.items():
        unused = {
            "drive.torque": turned,
            "drive.acceleration": not turned,
            "axial.force": axial != 0,
            "axial.acceleration": axial != 1,
        }
        if unused.get(name, False):
            assert row == base, name
            continue
        value = CHANGES[name]
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
        b[3] = value if name in ("axial.force", "axial.acceleration") else 0.0
        expected = np.linalg.solve(a, b)
        names = ("crank.acceleration", "shift.acceleration", "drive.applied_torque", "axial.applied_force")
        found = [row[output] - base[output] for output in names]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9), name
        assert row["slider.acceleration"] - base["slider.acceleration"] == pytest.approx(k @ expected[:2], rel=1e-9)


def follow_shift(fmu: str, folder: str) -> list[Any]:
    """Steps with an axial speed and acceleration commanded; the speed is given anew only before the third step."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start({"axial.speed": 0.4, "axial.acceleration": -2.0})
    rows = [instance.outputs()]
    for k, size in enumerate((0.01, 0.02, 0.01)):
        if k == 2:
            instance.set("axial.speed", -0.6)
            instance.set("axial.acceleration", 5.0)
            rows.append(instance.outputs())
        assert instance.step(sum((0.01, 0.02)[:k]), size) == 0
        rows.append(instance.outputs())
    return rows


def test_axial_speed_over_a_step_is_the_commanded_line(slider_crank: Path, tmp_path: Path) -> None:
    start, first, second, commanded, third = run_in_process(follow_shift, slider_crank, tmp_path)
    assert start["shift.position"] == pytest.approx(3.5 * INCH, rel=1e-15)
    assert start["shift.velocity"] == 0.4
    assert start["shift.acceleration"] == -2.0
    assert first["shift.velocity"] == pytest.approx(0.4 - 2.0 * 0.01, rel=1e-13)
    assert first["shift.position"] - 3.5 * INCH == pytest.approx(0.4 * 0.01 - 1.0 * 0.01**2, rel=1e-12)
    # not given again: the next step starts from the same commanded speed
    assert second["shift.velocity"] == pytest.approx(0.4 - 2.0 * 0.02, rel=1e-13)
    assert second["shift.position"] - first["shift.position"] == pytest.approx(0.4 * 0.02 - 1.0 * 0.02**2, rel=1e-12)
    # given anew it holds at once, and the acceleration with it
    assert commanded["shift.velocity"] == -0.6
    assert commanded["shift.acceleration"] == 5.0
    assert commanded["shift.position"] == second["shift.position"]
    assert third["shift.velocity"] == pytest.approx(-0.6 + 5.0 * 0.01, rel=1e-13)


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
