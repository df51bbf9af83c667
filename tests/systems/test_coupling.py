"""Systems in co-simulation against their equations joined to one model, and that model against an independent formulation."""

from dataclasses import replace
from math import inf, pi
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from analysis import InductionMotor, Inputs, figures, simulate, variant
from analysis.linkages import linkage
from analysis.systems import COUPLINGS, End, JoinedSystem, System, SystemRun, convergence, library, run_system
from analysis.systems.description import PartTable
from analysis.systems.wiring import WiringError
from linkwork.errors import InputError, UnknownNameError
from tests.refusals import refused

from .conftest import system_of, wiring_of

ORDERS = {"hold": 1.0, "acceleration": 1.0, "derivatives": 2.0, "updates": 1.0, "rollback": 2.0}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["motor-crank", "press", "two-linkages"])
def test_each_coupling_has_its_order(name: str) -> None:
    step = 2.5e-4
    found = convergence(system_of(name), [step * 0.5**n for n in range(4)], stop_time=0.1)
    for way, order in ORDERS.items():
        assert order - 0.15 < found.order(way) < order + 0.6, way
        assert found.errors[way][-1] < found.errors["hold"][-1] * (1.01 if order < 2.0 else 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-tracking", "motor-tracking"])
def test_a_sampled_controller_is_late_by_a_step_in_every_coupling(name: str) -> None:
    found = convergence(system_of(name), [5e-4, 2.5e-4, 1.25e-4], stop_time=0.05)
    for way in ORDERS:
        assert 0.7 < found.order(way) < 1.4
    assert found.errors["derivatives"][-1] < 0.02


@pytest.mark.slow
def test_the_joined_model_is_the_motor_and_shaft_of_a_hand_written_run() -> None:
    """A stiff shaft and a light rotor: a five-bar under the torque of Kloss's formula, the rotor's inertia on its crank."""
    system = system_of("motor-crank")
    rigid = {"rotor.inertia": 1e-6, "shaft.stiffness": 1e5, "shaft.damping": 0.5, "airGap.breakdown_torque": 1.0}
    parts = {**system.parts, "motor": replace(system.parts["motor"], values=rigid)}
    joined = JoinedSystem(replace(system, parts=parts)).run(0.1, 1e-2, tolerance=1e-10)
    motor = InductionMotor(breakdown_torque=1.0, breakdown_slip=322.8 / 1076.0, synchronous_speed=1076.0 * pi / 30.0)
    inertia = 1e-6 + system.members["linkage"].values["crank.inertia"]
    rig = variant("rig-2-spring-d", slider_damping=3.0, crank_inertia=inertia)
    run = simulate(rig, Inputs(torque=motor), initial={"crank_speed": 0.0}, stop_time=0.1, step=1e-2, tolerance=1e-11)
    for name in ("crank.angle", "slider.position"):
        np.testing.assert_allclose(joined[f"linkage.{name}"], run[name], rtol=1e-4, atol=1e-7)


def test_each_controller_of_the_joined_model_samples_at_its_own_times(monkeypatch: pytest.MonkeyPatch) -> None:
    model = JoinedSystem(system_of("motor-tracking"))
    found: dict[str, list[float]] = {}
    for (name, controller), period in zip(model.controllers.items(), (1e-3, 7e-4, 1e-3), strict=False):
        controller.sample_time, sample = period, controller.sample

        def record(t: float, sample: Any = sample, name: str = name) -> None:
            found.setdefault(name, []).append(t)
            sample(t)

        monkeypatch.setattr(controller, "sample", record)
    run = model.run(5e-3, 1e-3)
    assert len(found) >= 2
    assert len(run.time) == 6
    for name, times in found.items():
        period = model.controllers[name].sample_time
        assert sorted({round(t, 9) for t in times}) == pytest.approx(np.arange(0.0, 5e-3 + 1e-9, period))


#: Two masses between walls, three springs and dampers: F. Gonzalez, cosim-benchmarks, linear oscillator, table 1.
#: Stiffnesses (N/m) of the first, the coupling and the second spring, both masses (kg), speeds at the start (m/s), time (s).
OSCILLATORS = ((10.0, 100.0, 1000.0), 1.0, 100.0, 10.0)


def carts(tmp_path: Path, name: str, first: dict[str, Any], second: dict[str, Any], link: dict[str, Any]) -> System:
    """Two carts on a line: the first is told a force, the second has the coupling spring and is told the first's speed.

    ``first`` and ``second`` have the mass, the speed at the start, and the spring to the ground.
    """
    far = 1e3  # the coupling spring is between points, which must not come to each other
    one = linkage(f"{name}-one", ground={"A": (0, 0)}).body("cart", points={"P": (0, 0)}, mass=first["mass"])
    one.slide("G", body="cart", through="A").spring("wall", at="G", **first["spring"])
    one.freedom("cart", "G", driven=False, speed=first["speed"]).mechanism()
    two = linkage(f"{name}-two", ground={"A": (0, 0)}).body("cart", points={"P": (0, 0)}, mass=second["mass"])
    two.body("flange", points={"Q": (-far, 0)}).slide("G", body="cart", through="A").slide(
        "H", body="flange", through="A"
    )
    two.spring("wall", at="G", **second["spring"]).spring("link", between=("P", "Q"), free=far, **link)
    two.freedom("cart", "G", driven=False, speed=second["speed"])
    two.freedom("flange", "H", driven=True, speed=first["speed"]).mechanism()
    return System(
        title=name,
        parts={"one": PartTable(case=f"{name}-one"), "two": PartTable(case=f"{name}-two")},
        connections={
            End("two", "drive.speed"): End("one", "cart.velocity"),
            End("two", "drive.acceleration"): End("one", "cart.acceleration"),
            End("one", "cart.force"): End("two", "link.exerted_force"),
        },
        folder=tmp_path,
    )


def of_carts(
    masses: tuple[float, float], springs: tuple[float, ...], dampers: tuple[float, ...], start: Any, times: Any
) -> NDArray[np.float64]:
    """Positions and speeds of two carts over time by the matrix exponential."""
    inverse, (k1, k, k2), (c1, c, c2) = np.diag(1.0 / np.array(masses)), springs, dampers
    matrix = np.zeros((4, 4))
    matrix[:2, 2:] = np.eye(2)
    matrix[2:, :2] = -inverse @ [[k1 + k, -k], [-k, k2 + k]]
    matrix[2:, 2:] = -inverse @ [[c1 + c, -c], [-c, c2 + c]]
    return np.array([scipy.linalg.expm(matrix * t) @ start for t in times])


@pytest.mark.parametrize("damping", [0.0, 0.01])
def test_the_linear_oscillator_of_a_published_benchmark(tmp_path: Path, damping: float) -> None:
    """Both cases, over 10 s at the benchmark's step of 1 ms and at ten times that, against the solution in closed form."""
    springs, mass, speed, end = OSCILLATORS
    k1, k, k2 = springs
    first = {"mass": mass, "speed": speed, "spring": {"stiffness": k1, "damping": damping}}
    second = {"mass": mass, "speed": -speed, "spring": {"stiffness": k2, "damping": damping}}
    system = carts(tmp_path, f"oscillators{1e3 * damping:.0f}", first, second, {"stiffness": k, "damping": damping})
    start = np.array([0.0, 0.0, speed, -speed])
    errors = {}
    for step in (1e-2, 1e-3):
        times = np.arange(round(end / step) + 1) * step
        right = of_carts((mass, mass), springs, (damping,) * 3, start, times[::10])
        for coupling in ("hold", "derivatives"):
            chosen = system if coupling == "derivatives" else system.without_rates()
            run = run_system(chosen.wiring(), coupling=coupling, step=step, stop_time=end)
            found = np.column_stack([run["one.cart.position"], run["two.cart.position"]])[::10]
            errors[coupling, step] = np.abs(found - right[:, :2]).max() / np.abs(right[:, :2]).max()
    assert errors["derivatives", 1e-3] < 2.5e-3
    assert errors["derivatives", 1e-2] / errors["derivatives", 1e-3] == pytest.approx(100.0, rel=0.4)
    # held inputs bring in energy: without losses the motion grows
    assert errors["hold", 1e-3] > 20.0 * errors["derivatives", 1e-3]


def test_steps_chosen_by_the_power_bond_on_the_published_quarter_car(tmp_path: Path) -> None:
    """The quarter car of Sadjina et al., with the numbers of libcosim's example, against as many equal steps.

    The transient of the wheel gains much; over the whole run the greatest error falls, the mean error hardly.
    """
    first = {"mass": 400.0, "speed": 0.0, "spring": {"stiffness": 0.0, "damping": 1e-9}}
    # the road lies 0.1 m higher from the start on
    second = {"mass": 40.0, "speed": 0.0, "spring": {"stiffness": 15e4, "free": 0.1}}
    system = carts(tmp_path, "quarter", first, second, {"stiffness": 15e3, "damping": 1e3})
    wiring = system.without_rates().wiring()
    rest = np.array([0.1, 0.1, 0.0, 0.0])

    def error(run: SystemRun) -> tuple[NDArray[np.float64], float, float]:
        right = rest + of_carts((400.0, 40.0), (0.0, 15e3, 15e4), (0.0, 1e3, 0.0), -rest, run.time)
        found = np.column_stack([run["one.cart.velocity"], run["two.cart.velocity"]])
        worst = np.abs(found - right[:, 2:]).max(axis=1)
        mean = float(np.sqrt(np.diff(run.time) @ worst[1:] ** 2 / run.time[-1]))
        return worst[run.time < 0.05].max(), worst.max(), mean

    chosen = run_system(wiring, step=1e-4, stop_time=4.0, share=2e-2)
    assert chosen.time[-1] == 4.0
    assert np.diff(chosen.time).max() > 5.0 * np.diff(chosen.time).min()
    equal = run_system(wiring, step=4.0 / (len(chosen) - 1), stop_time=4.0)
    assert len(equal) == len(chosen)
    at_once, worst, mean = np.array(error(chosen)) / np.array(error(equal))
    assert at_once < 0.25
    assert worst < 0.85
    assert mean < 1.05


def test_the_step_that_is_advised_brings_in_what_was_asked_for() -> None:
    for coupling in ("hold", "derivatives"):
        run = run_system(wiring_of("press"), coupling=coupling, step=5e-4, stop_time=0.1)
        step = run.suggested_step(2e-3)
        assert step is not None
        again = run_system(wiring_of("press"), coupling=coupling, step=step, stop_time=0.1)
        assert again.added_work() == pytest.approx(2e-3, rel=0.3)
    run = run_system(wiring_of("press"), coupling="rollback", step="1 ms", stop_time="0.01 s")
    assert run.suggested_step(1e-3) is None


def test_parts_of_fmi_3_have_lines_by_their_middle_and_updates_within_long_steps() -> None:
    system = system_of("motor-crank")
    wiring, right = system.wiring(fmi=3), JoinedSystem(system).run(0.05, 1e-3)

    def error(coupling: str, step: float) -> float:
        run = run_system(wiring, coupling=coupling, step=step, stop_time=0.05)
        every = round(1e-3 / step)
        return float(np.abs(run["linkage.crank.speed"][::every] - right["linkage.crank.speed"]).max())

    assert error("derivatives", 1e-3) / error("derivatives", 2.5e-4) == pytest.approx(16.0, rel=0.3)
    # a step that a part takes in one has no update: its inputs are held
    assert error("updates", 1e-3) / error("updates", 2.5e-4) == pytest.approx(4.0, rel=0.3)


def test_power_residuals_are_the_work_that_the_coupling_brings_in(tmp_path: Path) -> None:
    """Two oscillators without losses gain what the coupling adds."""
    free = {"mass": 1.0, "speed": 0.1, "spring": {"stiffness": 0.0, "damping": 1e-12}}
    system = carts(tmp_path, "gaining", free, free | {"speed": -0.1}, {"stiffness": 100.0})
    run = run_system(system.without_rates().wiring(), step=1e-3, stop_time=0.5)
    (power,) = run.powers.values()
    energy = run["one.energy.kinetic"] + run["two.energy.kinetic"] + run["two.energy.potential"]
    assert energy[-1] > 1.001 * energy[0]
    assert energy[-1] - energy[0] == pytest.approx(0.5e-3 * power.sum(), rel=0.02)
    better = run_system(system.wiring(), coupling="derivatives", step=1e-3, stop_time=0.5)
    assert better.added_work() < 0.02 * run.added_work()


@pytest.mark.parametrize("coupling", COUPLINGS)
def test_a_refused_step_ends_the_run_and_keeps_what_was_there(coupling: str) -> None:
    system = system_of("slider-tracking")
    far = {**system.parts["reference"].values, "motion_cos_2": "500 mm"}
    strong = {**system.parts["controller"].values, "limit": "100 kN"}
    given = {"reference": far, "controller": strong}
    parts = system.parts | {name: replace(system.parts[name], values=values) for name, values in given.items()}
    run = run_system(replace(system, parts=parts).wiring(), coupling=coupling)
    assert run.status == 3
    assert "linkage refused the step from t = " in run.message
    assert "limit of assembly" in run.message
    assert 1 < len(run) < 2001
    assert np.isfinite(run["linkage.slider.position"]).all()


@pytest.mark.parametrize("step", [3e-3, 4e-3, 6e-3])
def test_steps_that_do_not_fill_the_run_end_with_a_shorter_one(step: float, monkeypatch: pytest.MonkeyPatch) -> None:
    wiring = wiring_of("motor-crank")
    run = run_system(wiring, step=step, stop_time=0.01)
    assert run.time == pytest.approx([*np.arange(0.0, 0.01, step), 0.01], abs=1e-15)
    interface = wiring.parts["motor"].description.coSimulation
    monkeypatch.setattr(interface, "canHandleVariableCommunicationStepSize", False)
    with pytest.raises(InputError, match="motor accepts only equal communication steps"):
        run_system(wiring, step=step, stop_time=0.01)
    assert len(run_system(wiring, step=5e-3, stop_time=0.01)) == 3


def test_wrong_arguments_are_refused() -> None:
    wiring = wiring_of("motor-crank")
    refused(UnknownNameError, "rollback", run_system, wiring, coupling="roll")
    refused(InputError, r"wiring is System: give .*wiring\(\)", run_system, system_of("motor-crank"))
    for step, stop_time in ((2.0, 1.0), (0.0, 1.0), (1e-3, inf)):
        refused(InputError, "communication step", run_system, wiring, step=step, stop_time=stop_time)
    refused(InputError, "does not divide", convergence, system_of("motor-crank"), [1e-3, 4e-4], stop_time=0.1)
    refused(InputError, "the system has 0 power bonds", run_system, wiring_of("slider-tracking"), share=1e-3)
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


def test_a_loop_is_solved_apart_from_what_is_connected_to_it() -> None:
    """Of five outputs the second and third are a loop; what comes before and after it need not be linear."""
    x, *w = casadi.vertsplit(casadi.SX.sym("w", 6))
    values = [w[3] ** 2 + w[1], w[4] ** 3 + 0.5 * w[2], w[1], w[2] ** 2, casadi.sin(x)]
    solve = JoinedSystem._solve_connections
    found = casadi.Function("found", [x], [solve(None, casadi, w, values)])(0.7)  # type: ignore[arg-type]
    loop = 2.0 * np.sin(0.7) ** 3
    np.testing.assert_allclose(found.full().ravel(), [loop**4 + loop, loop, loop, loop**2, np.sin(0.7)], rtol=1e-14)
    with pytest.raises(WiringError, match="not linear"):
        solve(None, casadi, w[:1], [w[0] ** 2])  # type: ignore[arg-type]


def test_an_algebraic_loop_is_settled_at_the_start_and_joined_to_one_model() -> None:
    """A wheel on a spring, and a load that it drives: torque against acceleration, and not linear in the speed."""
    wheel = linkage("loop-wheel", ground={"A": (0, 0)}).body(
        "wheel", points={"A": (0, 0)}, mass="1 kg", inertia="0.05 kg*m^2"
    )
    wheel.spring("k", at="A", stiffness="30 N*m/rad").freedom("wheel", "A", start="0.2 rad").mechanism()
    load = linkage("loop-load", ground={"A": (0, 0)}).body(
        "load", points={"A": (0, 0)}, mass="1 kg", inertia="0.02 kg*m^2"
    )
    load.spring("fan", at="A", law="0.01*v**3").freedom("load", "A").mechanism()
    wires = {
        End("wheel", "drive.torque"): End("load", "drive.applied_torque"),
        End("load", "drive.speed"): End("wheel", "wheel.speed"),
        End("load", "drive.acceleration"): End("wheel", "wheel.acceleration"),
    }
    system = System(
        parts={"wheel": PartTable(case="loop-wheel"), "load": PartTable(case="loop-load")}, connections=wires
    )
    for run in (run_system(system.wiring(), stop_time=2e-3), JoinedSystem(system).run(2e-3, 1e-3)):
        # the torque of the load acts with the sign of its drive: the inertias subtract
        assert run["wheel.wheel.acceleration"][0] == pytest.approx(-30.0 * 0.2 / (0.05 - 0.02), rel=1e-12)
