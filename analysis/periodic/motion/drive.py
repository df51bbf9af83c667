"""Define the drive of a mechanism in periodic motion, the scales of its state, and starts of the search for motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace
from fractions import Fraction
from functools import cache
from math import inf, isfinite, lcm, pi
from numbers import Real
from typing import Any, NamedTuple, SupportsFloat

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError
from linkwork.mechanism import Channel, Freedom, Mechanism, PublishedSet
from linkwork.parameters import field_name

from ... import run
from ...files import unknown_name
from ...mechanisms import InitialState, Parameters, find_mechanism, variable_units
from ...numerics.cache import code_folder, load_or_make
from ...run import InductionMotor, Inputs, takes_published
from ...units import Amount, in_si
from .flow import PLAIN, Crank, Flow, find_crank, find_turning_freedom, flow

#: Value below which a relative change of accelerations by a turn, or an error of a ratio of turns, counts as a rounding error.
_NO_SPRING = 1e-7
#: Advice in messages about a negative speed.
_MIRROR = (
    "; for a crank that turns the other way describe the mirror image: change the signs of y and of all angles, also that of "
    "gravity, and adapt the assemblies"
)
#: A torque on the crank: constant, a motor's, or both.
Torque = float | InductionMotor | Sequence[float | InductionMotor]


class VaryingInputError(InputError):
    """An input varies in time, so that there is no periodic motion to be sought; ``channel`` is the name of the input."""

    def __init__(self, channel: str, value: object) -> None:
        self.channel = channel
        super().__init__(
            f"{channel} is a {type(value).__name__}: every input of a periodic motion must be constant, or an induction motor"
        )


class NothingFreeError(InputError):
    """All degrees of freedom are commanded, so that none can oscillate.

    ``force`` is an input that would free one of them; it is empty if there is none.
    """

    def __init__(self, mechanism: str, force: str) -> None:
        self.force = force
        other = force and f", or another freedom by a force, such as {force} = 0"
        super().__init__(f"no freedom of the {mechanism} is free at a prescribed speed: drive it by a torque{other}")


@in_si(speed="rad/s", torque="N.m", forces=variable_units, held=variable_units, speeds=variable_units)
@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """The drive of a mechanism in periodic motion: speeds of its cranks or torques on them; other inputs are constant.

    With one crank, ``speed``, ``torque`` and ``motor`` refer to this crank. With several cranks, ``speeds`` gives the speeds of
    all commanded cranks, which keep their ratios as the speed varies. If no crank is commanded, ``crank`` names the crank that
    ``torque`` and ``motor`` drive; torques on other cranks are among ``forces`` and ``motors``.

    Attributes
    ----------
    speed : float or None
        Prescribed crank speed (rad/s), above zero; None for a drive by torque.
    torque : float
        Constant torque on the crank (N.m), to which the torque of ``motor`` is added. Give 0 if a force law of the mechanism
        drives the crank. At a prescribed speed the torque is 0.
    motor : InductionMotor or None
        Motor on the crank; its torque is added to ``torque``.
    forces : mapping of str to float
        Constant forces by the FMI names of their inputs, such as ``slider.force`` or ``load.fx`` (N), and torques on other
        cranks (N.m).
    held : mapping of str to float
        Coordinates of held degrees of freedom by their FMI names, such as ``shift.position``, and angles of other commanded
        cranks at the crank angle 0; 0 if they are left out.
    modes : mapping of str to int
        Modes of degrees of freedom other than the crank, by name, such as ``axial.mode``. A degree of freedom whose mode is
        left out is free if its force is among ``forces`` (0 included), commanded if it is a crank with a ratio, and otherwise
        in its default mode.
    crank : str
        FMI name of the crank to which ``speed``, ``torque`` and ``motor`` refer: name of its coordinate, commanded speed or
        torque. It follows from ``speeds``, and may be left out if there is one crank.
    ratios : mapping of str to Fraction
        Turns of the other cranks per turn of the crank, by FMI name; they follow from ``speeds``. A crank that is not free and
        has no ratio is held. An undriven link that makes full turns has a ratio, too, by the name of its coordinate, such as
        ``{"swing.angle": 1}``; a link without a ratio only swings. If a spring couples a link or a free crank to the crank, the
        ratio follows.
    motors : mapping of str to InductionMotor
        Motors on other cranks by the FMI names of the torques.
    speeds : mapping of str to float, optional
        Prescribed speeds of all commanded cranks (rad/s) by the FMI names of their inputs, such as ``{"left.speed": 40.0,
        "right.speed": -80.0}``; the first above zero is ``speed``.

    Raises
    ------
    InputError
        If a value is not a finite number, the speed is not above zero, there are both a speed and a torque, or speeds have no
        common period.
    """

    speed: Amount = None
    torque: Amount = None
    motor: InductionMotor | None = None
    forces: Mapping[str, Amount] = field(default_factory=dict)
    held: Mapping[str, Amount] = field(default_factory=dict)
    modes: Mapping[str, int] = field(default_factory=dict)
    crank: str = ""
    ratios: Mapping[str, Any] = field(default_factory=dict)
    motors: Mapping[str, InductionMotor] = field(default_factory=dict)
    speeds: InitVar[Mapping[str, Amount] | None] = None

    def __post_init__(self, speeds: Mapping[str, Any] | None) -> None:
        alone = {name: value for name in ("speed", "torque") if (value := getattr(self, name)) is not None}
        for name, value in {**alone, **self.forces, **self.held, **(speeds or {})}.items():
            run.require_kind(value, Real, name, "a number in SI, or a text with its unit")
        if speeds:
            if self.speed is not None:
                raise InputError("both speed and speeds are given: speeds has those of all commanded cranks")
            known = {name: value for name, value in speeds.items() if isfinite(value)}
            first = next((name for name, value in known.items() if value > 0.0), None)
            if first is None or len(known) < len(speeds):
                mirror = _MIRROR if known and first is None and min(known.values()) < 0.0 else ""
                raise InputError(f"speeds are {dict(speeds)} rad/s: they must be finite, and one above zero{mirror}")
            ratios = {n: run.speed_ratio(n, speed, first, speeds[first]) for n, speed in speeds.items() if n != first}
            for name, value in (("speed", speeds[first]), ("crank", first), ("ratios", {**self.ratios, **ratios})):
                object.__setattr__(self, name, value)
        if self.ratios:
            object.__setattr__(self, "ratios", {name: _read_ratio(name, value) for name, value in self.ratios.items()})
        if self.speed is not None and not (isfinite(self.speed) and self.speed > 0.0):
            mirror = _MIRROR if self.speed < 0.0 else ""
            raise InputError(f"speed is {self.speed} rad/s: it must be a finite number above zero{mirror}")
        if self.torque is None:
            if self.speed is None and self.motor is None:
                raise InputError(
                    "neither a speed nor a torque is given: an orbit needs one of them; where a force law drives the crank, "
                    "torque = 0"
                )
            object.__setattr__(self, "torque", 0.0)
        for name, value in {"torque": self.torque, **self.forces, **self.held}.items():
            if not isfinite(value):
                raise InputError(f"{name} is {value}: it must be a finite number")
        if self.speed is not None and (self.torque != 0.0 or self.motor is not None):
            raise InputError("both a speed and a torque are given: give only one of them")

    @property
    def speed_drive(self) -> bool:
        """Return whether the crank speed is prescribed."""
        return self.speed is not None

    def reference(self, mechanism: Mechanism) -> Crank:
        """Return the crank to which ``speed``, ``torque`` and ``motor`` refer; its angle is the independent variable.

        Raises
        ------
        InputError
            If the mechanism has no crank, or has several cranks and ``crank`` names none of them.
        """
        return find_crank(mechanism, self.crank)

    def ratios_by_freedom(self, mechanism: Mechanism) -> dict[int, Fraction]:
        """Return the turns, per turn of the crank, of the other cranks and of the links that make full turns.

        The keys are the indices of their degrees of freedom. A free rotation without a given ratio that a spring couples to the
        crank, to another crank or to a link with a ratio has the ratio that does not wind this spring up.
        """
        given = {find_turning_freedom(mechanism, name): ratio for name, ratio in self.ratios.items()}
        return self._with_coupled(mechanism, given)

    def _with_coupled(self, mechanism: Mechanism, given: dict[int, Fraction]) -> dict[int, Fraction]:
        """Return the ratios ``given`` and the ratios of rotations that springs couple to these rotations or to the crank."""
        if not any(freedom.coupled for freedom in mechanism.freedoms):
            return given
        turning, acting = {self.reference(mechanism).freedom: Fraction(1)} | given, {*self.forces, *self.motors}
        loaded = {c.freedom for c in mechanism.channels if c.kind == "force" and c.name in acting}
        others = ((n, f) for n, f in enumerate(mechanism.freedoms) if f.coupled and n not in turning)
        coupled = tuple(n for n, freedom in others if freedom.swings or n in loaded)
        return given | _coupled_ratios(mechanism, coupled, tuple(turning.items()))

    def arguments(self, mechanism: Mechanism) -> Mapping[str, str]:
        """Return how each degree of freedom that has a mode is driven: one of `Mode.arguments`, by the name of the mode.

        Raises
        ------
        InputError
            If ``modes`` names a mode that no degree of freedom other than the crank has, or gives it a value that does not
            exist.
        """
        return _arguments(
            mechanism,
            self.reference(mechanism).freedom,
            self.speed_drive,
            (*self.forces, *self.motors),
            tuple(self.ratios_by_freedom(mechanism)),
            tuple(self.modes.items()),
        )

    def flow(self, mechanism: Mechanism) -> Flow:
        """Return the flow of the mechanism with this drive.

        Raises
        ------
        InputError
            If the mechanism cannot have this drive, or no degree of freedom is free.
        """
        crank, ratios = self.reference(mechanism), self.ratios_by_freedom(mechanism)
        if (crank.command if self.speed_drive else crank.torque) is None:
            what = "speed of" if self.speed_drive else "torque on"
            raise InputError(f"a {mechanism.name} has no input for the {what} its crank: choose another kind of drive")
        chosen = self.arguments(mechanism)
        modes = tuple(mode.arguments.index(chosen[mode.name]) for mode in mechanism.modes)
        freedoms = mechanism.freedoms
        # ratios in whole turns; springs that couple links to the cranks fix the ratios of these links, too
        own = _whole_turns(freedoms[crank.freedom])
        whole = {n: ratio * own / _whole_turns(freedoms[n]) for n, ratio in ratios.items()}
        fixed = self._with_coupled(mechanism, {n: ratio for n, ratio in ratios.items() if not freedoms[n].swings})
        common = lcm(*(of.denominator for n, of in whole.items() if n in fixed))
        base = lcm(common, *(of.denominator for of in whole.values()))
        made = flow(mechanism, modes, crank.freedom, base, base // common)
        for number in made.others:
            name = freedoms[number].coordinate
            if number in made.free and number not in ratios and not freedoms[number].swings:
                raise InputError(
                    f"{name} is free: say how often it turns for each turn of the crank, in Python ratios = {{{name!r}: 1}}, "
                    f"in a case by the speeds at the start, such as initial.{freedoms[number].initial[1]}"
                )
            if number in ratios and number not in (*made.free, *made.commanded):
                raise InputError(f"{name} has a ratio, but is neither commanded nor free")
        if made.size == 0:
            acting = force_inputs(mechanism).values()
            others = (c.name for c in acting if c.freedom >= 0 and c.freedom != crank.freedom)
            raise NothingFreeError(mechanism.name, next(others, ""))
        return made

    def with_rounds(self, mechanism: Mechanism, rounds: Mapping[str, int], turns: int) -> tuple[Drive, int]:
        """Return the drive for motions in which undriven links make given numbers of whole turns in ``turns`` common periods.

        Parameters
        ----------
        mechanism : Mechanism
        rounds : mapping of str to int
            Number of whole turns of each link, by the FMI name of the link's coordinate.
        turns : int
            Number of common periods of this drive.

        Returns
        -------
        drive : Drive
        turns : int
            Number of common periods of the new drive in the same time: fewer if the common period has become longer.
        """
        made, freedoms = self.flow(mechanism), {f.coordinate: f for f in mechanism.freedoms}
        ratios = {n: Fraction(times * _whole_turns(freedoms[n]), turns * made.turns) for n, times in rounds.items()}
        drive = replace(self, ratios={**self.ratios, **ratios})
        return drive, round(turns * made.period / drive.flow(mechanism).period)

    def vector(self, mechanism: Mechanism) -> NDArray[np.float64]:
        """Return the drive vector: channels, motor parameters, held coordinates and ratios, in the order that `Flow` describes.

        Raises
        ------
        UnknownNameError
            If a name in ``forces`` is not the name of a force input, or a name in ``motors`` is not the name of a torque.
        InputError
            If a force has no effect in this drive, or if ``held`` names a coordinate that is not held.
        """
        made, crank, ratios = self.flow(mechanism), self.reference(mechanism), self.ratios_by_freedom(mechanism)
        numbers = {c.name: n for n, c in enumerate(mechanism.channels)}
        u = np.zeros(len(numbers))
        if self.speed is not None and crank.command is not None:
            u[crank.command] = self.speed
            for number, channel in made.commanded.items():
                u[channel] = ratios.get(number, Fraction(0)) * self.speed
        elif crank.torque is not None:
            u[crank.torque] = self.torque
        forces = force_inputs(mechanism)
        for name, value in self.forces.items():
            if name not in forces:
                raise unknown_name(name, forces)
            require_acting(self, mechanism, forces[name])
            u[numbers[name]] = value
        motors = []
        for channel in mechanism.torques:
            name = mechanism.channels[channel].name
            motor = self.motor if channel == crank.torque else self.motors.get(name)
            if motor is not None:
                require_acting(self, mechanism, mechanism.channels[channel])
            # a motor without a breakdown torque exerts no torque
            motors += [0.0, 1.0, 1.0] if motor is None else [getattr(motor, field) for field in run.MOTOR]
        if wrong := [name for name in self.motors if numbers.get(name) not in mechanism.torques]:
            raise unknown_name(wrong[0], [mechanism.channels[n].name for n in mechanism.torques])
        coordinates = [f.coordinate for f in mechanism.freedoms]
        for name in self.held:
            if name not in coordinates or coordinates.index(name) in (crank.freedom, *made.free):
                raise InputError(f"{name} is not a coordinate of the {mechanism.name} that is held in this drive")
        held = (self.held.get(name, 0.0) for name in coordinates)
        return np.array([*u, *motors, *held, *(float(ratios.get(n, 0)) for n in made.others)])

    def inputs(self, mechanism: Mechanism) -> Inputs:
        """Return the `Inputs` that give a run of the mechanism this drive."""
        made, crank, ratios = self.flow(mechanism), self.reference(mechanism), self.ratios_by_freedom(mechanism)
        names = [c.argument for c in mechanism.channels]
        acting: dict[str, Any] = {c.argument: self.forces[c.name] for c in mechanism.channels if c.name in self.forces}
        for channel in mechanism.channels:
            if channel.name in self.motors:
                acting[channel.argument] = (acting.get(channel.argument, 0.0), self.motors[channel.name])
        if self.speed is not None:
            acting[names[crank.command or 0]] = self.speed
            acting |= {names[n]: float(ratios.get(i, Fraction(0)) * self.speed) for i, n in made.commanded.items()}
        else:
            acting[names[crank.torque or 0]] = self.torque if self.motor is None else (self.torque, self.motor)
        for argument in self.arguments(mechanism).values():
            acting.setdefault(argument, 0.0 if argument in names else True)
        return Inputs(**acting)


def _read_ratio(name: str, value: object) -> Fraction:
    """Return the ratio of turns of ``name`` as a fraction; raise InputError if it is not a finite number."""
    if isinstance(value, Fraction):
        return value
    if isinstance(value, (bool, str)) or not isinstance(value, SupportsFloat) or not isfinite(value):
        raise InputError(
            f"the ratio of {name} is {value!r}: it must be a finite number of turns per turn of the crank, such as -0.5 or "
            "Fraction(-1, 2)"
        )
    return run.speed_ratio(name, float(value), "crank", 1.0)


def _whole_turns(freedom: Freedom) -> int:
    """Return the number of turns of a link after which the mechanism is in the same configuration again."""
    return round(freedom.period / (2.0 * pi))


@cache
def _coupled_ratios(
    mechanism: Mechanism, coupled: tuple[int, ...], turning: tuple[tuple[int, Fraction], ...]
) -> dict[int, Fraction]:
    """Return the turns of coupled rotations, per turn of the crank, that do not wind up the springs that couple them.

    A whole turn of one of these rotations changes the accelerations only through the spring. ``turning`` are the other
    rotations with their ratios, the crank included; keys are indices of degrees of freedom. Coupled rotations that do not turn
    are left out of the result, which holds for the parameters of the first published set; under a nonlinear law both ends of
    the spring must turn equally often.
    """
    if not coupled:
        return {}
    known, size = mechanism.first_set, len(mechanism.freedoms)
    p = known.parameters.constants()
    x, i = np.array(mechanism.state(known.initial)), mechanism.idle_inputs(p)

    def accelerations(number: int, turns: float) -> NDArray[np.float64]:
        state = x.copy()
        state[number] += turns * mechanism.freedoms[number].period
        return np.array(mechanism.equations.derivative(tuple(state.tolist()), i, p))[size : 2 * size]

    def winding(number: int) -> NDArray[np.float64]:
        """Return the change of the accelerations by one turn of a degree of freedom, as a central difference over two periods.

        With a central difference two bodies that turn equally have opposite effects on a spring between them, under any law and
        also if the spring is twisted at the start.
        """
        turns = 2.0 * _whole_turns(mechanism.freedoms[number])
        return (accelerations(number, 1.0) - accelerations(number, -1.0)) / turns

    try:
        wound = sum((float(ratio) * winding(number) for number, ratio in turning), np.zeros(size))
        columns = np.column_stack([winding(number) for number in coupled])
        found = np.linalg.lstsq(columns, -wound, rcond=_NO_SPRING)[0].tolist()
        fractions = [Fraction(ratio).limit_denominator(run.MOST_TURNS) for ratio in found]
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return {}
    return {n: ratio for n, ratio, value in zip(coupled, fractions, found) if ratio and abs(ratio - value) < _NO_SPRING}


def require_drive(drive: object) -> Drive:
    """Return ``drive``; raise InputError if it is not a `Drive`."""
    if not isinstance(drive, Drive):
        raise InputError(f"drive is {drive!r}: give a drive, such as Drive(speed=44.0) or Drive(speed='420 rpm')")
    return drive


class Direction(NamedTuple):
    """Derivatives of `Drive.vector` and of the constants of the equations with respect to a parameter lambda."""

    drive: NDArray[np.float64]
    constants: NDArray[np.float64]


@cache
def _arguments(
    mechanism: Mechanism,
    crank: int,
    speed_drive: bool,
    acting: tuple[str, ...],
    turning: tuple[int, ...],
    modes: tuple[tuple[str, int], ...],
) -> Mapping[str, str]:
    """Compute `Drive.arguments`; the result is cached because continuation needs it at every point of a branch."""
    found, own = {}, dict(modes)
    others = {f.mode.name: f.mode for n, f in enumerate(mechanism.freedoms) if f.mode and n != crank}
    for name, value in modes:
        if name not in others or value not in range(len(others[name].values)):
            raise InputError(f"{name} = {value} is not a mode of a {mechanism.name} that a drive can have")
    for number, freedom in enumerate(mechanism.freedoms):
        if (mode := freedom.mode) is None:
            continue
        if mode.name in own:
            found[mode.name] = mode.arguments[own[mode.name]]
            continue
        names = {c.kind: c for c in mechanism.channels if c.freedom == number}
        kind = "command" if number == crank and speed_drive else "force"
        acts = kind in names and (number == crank or names[kind].name in acting)
        if not acts and number in turning:
            # a crank with a ratio but without a force is commanded, if its speed can be prescribed
            kind, acts = ("command", True) if "command" in names else (kind, kind in names)
        found[mode.name] = names[kind].argument if acts else mode.arguments[mode.default]
    return found


@cache
def force_inputs(mechanism: Mechanism) -> dict[str, Channel]:
    """Return the force inputs of a mechanism by FMI name; the torque on the crank is left out if there is one crank only."""
    crank = mechanism.cyclic_freedoms[0] if len(mechanism.cyclic_freedoms) == 1 else -1
    return {c.name: c for c in mechanism.channels if c.kind == "force" and (c.freedom != crank or crank < 0)}


def require_acting(drive: Drive, mechanism: Mechanism, channel: Channel) -> None:
    """Raise InputError if a channel has no effect because the drive prescribes its degree of freedom differently."""
    mode = mechanism.freedoms[channel.freedom].mode if channel.freedom >= 0 else None
    chosen = "" if mode is None else drive.arguments(mechanism)[mode.name]
    if mode is not None and chosen != channel.argument:
        raise InputError(f"{channel.name} does not act: {mode.name} is {mode.values[mode.arguments.index(chosen)]}")


def published_drive(known: PublishedSet, drive: Drive | None) -> Drive:
    """Return ``drive``; if it is None, return the drive of a published set.

    In the drive of the set, held degrees of freedom are at the set's initial values.
    """
    return drive or steady_drive(known.parameters, run.complete_inputs(known, None), known.initial)


@takes_published(inputs=run.complete_inputs, initial=run.complete_initial_state)
@in_si(speed="rad/s", torque="N.m")
def steady_drive(
    parameters: Parameters,
    inputs: Inputs | None = None,
    initial: InitialState | None = None,
    *,
    speed: Amount = None,
    torque: Amount = None,
) -> Drive:
    """Return the drive of a periodic motion from the inputs of a run; the inputs must not vary in time.

    Parameters
    ----------
    parameters : parameters of a mechanism
    inputs : Inputs, optional
    initial : state at the start, optional
        State that gives the positions of held degrees of freedom: all those that are neither free nor the crank.
    speed, torque : optional
        Crank speed (rad/s) and torque on the crank (N.m), instead of the drive of the crank in ``inputs``; other commanded
        cranks keep their ratios to the crank.

    Raises
    ------
    VaryingInputError
        If an input varies.
    InputError
        If nothing drives the crank, or if a degree of freedom that is not a crank is commanded at a speed other than zero.
    """
    mechanism = find_mechanism(parameters)
    inputs, initial = run.check_run(mechanism, inputs, initial)
    modes = inputs.modes(mechanism)
    crank, ratios = _choose_crank(mechanism, inputs, initial, modes)
    constant: dict[str, float] = {}
    motors: list[InductionMotor] = []
    others: dict[str, InductionMotor] = {}
    for number, channel in enumerate(mechanism.channels):
        if channel.freedom == crank.freedom and (speed is not None or torque is not None):
            continue
        for part in inputs.parts(channel.argument) if channel.kind != "rate" else ():
            if isinstance(part, InductionMotor) and number == crank.torque:
                motors.append(part)
            elif isinstance(part, InductionMotor) and number in mechanism.torques:
                others[channel.name] = part
            elif isinstance(part, (int, float, np.floating, np.integer)):
                constant[channel.name] = constant.get(channel.name, 0.0) + float(part)
            else:
                raise VaryingInputError(channel.argument, part)
    speed_name, torque_name = ("" if n is None else mechanism.channels[n].name for n in (crank.command, crank.torque))
    for channel in mechanism.channels:
        turns = channel.freedom in mechanism.cyclic_freedoms
        if channel.kind == "command" and not turns and constant.get(channel.name, 0.0) != 0.0:
            raise InputError(
                f"{channel.argument} is {constant[channel.name]}: with this constant speed the motion is not periodic"
            )
    parts = () if torque is None else tuple(torque) if isinstance(torque, Sequence) else (torque,)
    motors += [part for part in parts if isinstance(part, InductionMotor)]
    if len(motors) > 1:
        raise InputError(f"{len(motors)} motors drive the crank: there must be at most one")
    free = flow(mechanism, tuple(modes.values()), crank.freedom).free
    other = {n: f for n, f in enumerate(mechanism.freedoms) if n not in (crank.freedom, *free)}
    angle = float(getattr(initial, mechanism.freedoms[crank.freedom].initial[0]))
    coordinate = {n: f.coordinate for n, f in enumerate(mechanism.freedoms)}
    several = len(mechanism.cyclic_freedoms) > 1
    torques = [constant[torque_name]] if torque_name in constant else []
    torques += [float(part) for part in parts if not isinstance(part, InductionMotor)]
    return Drive(
        speed=constant.get(speed_name) if speed is None else speed,
        torque=sum(torques) if torques else None,
        motor=motors[0] if motors else None,
        forces={name: constant[name] for name in force_inputs(mechanism) if name in constant and name != torque_name},
        held={f.coordinate: float(getattr(initial, f.initial[0])) - ratios.get(n, 0) * angle for n, f in other.items()},
        modes={f.mode.name: modes[f.mode.name] for f in other.values() if f.mode is not None},
        crank=coordinate[crank.freedom] if several else "",
        ratios={coordinate[n]: ratio for n, ratio in ratios.items()},
        motors=others,
    )


def _choose_crank(
    mechanism: Mechanism, inputs: Inputs, initial: InitialState, modes: Mapping[str, int]
) -> tuple[Crank, dict[int, Fraction]]:
    """Return the crank whose angle is the independent variable under the inputs of a run, and the ratios of the other cranks.

    This crank is the first crank that is commanded at a positive speed, or else the first crank. The ratios, by index of the
    degree of freedom, are those of the commanded speeds; a free crank has the ratio of the initial speeds, see `start_ratio`,
    unless it begins at rest and a spring couples it, see `Drive.ratios_by_freedom`.
    """
    cranks, freedoms = mechanism.cyclic_freedoms, mechanism.freedoms
    if len(cranks) < 2:
        return find_crank(mechanism), {}
    commanded = {mechanism.channels[n].freedom: mechanism.channels[n] for n in mechanism.commands(modes)}
    speeds = {n: sum(inputs.constants([commanded[n].argument]) or [0.0]) for n in cranks if n in commanded}
    first = next((n for n, speed in speeds.items() if speed > 0.0), cranks[0])
    crank = find_crank(mechanism, freedoms[first].coordinate)
    start = {n: float(getattr(initial, freedoms[n].initial[1])) for n in cranks}
    speed = speeds.get(first) or start[first]
    ratios = {}
    for n in cranks:
        if n == first:
            continue
        if n in speeds and first in speeds:
            ratios[n] = run.speed_ratio(commanded[n].name, speeds[n], commanded[first].name, speed)
        elif n in speeds:
            ratios[n] = Fraction(0)
        elif speed != 0.0 and (start[n] != 0.0 or not freedoms[n].coupled):
            ratios[n] = run.start_ratio(start[n], speed)
    return crank, ratios


#: Distance of two starts, relative to the scale, below which they belong to the same motion.
SAME = 1e-6
#: Greatest distance of starts from rest if no limit of assembly is met, relative to the scale of y, and the factor by which
#: the distance is increased until the limit is met.
_WIDEST, _WIDER = 16.0, 1.25
#: Ratio of the two sides of a range above which it is one-sided: more than one step by the factor ``_WIDER``.
_ONE_SIDED = 1.3
#: Greatest number of free vibrations per turn of the crank at the widest starts, or twice the number at small amplitudes if
#: that is greater; for a coupled body, also the greatest speed, relative to the crank, that the spring of its coupling gives
#: it.
_FASTEST = 30.0
#: Ratio of the largest ellipse of starts to the smallest: the smallest are for motions much smaller than the room that the
#: links have.
_DEPTH = 1024.0
#: Crank speeds of starts under a torque, relative to the guess.
_SPEEDS = (0.25, 1.5)


@takes_published()
def motion_scales(parameters: Parameters, drive: Drive, start: ArrayLike) -> NDArray[np.float64]:
    """Return the scale of each component of y, its typical magnitude; shape (n,).

    For a five-bar: the crank length, the speed of the crank pin and, under a torque, the crank speed.
    """
    mechanism = find_mechanism(parameters)
    return flow_scales(drive.flow(mechanism), parameters, drive.vector(mechanism), np.asarray(start, dtype=float))


def flow_scales(
    flow: Flow, parameters: Parameters, vector: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the scale of each component of y: see `motion_scales`; ``vector`` is the drive vector."""
    scale = flow.mechanism.error_scale(parameters, flow.state(start, vector))
    return np.array([scale[place] for place in flow.places])


