"""Runs of the native FMUs call by call: what is refused and in which words, saved states, events, intermediate updates."""

import ctypes
import json
import math
import re
import struct
import sys
from collections.abc import Callable, Iterator
from ctypes import byref, c_bool, c_char, c_double, c_int, c_size_t, c_uint32, c_void_p
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from build_fmu import FMUS
from linkwork.errors import AssemblyError
from linkwork.five_bar import MECHANISM as FIVE_BAR
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import TABLE_3_1
from linkwork.limits import JAMMING, LIMIT_SINE, NO_ACCELERATION
from linkwork.parameters import TOO_LARGE, TOO_SMALL
from linkwork.plant import Plant
from tests.scripts import called

from .native import DISCARD, ERROR, OK, WARNING, Instance, Library

Law = Callable[[float], float]

#: A force that ends in the limit of assembly within a tenth of a second, by the model; modes that leave both freedoms free.
TOO_MUCH = {
    "FiveBarSlider": ("slider__force", {"drive__mode": 0}),
    "SliderCrank": ("axial__force", {"drive__mode": 0, "axial__mode": 0}),
}
FILES = ["FiveBarSlider-native", "FiveBarSlider-native-fmi3", "SliderCrank-native", "SliderCrank-native-fmi3"]


@pytest.fixture(scope="module")
def libraries(natives: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Library]:
    return {name: Library(natives[name], tmp_path_factory.mktemp("library")) for name in FILES}


@pytest.fixture(params=FILES)
def library(request: pytest.FixtureRequest, libraries: dict[str, Library]) -> Library:
    return libraries[request.param]


@pytest.fixture(params=FILES[:2])
def five_bar(request: pytest.FixtureRequest, libraries: dict[str, Library]) -> Library:
    return libraries[request.param]


@pytest.fixture
def fmi3(libraries: dict[str, Library]) -> Library:
    return libraries["FiveBarSlider-native-fmi3"]


def model(library: Library) -> str:
    return library.path.name.partition("_")[0]


def refused(c: Instance, time: float, step: float, status: int, said: str) -> None:
    """A step is discarded; `solver.status` and the sentence tell why."""
    assert c.step(time, step) == DISCARD
    assert c.status() == status
    assert said in c.text()


# Initialisation


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"crank__length": -1.0}, "parameter crank.length is -1: it must be a finite number greater than zero"),
        ({"crank__mass": -0.5}, "parameter crank.mass is -0.5: it must be a finite number, zero or greater"),
        ({"gravity": math.nan}, "parameter gravity is nan: it must be a finite number, zero or greater"),
        ({"initial__crank_angle": math.inf}, "parameter initial.crank_angle is inf: it must be a finite number"),
        ({"solver__tolerance": 0.1}, "parameter solver.tolerance is 0.1: it must be between 1e-13 and 0.01"),
        ({"assembly__branch": 2}, "parameter assembly.branch is 2: it must be +1 or -1, the sign of"),
        ({"drive__mode": 2}, "parameter drive.mode is 2: it must be 0 (torque) or 1 (speed)"),
        ({"drive__mode": -1}, "parameter drive.mode is -1: it must be 0 (torque) or 1 (speed)"),
        ({"crank__mass": 1.0, "crank__cog_distance": 0.5}, "at least crank.mass * crank.cog_distance^2 = 0.25"),
        ({"rocker__mass": 0.0, "slider__mass": 0.0}, "slider.mass is 0: it must be greater than zero where rocker"),
        ({"crank__mass": 1e308}, f"parameter crank.mass is 1e+308: it must {TOO_LARGE}"),
        ({"slider__guide_angle": -1e76}, f"parameter slider.guide_angle is -1e+76: it must {TOO_LARGE}"),
        ({"coupler__length": 5e-324}, f"parameter coupler.length is 4.94065646e-324: it must {TOO_SMALL}"),
        ({"crank__inertia": 9e-76}, f"parameter crank.inertia is 9e-76: it must {TOO_SMALL}"),
        # coupler and rocker of 0.3 m stretched out, less 2e-8 m
        ({"crank__length": 0.05, "ground__length": 0.35 - 2e-8}, "limit of assembly at crank angle 0 rad"),
        ({"crank__length": 9.0}, "the links cannot be joined at crank angle 0 rad (0.0000 deg) and slider position 0"),
        ({"initial__slider_velocity": 1e200}, "the energy at the start is not finite: crank angle 0 rad"),
        ({"initial__slider_velocity": 5e153}, f"rad (0.0000 deg) and slider position 0 m: {NO_ACCELERATION}"),
        ({"drive__speed": math.nan}, "input drive.speed is nan at t = 0 s: it must be a finite number"),
        (
            {"slider__force": 1e300, "drive__mode": 0, "drive__torque": 1e308},
            "finite at t = 0 s: input drive.torque is",
        ),
        (
            {"slider__force": 1e308, "drive__mode": 0, "drive__torque": 1e300},
            "finite at t = 0 s: input slider.force is",
        ),
    ],
)
def test_what_the_initialisation_refuses(five_bar: Library, values: dict[str, float], sentence: str) -> None:
    c = five_bar.instance()
    c.set(**values)
    c.enter()
    assert c("ExitInitializationMode") == ERROR
    ((status, logged),) = c.log
    assert status == ERROR
    assert sentence in logged
    # for who has no log
    assert c.text() == logged
    assert c.status() in (2, 3, 6)
    # the values can be mended, and the instance goes on
    good = five_bar.instance()
    assert c("Reset") == OK
    c.start()
    good.start()
    assert c.get("crank.acceleration", "pin.C.fx") == good.get("crank.acceleration", "pin.C.fx")
    assert c.step(0.0, 1e-3) == OK


@pytest.mark.parametrize("values", [{"crank_length": 0.5}, {"crank_length": 0.05, "ground_length": 0.35 - 2e-8}])
def test_links_that_cannot_be_joined_are_told_as_in_python(five_bar: Library, values: dict[str, float]) -> None:
    """The gap and the span, or the angle from the limit of assembly."""
    c = five_bar.instance()
    c.set(**{name.replace("_", "__"): value for name, value in values.items()})
    c.enter()
    assert c("ExitInitializationMode") == ERROR
    with pytest.raises(AssemblyError) as told:
        Plant(FIVE_BAR, replace(TABLE_3_1, **values), InitialState())
    assert c.text() == str(told.value)
    assert re.search(r"apart, coupler and rocker span|collinear to 0\.\d+ deg", c.text())


def test_outputs_in_initialisation_mode_follow_what_is_set(library: Library) -> None:
    c = library.instance()
    assert c.enter() == OK
    at_rest = c.get("crank.angle")
    c.set(initial__crank_angle=0.25)
    assert at_rest == [0.0]
    assert c.get("crank.angle") == [0.25]
    # a bad value: the read is good, the outputs stay, the status says why
    c.set(crank__length=-1.0)
    assert c.get("crank.angle") == [0.25]
    assert c.status() == 6
    assert "crank.length" in c.text()
    c.set(crank__length=0.05)
    assert c("ExitInitializationMode") == OK
    assert (c.status(), c.text()) == (0, "")


def test_time_starts_where_the_master_says(library: Library) -> None:
    c = library.instance()
    assert c.enter(start=2.5, tolerance=1e-11) == OK
    assert c("ExitInitializationMode") == OK
    assert c.get("time") == [2.5]
    assert c.step(2.5, 1e-3) == OK
    assert c.get("time") == [2.501]


