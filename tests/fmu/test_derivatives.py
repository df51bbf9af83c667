"""Derivatives that the native FMUs give, against CasADi's Jacobians and against differences."""

from collections.abc import Iterator, Mapping, Sequence
from ctypes import c_double, c_int32, c_size_t, c_uint32
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.export import equations_c
from analysis.export.interface import MARGIN, interface, states
from analysis.run import expressions
from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism
from linkwork.parameters import fmi_name
from tests.oracles.differences import derivative

from .drawn import MECHANISMS, Drawn, drawn
from .native import OK, Instance, Library

Matrix = NDArray[np.float64]
SEEDS = 40
KINDS = ("native", "native-fmi3")


@pytest.fixture(scope="module")
def libraries(natives: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Library]:
    return {name: Library(path, tmp_path_factory.mktemp("library")) for name, path in natives.items()}


@pytest.fixture(params=[f"{fmu}-{kind}" for fmu in MECHANISMS for kind in KINDS])
def library(request: pytest.FixtureRequest, libraries: dict[str, Library]) -> Library:
    return libraries[request.param]


def cases(library: Library) -> Iterator[Drawn]:
    fmu = library.path.name.partition("_")[0]
    return (drawn(fmu, seed) for seed in range(SEEDS))


def begun(library: Library, case: Drawn, interface_type: str = "cs") -> Instance:
    """An instance in initialisation mode."""
    instance = library.instance(interface_type)
    assert put(instance, case.values) == OK
    assert instance.enter() == OK
    return instance


def call(instance: Instance, adjoint: bool, unknowns: Sequence[str], knowns: Sequence[str], seed: Any) -> Matrix:
    """Directional or adjoint derivative."""
    refs = [(c_uint32 * len(names))(*(instance.library.references[n] for n in names)) for names in (unknowns, knowns)]
    seeds = (c_double * len(seed))(*seed)
    result = (c_double * len(knowns if adjoint else unknowns))()
    counted = instance.library.fmi == 3
    arguments: list[Any] = []
    for array in (*refs, seeds, result):
        arguments += [array, c_size_t(len(array))] if counted or array in refs else [array]
    name = "GetAdjointDerivative" if adjoint else "GetDirectionalDerivative"
    assert instance(name, *arguments) == OK, instance.log
    return np.array(result)


def jacobian(instance: Instance, unknowns: Sequence[str], knowns: Sequence[str]) -> Matrix:
    """The whole Jacobian, column by column."""
    return np.array([call(instance, False, unknowns, [name], [1.0]) for name in knowns]).T


def close(found: Matrix, right: Matrix, scale: Matrix, tolerance: float = 1e-12) -> None:
    """Whether arrays agree relative to a scale, which is that of what cancels in them."""
    error = np.abs(found - right)
    np.testing.assert_array_less(error, tolerance * scale + 1e-300)


def size_of(matrix: Matrix, names: Sequence[str]) -> Matrix:
    """What the entries of a Jacobian are measured by: the largest of their row and of their column, geometrically.

    A residual is the small difference of what it is the residual of: its row is measured by the others.
    """
    absolute = np.abs(matrix)
    row = np.where(["residual" in name for name in names], absolute.max(), absolute.max(axis=1))
    return np.sqrt(row[:, None] * absolute.max(axis=0)[None, :])


