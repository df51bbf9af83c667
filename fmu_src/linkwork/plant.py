"""A mechanism as a stateful object: the shell around its equations that an FMU holds.

What every mechanism shares is here: inputs, steps, refused steps, commanded speeds that jump, saved states. A concrete plant
brings its parameters, its equations and its limit of assembly.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict
from math import isfinite, ulp
from typing import Any, ClassVar, NamedTuple, Self

from .errors import AssemblyError, InputError, IntegrationError, LinkworkError, ParameterError, StateError, StepError
from .integrate import UNDEFINED, Vector, integrate

#: Loosest and tightest tolerance that a run accepts.
TOLERANCE_RANGE = (1e-13, 1e-2)


def check_tolerance(tolerance: float) -> None:
    """Make sure that ``tolerance`` is usable.

    Raises
    ------
    ParameterError
        If it is outside `TOLERANCE_RANGE`.
    """
    low, high = TOLERANCE_RANGE
    if not low <= tolerance <= high:
        raise ParameterError("solver.tolerance", tolerance, f"be between {low:g} and {high:g}")


def error_scale(length: float, mass: float, inertia: float, crank_speed: float) -> tuple[float, ...]:
    """Magnitudes of a state's components below which the integrator's error counts as absolute.

    Of a mechanism with a crank of that length (m) and moment of inertia (kg.m2), other links of that mass (kg), and a crank
    speed at the start (rad/s).
    """
    speed = max(1.0, abs(crank_speed))
    energy = 0.5 * (inertia + mass * length * length) * speed * speed
    return (1.0, length, speed, length * speed, energy, energy)


class Mode(NamedTuple):
    """A way of driving a freedom: the parameter that chooses it and the words for its values, 0 and on."""

    name: str
    values: tuple[str, ...]


class MechanismPlant:
    """A mechanism in motion: state, inputs, and the step that takes it forward in time.

    The state is the six-tuple (crank angle, second coordinate, their rates, dissipated work, supplied work).

    Parameters
    ----------
    parameters
        Those of the mechanism.
    initial
        Its state at the start; the commanded speeds there take the place of what it gives.
    modes : dict
        Value of each of `MODES` by name.
    tolerance : float
        Bound of the local error of a step.
    time : float
        Time at the start (s).
    inputs : dict, optional
        Inputs in force at the start, by FMI name; those left out are zero.

    Raises
    ------
    ParameterError, AssemblyError, InputError
    """

    #: What it is, for the sentences.
    KIND: ClassVar[str]
    PARAMETERS: ClassVar[type]
    MODES: ClassVar[tuple[Mode, ...]]
    INPUT_NAMES: ClassVar[tuple[str, ...]]
    #: Inputs that are speeds, a jump of which is an impulse.
    COMMANDS: ClassVar[tuple[str, ...]]

    def __init__(
        self,
        parameters: Any,
        initial: Any,
        *,
        modes: dict[str, int],
        tolerance: float,
        time: float,
        inputs: dict[str, float] | None,
    ) -> None:
        for mode in self.MODES:
            if modes[mode.name] not in range(len(mode.values)):
                words = [f"{number} ({word})" for number, word in enumerate(mode.values)]
                raise ParameterError(mode.name, modes[mode.name], f"be {', '.join(words[:-1])} or {words[-1]}")
        check_tolerance(tolerance)
        if not isfinite(time):
            raise InputError(f"the time at the start is {time} s: it must be a finite number")
        self.parameters = parameters
        self.modes = modes
        self.tolerance = tolerance
        self.time = time
        self.inputs: dict[str, float] = dict.fromkeys(self.INPUT_NAMES, 0.0)
        self._commanded: set[str] = set()
        for name, value in (inputs or {}).items():
            self.set_input(name, value)
        self._check_inputs()
        self._p: Any = parameters.constants()
        self.state: Vector = self._start(initial)
        self._check_state(self.state)
        self._commanded.clear()
        self._step_size = 0.0
        self._scale = self._error_scale(self.state)
        self.start_energy = self._energy(self.state)
        if not isfinite(self.start_energy):
            raise InputError(f"the energy at the start is not finite: {self._started_from(self.state)}")

    # What a concrete plant adds

    def _start(self, initial: Any) -> Vector:
        """State at the start."""
        raise NotImplementedError

    def _check_state(self, x: Vector) -> None:
        """Make sure that the links can be joined at ``x``, clear of the limit of assembly; else AssemblyError."""
        raise NotImplementedError

    def _error_scale(self, x: Vector) -> Vector:
        """Magnitudes of the state's components below which the integrator's error counts as absolute."""
        raise NotImplementedError

    def _energy(self, x: Vector) -> float:
        """Mechanical energy (J)."""
        raise NotImplementedError

    def _inputs(self) -> Any:
        """The inputs in force as the equations read them."""
        raise NotImplementedError

    def _jumped(self, x: Vector, inputs: Any, commands: Collection[str]) -> Vector:
        """The state with the commanded speeds applied, of those ``commands``."""
        raise NotImplementedError

    def _derivative(self, x: Vector, inputs: Any) -> Vector:
        raise NotImplementedError

    def _outputs(self, x: Vector, inputs: Any) -> Any:
        raise NotImplementedError

    def _near_limit(self, x: Vector) -> bool:
        """Whether a failure at ``x`` is one of assembly."""
        raise NotImplementedError

    def _where(self, x: Vector) -> str:
        """The configuration in words."""
        raise NotImplementedError

    def _started_from(self, x: Vector) -> str:
        """The state at the start in words, by the names of what it was given by."""
        raise NotImplementedError

    # Inputs and outputs

    def set_input(self, name: str, value: float) -> None:
        """Set an input by its FMI name; it holds until it is set again. Checked at the next step, not here."""
        if name not in self.inputs:
            raise InputError(f"there is no input {name!r}: the inputs are {', '.join(self.INPUT_NAMES)}")
        self.inputs[name] = value
        if name in self.COMMANDS:
            self._commanded.add(name)

    def _check_inputs(self) -> None:
        for name, value in self.inputs.items():
            if not isfinite(value):
                raise InputError(f"input {name} is {value} at t = {self.time:.9g} s: it must be a finite number")

    def outputs(self) -> Any:
        """All real outputs at the present time under the inputs in force.

        Raises
        ------
        InputError
            If an input is not finite, or so large that an output is not.
        """
        self._check_inputs()
        i = self._inputs()
        result = self._outputs(self._jumped(self.state, i, self._commanded), i)
        if not all(map(isfinite, result)):
            largest = max(self.inputs, key=lambda name: abs(self.inputs[name]))
            raise InputError(
                f"an output is not finite at t = {self.time:.9g} s: input {largest} is {self.inputs[largest]:g}, too large"
            )
        return result

    # Steps

    def step(self, time: float, step: float) -> None:
        """Go forward from ``time`` by ``step`` seconds under the inputs in force.

        A step that fails leaves everything as it was.

        Raises
        ------
        StepError
            If ``step`` is not positive or ``time`` is not where the plant is.
        InputError
            If an input is not finite.
        AssemblyError
            If the motion reaches the limit of assembly.
        IntegrationError
            If the tolerance cannot be met.
        """
        if not (isfinite(time) and isfinite(step)):
            raise StepError(f"a step of {step} s from t = {time} s: both must be finite numbers")
        if step <= 0.0:
            raise StepError(f"a step of {step:.9g} s at t = {time:.9g} s: it must be greater than zero")
        # what rounding in the master's own sum of steps can make, and no more: a repeated step of a microsecond is told
        slack = min(1e-6 * step, 1e-9) + 8.0 * ulp(max(abs(time), abs(self.time)))
        if abs(time - self.time) > slack:
            way = "backwards" if time < self.time else "over a gap"
            raise StepError(f"a step {way}: it starts at t = {time:.9g} s, but the state is at t = {self.time:.9g} s")
        self._check_inputs()
        i = self._inputs()
        # a commanded speed that was not set again: the step starts from it all the same, as the contract says
        x = self._jumped(self.state, i, self.COMMANDS)
        last = x

        def accept(y: Vector) -> None:
            nonlocal last
            self._check_state(y)
            last = y

        try:
            result = integrate(
                lambda y: self._derivative(y, i),
                x,
                step,
                tolerance=self.tolerance,
                scale=self._scale,
                step=self._step_size,
                accept=accept,
            )
        except LinkworkError as error:
            raise self._explain(error, time, last) from error
        except UNDEFINED as error:
            raise self._explain(IntegrationError(str(error)), time, last) from error
        self.state = result.x
        self.time = time + step
        self._step_size = result.step
        self._commanded = set()

    def _explain(self, error: LinkworkError, time: float, last: Vector) -> LinkworkError:
        """The error with the time of the step and, where the cause is the limit of assembly, with that said."""
        if isinstance(error, IntegrationError):
            if self._near_limit(last):
                return AssemblyError(f"in the step from t = {time:.9g} s: limit of assembly near {self._where(last)}")
            return IntegrationError(f"in the step from t = {time:.9g} s: {error}, at {self._where(last)}")
        return type(error)(f"in the step from t = {time:.9g} s: {error}")

    # Saved state

    def save(self) -> dict[str, Any]:
        """Everything a run needs to go on exactly as it would have, as plain data that JSON carries without loss."""
        return {
            "parameters": asdict(self.parameters),
            "modes": dict(self.modes),
            "tolerance": self.tolerance,
            "time": self.time,
            "inputs": dict(self.inputs),
            "state": list(self.state),
            "commanded": sorted(self._commanded),
            "step_size": self._step_size,
            "scale": list(self._scale),
            "start_energy": self.start_energy,
        }

    @classmethod
    def restore(cls, saved: dict[str, Any]) -> Self:
        """The plant that `save` described.

        Raises
        ------
        StateError
            If something is missing from ``saved`` or of the wrong kind.
        """
        try:
            plant = cls.__new__(cls)
            plant.parameters = cls.PARAMETERS(**saved["parameters"])
            plant.modes = {mode.name: saved["modes"][mode.name] for mode in cls.MODES}
            plant.tolerance = saved["tolerance"]
            plant.time = saved["time"]
            # an input that is not finite may well be saved: it is told at the next step
            plant.inputs = {name: float(saved["inputs"][name]) for name in cls.INPUT_NAMES}
            plant.state = tuple(saved["state"])
            plant._commanded = set(saved["commanded"])
            plant._step_size = saved["step_size"]
            plant._scale = tuple(saved["scale"])
            plant.start_energy = saved["start_energy"]
            plant._p = plant.parameters.constants()
            check_tolerance(plant.tolerance)
            numbers = (plant.time, plant._step_size, plant.start_energy, *plant.state, *plant._scale)
            whole = (
                all(plant.modes[mode.name] in range(len(mode.values)) for mode in cls.MODES)
                and plant._commanded <= set(cls.COMMANDS)
                and len(plant._scale) == len(plant.state) == 6
                and min(plant._scale) > 0.0
                and all(isfinite(number) for number in numbers)
            )
        except (KeyError, TypeError, ValueError) as error:
            raise StateError(f"the saved state is not one of a {cls.KIND}: {error!r}") from error
        if not whole:
            raise StateError(f"the saved state is not one of a {cls.KIND}: a number in it is missing or not finite")
        return plant
