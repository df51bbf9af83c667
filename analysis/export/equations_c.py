"""Write the C of a native FMU that depends on the mechanism: its equations, by CasADi, and its tables."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from linkwork import integrate as integrator
from linkwork import limits, plant, tableau
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.parameters import NOT_NEGATIVE, POSITIVE, fmi_name

from ..numerics import symbolic
from ..run import equations
from .description import Kind, token
from .interface import Entry, interface, states

#: Added under square roots that are differentiated; lost in every sum with a square that is not zero.
TINY = 1e-300


def generated_files(mechanism: Mechanism, kind: Kind) -> dict[str, str]:
    """Return the generated files by name: sizes.h, tables.c, tableau.h and equations.c."""
    return {
        "sizes.h": _sizes(mechanism, kind),
        "tables.c": _tables(mechanism),
        "tableau.h": _tableau(),
        "equations.c": _equations(mechanism),
    }


# Equations

_START = "constants, RULES and error_scale must be arithmetic without branches, as the equations must"


def _equations(mechanism: Mechanism) -> str:
    made = {function.name(): function for function in functions(mechanism)}
    text = write_c_functions(made.values(), "equations")
    if mechanism.switch:
        text += _switched_calls(mechanism, made["equations_solution"].numel_out(0))
    return '#include "sizes.h"\n\n#ifndef LOCAL\n#define LOCAL\n#endif\n\n' + re.sub(
        "^int equations_", r"LOCAL \g<0>", text, flags=re.MULTILINE
    )


#: Auxiliary functions that CasADi writes for each function and that nothing calls.
_UNUSED = re.compile(
    r"^[\w* ]+_(?:\w+_mem|checkout|release|incref|decref|n_in|n_out|default_in|\w+_work|work\w*"
    r"|(?:name|sparsity)_(?:in|out)|\w+_size|version)"
    r"\([^)]*\) ?\{(?:[^\n]*\}|.*?^\})\n+",
    re.MULTILINE | re.DOTALL,
)


def write_c_functions(functions: Iterable[Any], file: str) -> str:
    """Return functions of CasADi as C for the shell; names that the functions share begin with ``file``."""
    options = {"with_header": False, "main": False, "casadi_int": "int", "with_export": False, "with_mem": False}
    generator = symbolic.library().CodeGenerator(f"{file}.c", options)
    for function in functions:
        generator.add(function)
    with TemporaryDirectory(prefix="linkwork-c-") as folder:
        generator.generate(f"{folder}/")
        text = (Path(folder) / f"{file}.c").read_text(encoding="utf-8")
    text = re.sub("^casadi_real casadi_", r"static \g<0>", _UNUSED.sub("", text), flags=re.MULTILINE)
    # the shell passes every argument and every result: without these tests the code is smaller
    return re.sub(r"arg\[(\d+)\]\? (arg\[\1\]\[\d+\]) : 0", r"\2", re.sub(r"if \(res\[\d+\]!=0\) ", "", text))


def _switched_calls(mechanism: Mechanism, numbers: int) -> str:
    """Return C functions that call, depending on the constants, the version with the mechanism's switch on or that with it off.

    With the switch on, the solution of the contact forces, an array of length ``numbers``, is computed once and passed to the
    function that needs it. Derivatives are always those with the switch on, because the constants may change too.
    """
    on = f"arg[3][{mechanism.switch_index}] != 0.0"
    sides = "(const double** arg, double** res, int* iw, double* w, int mem)"
    pair = f"return ({on} ? equations_clearance_on : equations_clearance_off)(arg, res, iw, w, mem);"
    text = f"\nint equations_clearance{sides} {{\n  {pair}\n}}\n"
    for name, (called, count, results) in _SWITCHED.items():
        given = ", ".join(f"arg[{n}]" for n in range(count))
        off = f"  if (!({on})) return equations_{name}_off(arg, res, iw, w, mem);\n" if called == "values" else ""
        text += f"""
