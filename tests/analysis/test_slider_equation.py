"""The linearised slider equation: published coefficients, Taylor orders, general mechanisms against differences and runs."""

from dataclasses import replace
from math import pi, radians
from typing import Any

import numpy as np
import pytest

pytest.importorskip("casadi")

from analysis.numerics.fourier import FourierSeries
from analysis.periodic import mean_effective_mass
from analysis.youssef import (
    NO_LOAD,
    Form,
    Load,
    SliderEquation,
    Variant,
    balance,
    monodromies,
    perturbed_region,
    printed_coefficients,
    resonance,
    slider_equation,
    two_harmonics,
)
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SETS, TABLE_3_1, chapter_4
from tests import published
from tests.strategies import seeded

ANGLES, TURN = (np.linspace(0.0, 2.0 * pi, n, endpoint=False) for n in (24, 64))
#: Chapter IV with everything that it leaves out.
GENERAL = replace(
    chapter_4(1.0, 2.0), coupler_mass=0.2, coupler_inertia=1e-3, coupler_cog_distance=0.12,
    coupler_cog_angle=0.3, rocker_cog_distance=0.1, rocker_cog_angle=-0.2, slider_guide_angle=radians(12.0),
    slider_spring_free_position=0.004, coupler_point_distance=0.2, coupler_point_angle=0.4, gravity=9.81,
    ground_inclination=0.5, coupler_length=0.28, rocker_length=0.33,
)  # fmt: skip
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


