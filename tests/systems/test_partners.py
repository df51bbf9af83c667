"""Partners and controllers, each against an answer in closed form."""

import re
from dataclasses import fields
from math import exp, inf, nan, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, instantiate_fmu, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from analysis import Inputs, simulate
from analysis.export import NATIVE, build, build_controller, build_native
from analysis.export.controllers import CONTROLLERS, UNITS, Controller
from analysis.linkages import load_linkage
from analysis.mechanisms import FIVE_BAR
from analysis.probe import probe
from analysis.systems.description import HERE, PARTNERS
from analysis.units import _registry
from linkwork import variables
from linkwork.errors import ParameterError


def partner(name: str, initial: dict[str, float] | None = None, **changes: float) -> tuple[Any, Any]:
    """Parameters and state at the start of a partner, some of them changed."""
    mechanism = load_linkage(Path(str(HERE / "partners" / f"{name}.toml")))
    start = mechanism.first_set
    return type(start.parameters)(**{**_fields(start.parameters), **changes}), type(start.initial)(**(initial or {}))


def _fields(record: Any) -> dict[str, Any]:
    return {entry.name: getattr(record, entry.name) for entry in fields(record)}


def begin(made: Controller) -> None:
    """Go through the initialisation."""
    made.enter_initialization_mode()
    made.exit_initialization_mode()


def controller(name: str, **values: float) -> Controller:
    made = CONTROLLERS[name](instance_name=name)
    for key, value in values.items():
        assert hasattr(made, key)
        setattr(made, key, value)
    return made


@pytest.mark.parametrize("speed", [20.0, 90.0, 112.0])
def test_the_motor_has_the_torque_of_kloss_at_a_steady_speed(speed: float) -> None:
    parameters, initial = partner("induction-motor", {"rotor_speed": speed, "flange_speed": speed})
    field = 1076.0 * pi / 30.0
    run = simulate(parameters, Inputs(field_speed=field, flange_speed=speed), initial=initial, stop_time=2.0, step=0.01)
    slip, least = 1.0 - speed / field, 322.8 / 1076.0
    kloss = 2.0 * 0.06 / (slip / least + least / slip)
    assert run["shaft.exerted_torque"][-1] == pytest.approx(kloss, rel=2e-5)
    # the load gets it, and the shaft is twisted by it
    assert run["shaft.turn"][-1] == pytest.approx(kloss / 50.0, rel=2e-5)


def test_the_rotor_swings_on_its_shaft_at_the_frequency_of_both() -> None:
    still = {"airGap_breakdown_torque": 0.0, "shaft_damping": 0.0}
    parameters, initial = partner("induction-motor", {"rotor_angle": 1e-3}, **still)
    frequency = sqrt(50.0 / 2e-4)
    times = np.linspace(0.0, 2.0 * pi / frequency, 41)
    held = Inputs(field_speed=0.0, flange_speed=0.0)
    run = simulate(parameters, held, initial=initial, samples=times, stop_time=times[-1])
    np.testing.assert_allclose(run["rotor.angle"], 1e-3 * np.cos(frequency * times), atol=1e-9)
    np.testing.assert_allclose(run["shaft.exerted_torque"], 50.0 * run["rotor.angle"], atol=1e-12)


def test_the_flywheel_is_accelerated_through_the_gear() -> None:
    parameters, _ = partner("flywheel-gear", shaft_stiffness=0.0, shaft_damping=0.0, bearings_damping=0.0)
    run = simulate(parameters, Inputs(speed=0.0, pinion_torque=2.0), stop_time=1.0, step=0.01)
    # on the pinion: its own inertia, and the wheel's by the square of the ratio
    np.testing.assert_allclose(run["pinion.speed"], 2.0 / (5e-4 + 0.5 * 0.2**2) * run.time, rtol=1e-9, atol=1e-12)


