"""Write a WebAssembly component around a native FMU, after the draft of FMI-LS-WASM.

The draft is commit c1aac17 of modelica/fmi-ls-wasm of July 2026. One component has both interfaces, co-simulation and model
exchange. It contains the core module that Zig compiles from the FMU's C code. The frame around the core module is written here:
types, resources, and one lifted function for each method. `native/component.c` has the C functions of the methods, under the
names of the methods.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache

from ..libraries import require
from .description import layered_standard, to_xml_bytes

#: The layered standard, and its manifest.
STANDARD = "org.modelica.fmi-ls-wasm"
MANIFEST = f"extra/{STANDARD}/manifest.xml"
#: Initial size of the memory in pages of 64 KiB. The frame has the memory, because callbacks of the FMU's module need it too.
PAGES = 16
MEMORY = ("-Wl,--import-memory", f"-Wl,--initial-memory={PAGES << 16}")
_PACKAGE, _VERSION = "fmi:fmi3", "3.0.0"

#: The types that both interfaces share.
_TYPES = {
    "value-reference": "u32",
    "status": "enum<ok,warning,discard,error,fatal>",
    "fmu-state": "list<u8>",
    "interval-qualifier": "enum<interval-not-yet-known,interval-unchanged,interval-changed>",
    "interval-fraction": "record<counter:u64,resolution:u64>",
    "dependency-kind": "enum<dependent,constant,fixed,tunable,discrete>",
    "variable-dependency": (
        "record<dependent-value-reference:value-reference,element-index-of-dependent:u32,"
        "independent-value-reference:value-reference,element-index-of-independent:u32,kind:dependency-kind>"
    ),
    "discrete-states-info": (
        "record<new-discrete-states-needed:bool,terminate-simulation:bool,nominals-of-continuous-states-changed:bool,"
        "values-of-continuous-states-changed:bool,next-event-time-defined:bool,next-event-time:f64>"
    ),
}
_VALUES = {
    **{f"float{n}": f"f{n}" for n in (32, 64)},
    **{f"int{n}": f"s{n}" for n in (8, 16, 32, 64)},
    **{f"uint{n}": f"u{n}" for n in (8, 16, 32, 64)},
    "boolean": "bool", "string": "string", "binary": "list<u8>", "clock": "bool",
}  # fmt: skip
_REFERENCES, _SEED = (
    "value-references:list<value-reference>",
    "unknowns:list<value-reference>,knowns:list<value-reference>,seed:list<f64>",
)
_FRACTION, _REQUESTS = "interval-fraction", "requests:list<tuple<value-reference,u32>>"
#: Methods of both interfaces by name: parameters after the instance, and result.
_COMMON = {
    "set-debug-logging": ("logging-on:bool,categories:list<string>", "status"),
    "enter-initialization-mode": ("tolerance:option<f64>,start-time:f64,stop-time:option<f64>", "status"),
    **dict.fromkeys(("exit-initialization-mode", "enter-event-mode"), ("", "status")),
    "update-discrete-states": ("", "result<discrete-states-info,status>"),
    **dict.fromkeys(("terminate", "reset", "enter-configuration-mode", "exit-configuration-mode"), ("", "status")),
    **{f"get-{name}": (_REFERENCES, f"result<list<{kind}>,status>") for name, kind in _VALUES.items()},
    **{f"set-{name}": (f"{_REFERENCES},values:list<{kind}>", "status") for name, kind in _VALUES.items()},
    "get-number-of-variable-dependencies": ("vr:value-reference", "result<u64,status>"),
    "get-variable-dependencies": ("dependent:value-reference", "result<list<variable-dependency>,status>"),
    "get-fmu-state": ("", "result<fmu-state,status>"),
    "set-fmu-state": ("state:fmu-state", "status"),
    "get-directional-derivative": (_SEED, "result<list<f64>,status>"),
    "get-adjoint-derivative": (_SEED, "result<list<f64>,status>"),
    "get-interval-decimal": (_REFERENCES, "result<list<tuple<f64,interval-qualifier>>,status>"),
    "get-interval-fraction": (_REFERENCES, f"result<list<tuple<{_FRACTION},interval-qualifier>>,status>"),
    "get-shift-decimal": (_REFERENCES, "result<list<f64>,status>"),
    "get-shift-fraction": (_REFERENCES, f"result<list<{_FRACTION}>,status>"),
    "set-interval-decimal": (f"{_REFERENCES},intervals:list<f64>", "status"),
    "set-interval-fraction": (f"{_REFERENCES},intervals:list<{_FRACTION}>", "status"),
    "set-shift-decimal": (f"{_REFERENCES},shifts:list<f64>", "status"),
    "set-shift-fraction": (f"{_REFERENCES},shifts:list<{_FRACTION}>", "status"),
    "evaluate-discrete-states": ("", "status"),
    "get-output-derivatives": (_REQUESTS, "result<list<f64>,status>"),
    "enter-step-mode": ("", "status"),
}  # fmt: skip
_NAMED = "instance-name:string,instantiation-token:string,resource-path:string,visible:bool,logging-on:bool"
_LISTS = ("continuous-state-derivatives", "event-indicators", "continuous-states", "nominals-of-continuous-states")
#: For each interface its own type, the parameters of a new instance, and its own methods.
_INTERFACES = {
    "co-simulation": (
        {
            "do-step-result": "record<last-successful-time:f64,event-handling-needed:bool,terminate-simulation:bool,"
            "early-return:bool>"
        },
        f"{_NAMED},event-mode-used:bool,early-return-allowed:bool,required-intermediate-variables:list<value-reference>",
        {
            "set-input-derivatives": (f"{_REQUESTS},values:list<f64>", "status"),
            "do-step": (
                "current-communication-point:f64,communication-step-size:f64,no-set-fmu-state-prior-to-current-point:bool",
                "result<do-step-result,status>",
            ),
        },
    ),
    "model-exchange": (
        {"completed-step-result": "record<enter-event-mode:bool,terminate-simulation:bool>"},
        _NAMED,
        {
            "enter-continuous-time-mode": ("", "status"),
            "set-time": ("time:f64", "status"),
            "set-continuous-states": ("continuous-states:list<f64>", "status"),
            **{f"get-{name}": ("", "result<list<f64>,status>") for name in _LISTS},
            **{f"get-number-of-{name}": ("", "result<u64,status>") for name in ("event-indicators", "continuous-states")},
            "completed-integrator-step": (
                "no-set-fmu-state-prior-to-current-point:bool", "result<completed-step-result,status>"
            ),
        },
    ),
}  # fmt: skip
_PRIMITIVE = {"bool", "string", "f32", "f64", *(f"{sign}{bits}" for sign in "su" for bits in (8, 16, 32, 64))}


def component(module: bytes) -> bytes:
    """Wrap the core WebAssembly module of an FMU as a WebAssembly component, and return it.

    MissingLibraryError is raised if wasmtime, which assembles the component's text to binary, is not installed.
    """
    frame = _frame()
    # put the module in the place of the frame's second core module, which is empty; a section is number, length and content
    parts, place, number = [frame[:8]], 8, 0
    while place < len(frame):
        size, begin = _length(frame, place + 1)
        section = frame[place : begin + size]
        if frame[place] == 1:
            number += 1
            section = b"\x01" + _leb(len(module)) + module if number == 2 else section
        parts.append(section)
        place = begin + size
    return b"".join(parts)


def manifest() -> bytes:
    """Return the manifest of the layered standard FMI-LS-WASM as XML."""
    text = "FMI Layered Standard for WebAssembly"
    return to_xml_bytes(layered_standard("fmiLayeredStandardManifest", STANDARD, "0.1.0", text))


def _length(data: bytes, place: int) -> tuple[int, int]:
    """Read a LEB128 number, seven bits in each byte, that begins at index ``place``; return it and the index after it."""
    value = shift = 0
    while True:
        byte = data[place]
        place, value, shift = place + 1, value | (byte & 0x7F) << shift, shift + 7
        if byte < 0x80:
            return value, place


def _leb(value: int) -> bytes:
    parts = []
    while value >= 0x80:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])


@lru_cache
def _frame() -> bytes:
    require("wasmtime")
    from wasmtime import wat2wasm

    return bytes(wat2wasm("\n".join(["(component", *_outer_lines(), ")"])))


def _split(text: str) -> list[str]:
    """Split the text of a list at the commas outside brackets."""
    parts, depth, begin = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter == "<") - (letter == ">")
        if letter == "," and not depth:
            parts.append(text[begin:place])
            begin = place + 1
    return [*parts, text[begin:]] if text else []


class _Types:
    """Definitions of types in one scope of WebAssembly's text format, in which every compound type needs a name."""

    def __init__(self, lines: list[str], known: dict[str, str] | None = None) -> None:
        self.lines, self.known = lines, dict(known or {})

    def define(self, text: str) -> str:
        """Return the name of a type in this scope; define the type first if it is not known."""
        if text in _PRIMITIVE:
            return text
        if text not in self.known:
            definition = self._definition(text)
            self.known[text] = f"$t{len(self.lines)}"
            self.lines.append(f"(type {self.known[text]} {definition})")
        return self.known[text]

    def define_named(self, text: str) -> str:
        """Return the name of a type, as `define` does; give a primitive type a name, too."""
        if text in _PRIMITIVE:
            self.lines.append(f"(type $t{len(self.lines)} {text})")
            return f"$t{len(self.lines) - 1}"
        return self.define(text)

    def _definition(self, text: str) -> str:
        found = re.fullmatch(r"([a-z]+)<(.*)>", text)
        assert found, text
        kind, parts = found[1], _split(found[2])
        if kind == "enum":
            return f"(enum {' '.join(map(_quote, parts))})"
        if kind == "record":
            fields = (part.partition(":") for part in parts)
            return f"(record {' '.join(f'(field {_quote(name)} {self.define(member)})' for name, _, member in fields)})"
        if kind == "result":
            return f"(result {self.define(parts[0])} (error {self.define(parts[1])}))"
        return f"({kind} {' '.join(map(self.define, parts))})"

    def function(self, parameters: str, result: str) -> str:
        """Return the parameters and the result of a function in the text format."""
        pairs = [part.partition(":") for part in _split(parameters)]
        given = " ".join(f"(param {_quote(name)} {self.define(kind)})" for name, _, kind in pairs)
        return f"{given} (result {self.define(result)})" if result else given


