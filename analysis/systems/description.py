"""Read a system from a file that describes parts, connections and a run, and build its FMUs and their wiring."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

from linkwork import __version__
from linkwork.errors import ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import fmi_name

from .. import files
from ..export import NATIVE, NATIVE_FMI3, SOURCES, build_controller, build_native
from ..export.controllers import CONTROLLERS, UNITS
from ..files import Quantity, Table, entry, unknown_name
from ..linkages import load_linkage
from ..mechanisms import find_mechanism
from ..numerics.cache import code_folder
from ..run import Case, Inputs, published_case, read_case
from ..units import quantity
from .wiring import End, Part, Wiring, WiringError

HERE = resources.files(__package__)
#: Described linkages that can be connected to mechanisms.
PARTNERS = ("induction-motor", "flywheel-gear", "line-shaft", "press-load")


def _flat_table(value: Any, name: str) -> dict[str, Any]:
    """Return the table ``value`` with nested tables replaced by entries with dotted names; ``name`` is for messages."""
    return files.flatten(files.as_table(value, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class PartTable:
    """Table of a part of a system: a case, a partner, a controller or an FMU, and start values.

    Attributes
    ----------
    case : str
        A published set, or a case file or linkage file: it gives the parameters and the initial state.
    partner : str
        One of `PARTNERS`.
    controller : str
        One of `CONTROLLERS`.
    fmu : str
        An FMU of FMI 2.0 or 3.0, from any tool.
    values : mapping
        Start values of parameters and inputs, by FMI name: texts with units, or numbers in SI; for an FMU only numbers, in the
        units of its variables. A list with the name ``table`` sets ``table_0``, ``table_1`` and so on, but not for an FMU.
    """

    case: str = entry(files.text, "")
    partner: str = entry(files.Choice(PARTNERS), "")
    controller: str = entry(files.Choice(CONTROLLERS), "")
    fmu: str = entry(files.text, "")
    values: Mapping[str, Any] = entry(_flat_table, factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTable:
    """Stop time and communication step of a run (s)."""

    stop_time: float = entry(Quantity("s", above=0.0), 1.0)
    step: float = entry(Quantity("s", above=0.0), 1e-3)


def _parts(value: Any, name: str) -> dict[str, PartTable]:
    return {key: files.read(PartTable, v, f"{name}.{key}") for key, v in files.as_table(value, name).items()}


def _connections(value: Any, name: str) -> dict[End, End]:
    def read_end(text: str, target: str) -> End:
        part, _, port = text.partition(".")
        if not (part and port):
            raise ParameterError(f"{name}.{target}", text, "be a part and its variable, as in motor.rotor.speed")
        return End(part, port)

    ends = _flat_table(value, name).items()
    return {read_end(t, t): read_end(files.text(source, f"{name}.{t}"), t) for t, source in ends}


@dataclass(frozen=True, kw_only=True)
class System:
    """A system of connected parts, as a file describes it.

    Attributes
    ----------
    title : str
    parts : mapping of str to PartTable
    connections : mapping of End to End
        For each connected input, the output to which it is connected.
    run : RunTable
    folder : path
        Folder to which file names are relative.
    """

    title: str = entry(files.text, "")
    parts: Mapping[str, PartTable] = entry(_parts)
    connections: Mapping[End, End] = entry(_connections, factory=dict)
    run: RunTable = entry(Table(RunTable), factory=RunTable)
    folder: Path = entry(files.any_value, Path())

    @cached_property
    def members(self) -> dict[str, Member]:
        """Return the parts by name, with their mechanisms and start values."""
        return {name: self._member(name, table) for name, table in self.parts.items()}

    def _member(self, name: str, table: PartTable) -> Member:
        kinds = [k for k in ("case", "partner", "controller", "fmu") if getattr(table, k)]
        if len(kinds) != 1:
            raise WiringError(f"parts.{name} has {' and '.join(kinds) or 'nothing'}: it must have one of case, partner, "
                              "controller and fmu")  # fmt: skip
        where = f"parts.{name}.values"
        if table.fmu:
            values = {key: _number(value, f"{where}.{key}") for key, value in table.values.items()}
            return Member(name=name, values=values, fmu=self.folder / table.fmu)
        if table.controller:
            rows = {row.name: row.unit for row in CONTROLLERS[table.controller].rows} | {"sample_time": "s"}
            return Member(name=name, values=_read_values(table.values, rows, where), controller=table.controller)
        case = self._case(table)
        mechanism = find_mechanism(case.parameters)
        inputs = self._inputs(name, mechanism, case.inputs)
        values = {fmi_name(key): float(value) for key, value in asdict(case.parameters).items()}
        values |= {f"initial.{key}": float(value) for key, value in asdict(case.initial).items()}
        units = {v.name: v.unit or "1" for v in mechanism.variables if v.causality in ("parameter", "input")}
        values |= inputs | self._modes(name, mechanism, case.inputs) | _read_values(table.values, units, where)
        return Member(name=name, values=values, mechanism=mechanism)

    def _case(self, table: PartTable) -> Case:
        """Return the case of a part."""
        if table.partner:
            made = load_linkage(Path(str(HERE / "partners" / f"{table.partner}.toml")))
            return published_case(made.name)
        if Path(table.case).suffix in (".toml", ".json"):
            # the stop time of the case itself is not used, and may be missing
            tables = files.read_tables(self.folder / table.case) | {"run": {"stop_time": self.run.stop_time}}
            return read_case(tables, folder=(self.folder / table.case).parent)
        return published_case(table.case)

    def _inputs(self, name: str, mechanism: Mechanism, inputs: Inputs) -> dict[str, float]:
        """Return the constant inputs of a part's case; refuse an input that varies unless something replaces it.

        It is replaced by a connection or a start value of the input itself, or of another input that drives the same freedom.
        """
        here = {end.port for end in self.connections if end.part == name} | set(self.parts[name].values)
        driven = {c.freedom for c in mechanism.channels if c.name in here and c.freedom >= 0}
        found = {}
        for channel in mechanism.channels:
            if channel.kind == "rate" or channel.argument not in inputs:
                continue
            replaced = channel.freedom in driven and mechanism.freedoms[channel.freedom].mode is not None
            if value := inputs.constants([channel.argument]):
                found[channel.name] = value[0]
            elif channel.name not in here and not replaced:
                raise WiringError(
                    f"parts.{name}: {channel.name} of its case is not constant: connect it, or give a constant in "
                    f"parts.{name}.values"
                )
        return found

    def _modes(self, name: str, mechanism: Mechanism, inputs: Inputs) -> dict[str, float]:
        """Return the drive mode of each freedom.

        It is the mode of the connected input; if none is connected, that of the input with a start value; if none has one,
        that of the case.
        """
        found = {mode: float(value) for mode, value in inputs.modes(mechanism).items()}
        for number, freedom in enumerate(mechanism.freedoms):
            if freedom.mode is None:
                continue
            channels = [c for c in mechanism.channels if c.freedom == number and c.argument in freedom.mode.arguments]
            wired = [c for c in channels if End(name, c.name) in self.connections]
            if len(wired) > 1:
                both = " and ".join(c.name for c in wired)
                raise WiringError(f"parts.{name}: {both} are both connected: only one may drive {freedom.coordinate}")
            if driven := wired or [c for c in channels if c.name in self.parts[name].values]:
                found[freedom.mode.name] = float(freedom.mode.arguments.index(driven[0].argument))
        return found

    def wiring(self, *, fmi: int = 2) -> Wiring:
        """Build the FMUs of the system in the user's cache, and return the wiring.

        Parameters
        ----------
        fmi : int
            Version of FMI of the mechanisms and partners, 2 or 3; controllers always have FMI 2.0.

        Raises
        ------
        BuildError
            If an FMU cannot be built.
        WiringError, UnknownNameError
            If a connection is not valid.
        """
        place = code_folder("systems")
        parts = {name: Part.from_fmu(name, m.build(place, fmi), m.values) for name, m in self.members.items()}
        return Wiring(
            title=self.title,
            parts=parts,
            connections=self.connections,
            stop_time=self.run.stop_time,
            step=self.run.step,
        )

    def without_rates(self) -> System:
        """Return the system without the connections of inputs that are rates of commanded speeds."""
        rates = {
            End(name, channel.name)
            for name, member in self.members.items()
            if member.mechanism is not None
            for channel in member.mechanism.channels
            if channel.kind == "rate"
        }
        return replace(self, connections={t: s for t, s in self.connections.items() if t not in rates})


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A part: its mechanism, controller or FMU, and its start values (SI; for an FMU, in the units of its variables)."""

    name: str
    values: Mapping[str, float]
    mechanism: Mechanism | None = None
    controller: str = ""
    fmu: Path | None = None

    def build(self, folder: Path, fmi: int = 2) -> Path:
        """Build the FMU of the part below ``folder`` unless it exists; return its path. A part that is an FMU is not built."""
        kinds = {2: NATIVE, 3: NATIVE_FMI3}
        if fmi not in kinds:
            raise ParameterError("fmi", fmi, "be 2 or 3")
        if self.fmu is not None:
            return self.fmu
        if self.mechanism is None:
            return build_controller(self.controller, folder)
        shell = sorted((SOURCES / "native").glob("*.[ch]"))
        sources = [*(Path(str(module.__file__)) for module in self.mechanism.modules), *shell]
        texts = [*(path.read_text(encoding="utf-8") for path in sources), __version__]
        key = hashlib.sha256("\0".join(texts).encode()).hexdigest()[:8]
        target = folder / key / kinds[fmi].file_name(self.mechanism)
        return target if target.is_file() else build_native(self.mechanism, kinds[fmi], target.parent)


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(name, value, "be a number in the unit of the variable")
    return float(value)


