"""The Runge-Kutta tableau proves itself: every order condition it must meet, up to order 8."""

from collections.abc import Iterator
from functools import cache
from itertools import combinations_with_replacement
from math import fsum, prod

import numpy as np
import pytest
from scipy.integrate import DOP853

from linkwork import tableau

#: A rooted tree as the sorted tuple of the trees that hang on its root.
Tree = tuple["Tree", ...]

#: The weights of the step: row 12 of A is the step itself.
B = dict(tableau.A[12])
ROUNDING = 1e-13


@cache
def trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees with ``order`` nodes: 1, 1, 2, 4, 9, 20, 48, 115."""
    found: set[Tree] = set()

    def grow(left: int, largest: int, chosen: tuple[Tree, ...]) -> None:
        if left == 0:
            found.add(tuple(sorted(chosen)))
            return
        for size in range(min(left, largest), 0, -1):
            for count in range(1, left // size + 1):
                for some in combinations_with_replacement(trees(size), count):
                    grow(left - size * count, size - 1, chosen + some)

    grow(order - 1, order - 1, ())
    return tuple(sorted(found))


def nodes(tree: Tree) -> int:
    return 1 + sum(nodes(branch) for branch in tree)


def density(tree: Tree) -> int:
    """Butcher's gamma: the number of nodes of the tree and of every subtree, multiplied."""
    return nodes(tree) * prod(density(branch) for branch in tree)


@cache
def weight(tree: Tree, stage: int) -> float:
    """Elementary weight of the tree with its root at a stage."""
    return prod(fsum(a * weight(branch, j) for j, a in tableau.A[stage]) for branch in tree)


def conditions(order: int) -> Iterator[Tree]:
    for n in range(1, order + 1):
        yield from trees(n)


def test_trees_are_all_there() -> None:
    assert [len(trees(n)) for n in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]
    assert sorted(density(t) for t in trees(4)) == [4, 8, 12, 24]


@pytest.mark.parametrize("stage", range(16))
def test_row_sums_are_the_abscissae(stage: int) -> None:
    assert fsum(a for _, a in tableau.A[stage]) == pytest.approx(tableau.C[stage], abs=ROUNDING)


@pytest.mark.parametrize("stage", range(16))
def test_method_is_explicit(stage: int) -> None:
    assert all(j < stage for j, _ in tableau.A[stage])


@pytest.mark.parametrize("power", range(8))
def test_quadrature_conditions(power: int) -> None:
    assert fsum(b * tableau.C[j] ** power for j, b in B.items()) == pytest.approx(1.0 / (power + 1), abs=ROUNDING)


def test_all_two_hundred_order_conditions() -> None:
    tested = 0
    for tree in conditions(tableau.ORDER):
        total = fsum(b * weight(tree, j) for j, b in B.items())
        assert total == pytest.approx(1.0 / density(tree), abs=ROUNDING), tree
        tested += 1
    assert tested == 200


def test_order_is_not_nine() -> None:
    misses = [abs(fsum(b * weight(t, j) for j, b in B.items()) - 1.0 / density(t)) for t in trees(9)]
    assert max(misses) > 1e-6


@pytest.mark.parametrize(("estimate", "order"), [(tableau.E5, 5), (tableau.E3, 3)])
def test_error_estimates_vanish_up_to_their_order_and_not_beyond(estimate: tuple[float, ...], order: int) -> None:
    def misses(n: int) -> list[float]:
        return [abs(fsum(e * weight(t, j) for j, e in enumerate(estimate))) for t in trees(n)]

    for n in range(1, order + 1):
        assert max(misses(n)) < ROUNDING
    assert max(misses(order + 1)) > 1e-6


def test_interpolant_is_of_order_seven() -> None:
    # on the monomials y' = (n + 1) t^n over one step of length 1 from 0 the interpolant is exact up to t^7
    for degree in range(1, 8):
        slopes = [degree * c ** (degree - 1) for c in tableau.C]
        rise = 1.0
        rows = [rise, slopes[0] - rise, 2.0 * rise - slopes[0] - slopes[12]]
        rows += [fsum(d * k for d, k in zip(row, slopes)) for row in tableau.D]
        for s in (0.1, 0.35, 0.6, 0.95):
            value = 0.0
            for n, row in enumerate(reversed(rows)):
                value = (value + row) * (s if n % 2 == 0 else 1.0 - s)
            assert value == pytest.approx(s**degree, abs=1e-12)


def test_same_numbers_as_in_an_independent_listing() -> None:
    # SciPy's, typed from the same book by others
    full = np.zeros((16, 16))
    for i, row in enumerate(tableau.A):
        for j, a in row:
            full[i, j] = a
    assert full[:12, :12] == pytest.approx(DOP853.A, abs=1e-15)
    assert full[12, :12] == pytest.approx(DOP853.B, abs=1e-15)
    assert full[13:] == pytest.approx(DOP853.A_EXTRA, abs=1e-15)
    assert tableau.C[:12] == pytest.approx(DOP853.C, abs=1e-15)
    assert tableau.C[13:] == pytest.approx(DOP853.C_EXTRA, abs=1e-15)
    assert np.array(tableau.E3) == pytest.approx(DOP853.E3, abs=1e-15)
    assert np.array(tableau.E5) == pytest.approx(DOP853.E5, abs=1e-15)
    assert np.array(tableau.D) == pytest.approx(DOP853.D, abs=1e-12)
    assert DOP853.n_stages == tableau.STAGES