def _quote(name: str) -> str:
    return f'"{name}"'


def _interface(name: str) -> str:
    return f'"{_PACKAGE}/{name}@{_VERSION}"'


def _methods(interface: str) -> Iterator[tuple[str, str, str, str]]:
    """Yield for each method of an interface: the name of its C function, the method's name, its parameters and its result."""
    _, making, own = _INTERFACES[interface]
    resource = f"{interface}-instance"
    yield f"instantiate-{interface}", f"[static]{resource}.instantiate-{interface}", making, f"option<own<{resource}>>"
    for name, (parameters, result) in (_COMMON | own).items():
        given = ",".join(filter(None, (f"self:borrow<{resource}>", parameters)))
        yield name, f"[method]{resource}.{name}", given, result


def _outer_lines() -> list[str]:
    """Return the lines of the component: imports, core modules and their instances, lifted functions, exports."""
    shared: list[str] = []
    types = _Types(shared)
    for name, kind in _TYPES.items():
        shared.append(f"(export {_quote(name)} (type ${name} (eq {types.define_named(kind)})))")
        types.known[name] = f"${name}"
    log = "instance-name:string,status:status,category:string,message:string"
    lines = [
        f"(type $shared (instance {' '.join(shared)}))",
        f"(import {_interface('types')} (instance $types (type $shared)))",
        *(f"(alias export $types {_quote(name)} (type ${name}))" for name in _TYPES),
        f"(type $heard (instance (alias outer 1 $status (type $s)) (export {_quote('status')} (type $status (eq $s)))",
        f" (export {_quote('log-message')} (func {_Types([], {'status': '$status'}).function(log, '')}))))",
        f"(import {_interface('callbacks')} (instance $callbacks (type $heard)))",
        f'(core module $memory (memory (export "memory") {PAGES}))',
        "(core module $fmu)",
        "(core instance $memory (instantiate $memory))",
        '(alias core export $memory "memory" (core memory $space))',
        f"(alias export $callbacks {_quote('log-message')} (func $log))",
        "(core func $lowered (canon lower (func $log) (memory $space) string-encoding=utf8))",
        f"(core instance $host (export {_quote('log-message')} (func $lowered)))",
        '(core instance $fmu (instantiate $fmu (with "env" (instance $memory)) (with "callbacks" (instance $host))))',
        *(
            f"(alias core export $fmu {_quote(name)} (core func ${name}))"
            for name in ("cabi_realloc", "forget", "drop")
        ),
    ]
    known = _Types(lines, {name: f"${name}" for name in _TYPES})
    for interface in _INTERFACES:
        lines += _resource(interface)
        known.known[f"{interface}-instance"] = f"${interface}-instance"
    how = "(memory $space) (realloc $cabi_realloc) string-encoding=utf8 (post-return $forget)"
    lines += [
        '(alias core export $fmu "get-version" (core func $core-version))',
        f"(func $version (result string) (canon lift (core func $core-version) {how}))",
        '(component $common (import "version" (func $f (result string)))',
        ' (export "get-version" (func $f) (func (result string))))',
        '(instance $common (instantiate $common (with "version" (func $version))))',
        f"(export {_interface('common')} (instance $common))",
    ]
    for interface, (own, _, _) in _INTERFACES.items():
        for name, kind in own.items():
            known.known[name] = known.define(kind)
        given = []
        for c_name, name, parameters, result in _methods(interface):
            core, lifted = f"$core-{interface}-{c_name}", f"${interface}-{c_name}"
            made = f"$make-{interface}" if name.startswith("[static]") else "$fmu"
            signature = known.function(parameters, result)
            lines += [
                f"(alias core export {made} {_quote(c_name)} (core func {core}))",
                f"(func {lifted} {signature} (canon lift (core func {core}) {how}))",
            ]
            given.append(f"(with {_quote(c_name)} (func {lifted}))")
        given += [
            f"(with {_quote(f'type-{name}')} (type {known.define(name)}))"
            for name in (*_TYPES, *own, f"{interface}-instance")
        ]
        lines += [
            *_inner_lines(interface),
            f"(instance $of-{interface} (instantiate $shim-{interface} {' '.join(given)}))",
            f"(export {_interface(interface)} (instance $of-{interface}))",
        ]
    return lines


