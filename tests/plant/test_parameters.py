"""Parameters: what is refused and what is said, the derived constants, and the published sets against their tables."""

from __future__ import annotations

from dataclasses import MISSING, FrozenInstanceError, asdict, fields, replace
from math import cos, hypot, inf, nan, pi, sin
from typing import Any

import pytest
from hypothesis import given, settings

from linkwork.errors import LinkworkError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState, reach
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.parameters import field_name, fmi_name
from tests import published
from tests.published import CM, DYN_PER_CM, DYN_S_PER_CM, G_CM2, GRAM, RPM
from tests.strategies import Case, cases

#: Every field with its name in the FMI contract (DESIGN.md), and the least value it may have: None for any.
CONTRACT = {
    "ground_length": ("ground.length", "above 0"),
    "crank_length": ("crank.length", "above 0"),
    "coupler_length": ("coupler.length", "above 0"),
    "rocker_length": ("rocker.length", "above 0"),
    "crank_mass": ("crank.mass", "0"),
    "coupler_mass": ("coupler.mass", "0"),
    "rocker_mass": ("rocker.mass", "0"),
    "slider_mass": ("slider.mass", "0"),
    "crank_inertia": ("crank.inertia", "above 0"),
    "coupler_inertia": ("coupler.inertia", "0"),
    "rocker_inertia": ("rocker.inertia", "0"),
    "crank_cog_distance": ("crank.cog_distance", None),
    "coupler_cog_distance": ("coupler.cog_distance", None),
    "rocker_cog_distance": ("rocker.cog_distance", None),
    "crank_cog_angle": ("crank.cog_angle", None),
    "coupler_cog_angle": ("coupler.cog_angle", None),
    "rocker_cog_angle": ("rocker.cog_angle", None),
    "slider_guide_angle": ("slider.guide_angle", None),
    "slider_stiffness": ("slider.stiffness", "0"),
    "slider_spring_free_position": ("slider.spring_free_position", None),
    "slider_damping": ("slider.damping", "0"),
    "slider_coulomb_friction": ("slider.coulomb_friction", "0"),
    "coupler_point_distance": ("coupler.point_distance", None),
    "coupler_point_angle": ("coupler.point_angle", None),
    "gravity": ("gravity", "0"),
    "ground_inclination": ("ground.inclination", None),
    "assembly_branch": ("assembly.branch", "+1 or -1"),
}


def refusal(**changes: Any) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        replace(TABLE_3_1, **changes)
    return caught.value


def test_fields_are_those_of_the_contract() -> None:
    assert [f.name for f in fields(FiveBarParameters)] == list(CONTRACT)


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
    assert isinstance(error, ValueError)


@pytest.mark.parametrize("value", ["0.1", None, True, 1j, [0.1]])
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
    assert getattr(replace(TABLE_3_1, **{name: 0.0}), name) == 0.0


@pytest.mark.parametrize("name", [n for n, (_, least) in CONTRACT.items() if least is None])
def test_either_sign_is_allowed_where_it_is_a_direction(name: str) -> None:
    assert getattr(replace(TABLE_3_1, **{name: -0.3}), name) == -0.3


@pytest.mark.parametrize("value", [0, 2, -2, 0.5])
def test_branch_is_one_of_two(value: float) -> None:
    error = refusal(assembly_branch=value)
    assert error.name == "assembly.branch"
    assert "+1 or -1, the sign of sin(rocker.angle - coupler.angle)" in str(error)


def test_defaults_are_nothing_but_gravity_and_the_thesiss_assembly() -> None:
    defaults = {f.name: f.default for f in fields(FiveBarParameters) if f.default is not MISSING}
    assert {name: value for name, value in defaults.items() if value != 0.0} == {"gravity": 9.81, "assembly_branch": 1}
    assert len(defaults) == 15


def test_crank_inertia_about_the_shaft_includes_its_mass() -> None:
    crank = {"crank_mass": 2.0, "crank_cog_distance": -0.03}
    error = refusal(crank_inertia=0.9 * 2.0 * 0.03**2, **crank)
    assert error.name == "crank.inertia"
    assert "0.0018 kg.m2" in str(error)
    replace(TABLE_3_1, crank_inertia=2.0 * 0.03**2, **crank)  # a point mass is allowed


def test_something_has_to_move_with_the_slider() -> None:
    error = refusal(rocker_mass=0.0, slider_mass=0.0)
    assert error.name == "slider.mass"
    replace(TABLE_3_1, rocker_mass=0.0)
    replace(TABLE_3_1, slider_mass=0.0)


def test_parameters_are_frozen_and_have_no_other_fields() -> None:
    with pytest.raises(FrozenInstanceError):
        TABLE_3_1.gravity = 0.0  # type: ignore[misc]
    with pytest.raises(TypeError, match="coupler_lenght"):
        FiveBarParameters(**asdict(TABLE_3_1), coupler_lenght=0.1)  # type: ignore[call-arg]
    assert replace(TABLE_3_1) == TABLE_3_1
    assert hash(replace(TABLE_3_1)) == hash(TABLE_3_1)


@pytest.mark.parametrize("value", [nan, inf, "0", None, False])
@pytest.mark.parametrize("name", [f.name for f in fields(InitialState)])
def test_start_refuses_what_is_not_a_finite_number(name: str, value: Any) -> None:
    with pytest.raises(ParameterError, match=rf"parameter initial\.{name} is .* it must be a finite number"):
        InitialState(**{name: value})


