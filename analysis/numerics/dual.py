"""Dual numbers a + eps b with eps^2 = 0, whose parts are NumPy arrays: exact derivatives, and screws in space.

Dual numbers give derivatives: f(a + eps b) = f(a) + eps f'(a) b. NumPy's functions take them (``np.sin(x)``), they can be
combined with scalars and arrays, and comparisons compare their real parts.

>>> x = Dual(2.0, 1.0)
>>> (x * x + np.sqrt(x)).dual == 4.0 + 0.5 / np.sqrt(2.0)
True

In mechanics they are screws (Rahman, chapter II): a dual angle is an angle + eps a distance along the same axis, a dual
velocity an angular velocity + eps the velocity of the point at the origin, a dual force a force + eps its moment about the
origin, a dual momentum likewise. Dual vectors have shape (..., 3), dual matrices (..., 3, 3). The matrix of a frame with
orientation R and origin p is R + eps [p]R, with [p] the matrix of the cross product by p. It is orthogonal, so that its inverse
is its transpose (eq 4), and transforms screws from the described frame to the frame in which p and R are given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

Array: TypeAlias = NDArray[Any]

_COMPARISONS = {np.less, np.less_equal, np.equal, np.not_equal, np.greater_equal, np.greater}

#: Derivatives of the functions of one argument, from the argument x and the value f.
_UNARY: dict[Any, Callable[[Array, Array], Any]] = {
    np.positive: lambda x, f: 1.0,
    np.negative: lambda x, f: -1.0,
    np.absolute: lambda x, f: np.sign(x),
    np.square: lambda x, f: 2.0 * x,
    np.reciprocal: lambda x, f: -f * f,
    np.sqrt: lambda x, f: 0.5 / f,
    np.exp: lambda x, f: f,
    np.log: lambda x, f: 1.0 / x,
    np.sin: lambda x, f: np.cos(x),
    np.cos: lambda x, f: -np.sin(x),
    np.tan: lambda x, f: 1.0 + f * f,
    np.arcsin: lambda x, f: 1.0 / np.sqrt(1.0 - x * x),
    np.arccos: lambda x, f: -1.0 / np.sqrt(1.0 - x * x),
    np.arctan: lambda x, f: 1.0 / (1.0 + x * x),
    np.sinh: lambda x, f: np.cosh(x),
    np.cosh: lambda x, f: np.sinh(x),
    np.tanh: lambda x, f: 1.0 - f * f,
    np.sign: lambda x, f: 0.0,
}


def _power(a: Dual, b: Dual) -> Dual:
    """Return a^b.

    log a is computed only where the dual part of b is not zero, so that a negative a can have a constant exponent.
    """
    value = np.power(a.real, b.real)
    # b a^(b-1), which is 0 for b = 0 whatever a is
    slope = b.real * np.power(a.real, np.where(b.real == 0.0, 1.0, b.real - 1.0)) * a.dual
    # a^b log a is 0 in the limit for a = 0 and b > 0
    varies = (b.dual != 0.0) & ~((a.real == 0.0) & (b.real > 0.0))
    return Dual(value, slope + value * np.log(np.where(varies, a.real, 1.0)) * b.dual)


def _matmul(a: Dual, b: Dual) -> Dual:
    """Return a @ b; a and b may be vectors, as in NumPy."""
    if a.real.ndim == 1:
        return _matmul(a[None, :], b)[..., 0, :] if b.real.ndim > 1 else _matmul(a, b[:, None])[..., 0]
    if b.real.ndim == 1:
        return _matmul(a, b[:, None])[..., 0]
    a, b = _align_axes(a, b)
    return Dual(a.real @ b.real, a.real @ b.dual + a.dual @ b.real)


def _atan2(y: Dual, x: Dual) -> Dual:
    return Dual(np.arctan2(y.real, x.real), (x.real * y.dual - y.real * x.dual) / (x.real * x.real + y.real * y.real))


def _hypot(a: Dual, b: Dual) -> Dual:
    value = np.hypot(a.real, b.real)
    return Dual(value, (a.real * a.dual + b.real * b.dual) / value)


def _choose(value: Array, a: Dual, b: Dual) -> Dual:
    """Return the dual number, a or b, whose real part is ``value``; a if both have it."""
    return Dual(value, np.where(value == a.real, a.dual, b.dual))


#: Functions of two arguments, except the matrix product, in which vectors are a special case.
_BINARY: dict[Any, Callable[[Dual, Dual], Dual]] = {
    np.add: lambda a, b: Dual(a.real + b.real, a.dual + b.dual),
    np.subtract: lambda a, b: Dual(a.real - b.real, a.dual - b.dual),
    np.multiply: lambda a, b: Dual(a.real * b.real, a.real * b.dual + a.dual * b.real),
    np.divide: lambda a, b: Dual(a.real / b.real, (a.dual - a.real / b.real * b.dual) / b.real),
    np.power: _power,
    np.arctan2: _atan2,
    np.hypot: _hypot,
    np.minimum: lambda a, b: _choose(np.minimum(a.real, b.real), a, b),
    np.maximum: lambda a, b: _choose(np.maximum(a.real, b.real), a, b),
}


class Dual(NDArrayOperatorsMixin):
    """A dual number, or an array of them: real + eps dual.

    Parameters
    ----------
    real, dual : array_like
        The real and the dual part, broadcast to a common shape. The dual part may have additional axes in front, one entry for
        each direction of differentiation: ``Dual(2.0, [1.0, 0.0])`` is a number with its derivatives in two directions, and a
        real part of shape (n,) with m directions has a dual part of shape (m, n). In calculations axes of real parts are
        matched with each other, and axes of directions with each other.
    """

    __slots__ = ("dual", "real")
    __hash__ = None  # type: ignore[assignment]

    real: Array
    dual: Array

    def __init__(self, real: Any, dual: Any = 0.0) -> None:
        a, b = _inexact(real), _inexact(dual)
        if a.shape != b.shape:
            shape = np.broadcast_shapes(a.shape, b.shape)
            a = np.broadcast_to(a, shape[len(shape) - a.ndim :])
            b = np.broadcast_to(b, shape)
        self.real = a
        self.dual = b

    def __repr__(self) -> str:
        return f"Dual({self.real!r}, {self.dual!r})"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the real part."""
        return self.real.shape

    @property
    def T(self) -> Dual:
        """Transpose of the last two axes: the inverse of an orthogonal dual matrix (eq 4)."""
        return Dual(np.swapaxes(self.real, -1, -2), np.swapaxes(self.dual, -1, -2))

    @property
    def directions(self) -> int:
        """Number of axes for directions of differentiation; they are the first axes of the dual part."""
        return self.dual.ndim - self.real.ndim

    def __len__(self) -> int:
        """Return the length of the real part's first axis; TypeError for a single number."""
        return len(self.real)

    def __iter__(self) -> Iterator[Dual]:
        """Iterate along the real part's first axis."""
        return (self[i] for i in range(len(self)))

    def __bool__(self) -> bool:
        """Return whether a single number's real part is not 0."""
        return bool(self.real)

    def __getitem__(self, index: Any) -> Dual:
        """Return the elements at an index of the real part, with all their directions."""
        directions = (slice(None),) * self.directions
        return Dual(self.real[index], self.dual[directions + (index if isinstance(index, tuple) else (index,))])

    def __array__(self, *_: Any, **__: Any) -> Array:
        """Raise TypeError: an array of objects, or of the real part alone, would be silently wrong."""
        raise TypeError(
            "a dual number is not an array, and only NumPy's element-wise functions take it: use its real or dual part, or "
            "stack() or join() of analysis.numerics.dual for several"
        )

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply NumPy's function ``ufunc`` to dual numbers; TypeError if its derivative is not known here."""
        if method != "__call__" or options:
            return NotImplemented
        if ufunc in _COMPARISONS:
            return ufunc(*(x.real if isinstance(x, Dual) else x for x in inputs))
        if ufunc in (np.isfinite, np.isnan):
            both, every = (np.logical_and, np.all) if ufunc is np.isfinite else (np.logical_or, np.any)
            return both(ufunc(self.real), every(ufunc(self.dual), axis=tuple(range(self.directions))))
        x = [dual(i) for i in inputs]
        if ufunc is np.matmul:
            return _matmul(*x)
        if ufunc in _BINARY:
            return _BINARY[ufunc](*_align_axes(*x))
        if ufunc in _UNARY:
            value = ufunc(x[0].real)
            return Dual(value, _UNARY[ufunc](x[0].real, value) * x[0].dual)
        return NotImplemented


