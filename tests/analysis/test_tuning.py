"""Tuning: the least change after which a range of speeds is as it was wished, against independent searches for it."""

import json
from dataclasses import replace
from math import pi
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize

from analysis import InductionMotor, Limit, Wish, cli, figures, tune
from analysis.periodic import (
    Crossing,
    Drive,
    find_orbit,
    find_orbits,
    frequency_response,
    newton_orbit,
    orbit_test,
    plane,
    removing_damping,
    steady_drive,
)
from analysis.run import load_case, read_case
from analysis.tuning import load_tuning_case
from analysis.tuning.cases import read_tuning_case
from analysis.tuning.optimisation import _conditions, _unwanted_regions, _ways
from analysis.tuning.result import STABLE, describe_wish, readings
from analysis.tuning.survey import other_motions, survey
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import InputError, LinkworkError, ParameterError, UnknownNameError
from linkwork.five_bar.published import SETS
from linkwork.slider_crank import published as rahman
from tests.mechanisms import rotor_on_cart, torsion
from tests.scripts import linkwork

pytestmark = pytest.mark.usefixtures("registered")

RPM = pi / 30.0
EXAMPLES = Path(__file__).parents[2] / "examples"
RIG_2 = SETS["rig-2-spring-c"].parameters
#: With so little damping the principal parametric region is there, from 1162 to 1177 rpm.
LIGHT = replace(RIG_2, slider_damping=0.5)
PIN = Limit(output="pin.C", below="14 N")
AMPLITUDE = Limit(output="amplitude of slider.position", below="1.6 cm")
BOTH = {"slider.damping": "20 %", "slider.stiffness": "5 %"}


ROTOR = next(iter(rotor_on_cart.MECHANISM.published.values())).parameters
MOTOR = InductionMotor(breakdown_torque=2.0, breakdown_slip=0.3, synchronous_speed=25.0)
FIELD = "drive.torque.synchronous_speed"
#: The slider-crank of section 3.1 with a spring on the axial shift.
SPRUNG = replace(rahman.parameters(20.0, 232.0), shift_stiffness=8000.0, shift_damping=60.0)
#: Parametric resonance of a hardening spring: a closed branch from 0.92 to 1.35 rad/s, and a jump from 1.03 to 1.42 rad/s.
TONGUE = torsion.Parameters(
    rotor_stiffness=1.0, rotor_damping=0.05, rotor_cubic_stiffness=0.2, rotor_modulation=0.8, rotor_excitation=0.02,
)  # fmt: skip
OF_TONGUE = {"parameters": TONGUE, "change": {"rotor.damping": [0.01, 0.6]}, "no_jump": True, "least": "rotor.damping"}


def wish(**of):
    return Wish(**{"parameters": RIG_2, "speeds": ("570 rpm", "600 rpm"), "change": BOTH} | of)


# Derivatives


