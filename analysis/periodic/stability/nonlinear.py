"""Compute the normal form at a loss of stability, and check it by long runs of the nonlinear mechanism.

On the centre manifold of a special point the map over a period is one of a few normal forms (Y. A. Kuznetsov, Elements of
Applied Bifurcation Theory, 3rd ed., Springer 2004, sections 5.4 and 8.7). The sign of one coefficient decides: beyond a
supercritical period doubling, torus point or branch point a new stable motion grows out of the motion of the branch; beyond a
subcritical point the mechanism jumps to another motion. The second and third derivatives of the map are computed by finite
differences along eigenvectors. `confirm_form` compares the normal form, and `confirm` the verdict, with a long run of the
mechanism.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import exp, log, sqrt
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError

from ...mechanisms import Parameters
from ...run import simulate, takes_published
from ..motion.discretisation import OperatingPoint, OrbitError, operating_point
from ..motion.drive import Drive
from ..motion.flow import Crossing, Stability, StabilityVerdict, torus_pair
from ..motion.orbit import PeriodicOrbit, newton_orbit
from ..motion.variables import Family


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SpecialPoint:
    """A point of a branch at which a multiplier crosses the unit circle.

    Attributes
    ----------
    kind : Crossing
        FOLD, BRANCH_POINT, PERIOD_DOUBLING or TORUS.
    parameter : float
        Value of the branch's parameter.
    orbit : PeriodicOrbit
        The motion at the point.
    after : int
        Index of the last point of the branch before the special point.
    """

    kind: Crossing
    parameter: float
    orbit: PeriodicOrbit
    after: int


#: Step of the finite differences, relative to the scale of y; relative uncertainty of the result below which the step is no
#: longer halved; greatest number of halvings. The map over many turns may bend within a thousandth of the scale, near the limit
#: of assembly within a millionth.
_STEP, _CERTAIN, _HALVINGS = 8e-3, 1e-2, 16
#: Distance of the multiplier from the crossing of the unit circle up to which the point counts as located: next to the limit of
#: assembly the multiplier may change from -1 to 1 within the rounding error of the parameter.
_LOCATED = 1e-2
#: Relative uncertainty of a coefficient above which its sign is not settled.
UNSETTLED = 0.1
_UNSETTLED = "not settled"
#: Run that confirms a normal form: least and greatest distance of the multiplier from the unit circle; wanted square of the
#: distance from the motion of the branch; periods of the run.
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
        With y in units of its scale: for a fold half the second derivative along the eigenvector; for a period doubling the
        cubic coefficient, positive if supercritical; for a branch point the cubic coefficient, for a torus the first Lyapunov
        coefficient, negative if supercritical.
    uncertainty : float
        Change of the coefficient when the step of the finite differences is halved; infinite if the point is not located.
    words : str
        "supercritical", "subcritical", for a branch point without symmetry "transcritical", or "not settled" if the coefficient
        is uncertain or the multiplier crosses the circle too fast for the point to be located; for a fold, whether the two
        motions exist at lower or higher parameter values.
    """

    kind: Crossing
    coefficient: float
    uncertainty: float
    words: str


class Forms(NamedTuple):
    """Second and third derivatives of a map at the fixed point zero as multilinear forms B and C, by finite differences."""

    function: Callable[[FloatArray], FloatArray]  # the map, from shape (n,) to (n,)
    matrix: FloatArray  # first derivative of the map at zero, (n, n)

    def second_form(self, x: FloatArray, h: float) -> FloatArray:
        """Return the second derivative B(x, x) by finite differences with the step h."""
        f = self.function
        return (f(h * x) + f(-h * x) - 2.0 * f(0.0 * x)) / h**2

    def third_form(self, x: FloatArray, h: float) -> FloatArray:
        """Return the third derivative C(x, x, x) by finite differences with the step h."""
        f = self.function
        return (f(2.0 * h * x) - 2.0 * f(h * x) + 2.0 * f(-h * x) - f(-2.0 * h * x)) / (2.0 * h**3)

    def complex_forms(self, h: float) -> tuple[Form, Form]:
        """Return the functions B(u, v) and C(u, v, w) of complex vectors, by polarisation of the real forms."""

        def b_real(u: FloatArray, v: FloatArray) -> FloatArray:
            return (self.second_form(u + v, h) - self.second_form(u - v, h)) / 4.0

        def c_real(u: FloatArray, v: FloatArray, w: FloatArray) -> FloatArray:
            return (
                self.third_form(u + v + w, h)
                - self.third_form(u + v - w, h)
                - self.third_form(u - v + w, h)
                + self.third_form(u - v - w, h)
            ) / 24.0

        return _complex_form(b_real, 2), _complex_form(c_real, 3)


