"""Parameters of the five-bar slider: validated, in SI, named as in the FMI contract."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, sin
from typing import ClassVar, NamedTuple

from ..parameters import CheckedParameters, CheckedState, LowerBound, Rules


class Constants(NamedTuple):
    """Constants of the equations, in thesis symbols, derived once from `FiveBarParameters`.

    ``mx3, my3`` are m3 times the components of the centre of mass along and across the coupler, and so on; ``i2b`` is
    I_A + m3 l2^2, ``i3b`` the coupler's moment of inertia about B, ``i4d`` the rocker's about D; ``gx, gy`` gravity;
    ``ca, sa`` the guide's direction. ``rough`` is mug + ra + rb + rc + rd, used only as a switch: it is zero if no friction
    depends on the joint forces.
    """

    l1: float
    l2: float
    l3: float
    l4: float
    ca: float
    sa: float
    branch: float
    m2: float
    m3: float
    m4: float
    m5: float
    m45: float
    mx2: float
    my2: float
    mx3: float
    my3: float
    mx4: float
    my4: float
    i2b: float
    i3b: float
    i4d: float
    k: float
    u0: float
    mu: float
    fc: float
    mug: float
    ra: float
    rb: float
    rc: float
    rd: float
    rough: float
    xp: float
    yp: float
    gx: float
    gy: float


def _crank_inertia_of_mass(p: FiveBarParameters) -> float:
    # with an allowance for the rounding of a printed moment of inertia
    return p.crank_mass * p.crank_cog_distance * p.crank_cog_distance * (1.0 - 1e-12)


def _least_slider_mass(p: FiveBarParameters) -> float:
    return 1e-300 - p.rocker_mass


_RULES = Rules(
    positive=("ground_length", "crank_length", "coupler_length", "rocker_length", "crank_inertia"),
    free_sign=(
        "crank_cog_distance",
        "coupler_cog_distance",
        "rocker_cog_distance",
        "crank_cog_angle",
        "coupler_cog_angle",
        "rocker_cog_angle",
        "slider_guide_angle",
        "slider_spring_free_position",
        "coupler_point_distance",
        "coupler_point_angle",
        "ground_inclination",
    ),
    signs={"assembly_branch": "the sign of sin(rocker.angle - coupler.angle)"},
    least=(
        LowerBound(
            "crank_inertia",
            _crank_inertia_of_mass,
            "be at least crank.mass * crank.cog_distance^2 = %g kg.m2: it is taken about the shaft A",
        ),
        LowerBound("slider_mass", _least_slider_mass, "be greater than zero where rocker.mass is zero"),
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FiveBarParameters(CheckedParameters):
    """A five-bar slider: a four-bar whose rocker-to-ground pivot slides on a sprung and damped guide.

    Lengths in m, masses in kg, moments of inertia in kg.m2, angles in rad, stiffness in N/m, damping in N.s/m. The
    moment of inertia of the crank is about its shaft A and includes m lG2^2; those of coupler and rocker are about their
    own centres of mass. The centres of mass of crank, coupler and rocker are measured from A, from the crank pin B and from
    the slider pin D, at the ``*_cog_angle`` from the link's own direction (A to B, B to C, D to C).

    Raises
    ------
    ParameterError
        If a value is not finite or has the wrong sign, if ``assembly_branch`` is neither +1 nor -1, if the crank's
        inertia about A is less than its mass requires, or if neither rocker nor slider has a mass.
    """

    RULES: ClassVar[Rules] = _RULES

    ground_length: float
    crank_length: float
    coupler_length: float
    rocker_length: float
    crank_mass: float = 0.0
    coupler_mass: float
    rocker_mass: float
    slider_mass: float
    crank_inertia: float
    coupler_inertia: float
    rocker_inertia: float
    crank_cog_distance: float = 0.0
    coupler_cog_distance: float
    rocker_cog_distance: float
    crank_cog_angle: float = 0.0
    coupler_cog_angle: float = 0.0
    rocker_cog_angle: float = 0.0
    slider_guide_angle: float = 0.0
    slider_stiffness: float = 0.0
    slider_spring_free_position: float = 0.0
    slider_damping: float = 0.0
    slider_coulomb_friction: float = 0.0
    slider_friction_coefficient: float = 0.0
    pin_A_friction_radius: float = 0.0
    pin_B_friction_radius: float = 0.0
    pin_C_friction_radius: float = 0.0
    pin_D_friction_radius: float = 0.0
    coupler_point_distance: float = 0.0
    coupler_point_angle: float = 0.0
    gravity: float = 9.81
    ground_inclination: float = 0.0
    assembly_branch: int = 1

    def constants(self) -> Constants:
        """Compute the constants of the equations."""

        def components(factor: float, distance: float, angle: float) -> tuple[float, float]:
            return factor * distance * cos(angle), factor * distance * sin(angle)

        mx2, my2 = components(self.crank_mass, self.crank_cog_distance, self.crank_cog_angle)
        mx3, my3 = components(self.coupler_mass, self.coupler_cog_distance, self.coupler_cog_angle)
        mx4, my4 = components(self.rocker_mass, self.rocker_cog_distance, self.rocker_cog_angle)
        xp, yp = components(1.0, self.coupler_point_distance, self.coupler_point_angle)
        return Constants(
            l1=float(self.ground_length),
            l2=float(self.crank_length),
            l3=float(self.coupler_length),
            l4=float(self.rocker_length),
            ca=cos(self.slider_guide_angle),
            sa=sin(self.slider_guide_angle),
            branch=float(self.assembly_branch),
            m2=float(self.crank_mass),
            m3=float(self.coupler_mass),
            m4=float(self.rocker_mass),
            m5=float(self.slider_mass),
            m45=float(self.rocker_mass + self.slider_mass),
            mx2=mx2,
            my2=my2,
            mx3=mx3,
            my3=my3,
            mx4=mx4,
            my4=my4,
            i2b=self.crank_inertia + self.coupler_mass * self.crank_length * self.crank_length,
            i3b=self.coupler_inertia + self.coupler_mass * self.coupler_cog_distance * self.coupler_cog_distance,
            i4d=self.rocker_inertia + self.rocker_mass * self.rocker_cog_distance * self.rocker_cog_distance,
            k=float(self.slider_stiffness),
            u0=float(self.slider_spring_free_position),
            mu=float(self.slider_damping),
            fc=float(self.slider_coulomb_friction),
            mug=float(self.slider_friction_coefficient),
            ra=float(self.pin_A_friction_radius),
            rb=float(self.pin_B_friction_radius),
            rc=float(self.pin_C_friction_radius),
            rd=float(self.pin_D_friction_radius),
            rough=self.slider_friction_coefficient
            + self.pin_A_friction_radius
            + self.pin_B_friction_radius
            + self.pin_C_friction_radius
            + self.pin_D_friction_radius,
            xp=xp,
            yp=yp,
            gx=-self.gravity * sin(self.ground_inclination),
            gy=-self.gravity * cos(self.ground_inclination),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialState(CheckedState):
    """Initial state of a run: rad, rad/s, m, m/s.

    In speed drive the commanded speed at the start replaces ``crank_speed``.
    """

    crank_angle: float = 0.0
    crank_speed: float = 0.0
    slider_position: float = 0.0
    slider_velocity: float = 0.0


def without_friction(parameters: FiveBarParameters) -> FiveBarParameters:
    """Return the parameters without Coulomb friction and friction by contact forces."""
    return replace(
        parameters,
        slider_coulomb_friction=0.0,
        slider_friction_coefficient=0.0,
        pin_A_friction_radius=0.0,
        pin_B_friction_radius=0.0,
        pin_C_friction_radius=0.0,
        pin_D_friction_radius=0.0,
    )