def test_the_tighter_of_both_tolerances_holds(library: Library) -> None:
    def after(own: float, master: float | None) -> list[float]:
        c = library.instance()
        c.set(solver__tolerance=own)
        c.enter(tolerance=master)
        assert c("ExitInitializationMode") == OK
        assert c.step(0.0, 0.1) == OK
        return c.get("slider.position", "energy.supplied")

    assert after(1e-6, 1e-11) == after(1e-11, None) == after(1e-11, 1e-6)
    assert after(1e-6, 1e-11) != after(1e-6, None)
    assert after(1e-13, None) == after(1e-2, 1e-30)


# Steps


@pytest.mark.parametrize(
    ("time", "step", "sentence"),
    [
        (0.0, 0.0, "a step of 0 s at t = 0 s: it must be greater than zero"),
        (0.0, -1.0, "a step of -1 s at t = 0 s: it must be greater than zero"),
        (0.0, math.nan, "a step of nan s from t = 0 s: both must be finite numbers"),
        (math.inf, 1.0, "a step of 1 s from t = inf s: both must be finite numbers"),
        (0.5, 1e-20, "a step of 1e-20 s at t = 0.5 s: it is lost in the rounding of the time"),
        (0.5, 1e-3, "a step over a gap: it starts at t = 0.5 s, but the state is at t = 0 s"),
        (-0.5, 1e-3, "a step backwards: it starts at t = -0.5 s, but the state is at t = 0 s"),
    ],
)
def test_steps_out_of_order(library: Library, time: float, step: float, sentence: str) -> None:
    c, other = library.instance().start(), library.instance().start()
    assert c.step(time, step) == DISCARD
    assert (c.status(), c.text()) == (1, sentence)
    for instance in (c, other):
        assert instance.step(0.0, 1e-3) == OK
    assert (c.status(), c.text()) == (0, "")
    assert c.get("crank.angle", "energy.residual") == other.get("crank.angle", "energy.residual")


def test_an_input_that_is_not_finite(library: Library) -> None:
    c = library.instance().start()
    before = c.get("drive.applied_torque")
    c.set(drive__torque=math.inf)
    assert c.get("drive.applied_torque") == before
    refused(c, 0.0, 1e-3, 2, "input drive.torque is inf at t = 0 s: it must be a finite number")
    if library.fmi == 2:  # FMPy would otherwise repeat the step for ever
        flag = c_int()
        assert (c("GetBooleanStatus", 3, byref(flag)), flag.value) == (OK, 1)
    # the first cause stays
    refused(c, 1e-3, 1e-3, 2, "; before that, input drive.torque is inf")
    assert c.text().startswith("a step over a gap")
    c.set(drive__torque=0.0)
    assert c.step(0.0, 1e-3) == OK


def to_the_limit(library: Library, **options: Any) -> Instance:
    force, modes = TOO_MUCH[model(library)]
    c = library.instance(**options).start(**modes)
    c.set(**{force: 1e5})
    return c


def test_the_limit_of_assembly_refuses_a_step(library: Library) -> None:
    c = to_the_limit(library)
    before = c.get("crank.angle", "energy.kinetic")
    refused(c, 0.0, 0.1, 3, "limit of assembly")
    assert c.get("crank.angle", "energy.kinetic", "time") == [*before, 0.0]
    if library.fmi == 2:
        number, state, flag = c_double(), c_int(), c_int()
        assert c("GetRealStatus", 2, byref(number)) == OK
        assert c("GetStatus", 0, byref(state)) == OK
        assert c("GetBooleanStatus", 3, byref(flag)) == OK
        assert (number.value, state.value, flag.value) == (0.0, DISCARD, 1)
        for kind in (0, 1):
            sentence = ctypes.c_char_p()
            assert c("GetStringStatus", kind, byref(sentence)) == OK
            assert (sentence.value or b"").decode() == c.text()
        for name in ("GetStatus", "GetRealStatus", "GetBooleanStatus", "GetStringStatus", "GetIntegerStatus"):
            assert c(name, 17, byref(c_double())) == ERROR
            assert "no status of kind 17" in c.log[-1][1]
    # the run goes on with another force
    c.set(**{TOO_MUCH[model(library)][0]: 0.0})
    assert c.step(0.0, 1e-3) == OK


def test_a_step_ends_early_at_the_limit(libraries: dict[str, Library]) -> None:
    for name in FILES[1::2]:
        library = libraries[name]
        c = to_the_limit(library, early=True)
        assert c.step(0.0, 0.1) == OK
        assert (c.early, c.terminate, c.event) == (True, True, False)
        assert 0.0 < c.reached.value < 0.1
        assert c.get("time") == [c.reached.value]
        assert (c.status(), c.text()) == (3, "the step ended early, at the limit of assembly")
        (margin,) = c.get("assembly.margin_to_limit")
        assert 0.0 <= margin < 1e-6
        assert abs(c.get("energy.residual")[0]) < 1e-6 * c.get("energy.kinetic")[0]
        # nothing is left of the way
        reached = c.reached.value
        for _ in range(100):
            if c.step(c.reached.value, 1e-3) == DISCARD:
                break
            assert c.terminate
        assert (c.status(), c.early, c.terminate) == (3, False, False)
        assert c.reached.value - reached < 1e-6


#: A start from which friction comes near to jamming the links within a turn and a half.
TOO_ROUGH = {"slider__friction_coefficient": 4.0, "drive__speed": 10.0 * math.pi}


def rough(clearance: float, mode: int) -> dict[str, float]:
    """Start of a five-bar, its slider in motion, with so much friction in the guide that it has this clearance from jamming."""
    initial, p = InitialState(crank_speed=40.0, slider_velocity=0.1), TABLE_3_1.constants()
    x, acting = FIVE_BAR.state(initial), FIVE_BAR.equations.apply_inputs((float(mode),), (0.0,) * 6, p)
    low, high = 0.0, 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        enough = FIVE_BAR.equations.clearance(x, acting, p._replace(mug=middle, rough=1.0)) > clearance
        low, high = (middle, high) if enough else (low, middle)
    start = {"initial__slider_velocity": 0.1, "initial__crank_speed": 40.0, "drive__speed": 40.0, "drive__mode": mode}
    return start | {"slider__friction_coefficient": low}


def test_friction_that_may_jam_the_links_is_refused(five_bar: Library) -> None:
    # at the start; in a step; next to the limit, where a step fails for another reason
    c = five_bar.instance()
    c.set(**rough(-0.1, 1))
    assert c.enter() == OK
    assert c("ExitInitializationMode") == ERROR
    assert c.status() == 3
    assert c.text().startswith(f"{JAMMING} at crank angle 0 rad (0.0000 deg) and slider position 0 m")
    c = five_bar.instance().start(**TOO_ROUGH)
    before = c.get("slider.guide_force", "assembly.margin_to_limit")
    refused(c, 0.0, 0.3, 3, f"in the step from t = 0 s: {JAMMING} at crank angle ")
    assert c.get("slider.guide_force", "assembly.margin_to_limit") == before
    c = five_bar.instance().start(**rough(0.01, 0))
    c.set(drive__torque=1e200)
    refused(c, 0.0, 1.0, 3, f"in the step from t = 0 s: {JAMMING} near crank angle ")


