"""What acts on a mechanism during a run: crank torque or speed, slider or axial force, axial speed, load.

One object, `Inputs` for the five-bar and `SliderCrankInputs` for the slider-crank, serves `simulate` and `cosimulate`. A
signal is a function of time; a torque may besides depend on the crank (torsion bar, induction motor), and any channel but a
commanded speed may be a function of time and state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from linkwork.errors import InputError

from ..mechanisms import InitialState, Mechanism

#: Number of the crank speed among the channels, and of that channel whose rate of change counts besides: an axial speed.
SPEED, LAST = 1, 4
#: Where a function of each channel stands among the functions of a run, and where the rates of those two.
SLOT_OF_CHANNEL = (0, 4, 1, 2, 3)
SLOT_OF_RATE = {SPEED: 5, LAST: 6}
FUNCTIONS = 7

StateFunction = Callable[[float, float, float, float, float], float]


@dataclass(frozen=True, slots=True)
class Piecewise:
    """A signal that is a polynomial of degree three at most between its breaks.

    Parameters
    ----------
    breaks : ndarray, shape (n + 1,)
        Times (s), increasing. Before the first and after the last the outer polynomials go on.
    coefficients : ndarray, shape (n, 4)
        Of the powers 0 to 3 of the time since the break on the left.

    Notes
    -----
    A jump belongs to the piece on its right: the value at a break is the limit from the right.
    """

    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("breaks", "coefficients"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        if self.breaks.ndim != 1 or len(self.breaks) < 2:
            raise InputError(
                f"a signal needs at least two breaks in one dimension, not an array of {self.breaks.shape}"
            )
        if self.coefficients.shape != (len(self.breaks) - 1, 4):
            raise InputError(
                f"a signal with {len(self.breaks)} breaks needs coefficients of shape ({len(self.breaks) - 1}, 4), "
                f"not {self.coefficients.shape}"
            )
        if not (np.all(np.isfinite(self.breaks)) and np.all(np.isfinite(self.coefficients))):
            raise InputError("a signal's breaks and coefficients must be finite numbers")
        if np.any(np.diff(self.breaks) <= 0.0):
            raise InputError(f"a signal's times must increase: they are {self.breaks}")


@dataclass(frozen=True, slots=True)
class Harmonics:
    """mean + sum of amplitude cos(frequency t + phase); frequencies in rad/s, phases in rad, shapes (n,)."""

    mean: float = 0.0
    amplitudes: Sequence[float] = ()
    frequencies: Sequence[float] = ()
    phases: Sequence[float] = ()

    def __post_init__(self) -> None:
        if any(np.ndim(values) != 1 for values in (self.amplitudes, self.frequencies, self.phases)):
            raise InputError("amplitudes, frequencies and phases of harmonics must be lists of numbers")
        if not len(self.amplitudes) == len(self.frequencies) == len(self.phases):
            raise InputError("harmonics need as many amplitudes as frequencies and phases")
        if not np.all(np.isfinite([self.mean, *self.amplitudes, *self.frequencies, *self.phases])):
            raise InputError("harmonics must be finite numbers")


@dataclass(frozen=True, slots=True, kw_only=True)
class TorsionBar:
    """Torque of a wound-up bar: torque (1 - angle / release_angle) until the crank reaches release_angle, then none.

    The thesis's launch (section 3.2.2): torque T0 in N.m, released at 1 rad. The switch is located exactly.
    """

    torque: float
    release_angle: float = 1.0

    def __post_init__(self) -> None:
        if not np.isfinite(self.torque):
            raise InputError(f"torque of the torsion bar is {self.torque}: it must be a finite number of N.m")
        if not (np.isfinite(self.release_angle) and self.release_angle > 0.0):
            raise InputError(f"release angle of the torsion bar is {self.release_angle}: it must be above 0 rad")


@dataclass(frozen=True, slots=True, kw_only=True)
class InductionMotor:
    """Torque of an induction motor by Kloss's formula, 2 Tb / (s / sb + sb / s) at the slip s = 1 - speed / synchronous_speed.

    Parameters
    ----------
    breakdown_torque : float
        Greatest torque Tb (N.m).
    breakdown_slip : float
        Slip sb at which it is reached.
    synchronous_speed : float
        Speed of the field (rad/s).
    """

    breakdown_torque: float
    breakdown_slip: float
    synchronous_speed: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.breakdown_torque):
            raise InputError(f"breakdown torque is {self.breakdown_torque}: it must be a finite number of N.m")
        if not (np.isfinite(self.breakdown_slip) and self.breakdown_slip > 0.0):
            raise InputError(f"breakdown slip is {self.breakdown_slip}: it must be above 0")
        if not (np.isfinite(self.synchronous_speed) and self.synchronous_speed != 0.0):
            raise InputError(f"synchronous speed is {self.synchronous_speed}: it must be finite and not 0 rad/s")


@dataclass(frozen=True, slots=True)
class Function:
    """Any channel as a Python function of time, crank angle, second coordinate and their rates, all floats.

    The second coordinate is the five-bar's slider position u, the slider-crank's axial shift S1.

    It is compiled with Numba where it can be, else the run needs one of SciPy's methods. As a speed it must depend on
    ``t`` alone and needs its ``rate``, the acceleration. ``breaks`` are times (s) where it is not smooth.
    """

    function: StateFunction
    rate: StateFunction | None = None
    breaks: Sequence[float] = ()

    def __post_init__(self) -> None:
        for name, value in (("function", self.function), ("rate", self.rate)):
            if not callable(value) and not (name == "rate" and value is None):
                raise InputError(
                    f"{name} of an input is {value!r}: it must be a function of t, both coordinates and their rates"
                )
        if not np.all(np.isfinite(self.breaks)):
            raise InputError(f"the breaks of a function must be finite times, not {self.breaks}")


Signal = float | Piecewise | Harmonics | Function
Torque = Signal | TorsionBar | InductionMotor


def ramp(start: float, end: float, from_time: float, to_time: float) -> Piecewise:
    """A signal that goes from ``start`` to ``end`` along a straight line between two times (s)."""
    if not to_time > from_time:
        raise InputError(f"a ramp from {from_time} s to {to_time} s: it must end after it begins")
    return table([from_time - 1.0, from_time, to_time, to_time + 1.0], [start, start, end, end])


def steps(times: ArrayLike, values: ArrayLike) -> Piecewise:
    """A signal with the value ``values[i]`` from ``times[i]`` on; shapes (n,) and (n,)."""
    t, y = _points(times, values, least=1)
    breaks = np.append(t, t[-1] + 1.0)
    coefficients = np.zeros((len(t), 4))
    coefficients[:, 0] = y
    return Piecewise(breaks, coefficients)


def table(times: ArrayLike, values: ArrayLike, kind: str = "linear") -> Piecewise:
    """A signal through the points (times, values), shapes (n,): ``linear``, ``cubic`` (spline) or ``hold``.

    Outside the table the first and the last value hold.
    """
    if kind == "hold":
        return steps(times, values)
    t, y = _points(times, values, least=2)
    if kind == "linear":
        slopes = np.diff(y) / np.diff(t)
        inner = np.column_stack([y[:-1], slopes, np.zeros_like(slopes), np.zeros_like(slopes)])
    elif kind == "cubic":
        inner = CubicSpline(t, y).c[::-1].T
    else:
        raise InputError(f"kind of table is {kind!r}: it must be 'linear', 'cubic' or 'hold'")
    flat = np.zeros((1, 4))
    flat[0, 0] = y[0]
    end = np.zeros((1, 4))
    end[0, 0] = y[-1]
    return Piecewise(np.concatenate([[t[0] - 1.0], t, [t[-1] + 1.0]]), np.vstack([flat, inner, end]))


def _points(times: ArrayLike, values: ArrayLike, least: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    t = np.asarray(times, dtype=float)
    y = np.asarray(values, dtype=float)
    if t.ndim != 1 or t.shape != y.shape:
        raise InputError(f"a table needs as many times as values in one dimension each, not {t.shape} and {y.shape}")
    if len(t) < least:
        raise InputError(f"a table needs at least {least} points, not {len(t)}")
    if np.any(np.diff(t) <= 0.0):
        raise InputError(f"a table's times must increase: they are {t}")
    return t, y


_NUMBER = (int, float, np.floating, np.integer)


class Channels:
    """What every mechanism's inputs share: named channels, each a signal or a sum of signals."""

    __slots__ = ()

    #: Name of the mechanism that they act on.
    MECHANISM: ClassVar[str]
    #: Names of the channels, in the order of the compiled code.
    CHANNELS: ClassVar[tuple[str, ...]]
    #: Channels that are speeds: a jump of them is an impulse, and their rate counts.
    COMMANDS: ClassVar[tuple[str, ...]]

    speed: Signal | tuple[Signal, ...] | None
    torque: Torque | tuple[Torque, ...] | None

    def __post_init__(self) -> None:
        if self.speed is not None and self.torque is not None:
            raise InputError("both speed and torque are given: the crank can be driven by one of them only")
        for channel in self.CHANNELS:
            for part in self.parts(channel):
                kinds: tuple[type, ...] = (*_NUMBER, Piecewise, Harmonics, Function)
                if channel == "torque":
                    kinds = (*kinds, TorsionBar, InductionMotor)
                if not isinstance(part, kinds):
                    raise InputError(
                        f"{channel} is {part!r}: it must be a number, a signal of analysis.run.inputs, or a Function"
                    )
                if isinstance(part, _NUMBER) and not np.isfinite(part):
                    raise InputError(f"{channel} is {part}: it must be a finite number")
        for command in self.COMMANDS:
            if any(isinstance(part, Function) and part.rate is None for part in self.parts(command)):
                unit = "rad/s2" if command == "speed" else "m/s2"
                raise InputError(f"a {command} given as a Function needs its rate, the acceleration ({unit})")
        for channel in self.CHANNELS:
            for kind in (TorsionBar, InductionMotor, Function):
                if sum(isinstance(part, kind) for part in self.parts(channel)) > 1:
                    raise InputError(f"{channel} has more than one {kind.__name__}: one can be in force at a time")

    def parts(self, channel: str) -> tuple[Any, ...]:
        """The summands of a channel."""
        value = getattr(self, channel)
        if value is None:
            return ()
        return value if isinstance(value, tuple) else (value,)

    @property
    def held_exactly(self) -> bool:
        """Whether a master that holds the inputs over its steps loses nothing by it: all are constant.

        A commanded speed goes along the secant of a step, which is exact where it is constant.
        """
        parts = [part for channel in self.CHANNELS for part in self.parts(channel)]
        return all(isinstance(part, _NUMBER) for part in parts)

    @property
    def speed_drive(self) -> bool:
        """Whether the crank speed is prescribed."""
        return self.speed is not None

    @property
    def axial_mode(self) -> int:
        """What moves the second coordinate: 0 a force, 1 a commanded speed, 2 a groove."""
        return 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs(Channels):
    """Everything that acts on a five-bar slider during a run. SI units; a plain number is a constant.

    Parameters
    ----------
    speed : signal, optional
        Crank speed (rad/s). Where it is given the run is in speed drive: the crank torque is a result.
    torque : signal, TorsionBar, InductionMotor or a tuple of them, optional
        Crank torque (N.m). Excludes ``speed``.
    force : signal
        Control force on the slider (N).
    load_x, load_y : signal
        Load on the coupler point P (N).

    Notes
    -----
    A tuple of signals is their sum.

    Raises
    ------
    InputError
        If both speed and torque are given, or a value is not finite or of the wrong kind.
    """

    MECHANISM: ClassVar[str] = "five-bar"
    CHANNELS: ClassVar[tuple[str, ...]] = ("torque", "speed", "force", "load_x", "load_y")
    COMMANDS: ClassVar[tuple[str, ...]] = ("speed",)

    speed: Signal | tuple[Signal, ...] | None = None
    torque: Torque | tuple[Torque, ...] | None = None
    force: Signal | tuple[Signal, ...] = 0.0
    load_x: Signal | tuple[Signal, ...] = 0.0
    load_y: Signal | tuple[Signal, ...] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderCrankInputs(Channels):
    """Everything that acts on a slider-crank during a run. SI units; a plain number is a constant.

    Parameters
    ----------
    speed : signal, optional
        Crank speed (rad/s). Where it is given the crank torque is a result.
    torque : signal, TorsionBar, InductionMotor or a tuple of them, optional
        Crank torque (N.m). Excludes ``speed``.
    load : signal
        Force on the slider along the guide (N), in the direction in which its position increases.
    shift_speed : signal, optional
        Axial velocity of the crank (m/s); the axial force is then a result.
    axial_force : signal, optional
        Force on the crank along its axis (N); the shift is then free.
    groove : bool
        Whether a groove in the crank shaft makes the shift, S1 = SS1 sin(alpha theta1) by eq 28, with the parameters'
        ``groove_amplitude`` and ``groove_ratio``.

    Notes
    -----
    Of ``shift_speed``, ``axial_force`` and ``groove`` one may be given; without any the shift is held as it is. A tuple of
    signals is their sum. A `Function` is one of (t, theta1, S1, theta1', S1').

    Raises
    ------
    InputError
        If more than one drive of a freedom is given, or a value is not finite or of the wrong kind.
    """

    MECHANISM: ClassVar[str] = "slider-crank"
    CHANNELS: ClassVar[tuple[str, ...]] = ("torque", "speed", "axial_force", "load", "shift_speed")
    COMMANDS: ClassVar[tuple[str, ...]] = ("speed", "shift_speed")

    speed: Signal | tuple[Signal, ...] | None = None
    torque: Torque | tuple[Torque, ...] | None = None
    load: Signal | tuple[Signal, ...] = 0.0
    shift_speed: Signal | tuple[Signal, ...] | None = None
    axial_force: Signal | tuple[Signal, ...] | None = None
    groove: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.groove, bool):
            raise InputError(f"groove is {self.groove!r}: it must be True or False")
        given = [name for name in ("shift_speed", "axial_force") if getattr(self, name) is not None]
        given += ["groove"] * self.groove
        if len(given) > 1:
            raise InputError(f"both {' and '.join(given)} are given: the shift can be made by one of them only")
        Channels.__post_init__(self)

    @property
    def axial_mode(self) -> int:
        """What makes the shift: 0 a force, 1 a commanded speed, 2 a groove; `linkwork.slider_crank.plant` names them."""
        return 2 if self.groove else 0 if self.axial_force is not None else 1


