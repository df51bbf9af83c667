"""Inverse dynamics against forward runs of the plant, the redundant formulation, closed forms and invariants."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from analysis import Inputs, simulate
from analysis.numerics.fourier import FourierSeries
from analysis.periodic import find_orbit
from analysis.run import table
from analysis.slider import best_spring, inverse_dynamics
from analysis.slider.inverse import NAMES
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests.oracles.five_bar import FORCE_NAMES, solve

RIG, SPEED = SETS["rig-2-spring-c"].parameters, SETS["rig-2-spring-c"].crank_speed
MOTION = FourierSeries(np.array([0.002, 0.004, 0.001]), np.array([0.0, 0.003, -0.002]))
#: P off both links, guide and ground inclined, all centres of mass off their links.
GENERAL = replace(
    TABLE_3_1, coupler_point_distance=0.12, coupler_point_angle=0.5, slider_guide_angle=0.3,
    ground_inclination=0.4, coupler_cog_angle=0.2, rocker_cog_angle=-0.3, slider_spring_free_position=0.004,
)  # fmt: skip
#: The slider's mass alone: F2 = m5 u''.
MASS = replace(
    RIG, coupler_mass=0.0, rocker_mass=0.0, coupler_inertia=0.0, rocker_inertia=0.0, slider_stiffness=0.0,
    slider_damping=0.0,
)  # fmt: skip


def load(th2: float) -> tuple[float, float]:
    return 2.0 + 3.0 * cos(th2), -1.0 + 2.0 * sin(2.0 * th2)


CASES = {
    "rig": (RIG, SPEED),
    "general": (GENERAL, 44.0),
    "backwards": (GENERAL, -30.0),
    "friction": (replace(GENERAL, slider_coulomb_friction=4.0), 44.0),
    "other assembly": (replace(GENERAL, assembly_branch=-1), 44.0),
}


@pytest.fixture(params=CASES, scope="module")
def case(request):
    p, speed = CASES[request.param]
    return inverse_dynamics(p, MOTION, speed, load=load, samples=4000)


def test_the_plant_moves_as_it_should_under_the_force(case) -> None:
    """A forward run of the plant: position, torque, and the energies per turn."""
    time = np.append(case.time, case.period)

    def signal(values):
        return table(time, np.append(values, values[0]), "cubic")

    loads = {"load_x": signal(case.inputs[:, 4]), "load_y": signal(case.inputs[:, 5])}
    inputs = Inputs(speed=case.crank_speed, force=signal(case.force), **loads)
    initial = InitialState(slider_position=float(case.states[0, 1]), slider_velocity=float(case.states[0, 3]))
    options = {"initial": initial, "stop_time": case.period, "samples": time, "tolerance": 1e-12}
    run = simulate(case.parameters, inputs, **options)
    assert run.status == 0
    # the table rounds the corners that Coulomb friction makes within 1 mm/s
    coarse = 1e3 if case.parameters.slider_coulomb_friction else 1.0
    angle = case.crank_speed * time
    assert run["crank.angle"] == pytest.approx(angle, abs=1e-9)
    assert run["slider.position"] == pytest.approx(MOTION(angle), abs=1e-10 * coarse)
    velocity = case.crank_speed * MOTION.derivative()(angle)
    assert run["slider.velocity"] == pytest.approx(velocity, abs=1e-8 * coarse)
    assert run["drive.applied_torque"][:-1] == pytest.approx(case.torque, abs=1e-7 * coarse)
    balance = case.balance
    supplied = balance.force + balance.torque + balance.load
    assert run["energy.dissipated"][-1] == pytest.approx(balance.dissipated, rel=1e-6)
    assert run["energy.supplied"][-1] == pytest.approx(supplied, rel=1e-6)


def test_the_redundant_form_has_the_same_forces(case) -> None:
    """Accelerations, torque and nine pin forces, with Lagrange multipliers in redundant coordinates."""
    acceleration = case.crank_speed**2 * MOTION.derivative().derivative()(case.crank_angle)
    for index in range(0, len(case.time), 500):
        state = case.states[index, :4].tolist()
        acting = dynamics.Inputs(1.0, 0.0, 0.0, float(case.force[index]), *load(state[0]))
        solution = solve(case.parameters, state, acting)
        scale = np.abs([case[name][index] for name in FORCE_NAMES]).max()
        assert solution.accelerations[3] == pytest.approx(acceleration[index], rel=1e-9, abs=1e-9)
        assert solution.torque == pytest.approx(case.torque[index], abs=1e-10 * scale)
        for name in FORCE_NAMES:
            assert case[name][index] == pytest.approx(solution.forces[name], abs=1e-9 * scale), name


coefficient = st.floats(-3e-3, 3e-3)


@settings(max_examples=25)
@given(
    cos=st.lists(coefficient, min_size=4, max_size=4),
    sin=st.lists(coefficient, min_size=4, max_size=4),
    speed=st.sampled_from([-60.0, 5.0, 44.0]),
    friction=st.sampled_from([0.0, 3.0]),
)
def test_what_goes_in_over_a_turn_is_dissipated(cos, sin, speed, friction) -> None:
    p = replace(GENERAL, slider_coulomb_friction=friction)
    drive = inverse_dynamics(p, FourierSeries(np.array(cos), np.array(sin)), speed, load=load)
    b = drive.balance
    size = max(np.abs(drive.power).mean(), np.abs(drive.torque * speed).mean()) * drive.period
    assert abs(b.residual) < 1e-10 * size
    assert drive.positive_work + drive.negative_work == pytest.approx(b.force, abs=1e-12 * size)
    assert b.dissipated >= 0.0


def test_the_free_motion_takes_no_force() -> None:
    orbit = find_orbit(RIG, speed=SPEED)
    turn = orbit.turn(256)
    drive = inverse_dynamics(RIG, FourierSeries.from_samples(turn["slider.position"]), SPEED, samples=256)
    spring = RIG.slider_stiffness * np.abs(turn["slider.position"]).max()
    assert drive.peak_force < 1e-7 * spring
    assert drive.torque == pytest.approx(turn["drive.applied_torque"], abs=1e-8)


def test_the_figures_of_a_bare_mass_in_closed_form() -> None:
    """u = A cos th2: F = -m w^2 A cos th2, power m w^3 A^2 sin th2 cos th2, work in and out m w^2 A^2."""
    m, w, a = MASS.slider_mass, 30.0, 0.01
    drive = inverse_dynamics(MASS, FourierSeries(np.array([0.0, a]), np.zeros(2)), w)
    assert drive.force == pytest.approx(-m * w**2 * a * np.cos(drive.crank_angle))
    assert drive.rms_force == pytest.approx(m * w**2 * a / np.sqrt(2.0))
    assert drive.peak_force == pytest.approx(m * w**2 * a)
    assert drive.peak_power == pytest.approx(0.5 * m * w**3 * a**2, rel=1e-4)
    assert drive.positive_work == pytest.approx(m * w**2 * a**2, rel=1e-4)
    assert drive.negative_work == pytest.approx(-m * w**2 * a**2, rel=1e-4)
    assert abs(drive.mean_power) < 1e-12
    assert drive.peak_torque == pytest.approx(np.abs(drive["drive.applied_torque"]).max())
    damped = inverse_dynamics(replace(MASS, slider_damping=7.0), drive.slider, w)
    assert damped.mean_power == pytest.approx(0.5 * 7.0 * (a * w) ** 2)
    assert damped.balance.dissipated == pytest.approx(damped.mean_power * 2.0 * pi / w)


def test_columns_hold_what_the_drive_has() -> None:
    drive = inverse_dynamics(RIG, MOTION, SPEED, samples=32)
    columns = drive.columns()
    assert columns["slider.force [N]"] == pytest.approx(drive.force)
    assert columns["pin.D.fy [N]"] == pytest.approx(drive["pin.D.fy"])
    assert columns["slider.position [m]"] == pytest.approx(MOTION(SPEED * columns["time [s]"]))
    assert columns["slider.power [W]"] == pytest.approx(drive.force * drive["slider.velocity"])
    with pytest.raises(InputError, match=r"no output 'energy\.residual'"):
        drive["energy.residual"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"crank_speed": 0.0}, "crank speed"),
        ({"crank_speed": float("inf")}, "crank speed"),
        ({"slider": MOTION.to_order(40), "samples": 80}, "order 40 needs at least 81"),
        ({"load": (float("nan"), 0.0)}, r"load at P is \(nan, 0\.0\) N at crank angle 0 rad"),
        ({"load": (1.0, 2.0, 3.0)}, "load at P is .* crank angle 0 rad"),
        ({"load": lambda angle: None}, "load at P is .* crank angle 0 rad"),
        ({"load": ("a", 0.0)}, "load at P is .* crank angle 0 rad"),
        ({"load": 5.0}, "load at P is .* crank angle 0 rad"),
        ({"samples": 72.5}, "samples of a turn"),
        ({"samples": float("nan")}, "samples of a turn"),
        # at 90 deg u = 0.255 m: the slider pin is 0.509 m from the crank pin, and the two links together are 0.508 m long
        ({"slider": FourierSeries(np.array([0.255, -0.255]), np.zeros(2))}, r"90\.00 deg"),
    ],
)
def test_bad_motions_are_told(change, said) -> None:
    with pytest.raises((InputError, AssemblyError), match=said):
        inverse_dynamics(**{"parameters": RIG, "slider": MOTION, "crank_speed": SPEED} | change)


def test_a_number_of_samples_may_be_a_float() -> None:
    assert len(inverse_dynamics(RIG, MOTION, SPEED, samples=72.0).time) == 72


# springs


def test_the_best_spring_of_a_bare_mass_is_tuned_to_the_speed() -> None:
    w = 25.0
    found = best_spring(MASS, FourierSeries(np.array([0.013, 0.01, 0.0]), np.array([0.0, 0.004, 0.0])), w)
    assert found.stiffness == pytest.approx(MASS.slider_mass * w**2)
    assert found.free_position == pytest.approx(0.013)
    assert found.rms_force < 1e-10 * found.rms_force_without


@pytest.mark.parametrize("free_position", [None, (0.01, 0.02), (-0.01, -0.002), (0.005, 0.005)])
def test_the_best_spring_is_the_best_of_a_search(free_position) -> None:
    low, high = free_position or (-GENERAL.ground_length, GENERAL.ground_length)

    def rms(k: float, free: float) -> float:
        sprung = replace(GENERAL, slider_stiffness=max(k, 0.0), slider_spring_free_position=free)
        return inverse_dynamics(sprung, MOTION, 44.0, load=load, samples=60).rms_force

    found = best_spring(GENERAL, MOTION, 44.0, free_position=free_position, load=load, samples=60)
    assert found.rms_force == pytest.approx(rms(found.stiffness, found.free_position), rel=1e-12)
    assert found.rms_force_without == pytest.approx(rms(0.0, 0.0), rel=1e-12)
    assert low <= found.free_position <= high or found.stiffness == 0.0
    assert found.parameters.slider_stiffness == found.stiffness
    search = min(
        minimize(lambda x: rms(1e3 * x[0], x[1]), (k, free), bounds=[(0.0, 20.0), (low, high)], tol=1e-12).fun
        for k in (0.5, 5.0)
        for free in (low, high)
    )
    assert found.rms_force == pytest.approx(search, rel=1e-5)
    assert found.rms_force <= search * (1.0 + 1e-9)


def test_a_motion_that_no_spring_helps_gets_none() -> None:
    """A slider that hangs, and a spring that could only pull it further down; one above it takes the weight."""
    hanging = replace(MASS, gravity=9.81, slider_guide_angle=-0.5 * pi)
    motion = FourierSeries(np.array([0.0, 0.01]), np.zeros(2))
    none = best_spring(hanging, motion, 5.0, free_position=(0.3, 0.4))
    assert (none.stiffness, none.rms_force) == (0.0, none.rms_force_without)
    assert none.rms_force == pytest.approx(hanging.slider_mass * 9.81, rel=1e-3)
    above = best_spring(hanging, motion, 5.0, free_position=(-0.4, -0.3))
    # tuned to the speed, k = m w^2, and drawn out by m g / k
    assert (above.stiffness, above.free_position) == pytest.approx((hanging.slider_mass * 25.0, -9.81 / 25.0))
    assert above.rms_force < 1e-10 * above.rms_force_without
    with pytest.raises(InputError, match="free position"):
        best_spring(hanging, motion, 5.0, free_position=(0.1, -0.1))


def test_extremes_are_those_of_either_way() -> None:
    """A force against the motion, power and torque alike: the greatest is that of the greatest magnitude."""
    drive = inverse_dynamics(RIG, MOTION, SPEED, samples=64)
    for name, peak in (("power", "peak_power"), ("force", "peak_force"), ("torque", "peak_torque")):
        values = getattr(drive, name)
        assert getattr(drive, peak) == np.abs(values).max()
    inputs, states, values = drive.inputs.copy(), drive.states.copy(), drive.values.copy()
    inputs[:, 3], states[:, 3] = np.linspace(-3.0, 1.0, 64), 1.0
    values[:, NAMES.index("drive.applied_torque")] = np.linspace(-5.0, 2.0, 64)
    against = replace(drive, inputs=inputs, states=states, values=values)
    assert (against.peak_power, against.peak_force, against.peak_torque) == (3.0, 3.0, 5.0)
