"""Slider-force control: designs against what defines them, loops against their linear prediction and the FMU."""

import re
from dataclasses import replace
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from analysis import Harmonics, Inputs, find_orbit, simulate, steps
from analysis import linear as lin
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import InputError, ParameterError, UnknownNameError
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests.refusals import refused

pytest.importorskip("casadi")

HELD = Inputs(speed=0.0)
WEIGHTS = {"slider.position": 1e6, "slider.velocity": 1e2}


@pytest.fixture(scope="module")
def rest():
    return lin.find_equilibrium(TABLE_3_1, held={"crank.angle": 0.5})


@pytest.fixture(scope="module")
def held(rest):
    """Table 3.1 with the crank held: one freedom."""
    return lin.linearise(TABLE_3_1, rest.state, rest.inputs)


@pytest.fixture(scope="module")
def hanging():
    """Table 3.1 with the crank free."""
    rest = lin.find_equilibrium(TABLE_3_1)
    return lin.linearise(TABLE_3_1, rest.state, rest.inputs)


def start(model, *deviation: float) -> InitialState:
    th2, u, w2, v = (model.state[:4] + np.array(deviation or (0.0,) * 4)).tolist()
    return InitialState(crank_angle=th2, slider_position=u, crank_speed=w2, slider_velocity=v)


# designs


@pytest.mark.parametrize("integral", [0.0, 1e8])
@pytest.mark.parametrize("which", ["held", "hanging"])
def test_lqr_keeps_its_return_difference(which, integral, request) -> None:
    """Kalman's inequality |1 + L| >= 1 holds for LQR alone; it makes the margins 60 deg and infinite."""
    model = request.getfixturevalue(which)
    design = lin.design_lqr(model, {"slider.position": 1e6, "slider.velocity": 50.0}, 0.3, integral=integral)
    loop = design.loop(1j * np.geomspace(1e-2, 1e5, 2000))
    assert np.abs(1.0 + loop).min() >= 1.0 - 1e-6
    assert np.abs(1.0 + loop).min() < 1.001
    assert design.gain_margin == inf
    assert design.phase_margin >= pi / 3.0 - 1e-6
    assert (design.integral_gain != 0.0) == (integral != 0.0)
    assert design.poles.real.max() < 0.0


#: Weights of the control that keeps the crank upright.
BALANCE = {"crank.angle": 1e2, "slider.position": 1e6}


def upright_crank() -> tuple[lin.Equilibrium, lin.LinearModel]:
    """The unstable equilibrium without a drive, and its linear model."""
    upright = next(one for one in lin.find_equilibria(TABLE_3_1) if not one.stable)
    return upright, lin.linearise(TABLE_3_1, upright.state, upright.inputs)


def test_lqr_of_a_heavy_force_only_moves_the_unstable_poles() -> None:
    """With no weight but on the force the stable poles stay and the unstable one is mirrored."""
    _, model = upright_crank()
    design = lin.design_lqr(model, np.full(4, 1e-9), 1e3)
    mirrored = np.where(model.poles.real > 0.0, -model.poles.conj(), model.poles)
    # of the two nearly equal real poles the product and sum are what is determined
    assert np.poly(design.poles) == pytest.approx(np.poly(mirrored), rel=1e-6)


def test_lqr_of_a_velocity_alone_has_an_infinite_gain_margin(held) -> None:
    """The gain of the position is a rounding error of either sign; where the loop has only this gain, nothing is crossed."""
    designs = [lin.design_lqr(held, {"slider.velocity": weight}) for weight in np.geomspace(1.0, 1e8, 17)]
    assert {design.gain_margin for design in designs} == {inf}


def test_lqr_weighs_outputs(hanging) -> None:
    """H' H has zeros as eigenvalues, rounded to either side; x' Q x is that of the symmetric part of Q."""
    rows = np.random.default_rng(0).normal(size=(8, 1, 4)) * [1.0, 30.0, 0.3, 10.0]
    for h in rows:
        design = lin.design_lqr(hanging, 1e6 * h.T @ h)
        skew = np.triu(np.ones((4, 4)), 1)
        assert lin.design_lqr(hanging, 1e6 * h.T @ h + skew - skew.T).gains == pytest.approx(design.gains, rel=1e-6)


