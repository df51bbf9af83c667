"""The command line: what it writes, what it says, and its exit codes."""

import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from io import StringIO
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from rich.console import Console

from analysis import Inputs, cli, export, figures, simulate
from analysis.cli import common, slider_crank, system
from analysis.cli.runs import _places
from analysis.export.description import KINDS, description
from analysis.mechanisms import FIVE_BAR
from analysis.periodic import find_orbit, find_orbits
from analysis.periodic.chart import chart as charts
from analysis.periodic.chart import grid as grids
from analysis.run import save_parameters
from build_fmu import FMUS
from linkwork.errors import Interrupted
from linkwork.five_bar.published import SETS, TABLE_3_1

from .conftest import cells, csv

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


def in_own_process(*arguments, cwd):
    """An FMU runs in a process of its own."""
    command = [sys.executable, "-m", "analysis.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.parametrize(
    "command",
    [
        [],
        *([name] for name in cli.COMMANDS),
        *([group.name, name] for group in (slider_crank.slider_crank, system.system) for name in group.commands),
    ],
)
def test_help_shows_examples(linkwork, command):
    result = linkwork(*command, "--help")
    assert "Examples:" in result.output


def test_run_writes_csv_and_plot(linkwork, tmp_path):
    result = linkwork("run --published table-3.1")
    rows = np.loadtxt(tmp_path / "out" / "table-3.1.csv", delimiter=",", skiprows=1)
    assert rows.shape == (1081, 28)
    assert (tmp_path / "out" / "table-3.1.png").read_bytes().startswith(b"\x89PNG")
    assert "slider.position" in result.output


WIPER = """
[linkage]
name = "wiper-arm"
ground = { A = [0, 0], E = ["420 mm", "40 mm"] }
bodies.crank = { bar = ["A", "B"], length = "40 mm", mass = 0.15 }
bodies.rod = { bar = ["B", "F"], length = "410 mm", mass = 0.25 }
bodies.arm = { bar = ["E", "F"], length = "52 mm", mass = 0.5 }
springs.blade = { at = "E", damping = 0.1 }
freedoms.crank = { joint = "A", speed = "45 rpm" }
assembly.F = 1
[run]
revolutions = 2
"""


def test_an_arm_that_swings_through_the_negative_x_axis_has_its_swing_in_the_table(linkwork, tmp_path):
    """The arm turns back where crank and rod are in line: there its angle to the ground follows from three sides."""
    (tmp_path / "wiper.toml").write_text(WIPER)
    result = linkwork("run wiper.toml --no-plot")
    ground = np.hypot(420.0, 40.0)
    ends = [np.degrees(np.arccos((ground**2 + 52**2 - way**2) / (2 * ground * 52))) for way in (410 + 40, 410 - 40)]
    found = cells(result.output)
    for name in ("arm.angle", "E.turn"):
        least, greatest = float(found[name][1]), float(found[name][3])
        assert greatest - least == pytest.approx(ends[0] - ends[1], abs=0.02)
        assert least < 180.0 < greatest
    # the outputs stay between -pi and pi
    run = simulate("wiper-arm")
    assert np.ptp(run["arm.angle"]) > 6.2
    assert np.ptp(csv(tmp_path / "out" / "wiper.csv")["E.turn [rad]"]) > 6.2
    for figure, axis in (
        (figures.plot(run, ["arm.angle"]), 0),
        (figures.plot_comparison(run, replace(run, values=run.values + 1e-3), ["E.turn"]), 1),
    ):
        assert np.ptp(figure.axes[axis].lines[0].get_ydata()) < 120.0


def test_the_table_of_a_run_says_where_the_extremes_are(linkwork, tmp_path):
    """At crank angles of one crank, else at times; what does not change has none, and all fits into 100 columns."""
    result = linkwork("run --published table-3.1 --no-plot")
    found = cells(result.output)
    assert found["crank.speed"] == ["rpm", "420", "", "420", "", "420"]
    assert max(map(len, result.output.splitlines()[:10])) <= 100
    run = simulate("table-3.1")
    force = np.hypot(run["pin.A.fx"], run["pin.A.fy"])
    for place, index in ((2, force.argmin()), (4, force.argmax())):
        angle = np.degrees(run["crank.angle"][index]) % 360.0
        assert float(found["pin.A force"][place]) == pytest.approx(angle, abs=0.051)
    assert [found[name][0] for name in ("crank.angle", "coupler.point.y", "pin.A force")] == ["deg", "mm", "N"]
    assert float(found["pin.A force"][3]) == pytest.approx(force.max(), rel=1e-3)
    heading, place = _places(replace(run, parameters=None))
    assert heading == "at [s]"
    assert float(place(force.argmax())) == pytest.approx(run.time[force.argmax()], rel=1e-3)


