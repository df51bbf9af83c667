"""Pin forces in the synthesis: the traced plant against Lagrange multipliers, bounds and objective."""

from dataclasses import replace
from math import cos, hypot, pi, radians, sin
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import analysis.synthesis as syn
from analysis.numerics import symbolic
from analysis.numerics.fourier import FourierSeries
from analysis.run import read_case, simulate
from analysis.synthesis.linkage.machine import pin_functions
from analysis.synthesis.task.constraint import InfeasibleError, RotationRange
from linkwork.errors import InputError, ParameterError
from linkwork.five_bar.dynamics import Inputs
from linkwork.five_bar.parameters import FiveBarParameters
from tests.linkages import outline
from tests.oracles.five_bar import solve

LINKAGE = syn.Linkage(
    pivot_x=0.1, pivot_y=-0.2, ground_length=0.25, crank_length=0.07, coupler_length=0.2, rocker_length=0.18,
    point_distance=0.15, point_angle=0.7, ground_angle=2.1, crank_phase=0.4, branch=-1,
)  # fmt: skip
BARS = {"width": "30 mm", "thickness": "8 mm", "density": 2700.0}
MAKE = syn.MachineSpec(speed="240 rpm", load=("3 N", "-15 N"), **BARS, rocker_mass=0.4)
PHI = syn.turn(24)
ELLIPSE = np.column_stack([0.20 + 0.06 * np.cos(PHI), 0.15 + 0.03 * np.sin(PHI)])
TASK = syn.TimedPath(points=ELLIPSE)
USUAL = (syn.LargestLink(length=0.3), syn.LeastTransmission())
FEW = syn.Search(starts=3, candidates=1 << 12)


def plant(linkage: syn.Linkage, make: syn.MachineSpec) -> FiveBarParameters:
    """The plant; `test_linkage` sums the masses of its bars."""
    p = replace(make, rocker_mass=None, slider_mass=1e7).sliding_five_bar(linkage)
    m = p.rocker_mass if make.rocker_mass is None else make.rocker_mass
    return replace(p, rocker_mass=m, rocker_inertia=p.rocker_inertia * m / p.rocker_mass)


def by_multipliers(linkage: syn.Linkage, make: syn.MachineSpec, rotation: float) -> np.ndarray:
    """Magnitudes of the forces on the pins A to D, the slider so heavy that it stands still."""
    p = plant(linkage, make)
    c, s = cos(linkage.ground_angle), sin(linkage.ground_angle)
    x, y = make.load
    acting = Inputs(1.0, 0.0, 0.0, p.slider_mass * p.gravity * s, c * x + s * y, c * y - s * x)
    found = solve(p, (rotation + linkage.crank_phase, 0.0, make.speed, 0.0), acting)
    return np.array([hypot(found.forces[f"pin.{pin}.fx"], found.forces[f"pin.{pin}.fy"]) for pin in "ABCD"])


@pytest.mark.parametrize("change", [{}, {"branch": 1, "ground_angle": -0.6}, {"point_distance": 0.0}])
def test_the_forces_are_those_of_multipliers(change: dict[str, Any]) -> None:
    linkage = replace(LINKAGE, **change)
    run = syn.pin_forces(linkage, MAKE)
    for k in (0, 100, 333, 600):
        wanted = by_multipliers(linkage, MAKE, float(run.rotation[k]))
        assert run.force[k] == pytest.approx(wanted, rel=2e-6)
    assert run.greatest == run.force.max()
    assert run.force[:, "ABCD".index(run.pin)].max() == run.greatest


