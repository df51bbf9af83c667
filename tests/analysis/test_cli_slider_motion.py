"""`linkwork slider-motion`: its case files, what it writes, says and refuses, and that what it writes runs."""

from dataclasses import replace
from math import pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from click.testing import Result

from analysis import cli, slider
from analysis import synthesis as syn
from analysis.numerics.fourier import FourierSeries
from analysis.run import load_case, load_parameters, read_case, simulate
from analysis.slider import SliderCase, linkage_from_csv, load_slider_case, motion_of_plant
from analysis.systems import load_system
from linkwork.errors import InputError
from tests import scripts
from tests.linkages import BASE

from .conftest import csv, run_case

pytest.importorskip("casadi")

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "slider-motion.toml"
MOTION = syn.SliderMotion(FourierSeries(np.array([0.0, 0.012]), np.array([0.0, 0.01])), 0.4)
LINKAGE = {
    name: f"{getattr(BASE, name)!r} {'rad' if name.endswith(('angle', 'phase')) else 'm'}"
    for name in (
        *("pivot_x", "pivot_y", "ground_length", "crank_length", "coupler_length", "rocker_length"),
        *("point_distance", "ground_angle", "crank_phase", "point_angle"),
    )
}


def tables(**more: Any) -> dict[str, Any]:
    """A case: the path of the moved linkage, 24 points, links kept."""
    points = replace(BASE, pivot=MOTION).path(syn.turn(24)).tolist()
    return {
        "title": "Moved",
        "task": {"kind": "timed-path", "points": points},
        "linkage": dict(LINKAGE),
        "constraints": {"least_transmission_angle": "10 deg"},
        "slider": {"harmonics": 1, "starts": 6},
        "make": {"slider_damping": "20 N*s/m"},
    } | more


@pytest.fixture
def linkwork(linkwork, tmp_path):
    def call(case: dict[str, Any] | Path, *words: object, code: int = 0) -> Result:
        if isinstance(case, dict):
            (tmp_path / "case.toml").write_text(tomli_w.dumps(case), encoding="utf-8")
            case = tmp_path / "case.toml"
        return linkwork("slider-motion", case, *words, code=code)

    return call


def read(tmp_path: Path, case: dict[str, Any]) -> SliderCase:
    path = tmp_path / "read.toml"
    path.write_text(tomli_w.dumps(case), encoding="utf-8")
    return load_slider_case(path)


def motion_of(case: SliderCase) -> syn.Solution:
    """Find a motion of one harmonic on the case's four-bar."""
    return case.find_motion(case.find_four_bar(), 1, (), progress=False).best


def test_the_example_does_what_it_says(linkwork, tmp_path) -> None:
    result = linkwork(EXAMPLE)
    for words in ("fixed", "slider, 1 harmonic ", "slider, 3 harmonics", "rms force", "feed-forward + PID"):
        assert words in result.output
    # the printed linkage's own error, 35.835 deg2 with the weights as 1000 and 1; two harmonics within the goal of 0.76
    assert "35835" in result.output
    row = next(line for line in result.output.splitlines() if "slider, 2 harmonics" in line)
    assert float(row.split("│")[2]) < 760.0
    names = {p.name for p in (tmp_path / "out").glob("[!.]*")}
    assert names == {
        *("curve.csv", "report.txt", "linkage.dxf", "linkage.svg", "linkage.png", "linkage.toml"),
        *("motion.csv", "motion.png"),
        *("force.csv", "five-bar-parameters.toml", "five-bar.toml", "system.toml", "tracking.csv", "tracking.png"),
    }