def _forms(orbit: PeriodicOrbit) -> Forms:
    """Return the `Forms` of the map over a period, for deviations from the orbit in units of the scale of y."""
    scale, point = orbit.scale, orbit.point

    def after(x: FloatArray) -> FloatArray:
        return x + point.period(orbit.start + scale * x, orbit.turns).shift / scale

    return Forms(after, orbit.monodromy * scale / scale[:, None])


def _complex_form(form: Callable[..., FloatArray], count: int) -> Form:
    """Extend a real multilinear form of ``count`` vectors to complex vectors, by linearity."""

    def extended(*vectors: NDArray[np.complex128]) -> NDArray[np.complex128]:
        total = np.zeros(len(vectors[0]), dtype=complex)
        for number in range(2**count):
            parts = [(v.imag, 1j) if number >> n & 1 else (v.real, 1.0) for n, v in enumerate(vectors)]
            if all(np.any(part) for part, _ in parts):
                total += np.prod([factor for _, factor in parts]) * form(*(part for part, _ in parts))
        return total

    return extended


def _eigenvectors(matrix: FloatArray, value: complex) -> tuple[NDArray[np.complex128], NDArray[np.complex128], complex]:
    """Return the right and left eigenvectors of the eigenvalue nearest to ``value``, and this eigenvalue.

    The eigenvectors are scaled so that their product is 1.
    """
    values, right = np.linalg.eig(matrix.astype(complex))
    n = int(np.abs(values - value).argmin())
    adjoint, left = np.linalg.eig(matrix.T.astype(complex))
    m = int(np.abs(adjoint - values[n].conjugate()).argmin())
    q = right[:, n] / np.linalg.norm(right[:, n])
    p = left[:, m]
    return q, p / np.conj(np.vdot(p, q)), complex(values[n])


def normal_form(family: Family, special: SpecialPoint) -> NormalForm:
    """Compute the normal form at a special point of a branch.

    Raises
    ------
    OrbitError
        If the integration over a period, from a start next to the orbit, fails.
    """
    forms = _forms(special.orbit)
    multiplier = special.kind.sign or torus_pair(special.orbit.multipliers)[0]
    if np.abs(special.orbit.multipliers - multiplier / abs(multiplier)).min() > _LOCATED:
        return NormalForm(kind=special.kind, coefficient=0.0, uncertainty=np.inf, words=_UNSETTLED)
    coefficient, uncertainty = _extrapolate_coefficient(lambda h: form_coefficient(forms, special.kind, multiplier, h))
    if not uncertainty < UNSETTLED * abs(coefficient):
        words = _UNSETTLED
    elif special.kind is Crossing.FOLD:
        words = f"both motions at {'lower' if coefficient * _slope(family, forms, special) > 0.0 else 'higher'} values"
    elif special.kind is Crossing.BRANCH_POINT and _is_transcritical(forms, coefficient):
        words = "transcritical"
    else:
        gentle = coefficient > 0.0 if special.kind is Crossing.PERIOD_DOUBLING else coefficient < 0.0
        words = "supercritical" if gentle else "subcritical"
    return NormalForm(kind=special.kind, coefficient=coefficient, uncertainty=uncertainty, words=words)


def _extrapolate_coefficient(at: Callable[[float], float]) -> tuple[float, float]:
    """Extrapolate a coefficient to step size zero; return the least uncertain value and its uncertainty.

    ``at`` computes the coefficient for a step size of the finite differences.
    """
    found: list[tuple[float, float]] = []
    values: list[float] = []
    change = 0.0
    for number in range(_HALVINGS + 1):
        try:
            values.append(at(_STEP * 0.5**number))
        except OrbitError as error:
            # with this step the links come to the limit of assembly; with slightly smaller ones two values may agree by chance
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


