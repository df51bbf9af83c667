"""Discretise a period: one interface for shooting and collocation, and the rule that chooses between them.

A period is divided into pieces. The unknowns of a periodic motion are the states y at the beginnings of the pieces; the
residual is y at the end of each piece minus y at the beginning of the next piece. The exact Jacobian contains, for each piece,
the derivatives of y at the end with respect to y at the beginning. The product of these matrices is the monodromy matrix; its
eigenvalues are the Floquet multipliers. Both methods compute the `Ends` of the pieces. `orbit.OrbitEquations` builds the
equations for Newton's method and for continuation from them.

- **Shooting** integrates each piece with steps of order 8. With one piece it is single shooting, with several multiple
  shooting. It works for every drive.
- **Collocation** corrects the polynomials of a neighbouring motion, element by element. It evaluates the right-hand sides a
  sixth as often as shooting. It works if the crank's speed is prescribed and the rates are smooth (`can_collocate`), as
  long as the links stay clear of the limit of assembly and not too many elements are needed; otherwise shooting is used for
  a while.

The period is one piece as long as a deviation grows less than `GROWTH` times over the period. If a deviation grows more, the
period is divided so that deviations grow about `AIM` times over each piece (`choose_pieces`).
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ...mechanisms import MECHANISMS, Parameters, find_mechanism
from ...run import repeats
from . import collocation, kernels
from .drive import Direction, Drive, flow_scales, is_smooth, require_drive
from .flow import DIRECTIONAL, GAP, IN_LANES, PLAIN, Flow
from .kernels import Section, Status

FloatArray = NDArray[np.float64]
#: Bound of the local error of a step; the error of the solution is about a hundred times as large.
INTEGRATOR_TOLERANCE = 1e-12
#: Growth of a deviation over a period, or over one of its pieces, above which the period is divided into (more) pieces; growth
#: wanted over each piece; number of crank angles in a turn from which the ends of the pieces are chosen.
GROWTH, AIM, PLACES = 1e3, 10.0, 64
#: Least number of pieces in a turn.
_FEWEST = 8
#: Collocation: calls that use shooting after collocation has failed; elements in a common period at first; greatest number of
#: elements for each piece, to which eight times the number at first is added; calls after which the elements are chosen again.
_PAUSE, _ELEMENTS, _MOST, _RENEWED = 16, 8, 8, 64


class OrbitError(LinkworkError):
    """No periodic motion was found.

    Attributes
    ----------
    reason : str
        Reason, in one sentence.
    start : tuple of float
        y at crank angle 0 of the last iterate: see `PeriodicOrbit`.
    residual : float
        ``|y(T) - y(0)|`` relative to the scale of y; infinite if the motion ended within the first period.
    iterations : int
    """

    def __init__(self, reason: str, flow: Flow, start: Iterable[float], residual: float, iterations: int) -> None:
        self.reason = reason
        self.start = tuple(float(value) for value in start)
        self.residual = residual
        self.iterations = iterations
        place = ", ".join(f"{n} = {value:.6g} {unit}" for (n, unit), value in zip(flow.components, self.start))
        reached = f"the motion misses its start by {residual:.2e} after {iterations} corrections, from"
        closed = reached if np.isfinite(residual) else "the motion ends within the first period from"
        super().__init__(f"no periodic motion found: {reason}; {closed} {place}")


class OrbitAssemblyError(OrbitError, AssemblyError):
    """The motion reaches the limit of assembly."""


def orbit_error(
    status: int, flow: Flow, start: FloatArray, residual: float = np.inf, iterations: int = 0
) -> OrbitError:
    """Return the exception for a `Status` of the kernels that means failure."""
    kind = OrbitAssemblyError if status == Status.LIMIT else OrbitError
    return kind(kernels.REASONS[Status(status)], flow, start, float(residual), iterations)


class Ends(NamedTuple):
    """y at the ends of the k pieces of a period, with the derivatives of these states."""

    y: FloatArray  # y at the end of each piece, shape (k, n)
    matrices: FloatArray  # its derivatives by y at the beginning, (k, n, n)
    slopes: FloatArray  # its derivatives by a parameter lambda, (k, n)
    clearance: float | None = None  # least clearance to the limit of assembly, if it was computed


class Period(NamedTuple):
    """Result of following one period from a start: y(T) - y(0), shape (n,), dy(T)/dy(0), (n, n), and dy(T)/dlambda, (n,)."""

    shift: FloatArray
    monodromy: FloatArray
    slope: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class OperatingPoint:
    """A mechanism and its drive as arrays for the kernels, computed once and shared by all results of a motion."""

    parameters: Parameters
    drive: Drive
    mechanism: Mechanism
    flow: Flow  # the mechanism with this drive, as a flow
    vector: FloatArray  # drive vector, `Drive.vector`
    constants: FloatArray  # constants of the equations

    def __reduce__(self) -> tuple[object, ...]:
        return _unpickle, (self.mechanism, self.parameters, self.drive)

    def scale(self, start: FloatArray) -> FloatArray:
        """Return the scale of each component of y, its typical magnitude: see `motion_scales`."""
        return flow_scales(self.flow, self.parameters, self.vector, start)

    def section(
        self,
        start: FloatArray,
        *functions: int,
        tolerance: float = INTEGRATOR_TOLERANCE,
        direction: Direction | None = None,
        along: float = 1.0,
        switched: bool = False,
    ) -> Section:
        """Return the `Section` for the kernels: addresses of the flow's functions, constants, drive, scale of y, tolerance.

        ``start``, shape (n,), gives the magnitudes of y; ``functions`` are the indices of the flow's functions that are needed
        besides GAP. ``direction`` are the derivatives with respect to a parameter lambda, zero if not given; ``along`` is the
        typical magnitude of lambda, which scales the errors of these derivatives. If ``switched``, the equations with their
        optional terms, such as friction, are used even if this mechanism has none.
        """
        d_drive, d_p = direction or (np.zeros_like(self.vector), np.zeros_like(self.constants))
        # a change of lambda may switch the optional terms on
        switched = switched or any(map(self.mechanism.is_switched_on, (self.constants.tolist(), d_p.tolist())))
        return Section(
            self.flow.addresses(GAP, *functions, switched=switched),
            np.array(self.flow.modes, dtype=float),
            np.concatenate([self.vector, d_drive]),
            np.concatenate([self.constants, d_p]),
            self.scale(start),
            self.flow.angle_periods,
            along,
            tolerance,
            self.flow.torque,
            self.flow.longest_step(self.vector),
            np.full(len(self.flow.free), self.mechanism.greatest_rotation),
        )

    def shoot(
        self, angles: FloatArray, starts: FloatArray, direction: Direction | None = None, along: float = 1.0
    ) -> Ends:
        """Integrate y with its derivatives over the pieces of a period, each from its own start; raise OrbitError on failure.

        For ``angles`` and ``starts`` see `Stations`, for ``direction`` and ``along`` see `section`.
        """
        k, n = starts.shape
        rows = np.zeros((k, n * (2 + n)))
        section = self.section(starts[0], DIRECTIONAL, direction=direction, along=along)
        status = kernels.segments(section, angles, np.ascontiguousarray(starts), rows)
        if status != Status.DONE:
            raise orbit_error(status, self.flow, starts[0])
        return _ends(rows, n)

    def period(self, start: FloatArray, turns: int, direction: Direction | None = None, along: float = 1.0) -> Period:
        """Integrate over ``turns`` common periods from a start that need not be on a periodic orbit; see `shoot`."""
        ends = self.shoot(np.array([0.0, self.flow.period * turns]), start[None, :], direction, along)
        return Period(ends.y[0] - start, ends.matrices[0].copy(), ends.slopes[0])


def operating_point(parameters: Parameters, drive: Drive) -> OperatingPoint:
    """Return a mechanism and its drive as an `OperatingPoint`.

    Raises InputError if the drive does not suit the mechanism. The error is also raised if a gear ratio or a force law differs
    from that of the mechanism's first published set, and the motion therefore does not repeat after the common period.
    """
    require_drive(drive)
    mechanism = find_mechanism(parameters)
    constants = np.array(parameters.constants())
    point = OperatingPoint(parameters, drive, mechanism, drive.flow(mechanism), drive.vector(mechanism), constants)
    coupled = [freedom.coordinate for freedom in mechanism.freedoms if freedom.coupled]
    known, names = mechanism.first_set.parameters, (*mechanism.names("ratio"), *mechanism.names("law"))
    changed = [name for name in names if getattr(parameters, field_name(name)) != getattr(known, field_name(name))]
    if changed and not _repeats(point):
        values = " and ".join(f"{name} is {getattr(parameters, field_name(name))}" for name in changed)
        raise InputError(
            f"{values}: with these values the {mechanism.name} does not repeat after its period, which follows from the values "
            "of its description; describe it with the new values"
        )
    if coupled and not _repeats(point):
        raise InputError(
            f"a spring couples {' and '.join(coupled)}, and every common period of this drive winds it up further: give "
            "commanded cranks speeds that do not wind it up; if one of the two is free, describe the coupling at a pin, at = "
            "NAME, whose freedom is the twist, or in Python give its turns per turn of the crank, such as ratios = "
            f"{{{coupled[-1]!r}: 1}}"
        )
    return point


def _repeats(point: OperatingPoint) -> bool:
    """Return whether the equations repeat after a common period, and after a whole turn of each free angle that is not coupled.

    The result is also True if the links can be joined at none of the angles tried.
    """
    mechanism, flow, rates = point.mechanism, point.flow, len(point.mechanism.freedoms)
    modes, u, p = tuple(map(float, flow.modes)), point.vector[: flow.inputs], point.parameters.constants()
    way = np.zeros(mechanism.size)
    way[flow.crank] = flow.period
    way[list(flow.others)] = flow.period * point.vector[flow.held + rates :]
    turned = [np.eye(mechanism.size)[n] * period for n, period in zip(flow.free, flow.angle_periods) if period]
    x, found = np.array(mechanism.state(mechanism.first_set.initial)), []
    for share in (0.1234, 0.3719, 0.6283, 0.8871):
        for own in (way, *turned):
            with suppress(ArithmeticError, ValueError):
                found.append(repeats(mechanism, p, modes, x + share * way, u, own))
    return all(found)


def _unpickle(mechanism: Mechanism, parameters: Parameters, drive: Drive) -> OperatingPoint:
    """Rebuild an operating point from a pickle; register its mechanism if this process does not know it."""
    MECHANISMS.setdefault(mechanism.name, mechanism)
    return operating_point(parameters, drive)


def can_collocate(drives: Iterable[Drive], sets: Iterable[Parameters]) -> bool:
    """Return whether collocation can be used: all speeds must be prescribed, and all rates must be smooth functions.

    Collocation assumes that the slope of a coordinate over the crank angle is its rate divided by the crank speed. This does
    not hold for a second crank that turns freely, or for a link that goes round.
    """
    sets = list(dict.fromkeys(sets))
    mechanism = find_mechanism(sets[0])

    def goes_round(drive: Drive) -> bool:
        ratios = drive.ratios_by_freedom(mechanism)
        return bool(ratios and {*drive.flow(mechanism).free} & {*ratios})

    return all(drive.speed_drive and not goes_round(drive) for drive in drives) and all(map(is_smooth, sets))


class Stations(NamedTuple):
    """The pieces of a period in multiple shooting."""

    angles: FloatArray  # crank angles (rad) at which the k pieces begin, the first 0, and the end of the period, shape (k + 1,)
    starts: FloatArray  # y at the beginnings of the pieces, (k, n)
    growth: float  # greatest growth factor of a deviation over a piece: see `growth_factors`


def growth_factors(matrices: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the greatest growth factor of a deviation over each piece of a period; shape (k,).

    For ``matrices`` see `Ends`; deviations are measured in units of ``scale``, the scale of y.
    """
    return np.asarray(np.linalg.norm(matrices * scale / scale[:, None], ord=2, axis=(1, 2)))


