"""All kinds of FMU of a mechanism, both their interfaces, and the in-process solver: the same runs."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract

from analysis import CosimulationError, Function, Harmonics, InductionMotor, Inputs, cosimulate, simulate
from analysis.mechanisms import find_mechanism
from analysis.run import CASES
from linkwork.errors import InputError
from linkwork.five_bar.published import TABLE_3_1

from .drawn import MECHANISMS, drawn
from .native import ERROR, OK, Instance, Library
from .runner import run_in_process
from .test_derivatives import put
from .test_native_runs import restored, serialized

ROOT = Path(__file__).parents[2]

#: The same algorithm; and CVode against it, both to 1e-11.
SAME, OTHER = 1e-9, 1e-6
#: The same where friction turns round within a step: rounding may decide whether that step is refused, and all that follow.
TURNED = 1e-7


def run_cases(root: str, files: dict[str, str], names: list[str]) -> list[Any]:
    """Standard cases in process and through every kind of FMU of their mechanism."""
    import sys

    sys.path.insert(0, root)
    from analysis.run import CASES, check

    found = []
    for name in names:
        for kind, file in files.items():
            for interface in ("co-simulation", "model-exchange") if kind != "python" else ("co-simulation",):
                a, b, result = check(file, CASES[name], interface=interface)
                found.append([name, b.source, interface, a.status, b.status, result.worst.name, result.worst.relative])
    return found


def run_random(root: str, fmu: str, files: dict[str, str], seeds: list[int]) -> list[Any]:
    """Random mechanisms under random inputs that jump now and then: each kind of FMU against another, or a run in process."""
    import random
    import sys
    from dataclasses import replace

    sys.path.insert(0, root)
    from analysis import Harmonics, Inputs, Trajectory, compare, cosimulate, simulate, steps
    from analysis.mechanisms import MECHANISMS, register
    from tests.fmu.drawn import PENDULUM, ROTOR, Drawn, drawn

    for mechanism in (ROTOR, PENDULUM):
        if mechanism.name not in MECHANISMS:
            register(mechanism)

    def acting(case: Drawn, seed: int) -> Inputs:
        source = random.Random(seed)
        given: dict[str, Any] = {}
        chosen = {name for mode in case.mechanism.modes for name in [mode.arguments[case.modes[mode.name]]]}
        by_mode = {name for mode in case.mechanism.modes for name in mode.arguments}
        for channel in case.mechanism.channels:
            if channel.kind == "rate" or (channel.argument in by_mode and channel.argument not in chosen):
                continue
            value = case.inputs[channel.name]
            n = source.randint(1, 3)
            ranges = ((-0.2, 0.2), (5.0, 100.0), (0.0, 6.3))
            waves = [[source.uniform(low, high) for _ in range(n)] for low, high in ranges]
            given[channel.argument] = (Harmonics(value, [value * a for a in waves[0]], *waves[1:]),)
            if source.random() < 0.5:
                # on the grid of the samples, or not
                time = source.choice([0.01, 0.0205])
                given[channel.argument] += (steps([0.0, time], [0.0, 0.1 * value]),)
        flags = chosen - {channel.argument for channel in case.mechanism.channels}
        return Inputs(**given, **dict.fromkeys(flags, True))

    def first(run: Trajectory, count: int) -> Trajectory:
        """Without the last sample before the limit of assembly, where forces grow without bound and rounding with them."""
        return replace(run, time=run.time[:count], values=run.values[:count])

    found = []
    for seed in seeds:
        case = drawn(fmu, seed)
        inputs = acting(case, seed)
        options = {"initial": case.initial, "stop_time": 0.03, "step": 1e-3}
        held = simulate(case.parameters, inputs, hold=1e-3, tolerance=1e-9, **options)
        free = simulate(case.parameters, inputs, tolerance=1e-11, **options)
        runs = [(kind, "co-simulation", held, 1e-9) for kind in files]
        runs += [(kind, "model-exchange", free, 1e-11) for kind in ("native", "native-fmi3")]
        for kind, interface, right, tolerance in runs:
            run = cosimulate(files[kind], case.parameters, inputs, interface=interface, tolerance=tolerance, **options)
            # what is left of the balance of energy is the error of the integrator itself
            own = ("energy.residual",) if interface == "model-exchange" else ()
            n = min(len(right), len(run)) - (right.status != 0)
            differences = compare(first(right, n), first(run, n)).differences
            worst = max((d for d in differences if d.name not in own), key=lambda d: d.relative)
            end = float(right.time[-1] - run.time[-1])
            found.append([seed, kind, interface, worst.name, worst.relative, right.status, run.status, end])
    return found


def files_of(fmu: str, fmus: dict[str, Path], natives: dict[str, Path]) -> dict[str, Path]:
    kinds = {"native": natives[f"{fmu}-native"], "native-fmi3": natives[f"{fmu}-native-fmi3"]}
    return ({"python": fmus[fmu]} if fmu in fmus else {}) | kinds


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fmu", "draws"), [("FiveBarSlider", 15), *(pytest.param(fmu, 50, marks=pytest.mark.long) for fmu in MECHANISMS)]
)
def test_random_mechanisms(fmu: str, draws: int, fmus: dict[str, Path], natives: dict[str, Path]) -> None:
    files = {kind: str(path) for kind, path in files_of(fmu, fmus, natives).items()}
    found = run_in_process(run_random, ROOT, fmu, files, list(range(draws)), timeout=900.0)
    assert {row[0] for row in found} == set(range(draws))
    for seed, kind, interface, name, relative, status, status_fmu, end in found:
        exchange = interface == "model-exchange"
        assert status == status_fmu, (seed, kind, interface)
        case = drawn(fmu, seed)
        same = TURNED if case.mechanism.is_switched_on(case.parameters.constants()) else SAME
        assert relative <= (OTHER if exchange else same), (seed, kind, interface, name, relative)
        # in process the last configuration is recorded, through co-simulation the last communication point
        assert abs(end) <= (1e-9 if exchange else 1e-3 * (status != 0)), (seed, kind, interface, end)
    if fmu == "FiveBarSlider":
        assert {row[5] for row in found} == {0, 3}


@pytest.mark.parametrize("fmu", ["FiveBarSlider", "SliderCrank"])
def test_standard_cases(fmu: str, fmus: dict[str, Path], natives: dict[str, Path]) -> None:
    names = [name for name, case in CASES.items() if find_mechanism(case.parameters).fmu == fmu]
    files = files_of(fmu, fmus, natives)
    found = run_in_process(run_cases, ROOT, {kind: str(path) for kind, path in files.items()}, names, timeout=120.0)
    assert len(found) == 5 * len(names)
    for name, source, interface, status, status_fmu, output, relative in found:
        assert status == status_fmu == 0
        assert relative <= (SAME if interface == "co-simulation" else OTHER), (
            name,
            source,
            interface,
            output,
            relative,
        )


#: Inputs, each with the order of convergence where they are held over a step and where they are linear; what it shows in.
ORDERS = {
    "force": ({"speed": 44.0, "force": Harmonics(1.0, [50.0], [60.0], [0.3])}, 1.0, 2.0),
    "speed": ({"speed": Harmonics(44.0, [10.0], [30.0], [0.3])}, 2.0, 3.0),
    "motor": ({"torque": InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=50.0)}, 1.0, 2.0),
}


@pytest.mark.parametrize("case", ORDERS)
def test_linear_inputs_are_one_order_better(natives: dict[str, Path], case: str) -> None:
    channels, *orders = ORDERS[case]
    inputs = Inputs(**channels)
    right = simulate(TABLE_3_1, inputs, stop_time=0.2, step=0.2, tolerance=1e-12)
    for interface, order in zip(("co-simulation", "linear-co-simulation"), orders):
        errors = []
        for step in (1e-3, 5e-4, 2.5e-4):
            run = cosimulate(
                natives["FiveBarSlider-native"], TABLE_3_1, inputs, stop_time=0.2, step=step, tolerance=1e-12,
                interface=interface,
            )  # fmt: skip
            errors.append(max(abs(run[name][-1] - right[name][-1]) for name in ("slider.position", "crank.angle")))
        measured = np.polyfit(np.log([4.0, 2.0, 1.0]), np.log(errors), 1)[0]
        assert measured == pytest.approx(order, abs=0.15)


def test_interfaces_that_an_fmu_has_not(natives: dict[str, Path], five_bar: Path) -> None:
    def run(fmu: Path, interface: str) -> None:
        cosimulate(fmu, TABLE_3_1, Inputs(speed=44.0), stop_time=0.01, interface=interface)

    with pytest.raises(CosimulationError, match=r"native-fmi3\.fmu does not take inputs that are linear over a step"):
        run(natives["FiveBarSlider-native-fmi3"], "linear-co-simulation")
    with pytest.raises(InputError, match=r"no interface 'both' \(the names are co-simulation, linear-co-simulation"):
        run(natives["FiveBarSlider-native"], "both")
    found = run_in_process(without_exchange, ROOT, five_bar)
    assert "is not a FiveBarSlider for model exchange, which these parameters need, but FiveBarSlider" in found


def without_exchange(root: str, fmu: str) -> str:
    """The error of model exchange with a Python FMU."""
    import sys

    sys.path.insert(0, root)
    from analysis import CosimulationError, Inputs, cosimulate
    from linkwork.five_bar.published import TABLE_3_1

    try:
        cosimulate(fmu, TABLE_3_1, Inputs(speed=44.0), stop_time=0.01, interface="model-exchange")
    except CosimulationError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("file", ["FiveBarSlider-native", "FiveBarSlider-native-fmi3"])
def test_native_fmus_run_from_folders_of_any_name(
    natives: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    folder = tmp_path / "M\u00fcller (1) # %41 & co"
    folder.mkdir()
    used = []
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setattr("analysis.run.fmu.extract", lambda fmu, to: (used.append(Path(to).parent), extract(fmu, to)))
    run = cosimulate(natives[file], TABLE_3_1, Inputs(speed=44.0), stop_time=0.01)
    assert len(run) == 11
    assert used == [folder]
    assert not list(folder.iterdir())


def test_model_exchange_ends_at_the_limit_of_assembly(natives: dict[str, Path]) -> None:
    slips = replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=10.0)
    options = {"stop_time": 3.0, "step": 0.01, "tolerance": 1e-11}
    within = simulate(slips, Inputs(speed=44.0), **options)
    for kind in ("native", "native-fmi3"):
        fmu = natives[f"FiveBarSlider-{kind}"]
        run = cosimulate(fmu, slips, Inputs(speed=44.0), interface="model-exchange", **options)
        assert run.status == within.status == 3
        assert run.message == within.message
        assert run.time[-1] == pytest.approx(within.time[-1], abs=1e-9)
        np.testing.assert_array_equal(run.time[:-1], within.time[:-1])


@pytest.mark.parametrize("file", ["FiveBarSlider-native", "FiveBarSlider-native-fmi3"])
def test_a_command_that_is_not_finite_does_not_reach_the_state(
    natives: dict[str, Path], tmp_path: Path, file: str
) -> None:
    instance = Library(natives[file], tmp_path / "library").instance("me").start(drive__speed=44.0)
    states = instance.states()
    assert put(instance, {"drive.speed": nan}) == OK
    assert instance.discrete() == (False, False)
    assert instance.states() == states
    assert instance.status() == 2
    assert put(instance, {"drive.speed": 45.0}) == OK
    assert instance.discrete() == (False, True)
    assert instance.status() == 0
    assert instance.get("crank.speed") == [45.0]
    assert np.isfinite(instance.states()).all()


def test_inputs_that_fail_under_cvode_are_named(natives: dict[str, Path]) -> None:
    def run(function: Any) -> None:
        inputs = Inputs(speed=44.0, force=Function(function))
        cosimulate(natives["FiveBarSlider-native"], TABLE_3_1, inputs, stop_time=0.1, interface="model-exchange")

    with pytest.raises(InputError, match=r"the input force is not a finite number at t = 0\.05"):
        run(lambda t, *x: nan if t > 0.05 else 1.0)
    with pytest.raises(ZeroDivisionError):
        run(lambda t, *x: 1.0 / 0.0 if t > 0.05 else 1.0)


# Saved states and resets


def in_steps(instance: Instance, first: int, last: int) -> list[list[float]]:
    """All that is computed, after each of some steps under inputs that move."""
    references = instance.library.references
    force = next(name for name in ("slider.force", "slider.load", "cart.force", "drive.torque") if name in references)
    command = "drive.speed" if "drive.speed" in references else "drive.torque"
    names = [
        name for name in references if not name.startswith(("solver.", "assembly.branch")) and name[-5:] != ".mode"
    ]
    rows = []
    for n in range(first, last):
        assert put(instance, {force: 3.0 * n, command: 20.0 + n}) == OK
        assert instance.step(n * 1e-3, 1e-3) == OK
        rows.append(instance.get(*names))
    return rows


def continued(root: str, fmu: str, folder: str, text: str) -> list[list[float]]:
    """The run of another process, taken up from its saved state."""
    import sys
    from pathlib import Path

    sys.path.insert(0, root)
    from tests.fmu.native import Library
    from tests.fmu.test_agreement import in_steps
    from tests.fmu.test_native_runs import restored

    instance = Library(Path(fmu), Path(folder)).instance()
    assert restored(instance, bytes.fromhex(text)) == 0
    return in_steps(instance, 5, 10)


EVERY = [f"{fmu}-{kind}" for fmu in MECHANISMS for kind in ("native", "native-fmi3")]


@pytest.mark.parametrize("file", EVERY)
def test_states_and_resets_bit_for_bit(file: str, natives: dict[str, Path], tmp_path: Path) -> None:
    library = Library(natives[file], tmp_path / "here")
    for seed in range(3):
        case = drawn(file.partition("-")[0], seed)
        one, other = library.instance(), library.instance()
        attempts = []
        for _ in range(2):
            assert put(one, case.values) == OK
            one.start()
            rows = in_steps(one, 0, 5)
            state = one.saved()
            attempts.append(rows + in_steps(one, 5, 10))
            assert one("Reset") == OK
        assert attempts[0] == attempts[1]
        rows = attempts[0]
        # another instance of the same library, one that was used before
        other.start()
        in_steps(other, 0, 3)
        text = serialized(other, state)
        assert restored(other, text) == OK
        assert in_steps(other, 5, 10) == rows[5:]
        if seed == 0:
            found = run_in_process(continued, ROOT, natives[file], tmp_path / "there", text.hex())
            assert found == rows[5:]


def test_states_of_another_kind_are_refused(natives: dict[str, Path], tmp_path: Path) -> None:
    libraries = {name: Library(natives[name], tmp_path / name) for name in EVERY}
    texts = {}
    for name, library in libraries.items():
        instance = library.instance().start()
        texts[name] = serialized(instance, instance.saved())
    for name, library in libraries.items():
        for of, text in texts.items():
            instance = library.instance().start()
            assert restored(instance, text) == (OK if of == name else ERROR)
    # and of the other interface, also before the initialisation
    for name, library in libraries.items():
        exchange = library.instance("me").start()
        assert restored(exchange, texts[name]) == ERROR
        assert restored(library.instance().start(), serialized(exchange, exchange.saved())) == ERROR
        begun = library.instance()
        assert restored(library.instance("me"), serialized(begun, begun.saved())) == ERROR
        assert exchange("EnterContinuousTimeMode") == OK