@pytest.mark.parametrize("name", ["ground_length", "crank_length", "coupler_length", "rocker_length", "point_distance"])
def test_derivatives_by_dimensions_are_those_of_the_oracle(name: str) -> None:
    casadi = symbolic.library()
    x = casadi.SX.sym("x")
    d = SimpleNamespace(**LINKAGE.values() | {name: x})
    found = pin_functions(d, MAKE, casadi.DM(1.3 + LINKAGE.crank_phase))
    force = casadi.vertcat(*(casadi.sqrt(fx**2 + fy**2) for fx, fy in found.values()))
    slope = casadi.Function("slope", [x], [casadi.jacobian(force, x)])(getattr(LINKAGE, name))
    other = {step: replace(LINKAGE, **{name: getattr(LINKAGE, name) + step}) for step in (1e-5, -1e-5)}
    ahead, behind = (by_multipliers(linkage, MAKE, 1.3) for linkage in other.values())
    assert np.asarray(slope).ravel() == pytest.approx((ahead - behind) / 2e-5, rel=2e-4, abs=1e-2)


def test_a_point_on_the_line_of_the_coupler_makes_one_bar() -> None:
    """The bar from B over all of the coupler."""
    linkage = replace(LINKAGE, point_angle=pi, point_distance=0.05)
    run = syn.pin_forces(linkage, MAKE)
    d = SimpleNamespace(**linkage.values())
    found = pin_functions(d, MAKE, symbolic.library().DM(linkage.crank_phase + float(run.rotation[50])), straight=True)
    assert [hypot(float(x), float(y)) for x, y in found.values()] == pytest.approx(run.force[50], rel=1e-6)


@pytest.fixture(scope="module", name="free")
def make_free() -> syn.Solution:
    return syn.synthesize(TASK, constraints=USUAL, search=FEW).best


class TestBound:
    @pytest.mark.parametrize("objective", ["error", "worst"])
    def test_no_pin_carries_more(self, free: syn.Solution, objective: Any) -> None:
        bound = 0.8 * syn.pin_forces(free.linkage, MAKE).greatest
        task = replace(TASK, objective=objective)
        found = syn.synthesize(task, constraints=[*USUAL, syn.MaxPinForce(force=bound, make=MAKE)], search=FEW)
        for s in found.solutions:
            assert syn.pin_forces(s.linkage, MAKE).greatest <= bound * (1.0 + 1e-6)
        # the bound is used, and paid for
        assert syn.pin_forces(found.best.linkage, MAKE).greatest == pytest.approx(bound, rel=1e-4)
        assert found.best.error > 1.01 * free.error

    @pytest.mark.slow
    def test_of_a_path(self) -> None:
        path = outline(ELLIPSE)
        free = syn.synthesize(path, constraints=USUAL, search=FEW).best
        bound = 0.8 * syn.pin_forces(free.linkage, MAKE).force[:, [0, 3]].max()
        asked = syn.MaxPinForce(force=bound, make=MAKE, pins="AD")
        found = syn.synthesize(path, constraints=[*USUAL, asked], search=FEW).best
        assert syn.pin_forces(found.linkage, MAKE).force[:, [0, 3]].max() == pytest.approx(bound, rel=1e-3)
        assert syn.pin_forces(found.linkage, MAKE).force[:, [0, 3]].max() <= bound * (1.0 + 1e-6)

    @pytest.mark.slow
    def test_one_that_cannot_be_kept_is_named_with_its_unit(self) -> None:
        weak = syn.MaxPinForce(force="1 N", make=MAKE)
        with pytest.raises(InfeasibleError, match=r"the force on the pins by [0-9.]+ N"):
            syn.synthesize(TASK, constraints=[*USUAL, weak], search=replace(FEW, starts=1))

    def test_a_swinging_crank_over_the_way_of_the_task(self) -> None:
        at = np.linspace(0.0, radians(80.0), 9)
        task = syn.RockerFunction(angle=1.0 + 0.3 * at**2, rotation=at, mounting=True)
        constraints = [syn.LeastTransmission(angle=0.6, over="task")]
        free = syn.synthesize(task, constraints=constraints, search=FEW).best
        over = (0.0, float(at[-1]))
        bound = 0.9 * syn.pin_forces(free.linkage, MAKE, over).greatest
        constraints.append(syn.MaxPinForce(force=bound, make=MAKE))
        best = syn.synthesize(task, constraints=constraints, search=FEW).best
        assert syn.pin_forces(best.linkage, MAKE, over).greatest <= bound * (1.0 + 1e-6)

    @pytest.mark.slow
    def test_a_trade_off_of_the_error(self, free: syn.Solution) -> None:
        greatest = syn.pin_forces(free.linkage, MAKE).greatest
        limits = np.array([0.7, 0.9]) * greatest
        constraints = [*USUAL, syn.MaxPinForce(force=greatest, make=MAKE)]
        traded = syn.trade_off(TASK, "pin-force", limits, constraints=constraints, search=FEW)
        assert traded.error[0] > traded.error[1] > free.error
        assert "limit of greatest pin force [N]" in traded.columns()


