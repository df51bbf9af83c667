"""Vary parameters of a mechanism and its drive by FMI name, and differentiate the equations with respect to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name, fmi_name

from ...files import unknown_name
from ...mechanisms import Parameters, find_mechanism, variable_unit
from ...numerics import symbolic
from ...run import InductionMotor, parameter_symbols, takes_published
from ...units import RAD_S_PER_RPM
from .drive import Direction, Drive, force_inputs, require_acting, require_drive
from .flow import Flow, find_crank, find_cranks

#: A mechanism and its drive.
Operation = tuple[Parameters, Drive]
#: The operation at a point of a chart.
Plane = Callable[[float, float], Operation]


@cache
def _crank_inputs(mechanism: Mechanism) -> dict[str, tuple[str, int]]:
    """Return the kind (speed or torque) and the degree of freedom's index of each crank speed and crank torque, by FMI name."""
    found = {}
    for crank in find_cranks(mechanism):
        for what, n in (("torque", crank.torque), ("speed", crank.command)):
            if n is not None:
                found[mechanism.channels[n].name] = (what, crank.freedom)
    return found


@cache
def motor_parameters(mechanism: Mechanism) -> dict[str, tuple[str, str]]:
    """Return the field of `InductionMotor` and the unit for each motor parameter, by FMI name, ordered as in `Drive.vector`."""
    units = {"breakdown_torque": "N.m", "breakdown_slip": "1", "synchronous_speed": "rad/s"}
    torques = [mechanism.channels[n].name for n in mechanism.torques]
    return {f"{name}.{field}": (field, unit) for name in torques for field, unit in units.items()}


def driving_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the FMI names of the parameters of a drive: crank speeds, crank torques, parameters of motors, and forces."""
    return tuple(dict.fromkeys((*_crank_inputs(mechanism), *motor_parameters(mechanism), *force_inputs(mechanism))))


def speed_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the FMI names of the crank speeds that can be prescribed."""
    return tuple(name for name, (what, _) in _crank_inputs(mechanism).items() if what == "speed")


def speed_name(mechanism: Mechanism, drive: Drive | None = None) -> str | None:
    """Return the FMI name of the prescribed speed of the crank, such as ``drive.speed``; None if no speed can be prescribed.

    Raises
    ------
    InputError
        If the mechanism has several cranks, and no drive tells which crank is meant.
    """
    command = (find_crank(mechanism) if drive is None else drive.reference(mechanism)).command
    return None if command is None else mechanism.channels[command].name


def default_variable(mechanism: Mechanism, drive: Drive | None = None) -> str:
    """Return the FMI name of the parameter that varies if no name is given: the prescribed speed of the crank.

    Raises
    ------
    InputError
        If the speed cannot be prescribed; or if the mechanism has several cranks, and no drive tells which crank is meant.
    """
    name = speed_name(mechanism, drive)
    if name is None:
        raise InputError(f"the crank of a {mechanism.name} has no speed that can be prescribed: name what varies")
    return name


@takes_published()
def require_variable(parameters: Parameters, drive: Drive, name: str) -> None:
    """Check that the parameter ``name`` can vary in this drive.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If the parameter has no effect in this drive: a speed under a torque, a torque at prescribed speed, a motor parameter
        without a motor.
    """
    require_drive(drive)
    mechanism = find_mechanism(parameters)
    parameter_unit(mechanism, name)
    what, freedom = _crank_inputs(mechanism).get(name, ("", -1))
    if what == "speed" or freedom == drive.reference(mechanism).freedom:
        if (what == "speed") != drive.speed_drive:
            given = "speed" if drive.speed_drive else "torque"
            raise InputError(f"{name} cannot vary: the drive is by {given}; give {name} in its place")
        if what == "speed" and not _crank_ratio(mechanism, drive, freedom):
            raise InputError(f"{name} cannot vary: this crank is not commanded to turn")
    elif name in force_inputs(mechanism):
        require_acting(drive, mechanism, force_inputs(mechanism)[name])
    if name in motor_parameters(mechanism) and _find_motor(mechanism, drive, name) is None:
        raise InputError(f"{name} cannot vary: no motor drives the crank")