def is_smooth(parameters: Parameters) -> bool:
    """Return whether the rates are smooth functions of the crank angle: whether there is no friction.

    Friction changes fast when a motion reverses; only an integrator with step size control resolves this reliably.
    """
    mechanism = find_mechanism(parameters)
    rough = mechanism.names("friction")
    return not any(getattr(parameters, field_name(name)) for name in rough) and not mechanism.is_switched_on(
        parameters.constants()
    )


def assembly_ranges(
    parameters: Parameters, drive: Drive, guess: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower and the upper bounds, at crank angle 0, of the free coordinates for which the links can be joined.

    Each coordinate is moved away from its default value in growing steps, while all other components of y stay as in
    ``guess``; a bound may lie one step too far. Both arrays have the shape (free,).
    """
    mechanism = find_mechanism(parameters)
    flow, vector, scale = drive.flow(mechanism), drive.vector(mechanism), motion_scales(parameters, drive, guess)
    p, sides = parameters.constants(), []
    for sign in (-1.0, 1.0):
        found = scale[: flow.size // 2].copy()
        for i in range(len(found)):
            half = 0.5 * flow.angle_periods[i]
            while found[i] < (half or _WIDEST * scale[i]):
                y = guess.copy()
                y[i] = flow.rest[i] + sign * found[i]
                try:
                    mechanism.check_assembly(flow.state(y, vector), p)
                except AssemblyError:
                    break
                found[i] *= _WIDER
            found[i] = min(found[i], half or inf)
        sides.append(flow.rest[: len(found)] + sign * found)
    return sides[0], sides[1]


def start_ranges(
    parameters: Parameters, drive: Drive, guess: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bounds of `assembly_ranges`, reduced to where free vibrations are not too fast: see `_FASTEST`.

    Where a spring has become much stiffer, there are no periodic motions, and integrations take very long. They also take long
    where the spring of a coupling is wound up so far that it turns the coupled body many times per turn of the crank.
    """
    mechanism, p = find_mechanism(parameters), parameters.constants()
    flow, vector, constants = drive.flow(mechanism), drive.vector(mechanism), np.array(p)
    rates = flow.function(PLAIN, mechanism.is_switched_on(p))
    numbers = (flow.modes, np.append(vector, np.zeros_like(vector)), np.append(constants, np.zeros_like(constants)))
    pace, n, half = drive.speed or guess[-1], flow.size, flow.size // 2

    def square(place: int, away: float) -> float:
        # square of the number of free vibrations per turn of the crank, from the change of the acceleration
        y = np.zeros((2, n * (n + 2)))
        y[:, :n] = guess
        y[:, place] = flow.rest[place] + np.array([0.0, away])
        slopes = [float(rates(0.0, z, *numbers)[half + place]) for z in y]
        return float(abs((slopes[1] - slopes[0]) / (away * pace)))

    low, high = assembly_ranges(parameters, drive, guess)
    coupled = {n for n, ratio in drive.ratios_by_freedom(mechanism).items() if ratio}

    def is_too_fast(place: int, away: float, most: float) -> bool:
        vibrations = square(place, away)
        return vibrations > most or (flow.free[place] in coupled and vibrations * away**2 > _FASTEST**2)

    for bound in (low, high):
        for i, away in enumerate((bound - flow.rest[:half]).tolist()):
            most = max(_FASTEST**2, 4.0 * square(i, 1e-6 * away))
            # a bound may lie a step beyond the limit of assembly, where there are no accelerations
            inside = away if isfinite(square(i, away)) else away / _WIDER
            while abs(inside) > 1e-3 * abs(away) and is_too_fast(i, inside, most):
                inside /= _WIDER
                bound[i] = flow.rest[i] + inside
    return low, high


def mean_rates(drive: Drive, flow: Flow, guess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean rate of each free coordinate, shape (free,): the crank's speed times the coordinate's ratio.

    Without a ratio the mean rate is 0. Under a torque the last component of ``guess`` gives the crank's speed.
    """
    turning, pace = drive.ratios_by_freedom(flow.mechanism), drive.speed or guess[-1]
    return np.array([pace * turning.get(n, 0) for n in flow.free], dtype=float)


def spread_starts(
    parameters: Parameters,
    drive: Drive,
    guess: NDArray[np.float64],
    count: int,
    number: int = 0,
    ranges: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    """Return starts with many amplitudes and phases, by a scrambled Sobol sequence; shape (3/2 count or 5/2 count, n).

    In the plane of a coordinate and its rate the starts fill the largest ellipse about the default initial value for which the
    links can be joined. Half as many further starts have amplitudes that are spread evenly over the logarithm, because the
    motions may be much smaller than the room that the links have. If a coordinate can move much further in one direction than
    in the other, ``count`` further starts fill the ellipse about the middle of the range of this coordinate.

    Parameters
    ----------
    guess : ndarray, shape (n,)
        First guess of y; under a torque the crank speeds of the starts lie around the crank speed in ``guess``.
    count : int
        Number of starts in an ellipse, a power of two.
    number : int
        Index of the set of starts, which is the seed of the sequence: each index gives other starts.
    ranges : tuple of ndarray, optional
        Result of `start_ranges`, for callers that take several sets.
    """
    flow, scale = drive.flow(find_mechanism(parameters)), motion_scales(parameters, drive, guess)
    half = flow.size // 2
    rest = flow.rest[:half]
    low, high = start_ranges(parameters, drive, guess) if ranges is None else ranges
    around = mean_rates(drive, flow, guess)
    # the centre and the half axes of each ellipse
    own = np.minimum(rest - low, high - rest)
    filled, further = _sequence(flow.size, count, number), _sequence(flow.size, count // 2, number, 1).copy()
    further[:, :half] = _DEPTH ** -further[:, :half]
    ellipses = [(rest, own, filled), (rest, own, further)]
    if (np.maximum(rest - low, high - rest) > _ONE_SIDED * own).any():
        ellipses.append((0.5 * (low + high), 0.5 * (high - low), filled))
    sets = []
    for centre, extent, sequence in ellipses:
        amplitude, phase = sequence[:, :half], 2.0 * pi * sequence[:, half : 2 * half]
        found = np.tile(guess, (len(sequence), 1))
        found[:, :half] = centre + extent * amplitude * np.cos(phase)
        found[:, half : 2 * half] = around + extent * scale[half : 2 * half] / scale[:half] * amplitude * np.sin(phase)
        if flow.torque:
            slow, fast = _SPEEDS
            found[:, -1] *= slow + (fast - slow) * sequence[:, -1]
        sets.append(found)
    return np.vstack(sets)


@cache
def _sequence(size: int, count: int, *seed: int) -> NDArray[np.float64]:
    """Return the first points of a scrambled Sobol sequence, shape (count, size); they are kept in the cache on disk."""

    def make() -> bytes:
        from scipy.stats import qmc  # takes half a second

        points: bytes = qmc.Sobol(size, rng=seed).random(count).tobytes()
        return points

    name = "-".join(map(str, (scipy.__version__, size, count, *seed)))
    return np.frombuffer(load_or_make(code_folder("sequences") / name, make)).reshape(count, size)
