"""Parameters of the slider-crank: what is refused and what is said, the derived constants, and section 3.1's data."""

from __future__ import annotations

from dataclasses import MISSING, FrozenInstanceError, asdict, fields, replace
from math import cos, hypot, inf, nan, pi, radians, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from linkwork.errors import LinkworkError, ParameterError
from linkwork.parameters import field_name, fmi_name
from linkwork.slider_crank import published
from linkwork.slider_crank.parameters import InitialState, SliderCrankParameters
from tests import published_rahman as rahman
from tests.published_rahman import INCH, POUND_FORCE, POUND_INCH
from tests.slider_cranks import Case, cases

#: A mechanism with every parameter, the crank as light in inertia as it may be to spare.
EXAMPLE = published.parameters(10.0)

#: Every field with its name in the FMI contract, and the least value it may have: None for any.
CONTRACT = {
    "crank_length": ("crank.length", "above 0"),
    "rod_length": ("rod.length", "above 0"),
    "guide_offset": ("guide.offset", None),
    "guide_twist": ("guide.twist", None),
    "crank_mass": ("crank.mass", "above 0"),
    "rod_mass": ("rod.mass", "0"),
    "slider_mass": ("slider.mass", "0"),
    "crank_inertia": ("crank.inertia", "above 0"),
    "crank_cog_x": ("crank.cog_x", None),
    "crank_cog_y": ("crank.cog_y", None),
    "crank_cog_z": ("crank.cog_z", None),
    "crank_product_xz": ("crank.product_xz", None),
    "crank_product_yz": ("crank.product_yz", None),
    "rod_inertia": ("rod.inertia", "0"),
    "rod_cog_distance": ("rod.cog_distance", None),
    "slider_cog_x": ("slider.cog_x", None),
    "slider_cog_y": ("slider.cog_y", None),
    "slider_cog_z": ("slider.cog_z", None),
    "slider_stiffness": ("slider.stiffness", "0"),
    "slider_spring_free_position": ("slider.spring_free_position", None),
    "slider_damping": ("slider.damping", "0"),
    "slider_coulomb_friction": ("slider.coulomb_friction", "0"),
    "shift_stiffness": ("shift.stiffness", "0"),
    "shift_spring_free_position": ("shift.spring_free_position", None),
    "shift_damping": ("shift.damping", "0"),
    "groove_amplitude": ("groove.amplitude", None),
    "groove_ratio": ("groove.ratio", None),
    "gravity_x": ("gravity.x", None),
    "gravity_y": ("gravity.y", None),
    "gravity_z": ("gravity.z", None),
    "assembly_branch": ("assembly.branch", "+1 or -1"),
}


def refusal(**changes: Any) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        replace(EXAMPLE, **changes)
    return caught.value


def test_fields_are_those_of_the_contract() -> None:
    assert [f.name for f in fields(SliderCrankParameters)] == list(CONTRACT)


@pytest.mark.parametrize("name", CONTRACT)
def test_names_go_to_the_contract_and_back(name: str) -> None:
    fmi = CONTRACT[name][0]
    assert fmi_name(name) == fmi
    assert field_name(fmi) == name


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("name", CONTRACT)
def test_every_field_refuses_what_is_not_finite(name: str, value: float) -> None:
    error = refusal(**{name: value})
    assert error.name == CONTRACT[name][0]
    assert str(error).startswith(f"parameter {CONTRACT[name][0]} is {value!r}: it must be ")
    assert isinstance(error, LinkworkError)


@pytest.mark.parametrize("value", ["0.1", None, True, 1j])
@pytest.mark.parametrize("name", CONTRACT)
def test_every_field_refuses_what_is_not_a_number(name: str, value: object) -> None:
    error = refusal(**{name: value})
    assert error.name == CONTRACT[name][0]
    assert repr(value) in str(error)


@pytest.mark.parametrize("name", [n for n, (_, least) in CONTRACT.items() if least in ("0", "above 0")])
def test_wrong_sign_is_refused(name: str) -> None:
    error = refusal(**{name: -1e-9})
    assert error.name == CONTRACT[name][0]
    assert "zero" in error.requirement


@pytest.mark.parametrize("name", [n for n, (_, least) in CONTRACT.items() if least == "above 0"])
def test_zero_is_refused_where_nothing_would_be_left(name: str) -> None:
    assert "greater than zero" in str(refusal(**{name: 0.0}))


@pytest.mark.parametrize("name", [n for n, (_, least) in CONTRACT.items() if least == "0"])
def test_zero_is_allowed_elsewhere(name: str) -> None:
    assert getattr(replace(EXAMPLE, **{name: 0.0}), name) == 0.0


