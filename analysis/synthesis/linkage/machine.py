"""Analyse a linkage as a machine, with material, speed and load: plant parameters, pin forces, limit positions.

The plant is the model that simulates the machine: the slider-crank, or the five-bar with a slider at the rocker pivot D. In a
dead centre crank and coupler are collinear, and rocker or slider rest at the end of their travel. In a toggle coupler and
rocker are collinear, or the coupler is perpendicular to the guide, and the crank can turn no further. See R. L. Norton, Design
of Machinery, 6th ed., 2020, chapters 2, 3 and 6.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from math import acos, atan2, cos, hypot, inf, pi, sin
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, ParameterError
from linkwork.five_bar import kinematics
from linkwork.five_bar.dynamics import Inputs, Motion
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.slider_crank.parameters import SliderCrankParameters

from ...files import Many, Quantity, entry
from ...mechanisms import FIVE_BAR
from ...numerics import symbolic
from ...run import parameter_symbols
from .linkage import LINKS, FiveBar, Linkage, SliderCrank, SliderMotion

#: Links that have a mass.
WEIGHED = ("crank", "coupler", "rocker")
#: Length of the rocker that represents the guide of a slider-crank, in coupler lengths.
FAR = 1e7
#: Least natural frequency of a slider that represents a fixed pivot: in rad/s, and as a multiple of the crank's speed.
STIFF, STIFF_TURNS = 1000.0, 50.0


def bar_mass_properties(length: Any, line: float, width: float) -> tuple[Any, Any]:
    """Return the mass of a rectangular bar (kg) and its moment of inertia about its centre (kg.m2).

    ``length`` is the distance between its pins (m), ``line`` the mass per length (kg/m), ``width`` its width (m).
    """
    mass = line * length
    return mass, mass * (length * length + width * width) / 12.0


def link_mass_properties(
    l2: Any, l3: Any, l4: Any, r: Any, a2: Any, line: float, width: float, straight: bool
) -> dict[str, Any]:
    """Return masses, moments of inertia and centres of mass of the links, by their names in `FiveBarParameters`.

    Crank and rocker are bars between their pins. The coupler consists of two bars, B to C and B to P; if P is on the line of B
    and C (``straight``), it is one bar over the whole length.

    Parameters
    ----------
    l2, l3, l4, r, a2 : float
        Lengths of crank, coupler and rocker; distance and direction of the coupler point (m, rad).
    line : float
        Mass of a bar per length (kg/m).
    width : float
        Width of a bar (m).
    straight : bool
        Whether P is on the line of B and C.
    """
    m2, i2 = bar_mass_properties(l2, line, width)
    m4, i4 = bar_mass_properties(l4, line, width)
    if straight:
        end = r * cos(a2)
        low, high = min(0.0, end), max(l3, end)
        m3, i3 = bar_mass_properties(high - low, line, width)
        x, y = 0.5 * (low + high), 0.0
    else:
        (along, own), (aside, inertia) = bar_mass_properties(l3, line, width), bar_mass_properties(r, line, width)
        bx, px, py = 0.5 * l3, 0.5 * r * cos(a2), 0.5 * r * sin(a2)
        m3 = along + aside
        x, y = (along * bx + aside * px) / m3, aside * py / m3
        i3 = own + along * ((bx - x) ** 2 + y**2) + inertia + aside * ((px - x) ** 2 + (py - y) ** 2)
    return {
        "crank_mass": m2,
        "crank_inertia": i2 + m2 * (0.5 * l2) ** 2,
        "crank_cog_distance": 0.5 * l2,
        "coupler_mass": m3,
        "coupler_inertia": i3,
        "coupler_cog_distance": hypot(x, y),
        "coupler_cog_angle": atan2(y, x),
        "rocker_mass": m4,
        "rocker_inertia": i4,
        "rocker_cog_distance": 0.5 * l4,
    }


def is_on_line(l3: float, r: float, a2: float) -> bool:
    """Return whether the coupler point, with the polar coordinates r (m) and a2 (rad) from B, is on the line of B and C."""
    return abs(sin(a2)) * r <= 1e-9 * l3


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineSpec:
    """Material, bar sections, slider, speed and load of a linkage.

    Attributes
    ----------
    density : float
        Density of the bars (kg/m3).
    width, thickness : float
        Width and thickness of every bar (m).
    pin : float, optional
        Diameter of the holes in the drawing of the plates (m); four tenths of the width by default.
    slider_mass, slider_stiffness, slider_damping : float, optional
        Properties of the slider that carries D (kg, N/m, N.s/m); by default the properties of a block on a spring so stiff that
        D hardly moves. A slider-crank's slider has by default the mass of this block, and neither spring nor damper.
    slider_coulomb_friction : float
        Coulomb friction of the slider (N).
    slider_spring_free_position : float
        Slider position at which the slider's spring exerts no force (m).
    gravity : float
        Acceleration of gravity (m/s2).
    speed : float
        Crank speed (rad/s).
    crank_mass, coupler_mass, rocker_mass : float, optional
        Masses of links that replace the masses from density and section (kg); the moments of inertia change in proportion.
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

    def describe(self, *, forces: bool = True, linkage: Linkage | None = None) -> str:
        """Return a line that describes the bars and, with ``forces``, speed, gravity and load.

        If the ``linkage`` is given, the line says on which of its points the load acts.
        """
        bars = f"bars {1e3 * self.width:g} x {1e3 * self.thickness:g} mm of {self.density:g} kg/m³, pins {1e3 * self.hole:g} mm"
        if not forces:
            return bars
        place = "at P"
        if linkage is not None and (linkage.point_is_pin or linkage.point_distance == 0.0):
            place = "on the slider" if linkage.point_is_pin else "at B"
        return f"{bars}; forces at {self.speed * 30.0 / pi:g} rpm, gravity {self.gravity:g} m/s²" + (
            f", {self.load[0]:g} and {self.load[1]:g} N {place}" if any(self.load) else ""
        )

    def describe_masses(self) -> str:
        """Return a sentence that says where the masses come from, for the head of a file."""
        given = [f"{link}.mass" for link in (*WEIGHED, "slider") if getattr(self, f"{link}_mass") is not None]
        weighed = f"; as given: {', '.join(given)}" if given else ""
        bars = self.describe(forces=False).partition(",")[0]
        return f"masses, centres of mass and moments of inertia: {bars}{weighed}; [make] of the task changes them"

    def link_masses(self, made: Mapping[str, Any]) -> dict[str, Any]:
        """Return masses and moments of inertia of the links: as in ``made``, but with each mass that this specification gives.

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
        """Return the mass of the slider (kg): as given, or else the mass of a block of the bars' material.

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

        The model's x axis is the ground link; its inclination to the horizontal is the ground angle. A fixed rocker pivot
        becomes a slider: give the slider a spring, or hold it by a force. A slider-crank becomes a four-bar with a very long
        rocker, of `FAR` coupler lengths. The mass of its slider is at C, at the end of this rocker.

        Raises ParameterError if the pivot is on a second crank.
        """
        if isinstance(linkage, FiveBar):
            raise ParameterError(
                "kind", linkage.kind, "be another: the plant of the five-bar slider has no second crank"
            )
        straight = is_on_line(linkage.coupler_length, linkage.point_distance, linkage.point_angle)
        return FiveBarParameters(
            **self.plant_values(linkage, straight, isinstance(linkage, SliderCrank), link_mass_properties),
            slider_mass=self.block_mass,
            slider_guide_angle=linkage.pivot.guide_angle if isinstance(linkage.pivot, SliderMotion) else 0.0,
            slider_stiffness=self.slider_stiffness or 0.0,
            slider_damping=self.slider_damping or 0.0,
            slider_coulomb_friction=self.slider_coulomb_friction,
            slider_spring_free_position=self.slider_spring_free_position,
        )

    def plant_values(self, d: Any, straight: bool, sliding: bool, law: Callable[..., dict[str, Any]]) -> dict[str, Any]:
        """Return the parameters of the five-bar plant for a linkage, by name, without the parameters of its slider.

        Parameters
        ----------
        d : namespace
            Dimensions and branch, by their names in `Linkage`: numbers or CasADi symbols.
        straight : bool
            Whether the coupler point is on the line of B and C.
        sliding : bool
            Whether the linkage is a slider-crank; see `sliding_five_bar`.
        law : callable
            `link_mass_properties`, for numbers or symbols.
        """
        links, far = {name: getattr(d, name) for name in LINKS}, FAR * d.coupler_length
        if sliding:
            links |= {"ground_length": d.ground_length + far, "rocker_length": far}
        r, a2, line = d.point_distance, d.point_angle, self.density * self.width * self.thickness
        made = law(d.crank_length, d.coupler_length, links["rocker_length"], r, a2, line, self.width, straight)
        made |= self.link_masses(made)
        if sliding:
            made |= {"rocker_mass": self.block_mass, "rocker_inertia": 0.0, "rocker_cog_distance": far}
        placed = {"ground_inclination": d.ground_angle, "assembly_branch": d.branch, "gravity": self.gravity}
        return links | made | placed | {"coupler_point_distance": r, "coupler_point_angle": a2}

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
#: Number of equal steps of the crank, at the ends of which pin forces are computed.
SAMPLES = 720


def pin_functions(
    d: Any,
    make: MachineSpec,
    crank_angle: Any,
    *,
    straight: bool = False,
    linkage: type[Linkage] = Linkage,
    on_slider: bool = False,
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
        Type of the linkage; for a slider-crank the force at D is the force of the guide on the slider.
    on_slider : bool
        Whether the coupler point is the pin C of a slider-crank, whose slider then carries the load.
    """
    casadi = symbolic.library()
    kind, plant, law = _trace_plant()
    values = make.plant_values(d, straight, linkage is SliderCrank, law)
    parameters = kind(**_DEFAULTS | values | {"slider_mass": 1.0})
    p = parameters.constants()
    load = make.load_components(casadi.cos(d.ground_angle), casadi.sin(d.ground_angle))
    w2 = make.speed
    g = plant.position(crank_angle, 0.0, p)
    k = plant.coefficients(g, p)
    w3, w4 = k.k32 * w2, k.k42 * w2
    # the slider is held and the crank's speed constant: only centripetal accelerations remain
    e3, e4 = plant.centripetal(g, w2, w3, w4, p)
    held = Motion(w3, w4, 0.0, 0.0, e3, e4, 0.0, 0.0, 0.0, 0.0, 0.0)
    f = plant.reactions(g, (crank_angle, 0.0, w2, 0.0, 0.0, 0.0), held, Inputs(1.0, 0.0, 0.0, 0.0, *load), p)
    # the plant's load is on the coupler; a load on the slider goes through the pin
    through = load if on_slider else (0.0, 0.0)
    return {"A": (f.ax, f.ay), "B": (f.bx, f.by), "C": (f.cx + through[0], f.cy + through[1]), "D": (f.dx, f.dy)}


