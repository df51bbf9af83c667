"""Dual numbers: derivatives against known ones and differences, the algebra's laws, screws against rigid motions."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.numerics import dual
from analysis.numerics.dual import Dual, about_i, about_j, about_k, apply, cross, origin, skew, stack, variables
from analysis.numerics.tracing import rebind_functions
from analysis.slider_crank.shifts import plant_functions
from linkwork import friction
from linkwork.slider_crank import dynamics, kinematics, vectors
from tests.slider_cranks import DRIVES, seeded

sizes = st.floats(-3.0, 3.0, allow_subnormal=False)
seeds = st.integers(0, 2**32 - 1)


def several(*strategies: Any) -> Callable[..., Any]:
    """Decorate a test of sixty examples, the same each time."""
    return lambda test: settings(max_examples=60, derandomize=True)(given(*strategies)(test))


@st.composite
def duals(draw: st.DrawFn) -> Dual:
    return Dual(draw(sizes), draw(sizes))


def same(a: Dual, b: Dual, tolerance: float = 1e-12) -> None:
    np.testing.assert_allclose(a.real, b.real, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(a.dual, b.dual, rtol=tolerance, atol=tolerance)


def derivative(function: Callable[[Dual], Any], x: Any) -> Any:
    return dual.dual(function(Dual(x, 1.0))).dual


def drawn(seed: int, *shape: int) -> Dual:
    random = np.random.default_rng(seed)
    return Dual(random.normal(size=shape), random.normal(size=shape))


def displacement(seed: int) -> Dual:
    """A general orthogonal dual matrix."""
    a = drawn(seed, 4)
    return about_k(a[0]) @ about_i(a[1]) @ about_j(a[2]) @ about_k(a[3])


# ------------------------------------------------------------------ numbers


@several(duals(), duals(), duals())
def test_the_numbers_are_a_commutative_ring(a: Dual, b: Dual, c: Dual) -> None:
    same(a * b, b * a)
    same(a * (b + c), a * b + a * c, 1e-11)
    same((a * b) * c, a * (b * c), 1e-11)
    same(a - a, Dual(0.0))
    same(Dual(0.0, 1.0) * Dual(0.0, 1.0), Dual(0.0))


@several(duals(), duals().filter(lambda x: abs(x.real) > 0.1))
def test_division_undoes_multiplication(a: Dual, b: Dual) -> None:
    same(a * b / b, a, 1e-10)
    same(1.0 / b * b, Dual(1.0), 1e-10)


FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "tanh": np.tanh,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "hypot": lambda x: np.sqrt(x * x + np.sin(x) ** 2) if not isinstance(x, Dual) else np.hypot(x, np.sin(x)),
    "arctan": np.arctan,
    "arcsin": lambda x: np.arcsin(0.4 * x),
    "arccos": lambda x: np.arccos(0.4 * x),
    "reciprocal": np.reciprocal,
    "square": np.square,
    "power": lambda x: x**3 + x**-1.5 + 2.0**x + x**x,
    "divide": lambda x: (1.0 + x) / (2.0 + x * x) - 3.0 / x,
    "atan2": lambda x: np.arctan2(np.sin(x), x * x) + np.arctan2(1.0, x),
}


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name != "atan2"])
def test_derivatives_by_the_complex_step(name: str) -> None:
    x = np.linspace(0.3, 2.2, 7)
    expected = FUNCTIONS[name](x + 1e-30j).imag / 1e-30
    np.testing.assert_allclose(derivative(FUNCTIONS[name], x), expected, rtol=1e-13)


def test_derivative_of_the_angle_in_all_quadrants() -> None:
    turn = np.linspace(-3.0, 3.0, 25)
    slope = derivative(lambda t: np.arctan2(2.0 * np.sin(t), 2.0 * np.cos(t)), turn)
    np.testing.assert_allclose(slope, 1.0, rtol=1e-14)


def test_derivatives_of_magnitude_and_constant_powers_where_logarithms_have_none() -> None:
    x = np.array([-2.0, -0.5, 3.0])
    np.testing.assert_array_equal(derivative(np.absolute, x), [-1.0, -1.0, 1.0])
    np.testing.assert_allclose(derivative(lambda a: a**3, x), 3.0 * x**2)
    np.testing.assert_array_equal(derivative(lambda a: a**0, np.array([0.0, 1.0])), [0.0, 0.0])
    np.testing.assert_array_equal(derivative(lambda a: a**1, np.array([0.0, -1.0])), [1.0, 1.0])


def test_scalars_arrays_and_dual_numbers_mix() -> None:
    x = Dual(np.array([1.0, 2.0]), 1.0)
    for y in (np.array([3.0, 4.0]) * x, x * np.array([3.0, 4.0])):
        assert isinstance(y, Dual)
        np.testing.assert_array_equal(y.real, [3.0, 8.0])
        np.testing.assert_array_equal(y.dual, [3.0, 4.0])
    assert isinstance(np.float64(2.0) - x, Dual)
    same(2 - x, Dual([1.0, 0.0], [-1.0, -1.0]))
    same(-x + 1 - (+x), Dual([-1.0, -3.0], [-2.0, -2.0]))
    same(Dual(2), Dual(2.0))


def test_comparisons_see_the_real_part() -> None:
    a, b = Dual(1.0, 5.0), Dual(1.0, -5.0)
    assert a == b
    assert a <= b
    assert not a < b
    assert Dual(0.0, 9.0) < 1.0
    assert np.array_equal(Dual([1.0, 3.0]) > 2.0, [False, True])
    assert not np.isfinite(Dual(1.0, np.inf))


def test_what_has_no_derivative_is_refused() -> None:
    with pytest.raises(TypeError):
        np.floor(Dual(1.0))
    with pytest.raises(TypeError):
        np.add.reduce(Dual([1.0, 2.0]))
    with pytest.raises(TypeError, match="stack"):
        np.asarray(Dual(1.0))
    with pytest.raises(TypeError):
        float(Dual(1.0))


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_directions_are_no_axis_of_the_numbers(size: int) -> None:
    """Two numbers with two directions meet arrays of as many elements, fewer and more: by differences of the real parts."""
    c, h = np.linspace(0.5, 2.0, size), 1e-6
    operations: list[Callable[[Any, Any], Any]] = [
        lambda x, y: x * c,
        lambda x, y: c - x * y,
        lambda x, y: c / x + y,
        lambda x, y: x**c + c**y,
        lambda x, y: np.arctan2(x, c) + np.hypot(c, y),
        lambda x, y: np.minimum(x, c) + np.maximum(c, y),
        lambda x, y: stack([x, c, y])[..., 0] if isinstance(x, Dual) else x + 0.0 * c,
        lambda x, y: np.outer(c, [1.0, 2.0]) @ (stack([x, y]) if isinstance(x, Dual) else np.array([x, y])),
    ]
    x, y = variables(2.1, 3.2)
    for operation in operations:
        found = operation(x, y)
        assert found.shape == (size,)
        assert found.dual.shape == (2, size)
        slopes = [operation(2.1 + h, 3.2) - operation(2.1 - h, 3.2), operation(2.1, 3.2 + h) - operation(2.1, 3.2 - h)]
        np.testing.assert_allclose(found.dual, np.array(slopes) / (2.0 * h), rtol=1e-7, atol=1e-8)


def test_directions_go_through_vectors_and_matrices_without_them() -> None:
    x, y = variables(0.4, 2.0)
    many = drawn(1, 2, 3)
    vector = stack([x, y, 0.0])
    for product in (cross(vector, many), cross(many, vector)):
        assert product.dual.shape == (2, 2, 3)
    slope = np.cross([0.0, 1.0, 0.0], many.real) + np.cross([0.4, 2.0, 0.0], many.dual)
    np.testing.assert_allclose(cross(vector, many).dual[1], slope)
    turned = apply(about_k(x), many)
    c, s = np.cos(0.4), np.sin(0.4)
    rate = np.array([[-s, -c, 0.0], [c, -s, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(turned.dual[0], many.real @ rate.T + many.dual @ about_k(0.4).real.T, atol=1e-14)
    np.testing.assert_allclose(turned.dual[1], many.dual @ about_k(0.4).real.T, atol=1e-14)
    # a vector on either side of the product
    matrix = about_k(x)
    np.testing.assert_allclose((matrix @ np.array([1.0, 2.0, 3.0])).dual[0], rate @ [1.0, 2.0, 3.0], atol=1e-14)
    np.testing.assert_allclose((np.array([1.0, 2.0, 3.0]) @ matrix).dual[0], rate.T @ [1.0, 2.0, 3.0], atol=1e-14)
    squared = vector @ vector
    np.testing.assert_allclose(squared.dual, [0.8, 4.0])
    both = dual.join(vector, many[0])
    assert both.dual.shape == (2, 6)
    np.testing.assert_array_equal(both.dual[0], [1.0, 0.0, 0.0, *many.dual[0]])


@pytest.mark.parametrize("base", [-2.0, 0.0])
def test_a_power_whose_exponent_does_not_vary_needs_no_logarithm(base: float) -> None:
    same(Dual(base, 1.0) ** Dual(2.0), Dual(base**2, 2.0 * base))
    same(Dual(base, 1.0) ** Dual([2.0, 3.0], 0.0), Dual([base**2, base**3], [2.0 * base, 3.0 * base**2]))
    # 0^x is 0 for all x > 0
    same(Dual(0.0) ** Dual(2.0, 1.0), Dual(0.0))


def test_the_lesser_and_the_greater_of_two() -> None:
    a, b = Dual([1.0, 5.0], [2.0, 3.0]), Dual([4.0, 4.0], [7.0, 8.0])
    same(np.minimum(a, b), Dual([1.0, 4.0], [2.0, 8.0]))
    same(np.maximum(a, b), Dual([4.0, 5.0], [7.0, 3.0]))
    same(np.sign(Dual([-3.0, 2.0], 1.0)), Dual([-1.0, 1.0]))
    same(abs(Dual(-3.0, 1.0)), Dual(3.0, -1.0))


def test_what_is_not_finite_is_reported_for_all_directions_of_a_number() -> None:
    x = Dual([1.0, 2.0, np.nan], [[0.0, np.inf, 0.0], [1.0, np.nan, 1.0]])
    assert np.isfinite(x).tolist() == [True, False, False]
    assert np.isnan(x).tolist() == [False, True, True]


# ------------------------------------------------------------------ the plant's own functions


@pytest.mark.parametrize("seed", range(8))
def test_the_plant_differentiated_through_tracing(seed: int) -> None:
    """Slider position, and torque and accelerations of the equations of motion, by the state and all parameters."""
    case = seeded(seed)
    inputs = case.inputs("torque-force" if seed % 2 else "speed-shift")
    names = [name for name in case.p._fields if name != "branch"]

    def outputs(f: Any, x: Any) -> list[Any]:
        p = case.p._replace(**dict(zip(names, x[4:])))
        state = (*x[:4], 0.0, 0.0)
        q = f.position(state[0], state[1], p)
        k = f.coefficients(q, p)
        motion = f.motion(q, k, state, inputs, p)
        reactions = f.reactions(q, state, motion, inputs, p)
        return [q.s4, k.kth, k.ks, motion.torque, motion.crank_acceleration, motion.force, *reactions.guide]

    x = [*case.state[:4], *(getattr(case.p, name) for name in names)]
    exact = outputs(plant_functions(), variables(*x))
    moved = np.array(x) + 1e-30j * np.eye(len(x))
    complex_step = np.imag([outputs(plant_functions(), row) for row in moved.tolist()]) / 1e-30
    values = outputs(rebind_functions((friction, vectors, kinematics, dynamics), {}), x)
    for y, value, by_step in zip(exact, values, complex_step.T):
        result = y if isinstance(y, Dual) else Dual(y, np.zeros(len(x)))
        assert result.real == pytest.approx(value, rel=1e-13, abs=1e-13)
        slopes = np.broadcast_to(result.dual, by_step.shape)
        np.testing.assert_allclose(slopes, by_step, rtol=1e-10, atol=1e-12 * np.abs(by_step).max())


def test_every_drive_of_the_plant_takes_dual_numbers() -> None:
    case = seeded(3)
    for drive in DRIVES:
        x = plant_functions().impose_groove((Dual(case.state[0], 1.0), *case.state[1:]), DRIVES[drive][2], case.p)
        rate = plant_functions().derivative(x, case.inputs(drive), case.p)
        h = 1e-6

        def at(angle: float, drive: str = drive) -> np.ndarray:
            return np.array(dynamics.derivative((angle, *case.state[1:]), case.inputs(drive), case.p))

        slope = (at(case.state[0] + h) - at(case.state[0] - h)) / (2.0 * h)
        for y, expected in zip(rate, slope):
            found = float(y.dual) if isinstance(y, Dual) else 0.0
            assert found == pytest.approx(expected, rel=1e-5, abs=1e-5 * np.abs(slope).max())


# ------------------------------------------------------------------ screws


@several(seeds)
def test_displacements_are_orthogonal_and_inverted_by_transposing(seed: int) -> None:
    m = displacement(seed)
    same(m @ m.T, Dual(np.eye(3)))
    same(m.T @ m, Dual(np.eye(3)))


@several(seeds)
def test_displacements_compose_as_rigid_motions(seed: int) -> None:
    """The same by orientations and origins: R = R1 R2, p = p1 + R1 p2."""
    first, second = displacement(seed), displacement(seed + 1)
    both = first @ second
    np.testing.assert_allclose(both.real, first.real @ second.real, atol=1e-13)
    np.testing.assert_allclose(origin(both), origin(first) + first.real @ origin(second), atol=1e-12)
    same(Dual(both.real, skew(origin(both)).real @ both.real), both)


@pytest.mark.parametrize(("about", "axis"), [(about_i, 0), (about_j, 1), (about_k, 2)])
def test_screw_displacement_about_an_axis(about: Callable[[Any], Dual], axis: int) -> None:
    angle, distance = 0.7, 2.5
    m = about(Dual(angle, distance))
    np.testing.assert_allclose(origin(m), distance * np.eye(3)[axis], atol=1e-15)
    np.testing.assert_allclose(m.real[:, axis], np.eye(3)[axis], atol=1e-15)
    # right-handed: the next axis turns towards the one after
    following, last = (axis + 1) % 3, (axis + 2) % 3
    assert m.real[last, following] == pytest.approx(np.sin(angle))
    # its derivative by the angle is the cross product by the axis
    rate = Dual(about(angle + 1e-6).real - about(angle - 1e-6).real) / 2e-6
    np.testing.assert_allclose(rate.real, skew(np.eye(3)[axis]).real @ m.real, atol=1e-9)


@several(seeds)
def test_products_do_not_depend_on_the_frame(seed: int) -> None:
    a, b, m = drawn(seed, 3), drawn(seed + 1, 3), displacement(seed)
    same(apply(m, a) @ apply(m, b), a @ b, 1e-10)
    same(cross(apply(m, a), apply(m, b)), apply(m, cross(a, b)), 1e-10)
    same(apply(skew(a), b), cross(a, b))
    same(dual.axial(skew(a)), a)
    same(cross(a, b), -cross(b, a))