def _align_axes(*x: Dual) -> tuple[Dual, ...]:
    """Return dual numbers whose real parts have the same number of axes, so that NumPy matches directions with directions."""
    axes = max(part.real.ndim for part in x)
    return tuple(part if part.real.ndim == axes or not part.directions else _with_axes(part, axes) for part in x)


def _with_axes(x: Dual, axes: int) -> Dual:
    ones = (1,) * (axes - x.real.ndim)
    return Dual(x.real.reshape(ones + x.real.shape), x.dual.reshape(x.dual.shape[: x.directions] + ones + x.real.shape))


def _inexact(part: Any) -> Array:
    a = np.asarray(part)
    return a if np.issubdtype(a.dtype, np.inexact) else a.astype(float)


def dual(x: Any) -> Dual:
    """Return ``x`` as a dual number: unchanged if it is one already, else with dual part zero."""
    return x if isinstance(x, Dual) else Dual(x)


def variables(*values: Any) -> tuple[Dual, ...]:
    """Return independent variables: the i-th has the derivative 1 in direction i and 0 in the others.

    A result computed from them has its gradient in the dual part, directions first.

    Parameters
    ----------
    values : array_like
        Values of the variables: arrays of one shape, or scalars.
    """
    real = np.broadcast_arrays(*(_inexact(x) for x in values))
    directions = np.eye(len(real)).reshape(len(real), len(real), *(1,) * real[0].ndim)
    return tuple(Dual(a, unit) for a, unit in zip(real, directions))


