"""Read and write parameters and cases in TOML or JSON files, with units; see `docs/case-files.md`.

In a file every quantity is a number in SI or a text with its unit, such as ``"15.35 cm"`` or ``"420 rpm"``; the unit's
dimension is checked. Names are those of the FMI contract: ``[slider] stiffness`` is ``slider.stiffness``.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from linkwork.errors import InputError, LinkworkError, MissingParameterError, ParameterError, UnknownNameError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name
from linkwork.plant import TOLERANCE_RANGE

from .. import files
from ..files import Choice, Kinds, Many, Quantity, Reader, Table, entry
from ..linkages import with_linkage
from ..mechanisms import MECHANISMS, PUBLISHED, InitialState, Parameters, find_mechanism, name_in_files
from ..units import quantity, with_unit
from .arguments import complete_inputs, published_set, turn_durations
from .inputs import Inputs, check_run, parameter_readers, read_start
from .masses import Mass, mass_origins, resolve_sections
from .signals import SHAPES, Harmonics, InductionMotor, Piecewise, TorsionBar, ramp, table

# Parameters


def read_parameters(
    data: Mapping[str, Any], base: Parameters | None = None, mechanism: Mechanism | None = None
) -> Parameters:
    """Read parameters from nested tables or dotted names; missing parameters are taken from ``base``.

    The ``section`` of a link gives its mass, its centre of mass and its moment of inertia; see `docs/case-files.md`.

    Parameters
    ----------
    data : mapping
    base : parameters of a mechanism, optional
    mechanism : Mechanism, optional
        Mechanism of the parameters. By default the mechanism of ``base``; without ``base`` the mechanism that ``data`` names,
        or else the mechanism with most of the parameters in ``data``.

    Raises
    ------
    ParameterError
        If a name is unknown, a value is wrong, or, without ``base``, a value is missing.
    """
    if mechanism is None:
        mechanism = _find_mechanism(data) if base is None else find_mechanism(base)
    if data.get("mechanism", mechanism.name) != mechanism.name:
        raise ParameterError("mechanism", data["mechanism"], f"be {mechanism.name}")
    data = {name: value for name, value in data.items() if name != "mechanism"}
    keys = {field_name(name): name for name in mechanism.mechanism_variables}
    flat = resolve_sections(mechanism, files.flatten(data), base)
    try:
        made: Parameters = files.read(
            mechanism.parameters, flat, "", readers=parameter_readers(mechanism), keys=keys, base=base
        )
    except MissingParameterError as error:
        bare = [link for link in mechanism.links if link.length in flat and link.inertia not in flat]
        if bare:
            sections = ", ".join(f"{link.name}.section" for link in bare)
            error.args = (f"{error}; give masses and inertias, or what they follow from: {sections}",)
        raise
    return made


def parameter_tables(parameters: Parameters) -> dict[str, Any]:
    """Return parameters as nested tables of texts with SI units and all digits; the entry ``mechanism`` has its name."""
    mechanism = find_mechanism(parameters)
    data: dict[str, Any] = {"mechanism": mechanism.name}
    for name, variable in mechanism.mechanism_variables.items():
        value = getattr(parameters, field_name(name))
        group, _, leaf = name.rpartition(".")
        place = data.setdefault(group, {}) if group else data
        place[leaf] = value if variable.kind == "Integer" else with_unit(value, variable.unit)
    return data


def save_parameters(path: str | Path, parameters: Parameters, *, head: str = "") -> Path:
    """Write parameters to a TOML or JSON file, according to the path's ending; ``head`` is a comment at the top of TOML."""
    return files.write_tables(path, parameter_tables(parameters), head=head)


def load_parameters(path: str | Path) -> Parameters:
    """Read parameters from a TOML or JSON file.

    Raises
    ------
    InputError
        If the file cannot be read.
    ParameterError
        As for `read_parameters`.
    """
    return read_parameters(files.read_tables(path))


