"""Build the native FMUs: the equations as C, with the C shell around them, compiled for any platform by Zig.

One archive has model exchange and co-simulation, of FMI 2.0 or 3.0, and the sources.
"""

from __future__ import annotations

import hashlib
import os
import platform as machine
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib import metadata, resources
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from linkwork.mechanism import Mechanism

from ..files import unknown_name
from ..libraries import require
from ..mechanisms import check
from ..numerics.cache import code_folder, hashes_below, keep_hashes, load_or_make, lock_folder, read_hashes
from ..run import show_progress
from .archive import SOURCES, BuildError, common_files, write
from .bill import add_bill
from .component import MANIFEST, MEMORY, component, manifest
from .description import Kind, build_description, description, terminal_files
from .equations_c import generated_files
from .interface import interface


class Platform(NamedTuple):
    """A platform: its name in Zig, the suffix of its libraries, its folders in FMI 2.0 and 3.0, its own compiler options."""

    target: str
    suffix: str
    folder_fmi2: str
    folder_fmi3: str
    options: tuple[str, ...] = ()


#: Platforms by their names in FMI 3.0. glibc 2.17 is that of RHEL 7, and all later versions are compatible. macOS 11 was the
#: first for ARM; if no version is named, Zig requires the one that was new when Zig was made. On Windows Zig adds 65 kB of its
#: own; code optimised for size is not slower there by more than the spread of measurements, some 5 %.
PLATFORMS = {
    "x86_64-linux": Platform("x86_64-linux-gnu.2.17", "so", "linux64", "x86_64-linux"),
    "aarch64-linux": Platform("aarch64-linux-gnu.2.17", "so", "aarch64-linux", "aarch64-linux"),
    "x86_64-windows": Platform("x86_64-windows-gnu", "dll", "win64", "x86_64-windows", ("-Os",)),
    "x86_64-darwin": Platform("x86_64-macos.11.0", "dylib", "darwin64", "x86_64-darwin"),
    "aarch64-darwin": Platform("aarch64-macos.11.0", "dylib", "darwin64", "aarch64-darwin"),
}

#: Options of the compiler. Without fused multiplications the arithmetic is the same on every platform. Traps on undefined
#: behaviour are for tests only.
CODE = (
    "-std=c11", "-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", "-fno-sanitize=undefined",
    "-ffunction-sections", "-Wl,--gc-sections", "-s",
)  # fmt: skip
OPTIONS = (*CODE, "-lm")

#: Options for a WebAssembly module, which imports only what the source declares as an import.
WASM_OPTIONS = (
    *(option for option in OPTIONS if option not in ("-shared", "-fPIC", "-fvisibility=hidden")),
    "-mexec-model=reactor", "-Wl,-z,stack-size=262144",
)  # fmt: skip
#: The platform of FMI-LS-WASM, for FMI 3.0 alone: one binary that runs wherever a WebAssembly runtime does.
WASM = "wasm32-wasip2"
EVERYWHERE = PLATFORMS | {WASM: Platform("wasm32-wasi", "wasm", "", WASM)}

_SHELL = ("face.h", "model.h", "plant.h", "step.h", "plant.c", "instance.h", "instance.c", "saved.c")
#: Headers of the standard, by its major version.
HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
#: Files to compile; they include all others.
COMPILED = ("all.c",)
_NOTES = (
    "The equations are those of the Python sources of Linkwork, written as C and compiled; nothing but the C library is "
    "needed. The sources are in the archive.",
    "In model exchange the state is that of crank and slider and the work done; the event indicator is the distance from "
    "the limit of assembly. A commanded speed is followed at every instant; accelerations, torque and "
    "forces are those of the acceleration input, which must move with it.",
)


def this_platform() -> str:
    """Return the name of the platform that this process runs on.

    Raises
    ------
    BuildError
        If this platform is not in `PLATFORMS`.
    """
    architecture = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine.machine().lower(), machine.machine().lower())
    name = f"{architecture}-{machine.system().lower()}"
    if name not in PLATFORMS:
        raise BuildError(f"native FMUs are not made for {name}: the platforms are {', '.join(PLATFORMS)}")
    return name


