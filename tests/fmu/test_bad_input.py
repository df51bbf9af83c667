"""Bad input gets an answer in one sentence, and nothing is lost: neither the process nor the last good state."""

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from .bare_master import DISCARD, ERROR, Fmu
from .models import MODELS, Changes, Model, each
from .runner import run_in_process
from .test_description import INPUTS

NAN, INF = float("nan"), float("inf")

#: Values before the initialisation, and what the sentence in the log must say: one of each kind of error. All that a parameter
#: may not be is in `tests/plant/test_parameters.py`.
BAD_ANYWHERE = {
    "negative length": ({"crank.length": -0.05}, "parameter crank.length is -0.05: it must be"),
    "length lost in products": ({"crank.length": 5e-324}, "parameter crank.length is 5e-324: it must be large enough"),
    "branch": ({"assembly.branch": 0}, "parameter assembly.branch is 0: it must be +1 or -1"),
    "drive mode": ({"drive.mode": 7}, "parameter drive.mode is 7: it must be 0 (torque) or 1 (speed)"),
    "tolerance not a number": ({"solver.tolerance": NAN}, "parameter solver.tolerance is nan: it must be between"),
    "start": ({"initial.crank_angle": INF}, "parameter initial.crank_angle is inf: it must be a finite number"),
}
BAD_PARAMETERS = {
    "FiveBarSlider": {
        **BAD_ANYWHERE,
        "input not a number": ({"slider.force": NAN}, "input slider.force is nan at t = 0 s: it must be a finite"),
        "not to be assembled": ({"initial.slider_position": 1.0}, "the links cannot be joined at crank angle 0 rad"),
        "at the limit of assembly": ({"initial.slider_position": 0.19649999}, "limit of assembly at crank angle 0 rad"),
    },
    "SliderCrank": {
        **BAD_ANYWHERE,
        "axial mode": ({"axial.mode": 3}, "parameter axial.mode is 3: it must be 0 (force), 1 (speed) or 2 (groove)"),
        "input too large": ({"axial.speed": 1e300}, "the energy at the start is not finite: "),
        "not to be assembled": ({"initial.shift_position": 2.0}, "the rod does not reach the guide at crank angle 0"),
    },
}


def initialise_badly(fmu: str, folder: str, cases: list[dict[str, Any]], times: int) -> list[Any]:
    """Statuses, log and trouble of failed initialisations; every instance is used on and then freed."""
    fmu = Fmu(fmu, folder)
    found = []
    for values in cases:
        for k in range(times):
            instance = fmu.instantiate(logging=k % 2 == 0)
            assert [instance.set(name, value) for name, value in values.items()] == [0] * len(values)
            assert instance.setup() == instance.enter() == 0
            if k % 3 == 1:
                # a read on the way neither fails nor hides the failure
                assert instance.read(["crank.angle"])[0] == 0
            status = instance.exit()
            # what masters do that overlook the status
            assert status == ERROR
            trouble = instance.trouble()
            assert instance.step(0.0, 1e-3) == DISCARD
            after = instance.trouble()
            outputs = instance.read(fmu.outputs)[0]
            if k % 2:
                instance.exit()
                instance.terminate()
            instance.free()
            if k == 0:
                found.append([trouble, after, outputs, instance.log])
            # without logging, too, the cause is to be read, and logged
            assert [trouble, after] == found[-1][:2]
            assert instance.log[: len(found[-1][3])] == found[-1][3]
    # the process is as good as before
    instance = fmu.instantiate().start()
    instance.run([1e-3] * 10)
    instance.free()
    return found


@pytest.fixture(scope="module")
def failures(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, Any]]:
    """What each bad parameter of a model leads to, after 14 of each in one process that lived on."""

    @cache
    def of(model: str) -> dict[str, Any]:
        cases = [values for values, _ in BAD_PARAMETERS[model].values()]
        found = run_in_process(initialise_badly, fmus[model], tmp_path_factory.mktemp("run"), cases, 14)
        return dict(zip(BAD_PARAMETERS[model], found))

    return of


