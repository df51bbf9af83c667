"""The libraries of the native FMUs for every platform: what they export and import, their size; stepped where there is an
emulator. Those of macOS are inspected only.

The emulators are Wine for Windows (Debian: wine64) and QEMU for 64-bit ARM (qemu-user-static, libc6-arm64-cross).
"""

import re
import shutil
import sys
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from zipfile import ZipFile

import pytest

from analysis.export import KINDS, PLATFORMS, build_native
from build_fmu import FMUS
from tests.scripts import called

from .c_host import compile_host, emulator, run_host, unpack, wine_settings
from .runner import run_in_process

lief = pytest.importorskip("lief", reason="LIEF reads the libraries: pip install lief")

NATIVE = [f"{model}-{kind}" for model in FMUS for kind in ("native", "native-fmi3")]

#: What the libraries may import of the C library: arithmetic, memory, strings, and text in a buffer. Nothing that reads,
#: writes, waits, knows the time or ends the process.
C_LIBRARY = """
    atan2 cos floor log10 nextafter pow sin sqrt tanh calloc free malloc bcmp memchr memcmp memcpy memmove memset
    feholdexcept fesetenv strchr strcmp strcpy strlen strstr snprintf vsnprintf
"""
#: What compilers put in the place of these on macOS, and its loader.
MACHINE = "__sincos_stret __bzero bzero dyld_stub_binder"
#: On Windows the beginning and the end of a library are the compiler's as well: those of the C runtime, locks, and a message
#: where the library cannot be loaded.
WINDOWS = """
    _execute_onexit_table _exit _initialize_onexit_table _initterm _initterm_e _register_onexit_function abort
    DeleteCriticalSection EnterCriticalSection GetLastError InitializeCriticalSection LeaveCriticalSection Sleep TlsGetValue
    VirtualProtect VirtualQuery __acrt_iob_func __stdio_common_vfprintf __stdio_common_vsprintf fwrite
"""


def standard(fmi: int) -> set[str]:
    """The functions that the standard's header declares."""
    header = (resources.files("fmpy") / "c-code" / f"fmi{fmi}Functions.h").read_text(encoding="utf-8")
    return set(re.findall(rf"^\s*FMI{fmi}_Export \w+\s+(\w+);", header, re.MULTILINE))


def libraries(fmu: Path) -> Iterator[tuple[str, bytes]]:
    """Name and content of each library."""
    with ZipFile(fmu) as archive:
        for name in archive.namelist():
            if name.startswith("binaries/"):
                yield name, archive.read(name)


def inspect_elf(data: bytes, exports: set[str], most: int) -> None:
    library = lief.ELF.parse(list(data))
    assert {symbol.name for symbol in library.exported_symbols} == exports
    assert {symbol.name for symbol in library.imported_symbols} <= set(C_LIBRARY.split())
    assert set(library.libraries) == {"libc.so.6", "libm.so.6"}
    needed = {a.name for v in library.symbols_version_requirement for a in v.get_auxiliary_symbols()}
    assert max(tuple(map(int, name.removeprefix("GLIBC_").split("."))) for name in needed) <= (2, 17)
    assert library.has_nx
    assert len(data) < most


def inspect_dll(data: bytes, exports: set[str], most: int) -> None:
    library = lief.PE.parse(list(data))
    assert {function.name for function in library.exported_functions} == exports
    assert {entry.name for part in library.imports for entry in part.entries} <= set((C_LIBRARY + WINDOWS).split())
    # the C runtime of Windows 10 and later
    strangers = [part.name for part in library.imports if not part.name.startswith("api-ms-win-crt-")]
    assert strangers == ["KERNEL32.dll"]
    assert len(data) < most


def inspect_dylib(data: bytes, exports: set[str], most: int) -> None:
    fat = lief.MachO.parse(list(data))  # held: what it gives out lives no longer than it does
    for library in fat:
        own = {"__mh_dylib_header", "___dso_handle"}  # the linker's, not to be called
        assert {s.name for s in library.exported_symbols} - own == {f"_{name}" for name in exports}
        # symbols of C have an underscore before their name there
        imported = {re.sub("^_", "", symbol.name) for symbol in library.imported_symbols}
        assert imported <= set((C_LIBRARY + MACHINE).split())
        assert [part.name for part in library.libraries][1:] == ["/usr/lib/libSystem.B.dylib"]
        assert library.build_version.minos <= [11, 0, 0]
        # what is not signed is not loaded on ARM
        assert library.has_code_signature or library.header.cpu_type == lief.MachO.Header.CPU_TYPE.X86_64
        assert library.original_size < most


