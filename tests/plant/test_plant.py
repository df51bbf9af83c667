"""The plants as stateful objects: what a step does, what it refuses, and how a run is saved and taken up again.

Tests of what every plant does run over the mechanisms and their drives; what is special of one comes at the end.
"""

import json
from dataclasses import dataclass, replace
from math import asin, cos, degrees, hypot, inf, isfinite, nan, pi, radians, sin, sqrt
from types import ModuleType
from typing import Any

import pytest
from scipy.integrate import solve_ivp

from linkwork import five_bar, slider_crank
from linkwork.errors import (
    AssemblyError,
    InputError,
    IntegrationError,
    LinkworkError,
    ParameterError,
    StateError,
    StepError,
)
from linkwork.five_bar.assembly import check_assembly
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism
from linkwork.plant import Plant, check_tolerance
from linkwork.slider_crank import dynamics
from linkwork.slider_crank.parameters import InitialState as SliderCrankStart
from linkwork.slider_crank.published import CRANK_SPEED, OFFSET_CASE, parameters
from tests import published, slider_cranks, strategies
from tests.published import CM, DYN_S_PER_CM
from tests.published_rahman import CRANK_IN, GREATEST_SHIFTS_IN, INCH, ROD_IN, SPOTS, Spot
from tests.refusals import refused
from tests.slider_cranks import DRIVES

W = SETS["table-3.1"].crank_speed
#: A turn at 420 rpm (s).
TURN = 2.0 * pi / W


@dataclass(frozen=True)
class Kind:
    """A mechanism for the tests of what every plant does."""

    name: str
    mechanism: Mechanism
    equations: ModuleType
    cases: ModuleType
    #: The thesis's mechanism and start.
    parameters: Any
    initial: Any
    #: Inputs of the thesis's run.
    inputs: dict[str, float]
    #: The output that is the rate of the second freedom, and the input that is its force.
    rate: str
    force: str
    #: The drive by speeds alone, and the outputs that are the accelerations commanded.
    speeds: str
    accelerations: tuple[str, str]
    #: Masses that count, beside the crank's inertia, in the scale of the errors.
    masses: tuple[str, ...]

    @property
    def commands(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.mechanism.channels if c.kind == "command")

    @property
    def input_names(self) -> tuple[str, ...]:
        return self.mechanism.input_names

    def new(self, parameters: Any, initial: Any, **options: Any) -> Any:
        return Plant(self.mechanism, parameters, initial, **options)

    def restore(self, saved: dict[str, Any]) -> Any:
        return Plant.restore(self.mechanism, saved)

    def start(self, drive: str, **options: Any) -> Any:
        """A plant that starts the thesis's run under a drive, with other ``options``."""
        return self.new(
            options.pop("parameters", self.parameters),
            options.pop("initial", self.initial),
            **modes(drive),
            inputs={**self.inputs, **options.pop("inputs", {})},
            **options,
        )

    def of_seed(self, seed: int, drive: str, **options: Any) -> Any:
        """A random mechanism in a random state with all of its inputs set."""
        case = self.cases.seeded(seed)
        return self.new(case.parameters, case.initial, **modes(drive), inputs=case.fmi_inputs(), **options)


FIVE_BAR = Kind(
    "five-bar",
    five_bar.MECHANISM,
    five_bar,
    strategies,
    TABLE_3_1,
    InitialState(crank_speed=W),
    {"drive.speed": W},
    "slider_velocity",
    "slider.force",
    "speed",
    ("crank_acceleration", "slider_acceleration"),
    ("coupler_mass", "rocker_mass", "slider_mass"),
)
SLIDER_CRANK = Kind(
    "slider-crank",
    slider_crank.MECHANISM,
    slider_crank,
    slider_cranks,
    *OFFSET_CASE,  # a4 = 10 in, S1 = 3.5 in at 50 rpm
    {"drive.speed": CRANK_SPEED},
    "shift_velocity",
    "axial.force",
    "speed-shift",
    ("crank_acceleration", "shift_acceleration"),
    ("crank_mass", "rod_mass", "slider_mass"),
)
#: Every mechanism under each of its drives.
DRIVEN = [(FIVE_BAR, drive) for drive in ("torque", "speed")] + [(SLIDER_CRANK, drive) for drive in DRIVES]
IDS = [f"{kind.name}-{drive}" for kind, drive in DRIVEN]
EVERY_DRIVE = pytest.mark.parametrize(("kind", "drive"), DRIVEN, ids=IDS)
EVERY_KIND = pytest.mark.parametrize("kind", [FIVE_BAR, SLIDER_CRANK], ids=lambda kind: kind.name)


def modes(drive: str) -> dict[str, int]:
    """Options of a plant for a drive: how the crank is driven, and how the shift where there is one."""
    turning, _, shifting = drive.partition("-")
    chosen = {"drive_mode": ("torque", "speed").index(turning)}
    return chosen | ({"axial_mode": ("force", "shift", "groove").index(shifting)} if shifting else {})


def speed_plant(**options: Any) -> Plant:
    return FIVE_BAR.start("speed", initial=options.pop("initial", InitialState()), **options)


