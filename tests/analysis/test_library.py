"""The library of described linkages in examples/linkages: each against multipliers, by its energy, and what it is known for."""

import cmath
import re
import tomllib
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

import analysis.synthesis as syn
from analysis.export import NATIVE, NATIVE_FMI3, build, build_native
from analysis.linkages import Package, dead_centres, linkage, load_linkage, load_package, reach, read_description
from analysis.linkages.structure import Pin
from analysis.mechanisms import find_mechanism
from analysis.numerics.fourier import FourierSeries
from analysis.periodic import Drive, frequency_response, newton_orbit
from analysis.periodic.motion.discretisation import operating_point
from analysis.probe import probe
from analysis.run import Inputs, Trajectory, check, compare, cosimulate, load_case, read_case, simulate, simulate_many
from analysis.studio import make_page, page_state
from analysis.studio.tables import mechanism_tables
from analysis.synthesis.result.output import description, drives
from linkwork.errors import InputError, IntegrationError, LinkworkError
from linkwork.limits import LIMIT_SINE, MASSLESS
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name
from linkwork.plant import Plant
from tests.oracles.planar import Multipliers, Solution

from .conftest import marked, opened, run_case
from .test_studio import _drag, _shown, in_browser

FOLDER = Path(__file__).parents[2] / "examples" / "linkages"
FILES = sorted(FOLDER.glob("*.toml"))
#: Slots, gears, racks, friction and two cranks: what takes long is tested with these, with the others by `make test-long`.
FIRST = ("elastic-bearing", "geared-five-bar", "hybrid-press", "rack-and-pinion", "shaper")
EVERY = [path if path.stem in FIRST else pytest.param(path, marks=pytest.mark.long) for path in FILES]
#: Their FMUs are probed: slots, and two cranks; the C shell that a probe tries is that of all linkages.
PROBED = ("hybrid-press", "shaper")


def run(name: str, **changes: Any) -> Trajectory:
    """Run a file of the library as it is, or with other entries."""
    return run_case(load_case(FOLDER / f"{name}.toml", changes), tolerance=1e-11)


def test_the_library_is_there():
    assert len(FILES) >= 21


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_positions_at_the_start_change_only_with_the_position_parameters(path):
    made = load_linkage(path)
    start = {v.name: v.start for v in made.variables}

    def positions(**changes: float) -> dict[str, float]:
        values = zip(made.output_names, Plant.from_values(made, start | changes).outputs(), strict=True)
        return {name: value for name, value in values if levels[name] == "position"}

    levels = {v.name: v.level for v in made.variables}
    for v in made.variables:
        if v.causality == "parameter" and v.kind == "Real" and v.name not in made.position_parameters:
            assert positions(**{v.name: 1.01 * v.start or 0.01}) == positions(), v.name


def places(made: Mechanism, oracle: Multipliers, x: Iterable[float], p: Any = None) -> np.ndarray:
    """The places of the bodies at a state, in the coordinates of the oracle."""
    p = made.first_set.parameters.constants() if p is None else p
    found = made.modules[-1].places(tuple(x), p)
    frames = [getattr(found, f"{body}_frame") for body in oracle.bodies]
    return np.array([c for f in frames for c in (f.origin.x, f.origin.y, np.arctan2(f.turn.s, f.turn.c))])


def tables_in(path: Path) -> dict[str, Any]:
    """The tables of a description."""
    found: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))["linkage"]
    return found


def same_joint_forces(package: Package, outputs: Any, oracle: Multipliers, solution: Solution, q: Any) -> None:
    """Compare with their signs the forces in all pins, by body, and in all slides, across their lines and as moments."""
    forces = solution.forces
    scale = 1e-8 * (1.0 + max(np.abs(force).max() for force in forces.values()))
    pins: dict[tuple[str, str], np.ndarray] = {}
    for r in package.motion.reactions:
        if isinstance(r.joint, Pin):
            force = np.array([outputs[f"{r.name}.fx"], outputs[f"{r.name}.fy"]])
            for body, sign in ((r.on, 1.0), (r.by, -1.0)):
                pins[r.joint.name, body] = pins.get((r.joint.name, body), np.zeros(2)) + sign * force
            continue
        sign = 1.0 if r.on == r.joint.bodies[1] else -1.0
        found = [sign * outputs[f"{r.name}.force"], sign * outputs[f"{r.name}.moment"]]
        wanted = forces[r.joint.name]
        np.testing.assert_allclose(found[: len(wanted)], wanted, atol=scale, err_msg=r.name)
    springs, slots = package.description.springs.items(), package.description.slots
    pulls = {s.at: -outputs[f"{name}.exerted_force"] for name, s in springs if s.at in slots}
    for (name, body), force in oracle.on_bodies(solution, pulls, q).items():
        np.testing.assert_allclose(pins.pop((name, body)), force, atol=scale, err_msg=f"{name} on {body}")
    # the massless blocks of slots
    assert {body for _, body in pins} <= set(package.description.slots)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_linkage_of_the_library_moves_as_with_multipliers(path):
    """Its run is whole and keeps its energy; at places along it accelerations, loads and joint forces are the multipliers'."""
    package = load_package(path)
    made = package.mechanism()
    found = run(str(path.with_suffix("")))
    assert found.status == 0, found.message
    energy = abs(found["energy.kinetic"]).max() + abs(found["energy.supplied"]).max()
    assert abs(found["energy.residual"]).max() < 1e-8 * (1e-3 + energy)
    d = package.description
    oracle, equations = Multipliers(d), made.modules[-1]
    known = made.published[made.name]
    p, n = known.parameters.constants(), len(made.freedoms)
    u = tuple(float(v.start) for v in made.variables if v.causality == "input")
    modes = tuple(float(mode.default) for mode in made.modes)
    i = made.equations.apply_inputs(modes, u, p)
    commanded = {made.channels[k].freedom: 0.0 for k in made.commands({mode.name: mode.default for mode in made.modes})}
    for sample in np.linspace(1, len(found) - 1, 4).astype(int):
        names = [f.coordinate for f in made.freedoms] + [f.rate for f in made.freedoms]
        x = (*(float(found[name][sample]) for name in names), 0.0, 0.0)
        m, q = equations.motion(x, i, p), places(made, oracle, x)
        loads = {load.point: (0.0, 0.0) for load in d.loads}
        wanted = oracle.solve(q, np.array(x[n : 2 * n]), np.zeros(n), commanded, loads, {})
        scale = 1.0 + np.abs(wanted.accelerations).max()
        np.testing.assert_allclose(m.accelerations, wanted.accelerations, atol=1e-8 * scale)
        np.testing.assert_allclose(m.loads, wanted.loads, atol=1e-8 * (1.0 + np.abs(wanted.loads).max()))
        outputs = dict(zip(made.output_names, made.equations.outputs(x, i, 0.0, p)))
        same_joint_forces(package, outputs, oracle, wanted, q)