def test_what_is_written_runs_and_reproduces_the_motion(linkwork, tmp_path) -> None:
    """The control force as a table over time, on the plant in process, through one turn: slider and coupler point."""
    load, make = {"fx": "2 N", "fy": "-3 N"}, {"slider_damping": "20 N*s/m", "load": ["1 N", "4 N"]}
    drive = {"speed": "120 rpm", "best_spring": True}
    linkwork(tables(drive=drive, load=load, make=make), "--no-plots", "--out", "moved")
    case = load_case(tmp_path / "moved" / "five-bar.toml")
    assert case.stop_time == pytest.approx(0.5)
    assert load_parameters(tmp_path / "moved" / "five-bar-parameters.toml") == case.parameters
    run = run_case(case)
    columns = csv(tmp_path / "moved" / "motion.csv")
    assert columns["slider position [m]"] == pytest.approx(columns["slider.position [m]"], abs=1e-15)
    n = len(columns["slider.position [m]"])
    assert run["slider.position"][:n] == pytest.approx(columns["slider.position [m]"], abs=1e-7)
    assert run["pin.C.fx"][:n] == pytest.approx(columns["pin.C.fx [N]"], abs=1e-3)
    # the plant's frame lies along the ground link, with A at its origin
    way = syn.turn(24)
    p = columns["coupler.point.x [m]"] + 1j * columns["coupler.point.y [m]"]
    p = np.interp(way, columns["crank.angle [rad]"], p, period=2.0 * pi)
    there = p * np.exp(1j * BASE.ground_angle) + complex(BASE.pivot_x, BASE.pivot_y)
    wanted = replace(BASE, pivot=MOTION).path(way - BASE.crank_phase) @ [1.0, 1j]
    assert np.abs(there - wanted).max() < 2e-6
    # the linkage as one of its own, with the motion commanded
    own = load_case(tmp_path / "moved" / "linkage.toml")
    run = run_case(own, stop_time=0.5, step=0.5 / 24)
    reached = np.column_stack([run["P.x"], run["P.y"]]) @ [1.0, 1j]
    phi = run["crank.angle"] - BASE.ground_angle - BASE.crank_phase
    assert np.abs(reached - replace(BASE, pivot=MOTION).path(phi) @ [1.0, 1j]).max() < 1e-6
    force = np.interp(phi, columns["crank rotation [rad]"], columns["slider.force [N]"], period=2.0 * pi)
    assert run["pivotDrive.applied_force"] == pytest.approx(force, abs=1e-3)
    scripts.linkwork("run moved/five-bar.toml --no-plot")


def test_a_pivot_that_is_set_and_kept_is_held_in_the_described_linkage(tmp_path) -> None:
    chosen = read(tmp_path, tables(drive={"speed": "60 rpm"}))
    held = BASE.with_pivot(syn.SliderMotion(FourierSeries.constant(0.01), 0.4))
    solution = syn.Solution.from_linkage(chosen.synthesis.task, held)
    own = read_case(syn.described_case(solution, chosen.machine(solution), "held"), folder=tmp_path)
    run = simulate(own.parameters, own.inputs, initial=own.initial, stop_time=0.2)
    assert run["pivot.position"] == pytest.approx(np.full(len(run), 0.01), abs=1e-15)


def test_the_motion_that_made_the_path_is_found_and_its_numbers_are_reported(linkwork, tmp_path) -> None:
    slow = {"period": "50 ms", "revolutions": 1}
    result = linkwork(tables(drive={"speed": "120 rpm"}, tracking=slow), "--no-plots")
    assert "wrote out/motion.csv" in result.output
    assert "sampled every 0.05 s, the feedback is unstable: errors grow by a factor of" in result.output
    assert not list((tmp_path / "out").glob("*.png"))
    columns = csv(tmp_path / "out" / "motion.csv")
    phi, u, slope = (columns[name] for name in ("crank rotation [rad]", "slider position [m]", "du/dphi [m/rad]"))
    # a guide is the same one from its other end
    assert np.abs(u) == pytest.approx(np.abs(MOTION.series(phi)), abs=1e-7)
    assert np.gradient(u, phi, edge_order=2) == pytest.approx(slope, abs=2e-6)
    assert np.gradient(slope, phi, edge_order=2) == pytest.approx(columns["d2u/dphi2 [m/rad2]"], abs=2e-6)
    force = columns["slider.force [N]"]
    assert f"{np.sqrt(np.mean(force**2)):.5g} N" in result.output
    assert f"{np.abs(columns['slider.power [W]']).max():.5g} W" in result.output
    assert columns["slider.power [W]"] == pytest.approx(force * columns["slider.velocity [m/s]"], abs=1e-12)
    table = csv(tmp_path / "out" / "force.csv")
    assert table["time [s]"][-1] == pytest.approx(0.5)
    assert table["slider.force [N]"][[0, -1]] == pytest.approx(force[0])