def _crank_ratio(mechanism: Mechanism, drive: Drive, freedom: int) -> float:
    """Return the turns of a commanded crank per turn of the drive's crank; 0 if the crank is held or not commanded."""
    if freedom == drive.reference(mechanism).freedom:
        return 1.0
    commanded = freedom in drive.flow(mechanism).commanded
    return float(drive.ratios_by_freedom(mechanism).get(freedom, 0)) if commanded else 0.0


def _find_motor(mechanism: Mechanism, drive: Drive, name: str) -> InductionMotor | None:
    """Return the motor to which a motor parameter, given by FMI name, belongs; None if there is no motor."""
    torque = name.rpartition(".")[0]
    own = drive.reference(mechanism).torque
    return drive.motor if own is not None and mechanism.channels[own].name == torque else drive.motors.get(torque)


def variable_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the FMI names of all parameters of a mechanism and its drive: see `driving_names`."""
    of_mechanism = [v.name for v in mechanism.mechanism_variables.values() if v.kind == "Real"]
    return (*driving_names(mechanism), *of_mechanism)


def parameter_unit(mechanism: Mechanism, name: str) -> str:
    """Return the unit of a parameter of a mechanism or its drive, by its FMI name.

    Raises
    ------
    UnknownNameError
        If there is no such parameter.
    """
    names = variable_names(mechanism)
    if name not in names:
        raise unknown_name(name, names)
    if name in motor_parameters(mechanism):
        return motor_parameters(mechanism)[name][1]
    return variable_unit(mechanism, name)


@takes_published()
def parameter_value(parameters: Parameters, drive: Drive, name: str) -> float:
    """Return the value of a parameter; NaN for a speed under a torque, or for a motor parameter if there is no motor."""
    mechanism = find_mechanism(parameters)
    what, freedom = _crank_inputs(mechanism).get(name, ("", -1))
    if what == "speed":
        return float("nan") if drive.speed is None else float(drive.speed) * _crank_ratio(mechanism, drive, freedom)
    if what == "torque" and freedom == drive.reference(mechanism).freedom:
        return float(drive.torque)
    if name in motor_parameters(mechanism):
        return float(getattr(_find_motor(mechanism, drive, name), motor_parameters(mechanism)[name][0], np.nan))
    if name in force_inputs(mechanism):
        return float(drive.forces.get(name, 0.0))
    return float(getattr(parameters, field_name(name)))


def format_value(name: str, value: float, unit: str) -> str:
    """Format a value with its name and unit; speeds are also given in rpm."""
    rpm = f" ({value / RAD_S_PER_RPM:.6g} rpm)" if unit == "rad/s" else ""
    return f"{name} = {value:.6g} {unit}".rstrip() + rpm


@lru_cache(maxsize=64)
def _replace_parameters(parameters: Parameters, *values: tuple[str, float]) -> Parameters:
    """Return parameters with new values, given as (FMI name, value).

    The result is cached, because all points in a row of a chart over the speed have the same values.
    """
    return replace(parameters, **dict(values))


@takes_published()
def with_values(parameters: Parameters, drive: Drive, values: Mapping[str, float]) -> Operation:
    """Return the mechanism and the drive with new values of parameters, which are given by FMI name."""
    mechanism = find_mechanism(parameters)
    of_cranks, of_motor, forces = _crank_inputs(mechanism), motor_parameters(mechanism), force_inputs(mechanism)
    own = drive.reference(mechanism).freedom
    of_drive: dict[str, Any] = {}
    acting: dict[str, float] = {}
    motors: dict[str, tuple[InductionMotor, dict[str, float]]] = {}
    of_mechanism: dict[str, float] = {}
    for name, value in values.items():
        what, freedom = of_cranks.get(name, ("", -1))
        if what == "speed":
            # all commanded speeds keep their ratios
            of_drive["speed"] = value / _crank_ratio(mechanism, drive, freedom)
        elif what == "torque" and freedom == own:
            of_drive["torque"] = value
        elif name in of_motor:
            motor = _find_motor(mechanism, drive, name)
            if motor is not None:
                motors.setdefault(name.rpartition(".")[0], (motor, {}))[1][of_motor[name][0]] = value
        elif name in forces:
            acting[name] = value
        else:
            of_mechanism[field_name(name)] = value
    if acting:
        of_drive["forces"] = {**drive.forces, **acting}
    for torque, (before, changes) in motors.items():
        motor = replace(before, **changes)
        if torque in drive.motors:
            of_drive["motors"] = {**of_drive.get("motors", drive.motors), torque: motor}
        else:
            of_drive["motor"] = motor
    if of_mechanism:
        parameters = _replace_parameters(parameters, *of_mechanism.items())
    return parameters, replace(drive, **of_drive) if of_drive else drive


@dataclass(frozen=True, slots=True)
class NamedPlane:
    """A plane of two parameters, given by FMI name: see `plane`."""

    parameters: Parameters
    drive: Drive
    x: str
    y: str

    def __call__(self, first: float, second: float) -> Operation:
        """Return the mechanism and drive at the values ``first`` of x and ``second`` of y."""
        return with_values(self.parameters, self.drive, {self.x: first, self.y: second})


@takes_published()
def plane(parameters: Parameters, drive: Drive, x: str, y: str) -> Plane:
    """Return a function that gives the mechanism and drive for values of two parameters, with all others fixed.

    Parameters
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    x, y : str
        Parameters of mechanism or drive by their names in the FMI contract, such as ``slider.damping``, ``drive.speed`` or
        ``slider.force``; in SI.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If the two parameters are the same or the speeds of two cranks, or if one of them has no effect in this drive.
    """
    if x == y:
        raise InputError(f"both axes are {x!r}: a chart needs two parameters")
    for name in (x, y):
        require_variable(parameters, drive, name)
    if {x, y} <= set(speed_names(find_mechanism(parameters))):
        raise InputError(f"{x} and {y} keep their ratio: only one of them can be an axis")
    return NamedPlane(parameters, drive, x, y)


#: Relative step of the finite difference that differentiates the constants with respect to the parameter. The constants are
#: smooth functions of it, most of them linear, and the derivative is used only in Newton's method.
_DIFFERENCE = 1e-6
#: What varies: a parameter by its FMI name, or a function from a number to a mechanism and drive.
Vary = str | Callable[[float], Operation]


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """A family of periodic motions: a mechanism and its drive as one parameter varies.

    Attributes
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    vary : str or callable
        What varies: FMI name of an input that has an effect, such as ``drive.speed``, ``drive.torque`` or ``slider.force``, or
        of a parameter, such as ``slider.damping``; or a function from a number to (parameters, Drive). By default the speed of
        the crank.
    name, unit : str
        Name and unit of the parameter for tables and plots; by default those of the FMI variable.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If the parameter has no effect in this drive.
    """

    parameters: Parameters
    drive: Drive
    vary: Vary = ""
    name: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        if callable(self.vary):
            object.__setattr__(self, "name", self.name or "parameter")
            return
        vary = self.vary or default_variable(find_mechanism(self.parameters), self.drive)
        object.__setattr__(self, "vary", vary)
        require_variable(self.parameters, self.drive, vary)
        object.__setattr__(self, "name", self.name or vary)
        object.__setattr__(self, "unit", self.unit or parameter_unit(find_mechanism(self.parameters), vary))

    def operation(self, value: float) -> Operation:
        """Return the mechanism and the drive at a value of the family's parameter."""
        if callable(self.vary):
            return self.vary(value)
        return with_values(self.parameters, self.drive, {self.vary: value})

    def with_ratios(self, ratios: Mapping[str, Any]) -> Family:
        """Return the family with new ratios: turns of the other cranks and of links per turn of the crank, see `Drive`."""
        if ratios == self.drive.ratios:
            return self
        found, vary = replace(self, drive=replace(self.drive, ratios=ratios)), self.vary
        if isinstance(vary, str):
            return found

        def varied(value: float) -> Operation:
            parameters, drive = vary(value)
            return parameters, replace(drive, ratios=ratios)

        return replace(found, vary=varied)

    def format_value(self, value: float) -> str:
        """Format a value of the family's parameter with its name and unit; speeds are also given in rpm."""
        return format_value(self.name, value, self.unit)

    def direction(self, value: float, low: float, high: float) -> Direction:
        """Return the derivatives of drive vector and constants with respect to the family's parameter at ``value``.

        They are computed by finite differences within the range from ``low`` to ``high``.
        """
        step = _DIFFERENCE * max(abs(value), 1e-3 * (high - low))
        a, b = max(value - step, low), min(value + step, high)
        mechanism = find_mechanism(self.parameters)
        (first, drive), (last, last_drive) = self.operation(a), self.operation(b)
        change = np.array(last.constants()) - np.array(first.constants())
        return Direction((last_drive.vector(mechanism) - drive.vector(mechanism)) / (b - a), change / (b - a))


