"""What happens where a motion loses its stability: gently or with a jump, by the normal form of the map over a period.

On the centre manifold of a special point the map is one of three normal forms (Y. A. Kuznetsov, Elements of Applied Bifurcation
Theory, 3rd ed., Springer 2004, sections 5.4 and 8.7). The sign of one coefficient decides: beyond a supercritical period
doubling or torus point a stable motion grows out of the old one; beyond a subcritical one the mechanism jumps. The second and
third derivatives of the map are differences of it along eigenvectors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError

from .branches import SpecialPoint
from .families import Family
from .floquet import Crossing
from .orbits import OrbitError, PeriodicOrbit, orbit_of, period_from
from .starts import scale_of

#: Step of the differences, relative to the scale of y, the relative uncertainty down to which it is halved, and how often at
#: most: the map over many turns bends within a thousandth of the scale, that next to the limit of assembly within a millionth.
_STEP, _CERTAIN, _HALVINGS = 8e-3, 1e-2, 16
#: Distance of the multiplier from where it crosses the unit circle up to which the point counts as located: next to the limit
#: of assembly it crosses from -1 to 1 within the rounding of the parameter.
_LOCATED = 1e-2
#: Relative difference of the coefficients with the whole and the half step above which its sign is not settled.
UNSETTLED = 0.5
_UNSETTLED = "not settled"
#: Distance of the multiplier from the unit circle at which a run confirms a normal form, at least and at most, the square of
#: the distance from the old motion that it is chosen for, and turns.
_BEYOND, _SMALL, _TURNS = (2e-3, 2e-2), 0.04, 6000

FloatArray = NDArray[np.float64]
Form = Callable[..., NDArray[np.complex128]]


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalForm:
    """The normal form at a special point of a branch.

    Attributes
    ----------
    kind : Crossing
    coefficient : float
        In the scale of y: of a fold half the second derivative along the eigenvector, of a period doubling the cubic
        coefficient, positive where it is supercritical, of a torus the first Lyapunov coefficient, negative where it is.
    uncertainty : float
        Change of the coefficient when the step of the differences is halved; infinite where the point is not located.
    words : str
        "supercritical", "subcritical", or "not settled", where the coefficient is not certain or the multiplier crosses the
        circle too fast for the point to be located; of a fold on which side of it the two motions are.
    """

    kind: Crossing
    coefficient: float
    uncertainty: float
    words: str


class Forms:
    """The multilinear forms of a map about its fixed point at zero, by differences.

    Parameters
    ----------
    of : callable
        The map, (n,) to (n,).
    matrix : ndarray, shape (n, n)
        Its derivative at zero.
    """

    def __init__(self, of: Callable[[FloatArray], FloatArray], matrix: FloatArray) -> None:
        self.of = of
        self.matrix = matrix

    def second(self, x: FloatArray, h: float) -> FloatArray:
        """B(x, x)."""
        return (self.of(h * x) + self.of(-h * x) - 2.0 * self.of(0.0 * x)) / h**2

    def third(self, x: FloatArray, h: float) -> FloatArray:
        """C(x, x, x)."""
        of = self.of
        return (of(2.0 * h * x) - 2.0 * of(h * x) + 2.0 * of(-h * x) - of(-2.0 * h * x)) / (2.0 * h**3)

    def complex(self, h: float) -> tuple[Form, Form]:
        """B(u, v) and C(u, v, w) of complex vectors, by polarisation of the real ones."""

        def b_real(u: FloatArray, v: FloatArray) -> FloatArray:
            return (self.second(u + v, h) - self.second(u - v, h)) / 4.0

        def c_real(u: FloatArray, v: FloatArray, w: FloatArray) -> FloatArray:
            return (
                self.third(u + v + w, h)
                - self.third(u + v - w, h)
                - self.third(u - v + w, h)
                + self.third(u - v - w, h)
            ) / 24.0

        return _of_complex(b_real, 2), _of_complex(c_real, 3)


def _forms(orbit: PeriodicOrbit) -> Forms:
    """Those of the map over a period, in scaled components from the orbit."""
    scale = scale_of(orbit.parameters, orbit.drive, orbit.start)

    def after(x: FloatArray) -> FloatArray:
        return x + period_from(orbit.parameters, orbit.drive, orbit.start + scale * x, orbit.turns).shift / scale

    return Forms(after, orbit.monodromy * scale / scale[:, None])


def _of_complex(form: Callable[..., FloatArray], count: int) -> Form:
    """A real multilinear form of complex vectors."""

    def of(*vectors: NDArray[np.complex128]) -> NDArray[np.complex128]:
        total = np.zeros(len(vectors[0]), dtype=complex)
        for number in range(2**count):
            parts = [(v.imag, 1j) if number >> n & 1 else (v.real, 1.0) for n, v in enumerate(vectors)]
            if all(np.any(part) for part, _ in parts):
                total += np.prod([factor for _, factor in parts]) * form(*(part for part, _ in parts))
        return total

    return of


def _eigenvectors(matrix: FloatArray, value: complex) -> tuple[NDArray[np.complex128], NDArray[np.complex128], complex]:
    """Right and left eigenvectors of the multiplier nearest to ``value``, the right of length 1, their product 1; it."""
    values, right = np.linalg.eig(matrix.astype(complex))
    n = int(np.abs(values - value).argmin())
    adjoint, left = np.linalg.eig(matrix.T.astype(complex))
    m = int(np.abs(adjoint - values[n].conjugate()).argmin())
    q = right[:, n] / np.linalg.norm(right[:, n])
    p = left[:, m]
    return q, p / np.conj(np.vdot(p, q)), complex(values[n])


def normal_form(family: Family, special: SpecialPoint) -> NormalForm:
    """The normal form at a special point of a branch.

    Raises
    ------
    OrbitError
        If the map cannot be followed next to the point.
    """
    of = _forms(special.orbit)
    multiplier = complex(special.orbit.multipliers[0])
    crossing = {Crossing.FOLD: 1.0, Crossing.PERIOD_DOUBLING: -1.0}.get(special.kind, multiplier / abs(multiplier))
    if np.abs(special.orbit.multipliers - crossing).min() > _LOCATED:
        return NormalForm(kind=special.kind, coefficient=0.0, uncertainty=np.inf, words=_UNSETTLED)
    coefficient, uncertainty = _extrapolated(lambda h: coefficient_of(of, special.kind, multiplier, h))
    if not uncertainty < UNSETTLED * abs(coefficient):
        words = _UNSETTLED
    elif special.kind is Crossing.FOLD:
        words = f"both motions at {'lower' if coefficient * _slope(family, of, special) > 0.0 else 'higher'} values"
    else:
        gentle = coefficient > 0.0 if special.kind is Crossing.PERIOD_DOUBLING else coefficient < 0.0
        words = "supercritical" if gentle else "subcritical"
    return NormalForm(kind=special.kind, coefficient=coefficient, uncertainty=uncertainty, words=words)


def _extrapolated(at: Callable[[float], float]) -> tuple[float, float]:
    """A coefficient at the step zero and its uncertainty, from that at a step and half of it: the most certain of them."""
    found: list[tuple[float, float]] = []
    values: list[float] = []
    change = 0.0
    for number in range(_HALVINGS + 1):
        try:
            values.append(at(_STEP * 0.5**number))
        except OrbitError as error:
            # so far from the motion the links come to the limit of assembly; just within, two values may agree by chance
            failure, change = error, np.inf
            continue
        if len(values) > 1:
            whole, half = values[-2:]
            # the differences are of second order: each change is a quarter of the one before
            before, change = change, abs(half - whole)
            found.append(((4.0 * half - whole) / 3.0, max(change, 0.25 * before)))
            if found[-1][1] < _CERTAIN * abs(found[-1][0]):
                break
    if not found:
        raise failure
    return min(found, key=lambda pair: pair[1] / max(abs(pair[0]), 1e-300))


def coefficient_of(of: Forms, kind: Crossing, multiplier: complex, h: float) -> float:
    """Kuznetsov's (5.25), (5.27) and (5.28): see `NormalForm`.

    Parameters
    ----------
    of : Forms
    kind : Crossing
    multiplier : complex
        Of a torus, one of the pair on the unit circle.
    h : float
        Step of the differences.
    """
    matrix, unit = of.matrix, np.eye(len(of.matrix))
    if kind is Crossing.TORUS:
        v, left, found = _eigenvectors(matrix, complex(multiplier.real, abs(multiplier.imag)))
        turn = found / abs(found)
        b, c = of.complex(h)
        inner = (
            c(v, v, v.conj())
            + 2.0 * b(v, np.linalg.solve(unit - matrix, b(v, v.conj())))
            + b(v.conj(), np.linalg.solve(turn**2 * unit - matrix, b(v, v)))
        )
        return float(0.5 * (np.vdot(left, inner) / turn).real)
    sign = 1.0 if kind is Crossing.FOLD else -1.0
    right, left, _ = _eigenvectors(matrix, sign)
    q, p = (np.array(vector.real, dtype=float) for vector in (right, left))
    second = of.second(q, h)
    if kind is Crossing.FOLD:
        return float(0.5 * p @ second)
    # B(q, w) by polarisation, with steps of one length
    w = np.linalg.solve(unit - matrix, second)
    length = float(np.linalg.norm(w)) or 1.0
    mixed = length * (of.second(q + w / length, h) - of.second(q - w / length, h)) / 4.0
    return float(p @ (of.third(q, h) + 3.0 * mixed)) / 6.0


def _slope(family: Family, of: Forms, special: SpecialPoint) -> float:
    """Derivative of the map with respect to the parameter along the left eigenvector of a fold."""
    _, p, _ = _eigenvectors(of.matrix, 1.0)
    parameters, drive = family.at(special.parameter)
    reach = 1e-3 * max(abs(special.parameter), 1e-9)
    direction = family.direction(special.parameter, special.parameter - reach, special.parameter + reach)
    slope = period_from(parameters, drive, special.orbit.start, special.orbit.turns, direction).slope
    return float(p.real @ (slope / scale_of(parameters, drive, special.orbit.start)))


@dataclass(frozen=True, slots=True, kw_only=True)
class FormRun:
    """A run next to a period doubling or a torus point, on the side where the old motion is unstable.

    Attributes
    ----------
    parameter : float
        Where it was run.
    distance : float
        Greatest distance from the old motion, in the scale of y, over the last turns; infinite if the run ended before.
    expected : float
        The distance that the normal form gives for a supercritical point.
    """

    parameter: float
    distance: float
    expected: float

    def agrees(self, form: NormalForm) -> bool:
        """Whether the run does what the normal form says: stays at the distance, to a factor of two, or leaves."""
        if form.words == "supercritical":
            return 0.5 * self.expected < self.distance < 2.0 * self.expected
        return form.words == "subcritical" and self.distance > 3.0 * self.expected


def confirm_form(family: Family, special: SpecialPoint, form: NormalForm) -> FormRun:
    """Run the mechanism next to a special point, from a small deviation, on the side where the old motion is unstable.

    Raises
    ------
    InputError
        If the point is a fold, beyond which there is no old motion.
    LinkworkError
        If the old motion does not become unstable to either side.
    """
    if special.kind is Crossing.FOLD:
        raise InputError("beyond a fold there is no old motion to deviate from")
    step = 1e-3 * max(abs(special.parameter), 1e-9)
    sides: list[tuple[float, PeriodicOrbit]] = []
    for sign in (-1.0, 1.0):
        value = special.parameter + sign * step
        parameters, drive = family.at(value)
        sides.append(
            (sign, orbit_of(parameters, drive, turns=special.orbit.turns, start=special.orbit.start, settle=False))
        )
    rates = [(orbit.largest - special.orbit.largest) / step for _, orbit in sides]
    sign, rate = max(zip((-1.0, 1.0), rates), key=lambda pair: pair[1])
    if rate <= 0.0:
        raise LinkworkError(f"the motion at {family.format_value(special.parameter)} is unstable on neither side")
    beyond = float(np.clip(_SMALL * abs(form.coefficient), *_BEYOND))
    value = special.parameter + sign * beyond / rate
    parameters, drive = family.at(value)
    old = orbit_of(parameters, drive, turns=special.orbit.turns, start=special.orbit.start, settle=False)
    scale = scale_of(parameters, drive, old.start)
    expected = sqrt((old.largest - 1.0) / abs(form.coefficient))
    q = _eigenvectors(_forms(old).matrix, complex(old.multipliers[0]))[0].real
    y = old.start + 0.2 * expected * scale * q / np.linalg.norm(q)
    distances = []
    for _ in range(_TURNS):
        try:
            y = y + period_from(parameters, drive, y, old.turns).shift
        except LinkworkError:
            return FormRun(parameter=value, distance=np.inf, expected=expected)
        distances.append(float(np.linalg.norm((y - old.start) / scale)))
        if distances[-1] > 10.0 * expected:
            break
    return FormRun(parameter=value, distance=max(distances[-20:]), expected=expected)
