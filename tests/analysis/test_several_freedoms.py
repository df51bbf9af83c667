"""Responses of a mechanism with two free coordinates, each a linear oscillator with an unbalance: closed forms."""

from dataclasses import replace
from math import hypot, pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from analysis import Inputs, figures, find_orbit, periodic
from analysis.linkages import linkage
from analysis.periodic.motion.discretisation import operating_point
from analysis.periodic.motion.drive import start_ranges
from analysis.periodic.motion.flow import VARIATIONAL
from analysis.periodic.motion.kernels import Status, segments
from analysis.periodic.motion.orbit import first_guess
from analysis.run import load_case
from analysis.run.case_files import Case
from analysis.tuning import Wish, tune
from analysis.units import RAD_S_PER_RPM

SHAKER = """
[linkage]
name = "shaker"
[linkage.ground]
O = [0, 0]
[linkage.bodies]
carriage = { points = { H = [0, 0] }, mass = "2 kg" }
frame = { points = { P = [0, 0] }, mass = "7 kg" }
rotor = { points = { P = [0, 0] }, mass = "1 kg", cog = ["10 mm", 0], inertia = "0.01 kg*m^2" }
[linkage.slides]
X = { body = "carriage", through = "O" }
Y = { body = "frame", on = "carriage", through = "H", direction = "90 deg" }
[linkage.springs]
side = { at = "X", stiffness = "40 N/mm", damping = "60 N*s/m" }
up = { at = "Y", stiffness = "20 N/mm", damping = "40 N*s/m" }
[linkage.freedoms]
rotor = { joint = "P", speed = "500 rpm" }
across = "X"
upright = "Y"
"""
LOW, HIGH = 300.0 * pi / 30.0, 900.0 * pi / 30.0


def peak(stiffness: float, damping: float, mass: float) -> float:
    """The speed at which an unbalance shakes an oscillator most."""
    ratio = damping / (2.0 * sqrt(stiffness * mass))
    return sqrt(stiffness / mass / (1.0 - 2.0 * ratio**2))


def size(speed: float, stiffness: float, damping: float, mass: float) -> float:
    return 0.01 * speed**2 / hypot(stiffness - mass * speed**2, damping * speed)


ACROSS, UPRIGHT = (4e4, 60.0, 10.0), (2e4, 40.0, 8.0)


@pytest.fixture
def shaker(tmp_path: Path) -> Case:
    path = tmp_path / "shaker.toml"
    path.write_text(SHAKER, encoding="utf-8")
    return load_case(path)


@pytest.fixture
def response(shaker: Case) -> periodic.Response:
    return periodic.frequency_response(shaker.parameters, LOW, HIGH, drive=periodic.Drive(speed=LOW))


def test_every_coordinate_has_its_resonance(response: periodic.Response) -> None:
    (branch,) = response.branches
    for n, oscillator in enumerate((ACROSS, UPRIGHT)):
        exact = [size(speed, *oscillator) for speed in branch.parameter]
        assert branch.amplitudes[:, n] == pytest.approx(exact, rel=1e-5)
    for top, (number, oscillator) in zip(response.maxima(), ((1, UPRIGHT), (0, ACROSS)), strict=True):
        assert top.coordinate == number
        assert top.parameter == pytest.approx(peak(*oscillator), rel=1e-8)
        assert top.amplitude == pytest.approx(size(peak(*oscillator), *oscillator), rel=1e-8)
    assert [(a.risk, a.coordinate) for a in response.speeds_to_avoid] == [
        (periodic.Risk.RESONANCE, "upright position"), (periodic.Risk.RESONANCE, "across position"),
    ]  # fmt: skip
    for avoided, oscillator in zip(response.speeds_to_avoid, (UPRIGHT, ACROSS)):
        half = size(peak(*oscillator), *oscillator) / sqrt(2.0)
        assert [size(speed, *oscillator) for speed in (avoided.low, avoided.high)] == pytest.approx(
            [half] * 2, rel=1e-3
        )