def test_a_step_ends_early_where_friction_may_jam_the_links(fmi3: Library) -> None:
    c = fmi3.instance(early=True).start(**TOO_ROUGH)
    assert c.step(0.0, 0.3) == OK
    assert 0.0 <= c.get("assembly.margin_to_limit")[0] < 1e-6
    assert (c.early, c.terminate, c.status()) == (True, True, 3)
    assert c.text() == f"the step ended early: {JAMMING}"


def test_model_exchange_to_where_friction_may_jam_the_links(five_bar: Library) -> None:
    values = rough(-0.1, 1)
    c = five_bar.instance("me").continuous(**values | {"initial__slider_velocity": 0.0})
    assert c.get("assembly.margin_to_limit")[0] > 0.0
    x = c.states()
    assert c.put_states(*x[:3], 0.1, *x[4:]) == OK
    assert c.get("assembly.margin_to_limit")[0] == pytest.approx(-0.1 - LIMIT_SINE, abs=1e-12)
    assert c("EnterEventMode") == OK
    assert c.discrete()[0]
    assert (c.status(), c.text()) == (3, f"the motion has ended: {JAMMING}")


def test_steps_that_cannot_meet_the_tolerance(five_bar: Library) -> None:
    c = five_bar.instance().start(drive__mode=0)
    c.set(drive__torque=1e200)
    refused(c, 0.0, 1.0, 4, "in the step from t = 0 s: the step size fell to")
    assert ", at crank angle 0 rad (0.0000 deg) and slider position 0 m" in c.text()
    # accelerations that are not finite from the beginning
    c = five_bar.instance().start(drive__mode=0)
    c.set(drive__torque=1e308, slider__force=1e308)
    refused(c, 0.0, 1.0, 4, "the accelerations are not finite")
    # more steps than there may be
    c = five_bar.instance().start(slider__stiffness=1e12, slider__damping=0.0)
    refused(c, 0.0, 10.0, 4, "20000 steps did not suffice: stopped")


def test_an_early_return_is_for_the_limit_alone(fmi3: Library) -> None:
    c = fmi3.instance(early=True).start(drive__mode=0)
    c.set(drive__torque=1e200)
    assert c.step(0.0, 1.0) == DISCARD
    assert (c.status(), c.early, c.reached.value) == (4, False, 0.0)


def test_every_way_into_the_limit_is_refused_or_ends_early(libraries: dict[str, Library]) -> None:
    """Loose steps come upon the limit by an accepted step or by shrinking steps; none passes to where no links are joined."""
    words = set()
    for name in FILES[1::2]:
        force, modes = TOO_MUCH[model(libraries[name])]
        for early in (False, True):
            for power in range(60):
                c = libraries[name].instance(early=early).start(**modes, solver__tolerance=1e-2)
                c.set(**{force: (-1.0) ** power * 10.0 ** (2.0 + power / 12.0)})
                time = 0.0
                for _ in range(40):
                    status = c.step(time, 0.01)
                    time += 0.01
                    if status != OK or c.early:
                        break
                else:
                    continue
                assert c.status() == 3, c.text()
                words.add(" ".join(c.text().partition("s: ")[2].split()[:4]))
                (margin,) = c.get("assembly.margin_to_limit")
                assert margin >= 0.0
    # a step so long that the least step of the integrator is too long near the limit
    for name in FILES[1::2]:
        force, modes = TOO_MUCH[model(libraries[name])]
        c = libraries[name].instance().start(**modes)
        c.set(**{force: 1e5})
        refused(c, 0.0, 1e8, 3, "limit of assembly")
        words.add(" ".join(c.text().partition("s: ")[2].split()[:4]))
    assert words - {""} == {"limit of assembly at", "limit of assembly near"}


def test_a_step_that_begins_a_micrometre_before_the_limit_is_refused(five_bar: Library) -> None:
    start = {"initial__crank_speed": 0.0, "initial__slider_position": 0.196499, "initial__slider_velocity": 1.0}
    c = five_bar.instance().start(drive__speed=0.0, **start)
    assert c.step(0.0, 0.01) == DISCARD
    assert (c.status(), *c.get("slider.position")) == (3, 0.196499)


def test_a_mechanism_at_rest_takes_any_step(five_bar: Library) -> None:
    rest = {"drive__speed": 0.0, "initial__crank_speed": 0.0, "gravity": 0.0}
    c = five_bar.instance().start(**rest)
    before = c.get("slider.position", "crank.angle")
    assert c.step(0.0, 3.0) == OK
    assert c.get("slider.position", "crank.angle") == before


def test_ten_thousand_steps_by_the_masters_own_sum(five_bar: Library) -> None:
    for times in ((k * 1e-4 for k in range(10_000)), summed(1e-4, 10_000)):
        c = five_bar.instance().start(solver__tolerance=1e-4)
        assert {c.step(time, 1e-4) for time in times} == {OK}


def summed(step: float, count: int) -> Iterator[float]:
    time = 0.0
    for _ in range(count):
        yield time
        time += step


def test_what_a_read_leaves_is_good_after_a_refused_step(fmi3: Library) -> None:
    reading = fmi3.instance(update=lambda c, *_: c.get("slider.acceleration"))
    c, other = reading.start(drive__mode=0), fmi3.instance().start(drive__mode=0)
    for instance in (c, other):
        instance.set(slider__force=1e9)
        assert instance.step(0.0, 0.1) == DISCARD
    assert c.get("slider.acceleration") == other.get("slider.acceleration")
    assert c.get("slider.acceleration")[0] > 1e8


def test_locals_that_cannot_be_computed_stay_the_last_good_ones(five_bar: Library) -> None:
    c = five_bar.instance().start(drive__mode=0)
    before = c.get("power.supplied", "power.dissipated")
    c.set(slider__force=math.nan)
    assert c.get("power.supplied", "power.dissipated") == before
    assert c.status() == 2


def test_the_status_of_the_last_step_is_not_that_of_a_read(libraries: dict[str, Library]) -> None:
    c = libraries["FiveBarSlider-native"].instance().start()
    assert c.step(0.0, 1e-3) == OK
    c.set(slider__force=math.nan)
    c.get("slider.acceleration")
    assert c.status() == 2
    state, ended = c_int(-1), c_int(-1)
    assert c("GetStatus", 0, byref(state)) == c("GetBooleanStatus", 3, byref(ended)) == OK
    assert (state.value, ended.value) == (OK, 0)


def test_the_status_of_a_mended_start_is_good(library: Library) -> None:
    for interface in ("cs", "me"):
        c = library.instance(interface)
        c.enter()
        c.set(crank__length=-1.0)
        c.get("crank.angle")
        assert c.status() == 6
        c.set(crank__length=0.05)
        c.get("crank.angle")
        assert (c.status(), c.text()) == (0, "")


TUNED = {"slider.stiffness": 5000.0, "slider.damping": 4.0, "slider.coulomb_friction": 0.5}


