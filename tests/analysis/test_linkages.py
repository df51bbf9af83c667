"""Described linkages: against multipliers in all coordinates, against the hand-written five-bar, energy, files, mistakes."""

import contextlib
import importlib
import inspect
import itertools
import math
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from scipy import integrate

from analysis import figures, periodic, steps, variant
from analysis.export import NATIVE, build_native
from analysis.files import entry_names
from analysis.linear import linearise
from analysis.linkages import Dyad, Package, RackStep, laws, linkage, load_linkage, reach, read_description
from analysis.linkages.builder import Builder
from analysis.linkages.description import Body, FreedomTable, Gear, Rack, Slide, Slot, Spring
from analysis.linkages.parameters import spring_angle_name
from analysis.linkages.structure import Pin, Slider
from analysis.mechanisms import MECHANISMS, check
from analysis.periodic import Drive, find_orbit, newton_orbit, search_orbits, steady_drive
from analysis.run import Inputs, TorsionBar, cosimulate, load_case, simulate, simulate_many
from analysis.tuning import Limit, Wish, tune
from analysis.tuning.conditions import limited_value
from linkwork.errors import AssemblyError, InputError, LinkworkError, ParameterError, UnknownNameError
from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism
from linkwork.plant import Plant
from linkwork.slider_crank.parameters import InitialState as SliderCrankState
from linkwork.slider_crank.parameters import SliderCrankParameters
from tests.oracles.planar import Multipliers
from tests.random_linkages import KINDS, random_linkage

from .conftest import marked, run_case

GROUPS = ("group", "RRP", "slot", "RPR")
RACKS = ("rack", "RRP", "RPR", "PRP")
#: Whether the gear follows from the rack, and the travel is linear.
CASES = ((False, True), (True, True), (True, False))


def imported(package: Package, folder: Path) -> Any:
    """The equations of a package, and its mechanism, not registered."""
    own = folder / package.name
    own.mkdir(parents=True, exist_ok=True)
    for name, text in package.files.items():
        (own / name).write_text(text)
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    importlib.invalidate_caches()
    return importlib.import_module(package.name)


def assembled(seed: int, folder: Path, kinds: Any = KINDS, dyads: Any = (1, 4), **changes: Any) -> tuple[Package, Any]:
    """A random linkage with the signs of assembly that give the places from which it was made; and these."""
    data, places = random_linkage(seed, kinds, dyads)
    package = Package(read_description(data))
    module = imported(package, folder)
    names = [dyad.inner.name for dyad in package.structure.dyads if dyad.has_two_assemblies]
    x = module.MECHANISM.state(module.MECHANISM.published["random-linkage"].initial)
    for signs in itertools.product((1, -1), repeat=len(names)):
        chosen = dict(zip(names, signs))
        p = module.Parameters(**{f"{name}_assembly": sign for name, sign in chosen.items()}).constants()
        try:
            found = module.equations.places(x, p)
        except (ValueError, ZeroDivisionError):
            continue
        errors = []
        for body, (bx, by, angle) in places.items():
            if body != "ground":
                f = getattr(found, f"{body}_frame")
                errors += [f.origin.x - bx, f.origin.y - by, f.turn.c - math.cos(angle), f.turn.s - math.sin(angle)]
        if np.abs(errors).max() < 1e-9:
            return Package(read_description(data | {"assembly": chosen} | changes)), places
    raise AssertionError("no assembly gives the places")


def whole_turns(package: Package, outputs: dict[str, float]) -> dict[str, int]:
    """Whole turns in the angle of each torsion spring, which the places of the bodies do not tell."""
    d = package.description
    names = {name: f"{name}.turn" if s.bodies else spring_angle_name(d, name) for name, s in d.springs.items()}
    return {name: round(outputs[of] / math.tau) for name, of in names.items() if of in outputs}


def compared(seed: int, folder: Path, kinds: Any = KINDS, dyads: Any = (1, 4), **changes: Any) -> Package:
    """Compare accelerations, loads and joint forces of a random linkage with the multipliers'; return it."""
    package, places = assembled(seed, folder, kinds, dyads, **changes)
    d, made = package.description, imported(package, folder).MECHANISM
    check(made)
    oracle, rng = Multipliers(d), np.random.default_rng(seed)
    q = np.array([c for body in d.bodies for c in places[body]])
    assert oracle.residual(q) < 1e-9
    n = len(made.freedoms)
    rates = rng.uniform(-3, 3, n)
    known = made.published["random-linkage"]
    x = (*made.state(known.initial)[:n], *rates, 0.0, 0.0)
    p, equations = known.parameters.constants(), made.modules[-1]
    for mode in (0.0, 1.0):
        u = rng.uniform(-3, 3, len(made.channels))
        i = made.equations.apply_inputs((mode,) * len(made.modes), tuple(u), p)
        values = dict(zip(made.input_names, u))
        commanded = {c.freedom: u[k] for k, c in enumerate(made.channels) if c.kind == "rate" and mode}
        loads = np.zeros(n)
        for k, c in enumerate(made.channels):
            if c.kind == "force" and c.freedom >= 0 and c.freedom not in commanded:
                loads[c.freedom] = u[k]
        forces = {name: values[f"{name}.torque"] for name in d.torques}
        names = [name for name, s in d.springs.items() if s.driven]
        forces |= {name: values.get(f"{name}.force", values.get(f"{name}.torque")) for name in names}
        points = {own: (values[f"{own}.load_x"], values[f"{own}.load_y"]) for own in (load.point for load in d.loads)}
        if made.equations.clearance(x, i, p) < 0.0:  # friction may jam the linkage
            continue
        out = dict(zip(made.output_names, made.equations.outputs(x, i, 0.0, p)))
        oracle.turns = whole_turns(package, out)
        wanted = oracle.solve(q, rates, loads, commanded, points, forces)
        m = equations.motion(x, i, p)
        # near the limit of assembly both lose digits alike
        near = 1e-9 / min(1.0, equations.places(x, p).clearance) ** 3
        np.testing.assert_allclose(m.accelerations, wanted.accelerations, rtol=near, atol=near * 10)
        np.testing.assert_allclose(m.loads, wanted.loads, rtol=near, atol=near * 10)
        assert out["energy.kinetic"] == pytest.approx(wanted.kinetic, rel=1e-9)
        scale = 1.0 + max(float(np.abs(f).max()) for f in wanted.forces.values())
        for r in package.motion.reactions:
            if r.joint.name not in wanted.forces or len(wanted.forces[r.joint.name]) < 2:
                continue
            pin = f"{r.name}.fx" in out
            found = [out[f"{r.name}.{c}"] for c in (("fx", "fy") if pin else ("force", "moment"))]
            sign = 1.0 if (r.on == r.joint.bodies[0]) == pin else -1.0
            np.testing.assert_allclose(found, sign * wanted.forces[r.joint.name], atol=near * scale, err_msg=r.name)
    return package


def test_random_linkages_move_as_with_multipliers(tmp_path):
    """Of all kinds of dyads, with laws, drives between points and at joints, and shafts between bodies."""
    found = [compared(seed, tmp_path) for seed in range(16)]
    assert {dyad.kind for package in found for dyad in package.structure.dyads} == {"RRR", "RRP", "PRP", "RPR", "RPP"}
    springs = [spring for package in found for spring in package.description.springs.values()]
    acting = {("between" if s.between else "at" if s.at else "of", s.driven, bool(s.law)) for s in springs}
    assert acting >= {("between", True, True), ("at", True, False), ("at", False, True), ("of", False, False)}


def test_random_linkages_of_twelve_bodies_move_as_with_multipliers(tmp_path):
    for seed in (21, 25):
        assert len(compared(seed, tmp_path, dyads=(4, 6)).description.bodies) == 12


def test_random_racks_move_as_with_multipliers(tmp_path):
    """Racks from gears and gears from racks, the rack as block and as holder of the line, linear and not."""
    found = set()
    for seed in (4, 9, 10, 25, 30, 42, 57, 66, 69, 70, 71, 84, 91, 102, 121):
        package = compared(seed, tmp_path, RACKS)
        steps = [step for step in package.structure.steps if isinstance(step, RackStep)]
        found |= {(step.turns, step.linear, step.slide.bodies[0] == step.parent) for step in steps}
    assert found >= {(turns, linear, block) for turns, linear in CASES for block in (True, False)}


def test_random_dyads_inside_dyads_move_as_with_multipliers(tmp_path):
    for seed in (2, 7, 15, 22, 28, 43):
        package = compared(seed, tmp_path, GROUPS)
        assert len(package.structure.dyads) > sum(isinstance(step, Dyad) for step in package.structure.steps)


def rough(package: Package) -> dict[str, float]:
    """Friction in every joint that can have it."""
    slots, found = package.description.slots, {}
    for name, joint in package.structure.joints.items():
        if isinstance(joint, Pin) and len(joint.bodies) == 2 and not set(joint.bodies) & set(slots):
            found[name] = 5e-4
        elif not isinstance(joint, Pin):
            found[name] = 0.02
    return found


def test_random_friction_is_that_of_multipliers(tmp_path):
    """Friction by the forces in pins, slides and slots, solved together with the accelerations, is that of a fixed point."""
    joints = set()
    for seed in range(12):
        package, _ = assembled(seed, tmp_path)
        friction = rough(package)
        compared(seed, tmp_path, friction=friction)
        joints |= {type(package.structure.joints[name]) for name in friction}
        joints |= {Slot for name in friction if name in package.description.slots}
    assert joints == {Pin, Slider, Slot}


@pytest.mark.slow
@pytest.mark.parametrize("first", [400, *marked("long", (420, 440))])
def test_many_random_linkages_of_all_kinds_with_friction(tmp_path, first):
    for seed in range(first, first + 20):
        package, _ = assembled(seed, tmp_path, (*KINDS, "rack", "rack"))
        compared(seed, tmp_path, (*KINDS, "rack", "rack"), friction=rough(package))


@pytest.mark.parametrize(
    ("change", "turns"),
    [
        ({"gears": {"Z": {"bodies": ["crank", "wheel"], "ratio": -1.5}}}, 2),
        ({"gears": {"Z": {"bodies": ["crank", "wheel"], "ratio": math.sqrt(2.0)}}}, 0),
        ({"slides": {"S": {"body": "wheel", "through": "O"}},
          "racks": {"R": {"gear": "crank", "rack": "wheel", "radius": 0.1}}}, 0),
    ],
)  # fmt: skip
def test_period_of_a_crank_brings_gears_and_racks_back(tmp_path, change, turns):
    """A wheel at -1.5 times the crank's speed is back after two turns, one at an irrational ratio and a rack never are."""
    points = {"crank": "A", "wheel": "Q" if "slides" in change else "B"}
    bodies = {name: {"points": {own: [0, 0]}, "mass": 1.0, "inertia": 1.0} for name, own in points.items()}
    data = {"name": "period-test", "ground": {"A": [0, 0], "B": [0.5, 0], "O": [0, -0.1]}, "bodies": bodies}
    made = Package(read_description(data | {"freedoms": {"crank": "A"}} | change)).mechanism(tmp_path)
    assert made.freedoms[0].period == pytest.approx(2.0 * math.pi * turns)