INSPECT = {"so": inspect_elf, "dll": inspect_dll, "dylib": inspect_dylib}


def most(name: str) -> int:
    """Bytes of a library at most: the five-bar has its equations twice, the second time with friction by contact forces."""
    return 300_000 if name.startswith("FiveBarSlider") else 200_000


@pytest.fixture(scope="module")
def everywhere(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Every native FMU for all platforms."""
    folder = tmp_path_factory.mktemp("everywhere")
    every = [(model, kind) for model in FMUS for kind in ("native", "native-fmi3")]
    return {f"{model}-{kind}": build_native(FMUS[model], KINDS[kind], folder, list(PLATFORMS)) for model, kind in every}


@pytest.mark.parametrize("name", NATIVE)
def test_library_for_this_machine(natives: dict[str, Path], name: str) -> None:
    found = list(libraries(natives[name]))
    assert len(found) == 1
    for path, data in found:
        INSPECT[path.rpartition(".")[2]](data, standard(3 if "fmi3" in name else 2), most(name))


@pytest.mark.slow
@pytest.mark.timeout(1200)  # Zig compiles its own libraries first, on an empty cache
@pytest.mark.parametrize("name", NATIVE)
def test_libraries_for_all_platforms(everywhere: dict[str, Path], name: str) -> None:
    fmi = 3 if "fmi3" in name else 2
    folders = {p.folder_fmi3 if fmi == 3 else p.folder_fmi2 for p in PLATFORMS.values()}
    found = dict(libraries(everywhere[name]))
    assert {path.split("/")[1] for path in found} == folders
    for path, data in found.items():
        INSPECT[path.rpartition(".")[2]](data, standard(fmi), most(name))


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("platform", [name for name in PLATFORMS if "darwin" not in name])
def test_the_same_results_on_every_platform(
    everywhere: dict[str, Path], natives: dict[str, Path], tmp_path: Path, platform: str
) -> None:
    command = emulator(platform)
    wine = wine_settings(tmp_path)
    for part in ("here", "there"):
        (tmp_path / part).mkdir()
    here, there = compile_host(tmp_path / "here"), compile_host(tmp_path / "there", platform)
    start = {"drive.mode": 0, "slider.damping": 25.0, "slider.coulomb_friction": 0.3, "initial.crank_speed": 30.0}
    for name in NATIVE:
        for interface in ("cs", "me"):
            expected = run_host(here, unpack(natives[name], tmp_path / "a" / name), start, interface=interface)
            fmu = unpack(everywhere[name], tmp_path / "b" / name, platform)
            found = run_host(there, fmu, start, interface=interface, emulator=command, environment=wine)
            assert (found["status"], found["time"]) == (expected["status"], expected["time"]) == (0, 0.1)
            # sine and cosine are of another library
            for output, value in expected["end"].items():
                assert found["end"][output] == pytest.approx(value, rel=1e-9, abs=1e-8), output


def last_row(fmu: str) -> list[float]:
    """Outputs at the end of a short run."""
    from fmpy import simulate_fmu

    return simulate_fmu(fmu, stop_time=0.1, step_size=1e-3, output_interval=1e-3)[-1].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", NATIVE)
def test_what_fmpy_compiles_of_the_sources_runs(natives: dict[str, Path], tmp_path: Path, name: str) -> None:
    if not shutil.which("cmake"):
        pytest.skip("fmpy compile needs CMake and a compiler")
    with ZipFile(natives[name]) as archive, ZipFile(tmp_path / f"{name}.fmu", "w") as bare:
        for entry in archive.namelist():
            if not entry.startswith("binaries/"):
                bare.writestr(entry, archive.read(entry))
    called(sys.executable, "-m", "fmpy", "compile", f"{name}.fmu", cwd=tmp_path)
    # in Python, where libm is already: FMPy does not link it, and has no place to say that it is needed
    expected, found = (run_in_process(last_row, fmu) for fmu in (natives[name], tmp_path / f"{name}.fmu"))
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-8)