def _read_values(values: Mapping[str, Any], units: Mapping[str, str], where: str) -> dict[str, float]:
    """Return values by FMI name, in the units of the variables; a list sets ``name_0``, ``name_1`` and so on."""
    values = dict(values)
    for key in [key for key, value in values.items() if isinstance(value, list)]:
        names = [name for name in units if re.fullmatch(re.escape(key) + r"_\d+", name)]
        if len(names) != len(values[key]):
            raise ParameterError(f"{where}.{key}", f"{len(values[key])} values", f"have {len(names) or 'one'}")
        values |= zip(names, values.pop(key), strict=True)
    for key in values:
        if key not in units:
            raise unknown_name(key, units, f"variable {key}, named in {where}")

    def convert(value: Any, unit: str, name: str) -> float:
        # values with other than mechanical units, which controllers have, are given in SI
        electric = {"A", "N/(m.s)"} & set(UNITS.get(unit, {unit: 1}))
        return _number(value, name) if electric else quantity(value, unit, name)

    return {key: convert(value, units[key], f"{where}.{key}") for key, value in values.items()}


def load_system(path: str | Path) -> System:
    """Read a system from a TOML file.

    Raises
    ------
    InputError, ParameterError
        If the file cannot be read, or an entry is wrong.
    """
    return replace(files.read(System, files.read_tables(path), ""), folder=Path(path).parent)


def library() -> dict[str, Path]:
    """Return the systems that come with Linkwork, by name."""
    return {Path(str(path)).stem: Path(str(path)) for path in sorted((HERE / "library").iterdir(), key=str)}
