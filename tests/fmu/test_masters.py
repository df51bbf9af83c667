"""Every master runs the same case to the same end, with each kind of FMU that it takes, and lives through a refused step.

A master that cannot be imported is skipped, unless the environment variable LINKWORK_ALL_MASTERS is set, as it is where
the whole project is checked.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.scripts import called

from . import masters
from .bare_master import Fmu
from .c_host import compile_host, python_path, run_host, unpack
from .models import Model
from .runner import run_in_process
from .test_description import ROWS

#: What has to be installed for each master, and how that is tried.
NEEDS = {
    "fmpy": ("the package FMPy", "import fmpy"),
    "wasmtime": ("wasmtime", "import wasmtime.component"),
    "libcosimpy": ("the package libcosimpy", "import libcosimpy"),
    "ecospy": ("the package ecospy and the library libtbb.so.12 (Debian: apt-get install libtbb12)", "import ecospy"),
    "cofmupy": (
        "the packages that `make` installs in a folder of their own",
        "import sys; sys.path.insert(0, f'{sys.prefix}/cofmupy'); import cofmupy",
    ),
    "pathsim": ("the package pathsim-fmi", "import pathsim_fmi.blocks"),
    "host": ("the package ziglang", "import ziglang"),
}
OUTPUTS = {
    model: [name for name, causality, kind, *_ in rows if causality == "output" and kind == "Real"]
    for model, rows in ROWS.items()
}


class Case(NamedTuple):
    """A run of 100 steps of 1 ms: parameters and inputs at the start, and an input that changes after half of it.

    ``shown`` is an output of which that makes a difference, ``too_much`` a value that ends in the limit of assembly in the
    second step after it is set, at 0.051 s.
    """

    reals: dict[str, float]
    integers: dict[str, int]
    changed: str
    later: float
    shown: str
    too_much: float


CASES = {
    "FiveBarSlider": Case(
        {
            "slider.damping": 25.0, "slider.coulomb_friction": 0.3, "coupler.point_distance": 0.07,
            "initial.crank_speed": 30.0, "drive.torque": 0.3, "slider.force": 0.5,
        },
        {"drive.mode": 0}, "slider.force", 2.0, "slider.position", 1e5,
    ),
    "SliderCrank": Case(
        {
            "guide.twist": 4.4, "slider.damping": 25.0, "slider.coulomb_friction": 0.3, "shift.stiffness": 500.0,
            "gravity.y": -9.81, "initial.crank_speed": 30.0, "drive.torque": 3.0, "axial.force": 0.5, "slider.load": 4.0,
        },
        {"drive.mode": 0, "axial.mode": 0}, "axial.force", 2.0, "shift.position", 2e7,
    ),
}  # fmt: skip


#: For masters that set Reals alone: the modes are those at the start, in which speeds are commanded.
COMMANDED = {
    name: case._replace(
        reals={key: value for key, value in case.reals.items() if key != "initial.crank_speed"} | {"drive.speed": 30.0},
        integers={},
    )
    for name, case in CASES.items()
}
COMMANDED["SliderCrank"] = COMMANDED["SliderCrank"]._replace(
    changed="slider.load", later=8.0, shown="drive.applied_torque", too_much=0.0,
)  # fmt: skip

ALL = ("python", "native", "native-fmi3")
NATIVE = ALL[1:]
FMI2 = ALL[:2]
STEPS, STATES = "CoSimulation", "ModelExchange"


class Row(NamedTuple):
    """A master with a kind of FMU by an interface; ``commanded``: it cannot set the modes.

    ``refused`` is what it ends with after a step that is refused, or at the limit of assembly in model exchange: the time,
    `solver.status`, and a part of what it says, each None where it tells nothing.
    """

    master: str
    kind: str
    interface: str = STEPS
    commanded: bool = False
    refused: tuple[float | None, int | None, str | None] = (0.051, 3, None)


SENTENCE = "in the step from t = 0.051 s: limit of assembly at crank angle"
DISCARD = "DoStep failed with status 2 (discard)"
#: FMPy ends a run of FMI 2.0 without a word: only the status in its last row says that it was not the end. libcosim reports
#: failure and reads nothing more: the status is that of the last good step. ecos overlooks the refusal and goes on to the end:
#: status and message alone tell, with the first cause; it reads no strings of FMI 3.0. CoFMUPy sets no integers,
#: PathSim none of FMI 3.0, where it takes them all for 64 bits wide. libcosim ends its process on an FMU of FMI 3.0.
TABLE = [
    *(Row("fmpy", kind, refused=(0.051, 3, SENTENCE)) for kind in FMI2),
    Row("fmpy", "native-fmi3", refused=(None, None, SENTENCE)),
    *(Row("fmpy", kind, STATES, refused=(None, 0, "the motion has reached the limit of assembly")) for kind in NATIVE),
    *(Row("libcosimpy", kind, refused=(0.051, 0, "the step failed")) for kind in FMI2),
    *(Row("ecospy", kind, refused=(0.1, 3, "a step over a gap: it starts at t = 0.099 s")) for kind in FMI2),
    Row("ecospy", "native-fmi3", refused=(0.1, 3, None)),
    *(Row("cofmupy", kind, commanded=True, refused=(0.051, 3, DISCARD)) for kind in ALL),
    *(Row("pathsim", kind, commanded=kind == "native-fmi3", refused=(0.051, 3, DISCARD)) for kind in ALL),
    *(
        Row("pathsim", kind, STATES, kind == "native-fmi3", (None, 3, "FMU requested simulation termination"))
        for kind in NATIVE
    ),
    *(Row("host", kind, refused=(0.051, None, SENTENCE)) for kind in ALL),
    *(Row("host", kind, STATES, refused=(None, None, "the equations are not defined")) for kind in NATIVE),
]
#: Masters that take seconds to start.
SLOW = ("cofmupy", "pathsim")
each_row = pytest.mark.parametrize(
    "row",
    [pytest.param(row, marks=pytest.mark.slow if row.master in SLOW else ()) for row in TABLE],
    ids=lambda row: "-".join((row.master, row.kind, row.interface)),
)


@cache
def missing(master: str) -> str:
    """Why a master cannot be imported; empty if it can."""
    what, attempt = NEEDS[master]
    done = subprocess.run([sys.executable, "-c", attempt], capture_output=True, text=True, timeout=60, check=False)
    if done.returncode == 0:
        return ""
    return f"{master} cannot be imported; it needs {what}: {done.stderr.strip().splitlines()[-1]}"


def need(master: str) -> None:
    """Skip where a master cannot be imported, or fail where all have to be."""
    if message := missing(master):
        if os.environ.get("LINKWORK_ALL_MASTERS"):
            pytest.fail(message)
        pytest.skip(message)


def case_of(row: Row, model: Model) -> Case:
    """The case that a master runs."""
    return (COMMANDED if row.commanded else CASES)[model.name]


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The master in C."""
    return compile_host(tmp_path_factory.mktemp("host"))


