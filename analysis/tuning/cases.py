"""A wish from the tables of a TOML or JSON file, every quantity with its unit; see `docs/tuning.md`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linkwork.errors import InputError, MissingParameterError, ParameterError

from ..files import Many, Quantity, Table, as_it_is, entry, flag, overridden, read, read_tables, table_of, text
from ..mechanisms import mechanism_of
from ..periodic import drive_of, speed_name, unit_of
from ..run import case_from
from ..units import with_unit
from .tuned import Tuned
from .wish import Limit, Wish

#: The objective where none is given, and how the other begins.
_LEAST_CHANGE, _LEAST = "least change", "least "


def _objective(value: Any, name: str) -> str:
    """The parameter that is made least; empty for the least change."""
    words = text(value, name)
    if words == _LEAST_CHANGE:
        return ""
    if not words.startswith(_LEAST):
        raise ParameterError(
            name, value, f"be {_LEAST_CHANGE!r}, or {_LEAST!r} and a parameter, as 'least slider.damping'"
        )
    return words.removeprefix(_LEAST).strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneTable:
    """The table ``[tune]``; see `Wish`."""

    speeds: tuple[float, float] = entry(Many(Quantity("rad/s", above=0.0), length=2))
    change: Mapping[str, Any] = entry(table_of)
    no_resonance: bool = entry(flag, False)
    no_jump: bool = entry(flag, False)
    no_unstable: bool = entry(flag, False)
    least_margin: float = entry(Quantity("1", least=0.0), 0.0)
    peak: tuple[Limit, ...] = entry(Many(Table(Limit, {"output": text, "below": as_it_is}), single=True), ())
    objective: str = entry(_objective, "")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TuningCase:
    """What a case file asks for.

    Attributes
    ----------
    title : str
    wish : Wish
    tables : mapping
        The file without what is wished: the mechanism, and what acts on it.
    """

    title: str
    wish: Wish
    tables: Mapping[str, Any]

    def tuned_tables(self, tuned: Tuned) -> dict[str, Any]:
        """The tables of a case with the changed parameters."""
        mechanism = mechanism_of(self.wish.parameters)
        changes = {n: with_unit(v, unit_of(mechanism, n)) for n, v in zip(self.wish.names, tuned.values.tolist())}
        return overridden(self.tables, changes)


def load_tuning_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> TuningCase:
    """Read a case from a TOML or JSON file; see `docs/tuning.md`.

    Raises
    ------
    InputError, ParameterError
        If the file cannot be read, or what it says is not usable.
    """
    path = Path(path)
    return tuning_case_from(read_tables(path), folder=path.parent, title=path.stem, overrides=overrides)


def tuning_case_from(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> TuningCase:
    """A case from the tables of a case file; ``folder`` is where its files are looked for."""
    tables = overridden({"title": title} | dict(data), overrides or {})
    if "tune" not in tables:
        raise MissingParameterError("tune")
    wanted = read(TuneTable, tables.pop("tune"), "tune")
    if isinstance(tables.get("drive"), Mapping) and "torque" in tables["drive"]:
        raise InputError("drive.torque drives the crank: over a range of speeds the speed is prescribed; leave it out")
    speed = with_unit(wanted.speeds[0], "rad/s")
    case = case_from(tables, folder=folder, title=title, overrides={"drive.speed": speed, "run.revolutions": 1})
    if speed_name(mechanism_of(case.parameters)) is None:
        raise InputError("the crank has no prescribed speed: there is no range of speeds")
    wish = Wish(
        parameters=case.parameters,
        drive=drive_of(case.parameters, case.inputs, case.initial),
        speeds=wanted.speeds,
        change=wanted.change,
        no_resonance=wanted.no_resonance,
        no_jump=wanted.no_jump,
        no_unstable=wanted.no_unstable,
        least_margin=wanted.least_margin,
        limits=wanted.peak,
        least=wanted.objective,
    )
    return TuningCase(title=case.title, wish=wish, tables=tables)