@pytest.mark.slow
@pytest.mark.parametrize("first", [16, *marked("long", range(66, 316, 50))])
def test_many_random_linkages_move_as_with_multipliers(tmp_path, first):
    """And energy gained and lost is that supplied, over steps of the plant from rest."""
    for seed in range(first, first + 50):
        package = compared(seed, tmp_path, dyads=(1, 4) if seed % 3 else (3, 6))
        made = imported(package, tmp_path).MECHANISM
        known, free = made.published[made.name], {mode.name.replace(".", "_"): 0 for mode in made.modes}
        plant = Plant(made, known.parameters, known.initial, tolerance=1e-10, **free)
        for _ in range(5):
            plant.step(plant.time, 2e-3)
        out = dict(zip(made.output_names, plant.outputs()))
        assert abs(out["energy.residual"]) < 1e-8 * (1.0 + out["energy.kinetic"]), seed


@pytest.mark.parametrize("seed", [0, 3, 4])
def test_random_linkages_keep_their_energy(tmp_path, seed):
    """Energy gained and lost is that supplied, over a run of the compiled solver from rest."""
    package, _ = assembled(seed, tmp_path, name=f"random-{seed}")
    made = package.mechanism(tmp_path)
    known = made.published[made.name]
    modes = dict.fromkeys((freedom.mode.arguments[0] for freedom in made.freedoms if freedom.mode), 0.0)
    run = simulate(known.parameters, Inputs(**modes), initial=known.initial, stop_time=0.05, step=1e-3, tolerance=1e-11)
    assert abs(run["energy.residual"]).max() < 1e-7 * (1.0 + abs(run["energy.kinetic"]).max())
    assert run["energy.kinetic"].max() > 1e-3


FOUR_BAR = {
    "name": "four-bar-test",
    "ground": {"A": [0, 0], "D": ["150 mm", 0]},
    "bodies": {
        "crank": {"bar": ["A", "B"], "length": "50 mm", "mass": "0.2 kg", "inertia": 1e-4},
        "coupler": {"bar": ["B", "C"], "length": "150 mm", "mass": "0.3 kg", "inertia": 1e-3},
        "rocker": {"bar": ["D", "C"], "length": "120 mm", "mass": "0.3 kg", "inertia": 1e-3},
    },
    "freedoms": {"crank": {"joint": "A", "speed": "300 rpm"}},
}


def changed(path: str, value: Any) -> dict[str, Any]:
    """The four-bar with another entry; None removes it."""
    import copy

    data = copy.deepcopy(FOUR_BAR)
    *tables, last = path.split("/")
    place: Any = data
    for name in tables:
        place = place.setdefault(name, {})
    if value is None:
        del place[last]
    else:
        place[last] = value
    return data


BARE = {"bar": ["A", "B"], "length": "50 mm"}
SECTION = {"kind": "bar", "width": "20 mm", "thickness": "5 mm", "material": "steel"}
#: Wrong descriptions, and what the sentence must contain: the place, or the value with what would be right.
MISTAKES = [
    ("bodies/crank/length", "-50 mm", "linkage.bodies.crank.length"),
    ("bodies/crank/length", 1e308, "linkage.bodies.crank.length is 1e+308"),
    ("ground/D", [-1e308, 0], "linkage.ground.D[0] is -1e+308"),
    ("bodies/coupler/points", {"P": [0, 1e200]}, "linkage.bodies.coupler.points.P[1] is 1e+200"),
    ("freedoms/crank/speed", 5e-324, "linkage.freedoms.crank.speed is 5e-324"),
    ("bodies/crank", BARE | {"section": SECTION | {"width": 5e-324}}, "linkage.bodies.crank.section has a mass of 0 kg"),
    ("bodies/crank", BARE | {"section": SECTION | {"width": 1e308}}, "width is 1e+308"),
    ("bodies/crank/length", None, "linkage.bodies.crank"),
    ("bodies/crank/lenght", "50 mm", "linkage.bodies.crank.length"),
    ("bodies/crank/bar", ["A"], "linkage.bodies.crank.bar"),
    ("bodies/crank/bar", ["A", "B 2"], "linkage.bodies.crank.bar"),
    ("bodies/crank/mass", "-1 kg", "linkage.bodies.crank.mass"),
    ("bodies/crank/mass", None, "linkage.bodies.crank"),
    ("bodies/crank/inertia", "1 kg", "linkage.bodies.crank.inertia"),
    ("bodies/crank/cog", ["1 mm"], "linkage.bodies.crank.cog"),
    ("bodies/crank/points", {"P": "1 mm"}, "linkage.bodies.crank.points.P"),
    ("bodies/crank/points", {"P_1": [0, 0]}, "P_1"),
    ("bodies/crank/section", {"kind": "rod"}, "linkage.bodies.crank.section"),
    ("bodies/crank/section", {"kind": "beam"}, "linkage.bodies.crank.section.kind"),
    ("bodies/dangling", {"points": {"Q": [0, 0]}, "mass": 1.0}, "linkage.bodies.dangling"),
    ("bodies/extra", {"bar": ["C", "Q"], "length": 0.1, "mass": 1.0}, "2 freedoms"),
    ("bodies/brace", {"bar": ["B", "D"], "length": 0.1, "mass": 1.0}, "without linkage.bodies.brace it has 1"),
    ("bodies/my_link", {"bar": ["C", "Q"], "length": 0.1}, "my_link"),
    ("bodies", {}, "linkage.bodies is empty"),
    ("ground", None, "linkage.ground"),
    ("ground/A", [0], "linkage.ground.A"),
    ("name", None, "linkage.name"),
    ("nmae", "x", "linkage.name"),
    ("gravity", "-9.81 m/s^2", "linkage.gravity"),
    ("gravity_direction", "2 m", "linkage.gravity_direction"),
    ("loads", ["Q"], "linkage.loads"),
    ("loads", "C", "linkage.loads"),
    ("torques", ["gear"], "linkage.torques"),
    ("assembly", {"C": 2}, "linkage.assembly.C"),
    ("assembly", {"B": 1}, "linkage.assembly"),
    ("freedoms", {"a": "A", "d": "D"}, "linkage.freedoms has 2"),
    ("freedoms/crank/joint", "Z", "linkage.freedoms.crank"),
    ("freedoms/crank/start", "1 m", "linkage.freedoms.crank.start"),
    ("freedoms/crank/speed", "5 Hz", "linkage.freedoms.crank.speed"),
    ("freedoms/crank/start", 60, 'linkage.freedoms.crank.start is 60: it must be less than four turns, or a text'),
    ("springs/return", {"at": "D", "stiffness": 1.0, "free": 90.0}, "linkage.springs.return.free is 90.0"),
    ("freedoms/crank/driven", "yes", "linkage.freedoms.crank.driven"),
    ("freedoms/crank", 3, "linkage.freedoms.crank"),
    ("slides/G", {"body": "rocker", "through": "Z"}, "linkage.slides.G.through"),
    ("slides/G", {"body": "block", "through": "A"}, "linkage.slides.G"),
    ("slides/G", {"body": "ground", "through": "A"}, "linkage.slides.G.body"),
    ("slides/G", {"body": "rocker"}, "linkage.slides.G.through"),
    ("slides/C", {"body": "rocker", "through": "A"}, "linkage.slides.C"),
    ("slides/G", {"body": "rocker", "through": "A", "direction": 90}, 'direction is 90: it must be less than four turns'),
    ("slots/S", {"pin": "Z", "on": "rocker", "through": "D"}, "linkage.slots.S"),
    ("slots/S", {"pin": "B", "on": "lever", "through": "D"}, "linkage.slots.S"),
    ("slots/S", {"pin": "B", "on": "rocker", "through": "B"}, "linkage.slots.S.through"),
    ("gears/X", {"bodies": ["crank"], "ratio": -1}, "linkage.gears.X.bodies"),
    ("gears/X", {"bodies": ["crank", "wheel"], "ratio": -1}, "linkage.gears.X"),
    ("gears/X", {"bodies": ["crank", "rocker"]}, "linkage.gears.X.ratio"),
    ("gears/X", {"bodies": ["crank", "rocker"], "ratio": -1}, "without linkage.gears.X it has 1"),
    ("racks/R", {"gear": "crank", "rack": "rocker"}, "linkage.racks.R.radius"),
    ("racks/R", {"gear": "crank", "rack": "bar", "radius": 0.1}, "linkage.racks.R"),
    ("racks/R", {"gear": "crank", "rack": "rocker", "radius": 0.1}, "linkage.racks.R"),
    ("friction", {"Z": 0.1}, "linkage.friction has Z"),
    ("friction", {"C": "0.1 kg"}, "linkage.friction.C"),
    ("friction", {"C": -0.1}, "linkage.friction.C"),
    ("springs/k", {"stiffness": "1 N/mm"}, "linkage.springs.k"),
    ("springs/k", {"at": "C", "between": ["A", "C"], "stiffness": 1.0}, "linkage.springs.k"),
    ("springs/k", {"at": "Z", "stiffness": 1.0}, "linkage.springs.k"),
    ("springs/k", {"at": "C", "stiffness": "1 N/mm"}, "linkage.springs.k.stiffness"),
    ("springs/k", {"between": ["A", "C"], "stiffness": "1 N*m/rad"}, "linkage.springs.k.stiffness"),
    ("springs/k", {"between": ["A", "Z"], "stiffness": 1.0}, "linkage.springs.k.between"),
    ("springs/k", {"between": ["A"], "stiffness": 1.0}, "linkage.springs.k.between"),
    ("springs/k", {"at": "C", "stiffness": -1.0}, "linkage.springs.k.stiffness"),
    ("springs/k", {"at": "C", "law": "import os"}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": "x.real"}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": "__import__('os')"}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": "y + 1"}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": [[1, 2], [0, 3]]}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": [[1, 2]]}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": [["1 mm", 2], [1, 3]]}, "linkage.springs.k.law"),
    ("springs/crank", {"at": "C", "stiffness": 1.0, "driven": "no"}, "linkage.springs.crank.driven"),
    ("bodies/crank/length", float("nan"), "linkage.bodies.crank.length"),
    ("bodies/crank/length", "50", "linkage.bodies.crank.length"),
    ("bodies/crank/bar", ["A", "A"], "linkage.bodies.crank.bar"),
    ("bodies/crank/points", {"B": ["1 mm", 0]}, "linkage.bodies.crank.points.B"),
    ("bodies/crank/points", ["P"], "linkage.bodies.crank.points"),
    ("bodies/crank/section", {"kind": "rod", "diameter": "1 mm", "material": "cheese"}, "section.material"),
    ("bodies/crank/section", {"kind": "plate", "corners": ["A"], "thickness": 0.008, "material": "steel"}, "section.corners"),
    ("bodies/ground", {"points": {"Q": [0, 0]}, "mass": 1.0}, "linkage.bodies.ground"),
    ("bodies/double", {"bar": ["A", "B"], "length": 0.05, "mass": 1.0}, "4 at A, 2 at D, 4 at B, 2 at C: it must have 1 to 4"),
    ("bodies/rocker/length", "10 mm", "joined at C, 0.15 m and 0.01 m long between pins that are 0.1 m apart: "),
    ("bodies", {"crank": {"bar": ["A", "B"], "length": 1.0}}, "linkage.bodies have no mass"),
    ("ground", {}, "linkage.ground"),
    ("ground/A", [float("inf"), 0], "linkage.ground.A"),
    ("name", "../x", "linkage.name"),
    ("name", "five-bar", "linkage.name"),
    ("loads", ["C", "C"], "linkage.loads has C twice"),
    ("loads", [{"point": "C", "frame": "link"}], "linkage.loads[0].frame"),
    ("freedoms", ["A"], "linkage.freedoms"),
    ("freedoms", {"coupler": "A"}, "linkage.freedoms.coupler"),
    ("freedoms", {"crank 1": "A"}, "linkage.freedoms.crank 1"),
    ("freedoms/crank/speeed", 1.0, "linkage.freedoms.crank.speed"),
    ("slots/S", {"pin": "C", "on": "rocker", "through": "D"}, "linkage.slots.S.pin"),
    ("slots/crank", {"pin": "B", "on": "rocker", "through": "D"}, "linkage.bodies.crank"),
    ("gears/X", {"bodies": ["crank", "crank"], "ratio": -1}, "linkage.gears.X.bodies"),
    ("gears/X", {"bodies": ["crank", "coupler"], "ratio": -1}, "linkage.gears.X.bodies"),
    ("gears/X", {"bodies": ["crank", "rocker"], "ratio": 0}, "linkage.gears.X.ratio"),
    ("racks/R", {"gear": "crank", "rack": "rocker", "radius": 0}, "linkage.racks.R.radius"),
    ("springs/k", {"at": "C"}, "linkage.springs.k does nothing"),
    ("springs/k", {"at": "C", "stiffness": 1.0, "free": "1 mm"}, "linkage.springs.k.free is"),
    ("springs/k", {"between": ["B", "B"], "stiffness": 1.0}, "linkage.springs.k.between"),
    ("springs/k", {"between": ["A", "D"], "stiffness": 1.0}, "linkage.springs.k.between"),
    ("springs/k", {"at": "C", "law": "sin(x, v)"}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": "1e999*x"}, "linkage.springs.k.law"),
    ("springs/k", {"at": "C", "law": "sqrt(-1 - x*x)"}, "the law of linkage.springs.k"),
    ("springs/k", {"at": "D", "stiffness": 1.0, "free": "-150 deg"}, "linkage.springs.k.free is -150 deg, and the angle"),
    ("gears/C", {"bodies": ["crank", "rocker"], "ratio": -1}, "linkage.gears.C has the name of a point"),
    ("springs/energy", {"at": "D", "stiffness": 1.0}, "linkage.springs.energy has a name that is taken"),
    ("bodies/rocker/section", {"kind": "tube", "outer": 0.005, "inner": 0.006, "material": "steel"}, "section.inner is 0.006"),
    ("freedoms/again", {"joint": "A"}, "linkage.freedoms.again is at A"),
    ("bodies/crank", {"points": {"A": [0, 0], "B": [0, 0]}, "mass": 1.0, "inertia": 1e-3}, "crank.points.B is where A is"),
    ("bodies/rocker", {"bar": ["D", "C"], "length": 0.12, "section": {"kind": "plate", "thickness": 0.005, "material": "steel",
     "corners": [[0, 0], [1, 1], [1, 0], [0, 1]]}}, "its edges cross"),
    ("freedoms", {"drive": {"joint": "A"}}, "two variables would be called drive.speed: drive of linkage.freedoms"),
    ("name", "rahman-ideal", "linkage.name is rahman-ideal: it must not be that of a published set of slider-crank"),
    ("name", "five-bar-slider", "its FMU would be called FiveBarSlider, like that of five-bar"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "named"), MISTAKES, ids=[f"{n}-{m[0]}" for n, m in enumerate(MISTAKES)])
