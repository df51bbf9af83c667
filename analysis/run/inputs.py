"""Inputs of a run: the class `Inputs`, and the arrays made from it for the compiled code.

`simulate`, `cosimulate` and all mechanisms take the same class. The mechanism determines the channels, which are its input
quantities, such as crank speed or slider force.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import chain
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from .. import files
from ..mechanisms import MECHANISMS, InitialState, input_units
from ..units import si
from .signals import Function, Harmonics, InductionMotor, Piecewise, Source, StateFunction, TorsionBar

#: Types that count as numbers.
NUMBER = (int, float, np.floating, np.integer)
#: Largest numerator and denominator of a ratio of crank speeds: if it needs larger ones, the cranks have no common period.
MOST_TURNS = 100
#: Largest numerator and denominator of a ratio of speeds at the start that is not rounded: see `start_ratio`.
_MOST_AT_START = 6
_SIGNALS = (*NUMBER, Piecewise, Harmonics, Function, TorsionBar, InductionMotor)


class Inputs:
    """Everything that acts on a mechanism during a run.

    A number is a constant in SI, a text such as "420 rpm" a constant in another unit, a tuple of signals their sum.

    Parameters
    ----------
    **channels : signal or tuple of signals
        Signals by the names of the mechanism's channels. A five-bar has ``speed`` (crank speed, rad/s; the crank torque is
        then a result) or ``torque`` (N.m), ``force`` (control force on the slider, N), ``load_x``, ``load_y`` (load on the
        coupler point P, N). A slider-crank has ``speed`` or ``torque``; one of ``shift_speed`` (axial velocity of the crank,
        m/s), ``axial_force`` (N) and ``groove=True`` (a groove in the shaft makes the shift, eq 28), or none of these: the
        shift is then held as it is; and ``load`` (force on the slider along the guide, N). None counts as not given.

    Raises
    ------
    InputError
        If no mechanism has such a channel, one degree of freedom is driven by two inputs, a value is not finite or of the
        wrong kind, or the unit of a text does not fit the channel.

    Examples
    --------
    >>> from analysis import Inputs, ramp
    >>> Inputs(speed=44.0, force="20 mN")
    Inputs(speed=44.0, force=0.02)
    >>> drive = Inputs(speed="420 rpm", force=(1.0, ramp(0.0, 2.0, 0.0, 0.5)))
    """

    __slots__ = ("_encoded", "_given", "_text_units")
    _given: dict[str, Any]
    #: See `encode_once`.
    _encoded: dict[Mechanism, Encoded]
    #: Units of the inputs that were given as texts.
    _text_units: dict[str, str]

    def __init__(self, **channels: Any) -> None:
        known, flags = _arguments()
        text_units: dict[str, str] = {}
        for name, value in channels.items():
            channels[name], unit = _to_si(name, value)
            signals = [p.unit for p in _parts(value) if isinstance(p, (Piecewise, Harmonics)) and p.unit]
            if channels[name] is not value or signals:
                text_units[name] = signals[0] if signals else unit
        for name, value in channels.items():
            if name not in known:
                raise files.unknown_name(name, known, f"input {name!r}")
            if name in flags and value is not None and not isinstance(value, bool):
                raise InputError(f"{name} is {value!r}: it must be True or False")
            if name not in flags:
                _check_channel(name, value)
        given = {name: value for name, value in channels.items() if value is not None and value is not False}
        theirs = [m for m in MECHANISMS.values() if set(given) <= {*_argument_names(m)}]
        rivals = [_rivals(mechanism, given) for mechanism in theirs]
        if rivals and all(rivals):
            _refuse(rivals[0])
        for name in (
            channel.argument for m in MECHANISMS.values() for channel in m.channels if channel.kind == "command"
        ):
            for part in _parts(given.get(name)):
                if isinstance(part, Function) and part.rate is None:
                    unit = "rad/s2" if name == "speed" else "m/s2"
                    raise InputError(f"a {name} given as a Function needs its rate, the acceleration ({unit})")
        _fill(self, given, text_units)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"inputs do not change: Inputs.replace({name}=...) makes new ones")

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_") and name in _arguments()[0]:
            return self._given.get(name)
        raise AttributeError(str(files.unknown_name(name, _arguments()[0], f"input {name!r}")))

    def __reduce__(self) -> Any:
        return _restore, (self._given, self._text_units)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Inputs) and self._given == other._given

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Inputs({', '.join(f'{name}={value!r}' for name, value in self._given.items())})"

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the given inputs."""
        return iter(self._given)

    def replace(self, **changes: Any) -> Inputs:
        """Return a copy with some inputs changed; the value None removes an input."""
        return Inputs(**{**self._given, **changes})

    def parts(self, channel: str) -> tuple[Any, ...]:
        """Return the summands of a channel."""
        return _parts(self._given.get(channel))

    def modes(self, mechanism: Mechanism) -> dict[str, int]:
        """Return the value of each mode of the mechanism, by name.

        A mode says which of several inputs drives a degree of freedom; the given inputs choose its value.
        """
        return {
            mode.name: next((n for n, name in enumerate(mode.arguments) if name in self._given), mode.default)
            for mode in mechanism.modes
        }

    def constants(self, names: Sequence[str]) -> list[float] | None:
        """Return the values of the named channels if all are constant (0 where nothing is given), else None."""
        values = []
        for name in names:
            value = self._given.get(name)
            total = 0.0 + value if type(value) is float else 0.0
            if value is not None and type(value) is not float:
                for part in _parts(value):
                    if not isinstance(part, NUMBER):
                        return None
                    total += float(part)
            values.append(total)
        return values

    @property
    def held_exactly(self) -> bool:
        """Return whether all inputs are constant, so that holding them over the communication steps of a master is exact."""
        return all(isinstance(part, NUMBER) for name in self._given for part in self.parts(name))


