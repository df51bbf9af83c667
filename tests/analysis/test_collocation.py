"""Periods by Gauss collocation against the integrator: neighbours along a branch, and rows of orbits."""

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from analysis import find_orbit
from analysis.linkages import load_linkage
from analysis.numerics.vectors import LANES
from analysis.periodic import Drive, OrbitError, newton_orbit
from analysis.periodic.motion import collocation
from analysis.periodic.motion.discretisation import Discretisation, can_collocate
from analysis.periodic.motion.variables import Family
from linkwork.five_bar.published import SETS

LINKAGES = Path(__file__).parents[2] / "examples" / "linkages"
SMOOTH = SETS["rig-2-spring-c"].parameters


@pytest.mark.parametrize("linkage", [None, "elastic-bearing"], ids=["five-bar", "two free freedoms"])
def test_a_neighbour_followed_by_collocation_is_the_integrator_s(linkage: str | None) -> None:
    """Ends, their derivatives by the beginnings and by the speed, from one speed to the next, in two pieces."""
    known = SMOOTH if linkage is None else load_linkage(LINKAGES / f"{linkage}.toml").first_set.parameters
    family = Family(parameters=known, drive=Drive(speed=30.0))
    angles = np.array([0.0, pi, 2.0 * pi])
    path = Discretisation(angles, True)
    used = 0
    for speed in np.linspace(30.0, 31.0, 6):
        parameters, drive = family.operation(float(speed))
        orbit = newton_orbit(parameters, drive)
        point = orbit.point
        starts = np.vstack([orbit.start, point.shoot(angles[:2], orbit.start[None, :]).y])
        direction = family.direction(float(speed), 30.0, 31.0)
        found = path.ends(point, starts, float(speed), direction, 1.0)
        used += found.clearance is not None
        ends, matrices, slopes, _ = point.shoot(angles, starts, direction, 1.0)
        scale = np.abs(matrices).max(axis=(0, 1))
        assert found.y == pytest.approx(ends, abs=1e-9)
        assert np.abs(found.matrices - matrices).max() < 1e-8 * scale.max()
        assert np.abs(found.slopes - slopes).max() < 1e-8 * np.abs(slopes).max()
    assert used == 6


def test_a_piece_beyond_the_limit_of_assembly_is_not_forgotten_for_the_next() -> None:
    """Each piece has a row of lanes or more of its own."""
    orbit = find_orbit(SMOOTH, speed=30.0)
    family = Family(parameters=SMOOTH, drive=Drive(speed=30.0))
    angles = np.array([0.0, pi, 2.0 * pi])
    starts = np.vstack([orbit.start, orbit.point.shoot(angles[:2], orbit.start[None, :]).y])
    direction = family.direction(30.0, 30.0, 31.0)
    path = Discretisation(angles, True)
    path._divide(np.linspace(0.0, 2.0 * pi, 4 * LANES + 1), 2)
    path._calls = 1
    assert path.ends(orbit.point, starts, 30.0, direction).clearance is not None
    with pytest.raises(OrbitError, match="limit of assembly"):
        path.ends(orbit.point, starts + np.array([[9.0, 0.0], [0.0, 0.0]]), 30.0, direction)
    assert np.isfinite(path.ends(orbit.point, starts, 30.0, direction).y).all()


@pytest.mark.parametrize(("values", "so_far"), [([1.0, np.nan, 2.0], 0.0), ([1.0], np.nan)])
def test_what_is_no_number_is_the_greatest(values: list[float], so_far: float) -> None:
    assert np.isnan(collocation._greatest.py_func(np.array(values), so_far))


def test_collocation_knows_how_near_the_links_come_to_the_limit_of_assembly() -> None:
    orbit = find_orbit(SMOOTH, speed=30.0)
    family = Family(parameters=SMOOTH, drive=Drive(speed=30.0))
    path = Discretisation(np.array([0.0, 2.0 * pi]), True)
    direction = family.direction(30.0, 30.0, 31.0)
    found = path.ends(orbit.point, orbit.start[None, :], 30.0, direction, 1.0)
    assert found.clearance == pytest.approx(orbit.clearance(), rel=1e-2)


def test_friction_and_torques_are_left_to_the_integrator() -> None:
    """The kink of Coulomb friction has no polynomial; under a torque the crank's rate is unknown too."""
    rough, drive = replace(SMOOTH, slider_coulomb_friction=0.2), Drive(speed=30.0)
    assert can_collocate([drive], [SMOOTH])
    assert not can_collocate([drive], [SMOOTH, rough])
    assert not can_collocate([drive, Drive(torque=1.0)], [SMOOTH])