FloatArray = NDArray[np.float64]


@takes_published()
def gradient_names(parameters: Parameters, drive: Drive) -> tuple[str, ...]:
    """Return the FMI names of the drive's and mechanism's parameters with respect to which motions are differentiated.

    A parameter is left out if it is zero and would switch on further equations, such as friction by contact forces. Functions
    that accept names also differentiate with respect to a parameter that is left out here.
    """
    mechanism, acting = find_mechanism(parameters), []
    for name in variable_names(mechanism):
        with suppress(InputError):
            require_variable(parameters, drive, name)
            acting.append(name)
    if mechanism.switch_index < 0 or mechanism.is_switched_on(parameters.constants()):
        return tuple(acting)
    effect = differentiate_constants(parameters, acting).p[mechanism.switch_index]
    return tuple(name for name, change in zip(acting, effect) if change == 0.0)


class ConstantDerivatives(NamedTuple):
    """Derivatives of the P constants of the equations with respect to m parameters."""

    p: FloatArray  # first derivatives, shape (P, m)
    p_along: FloatArray  # derivatives of ``p`` with respect to one further parameter, (P, m)


def differentiate_constants(parameters: Parameters, names: Sequence[str], along: str = "") -> ConstantDerivatives:
    """Compute the derivatives of the constants of the equations with respect to parameters; zero for parameters of the drive.

    ``names`` are FMI names; ``along`` is the FMI name of the further parameter for the second derivatives.
    """
    mechanism = find_mechanism(parameters)
    own = [float(getattr(parameters, field.name)) for field in fields(parameters)]
    known = {fmi_name(field.name): number for number, field in enumerate(fields(parameters))}
    direction = np.zeros(len(own))
    if along in known:
        direction[known[along]] = 1.0
    found = [np.asarray(part) for part in _constants(mechanism)(own, direction)]
    chosen = [np.zeros((len(found[0]), len(names))) for _ in found]
    for part, columns in zip(found, chosen):
        for column, name in enumerate(names):
            if name in known:
                columns[:, column] = part[:, known[name]]
    return ConstantDerivatives(*chosen)