def test_the_line_shaft_gives_each_load_what_its_side_is_twisted_by() -> None:
    parameters, initial = partner("line-shaft", {"leftFlange_angle": 0.01, "rightFlange_angle": -0.03})
    held = Inputs(leftFlange_speed=0.0, rightFlange_speed=0.0)
    run = simulate(parameters, held, initial=initial, stop_time=5.0, step=0.01)
    assert run["disc.angle"][-1] == pytest.approx(-0.01, abs=1e-9)
    assert run["left.exerted_torque"][-1] == pytest.approx(50.0 * -0.02, abs=1e-6)
    assert run["right.exerted_torque"][-1] == pytest.approx(50.0 * 0.02, abs=1e-6)


def test_the_press_load_resists_as_its_springs_do_and_sticks_where_friction_holds_it() -> None:
    parameters, initial = partner("press-load", {"ram_position": 0.05, "holder_position": 0.05})
    run = simulate(parameters, Inputs(speed=0.1), initial=initial, stop_time=4.0, step=1e-3)
    # pushed slowly to 0.45 m: the sheet from 0.3 m on, the spring, the friction of the guide
    force, place = run["contact.exerted_force"][-1], run["holder.position"][-1]
    assert force == pytest.approx(-(20e3 * (place - 0.3) + 300.0 * place + 15.0), rel=2e-3)
    assert run["ram.position"][-1] - place == pytest.approx(-force / 200e3, rel=2e-2)
    # let go, the holder sticks: less than 15 N pull it; smooth friction lets it creep by less than 2 mm in a second
    stuck, there = partner("press-load", {"ram_position": 0.0, "holder_position": 0.04})
    rest = simulate(stuck, Inputs(speed=0.0), initial=there, stop_time=1.0, step=1e-3)
    assert abs(rest["holder.position"][-1] - 0.04) < 2e-3


def test_a_current_rises_in_the_winding_as_it_must() -> None:
    servo = controller("dc-servo", torque_reference=100.0, current_limit=10.0, sample_time=1e-4)
    begin(servo)
    found = []
    for n in range(200):
        servo.do_step(n * 1e-4, 1e-4)
        found.append(servo.current)
    # at first the limit of the voltage is what holds: 24 V at 1 ohm and 1 mH, held rotor
    np.testing.assert_allclose(found[:5], [24.0 * (1.0 - exp(-0.1 * n)) for n in range(5)], rtol=1e-12)
    # in the end the current that the limit allows, and its torque
    assert found[-1] == pytest.approx(10.0, rel=1e-9)
    assert max(found) < 11.5
    assert servo.torque == pytest.approx(0.1 * 10.0, rel=1e-9)


def test_the_encoder_counts() -> None:
    servo = controller("dc-servo", angle=1.0, encoder_counts=100.0)
    begin(servo)
    assert servo.encoder_angle == pytest.approx(15 * 2.0 * pi / 100.0)


def test_a_pid_controller_has_its_three_shares() -> None:
    pid = controller("pid", gain=3.0, integral_gain=5.0, derivative_gain=0.5, sample_time=0.1, limit=100.0)
    begin(pid)
    for n in range(1, 11):
        pid.reference = 0.1 * n  # a ramp of 1 m/s
        pid.do_step(0.1 * n, 0.1)
    # the sum of the errors before the last sample, 0 to 0.9, by the sample time
    assert pid.force == pytest.approx(3.0 * 1.0 + 5.0 * 0.1 * 4.5 + 0.5 * 1.0)


def test_a_tracking_time_below_a_sample_leaves_the_force_at_its_limit() -> None:
    gains = {"gain": 1.0, "integral_gain": 1.0, "limit": 1.0}
    made = controller("pid", **gains, tracking_time=1e-3, reference=5.0, sample_time=0.01)
    begin(made)
    for number in range(20):
        made.do_step(0.01 * number, 0.01)
        assert made.force == 1.0


def test_an_integral_does_not_wind_up_at_the_limit() -> None:
    limited = controller("pid", integral_gain=100.0, limit=1.0, tracking_time=0.05, reference=1.0, sample_time=0.01)
    begin(limited)
    limited.do_step(0.01, 10.0)
    assert limited.force == 1.0
    assert limited.integral < 7.0
    limited.reference = -0.5
    limited.do_step(10.01, 0.3)
    assert limited.force < 1.0


