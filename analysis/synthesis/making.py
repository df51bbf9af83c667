"""What a linkage is made of, how fast it runs and what loads it: the plant's parameters, and a case that runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from math import cos, pi, remainder, sin, tau
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.slider_crank.parameters import SliderCrankParameters

from ..files import Many, Quantity, entry
from ..run import parameters_to
from ..units import with_unit
from .linkage import Linkage

if TYPE_CHECKING:
    from .solution import Solution

#: Links that have a mass.
LINKS = ("crank", "coupler", "rocker")
#: Distance of the rocker pivot that stands for one at infinity, in couplers.
FAR = 1e7
#: Stiffness of the slider that stands for a fixed pivot: natural frequency (rad/s), or multiples of the crank's speed.
STIFF, STIFF_TURNS = 1000.0, 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Make:
    """What the linkage is made of, and how fast it runs; see `Linkage.to_five_bar`.

    Attributes
    ----------
    density : float
        kg/m3.
    width, thickness : float
        Of every bar (m).
    pin : float, optional
        Diameter of the holes in the drawing of the plates (m); four tenths of the width by default.
    slider_mass, slider_stiffness, slider_damping : float, optional
        Of the slider that carries D (kg, N/m, N.s/m); by default of a block, held so stiffly that it stands for a fixed pivot.
    slider_coulomb_friction : float
        N.
    gravity : float
        m/s2.
    speed : float
        Of the crank (rad/s).
    crank_mass, coupler_mass, rocker_mass : float, optional
        In the place of what density and section make of a link (kg); its moment of inertia in proportion.
    load : (float, float)
        Force at the coupler point P, in the plane's own directions (N).
    """

    density: float = entry(Quantity("kg/m**3", above=0.0), 7850.0)
    width: float = entry(Quantity("m", above=0.0), 0.02)
    thickness: float = entry(Quantity("m", above=0.0), 0.005)
    pin: float | None = entry(Quantity("m", above=0.0), None)
    slider_mass: float | None = entry(Quantity("kg", least=0.0), None)
    slider_stiffness: float | None = entry(Quantity("N/m", least=0.0), None)
    slider_damping: float | None = entry(Quantity("N.s/m", least=0.0), None)
    slider_coulomb_friction: float = entry(Quantity("N", least=0.0), 0.0)
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
        """Diameter of the pins' holes (m)."""
        return 0.4 * self.width if self.pin is None else self.pin

    def describe(self, *, forces: bool = True) -> str:
        """Bars and, of forces, the speed in a line, for a sheet."""
        bars = f"bars {1e3 * self.width:g} x {1e3 * self.thickness:g} mm of {self.density:g} kg/m³, pins {1e3 * self.hole:g} mm"
        if not forces:
            return bars
        return f"{bars}; forces at {self.speed * 30.0 / pi:g} rpm, gravity {self.gravity:g} m/s²" + (
            f", {self.load[0]:g} and {self.load[1]:g} N at P" if any(self.load) else ""
        )

    def weighed(self, made: Mapping[str, Any]) -> dict[str, Any]:
        """Masses and moments of inertia of `masses.bodies`, of links with a mass of their own by that."""
        own: dict[str, Any] = {}
        for link in LINKS:
            mass, inertia, given = made[f"{link}_mass"], made[f"{link}_inertia"], getattr(self, f"{link}_mass")
            share = 1.0 if given is None else given / mass
            own |= {f"{link}_mass": share * mass, f"{link}_inertia": share * inertia}
        return own

    def load_along(self, c: Any, s: Any) -> tuple[Any, Any]:
        """The load at P along and across a ground link of this cosine and sine of its direction (N)."""
        x, y = self.load
        return c * x + s * y, c * y - s * x

    @property
    def block(self) -> float:
        """Mass of a slider (kg): as given, or of a block of four widths by two widths by four thicknesses."""
        return 32.0 * self.density * self.width**2 * self.thickness if self.slider_mass is None else self.slider_mass

    def slider_crank(self, linkage: Linkage) -> SliderCrankParameters:
        """Parameters of the slider-crank's plant, its guide at right angles to the crank shaft.

        Its rod has its mass on the line of its joints: an arm to a coupler point off that line counts where it projects to.
        """
        made = self.moving(linkage)
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
            slider_mass=self.block,
            slider_stiffness=self.slider_stiffness or 0.0,
            slider_damping=self.slider_damping or 0.0,
            slider_coulomb_friction=self.slider_coulomb_friction,
            gravity_x=-self.gravity * sin(a1),
            gravity_y=-self.gravity * cos(a1),
            assembly_branch=linkage.branch,
        )

    def moving(self, linkage: Linkage) -> FiveBarParameters:
        """Parameters of the plant for a linkage, its slider free to be moved.

        A slider-crank is a four-bar whose rocker pivot is `FAR` away, its slider the mass at the rocker's end.
        """
        far = FAR * linkage.coupler_length
        four_bar = linkage
        if linkage.slides:
            four_bar = replace(linkage, rocker_length=far, ground_length=linkage.ground_length + far)
        made = four_bar.to_five_bar(
            density=self.density,
            section=(self.width, self.thickness),
            slider_mass=self.block,
            slider_stiffness=self.slider_stiffness or 0.0,
            slider_damping=self.slider_damping or 0.0,
            slider_coulomb_friction=self.slider_coulomb_friction,
            gravity=self.gravity,
        )
        return replace(made, **self.weighed(asdict(made)) | (self.sliding(far) if linkage.slides else {}))

    def sliding(self, far: Any) -> dict[str, Any]:
        """What stands for the rocker of a slider-crank in the plant, its pivot so far away (m): the slider at its end."""
        return {"rocker_mass": self.block, "rocker_inertia": 0.0, "rocker_cog_distance": far}

    def five_bar(self, solution: Solution) -> FiveBarParameters:
        """Parameters of the plant for a solution, its slider held."""
        free = self.moving(solution.linkage)
        mass = free.slider_mass + free.rocker_mass + free.coupler_mass
        frequency = max(STIFF, STIFF_TURNS * abs(self.speed))
        stiffness = mass * frequency**2 if self.slider_stiffness is None else self.slider_stiffness
        # seven tenths of critical
        damping = 1.4 * (stiffness * mass) ** 0.5 if self.slider_damping is None else self.slider_damping
        return replace(free, slider_stiffness=stiffness, slider_damping=damping)

    def run_case(self, solution: Solution, title: str) -> dict[str, Any]:
        """Tables of a case file that runs the linkage through its task at constant speed; see `docs/case-files.md`.

        Of a slider-crank one of the slider-crank's plant, see `slider_crank`.
        """
        at = solution.evaluation.rotation
        start = (0.0 if at is None else float(at[0])) + solution.linkage.crank_phase
        run: dict[str, Any] = {"revolutions": 2.0}
        if not solution.verdicts.full_turn and at is not None:
            # a crank that cannot turn fully: from the first target to the last
            run = {"stop_time": with_unit(float(np.ptp(at)) / self.speed, "s")}
        linkage = solution.linkage
        across, along = self.load_along(cos(linkage.ground_angle), sin(linkage.ground_angle))
        load: Any = {"fx": with_unit(across, "N"), "fy": with_unit(along, "N")}
        if linkage.slides:
            # at the slider alone, which the plant loads along its guide
            load = with_unit(along if linkage.slider_is_point else 0.0, "N")
        return {
            "title": title,
            **parameters_to(self.slider_crank(linkage) if linkage.slides else self.five_bar(solution)),
            "initial": {"crank_angle": with_unit(remainder(start, tau), "rad")},
            "drive": {"speed": with_unit(direction(solution) * self.speed, "rad/s")},
            **({"load": load} if any(self.load) else {}),
            "run": run,
        }


#: Bars of steel at 60 rpm.
USUAL_MAKE = Make()


def direction(solution: Solution) -> float:
    """The way in which the crank turns over the task: 1 counter-clockwise, -1 clockwise."""
    at = solution.evaluation.rotation
    return -1.0 if at is not None and len(at) > 1 and at[-1] < at[0] else 1.0
