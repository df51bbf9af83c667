"""Normal forms: of maps whose coefficients are known, and of branches against runs beside the special points."""

from dataclasses import replace
from itertools import permutations
from math import sqrt

import numpy as np
import pytest

from analysis import periodic
from analysis.periodic.stability.nonlinear import Forms, form_coefficient
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import InputError
from linkwork.five_bar.published import SETS

RPM = RAD_S_PER_RPM


def test_period_doubling_of_the_logistic_map() -> None:
    """x -> r x (1 - x) at r = 3: f''^2/4 + f'''/6 = 9 (Kuznetsov, section 4.5)."""
    forms = Forms(lambda x: 3.0 * (2.0 / 3.0 + x) * (1.0 / 3.0 - x) - 2.0 / 3.0, np.array([[-1.0]]))
    assert form_coefficient(forms, periodic.Crossing.PERIOD_DOUBLING, -1.0, 1e-3) == pytest.approx(9.0, rel=1e-6)


def test_fold_of_a_parabola() -> None:
    forms = Forms(lambda x: x - 0.7 * x**2 + 3.0 * x**3, np.array([[1.0]]))
    assert abs(form_coefficient(forms, periodic.Crossing.FOLD, 1.0, 1e-3)) == pytest.approx(0.7, rel=1e-6)


def test_multilinear_forms_of_a_cubic_map() -> None:
    """They are those that the map is made of, at complex vectors too."""
    g = np.random.default_rng(2)
    a, b, c = g.normal(size=(3, 3)), g.normal(size=(3, 3, 3)), g.normal(size=(3, 3, 3, 3))
    b = (b + b.transpose(0, 2, 1)) / 2.0
    c = sum(c.transpose(0, *order) for order in permutations((1, 2, 3))) / 6.0

    def cubic(x: np.ndarray) -> np.ndarray:
        return a @ x + np.einsum("ijk,j,k", b, x, x) / 2.0 + np.einsum("ijkl,j,k,l", c, x, x, x) / 6.0

    second, third = Forms(cubic, a).complex_forms(0.1)
    u, v, w = g.normal(size=(3, 3)) + 1j * g.normal(size=(3, 3))
    assert second(u, v) == pytest.approx(np.einsum("ijk,j,k", b, u, v), rel=1e-9)
    assert third(u, v, w) == pytest.approx(np.einsum("ijkl,j,k,l", c, u, v, w), rel=1e-9)


def delayed(r: float, place: np.ndarray) -> np.ndarray:
    """The delayed logistic map x -> r x (1 - y), y -> x, from its fixed point 1 - 1/r."""
    fixed = 1.0 - 1.0 / r
    x, y = place + fixed
    return np.array([r * x * (1.0 - y), x]) - fixed


def test_torus_of_the_delayed_logistic_map() -> None:
    """At r = 2 it is supercritical, as the radius of the closed curve beyond it confirms."""
    multiplier = 0.5 + 0.5j * sqrt(3.0)
    forms = Forms(lambda x: delayed(2.0, x), np.array([[1.0, -1.0], [1.0, 0.0]]))
    coefficient = form_coefficient(forms, periodic.Crossing.TORUS, multiplier, 1e-3)
    assert coefficient < 0.0
    r = 2.001
    place = np.array([1e-3, 0.0])
    for _ in range(60_000):
        place = delayed(r, place)
    circle = []
    for _ in range(3000):
        place = delayed(r, place)
        circle.append(place)
    matrix = np.array([[1.0, 1.0 - r], [1.0, 0.0]])
    value, vectors = np.linalg.eig(matrix)
    radius = sqrt((abs(value[0]) - 1.0) / -coefficient)
    # along 2 Re(w q) with |w| the radius
    q = vectors[:, 0] / np.linalg.norm(vectors[:, 0])
    greatest = max(np.abs(2.0 * radius * (np.exp(1j * a) * q[1]).real) for a in np.linspace(0.0, 6.283, 400))
    assert np.abs(np.array(circle)[:, 1]).max() == pytest.approx(greatest, rel=0.05)


def branch_of(parameters: object, low: float, high: float) -> periodic.Branch:
    orbit = periodic.newton_orbit(parameters, periodic.Drive(speed=high * RPM))
    family = periodic.Family(parameters=parameters, drive=orbit.drive)
    return periodic.follow(family, orbit, high * RPM, low=low * RPM, high=high * RPM, direction=-1, most_points=700)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameters", "low", "high", "words"),
    [
        pytest.param(SETS["rig-1-spring-b"].parameters, 900.0, 1200.0, ["supercritical"], id="rig 1"),
        pytest.param(
            replace(SETS["rig-2-spring-c"].parameters, slider_damping=0.5),
            1150.0,
            1190.0,
            ["supercritical", "subcritical"],
            id="rig 2",
        ),
    ],
)
def test_a_run_beside_each_period_doubling_does_what_its_normal_form_says(
    parameters: object, low: float, high: float, words: list[str]
) -> None:
    branch = branch_of(parameters, low, high)
    forms = [periodic.normal_form(branch.family, special) for special in branch.special]
    assert [form.words for form in forms] == words
    for special, form in zip(branch.special, forms):
        assert periodic.confirm_form(branch.family, special, form).agrees(form)


def test_on_which_side_of_a_fold_the_motions_are() -> None:
    parameters = SETS["rig-1-spring-b"].parameters
    orbit = periodic.newton_orbit(parameters, periodic.Drive(speed=900.0 * RPM))
    family = periodic.Family(parameters=parameters, drive=orbit.drive)
    branch = periodic.follow(family, orbit, 900.0 * RPM, low=850.0 * RPM, high=1100.0 * RPM, most_points=200)
    fold = next(s for s in branch.special if s.kind is periodic.Crossing.FOLD)
    form = periodic.normal_form(family, fold)
    # the branch comes from lower speeds and turns back to them
    assert form.words == "both motions at lower values"
    assert form.uncertainty < 0.01 * abs(form.coefficient)
    with pytest.raises(InputError, match="no motion from which"):
        periodic.confirm_form(family, fold, form)


def test_next_to_the_limit_of_assembly_the_map_is_henons() -> None:
    """Folds and doublings lie within 1e-6 rpm of each other, and the map bends within a millionth of the crank's length.

    Of Henon's map, whose determinant is -b, the cubic coefficient of the doubling over the square of that of the fold is
    (1 + b) / (1 - b) for normed eigenvectors, which nearly agree here.
    """
    response = periodic.frequency_response("rig-1-spring-b", "670 rpm", "1100 rpm", doublings=0)
    found = [(s, periodic.normal_form(response.family, s)) for branch in response.branches for s in branch.special]
    beside = [(s, form) for s, form in found if s.parameter < 720.0 * RPM]
    assert len(beside) == 4
    for fold, doubling in (beside[:2], beside[2:]):
        if fold[1].kind is not periodic.Crossing.FOLD:
            fold, doubling = doubling, fold
        assert fold[0].parameter == pytest.approx(doubling[0].parameter, rel=1e-8)
        b = float(doubling[0].orbit.multipliers[1].real)
        ratio = doubling[1].coefficient / fold[1].coefficient ** 2
        assert ratio == pytest.approx((1.0 + b) / (1.0 - b), rel=3e-2)
        assert doubling[1].words == "supercritical"
    # the branch comes down, turns back at the first, and down again at the second
    assert [form.words for _, form in beside if form.kind is periodic.Crossing.FOLD] == [
        "both motions at higher values",
        "both motions at lower values",
    ]
