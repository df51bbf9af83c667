"""Write a mechanism as a flow, from the traced equations; compute Floquet multipliers, and judge stability by them.

A flow gives the derivatives dy/dangle of the state y over the crank angle. The monodromy matrix maps a small deviation from a
periodic motion to the deviation one period later; its eigenvalues are the Floquet multipliers. Orbits of a mechanism and linear
equations with periodic coefficients are judged by the same rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from math import exp, isfinite, pi
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.variables import Variable

from ...numerics import symbolic
from ...numerics.codegen import MAKING, MachineCode
from ...numerics.vectors import LANES
from ...run import MOTOR, constants, kloss, symbolic_equations

# Indices of the functions of a flow in its addresses; the functions in lanes begin at IN_LANES, in the same order
PLAIN, VARIATIONAL, DIRECTIONAL, GAP, STATE = range(5)
_NAMES = ("plain", "variational", "directional", "gap", "state")
IN_LANES = len(_NAMES)
#: Distance of the largest multiplier from the unit circle below which a verdict is "marginal" by default.
TOLERANCE = 1e-6
#: Angle from the real axis (rad) below which a multiplier counts as real. A double multiplier on the axis is accurate only to
#: the square root of the rounding errors.
REAL_ANGLE = 1e-5


class Crank(NamedTuple):
    """A crank of a mechanism: a degree of freedom that turns without end."""

    freedom: int  # index of the freedom
    command: int | None  # index of the channel of the commanded speed, if there is one
    torque: int | None  # index of the channel of the torque on the crank, if there is one


@cache
def find_cranks(mechanism: Mechanism) -> tuple[Crank, ...]:
    """Return all cranks of a mechanism."""
    index = mechanism.channel_index
    return tuple(Crank(n, index(n, "command"), index(n, "force")) for n in mechanism.cyclic_freedoms)


@cache
def find_turning_freedom(mechanism: Mechanism, name: str) -> int:
    """Return the index of the degree of freedom of a crank, or of a link that swings and may go round.

    ``name`` is one of the FMI names of the crank or link.
    """
    swinging = {freedom.coordinate: n for n, freedom in enumerate(mechanism.freedoms) if freedom.swings}
    return swinging[name] if name in swinging else find_crank(mechanism, name).freedom


@cache
def find_crank(mechanism: Mechanism, name: str = "") -> Crank:
    """Return the crank of a mechanism, by name if there are several.

    Parameters
    ----------
    mechanism : Mechanism
    name : str
        FMI name of the coordinate of the crank, of its commanded speed or of the torque on it; may be left out where there is
        one crank.

    Raises
    ------
    InputError
        If the mechanism has no crank, if it has several and no name is given, or if no crank has that name.
    """
    cranks = find_cranks(mechanism)
    if not cranks:
        raise InputError(
            f"a {mechanism.name} has no freedom that turns without end: it has no periodic motions over an angle"
        )
    if len(cranks) == 1 and not name:
        return cranks[0]
    for crank in cranks:
        if name in _names(mechanism, crank):
            return crank
    names = ", ".join(_names(mechanism, crank)[0] for crank in cranks)
    said = f"{name!r} is none of them" if name else "name one"
    raise InputError(
        f"a {mechanism.name} has the cranks {names}: {said}, or give all commanded speeds, as speeds = {{NAME: VALUE, ...}}"
    )


def _names(mechanism: Mechanism, crank: Crank) -> list[str]:
    """Return the FMI names of a crank's coordinate, commanded speed and torque."""
    channels = [mechanism.channels[n].name for n in (crank.command, crank.torque) if n is not None]
    return [mechanism.freedoms[crank.freedom].coordinate, *channels]


