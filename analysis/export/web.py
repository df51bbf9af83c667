"""Build a mechanism for a browser: the C of a native FMU with an interface of its own, as WebAssembly without imports.

The sizes of the arrays depend on the mechanism; each mechanism therefore has a WebAssembly module of its own.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from linkwork.mechanism import Mechanism

from ..mechanisms import check
from ..numerics import symbolic
from ..run import MOTOR, expressions, inertia_and_stiffness, kloss
from .archive import SOURCES
from .description import NATIVE
from .equations_c import generated_files, trace_start, write_c_functions
from .native_fmu import EVERYWHERE, WASM, WASM_OPTIONS, compile_library

#: C files that a browser's module shares with a native FMU, and the folder of its own files.
_SHARED = ("model.h", "plant.h", "plant.c", "step.h")
_OWN = Path(__file__).with_name("browser")
#: Equations to which the page adds a motor's torque: the shell calls them with the prefix ``driven_``.
_DRIVEN = ("derivative", "outputs", "clearance", "forward")


def build_web(mechanism: Mechanism, coupled: Mapping[int, float] = MappingProxyType({})) -> bytes:
    """Build the WebAssembly of a mechanism; see `browser/studio.c` for its functions.

    Parameters
    ----------
    mechanism : Mechanism
    coupled : mapping of int to float
        Turns, per turn of the crank, of the rotations that springs couple to it, by the index of the degree of freedom.

    Raises
    ------
    BuildError, MechanismError
        If a file does not compile, or the parts of the mechanism do not fit together.
    """
    check(mechanism)
    with tempfile.TemporaryDirectory(prefix="linkwork-web-") as folder:
        sources = web_sources(mechanism, coupled)
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        files = [name for name in sources if name.endswith(".c")]
        compile_library(folder, files, "module.wasm", EVERYWHERE[WASM].target, WASM_OPTIONS)
        return (Path(folder) / "module.wasm").read_bytes()


def web_sources(mechanism: Mechanism, coupled: Mapping[int, float]) -> dict[str, str]:
    """Return all C files of a mechanism's WebAssembly module by name; ``coupled`` is that of `build_web`."""
    files = {name: (SOURCES / "native" / name).read_text(encoding="utf-8") for name in _SHARED}
    files |= {path.name: path.read_text(encoding="utf-8") for path in sorted(_OWN.glob("*.[ch]"))}
    others = [f"Equation driven_{name};\n#define equations_{name} driven_{name}\n" for name in _DRIVEN]
    files["model.h"] += f"#ifndef DRIVEN_C\n{''.join(others)}#endif\n"
    return (
        files
        | generated_files(mechanism, NATIVE)
        | {"drawing.h": _header(mechanism, coupled), "drawing.c": _drawing(mechanism)}
    )


def crank_index(mechanism: Mechanism) -> int:
    """Return the index of the first degree of freedom that is a crank; -1 if there is none."""
    return next(iter(mechanism.cyclic_freedoms), -1)


def _header(mechanism: Mechanism, coupled: Mapping[int, float]) -> str:
    """Return the text of drawing.h: the declarations that a browser's module has in addition to a native FMU's."""
    joints = mechanism.drawing.joints if mechanism.drawing else ()
    freedoms = mechanism.freedoms
    crank = crank_index(mechanism)
    forces = {c.argument for c in mechanism.channels if c.kind == "force"}
    modes = [-1 if freedom.mode is None else mechanism.modes.index(freedom.mode) for freedom in freedoms]
    freeing = [
        sum(1 << n for n, argument in enumerate(freedom.mode.arguments) if argument in forces) if freedom.mode else 0
        for freedom in freedoms
    ]
    turn = freedoms[crank].period if crank >= 0 else 0.0
    growth = [coupled.get(n, 0.0) * turn for n in range(len(freedoms))]
    rounds = [0.0 if n in (crank, *coupled) else f.period for n, f in enumerate(freedoms)]
    return "\n".join(
        [
            f"/* The picture of a {mechanism.name}, and the drive modes that leave its freedoms free. Generated. */",
            "#include <stdbool.h>",
            '#include "model.h"',
            "/* TORQUE: index of the input that is the torque on the crank, -1 if there is none */",
            f"enum {{ JOINTS = {len(joints)}, CRANK = {crank}, TORQUE = {_torque_input(mechanism, crank)} }};",
            f"enum {{ MOTOR = {len(MOTOR)} }};",
            "extern double motor[MOTOR], motor_change[MOTOR];",
            f"#define PERIOD {turn!r}",
            "/* for each freedom: index of its mode, -1 if it has none; a bit for each mode value that leaves it to a force */",
            f"static const int mode_of[FREEDOMS] = {{{', '.join(map(str, modes))}}};",
            f"static const int freeing[FREEDOMS] = {{{', '.join(map(str, freeing))}}};",
            "/* growth in a turn of the crank of rotations coupled to it by springs; which nothing drives; a turn of others */",
            f"static const double coupled[FREEDOMS] = {{{', '.join(map(repr, growth))}}};",
            f"static const bool swings[FREEDOMS] = {{{', '.join(str(f.swings).lower() for f in freedoms)}}};",
            f"static const double rounds[FREEDOMS] = {{{', '.join(map(repr, rounds))}}};",
            "Equation equations_joints;         /* x, m, u, p -> places */",
            "Equation equations_joints_forward; /* m, parameters, state as given, u, dparameters, dstate -> dplaces */",
            "Equation equations_motor;          /* motor, crank's speed -> torque */",
            "Equation equations_motor_forward;  /* ..., dmotor, dspeed -> dtorque */",
            "Equation equations_slopes;         /* x, m, u, p, motor -> x', accelerations by coordinates, rates */",
            "Equation equations_along;          /* ..., dx, du, dp, dmotor -> accelerations; both without a switch */",
            "Equation equations_at_rest;        /* crank angle, p -> mass of the freedom beside the crank */",
            "",
        ]
    )


