"""What solver, co-simulation and files ask of a mechanism, and the mechanisms there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from linkwork.errors import InputError
from linkwork.five_bar import dynamics as five_bar_dynamics
from linkwork.five_bar import parameters as five_bar_parameters
from linkwork.five_bar import plant as five_bar_plant
from linkwork.five_bar import variables as five_bar_variables
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.plant import MechanismPlant
from linkwork.slider_crank import dynamics as slider_crank_dynamics
from linkwork.slider_crank import parameters as slider_crank_parameters
from linkwork.slider_crank import plant as slider_crank_plant
from linkwork.slider_crank import variables as slider_crank_variables
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.variables import Variable

Parameters = FiveBarParameters | SliderCrankParameters
InitialState = five_bar_parameters.InitialState | slider_crank_parameters.InitialState


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanism:
    """A mechanism with two freedoms, the crank angle and a second coordinate, as the analyses see it.

    Attributes
    ----------
    name : str
        In words, and as case files name it.
    fmu : str
        Name of its FMU.
    parameters, initial : type
        Of its parameters and of its state at the start.
    plant : type
        The stateful plant.
    dynamics : module
        Its equations.
    variables : module
        Its FMI interface.
    second : str
        Name of the second coordinate in the state at the start: ``<second>_position`` and ``<second>_velocity``.
    channel_of_input : mapping
        Number of the channel, among the values of `analysis.run.simulate.channels`, that goes to each input of the FMU.
    check_assembly : callable
        ``check_assembly(parameters, crank_angle, second coordinate)`` raises AssemblyError where the links cannot be joined.
    error_scale : callable
        ``error_scale(parameters, crank_speed)``: magnitudes of the state below which errors are absolute.
    where : callable
        ``where(crank_angle, second coordinate)``: a configuration in words.
    """

    name: str
    fmu: str
    parameters: type
    initial: type
    plant: type[MechanismPlant]
    dynamics: ModuleType
    variables: ModuleType
    second: str
    channel_of_input: Mapping[str, int]
    check_assembly: Callable[[Any, float, float], None]
    error_scale: Callable[[Any, float], tuple[float, ...]]
    where: Callable[[float, float], str]

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the real outputs, in the order of ``dynamics.Outputs``."""
        return self.variables.OUTPUT_NAMES  # type: ignore[no-any-return]

    @property
    def mechanism_variables(self) -> dict[str, Variable]:
        """Those variables that are fields of the parameters, by name."""
        modes = {mode.name for mode in self.plant.MODES} | {"solver.tolerance"}
        return {
            v.name: v for v in self.variables.PARAMETERS if not v.name.startswith("initial.") and v.name not in modes
        }

    @property
    def initial_variables(self) -> dict[str, Variable]:
        """The variables of the state at the start, by the name of the field."""
        prefix = "initial."
        return {v.name.removeprefix(prefix): v for v in self.variables.PARAMETERS if v.name.startswith(prefix)}

    def modes(self, speed_drive: bool, axial_mode: int) -> dict[str, int]:
        """The FMU's modes by name, for how the crank and the second coordinate are driven."""
        values = {"drive.mode": int(speed_drive), "axial.mode": axial_mode}
        return {mode.name: values[mode.name] for mode in self.plant.MODES}

    def state(self, initial: Any) -> tuple[float, float, float, float]:
        """Crank angle, second coordinate and their rates of a state at the start."""
        second, rate = (getattr(initial, f"{self.second}_{what}") for what in ("position", "velocity"))
        return (initial.crank_angle, second, initial.crank_speed, rate)


FIVE_BAR = Mechanism(
    name="five-bar",
    fmu="FiveBarSlider",
    parameters=FiveBarParameters,
    initial=five_bar_parameters.InitialState,
    plant=five_bar_plant.Plant,
    dynamics=five_bar_dynamics,
    variables=five_bar_variables,
    second="slider",
    channel_of_input={name: number for number, name in enumerate(five_bar_plant.INPUT_NAMES)},
    check_assembly=five_bar_plant.check_assembly,
    error_scale=five_bar_plant.error_scale,
    where=five_bar_plant.configuration,
)

SLIDER_CRANK = Mechanism(
    name="slider-crank",
    fmu="SliderCrank",
    parameters=SliderCrankParameters,
    initial=slider_crank_parameters.InitialState,
    plant=slider_crank_plant.Plant,
    dynamics=slider_crank_dynamics,
    variables=slider_crank_variables,
    second="shift",
    channel_of_input={
        "drive.torque": 0,
        "drive.speed": 1,
        "drive.acceleration": 2,
        "axial.force": 3,
        "axial.speed": 5,
        "axial.acceleration": 6,
        "slider.load": 4,
    },
    check_assembly=slider_crank_plant.check_assembly,
    error_scale=slider_crank_plant.error_scale,
    where=slider_crank_plant.configuration,
)

#: By name.
MECHANISMS = {mechanism.name: mechanism for mechanism in (FIVE_BAR, SLIDER_CRANK)}

#: Unit of every real output of every mechanism; outputs of one name have one unit (a test holds them to it).
OUTPUT_UNITS = {
    v.name: v.unit for mechanism in MECHANISMS.values() for v in mechanism.variables.OUTPUTS if v.kind == "Real"
}


def mechanism_of(parameters: Any) -> Mechanism:
    """The mechanism that parameters belong to.

    Raises
    ------
    InputError
        If they are those of none.
    """
    for mechanism in MECHANISMS.values():
        if isinstance(parameters, mechanism.parameters):
            return mechanism
    kinds = ", ".join(mechanism.parameters.__name__ for mechanism in MECHANISMS.values())
    raise InputError(f"parameters are {type(parameters).__name__}: they must be one of {kinds}")


def require_five_bar(parameters: Any, what: str) -> None:
    """Make sure that parameters are those of a five-bar, for an analysis that is of five-bars alone.

    Raises
    ------
    InputError
        If they are not, with ``what`` the analysis is.
    """
    if not isinstance(parameters, FIVE_BAR.parameters):
        raise InputError(
            f"{what} is of five-bars: the parameters are {type(parameters).__name__}, not FiveBarParameters"
        )