def test_mistakes_are_named(tmp_path, path, value, named):
    with pytest.raises(LinkworkError) as error:
        Package(read_description(changed(path, value))).mechanism(tmp_path)
    assert named in str(error.value)
    assert "linkage." in str(error.value)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('[linkage]\nname = "a"\n[linkage.ground]\nA = [0, 0]\nB = [0, 1]\nA = [1, 1]\n', "linkage.ground.A"),
        ('[linkage]\nname = "a"\nname = "b"\n', "linkage.name"),
        ("[linkage.bodies.rod]\nmass = 1\n[linkage.bodies.rod]\nmass = 2\n", "linkage.bodies.rod"),
    ],
)
def test_what_a_file_has_twice_is_named(tmp_path, text, place):
    (tmp_path / "twice.toml").write_text(text)
    with pytest.raises(LinkworkError, match=f"at line .*: {place} is there twice"):
        load_linkage(tmp_path / "twice.toml")


def test_an_undriven_freedom_with_the_name_of_its_slide_is_named():
    """Both would have a force of this name."""
    built = linkage("twice", ground={"O": (0, 0)}).body("block", points={"P": (0, 0)}, mass=1.0)
    built.slide("rail", body="block", through="O").body("rotor", bar=("P", "E"), length=0.1, mass=1.0)
    built.freedom("rotor", "P", speed=20.0).freedom("rail", "rail")
    with pytest.raises(LinkworkError, match=r"would be called rail\.force: rail of linkage\.freedoms"):
        built.mechanism()


def test_a_free_body_without_mass_is_named(tmp_path):
    """Its acceleration is no number, and no run may begin."""
    data = changed("bodies/x", {"bar": ["C", "Q"], "length": 0.1})
    data["freedoms"] |= {"x": {"joint": "Cx", "driven": False}}
    data["bodies"]["rocker"]["points"] = {"Cx": [0.05, 0]}
    data["bodies"]["x"]["bar"] = ["Cx", "Q"]
    with pytest.raises(LinkworkError, match=r"change the mass or inertia of linkage\.bodies\.x"):
        Package(read_description(data)).mechanism(tmp_path)


def test_every_dyad_has_a_transmission_angle() -> None:
    """At whose sine zero it locks: of a slider-crank from rod and guide, of a rod in a swivel from rod and line of pins."""
    built = linkage("crosshead", ground={"A": (0, 0), "O": (0, 0.02), "S": (0.25, 0)})
    built.body("crank", bar=("A", "B"), length=0.05, mass=1.0).body("rod", bar=("B", "C"), length=0.15, mass=1.0)
    built.body("block", points={"C": (0, 0)}, mass=1.0).slide("G", body="block", through="O")
    for body, pin in (("swivel", "S"), ("arm", "B")):
        built.body(body, points={pin: (0, 0)}, mass=1.0, inertia=1e-3)
    built.slide("E", body="arm", on="swivel", through="S").freedom("crank", "A", start="40 deg").mechanism()
    run = simulate("crosshead", Inputs(speed=10.0), stop_time=0.5, step=0.01)
    rise = 0.02 - 0.05 * np.sin(run["crank.angle"])
    assert np.sin(run["C.transmission_angle"]) == pytest.approx(np.sqrt(0.15**2 - rise**2) / 0.15, rel=1e-9)
    assert run["E.transmission_angle"] == pytest.approx(np.full(len(run), 0.5 * math.pi), abs=1e-9)
    least = np.minimum(np.sin(run["C.transmission_angle"]), np.sin(run["E.transmission_angle"]))
    assert run["assembly.clearance"] == pytest.approx(least, rel=1e-9)


def test_a_rack_ends_what_a_wheel_can_turn() -> None:
    """A wheel never brings its rack back, and its range is that of what the rack moves."""
    built = linkage("rack-end", ground={"A": (0, 0), "O": (0, -0.02), "Q": (0.1, 0.1)})
    built.body("wheel", points={"A": (0, 0)}, mass=1.0, inertia=1e-3)
    built.body("bar", points={"P": (0, 0)}, mass=1.0).slide("way", body="bar", through="O")
    built.rack("teeth", gear="wheel", rack="bar", radius=0.02)
    built.body("one", bar=("P", "R"), length=0.2, mass=1.0).body("two", bar=("Q", "R"), length=0.15, mass=1.0)
    found = reach(built.freedom("wheel", "A").mechanism())
    assert not found.turns
    assert found.open == (False, False)
    # the pins are sqrt(0.35^2 - 0.12^2) apart along the rack at most
    assert found.high - found.low == pytest.approx(2.0 * math.sqrt(0.35**2 - 0.12**2) / 0.02, rel=1e-2)


def test_an_input_of_a_body_and_a_freedom_of_its_name_have_arguments_of_their_own() -> None:
    built = linkage("pair", ground={"A": (0, 0), "D": (0.15, 0)}, torques=["right"])
    built.body("left", bar=("A", "B"), length=0.05, mass=1.0).body("right", bar=("D", "C"), length=0.05, mass=1.0)
    made = built.freedom("left", "A", driven=True).freedom("right", "D", driven=True).mechanism()
    assert {c.name: c.argument for c in made.channels if c.name.endswith("torque")} == {
        "leftDrive.torque": "left_torque",
        "rightDrive.torque": "right_drive_torque",
        "right.torque": "right_torque",
    }
    run = simulate("pair", Inputs(right_torque=0.2, right_drive_torque=0.3), stop_time=0.01, step=1e-3)
    assert run["right.acceleration"][0] == pytest.approx(0.5 / 0.025**2, rel=1e-9)


def test_the_force_of_teeth_turns_the_driven_gear() -> None:
    """At the pitch point, 0.1 m from its pin: it carries inertia and load."""
    built = linkage("wheels", ground={"A": (0, 0), "B": (0.15, 0)}, torques=["big"])
    built.body("small", points={"A": (0, 0)}, mass=1.0, inertia=1e-3)
    built.body("big", points={"B": (0, 0)}, mass=2.0, inertia=8e-3)
    built.gear("pair", bodies=("small", "big"), ratio=-0.5).freedom("small", "A").mechanism()
    run = simulate("wheels", Inputs(torque=3.0, big_torque=-2.0), stop_time=0.01, step=1e-3)
    turned = 8e-3 * -0.5 * run["small.acceleration"] + 2.0
    assert run["small.acceleration"] == pytest.approx((3.0 + 1.0) / (1e-3 + 0.25 * 8e-3), rel=1e-9)
    # the driven wheel is on the right: an upward force at its left turns it clockwise
    assert run["pair.fy"] * -0.1 == pytest.approx(turned, rel=1e-9)
    assert abs(run["pair.fx"]).max() < 1e-9