int equations_{name}{sides} {{
{off}  double z[{numbers}], unused[OUTPUTS + STATES];
  (void)unused;
  equations_solution(arg, (double*[]){{z}}, iw, w, mem);
  return equations_{called}_on((const double*[]){{{given}, z}}, (double*[]){{{results}}}, iw, w, mem);
}}
"""
    return text


#: Functions that contain a solution if the switch is on: the function called then, its number of arguments, its results.
_SWITCHED = {
    "derivative": ("values", 4, "unused, res[0]"),
    "outputs": ("values", 4, "res[0], unused"),
    "forward": ("forward", 7, "res[0], res[1], res[2]"),
    "reverse": ("reverse", 7, "res[0], res[1], res[2]"),
}


def functions(mechanism: Mechanism) -> list[Any]:
    """Return as functions of CasADi the equations that the C shell calls; see model.h for their arguments."""
    casadi = symbolic.library()
    named = _table(mechanism, False)
    del named["solution"], named["values"]
    if mechanism.switch:
        on = _table(mechanism, True)
        for name in ("forward", "reverse"):
            del named[name]
        for name in ("derivative", "outputs", "clearance"):
            named[f"{name}_off"] = named.pop(name)
        named |= {f"{name}_on": on[name] for name in ("values", "forward", "reverse", "clearance")}
        named["solution"] = on["solution"]
    _check_start(mechanism, casadi.Function("begin", *named["begin"]))
    return [
        casadi.Function(f"equations_{name}", arguments, [casadi.densify(r) for r in results], {"cse": True})
        for name, (arguments, results) in named.items()
    ]


def _table(mechanism: Mechanism, switched: bool) -> dict[str, tuple[list[Any], list[Any]]]:
    """Return arguments and results of the functions by name, with the mechanism's switch on or off."""
    casadi = symbolic.library()
    sx, join = casadi.SX, casadi.vertcat
    trace = equations.expressions(mechanism, switched)
    s = trace.symbols
    try:
        own, state, p, x, scale, bounds = trace_start(mechanism, s.modes, s.u)
    except RuntimeError as error:
        raise LinkworkError(f"the start of {mechanism.name} cannot be traced: {_START}") from error
    dx, du, dp = (sx.sym(f"d{n}", *v.shape) for n, v in (("x", s.x), ("u", s.u), ("p", s.p)))
    at, change = join(s.x, s.u, s.p), join(dx, du, dp)
    values, z, _ = _with_solution(mechanism, s, switched, smooth=True)
    plain, given_z, solution = _with_solution(mechanism, s, switched, smooth=False)
    # arguments in addition to those of a run
    beside, beside_plain = ([z], [given_z]) if solution.numel() else ([], [])
    given = join(own, state, s.u)
    dgiven = [sx.sym(f"d{n}", *v.shape) for n, v in (("own", own), ("state", state), ("u", s.u))]

    def forward(results: list[Any], of: Any, change: Any) -> list[Any]:
        return [casadi.densify(casadi.jtimes(result, of, change)) for result in results]

    def reverse(results: list[Any], of: Any, parts: list[Any]) -> tuple[list[Any], list[Any]]:
        """Return weights of the results, and the gradient of their weighted sum with respect to the arguments."""
        weights = [sx.sym(f"g{n}", *result.shape) for n, result in enumerate(results)]
        gradient = casadi.densify(casadi.jtimes(join(*results), of, join(*weights), True))
        ends = [0]
        for part in parts:
            ends.append(ends[-1] + part.numel())
        return weights, [gradient[a:b] for a, b in itertools.pairwise(ends)]

    begin, run = [s.modes, own, state, s.u], [s.x, s.modes, s.u, s.p]
    weights, gradient = reverse(values, at, [s.x, s.u, s.p])
    jump_weights, jump_gradient = reverse([trace.jump], at, [s.x, s.u, s.p])
    begin_weights, begin_gradient = reverse([p, x], given, [own, state, s.u])
    return {
        "bounds": ([own], [bounds]),
        "begin": (begin, [p, x, scale]),
        "begin_forward": ([*begin, *dgiven], forward([p, x], given, join(*dgiven))),
        "begin_reverse": ([*begin, *begin_weights], begin_gradient),
        "derivative": (run, [trace.derivative]),
        "outputs": (run, [trace.outputs]),
        "solution": (run, [solution]),
        "values": ([*run, *beside_plain], plain[:2]),
        "clearance": (run, [trace.clearance]),
        "apart": ([s.x, s.p], [_unjoined_numbers(mechanism, s.x, s.p)]),
        "jump": (run, [trace.jump]),
        "jump_forward": ([*run, dx, du, dp], forward([trace.jump], at, change)),
        "jump_reverse": ([*run, *jump_weights], jump_gradient),
        "following": ([*run, (rates := sx.sym("rates", mechanism.size))], [_state_slope(mechanism, trace, rates)]),
        "forward": ([*run, dx, du, dp, *beside], forward(values, at, change)),
        "reverse": ([*run, *weights, *beside], gradient),
    }