class Flow:
    """A mechanism with one kind of drive as a flow: differential equations for the state y over the crank angle.

    Other cranks and undriven links have a ratio to the crank whose angle is the independent variable. Commanded cranks turn
    exactly at their ratio; cranks under a torque and undriven links turn at their ratio on average. For cranks under a torque
    and undriven links, y contains the angle minus the ratio times the crank angle: this difference is periodic. The ratio of
    a link that only swings is 0.

    Parameters
    ----------
    mechanism : Mechanism
    modes : tuple of int
        Values of the mechanism's modes.
    crank : int
        Index of the cyclic degree of freedom whose angle is the independent variable.
    base : int
        Number of periods of the crank after which all cranks, and all links that go round, have made whole turns.
    commons : int
        Number of common periods of the cranks, and of the rotations that springs couple to them, in ``base`` periods of the
        crank.

    Attributes
    ----------
    others : tuple of int
        Indices of the other degrees of freedom that turn, or swing and may go round.
    free : tuple of int
        Indices of the degrees of freedom other than the crank whose coordinates and rates are in y. A degree of freedom that is
        commanded without a ratio is held in place.
    torque : bool
        Whether a torque drives the crank: the crank's rate is then in y.
    motors : int
        Index of the first motor parameter in the drive vector, after the channels; each of `Mechanism.torques` has three.
    held : int
        Index in the drive vector of the coordinates at crank angle 0, one for each degree of freedom; they are used for degrees
        of freedom that are held or have a ratio. The ratios of ``others`` follow.
    components : tuple of (str, str)
        FMI name and unit of each component of y.
    labels : tuple of str
        Names of the components of y in messages: short symbols where there are any.
    places : tuple of int
        Index of each component of y in the state of a run.
    size : int
        Number of components of y.
    swing_count : int
        Number of components at the beginning of y whose amplitudes tell how the mechanism moves: the free coordinates, or
        the crank's speed if there are none.
    rest : ndarray, shape (n,)
        y with the coordinates at which the mechanism starts by default, and rates of zero.
    angle_periods : ndarray, shape (n,)
        Period of each component of y: for an angle the rotation after which the mechanism is the same, otherwise 0. It is 0
        for an angle that a spring couples to others, too: a whole turn of it alone winds the spring up.
    swinging : dict of str to int
        Indices in y of the coordinates of undriven links that may go round, by FMI name.
    """

    def __init__(self, mechanism: Mechanism, modes: tuple[int, ...], crank: int, base: int, commons: int) -> None:
        self.mechanism, self.modes, self.crank, self.base, self.commons = mechanism, modes, crank, base, commons
        self.others = tuple(n for n, freedom in enumerate(mechanism.freedoms) if freedom.period > 0.0 and n != crank)
        by_name = {mode.name: value for mode, value in zip(mechanism.modes, modes)}
        commanded = {mechanism.channels[n].freedom: n for n in mechanism.commands(by_name)}
        forced = {c.argument for c in mechanism.channels if c.kind == "force"}
        self.command = commanded.get(self.crank)
        self.commanded = {n: commanded[n] for n in self.others if n in commanded}
        self.free = tuple(
            n
            for n, freedom in enumerate(mechanism.freedoms)
            if n != self.crank
            and n not in commanded
            and (freedom.mode is None or freedom.mode.arguments[by_name[freedom.mode.name]] in forced)
        )
        self.torque = self.command is None
        rates = len(mechanism.freedoms)
        self.places = (*self.free, *(rates + n for n in self.free), *([rates + self.crank] * self.torque))
        variables = {v.name: v for v in mechanism.variables}
        freedoms = [mechanism.freedoms[n] for n in self.free]
        crank_rate = mechanism.freedoms[self.crank].rate
        names = [f.coordinate for f in freedoms] + [f.rate for f in freedoms] + [crank_rate] * self.torque
        labels = [label(variables[f.coordinate]) for f in freedoms]
        labels += [
            f"{name}'" if name == variables[f.coordinate].symbol else label(variables[f.rate])
            for f, name in zip(freedoms, labels)
        ]
        self.labels = (*labels, *[label(variables[crank_rate])] * self.torque)
        self.components = tuple((name, variables[name].unit) for name in names)
        self.size, free = len(names), len(freedoms)
        self.swing_count = free or self.size
        initial = mechanism.state(mechanism.initial())
        self.rest, self.angle_periods = np.zeros(self.size), np.zeros(self.size)
        self.rest[:free] = [initial[n] for n in self.free]
        self.angle_periods[:free] = [0.0 if freedom.coupled else freedom.period for freedom in freedoms]
        self.swinging = {freedom.coordinate: place for place, freedom in enumerate(freedoms) if freedom.swings}
        self.inputs = self.motors = len(mechanism.channels)
        self.held = self.motors + len(MOTOR) * len(mechanism.torques)
        self.drive_size = self.held + rates + len(self.others)
        self._code: dict[tuple[bool, int], MachineCode] = {}
        self._addresses: NDArray[np.int64] = np.zeros((2, 2 * IN_LANES), dtype=np.int64)

    @property
    def period(self) -> float:
        """Return the crank angle (rad) of the common period of the crank and of everything else that goes round.

        It is one turn if only the crank goes round.
        """
        return self.mechanism.freedoms[self.crank].period * self.base

    @property
    def index_of_all(self) -> int:
        """Return the sum of the indices of all motions: 0 if a link may go round, otherwise 1; see `Orbits.index_of_all`."""
        return 0 if self.angle_periods.any() else 1

    @property
    def turns(self) -> int:
        """Return the number of turns of the crank in the common period: more than one if other cranks or gears need several."""
        return max(1, round(self.period / (2.0 * pi)))

    def turn(self, place: int) -> float:
        """Return the rotation (rad) after which a freedom is in the same position; ``place`` is the index of its angle in y."""
        return self.mechanism.freedoms[self.free[place]].period

    def addresses(self, *which: int, switched: bool = False) -> NDArray[np.int64]:
        """Return the addresses of all functions of the flow, ordered by index; 0 for a function that is not compiled.

        The functions with the indices ``which`` are compiled if needed. ``switched`` tells whether the equations have their
        optional terms, such as friction.
        """
        with MAKING:
            for n in which:
                if (switched, n) not in self._code:
                    if n < IN_LANES:
                        code = MachineCode([self.function(n, switched)])
                    else:
                        code = MachineCode([self.function_in_lanes(n - IN_LANES, switched)], LANES)
                    self._addresses[int(switched), n] = code.addresses[_NAMES[n % IN_LANES]]
                    self._code[switched, n] = code
        return self._addresses[int(switched)]

    def fingerprint(self, *which: int, switched: bool = False) -> str:
        """Return, as one text, the hashes of the machine code of the functions with the indices ``which``."""
        self.addresses(*which, switched=switched)
        return " ".join(self._code[switched, n].fingerprint for n in which)

    def state(self, y: NDArray[np.float64], drive: NDArray[np.float64]) -> tuple[Any, ...]:
        """Return the state of a run at crank angle 0 from y and the drive vector.

        If ``drive`` holds m drive vectors, shape (drive, m), the entries of the state are arrays of length m.
        """
        return tuple(self._plain_state(0.0, y.tolist(), drive.tolist() if drive.ndim == 1 else list(drive), 0.0))

    def _plain_state(self, angle: Any, y: Sequence[Any], drive: Sequence[Any], zero: Any) -> list[Any]:
        """Return the state of a run at a crank angle, as a list of numbers or symbols.

        The rotations of other cranks and links by their ratios are not added.
        """
        rates = len(self.mechanism.freedoms)
        x = [*drive[self.held : self.held + rates], *[zero] * (rates + 2)]
        x[self.crank] = angle
        for number, channel in ({self.crank: self.command} | self.commanded).items():
            if channel is not None:
                x[rates + number] = drive[channel]
        for place, value in zip(self.places, y):
            x[place] = value
        return x

    def remove_turns(self, away: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return differences of y, shape (..., n), with whole turns of angles removed."""
        return away - self.whole_turns(away)

    def nearest_to_rest(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return y with its angles changed by whole turns so that they are nearest to `rest`."""
        return y - self.whole_turns(y - self.rest)

    def whole_turns(self, away: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the whole turns of angles in differences of y, shape (..., n)."""
        return self.angle_periods * np.round(away / np.where(self.angle_periods > 0.0, self.angle_periods, 1.0))

    def paces(self, drive: NDArray[np.float64]) -> dict[str, float]:
        """Return the turns per turn of the crank of each coordinate in y that goes round, by FMI name.

        These ratios are taken from the drive vector.
        """
        freedoms = self.mechanism.freedoms
        return {freedoms[n].coordinate: float(r) for n, r in self._ratios(drive).items() if n in self.free and r}

    def longest_step(self, drive: NDArray[np.float64]) -> float:
        """Return the greatest step of the integrator (rad of the crank): see `Mechanism.greatest_rotation`."""
        return self.mechanism.greatest_rotation / max([1.0, *map(abs, self._ratios(drive).values())])

    def unknowns(self, states: NDArray[np.float64], drive: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return y, shape (..., n), from states of a run, shape (..., states), and the drive vector."""
        y = states[..., self.places]
        for place, ratio in self._ratios(drive).items():
            if place in self.places:
                y[..., self.places.index(place)] -= ratio * states[..., self.crank]
        return y

    def _ratios(self, drive: Any) -> dict[int, Any]:
        """Return the turns of each degree of freedom in `others` per turn of the crank, by index of the degree of freedom."""
        return {n: drive[self.held + len(self.mechanism.freedoms) + i] for i, n in enumerate(self.others)}

    @cache  # noqa: B019 - flows themselves are never discarded
    def function(self, which: int, switched: bool = False) -> Any:
        """Return the function of the flow with the index ``which`` as a ``casadi.Function``.

        The arguments are the crank angle; z, which is y and the columns of its derivatives; the modes; the drive vector and its
        derivative with respect to lambda; the constants and their derivative with respect to lambda. ``plain`` gives dy/dangle;
        ``variational`` gives also the rates of the columns dy/dy0, ``directional`` also the rates of dy/dlambda. ``gap`` gives
        the clearance to the limit of assembly, ``state`` the state of a run and the channels.
        """
        casadi = symbolic.library()
        n, m = self.size, self.mechanism
        angle, modes = casadi.SX.sym("angle"), casadi.SX.sym("modes", len(m.modes))
        y, columns = casadi.SX.sym("y", n), casadi.SX.sym("columns", n, n + 1)
        drive, d_drive = (casadi.SX.sym(name, self.drive_size) for name in ("drive", "d_drive"))
        p, k = constants(m, switched)
        d_p, join = casadi.SX.sym("d_p", p.numel()), casadi.vertcat
        arguments = [angle, join(y, casadi.vec(columns)), modes, join(drive, d_drive), join(p, d_p)]
        x, u = self._state(angle, y, drive)
        functions = symbolic_equations(m)
        applied = functions.find(m.equations.apply_inputs)(
            tuple(casadi.vertsplit(modes)) if m.modes else (), tuple(casadi.vertsplit(u)) if self.inputs else (), k
        )
        if which == GAP:
            settled = functions.find(m.equations.start)(x, applied, k)
            results = [casadi.SX(functions.find(m.equations.clearance)(settled, applied, k))]
        elif which == STATE:
            settled = functions.find(m.equations.start)(x, applied, k)
            results = [casadi.vertcat(*settled), u]
        else:
            rates = functions.find(m.equations.derivative)(x, applied, k)
            f = casadi.vertcat(*[rates[place] for place in self.places]) / x[len(m.freedoms) + self.crank]
            ratios = self._ratios(drive)
            if any(place in ratios for place in self.places):
                f -= casadi.vertcat(*[ratios.get(place, 0.0) for place in self.places])
            results = [f]
            if which != PLAIN:
                jacobian = casadi.jacobian(f, y)
                results.append(jacobian @ columns[:, :n])
            if which == DIRECTIONAL:
                along = casadi.jtimes(f, drive, d_drive) + casadi.jtimes(f, p, d_p)
                results.append(jacobian @ columns[:, n] + along)
        return casadi.Function(_NAMES[which], arguments, [casadi.densify(r) for r in results], {"cse": True})

    def function_in_lanes(self, which: int, switched: bool = False) -> Any:
        """Return a function of the flow in the form that is evaluated at several crank angles at once.

        The first argument is unused, the second is (y, angle). The columns dy/dy0 are set to the identity and dy/dlambda to
        zero, so that the columns of the result are the derivatives of the rates with respect to y and to lambda.
        """
        casadi = symbolic.library()
        function = self.function(which, switched)
        modes, drive, p = function.sx_in()[2:]
        time, y, angle = casadi.SX.sym("time"), casadi.SX.sym("y", self.size), casadi.SX.sym("angle")
        columns = casadi.horzcat(casadi.SX.eye(self.size), casadi.SX.zeros(self.size))
        results = function.call([angle, casadi.vertcat(y, casadi.vec(columns)), modes, drive, p])
        arguments = [time, casadi.vertcat(y, angle), modes, drive, p]
        return casadi.Function(_NAMES[which], arguments, [casadi.densify(r) for r in results], {"cse": True})

    def jacobian_trace(self, switched: bool = False) -> Any:
        """Return the trace of the Jacobian of dy/dangle as a ``casadi.Function`` of angle, y, modes, drive and constants."""
        casadi = symbolic.library()
        plain = self.function(PLAIN, switched)
        angle, z, modes, drive, p = plain.sx_in()
        y, own = z[: self.size], [modes, drive[: self.drive_size], p[: p.numel() // 2]]
        trace = casadi.trace(casadi.jacobian(plain(angle, z, modes, drive, p), y))
        return casadi.Function("trace", [angle, y, *own], [trace])

    def _state(self, angle: Any, y: Any, drive: Any) -> tuple[tuple[Any, ...], Any]:
        """Return the state of a run and the channels as symbolic expressions of the crank angle, y and the drive vector."""
        casadi, m = symbolic.library(), self.mechanism
        x = self._plain_state(angle, casadi.vertsplit(y), casadi.vertsplit(drive), casadi.SX(0.0))
        for number, ratio in self._ratios(drive).items():
            x[number] += ratio * angle
        u = casadi.vertcat(drive[: self.inputs])
        for n, channel in enumerate(m.torques):
            number = m.channels[channel].freedom
            if number in self.free or (number == self.crank and self.torque):
                motor = drive[self.motors + len(MOTOR) * n : self.motors + len(MOTOR) * (n + 1)]
                u[channel] += kloss(motor, x[len(m.freedoms) + number])
        return tuple(x), u


def label(variable: Variable) -> str:
    """Return the label of a variable in messages and tables: its symbol if short, else its name with spaces."""
    symbol = variable.symbol
    return symbol if symbol and not {*"\\{"} & {*symbol} else variable.name.replace(".", " ")


@cache
def flow(mechanism: Mechanism, modes: tuple[int, ...], crank: int, base: int = 1, commons: int = 1) -> Flow:
    """Return the `Flow` with these parameters (see the class); it is built at the first call and then cached."""
    return Flow(mechanism, modes, crank, base, commons)


class VerdictError(LinkworkError, TypeError):
    """A verdict was used as if it were a boolean."""


class Stability(Enum):
    """Stability by linear theory: a small deviation decays, grows, or the theory does not decide."""

    STABLE = "stable"
    UNSTABLE = "unstable"
    MARGINAL = "marginal"


class Crossing(Enum):
    """Kind of bifurcation, given by the place at which a multiplier crosses the unit circle."""

    FOLD = "fold"  # at +1: two motions of the same period meet
    BRANCH_POINT = "branch point"  # at +1: two branches of the same period cross
    PERIOD_DOUBLING = "period doubling"  # at -1
    TORUS = "torus"  # a complex pair

    @property
    def sign(self) -> int:
        """Real multiplier at the crossing, +1 or -1; 0 at a torus point."""
        return {Crossing.PERIOD_DOUBLING: -1, Crossing.TORUS: 0}.get(self, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityVerdict:
    """A verdict on the stability of a periodic motion; it has no truth value: compare ``stability``.

    Attributes
    ----------
    stability : Stability
    margin : float
        1 - ``max |multiplier|``: positive if deviations die out, negative if they grow; dimensionless.
    tolerance : float
        Size of the margin below which the verdict is MARGINAL. A system without damping is never better than MARGINAL.
    largest_multiplier : complex
        The multiplier of the greatest modulus.

    Raises
    ------
    VerdictError
        If the verdict is used as a truth value.
    """

    stability: Stability
    margin: float
    tolerance: float
    largest_multiplier: complex

    def __bool__(self) -> NoReturn:
        raise VerdictError(
            f"a verdict ({self}) has no truth value: compare .stability with STABLE, UNSTABLE or MARGINAL, or use .margin"
        )

    def __str__(self) -> str:
        return f"{self.stability.value}, margin {self.margin:.3g} with tolerance {self.tolerance:.1g}"

    @property
    def crossing(self) -> Crossing:
        """Kind of bifurcation at which the largest multiplier leaves the unit circle, or would leave it if its modulus grew."""
        return crossing(self.largest_multiplier)


def multipliers(monodromy: ArrayLike) -> NDArray[np.complex128]:
    """Return the Floquet multipliers, the largest modulus first.

    Parameters
    ----------
    monodromy : array_like, shape (..., n, n)
        One matrix or many.

    Returns
    -------
    ndarray of complex, shape (..., n)

    Raises
    ------
    InputError
        If an entry is not finite.
    """
    matrix = np.asarray(monodromy, dtype=float)
    if not np.isfinite(matrix).all():
        raise InputError("a monodromy matrix is not finite")
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    order = np.argsort(-np.abs(values), axis=-1, kind="stable")
    return np.take_along_axis(values, order, axis=-1)


def verdict(multipliers: ArrayLike, tolerance: float = TOLERANCE) -> StabilityVerdict:
    """Judge the stability of a periodic motion by its multipliers.

    Parameters
    ----------
    multipliers : array_like of complex, shape (n,)
    tolerance : float
        Size of the margin up to which the verdict is "marginal"; it should not be less than the error of the multipliers.

    Raises
    ------
    InputError
        If there are no multipliers, one is not finite, or the tolerance is negative or not finite.
    """
    values = np.atleast_1d(np.asarray(multipliers, dtype=complex))
    if values.ndim != 1 or len(values) == 0 or not np.isfinite(values).all():
        raise InputError(f"multipliers {values}: they must be finite numbers, at least one")
    if not (isfinite(tolerance) and tolerance >= 0.0):
        raise InputError(f"tolerance is {tolerance}: it must be a finite number, zero or greater")
    largest = complex(values[np.argmax(np.abs(values))])
    margin = 1.0 - abs(largest)
    stability = Stability.MARGINAL
    if abs(margin) > tolerance:
        stability = Stability.STABLE if margin > 0.0 else Stability.UNSTABLE
    return StabilityVerdict(stability=stability, margin=margin, tolerance=tolerance, largest_multiplier=largest)


def crossing(multiplier: complex) -> Crossing:
    """Return the kind of bifurcation at which a multiplier crosses the unit circle."""
    if abs(np.angle(multiplier)) <= REAL_ANGLE:
        return Crossing.FOLD
    if abs(np.angle(-multiplier)) <= REAL_ANGLE:
        return Crossing.PERIOD_DOUBLING
    return Crossing.TORUS


def liouville(trace: ArrayLike, period: float = 2.0 * pi) -> float:
    """Return the determinant of the monodromy matrix by Liouville's formula: exp of the integral of the trace over the period.

    Parameters
    ----------
    trace : array_like, shape (n,)
        Trace of the Jacobian matrix at equal steps over one period, the end left out. It is integrated by the trapezoidal
        rule, whose error comes only from harmonics of order n and more.
    period : float
        Period in the unit of the independent variable, rad or s.

    Raises
    ------
    InputError
        If a value is not finite, or there is none.
    """
    values = np.asarray(trace, dtype=float)
    if values.ndim != 1 or len(values) == 0 or not np.isfinite(values).all():
        raise InputError("the traces over a period must be finite numbers, at least one")
    return exp(period * float(values.mean()))


def crossing_test(monodromy: NDArray[np.float64], crossing: Crossing | int) -> NDArray[np.float64]:
    """Return a smooth function of monodromy matrices that is zero where a multiplier crosses the unit circle.

    Parameters
    ----------
    monodromy : ndarray, shape (..., n, n)
    crossing : Crossing or int
        The crossing; the number +1 stands for a fold or branch point, -1 for a period doubling. For these the function is
        det(I - Phi) or det(I + Phi), with the monodromy matrix Phi: positive if all multipliers are inside the unit circle,
        negative if one real multiplier has crossed it at +1 or -1. For a torus the function is the product of
        (mu_i mu_j - 1) over all pairs of multipliers mu_i, mu_j; it is 1 if there is a single multiplier.

    Returns
    -------
    ndarray, shape (...,)
    """
    if crossing is Crossing.TORUS:
        mu = multipliers(monodromy)
        i, j = np.tril_indices(mu.shape[-1], -1)
        return np.asarray(np.prod(mu[..., i] * mu[..., j] - 1.0, axis=-1).real)
    multiplier = crossing.sign if isinstance(crossing, Crossing) else crossing
    require_sign(multiplier)
    if monodromy.shape[-1] != 2:
        return np.asarray(np.linalg.det(np.eye(monodromy.shape[-1]) - multiplier * monodromy))
    trace = monodromy[..., 0, 0] + monodromy[..., 1, 1]
    det = monodromy[..., 0, 0] * monodromy[..., 1, 1] - monodromy[..., 0, 1] * monodromy[..., 1, 0]
    return np.asarray(1.0 - multiplier * trace + det)


def index(monodromy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the index of motions, the sign of det(I - Phi), from their monodromy matrices Phi, shape (..., n, n)."""
    return np.sign(crossing_test(monodromy, 1))


def torus_pair(multipliers: NDArray[np.complex128]) -> tuple[complex, float]:
    """Return one multiplier of the pair mu_i, mu_j whose product is nearest to 1, and the distance ``|mu_i mu_j - 1|``."""
    away = {(i, j): abs(multipliers[i] * multipliers[j] - 1.0) for i in range(len(multipliers)) for j in range(i)}
    nearest = min(away, key=away.__getitem__)
    return complex(multipliers[nearest[0]]), float(away[nearest])


def require_sign(multiplier: int) -> None:
    """Raise `InputError` if a multiplier is neither +1 nor -1."""
    if multiplier not in (1, -1):
        raise InputError(f"multiplier is {multiplier}: it must be +1 or -1")
