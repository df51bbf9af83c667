"""Parameters: what is refused and what is said, the derived constants, and the published sets against their tables."""

from dataclasses import MISSING, FrozenInstanceError, asdict, fields, replace
from math import hypot, inf, nan, pi, radians
from typing import Any, Mapping, NamedTuple

import numpy as np
import pytest

from linkwork.errors import LinkworkError, MissingParameterError, ParameterError, UnknownNameError
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.parameters import field_name
from linkwork.slider_crank import published as sets_3_1
from linkwork.slider_crank.parameters import InitialState as SliderCrankStart
from tests import published
from tests import published_rahman as rahman
from tests.published import CM, DYN_PER_CM, DYN_S_PER_CM, G_CM2, GRAM, RPM
from tests.published_rahman import INCH, POUND_FORCE, POUND_INCH

#: A slider-crank with every parameter, the crank as light in inertia as it may be to spare.
EXAMPLE = sets_3_1.parameters(10.0)


def contract(**names: str) -> dict[str, str | None]:
    """Every parameter by its name in the FMI contract, with the least value that it may have: None for any."""
    least = {"positive": "above 0", "not_negative": "0", "sign": "+1 or -1", "any": None}
    return {name: least[key] for key, group in names.items() for name in group.split()}


FIVE_BAR = contract(
    positive="ground.length crank.length coupler.length rocker.length crank.inertia",
    not_negative=(
        "crank.mass coupler.mass rocker.mass slider.mass coupler.inertia rocker.inertia slider.stiffness "
        "slider.damping slider.coulomb_friction slider.friction_coefficient pin.A_friction_radius "
        "pin.B_friction_radius pin.C_friction_radius pin.D_friction_radius gravity"
    ),
    any=(
        "crank.cog_distance coupler.cog_distance rocker.cog_distance crank.cog_angle coupler.cog_angle "
        "rocker.cog_angle slider.guide_angle slider.spring_free_position coupler.point_distance "
        "coupler.point_angle ground.inclination"
    ),
    sign="assembly.branch",
)
SLIDER_CRANK = contract(
    positive="crank.length rod.length crank.mass crank.inertia",
    any=(
        "guide.offset guide.twist crank.cog_x crank.cog_y crank.cog_z crank.product_xz crank.product_yz "
        "rod.cog_distance slider.cog_x slider.cog_y slider.cog_z slider.spring_free_position "
        "shift.spring_free_position groove.amplitude groove.ratio gravity.x gravity.y gravity.z"
    ),
    not_negative=(
        "rod.mass slider.mass rod.inertia slider.stiffness slider.damping slider.coulomb_friction "
        "shift.stiffness shift.damping"
    ),
    sign="assembly.branch",
)


class Kind(NamedTuple):
    """A mechanism with every parameter, the start's class, and what the contract says of it."""

    example: Any
    start: type
    contract: Mapping[str, str | None]
    defaults: dict[str, float]  # those that are not zero
    needed: set[str]  # fields without a default
    branch: str  # what the sign of the assembly is


KINDS = {
    "five-bar": Kind(
        TABLE_3_1,
        InitialState,
        FIVE_BAR,
        {"gravity": 9.81, "assembly_branch": 1},
        {f"{link}_length" for link in ("ground", "crank", "coupler", "rocker")}
        | {f"{link}_mass" for link in ("coupler", "rocker", "slider")}
        | {f"{link}_inertia" for link in ("crank", "coupler", "rocker")}
        | {"coupler_cog_distance", "rocker_cog_distance"},
        "the sign of sin(rocker.angle - coupler.angle)",
    ),
    "slider-crank": Kind(
        EXAMPLE,
        SliderCrankStart,
        SLIDER_CRANK,
        {"groove_ratio": 1.0, "assembly_branch": 1},
        {"crank_length", "rod_length", "guide_twist", "crank_mass", "crank_inertia"},
        "the side of the crank pin's foot on the guide on which the slider is",
    ),
}
EVERY_KIND = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)


def parameters_that(*least: str | None) -> pytest.MarkDecorator:
    """Every parameter of every mechanism, or those whose least value is one of these."""
    rows = [
        pytest.param(kind, fmi, id=f"{name}-{fmi}")
        for name, kind in KINDS.items()
        for fmi, requirement in kind.contract.items()
        if not least or requirement in least
    ]
    return pytest.mark.parametrize(("kind", "name"), rows)


