"""The compiled path of the coupler point and its derivatives: against the plant traced with CasADi, and finite differences."""

from functools import cache
from math import pi
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.mechanisms import FIVE_BAR
from analysis.numerics import symbolic
from analysis.run import symbolic_equations
from analysis.synthesis.linkage import kernels
from linkwork.five_bar.parameters import Constants
from tests.linkages import drawn

FloatArray = NDArray[np.float64]


def case(seed: int, n: int = 7) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Rotations, displacements of D, vector q and branch of a random linkage."""
    random = np.random.default_rng(seed)
    linkage = drawn(random, least=0.5)
    small = 0.02 * linkage.crank_length
    return (
        random.uniform(-pi, pi, n),
        random.uniform(-small, small, n),
        random.uniform(-small, small, n),
        linkage.vector,
        float(linkage.branch),
    )


def evaluated(
    kernel: Any, rows: int, phi: FloatArray, dx: FloatArray, dy: FloatArray, q: FloatArray, branch: float
) -> tuple[FloatArray, FloatArray]:
    out, jacobian = np.empty((rows, len(phi))), np.empty((len(kernels.COLUMNS), rows, len(phi)))
    kernel(np.cos(phi), np.sin(phi), dx, dy, q, branch, out, jacobian)
    return out, jacobian


@cache
def function() -> Any:
    """Coupler point in the plane and link angles, by `position` and `coupler_point` of the plant, with their Jacobian.

    The slider's displacement is (dx, dy) with u = 1 and the guide's direction (dx, dy).
    """
    casadi = symbolic.library()
    plant = symbolic_equations(FIVE_BAR)
    z = casadi.SX.sym("z", len(kernels.COLUMNS))
    phi, branch = casadi.SX.sym("phi"), casadi.SX.sym("branch")
    v = dict(zip(kernels.COLUMNS, casadi.vertsplit(z)))
    known = {
        "l1": v["ground_length"],
        "l2": v["crank_length"],
        "l3": v["coupler_length"],
        "l4": v["rocker_length"],
        "ca": v["dx"],
        "sa": v["dy"],
        "branch": branch,
        "xp": v["point_distance"] * casadi.cos(v["point_angle"]),
        "yp": v["point_distance"] * casadi.sin(v["point_angle"]),
    }
    p = Constants(**{name: known.get(name, 0.0) for name in Constants._fields})
    g = plant.position(phi + v["crank_phase"], 1.0, p)
    x, y = plant.coupler_point(g, p)
    c, s = casadi.cos(v["ground_angle"]), casadi.sin(v["ground_angle"])
    values = casadi.vertcat(
        v["pivot_x"] + c * x - s * y, v["pivot_y"] + s * x + c * y, casadi.atan2(g.s3, g.c3), casadi.atan2(g.s4, g.c4)
    )
    return casadi.Function("traced", [z, phi, branch], [values, casadi.jacobian(values, z)])


@pytest.mark.parametrize("seed", range(12))
def test_path_angles_and_jacobians_are_those_of_the_plant(seed: int) -> None:
    pytest.importorskip("casadi")
    phi, dx, dy, q, branch = case(seed)
    path, path_jacobian = evaluated(kernels.coupler_path_jacobian, 2, phi, dx, dy, q, branch)
    angles, angle_jacobian = evaluated(kernels.link_jacobian, 2, phi, dx, dy, q, branch)
    for j in range(len(phi)):
        values, jacobian = (np.asarray(a) for a in function()(np.append(q, [dx[j], dy[j]]), phi[j], branch))
        np.testing.assert_allclose(path[:, j], values[:2, 0], rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(np.exp(1j * angles[:, j]), np.exp(1j * values[2:, 0]), rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(path_jacobian[:, :, j], jacobian[:2].T, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(angle_jacobian[:, :, j], jacobian[2:].T, rtol=1e-11, atol=1e-12)


def test_with_and_without_derivatives_the_path_is_the_same() -> None:
    phi, dx, dy, q, branch = case(5, 72)
    path = np.empty((2, 72))
    kernels.coupler_path(np.cos(phi), np.sin(phi), dx, dy, q, branch, path)
    np.testing.assert_allclose(path, evaluated(kernels.coupler_path_jacobian, 2, phi, dx, dy, q, branch)[0], atol=1e-14)
    directions = np.empty((6, 72))
    kernels.link_directions(np.cos(phi), np.sin(phi), dx, dy, q, branch, directions)
    angles = evaluated(kernels.link_jacobian, 2, phi, dx, dy, q, branch)[0]
    np.testing.assert_allclose(directions[0] + 1j * directions[1], np.exp(1j * angles[0]), atol=1e-14)
    np.testing.assert_allclose(directions[2] + 1j * directions[3], np.exp(1j * angles[1]), atol=1e-14)
    np.testing.assert_allclose(directions[4] + 1j * directions[5], np.exp(1j * (angles[1] - angles[0])), atol=1e-14)


def test_links_that_cannot_be_joined_leave_a_nan() -> None:
    q = np.array([0.0, 0.0, 1.0, 0.9, 0.5, 0.6, 0.3, 0.0, 0.0, 0.0])
    phi = np.array([0.5, pi])
    zero = np.zeros(2)
    path, jacobian = evaluated(kernels.coupler_path_jacobian, 2, phi, zero, zero, q, 1.0)
    assert np.isfinite(path[:, 0]).all()
    assert np.isnan(path[:, 1]).all()
    assert np.isnan(jacobian[2:, :, 1]).any()


def test_many_linkages_at_once_are_one_after_the_other() -> None:
    random = np.random.default_rng(3)
    drawings = [drawn(random) for _ in range(5)]
    phi = np.linspace(0.0, 6.0, 11)
    for branch in (1.0, -1.0):
        shapes = np.array([[*x.vector[2:6], x.crank_phase, 0.03, 0.4] for x in drawings])
        coupler = np.empty((5, 11), dtype=complex)
        rocker = np.empty((5, 11), dtype=complex)
        waves = np.cos(phi), np.sin(phi), np.cos(2.0 * phi), np.sin(2.0 * phi)
        kernels.many_directions(*waves, shapes, branch, coupler, rocker)
        for row, linkage in enumerate(drawings):
            g = np.empty((6, 11))
            second = 0.03 * np.exp(1j * (2.0 * phi + 0.4))
            kernels.link_directions(*waves[:2], second.real.copy(), second.imag.copy(), linkage.vector, branch, g)
            np.testing.assert_allclose(coupler[row], g[0] + 1j * g[1], atol=1e-13)
            np.testing.assert_allclose(rocker[row], g[2] + 1j * g[3], atol=1e-13)


class TestMatchWindows:
    T = 2.0 * pi * np.arange(128) / 128
    CURVE = np.exp(1j * T) * (1.0 + 0.4 * np.cos(2.0 * T + 0.3) + 0.1 * np.cos(3.0 * T))

    def piece(self, start: int, span: int, k: int = 32) -> NDArray[np.complex128]:
        """Points at even arc length on a piece of the curve."""
        part = self.CURVE[np.arange(start, start + span + 1) % 128]
        length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(part)))])
        at = np.linspace(0.0, length[-1], k)
        return np.interp(at, length, part.real) + 1j * np.interp(at, length, part.imag)

    def matched(self, target: NDArray[np.complex128], gap: slice = slice(0)) -> FloatArray:
        best = np.empty((1, 4))
        spans = np.array([10, 20, 28, 48, 90])
        curves = self.CURVE[None, :].copy()
        curves[:, gap] = np.nan
        kernels.match_windows(curves, target - target.mean(), np.arange(0, 128, 4), spans, best)
        return best[0]

    @pytest.mark.parametrize(("start", "span"), [(8, 28), (112, 48), (64, 90)])
    def test_it_finds_the_piece_that_was_cut_out_turned_and_scaled(self, start: int, span: int) -> None:
        found = self.matched(2.5 * np.exp(0.7j) * self.piece(start, span) + 3.0)
        assert found[0] == pytest.approx(0.0, abs=1e-12)
        assert found[1:].tolist() == [start, span, 1.0]

    def test_it_finds_the_direction(self) -> None:
        found = self.matched(self.piece(20, 48)[::-1])
        assert found[0] == pytest.approx(0.0, abs=1e-12)
        assert found[1:].tolist() == [20, 48, -1.0]

    def test_a_mirror_image_is_no_similarity(self) -> None:
        assert self.matched(self.piece(20, 48).conj())[0] > 1e-3

    def test_no_piece_lies_over_a_gap(self) -> None:
        over = self.piece(112, 48)
        assert self.matched(over)[0] == pytest.approx(0.0, abs=1e-12)
        found = self.matched(over, slice(125, 128))
        assert found[0] > 1e-6
        assert found[1] + found[2] < 125