def _torque_input(mechanism: Mechanism, crank: int) -> int:
    """Return the index of the input that is the torque on the crank; -1 if there is none.

    ``crank`` is the index of the crank among the degrees of freedom, -1 without a crank.
    """
    return next((n for n, c in enumerate(mechanism.channels) if c.kind == "force" and c.freedom == crank >= 0), -1)


def _drawing(mechanism: Mechanism) -> str:
    """Return the text of drawing.c: positions of the joints and their derivatives by parameters and initial state."""
    casadi = symbolic.library()
    join, sx = casadi.vertcat, casadi.SX
    modes, u = sx.sym("modes", len(mechanism.modes)), sx.sym("u", len(mechanism.channels))
    x, p = sx.sym("x", mechanism.size), sx.sym("p", len(mechanism.constants._fields) + 1)
    own, state, p_begun, x_begun, _, _ = trace_start(mechanism, modes, u)
    at = casadi.Function("at", [x, modes, u, p], [_joint_positions(mechanism, x, modes, u, p)])
    given = join(own, state)
    d_own, d_state = sx.sym("d_own", *own.shape), sx.sym("d_state", *state.shape)
    change = casadi.jtimes(at(x_begun, modes, u, p_begun), given, join(d_own, d_state))
    made = (
        casadi.Function(f"equations_{name}", arguments, [casadi.densify(r) for r in results], {"cse": True})
        for name, arguments, *results in (
            ("joints", [x, modes, u, p], at(x, modes, u, p)),
            ("joints_forward", [modes, own, state, u, d_own, d_state], change),
            *_motor_functions(mechanism),
        )
    )
    return write_c_functions(made, "drawing")


def _motor_functions(mechanism: Mechanism) -> list[tuple[Any, ...]]:
    """Return the functions for the motor on the studio's page, each as (name, arguments, *results).

    The functions are: the motor torque and its derivative; the derivative of the state with the motor, and the derivatives of
    the accelerations; and, for the natural frequency, the inertia at rest in the coordinate beside the crank angle.
    """
    casadi = symbolic.library()
    join, sx, freedoms = casadi.vertcat, casadi.SX, len(mechanism.freedoms)
    motor, speed, d_motor, d_speed = (sx.sym(n, size) for n, size in zip("mvde", (len(MOTOR), 1, len(MOTOR), 1)))
    torque = kloss(motor, speed)
    crank = crank_index(mechanism)
    other = next((n for n in range(freedoms) if n != crank), -1)
    trace, place = expressions(mechanism), _torque_input(mechanism, crank)
    run = trace.symbols
    acting = join(run.u)
    if place >= 0:
        acting[place] += casadi.substitute(torque, speed, run.x[freedoms + crank])
    slopes = casadi.substitute(trace.derivative, run.u, acting)
    accelerations, variables = slopes[freedoms : 2 * freedoms], [run.x, run.u, run.p, motor]
    changes = [sx.sym(f"d{n}", *v.shape) for n, v in enumerate(variables)]
    angle, k = sx.sym("angle"), sx.sym("k", len(mechanism.constants._fields))
    mass = inertia_and_stiffness(mechanism, (crank,), other)(angle, 0.0, k)[0] if min(crank, other) >= 0 else sx(0.0)
    d_torque = casadi.jtimes(torque, join(motor, speed), join(d_motor, d_speed))
    return [
        ("motor", [motor, speed], torque),
        ("motor_forward", [motor, speed, d_motor, d_speed], d_torque),
        ("slopes", [*run, motor], slopes, casadi.jacobian(accelerations, run.x)[:, : 2 * freedoms]),
        ("along", [*run, motor, *changes], casadi.jtimes(accelerations, join(*variables), join(*changes))),
        ("at_rest", [angle, k], mass),
    ]


def _joint_positions(mechanism: Mechanism, x: Any, modes: Any, u: Any, p: Any) -> Any:
    casadi = symbolic.library()
    drawing = mechanism.drawing
    if drawing is None:
        return casadi.SX.zeros(1)
    functions = symbolic.symbolic_functions((*mechanism.modules, sys.modules[drawing.positions.__module__]))
    *constants, _ = casadi.vertsplit(p)
    k = mechanism.constants(*constants)
    if mechanism.switch:  # the positions of the joints do not depend on friction
        k = k._replace(**{mechanism.switch: 0.0})
    modes, channels = (tuple(casadi.vertsplit(v)) if v.numel() else () for v in (modes, u))
    acting = functions.find(mechanism.equations.apply_inputs)(modes, channels, k)
    return casadi.vertcat(*functions.find(drawing.positions)(tuple(casadi.vertsplit(x)), acting, k))