GEARS = """
[linkage]
name = "pair-of-gears"
ground = { A = [0, 0], E = [0.1, 0] }
bodies.one = { points = { A = [0, 0] }, mass = 1.0, inertia = 0.01 }
bodies.two = { points = { E = [0, 0] }, mass = 1.0, inertia = 0.01 }
gears.teeth = { bodies = ["one", "two"], ratio = -2.0 }
freedoms.one = "A"
[drive]
torque = 1.0
[run]
stop_time = 0.01
"""


def test_the_table_of_a_run_shows_what_is_no_number(linkwork, tmp_path):
    """The force between gears whose axes coincide, not 0 N; the torque over the inertia is 1/(0.01 + 4 0.01)."""
    (tmp_path / "gears.toml").write_text(GEARS)
    found = cells(linkwork("run gears.toml --no-plot --set ground.E_x=0").output)
    assert [found["teeth.fy"][k] for k in (1, 3, 5)] == ["nan"] * 3
    assert [found["one.acceleration"][k] for k in (1, 3, 5)] == ["20"] * 3


def test_a_run_that_ends_early_keeps_its_data_and_exits_with_3(linkwork, tmp_path):
    slips = "--set slider.stiffness=0 --set slider.damping=10 --stop-time '3 s'"
    result = linkwork(f"run --published table-3.1 {slips} --no-plot", code=cli.ENDED_EARLY)
    assert "limit of assembly at t = 0.49997" in " ".join(result.stderr.split())
    rows = np.loadtxt(tmp_path / "out" / "table-3.1.csv", delimiter=",", skiprows=1)
    assert rows[-1, 0] == pytest.approx(0.499978413)


def wrong_commands():
    """Rows of ``wrong_commands.txt``: exit code, words of the command line, sentence."""
    for line in Path(__file__).with_name("wrong_commands.txt").read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            code, words, said = line.split(" | ")
            given = words.replace("EXAMPLES", str(EXAMPLES)).replace("ROOT", str(ROOT))
            yield pytest.param(shlex.split(given), int(code), said, id=words)


@pytest.mark.parametrize(("words", "code", "said"), [*wrong_commands()])
def test_what_is_wrong_is_reported_in_a_sentence(linkwork, tmp_path, words, code, said):
    result = linkwork(*words, code=code)
    assert said in " ".join((result.output + result.stderr).split())
    assert "Traceback" not in result.output + result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("heading", "said"), [("t,F", "column 1 in s and column 2 in N ("), ("t [ms],F [N]", "")])
def test_units_that_a_file_of_inputs_does_not_state_are_said(linkwork, tmp_path, heading, said):
    (tmp_path / "force.csv").write_text(f"{heading}\n0,0\n1,1\n")
    table = 'force = { kind = "table", file = "force.csv" }\nrun.stop_time = "1 ms"'
    (tmp_path / "case.toml").write_text(f'published = "table-3.1"\n{table}\n')
    result = linkwork("run case.toml --no-plot")
    assert ("force.csv: no unit in the heading" in result.stderr) == bool(said)
    assert said in result.stderr


@pytest.mark.parametrize("given", ["--published table-3.1 --set drive.speed=420", "case.toml"])
def test_a_bare_speed_under_which_a_run_ends_early_is_asked_about(linkwork, tmp_path, given):
    (tmp_path / "case.toml").write_text('published = "table-3.1"\n[drive]\nspeed = 420\n')
    run = linkwork(f"run {given} --no-plot", code=cli.ENDED_EARLY)
    assert "drive.speed = 420 has no unit and is taken in rad/s, as 4010.7 rpm: was '420 rpm' meant?" in run.stderr
    run = linkwork("run --published table-3.1 --set 'drive.speed=4010 rpm' --no-plot", code=cli.ENDED_EARLY)
    assert "meant" not in run.stderr


def test_a_bare_speed_of_an_option_is_said_in_rpm(linkwork):
    judged = ("stability", "--published", "table-3.1", "--no-chart", "--speed")
    assert "--speed 40 has no unit and is taken in rad/s, as 381.972 rpm" in linkwork(*judged, "40").stderr
    assert linkwork(*judged, "40 rad/s").stderr == ""


