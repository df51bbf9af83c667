"""Published parameter sets (Youssef, Tables 3.1, 8.1, 8.2 and appendix 1), converted from cgs to SI.

`SETS` maps a name to a `PublishedSet`: the mechanism, its running speed, and the source.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Mapping

from ..mechanism import PublishedSet
from ..units import CM_PER_METRE, RAD_S_PER_RPM
from .parameters import FiveBarParameters, InitialState

# Divisors, as `CM_PER_METRE` is.
GRAM_PER_KG = 1e3
G_CM2_PER_KG_M2 = 1e7
DYN_CM_PER_NEWTON_METRE = 1e7
DYN_PER_NEWTON = 1e5
#: Stiffness in dyn/cm per N/m, and damping in dyn.s/cm per N.s/m.
DYN_PER_CM_PER_NEWTON_PER_METRE = 1e3


def _published_set(crank_speed_rpm: float, parameters: FiveBarParameters, source: str) -> PublishedSet:
    """Return a published set that starts as in the thesis: th2 = u = u' = 0 at the running speed."""
    speed = crank_speed_rpm * RAD_S_PER_RPM
    return PublishedSet(parameters, InitialState(crank_speed=speed), {"speed": speed}, source, at_rest=True)


def _from_cgs(
    lengths_cm: tuple[float, float, float, float],
    cog_cm: tuple[float, float],
    masses_g: tuple[float, float, float],
    inertias_g_cm2: tuple[float, float],
    stiffness_dyn_cm: float,
    damping_dyn_s_cm: float,
    gravity: float = 9.81,
) -> FiveBarParameters:
    return FiveBarParameters(
        ground_length=lengths_cm[0] / CM_PER_METRE,
        crank_length=lengths_cm[1] / CM_PER_METRE,
        coupler_length=lengths_cm[2] / CM_PER_METRE,
        rocker_length=lengths_cm[3] / CM_PER_METRE,
        coupler_mass=masses_g[0] / GRAM_PER_KG,
        rocker_mass=masses_g[1] / GRAM_PER_KG,
        slider_mass=masses_g[2] / GRAM_PER_KG,
        # Table 3.1 gives I_A = 12500 g.cm2; that of the rigs is not printed and is assumed to be the same. At constant speed
        # only the kinetic energy depends on it
        crank_inertia=12500 / G_CM2_PER_KG_M2,
        coupler_inertia=inertias_g_cm2[0] / G_CM2_PER_KG_M2,
        rocker_inertia=inertias_g_cm2[1] / G_CM2_PER_KG_M2,
        coupler_cog_distance=cog_cm[0] / CM_PER_METRE,
        rocker_cog_distance=cog_cm[1] / CM_PER_METRE,
        slider_stiffness=stiffness_dyn_cm / DYN_PER_CM_PER_NEWTON_PER_METRE,
        slider_damping=damping_dyn_s_cm / DYN_PER_CM_PER_NEWTON_PER_METRE,
        gravity=gravity,
    )


def _table_3_1(stiffness_dyn_cm: float, damping_dyn_s_cm: float) -> FiveBarParameters:
    return _from_cgs((15.35, 5, 15, 15), (9.82, 7.5), (209, 206, 590), (5250, 3863), stiffness_dyn_cm, damping_dyn_s_cm)


def _rig_1(stiffness_dyn_cm: float) -> FiveBarParameters:
    return _from_cgs((15.37, 5, 15, 15), (9.55, 7.5), (222, 206, 600), (7064, 4797), stiffness_dyn_cm, 9e3)


def _rig_2(stiffness_dyn_cm: float) -> FiveBarParameters:
    # horizontal plane: gravity does no work in it
    return _from_cgs(
        (25.4, 1.27, 25.4, 25.4),
        (14.2, 12.7),
        (324, 264, 856),
        (23784, 15100),
        stiffness_dyn_cm,
        5.5e3,
        gravity=0.0,
    )


SETS: Mapping[str, PublishedSet] = MappingProxyType(
    {
        "table-3.1": _published_set(420, _table_3_1(1e6, 3e4), "Youssef, Table 3.1, with fig. 3.4's spring"),
        "appendix-1": _published_set(450, _table_3_1(1.5e6, 2.8e4), "Youssef, appendix 1"),
        "rig-1-spring-a": _published_set(
            420, _rig_1(3e6), "Youssef, Table 8.1, spring A (speed and crank inertia assumed)"
        ),
        "rig-1-spring-b": _published_set(
            420, _rig_1(11e6), "Youssef, Table 8.1, spring B (speed and crank inertia assumed)"
        ),
        "rig-2-spring-c": _published_set(
            420, _rig_2(4e6), "Youssef, Table 8.2, spring C (speed and crank inertia assumed)"
        ),
        "rig-2-spring-d": _published_set(
            420, _rig_2(8e6), "Youssef, Table 8.2, spring D (speed and crank inertia assumed)"
        ),
    }
)

TABLE_3_1: FiveBarParameters = SETS["table-3.1"].parameters


#: Chapters IV and V: sigma2 = l2/l4, p45 = m4/(m4 + m5), k/(m4 + m5) (1/s2) and so omega_k = 31.623 rad/s.
SIGMA2, P45, SQUARE_OF_OMEGA_K = 0.05, 0.2, 1000.0


def chapter_4(inertia_ratio: float, omega_c: float = 0.0) -> FiveBarParameters:
    """Return the horizontal mechanism of chapters IV and V.

    The coupler has no mass, the rocker's centre of mass is on the slider pin D, l3 = l4 = l1, sigma2 = l2/l4 = 0.05,
    p45 = m4/(m4 + m5) = 0.2, k/(m4 + m5) = 1000 1/s2. The thesis leaves lengths and masses free: l1 = 0.3 m and m4 + m5 = 1 kg
    are chosen, and no dimensionless result depends on them. At constant speed the slider's motion does not depend on the
    crank's inertia.

    Parameters
    ----------
    inertia_ratio : float
        I4 = I_D/(m4 l4^2); the thesis has 0.25 to 2.
    omega_c : float
        mu/(m4 + m5) (1/s).
    """
    length, mass = 0.3, 1.0
    return FiveBarParameters(
        ground_length=length,
        crank_length=SIGMA2 * length,
        coupler_length=length,
        rocker_length=length,
        coupler_mass=0.0,
        rocker_mass=P45 * mass,
        slider_mass=(1.0 - P45) * mass,
        crank_inertia=12500 / G_CM2_PER_KG_M2,
        coupler_inertia=0.0,
        rocker_inertia=inertia_ratio * P45 * mass * length**2,
        coupler_cog_distance=0.0,
        rocker_cog_distance=0.0,
        slider_stiffness=SQUARE_OF_OMEGA_K * mass,
        slider_damping=omega_c * mass,
        gravity=0.0,
    )
