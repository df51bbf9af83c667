"""Periods by Gauss collocation against the integrator: neighbours along a branch, and rows of orbits."""

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from analysis import find_orbit
from analysis.linkages import linkage, load_linkage
from analysis.numerics.vectors import LANES
from analysis.periodic import Drive, OrbitError, grid, newton_orbit, plane
from analysis.periodic.motion import collocation
from analysis.periodic.motion.discretisation import Discretisation, can_collocate
from analysis.periodic.motion.kernels import Status
from analysis.periodic.motion.variables import Family
from linkwork.five_bar.published import SETS

LINKAGES = Path(__file__).parents[2] / "examples" / "linkages"
SMOOTH = SETS["rig-2-spring-c"].parameters


@pytest.mark.parametrize("example", [None, "elastic-bearing"], ids=["five-bar", "two free freedoms"])
def test_a_neighbour_followed_by_collocation_is_the_integrator_s(example: str | None) -> None:
    """Ends, their derivatives by the beginnings and by the speed, from one speed to the next, in two pieces."""
    known = SMOOTH if example is None else load_linkage(LINKAGES / f"{example}.toml").first_set.parameters
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


def test_links_that_do_not_reach_between_the_nodes_are_no_motion_of_a_chart(tmp_path: Path) -> None:
    """Two links without mass reach a shaken carriage up to a travel, closed form, which is exceeded by 0.04 % between nodes."""
    mass, stiffness, damping, unbalance, reach = 2.0, 1800.0, 4.0, 0.01, 0.0101
    lag = np.arctan2(damping * 24.6, stiffness - mass * 24.6**2)
    built = linkage("reach", ground={"O": (0, 0), "D": (-0.2, 0)}, assembly={"E": 1})
    built.body("carriage", points={"P": (0, 0), "Q": (0, 0)}, mass=1.0)
    # the travel is greatest in the middle of the first element
    cog = (unbalance * np.cos(pi / 8 - lag), -unbalance * np.sin(pi / 8 - lag))
    built.body("rotor", bar=("P", "T"), length=0.05, mass=1.0, cog=cog, inertia=1e-3)
    for name, pin in (("left", "D"), ("right", "Q")):
        built.body(name, bar=(pin, "E"), length=0.5 * (0.2 + reach), mass=0, cog=(0, 0), inertia=0)
    built.slide("rail", body="carriage", through="O").spring("spring", at="rail", stiffness=1800.0, damping=4.0)
    rig = built.freedom("rotor", "P", speed=20.0).freedom("across", "rail").mechanism().first_set.parameters
    # travel^2 (stiffness - mass w^2)^2 + (travel damping w)^2 = (unbalance w^2)^2
    travel = reach * np.array([0.996, 0.998, 1.0004])
    middle = damping**2 - 2.0 * mass * stiffness
    sizes = [np.roots([(t * mass) ** 2 - unbalance**2, t**2 * middle, (t * stiffness) ** 2]) for t in travel]
    speeds = np.sqrt([min(size) for size in sizes])
    found = grid(plane(rig, Drive(speed=20.0), "drive.speed", "spring.damping"), speeds, [4.0], folder=tmp_path)
    assert found.status.tolist() == [[Status.DONE, Status.DONE, Status.LIMIT]]


def test_friction_and_torques_are_left_to_the_integrator() -> None:
    """The kink of Coulomb friction has no polynomial; under a torque the crank's rate is unknown too."""
    rough, drive = replace(SMOOTH, slider_coulomb_friction=0.2), Drive(speed=30.0)
    assert can_collocate([drive], [SMOOTH])
    assert not can_collocate([drive], [SMOOTH, rough])
    assert not can_collocate([drive, Drive(torque=1.0)], [SMOOTH])