def default(drive: str = "speed-shift", **options: Any) -> Plant:
    return SLIDER_CRANK.start(drive, **options)


def go(plant: Plant, steps: int, step: float) -> None:
    start = plant.time
    for n in range(steps):
        plant.step(start + n * step, step)


def running(kind: Kind) -> Any:
    """A plant at 0.01 s whose commanded speeds do not vanish."""
    plant = speed_plant() if kind is FIVE_BAR else default(inputs={"drive.speed": 5.0, "axial.speed": 0.2})
    go(plant, 10, 1e-3)
    return plant


# ------------------------------------------------------------------ what a step does


@pytest.mark.parametrize("seed", range(8))
@EVERY_DRIVE
def test_step_against_another_integrator(seed: int, kind: Kind, drive: str) -> None:
    case = kind.cases.seeded(seed)
    i, p = case.read(drive), case.parameters.constants()
    duration = 2e-3

    def rates(t: float, y: Any) -> Any:
        return kind.equations.dynamics.derivative(tuple(y.tolist()), i, p)

    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    expected = solve_ivp(rates, (0.0, duration), case.under(drive), **tight).y[:, -1]
    plant = kind.of_seed(seed, drive, tolerance=1e-12)
    plant.step(0.0, duration)
    assert plant.state == pytest.approx(expected, rel=1e-9, abs=1e-9)


#: Ways to cut up 20 ms: in equal steps, and in some from a microsecond upwards.
CUTS = [[0.02], *([0.02 / n] * n for n in (2, 8, 50)), [1e-6, 3e-3, 2e-6, 1.1e-2, 1e-6, 7e-5, 5.926e-3]]


@EVERY_DRIVE
def test_cutting_up_the_communication_step_changes_nothing_beyond_the_tolerance(kind: Kind, drive: str) -> None:
    ends = []
    for sizes in CUTS:
        plant = kind.of_seed(3, drive)
        # the ramp of a commanded speed starts anew at every step: none here
        for name in kind.commands:
            plant.set_input(name.replace("speed", "acceleration"), 0.0)
        for size in sizes:
            plant.step(plant.time, size)
        assert plant.time == pytest.approx(0.02, rel=1e-12)
        ends.append(plant.outputs()[:15])
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], rel=1e-6, abs=1e-6)


def test_tolerance_is_what_the_error_follows() -> None:
    exact = published.U_CM_AT_CRANK_DEG[360] * CM
    errors = []
    for tolerance in (1e-4, 1e-7, 1e-10):
        plant = speed_plant(tolerance=tolerance)
        plant.step(0.0, TURN)
        errors.append(abs(plant.state[1] - exact))
    assert errors[0] < 1e-3
    assert errors[1] < 1e-6
    assert errors[2] < 1e-9
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.parametrize("again", [True, False])
@EVERY_KIND
def test_ramps_of_the_speeds_start_anew_at_every_step(kind: Kind, again: bool) -> None:
    # speed + acceleration (t - t_n), whether or not the speed is set again
    speeds, ramps = (kind.inputs["drive.speed"], 0.3)[: len(kind.commands)], (20.0, -4.0)
    given = dict(zip(kind.commands, speeds))
    rates = {name.replace("speed", "acceleration"): ramp for name, ramp in zip(given, ramps)}
    plant = kind.start(kind.speeds, initial=replace(kind.initial, crank_speed=0.0), inputs=given | rates)
    step = 1e-3
    o = plant.outputs()
    assert [getattr(o, name) for name in kind.accelerations[: len(speeds)]] == [*ramps[: len(speeds)]]
    for n in range(3):
        if again:
            for name, speed in given.items():
                plant.set_input(name, speed)
        before = plant.state
        plant.step(n * step, step)
        for k, (speed, ramp) in enumerate(zip(speeds, ramps)):
            assert plant.state[2 + k] == pytest.approx(speed + ramp * step, rel=1e-13)
            assert plant.state[k] - before[k] == pytest.approx(speed * step + 0.5 * ramp * step**2, rel=1e-11)


@pytest.mark.parametrize("name", SLIDER_CRANK.commands)
def test_speed_that_is_not_commanded_anew_goes_on_as_its_ramp_left_it(name: str) -> None:
    plant = default(inputs={"drive.acceleration": 20.0, "axial.speed": 0.3, "axial.acceleration": -4.0})
    plant.step(0.0, 1e-2)
    ramped = {"drive.speed": CRANK_SPEED + 20.0 * 1e-2, "axial.speed": 0.3 - 4.0 * 1e-2}
    plant.set_input(name, 0.7)
    o = plant.outputs()
    assert (o.crank_speed, o.shift_velocity) == pytest.approx(tuple((ramped | {name: 0.7}).values()), rel=1e-13)


def commands(kind: Kind) -> list[tuple[str, ...]]:
    one = [(name,) for name in kind.commands]
    return one if len(one) == 1 else [*one, kind.commands]


