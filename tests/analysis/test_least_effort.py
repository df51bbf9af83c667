"""The motion of least effort: its limits, an independent formulation, and the checks it makes of itself."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import cos, inf, pi, radians, sin

import numpy as np
import pytest
from scipy.optimize import minimize

from analysis import simulate
from analysis.motion import Collocation, MotionLimits, TrackingController, best_spring, inverse_dynamics, track
from analysis.numerics.fourier import FourierSeries
from analysis.periodic import find_orbit
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar import kinematics
from linkwork.five_bar.published import SETS, TABLE_3_1

pytest.importorskip("casadi")

from analysis.motion import EffortError, UnattainableError, least_effort
from analysis.motion.collocation import shortest_way

SPEED = SETS["rig-2-spring-c"].crank_speed
RIG = replace(SETS["rig-2-spring-c"].parameters, coupler_point_distance=0.2, coupler_point_angle=0.5)
MOTION = FourierSeries(np.array([0.002, 0.004, 0.001]), np.array([0.0, 0.003, -0.002]))


def path_of(parameters, slider):
    """P over the crank angle with the slider on a motion."""
    p = parameters.constants()

    def target(theta):
        return [kinematics.coupler_point(kinematics.position(t, float(slider(t)), p), p) for t in theta]

    return target


def rocker_of(parameters, slider):
    p = parameters.constants()

    def target(theta):
        return [kinematics.rocker_angle(kinematics.position(t, float(slider(t)), p)) for t in theta]

    return target


TARGET = path_of(RIG, MOTION)


@pytest.fixture(scope="module")
def within():
    """Of bounds of 0.2 to 2 mm."""
    return {bound: least_effort(RIG, SPEED, TARGET, bound) for bound in (2e-4, 1e-3, 2e-3)}


def test_a_tight_bound_leads_to_inverse_dynamics() -> None:
    exact = inverse_dynamics(RIG, MOTION, SPEED)
    found = least_effort(RIG, SPEED, TARGET, 1e-6)
    assert found.status == "Solve_Succeeded"
    assert found.effort == pytest.approx(exact.rms_force, rel=2e-3)
    assert found.position == pytest.approx(MOTION(found.crank_angle), abs=5e-6)
    # what a motion within 1e-6 m can save is seen in the force at once, for it has two derivatives
    force = FourierSeries.from_samples(exact.force)(found.crank_angle)
    assert found.force == pytest.approx(force, abs=0.05 * exact.peak_force)
    assert found.attained < 1.01e-6


def test_a_loose_bound_leaves_the_free_motion() -> None:
    orbit = find_orbit(RIG, speed=SPEED)
    found = least_effort(RIG, SPEED, TARGET, 0.02)
    assert found.effort < 1e-6 * inverse_dynamics(RIG, MOTION, SPEED).rms_force
    free = FourierSeries.from_samples(orbit.turn(256)["slider.position"])
    assert found.position == pytest.approx(free(found.crank_angle), abs=1e-8)
    assert found.velocity == pytest.approx(SPEED * free.derivative()(found.crank_angle), abs=1e-6)


def test_the_effort_falls_as_the_bound_loosens(within) -> None:
    exact = inverse_dynamics(RIG, MOTION, SPEED).rms_force
    efforts = [exact, *(one.effort for one in within.values()), 0.0]
    assert np.all(np.diff(efforts) < -0.05 * exact)
    for bound, one in within.items():
        assert one.error.max() == pytest.approx(bound, rel=1e-6)


def test_the_plant_does_what_was_found(within) -> None:
    """The run under the force is the motion; its error and effort are what is said of them."""
    for bound, one in within.items():
        time = np.linspace(0.0, 2.0 * pi / SPEED, 2001)
        run = simulate(RIG, one.inputs(), initial=one.initial, stop_time=float(time[-1]), samples=time, tolerance=1e-12)
        u, v, f = one.at(SPEED * time)
        assert run["slider.position"] == pytest.approx(u, abs=5e-8)
        assert run["slider.position"][-1] == pytest.approx(run["slider.position"][0], abs=5e-8)
        assert one.deviation == pytest.approx(np.abs(run["slider.position"] - u).max(), rel=0.5, abs=1e-11)
        assert one.deviation_velocity == pytest.approx(np.abs(run["slider.velocity"] - v).max(), rel=0.5, abs=1e-9)
        assert one.effort == pytest.approx(np.sqrt(np.mean(f[:-1] ** 2)), rel=1e-3)
        there = np.column_stack([run["coupler.point.x"], run["coupler.point.y"]])
        error = np.linalg.norm(there - np.array(TARGET(SPEED * time)), axis=1)
        assert one.attained == pytest.approx(error.max(), rel=1e-4)
        assert one.attained < 1.001 * bound


def test_a_fourier_series_under_scipy_finds_no_better(within) -> None:
    """Direct: nine coefficients of the motion, the force by inverse dynamics, SciPy's SLSQP on a grid of angles."""
    bound = 1e-3
    one = within[bound]
    order, samples = 6, 48
    theta = 2.0 * pi * np.arange(samples) / samples
    wanted = np.array(TARGET(theta))
    p = RIG.constants()

    def series(x):
        return FourierSeries(1e-3 * x[: order + 1], 1e-3 * np.append(0.0, x[order + 1 :]))

    def cost(x):
        return float(np.mean(inverse_dynamics(RIG, series(x), SPEED, samples=samples).force ** 2))

    def room(x):
        u = series(x)(theta)
        there = [kinematics.coupler_point(kinematics.position(t, q, p), p) for t, q in zip(theta, u)]
        return 1.0 - np.sum((np.array(there) - wanted) ** 2, axis=1) / bound**2

    start = MOTION.to_order(order)
    found = minimize(
        cost, 1e3 * np.concatenate([start.cos, start.sin[1:]]), method="SLSQP",
        constraints={"type": "ineq", "fun": room}, options={"maxiter": 80, "ftol": 1e-6},
    )  # fmt: skip
    effort = np.sqrt(found.fun)
    assert found.success
    # six harmonics can do a little less than the collocation; a bound kept at 48 angles alone is a little looser
    assert 0.99 * one.effort < effort < 1.03 * one.effort
    assert series(found.x)(theta) == pytest.approx(one.at(theta)[0], abs=2e-4)


