"""Natural frequencies about the equilibrium, against closed forms and the energy of machines with several springs."""

import csv
from collections.abc import Callable
from dataclasses import replace
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from analysis import Inputs, natural_frequency, natural_modes, ramp
from analysis.linear import linearise
from analysis.linkages import linkage
from analysis.periodic import Drive, basins, default_range, find_orbits
from analysis.run import load_case
from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.five_bar.published import SETS

pytest.importorskip("casadi")

RPM = pi / 30.0
#: A crank drives a lever through a rod that is a spring; a second spring holds the lever upright.
LEVER = """
[linkage]
name = "sprung-lever"
gravity = 9.81
ground = { A = [0, 0], E = [0.5, 0] }
[linkage.bodies]
crank = { bar = ["A", "B"], length = 0.015, mass = 1, inertia = 0.01 }
rod = { points = { B = [0, 0] }, mass = 0 }
head = { points = { C = [0, 0] }, mass = 0 }
lever = { bar = ["E", "C"], length = 0.3, mass = 6, cog = [0.2, 0], inertia = 0.05 }
[linkage.slides]
S = { body = "head", on = "rod", through = "B" }
[linkage.springs]
rodspring = { at = "S", stiffness = 3e4, free = 0.583, damping = 40 }
back = { at = "E", stiffness = 400, free = "90 deg", damping = 0.5, friction = 3 }
[linkage.freedoms]
crank = { joint = "A", speed = "300 rpm" }
lever = { joint = "E", start = "90 deg" }
"""
#: A block on a spring carries a rotor with an unbalance, and a pendulum that hangs.
BLOCK = """
[linkage]
name = "pendulum-block"
gravity = 9.81
ground = { O = [0, 0] }
[linkage.bodies]
block = { points = { P = [0, 0], R = [0.1, 0] }, mass = 10 }
rotor = { points = { R = [0, 0] }, mass = 2, cog = [0.01, 0], inertia = 0.01 }
pendulum = { points = { P = [0, 0] }, mass = 1.2, cog = [0.25, 0], inertia = 0.002 }
[linkage.slides]
Y = { body = "block", through = "O", direction = "90 deg" }
[linkage.springs]
foot = { at = "Y", stiffness = 1600, free = 0.084, damping = 10 }
hinge = { at = "P", damping = 0.008 }
[linkage.freedoms]
rotor = { joint = "R", speed = "120 rpm" }
lift = "Y"
swing = { joint = "P", start = "180 deg" }
"""
#: A crank alone.
CRANK = """
[linkage]
name = "one-crank"
ground = { A = [0, 0] }
[linkage.bodies]
crank = { points = { A = [0, 0] }, mass = 1, cog = [0.02, 0], inertia = 0.01 }
[linkage.springs]
bearing = { at = "A", damping = 0.02 }
[linkage.freedoms]
crank = { joint = "A", speed = "300 rpm" }
"""


def write(folder: Path, text: str) -> Path:
    (path := folder / "machine.toml").write_text(text + "[run]\nstop_time = 1.0\n", encoding="utf-8")
    return path


def test_two_springs_and_gravity_over_a_turn_of_the_crank(tmp_path: Path) -> None:
    case = load_case(write(tmp_path, LEVER))
    found = natural_modes(case.parameters, case.inputs, initial=case.initial)

    def potential(lever: float, crank: float) -> float:
        across = 0.5 + 0.3 * np.cos(lever) - 0.015 * np.cos(crank), 0.3 * np.sin(lever) - 0.015 * np.sin(crank)
        springs = 0.5 * 3e4 * (np.hypot(*across) - 0.583) ** 2 + 0.5 * 400.0 * (lever - 0.5 * pi) ** 2
        return float(springs + 6.0 * 9.81 * 0.2 * np.sin(lever))

    inertia, wanted = 0.05 + 6.0 * 0.2**2, []
    tight = {"method": "bounded", "options": {"xatol": 1e-10}}
    for crank in 2.0 * pi * np.arange(36) / 36:
        rest = minimize_scalar(potential, bounds=(1.2, 1.9), args=(crank,), **tight).x
        h = 1e-4
        second = (potential(rest + h, crank) - 2.0 * potential(rest, crank) + potential(rest - h, crank)) / h**2
        wanted.append(sqrt(second / inertia))
    np.testing.assert_allclose(found.frequencies[:, 0], wanted, rtol=1e-5)
    assert found.frequency_ranges[0, 0] / RPM == pytest.approx(845.65, abs=0.1)
    # the dampers of the machine alone, not its dry friction
    assert 0.05 < found.damping_ranges[0, 0] < found.damping_ranges[0, 2] < 0.07
    assert not found.unstable
    with pytest.raises(ParameterError, match="natural_modes"):
        natural_frequency(case.parameters)


def test_all_free_coordinates_are_in_the_equilibrium_of_their_start(tmp_path: Path) -> None:
    case = load_case(write(tmp_path, BLOCK))
    found = natural_modes(case.parameters, case.inputs, initial=case.initial)
    mass, arm = 13.2, 0.002 + 1.2 * 0.25**2
    swing, lift = sqrt(1.2 * 9.81 * 0.25 / arm), sqrt(1600.0 / mass)
    assert found.coordinates == ("swing.angle", "lift.position")
    np.testing.assert_allclose(found.frequency_ranges, [[swing] * 3, [lift] * 3], rtol=1e-9)
    ratios = [[0.008 / (2.0 * arm * swing)] * 3, [10.0 / (2.0 * mass * lift)] * 3]
    np.testing.assert_allclose(found.damping_ranges, ratios, rtol=1e-9)
    with pytest.raises(ParameterError, match="one freedom beside its cranks"):
        natural_frequency(case.parameters)
    upright = natural_modes(case.parameters, case.inputs, initial={"swing_angle": 0.0})
    assert upright.unstable == len(upright.equilibria) == 36
    assert "36 of them unstable" in repr(upright)
    assert upright.coordinates == ("lift.position",)