#: A rack that is a lever between a crank and a swivel, whose pin in the ground its gear shares; the gear moves a ram.
LEVER_RACK = """
[linkage]
name = "lever-rack"
gravity = "9.81 m/s^2"
ground = { A = [0, 0], O = ["120 mm", "20 mm"], W = ["120 mm", "-60 mm"] }
bodies.crank = { bar = ["A", "B"], length = "25 mm", mass = 0.02, inertia = 1e-6 }
bodies.lever = { bar = ["B", "T"], length = "200 mm", mass = 0.16, inertia = 5e-4 }
bodies.swivel = { points = { O = [0, 0], S = [0, "30 mm"] }, mass = 0.2, inertia = 1e-4 }
bodies.gear = { points = { O = [0, 0], Q = ["25 mm", 0] }, mass = 0.4, inertia = 2e-4 }
bodies.link = { bar = ["Q", "R"], length = "140 mm", mass = 0.12, inertia = 2e-4 }
bodies.ram = { points = { R = [0, 0] }, mass = 1.0 }
slides.guide = { body = "lever", on = "swivel", through = "S" }
slides.way = { body = "ram", through = "W" }
racks.teeth = { gear = "gear", rack = "lever", radius = "30 mm", offset = "120 mm" }
springs.buffer = { at = "way", law = [["-100 mm", "-200 N"], [0.0, 0.0], ["10 cm", "0.1 kN"], [0.2, 400.0]], damping = 20.0 }
friction = { guide = 0.08, B = "0.5 mm" }
freedoms.crank = { joint = "A", speed = "240 rpm" }
"""

#: A spring and friction in a slot; constants of a law that are called like a cosine and a sine.
SLOTTED_LEVER = """
[linkage]
name = "slotted-lever"
gravity = "9.81 m/s^2"
ground = { A = [0, 0], E = [0, "200 mm"] }
bodies.crank = { bar = ["A", "B"], length = "50 mm", mass = 0.1, inertia = 3e-5 }
bodies.lever = { points = { E = [0, 0], K = ["10 mm", "5 mm"] }, mass = 0.5, cog = ["80 mm", 0], inertia = 2e-3 }
slots.S = { pin = "B", on = "lever", through = "K", direction = "4 deg" }
springs.tab = { at = "S", stiffness = "500 N/m", free = "150 mm", damping = "5 N*s/m" }
springs.return = { at = "E", free = "-70 deg", law = "c*x + s*x**3", constants = { c = "0.5 N*m/rad", s = "0.1 N*m/rad" } }
springs.stop = { at = "E", free = "-1.4 rad", law = "200*(x + fabs(x))" }
friction = { S = 0.15 }
freedoms.crank = { joint = "A", speed = "120 rpm" }
"""

#: A pendulum on a gear that is called like a tooth force; three bodies on a pin, beside a slide that is called like the second.
GEARED_PENDULUM = """
[linkage]
name = "geared-pendulum"
gravity = "9.81 m/s^2"
ground = { A = [0, 0], E = ["90 mm", 0], F = ["150 mm", "-40 mm"], G = ["20 mm", "-120 mm"] }
bodies.crank = { bar = ["A", "B"], length = "40 mm", mass = 0.2, inertia = 1e-4 }
bodies.teeth = { points = { E = [0, 0], Q = ["25 mm", 0] }, mass = 0.3, cog = ["5 mm", 0], inertia = 1e-4 }
bodies.pendulum = { bar = ["Q", "R"], length = "60 mm", mass = 0.1, inertia = 3e-5 }
bodies.coupler = { bar = ["B", "C"], length = "150 mm", mass = 0.2, inertia = 4e-4 }
bodies.arm = { bar = ["F", "C"], length = "100 mm", mass = 0.2, inertia = 2e-4 }
bodies.rod = { bar = ["C", "D"], length = "260 mm", mass = 0.1, inertia = 3e-4 }
bodies.ram = { points = { D = [0, 0] }, mass = 0.4 }
gears.zz = { bodies = ["crank", "teeth"], ratio = -2.0, phase = "20 deg" }
slides.C2 = { body = "ram", through = "G" }
springs.tie = { at = "Q", stiffness = "0.5 N*m/rad", damping = 1e-3 }
freedoms.crank = { joint = "A", speed = "90 rpm" }
freedoms.pendulum = { joint = "Q", start = "-60 deg" }
"""