def choose_pieces(point: OperatingPoint, places: FloatArray, turns: int) -> tuple[FloatArray, FloatArray]:
    """Divide a period into pieces, shorter where deviations grow faster; return their angles and starts: see `Stations`.

    ``places``, shape (PLACES turns, n), is y at equal steps of the crank angle.
    """
    count = len(places)
    angles = np.linspace(0.0, point.flow.period * turns, count + 1)
    growth = np.log(growth_factors(point.shoot(angles, places).matrices, point.scale(places[0])).clip(1.0))
    # half of the pieces by growth, half by angle
    pieces = int(np.clip(np.ceil(2.0 * growth.sum() / np.log(AIM)), _FEWEST * turns, count))
    share = np.concatenate([[0.0], np.cumsum(growth / max(growth.sum(), 1e-9) + 1.0 / count)])
    chosen = np.unique(np.searchsorted(share, np.linspace(0.0, share[-1], pieces + 1)).clip(0, count))
    return angles[chosen], places[chosen[:-1]]


class Discretisation:
    """Method that computes y at the ends of the pieces of a period, for one motion of a family after another.

    Collocation, which takes the previous motion as first approximation, is tried if ``collocated`` is true: see
    `can_collocate`. Shooting is used where collocation is not tried or fails. For ``angles`` see `Stations`.
    """

    def __init__(self, angles: FloatArray, collocated: bool) -> None:
        self.angles, self.collocated = angles, collocated
        self._calls = self._pause = 0
        self._value: float | None = None
        self._mesh = self._firsts = np.empty(0)

    def ends(
        self,
        point: OperatingPoint,
        starts: FloatArray,
        value: float = 0.0,
        direction: Direction | None = None,
        along: float = 1.0,
    ) -> Ends:
        """Compute y and its derivatives at the ends of the pieces from y at their beginnings, ``starts``.

        ``value`` is the value of lambda; for ``direction`` and ``along`` see `OperatingPoint.section`. Raises OrbitError if the
        integration over a piece fails.
        """
        self._pause -= 1
        if self.collocated and self._pause < 0:
            functions = (PLAIN, IN_LANES + DIRECTIONAL, IN_LANES + GAP)
            section = point.section(starts[0], *functions, direction=direction, along=along)
            ends = self._collocate(section, point.flow, starts, value)
            if ends is not None:
                return ends
        return point.shoot(self.angles, starts, direction, along)

    def _collocate(self, section: Section, flow: Flow, starts: FloatArray, value: float) -> Ends | None:
        """Compute y at the ends by collocation on as many elements as are needed; return None if shooting must be used."""
        k, n = starts.shape
        self._calls += 1
        if self._calls % _RENEWED == 1:
            lengths = np.diff(self.angles)
            counts = np.ceil(lengths * _ELEMENTS / flow.period - 1e-9).astype(np.int64)
            parts = [a + h * np.arange(count) / count for a, h, count in zip(self.angles, lengths, counts)]
            self._divide(np.concatenate([*parts, self.angles[-1:]]), n)
        most = _MOST * len(self.angles) + 8 * _ELEMENTS * (self.angles[-1] / flow.period)
        while len(self._mesh) <= most:
            known = self._value is not None
            found = collocation.PieceSolution(np.zeros((k, n * (2 + n))), np.zeros(len(self._mesh) - 1), np.zeros(1))
            change = 0.0 if self._value is None else value - self._value
            status = collocation.solve_pieces(
                section, self._mesh, self._firsts, np.ascontiguousarray(starts), change, known, self._known, found
            )
            self._value = None
            if status == Status.LIMIT:
                raise orbit_error(status, flow, starts[0])
            if status == Status.DONE:
                clearance = float(found.clearance[0])
                if clearance < collocation.BETWEEN * np.diff(self._mesh).max():
                    return None
                self._value = value
                return _ends(found.rows, n)._replace(clearance=clearance)
            if status == Status.NO_STEP:
                long = ~(found.tails <= collocation.DECAY * np.sqrt(section.tolerance))
            elif known:
                # not found from the neighbouring motion: try again without this motion
                continue
            else:
                long = np.ones(len(found.tails), dtype=bool)
            halves = 0.5 * (self._mesh[:-1] + self._mesh[1:])
            self._divide(np.sort(np.concatenate([self._mesh, halves[long]])), n)
        self._calls, self._pause = 0, _PAUSE
        return None

    def _divide(self, mesh: FloatArray, n: int) -> None:
        """Divide the pieces into new elements that begin at the crank angles ``mesh``, and forget the previous motion."""
        self._value = None
        self._mesh = mesh
        self._firsts = np.searchsorted(mesh, self.angles).astype(np.int64)
        self._known = collocation.neighbour(len(mesh) - 1, n)


def _ends(rows: FloatArray, n: int) -> Ends:
    """Return the `Ends` of the pieces from the array ``rows`` that a kernel has written; n is the size of y."""
    matrices = rows[:, n : n + n * n].reshape(-1, n, n).transpose(0, 2, 1)
    return Ends(rows[:, :n], matrices, rows[:, n + n * n :])