@pytest.mark.parametrize(("points", "degree"), [("radau", 2), ("radau", 3), ("legendre", 1), ("legendre", 2)])
def test_the_residual_falls_with_the_order_of_the_method(points, degree) -> None:
    """A polynomial of degree d is good to the order d + 1 between its nodes; without active bounds all is smooth."""
    runs = [
        least_effort(
            RIG, SPEED, TARGET, 0.02, collocation=Collocation(intervals=n, points=points, degree=degree, halvings=0)
        )
        for n in (20, 40)
    ]
    assert np.log2(runs[0].deviation / runs[1].deviation) == pytest.approx(degree + 1, abs=0.15)


def test_the_mesh_figures_are_the_change_by_halving() -> None:
    coarse, fine = (
        least_effort(RIG, SPEED, TARGET, 1e-3, collocation=Collocation(intervals=n, halvings=0)) for n in (20, 40)
    )
    checked = least_effort(RIG, SPEED, TARGET, 1e-3, collocation=Collocation(intervals=20, halvings=1))
    assert (checked.intervals, coarse.mesh_effort, coarse.mesh_position) == (40, inf, inf)
    assert checked.effort == pytest.approx(fine.effort, rel=1e-7)
    assert checked.mesh_effort == pytest.approx(abs(fine.effort - coarse.effort) / fine.effort, rel=1e-3)
    assert 1e-7 < checked.mesh_effort < 1e-2
    moved = np.abs(fine.at(fine.crank_angle)[0] - coarse.at(fine.crank_angle)[0]).max()
    assert checked.mesh_position == pytest.approx(moved, rel=1e-2)


def test_bounds_on_the_way_are_kept() -> None:
    """Each costs effort, and each is met with equality somewhere."""
    free = least_effort(RIG, SPEED, TARGET, 1e-3, collocation=Collocation(halvings=0))
    low, fast, strong = -0.0036, 0.2, 11.5
    assert free.position.min() < low - 2e-4
    assert np.abs(free.velocity).max() > fast
    assert np.abs(free.force).max() > strong
    stroke = least_effort(
        RIG, SPEED, TARGET, 1e-3, limits=MotionLimits(stroke=(low, 0.01)), collocation=Collocation(halvings=0)
    )
    assert stroke.position.min() == pytest.approx(low, abs=1e-7)
    speed = least_effort(RIG, SPEED, TARGET, 1e-3, limits=MotionLimits(speed=fast), collocation=Collocation(halvings=0))
    assert np.abs(speed.velocity).max() == pytest.approx(fast, rel=1e-5)
    force = least_effort(
        RIG, SPEED, TARGET, 1e-3, limits=MotionLimits(force=strong), collocation=Collocation(halvings=0)
    )
    assert np.abs(force.force).max() == pytest.approx(strong, rel=1e-5)
    assert min(stroke.effort, speed.effort, force.effort) > free.effort * (1.0 + 1e-4)


