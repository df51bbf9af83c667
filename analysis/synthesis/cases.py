"""A synthesis from the tables of a TOML or JSON file, every quantity with its unit; see `docs/synthesis-cases.md`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite, pi, remainder, tau
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import MissingParameterError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters

from ..files.io import check_names, parameters_to, quantity, read_tables, unknown_name
from .case_tasks import flag, given, list_of, listed, one_of, pairs, section, task_from, whole
from .constraints import (
    UNKNOWNS,
    USUAL,
    Assembly,
    Constraint,
    FullTurn,
    Grashof,
    GrashofType,
    LargestLink,
    LeastTransmission,
    PivotRegion,
    limits_of,
)
from .linkage import ANGLES
from .requirements import requirement
from .search import METHODS, Search
from .solution import Solution
from .solve import Synthesis, TradeOff, synthesize, trade_off
from .tasks import Task, normal_form

FloatArray = NDArray[np.float64]

#: Tables of a case file.
TABLES = ("title", "task", "bounds", "constraints", "search", "make", "trade_off")
#: Stiffness of the slider that stands for a fixed pivot: natural frequency (rad/s), or multiples of the crank's speed.
STIFF, STIFF_TURNS = 1000.0, 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Make:
    """What the linkage is made of, and how fast it runs; see `Linkage.to_five_bar`.

    Attributes
    ----------
    density : float
        kg/m3.
    width, thickness : float
        Of every bar (m).
    slider_mass, slider_stiffness, slider_damping : float, optional
        Of the slider that carries D (kg, N/m, N.s/m); by default of a block, held so stiffly that it stands for a fixed pivot.
    slider_coulomb_friction : float
        N.
    gravity : float
        m/s2.
    speed : float
        Of the crank (rad/s).
    """

    density: float = 7850.0
    width: float = 0.02
    thickness: float = 0.005
    slider_mass: float | None = None
    slider_stiffness: float | None = None
    slider_damping: float | None = None
    slider_coulomb_friction: float = 0.0
    gravity: float = 9.81
    speed: float = 2.0 * pi

    def five_bar(self, solution: Solution) -> FiveBarParameters:
        """Parameters of the plant for a solution, its slider held."""
        free = solution.to_five_bar(
            density=self.density,
            section=(self.width, self.thickness),
            slider_mass=self.slider_mass,
            slider_coulomb_friction=self.slider_coulomb_friction,
            gravity=self.gravity,
        )
        mass = free.slider_mass + free.rocker_mass + free.coupler_mass
        frequency = max(STIFF, STIFF_TURNS * abs(self.speed))
        stiffness = mass * frequency**2 if self.slider_stiffness is None else self.slider_stiffness
        # seven tenths of critical
        damping = 1.4 * (stiffness * mass) ** 0.5 if self.slider_damping is None else self.slider_damping
        return replace(free, slider_stiffness=stiffness, slider_damping=damping)

    def run_case(self, solution: Solution, title: str) -> dict[str, Any]:
        """Tables of a case file that runs the linkage through its task at constant speed; see `docs/case-files.md`."""
        at = solution.evaluation.rotation
        backwards = at is not None and len(at) > 1 and at[-1] < at[0]
        start = (0.0 if at is None else float(at[0])) + solution.linkage.crank_phase
        run: dict[str, Any] = {"revolutions": 2.0}
        if not solution.verdicts.full_turn and at is not None:
            # a crank that cannot turn fully: from the first target to the last
            run = {"stop_time": f"{float(np.ptp(at)) / self.speed!r} s"}
        return {
            "title": title,
            **parameters_to(self.five_bar(solution)),
            "initial": {"crank_angle": f"{remainder(start, tau)!r} rad"},
            "drive": {"speed": f"{-self.speed if backwards else self.speed!r} rad/s"},
            "run": run,
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TradeOffWanted:
    """Arguments of `trade_off`."""

    over: str
    limits: FloatArray
    starts: int = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SynthesisCase:
    """What a case file asks for."""

    title: str
    task: Task
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    constraints: tuple[Constraint, ...] = USUAL
    search: Search = field(default_factory=Search)
    make: Make = field(default_factory=Make)
    trade_off: TradeOffWanted | None = None

    def __post_init__(self) -> None:
        # contradictions are told before anything is searched
        limits_of(self.task, normal_form(self.task), self.bounds, self.constraints)

    def solve(self, *, progress: bool = False) -> Synthesis:
        """Search; see `synthesize`."""
        search = replace(self.search, progress=progress)
        return synthesize(self.task, self.bounds, self.constraints, search=search)

    def trade(self, *, progress: bool = False) -> TradeOff | None:
        """The trade-off that is asked for, if any; see `trade_off`."""
        wanted = self.trade_off
        if wanted is None:
            return None
        return trade_off(
            self.task,
            wanted.over,  # type: ignore[arg-type]
            wanted.limits,
            self.bounds,
            self.constraints,
            search=Search(seed=self.search.seed, starts=wanted.starts, n_jobs=self.search.n_jobs, progress=progress),
        )


def load_synthesis_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> SynthesisCase:
    """Read a synthesis from a TOML or JSON file; see `docs/synthesis-cases.md`.

    Parameters
    ----------
    path : path
    overrides : mapping, optional
        Values by dotted name that replace the file's, such as ``constraints.largest_link`` or ``search.seed``.

    Raises
    ------
    InputError, ParameterError
        If the file cannot be read, or what it says is not usable.
    InfeasibleError
        If bounds and constraints contradict one another.
    """
    path = Path(path)
    return synthesis_case_from(read_tables(path), folder=path.parent, title=path.stem, overrides=overrides)


def synthesis_case_from(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> SynthesisCase:
    """A synthesis from the tables of a case file; ``folder`` is where its files are looked for."""
    data = overridden(data, overrides or {})
    for name in data:
        if name not in TABLES:
            raise unknown_name(name, TABLES)
    if "task" not in data:
        raise MissingParameterError("task")
    wanted = data.get("trade_off")
    return SynthesisCase(
        title=str(data.get("title", title)),
        task=task_from(section(data, "task"), folder),
        bounds=bounds_from(section(data, "bounds")),
        constraints=constraints_from(section(data, "constraints")),
        search=search_from(section(data, "search")),
        make=make_from(section(data, "make")),
        trade_off=None if wanted is None else _trade_off(section(data, "trade_off")),
    )


def overridden(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with single values replaced, by dotted name of any depth."""
    result: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in data.items()}
    for name, value in overrides.items():
        *groups, leaf = name.split(".")
        place = result
        for depth, group in enumerate(groups, start=1):
            inner = place.get(group, {})
            if not isinstance(inner, Mapping):
                raise ParameterError(".".join(groups[:depth]), inner, "be a table")
            place[group] = dict(inner)
            place = place[group]
        place[leaf] = value
    return result


