"""Sampled controllers as Python FMUs; their outputs are held between two samples.

A sample uses the inputs of the communication step in which its instant lies, which a master sets at the start of the step; its
outputs are available at the end of the step. If the step is a fraction of the sample time, the outputs are therefore delayed by
one step. If the step is as long as the sample time, they are delayed by one sample, like the outputs of a computer that needs
the whole sample time for the calculation. In a step that is longer, all samples use the same inputs.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, exp, floor, inf, isfinite, pi, sin
from typing import Any, ClassVar, NamedTuple, NoReturn
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Causality, Fmi2Status, Fmi2Variability
from pythonfmu.variables import Integer, Real

from linkwork.wrapper import (
    INITIALISING,
    INSTANTIATED,
    RUNNING,
    TERMINATED,
    end_in_order,
    keep_namespace,
    outlive_exception,
    read_state,
    write_state,
)


class Row(NamedTuple):
    """A variable of a controller: a parameter, an input, an output, or a local variable, which is a state.

    ``rule``, a key of `RULES`, is a condition on a parameter; all parameters must be finite.
    """

    name: str
    causality: str
    unit: str
    start: float
    text: str
    rule: str = ""


#: Conditions on a parameter: the words after "it must", and the test of a finite value.
RULES: dict[str, tuple[str, Callable[[float], bool]]] = {
    "": ("be a finite number", lambda value: True),
    "positive": ("be a finite number greater than zero", lambda value: value > 0.0),
    "not negative": ("be a finite number and not negative", lambda value: value >= 0.0),
}

#: Parameter of every controller; it is the only fixed parameter.
SAMPLE_TIME = Row("sample_time", "parameter", "s", 1e-3, "Time between two samples", "positive")

#: Exponents of the base units.
UNITS: dict[str, dict[str, int]] = {
    "s": {"s": 1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "N/(m.s)": {"kg": 1, "s": -3},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m/A": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "V/A": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "V.s/A": {"kg": 1, "m": 2, "s": -2, "A": -2},
}


class Controller(Fmi2Slave):  # type: ignore[misc]
    """Base of the controllers.

    A controller has the table ``rows`` of its variables, and `sample`, which reads and sets the attributes with the names of
    the variables. All parameters except the sample time may be set between steps; they act from the next sample on.
    """

    rows: ClassVar[tuple[Row, ...]]
    sample_time: float
    #: Phase, start and stop time (s) of the run, which are part of a saved state.
    phase = INSTANTIATED
    start_time, stop_time = 0.0, inf

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        keep_namespace(cls)

    def __init__(self, **keywords: Any) -> None:
        super().__init__(**keywords)
        self._wrapped = "logger" in keywords
        if self._wrapped:
            outlive_exception(self)
        self.description = (type(self).__doc__ or "").strip().partition("\n")[0]
        self.count = 0
        self.author = "Linkwork"
        self.parameters = {row.name: row for row in (SAMPLE_TIME, *self.rows) if row.causality == "parameter"}
        for row in (SAMPLE_TIME, *self.rows):
            setattr(self, row.name, row.start)
            changes = {"parameter": "tunable", "input": "continuous"}.get(row.causality, "discrete")
            self.register_variable(
                Real(
                    row.name,
                    causality=Fmi2Causality[row.causality],
                    variability=Fmi2Variability["fixed" if row is SAMPLE_TIME else changes],
                    description=row.text,
                )
            )
        text = "Number of the samples taken"
        local, discrete = Fmi2Causality.local, Fmi2Variability.discrete
        self.register_variable(Integer("count", causality=local, variability=discrete, description=text))

    def to_xml(self, model_options: dict[str, str] = {}) -> Element:  # noqa: B006 - the signature is pythonfmu's
        """Return the model description, with the units, which pythonfmu does not know."""
        root: Element = super().to_xml(model_options)
        units = {row.name: row.unit for row in (SAMPLE_TIME, *self.rows) if row.unit in UNITS}
        definitions = Element("UnitDefinitions")
        for unit in dict.fromkeys(units.values()):
            node = SubElement(definitions, "Unit", name=unit)
            SubElement(node, "BaseUnit", {base: str(power) for base, power in UNITS[unit].items()})
        root.insert([child.tag for child in root].index("LogCategories"), definitions)
        (structure,) = root.iter("ModelStructure")
        unknowns = SubElement(structure, "InitialUnknowns")
        for number, variable in enumerate(root.iterfind("ModelVariables/ScalarVariable"), 1):
            if variable.get("causality") == "output":
                SubElement(unknowns, "Unknown", index=str(number))
            name = str(variable.get("name"))
            if name in units:
                variable[0].set("unit", units[name])
            if name in self.parameters and self.parameters[name].rule:
                variable[0].set("min", "0.0")
        return root

    def get_real(self, vrs: list[int]) -> list[float]:
        """Return values of variables; before the first sample, outputs are computed from the present inputs."""
        if self.count == 0:
            self.preview()
        return super().get_real(vrs)

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set all values, or none if one is refused; after the first sample, bad parameters and sample times are refused."""
        self._expect("fmi2SetReal", INSTANTIATED, INITIALISING, RUNNING)
        for reference, value in zip(vrs, values):
            if reference not in self.vars:
                self._refuse(f"there is no variable with the value reference {reference}")
            name = self.vars[reference].name
            if self.vars[reference].causality not in (Fmi2Causality.parameter, Fmi2Causality.input):
                self._refuse(f"{name} is computed: the value {value} was not taken")
            if self.count > 0 and name == SAMPLE_TIME.name:
                self._refuse(f"{name} is a fixed parameter: the value {value} was not taken")
            if self.count > 0 and name in self.parameters:
                self._check(name, value)
        super().set_real(vrs, values)

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Refuse the call: the only integer, the count of samples, cannot be set."""
        self._refuse("no integer can be set")

    def _expect(self, call: str, *phases: str) -> None:
        if self.phase not in phases:
            self._refuse(f"{call} out of order: the controller is {self.phase}, not {' or '.join(phases)}")

    def _is_valid(self, name: str, value: float) -> bool:
        return isfinite(value) and RULES[self.parameters[name].rule][1](value)

    def _check(self, name: str, value: float) -> None:
        if not self._is_valid(name, value):
            self._refuse(f"parameter {name} is {value}: it must {RULES[self.parameters[name].rule][0]}")

    def _refuse(self, sentence: str) -> NoReturn:
        self.log(sentence, Fmi2Status.error)
        if self._wrapped:
            outlive_exception(self)
        raise ValueError(sentence)

    def preview(self) -> None:
        """Set the outputs to the values that a sample at the start would give, without changing the states."""
        if not all(self._is_valid(name, getattr(self, name)) for name in self.parameters):
            return
        states = {row.name: getattr(self, row.name) for row in self.rows if row.causality == "local"}
        self.sample(0.0)
        for name, value in states.items():
            setattr(self, name, value)

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Store the start and stop time of the run."""
        self._expect("fmi2SetupExperiment", INSTANTIATED)
        self.start_time, self.stop_time = start_time, inf if stop_time is None else stop_time
        if not start_time <= self.stop_time:
            self._refuse(f"the stop time is {stop_time} s: it must not be before the start time, {start_time} s")

    def enter_initialization_mode(self) -> None:
        """Begin the initialisation."""
        self._expect("fmi2EnterInitializationMode", INSTANTIATED)
        self.phase = INITIALISING

    def exit_initialization_mode(self) -> None:
        """Check the parameters and take the sample at the start."""
        self._expect("fmi2ExitInitializationMode", INITIALISING)
        for name in self.parameters:
            self._check(name, getattr(self, name))
        self.count, self.phase = 0, RUNNING
        self._sample_before_end(self.start_time + 0.5 * self.sample_time)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Take the samples in a step, except a sample at the end of the step; return False if the step is not valid."""
        end = current_time + step_size
        if self.phase != RUNNING:
            wrong = f"the controller is {self.phase}"
        elif not (isfinite(end) and step_size > 0.0 and end <= self.stop_time + 1e-6 * step_size):
            wrong = f"it must be finite and above 0, and end by the stop time, {self.stop_time} s"
        else:
            self._sample_before_end(end)
            return True
        self.log(f"a step of {step_size} s at {current_time} s: {wrong}", Fmi2Status.discard)
        return False

    def terminate(self) -> None:
        """End the run; this is allowed in every phase, because masters clean up after errors."""
        if self._wrapped and self.phase != TERMINATED:
            end_in_order(self)
        self.phase = TERMINATED

    _fmu_state_to_bytes, _fmu_state_from_bytes = staticmethod(write_state), staticmethod(read_state)

    def _get_fmu_state(self) -> dict[str, Any]:
        state: dict[str, Any] = super()._get_fmu_state()
        times = {"start_time": self.start_time, "stop_time": self.stop_time}
        return state | times | {"model": type(self).__name__, "phase": self.phase}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Restore a saved state; refuse a state that is damaged or belongs to another controller."""
        if "damaged" in state:
            self._refuse(f"the serialised state is damaged: {state['damaged']}")
        kind = type(self).__name__
        if state.get("model") != kind or set(state) != set(self._get_fmu_state()):
            self._refuse(f"the saved state belongs to {state.get('model')!r}, not to this {kind}")
        super()._set_fmu_state({name: value for name, value in state.items() if name != "model"})

    def _sample_before_end(self, end: float) -> None:
        while (t := self.start_time + self.count * self.sample_time) < end - 1e-6 * self.sample_time:
            self.sample(t)
            self.count += 1

    def sample(self, t: float) -> None:
        """Set the outputs and states at an instant of sampling."""
        raise NotImplementedError


