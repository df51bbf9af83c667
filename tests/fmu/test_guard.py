"""Where a Python FMU can be unpacked, and the calls from which its guard keeps PythonFMU's library."""

import os
import sys
import tempfile
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

from analysis import CosimulationError
from analysis.export import NATIVE, PLATFORMS, SOURCES, build_native, compile_library, run_trial, this_platform
from analysis.export.python_fmu import PYTHONFMU, compile_guard
from analysis.mechanisms import FIVE_BAR
from analysis.run import cosimulation, unpacking_folder
from tests.scripts import called

from .c_host import Unpacked, compile_host, emulator, python_path, run_host, unpack, wine_settings
from .runner import HERE, run_in_process

PLAIN = ["plain", "with space", "dots.-_~09"]
#: Names that PythonFMU's own library cannot read.
OTHERS = ["M\u00fcller", *(f"a{character}b" for character in "()#%+&@'")]

_CALL = """
import sys
sys.path.insert(0, sys.argv[1])
from ctypes import byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, memset
from bare_master import Fmu
fmu = Fmu(*sys.argv[2:4])
uri = (fmu.folder / "resources").as_uri()


def refused(sentence, **arguments):
    try:
        fmu.instantiate(logging=False, **arguments)
    except RuntimeError as error:
        assert "3, 'logStatusError'" in str(error) and sentence in str(error), error
    else:
        raise AssertionError("instantiated")
"""

