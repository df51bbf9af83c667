"""The C of native FMUs under GCC's instruments: the tests of native FMUs run on it in a process of their own.

Every line and every branch of the shell is reached, or it says here why it is not; no access outside of what is allocated and
no undefined behaviour is found on the way.
"""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

from analysis.export import NATIVE, NATIVE_FMI3, build_native
from analysis.export.native_fmu import source_files
from tests.scripts import called

from ..conftest import NATIVE_MECHANISMS

ROOT = Path(__file__).resolve().parents[2]
SHELL = ROOT / "fmu_src" / "native"
#: The tests that call native FMUs function by function.
TESTS = (
    "test_native_calls.py",
    "test_native_runs.py",
    "test_derivatives.py",
    "test_agreement.py::test_states_of_another_kind_are_refused",
    "test_agreement.py::test_a_command_that_is_not_finite_does_not_reach_the_state",
)

#: Lines that no test reaches, and lines with a branch that none takes, by a part of their text: why.
NOT_REACHED = {
    "/* NO_HEAP */": "the FMUs of the tests are compiled with a heap; tests/systems/test_realtime.py has a host without",
    "if (stage < STAGES && !slope(": "the slope of a plant is always defined, a turn of the browser's may not be",
    "if (isnan(fall))": "a thousandth of a step leads beyond the limit in linkages with far higher ratios only",
    "command->mode < 0 ||": "no mechanism of the tests has a command that is always in force",
    "i < FREEDOMS && end < SENTENCE": "no mechanism has so many freedoms that a sentence overflows",
    "blame_extreme(": "parameters of at most 1e75 give finite constants; those of described linkages may have higher powers",
}

#: The same on machines without a locale that has a decimal comma.
NOT_EVERYWHERE = {"if (*c == ',')", "*c = '.';"}


class Line(NamedTuple):
    """A line of the shell that was not reached, or a branch at its end that was not taken."""

    file: str
    number: int
    text: str


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("gcov")), reason="GCC and its gcov are not installed"),
]


def instrumented(folder: Path, *flags: str) -> Path:
    """Native FMUs with libraries compiled by GCC with flags; their objects are in folders beside them."""
    fmus = folder / "fmus"
    for mechanism in NATIVE_MECHANISMS:
        for kind in (NATIVE, NATIVE_FMI3):
            fmu = build_native(mechanism, kind, fmus)
            objects = folder / fmu.stem
            objects.mkdir()
            sources = source_files(mechanism, kind)
            for name, text in sources.items():
                (objects / name).write_text(text, encoding="utf-8")
            library = f"{kind.identifier(mechanism)}.so"
            always = ["-std=c11", "-ffp-contract=off", "-shared", "-fPIC"]
            subprocess.run(["gcc", *always, *flags, "-o", library, "all.c", "-lm"], cwd=objects, check=True)
            with zipfile.ZipFile(fmu) as archive:
                entries = {name: archive.read(name) for name in archive.namelist()}
            with zipfile.ZipFile(fmu, "w") as archive:
                for name, content in entries.items():
                    archive.writestr(name, (objects / library).read_bytes() if name.endswith(".so") else content)
    return fmus


def counted(folder: Path) -> tuple[dict[Line, int], dict[tuple[Line, int], int]]:
    """How often each line and each branch of the shell was executed, in all libraries together."""
    lines: dict[Line, int] = {}
    branches: dict[tuple[Line, int], int] = {}
    texts = {path.name: path.read_text(encoding="utf-8").splitlines() for path in SHELL.glob("*.[ch]")}
    for data in folder.glob("*/*.gcda"):
        report = called("gcov", "--json-format", "--stdout", "--branch-probabilities", data.name, cwd=data.parent)
        for document in report.splitlines():
            for file in json.loads(document)["files"]:
                name = Path(file["file"]).name
                for line in file["lines"] if name in texts else ():
                    at = Line(name, line["line_number"], texts[name][line["line_number"] - 1].strip())
                    lines[at] = lines.get(at, 0) + line["count"]
                    for number, branch in enumerate(line["branches"]):
                        key = (at, number)
                        branches[key] = branches.get(key, 0) + branch["count"]
    return lines, branches


def run_tests(fmus: Path, **environment: str) -> None:
    """Run the tests of native FMUs on the FMUs of a folder."""
    tests = [f"tests/fmu/{name}" for name in TESTS]
    there = os.environ | environment | {"LINKWORK_NATIVE_FMUS": str(fmus)}
    called(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests, cwd=ROOT, env=there, timeout=7200.0)


def test_every_line_and_branch_of_the_shell_is_reached(tmp_path: Path) -> None:
    run_tests(instrumented(tmp_path, "-O0", "--coverage"))
    lines, branches = counted(tmp_path)
    assert len(lines) > 700
    missed = {line for line, count in lines.items() if count == 0}
    missed |= {line for (line, _), count in branches.items() if count == 0}
    known = (*NOT_REACHED, *NOT_EVERYWHERE)
    shell = (SHELL / "plant.c").read_text(encoding="utf-8").splitlines()
    first = next(number for number, text in enumerate(shell, 1) if "Reason blame_extreme(" in text)
    unused = {("plant.c", number) for number in range(first, shell.index("}", first) + 2)}
    left = {line for line in missed if (line.file, line.number) not in unused}
    assert sorted(line for line in left if not any(part in line.text for part in known)) == []
    assert [part for part in NOT_REACHED if not any(part in line.text for line in missed)] == [], "reached now"


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """Native FMUs under the sanitizers, and the environment that a Python needs to load them."""
    runtime = called("gcc", "-print-file-name=libasan.so").strip()
    if not Path(runtime).is_absolute():
        pytest.skip("GCC has no runtime of its AddressSanitizer here")
    flags = ("-O1", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    # Python itself keeps memory to the end; and what is freed is not kept back, for the probe measures memory
    options = "detect_leaks=0:quarantine_size_mb=0:thread_local_quarantine_size_kb=0"
    folder = tmp_path_factory.mktemp("sanitized")
    return instrumented(folder, *flags), {"LD_PRELOAD": runtime, "ASAN_OPTIONS": options}


def test_sanitizers_find_nothing_in_the_tests(sanitized: tuple[Path, dict[str, str]]) -> None:
    fmus, environment = sanitized
    run_tests(fmus, **environment)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("name", "calls"),  # of each interface
    [
        ("FiveBarSlider-native-fmi3", 50_000),
        pytest.param("FiveBarSlider-native", 500_000, marks=pytest.mark.long),
        pytest.param("FiveBarSlider-native-fmi3", 500_000, marks=pytest.mark.long),
    ],
)
def test_sanitizers_and_probe_find_nothing_in_many_calls(
    sanitized: tuple[Path, dict[str, str]], name: str, calls: int
) -> None:
    fmus, environment = sanitized
    command = (sys.executable, "-m", "analysis.cli", "probe", fmus / f"{name}.fmu", "--calls", calls)
    called(*command, "--time", "1500", "--strict", cwd=ROOT, env=os.environ | environment, timeout=1800.0)