@pytest.mark.parametrize("name", [n for n, (_, least) in CONTRACT.items() if least is None])
def test_either_sign_is_allowed_where_it_is_a_direction(name: str) -> None:
    assert getattr(replace(EXAMPLE, **{name: -0.02}), name) == -0.02


@pytest.mark.parametrize("value", [0, 2, -2, 0.5])
def test_branch_is_one_of_two(value: float) -> None:
    error = refusal(assembly_branch=value)
    assert error.name == "assembly.branch"
    assert "+1 or -1, the side of the crank pin's foot on the guide on which the slider is" in str(error)


def test_defaults_are_nothing_but_the_thesiss_assembly_and_groove() -> None:
    defaults = {f.name: f.default for f in fields(SliderCrankParameters) if f.default is not MISSING}
    assert {n: value for n, value in defaults.items() if value != 0.0} == {"groove_ratio": 1.0, "assembly_branch": 1}
    needed = {"crank_length", "rod_length", "guide_twist", "crank_mass", "crank_inertia"}
    assert set(CONTRACT) - set(defaults) == needed


def test_crank_inertia_about_the_axis_includes_its_mass() -> None:
    crank = {"crank_mass": 2.0, "crank_cog_x": -0.03, "crank_cog_y": 0.04}
    error = refusal(crank_inertia=0.9 * 2.0 * 0.05**2, **crank)
    assert error.name == "crank.inertia"
    assert "0.005 kg.m2" in str(error)
    assert replace(EXAMPLE, crank_inertia=2.0 * 0.05**2, **crank).crank_mass == 2.0  # a point mass is allowed
    # how far along the axis it is does not matter
    assert replace(EXAMPLE, crank_inertia=2.0 * 0.05**2, crank_cog_z=10.0, **crank).crank_cog_z == 10.0


def test_constants_that_overflow_are_refused() -> None:
    error = refusal(crank_mass=1e300, crank_inertia=1e308, crank_cog_x=0.0, crank_cog_z=1e200)
    assert error.name == "crank.inertia"
    assert "finite moments of inertia" in str(error)


def test_parameters_are_frozen_and_have_no_other_fields() -> None:
    with pytest.raises(FrozenInstanceError):
        EXAMPLE.guide_twist = 0.0  # type: ignore[misc]
    with pytest.raises(TypeError, match="rod_lenght"):
        SliderCrankParameters(**asdict(EXAMPLE), rod_lenght=0.1)  # type: ignore[call-arg]
    assert replace(EXAMPLE) == EXAMPLE
    assert hash(replace(EXAMPLE)) == hash(EXAMPLE)


@pytest.mark.parametrize("value", [nan, inf, "0", None, False])
@pytest.mark.parametrize("name", [f.name for f in fields(InitialState)])
def test_start_refuses_what_is_not_a_finite_number(name: str, value: Any) -> None:
    with pytest.raises(ParameterError, match=rf"parameter initial\.{name} is .* it must be a finite number"):
        InitialState(**{name: value})


@settings(max_examples=50, derandomize=True, deadline=None)
@given(case=cases())
def test_constants_are_what_they_say(case: Case) -> None:
    par, p = case.parameters, case.p
    assert (p.ca, p.sa) == (cos(par.guide_twist), sin(par.guide_twist))
    assert (p.a1, p.a2, p.a4) == (par.crank_length, par.rod_length, par.guide_offset)
    # the rod's masses at its ends: mass, centre of mass and moment of inertia of the rod itself
    assert p.m22 + 2.0 * p.m23 + p.m33 == pytest.approx(par.rod_mass, rel=1e-12)
    assert (p.m23 + p.m33) * p.a2 == pytest.approx(par.rod_mass * par.rod_cog_distance, abs=1e-12)
    about_crank_pin = par.rod_inertia + par.rod_mass * par.rod_cog_distance**2
    assert p.m33 * p.a2**2 == pytest.approx(about_crank_pin, rel=1e-12)
    about_slider_pin = par.rod_inertia + par.rod_mass * (p.a2 - par.rod_cog_distance) ** 2
    assert p.m22 * p.a2**2 == pytest.approx(about_slider_pin, rel=1e-9)
    assert (p.mx1, p.my1, p.mz1) == pytest.approx(
        [par.crank_mass * x for x in (par.crank_cog_x, par.crank_cog_y, par.crank_cog_z)]
    )
    assert (p.mx4, p.my4, p.mz4) == pytest.approx(
        [par.slider_mass * x for x in (par.slider_cog_x, par.slider_cog_y, par.slider_cog_z)]
    )
    assert (p.gx, p.gy, p.gz) == (par.gravity_x, par.gravity_y, par.gravity_z)
    assert all(isinstance(value, float) for value in p)