def test_pid_has_the_poles_asked_for(held) -> None:
    wanted = [-50.0, -30.0 + 40.0j, -30.0 - 40.0j]
    design = lin.design_pid(held, poles=wanted)
    assert np.sort_complex(design.poles) == pytest.approx(np.sort_complex(np.array(wanted)), rel=1e-8)
    assert np.abs(lin.design_pid(held, bandwidth=80.0, damping=0.6).poles) == pytest.approx([80.0] * 3, rel=1e-8)
    # all of it is shown in a line
    assert repr(design).startswith("<PID from slider.force to slider.position: gains ")
    assert repr(held).startswith("<LinearModel of five-bar: states slider.position, slider.velocity; inputs")
    assert repr(held.mechanism).startswith("<mechanism five-bar: freedoms crank.angle, slider.position; inputs")
    assert lin.design_pid(held, bandwidth=80.0, damping=1.0).poles == pytest.approx([-80.0] * 3, rel=1e-4)


def test_pi_has_the_crossover_and_phase_asked_for(held) -> None:
    design = lin.design_pi(held, bandwidth=12.0, phase_margin=1.1)
    at = complex(design.loop(12.0j))
    assert abs(at) == pytest.approx(1.0, rel=1e-9)
    assert np.angle(-at) >= 1.1 - 1e-9
    assert (design.crossover, design.delay_margin) == pytest.approx((12.0, design.phase_margin / 12.0), rel=1e-6)
    # nearer to the resonance the lag of the integral alone is too much, and the margin is just that asked for
    fast = lin.design_pi(held, bandwidth=30.0, phase_margin=1.1)
    assert fast.gains[0] > 0.0
    assert np.angle(-complex(fast.loop(30.0j))) == pytest.approx(1.1, rel=1e-9)
    assert fast.phase_margin == pytest.approx(1.1, rel=1e-6)


def test_amounts_are_texts_with_units_and_a_name_stands_alone(held) -> None:
    design = lin.design_pid(held, bandwidth=80.0)
    words, numbers = (
        lin.SampledController(design, "1 ms", limit="20 N"),
        lin.SampledController(design, 1e-3, limit=20.0),
    )
    runs = [
        lin.predict_loop(held, one, where, stop_time=0.02) for one, where in ((words, "5 mm"), (numbers, 5e-3))
    ]  # fmt: skip
    assert np.array_equal(runs[0].force, runs[1].force)
    metrics = runs[0].metrics(band="1 mm", start="5 ms", window="4 ms")
    assert metrics == runs[0].metrics(band=1e-3, start=5e-3, window=4e-3)
    assert np.array_equal(design.sampled_poles("1 ms"), design.sampled_poles(1e-3))
    with pytest.raises(ParameterError, match="limit is '20 mm': it must be a number in N"):
        lin.SampledController(design, 1e-3, limit="20 mm")
    assert design.closed_loop("slider.position").output_labels == ["slider_position"]
    assert held.to_state_space("slider.position", "slider.force").input_labels == ["slider_force"]


def test_the_band_of_an_angle_is_an_angle(hanging) -> None:
    design = lin.design_lqr(hanging, {"crank.angle": 1e2, "slider.position": 1e6}, channel="drive.torque")
    loop = lin.predict_loop(hanging, lin.SampledController(design, "2 ms"), 0.1 + hanging.state[0], stop_time=0.5)
    assert loop.metrics(band="1 deg") == loop.metrics(band=pi / 180.0)
    refused(ParameterError, "band is '1 mm': it must be a number in rad", loop.metrics, band="1 mm")
    refused(InputError, "band of settling is 0 rad", loop.metrics, band=0)


def test_the_closed_loop_has_the_poles_and_no_static_error(held) -> None:
    design = lin.design_pid(held, bandwidth=80.0)
    closed = design.closed_loop(("slider.position", "slider.acceleration"))
    assert np.sort_complex(closed.poles()) == pytest.approx(np.sort_complex(design.poles), rel=1e-8)
    assert abs(complex(closed[0, 0](0.0))) < 1e-12
    lqr = lin.design_lqr(held, WEIGHTS)
    assert complex(lqr.closed_loop()(0.0)).real == pytest.approx(1.0 / (held.K[0, 0] + lqr.gains[0]), rel=1e-10)


