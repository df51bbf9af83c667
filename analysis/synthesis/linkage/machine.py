"""Compute parameters and pin forces of a machine, a linkage with material, speed and load; write it as a case file.

The plant is the model that simulates the machine: the slider-crank, or the five-bar with a slider at the rocker pivot D."""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from math import cos, pi, remainder, sin, tau
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.five_bar.dynamics import Inputs as Acting
from linkwork.five_bar.dynamics import Motion
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.slider_crank.parameters import SliderCrankParameters

from ...files import Many, Quantity, entry
from ...mechanisms import FIVE_BAR
from ...numerics import symbolic
from ...run import Inputs, parameter_symbols, simulate
from ...units import with_unit
from . import linkage as geometry
from .linkage import Linkage, SliderCrank, is_on_line
from .pivot import SecondCrank, SliderMotion

#: Links that have a mass.
WEIGHED = ("crank", "coupler", "rocker")
#: Length of the rocker that represents the guide of a slider-crank, in coupler lengths.
FAR = 1e7
#: Least natural frequency of a slider that represents a fixed pivot: in rad/s, and as a multiple of the crank's speed.
STIFF, STIFF_TURNS = 1000.0, 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineSpec:
    """Material, bar sections, slider, speed and load of a linkage; see `Linkage.to_five_bar`.

    Attributes
    ----------
    density : float
        Density of the bars (kg/m3).
    width, thickness : float
        Width and thickness of every bar (m).
    pin : float, optional
        Diameter of the holes in the drawing of the plates (m); four tenths of the width by default.
    slider_mass, slider_stiffness, slider_damping : float, optional
        Properties of the slider that carries D (kg, N/m, N.s/m); by default those of a block on a spring so stiff that D
        hardly moves.
    slider_coulomb_friction, slider_spring_free_position : float
        Coulomb friction of the slider (N); slider position at which its spring is free (m).
    gravity : float
        Acceleration of gravity (m/s2).
    speed : float
        Crank speed (rad/s).
    crank_mass, coupler_mass, rocker_mass : float, optional
        Masses that replace those from density and section (kg); the moments of inertia change in proportion.
    load : (float, float)
        Components of the force at the coupler point P along the axes of the plane (N).
    """

    density: float = entry(Quantity("kg/m**3", above=0.0), 7850.0)
    width: float = entry(Quantity("m", above=0.0), 0.02)
    thickness: float = entry(Quantity("m", above=0.0), 0.005)
    pin: float | None = entry(Quantity("m", above=0.0), None)
    slider_mass: float | None = entry(Quantity("kg", least=0.0), None)
    slider_stiffness: float | None = entry(Quantity("N/m", least=0.0), None)
    slider_damping: float | None = entry(Quantity("N.s/m", least=0.0), None)
    slider_coulomb_friction: float = entry(Quantity("N", least=0.0), 0.0)
    slider_spring_free_position: float = entry(Quantity("m"), 0.0)
    gravity: float = entry(Quantity("m/s2", least=0.0), 9.81)
    speed: float = entry(Quantity("rad/s", above=0.0), 2.0 * pi)
    crank_mass: float | None = entry(Quantity("kg", above=0.0), None)
    coupler_mass: float | None = entry(Quantity("kg", above=0.0), None)
    rocker_mass: float | None = entry(Quantity("kg", above=0.0), None)
    load: tuple[float, float] = entry(Many(Quantity("N"), length=2), (0.0, 0.0))

    def __post_init__(self) -> None:
        # in Python as in a case file: texts with a unit
        for field in fields(self):
            given = getattr(self, field.name)
            if given is not None:
                value = field.metadata["reader"](list(given) if isinstance(given, tuple) else given, field.name)
                object.__setattr__(self, field.name, value)

    @property
    def hole(self) -> float:
        """Return the diameter of the pins' holes (m)."""
        return 0.4 * self.width if self.pin is None else self.pin

    def describe(self, *, forces: bool = True) -> str:
        """Return a line that describes the bars and, with ``forces``, speed, gravity and load."""
        bars = f"bars {1e3 * self.width:g} x {1e3 * self.thickness:g} mm of {self.density:g} kg/m³, pins {1e3 * self.hole:g} mm"
        if not forces:
            return bars
        return f"{bars}; forces at {self.speed * 30.0 / pi:g} rpm, gravity {self.gravity:g} m/s²" + (
            f", {self.load[0]:g} and {self.load[1]:g} N at P" if any(self.load) else ""
        )

    def describe_masses(self) -> str:
        """Return a sentence that says where the masses come from, for the head of a file."""
        given = [f"{link}.mass" for link in (*WEIGHED, "slider") if getattr(self, f"{link}_mass") is not None]
        weighed = f"; as given: {', '.join(given)}" if given else ""
        bars = self.describe(forces=False).partition(",")[0]
        return f"masses, centres of mass and moments of inertia: {bars}{weighed}; [make] of the task changes them"

    def link_masses(self, made: Mapping[str, Any]) -> dict[str, Any]:
        """Return masses and moments of inertia of the links: those in ``made``, unless this specification gives a link's mass.

        The moment of inertia of a link with a given mass changes in proportion to its mass.
        """
        own: dict[str, Any] = {}
        for link in WEIGHED:
            mass, inertia, given = made[f"{link}_mass"], made[f"{link}_inertia"], getattr(self, f"{link}_mass")
            share = 1.0 if given is None else given / mass
            own |= {f"{link}_mass": share * mass, f"{link}_inertia": share * inertia}
        return own

    def load_components(self, c: Any, s: Any) -> tuple[Any, Any]:
        """Return the load's components along and across the ground link (N); c and s are cosine and sine of its direction."""
        x, y = self.load
        return c * x + s * y, c * y - s * x

    @property
    def block_mass(self) -> float:
        """Return the mass of the slider (kg): as given, or else that of a block of the bars' material.

        The block is four bar widths long, two bar widths wide and four bar thicknesses high.
        """
        return 32.0 * self.density * self.width**2 * self.thickness if self.slider_mass is None else self.slider_mass

    def slider_crank(self, linkage: Linkage) -> SliderCrankParameters:
        """Return the parameters of the slider-crank's plant, with the guide at right angles to the crank shaft.

        The plant's rod has its centre of mass on the line of its joints. If the coupler point is off this line, the coupler's
        centre of mass is projected onto the line.
        """
        made = self.sliding_five_bar(linkage)
        a1 = linkage.ground_angle
        return SliderCrankParameters(
            crank_length=linkage.crank_length,
            rod_length=linkage.coupler_length,
            # the common normal is from the guide to the shaft
            guide_offset=-linkage.ground_length,
            guide_twist=-0.5 * pi,
            crank_mass=made.crank_mass,
            crank_inertia=made.crank_inertia,
            crank_cog_x=made.crank_cog_distance,
            rod_mass=made.coupler_mass,
            rod_inertia=made.coupler_inertia,
            rod_cog_distance=made.coupler_cog_distance * cos(made.coupler_cog_angle),
            slider_mass=self.block_mass,
            slider_stiffness=self.slider_stiffness or 0.0,
            slider_damping=self.slider_damping or 0.0,
            slider_coulomb_friction=self.slider_coulomb_friction,
            slider_spring_free_position=self.slider_spring_free_position,
            gravity_x=-self.gravity * sin(a1),
            gravity_y=-self.gravity * cos(a1),
            assembly_branch=linkage.branch,
        )

    def sliding_five_bar(self, linkage: Linkage) -> FiveBarParameters:
        """Return the parameters of the five-bar plant for a linkage; the plant's slider at D is free to move.

        A slider-crank becomes a four-bar with a very long rocker, of `FAR` coupler lengths. The mass of its slider is at C, at
        the end of this rocker.
        """
        far, sliding, four_bar = FAR * linkage.coupler_length, isinstance(linkage, SliderCrank), linkage
        if sliding:
            away: Any = {"rocker_length": far, "ground_length": linkage.ground_length + far}
            four_bar = Linkage(**linkage.values() | away)
        made = four_bar.to_five_bar(
            density=self.density,
            section=(self.width, self.thickness),
            slider_mass=self.block_mass,
            slider_stiffness=self.slider_stiffness or 0.0,
            slider_damping=self.slider_damping or 0.0,
            slider_coulomb_friction=self.slider_coulomb_friction,
            gravity=self.gravity,
        )
        own = self.link_masses(asdict(made)) | {"slider_spring_free_position": self.slider_spring_free_position}
        return replace(made, **own | (self.slider_as_rocker(far) if sliding else {}))

    def slider_as_rocker(self, far: Any) -> dict[str, Any]:
        """Return mass, moment of inertia and centre of mass of the rocker that represents the slider of a slider-crank.

        ``far`` is the length of that rocker (m); see `sliding_five_bar`.
        """
        return {"rocker_mass": self.block_mass, "rocker_inertia": 0.0, "rocker_cog_distance": far}

    def plant(self, linkage: Linkage) -> FiveBarParameters | SliderCrankParameters:
        """Return the parameters of the plant for a linkage: `slider_crank` for a slider-crank, otherwise `five_bar`."""
        return self.slider_crank(linkage) if isinstance(linkage, SliderCrank) else self.five_bar(linkage)

    def five_bar(self, linkage: Linkage) -> FiveBarParameters:
        """Return the parameters of the five-bar plant for a linkage; the plant's slider at D is held by spring and damper."""
        free = self.sliding_five_bar(linkage)
        mass = free.slider_mass + free.rocker_mass + free.coupler_mass
        frequency = max(STIFF, STIFF_TURNS * abs(self.speed))
        stiffness = mass * frequency**2 if self.slider_stiffness is None else self.slider_stiffness
        # seven tenths of critical damping
        damping = 1.4 * (stiffness * mass) ** 0.5 if self.slider_damping is None else self.slider_damping
        return replace(free, slider_stiffness=stiffness, slider_damping=damping)