def _unjoined_numbers(mechanism: Mechanism, x: Any, p: Any) -> Any:
    """Return the values that the message on links that cannot be joined quotes; a zero if it quotes none."""
    casadi = symbolic.library()
    if mechanism.unjoined is None or mechanism.unjoined.reach is None:
        return casadi.SX(0.0)
    reach = symbolic.symbolic_functions(mechanism.modules).find(mechanism.unjoined.reach)
    return casadi.vertcat(*reach(tuple(casadi.vertsplit(x)), mechanism.constants(*casadi.vertsplit(p)[:-1])))


def _state_slope(mechanism: Mechanism, trace: equations.TracedEquations, rates: Any) -> Any:
    """Return the derivative x' of a state for which jump(x, u) is the motion, with commands u of unknown accelerations a.

    ``rates`` is the derivative F of the motion for any a. The choice does not matter: jump_x x' = F - jump_u a, and a change of
    a changes F by jump_u times that change.
    """
    casadi = symbolic.library()
    s, n = trace.symbols, len(mechanism.freedoms)
    moving = casadi.SX.zeros(len(mechanism.channels))
    for number, channel in enumerate(mechanism.channels):
        if channel.kind == "command":
            moving[number] = rates[n + channel.freedom]

    def apply_jump(change: Any) -> Any:
        return casadi.jtimes(trace.jump, casadi.vertcat(s.x, s.u), casadi.vertcat(change, moving))

    free = casadi.diag(casadi.jacobian(trace.jump, s.x))[n : 2 * n]  # 1 for a freedom that nothing commands, else 0
    kept = casadi.vertcat(rates[: 2 * n], 0.0, 0.0)
    result = casadi.vertcat(rates[:n], rates[n : 2 * n] - free * (apply_jump(kept) - kept)[n : 2 * n], 0.0, 0.0)
    return casadi.vertcat(result[: 2 * n], (rates - apply_jump(result))[2 * n :])


def _with_solution(
    mechanism: Mechanism, s: equations.Symbols, switched: bool, *, smooth: bool
) -> tuple[list[Any], Any, Any]:
    """Return [outputs, derivative, clearance] as functions of symbols for the contact forces, these symbols, and the forces.

    The expressions apply one more sweep of Newton's method to the symbols, so that their derivatives are those at the
    solved forces. If ``smooth``, for differentiation, the root of a sum of squares has the derivative 0 at 0, instead of 0/0.
    """
    casadi = symbolic.library()
    found: dict[str, tuple[Any, Any]] = {}

    def mark_converged(solution: tuple[Any, ...]) -> tuple[Any, ...]:
        expressions = casadi.vertcat(*solution)
        # outputs and derivative have the same solution: it gets the same symbols
        graph = str(casadi.Function("solution", [s.x, s.modes, s.u, s.p], [expressions], {"cse": True}).serialize())
        symbols, _ = found.setdefault(graph, (casadi.SX.sym(f"z{len(found)}", len(solution)), expressions))
        return tuple(casadi.vertsplit(symbols))

    *p, energy = casadi.vertsplit(s.p)
    k = mechanism.constants(*p)
    if mechanism.switch:
        k = k._replace(**{mechanism.switch: float(switched)})
    modes, channels = (tuple(casadi.vertsplit(v)) if v.numel() else () for v in (s.modes, s.u))
    others = {"sqrt": lambda value: casadi.sqrt(value + TINY)} if smooth else {}
    functions = symbolic.symbolic_functions(mechanism.modules, mark_converged=mark_converged, **others)
    x = tuple(casadi.vertsplit(s.x))

    def trace_function(what: str, *further: Any) -> Any:
        acting = functions.find(mechanism.equations.apply_inputs)(modes, channels, k)
        result = functions.find(getattr(mechanism.equations, what))(x, acting, *further, k)
        return casadi.densify(casadi.vertcat(*result) if isinstance(result, tuple) else casadi.SX(result))

    values = [trace_function("outputs", energy), trace_function("derivative"), trace_function("clearance")]
    # what they have in common is differentiated once
    joined = casadi.cse(casadi.vertcat(*values))
    parts = casadi.vertsplit(joined, np.cumsum([0, *(value.numel() for value in values)]).tolist())
    symbols, expressions = (
        (casadi.vertcat(*column) for column in zip(*found.values())) if found else (casadi.SX(), casadi.SX())
    )
    return parts, symbols, expressions