def test_designs_that_cannot_be(held, hanging) -> None:
    refused(lin.DesignError, "design_pid", lin.design_pi, held, bandwidth=60.0)
    refused(lin.DesignError, "phase margin is 4", lin.design_pi, held, bandwidth=3.0, phase_margin=4.0)
    refused(lin.DesignError, "bandwidth is -1", lin.design_pi, held, bandwidth=-1.0)
    refused(lin.DesignError, "design_lqr", lin.design_pid, hanging, bandwidth=50.0)
    refused(lin.DesignError, r"poles.*bandwidth", lin.design_pid, held)
    refused(lin.DesignError, "damping is 0", lin.design_pid, held, bandwidth=1.0, damping=0.0)
    for poles in ([-1.0, -2.0], [-1.0, -2.0 + 1.0j, -2.0], [1.0, -2.0, -3.0], ["-1 1/s"] * 3):
        refused(lin.DesignError, "poles", lin.design_pid, held, poles=poles)
    refused(UnknownNameError, r"crank\.speed", lin.design_lqr, held, {"crank.speed": 1.0})
    refused(lin.DesignError, "shape", lin.design_lqr, held, [1.0, 2.0, 3.0])
    refused(lin.DesignError, "weights", lin.design_lqr, held, [1.0, -2.0])
    refused(lin.DesignError, "force is 0", lin.design_lqr, held, WEIGHTS, 0.0)
    turning = lin.linearise(TABLE_3_1, (0.0, 0.0, 40.0, 0.0))
    with pytest.raises(lin.DesignError, match=r"crank\.angle is free and turns at 40 rad/s"):
        lin.design_lqr(turning, {"slider.position": 1e6, "crank.angle": 1.0})
    refused(lin.DesignError, "integral is -1", lin.design_lqr, held, WEIGHTS, integral=-1.0)


def test_a_crank_that_no_slider_force_holds_is_reported() -> None:
    """Without gravity a free crank turns as it likes: its double pole at zero is out of the slider's reach, or nearly."""
    horizontal = SETS["rig-2-spring-c"].parameters
    rest = lin.find_equilibrium(horizontal, guess=(0.0, 0.0))
    with pytest.raises(lin.DesignError):
        lin.design_lqr(lin.linearise(horizontal, rest.state, rest.inputs), WEIGHTS)


@pytest.mark.parametrize(("damping", "bandwidth", "reason"), [(30.0, 35.0, "design_pid"), (5.5, 6.0, "not stable")])
def test_a_pi_near_a_light_resonance_is_refused(damping, bandwidth, reason) -> None:
    p = replace(SETS["rig-2-spring-c"].parameters, slider_damping=damping)
    rest = lin.find_equilibrium(p, held={"crank.angle": 0.0})
    with pytest.raises(lin.DesignError, match=reason):
        lin.design_pi(lin.linearise(p, rest.state, rest.inputs), bandwidth=bandwidth)


# loops


def test_the_predicted_loop_is_the_sampled_one_in_closed_form(held) -> None:
    design = lin.design_pid(held, bandwidth=80.0)
    h, steps = 2e-3, 60
    controller = lin.SampledController(design, h)
    run = lin.predict_loop(held, controller, float(held.state[1]), stop_time=steps * h, deviation=[1e-3, 0.0])
    whole = expm(h * np.block([[held.A, held.B[:, :1]], [np.zeros((1, 3))]]))
    x, total = np.array([1e-3, 0.0]), 0.0
    for measured, force in zip(run.states, run.force):
        assert measured[[1, 3]] - held.state[[1, 3]] == pytest.approx(x, rel=1e-6, abs=1e-8)
        f = -design.gains @ x - design.integral_gain * total
        assert force == pytest.approx(f, rel=1e-6, abs=1e-4)
        total += h * x[0]
        x = whole[:2, :2] @ x + whole[:2, 2] * f
    # and dies out as the slowest of the sampled poles says
    z = np.abs(design.sampled_poles(h))
    late = np.abs(run.position - held.state[1])
    assert late[-20:].max() < 3.0 * 1e-3 * z[-1] ** (steps - 20)


def test_sampled_poles_tell_a_period_that_is_too_long(held) -> None:
    design = lin.design_pid(held, bandwidth=150.0)
    assert np.abs(design.sampled_poles(1e-3)).max() < 1.0
    slow = 3.0 * design.delay_margin
    assert np.abs(design.sampled_poles(slow)).max() > 1.0
    fast = design.sampled_poles(1e-6)
    assert np.sort_complex(np.log(fast) / 1e-6) == pytest.approx(np.sort_complex(design.poles), rel=1e-3)


