"""A system as one C program: the numbers of the Python master, no heap, times and deadlines."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import benchmarks.realtime
from analysis.export import this_platform
from analysis.systems import System, Wiring, WiringError, build_host, library, run_system, write_host
from analysis.systems.description import PartTable
from analysis.systems.embedded import OPTIONS
from analysis.systems.wiring import End
from benchmarks.realtime import PERCENTILES, RATES, run_host
from linkwork.errors import ParameterError

from ..scripts import called
from .conftest import system_of, wiring_of

pytestmark = [
    pytest.mark.fmu,
    pytest.mark.skipif(not this_platform().endswith("linux"), reason="the host goes by the clock of Linux"),
]


@pytest.fixture(scope="module")
def tracking(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program of the motor, the linkage and their controllers."""
    return build_host(wiring_of("motor-tracking"), tmp_path_factory.mktemp("host"))


def check_same(found: dict[str, float], wiring: Wiring) -> None:
    """Compare the end of a run of the program with that of the Python master."""
    run = run_system(wiring, step=found["step_s"], stop_time=found["steps"] * found["step_s"])
    assert run.status == 0
    assert run.connected
    for name in run.connected:
        assert found[name] == pytest.approx(run[name][-1], abs=1e-9 * np.abs(run[name]).max()), name


def test_the_numbers_are_those_of_the_python_master(tracking: Path) -> None:
    wiring = wiring_of("motor-tracking")
    for steps, rate in ((1, None), (1000, None), (300, RATES[0]), (300, RATES[1])):
        found = run_host(tracking, steps, rate)
        assert (found["steps"], found["step_s"]) == (steps, wiring.step if rate is None else 1.0 / rate)
        check_same(found, wiring)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*library()} - {"motor-tracking"}))
def test_every_system_of_the_library_is_a_program(name: str, tmp_path: Path) -> None:
    check_same(run_host(build_host(wiring_of(name), tmp_path), 200), wiring_of(name))


def with_a_table(values: dict[str, Any]) -> System:
    """The system slider-tracking, with a table for its feed-forward."""
    system = system_of("slider-tracking")
    parts = {**system.parts, "table": PartTable(controller="force-table", values=values)}
    ends = {
        End("table", "angle"): End("linkage", "crank.angle"),
        End("controller", "feed_forward"): End("table", "force"),
    }
    return replace(system, parts=parts, connections={**system.connections, **ends})


def test_a_table_as_feed_forward_is_a_list_and_is_the_same_in_c(tmp_path: Path) -> None:
    series = wiring_of("slider-tracking").parts["reference"].values
    degrees = np.arange(0.0, 360.0, 5.0)
    terms = [(n, kind, of) for n in range(1, 7) for kind, of in (("cos", np.cos), ("sin", np.sin))]
    forces = sum(series.get(f"load_{kind}_{n}", 0.0) * of(n * np.radians(degrees)) for n, kind, of in terms)
    table = [f"{force + series['load_0']} N" for force in forces]
    wiring = with_a_table({"sample_time": "0.5 ms", "table": table}).wiring()
    check_same(run_host(build_host(wiring, tmp_path), 2000), wiring)
    # the table is the series but for what straight lines cut off, so that the slider goes as well
    runs = [run_system(w, step=1e-3) for w in (wiring, wiring_of("slider-tracking"))]
    errors = [np.abs(run["controller.error"])[run.time > 0.5].max() for run in runs]
    assert errors[0] < 1.1 * errors[1]
    with pytest.raises(ParameterError, match=r"71 values.*must have 72"):
        with_a_table({"table": ["0 N"] * 71}).wiring()


@pytest.mark.slow
def test_harmonics_loads_and_the_integral_are_the_same_in_c(tmp_path: Path) -> None:
    """All parameters of the two controllers: every harmonic, the force as feed-forward, integral, filter and limit."""
    system = system_of("slider-tracking")
    series = {
        f"{name}_{kind}_{n}": size * (-0.6) ** n
        for name, size in (("motion", 2e-3), ("load", 3.0))
        for kind in ("cos", "sin")
        for n in range(1, 7)
    }
    gains = {"integral_gain": 4e4, "filter_time": 1e-3, "tracking_time": 0.05, "limit": 60.0}
    values = {"reference": series | {"load_0": 2.0}, "controller": gains}
    parts = {
        name: replace(table, values={**table.values, **values.get(name, {})}) for name, table in system.parts.items()
    }
    wiring = replace(system, parts=parts).wiring()
    found = run_host(build_host(wiring, tmp_path), 400)
    check_same(found, wiring)
    limits = run_system(wiring, stop_time=400 * wiring.step)["controller.force"]
    assert np.abs(limits).max() == 60.0
    assert np.ptp(limits) > 60.0


