"""Compare runs that must be equal, such as a run and its repetition after a reset, and one step with two half steps."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence

from .context import Context
from .drive import Inputs, Run, Values, first_difference, random_inputs, step_size
from .findings import QUESTIONABLE, WRONG
from .walk import byte_array, serialize

_STEPS = 20
#: Relative difference between one step and two half steps above which there is a (questionable) finding.
SPLIT_TOLERANCE = 1e-2


def _run_steps(run: Run, steps: Sequence[Inputs]) -> list[Values]:
    values = []
    for inputs in steps:
        run.step(step_size(run.model), inputs)
        values.append(run.values())
    return values


def _compare(context: Context, one: Sequence[Values], other: Sequence[Values], key: str, what: str) -> None:
    for number, (a, b) in enumerate(zip(one, other), 1):
        name = first_difference(a, b, context.model)
        if name:
            context.note(WRONG, key, f"{what}: {name} differs from step {number} on")
            return


def check_repetition(context: Context, case: int) -> None:
    """Check that the same calls give the same values in a new instance, after a reset, and beside another instance."""
    steps = random_inputs(context.random(case), context.model, _STEPS)
    first = Run(context.session())
    expected = _run_steps(first, steps)
    first.session.need("Reset")
    again = Run(first.session, instantiate=False)
    what = "a run after Reset is not that of a new instance"
    _compare(context, expected, _run_steps(again, steps), "Reset: another run", what)
    again.session.free()
    if context.model.once:
        return
    one, other = Run(context.session()), Run(context.session())
    courses: tuple[list[Values], list[Values]] = ([], [])
    for inputs, different in zip(steps, reversed(steps)):
        courses[0].extend(_run_steps(one, [inputs]))
        courses[1].extend(_run_steps(other, [different]))
    one.session.free()
    what = "a run beside another instance is not that of one alone"
    _compare(context, expected, courses[0], "two instances: another run", what)
    other.step(step_size(context.model))
    other.session.free()


def check_restoring(context: Context, case: int) -> None:
    """Check that a run from a restored state gives the same values bit by bit, whatever the instance did after the saving."""
    rng = context.random(case)
    steps = random_inputs(rng, context.model, 2 * _STEPS)
    run = Run(context.session())
    for inputs in steps[: rng.randint(0, _STEPS)]:
        run.step(step_size(context.model), inputs)
    state, time, event = run.save(), run.time, run.next_event
    at = run.values()
    expected = _run_steps(run, steps[_STEPS:])
    ways: list[tuple[str, Callable[[], object]]] = [
        ("after more steps", lambda: None),
        ("after other steps", lambda: _run_steps(run, steps[:5])),
        ("after Terminate", lambda: run.session.need("Terminate")),
        ("after Reset", lambda: run.session.need("Reset")),
    ]
    for way, disturb in ways:
        disturb()
        run.restore(state, time, event)
        what = f"a run continued from a state that was restored {way} is not the run that was saved"
        _compare(context, [at], [run.values()], f"{way}: state not restored", what)
        _compare(context, expected, _run_steps(run, steps[_STEPS:]), f"{way}: state not restored", what)
    run.forget(state)
    run.session.free()


def check_serializing(context: Context, case: int) -> None:
    """Check that a state is serialized to the same bytes twice; write the bytes and the run from this state to a file.

    `check_deserializing` reads the file in another process.
    """
    steps = random_inputs(context.random(case), context.model, 2 * _STEPS)
    run = Run(context.session())
    _run_steps(run, steps[:_STEPS])
    state = run.save()
    data = serialize(run.session, state)
    if serialize(run.session, state) != data:
        context.note(
            QUESTIONABLE, "SerializeFMUState: other bytes", "two serializations of one state are not the same bytes"
        )
    time, event = run.time, run.next_event
    expected = _run_steps(run, steps[_STEPS:])
    run.forget(state)
    run.session.free()
    kept = {"data": data.hex(), "time": time, "event": None if math.isinf(event) else event}
    kept["values"] = [{group: value.hex() for group, value in values.items()} for values in expected]
    (context.work / f"serialized-{context.model.interface}-{case}.json").write_text(json.dumps(kept), encoding="utf-8")
    context.say(f"{len(data)} bytes")


def check_deserializing(context: Context, case: int) -> None:
    """Restore a state that `check_serializing` wrote in another process; check that a run from it has the recorded values."""
    path = context.work / f"serialized-{context.model.interface}-{case}.json"
    if not path.exists():
        context.say("not made: no bytes were written")
        return
    kept = json.loads(path.read_text(encoding="utf-8"))
    steps = random_inputs(context.random(case, "serialize"), context.model, 2 * _STEPS)
    run = Run(context.session())
    data = byte_array(run.session, bytes.fromhex(kept["data"]))
    state = run.save()
    run.forget(state)
    run.session.need("DeserializeFMUState", data, len(data), state)
    run.restore(state, kept["time"], math.inf if kept["event"] is None else kept["event"])
    expected = [{group: bytes.fromhex(value) for group, value in values.items()} for values in kept["values"]]
    what = "a run continued from a state of another process is not the run that was serialized"
    _compare(context, expected, _run_steps(run, steps[_STEPS:]), "another process: state not restored", what)
    run.forget(state)
    run.session.free()


def compare_half_steps(context: Context, case: int) -> None:
    """Compare one step h with two steps h/2 at constant inputs, and report the largest relative difference of an output."""
    model = context.model
    if model.fixed_step:
        context.say("not made: the FMU takes steps of one size only")
        return
    inputs = random_inputs(context.random(case), model, 1)[0]
    outputs = [v for v in model.variables if v.causality == "output" and v.group in ("Real", "Float64")]
    if not outputs:
        return
    courses = []
    for parts in (1, 2):
        run = Run(context.session())
        run.set(inputs)
        course = []
        for _ in range(_STEPS):
            for _ in range(parts):
                run.step(model.step / parts)
            course.append(list(run.get(outputs)))
        run.session.free()
        courses.append(course)
    worst, name = 0.0, ""
    elements = [v for v in outputs for _ in range(v.size)]
    for column, output in enumerate(elements):
        one, two = ([row[column] for row in course] for course in courses)
        scale = max(*map(abs, one), 1e-6 * abs(output.nominal))  # smaller values are considered rounding errors
        difference = max(abs(a - b) for a, b in zip(one, two)) / scale
        if difference > worst:
            worst, name = difference, output.name
    context.say(f"largest relative difference {worst:.1e}{' of ' + name if name else ''}")
    if not worst <= SPLIT_TOLERANCE:
        context.note(
            QUESTIONABLE,
            "step and halves: difference",
            f"one step of {model.step:g} s and two halves differ by {worst:.1e} of {name}'s largest value",
        )
