"""Tracking of a slider motion: feed-forward, feedback, both, on plants that are and are not the model."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest

from analysis import Inputs, linear
from analysis.numerics.fourier import FourierSeries
from analysis.slider import TrackingController, inverse_dynamics, track
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests.refusals import refused

pytest.importorskip("casadi")

SPEED = SETS["rig-2-spring-c"].crank_speed
RIG = replace(SETS["rig-2-spring-c"].parameters, coupler_point_distance=0.2, coupler_point_angle=0.5)
MOTION = FourierSeries(np.array([0.002, 0.004, 0.001]), np.array([0.0, 0.003, -0.002]))
#: What the model does not know: friction in the guide, and masses that are 5 to 10 % off.
TRUE = replace(RIG, slider_coulomb_friction=3.0, coupler_mass=0.36, slider_mass=0.9)
PERIOD = 1e-3


def load(th2: float) -> tuple[float, float]:
    return 5.0 + 2.0 * np.cos(th2), 3.0 * np.sin(th2)


@pytest.fixture(scope="module")
def model():
    """The mean linear model along the reference."""
    return linear.linearise_orbit(RIG, inverse_dynamics(RIG, MOTION, SPEED)).mean()


@pytest.fixture(scope="module")
def pid(model):
    return linear.design_pid(model, bandwidth=150.0)


def run(
    model=RIG, motion=MOTION, *, period=PERIOD, design=None, feedforward=True, known=(0.0, 0.0), limit=inf, **options
):
    controller = TrackingController(
        model, motion, period, design=design, feedforward=feedforward, load=known, limit=limit
    )
    return track(controller, **{"crank_speed": SPEED} | options)


def test_the_feed_forward_error_goes_with_the_square_of_the_period() -> None:
    """A force held at its value in the middle of the period; with the one at its beginning it would go with the period."""
    errors = [run(period=h, tolerance=1e-12, revolutions=6).metrics().rms_error for h in (2e-3, 1e-3, 5e-4)]
    assert errors[0] < 3e-6
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx([4.0, 4.0], rel=0.02)


def test_the_known_load_is_fed_forward() -> None:
    known = run(load=load, known=load, tolerance=1e-12).metrics()
    unknown = run(load=load).metrics()
    assert known.rms_error < 1e-6
    assert unknown.rms_error > 300.0 * known.rms_error


def test_both_together_beat_either_alone(pid) -> None:
    """On a plant with friction, other masses and a load that the feed-forward knows nothing of."""
    wrong = {"plant": TRUE, "load": load, "revolutions": 5}
    kinds = ({}, {"design": pid, "feedforward": False}, {"design": pid})
    forward, back, both = (run(**wrong, **kind).metrics() for kind in kinds)
    assert both.rms_error < 5e-5
    assert forward.rms_error > 20.0 * both.rms_error
    assert back.rms_error > 6.0 * both.rms_error
    assert forward.rms_point_error > 20.0 * both.rms_point_error
    assert back.rms_point_error > 6.0 * both.rms_point_error
    # without the errors of the model, feedback has next to nothing left to do
    exact = run(design=pid, revolutions=5).metrics()
    assert run(design=pid, feedforward=False, revolutions=5).metrics().rms_error > 500.0 * exact.rms_error


def test_the_integral_takes_the_constant_part_away(model, pid) -> None:
    """A constant load that is not known: the mean error of a proportional law is F/(k + k_p), that of a PID none."""
    steady = {"load": (6.0, 0.0), "revolutions": 12}
    proportional = replace(pid, integral_gain=0.0)
    means = {}
    for name, design in (("none", None), ("PD", proportional), ("PID", pid)):
        result = run(design=design, **steady)
        last = result.loop.time > result.loop.time[-1] - 2.0 * pi / SPEED
        means[name] = abs(float(result.error[last].mean()))
    assert means["none"] > 3.0 * means["PD"] > 100.0 * means["PID"]
    assert means["PID"] < 1e-6


def test_an_error_at_the_start_dies_out(pid) -> None:
    off = InitialState(slider_position=float(MOTION(0.0)) + 2e-3, slider_velocity=0.0)
    result = run(design=pid, initial=off)
    assert result.error[0] == pytest.approx(2e-3)
    assert result.metrics().peak_error < 2e-6


def test_the_run_may_start_anywhere_and_go_backwards(pid) -> None:
    """The reference goes with the crank: turned by an angle it is followed as well, and in the other direction."""
    start = 1.3
    u, v = float(MOTION(start)), -SPEED * float(MOTION.derivative()(start))
    at = InitialState(crank_angle=start, slider_position=u, slider_velocity=v)
    result = run(crank_speed=-SPEED, design=pid, initial=at, revolutions=3)
    assert np.abs(result.error).max() < 2e-6
    assert result.loop.reference == pytest.approx(MOTION(start - SPEED * result.loop.time), abs=1e-12)


def test_the_result_says_what_happened(pid) -> None:
    result = run(design=pid, plant=TRUE, load=load, revolutions=2.5)
    loop = result.loop
    assert result.method == "feed-forward + PID"
    assert loop.trajectory.source.endswith("feed-forward + PID sampled")
    assert loop.time[-1] == pytest.approx(5.0 * pi / SPEED)
    p = RIG.constants()
    angles = loop.states[:, 0].tolist()
    wanted = [kinematics.coupler_point(kinematics.position(th2, float(MOTION(th2)), p), p) for th2 in angles]
    x, y = np.array(wanted).T
    distance = np.hypot(loop.trajectory["coupler.point.x"] - x, loop.trajectory["coupler.point.y"] - y)
    assert result.point_error == pytest.approx(distance, abs=1e-12)
    metrics = result.metrics()
    last = loop.time > loop.time[-1] - 2.0 * pi / SPEED * (1.0 - 1e-9)
    assert metrics.peak_error == np.abs(result.error[last]).max()
    assert metrics.rms_force == pytest.approx(np.sqrt(np.mean(loop.force[last] ** 2)))
    assert metrics.peak_force == np.abs(loop.force[last]).max()


def test_force_and_power_are_those_of_inverse_dynamics(pid) -> None:
    ideal = inverse_dynamics(RIG, MOTION, SPEED, samples=150)
    metrics = run(design=pid, period=ideal.period / 150).metrics()
    for name in ("rms_force", "peak_force", "mean_power", "peak_power"):
        assert getattr(metrics, name) == pytest.approx(getattr(ideal, name), rel=2e-3), name


def test_feedback_alone_holds_a_still_slider_as_the_control_loop_does(model) -> None:
    """A reference that stands still: the law is that of a `SampledController` as it is there."""
    still = FourierSeries.constant(0.003)
    design = linear.design_lqr(model, {"slider.position": 1e7, "slider.velocity": 1e2}, integral=1e9)
    start = InitialState(slider_position=0.0)
    result = run(RIG, still, design=design, feedforward=False, initial=start, revolutions=2)
    given = {"initial": start, "stop_time": 4.0 * pi / SPEED}
    loop = linear.control_loop(RIG, linear.SampledController(design, PERIOD), 0.003, Inputs(speed=SPEED), **given)
    # the mean velocity about which the design was made is zero but for rounding
    assert result.loop.states == pytest.approx(loop.states, abs=1e-9)
    assert result.loop.force == pytest.approx(loop.force, abs=1e-6)


def test_a_controller_starts_each_run_afresh(pid) -> None:
    controller = TrackingController(RIG, MOTION, "1 ms", design=pid, limit="2 kN")
    options = {"initial": InitialState(crank_speed=SPEED), "stop_time": 0.05}
    first, second = (linear.control_loop(RIG, controller, 0.0, Inputs(speed=SPEED), **options).force for _ in range(2))
    assert np.array_equal(first, second)


def test_the_limit_is_kept(pid) -> None:
    for design in (None, pid):
        result = run(design=design, limit=12.0, revolutions=2)
        assert np.abs(result.loop.force).max() == 12.0
    assert run(revolutions=2).metrics().peak_force > 20.0


def test_the_fmu_is_followed_as_the_plant_is(fmu, pid) -> None:
    options = {"design": pid, "plant": TRUE, "load": load, "period": 2e-3, "revolutions": 2}
    inside, outside = run(**options), run(**options, fmu=fmu)
    assert outside.loop.states == pytest.approx(inside.loop.states, abs=1e-11)
    assert outside.error == pytest.approx(inside.error, abs=1e-11)
    assert outside.point_error == pytest.approx(inside.point_error, abs=1e-11)
    assert outside.loop.force == pytest.approx(inside.loop.force, abs=1e-7)


def test_a_run_that_loses_the_assembly_ends_there() -> None:
    """Without damper and feedback, and the force off by the wrong spring, table 3.1 comes apart."""
    soft = replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=0.0)
    result = run(TABLE_3_1, MOTION, crank_speed=44.0, plant=soft)
    assert result.loop.status == 3
    assert len(result.error) == len(result.power) == len(result.point_error) == len(result.loop.time) < 1400
    with pytest.raises(InputError, match="reach its end"):
        result.metrics()


def test_bad_runs_are_told(pid) -> None:
    refused(InputError, "neither feed-forward nor feedback", run, feedforward=False)
    refused(InputError, "limit of the force is 0", run, limit=0.0)
    refused(InputError, "sampling period is 0", run, period=0.0)
    refused(InputError, "shorter than a turn", run(revolutions=0.5).metrics)
    refused(InputError, "-1 revolutions", run, revolutions=-1)
    refused(InputError, "crank speed is 0", run, crank_speed=0.0)
    refused(AssemblyError, "deg of the turn", run, RIG, MOTION * 100.0)
    rest = linear.find_equilibrium(TABLE_3_1)
    free = linear.design_lqr(
        linear.linearise(TABLE_3_1, rest.state, rest.inputs), {"slider.position": 1e6, "crank.angle": 1.0}
    )
    refused(InputError, "free crank", TrackingController, RIG, MOTION, PERIOD, design=free)