@pytest.mark.slow
def test_the_least_force_within_an_error() -> None:
    """Whoever asks the other way round, for the least error within that force, comes to the same linkage."""
    error = 0.004
    found = syn.synthesize(TASK, constraints=[*USUAL, syn.LeastPinForce(error="4 mm", make=MAKE)], search=FEW)
    best = found.best
    least = syn.pin_forces(best.linkage, MAKE).greatest
    assert best.value <= error * (1.0 + 1e-5)
    assert all(syn.pin_forces(s.linkage, MAKE).greatest >= least * (1.0 - 1e-6) for s in found.solutions)
    back = syn.synthesize(
        replace(TASK, objective="worst"),
        constraints=[*USUAL, syn.MaxPinForce(force=least * (1.0 + 1e-5), make=MAKE)],
        guesses=[best],
        search=replace(FEW, starts=1),
    ).best
    assert back.value == pytest.approx(error, rel=2e-3)


@pytest.mark.slow
def test_the_least_force_of_a_path() -> None:
    task = outline(ELLIPSE, objective="worst")
    one = replace(FEW, starts=1)
    free = syn.synthesize(task, constraints=USUAL, search=one).best
    assert free.value < 0.0025
    found = syn.synthesize(task, constraints=[*USUAL, syn.LeastPinForce(error=0.003, make=MAKE)], search=one).best
    # the bound is used, and what it buys is much
    assert found.value == pytest.approx(0.003, rel=2e-3)
    assert found.value <= 0.003 * (1.0 + 1e-4)
    assert syn.pin_forces(found.linkage, MAKE).greatest < 0.8 * syn.pin_forces(free.linkage, MAKE).greatest


class TestRefused:
    @pytest.mark.parametrize(
        ("made", "message"),
        [
            (lambda: syn.MaxPinForce(force=0.0), "greatest pin force"),
            (lambda: syn.MaxPinForce(force=1.0, pins="AX"), "letters ABCD"),
            (lambda: syn.MaxPinForce(force="3 mm"), "force"),
            (lambda: syn.MachineSpec(speed="3 mm"), "speed"),
            (lambda: syn.pin_forces(LINKAGE.with_pivot(syn.SliderMotion(FourierSeries.constant(0.0))), MAKE), "pivot"),
        ],
    )
    def test_what_is_not_usable(self, made: Any, message: str) -> None:
        with pytest.raises(ParameterError, match=message):
            made()

    @pytest.mark.parametrize(
        ("constraint", "more", "error", "message"),
        [
            (syn.MaxPinForce(force=1.0), {"pivot": syn.SliderUnknown(harmonics=1)}, InputError, "a fixed rocker pivot"),
            (syn.LeastPinForce(error=0.0), {}, ParameterError, "greatest error"),
            (syn.LeastPinForce(error="1 deg"), {}, ParameterError, "greatest error"),
            (syn.LeastPinForce(error="0.01 mm"), {"search": replace(FEW, starts=1)}, InfeasibleError, "greatest error"),
        ],
    )
    def test_what_cannot_be_searched(self, constraint: Any, more: dict[str, Any], error: Any, message: str) -> None:
        with pytest.raises(error, match=message):
            syn.synthesize(TASK, constraints=[*USUAL, constraint], **more)

    def test_two_objectives(self) -> None:
        with pytest.raises(InputError, match="one objective"):
            syn.synthesize(TASK, constraints=[syn.LeastPinForce(error=1.0), syn.LeastPinForce(error=2.0)])

    def test_forces_need_to_know_where_the_crank_goes(self) -> None:
        with pytest.raises(InputError, match="needs crank rotations"):
            syn.MaxPinForce(force=1.0).requires(RotationRange(False, None))


