"""Systems in co-simulation against their equations joined to one model, and that model against an independent formulation."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest
import scipy

from analysis import InductionMotor, Inputs, figures, simulate, variant
from analysis.linkages import linkage
from analysis.systems import COUPLINGS, End, Joined, System, convergence, library, run_system
from analysis.systems.description import PartTable
from linkwork.errors import InputError, UnknownNameError

from .conftest import system_of, wiring_of

ORDERS = {"hold": 1.0, "acceleration": 1.0, "derivatives": 2.0, "rollback": 2.0}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["motor-crank", "press", "two-linkages"])
def test_each_coupling_has_its_order(name: str) -> None:
    step = 2.5e-4
    found = convergence(system_of(name), [step * 0.5**n for n in range(4)], stop_time=0.1)
    for way, order in ORDERS.items():
        assert order - 0.15 < found.order(way) < order + 0.6, way
        assert found.errors[way][-1] < found.errors["hold"][-1] * (1.01 if order < 2.0 else 0.05)


@pytest.mark.parametrize("name", ["slider-tracking", "motor-tracking"])
def test_a_sampled_controller_is_late_by_a_step_in_every_coupling(name: str) -> None:
    found = convergence(system_of(name), [5e-4, 2.5e-4, 1.25e-4], stop_time=0.05)
    for way in ORDERS:
        assert 0.7 < found.order(way) < 1.4
    assert found.errors["derivatives"][-1] < 0.02


def test_the_joined_model_is_the_motor_and_shaft_of_a_hand_written_run() -> None:
    """A stiff shaft and a light rotor: a five-bar under the torque of Kloss's formula, the rotor's inertia on its crank."""
    system = system_of("motor-crank")
    rigid = {"rotor.inertia": 1e-6, "shaft.stiffness": 1e5, "shaft.damping": 0.5, "airGap.breakdown_torque": 1.0}
    parts = {**system.parts, "motor": replace(system.parts["motor"], values=rigid)}
    joined = Joined(replace(system, parts=parts)).run(0.1, 1e-2, tolerance=1e-10)
    motor = InductionMotor(breakdown_torque=1.0, breakdown_slip=322.8 / 1076.0, synchronous_speed=1076.0 * pi / 30.0)
    inertia = 1e-6 + system.members["linkage"].values["crank.inertia"]
    rig = variant("rig-2-spring-d", slider_damping=3.0, crank_inertia=inertia)
    run = simulate(rig, Inputs(torque=motor), initial={"crank_speed": 0.0}, stop_time=0.1, step=1e-2, tolerance=1e-11)
    for name in ("crank.angle", "slider.position"):
        np.testing.assert_allclose(joined[f"linkage.{name}"], run[name], rtol=1e-4, atol=1e-7)


def oscillators(tmp_path: Path, stiffness: float, folder: str) -> System:
    """Two masses of 1 kg joined by a spring, of a published benchmark of couplings: v = +100 and -100 m/s at the start."""
    ground = {"A": (0, 0)}
    one = linkage(f"{folder}-one", ground=ground).body("cart", points={"P": (0, 0)}, mass="1 kg")
    one.slide("G", body="cart", through="A").freedom("cart", "G", driven=False, speed="100 m/s").mechanism()
    text = f"""
