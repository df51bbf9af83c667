"""Solve the variational equations of a periodic motion, to second order and with parameters, by Gauss collocation.

The period is divided into panels on which the motion is a polynomial to within rounding. On a panel the linear equations
d' = A d + r of a deviation d are solved at Gauss points for any number of right-hand sides at once, by the implicit Runge-Kutta
method of these points (E. Hairer, S. P. Norsett and G. Wanner, Solving Ordinary Differential Equations I, section II.7). The
panels are joined by the condition that the solution is periodic; this works for unstable motions, too. The motion itself is
sampled from the orbit. `motion.collocation` solves for the motion; the equations here, in contrast, allow any forcing r,
friction and torques. The derivatives A of the rates dy/dangle with respect to y, those with respect to the constants, and the
second derivatives along a direction are traced from the equations.
"""

from __future__ import annotations

from functools import cache, reduce
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from linkwork.errors import LinkworkError

from ...numerics import symbolic
from ...numerics.codegen import MAKING, MachineCode
from ...numerics.gauss import gauss
from ...run import expressions
from ...run.compiled import rows
from ..motion.flow import PLAIN, STATE, Flow
from ..motion.orbit import PeriodicOrbit

FloatArray = NDArray[np.float64]
#: Number of Gauss points of a panel; number of panels of a turn at first; greatest number of halvings of a panel.
_POINTS, _PANELS, _HALVINGS = 8, 32, 40
#: Size of the last Legendre coefficients over a panel above which the panel is halved: for the rates and their derivatives, in
#: the scale of y; for the effect of a parameter on the rates, relative to its greatest value.
_RESOLVED, _EFFECT = 1e-10, 1e-8
#: Jump of the rates, of their derivatives or of the effect of a parameter between two neighbouring panels, relative to the same
#: scales, above which both panels are halved.
_CONTINUOUS = 1e-8
#: A panel has a kink if it is shorter than ``_KINK`` (rad) and if the derivatives of the rates change over it by more than
#: ``_STEEP`` times their greatest value times the square root of its length. The square root is allowed because rates may have
#: powers of 1.5.
_KINK, _STEEP = 1e-6, 30.0
#: Imaginary part below which a root counts as real.
_REAL = 1e-9
#: Effect of a parameter on the rates, relative to the effect of the motion, below which it counts as a rounding error; both are
#: effects of changes as large as the quantities themselves.
_NO_EFFECT = 1e-10
#: Difference of the monodromy matrix from the orbit's, relative to its greatest entry, above which an error is raised.
_AGREES = 1e-6
#: Least singular value, relative to the norm, up to which a matrix is singular to within rounding.
_ROUNDING = 1e-15
_GAUSS = gauss(_POINTS)
#: Values of the Legendre polynomials at the beginning of a panel; at the end they are 1.
_SIGNS = (-1.0) ** np.arange(_POINTS)
#: Legendre polynomials on a grid over a panel, its two ends included.
_GRID = legendre.legvander(np.linspace(-1.0, 1.0, 4 * _POINTS + 1), _POINTS - 1)


def _greatest(values: FloatArray) -> FloatArray:
    """Return the greatest modulus in each panel, shape (k,), of values of shape (k, ...)."""
    return np.asarray(np.abs(values).reshape(len(values), -1).max(axis=1, initial=0.0))


class Place(NamedTuple):
    """A point of the period, given by its panel and its position on the panel."""

    panel: int  # index of the panel
    position: float  # position on the panel, from -1 to 1
    weights: FloatArray  # weights of the values at the nodes that interpolate at the point, shape (s,)


class _Kink(NamedTuple):
    """Kink of the rates: their derivatives jump, as at the bend of a spring's table.

    At a kink the rates themselves are continuous: they are F before it and F + g h after it. The scalar h is a function of y,
    the angle and the constants, and is zero at the kink. The jumps of the derivatives are therefore multiples of the vector g.
    """

    panel: int  # index of the panel
    by_y: FloatArray  # jump of the derivatives of the rates by y, shape (n, n)
    by_constant: FloatArray  # jump of the derivatives by the drive vector and the constants, (n, c)
    slope: FloatArray  # jump of the derivative of the rates along the motion by the angle, (n,)