def test_the_force_of_a_guide_is_positive_to_the_left_and_acts_where_moment_by_force_says() -> None:
    """A block slides along -x, so its weight is carried by a force to the right of its way, below its centre of mass."""
    built = linkage("carried", ground={"O": (0, 0)}, gravity=9.81)
    built.body("block", points={"C": (0, 0)}, mass=2.0, cog=("30 mm", 0), inertia=1e-3)
    made = built.slide("G", body="block", through="O", direction="180 deg").freedom("travel", "G").mechanism()
    run = simulate(made.first_set.parameters, Inputs(force=0.0), stop_time=0.01)
    assert run["G.force"][-1] == pytest.approx(-2.0 * 9.81)
    assert run["G.moment"][-1] / run["G.force"][-1] == pytest.approx(0.03)
    said = next(variable.description for variable in made.variables if variable.name == "G.force")
    assert said == "Force of the ground on the block across the line of G, to the left of the line's direction"


def test_other_freedoms_are_proposed(tmp_path):
    """A Stephenson chain driven on its far side is no chain of dyads: the joints that would do are named."""
    built = linkage("stephenson-far", ground={"A": (0, 0), "D": (0.3, 0), "F": (0.6, 0)})
    built.body("crank", bar=("A", "B"), length=0.05, mass=1.0).body("rocker", bar=("D", "C"), length=0.2, mass=1.0)
    built.body("coupler", points={"B": (0, 0), "C": (0.3, 0), "E": (0.2, 0.1)}, mass=1.0)
    built.body("link", bar=("E", "G"), length=0.4, mass=1.0).body("lever", bar=("F", "G"), length=0.2, mass=1.0)
    with pytest.raises(LinkworkError, match="A or D") as error:
        Package(read_description(built.tables | {"freedoms": {"lever": "F"}})).mechanism(tmp_path)
    assert all(body in str(error.value) for body in ("crank", "coupler", "rocker", "link"))
    # left to itself the linkage takes one that does
    made = built.mechanism()
    assert made.freedoms[0].coordinate == "crank.angle"


def test_case_file_and_python_say_the_same(tmp_path):
    """A file that describes a linkage is a case; the builder fills the same tables."""
    text = """
[linkage]
name = "bar-test"
gravity = "9.81 m/s^2"
ground = { A = [0, 0] }
bodies.rod.bar = ["A", "B"]
bodies.rod.length = "0.5 m"
bodies.rod.section = { kind = "bar", width = "30 mm", thickness = "10 mm", material = "steel" }
freedoms.swing = { joint = "A", start = "20 deg", driven = false }
[run]
stop_time = "0.5 s"
"""
    (tmp_path / "bar.toml").write_text(text)
    (tmp_path / "other.toml").write_text('linkage = "bar.toml"\ninitial.swing_angle = "30 deg"\nrun.stop_time = 0.1\n')
    run = run_case(load_case(tmp_path / "bar.toml"))
    # a physical pendulum: w^2 = 3 g sin / L at the top of its fall, by energy (I about the pin = m (L^2/3 + w^2/12))
    fall = np.sin(np.deg2rad(20)) - np.sin(run["swing.angle"])
    square = 2.0 * 9.81 * 0.25 * fall / (0.25 / 3.0 + 0.03**2 / 12.0)
    np.testing.assert_allclose(run["swing.speed"] ** 2, square, rtol=1e-7, atol=1e-7)
    assert run_case(load_case(tmp_path / "other.toml"))["swing.angle"][0] == pytest.approx(np.deg2rad(30))
    section = {"kind": "bar", "width": "30 mm", "thickness": "10 mm", "material": "steel"}
    built = linkage("bar-test", ground={"A": (0, 0)}, gravity="9.81 m/s^2")
    built.body("rod", bar=("A", "B"), length=0.5, section=section).freedom("swing", "A", start="20 deg", driven=False)
    assert built.mechanism() is load_linkage(tmp_path / "bar.toml")


def test_the_clearance_to_the_limit_of_assembly_is_an_output(tmp_path):
    """The sine of the transmission angle of a four-bar; its variables have symbols."""
    made = Package(read_description(changed("name", "four-bar-clearance"))).mechanism(tmp_path)
    known = made.published[made.name]
    p, idle = known.parameters.constants(), made.idle_inputs(known.parameters.constants())
    for angle in (0.0, 1.0, 4.0):
        found = dict(zip(made.output_names, made.equations.outputs((angle, 3.0, 0.0, 0.0), idle, 0.0, p)))
        assert found["assembly.clearance"] == pytest.approx(np.sin(found["C.transmission_angle"]), rel=1e-12)
    variables = {v.name: v for v in made.variables}
    assert (variables["assembly.clearance"].unit, variables["assembly.clearance"].level) == ("1", "position")
    without = {name for name, v in variables.items() if v.kind == "Real" and not v.symbol}
    assert without == {"solver.tolerance", *(name for name in variables if name.startswith("energy."))}
    assert variables["rocker.length"].symbol == r"l_{\mathrm{rocker}}"
    assert variables["crank.acceleration"].symbol == r"\ddot\theta_{\mathrm{crank}}"


@pytest.mark.parametrize("kind", [Body, Slide, Slot, Gear, Rack, Spring, FreedomTable])
def test_the_builder_knows_every_entry(kind):
    """What an editor completes is what a file may have."""
    method = kind.__name__.lower().removesuffix("table")
    assert {*inspect.signature(getattr(Builder, method)).parameters} - {"self", "name"} == {*entry_names(kind)}


def test_pins_and_drives_of_the_builder(tmp_path):
    """A four-bar by pins and a drive is the one by names of points; a cylinder is driven by a force."""
    built = linkage("four-bar-test", ground={})
    for name, entries in FOUR_BAR["bodies"].items():
        built.body(name, **{key: entry for key, entry in entries.items() if key not in ("bar", "length")})
    built.pin("A", ground=(0, 0), crank=(0, 0)).pin("D", ground=("150 mm", 0), rocker=(0, 0))
    built.pin("B", crank=("50 mm", 0), coupler=(0, 0)).pin("C", coupler=("150 mm", 0), rocker=("120 mm", 0))
    for body, length in (("crank", "50 mm"), ("coupler", "150 mm"), ("rocker", "120 mm")):
        built.tables["bodies"][body]["cog"] = [f"{0.5 * float(length.split()[0])} mm", 0]
    built.drive("crank", "A", speed="300 rpm").drive("ram", between=("A", "C"))
    one, other = built.mechanism(), Package(read_description(FOUR_BAR)).mechanism(tmp_path)
    assert "ram.force" in one.input_names
    x = (0.7, 20.0, 0.0, 0.0)
    rates = []
    for made in (one, other):
        p = made.first_set.parameters.constants()
        rates.append(
            made.equations.derivative(x, made.equations.apply_inputs((0.0,), (0.0,) * len(made.channels), p), p)
        )
    np.testing.assert_allclose(*rates, rtol=1e-12)
    with pytest.raises(LinkworkError, match="the drive ram has"):
        built.drive("ram")
    with pytest.raises(LinkworkError, match="body wheel, named in the pin A"):
        built.pin("A", wheel=(0, 0))


@pytest.mark.parametrize(
    ("speed", "span", "step"),
    [("300 rpm", 0.6, 5e-4), ("7 rpm", 26.0, 0.02), ("-1e6 rpm", 1.8e-4, 1e-7), (None, 1.0, 1e-3)],
)
def test_the_default_experiment_is_three_turns(tmp_path: Path, speed: str | None, span: float, step: float) -> None:
    mechanism = Package(read_description(changed("freedoms/crank/speed", speed))).mechanism(tmp_path)
    assert mechanism.experiment == (0.0, pytest.approx(span), pytest.approx(step), 1e-9)


def test_a_pendulum_on_the_crank_does_not_prolong_the_default_experiment() -> None:
    built = linkage("swing", ground={"A": (0, 0)}).body("crank", points={"A": (0, 0), "P": (0.1, 0)}, mass=1)
    built.body("arm", points={"P": (0, 0)}, mass=1, cog=(0.05, 0))
    built.freedom("crank", "A", speed="300 rpm").freedom("arm", "P", speed=0.05)
    assert built.mechanism().experiment[1] == pytest.approx(0.6)


def test_the_default_experiment_of_very_different_cranks_has_an_end() -> None:
    built = linkage("slow-and-fast", ground={"A": (0, 0), "B": (1, 0)})
    for body, pin, speed in (("slow", "A", "1 rpm"), ("fast", "B", "10000 rpm")):
        built.body(body, points={pin: (0, 0)}, mass=1.0, inertia=0.1).drive(body, pin, speed=speed)
    assert built.mechanism().experiment == (0.0, pytest.approx(1.0), pytest.approx(1e-5), 1e-9)


def test_the_builder_refuses_a_name_given_twice() -> None:
    with pytest.raises(InputError, match=r"already has springs\.wind"):
        wheel("twice", stiffness=1.0).spring("wind", at="Q", damping=1.0)


def test_the_builder_takes_numbers_and_arrays_of_numpy() -> None:
    def built(mass: Any, point: Any) -> Any:
        return linkage("of-numpy", ground={"A": point}).body("rod", bar=("A", "B"), length=0.5, mass=mass, inertia=0.1)

    made = built(np.float32(1.5), np.array([0.0, 0.1])).tables
    assert made == built(1.5, (0.0, 0.1)).tables
    assert read_description({**made, "freedoms": {"swing": "A"}}).ground == {"A": (0.0, 0.1)}


def wheel(name: str, **changes: Any) -> Any:
    """A driven wheel with a pendulum on its rim."""
    built = linkage(name, ground={"A": (0, 0)}, **changes.pop("more", {}))
    built.body("drum", points={"A": (0, 0), "Q": ("0.1 m", 0)}, mass=1.0, inertia=0.02)
    built.body("pendulum", bar=("Q", "R"), length="0.1 m", mass=0.1, inertia=1e-4)
    built.freedom("drum", "A", speed="600 rpm").freedom("pendulum", "Q", start=0.2)
    return built.spring("wind", at="A", **changes)


def test_a_spring_that_a_wheel_winds_up_leaves_no_periodic_motion() -> None:
    """A law with the period of a turn does."""
    with pytest.raises(InputError, match="wound has no freedom that turns without end"):
        find_orbit(wheel("wound", stiffness="0.01 N*m/rad").mechanism().first_set.parameters, speed=10.0)
    with pytest.raises(InputError, match="wound-law has no freedom that turns without end"):
        find_orbit(wheel("wound-law", law="0.01*x + sin(x)").mechanism().first_set.parameters, speed=10.0)
    made = wheel("latched", law="a*sin(n*x + 0.3)", constants={"a": "0.1 N*m", "n": 2.0}).mechanism()
    assert made.cyclic_freedoms == (0,)
    with pytest.raises(InputError, match=r"wind\.n is 2\.5: with these values the latched does not repeat"):
        find_orbit(replace(made.first_set.parameters, wind_n=2.5), speed=10.0)
    # where the law has no value at some angle it is none of them
    assert not wheel("rooted", law="tanh(x**1.5)").mechanism().cyclic_freedoms
    # a stop beyond one and a half turns
    assert not wheel("stopped", law="20*max(x - 9.5, 0) + sin(x)").mechanism().cyclic_freedoms


