"""Shorthand arguments of the public functions: published sets by name, initial states as mappings, quantities as text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from inspect import signature
from math import tau
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism, PublishedSet

from .. import files
from ..mechanisms import MECHANISMS, PUBLISHED, Parameters, find_mechanism
from ..units import Amount
from .inputs import Inputs, parameter_readers, read_start

_Function = TypeVar("_Function", bound=Callable[..., Any])
#: Function that takes a published set and an argument (None if not given), and returns the value to use for the argument.
Fill = Callable[[PublishedSet, Any], Any]


def published_set(known: str | PublishedSet) -> PublishedSet:
    """Return a published set by its name; a set itself is returned as it is.

    Raises
    ------
    UnknownNameError
        If there is no set of that name.
    InputError
        If the name is that of a case file.
    """
    if isinstance(known, PublishedSet):
        return known
    if known.endswith((".toml", ".json")):
        raise InputError(
            f"{known!r} is a file: give the parameters of analysis.run.load_case({known!r}), or a published set"
        )
    if known not in PUBLISHED:
        raise files.unknown_name(known, PUBLISHED, f"published set {known!r}")
    return PUBLISHED[known]


def takes_published(**fills: Fill) -> Callable[[_Function], _Function]:
    """Decorate a function so that its argument ``parameters`` may also be a published set, the name of one, or a list of these.

    Parameters
    ----------
    **fills : function
        For another argument, as in ``initial=complete_initial_state``: function that returns the value of this argument from
        the published set and the given value (None if it was not given).
    """

    def decorate(function: _Function) -> _Function:
        its = signature(function)
        place = list(its.parameters).index("parameters")
        further = next((p.name for p in its.parameters.values() if p.kind is p.VAR_KEYWORD), "")

        @wraps(function)
        def resolved(*arguments: Any, **options: Any) -> Any:
            given: Any = options.get("parameters", arguments[place] if len(arguments) > place else None)
            several = isinstance(given, (list, tuple)) and not isinstance(given, PublishedSet)
            each = list(given) if several else [given]
            if not any(isinstance(one, (str, PublishedSet)) for one in each):
                return function(*arguments, **options)
            sets = [published_set(one) if isinstance(one, (str, PublishedSet)) else None for one in each]
            own = [one if known is None else known.parameters for one, known in zip(each, sets)]
            bound = its.bind_partial(*arguments, **options).arguments
            bound["parameters"] = own if several else own[0]
            driven = varied if isinstance(varied := bound.get("vary"), Mapping) else ()
            # what a controller moves has no drive of the set either
            driven = (*driven, *filter(None, [getattr(bound.get("controller"), "channel", None)]))
            sets = [None if known is None else _without_drives(known, driven) for known in sets]
            for name, fill in fills.items():
                value: Any = bound.get(name)
                own_each = several and isinstance(value, (list, tuple))
                if own_each and len(value) != len(sets):
                    raise InputError(f"{name} has {len(value)} entries for {len(sets)} sets: give one, or one for each")
                values = value if own_each else [value] * len(sets)
                filled = [v if known is None else fill(known, v) for known, v in zip(sets, values)]
                bound[name] = filled if several else filled[0]
            # no argument is positional only: all can be passed by name, and further keywords after them
            others = bound.pop(further, {})
            return function(**bound, **others)

        return cast(_Function, resolved)

    return decorate


def require_kind(value: Any, kind: type | tuple[type, ...], name: str, wanted: str) -> None:
    """Raise InputError if an argument is not an instance of ``kind``; ``wanted`` says in the message what to give instead."""
    if not isinstance(value, kind):
        shown = repr(value) if value is None or isinstance(value, (str, int, float)) else type(value).__name__
        raise InputError(f"{name} is {shown}: give {wanted}")


def require_list(names: object, name: str) -> None:
    """Raise InputError if an argument is a text where it must be a list of names."""
    if isinstance(names, str):
        raise InputError(f"{name} is {names!r}: it must be a list of names, such as [{names!r}]")


def float_array(value: ArrayLike, message: str) -> NDArray[np.float64]:
    """Return the value as a new array of floats; raise InputError with ``message`` if it is not numeric."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(message) from None


def takes_options(kind: type) -> Callable[[_Function], _Function]:
    """Decorate a function to reject keywords that are neither arguments of the function nor keys of the TypedDict ``kind``.

    ``kind`` lists the options that the function accepts besides its arguments.

    If the argument ``method`` is a class, all keywords are accepted, as the class may have options of its own.
    """

    def decorate(function: _Function) -> _Function:
        known = tuple(name for name in (*signature(function).parameters, *kind.__annotations__) if name != "options")

        @wraps(function)
        def checked(*arguments: Any, **options: Any) -> Any:
            for name in options:
                if name not in known and not isinstance(options.get("method"), type):
                    raise files.unknown_name(name, known, f"argument {name!r} of {function.__name__}")
            return function(*arguments, **options)

        return cast(_Function, checked)

    return decorate