@pytest.mark.parametrize("which", ["held", "hanging"])
def test_the_loop_is_the_predicted_one_to_first_order(which, request) -> None:
    model = request.getfixturevalue(which)
    design = lin.design_lqr(model, {"slider.position": 1e6, "slider.velocity": 10.0}, 1.0, integral=1e7)
    controller = lin.SampledController(design, 2e-3)
    errors = []
    for size in (4e-3, 4e-4):
        target = float(model.state[1]) + size
        loop = lin.control_loop(
            TABLE_3_1, controller, target, HELD if which == "held" else None, initial=start(model), stop_time=0.5,
            tolerance=1e-12,
        )  # fmt: skip
        linear = lin.predict_loop(model, controller, target, stop_time=0.5)
        errors.append(lin.largest_difference(loop, linear))
        assert np.abs(loop.position - model.state[1]).max() > 0.9 * size
    # with the square of the amplitude
    assert errors[1] < 0.03 * errors[0]
    assert errors[0] < 0.1 * 4e-3


def test_the_integral_takes_a_load_away(held) -> None:
    # at C: the crank pin, where P is by default, does not move
    tip = replace(TABLE_3_1, coupler_point_distance=0.15)
    errors = []
    for integral in (0.0, 1e9):
        design = lin.design_lqr(held, WEIGHTS, integral=integral)
        loop = lin.control_loop(
            tip, lin.SampledController(design, 2e-3), float(held.state[1]), HELD.replace(load_x=steps([0.0, 0.1], [0.0, 3.0])),
            initial=start(held), stop_time=1.5,
        )  # fmt: skip
        errors.append(abs(float(loop.position[-1] - held.state[1])))
        assert loop.trajectory["slider.position"] == pytest.approx(loop.position)
    assert errors[0] > 1e-4
    assert errors[1] < 1e-8


def test_a_limited_force_is_kept_and_does_not_wind_up(held) -> None:
    design = lin.design_pid(held, bandwidth=100.0)
    target = float(held.state[1]) + 0.02
    runs = {}
    for limit in (25.0, inf):
        controller = lin.SampledController(design, 1e-3, limit=limit)
        loop = lin.control_loop(TABLE_3_1, controller, target, HELD, initial=start(held), stop_time=1.0)
        runs[limit] = loop.metrics(band=1e-4)
        assert loop.metrics(band=1e-4).rms_error < 1e-6
    assert runs[25.0].peak_force == 25.0
    assert runs[inf].peak_force > 200.0
    # 0.40 if the integral grew on at the limit
    assert runs[25.0].overshoot < 0.1


def test_a_torque_under_control_takes_the_place_of_a_published_speed() -> None:
    rest = lin.find_equilibrium("rahman-a4-10-s1-3.5", Inputs(torque=0.0))
    design = lin.design_pid(lin.linearise("rahman-a4-10-s1-3.5", rest.state, rest.inputs), bandwidth=20.0)
    controller = lin.SampledController(design, 2e-3)
    loop = lin.control_loop("rahman-a4-10-s1-3.5", controller, "2 deg", initial=rest.initial, stop_time=1.5)
    assert loop.position[-1] == pytest.approx(np.radians(2.0), rel=1e-4)


def test_the_slider_force_balances_the_crank() -> None:
    upright, model = upright_crank()
    lean = start(model, 0.02, 0.0, 0.0, 0.0)
    controller = lin.SampledController(lin.design_lqr(model, BALANCE), 2e-3)
    loop = lin.control_loop(TABLE_3_1, controller, upright["slider.position"], initial=lean, stop_time=2.0)
    assert abs(loop.states[-1, 0] - upright["crank.angle"]) < 1e-5
    fallen = simulate(TABLE_3_1, initial=lean, stop_time=2.0, step=1e-2)
    assert np.abs(fallen["crank.angle"] - upright["crank.angle"]).max() > 1.0


