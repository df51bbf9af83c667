"""Parameter and case files: units, errors that name what is wrong, every digit kept."""

import json
from dataclasses import fields, replace
from math import pi, radians
from pathlib import Path

import pytest

from analysis.mechanisms import FIVE_BAR, PUBLISHED, find_mechanism
from analysis.run import (
    Harmonics,
    Piecewise,
    TorsionBar,
    load_case,
    load_parameters,
    parameter_tables,
    read_case,
    read_parameters,
    save_parameters,
)
from linkwork.errors import InputError, MissingParameterError, ParameterError, UnknownNameError
from linkwork.five_bar.published import TABLE_3_1

from .conftest import run_case

A4_10 = PUBLISHED["rahman-a4-10-s1-3.5"]
#: Numbers that are short in no unit.
AWKWARD = (
    replace(TABLE_3_1, slider_guide_angle=0.1 + 0.2, crank_length=0.05 * (1 + 2**-52)),
    replace(A4_10.parameters, guide_twist=4.1, gravity_z=-1.0 / 3.0, assembly_branch=-1),
)


@pytest.mark.parametrize("ending", ["toml", "json"])
@pytest.mark.parametrize("parameters", [*(entry.parameters for entry in PUBLISHED.values()), *AWKWARD])
def test_a_saved_mechanism_comes_back_digit_for_digit(tmp_path, ending, parameters):
    path = save_parameters(tmp_path / f"mechanism.{ending}", parameters)
    assert load_parameters(path) == parameters


@pytest.mark.parametrize("parameters", AWKWARD)
def test_every_parameter_has_its_place_in_a_file(parameters):
    data = parameter_tables(parameters)
    named = data.pop("mechanism", "five-bar")
    assert named == find_mechanism(parameters).name
    assert sum(len(v) if isinstance(v, dict) else 1 for v in data.values()) == len(fields(parameters))
    assert json.loads(json.dumps(data)) == data


@pytest.mark.parametrize(
    ("data", "error", "said"),
    [
        # "30" for an angle was hardly meant in radians
        ({"ground": {"inclination": "30"}}, ParameterError, r"ground\.inclination is '30': it must come with its unit"),
        ({"slider": {"stifness": 1.0}}, UnknownNameError, r"slider\.stifness; did you mean slider\.stiffness"),
        ({"crank": {"length": -0.05}}, ParameterError, r"crank\.length is -0\.05"),
        ({"slider.mass": float("nan")}, ParameterError, r"slider\.mass"),
        ({"assembly": {"branch": 0.5}}, ParameterError, r"assembly\.branch"),
    ],
)
def test_wrong_parameters_are_named(data, error, said):
    with pytest.raises(error, match=said):
        read_parameters(data, TABLE_3_1)


@pytest.mark.parametrize("name", PUBLISHED)
def test_parameters_say_whose_they_are(name):
    parameters = PUBLISHED[name].parameters
    data = parameter_tables(parameters)
    assert read_parameters(data) == parameters
    other = "slider-crank" if data["mechanism"] == "five-bar" else "five-bar"
    with pytest.raises(ParameterError, match=f"mechanism is '{other}': it must be {data['mechanism']}"):
        read_parameters({"mechanism": other}, parameters)


def test_missing_names_are_listed():
    with pytest.raises(MissingParameterError, match=r"ground\.length is missing.*rocker\.cog_distance"):
        read_parameters({"slider": {"stiffness": 1.0}}, mechanism=FIVE_BAR)
    lengths = {"crank.length": 0.05, "crank.inertia": 1e-3, "coupler.length": 0.15, "rocker.length": 0.15}
    with pytest.raises(MissingParameterError, match=r"what they follow from: coupler\.section, rocker\.section$"):
        read_parameters(lengths, mechanism=FIVE_BAR)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("case.toml", "title = ", "not valid TOML"),
        ("case.json", "{", "not valid JSON"),
        ("case.yaml", "", r"must end in \.toml or \.json"),
        ("case.json", "[1, 2]", "must contain tables"),
    ],
)
def test_files_that_cannot_be_read(tmp_path, name, text, said):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        load_case(path)


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_parameters(tmp_path / "nowhere.toml")