def test_constants_of_a_law_keep_their_units() -> None:
    given = {"a": "2 cm^2", "p": "10 bar", "c": "3e6 N/m^3", "m": "3 N*m", "n": 2.5}
    given |= {"k": "0.5 N*m/deg", "t": "2 N*m/turn"}
    found = {"a": (2e-4, "m2"), "p": (1e6, "N/m2"), "c": (3e6, "N/m3"), "m": (3.0, "N.m"), "n": (2.5, "1")}
    read = laws.constants(given, "law")
    stiffness, unit = read.pop("k")
    assert read.pop("t") == (pytest.approx(1.0 / math.pi), "N.m/rad")
    assert (stiffness, unit) == (pytest.approx(90.0 / math.pi), "N.m/rad")
    assert read == found
    made = wheel("gas", law="a*p*x/c", constants={name: given[name] for name in "apc"}).mechanism()
    units = {v.name: v.unit for v in made.variables if v.role == "law"}
    assert units == {"wind.a": "m2", "wind.p": "N/m2", "wind.c": "N/m3"}


def test_a_linkage_whose_freedoms_are_all_commanded_has_no_linear_model() -> None:
    built = linkage("lone-arm", ground={"A": (0, 0)}).body("arm", bar=("A", "B"), length="0.1 m", mass=0.1)
    made = built.freedom("arm", "A").mechanism()
    known = made.first_set
    with pytest.raises(InputError, match=r"arm\.speed being commanded: .*leave out a commanded speed"):
        linearise(known.parameters, made.state(known.initial), Inputs(speed=0.0))


def test_powers_that_are_not_whole_have_no_complex_value() -> None:
    assert laws.expression("-x**1.5 + x**-1.5 + 2**x", False, "law") == "-pow(x, 1.5) + pow(x, -1.5) + pow(2, x)"
    written = laws.expression("a*x**2 - 3*x**-1 + (x - 1)**(2*x**1.5)", False, "law")
    assert written.replace("(-1)", "-1") == "a * x ** 2 - 3 * x ** -1 + pow(x - 1, 2 * pow(x, 1.5))"
    with pytest.raises(ValueError, match="math domain error"):
        eval(laws.expression("x**1.5", False, "law"), vars(math) | {"x": -0.1})


@pytest.mark.parametrize("x", [-1.7, 0.0, 0.4, 2.5])
def test_laws_have_max_min_and_abs(x: float) -> None:
    """A one-sided stop is max(-x, 0), in the source without branches."""
    formula = "max(-x, 0)**1.5 - 3*min(x, 0.3 - x) + abs(x - 2*max(x, min(1, v)))"
    written = laws.expression(laws.law(formula, "law"), False, "law")
    assert set(re.findall(r"[a-z]+(?=\()", written)) == {"fabs", "pow"}
    known = {"x": x, "v": 0.9}
    assert eval(written, vars(math) | known) == pytest.approx(eval(formula, known), rel=1e-14, abs=1e-15)
    with pytest.raises(ParameterError, match="be a formula in x, v"):
        laws.law("max(x)", "law")


def test_the_freedom_with_a_speed_is_driven_whatever_the_order() -> None:
    built = linkage("any-order", ground={"A": (0, 0)}).body("arm", bar=("A", "B"), length=0.1, mass=1.0)
    built.body("bob", bar=("B", "C"), length=0.1, mass=1.0).freedom("swing", "B").freedom("arm", "A", speed=2.0)
    assert [freedom.mode is not None for freedom in built.mechanism().freedoms] == [False, True]
    np.testing.assert_array_equal(simulate("any-order", stop_time=0.1)["arm.speed"], 2.0)


def test_a_cylinder_called_like_a_body_has_its_own_force() -> None:
    built = wheel("own-force", damping=0.1, more={"torques": ["drum"]}).body("cart", points={"C": (0, 0)}, mass=1.0)
    built.slide("G", body="cart", through="A").freedom("cart", "G", start="0.5 m", driven=False)
    made = built.spring("drum", between=("A", "C"), driven=True).mechanism()
    known, u = made.first_set, dict.fromkeys(made.input_names, 0.0)
    p, x = known.parameters.constants(), made.state(known.initial)
    still, moved = (
        made.equations.derivative(x, made.equations.apply_inputs((0.0,), tuple(values.values()), p), p)
        for values in (u, u | {"drum.force": 3.0})
    )
    rate = len(made.freedoms) + [freedom.coordinate for freedom in made.freedoms].index("cart.position")
    assert moved[rate] - still[rate] == pytest.approx(3.0)


def test_a_slot_may_have_its_pin_at_the_origin_and_a_ring_gear_may_stand_still() -> None:
    """Both are drawn."""
    planet = linkage("planet-in-a-ring", ground={"A": (0, 0)}).body("arm", bar=("A", "B"), length="40 mm", mass=0.1)
    planet.body("planet", points={"B": (0, 0), "P": ("15 mm", 0)}, mass=0.1, inertia=1e-5)
    planet.gear("ring", bodies=("ground", "planet"), ratio=3.0).freedom("arm", "A", speed="60 rpm")
    slotted = linkage("slot-at-an-origin", ground={"A": (0, 0), "O": (0, "100 mm")})
    slotted.body("block", points={"P": (0, 0)}, mass=1.0).body("arm", points={"A": (0, 0)}, mass=1.0, inertia=1e-3)
    slotted.slide("G", body="block", through="O").slot("S", pin="P", on="arm", through="A")
    slotted.freedom("block", "G", driven=False)
    for made in (planet.mechanism(), slotted.mechanism()):
        known = made.first_set
        p = known.parameters.constants()
        assert np.isfinite(made.drawing.positions(made.state(known.initial), made.idle_inputs(p), p)).all()


def test_a_spring_near_half_a_turn_is_twisted_little() -> None:
    """By 4 degrees each, whether its angle is read as 179 or as -179 degrees."""
    for name, start, free in (("near-one", "179 deg", "175 deg"), ("near-other", "181 deg", "185 deg")):
        built = linkage(name, ground={"A": (0, 0)}).body("drum", points={"A": (0, 0)}, mass=1.0, inertia=0.02)
        built.spring("tie", bodies=("ground", "drum"), stiffness="1 N*m/rad", free=free)
        made = built.freedom("drum", "A", start=start, driven=False).mechanism()
        known = made.first_set
        p = known.parameters.constants()
        outputs = made.equations.outputs(made.state(known.initial), made.idle_inputs(p), 0.0, p)
        assert abs(outputs[made.output_names.index("tie.turn")]) == pytest.approx(np.deg2rad(4.0))


def shafts(name: str, inertia: float, **places: float) -> Any:
    """Shafts of 1 kg in bearings of the ground at places along x; the bearing of a motor is M."""
    built = linkage(name, ground={body[0].upper(): (x, 0) for body, x in places.items()})
    for body in places:
        built.body(body, points={body[0].upper(): (0, 0)}, mass=1.0, inertia=inertia)
    return built


def coupled(name: str, **values: Any) -> Any:
    """A rotor on an elastic coupling to a drum with a brake of 220 N.m, more than the coupling holds at half a turn."""
    built = linkage(name, ground={"A": (0, 0), "K": (0, 0)}).body("rotor", points={"A": (0, 0)}, mass=1, inertia=0.3)
    built.body("drum", points={"K": (0, 0)}, mass=1, inertia=2.0)
    built.spring("coupling", bodies=("rotor", "drum"), stiffness="60 N*m/rad", damping="3 N*m*s/rad", **values)
    built.spring("brake", at="K", law="220*tanh(v/0.05)")
    return built.freedom("rotor", "A", speed="60 rpm").freedom("drum", "K", driven=False)


def test_a_coupling_of_two_counted_bodies_winds_up_beyond_half_a_turn() -> None:
    made = coupled("wound-coupling", free="20 deg").mechanism()
    run = simulate(made.first_set.parameters, Inputs(speed=2.0 * math.pi), stop_time=2.0, step=0.01, tolerance=1e-10)

    def rates(t: float, y: Any) -> Any:
        torque = 60.0 * (y[0] - 2.0 * math.pi * t - math.radians(20.0)) + 3.0 * (y[1] - 2.0 * math.pi)
        return y[1], -(torque + 220.0 * math.tanh(y[1] / 0.05)) / 2.0

    wanted = integrate.solve_ivp(rates, (0.0, 2.0), (0.0, 0.0), "Radau", run.time, rtol=1e-9, atol=1e-10)
    assert np.abs(run["coupling.turn"]).max() > 1.3 * math.pi
    np.testing.assert_allclose(run["drum.angle"], wanted.y[0], atol=1e-6)
    # without whole turns, which are taken of both angles alike although one is short of them
    turns = 3000.0 * math.pi
    at = {"rotor_angle": turns + 0.05, "drum_angle": turns - 0.05}
    late, early = (
        simulate(made.first_set.parameters, Inputs(speed=2.0 * math.pi), initial=made.initial(**initial), stop_time=0.5)
        for initial in (at, {"rotor_angle": 0.05, "drum_angle": -0.05})
    )
    np.testing.assert_allclose(late["coupling.turn"], early["coupling.turn"], atol=1e-6)
    np.testing.assert_allclose(late["drum.angle"], turns + early["drum.angle"], atol=1e-6)


def test_a_coupling_of_gears_counts_their_turns() -> None:
    """A shaft from a crank to a wheel that its own pinion turns twice as fast the other way."""
    built = shafts("geared-shaft", 0.1, pinion=0.0, wheel=0.1)
    built.gear("teeth", bodies=("pinion", "wheel"), ratio=-2.0, phase="30 deg")
    built.spring("shaft", bodies=("pinion", "wheel"), stiffness="2 N*m/rad", free="10 deg")
    made = built.freedom("pinion", "P", speed="60 rpm").mechanism()
    run = simulate(made.first_set.parameters, Inputs(speed=2.0 * math.pi), stop_time=1.0, step=0.01)
    wanted = -3.0 * run["pinion.angle"] + math.radians(20.0)
    np.testing.assert_allclose(run["shaft.turn"], wanted, atol=1e-9)
    np.testing.assert_allclose(run["energy.potential"], wanted**2, atol=1e-6)
    assert not made.cyclic_freedoms


def test_a_coupling_has_periodic_motions_in_which_both_its_ends_turn() -> None:
    made = coupled("periodic-coupling").mechanism()
    speed = 2.0 * math.pi
    with pytest.raises(InputError, match=r"couples rotor\.angle and drum\.angle.*ratios = \{'drum\.angle': 1\}"):
        newton_orbit(made.first_set.parameters, Drive(speed=speed, ratios={"drum.angle": 2}))
    for drive in (Drive(speed=speed, ratios={"drum.angle": 1}), Drive(speed=speed)):
        orbit = newton_orbit(made.first_set.parameters, drive)
        assert orbit.start[0] == pytest.approx(-220.0 / 60.0, rel=1e-9)
    found = search_orbits(made.first_set.parameters, Drive(speed=speed)).orbits
    assert [orbit.rounds for orbit in found] == [{"drum.angle": 1}]