#: Exponents of the base units of all units that FMUs name.
_BASES = ("kg", "m", "s", "rad")
EXPONENTS = UNITS | {name: {base: getattr(unit, base) for base in _BASES} for name, unit in variables.UNITS.items()}


@pytest.mark.parametrize("name", EXPONENTS)
def test_exponents_of_the_base_units_are_those_of_pint(name: str) -> None:
    product = re.sub(r"([a-z])(\d)", r"\1**\2", name.replace("(m.s)", "m/s")).replace(".", "*")
    product += "".join(f" * {base}**{-exponent}" for base, exponent in EXPONENTS[name].items())
    # an angle is a number to pint: the candela stands for its unit
    assert _registry().Quantity(1.0, product.replace("rad", "cd")).to("").magnitude == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["pid", "state-feedback"])
def test_a_controller_without_gains_adds_nothing_to_the_feed_forward(name: str) -> None:
    idle = controller(name, reference=0.3, feed_forward=4.0)
    begin(idle)
    idle.do_step(0.0, 0.05)
    assert idle.force == 4.0


def test_state_feedback_and_its_limit() -> None:
    start = {"position": 0.3, "velocity": -0.5, "reference": 0.1}
    feedback = controller("state-feedback", position_gain=10.0, velocity_gain=2.0, feed_forward=4.0, **start)
    begin(feedback)
    assert feedback.force == pytest.approx(4.0 - 10.0 * 0.2 + 2.0 * 0.5)
    feedback.limit = 1.0
    feedback.do_step(1e-3, 1e-3)
    assert feedback.force == 1.0


def test_a_motion_reference_is_its_series_and_the_rate_its_derivative() -> None:
    values = {"motion_0": 0.5, "motion_cos_1": 0.2, "motion_sin_3": -0.1, "load_sin_2": 7.0, "speed": 4.0}
    series = controller("motion-reference", **values)
    step, places = 1e-6, []
    for angle in (0.7 - step, 0.7 + step, 0.7):
        series.angle = angle
        series.sample(0.0)
        places.append(series.position)
    assert series.position == pytest.approx(0.5 + 0.2 * np.cos(0.7) - 0.1 * np.sin(2.1))
    assert series.velocity == pytest.approx(4.0 * (places[1] - places[0]) / (2.0 * step), rel=1e-8)
    assert series.force == pytest.approx(7.0 * np.sin(1.4))
    ahead = (series.position, series.velocity, series.force)
    series.angle, series.lead = 0.3, 0.1
    series.sample(0.0)
    assert (series.position, series.velocity, series.force) == pytest.approx(ahead)


def test_a_force_table_is_met_at_its_points_and_straight_between_them_in_every_turn() -> None:
    right = 3.0 * np.cos(np.radians(np.arange(0.0, 360.0, 5.0))) + np.arange(72)
    made = controller("force-table", **{f"table_{n}": float(value) for n, value in enumerate(right)})
    for degrees in np.arange(-720.0, 720.0, 1.25):
        made.angle = float(np.radians(degrees))
        made.sample(0.0)
        place = degrees % 360.0 / 5.0
        assert made.force == pytest.approx(np.interp(place, np.arange(73), [*right, right[0]]), abs=1e-11)


def set_values(made: Controller, **values: float) -> None:
    """Set values as a master does, by their references."""
    references = {v.name: reference for reference, v in made.vars.items()}
    made.set_real([references[name] for name in values], list(values.values()))


def test_gains_and_limits_act_from_the_next_sample_on() -> None:
    pid = controller("pid", gain=2.0, integral_gain=5.0, reference=1.0, sample_time=0.1, limit=100.0)
    begin(pid)
    pid.do_step(0.1, 0.1)
    before, integral = pid.force, pid.integral
    set_values(pid, gain=3.0)
    assert pid.force == before
    pid.do_step(0.2, 0.1)
    # the integral has the force that it had grown to: a change of the gain alone changes the share of the error alone
    assert pid.force == pytest.approx(3.0 + integral)
    set_values(pid, limit=0.5)
    pid.do_step(0.3, 0.1)
    assert pid.force == 0.5