@pytest.mark.parametrize("text", [LEVER_RACK, SLOTTED_LEVER, GEARED_PENDULUM], ids=lambda text: text.split('"')[1])
def test_a_linkage_beside_the_library_moves_as_with_multipliers(text, tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(f"{text}[run]\nrevolutions = 1.0\n", encoding="utf-8")
    test_a_linkage_of_the_library_moves_as_with_multipliers(path)


@pytest.mark.parametrize("method", ["compiled", "DOP853", "LSODA", "Radau", "BDF", "Hamming"])
def test_a_run_that_leaves_a_law_behind_names_it(method, tmp_path):
    path = tmp_path / "own.toml"
    power = 'springs.stop = { at = "E", free = "-1.75 rad", law = "200*x**1.5" }'
    lines = [line for line in SLOTTED_LEVER.splitlines() if not line.startswith(("springs.stop", "springs.return"))]
    text = "\n".join(power if line.startswith("springs.tab") else line for line in lines)
    path.write_text(text.replace('speed = "120 rpm"', 'speed = "120 rpm", start = "90 deg"'), encoding="utf-8")
    case = load_case(path)
    found = simulate(case.parameters, case.inputs, initial=case.initial, stop_time=0.1, method=method)
    assert found.status == 4
    assert found.message.endswith("the law of stop has no value beyond")
    assert np.isfinite(found.values).all()


@pytest.mark.parametrize("method", ["compiled", "DOP853", "LSODA", "Radau", "BDF", "Hamming"])
def test_a_start_where_a_law_has_no_value_names_it(method):
    arm = linkage("late-arm", ground={"A": (0, 0)}).body("arm", bar=("A", "Q"), length="0.1 m", mass=1.0)
    made = arm.spring("stop", at="A", law="2*(x - 0.2)**1.5").freedom("arm", "A", start=0.5).mechanism()
    start = made.initial(arm_angle=0.1)
    found = simulate(made.first_set.parameters, Inputs(), initial=start, stop_time=0.5, method=method)
    assert (found.status, len(found)) == (4, 1)
    assert found.message.endswith("the law of stop has no value beyond")


def test_a_law_that_ends_a_run_next_to_the_limit_of_assembly_is_named_alone():
    rocker = linkage("two-laws", ground={"A": (0, 0), "D": ("200 mm", 0)})
    rocker.body("left", bar=("A", "B"), length="150 mm", mass=0.2, inertia=1e-3)
    rocker.body("coupler", bar=("B", "C"), length="60 mm", mass=0.1, inertia=1e-4)
    rocker.body("right", bar=("D", "C"), length="100 mm", mass=0.2, inertia=1e-3)
    rocker.spring("back", at="D", stiffness="1 N*m/rad").freedom("left", "A", start="40 deg", speed="90 rpm")
    limit = reach(rocker.mechanism()).high
    rocker.tables["name"] = "two-laws-one-ends"
    rocker.spring("pad", at="A", law=f"10*sqrt({limit - 3e-3!r} - x)")
    made = rocker.mechanism()
    given = {"inputs": Inputs(speed=5.0), "initial": made.first_set.initial, "stop_time": 1.0}
    found = simulate(made.first_set.parameters, **given)
    assert found.status == 4
    assert found.message.endswith("the law of pad has no value beyond")
    # so do the runs of an ensemble
    many = simulate_many([made.first_set.parameters] * 2, **given)
    assert [message.partition(":")[2] for message in many.messages] == [" the law of pad has no value beyond"] * 2


@pytest.mark.fmu
def test_a_force_on_what_has_no_mass_is_named(tmp_path):
    disc = linkage("massless", ground={"A": (0, 0)}).body("disc", points={"A": (0, 0), "Q": (1, 0)}, mass=1, cog=(0, 0))
    made = disc.freedom("disc", "A", speed=10.0).mechanism()
    given = made.first_set.parameters, Inputs(torque=1.0)
    message = simulate(*given, stop_time=0.1).message
    assert message == f"no step succeeds at t = 0 s, disc angle 0 rad (0.0000 deg): {MASSLESS}"
    plant = Plant(made, given[0], made.first_set.initial, **{"drive.mode": 0})
    plant.set_input("drive.torque", 1.0)
    with pytest.raises(IntegrationError, match=f"in the step from t = 0 s: {MASSLESS}"):
        plant.step(0.0, 0.1)
    for file in (build(made, tmp_path), build_native(made, NATIVE, tmp_path)):
        with pytest.raises(LinkworkError, match=re.escape(f", disc angle 0 rad (0.0000 deg): {MASSLESS}")):
            cosimulate(file, *given, stop_time=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("path", EVERY, ids=lambda path: path.stem)
def test_a_linkage_of_the_library_runs_as_with_multipliers(path):
    """The oracle's own run, by SciPy in all coordinates of all bodies, at its end; what is driven under constant torques."""
    time = np.linspace(0.0, 0.2, 3)
    made, oracle = load_linkage(path), Multipliers(read_description(tables_in(path)))
    # light legs turn fast
    torque = 0.01 if path.stem in ("jansen", "klann") else 0.2
    inputs = [v.name for v in made.variables if v.causality == "input" and v.name.endswith("rive.torque")]
    assert len(inputs) == len(made.modes)
    given = {name.replace("Drive.", "_").replace("drive.", ""): torque for name in inputs}
    first = made.first_set
    found = simulate(first.parameters, Inputs(**given), initial=first.initial, stop_time=0.2, step=0.1, tolerance=1e-12)
    assert found.status == 0
    x = np.array([[found[v] for v in (f.coordinate, f.rate)] for f in made.freedoms])
    loads = np.array([torque if n < len(inputs) else 0.0 for n in range(len(x))])
    start = places(made, oracle, (*x[:, 0, 0], *x[:, 1, 0], 0.0, 0.0))
    q, v = oracle.run(x[:, 0, 0], x[:, 1, 0], start, time, loads=loads)
    assert np.abs(q[0, -1] - q[0, 0]) > 0.05
    np.testing.assert_allclose(x[:, 0, -1], q[:, -1], atol=1e-8 * (1.0 + np.abs(q[:, -1]).max()))
    np.testing.assert_allclose(x[:, 1, -1], v[:, -1], atol=1e-8 * (1.0 + np.abs(v[:, -1]).max()))


def test_peaucelliers_point_is_on_a_straight_line():
    line = (200.0**2 - 80.0**2) / (2.0 * 90.0) * 1e-3
    found = run("peaucellier")
    assert np.ptp(found["P.y"]) > 0.05
    np.testing.assert_allclose(found["P.x"], line, atol=1e-12)


def test_harts_point_is_on_a_straight_line():
    found = run("hart")
    assert np.ptp(found["Q.y"]) > 0.01
    np.testing.assert_allclose(-found["Q.x"], 0.4 * 0.6 * (200.0**2 - 120.0**2) / (2.0 * 50.0) * 1e-3, atol=1e-12)


def test_whitworths_lever_is_fast_on_one_side():
    """The lever is level where the crank pin is as high as its shaft: sin(angle) = -30/80."""
    found = run("whitworth", **{"run.step": "0.1 ms"})
    slow = np.mean(np.sin(found["lever.angle"]) > 0.0)
    assert slow == pytest.approx(0.5 + np.arcsin(30.0 / 80.0) / np.pi, abs=3e-4)


@pytest.mark.parametrize(("name", "span", "height"), [("klann", 100.0, 4.0), ("jansen", 45.0, 2.5)])
def test_a_foot_is_flat_on_the_ground(name, span, height):
    found = run(name)
    x, y = 1e3 * found["P.x"], 1e3 * found["P.y"]
    assert np.ptp(x[y < y.min() + height]) > span


def test_klanns_foot_is_where_the_patent_has_it():
    """With the leg stretched out it is the origin of the coordinates in which the crank's axis is (1.599, 0.750) units."""
    found = run("klann")
    i = np.cos(found["crank.angle"]).argmin()
    assert [1e3 * found[f"P.{axis}"][i] for axis in "xy"] == pytest.approx([-159.9, -75.0], abs=0.5)


def test_another_ratio_with_another_period_is_refused():
    """One with the same period is not."""
    made, drive = load_linkage(FOLDER / "geared-five-bar.toml"), Drive(torque=0.1)
    known, (name,) = made.first_set.parameters, made.names("ratio")
    assert name in made.position_parameters
    for value in (-1.5, -0.25, -2.01):
        with pytest.raises(InputError, match="describe it with the new values"):
            operating_point(replace(known, **{field_name(name): value}), drive)
    for value in (-3.0, -25.0, 15.0, 1.0):
        assert operating_point(replace(known, **{field_name(name): value}), drive).flow.base == 1


def test_gears_turn_at_their_ratio():
    found = run("geared-five-bar")
    wanted = -2.0 * found["crank.angle"] + np.deg2rad(60.0)
    np.testing.assert_allclose(np.sin(found["second.angle"] - wanted), 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["geared-five-bar", "rack-and-pinion"])
def test_pitch_circles_are_drawn_and_roll_on_each_other(name):
    made = load_linkage(FOLDER / f"{name}.toml")
    drawing, known = made.drawing, made.first_set
    start = made.state(known.initial)
    circles = [part for part in drawing.parts if part.kind == "gear"]
    p = known.parameters.constants()

    def place(angle: float) -> dict[str, complex]:
        x = drawing.positions((angle, *start[1:]), made.idle_inputs(p), p)
        return {joint.name: complex(*x[3 * n : 3 * n + 2]) for n, joint in enumerate(drawing.joints)}

    before, after = place(0.4), place(0.4 + 1e-6)
    arcs = [
        abs(before[mark] - before[pin]) * cmath.phase((after[mark] - after[pin]) / (before[mark] - before[pin]))
        for pin, mark in (part.joints for part in circles)
    ]
    radii = [abs(before[mark] - before[pin]) for pin, mark in (part.joints for part in circles)]
    if name == "geared-five-bar":
        assert sum(radii) == pytest.approx(0.16)
        assert arcs[0] == pytest.approx(-arcs[1], rel=1e-6)
        assert arcs[0] > 0.0
    else:
        assert radii == pytest.approx([0.03])
        # the pitch line is as far from the gear's bearing, and the rack moves by the arc
        low, high = before["teethLine"], before["teethLineEnd"]
        across = ((high - low).conjugate() * (before["E"] - low)).imag / abs(high - low)
        assert abs(across) == pytest.approx(0.03)
        assert abs(arcs[0]) == pytest.approx(abs(after["T"] - before["T"]), rel=1e-6)


@pytest.mark.parametrize("start", ["5 deg", "-5 deg"])
def test_the_folding_linkage_has_two_rests(start):
    """It comes to rest where the spring is free: cos = (80^2 + 140^2 - 100^2)/(2 80 140), on the side where it began."""
    found = run("bistable", **{"initial.arm_angle": start, "run.stop_time": "6 s"})
    rest = np.arccos((80.0**2 + 140.0**2 - 100.0**2) / (2.0 * 80.0 * 140.0))
    assert found["arm.angle"][-1] == pytest.approx(rest if start == "5 deg" else -rest, abs=1e-4)


def test_the_described_five_bar_runs_as_the_hand_written_one():
    found = run("described-five-bar")
    by_hand = simulate("table-3.1", samples=found.time, tolerance=1e-11)
    np.testing.assert_allclose(found["slider.position"], by_hand["slider.position"], atol=1e-10)
    np.testing.assert_allclose(found["C.fx"], by_hand["pin.C.fx"], atol=1e-6)


def on_a_spring(name: str, pivot: str) -> dict[str, Any]:
    """The tables of a linkage of the library with a pivot of the ground on a slide, with spring and damper."""
    tables = tables_in(FOLDER / f"{name}.toml")
    tables["name"] += "-on-a-spring"
    tables["ground"]["Rest"] = tables["ground"].pop(pivot)
    tables["bodies"]["support"] = {"points": {pivot: [0, 0]}, "mass": "0.4 kg"}
    tables.setdefault("slides", {})["Guide"] = {"body": "support", "through": "Rest"}
    springs = tables.setdefault("springs", {})
    springs["support"] = {"at": "Guide", "stiffness": "20 N/mm", "damping": "5 N*s/m"}
    tables["freedoms"]["support"] = "Guide"
    return tables


def damped(name: str, **damping: str) -> dict[str, Any]:
    """The tables of a linkage of the library with other dampers."""
    tables = tables_in(FOLDER / f"{name}.toml")
    for spring, value in damping.items():
        tables["springs"][spring]["damping"] = value
    return tables


#: Four linkages with a commanded crank and something else that is free.
VIBRATING = {
    "elastic-bearing": damped("elastic-bearing", across="4 N*s/m", upright="6 N*s/m"),
    "described-five-bar": damped("described-five-bar", slider="5 N*s/m"),
    "watt-1": on_a_spring("watt-1", "D"),
    "stephenson-3": on_a_spring("stephenson-3", "D"),
}
#: Watt's linkage is for `make test-long`: Stephenson's has as many links and its spring at the same place.
OTHERS = [name for name in VIBRATING if name != "watt-1"]
each_vibrating = pytest.mark.parametrize("name", [*OTHERS, *marked("long", ["watt-1"])])


class Vibration:
    """A linkage with its oracle, that goes on for one turn of the crank from any start (free coordinates, their rates)."""

    def __init__(self, name: str) -> None:
        d = read_description(VIBRATING[name])
        self.made, self.oracle = Package(d).mechanism(), Multipliers(d)
        self.parameters, self.n = self.made.first_set.parameters, len(self.made.freedoms)

    def of(self, orbit: Any) -> tuple[np.ndarray, float, float]:
        """Start of an orbit, crank angle and speed."""
        turn = orbit.turn(4)
        y = [turn[f.coordinate][0] for f in self.made.freedoms[1:]] + [turn[f.rate][0] for f in self.made.freedoms[1:]]
        return np.array(y), turn["crank.angle"][0], orbit.drive.speed

    def turn(self, y: np.ndarray, angle: float, speed: float, samples: int = 2) -> np.ndarray:
        """Free coordinates and their rates at equal steps of a turn."""
        q, v = np.array([angle, *y[: self.n - 1]]), np.array([speed, *y[self.n - 1 :]])
        near, time = places(self.made, self.oracle, (*q, *v, 0.0, 0.0)), np.linspace(0.0, 2.0 * np.pi / speed, samples)
        found, rates = self.oracle.run(q, v, near, time, commanded=(0,))
        return np.concatenate([found[1:], rates[1:]])


@pytest.mark.slow
@each_vibrating
def test_multipliers_are_those_of_the_multipliers_of_lagrange(name):
    """The monodromy matrix by finite differences of runs of the oracle, which knows nothing of freedoms in closed form."""
    of = Vibration(name)
    orbit = newton_orbit(of.parameters, Drive(speed=of.made.first_set.drive["speed"]))
    y, angle, speed = of.of(orbit)

    def after(start: np.ndarray) -> np.ndarray:
        return of.turn(start, angle, speed)[:, -1]

    np.testing.assert_allclose(after(y), y, atol=1e-8)
    steps = np.repeat([1e-6, 1e-4], of.n - 1)
    columns = [(after(y + h * e) - after(y - h * e)) / (2.0 * h) for h, e in zip(steps, np.eye(len(y)))]
    found = np.sort_complex(np.linalg.eigvals(np.array(columns).T))
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), found, atol=1e-5)
    assert np.abs(found).max() > 0.05