class TestThesis:
    """The thesis's own coefficients against what its programs give, which the notes have from the listings."""

    @pytest.mark.parametrize("inertia_ratio", published.RESONANCE)
    def test_resonance_of_appendix_2(self, inertia_ratio: float) -> None:
        lower, upper = resonance(chapter_4(inertia_ratio), variant=Variant.FORTRAN)
        assert lower == pytest.approx(published.RESONANCE[inertia_ratio].thesis, abs=5.1e-5)
        if inertia_ratio == 1.5:
            assert upper == pytest.approx(published.UPPER_RESONANCE_THESIS, abs=5.1e-5)

    def test_resonance_of_the_printed_coefficients(self) -> None:
        lower, _ = resonance(chapter_4(1.0), variant=Variant.PRINTED)
        assert lower == pytest.approx(published.RESONANCE_PRINTED, abs=5.1e-5)

    @pytest.mark.parametrize("inertia_ratio", published.FIRST_REGION_THESIS)
    def test_first_region_of_appendix_3(self, inertia_ratio: float) -> None:
        e = slider_equation(chapter_4(inertia_ratio), 60.0, variant=Variant.APPENDIX_3, form=Form.SERIES)
        region = perturbed_region(e.homogeneous(), 1, order=1)
        # (5.16) without 1/k0 in the half width
        middle, half = 0.5 * (region.low + region.high), 0.5 * region.width * e.spring_factor.mean
        assert (middle - half, middle + half) == pytest.approx(published.FIRST_REGION_THESIS[inertia_ratio], abs=5.1e-6)

    def test_removing_damping_of_appendix_4(self) -> None:
        def greatest(omega_c: float) -> float:
            """Growth of the worst motion over half a turn of 4 pi, less 1."""
            table, speeds = chapter_4(1.5, omega_c), np.sqrt(1000.0 / np.linspace(0.274, 0.279, 26)).tolist()
            equations = [slider_equation(table, speed, variant=Variant.FORTRAN) for speed in speeds]
            matrices = monodromies([e.homogeneous().stiffened(e.spring) for e in equations])
            return float(np.abs(np.linalg.eigvals(matrices)).max() - 1.0)

        own = published.REMOVING_DAMPING_THESIS
        assert greatest(own - 0.002) > 0.0 > greatest(own + 0.002)

    def test_second_harmonic_of_appendix_2(self) -> None:
        right, listed = (
            max(
                two_harmonics(slider_equation(chapter_4(1.0, 0.45), w, variant=v, form=Form.RESONANCE)).harmonic(2)
                for w in np.arange(15.2, 15.4, 0.005).tolist()
            )
            for v in (Variant.EXACT, Variant.FORTRAN)
        )
        assert right / listed == pytest.approx(published.SECOND_HARMONIC_TOO_SMALL, abs=0.5)

    def test_the_force_has_a_third_of_its_second_harmonic(self) -> None:
        """A sixth with the halved factors, which makes the slider's seven times too small in the right equation too."""
        right, ratios = slider_equation(chapter_4(1.0), 1.0), printed_coefficients.ratios(chapter_4(1.0))
        assert right.force.amplitudes[2] == pytest.approx(0.00069, abs=5e-6)
        forces = [right.force]
        for coefficients, size in ((printed_coefficients.printed, 0.00023), (printed_coefficients.listed, 0.00011)):
            parts = coefficients(ratios)
            forces.append(FourierSeries.from_samples(parts.force(TURN) / parts.spring(TURN), 2))
            assert forces[-1].amplitudes[2] == pytest.approx(size, abs=5e-6)

        def greatest(force: FourierSeries, damping: float = 0.2) -> float:
            speeds = np.arange(15.2, 15.4, 0.005).tolist()
            equations = (replace(right, force=force, spring=1000.0 / w**2, damping=damping / w) for w in speeds)
            return max(two_harmonics(e).harmonic(2) for e in equations)

        whole, _, halved = map(greatest, forces)
        assert (whole, halved) == pytest.approx((0.0271, 0.0040), abs=5.1e-5)

    @pytest.mark.parametrize("variant", [Variant.PRINTED, Variant.FORTRAN, Variant.APPENDIX_3])
    def test_without_a_rocker_it_is_a_mass_on_a_spring(self, variant: Variant) -> None:
        e = slider_equation(chapter_4(0.0, 0.5), 40.0, variant=variant)
        for got, value in zip(e.coefficients(), (1.0, e.damping, e.spring)):
            assert got(ANGLES) == pytest.approx(np.full(24, value), abs=1e-15)
        assert e.force(ANGLES) == pytest.approx(np.zeros(24), abs=1e-15)

    def test_the_series_is_the_quotient_to_second_order_but_for_its_mean(self) -> None:
        left = []
        for scale in (1.0, 0.5):
            p = replace(chapter_4(1.0, 0.5), crank_length=0.005 * scale)
            one, other = (
                slider_equation(p, 40.0, variant=Variant.PRINTED, form=f) for f in (Form.QUOTIENT, Form.SERIES)
            )
            a, b, c = (s(TURN) for s in one.coefficients())
            for whole, part in zip((b / a, c / a, one.force(TURN) / a), (*other.coefficients()[1:], other.force)):
                off = np.abs(FourierSeries.from_samples(whole - part(TURN), 4).exponential[4:])
                left.append([off[0], off[1:].max()])
        means, waves = np.reshape(left, (2, 3, 2)).transpose(2, 0, 1)
        assert np.log2(means[0] / means[1]) == pytest.approx(2.0, abs=0.2)
        assert np.log2(waves[0] / waves[1]) == pytest.approx(3.0, abs=0.2)

    def test_the_programs_lose_k0(self) -> None:
        table, forms = chapter_4(1.0, 0.5), (Form.SERIES, Form.RESONANCE, Form.STABILITY)
        series, *others = (slider_equation(table, 40.0, variant=Variant.FORTRAN, form=f) for f in forms)
        appendix_2, appendix_4 = others
        k0 = series.spring_factor.mean
        assert k0 == pytest.approx(0.94, abs=0.01)
        lost = series.spring_factor * (1.0 / k0)
        for factor, mean in (
            (appendix_2.spring_factor, k0),
            (appendix_4.spring_factor, k0),
            (appendix_2.damping_factor, 1.0),
            (appendix_4.damping_factor, k0),
        ):
            assert factor.mean == pytest.approx(mean, rel=1e-14)
            assert factor.exponential[3:] == pytest.approx(lost.exponential[3:], rel=1e-13)

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            ({"coupler_mass": 0.2}, r"coupler\.mass is 0\.2"),
            ({"rocker_cog_distance": 0.1}, r"rocker\.cog_distance is 0\.1"),
            ({"gravity": 9.81}, "gravity is 9.81"),
        ],
    )
    def test_what_it_leaves_out_is_refused(self, change: dict[str, float], said: str) -> None:
        with pytest.raises(InputError, match=said):
            slider_equation(replace(chapter_4(1.0), **change), 40.0, variant=Variant.PRINTED)
        with pytest.raises(InputError, match="no load"):
            slider_equation(chapter_4(1.0), 40.0, variant=Variant.PRINTED, load=Load(slider=1.0))


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
        size = abs(found.by_acceleration * m.slider_acceleration)
        assert float(found.force) == pytest.approx(0.0, abs=1e-10 * (1.0 + size))
        assert float(found.torque) == pytest.approx(m.torque, rel=1e-10)

    @pytest.mark.parametrize("free", [0.0, 0.01])
    def test_mean_effective_mass(self, free: float) -> None:
        """With the slider where its spring is free."""
        p = replace(SETS["rig-1-spring-a"].parameters, slider_spring_free_position=free)
        k = p.constants()
        masses = []
        for th2 in np.linspace(0.0, 2.0 * pi, 200, endpoint=False).tolist():
            g = kinematics.position(th2, free, k)
            masses.append(dynamics.inertia(g, kinematics.coefficients(g, k), k).m22)
        assert mean_effective_mass(p) == pytest.approx(np.mean(masses), rel=1e-13)

    def test_an_order_cuts_the_exact_series(self) -> None:
        full, cut = slider_equation(TABLE_3_1, 44.0), slider_equation(TABLE_3_1, 44.0, order=3)
        assert cut.stiffness.order == 3 < full.stiffness.order
        np.testing.assert_array_equal(cut.stiffness.sin, full.stiffness.sin[:4])


class TestErrors:
    """What is refused."""

    @pytest.mark.parametrize(
        ("changes", "speed", "options", "named"),
        [
            *(({}, speed, {}, "crank speed") for speed in (0.0, -3.0, float("nan"), float("inf"))),
            ({"slider_coulomb_friction": 0.1}, 44.0, {}, "coulomb_friction"),
            ({"slider_friction_coefficient": 0.01}, 44.0, {}, r"slider\.friction_coefficient"),
            ({"pin_C_friction_radius": 0.01}, 44.0, {}, r"pin\.\*_friction_radius"),
            ({}, 44.0, {"variant": Variant.FIRST_ORDER, "order": 2}, "first order"),
        ],
    )
    def test_arguments(self, changes: dict[str, Any], speed: float, options: dict[str, Any], named: str) -> None:
        with pytest.raises(InputError, match=named):
            slider_equation(replace(TABLE_3_1, **changes), speed, **options)

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
