"""The variables of native FMUs: what they add to the mechanism's, the states with their derivatives, what depends on what."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from random import Random
from typing import Any

import pytest

from analysis.export.description import NATIVE, NATIVE_FMI3, PYTHON, Kind, description, traced_dependencies
from analysis.export.interface import derivatives, indicator, interface, states
from analysis.mechanisms import FIVE_BAR, SLIDER_CRANK
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name
from linkwork.plant import Plant

from ..mechanisms import pendulum, rotor_on_cart
from ..oracles import differences
from .described import read_scalars, read_unknowns

EVERY = {m.name: m for m in (FIVE_BAR, SLIDER_CRANK, pendulum.MECHANISM, rotor_on_cart.MECHANISM)}

#: Name, causality, unit, and what it is the derivative of.
POWERS = [("power.dissipated", "local", "W", "energy.dissipated"), ("power.supplied", "local", "W", "energy.supplied")]
ENERGIES = [("energy.dissipated", "local", "J", None), ("energy.supplied", "local", "J", None)]
TIME = [("time", "independent", "s", None)]
MARGIN = [("assembly.margin_to_limit", "local", "1", None)]
ADDED = {
    "five-bar": TIME + POWERS + MARGIN,
    "slider-crank": TIME + POWERS + MARGIN,
    "pendulum": TIME + ENERGIES + POWERS + MARGIN,
    "rotor-on-cart": TIME + ENERGIES + POWERS + MARGIN,
}
ENERGY = {"energy.dissipated": "power.dissipated", "energy.supplied": "power.supplied"}


def states_of(turning: tuple[str, ...], moving: tuple[str, ...] = ()) -> dict[str, str]:
    """Coordinates and rates of bodies that turn, and of bodies that move along a line, each with its derivative."""
    rows = [(name, "angle", "speed") for name in turning] + [(name, "position", "velocity") for name in moving]
    rates = {f"{name}.{place}": f"{name}.{rate}" for name, place, rate in rows}
    return rates | {f"{name}.{rate}": f"{name}.acceleration" for name, _, rate in rows}


#: The components of the state, each with its derivative.
STATES = {
    "five-bar": states_of(turning=("crank",), moving=("slider",)),
    "slider-crank": states_of(turning=("crank",), moving=("shift",)),
    "pendulum": states_of(turning=("pendulum",)),
    "rotor-on-cart": states_of(turning=("rotor",), moving=("cart",)),
}


@pytest.fixture(params=list(EVERY))
def mechanism(request: pytest.FixtureRequest) -> Mechanism:
    """Each mechanism in turn, those of the tests as well."""
    return EVERY[request.param]


def modes_of(mechanism: Mechanism) -> Iterator[dict[str, int]]:
    """Every combination of the values of the modes."""
    names = [mode.name for mode in mechanism.modes]
    for values in product(*(range(len(mode.values)) for mode in mechanism.modes)):
        yield dict(zip(names, values))


def started(mechanism: Mechanism, modes: dict[str, int], random: Random, **others: float) -> Plant:
    """The mechanism with random parameters and state not far from those of its table, under random inputs, none zero.

    ``others`` are parameters that are not to be near those.
    """
    values: dict[str, Any] = {v.name: v.start for v in mechanism.variables}
    for v in mechanism.mechanism_variables.values():
        if v.kind == "Real":
            values[v.name] = values[v.name] * random.uniform(1.0, 1.02) or 1e-3 * random.uniform(1.0, 2.0)
    fields = {field_name(name): values[name] for name in mechanism.mechanism_variables} | others
    initial = {f: values[f"initial.{f}"] + random.uniform(0.01, 0.02) for f in mechanism.initial_variables}
    inputs = {name: values[name] + random.uniform(0.5, 1.0) for name in mechanism.input_names}
    if "axial.speed" in inputs:
        inputs["axial.speed"] = 0.05
    chosen = {field_name(name): value for name, value in modes.items()}
    start = mechanism.initial(**initial)
    return Plant(mechanism, mechanism.parameters(**fields), start, inputs=inputs, tolerance=1e-12, **chosen)


def test_the_mechanisms_variables_come_first_and_then_what_a_native_fmu_adds(mechanism: Mechanism) -> None:
    entries = interface(mechanism)
    names = [entry.variable.name for entry in entries]
    assert [entry.reference for entry in entries] == list(range(len(entries)))
    assert tuple(entry.variable for entry in entries[: len(mechanism.variables)]) == mechanism.variables
    of = [None if entry.derivative_of is None else names[entry.derivative_of] for entry in entries]
    added = [(entry.variable.name, entry.variable.causality, entry.variable.unit) for entry in entries]
    count = len(mechanism.variables)
    assert [(*row, rate) for row, rate in zip(added[count:], of[count:])] == ADDED[mechanism.name]
    assert len(set(names)) == len(names)


def test_a_rate_without_an_output_for_its_derivative_gets_one() -> None:
    rotor = rotor_on_cart.MECHANISM
    variables = tuple(v for v in rotor.variables if v.name != "cart.acceleration")
    entries = interface(replace(rotor, variables=variables))
    added = next(entry for entry in entries if entry.variable.name == "der(cart.velocity)")
    assert entries[added.derivative_of].variable.name == "cart.velocity"
    assert (added.variable.unit, added.role) == ("m/s2", "derivative")


def test_states_and_their_derivatives(mechanism: Mechanism) -> None:
    names = [entry.variable.name for entry in interface(mechanism)]
    pairs = [(names[s], names[d]) for s, d in zip(states(mechanism), derivatives(mechanism))]
    assert pairs == list((STATES[mechanism.name] | ENERGY).items())


def test_roles_say_where_values_come_from(mechanism: Mechanism) -> None:
    roles: dict[str, list[str]] = {}
    for entry in interface(mechanism):
        roles.setdefault(entry.role, []).append(entry.variable.name)
    assert roles.pop("parameter") == list(mechanism.mechanism_variables)
    assert roles.pop("initial") == [f"initial.{field}" for field in mechanism.initial_variables]
    assert roles.pop("mode", []) == [mode.name for mode in mechanism.modes]
    assert roles.pop("input") == list(mechanism.input_names)
    assert roles.pop("output") == list(mechanism.output_names)
    assert roles.pop("state", []) == [name for name, causality, unit, _ in ADDED[mechanism.name] if unit == "J"]
    assert roles == {
        "tolerance": ["solver.tolerance"],
        "status": ["solver.status", "solver.message"],
        "time": ["time"],
        "derivative": ["power.dissipated", "power.supplied"],
        "indicator": ["assembly.margin_to_limit"],
    }


def test_outputs_that_are_states_or_derivatives_are_those_of_the_equations(mechanism: Mechanism) -> None:
    entries = interface(mechanism)
    for modes in modes_of(mechanism):
        plant = started(mechanism, modes, Random(1))
        outputs = dict(zip(mechanism.output_names, plant.outputs()))
        x = plant._jump_rates(plant.state, plant._applied_inputs(), plant._commanded)
        rates = mechanism.equations.derivative(x, plant._applied_inputs(), plant._p)
        for references, values in ((states(mechanism), x), (derivatives(mechanism), rates)):
            for reference, value in zip(references, values):
                name = entries[reference].variable.name
                assert outputs.get(name, value) == pytest.approx(value, rel=1e-12, abs=1e-12), name


def test_rates_are_time_derivatives(mechanism: Mechanism) -> None:
    """Along a run with all forces and accelerations, the commanded speeds as they go on."""
    step = 5e-5
    for modes in modes_of(mechanism):
        plant = started(mechanism, modes, Random(2))
        commands = [c for c in mechanism.channels if c.kind == "command"]
        rate = {c.freedom: c.name for c in mechanism.channels if c.kind == "rate"}
        at_start = {c.name: plant.inputs[c.name] for c in commands}
        samples = []
        for n in range(40):
            for c in commands:
                plant.set_input(c.name, at_start[c.name] + plant.inputs[rate[c.freedom]] * n * step)
            samples.append(plant.outputs())
            plant.step(n * step, step)
        for middle in (5, 20, 36):
            around = samples[middle - 3 : middle + 4]
            found = differences.derivative(lambda t, around=around: around[3 + round(t / step)], step)
            rates = dict(zip(mechanism.output_names, found))
            values = dict(zip(mechanism.output_names, samples[middle]))
            checked = [v for v in mechanism.variables if v.rate_of]
            assert len(checked) >= 2 * len(mechanism.freedoms)
            for v in checked:
                assert values[v.name] == pytest.approx(rates[v.rate_of], rel=1e-6, abs=1e-6), (modes, v.name)


#: Parameters with which the clearance is that from another limit: friction that may jam the links.
OTHER_LIMIT = {"five-bar": {"slider_friction_coefficient": 1.2}}


def changed(mechanism: Mechanism) -> dict[str, set[str]]:
    """What each output, derivative and the event indicator was seen to change with: states, and inputs at once.

    An input acts at once also by the jump of a commanded speed.
    """
    e = mechanism.equations
    entries = interface(mechanism)
    unknowns = [*mechanism.output_names, *(entries[r].variable.name for r in derivatives(mechanism))]
    unknowns.append(entries[indicator(mechanism)].variable.name)
    known = [*(entries[r].variable.name for r in states(mechanism)), *mechanism.input_names]
    found: dict[str, set[str]] = {name: set() for name in unknowns}
    for seed, modes, others in product(range(3), modes_of(mechanism), ({}, OTHER_LIMIT.get(mechanism.name, {}))):
        plant = started(mechanism, modes, Random(seed), **others)
        p, m = plant._p, plant._modes

        def values(at: list[float], jumped: bool, p: Any = p, m: Any = m) -> list[float]:
            x, u = tuple(at[: mechanism.size]), tuple(at[mechanism.size :])
            i = e.apply_inputs(m, u, p)
            x = e.jump(x, i, u, p) if jumped else x
            return [*e.outputs(x, i, 0.3, p), *e.derivative(x, i, p), e.clearance(x, i, p)]

        # commands differ from the rates, as between events in model exchange
        at = [*plant.state, *(1.1 * value + 0.01 for value in plant.inputs.values())]
        for place, name in enumerate(known):
            moved = list(at)
            moved[place] = moved[place] * 1.001 + 1e-5
            for jumped in (False, True):
                for unknown, before, after in zip(unknowns, values(at, jumped), values(moved, jumped)):
                    if before != after:
                        found[unknown].add(name)
    return found


@pytest.mark.parametrize("kind", [NATIVE, NATIVE_FMI3], ids=["native", "native-fmi3"])
def test_dependencies_are_those_of_the_equations(mechanism: Mechanism, kind: Kind) -> None:
    root = description(mechanism, kind)
    declared = {}
    for group in ("Output", "ContinuousStateDerivative", "EventIndicator"):
        for unknown, on in read_unknowns(root, group).items():
            assert on is not None
            assert declared.setdefault(unknown, on) == on, "an output that is a derivative is listed twice"
    seen = changed(mechanism)
    if kind.fmi == 2:
        # event indicators have no place in the model structure of FMI 2.0
        del seen["assembly.margin_to_limit"]
    assert set(declared) == set(seen)
    inputs = set(mechanism.input_names)
    for unknown, on in seen.items():
        assert on <= declared[unknown], unknown
        # of the inputs declared some are multiplied by modes that exclude one another
        assert declared[unknown] - inputs == on - inputs, unknown


def test_the_table_states_the_dependencies_of_the_equations(mechanism: Mechanism) -> None:
    """On inputs: what `Variable.depends` says is what the traced equations have, by the jumps as well."""
    declared = read_unknowns(description(mechanism, PYTHON), "Output")
    reference = {entry.variable.name: entry.reference for entry in interface(mechanism)}
    traced = traced_dependencies(mechanism)
    for name, on in declared.items():
        assert {reference[known] for known in on} == traced[reference[name]] - set(states(mechanism)), name


def test_only_states_that_jump_are_reinitialised(mechanism: Mechanism) -> None:
    jumps = {
        "five-bar": {"crank.speed", "slider.velocity", "energy.supplied"},
        # the position, because a groove sets it
        "slider-crank": {"crank.speed", "shift.velocity", "shift.position", "energy.supplied"},
        "pendulum": set(),
        "rotor-on-cart": {"rotor.speed", "cart.velocity", "energy.supplied"},
    }
    for kind in (NATIVE, NATIVE_FMI3):
        marked = {s.name for s in read_scalars(description(mechanism, kind)) if s.attributes.get("reinit") == "true"}
        assert marked == jumps[mechanism.name]


def test_nominals_are_the_magnitudes_that_errors_are_measured_by(mechanism: Mechanism) -> None:
    plant = Plant(
        mechanism,
        mechanism.parameters(**{field_name(n): v.start for n, v in mechanism.mechanism_variables.items()}),
        mechanism.initial(**{f: v.start for f, v in mechanism.initial_variables.items()}),
        inputs={v.name: v.start for v in mechanism.variables if v.causality == "input"},
        **{field_name(v.name): v.start for v in mechanism.variables if v.name.endswith(".mode")},
    )
    entries = interface(mechanism)
    expected = {v.name: v.nominal for v in mechanism.variables if v.nominal is not None}
    expected |= dict(zip((entries[r].variable.name for r in states(mechanism)), plant._scale))
    for kind in (NATIVE, NATIVE_FMI3):
        scalars = read_scalars(description(mechanism, kind))
        assert {s.name: float(s.attributes["nominal"]) for s in scalars if "nominal" in s.attributes} == expected
