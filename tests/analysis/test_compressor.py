"""A compressor driven by a force law at its crank pin: one freedom, a torque of zero, and friction from its joint forces."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from analysis.files import read_tables
from analysis.numerics.continuation import ContinuationError, Follower
from analysis.periodic import Drive, Family, Response, find_orbit, frequency_response
from analysis.periodic.motion.discretisation import operating_point
from analysis.periodic.motion.orbit import solve_orbit
from analysis.run import Case, load_case
from linkwork import variant
from linkwork.errors import InputError

#: Without tables after ``[drive]``, so that tests can add their own.
COMPRESSOR = """
[linkage]
name = "compressor"
source = "a machine of one cylinder"
gravity = "9.81 m/s^2"
[linkage.ground]
A = [0, 0]
[linkage.bodies]
crank = { bar = ["A", "B"], length = "35 mm", mass = "14 kg", cog = ["-4 mm", 0], inertia = "0.18 kg*m^2" }
rod = { bar = ["B", "C"], length = "140 mm", mass = "0.7 kg", cog = ["42 mm", 0], inertia = "2.4e-3 kg*m^2" }
piston = { points = { C = [0, 0] }, mass = "0.55 kg" }
[linkage.slides]
G = { body = "piston", through = "A", direction = "90 deg" }
[linkage.springs.gas]
at = "G"
law = "a*(min(max(p1*((1-tanh(-v/w))/2*((s+c)/(b+c-x))**n + (1-tanh(v/w))/2*((p2/p1)**(1/n)*c/(b+c-x))**n), p1), p2) - p1)"
constants = { a = "3848 mm^2", p1 = "1 bar", p2 = "7 bar", s = "70 mm", c = "3.5 mm", b = "175 mm", n = 1.3, w = "0.02 m/s" }
[linkage.springs.motor]
at = "A"
law = "-(m0 - k*v)"
constants = { m0 = "60 N*m", k = "0.75 N*m*s/rad" }
[linkage.friction]
G = 0.05
B = "0.3 mm"
A = "0.4 mm"
[linkage.freedoms]
crank = { joint = "A" }
[linkage.assembly]
C = 1
[initial]
crank_angle = "100 deg"
[run]
stop_time = "3 s"
[drive]
torque = "0 N*m"
"""
#: Mean speed of the crank near which its motion is sought (rad/s).
GUESS = 67.0


@pytest.fixture(scope="module")
def compressor(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path = tmp_path_factory.mktemp("compressor") / "compressor.toml"
    path.write_text(COMPRESSOR, encoding="utf-8")
    assert read_tables(path)["drive"] == {"torque": "0 N*m"}
    return load_case(path)


def test_a_torque_of_zero_is_a_torque(compressor: Case) -> None:
    given = find_orbit(compressor.parameters, compressor.inputs, start=(GUESS,))
    assert given.drive.torque == 0.0
    assert given.multipliers[0].real == pytest.approx(0.68, abs=0.01)
    assert find_orbit(compressor.parameters, torque=0.0, start=(GUESS,)).start == pytest.approx(given.start, rel=1e-7)
    assert find_orbit(compressor.parameters, torque=1e-9, start=(GUESS,)).start == pytest.approx(given.start, rel=1e-7)
    with pytest.raises(InputError, match="neither a speed nor a torque is given"):
        find_orbit(compressor.parameters, start=(GUESS,))


def test_the_verdict_needs_no_axes_of_a_chart(linkwork: Callable[..., Result], tmp_path: Path) -> None:
    (tmp_path / "compressor.toml").write_text(COMPRESSOR, encoding="utf-8")
    asked = ("stability", "compressor.toml", "--guess-speed", "640 rpm")
    alone = linkwork(*asked, "--no-chart")
    assert "stable, margin 0.32" in alone.stdout
    charted = linkwork(*asked, code=1)
    assert "stable, margin 0.32" in charted.stdout
    assert "no chart, as --y is not given: a compressor has no damping" in charted.stderr


def respond(compressor: Case, least: float, *, greatest_step: float) -> Response:
    """Follow the motion over the flywheel's inertia, from ``least`` to 0.3 kg.m2."""
    return frequency_response(
        compressor.parameters, least, 0.3, vary="crank.inertia", drive=Drive(torque=0.0), start=(GUESS,),
        greatest_step=greatest_step,
    )  # fmt: skip


@pytest.mark.parametrize("inertia", [0.35, 0.45, 0.8])
def test_newtons_method_ends_at_the_errors_of_the_integrator(compressor: Case, inertia: float) -> None:
    parameters = variant(compressor.parameters, motor_m0=0.0)
    family = Family(parameters=parameters, drive=Drive(torque=60.0), vary="crank.inertia")
    orbit = solve_orbit(operating_point(*family.operation(inertia)), 1, np.array([68.0]))
    assert orbit.residual < 1e-9


def test_a_flywheel_is_sized_with_friction_by_joint_forces(compressor: Case) -> None:
    response = respond(compressor, 0.15, greatest_step=0.1)
    assert response.problems == ()
    (branch,) = response.branches
    assert branch.parameter[[0, -1]].tolist() == [0.15, 0.3]
    # a heavier flywheel turns more evenly
    assert (np.diff(branch.amplitude) < 0.0).all()


def test_what_was_followed_is_kept_when_a_branch_is_lost(compressor: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def lose(*_: object) -> None:
        raise ContinuationError("no point there")

    with monkeypatch.context() as patch:
        patch.setattr(Follower, "_find_bound_point", lose)
        lost = respond(compressor, 0.2, greatest_step=0.3)
    assert len(lost.branches[0]) > 1
    assert lost.problems == (
        f"the branch is followed from crank.inertia = 0.2 kg.m2 to crank.inertia = {lost.branches[0].parameter[-1]:.6g} kg.m2 "
        "only: no next point is found: no point there",
    )
    monkeypatch.setattr(Follower, "start", lose)
    with pytest.raises(ContinuationError, match="no point there"):
        respond(compressor, 0.2, greatest_step=0.3)
