"""`linkwork synthesize`, and the case files it reads."""

import json
import re
import tomllib
from dataclasses import replace
from math import asin, cos, degrees, pi, radians, sin
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import analysis.synthesis as syn
from analysis import cli, figures
from analysis.files import entry_names, read_rows
from analysis.numerics.symbolic import library
from analysis.run import Inputs, load_case, load_parameters, read_case, simulate
from analysis.synthesis.case import case as cases
from analysis.synthesis.case.case import requirement
from analysis.synthesis.case.tables import KINDS
from analysis.synthesis.search.statement import trace_requirement
from analysis.synthesis.task.constraint import UNKNOWNS
from linkwork.errors import InputError, LinkworkError, ParameterError
from tests import scripts

from .conftest import csv, run_case

ROOT = Path(__file__).parents[2]
ELLIPSE = '[task]\nkind = "timed-path"\nx = "20 + 10*cos(t)"\ny = "15 + 5*sin(t)"\nunit = "cm"\nn = 24\n'
#: Few starts: enough for an ellipse.
QUICK = "[search]\ncandidates = 4096\nstarts = 3\nsolutions = 2\n"
CAPPED = ELLIPSE + QUICK + '[constraints]\nlargest_link = "50 cm"\n'
TRADED = CAPPED + '[trade_off]\nover = "size"\nlimits = ["40 cm", "50 cm"]\nstarts = 1\n'
ROCKING = syn.Linkage(ground_length=0.3, crank_length=0.08, coupler_length=0.25, rocker_length=0.2, point_distance=0.1)
SQUARE = "[[0, 0], [1, 0], [1, 1], [0, 1]]"


def case(text: str, folder: Path, **overrides):
    path = folder / "case.toml"
    path.write_text(text)
    return syn.load_synthesis_case(path, overrides)


# The command


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    (folder / "case.toml").write_text(TRADED)
    return scripts.linkwork("synthesize", folder / "case.toml", "--out", folder / "out"), folder


def test_it_reports_and_writes_what_it_found(run) -> None:
    result, folder = run
    written = {path.name for path in (folder / "out").glob("[!.]*")}
    assert {name for name in written if not name.startswith("linkage-")} == {
        "solutions.csv", "best-curve.csv", "best-report.txt", "best.dxf", "best.svg", "five-bar-parameters.toml",
        "five-bar.toml", "best-linkage.png", "alternatives.png", "trade-off.csv", "trade-off.png", "cognates.csv",
        "best-plates.dxf", "best-plates.svg", "best-sheet.pdf", "linkage.toml",
    }  # fmt: skip
    assert all(f"wrote {folder / 'out' / name}" in result.output for name in written)
    first = read_rows(folder / "out" / "solutions.csv")[0]
    # as reported, in mm2, and what the curve's file adds up to
    quality = float(first["quality [m2]"])
    assert f"{1e6 * quality:.5g}" in result.output
    assert (csv(folder / "out" / "best-curve.csv")["error [m]"] ** 2).sum() == pytest.approx(quality)
    assert float(first["ground_length [m]"]) <= 0.5 + 1e-6
    assert float(first["least transmission angle [rad]"]) >= radians(40.0) - 1e-6
    trade = [float(row["quality [m2]"]) for row in read_rows(folder / "out" / "trade-off.csv")]
    assert trade[0] > trade[1]
    assert "crank-rocker" in result.output
    assert "no circuit defect" not in result.output