class Oracle:
    """Jacobians of a mechanism's equations by CasADi: as matrices of expressions, not as the products that the FMUs have."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        trace = expressions(mechanism, bool(mechanism.switch))
        s = trace.symbols
        own, state, p, x, *_ = equations_c.trace_start(mechanism, s.modes, s.u)
        rows = casadi.vertcat(trace.outputs, s.x, trace.derivative, trace.clearance)
        at = casadi.vertcat(s.x, s.u, s.p)
        run = [s.x, s.modes, s.u, s.p]
        given = casadi.vertcat(own, state, s.u)
        jacobian = casadi.jacobian(casadi.vertcat(x, p), given)
        self.begin = casadi.Function("b", [s.modes, own, state, s.u], [x, p, jacobian])
        self.rows = casadi.Function("r", run, [rows, casadi.jacobian(rows, at)])
        self.jump = casadi.Function("j", run, [trace.jump, casadi.jacobian(trace.jump, at)])
        entries = interface(mechanism)
        place = {}
        references = states(mechanism)
        n, size = len(mechanism.output_names), mechanism.size
        for entry in entries:
            name = entry.variable.name
            if entry.role == "output":
                place[name] = mechanism.output_names.index(name)
            elif entry.role == "state":
                place[name] = n + references.index(entry.reference)
            elif entry.role == "derivative":
                place[name] = n + size + references.index(entry.derivative_of)  # type: ignore[arg-type]
            elif entry.role == "indicator":
                place[name] = n + 2 * size
        self.unknowns = list(place)
        self.places = list(place.values())
        self.states = [next(e.variable.name for e in entries if e.reference == r) for r in references]

    def start(self, case: Drawn) -> tuple[list[str], Matrix, Matrix, Matrix]:
        """Names of what is given, the Jacobian at the start with respect to it, the state and the constants."""
        m = self.mechanism
        n = len(m.freedoms)
        values = case.values
        own = [fmi_name(name) for name in (f.name for f in fields(m.parameters))]
        initial = [f"initial.{f.initial[k]}" for k in (0, 1) for f in m.freedoms]
        rates = {f"initial.{f.initial[1]}": f.rate for f in m.freedoms}
        commanded = {rate: name for name, rate in case.commanded.items()}
        state = [values[commanded.get(rates.get(name, ""), name)] for name in initial]
        u = [values[name] for name in m.input_names]
        modes = list(case.modes.values())
        x, p, first = (np.array(a) for a in self.begin(modes, [values[name] for name in own], state, u))
        rows, second = (np.array(a) for a in self.rows(x, modes, u, p))
        second = np.where((rows == 0.0) & np.isnan(second), 0.0, second)
        size, inputs = m.size, len(u)
        total = np.hstack([second[:, :size], second[:, size + inputs :]]) @ first
        total[:, len(own) + len(initial) :] += second[:, size : size + inputs]
        names = [*own, *initial, *m.input_names]
        for rate, name in commanded.items():
            at = len(own) + n + [f.rate for f in m.freedoms].index(rate)
            total[:, names.index(name)] += total[:, at]
            total[:, at] = 0.0
        return names, total[self.places], x, p

    def run(
        self, case: Drawn, x: Matrix, u: Sequence[float], p: Matrix, applied: Sequence[str]
    ) -> tuple[Matrix, Matrix]:
        """Rows, and their Jacobian with respect to state and inputs, where commands are applied to the state."""
        m = self.mechanism
        size, modes = m.size, list(case.modes.values())
        before = np.eye(size, size + len(u))
        if applied:
            given, command = np.array(u, float), np.eye(len(u), size + len(u), size)
            for name, rate in case.commanded.items():
                if name not in applied:
                    at, of = m.input_names.index(name), self.states.index(rate)
                    given[at], command[at] = x[of], np.eye(1, size + len(u), of)[0]
            x, change = (np.array(a) for a in self.jump(x, modes, given, p))
            before = change[:, :size] @ before + change[:, size : size + len(u)] @ command
        rows, second = (np.array(a) for a in self.rows(x, modes, u, p))
        # 0/0 where a length is zero to the last bit: there it does not change
        second = np.where((rows == 0.0) & np.isnan(second), 0.0, second)
        total = second[:, :size] @ before
        total[:, size:] += second[:, size : size + len(u)]
        return rows[self.places, 0], total[self.places]


@cache
def oracle(fmu: str) -> Oracle:
    return Oracle(MECHANISMS[fmu])


def sums_close(instance: Instance, unknowns: Sequence[str], knowns: Sequence[str], right: Matrix, size: Matrix) -> None:
    """Changes of several knowns at once; where FMI has them gradients, of single unknowns and of a weighted sum."""
    change = np.linspace(-1.0, 2.0, len(knowns))
    close(call(instance, False, unknowns, knowns, change), right @ change, size @ np.abs(change))
    if instance.library.fmi == 2:
        return
    for n, name in enumerate(unknowns):
        close(call(instance, True, [name], knowns, [1.0]), right[n], size[n])
    weights = np.linspace(-1.0, 2.0, len(unknowns)) / np.maximum(np.abs(right).max(axis=1), 1e-3)
    close(call(instance, True, unknowns, knowns, weights), weights @ right, np.abs(weights) @ size)


def by_differences(instance: Instance, unknowns: Sequence[str], knowns: Sequence[str]) -> Matrix:
    """The Jacobian by differences of what is read after one value was set."""
    columns = []
    for name in knowns:
        (base,) = instance.get(name)

        def at(change: float, name: str = name, base: float = base) -> list[float]:
            assert put(instance, {name: base + change}) == OK
            return instance.get(*unknowns)

        columns.append(derivative(at, 1e-4 * (abs(base) or 0.1)))
        assert put(instance, {name: base}) == OK
    return np.array(columns).T


def put(instance: Instance, values: Mapping[str, float]) -> int:
    return instance.set(**{name.replace(".", "__"): value for name, value in values.items()})


@pytest.mark.parametrize("kind", ["cs", "me"])
def test_at_the_start(library: Library, kind: str) -> None:
    for number, case in enumerate(cases(library)):
        of = oracle(case.mechanism.fmu)
        names, all_columns, *_ = of.start(case)
        knowns = [name for name in names if name != "assembly.branch"]
        right = all_columns[:, [names.index(name) for name in knowns]]
        instance = begun(library, case, kind)
        found = jacobian(instance, of.unknowns, knowns)
        size = size_of(right, of.unknowns)
        close(found, right, size)
        sums_close(instance, of.unknowns, knowns, right, size)
        assert not call(instance, False, of.unknowns, ["solver.tolerance"], [1.0]).any()
        assert not call(instance, False, ["time"], knowns, [1.0] * len(knowns)).any()
        if number < 3:
            close(by_differences(instance, of.unknowns, knowns), right, size, 1e-6)


@pytest.mark.parametrize("fresh", [False, True], ids=["as stepped", "set anew"])
def test_after_steps(library: Library, fresh: bool) -> None:
    for number, case in enumerate(cases(library)):
        of = oracle(case.mechanism.fmu)
        *_, p = of.start(case)
        instance = begun(library, case)
        assert instance("ExitInitializationMode") == OK
        for n in range(3):
            assert instance.step(n * 1e-4, 1e-4) == OK
        x = np.array(instance.get(*of.states))
        inputs = {name: value * 1.1 + 0.1 for name, value in case.inputs.items()} if fresh else case.inputs
        commands = list(case.commanded)
        assert put(instance, inputs if fresh else {}) == OK
        knowns, u = list(inputs), list(inputs.values())
        columns = []
        for n, name in enumerate(knowns):
            # a command that is a known is one that would be set: it is applied
            applied = commands if fresh else [name] if name in commands else []
            rows, whole = of.run(case, x, u, p, applied)
            columns.append(whole[:, of.mechanism.size + n])
        right = np.array(columns).T
        size = size_of(right, of.unknowns)
        close(jacobian(instance, of.unknowns, knowns), right, size)
        # masters that solve loops of outputs give all dependencies of an output, its states among them
        _, whole = of.run(case, x, u, p, commands if fresh else [])
        size_of_states = size_of(whole, of.unknowns)[:, : of.mechanism.size]
        close(jacobian(instance, of.unknowns, of.states), whole[:, : of.mechanism.size], size_of_states)
        if fresh:
            close(np.array(instance.get(*of.unknowns)), rows - limit(of), np.abs(rows) + 1.0)
            sums_close(instance, of.unknowns, knowns, right, size)
            if number < 3:
                close(by_differences(instance, of.unknowns, knowns), right, size, 1e-6)
        else:
            for n, name in enumerate(knowns):
                sums_close(instance, of.unknowns, [name], right[:, [n]], size[:, [n]])
            for n, name in enumerate(knowns):
                if name in commands:
                    # one of them set, the other freedom goes on as it does
                    saved, jumped = instance.saved(), [*u[:n], u[n] * 1.1 + 0.1, *u[n + 1 :]]
                    assert put(instance, {name: jumped[n]}) == OK
                    rows, _ = of.run(case, x, jumped, p, [name])
                    close(np.array(instance.get(*of.unknowns)), rows - limit(of), np.abs(rows) + 1.0)
                    assert instance.with_state("Set", saved) == OK


def limit(of: Oracle) -> Matrix:
    """What the rows have less than CasADi's: the indicator is the clearance above the limit."""
    return np.where([name == MARGIN for name in of.unknowns], LIMIT_SINE, 0.0)