def test_every_summary_is_a_sentence_that_is_not_cut(linkwork):
    for group in ([], ["slider-crank"], ["system"]):
        listed = linkwork(*group, "--help").output.partition("Commands:")[2].split("\n  ")[1:]
        assert len(listed) > 4
        assert all(" ".join(line.split()).endswith(".") and "..." not in line for line in listed)


def test_stability_judges_before_it_asks_for_an_axis_that_nobody_chose(linkwork):
    result = linkwork("stability --published table-3.1 --set slider.damping=0", code=1)
    assert "Floquet multipliers" in result.stdout
    assert "no chart over slider.damping, as --y is not given: slider.damping is 0 here" in result.stderr


@pytest.mark.parametrize(
    ("what", "names"),
    [
        ((), tuple(SETS)),
        (("own.toml",), ("slider.stiffness",)),
        (("rig-1-spring-a",), ("slider.stiffness", "turns fully")),
        (("five-bar",), (" crank.length ", " initial.crank_angle ", " drive.torque ", " force ", " load.fx ")),
        (("slider-crank",), (" gravity.x ", " initial.shift_position ", " axial.groove ", " drive.speed ")),
    ],
)
def test_info_has_the_names_of_sets_parameters_and_case_files(linkwork, tmp_path, what, names):
    save_parameters(tmp_path / "own.toml", TABLE_3_1)
    result = linkwork("info", *what)
    assert all(name in result.output for name in names)


def test_values_of_set_are_those_of_a_case_file(linkwork):
    section = 'crank.section={kind = "rod", diameter = "12 mm", material = "steel"}'
    result = linkwork("run --published table-3.1 --no-plot --set drive.speed=.5e2 --set", section)
    # 7850 kg/m3 pi/4 (12 mm)^2 50 mm, and 50 rad/s
    assert "crank.mass 0.04439 kg (of a rod of 12 mm" in result.output
    assert " 477.465 " in result.output