def stack(parts: Sequence[Any], axis: int = -1) -> Dual:
    """Join dual numbers along a new axis; ``axis`` is negative, counted from the end."""
    x = _align_axes(*(dual(part) for part in parts))
    real = np.broadcast_arrays(*(part.real for part in x))
    slopes = np.broadcast_arrays(*(part.dual for part in x), np.empty(real[0].shape))[:-1]
    return Dual(np.stack(real, axis), np.stack(slopes, axis))


def join(*parts: Dual) -> Dual:
    """Join dual vectors or matrices along their last axis."""
    directions = np.broadcast_shapes(*(x.dual.shape[: x.directions] for x in parts))
    slopes = [np.broadcast_to(x.dual, directions + x.real.shape) for x in parts]
    return Dual(np.concatenate([x.real for x in parts], -1), np.concatenate(slopes, -1))


def cross(a: Any, b: Any) -> Dual:
    """Return the cross product a x b of dual vectors (..., 3).

    If a is the dual velocity of a body and b is a screw fixed in the body, a x b is the rate of b. If b moves in the body, add
    its rate relative to the body.
    """
    x, y = _align_axes(dual(a), dual(b))
    return Dual(np.cross(x.real, y.real), np.cross(x.real, y.dual) + np.cross(x.dual, y.real))


def skew(a: Any) -> Dual:
    """Return the matrix (..., 3, 3) of the cross product by a dual vector (..., 3)."""
    x = dual(a)
    return Dual(_skew(x.real), _skew(x.dual))


def axial(m: Any) -> Dual:
    """Return the dual vector (..., 3) of the antisymmetric part of a dual matrix (..., 3, 3): axial(skew(a)) = a."""
    x = dual(m)
    return Dual(_axial(x.real), _axial(x.dual))


def apply(m: Any, a: Any) -> Dual:
    """Multiply a dual matrix (..., 3, 3) by a dual vector (..., 3)."""
    return cast(Dual, dual(m) @ dual(a)[..., None])[..., 0]


def about_i(angle: Any) -> Dual:
    """Return the matrix of a screw displacement about and along the i axis by a dual angle (eq 2)."""
    return _rotation_about_axis(angle, 0)


def about_j(angle: Any) -> Dual:
    """Return the matrix of a screw displacement about and along the j axis by a dual angle."""
    return _rotation_about_axis(angle, 1)


def about_k(angle: Any) -> Dual:
    """Return the matrix of a screw displacement about and along the k axis by a dual angle (eq 1)."""
    return _rotation_about_axis(angle, 2)


def origin(m: Dual) -> Array:
    """Return the origin p (..., 3) of the frame that an orthogonal dual matrix R + eps [p]R describes."""
    return _axial(m.dual @ np.swapaxes(m.real, -1, -2))


def _rotation_about_axis(angle: Any, axis: int) -> Dual:
    c, s = np.cos(dual(angle)), np.sin(dual(angle))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rows: list[list[Any]] = [[0.0] * 3 for _ in range(3)]
    rows[axis][axis] = 1.0
    rows[i][i] = rows[j][j] = c
    rows[i][j] = -s
    rows[j][i] = s
    return stack([stack(row) for row in rows], axis=-2)


def _skew(a: Array) -> Array:
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def _axial(m: Array) -> Array:
    return 0.5 * np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1)