@pytest.mark.parametrize(
    ("kind", "drive", "command"),
    [
        pytest.param(kind, drive, c, id=f"{name}-{'+'.join(c)}")
        for (kind, drive), name in zip(DRIVEN, IDS)
        for c in commands(kind)
    ],
)
@pytest.mark.parametrize("seed", range(15))
def test_jump_of_a_commanded_speed_conserves_what_has_no_impulse(
    seed: int, kind: Kind, drive: str, command: tuple[str, ...]
) -> None:
    case = kind.cases.seeded(seed)
    turned, shifted, grooved = ("speed" in drive, "shift" in drive, "groove" in drive)
    plant = kind.of_seed(seed, drive)
    before = plant.outputs()
    x, p = plant.state, case.parameters.constants()
    q = kind.equations.kinematics.position(x[0], x[1], p)
    m = kind.equations.dynamics.inertia(q, kind.equations.kinematics.coefficients(q, p), p)
    w, v = before.crank_speed, getattr(before, kind.rate)
    commanded = {"drive.speed": w + 5.0, "axial.speed": v - 0.7}
    for name in command:
        plant.set_input(name, commanded[name])
    after = plant.outputs()
    new = (after.crank_speed, getattr(after, kind.rate))
    if not (turned and "drive.speed" in command) and not (shifted and "axial.speed" in command):
        assert after == before
        return
    if turned:
        assert new[0] == (commanded["drive.speed"] if "drive.speed" in command else w)
    else:
        assert m.m11 * new[0] + m.m12 * new[1] == pytest.approx(m.m11 * w + m.m12 * v, rel=1e-11, abs=1e-11)
    if shifted:
        assert new[1] == (commanded["axial.speed"] if "axial.speed" in command else v)
    elif grooved:
        law = case.parameters
        slope = law.groove_amplitude * law.groove_ratio * cos(law.groove_ratio * after.crank_angle)
        assert new[1] == pytest.approx(slope * new[0], rel=1e-13)
    else:
        assert m.m12 * new[0] + m.m22 * new[1] == pytest.approx(m.m12 * w + m.m22 * v, rel=1e-12, abs=1e-12)
        assert new[1] != v
    assert new[0] != w or new[1] != v
    for place in ("crank_angle", kind.rate.replace("velocity", "position")):
        assert getattr(after, place) == getattr(before, place)
    # the impulses work at the mean of the speeds before and after: that is supplied, so that the balance holds across it
    assert after.energy_dissipated == before.energy_dissipated
    gain = 0.5 * (m.m11 * new[0] ** 2 + 2.0 * m.m12 * new[0] * new[1] + m.m22 * new[1] ** 2) - before.energy_kinetic
    size = max(1.0, after.energy_kinetic)
    assert after.energy_kinetic - before.energy_kinetic == pytest.approx(gain, rel=1e-9, abs=1e-12 * size)
    assert after.energy_supplied - before.energy_supplied == pytest.approx(gain, rel=1e-9, abs=1e-12 * size)
    assert after.energy_supplied != before.energy_supplied
    assert after.energy_residual == pytest.approx(before.energy_residual, abs=1e-9 * size)
    # shown before the step as it is at its start
    plant.step(0.0, 1e-9)
    assert plant.state[2:4] == pytest.approx(new, rel=1e-5, abs=1e-5)


