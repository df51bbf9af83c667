"""The generalised slider-crank as a stateful object: the shell around the equations that the FMU holds."""

from __future__ import annotations

from collections.abc import Collection
from math import asin, degrees, sqrt
from typing import ClassVar

from .. import plant
from ..errors import AssemblyError
from ..integrate import Vector
from ..limits import LIMIT_SINE, NEAR_LIMIT
from ..plant import MechanismPlant, Mode
from . import dynamics, kinematics
from .parameters import Constants, InitialState, SliderCrankParameters

TORQUE_DRIVE = 0
SPEED_DRIVE = 1

#: What makes the axial shift: a force on the crank, a commanded axial speed, or a groove in the shaft (eq 28).
FORCED_SHIFT = 0
COMMANDED_SHIFT = 1
GROOVE = 2

INPUT_NAMES = (
    "drive.torque",
    "drive.speed",
    "drive.acceleration",
    "axial.force",
    "axial.speed",
    "axial.acceleration",
    "slider.load",
)


def check_assembly(parameters: SliderCrankParameters, crank_angle: float, shift: float) -> None:
    """Make sure that the rod reaches the guide at a configuration, clear of the limit of assembly.

    Parameters
    ----------
    parameters : SliderCrankParameters
    crank_angle : float
        Crank angle theta1 (rad).
    shift : float
        Axial shift S1 (m).

    Raises
    ------
    AssemblyError
        With the configuration, and by how much the rod is too short or how near it is to perpendicular to the guide.
    """
    p = parameters.constants()
    square = kinematics.assembly_square(crank_angle, shift, p)
    least = LIMIT_SINE * p.a2
    if square >= least * least:
        return
    where = f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and shift {shift:.9g} m"
    if square >= 0.0:
        raise AssemblyError(
            f"limit of assembly at {where}: the rod is within {degrees(asin(sqrt(square) / p.a2)):.3f} deg of "
            f"perpendicular to the guide"
        )
    distance = sqrt(p.a2 * p.a2 - square)
    raise AssemblyError(
        f"the rod does not reach the guide at {where}: the crank pin is {distance:.9g} m from the guide, the rod is "
        f"{p.a2:.9g} m long, {distance - p.a2:.9g} m too short"
    )


def configuration(crank_angle: float, shift: float) -> str:
    """A configuration in words."""
    return f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and axial shift {shift:.9g} m"


def error_scale(parameters: SliderCrankParameters, crank_speed: float) -> tuple[float, ...]:
    """Magnitudes of the state's components below which the integrator's error counts as absolute.

    ``crank_speed`` is the speed at the start (rad/s).
    """
    mass = parameters.crank_mass + parameters.rod_mass + parameters.slider_mass
    return plant.error_scale(parameters.crank_length, mass, parameters.crank_inertia, crank_speed)


class Plant(MechanismPlant):
    """A generalised slider-crank in motion: state, inputs, and the step that takes it forward in time.

    Parameters
    ----------
    parameters : SliderCrankParameters
    initial : InitialState
        The commanded speeds at the start take the place of what it gives, and so does the groove.
    drive_mode : int
        0 where the crank torque is given, 1 where the crank speed is.
    axial_mode : int
        0 where the axial force is given, 1 where the axial speed is, 2 where a groove makes the shift.
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

    KIND = "slider-crank"
    PARAMETERS = SliderCrankParameters
    MODES = (Mode("drive.mode", ("torque", "speed")), Mode("axial.mode", ("force", "speed", "groove")))
    INPUT_NAMES: ClassVar[tuple[str, ...]] = INPUT_NAMES
    COMMANDS = ("drive.speed", "axial.speed")

    parameters: SliderCrankParameters
    _p: Constants

    def __init__(
        self,
        parameters: SliderCrankParameters,
        initial: InitialState,
        *,
        drive_mode: int = TORQUE_DRIVE,
        axial_mode: int = COMMANDED_SHIFT,
        tolerance: float = 1e-9,
        time: float = 0.0,
        inputs: dict[str, float] | None = None,
    ) -> None:
        modes = {"drive.mode": drive_mode, "axial.mode": axial_mode}
        super().__init__(parameters, initial, modes=modes, tolerance=tolerance, time=time, inputs=inputs)

    def _start(self, initial: InitialState) -> Vector:
        speed = self.inputs["drive.speed"] if self.modes["drive.mode"] == SPEED_DRIVE else initial.crank_speed
        shifting = self.inputs["axial.speed"] if self.modes["axial.mode"] == COMMANDED_SHIFT else initial.shift_velocity
        x = (initial.crank_angle, initial.shift_position, float(speed), float(shifting), 0.0, 0.0)
        return dynamics.grooved(x, float(self.modes["axial.mode"] == GROOVE), self._p)

    def _check_state(self, x: Vector) -> None:
        x = dynamics.grooved(x, float(self.modes["axial.mode"] == GROOVE), self._p)  # type: ignore[arg-type]
        check_assembly(self.parameters, x[0], x[1])

    def _error_scale(self, x: Vector) -> Vector:
        return error_scale(self.parameters, x[2])

    def _energy(self, x: Vector) -> float:
        return dynamics.mechanical_energy(x, self._p)  # type: ignore[arg-type]

    def _inputs(self) -> dynamics.Inputs:
        i = self.inputs
        return dynamics.applied(
            float(self.modes["drive.mode"]),
            float(self.modes["axial.mode"]),
            i["drive.torque"],
            i["drive.acceleration"],
            i["axial.force"],
            i["slider.load"],
            i["axial.speed"],
            i["axial.acceleration"],
            self._p,
        )

    def _jumped(self, x: Vector, inputs: dynamics.Inputs, commands: Collection[str]) -> Vector:
        if not (commands and (inputs.speed_drive or inputs.shift_drive)):
            return x
        # a freedom that is driven and not commanded anew goes on as it goes
        speed = self.inputs["drive.speed"] if "drive.speed" in commands else x[2]
        shifting = self.inputs["axial.speed"] if "axial.speed" in commands else x[3]
        return dynamics.jump(x, inputs, speed, shifting, self._p)  # type: ignore[arg-type]

    def _derivative(self, x: Vector, inputs: dynamics.Inputs) -> Vector:
        return dynamics.derivative(x, inputs, self._p)  # type: ignore[arg-type]

    def _outputs(self, x: Vector, inputs: dynamics.Inputs) -> dynamics.Outputs:
        return dynamics.outputs(x, inputs, self.start_energy, self._p)  # type: ignore[arg-type]

    def _near_limit(self, x: Vector) -> bool:
        square = kinematics.assembly_square(x[0], x[1], self._p)
        return bool(abs(square) ** 0.5 < NEAR_LIMIT * self._p.a2)

    def _where(self, x: Vector) -> str:
        return configuration(x[0], x[1])

    def _started_from(self, x: Vector) -> str:
        speed = "drive.speed" if self.modes["drive.mode"] == SPEED_DRIVE else "initial.crank_speed"
        given = ("initial.shift_velocity", "axial.speed", "groove.amplitude")[self.modes["axial.mode"]]
        return f"{speed} is {x[2]:g} rad/s, the axial velocity (of {given}) {x[3]:g} m/s, the shift {x[1]:g} m"