@pytest.mark.slow
@each_vibrating
def test_a_resonance_curve_is_that_of_the_oracle(name):
    """At its ends and its greatest amplitude the oracle's motion closes after a turn too, with the same amplitude."""
    of = Vibration(name)
    speed = of.made.first_set.drive["speed"]
    branch = frequency_response(of.parameters, 0.9 * speed, 1.1 * speed, doublings=0).branches[0]
    for place in {0, int(np.argmax(branch.amplitude)), len(branch) - 1}:
        y, angle, at = of.of(branch.orbits[place])
        turn = of.turn(y, angle, at, 181)
        np.testing.assert_allclose(turn[:, -1], y, atol=1e-8 * (1.0 + np.abs(y).max()))
        # samples miss a greatest value by at most the square of half their distance
        assert np.ptp(turn[0]) / 2.0 == pytest.approx(branch.amplitude[place], rel=2e-3)


@pytest.mark.slow
@pytest.mark.fmu
@pytest.mark.parametrize("name", ["shaper", "rack-and-pinion", *marked("long", ["elastic-bearing"])])
def test_the_fmus_of_a_linkage_run_as_in_process(name, tmp_path):
    case = load_case(FOLDER / f"{name}.toml")
    made = load_linkage(FOLDER / f"{name}.toml")
    given = {"initial": case.initial, "stop_time": 0.1, "step": 2e-3, "tolerance": 1e-12}
    found = simulate(case.parameters, case.inputs, **given)
    for file in (build(made, tmp_path), *(build_native(made, kind, tmp_path) for kind in (NATIVE, NATIVE_FMI3))):
        other = cosimulate(file, case.parameters, case.inputs, **given)
        assert compare(found, other).worst.relative < 1e-8, file.name


