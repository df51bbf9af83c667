"""The linearised slider equation: published coefficients, Taylor orders, general mechanisms against differences and runs."""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians

import numpy as np
import pytest

pytest.importorskip("casadi")

from analysis.numerics.fourier import FourierSeries
from analysis.periodic import mean_effective_mass
from analysis.youssef import NO_LOAD, Load, SliderEquation, Variant, balance, slider_equation
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SETS, TABLE_3_1, chapter_4
from tests import published
from tests.strategies import seeded

ANGLES = np.linspace(0.0, 2.0 * pi, 24, endpoint=False)
#: Chapter IV with everything that it leaves out.
GENERAL = replace(
    chapter_4(1.0, 2.0),
    coupler_mass=0.2,
    coupler_inertia=1e-3,
    coupler_cog_distance=0.12,
    coupler_cog_angle=0.3,
    rocker_cog_distance=0.1,
    rocker_cog_angle=-0.2,
    slider_guide_angle=radians(12.0),
    slider_spring_free_position=0.004,
    coupler_point_distance=0.2,
    coupler_point_angle=0.4,
    gravity=9.81,
    ground_inclination=0.5,
    coupler_length=0.28,
    rocker_length=0.33,
)
SERIES = ("mass", "stiffness", "force")


def slider_force(
    parameters: FiveBarParameters, angle: float, u: float, v: float, a: float, w: float, load: Load = NO_LOAD
) -> float:
    """m22 a + b2 - Q2 - F2 by the plain functions."""
    p = parameters.constants()
    g = kinematics.position(angle, u, p)
    k = kinematics.coefficients(g, p)
    w3, w4 = k.k32 * w + k.k3u * v, k.k42 * w + k.k4u * v
    b = dynamics.velocity_terms(g, k, w, w3, w4, *kinematics.centripetal(g, w, w3, w4, p), p)
    q = dynamics.applied_forces(g, k, u, v, load.x, load.y, p)
    return dynamics.inertia(g, k, p).m22 * a + b[1] - q[1] - load.slider


class TestPublishedCoefficients:
    """I4 = 1, sigma2 = 0.05."""

    @pytest.mark.parametrize("name", SERIES)
    def test_the_independent_derivation_is_of_the_exact_coefficients(self, name: str) -> None:
        series = getattr(slider_equation(chapter_4(1.0), 40.0), name)
        mean, cosine, sine = published.SLIDER_EQUATION[name]
        assert series.mean == pytest.approx(mean, abs=5.1e-8)
        assert series.cos[1] == pytest.approx(cosine, abs=5.1e-8)
        assert series.sin[1] == pytest.approx(sine, abs=5.1e-7 if sine == -0.003833 else 5.1e-8)

    @pytest.mark.parametrize("variant", [Variant.FIRST_ORDER, Variant.SECOND_ORDER])
    def test_which_those_of_neither_taylor_order_are(self, variant: Variant) -> None:
        series = slider_equation(chapter_4(1.0), 40.0, variant=variant).mass
        assert abs(series.cos[1] - published.SLIDER_EQUATION["mass"][1]) > 1e-5

    @pytest.mark.parametrize("inertia_ratio", [0.25, 1.0, 2.0])
    def test_taylor_orders_in_closed_form(self, inertia_ratio: float) -> None:
        # the equilateral triangle l1 = l3 = l4: th4 = 120 deg, dth4/dzeta = 1/sqrt 3 at l2 = 0, and so on by hand
        first, second = published.P45 * inertia_ratio * published.SIGMA2 ** np.arange(1, 3)
        root = 3.0**-0.5
        e = slider_equation(chapter_4(inertia_ratio), 40.0, variant=Variant.SECOND_ORDER)
        m0 = 1.0 + published.P45 * inertia_ratio / 3.0
        assert e.mass.cos == pytest.approx([m0 + 14 / 27 * second, -2 / 9 * first, -7 / 27 * second], rel=1e-12)
        assert e.mass.sin[1:] == pytest.approx([2.0 * root * first, 5 / 3 * root * second], rel=1e-12)
        assert e.stiffness.cos == pytest.approx([-44 / 27 * second, 2 / 9 * first, second], rel=1e-12)
        assert e.stiffness.sin[1:] == pytest.approx([-2 / 3 * root * first, -13 / 3 * root * second], rel=1e-12)
        assert e.force.cos == pytest.approx([-4 / 9 * second, -first / 3, second / 3], rel=1e-12)
        assert e.force.sin[1:] == pytest.approx([-root * first, -7 / 3 * root * second], rel=1e-12)

    def test_lengths_and_total_mass_do_not_matter(self) -> None:
        p = chapter_4(1.0, 0.4)
        bigger = replace(
            p,
            **{
                f"{link}_length": 2.0 * getattr(p, f"{link}_length")
                for link in ("ground", "crank", "coupler", "rocker")
            },
            rocker_mass=3.0 * p.rocker_mass,
            slider_mass=3.0 * p.slider_mass,
            rocker_inertia=12.0 * p.rocker_inertia,
            slider_stiffness=3.0 * p.slider_stiffness,
            slider_damping=3.0 * p.slider_damping,
        )
        one, other = slider_equation(p, 40.0), slider_equation(bigger, 40.0)
        for name in SERIES:
            assert getattr(one, name)(ANGLES) == pytest.approx(getattr(other, name)(ANGLES), rel=1e-11)
        assert (one.spring, one.damping) == pytest.approx((other.spring, other.damping), rel=1e-14)
        assert (one.spring, one.damping) == pytest.approx((1000.0 / 1600.0, 0.4 / 40.0), rel=1e-14)