[linkage]
name = "{folder}-two"
[linkage.ground]
A = [0, 0]
[linkage.bodies.cart]
points = {{ P = [0, 0] }}
mass = "1 kg"
[linkage.bodies.flange]
points = {{ Q = ["-1 m", 0] }}
[linkage.slides.G]
body = "cart"
through = "A"
[linkage.slides.H]
body = "flange"
through = "A"
[linkage.springs.link]
between = ["P", "Q"]
free = "1 m"
stiffness = {stiffness}
[linkage.freedoms]
cart = {{ joint = "G", driven = false, speed = "-100 m/s" }}
flange = {{ joint = "H", driven = true, speed = "100 m/s" }}
"""
    (tmp_path / f"{folder}.toml").write_text(text, encoding="utf-8")
    return System(
        title="two oscillators",
        parts={"one": PartTable(case=f"{folder}-one"), "two": PartTable(case=f"{folder}.toml")},
        connections={
            End("two", "drive.speed"): End("one", "cart.velocity"),
            End("two", "drive.acceleration"): End("one", "cart.acceleration"),
            End("one", "cart.force"): End("two", "link.exerted_force"),
        },
        folder=tmp_path,
    )


def slow_oscillators(tmp_path: Path, stiffness: float, name: str) -> System:
    """The same at a thousandth of the speeds: the spring between points a metre apart must not be turned over."""
    system = oscillators(tmp_path, stiffness, name)
    parts = {
        "one": replace(system.parts["one"], values={"initial.cart_velocity": 0.1}),
        "two": replace(system.parts["two"], values={"initial.cart_velocity": -0.1, "initial.flange_velocity": 0.1}),
    }
    return replace(system, parts=parts)


@pytest.mark.parametrize("stiffness", [10.0, 100.0, 1000.0])
def test_the_linear_oscillators_of_published_benchmarks(tmp_path: Path, stiffness: float) -> None:
    """m = 1 kg, k = 10, 100, 1000 N/m and v = +-100 m/s, as cosim-benchmarks has them; the solution is known in closed form."""
    frequency = np.sqrt(2.0 * stiffness)
    system = slow_oscillators(tmp_path, stiffness, f"oscillators{stiffness:.0f}")
    step = 0.02 / frequency
    run = run_system(system.wiring(), coupling="derivatives", step=step, stop_time=400 * step)
    right = 0.1 / frequency * np.sin(frequency * run.time)
    joined = Joined(system).run(400 * step, step)
    np.testing.assert_allclose(joined["one.cart.position"], right, atol=1e-9 / frequency)
    assert np.abs(run["one.cart.position"] - right).max() < 2e-3 * 0.1 / frequency
    found = convergence(system, [2.0 * step, step, 0.5 * step], stop_time=100 * step)
    assert found.order("hold") == pytest.approx(1.0, abs=0.1)
    assert found.order("derivatives") == pytest.approx(2.0, abs=0.2)


def test_power_residuals_are_the_work_that_the_coupling_brings_in(tmp_path: Path) -> None:
    """Two oscillators without losses gain what the coupling brings in."""
    system = slow_oscillators(tmp_path, 100.0, "gaining")
    run = run_system(system.without_rates().wiring(), step=1e-3, stop_time=0.5)
    (power,) = run.powers.values()
    energy = run["one.energy.kinetic"] + run["two.energy.kinetic"] + run["two.energy.potential"]
    assert energy[-1] > 1.001 * energy[0]
    assert energy[-1] - energy[0] == pytest.approx(0.5e-3 * power.sum(), rel=0.02)
    better = run_system(system.wiring(), coupling="derivatives", step=1e-3, stop_time=0.5)
    assert better.brought_in() < 0.02 * run.brought_in()


@pytest.mark.parametrize("coupling", COUPLINGS)
def test_a_refused_step_ends_the_run_and_keeps_what_was_there(coupling: str) -> None:
    system = system_of("slider-tracking")
    far = {**system.parts["reference"].values, "motion_cos_2": "500 mm"}
    strong = {**system.parts["controller"].values, "limit": "100 kN"}
    parts = {
        **system.parts,
        "reference": replace(system.parts["reference"], values=far),
        "controller": replace(system.parts["controller"], values=strong),
    }
    run = run_system(replace(system, parts=parts).wiring(), coupling=coupling)
    assert run.status == 3
    assert "linkage refused the step from t = " in run.message
    assert "limit of assembly" in run.message
    assert 1 < len(run) < 2001
    assert np.isfinite(run["linkage.slider.position"]).all()


def test_wrong_arguments_are_refused() -> None:
    wiring = wiring_of("motor-crank")
    with pytest.raises(UnknownNameError, match="rollback"):
        run_system(wiring, coupling="roll")
    with pytest.raises(InputError, match="communication step"):
        run_system(wiring, step=2.0, stop_time=1.0)
    with pytest.raises(InputError, match="does not divide"):
        convergence(system_of("motor-crank"), [1e-3, 4e-4], stop_time=0.1)
    with pytest.raises(UnknownNameError):
        run_system(wiring, step=1e-3, stop_time=1e-2)["linkage.crank.sped"]


def test_sommerfelds_capture_in_the_system() -> None:
    """The crank is caught near 800 rpm, as the run in process with a rigid shaft is (docs/capture.md)."""
    run = run_system(wiring_of("motor-crank"), coupling="derivatives")
    last = run.time > 15.0
    assert run["linkage.crank.speed"][last].mean() * 30.0 / pi == pytest.approx(804.5, abs=8.0)
    assert run["linkage.slider.position"][last].max() == pytest.approx(0.0216, abs=0.003)


def test_the_press_slows_down_as_it_works_and_is_brought_back_to_speed() -> None:
    run = run_system(wiring_of("press"), coupling="derivatives")
    pressed = run["load.contact.exerted_force"] < -500.0
    assert pressed.any()
    assert not pressed[-1]
    speed = run["flywheel.pinion.speed"] / 5.0
    assert speed[pressed].min() < speed[run.time > 0.5].max()
    assert run["press.slider.position"] == pytest.approx(run["load.ram.position"], abs=1e-5)


def test_pictures() -> None:
    figures.plot(run_system(wiring_of("press"), stop_time=0.05))
    figures.plot(convergence(system_of("motor-crank"), [1e-3, 5e-4], stop_time=0.02))
    assert set(library()) == {"motor-crank", "motor-tracking", "press", "slider-tracking", "two-linkages"}


def test_a_torsional_spring_of_two_bodies_swings_as_two_rotors_do() -> None:
    pair = linkage("rotor-pair", ground={"A": (0, 0), "B": ("1 m", 0)})
    pair.body("left", points={"A": (0, 0)}, mass="1 kg", inertia="0.02 kg*m^2")
    pair.body("right", points={"B": (0, 0)}, mass="1 kg", inertia="0.05 kg*m^2")
    pair.spring("shaft", bodies=("left", "right"), stiffness="30 N*m/rad", free="10 deg")
    pair.freedom("left", "A", driven=False, speed="3 rad/s").freedom("right", "B", driven=False).mechanism()
    run = simulate("rotor-pair", stop_time=1.0, step=0.01, tolerance=1e-11)
    k, one, two = 30.0, 0.02, 0.05
    matrix = np.zeros((4, 4))
    matrix[:2, 2:] = np.eye(2)
    matrix[2:, :2] = [[-k / one, k / one], [k / two, -k / two]]
    rest = np.array([0.0, np.radians(10.0), 0.0, 0.0])
    states = [scipy.linalg.expm(matrix * t) @ (np.array([0.0, 0.0, 3.0, 0.0]) - rest) + rest for t in run.time]
    np.testing.assert_allclose(run["left.angle"], [s[0] for s in states], atol=1e-8)
    np.testing.assert_allclose(run["shaft.exerted_torque"], [k * (s[1] - s[0] - rest[1]) for s in states], atol=1e-6)
