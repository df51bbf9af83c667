"""The jobs that a page gives: each takes a case and what is wanted of it, and answers with what the page shows.

A request is numbers and names; no text of it is ever a path. An answer is for people, in the units they read: ``words``, a
``table`` of texts, ``states`` of the page and ``curves`` in the plane of the mechanism, one a row, ``charts``, the ``outputs``
of a run, and ``files`` for the browser to save.
"""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..export import KINDS, NATIVE, PYTHON, build, build_native, kinds_here, with_starts
from ..files import Choice, Many, Quantity, Whole, entry, flag, read, text, unknown_name, write_csv
from ..mechanisms import mechanism_of, require_five_bar
from ..motion import inverse_dynamics, motion_of_plant, slider_motion
from ..notebook import format_count
from ..periodic import drive_of, of_the_motor, unit_of
from ..run import Case, case_from, cosimulate
from ..studio import case_of, given_values, state_of
from ..synthesis import (
    Constraint,
    FullTurn,
    LargestLink,
    LeastTransmission,
    Linkage,
    Make,
    Search,
    SliderMotion,
    SliderUnknown,
    Solution,
    TargetPath,
    UntimedPath,
    format_transmission,
    synthesize,
)
from ..tuning import Wish, tune

Answer = dict[str, Any]
FloatArray = NDArray[np.float64]

_POINT = Many(Quantity("m"), length=2)
#: Rows of a run through the FMU, at most.
_ROWS = 5000


