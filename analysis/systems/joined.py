"""Integrate a system as one model, with the equations of all mechanisms joined: the reference for coupling errors.

At every instant a commanded speed equals the speed to which it is connected, and its rate equals the derivative of this
speed. Controllers sample at their sample times, and their outputs act at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields as dataclass_fields
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from linkwork.errors import IntegrationError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..export.controllers import CONTROLLERS, Controller
from ..numerics import symbolic
from ..run import expressions
from .description import Member, System
from .master import SystemRun
from .wiring import End, WiringError


class _Model:
    """Traced equations, constants and initial state of one mechanism of a system."""

    def __init__(self, member: Member, mechanism: Mechanism) -> None:
        self.mechanism, values = mechanism, member.values
        names = {v.name for v in mechanism.variables}
        fields = {field_name(name): v for name, v in values.items() if name in names}
        kept = {entry.name for entry in dataclass_fields(mechanism.parameters)}
        whole = mechanism.first_set.parameters
        numbers = {k: type(getattr(whole, k))(v) for k, v in fields.items() if k in kept}
        self.parameters = mechanism.parameters(**numbers)
        start = {n.removeprefix("initial."): v for n, v in values.items() if n.startswith("initial.")}
        self.initial = mechanism.initial(**start)
        self.modes = [float(values[mode.name]) for mode in mechanism.modes]
        self.p = self.parameters.constants()
        self.traced = expressions(mechanism, mechanism.is_switched_on(self.p))
        self.start = np.array(mechanism.state(self.initial))
        self.energy = mechanism.equations.energy(self.start.tolist(), self.p)
        self.rate_of = {v.rate_of: v.name for v in mechanism.variables if v.rate_of}
        self.constants = [float(values.get(channel.name, 0.0)) for channel in mechanism.channels]

    def commanding_inputs(self) -> dict[int, int]:
        """Return the freedoms whose rates are commanded, each with the index of the commanding channel."""
        chosen = {mode.name: int(value) for mode, value in zip(self.mechanism.modes, self.modes)}
        return {self.mechanism.channels[number].freedom: number for number in self.mechanism.commands(chosen)}


class JoinedSystem:
    """A system as one set of equations.

    Parameters
    ----------
    system : System
        A system whose parts are all mechanisms or controllers.

    Raises
    ------
    WiringError
        If a part is an FMU, whose equations are not known, or the values in an algebraic loop depend on each other
        nonlinearly.
    """

    def __init__(self, system: System) -> None:
        casadi = symbolic.library()
        self.system = system
        self.models: dict[str, _Model] = {}
        self.controllers: dict[str, Controller] = {}
        for name, member in system.members.items():
            if member.mechanism is not None:
                self.models[name] = _Model(member, member.mechanism)
            elif member.controller:
                self.controllers[name] = CONTROLLERS[member.controller](instance_name=name)
                for key, value in member.values.items():
                    setattr(self.controllers[name], key, value)
            else:
                raise WiringError(f"{name} is an FMU, whose equations are not known: it cannot be joined to one model")
        self.given = [s for s in dict.fromkeys(system.connections.values()) if s.part in self.controllers]
        held = casadi.SX.sym("held", len(self.given))
        wires: dict[End, Any] = {end: held[n] for n, end in enumerate(self.given)}

        def wire(source: End | None, otherwise: float = 0.0) -> Any:
            return casadi.SX(otherwise) if source is None else wires.setdefault(source, casadi.SX.sym(str(source)))

        states: list[Any] = []
        slopes: list[Any] = []
        outputs: dict[End, Any] = {}
        for name, model in self.models.items():
            m, s = model.mechanism, model.traced.symbols
            x, n = casadi.SX.sym(name, m.size), len(m.freedoms)
            sources = [system.connections.get(End(name, channel.name)) for channel in m.channels]
            u = [wire(source, value) for source, value in zip(sources, model.constants)]
            inside = casadi.vertsplit(x)
            for freedom, command in model.commanding_inputs().items():
                inside[n + freedom], source = u[command], sources[command]
                rate = m.channel_index(freedom, "rate")
                if rate is not None and source is not None and source.part in self.models:
                    u[rate] = wire(End(source.part, self.models[source.part].rate_of[source.port]))
            own = casadi.vertcat(*inside)
            put = [casadi.vertcat(*u) if u else casadi.SX(0, 1), casadi.DM(model.modes), own]
            numbers = [casadi.DM([*model.p, model.energy])]

            def insert(what: Any, s: Any = s, put: Any = put, numbers: Any = numbers) -> Any:
                return casadi.substitute([what], [s.u, s.modes, s.x, s.p], [*put, *numbers])[0]

            slope = casadi.vertsplit(insert(model.traced.derivative))
            for freedom in model.commanding_inputs():
                slope[n + freedom] = casadi.SX(0)
            states.append(x)
            slopes += slope
            outputs |= {
                End(name, out): v for out, v in zip(m.output_names, casadi.vertsplit(insert(model.traced.outputs)))
            }
        open_ends = [end for end in wires if end.part in self.models]
        found = self._solve_connections(casadi, [wires[end] for end in open_ends], [outputs[end] for end in open_ends])
        self.names = list(outputs)

        def solve_for_states(what: list[Any]) -> Any:
            return casadi.substitute(casadi.vertcat(*what), casadi.vertcat(*(wires[end] for end in open_ends)), found)

        symbols = [casadi.vertcat(*states), held]
        self._slope = casadi.Function("slope", symbols, [solve_for_states(slopes)], {"cse": True})
        self._outputs = casadi.Function("outputs", symbols, [solve_for_states(list(outputs.values()))], {"cse": True})
        self.start = np.concatenate([model.start for model in self.models.values()])

    def _solve_connections(self, casadi: Any, symbols: list[Any], values: list[Any]) -> Any:
        """Solve the connections: return the connected outputs as expressions of the states and the controllers' outputs.

        ``symbols`` stand for the connected outputs of mechanisms; ``values`` are the expressions of these outputs, which may
        contain ``symbols``.
        """
        found = list(values)
        if not symbols:
            return casadi.SX(0, 1)
        _, order, bounds = casadi.jacobian_sparsity(casadi.vertcat(*values), casadi.vertcat(*symbols)).scc()
        solved: list[int] = []
        # the blocks of outputs that depend on one another; those on which a block depends come after it
        for block in [order[a:b] for a, b in pairwise(bounds)][::-1]:
            known, loop = (casadi.vertcat(*(symbols[n] for n in each)) for each in (solved, block))
            value = casadi.vertcat(*(found[n] for n in block))
            if solved:
                value = casadi.substitute(value, known, casadi.vertcat(*(found[n] for n in solved)))
            if casadi.depends_on(value, loop):
                matrix = casadi.jacobian(value - loop, loop)
                if casadi.depends_on(matrix, loop):
                    raise WiringError("an algebraic loop of the system is not linear: it cannot be joined to one model")
                value = -casadi.solve(matrix, casadi.substitute(value - loop, loop, casadi.SX.zeros(len(block))))
            for n, one in zip(block, casadi.vertsplit(value)):
                found[n] = one
            solved += block
        return casadi.vertcat(*found)

    def run(self, stop_time: float, step: float, *, tolerance: float = 1e-12) -> SystemRun:
        """Integrate the system with SciPy's DOP853, and return all outputs at multiples of ``step`` (s).

        Raises
        ------
        IntegrationError
            If the integration does not reach the end.
        """
        times = step * np.arange(round(stop_time / step) + 1)
        marks = self._sample_times(stop_time)
        x, rows, kept = self.start, [], []
        for begin, end in pairwise(marks):
            held = self._sample(float(begin), x)
            inside = times[(times >= begin - 1e-9 * step) & (times < end - 1e-9 * step)]
            found = solve_ivp(
                lambda t, x, held=held: self._slope(x, held).full().ravel(), (begin, end), x, "DOP853",
                t_eval=np.clip([*inside, end], begin, end), rtol=tolerance, atol=1e-3 * tolerance,
            )  # fmt: skip
            if not found.success:
                raise IntegrationError(
                    f"the joined system was not integrated past t = {found.t[-1]:.9g} s: {found.message}"
                )
            kept += list(inside)
            rows += [self._outputs(state, held).full().ravel() for state in found.y.T[:-1]]
            x = found.y[:, -1]
        rows.append(self._outputs(x, self._sample(float(marks[-1]), x)).full().ravel())
        values = np.array(rows)
        return SystemRun(
            time=np.array([*kept, stop_time]),
            values={str(name): values[:, k] for k, name in enumerate(self.names)},
            coupling="joined",
        )

    def _sample_times(self, stop_time: float) -> NDArray[np.float64]:
        """Return the instants (s) at which controllers sample, from 0, and the stop time.

        Instants that differ only by rounding errors are given once.
        """
        periods = [controller.sample_time for controller in self.controllers.values()]
        times = [period * np.arange(ceil(stop_time / period)) for period in periods]
        marks = np.unique(np.concatenate([[0.0], *times]))
        shortest = min(periods, default=stop_time)
        apart = np.diff(marks, append=stop_time) > 1e-6 * shortest
        return np.append(marks[apart], stop_time)

    def _sample(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sample the controllers that are due at t, using the controller outputs before t; return all controllers' outputs."""
        due = {name: c for name, c in self.controllers.items() if c.count * c.sample_time <= t + 1e-6 * c.sample_time}
        # at the start the values that controllers exchange settle after as many rounds as there are controllers
        for _ in due if t == 0.0 else ():
            self._set_inputs(due, x)
            for controller in due.values():
                controller.preview()
        self._set_inputs(due, x)
        for controller in due.values():
            controller.sample(t)
            controller.count += 1
        return self._held_outputs()

    def _held_outputs(self) -> NDArray[np.float64]:
        return np.array([getattr(self.controllers[end.part], end.port) for end in self.given])

    def _set_inputs(self, controllers: Mapping[str, Controller], x: NDArray[np.float64]) -> None:
        """Set the inputs of controllers to the values of the connected outputs."""
        held = self._held_outputs()
        told = dict(zip(self.names, self._outputs(x, held).full().ravel())) | dict(zip(self.given, held))
        for target, source in self.system.connections.items():
            if target.part in controllers:
                setattr(controllers[target.part], target.port, told[source])
