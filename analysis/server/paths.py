"""Jobs for a drawn path: find linkages, or the motion of a five-bar's slider, with which the coupler point follows it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, pi
from pathlib import Path
from typing import Any, get_args

import numpy as np

from linkwork.errors import ParameterError

from .. import synthesis as syn
from ..display import format_count
from ..files import Choice, Many, Quantity, Whole, entry, flag, save_drawing, write_csv, write_tables
from ..mechanisms import find_mechanism
from ..periodic import default_variable
from ..run import Case, read_case
from ..slider import inverse_dynamics, motion_of_plant, slider_motion
from ..studio import page_state
from ..youssef import require_five_bar
from .answers import Answer, FloatArray, chart, file, folder

_POINT = Many(Quantity("m"), length=2)
#: Notes on kinds of linkages that the page cannot show completely.
_NOTES: dict[syn.Kind, str] = {
    "slider-crank": "The page's slider-crank has no coupler point: its curve is in the small picture.",
    "geared-five-bar": "The page cannot show a geared five-bar: its drawing is at real size, and linkwork synthesize with "
    "its own case file searches only its gears.",
}
#: Name of the case file of a search; step between the points of a curve that a small picture shows.
_TASK, _EVERY = "linkages.toml", 4


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drawn:
    """Options that the jobs `linkages` and `moved` share.

    They are the points of the drawn path (m), whether it is closed, and the number of starts of the search.
    """

    points: tuple[tuple[float, float], ...] = entry(Many(_POINT, least=3))
    closed: bool = entry(flag, True)
    starts: int = entry(Whole(1), 24)

    def task(self) -> syn.UntimedPath:
        return syn.UntimedPath(path=syn.TargetPath(points=np.array(self.points), closed=self.closed))


@dataclass(frozen=True, slots=True, kw_only=True)
class Linkages(_Drawn):
    """Options of a search for linkages: kinds, least transmission angle (rad) and greatest length of a link (m)."""

    kinds: tuple[syn.Kind, ...] = entry(Many(Choice(get_args(syn.Kind)), least=1), ("four-bar",))
    least_transmission: float = entry(Quantity("rad", least=0.0, below=0.5 * pi), syn.LeastTransmission().angle)
    longest: float = entry(Quantity("m", above=0.0), inf)

    def constraints(self) -> list[syn.Constraint]:
        angle = self.least_transmission
        found: list[syn.Constraint] = [syn.LeastTransmission(angle=angle)] if angle else [syn.FullTurn()]
        return [*found, syn.LargestLink(length=self.longest)] if isfinite(self.longest) else found

    def tables(self, title: str, **search: Any) -> dict[str, Any]:
        """Return the tables of a case file with which `linkwork synthesize` repeats the search.

        ``search`` are further entries of its table [search].
        """
        angle: dict[str, Any] = {"least_transmission_angle": self.least_transmission or False}
        turn = {} if self.least_transmission else {"full_turn": True}
        longest = {"largest_link": self.longest} if isfinite(self.longest) else {}
        return {
            "title": title,
            "task": {"kind": "untimed-path", "points": [list(p) for p in self.points], "closed": self.closed},
            "constraints": angle | turn | longest,
            "search": {"starts": self.starts, "kinds": list(self.kinds)} | search,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved(_Drawn):
    """Options of a search for the slider's motion: greatest number of harmonics, and greatest stroke (m)."""

    starts: int = entry(Whole(1), 8)
    harmonics: int = entry(Whole(1), 2)
    stroke: float = entry(Quantity("m", above=0.0), inf)


def linkages(case: Case, wanted: Linkages) -> Answer:
    """Find linkages for the drawn path; return them ranked, with pictures, page states, and the path in each linkage's frame.

    As a geared five-bar cannot be run, the answer has a drawing for CAD and a case file instead of the state of a five-bar.
    """
    found = syn.synthesize(
        wanted.task(), constraints=wanted.constraints(), kinds=wanted.kinds, search=syn.Search(starts=wanted.starts)
    )
    headings = ["rank", "area [mm²]", "worst [mm]", "transmission [deg]", "largest link [mm]", "kind"]
    rows, states, curves, files = [], [], [], []
    with folder() as place:
        for rank, solution in enumerate(found.solutions, 1):
            v = solution.verdicts
            rows.append(
                [
                    str(rank),
                    f"{1e6 * solution.error:.4g}",
                    f"{1e3 * solution.evaluation.worst:.3g}",
                    syn.format_transmission(v),
                    f"{1e3 * solution.largest_link:.4g}",
                    ", ".join(filter(None, (v.grashof, *v.defects, syn.format_variants(solution)))),
                ]
            )
            title = f"Linkage {rank} for a path that was drawn"
            shown = not isinstance(solution.linkage, syn.FiveBar)
            states.append(_state(solution, title) if shown else None)
            curves.append(_in_ground_frame(np.array(wanted.points), solution.linkage).tolist())
            files.append(
                [] if shown else _files_instead_of_state(solution, wanted, Path(place) / f"linkage-{rank}", title)
            )
        found_kinds = {solution.linkage.kind for solution in found.solutions}
        said = (
            f"{format_count(len(rows), 'linkage')} in {found.seconds:.1f} s, the area between the curves the least first. "
            f"linkwork synthesize {_TASK} finds them again, and writes drawings, plates and a sheet of the first."
        )
        task = write_tables(Path(place) / _TASK, wanted.tables("A path that was drawn"))
        return {
            "words": " ".join([said, *(note for kind, note in _NOTES.items() if kind in found_kinds)]),
            "table": {"headings": headings, "rows": rows, "files": files},
            "pictures": [_picture(solution) for solution in found.solutions],
            "states": states,
            "curves": curves,
            "closed": wanted.closed,
            "files": [file(task)],
        }