@cache
def _trace_plant() -> tuple[Any, Any, Any]:
    """Return the five-bar plant's parameter class and functions, and `link_mass_properties`, all for CasADi symbols."""
    casadi = symbolic.library()
    plant = parameter_symbols(FIVE_BAR)
    law = symbolic.symbolic_functions((sys.modules[__name__],), min=casadi.fmin, max=casadi.fmax)
    return type(plant.parameters), plant.functions, law.link_mass_properties


_DEFAULTS: dict[str, Any] = {f.name: f.default for f in fields(FiveBarParameters) if isinstance(f.default, float)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PinForces:
    """Forces on the pins at constant crank speed, over a turn or over the range of a task.

    Attributes
    ----------
    rotation : ndarray, shape (n,)
        Crank rotations relative to the start of the task (rad).
    force : ndarray, shape (n, 4)
        Magnitudes of the forces on the pins A to D (N).
    """

    rotation: FloatArray
    force: FloatArray

    @property
    def greatest(self) -> float:
        """Return the greatest force on any pin (N)."""
        return float(self.force.max())

    @property
    def pin(self) -> str:
        """Return the letter of the pin with the greatest force."""
        return PINS[int(self.force.max(axis=0).argmax())]


def pin_forces(linkage: Linkage, make: MachineSpec, rotation: tuple[float, float] | None = None) -> PinForces:
    """Compute the forces on the pins of a linkage at constant crank speed, from the equations of the five-bar plant.

    Parameters
    ----------
    linkage : Linkage
        A linkage with a fixed pivot, or a slider-crank, for which the force at D is the force of the guide on the slider.
    make : MachineSpec
    rotation : (float, float), optional
        First and last crank rotation (rad); a turn by default.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    AssemblyError
        If the links cannot be joined at some crank rotation.
    """
    if linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: for a moving pivot use slider.inverse_dynamics")
    at = np.linspace(*((0.0, 2.0 * pi) if rotation is None else rotation), SAMPLES + 1)
    casadi, d = symbolic.library(), SimpleNamespace(**linkage.values())
    straight = is_on_line(linkage.coupler_length, linkage.point_distance, linkage.point_angle)
    th2, carries = casadi.DM(linkage.crank_angle(at)), linkage.point_is_pin
    found = pin_functions(d, make, th2, straight=straight, linkage=type(linkage), on_slider=carries)
    force = np.column_stack([np.hypot(*(np.array(f).ravel() for f in found[pin])) for pin in PINS])
    joined = np.isfinite(force).all(axis=1)
    if not joined.all():
        raise AssemblyError(f"the links cannot be joined at a crank rotation of {float(at[joined.argmin()]):.6g} rad")
    return PinForces(rotation=at, force=force)


# Limit positions and mechanical advantage


def dead_centres(linkage: Linkage) -> tuple[float, ...]:
    """Return the crank rotations of the dead centres, within a turn from 0 (rad), in increasing order; empty if there are none.

    Raises ParameterError if the rocker pivot moves.
    """
    _require_fixed_pivot(linkage)
    l2, l3 = linkage.crank_length, linkage.coupler_length
    found = []
    # distance of C from A with coupler and crank in line, stretched and folded
    for reach in (l3 + l2, l3 - l2):
        if reach == 0.0:
            continue
        # cosine of the coupler's direction, which points to the side of the assembly
        cosine = _linear_root(partial(linkage.dead_gap, linkage, reach))
        if abs(cosine) > 1.0:
            continue
        th3 = linkage.branch * acos(cosine)
        found.append(th3 if reach == l3 + l2 else th3 + pi)
    return tuple(sorted((th2 - linkage.crank_phase) % (2.0 * pi) for th2 in found))


def toggles(linkage: Linkage) -> tuple[float, ...]:
    """Return the crank rotations of the toggles, within a turn from 0 (rad); empty if the crank can turn fully.

    With a moving rocker pivot the results are rotations of the input shaft, which turns once per period of the linkage.
    """
    if linkage.pivot is not None:
        return _toggles_by_roots(linkage)
    found = []
    for side in (1.0, -1.0):
        cosine = _linear_root(partial(linkage.toggle_gap, linkage, side=side))
        if abs(cosine) <= 1.0:
            found += [acos(cosine), -acos(cosine)]
    return tuple(sorted((th2 - linkage.crank_phase) % (2.0 * pi) for th2 in found))


def _toggles_by_roots(linkage: Linkage) -> tuple[float, ...]:
    """Find the rotations at which the cosine of the angle between coupler and rocker passes -1 or 1."""
    from scipy.optimize import brentq

    def excess_of_cosine(phi: Any) -> Any:
        return np.abs(linkage.cosine_at_c(linkage.reach(phi))) - 1.0

    phi = np.linspace(0.0, 2.0 * pi, 1441)
    off = excess_of_cosine(phi)
    passed = np.flatnonzero(np.sign(off[1:]) != np.sign(off[:-1]))
    return tuple(float(brentq(excess_of_cosine, phi[k], phi[k + 1], xtol=1e-13)) for k in passed)


def time_ratio(linkage: Linkage) -> float | None:
    """Return the duration of the slow swing or stroke divided by the duration of the quick one; at least 1.

    The crank turns at constant speed. The result is None if the crank cannot turn fully, or if the rocker turns fully, too.

    Raises ParameterError if the rocker pivot moves.
    """
    rests = dead_centres(linkage)
    if len(rests) != 2 or not linkage.turns_fully:
        return None
    way = rests[1] - rests[0]
    return max(way, 2.0 * pi - way) / min(way, 2.0 * pi - way)


def mechanical_advantage(linkage: Linkage, rotation: ArrayLike) -> FloatArray:
    """Return the torque on the rocker divided by the torque on the crank, without friction and masses.

    For a slider-crank the mechanical advantage is the force on the slider divided by the force on the crank pin perpendicular
    to the crank, which equals the speed of the pin divided by the speed of the slider. The mechanical advantage is infinite in
    a dead centre, zero in a toggle, and NaN if the links cannot be joined. The result has the shape of ``rotation``, the crank
    rotations (rad).

    Raises ParameterError if the rocker pivot moves.
    """
    _require_fixed_pivot(linkage)
    phi = np.atleast_1d(np.asarray(rotation, dtype=float))
    th2 = linkage.crank_angle(phi)
    places: Any = (np.cos(th2), np.sin(th2), *linkage.directions(phi))
    g = kinematics.Position(*places)
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = linkage.driven_speed(g, linkage.crank_length, linkage.coupler_length, linkage.rocker_length)
        ratio = np.where(speed == 0.0, inf, 1.0 / speed)
    return ratio.reshape(np.shape(rotation))


def _require_fixed_pivot(linkage: Linkage) -> None:
    if linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: with a moving pivot no link rests in a dead centre")


def _linear_root(gap: Callable[[float], float]) -> float:
    """Return the cosine at which ``gap``, a linear function of the cosine, is zero."""
    return gap(0.0) / (gap(0.0) - gap(1.0))