def test_the_turns_of_bodies_on_elastic_couplings_follow_from_the_couplings() -> None:
    """A motor, by a gear of ratio -1/2 and a coupling with backlash, turns a drum, and by a coupling to the drum a fan."""
    built = shafts("coupled-train", 0.2, motor=0.0, wheel=0.3, drum=0.0, fan=0.0)
    built.gear("teeth", bodies=("motor", "wheel"), ratio=-0.5)
    backlash = "300*(max(x - 0.1, 0) + min(x + 0.1, 0)) + 2*v"
    built.spring("first", bodies=("wheel", "drum"), law=backlash)
    built.spring("second", bodies=("drum", "fan"), stiffness="50 N*m/rad", damping="1 N*m*s/rad")
    built.spring("brake", at="F", damping="0.5 N*m*s/rad")
    built.freedom("motor", "M", speed="60 rpm").freedom("drum", "D", driven=False).freedom("fan", "F", driven=False)
    made = built.mechanism()
    drive = steady_drive(made.first_set, None)
    half = Fraction(-1, 2)
    assert drive.ratios_by_freedom(made) == {1: half, 2: half}
    orbit = newton_orbit(made.first_set.parameters, drive)
    # the brake's torque twists the couplings, the first beyond its backlash
    torque = 0.5 * math.pi
    assert orbit.start[0] == pytest.approx(torque / 300.0 + 0.1, rel=1e-7)
    assert orbit.start[1] - orbit.start[0] == pytest.approx(torque / 50.0, rel=1e-7)


def test_a_nonlinear_coupling_twisted_at_the_start_turns_both_its_ends_alike() -> None:
    built = shafts("cubic-coupling", 0.3, rotor=0.0, drum=0.0)
    built.spring("coupling", bodies=("rotor", "drum"), law="200*x**3 + 50*x + 1*v").spring("brake", at="D", damping=1.0)
    made = built.freedom("rotor", "R", speed="60 rpm").freedom("drum", "D", driven=False, start=0.3).mechanism()
    drive = Drive(speed=6.0)
    assert drive.ratios_by_freedom(made) == {1: 1}
    twist = newton_orbit(made.first_set.parameters, drive).start[0]
    assert 200.0 * twist**3 + 50.0 * twist == pytest.approx(-6.0, rel=1e-9)


def test_a_driven_crank_that_a_load_frees_turns_with_its_coupling() -> None:
    built = shafts("coupled-cranks", 0.2, motor=0.0, pump=0.0)
    built.spring("coupling", bodies=("motor", "pump"), stiffness="50 N*m/rad", damping="1 N*m*s/rad")
    built.freedom("motor", "M", speed="60 rpm").freedom("pump", "P", driven=True)
    made = built.mechanism()
    drive = steady_drive(made.first_set, Inputs(motor_speed=2.0 * math.pi, pump_torque=-5.0))
    assert not drive.ratios
    assert newton_orbit(made.first_set.parameters, drive).start[0] == pytest.approx(-5.0 / 50.0, rel=1e-9)


def striker(stop: float) -> Any:
    """A rotor shakes a frame on a spring, which has a stop of a given stiffness at 2 mm."""
    built = linkage("striker", ground={"O": (0, 0)}).body("frame", points={"M": (0, 0)}, mass=20)
    built.body("rotor", points={"M": (0, 0)}, mass=1, cog=(0.03, 0), inertia=0.01).slide("X", body="frame", through="O")
    built.spring("leaf", at="X", stiffness="20 N/mm", damping="60 N*s/m")
    built.spring("stop", at="X", law="k*max(x - 0.002, 0)", constants={"k": stop})
    return built.freedom("rotor", "M", speed="300 rpm").freedom("x", "X").mechanism()


@pytest.mark.parametrize("stop", [2e4, 2e7])
def test_periodic_motions_of_a_frame_that_strikes_a_stop(stop: float) -> None:
    """A stop as stiff as the spring, or a thousand times; a turn and its multipliers by SciPy, with events."""
    made = striker(stop)
    speed, drive = 10.0 * math.pi, Drive(speed=10.0 * math.pi)
    orbit = newton_orbit(made.first_set.parameters, drive)

    def turned(y: Any) -> Any:
        t, end = 0.0, 2.0 * math.pi / speed
        while t < end:
            stiffness = 2e4 + stop * (y[0] > 0.002 or (y[0] == 0.002 and y[1] > 0.0))

            def rates(t: float, y: Any, k: float = stiffness) -> Any:
                force = 0.03 * speed**2 * math.cos(speed * t) - k * y[0] + (k - 2e4) * 0.002 - 60.0 * y[1]
                return y[1], force / 21.0

            def meets(t: float, y: Any) -> float:
                return float(y[0] - 0.002)

            meets.terminal = True
            part = integrate.solve_ivp(rates, (t, end), y, "DOP853", rtol=1e-12, atol=1e-14, events=meets)
            t, y = part.t[-1], part.y[:, -1]
            if part.status == 1:
                y[0] = np.nextafter(0.002, math.copysign(1.0, y[1]))
        return y

    np.testing.assert_allclose(turned(orbit.start), orbit.start, rtol=1e-6)
    step = 1e-6 * np.diag([1e-2, 1.0])
    columns = [(turned(orbit.start + d) - turned(orbit.start - d)) / (2.0 * d.sum()) for d in step]
    values = np.sort_complex(np.linalg.eigvals(np.column_stack(columns)))
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), values, atol=1e-4)
    charted = periodic.largest_multipliers([made.first_set.parameters] * 3, [drive] * 3, orbit.start)[0]
    np.testing.assert_allclose(charted, abs(values).max(), rtol=1e-4)


def test_the_greatest_force_of_a_stop_is_found_between_the_samples() -> None:
    known = striker(2e7).first_set
    wish = Wish(
        parameters=known.parameters,
        speeds=(30.0, 32.0),
        change={"leaf.damping": "5 %"},
        limits=[Limit(output="stop.exerted_force", below="2 kN")],
    )
    orbit = newton_orbit(known.parameters, Drive(speed=10.0 * math.pi))
    value, _ = limited_value(orbit.resolved_turn(wish.limits[0].parts), wish.limits[0])
    start = {"x_position": orbit.start[0], "x_velocity": orbit.start[1]}
    run = simulate(known.parameters, Inputs(speed=10.0 * math.pi), initial=start, stop_time=0.2, step=1e-5)
    assert value == pytest.approx(run["stop.exerted_force"].max(), rel=1e-4)


def test_the_amplitude_of_a_flywheel_that_a_press_slows_down_suddenly() -> None:
    built = linkage("pressing", ground={"A": (0, 0)}).body("wheel", points={"A": (0, 0)}, mass=30, inertia=12)
    built.spring("load", at="A", law="20*v - 250 + 40*sin(x) + 3e4*max(sin(x) - 0.98, 0)")
    parameters = built.freedom("wheel", "A", driven=True).mechanism().first_set.parameters
    orbit = find_orbit(parameters, torque=0.0, start=[12.0])
    inputs, start = Inputs(torque=0.0), {"wheel_speed": orbit.start[0]}
    run = simulate(parameters, inputs, initial=start, stop_time=orbit.turn().period, step=1e-4, tolerance=1e-11)
    assert orbit.amplitude == pytest.approx(0.5 * np.ptp(run["wheel.speed"]), rel=2e-4)


def shaker(name: str) -> Any:
    """An unbalanced crank on a sprung frame that moves along x, with the law of a motor; natural frequency 302 rpm."""
    built = linkage(name, ground={"O": (0, 0)}).body("frame", points={"A": (0, 0)}, mass=10)
    built.body("crank", bar=("A", "B"), length="40 mm", mass=2, inertia=0.02, cog=("10 mm", 0))
    built.slide("X", body="frame", through="O")
    built.spring("feet", at="X", stiffness="12 N/mm", damping="60 N*s/m")
    built.spring("motor", at="A", law="c*(v - w)", constants={"c": "2 N*m*s/rad", "w": "300 rpm"})
    return built.freedom("crank", "A").freedom("x", "X").mechanism().first_set.parameters


@pytest.mark.filterwarnings("error")
def test_a_response_over_a_constant_of_a_law_has_plain_names_and_no_empty_panels() -> None:
    options = {"drive": Drive(torque=0.0), "vary": "motor.w", "start": (0.0, 0.0, 30.0)}
    response = periodic.frequency_response(shaker("shaker"), 30.0, 34.0, **options)
    assert {"amplitude of x position [m]", "harmonic 3 of x position [m]"} <= response.branches[0].columns().keys()
    assert response.branches[0].orbits[0].flow.labels == ("x position", "x velocity", "crank speed")
    labels = [axes.get_ylabel() for axes in figures.plot_branches(response.branches).axes]
    # nothing but the law drives the crank: no panel of its torque
    assert labels == ["amplitude of x position [mm]", "harmonics of x position\n[mm]", "greatest\njoint force [N]"]


def test_a_range_of_a_constant_of_a_law_is_freed_of_resonance() -> None:
    parameters = shaker("shaker-tuned")
    of = {"drive": Drive(torque=0.0), "start": (0.0, 0.0, 24.0), "over": "motor.w", "no_resonance": True}
    change = {"feet.stiffness": "40 %"}
    tuned = tune(Wish(parameters=parameters, between=("290 rpm", "330 rpm"), change=change, **of))
    assert tuned.met
    # the peak of the unbalanced machine is near its natural frequency, and left of the range and its margin
    (stiffness,) = tuned.values
    assert 0.97 * 0.98 * 290.0 < math.sqrt(stiffness / 12.0) * 30.0 / math.pi < 0.98 * 290.0
    change = {"feet.damping": "40 %"}
    with pytest.raises(UnknownNameError, match=r"no feet\.stiffness \(the names are drive\.torque, .*motor\.w"):
        Wish(parameters=parameters, between=(1e4, 2e4), change=change, **of | {"over": "feet.stiffness"})


def arm(name: str, **spring: Any) -> Any:
    """A crank that swings an arm from 66 to 182 deg, with a spring at the arm's bearing E."""
    built = linkage(name, ground={"A": (0, 0), "E": ("420 mm", "40 mm")}).body("crank", bar=("A", "B"), length="40 mm")
    built.body("rod", bar=("B", "F"), length="410 mm", mass=0.3, inertia=3e-3)
    built.body("arm", bar=("E", "F"), length="52 mm", mass=0.5, inertia=1e-2)
    return built.spring("blade", at="E", **spring).freedom("crank", "A", speed="45 rpm")