class TestVariants:
    """The thesis's errors."""

    def test_the_printed_equation_leaves_the_rate_of_the_mass_out(self) -> None:
        right, printed = (
            slider_equation(chapter_4(1.0, 0.5), 40.0, variant=v) for v in (Variant.SECOND_ORDER, Variant.PRINTED)
        )
        _, b, _ = right.coefficients()
        assert b(ANGLES) == pytest.approx(right.damping + right.mass.derivative()(ANGLES), abs=1e-15)
        _, b, _ = printed.coefficients()
        assert b(ANGLES) == pytest.approx(printed.damping, abs=1e-15)
        for name in SERIES:
            assert getattr(right, name)(ANGLES) == pytest.approx(getattr(printed, name)(ANGLES), abs=1e-15)

    def test_the_fortran_halves_every_first_order_term(self) -> None:
        printed, fortran = (
            slider_equation(chapter_4(1.0), 40.0, variant=v) for v in (Variant.PRINTED, Variant.FORTRAN)
        )
        assert not fortran.mass_rate
        for name in SERIES:
            a, b = getattr(printed, name), getattr(fortran, name)
            assert [b.cos[1], b.sin[1]] == pytest.approx([0.5 * a.cos[1], 0.5 * a.sin[1]], rel=1e-13)
            assert [*b.cos[::2], b.sin[2]] == pytest.approx([*a.cos[::2], a.sin[2]], rel=1e-13)

    @pytest.mark.parametrize("inertia_ratio", published.FIRST_REGION_THESIS)
    def test_and_yet_is_not_the_whole_of_appendix_3(self, inertia_ratio: float) -> None:
        # first region from the balance of cos and sin of theta/2: its width is 2 |K1 - M1/4|. Halving alone gives three
        # quarters of the thesis's; halving K and not M gives it but for a factor 4 lambda_k^2, near (m4 + m5)'s mean
        lower, upper = published.FIRST_REGION_THESIS[inertia_ratio]
        middle, width = 0.5 * (lower + upper), upper - lower
        fortran = slider_equation(chapter_4(inertia_ratio), 60.0, variant=Variant.FORTRAN)
        mass, stiffness = (s.cos[1] + 1j * s.sin[1] for s in (fortran.mass, fortran.stiffness))
        assert abs(stiffness - 0.25 * mass) / width == pytest.approx(0.77, abs=0.03)
        assert 0.25 * fortran.mass.mean - fortran.stiffness.mean - middle == pytest.approx(
            -6.4e-4 * inertia_ratio, rel=0.06
        )
        unequal = abs(stiffness - 0.5 * mass)
        assert unequal / (4.0 * middle) == pytest.approx(width, abs=2e-5)
        if inertia_ratio == 1.5:
            speed = (published.STIFFNESS_PER_MASS / middle) ** 0.5
            assert unequal * speed == pytest.approx(published.REMOVING_DAMPING_THESIS, abs=5e-4)