def trace_start(mechanism: Mechanism, modes: Any, u: Any) -> tuple[Any, ...]:
    """Trace the start of a run.

    Return the symbols of the parameters and of the given state, then four expressions of them: the constants with the start
    energy appended, the initial state, its error scale, and the lower bounds of parameters.
    """
    casadi = symbolic.library()
    own, parameters, functions = equations.parameter_symbols(mechanism)
    state = casadi.SX.sym("state", 2 * len(mechanism.freedoms))
    k = parameters.constants()
    channels = tuple(casadi.vertsplit(u)) if mechanism.channels else ()
    e = mechanism.equations
    acting = functions.find(e.apply_inputs)(tuple(casadi.vertsplit(modes)) if mechanism.modes else (), channels, k)
    x = functions.find(e.start)((*casadi.vertsplit(state), 0.0, 0.0), acting, k)
    energy = functions.find(e.energy)(x, k)
    scale = functions.find(mechanism.error_scale)(parameters, x)
    bounds = [functions.find(least.of)(parameters) for least in mechanism.rules.least]
    return own, state, *(casadi.densify(casadi.vertcat(*v)) for v in ((*k, energy), x, scale, bounds))


def _check_start(mechanism: Mechanism, begin: Any) -> None:
    """Check that the traced start gives the numbers of each published set: tracing loses operations of NumPy and `float`."""
    for name, known in mechanism.published.items():
        modes = [mode.default for mode in mechanism.modes]
        state = mechanism.state(known.initial)[: 2 * len(mechanism.freedoms)]
        own = [float(getattr(known.parameters, field.name)) for field in fields(known.parameters)]
        constants, _, scale = begin(modes, own, state, [0.0] * len(mechanism.channels))
        found = [*np.asarray(constants).ravel()[:-1], *np.asarray(scale).ravel()]
        wanted = [
            *known.parameters.constants(),
            *mechanism.error_scale(known.parameters, mechanism.state(known.initial)),
        ]
        if not np.allclose(found, wanted, rtol=1e-12, atol=0.0):
            raise LinkworkError(f"the start of {mechanism.name}, traced, is another with the set {name}: {_START}")


# Tables


def _text(value: str) -> str:
    # a JSON string of ASCII is a C string; saved states quote sentences in which these texts are
    return json.dumps(value.replace('"', "'").replace("\\", "/"))


def _number(value: float) -> str:
    return repr(float(value))


def _array(name: str, values: Sequence[object], size: str, kind: str = "int") -> str:
    body = ", ".join(map(str, values)) or "{0}" if kind != "int" else ", ".join(map(str, values)) or "0"
    return f"LOCAL const {kind} {name}[{size}] = {{{body}}};"


def _sizes(mechanism: Mechanism, kind: Kind) -> str:
    commands = [c for c in mechanism.channels if c.kind == "command"]
    sizes = {
        "VARIABLES": len(interface(mechanism)),
        "PARAMETERS": len(fields(mechanism.parameters)),
        "BOUNDS": len(mechanism.rules.least),
        "FREEDOMS": len(mechanism.freedoms),
        "MODES": len(mechanism.modes),
        "INPUTS": len(mechanism.channels),
        "COMMANDS": len(commands),
        "OUTPUTS": len(mechanism.output_names),
        "STATES": mechanism.size,
        # with the energy at the start
        "CONSTANTS": len(mechanism.constants._fields) + 1,
        # index of the constant that chooses the functions; -1 if there is no choice
        "SWITCH": mechanism.switch_index,
    }
    constants = {
        "LIMIT_CLEARANCE": limits.LIMIT_SINE,
        "NEAR_CLEARANCE": limits.NEAR_LIMIT,
        "LEAST_TOLERANCE": plant.TOLERANCE_RANGE[0],
    }
    return "\n".join(
        [
            f"/* Sizes of a {mechanism.name}, and its names. Generated. */",
            "#ifndef SIZES_H",
            "#define SIZES_H",
            f"#define MODEL_IDENTIFIER {_text(kind.identifier(mechanism))}",
            f"#define TOKEN {_text(token(mechanism, kind))}",
            f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())} }};",
            *(f"#define {name} {_number(value)}" for name, value in constants.items()),
            f"#define ASSEMBLY {_text(limits.ASSEMBLY)}",
            f"#define JAMMING {_text(limits.JAMMING)}",
            *_unjoined_messages(mechanism),
            "#endif",
            "",
        ]
    )