@pytest.mark.parametrize("kind", KINDS)
def test_info_on_every_kind_of_fmu_shows_starts_alike(linkwork, kind, tmp_path):
    with ZipFile(tmp_path / "some.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description(FIVE_BAR, KINDS[kind]))
    result = linkwork("info", str(tmp_path / "some.fmu"))
    row = next(line for line in result.output.splitlines() if line.startswith("│ drive.speed "))
    assert "43.9823" in row.split()
    assert "valid" in result.output
    assert "None" not in result.output


def test_check_of_every_kind_of_fmu_says_which(fmu, natives, tmp_path):
    folder = tmp_path / "build"
    folder.mkdir()
    for path in (fmu, natives["FiveBarSlider-native"], natives["FiveBarSlider-native-fmi3"]):
        shutil.copy(path, folder)
    done = in_own_process("check", "table-3.1", "--method", "compiled", "--method", "RK45", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    # model exchange is CVode's against one method
    assert "8 of 8 checks pass" in done.stdout
    kinds = ("co-simulation, FMI 2.0", "co-simulation, FMI 3.0", "model exchange, FMI 2.0")
    assert [done.stdout.count(kind) for kind in kinds] == [4, 2, 1]
    assert {p.name for p in (tmp_path / "out").glob("*.png")} == {"table-3.1.png", "table-3.1-RK45.png"}
    for run in ("table-3.1", "table-3.1-RK45"):
        assert {f"{run}-in-process.csv", f"{run}-fmu.csv"} <= {p.name for p in (tmp_path / "out").glob("*.csv")}


def test_check_of_one_interface_of_a_native_fmu(linkwork, natives, tmp_path):
    result = linkwork("check speed-jump --fmu", natives["FiveBarSlider-native-fmi3"], "--interface", "model-exchange")
    assert "1 of 1 checks pass" in result.output
    assert "model exchange, FMI 3.0" in result.output
    assert "slider.guide_force" in result.output
    assert (tmp_path / "out" / "speed-jump-native-fmi3-model-exchange.png").is_file()


def test_the_failing_kind_is_named(linkwork, natives):
    fmu = natives["FiveBarSlider-native"]
    result = linkwork("check coulomb-friction --tolerance 1e-11 --fmu", fmu, code=cli.CHECK_FAILED)
    assert result.stderr.strip() == "check failed: coulomb-friction-native-model-exchange"


@pytest.mark.parametrize(("step", "turns"), [("10 ms", ""), ("50 ms", "0.35"), ("100 ms", "0.7")])
def test_samples_too_few_for_the_extremes_are_noted(linkwork, step: str, turns: str) -> None:
    """At 420 rpm."""
    result = linkwork("run", "--published", "table-3.1", "--stop-time", "0.4 s", "--step", step, "--no-plot")
    assert result.exit_code == 0
    said = " ".join(result.stderr.split())
    assert ("crank.angle advances by up to" in said) == bool(turns)
    if turns:
        assert f"by up to {turns} turns from one sample to the next, where it has 420 rpm" in said
        assert "--step '2 ms' has 72 samples a turn there" in said


@pytest.mark.parametrize("interface", ["co-simulation", "linear-co-simulation", "model-exchange"])
def test_run_through_each_interface(linkwork, natives, tmp_path, interface):
    fmu = natives["FiveBarSlider-native"]
    result = linkwork(f"run --interface {interface} --no-plot --fmu", fmu, EXAMPLES / "torsion-bar.toml")
    noted = "note: inputs that vary over a step are sampled and held" in result.stderr
    assert noted == (interface == "co-simulation")
    rows = np.loadtxt(tmp_path / "out" / "torsion-bar-fmu.csv", delimiter=",", skiprows=1)
    assert np.isfinite(rows).all()


def test_an_interface_that_the_fmu_has_not(linkwork, fmu):
    result = linkwork("check --fmu", fmu, "--interface", "model-exchange", code=1)
    assert "there is no model-exchange in it" in result.stderr


@pytest.mark.fmu
def test_build_builds(linkwork, tmp_path):
    result = linkwork("build --dest", tmp_path / "fmus", "--kinds", "python")
    assert {path.name for path in (tmp_path / "fmus").iterdir()} == {f"{name}.fmu" for name in FMUS}
    assert result.output.count("valid") == len(FMUS)


def test_build_of_a_linkage_names_what_its_file_says_of_runs_alone(linkwork, tmp_path, monkeypatch):
    """Start values and inputs beside [linkage] are not in the FMU; what stands in the file that this one names counts, too."""
    monkeypatch.setattr(export, "build_all", lambda *given, **others: [])
    (tmp_path / "wiper.toml").write_text(WIPER)
    assert linkwork("build wiper.toml").stderr == ""
    (tmp_path / "first.toml").write_text(f'{WIPER}[initial]\ncrank_angle = "100 deg"\n')
    (tmp_path / "second.toml").write_text('linkage = "first.toml"\ncrank.length = "35 mm"\ndrive.torque = 0\n')
    for file, entries in (
        ("first.toml", "initial.crank_angle outside of this table is only"),
        ("second.toml", "initial.crank_angle, crank.length, drive.torque outside of this table are only"),
    ):
        said = " ".join(linkwork("build", file).stderr.split())
        assert f"WiperArm starts with the values in [linkage] of {file}; {entries} for runs of the file." in said


def test_examples_are_copied_once(linkwork, tmp_path):
    linkwork("examples --dest mine")
    (tmp_path / "mine" / "run-up.toml").write_text("changed")
    result = linkwork("examples --dest mine", code=2)
    assert "calm-pins.toml" in result.stderr
    assert (tmp_path / "mine" / "run-up.toml").read_text() == "changed"
    linkwork("examples --dest mine --force")
    for path in (path for path in (ROOT / "examples").rglob("*") if path.is_file()):
        assert (tmp_path / "mine" / path.relative_to(ROOT / "examples")).read_bytes() == path.read_bytes()


@pytest.mark.parametrize("error", [KeyboardInterrupt, Interrupted("interrupted: it is not written")])
def test_ctrl_c_is_clean(linkwork, monkeypatch, error):
    def interrupted(*arguments, **options):
        raise error

    monkeypatch.setattr(export, "build_all", interrupted)
    result = linkwork("build", code=cli.INTERRUPTED)
    assert "interrupted" in result.stderr


def test_resonance_of_a_published_set(linkwork, tmp_path):
    result = linkwork("resonance --published rig-2-spring-c --from '300 rpm' --to '700 rpm' --html")
    assert "585.47 rpm" in result.output
    assert "586.13" in result.output
    assert "speeds to avoid" in result.output
    assert "resonance, above 0.71 of the peak" in result.output
    out = tmp_path / "out"
    assert "amplitude of slider position u [mm]" in (out / "rig-2-spring-c-resonance.html").read_text(encoding="utf-8")
    header = (out / "rig-2-spring-c-resonance.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header.startswith("branch,drive.speed [rad/s],turns in a period")
    assert (out / "rig-2-spring-c-resonance.png").read_bytes().startswith(b"\x89PNG")
    rows = np.loadtxt(out / "rig-2-spring-c-resonance-approximations.csv", delimiter=",", skiprows=1)
    assert rows.shape[1] == 3


def resonance_sensitivities(linkwork, low: str, high: str) -> str:
    """Run `linkwork resonance` for the sensitivities between two speeds; return its output."""
    command = f"resonance --published rig-2-spring-c --from '{low}' --to '{high}' --no-plot --sensitivity --places 0"
    return linkwork(command).output


def test_resonance_says_what_moves_it(linkwork, tmp_path):
    output = resonance_sensitivities(linkwork, "560 rpm", "610 rpm")
    assert "not sought: --places" in output
    # half a percent for a percent of the stiffness: w^2 = k / m; an amplitude that the damper alone limits
    assert re.search(r"maximum │ +586\.1\d │ slider\.stiffness \+0\.49\d* +│ +17\.153 ", output), output
    path = tmp_path / "out" / "rig-2-spring-c-resonance-sensitivity.csv"
    columns = dict(zip(*(row.split(",") for row in path.read_text(encoding="utf-8").splitlines())))
    assert float(columns["amplitude by slider.damping [%/%]"]) == pytest.approx(-1.0, abs=0.02)
    assert float(columns["place by slider.damping [%/%]"]) == pytest.approx(0.0, abs=0.01)


def test_resonance_says_where_nothing_can_be_said_of_what_moves_it(linkwork):
    assert "no special point" in resonance_sensitivities(linkwork, "620 rpm", "640 rpm")


def test_resonance_reports_a_fold(linkwork):
    result = linkwork("resonance --published rig-1-spring-b --from '1030 rpm' --to '1060 rpm' --no-plot")
    assert "fold at 1035.97" in result.output
    sentence = next(line for line in result.output.splitlines() if "it jumps to" in line)
    assert sentence.startswith("the stable motion of 37.91 mm of u is there only below 1035.97 rpm: ")
    # the large motion at the fold, found by itself
    rig = SETS["rig-1-spring-b"].parameters
    large = [1e3 * orbit.amplitude for orbit in find_orbits(rig, speed="1035.97 rpm").stable][-1]
    assert float(sentence.split()[-2]) == pytest.approx(large, rel=2e-3)


@pytest.mark.parametrize("command", ["resonance", "stability", "basins"])
def test_pages_without_plotly_are_refused_before_anything_is_computed(linkwork, monkeypatch, command):
    monkeypatch.setattr("analysis.libraries.find_spec", lambda name: None)
    result = linkwork(command, "--published", "rig-2-spring-c", "--html", code=2)
    assert "python -m pip install 'plotly" in " ".join(result.stderr.split())


@pytest.mark.slow
def test_resonance_reports_what_could_not_be_followed(linkwork, tmp_path):
    command = "resonance --published table-3.1 --vary slider.stiffness --from 10 --to 350 --no-plot --doublings 0"
    result = linkwork(command, code=cli.ENDED_EARLY)
    assert " to slider.stiffness = 305." in " ".join(result.output.split())
    assert "links come to the limit of assembly" in " ".join(result.output.split())
    assert not (tmp_path / "out" / "table-3.1-resonance.png").exists()
    assert (tmp_path / "out" / "table-3.1-resonance.csv").exists()


def test_stability_verdict_and_chart(linkwork, tmp_path, monkeypatch):
    monkeypatch.setattr(grids, "grid_folder", lambda: tmp_path / "grids")
    result = linkwork("stability --published table-3.1 --no-chart")
    assert "stable, margin 0.94" in result.output
    assert not (tmp_path / "out").exists()
    ranges = "--x-range '1120 rpm' '1220 rpm' --y-range 0 '2e3 dyn.s/cm'"
    result = linkwork(f"stability --published rig-2-spring-c {ranges} --points 12 --cores 1")
    assert "gone from slider.damping = 0.97580" in " ".join(result.output.split())
    assert result.output.count("agrees") == 3
    for name in (".csv", "-boundaries.csv", ".png"):
        assert (tmp_path / "out" / f"rig-2-spring-c-stability{name}").exists()


def test_stability_judges_the_motion_that_a_weak_motor_reaches(linkwork):
    case = EXAMPLES / "capture.toml"
    for speed, amplitude in (("", "21.612 mm"), ("1070 rpm", "3.5693 mm")):  # docs/capture.md
        begins = ["--guess-speed", speed] if speed else []
        result = linkwork("stability", case, "--no-chart", *begins)
        assert f"amplitude {amplitude}" in result.output
        assert "2 other periodic motions there" in result.output


@pytest.fixture
def coarse_charts(tmp_path, monkeypatch):
    """Few lines and samples of charts, whose rows are kept for the test alone."""
    monkeypatch.setattr(grids, "grid_folder", lambda: tmp_path)
    monkeypatch.setattr(charts, "LINES", (2, 2))
    monkeypatch.setattr(charts, "SAMPLES", 12)


@pytest.mark.slow
def test_a_chart_of_another_motion_than_the_machine_reaches_is_noted(linkwork, coarse_charts):
    command = "stability --x slider.stiffness --x-range 7900 8100 --y-range 2 4 --points 2 --jobs 1"
    result = linkwork(command, EXAMPLES / "capture.toml")
    assert "follows a motion of amplitude 3.5693 mm, not the motion of 21.612 mm" in result.output


@pytest.mark.slow
def test_a_chart_with_points_missing_is_written_and_ends_early(linkwork, tmp_path, coarse_charts):
    # with so soft a spring the links come to the limit of assembly
    ranges = "--x slider.stiffness --x-range 150 400 --y-range 20 40"
    result = linkwork(f"stability --published table-3.1 {ranges} --points 3 --cores 1", code=cli.ENDED_EARLY)
    assert "a motion is not found at" in " ".join(result.stderr.split()), result.stderr
    for name in (".csv", "-boundaries.csv", ".png"):
        assert (tmp_path / "out" / f"table-3.1-stability{name}").exists()


CASE = 'published = "table-3.1"\nforce = "5 N"\nload.fy = "-20 N"\ndrive.speed = "300 rpm"\n'


def test_constant_inputs_of_a_case_count(linkwork, tmp_path):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    result = linkwork("stability case.toml --no-chart")
    orbit = find_orbit(TABLE_3_1, speed=10.0 * np.pi, inputs=Inputs(force=5.0, load_y=-20.0))
    assert f"amplitude {1e3 * orbit.amplitude:.5g} mm" in result.output
    assert "at 300 rpm" in result.output
    bare = linkwork("stability --published table-3.1 --set 'drive.speed=300 rpm' --no-chart")
    assert "at 300 rpm" in bare.output
    assert bare.output != result.output
    linkwork("resonance case.toml --from '290 rpm' --to '310 rpm' --no-plot")
    columns = csv(tmp_path / "out" / "case-resonance.csv")
    found = np.interp(10.0 * np.pi, columns["drive.speed [rad/s]"], columns["amplitude of u [m]"])
    assert found == pytest.approx(orbit.amplitude, rel=1e-3)


def test_a_motor_is_no_input_that_varies_in_time(linkwork):
    result = linkwork("stability", EXAMPLES / "run-up.toml", "--set", "force=0", "--no-chart")
    assert "at 499.502 rpm: stable" in result.output


@pytest.mark.slow
def test_resonance_over_the_torque(linkwork):
    vary = "--set 'drive.torque=0.01 N*m' --vary drive.torque --from 0.005 --to 0.06 --guess-speed '540 rpm'"
    result = linkwork(f"resonance --published rig-2-spring-c {vary} --no-plot --doublings 0")
    assert "fold at 0.04949" in result.output, result.output


@pytest.mark.parametrize(
    "command",
    [
        ["run", "--published", "table-3.1", "--out"],
        ["stability", "--published", "table-3.1", "--out"],
        ["synthesize", str(EXAMPLES / "hand-drawn.toml"), "--out"],
        ["slider-crank", "tolerances", "--out"],
        ["build", "--dest"],
        ["studio", "--out"],
    ],
)
def test_a_place_that_cannot_be_written_is_refused_before_anything_is_computed(linkwork, tmp_path, command):
    (tmp_path / "file").touch()
    result = linkwork(*command, tmp_path / "file" / "new", code=2)
    assert "is no folder" in " ".join(result.stderr.split())


def test_headings_are_broken_and_not_cut_in_a_narrow_terminal(monkeypatch):
    narrow = Console(width=30, file=StringIO())
    monkeypatch.setattr(common, "console", narrow)
    common.show_table("points", ["slider damping [N.s/m]", "supercalifragilistic"], [["1", "2"]])
    text = narrow.file.getvalue()
    assert "…" not in text
    assert "damping" in text