@each({model: {case: case for case in cases} for model, cases in BAD_PARAMETERS.items()})
def test_bad_parameter_fails_the_initialisation_with_a_sentence(
    failures: Callable[[str], dict[str, Any]], model: Model, case: str
) -> None:
    trouble, after, outputs, log = failures(model.name)[case]
    sentence = BAD_PARAMETERS[model.name][case][1]
    said = [text for status, category, text in log if (status, category) == (3, "logStatusError")]
    assert len(said) == 1
    assert said[0].startswith(sentence)
    assert "\n" not in said[0]
    code = 2 if "input" in case else 3 if "assembl" in case else 6
    assert trouble == [code, said[0]]
    # a step all the same: refused, and the cause is still to be read
    assert after[0] in (5, code)
    assert said[0] in after[1]
    assert outputs == 0


#: Time and size of a step at t = 0.01, the value of solver.status, and what the sentence must say.
BAD_STEPS = {
    "not a number": (0.01, NAN, 1, "a step of nan s from t = 0.01 s: both must be finite numbers"),
    "backwards": (0.009, 1e-3, 1, "a step backwards: it starts at t = 0.009 s, but the state is at t = 0.01 s"),
}
LIMIT, TOO_SMALL = (f"in the step from t = 0.01 s: {what}" for what in ("limit of assembly at", "the step size fell"))
#: Input and value, the value of solver.status, and what the sentence must say.
BAD_INPUTS = {
    "FiveBarSlider": {
        "infinite load": ("load.fy", -INF, 2, "input load.fy is -inf at t = 0.01 s: it must be a finite number"),
        "slider pushed out": ("slider.force", 1e5, 3, LIMIT),
        "crank run wild": ("drive.speed", 1e5, 3, LIMIT),
        "beyond floats": ("slider.force", 1e300, 4, TOO_SMALL),
    },
    "SliderCrank": {
        "force of no use": ("axial.force", NAN, 2, "input axial.force is nan at t = 0.01 s: it must be a finite"),
        "crank pulled out": ("axial.speed", -30.0, 3, LIMIT),
        "beyond floats": ("axial.acceleration", 1e300, 4, TOO_SMALL),
    },
}


def step_badly(fmu: str, folder: str, cases: list[Any]) -> list[Any]:
    """After ten good steps a bad one, and then a good one; beside a run without the bad one."""
    fmu = Fmu(fmu, folder)
    good = fmu.instantiate().start()
    good.run([1e-3] * 10)
    at_failure = good.outputs()
    good.run([1e-3], 0.01)
    found = []
    for inputs, time, size in cases:
        instance = fmu.instantiate().start()
        instance.run([1e-3] * 10)
        kept = {name: instance.get(name) for name in inputs}
        for name, value in inputs.items():
            assert instance.set(name, value) == 0
        status = instance.step(time, size)
        trouble = instance.trouble()
        log = list(instance.log)
        terminated = instance.terminated()
        # readable under the input that failed, equal to the last good where the input is put back
        readable = instance.read(fmu.outputs)[0]
        for name, value in kept.items():
            instance.set(name, value)
        same = instance.outputs() == at_failure
        state = instance.save()
        saved = len(instance.serialize(state))
        again = instance.step(0.01, 1e-3)
        found.append(
            {
                "status": status,
                "trouble": trouble,
                "log": log,
                "terminated": terminated,
                "readable": readable,
                "same": same,
                "saved": saved,
                "again": again,
                "after": instance.trouble(),
                "like the run without it": instance.outputs() == good.outputs(),
            }
        )
        # and once more from the state saved after the refusal
        assert instance.restore(state) == 0
        assert instance.step(0.01, 1e-3) == 0
        assert instance.outputs() == good.outputs()
        instance.terminate()
        instance.free()
    return found


@pytest.fixture(scope="module")
def refusals(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, Any]]:
    """What each bad step and each bad input of a model leads to."""

    @cache
    def of(model: str) -> dict[str, Any]:
        inputs = BAD_INPUTS[model]
        cases: list[Any] = [[{}, time, size] for time, size, _, _ in BAD_STEPS.values()]
        cases += [[{name: value}, 0.01, 0.1] for name, value, _, _ in inputs.values()]
        found = run_in_process(step_badly, fmus[model], tmp_path_factory.mktemp("run"), cases)
        return dict(zip([*BAD_STEPS, *inputs], found))

    return of