class Variations:
    """A periodic motion with its variational equations.

    Parameters
    ----------
    orbit : PeriodicOrbit
    switched : bool
        Whether the optional terms of the equations, such as friction, are included: because they are not zero, or because
        derivatives with respect to their parameters are wanted.
    along : ndarray, shape (c, m)
        Derivatives of the drive vector and, below them, of the constants with respect to m parameters; the panels are chosen
        such that they also resolve the effect of these parameters on the rates.

    Attributes
    ----------
    h : ndarray, shape (k,)
        Lengths of the k panels (rad).
    angles : ndarray, shape (k, s)
        Crank angles of the s nodes of each panel.
    y, rates : ndarray, shape (k, s, n)
        The motion and its derivative with respect to the crank angle.
    by_y : ndarray, shape (k, s, n, n)
        Derivatives of the rates with respect to y.
    by_constant : ndarray, shape (k, s, n, c)
        Derivatives of the rates with respect to the drive vector and, after it, the constants.
    forcing : ndarray, shape (k, s, n, m)
        Derivatives of the rates with respect to the parameters, at fixed y.
    monodromy : ndarray, shape (n, n)
        Monodromy matrix.
    """

    def __init__(self, orbit: PeriodicOrbit, switched: bool, along: FloatArray) -> None:
        self.orbit, self.switched, self.flow = orbit, switched, orbit.flow
        self._drive, self._p, self.scale = orbit.point.vector, orbit.point.constants, orbit.scale
        self._divide(along)
        self._kinks = self._find_kinks()
        self._solve_panels()
        wrong = float(np.abs(self.monodromy - orbit.monodromy).max() / max(1.0, np.abs(orbit.monodromy).max()))
        if not wrong < _AGREES * max(1.0, *(self.scale[:, None] / self.scale).ravel()):
            raise LinkworkError(
                f"variational equations on {len(self.h)} panels: the monodromy matrix differs from the orbit's by {wrong:.2g}"
            )

    def _divide(self, along: FloatArray) -> None:
        """Divide the period into panels that resolve the motion, the derivatives of the rates and the forcing."""
        flow = self.flow
        edges = np.linspace(0.0, flow.period * self.orbit.turns, _PANELS * self.orbit.periods + 1)
        if self.orbit.stations is not None:
            edges = np.union1d(edges, self.orbit.stations.angles)
        relative = self.scale[:, None] / self.scale
        # magnitudes of the parameters, from the numbers that they change
        numbers = np.abs(np.concatenate([self._drive, self._p]))[:, None]
        sizes = np.divide(numbers, np.abs(along), out=np.full(along.shape, np.inf), where=along * numbers != 0.0)
        least = _NO_EFFECT / sizes.min(axis=0, initial=np.inf)
        for _ in range(_HALVINGS):
            self.h = np.diff(edges)
            self.angles = edges[:-1, None] + self.h[:, None] * _GAUSS.nodes
            states = self.orbit.sample(self.angles.ravel())
            self.y = flow.unknowns(states, self._drive).reshape(*self.angles.shape, flow.size)
            self.rates, first = self._first_derivatives()
            self.by_y, self.by_constant = first[..., : flow.size], first[..., flow.size :]
            self.forcing = self.by_constant @ along
            # effects are relative to the greatest one of a parameter; in a motion at rest many are only rounding errors
            effect = np.abs(self.forcing / self.scale[:, None]).max(axis=(0, 1, 2), initial=1e-300)
            effect = np.maximum(effect, least * np.abs(self.by_y / relative).max())
            rough = np.zeros(len(self.h), dtype=bool)
            for values, size in (
                (self.rates, self.scale),
                (self.by_y, relative),
                (self.forcing, self.scale[:, None] * effect * (_EFFECT / _RESOLVED)),
            ):
                series = np.einsum("is,ks...->ki...", _GAUSS.coefficients, values / size)
                rough |= self.h * _greatest(series[:, -2:]) > _RESOLVED
                # a kink between the last node of a panel and the first node of the next one
                gaps = series.sum(axis=1) - np.roll(np.einsum("i,ki...->k...", _SIGNS, series), -1, axis=0)
                apart = self._joined & (np.maximum(self.h, np.roll(self.h, -1)) * _greatest(gaps) > _CONTINUOUS)
                rough |= apart | np.roll(apart, 1)
            if not rough.any():
                break
            edges = np.sort(np.append(edges, 0.5 * (edges[:-1] + edges[1:])[rough]))

    @property
    def _joined(self) -> NDArray[np.bool_]:
        """Whether the motion goes on without a gap from each panel to the next and, if closed, from the last to the first."""
        joined = np.ones(len(self.h), dtype=bool)
        joined[-1] = self.orbit.residual <= _CONTINUOUS
        return joined

    def _find_kinks(self) -> list[_Kink]:
        """Return the kinks of the rates. A kink is between the first node of its panel and the first node of the next one."""
        relative = self.scale[:, None] / self.scale
        jumps = _greatest((np.roll(self.by_y[:, 0], -1, axis=0) - self.by_y[:, 0]) / relative)
        steep = jumps > _STEEP * np.sqrt(self.h) * np.abs(self.by_y / relative).max()
        slope = _angle_derivatives(self.flow, self.switched)
        modes = list(self.flow.modes)

        def derivatives(panel: int) -> tuple[FloatArray, FloatArray, FloatArray]:
            by_angle = slope(self.angles[panel, 0], self.y[panel, 0], modes, self._drive, self._p)
            return self.by_y[panel, 0], self.by_constant[panel, 0], np.asarray(by_angle).ravel()

        kinks = []
        for k in np.flatnonzero(steep & self._joined & (self.h < _KINK)).tolist():
            by_y, by_constant, by_angle = map(np.subtract, derivatives((k + 1) % len(self.h)), derivatives(k))
            kinks.append(_Kink(k, by_y, by_constant, by_y @ self.rates[k, 0] + by_angle))
        return kinks

    def _call(
        self, name: str, size: int, direction: FloatArray | None = None, along: FloatArray | None = None
    ) -> FloatArray:
        """Evaluate the function ``name`` of `_code` at the nodes; shape (k, s, size).

        ``direction`` is a direction in the space of y, ``along`` a direction in the space of drive vector and constants, for a
        directional derivative; both are zero if not given.
        """
        direction = np.zeros_like(self.y) if direction is None else direction
        along = np.zeros(self.constants) if along is None else along
        arguments = np.concatenate([self.y, direction, self.angles[..., None]], axis=-1)
        rows_of_arguments = arguments.reshape(self.angles.size, -1)
        count, d = self.angles.size, self.flow.drive_size
        drive = np.concatenate([self._drive, along[:d]])
        values = np.empty((count, size))
        rows(
            _code(self.flow, self.switched, name).addresses[name],
            1,
            np.array(self.flow.modes, dtype=float),
            np.concatenate([self._p, along[d:]]),
            np.ascontiguousarray(rows_of_arguments),
            np.tile(drive, (count, 1)),
            values,
        )
        return values.reshape(*self.angles.shape, size)

    @property
    def constants(self) -> int:
        """Size of the drive vector plus the number of constants."""
        return self.flow.drive_size + len(self._p)

    def _first_derivatives(self) -> tuple[FloatArray, FloatArray]:
        """Return the rates at the nodes, shape (k, s, n), and their derivatives, shape (k, s, n, n + c).

        The derivatives are with respect to y and, after it, the drive vector and the constants.
        """
        n, width = self.flow.size, self.flow.size + self.constants
        found = self._call("first", n * (1 + width))
        return found[..., :n], found[..., n:].reshape(*self.angles.shape, width, n).swapaxes(-1, -2)

    def second_derivatives(
        self, direction: FloatArray, along: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of ``by_y`` and of ``by_constant`` along a direction.

        Parameters
        ----------
        direction : ndarray, shape (k, s, n)
            Components of the direction in the space of y, at the nodes.
        along : ndarray, shape (c,), optional
            Components of the direction in the space of the drive vector and the constants; zero if not given.
        """
        n, width = self.flow.size, self.flow.size + self.constants
        found = self._call("second", n * width, direction, along)
        found = found.reshape(*self.angles.shape, width, n).swapaxes(-1, -2)
        by_y, by_constant = found[..., :n], found[..., n:]
        for kink in self._kinks:
            # along the direction the kink comes earlier by ``ahead``; all changes at a kink are multiples of one vector
            change = kink.by_y @ direction[kink.panel, 0] + (0.0 if along is None else kink.by_constant @ along)
            ahead = (change / self.scale**2) @ kink.slope / np.sum((kink.slope / self.scale) ** 2)
            by_y[kink.panel] += kink.by_y * (ahead / self.h[kink.panel])
            by_constant[kink.panel] += kink.by_constant * (ahead / self.h[kink.panel])
        return by_y, by_constant

    # Linear equations

    def _solve_panels(self) -> None:
        """Compute, for d' = A d + r, the matrices that give d on each panel from d at the beginning of the panel and from r."""
        n, k = self.flow.size, len(self.h)
        size = _POINTS * n
        integrals = self.h[:, None, None] * _GAUSS.integrals
        matrix = np.eye(size) - np.einsum("kij,kjab->kiajb", integrals, self.by_y).reshape(k, size, size)
        inverse = np.linalg.inv(matrix).reshape(k, size, _POINTS, n)
        #: Matrices that give d at the nodes, from r and from d at the beginning of the panel.
        self._to_nodes = np.einsum("kxia,kij->kxja", inverse, integrals).reshape(k, size, size)
        self._from_start = inverse.sum(axis=2)
        weights = self.h[:, None] * _GAUSS.weights
        weighted = np.einsum("ki,kiab->kaib", weights, self.by_y).reshape(k, n, size)
        #: Matrices that give d at the end of the panel, from r and from d at the beginning.
        self._to_end = weighted @ self._to_nodes + np.einsum("ki,ab->kaib", weights, np.eye(n)).reshape(k, n, size)
        self.steps = np.eye(n) + weighted @ self._from_start
        starts = np.empty((k, n, n))
        matrix = np.eye(n)
        for panel, step in enumerate(self.steps):
            starts[panel] = matrix
            matrix = step @ matrix
        self.monodromy = matrix
        #: dy/dy(0) at the nodes, (k, s, n, n)
        self.fundamental = (self._from_start @ starts).reshape(k, _POINTS, n, n)

    def _gains(self, forcing: FloatArray) -> FloatArray:
        k, n = len(self.h), self.flow.size
        return self._to_end @ forcing.reshape(k, _POINTS * n, -1)

    def _node_values(self, starts: FloatArray, forcing: FloatArray) -> FloatArray:
        k, n = len(self.h), self.flow.size
        found = self._from_start @ starts + self._to_nodes @ forcing.reshape(k, _POINTS * n, -1)
        return np.asarray(found.reshape(k, _POINTS, n, -1))

    def final_deviation(self, forcing: FloatArray) -> FloatArray:
        """Return d after the period, shape (n, m), for d' = A d + r from d = 0; r has the shape (k, s, n, m)."""
        gains = self._gains(forcing)
        d = np.zeros_like(gains[0])
        for step, gain in zip(self.steps, gains):
            d = step @ d + gain
        return np.asarray(d)

    def solve_from_start(self, start: FloatArray, forcing: FloatArray) -> FloatArray:
        """Return d at the nodes, shape (k, s, n, m), for d' = A d + r from d = ``start``, (n, m), with the forcing r."""
        gains = self._gains(forcing)
        starts = np.empty((len(self.h), *start.shape))
        d = start
        for panel, (step, gain) in enumerate(zip(self.steps, gains)):
            starts[panel] = d
            d = step @ d + gain
        return self._node_values(starts, forcing)

    def periodic_solution(self, forcing: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the periodic solution of d' = A d + r: at the nodes, (k, s, n, m), and at crank angle 0, (n, m).

        Raises
        ------
        LinkworkError
            If there is no such solution: exactly at a fold.
        """
        starts = _solve_cyclic(self.steps, self._gains(forcing))
        return self._node_values(starts, forcing), starts[0]

    # Results

    def monodromy_derivatives(self, ways: FloatArray, constants: FloatArray) -> FloatArray:
        """Return the derivatives of the monodromy matrix with respect to m numbers, shape (n, n, m).

        ``ways`` are the derivatives of y at the nodes with respect to these numbers, shape (k, s, n, m); ``constants`` are the
        derivatives of the drive vector and, below them, of the constants, shape (c, m).
        """
        second = (self.second_derivatives(column) for column in np.moveaxis(self.fundamental, -1, 0))
        return np.stack([self.final_deviation(by_y @ ways + by_k @ constants) for by_y, by_k in second], axis=1)

    def integral(self, values: FloatArray) -> FloatArray:
        """Integrate over the period a quantity with given values at the nodes, shape (k, s, ...)."""
        return np.einsum("k,s,ks...->...", self.h, _GAUSS.weights, values)

    def slope(self, panel: int, values: FloatArray, position: float) -> float:
        """Return the derivative of a quantity with respect to the crank angle, at a position on a panel.

        ``values``, shape (s,), are the values of the quantity at the nodes of the panel.
        """
        series = legendre.legder(_GAUSS.coefficients @ values)
        return float(legendre.legval(position, series) * 2.0 / self.h[panel])

    def greatest_value(self, values: FloatArray) -> tuple[float, Place]:
        """Return the greatest value over the period of a quantity with given values at the nodes, shape (k, s), and its place.

        For a vector quantity, shape (k, s, c), the result is the greatest modulus.
        """
        vectors = values.ndim == 3
        coefficients = np.einsum("is,ks...->ki...", _GAUSS.coefficients, values)
        on_grid = np.einsum("gi,ki...->kg...", _GRID, coefficients)
        first = int(((on_grid**2).sum(axis=-1) if vectors else on_grid).max(axis=1).argmax())
        found = []
        # next to an end of a panel rounding errors decide on which panel the greatest value lies
        for panel in (first - 1, first, (first + 1) % len(self.h)):
            series = coefficients[panel]
            if vectors:
                series = reduce(legendre.legadd, (legendre.legmul(part, part) for part in series.T))
            turning = legendre.legroots(legendre.legder(series)) if np.any(series[1:]) else np.zeros(0)
            real = turning[np.abs(turning.imag) < _REAL].real
            places = np.append(real[np.abs(real) < 1.0], [-1.0, 1.0])
            there = legendre.legval(places, series)
            found.append((float(there.max()), panel % len(self.h), float(places[there.argmax()])))
        value, panel, position = max(found)
        weights = legendre.legvander(np.array([position]), _POINTS - 1)[0] @ _GAUSS.coefficients
        return sqrt(value) if vectors else value, Place(panel, position, weights)

    def outputs(self) -> FloatArray:
        """Return all outputs at the nodes, shape (k, s, outputs)."""
        return self._call("outputs", len(self.flow.mechanism.output_names))

    def output_derivatives(self, panel: int, number: int) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of the output with the index ``number`` at the nodes of a panel.

        The derivatives are with respect to y, shape (s, n), and to the drive vector and the constants, shape (s, c).
        """
        n = self.flow.size
        function = _output_derivatives(self.flow, self.switched, number)
        found = [
            np.asarray(function(angle, y, list(self.flow.modes), self._drive, self._p)).ravel()
            for angle, y in zip(self.angles[panel], self.y[panel])
        ]
        return np.array(found)[:, :n], np.array(found)[:, n:]


def _solve_cyclic(steps: FloatArray, gains: FloatArray) -> FloatArray:
    """Solve for d at the beginning of each panel, shape (k, n, m), so that d is continuous over the closed period.

    ``steps`` and ``gains`` give d at the end of a panel: step @ d + gain. Neighbouring panels are merged in pairs, repeatedly:
    orthogonal transformations eliminate d between the two panels, so that neither growth nor decay accumulates.
    """
    count, n, _ = gains.shape
    # panels of length zero make their number a power of two
    more = (1 << (count - 1).bit_length()) - count
    whole = np.broadcast_to(np.eye(n), (count + more, n, n))
    # a d + b (d at the beginning of the next panel) = right
    a, b = np.concatenate([-steps, -whole[:more]]), whole
    right = np.pad(gains, ((0, more), (0, 0), (0, 0)))
    levels = []
    while len(a) > 1:
        none = np.zeros_like(a[::2])
        turned, triangle = np.linalg.qr(np.concatenate([b[::2], a[1::2]], axis=1), mode="complete")
        rows = [np.concatenate(row, axis=2) for row in ((a[::2], none, right[::2]), (none, b[1::2], right[1::2]))]
        outer = turned.swapaxes(1, 2) @ np.concatenate(rows, axis=1)
        levels.append((triangle[:, :n], outer[:, :n]))
        a, b, right = np.split(outer[:, n:], (n, 2 * n), axis=2)
    if np.linalg.norm(a[0] + b[0], -2) <= _ROUNDING * np.linalg.norm(np.hstack([a[0], b[0]])):
        raise LinkworkError("the motion is at a fold: it has no derivatives by the parameters")
    found = np.linalg.solve(a + b, right)
    for triangle, outer in reversed(levels):
        beside = np.concatenate([found, np.roll(found, -1, axis=0)], axis=1)
        between = np.linalg.solve(triangle, outer[:, :, 2 * n :] - outer[:, :, : 2 * n] @ beside)
        found = np.stack([found, between], axis=1).reshape(-1, *gains.shape[1:])
    return np.asarray(found[:count])


class _Symbols(NamedTuple):
    """CasADi symbols of a flow's arguments, and the flow's rates and outputs as expressions of these arguments.

    ``dy``, ``d_drive`` and ``d_p`` are symbols of the direction of a directional derivative, in the space of y, of the drive
    vector and of the constants.
    """

    y: Any
    dy: Any
    angle: Any
    modes: Any
    drive: Any
    d_drive: Any
    p: Any
    d_p: Any
    rates: Any
    outputs: Any


@cache
def _symbols(flow: Flow, switched: bool) -> _Symbols:
    casadi = symbolic.library()
    plain, state = flow.function(PLAIN, switched), flow.function(STATE, switched)
    n, size = flow.size, plain.size1_in(4) // 2
    y, dy = casadi.SX.sym("y", n), casadi.SX.sym("dy", n)
    angle, modes = casadi.SX.sym("angle"), casadi.SX.sym("modes", len(flow.mechanism.modes))
    drive, d_drive = casadi.SX.sym("drive", flow.drive_size), casadi.SX.sym("d_drive", flow.drive_size)
    p, d_p = casadi.SX.sym("p", size), casadi.SX.sym("d_p", size)
    join, zeros = casadi.vertcat, casadi.SX.zeros
    arguments = angle, join(y, zeros(n * (n + 1))), modes, join(drive, zeros(flow.drive_size)), join(p, zeros(size))
    x, u = state(*arguments)
    trace = expressions(flow.mechanism, switched)
    outputs = casadi.Function("outputs", [*trace.symbols], [trace.outputs])(x, modes, u, casadi.vertcat(p, 0.0))
    return _Symbols(y, dy, angle, modes, drive, d_drive, p, d_p, plain(*arguments), outputs)


@cache
def _code(flow: Flow, switched: bool, name: str) -> MachineCode:
    """Return the machine code of one of three functions, by name.

    "first" gives the rates and their first derivatives, "second" the derivatives of the first derivatives along a direction,
    "outputs" the outputs. The arguments are (y, direction of y, crank angle), the modes, the drive vector with its direction,
    and the constants with their direction.
    """
    casadi = symbolic.library()
    with MAKING:
        s = _symbols(flow, switched)
        of = casadi.vertcat(s.y, s.drive, s.p)
        jacobian = casadi.jacobian(s.rates, of)
        if name == "first":
            results = [s.rates, jacobian]
        elif name == "second":
            along = casadi.jtimes(casadi.vec(jacobian), of, casadi.vertcat(s.dy, s.d_drive, s.d_p))
            results = [casadi.reshape(along, *jacobian.shape)]
        else:
            results = [s.outputs]
        t, join = casadi.SX.sym("t"), casadi.vertcat
        arguments = [t, join(s.y, s.dy, s.angle), s.modes, join(s.drive, s.d_drive), join(s.p, s.d_p)]
        return MachineCode([casadi.Function(name, arguments, [casadi.densify(r) for r in results], {"cse": True})])


@cache
def _angle_derivatives(flow: Flow, switched: bool) -> Any:
    """Return the function that gives the derivatives of the rates with respect to the crank angle."""
    s = _symbols(flow, switched)
    return _make_function(s, symbolic.library().jacobian(s.rates, s.angle))


@cache
def _output_derivatives(flow: Flow, switched: bool, number: int) -> Any:
    casadi = symbolic.library()
    s = _symbols(flow, switched)
    return _make_function(s, casadi.jacobian(s.outputs[number], casadi.vertcat(s.y, s.drive, s.p)))


def _make_function(s: _Symbols, result: Any) -> Any:
    casadi = symbolic.library()
    return casadi.Function("f", [s.angle, s.y, s.modes, s.drive, s.p], [casadi.densify(result)], {"cse": True})