def test_a_loop_that_loses_the_assembly_ends_there() -> None:
    upright, model = upright_crank()
    lean = start(model, 0.3, 0.0, 0.0, 0.0)
    controller = lin.SampledController(lin.design_lqr(model, BALANCE), 1e-3)
    loop = lin.control_loop(TABLE_3_1, controller, upright["slider.position"], initial=lean, stop_time=1.0)
    assert loop.status == loop.trajectory.status == 3
    assert "limit of assembly" in loop.message
    assert 10 < len(loop.time) == len(loop.states) == len(loop.trajectory) < 100
    with pytest.raises(InputError, match="reach its end"):
        loop.metrics(band=1e-3)


@pytest.fixture(scope="module")
def resonant():
    speed = 585.0 * RAD_S_PER_RPM
    p = SETS["rig-2-spring-c"].parameters
    turning = Inputs(speed=speed)
    return p, turning, lin.linearise_orbit(p, find_orbit(p, turning))


def test_the_slider_is_kept_still_at_resonance(resonant) -> None:
    p, turning, models = resonant
    mean = models.mean()
    middle = float(mean.state[1])
    controller = lin.SampledController(lin.design_pid(mean, bandwidth=150.0), 1e-3)
    th2, u, w2, v = models.states[0, :4].tolist()
    initial = InitialState(crank_angle=th2, slider_position=u, crank_speed=w2, slider_velocity=v)
    loop = lin.control_loop(p, controller, middle, turning, initial=initial, stop_time=0.5)
    periodic = lin.predict_loop(models, controller, middle, stop_time=0.5)
    averaged = lin.predict_loop(models, controller, middle, stop_time=0.5, averaged=True)
    reached = loop.metrics(band=1e-3, window=models.period).rms_error
    assert models.states[:, 1].std() > 100.0 * reached
    # the time-periodic model knows what the averaged one leaves out
    assert lin.largest_difference(loop, periodic) < 0.3 * lin.largest_difference(loop, averaged)
    assert lin.largest_difference(loop, periodic) < 1e-3 * np.ptp(models.states[:, 1])


def test_without_control_the_periodic_model_repeats_the_motion(resonant) -> None:
    p, turning, models = resonant
    none = {"gains": np.zeros(2), "integral_gain": 0.0, "force_slope": 0.0}
    idle = lin.SampledController(replace(lin.design_pid(models.mean(), bandwidth=50.0), **none), models.period / 100.0)
    run = lin.predict_loop(models, idle, 0.0, stop_time=2.0 * models.period)
    assert np.abs(run.force).max() == 0.0
    assert run.position[:100] == pytest.approx(run.position[100:200], abs=1e-12)
    motion = lin.linearise_orbit(p, find_orbit(p, turning), samples=100).states
    assert run.position[:100] == pytest.approx(motion[:, 1], abs=1e-8)


def test_the_loop_departs_from_a_motion_that_forces_drive() -> None:
    """Forces of the motion that act in the loop cause no deviation; the controller's force takes the place of the motion's."""
    p, speed = replace(TABLE_3_1, slider_damping=30.0), 20.0
    load = Inputs(speed=speed, load_y=Harmonics(0.0, [0.5], [speed], [0.3]))
    driven = load.replace(force=Harmonics(0.0, [0.05], [speed], [0.0]))
    period, samples = 2.0 * pi / speed, 32
    last = period * (10 + np.arange(samples) / samples)
    run = simulate(p, driven, samples=np.append(0.0, last), tolerance=1e-12)
    names = ("crank.angle", "slider.position", "crank.speed", "slider.velocity")
    states = np.column_stack([run[name][1:] for name in names])
    states[:, 0] -= 20.0 * pi
    models = lin.linearise_orbit(p, states, driven, period=period)
    none = {"gains": np.zeros(2), "integral_gain": 0.0, "force_slope": 0.0}
    idle = lin.SampledController(replace(lin.design_pid(models.mean(), bandwidth=50.0), **none), period / 100.0)
    th2, u, w2, v = states[0].tolist()
    initial = InitialState(crank_angle=th2, slider_position=u, crank_speed=w2, slider_velocity=v)
    loop = lin.control_loop(p, idle, 0.0, load, initial=initial, stop_time=period)
    departed = np.abs(loop.position - [models.motion()(t)[1] for t in loop.time]).max()
    linear = lin.predict_loop(models, idle, 0.0, stop_time=period)
    assert lin.largest_difference(loop, linear) < 0.02 * departed


