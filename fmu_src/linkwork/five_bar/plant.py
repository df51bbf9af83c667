"""The five-bar slider as a stateful object: the shell around the equations that the FMU holds."""

from __future__ import annotations

from collections.abc import Collection
from math import asin, degrees
from typing import ClassVar

from .. import plant
from ..errors import AssemblyError
from ..integrate import Vector
from ..limits import LIMIT_SINE, NEAR_LIMIT
from ..plant import MechanismPlant, Mode
from . import dynamics, kinematics
from .parameters import Constants, FiveBarParameters, InitialState, reach

TORQUE_DRIVE = 0
SPEED_DRIVE = 1

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
    least = LIMIT_SINE * p.l3 * p.l4
    if square >= least * least:
        return
    distance = reach(parameters, crank_angle, slider_position)
    low, high = abs(p.l3 - p.l4), p.l3 + p.l4
    where = configuration(crank_angle, slider_position)
    if square > 0.0:
        raise AssemblyError(
            f"limit of assembly at {where}: coupler and rocker are collinear to "
            f"{degrees(asin(square**0.5 / (p.l3 * p.l4))):.3f} deg"
        )
    raise AssemblyError(
        f"the links cannot be joined at {where}: crank pin and slider pin are {distance:.9g} m apart, "
        f"coupler and rocker span {low:.9g} m to {high:.9g} m"
    )


def configuration(crank_angle: float, slider_position: float) -> str:
    """A configuration in words."""
    return f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and slider position {slider_position:.9g} m"


def error_scale(parameters: FiveBarParameters, crank_speed: float) -> tuple[float, ...]:
    """Magnitudes of the state's components below which the integrator's error counts as absolute.

    ``crank_speed`` is the speed at the start (rad/s).
    """
    mass = parameters.coupler_mass + parameters.rocker_mass + parameters.slider_mass
    return plant.error_scale(parameters.crank_length, mass, parameters.crank_inertia, crank_speed)


class Plant(MechanismPlant):
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

    KIND = "five-bar slider"
    PARAMETERS = FiveBarParameters
    MODES = (Mode("drive.mode", ("torque", "speed")),)
    INPUT_NAMES: ClassVar[tuple[str, ...]] = INPUT_NAMES
    COMMANDS = ("drive.speed",)

    parameters: FiveBarParameters
    _p: Constants

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
        super().__init__(
            parameters, initial, modes={"drive.mode": drive_mode}, tolerance=tolerance, time=time, inputs=inputs
        )

    @property
    def drive_mode(self) -> int:
        """0 where the crank torque is given, 1 where the crank speed is."""
        return self.modes["drive.mode"]

    def _start(self, initial: InitialState) -> Vector:
        speed = self.inputs["drive.speed"] if self.drive_mode == SPEED_DRIVE else initial.crank_speed
        return (initial.crank_angle, initial.slider_position, float(speed), initial.slider_velocity, 0.0, 0.0)

    def _check_state(self, x: Vector) -> None:
        check_assembly(self.parameters, x[0], x[1])

    def _error_scale(self, x: Vector) -> Vector:
        return error_scale(self.parameters, x[2])

    def _energy(self, x: Vector) -> float:
        return dynamics.mechanical_energy(x, self._p)  # type: ignore[arg-type]

    def _inputs(self) -> dynamics.Inputs:
        i = self.inputs
        drive = float(self.drive_mode)
        torque, acceleration, force = i["drive.torque"], i["drive.acceleration"], i["slider.force"]
        return dynamics.applied(drive, 0.0, torque, acceleration, force, i["load.fx"], i["load.fy"], 0.0, self._p)

    def _jumped(self, x: Vector, inputs: dynamics.Inputs, commands: Collection[str]) -> Vector:
        if self.drive_mode == SPEED_DRIVE and commands:
            return dynamics.jump_speed(x, self.inputs["drive.speed"], self._p)  # type: ignore[arg-type]
        return x

    def _derivative(self, x: Vector, inputs: dynamics.Inputs) -> Vector:
        return dynamics.derivative(x, inputs, self._p)  # type: ignore[arg-type]

    def _outputs(self, x: Vector, inputs: dynamics.Inputs) -> dynamics.Outputs:
        return dynamics.outputs(x, inputs, self.start_energy, self._p)  # type: ignore[arg-type]

    def _near_limit(self, x: Vector) -> bool:
        square = kinematics.assembly_square(x[0], x[1], self._p)
        return bool(abs(square) ** 0.5 < NEAR_LIMIT * self._p.l3 * self._p.l4)

    def _where(self, x: Vector) -> str:
        return configuration(x[0], x[1])

    def _started_from(self, x: Vector) -> str:
        name = "drive.speed" if self.drive_mode == SPEED_DRIVE else "initial.crank_speed"
        return f"{name} is {x[2]:g} rad/s, initial.slider_velocity {x[3]:g} m/s, initial.slider_position {x[1]:g} m"