def test_the_motion_over_the_plants_crank_angle() -> None:
    phi = np.linspace(0.0, 2.0 * pi, 17)
    moved = replace(BASE, pivot=MOTION)
    assert motion_of_plant(moved)(phi + BASE.crank_phase) == pytest.approx(MOTION.series(phi), abs=1e-15)
    assert motion_of_plant(BASE)(phi) == pytest.approx(np.zeros(17))
    with pytest.raises(InputError, match="second crank"):
        motion_of_plant(BASE.with_pivot(syn.SecondCrank(length=0.01)))


def test_a_spring_takes_part_of_the_force(linkwork, tmp_path) -> None:
    case = tables()
    chosen = read(tmp_path, case | {"drive": {"speed": "300 rpm"}})
    with_spring = read(tmp_path, case | {"drive": {"speed": "300 rpm", "best_spring": True}})
    solution = motion_of(chosen)
    bare, sprung = chosen.compute_drive(solution), with_spring.compute_drive(solution)
    assert bare.parameters.slider_stiffness == 0.0
    assert sprung.parameters.slider_stiffness > 0.0
    assert sprung.rms_force < bare.rms_force
    result = linkwork(case | {"drive": {"speed": "300 rpm", "best_spring": True}}, "--no-plots")
    assert f"{sprung.parameters.slider_stiffness:.5g} N/m, free at" in result.output


def test_tracking_without_feed_forward_is_worse(tmp_path) -> None:
    drive = {"speed": "120 rpm"}
    errors = []
    for options in ({}, {"feedforward": False}, {"bandwidth": 0}, {"coulomb_friction": "5 N", "mass_error": 0.1}):
        chosen = read(tmp_path, tables(drive=drive, tracking={"revolutions": 2} | options))
        solution = motion_of(chosen)
        errors.append(chosen.run_tracking(chosen.compute_drive(solution)).metrics().rms_error)
        system = chosen.system(chosen.compute_drive(solution), "five-bar.toml")
        assert ("controller.feed_forward" in system["connections"]) == options.get("feedforward", True)
        assert system["parts"]["reference"]["values"]["lead"] == "0.001 s"
    both, feedback, forward, wrong = errors
    assert both < 1e-6
    assert feedback > 20.0 * both
    assert forward < 1e-5
    assert 2.0 * both < wrong < 2e-4


def test_the_written_system_has_the_plant_and_the_load_of_the_tracking(linkwork, tmp_path) -> None:
    load = {"fx": "2 N", "fy": "-3 N"}
    tracking = {"coulomb_friction": "5 N", "mass_error": 0.1, "load_known": False}
    base = tables(drive={"speed": "120 rpm"}, load=load, make={"slider_damping": "20 N*s/m", "slider_mass": "2 kg"})
    systems = {}
    for name, case in (("same", base), ("other", base | {"tracking": tracking}), ("unloaded", base | {"load": {}})):
        linkwork(case, "--no-plots", "--out", name)
        systems[name] = load_system(tmp_path / name / "system.toml").members
    same, other = (systems[name]["linkage"].values for name in ("same", "other"))
    heavier = ("slider.mass", "coupler.mass", "rocker.mass", "coupler.inertia", "rocker.inertia")
    expected = dict(same) | {name: 1.1 * same[name] for name in heavier} | {"slider.coulomb_friction": 5.0}
    assert other == pytest.approx(expected, rel=1e-14)
    assert same["slider.mass"] == 2.0
    # the force that the feed-forward gives is that of the model without the load
    assert systems["other"]["reference"].values == pytest.approx(systems["unloaded"]["reference"].values, abs=1e-9)
    assert abs(systems["same"]["reference"].values["load_0"] - systems["other"]["reference"].values["load_0"]) > 0.1


def test_the_slider_is_made_as_the_case_says(tmp_path) -> None:
    make = {"damping": "20 N*s/m", "stiffness": "300 N/m", "coulomb_friction": "2 N", "mass": "1 kg"}
    given = {f"slider_{name}": text for name, text in make.items()}
    made = read(tmp_path, tables(make=given)).synthesis.make.sliding_five_bar(BASE)
    assert [getattr(made, name) for name in given] == [20, 300, 2, 1]
    # a pivot that is to move is not held, unlike that of a four-bar
    free = read(tmp_path, tables(make={})).synthesis.make.sliding_five_bar(BASE)
    assert free.slider_stiffness == free.slider_damping == 0.0