def test_the_transmission_angle_is_kept() -> None:
    """Table 3.1 pulled to where coupler and rocker are nearly in line."""
    p = replace(TABLE_3_1, coupler_point_distance=0.15)
    out = path_of(p, FourierSeries(np.array([0.04]), np.zeros(1)))
    least = radians(70.0)

    def angles(found):
        c = p.constants()
        at = zip(found.crank_angle.tolist(), found.position.tolist())
        return np.array([kinematics.transmission_angle(kinematics.position(th2, u, c), c) for th2, u in at])

    free = least_effort(p, 44.0, out, 0.03, collocation=Collocation(halvings=0))
    kept = least_effort(
        p, 44.0, out, 0.03, collocation=Collocation(halvings=0), limits=MotionLimits(transmission=least)
    )
    assert np.abs(np.sin(angles(free))).min() < sin(least) - 0.01
    assert np.abs(np.sin(angles(kept))).min() == pytest.approx(sin(least), abs=1e-6)
    assert kept.effort > free.effort


def test_a_spring_designed_along_saves_effort(within) -> None:
    bound = 1e-3
    fixed = within[bound]
    found = least_effort(RIG, SPEED, TARGET, bound, spring=(-0.05, 0.05))
    assert found.effort < 0.5 * fixed.effort
    assert found.deviation < 1e-7
    # for its own motion no spring is better, which linear least squares says on its own
    best = best_spring(found.parameters, found.motion(40), SPEED, free_position=(-0.05, 0.05))
    assert found.effort == pytest.approx(best.rms_force, rel=2e-3)
    assert found.parameters.slider_stiffness == pytest.approx(best.stiffness, rel=2e-3)
    assert found.parameters.slider_spring_free_position == pytest.approx(best.free_position, rel=2e-2)
    # and a free position that is bounded is kept
    for span, free in (((0.004, 0.05), 0.004), ((-0.05, 0.0), 0.0)):
        held = least_effort(RIG, SPEED, TARGET, bound, spring=span, collocation=Collocation(halvings=0))
        assert held.parameters.slider_spring_free_position == pytest.approx(free, abs=1e-6)
        assert found.effort < 0.99 * held.effort


@pytest.mark.slow
@pytest.mark.parametrize("cost", ["power", "positive power"])
def test_least_power(cost, within) -> None:
    found = least_effort(RIG, SPEED, TARGET, 1e-3, cost=cost, limits=MotionLimits(force=20.0))

    def power(one):
        theta = 2.0 * pi * np.arange(4000) / 4000
        _, v, f = one.at(theta)
        return float(np.mean(np.abs(f * v) if cost == "power" else np.maximum(f * v, 0.0)))

    assert found.effort == pytest.approx(power(found), rel=2e-2)
    assert found.effort < 0.8 * power(within[1e-3])
    assert found.attained < 1.002e-3
    # bound tightly, it is the power of the exact motion, which is negative for a part of the turn
    exact = inverse_dynamics(RIG, MOTION, SPEED)
    work = exact.positive_work - (exact.negative_work if cost == "power" else 0.0)
    tight = least_effort(RIG, SPEED, TARGET, 1e-6, cost=cost, collocation=Collocation(halvings=0))
    assert exact.negative_work < -0.1 * exact.positive_work
    assert tight.effort == pytest.approx(work / exact.period, rel=2e-2)


def test_a_rocker_function_with_gravity_and_a_load() -> None:
    """Table 3.1 in the vertical plane, whose rocker is to turn as if the slider moved; the target as samples."""
    p = replace(TABLE_3_1, coupler_point_distance=0.1, slider_guide_angle=0.2)

    def load(th2):
        return 4.0 * cos(th2), -2.0

    theta = 2.0 * pi * np.arange(72) / 72
    samples = rocker_of(p, MOTION)(theta)
    exact = inverse_dynamics(p, MOTION, 44.0, load=load)
    tight, loose = (
        least_effort(p, 44.0, samples, bound, load=load, collocation=Collocation(halvings=0)) for bound in (1e-4, 1e-2)
    )
    assert tight.effort == pytest.approx(exact.rms_force, rel=1e-2)
    assert loose.effort < 0.95 * tight.effort
    assert loose.error.max() == pytest.approx(1e-2, rel=1e-5)
    assert max(tight.deviation, loose.deviation) < 1e-7
    # the error is that of the rocker's angle
    c = p.constants()
    at = zip(loose.crank_angle.tolist(), loose.position.tolist())
    angle = [kinematics.rocker_angle(kinematics.position(th2, u, c)) for th2, u in at]
    wanted = rocker_of(p, MOTION)(loose.crank_angle.tolist())
    assert loose.error == pytest.approx(np.abs(np.subtract(angle, wanted)), abs=1e-5)
    # whole turns of the target do not matter
    turned = least_effort(p, 44.0, np.add(samples, 2.0 * pi), 1e-2, load=load, collocation=Collocation(halvings=0))
    assert turned.effort == pytest.approx(loose.effort, rel=1e-6)