@pytest.mark.parametrize("mode", ["event", "continuous"])
def test_in_model_exchange(library: Library, mode: str) -> None:
    for number, case in enumerate(cases(library)):
        of = oracle(case.mechanism.fmu)
        *_, p = of.start(case)
        instance = begun(library, case, "me")
        assert instance("ExitInitializationMode") == OK
        assert instance("EnterContinuousTimeMode") == OK
        x = np.array(instance.states(count=of.mechanism.size)) * 1.001 + 1e-4
        assert instance("SetContinuousStates", (c_double * len(x))(*x), c_size_t(len(x))) == OK
        inputs = {name: value * 1.1 + 0.1 for name, value in case.inputs.items()}
        assert put(instance, inputs) == OK
        if mode == "event":
            assert instance("EnterEventMode") == OK
        # commands that have moved since the last event are followed
        rows, right = of.run(case, x, list(inputs.values()), p, list(case.commanded))
        knowns = [*of.states, *inputs]
        size = size_of(right, of.unknowns)
        close(np.array(instance.get(*of.unknowns)), rows - limit(of), np.abs(rows) + 1.0)
        close(jacobian(instance, of.unknowns, knowns), right, size)
        sums_close(instance, of.unknowns, knowns, right, size)
        if number < 3:
            close(by_differences(instance, of.unknowns, list(inputs)), right[:, len(x) :], size[:, len(x) :], 1e-6)


