"""Errors in Rahman's equations, each against another formulation; what they do to his statements is tested beside these."""

from math import cos, pi, sin

import numpy as np
import pytest

from analysis.numerics.dual import Dual
from analysis.slider_crank import close, joint_loads, rates
from analysis.slider_crank.closure import chain, equations, planar, settle
from analysis.studies.rahman import method, printed
from analysis.studies.rahman.forces import planar_forces
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, parameters
from tests.published_rahman import CRANK_IN, INCH, MASSES_LB_S2_IN, POUND_FORCE, ROD_IN, TORQUE_LB_IN

TURN = np.radians(np.arange(0.0, 360.0, 10.0))
W = 50.0 * pi / 30.0


def test_the_thesiss_equations_of_a_step_are_those_of_its_matrices() -> None:
    """Eqs 11 to 25 with 3x3 dual matrices, H = T Q T' and B' - I, at an open loop."""
    p, angle, shift = parameters(10.0, 300.0), np.array([0.7]), np.array([3.5 * INCH])
    q = np.array([[2.1, 0.35, -1.3, 0.2, 40.0 * INCH]])
    product, screws = chain(p, angle, shift, q)

    def turned(c: float, s: float) -> np.ndarray:
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def tilted(c: float, s: float) -> np.ndarray:
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

    th2, eta2, th3, eta3, _ = q[0]
    c, s, a1, a2 = cos(angle[0]), sin(angle[0]), CRANK_IN, ROD_IN
    m1 = Dual(turned(c, s), [[-3.5 * s, -3.5 * c, a1 * s], [3.5 * c, -3.5 * s, -a1 * c], [0.0, a1, 0.0]])
    rod = turned(cos(th2), sin(th2)) @ tilted(cos(eta2), sin(eta2))
    l2 = Dual(rod, rod @ np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -a2], [0.0, a2, 0.0]]))
    l3 = Dual(
        turned(cos(th3), sin(th3)) @ tilted(cos(eta3), sin(eta3)) @ np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    )
    about = turned(0.0, 1.0) - np.diag([0.0, 0.0, 1.0])

    def leaning(th: float) -> np.ndarray:
        return np.array([[0.0, 0.0, cos(th)], [0.0, 0.0, sin(th)], [-cos(th), -sin(th), 0.0]])

    before = (m1, m1, m1 @ l2, m1 @ l2, m1 @ l2 @ l3)
    operators = (Dual(about), Dual(leaning(th2)), Dual(about), Dual(leaning(th3)), Dual(0.0 * about, about))
    columns = [t @ operator @ Dual(t.real.T, t.dual.T) for t, operator in zip(before, operators)]
    upper = ([0, 0, 1], [1, 2, 2])
    matrix = np.array([np.concatenate([h.real[upper], h.dual[upper]]) for h in columns]).T
    b, b_dual = product.real[0], product.dual[0] / INCH
    diagonal = np.diagonal(b)
    right = np.concatenate([b.T[upper] + diagonal[upper[0]] + diagonal[upper[1]] - 2.0, b_dual.T[upper]])
    found, found_right = equations(product, screws, INCH, "printed")
    np.testing.assert_allclose(found[0], matrix, atol=1e-12)
    np.testing.assert_allclose(found_right[0], right, atol=1e-12)
    found = equations(product, screws, INCH, "upper")[1][0]
    np.testing.assert_allclose(found, [*b.T[upper], *b_dual.T[upper]], atol=1e-12)


def test_where_the_thesiss_steps_become_small_its_equations_are_not_met() -> None:
    """A'V = 0, and V is not."""
    p, angle, shift = parameters(10.0), np.array([0.35]), np.array([3.5 * INCH])
    found = settle(p, angle, shift, rows="printed", step_tolerance=1e-12)
    assert found.settled.all()
    ((matrix,), (right,)) = equations(*chain(p, angle, shift, found.unknowns), INCH, "printed")
    np.testing.assert_allclose(matrix.T @ right, 0.0, atol=1e-9)
    assert np.abs(right).max() > 0.1