def test_the_strategy_stops_where_it_is_good_enough_and_says_why(linkwork, tmp_path) -> None:
    strategy = {"tolerance": "0.01 mm", "harmonics": 2, "ratios": [1], "starts": 4}
    result = linkwork(tables(strategy=strategy, slider={"stroke": "60 mm"}), "--no-plots")
    words = " ".join(result.output.replace("│", " ").split())
    assert "four-bar worst" in words
    assert "times the tolerance 0.01 mm: rejected" in words
    assert "is within 0.01 mm: accepted" in words
    assert "five-bar" not in words
    assert csv(tmp_path / "out" / "motion.csv")["du/dphi [m/rad]"].size == 720
    by_error = strategy | {"criterion": "error", "tolerance": "1e-6 mm^2"}
    chosen = read(tmp_path, tables(strategy=by_error, slider={}))
    assert chosen.strategy.tolerance == pytest.approx(1e-12)


def test_a_second_crank_has_no_forces(linkwork, tmp_path) -> None:
    points = BASE.with_pivot(syn.SecondCrank(length=0.03, ratio=2, phase=-0.8)).path(syn.turn(24)).tolist()
    strategy = {"tolerance": "0.01 mm", "harmonics": 1, "ratios": [2], "starts": 4}
    case = tables(strategy=strategy, slider={}, drive={"speed": "60 rpm"})
    case["task"]["points"] = points
    result = linkwork(case, "--no-plots")
    assert "geared 2:1" in result.output
    assert "no forces are computed" in result.output
    assert not (tmp_path / "out" / "motion.csv").exists()
    assert (tmp_path / "out" / "report.txt").exists()


def test_nothing_is_good_enough(linkwork) -> None:
    strategy = {"tolerance": "1e-12 mm", "harmonics": 1, "ratios": [], "starts": 2}
    result = linkwork(tables(strategy=strategy, slider={"stroke": "10 mm"}), "--no-plots")
    assert "none meets the tolerance; the nearest is kept: " in result.output


def test_the_linkage_is_found_first_or_read_from_what_synthesize_wrote(linkwork, tmp_path) -> None:
    wanted = syn.TimedPath(points=replace(BASE, pivot=MOTION).path(syn.turn(24)))
    search = {"starts": 4, "candidates": 4096}
    case = tables(search=search, constraints={"largest_link": "300 mm"})
    del case["linkage"]
    found = read(tmp_path, case)
    first = found.find_four_bar()
    result = syn.synthesize(wanted, constraints=found.synthesis.constraints, search=syn.Search(**search))
    assert first.error == pytest.approx(result.best.error, rel=1e-12)
    result.to_csv(tmp_path / "solutions.csv")
    for rank, solution in enumerate(result.solutions, start=1):
        assert linkage_from_csv(tmp_path / "solutions.csv", rank).values() == solution.linkage.values()
    case["linkage"] = {"file": "solutions.csv"}
    assert read(tmp_path, case).find_four_bar().error == pytest.approx(first.error, rel=1e-12)
    linkwork(case, "--no-plots")


@pytest.mark.long
def test_links_that_are_free_do_better(tmp_path) -> None:
    case = tables(slider={"harmonics": 1, "starts": 4, "stroke": "10 mm"}, constraints={"largest_link": "300 mm"})
    free = case | {"slider": case["slider"] | {"links": "free"}}
    kept, freed = read(tmp_path, case), read(tmp_path, free)
    errors = [motion_of(one) for one in (kept, freed)]
    assert errors[1].error < 0.5 * errors[0].error
    assert errors[1].linkage.largest_link <= 0.3 * (1.0 + 1e-6)
    bounded = read(tmp_path, free | {"bounds": {"crank_length": ["59 mm", "61 mm"]}})
    crank = motion_of(bounded).linkage.crank_length
    assert 0.059 - 1e-9 <= crank <= 0.061 + 1e-9


def test_an_open_path_is_placed_by_itself(tmp_path) -> None:
    t = np.linspace(0.3, 2.4, 40)
    points = BASE.path(t).tolist()
    task = {"kind": "untimed-path", "points": points, "closed": False, "measure": "distance"}
    chosen = read(tmp_path, tables(task=task, drive={"speed": "60 rpm"}))
    four_bar = chosen.find_four_bar()
    assert chosen.compute_drive(four_bar).crank_speed == pytest.approx(2.0 * pi)
    assert four_bar.evaluation.worst < 1e-5
    ends = np.exp(1j * four_bar.evaluation.rotation[[0, -1]])
    assert ends == pytest.approx(np.exp(1j * t[[0, -1]]), abs=1e-3)
    assert chosen.find_motion(four_bar, 1, (), progress=False).best.error <= four_bar.error + 1e-12