def _resource(interface: str) -> list[str]:
    """Return WebAssembly text that defines the type of an instance, and a core module that makes instances.

    The function of this module instantiates the FMU and replaces the instance's address in the result by a handle.
    """
    resource, making = f"${interface}-instance", f"instantiate-{interface}"
    # the core function receives texts and lists as address and count, and returns the address of its result
    count = sum(1 if part.endswith(":bool") else 2 for part in _split(_INTERFACES[interface][1]))
    numbers = " ".join(["i32"] * count)
    passed = " ".join(f"(local.get {n})" for n in range(count))
    area = f"(local.get {count})"
    return [
        f"(type {resource} (resource (rep i32) (dtor (core func $drop))))",
        f"(core func $new-{interface} (canon resource.new {resource}))",
        f"(alias core export $fmu {_quote(making)} (core func $raw-{interface}))",
        f'(core instance $parts-{interface} (export "raw" (func $raw-{interface})) (export "new" (func $new-{interface}))',
        ' (export "memory" (memory $space)))',
        f'(core module $maker-{interface} (import "" "memory" (memory 1))',
        f' (import "" "raw" (func $raw (param {numbers}) (result i32))) (import "" "new" (func $new (param i32) (result i32)))',
        f" (func (export {_quote(making)}) (param {numbers}) (result i32) (local i32)",
        f" (local.set {count} (call $raw {passed}))",
        f" (if (i32.load8_u {area}) (then (i32.store offset=4 {area} (call $new (i32.load offset=4 {area}))))) {area}))",
        f'(core instance $make-{interface} (instantiate $maker-{interface} (with "" (instance $parts-{interface}))))',
    ]