@pytest.mark.parametrize("erratum_6", [False, True])
@pytest.mark.parametrize("erratum_5", [False, True])
def test_errata_5_and_6_momentum_is_balanced_with_both_mended_alone(erratum_5: bool, erratum_6: bool) -> None:
    """What acts from outside on the planar mechanism against the rate of its momentum, differentiated numerically."""
    forces = planar_forces(erratum_5=erratum_5, erratum_6=erratum_6)
    p, h, lacking = parameters(10.0), 1e-4, []
    for angle in TURN[1::5]:

        def momentum(t: float, angle: float = angle) -> np.ndarray:
            found = close(p, angle + CRANK_SPEED * t, 0.0)
            moved = rates(found, speed=CRANK_SPEED)
            pins = (np.zeros(3), found.crank_pin[0], found.slider_pin[0])
            centres = (0.5 * pins[1], 0.5 * (pins[1] + pins[2]), pins[2])
            bodies = zip(MASSES_LB_S2_IN, centres, (moved.crank, moved.rod, moved.slider))
            return (
                sum(mass * (body.dual[0] + np.cross(body.real[0], centre)) for mass, centre, body in bodies)[:2] / INCH
            )

        at = round(np.degrees(angle) * 2.0)
        # k4 is along -j
        outside = [forces["1F1i"][at] + forces["4F4i"][at], forces["1F1j"][at] - forces["4F4k"][at]]
        lacking.append(np.abs(outside - (momentum(h) - momentum(-h)) / (2.0 * h)).max())
    if erratum_5 and erratum_6:
        assert max(lacking) < 1e-4
    else:
        assert max(lacking) > 5.0


def test_the_printed_accelerations_are_the_second_rates_of_the_planar_loop() -> None:
    """Eqs 38a, 39a, 42a along the motion of the planar mechanism, against second differences of its closed form."""
    p, h = parameters(20.0), 1e-3
    at = [planar(p, TURN + 0.03 + n * h) / [1.0, 1.0, 1.0, 1.0, INCH] for n in (-2, -1, 0, 1, 2)]
    seconds = W * W * (-at[0] + 16.0 * at[1] - 30.0 * at[2] + 16.0 * at[3] - at[4]) / (12.0 * h * h)
    q = method.joints(at[2])
    found = printed.joint_accelerations(printed.CRANK_AT_SPEED, q, printed.joint_rates(printed.CRANK_AT_SPEED, q))
    np.testing.assert_allclose([found.th2, found.th3, found.s4], seconds[:, [0, 2, 4]].T, rtol=1e-6, atol=1e-5)


def test_erratum_7_the_axial_crank_force_cannot_be_prescribed() -> None:
    """The thesis sets it to 0, or m1 S1'', though S1 is given. What the motion takes at a4 = 10, S1 = 3.5 in is other than
    that, by as much as the rod pulls along the axis."""
    found = close(parameters(10.0), TURN + 0.02, 3.5 * INCH)
    loads = joint_loads(found, speed=CRANK_SPEED, slider_force=0.0)
    np.testing.assert_allclose(loads.axial, loads.crank_pin[:, 2], atol=1e-10)
    assert np.abs(loads.axial).max() > 0.2 * POUND_FORCE
    given = joint_loads(found, speed=CRANK_SPEED, torque=CRANK_TORQUE)
    assert np.abs(given.axial).max() > 1.0 * POUND_FORCE
    # with the shift in motion: not m1 S1'' either
    moving = joint_loads(found, speed=CRANK_SPEED, shift_acceleration=2.0, slider_force=0.0)
    assert np.abs(moving.axial - parameters().crank_mass * 2.0).max() > 0.2 * POUND_FORCE


def test_erratum_8_the_crank_equation_is_met_whatever_the_slider_force_is() -> None:
    """69i and 69j solve 62a, so that 69k, which is 62a again, gives back any 2F2i that is put in."""
    q = printed.Joints(*(np.array(value) for value in (2.1, 0.0, -1.3, 0.0, 40.0)))
    crank = printed.CRANK_AT_SPEED
    r = printed.joint_rates(crank, q)
    forces = printed.joint_forces(crank, printed.bodies(parameters()), q, r, r, TORQUE_LB_IN)
    inertia = -forces["along crank"] - forces["2F2i"]
    for value in (-25.0, 0.0, 10.0):
        f1i, f1j = printed.crank_bearing_forces(np.array(0.7), forces | {"along crank": -(value + inertia)})
        assert -f1i * cos(0.7) - f1j * sin(0.7) - inertia == pytest.approx(value, abs=1e-12)