#: Kind of inputs of each mechanism, by its name.
INPUTS_OF: dict[str, type[Inputs | SliderCrankInputs]] = {kind.MECHANISM: kind for kind in (Inputs, SliderCrankInputs)}


def given(mechanism: Mechanism, inputs: Channels | None, initial: InitialState | None) -> tuple[Channels, Any]:
    """Inputs and state at the start of a run, by default nothing and at rest; both must be of the mechanism.

    Raises
    ------
    InputError
        If they are another mechanism's.
    """
    kind = INPUTS_OF[mechanism.name]
    inputs = kind() if inputs is None else inputs
    initial = mechanism.initial() if initial is None else initial
    for name, value, wanted in (("inputs", inputs, kind), ("initial", initial, mechanism.initial)):
        if not isinstance(value, wanted):
            raise InputError(
                f"{name} is {type(value).__module__}.{type(value).__qualname__}: with parameters of the {mechanism.name} it "
                f"must be {wanted.__module__}.{wanted.__qualname__}"
            )
    return inputs, initial


@dataclass(frozen=True, slots=True)
class Encoded:
    """`Inputs` as the arrays that the compiled code reads.

    Attributes
    ----------
    breaks : ndarray, shape (n + 1,)
        Times at which some channel's polynomial changes.
    coefficients : ndarray, shape (n, 5, 4)
        Polynomials of the channels between the breaks.
    harmonics : ndarray, shape (m, 4)
        Channel number, amplitude, frequency, phase.
    law : ndarray, shape (6,)
        Torsion bar: torque, release angle, 1 while it acts. Motor: breakdown torque and slip, synchronous speed.
    functions : tuple
        Python functions of the channels 0, 2, 3, 4 and 1, and of the rates of channels 1 and 4, or None.
    kind : type
        Of the inputs.
    """

    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    harmonics: NDArray[np.float64]
    law: NDArray[np.float64]
    functions: tuple[StateFunction | None, ...] = field(default=(None,) * FUNCTIONS)
    kind: type[Channels] = Inputs

    @property
    def value_names(self) -> tuple[str, ...]:
        """Names of what the channels and the rates are worth at a time, in the order of the compiled code."""
        torque, speed, *others = self.kind.CHANNELS
        return (torque, speed, "acceleration", *others, f"rate of {others[-1]}")

    @property
    def steady(self) -> bool:
        """Whether all channels, but for the torsion bar and of the speed its rate, are constant between the breaks.

        An axial speed counts by its value, though only its rate acts: where it is not constant the run takes the general way.
        """
        others = [c for c in range(self.coefficients.shape[1]) if c != SPEED]
        return bool(
            len(self.harmonics) == 0
            and self.law[3] == 0.0
            and not any(self.functions)
            and np.all(self.coefficients[:, others, 1:] == 0.0)
            and np.all(self.coefficients[:, SPEED, 2:] == 0.0)
        )


