"""Define wishes: requirements on a range of speeds, and the parameters that may be changed to meet them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError
from linkwork.mechanism import Mechanism, PublishedSet
from linkwork.parameters import field_name

from .. import periodic
from ..files import Quantity, Range, check_names, unknown_name
from ..mechanisms import Parameters, find_mechanism
from ..periodic import Drive, driving_names, parameter_unit, parameter_value, require_variable, with_values
from ..run import published_set
from ..units import RAD_S_PER_RPM, Amount, display_text, pair, quantity, si

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A parameter of the mechanism, or a quantity of its drive, that may be changed.

    Attributes
    ----------
    name : str
        FMI name, such as ``slider.stiffness``, ``slider.force`` or ``drive.torque.breakdown_torque``.
    low, high : float
        Bounds of the value (SI).
    tolerance : float
        Unit in which the change is measured (SI).
    given : str or float
        The tolerance as the user wrote it, if the bounds follow from it; otherwise empty.
    """

    name: str
    low: float
    high: float
    tolerance: float
    given: Amount = ""

    def __post_init__(self) -> None:
        if not (isfinite(self.low) and isfinite(self.high) and self.low < self.high):
            raise ParameterError(f"change.{self.name}", [self.low, self.high], "be a range: [least, greatest]")
        if not (isfinite(self.tolerance) and self.tolerance > 0.0):
            raise ParameterError(f"change.{self.name}", self.tolerance, "have a tolerance above zero")


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Upper bound of the magnitude of an output over the period of a motion.

    Attributes
    ----------
    output : str
        An output of the plant, such as ``drive.applied_torque``; a joint, such as ``pin.C`` or ``A`` of a user's own linkage,
        for the magnitude of the force in it; or ``amplitude of`` an output, for half its range.
    below : float or str
        The bound: a number in SI, or a text with a unit, which `Wish` converts to SI.
    unit : str
        Unit of the bound; `Wish` fills in unit and parts.
    parts : tuple of str
        The output, or the components of the force in the joint.
    """

    output: str
    below: Amount
    unit: str = field(init=False, default="")
    parts: tuple[str, ...] = field(init=False, default=())

    def __str__(self) -> str:
        return self.output if self.output.startswith(AMPLITUDE) else f"greatest {self.output}"


#: Beginning of `Limit.output` if half the range of an output is limited.
AMPLITUDE = "amplitude of "


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wish:
    """Requirements on a range of speeds, or of another drive quantity, and the parameters that may be changed.

    Attributes
    ----------
    parameters : parameters of a mechanism
        Present parameters; or a published set or its name.
    change : mapping or sequence of Change
        Parameters that may be changed, by FMI name or by field, and acting drive quantities such as a force on the slider, a
        torque on the crank, or a motor's data. Each has a tolerance, such as "5 %" or "10 N/m", which is the greatest change
        in either direction and the unit in which the change is measured; or a range (least, greatest), half of whose width is
        this unit; or both, as a mapping with ``tolerance`` and ``between``.
    speeds : (float, float), optional
        Range of the crank's prescribed speed: rad/s, or texts such as "900 rpm".
    over : str
        FMI name of another drive quantity whose range is tuned, such as ``drive.torque`` or ``slider.force``, of a motor's
        parameter, such as ``drive.torque.synchronous_speed``, or of a constant of a spring's force law, such as ``motor.w``.
    between : (float, float), optional
        Range of the quantity ``over``: numbers in SI, or texts with units.
    drive : Drive, optional
        All that drives the mechanism; needed if ``speeds`` are not given.
    start : array_like, optional
        Guess of the motion at the low end of the range, as for `find_orbit`: needed under a torque without a motor.
    turns : int
        Greatest number of turns of the crank in a period that is examined.
    no_resonance : bool
        No maximum of an amplitude of a motion of one turn lies in the range, or within ``resonance_margin`` of it.
    resonance_margin : float
        Distance of a resonance from either end of the range, as a share of the value at that end; 0.02 by default.
    no_jump : bool
        No fold lies in the range, and there is no second stable motion anywhere in the range.
    no_unstable : bool
        No unstable motion lies in the range. If ``no_unstable`` is False, unstable motions may lie beside stable ones, but
        everywhere in the range there must be a stable motion.
    least_margin : float
        The largest Floquet multiplier is at most 1 - ``least_margin``.
    limits : sequence of Limit
    least : str
        Parameter to be minimised; by default the sum of the squares of the changes, each divided by its tolerance.

    Raises
    ------
    InputError, ParameterError
        If an argument is not usable.
    """

    parameters: Parameters
    change: Any
    speeds: tuple[Amount, Amount] | None = None
    over: str = ""
    between: tuple[Amount, Amount] | None = None
    drive: Drive | None = None
    start: Any = None
    turns: int = 1
    no_resonance: bool = False
    resonance_margin: float = 0.02
    no_jump: bool = False
    no_unstable: bool = False
    least_margin: float = 0.0
    limits: Sequence[Limit] = ()
    least: str = ""

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        given: Any = self.parameters
        if isinstance(given, (str, PublishedSet)):
            put("parameters", published_set(given).parameters)
        mechanism = self.mechanism
        put("over", self._check_range())
        put("between", _span(mechanism, self.over, self.between if self.speeds is None else self.speeds))
        drive = self.drive or periodic.steady_drive(given, speed=self.span[0])
        require_variable(self.parameters, drive, self.over)
        require_free(mechanism, drive)
        alone = (
            not drive.speed_drive
            and drive.motor is None
            and self.over in driving_names(mechanism)
            and parameter_value(self.parameters, drive, self.over) == drive.torque
        )
        if alone and self.span[0] <= 0.0 <= self.span[1]:
            raise ParameterError(self.over, list(self.span), "not contain zero: nothing would drive the crank there")
        put("drive", with_values(self.parameters, drive, {self.over: self.span[0]})[1])
        if not (isinstance(self.turns, int) and self.turns >= 1):
            raise ParameterError("turns", self.turns, "be a whole number, at least one")
        put("change", _changes((self.parameters, drive), self.over, self.change))
        put("limits", tuple(_check_limit(mechanism, limit) for limit in self.limits))
        for name in ("least_margin", "resonance_margin"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ParameterError(name, getattr(self, name), "be at least zero and less than one")
        if not (self.no_resonance or self.no_jump or self.judges_stability or self.limits):
            raise InputError(
                "there is no requirement: give no_resonance, no_jump, no_unstable, least_margin or a limit of an output"
            )
        if self.least:
            put("least", _find_changeable_name(mechanism, self.least))
            if self.least not in self.names:
                raise InputError(f"{self.least} is to be minimised, but may not be changed: name it in change")
        self._check_bounds()

    def _check_bounds(self) -> None:
        """Raise ParameterError if the mechanism or the drive does not allow the bounds of a parameter that may be changed."""
        assert self.drive is not None
        for change in self.change:
            for value in (change.low, change.high):
                try:
                    with_values(self.parameters, self.drive, {change.name: value})
                except ParameterError as error:
                    if not change.given:
                        raise
                    unit = parameter_unit(self.mechanism, change.name)
                    raise ParameterError(
                        f"change.{change.name}",
                        change.given,
                        f"be a smaller tolerance or a range [least, greatest]: it allows {value:.6g} {unit}, and "
                        f"{error.name} must {error.requirement}",
                    ) from None
        for x in (self.scale_changes(self.low), self.scale_changes(self.high)):
            self.operation(x, self.span[0])

    def _check_range(self) -> str:
        """Check the arguments about the range; return the FMI name of the quantity whose range is tuned."""
        speed = periodic.speed_name(self.mechanism, self.drive)
        if (self.speeds is None) == (self.between is None) or (self.between is None) == bool(self.over):
            raise InputError("give the range: speeds of the crank, or over (a drive quantity) and between (its values)")
        driven = self.drive is not None and not self.drive.speed_drive
        if self.between is None and (speed is None or driven):
            why = "its speed cannot be prescribed"
            if driven:
                why = "the drive is by torque, so that the speed follows from it"
            names = ", ".join([name for name in driving_names(self.mechanism) if name != speed][:5])
            raise InputError(
                f"the crank has no range of speeds: {why}; give over and between instead, over one of {names}, ..."
            )
        known = (*driving_names(self.mechanism), *self.mechanism.names("law"))
        if self.over and self.over not in known:
            raise unknown_name(self.over, known)
        if self.between is not None and self.drive is None and self.over != speed:
            raise InputError(f"the range is of {self.over}: give the drive of the crank, drive=Drive(...)")
        return self.over or str(speed)

    @property
    def span(self) -> tuple[float, float]:
        """The ends of the range, in SI."""
        low, high = self.between or (0.0, 0.0)
        return float(low), float(high)

    def level(self, orbit: periodic.PeriodicOrbit) -> float:
        """Return the level of a motion: the value that the quantity ``over`` has in this motion."""
        return parameter_value(orbit.parameters, orbit.drive, self.over)

    def say(self, *levels: float, joint: str = ", ") -> str:
        """Format levels as a text with their unit, speeds in rpm; ``joint`` stands between two levels."""
        unit = parameter_unit(self.mechanism, self.over)
        factor, unit = (RAD_S_PER_RPM, "rpm") if unit == "rad/s" else (1.0, unit)
        return f"{joint.join(f'{level / factor:.6g}' for level in levels)} {unit}"

    @property
    def mechanism(self) -> Mechanism:
        """Mechanism of the parameters."""
        return find_mechanism(self.parameters)

    @property
    def judges_stability(self) -> bool:
        """Whether the stability of all motions is part of the wish."""
        return self.no_unstable or self.least_margin > 0.0

    @property
    def radius(self) -> float:
        """Upper bound of the modulus of the largest multiplier."""
        return 1.0 - self.least_margin

    @property
    def range_with_margin(self) -> tuple[float, float]:
        """The ends of the range widened by the margin for resonances, in SI."""
        (low, high), margin = self.span, self.resonance_margin
        return low - margin * abs(low), high + margin * abs(high)

    @property
    def size(self) -> float:
        """Middle of the range (SI), the reference of relative distances."""
        low, high = self.span
        return 0.5 * (abs(low) + abs(high))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that may be changed."""
        return tuple(change.name for change in self.change)

    @property
    def present(self) -> FloatArray:
        """Present values of the parameters that may be changed, shape (k,)."""
        assert self.drive is not None
        return np.array([parameter_value(self.parameters, self.drive, name) for name in self.names])

    @property
    def low(self) -> FloatArray:
        """Lower bounds of the parameters that may be changed, shape (k,)."""
        return np.array([change.low for change in self.change])

    @property
    def high(self) -> FloatArray:
        """Upper bounds of the parameters that may be changed, shape (k,)."""
        return np.array([change.high for change in self.change])

    @property
    def tolerance(self) -> FloatArray:
        """Tolerances of the changes, shape (k,)."""
        return np.array([change.tolerance for change in self.change])

    def scale_changes(self, values: FloatArray) -> FloatArray:
        """Convert values of the parameters to changes from the present values, in units of the tolerances."""
        return (values - self.present) / self.tolerance

    def operation(self, x: FloatArray, level: float) -> periodic.Operation:
        """Return parameters and drive with changes x in units of the tolerances, at a level of the range."""
        assert self.drive is not None
        values = np.clip(self.present + x * self.tolerance, self.low, self.high).tolist()
        return with_values(self.parameters, self.drive, {**dict(zip(self.names, values)), self.over: level})