def refusal(example: Any, **changes: Any) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        replace(example, **changes)
    return caught.value


@EVERY_KIND
def test_fields_are_those_of_the_contract(kind: Kind) -> None:
    assert {f.name for f in fields(kind.example)} == {name.replace(".", "_") for name in kind.contract}


@pytest.mark.parametrize("value", [nan, inf, -inf, "0.1", None, True, 1j, [0.1]])
@parameters_that()
def test_every_field_refuses_what_is_not_a_finite_number(kind: Kind, name: str, value: object) -> None:
    error = refusal(kind.example, **{field_name(name): value})
    assert error.name == name
    assert str(error).startswith(f"parameter {name} is {value!r}: it must be ")
    assert isinstance(error, LinkworkError)
    assert isinstance(error, ValueError)


@parameters_that("0", "above 0")
def test_wrong_sign_is_refused_and_zero_where_nothing_would_be_left(kind: Kind, name: str) -> None:
    error = refusal(kind.example, **{field_name(name): -1e-9})
    assert error.name == name
    assert "zero" in error.requirement
    if kind.contract[name] == "above 0":
        assert "greater than zero" in str(refusal(kind.example, **{field_name(name): 0.0}))


@parameters_that("0", None)
def test_zero_is_allowed_elsewhere_and_either_sign_of_a_direction(kind: Kind, name: str) -> None:
    value = 0.0 if kind.contract[name] == "0" else -0.02
    assert getattr(replace(kind.example, **{field_name(name): value}), field_name(name)) == value


@pytest.mark.parametrize("value", [0, 2, -2, 0.5])
@EVERY_KIND
def test_branch_is_one_of_two(kind: Kind, value: float) -> None:
    error = refusal(kind.example, assembly_branch=value)
    assert error.name == "assembly.branch"
    assert f"+1 or -1, {kind.branch}" in str(error)


@EVERY_KIND
def test_defaults_are_nothing_but_what_the_thesis_has(kind: Kind) -> None:
    defaults = {f.name: f.default for f in fields(kind.example) if f.default is not MISSING}
    assert {name: value for name, value in defaults.items() if value != 0.0} == kind.defaults
    assert {f.name for f in fields(kind.example)} - set(defaults) == kind.needed


def test_crank_inertia_about_the_shaft_includes_its_mass() -> None:
    crank = {"crank_mass": 2.0, "crank_cog_distance": -0.03}
    error = refusal(TABLE_3_1, crank_inertia=0.9 * 2.0 * 0.03**2, **crank)
    assert error.name == "crank.inertia"
    assert "0.0018 kg.m2" in str(error)
    # a point mass is allowed, but for the last digits of its moment of inertia
    replace(TABLE_3_1, crank_inertia=2.0 * 0.03 * 0.03 * (1.0 - 1e-12), **crank)


def test_crank_inertia_about_the_axis_includes_its_mass() -> None:
    crank = {"crank_mass": 2.0, "crank_cog_x": -0.03, "crank_cog_y": 0.04}
    error = refusal(EXAMPLE, crank_inertia=0.9 * 2.0 * 0.05**2, **crank)
    assert error.name == "crank.inertia"
    assert "0.005 kg.m2" in str(error)
    assert replace(EXAMPLE, crank_inertia=2.0 * 0.05**2, **crank).crank_mass == 2.0  # a point mass is allowed
    # how far along the axis it is does not matter
    assert replace(EXAMPLE, crank_inertia=2.0 * 0.05**2, crank_cog_z=10.0, **crank).crank_cog_z == 10.0


def test_something_has_to_move_with_the_slider() -> None:
    error = refusal(TABLE_3_1, rocker_mass=0.0, slider_mass=0.0)
    assert error.name == "slider.mass"
    replace(TABLE_3_1, rocker_mass=0.0)
    replace(TABLE_3_1, slider_mass=0.0)


def test_constants_that_overflow_are_refused() -> None:
    error = refusal(EXAMPLE, rod_mass=1e20, rod_length=1e-70, rod_cog_distance=1e75)
    assert error.name == "rod.cog_distance"
    assert "finite moments of inertia" in str(error)


