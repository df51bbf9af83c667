"""Case files of a slider motion: TOML or JSON tables, every quantity with its unit; see `docs/slider-cases.md`."""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from math import cos, inf, isfinite, pi, sin
from pathlib import Path
from typing import Any, get_args

import numpy as np

from linkwork.errors import InputError, MissingParameterError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.parameters import fmi_name

from .. import files
from .. import synthesis as syn
from ..linear import Design, design_pid, linearise_orbit
from ..numerics.fourier import FourierSeries
from ..run import parameter_tables
from ..units import with_unit
from .inverse import SliderDrive, best_spring, inverse_dynamics
from .motion import motion_of_plant, slider_motion
from .strategy import RATIOS, Criterion, Strategy, simplest_mechanism
from .tracking import TrackingController, TrackingResult, track


def _read_increasing(value: Any, name: str) -> tuple[int, ...]:
    return tuple(sorted(set(files.Many(files.Whole(0), least=1, single=True)(value, name))))


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderTable:
    """The table ``[slider]``: harmonics and bounds of the motion.

    Attributes
    ----------
    harmonics : tuple of int
        Numbers of harmonics, increasing. There is one search for each number; it starts from the solutions of the previous
        search.
    links : str
        "kept", or "free" if the links are optimised together with the motion.
    guide_angle, position, stroke, speed, acceleration
        Bounds of the motion, see `SliderUnknown`.
    starts : int
        Number of starts of each search.
    """

    harmonics: tuple[int, ...] = files.entry(_read_increasing, (2,))
    links: str = files.entry(files.Choice(("kept", "free")), "kept")
    guide_angle: tuple[float, float] = files.entry(files.Range(files.Quantity("rad")), (-pi, pi))
    position: tuple[float, float] | None = files.entry(files.Range(files.Quantity("m")), None)
    stroke: float = files.entry(files.Quantity("m", above=0.0), inf)
    speed: float = files.entry(files.Quantity("m/rad", above=0.0), inf)
    acceleration: float = files.entry(files.Quantity("m/rad**2", above=0.0), inf)
    starts: int = files.entry(files.Whole(1), 24)

    def __post_init__(self) -> None:
        self.unknown(0)  # checks the bounds

    def unknown(self, harmonics: int) -> syn.SliderUnknown:
        """Return the unknowns of a motion with this number of harmonics, within the bounds of the table."""
        bounds = {name: getattr(self, name) for name in ("guide_angle", "position", "stroke", "speed", "acceleration")}
        return syn.SliderUnknown(harmonics=harmonics, **bounds)


