"""Where an FMU can be unpacked, and what else in the wrapper ends the process: what docs/fmu.md says of it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

from analysis import CosimulationError
from analysis.export import run_trial
from analysis.run import cosimulation, unpacking_folder

from .runner import HERE, run_in_process

SAFE = ["plain", "with space", "dots.-_~09"]
FATAL = ["M\u00fcller", *(f"a{character}b" for character in "()#%+&@'")]

_CALL = """
import sys
sys.path.insert(0, sys.argv[1])
from ctypes import byref, c_char_p, c_size_t, c_uint, c_void_p
from bare_master import Fmu
fmu = Fmu(*sys.argv[2:4])
uri = (fmu.folder / "resources").as_uri()
"""

#: Calls that are good or that the wrapper accepts, and those that end the process.
LIVING = {
    "three slashes": "fmu.instantiate().start()",
    "the pointer to a freed state stays": "i = fmu.instantiate().start(); s = i.save(); i.free_state(s); assert s.value",
    "wrong GUID": "fmu.instantiate(guid='wrong').start()",
    "no string": """
i = fmu.instantiate().start()
i._call("SetString", (c_uint * 1)(fmu.variables["solver.message"].reference), c_size_t(1), (c_char_p * 1)(b"\\xff"))
i.free()
""",
}
CALLS = {
    **LIVING,
    "one slash": "fmu.instantiate(resources=uri.replace('file:///', 'file:/'))",
    "a host": "fmu.instantiate(resources=uri.replace('file:///', 'file://localhost/'))",
    "no state": "fmu.instantiate().start()._call('FreeFMUstate', c_void_p())",
}


def end_of(fmu: Path, folder: Path, call: str = CALLS["three slashes"]) -> int:
    """How a process ends that unpacks the FMU into the folder and makes the call."""
    done = subprocess.run(
        [sys.executable, "-c", _CALL + call, str(HERE), str(fmu), str(folder)],
        capture_output=True,
        timeout=60,
        check=False,
    )
    return done.returncode


@pytest.mark.skipif(sys.platform == "win32", reason="not every name can be given to a folder there")
@pytest.mark.parametrize("name", [*SAFE, *FATAL])
def test_names_of_folders(five_bar: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / name
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    # those that are avoided are those that end the process
    assert end_of(five_bar, folder) == (0 if name in SAFE else -11)
    assert (unpacking_folder() == str(folder)) == (name in SAFE)


@pytest.mark.skipif(sys.platform == "win32", reason="a crash has another code there")
@pytest.mark.parametrize("call", CALLS)
def test_calls_that_end_the_process(five_bar: Path, tmp_path: Path, call: str) -> None:
    assert (end_of(five_bar, tmp_path, CALLS[call]) < 0) == (call not in LIVING)


def cosimulate_in(fmu: str, root: str, folders: list[str]) -> list[Any]:
    """Co-simulation where the folder for temporary files is each of these; what is left in it, and of the module path."""
    import sys
    import tempfile
    from pathlib import Path

    sys.path.insert(0, root)
    from analysis import Inputs, cosimulate
    from linkwork.five_bar.published import TABLE_3_1

    before, found = list(sys.path), []
    for folder in folders:
        Path(folder).mkdir()
        tempfile.tempdir = folder
        run = cosimulate(fmu, TABLE_3_1, Inputs(speed=44.0), stop_time=5e-3, step=1e-3)
        found.append([run.status, len(run), [path.name for path in Path(folder).iterdir()]])
    return [found, sys.path == before]


def test_cosimulation_goes_around_such_folders(five_bar: Path, tmp_path: Path) -> None:
    root = Path(cosimulation.__file__).resolve().parents[2]
    folders = [str(tmp_path / name) for name in (*SAFE, *FATAL[:3])]
    found, clean = run_in_process(cosimulate_in, five_bar, root, folders, options=())
    assert found == [[0, 6, []]] * len(folders)
    assert clean


def test_trial_run_of_a_build_goes_around_such_folders(
    five_bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / FATAL[0]
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    run_trial(five_bar)


def test_no_folder_that_would_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / FATAL[0]))
    monkeypatch.setattr(os, "access", lambda folder, mode: folder == str(tmp_path / FATAL[0]))
    with pytest.raises(CosimulationError, match=r"an FMU cannot be unpacked in .*M\u00fcller: .* set TMPDIR"):
        unpacking_folder()