@pytest.mark.parametrize(
    "law",
    [
        {"law": "c*(x - x0)", "constants": {"c": "1 N*m/rad", "x0": "130 deg"}},
        {"law": [["40 deg", -math.pi / 2.0], ["220 deg", math.pi / 2.0]]},
    ],
)
def test_a_law_of_an_angle_that_passes_half_a_turn_is_that_of_a_spring(law: Any) -> None:
    runs = []
    for n, spring in enumerate(({"stiffness": "1 N*m/rad", "free": "130 deg"}, law)):
        arm(f"swung-{n}-{len(law)}", **spring).mechanism()
        runs.append(simulate(f"swung-{n}-{len(law)}", stop_time="1.3 s"))
    assert np.degrees(runs[1]["E.turn"]).max() > 181.0
    np.testing.assert_allclose(runs[1]["blade.exerted_torque"], runs[0]["blade.exerted_torque"], atol=1e-9)
    assert not runs[1].message


def drag_link() -> Mechanism:
    """A spring at the bearing of the follower, which goes round: nothing counts its turns."""
    built = linkage("drag-link", ground={"A": (0, 0), "D": ("50 mm", 0)}).body("crank", bar=("A", "B"), length="100 mm")
    built.body("rod", bar=("B", "C"), length="110 mm", mass=1.0, inertia=1e-3)
    built.body("follower", bar=("D", "C"), length="120 mm", mass=1.0, inertia=1e-3)
    return built.spring("hair", at="D", stiffness="0.1 N*m/rad").freedom("crank", "A", speed="60 rpm").mechanism()


@pytest.mark.parametrize("method", ["compiled", "DOP853"])
def test_a_spring_whose_turns_nothing_counts_is_named_where_its_torque_jumps(method: str) -> None:
    drag_link()
    run = simulate("drag-link", stop_time=1.0, **({} if method == "compiled" else {"method": method}))
    assert "hair at t = 0." in run.message
    assert "whole turns of this angle are not counted" in run.message


def test_fmus_name_such_a_spring_too(tmp_path: Path) -> None:
    """Also within a step of a whole turn, and to the end of the run."""
    fmu = build_native(drag_link(), NATIVE, tmp_path)
    said = [cosimulate(fmu, "drag-link", stop_time=1.0).message]
    description = fmpy.read_model_description(fmu)

    def log(*told: Any) -> None:
        said.append(told[-1].decode())

    folder, kind = fmpy.extract(fmu, str(tmp_path / "there")), "CoSimulation"
    one = fmpy.simulation.instantiate_fmu(folder, description, kind, debug_logging=True, logger=log)
    one.setupExperiment(startTime=0.0)
    one.enterInitializationMode()
    one.exitInitializationMode()
    for time in (0.0, 1.0):
        one.doStep(time, 1.0 if time == 0.0 else 0.1)
        reference = {v.name: v.valueReference for v in description.modelVariables}
        assert one.getInteger([reference["solver.status"]]) == [0]
        said.append(one.getString([reference["solver.message"]])[0].decode())
    one.freeInstance()
    assert len(said) == 4
    for message in said:
        assert "hair at t = 0." in message
        assert "whole turns of this angle are not counted" in message


def test_two_shafts_on_one_axis_are_joined_by_a_freedom_or_by_bodies() -> None:
    """A rotor and a crank on one axis: joined at a pin K of both, or each in a bearing of its own."""
    angles = []
    for name, own in (("coaxial", "rotor"), ("coaxial-bearings", "ground")):
        built = linkage(name, ground={"A": (0, 0), **({"K": (0, 0)} if own == "ground" else {})})
        built.body("rotor", points={"A": (0, 0), **({"K": (0, 0)} if own == "rotor" else {})}, mass=1.0, inertia=0.3)
        built.body("crank", bar=("K", "B"), length="35 mm", mass=4.0, cog=(0, 0), inertia=0.012)
        built.body("rod", bar=("B", "C"), length=0.14, mass=0.7, inertia=2e-3).body(
            "piston", points={"C": (0, 0)}, mass=2
        )
        built.slide("G", body="piston", through="A").freedom("rotor", "A", speed="600 rpm")
        place = {"at": "K"} if own == "rotor" else {"bodies": ("rotor", "crank")}
        built.spring("coupling", stiffness="400 N*m/rad", **place)
        built.freedom("twist", "K", driven=False, **({} if own == "rotor" else {"speed": "600 rpm"})).mechanism()
        run = simulate(name, stop_time=0.2, tolerance=1e-11)
        angles.append(run["twist.angle"] + (run["rotor.angle"] if own == "rotor" else 0.0))
    np.testing.assert_allclose(angles[0], angles[1], atol=1e-7)


def crowded(joint: str) -> Any:
    """A freedom at a pin of three bodies, by the name of the pin or of one of its joints."""
    built = wheel("crowded", stiffness="0.01 N*m/rad").body("bob", bar=("Q", "S"), length="0.1 m", mass=0.1)
    return built.freedom("bob", joint)


def held() -> Any:
    built = linkage("held", ground={"A": (0, 0), "O": (0.2, 0)}).body("arm", bar=("A", "B"), length=0.1, mass=1.0)
    built.body("block", points={"F": (0, 0)}, mass=1.0).slide("one", body="block", through="O")
    built.slide("two", body="block", through="O")
    return built.body("tip", bar=("B", "C"), length=0.1, mass=1.0).body("end", bar=("C", "D"), length=0.1, mass=1.0)


def massless() -> Any:
    """A massless body, which is blamed, and not the sound law beside it."""
    built = linkage("massless", ground={"A": (0, 0)}).body("crank", bar=("A", "B"), length=0.05, mass=1.0, inertia=1e-3)
    built.body("pendulum", bar=("B", "Q"), length=0.1).freedom("crank", "A", speed="100 rpm").freedom("pendulum", "B")
    return built.spring("wind", at="A", law="2*sin(x)")


def short_slot() -> Any:
    built = linkage("short", ground={"A": (0, 0), "E": (0.3, 0)}).body("crank", bar=("A", "B"), length=0.05, mass=1.0)
    built.body("lever", bar=("E", "F"), length=0.1, mass=1.0)
    return built.slot("S", pin="F", on="crank", through="A", direction="90 deg").freedom("crank", "A")


def spring_without_length() -> Any:
    built = wheel("drawn", stiffness="0.01 N*m/rad").body("cart", points={"C": (0, 0)}, mass=1.0)
    built.slide("G", body="cart", through="A").freedom("cart", "G", driven=False)
    return built.spring("k", between=("A", "C"), stiffness="10 N/m")


def toothed_rocker() -> Any:
    built = linkage("sector", ground={"A": (0, 0), "D": (0.15, 0), "H": (0.3, 0)})
    built.body("crank", bar=("A", "B"), length=0.05).body("coupler", bar=("B", "C"), length=0.15)
    built.body("rocker", bar=("D", "C"), length=0.12, mass=1.0).body("pinion", points={"H": (0, 0)}, mass=1.0)
    return built.gear("Z", bodies=("rocker", "pinion"), ratio=-2.0).freedom("crank", "A")


def gears_on_one_axis() -> Any:
    built = shafts("coaxial", 0.01, shaft=0.0, tube=0.0).freedom("shaft", "S")
    return built.gear("Z", bodies=("shaft", "tube"), ratio=-2.0)


def rubbed_pin() -> Any:
    built = linkage("rubbed", ground={"A": (0, 0), "D": (0.15, 0), "H": (0.3, 0)}, friction={"B2": "1 mm"})
    built.body("crank", bar=("A", "B"), length=0.05).body("rocker", bar=("D", "C"), length=0.12, mass=1.0)
    built.body("coupler", bar=("B", "C"), length=0.15).body("other", bar=("B", "G"), length=0.3)
    return built.body("lever", bar=("H", "G"), length=0.1).freedom("crank", "A")


def rubbed_slot() -> Any:
    built = linkage("rubbed-slot", ground={"A": (0, 0), "D": (0, -0.2)}, friction={"B": "1 mm"})
    built.body("crank", bar=("A", "B"), length=0.06).body("lever", bar=("D", "E"), length=0.3, mass=1.0)
    return built.slot("S", pin="B", on="lever", through="D").freedom("crank", "A")


def folded_slot() -> Any:
    built = linkage("folded", ground={"A": (0, 0), "D": ("100 mm", 0)}).body("crank", bar=("A", "B"), length="100 mm")
    built.body("lever", points={"D": (0, 0)}, mass=1.0, inertia=0.01).slot("S", pin="B", on="lever", through="D")
    return built.freedom("crank", "A", start="1e-9 rad")


def test_a_clockwise_torsion_bar_is_the_mirror_of_a_counterclockwise_one() -> None:
    runs = []
    bars = {"clockwise-bar": ("t*max(1 + x/r, 0)", 0.0), "counterclockwise-bar": (None, TorsionBar(torque=0.5))}
    for name, (law, torque) in bars.items():
        built = linkage(name, ground={"A": (0, 0)}).body("crank", bar=("A", "B"), length=0.05, mass=0.2, inertia=1e-4)
        if law:
            built.spring("bar", at="A", law=law, constants={"t": "0.5 N.m", "r": "1 rad"})
        made = built.freedom("crank", "A", start=0.0).mechanism()
        known = made.published[name]
        run = simulate(known.parameters, Inputs(torque=torque), initial=known.initial, stop_time=0.1)
        runs.append(run["crank.angle"])
    assert runs[1][-1] > 2.0
    np.testing.assert_allclose(runs[0], -runs[1], atol=1e-7)


#: Linkages that are refused, and the sentence; those that are one entry of the four-bar are among `MISTAKES`.
REFUSED = [
    (held, r"linkage\.bodies\.block is joined to ground twice, by one and by two"),
    (massless, r"numbers: change the mass or inertia of linkage\.bodies\.pendulum"),
    (short_slot, r"linkage\.slots\.S"),
    (lambda: crowded("Q"), "at the pin Q of drum, pendulum, bob: it must be at a joint of two bodies"),
    (lambda: crowded("Q2"), "at the pin Q of drum, pendulum, bob: it must be at a joint of two bodies"),
    (lambda: wheel("nameless", law="a*x**3", constants={"b": 1.0}), r"wind\.law is .*: a is none of them.*constants = \{ a = "),
    (spring_without_length, r"the length of linkage\.springs\.k, which has no direction at 0 m"),
    (lambda: wheel("twice", damping=1.0, more={"torques": ["pendulum"]}), r"two inputs would be called pendulum\.torque"),
    (toothed_rocker, r"by linkage\.gears\.Z pinion meshes with rocker, whose angle must follow"),
    (gears_on_one_axis, r"linkage\.gears\.Z\.bodies are shaft and tube, on one axis of the ground: teeth need two axes"),
    (rubbed_pin, "B is of crank, coupler, other: give the other a point of its own at the same"),
    (rubbed_slot, "of two bodies: A, D, S; the friction of the pin B is that of its slot S"),
    (folded_slot, r"linkage\.slots\.S has no direction at the start: the pins . and . are at one"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "said"), REFUSED)