def _state(solution: syn.Solution, title: str) -> Answer:
    case = read_case(syn.run_case(solution, syn.MachineSpec(), title), folder=Path(), title=title)
    state, speed = page_state(case), default_variable(find_mechanism(case.parameters))
    # the path does not say in which direction the crank turns; the page seeks periodic motions with positive speed
    state["values"][speed] = abs(state["values"][speed])
    return state


def _files_instead_of_state(solution: syn.Solution, wanted: Linkages, path: Path, title: str) -> list[Answer]:
    """Return the drawing of a linkage that the page cannot show, and a case that searches only its kind and gear ratio."""
    pivot = solution.linkage.pivot
    assert isinstance(pivot, syn.SecondCrank)
    case = wanted.tables(title, kinds=[solution.linkage.kind], gears=[pivot.ratio])
    drawn = syn.drawing(solution, title=title)
    return [file(write_tables(path.with_suffix(".toml"), case)), file(save_drawing(path.with_suffix(".dxf"), drawn))]


def _picture(solution: syn.Solution) -> Answer:
    """Return the lines of a small picture of a linkage at the first station of the path: links, guide and traced curve (m)."""
    scene = syn.LinkageScene(solution)
    pins = scene.pins(float(scene.rotation[0])) or {}
    links = [
        "AB",
        "BCPB",
        *([] if isinstance(solution.linkage, syn.SliderCrank) else ["CD"]),
        *(["DE"] if scene.second_crank else []),
    ]
    guide = [] if scene.guide is None else [scene.guide.tolist()]
    # for an open path the rest of the curve, which may be far larger, is left out
    curves = scene.curves if scene.target_closed else [] if scene.traced_curve is None else [scene.traced_curve]
    return {
        "links": [[pins[name] for name in link] for link in links if pins] + guide,
        "curves": [piece[np.isfinite(piece).all(axis=1)][::_EVERY].tolist() for piece in curves],
    }


def _in_ground_frame(points: FloatArray, linkage: syn.Linkage) -> FloatArray:
    """Return points of the plane in the frame of a linkage's ground link, shape (n, 2)."""
    from_pivot = points @ [1.0, 1j] - complex(linkage.pivot_x, linkage.pivot_y)
    z = from_pivot * np.exp(-1j * linkage.ground_angle)
    return np.column_stack([z.real, z.imag])


def moved(case: Case, wanted: Moved) -> Answer:
    """Find slider motions with 1, 2, ... harmonics for the drawn path, and the control force of the last motion."""
    p = case.parameters
    require_five_bar(p, "a motion of the slider")
    if p.coupler_point_distance == 0.0:
        raise ParameterError(
            "coupler.point_distance",
            0.0,
            "not be zero: the path is that of the crank pin, which the slider does not move",
        )
    task = wanted.task()
    linkage = syn.Linkage(
        ground_length=p.ground_length,
        crank_length=p.crank_length,
        coupler_length=p.coupler_length,
        rocker_length=p.rocker_length,
        point_distance=p.coupler_point_distance,
        point_angle=p.coupler_point_angle,
        branch=p.assembly_branch,
    )
    if wanted.closed:
        still = syn.Solution.from_linkage(task, linkage)
    else:
        kept = {name: (value, value) for name, value in linkage.values().items() if name != "branch"}
        still = syn.synthesize(
            task, kept, [syn.FullTurn()], search=syn.Search(starts=4, candidates=1 << 10, solutions=1)
        ).best
    found = [still]
    guide = (p.slider_guide_angle, p.slider_guide_angle)
    for harmonics in range(1, wanted.harmonics + 1):
        unknown = syn.SliderUnknown(harmonics=harmonics, guide_angle=guide, stroke=wanted.stroke)
        search = syn.Search(starts=wanted.starts)
        found.append(slider_motion(task, still, unknown, guesses=found[1:], search=search).best)
    rows = [
        [
            "at rest" if n == 0 else format_count(n, "harmonic"),
            f"{1e6 * s.error:.4g}",
            f"{1e3 * s.evaluation.worst:.3g}",
            f"{1e3 * s.linkage.pivot.stroke:.4g}" if isinstance(s.linkage.pivot, syn.SliderMotion) else "",
            syn.format_transmission(s.verdicts),
        ]
        for n, s in enumerate(found)
    ]
    turn = np.linspace(0.0, 2.0 * pi, 181)
    last = found[-1].linkage
    charts = [chart("Slider position over the crank angle", "mm", turn, 1e3 * motion_of_plant(last)(turn))]
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
        f" It takes a force of {drive.peak_force:.4g} N at most, {drive.rms_force:.4g} N rms, and a crank torque of "
        f"{drive.peak_torque:.4g} N.m at most."
    )
    charts.append(chart("Force on the slider over the crank angle", "N", drive.crank_angle, drive.force))
    own = {"crank angle [rad]": drive.crank_angle, "slider position [m]": drive.slider(drive.crank_angle)}
    with folder() as place:
        answer["files"] = [file(write_csv(Path(place) / "slider-motion.csv", own | dict(drive.columns())))]
    return answer