def test_step_size_is_carried_from_step_to_step(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = speed_plant()
    go(plant, 10, 1e-4)
    assert plant.save()["step_size"] > 1e-4
    calls = 0
    equations = plant.mechanism.equations

    def counted(*arguments: Any) -> five_bar.dynamics.State:
        nonlocal calls
        calls += 1
        return equations.derivative(*arguments)

    monkeypatch.setattr(plant, "mechanism", replace(plant.mechanism, equations=equations._replace(derivative=counted)))
    plant.step(10 * 1e-4, 1e-4)
    assert calls == 12  # one step of the integrator, with the evaluation at its start and without that at its end


def test_end_of_a_step_that_cannot_be_assembled_is_refused_without_the_equations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plant = speed_plant()
    monkeypatch.setattr(plant, "_step_size", 1.0)
    before = plant.state
    # they are not asked at the end of a step, and know no limit here: the slider goes on
    equations = plant.mechanism.equations._replace(derivative=lambda x, i, p: (0.0, 10.0, 0.0, 0.0, 0.0, 0.0))
    monkeypatch.setattr(plant, "mechanism", replace(plant.mechanism, equations=equations))
    with pytest.raises(AssemblyError, match=r"in the step from t = 0 s: the links cannot be joined at .* position 0.2"):
        plant.step(0.0, 0.1)
    assert plant.state == before


@EVERY_DRIVE
def test_setting_the_same_speeds_again_does_nothing(kind: Kind, drive: str) -> None:
    plain, again = kind.start(drive), kind.start(drive)
    for n in range(5):
        for name in kind.commands:
            again.set_input(name, kind.inputs.get(name, 0.0))
        for plant in (plain, again):
            plant.step(n * 1e-3, 1e-3)
    assert again.state == plain.state


#: Inputs that are of no use under part of a drive's name.
NO_USE = {
    "torque": ("drive.speed", "drive.acceleration"),
    "speed": ("drive.torque",),
    "force": ("axial.speed", "axial.acceleration"),
    "shift": ("axial.force",),
    "groove": ("axial.force", "axial.speed", "axial.acceleration"),
}


@EVERY_DRIVE
def test_inputs_of_another_drive_are_of_no_use(kind: Kind, drive: str) -> None:
    without = {name for part in drive.split("-") for name in NO_USE[part]}
    one, other = kind.of_seed(1, drive), kind.of_seed(1, drive)
    for name in without:
        other.set_input(name, other.inputs[name] + 3.0)
    assert other.outputs() == one.outputs()
    for plant in (one, other):
        plant.step(0.0, 1e-2)
    assert other.outputs() == one.outputs()
    # and every other input is of some
    for name in set(kind.input_names) - without:
        changed = kind.of_seed(1, drive)
        changed.set_input(name, changed.inputs[name] + 3.0)
        assert changed.outputs() != kind.of_seed(1, drive).outputs(), name


@EVERY_DRIVE
def test_energy_balance_over_a_run_with_everything_switched_on(kind: Kind, drive: str) -> None:
    plant = kind.of_seed(6, drive, tolerance=1e-11)
    given, largest = plant.inputs, 0.0
    for n in range(100):
        for k, name in enumerate(kind.input_names):
            plant.set_input(name, given[name] * (1.0 + 0.1 * sin(0.3 * n + k)))
        plant.step(n * 1e-3, 1e-3)
        largest = max(largest, plant.outputs().energy_kinetic)
    o = plant.outputs()
    assert o.energy_dissipated > 1e-3
    assert abs(o.energy_supplied) > 1e-3
    assert abs(o.energy_residual) < 1e-8 * max(1.0, largest)


# ------------------------------------------------------------------ what a step refuses


def snapshot(plant: Plant) -> str:
    return json.dumps(plant.save())


def assert_refused(plant: Plant, error: type[LinkworkError], match: str, time: float, step: float) -> LinkworkError:
    """The step fails with the message, leaves everything as it was, and the plant goes on as if it had not been asked."""
    before = snapshot(plant)
    with pytest.raises(error, match=match) as caught:
        plant.step(time, step)
    assert snapshot(plant) == before
    return caught.value


NOT_FINITE = "both must be finite numbers"


@EVERY_KIND
@pytest.mark.parametrize(
    ("time", "step", "message"),
    [
        (0.01, 0.0, "it must be greater than zero"),
        (0.01, -1e-3, "it must be greater than zero"),
        (0.01, 1e-19, "a step of 1e-19 s .* it is lost in the rounding of the time"),
        (nan, 1e-3, NOT_FINITE),
        (0.01, nan, NOT_FINITE),
        (inf, 1e-3, NOT_FINITE),
        (0.01, inf, NOT_FINITE),
        (0.02, 1e-3, r"over a gap: it starts at t = 0\.02 s, but the state is at t = 0\.01 s"),
        (0.009, 1e-3, r"backwards: it starts at t = 0\.009 s, but .* t = 0\.01 s"),
    ],
)
def test_step_that_no_step_can_be(kind: Kind, time: float, step: float, message: str) -> None:
    assert_refused(running(kind), StepError, message, time, step)


@EVERY_KIND
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("step", "slack"), [(1e-6, 1e-12), (1e-5, 1e-11), (1e-3, 1e-9), (0.1, 1e-9)])
def test_a_millionth_of_the_step_or_a_nanosecond_counts_as_rounding(
    step: float, slack: float, sign: float, kind: Kind
) -> None:
    running(kind).step(0.01 + sign * 0.9 * slack, step)
    assert_refused(running(kind), StepError, "a step (backwards|over a gap)", 0.01 + sign * 1.1 * slack, step)


@pytest.mark.parametrize("value", [nan, inf, -inf])
@EVERY_KIND
def test_input_that_is_not_finite(kind: Kind, value: float) -> None:
    for name in kind.input_names:
        plant = running(kind)
        kept = plant.inputs[name]
        plant.set_input(name, value)
        sentence = rf"input {name} is {value} at t = 0\.01 s: it must be a finite number"
        with pytest.raises(InputError, match=sentence):
            plant.outputs()
        assert_refused(plant, InputError, sentence, 0.01, 1e-3)
        # the last good state stays readable once the input is good again
        plant.set_input(name, kept)
        assert all(map(isfinite, plant.outputs()))
        plant.step(0.01, 1e-3)


@EVERY_KIND
def test_errors_count_as_absolute_below_the_scale_of_the_mechanism(kind: Kind) -> None:
    par = kind.parameters

    def scale(speed: float) -> Any:
        return kind.equations.assembly.error_scale(par, (0.0, 0.0, speed, 0.0, 0.0, 0.0))

    mass = sum(getattr(par, name) for name in kind.masses)
    energy = 0.5 * (par.crank_inertia + mass * par.crank_length**2) * 40.0**2
    expected = (1.0, par.crank_length, 40.0, 40.0 * par.crank_length, energy, energy)
    assert scale(-40.0) == pytest.approx(expected, rel=1e-14)
    assert scale(0.1) == scale(1.0)  # one rad/s at least