CALLS = {
    "three slashes": "fmu.instantiate().start()",
    "one slash": "fmu.instantiate(resources=uri.replace('file:///', 'file:/')).start()",
    "a host": "fmu.instantiate(resources=uri.replace('file:///', 'file://localhost/')).start()",
    "capitals": "fmu.instantiate(resources=uri.replace('file://', 'FILE://LocalHost')).start()",
    "an end in the middle": "refused('UTF-8', resources=uri + '%00')",
    "another GUID": "refused('GUID', guid='{0}')",
    "a path": "fmu.instantiate(resources=str(fmu.folder / 'resources')).start()",
    "another host": "refused('resources', resources=uri.replace('file:///', 'file://elsewhere/'))",
    "another folder": "refused('resources', resources=fmu.folder.as_uri())",
    "a folder that is not UTF-8": "refused('UTF-8', resources='file:///tmp/%FC')",
    "a freed state": """
i = fmu.instantiate().start()
s = i.save()
i.run([1e-3])
assert i._call("GetFMUstate", byref(s)) == 0 and i.restore(s) == 0 and i.step(1e-3, 1e-3) == 0
assert s.value and i.free_state(s) == 0 and s.value is None and i.free_state(s) == 0
""",
    "no state": """
i = fmu.instantiate().start()
assert i._call('FreeFMUstate', c_void_p()) == 0
assert [i._call(n, c_void_p()) for n in ('GetFMUstate', 'SetFMUstate')] == [3, 3]
assert i.log[-1] == [3, 'logStatusError', 'fmi2SetFMUstate: a null pointer']
i.run([1e-3])
""",
    "no component": """
i = fmu.instantiate().start()
kept, i.component = i.component, c_void_p()
assert [i.setup(), i.enter(), i.exit(), i.step(0.0, 1e-3), i.terminate(), i.reset(), i.read(fmu.outputs)[0]] == [3] * 7
i.component = kept
i.run([1e-3])
""",
    "a size that is not the state's": """
i = fmu.instantiate().start()
s = i.save()
size = c_size_t()
assert i._call("SerializedFMUstateSize", s, byref(size)) == 0
for other in (0, size.value - 1, size.value + 1, 50_000_000):
    assert i._call("SerializeFMUstate", s, (c_char * (size.value + 1))(), c_size_t(other)) == 3
    assert "size" in i.log[-1][2]
assert i.restore(i.deserialize(i.serialize(s))[1]) == 0
""",
    "a long name": """
i = fmu.instantiate(name=300 * "\\u00fc", logging=False)
assert i.step(0.0, 1.0) == 2
""",
    "callbacks that are gone": """
i = fmu.instantiate()
memset(byref(i._callbacks), 0, 8)
assert i.step(0.0, 1.0) == 2 and i.log[-1][1] == "logStatusDiscard"
""",
    "threads": """
from threading import Thread
found = []
def run(k):
    for n in range(10):
        try:
            found.append(k % 2 == 0 and fmu.instantiate().start() is not None)
        except RuntimeError:
            found.append("wrong")
def run_wrong(k):
    for n in range(10):
        try:
            fmu.instantiate(resources=uri + "x")
        except RuntimeError:
            found.append(True)
threads = [Thread(target=(run, run_wrong)[k % 2], args=(k,)) for k in range(8)]
for thread in threads: thread.start()
for thread in threads: thread.join()
assert found == [True] * 80
""",
    "a relative path": """
import os
from ctypes import CDLL
os.chdir(fmu.folder / "binaries" / "linux64")
fmu.library = CDLL(f"./{fmu.identifier}.so")
os.chdir("/")
fmu.instantiate().start()
""",
    "a step after a refused one": """
i = fmu.instantiate().start()
def last():
    time = c_double()
    status = c_int(-1)
    assert i._call("GetRealStatus", c_int(2), byref(time)) == i._call("GetStatus", c_int(0), byref(status)) == 0
    assert status.value == 2 * i.terminated()[1]
    return i.terminated(), time.value
before = i.save()
i.run([1e-3, 1e-3])
assert i.step(2e-3, -1.0) == 2 and last() == ((0, 1), 2e-3)
i.run([1e-3], 2e-3)
assert last() == ((0, 0), 3e-3) and i.step(3e-3, -1.0) == 2
assert i.restore(before) == 0 and i.terminated() == (0, 0)
assert i._call("GetRealStatus", c_int(2), byref(c_double())) == 2
assert i.step(0.0, -1.0) == 2 and last() == ((0, 1), 0.0)
assert i.reset() == 0 and i.start(start=5.0) and last() == ((0, 0), 5.0)
assert i.step(5.0, -1.0) == 2 and last() == ((0, 1), 5.0)
i = fmu.instantiate().start(start=5.0)
assert last() == ((0, 0), 5.0) and i.step(5.0, -1.0) == 2 and last() == ((0, 1), 5.0)
""",
    "no values": """
i = fmu.instantiate().start()
assert [i._call(f"{w}{k}", c_void_p(), c_size_t(1), c_void_p())
        for w in ("Get", "Set") for k in ("Real", "Integer", "Boolean", "String")] == [3] * 8
i.run([1e-3])
""",
    "strings that are not UTF-8": """
i = fmu.instantiate().start()
at = (c_uint * 1)(fmu.variables["solver.message"].reference)
for text in (b"\\xff", b"\\xc0\\x80", b"\\xed\\xa0\\x80", b"\\xf4\\x90\\x80\\x80", b"a\\xc3", None):
    assert i._call("SetString", at, c_size_t(1), (c_char_p * 1)(text)) == 3
    assert i.log[-1][2] == "fmi2SetString: a string that is null or not in UTF-8"
# a good one reaches the slave, which does not take it
assert i._call("SetString", at, c_size_t(1), (c_char_p * 1)("\\u00fc\\u20ac\\U0001f600".encode())) == 3
assert "\\u20ac" in i.log[-1][2] and "not taken" in i.log[-1][2]
i.run([1e-3])
""",
    "model exchange": """
import bare_master
bare_master.CO_SIMULATION = 0
refused("co-simulation")
""",
    "no logging": """
i = fmu.instantiate(logging=False).start()
assert i.step(0.0, -1.0) == 2
assert [status for status, *_ in i.log] == [2]
assert i._call("SetDebugLogging", c_int(1), c_size_t(1), c_void_p()) == 3
assert i._call("SetDebugLogging", c_int(1), c_size_t(1), (c_char_p * 1)(b"nonsense")) == 3
assert i._call("SetDebugLogging", c_int(1), c_size_t(1), (c_char_p * 1)(b"logStatusWarning")) == 0
assert i.step(0.0, -1.0) == 2 and i.log[-1][0] == 2
""",
}


def end_of(fmu: Path, folder: Path, call: str = CALLS["three slashes"]) -> None:
    """Unpack the FMU into the folder and make the call, in a process of its own; it must end well."""
    called(sys.executable, "-c", _CALL + call, HERE, fmu, folder, timeout=60.0)


