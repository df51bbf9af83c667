"""The five-bar slider as a stateful object: the shell around the equations that the FMU holds."""

from __future__ import annotations

from dataclasses import asdict
from math import asin, degrees, isfinite, ulp
from typing import Any

from ..errors import AssemblyError, InputError, IntegrationError, LinkworkError, ParameterError, StateError, StepError
from ..integrate import UNDEFINED, integrate
from . import dynamics, kinematics
from .parameters import Constants, FiveBarParameters, InitialState, reach

TORQUE_DRIVE = 0
SPEED_DRIVE = 1

#: Loosest and tightest tolerance that a run accepts.
TOLERANCE_RANGE = (1e-13, 1e-2)

INPUT_NAMES = ("drive.torque", "drive.speed", "drive.acceleration", "slider.force", "load.fx", "load.fy")


def check_assembly(parameters: FiveBarParameters, crank_angle: float, slider_position: float) -> None:
    """Make sure that the links can be joined at a configuration, clear of the limit of assembly.

    Raises
    ------
    AssemblyError
        With the configuration, the distance from crank pin to slider pin, and the range it would have to be in.
    """
    p = parameters.constants()
    square = kinematics.assembly_square(crank_angle, slider_position, p)
    least = kinematics.LIMIT_SINE * p.l3 * p.l4
    if square >= least * least:
        return
    distance = reach(parameters, crank_angle, slider_position)
    low, high = abs(p.l3 - p.l4), p.l3 + p.l4
    where = f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and slider position {slider_position:.9g} m"
    if square > 0.0:
        raise AssemblyError(
            f"limit of assembly at {where}: coupler and rocker are collinear to "
            f"{degrees(asin(square**0.5 / (p.l3 * p.l4))):.3f} deg"
        )
    raise AssemblyError(
        f"the links cannot be joined at {where}: crank pin and slider pin are {distance:.9g} m apart, "
        f"coupler and rocker span {low:.9g} m to {high:.9g} m"
    )


def error_scale(parameters: FiveBarParameters, crank_speed: float) -> tuple[float, ...]:
    """Magnitudes of the state's components below which the integrator's error counts as absolute.

    ``crank_speed`` is the speed at the start (rad/s).
    """
    length = parameters.crank_length
    mass = parameters.coupler_mass + parameters.rocker_mass + parameters.slider_mass
    speed = max(1.0, abs(crank_speed))
    energy = 0.5 * (parameters.crank_inertia + mass * length * length) * speed * speed
    return (1.0, length, speed, length * speed, energy, energy)


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