def parameter_places(flow: Flow, drive: Drive, name: str) -> dict[int, float] | None:
    """Return the entries of `Drive.vector` that are multiples of a parameter: the factor of each, by the index of the entry.

    For a parameter of the mechanism the result is None.
    """
    mechanism = flow.mechanism
    places = (*mechanism.input_names, *motor_parameters(mechanism))
    what, freedom = _crank_inputs(mechanism).get(name, ("", -1))
    if what == "speed":
        own = _crank_ratio(mechanism, drive, freedom)
        channels = ({flow.crank: flow.command} | flow.commanded).items()
        return {c: _crank_ratio(mechanism, drive, number) / own for number, c in channels if c is not None}
    return {places.index(name): 1.0} if name in places else None


def stack_derivatives(drive: Drive, flow: Flow, names: Sequence[str], p: FloatArray) -> FloatArray:
    """Return the derivatives of the drive vector with respect to the m parameters ``names``, and below them ``p``.

    ``p`` are the derivatives of the constants. The shape is (size of the drive vector + constants, m).
    """
    found = np.zeros((flow.drive_size, p.shape[1]))
    for column, name in enumerate(names):
        for place, factor in (parameter_places(flow, drive, name) or {}).items():
            found[place, column] = factor
    return np.vstack([found, p])


@cache
def _constants(mechanism: Mechanism) -> Any:
    """Return a ``casadi.Function`` that differentiates the constants of the equations with respect to the parameters.

    The arguments are the parameters and a direction in their space. The values are the Jacobian of the constants with respect
    to the parameters, and the derivative of this Jacobian along the direction.
    """
    casadi = symbolic.library()
    traced = parameter_symbols(mechanism)
    k = casadi.vertcat(*traced.parameters.constants())
    direction = casadi.SX.sym("direction", *traced.own.shape)
    jacobian = casadi.jacobian(k, traced.own)
    along = casadi.reshape(casadi.jtimes(casadi.vec(jacobian), traced.own, direction), *jacobian.shape)
    return casadi.Function("constants", [traced.own, direction], [casadi.densify(jacobian), casadi.densify(along)])