def _unjoined_messages(mechanism: Mechanism) -> list[str]:
    """Return the C macros of the messages for links that cannot be joined, or hardly."""
    said = mechanism.unjoined or limits.UnjoinedMessages("the links cannot be joined", "", "")
    numbers = [f"(r)[{n}]" for n in range(said.apart.count("{"))]
    return [
        f"#define UNJOINED {_text(said.fact)}",
        f"#define SAY_APART(text, r) {_print_call(said.apart, numbers)}",
        f"#define SAY_NEAR(text, angle) {_print_call(said.near, ['angle'] if said.near else [])}",
    ]


def _print_call(form: str, values: Sequence[str]) -> str:
    """Return the C call that prints ``values`` into a text, from a format string of Python."""
    printed = re.sub(r"\{:(\.\d+\w)\}", r"%\1", form)
    given = [_text(printed), *values] if values else ['"%s"', _text(form)]
    return f"snprintf(text, SENTENCE, {', '.join(given)})"


def _tables(mechanism: Mechanism) -> str:
    entries = interface(mechanism)
    reference = {entry.variable.name: entry.reference for entry in entries}
    units = {entry.variable.name: entry.variable.unit for entry in entries}
    own = [fmi_name(field.name) for field in fields(mechanism.parameters)]
    initial = [f"initial.{freedom.initial[n]}" for n in (0, 1) for freedom in mechanism.freedoms]
    freedoms = [
        f"{{{_text(f.coordinate.replace('.', ' '))}, {_text(units[f.coordinate])}}}" for f in mechanism.freedoms
    ]
    rules = [f"{{{own.index(fmi_name(least.field))}, {_text(least.requirement)}}}" for least in mechanism.rules.least]
    rows = ",\n".join(f"    {_row(mechanism, entry)}" for entry in entries)
    return "\n".join(
        [
            f"/* Tables of a {mechanism.name}. Generated. */",
            '#include "model.h"',
            "",
            f"LOCAL const Variable variables[VARIABLES] = {{\n{rows},\n}};",
            _array("parameter_at", [reference[name] for name in own], "ROOM(PARAMETERS)"),
            _array("initial_at", [reference[name] for name in initial], "2 * FREEDOMS"),
            _array("mode_at", [reference[mode.name] for mode in mechanism.modes], "ROOM(MODES)"),
            _array("input_at", [reference[name] for name in mechanism.input_names], "ROOM(INPUTS)"),
            _array("state_at", states(mechanism), "STATES"),
            *(f"LOCAL const int {n}_at = {reference[f'solver.{n}']};" for n in ("tolerance", "status", "message")),
            _array("freedoms", freedoms, "FREEDOMS", "FreedomName"),
            _array("commands", _commands(mechanism), "ROOM(COMMANDS)", "Command"),
            _array("least", rules, "ROOM(BOUNDS)", "Least"),
            "",
        ]
    )


_KINDS = {"Real": "REAL", "Integer": "INTEGER", "String": "STRING"}


def _row(mechanism: Mechanism, entry: Entry) -> str:
    v = entry.variable
    causality = {"parameter": "PARAMETER", "input": "INPUT"}.get(v.causality, "COMPUTED")
    rule, low, high, requirement = _rule(mechanism, entry) if causality == "PARAMETER" else ("ANY", 0.0, 0.0, "")
    cells = (
        _text(v.name),
        _text(v.unit),
        _KINDS[v.kind],
        causality,
        _number(v.start) if causality != "COMPUTED" else "0.0",  # type: ignore[arg-type]
        _c_index(mechanism, entry),
        int(v.tunable),
        rule,
        _number(low),
        _number(high),
        _text(requirement),
    )
    return "{" + ", ".join(map(str, cells)) + "}"


