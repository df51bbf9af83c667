"""Registry of the mechanisms, and checks that the parts of a mechanism are consistent."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from linkwork import five_bar, slider_crank
from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.parameters import FiveBarParameters as FiveBarParameters
from linkwork.mechanism import PARTS, Channel, Mechanism, PublishedSet
from linkwork.parameters import Rules, fmi_name
from linkwork.slider_crank.parameters import SliderCrankParameters as SliderCrankParameters
from linkwork.variables import ROLES, UNITS, status_variables

STATUS_NAMES = tuple(v.name for v in status_variables())

FIVE_BAR = five_bar.MECHANISM
SLIDER_CRANK = slider_crank.MECHANISM

#: The known mechanisms by name; `register` adds one.
MECHANISMS: dict[str, Mechanism] = {}


class MechanismError(LinkworkError):
    """Error for a mechanism whose parts are inconsistent."""


def check(mechanism: Mechanism) -> None:
    """Check that the parts of a mechanism are consistent.

    Raises
    ------
    MechanismError
        If the parts are inconsistent; the message states the first fault.
    """
    # later checks assume that earlier ones found no fault
    for faults in (_faults_of_interface, _faults_of_drives, _faults_of_equations, _faults_of_drawing):
        for fault in faults(mechanism):
            raise MechanismError(f"mechanism {mechanism.name}: {fault}")


def register(mechanism: Mechanism) -> None:
    """Make a mechanism known to the analyses, case files and the command line.

    Raises MechanismError if its parts are inconsistent, or another mechanism has its name or the name of its FMU.
    """
    check(mechanism)
    for other in MECHANISMS.values():
        if other is not mechanism and (other.name == mechanism.name or other.fmu == mechanism.fmu):
            raise MechanismError(f"there is a mechanism {other.name} with the FMU {other.fmu} already")
    MECHANISMS[mechanism.name] = mechanism


def _faults_of_interface(m: Mechanism) -> Iterator[str]:
    names = [v.name for v in m.variables]
    for v in m.variables:
        for field, known in (
            ("causality", ("local",) if v.name in STATUS_NAMES else ("parameter", "input", "output")),
            ("unit", UNITS if v.kind == "Real" else (v.unit,)),
            ("depends", ("state", "speed", "all")),
            ("level", ("position", "velocity", "all", "none")),
        ):
            if getattr(v, field) not in known:
                yield f"{v.name} has {field} = {getattr(v, field)!r}: it must be {' or '.join(known)}"
        if v.rate_of and not {v.name, v.rate_of} <= set(m.output_names):
            yield f"{v.name} is the rate of {v.rate_of!r}: both must be real outputs"
    for v in m.variables:
        if v.role and ROLES.get(v.role, ("",))[0] != v.causality:
            yield f"{v.name}, a {v.causality}, has the role {v.role!r}: the roles are {', '.join(ROLES)}"
        if v.role in ("stiffness", "damping", "drive") and v.of not in m.output_names:
            yield f"{v.name} is the {v.role} of {v.of!r}: it must be that of an output"
    for name in dict.fromkeys(name for name in names if names.count(name) > 1):
        yield f"two variables are called {name}"
    for name in ("solver.tolerance", *STATUS_NAMES, *(mode.name for mode in m.modes)):
        if name not in names:
            yield f"there is no variable {name}"
    for name in (*(n for f in m.freedoms for n in (f.coordinate, f.rate)), *(c.displacement for c in m.channels)):
        if name and name not in m.output_names:
            yield f"there is no output {name}"
    rate_of = {v.name: v.rate_of for v in m.variables}
    for freedom in m.freedoms:
        if rate_of.get(freedom.rate) != freedom.coordinate:
            yield f"{freedom.rate} is the rate of {rate_of.get(freedom.rate)!r}: it must be that of {freedom.coordinate}"
    for name in m.position_parameters:
        if name not in names:
            yield f"there is no parameter {name}"
    for link in m.links:
        for name in (link.length, link.mass, link.inertia, *link.centre):
            if name not in names or not name.startswith(f"{link.name}."):
                yield f"the link {link.name} has {name!r}: it must be one of its parameters"
    if not isinstance(getattr(m.parameters, "RULES", None), Rules):
        yield f"{m.parameters.__name__} has no RULES: it must have an attribute of that name, a linkwork.parameters.Rules"
    for what, wanted, there in (
        ("the parameters", {fmi_name(f.name) for f in fields(m.parameters)}, set(m.mechanism_variables)),
        ("the state at the start", {f.name for f in fields(m.initial)}, set(m.initial_variables)),
    ):
        if wanted != there:
            yield f"{what} and its variables differ: {', '.join(sorted(wanted ^ there))}"
    for name in (n for f in m.freedoms for n in f.initial):
        if name not in m.initial_variables:
            yield f"the state at the start has no {name}"


def _faults_of_drives(m: Mechanism) -> Iterator[str]:
    inputs = tuple(v.name for v in m.variables if v.causality == "input")
    if inputs != m.input_names:
        yield f"the channels are {', '.join(m.input_names)}: they must be the inputs in their order, {', '.join(inputs)}"
    arguments = [c.argument for c in m.channels]
    in_files = [name_in_files(m, c) for c in m.channels if c.kind != "rate"]
    for what, called in (("have the argument", arguments), ("are in case files", in_files)):
        for name in dict.fromkeys(name for name in called if called.count(name) > 1):
            yield f"two channels {what} {name}: it must be one"
    for c in m.channels:
        if c.kind not in ("force", "command", "rate"):
            yield f"the channel {c.name} is a {c.kind!r}: it must be force, command or rate"
        if not -1 <= c.freedom < len(m.freedoms) or (c.kind != "force" and c.freedom < 0):
            yield f"the channel {c.name} drives freedom {c.freedom} of {len(m.freedoms)}"
        if c.kind == "command" and not any(r.kind == "rate" and r.freedom == c.freedom for r in m.channels):
            yield f"the command {c.name} has no channel for its rate"
    for number, freedom in enumerate(m.freedoms):
        own = {c.argument for c in m.channels if c.freedom == number and c.kind != "rate"}
        mode = freedom.mode
        if mode is None:
            continue
        if len(mode.values) != len(mode.arguments) or not 0 <= mode.default < len(mode.values):
            yield f"{mode.name}: {len(mode.values)} values, {len(mode.arguments)} arguments, default {mode.default}"
        if not own <= set(mode.arguments):
            yield f"{mode.name} is chosen by {', '.join(mode.arguments)}: it must have {', '.join(sorted(own))}"


def _faults_of_equations(m: Mechanism) -> Iterator[str]:
    if not m.published:
        yield "there is no published set: it must have one at least"
    for name, known in m.published.items():
        p, e, x = known.parameters.constants(), m.equations, m.state(known.initial)
        if not hasattr(p, "_fields"):
            yield f"the constants are a {type(p).__name__}: they must be a NamedTuple"
            return
        u = (0.0,) * len(m.channels)
        acting = m.idle_inputs(p)
        for what, size, found in (
            ("outputs", len(m.output_names), e.outputs(x, acting, 0.0, p)),
            ("derivative", m.size, e.derivative(x, acting, p)),
            ("jump", m.size, e.jump(x, acting, u, p)),
            ("start", m.size, e.start(x, acting, p)),
            ("error_scale", m.size, m.error_scale(known.parameters, x)),
        ):
            if len(found) != size:
                yield f"{what} gives {len(found)} numbers with {name}: it must give {size}"


def _faults_of_drawing(m: Mechanism) -> Iterator[str]:
    if m.drawing is None:
        return
    known = m.first_set
    p, x = known.parameters.constants(), m.state(known.initial)
    names = [joint.name for joint in m.drawing.joints]
    found = m.drawing.positions(x, m.idle_inputs(p), p)
    if len(found) != 3 * len(names):
        yield f"its picture has {len(found)} coordinates of {len(names)} joints: it must have three of each"
    parameters = {v.name for v in m.variables if v.causality == "parameter" and v.kind == "Real"}
    for joint in m.drawing.joints:
        if len(joint.moves) > 2 or not parameters >= set(joint.moves):
            yield f"joint {joint.name} moves {', '.join(joint.moves)}: it must move two real parameters at most"
    for part in m.drawing.parts:
        least = PARTS.get(part.kind)
        if least is None or len(part.joints) < least or (part.kind != "link" and len(part.joints) > least):
            yield f"the {part.text} is a {part.kind!r} of {len(part.joints)} joints: it must be one of {PARTS}"
        if part.where and part.where not in parameters:
            yield f"the {part.text} is drawn where {part.where!r} is not zero: this must be a real parameter"
    for name in (*m.drawing.paths, *(name for part in m.drawing.parts for name in part.joints)):
        if name not in names:
            yield f"its picture has no joint {name!r}"


class OfAll(Mapping[str, Any]):
    """Entries of all known mechanisms, by name; ``own`` returns those of one mechanism."""

    def __init__(self, what: str, own: Callable[[Mechanism], Mapping[str, Any]]) -> None:
        self._what, self._own = what, own

    def _all(self) -> dict[str, Any]:
        return {name: item for mechanism in MECHANISMS.values() for name, item in self._own(mechanism).items()}

    def __repr__(self) -> str:
        return f"<{self._what}: {', '.join(self)}>"

    def __getitem__(self, name: str) -> Any:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())


#: The published sets of every mechanism, by name: each has parameters, initial, drive and source.
PUBLISHED: Mapping[str, Any] = OfAll("published sets", lambda mechanism: mechanism.published)

#: Parameters of a mechanism and its state at the start: instances of `Mechanism.parameters` and `Mechanism.initial`.
Parameters = Any
InitialState = Any


def name_in_files(mechanism: Mechanism, channel: Channel) -> str:
    """Return the name of a channel in case files.

    The name is the FMI name of the input, such as ``slider.force``. It is the last part alone (``force``) if the table
    (``slider``) also has parameters, and no input of another table with parameters has the same last part.
    """
    tables = {name.partition(".")[0] for name in mechanism.mechanism_variables}
    bare = [c.name.rpartition(".")[2] for c in mechanism.channels if c.name.rpartition(".")[0] in tables]
    table, _, leaf = channel.name.rpartition(".")
    return leaf if table in tables and bare.count(leaf) == 1 else channel.name


def find_mechanism(parameters: Parameters) -> Mechanism:
    """Return the mechanism to which parameters belong.

    Raises InputError if the parameters belong to no known mechanism.
    """
    for mechanism in MECHANISMS.values():
        if isinstance(parameters, mechanism.parameters):
            return mechanism
    if isinstance(parameters, PublishedSet):
        raise InputError("parameters are a published set: they must be its parameters, as in variant(...).parameters")
    kinds = ", ".join(mechanism.parameters.__name__ for mechanism in MECHANISMS.values())
    raise InputError(f"parameters are {type(parameters).__name__}: they must be one of {kinds}")


def output_units() -> dict[str, str]:
    """Return the unit of every real output of every mechanism; a test checks that outputs of one name share a unit."""
    return {
        v.name: v.unit
        for mechanism in MECHANISMS.values()
        for v in mechanism.variables
        if v.causality == "output" and v.kind == "Real"
    }


def wrapping_outputs() -> frozenset[str]:
    """Return the names of the outputs that are angles of links and may jump by a full turn."""
    return frozenset(v.name for mechanism in MECHANISMS.values() for v in mechanism.variables if v.wraps)


def residual_outputs() -> frozenset[str]:
    """Return the names of the outputs that are residuals, which are zero except for numerical errors."""
    return frozenset(name for mechanism in MECHANISMS.values() for name in mechanism.names("residual"))


@lru_cache(maxsize=64)
def input_units(mechanism: Mechanism) -> Mapping[str, str]:
    """Return the units of a mechanism's inputs, by their names in `Inputs`; rates of commanded speeds are left out."""
    units = {v.name: v.unit for v in mechanism.variables}
    return MappingProxyType({c.argument: units[c.name] for c in mechanism.channels if c.kind != "rate"})


def variable_unit(mechanism: Mechanism, name: str) -> str:
    """Return the unit of a variable of a mechanism, by its FMI name."""
    return next(v.unit for v in mechanism.variables if v.name == name)


def variable_units() -> dict[str, str]:
    """Return the unit of every real variable of every mechanism, by its FMI name."""
    return _real_units(tuple(MECHANISMS.values()))


@lru_cache(maxsize=4)  # as every new `Drive` asks for them
def _real_units(mechanisms: tuple[Mechanism, ...]) -> dict[str, str]:
    return {v.name: v.unit for mechanism in mechanisms for v in mechanism.variables if v.kind == "Real"}


for _mechanism in (FIVE_BAR, SLIDER_CRANK):
    register(_mechanism)
