"""Periods integrated in lanes against the same one by one, and vectors in kernels against NumPy."""

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest
from numba import float64, int64, types

from analysis import InductionMotor
from analysis.numerics.codegen import MATRIX, VECTOR, kernel
from analysis.numerics.vectors import LANES, absolute, greater, load, multiply_add, store
from analysis.periodic import Drive
from analysis.periodic.motion import kernels
from analysis.periodic.motion.discretisation import operating_point
from analysis.periodic.motion.flow import GAP, IN_LANES, PLAIN, VARIATIONAL
from analysis.periodic.motion.kernels import SECTION, Status
from analysis.periodic.motion.tracks import DONE, IDLE, RUNNING, advance_tracks, begin, make_tracks, set_mechanism
from analysis.run.compiled import read_lane
from linkwork.five_bar.published import SETS
from tests.analysis.test_orbits import LIGHT

RIG = SETS["rig-2-spring-c"].parameters
USED = PLAIN, VARIATIONAL, IN_LANES + PLAIN, IN_LANES + VARIATIONAL, IN_LANES + GAP


@kernel(types.void(SECTION, int64, float64, MATRIX, VECTOR, MATRIX, MATRIX, int64[::1]), purpose="a test")
def follow_all(
    section: Any, columns: int, end: float, constants: Any, tolerances: Any, starts: Any, rows: Any, statuses: Any
) -> None:
    """Integrate from all starts in lanes, each with its own constants to its own tolerance."""
    v, owner, place = make_tracks(section, columns), np.full(LANES, -1), 0
    running = True
    while running:
        for lane in range(LANES):
            while v.status[lane] != RUNNING:
                if owner[lane] >= 0:
                    statuses[owner[lane]] = v.status[lane]
                    if v.status[lane] == DONE:
                        read_lane(lane, LANES, v.x, rows[owner[lane]])
                owner[lane], v.status[lane] = -1, IDLE
                if place == starts.shape[0]:
                    break
                owner[lane], v.step[lane] = place, 0.1
                own = kernels.replace_numbers(
                    section, section.drive, constants[place], section.scale, tolerances[place]
                )
                set_mechanism(lane, own, v)
                begin(lane, own, starts[place], end, tolerances[place], v)
                place += 1
        running = advance_tracks(section, v)


@pytest.mark.parametrize(
    "drive",
    [Drive(speed=30.0), Drive(motor=InductionMotor(breakdown_torque=0.06, breakdown_slip=0.3, synchronous_speed=60.0))],
    ids=["speed", "motor"],
)
@pytest.mark.parametrize("columns", [0, 1], ids=["plain", "derivatives"])
def test_lanes_take_the_steps_of_one_motion_alone(drive: Drive, columns: int) -> None:
    """More starts than lanes, some beyond the limit of assembly, with several dampers, to several tolerances."""
    point = operating_point(RIG, drive)
    n = point.flow.size
    generator = np.random.default_rng(5)
    starts = np.zeros((21, n))
    starts[:, 0] = generator.uniform(-0.3, 0.3, 21)
    starts[:, 1] = generator.uniform(-1.0, 1.0, 21)
    starts[:, 2:] = 40.0
    tolerances = 10.0 ** generator.uniform(-12.0, -6.0, 21)
    rows, statuses = np.zeros((21, n * (1 + n * columns))), np.zeros(21, dtype=np.int64)
    section = point.section(starts[0], *USED)
    rigs = [replace(RIG, slider_damping=damping) for damping in generator.uniform(0.0, 9.0, 21)]
    constants = np.array([operating_point(rig, drive).section(starts[0]).p for rig in rigs])
    follow_all(section, n * columns, 2.0 * pi, constants, tolerances, starts, rows, statuses)
    for start, p, tolerance, row, status in zip(starts, constants, tolerances, rows, statuses):
        alone = np.zeros((1, row.size))
        own = section._replace(p=p, tolerance=tolerance)
        assert status == kernels.segments(own, np.array([0.0, 2.0 * pi]), start[None, :], alone)
        if status == Status.DONE:
            assert row == pytest.approx(alone[0], rel=1e-10, abs=1e-11 * np.abs(alone).max())
    assert len(set(statuses.tolist())) > 1