def test_modes_are_followed_where_their_frequencies_cross_and_one_is_overdamped_in_part(tmp_path: Path) -> None:
    """Beside the lever, whose frequency varies over the turn, a block on a spring of its own."""
    text = LEVER
    for table, more in (
        ("slides", "block = { points = { P = [0, 0] }, mass = 2 }"),
        ("springs", 'Y = { body = "block", through = "E", direction = "90 deg" }'),
        ("freedoms", 'foot = { at = "Y", stiffness = 16020, damping = 4 }'),
    ):
        text = text.replace(f"[linkage.{table}]", f"{more}\n[linkage.{table}]")
    case = load_case(write(tmp_path, text + 'block = "Y"\n'))
    block = sqrt(16020.0 / 2.0)
    for damping in (40.0, 790.0):
        parameters = replace(case.parameters, rodspring_damping=damping)
        found = natural_modes(parameters, case.inputs, initial=case.initial)
        of_block = found.coordinates.index("block.position")
        np.testing.assert_allclose(found.frequencies[:, of_block], block, rtol=1e-9)
        np.testing.assert_allclose(found.damping_ratios[:, of_block], 1.0 / block, rtol=1e-9)
        lever = found.frequencies[:, 1 - of_block]
        assert found.coordinates[1 - of_block] == "lever.angle"
        assert np.nanmin(lever) < block < np.nanmax(lever)
        assert bool(np.isnan(lever).any()) == (damping > 40.0)


def test_a_crank_alone_has_no_natural_frequency_and_no_basins(tmp_path: Path) -> None:
    case = load_case(write(tmp_path, CRANK))
    for inputs in (case.inputs, Inputs(torque=0.0)):
        with pytest.raises(InputError, match="no coordinate of the one-crank other than the held crank is free"):
            natural_modes(case.parameters, inputs)
    for name in (None, "crank.angle"):
        with pytest.raises(InputError, match="one-crank has no free coordinate other than the crank's angle"):
            basins(case.parameters, Drive(torque=0.1), start=(5.0,), coordinate=name)


def test_the_crank_of_a_five_bar_is_held_whatever_drives_it() -> None:
    rig = SETS["rig-2-spring-c"].parameters
    turned = natural_modes(rig, Inputs(speed=30.0), samples=8)
    torque = natural_modes(rig, Inputs(torque=0.3), samples=8)
    np.testing.assert_allclose(torque.frequencies, turned.frequencies, rtol=1e-12)
    rest = turned.equilibria[3]
    np.testing.assert_allclose(turned.frequencies[3], abs(linearise(rig, rest.state, rest.inputs).poles[0]), rtol=1e-9)
    growing = ramp(0.0, 2.0, 0.0, 0.5)
    for inputs, samples in ((Inputs(force=growing), 8), (Inputs(speed=growing), 8), (Inputs(), 0)):
        with pytest.raises(InputError):
            natural_modes(rig, inputs, samples=samples)


def test_resonance_prints_them_and_covers_them(tmp_path: Path, linkwork: Callable[..., Any]) -> None:
    path = write(tmp_path, LEVER)
    done = linkwork("resonance", path, "--places", "0", "--doublings", "0", "--no-plot", "--out", tmp_path)
    assert "845.65" in done.stdout
    assert "lever.angle" in done.stdout
    assert "spring alone" not in done.stdout
    case = load_case(path)
    mean = natural_modes(case.parameters, case.inputs, initial=case.initial).frequency_ranges[0, 1]
    with (tmp_path / "machine-resonance.csv").open(encoding="utf-8", newline="") as file:
        speeds = [float(row["drive.speed [rad/s]"]) for row in csv.DictReader(file)]
    assert [min(speeds), max(speeds)] == pytest.approx([0.15 * mean, 2.3 * mean])


def test_a_chart_has_a_range_of_speeds_without_a_natural_frequency() -> None:
    # the slider cannot be held where this spring is free while the crank turns
    locked = replace(SETS["rig-2-spring-c"].parameters, slider_spring_free_position=1.0)
    with pytest.raises(AssemblyError):
        natural_frequency(locked)
    assert default_range(locked, Drive(speed=30.0), "drive.speed") == pytest.approx((3.0, 60.0))


def test_no_position_or_motion_is_taken_beyond_a_change_point() -> None:
    # a level parallelogram, with a pendulum on its coupler, folds at 0 and 180 deg, between two positions
    built = linkage("folding-parallelogram", ground={"A": (0, 0), "D": (0.2, 0)}, gravity=9.81)
    built.body("crank", bar=("A", "B"), length=0.05, mass=0.1, inertia=1e-4)
    built.body("coupler", bar=("B", "C"), length=0.2, points={"P": (0.1, 0)}, mass=0.1, inertia=1e-4)
    built.body("rocker", bar=("D", "C"), length=0.05, mass=0.1, inertia=1e-4)
    built.body("pendulum", bar=("P", "Q"), length=0.1, mass=0.2, inertia=1e-4)
    built.freedom("crank", "A", speed="300 rpm", start=0.1).freedom("swing", "P", start=-0.5 * pi)
    mechanism = built.mechanism()
    assert natural_modes(mechanism.name, samples=1).frequencies.shape == (1, 1)
    with pytest.raises(AssemblyError, match=r"at crank angle 3\.14"):
        natural_modes(mechanism.name)
    assert "the links come to the limit of assembly" in find_orbits(mechanism.name, speed="100 rpm").reason