def require_free(mechanism: Mechanism, drive: Drive) -> None:
    """Raise InputError if no degree of freedom is free, because the whole motion is then prescribed."""
    try:
        drive.flow(mechanism)
    except periodic.NothingFreeError as error:
        free = error.force and f", or free a freedom by a force, such as {error.force} = 0"
        raise InputError(
            f"the speed prescribes the whole motion of a {mechanism.name}, so that nothing can vibrate, but tuning needs a "
            "freedom that is not prescribed. Peaks of outputs can be found by runs: vary the parameters by simulate_many with "
            "vary, or by linkwork run --set; or drive the crank by a torque or a motor, with over and between instead of "
            f"speeds{free}"
        ) from None


def _span(mechanism: Mechanism, over: str, given: Any) -> tuple[float, float]:
    name, unit = "speeds" if over in periodic.speed_names(mechanism) else over, parameter_unit(mechanism, over)
    low, high = pair(given, unit, name)
    shown = [display_text(end, unit) for end in (low, high)]
    if not low < high:
        raise ParameterError(name, shown, "be a range: [least, greatest]")
    if name == "speeds" and not low > 0.0:
        raise ParameterError(name, shown, "be a range above zero: [least, greatest]")
    return low, high


def _find_changeable_name(mechanism: Mechanism, name: str) -> str:
    """Return the FMI name of a parameter or drive quantity, given by its FMI name or its field."""
    known = {field_name(n): n for n in periodic.variable_names(mechanism)}
    found = known.get(field_name(name))
    if found is None:
        raise unknown_name(name, known.values())
    return found