# Bounds and constraints


def bounds_from(table: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Bounds of a table ``[bounds]``: [least, greatest], or one value that fixes the dimension."""
    bounds: dict[str, tuple[float, float]] = {}
    for name, value in table.items():
        if name not in UNKNOWNS:
            raise unknown_name(f"bounds.{name}", [f"bounds.{n}" for n in UNKNOWNS])
        unit = "rad" if name in ANGLES else "m"
        ends = value if isinstance(value, list) else [value, value]
        if len(ends) != 2:
            raise ParameterError(f"bounds.{name}", value, "be one value, or two: [least, greatest]")
        low, high = (quantity(end, unit, f"bounds.{name}") for end in ends)
        bounds[name] = low, high
    return bounds


#: Names in the table ``[constraints]``.
CONSTRAINTS = (
    "least_transmission_angle",
    "over",
    "full_turn",
    "grashof",
    "largest_link",
    "assembly",
    "pivot_A",
    "pivot_D",
    "require",
)


def constraints_from(table: Mapping[str, Any]) -> tuple[Constraint, ...]:
    """Constraints of a table ``[constraints]``; 40 degrees over a full turn where no transmission angle is given."""
    check_names(table, "constraints", CONSTRAINTS)
    found: list[Constraint] = []
    angle = table.get("least_transmission_angle", LeastTransmission().angle)
    # a crank that cannot turn fully is looked at where it works
    swings = table.get("grashof") in ("double-rocker", "rocker-crank", "triple-rocker")
    over = one_of(table.get("over", "task" if swings else "turn"), "constraints.over", ("turn", "task"))
    if angle is not False:
        name = "constraints.least_transmission_angle"
        value = quantity(angle, "rad", name)
        if not 0.0 <= value < 0.5 * pi:
            raise ParameterError(name, angle, "be at least 0 and below 90 deg; a number without a unit is in rad")
        found.append(LeastTransmission(angle=value, over=over))  # type: ignore[arg-type]
    if flag(table.get("full_turn", False), "constraints.full_turn"):
        found.append(FullTurn())
    if "grashof" in table:
        found.append(Grashof(type=one_of(table["grashof"], "constraints.grashof", get_args(GrashofType))))  # type: ignore[arg-type]
    if "largest_link" in table:
        found.append(LargestLink(length=quantity(table["largest_link"], "m", "constraints.largest_link")))
    if "assembly" in table:
        found.append(Assembly(branch=whole(table["assembly"], "constraints.assembly")))
    for pivot in ("A", "D"):
        if f"pivot_{pivot}" in table:
            corners = pairs(table[f"pivot_{pivot}"], f"constraints.pivot_{pivot}")
            found.append(PivotRegion(pivot=pivot, polygon=corners))
    found += [requirement(text) for text in listed(table.get("require", []), "constraints.require")]
    return tuple(found)


# The rest

#: Names in the table ``[search]``.
SEARCH = ("method", "seed", "candidates", "starts", "solutions", "jobs")


def search_from(table: Mapping[str, Any]) -> Search:
    """How it is searched, of a table ``[search]``."""
    check_names(table, "search", SEARCH)
    values: dict[str, Any] = {
        name: whole(value, f"search.{name}", {"seed": 0, "jobs": -1}.get(name, 1))
        for name, value in table.items()
        if name != "method"
    }
    if values.get("jobs") == 0:
        raise ParameterError("search.jobs", 0, "be a number of cores, or -1 for all")
    if "jobs" in values:
        values["n_jobs"] = values.pop("jobs")
    if "method" in table:
        values["method"] = one_of(table["method"], "search.method", METHODS)
    return Search(**values)


_MAKE = {
    "density": "kg/m**3",
    "width": "m",
    "thickness": "m",
    "slider_mass": "kg",
    "slider_stiffness": "N/m",
    "slider_damping": "N.s/m",
    "slider_coulomb_friction": "N",
    "gravity": "m/s2",
    "speed": "rad/s",
}


def make_from(table: Mapping[str, Any]) -> Make:
    """What the linkage is made of, of a table ``[make]``."""
    check_names(table, "make", _MAKE)
    values = {name: quantity(value, _MAKE[name], f"make.{name}") for name, value in table.items()}
    for name, value in values.items():
        above = name in ("density", "width", "thickness", "speed")
        if not isfinite(value) or value < 0.0 or (above and value == 0.0):
            raise ParameterError(
                f"make.{name}", table[name], f"be {'greater than zero' if above else 'zero or greater'}"
            )
    return Make(**values)


def _trade_off(table: Mapping[str, Any]) -> TradeOffWanted:
    check_names(table, "trade_off", ("over", "limits", "starts"))
    over = one_of(given(table, "over", "trade_off"), "trade_off.over", ("size", "transmission"))
    limits = list_of(given(table, "limits", "trade_off"), "m" if over == "size" else "rad", "trade_off.limits")
    if len(limits) < 2:
        raise ParameterError("trade_off.limits", table["limits"], "be at least two")
    return TradeOffWanted(over=over, limits=limits, starts=whole(table.get("starts", 12), "trade_off.starts", 1))