def build_native(
    mechanism: Mechanism, kind: Kind, dest: Path | str = "build", platforms: Sequence[str] | None = None
) -> Path:
    """Build a native FMU of a mechanism and return its path.

    Parameters
    ----------
    mechanism : Mechanism
    kind : Kind
        `description.NATIVE` or `description.NATIVE_FMI3`.
    dest : path
        Folder for the FMU; made if it is not there.
    platforms : sequence of str, optional
        Names in `PLATFORMS`, or `WASM`; by default the platform of this process.

    Raises
    ------
    BuildError
        If a file does not compile, the FMU is not valid, or `WASM` is asked for with FMI 2.0.
    MissingLibraryError
        If Zig is not installed, or wasmtime, which `WASM` needs.
    UnknownNameError
        If there is no such platform.
    MechanismError
        If the parts of the mechanism do not fit together.
    """
    check(mechanism)
    platforms = [this_platform()] if platforms is None else [*dict.fromkeys(platforms)]
    for name in platforms:
        if name not in EVERYWHERE:
            raise unknown_name(name, EVERYWHERE, f"platform {name!r}")
    if kind.fmi == 2 and WASM in platforms:
        raise BuildError(f"{kind.file_name(mechanism)} cannot be for {WASM}: FMI-LS-WASM is a layer of FMI 3.0")
    dest = Path(dest)
    dest.mkdir(parents=True, exist_ok=True)
    sources = source_files(mechanism, kind, web=WASM in platforms)
    identifier = kind.identifier(mechanism)
    entries = {f"sources/{name}": text.encode() for name, text in sources.items()}
    entries |= compile_binaries(identifier, kind, sources, platforms)
    entries["modelDescription.xml"] = description(mechanism, kind, COMPILED)
    entries["sources/buildDescription.xml"] = build_description(identifier, COMPILED)
    if kind.fmi == 3:
        entries |= terminal_files(mechanism)
    if WASM in platforms:
        entries[MANIFEST] = manifest()
    made = f"FMI {kind.fmi}.0 model exchange and co-simulation"
    variables = [entry.variable for entry in interface(mechanism)]
    icon = "model.png" if kind.fmi == 2 else "terminalsAndIcons/icon.png"
    entries |= common_files(mechanism, variables, made, _NOTES, icon)
    target = dest / kind.file_name(mechanism)
    return write(add_bill(target.stem, entries, native=True, fmi=kind.fmi), target)


def source_files(mechanism: Mechanism, kind: Kind, *, web: bool = False) -> dict[str, str]:
    """Return all C files of a native FMU by name: the shell, the headers of the standard, and the generated files.

    If ``web`` is true, there is also the file for a WebAssembly component.

    Only all.c (`COMPILED`) is compiled; it includes all other C files. The functions of the standard have the prefix
    FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX if this macro is defined; no other symbols are exported.
    """
    shell = SOURCES / "native"
    headers = resources.files("fmpy") / "c-code"
    own = [f"fmi{kind.fmi}.c", *_SHELL, *(["component.c"] if web else [])]
    files = {name: (shell / name).read_text(encoding="utf-8") for name in own}
    files |= {name: (headers / name).read_text(encoding="utf-8") for name in HEADERS[kind.fmi]}
    if kind.fmi == 2:
        files["fmi2Functions.h"] = _with_prefix(files["fmi2Functions.h"], (headers / "fmi3Functions.h").read_text())
    files |= generated_files(mechanism, kind)
    units = "".join(f'#include "{name}"\n' for name in files if name.endswith(".c"))
    units = f'#define ALL_IN_ONE\n#include "model.h"\n{units}'
    return files | {"all.c": f"/* All of the FMU in one file. Generated. */\n{units}"}


def _with_prefix(fmi2: str, fmi3: str) -> str:
    """Return the FMI 2.0 header with lines for a function prefix, made from the FMI 3.0 header.

    FMPy omits these lines of the standard in its FMI 2.0 header.
    """
    first, last = fmi2.index("/*\nExport FMI2 API functions"), "#define fmi2FullName(name) name\n"
    lines = fmi3[fmi3.index("#if !defined(FMI3_OVERRIDE") : fmi3.index("/* FMI version */")]
    return fmi2[:first] + lines.replace("FMI3", "FMI2").replace("fmi3", "fmi2") + fmi2[fmi2.index(last) + len(last) :]


def compile_binaries(
    identifier: str, kind: Kind, sources: dict[str, str], platforms: Sequence[str], *, kept: bool = True
) -> dict[str, bytes]:
    """Compile the library for each platform; return the libraries by path in the archive.

    In FMI 2.0 the libraries for both architectures of macOS are in one file. If ``kept`` is true, a library that was compiled
    before is not compiled again; see `compile_library`.
    """
    found: dict[str, list[bytes]] = {}
    with tempfile.TemporaryDirectory(prefix="linkwork-native-") as folder:
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        for number, name in enumerate(platforms):
            platform = EVERYWHERE[name]
            place = platform.folder_fmi2 if kind.fmi == 2 else platform.folder_fmi3
            library = f"{identifier}.{platform.suffix}"
            with show_progress(False, float(len(platforms)), f"compiling for {name}") as show:
                show(float(number))
                options = (*WASM_OPTIONS, *MEMORY) if name == WASM else (*OPTIONS, *platform.options)
                compile_library(folder, COMPILED, library, platform.target, options, kept=kept)
            made = (Path(folder) / library).read_bytes()
            found.setdefault(f"binaries/{place}/{library}", []).append(component(made) if name == WASM else made)
    return {place: parts[0] if len(parts) == 1 else _join_macos_libraries(parts) for place, parts in found.items()}