def _restore(given: dict[str, Any], text_units: dict[str, str]) -> Inputs:
    """Restore pickled inputs without checks, because the reading process may not know their mechanism."""
    return _fill(object.__new__(Inputs), given, text_units)


def _fill(inputs: Inputs, given: dict[str, Any], text_units: dict[str, str]) -> Inputs:
    for name, value in (("_given", given), ("_text_units", text_units), ("_encoded", {})):
        object.__setattr__(inputs, name, value)
    return inputs


def _arguments() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of all inputs of all mechanisms, and those among them that are flags, which choose a mode."""
    mechanisms = MECHANISMS.values()
    channels = dict.fromkeys(c.argument for m in mechanisms for c in m.channels if c.kind != "rate")
    modes = dict.fromkeys(name for m in mechanisms for mode in m.modes for name in mode.arguments)
    return tuple(channels | modes), tuple(name for name in modes if name not in channels)


def _rivals(mechanism: Mechanism, given: Iterable[str]) -> list[str]:
    """Return the names of given inputs that drive the same degree of freedom of a mechanism; empty if there are none."""
    found = ([name for name in given if name in mode.arguments] for mode in mechanism.modes)
    return next((names for names in found if len(names) > 1), [])


def _refuse(rivals: Sequence[str]) -> NoReturn:
    raise InputError(f"both {' and '.join(rivals)} are given: the freedom can be driven by one of them only")


def _all_units(name: str) -> tuple[str, ...]:
    """Return the SI units that an input has in the mechanisms that have this input."""
    return tuple(dict.fromkeys(u[name] for m in MECHANISMS.values() if name in (u := input_units(m))))


def _to_si(name: str, value: Any) -> tuple[Any, str]:
    """Return the value of an input in SI, and its SI unit: the first of `_all_units` that fits the value."""
    wrong: ParameterError | None = None
    for unit in _all_units(name):
        try:
            return si(value, unit, name), unit
        except ParameterError as error:
            wrong = wrong or error
    if wrong is not None:
        raise InputError(str(wrong).removeprefix("parameter ")) from None
    return value, ""  # a flag, or an unknown name


def _parts(value: Any) -> tuple[Any, ...]:
    if value is None:
        return ()
    return value if isinstance(value, tuple) else (value,)


def _check_channel(name: str, value: Any) -> None:
    on_shafts = {m.channels[n].argument for m in MECHANISMS.values() for n in m.torques}
    parts = _parts(value)
    kinds = _SIGNALS if name in on_shafts else _SIGNALS[:-2]
    if isinstance(value, tuple) and not value:
        raise InputError(f"{name} is (): a sum has at least one summand; leave {name} out if nothing acts")
    for part in parts:
        if not isinstance(part, kinds) or isinstance(part, bool):
            also = "; a motor can only drive a freedom that turns" if isinstance(part, _SIGNALS[-2:]) else ""
            raise InputError(
                f"{name} is {part!r}: it must be a number, a signal of analysis.run.signals, or a Function{also}"
            )
        if isinstance(part, (Piecewise, Harmonics)) and part.unit not in ("", *(units := _all_units(name))):
            raise InputError(f"{name} is a signal in {part.unit}: it must be in {' or '.join(units)}")
        if isinstance(part, NUMBER) and not np.isfinite(part):
            raise InputError(f"{name} is {part}: it must be a finite number")
    for kind in (TorsionBar, InductionMotor, Function):
        if sum(isinstance(part, kind) for part in parts) > 1:
            raise InputError(f"{name} has more than one {kind.__name__}: only one can act at a time")


def parameter_readers(mechanism: Mechanism) -> dict[str, files.Reader]:
    """Return the readers of a mechanism's parameters by the names of their fields."""
    return {
        field_name(name): files.Whole() if variable.kind == "Integer" else files.Quantity(variable.unit)
        for name, variable in mechanism.mechanism_variables.items()
    }


