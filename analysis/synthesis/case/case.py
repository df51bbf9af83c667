"""Read a synthesis from the tables of a TOML or JSON file, every quantity with its unit; see `docs/synthesis-cases.md`."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from math import pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError

from ... import files
from ...numerics import symbolic
from ...units import quantity
from ..exact.generation import QuickReturn, QuickSwing
from ..linkage import ANGLES, PINS, Kind, MachineSpec, PinForces, pin_forces
from ..result.solution import Solution
from ..search.polish import Search, worst_violation
from ..search.solve import OVER, Synthesis, TradeOff, check_arguments, synthesize, trade_off
from ..task import constraint
from ..task.constraint import DeadCentre, MechanicalAdvantage, NoToggle, Toggle
from ..task.limits import GEARS, limits_by_kind
from ..task.target import evaluate_expression, parse_expression
from ..task.task import Task, normal_form
from .tables import read_plane_points, read_task

FloatArray = NDArray[np.float64]


def _cores(value: Any, name: str) -> int:
    number = files.Whole(-1)(value, name)
    if number == 0:
        raise ParameterError(name, value, "be a number of cores, or -1 for all")
    return number


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTable:
    """The table ``[search]``: kinds of linkages and effort; see `Search` and `synthesize`."""

    seed: int = files.entry(files.Whole(0), 0)
    candidates: int = files.entry(files.Whole(1), 1 << 16)
    starts: int = files.entry(files.Whole(1), 24)
    solutions: int = files.entry(files.Whole(1), 6)
    kinds: tuple[Kind, ...] | None = files.entry(files.Many(files.Choice(get_args(Kind)), least=1), None)
    gears: tuple[float, ...] = files.entry(files.Many(files.Quantity("1"), least=1), GEARS)
    jobs: int = files.entry(_cores, 1)

    def search(self, **changes: Any) -> Search:
        """Return the `Search` that the table describes, with the fields in ``changes`` replaced."""
        own = {name: value for name, value in asdict(self).items() if name not in ("kinds", "gears")}
        return Search(**({"n_jobs": own.pop("jobs")} | own | changes))


_COMPARISONS: Mapping[type[ast.cmpop], tuple[int, bool]] = {
    ast.LtE: (1, False),
    ast.Lt: (1, False),
    ast.GtE: (-1, False),
    ast.Gt: (-1, False),
    ast.Eq: (1, True),
}
_REQUIREMENT_FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log", "hypot")
_MEASURE = re.compile(
    r"(?<![\w.])(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)\s*(um|mm|cm|m|km|in|ft|deg|rad)\b"
)


def requirement(text: Any, name: str = "constraints.require") -> constraint.Require:
    """Convert a text such as ``"crank_length + rocker_length <= 300 mm"`` to a constraint.

    The text compares two sides by ``<=``, ``>=`` or ``==``. A side may contain dimensions by their name in `Linkage`, numbers
    with a unit of length or angle or without a unit (SI), ``+ - * / **``, brackets, ``pi`` and functions, nothing else.

    Raises InputError if the text is not a constraint; the message names the wrong part.
    """
    if not isinstance(text, str):
        raise ParameterError(name, text, "be a text such as 'crank_length <= 50 mm'")
    units, what = {"deg": "rad", "rad": "rad"}, f"the requirement {text!r}"
    plain = _MEASURE.sub(lambda found: repr(quantity(found[0], units.get(found[2], "m"), name)), text)
    tree = parse_expression(plain, "the requirement")
    if not (isinstance(tree, ast.Compare) and len(tree.ops) == 1 and type(tree.ops[0]) in _COMPARISONS):
        raise InputError(f"{what} is no comparison: it must have two sides about <=, >= or ==")
    sign, equal = _COMPARISONS[type(tree.ops[0])]
    sides = (tree.left, tree.comparators[0])[::sign]
    functions = {f: getattr(symbolic.library(), f) for f in _REQUIREMENT_FUNCTIONS}

    def difference(d: Any) -> Any:
        less, more = (evaluate_expression(side, what, {**vars(d), "pi": pi}, functions) for side in sides)
        return less - more

    trial = dict(zip(constraint.UNKNOWNS, np.geomspace(0.1, 0.2, len(constraint.UNKNOWNS)).tolist()))
    if np.isinf(difference(SimpleNamespace(**trial))):
        raise InputError(f"{what} has a number that is too large")
    numbers = [abs(node.value) for node in ast.walk(tree) if isinstance(node, ast.Constant)]  # type: ignore[arg-type]
    scale = float(max(numbers, default=0.0)) or 1.0
    return constraint.Require(function=difference, equal=equal, name=text, scale=scale)


def _transmission(value: Any, name: str) -> float | None:
    if value is False:
        return None
    requirement = "be at least 0 and below 90 deg; a number without a unit is in rad"
    return files.Quantity("rad", least=0.0, below=0.5 * pi, requirement=requirement)(value, name)


def _error(value: Any, name: str) -> Any:
    """Check the greatest error that is allowed while pin forces are minimised: a length, or for a rocker function an angle."""
    try:
        quantity(value, "m", name)
    except ParameterError:
        # for a rocker function
        quantity(value, "rad", name)
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraints:
    """The table ``[constraints]`` of a case file; false in ``least_transmission_angle`` is read as None.

    Attributes
    ----------
    least_transmission_angle : float
        Least transmission angle; 0 only requires that the crank turns fully, false requires nothing.
    over : "turn" or "task"
        Where the transmission angle is bounded: over a turn, or only during the task.
    full_turn : bool
        Whether the crank must turn fully.
    grashof : str
        Required Grashof type of the four-bar.
    stroke : (float, float)
        Bounds of the travel of a slider-crank's slider.
    largest_link : float
        Greatest length of the links, and greatest distance of the coupler point from B.
    assembly : int
        1 if C must lie to the left of B -> D, -1 if to the right.
    pivot_A, pivot_D : list
        Corners [[x, y], ...] of a polygon in which the pivot must lie.
    time_ratio : (float, float)
        Bounds of the time ratio: duration of a crank-rocker's slow swing divided by the duration of its quick swing.
    least_mechanical_advantage, greatest_mechanical_advantage : float
        Bounds of the mechanical advantage: torque on the rocker divided by torque on the crank.
    mechanical_advantage_at : list
        Crank rotations at which the bounds of the mechanical advantage hold; by default everywhere.
    dead_centre_stretched, dead_centre_folded : (float, float)
        Crank rotation, or range of crank rotations, at which crank and coupler are in line.
    toggle_stretched, toggle_folded : (float, float)
        Crank rotation, or range of crank rotations, at which coupler and rocker are in line.
    no_toggle : (float, float)
        Crank rotations between which there is no toggle.
    max_pin_force : float
        Greatest force on any pin, at the speed and under the load of the table ``[make]``.
    least_pin_force_within : float
        Bound of the greatest error of the linkage, while the greatest pin force is minimised.
    pins : str
        Letters of the pins whose forces count.
    require : list
        Comparisons of dimensions, such as ["crank_length >= 0.2*ground_length"].
    """

    least_transmission_angle: float | None = files.entry(_transmission, constraint.LeastTransmission().angle)
    over: str | None = files.entry(files.Choice(("turn", "task")), None)
    full_turn: bool = files.entry(files.flag, False)
    grashof: constraint.GrashofType | None = files.entry(files.Choice(get_args(constraint.GrashofType)), None)
    time_ratio: tuple[float, float] | None = files.entry(files.Range(files.Quantity("1", least=1.0)), None)
    stroke: tuple[float, float] | None = files.entry(files.Range(files.Quantity("m", least=0.0)), None)
    largest_link: float | None = files.entry(files.Quantity("m"), None)
    assembly: int | None = files.entry(files.Whole(), None)
    pivot_A: FloatArray | None = files.entry(read_plane_points, None)
    pivot_D: FloatArray | None = files.entry(read_plane_points, None)
    least_mechanical_advantage: float | None = files.entry(files.Quantity("1", least=0.0), None)
    greatest_mechanical_advantage: float | None = files.entry(files.Quantity("1", above=0.0), None)
    mechanical_advantage_at: tuple[float, ...] | None = files.entry(
        files.Many(files.Quantity("rad"), single=True), None
    )
    dead_centre_stretched: tuple[float, float] | None = files.entry(files.Range(files.Quantity("rad")), None)
    dead_centre_folded: tuple[float, float] | None = files.entry(files.Range(files.Quantity("rad")), None)
    toggle_stretched: tuple[float, float] | None = files.entry(files.Range(files.Quantity("rad")), None)
    toggle_folded: tuple[float, float] | None = files.entry(files.Range(files.Quantity("rad")), None)
    no_toggle: tuple[float, float] | None = files.entry(files.Range(files.Quantity("rad")), None)
    max_pin_force: float | None = files.entry(files.Quantity("N", above=0.0), None)
    least_pin_force_within: Any = files.entry(_error, None)
    pins: str | None = files.entry(files.text, None)
    require: tuple[constraint.Constraint, ...] = files.entry(files.Many(requirement), ())

    def __post_init__(self) -> None:
        for name, carriers in (
            ("over", ("least_transmission_angle",)),
            ("pins", ("max_pin_force", "least_pin_force_within")),
            ("mechanical_advantage_at", ("least_mechanical_advantage", "greatest_mechanical_advantage")),
        ):
            value = getattr(self, name)
            if value is not None and all(getattr(self, carrier) is None for carrier in carriers):
                raise ParameterError(f"constraints.{name}", value, f"come with {' or '.join(carriers)}")

    def constraints(self) -> tuple[constraint.Constraint, ...]:
        """Return the constraints of the table.

        If ``over`` is not given, the transmission angle is bounded over a turn or, if the crank of the required Grashof type
        cannot turn fully, only over the task.
        """
        swings = self.grashof in ("double-rocker", "rocker-crank", "triple-rocker")
        over: Any = self.over or ("task" if swings else "turn")
        pins = PINS if self.pins is None else self.pins
        made: tuple[tuple[Any, Callable[[Any], constraint.Constraint]], ...] = (
            (self.least_transmission_angle, lambda angle: constraint.LeastTransmission(angle=angle, over=over)),
            (self.full_turn or None, lambda _: constraint.FullTurn()),
            (self.grashof, lambda kind: constraint.Grashof(type=kind)),
            (self.time_ratio, lambda ends: constraint.TimeRatio(least=ends[0], greatest=ends[1])),
            (self.stroke, lambda ends: constraint.Stroke(least=ends[0], greatest=ends[1])),
            (self.largest_link, lambda length: constraint.LargestLink(length=length)),
            (self.assembly, lambda branch: constraint.Assembly(branch=branch)),
            (self.pivot_A, lambda corners: constraint.PivotRegion(pivot="A", polygon=corners)),
            (self.pivot_D, lambda corners: constraint.PivotRegion(pivot="D", polygon=corners)),
            (self._advantage(), lambda bounds: MechanicalAdvantage(**bounds)),
            (self.dead_centre_stretched, lambda rotation: DeadCentre(at=rotation)),
            (self.dead_centre_folded, lambda rotation: DeadCentre(at=rotation, position="folded")),
            (self.toggle_stretched, lambda rotation: Toggle(at=rotation)),
            (self.toggle_folded, lambda rotation: Toggle(at=rotation, position="folded")),
            (self.no_toggle, lambda ends: NoToggle(between=ends)),
            (self.max_pin_force, lambda force: constraint.MaxPinForce(force=force, pins=pins)),
            (self.least_pin_force_within, lambda error: constraint.LeastPinForce(error=error, pins=pins)),
        )
        return (*(make(value) for value, make in made if value is not None), *self.require)

    def _advantage(self) -> dict[str, Any] | None:
        """Return the arguments of `MechanicalAdvantage`; None if the table gives no bounds of the mechanical advantage."""
        ends = {"least": self.least_mechanical_advantage, "greatest": self.greatest_mechanical_advantage}
        given = {name: end for name, end in ends.items() if end is not None}
        return {**given, "at": self.mechanical_advantage_at} if given else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TradeOffTable:
    """The table ``[trade_off]``: arguments of `trade_off`.

    Attributes
    ----------
    starts : int
        Number of candidates of the scan from which a search is started, at each limit.
    """

    over: Any = files.entry(files.Choice(OVER))
    limits: tuple[float, ...] = files.entry(files.Many(files.any_value, least=2))
    starts: int = files.entry(files.Whole(1), 12)


#: The table ``[bounds]``: for each dimension [least, greatest], or one value that fixes the dimension.
BOUNDS = files.Table(
    dict,
    {
        name: files.Range(files.Quantity("rad" if name in ANGLES else "m"), ordered=False)
        for name in (*constraint.UNKNOWNS, constraint.SECOND_LENGTH)
    },
)
#: The tables of a case file besides ``[task]``, for `linkwork new`.
TABLES: Mapping[str, type] = {
    "constraints": Constraints,
    "search": SearchTable,
    "make": MachineSpec,
    "trade_off": TradeOffTable,
}


def _constraints(value: Any, name: str) -> tuple[constraint.Constraint, ...]:
    return files.read(Constraints, value, name).constraints()


def _trade_off(value: Any, name: str) -> TradeOffTable:
    over = files.as_table(value, name).get("over")
    limit = files.Quantity(OVER[over].unit if isinstance(over, str) and over in OVER else "m")
    return files.read(TradeOffTable, value, name, readers={"limits": files.Many(limit, least=2)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SynthesisCase:
    """A synthesis described by a case file: task, bounds, constraints, search and trade-off."""

    title: str = files.entry(files.text)
    task: Task = files.entry(files.any_value)
    bounds: Mapping[str, tuple[float, float]] = files.entry(BOUNDS, factory=dict)
    constraints: tuple[constraint.Constraint, ...] = files.entry(_constraints, constraint.USUAL)
    search: SearchTable = files.entry(files.Table(SearchTable), SearchTable())
    make: MachineSpec = files.entry(files.Table(MachineSpec), MachineSpec())
    trade_off: TradeOffTable | None = files.entry(_trade_off, None)

    def __post_init__(self) -> None:
        made = (replace(c, make=self.make) if isinstance(c, constraint.FORCES) else c for c in self.constraints)
        object.__setattr__(self, "constraints", tuple(made))
        # what has no effect, and contradictions, are reported before anything is searched
        over = None if self.trade_off is None else self.trade_off.over
        check_arguments(self.task, self.search.kinds, bounds=self.bounds, gears=self.search.gears, over=over)
        if not isinstance(self.task, QuickReturn | QuickSwing):
            limits_by_kind(
                self.task, normal_form(self.task), self.bounds, self.constraints, self.search.kinds, self.search.gears
            )

    def solve(self, *, progress: bool = False) -> Synthesis:
        """Search for linkages; see `synthesize`."""
        search, (kinds, gears) = self.search.search(progress=progress), (self.search.kinds, self.search.gears)
        return synthesize(self.task, self.bounds, self.constraints, search=search, kinds=kinds, gears=gears)

    def worst_violation(self, solution: Solution) -> str:
        """Return as text the constraint or bound that a linkage violates most and by how much; empty if it violates none.

        The text is also empty for tasks that are solved in closed form.
        """
        closed = isinstance(self.task, QuickReturn | QuickSwing)
        return "" if closed else worst_violation(solution, self.bounds, self.constraints)

    def forces(self, solutions: Sequence[Solution]) -> list[PinForces] | None:
        """Compute the pin forces of solutions; None if no constraint involves pin forces."""
        if not any(isinstance(c, constraint.FORCES) for c in self.constraints):
            return None
        return [pin_forces(s.linkage, self.make, s.rotation_range) for s in solutions]

    def trade(self, *, progress: bool = False) -> TradeOff | None:
        """Compute the trade-off that the case file describes; None if the file describes none. See `trade_off`."""
        wanted = self.trade_off
        if wanted is None:
            return None
        constraints = self.constraints
        if wanted.over == "pin-force" and not any(isinstance(c, constraint.MaxPinForce) for c in constraints):
            constraints = (*constraints, constraint.MaxPinForce(force=max(wanted.limits), make=self.make))
        return trade_off(
            self.task,
            wanted.over,
            np.array(wanted.limits),
            self.bounds,
            constraints,
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
        If the file cannot be read, or an entry is not usable.
    InfeasibleError
        If bounds and constraints contradict one another.
    """
    path = Path(path)
    return read_synthesis_case(files.read_tables(path), folder=path.parent, title=path.stem, overrides=overrides)


def read_synthesis_case(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> SynthesisCase:
    """Read a synthesis from the tables of a case file; names of further files are relative to ``folder``."""
    tables = {"title": title} | files.override(data, overrides or {})
    return files.read(SynthesisCase, tables, "", readers={"task": partial(read_task, folder=folder)})
