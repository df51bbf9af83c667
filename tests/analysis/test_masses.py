"""Masses from the sections of links: held against integrals over the bodies, and their origins."""

from dataclasses import replace
from math import hypot, pi
from pathlib import Path

import numpy as np
import pytest

from analysis import Inputs, linkages, simulate, variant
from analysis.mechanisms import PUBLISHED
from analysis.run import describe_masses, load_case, read_case, read_parameters, with_sections
from analysis.sections import Bar, Rod
from linkwork.errors import LinkworkError, ParameterError

BAR = {"kind": "bar", "width": "20 mm", "thickness": "5 mm", "material": "steel"}


def _case(**tables):
    return read_case({"published": "table-3.1", **tables}, folder=Path())


def test_section_gives_mass_centre_and_inertia_about_the_point_of_the_contract():
    """A crank with overhangs, cut into slices: its inertia is about the shaft, a coupler's about the centre of mass."""
    section = BAR | {"overhang": "10 mm"}
    p = _case(crank={"section": section}, coupler={"section": section, "length": "180 mm"}).parameters
    for name, length in (("crank", 0.05), ("coupler", 0.18)):
        n = 4000
        body = length + 0.02
        x = ((np.arange(n) + 0.5) / n) * body - 0.01
        slice_mass = 7850.0 * 0.02 * 0.005 * body / n
        about = 0.0 if name == "crank" else 0.5 * length
        inertia = slice_mass * ((x - about) ** 2 + 0.02**2 / 12.0).sum()
        assert getattr(p, f"{name}_mass") == pytest.approx(n * slice_mass)
        assert getattr(p, f"{name}_cog_distance") == pytest.approx(0.5 * length)
        assert getattr(p, f"{name}_inertia") == pytest.approx(inertia, rel=1e-6)


def test_weighed_mass_keeps_the_radius_of_gyration():
    computed, weighed = (_case(rocker={"section": BAR, **own}).parameters for own in ({}, {"mass": "50 g"}))
    assert weighed.rocker_mass == 0.05
    assert weighed.rocker_inertia / 0.05 == pytest.approx(computed.rocker_inertia / computed.rocker_mass)


def test_plate_has_its_centre_beside_the_line_of_the_pins():
    """A right-angled triangle: its centroid is the mean of the corners, its polar moment m (a^2 + b^2)/18."""
    plate = {"kind": "plate", "thickness": "4 mm", "material": "aluminium"}
    p = _case(coupler={"section": plate | {"corners": [[0, 0], ["150 mm", 0], [0, "90 mm"]]}}).parameters
    mass = 0.5 * 0.15 * 0.09 * 0.004 * 2700.0
    assert p.coupler_mass == pytest.approx(mass)
    assert p.coupler_cog_distance == pytest.approx(hypot(0.05, 0.03))
    assert np.tan(p.coupler_cog_angle) == pytest.approx(0.6)
    assert p.coupler_inertia == pytest.approx(mass * (0.15**2 + 0.09**2) / 18.0)


def test_rahmans_round_links_are_rods():
    """His printed masses, K^2 = r^2/4 + a^2/3 about the end, from diameters and the density 0.28 lbf/in3."""
    printed = PUBLISHED["rahman-ideal"].parameters
    inch, pound, g = 0.0254, 4.4482216152605, 386.0886
    density = 0.28 * pound / inch / g / inch**3
    made = with_sections(printed, crank=Rod("3 in", density), rod=Rod("2 in", density))
    for name in ("crank_mass", "crank_inertia", "crank_cog_x", "rod_mass", "rod_inertia", "rod_cog_distance"):
        assert getattr(made, name) == pytest.approx(getattr(printed, name), rel=1e-3)
    assert made.crank_mass == pytest.approx(pi * 0.25 * (3 * inch) ** 2 * 12 * inch * density)