def _inner_lines(interface: str) -> list[str]:
    """Return the lines of the inner component of an interface, which exports its imports under the names of the interface."""
    own, resource = _INTERFACES[interface][0], f"{interface}-instance"
    lines: list[str] = []
    outer, inner = _Types(lines), _Types(lines)
    for name, kind in (_TYPES | own).items():
        lines.append(f"(import {_quote(f'type-{name}')} (type $in-{name} (eq {outer.define_named(kind)})))")
        outer.known[name] = f"$in-{name}"
    lines.append(f"(import {_quote(f'type-{resource}')} (type $in-{resource} (sub resource)))")
    outer.known[resource] = f"$in-{resource}"
    functions = list(_methods(interface))
    for c_name, _, parameters, result in functions:
        signature = outer.function(parameters, result)
        lines.append(f"(import {_quote(c_name)} (func $in-{c_name} {signature}))")
    for name in (*_TYPES, *own, resource):
        lines.append(f"(export $out-{name} {_quote(name)} (type $in-{name}))")
        inner.known[name] = f"$out-{name}"
    for c_name, name, parameters, result in functions:
        signature = inner.function(parameters, result)
        lines.append(f"(export {_quote(name)} (func $in-{c_name}) (func {signature}))")
    return [f"(component $shim-{interface}", *lines, ")"]