def test_what_moves_the_second_resonance(response: periodic.Response) -> None:
    top = response.maxima()[0]
    found = periodic.special_gradient(response.family, top, ("up.stiffness", "side.stiffness", "up.damping"))
    step = 1e-4
    for name, changed in (("up.stiffness", 0), ("up.damping", 1)):
        up, down = ([v * (1.0 + way * step * (n == changed)) for n, v in enumerate(UPRIGHT)] for way in (1, -1))
        exact = (peak(*up) - peak(*down)) / (2.0 * step * peak(*UPRIGHT))
        assert found.place.elasticities[name] == pytest.approx(exact, rel=1e-4)
    assert found.place.elasticities["side.stiffness"] == pytest.approx(0.0, abs=1e-9)
    assert found.amplitude.value == pytest.approx(top.amplitude)


def test_table_and_picture_show_all_coordinates(response: periodic.Response) -> None:
    columns = response.branches[0].columns()
    for name in ("amplitude", "mean", "harmonic 1"):
        assert {f"{name} of across position [m]", f"{name} of upright position [m]"} <= columns.keys()
    assert "across.position" in repr(response)
    assert "upright.position" in repr(response)
    picture = figures.picture(response)
    labels = [part.y_label.replace("\n", " ") for part in picture.parts]
    assert labels[:3] == [
        "amplitude of across position [mm]", "amplitude of upright position [mm]", "harmonics of across position [mm]",
    ]  # fmt: skip
    shown = max(float(np.nanmax(curve.y, initial=0.0)) for curve in picture.parts[1].curves)
    assert shown == pytest.approx(1e3 * size(peak(*UPRIGHT), *UPRIGHT), rel=1e-2)


def test_two_unstable_branches_on_one_another_are_drawn_once() -> None:
    """Otherwise the dashes of one fill the gaps of the other."""
    from tests.analysis.periodic_branches import branch

    x = np.linspace(1.0, 2.0, 60)
    rho = np.where((x > 1.3) & (x < 1.7), 2.0, 0.5)
    pair: list[periodic.Branch] = [branch(x, 1.0 + x, rho), branch(x, 1.0 + x, 2.0), branch(x, 1.4 + x, 2.0)]
    (main, *_) = figures.picture(periodic.Response(branches=tuple(pair), low=1.0, high=2.0, problems=())).parts
    dashed = [np.asarray(curve.y, dtype=float) for curve in main.curves if curve.line == "--"]
    dashed = [y for y in dashed if len(np.atleast_1d(y))]
    drawn = np.array([np.isfinite(y) for y in dashed])
    assert drawn[2].all()
    assert not (drawn[0] & drawn[1]).any()
    assert (drawn[0] | drawn[1]).all()


def test_tuning_leads_the_second_resonance_out_of_the_range(shaker: Case) -> None:
    wish = Wish(
        parameters=shaker.parameters, change={"up.stiffness": "40 %"}, speeds=("440 rpm", "520 rpm"), no_resonance=True
    )
    tuned = tune(wish)
    assert tuned.met
    (stiffness,) = tuned.values
    # the nearer end of the range, less the margin of 2 %
    assert peak(stiffness, *UPRIGHT[1:]) == pytest.approx(0.98 * 440.0 * pi / 30.0, rel=1e-6)
    assert len(figures.plot(tuned).axes) == 3


def test_a_coordinate_that_does_not_move_has_no_resonance() -> None:
    """A braked drum behind an elastic coupling turns evenly with the crank: what moves is the error of the solution."""
    train = linkage("train", ground={"A": (0, 0), "K": (0, 0)})
    train.body("crank", points={"A": (0, 0)}, mass=1.0, inertia=0.2)
    train.body("drum", points={"K": (0, 0)}, mass=1.0, inertia=0.2)
    train.spring("coupling", bodies=("crank", "drum"), stiffness="50 N*m/rad", damping="1 N*m*s/rad")
    train.spring("brake", at="K", damping="0.5 N*m*s/rad")
    made = train.freedom("crank", "A", speed="60 rpm").freedom("drum", "K", driven=False).mechanism()
    response = periodic.frequency_response(made.first_set.parameters, 5.0, 30.0)
    assert not response.branches[0].amplitudes.any()
    assert response.maxima() == response.speeds_to_avoid == ()


def test_without_damping_rounding_makes_no_torus_points(shaker: Case) -> None:
    still = replace(shaker.parameters, side_damping=0.0, up_damping=0.0)
    (branch,) = periodic.frequency_response(still, 300.0 * pi / 30.0, 420.0 * pi / 30.0).branches
    assert set(branch.stability()) == {periodic.Stability.MARGINAL}
    assert branch.special == ()