def test_the_five_bar_runs_and_its_point_traces_the_path(run, linkwork) -> None:
    _, folder = run
    head, _ = (folder / "out" / "five-bar.toml").read_text(encoding="utf-8").split("\n", 1)
    assert "bars 20 x 5 mm of 7850 kg/m³" in head
    chosen = load_case(folder / "out" / "five-bar.toml")
    assert load_parameters(folder / "out" / "five-bar-parameters.toml") == chosen.parameters
    motion = run_case(chosen)
    curve = csv(folder / "out" / "best-curve.csv")
    # the plant's frame is that of the ground link, from A
    first = read_rows(folder / "out" / "solutions.csv")[0]
    a1, *pivot = (float(first[name]) for name in ("ground_angle [rad]", "pivot_x [m]", "pivot_y [m]"))
    place = np.column_stack([motion["coupler.point.x"], motion["coupler.point.y"]])
    plane = place @ np.array([[cos(a1), sin(a1)], [-sin(a1), cos(a1)]]) + pivot
    made = np.column_stack([curve["path x [m]"], curve["path y [m]"]])
    # samples a 360th of a turn apart; the slider gives by some micrometres
    assert len(plane) == 721
    np.testing.assert_allclose(plane[360 : 720 : 360 // len(made)], made, atol=1e-4)
    assert np.abs(motion["slider.position"]).max() < 1e-4
    linkwork("run", folder / "out" / "five-bar.toml", "--no-plot")


def test_options_and_settings_reach_the_search(linkwork, tmp_path) -> None:
    (tmp_path / "case.toml").write_text(CAPPED)
    settings = """--set task.n=36 --set 'constraints.largest_link=45 cm' --set 'bounds.crank_length=[0.01, "80 mm"]'"""
    for out in ("a", "b"):
        linkwork(f"synthesize case.toml --no-plots --seed 3 --jobs 1 --out {out} {settings}")
    first, second = (Path(out, "solutions.csv").read_bytes() for out in ("a", "b"))
    assert first == second
    assert not list(Path("a").glob("*.png"))
    assert len(read_rows(Path("a/best-curve.csv"))) == 36
    result = linkwork("synthesize case.toml --jobs 0", code=2)
    assert "0 is neither -1, for all, nor a number of cores" in " ".join(result.stderr.split())
    assert max(float(row["ground_length [m]"]) for row in read_rows(Path("a/solutions.csv"))) <= 0.45 + 1e-6


def test_what_the_tables_say_is_what_is_searched(tmp_path, monkeypatch) -> None:
    given = {}
    monkeypatch.setattr(cases, "synthesize", lambda *arguments, **more: given.update(more))
    monkeypatch.setattr(cases, "trade_off", lambda *arguments, **more: given.update(limits=arguments[2], **more))
    search = "[search]\nseed = 5\ncandidates = 99\nstarts = 7\nsolutions = 2\njobs = 2\n"
    search += 'kinds = ["slider-crank", "geared-five-bar"]\ngears = [2]\n'
    found = case(ELLIPSE + search + '[trade_off]\nover = "size"\nlimits = [1, 2]\nstarts = 3\n', tmp_path)
    found.solve(progress=True)
    search = syn.Search(seed=5, candidates=99, starts=7, solutions=2, n_jobs=2, progress=True)
    which = {"kinds": ("slider-crank", "geared-five-bar"), "gears": (2.0,)}
    assert given == {"search": search, **which}
    given.clear()
    found.trade()
    assert given.pop("limits").tolist() == [1.0, 2.0]
    assert given == {"search": syn.Search(seed=5, starts=3, n_jobs=2), **which}


def test_a_crank_that_swings_backwards_is_run_over_its_task_alone(tmp_path) -> None:
    linkage = syn.Linkage(
        ground_length=0.35, crank_length=0.25, coupler_length=0.215, rocker_length=0.215, point_distance=0.1,
        crank_phase=0.2,
    )  # fmt: skip
    at = np.linspace(0.4, -0.6, 11)
    task = syn.Motion(points=linkage.path(at) + 1e-3, angle=linkage.coupler_angle(at), rotation=at)
    solution = syn.Solution.from_linkage(task, linkage)
    assert not solution.verdicts.full_turn
    ran = read_case(syn.run_case(solution, syn.MachineSpec(speed=3.0), "swing"), folder=tmp_path)
    motion = run_case(ran, step=ran.stop_time / 10.0)
    place = np.column_stack([motion["coupler.point.x"], motion["coupler.point.y"]])
    np.testing.assert_allclose(place, linkage.path(at), atol=1e-4)
    # the slider starts in equilibrium: with the crank at rest it stays
    still = simulate(ran.parameters, Inputs(speed=0.0), initial=ran.initial, stop_time=0.2)["slider.position"]
    assert abs(still[0]) > 1e-7
    np.testing.assert_allclose(still, still[0], rtol=1e-3)


def test_a_slider_that_does_not_settle_starts_at_its_zero() -> None:
    solution = syn.Solution.from_linkage(syn.TimedPath(points=ROCKING.path(syn.turn(12)) + 1e-3), ROCKING)
    made = syn.run_case(solution, syn.MachineSpec(slider_stiffness=2000.0, slider_damping=0.0), "undamped")
    assert (made["initial"]["slider_position"], made["initial"]["slider_velocity"]) == ("0.0 m", "0.0 m/s")


def both_runs(solution, make, folder, stop_time):
    """Runs of the linkage as it is described in words, and as the hand-written mechanism."""
    for tables in (syn.described_case(solution, make, "one"), syn.run_case(solution, make, "other")):
        yield run_case(read_case(tables, folder=folder), stop_time=stop_time, step=stop_time / 80.0)


@pytest.mark.parametrize(
    ("distance", "angle", "given"),
    [(0.1, 0.5, {}), (0.1, 0.5, {"coupler_mass": 0.6}), (0.3, 0.0, {"load": (0, 0)}), (0.25, 0.0, {}), (0.0, 0.0, {})],
)
def test_both_files_of_a_linkage_have_the_same_masses_and_load(tmp_path, distance, angle, given) -> None:
    linkage = replace(ROCKING, point_distance=distance, point_angle=angle, ground_angle=0.3)
    at = np.linspace(0.0, 6.0, 13)
    solution = syn.Solution.from_linkage(syn.TimedPath(points=linkage.path(at) + 1e-3, rotation=at), linkage)
    make = syn.MachineSpec(**{"speed": 15.0, "load": (3.0, -20.0)} | given)
    runs = list(both_runs(solution, make, tmp_path, 0.8))
    # of the other file a stiff spring holds the rocker's pivot, which starts in its steady motion
    torques = [run["drive.applied_torque"] for run in runs]
    np.testing.assert_allclose(*torques, atol=2e-3 * np.abs(torques[0]).max())
    for pin in "ABCD":
        forces = [np.hypot(run[f"{name}.fx"], run[f"{name}.fy"]) for run, name in zip(runs, (pin, f"pin.{pin}"))]
        np.testing.assert_allclose(*forces, atol=1e-2 * forces[0].max())


def test_both_files_of_a_slider_crank_have_the_same_spring_damper_and_friction(tmp_path) -> None:
    crank = syn.SliderCrank(ground_length=0.02, crank_length=0.05, coupler_length=0.2, ground_angle=0.3)
    task = syn.SliderFunction(position=[0.2, 0.15, 0.2], rotation=[0.0, 1.0, 2.0])
    spring = {"slider_stiffness": 900.0, "slider_spring_free_position": 0.15}
    make = syn.MachineSpec(speed=15.0, slider_damping=40.0, slider_coulomb_friction=3.0, **spring)
    solution = syn.Solution.from_linkage(task, crank)
    described, hand = both_runs(solution, make, tmp_path, 0.4)
    torque = described["drive.applied_torque"]
    np.testing.assert_allclose(hand["drive.applied_torque"], torque, atol=1e-6 * np.abs(torque).max())


def test_a_load_on_the_slider_goes_through_its_pin(tmp_path) -> None:
    """At rest, with light bars on a level guide without an offset, the coupler alone holds the slider against the load."""
    lengths = {"ground_length": 0.0, "crank_length": 0.05, "coupler_length": 0.2, "point_distance": 0.2}
    crank = syn.SliderCrank(**lengths, ground_angle=0.5 * pi)
    task = syn.SliderFunction(position=[-0.2, -0.15, -0.2], rotation=[0.0, 1.0, 2.0])
    make = syn.MachineSpec(speed=1e-6, density=1e-6, slider_mass=1.0, gravity=0.0, load=(-60.0, 0.0))
    solution = syn.Solution.from_linkage(task, crank)
    described, hand = both_runs(solution, make, tmp_path, 0.1)
    # the crank points along the guide's normal: sin(b) = 50 / 200
    wanted = 60.0 / cos(asin(0.25))
    for run, pins in ((described, "ABC"), (hand, ("bearing", "crank_pin", "slider_pin"))):
        for pin in pins:
            assert np.hypot(run[f"{pin}.fx"], run[f"{pin}.fy"])[0] == pytest.approx(wanted, rel=1e-6)
    assert syn.pin_forces(crank, make).force[0, :3] == pytest.approx(wanted, rel=1e-6)


def test_a_load_that_the_slider_cranks_case_leaves_out_is_named(linkwork, tmp_path) -> None:
    case = 'task = {{ kind = "quick-return", stroke = 0.1, time_ratio = 1.1 }}\nmake = {{ load = [{}, {}] }}\n'
    for load, noted in (((-30.0, 0.0), False), ((-30.0, -4.0), True)):
        (tmp_path / "case.toml").write_text(case.format(*load))
        said = linkwork("synthesize case.toml --no-plots").stderr
        assert ("without the 4 N of make.load across the guide" in said) == noted
        assert ("across the guide" in Path("out/slider-crank.toml").read_text().partition("\n")[0]) == noted


def test_an_animation_is_made_where_it_is_asked_for(linkwork, tmp_path, monkeypatch) -> None:
    (tmp_path / "case.toml").write_text(CAPPED)
    asked = []
    monkeypatch.setattr(figures, "animate", lambda solution, path, **more: asked.append((path.name, more)) or path)
    linkwork("synthesize case.toml --no-plots --animate")
    assert asked == [("best.gif", {"title": "case"})]


def test_an_interrupted_search_keeps_its_best(linkwork, tmp_path, monkeypatch) -> None:
    (tmp_path / "case.toml").write_text(CAPPED)
    found = cases.synthesize

    def stopped(*arguments, **more):
        raise syn.SynthesisInterrupted(found(*arguments, **more), 2, 3)

    monkeypatch.setattr(cases, "synthesize", stopped)
    result = linkwork("synthesize case.toml --no-plots", code=cli.INTERRUPTED)
    assert "stopped after 2 of 3 searches; the best so far is kept" in result.stderr
    assert Path("out/solutions.csv").exists()

    def nothing(*arguments, **more):
        raise syn.SynthesisInterrupted(None, 0, 3)

    monkeypatch.setattr(cases, "synthesize", nothing)
    linkwork("synthesize case.toml --out none", code=cli.INTERRUPTED)
    assert not Path("none").exists()


@pytest.mark.parametrize(
    ("points", "rotation", "noted"),
    [
        ([[0, 0], [0, 1], [1, 1], [1, 0]], None, True),
        ([[0, 0], [1, 0], [1, 1], [0, 1]], None, False),
        ([[0, 0], [0, 1], [1, 1], [1, 0]], [0.0, -1.5, -3.0, -4.5], False),
        ([[0, 0], [1, 1], [2, 0], [2, 1], [1, 0], [0, 1]], None, False),
    ],
)
def test_a_clockwise_path_in_step_with_a_counter_clockwise_crank_is_noted(points, rotation, noted) -> None:
    said = syn.format_sense(syn.TimedPath(points=points, rotation=rotation))
    assert said.startswith("the points run clockwise") == noted


def test_an_interrupted_trade_off_keeps_what_it_has(linkwork, tmp_path, monkeypatch) -> None:
    (tmp_path / "case.toml").write_text(TRADED)

    def stopped(self, **more):
        found = self.solve()
        front = syn.TradeOff(over="size", limit=np.array([0.4, 0.5]), solutions=(None, found.best))
        raise syn.TradeOffInterrupted(front, 1, 4)

    monkeypatch.setattr(cases.SynthesisCase, "trade", stopped)
    result = linkwork("synthesize case.toml --no-plots", code=cli.INTERRUPTED)
    assert "stopped after 1 of 4 problems of the trade-off; what there is is kept" in result.stderr
    # that there is no linkage would be known only after the whole search
    assert "none found yet" in result.stdout
    assert "no linkage" not in result.output
    assert len(Path("out/trade-off.csv").read_text().splitlines()) == 2
    assert Path("out/solutions.csv").exists()


def test_a_solution_with_a_defect_is_reported(linkwork, tmp_path, monkeypatch) -> None:
    (tmp_path / "case.toml").write_text(CAPPED)
    found = cases.synthesize

    def spoilt(*arguments, **more):
        result = found(*arguments, **more)
        verdicts = replace(result.best.verdicts, branch=False)
        return replace(result, solutions=(replace(result.best, verdicts=verdicts),))

    monkeypatch.setattr(cases, "synthesize", spoilt)
    result = linkwork("synthesize case.toml --no-plots")
    said = " ".join(result.stderr.split())
    assert "none of them is free of defects" in said
    assert "branch defect" in said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "parameter task is missing"),
        ("[tsk]", "there is no tsk; did you mean task?"),
        ("task = 3", "parameter task is 3: it must be a table"),
        ("[task]", "parameter task.kind is missing"),
        ('[task]\nkind = "timed"', "did you mean timed-path?"),
        ('[task]\nkind = "timed-path"', "there is none of them"),
        (ELLIPSE + 'file = "a.csv"', "there are task.file and task.x"),
        (ELLIPSE + "wieghts = [1]", "did you mean task.weights?"),
        (ELLIPSE.replace("cos(t)", "cso(t)"), "did you mean cos?"),
        (ELLIPSE.replace('"cm"', '"kg"'), "it must be a unit of length"),
        (ELLIPSE.replace("24", "2"), "task.n is 2: it must be at least 3"),
        (ELLIPSE + "weights = [1, 2]", "there must be one for each of the 24 targets"),
        (ELLIPSE + 'weights = [{ from = "50 deg", to = "40 deg", weight = 2 }]', "hold at least one target"),
        (ELLIPSE + 'weights = [{ from = "4 deg", to = "50 deg" }]', "task.weights[0].weight is missing"),
        (ELLIPSE + 'rotation = { from = "0 deg" }', "task.rotation.to is missing"),
        ('[task]\nkind = "timed-path"\npoints = [[0, 0], [1, 1]]', "there must be at least 3"),
        ('[task]\nkind = "timed-path"\npoints = [[0, 0], [nan, 0], [1, 1]]', "points[1][0] is nan"),
        ('[task]\nkind = "timed-path"\npoints = []', "0 are too few"),
        ('[task]\nkind = "timed-path"\npoints = [["1", 0], [1, 1]]', "come with its unit"),
        ('[task]\nkind = "untimed-path"\nfile = "none.svg"', "none.svg cannot be read"),
        (f'[task]\nkind = "untimed-path"\npoints = {SQUARE}\nsmoothing = "yes"', "true, false, or a table"),
        (
            f'[task]\nkind = "untimed-path"\npoints = {SQUARE}\nsmoothing = true\n'
            'straight = { start = 0, end = 1, rotation = "90 deg" }',
            "not come with task.straight",
        ),
        ('[task]\nkind = "rocker-function"\nangle = [1, 2]', "must be a list of at least 3"),
        ('[task]\nkind = "rocker-function"\nangle = "70+"', "cannot be read"),
        ('[task]\nkind = "rocker-function"\nangle = "1"\nangle_unit = "mm"', "it must be a unit of angle"),
        (f'[task]\nkind = "motion"\npoints = {SQUARE}', "task.angle is missing"),
        (f'[task]\nkind = "precision-points"\npoints = {SQUARE}\nweights = [1, 1, 1, 1]', "there is no task.weights"),
        (ELLIPSE + "[bounds]\ncrank_lenght = [0, 1]", "did you mean bounds.crank_length?"),
        (ELLIPSE + '[bounds]\ncrank_length = ["3 m", "1 m"]', "crank_length is to be at least 3 m and at most 1 m"),
        (ELLIPSE + '[bounds]\ncrank_length = ["1 deg", "2 deg"]', "it must be a number in m"),
        (ELLIPSE + "[bounds]\ncrank_length = [1]", "[least, greatest]"),
        (ELLIPSE + '[bounds]\nground_length = "3 m"\n[constraints]\nlargest_link = "1 m"', "no linkage has both"),
        (ELLIPSE + "[constraints]\nleast_transmission_angle = 40", 'such as "40 deg": a number alone is in rad'),
        (ELLIPSE + '[constraints]\ngrashof = "crank-roker"', "did you mean crank-rocker?"),
        (ELLIPSE + '[constraints]\ngrashof = "double-rocker"\nfull_turn = true', "does not turn fully"),
        (ELLIPSE + "[constraints]\nassembly = 2", "be +1 or -1"),
        (ELLIPSE + '[constraints]\npins = "AB"', "constraints.pins is 'AB': it must come with max_pin_force or"),
        (ELLIPSE + '[constraints]\nleast_transmission_angle = false\nover = "task"', "constraints.over is 'task'"),
        (ELLIPSE + "[search]\ngears = [2]", "gears has no effect: it is for a geared-five-bar"),
        (ELLIPSE + "[bounds]\nsecond_crank_length = 1", "second_crank_length has no effect"),
        ('[task]\nkind = "quick-return"\nstroke = 1\n[trade_off]\nover = "size"\nlimits = [1, 2]', "no error to trade"),
        (f'[task]\nkind = "precision-points"\npoints = {SQUARE}\nlength = 1', "length is 1"),
        (f'[task]\nkind = "timed-path"\npoints = {SQUARE}\nclosed = false', "task.closed is False"),
        ('[task]\nkind = "rocker-function"\nangle = [1, 2, 3]\nspacing = "even"', "task.spacing is 'even'"),
        (ELLIPSE + "[constraints]\npivot_A = [[0, 0], [1, 1]]", "at least 3 finite corners"),
        (ELLIPSE + '[constraints]\nrequire = ["crank_lenght <= 3 mm"]', "did you mean crank_length?"),
        (ELLIPSE + "[search]\nstarts = 0", "search.starts is 0: it must be at least 1"),
        (ELLIPSE + "[search]\njobs = 0", "a number of cores, or -1"),
        (ELLIPSE + '[make]\nspeed = "1 Hz"', "be in rad/s or rpm"),
        (ELLIPSE + "[make]\nwidth = 0", "make.width is 0: it must be greater than zero"),
        (ELLIPSE + '[trade_off]\nover = "mass"\nlimits = [1, 2]', "the names are size, transmission"),
        (ELLIPSE + '[trade_off]\nover = "size"\nlimits = [1]', "have at least 2 entries"),
        (
            ELLIPSE + QUICK + "[constraints]\nlargest_link = 0.5\npivot_A = [[9, 9], [10, 9], [9, 10]]",
            "the regions of pivot A and the bounds of its place have no point in common",
        ),
    ],
)
def test_what_is_wrong_is_reported_in_a_sentence(linkwork, tmp_path, text, said) -> None:
    (tmp_path / "case.toml").write_text(text)
    result = linkwork("synthesize case.toml", code=cli.WRONG)
    assert said in " ".join(result.stderr.split())
    assert "Traceback" not in result.output + result.stderr