@pytest.mark.parametrize("name", TUNED)
def test_tunable_parameters_change_between_steps(library: Library, name: str) -> None:
    mechanism = FMUS[model(library)]
    plant = Plant.from_values(mechanism, {v.name: v.start for v in mechanism.variables})
    c = library.instance().start()
    for n in range(20):
        if n == 10:
            assert c.set(**{name.replace(".", "__"): TUNED[name]}) == OK
            assert c.get("energy.residual")[0] == pytest.approx(0.0, abs=1e-6)  # a spring does no work as it changes
            plant.tune({v.name: v.start for v in mechanism.variables} | {name: TUNED[name]})
        assert c.step(n * 5e-3, 5e-3) == OK
        plant.step(n * 5e-3, 5e-3)
    assert c.get(*mechanism.output_names) == pytest.approx(list(plant.outputs()), rel=1e-8, abs=1e-9)
    assert c.get("energy.residual")[0] == pytest.approx(0.0, abs=1e-6)
    # what is not valid is refused, and nothing changes
    assert c.set(**{name.replace(".", "__"): -1.0}) == ERROR
    assert f"parameter {name} is -1: it must be a finite number, zero or greater" in c.log[-1][1]
    assert c.get(name) == [TUNED[name]]
    assert c.step(0.1, 5e-3) == OK


def test_tunable_parameters_too_large_together(five_bar: Library) -> None:
    c = five_bar.instance().start()
    arrays = c.arrays(["pin.A_friction_radius", "pin.B_friction_radius"], (c_double * 2)(1.7e308, 1.7e308))
    assert c(c.real("Set"), *arrays) == ERROR
    assert "parameter pin.A_friction_radius is 1.7e+308: it must be small enough" in c.log[-1][1]
    assert c.step(0.0, 1e-3) == OK


# Inputs that move over a step, outputs that do


def slopes(c: Instance, names: list[str], values: Any, order: int = 1) -> int:
    """Input derivatives of FMI 2.0, or output derivatives of either version."""
    references, n, found, *rest = c.arrays(names, values)
    orders = (c_int * len(names))(*[order] * len(names))
    what = "GetRealOutputDerivatives" if c.library.fmi == 2 else "GetOutputDerivatives"
    return c(what, references, n, orders, found, *rest)


def test_what_moves(library: Library) -> None:
    c = library.instance().start()
    one, out = (c_double * 1)(1.0), (c_double * 1)()
    force = "slider.force" if model(library) == "FiveBarSlider" else "slider.load"
    if library.fmi == 2:

        def give(name: str, order: int, value: float) -> int:
            return c("SetRealInputDerivatives", *c.arrays([name], one)[:2], (c_int * 1)(order), (c_double * 1)(value))

        assert give("crank.angle", 1, 1.0) == ERROR
        assert give(force, 2, 1.0) == ERROR
        assert "derivative 2 of" in c.log[-1][1]
        assert give(force, 1, math.nan) == ERROR
        assert f"the derivative of {force} is nan" in c.log[-1][1]
        assert give("solver.status", 1, 1.0) == ERROR
        assert give(force, 1, 1000.0) == OK
    assert c.step(0.0, 0.01) == OK
    # in the place of the force that moved is where it has come to
    assert c.get(force) == [10.0 if library.fmi == 2 else 0.0]
    assert slopes(c, ["crank.angle"], out) == OK
    assert list(out) == c.get("crank.speed")
    assert slopes(c, ["time"], out) == OK
    assert list(out) == [1.0]
    assert slopes(c, [force], out) == ERROR
    assert slopes(c, ["crank.angle"], out, order=2) == ERROR
    assert "derivative 2 of crank.angle" in c.log[-1][1]
    assert slopes(c, ["solver.status"], out) == ERROR


def test_output_derivatives_that_are_not_finite(five_bar: Library) -> None:
    c = five_bar.instance().start(drive__mode=0)
    c.set(drive__torque=math.nan)
    assert slopes(c, ["crank.speed"], (c_double * 1)()) == DISCARD


def test_a_commanded_speed_that_moves(libraries: dict[str, Library]) -> None:
    # drive.speed with a slope is drive.acceleration
    library = libraries["FiveBarSlider-native"]
    moving, given = library.instance().start(), library.instance().start()
    references, n, _ = moving.arrays(["drive.speed"], None)
    assert moving("SetRealInputDerivatives", references, n, (c_int * 1)(1), (c_double * 1)(100.0)) == OK
    given.set(drive__acceleration=100.0)
    for c in (moving, given):
        assert c.step(0.0, 0.05) == OK
    names = ("crank.speed", "slider.position", "energy.supplied")
    assert moving.get(*names) == pytest.approx(given.get(*names), rel=1e-12)
    assert moving.get("drive.speed") == [43.982297150257104 + 5.0]


@pytest.mark.parametrize("moved", ["drive.speed", "drive.acceleration", "drive.torque", "slider.force"])
def test_derivatives_of_outputs_where_any_input_moved(libraries: dict[str, Library], moved: str) -> None:
    """Against the differences of the outputs at the end of two steps, under the inputs as they were there."""
    library = libraries["FiveBarSlider-native"]
    names = ["crank.angle", "crank.speed", "crank.acceleration", "slider.velocity", "slider.acceleration", "pin.C.fx"]
    slope, h, end = 50.0, 1e-6, 0.02

    def at(time: float) -> Instance:
        c = library.instance().start(drive__mode=int(moved == "drive.torque") ^ 1)
        references, n, _ = c.arrays([moved], None)
        assert c("SetRealInputDerivatives", references, n, (c_int * 1)(1), (c_double * 1)(slope)) == OK
        assert c.step(0.0, time) == OK
        return c

    def values(time: float) -> list[float]:
        c = at(time)
        if moved == "drive.speed":  # which was an acceleration
            (speed,) = c.get("crank.speed")
            c.set(drive__acceleration=slope)
            assert c.get("crank.speed") == [speed]
        return c.get(*names)

    c = at(end)
    found = (c_double * len(names))()
    assert slopes(c, names, found) == OK
    up, down = values(end + h), values(end - h)
    expected = [(a - b) / (2 * h) for a, b in zip(up, down)]
    assert list(found) == pytest.approx(expected, rel=1e-6, abs=1e-5 * max(map(abs, expected)))


def test_jumps_of_a_commanded_speed(five_bar: Library) -> None:
    c, again = five_bar.instance().start(), five_bar.instance().start()
    before = c.get("slider.velocity")
    c.set(drive__speed=50.0)
    assert c.get("crank.speed") == [50.0]
    assert c.get("slider.velocity") != before
    power = c.get("power.supplied", "power.dissipated")
    assert all(map(math.isfinite, power))
    again.set(drive__speed=50.0)
    for instance in (c, again):
        assert instance.step(0.0, 1e-3) == OK
    assert c.get("crank.speed", "slider.velocity") == again.get("crank.speed", "slider.velocity")


# Saved states


def serialized(c: Instance, state: c_void_p) -> bytes:
    size = c_size_t()
    assert c(f"SerializedFMU{'S' if c.library.fmi == 3 else 's'}tateSize", state, byref(size)) == OK
    text = (c_char * size.value)()
    assert c.with_state("Serialize", state, text, c_size_t(size.value + 1)) == ERROR
    assert "it must be" in c.log[-1][1]
    assert c.with_state("Serialize", state, text, size) == OK
    return bytes(text.raw)


def restored(c: Instance, text: bytes) -> int:
    state = c_void_p()
    verb = "Deserialize" if c.library.fmi == 3 else "DeSerialize"
    status = c.with_state(verb, text, c_size_t(len(text)), byref(state))
    if status == OK:
        status = c.with_state("Set", state)
        assert c.with_state("Free", byref(state)) == OK
        assert state.value is None
    return status


NAMES = ("crank.angle", "crank.acceleration", "energy.supplied", "energy.residual", "time")