def _changes(operation: periodic.Operation, over: str, given: Any) -> tuple[Change, ...]:
    if not isinstance(given, Mapping):
        changes = tuple(given)
    else:
        flat = _flatten_names(given, find_mechanism(operation[0]))
        changes = tuple(_change(operation, name, value) for name, value in flat.items())
    if not changes:
        raise InputError("nothing may be changed: name at least one parameter in change")
    for change in changes:
        require_variable(*operation, change.name)
        if change.name == over:
            raise ParameterError(
                f"change.{over}", over, "not be changed, because it is the quantity whose range is given"
            )
    return changes


def _flatten_names(given: Mapping[str, Any], mechanism: Mechanism, prefix: str = "") -> dict[str, Any]:
    """Flatten a mapping of parameters, with nested tables or dotted names, into a mapping by FMI name."""
    parts = [name.split(".") for name in periodic.variable_names(mechanism)]
    groups = {".".join(part[:n]) for part in parts for n in range(1, len(part))}
    found: dict[str, Any] = {}
    for name, value in given.items():
        if prefix + name in groups and isinstance(value, Mapping) and not {"tolerance", "between"} & set(value):
            found |= _flatten_names(value, mechanism, f"{prefix}{name}.")
        else:
            found[_find_changeable_name(mechanism, prefix + name)] = value
    return found


