"""The class `Plant`: a mechanism with its state and its inputs, as an FMU simulates it.

`Plant` handles inputs, steps, refused steps, jumps of commanded rates and saved states in the same way for every `Mechanism`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict
from math import isfinite, ulp
from typing import Any

from .errors import AssemblyError, InputError, IntegrationError, LinkworkError, ParameterError, StateError, StepError
from .integrate import UNDEFINED, Vector, integrate
from .limits import NEAR_LIMIT, NO_ACCELERATION
from .mechanism import Mechanism, Mode
from .parameters import field_name, fmi_name

#: Tightest and loosest tolerance that a run accepts.
TOLERANCE_RANGE = (1e-13, 1e-2)


def check_tolerance(tolerance: float) -> None:
    """Check that a tolerance of the integrator is within its range.

    Raises
    ------
    ParameterError
        If it is outside `TOLERANCE_RANGE`.
    """
    low, high = TOLERANCE_RANGE
    if not low <= tolerance <= high:
        raise ParameterError("solver.tolerance", tolerance, f"be between {low:g} and {high:g}")


def mode_requirement(mode: Mode) -> str:
    """Describe the values that a mode may have, as the end of the sentence "it must ..."."""
    words = [f"{number} ({word})" for number, word in enumerate(mode.values)]
    return f"be {', '.join(words[:-1])} or {words[-1]}"


def _make_parameters(mechanism: Mechanism, values: Mapping[str, Any]) -> Any:
    """Return the parameters of a mechanism from ``values`` by FMI name; raise ParameterError if one is not valid."""
    return mechanism.parameters(**{field_name(name): values[name] for name in mechanism.mechanism_variables})


class Plant:
    """A mechanism during a simulation: its state, its inputs, and `step`, which advances the state in time.

    Parameters
    ----------
    mechanism : Mechanism
    parameters, initial
        Parameters and initial state, of the mechanism's types. A rate commanded at the start replaces the rate in ``initial``.
    tolerance : float
        Bound of the local error of a step.
    time : float
        Time at the start (s).
    inputs : dict, optional
        Inputs in force at the start, by FMI name; inputs left out are zero.
    **modes : int
        Value of each of the mechanism's modes, ``drive_mode`` for the parameter ``drive.mode``; modes left out have
        their default.

    Raises
    ------
    ParameterError, AssemblyError, InputError
    """

    #: Evaluations of the derivatives in all steps since the plant was made or restored.
    evaluations = 0

    def __init__(
        self,
        mechanism: Mechanism,
        parameters: Any,
        initial: Any,
        *,
        tolerance: float = 1e-9,
        time: float = 0.0,
        inputs: dict[str, float] | None = None,
        **modes: int,
    ) -> None:
        self.mechanism = mechanism
        self.modes = {mode.name: mode.default for mode in mechanism.modes}
        for name, mode_value in modes.items():
            if fmi_name(name) not in self.modes:
                raise TypeError(f"a {mechanism.name} has no {name}")
            self.modes[fmi_name(name)] = mode_value
        for mode in mechanism.modes:
            if self.modes[mode.name] not in range(len(mode.values)):
                raise ParameterError(mode.name, self.modes[mode.name], mode_requirement(mode))
        check_tolerance(tolerance)
        if not isfinite(time):
            raise InputError(f"the time at the start is {time} s: it must be a finite number")
        self.parameters = parameters
        self.tolerance = tolerance
        self.time = time
        self.inputs: dict[str, float] = dict.fromkeys(mechanism.input_names, 0.0)
        self._commanded: set[str] = set()
        self._rates = self._rate_names()
        for name, value in (inputs or {}).items():
            self.set_input(name, value)
        self._check_inputs()
        self._derive()
        self.state: Vector = self._initial_state(initial)
        self._check_state(self.state)
        self._commanded.clear()
        self._step_size = 0.0
        self._scale = mechanism.error_scale(parameters, self.state)
        self.start_energy = mechanism.equations.energy(self.state, self._p)
        if not isfinite(self.start_energy):
            raise InputError(f"the energy at the start is not finite: {self._describe_start(self.state)}")

    @classmethod
    def from_values(
        cls, mechanism: Mechanism, values: Mapping[str, Any], *, tolerance: float | None = None, time: float = 0.0
    ) -> Plant:
        """Return the plant with the parameters, initial state, inputs and modes in ``values``, by FMI name.

        ``tolerance``, if given, is used instead of ``solver.tolerance`` in ``values``.

        Raises
        ------
        ParameterError, AssemblyError, InputError
        """
        return cls(
            mechanism,
            _make_parameters(mechanism, values),
            mechanism.initial(**{field: values[f"initial.{field}"] for field in mechanism.initial_variables}),
            tolerance=values["solver.tolerance"] if tolerance is None else tolerance,
            time=time,
            inputs={name: values[name] for name in mechanism.input_names},
            **{field_name(mode.name): values[mode.name] for mode in mechanism.modes},
        )

    def _derive(self) -> None:
        """Compute the constants that follow from parameters and modes."""
        self._p: Any = self.parameters.constants()
        self._modes = tuple(float(self.modes[mode.name]) for mode in self.mechanism.modes)
        self._commands = self.mechanism.commands(self.modes)

    def tune(self, values: Mapping[str, Any]) -> None:
        """Set all parameters, by FMI name, during a run.

        The start energy is shifted by the jump of the energy, so that the change does not count as work.

        Raises
        ------
        ParameterError
            If a parameter is not valid; nothing is changed then.
        """
        energy, parameters = self.mechanism.equations.energy, _make_parameters(self.mechanism, values)
        before = energy(self.state, self._p)
        self.parameters = parameters
        self._derive()
        self.start_energy += energy(self.state, self._p) - before

    def _rate_names(self) -> set[str]:
        """Return the names of the inputs that command a rate in any mode."""
        return {channel.name for channel in self.mechanism.channels if channel.kind == "command"}

    def _initial_state(self, initial: Any) -> Vector:
        """Return the state at the start, in which commanded rates replace the rates of ``initial``."""
        x = list(self.mechanism.state(initial))
        for number in self._commands:
            x[self._commanded_rate(number)] = float(self.inputs[self.mechanism.channels[number].name])
        return self._complete_start(tuple(x))

    def _commanded_rate(self, number: int) -> int:
        """Return the index in the state of the rate that a channel commands."""
        return len(self.mechanism.freedoms) + self.mechanism.channels[number].freedom

    def _applied_inputs(self) -> Any:
        """Return the inputs in force as the record i that the equations take."""
        return self.mechanism.equations.apply_inputs(self._modes, tuple(self.inputs.values()), self._p)

    def _complete_start(self, x: Vector) -> Vector:
        """Return the state ``x`` with its dependent components computed from the others."""
        complete: Vector = self.mechanism.equations.start(x, self._applied_inputs(), self._p)
        return complete

    def _check_state(self, x: Vector) -> None:
        self.mechanism.check_state(self._complete_start(x), self._applied_inputs(), self._p)

    def _jump_rates(self, x: Vector, applied: Any, commanded: Collection[str]) -> Vector:
        """Return the state after the rates have jumped to the values of the inputs named in ``commanded``."""
        names = self.mechanism.input_names
        if not any(names[number] in commanded for number in self._commands):
            return x
        u = list(self.inputs.values())
        for number in self._commands:
            # a commanded coordinate without a new command keeps its rate
            if names[number] not in commanded:
                u[number] = x[self._commanded_rate(number)]
        jumped: Vector = self.mechanism.equations.jump(x, applied, tuple(u), self._p)
        return jumped

    def _near_limit(self, x: Vector) -> bool:
        """Return whether a failure at ``x`` is due to the limit of assembly."""
        try:
            return abs(self.mechanism.equations.clearance(x, self._applied_inputs(), self._p)) < NEAR_LIMIT
        except UNDEFINED:
            return True

    def _describe_start(self, x: Vector) -> str:
        """Describe the initial state in words, each value by the name of the parameter or input that sets it."""
        units = {v.name: v.unit for v in self.mechanism.variables}
        source = {self._commanded_rate(number): self.mechanism.channels[number].name for number in self._commands}
        fields = [freedom.initial[part] for part in (0, 1) for freedom in self.mechanism.freedoms]
        names = [source.get(place, f"initial.{field}") for place, field in enumerate(fields)]
        return ", ".join(f"{name} is {value:g} {units[name]}" for name, value in zip(names, x))

    # Inputs and outputs

    def set_input(self, name: str, value: float) -> None:
        """Set an input by its FMI name, until the next call; `step` and `outputs` check the value, this method does not."""
        if name not in self.inputs:
            raise InputError(f"there is no input {name!r}: the inputs are {', '.join(self.inputs)}")
        self.inputs[name] = value
        if name in self._rates:
            self._commanded.add(name)

    def _check_inputs(self) -> None:
        for name, value in self.inputs.items():
            if not isfinite(value):
                raise InputError(f"input {name} is {value} at t = {self.time:.9g} s: it must be a finite number")

    def outputs(self) -> Any:
        """Return all real outputs at the present time under the inputs in force.

        Raises
        ------
        InputError
            If an input is not finite, or so large that an output is not finite, or if an output is not finite at zero inputs.
        """
        self._check_inputs()
        i = self._applied_inputs()
        x = self._jump_rates(self.state, i, self._commanded)
        result = self._compute_outputs(x, i)
        if result is None:
            at, idle = f"an output is not finite at t = {self.time:.9g} s", (0.0,) * len(self.inputs)
            still = self.mechanism.equations.apply_inputs(self._modes, idle, self._p)
            if self._compute_outputs(self.state, still) is None:
                raise InputError(f"{at}, {self.mechanism.describe_state(self.state)}: {NO_ACCELERATION}")
            largest = max(self.inputs, key=lambda name: abs(self.inputs[name]))
            raise InputError(f"{at}: input {largest} is {self.inputs[largest]:g}, too large")
        return result

    def _compute_outputs(self, x: Vector, applied: Any) -> Any:
        """Return the outputs at a state, or None if one of them is not finite."""
        try:
            result = self.mechanism.equations.outputs(x, applied, self.start_energy, self._p)
        except UNDEFINED:
            return None
        return result if all(map(isfinite, result)) else None

    # Steps

    @property
    def next_step(self) -> float:
        """Return the step size (s) that the solver will try first in the next interval; 0 before the first interval."""
        return self._step_size

    def step(self, time: float, step: float) -> None:
        """Advance from ``time`` by ``step`` seconds under the inputs in force.

        A step that fails leaves the plant unchanged.

        Raises
        ------
        StepError
            If ``step`` is not positive, or too short to change ``time``, or ``time`` is not the plant's time.
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
        if time + step == time:
            raise StepError(f"a step of {step:.9g} s at t = {time:.9g} s: it is lost in the rounding of the time")
        # allows for rounding in the master's sum of steps; so small that a repeated step of a microsecond is still refused
        slack = min(1e-6 * step, 1e-9) + 8.0 * ulp(max(abs(time), abs(self.time)))
        if abs(time - self.time) > slack:
            way = "backwards" if time < self.time else "over a gap"
            raise StepError(f"a step {way}: it starts at t = {time:.9g} s, but the state is at t = {self.time:.9g} s")
        self._check_inputs()
        i = self._applied_inputs()
        derivative, clearance, p = self.mechanism.equations.derivative, self.mechanism.equations.clearance, self._p
        # at the start every commanded rate jumps to its input, even if the input was not set again, as the contract says
        x = self._jump_rates(self.state, i, self.inputs)
        last = x

        def accept(y: Vector) -> None:
            nonlocal last
            self._check_state(y)
            last = y

        try:
            result = integrate(
                lambda y: derivative(y, i, p),
                x,
                step,
                tolerance=self.tolerance,
                scale=self._scale,
                step=self._step_size,
                reach=self.mechanism.reach,
                clearance=lambda y: clearance(y, i, p),
                accept=accept,
            )
        except LinkworkError as error:
            raise self._explain(error, time, last) from error
        except UNDEFINED as error:
            raise self._explain(IntegrationError(NO_ACCELERATION), time, last) from error
        self.state = result.x
        self.time = time + step
        self._step_size = result.step
        self.evaluations += result.evaluations
        self._commanded = set()

    def _explain(self, error: LinkworkError, time: float, last: Vector) -> LinkworkError:
        """Return the error of a step with the step's start time and, if the limit of assembly is the cause, this limit.

        ``last`` is the last accepted state of the step.
        """
        if isinstance(error, IntegrationError):
            if self._near_limit(last):
                limit = self.mechanism.describe_limit(last, self._applied_inputs(), self._p)
                return AssemblyError(
                    f"in the step from t = {time:.9g} s: {limit} near {self.mechanism.describe_state(last)}"
                )
            return IntegrationError(
                f"in the step from t = {time:.9g} s: {error}, at {self.mechanism.describe_state(last)}"
            )
        return type(error)(f"in the step from t = {time:.9g} s: {error}")

    # Saved state

    def save(self) -> dict[str, Any]:
        """Return the complete state of a run as plain data for JSON, from which the run resumes exactly."""
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
    def restore(cls, mechanism: Mechanism, saved: dict[str, Any]) -> Plant:
        """Return a plant in the state ``saved``, which `save` has returned.

        Raises
        ------
        StateError
            If something is missing from ``saved`` or of the wrong kind.
        """
        try:
            plant = cls.__new__(cls)
            plant.mechanism = mechanism
            plant.parameters = mechanism.parameters(**saved["parameters"])
            plant.modes = {mode.name: saved["modes"][mode.name] for mode in mechanism.modes}
            plant.tolerance = saved["tolerance"]
            plant.time = saved["time"]
            # an input that is not finite may well be saved: the next step reports it
            plant.inputs = {name: float(saved["inputs"][name]) for name in mechanism.input_names}
            plant.state = tuple(saved["state"])
            plant._commanded = set(saved["commanded"])
            plant._rates = plant._rate_names()
            plant._step_size = saved["step_size"]
            plant._scale = tuple(saved["scale"])
            plant.start_energy = saved["start_energy"]
            check_tolerance(plant.tolerance)
            numbers = (plant.time, plant._step_size, plant.start_energy, *plant.state, *plant._scale)
            whole = (
                all(plant.modes[mode.name] in range(len(mode.values)) for mode in mechanism.modes)
                and plant._commanded <= plant._rates
                and len(plant._scale) == len(plant.state) == mechanism.size
                and min(plant._scale) > 0.0
                and all(isfinite(number) for number in numbers)
            )
            if whole:
                plant._derive()
        except (KeyError, TypeError, ValueError) as error:
            raise StateError(f"the saved state is not one of a {mechanism.name}: {error!r}") from error
        if not whole:
            raise StateError(
                f"the saved state is not one of a {mechanism.name}: a number in it is missing or not finite"
            )
        return plant