def encode(inputs: Channels) -> Encoded:
    """Bring all channels onto common breaks."""
    pieces = [(c, part) for c, name in enumerate(inputs.CHANNELS) for part in inputs.parts(name)]
    times = [part.breaks for _, part in pieces if isinstance(part, Piecewise)]
    for _, part in pieces:
        if isinstance(part, Function) and len(part.breaks) > 0:
            # every one of them is a break inside: the first and the last of the merged ones are none
            times.append(np.array([min(part.breaks) - 1.0, *part.breaks, max(part.breaks) + 1.0]))
    merged = np.unique(np.concatenate(times)) if times else np.array([0.0, 1.0])
    coefficients = np.zeros((len(merged) - 1, len(inputs.CHANNELS), 4))
    harmonics: list[tuple[float, float, float, float]] = []
    law = np.zeros(6)
    law[4] = law[5] = 1.0
    functions: list[StateFunction | None] = [None] * FUNCTIONS
    for c, part in pieces:
        if isinstance(part, Piecewise):
            coefficients[:, c, :] += _on_breaks(part, merged)
        elif isinstance(part, Harmonics):
            coefficients[:, c, 0] += part.mean
            harmonics += [(float(c), *row) for row in zip(part.amplitudes, part.frequencies, part.phases)]
        elif isinstance(part, TorsionBar):
            law[0:3] = part.torque, part.release_angle, 1.0
        elif isinstance(part, InductionMotor):
            law[3:6] = part.breakdown_torque, part.breakdown_slip, part.synchronous_speed
        elif isinstance(part, Function):
            functions[SLOT_OF_CHANNEL[c]] = part.function
            if c in SLOT_OF_RATE and part.rate is not None:
                functions[SLOT_OF_RATE[c]] = part.rate
        else:
            coefficients[:, c, 0] += float(part)
    return Encoded(
        merged, coefficients, np.array(harmonics, dtype=float).reshape(-1, 4), law, tuple(functions), type(inputs)
    )