def _change(operation: periodic.Operation, name: str, value: Any) -> Change:
    require_variable(*operation, name)
    unit = parameter_unit(find_mechanism(operation[0]), name)
    now, what = parameter_value(*operation, name), f"change.{name}"
    given: Mapping[str, Any]
    if isinstance(value, Mapping):
        check_names(value, what, ("tolerance", "between"))
        given = value
    else:
        given = {"between": value} if isinstance(value, (list, tuple)) else {"tolerance": value}
    tolerance = None
    if "tolerance" in given:
        tolerance = _tolerance(given["tolerance"], unit, now, what)
    if "between" in given:
        low, high = Range(Quantity(unit))(list(given["between"]), what)
        return Change(name=name, low=low, high=high, tolerance=tolerance or 0.5 * (high - low))
    if tolerance is None:
        raise ParameterError(what, dict(given), "have a tolerance, or a range between [least, greatest]")
    return Change(name=name, low=now - tolerance, high=now + tolerance, tolerance=tolerance, given=given["tolerance"])


def _tolerance(value: Any, unit: str, now: float, name: str) -> float:
    """Return a tolerance in SI; a percentage is taken of the present value ``now``."""
    if isinstance(value, str) and value.rstrip().endswith("%"):
        found = quantity(value, "1", name) * abs(now)
        if now == 0.0:
            raise ParameterError(name, value, f"be a quantity in {unit}: it is zero now")
    else:
        found = quantity(value, unit, name)
    if not found > 0.0:
        raise ParameterError(name, value, "be above zero")
    return found


def _check_limit(mechanism: Mechanism, limit: Limit) -> Limit:
    """Check a limit; return it with its bound in SI, its unit, and the outputs in ``parts``."""
    name = limit.output.removeprefix(AMPLITUDE)
    units = {v.name: v.unit for v in mechanism.variables if v.name in mechanism.output_names}
    known = {output: (output,) for output in units} | (mechanism.joints if name == limit.output else {})
    joint = name.removesuffix(" force")  # the name of the force in the table of a run
    if joint != name and joint in known:
        raise ParameterError("output", limit.output, f"be {joint!r}, the name of the joint, for the force in it")
    if name not in known:
        raise unknown_name(name, known, f"output {name!r}")
    parts = known[name]
    value = si(limit.below, units[parts[0]], f"limit of {limit.output}")
    if not (isinstance(value, (int, float)) and isfinite(value) and value > 0.0):
        raise ParameterError(f"limit of {limit.output}", limit.below, "be above zero")
    checked = replace(limit, below=float(value))
    object.__setattr__(checked, "unit", units[parts[0]])
    object.__setattr__(checked, "parts", parts)
    return checked