def test_newtons_method_from_the_start_misses_places():
    """Of Stephenson's second inversion from its crank: the shares of docs/linkages.md, which says why this is refused."""
    made = load_linkage(FOLDER / "stephenson-2.toml")
    oracle = Multipliers(read_description(tables_in(FOLDER / "stephenson-2.toml")))
    found = reach(made)
    angles = np.linspace(found.low + 1e-6, found.high - 1e-6, 400)
    wanted = np.array([places(made, oracle, (angle, 0.0)) for angle in angles])
    crank = wanted[:, 2]
    assert np.diff(crank).min() < 0.0 < np.diff(crank).max()
    shares = []
    oracle.freedoms = oracle.coordinate("A")
    closed = casadi.vertcat(oracle.closure, oracle.freedoms)
    oracle.joints = casadi.Function("joints", [oracle.q], [closed, casadi.jacobian(closed, oracle.q)])
    start = places(made, oracle, (np.deg2rad(20.0), 0.0))
    for sweeps in (8, 50):
        ends = np.array([oracle.placed(angle, start, sweeps) for angle in crank[:, None]])
        shares.append(np.mean(np.abs(ends - wanted)[:, 0::3].max(axis=1) < 1e-9))
    assert shares == pytest.approx([0.84, 0.84], abs=0.01)