@EVERY_KIND
def test_parameters_are_frozen_and_have_no_other_fields(kind: Kind) -> None:
    with pytest.raises(FrozenInstanceError):
        kind.example.crank_length = 0.0
    with pytest.raises(TypeError, match="crank_lenght"):
        type(kind.example)(**asdict(kind.example), crank_lenght=0.1)
    assert replace(kind.example) == kind.example
    assert hash(replace(kind.example)) == hash(kind.example)


@pytest.mark.parametrize("value", [nan, inf, "0", None, False])
@EVERY_KIND
def test_start_refuses_what_is_not_a_finite_number(kind: Kind, value: Any) -> None:
    for field in fields(kind.start):
        with pytest.raises(ParameterError, match=rf"parameter initial\.{field.name} is .* it must be a finite number"):
            kind.start(**{field.name: value})


@EVERY_KIND
def test_numbers_of_other_kinds_become_plain_ones(kind: Kind) -> None:
    gravity = "gravity" if "gravity" in kind.contract else "gravity_z"
    changed = replace(kind.example, slider_mass=np.float32(0.5), assembly_branch=np.int64(-1), **{gravity: 9})
    values = (changed.slider_mass, changed.assembly_branch, getattr(changed, gravity))
    assert tuple(map(type, values)) == (float, int, float)
    assert values == (0.5, -1, 9.0)
    assert type(kind.start(crank_angle=np.float64(1.0)).crank_angle) is float
    with pytest.raises(ParameterError, match=r"slider\.mass"):
        replace(kind.example, slider_mass=10**400)


def test_gravity_in_the_frame_of_an_inclined_ground_link() -> None:
    # x points up the slope: gravity pulls back along it
    p = replace(TABLE_3_1, ground_inclination=pi / 6).constants()
    assert (p.gx, p.gy) == pytest.approx((-9.81 * 0.5, -9.81 * 0.75**0.5), rel=1e-14)
    assert TABLE_3_1.constants().gy == -9.81


# ------------------------------------------------------------------ published sets: Youssef's tables


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
    printed = {
        "coupler_cog_distance": table.coupler_cog_cm * CM,
        "rocker_cog_distance": table.rocker_cog_cm * CM,
        **{f"{part}_mass": mass * GRAM for part, mass in zip(("coupler", "rocker", "slider"), table.masses_g)},
        "coupler_inertia": table.coupler_inertia_g_cm2 * G_CM2,
        "rocker_inertia": table.rocker_inertia_g_cm2 * G_CM2,
        "crank_inertia": published.CRANK_INERTIA_G_CM2 * G_CM2,
        "slider_stiffness": table.stiffness_dyn_cm * DYN_PER_CM,
        "slider_damping": table.damping_dyn_s_cm * DYN_S_PER_CM,
        # rig 2 lies in a horizontal plane
        "gravity": 0.0 if name.startswith("rig-2") else published.GRAVITY_CM_S2 * CM,
    }
    assert {name: getattr(par, name) for name in printed} == pytest.approx(printed, rel=1e-14)
    assert par.crank_cog_distance == par.crank_mass == par.slider_guide_angle == par.slider_coulomb_friction == 0.0
    assert par.assembly_branch == 1
    assert entry.crank_speed == pytest.approx(table.speed_rpm * RPM, rel=1e-14)
    assert entry.initial == InitialState(crank_speed=entry.crank_speed)
    assert entry.source.startswith("Youssef")


# ------------------------------------------------------------------ published sets: Rahman's section 3.1