@pytest.mark.parametrize(
    ("kind", "drive", "name", "where"),
    [
        (FIVE_BAR, "torque", "slider.force", r"slider position 0 m"),
        (SLIDER_CRANK, "torque-force", "slider.load", r"shift position 0\.0889 m"),
    ],
    ids=["five-bar", "slider-crank"],
)
def test_step_that_cannot_meet_its_tolerance(kind: Kind, drive: str, name: str, where: str) -> None:
    plant = kind.start(drive, inputs={name: 1e200})
    match = rf"in the step from t = 0 s: .*, at crank angle 0 rad .* and {where}"
    assert_refused(plant, IntegrationError, match, 0.0, 1.0)


@pytest.mark.parametrize(("sine", "error"), [(0.03, AssemblyError), (0.1, IntegrationError)])
def test_an_integration_that_fails_near_the_limit_fails_for_it(
    sine: float, error: type[LinkworkError], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*arguments: Any, **options: Any) -> None:
        raise IntegrationError("the step size fell")

    # coupler and rocker of 0.15 m, nearly stretched out, and the angle between them
    stretch = 0.3 * cos(0.5 * asin(sine))
    p = TABLE_3_1
    plant = Plant(FIVE_BAR.mechanism, p, InitialState(slider_position=stretch - p.ground_length + p.crank_length))
    monkeypatch.setattr("linkwork.plant.integrate", fails)
    with pytest.raises(LinkworkError, match="limit of assembly near" if sine < 0.05 else "step size fell") as caught:
        plant.step(0.0, 1e-3)
    assert type(caught.value) is error


def falling(**options: Any) -> Plant:
    """Without spring and nearly without damper the slider drifts to the limit of assembly within four turns."""
    loose = replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=1e4 * DYN_S_PER_CM)
    return speed_plant(parameters=loose, **options)


@EVERY_KIND
def test_refused_step_leaves_newly_commanded_speeds_waiting(kind: Kind) -> None:
    plants = [falling() if kind is FIVE_BAR else default(inputs={"axial.speed": 0.5}) for _ in range(2)]
    speeds = (0.9 * plants[0].inputs["drive.speed"], 1.0)[: len(kind.commands)]
    for plant in plants:
        go(plant, 10, 1e-3)
        for name, speed in zip(kind.commands, speeds):
            plant.set_input(name, speed)
    assert_refused(plants[0], AssemblyError, "limit of assembly", plants[0].time, 10.0)
    for plant in plants:
        plant.step(plant.time, 1e-3)
        assert plant.state[2 : 2 + len(speeds)] == pytest.approx(speeds, rel=1e-14)
    assert plants[0].state == plants[1].state


@EVERY_KIND
def test_a_speed_too_large_for_finite_outputs_is_reported(kind: Kind) -> None:
    for name in kind.commands:
        plant = kind.start(kind.speeds)
        plant.set_input(name, 1e200)
        with pytest.raises(InputError, match=rf"an output is not finite .*{name} is 1e\+200"):
            plant.outputs()


def test_steps_late_in_a_long_run_are_taken_for_what_they_are() -> None:
    plant = FIVE_BAR.new(TABLE_3_1, InitialState(), time=1e6)
    for k in range(5):
        plant.step(1e6 + k * 1e-6, 1e-6)
    with pytest.raises(StepError, match="backwards"):
        plant.step(1e6 + 3e-6, 1e-6)


def to_the_limit(plant: Plant, step: float) -> None:
    """Steps until one is refused, which is refused again when asked again, and the last good state kept."""
    with pytest.raises(AssemblyError):
        go(plant, 1000, step)
    message = rf"^in the step from t = {plant.time:.9g} s: limit of assembly .*crank angle .* (slider position|shift) "
    assert_refused(plant, AssemblyError, message, plant.time, step)
    assert all(map(isfinite, plant.outputs()))


def test_limit_of_assembly_is_refused_and_the_last_good_state_kept() -> None:
    plant = falling()
    to_the_limit(plant, TURN / 100)
    assert 3.0 < plant.time / TURN < 5.0  # beyond where sin(th4 - th3) passes 0.3


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("drive", ["speed-shift", "torque-shift"])
def test_shift_out_of_the_rods_reach_is_refused_and_the_last_good_state_kept(drive: str, sign: float) -> None:
    plant = default(drive, inputs={"axial.speed": 2.0 * sign})
    to_the_limit(plant, 1e-2)
    time, o = plant.time, plant.outputs()
    assert 0.0 < o.assembly_margin < 0.02
    if drive == "speed-shift":
        # the last step that is still inside: |(a1 c + a4, S1)| reaches a2 within the next
        def reach(t: float) -> float:
            return hypot(CRANK_IN * cos(CRANK_SPEED * t) + 10.0, 3.5 + sign * 2.0 * t / INCH)

        assert reach(time) < ROD_IN < reach(time + 1e-2)
    # a shorter step that stays inside is taken, and so is one back
    plant.step(plant.time, 1e-5)
    plant.set_input("axial.speed", -2.0 * sign)
    plant.set_input("drive.speed", -CRANK_SPEED)
    if drive == "speed-shift":
        go(plant, 10, 1e-2)
        assert plant.outputs().assembly_margin > o.assembly_margin