def read_start(mechanism: Mechanism, data: Any, base: InitialState | None = None) -> InitialState:
    """Read the initial state from a mapping of its fields, in SI or with units, such as {"crank_speed": "420 rpm"}.

    Missing fields are taken from ``base``, or are the defaults.

    Raises
    ------
    ParameterError
        If a name is unknown or a value is wrong.
    """
    readers = {name: files.Quantity(variable.unit) for name, variable in mechanism.initial_variables.items()}
    return files.read(mechanism.initial, data, "initial", readers=readers, base=base)


@lru_cache(maxsize=64)
def _rest_state(mechanism: Mechanism) -> InitialState:
    """Return the default initial state."""
    return read_start(mechanism, {})


@lru_cache(maxsize=64)
def _argument_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the inputs of a mechanism and of the flags that choose its modes."""
    modes = [name for mode in mechanism.modes for name in mode.arguments]
    return tuple(dict.fromkeys([*(c.argument for c in mechanism.channels if c.kind != "rate"), *modes]))


def speed_ratio(name: str, value: float, reference: str, speed: float) -> Fraction:
    """Return value / speed (both rad/s) as a fraction of whole numbers up to `MOST_TURNS`.

    ``name`` and ``reference`` are the names of value and speed in the error message.

    Raises
    ------
    InputError
        If the ratio is not such a fraction.
    """
    ratio = Fraction(value / speed).limit_denominator(MOST_TURNS)
    if abs(ratio * speed - value) > 1e-9 * abs(value) or (value != 0.0 and ratio == 0):
        raise InputError(
            f"{reference} = {speed:.9g} rad/s and {name} = {value:.9g} rad/s have no common period: their ratio is "
            f"{value / speed:.9g}, and must be a fraction of whole numbers up to {MOST_TURNS}"
        )
    return ratio


def start_ratio(value: float, speed: float) -> Fraction:
    """Return value / speed at the start of a run: a fraction of small whole numbers, or else the nearest whole number."""
    ratio = Fraction(value / speed).limit_denominator(_MOST_AT_START)
    exact = abs(ratio * speed - value) <= 1e-9 * abs(value) and abs(ratio.numerator) <= _MOST_AT_START
    return ratio if exact else Fraction(round(value / speed))


def check_run(mechanism: Mechanism, inputs: Inputs | None, initial: InitialState | None) -> tuple[Inputs, Any]:
    """Check the inputs and the initial state of a run and return them; the defaults are no inputs and the state of rest.

    The state may be a mapping, as for `read_start`.

    Raises
    ------
    InputError
        If inputs or state belong to another mechanism.
    """
    inputs = Inputs() if inputs is None else inputs
    if not isinstance(inputs, Inputs):
        raise InputError(f"inputs is {inputs!r}: it must be analysis.Inputs")
    for name in inputs:
        if name not in (known := _argument_names(mechanism)):
            raise InputError(f"a {mechanism.name} has no input {name!r}: its inputs are {', '.join(known)}")
    if rivals := _rivals(mechanism, inputs):
        _refuse(rivals)
    for name, unit in inputs._text_units.items():
        if unit != (right := input_units(mechanism).get(name, unit)):
            raise InputError(f"{name} of a {mechanism.name} is given in {unit}: it must be in {right}")
    if initial is None:
        initial = _rest_state(mechanism)
    elif isinstance(initial, Mapping):
        initial = read_start(mechanism, initial)
    if not isinstance(initial, mechanism.initial):
        kind, wanted = type(initial), mechanism.initial
        raise InputError(
            f"initial is {kind.__module__}.{kind.__qualname__}: with parameters of the {mechanism.name} it must be "
            f"{wanted.__module__}.{wanted.__qualname__}"
        )
    return inputs, initial


@dataclass(frozen=True)
class Encoded:
    """`Inputs` of a mechanism as arrays, all signals with the same breaks.

    Attributes
    ----------
    mechanism : Mechanism
    modes : dict
        Values of the mechanism's modes, by name.
    source : Source
        Arrays for the compiled code, without the users' functions.
    commands : ndarray of int, shape (c, 3)
        For each commanded rate (such as a crank speed): the index of its channel, the component of the state that it
        prescribes, and the index of the channel of its derivative.
    functions : tuple
        For each signal the user's Python function and the function of its derivative, or None.
    """

    mechanism: Mechanism
    modes: dict[str, int]
    source: Source
    commands: NDArray[np.int64]
    functions: tuple[tuple[StateFunction | None, StateFunction | None], ...]

    @cached_property
    def has_functions(self) -> bool:
        """Return whether the user's functions add to any signal."""
        return any(chain.from_iterable(self.functions))

    @cached_property
    def constant(self) -> NDArray[np.float64] | None:
        """Return the values of all channels if these do not change during a run, else None."""
        u = np.zeros(len(self.mechanism.channels))
        u[self.source.places[:, 0]] = self.source.coefficients[0, :, 0]
        changes = not self.source.is_constant or self.has_functions
        return None if changes or not np.isfinite(u).all() else u

    @cached_property
    def steady(self) -> bool:
        """Return whether all channels except the torsion bar are constant between the breaks.

        A commanded speed may change linearly: the speed is used at the beginning of an interval only, then its derivative.
        """
        slopes, bends = self.source.coefficients[:, :, 1], self.source.coefficients[:, :, 2:]
        return not (
            len(self.source.harmonics)
            or self.source.laws[:, 3].any()
            or self.has_functions
            or bends.any()
            or slopes[:, self.source.places[:, 1] < 0].any()
        )

    def value_name(self, channel: int) -> str:
        """Return the name in `Inputs` of a channel, given by its index."""
        return self.mechanism.channels[channel].argument