def form_coefficient(forms: Forms, kind: Crossing, multiplier: complex, h: float) -> float:
    """Compute the coefficient of a normal form by Kuznetsov's equation (5.25), (5.27) or (5.28): see `NormalForm`.

    ``forms`` are the derivatives of the map at the special point, ``h`` the step of the finite differences. ``multiplier`` is
    used for a torus alone: one multiplier of the pair on the unit circle.
    """
    matrix, unit = forms.matrix, np.eye(len(forms.matrix))
    if kind is Crossing.TORUS:
        v, left, found = _eigenvectors(matrix, complex(multiplier.real, abs(multiplier.imag)))
        turn = found / abs(found)
        b, c = forms.complex_forms(h)
        inner = (
            c(v, v, v.conj())
            + 2.0 * b(v, np.linalg.solve(unit - matrix, b(v, v.conj())))
            + b(v.conj(), np.linalg.solve(turn**2 * unit - matrix, b(v, v)))
        )
        return float(0.5 * (np.vdot(left, inner) / turn).real)
    q, p = (vector.real for vector in _eigenvectors(matrix, kind.sign)[:2])
    second = forms.second_form(q, h)
    if kind is Crossing.FOLD:
        return float(0.5 * p @ second)
    # B(q, w) by polarisation, with w scaled to the length of q; at a branch point w is normal to the left eigenvector
    if kind is Crossing.BRANCH_POINT:
        matrix, second = matrix - np.outer(q, p), second - (p @ second) * q
    w = np.linalg.solve(unit - matrix, second)
    length = float(np.linalg.norm(w)) or 1.0
    mixed = length * (forms.second_form(q + w / length, h) - forms.second_form(q - w / length, h)) / 4.0
    return float(p @ (forms.third_form(q, h) + 3.0 * mixed)) / 6.0


#: Quadratic coefficient, relative to the root of the cubic coefficient, above which a branch point is transcritical; symmetry
#: makes the quadratic coefficient zero.
_QUADRATIC = 1e-2


def _is_transcritical(forms: Forms, cubic: float) -> bool:
    """Return whether the map at a branch point has a quadratic coefficient: the crossing branch then exists on both sides.

    ``forms`` are the derivatives of the map, ``cubic`` is its cubic coefficient.
    """
    whole, half = (form_coefficient(forms, Crossing.FOLD, 1.0, h) for h in (_STEP, 0.5 * _STEP))
    return abs(half) > max(_QUADRATIC * sqrt(abs(cubic)), abs(half - whole) / UNSETTLED)


def _slope(family: Family, forms: Forms, special: SpecialPoint) -> float:
    """Return the derivative of the map over a period with respect to the parameter, at a fold.

    The derivative is projected on the left eigenvector.
    """
    _, p, _ = _eigenvectors(forms.matrix, 1.0)
    point, start = operating_point(*family.operation(special.parameter)), special.orbit.start
    reach = 1e-3 * max(abs(special.parameter), 1e-9)
    direction = family.direction(special.parameter, special.parameter - reach, special.parameter + reach)
    slope = point.period(start, special.orbit.turns, direction).slope
    return float(p.real @ (slope / point.scale(start)))


@dataclass(frozen=True, slots=True, kw_only=True)
class FormRun:
    """A run near a period doubling, torus point or branch point, on the side where the motion of the branch is unstable.

    ``parameter`` is the value of the branch's parameter in the run. ``distance`` is the greatest distance from the motion of
    the branch over the last periods, relative to the scale of y, and infinite if the run ended early; ``expected`` is the
    distance that the normal form predicts for a supercritical point.
    """

    parameter: float
    distance: float
    expected: float

    def agrees(self, form: NormalForm) -> bool:
        """Return whether the run agrees with the normal form.

        If the form is supercritical, the distance of the run must be the expected distance within a factor of two. If the form
        is subcritical, the distance must be more than three times the expected distance.
        """
        if form.words == "supercritical":
            return 0.5 * self.expected < self.distance < 2.0 * self.expected
        return form.words == "subcritical" and self.distance > 3.0 * self.expected