def compile_library(
    folder: Path | str,
    files: Sequence[str],
    library: str,
    target: str,
    options: Sequence[str] = OPTIONS,
    *,
    kept: bool = False,
) -> None:
    """Compile C files of a folder to a library in the same folder.

    What Zig compiles for its own use, such as the C library, is cached with hashes and compiled again if a cached file has
    changed.

    Parameters
    ----------
    folder : path
    files : sequence of str
        Paths of the C files, in the folder or elsewhere.
    library : str
        Name of the library.
    target : str
        Platform by its name in Zig.
    options : sequence of str
        Options of the compiler.
    kept : bool
        Whether the library is kept in the cache, and taken from there if it was compiled before by the same version of Zig
        and of this module with the same options from the same files. The files are then all sources: those of the folder,
        ``files``, and the folders of headers after an option ``-I``.

    Raises
    ------
    BuildError
        If the compiler fails; the message has what the compiler printed.
    MissingLibraryError
        If Zig is not installed.
    """
    require("ziglang")
    if not kept:
        _run_compiler(folder, files, library, target, options)
        return
    path = Path(folder) / library

    def compiled() -> bytes:
        _run_compiler(folder, files, library, target, options)
        return path.read_bytes()

    content = load_or_make(
        code_folder("libraries") / _fingerprint(Path(folder), files, library, target, options), compiled
    )
    path.write_bytes(content)
    path.chmod(0o755)


def _fingerprint(folder: Path, files: Sequence[str], library: str, target: str, options: Sequence[str]) -> str:
    """Return a hash of all that a library depends on: the compiler, its call by this module, and the files that it may read."""
    headers = [Path(after) for before, after in pairwise(options) if before == "-I"]
    plain = [option for option in options if Path(option) not in headers]
    sources = [path for place in (folder, *headers) for path in sorted(place.rglob("*.[ch]"))]
    sources += [*(folder / name for name in files), Path(__file__)]
    digest = hashlib.sha256(repr((metadata.version("ziglang"), library, target, plain)).encode())
    for path in sources:
        content = path.read_bytes()
        digest.update(f"{path.name} {len(content)} ".encode() + content)
    return digest.hexdigest()


def _run_compiler(folder: Path | str, files: Sequence[str], library: str, target: str, options: Sequence[str]) -> None:
    """Compile C files of a folder with Zig, whose own objects are kept in the cache."""
    cache = code_folder(f"zig-{target}")
    known = cache / "hashes"
    with lock_folder(cache), tempfile.TemporaryDirectory(prefix="linkwork-zig-") as own:
        found = hashes_below(cache / "o")
        if any(found.get(name) != digest for name, digest in read_hashes(known).items()):
            sys.stderr.write(f"linkwork: {cache}: a file has changed or is gone: all are compiled again\n")
            shutil.rmtree(cache)
            cache.mkdir(mode=0o700)
        if not known.is_file():
            sys.stderr.write(f"linkwork: Zig compiles its own libraries for {target}, once on this machine ...\n")
        done = subprocess.run(
            [sys.executable, "-m", "ziglang", "cc", "-target", target, *options, "-o", library, *files],
            cwd=folder,
            env=os.environ | {"ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": own},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise BuildError(f"{library} cannot be compiled for {target}:\n{done.stderr}")
        keep_hashes(known, hashes_below(cache / "o"))


def _join_macos_libraries(parts: Sequence[bytes]) -> bytes:
    """Join libraries of macOS for several architectures in one file, as Apple's loader reads it (<mach-o/fat.h>)."""
    align = 14  # pages of 16 KiB
    header = struct.pack(">II", 0xCAFEBABE, len(parts))
    body = b""
    start = 1 << align
    for part in parts:
        cpu, subtype = struct.unpack_from("<ii", part, 4)
        offset = start + len(body)
        header += struct.pack(">iiIII", cpu, subtype, offset, len(part), align)
        body += part + bytes(-len(part) % (1 << align))
    return header + bytes(start - len(header)) + body