def _clamp(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


class Pid(Controller):
    """PID controller of a position, with feed-forward; the output is a force, limited without windup of the integral.

    The derivative term uses the error after a first-order filter. While the force is at its limit, the integral is driven back
    with the tracking time (K. J. Astrom and T. Hagglund, Advanced PID Control, 2006, section 3.5).
    """

    rows = (
        Row("gain", "parameter", "N/m", 0.0, "Force per error"),
        Row("integral_gain", "parameter", "N/(m.s)", 0.0, "Growth of the force per error and second"),
        Row("derivative_gain", "parameter", "N.s/m", 0.0, "Force per rate of the error"),
        Row("filter_time", "parameter", "s", 0.0, "Time constant of the filter before the derivative", "not negative"),
        Row(
            "tracking_time",
            "parameter",
            "s",
            0.1,
            "Time in which the integral follows the limit, at least sample_time",
            "positive",
        ),
        Row("limit", "parameter", "N", 1e6, "Greatest magnitude of the force", "not negative"),
        Row("reference", "input", "m", 0.0, "Wanted position"),
        Row("measured", "input", "m", 0.0, "The position"),
        Row("feed_forward", "input", "N", 0.0, "Force added to the controller's"),
        Row("force", "output", "N", 0.0, "The force"),
        Row("error", "output", "m", 0.0, "Reference minus position, at the last sample"),
        Row("integral", "local", "N", 0.0, "Force of the integral term"),
        Row("derivative", "local", "N", 0.0, "Force of the derivative term"),
    )

    error: float
    derivative: float
    integral: float

    def sample(self, t: float) -> None:
        before, self.error = self.error, self.reference - self.measured
        if self.count > 0:
            change = self.derivative_gain * (self.error - before)
            self.derivative = (self.filter_time * self.derivative + change) / (self.filter_time + self.sample_time)
        wanted = self.gain * self.error + self.integral + self.derivative + self.feed_forward
        self.force = _clamp(wanted, self.limit)
        # with a tracking time below half a sample time the integral would oscillate with growing amplitude
        back = (self.force - wanted) / max(self.tracking_time, self.sample_time)
        self.integral += self.sample_time * (self.integral_gain * self.error + back)


class StateFeedback(Controller):
    """State feedback of position and velocity with feed-forward and force limit; `design_lqr` gives its gains."""

    rows = (
        Row("position_gain", "parameter", "N/m", 0.0, "Restoring force per deviation of the position"),
        Row("velocity_gain", "parameter", "N.s/m", 0.0, "Restoring force per deviation of the velocity"),
        Row("limit", "parameter", "N", 1e6, "Greatest magnitude of the force", "not negative"),
        Row("reference", "input", "m", 0.0, "Wanted position"),
        Row("reference_velocity", "input", "m/s", 0.0, "Wanted velocity"),
        Row("position", "input", "m", 0.0, "The position"),
        Row("velocity", "input", "m/s", 0.0, "The velocity"),
        Row("feed_forward", "input", "N", 0.0, "Force added to the controller's"),
        Row("force", "output", "N", 0.0, "The force"),
    )

    def sample(self, t: float) -> None:
        back = self.position_gain * (self.position - self.reference)
        back += self.velocity_gain * (self.velocity - self.reference_velocity)
        self.force = _clamp(self.feed_forward - back, self.limit)


#: Harmonics of a `MotionReference`.
HARMONICS = 6


def _series(name: str, unit: str, text: str) -> tuple[Row, ...]:
    rows = [Row(f"{name}_0", "parameter", unit, 0.0, f"{text}, mean")]
    for n in range(1, HARMONICS + 1):
        rows.append(Row(f"{name}_cos_{n}", "parameter", unit, 0.0, f"{text}, cosine of {n} times the angle"))
        rows.append(Row(f"{name}_sin_{n}", "parameter", unit, 0.0, f"{text}, sine of {n} times the angle"))
    return tuple(rows)


class MotionReference(Controller):
    """A motion as a function of the crank angle, and the force that belongs to it: Fourier series of six harmonics.

    The outputs are those at the angle that the crank will have after the time ``lead``, when a controller uses them.
    """

    rows = (
        *_series("motion", "m", "Position"),
        *_series("load", "N", "Force"),
        Row("lead", "parameter", "s", 0.0, "Time ahead for which the outputs are computed", "not negative"),
        Row("angle", "input", "rad", 0.0, "Crank angle"),
        Row("speed", "input", "rad/s", 0.0, "Crank speed"),
        Row("position", "output", "m", 0.0, "Position there"),
        Row("velocity", "output", "m/s", 0.0, "Velocity at the crank speed"),
        Row("force", "output", "N", 0.0, "Force there"),
    )

    def sample(self, t: float) -> None:
        self.position, slope = self._evaluate_series("motion")
        self.velocity = slope * self.speed
        self.force, _ = self._evaluate_series("load")

    def _evaluate_series(self, name: str) -> tuple[float, float]:
        value, slope = getattr(self, f"{name}_0"), 0.0
        for n in range(1, HARMONICS + 1):
            a, b = getattr(self, f"{name}_cos_{n}"), getattr(self, f"{name}_sin_{n}")
            angle = n * (self.angle + self.lead * self.speed)
            value += a * cos(angle) + b * sin(angle)
            slope += n * (b * cos(angle) - a * sin(angle))
        return value, slope


#: Number of points of a `ForceTable` per revolution.
POINTS = 72


class ForceTable(Controller):
    """A force as a function of the crank angle: a table of 72 points, five degrees apart, interpolated linearly; periodic."""

    rows = (
        *(Row(f"table_{n}", "parameter", "N", 0.0, f"Force at {n * 360 // POINTS} degrees") for n in range(POINTS)),
        Row("angle", "input", "rad", 0.0, "Crank angle"),
        Row("force", "output", "N", 0.0, "Force there"),
    )

    def sample(self, t: float) -> None:
        place = POINTS * self.angle / (2.0 * pi)
        before = floor(place)
        first, second = (getattr(self, f"table_{n % POINTS}") for n in (before, before + 1))
        self.force = first + (place - before) * (second - first)


class DcServo(Controller):
    """DC motor with a current loop, limits of voltage and current, and an encoder; the rotor's inertia belongs to the load.

    Within a sample, voltage and speed are constant; the current is computed exactly.
    """

    rows = (
        Row("resistance", "parameter", "V/A", 1.0, "Resistance of the winding", "positive"),
        Row("inductance", "parameter", "V.s/A", 1e-3, "Inductance of the winding", "positive"),
        Row("torque_constant", "parameter", "N.m/A", 0.1, "Torque per current, and voltage per speed", "positive"),
        Row("voltage_limit", "parameter", "V", 24.0, "Greatest magnitude of the voltage", "not negative"),
        Row("current_limit", "parameter", "A", 10.0, "Greatest magnitude of the current reference", "not negative"),
        Row("current_gain", "parameter", "V/A", 5.0, "Voltage per error of the current"),
        Row("encoder_counts", "parameter", "1", 4096.0, "Counts of the encoder in a turn", "positive"),
        Row("torque_reference", "input", "N.m", 0.0, "Wanted torque"),
        Row("angle", "input", "rad", 0.0, "Angle of the shaft"),
        Row("speed", "input", "rad/s", 0.0, "Speed of the shaft"),
        Row("torque", "output", "N.m", 0.0, "Torque on the shaft"),
        Row("current", "output", "A", 0.0, "Current of the winding"),
        Row("encoder_angle", "output", "rad", 0.0, "Angle measured by the encoder"),
        Row("voltage", "local", "V", 0.0, "Voltage since the last sample"),
    )

    voltage: float
    current: float

    def sample(self, t: float) -> None:
        induced = self.torque_constant * self.speed
        if self.count > 0:
            end = (self.voltage - induced) / self.resistance
            left = exp(-self.sample_time * self.resistance / self.inductance)
            self.current = end + (self.current - end) * left
        wanted = _clamp(self.torque_reference / self.torque_constant, self.current_limit)
        voltage = self.resistance * wanted + induced + self.current_gain * (wanted - self.current)
        self.voltage = _clamp(voltage, self.voltage_limit)
        self.torque = self.torque_constant * self.current
        count = 2.0 * pi / self.encoder_counts
        self.encoder_angle = count * floor(self.angle / count)


#: Controllers by their names in descriptions of systems.
CONTROLLERS: dict[str, type[Controller]] = {
    "pid": Pid,
    "state-feedback": StateFeedback,
    "motion-reference": MotionReference,
    "force-table": ForceTable,
    "dc-servo": DcServo,
}
