"""Parameters and cases in TOML or JSON files, with units; see `docs/case-files.md`.

In a file every quantity is a number in SI or a text with its unit, such as ``"15.35 cm"`` or ``"420 rpm"``; the unit's
dimension is checked. Names are those of the FMI contract: ``[slider] stiffness`` is ``slider.stiffness``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import pi
from pathlib import Path
from typing import Any

from linkwork.errors import InputError, MissingParameterError, ParameterError
from linkwork.parameters import field_name

from .. import files
from ..files import Choice, Kinds, Many, Quantity, Reader, Table, Whole, entry
from ..mechanisms import FIVE_BAR, MECHANISMS, Mechanism, Parameters, mechanism_of
from ..units import with_unit
from .case import PUBLISHED, Case
from .inputs import INPUTS_OF, Channels, Harmonics, InductionMotor, Piecewise, TorsionBar, ramp, table

# Parameters


def parameters_from(
    data: Mapping[str, Any], base: Parameters | None = None, mechanism: Mechanism = FIVE_BAR
) -> Parameters:
    """Parameters from nested tables or dotted names; what they leave out is taken from ``base``.

    Parameters
    ----------
    data : mapping
    base : FiveBarParameters or SliderCrankParameters, optional
    mechanism : Mechanism
        Whose parameters they are; with a base, the base's.

    Raises
    ------
    ParameterError
        If a name is unknown, a value is wrong, or, without a base, one is missing.
    """
    mechanism = mechanism if base is None else mechanism_of(base)
    known = mechanism.mechanism_variables
    readers = {
        field_name(name): Whole() if variable.kind == "Integer" else Quantity(variable.unit)
        for name, variable in known.items()
    }
    keys = {field_name(name): name for name in known}
    made: Parameters = files.read(
        mechanism.parameters, files.flattened(data), "", readers=readers, keys=keys, base=base
    )
    return made


def parameters_to(parameters: Parameters) -> dict[str, Any]:
    """Parameters as nested tables of texts with SI units, every digit kept; those of the five-bar need no ``mechanism``."""
    mechanism = mechanism_of(parameters)
    data: dict[str, Any] = {} if mechanism is FIVE_BAR else {"mechanism": mechanism.name}
    for name, variable in mechanism.mechanism_variables.items():
        value = getattr(parameters, field_name(name))
        group, _, leaf = name.rpartition(".")
        place = data.setdefault(group, {}) if group else data
        place[leaf] = value if variable.kind == "Integer" else with_unit(value, variable.unit)
    return data


def save_parameters(path: str | Path, parameters: Parameters) -> Path:
    """Write parameters to a TOML or JSON file, as the path's ending says."""
    return files.write_tables(path, parameters_to(parameters))


def load_parameters(path: str | Path) -> Parameters:
    """Read parameters from a TOML or JSON file.

    Raises
    ------
    InputError
        If the file cannot be read.
    ParameterError
        As `parameters_from`.
    """
    data = files.read_tables(path)
    mechanism = _mechanism_of(data)
    return parameters_from({k: v for k, v in data.items() if k != "mechanism"}, mechanism=mechanism)


def _mechanism_of(data: Mapping[str, Any], usual: Mechanism = FIVE_BAR) -> Mechanism:
    """The mechanism that a file is about: its ``mechanism``, or else the usual one."""
    return MECHANISMS[Choice(MECHANISMS)(data.get("mechanism", usual.name), "mechanism")]


# Cases