@lru_cache(maxsize=64)
def _signals(mechanism: Mechanism) -> tuple[tuple[str, int, int], ...]:
    """Return for each signal its name, and the indices of its channel and of its derivative's channel (-1 without one)."""
    rates = {channel.freedom: n for n, channel in enumerate(mechanism.channels) if channel.kind == "rate"}
    return tuple(
        (channel.argument, n, rates.get(channel.freedom, -1) if channel.kind == "command" else -1)
        for n, channel in enumerate(mechanism.channels)
        if channel.kind != "rate"
    )


#: Breaks of inputs without breaks.
_NO_BREAKS = np.array([0.0, 1.0])


def encode(inputs: Inputs, mechanism: Mechanism) -> Encoded:
    """Convert inputs to arrays for the compiled code: all signals get the same breaks."""
    signals = _signals(mechanism)
    freedoms = len(mechanism.freedoms)
    pieces = [(n, part) for n, (name, _, _) in enumerate(signals) for part in inputs.parts(name)]
    times = [part.breaks for _, part in pieces if isinstance(part, Piecewise)]
    for _, part in pieces:
        if isinstance(part, Function) and len(part.breaks) > 0:
            # the first and the last of the merged breaks do not act as breaks, so that others are added outside
            times.append(np.array([min(part.breaks) - 1.0, *part.breaks, max(part.breaks) + 1.0]))
    merged = np.unique(np.concatenate(times)) if times else _NO_BREAKS
    coefficients = np.zeros((len(merged) - 1, len(signals), 4))
    harmonics: list[tuple[float, float, float, float]] = []
    laws = np.tile((0.0, 0.0, 0.0, 0.0, 1.0, 1.0), (len(mechanism.torques), 1))
    on = [mechanism.channels[channel].freedom for channel in mechanism.torques]
    law_places = np.array([(c, n, freedoms + n) for c, n in zip(mechanism.torques, on)], dtype=np.int64).reshape(-1, 3)
    functions: list[tuple[StateFunction | None, StateFunction | None]] = [(None, None)] * len(signals)
    for n, part in pieces:
        if isinstance(part, Piecewise):
            coefficients[:, n, :] += _refine_breaks(part, merged)
        elif isinstance(part, Harmonics):
            coefficients[:, n, 0] += part.mean
            harmonics += [(float(n), *row) for row in zip(part.amplitudes, part.frequencies, part.phases)]
        elif isinstance(part, (TorsionBar, InductionMotor)):
            if signals[n][1] not in mechanism.torques:
                raise InputError(
                    f"{signals[n][0]} of a {mechanism.name} is {part!r}, which can only be a torque on a freedom that turns"
                )
            law = laws[mechanism.torques.index(signals[n][1])]
            if isinstance(part, TorsionBar):
                law[0:3] = part.torque, part.release_angle, 1.0
            else:
                law[3:6] = part.breakdown_torque, part.breakdown_slip, part.synchronous_speed
        elif isinstance(part, Function):
            functions[n] = (part.function, part.rate if signals[n][2] >= 0 else None)
        else:
            coefficients[:, n, 0] += float(part)
    modes = inputs.modes(mechanism)
    commanded = [
        (n, freedoms + mechanism.channels[n].freedom, next(r for _, c, r in signals if c == n))
        for n in mechanism.commands(modes)
    ]
    source = Source(
        merged,
        coefficients,
        np.array(harmonics, dtype=float).reshape(-1, 4),
        np.array([row[1:] for row in signals], dtype=np.int64).reshape(-1, 2),
        laws,
        law_places,
        np.zeros((len(signals), 2), dtype=np.int64),
    )
    return Encoded(mechanism, modes, source, np.array(commanded, dtype=np.int64).reshape(-1, 3), tuple(functions))