@each({model: {case: case for case in [*BAD_STEPS, *inputs]} for model, inputs in BAD_INPUTS.items()})
def test_bad_step_is_refused_and_the_last_good_state_stays(
    refusals: Callable[[str], dict[str, Any]], model: Model, case: str
) -> None:
    *_, code, sentence = (BAD_STEPS | BAD_INPUTS[model.name])[case]
    found = refusals(model.name)[case]
    assert found["status"] == 2, "fmi2Discard"
    assert found["trouble"][0] == code
    assert found["trouble"][1].startswith(sentence)
    assert found["log"] == [[2, "logStatusDiscard", found["trouble"][1]]]
    assert (found["terminated"], found["readable"]) == ([0, 1], 0)
    assert found["same"]
    assert found["saved"] > 100
    assert (found["again"], found["after"]) == (0, [0, ""])
    assert found["like the run without it"]


def nan_input_read(fmu: str, folder: str, inputs: list[str]) -> list[Any]:
    """Outputs read while an input is not finite, and whether they are as before when it is put back."""
    fmu = Fmu(fmu, folder)
    found = []
    for name in inputs:
        instance = fmu.instantiate().start()
        before = instance.outputs()
        kept = instance.get(name)
        instance.set(name, float("nan"))
        found.append([before, instance.outputs(), instance.trouble()])
        instance.set(name, kept)
        assert instance.outputs() == before
    return found


def test_outputs_under_an_input_that_is_not_finite_are_the_last_good_ones(
    fmu: Path, model: Model, tmp_path: Path
) -> None:
    names = sorted(INPUTS[model.name])
    for name, (before, during, trouble) in zip(names, run_in_process(nan_input_read, fmu, tmp_path, names)):
        assert during == before
        assert trouble[0] == 2
        assert f"{name} is nan" in trouble[1]


def out_of_order(fmu: str, folder: str) -> list[Any]:
    """Steps before the initialisation and after the end, values set where they cannot be, states of no run."""
    fmu = Fmu(fmu, folder)
    instance = fmu.instantiate()
    found = [[instance.step(0.0, 1e-3), instance.trouble()]]
    state = instance.save()
    instance.start()
    assert instance.step(0.0, 1e-3) == 0
    found.append([instance.set("crank.length", 0.06), instance.get("crank.length"), instance.log[-1]])
    found.append([instance.set("crank.angle", 1.0), instance.get("crank.angle") == 1.0, instance.log[-1]])
    assert instance.restore(state) == 0
    found.append([instance.step(0.0, 1e-3), instance.trouble()])
    instance.free_state(state)
    instance.free()
    return found


def test_calls_out_of_order(fmu: Path, model: Model, tmp_path: Path) -> None:
    before, parameter, output, restored = run_in_process(out_of_order, fmu, tmp_path)
    assert before == [2, [5, "a step at t = 0 s before the initialisation"]]
    # the default: 5 cm, 12 in
    assert parameter[:2] == [3, pytest.approx({"FiveBarSlider": 0.05, "SliderCrank": 0.3048}[model.name], rel=1e-15)]
    said = "crank.length is a fixed parameter, set after the initialisation: the value 0.06 was not taken"
    assert parameter[2] == [3, "logStatusError", said]
    assert (output[:2], output[2][2]) == ([3, False], "crank.angle is an output: the value 1.0 was not taken")
    assert restored == before


#: Calls that lead to each phase of a run, and those that are refused there.
PHASES: dict[str, tuple[list[str], list[str]]] = {
    "instantiated": ([], ["exit", "step"]),
    "in initialisation": (["setup", "enter"], ["setup", "enter", "step"]),
    "running": (["setup", "enter", "exit", "step"], ["setup", "enter", "exit"]),
    "terminated": (
        ["setup", "enter", "exit", "step", "terminate"], ["setup", "enter", "exit", "step", "set input", "set parameter"],
    ),
}  # fmt: skip