def test_a_path_that_is_traced_clockwise_is_driven_so(tmp_path) -> None:
    points = BASE.path(np.linspace(2.4, 0.3, 40)).tolist()
    task = {"kind": "untimed-path", "points": points, "closed": False, "measure": "distance"}
    chosen = read(tmp_path, tables(task=task, drive={"speed": "60 rpm"}))
    assert chosen.compute_drive(chosen.find_four_bar()).crank_speed == pytest.approx(-2.0 * pi)


def test_the_options_of_the_command_line_take_the_place_of_the_files(linkwork) -> None:
    few = ("--no-plots", "--set", "slider.starts=8")
    result = linkwork(tables(), "--harmonics", 2, "--seed", 5, "--jobs", 1, "--set", "slider.stroke='20 mm'", *few)
    assert "slider, 2 harmonics" in result.output
    row = next(line for line in result.output.splitlines() if "slider, 2 harmonics" in line)
    assert float(row.split("│")[4]) < 20.1


@pytest.mark.parametrize("option", [("--harmonics", 2), ("--harmonics", 3), ("--objective", "worst")])
def test_options_of_a_motion_are_not_for_the_strategy(linkwork, option) -> None:
    result = linkwork(tables(strategy={"tolerance": "1 mm"}, slider={}), *option, code=cli.WRONG)
    assert "must not come with [strategy]" in result.output


def test_ctrl_c_keeps_the_best_so_far(linkwork, tmp_path, monkeypatch) -> None:
    done = []

    def stopped(task: Any, *arguments: Any, **options: Any) -> Any:
        found = slider.slider_motion(task, *arguments, **options)
        done.append(found)
        if len(done) == 2:
            raise syn.SynthesisInterrupted(found, 3, 6)
        return found

    monkeypatch.setattr("analysis.slider.cases.slider_motion", stopped)
    case = tables(slider={"harmonics": [1, 2, 3], "starts": 3}, drive={"speed": "60 rpm"})
    result = linkwork(case, "--no-plots", code=cli.INTERRUPTED)
    assert "stopped after 3 of 6 searches; the best so far is kept" in result.output
    assert "slider, 2 harmonics" in result.output
    assert "slider, 3 harmonics" not in result.output
    assert (tmp_path / "out" / "motion.csv").exists()