@pytest.mark.parametrize("drive", ["torque-force", "speed-force", "torque-groove", "speed-groove"])
def test_other_ways_out_of_the_rods_reach(drive: str) -> None:
    # a groove too deep for the rod, or a force that pushes the crank off
    deep, start = replace(OFFSET_CASE[0], groove_amplitude=3.0), SliderCrankStart(crank_speed=CRANK_SPEED)
    plant = default(drive, parameters=deep, initial=start, inputs={"axial.force": 1e4})
    assert_refused(plant, AssemblyError, r"step from t = 0 s: limit of assembly .* shift", plant.time, 1.0)
    plant.step(0.0, 1e-3)


# ------------------------------------------------------------------ how a run begins


@pytest.mark.parametrize("mode", [3, -1, 1.5, "groove", None])
def test_modes_are_one_of_those_listed(mode: Any) -> None:
    with pytest.raises(ParameterError, match=r"drive\.mode is .* be 0 \(torque\) or 1 \(speed\)"):
        SLIDER_CRANK.new(*OFFSET_CASE, drive_mode=mode)
    with pytest.raises(ParameterError, match=r"axial\.mode is .* be 0 \(force\), 1 \(speed\) or 2 \(groove\)"):
        SLIDER_CRANK.new(*OFFSET_CASE, axial_mode=mode)


@pytest.mark.parametrize("tolerance", [0.0, -1e-6, 0.1, 1e-16, nan, inf])
def test_tolerance_out_of_range(tolerance: float) -> None:
    refused(ParameterError, r"solver\.tolerance is .* between 1e-13 and 0\.01$", check_tolerance, tolerance)
    refused(ParameterError, r"solver\.tolerance", FIVE_BAR.new, TABLE_3_1, InitialState(), tolerance=tolerance)


def test_a_start_time_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InputError, match="time at the start"):
        FIVE_BAR.new(TABLE_3_1, InitialState(), time=nan)


@pytest.mark.parametrize(
    ("kind", "name"), [(FIVE_BAR, "load.fx"), (SLIDER_CRANK, "axial.speed")], ids=["five-bar", "slider-crank"]
)
def test_start_with_inputs_that_are_not_usable(kind: Kind, name: str) -> None:
    refused(InputError, rf"input {name} is nan at t = 0 s", kind.start, kind.speeds, inputs={name: nan})
    refused(InputError, "there is no input 'load'", kind.start, kind.speeds, inputs={"load": 1.0})


@pytest.mark.parametrize(
    ("kind", "drive", "options", "names"),
    [
        (FIVE_BAR, "torque", {"initial": InitialState(slider_velocity=1e180)}, r"slider_velocity is 1e\+180"),
        (FIVE_BAR, "speed", {"inputs": {"drive.speed": 1e300}}, r"drive\.speed is 1e\+300"),
        (SLIDER_CRANK, "torque-force", {"initial": SliderCrankStart(crank_speed=1e180)}, r"speed is 1e\+180 rad/s"),
        (SLIDER_CRANK, "torque-force", {"initial": SliderCrankStart(shift_velocity=1e180)}, r"velocity is 1e\+180"),
        (SLIDER_CRANK, "speed-shift", {"inputs": {"drive.speed": 1e300}}, r"drive\.speed is 1e\+300 rad/s"),
        (SLIDER_CRANK, "speed-shift", {"inputs": {"axial.speed": 1e300}}, r"axial\.speed is 1e\+300 m/s"),
        (SLIDER_CRANK, "speed-groove", {"inputs": {"drive.speed": 1e300}}, r"drive\.speed is 1e\+300 rad/s"),
    ],
)
def test_start_with_a_kinetic_energy_that_overflows(
    kind: Kind, drive: str, options: dict[str, Any], names: str
) -> None:
    with pytest.raises(InputError, match=rf"energy at the start is not finite: .*{names}"):
        kind.start(drive, **options)


def test_speed_drive_starts_at_the_commanded_speed() -> None:
    plant = speed_plant(initial=InitialState(crank_speed=1.0, slider_velocity=0.25), time=2.0)
    assert plant.state == (0.0, 0.0, W, 0.25, 0.0, 0.0)
    assert plant.time == 2.0
    assert plant.outputs().energy_residual == 0.0
    plant.step(2.0, 1e-3)
    assert plant.time == pytest.approx(2.001)


@pytest.mark.parametrize("drive", DRIVES)
def test_commanded_speeds_and_groove_take_the_place_of_the_initial_state(drive: str) -> None:
    speed_drive, shift_drive, groove = DRIVES[drive]
    given = SliderCrankStart(crank_angle=0.4, crank_speed=1.0, shift_position=0.05, shift_velocity=0.25)
    law = replace(OFFSET_CASE[0], groove_amplitude=0.07, groove_ratio=1.5)
    plant = default(drive, parameters=law, initial=given, time=2.0, inputs={"axial.speed": -0.1})
    o = plant.outputs()
    speed = CRANK_SPEED if speed_drive else 1.0
    assert o.crank_angle == 0.4
    assert o.crank_speed == speed
    if groove:
        assert o.shift_position == 0.07 * sin(1.5 * 0.4)
        assert o.shift_velocity == pytest.approx(0.07 * 1.5 * cos(0.6) * speed, rel=1e-14)
    else:
        assert o.shift_position == 0.05
        assert o.shift_velocity == (-0.1 if shift_drive else 0.25)
    assert o.energy_residual == o.energy_supplied == o.energy_dissipated == 0.0
    assert plant.time == 2.0
    plant.step(2.0, 1e-3)
    assert plant.time == pytest.approx(2.001)