def _find_mechanism(data: Mapping[str, Any]) -> Mechanism:
    """Return the mechanism that a file names as ``mechanism``, else the mechanism with most of the file's parameters."""
    if "mechanism" in data:
        try:
            return MECHANISMS[Choice(MECHANISMS)(data["mechanism"], "mechanism")]
        except UnknownNameError as error:
            error.args = (f"{error}; a linkage of your own is loaded first: load_linkage(FILE)",)
            raise
    names = set(files.flatten(data))
    found = {name: len(names & set(mechanism.mechanism_variables)) for name, mechanism in MECHANISMS.items()}
    best = [name for name, count in found.items() if count == max(found.values())]
    if len(best) > 1:
        raise ParameterError("mechanism", "missing", f"be given: one of {', '.join(MECHANISMS)}")
    return MECHANISMS[best[0]]


# Cases


def case_mechanism(data: Mapping[str, Any]) -> Mechanism:
    """Return the mechanism of a case: that of its published set or, if it names no set, that of its parameters."""
    if "published" in data:
        return find_mechanism(PUBLISHED[Choice(PUBLISHED)(data["published"], "published")].parameters)
    return _find_mechanism(data)


#: Entries of case files of all mechanisms that are neither parameters nor inputs of the mechanism.
COMMON = ("mechanism", "title", "published", "initial", "run")


class ActingInput(NamedTuple):
    """An input of a mechanism: its name in `Inputs`, and its unit, empty for a flag."""

    argument: str
    unit: str


def case_inputs(mechanism: Mechanism) -> dict[str, ActingInput]:
    """Return the inputs of a mechanism by their names in case files.

    The function `name_in_files` gives the name of a channel: ``force`` for ``slider.force``. A flag that drives a degree of
    freedom, such as ``axial.groove``, is an entry in the table (``axial``) of the mode of the degree of freedom.
    """
    units = {variable.name: variable.unit for variable in mechanism.variables}
    found = {}
    for channel in mechanism.channels:
        if channel.kind != "rate":
            found[name_in_files(mechanism, channel)] = ActingInput(channel.argument, units[channel.name])
    channels = {channel.argument for channel in mechanism.channels}
    for mode in mechanism.modes:
        for flag in mode.arguments:
            if flag not in channels:
                found[f"{mode.name.rpartition('.')[0]}.{flag}"] = ActingInput(flag, "")
    return found


def _tolerance(value: Any, name: str) -> float:
    """Return a tolerance of the solver; raise ParameterError with its name in the file if it is outside its range."""
    number = quantity(value, "1", name)
    low, high = TOLERANCE_RANGE
    if not low <= number <= high:
        raise ParameterError(name, value, f"be between {low:g} and {high:g}")
    return number


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTable:
    """The table ``[run]``: duration, step and tolerance of a run; `linkwork new` prints the explanations of its entries.

    Attributes
    ----------
    stop_time : float, optional
        Duration of the run. By default three revolutions of the slowest crank, if its speed is constant.
    revolutions : float, optional
        Duration in revolutions of the slowest crank, if its speed is constant. Not with stop_time.
    step : float, optional
        Time between two samples. By default the time of 1 deg of the fastest crank; 1 ms if no crank has a constant speed.
    tolerance : float
        Tolerance of the solver, between 1e-13 and 0.01.
    """

    stop_time: float | None = entry(Quantity("s"), None)
    revolutions: float | None = entry(Quantity("1", above=0.0), None)
    step: float | None = entry(Quantity("s"), None)
    tolerance: float = entry(_tolerance, 1e-9)

    def times(self, inputs: Inputs, mechanism: Mechanism) -> tuple[float, float]:
        """Return the stop time and the sampling step (s)."""
        turn = turn_durations(inputs, mechanism)
        step = self.step if self.step is not None else 1e-3 if turn is None else turn[1] / 360.0
        if self.stop_time is not None:
            if self.revolutions is not None:
                raise ParameterError("run.revolutions", self.revolutions, "not come together with run.stop_time")
            return self.stop_time, step
        if turn is not None:
            return (3.0 if self.revolutions is None else self.revolutions) * turn[0], step
        if self.revolutions is None:
            raise InputError(
                "run.stop_time is missing: a run lasts three turns by default only if a crank has a constant speed"
            )
        raise ParameterError("run.revolutions", self.revolutions, "come with a constant speed; give run.stop_time")