def test_numbers_of_other_kinds_become_plain_ones() -> None:
    changed = replace(EXAMPLE, slider_mass=np.float32(0.5), assembly_branch=np.int64(-1), gravity_z=9)
    assert (type(changed.slider_mass), type(changed.assembly_branch), type(changed.gravity_z)) == (float, int, float)
    assert (changed.slider_mass, changed.assembly_branch, changed.gravity_z) == (0.5, -1, 9.0)
    with pytest.raises(ParameterError, match=r"slider\.mass"):
        replace(EXAMPLE, slider_mass=10**400)


# ------------------------------------------------------------------ section 3.1


@pytest.mark.parametrize("offset_in", rahman.OFFSETS_IN)
@pytest.mark.parametrize("twist_deg", rahman.TWISTS_DEG)
def test_published_set_is_the_data_of_section_3_1(offset_in: float, twist_deg: float) -> None:
    par = published.parameters(offset_in, twist_deg)
    mass = POUND_FORCE / INCH  # lb.s2/in
    assert (par.crank_length, par.rod_length, par.guide_offset) == pytest.approx(
        (12.0 * INCH, 50.0 * INCH, offset_in * INCH), rel=1e-14
    )
    assert par.guide_twist == pytest.approx(radians(twist_deg), rel=1e-15)
    masses = [m * mass for m in rahman.MASSES_LB_S2_IN]
    assert (par.crank_mass, par.rod_mass, par.slider_mass) == pytest.approx(masses, rel=1e-14)
    # radii of gyration as printed, about the link's end; the rod's is told about its centre of mass
    r1, r2 = rahman.CRANK_RADIUS_IN, rahman.ROD_RADIUS_IN
    assert par.crank_inertia == pytest.approx(masses[0] * (r1**2 / 4 + 12.0**2 / 3) * INCH**2, rel=1e-12)
    at_end = par.rod_inertia + par.rod_mass * par.rod_cog_distance**2
    assert at_end == pytest.approx(masses[1] * (r2**2 / 4 + 50.0**2 / 3) * INCH**2, rel=1e-12)
    assert (par.crank_cog_x, par.rod_cog_distance) == pytest.approx((6.0 * INCH, 25.0 * INCH), rel=1e-14)
    others = set(CONTRACT) - {
        "crank_length", "rod_length", "guide_offset", "guide_twist", "crank_mass", "rod_mass", "slider_mass",
        "crank_inertia", "rod_inertia", "crank_cog_x", "rod_cog_distance", "groove_ratio", "assembly_branch",
    }  # fmt: skip
    assert all(getattr(par, name) == 0.0 for name in others)
    assert par.assembly_branch == 1


def test_masses_are_those_of_the_weights() -> None:
    # "specific gravity 0.28" is a weight density in lb/in3
    density = rahman.DENSITY_LB_IN3 / rahman.GRAVITY_IN_S2
    volumes = (
        pi * rahman.CRANK_RADIUS_IN**2 * rahman.CRANK_IN,
        pi * rahman.ROD_RADIUS_IN**2 * rahman.ROD_IN,
        rahman.SLIDER_SIDE_IN**3,
    )
    assert pytest.approx([density * volume for volume in volumes], rel=5e-7) == rahman.MASSES_LB_S2_IN


def test_speed_torque_and_start_of_section_3_1() -> None:
    assert pytest.approx(rahman.SPEED_RPM * 2.0 * pi / 60.0, rel=1e-15) == published.CRANK_SPEED
    assert pytest.approx(rahman.TORQUE_LB_IN * POUND_INCH, rel=1e-15) == published.CRANK_TORQUE
    start = published.initial(3.5)
    assert start == InitialState(crank_speed=published.CRANK_SPEED, shift_position=3.5 * INCH)
    assert (published.parameters(10.0), start) == published.OFFSET_CASE
    assert hypot(published.INCH - INCH, published.POUND_FORCE - POUND_FORCE, published.POUND_INCH - POUND_INCH) == 0.0


@pytest.mark.parametrize("length", [1e-200, 1e-160])
def test_a_rod_too_short_for_finite_moments_is_named(length: float) -> None:
    with pytest.raises(
        ParameterError, match=r"parameter rod\.length is 1e-\d+: it must be large enough for finite moments"
    ):
        replace(published.parameters(), rod_length=length)