def confirm_form(family: Family, special: SpecialPoint, form: NormalForm) -> FormRun:
    """Run the mechanism near a special point, from a small deviation, on the side where the motion of the branch is unstable.

    Raises
    ------
    InputError
        If the point is a fold: the branch has no motion beyond a fold.
    LinkworkError
        If the motion of the branch is unstable on neither side, or only over a range too narrow for a run.
    """
    if special.kind is Crossing.FOLD:
        raise InputError("beyond a fold the branch has no motion from which a run could deviate")

    def find_nearby(value: float) -> PeriodicOrbit:
        parameters, drive = family.operation(value)
        return newton_orbit(parameters, drive, turns=special.orbit.turns, start=special.orbit.start, settle=False)

    step = 1e-3 * max(abs(special.parameter), 1e-9)
    largest = [find_nearby(special.parameter + sign * step).largest for sign in (-1.0, 1.0)]
    rates = [(value - special.orbit.largest) / step for value in largest]
    sign, rate = max(zip((-1.0, 1.0), rates), key=lambda pair: pair[1])
    if rate <= 0.0:
        raise LinkworkError(f"the motion at {family.format_value(special.parameter)} is unstable on neither side")
    beyond = float(np.clip(_SMALL * abs(form.coefficient), *_BEYOND))
    value = special.parameter + sign * beyond / rate
    old = find_nearby(value)
    if old.largest <= 1.0:
        raise LinkworkError(
            f"at {family.format_value(value)} the motion is stable again: the unstable range is too narrow for a run"
        )
    scale = old.scale
    expected = sqrt((old.largest - 1.0) / abs(form.coefficient))
    q = _eigenvectors(_forms(old).matrix, complex(old.multipliers[0]))[0].real
    y = old.start + 0.2 * expected * scale * q / np.linalg.norm(q)
    distances = []
    for _ in range(_TURNS):
        try:
            y = y + old.point.period(y, old.turns).shift
        except LinkworkError:
            return FormRun(parameter=value, distance=np.inf, expected=expected)
        distances.append(float(np.linalg.norm((y - old.start) / scale)))
        if distances[-1] > 10.0 * expected:
            break
    return FormRun(parameter=value, distance=max(distances[-20:]), expected=expected)


# Long runs


class Outcome(Enum):
    """The behaviour of a deviation from an orbit in a long run."""

    DECAYS = "decays"
    BOUNDED = "stays bounded"
    GROWS = "grows"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Confirmation:
    """A verdict on a periodic orbit, and a long run of the nonlinear mechanism that starts near the orbit.

    Attributes
    ----------
    verdict : StabilityVerdict
        Verdict from the multipliers of the orbit.
    outcome : Outcome
    growth : float
        Growth factor of the deviation per turn, along the direction of the leading multiplier, by regression over the turns
        before the deviation is lost in rounding errors or exceeds a hundredth of the scale of y; if it is lost or exceeds this
        limit within the first turn, the factor is only a bound.
    deviations : ndarray, shape (n,)
        Distance from the orbit at crank angle 0 of each turn, relative to the first distance, up to the end of the run.
    message : str
        Reason why the run ended early; empty if the run is complete.
    """

    verdict: StabilityVerdict
    outcome: Outcome
    growth: float
    deviations: NDArray[np.float64]
    message: str

    @property
    def agrees(self) -> bool:
        """Whether the run confirms the verdict; the deviation of a marginal motion must neither decay nor grow.

        If the margin is so small that the deviation hardly decays or grows within the run, the measured growth must agree with
        the multiplier.
        """
        expected = {
            Stability.STABLE: Outcome.DECAYS,
            Stability.UNSTABLE: Outcome.GROWS,
            Stability.MARGINAL: Outcome.BOUNDED,
        }
        if self.outcome is expected[self.verdict.stability]:
            return True
        margin = abs(self.verdict.margin)
        return self.outcome is Outcome.BOUNDED and abs(self.growth - 1.0 + self.verdict.margin) < 0.1 * margin


#: Initial distance of a long run from the orbit, in the direction of greatest growth and relative to the scale of y; least and
#: greatest distance at which growth is measured.
DISTURBANCE, NOISE, LINEAR = 1e-5, 1e-8, 1e-2
#: Size below which a deviation counts as zero.
TINY = 1e-300
#: Least and greatest number of turns of a run whose number of turns is not given.
FEWEST_TURNS, MOST_TURNS = 1000, 20_000
#: Factor of growth or decay of the deviation over a run above which the deviation counts as growing or decaying.
NOTABLE = 3.0


