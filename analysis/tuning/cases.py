"""Read and write case files of a tuning: TOML or JSON tables, every quantity with its unit; see `docs/tuning.md`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from linkwork.errors import InputError, MissingParameterError, ParameterError

from ..files import Many, Quantity, Table, Whole, any_value, as_table, entry, flag, override, read, read_tables, text
from ..linkages import with_linkage
from ..mechanisms import find_mechanism, name_in_files
from ..periodic import default_variable, parameter_unit, rest_guess, steady_drive
from ..run import case_mechanism, read_case, with_case_file_names
from ..units import with_unit
from .result import Tuned
from .wishes import Limit, Wish, require_free

#: The default objective, and the first word of an objective that names a parameter.
_LEAST_CHANGE, _LEAST = "least change", "least "


def _objective(value: Any, name: str) -> str:
    """Check the text of an objective, "least change" or "least" followed by the name of a parameter, and return the text."""
    words = text(value, name)
    if words != _LEAST_CHANGE and not words.startswith(_LEAST):
        raise ParameterError(
            name, value, f"be {_LEAST_CHANGE!r}, or {_LEAST!r} and a parameter, such as 'least slider.damping'"
        )
    return words


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneTable:
    """The table ``[tune]`` of a case file; see `Wish`.

    Attributes
    ----------
    change : mapping
        Parameters that may be changed, and how far: "5 %", "10 N/m", or ["1 kg", "3 kg"]
    peak : tuple of Limit
        Limits of outputs: { output = "pin.C", below = "14 N" }
    objective : str
        Quantity to be minimised: "least change", or a parameter, as in "least slider.damping"
    """

    change: Mapping[str, Any] = entry(as_table)
    speeds: tuple[float, float] | None = entry(Many(Quantity("rad/s", above=0.0), length=2), None)
    over: str = entry(text, "")
    between: tuple[Any, Any] | None = entry(Many(any_value, length=2), None)
    turns: int = entry(Whole(least=1), 1)
    no_resonance: bool = entry(flag, False)
    resonance_margin: float = entry(Quantity("1", least=0.0), 0.02)
    no_jump: bool = entry(flag, False)
    no_unstable: bool = entry(flag, False)
    least_margin: float = entry(Quantity("1", least=0.0), 0.0)
    peak: tuple[Limit, ...] = entry(Many(Table(Limit, {"output": text, "below": any_value}), single=True), ())
    objective: str = entry(_objective, _LEAST_CHANGE)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TuningCase:
    """A case file of a tuning.

    Attributes
    ----------
    title : str
    wish : Wish
    tables : mapping
        The tables of the file without ``[tune]``: the mechanism and its inputs.
    folder : path
        Folder to which the names of files in the case are relative.
    """

    title: str
    wish: Wish
    tables: Mapping[str, Any]
    folder: Path

    def tuned_tables(self, tuned: Tuned, folder: str | Path) -> dict[str, Any]:
        """Return the tables of a case with the tuned values; file names in the tables become relative to ``folder``."""
        mechanism = find_mechanism(self.wish.parameters)
        inputs = {channel.name: name_in_files(mechanism, channel) for channel in mechanism.channels}
        values = zip(self.wish.names, tuned.values.tolist())
        changes = {inputs.get(name, name): with_unit(value, parameter_unit(mechanism, name)) for name, value in values}
        if isinstance(own := self.tables.get("linkage"), str):
            changes["linkage"] = Path(os.path.relpath(self.folder / own, folder)).as_posix()
        return override(with_case_file_names(self.tables, mechanism), changes)


def load_tuning_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> TuningCase:
    """Read a tuning case from a TOML or JSON file; see `docs/tuning.md`.

    Raises
    ------
    InputError, ParameterError
        If the file cannot be read, or an entry is not usable.
    """
    return read_tuning_case(read_tables(path), folder=Path(path).parent, title=Path(path).stem, overrides=overrides)


def read_tuning_case(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> TuningCase:
    """Build a case from the tables of a case file; file names in the tables are relative to ``folder``."""
    tables = override({"title": title} | dict(data), overrides or {})
    if "tune" not in tables:
        raise MissingParameterError("tune")
    wanted = read(TuneTable, tables.pop("tune"), "tune")
    overrides, linked = {"run": {"stop_time": 1.0}}, with_linkage(tables, folder)
    if wanted.speeds is not None:
        if isinstance(linked.get("drive"), Mapping) and "torque" in linked["drive"]:
            raise InputError(
                "drive.torque drives the crank, so that its speed follows: leave out tune.speeds and give what "
                "is set, such as over = 'drive.torque' and between = ['0.1 N*m', '0.2 N*m']; or leave out drive.torque"
            )
        overrides[default_variable(case_mechanism(linked))] = with_unit(wanted.speeds[0], "rad/s")
    case = read_case(linked, folder=folder, title=title, overrides=overrides)
    drive = steady_drive(case.parameters, case.inputs, case.initial)
    require_free(find_mechanism(case.parameters), drive)
    wish = Wish(
        parameters=case.parameters,
        drive=drive,
        start=rest_guess(case.parameters, drive, case.initial),
        limits=wanted.peak,
        least="" if wanted.objective == _LEAST_CHANGE else wanted.objective.removeprefix(_LEAST).strip(),
        **{
            field.name: getattr(wanted, field.name)
            for field in fields(wanted)
            if field.name not in ("peak", "objective")
        },
    )
    return TuningCase(title=case.title, wish=wish, tables=tables, folder=folder)