def test_a_run_goes_on_from_a_saved_state_bit_for_bit(library: Library) -> None:
    c = library.instance().start()
    assert c.step(0.0, 0.01) == OK
    assert c.step(5.0, 0.01) == DISCARD  # a sentence to save
    c.set(drive__torque=math.inf)
    assert c.step(0.01, 0.01) == DISCARD
    c.set(drive__torque=0.0)
    state = c.saved()
    text = serialized(c, state)
    assert json.loads(text)["model"] == library.path.stem
    assert c.step(0.01, 0.01) == OK
    wanted = c.get(*NAMES)
    # saved into the same place again
    assert c.with_state("Get", byref(state)) == OK
    assert c.step(0.02, 0.01) == OK
    later = c.get(*NAMES)
    assert c.with_state("Set", state) == OK
    assert c.step(0.02, 0.01) == OK
    assert c.get(*NAMES) == later
    # in another instance, from text
    other = library.instance()
    assert restored(other, text) == OK
    assert other.status() == 2
    assert other.step(0.01, 0.01) == OK
    assert other.get(*NAMES) == wanted
    c.with_state("Free", byref(state))
    c.with_state("Free", None)


def checked(text: bytes) -> bytes:
    """Return a serialised state with the checksum that its text must have, FNV-1a of 64 bits."""
    body, mark, _ = text.rpartition(b'"check":"')
    total = 0xCBF29CE484222325
    for character in body + mark:
        total = (total ^ character) * 0x100000001B3 % 2**64
    return body + mark + b'%016x"}' % total


def test_every_change_of_a_character_is_noticed(library: Library) -> None:
    c = library.instance().start()
    assert c.step(0.0, 0.01) == OK
    text, before = serialized(c, c.saved()), c.get(*NAMES)
    assert checked(text) == text
    for place, character in enumerate(text):
        for other in {b"0", b"9", b"f", b"G"} - {bytes([character])}:
            assert restored(c, text[:place] + other + text[place + 1 :]) == ERROR, place
    assert c.get(*NAMES) == before


def test_damaged_states_are_refused(library: Library) -> None:
    c = library.instance().start()
    text = serialized(c, c.saved())
    start = text.index(b'numbers":"') + 10
    phase = text.index(b'","message')  # the last numbers before it are phase, reason and cause
    count = (phase - start) // 16
    given = sorted(library.references.items(), key=lambda item: item[1])
    branch = next(reference for name, reference in given if name == "assembly.branch")

    def number(place: int, value: float) -> bytes:
        at = start + 16 * place
        return checked(text[:at] + struct.pack(">d", value).hex().encode() + text[at + 16 :])

    half = number(branch, 0.5)
    damaged = [
        b"", b"{}", text[:-1], text + b" ", text[:200], text[: start + 20], text.replace(b'"format":2', b'"format":1'),
        text[:start] + b"G" + text[start + 1 :], text[:start] + b"\x00" + text[start + 1 :],
        text.replace(b'"message":"', b'"massage":"'), text.replace(b'"message":"', b'"message":"\n'),
        text.replace(b'"message":"', b'"message":"' + b"x" * 400), text.replace(b'"cause":"', b'"cause":'),
        text[: text.index(b'"message":"') + 11], half, number(branch, 1e10), number(branch, -1e10), number(branch, math.nan),
        # phase: two at once, none, a part, during an update, one that the start has not come to
        *(number(count - 4, phase) for phase in (3.0, 1000.0, 0.5, math.nan, 32.0, 0.0)),
        number(count - 6, 0.0),  # tolerance
        number(count - 3, 9.5), number(count - 2, 77.0), number(count - 1, -1.0),
    ]  # fmt: skip
    for place, wrong in enumerate(damaged):
        assert restored(c, wrong) == ERROR, place
        assert "the serialised state is damaged" in c.log[-1][1]
    # running, with a start that is not there
    fresh = library.instance()
    text = serialized(fresh, fresh.saved())
    for phase in (4.0, 8.0, 16.0, 64.0):
        assert restored(c, number(count - 4, phase)) == ERROR
    text = serialized(c, c.saved())
    assert restored(c, text) == OK
    assert c.step(0.0, 1e-3) == OK


def test_a_state_with_a_time_that_is_not_finite_is_refused(five_bar: Library) -> None:
    c = five_bar.instance()
    assert c.enter(start=1.25) == OK
    text = serialized(c, c.saved())
    time = struct.pack(">d", 1.25).hex().encode()
    assert text.count(time) == 2
    nan = struct.pack(">d", math.nan).hex().encode()
    for wrong in (text.replace(time, nan), text.replace(time, nan, 1), nan.join(text.rsplit(time, 1))):
        assert restored(c, checked(wrong)) == ERROR
    assert restored(c, text) == OK


def test_quotes_in_a_sentence_do_not_spoil_the_text(five_bar: Library) -> None:
    c = five_bar.instance().start()
    c.step(5.0, 1.0)
    saved = json.loads(serialized(c, c.saved()))
    assert saved["message"] == c.text()


# Derivatives


def directional(
    c: Instance, unknowns: list[str], knowns: list[str], seed: list[float], kind: str = "Directional"
) -> Any:
    """Status, or the result where it is good."""
    result = (c_double * (len(unknowns) if kind == "Directional" else len(knowns)))()
    given = (*c.arrays(unknowns, ())[:2], *c.arrays(knowns, (c_double * len(seed))(*seed)), result)
    status = c(f"Get{kind}Derivative", *given, *((c_size_t(len(result)),) if c.library.fmi == 3 else ()))
    return list(result) if status == OK else status


@pytest.mark.parametrize("kind", ["Directional", "Adjoint"])
def test_derivatives_that_there_are_not(library: Library, kind: str) -> None:
    if library.fmi == 2 and kind == "Adjoint":
        pytest.skip("FMI 2.0 has no adjoint derivatives")
    c = library.instance()
    c.enter()
    assert directional(c, ["crank.acceleration"], ["solver.status"], [1.0], kind) == ERROR
    assert directional(c, ["solver.status"], ["drive.torque"], [1.0], kind) == ERROR
    assert directional(c, ["drive.torque"], ["drive.torque"], [1.0], kind) == ERROR
    assert "drive.torque is no unknown" in c.log[-1][1]
    assert directional(c, ["crank.acceleration"], ["crank.angle"], [1.0], kind) == ERROR
    assert "crank.angle is no known of a derivative in initialisation mode" in c.log[-1][1]
    assert directional(c, ["crank.acceleration"], ["initial.crank_angle"], [1.0], kind) != ERROR
    assert directional(c, ["crank.acceleration"], ["drive.torque"], [math.nan], kind) == DISCARD
    c.set(crank__length=-1.0)
    assert directional(c, ["crank.acceleration"], ["drive.torque"], [1.0], kind) == ERROR
    assert "crank.length is -1" in c.log[-1][1]
    c = library.instance().start()
    assert directional(c, ["crank.acceleration"], ["crank.length"], [1.0], kind) == ERROR
    assert "crank.length is no known of a derivative in step mode" in c.log[-1][1]
    if library.fmi == 3:
        refs = (c_uint32 * 1)(c.library.references["crank.acceleration"])
        one = (c_double * 1)(1.0)
        n, none = c_size_t(1), (None, c_size_t(0))
        for first, last in ((2, 1), (1, 2)):
            sized = (refs, n, refs, n, one, c_size_t(first), one, c_size_t(last))
            assert c(f"Get{kind}Derivative", *sized) == ERROR
            assert "2 numbers: it must be 1" in c.log[-1][1]
        assert c(f"Get{kind}Derivative", *none, *none, *none, *none) == OK
    else:
        assert c("GetDirectionalDerivative", None, c_size_t(0), None, c_size_t(0), None, None) == OK