def test_a_setting_without_a_value_is_refused(linkwork, tmp_path) -> None:
    (tmp_path / "case.toml").write_text(ELLIPSE)
    linkwork("synthesize case.toml --set nonsense", code=2)
    linkwork("synthesize case.toml --set task.n.m=3", code=cli.WRONG)


# Tasks from tables


def test_points_file_and_formula_give_the_same_target(tmp_path) -> None:
    phi = syn.turn(24)
    points = np.column_stack([20.0 + 10.0 * np.cos(phi), 15.0 + 5.0 * np.sin(phi)])
    (tmp_path / "ellipse.csv").write_text("x,y\n" + "\n".join(f"{x!r},{y!r}" for x, y in points.tolist()))
    written = ", ".join(f"[{x!r}, '{10.0 * y!r} mm']" for x, y in points.tolist())
    kind = '[task]\nkind = "timed-path"\nunit = "cm"\n'
    for text in (ELLIPSE, kind + 'file = "ellipse.csv"\n', kind + f"points = [{written}]\n"):
        task = case(text, tmp_path).task
        assert isinstance(task, syn.TimedPath)
        np.testing.assert_allclose(task.points, 0.01 * points)
        np.testing.assert_allclose(task.rotation, phi)


def test_a_target_is_scaled_turned_and_shifted(tmp_path) -> None:
    text = ELLIPSE + 'scale = 2.0\nturn = "90 deg"\nshift = [1, "2 mm"]\n'
    phi = syn.turn(24)
    x, y = 0.2 + 0.1 * np.cos(phi), 0.15 + 0.05 * np.sin(phi)
    np.testing.assert_allclose(case(text, tmp_path).task.points, np.column_stack([-2.0 * y + 0.01, 2.0 * x + 0.002]))