@pytest.mark.parametrize(
    ("name", "values", "sentence"),
    [
        ("pid", {"sample_time": 0.01}, "sample_time is a fixed parameter"),
        ("pid", {"gain": float("nan")}, "gain is nan: it must be a finite number"),
        ("pid", {"gain": 3.0, "tracking_time": 0.0}, "tracking_time is 0.0: .* a finite number greater than zero"),
        ("state-feedback", {"limit": -1.0}, "limit is -1.0: it must be a finite number and not negative"),
        ("pid", {"limit": float("inf")}, "limit is inf: it must be a finite number and not negative"),
        ("dc-servo", {"inductance": 0.0}, "inductance is 0.0: it must be a finite number greater than zero"),
    ],
)
def test_what_a_controller_does_not_take_in_a_run(name: str, values: dict[str, float], sentence: str) -> None:
    made = controller(name)
    begin(made)
    kept = {parameter: getattr(made, parameter) for parameter in made.parameters}
    with pytest.raises(ValueError, match=sentence):
        set_values(made, **values)
    assert {parameter: getattr(made, parameter) for parameter in made.parameters} == kept
    made.do_step(0.0, 1e-3)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_bad_parameter_of_a_controller_fails_the_initialisation(name: str) -> None:
    for parameter, row in controller(name).parameters.items():
        bad = {"positive": 0.0, "not negative": -1.0}.get(row.rule, float("inf"))
        made = controller(name)
        set_values(made, **{parameter: bad})
        made.get_real([0])
        with pytest.raises(ValueError, match=parameter):
            begin(made)


def started(name: str, folder: Path, **values: float) -> tuple[Any, Any]:
    """The model description of a controller's FMU, and a slave of it after the initialisation."""
    fmu = build_controller(name, folder)
    description = read_model_description(str(fmu))
    slave = instantiate_fmu(extract(str(fmu), str(folder / name)), description, "CoSimulation")
    slave.setupExperiment(stopTime=1.0)
    slave.enterInitializationMode()
    of = {v.name: v.valueReference for v in description.modelVariables}
    slave.setReal([of[key] for key in values], list(values.values()))
    slave.exitInitializationMode()
    return description, slave


@pytest.mark.fmu
def test_a_controller_lives_on_after_a_refusal(tmp_path: Path) -> None:
    description, slave = started("pid", tmp_path, gain=2.0, reference=1.0)
    kinds = {v.name: v.variability for v in description.modelVariables if v.causality == "parameter"}
    assert {name for name, kind in kinds.items() if kind == "fixed"} == {"sample_time"}
    assert set(kinds.values()) == {"fixed", "tunable"}
    of = {v.name: v.valueReference for v in description.modelVariables}
    for wrong in ("sample_time", "tracking_time"):
        with pytest.raises(FMICallException):
            slave.setReal([of[wrong]], [0.0])
    slave.setReal([of["gain"]], [3.0])
    slave.doStep(0.0, 2e-3)
    assert slave.getReal([of["force"], of["tracking_time"]]) == [3.0, 0.1]
    slave.terminate()
    slave.freeInstance()


@pytest.mark.fmu
def test_states_of_a_controller_that_are_damaged_or_of_another_are_refused(tmp_path: Path) -> None:
    (_, slave), (_, other) = (started(name, tmp_path) for name in ("pid", "state-feedback"))
    slave.doStep(0.0, 2e-3)
    good = slave.serializeFMUstate(slave.getFMUstate())
    changed = [good[:k] + bytes([good[k] ^ 1]) + good[k + 1 :] for k, byte in enumerate(good) if 48 <= byte < 58]
    assert len(changed) > 20
    foreign = other.serializeFMUstate(other.getFMUstate())
    before = slave.serializeFMUstate(slave.getFMUstate())
    for text in (b"x", b"", b'{"phase": 7}', foreign, *changed):
        with pytest.raises(FMICallException):
            slave.setFMUstate(slave.deSerializeFMUstate(text))
    assert slave.serializeFMUstate(slave.getFMUstate()) == before
    slave.doStep(2e-3, 2e-3)
    slave.setFMUstate(slave.deSerializeFMUstate(good))
    slave.doStep(2e-3, 2e-3)
    slave.freeInstance()
    other.freeInstance()