def test_the_states_are_the_knowns_of_model_exchange(five_bar: Library) -> None:
    c = five_bar.instance("me").start()
    assert directional(c, ["crank.acceleration"], ["crank.speed"], [1.0]) != ERROR
    assert directional(c, ["crank.acceleration"], ["crank.acceleration"], [1.0]) == ERROR


def test_works_that_are_no_outputs(natives: dict[str, Path], tmp_path: Path) -> None:
    for number, name in enumerate(("Pendulum-native", "Pendulum-native-fmi3")):
        c = Library(natives[name], tmp_path / str(number)).instance().start(initial__pendulum_speed=10.0)
        assert c.step(0.0, 0.1) == OK
        dissipated, supplied = c.get("energy.dissipated", "energy.supplied")
        assert (dissipated > 0.0, supplied) == (True, 0.0)
        c.set(drive__torque=1.0)
        assert c.step(0.1, 0.1) == OK
        assert c.get("energy.supplied") != [0.0]


# Model exchange


def test_model_exchange_by_hand(library: Library) -> None:
    c = library.instance("me")
    assert c.enter() == OK
    assert c.states()[0] == 0.0
    assert c("ExitInitializationMode") == OK
    assert c.discrete() == (False, False)
    assert c("EnterContinuousTimeMode") == OK
    x, nominals = c.states(), c.states("NominalsOfContinuousStates")
    assert min(nominals) > 0.0
    rates, name = c.rates(), "Derivatives" if library.fmi == 2 else "ContinuousStateDerivatives"
    assert rates[:2] == x[2:4]
    assert rates[4:] == c.get("power.dissipated", "power.supplied")
    assert c.get("assembly.margin_to_limit") == c.states("EventIndicators", 1)
    for which in ("ContinuousStates", name, "NominalsOfContinuousStates"):
        assert c(f"Get{which}", (c_double * 9)(), c_size_t(9)) == ERROR
        assert "9 numbers: it must be 6" in c.log[-1][1]
    assert c("GetEventIndicators", (c_double * 2)(), c_size_t(2)) == ERROR
    assert c("SetContinuousStates", (c_double * 5)(), c_size_t(5)) == ERROR
    assert c.put_states(math.nan, *x[1:]) == DISCARD
    assert c("SetTime", math.nan) == ERROR
    assert "the time is nan s: it must be finite and not before the start" in c.log[-1][1]
    assert c("SetTime", 0.25) == OK
    assert c.get("time") == [0.25]
    if library.fmi == 2:  # states by themselves
        assert c.set(crank__angle=0.5) == OK
        assert c.states() == [0.5, *x[1:]]
        assert c.set(crank__angle=math.nan) == DISCARD
        assert c.set(crank__angle=x[0]) == OK
    assert c.set(crank__acceleration=1.0) == ERROR
    assert c("CompletedIntegratorStep", c_bool(True) if library.fmi == 3 else 1, byref(c_int(1)), byref(c_int(1))) == OK
    # a command that changes is followed at once; the state takes it at the event, once
    c.set(drive__speed=50.0)
    assert c.get("crank.speed") == [50.0]
    assert c("EnterEventMode") == OK
    assert c.discrete() == (False, True)
    assert c.states()[2] == 50.0
    assert c.discrete() == (False, False)
    assert c("EnterContinuousTimeMode") == OK


#: Commands that move between events: the FMU, its modes and start, and law and rate of each command.
FOLLOWED: dict[str, tuple[str, dict[str, float], dict[str, tuple[Law, Law, str]]]] = {
    "ramp": ("FiveBarSlider", {}, {"drive.speed": (lambda t: 40.0 + 50.0 * t, lambda t: 50.0, "drive.acceleration")}),
    "shift": (
        "SliderCrank",
        {"drive__mode": 0, "axial__mode": 1, "initial__crank_speed": 9.0},
        {"axial.speed": (lambda t: 0.3 * math.sin(30 * t), lambda t: 9.0 * math.cos(30 * t), "axial.acceleration")},
    ),
    "both": (
        "SliderCrank",
        {"drive__mode": 1, "axial__mode": 1},
        {
            "drive.speed": (lambda t: 5.0 + 40.0 * t * t, lambda t: 80.0 * t, "drive.acceleration"),
            "axial.speed": (lambda t: 0.3 * math.sin(30 * t), lambda t: 9.0 * math.cos(30 * t), "axial.acceleration"),
        },
    ),
}