def test_a_case_file_asks_for_all_of_it(tmp_path: Path) -> None:
    tables: dict[str, Any] = {
        "task": {"kind": "rocker-function", "angle": "30 + 10*sin(t)", "angle_unit": "deg", "n": 12},
        "constraints": {
            "least_mechanical_advantage": 1.5,
            "mechanical_advantage_at": ["30 deg"],
            "dead_centre_stretched": "80 deg",
            "dead_centre_folded": ["200 deg", "250 deg"],
            "no_toggle": ["0 deg", "90 deg"],
            "max_pin_force": "40 N",
            "least_pin_force_within": "2 deg",
            "pins": "BC",
        },
        "make": {"speed": "300 rpm", "load": ["0 N", "-20 N"], "crank_mass": "200 g"},
    }
    case = syn.read_synthesis_case(tables, folder=tmp_path)
    _, advantage, stretched, folded, clear, most, least = case.constraints
    assert isinstance(advantage, syn.MechanicalAdvantage)
    assert (advantage.least, list(advantage.at)) == (1.5, [radians(30.0)])
    assert isinstance(stretched, syn.DeadCentre)
    assert isinstance(folded, syn.DeadCentre)
    assert stretched.at == (radians(80.0), radians(80.0))
    assert (folded.at, folded.position) == ((radians(200.0), radians(250.0)), "folded")
    assert isinstance(clear, syn.NoToggle)
    assert isinstance(most, syn.MaxPinForce)
    assert isinstance(least, syn.LeastPinForce)
    assert (most.force, most.pins, least.error, least.pins) == (40.0, "BC", "2 deg", "BC")
    assert most.make == least.make == case.make == syn.MachineSpec(speed=10.0 * pi, load=(0.0, -20.0), crank_mass=0.2)
    with pytest.raises(ParameterError, match="come with least_mechanical_advantage"):
        syn.read_synthesis_case(tables | {"constraints": {"mechanical_advantage_at": ["30 deg"]}}, folder=tmp_path)
    swing = {"least_transmission_angle": False, "toggle_stretched": "200 deg", "toggle_folded": ["30 deg", "40 deg"]}
    # a crank that comes to a toggle does not make a whole turn
    part = {"task": tables["task"] | {"end": "240 deg"}, "constraints": swing}
    *_, toggle, other = syn.read_synthesis_case(tables | part, folder=tmp_path).constraints
    assert isinstance(toggle, syn.Toggle)
    assert isinstance(other, syn.Toggle)
    assert (toggle.position, other.position) == ("stretched", "folded")


def test_the_sheet_says_where_the_load_acts() -> None:
    make = syn.MachineSpec(load=("-20 N", "0 N"))
    plain = syn.Linkage(ground_length=0.3, crank_length=0.08, coupler_length=0.25, rocker_length=0.2)
    sliding = syn.SliderCrank(ground_length=0.0, crank_length=0.08, coupler_length=0.25, point_distance=0.25)
    for linkage, place in ((plain, "at B"), (replace(plain, point_distance=0.1), "at P"), (sliding, "on the slider")):
        assert make.describe(linkage=linkage).endswith(f"-20 and 0 N {place}")


def test_a_case_that_runs_has_the_load(free: syn.Solution, tmp_path: Path) -> None:
    """In the frame of the ground link, as the plant has it; its pins carry what they are said to, but for its spring."""
    made = replace(MAKE, gravity=0.0)
    case = read_case(syn.run_case(free, made, "loaded"), folder=tmp_path)
    run = simulate(case.parameters, case.inputs, initial=case.initial, stop_time=4.0 * pi / made.speed)
    last = run.time > 2.0 * pi / made.speed
    greatest = max(float(np.hypot(run[f"pin.{pin}.fx"], run[f"pin.{pin}.fy"])[last].max()) for pin in "ABC")
    assert greatest == pytest.approx(syn.pin_forces(free.linkage, made).force[:, :3].max(), rel=5e-3)
