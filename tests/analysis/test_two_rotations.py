"""The thesis's two rotations in a ball joint: where the loop stays open, by all eighteen equations and by its own six."""

from dataclasses import replace
from math import asin, degrees, radians

import numpy as np
import pytest
from scipy.optimize import least_squares

from analysis.numerics.dual import skew
from analysis.slider_crank import close, settle
from analysis.slider_crank.closure import chain, planar
from analysis.units import INCH
from linkwork.slider_crank.published import parameters
from tests.published_rahman import GREATEST_SHIFTS_IN, OFFSETS_IN

TURN = np.radians(np.arange(0.0, 360.0, 10.0))


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("offset", OFFSETS_IN)
def test_it_is_right_in_the_plane(offset: float, branch: int) -> None:
    p = replace(parameters(offset), assembly_branch=branch)
    found = settle(p, TURN, 0.0)
    assert found.settled.all()
    assert found.rotation_residual.max() < 1e-12
    assert found.length_residual.max() < 1e-12
    assert found.position_error.max() < 1e-12
    np.testing.assert_allclose(found.unknowns, planar(p, TURN), atol=1e-12)
    np.testing.assert_allclose(planar(p, TURN)[:, 4], close(p, TURN, 0.0).slider_position, atol=1e-12)


@pytest.mark.parametrize("shift", [0.0, 3.5])
@pytest.mark.parametrize("angle", [0.4, 1.7, 3.0, 4.4])
def test_its_chain_has_one_freedom(shift: float, angle: float) -> None:
    """So a crank angle and a shift cannot both be given. With a third rotation in each ball joint it would be three, two and
    the spin of the rod."""
    p = parameters(10.0)
    found = settle(p, angle, shift * INCH)
    _, screws = chain(p, found.crank_angle, found.shift, found.unknowns)
    of_crank = np.zeros((6, 2))
    of_crank[2, 0] = of_crank[5, 1] = 1.0
    columns = np.concatenate([of_crank, np.concatenate([screws.real[0], screws.dual[0] / p.rod_length])], -1)
    assert 7 - np.linalg.matrix_rank(columns / np.linalg.norm(columns, axis=0), tol=1e-9) == 1


# offset, shift (in), twist (deg)
OPEN = [
    pytest.param(10.0, 3.5, 270.0, id="shift"),
    pytest.param(20.0, 0.0, 232.0, id="twist-232"),
    pytest.param(20.0, 0.0, 310.0, id="twist-310"),
]


@pytest.mark.parametrize(("offset", "shift", "twist"), OPEN)
def test_its_steps_become_small_on_open_loops(offset: float, shift: float, twist: float) -> None:
    """Accepted by the size of the step everywhere; true ball joints close everywhere."""
    p = parameters(offset, twist)
    found = settle(p, TURN, shift * INCH)
    assert found.settled.all()
    assert degrees(found.rotation_residual.max()) > 20.0
    assert found.position_error.max() / INCH > 1.5
    truth = close(p, TURN, shift * INCH)
    assert truth.rotation_residual.max() < 1e-12
    assert truth.length_residual.max() < 1e-12


def test_all_eighteen_equations_against_the_independent_reconstruction() -> None:
    found = settle(parameters(10.0), np.radians(np.arange(0.0, 360.0, 5.0)), 3.5 * INCH)
    assert degrees(found.rotation_residual.max()) == pytest.approx(20.26, abs=0.005)
    assert found.position_error.max() / INCH == pytest.approx(1.71, abs=0.005)


@pytest.mark.parametrize(("offset", "shift", "twist"), OPEN)
def test_where_it_settles_nothing_closes_better(offset: float, shift: float, twist: float) -> None:
    """Another minimiser of the same eighteen residuals, from the same start and from beside the end, comes no lower."""
    p = parameters(offset, twist)
    angle = radians(40.0)
    found = settle(p, angle, shift * INCH)
    units = np.array([1.0, 1.0, 1.0, 1.0, INCH])

    def errors(x: np.ndarray) -> np.ndarray:
        product, _ = chain(p, np.array([angle]), np.array([shift * INCH]), (x * units)[None])
        return np.concatenate([(product.real[0] - np.eye(3)).ravel(), product.dual[0].ravel() / INCH])

    def slopes(x: np.ndarray) -> np.ndarray:
        product, screws = chain(p, np.array([angle]), np.array([shift * INCH]), (x * units)[None])
        changes = [skew(screws[..., i]) @ product for i in range(5)]
        columns = [np.concatenate([c.real[0].ravel(), c.dual[0].ravel() / INCH]) for c in changes]
        return np.stack(columns, -1) * units

    end = found.unknowns[0] / units
    by_difference = [(errors(end + d) - errors(end - d)) / 2e-6 for d in 1e-6 * np.eye(5)]
    np.testing.assert_allclose(slopes(end).T, by_difference, atol=1e-6)
    reached = float(np.sum(errors(end) ** 2))
    assert reached > 1e-3
    for start in (planar(p, np.array([angle]))[0] / units, end + 0.01):
        least = least_squares(errors, start, jac=slopes, method="lm", xtol=1e-12, ftol=1e-12, gtol=1e-12)
        assert reached <= 2.0 * least.cost * (1.0 + 1e-6)


def test_why_the_rotation_left_is_the_shift_over_the_offset() -> None:
    """Lengths weigh most in inches, and only eta3, whose axis passes the origin at a4, can lift the loop by S1."""
    for offset in (10.0, 20.0, 30.0):
        worst = settle(parameters(offset), TURN, 3.5 * INCH).rotation_residual.max()
        assert worst == pytest.approx(asin(3.5 / offset), rel=0.05)


def test_its_result_depends_on_the_unit_of_length() -> None:
    """In inches or in metres: other slider positions by inches. `closure` gives the same (see its tests)."""
    p = parameters(20.0, 232.0)
    inches, metres = (settle(p, TURN, 0.0, unit=unit).unknowns[:, 4] for unit in (INCH, 1.0))
    assert np.abs(inches - metres).max() / INCH > 1.0


@pytest.mark.parametrize("offset", OFFSETS_IN)
def test_the_mechanism_assembles_far_beyond_the_published_limits(offset: float) -> None:
    """These are S1 = 1.5, 3.5 and 9 in; the mechanism's own fall with a4 and are 27 in and more."""
    limit = GREATEST_SHIFTS_IN[offset] - 0.01
    assert limit > 27.0
    assert close(parameters(offset), TURN, limit * INCH).length_residual.max() < 1e-12


def test_without_an_offset_any_shift_fails() -> None:
    """With a4 = 0 no axis can lift the loop: the steps do not become small."""
    assert not settle(parameters(0.0), TURN, 0.5 * INCH, max_steps=30).settled.all()


def test_the_mechanism_assembles_at_every_twist() -> None:
    """The published limits are 232 and 310 deg, at a4 = 20 and S1 = 0."""
    for twist in range(0, 360, 15):
        assert close(parameters(20.0, float(twist)), TURN, 0.0).length_residual.max() < 1e-12
