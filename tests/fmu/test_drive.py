"""What the two drives mean: the commanded speed over a step, its jumps, the torque, and the energy balance."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from linkwork.five_bar.dynamics import inertia
from linkwork.five_bar.kinematics import coefficients, position
from linkwork.five_bar.published import TABLE_3_1

from .models import each
from .runner import run_in_process

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


def masses(outputs: dict[str, float]) -> tuple[float, float, float]:
    """m11, m12 and m22 at the configuration of some outputs."""
    g = position(outputs["crank.angle"], outputs["slider.position"], CONSTANTS)
    return tuple(inertia(g, coefficients(g, CONSTANTS), CONSTANTS))


def follow_speed(fmu: str, folder: str) -> list[Any]:
    """Steps with a speed and an acceleration commanded; the speed is given anew only before the third step."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start({"drive.speed": 40.0, "drive.acceleration": 100.0})
    rows = [instance.outputs()]
    for k, size in enumerate((0.01, 0.02, 0.01)):
        if k == 2:
            instance.set("drive.speed", 42.0)
            instance.set("drive.acceleration", -50.0)
            rows.append(instance.outputs())
        assert instance.step(sum((0.01, 0.02)[:k]), size) == 0
        rows.append(instance.outputs())
    return rows


def test_speed_over_a_step_is_the_commanded_line(fmu: Path, tmp_path: Path) -> None:
    start, first, second, commanded, third = run_in_process(follow_speed, fmu, tmp_path)
    assert start["crank.speed"] == 40.0
    assert start["crank.acceleration"] == 100.0
    assert first["crank.speed"] == pytest.approx(40.0 + 100.0 * 0.01, rel=1e-14)
    assert first["crank.angle"] == pytest.approx(40.0 * 0.01 + 50.0 * 0.01**2, rel=1e-13)
    # not given again: the next step starts from the same commanded speed
    assert second["crank.speed"] == pytest.approx(40.0 + 100.0 * 0.02, rel=1e-14)
    assert second["crank.angle"] - first["crank.angle"] == pytest.approx(40.0 * 0.02 + 50.0 * 0.02**2, rel=1e-13)
    # given anew it holds at once, and the acceleration with it
    assert commanded["crank.speed"] == 42.0
    assert commanded["crank.acceleration"] == -50.0
    assert commanded["crank.angle"] == second["crank.angle"]
    assert third["crank.speed"] == pytest.approx(42.0 - 50.0 * 0.01, rel=1e-14)


def jump(fmu: str, folder: str, speed: float) -> list[Any]:
    """Outputs before and after a jump of the commanded speed, and after a step on from it."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start({"drive.acceleration": 5.0})
    instance.run([1e-3] * 37)
    before = instance.outputs()
    instance.set("drive.speed", speed)
    at = instance.outputs()
    assert instance.step(0.037, 1e-6) == 0
    after = instance.outputs()
    instance.run([1e-3] * 20, 0.037001)
    return [before, at, after, instance.outputs()]


@pytest.mark.parametrize("speed", [60.0, 5.0, -30.0])
def test_jump_of_the_speed_conserves_the_momentum_of_the_slider(five_bar: Path, tmp_path: Path, speed: float) -> None:
    before, at, after, later = run_in_process(jump, five_bar, tmp_path, speed)
    _, m12, m22 = masses(before)
    assert abs(m12) > 1e-3, "no coupling here: nothing would be tested"
    momentum = m12 * before["crank.speed"] + m22 * before["slider.velocity"]
    assert at["crank.speed"] == speed
    assert m12 * speed + m22 * at["slider.velocity"] == pytest.approx(momentum, rel=1e-12)
    assert abs(at["slider.velocity"] - before["slider.velocity"]) > 1e-3
    for same in ("crank.angle", "slider.position", "energy.potential", "energy.dissipated", "coupler.point.x"):
        assert at[same] == before[same]
    # what the step starts from is what was read
    assert after["slider.velocity"] == pytest.approx(at["slider.velocity"] + at["slider.acceleration"] * 1e-6, abs=1e-7)
    # the impulse did the work that the kinetic energy shows
    gain = at["energy.kinetic"] - before["energy.kinetic"]
    assert at["energy.supplied"] - before["energy.supplied"] == pytest.approx(gain, rel=1e-12)
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


def feed_through(fmu: str, folder: str, mode: int) -> list[Any]:
    """Outputs read right after an input was set, one input after the other, and after it was set back."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start({"drive.mode": mode})
    instance.run([1e-3] * 20)
    base = instance.outputs()
    read = {}
    for name, value in (("drive.torque", 0.7), ("drive.acceleration", 25.0), ("slider.force", 3.0)):
        before = instance.get(name)
        instance.set(name, value)
        read[name] = instance.outputs()
        instance.set(name, before)
        assert instance.outputs() == base
    return [base, read]


def test_inputs_are_felt_at_once_in_speed_drive(five_bar: Path, tmp_path: Path) -> None:
    base, read = run_in_process(feed_through, five_bar, tmp_path, 1)
    m11, m12, m22 = masses(base)
    assert read["drive.torque"] == base
    pushed = read["slider.force"]
    assert pushed["slider.acceleration"] - base["slider.acceleration"] == pytest.approx(3.0 / m22, rel=1e-9)
    assert pushed["drive.applied_torque"] - base["drive.applied_torque"] == pytest.approx(3.0 * m12 / m22, rel=1e-9)
    driven = read["drive.acceleration"]
    assert driven["crank.acceleration"] == 25.0
    assert driven["slider.acceleration"] - base["slider.acceleration"] == pytest.approx(-25.0 * m12 / m22, rel=1e-9)
    torque = 25.0 * (m11 - m12**2 / m22)
    assert driven["drive.applied_torque"] - base["drive.applied_torque"] == pytest.approx(torque, rel=1e-9)


def test_inputs_are_felt_at_once_in_torque_drive(five_bar: Path, tmp_path: Path) -> None:
    base, read = run_in_process(feed_through, five_bar, tmp_path, 0)
    m11, m12, m22 = masses(base)
    determinant = m11 * m22 - m12**2
    assert read["drive.acceleration"] == base
    turned = read["drive.torque"]
    assert turned["drive.applied_torque"] == 0.7
    assert turned["crank.acceleration"] - base["crank.acceleration"] == pytest.approx(0.7 * m22 / determinant, rel=1e-9)
    pushed = read["slider.force"]
    assert pushed["crank.acceleration"] - base["crank.acceleration"] == pytest.approx(
        -3.0 * m12 / determinant, rel=1e-9
    )
    assert pushed["slider.acceleration"] - base["slider.acceleration"] == pytest.approx(
        3.0 * m11 / determinant, rel=1e-9
    )