@takes_published()
def confirm(
    parameters: Parameters, drive: Drive, *, turns: int | None = None, start: ArrayLike | None = None
) -> Confirmation:
    """Run the nonlinear mechanism for many turns from a slightly disturbed periodic orbit.

    Parameters
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    turns : int, optional
        Turns of the run, or common periods of gears or several cranks; at least 20. By default 1000, and up to 20000 if the
        margin is too small to distinguish growth from decay.
    start : array_like, shape (n,), optional
        Guess of the orbit.

    Raises
    ------
    OrbitError
        If there is no periodic orbit.
    InputError
        If there are less than 20 turns.
    LinkworkError
        If the run ends within the first turn.
    """
    if turns is not None and turns < 20:
        raise InputError(f"a run of {turns} turns: there must be at least 20 turns")
    orbit = newton_orbit(parameters, drive, start=start)
    verdict = orbit.verdict()
    if turns is None:
        # enough to change the deviation by more than NOTABLE, if possible
        turns = int(min(MOST_TURNS, max(FEWEST_TURNS, 2.0 * log(NOTABLE) / max(abs(verdict.margin), 1e-12))))
    scale = orbit.scale
    values, left, right = scipy.linalg.eig(orbit.monodromy * scale / scale[:, None], left=True)
    leading = int(np.argmax(np.abs(values)))
    direction = right[:, leading].real
    # the product of a deviation with the left eigenvector of the largest multiplier grows by the same factor in each turn,
    # whereas for a complex pair the distance itself oscillates
    measure = left[:, leading].conj()
    begin = orbit.start + DISTURBANCE * scale * (direction / np.linalg.norm(direction))
    passed, message = _passages(orbit.point, begin, turns)
    away = (passed - orbit.start) / scale
    size = np.linalg.norm(away, axis=1)
    outside = np.flatnonzero((size > LINEAR) | (size < NOISE))
    # one turn counts even if the deviation leaves the range in it: the motion decays or grows by at least as much
    used = np.maximum(np.abs(away @ measure), TINY)[: max(2, outside[0]) if len(outside) else None]
    if len(used) < 2:
        raise LinkworkError(f"the run beside the orbit ends within a turn: {message}")
    # growth factor per turn, by regression of the logarithms
    growth = exp(float(np.polyfit(np.arange(len(used)), np.log(used), 1)[0]))
    factor = growth ** len(used)
    if factor > NOTABLE or size.max() > NOTABLE * LINEAR:
        outcome = Outcome.GROWS
    else:
        outcome = Outcome.DECAYS if factor < 1.0 / NOTABLE else Outcome.BOUNDED
    return Confirmation(verdict=verdict, outcome=outcome, growth=growth, deviations=size / size[0], message=message)


def _passages(point: OperatingPoint, start: FloatArray, turns: int) -> tuple[FloatArray, str]:
    """Run the mechanism from a start; return y at the beginning of each turn, shape (turns + 1, n), and a message.

    The message tells why the run ended early; it is empty if the run is complete.
    """
    if point.drive.speed is not None:
        mechanism, flow = point.mechanism, point.flow
        x, count = flow.state(start, point.vector), len(mechanism.freedoms)
        initial: dict[str, float] = {}
        for number, freedom in enumerate(mechanism.freedoms):
            initial |= dict(zip(freedom.initial, (x[number], x[count + number])))
        turn = flow.period / point.drive.speed
        run = simulate(
            point.parameters,
            point.drive.inputs(mechanism),
            initial=mechanism.initial(**initial),
            samples=turn * np.arange(turns + 1),
            stop_time=turn * turns,
            tolerance=1e-12,
        )
        names = [name for freedom in mechanism.freedoms for name in (freedom.coordinate, freedom.rate)]
        states = np.column_stack([run[name] for name in (*names[::2], *names[1::2])])
        return flow.unknowns(states, point.vector), run.message if run.status else ""
    passed = [start]
    for _ in range(turns):
        try:
            passed.append(passed[-1] + point.period(passed[-1], 1).shift)
        except OrbitError as error:
            return np.array(passed), str(error)
    return np.array(passed), ""
