"""Write a system as one C program for real-time targets, with the sources of its native FMUs: no heap, no Python."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Iterable
from importlib import resources
from pathlib import Path

from ..export import BuildError, compile_library, this_platform
from ..files import write_text
from .wiring import Part, Wiring, WiringError

_HOST, _CONTROLLERS = "host.c", "controllers.h"
#: Options of the compiler. NO_HEAP leaves out the code by which FMUs allocate memory if the host gives them none.
OPTIONS = (
    "-std=c11", "-O2", "-ffp-contract=off", "-fno-sanitize=undefined", "-Wall", "-Wextra", "-Werror", "-DNO_HEAP",
)  # fmt: skip


def write_host(wiring: Wiring, folder: str | Path) -> list[str]:
    """Write a system as C files into a folder, and return the names of the files to compile.

    These are ``host.c``, which is the master with its clock, and one file for each native FMU. The header ``system.h`` has the
    start values and the connections.

    Raises
    ------
    WiringError
        If a part is neither a native FMU with its sources nor a controller known to the host, or two different FMUs have the
        same model identifier.
    """
    folder = Path(folder)
    files = {name: (resources.files(__package__) / name).read_text(encoding="utf-8") for name in (_HOST, _CONTROLLERS)}
    files["system.h"] = _header(wiring)
    fmus: dict[str, Path] = {}
    for name, part in wiring.parts.items():
        if not _files_to_compile(part):
            known = re.findall(r"void (\w+)_sample\(", files[_CONTROLLERS])
            if part.description.modelName not in known:
                raise WiringError(
                    f"{name}: {part.fmu.name} has no sources in C; controllers known to the host are {', '.join(known)}"
                )
        elif fmus.setdefault(_identifier(part), part.fmu) != part.fmu:
            raise WiringError(f"{name}: two different FMUs are named {_identifier(part)}: one of them must be renamed")
    for identifier, path in fmus.items():
        with zipfile.ZipFile(path) as archive:
            sources = {
                entry.removeprefix("sources/"): archive.read(entry).decode()
                for entry in archive.namelist()
                if re.fullmatch(r"sources/[^/]+\.[ch]", entry)
            }
        files |= {name: text for name, text in sources.items() if re.fullmatch(r"fmi2\w+\.h", name)}
        files |= {f"{identifier}/{name}": text for name, text in sources.items()}
        part = next(part for part in wiring.parts.values() if part.fmu == path)
        included = "".join(f'#include "{identifier}/{name}"\n' for name in _files_to_compile(part))
        files[f"{identifier}.c"] = (
            f"#define FMI2_FUNCTION_PREFIX {identifier}_\n"
            '#pragma GCC diagnostic ignored "-Wunused-function"\n'
            f'#pragma GCC diagnostic ignored "-Wunused-parameter"\n{included}'
        )
    for name, text in files.items():
        write_text(folder / name, text)
    return [_HOST, *(f"{identifier}.c" for identifier in fmus)]


def build_host(wiring: Wiring, folder: str | Path) -> Path:
    """Write a system as C files into a folder, compile them there with Zig, and return the program; see ``host.c``.

    Raises
    ------
    BuildError
        If the machine does not run Linux, whose clock the host uses, or the files do not compile.
    """
    architecture, _, name = this_platform().partition("-")
    if name != "linux":
        raise BuildError(f"the host in C is for Linux, this is {name}: compile the files on the target")
    files = write_host(wiring, folder)
    compile_library(folder, files, "host", f"{architecture}-linux-musl", (*OPTIONS, "-static", "-lm"), kept=True)
    return Path(folder) / "host"


def _identifier(part: Part) -> str:
    return str(part.description.coSimulation.modelIdentifier)


def _files_to_compile(part: Part) -> list[str]:
    """Return the C files of an FMU that must be compiled."""
    return [
        name
        for configuration in part.description.buildConfigurations or ()
        if configuration.modelIdentifier == _identifier(part)
        for group in configuration.sourceFileSets
        for name in group.sourceFiles
    ]


def _header(wiring: Wiring) -> str:
    """Return the text of system.h: instances of the parts, start values, and functions that call all parts in turn."""
    names = {name: f"part{n}" for n, name in enumerate(wiring.parts)}
    native = {name: _identifier(part) for name, part in wiring.parts.items() if _files_to_compile(part)}
    ends = dict.fromkeys(wiring.connections.values())
    at = {end: f"y[{n}]" for n, end in enumerate(ends)}
    declared = [f"FMU({identifier})" for identifier in dict.fromkeys(native.values())]
    begin, ahead, back, read, put, initialise, advance, finish = ([] for _ in range(8))
    for name, part in wiring.parts.items():
        c, kind = names[name], native.get(name)
        if kind is None:
            kind = part.description.modelName
            own = {v.name: float(v.start) for v in part.description.modelVariables if v.type == "Real" and v.start}
            starts = ", ".join(
                f".{_field(port)} = {value!r}" for port, value in {**own, **part.values}.items() if value
            )
            declared.append(f"static {kind} {c} = {{{starts}}}, {c}_before; /* {name} */")
            ahead.append(f"{c}_before = {c}, {kind}_sample(&{c});")
            back.append(f"{c} = {c}_before;")
            initialise.append(f"SAMPLE({kind}, {c}, 0.5 * {c}.sample_time)")
            advance.append(f"SAMPLE({kind}, {c}, time + step)")
            continue
        declared.append(f"static fmi2Component {c}; /* {name} */")
        begin.append(f"NEW({kind}, {c}, {json.dumps(name)}, {json.dumps(part.description.guid)})")
        for port, value in part.values.items():
            variable = part.ports[port]
            text = repr(float(value)) if variable.type == "Real" else str(int(value))
            type_ = variable.type if variable.type in ("Real", "Boolean") else "Integer"
            begin.append(f"SET({kind}, {type_}, {c}, {variable.reference}, {text}) /* {port} */")
        begin.append(f"ENTER({kind}, {c})")
        initialise.append(f"EXIT({kind}, {c})")
        advance.append(f"STEP({kind}, {c}, time, step)")
        finish.append(f"END({kind}, {c})")
    for end, place in at.items():
        c = names[end.part]
        if end.part in native:
            read.append(f"GET({native[end.part]}, {c}, {wiring.port(end).reference}, {place})")
        else:
            read.append(f"{place} = {c}.{_field(end.port)};")
    for target, source in wiring.connections.items():
        c, note = names[target.part], f" /* {source} -> {target} */"
        if target.part in native:
            put.append(f"SET({native[target.part]}, Real, {c}, {wiring.port(target).reference}, {at[source]}){note}")
        else:
            put.append(f"{c}.{_field(target.port)} = {at[source]};{note}")
    said = ", ".join(json.dumps(str(end)) for end in ends)
    return "\n".join(
        [
            f"/* {wiring.title}: parts, start values and connections, for host.c. Generated. */",
            f"enum {{ PARTS = {len(names)}, OUTPUTS = {len(at)} }};",
            f"static const double COMMUNICATION_STEP = {wiring.step!r};",
            f"static double y[{len(at) or 1}];",
            f"static const char *const outputs[] = {{{said or 'NULL'}}};",
            *declared,
            *_function("begin(void)", begin),
            *_function("initialise(void)", initialise),
            *_function("sample_ahead(void)", ahead),
            *_function("go_back(void)", back),
            *_function("read_outputs(void)", read),
            *_function("set_inputs(void)", put),
            *_function("advance(double time, double step)", advance),
            *_function("finish(void)", finish),
            "",
        ]
    )


def _function(head: str, lines: Iterable[str]) -> list[str]:
    return ["", f"static void {head} {{", *(f"    {line}" for line in lines), "}"]


def _field(port: str) -> str:
    """Return the field of a controller's C structure for a port, such as ``name[0]`` for the port ``name_0``."""
    return re.sub(r"_(\d+)$", r"[\1]", port)