def test_one_freedom_that_excites_itself_has_torus_points_at_a_prescribed_speed() -> None:
    """Van der Pol's oscillator, forced: entrained between two speeds, at which the mean damping over a turn is zero."""
    table = linkage("self-excited", ground={"O": (0, 0)}, gravity=0.0)
    table.body("table", points={"A": (0, 0)}, mass=9.0)
    table.body("rotor", points={"A": (0, 0)}, mass=1.0, cog=(0.02, 0), inertia=1e-3)
    table.slide("X", body="table", through="O")
    table.spring("spring", at="X", law="k*x - (c - d*x**2)*v", constants={"k": 1000.0, "c": 2.0, "d": 4000.0})
    made = table.freedom("rotor", "A", speed="100 rpm").freedom("table", "X").mechanism()
    response = periodic.frequency_response(made.first_set.parameters, 9.0, 11.0)
    points = response.branches[0].special
    assert [point.kind for point in points] == 2 * [periodic.Crossing.TORUS]
    for point in points:
        assert np.mean(point.orbit.turn()["table.position"] ** 2) == pytest.approx(2.0 / 4000.0, rel=1e-8)
        assert periodic.normal_form(response.family, point).words == "supercritical"
    lost = [(each.low, each.high) for each in response.speeds_to_avoid if each.risk is periodic.Risk.UNSTABLE]
    assert lost == [(9.0, points[0].parameter), (points[1].parameter, 11.0)]


def test_the_common_period_of_two_cranks_counts_the_turns_of_a_gear() -> None:
    """Both rotors turn once while the wheel on the second one turns half: the motion repeats after two turns."""
    built = linkage("geared-shaker", ground={"O": (0, 0)}).slide("X", body="table", through="O")
    built.body("table", points={"L": (0, 0), "R": (0, 0.2), "W": (0, 0.3)}, mass=80)
    for body, point, eccentricity in (("left", "L", 0.05), ("right", "R", 0.05), ("wheel", "W", 0.06)):
        built.body(body, points={point: (0, 0)}, mass=4, cog=(eccentricity, 0), inertia=0.02)
    built.gear("teeth", bodies=("right", "wheel"), ratio=-0.5)
    built.spring("mount", at="X", stiffness="60 kN/m", damping="300 N*s/m")
    built.freedom("left", "L", speed="600 rpm").freedom("right", "R", speed="600 rpm", driven=True).freedom("x", "X")
    orbit = find_orbit(built.mechanism().first_set, Inputs(left_speed="600 rpm", right_speed="600 rpm"))
    assert (orbit.turn().period, orbit.periods) == (pytest.approx(0.2), 1)
    wanted = np.zeros(2001)
    for unbalance, speed in ((0.4, 20.0 * pi), (0.24, 10.0 * pi)):
        across = unbalance * speed**2 / (60e3 - 92.0 * speed**2 + 300j * speed)
        wanted += (across * np.exp(1j * speed * np.linspace(0.0, 0.2, 2001))).real
    assert orbit.amplitude == pytest.approx(0.5 * np.ptp(wanted), rel=1e-4)