def test_the_motion_found_can_be_followed(within) -> None:
    one = within[1e-3]
    result = track(TrackingController(RIG, one.motion(20), 5e-4), crank_speed=SPEED, revolutions=8)
    metrics = result.metrics()
    assert metrics.rms_force == pytest.approx(one.effort, rel=1e-2)
    assert metrics.rms_error < 1e-5


def test_theshortest_way_is_that_of_all_closed_ways() -> None:
    """Of 4 positions at 6 angles there are 4096 closed ways; and its two limits of free and of dear travel."""
    rng = np.random.default_rng(3)
    miss, u = rng.random((6, 4)), np.arange(4.0)
    for price in (0.0, 0.02, 0.1, 10.0):
        travel = price * np.subtract.outer(u, u) ** 2

        def cost(way, travel=travel):
            return sum(miss[i, k] + travel[way[i - 1], k] for i, k in enumerate(way))

        best = min(product(range(4), repeat=6), key=cost)
        assert tuple(shortest_way(miss, travel)) == best
    assert best == (int(miss.sum(axis=0).argmin()),) * 6


def test_what_cannot_be_is_told() -> None:
    with pytest.raises(
        UnattainableError, match=r"bound of 0\.001 m cannot be kept: at crank angle \d+\.0 deg the error is at"
    ):
        least_effort(RIG, SPEED, TARGET, 1e-3, limits=MotionLimits(stroke=(-0.002, 0.006)))
    with pytest.raises(UnattainableError, match=r"cannot be joined with a transmission angle of 5 deg"):
        least_effort(RIG, SPEED, TARGET, 1e-3, limits=MotionLimits(stroke=(5.0, 6.0)))
    with pytest.raises(
        UnattainableError, match=r"and all other bounds: IPOPT ended after \d+ iterations with Inf"
    ) as caught:
        least_effort(RIG, SPEED, TARGET, 1e-3, limits=MotionLimits(force=5.0))
    assert caught.value.status == "Infeasible_Problem_Detected"
    assert isinstance(caught.value, EffortError)
    with pytest.raises(InputError, match="P is the crank pin, which no slider moves"):
        least_effort(replace(RIG, coupler_point_distance=0.0), SPEED, TARGET, 1e-3)
    with pytest.raises(AssemblyError, match="cannot be followed beyond"):
        least_effort(RIG, SPEED, TARGET, 1e-3, guess=MOTION * 100.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bound": 0.0}, "bound of the error is 0"),
        ({"crank_speed": -1.0}, "crank speed is -1"),
        ({"spring": (0.1, -0.1)}, "free position between"),
        ({"cost": "work"}, "cost is 'work': it must be one of force, power, positive power"),
        ({"target": np.zeros((8, 3))}, r"target of shape \(8, 3\)"),
        ({"target": np.full(8, np.nan)}, "a value of the target is not finite"),
        ({"target": lambda theta: np.zeros(3)}, r"gives values of shape \(3,\) for 1 crank angles"),
    ],
)
def test_bad_problems_are_told(options, message) -> None:
    with pytest.raises(InputError, match=message):
        least_effort(RIG, **{"crank_speed": SPEED, "target": TARGET, "bound": 1e-3} | options)


@pytest.mark.parametrize(
    ("settings", "options", "message"),
    [
        (MotionLimits, {"speed": 0.0}, "bound of the speed is 0"),
        (MotionLimits, {"force": -2.0}, "bound of the force is -2"),
        (MotionLimits, {"stroke": (0.1, -0.1)}, "two increasing numbers"),
        (MotionLimits, {"transmission": 2.0}, "least transmission angle is 2"),
        (Collocation, {"degree": 5}, "degree of the collocation is 5"),
        (Collocation, {"points": "lobatto"}, "points is 'lobatto'"),
        (Collocation, {"intervals": 3}, "3 intervals, 1 halvings"),
        (Collocation, {"intervals": 20.5}, "20.5 intervals: it must be a whole number"),
        (Collocation, {"halvings": 0.5}, "0.5 halvings: it must be a whole number"),
        (Collocation, {"degree": 2.5}, "2.5 as the degree: it must be a whole number"),
    ],
)
def test_bad_settings_are_refused(settings, options, message) -> None:
    with pytest.raises(InputError, match=message):
        settings(**options)