class Plant:
    """A five-bar slider in motion: state, inputs, and the step that takes it forward in time.

    Parameters
    ----------
    parameters : FiveBarParameters
    initial : InitialState
        In speed drive the ``speed`` at the start takes the place of ``initial.crank_speed``.
    drive_mode : int
        0 where the crank torque is given, 1 where the crank speed is.
    tolerance : float
        Bound of the local error of a step.
    time : float
        Time at the start (s).
    inputs : dict
        Inputs in force at the start, by FMI name; those left out are zero.

    Raises
    ------
    ParameterError, AssemblyError, InputError
    """

    def __init__(
        self,
        parameters: FiveBarParameters,
        initial: InitialState,
        *,
        drive_mode: int = TORQUE_DRIVE,
        tolerance: float = 1e-9,
        time: float = 0.0,
        inputs: dict[str, float] | None = None,
    ) -> None:
        if drive_mode not in (TORQUE_DRIVE, SPEED_DRIVE):
            raise ParameterError("drive.mode", drive_mode, "be 0 (torque) or 1 (speed)")
        check_tolerance(tolerance)
        if not isfinite(time):
            raise InputError(f"the time at the start is {time} s: it must be a finite number")
        check_assembly(parameters, initial.crank_angle, initial.slider_position)
        self.parameters = parameters
        self.drive_mode = drive_mode
        self.tolerance = tolerance
        self.time = time
        self.inputs: dict[str, float] = dict.fromkeys(INPUT_NAMES, 0.0)
        for name, value in (inputs or {}).items():
            self.set_input(name, value)
        self._check_inputs()
        self._p: Constants = parameters.constants()
        speed = self.inputs["drive.speed"] if drive_mode == SPEED_DRIVE else initial.crank_speed
        self.state: dynamics.State = (
            float(initial.crank_angle),
            float(initial.slider_position),
            float(speed),
            float(initial.slider_velocity),
            0.0,
            0.0,
        )
        self._speed_commanded = False
        self._step_size = 0.0
        self._scale = error_scale(parameters, speed)
        self.start_energy = dynamics.mechanical_energy(self.state, self._p)
        if not isfinite(self.start_energy):
            name = "drive.speed" if drive_mode == SPEED_DRIVE else "initial.crank_speed"
            raise InputError(
                f"the energy at the start is not finite: {name} is {speed:g} rad/s, initial.slider_velocity "
                f"{initial.slider_velocity:g} m/s, initial.slider_position {initial.slider_position:g} m"
            )

    def set_input(self, name: str, value: float) -> None:
        """Set an input by its FMI name; it holds until it is set again. Checked at the next step, not here."""
        if name not in self.inputs:
            raise InputError(f"there is no input {name!r}: the inputs are {', '.join(INPUT_NAMES)}")
        self.inputs[name] = value
        if name == "drive.speed":
            self._speed_commanded = True

    def _check_inputs(self) -> None:
        for name, value in self.inputs.items():
            if not isfinite(value):
                raise InputError(f"input {name} is {value} at t = {self.time:.9g} s: it must be a finite number")

    def _inputs(self) -> dynamics.Inputs:
        i = self.inputs
        if self.drive_mode == SPEED_DRIVE:
            return dynamics.Inputs(1.0, 0.0, i["drive.acceleration"], i["slider.force"], i["load.fx"], i["load.fy"])
        return dynamics.Inputs(0.0, i["drive.torque"], 0.0, i["slider.force"], i["load.fx"], i["load.fy"])

    def _current(self) -> dynamics.State:
        """The state with a newly commanded speed applied."""
        if self.drive_mode == SPEED_DRIVE and self._speed_commanded:
            return dynamics.jump_speed(self.state, self.inputs["drive.speed"], self._p)
        return self.state

    def outputs(self) -> dynamics.Outputs:
        """All real outputs at the present time under the inputs in force.

        Raises
        ------
        InputError
            If an input is not finite, or so large that an output is not.
        """
        self._check_inputs()
        result = dynamics.outputs(self._current(), self._inputs(), self.start_energy, self._p)
        if not all(map(isfinite, result)):
            largest = max(self.inputs, key=lambda name: abs(self.inputs[name]))
            raise InputError(
                f"an output is not finite at t = {self.time:.9g} s: input {largest} is {self.inputs[largest]:g}, too large"
            )
        return result

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
        p = self._p
        x = self._current()
        if self.drive_mode == SPEED_DRIVE and not self._speed_commanded:
            # the commanded speed was not set again: the step starts from it all the same, as the contract says
            x = dynamics.jump_speed(x, self.inputs["drive.speed"], p)
        last = x

        def accept(y: tuple[float, ...]) -> None:
            nonlocal last
            check_assembly(self.parameters, y[0], y[1])
            last = y  # type: ignore[assignment]

        try:
            result = integrate(
                lambda y: dynamics.derivative(y, i, p),  # type: ignore[arg-type]
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
        self.state = result.x  # type: ignore[assignment]
        self.time = time + step
        self._step_size = result.step
        self._speed_commanded = False

    def _explain(self, error: LinkworkError, time: float, last: dynamics.State) -> LinkworkError:
        """The error with the time of the step and, where the cause is the limit of assembly, with that said."""
        if isinstance(error, IntegrationError):
            p = self._p
            square = kinematics.assembly_square(last[0], last[1], p)
            near = abs(square) ** 0.5 / (p.l3 * p.l4)
            if near < 0.05:
                return AssemblyError(
                    f"in the step from t = {time:.9g} s: limit of assembly near crank angle {last[0]:.9g} rad "
                    f"({degrees(last[0]):.4f} deg) and slider position {last[1]:.9g} m"
                )
            return IntegrationError(
                f"in the step from t = {time:.9g} s: {error}, at crank angle {last[0]:.9g} rad and slider position "
                f"{last[1]:.9g} m"
            )
        return type(error)(f"in the step from t = {time:.9g} s: {error}")

    def save(self) -> dict[str, Any]:
        """Everything a run needs to go on exactly as it would have, as plain data that JSON carries without loss."""
        return {
            "parameters": asdict(self.parameters),
            "drive_mode": self.drive_mode,
            "tolerance": self.tolerance,
            "time": self.time,
            "inputs": dict(self.inputs),
            "state": list(self.state),
            "speed_commanded": self._speed_commanded,
            "step_size": self._step_size,
            "scale": list(self._scale),
            "start_energy": self.start_energy,
        }

    @classmethod
    def restore(cls, saved: dict[str, Any]) -> Plant:
        """The plant that `save` described.

        Raises
        ------
        StateError
            If something is missing from ``saved`` or of the wrong kind.
        """
        try:
            plant = cls.__new__(cls)
            plant.parameters = FiveBarParameters(**saved["parameters"])
            plant.drive_mode = saved["drive_mode"]
            plant.tolerance = saved["tolerance"]
            plant.time = saved["time"]
            # an input that is not finite may well be saved: it is told at the next step
            plant.inputs = {name: float(saved["inputs"][name]) for name in INPUT_NAMES}
            th2, u, w2, v, dissipated, supplied = saved["state"]
            plant.state = (th2, u, w2, v, dissipated, supplied)
            plant._speed_commanded = saved["speed_commanded"]
            plant._step_size = saved["step_size"]
            plant._scale = tuple(saved["scale"])
            plant.start_energy = saved["start_energy"]
            plant._p = plant.parameters.constants()
            check_tolerance(plant.tolerance)
            numbers = (plant.time, plant._step_size, plant.start_energy, *plant.state, *plant._scale)
            whole = (
                plant.drive_mode in (TORQUE_DRIVE, SPEED_DRIVE)
                and isinstance(plant._speed_commanded, bool)
                and len(plant._scale) == len(plant.state)
                and min(plant._scale) > 0.0
                and all(isfinite(number) for number in numbers)
            )
        except (KeyError, TypeError, ValueError) as error:
            raise StateError(f"the saved state is not one of a five-bar slider: {error!r}") from error
        if not whole:
            raise StateError("the saved state is not one of a five-bar slider: a number in it is missing or not finite")
        return plant