def test_the_fmu_runs_the_same_loop(fmu, held) -> None:
    controller = lin.SampledController(lin.design_pid(held, bandwidth=60.0), 5e-3, limit=50.0)
    target = float(held.state[1]) + 5e-3
    options = {"inputs": HELD, "initial": start(held), "stop_time": 0.3}
    inside = lin.control_loop(TABLE_3_1, controller, target, **options)
    outside = lin.control_loop(TABLE_3_1, controller, target, fmu=fmu, **options)
    assert outside.states == pytest.approx(inside.states, abs=1e-12)
    assert outside.trajectory.values == pytest.approx(inside.trajectory.values, abs=1e-9)


def test_bad_loops_are_reported(held) -> None:
    design = lin.design_lqr(held, WEIGHTS)
    for period in (0.0, float("nan")):
        refused(InputError, "sampling period", lin.SampledController, design, period)
    refused(InputError, "limit of the force", lin.SampledController, design, 1e-3, limit=0.0)
    controller = lin.SampledController(design, 1e-2)
    with pytest.raises(InputError, match="force is among the inputs"):
        lin.control_loop(TABLE_3_1, controller, 0.0, Inputs(force=1.0), initial=InitialState(), stop_time=0.1)
    with pytest.raises(InputError, match=r"reference is nan m at t = 0\.05 s"):
        lin.control_loop(
            TABLE_3_1, controller, lambda t: 0.0 if t < 0.045 else float("nan"), initial=InitialState(), stop_time=0.1
        )
    with pytest.raises(ParameterError, match="reference is '2 deg'"):
        lin.predict_loop(held, controller, lambda t: "2 deg", stop_time=0.1)
    refused(InputError, "2 finite", lin.predict_loop, held, controller, 0.0, stop_time=0.1, deviation=[1.0])
    refused(InputError, "2 finite", lin.predict_loop, held, controller, 0.0, stop_time=0.1, deviation=["1 mm", 0.0])
    refused(InputError, "design is LinearModel", lin.SampledController, held, 1e-3)
    moving = lin.linearise(TABLE_3_1, (0.0, 0.0, 0.0, 0.5), HELD)
    refused(InputError, "PeriodicModel", lin.predict_loop, moving, controller, 0.0, stop_time=0.1)


def test_the_code_of_the_page_runs() -> None:
    page = (Path(__file__).parents[2] / "docs" / "linearisation.md").read_text(encoding="utf-8")
    space: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL):
        exec(block, space)
    assert space["metrics"].rms_error < 1e-4  # type: ignore[attr-defined]


# metrics


def result(position, reference=1.0) -> lin.LoopResult:
    n = len(position)
    states = np.zeros((n, 4))
    states[:, 1] = position
    of = {"force": np.linspace(-3.0, 2.0, n), "reference": np.full(n, reference)}
    return lin.LoopResult(time=0.1 * np.arange(n), states=states, **of)


def test_metrics_of_a_known_run() -> None:
    run = result([0.0, 0.5, 1.3, 0.9, 1.02, 0.99, 1.0, 1.01, 1.0, 0.99, 1.0])
    m = run.metrics(band=0.05, window=0.3)
    assert (m.settling_time, m.overshoot, m.peak_force) == pytest.approx((0.4, 0.3, 3.0))
    assert m.rms_error == pytest.approx(np.sqrt(1e-4 / 3.0))
    assert m.peak_error == pytest.approx(0.01)
    assert run.metrics(band=0.005).settling_time == pytest.approx(1.0)
    assert result([0.0, 0.5, 0.4]).metrics(band=0.05).settling_time is None
    assert result([1.0, 1.0, 1.0]).metrics(band=0.05).settling_time == 0.0
    # downwards, the other side is past it
    down = result([0.0, -0.5, -1.2, -1.0], reference=-1.0)
    assert down.metrics(band=0.05).overshoot == pytest.approx(0.2)


def test_bad_metrics_are_reported() -> None:
    run = result([0.0, 0.5, 1.0])
    refused(InputError, "band", run.metrics, band=0.0)
    refused(InputError, r"window of 5\.0", run.metrics, band=0.1, window=5.0)
    refused(InputError, r"start at 0\.2", run.metrics, band=0.1, start=0.2)
    refused(InputError, "3 and 2 samples", lin.largest_difference, run, result([0.0, 1.0]))