def test_windows_weigh_what_is_within_their_ends(tmp_path) -> None:
    windows = (
        'weights = [{ from = "60 deg", to = "90 deg", weight = 10 }, { from = "90 deg", to = "105 deg", weight = 3 },\n'
        ' { from = "-15 deg", to = "15 deg", weight = 4 }, { from = "330 deg", to = "345 deg", weight = 5 }]\n'
    )
    weights = case(ELLIPSE + windows, tmp_path).task.weights
    expected = np.ones(24)
    expected[4:6], expected[6:8], expected[[0, 1]], expected[[22, 23]] = 10.0, 3.0, 4.0, 5.0
    np.testing.assert_array_equal(weights, expected)
    # of an untimed path, numbers of points
    untimed = f'[task]\nkind = "untimed-path"\npoints = {SQUARE}\nweights = [{{ from = 1, to = 2, weight = 5 }}]\n'
    np.testing.assert_array_equal(case(untimed, tmp_path).task.weights, [1.0, 5.0, 5.0, 1.0])


def test_rotations_in_equal_steps_or_as_a_list(tmp_path) -> None:
    text = ELLIPSE + 'rotation = { from = "10 deg", to = "240 deg" }\n'
    np.testing.assert_allclose(case(text, tmp_path).task.rotation, np.radians(np.linspace(10.0, 240.0, 24)))
    points = f'[task]\nkind = "timed-path"\npoints = {SQUARE}\nrotation = [0, "10 deg", "20 deg", "50 deg"]\n'
    np.testing.assert_allclose(case(points, tmp_path).task.rotation, np.radians([0.0, 10.0, 20.0, 50.0]))