def test_there_is_no_heap_in_the_program(tracking: Path) -> None:
    """Not one allocator of the C library is linked, and the pool does not grow in the steps."""
    names = {line.split()[-1] for line in called("nm", tracking).splitlines()}
    assert {"main", "allocate", "InductionMotor_native_fmi2DoStep", "FiveBarSlider_native_fmi2DoStep"} <= names
    assert not names & {"malloc", "calloc", "realloc", "free", "aligned_alloc", "__libc_malloc", "mmap", "brk", "sbrk"}
    found = run_host(tracking, 2000)
    assert found["pool_bytes"] > 1000
    assert found["pool_bytes_in_steps"] == 0


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("gcc"), reason="GCC is not installed")
def test_another_compiler_has_no_warnings_and_without_no_heap_would_need_one(tmp_path: Path) -> None:
    files = write_host(wiring_of("motor-tracking"), tmp_path)
    # GCC sees that long sentences are cut, as they are to be
    options = [*(option for option in OPTIONS if "sanitize" not in option), "-Wno-format-truncation"]
    assert {"-std=c11", "-Wall", "-Wextra", "-Werror", "-DNO_HEAP"} <= set(options)

    def needed(*given: str) -> set[str]:
        called("gcc", *given, "-c", *files, cwd=tmp_path)
        objects = [Path(name).with_suffix(".o") for name in files]
        printed = called("nm", "-u", *objects, cwd=tmp_path)
        return {line.split()[-1] for line in printed.splitlines() if line.startswith(" ")}

    heap = {"malloc", "calloc", "realloc", "free"}
    assert needed(*options) & heap == set()
    assert needed(*(option for option in options if option != "-DNO_HEAP")) & heap == {"calloc", "free"}


def test_times_and_deadlines(tracking: Path) -> None:
    found = run_host(tracking, 400, 2000)
    for what in ("step", "wake"):
        times = [found[f"{what}_us_{percentile}"] for percentile in PERCENTILES]
        assert times[0] > 0.0
        assert times == sorted(times)
    assert found["deadlines_missed"] < 400
    # steps of 0.1 microseconds cannot be kept: each is late, the last one by all steps before
    hurried = run_host(tracking, 400, 1e7)
    assert hurried["deadlines_missed"] == 400
    assert hurried["latest_us"] > 390 * (0.5 * hurried["step_us_median"] - 0.1)


@pytest.mark.parametrize(
    "words", [(), ("0",), ("10", "0"), ("10", "-5"), ("many",), ("12.5",), ("10k",), ("10", "2kHz")]
)
def test_wrong_words_are_refused(tracking: Path, words: tuple[str, ...]) -> None:
    done = subprocess.run([tracking, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "STEPS" in done.stderr


@pytest.mark.slow
def test_a_refused_step_ends_the_program_with_a_sentence(tmp_path: Path) -> None:
    system = system_of("motor-crank")
    torque = {"airGap.breakdown_torque": 1e70}
    parts = {**system.parts, "motor": replace(system.parts["motor"], values=torque)}
    host = build_host(replace(system, parts=parts).wiring(), tmp_path)
    done = subprocess.run([host, "1000"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    reason, end = done.stderr.splitlines()
    assert reason.startswith("motor: in the step from t = ")
    assert end.endswith("DoStep failed")


def test_what_cannot_be_one_program_is_refused(tmp_path: Path) -> None:
    servo = replace(system_of("motor-tracking"), parts={"servo": PartTable(controller="dc-servo")}, connections={})
    with pytest.raises(WiringError, match=r"servo: .* has no sources in C; controllers known to the host are Pid"):
        write_host(servo.wiring(), tmp_path)
    wiring = wiring_of("two-linkages")
    name, part = next((name, part) for name, part in wiring.parts.items() if "native" in part.fmu.stem)
    other = replace(part, fmu=Path(shutil.copy(part.fmu, tmp_path)))
    with pytest.raises(WiringError, match=f"another: two different FMUs are named {part.fmu.stem.replace('-', '_')}"):
        write_host(replace(wiring, parts={name: part, "another": other}, connections={}), tmp_path)


@pytest.mark.slow
def test_the_benchmark(capsys: pytest.CaptureFixture[str]) -> None:
    benchmarks.realtime.main(["--steps", "2000", "--seconds", "0.2"])
    printed = capsys.readouterr().out
    said = ("as fast as possible", "1 kHz", "4 kHz", "missed", "times the median of the C program", "0 in the steps")
    assert all(what in printed for what in said)