@pytest.mark.parametrize("ratio", [Fraction(1), Fraction(2), Fraction(2, 3)], ids=str)
def test_two_commanded_cranks_are_driven_by_the_torques_of_the_multipliers(ratio):
    """Over their common period, as many turns of the first as the denominator."""
    path, speed = FOLDER / "two-crank-five-bar.toml", 12.0
    made, speeds = load_linkage(path), np.array([speed, speed * float(ratio)])
    period = 2.0 * np.pi / speed * ratio.denominator
    given = {"leftDrive.speed": speeds[0], "rightDrive.speed": speeds[1]}
    given |= {"run.revolutions": period * speeds.min() / (2.0 * np.pi), "run.step": period / 12.0}
    turn = run(path.stem, **given)
    assert turn.time[-1] == pytest.approx(period)
    oracle = Multipliers(read_description(tables_in(path)))
    loads = []
    for left, right in zip(turn["left.angle"], turn["right.angle"]):
        q = places(made, oracle, (left, right, *speeds, 0.0, 0.0))
        loads.append(oracle.solve(q, speeds, np.zeros(2), {0: 0.0, 1: 0.0}, {}, {}).loads)
    found = np.column_stack([turn[f"{side}Drive.applied_torque"] for side in ("left", "right")])
    np.testing.assert_allclose(found, loads, atol=1e-8 * np.abs(loads).max())
    np.testing.assert_allclose(found[-1], found[0], atol=1e-8 * np.abs(loads).max())


@pytest.mark.slow
@pytest.mark.fmu
@pytest.mark.parametrize(
    "path",
    [path if path.stem in PROBED else pytest.param(path, marks=pytest.mark.long) for path in FILES],
    ids=lambda path: path.stem,
)
def test_the_fmu_of_a_linkage_probes_clean(path, tmp_path):
    assert probe(build_native(load_linkage(path), NATIVE_FMI3, tmp_path), calls=150, seconds=1.5).findings == []


@in_browser
@pytest.mark.fmu
def test_a_geared_five_bar_that_was_found_becomes_an_fmu_and_a_page(browser, tmp_path):
    found = syn.FiveBar(**FIVE_BAR, pivot=syn.SecondCrank(length=0.04, ratio=-2.0, phase=0.7))
    tables = {"linkage": description(found, syn.MachineSpec(speed=20.0)), "run": {"revolutions": 1.0}}
    case = read_case(tables, folder=FOLDER)
    file = build_native(find_mechanism(case.parameters), NATIVE, tmp_path)
    given = {"initial": case.initial, "stop_time": 0.3, "step": 0.01, "tolerance": 1e-11}
    fmu = cosimulate(file, case.parameters, case.inputs, **given)
    wanted = found.path(20.0 * fmu.time)
    np.testing.assert_allclose(np.column_stack([fmu["P.x"], fmu["P.y"]]), wanted, atol=1e-8)
    (tmp_path / "page.html").write_text(make_page(page_state(case)), encoding="utf-8")
    page = opened(browser, tmp_path / "page.html")
    shown = _shown(page)["columns"]
    wanted = found.path(shown["crank.angle"] - case.initial.crank_angle)
    np.testing.assert_allclose(shown["P.x"], wanted[:, 0], atol=1e-9)
    page.close()


