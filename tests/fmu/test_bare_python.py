"""The FMU runs on a Python with nothing installed, and on older and newer ones than that of the tests."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from analysis.export import SOURCES, python_fmu
from tests.scripts import called

from .bare_master import Fmu
from .models import each
from .runner import run_in_process

VALUES = {
    "FiveBarSlider": {
        "default": {},
        "torque drive": {"slider.damping": 25.0, "slider.coulomb_friction": 0.4, "drive.mode": 0, "drive.torque": 0.3},
    },
    "SliderCrank": {
        "default": {},
        "forces": {"slider.damping": 25.0, "shift.damping": 9.0, "drive.mode": 0, "axial.mode": 0, "axial.force": 7.0},
        "groove": {"axial.mode": 2, "groove.amplitude": 0.08, "groove.ratio": 2.0, "slider.coulomb_friction": 0.4},
    },
}


def run_bare(fmu: str, folder: str, values: dict[str, float], steps: int) -> list[list[float]]:
    """Outputs after each millisecond, by ctypes on the FMU's library."""
    import importlib.util

    # no import of these can have been hidden: nothing has been loaded yet
    installed = [name for name in ("pip", "numpy", "pythonfmu", "linkwork", "fmpy") if importlib.util.find_spec(name)]
    assert not installed, f"not a bare Python: {installed}"
    instance = Fmu(fmu, folder).instantiate().start(values)
    rows = [list(instance.outputs().values())]
    for k in range(steps):
        time, end = k * 1e-3, (k + 1) * 1e-3
        assert instance.step(time, end - time) == 0
        rows.append(list(instance.outputs().values()))
    assert instance.trouble() == [0, ""]
    assert instance.terminate() == 0
    instance.free()
    homes = (sys.prefix, sys.base_prefix, folder)
    files = [m.__file__ for m in list(sys.modules.values()) if getattr(m, "__file__", None)]
    strangers = [file for file in files if not file.startswith(homes) and "bare_master" not in file]
    assert [path for path in strangers if not path.endswith("script.py")] == []
    return rows


def run_fmpy(fmu: str, values: dict[str, float], steps: int) -> list[list[float]]:
    """The same by FMPy."""
    from fmpy import read_model_description, simulate_fmu

    variables = read_model_description(fmu).modelVariables
    outputs = [v.name for v in variables if v.causality == "output" and v.type == "Real"]
    times = {"stop_time": steps * 1e-3, "step_size": 1e-3, "output_interval": 1e-3}
    result = simulate_fmu(fmu, **times, start_values=values, output=outputs)
    return [[float(row[name]) for name in outputs] for row in result]


#: Versions of Python, the oldest that the FMUs run on and newer ones; each is looked for on the path and in pyenv.
OLDEST = ".".join(map(str, python_fmu.OLDEST))
VERSIONS = ["of the tests", OLDEST, "3.12", "3.13"]


def interpreter(version: str) -> str:
    """A Python of that version; the test is skipped where there is none."""
    if version == "of the tests":
        return sys.executable
    homes = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for found in (shutil.which(f"python{version}"), *sorted(homes.glob(f"{version}.*/bin/python"))):
        asked = [str(found), "-c", "import sys, venv; print('%d.%d' % sys.version_info[:2])"]
        if found and subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip() == version:
            return str(found)
    pytest.skip(f"there is no Python {version} on this machine")


@pytest.fixture(scope="module", params=VERSIONS)
def bare_python(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment without even pip."""
    folder = tmp_path_factory.mktemp("bare") / "venv"
    subprocess.run([interpreter(request.param), "-m", "venv", "--without-pip", str(folder)], check=True)
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


@each(VALUES, "values")
def test_same_values_as_through_fmpy_bit_for_bit(
    fmu: Path, tmp_path: Path, bare_python: Path, values: dict[str, Any]
) -> None:
    bare = run_in_process(run_bare, fmu, tmp_path, values, 100, python=bare_python, options=("-I", "-W", "error"))
    assert len(bare) == 101
    assert bare[0] != bare[-1]
    assert bare == run_in_process(run_fmpy, fmu, values, 100)


def instantiate_only(fmu: str, folder: str) -> str:
    """What an FMU says that cannot be instantiated."""
    try:
        Fmu(fmu, folder).instantiate()
    except RuntimeError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("version", ["3.8", "3.9"])
def test_older_python_is_refused_with_a_sentence(fmu: Path, tmp_path: Path, version: str) -> None:
    said = run_in_process(instantiate_only, fmu, tmp_path, python=interpreter(version), options=("-I",))
    assert f"{fmu.name} needs Python {OLDEST} or newer: this is {version}" in said


def test_sources_use_nothing_newer_than_the_oldest_python(tmp_path: Path) -> None:
    # where there is no such interpreter: syntax and the standard library's names, by the types of that version
    options = ["--python-version", OLDEST, "--cache-dir", str(tmp_path), "--config-file", ""]
    what = ["--ignore-missing-imports", "--package", "linkwork", "--module", "slave"]
    called(sys.executable, "-m", "mypy", *options, *what, cwd=SOURCES, env=os.environ | {"MYPYPATH": str(SOURCES)})