@pytest.mark.parametrize("case", FOLLOWED)
@pytest.mark.parametrize("kind", ["native", "native-fmi3"])
def test_a_command_that_moves_is_followed_at_the_order_of_the_solver(
    libraries: dict[str, Library], case: str, kind: str
) -> None:
    model, values, commands = FOLLOWED[case]
    mechanism = FMUS[model]
    start = values | {name.replace(".", "__"): law(0.0) for name, (law, _, _) in commands.items()}
    given = {v.name: v.start for v in mechanism.variables}
    given |= {name.replace("__", "."): value for name, value in start.items()}
    plant = Plant.from_values(mechanism, given)

    def motion(t: float, x: Any) -> Any:
        for name, (law, rate, channel) in commands.items():
            plant.inputs |= {name: law(t), channel: rate(t)}
        return mechanism.equations.derivative(tuple(x), plant._applied_inputs(), plant._p)

    exact = solve_ivp(motion, (0.0, 0.2), plant.state, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    names = [part for f in mechanism.freedoms for part in (f.coordinate, f.rate)] + ["energy.supplied"]
    n = len(mechanism.freedoms)
    places = [place for i in range(n) for place in (i, n + i)] + [2 * n + 1]
    library = libraries[f"{model}-{kind}"]

    def error(steps: int) -> Any:
        c = library.instance("me").start(**start)
        c.discrete()
        assert c("EnterContinuousTimeMode") == OK
        x, h = np.array(c.states()), 0.2 / steps

        def put(t: float, x: Any) -> None:
            assert c("SetTime", t) == OK
            assert c.put_states(*x) == OK
            c.set(**{name.replace(".", "__"): law(t) for name, (law, _, _) in commands.items()})

        def slope(t: float, x: Any) -> Any:
            put(t, x)
            return np.array(c.rates())

        for i in range(steps):  # the classical method of fourth order
            t = i * h
            k1 = slope(t, x)
            k2 = slope(t + h / 2, x + h / 2 * k1)
            k3 = slope(t + h / 2, x + h / 2 * k2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(t + h, x + h * k3))
            if i == steps // 2:  # an event on the way changes nothing
                put(t + h, x)
                assert c("EnterEventMode") == OK
                assert c.discrete()[1]
                assert c("EnterContinuousTimeMode") == OK
                x = np.array(c.states())
        put(0.2, x)
        for name, (law, _, _) in commands.items():
            assert c.get({"drive.speed": "crank.speed", "axial.speed": "shift.velocity"}[name]) == [law(0.2)]
        return np.abs(np.array(c.get(*names)) - exact[places])

    coarse, fine = error(200), error(400)
    assert (fine < 2e-5).all()
    assert (fine < coarse / 12 + 1e-9).all(), (coarse, fine)


STAYED = "drive.speed stayed at 40 while drive.acceleration is 50"


@pytest.mark.parametrize(("moved", "said"), [(0.0, STAYED), (1.0, "")])
def test_a_speed_that_contradicts_its_acceleration_is_named(five_bar: Library, moved: float, said: str) -> None:
    c = five_bar.instance("me", logging=True).continuous(drive__speed=40.0, drive__acceleration=50.0)
    assert c("SetTime", 0.1) == OK
    c.set(drive__speed=40.0 + moved)
    assert c("Terminate") == (WARNING if said else OK)
    assert [said in text for _, text in c.log] == [True] * bool(said)
    # since an event
    c = five_bar.instance("me", logging=True).continuous(drive__speed=40.0)
    assert c("SetTime", 0.1) == OK
    assert c("EnterEventMode") == OK
    c.set(drive__speed=30.0, drive__acceleration=50.0)
    c.discrete()
    assert c("EnterContinuousTimeMode") == OK
    assert c("SetTime", 0.2) == OK
    c.set(drive__speed=30.0 + moved)
    assert c("Terminate") == (WARNING if said else OK)
    assert [text for _, text in c.log] == [said.replace("40", "30") + ": in model exchange both must move"] * bool(said)


def test_model_exchange_without_a_command_in_force(five_bar: Library) -> None:
    c = five_bar.instance("me").continuous(drive__mode=0, drive__acceleration=50.0, initial__crank_speed=40.0)
    assert c("SetTime", 0.1) == OK
    assert c.text() == ""
    rates = c.rates()
    assert rates[2:4] == c.get("crank.acceleration", "slider.acceleration")
    assert c.set(slider__stiffness=1.0) == ERROR
    assert "slider.stiffness is a tunable parameter, it cannot be set in continuous-time mode" in c.log[-1][1]
    assert c("Terminate") == OK


def test_model_exchange_beyond_the_limit(five_bar: Library) -> None:
    c = five_bar.instance("me", logging=True).continuous()
    assert c.put_states(0.0, 9.0, 1.0, 0.0, 0.0, 0.0) == OK
    name = "Derivatives" if five_bar.fmi == 2 else "ContinuousStateDerivatives"
    assert c(f"Get{name}", (c_double * 6)(), c_size_t(6)) == DISCARD
    assert c("GetEventIndicators", (c_double * 1)(), c_size_t(1)) == DISCARD
    # nor are there outputs
    assert c(c.real("Get"), *c.arrays(["crank.acceleration"], (c_double * 1)())) == DISCARD
    assert c.status() == 0
    assert c("EnterEventMode") == OK
    assert c.discrete()[0]
    assert (c.status(), c.text()) == (3, "the motion has reached the limit of assembly")
    assert c.log[-1] == (WARNING, c.text())
    c = five_bar.instance("me")
    c.set(crank__length=-1.0)
    c.enter()
    assert c("GetContinuousStates", (c_double * 6)(), c_size_t(6)) == ERROR
    assert "crank.length is -1" in c.log[-1][1]


def test_the_limit_stays_the_reason_until_the_state_is_clear_of_it(five_bar: Library) -> None:
    c = five_bar.instance("me").continuous()
    x = c.states()

    def put(position: float) -> float:
        assert c.put_states(x[0], position, *x[2:]) == OK
        return c.get("assembly.margin_to_limit")[0]

    clear, beyond = x[1], 9.0
    for _ in range(45):
        middle = 0.5 * (clear + beyond)
        clear, beyond = (middle, beyond) if put(middle) >= 0.0 else (clear, middle)
    assert put(beyond) < 0.0
    assert c("EnterEventMode") == OK
    assert c.discrete()[0]
    c.get("crank.acceleration")
    assert c.status() == 3
    assert c("EnterContinuousTimeMode") == OK
    put(x[1])
    c.get("crank.acceleration")
    assert c.status() == 3  # discrete: it waits for the event
    assert c("EnterEventMode") == OK
    c.get("crank.acceleration")
    assert c.status() == 0


# Intermediate updates of FMI 3.0


def test_intermediate_updates(fmi3: Library) -> None:
    seen: list[tuple[float, float]] = []
    forbidden: list[int] = []

    def update(c: Instance, time: float, *flags: Any) -> None:
        *states, ask, end = flags
        assert states == [True, True, True, False]
        assert c.get("time") == [time]
        seen.append((time, c.get("crank.angle")[0]))
        forbidden.append(c("Reset"))
        ask[0], end[0] = True, time  # not allowed, not heeded

    c, plain = fmi3.instance(update=update).start(), fmi3.instance().start()
    for instance in (c, plain):
        assert instance.step(0.0, 0.1) == OK
        assert not instance.early
    assert len(seen) > 3
    assert [time for time, _ in seen] == sorted({time for time, _ in seen})
    assert max(seen)[0] < 0.1
    assert set(forbidden) == {ERROR}
    assert "not allowed during an intermediate update" in c.log[-1][1]
    assert c.get(*NAMES) == plain.get(*NAMES)


def test_inputs_set_in_an_intermediate_update_hold_from_there(fmi3: Library) -> None:
    times: list[float] = []
    seen: list[float] = []

    def update(c: Instance, time: float, *rest: Any) -> None:
        seen.append(c.get("slider.acceleration")[0])  # an output is that of the state now, each time
        if not times:
            times.append(time)
            c.set(slider__force=3.0, drive__speed=60.0)

    # with an acceleration: the command is applied once, not at every update that follows
    c = fmi3.instance(update=update).start(drive__acceleration=200.0, solver__tolerance=1e-12)
    assert c.step(0.0, 0.05) == OK
    assert len(set(seen)) == len(seen) > 5
    two = fmi3.instance().start(drive__acceleration=200.0, solver__tolerance=1e-12)
    assert two.step(0.0, times[0]) == OK
    two.set(slider__force=3.0, drive__speed=60.0)
    assert two.step(times[0], 0.05 - times[0]) == OK
    names = ("crank.angle", "crank.speed", "slider.position", "slider.velocity", "energy.supplied")
    assert c.get(*names) == pytest.approx(two.get(*names), rel=1e-8)


def test_a_controller_in_intermediate_updates_is_of_second_order(fmi3: Library) -> None:
    """A PI controller of the crank's speed, 44 rad/s from 40, over 0.1 s, in communication steps of 2.5 ms and in one."""
    proportional, integral, wanted, begin = 5e-4, 0.01, 44.0, 40.0

    def angle(steps: int, **values: float) -> tuple[float, int]:
        memory = [0.0, wanted - begin, 0.0]  # time, error, integral
        times: list[float] = []

        def control(c: Instance, time: float, *rest: Any) -> None:
            error = wanted - c.get("crank.speed")[0]
            memory[:] = [time, error, memory[2] + 0.5 * (error + memory[1]) * (time - memory[0])]
            c.set(drive__torque=proportional * error + integral * memory[2])
            times.append(time)

        c = fmi3.instance(update=control).start(drive__mode=0, initial__crank_speed=begin, **values)
        for n in range(steps):
            control(c, n * 0.1 / steps)
            assert c.step(n * 0.1 / steps, 0.1 / steps) == OK
        return c.get("crank.angle")[0], len(times)

    values = {v.name: v.start for v in FIVE_BAR.variables} | {"drive.mode": 0, "initial.crank_speed": begin}
    plant = Plant.from_values(FIVE_BAR, values)

    def motion(t: float, x: Any) -> list[float]:
        plant.inputs["drive.torque"] = proportional * (wanted - x[2]) + integral * x[-1]
        return [*FIVE_BAR.equations.derivative(tuple(x[:-1]), plant._applied_inputs(), plant._p), wanted - x[2]]

    exact = solve_ivp(motion, (0.0, 0.1), [*plant.state, 0.0], method="DOP853", rtol=1e-11, atol=1e-12).y[0, -1]
    # 4.1e-4 where inputs are held from one update to the next
    assert abs(angle(40)[0] - exact) < 2e-5
    # in one step: the smaller the tolerance, the more updates, whose number measures the step between them
    ends, counts = zip(*(angle(1, solver__tolerance=value) for value in (1e-6, 1e-8, 1e-10, 1e-12)), strict=True)
    order = -np.polyfit(np.log(counts), np.log(np.abs(np.array(ends) - exact)), 1)[0]
    assert 1.75 < order < 2.25


def test_an_input_that_is_not_finite_in_an_update_refuses_the_step(fmi3: Library) -> None:
    c = fmi3.instance(update=lambda c, *_: c.set(slider__force=math.nan)).start()
    refused(c, 0.0, 0.05, 2, "slider.force is nan")
    assert c.get("time", "slider.force") == [0.0, 0.0]


@pytest.mark.parametrize("begin", [0.0, 3.0])
@pytest.mark.parametrize("ahead", [0.0, 0.004, 1.0])
def test_an_update_may_end_the_step(fmi3: Library, ahead: float, begin: float) -> None:
    asked: list[float] = []

    def update(_: Instance, time: float, *flags: Any) -> None:
        *_, can_end, ask, end = flags
        assert can_end
        if not asked:
            asked.append(time + ahead)
            ask[0], end[0] = True, time + ahead

    c = fmi3.instance(early=True, update=update)
    assert c.enter(begin) == OK
    assert c("ExitInitializationMode") == OK
    assert c.step(begin, 0.05) == OK
    ends = min(asked[0], begin + 0.05)
    assert c.early == (ends < begin + 0.05)
    assert not c.terminate
    assert c.reached.value == pytest.approx(ends, abs=1e-15)
    assert c.get("time") == [c.reached.value]
    assert c.step(c.reached.value, 0.01) == OK


# Arrays


def test_of_an_array_with_a_wrong_reference_nothing_is_set(library: Library) -> None:
    c = library.instance()
    assert c.set(**{"gravity" if "gravity" in library.references else "gravity.y": 3.0}) == OK
    wrong = (c_uint32 * 2)(0, len(library.references))
    values = (c_double * 2)(9.0, 9.0)
    arguments = (wrong, c_size_t(2), values) if library.fmi == 2 else (wrong, c_size_t(2), values, c_size_t(2))
    assert c(c.real("Set"), *arguments) == ERROR
    assert c.enter() == OK
    first = min(library.references, key=lambda name: library.references[name])
    assert c.get(first) != [9.0]


def test_a_known_that_is_named_twice_counts_twice(library: Library) -> None:
    c = library.instance().start(drive__mode=0)
    (once,) = directional(c, ["crank.acceleration"], ["drive.torque"], [2.0])
    assert directional(c, ["crank.acceleration"], ["drive.torque"] * 2, [1.5, 0.5]) == [pytest.approx(once, rel=1e-14)]
    if library.fmi == 3:
        (g,) = directional(c, ["crank.acceleration"] * 2, ["drive.torque"], [1.5, 0.5], "Adjoint")
        assert g == pytest.approx(once, rel=1e-14)
    c = library.instance("me").start(drive__mode=0)
    (once,) = directional(c, ["crank.acceleration"], ["crank.speed"], [2.0])
    assert directional(c, ["crank.acceleration"], ["crank.speed"] * 2, [1.5, 0.5]) == [pytest.approx(once, rel=1e-14)]


def test_nothing_asked_is_nothing_wrong(library: Library) -> None:
    c = library.instance().start()
    none = (None, c_size_t(0), None) if library.fmi == 2 else (None, c_size_t(0), None, c_size_t(0))
    kinds = ("Real", "Integer", "String") if library.fmi == 2 else ("Float64", "Int32", "String")
    for kind in kinds:
        for verb in ("Get", "Set"):
            assert c(f"{verb}{kind}", *none) == OK
    slope = (None, c_size_t(0), None, None) if library.fmi == 2 else (None, c_size_t(0), None, None, c_size_t(0))
    assert c("GetRealOutputDerivatives" if library.fmi == 2 else "GetOutputDerivatives", *slope) == OK
    if library.fmi == 2:
        assert c("SetRealInputDerivatives", *slope) == OK
    else:
        names = ["crank.angle"]
        references, n, values, _ = c.arrays(names, (c_double * 1)())
        for kind in kinds:
            for verb in ("Get", "Set") if kind != "String" else ("Get",):
                assert c(f"{verb}{kind}", references, n, values, c_size_t(2)) == ERROR
                assert "2 numbers: it must be 1" in c.log[-1][1]
        assert c("GetOutputDerivatives", references, n, (c_int * 1)(1), values, c_size_t(2)) == ERROR


TRAPPING = """
import ctypes, math, sys
from pathlib import Path
from tests.fmu.native import Library
c = Library(Path(sys.argv[1]), Path(sys.argv[2]))
libm = ctypes.CDLL("libm.so.6")
traps = 1 | 4 | 8  # invalid, division by zero, overflow
beyond = (ctypes.c_double * 6)(0.0, 9.0, 1.0, 0.0, 0.0, 0.0)
for kind in ("cs", "me"):
    cases = dict(crank__length=math.nan, crank__mass=1e300, ground__length=9.0, drive__speed=math.inf, gravity=0.0)
    for name, value in cases.items():
        i = c.instance(kind)
        i.set(**{name: value})
        libm.feenableexcept(traps)
        i.enter()
        bad = i("ExitInitializationMode")
        i.get("crank.acceleration", "assembly.margin_to_limit")
        if not bad and kind == "cs":
            i.set(drive__speed=1e200)
            i.step(0.0, 1e-3)
            i.step(math.nan, 1e-3)
        elif not bad:
            i("EnterContinuousTimeMode")
            i("SetContinuousStates", beyond, ctypes.c_size_t(6))
            i("GetDerivatives" if c.fmi == 2 else "GetContinuousStateDerivatives", beyond, ctypes.c_size_t(6))
            i("GetEventIndicators", beyond, ctypes.c_size_t(1))
            i.get("assembly.margin_to_limit")
        assert libm.fegetexcept() == traps
        libm.fedisableexcept(traps)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="traps are set by glibc")
def test_a_host_that_traps_floating_point_exceptions_lives(five_bar: Library, tmp_path: Path) -> None:
    called(sys.executable, "-c", TRAPPING, five_bar.archive, tmp_path, cwd=Path(__file__).parents[2], timeout=60.0)


def test_versions(library: Library) -> None:
    version = getattr(library.dll, f"fmi{library.fmi}GetVersion")
    version.restype = ctypes.c_char_p
    assert version() == f"{library.fmi}.0".encode()
    if library.fmi == 2:
        platform = library.dll.fmi2GetTypesPlatform
        platform.restype = ctypes.c_char_p
        assert platform() == b"default"