def output_slopes(instance: Instance, names: Sequence[str]) -> Matrix:
    n = len(names)
    refs = (c_uint32 * n)(*(instance.library.references[name] for name in names))
    values, orders = (c_double * n)(), (c_int32 * n)(*[1] * n)
    if instance.library.fmi == 2:
        status = instance("GetRealOutputDerivatives", refs, c_size_t(n), orders, values)
    else:
        status = instance("GetOutputDerivatives", refs, c_size_t(n), orders, values, c_size_t(n))
    assert status == OK, instance.log
    return np.array(values)


def set_slopes(instance: Instance, slopes: Mapping[str, float]) -> None:
    n = len(slopes)
    refs = (c_uint32 * n)(*(instance.library.references[name] for name in slopes))
    orders = (c_int32 * n)(*[1] * n)
    assert instance("SetRealInputDerivatives", refs, c_size_t(n), orders, (c_double * n)(*slopes.values())) == OK


#: Derivative at the first of five equidistant points.
ONE_SIDED = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0


@pytest.mark.parametrize("fresh", [False, True], ids=["as stepped", "commands set anew"])
def test_output_derivatives(library: Library, fresh: bool) -> None:
    for number, case in enumerate(cases(library)):
        of = oracle(case.mechanism.fmu)
        *_, p = of.start(case)
        instance = begun(library, case)
        assert instance("ExitInitializationMode") == OK
        forces = [c.name for c in of.mechanism.channels if c.kind == "force"]
        slopes = {name: 100.0 * n for n, name in enumerate(forces, 1)} if library.fmi == 2 else {}
        set_slopes(instance, slopes) if slopes else None
        assert instance.step(0.0, 1e-4) == OK
        commands = case.commanded
        # from where the motion is, so that the steps below go on without a jump
        now = dict(zip(commands, instance.get(*commands.values()))) if commands else {}
        x = np.array(instance.get(*of.states))
        if fresh:
            assert put(instance, now) == OK
        names = [name for name in of.unknowns if name != MARGIN]
        u = instance.get(*of.mechanism.input_names)
        rows, whole = of.run(case, x, u, p, [])
        at = {name: n for n, name in enumerate(of.unknowns)}
        rates = rows[[at[name] for name in rate_names(of)]]
        moving = np.array([slopes.get(name, 0.0) for name in of.mechanism.input_names])
        right = whole @ np.concatenate([rates, moving])
        found = output_slopes(instance, of.unknowns)
        assert output_slopes(instance, ["time"]) == 1.0
        scale = np.abs(whole) @ np.abs(np.concatenate([rates, moving])) + 1.0
        # a residual, and a moment that a free shaft's bearing does not take, are small differences of others
        scale = np.where(
            ["residual" in name for name in of.unknowns], scale.max(), np.maximum(scale, 1e-3 * scale.max())
        )
        close(found, right, scale)
        if number < 3:
            h, values = 1e-5, []
            saved = instance.saved()
            for n in range(5):
                assert instance(f"SetFMU{'s' if library.fmi == 2 else 'S'}tate", saved) == OK
                if n:
                    assert put(instance, now) == OK
                    set_slopes(instance, slopes) if slopes else None
                    assert instance.step(1e-4, n * h) == OK
                values.append(instance.get(*names))
            close(ONE_SIDED @ np.array(values) / h, found[[at[n] for n in names]], scale[[at[n] for n in names]], 1e-5)


def rate_names(of: Oracle) -> list[str]:
    """The time derivatives of the states, by name."""
    entries = interface(of.mechanism)
    return [next(e.variable.name for e in entries if e.derivative_of == r) for r in states(of.mechanism)]