def case(tmp_path, text, **overrides):
    path = tmp_path / "case.toml"
    path.write_text(text)
    return load_case(path, overrides or None)


def test_a_published_case_runs_three_turns_at_its_speed(tmp_path):
    loaded = case(tmp_path, 'published = "table-3.1"\n[slider]\nstiffness = "2e6 dyn/cm"\n')
    assert loaded.parameters == replace(TABLE_3_1, slider_stiffness=2000.0)
    assert loaded.inputs.speed == pytest.approx(14 * pi)
    assert loaded.stop_time == pytest.approx(3 / 7)
    assert loaded.step == pytest.approx(1 / 7 / 360)


def test_every_kind_of_input(tmp_path):
    (tmp_path / "fy.csv").write_text("time,fy\n0,1\n0.5,2\n1,3\n")
    loaded = case(
        tmp_path,
        """
published = "table-3.1"
[[drive.torque]]
kind = "torsion-bar"
torque = "1e8 dyn*cm"
release_angle = "45 deg"
[[drive.torque]]
kind = "induction-motor"
breakdown_torque = 5
breakdown_slip = 0.2
synchronous_speed = "500 rpm"
[force]
kind = "harmonics"
mean = 1
amplitudes = ["2 N", 3]
frequencies = ["60 rpm", 4]
[load.fx]
kind = "ramp"
start = 0
end = "1 kN"
from_time = "10 ms"
to_time = "20 ms"
[load.fy]
kind = "table"
file = "fy.csv"
interpolation = "cubic"
[run]
stop_time = "0.5 s"
step = "1 ms"
""",
    )
    bar, motor = loaded.inputs.torque
    assert bar == TorsionBar(torque=10.0, release_angle=pi / 4)
    assert (motor.breakdown_torque, motor.breakdown_slip) == (5.0, 0.2)
    assert motor.synchronous_speed == pytest.approx(500 * pi / 30)
    force = loaded.inputs.force
    assert isinstance(force, Harmonics)
    assert (force.mean, force.amplitudes, force.phases) == (1.0, [2.0, 3.0], [0.0, 0.0])
    assert force.frequencies == pytest.approx([2 * pi, 4.0])
    assert isinstance(loaded.inputs.load_x, Piecewise)
    assert isinstance(loaded.inputs.load_y, Piecewise)
    assert (loaded.stop_time, loaded.step) == (0.5, 1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "time,fy\n0,1\n0.5,2\n1,3\n",
        "0,1\n0.5,2\n1,3\n",
        "t [ms],fy [kN]\n0,0.001\n500,0.002\n1000,0.003\n",
        "# t (s); fy (N)\n0;1\n0,5;2\n1;3\n",
    ],
)
def test_a_table_file_is_read_in_the_units_of_its_headings(tmp_path, text):
    (tmp_path / "fy.csv").write_text(text)
    force = case(tmp_path, 'published = "table-3.1"\nforce = { kind = "table", file = "fy.csv" }').inputs.force
    assert force.breaks[1:-1] == pytest.approx([0.0, 0.5, 1.0])
    assert force.coefficients[:, 0] == pytest.approx([1.0, 1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,angle,force\n0,0,1\n1,0,2\n", "has 3 columns: it must have two, time in s and value in N"),
        ("t [ms],force [kg]\n0,1\n1,2\n", "column 2 in 'kg'"),
        ("t [mm],force [N]\n0,1\n1,2\n", "column 1 in 'mm'"),
        ("t,force\n0,1\n1,\n", "line 3, column 2: '' is not a finite number"),
        ("t,force\n0,0,1,5\n0,5,2,5\n", "line 2: 4 cells in a table of 2 columns; numbers with a decimal comma"),
    ],
)
def test_a_table_file_that_is_none(tmp_path, text, said):
    (tmp_path / "fy.csv").write_text(text)
    with pytest.raises((InputError, ParameterError), match=said):
        case(tmp_path, 'published = "table-3.1"\nforce = { kind = "table", file = "fy.csv" }')


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('published = "table-3.2"', r"did you mean table-3\.1"),
        ('published = "table-3.1"\n[run]\nstop = 1', r"run\.stop"),
        ('published = "table-3.1"\nspeed = 1', r"did you mean drive\.speed"),
        ('published = "table-3.1"\ndrive.torque = {kind = "table", times = [0], values = []}', "a table needs as many"),
        ('published = "table-3.1"\nforce = {kind = "table", interpolation = "step"}', r"force\.interpolation 'step'"),
        ('published = "table-3.1"\n[drive]\ntorque = 1', r"run\.stop_time is missing: .* a constant speed"),
        ('published = "table-3.1"\n[drive.torque]\nkind = "torsion-bra"\ntorque = 1', "torsion-bar"),
        ('published = "table-3.1"\n[drive.torque]\nkind = "torsion-bar"', r"drive\.torque\.torque is missing"),
        ('published = "table-3.1"\n[drive]\nspeed = 1\ntorque = 1', "drive .*only one of torque, speed"),
        ('published = "table-3.1"\n[run]\nrevolutions = 0', r"run\.revolutions is 0: it must be greater than zero"),
        ('published = "table-3.1"\n[run]\nrevolutions = 1\nstop_time = "1 s"', "not come together with"),
        ('published = "table-3.1"\n[run]\ntolerance = 2', r"run\.tolerance is 2: it must be between 1e-13 and 0\.01"),
        ('published = "table-3.1"\n[initial]\nangle = 1', r"initial\.angle"),
        ('published = "table-3.1"\ntitle = nan', "title is nan"),
        ('published = "table-3.1"\n[drive]\ntorque = []', r"drive\.torque is \[\]: it must have at least 1 entry"),
        ('published = "table-3.1"\n[force]\nkind = "table"\nfile = "no.csv"\ntimes = [0, 1]', "cannot have both"),
        ('published = "table-3.1"\n[force]\nkind = "table"\nfile = "no.csv"', "no.csv cannot be read: No such file"),
        ('mechanism = "slider_crank"', "did you mean slider-crank"),
        ('mechanism = "five-bar"\npublished = "rahman-ideal"', "be that of the published set rahman-ideal"),
        ('published = "rahman-ideal"\n[axial]\nshift = 1.0', "there is no axial.shift"),
        ('published = "rahman-ideal"\n[axial]\ngroove = 1', "axial.groove is 1: it must be true or false"),
        ('published = "rahman-ideal"\n[axial]\ngroove = true', "groove.amplitude is 0.0: .* given with axial.groove"),
        ('published = "rahman-ideal"\n[axial]\nspeed = 0.1\ngroove = true', "'speed, groove': .* only one of"),
        ('published = "rahman-ideal"\n[initial]\nshift_velocity = 0.1', "come with axial.force"),
        ('published = "rahman-ideal"\n[load]\nfx = "3 N"', "load is 'fx': .* a quantity, or a table"),
        ('mechanism = ["slider-crank"]', r"mechanism is \['slider-crank'\]: it must be one of five-bar, slider-crank"),
        ('published = "rahman-ideal"\n[coupler]\nlength = 1.0', "there is no coupler.length"),
        ('mechanism = "slider-crank"\n[crank]\nlength = 1.0', "parameter rod.length is missing"),
    ],
)
def test_a_wrong_case_is_reported_in_a_sentence(tmp_path, text, said):
    with pytest.raises((ParameterError, InputError), match=said):
        case(tmp_path, text)


