"""The motion of a slider from the tables of a TOML or JSON file, every quantity with its unit; see `docs/slider-cases.md`."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from pathlib import Path
from typing import Any, get_args

import numpy as np

from linkwork.errors import InputError, LinkworkError, MissingParameterError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState

from ..files.io import check_names, parameters_to, quantity, read_tables, unknown_name
from ..linear import design_pid, linearise_along
from ..synthesis.case_tasks import flag, given, listed, one_of, section, whole
from ..synthesis.cases import TABLES, SynthesisCase, overridden, synthesis_case_from
from ..synthesis.constraints import Assembly, Constraint
from ..synthesis.linkage import ANGLES, LENGTHS, LINKS, Linkage
from ..synthesis.program import SliderUnknown
from ..synthesis.solution import Solution
from ..synthesis.solve import Synthesis, synthesize
from ..synthesis.tasks import RockerFunction, Task, TimedPath, UntimedPath
from .inverse import SliderDrive, best_spring, inverse_dynamics
from .least_effort import Effort, LeastEffort, least_effort
from .motion import motion_of_plant, slider_motion
from .strategy import RATIOS, Criterion, Strategy, simplest_mechanism
from .tracking import TrackingResult, track

#: Tables of a case file besides those of a synthesis.
OWN = ("linkage", "slider", "strategy", "drive", "load", "tracking", "least_effort")
#: A name of a dimension in the columns of solutions.csv: by itself, or with its unit.
DIMENSIONS = (*LENGTHS, *ANGLES)


@dataclass(frozen=True, slots=True, kw_only=True)
class StrategyWanted:
    """Arguments of `simplest_mechanism`."""

    tolerance: float
    criterion: Criterion = "worst"
    harmonics: int = 3
    ratios: tuple[int, ...] = RATIOS
    second_crank: float | None = None
    starts: int = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveWanted:
    """What inverse dynamics is asked for: crank speed (rad/s), load at P (N), samples of a turn, the best spring or not."""

    speed: float
    load: tuple[float, float] = (0.0, 0.0)
    samples: int = 720
    best_spring: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingWanted:
    """A run under control: arguments of `track`, and what its plant has that the model has not.

    Attributes
    ----------
    period : float
        Of sampling (s).
    bandwidth : float, optional
        Of the feedback, a PID (rad/s); ten times the crank's speed by default, 0 for none.
    feedforward : bool
    revolutions : float
    limit : float
        Of the force (N).
    coulomb_friction : float, optional
        Of the plant (N); by default the model's.
    mass_error : float
        Share by which the plant's slider and links are heavier than the model's.
    load_known : bool
        Whether the feed-forward knows the load.
    """

    period: float = 1e-3
    bandwidth: float | None = None
    feedforward: bool = True
    revolutions: float = 5.0
    limit: float = inf
    coulomb_friction: float | None = None
    mass_error: float = 0.0
    load_known: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class EffortWanted:
    """Arguments of `least_effort`: bound in m or rad."""

    bound: float
    cost: Effort = "force"
    force: float = inf
    speed: float = inf
    intervals: int = 40


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SliderCase:
    """What a case file asks for.

    Attributes
    ----------
    synthesis : SynthesisCase
        Task, bounds, constraints, search, and what the linkage is made of.
    linkage : Linkage or None
        The one whose pivot is moved; None if it is to be found first.
    harmonics : tuple of int
        Increasing; each is searched for, from the one before.
    unknown : SliderUnknown
        Bounds of the motion.
    free : bool
        Whether the links are optimised together with the motion.
    starts : int
    strategy, drive, tracking, effort
        What is asked for besides; None for what is not.
    """

    synthesis: SynthesisCase
    linkage: Linkage | None
    harmonics: tuple[int, ...] = (2,)
    unknown: SliderUnknown
    free: bool = False
    starts: int = 24
    strategy: StrategyWanted | None = None
    drive: DriveWanted | None = None
    tracking: TrackingWanted | None = None
    effort: EffortWanted | None = None

    @property
    def _constraints(self) -> tuple[Constraint, ...]:
        constraints = self.synthesis.constraints
        if self.linkage is not None and not any(isinstance(c, Assembly) for c in constraints):
            constraints = (*constraints, Assembly(branch=self.linkage.branch))
        return constraints

    def _bounds(self) -> Mapping[str, tuple[float, float]]:
        """Bounds of the links, where a linkage is given and they are kept, that linkage."""
        if self.linkage is None or self.free:
            return self.synthesis.bounds
        return {name: (value, value) for name, value in self.linkage.values().items() if name != "branch"}

    def four_bar(self, *, progress: bool = False) -> Solution:
        """The linkage with its pivot fixed: the one given, evaluated, or the best that is found."""
        task = self.synthesis.task
        if self.linkage is None:
            return self.synthesis.solve(progress=progress).best
        if isinstance(task, (TimedPath, RockerFunction)) or (isinstance(task, UntimedPath) and task.path.closed):
            return Solution.of(task, self.linkage)
        # where it is on the way of the task is not given: found with every dimension fixed
        kept = {name: (value, value) for name, value in self.linkage.values().items() if name != "branch"}
        only = (Assembly(branch=self.linkage.branch),)
        seed = self.synthesis.search.seed
        return synthesize(task, kept, only, seed=seed, candidates=1 << 10, starts=4, solutions=1).best

    def move(self, four_bar: Solution, harmonics: int, guesses: tuple[Solution, ...], *, progress: bool) -> Synthesis:
        """The best motion with so many harmonics; see `slider_motion`."""
        search = self.synthesis.search
        bounds = _around(four_bar.linkage, self.synthesis.task) | dict(self.synthesis.bounds) if self.free else None
        return slider_motion(
            self.synthesis.task,
            four_bar,
            replace(self.unknown, harmonics=harmonics),
            bounds=bounds,
            constraints=self._constraints,
            guesses=guesses,
            starts=self.starts,
            solutions=search.solutions,
            seed=search.seed,
            n_jobs=search.jobs,
            progress=progress,
        )

    def simplest(self, *, progress: bool = False) -> Strategy:
        """The simplest mechanism within the tolerance; see `simplest_mechanism`."""
        wanted, search = self.strategy, self.synthesis.search
        assert wanted is not None
        return simplest_mechanism(
            self.synthesis.task,
            wanted.tolerance,
            criterion=wanted.criterion,
            bounds=self._bounds(),
            constraints=self._constraints,
            stroke=self.unknown.stroke if isfinite(self.unknown.stroke) else None,
            harmonics=wanted.harmonics,
            ratios=wanted.ratios,
            second_crank=wanted.second_crank,
            starts=wanted.starts,
            seed=search.seed,
            n_jobs=search.jobs,
            progress=progress,
        )

    # Dynamics

    def five_bar(self, linkage: Linkage) -> FiveBarParameters:
        """Parameters of the plant: as `Make` says, the slider free to be moved."""
        make = self.synthesis.make
        return linkage.to_five_bar(
            density=make.density,
            section=(make.width, make.thickness),
            slider_mass=make.slider_mass,
            slider_stiffness=make.slider_stiffness or 0.0,
            slider_damping=make.slider_damping or 0.0,
            slider_coulomb_friction=make.slider_coulomb_friction,
            gravity=make.gravity,
        )

    def driven(self, solution: Solution) -> SliderDrive:
        """Force, torque and pin forces of the motion; the crank turns the way the task is done."""
        wanted = self.drive
        assert wanted is not None
        at = solution.evaluation.rotation
        backwards = at is not None and len(at) > 1 and at[-1] < at[0]
        speed = -wanted.speed if backwards else wanted.speed
        motion, parameters = motion_of_plant(solution.linkage), self.five_bar(solution.linkage)
        if wanted.best_spring:
            parameters = best_spring(parameters, motion, speed, load=wanted.load, samples=wanted.samples).parameters
        return inverse_dynamics(parameters, motion, speed, load=wanted.load, samples=wanted.samples)

    def tracked(self, drive: SliderDrive) -> TrackingResult:
        """The run under control."""
        wanted = self.tracking
        assert wanted is not None
        model = drive.parameters
        other: dict[str, Any] = {
            name: getattr(model, name) * (1.0 + wanted.mass_error)
            for name in ("coupler_mass", "rocker_mass", "slider_mass", "coupler_inertia", "rocker_inertia")
        }
        if wanted.coulomb_friction is not None:
            other["slider_coulomb_friction"] = wanted.coulomb_friction
        bandwidth = 10.0 * abs(drive.crank_speed) if wanted.bandwidth is None else wanted.bandwidth
        design = design_pid(linearise_along(model, drive).mean(), bandwidth=bandwidth) if bandwidth > 0.0 else None
        return track(
            model,
            drive.slider,
            crank_speed=drive.crank_speed,
            period=wanted.period,
            design=design,
            feedforward=wanted.feedforward,
            revolutions=wanted.revolutions,
            plant=replace(model, **other),
            load=drive.load,
            known_load=drive.load if wanted.load_known else (0.0, 0.0),
            limit=wanted.limit,
        )

    def relaxed(self, drive: SliderDrive, linkage: Linkage) -> LeastEffort:
        """The motion of least effort that stays within a bound of what the motion found does.

        Of a rocker function the rocker's angle, else the coupler point.
        """
        wanted = self.effort
        assert wanted is not None
        if drive.crank_speed < 0.0:
            raise InputError("least effort is for a crank that turns counter-clockwise; this task is done clockwise")
        if isinstance(self.synthesis.task, RockerFunction):
            target = np.unwrap(drive["rocker.angle"])
        else:
            target = np.column_stack([drive["coupler.point.x"], drive["coupler.point.y"]])
        ground = linkage.ground_length
        low, high = self.unknown.position or (-ground, ground)
        return least_effort(
            drive.parameters,
            drive.crank_speed,
            target,
            wanted.bound,
            cost=wanted.cost,
            stroke=(low, high),
            speed=wanted.speed,
            force=wanted.force,
            load=drive.load,
            intervals=wanted.intervals,
            guess=drive.slider,
        )


def _around(linkage: Linkage, task: Task) -> dict[str, tuple[float, float]]:
    """Bounds of links that are free: from a quarter to four times, the rest anywhere near; what a rocker ignores is kept."""
    near = {name: (0.25 * getattr(linkage, name), 4.0 * getattr(linkage, name)) for name in LINKS}
    near["crank_phase"] = (linkage.crank_phase - pi, linkage.crank_phase + pi)
    if isinstance(task, RockerFunction):
        del near["ground_length"]
        return near
    reach = 4.0 * linkage.largest_link
    near["point_distance"] = (0.0, reach)
    for name in ("pivot_x", "pivot_y"):
        near[name] = (getattr(linkage, name) - reach, getattr(linkage, name) + reach)
    for name in ("ground_angle", "point_angle"):
        near[name] = (getattr(linkage, name) - pi, getattr(linkage, name) + pi)
    return near


def run_case(drive: SliderDrive, title: str, force_file: str) -> dict[str, Any]:
    """Tables of a case file that runs one turn under the control force, read from a file; see `docs/case-files.md`."""
    start = InitialState(
        crank_speed=drive.crank_speed,
        slider_position=float(drive.states[0, 1]),
        slider_velocity=float(drive.states[0, 3]),
    )
    assert not callable(drive.load)
    return {
        "title": title,
        **parameters_to(drive.parameters),
        "initial": {
            "slider_position": f"{start.slider_position!r} m",
            "slider_velocity": f"{start.slider_velocity!r} m/s",
        },
        "drive": {"speed": f"{drive.crank_speed!r} rad/s"},
        "force": {"kind": "table", "file": force_file, "interpolation": "cubic"},
        "load": {"fx": f"{drive.load[0]!r} N", "fy": f"{drive.load[1]!r} N"},
        "run": {"stop_time": f"{drive.period!r} s", "step": f"{drive.period / len(drive.time)!r} s"},
    }


# Reading


def load_slider_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> SliderCase:
    """Read a case from a TOML or JSON file; see `docs/slider-cases.md`.

    Raises
    ------
    InputError, ParameterError
        If the file cannot be read, or what it says is not usable.
    InfeasibleError
        If bounds and constraints contradict one another.
    """
    path = Path(path)
    return slider_case_from(read_tables(path), folder=path.parent, title=path.stem, overrides=overrides)


def slider_case_from(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> SliderCase:
    """A case from the tables of a case file; ``folder`` is where its files are looked for."""
    data = overridden(data, overrides or {})
    for name in data:
        if name not in (*TABLES, *OWN) or name == "trade_off":
            raise unknown_name(name, [n for n in (*TABLES, *OWN) if n != "trade_off"])
    if "slider" not in data and "strategy" not in data:
        raise MissingParameterError("slider")
    rest = {name: value for name, value in data.items() if name not in OWN}
    synthesis = synthesis_case_from(rest, folder=folder, title=title)
    linkage = _linkage(section(data, "linkage"), folder) if "linkage" in data else None
    slider = section(data, "slider")
    check_names(slider, "slider", (*_MOTION, "harmonics", "guide_angle", "position", "links", "starts"))
    free = one_of(slider.get("links", "kept"), "slider.links", ("kept", "free")) == "free"
    if linkage is not None and not free and synthesis.bounds:
        first = next(iter(synthesis.bounds))
        raise ParameterError(
            f"bounds.{first}",
            synthesis.bounds[first],
            "not come with a [linkage] that is kept; set slider.links = 'free'",
        )
    if "drive" not in data:
        for name in ("load", "tracking", "least_effort"):
            if name in data:
                raise MissingParameterError("drive.speed")
    angular = isinstance(synthesis.task, RockerFunction)
    return SliderCase(
        synthesis=synthesis,
        linkage=linkage,
        harmonics=_harmonics(slider.get("harmonics", 2)),
        unknown=_unknown_motion(slider),
        free=free,
        starts=whole(slider.get("starts", 24), "slider.starts", 1),
        strategy=_strategy(section(data, "strategy"), angular) if "strategy" in data else None,
        drive=_drive(section(data, "drive"), section(data, "load")) if "drive" in data else None,
        tracking=_tracking(section(data, "tracking")) if "tracking" in data else None,
        effort=_effort(section(data, "least_effort"), angular) if "least_effort" in data else None,
    )


def _linkage(table: Mapping[str, Any], folder: Path) -> Linkage:
    """A linkage by its dimensions, or one of those in a file that `linkwork synthesize` wrote."""
    if "file" in table:
        check_names(table, "linkage", ("file", "rank"))
        return linkage_from_csv(folder / str(table["file"]), whole(table.get("rank", 1), "linkage.rank", 1))
    check_names(table, "linkage", (*DIMENSIONS, "branch"))
    values: dict[str, Any] = {
        name: quantity(table[name], "rad" if name in ANGLES else "m", f"linkage.{name}")
        for name in DIMENSIONS
        if name in table
    }
    for name in LINKS:
        if name not in values:
            raise MissingParameterError(f"linkage.{name}")
    if "branch" in table:
        values["branch"] = whole(table["branch"], "linkage.branch")
    return Linkage(**values)


def linkage_from_csv(path: str | Path, rank: int = 1) -> Linkage:
    """A linkage of a file that `Synthesis.to_csv` wrote: ``rank`` 1 is the best.

    Raises
    ------
    InputError
        If the file cannot be read, is none of that kind, or has no linkage of that rank.
    """
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if rank > len(rows):
        raise InputError(f"{path} has {len(rows)} linkages: there is none of rank {rank}")
    row = rows[rank - 1]
    columns = {name: f"{name} [{'rad' if name in ANGLES else 'm'}]" for name in DIMENSIONS}
    try:
        values: dict[str, Any] = {name: float(row[column]) for name, column in columns.items()}
        return Linkage(**values, branch=int(float(row["branch"])))
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, LinkworkError):
            raise
        raise InputError(
            f"{path} is no list of linkages as 'linkwork synthesize' writes it ({type(error).__name__}: {error})"
        ) from None


#: Bounds of the motion by the crank's rotation in radians.
_MOTION = {"stroke": "m", "speed": "m/rad", "acceleration": "m/rad**2"}


def _harmonics(value: Any) -> tuple[int, ...]:
    values = listed(value, "slider.harmonics") if isinstance(value, list) else [value]
    numbers = sorted({whole(v, "slider.harmonics", 0) for v in values})
    if not numbers:
        raise ParameterError("slider.harmonics", value, "be a number or a list of some")
    return tuple(numbers)


def _range(value: Any, unit: str, name: str) -> tuple[float, float]:
    ends = value if isinstance(value, list) else [value, value]
    if len(ends) != 2:
        raise ParameterError(name, value, "be one value, or two: [least, greatest]")
    low, high = (quantity(end, unit, name) for end in ends)
    if not low <= high:
        raise ParameterError(name, value, "be in order: [least, greatest]")
    return low, high


def _unknown_motion(table: Mapping[str, Any]) -> SliderUnknown:
    options: dict[str, Any] = {}
    for name, unit in _MOTION.items():
        if name in table:
            options[name] = _positive(table[name], unit, f"slider.{name}")
    if "guide_angle" in table:
        options["guide_angle"] = _range(table["guide_angle"], "rad", "slider.guide_angle")
    if "position" in table:
        options["position"] = _range(table["position"], "m", "slider.position")
    return SliderUnknown(harmonics=0, **options)


def _positive(value: Any, unit: str, name: str) -> float:
    number = quantity(value, unit, name)
    if not (isfinite(number) and number > 0.0):
        raise ParameterError(name, value, "be a finite number greater than zero")
    return number


def _strategy(table: Mapping[str, Any], angular: bool) -> StrategyWanted:
    name = "strategy"
    check_names(table, name, StrategyWanted.__dataclass_fields__)
    criterion = one_of(table.get("criterion", "worst"), "strategy.criterion", get_args(Criterion))
    unit = ("rad" if angular else "m") + ("**2" if criterion == "error" else "")
    options: dict[str, Any] = {
        key: whole(table[key], f"{name}.{key}", 1) for key in ("harmonics", "starts") if key in table
    }
    if "ratios" in table:
        options["ratios"] = tuple(whole(v, "strategy.ratios") for v in listed(table["ratios"], "strategy.ratios"))
    if "second_crank" in table:
        options["second_crank"] = _positive(table["second_crank"], "m", "strategy.second_crank")
    tolerance = _positive(given(table, "tolerance", name), unit, "strategy.tolerance")
    return StrategyWanted(tolerance=tolerance, criterion=criterion, **options)  # type: ignore[arg-type]


def _drive(table: Mapping[str, Any], load: Mapping[str, Any]) -> DriveWanted:
    check_names(table, "drive", ("speed", "samples", "best_spring"))
    check_names(load, "load", ("fx", "fy"))
    return DriveWanted(
        speed=_positive(given(table, "speed", "drive"), "rad/s", "drive.speed"),
        load=(quantity(load.get("fx", 0.0), "N", "load.fx"), quantity(load.get("fy", 0.0), "N", "load.fy")),
        samples=whole(table.get("samples", 720), "drive.samples", 72),
        best_spring=flag(table.get("best_spring", False), "drive.best_spring"),
    )


def _tracking(table: Mapping[str, Any]) -> TrackingWanted:
    check_names(table, "tracking", TrackingWanted.__dataclass_fields__)
    options: dict[str, Any] = {
        name: flag(table[name], f"tracking.{name}") for name in ("feedforward", "load_known") if name in table
    }
    for name, unit in (("period", "s"), ("revolutions", "1"), ("limit", "N")):
        if name in table:
            options[name] = _positive(table[name], unit, f"tracking.{name}")
    for name, unit in (("bandwidth", "rad/s"), ("coulomb_friction", "N")):
        if name in table:
            value = quantity(table[name], unit, f"tracking.{name}")
            if not 0.0 <= value < inf:
                raise ParameterError(f"tracking.{name}", table[name], "be a finite number, zero or greater")
            options[name] = value
    if "mass_error" in table:
        share = quantity(table["mass_error"], "1", "tracking.mass_error")
        if not -1.0 < share < inf:
            raise ParameterError("tracking.mass_error", table["mass_error"], "be a share above -1")
        options["mass_error"] = share
    return TrackingWanted(**options)


def _effort(table: Mapping[str, Any], angular: bool) -> EffortWanted:
    check_names(table, "least_effort", EffortWanted.__dataclass_fields__)
    options: dict[str, Any] = {
        name: _positive(table[name], unit, f"least_effort.{name}")
        for name, unit in (("force", "N"), ("speed", "m/s"))
        if name in table
    }
    if "intervals" in table:
        options["intervals"] = whole(table["intervals"], "least_effort.intervals", 4)
    if "cost" in table:
        options["cost"] = one_of(table["cost"], "least_effort.cost", get_args(Effort))
    bound = given(table, "bound", "least_effort")
    return EffortWanted(bound=_positive(bound, "rad" if angular else "m", "least_effort.bound"), **options)