@dataclass(frozen=True, slots=True, kw_only=True)
class _Path:
    """A path that was drawn (m), and the searches for it."""

    points: tuple[tuple[float, float], ...] = entry(Many(_POINT, least=3))
    closed: bool = entry(flag, True)
    starts: int = entry(Whole(1), 24)

    def task(self) -> UntimedPath:
        return UntimedPath(path=TargetPath(points=np.array(self.points), closed=self.closed))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Linkages(_Path):
    """Linkages for it, with at least this transmission angle (rad) and no longer link (m)."""

    least_transmission: float = entry(Quantity("rad", least=0.0, below=0.5 * pi), LeastTransmission().angle)
    longest: float = entry(Quantity("m", above=0.0), inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Moved(_Path):
    """The slider's motion for it: harmonics up to a number, and the greatest stroke (m)."""

    starts: int = entry(Whole(1), 8)
    harmonics: int = entry(Whole(1), 2)
    stroke: float = entry(Quantity("m", above=0.0), inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tuning:
    """A range of speeds (rad/s), what must not lie in it, and what may change by which share of its value."""

    speeds: tuple[float, float] = entry(Many(Quantity("rad/s", above=0.0), length=2))
    change: tuple[str, ...] = entry(Many(text, least=1))
    share: float = entry(Quantity("1", above=0.0))
    no_resonance: bool = entry(flag, True)
    no_jump: bool = entry(flag, False)
    no_unstable: bool = entry(flag, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """A run of the FMU, with rows at so many equal steps."""

    rows: int = entry(Whole(1))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Export:
    """An FMU with the start values of the page."""

    kind: str = entry(Choice([name for name, kind in KINDS.items() if kind is not PYTHON]), "native")


def do(kind: str, request: Mapping[str, Any]) -> Answer:
    """Do a job of `JOBS` with the ``state`` and what is ``wanted`` of a request.

    Raises
    ------
    LinkworkError
        Of whatever kind the job has.
    """
    if kind not in JOBS:
        raise unknown_name(kind, JOBS, f"job {kind!r}")
    wanted, work = JOBS[kind]
    state = request.get("state")
    if not isinstance(state, Mapping):
        raise InputError("a request has no state: it must have that of the page")
    return work(case_of(state), read(wanted, request.get("wanted", {}), ""))


def _linkages(case: Case, wanted: _Linkages) -> Answer:
    """Ranked four-bars, each as a state of the page, with the path as that has it: its x axis is the ground link."""
    task = wanted.task()
    angle = wanted.least_transmission
    constraints: list[Constraint] = [LeastTransmission(angle=angle)] if angle else [FullTurn()]
    if isfinite(wanted.longest):
        constraints.append(LargestLink(length=wanted.longest))
    found = synthesize(task, constraints=constraints, search=Search(starts=wanted.starts))
    rows, states, curves = [], [], []
    for rank, solution in enumerate(found.solutions, 1):
        v = solution.verdicts
        rows.append(
            [
                str(rank),
                f"{1e6 * solution.error:.4g}",
                f"{1e3 * solution.evaluation.worst:.3g}",
                format_transmission(v),
                f"{1e3 * solution.linkage.largest_link:.4g}",
                ", ".join([v.grashof, *v.defects]),
            ]
        )
        title = f"Linkage {rank} for a path that was drawn"
        made = case_from(Make().run_case(solution, title), folder=Path(), title=title)
        state = state_of(made)
        # the path says nothing of the way in which the crank turns, and the page seeks periodic motions of one way
        state["values"]["drive.speed"] = abs(state["values"]["drive.speed"])
        states.append(state)
        curves.append(_turned(np.array(wanted.points), solution.linkage).tolist())
    headings = ["", "area [mm²]", "worst [mm]", "transmission [deg]", "longest link [mm]", ""]
    return {
        "words": f"{len(rows)} linkages in {found.seconds:.1f} s, the area between the curves the least first.",
        "table": {"headings": headings, "rows": rows},
        "states": states,
        "curves": curves,
        "closed": wanted.closed,
    }


def _turned(points: FloatArray, linkage: Linkage) -> FloatArray:
    """Points of the plane in the frame of a linkage's ground link."""
    z = (points[:, 0] + 1j * points[:, 1] - complex(linkage.pivot_x, linkage.pivot_y)) * np.exp(
        -1j * linkage.ground_angle
    )
    return np.column_stack([z.real, z.imag])


def _moved(case: Case, wanted: _Moved) -> Answer:
    """The slider's motion with more and more harmonics, the links and the guide kept, and the force of the last."""
    p = case.parameters
    require_five_bar(p, "a motion of the slider")
    task = wanted.task()
    linkage = Linkage(
        ground_length=p.ground_length,
        crank_length=p.crank_length,
        coupler_length=p.coupler_length,
        rocker_length=p.rocker_length,
        point_distance=p.coupler_point_distance,
        point_angle=p.coupler_point_angle,
        branch=p.assembly_branch,
    )
    if wanted.closed:
        still = Solution.of(task, linkage)
    else:
        kept = {name: (value, value) for name, value in linkage.values().items() if name != "branch"}
        still = synthesize(task, kept, [FullTurn()], search=Search(starts=4, candidates=1 << 10, solutions=1)).best
    found = [still]
    guide = (p.slider_guide_angle, p.slider_guide_angle)
    for harmonics in range(1, wanted.harmonics + 1):
        unknown = SliderUnknown(harmonics=harmonics, guide_angle=guide, stroke=wanted.stroke)
        search = Search(starts=wanted.starts)
        found.append(slider_motion(task, still, unknown, guesses=found[1:], search=search).best)
    rows = [
        [
            "at rest" if n == 0 else format_count(n, "harmonic"),
            f"{1e6 * s.error:.4g}",
            f"{1e3 * s.evaluation.worst:.3g}",
            f"{1e3 * s.linkage.pivot.stroke:.4g}" if isinstance(s.linkage.pivot, SliderMotion) else "",
            format_transmission(s.verdicts),
        ]
        for n, s in enumerate(found)
    ]
    turn = np.linspace(0.0, 2.0 * pi, 181)
    last = found[-1].linkage
    charts = [_chart("Slider position over the crank angle", "mm", turn, 1e3 * motion_of_plant(last)(turn))]
    answer: Answer = {
        "words": "The guide and the links are kept; what is drawn is the path with the last motion.",
        "table": {
            "headings": ["slider", "area [mm²]", "worst [mm]", "stroke [mm]", "transmission [deg]"],
            "rows": rows,
        },
        "curves": [s.linkage.path(s.rotation).tolist() for s in found],
        "closed": wanted.closed,
        "charts": charts,
    }
    speed = case.inputs.speed
    if not speed:
        answer["words"] += " No force is computed: the crank is not driven at a speed."
        return answer
    load = tuple(sum(case.inputs.parts(name)) for name in ("load_x", "load_y"))
    drive = inverse_dynamics(p, motion_of_plant(last), speed, load=load)
    answer["words"] += (
        f" It takes a force of {drive.peak_force:.4g} N at most, {drive.rms_force:.4g} N rms, and a torque of the crank of "
        f"{drive.peak_torque:.4g} N.m at most."
    )
    charts.append(_chart("Force on the slider over the crank angle", "N", drive.crank_angle, drive.force))
    own = {"crank angle [rad]": drive.crank_angle, "slider position [m]": drive.slider(drive.crank_angle)}
    with _folder() as folder:
        answer["files"] = [_file(write_csv(Path(folder) / "slider-motion.csv", own | dict(drive.columns())))]
    return answer


def _chart(title: str, unit: str, angle: FloatArray, values: FloatArray) -> Answer:
    return {"title": title, "unit": unit, "x": np.degrees(angle).tolist(), "y": values.tolist()}


def _tuned(case: Case, wanted: _Tuning) -> Answer:
    """The least change, as a state of the page."""
    low, high = wanted.speeds
    wish = Wish(
        parameters=case.parameters,
        drive=drive_of(case.parameters, case.inputs, case.initial, speed=low),
        speeds=(low, high),
        change=dict.fromkeys(wanted.change, f"{100.0 * wanted.share!r} %"),
        no_resonance=wanted.no_resonance,
        no_jump=wanted.no_jump,
        no_unstable=wanted.no_unstable,
    )
    tuned = tune(wish)
    mechanism = mechanism_of(case.parameters)
    rows = [
        [
            f"{name} [{unit_of(mechanism, name)}]",
            f"{before:.7g}",
            f"{after:.7g}",
            f"{100.0 * (after / before - 1.0):+.3g} %",
        ]
        for name, before, after in zip(wish.names, wish.present.tolist(), tuned.values.tolist())
    ]
    rows += [[r.name, r.before.text, r.after.text, "met" if r.met else "not met"] for r in tuned.requirements]
    title = f"{case.title}, tuned"
    after = state_of(replace(case, title=title, parameters=tuned.parameters))
    words = f"Verified: {tuned.verification}." if tuned.met else " ".join(f"{sentence}." for sentence in tuned.missed)
    table = {"headings": ["", "before", "after", ""], "rows": rows}
    return {"words": words, "table": table, "states": [after], "met": tuned.met}


def _run(case: Case, wanted: _Run) -> Answer:
    """A run of the native FMU, or where Zig is not installed of the Python FMU, at the samples of the page."""
    if wanted.rows > _ROWS:
        raise InputError(f"{wanted.rows} rows are more than {_ROWS}: ask for less")
    mechanism = mechanism_of(case.parameters)
    with _folder() as folder:
        native = "native" in kinds_here()
        fmu = build_native(mechanism, NATIVE, folder) if native else build(mechanism, folder)
        run = cosimulate(
            fmu,
            case.parameters,
            case.inputs,
            initial=case.initial,
            stop_time=case.stop_time,
            step=case.stop_time / wanted.rows,
            tolerance=1e-10,
            # a motor follows the speed within a step
            interface="co-simulation" if case.inputs.held_exactly else "model-exchange",
        )
    words = f"{run.source} through FMPy" + (f" ended early: {run.message}" if run.status else "")
    return {
        "words": words,
        "time": run.time.tolist(),
        "outputs": {name: run[name].tolist() for name in run.names},
    }


def _exported(case: Case, wanted: _Export) -> Answer:
    """A native FMU for this platform with the values of the page as its start values."""
    mechanism = mechanism_of(case.parameters)
    values = given_values(mechanism, state_of(case)["values"])
    motor = of_the_motor(mechanism)
    if any(values[name] != 0.0 for name, (field, _) in motor.items() if field == "breakdown_torque"):
        raise InputError(
            "an FMU has no motor: take it out here, and connect one to the FMU's torque in the system that it goes into"
        )
    values = {name: value for name, value in values.items() if name not in motor}
    with _folder() as folder:
        made = build_native(with_starts(mechanism, values), KINDS[wanted.kind], folder)
        return {"words": f"{made.name} starts with the values of the page.", "files": [_file(made)]}


def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="linkwork-", ignore_cleanup_errors=True)


def _file(path: Path) -> Answer:
    return {"name": path.name, "base64": base64.b64encode(path.read_bytes()).decode()}


#: By kind of job: how what is wanted is read, and what does it.
JOBS: dict[str, tuple[type, Callable[[Case, Any], Answer]]] = {
    "linkages": (_Linkages, _linkages),
    "slider": (_Moved, _moved),
    "tune": (_Tuning, _tuned),
    "run": (_Run, _run),
    "export": (_Export, _exported),
}