@pytest.fixture
def run(
    fmus: dict[str, Path], natives: dict[str, Path], host: Path, model: Model, tmp_path: Path
) -> Callable[..., dict[str, Any]]:
    """Runs the model's case, with changes, by a master."""

    def of(row: Row, **changes: Any) -> dict[str, Any]:
        need(row.master)
        case = case_of(row, model)._replace(**changes)
        fmu = fmus[model.name] if row.kind == "python" else natives[f"{model.name}-{row.kind}"]
        if row.master != "host":
            by = getattr(masters, f"by_{row.master}")
            return run_in_process(by, fmu, list(case[:4]), OUTPUTS[model.name], row.interface)
        there = python_path() if row.kind == "python" else {}
        interface = "me" if row.interface == STATES else "cs"
        start, change = case.reals | case.integers, (case.changed, case.later, 50)
        found = run_host(host, unpack(fmu, tmp_path), start, change=change, interface=interface, environment=there)
        assert found["python"] is (row.kind == "python"), "Python is in the process of the master in C"
        return found | {"said": [found["logged"]]}

    return of


def by_hand(
    fmu: str, folder: str, reals: dict[str, float], integers: dict[str, int], changed: str, later: float
) -> Any:
    """The case step by step: 50 of 1 ms, the input changed, 50 more."""
    instance = Fmu(fmu, folder).instantiate().start(reals | integers)
    for k in range(100):
        if k == 50:
            instance.set(changed, later)
        if instance.step(k * 1e-3, 1e-3):
            break
    return [instance.outputs(), instance.trouble()]