def test_case_file_of_a_slider_crank(tmp_path):
    text = """
mechanism = "slider-crank"
published = "rahman-a4-10-s1-3.5"
load = { kind = "ramp", start = "0 N", end = "-20 N", from_time = "0 s", to_time = "1 s" }

[guide]
twist = "280 deg"

[drive]
torque = "10 N*m"

[axial]
speed = { kind = "harmonics", amplitudes = ["4 in/s"], frequencies = ["60 rpm"] }

[initial]
crank_angle = "30 deg"

[run]
stop_time = "0.5 s"
"""
    loaded = case(tmp_path, text)
    assert loaded.parameters == replace(A4_10.parameters, guide_twist=radians(280.0))
    assert loaded.initial == replace(A4_10.initial, crank_angle=pi / 6.0)
    assert loaded.inputs.shift_speed == Harmonics(0.0, [4.0 * 0.0254], [2.0 * pi], [0.0])
    assert (loaded.inputs.torque, loaded.inputs.speed) == ((10.0,), None)
    assert isinstance(loaded.inputs.load, Piecewise)
    run = run_case(loaded, stop_time=0.5)
    assert run.status == 0
    grooved = case(tmp_path, text, **{"axial.groove": True, "groove.amplitude": "2 in"})
    assert grooved.inputs.groove
    assert grooved.inputs.shift_speed is None


