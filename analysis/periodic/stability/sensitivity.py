"""Differentiate periodic motions, resonances and losses of stability with respect to every parameter.

The derivatives follow from the variational equations (`variations`) by the implicit function theorem. The conditions are: a
motion stays periodic; at a fold, a period doubling or a torus point the multiplier stays on the unit circle; at a resonance
the amplitude stays stationary (Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., Springer 2004, chapter 10).
All derivatives are exact, up to the resolution of the collocation; none is a finite difference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError

from ...files import unknown_name
from ...mechanisms import find_mechanism
from ..motion import variables
from ..motion.discretisation import operating_point
from ..motion.flow import Crossing
from ..motion.orbit import PeriodicOrbit, newton_orbit, trial_orbit
from .variations import Place, Variations

FloatArray = NDArray[np.float64]
#: Newton steps to a special point at most, relative size of the last step, and greatest relative distance to the point.
_STEPS, _LAST, _FAR = 12, 1e-7, 0.25
#: Distance of a multiplier from +1 below which a motion counts as the motion at a fold.
_AT_FOLD = 1e-3
#: Product of unit left and right eigenvectors below which a multiplier is double and has no derivative.
_DOUBLE = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Gradient:
    """A quantity with its derivatives with respect to parameters.

    Attributes
    ----------
    value : float
        Value of the quantity.
    names : tuple of str
        FMI names of the m parameters.
    by : ndarray, shape (m,)
        Derivatives of the quantity with respect to the parameters, in SI units.
    at : ndarray, shape (m,)
        Values of the parameters.

    Notes
    -----
    ``gradient["slider.damping"]`` is one derivative.
    """

    value: float
    names: tuple[str, ...]
    by: FloatArray
    at: FloatArray

    def __getitem__(self, name: str) -> float:
        if name not in self.names:
            raise unknown_name(name, self.names)
        return float(self.by[self.names.index(name)])

    @property
    def elasticities(self) -> dict[str, float]:
        """Change of the quantity in percent for a change of each parameter by one percent; 0 for a parameter that is 0.

        Raises
        ------
        InputError
            If the quantity is 0.
        """
        if self.value == 0.0:
            raise InputError("a quantity that is 0 has no elasticities")
        return dict(zip(self.names, (self.by * self.at / self.value).tolist()))

    def movers(self, count: int = 3) -> tuple[str, ...]:
        """Return the names of the parameters with the greatest elasticities in absolute value, the greatest first."""
        shares = {name: abs(value) for name, value in self.elasticities.items() if value != 0.0}
        return tuple(sorted(shares, key=lambda name: -shares[name])[:count])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointGradient:
    """The derivatives, with respect to parameters, of a special point: a resonance, fold, period doubling or torus point.

    Attributes
    ----------
    along : str
        FMI name of the branch's parameter, such as ``drive.speed``.
    place : Gradient
        Gradient of the value of the branch's parameter at the point, with respect to the other parameters.
    amplitude : Gradient
        Gradient of the amplitude of the motion at the point.
    orbit : PeriodicOrbit
        The motion at the point.
    """

    along: str
    place: Gradient
    amplitude: Gradient
    orbit: PeriodicOrbit


class MotionGradient:
    """Derivatives of a periodic motion with respect to parameters, computed on first use; see `motion_gradient`.

    Attributes
    ----------
    orbit : PeriodicOrbit
    names : tuple of str
        FMI names of the m parameters.
    values : ndarray, shape (m,)
        Values of the parameters.
    along : ndarray, shape (c, m)
        Derivatives of the drive vector and, below them, of the constants of the equations, with respect to the parameters.
    coordinate : int
        Index of the free coordinate to whose amplitude `amplitude` refers.
    """

    def __init__(self, orbit: PeriodicOrbit, names: Sequence[str] | None = None, coordinate: int = 0) -> None:
        parameters, drive = orbit.parameters, orbit.drive
        self.orbit = orbit
        self.coordinate = coordinate
        self.names = variables.gradient_names(parameters, drive) if names is None else tuple(names)
        for name in self.names:
            variables.require_variable(parameters, drive, name)
        self.values = np.array([variables.parameter_value(parameters, drive, name) for name in self.names])
        own = variables.differentiate_constants(parameters, self.names)
        self.along = variables.stack_derivatives(orbit.drive, orbit.flow, self.names, own.p)
        mechanism = find_mechanism(parameters)
        place = mechanism.switch_index
        self._switched = mechanism.is_switched_on(parameters.constants()) or (place >= 0 and bool(np.any(own.p[place])))

    @cached_property
    def variations(self) -> Variations:
        """The variational equations of the motion."""
        return Variations(self.orbit, self._switched, self.along)

    @cached_property
    def _solution(self) -> tuple[FloatArray, FloatArray]:
        return self.variations.periodic_solution(self.variations.forcing)

    def _gradient(self, value: float, by: FloatArray) -> Gradient:
        return Gradient(value=float(value), names=self.names, by=by, at=self.values)

    # The motion

    @property
    def start(self) -> FloatArray:
        """Derivatives of y at crank angle 0 with respect to the parameters, shape (n, m)."""
        return self._solution[1]

    @cached_property
    def period(self) -> Gradient:
        """Gradient of the period (s)."""
        v, flow = self.variations, self.orbit.flow
        if flow.command is not None:
            speed, by = np.full(v.angles.shape, float(self.orbit.drive.speed or 0.0)), self.along[flow.command]
        else:
            speed, by = v.y[..., -1], self._solution[0][..., -1, :]
        return self._gradient(float(v.integral(1.0 / speed)), v.integral(-by / speed[..., None] ** 2))

    @property
    def speed(self) -> Gradient:
        """Gradient of the crank's mean speed (rad/s), which under a torque is part of the solution."""
        way = self.orbit.flow.period * self.orbit.turns
        return self._gradient(way / self.period.value, -way / self.period.value**2 * self.period.by)

    @cached_property
    def _extremes(self) -> tuple[tuple[float, float, Place], tuple[float, float, Place]]:
        """The greatest and the least value of the coordinate, each as (sign, which is +1 or -1; value; place)."""
        y = self.variations.y[..., self.coordinate]
        (greatest, top), (opposite, bottom) = (self.variations.greatest_value(sign * y) for sign in (1.0, -1.0))
        return (1.0, greatest, top), (-1.0, -opposite, bottom)

    @cached_property
    def amplitude(self) -> Gradient:
        """Gradient of the coordinate's amplitude, one of `PeriodicOrbit.amplitudes`."""
        return self.gradient_for_motion(self._solution[0])

    def gradient_for_motion(self, solution: FloatArray) -> Gradient:
        """Return the gradient of the amplitude for given derivatives of the motion, shape (k, s, n, m)."""
        # to first order the value of an extremum does not depend on its place
        own = solution[:, :, self.coordinate, :]
        by = sum(0.5 * sign * place.weights @ own[place.panel] for sign, _, place in self._extremes)
        # an amplitude that is a rounding error is zero: see `Turn.swing_amplitude`
        still = self.orbit.amplitudes[self.coordinate] == 0.0
        (_, greatest, _), (_, least, _) = self._extremes
        return self._gradient(0.0 if still else 0.5 * (greatest - least), np.asarray(by))

    def amplitude_curvature(self, along: str) -> Gradient:
        """Return the gradient of the derivative of the amplitude with respect to the parameter ``along``."""
        v, solution, own = self.variations, self._solution[0], self.coordinate
        number = self.names.index(along)
        by_y, by_constant = v.second_derivatives(solution[..., number], self.along[:, number])
        twice = variables.differentiate_constants(self.orbit.parameters, self.names, along).p_along
        bent = variables.stack_derivatives(self.orbit.drive, self.orbit.flow, (), twice)
        forcing = by_y @ solution + by_constant @ self.along + v.by_constant @ bent
        second, rates = v.periodic_solution(forcing)[0], v.by_y @ solution + v.forcing
        total = np.zeros(len(self.names))
        for sign, _, place in self._extremes:
            # the place of the extremum moves so that the rate there stays zero
            curvature = v.slope(place.panel, v.rates[place.panel, :, own], place.position)
            rate = place.weights @ rates[place.panel, :, own, :]
            total += 0.5 * sign * (place.weights @ second[place.panel, :, own, :] - rate[number] * rate / curvature)
        return self._gradient(self.amplitude[along], total)

    # Outputs

    def peak(self, name: str) -> Gradient:
        """Return the gradient of the greatest modulus, over the period, of an output or a joint force.

        ``name`` is the FMI name of the output, such as ``drive.applied_torque``, or the name of the joint force, such as
        ``pin.A``.
        """
        mechanism = self.orbit.flow.mechanism
        known = {output: (output,) for output in mechanism.output_names} | mechanism.joints
        if name not in known:
            raise unknown_name(name, known)
        numbers = [mechanism.output_names.index(part) for part in known[name]]
        values = self._outputs[..., numbers]
        value, place = self.variations.greatest_value(values)
        by = np.zeros(len(self.names))
        for column, number in enumerate(numbers):
            by_y, by_constant = self.variations.output_derivatives(place.panel, number)
            change = np.einsum("sn,snm->sm", by_y, self._solution[0][place.panel]) + by_constant @ self.along
            # to first order the value of an extremum does not depend on its place
            share = place.weights @ values[place.panel, :, column] / value
            by += share * (place.weights @ change)
        return self._gradient(value, by)

    @cached_property
    def _outputs(self) -> FloatArray:
        return self.variations.outputs()

    # Stability

    @cached_property
    def monodromy(self) -> FloatArray:
        """Derivatives of the monodromy matrix with respect to the parameters, shape (n, n, m)."""
        return self.variations.monodromy_derivatives(self._solution[0], self.along)

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Derivatives of the Floquet multipliers, in the order of `PeriodicOrbit.multipliers`, shape (n, m).

        Raises
        ------
        LinkworkError
            If two multipliers coincide: then they have no derivatives.
        """
        scale, matrix = self.variations.scale, self.orbit.monodromy
        values, right = np.linalg.eig((matrix * scale / scale[:, None]).astype(complex))
        left = np.linalg.inv(right)
        if not _DOUBLE * np.linalg.norm(left, axis=1).max() < 1.0:
            raise LinkworkError(f"two of the multipliers {values} coincide: they have no derivatives")
        scaled = self.monodromy * scale[:, None] / scale[:, None, None]
        found = np.einsum("ia,abm,bi->im", left, scaled, right)
        order = [int(np.abs(values - value).argmin()) for value in self.orbit.multipliers]
        return np.asarray(found[order])

    def test(self, kind: Crossing) -> Gradient:
        """Return the gradient of a function that is zero where a multiplier crosses the unit circle: see `crossing_test`.

        The function is smooth even where two multipliers meet, whereas their moduli are not.
        """
        sign = -1.0 if kind is Crossing.TORUS else 1.0  # of the products of multipliers minus 1, as in `crossing_test`
        matrix, by = (sign * part for part in singular_matrix(self.orbit.monodromy, kind, self.monodromy))
        return self._gradient(float(np.linalg.det(matrix)), determinant_derivatives(matrix, by))

    @property
    def largest(self) -> Gradient:
        """Gradient of the modulus of the largest multiplier."""
        value = self.orbit.multipliers[0]
        return self._gradient(abs(value), np.real(np.conj(value) * self.multipliers[0]) / abs(value))


def motion_gradient(orbit: PeriodicOrbit, names: Sequence[str] | None = None) -> MotionGradient:
    """Compute the derivatives of a periodic motion with respect to parameters.

    Parameters
    ----------
    orbit : PeriodicOrbit
    names : sequence of str, optional
        FMI names of the parameters; by default all, see `gradient_names`.

    Raises
    ------
    UnknownNameError, InputError
        If a name is not the name of a parameter, or the parameter has no effect in this drive.
    LinkworkError
        If the variational equations cannot be resolved.

    Examples
    --------
    >>> from math import pi
    >>> from analysis import find_orbit
    >>> from analysis.periodic import motion_gradient
    >>> motion = motion_gradient(find_orbit("rig-2-spring-c", speed=500 * pi / 30))
    >>> motion.amplitude.movers()
    ('drive.speed', 'slider.stiffness', 'rocker.length')
    """
    return MotionGradient(orbit, names)


def extremum_orbit(orbit: PeriodicOrbit, along: str, coordinate: int = 0) -> PeriodicOrbit:
    """Return the motion at an extremum of the amplitude over a parameter, starting from a motion near the extremum.

    See `extremum_gradient`.
    """
    return _locate_motion(orbit, along, _extremum_step, "extremum of the amplitude", coordinate)


def extremum_gradient(
    orbit: PeriodicOrbit, along: str, names: Sequence[str] | None = None, coordinate: int = 0
) -> PointGradient:
    """Compute how a resonance, or another extremum of the amplitude over a parameter, moves with the other parameters.

    An extremum that is too near to a fold to be told from it moves with the fold.

    Parameters
    ----------
    orbit : PeriodicOrbit
        A motion near the extremum, from which Newton's method begins.
    along : str
        FMI name of the parameter, such as ``drive.speed``.
    names : sequence of str, optional
        FMI names of the other parameters; by default all, see `gradient_names`.
    coordinate : int
        Index of the free coordinate whose amplitude has the extremum.

    Raises
    ------
    LinkworkError
        If there is no extremum near the motion.
    """
    others = _other_names(orbit, along, names)
    try:
        motion = MotionGradient(extremum_orbit(orbit, along, coordinate), (*others, along), coordinate)
    except LinkworkError:
        if np.abs(orbit.multipliers - 1.0).min() > _AT_FOLD:
            raise
        return crossing_gradient(orbit, Crossing.FOLD, along, others, coordinate)
    slopes = motion.amplitude_curvature(along).by
    # at the extremum the amplitude does not change with the parameter ``along``
    return _point_gradient(motion, -slopes[:-1] / slopes[-1], motion.amplitude.value, motion.amplitude.by[:-1])


def crossing_gradient(
    orbit: PeriodicOrbit, kind: Crossing, along: str, names: Sequence[str] | None = None, coordinate: int = 0
) -> PointGradient:
    """Compute how a fold, a period doubling or a torus point moves along one parameter when other parameters change.

    For the arguments see `extremum_gradient`; ``kind`` is the kind of the point.

    Raises
    ------
    LinkworkError
        If there is no such point near the motion, or its place has no derivative: the boundary is parallel to the parameter,
        two folds meet, or two branches cross.
    """
    _require_derivative(kind)
    others = _other_names(orbit, along, names)
    step: _Step = _fold_step if kind is Crossing.FOLD else partial(_crossing_step, kind=kind)
    orbit = _locate_motion(orbit, along, step, kind.value)
    motion = MotionGradient(orbit, (*others, along), coordinate)
    test = _test(motion, kind)
    if not abs(test[-1]) * abs(motion.values[-1]) > 1e-9 * float(np.abs(test * motion.values).max()):
        raise LinkworkError(f"the {kind.value} does not move along {along}: its place there has no derivative")
    shift = -test[:-1] / test[-1]
    amplitude = motion.gradient_for_motion(_fold_motion(motion, shift)) if kind is Crossing.FOLD else motion.amplitude
    return _point_gradient(motion, shift, amplitude.value, amplitude.by[:-1] + amplitude.by[-1] * shift)


def _point_gradient(motion: MotionGradient, place: FloatArray, amplitude: float, by: FloatArray) -> PointGradient:
    """Build the gradients of the place and the amplitude of a special point.

    The place is the value of the last parameter of ``motion``. ``place`` and ``by`` are the derivatives of the place and of the
    amplitude with respect to the other parameters.
    """
    *others, along = motion.names
    names, at = tuple(others), motion.values[:-1]
    return PointGradient(
        along=along,
        place=Gradient(value=float(motion.values[-1]), names=names, by=place, at=at),
        amplitude=Gradient(value=amplitude, names=names, by=by, at=at),
        orbit=motion.orbit,
    )


def boundary_gradient(orbit: PeriodicOrbit, kind: Crossing, names: Sequence[str]) -> Gradient:
    """Compute the normal of the stability boundary in the space of parameters, at one of its points.

    Parameters
    ----------
    orbit : PeriodicOrbit
        A motion with a multiplier on the unit circle, such as an orbit of a `CrossingCurve`.
    kind : Crossing
    names : sequence of str
        FMI names of the parameters, such as the two axes of a chart.

    Returns
    -------
    Gradient
        Gradient of a function that is zero on the boundary: for a period doubling or torus point `MotionGradient.test`; for a
        fold the shift of the map over a period along the left eigenvector.

    Raises
    ------
    LinkworkError
        If the kind is a branch point.
    """
    _require_derivative(kind)
    motion = MotionGradient(orbit, names)
    return Gradient(value=0.0, names=motion.names, by=_test(motion, kind), at=motion.values)


def _require_derivative(kind: Crossing) -> None:
    if kind is Crossing.BRANCH_POINT:
        raise LinkworkError("two branches cross: the place has no derivative, as they part when a symmetry is broken")


def _other_names(orbit: PeriodicOrbit, along: str, names: Sequence[str] | None) -> tuple[str, ...]:
    variables.require_variable(orbit.parameters, orbit.drive, along)
    names = variables.gradient_names(orbit.parameters, orbit.drive) if names is None else names
    return tuple(name for name in names if name != along)


#: A Newton step from a motion towards a special point along a parameter: changes of the start and of the parameter.
_Step = Callable[[MotionGradient], tuple[FloatArray, float]]


def _locate_motion(
    orbit: PeriodicOrbit, along: str, newton_step: _Step, what: str, coordinate: int = 0
) -> PeriodicOrbit:
    """Find the special point near a motion by Newton's method along the parameter ``along``; return the motion at this point.

    Raises LinkworkError if Newton's method does not converge to a point near the motion; ``what`` names the point in the
    message.
    """
    begun = variables.parameter_value(orbit.parameters, orbit.drive, along)
    for _ in range(_STEPS):
        motion = MotionGradient(orbit, (along,), coordinate)
        try:
            change, step = newton_step(motion)
        except (np.linalg.LinAlgError, ZeroDivisionError):
            # the condition does not depend on the parameter
            break
        value = float(motion.values[0]) + step
        if not abs(value - begun) < _FAR * abs(begun):
            break
        parameters, drive = variables.with_values(orbit.parameters, orbit.drive, {along: value})
        start = orbit.start + change
        if newton_step is _fold_step:
            orbit, _ = trial_orbit(operating_point(parameters, drive), start, orbit.turns)
        else:
            orbit = newton_orbit(parameters, drive, turns=orbit.turns, start=start, settle=False)
        if abs(step) <= _LAST * abs(value):
            return orbit
    raise LinkworkError(f"no {what} along {along} was found near {begun:.9g}")


def _extremum_step(motion: MotionGradient) -> tuple[FloatArray, float]:
    (along,) = motion.names
    size, slope = motion.amplitude.value, motion.amplitude[along]
    if size == 0.0:
        raise ZeroDivisionError("a coordinate that does not move has no curvature at its extremes")
    curvature = motion.amplitude_curvature(along)[along]
    # near a resonance 1 / amplitude^2 is nearly a parabola, near a minimum amplitude^2 is nearly one
    peaked = 3.0 * slope**2 - size * curvature
    step = slope * size / (peaked if peaked > 0.0 else -(slope**2) - size * curvature)
    return motion.start[:, 0] * step, step


def _crossing_step(motion: MotionGradient, kind: Crossing) -> tuple[FloatArray, float]:
    test = motion.test(kind)
    step = -test.value / float(test.by[0])
    return motion.start[:, 0] * step, step


def _fold_step(motion: MotionGradient) -> tuple[FloatArray, float]:
    """Return Newton's step to a fold, where y(T) = y(0) and the monodromy matrix minus the identity is singular."""
    v, n, orbit = motion.variations, len(motion.orbit.start), motion.orbit
    left, right = _null_vectors(v)
    by_y, by_constant = v.second_derivatives(v.fundamental @ right)
    # derivatives of the motion by its start and by the parameter
    columns = np.concatenate([v.fundamental, v.solve_from_start(np.zeros((n, 1)), v.forcing)], axis=-1)
    along = np.hstack([np.zeros((len(motion.along), n)), motion.along])
    closed = np.hstack([v.monodromy - np.eye(n), v.final_deviation(v.forcing)])
    matrix = np.vstack([closed, left @ v.final_deviation(by_y @ columns + by_constant @ along)])
    shift = orbit.point.period(orbit.start, orbit.turns).shift
    test = left @ (v.monodromy - np.eye(n)) @ right
    step = np.linalg.solve(matrix, -np.append(shift, test))
    return step[:n], float(step[n])