def test_the_end_of_a_turn_is_its_start(tmp_path) -> None:
    whole, part = (f'rotation = {{ from = 0, to = "{end} deg" }}\n' for end in (360, 80))
    repeated = [*json.loads(SQUARE), [0, 0]]
    (tmp_path / "square.csv").write_text("\n".join(f"{x},{y}" for x, y in repeated))
    timed, rocker = '[task]\nkind = "timed-path"\n', '[task]\nkind = "rocker-function"\nangle_unit = "deg"\n'
    moved = '[task]\nkind = "motion"\n'
    for text, expected in (
        (ELLIPSE + whole, syn.turn(24)),
        (f"{timed}{whole}points = {SQUARE}\n", syn.turn(4)),
        (f"{timed}{whole}points = {repeated}\n", np.linspace(0.0, 2.0 * pi, 5)),
        (f"{rocker}{whole}angle = [10, 30, 20]\n", syn.turn(3)),
        (f"{rocker}{whole}angle = [10, 130, 250, 370]\n", np.linspace(0.0, 2.0 * pi, 4)),
        (f"{moved}{whole}points = {repeated}\nangle = [0, 1, 2, 3, 4]\n", syn.turn(5)),
        (f"{moved}{whole}points = {repeated}\nangle = [0, 1, 2, 3, {2.0 * pi}]\n", np.linspace(0.0, 2.0 * pi, 5)),
    ):
        np.testing.assert_allclose(case(text, tmp_path).task.rotation, expected)
    body = f"{moved}angle = [0, 1, 2, 3, 4]\n"
    for text in (timed + whole, timed + part, timed + "rotation = [0, 1, 2, 3, 4]\n", body, body + part):
        assert case(text + 'file = "square.csv"\n', tmp_path).task.points.tolist() == repeated
    opened = '[task]\nkind = "untimed-path"\nfile = "square.csv"\nclosed = false\n'
    assert case(opened, tmp_path).task.path.points.tolist() == repeated