@pytest.mark.parametrize(
    "of",
    [
        {"no_resonance": True},
        {"limits": [PIN, AMPLITUDE]},
        {
            "limits": [Limit(output="drive.applied_torque", below=0.3)],
            "change": {"slider.force": "1 N", "slider.stiffness": "5 %"},
        },
        {"parameters": LIGHT, "speeds": ("1150 rpm", "1185 rpm"), "least_margin": 0.01},
        pytest.param(
            {"parameters": "rig-1-spring-b", "speeds": ("980 rpm", "1150 rpm"), "no_jump": True}, marks=pytest.mark.slow
        ),
        {
            "parameters": ROTOR,
            "drive": Drive(motor=MOTOR),
            "speeds": None,
            "over": FIELD,
            "between": (25.5, 29.0),
            "change": {"cart.stiffness": "30 %", "drive.torque.breakdown_torque": "30 %"},
            "no_resonance": True,
            "limits": [Limit(output="drive.applied_torque", below=0.1)],
        },
        pytest.param(
            {
                "drive": Drive(torque=0.04),
                "speeds": None,
                "over": "drive.torque",
                "between": ("0.03 N*m", "0.05 N*m"),
                "start": (0.0, 0.0, 60.0),
                "no_jump": True,
            },
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {"parameters": LIGHT, "speeds": ("1150 rpm", "1160 rpm"), "turns": 2, "no_unstable": True},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_derivatives_of_the_conditions_are_those_of_differences(of):
    asked = wish(**of)
    x, step = np.zeros(2), 2e-3
    found = survey(asked, x)
    found = survey(asked, x, other_motions(found)[0])
    conditions = {
        (type(c).__name__, round(c.value(x), 6)): c for way in _ways(found) for c in _conditions(found, list(way))
    }
    assert conditions
    for condition in conditions.values():
        slopes = condition.slopes(x)
        differences = [
            (
                8.0 * (condition.value(step * e) - condition.value(-step * e))
                - (condition.value(2.0 * step * e) - condition.value(-2.0 * step * e))
            )
            / (12.0 * step)
            for e in np.eye(2)
        ]
        assert slopes == pytest.approx(differences, rel=2e-4, abs=2e-5 * float(np.abs(slopes).max()))


# Against independent searches


@pytest.mark.slow
def test_least_damping_is_that_which_removes_the_region():
    """Section 5 of the thesis in one line: where the region vanishes, by a root search without any of the tuning's parts."""
    change = {"slider.damping": ["0.1 N*s/m", "6 N*s/m"]}
    calm = {"no_unstable": True, "least": "slider.damping"}
    asked = wish(parameters=LIGHT, speeds=("1155 rpm", "1185 rpm"), change=change, **calm)
    tuned = tune(asked)
    test = orbit_test(plane(LIGHT, Drive(speed=1170 * RPM), "drive.speed", "slider.damping"), -1)
    removed = removing_damping(test, asked.span, (0.5, 2.0))
    assert tuned.met
    assert tuned.values[0] == pytest.approx(removed.damping, rel=1e-6)
    assert find_orbit(replace(LIGHT, slider_damping=0.99 * removed.damping), speed=removed.x).largest > 1.0
    assert tuned.requirements[0].before.excess > 0.0
    figure = figures.plot(tuned)
    low, high = figure.axes[1].get_ylim()
    assert low > 0.5  # of the multipliers near one, not from zero
    assert "slider damping 0.5 to" in figure.get_supxlabel()
    assert high < 1.5


@pytest.mark.parametrize(("margin", "end"), [(None, 612.0), (0.0, 600.0)])
def test_resonance_is_led_to_the_nearer_end_and_its_margin(margin, end):
    given = {} if margin is None else {"resonance_margin": margin}
    tuned = tune(wish(change={"slider.stiffness": "10 %"}, no_resonance=True, **given))

    def away(stiffness):
        changed = replace(RIG_2, slider_stiffness=stiffness)
        response = frequency_response(changed, 560 * RPM, 640 * RPM, doublings=0, greatest_step=5e-2)
        return response.maxima()[0].parameter - end * RPM

    assert tuned.met
    assert tuned.values[0] == pytest.approx(brentq(away, 4100.0, 4500.0, rtol=1e-7), rel=3e-4)
    assert f"{end:g} rpm" in tuned.requirements[0].wished


@pytest.mark.long
def test_where_no_way_leads_to_what_is_wished_one_is_begun_next_to_it():
    """The jump of a tongue and its closed branch are both gone where the curve of the jump's folds has its cusp."""
    tuned = tune(wish(**OF_TONGUE, speeds=(0.8, 1.5)))
    assert tuned.met
    for share, jumps in ((0.99, True), (1.01, False)):
        damped = replace(TONGUE, rotor_damping=share * tuned.values[0])
        branches = frequency_response(damped, 0.8, 1.5, doublings=0, greatest_step=5e-3).branches
        assert any(special.kind is Crossing.FOLD for branch in branches for special in branch.special) == jumps


@pytest.mark.slow
def test_resonance_under_a_motor_is_led_out_of_a_range_of_its_frequency():
    drive, span = Drive(motor=MOTOR), (25.5, 29.0)
    tuned = tune(
        wish(
            parameters=ROTOR, drive=drive, speeds=None, over=FIELD, between=span, change={"cart.stiffness": "30 %"},
            no_resonance=True, resonance_margin=0.0,
        )
    )  # fmt: skip
    assert tuned.met
    assert tuned.requirements[0].before.excess > 0.0
    (top,) = frequency_response(
        tuned.parameters, 20.0, 29.0, drive=drive, vary=FIELD, doublings=0, greatest_step=5e-2
    ).maxima()
    assert top.parameter == pytest.approx(span[0], rel=1e-7)
    assert figures.plot(tuned).axes[0].get_xlabel() == "drive torque synchronous speed [rpm]"


def test_swing_of_the_axial_shift_of_a_slider_crank_stays_below_its_limit():
    drive, bound = Drive(speed=rahman.CRANK_SPEED, forces={"axial.force": 0.0}), 0.014
    span = 0.9 * rahman.CRANK_SPEED, 1.1 * rahman.CRANK_SPEED
    limit = Limit(output="amplitude of shift.position", below=bound)
    change = {"shift.stiffness": "30 %", "shift.damping": "30 %"}
    tuned = tune(wish(parameters=SPRUNG, drive=drive, speeds=span, change=change, limits=[limit]))
    assert tuned.met
    response = frequency_response(tuned.parameters, *span, drive=drive, doublings=0)
    assert max(branch.amplitude.max() for branch in response.branches) == pytest.approx(bound, rel=1e-5)


@pytest.mark.long
def test_a_motion_of_two_turns_beside_a_stable_one_is_seen_and_removed():
    """Below the doubling a motion of 20 cm repeats itself after two turns, beside a stable one of 2 mm."""
    asked = {
        "parameters": LIGHT, "speeds": ("1150 rpm", "1160 rpm"), "change": {"slider.damping": ["0.1 N*s/m", "6 N*s/m"]},
        "no_unstable": True, "least": "slider.damping",
    }  # fmt: skip
    one, two = tune(wish(**asked)), tune(wish(**asked, turns=2))
    assert one.values[0] < LIGHT.slider_damping
    assert two.met
    assert two.values[0] == pytest.approx(1.41, abs=5e-3)
    for share, there in ((0.98, True), (1.001, False)):
        damped = replace(LIGHT, slider_damping=share * two.values[0])
        found = [find_orbits(damped, speed=speed, turns=2).orbits for speed in np.linspace(*two.wish.span, 3).tolist()]
        assert any(found) == there


@pytest.mark.long
def test_least_change_for_a_pin_force_is_that_of_slsqp():
    asked = wish(speeds=("550 rpm", "620 rpm"), limits=[PIN])
    speeds = np.linspace(*asked.span, 25)

    def room(x):
        start, force = None, []
        for speed in speeds.tolist():
            orbit = newton_orbit(*asked.operation(np.asarray(x), speed), start=start)
            start, turn = orbit.start, orbit.turn(512)
            force.append(float(np.hypot(turn["pin.C.fx"], turn["pin.C.fy"]).max()))
        # the top of a curve through the speeds
        return 1.0 - float(CubicSpline(speeds, force)(np.linspace(*asked.span, 5000)).max()) / 14.0

    tuned = tune(asked)
    box = list(zip(asked.scale_changes(asked.low), asked.scale_changes(asked.high)))
    found = minimize(
        lambda x: float(x @ x),
        tuned.x + np.array([-0.2, 0.2]),
        bounds=box,
        constraints={"type": "ineq", "fun": room},
        method="SLSQP",
        options={"eps": 1e-4, "ftol": 1e-8},
    )
    assert tuned.met
    assert room(tuned.x) == pytest.approx(0.0, abs=3e-4)
    assert float(tuned.x @ tuned.x) == pytest.approx(found.fun, rel=5e-3)


@pytest.mark.slow
def test_a_jump_is_led_out_of_the_range():
    wish = load_tuning_case(EXAMPLES / "tuning-jump.toml").wish
    tuned = tune(wish)
    assert tuned.met

    def folds(parameters):
        branches = frequency_response(parameters, "900 rpm", "1200 rpm", doublings=0).branches
        return [special.parameter for b in branches for special in b.special if special.kind.value == "fold"]

    assert [fold for fold in folds(tuned.parameters) if fold > 950 * RPM] == pytest.approx([980 * RPM], rel=1e-5)
    # the response is followed from 912 rpm, where there is no fold
    (fold,) = folds(wish.parameters)
    assert tuned.requirements[0].before.text == f"between 912 rpm or less and {fold / RPM:.6g} rpm"


# What cannot be had


def on_a_soft_spring():
    """A wish for a mechanism whose soft spring leaves no stable motion from 184 to 237 rpm."""
    lengths = {"crank_length": 0.06, "coupler_length": 0.18, "rocker_length": 0.12}
    soft = replace(SETS["table-3.1"].parameters, **lengths, slider_stiffness=600.0, slider_damping=3.0)
    change = {"slider.stiffness": ["0.2 N/mm", "40 N/mm"]}
    return Wish(parameters=soft, speeds=("150 rpm", "250 rpm"), change=change, no_resonance=True)


@pytest.mark.slow
def test_nothing_is_met_where_the_motion_is_unstable():
    """Although no resonance lies in the range."""
    asked = on_a_soft_spring()
    found = survey(asked, np.zeros(1))
    found = survey(asked, np.zeros(1), other_motions(found)[0])
    ((low, high),) = found.unstable
    assert (low / RPM, high / RPM) == (pytest.approx(184.4, abs=0.1), pytest.approx(237.3, abs=0.1))
    assert not found.peaks
    assert readings(found)[STABLE].excess == pytest.approx((high - low) / (200 * RPM))
    for speed, there in ((0.98 * low, True), (1.02 * low, False), (0.98 * high, False), (1.02 * high, True)):
        assert bool(find_orbits(asked.parameters, speed=speed).stable) == there
    assert any(region.low < high and low < region.high for region in _unwanted_regions(found))


@pytest.mark.long
def test_an_answer_far_from_the_present_values_is_found_and_what_lies_beside_the_range_does_not_make_it_unmet():
    """Between the values at which all ways end lies a narrow window of stiffness; a branch beyond 250 rpm is lost there."""
    tuned = tune(on_a_soft_spring())
    assert tuned.met, tuned.missed
    for speed in np.linspace(150.0, 250.0, 9) * RPM:
        assert find_orbits(tuned.parameters, speed=speed).stable


@pytest.mark.slow
def test_a_wish_that_cannot_be_met_is_answered_by_the_nearest():
    tuned = tune(wish(change={"slider.damping": [5.5, 6.0]}, least_margin=0.3))
    assert not tuned.met
    assert tuned.values == pytest.approx([6.0], rel=1e-6)
    (said,) = tuned.missed
    assert "stable motion is not met: largest multiplier 0.754" in said
    missing = max(find_orbit(tuned.parameters, speed=s).largest for s in tuned.wish.span) - 0.7
    assert tuned.requirements[0].after.excess == pytest.approx(missing, rel=1e-3)


def test_what_is_met_already_is_not_changed():
    tuned = tune(wish(speeds=("300 rpm", "310 rpm"), no_jump=True, no_unstable=True))
    assert tuned.met
    assert tuned.x.tolist() == [0.0, 0.0]


def test_a_motion_that_the_speed_prescribes_is_refused_with_what_works_instead():
    said = r"the speed prescribes the whole motion of a slider-crank.* simulate_many .* axial\.force = 0"
    limit = {"output": "drive.applied_torque", "below": "1 N*m"}
    with pytest.raises(InputError, match=said):
        Wish(parameters=SPRUNG, speeds=(10.0, 12.0), change={"crank.length": "5 %"}, limits=[Limit(**limit)])
    name = next(iter(rahman.SETS))
    wanted = {"speeds": ["100 rpm", "110 rpm"], "change": {"crank.length": "5 %"}, "peak": limit}
    with pytest.raises(InputError, match=said):
        read_tuning_case({"published": name, "tune": wanted}, folder=Path())


# What is wished


@pytest.mark.parametrize(
    ("of", "kind", "words"),
    [
        ({}, InputError, "there is no requirement"),
        ({"no_jump": True, "speeds": None}, InputError, "give the range"),
        ({"no_jump": True, "speeds": None, "over": "drive.speed"}, InputError, "give the range"),
        ({"no_jump": True, "between": (1.0, 2.0), "over": "drive.torque"}, InputError, "give the range"),
        ({"no_jump": True, "drive": Drive(torque=0.1)}, InputError, "speed follows"),
        ({"no_jump": True, "speeds": None, "over": "drive.torqe", "between": (1, 2)}, UnknownNameError, "torque"),
        ({"no_jump": True, "speeds": None, "over": "drive.torque", "between": (1, 2)}, InputError, "Drive"),
        (
            {"no_jump": True, "speeds": None, "over": FIELD, "between": (1, 2), "drive": Drive(torque=0.1)},
            InputError,
            "no motor drives",
        ),
        (
            {"no_jump": True, "speeds": None, "over": "drive.torque", "between": (-1, 1), "drive": Drive(torque=0.1)},
            ParameterError,
            "not contain zero",
        ),
        ({"no_jump": True, "turns": 0}, ParameterError, "at least one"),
        ({"no_jump": True, "change": {}}, InputError, "nothing may be changed"),
        ({"no_jump": True, "change": {"slider.stifness": "5 %"}}, UnknownNameError, r"slider\.stiffness"),
        ({"no_jump": True, "change": {"gravity": "5 %"}}, ParameterError, "it is zero now"),
        ({"no_jump": True, "change": {"drive.speed": "5 %"}}, ParameterError, "whose range is given"),
        ({"no_jump": True, "change": {"drive.torque": "0.1 N*m"}}, InputError, "the drive is by speed"),
        ({"no_jump": True, "change": {"slider.stiffness": [5e3, 4e3]}}, ParameterError, "in order"),
        ({"no_jump": True, "change": {"slider.stiffness": {"tolerance": "0 %"}}}, ParameterError, "above zero"),
        ({"no_jump": True, "change": {"slider.damping": "200 %"}}, ParameterError, r"200 %.*zero or greater"),
        ({"no_resonance": True, "resonance_margin": -0.1}, ParameterError, "resonance_margin"),
        ({"no_jump": True, "speeds": ("600 rpm", "570 rpm")}, ParameterError, "'600 rpm', '570 rpm'.*be a range"),
        ({"no_jump": True, "speeds": "500 rpm"}, ParameterError, "speeds is '500 rpm': it must be two values"),
        ({"least_margin": 1.5}, ParameterError, "less than one"),
        ({"no_jump": True, "least": "gravity"}, InputError, "may not be changed"),
        ({"limits": [Limit(output="pin.E", below=1.0)]}, UnknownNameError, r"pin\.[A-D]"),
        ({"limits": [Limit(output="pin.C force", below=1.0)]}, ParameterError, r"be 'pin\.C', the name of the joint"),
        ({"limits": [Limit(output="pin.C", below="-1 N")]}, ParameterError, "above zero"),
        ({"limits": [Limit(output="pin.C", below="1 m")]}, ParameterError, "unit of that kind"),
    ],
)
def test_errors_in_words(of, kind, words):
    with pytest.raises(kind, match=words):
        wish(**of)


def test_limits_are_in_the_units_of_tables():
    assert describe_wish(wish(limits=[AMPLITUDE, PIN]))[str(AMPLITUDE)] == "below 16 mm"


def test_what_may_be_changed_is_measured_in_its_tolerance():
    asked = wish(
        no_jump=True,
        change={
            "slider_mass": ["0.8 kg", "0.9 kg"],
            "slider": {"stiffness": {"tolerance": "100 N/m", "between": [3e3, 5e3]}, "damping": "10 %"},
        },
    )
    assert [(c.name, c.low, c.high, c.tolerance) for c in asked.change] == [
        ("slider.mass", 0.8, 0.9, pytest.approx(0.05)),
        ("slider.stiffness", 3e3, 5e3, 100.0),
        ("slider.damping", pytest.approx(4.95), pytest.approx(6.05), pytest.approx(0.55)),
    ]
    made, _ = asked.operation(np.array([0.0, 2.0, -1.0]), asked.span[0])
    assert (made.slider_stiffness, made.slider_damping) == (4200.0, pytest.approx(4.95))


@pytest.mark.parametrize("force", [{"force": "1 N"}, {"slider": {"force": "1 N"}}])
def test_numbers_of_the_drive_are_changed_in_the_case_too(force):
    tables = {
        "published": "rig-2-spring-c",
        "drive": {"torque": {"kind": "induction-motor", "breakdown_torque": 2.0, "breakdown_slip": 0.3}},
        **force,
    }
    tables["drive"]["torque"]["synchronous_speed"] = "600 rpm"
    change = {"drive": {"torque": {"breakdown_torque": "10 %"}}, "slider.force": {"tolerance": "2 N"}}
    asked = {"over": FIELD, "between": ["500 rpm", "600 rpm"], "no_jump": True, "change": change}
    case = read_tuning_case(tables | {"tune": asked}, folder=Path())
    torque = ("drive.torque.breakdown_torque", pytest.approx(1.8), pytest.approx(2.2))
    assert [(c.name, c.low, c.high) for c in case.wish.change] == [torque, ("slider.force", -1.0, 3.0)]
    values = np.array([1.9, 2.5])
    _, drive = case.wish.operation(case.wish.scale_changes(values), 55.0)
    assert (drive.motor.breakdown_torque, drive.motor.synchronous_speed) == (pytest.approx(1.9), 55.0)
    assert drive.forces["slider.force"] == pytest.approx(2.5)
    tables = case.tuned_tables(SimpleNamespace(values=values), Path())
    written = read_case(tables, folder=Path(), overrides={"run.stop_time": 1.0})
    again = steady_drive(written.parameters, written.inputs, written.initial)
    assert again.motor.breakdown_torque == pytest.approx(1.9)
    assert again.forces["slider.force"] == pytest.approx(2.5)


def test_under_a_motor_the_crank_begins_as_it_does_in_the_case():
    motor = {"kind": "induction-motor", "breakdown_torque": 2.0, "breakdown_slip": 0.2, "synchronous_speed": "600 rpm"}
    asked = {"over": FIELD, "between": ["500 rpm", "600 rpm"], "no_jump": True, "change": {"slider.mass": "5 %"}}
    tables = {"published": "rig-2-spring-c", "drive": {"torque": motor}, "tune": asked}
    for initial, speed in (({}, 540.0), ({"crank_speed": "300 rpm"}, 300.0)):
        case = read_tuning_case(tables | {"initial": initial}, folder=Path())
        assert case.wish.start[-1] == pytest.approx(speed * RAD_S_PER_RPM)


# The command

CASE = """
published = "rig-2-spring-c"
[slider]
damping = "5.5 N*s/m"
[tune]
speeds = ["590 rpm", "600 rpm"]
least_margin = {margin}
peak = {{ output = "pin.C", below = "100 N" }}
change = {{ slider = {{ damping = ["5 N*s/m", "9 N*s/m"] }} }}
objective = "{objective}"
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def of(*options, margin=0.25, objective="least change", code=0):
        Path("case.toml").write_text(CASE.format(margin=margin, objective=objective))
        return linkwork("tune case.toml", *options, code=code)

    return of


def test_command_writes_the_changed_case(run):
    result = run()
    assert "slider.damping" in result.output
    assert "verified: response followed again" in result.output
    made = load_case("out/case-tuned.toml")
    assert find_orbit(made.parameters, speed="600 rpm").largest == pytest.approx(0.75, abs=1e-3)
    assert made.parameters == replace(RIG_2, slider_damping=made.parameters.slider_damping)
    assert json.loads(Path("out/case-tuned.json").read_text())["met"]
    assert Path("out/case-tuned.png").exists()


@pytest.mark.slow
def test_command_reports_what_cannot_be_met(run):
    result = run("--no-plot", "--json", "--set", 'tune.peak.below="10 N"', margin=0.25, code=cli.CHECK_FAILED)
    found = json.loads(result.stdout)
    assert not found["met"]
    assert found["requirements"]["stable motion"]["met"]
    assert not found["requirements"]["greatest pin.C"]["met"]
    assert "note: greatest pin.C is not met" in result.stderr
    assert not Path("out/case-tuned.png").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--set", "tune.objective=most"], "least slider.damping"),
        (["--set", "tune.speds=1"], "tune.speeds"),
        (["--set", "drive.torque=1 N*m"], "so that its speed follows"),
        (["--set", 'tune.speeds=["600 rpm"]'], "a list of 2"),
        (["--set", "tune.turns=0"], "at least 1"),
        (["--set", 'tune.speeds=["1 m", "2 m"]'], "rad/s"),
    ],
)
def test_command_says_what_is_wrong(run, options, words):
    result = run(*options, code=cli.WRONG)
    assert words in result.stderr


def test_a_case_of_a_tuning_is_taken_for_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = linkwork("run", EXAMPLES / "tuning.toml", code=cli.WRONG)
    assert "linkwork tune" in result.stderr


def test_the_example_loads():
    case = load_tuning_case(EXAMPLES / "tuning.toml")
    assert (case.wish.least, case.wish.names) == ("slider.damping", ("slider.damping",))
    assert case.wish.parameters == LIGHT
    with pytest.raises(LinkworkError, match="tune"):
        load_tuning_case(EXAMPLES / "run-up.toml")


def test_no_way_that_could_be_followed_names_range_and_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.tuning.optimisation._Search.keep", lambda *_: None)
    limits, change = [Limit(output="pin.C", below="9 N")], {"slider.stiffness": "5 %"}
    wish = Wish(parameters="rig-2-spring-c", speeds=("500 rpm", "510 rpm"), change=change, limits=limits)
    with pytest.raises(LinkworkError, match=r"500 to 510 rpm .* slider\.stiffness .* narrower"):
        tune(wish)
