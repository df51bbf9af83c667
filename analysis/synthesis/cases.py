"""A synthesis from the tables of a TOML or JSON file, every quantity with its unit; see `docs/synthesis-cases.md`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from math import pi, remainder, tau
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import ParameterError
from linkwork.five_bar.parameters import FiveBarParameters

from ..files import (
    Choice,
    Many,
    Quantity,
    Range,
    Table,
    Whole,
    as_it_is,
    entry,
    flag,
    overridden,
    read,
    read_tables,
    table_of,
    text,
)
from ..run import parameters_to
from ..units import with_unit
from .case_tasks import points_of, task_from
from .constraints import (
    SECOND_LENGTH,
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
    TimeRatio,
)
from .kinds import GEARS, Kind, Stroke, limits_of_kinds
from .linkage import ANGLES, Linkage
from .quick_return import QuickReturn
from .requirements import requirement
from .search import METHODS, Method, Search
from .solution import Solution
from .solve import Synthesis, TradeOff, synthesize, trade_off
from .tasks import Task, normal_form

FloatArray = NDArray[np.float64]

#: Stiffness of the slider that stands for a fixed pivot: natural frequency (rad/s), or multiples of the crank's speed.
STIFF, STIFF_TURNS = 1000.0, 50.0


def _cores(value: Any, name: str) -> int:
    number = Whole(-1)(value, name)
    if number == 0:
        raise ParameterError(name, value, "be a number of cores, or -1 for all")
    return number


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTable:
    """How it is searched, and among what; see `Search` and `synthesize`."""

    method: Method = entry(Choice(METHODS), "scan")
    seed: int = entry(Whole(0), 0)
    candidates: int = entry(Whole(1), 1 << 16)
    starts: int = entry(Whole(1), 24)
    solutions: int = entry(Whole(1), 6)
    kinds: tuple[Kind, ...] | None = entry(Many(Choice(get_args(Kind)), least=1), None)
    gears: tuple[float, ...] = entry(Many(Quantity("1"), least=1), GEARS)
    jobs: int = entry(_cores, 1)

    def search(self, **changes: Any) -> Search:
        """The same as the argument of `synthesize`, with some of it changed."""
        own = {name: value for name, value in asdict(self).items() if name not in ("kinds", "gears")}
        return Search(**({"n_jobs": own.pop("jobs")} | own | changes))


@dataclass(frozen=True, slots=True, kw_only=True)
class Make:
    """What the linkage is made of, and how fast it runs; see `Linkage.to_five_bar`.

    Attributes
    ----------
    density : float
        kg/m3.
    width, thickness : float
        Of every bar (m).
    pin : float, optional
        Diameter of the holes in the drawing of the plates (m); four tenths of the width by default.
    slider_mass, slider_stiffness, slider_damping : float, optional
        Of the slider that carries D (kg, N/m, N.s/m); by default of a block, held so stiffly that it stands for a fixed pivot.
    slider_coulomb_friction : float
        N.
    gravity : float
        m/s2.
    speed : float
        Of the crank (rad/s).
    """

    density: float = entry(Quantity("kg/m**3", above=0.0), 7850.0)
    width: float = entry(Quantity("m", above=0.0), 0.02)
    thickness: float = entry(Quantity("m", above=0.0), 0.005)
    pin: float | None = entry(Quantity("m", above=0.0), None)
    slider_mass: float | None = entry(Quantity("kg", least=0.0), None)
    slider_stiffness: float | None = entry(Quantity("N/m", least=0.0), None)
    slider_damping: float | None = entry(Quantity("N.s/m", least=0.0), None)
    slider_coulomb_friction: float = entry(Quantity("N", least=0.0), 0.0)
    gravity: float = entry(Quantity("m/s2", least=0.0), 9.81)
    speed: float = entry(Quantity("rad/s", above=0.0), 2.0 * pi)

    @property
    def hole(self) -> float:
        """Diameter of the pins' holes (m)."""
        return 0.4 * self.width if self.pin is None else self.pin

    def describe(self) -> str:
        """Bars and speed in a line, for a sheet."""
        return (
            f"bars {1e3 * self.width:g} x {1e3 * self.thickness:g} mm of {self.density:g} kg/m³, "
            f"pins {1e3 * self.hole:g} mm; forces at {self.speed * 30.0 / pi:g} rpm, gravity {self.gravity:g} m/s²"
        )

    def moving(self, linkage: Linkage) -> FiveBarParameters:
        """Parameters of the plant for a linkage, its slider free to be moved."""
        return linkage.to_five_bar(
            density=self.density,
            section=(self.width, self.thickness),
            slider_mass=self.slider_mass,
            slider_stiffness=self.slider_stiffness or 0.0,
            slider_damping=self.slider_damping or 0.0,
            slider_coulomb_friction=self.slider_coulomb_friction,
            gravity=self.gravity,
        )

    def five_bar(self, solution: Solution) -> FiveBarParameters:
        """Parameters of the plant for a solution, its slider held."""
        free = self.moving(solution.linkage)
        mass = free.slider_mass + free.rocker_mass + free.coupler_mass
        frequency = max(STIFF, STIFF_TURNS * abs(self.speed))
        stiffness = mass * frequency**2 if self.slider_stiffness is None else self.slider_stiffness
        # seven tenths of critical
        damping = 1.4 * (stiffness * mass) ** 0.5 if self.slider_damping is None else self.slider_damping
        return replace(free, slider_stiffness=stiffness, slider_damping=damping)

    def run_case(self, solution: Solution, title: str) -> dict[str, Any]:
        """Tables of a case file that runs the linkage through its task at constant speed; see `docs/case-files.md`."""
        at = solution.evaluation.rotation
        start = (0.0 if at is None else float(at[0])) + solution.linkage.crank_phase
        run: dict[str, Any] = {"revolutions": 2.0}
        if not solution.verdicts.full_turn and at is not None:
            # a crank that cannot turn fully: from the first target to the last
            run = {"stop_time": with_unit(float(np.ptp(at)) / self.speed, "s")}
        return {
            "title": title,
            **parameters_to(self.five_bar(solution)),
            "initial": {"crank_angle": with_unit(remainder(start, tau), "rad")},
            "drive": {"speed": with_unit(direction(solution) * self.speed, "rad/s")},
            "run": run,
        }