def load_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Case:
    """Read a case from a TOML or JSON file; see `docs/case-files.md`.

    Parameters
    ----------
    path : path
    overrides : mapping, optional
        Values by dotted name that replace values of the file, such as ``slider.stiffness``, ``drive.speed`` or
        ``run.stop_time``.

    Raises
    ------
    InputError
        If the file cannot be read or lacks an entry that a run needs.
    ParameterError
        If a name is unknown or a value is wrong.
    """
    return read_case(files.read_tables(path), folder=Path(path).parent, title=Path(path).stem, overrides=overrides)


def read_case(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> Case:
    """Build a case from the tables of a case file; files named in the case (CSV, a linkage) are read from ``folder``."""
    data = with_linkage(data, folder)
    named = {**data, **(overrides or {})}
    mechanism = case_mechanism(named)
    data = with_case_file_names(data, mechanism)
    overrides = {_case_file_name(name, mechanism): value for name, value in (overrides or {}).items()}
    published = PUBLISHED[named["published"]] if "published" in named else None
    if named.get("mechanism", mechanism.name) != mechanism.name:
        raise ParameterError("mechanism", named["mechanism"], f"be that of the published set {named['published']}")
    acting = case_inputs(mechanism)
    data = files.override(_without_rivals(data, overrides, mechanism, acting), overrides)
    own, found = _split_tables(data, mechanism, acting, folder)
    printed = None if published is None else published.parameters
    try:
        parameters = read_parameters(own, printed, mechanism)
    except UnknownNameError as error:
        if not set(mechanism.mechanism_variables) <= set(error.known):  # an entry of a part, such as of a section
            raise
        others = (*acting, *(f"run.{name}" for name in files.entry_names(RunTable)), *COMMON[:-2])
        raise files.unknown_name(error.name, (*error.known, *others)) from None
    base = None if published is None or published.at_rest else published.initial
    initial = read_start(mechanism, data.get("initial", {}), base)
    inputs = Inputs(**found)
    if published is not None:
        inputs = complete_inputs(published, inputs)
    _check_drives(mechanism, inputs, parameters, initial, acting)
    run: RunTable = files.read(RunTable, data.get("run", {}), "run")
    stop_time, step = run.times(inputs, mechanism)
    return Case(
        title=files.text(data.get("title", title), "title"),
        parameters=parameters,
        initial=initial,
        inputs=inputs,
        stop_time=stop_time,
        step=step,
        tolerance=run.tolerance,
        masses=mass_origins(parameters, files.flatten(own), published, str(named.get("published", ""))),
    )


def with_case_file_names(data: Mapping[str, Any], mechanism: Mechanism) -> dict[str, Any]:
    """Return the tables of a case with the FMI names of inputs replaced by their names in case files."""
    result = dict(data)
    for channel in mechanism.channels:
        table, _, leaf = channel.name.rpartition(".")
        name, inner = name_in_files(mechanism, channel), result.get(table)
        if name == channel.name or not isinstance(inner, Mapping) or leaf not in inner:
            continue
        if name in result:
            raise InputError(
                f"{channel.name} is called {name} in case files, and both are given: leave out one of them"
            )
        result |= {name: inner[leaf], table: {key: value for key, value in inner.items() if key != leaf}}
    return result


def _case_file_name(name: str, mechanism: Mechanism) -> str:
    """Return the dotted name of an entry, with the FMI name of an input replaced by its name in case files."""
    for channel in mechanism.channels:
        if f"{name}.".startswith(f"{channel.name}."):
            return name_in_files(mechanism, channel) + name.removeprefix(channel.name)
    return name


def _without_rivals(
    data: Mapping[str, Any], overrides: Mapping[str, Any], mechanism: Mechanism, acting: Mapping[str, ActingInput]
) -> dict[str, Any]:
    """Return the tables of a case without the entries that an override replaces.

    These entries are drives of the same degree of freedom, or entries that set the end of the run.
    """
    result = dict(data)
    for given, rival in (("run.stop_time", "revolutions"), ("run.revolutions", "stop_time")):
        if given in overrides and isinstance(run := result.get("run"), Mapping):
            result["run"] = {name: value for name, value in run.items() if name != rival}
    for name in overrides:
        chosen = next((a.argument for own, a in acting.items() if f"{name}.".startswith(f"{own}.")), None)
        rivals = {n for mode in mechanism.modes if chosen in mode.arguments for n in mode.arguments} - {chosen}
        for rival in (own for own, a in acting.items() if a.argument in rivals):
            table, _, leaf = rival.rpartition(".")
            if not table:
                result.pop(leaf, None)
            elif isinstance(result.get(table), Mapping):
                result[table] = {key: value for key, value in result[table].items() if key != leaf}
    return result


def _split_tables(
    data: Mapping[str, Any], mechanism: Mechanism, acting: Mapping[str, ActingInput], folder: Path
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split the tables of a case into the parameters, still unread, and the inputs, which are read and named as in `Inputs`.

    In a file, inputs are entries at the top, in tables of their own, or in the table of a body, beside its parameters.
    """
    readers = {name: _reader(unit, folder) for name, (_, unit) in acting.items()}
    found = {name: readers[name](data[name], name) for name in acting if name in data}
    own = {name: value for name, value in data.items() if name not in acting and name not in COMMON}
    bodies = {name.partition(".")[0] for name in mechanism.mechanism_variables if "." in name}
    for group in dict.fromkeys(name.partition(".")[0] for name in acting if "." in name):
        inside = {name.removeprefix(f"{group}."): r for name, r in readers.items() if name.startswith(f"{group}.")}
        table = files.as_table(own.pop(group, {}), group)
        if group in bodies:
            own[group] = {leaf: value for leaf, value in table.items() if leaf not in inside}
            table = {leaf: value for leaf, value in table.items() if leaf in inside}
        values: dict[str, Any] = files.read(dict, table, group, readers=inside)
        found |= {f"{group}.{name}": value for name, value in values.items()}
    for mode in mechanism.modes:
        rivals = [name for name, (argument, _) in acting.items() if argument in mode.arguments]
        given = [name for name in found if name in rivals]
        if len(given) > 1:
            group = mode.name.partition(".")[0]
            one, all_of = (", ".join(name.removeprefix(f"{group}.") for name in names) for names in (given, rivals))
            raise ParameterError(group, one, f"have only one of {all_of}")
    return own, {acting[name].argument: value for name, value in found.items()}


def _check_drives(
    mechanism: Mechanism, inputs: Inputs, parameters: Any, initial: Any, acting: Mapping[str, ActingInput]
) -> None:
    """Raise ParameterError if a groove of zero amplitude drives the shift, or a coordinate that is held has an initial rate."""
    if inputs.parts("groove") and getattr(parameters, "groove_amplitude", None) == 0.0:
        raise ParameterError(
            "groove.amplitude", 0.0, "be given with axial.groove: a groove without it holds the shift at zero"
        )
    modes = inputs.modes(mechanism)
    names = {argument: name for name, (argument, _) in acting.items()}
    for freedom in mechanism.freedoms:
        rate = getattr(initial, freedom.initial[1])
        if freedom.mode is None or rate == 0.0:
            continue
        chosen = freedom.mode.arguments[modes[freedom.mode.name]]
        if not inputs.parts(chosen) and chosen in (c.argument for c in mechanism.channels if c.kind == "command"):
            force = names[freedom.mode.arguments[0]]
            raise ParameterError(
                f"initial.{freedom.initial[1]}", rate, f"come with {force}: without it {freedom.coordinate} is held"
            )


# Inputs


def _reader(unit: str, folder: Path) -> Reader:
    """Return the reader of an input with this unit: a flag if the unit is empty, else a number or a signal.

    A torque may also be a torque law, or a list of summands."""
    if not unit:
        return files.flag
    kinds, value = signal_kinds(unit, folder), Quantity(unit)

    def signal(item: Any, name: str) -> Any:
        if not isinstance(item, Mapping):
            return value(item, name)
        if "kind" not in item:
            raise ParameterError(name, ", ".join(item), f"be a quantity, or a table with a kind, of {', '.join(kinds)}")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                return Kinds(kinds)(item, name)
        except LinkworkError as error:
            if name in str(error):
                raise
            raise InputError(f"{name}: {error}") from None
        except (ValueError, ArithmeticError) as error:  # such as of a spline through numbers near 1e308
            raise InputError(f"{name} cannot be made a signal: {files.first_line(error)}") from error

    return Many(signal, least=1, single=True) if unit == "N.m" else signal


def signal_kinds(unit: str, folder: Path) -> dict[str, Table]:
    """Return a reader for each kind of signal: ramp, table and harmonics; a torque can also be a torsion bar or a motor.

    The values of a signal have the unit ``unit``; the file of a table is read from ``folder``.
    """
    value, values = Quantity(unit), Many(Quantity(unit))
    waves: dict[str, Reader] = {
        "mean": value,
        "amplitudes": values,
        "frequencies": Many(Quantity("rad/s")),
        "phases": Many(Quantity("rad")),
    }
    kinds: dict[str, Table] = {
        "ramp": Table(ramp, {"start": value, "end": value, "from_time": Quantity("s"), "to_time": Quantity("s")}),
        "table": Table(
            partial(_make_table, folder, unit),
            {"times": Many(Quantity("s")), "values": values, "file": files.text, "interpolation": Choice(SHAPES)},
        ),
        "harmonics": Table(_harmonics, waves),
    }
    if unit == "N.m":
        kinds["torsion-bar"] = Table(TorsionBar, {"torque": value, "release_angle": Quantity("rad")})
        motor = {"breakdown_torque": value, "breakdown_slip": Quantity("1"), "synchronous_speed": Quantity("rad/s")}
        kinds["induction-motor"] = Table(InductionMotor, motor)
    return kinds


def _harmonics(
    amplitudes: Sequence[float], frequencies: Sequence[float], mean: float = 0.0, phases: Sequence[float] | None = None
) -> Harmonics:
    phases = [0.0] * len(amplitudes) if phases is None else phases
    return Harmonics(mean, list(amplitudes), list(frequencies), list(phases))


def _make_table(
    folder: Path,
    unit: str,
    times: Sequence[float] = (),
    values: Sequence[float] = (),
    file: str | None = None,
    interpolation: str = "linear",
) -> Piecewise:
    if file is None:
        return table(times, values, interpolation)
    if len(times) or len(values):
        raise InputError(f"a table has times and values, or the file {file}: it cannot have both")
    path = folder / file
    found, columns = files.read_record(path)
    if len(columns) != 2:
        raise InputError(f"{path} has {len(columns)} columns: it must have two, time in s and value in {unit}")
    # the unit in a heading, else SI
    files.note_assumed_units(path, found, ("s", unit))
    t, y = (
        column * (1.0 if own in ("", si) else quantity(f"1 {own}", si, f"{path.name}, column {place} in {own!r}"))
        for place, (column, own, si) in enumerate(zip(columns, found, ("s", unit)), start=1)
    )
    return table(t, y, interpolation)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A case: all data that a run needs, in process or through the FMU, in SI units.

    Attributes
    ----------
    title : str
    parameters, initial, inputs
        Parameters, initial state and inputs of one mechanism; by default the mechanism is at rest and nothing acts on it.
    stop_time : float
        End of the run (s), which starts at 0.
    step : float
        Time between samples, and communication step of the FMU (s).
    tolerance : float
        Tolerance of the integrator, as for `simulate`.
    masses : tuple of Mass
        The masses, each with the origin of its value; empty if the origins are not known.
    """

    title: str
    parameters: Parameters
    initial: InitialState = None
    inputs: Inputs = field(default_factory=Inputs)
    stop_time: float
    step: float = 1e-3
    tolerance: float = 1e-9
    masses: tuple[Mass, ...] = ()

    def __post_init__(self) -> None:
        # inputs and start of another mechanism are refused here, not when it is run
        _, initial = check_run(find_mechanism(self.parameters), self.inputs, self.initial)
        object.__setattr__(self, "initial", initial)


def published_case(name: str) -> Case:
    """Return the case of a published set, with its published drive and initial state.

    The run lasts three revolutions of the slowest crank, in steps of one degree of the fastest crank. If no speed
    is commanded, duration and step are those of the default experiment of the FMU.

    Raises
    ------
    UnknownNameError
        If there is no set of that name.
    """
    entry = published_set(name)
    mechanism, inputs = find_mechanism(entry.parameters), complete_inputs(entry, None)
    turn = turn_durations(inputs, mechanism)
    _, stop_time, step, _ = mechanism.experiment
    if turn is not None:
        stop_time, step = 3.0 * turn[0], turn[1] / 360.0
    return Case(
        title=entry.source,
        parameters=entry.parameters,
        initial=entry.initial,
        inputs=inputs,
        stop_time=stop_time,
        step=step,
        masses=mass_origins(entry.parameters, {}, entry, name),
    )
