"""Parameters of the generalised slider-crank: validated, in SI, named as in its FMI interface.

The frames are right-handed and have the thesis's axes. Frame 1 is fixed to the ground: origin O on the crank axis, k along the
crank axis. Frame 2 rotates and shifts with the crank: origin on the crank axis in the plane of the crank pin, i towards the
pin. Frame 4 is fixed to the guide: i along the common normal of crank axis and guide (also i of frame 1), k at the angle
``guide_twist`` from k of frame 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import ClassVar, NamedTuple

from ..parameters import CheckedParameters, CheckedState, LowerBound, Rules


class Constants(NamedTuple):
    """Constants of the equations, in thesis symbols, derived once from `SliderCrankParameters`.

    ``ca, sa`` are cosine and sine of the twist alpha4. ``m22, m23, m33`` are the rod's masses at its ends: its kinetic
    energy is half of m22 v2.v2 + 2 m23 v2.v3 + m33 v3.v3, with v2, v3 the velocities of crank pin and slider pin;
    ``share`` is the distance of its centre of mass from the crank pin divided by its length.
    ``iz`` is the crank's moment of inertia about its axis, ``pxz, pyz`` its products of inertia, ``mx1, my1, mz1`` its mass
    times the coordinates of its centre of mass in frame 2; ``mx4, my4, mz4`` are the slider's mass times the coordinates of
    its centre of mass from the slider pin, in frame 4.
    """

    a1: float
    a2: float
    a4: float
    ca: float
    sa: float
    branch: float
    m1: float
    m2: float
    m3: float
    share: float
    m22: float
    m23: float
    m33: float
    iz: float
    pxz: float
    pyz: float
    mx1: float
    my1: float
    mz1: float
    mx4: float
    my4: float
    mz4: float
    k: float
    s0: float
    mu: float
    fc: float
    kx: float
    x0: float
    mux: float
    amplitude: float
    ratio: float
    gx: float
    gy: float
    gz: float


def _crank_inertia_of_mass(p: SliderCrankParameters) -> float:
    # with an allowance for the rounding of a printed moment of inertia
    return p.crank_mass * (p.crank_cog_x * p.crank_cog_x + p.crank_cog_y * p.crank_cog_y) * (1.0 - 1e-12)


_RULES = Rules(
    positive=("crank_length", "rod_length", "crank_mass", "crank_inertia"),
    free_sign=(
        "guide_offset",
        "guide_twist",
        "crank_cog_x",
        "crank_cog_y",
        "crank_cog_z",
        "crank_product_xz",
        "crank_product_yz",
        "rod_cog_distance",
        "slider_cog_x",
        "slider_cog_y",
        "slider_cog_z",
        "slider_spring_free_position",
        "shift_spring_free_position",
        "groove_amplitude",
        "groove_ratio",
        "gravity_x",
        "gravity_y",
        "gravity_z",
    ),
    signs={"assembly_branch": "the side of the crank pin's foot on the guide on which the slider is"},
    least=(
        LowerBound(
            "crank_inertia",
            _crank_inertia_of_mass,
            "be at least crank.mass * (crank.cog_x^2 + crank.cog_y^2) = %g kg.m2: it is taken about the axis",
        ),
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderCrankParameters(CheckedParameters):
    """A generalised slider-crank: crank on a cylindrical joint, rod between two ball joints, slider on a straight guide.

    Lengths in m, masses in kg, moments and products of inertia in kg.m2, angles in rad, stiffness in N/m, damping in
    N.s/m, gravity in m/s2 along the axes of the ground frame.

    The crank's centre of mass is given in frame 2 and its inertia about the axes of that frame: ``crank_inertia`` about the
    axis of rotation, including the parallel-axis term, and the products of inertia, the integrals of x z and y z over its
    mass. The rod's mass must be symmetric about the line through its joints. Only then the spin about this line, which two
    ball joints leave free, has no effect; it is taken as zero, and the rod's moment of inertia about the line is not needed.
    ``rod_inertia`` is about a transverse axis through the centre of mass, ``rod_cog_distance`` is measured from the crank pin.
    The slider's centre of mass is given in frame 4 from the slider pin.

    ``groove_amplitude`` and ``groove_ratio`` are SS1 and alpha of eq 28, S1 = SS1 sin(alpha theta1), the shift that a groove in
    the crank shaft makes.

    Raises
    ------
    ParameterError
        If a value is not finite or has the wrong sign, if ``assembly_branch`` is neither +1 nor -1, or if the crank's
        inertia is less than its mass requires.
    """

    RULES: ClassVar[Rules] = _RULES

    crank_length: float
    rod_length: float
    guide_offset: float = 0.0
    guide_twist: float
    crank_mass: float
    rod_mass: float = 0.0
    slider_mass: float = 0.0
    crank_inertia: float
    crank_cog_x: float = 0.0
    crank_cog_y: float = 0.0
    crank_cog_z: float = 0.0
    crank_product_xz: float = 0.0
    crank_product_yz: float = 0.0
    rod_inertia: float = 0.0
    rod_cog_distance: float = 0.0
    slider_cog_x: float = 0.0
    slider_cog_y: float = 0.0
    slider_cog_z: float = 0.0
    slider_stiffness: float = 0.0
    slider_spring_free_position: float = 0.0
    slider_damping: float = 0.0
    slider_coulomb_friction: float = 0.0
    shift_stiffness: float = 0.0
    shift_spring_free_position: float = 0.0
    shift_damping: float = 0.0
    groove_amplitude: float = 0.0
    groove_ratio: float = 1.0
    gravity_x: float = 0.0
    gravity_y: float = 0.0
    gravity_z: float = 0.0
    assembly_branch: int = 1

    def constants(self) -> Constants:
        """Compute the constants of the equations."""
        share = self.rod_cog_distance / self.rod_length
        end = self.rod_mass * share * share + self.rod_inertia / (self.rod_length * self.rod_length)
        return Constants(
            a1=self.crank_length,
            a2=self.rod_length,
            a4=self.guide_offset,
            ca=cos(self.guide_twist),
            sa=sin(self.guide_twist),
            branch=float(self.assembly_branch),
            m1=self.crank_mass,
            m2=self.rod_mass,
            m3=self.slider_mass,
            share=share,
            m22=self.rod_mass * (1.0 - 2.0 * share) + end,
            m23=self.rod_mass * share - end,
            m33=end,
            iz=self.crank_inertia,
            pxz=self.crank_product_xz,
            pyz=self.crank_product_yz,
            mx1=self.crank_mass * self.crank_cog_x,
            my1=self.crank_mass * self.crank_cog_y,
            mz1=self.crank_mass * self.crank_cog_z,
            mx4=self.slider_mass * self.slider_cog_x,
            my4=self.slider_mass * self.slider_cog_y,
            mz4=self.slider_mass * self.slider_cog_z,
            k=self.slider_stiffness,
            s0=self.slider_spring_free_position,
            mu=self.slider_damping,
            fc=self.slider_coulomb_friction,
            kx=self.shift_stiffness,
            x0=self.shift_spring_free_position,
            mux=self.shift_damping,
            amplitude=self.groove_amplitude,
            ratio=self.groove_ratio,
            gx=self.gravity_x,
            gy=self.gravity_y,
            gz=self.gravity_z,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialState(CheckedState):
    """Initial state of a run: rad, rad/s, m, m/s.

    A commanded crank speed at the start replaces ``crank_speed``, a commanded axial speed replaces ``shift_velocity``; a groove
    determines shift and axial velocity.
    """

    crank_angle: float = 0.0
    crank_speed: float = 0.0
    shift_position: float = 0.0
    shift_velocity: float = 0.0