#: Bars of steel at 60 rpm.
USUAL_MAKE = MachineSpec()


FloatArray = NDArray[np.float64]
PINS = "ABCD"
#: Number of steps at which a run of the plant is sampled.
SAMPLES = 720
#: Greatest number of runs until a slider has settled.
SETTLING = 5
#: Mass of the slider that represents a fixed pivot in a run, relative to the mass of the links.
HEAVY = 1e8


def pin_functions(
    d: Any, make: MachineSpec, crank_angle: Any, *, straight: bool = False, linkage: type[Linkage] = Linkage
) -> dict[str, tuple[Any, Any]]:
    """Return the components of each pin's force along and across the ground link (N), by pin, for CasADi symbols or numbers.

    Parameters
    ----------
    d : namespace
        Dimensions and branch, by their names in `Linkage`.
    make : MachineSpec
    crank_angle : CasADi column
        th2, one or more angles (rad).
    straight : bool
        Whether the coupler point is on the line of B and C, see `link_mass_properties`.
    linkage : type
        Type of the linkage; for a slider-crank the force at D is that of the guide on the slider.
    """
    casadi = symbolic.library()
    kind, plant, law = _trace_plant()
    line = make.density * make.width * make.thickness
    links = {name: getattr(d, name) for name in ("ground_length", "crank_length", "coupler_length", "rocker_length")}
    far = FAR * d.coupler_length
    sliding = linkage is SliderCrank
    if sliding:
        links |= {"ground_length": d.ground_length + far, "rocker_length": far}
    made = law(
        d.crank_length,
        d.coupler_length,
        links["rocker_length"],
        d.point_distance,
        d.point_angle,
        line,
        make.width,
        straight,
    )
    parameters = kind(
        **_DEFAULTS
        | links
        | made
        | make.link_masses(made)
        | (make.slider_as_rocker(far) if sliding else {})
        | {
            "slider_mass": 1.0,
            "coupler_point_distance": d.point_distance,
            "coupler_point_angle": d.point_angle,
            "gravity": make.gravity,
            "ground_inclination": d.ground_angle,
            "assembly_branch": d.branch,
        }
    )
    p = parameters.constants()
    load = make.load_components(casadi.cos(d.ground_angle), casadi.sin(d.ground_angle))
    w2 = make.speed
    g = plant.position(crank_angle, 0.0, p)
    k = plant.coefficients(g, p)
    w3, w4 = k.k32 * w2, k.k42 * w2
    # the slider is held and the crank's speed constant: only centripetal accelerations remain
    e3, e4 = plant.centripetal(g, w2, w3, w4, p)
    held = Motion(w3, w4, 0.0, 0.0, e3, e4, 0.0, 0.0, 0.0, 0.0, 0.0)
    f = plant.reactions(g, (crank_angle, 0.0, w2, 0.0, 0.0, 0.0), held, Acting(1.0, 0.0, 0.0, 0.0, *load), p)
    return {"A": (f.ax, f.ay), "B": (f.bx, f.by), "C": (f.cx, f.cy), "D": (f.dx, f.dy)}


