"""The class `Mechanism`, of which each mechanism's folder exports one object, and the records that it consists of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from math import degrees
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple

from .errors import JammingError, LinkworkError
from .limits import ASSEMBLY, JAMMING, LIMIT_SINE, NEAR_LIMIT, Unjoined
from .parameters import Rules
from .variables import Variable

State = tuple[float, ...]


class Mode(NamedTuple):
    """A way of driving a freedom: the parameter that chooses it.

    Attributes
    ----------
    name : str
        Of the FMI parameter.
    values : tuple of str
        Its values 0, 1, ... in words.
    arguments : tuple of str
        What chooses each value where the inputs of a run are given: the channel of that argument, or a flag of that name.
    default : int
        Value where none of them is given.
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
        Fields of the state at the start that give both.
    mode : Mode or None
        How it can be driven, if it can.
    period : float
        Increase of the coordinate after which the mechanism is in the same configuration; 0 where there is none.
    swings : bool
        Whether nothing drives it, so that it is no crank: a pendulum.
    """

    coordinate: str
    rate: str
    initial: tuple[str, str]
    mode: Mode | None = None
    period: float = 0.0
    swings: bool = False


class Channel(NamedTuple):
    """An input.

    Attributes
    ----------
    name : str
        Of the FMI input.
    argument : str
        Its name among the inputs of a run in Python and in case files; of a ``rate`` what messages call it.
    kind : str
        ``force``, ``command`` (the rate of a freedom, a jump of which is an impulse) or ``rate`` (of change of the command
        of the same freedom, over a step).
    freedom : int
        Number of the freedom that it drives; -1 where it drives none directly.
    displacement : str
        Of a force that drives no freedom directly, the output that is the displacement of what it acts on, along it.
    """

    name: str
    argument: str
    kind: str = "force"
    freedom: int = -1
    displacement: str = ""


class Equations(NamedTuple):
    """The equations: straight lines of arithmetic on floats; x is the state, u the channels, p the constants, a NamedTuple.

    What a mechanism has no use for returns what it was given, or a constant: `jump` and `start` the state, where no rate is
    commanded; `clearance` 1.0, where the links can always be assembled.

    Attributes
    ----------
    applied : callable
        ``applied(modes, u, p)``: what acts on the plant, i, from the values of the modes and the channels.
    derivative : callable
        ``derivative(x, i, p)``: time derivative of the state.
    outputs : callable
        ``outputs(x, i, start_energy, p)``: all real outputs, in the order of the interface.
    clearance : callable
        ``clearance(x, i, p)``: how far the links are from the limit of assembly, in the measure of `limits.LIMIT_SINE`; where
        friction is switched on, from where it may jam them, if that is less.
    jump : callable
        ``jump(x, i, u, p)``: the state after the commanded rates, where they are in force, have jumped to those in u.
    start : callable
        ``start(x, i, p)``: the state with those parts settled that others determine.
    energy : callable
        ``energy(x, p)``: mechanical energy (J).
    """

    applied: Callable[..., Any]
    derivative: Callable[..., Any]
    outputs: Callable[..., Any]
    clearance: Callable[..., float]
    jump: Callable[..., Any]
    start: Callable[..., Any]
    energy: Callable[..., float]


class Joint(NamedTuple):
    """A point of the picture of a mechanism.

    Attributes
    ----------
    name : str
        Its letter.
    text : str
        What it is.
    moves : tuple of str
        FMI parameters, one or two, that change so that the point goes where it is dragged; none where it stays.
    """

    name: str
    text: str
    moves: tuple[str, ...] = ()


class Part(NamedTuple):
    """A part of the drawing, drawn through joints.

    Attributes
    ----------
    kind : str
        ``pivot`` (a bearing of the ground at a point), ``link`` (through two points or more), ``guide`` (a line through two
        points), ``slider`` (a block at the first point, in the direction of the next two), ``spring``, ``damper`` (from a
        slider to the ground, with the slider's points), ``axis`` (a centre line through two points) or ``gear`` (the pitch
        circle about the first point through the second, and its radius to there, which turns).
    joints : tuple of str
    text : str
        What it is.
    where : str
        FMI parameter that is not zero where there is such a part; empty where there always is.
    """

    kind: str
    joints: tuple[str, ...]
    text: str
    where: str = ""


#: Points by kind of part: as many, or at least as many as a link has.
PARTS = {"pivot": 1, "link": 2, "guide": 2, "slider": 3, "spring": 3, "damper": 3, "axis": 2, "gear": 2}


class Link(NamedTuple):
    """A link whose mass follows from its length and its section, where a case gives one.

    Attributes
    ----------
    name : str
        First part of the names of its parameters.
    length, mass, inertia : str
        FMI parameters.
    centre : tuple of str
        FMI parameters of its centre of mass from its first pin: the distance along the link, and the coordinate across it or
        the angle from it, if it has one.
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
        ``positions(x, i, p)``: x, y and z of every joint (m); a straight line of arithmetic like the equations.
    parts : tuple of Part
        From the back to the front.
    paths : tuple of str
        Joints whose paths are drawn.
    planar : bool
        Whether all moves in the plane z = 0.
    """

    joints: tuple[Joint, ...]
    positions: Callable[..., Any]
    parts: tuple[Part, ...]
    paths: tuple[str, ...]
    planar: bool = True


class PublishedSet(NamedTuple):
    """A mechanism as printed.

    Attributes
    ----------
    parameters, initial : of the mechanism
        Parameters and state at the start.
    drive : mapping of str to float
        Constant inputs that it is run at, by their arguments, such as ``{"speed": 44.0}``.
    source : str
        Where it is printed.
    at_rest : bool
        Whether it starts at rest but for what ``drive`` commands: where something else drives the mechanism it then starts at
        rest, unless a case file says otherwise.
    origins : mapping of str to str
        Where masses come from, in words by FMI parameter, such as "of a bar of 20 x 5 mm"; what is not there is as printed.
    """

    parameters: Any
    initial: Any
    drive: Mapping[str, float]
    source: str
    at_rest: bool = False
    origins: Mapping[str, str] = MappingProxyType({})

    @property
    def crank_speed(self) -> float:
        """Speed of the one crank (rad/s), ``drive["speed"]``."""
        return self.drive["speed"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Mechanism:
    """A mechanism: its parameters, its interface and its equations.

    The state of a run is the tuple of all coordinates, all their rates, the work dissipated and the work supplied.

    Attributes
    ----------
    name : str
        As case files and messages name it.
    fmu : str
        Name of its FMU.
    title, description : str
    notes : tuple of str
        Paragraphs of the FMU's documentation.
    parameters, initial : type
        Dataclasses of its parameters, with a method ``constants`` and ``RULES``, and of its state at the start.
    published : mapping
        `PublishedSet` by name, one at least.
    freedoms : tuple of Freedom
        Any of them may turn, and any number of them.
    channels : tuple of Channel
        In the order of the FMI inputs.
    variables : tuple of Variable
        The FMI interface.
    position_parameters : tuple of str
        FMI parameters that set the configuration at the start.
    experiment : tuple of float
        Default experiment: start, stop and step (s), tolerance.
    modules : tuple of modules
        Those of the equations and of all functions that they call; the last in the package that has ``MECHANISM``.
    equations : Equations
    check_assembly : callable
        ``check_assembly(parameters, x)`` raises AssemblyError where the links cannot be joined clear of the limit.
    error_scale : callable
        ``error_scale(parameters, x)``: magnitudes of the state's components below which the integrator's error is absolute; a
        straight line of arithmetic like the equations.
    unjoined : Unjoined or None
        What is said there, of which the FMU in C says the same; None where the links can always be joined.
    switch : str
        Name of the one constant, zero or greater, on which the equations may branch: on whether it is zero. They are traced
        once for either, so that what is switched off costs nothing. Empty where there is none.
    links : tuple of Link
        Those whose masses a section can give.
    drawing : Drawing or None
        How it is drawn; None where there is no picture of it.
    cases : mapping
        Standard cases by name, in the tables of a case file: with them its FMUs are checked. None are needed.
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
    check_assembly: Callable[[Any, Sequence[float]], None]
    error_scale: Callable[[Any, Sequence[float]], tuple[float, ...]]
    unjoined: Unjoined | None = None
    switch: str = ""
    links: tuple[Link, ...] = ()
    drawing: Drawing | None = None
    cases: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __reduce__(self) -> Any:
        # by its package: a copy would be another mechanism
        package = str(self.modules[-1].__package__)
        if getattr(import_module(package), "MECHANISM", None) is not self:
            raise LinkworkError(f"this {self.name} is not the MECHANISM of {package}: another process cannot import it")
        return _load, (package,)

    def __repr__(self) -> str:
        freedoms = ", ".join(freedom.coordinate for freedom in self.freedoms)
        return f"<mechanism {self.name}: freedoms {freedoms}; inputs {', '.join(self.input_names)}>"

    @cached_property
    def size(self) -> int:
        """Number of components of the state."""
        return 2 * len(self.freedoms) + 2

    @property
    def first_set(self) -> PublishedSet:
        """The first of the published sets."""
        return next(iter(self.published.values()))

    @cached_property
    def constants(self) -> Any:
        """The type of the equations' constants."""
        return type(self.first_set.parameters.constants())

    @cached_property
    def switch_place(self) -> int:
        """Place of the switch among the constants; -1 where there is none."""
        return int(self.constants._fields.index(self.switch)) if self.switch else -1

    def switched(self, p: Sequence[float]) -> bool:
        """Whether the switch is on in constants, or in numbers that begin with them."""
        return self.switch_place >= 0 and p[self.switch_place] != 0.0

    def limit(self, x: Sequence[float], i: Any, p: Any) -> str:
        """What the motion comes to where the clearance is small, in words."""
        if self.switched(p) and abs(self.equations.clearance(x, i, p._replace(**{self.switch: 0.0}))) >= NEAR_LIMIT:
            return JAMMING
        return ASSEMBLY

    def idle(self, p: Any) -> Any:
        """What acts on the mechanism with constants p where all inputs are zero and the modes are the default ones."""
        modes = tuple(float(mode.default) for mode in self.modes)
        return self.equations.applied(modes, (0.0,) * len(self.channels), p)

    def check_state(self, parameters: Any, x: Sequence[float], i: Any, p: Any) -> None:
        """Make sure that the links can be joined and do not jam, clear of the limit of either.

        Raises
        ------
        AssemblyError
            If they cannot be joined; `JammingError` if friction may jam them.
        """
        self.check_assembly(parameters, x)
        if self.switched(p) and not self.equations.clearance(x, i, p) >= LIMIT_SINE:
            raise JammingError(f"{JAMMING} at {self.where(x)}")

    @cached_property
    def cyclic(self) -> tuple[int, ...]:
        """Numbers of the freedoms that turn as a crank does."""
        return tuple(n for n, freedom in enumerate(self.freedoms) if freedom.period > 0.0 and not freedom.swings)

    @cached_property
    def torques(self) -> tuple[int, ...]:
        """Numbers of the channels that are torques on freedoms that turn."""
        return tuple(n for n, c in enumerate(self.channels) if c.kind == "force" and c.freedom in self.cyclic)

    def channel(self, freedom: int, kind: str) -> int | None:
        """Return the number of the channel of a kind that drives a freedom directly; None where there is none."""
        found = (n for n, c in enumerate(self.channels) if c.kind == kind and c.freedom == freedom)
        return next(found, None)

    def names(self, role: str, of: str | None = None) -> tuple[str, ...]:
        """Return the names of the variables that play a role, of a freedom or a joint if one is given."""
        return tuple(v.name for v in self.variables if v.role == role and of in (None, v.of))

    @cached_property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """Names of the outputs that are the components of the force in each joint."""
        found: dict[str, tuple[str, ...]] = {}
        for v in self.variables:
            if v.role == "joint force":
                found[v.of] = (*found.get(v.of, ()), v.name)
        return found

    @cached_property
    def rules(self) -> Rules:
        """What the parameters must be."""
        rules: Rules = self.parameters.RULES  # type: ignore[attr-defined]
        return rules

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of all freedoms that have one."""
        return tuple(freedom.mode for freedom in self.freedoms if freedom.mode is not None)

    @cached_property
    def input_names(self) -> tuple[str, ...]:
        """FMI names of the inputs."""
        return tuple(channel.name for channel in self.channels)

    @cached_property
    def output_names(self) -> tuple[str, ...]:
        """FMI names of the real outputs, in the order of ``equations.outputs``."""
        return tuple(v.name for v in self.variables if v.causality == "output" and v.kind == "Real")

    @cached_property
    def mechanism_variables(self) -> dict[str, Variable]:
        """The variables that are fields of the parameters, by FMI name."""
        others = {mode.name for mode in self.modes} | {"solver.tolerance"}
        return {
            v.name: v
            for v in self.variables
            if v.causality == "parameter" and not v.name.startswith("initial.") and v.name not in others
        }

    @cached_property
    def initial_variables(self) -> dict[str, Variable]:
        """The variables of the state at the start, by the name of the field."""
        prefix = "initial."
        return {v.name.removeprefix(prefix): v for v in self.variables if v.name.startswith(prefix)}

    def commands(self, modes: Mapping[str, int]) -> tuple[int, ...]:
        """Numbers of the channels that command a rate under ``modes``, values by the name of the mode."""
        return tuple(
            number
            for number, channel in enumerate(self.channels)
            if channel.kind == "command" and self._drives(channel, modes)
        )

    def _drives(self, channel: Channel, modes: Mapping[str, int]) -> bool:
        mode = self.freedoms[channel.freedom].mode
        return mode is None or mode.arguments[modes[mode.name]] == channel.argument

    def where(self, x: Sequence[float]) -> str:
        """A configuration in words, by the freedoms' coordinates."""
        units = {v.name: v.unit for v in self.variables}
        words = []
        for freedom, value in zip(self.freedoms, x):
            unit = units[freedom.coordinate]
            in_degrees = f" ({degrees(value):.4f} deg)" if unit == "rad" else ""
            words.append(f"{freedom.coordinate.replace('.', ' ')} {value:.9g} {unit}{in_degrees}")
        return " and ".join(words)

    def state(self, initial: Any) -> State:
        """The state that ``initial`` describes, no work done yet."""
        coordinates = [float(getattr(initial, freedom.initial[0])) for freedom in self.freedoms]
        rates = [float(getattr(initial, freedom.initial[1])) for freedom in self.freedoms]
        return (*coordinates, *rates, 0.0, 0.0)


def _load(package: str) -> Mechanism:
    mechanism: Mechanism = import_module(package).MECHANISM
    return mechanism


def crank_scale(length: float, mass: float, inertia: float, crank_speed: float) -> tuple[float, ...]:
    """`Mechanism.error_scale` of a mechanism of a crank and a second freedom along a line.

    Of a crank of that length (m) and moment of inertia (kg.m2), other links of that mass (kg), and a crank speed at the
    start (rad/s).
    """
    speed = max(1.0, abs(crank_speed))
    energy = 0.5 * (inertia + mass * length * length) * speed * speed
    return (1.0, length, speed, length * speed, energy, energy)
