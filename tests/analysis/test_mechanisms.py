"""Adding a mechanism is adding a folder and one line: two of the tests' own, of two freedoms and of one, through everything."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import cos, hypot, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from analysis import Inputs, compare, cosimulate, simulate
from analysis.export import build
from analysis.mechanisms import MECHANISMS
from linkwork.mechanism import Mechanism
from tests.mechanisms import pendulum, rotor_on_cart

ROTOR, PENDULUM = rotor_on_cart.MECHANISM, pendulum.MECHANISM


@pytest.fixture(autouse=True, scope="module")
def registered() -> Iterator[None]:
    """The one line."""
    for mechanism in (ROTOR, PENDULUM):
        MECHANISMS[mechanism.name] = mechanism
    yield
    for mechanism in (ROTOR, PENDULUM):
        del MECHANISMS[mechanism.name]


def demo(mechanism: Mechanism) -> Any:
    return next(iter(mechanism.published.values()))


#: How each is driven: mechanism, inputs.
DRIVES = {
    "rotor at a speed": (ROTOR, {"speed": 20.0}),
    "rotor under a torque": (ROTOR, {"torque": 0.5, "force": 2.0}),
    "pendulum": (PENDULUM, {"torque": 0.3}),
}


@pytest.fixture(params=DRIVES)
def driven(request: pytest.FixtureRequest) -> tuple[Mechanism, Any, Inputs]:
    mechanism, channels = DRIVES[request.param]
    return mechanism, demo(mechanism), Inputs(**channels)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("fmus")
    return {mechanism.name: build(mechanism, folder) for mechanism in (ROTOR, PENDULUM)}


def test_each_folder_is_short() -> None:
    for package in (rotor_on_cart, pendulum):
        folder = Path(str(package.__file__)).parent
        assert sum(len(path.read_text().splitlines()) for path in folder.glob("*.py")) < 250


def right_side(mechanism: Mechanism, p: Any, channels: dict[str, float]) -> Any:
    """The equations of motion solved by NumPy as a linear system of accelerations: written for the tests alone."""
    if mechanism is PENDULUM:
        torque = channels["torque"]
        return lambda t, x: [x[1], (torque - p.weight * cos(x[0]) - p.damping * x[1]) / p.inertia]

    def rotor(t: float, x: Any) -> Any:
        th, s, w, v = x
        m12 = -p.unbalance * sin(th)
        matrix = np.array([[p.inertia, m12, -1.0], [m12, p.mass, 0.0], [1.0, 0.0, 0.0]])
        force = channels.get("force", 0.0) - p.k * s - p.c * v + p.unbalance * cos(th) * w * w
        right = np.array([-p.weight * cos(th), force, 0.0])
        if "torque" in channels:
            matrix[2] = 0.0, 0.0, 1.0
            right[2] = channels["torque"]
        e, a, _ = np.linalg.solve(matrix, right)
        return [w, v, e, a]

    return rotor


def test_compiled_runs_are_those_of_scipy_on_other_equations(driven: tuple[Mechanism, Any, Inputs]) -> None:
    mechanism, published, inputs = driven
    run = simulate(published.parameters, inputs, initial=published.initial, stop_time=1.0, step=0.01, tolerance=1e-11)
    names = [f.coordinate for f in mechanism.freedoms] + [f.rate for f in mechanism.freedoms]
    start = mechanism.state(published.initial)[:-2]
    own = solve_ivp(
        right_side(mechanism, published.parameters.constants(), {name: getattr(inputs, name) for name in inputs}),
        (0.0, 1.0),
        start,
        t_eval=run.time,
        rtol=1e-12,
        atol=1e-12,
        method="DOP853",
    )
    assert run.status == 0
    for name, column in zip(names, own.y):
        np.testing.assert_allclose(run[name], column, atol=1e-8 * max(1.0, np.abs(column).max()))
    assert np.abs(run["energy.residual"]).max() < 1e-8


def test_fmu_is_valid_and_does_as_the_solver(driven: tuple[Mechanism, Any, Inputs], fmus: dict[str, Path]) -> None:
    mechanism, published, inputs = driven
    fmu = fmus[mechanism.name]
    assert validate_fmu(str(fmu)) == []
    times: dict[str, Any] = {"initial": published.initial, "stop_time": 0.3, "step": 1e-3}
    through = cosimulate(fmu, published.parameters, inputs, **times)
    within = simulate(published.parameters, inputs, hold=1e-3, **times)
    assert through.names == mechanism.output_names
    assert compare(within, through, tolerance=1e-11).agrees


def test_fmu_runs_through_fmpy_alone(fmus: dict[str, Path]) -> None:
    result = simulate_fmu(str(fmus["rotor-on-cart"]), stop_time=0.1, step_size=1e-3, output_interval=1e-3)
    assert len(result) == 101


def test_jump_of_the_speed_conserves_the_momentum_of_the_cart() -> None:
    published = demo(ROTOR)
    p = published.parameters.constants()
    run = simulate(
        published.parameters,
        Inputs(speed=_step(20.0, 25.0, 0.5)),
        initial=published.initial,
        stop_time=1.0,
        step=0.5,
        samples=[0.0, 0.5 - 1e-12, 0.5, 1.0],
    )

    def momentum(n: int) -> float:
        v, th, w = (run[name][n] for name in ("cart.velocity", "rotor.angle", "rotor.speed"))
        return float(p.mass * v - p.unbalance * sin(th) * w)

    assert run["rotor.speed"][1:3] == pytest.approx([20.0, 25.0])
    assert momentum(1) == pytest.approx(momentum(2), abs=1e-9)
    assert run["cart.velocity"][1] != pytest.approx(run["cart.velocity"][2], abs=1e-3)


def _step(low: float, high: float, time: float) -> Any:
    from analysis import steps

    return steps([0.0, time], [low, high])


def test_slow_rotor_shakes_the_cart_as_a_harmonic_force_would() -> None:
    """At constant speed the cart is a driven oscillator: amplitude m l w2 / |k - M w2 + i c w|."""
    published = demo(ROTOR)
    p, w = published.parameters.constants(), 20.0
    run = simulate(published.parameters, Inputs(speed=w), initial=published.initial, stop_time=60 * pi, step=0.01)
    late = run["cart.position"][-2000:]
    assert np.ptp(late) / 2.0 == pytest.approx(p.unbalance * w * w / hypot(p.k - p.mass * w * w, p.c * w), rel=1e-4)


def test_parameters_and_states_are_named_after_the_interface() -> None:
    for mechanism in (ROTOR, PENDULUM):
        fields = {name.replace(".", "_", 1) for name in mechanism.mechanism_variables}
        assert fields == set(asdict(demo(mechanism).parameters))
        assert set(mechanism.initial_variables) == set(asdict(demo(mechanism).initial))


def test_inputs_of_another_mechanism_are_refused() -> None:
    from linkwork.errors import InputError

    with pytest.raises(InputError, match="a pendulum has no input 'force': its inputs are torque"):
        simulate(demo(PENDULUM).parameters, Inputs(force=1.0), stop_time=0.1)