@pytest.mark.parametrize("offset_in", rahman.OFFSETS_IN)
@pytest.mark.parametrize("twist_deg", rahman.TWISTS_DEG)
def test_published_set_is_the_data_of_section_3_1(offset_in: float, twist_deg: float) -> None:
    par = sets_3_1.parameters(offset_in, twist_deg)
    mass = POUND_FORCE / INCH  # lb.s2/in
    lengths = [12.0 * INCH, 50.0 * INCH, offset_in * INCH]
    assert [par.crank_length, par.rod_length, par.guide_offset] == pytest.approx(lengths, rel=1e-14)
    assert par.guide_twist == pytest.approx(radians(twist_deg), rel=1e-15)
    masses = [m * mass for m in rahman.MASSES_LB_S2_IN]
    assert (par.crank_mass, par.rod_mass, par.slider_mass) == pytest.approx(masses, rel=1e-14)
    # radii of gyration as printed, about the link's end; the rod's is given about its centre of mass
    r1, r2 = rahman.CRANK_RADIUS_IN, rahman.ROD_RADIUS_IN
    assert par.crank_inertia == pytest.approx(masses[0] * (r1**2 / 4 + 12.0**2 / 3) * INCH**2, rel=1e-12)
    at_end = par.rod_inertia + par.rod_mass * par.rod_cog_distance**2
    assert at_end == pytest.approx(masses[1] * (r2**2 / 4 + 50.0**2 / 3) * INCH**2, rel=1e-12)
    assert (par.crank_cog_x, par.rod_cog_distance) == pytest.approx((6.0 * INCH, 25.0 * INCH), rel=1e-14)
    others = set(map(field_name, SLIDER_CRANK)) - {
        "crank_length", "rod_length", "guide_offset", "guide_twist", "crank_mass", "rod_mass", "slider_mass",
        "crank_inertia", "rod_inertia", "crank_cog_x", "rod_cog_distance", "groove_ratio", "assembly_branch",
    }  # fmt: skip
    assert all(getattr(par, name) == 0.0 for name in others)
    assert par.assembly_branch == 1


def test_speed_torque_and_start_of_section_3_1() -> None:
    assert pytest.approx(rahman.SPEED_RPM * 2.0 * pi / 60.0, rel=1e-15) == sets_3_1.CRANK_SPEED
    assert pytest.approx(rahman.TORQUE_LB_IN * POUND_INCH, rel=1e-15) == sets_3_1.CRANK_TORQUE
    start = sets_3_1.initial(3.5)
    assert start == SliderCrankStart(crank_speed=sets_3_1.CRANK_SPEED, shift_position=3.5 * INCH)
    assert (sets_3_1.parameters(10.0), start) == sets_3_1.OFFSET_CASE
    twisted = sets_3_1.SETS["rahman-a4-20-alpha4-232"]
    assert (twisted.parameters, twisted.initial) == (sets_3_1.parameters(20.0, 232.0), sets_3_1.initial())
    assert hypot(sets_3_1.INCH - INCH, sets_3_1.POUND_FORCE - POUND_FORCE, sets_3_1.POUND_INCH - POUND_INCH) == 0.0


@pytest.mark.parametrize(("example", "least"), [(TABLE_3_1, FIVE_BAR), (EXAMPLE, SLIDER_CRANK)])
def test_values_with_which_one_cannot_compute_are_refused_by_name(example: Any, least: dict[str, str | None]) -> None:
    for name, lower in least.items():
        values = {1e308: "at most 1e+75 in magnitude", 1.1e75: "at most 1e+75 in magnitude"}
        if lower is None:
            values[-1e76] = "at most 1e+75 in magnitude"
        elif lower == "above 0":
            values |= {5e-324: "at least 1e-75", 0.9e-75: "at least 1e-75"}
        for value, words in values.items() if lower != "+1 or -1" else ():
            error = refusal(example, **{field_name(name): value})
            assert (error.name, error.value) == (name, value)
            assert str(error).endswith(words)


@pytest.mark.parametrize(("count", "listed"), [(8, [f"a.{n}" for n in range(8)]), (60, ["a.1"])])
def test_of_many_names_the_nearest_five_are_listed(count: int, listed: list[str]) -> None:
    error = UnknownNameError("a.1x", tuple(f"a.{n}" for n in range(count)), words="a name 'a.1x'")
    assert (error.near, len(error.known)) == ("a.1", count)
    found = str(error).partition("names are ")[2].rstrip(")").split(", ")
    assert len(found) == (count if count <= 8 else 5)
    assert set(listed) <= set(found)
    assert f"the nearest of {count} names" in str(error) or count <= 8


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ParameterError("a", "b" * 498, "be short"), f"'{'b' * 498}': it"),
        (ParameterError("a", "b" * 499, "be short"), f"'{'b' * 499}...: it"),
        (MissingParameterError("a"), "missing"),
        (MissingParameterError("a", ("b",)), "missing, and so is b"),
        (MissingParameterError("a", ("b",) * 12), f"missing, and so are {'b, ' * 11}b"),
        (MissingParameterError("a", ("b",) * 13), f"missing, and so are {'b, ' * 11}b and 1 more"),
    ],
)
def test_long_values_and_lists_are_cut(error: ParameterError, said: str) -> None:
    assert str(error).removesuffix(" must be short") == f"parameter a is {said}"