def test_lanes_pass_over_no_change_point() -> None:
    point = operating_point(LIGHT, Drive(speed=40.0))
    section = point.section(np.zeros(2), *USED)
    ends, rows, statuses = np.array([0.9, 1.1]) * pi, np.zeros((1, 2)), np.zeros(1, dtype=np.int64)
    for end, wanted in zip(ends, (Status.DONE, Status.LIMIT)):
        for tolerance in (1e-12, 1e-6):
            constants, start = section.p[None, :].copy(), np.zeros((1, 2))
            follow_all(section, 0, end, constants, np.array([tolerance]), start, rows, statuses)
            assert statuses[0] == wanted


@kernel(int64(SECTION, MATRIX, VECTOR, VECTOR, VECTOR), purpose="a test")
def deflate(section: Any, known: Any, start: Any, z: Any, correction: Any) -> int:
    """Return what follows one integration from a start to z, and write the correction."""
    hunt = kernels.make_hunt(start)
    what = kernels.continue_deflated_newton(section, 9, 1e9, DONE, known, z, hunt)
    for i in range(start.shape[0]):
        correction[i] = hunt.correction[i]
    return what


def test_known_motions_are_divided_out_by_their_distances() -> None:
    """Newton's step of F times the product of 1 + 1/d^2, from the definition."""
    generator = np.random.default_rng(8)
    section = operating_point(RIG, Drive(speed=30.0)).section(np.zeros(2), *USED)
    scale = section.scale
    start, known = scale * generator.normal(size=2), scale * generator.normal(size=(3, 2))
    end, monodromy = start + 0.1 * scale * generator.normal(size=2), generator.normal(size=(2, 2))
    correction = np.zeros(2)
    assert deflate(section, known, start, np.concatenate([end, monodromy.T.ravel()]), correction) == kernels.GOING
    square = (((start - known) / scale) ** 2).sum(axis=1)
    factor = np.prod(1.0 + 1.0 / square)
    slope = factor * (-2.0 / (square * (1.0 + square)) * ((start - known) / scale**2).T).sum(axis=1)
    jacobian = factor * (monodromy - np.eye(2)) + np.outer(end - start, slope)
    assert correction == pytest.approx(np.linalg.solve(jacobian, factor * (start - end)), rel=1e-9)


@kernel(types.void(VECTOR, VECTOR, VECTOR), purpose="a test")
def combine(a: Any, b: Any, out: Any) -> None:
    """Apply each operation to two numbers of each lane, and to a vector and a number."""
    x, y = load(a, 0), load(b, 0)
    store(out, 0, x + y)
    store(out, 1, x - y)
    store(out, 2, x * y)
    store(out, 3, x / y)
    store(out, 4, 2.0 - x)
    store(out, 5, x / 3.0)
    store(out, 6, multiply_add(x, y, 1.0))
    store(out, 7, absolute(x))
    store(out, 8, greater(x, y))
    store(out, 9, 7.0)


def test_vectors_compute_lane_by_lane() -> None:
    generator = np.random.default_rng(2)
    a, b, out = generator.normal(size=LANES), generator.normal(size=LANES), np.zeros(10 * LANES)
    combine(a, b, out)
    expected = [
        a + b,
        a - b,
        a * b,
        a / b,
        2.0 - a,
        a / 3.0,
        a * b + 1.0,
        np.abs(a),
        np.maximum(a, b),
        np.full(LANES, 7.0),
    ]
    np.testing.assert_allclose(out.reshape(10, LANES), expected, rtol=1e-15, atol=1e-16)
