"""The class `Mechanism` and the records that it contains; the package of each mechanism exports one `Mechanism`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from math import degrees, inf, pi, radians
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple

from .errors import JammingError, LinkworkError
from .integrate import UNDEFINED
from .limits import ASSEMBLY, JAMMING, LIMIT_SINE, NEAR_LIMIT, UnjoinedMessages
from .parameters import Rules
from .variables import Variable

State = tuple[float, ...]


class Mode(NamedTuple):
    """The FMI parameter that chooses how a degree of freedom is driven.

    Attributes
    ----------
    name : str
        Name of the FMI parameter.
    values : tuple of str
        Meaning of its values 0, 1, ... in words.
    arguments : tuple of str
        For each value, the argument with which a run selects the value: the argument of a channel, or the name of a flag.
    default : int
        Value if none of these arguments is given.
    """

    name: str
    values: tuple[str, ...]
    arguments: tuple[str, ...]
    default: int = 0


class Freedom(NamedTuple):
    """A degree of freedom.

    Attributes
    ----------
    coordinate, rate : str
        FMI outputs that are the coordinate and its rate.
    initial : (str, str)
        Fields of the initial state with the coordinate and its rate.
    mode : Mode or None
        Choice of the drive; None if there is no choice.
    period : float
        Increase of the coordinate after which the mechanism is in the same configuration; 0 if there is none.
    swings : bool
        Whether the degree of freedom is a rotation that nothing drives, such as that of a pendulum; it is then not a crank.
    coupled : bool
        Whether a spring joins the rotation to others: a whole turn of it alone winds the spring up.
    """

    coordinate: str
    rate: str
    initial: tuple[str, str]
    mode: Mode | None = None
    period: float = 0.0
    swings: bool = False
    coupled: bool = False


class Channel(NamedTuple):
    """A channel: an input of a mechanism.

    Attributes
    ----------
    name : str
        Name of the FMI input.
    argument : str
        Name among the inputs of a run in Python and in case files; for a ``rate`` the name in messages.
    kind : str
        ``force``; ``command``, the commanded rate of a coordinate, whose jumps are impulses; or ``rate``, the time derivative
        of the command for the same coordinate during a step.
    freedom : int
        Index of the degree of freedom that the input drives; -1 if the input drives none directly.
    displacement : str
        For a force that drives no degree of freedom directly: the output with the displacement of the force's point of
        application, in the direction of the force.
    """

    name: str
    argument: str
    kind: str = "force"
    freedom: int = -1
    displacement: str = ""


#: A crank driven by a torque or at a commanded speed, as the first freedom, and its channels.
CRANK = Freedom(
    "crank.angle",
    "crank.speed",
    ("crank_angle", "crank_speed"),
    Mode("drive.mode", ("torque", "speed"), ("torque", "speed")),
    2.0 * pi,
)
CRANK_CHANNELS = (
    Channel("drive.torque", "torque", freedom=0),
    Channel("drive.speed", "speed", "command", 0),
    Channel("drive.acceleration", "acceleration", "rate", 0),
)


class Equations(NamedTuple):
    """The equations of a mechanism: arithmetic on floats without branches.

    x is the state, u the values of the channels, p the constants, a NamedTuple. A function that a mechanism does not need
    returns the state (`jump` and `start`, if no rate is commanded) or a constant (`clearance` 1.0, if the links can always be
    assembled).

    Attributes
    ----------
    apply_inputs : callable
        ``apply_inputs(modes, u, p)``: the record i of applied inputs that the other functions take, from the values of modes
        and channels.
    derivative : callable
        ``derivative(x, i, p)``: time derivative of the state.
    outputs : callable
        ``outputs(x, i, start_energy, p)``: all real outputs, in the order of the interface.
    clearance : callable
        ``clearance(x, i, p)``: the distance of the links from the limit of assembly, as the sine of an angle, comparable with
        `limits.LIMIT_SINE`; with friction switched on, the margin to jamming if this margin is smaller.
    jump : callable
        ``jump(x, i, u, p)``: the state after the commanded rates that are in force have jumped to their values in u.
    start : callable
        ``start(x, i, p)``: the initial state x, with its dependent components computed from the others.
    energy : callable
        ``energy(x, p)``: mechanical energy (J).
    """

    apply_inputs: Callable[..., Any]
    derivative: Callable[..., Any]
    outputs: Callable[..., Any]
    clearance: Callable[..., float]
    jump: Callable[..., Any]
    start: Callable[..., Any]
    energy: Callable[..., float]

    @classmethod
    def of(cls, module: ModuleType) -> Equations:
        """Return the equations of a module whose functions have these names."""
        return cls(*(getattr(module, name) for name in cls._fields))


class Joint(NamedTuple):
    """A point in the drawing of a mechanism.

    Attributes
    ----------
    name : str
        Letter of the point.
    text : str
        Description.
    moves : tuple of str
        FMI parameters, one or two, that change when the point is dragged; empty if the point cannot be dragged.
    aid : bool
        Whether the point only places parts: neither a pin nor its name is drawn.
    """

    name: str
    text: str
    moves: tuple[str, ...] = ()
    aid: bool = False


class Part(NamedTuple):
    """A part of the drawing, drawn through joints.

    Attributes
    ----------
    kind : str
        ``pivot`` (a bearing of the ground at a point), ``link`` (through two points or more), ``guide`` (a line through two
        points), ``slider`` (a block at the first point, in the direction of the next two), ``spring``, ``damper`` (both from
        a slider to the ground, with the slider's points), ``axis`` (a centre line through two points) or ``gear`` (the pitch
        circle about the first point through the second, and the radius to the second, which rotates).
    joints : tuple of str
    text : str
        Description.
    where : str
        FMI parameter that must not be zero for the part to be drawn; empty if it is always drawn.
    """

    kind: str
    joints: tuple[str, ...]
    text: str
    where: str = ""


#: Number of points of each kind of part; for a link the least number.
PARTS = {"pivot": 1, "link": 2, "guide": 2, "slider": 3, "spring": 3, "damper": 3, "axis": 2, "gear": 2}


class Link(NamedTuple):
    """A link whose mass follows from its length and its cross-section, if a case gives a section.

    Attributes
    ----------
    name : str
        First part of the names of the link's parameters.
    length, mass, inertia : str
        FMI parameters.
    centre : tuple of str
        FMI parameters of the centre of mass relative to the first pin: the distance along the link and, for some links, the
        coordinate across the link or the angle from the link.
    about_pin : bool
        Whether the moment of inertia is about the first pin, not about the centre of mass.
    """

    name: str
    length: str
    mass: str
    inertia: str
    centre: tuple[str, ...]
    about_pin: bool = False


class Drawing(NamedTuple):
    """The drawing of a mechanism.

    Attributes
    ----------
    joints : tuple of Joint
    positions : callable
        ``positions(x, i, p)``: x, y and z of every joint (m), by arithmetic without branches.
    parts : tuple of Part
        From the back to the front.
    paths : tuple of str
        Joints whose paths are drawn.
    planar : bool
        Whether all points move in the plane z = 0.
    """

    joints: tuple[Joint, ...]
    positions: Callable[..., Any]
    parts: tuple[Part, ...]
    paths: tuple[str, ...]
    planar: bool = True


class PublishedSet(NamedTuple):
    """A mechanism with published numbers.

    Attributes
    ----------
    parameters, initial : of the mechanism
        Parameters and state at the start.
    drive : mapping of str to float
        Constant inputs of the published run, by argument, such as ``{"speed": 44.0}``.
    source : str
        Source in which the numbers are printed.
    at_rest : bool
        Whether the mechanism starts at rest except for the rate that ``drive`` commands. A run with another drive then starts
        at rest, unless a case file says otherwise.
    origins : mapping of str to str
        Origin of masses in words, by FMI parameter, such as "of a bar of 20 x 5 mm"; masses not listed are as printed.
    """

    parameters: Any
    initial: Any
    drive: Mapping[str, float]
    source: str
    at_rest: bool = False
    origins: Mapping[str, str] = MappingProxyType({})

    @property
    def crank_speed(self) -> float:
        """Return the speed of a single crank (rad/s): ``drive["speed"]``."""
        return self.drive["speed"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Mechanism:
    """A mechanism: its parameters, its interface and its equations.

    The state of a run is the tuple of all coordinates, all their rates, the work dissipated and the work supplied.

    Attributes
    ----------
    name : str
        Name in case files and messages.
    fmu : str
        Name of its FMU.
    title, description : str
    notes : tuple of str
        Paragraphs of the FMU's documentation.
    parameters, initial : type
        Dataclass of the parameters, with a method ``constants`` and an attribute ``RULES``; dataclass of the initial state.
    published : mapping
        `PublishedSet` by name, at least one.
    freedoms : tuple of Freedom
        Degrees of freedom; any number of them may be rotations.
    channels : tuple of Channel
        In the order of the FMI inputs.
    variables : tuple of Variable
        The FMI interface.
    position_parameters : tuple of str
        FMI parameters that set the configuration at the start.
    experiment : tuple of float
        Default experiment: start, stop and step (s), tolerance.
    modules : tuple of modules
        Modules of the equations and of all functions that they call; the last is in the package that has ``MECHANISM``.
    equations : Equations
    check_assembly : callable
        ``check_assembly(x, p)`` raises AssemblyError unless the links can be joined with clearance `LIMIT_SINE`.
    error_scale : callable
        ``error_scale(parameters, x)``: magnitudes of the state's components below which the integrator's error is absolute,
        by arithmetic without branches.
    unjoined : UnjoinedMessages or None
        Messages of this AssemblyError, also used by the FMU in C; None if the links can always be joined.
    greatest_rotation : float
        Largest change of an angle among the freedoms in a step of the integrator (rad), and of a translation relative to its
        ``error_scale``, so that no step passes over a force that acts over a small angle only, and none over a limit of
        assembly; infinite if the mechanism has neither such a force nor a limit of assembly.
    switch : str
        Name of the only constant on which the equations may branch: they may differ between zero and positive values of this
        constant. The equations are traced once for each of the two cases, so that terms that are switched off cost nothing.
        Empty if the equations do not branch.
    links : tuple of Link
        Links whose masses can follow from a cross-section.
    drawing : Drawing or None
        Drawing of the mechanism; None if there is none.
    cases : mapping
        Standard cases by name, as tables of a case file; the mechanism's FMUs are checked with these cases. May be empty.
    """

    name: str
    fmu: str
    title: str
    description: str
    notes: tuple[str, ...]
    parameters: type
    initial: type
    published: Mapping[str, PublishedSet]
    freedoms: tuple[Freedom, ...]
    channels: tuple[Channel, ...]
    variables: tuple[Variable, ...]
    position_parameters: tuple[str, ...]
    experiment: tuple[float, float, float, float]
    modules: tuple[ModuleType, ...]
    equations: Equations
    check_assembly: Callable[[Sequence[float], Any], None]
    error_scale: Callable[[Any, Sequence[float]], tuple[float, ...]]
    unjoined: UnjoinedMessages | None = None
    greatest_rotation: float = radians(60.0)
    switch: str = ""
    links: tuple[Link, ...] = ()
    drawing: Drawing | None = None
    cases: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __reduce__(self) -> Any:
        # a mechanism is pickled by the name of its package, because a copy would count as another mechanism
        package = str(self.modules[-1].__package__)
        if getattr(import_module(package), "MECHANISM", None) is not self:
            raise LinkworkError(f"this {self.name} is not the MECHANISM of {package}: another process cannot import it")
        return _load, (package,)

    def __repr__(self) -> str:
        freedoms = ", ".join(freedom.coordinate for freedom in self.freedoms)
        return f"<mechanism {self.name}: freedoms {freedoms}; inputs {', '.join(self.input_names)}>"

    @cached_property
    def size(self) -> int:
        """Return the number of components of the state."""
        return 2 * len(self.freedoms) + 2

    @cached_property
    def reach(self) -> tuple[float, ...]:
        """Return the largest change of each component of the state, relative to its ``error_scale``, in a step."""
        return (*[self.greatest_rotation] * len(self.freedoms), *[inf] * (len(self.freedoms) + 2))

    @property
    def first_set(self) -> PublishedSet:
        """Return the first of the published sets."""
        return next(iter(self.published.values()))

    @cached_property
    def constants(self) -> Any:
        """Return the type of the equations' constants."""
        return type(self.first_set.parameters.constants())

    @cached_property
    def switch_index(self) -> int:
        """Return the index of the switch among the constants; -1 if there is none."""
        return int(self.constants._fields.index(self.switch)) if self.switch else -1

    def is_switched_on(self, p: Sequence[float]) -> bool:
        """Return whether the switch is on; ``p`` are the constants, or numbers that begin with them."""
        return self.switch_index >= 0 and p[self.switch_index] != 0.0

    def describe_limit(self, x: Sequence[float], i: Any, p: Any) -> str:
        """Return in words the limit that a motion with a small clearance is near: limit of assembly, or jamming by friction."""
        if (
            self.is_switched_on(p)
            and abs(self.equations.clearance(x, i, p._replace(**{self.switch: 0.0}))) >= NEAR_LIMIT
        ):
            return JAMMING
        return ASSEMBLY

    def idle_inputs(self, p: Any) -> Any:
        """Return the record i of applied inputs for all inputs zero and all modes at their defaults."""
        modes = tuple(float(mode.default) for mode in self.modes)
        return self.equations.apply_inputs(modes, (0.0,) * len(self.channels), p)

    def check_state(self, x: Sequence[float], i: Any, p: Any) -> None:
        """Check that the links can be joined and do not jam, with a clearance of at least `limits.LIMIT_SINE`.

        Raises
        ------
        AssemblyError
            If the links cannot be joined; `JammingError` if friction may jam the links.
        """
        self.check_assembly(x, p)
        if self.is_switched_on(p):
            try:
                clear = self.equations.clearance(x, i, p) >= LIMIT_SINE
            except UNDEFINED:
                clear = False
            if not clear:
                raise JammingError(f"{JAMMING} at {self.describe_state(x)}")

    @cached_property
    def cyclic_freedoms(self) -> tuple[int, ...]:
        """Return the indices of the degrees of freedom that are rotations of cranks; pendulums are left out."""
        return tuple(n for n, freedom in enumerate(self.freedoms) if freedom.period > 0.0 and not freedom.swings)

    @cached_property
    def torques(self) -> tuple[int, ...]:
        """Return the indices of the channels that are torques on cranks; see `cyclic_freedoms`."""
        return tuple(n for n, c in enumerate(self.channels) if c.kind == "force" and c.freedom in self.cyclic_freedoms)

    def channel_index(self, freedom: int, kind: str) -> int | None:
        """Return the index of the channel of a kind that drives a degree of freedom directly; None if there is none."""
        found = (n for n, c in enumerate(self.channels) if c.kind == kind and c.freedom == freedom)
        return next(found, None)

    def names(self, role: str, of: str | None = None) -> tuple[str, ...]:
        """Return the names of the variables with a role; ``of`` selects those of one coordinate or joint."""
        return tuple(v.name for v in self.variables if v.role == role and of in (None, v.of))

    @cached_property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """Return, by joint, the names of the outputs that are the components of the joint force."""
        found: dict[str, tuple[str, ...]] = {}
        for v in self.variables:
            if v.role == "joint force":
                found[v.of] = (*found.get(v.of, ()), v.name)
        return found

    @cached_property
    def rules(self) -> Rules:
        """Return the rules for the values of the parameters."""
        rules: Rules = self.parameters.RULES  # type: ignore[attr-defined]
        return rules

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Return the modes of all degrees of freedom that have a choice of the drive."""
        return tuple(freedom.mode for freedom in self.freedoms if freedom.mode is not None)

    @cached_property
    def input_names(self) -> tuple[str, ...]:
        """Return the FMI names of the inputs."""
        return tuple(channel.name for channel in self.channels)

    @cached_property
    def output_names(self) -> tuple[str, ...]:
        """Return the FMI names of the real outputs, in the order of ``equations.outputs``."""
        return tuple(v.name for v in self.variables if v.causality == "output" and v.kind == "Real")

    @cached_property
    def mechanism_variables(self) -> dict[str, Variable]:
        """Return, by FMI name, the variables that are fields of the parameters."""
        others = {mode.name for mode in self.modes} | {"solver.tolerance"}
        return {
            v.name: v
            for v in self.variables
            if v.causality == "parameter" and not v.name.startswith("initial.") and v.name not in others
        }

    @cached_property
    def initial_variables(self) -> dict[str, Variable]:
        """Return, by name of the field, the variables of the state at the start."""
        prefix = "initial."
        return {v.name.removeprefix(prefix): v for v in self.variables if v.name.startswith(prefix)}

    def commands(self, modes: Mapping[str, int]) -> tuple[int, ...]:
        """Return the indices of the channels that command a rate; ``modes`` has the value of each mode by name."""
        return tuple(
            number
            for number, channel in enumerate(self.channels)
            if channel.kind == "command" and self._drives(channel, modes)
        )

    def _drives(self, channel: Channel, modes: Mapping[str, int]) -> bool:
        mode = self.freedoms[channel.freedom].mode
        return mode is None or mode.arguments[modes[mode.name]] == channel.argument

    def describe_state(self, x: Sequence[float]) -> str:
        """Describe a state in words, by the coordinates of the degrees of freedom."""
        units = {v.name: v.unit for v in self.variables}
        words = []
        for freedom, value in zip(self.freedoms, x):
            unit = units[freedom.coordinate]
            in_degrees = f" ({degrees(value):.4f} deg)" if unit == "rad" else ""
            words.append(f"{freedom.coordinate.replace('.', ' ')} {value:.9g} {unit}{in_degrees}")
        return " and ".join(words)

    def state(self, initial: Any) -> State:
        """Return the state that ``initial`` describes, with dissipated and supplied work zero."""
        coordinates = [float(getattr(initial, freedom.initial[0])) for freedom in self.freedoms]
        rates = [float(getattr(initial, freedom.initial[1])) for freedom in self.freedoms]
        return (*coordinates, *rates, 0.0, 0.0)


def _load(package: str) -> Mechanism:
    mechanism: Mechanism = import_module(package).MECHANISM
    return mechanism


def crank_scale(length: float, mass: float, inertia: float, crank_speed: float) -> tuple[float, ...]:
    """Return `Mechanism.error_scale` for a mechanism with a crank and a translation as its second freedom.

    ``length`` (m) and ``inertia`` (kg.m2) belong to the crank, ``mass`` (kg) is the mass of the other links, and
    ``crank_speed`` (rad/s) the crank speed at the start.
    """
    speed = max(1.0, abs(crank_speed))
    energy = 0.5 * (inertia + mass * length * length) * speed * speed
    return (1.0, length, speed, length * speed, energy, energy)