def test_a_function_of_the_rocker_as_formula_list_and_file(tmp_path) -> None:
    phi = np.linspace(0.0, pi, 7)
    angle = 70.0 + 100.0 * np.abs(np.sin(0.5 * phi))
    rows = "\n".join(f"{degrees(p)!r};{a!r}" for p, a in zip(phi.tolist(), angle.tolist()))
    (tmp_path / "rocker.csv").write_text(rows)
    kind = '[task]\nkind = "rocker-function"\nangle_unit = "deg"\n'
    formula = kind + 'angle = "70 + 100*abs(sin(t/2))"\nn = 7\nend = "180 deg"\nmounting = true\n'
    listed = f'{kind}angle = {angle.tolist()}\nrotation = {{ from = 0, to = "180 deg" }}\n'
    for text in (formula, formula.replace('"180 deg"', '"pi"'), kind + 'file = "rocker.csv"\n', listed):
        task = case(text, tmp_path).task
        np.testing.assert_allclose(task.angle, np.radians(angle))
        np.testing.assert_allclose(task.rotation, phi)
        assert task.mounting is ("mounting" in text)


def test_motion_and_precision_points(tmp_path) -> None:
    text = f'[task]\nkind = "motion"\npoints = {SQUARE}\nangle = [0, 10, "0.5 rad", 30]\nangle_unit = "deg"\nlength = "2 m"\n'
    task = case(text, tmp_path).task
    assert isinstance(task, syn.Motion)
    np.testing.assert_allclose(task.angle, [0.0, radians(10.0), 0.5, radians(30.0)])
    assert (task.length, task.rotation) == (2.0, None)
    # a body turned with its target
    turned = case(text + 'turn = "15 deg"\n', tmp_path).task
    np.testing.assert_allclose(turned.angle, task.angle + radians(15.0))
    precise = case(f'[task]\nkind = "precision-points"\npoints = {SQUARE}\n', tmp_path).task
    assert isinstance(precise, syn.PrecisionPoints)
    assert precise.angle is None