#: Entries of every case file that are not parameters of the mechanism, beside those that say what acts on it.
COMMON = ("mechanism", "title", "published", "initial", "run")
#: Where a case file has what acts on a mechanism: the fields of its inputs by their name in the file, with the unit.
ACTING: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "five-bar": {
        "drive.speed": ("speed", "rad/s"),
        "drive.torque": ("torque", "N.m"),
        "force": ("force", "N"),
        "load.fx": ("load_x", "N"),
        "load.fy": ("load_y", "N"),
    },
    "slider-crank": {
        "drive.speed": ("speed", "rad/s"),
        "drive.torque": ("torque", "N.m"),
        "axial.speed": ("shift_speed", "m/s"),
        "axial.force": ("axial_force", "N"),
        "axial.groove": ("groove", ""),  # true or false
        "load": ("load", "N"),
    },
}
#: Tables of which one entry counts, the way in which a freedom is driven.
EXCLUSIVE = ("drive", "axial")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTable:
    """The table ``[run]``: how long, and how finely."""

    stop_time: float | None = entry(Quantity("s"), None)
    revolutions: float | None = entry(Quantity("1", above=0.0), None)
    step: float | None = entry(Quantity("s"), None)
    tolerance: float = entry(Quantity("1"), 1e-9)

    def times(self, inputs: Channels) -> tuple[float, float]:
        """End of the run and distance of the samples (s), by default three turns at a constant speed, in 360 steps each."""
        constant = isinstance(inputs.speed, (int, float)) and inputs.speed != 0.0
        turn = 2.0 * pi / abs(inputs.speed) if constant else None  # type: ignore[arg-type]
        step = self.step if self.step is not None else 1e-3 if turn is None else turn / 360.0
        if self.stop_time is not None:
            if self.revolutions is not None:
                raise ParameterError("run.revolutions", self.revolutions, "not come together with run.stop_time")
            return self.stop_time, step
        if turn is not None:
            return (3.0 if self.revolutions is None else self.revolutions) * turn, step
        if self.revolutions is None:
            raise MissingParameterError("run.stop_time")
        raise ParameterError(
            "run.revolutions", self.revolutions, "come with a constant drive.speed; give run.stop_time"
        )


def load_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Case:
    """Read a case from a TOML or JSON file; see `docs/case-files.md`.

    Parameters
    ----------
    path : path
    overrides : mapping, optional
        Values by dotted name that replace the file's, such as ``slider.stiffness``, ``drive.speed`` or ``run.stop_time``.

    Raises
    ------
    InputError
        If the file cannot be read or leaves out what a run needs.
    ParameterError
        If a name is unknown or a value is wrong.
    """
    return case_from(files.read_tables(path), folder=Path(path).parent, title=Path(path).stem, overrides=overrides)