@pytest.mark.skipif(sys.platform == "win32", reason="not every name can be given to a folder there")
@pytest.mark.parametrize("name", [*PLAIN, *OTHERS])
def test_names_of_folders(five_bar: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / name
    folder.mkdir()
    end_of(five_bar, folder)
    # other FMUs of PythonFMU cannot read some of them
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    assert (unpacking_folder() == str(folder)) == (name in PLAIN)


@pytest.mark.parametrize("call", CALLS)
def test_calls_of_which_pythonfmu_would_die(five_bar: Path, tmp_path: Path, call: str) -> None:
    end_of(five_bar, tmp_path, CALLS[call])


_TWO = """
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include "fmi2Functions.h"
static void log(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c, fmi2String text, ...) {
    va_list rest;
    va_start(rest, text);
    vfprintf(stderr, text, rest);
    va_end(rest);
}
int main(int count, char **given) {
    fmi2CallbackFunctions functions = {log, NULL, NULL, NULL, NULL};
    for (int k = 1; k + 2 < count; k += 3) {
        void *library = dlopen(given[k], RTLD_NOW | RTLD_LOCAL);
        if (!library) return 2;
        fmi2InstantiateTYPE *make = (fmi2InstantiateTYPE *)dlsym(library, "fmi2Instantiate");
        fmi2FreeInstanceTYPE *drop = (fmi2FreeInstanceTYPE *)dlsym(library, "fmi2FreeInstance");
        fmi2Component c = make("one", fmi2CoSimulation, given[k + 1], given[k + 2], &functions, 0, 0);
        if (!c) return 3;
        drop(c);
    }
    return 0;
}
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="PythonFMU's fault is in its library for Linux alone")
def test_two_python_fmus_let_go_of_python_before_a_process_in_c_ends(fmus: dict[str, Path], tmp_path: Path) -> None:
    # PythonFMU's library would use a pointer in a destructor that runs after the pointer was destroyed
    (tmp_path / "two.c").write_text(_TWO)
    options = ("-D_GNU_SOURCE", "-I", str(resources.files("fmpy") / "c-code"), "-ldl")
    compile_library(tmp_path, ["two.c"], "two", PLATFORMS[this_platform()].target, options)
    unpacked = [unpack(fmus[name], tmp_path / name) for name in ("FiveBarSlider", "SliderCrank")]
    for order in (unpacked, unpacked[::-1]):
        given = [str(part) for u in order for part in (u.library, u.token, (u.folder / "resources").as_uri())]
        called(tmp_path / "two", *given, env=os.environ | python_path(), timeout=60.0)


def put_guard_before(fmu: Unpacked) -> None:
    """Put the guard before the library of a native FMU, in the place of PythonFMU's; it has the same functions."""
    place = fmu.library.parent.name
    fmu.library.rename(fmu.library.with_name(PYTHONFMU[place]))
    fmu.library.write_bytes(compile_guard((SOURCES / "guard.c").read_bytes())[place])
    (fmu.folder / "resources").mkdir()
    (fmu.folder / "resources" / "guid.txt").write_text(fmu.token)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("platform", ["x86_64-linux", "x86_64-windows"])
def test_calls_go_through_on_every_platform(tmp_path: Path, platform: str) -> None:
    command, settings = emulator(platform), wine_settings(tmp_path)
    host = compile_host(tmp_path, platform)
    native = build_native(FIVE_BAR, NATIVE, tmp_path, [platform])
    start = {"drive.mode": 0, "initial.crank_speed": 30.0}
    expected = run_host(
        host, unpack(native, tmp_path / "bare", platform), start, emulator=command, environment=settings
    )
    # the short name of a folder on Windows, and its drive
    fmu = unpack(native, tmp_path / "M\u00fcller & S\u00f6hne", platform)
    put_guard_before(fmu)
    drive = "/Z:" if platform == "x86_64-windows" else ""
    path = f"{drive}{quote(str(fmu.folder))}/resources"
    for uri in (f"file://{path}", f"file:{path}", f"file://localhost{path}"):
        found = run_host(host, fmu, start, resources=uri, emulator=command, environment=settings)
        assert (found["status"], found["time"], found["end"]) == (0, expected["time"], expected["end"])
    with pytest.raises(RuntimeError, match="resources"):
        run_host(host, fmu, start, resources=f"file://{drive}/nowhere", emulator=command, environment=settings)


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


def test_cosimulation_in_such_folders(five_bar: Path, tmp_path: Path) -> None:
    root = Path(cosimulation.__file__).resolve().parents[2]
    folders = [str(tmp_path / name) for name in (*PLAIN, *OTHERS[:3])]
    found, clean = run_in_process(cosimulate_in, five_bar, root, folders, options=())
    assert found == [[0, 6, []]] * len(folders)
    assert clean


def test_trial_run_of_a_build_in_such_a_folder(five_bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / OTHERS[0]
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    run_trial(five_bar)


def test_no_folder_that_would_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / OTHERS[0]))
    monkeypatch.setattr(os, "access", lambda folder, mode: folder == str(tmp_path / OTHERS[0]))
    with pytest.raises(CosimulationError, match=r"an FMU cannot be unpacked in .*M\u00fcller: .* set TMPDIR"):
        unpacking_folder()