@pytest.mark.parametrize(
    ("own", "said"),
    [
        ({"section": "bar"}, "coupler.section"),
        ({"section": BAR | {"material": "stell"}}, "coupler.section.material"),
        ({"section": BAR | {"with": "2 mm"}}, "width"),
        ({"section": BAR, "inertia": 1e-3}, "coupler.inertia"),
        ({"section": {"kind": "bra"}}, "bar"),
    ],
)
def test_wrong_sections_are_refused(own, said):
    with pytest.raises(LinkworkError, match=said):
        _case(coupler=own)
    with pytest.raises(LinkworkError):
        with_sections(PUBLISHED["table-3.1"].parameters, couplr=Bar(0.02, 0.005, "steel"))


def test_a_spatial_rod_has_its_mass_on_its_line():
    plate = {"kind": "plate", "thickness": 0.01, "material": "steel", "corners": [[0, 0], [1, 0], [0, 1]]}
    with pytest.raises(ParameterError, match="line of the pins"):
        read_parameters({"rod": {"section": plate}}, PUBLISHED["rahman-ideal"].parameters)


def test_origins_of_masses_and_lengths_that_leave_them():
    masses = {
        m.name: m for m in _case(coupler={"length": "180 mm"}, rocker={"section": BAR}, slider={"mass": 1}).masses
    }
    assert masses["crank.mass"].origin == masses["coupler.mass"].origin == "of table-3.1"
    assert masses["slider.mass"].origin == "as given"
    assert "20 x 5 mm" in masses["rocker.mass"].origin
    assert [name for name, mass in masses.items() if mass.stale] == ["coupler.mass"]
    sentence, (warning,) = describe_masses(tuple(masses.values()))
    assert "slider.mass 1 kg (as given)" in sentence
    assert "coupler.length is 180 mm where table-3.1 has 150 mm" in warning
    given = {"length": "180 mm", "mass": 0.2, "inertia": 1e-3, "cog_distance": "90 mm"}
    assert not any(mass.stale for mass in _case(coupler=given).masses)


def test_masses_of_a_described_linkage_are_those_of_its_sections(tmp_path):
    rod = 'section = { kind = "rod", diameter = "12 mm", material = "steel" }'
    text = linkages.TEXT.replace("{file}", "own.toml").replace('mass = "0.4 kg" ', f'mass = "0.4 kg"\n{rod}')
    kept = [line for line in text.splitlines() if not line.startswith(("cog =", "inertia ="))]
    (tmp_path / "own.toml").write_text("\n".join(kept))
    origin = {mass.name: mass.origin for mass in load_case(tmp_path / "own.toml").masses}
    assert origin["crank.mass"].startswith("of a bar of 20 x 5 mm")
    assert origin["coupler.mass"].startswith("weighed, shaped as a rod of 12 mm")
    assert origin["rocker.mass"].startswith("of a rod of 12 mm")
    (tmp_path / "plain.toml").write_text(text.replace(rod, ""))
    origin = {mass.name: mass.origin for mass in load_case(tmp_path / "plain.toml").masses}
    assert origin["coupler.mass"] == "as given"
    changed = {mass.name: mass for mass in load_case(tmp_path / "own.toml", {"crank.length": "60 mm"}).masses}
    assert "crank.length is 60 mm where my-linkage has 50 mm" in changed["crank.mass"].stale


def test_a_run_says_whose_masses_it_has():
    run = simulate(variant("table-3.1", coupler_length="155 mm", slider_mass="1 kg"), stop_time="2 ms")
    assert "coupler.mass 0.209 kg" in repr(run)
    assert "slider.mass 1 kg (as given)" in run.masses
    assert "coupler.length is 155 mm where table-3.1 has 150 mm" in repr(run)
    own = with_sections("table-3.1", **dict.fromkeys(("crank", "coupler", "rocker"), Bar("20 mm", "5 mm", "steel")))
    run = simulate(variant(own, slider_mass="1 kg"), Inputs(speed="420 rpm"), stop_time="2 ms")
    assert "table-3.1" not in run.masses
    assert not replace(run, parameters=None).masses


def test_lengths_with_a_thesis_masses_are_noted_at_the_shell(linkwork):
    result = linkwork("run", "--published", "table-3.1", "--set", "crank.length=0.04", "--no-plot", "--stop-time", 0.01)
    assert "crank.length is 40 mm where table-3.1 has 50 mm" in result.stderr
    assert "masses: " in result.output
