"""A mechanism as a flow over the angle of its cyclic freedom, the crank, from the traced equations."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism
from linkwork.variables import Variable

from ...numerics import symbolic
from ...numerics.codegen import MAKING, MachineCode
from ...run import MOTOR, constants, kloss, traced

# Functions of a flow, by their numbers among its addresses
PLAIN, VARIATIONAL, DIRECTIONAL, GAP, STATE = range(5)
_NAMES = ("plain", "variational", "directional", "gap", "state")


class Crank(NamedTuple):
    """The cyclic freedom of a mechanism: its number, and those of the channels of its rate and of the torque on it, or None."""

    freedom: int
    command: int | None
    torque: int | None


@cache
def crank_of(mechanism: Mechanism) -> Crank:
    """The cyclic freedom of a mechanism.

    Raises
    ------
    InputError
        If it has none.
    """
    number = next((n for n, freedom in enumerate(mechanism.freedoms) if freedom.period > 0.0), None)
    if number is None:
        raise InputError(f"a {mechanism.name} has no freedom that turns: it has no periodic motions over an angle")

    def channel(kind: str) -> int | None:
        found = (n for n, c in enumerate(mechanism.channels) if c.kind == kind and c.freedom == number)
        return next(found, None)

    return Crank(number, channel("command"), channel("force"))


class Flow:
    """A mechanism as a flow over its crank's angle, driven in one way.

    Parameters
    ----------
    mechanism : Mechanism
    modes : tuple of int
        Values of its modes.

    Attributes
    ----------
    crank : int
        Number of the cyclic freedom.
    free : tuple of int
        Numbers of the other freedoms that are part of y; what is commanded is held where it is.
    torque : bool
        Whether the crank's rate is part of y.
    components : tuple of (str, str)
        FMI names and units of y.
    labels : tuple of str
        What messages call them: by symbols where there are short ones.
    places : tuple of int
        Components of the state of a run that make up y.
    size : int
        Number of components of y.
    """

    def __init__(self, mechanism: Mechanism, modes: tuple[int, ...]) -> None:
        self.mechanism = mechanism
        self.modes = modes
        self.crank = crank_of(mechanism).freedom
        by_name = {mode.name: value for mode, value in zip(mechanism.modes, modes)}
        commanded = {mechanism.channels[n].freedom: n for n in mechanism.commands(by_name)}
        forced = {c.argument for c in mechanism.channels if c.kind == "force"}
        self.command = commanded.get(self.crank)
        self.free = tuple(
            n
            for n, freedom in enumerate(mechanism.freedoms)
            if n != self.crank
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
        self.size = len(names)
        #: numbers of the channels of the drive, and of motor and held coordinates after them
        self.inputs = len(mechanism.channels)
        self.drive_size = self.inputs + len(MOTOR) + len(mechanism.freedoms)
        self._code: dict[tuple[bool, int], MachineCode] = {}
        self._addresses: NDArray[np.int64] = np.zeros((2, len(_NAMES)), dtype=np.int64)

    @property
    def period(self) -> float:
        """Angle of one turn (rad)."""
        return self.mechanism.freedoms[self.crank].period

    def addresses(self, *which: int, switched: bool = False) -> NDArray[np.int64]:
        """Addresses of the machine code, of the functions of those numbers at least, with the mechanism's switch on or off."""
        with MAKING:
            for n in which:
                if (switched, n) not in self._code:
                    code = MachineCode([self.function(n, switched)])
                    self._addresses[int(switched), n] = code.addresses[_NAMES[n]]
                    self._code[switched, n] = code
        addresses: NDArray[np.int64] = self._addresses[int(switched)]
        return addresses

    def fingerprint(self, *which: int, switched: bool = False) -> str:
        """Of the machine code of the functions of those numbers."""
        self.addresses(*which, switched=switched)
        return " ".join(self._code[switched, n].fingerprint for n in which)

    def state(self, y: NDArray[np.float64], drive: NDArray[np.float64]) -> tuple[float, ...]:
        """State of a run at the crank angle 0, from y and the numbers of the drive."""
        rates = len(self.mechanism.freedoms)
        x = [*drive[self.inputs + len(MOTOR) : self.drive_size].tolist(), *[0.0] * (rates + 2)]
        x[self.crank] = 0.0
        if self.command is not None:
            x[rates + self.crank] = float(drive[self.command])
        for place, value in zip(self.places, y.tolist()):
            x[place] = value
        return tuple(x)

    @cache  # noqa: B019 - flows are kept for good themselves
    def function(self, which: int, switched: bool = False) -> Any:
        """A function as a ``casadi.Function`` of angle, z, modes, drive with its direction, constants with theirs.

        ``plain``: dy/dangle. ``variational``: with the columns of dy/dy0. ``directional``: with that of dy/dlambda after
        them. ``gap``: how far the links are from the limit of assembly. ``state``: the state of a run and the channels.
        """
        casadi = symbolic.library()
        n, m = self.size, self.mechanism
        angle, modes = casadi.SX.sym("angle"), casadi.SX.sym("modes", len(m.modes))
        y, columns = casadi.SX.sym("y", n), casadi.SX.sym("columns", n, n + 1)
        drive, d_drive = (casadi.SX.sym(name, self.drive_size) for name in ("drive", "d_drive"))
        p, k = constants(m, switched)
        d_p = casadi.SX.sym("d_p", p.numel())
        arguments = [
            angle,
            casadi.vertcat(y, casadi.vec(columns)),
            modes,
            casadi.vertcat(drive, d_drive),
            casadi.vertcat(p, d_p),
        ]
        x, u = self._state(angle, y, drive)
        functions = traced(m)
        applied = functions.of(m.equations.applied)(
            tuple(casadi.vertsplit(modes)) if m.modes else (), tuple(casadi.vertsplit(u)) if self.inputs else (), k
        )
        if which == GAP:
            settled = functions.of(m.equations.start)(x, applied, k)
            results = [casadi.SX(functions.of(m.equations.clearance)(settled, applied, k))]
        elif which == STATE:
            settled = functions.of(m.equations.start)(x, applied, k)
            results = [casadi.vertcat(*settled), u]
        else:
            rates = functions.of(m.equations.derivative)(x, applied, k)
            f = casadi.vertcat(*[rates[place] for place in self.places]) / x[len(m.freedoms) + self.crank]
            results = [f]
            if which != PLAIN:
                jacobian = casadi.jacobian(f, y)
                results.append(jacobian @ columns[:, :n])
            if which == DIRECTIONAL:
                along = casadi.jtimes(f, drive, d_drive) + casadi.jtimes(f, p, d_p)
                results.append(jacobian @ columns[:, n] + along)
        return casadi.Function(_NAMES[which], arguments, [casadi.densify(r) for r in results], {"cse": True})

    def jacobian_trace(self, switched: bool = False) -> Any:
        """Trace of the rates' Jacobian as a ``casadi.Function`` of angle, y, modes, drive and constants."""
        casadi = symbolic.library()
        plain = self.function(PLAIN, switched)
        shapes = [plain.size1_in(i) for i in range(plain.n_in())]
        angle, y, modes, drive, p = (
            casadi.SX.sym(name, size)
            for name, size in zip(
                ("angle", "y", "modes", "drive", "p"), (1, self.size, shapes[2], self.drive_size, shapes[4] // 2)
            )
        )
        f = plain(
            angle,
            casadi.vertcat(y, casadi.DM.zeros(shapes[1] - self.size)),
            modes,
            casadi.vertcat(drive, casadi.DM.zeros(self.drive_size)),
            casadi.vertcat(p, casadi.DM.zeros(shapes[4] // 2)),
        )
        return casadi.Function("trace", [angle, y, modes, drive, p], [casadi.trace(casadi.jacobian(f, y))])

    def _state(self, angle: Any, y: Any, drive: Any) -> tuple[tuple[Any, ...], Any]:
        """State of a run and channels, as expressions."""
        casadi = symbolic.library()
        m, freedoms = self.mechanism, len(self.mechanism.freedoms)
        held = drive[self.inputs + len(MOTOR) :]
        x = [*casadi.vertsplit(held), *[casadi.SX(0.0)] * freedoms, casadi.SX(0.0), casadi.SX(0.0)]
        x[self.crank] = angle
        for component, place in enumerate(self.places):
            x[place] = y[component]
        u = drive[: self.inputs]
        if self.command is not None:
            x[freedoms + self.crank] = u[self.command]
        else:
            channel = crank_of(m).torque
            u = casadi.vertcat(u)
            u[channel] += kloss(drive[self.inputs : self.inputs + len(MOTOR)], x[freedoms + self.crank])
        return tuple(x), u


def label(variable: Variable) -> str:
    """What messages and tables call a variable: its symbol if that is a short one, else its name with spaces."""
    symbol = variable.symbol
    return symbol if symbol and "\\" not in symbol else variable.name.replace(".", " ")


@cache
def flow(mechanism: Mechanism, modes: tuple[int, ...]) -> Flow:
    """The flow of a mechanism driven in one way, made when it is first asked for."""
    return Flow(mechanism, modes)