def encode_once(inputs: Inputs, mechanism: Mechanism) -> Encoded:
    """Return the result of `encode`, cached in ``inputs`` if these have only numbers and torque laws, which cannot change."""
    if mechanism not in inputs._encoded:
        encoded = encode(inputs, mechanism)
        if not all(isinstance(p, (*NUMBER, TorsionBar, InductionMotor)) for name in inputs for p in inputs.parts(name)):
            return encoded
        inputs._encoded[mechanism] = encoded
    return inputs._encoded[mechanism]


def _refine_breaks(part: Piecewise, breaks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the polynomial coefficients of a signal on finer breaks, shape (n, 4).

    The first and the last polynomial of the signal extend beyond the ends of the signal.
    """
    left = breaks[:-1]
    index = np.clip(np.searchsorted(part.breaks, left, side="right") - 1, 0, len(part.coefficients) - 1)
    s = left - part.breaks[index]
    c0, c1, c2, c3 = part.coefficients[index].T
    return np.column_stack(
        [c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2.0 * c2 + s * 3.0 * c3), c2 + 3.0 * s * c3, c3]
    )


def align(encoded: Encoded, times: NDArray[np.float64]) -> Encoded:
    """Move each break of the inputs that differs from a sample time only by rounding errors onto the sample time.

    In floats 0.3 is not 3 * 0.1: where inputs are sampled and held, a jump at 0.3 s would act a whole step late, and the
    sample at 0.3 s would have the values before the jump.
    """
    breaks = encoded.source.breaks
    if breaks is _NO_BREAKS:
        return encoded
    after = np.clip(np.searchsorted(times, breaks), 1, len(times) - 1)
    low, high = times[after - 1], times[after]
    nearest = np.where(breaks - low < high - breaks, low, high)
    rounding = 1e-9 * (high - low) + 4.0 * np.spacing(np.abs(breaks))
    moved = np.where(np.abs(nearest - breaks) <= rounding, nearest, breaks)
    return replace(encoded, source=encoded.source._replace(breaks=moved)) if np.all(np.diff(moved) > 0.0) else encoded


# User's functions, compiled


@lru_cache(maxsize=256)
def compile_function(function: StateFunction, freedoms: int) -> Any:
    """Compile a user's function to a C function of time and state that returns NaN where the original raises.

    The state has the coordinates of all degrees of freedom, ``freedoms`` in number, followed by their rates.

    Raises
    ------
    InputError
        If Numba cannot compile it.
    """
    from ..numerics.codegen import user_function

    try:
        return user_function(function, 2 * freedoms)
    except Exception as error:
        raise InputError(
            f"function {getattr(function, '__name__', function)!r} cannot be compiled with Numba: choose one of SciPy's "
            f"methods, such as method='DOP853', which take any function. Numba says: {_reason(error)}"
        ) from error


def _reason(error: Exception) -> str:
    """Return the first line of Numba's error report that names the cause."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in nopython", "During", "File", "- During"))]
    return (telling or lines or [type(error).__name__])[0]


def compile_source(encoded: Encoded) -> tuple[Source, list[Any]]:
    """Return the inputs for the compiled code, with a copy of the torque laws, and the objects to keep while it is in use."""
    freedoms, source = len(encoded.mechanism.freedoms), encoded.source._replace(laws=encoded.source.laws.copy())
    if not encoded.has_functions:
        return source, []
    kept = [[f and compile_function(f, freedoms) for f in row] for row in encoded.functions]
    return source._replace(functions=np.array([[f.address if f else 0 for f in row] for row in kept])), kept