def test_ranges_of_motion():
    assert reach(load_linkage(FOLDER / "watt-1.toml")).turns
    found = reach(load_linkage(FOLDER / "peaucellier.toml"))
    # O C = 2 x 90 cos(angle/2) mm is at least 200 - 80 mm, where upper and inner link are in line
    assert not found.turns
    assert found.high == pytest.approx(2.0 * np.arccos(120.0 / 180.0), abs=1e-4)
    assert found.open == (False, False)
    # there the bodies of the dyad are in line
    assert found.least == pytest.approx(LIMIT_SINE)
    # a limit more than half a turn from the start: the crank stops on either side where coupler and rocker are in line
    swing = linkage("wide-swing", ground={"A": (0, 0), "D": (0.1, 0)}).body(
        "crank", bar=("A", "B"), length=0.08, mass=1
    )
    swing.body("coupler", bar=("B", "C"), length="90 mm").body("rocker", bar=("D", "C"), length="80 mm")
    found = reach(swing.freedom("crank", "A", start="130 deg", driven=False).mechanism())
    widest = np.arccos((0.1**2 + 0.08**2 - 0.17**2) / (2.0 * 0.1 * 0.08))
    assert (found.low, found.high) == pytest.approx((-widest, widest), abs=1e-3)
    assert found.open == (False, False)
    # an arm that nothing stops turns, though it is not driven round
    assert reach(load_linkage(FOLDER / "bistable.toml")).turns
    cart = linkage("reach-of-a-cart", ground={"A": (0, 0)}).body("cart", points={"P": (0, 0)}, mass="1 kg")
    found = reach(cart.slide("G", body="cart", through="A").freedom("cart", "G", driven=False).mechanism())
    assert (found.low, found.high, found.open, found.turns) == (-5.0, 5.0, (True, True), False)
    for name, size in (("microscopic", 1e-8), ("gigantic", 1e2)):
        comb = linkage(f"{name}-comb", ground={"A": (0, 0), "O": (0, 20.0 * size)})
        comb.body("crank", bar=("A", "B"), length=50.0 * size).body("rod", bar=("B", "C"), length=150.0 * size)
        comb.body("ram", points={"C": (0, 0)}, mass=1.0).slide("G", body="ram", through="O")
        found = reach(comb.freedom("stroke", "G", start=120.0 * size, driven=False).mechanism())
        ends = np.sqrt([100.0**2 - 20.0**2, 200.0**2 - 20.0**2]) * size
        assert (found.low, found.high) == pytest.approx(ends, rel=1e-5)
        assert (found.open, found.least) == ((False, False), 1e-3)
    # the block runs off along its line where the slot of the arm is parallel to it, which no place need hit
    slotted = linkage("slotted-arm", ground={"A": (0, 0), "O": (0, 0.1)}).body("arm", points={"A": (0, 0)}, mass=1)
    slotted.body("block", points={"P": (0, 0)}, mass=1.0, inertia=1e-3).slide("G", body="block", through="O")
    slotted.slot("S", pin="P", on="arm", through="A")
    for start in (90.2, 0.2, 179.8):
        slotted.tables |= {"name": f"slotted-arm-{10 * start:.0f}", "freedoms": {}}
        found = reach(slotted.freedom("arm", "A", start=f"{start} deg", driven=False).mechanism())
        assert (np.rad2deg(found.low), np.rad2deg(found.high)) == pytest.approx((0.0, 180.0), abs=0.1)


def test_a_joint_of_the_picture_moves_its_links_or_only_places_parts():
    joints = {joint.name: joint for joint in load_linkage(FOLDER / "shaper.toml").drawing.joints}
    assert joints["F"].moves == ("rod.length",)
    assert {name for name, joint in joints.items() if joint.aid} == {"SBlock", "SEnd", "GBlock", "GEnd"}
    # a pin at the ends of two links changes both, and so follows the pointer
    joints = {joint.name: joint for joint in load_linkage(FOLDER / "watt-1.toml").drawing.joints}
    assert joints["C"].moves == ("coupler.length", "rocker.length")
    assert joints["B"].moves == ("crank.length", "initial.crank_angle")


def test_dead_centres():
    """A rocker stands still where crank and coupler are in line, a slider where its crank and rod are."""
    found = {centre.at for centre in dead_centres(load_package(FOLDER / "watt-1.toml")) if centre.name == "rocker"}
    angles = []
    for reached, turn in ((0.18 + 0.05, 0.0), (0.18 - 0.05, np.pi)):
        inner = np.arccos((0.2**2 + reached**2 - 0.14**2) / (2.0 * 0.2 * reached))
        angles.append(np.remainder(inner + turn, 2.0 * np.pi))
    np.testing.assert_allclose(sorted(np.remainder(list(found), 2.0 * np.pi)), sorted(angles), atol=1e-9)
    tables = tables_in(FOLDER / "watt-1.toml")
    wound = Package(read_description(tables | {"name": "wound", "springs": {"s": {"at": "A", "stiffness": 1.0}}}))
    assert len(dead_centres(wound)) == len(dead_centres(load_package(FOLDER / "watt-1.toml")))
    press = dead_centres(load_package(FOLDER / "toggle-press.toml"))
    run_of = run("toggle-press", **{"run.step": "1 ms"})
    turns = np.flatnonzero(np.diff(np.sign(run_of["G.velocity"])))
    seen = np.remainder(run_of["crank.angle"][turns], 2.0 * np.pi)
    at = np.remainder([centre.at for centre in press if centre.name == "G"], 2.0 * np.pi)
    np.testing.assert_allclose(np.sort(seen), np.sort(at), atol=0.02)


PLACED = {"pivot_x": 0.1, "pivot_y": 0.05, "ground_angle": 0.3, "crank_phase": 0.4}
PLACED |= {"point_distance": 0.09, "point_angle": 0.5}
FIVE_BAR = PLACED | {"ground_length": 0.15, "crank_length": 0.05, "coupler_length": 0.16, "rocker_length": 0.15}
FOUR_BAR = PLACED | {"ground_length": 0.2, "crank_length": 0.06, "coupler_length": 0.18, "rocker_length": 0.15}
HALF = {"length": 0.03, "ratio": 0.5, "phase": -0.2}