def test_an_untimed_path_with_a_straight_part_or_smoothed(tmp_path) -> None:
    text = (
        f'[task]\nkind = "untimed-path"\npoints = {SQUARE}\nmeasure = "distance"\nsamples = 40\nclosed = false\n'
        'straight = { start = 0, end = 1, rotation = "90 deg", flatness = "1 mm" }\n'
    )
    task = case(text, tmp_path).task
    assert (task.measure, task.samples, task.path.closed) == ("distance", 40, False)
    assert (task.straight.end, task.straight.flatness) == (1, 1e-3)
    assert task.straight.rotation == pytest.approx(pi / 2.0)
    (tmp_path / "hand-drawn.svg").write_text((ROOT / "examples" / "hand-drawn.svg").read_text())
    drawn = '[task]\nkind = "untimed-path"\nfile = "hand-drawn.svg"\nname = "curve"\nsmoothing = '
    ways = ("false", '{ points = 90, deviation = "0.5 mm" }')
    rough, smooth = (case(drawn + way, tmp_path).task.path for way in ways)
    assert len(smooth.points) == 90
    assert smooth.closed
    assert smooth.length < rough.length
    assert smooth.enclosed_area == pytest.approx(rough.enclosed_area, rel=0.02)


def test_bounds_constraints_and_the_rest(tmp_path) -> None:
    text = (
        ELLIPSE
        + '[bounds]\nground_angle = "30 deg"\ncrank_length = [0.01, "80 mm"]\n'
        + '[constraints]\nleast_transmission_angle = "35 deg"\nover = "task"\nfull_turn = true\ngrashof = "drag-link"\n'
        + 'largest_link = "1 m"\nassembly = -1\npivot_A = [[0, 0], [1, 0], ["1000 mm", 1]]\n'
        + 'require = ["crank_length >= 10 mm"]\n[make]\ndensity = "2.7 g/cm^3"\nspeed = "120 rpm"\n'
        + '[trade_off]\nover = "transmission"\nlimits = ["20 deg", "40 deg"]\n'
    )
    found = case(text, tmp_path)
    assert {*found.bounds} == {"ground_angle", "crank_length"}
    assert found.bounds["ground_angle"] == pytest.approx((radians(30.0), radians(30.0)))
    assert found.bounds["crank_length"] == pytest.approx((0.01, 0.08))
    kinds = [type(c).__name__ for c in found.constraints[:6]]
    assert kinds == ["LeastTransmission", "FullTurn", "Grashof", "LargestLink", "Assembly", "PivotRegion"]
    assert (found.constraints[0].angle, found.constraints[0].over) == (pytest.approx(radians(35.0)), "task")
    np.testing.assert_allclose(found.constraints[5].polygon, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    assert (found.make.density, found.make.speed) == (pytest.approx(2700.0), pytest.approx(4.0 * pi))
    np.testing.assert_allclose(found.trade_off.limits, np.radians([20.0, 40.0]))
    # without a table, and with one that says nothing of it, 40 degrees over the turn
    for more in ("", "[constraints]\nlargest_link = 1\n"):
        assert case(ELLIPSE + more, tmp_path).constraints[0] == syn.LeastTransmission()
    assert case(ELLIPSE + "[constraints]\nleast_transmission_angle = false\n", tmp_path).constraints == ()
    # a crank that swings is not asked to turn
    swings = case(ELLIPSE + '[constraints]\ngrashof = "double-rocker"\n', tmp_path).constraints
    assert swings[0] == syn.LeastTransmission(over="task")


def test_overrides_reach_any_depth(tmp_path) -> None:
    settings = {"task.rotation.to": "200 deg", "task.rotation.from": 0, "search.seed": 7, "title": "x"}
    found = case(CAPPED, tmp_path, **settings)
    assert found.task.rotation[-1] == pytest.approx(radians(200.0))
    assert (found.search.seed, found.title) == (7, "x")


def test_json_does_as_well(tmp_path) -> None:
    data = {"task": {"kind": "timed-path", "x": "cos(t)", "y": "sin(t)"}, "search": {"seed": 4}}
    (tmp_path / "case.json").write_text(json.dumps(data))
    assert syn.load_synthesis_case(tmp_path / "case.json").search.seed == 4
    assert data == json.loads((tmp_path / "case.json").read_text())


def test_the_examples_and_the_documentation_are_readable() -> None:
    texts = {path: path.read_text() for path in (ROOT / "examples").glob("*.toml")}
    examples = [path for path, text in texts.items() if "[task]" in text and "[slider" not in text]
    assert len(examples) >= 4
    for path in examples:
        syn.load_synthesis_case(path)
    page = (ROOT / "docs" / "synthesis-cases.md").read_text()
    (block,) = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    syn.read_synthesis_case(tomllib.loads(block), folder=ROOT)
    tables = (cases.SynthesisCase, cases.Constraints, cases.SearchTable, cases.MachineSpec, cases.TradeOffTable)
    for kind in (*KINDS.values(), *tables):
        for name in entry_names(kind):
            assert re.search(rf"\b{name}\b", page), name


# Requirements


@pytest.mark.parametrize(
    ("text", "difference"),
    [
        ("crank_length + coupler_length <= 300 mm", lambda p: p.crank_length + p.coupler_length - 0.3),
        ("crank_length >= 0.2*ground_length", lambda p: 0.2 * p.ground_length - p.crank_length),
        ("ground_angle == 30 deg", lambda p: p.ground_angle - pi / 6.0),
        ("-sin(point_angle)**2/2 < pivot_x - 1.5e-1 m", lambda p: -(sin(p.point_angle) ** 2) / 2.0 - p.pivot_x + 0.15),
        ("atan2(pivot_y, pivot_x)*pi > 2", lambda p: 2.0 - pi * np.arctan2(p.pivot_y, p.pivot_x)),
    ],
)
def test_a_requirement_is_the_difference_of_its_sides(text, difference) -> None:
    found = requirement(text)
    assert found.equal is ("==" in text)
    casadi = library()
    symbols = {name: casadi.SX.sym(name) for name in UNKNOWNS}
    function = casadi.Function("f", list(symbols.values()), [trace_requirement(found, SimpleNamespace(**symbols))])
    for values in np.random.default_rng(1).uniform(0.1, 3.0, (20, len(UNKNOWNS))).tolist():
        p = SimpleNamespace(**dict(zip(UNKNOWNS, values)))
        assert found.function(p) == pytest.approx(difference(p), abs=1e-12)
        # and traced with CasADi's symbols
        assert float(function(*values)) == pytest.approx(difference(p), abs=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "crank_length", "crank_length <= 1 <= 2", "crank_length <= (1", "crank_length.real <= 1", "__import__(1) <= 1",
        "sin(1, 2) <= 1", "crank_length <= 3 furlong", "(lambda: 1)() <= 1", "crank_length and 1 <= 2", "'a' <= 1", "p <= 1",
        "crank_length <= 1e999", "True <= crank_length", "sin() <= 1",
        "9**9**9 <= crank_length",
        "crank_length <= 10**300 * 10**300",
        "crank_length <= " + "9" * 5000,
        "(" * 900 + "1" + ")" * 900 + " <= crank_length",
    ],
)  # fmt: skip
def test_what_is_no_requirement_is_refused(text) -> None:
    with pytest.raises(LinkworkError):
        requirement(text)


def test_a_requirement_is_kept(tmp_path) -> None:
    free = case(ELLIPSE + QUICK + '[constraints]\nlargest_link = "50 cm"\n', tmp_path).solve().best.linkage
    held = case(CAPPED + 'require = ["coupler_length <= 0.3*rocker_length"]\n', tmp_path).solve().best.linkage
    assert free.coupler_length > 0.3 * free.rocker_length
    assert held.coupler_length <= 0.3 * held.rocker_length * (1.0 + 1e-6)


def test_wrong_kinds_of_values_are_refused(tmp_path) -> None:
    with pytest.raises(ParameterError, match="be a text such as"):
        case(ELLIPSE + "[constraints]\nrequire = [3]\n", tmp_path)
    with pytest.raises(ParameterError, match="be true or false"):
        case(ELLIPSE + '[constraints]\nfull_turn = "yes"\n', tmp_path)
    with pytest.raises(InputError, match="is not valid TOML"):
        case("[task", tmp_path)