def refused_calls(fmu: str, folder: str, name: str, lead: list[str], calls: list[str]) -> list[Any]:
    """Status of each call, solver.status, the sentence, and whether it left the outputs; then of what is right to do."""
    fmu = Fmu(fmu, folder)

    def do(instance, call):
        if call == "step":
            return instance.step(0.0, 1e-3)
        if call.startswith("set "):
            return instance.set(name if call == "set input" else "crank.length", 0.06)
        return getattr(instance, call)()

    found = []
    for call in calls:
        instance = fmu.instantiate()
        assert [do(instance, one) for one in lead] == [0] * len(lead)
        before = instance.outputs()
        # more than once: a refused call leaves nothing behind that the next one breaks on
        statuses = [do(instance, call) for _ in range(3)]
        trouble, said = instance.trouble(), [text for status, _, text in instance.log if status == 3]
        same = instance.outputs() == before
        rest = [one for one in ("setup", "enter", "exit") if one not in lead]
        onward = [do(instance, one) for one in rest]
        if "terminate" not in lead:
            time = 1e-3 if "step" in lead else 0.0
            onward += [instance.step(time, 1e-3), *instance.trouble()]
        onward += [instance.terminate(), instance.terminate()]
        instance.free()
        found.append([statuses, trouble, said, same, onward])
    return found


@each(dict.fromkeys(MODELS, PHASES), "lead", "calls")
def test_calls_that_the_phase_of_a_run_does_not_allow(
    fmu: Path, model: Model, tmp_path: Path, request: pytest.FixtureRequest, lead: list[str], calls: list[str]
) -> None:
    phase = request.node.callspec.id.partition("-")[2]
    for call, (statuses, trouble, said, same, onward) in zip(
        calls, run_in_process(refused_calls, fmu, tmp_path, model.force, lead, calls)
    ):
        if call == "step":
            # discarded, as any step that cannot be taken
            assert statuses == [2] * 3
            assert trouble[0] == (1 if phase == "terminated" else 5)
            assert trouble[1].startswith("a step at t = 0 s " + ("after" if phase == "terminated" else "before"))
        else:
            assert statuses == [3] * 3
            assert trouble == [1, said[0]]
            assert said == said[:1] * 3
            assert f"out of order: the slave is {phase}, not" in said[0]
        assert same
        # and the run goes on as if nothing had been
        assert [one for one in onward if one] == []


def go_on_regardless(fmu: str, folder: str, name: str, value: float) -> list[Any]:
    """A master that overlooks a refused step and goes on."""
    instance = Fmu(fmu, folder).instantiate().start()
    instance.set(name, value)
    return [[instance.step(0.1 * k, 0.1), instance.trouble()] for k in range(4)]


#: An input with which the first step of a tenth of a second, from the defaults, ends in the limit of assembly.
TOO_FAR = {"FiveBarSlider": {"force": ("slider.force", 1e5)}, "SliderCrank": {"shift": ("axial.speed", 30.0)}}


@each(TOO_FAR, "name", "value")
def test_the_cause_stays_where_a_master_goes_on_after_a_refused_step(
    fmu: Path, tmp_path: Path, name: str, value: float
) -> None:
    first, *others = run_in_process(go_on_regardless, fmu, tmp_path, name, value)
    assert (first[0], first[1][0]) == (2, 3)
    assert first[1][1].startswith("in the step from t = 0 s: limit of assembly")
    for k, (status, trouble) in enumerate(others, 1):
        assert status == 2
        gap = f"a step over a gap: it starts at t = {0.1 * k:.9g} s, but the state is at t = 0 s"
        assert trouble == [3, f"{gap}; before that, {first[1][1]}"]


def wrong_calls(fmu: str, folder: str) -> list[Any]:
    """Variables that are not there or of another type; each instance is used on and freed."""
    fmu = Fmu(fmu, folder)
    found = []
    for call in (
        lambda i: i.read(["drive.mode"], kind="Real")[0],
        lambda i: i.read(["solver.message"], kind="Integer")[0],
        lambda i: i.set("crank.length", 1, kind="Integer"),
        lambda i: i.set("crank.length", "long", kind="String"),
        lambda i: i.read(["crank.length"], kind="Boolean")[0],
        lambda i: i.set("crank.length", 1, kind="Boolean"),
        lambda i: i.read([], kind="Real", references=[9999])[0],
        lambda i: i.read([], kind="String", references=[0xFFFFFFFF])[0],
        lambda i: i.set("crank.length", 1.0, reference=0xFFFFFFFF),
    ):
        for _ in range(5):
            instance = fmu.instantiate().start()
            status = call(instance)
            said = [text for _, category, text in instance.log if category == "logStatusError"]
            instance.run([1e-3])
            instance.free()
        found.append([status, said])
    return found