@pytest.mark.parametrize(
    "found",
    [
        syn.Linkage(**FOUR_BAR, branch=-1),
        syn.SliderCrank(**PLACED, ground_length=0.03, crank_length=0.05, coupler_length=0.16),
        syn.SliderCrank(**PLACED, ground_length=-0.03, crank_length=0.05, coupler_length=0.16, branch=-1),
        syn.FiveBar(**FIVE_BAR, pivot=syn.SecondCrank(length=0.04, ratio=-2.0, phase=0.7)),
        syn.FiveBar(**FIVE_BAR, branch=-1, pivot=syn.SecondCrank(**HALF)),
        syn.FiveBar(**FIVE_BAR, pivot=syn.SecondCrank(**HALF, series=FourierSeries([0.0, 0.1, 0.05], [0.0, 0.2, -0.1]))),
        syn.Linkage(
            **FOUR_BAR, pivot=syn.SliderMotion(FourierSeries([2e-3, 4e-3, -1e-3], [0.0, 6e-3, 2e-3]), guide_angle=0.3)
        ),
    ],
    ids=["four-bar", "slider-crank", "slider-crank-other-side", "five-bar", "five-bar-half-speed", "two-drives", "moved-pivot"],
)  # fmt: skip
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_linkage_that_was_found_is_described_and_runs(found, direction):
    """Its coupler point goes where the synthesis says, over two turns."""
    make, way = syn.MachineSpec(speed=20.0), {"rotation": 0.2, "direction": direction}
    run = {"stop_time": 0.2 * np.pi, "step": 1e-3}
    tables = {"linkage": description(found, make, **way), **drives(found, make, **way), "run": run}
    case = read_case(tables, folder=FOLDER)
    done = run_case(case, tolerance=1e-12)
    assert done.status == 0
    wanted = found.path(0.2 + direction * 20.0 * done.time / found.turns)
    np.testing.assert_allclose(np.column_stack([done["P.x"], done["P.y"]]), wanted, atol=1e-9)
    assert done["energy.kinetic"].min() > 0.0


def test_two_cranks_alone_have_tables_without_a_natural_frequency():
    tables = mechanism_tables(load_linkage(FOLDER / "hybrid-press.toml"))
    assert (tables["natural"], tables["damping"]) == (None, "sheet.damping")


def test_the_studio_sorts_parameters_by_their_roles():
    given = {row["name"]: row for row in mechanism_tables(load_linkage(FOLDER / "hybrid-press.toml"))["given"]}
    asked = ("sheet.free_position", "gravity", "rod.cog_x", "initial.motor_angle")
    assert [given[name]["section"] for name in asked] == ["Spring, damper, friction", "Gravity", "Masses", "Start"]
    assert [name for name, row in given.items() if row.get("role") == "stiffness"] == ["sheet.stiffness"]


def test_motions_in_different_units_have_charts_of_their_own():
    built = linkage("pendulum-on-a-cart", ground={"O": (0, 0)}, gravity=9.81)
    built.body("cart", points={"P": (0, 0)}, mass=1.0).slide("G", body="cart", through="O")
    built.body("arm", bar=("P", "E"), length=0.1, mass=0.1, cog=(0.05, 0), inertia=1e-4)
    built.freedom("cart", "G", driven=False).freedom("arm", "P", driven=False)
    tables = mechanism_tables(built.mechanism())
    assert tables["described"]
    shown = [[c[key] for key in ("title", "unit", "factor")] for c in tables["charts"] if c["kind"] == "motion"]
    assert shown == [["Motion: cart position", "mm", 1e3], ["Motion: arm angle", "deg", np.rad2deg(1.0)]]


@in_browser
@pytest.mark.parametrize("path", EVERY, ids=lambda path: path.stem)
def test_a_linkage_moves_in_the_studio_and_is_dragged(browser, tmp_path, path):
    """Its bars keep their lengths over the motion, at first and after each joint was dragged; no number is lost."""
    # the studio has inputs that are constant
    case = load_case(path, {"motor.torque": 0.5} if path.stem == "stephenson-2" else {})
    bars = {n: b.bar for n, b in read_description(tables_in(path)).bodies.items() if b.bar}
    (tmp_path / "page.html").write_text(make_page(page_state(case)), encoding="utf-8")
    page = opened(browser, tmp_path / "page.html")
    root = "document.documentElement.dataset"
    settled = f"window.studio.solver.id === Number({root}.answer) && {root}.settled === 'true'"

    def values() -> dict[str, float]:
        page.wait_for_function(settled)
        found, given = _shown(page)["columns"], page.evaluate("window.studio.state.values")
        assert np.isfinite(list(given.values())).all()
        for body, (start, end) in bars.items():
            if f"{start}x" in found and f"{end}x" in found:
                along = np.hypot(*(found[f"{end}{c}"] - found[f"{start}{c}"] for c in "xy"))
                np.testing.assert_allclose(along, given[f"{body}.length"], rtol=1e-9)
        return given

    first = values()
    for joint in load_linkage(path).drawing.joints[:4]:
        if page.locator(f'[data-joint="{joint.name}"] .pin').count():
            _drag(page, joint.name, 9.0, -7.0)
            last = values()
    assert last != first
    page.close()


@pytest.mark.fmu
def test_check_of_a_linkage_whose_pin_has_friction(tmp_path):
    # at this speed a step of the run in process passed over a reversal of the friction at a tolerance of 1e-11
    ground, more = {"A": (0, 0), "D": ("180 mm", "20 mm")}, {"assembly": {"C": 1}, "friction": {"C": "1 mm"}}
    wiper = linkage("wiper-arm", ground=ground, **more).freedom("crank", "A", speed="45 rpm")
    wiper.body("crank", bar=("A", "B"), length="45 mm", mass=0.035, inertia=6e-6)
    wiper.body("coupler", bar=("B", "C"), length="190 mm", mass=0.117, inertia=3.5e-4)
    wiper.body("arm", bar=("D", "C"), length="60 mm", mass=0.6, inertia=0.02)
    case = read_case({"linkage": wiper.tables, "drive": {"speed": "39 rpm"}}, folder=FOLDER)
    file = build_native(find_mechanism(case.parameters), NATIVE, tmp_path)
    assert check(file, case, interface="model-exchange")[2].agrees