def test_start_at_the_limit_of_assembly() -> None:
    # BD = l1 + u - l2 at crank angle 0; 30 cm is stretched out
    stretched, p = 0.30 - 0.1535 + 0.05, TABLE_3_1.constants()
    with pytest.raises(AssemblyError, match=r"limit of assembly .* collinear to 0\.009 deg"):
        check_assembly(0.0, stretched - 1e-9, p)
    # at the limit the sine is 1e-3: it is about 2 sqrt(2 x / 0.3) for BD short of stretched by x
    assert LIMIT_SINE == 1e-3
    inside = 0.3 / 8 * 1e-3**2
    check_assembly(0.0, stretched - 1.05 * inside, p)
    with pytest.raises(AssemblyError):
        check_assembly(0.0, stretched - 0.95 * inside, p)


def test_start_out_of_the_rods_reach_says_by_how_much() -> None:
    with pytest.raises(AssemblyError) as caught:
        default(initial=SliderCrankStart(crank_angle=pi / 3, shift_position=1.5))
    # at 270 deg the crank pin is (a1 c + a4, S1) from the guide
    distance = hypot((6.0 + 10.0) * INCH, 1.5)
    text = str(caught.value)
    assert text.startswith("the rod does not reach the guide at crank angle 1.04719755 rad (60.0000 deg) and shift ")
    assert f"the crank pin is {distance:.9g} m from the guide" in text
    assert f"the rod is 1.27 m long, {distance - 1.27:.9g} m too short" in text


def test_start_in_a_groove_too_deep_says_by_how_much() -> None:
    deep = replace(OFFSET_CASE[0], groove_amplitude=1.4, groove_ratio=3.0)
    with pytest.raises(AssemblyError, match=r"rad \(30\.0000 deg\) and shift position 1\.4 m: .* too short"):
        default("speed-groove", parameters=deep, initial=SliderCrankStart(crank_angle=pi / 6))
    # the shift that is given is not the one that counts
    default("speed-groove", initial=SliderCrankStart(shift_position=5.0))


@pytest.mark.parametrize("offset", GREATEST_SHIFTS_IN)
def test_start_at_the_limit_of_the_rods_reach(offset: float) -> None:
    mechanism = parameters(offset)

    def start(shift: float) -> Plant:
        return default(parameters=mechanism, initial=SliderCrankStart(shift_position=shift))

    stretched = sqrt(ROD_IN**2 - (CRANK_IN + offset) ** 2)
    assert stretched == pytest.approx(GREATEST_SHIFTS_IN[offset], abs=6e-4)
    off = degrees(asin(sqrt(stretched**2 - (stretched - 1e-6) ** 2) / ROD_IN))
    with pytest.raises(AssemblyError, match=rf"limit of assembly at crank angle 0 rad .* within {off:.3f} deg"):
        start((stretched - 1e-6) * INCH)
    # the sine at which it counts as the limit is h / a2, with h^2 = stretched^2 - S1^2
    inside = (LIMIT_SINE * ROD_IN) ** 2 / (2.0 * stretched)
    start((stretched - 1.05 * inside) * INCH)
    refused(AssemblyError, "limit of assembly", start, (stretched - 0.95 * inside) * INCH)
    refused(AssemblyError, "does not reach", start, (stretched + 1e-6) * INCH)


# ------------------------------------------------------------------ saving and taking up again


@EVERY_DRIVE
def test_run_taken_up_from_json_goes_on_bit_by_bit(kind: Kind, drive: str) -> None:
    plant = kind.of_seed(5, drive)
    go(plant, 13, 1.1e-3)
    plant.set_input(kind.input_names[-1], 3.0)
    for name in kind.commands:
        plant.set_input(name, plant.inputs[name] + 0.1)  # commanded, not yet in force
    other = kind.restore(json.loads(json.dumps(plant.save())))
    assert other.outputs() == plant.outputs()
    for n in range(25):
        time = plant.time
        for p in (plant, other):
            if n == 10:
                p.set_input(kind.force, -2.0)
                p.set_input(kind.commands[-1], 0.0)
            p.step(time, 0.7e-3)
        assert (other.state, other.time) == (plant.state, plant.time)
    assert other.outputs() == plant.outputs()
    assert other.save() == plant.save()


@EVERY_KIND
def test_saved_state_is_a_copy(kind: Kind) -> None:
    plant = running(kind)
    saved = plant.save()
    text = json.dumps(saved)
    plant.set_input("drive.torque", 1.0)
    go(plant, 3, 1e-3)
    assert json.dumps(saved) == text