def test_wrong_variables_are_reported_and_do_not_take_the_process_along(fmu: Path, tmp_path: Path) -> None:
    found = run_in_process(wrong_calls, fmu, tmp_path)
    assert [status for status, _ in found] == [3] * 9
    sentences = [said[0] for _, said in found]
    assert sentences[0] == "variable drive.mode is not of type Real"
    assert sentences[5] == "variable crank.length is not of type Boolean"
    assert sentences[6] == "there is no variable with the value reference 9999"
    assert all(len(said) == 1 for _, said in found)


def interrupt(fmu: str, folder: str) -> list[Any]:
    """Interrupts as from the keyboard while steps are taken, then a good run in the same process."""
    import signal
    import time

    signal.signal(signal.SIGALRM, signal.default_int_handler)
    fmu = Fmu(fmu, folder)
    ends = []
    for _ in range(4):
        instance = fmu.instantiate().start()
        end = "none"
        until = time.monotonic() + 10.0
        k = 0
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.05)
            # in a step nearly all the time, so that the interrupt finds one
            while end == "none" and time.monotonic() < until:
                status = instance.step(k * 0.1, 0.1)
                end = status or end
                k += 1
        except KeyboardInterrupt:
            end = "raised"
        assert len(instance.outputs()) > 20
        ends.append(end)
        instance.free()
    instance = fmu.instantiate().start()
    instance.run([1e-3] * 10)
    return ends


@pytest.mark.skipif(sys.platform == "win32", reason="no interval timer")
def test_interrupt_in_a_step_ends_the_run_and_not_the_process(fmu: Path, tmp_path: Path) -> None:
    # an error where it found the slave at work, raised where it found the master
    assert set(run_in_process(interrupt, fmu, tmp_path)) <= {3, "raised"}


def escape(fmu: str, folder: str) -> list[Any]:
    """Exceptions that a slave cannot catch, one a run; what the next calls return, and how many slaves are left."""
    import gc

    fmu = Fmu(fmu, folder)
    found, kind = [], None
    for _ in range(20):
        for terminated in (False, True):
            instance = fmu.instantiate().start()
            kind = kind or next(k for k in map(type, gc.get_objects()) if k.__name__ == fmu.identifier)
            kept = kind.do_step

            def interrupted(self, *arguments):
                raise KeyboardInterrupt

            kind.do_step = interrupted
            found.append(instance.step(0.0, 0.1))
            kind.do_step = kept
            found.append(len(instance.outputs()) > 20)
            if terminated:
                found.append(instance.terminate())
            instance.free()
    for _ in range(20):
        instance = fmu.instantiate().start()
        instance.terminate()
        instance.free()
        # a good one, and one whose initialisation fails
        instance = fmu.instantiate()
        found += [instance.set("crank.length", -1.0), instance.setup(), instance.enter() or instance.exit()]
        instance.free()
    gc.collect()
    return [found, sum(type(one).__name__ == fmu.identifier for one in gc.get_objects())]


def test_exception_that_a_slave_cannot_catch_leaves_it_usable(fmu: Path, tmp_path: Path) -> None:
    found, left = run_in_process(escape, fmu, tmp_path)
    assert found == [3, True, 3, True, 0] * 20 + [0, 0, 3] * 20
    assert left == 0


def refuse_in_percent(fmu: str, folder: str) -> list[Any]:
    """A refused step whose sentence carries printf conversions."""
    instance = Fmu(fmu, folder).instantiate().start()
    status = instance.step(0.0, 0.0)
    return [status, instance.log, instance.get("solver.message")]


def test_percent_signs_come_through_the_printf_of_the_master(
    build_variant: Callable[[Changes], Path], tmp_path: Path
) -> None:
    sentence = "greater than 0 %, not %s%s%n%d %5.3f %%"
    variant = build_variant({"linkwork/plant.py": ("it must be greater than zero", sentence)})
    status, log, message = run_in_process(refuse_in_percent, variant, tmp_path / "run")
    assert status == 2
    assert message == f"a step of 0 s at t = 0 s: {sentence}"
    assert log == [[2, "logStatusDiscard", message]]