def _on_breaks(part: Piecewise, breaks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of ``part`` about the left ends of finer breaks; its outer pieces go on beyond its ends."""
    left = breaks[:-1]
    index = np.clip(np.searchsorted(part.breaks, left, side="right") - 1, 0, len(part.coefficients) - 1)
    s = left - part.breaks[index]
    c0, c1, c2, c3 = part.coefficients[index].T
    return np.column_stack(
        [c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2.0 * c2 + s * 3.0 * c3), c2 + 3.0 * s * c3, c3]
    )


def align(encoded: Encoded, times: NDArray[np.float64]) -> Encoded:
    """The same inputs with those breaks that miss a sample by rounding alone moved onto it.

    0.3 is not 3 * 0.1 in floats: a jump at 0.3 s would otherwise be missed by a whole step where inputs are sampled and
    held, and the sample there would belong to what was before the jump.
    """
    after = np.clip(np.searchsorted(times, encoded.breaks), 1, len(times) - 1)
    low, high = times[after - 1], times[after]
    nearest = np.where(encoded.breaks - low < high - encoded.breaks, low, high)
    rounding = 1e-9 * (high - low) + 4.0 * np.spacing(np.abs(encoded.breaks))
    moved = np.where(np.abs(nearest - encoded.breaks) <= rounding, nearest, encoded.breaks)
    return replace(encoded, breaks=moved) if np.all(np.diff(moved) > 0.0) else encoded