#: Damage to a saved state: of any plant, and of one that is driven in its own ways.
DAMAGE: dict[str, list[tuple[str, Any]]] = {
    "any": [
        ("state", [0.0, 0.0]),
        ("state", [0.0] * 5),
        ("state", ["a"] * 6),
        ("state", [nan] * 6),
        ("tolerance", nan),
        ("time", "x"),
        ("time", inf),
        ("step_size", "x"),
        ("start_energy", None),
        ("start_energy", inf),
        ("scale", None),
        ("scale", [0.0] * 6),
        ("scale", [1.0] * 5),
        ("inputs", {}),
        ("inputs", dict.fromkeys(("drive.torque",), 0.0)),
        ("parameters", {}),
        ("parameters", {"crank_length": 1.0}),
        ("modes", {}),
        ("commanded", "no"),
        ("commanded", ["drive.torque"]),
    ],
    "five-bar": [
        ("parameters", {**running(FIVE_BAR).save()["parameters"], "crank_length": -1.0}),
        ("modes", {"drive.mode": 7}),
    ],
    "slider-crank": [
        ("modes", {"drive.mode": 1}),
        ("modes", {"drive.mode": 1, "axial.mode": 3}),
        ("modes", {"drive.mode": 2, "axial.mode": 1}),
        ("commanded", ["slider.speed"]),
        ("inputs", dict.fromkeys(SLIDER_CRANK.input_names[:-1], 0.0)),
        ("inputs", dict.fromkeys(SLIDER_CRANK.input_names, "x")),
    ],
}


@EVERY_KIND
def test_a_damaged_saved_state_is_refused(kind: Kind) -> None:
    saved = running(kind).save()
    assert kind.restore(dict(saved)).save() == saved
    damaged = [{**saved, key: value} for key, value in DAMAGE["any"] + DAMAGE[kind.name]]
    lacking = [{name: saved[name] for name in saved if name != key} for key in saved]
    for state in damaged + lacking:
        with pytest.raises(StateError, match=f"the saved state is not one of a {kind.name}"):
            kind.restore(state)


def test_a_saved_state_of_another_mechanism_is_refused() -> None:
    for kind, other in ((FIVE_BAR, SLIDER_CRANK), (SLIDER_CRANK, FIVE_BAR)):
        with pytest.raises(StateError, match=f"the saved state is not one of a {kind.name}"):
            kind.restore(running(other).save())


# ------------------------------------------------------------------ the theses' numbers, and the groove


def test_step_goes_where_the_known_numbers_say() -> None:
    plant = speed_plant(tolerance=1e-11)
    step = TURN / 360
    for n in range(1080):
        plant.step(n * step, step)
        if n + 1 in published.U_CM_AT_CRANK_DEG:
            assert plant.state[0] == pytest.approx(radians(n + 1), abs=1e-12)
            assert plant.outputs().slider_position / CM == pytest.approx(published.U_CM_AT_CRANK_DEG[n + 1], abs=1e-8)
    assert plant.time == pytest.approx(3 * TURN, rel=1e-14)
    assert abs(plant.outputs().energy_residual) < 1e-9
    assert plant.outputs().closure_residual < 1e-15


@pytest.mark.parametrize("spot", SPOTS, ids=["offset and shift", "offset and twist"])
def test_slider_crank_goes_where_the_known_numbers_say(spot: Spot) -> None:
    start = SliderCrankStart(shift_position=spot.shift_in * INCH)
    plant = default(parameters=parameters(spot.offset_in, spot.twist_deg), initial=start)
    go(plant, 10, 1.2 / 120)
    o = plant.outputs()
    assert o.crank_angle == pytest.approx(radians(30.0), rel=1e-12)
    assert o.slider_position / INCH == pytest.approx(spot.position_in, abs=6e-7)
    assert o.slider_velocity / INCH == pytest.approx(spot.velocity_in_s, abs=6e-7)
    assert o.slider_acceleration / INCH == pytest.approx(spot.acceleration_in_s2, abs=6e-6)


@pytest.mark.parametrize("drive", ["torque-groove", "speed-groove"])
def test_groove_makes_the_shift_at_all_times(drive: str) -> None:
    case = slider_cranks.seeded(2)
    law, p = case.parameters, case.p
    plant = SLIDER_CRANK.of_seed(2, drive, tolerance=1e-6)
    for n in range(40):
        plant.set_input("drive.speed", case.state[2] * (1.0 + 0.3 * sin(0.5 * n)))
        plant.set_input("drive.torque", case.torque * cos(n))
        o = plant.outputs()
        # eq 28, exactly, however loose the tolerance
        assert o.shift_position == law.groove_amplitude * sin(law.groove_ratio * o.crank_angle)
        slope = law.groove_amplitude * law.groove_ratio * cos(law.groove_ratio * o.crank_angle)
        assert o.shift_velocity == pytest.approx(slope * o.crank_speed, rel=1e-13, abs=1e-15)
        plant.step(plant.time, 2e-3)
        # what is supplied is the work of shaft and load: the groove's force has no power of its own
        o = plant.outputs()
        inputs = case.read(drive)._replace(torque=0.0 if drive.startswith("speed") else plant.inputs["drive.torque"])
        power = dynamics.derivative(plant.state, inputs, p)[5]  # type: ignore[arg-type]
        given = o.drive_applied_torque * o.crank_speed + case.load * o.slider_velocity
        assert power == pytest.approx(given, rel=1e-9, abs=1e-9)
        assert o.axial_applied_force != 0.0
    assert abs(plant.outputs().energy_residual) < 1e-3 * plant.outputs().energy_kinetic
