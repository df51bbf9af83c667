"""Make random sequences of calls: legal calls only, or legal calls with one forbidden call.

A case is one instance, from its instantiation until it is freed.
"""

from __future__ import annotations

import math
import random

from .context import Context
from .faults import ACCEPT, BadStart, Fault, bad_starts, catalogue
from .findings import QUESTIONABLE, WRONG
from .session import ERROR, FATAL, OK, WARNING
from .walk import Walk, access

#: Approximate mean number of calls in a case with legal calls only.
_LENGTH = 60


def run_legal_calls(context: Context, case: int) -> None:
    """Make random legal calls on one instance, and check that the FMU accepts them."""
    rng = context.random(case)
    session = context.session()
    if not session.instantiate(event_mode=rng.random() < 0.7, early_return=rng.random() < 0.5):
        said = f": {session.messages[-1]}" if session.messages else ""
        text = f"{session.prefix}Instantiate returned NULL for a legal call{said}"
        context.note(WRONG, "Instantiate: NULL", text)
        return
    walk = Walk(session, rng, context.note)
    for _ in range(rng.randint(5, 2 * _LENGTH)):
        walk.step()
        if walk.state == "error" and rng.random() < 0.5:
            break
    _end(walk)


def list_faults(context: Context) -> list[Fault | BadStart]:
    """Return all faults that can be tried on the FMU, always in the same order."""
    if not context.faults:
        walk = Walk(context.session(), random.Random(0), context.note)
        context.faults += [*bad_starts(context.model), *catalogue(walk)]
    return context.faults


def run_forbidden_call(context: Context, case: int) -> None:
    """Make one forbidden call on one instance; the cases try all faults in turn, each at least once."""
    faults = list_faults(context)
    fault = faults[case % len(faults)]
    if fault.key in context.avoided:
        return
    context.tell(fault.key)
    rng = context.random(case)
    session = context.session()
    walk = Walk(session, rng, context.note)
    walk.judged = False
    if isinstance(fault, BadStart):
        _start_badly(context, walk, fault)
    elif session.instantiate(event_mode=rng.random() < 0.5):
        _call_wrongly(context, walk, fault, case // len(faults))
        _make_later_calls(walk)


def _start_badly(context: Context, walk: Walk, fault: BadStart) -> None:
    session = walk.session
    _, arguments = session.instantiation()
    arguments[fault.position] = fault.value
    made = session.instantiate(arguments)
    name = f"{session.prefix}Instantiate"
    if made and fault.accepted not in (None, ACCEPT):
        context.note(str(fault.accepted), fault.key, f"{name} accepts {fault.what}")
    elif not made and fault.accepted == ACCEPT:
        context.note(QUESTIONABLE, fault.key, f"{name} refuses {fault.what}, which is allowed")
    if made:
        _make_later_calls(walk)


def _call_wrongly(context: Context, walk: Walk, fault: Fault, again: int) -> None:
    session, machine = walk.session, walk.machine
    reachable = [state for state in machine.states if machine.path(state, session.event_mode) is not None]
    allowed = fault.function in machine.allowed  # FreeInstance is not: it ends the case
    where = [s for s in reachable if not allowed or machine.cell(fault.function, s, session.event_mode) not in ".?"]
    # each time in another state, first in the state in which a simulation runs
    where.sort(key=lambda state: state not in ("step", "continuous"))
    target = fault.state or (where[again % len(where)] if where else None)
    if target is None or not walk.go(target) or (fault.state and walk.cell(fault.function) != "."):
        return
    if walk.model.can_save and not walk.saved and "FMU" in fault.function:
        walk.call({2: "GetFMUstate", 3: "GetFMUState"}[walk.model.version])
    arguments = walk.arguments(fault.function, whatever=True)
    changed = None if arguments is None else fault.change(walk, fault.function, arguments)
    if changed is None:
        return
    session.journal.write(f"\n# forbidden: {fault.what}")
    instance = None if fault.what == "NULL instance" else session.instance
    before = len(session.messages)
    status = session.call_instance(instance, fault.function, *changed)
    full, refused = f"{session.prefix}{fault.function}", status > WARNING
    if fault.accepted == ACCEPT:
        if refused:
            context.note(QUESTIONABLE, fault.key, f"{full} refuses {fault.what}, which the standard allows")
    elif not refused and fault.accepted is not None:
        what = f"a call in the state {walk.state!r}, where it is not allowed" if fault.state else fault.what
        context.note(fault.accepted, fault.key, f"{full} accepts {what}")
    elif status == FATAL:
        text = f"{full} returns Fatal for {fault.what}: Error would do"
        context.note(QUESTIONABLE, f"{fault.key}: Fatal", text)
    elif status == ERROR and instance and walk.logging and len(session.messages) == before < 100:
        text = f"{full} logs no reason for its Error, with logging on"
        context.note(QUESTIONABLE, f"{fault.function}: Error without a message", text)
    elif fault.what in ("NaN", "infinity"):
        _check_nan_step(context, walk, fault)
    if status == ERROR and instance:
        walk.state = "error"


def _check_nan_step(context: Context, walk: Walk, fault: Fault) -> None:
    """Note a finding if a step with an input that is NaN or infinite returns OK although outputs are not finite."""
    outputs = [v for v in walk.model.variables if v.causality == "output" and v.group == fault.function[3:]]
    if not outputs or walk.state != "step" or not walk.call("DoStep"):
        return
    arguments = access(walk.model, outputs)
    if walk.session.call(f"Get{outputs[0].group}", *arguments) == OK and not all(map(math.isfinite, arguments[2])):
        text = f"an input of {fault.what} is accepted, DoStep returns OK, and outputs are no numbers"
        context.note(QUESTIONABLE, f"{fault.key}: goes through", text)


def _make_later_calls(walk: Walk) -> None:
    """Make random calls after a forbidden call: read, continue, reset, free. Only a crash or a hang is a finding."""
    for _ in range(walk.rng.randint(0, 12)):
        walk.step()
    if walk.state == "error" and walk.rng.random() < 0.5 and walk.session.call("Reset") == OK:
        walk.follow_call("Reset", [], OK)
        walk.go("step" if walk.model.interface == "cs" else "continuous")
    _end(walk)


def _end(walk: Walk) -> None:
    if not walk.session.journal.fatal:
        for state, *_ in walk.saved:
            walk.session.call("FreeFMUState", state)
        walk.session.free()