def _test(motion: MotionGradient, kind: Crossing) -> FloatArray:
    """Return the derivatives of a function of the m parameters that is zero where the multiplier is on the unit circle.

    The shape is (m,).
    """
    if kind is Crossing.FOLD:
        left, _ = _null_vectors(motion.variations)
        return left @ motion.variations.final_deviation(motion.variations.forcing)
    return motion.test(kind).by


def singular_matrix(matrix: FloatArray, kind: Crossing, by: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Return a square matrix that is singular at a crossing, and its derivatives, shape (..., m).

    ``matrix`` is the monodromy matrix and ``by`` its derivatives, shape (n, n, m). The determinant is positive if all
    multipliers are inside the unit circle.
    """
    by = np.zeros((*matrix.shape, 0)) if by is None else by
    if kind is not Crossing.TORUS:
        return np.eye(len(matrix)) - kind.sign * matrix, -kind.sign * by
    # the second compound matrix has the products of two multipliers as eigenvalues
    i, j = np.triu_indices(len(matrix), 1)

    def minors(a: FloatArray, b: FloatArray) -> FloatArray:
        return a[np.ix_(i, i)] * b[np.ix_(j, j)] - a[np.ix_(i, j)] * b[np.ix_(j, i)]

    whole = matrix[:, :, None]
    return np.eye(len(i)) - minors(matrix, matrix), -minors(by, whole) - minors(whole, by)


def determinant_derivatives(matrix: FloatArray, by: FloatArray) -> FloatArray:
    """Return the derivatives of the determinant of a matrix, shape (m,), from the derivatives of its entries, (n, n, m)."""
    total = np.zeros(by.shape[-1])
    for column in range(len(matrix)):
        # the determinant is linear in each column
        replaced = np.repeat(matrix[None], len(total), axis=0)
        replaced[:, :, column] = by[:, column].T
        total += np.linalg.det(replaced)
    return total


def _null_vectors(v: Variations) -> tuple[FloatArray, FloatArray]:
    """Return the left and right eigenvectors of the monodromy matrix for the multiplier +1."""
    left, _, right = np.linalg.svd(v.monodromy * v.scale / v.scale[:, None] - np.eye(len(v.scale)))
    return left[:, -1] / v.scale, right[-1] * v.scale


def _fold_motion(motion: MotionGradient, shift: FloatArray) -> FloatArray:
    """Return the derivatives of the motion at a fold that moves by ``shift`` along the last parameter; shape (k, s, n, m).

    The first-order equations determine the derivatives up to a multiple of the eigenvector. The second-order equations
    determine this multiple, since the multiplier stays +1. The last column, for the last parameter, is zero.
    """
    v, n, m = motion.variations, len(motion.variations.scale), len(shift)
    left, right = _null_vectors(v)
    moved = np.vstack([np.eye(m), shift]) if m else np.zeros((1, 0))
    forcing, along = v.forcing @ moved, motion.along @ moved
    # bordered by the left and the right eigenvector the matrix is regular
    matrix = np.block(
        [[v.monodromy - np.eye(n), (left * v.scale**2)[:, None]], [(right / v.scale**2)[None, :], np.zeros((1, 1))]]
    )
    start = np.linalg.solve(matrix, np.vstack([-v.final_deviation(forcing), np.zeros(m)]))[:n]
    particular = v.solve_from_start(start, forcing)
    free = v.fundamental @ right
    by_y, by_constant = v.second_derivatives(free)
    open_ = left @ v.final_deviation(by_y @ free[..., None])
    if open_[0] == 0.0:
        raise LinkworkError("two folds meet: the motion there has no derivatives")
    share = -(left @ v.final_deviation(by_y @ particular + by_constant @ along)) / open_
    found = particular + free[..., None] * share
    return np.concatenate([found, np.zeros_like(free[..., None])], axis=-1)
