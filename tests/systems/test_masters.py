"""Other masters run an archive of SSP, or its FMUs by their own wiring, to where ours comes; each in a process of its own."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from analysis.systems import Joined, run_system, write_ssp

from ..fmu.runner import run_in_process
from ..fmu.test_masters import SLOW, need
from . import masters
from .conftest import started_in_its_modes, system_of

STEP, STEPS = 5e-4, 100
#: What is compared.
COMPARED = ("linkage.crank.angle", "linkage.crank.speed", "linkage.slider.position", "motor.rotor.angle")
#: How near a master comes. PathSim's blocks see each other a step late.
NEAR = {"fmpy": 1e-6, "libcosimpy": 1e-6, "ecospy": 1e-6, "cofmupy": 1e-6, "pathsim": 1e-2}


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ssp(
        system_of("motor-crank").without_rates().wiring(), tmp_path_factory.mktemp("ssp") / "motor-crank.ssp"
    )


@pytest.mark.parametrize("master", [pytest.param(m, marks=pytest.mark.slow if m in SLOW else ()) for m in NEAR])
def test_a_master_comes_to_where_ours_does(archive: Path, tmp_path: Path, master: str) -> None:
    need(master)
    if master == "cofmupy":
        archive = write_ssp(started_in_its_modes("motor-crank", tmp_path), tmp_path / "motor-crank.ssp")
    ours = run_system(system_of("motor-crank").without_rates().wiring(), step=STEP, stop_time=STEP * STEPS)
    by: Callable[..., Any] = getattr(masters, f"by_{master}")
    found = run_in_process(by, archive, STEP, STEPS, list(COMPARED), options=())
    assert found
    for name, value in found.items():
        assert value == pytest.approx(float(ours[name][-1]), rel=NEAR[master]), name
    if os.environ.get("LINKWORK_ALL_MASTERS") and master != "fmpy":
        assert set(found) == set(COMPARED)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8])
def test_ecco_keeps_its_tolerance_on_the_bond(archive: Path, tolerance: float) -> None:
    """It holds the energy that a step brings in: at rest its controller is where 0.8 e^-0.15 = 1, e relative to the tolerance.

    What goes through the bond is then right to as many tolerances as there were steps.
    """
    need("libcosimpy")
    system, supplied = system_of("motor-crank").without_rates(), "linkage.energy.supplied"
    (bond,) = system.wiring().bonds()
    names = [str(end) for end in bond]
    found = run_in_process(masters.by_ecco, archive, 0.1, tolerance, names, [supplied], options=())
    time, *sides = (np.array(found[name]) for name in ("time", *names))
    effort, effort_to, flow, flow_to = sides
    brought = np.abs(effort * flow_to - flow * effort_to)[1:] * np.diff(time)
    assert np.median(brought) == pytest.approx(0.8 ** (1.0 / 0.15) * tolerance, rel=0.1)
    assert brought.max() < 2.0 * tolerance
    joined = Joined(system).run(0.1, 1e-4)
    right = CubicSpline(joined.time, joined[supplied])(time)
    assert np.abs(found[supplied] - right).max() < len(time) * tolerance < 0.1 * right[-1]