def direction(solution: Solution) -> float:
    """The way in which the crank turns over the task: 1 counter-clockwise, -1 clockwise."""
    at = solution.evaluation.rotation
    return -1.0 if at is not None and len(at) > 1 and at[-1] < at[0] else 1.0


def _transmission(value: Any, name: str) -> float | None:
    if value is False:
        return None
    requirement = "be at least 0 and below 90 deg; a number without a unit is in rad"
    return Quantity("rad", least=0.0, below=0.5 * pi, requirement=requirement)(value, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraints:
    """The table ``[constraints]``; a least transmission angle of None asks nothing."""

    least_transmission_angle: float | None = entry(_transmission, LeastTransmission().angle)
    over: str | None = entry(Choice(("turn", "task")), None)
    full_turn: bool = entry(flag, False)
    grashof: GrashofType | None = entry(Choice(get_args(GrashofType)), None)
    time_ratio: tuple[float, float] | None = entry(Range(Quantity("1", least=1.0, requirement="be 1 or greater")), None)
    stroke: tuple[float, float] | None = entry(Range(Quantity("m", least=0.0)), None)
    largest_link: float | None = entry(Quantity("m"), None)
    assembly: int | None = entry(Whole(), None)
    pivot_A: FloatArray | None = entry(points_of, None)
    pivot_D: FloatArray | None = entry(points_of, None)
    require: tuple[Constraint, ...] = entry(Many(requirement), ())

    def constraints(self) -> tuple[Constraint | Stroke, ...]:
        """The constraints; a crank that cannot turn fully is looked at where it works."""
        found: list[Constraint | Stroke] = []
        if self.least_transmission_angle is not None:
            swings = self.grashof in ("double-rocker", "rocker-crank", "triple-rocker")
            over: Any = self.over or ("task" if swings else "turn")
            found.append(LeastTransmission(angle=self.least_transmission_angle, over=over))
        if self.full_turn:
            found.append(FullTurn())
        if self.grashof is not None:
            found.append(Grashof(type=self.grashof))
        if self.time_ratio is not None:
            low, high = self.time_ratio
            found.append(TimeRatio(least=low, greatest=high))
        if self.stroke is not None:
            found.append(Stroke(least=self.stroke[0], greatest=self.stroke[1]))
        if self.largest_link is not None:
            found.append(LargestLink(length=self.largest_link))
        if self.assembly is not None:
            found.append(Assembly(branch=self.assembly))
        if self.pivot_A is not None:
            found.append(PivotRegion(pivot="A", polygon=self.pivot_A))
        if self.pivot_D is not None:
            found.append(PivotRegion(pivot="D", polygon=self.pivot_D))
        return (*found, *self.require)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TradeOffTable:
    """The table ``[trade_off]``: arguments of `trade_off`."""

    over: Any = entry(Choice(("size", "transmission")))
    limits: tuple[float, ...] = entry(Many(as_it_is, least=2))
    starts: int = entry(Whole(1), 12)


#: The table ``[bounds]``: [least, greatest], or one value that fixes the dimension.
BOUNDS = Table(
    dict,
    {name: Range(Quantity("rad" if name in ANGLES else "m"), ordered=False) for name in (*UNKNOWNS, SECOND_LENGTH)},
)


#: The tables of a case beside the task's, for `linkwork new`.
TABLES: Mapping[str, type] = {
    "constraints": Constraints,
    "search": SearchTable,
    "make": Make,
    "trade_off": TradeOffTable,
}


def _constraints(value: Any, name: str) -> tuple[Constraint | Stroke, ...]:
    return read(Constraints, value, name).constraints()


def _trade_off(value: Any, name: str) -> TradeOffTable:
    limit = Quantity("m" if table_of(value, name).get("over") == "size" else "rad")
    return read(TradeOffTable, value, name, readers={"limits": Many(limit, least=2)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SynthesisCase:
    """What a case file asks for."""

    title: str = entry(text)
    task: Task = entry(as_it_is)
    bounds: Mapping[str, tuple[float, float]] = entry(BOUNDS, factory=dict)
    constraints: tuple[Constraint | Stroke, ...] = entry(_constraints, USUAL)
    search: SearchTable = entry(Table(SearchTable), SearchTable())
    make: Make = entry(Table(Make), Make())
    trade_off: TradeOffTable | None = entry(_trade_off, None)

    def __post_init__(self) -> None:
        # contradictions are reported before anything is searched
        if not isinstance(self.task, QuickReturn):
            limits_of_kinds(
                self.task, normal_form(self.task), self.bounds, self.constraints, self.search.kinds, self.search.gears
            )

    def solve(self, *, progress: bool = False) -> Synthesis:
        """Search; see `synthesize`."""
        search, (kinds, gears) = self.search.search(progress=progress), (self.search.kinds, self.search.gears)
        return synthesize(self.task, self.bounds, self.constraints, search=search, kinds=kinds, gears=gears)

    def trade(self, *, progress: bool = False) -> TradeOff | None:
        """The trade-off that is asked for, if any; see `trade_off`."""
        wanted = self.trade_off
        if wanted is None:
            return None
        return trade_off(
            self.task,
            wanted.over,
            np.array(wanted.limits),
            self.bounds,
            self.constraints,
            search=Search(seed=self.search.seed, starts=wanted.starts, n_jobs=self.search.jobs, progress=progress),
            kinds=self.search.kinds,
            gears=self.search.gears,
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
    tables = {"title": title} | overridden(data, overrides or {})
    return read(SynthesisCase, tables, "", readers={"task": partial(task_from, folder=folder)})