def case_from(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> Case:
    """A case from the tables of a case file; ``folder`` is where its CSV tables are looked for."""
    data = files.overridden(data, overrides or {}, exclusive=EXCLUSIVE)
    published = PUBLISHED[Choice(PUBLISHED)(data["published"], "published")] if "published" in data else None
    usual = FIVE_BAR if published is None else mechanism_of(published.parameters)
    mechanism = _mechanism_of(data, usual)
    if published is not None and mechanism is not usual:
        raise ParameterError("mechanism", mechanism.name, f"be that of the published set {data['published']}")
    other = {*COMMON, *(name.partition(".")[0] for name in ACTING[mechanism.name])}
    parameters = parameters_from(
        {name: value for name, value in data.items() if name not in other},
        None if published is None else published.parameters,
        mechanism,
    )
    initial = files.read(
        mechanism.initial,
        data.get("initial", {}),
        "initial",
        readers={name: Quantity(v.unit) for name, v in mechanism.initial_variables.items()},
        # a five-bar's published start is at rest but for the speed, which the drive gives
        base=None if published is None or mechanism is FIVE_BAR else published.initial,
    )
    inputs = _inputs(data, mechanism, folder, None if published is None else published.crank_speed)
    _check_shift(inputs, parameters, initial)
    run = files.read(RunTable, data.get("run", {}), "run")
    stop_time, step = run.times(inputs)
    return Case(
        title=str(data.get("title", title)),
        parameters=parameters,
        initial=initial,
        inputs=inputs,
        stop_time=stop_time,
        step=step,
        tolerance=run.tolerance,
    )


def _inputs(data: Mapping[str, Any], mechanism: Mechanism, folder: Path, speed: float | None) -> Channels:
    """What acts on a mechanism; where nothing is said of the drive the crank turns at ``speed``."""
    acting = ACTING[mechanism.name]
    readers = {name: _reader(unit, folder) for name, (_, unit) in acting.items()}
    found = {name: readers[name](data[name], name) for name in acting if name in data}
    for group in dict.fromkeys(name.partition(".")[0] for name in acting if "." in name):
        inside = {
            name.removeprefix(f"{group}."): reader for name, reader in readers.items() if name.startswith(f"{group}.")
        }
        values: dict[str, Any] = files.read(dict, data.get(group, {}), group, readers=inside)
        if group in EXCLUSIVE and len(values) > 1:
            raise ParameterError(group, ", ".join(data[group]), f"have only one of {', '.join(inside)}")
        found |= {f"{group}.{name}": value for name, value in values.items()}
    if speed is not None and not data.get("drive"):
        found["drive.speed"] = speed
    return INPUTS_OF[mechanism.name](**{acting[name][0]: value for name, value in found.items()})


def _check_shift(inputs: Channels, parameters: Any, initial: Any) -> None:
    """Make sure that what is said of a slider-crank's shift has an effect."""
    if inputs.axial_mode == 2 and parameters.groove_amplitude == 0.0:
        raise ParameterError(
            "groove.amplitude", 0.0, "be given with axial.groove: a groove without it holds the shift at zero"
        )
    if inputs.axial_mode == 1 and not inputs.parts("shift_speed") and initial.shift_velocity:
        raise ParameterError(
            "initial.shift_velocity", initial.shift_velocity, "come with axial.force: the shift is held"
        )


# What acts


def _reader(unit: str, folder: Path) -> Reader:
    """Reader of what acts through one input: a truth value, a signal, or of torques a law or a list of which the sum acts."""
    if not unit:
        return files.flag
    value, values = Quantity(unit), Many(Quantity(unit))
    kinds: dict[str, Reader] = {
        "ramp": Table(ramp, {"start": value, "end": value, "from_time": Quantity("s"), "to_time": Quantity("s")}),
        "table": Table(
            partial(_tabulated, folder, unit),
            {"times": Many(Quantity("s")), "values": values, "file": files.text, "interpolation": files.text},
        ),
        "harmonics": Table(
            _harmonics,
            {
                "mean": value,
                "amplitudes": values,
                "frequencies": Many(Quantity("rad/s")),
                "phases": Many(Quantity("rad")),
            },
        ),
    }
    if unit == "N.m":
        kinds["torsion-bar"] = Table(TorsionBar, {"torque": value, "release_angle": Quantity("rad")})
        motor = {"breakdown_torque": value, "breakdown_slip": Quantity("1"), "synchronous_speed": Quantity("rad/s")}
        kinds["induction-motor"] = Table(InductionMotor, motor)

    def signal(item: Any, name: str) -> Any:
        if not isinstance(item, Mapping):
            return value(item, name)
        if "kind" not in item:
            raise ParameterError(name, ", ".join(item), f"be a quantity, or a table with a kind, of {', '.join(kinds)}")
        return Kinds(kinds)(item, name)

    return Many(signal, single=True) if unit == "N.m" else signal


def _harmonics(
    amplitudes: Sequence[float], frequencies: Sequence[float], mean: float = 0.0, phases: Sequence[float] | None = None
) -> Harmonics:
    phases = [0.0] * len(amplitudes) if phases is None else phases
    return Harmonics(mean, list(amplitudes), list(frequencies), list(phases))


def _tabulated(
    folder: Path,
    unit: str,
    times: Sequence[float] = (),
    values: Sequence[float] = (),
    file: str | None = None,
    interpolation: str = "linear",
) -> Piecewise:
    if file is None:
        return table(times, values, interpolation)
    rows = files.read_csv(folder / file)
    if rows.shape[1] < 2:
        raise InputError(f"{folder / file} must have two columns, time in s and value in {unit}")
    return table(rows[:, 0], rows[:, 1], interpolation)