def test_ctrl_c_in_the_strategy_keeps_its_steps(linkwork, tmp_path, monkeypatch) -> None:
    def stopped(*arguments: Any, **options: Any) -> Any:
        found = slider.simplest_mechanism(*arguments, **options)
        raise slider.StrategyInterrupted(replace(found, steps=found.steps[:1], met=False))

    monkeypatch.setattr("analysis.slider.cases.simplest_mechanism", stopped)
    # the four-bar would be good enough, so that nothing else is sought
    strategy = {"tolerance": "1 m", "harmonics": 1, "ratios": [], "starts": 2}
    result = linkwork(tables(strategy=strategy, slider={}), "--no-plots", code=cli.INTERRUPTED)
    assert "none meets the tolerance so far; the nearest is kept: four-bar" in result.output
    assert "stopped after 1 mechanism; the best so far is kept" in result.output
    assert (tmp_path / "out" / "report.txt").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"slyder": {}}, "slyder"),
        ({"slider": None}, "slider"),
        ({"trade_off": {"over": "size", "limits": ["1 m", "2 m"]}}, "trade_off"),
        ({"slider": {"harmonic": 2}}, "slider.harmonic"),
        ({"slider": {"harmonics": -1}}, "slider.harmonics"),
        ({"slider": {"stroke": "-1 mm"}}, "slider.stroke"),
        ({"slider": {"stroke": "20"}}, "slider.stroke"),
        ({"slider": {"speed": "1 m/s"}}, "slider.speed"),
        ({"slider": {"guide_angle": ["30 deg", "10 deg"]}}, "slider.guide_angle"),
        ({"slider": {"position": "3 mm"}}, "slider position"),
        ({"slider": {"links": "loose"}}, "slider.links"),
        ({"slider": {"starts": 0}}, "slider.starts"),
        ({"linkage": {"crank_length": "6 cm"}}, "linkage.ground_length"),
        ({"linkage": LINKAGE | {"crank_lenght": 1.0}}, "linkage.crank_length"),
        ({"linkage": LINKAGE | {"branch": 2}}, "branch"),
        ({"linkage": {"file": "nowhere.csv"}}, "nowhere.csv"),
        ({"linkage": {"file": "case.toml"}}, "not a list of linkages"),
        ({"bounds": {"crank_length": "5 cm"}}, "bounds.crank_length"),
        ({"load": {"fx": "2 N"}}, "drive.speed"),
        ({"tracking": {}}, "drive.speed"),
        ({"drive": {}}, "drive.speed"),
        ({"drive": {"speed": "0 rpm"}}, "drive.speed"),
        ({"drive": {"speed": "60 rpm"}, "tracking": {"period": "0 s"}}, "tracking.period"),
        ({"drive": {"speed": "60 rpm"}, "tracking": {"revolutions": 0.5}}, "tracking.revolutions"),
        ({"drive": {"speed": "60 rpm"}, "tracking": {"mass_error": -1}}, "tracking.mass_error"),
        ({"drive": {"speed": "60 rpm"}, "tracking": {"bandwidth": "-1 rad/s"}}, "tracking.bandwidth"),
        ({"strategy": {}}, "strategy.tolerance"),
        ({"strategy": {"tolerance": "1 mm^2"}}, "strategy.tolerance"),
        ({"strategy": {"tolerance": "1 mm", "criterion": "mean"}}, "strategy.criterion"),
        ({"strategy": {"tolerance": "1 mm", "ratios": [1.5]}}, "strategy.ratios"),
        ({"strategy": {"tolerance": "1 mm"}}, "slider.harmonics is 1: it must not come with [strategy]"),
        (
            {"task": tables()["task"] | {"objective": "error"}, "slider": None, "strategy": {"tolerance": "1 mm"}},
            "task.objective is 'error': it must not come with [strategy]",
        ),
        ({"search": {"kinds": ["slider-crank"]}}, "search.kinds"),
        ({"search": {"gears": [2]}}, "gears"),
        ({"task": {"kind": "timed-path", "points": [[0, 0]]}}, "points"),
        ({"task": {"kind": "slider-function", "position": [0.2, 0.1, 0.2]}}, "SliderFunction needs a slider at C"),
        ({"task": {"kind": "quick-return", "stroke": "10 cm", "time_ratio": 1.3}}, "it is for a slider-crank"),
        ({"constraints": {"largest_link": "10 mm"}}, "143.5 mm"),
    ],
)
def test_bad_input_is_one_sentence(linkwork, tmp_path, change: dict[str, Any], words: str) -> None:
    case = {name: table for name, table in (tables() | change).items() if table is not None}
    result = linkwork(case, "--no-plots", code=cli.WRONG)
    assert words in result.output
    assert result.output.startswith("error: ")
    assert len(result.output.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_list_of_linkages_is_checked(tmp_path) -> None:
    good = tmp_path / "solutions.csv"
    task = syn.TimedPath(points=BASE.path(syn.turn(12)))
    syn.synthesize(task, search=syn.Search(starts=2, candidates=1024)).to_csv(good)
    with pytest.raises(InputError, match="none of rank 99"):
        linkage_from_csv(good, 99)


def test_the_motion_is_read_with_its_units(tmp_path) -> None:
    motion = {"harmonics": [3, 1], "guide_angle": "20 deg", "position": ["-10 mm", "2 cm"]}
    motion |= {"stroke": "25 mm", "speed": "30 mm/rad", "acceleration": "50 mm/rad^2"}
    chosen = read(tmp_path, tables(slider=motion))
    assert chosen.slider.harmonics == (1, 3)
    u = chosen.slider.unknown(1)
    assert u.guide_angle == pytest.approx((radians(20.0), radians(20.0)))
    assert u.position == pytest.approx((-0.01, 0.02))
    assert (u.stroke, u.speed, u.acceleration) == pytest.approx((0.025, 0.03, 0.05))
    assert isinstance(chosen.linkage, syn.Linkage)
    assert chosen.linkage.values() == BASE.values()