def _c_index(mechanism: Mechanism, entry: Entry) -> str:
    """Return as C the row of a computed variable or the index of an input; -1 for any other variable."""
    if entry.role == "input":
        return str(mechanism.input_names.index(entry.variable.name))
    if entry.role == "output":
        return str(mechanism.output_names.index(entry.variable.name))
    if entry.role == "state":
        return f"STATE_ROW + {states(mechanism).index(entry.reference)}"
    if entry.role == "derivative":
        return f"DERIVATIVE_ROW + {states(mechanism).index(entry.derivative_of)}"
    return {"indicator": "MARGIN_ROW", "time": "TIME_ROW"}.get(entry.role, "-1")


def _rule(mechanism: Mechanism, entry: Entry) -> tuple[str, float, float, str]:
    """Return the condition on a parameter: rule, bounds, and the requirement in words."""
    rules = mechanism.rules
    name = entry.variable.name.replace(".", "_", 1)
    if entry.role == "tolerance":
        low, high = plant.TOLERANCE_RANGE
        return "WITHIN", low, high, f"be between {low:g} and {high:g}"
    if entry.role == "mode":
        mode = next(mode for mode in mechanism.modes if mode.name == entry.variable.name)
        return "WITHIN", 0.0, len(mode.values) - 1.0, plant.mode_requirement(mode)
    if entry.role == "initial" or name in rules.free_sign:
        return "ANY", 0.0, 0.0, "be a finite number"
    if name in rules.signs:
        return "PLUS_OR_MINUS_ONE", 0.0, 0.0, f"be +1 or -1, {rules.signs[name]}"
    if name in rules.positive:
        return "POSITIVE", 0.0, 0.0, POSITIVE
    return "NOT_NEGATIVE", 0.0, 0.0, NOT_NEGATIVE


def _commands(mechanism: Mechanism) -> list[str]:
    """Return a C row of `Command` for each channel that commands a rate.

    A row has the index of the channel, the index of its rate in the state, the index of the mode (-1 without one), the value
    of the mode at which the command is in force, and the index of the channel that gives the command's time derivative.
    """
    rows = []
    for number, channel in enumerate(mechanism.channels):
        if channel.kind != "command":
            continue
        mode = mechanism.freedoms[channel.freedom].mode
        rate = next(
            n for n, other in enumerate(mechanism.channels) if other.kind == "rate" and other.freedom == channel.freedom
        )
        at = (
            number,
            len(mechanism.freedoms) + channel.freedom,
            -1 if mode is None else mechanism.modes.index(mode),
            0 if mode is None else mode.arguments.index(channel.argument),
            rate,
        )
        rows.append("{" + ", ".join(map(str, at)) + "}")
    return rows


def _tableau() -> str:
    """Return the coefficients of the integrator as C."""
    rows = tableau.A[: tableau.STAGES + 1]
    ends = [0, 0]
    for row in rows[1:]:
        ends.append(ends[-1] + len(row))
    errors = [i for i in range(tableau.STAGES) if tableau.E5[i] != 0.0]
    number = _number
    steps = (integrator.integrate.__kwdefaults__ or {})["max_steps"]
    arrays: list[tuple[str, str, Sequence[object]]] = [
        ("double", "C", [number(c) for c in tableau.C[: tableau.STAGES]]),
        ("int", "A_ROW", ends[: len(rows) + 1]),
        ("int", "A_STAGE", [stage for row in rows for stage, _ in row]),
        ("double", "A_WEIGHT", [number(weight) for row in rows for _, weight in row]),
        ("int", "E_STAGE", errors),
        ("double", "E3", [number(tableau.E3[i]) for i in errors]),
        ("double", "E5", [number(tableau.E5[i]) for i in errors]),
    ]
    constants = {
        "SAFETY": integrator.SAFETY,
        "LEAST_FACTOR": integrator.LEAST_FACTOR,
        "GREATEST_FACTOR": integrator.GREATEST_FACTOR,
        "LEAST_STEP": integrator.LEAST_STEP,
    }
    lines = [
        "/* Coefficients of DOP853: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I. Generated. */",
        f"enum {{ STAGES = {tableau.STAGES}, ORDER = {tableau.ORDER}, ERROR_STAGES = {len(errors)}, MAX_STEPS = {steps} }};",
        *(f"#define {name} {number(value)}" for name, value in constants.items()),
        *(f"static const {kind} {name}[] = {{{', '.join(map(str, values))}}};" for kind, name, values in arrays),
        "",
    ]
    return "\n".join(lines)