def complete_inputs(known: PublishedSet, inputs: Any) -> Any:
    """Complete inputs with the drives of the published set, for degrees of freedom that the inputs do not drive."""
    inputs = Inputs() if inputs is None else inputs
    if not isinstance(inputs, Inputs):
        return inputs
    added = _without_drives(known, inputs).drive
    return inputs.replace(**added) if added else inputs


def _without_drives(known: PublishedSet, names: Iterable[str]) -> PublishedSet:
    """Return a published set without the drives of degrees of freedom that the named inputs drive.

    The names are those in `Inputs` or in FMI.
    """
    mechanism, names = find_mechanism(known.parameters), {*names}
    given = names | {channel.argument for channel in mechanism.channels if channel.name in names}
    modes = [mode.arguments for mode in mechanism.modes]
    rivals = {name: next((own for own in modes if name in own), (name,)) for name in known.drive}
    return known._replace(drive={name: value for name, value in known.drive.items() if not given & {*rivals[name]}})


def complete_initial_state(known: PublishedSet, initial: Any) -> Any:
    """Return the initial state of a run: by default that of the published set, which also fills the gaps of a mapping."""
    if isinstance(initial, Mapping):
        return read_start(find_mechanism(known.parameters), initial, known.initial)
    return known.initial if initial is None else initial


def complete_speed(known: PublishedSet, speed: Any) -> Any:
    """Return the given crank speed or, if it is None, the speed of the published set (rad/s)."""
    return known.crank_speed if speed is None else speed


def turn_durations(inputs: Inputs, mechanism: Mechanism) -> tuple[float, float] | None:
    """Return the times (s) of one revolution of the slowest and of the fastest crank that is driven at constant speed.

    Return None if no crank is driven at constant speed.
    """
    found = []
    angles = {v.name for v in mechanism.variables if v.unit == "rad"}
    for number, freedom in enumerate(mechanism.freedoms):
        if freedom.coordinate not in angles:
            continue
        channel = mechanism.channel_index(number, "command")
        parts = () if channel is None else inputs.parts(mechanism.channels[channel].argument)
        if len(parts) == 1 and isinstance(parts[0], (int, float)) and parts[0] != 0.0:
            found.append(tau / abs(parts[0]))
    return (max(found), min(found)) if found else None


def usual_times(
    parameters: Parameters, inputs: Inputs | None, stop_time: float | None, step: float | None
) -> tuple[float, float]:
    """Return the stop time and the sampling step of a run (s).

    The default stop time needs a crank that is driven at constant speed: it is the time of three revolutions of the slowest
    such crank. The step is then by default the time of one degree of the fastest crank. If a stop time is given, the default
    step is 1 ms.

    Raises
    ------
    InputError
        If there is neither a stop time nor a constant speed.
    """
    if stop_time is not None:
        return stop_time, 1e-3 if step is None else step
    mechanism = find_mechanism(parameters)
    turn = turn_durations(inputs, mechanism) if isinstance(inputs, Inputs) else None
    if turn is None:
        raise InputError(
            "stop_time is missing: a run has three turns by default only where the crank has a constant speed"
        )
    return 3.0 * turn[0], turn[1] / 360.0 if step is None else step


def variant(of: Any, /, **changes: Amount) -> Any:
    """Return a published set or parameters with some values changed; values may be texts with units.

    Parameters
    ----------
    of : str, PublishedSet, parameters of a mechanism, or their class
        Published set or parameters to change. From a class, such as FiveBarParameters, new parameters are made.
    **changes
        New values by the names of the fields, such as ``slider_stiffness="1e6 dyn/cm"``. Numbers are in SI.

    Returns
    -------
    PublishedSet or parameters
        A set if a set was given; it keeps its initial state and its crank speed.

    Raises
    ------
    ParameterError
        If a name is unknown, a value is wrong, or a class is given and a value is missing.

    Examples
    --------
    >>> from analysis import simulate, variant
    >>> soft = variant("table-3.1", slider_stiffness="0.8e6 dyn/cm", slider_damping="20 N.s/m")
    >>> soft.parameters.slider_stiffness, soft.parameters.slider_damping
    (800.0, 20.0)
    >>> simulate(soft).status
    0
    """
    known = published_set(of) if isinstance(of, (str, PublishedSet)) else None
    base = of if known is None else known.parameters
    if isinstance(base, type):
        mechanism = next((m for m in MECHANISMS.values() if m.parameters is base), None)
        if mechanism is None:
            kinds = ", ".join(m.parameters.__name__ for m in MECHANISMS.values())
            raise InputError(f"{base.__name__} has no variants: it must be one of {kinds}")
        base = None
    else:
        mechanism = find_mechanism(base)
    made = files.read(mechanism.parameters, changes, "", readers=parameter_readers(mechanism), base=base)
    if known is None:
        return made
    return known._replace(parameters=made, source=f"{known.source}, changed" if changes else known.source)