class TestGeneralMechanism:
    """Gravity, load, preload, inclined guide, coupler with mass."""

    LOAD = Load(x=0.7, y=-1.1, slider=0.4)

    def test_it_is_the_derivative_of_the_plant(self) -> None:
        w, h = 17.0, 1e-5
        e = slider_equation(GENERAL, w, load=self.LOAD)
        p = GENERAL.constants()
        a, b, c = (p.m45 * s(ANGLES) for s in e.coefficients())
        for i, angle in enumerate(ANGLES.tolist()):
            by = [
                slider_force(GENERAL, angle, *(h * np.eye(3)[j]), w)
                - slider_force(GENERAL, angle, *(-h * np.eye(3)[j]), w)
                for j in range(3)
            ]
            loaded = [slider_force(GENERAL, angle, s * h, 0.0, 0.0, w, self.LOAD) for s in (1.0, -1.0)]
            assert a[i] == pytest.approx(by[2] / (2.0 * h), rel=1e-8)
            assert b[i] * w == pytest.approx(by[1] / (2.0 * h), rel=1e-6)
            assert c[i] * w**2 == pytest.approx((loaded[0] - loaded[1]) / (2.0 * h), rel=1e-6)
            rest = slider_force(GENERAL, angle, 0.0, 0.0, 0.0, w, self.LOAD)
            assert e.force(angle) * p.m45 * w**2 * p.l4 == pytest.approx(-rest, rel=1e-10)

    @pytest.mark.parametrize(("variant", "power"), [(Variant.FIRST_ORDER, 2), (Variant.SECOND_ORDER, 3)])
    @pytest.mark.parametrize("name", SERIES)
    def test_taylor_orders_leave_the_next_power_of_the_crank(self, variant: Variant, power: int, name: str) -> None:
        left = []
        for length in (0.01, 0.005):
            p = replace(GENERAL, crank_length=length)
            exact, taylor = (getattr(slider_equation(p, 17.0, variant=v), name) for v in (Variant.EXACT, variant))
            left.append(np.abs(exact(ANGLES) - taylor(ANGLES)).max())
        assert np.log2(left[0] / left[1]) == pytest.approx(power, abs=0.15)

    def test_gravity_load_and_preload_fall_with_the_square_of_the_speed(self) -> None:
        parts = []
        for name in SERIES[1:]:
            at = {w: getattr(slider_equation(GENERAL, w, load=self.LOAD), name) for w in (10.0, 20.0, 40.0)}
            static = [(at[w] + -1.0 * at[2 * w])(ANGLES) * w**2 for w in (10.0, 20.0)]
            assert static[0] == pytest.approx(static[1], abs=1e-11 * np.abs(static[0]).max() + 1e-12)
            parts.append(np.abs(static[0]).max())
        assert min(parts) > 1.0

    @pytest.mark.parametrize("seed", range(6))
    def test_balance_is_the_plant(self, seed: int) -> None:
        case = seeded(seed)
        th2, u, w, v, _, _ = case.state
        p = case.parameters.constants()
        i = case.speed_inputs._replace(acceleration=0.0)
        g = kinematics.position(th2, u, p)
        k = kinematics.coefficients(g, p)
        m = dynamics.motion(g, k, case.state, i, p)
        found = balance(th2, u, v, m.slider_acceleration, w, p, Load(i.load_x, i.load_y, i.force))
        assert float(found.force) == pytest.approx(
            0.0, abs=1e-10 * (1.0 + abs(found.by_acceleration * m.slider_acceleration))
        )
        assert float(found.torque) == pytest.approx(m.torque, rel=1e-10)

    def test_mean_effective_mass(self) -> None:
        p = SETS["rig-1-spring-a"].parameters
        k = p.constants()
        masses = []
        for th2 in np.linspace(0.0, 2.0 * pi, 200, endpoint=False).tolist():
            g = kinematics.position(th2, 0.0, k)
            masses.append(dynamics.inertia(g, kinematics.coefficients(g, k), k).m22)
        assert mean_effective_mass(p) == pytest.approx(np.mean(masses), rel=1e-13)

    def test_an_order_cuts_the_exact_series(self) -> None:
        full, cut = slider_equation(TABLE_3_1, 44.0), slider_equation(TABLE_3_1, 44.0, order=3)
        assert cut.stiffness.order == 3 < full.stiffness.order
        np.testing.assert_array_equal(cut.stiffness.sin, full.stiffness.sin[:4])


class TestErrors:
    """What is refused."""

    @pytest.mark.parametrize("speed", [0.0, -3.0, float("nan"), float("inf")])
    def test_speed(self, speed: float) -> None:
        with pytest.raises(InputError, match="crank speed"):
            slider_equation(TABLE_3_1, speed)

    def test_coulomb_friction(self) -> None:
        with pytest.raises(InputError, match="coulomb_friction"):
            slider_equation(replace(TABLE_3_1, slider_coulomb_friction=0.1), 44.0)

    def test_order_of_a_taylor_variant(self) -> None:
        with pytest.raises(InputError, match="first order"):
            slider_equation(TABLE_3_1, 44.0, variant=Variant.FIRST_ORDER, order=2)

    def test_links_that_do_not_join(self) -> None:
        short = replace(TABLE_3_1, coupler_length=0.03)
        with pytest.raises(AssemblyError, match=r"crank length 0\.05 m"):
            slider_equation(short, 44.0)
        # the expansion is about no crank
        with pytest.raises(AssemblyError, match="crank length 0 m"):
            slider_equation(replace(short, rocker_length=0.1), 44.0, variant=Variant.SECOND_ORDER)

    def test_links_that_come_too_near_the_limit(self) -> None:
        # B comes to l1 + l2 from D
        reach = TABLE_3_1.ground_length + TABLE_3_1.crank_length
        tight = replace(TABLE_3_1, coupler_length=reach * (1.0 + 1e-6) - TABLE_3_1.rocker_length)
        with pytest.raises(InputError, match="limit of assembly"):
            slider_equation(tight, 44.0)

    def test_coefficients_that_are_not_finite(self) -> None:
        one = FourierSeries.constant(1.0)
        with pytest.raises(InputError, match="lambda_c = nan"):
            SliderEquation(mass=one, stiffness=one, force=one, spring=1.0, damping=float("nan"))