@dataclass(frozen=True, slots=True, kw_only=True)
class StrategyTable:
    """The table ``[strategy]``: the arguments of `simplest_mechanism`."""

    tolerance: float = files.entry(files.any_value)
    criterion: Criterion = files.entry(files.Choice(get_args(Criterion)), "worst")
    harmonics: int = files.entry(files.Whole(1), 3)
    ratios: tuple[int, ...] = files.entry(files.Many(files.Whole()), RATIOS)
    second_crank: float | None = files.entry(files.Quantity("m", above=0.0), None)
    starts: int = files.entry(files.Whole(1), 12)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveTable:
    """The table ``[drive]``: crank speed (rad/s), number of samples per crank turn, and whether the best spring is added."""

    speed: float = files.entry(files.Quantity("rad/s", above=0.0))
    samples: int = files.entry(files.Whole(72), 720)
    best_spring: bool = files.entry(files.flag, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingTable:
    """The table ``[tracking]``: arguments of `track`, and differences between plant and model.

    Attributes
    ----------
    period : float
        Sampling period (s).
    bandwidth : float, optional
        Bandwidth of the PID feedback (rad/s); ten times the crank speed by default, 0 for no feedback.
    feedforward : bool
        Whether there is a feed-forward.
    revolutions : float
        Number of crank turns.
    limit : float
        Largest magnitude of the slider force (N).
    coulomb_friction : float, optional
        Coulomb friction of the plant (N); by default the same as in the model.
    mass_error : float
        Fraction by which the plant's masses and moments of inertia, except the crank's, are larger than the model's.
    load_known : bool
        Whether the feed-forward knows the load.
    """

    period: float = files.entry(files.Quantity("s", above=0.0), 1e-3)
    bandwidth: float | None = files.entry(files.Quantity("rad/s", least=0.0), None)
    feedforward: bool = files.entry(files.flag, True)
    revolutions: float = files.entry(files.Quantity("1", least=1.0), 5.0)
    limit: float = files.entry(files.Quantity("N", above=0.0), inf)
    coulomb_friction: float | None = files.entry(files.Quantity("N", least=0.0), None)
    mass_error: float = files.entry(files.Quantity("1", above=-1.0, requirement="be a share above -1"), 0.0)
    load_known: bool = files.entry(files.flag, True)

    def plant_values(self, model: FiveBarParameters) -> dict[str, Any]:
        """Return the parameters in which the plant differs from the model, by field name."""
        heavier = ("coupler_mass", "rocker_mass", "slider_mass", "coupler_inertia", "rocker_inertia")
        values = {name: getattr(model, name) * (1.0 + self.mass_error) for name in heavier if self.mass_error}
        if self.coulomb_friction is not None:
            values["slider_coulomb_friction"] = self.coulomb_friction
        return values


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """The table ``[load]``: force at P (N), ``fx`` along the ground link and ``fy`` perpendicular to it, to the left."""

    fx: float = files.entry(files.Quantity("N"), 0.0)
    fy: float = files.entry(files.Quantity("N"), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SliderCase:
    """A case file of a slider motion.

    Attributes
    ----------
    synthesis : SynthesisCase
        Task, bounds, constraints, search, and masses of the linkage.
    linkage : Linkage or None
        Linkage whose rocker pivot is moved; None if a search has to find the linkage.
    slider : SliderTable
        Unknowns and bounds of the motion.
    strategy, drive, tracking
        Tables of further computations; None if not requested.
    load : Load, optional
        Force at the coupler point.
    """

    synthesis: syn.SynthesisCase = files.entry(files.any_value)
    linkage: syn.Linkage | None = files.entry(files.any_value, None)
    slider: SliderTable = files.entry(files.Table(SliderTable), SliderTable())
    strategy: StrategyTable | None = files.entry(files.any_value, None)
    drive: DriveTable | None = files.entry(files.Table(DriveTable), None)
    load: Load | None = files.entry(files.Table(Load), None)
    tracking: TrackingTable | None = files.entry(files.Table(TrackingTable), None)

    def __post_init__(self) -> None:
        syn.check_task("four-bar", self.synthesis.task)
        kinds = self.synthesis.search.kinds
        if kinds not in (None, ("four-bar",)):
            raise ParameterError("search.kinds", kinds, "be four-bar, whose pivot is moved, or left out")
        if self.linkage is not None and not self.free and self.synthesis.bounds:
            first, limits = next(iter(self.synthesis.bounds.items()))
            raise ParameterError(
                f"bounds.{first}", limits, "not come with a [linkage] that is kept; set slider.links = 'free'"
            )
        if self.drive is None and any((self.load, self.tracking)):
            raise MissingParameterError("drive.speed")

    @property
    def free(self) -> bool:
        """Return whether the links are optimised together with the motion."""
        return self.slider.links == "free"

    def find_four_bar(self, *, progress: bool = False) -> syn.Solution:
        """Evaluate the given linkage with a fixed pivot; if no linkage is given, search for the best four-bar."""
        task = self.synthesis.task
        if self.linkage is None:
            return self.synthesis.solve(progress=progress).best
        closed = isinstance(task, syn.UntimedPath) and task.path.closed
        if closed or isinstance(task, syn.TimedPath | syn.RockerFunction):
            return syn.Solution.from_linkage(task, self.linkage)
        # the crank rotations along an open path are unknown: a search with all dimensions fixed finds them
        only = (syn.Assembly(branch=self.linkage.branch),)
        search = syn.Search(seed=self.synthesis.search.seed, candidates=1 << 10, starts=4, solutions=1)
        return syn.synthesize(task, _fixed_bounds(self.linkage), only, search=search).best

    def find_motion(
        self, four_bar: syn.Solution, harmonics: int, guesses: tuple[syn.Solution, ...], *, progress: bool
    ) -> syn.Synthesis:
        """Find the best motion of the pivot with this number of harmonics; see `slider_motion`.

        ``four_bar`` is the linkage with a fixed pivot; ``guesses`` are further solutions to start from.
        """
        search = self.synthesis.search
        free = _free_bounds(four_bar.linkage, self.synthesis.task) | dict(self.synthesis.bounds)
        return slider_motion(
            self.synthesis.task,
            four_bar,
            self.slider.unknown(harmonics),
            bounds=free if self.free else None,
            constraints=self.synthesis.constraints,
            guesses=guesses,
            search=search.search(starts=self.slider.starts, progress=progress),
        )

    def find_simplest(self, *, progress: bool = False) -> Strategy:
        """Find the simplest mechanism within the tolerance; see `simplest_mechanism`."""
        wanted, search = self.strategy, self.synthesis.search
        assert wanted is not None
        bounds, constraints = self.synthesis.bounds, self.synthesis.constraints
        if self.linkage is not None:
            bounds = bounds if self.free else _fixed_bounds(self.linkage)
            if not any(isinstance(c, syn.Assembly) for c in constraints):
                constraints = (*constraints, syn.Assembly(branch=self.linkage.branch))
        return simplest_mechanism(
            self.synthesis.task,
            bounds=bounds,
            constraints=constraints,
            stroke=self.slider.stroke if isfinite(self.slider.stroke) else None,
            search=syn.Search(starts=wanted.starts, seed=search.seed, n_jobs=search.jobs, progress=progress),
            **{name: value for name, value in asdict(wanted).items() if name != "starts"},
        )

    # Dynamics

    def machine(self, solution: syn.Solution) -> syn.MachineSpec:
        """Return the machine of the synthesis, with the speed, the load and the best spring of this case."""
        make, wanted, linkage = self.synthesis.make, self.drive, solution.linkage
        if wanted is None:
            return make
        load = self.load or Load()
        whole = complex(*make.load) + complex(load.fx, load.fy) * rect(1.0, linkage.ground_angle)
        make = replace(make, speed=wanted.speed, load=(whole.real, whole.imag))
        if wanted.best_spring and not isinstance(linkage.pivot, syn.SecondCrank):
            motion, speed = motion_of_plant(linkage), solution.direction * wanted.speed
            found = best_spring(
                make.sliding_five_bar(linkage), motion, speed, load=self._load(make, linkage), samples=wanted.samples
            )
            make = replace(make, slider_stiffness=found.stiffness, slider_spring_free_position=found.free_position)
        return make

    def _load(self, make: syn.MachineSpec, linkage: syn.Linkage) -> tuple[float, float]:
        """Return the load of a machine (N), along the ground link and to its left."""
        fx, fy = make.load_components(cos(linkage.ground_angle), sin(linkage.ground_angle))
        return float(fx), float(fy)

    def compute_drive(self, solution: syn.Solution) -> SliderDrive:
        """Compute force, torque and pin forces of a solution's motion; the crank turns in the sense of the task."""
        assert self.drive is not None
        make, linkage = self.machine(solution), solution.linkage
        plant, motion, load = make.sliding_five_bar(linkage), motion_of_plant(linkage), self._load(make, linkage)
        speed = solution.direction * self.drive.speed
        return inverse_dynamics(plant, motion, speed, load=load, samples=self.drive.samples)

    def run_tracking(self, drive: SliderDrive) -> TrackingResult:
        """Run the plant, which may differ from the model, under the tracking controller."""
        wanted = self.tracking
        assert wanted is not None
        controller = TrackingController(
            drive.parameters,
            drive.slider,
            wanted.period,
            design=self.design(drive),
            feedforward=wanted.feedforward,
            load=drive.load if wanted.load_known else (0.0, 0.0),
            limit=wanted.limit,
        )
        return track(
            controller,
            crank_speed=drive.crank_speed,
            revolutions=wanted.revolutions,
            plant=replace(drive.parameters, **wanted.plant_values(drive.parameters)),
            load=drive.load,
        )

    def design(self, drive: SliderDrive) -> Design | None:
        """Design the feedback of the tracking controller; return None if its bandwidth is zero."""
        wanted = self.tracking or TrackingTable()
        bandwidth = 10.0 * abs(drive.crank_speed) if wanted.bandwidth is None else wanted.bandwidth
        if bandwidth <= 0.0:
            return None
        # dry friction is left to the feed-forward: at rest its slope would pass for a damper
        smooth = replace(drive.parameters, slider_coulomb_friction=0.0)
        return design_pid(linearise_orbit(smooth, drive).mean(), bandwidth=bandwidth)

    def system(self, drive: SliderDrive, case: str) -> dict[str, Any]:
        """Return the tables that describe a system of linkage, reference and controller.

        ``case`` is the case file of the model; the linkage of the system differs from it as `tracking` says.
        """
        from ..export.controllers import HARMONICS

        wanted, design = self.tracking or TrackingTable(), self.design(drive)
        known = drive
        if not wanted.load_known:
            known = inverse_dynamics(drive.parameters, drive.slider, drive.crank_speed, samples=len(drive.time))
        plant = {fmi_name(name): value for name, value in wanted.plant_values(drive.parameters).items()}
        period = with_unit(wanted.period, "s")
        # the controller uses the reference one sample later
        reference: dict[str, Any] = {"sample_time": period, "lead": period}
        # samples at equal angles over a turn, from 0, where the crank starts
        for name, unit, samples in (("motion", "m", drive.states[:, 1]), ("load", "N", known.force)):
            forwards = samples if drive.crank_speed > 0.0 else np.roll(samples[::-1], 1)
            series = FourierSeries.from_samples(forwards, HARMONICS)
            reference[f"{name}_0"] = with_unit(series.cos[0], unit)
            for n in range(1, HARMONICS + 1):
                reference[f"{name}_cos_{n}"] = with_unit(series.cos[n], unit)
                reference[f"{name}_sin_{n}"] = with_unit(series.sin[n], unit)
        controller: dict[str, Any] = {"sample_time": period}
        if design is not None:
            gain, derivative_gain = design.gains.tolist()
            controller |= {"gain": with_unit(gain, "N/m"), "derivative_gain": with_unit(derivative_gain, "N.s/m")}
            controller["integral_gain"] = design.integral_gain
        if isfinite(wanted.limit):
            controller["limit"] = with_unit(wanted.limit, "N")
        return {
            "title": f"{self.synthesis.title}: controller and five-bar slider",
            "parts": {
                "linkage": {"case": case, **({"values": plant} if plant else {})},
                "reference": {"controller": "motion-reference", "values": reference},
                "controller": {"controller": "pid", "values": controller},
            },
            "connections": {
                "reference.angle": "linkage.crank.angle",
                "reference.speed": "linkage.crank.speed",
                "controller.reference": "reference.position",
                "controller.measured": "linkage.slider.position",
                **({"controller.feed_forward": "reference.force"} if wanted.feedforward else {}),
                "linkage.slider.force": "controller.force",
            },
            "run": {"stop_time": with_unit(wanted.revolutions * drive.period, "s"), "step": period},
        }


def _fixed_bounds(linkage: syn.Linkage) -> dict[str, tuple[float, float]]:
    """Return bounds, by dimension, that fix all dimensions of a linkage."""
    return {name: (value, value) for name, value in linkage.values().items() if name != "branch"}


def _free_bounds(linkage: syn.Linkage, task: syn.Task) -> dict[str, tuple[float, float]]:
    """Return wide bounds for free links, such as a quarter to four times a length; dimensions without bounds stay fixed."""
    near = {name: (0.25 * getattr(linkage, name), 4.0 * getattr(linkage, name)) for name in syn.LINKS}
    near["crank_phase"] = (linkage.crank_phase - pi, linkage.crank_phase + pi)
    if isinstance(task, syn.RockerFunction):
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
    """Return the tables of a case file for one turn under the control force in ``force_file``; see `docs/case-files.md`."""
    assert not callable(drive.load)
    position, velocity = drive.states[0, [1, 3]].tolist()
    return {
        "title": title,
        **parameter_tables(drive.parameters),
        "initial": {"slider_position": with_unit(position, "m"), "slider_velocity": with_unit(velocity, "m/s")},
        "drive": {"speed": with_unit(drive.crank_speed, "rad/s")},
        "force": {"kind": "table", "file": force_file, "interpolation": "cubic"},
        "load": {"fx": with_unit(drive.load[0], "N"), "fy": with_unit(drive.load[1], "N")},
        "run": {"stop_time": with_unit(drive.period, "s"), "step": with_unit(drive.period / len(drive.time), "s")},
    }


#: Tables of a slider case that a synthesis case does not have, for `linkwork new`.
TABLES: Mapping[str, type] = {
    "slider": SliderTable, "strategy": StrategyTable, "drive": DriveTable, "load": Load, "tracking": TrackingTable,
}  # fmt: skip


# Reading


def _read_strategy(value: Any, name: str, *, angular: bool) -> StrategyTable:
    """Read the table ``[strategy]``; the tolerance is a worst error (m, rad) or a value of the quality function (m2, rad2)."""
    unit = ("rad" if angular else "m") + "**2" * (files.as_table(value, name).get("criterion") == "error")
    return files.read(StrategyTable, value, name, readers={"tolerance": files.Quantity(unit, above=0.0)})


def _read_linkage(value: Any, name: str, *, folder: Path) -> syn.Linkage:
    """Read a linkage from its dimensions or from a file of `linkwork synthesize`."""
    if "file" not in files.as_table(value, name):
        dimensions = {name: files.Quantity(unit) for name, unit in syn.UNITS.items()}
        return files.read(syn.Linkage, value, name, readers={**dimensions, "branch": files.Whole()})
    found: dict[str, Any] = files.read(dict, value, name, readers={"file": files.text, "rank": files.Whole(1)})
    return linkage_from_csv(folder / found["file"], found.get("rank", 1))


def load_slider_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> SliderCase:
    """Read a case from a TOML or JSON file; see `docs/slider-cases.md`. Errors are those of `load_synthesis_case`."""
    path = Path(path)
    return read_slider_case(files.read_tables(path), folder=path.parent, title=path.stem, overrides=overrides)


def read_slider_case(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> SliderCase:
    """Build a case from the tables of a case file; file names in the tables are relative to ``folder``."""
    data = {"title": title} | files.override(data, overrides or {})
    own = [name for name in files.entry_names(SliderCase) if name != "synthesis"]
    files.check_names(data, "", [name for name in (*files.entry_names(syn.SynthesisCase), *own) if name != "trade_off"])
    if "slider" not in data and "strategy" not in data:
        raise MissingParameterError("slider")
    synthesis = syn.read_synthesis_case({name: value for name, value in data.items() if name not in own}, folder=folder)
    angular = isinstance(synthesis.task, syn.RockerFunction)
    made: SliderCase = files.read(
        SliderCase,
        {"synthesis": synthesis} | {name: value for name, value in data.items() if name in own},
        "",
        readers={
            "linkage": partial(_read_linkage, folder=folder),
            "strategy": partial(_read_strategy, angular=angular),
        },
    )
    if made.strategy is not None:
        given = {f"slider.{name}": v for name, v in data.get("slider", {}).items() if name not in ("stroke", "links")}
        given |= {f"task.{name}": v for name, v in data["task"].items() if name == "objective"}
        for name, value in given.items():
            wanted = "not come with [strategy], which takes stroke and links alone and has a criterion of its own"
            raise ParameterError(name, value, wanted)
    return made


def linkage_from_csv(path: str | Path, rank: int = 1) -> syn.Linkage:
    """Read a linkage from a file of `Synthesis.to_csv`; ``rank`` 1 is the best linkage.

    Raises
    ------
    InputError
        If the file cannot be read, was not written by `Synthesis.to_csv`, or has no linkage of that rank.
    """
    rows = files.read_rows(path)
    if not 1 <= rank <= len(rows):
        raise InputError(f"{path} has {len(rows)} linkages: there is none of rank {rank}")
    row = rows[rank - 1]
    try:
        values: dict[str, Any] = {name: float(row[f"{name} [{unit}]"]) for name, unit in syn.UNITS.items()}
        values["branch"] = int(float(row["branch"]))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"{path} is not a list of linkages written by 'linkwork synthesize' ({type(error).__name__}: {error})"
        ) from None
    return syn.Linkage(**values)