@pytest.mark.parametrize("name", PARTNERS)
def test_the_balance_of_energy_of_a_partner_closes(name: str) -> None:
    load_linkage(Path(str(HERE / "partners" / f"{name}.toml")))
    run = simulate(name, stop_time=0.2, step=1e-3)
    assert np.abs(run["energy.residual"]).max() < 1e-6


def test_constants_of_a_law_are_read_with_their_units_and_must_have_names_of_their_own(tmp_path: Path) -> None:
    text = (Path(str(HERE / "partners" / "induction-motor.toml"))).read_text(encoding="utf-8")
    for old, new, message in (
        ("breakdown_torque = ", "torque_of_breakdown = ", "law"),
        ('"0.06 N*m"', '"0.06 apples"', "breakdown_torque"),
        ("breakdown_speed", "sin", "law"),
        (", breakdown_speed = ", ", Slip = ", "law"),
    ):
        (tmp_path / "wrong.toml").write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(ParameterError, match=message):
            load_linkage(tmp_path / "wrong.toml")


@pytest.mark.slow
@pytest.mark.fmu
@pytest.mark.parametrize(
    "name", [*(pytest.param(name, marks=pytest.mark.long) for name in PARTNERS[:-1]), PARTNERS[-1]]
)
def test_the_fmu_of_a_partner_is_valid_and_probes_clean(name: str, tmp_path: Path) -> None:
    fmu = build_native(load_linkage(Path(str(HERE / "partners" / f"{name}.toml"))), NATIVE, tmp_path)
    assert validate_fmu(str(fmu)) == []
    # random inputs make the contact of the press leap: a step and two halves of it then differ, which is questionable alone
    assert {finding.severity for finding in probe(fmu, calls=200, seconds=2.0).findings} <= {"questionable"}


@pytest.mark.fmu
@pytest.mark.parametrize("name", CONTROLLERS)
def test_the_fmu_of_a_controller_is_valid(name: str, tmp_path: Path) -> None:
    assert validate_fmu(str(build_controller(name, tmp_path))) == []


@pytest.mark.slow
@pytest.mark.fmu
def test_what_a_probe_finds_in_a_controller_is_the_wrappers(tmp_path: Path) -> None:
    """What PythonFMU's wrapper does with every FMU (docs/fmu.md): nothing wrong is found that the five-bar slider's has not."""
    fmus = [build_controller("pid", tmp_path), build(FIVE_BAR, tmp_path)]
    found = [{f.key.removesuffix(": Fatal") for f in probe(fmu, calls=100, seconds=1.0).findings} for fmu in fmus]
    # times are those of the master; a bad value is refused at once in a run; who cleans up may end a run twice
    left = {"DoStep: a gap in time", "DoStep: a time in the past", "SetReal: NaN"}
    assert found[0] - found[1] <= {f"cs: {key}" for key in left | {"Terminate in terminated: out of order"}}


def test_no_step_is_taken_out_of_order_or_without_an_end() -> None:
    made = controller("pid", sample_time=0.1)
    assert not made.do_step(0.0, 0.1)
    with pytest.raises(ValueError, match="out of order"):
        made.exit_initialization_mode()
    made.setup_experiment(100.0, 101.0, None)
    begin(made)
    assert made.count == 1, "samples are counted from the start of the run"
    for step in (0.0, -0.1, inf, nan, 2.0):
        assert not made.do_step(100.0, step)
    state = made._get_fmu_state()
    assert made.do_step(100.0, 1.0)
    assert made.count == 10
    made.terminate()
    assert not made.do_step(101.0, 0.1)
    made._set_fmu_state(state)
    assert made.do_step(100.0, 0.5)
    with pytest.raises(ValueError, match="computed"):
        made.set_real([next(v for v in made.vars if made.vars[v].name == "force")], [1.0])