@pytest.fixture(scope="module")
def ends(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """The last good outputs of a model's case run by hand, to its end or to the limit of assembly, and the trouble then."""

    @cache
    def of(model: str, *, commanded: bool = False, too_far: bool = False) -> Any:
        case = (COMMANDED if commanded else CASES)[model]
        case = case._replace(later=case.too_much) if too_far else case
        end, trouble = run_in_process(by_hand, fmus[model], tmp_path_factory.mktemp("run"), *case[:4])
        assert trouble[0] == (3 if too_far else 0)
        assert trouble[1].startswith(SENTENCE if too_far else "")
        return end

    return of


#: Outputs of which the last digits are those of sums of far greater ones: forces, moments, accelerations, and the balance of
#: the slider-crank's hundreds of joules.
SUMS = {
    "FiveBarSlider": ("pin.", "acceleration", "guide_force"),
    "SliderCrank": ("acceleration", "guide.", "bearing.", "crank_pin.f", "slider_pin.f", "applied_force", "residual"),
}  # fmt: skip


#: The same algorithm in the same language; in C; other algorithms at their own tolerances.
CLOSE = {(STEPS, "python"): 1e-12, (STEPS, "native"): 1e-9, (STEPS, "native-fmi3"): 1e-9}


@each_row
def test_same_end_values(run: Callable[..., dict[str, Any]], ends: Callable[..., Any], model: Model, row: Row) -> None:
    found = run(row)
    expected = ends(model.name, commanded=row.commanded)
    assert found.get("status", 0) == 0
    assert found["time"] == pytest.approx(0.1, abs=1e-12)
    assert list(found["end"]) == list(expected) == OUTPUTS[model.name]
    close = CLOSE.get((row.interface, row.kind), 1e-6)
    for name, value in expected.items():
        scale = 1e2 if any(part in name for part in SUMS[model.name]) else 1.0
        assert found["end"][name] == pytest.approx(value, rel=close, abs=close * scale), name


@pytest.mark.parametrize("table", [CASES, COMMANDED], ids=["free", "commanded"])
def test_parameters_and_inputs_arrive(
    fmu: Path, model: Model, tmp_path: Path, ends: Callable[..., Any], table: dict[str, Case]
) -> None:
    # that the masters agree says something only if what they set makes a difference
    case = table[model.name]
    expected = ends(model.name, commanded=table is COMMANDED)
    for name in case.reals:
        changed = case._replace(reals=case.reals | {name: case.reals[name] * 1.1})
        end, _ = run_in_process(by_hand, fmu, tmp_path / name, *changed[:4])
        # where speeds are commanded, the torques and forces that are inputs do nothing
        assert (end != expected) is not (table is COMMANDED and name in ("drive.torque", "axial.force")), name
    end, _ = run_in_process(by_hand, fmu, tmp_path / "later", *case._replace(later=case.later * 1.1)[:4])
    assert end[case.shown] != expected[case.shown]


@each_row
def test_refused_step(run: Callable[..., dict[str, Any]], ends: Callable[..., Any], model: Model, row: Row) -> None:
    case = case_of(row, model)
    if not case.too_much:
        pytest.skip("where both speeds are commanded, nothing leads to the limit of assembly")
    found = run(row, later=case.too_much)
    time, status, words = row.refused
    if row.interface == STATES:
        # in the second step: where it is located, or where the last good step ends
        assert 0.051 <= found["time"] < 0.052
    elif time is not None:
        assert found["time"] == pytest.approx(time)
        last_good = ends(model.name, commanded=row.commanded, too_far=True)
        assert found["end"][case.shown] == pytest.approx(last_good[case.shown], rel=1e-9)
    if status is not None:
        assert found["status"] == status
    if words is not None:
        assert any(words in said for said in found["said"])


def test_libcosim_ends_its_process_on_fmi_3(natives: dict[str, Path], model: Model) -> None:
    # it is for FMI 1.0 and 2.0: what a version of it that reads FMI 3.0 does belongs in the table
    need("libcosimpy")
    fmu, case = natives[f"{model.name}-native-fmi3"], list(CASES[model.name][:4])
    with pytest.raises(AssertionError, match="by_libcosimpy ended with -"):
        run_in_process(masters.by_libcosimpy, fmu, case, OUTPUTS[model.name], STEPS)


def bad_by_fmpy(fmu: str, reals: dict[str, float]) -> list[Any]:
    """Initialisations that fail by FMPy, and a good run after them."""
    from fmpy import simulate_fmu
    from fmpy.fmi1 import FMICallException

    said: list[str] = []
    for _ in range(5):
        try:
            simulate_fmu(
                fmu,
                stop_time=0.01,
                start_values=reals,
                debug_logging=True,
                logger=lambda environment, instance, status, category, message: said.append(message.decode()),
            )
        except FMICallException as error:
            last = str(error)
    return [last, said, len(simulate_fmu(fmu, stop_time=0.01, step_size=1e-3, output_interval=1e-3))]


def test_bad_parameter_under_fmpy(fmu: Path) -> None:
    error, said, rows = run_in_process(bad_by_fmpy, fmu, {"slider.damping": -1.0})
    assert "fmi2ExitInitializationMode" in error
    sentence = "parameter slider.damping is -1.0: it must be a finite number, zero or greater"
    assert said.count(sentence) == 5
    assert rows == 11


@pytest.mark.parametrize("kind", FMI2)
def test_bad_parameter_under_ecospy(run: Callable[..., dict[str, Any]], model: Model, kind: str) -> None:
    # ecos overlooks this as well: every read has to be survived, and the sentence is there to be read
    found = run(Row("ecospy", kind), reals=CASES[model.name].reals | {"slider.damping": -1.0})
    assert found["status"] == 6
    assert "parameter slider.damping is -1" in found["said"][0]


@pytest.mark.parametrize("kind", FMI2)
def test_bad_parameter_under_libcosimpy(run: Callable[..., dict[str, Any]], model: Model, kind: str) -> None:
    # libcosim itself ends the process on a failed initialisation, but not before the sentence is in its log
    with pytest.raises(AssertionError, match=r"parameter slider\.damping is -1(\.0)?: it must be"):
        run(Row("libcosimpy", kind), reals=CASES[model.name].reals | {"slider.damping": -1.0})


PAGE = Path(__file__).parents[2] / "docs" / "masters.md"
#: Which section of the page is of which master.
SECTIONS = {
    "FMPy": "fmpy", "WebAssembly runtimes": "wasmtime", "libcosim": "libcosimpy", "ecos": "ecospy",
    "CoFMUPy": "cofmupy", "PathSim": "pathsim",
}  # fmt: skip


@pytest.mark.parametrize("section", SECTIONS)
def test_the_code_of_the_page_runs(natives: dict[str, Path], tmp_path: Path, section: str) -> None:
    need(SECTIONS[section])
    found = re.search(rf"^## {section}: tried$(.*?)^## ", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    code = "\n".join(re.findall(r"```python\n(.*?)```", found.group(1), flags=re.DOTALL))
    (tmp_path / "build").mkdir()
    for name in ("FiveBarSlider-native", "FiveBarSlider-native-fmi3"):
        shutil.copy2(natives[name], tmp_path / "build" / f"{name}.fmu")
    called(sys.executable, "-c", code, cwd=tmp_path, timeout=120.0)


def test_the_page_says_of_every_master_whether_it_was_tried() -> None:
    page = PAGE.read_text(encoding="utf-8")
    stated = dict(re.findall(r"^\| ([\w ]+?)(?: \d.*?| \(.*?)? \| (tried|untried) \|", page, flags=re.MULTILINE))
    sections = dict(re.findall(r"^## (.*): (tried|untried)$", page, flags=re.MULTILINE))
    assert {name.lower(): tried for name, tried in stated.items()} == {n.lower(): t for n, t in sections.items()}
    assert {name for name, tried in sections.items() if tried == "tried"} == {*SECTIONS, "A host in C"}