@settings(max_examples=50, derandomize=True, deadline=None)
@given(case=cases())
def test_constants_are_the_components_they_say(case: Case) -> None:
    par, p = case.parameters, case.parameters.constants()
    for mass, distance, angle, x, y in (
        (par.crank_mass, par.crank_cog_distance, par.crank_cog_angle, p.mx2, p.my2),
        (par.coupler_mass, par.coupler_cog_distance, par.coupler_cog_angle, p.mx3, p.my3),
        (par.rocker_mass, par.rocker_cog_distance, par.rocker_cog_angle, p.mx4, p.my4),
        (1.0, par.coupler_point_distance, par.coupler_point_angle, p.xp, p.yp),
    ):
        assert hypot(x, y) == pytest.approx(mass * abs(distance), rel=1e-12)
        assert x * sin(angle) == pytest.approx(y * cos(angle), abs=1e-15)
    assert p.i2b == pytest.approx(par.crank_inertia + par.coupler_mass * par.crank_length**2)
    assert p.i3b == pytest.approx(par.coupler_inertia + par.coupler_mass * par.coupler_cog_distance**2)
    assert p.i4d == pytest.approx(par.rocker_inertia + par.rocker_mass * par.rocker_cog_distance**2)
    assert p.m45 == par.rocker_mass + par.slider_mass
    assert hypot(p.gx, p.gy) == pytest.approx(par.gravity, rel=1e-14)
    assert all(isinstance(value, float) for value in p)


def test_gravity_in_the_frame_of_an_inclined_ground_link() -> None:
    # x points up the slope: gravity pulls back along it
    p = replace(TABLE_3_1, ground_inclination=pi / 6).constants()
    assert (p.gx, p.gy) == pytest.approx((-9.81 * 0.5, -9.81 * 0.75**0.5), rel=1e-14)
    assert TABLE_3_1.constants().gy == -9.81


def test_reach_is_the_distance_of_the_pins() -> None:
    assert reach(TABLE_3_1, 0.0, 0.01) == pytest.approx(0.1535 + 0.01 - 0.05, rel=1e-14)
    turned = replace(TABLE_3_1, slider_guide_angle=pi / 2)
    assert reach(turned, pi / 2, 0.05) == pytest.approx(0.1535, rel=1e-14)


# ------------------------------------------------------------------ published sets


def test_published_sets_are_all_there() -> None:
    assert set(SETS) == set(published.TABLES)
    assert SETS["table-3.1"].parameters is TABLE_3_1
    with pytest.raises(TypeError):
        SETS["table-3.1"] = SETS["appendix-1"]  # type: ignore[index]


@pytest.mark.parametrize("name", published.TABLES)
def test_published_set_is_the_printed_table(name: str) -> None:
    table, entry = published.TABLES[name], SETS[name]
    par = entry.parameters
    lengths = (par.ground_length, par.crank_length, par.coupler_length, par.rocker_length)
    assert lengths == pytest.approx([length * CM for length in table.lengths_cm], rel=1e-14)
    assert (par.coupler_cog_distance, par.rocker_cog_distance) == pytest.approx(
        (table.coupler_cog_cm * CM, table.rocker_cog_cm * CM), rel=1e-14
    )
    assert (par.coupler_mass, par.rocker_mass, par.slider_mass) == pytest.approx(
        [mass * GRAM for mass in table.masses_g], rel=1e-14
    )
    assert par.coupler_inertia == pytest.approx(table.coupler_inertia_g_cm2 * G_CM2, rel=1e-14)
    assert par.rocker_inertia == pytest.approx(table.rocker_inertia_g_cm2 * G_CM2, rel=1e-14)
    assert par.crank_inertia == pytest.approx(published.CRANK_INERTIA_G_CM2 * G_CM2, rel=1e-14)
    assert par.slider_stiffness == pytest.approx(table.stiffness_dyn_cm * DYN_PER_CM, rel=1e-14)
    assert par.slider_damping == pytest.approx(table.damping_dyn_s_cm * DYN_S_PER_CM, rel=1e-14)
    assert par.crank_cog_distance == par.crank_mass == par.slider_guide_angle == par.slider_coulomb_friction == 0.0
    assert par.assembly_branch == 1
    assert entry.crank_speed == pytest.approx(table.speed_rpm * RPM, rel=1e-14)
    assert entry.initial == InitialState(crank_speed=entry.crank_speed)
    assert entry.source.startswith("Youssef")


@pytest.mark.parametrize("name", published.TABLES)
def test_gravity_of_the_published_sets(name: str) -> None:
    # rig 2 lies in a horizontal plane
    horizontal = name.startswith("rig-2")
    assert SETS[name].parameters.gravity == pytest.approx(
        0.0 if horizontal else published.GRAVITY_CM_S2 * CM, rel=1e-14
    )


def test_numbers_of_other_kinds_become_plain_ones() -> None:
    numpy = pytest.importorskip("numpy")
    changed = replace(TABLE_3_1, slider_mass=numpy.float32(0.5), assembly_branch=numpy.int64(-1), gravity=9)
    assert (type(changed.slider_mass), type(changed.assembly_branch), type(changed.gravity)) == (float, int, float)
    assert (changed.slider_mass, changed.assembly_branch, changed.gravity) == (0.5, -1, 9.0)
    assert type(InitialState(crank_angle=numpy.float64(1.0)).crank_angle) is float
    with pytest.raises(ParameterError, match=r"slider\.mass"):
        replace(TABLE_3_1, slider_mass=10**400)