def test_overrides_replace_parameters_drive_and_run(tmp_path):
    loaded = case(
        tmp_path,
        'published = "table-3.1"\n[drive]\nspeed = "420 rpm"',
        **{"slider.stiffness": "5e5 dyn/cm", "drive.torque": "2 N*m"},
        **{"run.stop_time": "0.1 s", "initial.crank_angle": 0.5},
    )
    assert loaded.parameters.slider_stiffness == 500.0
    assert loaded.inputs.speed is None
    assert loaded.inputs.torque == (2.0,)
    assert loaded.stop_time == 0.1
    assert loaded.initial.crank_angle == 0.5


def test_the_examples_load():
    examples = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))
    texts = {path: path.read_text(encoding="utf-8") for path in examples}
    runs = [path for path, text in texts.items() if "[task]" not in text and "[tune]" not in text]
    # the others are cases of the synthesis, of the slider's motion and of the tuning, and have their tests
    assert len(runs) >= 2
    for path in runs:
        assert load_case(path).stop_time > 0.0


def test_an_end_that_is_given_for_itself_takes_the_place_of_the_files():
    data = {"published": "table-3.1", "run": {"revolutions": 2.0}}
    case = read_case(data, folder=Path(), overrides={"run.stop_time": "0.1 s", "drive.torque": "1 N.m"})
    assert (case.stop_time, [*case.inputs], case.inputs.parts("torque")) == (0.1, ["torque"], (1.0,))
    data = {"published": "table-3.1", "run": {"stop_time": "1 s"}}
    case = read_case(data, folder=Path(), overrides={"run.revolutions": 2.0})
    assert case.stop_time == pytest.approx(4.0 * pi / PUBLISHED["table-3.1"].crank_speed)


def test_an_input_that_is_given_for_itself_may_have_its_fmi_name():
    data = {"published": "table-3.1"}
    for name in ("force", "slider.force"):
        case = read_case(data, folder=Path(), overrides={name: "3 N"})
        assert case.inputs.parts("force") == (3.0,)
    data = {"published": "table-3.1", "slider": {"force": "3 N", "damping": "5 N*s/m"}}
    case = read_case(data, folder=Path())
    assert (case.inputs.parts("force"), case.parameters.slider_damping) == ((3.0,), 5.0)
    assert read_case(data, folder=Path(), overrides={"force": "4 N"}).inputs.parts("force") == (4.0,)
    with pytest.raises(InputError, match=r"slider\.force is called force in case files, and both are given"):
        read_case(data | {"force": "4 N"}, folder=Path())