def test_what_is_refused_is_named(make: Callable[[], Any], said: str) -> None:
    with pytest.raises(LinkworkError, match=said):
        make().mechanism()


def test_friction_of_a_microscopic_linkage_is_that_of_its_joint_forces() -> None:
    spun = linkage("spun", ground={"A": (0, 0)}, friction={"A": "1 um"})
    spun.body("arm", bar=("A", "B"), length="40 um", mass=2e-12, inertia=1e-22)
    spun.freedom("arm", "A", speed=1e4).mechanism()
    held = simulate("spun", stop_time="1 ms")["drive.applied_torque"]
    np.testing.assert_allclose(held, 1e-6 * 2e-12 * 1e4**2 * 20e-6, rtol=1e-6)


#: Half the angle over which the punch below acts (rad), and the work that it takes (J).
PUNCH = math.radians(3.0)
WORK = 4e4 * (math.sin(PUNCH) - PUNCH * math.cos(PUNCH))


def punch() -> Any:
    """A flywheel of 4 kg.m2 that a force slows down over six degrees of each turn."""
    built = linkage("punch", ground={"A": (0, 0)}).body("wheel", points={"A": (0, 0)}, mass=30, inertia=4)
    law = f"2e4*max(cos(x - 0.5) - {math.cos(PUNCH)!r}, 0) + c*v"
    built.spring("load", at="A", law=law, constants={"c": "0 N*m*s/rad"})
    return built.freedom("wheel", "A", driven=True).mechanism()


def geared_punch() -> Any:
    """The same force, a tenth as great, on a shaft that turns ten times as fast."""
    built = linkage("geared-punch", ground={"A": (0, 0), "B": (1, 0)})
    built.body("wheel", points={"A": (0, 0)}, mass=30, inertia=4)
    built.body("shaft", points={"B": (0, 0)}, mass=1, inertia=1e-6).gear("Z", bodies=("wheel", "shaft"), ratio=10)
    built.spring("load", at="B", law=f"2e3*max(cos(x - 0.5) - {math.cos(PUNCH)!r}, 0)")
    return built.freedom("wheel", "A", driven=True).mechanism()


def punch_with_spring() -> Any:
    """The same force beside a spring that winds up: the freedom has no period."""
    built = linkage("punch-spring", ground={"A": (0, 0)}).body("wheel", points={"A": (0, 0)}, mass=30, inertia=4)
    built.spring("load", at="A", law=f"2e4*max(cos(x - 0.5) - {math.cos(PUNCH)!r}, 0) + 1e-6*x")
    return built.freedom("wheel", "A", driven=True).mechanism()


def by_plant(mechanism: Mechanism, _: Path, step: float, stop_time: float, **given: Any) -> dict[str, list[float]]:
    """Outputs at the end of steps of the plant of the FMU, whose crank has a commanded speed or no torque."""
    drive = {"drive_mode": 0} if given else {"inputs": {"drive.speed": 10.0 * math.pi}}
    plant = Plant(mechanism, mechanism.first_set.parameters, mechanism.initial(**given.get("initial", {})), **drive)
    with contextlib.suppress(AssemblyError):
        while plant.time < stop_time:
            plant.step(plant.time, step)
    return {name: [value] for name, value in zip(mechanism.output_names, plant.outputs())}


def alone(mechanism: Mechanism, _: Path, **given: Any) -> Any:
    return simulate(mechanism.name, **given)


def among_many(mechanism: Mechanism, _: Path, **given: Any) -> Any:
    return simulate_many([mechanism.first_set] * 9, **given)[8]


def native(mechanism: Mechanism, folder: Path, **given: Any) -> Any:
    return cosimulate(build_native(mechanism, NATIVE, folder), mechanism.first_set, **given)


every_run = pytest.mark.parametrize(
    "run", [by_plant, alone, among_many, pytest.param(native, marks=[pytest.mark.slow, pytest.mark.fmu])]
)
ROLLING = {
    "inputs": Inputs(torque=0.0), "initial": {"wheel_angle": 1.0, "wheel_speed": 20.0}, "stop_time": 0.7, "step": 0.7,
}  # fmt: skip


@every_run
def test_no_step_passes_over_a_force_that_acts_over_a_few_degrees(run: Callable[..., Any], tmp_path: Path) -> None:
    found = run(punch(), tmp_path, **ROLLING)
    assert found["wheel.angle"][-1] // (2.0 * math.pi) == 2
    wanted = 20.0 - math.sqrt(20.0**2 - 2.0 * 2.0 * WORK / 4.0)
    assert 20.0 - found["wheel.speed"][-1] == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize(("make", "passes"), [(geared_punch, 2.2), (punch_with_spring, 2.0)])
def test_a_step_is_bounded_by_what_turns_fastest_and_without_a_period(make: Callable[[], Any], passes: float) -> None:
    speed = by_plant(make(), Path(), **ROLLING)["wheel.speed"][-1]
    assert 20.0 - speed == pytest.approx(20.0 - math.sqrt(20.0**2 - 2.0 * passes * WORK / 4.0), rel=1e-2)


@pytest.mark.parametrize("find", [newton_orbit, lambda p, drive, **o: search_orbits(p, drive, **o).orbits[0]])
def test_a_periodic_motion_meets_a_force_that_acts_over_a_few_degrees(find: Callable[..., Any]) -> None:
    orbit = find(variant(punch().name, load_c=0.05), Drive(torque=1.0), start=[12.0])
    assert orbit.turn()["wheel.speed"].mean() == pytest.approx((1.0 - WORK / (2.0 * math.pi)) / 0.05, rel=1e-3)


def level_four_bar(coupler: float, mass: float) -> tuple[Mechanism, float]:
    """A level four-bar that all but is a parallelogram, whose crank alone has a mass or whose energies do not change.

    Beside it the crank angle at which it comes within 1e-3 of the line of its bodies, by the law of cosines.
    """
    built = linkage("level-four-bar", ground={"A": (0, 0), "D": (0.2, 0)}, assembly={"C": -1})
    built.body("crank", bar=("A", "B"), length=0.05, mass=0.1, inertia=1e-4)
    built.body("coupler", bar=("B", "C"), length=coupler, mass=mass)
    built.body("rocker", bar=("D", "C"), length=0.05, mass=mass)
    made = built.freedom("crank", "A", speed="300 rpm", start=0.3).mechanism()
    far = coupler**2 + 0.05**2 + 2.0 * coupler * 0.05 * math.sqrt(1.0 - LIMIT_SINE**2)
    return made, math.acos((0.2**2 + 0.05**2 - far) / (2.0 * 0.2 * 0.05))


@pytest.mark.parametrize(("coupler", "mass"), [(0.2, 0.1), (0.2, 0.0), (0.199999, 0.0)])
@every_run
def test_no_step_passes_over_a_limit_of_assembly(run: Any, coupler: float, mass: float, tmp_path: Path) -> None:
    mechanism, limit = level_four_bar(coupler, mass)
    end = run(mechanism, tmp_path, stop_time=0.3, step=0.0005)["crank.angle"][-1]
    assert limit - 0.01 * math.pi < end < limit + 1e-6


def test_a_method_of_scipy_says_that_it_passed_over_a_limit_of_assembly() -> None:
    mechanism, limit = level_four_bar(0.19999, 0.0)
    run = simulate(mechanism.name, method="RK45", stop_time=0.3)
    assert run.status == 3
    assert limit - 0.02 * math.pi < run["crank.angle"][-1] < limit + 1e-6
    assert all(np.isfinite(run[name]).all() for name in run.names)


def _pusher() -> tuple[Any, Any, str, float]:
    """A dyad without mass that a block pushes, and the position of the block at which its bodies are in line."""
    built = linkage("pusher", ground={"O": (0, 0), "D": (0.0, 0.05)}, assembly={"C": 1})
    built.body("block", points={"B": (0, 0)}, mass=1.0).slide("G", body="block", through="O")
    built.body("rod", bar=("B", "C"), length=0.2).body("rocker", bar=("D", "C"), length=0.1)
    known = built.freedom("push", "G", speed=1.0, start=-0.22).mechanism().first_set
    return known.parameters, known.initial, "push.position", -math.sqrt(0.1**2 - 0.05**2)


def _light_slider_crank() -> tuple[Any, Any, str, float]:
    """A slider-crank whose crank alone has a mass and is longer than the rod; its guide is through the crank axis."""
    lengths = {"crank_length": 0.12, "rod_length": 0.119, "guide_twist": math.pi / 2.0}
    made = SliderCrankParameters(**lengths, crank_mass=1.0, crank_inertia=0.01)
    return made, SliderCrankState(crank_angle=1.05), "crank.angle", math.pi - math.acos(0.119 / 0.12)


def _light_five_bar() -> tuple[Any, Any, str, float]:
    """A level five-bar whose coupler and rocker have no mass, so that the slider remains at rest."""
    known = MECHANISMS["five-bar"].first_set
    lengths = {"ground_length": 0.2, "crank_length": 0.05, "coupler_length": 0.2, "rocker_length": 0.0499}
    light = dict.fromkeys(("coupler_mass", "rocker_mass", "coupler_inertia", "rocker_inertia", "slider_stiffness"), 0.0)
    made = replace(known.parameters, slider_mass=1.0, **lengths, **light)
    cosine = (0.2**2 + 0.05**2 - (0.2 + 0.0499) ** 2) / (2.0 * 0.2 * 0.05)
    return made, replace(known.initial, crank_angle=0.3), "crank.angle", math.acos(cosine)


@pytest.mark.parametrize("make", [_pusher, _light_slider_crank, _light_five_bar])
@pytest.mark.parametrize("many", [False, True])
def test_no_step_passes_over_a_limit_after_a_rest(make: Callable[[], tuple[Any, Any, str, float]], many: bool) -> None:
    parameters, initial, name, limit = make()
    for speed in (1.0, 1.5, 100.0, 700.0):
        inputs = Inputs(speed=steps([0.0, 1.0], [0.0, speed]))
        if many:
            run = simulate_many([parameters] * 9, inputs, initial=initial, stop_time=6.0)[8]
        else:
            run = simulate(parameters, inputs, initial=initial, stop_time=6.0)
        assert "limit of assembly" in run.message
        assert limit - 1e-3 * speed - 1e-3 < run[name][-1] < limit + 1e-6


@pytest.mark.parametrize("method", ["compiled", "RK45"])
def test_a_run_says_which_outputs_the_equations_do_not_determine(method: str) -> None:
    built = shafts("gear-pair", 1e-3, crank=0.0, wheel=0.06)
    built.gear("Z", bodies=("crank", "wheel"), ratio=-0.5).freedom("crank", "C", speed=30.0)
    known = built.mechanism().first_set
    assert simulate(known.parameters, method=method, stop_time=0.1).message == ""
    # on one axis the teeth have no lever
    run = simulate(replace(known.parameters, ground_W_x=0.0), method=method, stop_time=0.1)
    assert re.search(r"W\.fy.* not finite numbers at t = 0 s" if method == "compiled" else "crank.angle", run.message)