@cache
def _trace_plant() -> tuple[Any, Any, Any]:
    """Return the five-bar plant's parameter class and functions, and `link_mass_properties`, all for CasADi symbols."""
    casadi = symbolic.library()
    plant = parameter_symbols(FIVE_BAR)
    law = symbolic.symbolic_functions((geometry,), min=casadi.fmin, max=casadi.fmax)
    return type(plant.parameters), plant.functions, law.link_mass_properties


_DEFAULTS: dict[str, Any] = {
    field.name: field.default
    for field in FiveBarParameters.__dataclass_fields__.values()
    if isinstance(field.default, float)
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PinForces:
    """Forces on the pins at constant crank speed, over a turn or over the range of a task.

    Attributes
    ----------
    rotation : ndarray, shape (n,)
        Crank rotations relative to the start of the task (rad).
    force : ndarray, shape (n, 4)
        Magnitudes of the forces on the pins A to D (N).
    moved : float
        Greatest displacement of the slider that represents the fixed pivot D (m).
    """

    rotation: FloatArray
    force: FloatArray
    moved: float

    @property
    def greatest(self) -> float:
        """Return the greatest force on any pin (N)."""
        return float(self.force.max())

    @property
    def pin(self) -> str:
        """Return the letter of the pin with the greatest force."""
        return PINS[int(self.force.max(axis=0).argmax())]

    def greatest_force(self, pins: str) -> float:
        """Return the greatest force on any of the pins whose letters are in ``pins`` (N)."""
        return float(self.force[:, [PINS.index(pin) for pin in pins]].max())


def pin_forces(
    linkage: Linkage, make: MachineSpec, rotation: tuple[float, float] | None = None, *, run: bool = True
) -> PinForces:
    """Compute the forces on the pins of a linkage at constant crank speed.

    With ``run`` the compiled plant is simulated; its slider at D is so heavy that it hardly moves, and the control force
    carries the slider's weight. Otherwise the plant's equations are evaluated with the slider fixed.

    Parameters
    ----------
    linkage : Linkage
        A linkage with a fixed pivot, or a slider-crank, for which the force at D is that of the guide on the slider.
    make : MachineSpec
    rotation : (float, float), optional
        First and last crank rotation (rad); a turn by default.
    run : bool
        Whether to simulate the plant.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    AssemblyError
        If the links cannot be joined at some crank rotation.
    """
    if linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: for a moving pivot use slider.inverse_dynamics")
    begin, end = (0.0, 2.0 * pi) if rotation is None else rotation
    if not run:
        return _evaluate_forces(linkage, make, np.linspace(begin, end, SAMPLES + 1))
    made = make.sliding_five_bar(linkage)
    heavy = HEAVY * (made.crank_mass + made.coupler_mass + made.rocker_mass)
    parameters = replace(made, slider_mass=heavy, slider_stiffness=0.0, slider_damping=0.0, slider_coulomb_friction=0.0)
    x, y = make.load_components(np.cos(linkage.ground_angle), np.sin(linkage.ground_angle))
    weight = heavy * make.gravity * float(np.sin(linkage.ground_angle))
    acting = Inputs(speed=make.speed, force=weight, load_x=float(x), load_y=float(y))
    start = InitialState(crank_angle=begin + linkage.crank_phase)
    samples = np.linspace(0.0, (end - begin) / make.speed, SAMPLES + 1)
    done = simulate(parameters, acting, initial=start, samples=samples)
    if done.time[-1] < samples[-1]:
        raise InputError(
            f"the plant did not run from a crank rotation of {begin:.6g} rad to {end:.6g} rad: {done.message}"
        )
    force = np.column_stack([np.hypot(done[f"pin.{pin}.fx"], done[f"pin.{pin}.fy"]) for pin in PINS])
    moved = float(np.abs(done["slider.position"]).max())
    return PinForces(rotation=begin + make.speed * done.time, force=force, moved=moved)


def _evaluate_forces(linkage: Linkage, make: MachineSpec, rotation: FloatArray) -> PinForces:
    """Compute the pin forces at crank rotations from the equations of the five-bar plant, with the slider at D fixed."""
    casadi, d = symbolic.library(), SimpleNamespace(**linkage.values())
    straight = is_on_line(linkage.coupler_length, linkage.point_distance, linkage.point_angle)
    th2 = casadi.DM(linkage.crank_angle(rotation))
    found = pin_functions(d, make, th2, straight=straight, linkage=type(linkage))
    force = np.column_stack([np.hypot(*(np.array(f).ravel() for f in found[pin])) for pin in PINS])
    if not np.isfinite(force).all():
        at = float(rotation[np.argmin(np.isfinite(force).all(axis=1))])
        raise AssemblyError(f"the links cannot be joined at a crank rotation of {at:.6g} rad")
    return PinForces(rotation=rotation, force=force, moved=0.0)


def settle_slider(
    parameters: FiveBarParameters, acting: Inputs, crank_angle: float, duration: float
) -> tuple[float, float]:
    """Return position (m) and velocity (m/s) of a slider that a run of ``duration`` (s) returns to; zeros if it has none.

    With a turn at constant speed this is the steady motion at ``crank_angle``, with the crank at rest the equilibrium. The run
    is repeated at most `SETTLING` times until the slider is within a millionth of its travel. SciPy's method is used: to
    compile the solver would take longer.
    """
    slider = 0.0, 0.0
    for _ in range(SETTLING):
        start = InitialState(crank_angle=crank_angle, slider_position=slider[0], slider_velocity=slider[1])
        run = simulate(parameters, acting, initial=start, stop_time=duration, step=duration / 64.0, method="LSODA")
        if run.status:
            break
        before, slider = slider, (float(run["slider.position"][-1]), float(run["slider.velocity"][-1]))
        swept = max(np.abs(run["slider.position"]).max(), np.abs(run["slider.velocity"]).max() * duration / (2.0 * pi))
        if max(abs(slider[0] - before[0]), abs(slider[1] - before[1]) * duration / (2.0 * pi)) <= 1e-6 * swept:
            return slider
    return 0.0, 0.0


# The linkage as tables of a case file, from which it can be simulated, exported as an FMU and shown in the studio


def description(
    linkage: Linkage, make: MachineSpec, *, rotation: float = 0.0, direction: float = 1.0
) -> dict[str, Any]:
    """Return the table ``[linkage]`` with the description of a four-bar, a slider-crank or a five-bar.

    A rocker pivot that moves on a guide, or on a crank without gears, is a second degree of freedom. For such a linkage
    `drives` returns the speeds of crank and pivot.

    Parameters
    ----------
    linkage : Linkage
    make : MachineSpec
        Bars, gravity and the speed of the crank.
    rotation : float
        Rotation of the input shaft at the start (rad).
    direction : float
        Sense in which the crank turns: +1 counter-clockwise, -1 clockwise.
    """
    a1, shaft = linkage.ground_angle, complex(linkage.pivot_x, linkage.pivot_y)
    end = shaft + rect(linkage.ground_length, a1)
    bodies = {"crank": _bar_table("AB", linkage.crank_length, make, make.crank_mass)}
    bodies["coupler"] = _bar_table("BC", linkage.coupler_length, make, make.coupler_mass)
    if linkage.point_distance and not linkage.point_is_pin:
        point = rect(linkage.point_distance, linkage.point_angle)
        bodies["coupler"] |= {"points": {"P": _point_entry(point)}, **_coupler_masses(linkage, make)}
        del bodies["coupler"]["section"]
    # the angle is not wrapped to a turn, because the position of gears depends on whole turns
    start = a1 + float(linkage.crank_angle(rotation))
    crank = {"joint": "A", "start": with_unit(start, "rad"), "speed": with_unit(direction * make.speed, "rad/s")}
    tables: dict[str, Any] = {
        "name": "found-linkage",
        "source": "found by synthesis",
        "gravity": with_unit(make.gravity, "m/s2"),
        "ground": {
            "A": _point_entry(shaft),
            "E" if linkage.pivot or isinstance(linkage, SliderCrank) else "D": _point_entry(end),
        },
        "bodies": bodies,
        "freedoms": {"crank": crank},
        "assembly": {"C": linkage.branch},
    }
    if isinstance(linkage, SliderCrank):
        bodies["block"] = {"points": {"C": [0, 0]}, "mass": with_unit(make.block_mass, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": with_unit(a1 + 0.5 * pi, "rad")}}
    else:
        bodies["rocker"] = _bar_table("DC", linkage.rocker_length, make, make.rocker_mass)
    second = linkage.pivot
    if isinstance(second, SliderMotion):
        along = with_unit(a1 + second.guide_angle, "rad")
        bodies["block"] = {"points": {"D": [0, 0]}, "mass": with_unit(make.block_mass, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": along}}
        position = with_unit(float(second.series(rotation)), "m")
        tables["freedoms"]["pivot"] = {"joint": "guide", "start": position, "driven": True}
    elif second is not None:
        bodies["second"] = _bar_table("ED", second.length, make, None)
    if isinstance(second, SecondCrank) and second.series.order:
        angle = with_unit(a1 + float(second.angle(rotation)), "rad")
        tables["freedoms"]["pivot"] = {"joint": "E", "start": angle, "driven": True}
    elif isinstance(second, SecondCrank):
        # angle of the second crank while the first crank points along x
        phase = a1 + second.phase - second.ratio * (a1 + linkage.crank_phase)
        tables["gears"] = {
            "teeth": {
                "bodies": ["crank", "second"],
                "ratio": second.ratio,
                "phase": with_unit(remainder(phase, tau), "rad"),
            }
        }
    if "slides" in tables and (spring := _spring_table(make)):
        tables["springs"] = {"slider": {"at": "guide"} | spring}
    if acting := loads(linkage, make):
        tables["loads"] = list(acting)
    return tables


def _spring_table(make: MachineSpec) -> dict[str, Any]:
    """Return spring, damper and friction of the slider as a description has them; without those that are zero."""
    values = {
        "stiffness": (make.slider_stiffness, "N/m"),
        "free": (make.slider_stiffness and make.slider_spring_free_position, "m"),
        "damping": (make.slider_damping, "N.s/m"),
        "friction": (make.slider_coulomb_friction, "N"),
    }
    return {name: with_unit(value, unit) for name, (value, unit) in values.items() if value}


def loads(linkage: Linkage, make: MachineSpec) -> dict[str, Any]:
    """Return the table with the load of ``make``, by the name of the point on which it acts; empty without a load."""
    if not any(make.load):
        return {}
    # the coupler point may be one of the coupler's pins
    point = "C" if linkage.point_is_pin else "P" if linkage.point_distance else "B"
    return {point: {f"load_{axis}": with_unit(force, "N") for axis, force in zip("xy", make.load)}}


def drives(linkage: Linkage, make: MachineSpec, *, rotation: float = 0.0, direction: float = 1.0) -> dict[str, Any]:
    """Return the drive tables of a linkage whose pivot is a second degree of freedom: speeds of crank and pivot over time.

    The arguments are those of `description`. For any other linkage the result is empty, because `description` contains the
    crank speed.
    """
    pivot = linkage.pivot
    sliding = isinstance(pivot, SliderMotion)
    if pivot is None or not (sliding or pivot.series.order):
        return {}
    speed = direction * make.speed
    rate = speed / linkage.turns
    slope, unit = pivot.series.derivative(), "m/s" if sliding else "rad/s"
    k = np.arange(1, slope.order + 1)
    waves = {
        "kind": "harmonics",
        "amplitudes": [with_unit(rate * a, unit) for a in slope.amplitudes[1:]],
        "frequencies": [with_unit(w, "rad/s") for w in rate * k],
        "phases": [with_unit(a, "rad") for a in k * rotation - np.arctan2(slope.sin, slope.cos)[1:]],
    }
    if isinstance(pivot, SecondCrank):
        waves["mean"] = with_unit(speed * pivot.ratio, unit)
    moved = waves if pivot.series.order else with_unit(0.0, unit)
    return {"crankDrive": {"speed": with_unit(speed, "rad/s")}, "pivotDrive": {"speed": moved}}


def _coupler_masses(linkage: Linkage, make: MachineSpec) -> dict[str, Any]:
    """Return mass, centre of mass and moment of inertia of a coupler with an arm to its point; see `link_mass_properties`."""
    line = make.density * make.width * make.thickness
    r, a2 = linkage.point_distance, linkage.point_angle
    straight = is_on_line(linkage.coupler_length, r, a2)
    links = linkage.crank_length, linkage.coupler_length, linkage.rocker_length
    made = geometry.link_mass_properties(*links, r, a2, line, make.width, straight)
    made |= make.link_masses(made)
    centre = rect(made["coupler_cog_distance"], made["coupler_cog_angle"])
    return {
        "mass": with_unit(made["coupler_mass"], "kg"),
        "cog": _point_entry(centre),
        "inertia": with_unit(made["coupler_inertia"], "kg.m2"),
    }


def _point_entry(z: complex) -> list[Any]:
    """Return a point as a case file gives it, [x, y] with units; exact zeros are the number 0."""
    return [0 if c == 0.0 else with_unit(c, "m") for c in (z.real, z.imag)]


def _bar_table(ends: str, length: float, make: MachineSpec, mass: float | None) -> dict[str, Any]:
    """Return the table of a bar with the section of ``make``, and with ``mass`` (kg) if it is given."""
    section = {"kind": "bar", "width": with_unit(make.width, "m"), "thickness": with_unit(make.thickness, "m")}
    table = {"bar": list(ends), "length": with_unit(length, "m"), "section": section | {"material": make.density}}
    return table if mass is None else table | {"mass": with_unit(mass, "kg")}