def test_a_drum_behind_a_gear_and_elastic_shafts_has_its_resonance() -> None:
    """The drum turns -2/5 times for each turn of the rotor, so that its unbalance shakes it at 2/5 of the speed."""
    built = linkage("line", ground={"A": (0, 0), "B": (0, 0.3), "K": (0, 0), "L": (0, 0.3)}, gravity=9.81)
    for body, point, inertia in (("rotor", "A", 0.2), ("pinion", "K", 0.01), ("wheel", "B", 0.3)):
        built.body(body, points={point: (0, 0)}, mass=1, inertia=inertia)
    built.body("drum", points={"L": (0, 0)}, mass=20, cog=("2 mm", 0), inertia=1.5)
    built.gear("teeth", bodies=("pinion", "wheel"), ratio=-0.4)
    built.spring("first", bodies=("rotor", "pinion"), stiffness=4000.0, damping=0.5)
    built.spring("second", bodies=("wheel", "drum"), stiffness=9000.0, damping=0.8)
    built.freedom("rotor", "A", speed="300 rpm").freedom("pinion", "K", driven=False).freedom("drum", "L", driven=False)
    response = periodic.frequency_response(built.mechanism().first_set, "1500 rpm", "1640 rpm")
    (drum,) = (top for top in response.maxima() if top.coordinate == 1)
    speeds = np.linspace(1565.0, 1578.0, 5201) * RAD_S_PER_RPM
    turning, g = 0.4j * speeds[:, None, None], -0.4
    stiffness = np.array([[4000.0 + 9000.0 * g * g, -9000.0 * g], [-9000.0 * g, 9000.0]])
    damping = np.array([[0.5 + 0.8 * g * g, -0.8 * g], [-0.8 * g, 0.8]])
    mass = np.diag([0.01 + 0.3 * g * g, 1.5 + 20.0 * 0.002**2])
    load = np.broadcast_to([[0.0], [20.0 * 0.002 * 9.81]], (len(speeds), 2, 1))
    swing = np.abs(np.linalg.solve(stiffness + turning * damping + turning**2 * mass, load))[:, 1, 0]
    assert drum.parameter == pytest.approx(speeds[swing.argmax()], rel=1e-4)
    assert drum.amplitude == pytest.approx(swing.max(), rel=1e-3)
    assert {avoided.risk for avoided in response.speeds_to_avoid} == {periodic.Risk.RESONANCE}


#: A four-bar whose shaft twists, whose coupler bends and whose rocker stretches.
ELASTIC = """
[linkage]
name = "elastic-four-bar"
[linkage.ground]
A = [0, 0]
G = [0, 0]
D = ["150 mm", 0]
[linkage.bodies]
wheel = { points = { G = [0, 0] }, mass = "2 kg", inertia = "50 kg*cm^2" }
crank = { bar = ["A", "B"], length = "50 mm", mass = "0.04 kg", inertia = "0.08 kg*cm^2" }
first = { bar = ["B", "M"], length = "75 mm", mass = "0.06 kg", inertia = "0.3 kg*cm^2" }
second = { bar = ["M", "C"], length = "75 mm", mass = "0.06 kg", inertia = "0.3 kg*cm^2" }
rocker = { bar = ["D", "E"], length = "60 mm", mass = "0.05 kg", inertia = "0.2 kg*cm^2" }
tip = { points = { C = [0, 0] }, mass = "0.1 kg", inertia = "1 kg*cm^2" }
[linkage.slides]
S = { body = "tip", on = "rocker", through = "D", direction = "0 deg" }
[linkage.springs]
shaft = { bodies = ["wheel", "crank"], stiffness = "300 N*m/rad", damping = "0.3 N*m*s/rad" }
bend = { at = "M", stiffness = "400 N*m/rad", damping = "0.3 N*m*s/rad" }
stretch = { at = "S", stiffness = "500 N/mm", free = "120 mm", damping = "60 N*s/m" }
[linkage.freedoms]
wheel = { joint = "G", speed = "300 rpm" }
crank = { joint = "A", start = 0 }
bend = { joint = "M", start = 0 }
stretch = { joint = "S", start = "120 mm" }
[linkage.assembly]
C = 1
"""


def test_starts_of_elastic_bodies_that_would_take_for_ever(tmp_path: Path) -> None:
    """A stretch through zero takes steps without end, and a shaft that is wound up turns hundreds of times in a turn."""
    path = tmp_path / "elastic.toml"
    path.write_text(ELASTIC, encoding="utf-8")
    case = load_case(path)
    drive = periodic.steady_drive(case.parameters, case.inputs, case.initial)
    point = operating_point(case.parameters, drive)
    ranges = start_ranges(case.parameters, drive, first_guess(point.flow, drive, None))
    assert max(abs(bound[0]) for bound in ranges) < pi
    start = np.array([-0.338402922, 1.42102287, -0.0118267618, 29.7565734, -58.3057234, 0.498258135])
    rows = np.empty((1, 42))
    status = segments(point.section(start, VARIATIONAL, tolerance=1e-6), np.array([0.0, 0.2]), start[None], rows)
    assert status == Status.NO_STEP
    assert find_orbit(case.parameters, case.inputs).verdict().stability is periodic.Stability.STABLE
