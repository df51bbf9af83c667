"""Check single values: derivatives against finite differences, declared bounds, start values."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .context import Context
from .drive import Run, random_inputs, step_size
from .findings import QUESTIONABLE, WRONG
from .model import Model, Variable
from .session import ProbeError
from .walk import derivative_arguments

#: Steps of the finite differences, relative to the size of the known; a derivative is compared
#: with the difference nearest to it.
_DIFFERENCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
#: A derivative is wrong if it differs from the closest finite difference by more than this share of the largest derivative of
#: the same unknown.
DERIVATIVE_TOLERANCE = 1e-4


def check_derivatives(context: Context, case: int) -> None:
    """Check directional derivatives by finite differences, and adjoint by directional derivatives, at a random state."""
    model, rng = context.model, context.random(case)
    run = _run_at_random_state(context, case)
    worst, name = 0.0, ""
    for unknown, knowns in rng.sample(model.dependencies, min(len(model.dependencies), 40)):
        knowns = tuple(k for k in knowns if model.interface == "me" or k.causality == "input")
        row = [_directional(run, [unknown], [known], [1.0])[0] for known in knowns]
        scale = max(map(abs, row), default=0.0) or 1.0
        for known, declared in zip(knowns, row):
            error, difference = min(_difference(run, unknown, known, step, declared) for step in _DIFFERENCES)
            error /= max(scale, abs(difference), _floor(unknown))
            if error > worst:
                worst, name = error, f"d {unknown.name} / d {known.name}"
            if not error <= DERIVATIVE_TOLERANCE:
                text = f"d {unknown.name} / d {known.name} is {declared!r}, differences give {difference:.9g}"
                context.note(WRONG, f"d {unknown.name} / d {known.name}: derivative", text)
        if knowns:
            seed = [rng.gauss(0, 1) for _ in knowns]
            _check_sums(context, run, unknown, knowns, seed, row)
    run.session.free()
    context.say(f"largest relative error beyond rounding {worst:.1e}{' of ' + name if name else ''}")


def _floor(unknown: Variable) -> float:
    """Return the magnitude below which a derivative of an unknown may be only a rounding error."""
    return 1e-8 * abs(unknown.nominal)


def _run_at_random_state(context: Context, case: int) -> Run:
    """Return a run in which derivatives may be read: in continuous-time mode, or for co-simulation in initialization mode."""
    exchange = context.model.interface == "me"
    run = Run(context.session(), finish=exchange)
    for inputs in random_inputs(context.random(case), context.model, 5 * case) if exchange else ():
        run.step(step_size(context.model), inputs)
    return run


def _directional(
    run: Run, unknowns: Sequence[Variable], knowns: Sequence[Variable], seed: Sequence[float]
) -> list[float]:
    arguments = derivative_arguments(run.model.version, unknowns, knowns, seed)
    run.session.need("GetDirectionalDerivative", *arguments)
    return list(arguments[5 if run.model.version == 2 else 6])


def _difference(run: Run, unknown: Variable, known: Variable, step: float, declared: float) -> tuple[float, float]:
    """Return the error of a declared derivative against a central difference, and the central difference."""
    here = _state(run, known)
    step *= max(abs(here), 0.01 * min(abs(known.nominal), 1.0))
    sides = []
    for side in (here + step, here - step):
        _put(run, known, side)
        sides.append(run.get([unknown])[0])
    _put(run, known, here)
    difference = (sides[0] - sides[1]) / (2 * step)
    rounding = 1e-14 * max(*map(abs, sides), abs(unknown.nominal)) / step
    error = max(0.0, abs(difference - declared) - rounding)
    return (error if math.isfinite(difference) else math.inf), difference


def _state(run: Run, known: Variable) -> float:
    """Return the value of an input or a continuous state.

    In model exchange the state is read from the state vector, because the variable of the same name may differ between events.
    """
    names = run.model.state_names
    if known.is_state and run.model.interface == "me" and known.name in names:
        return float(run.states("GetContinuousStates")[names.index(known.name)])
    return float(run.get([known])[0])


def _put(run: Run, known: Variable, value: float) -> None:
    """Set an input or a continuous state to a value."""
    names = run.model.state_names
    if not (known.is_state and run.model.interface == "me" and known.name in names):
        run.set({known: value})
        return
    states = run.states("GetContinuousStates")
    states[names.index(known.name)] = value
    run.session.need("SetContinuousStates", states, len(states))


def _check_sums(
    context: Context,
    run: Run,
    unknown: Variable,
    knowns: Sequence[Variable],
    seed: Sequence[float],
    row: Sequence[float],
) -> None:
    """Check the derivative along several knowns, and the adjoint derivative, by the derivatives with respect to each known.

    ``row`` has the derivatives with respect to each known. The derivative along ``seed`` must be the sum of ``row`` times
    ``seed``, and the adjoint derivative must be ``row``.
    """
    terms = [a * b for a, b in zip(row, seed)]
    floor = _floor(unknown)
    room = 1e-9 * sum(map(abs, terms)) + floor
    along = _directional(run, [unknown], knowns, seed)[0]
    if not abs(along - sum(terms)) <= room:
        context.note(
            WRONG,
            f"{unknown.name}: derivative along several knowns",
            f"the derivative of {unknown.name} along several knowns is {along!r}, not the sum {sum(terms)!r}",
        )
    if context.model.adjoint:
        arguments = derivative_arguments(run.model.version, [unknown], knowns, [2.0], transposed=True)
        run.session.need("GetAdjointDerivative", *arguments)
        for known, adjoint, declared in zip(knowns, arguments[6], row):
            if not abs(adjoint - 2 * declared) <= 1e-9 * max(map(abs, row)) + floor:
                text = f"d {unknown.name} / d {known.name}: adjoint {adjoint / 2!r}, directional {declared!r}"
                context.note(WRONG, f"d {unknown.name} / d {known.name}: adjoint derivative", text)


def check_bounds(context: Context, case: int) -> None:
    """Check over a run with random inputs that all variables stay within their declared bounds and no output is NaN."""
    model = context.model
    numbers = [v for v in model.variables if v.group not in ("String", "Boolean") and v.size == 1]
    watched = [v for v in numbers if v.causality == "output" or math.isfinite(v.minimum) or math.isfinite(v.maximum)]
    run = Run(context.session())
    for inputs in random_inputs(context.random(case), model, 200):
        run.step(step_size(model), inputs)
        for group in dict.fromkeys(v.group for v in watched):
            chosen = [v for v in watched if v.group == group]
            for variable, found in zip(chosen, run.get(chosen)):
                if math.isnan(found):
                    context.note(
                        QUESTIONABLE, f"{variable.name}: NaN", f"{variable.name} is NaN after a step that returned OK"
                    )
                elif not variable.minimum <= found <= variable.maximum:
                    limits = f"{variable.minimum:g} .. {variable.maximum:g}"
                    text = f"{variable.causality} {variable.name} is {found!r}, outside its declared range {limits}"
                    context.note(WRONG, f"{variable.name}: outside its range", text)
    run.session.free()


def check_starts(context: Context, case: int) -> None:
    """Check that after the initialization parameters and inputs have the start values of the model description."""
    run = Run(context.session())
    for group in context.model.groups:
        chosen = [
            v
            for v in context.model.select_variables(group, "3")
            if v.size == 1 and v.causality in ("parameter", "input")
        ]
        for variable, found in zip(chosen, run.get(chosen) if chosen else ()):
            expected = context.model.c_types[group](variable.start).value
            if (found or (b"" if group == "String" else 0)) != expected:
                text = f"{variable.causality} {variable.name} starts as {found!r}, declared is {variable.start!r}"
                context.note(WRONG, f"{variable.name}: another start", text)
    run.session.free()


def check_step_past_end(context: Context, case: int) -> None:
    """Check that a step past the stop time is refused, as both standards require."""
    size = step_size(context.model)
    run = Run(context.session(), stop=context.model.start_time + 4 * size)
    for _ in range(4):
        run.step(size)
    try:
        run.step(size)
    except ProbeError:
        context.say("refused")
    else:
        context.note(
            WRONG, "DoStep: past the stop time", f"{run.session.prefix}DoStep accepts a step past the stop time"
        )
    if not context.journal.fatal:
        run.session.free()


def bounded_parameters(model: Model) -> list[tuple[Variable, float]]:
    """Return pairs (parameter, value): for each declared bound of a parameter a value beyond this bound."""
    parameters = [
        v
        for v in model.variables
        if v.causality == "parameter" and v.group not in ("String", "Boolean") and v.size == 1
    ]
    beyond = []
    for variable in parameters:
        if abs(variable.minimum) < 1e300 and variable.minimum > -(2**31) + 1:
            beyond.append((variable, variable.minimum - max(1.0, abs(variable.minimum))))
        if abs(variable.maximum) < 1e300 and variable.maximum < 2**31 - 1:
            beyond.append((variable, variable.maximum + max(1.0, abs(variable.maximum))))
    return [(v, x) for v, x in beyond if v.is_real or "U" not in v.group or x >= 0]


def check_parameter_bounds(context: Context, case: int) -> None:
    """Check that a parameter value beyond a bound is refused when it is set, or by the end of the initialization."""
    variable, beyond = bounded_parameters(context.model)[case]
    session = context.session()
    if not session.instantiate():
        return
    chosen = beyond if variable.is_real else int(beyond)
    try:
        Run(session, instantiate=False, start={variable: chosen})
    except ProbeError:
        if not session.journal.fatal:
            session.free()
        return
    limits = f"{variable.minimum:g} .. {variable.maximum:g}"
    text = f"parameter {variable.name} = {chosen:g} is accepted, its declared range is {limits}"
    context.note(QUESTIONABLE, f"{variable.name}: accepted beyond its range", text)
    session.free()
