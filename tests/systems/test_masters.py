"""Other masters run an archive of SSP, or its FMUs by their own wiring, to where ours comes; each in a process of its own."""

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from analysis.systems import JoinedSystem, run_system, write_ssp
from benchmarks.masters import RESULTS, RUNS, find, read

from ..fmu.runner import run_in_process
from ..fmu.test_masters import PAGE, SLOW, need
from ..scripts import called
from . import masters
from .conftest import started_in_its_modes, system_of, wiring_of

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
    found = run_in_process(by, archive, STEP, STEPS, list(COMPARED), options=(), timeout=300.0)
    assert found
    for name, value in found.items():
        assert value == pytest.approx(float(ours[name][-1]), rel=NEAR[master]), name
    if os.environ.get("LINKWORK_ALL_MASTERS") and master != "fmpy":
        assert set(found) == set(COMPARED)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8])
def test_ecco_keeps_its_tolerance_on_the_bond(archive: Path, tolerance: float) -> None:
    """It holds the energy that a step adds: at rest its controller is where 0.8 e^-0.15 = 1, e relative to the tolerance.

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
    joined = JoinedSystem(system).run(0.1, 1e-4)
    right = CubicSpline(joined.time, joined[supplied])(time)
    assert np.abs(found[supplied] - right).max() < len(time) * tolerance < 0.1 * right[-1]


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of what the masters run, made as it is needed."""
    return tmp_path_factory.mktemp("watched")


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="FMUs that write down what is called are for Linux")
@pytest.mark.parametrize("master", RUNS)
def test_the_table_of_what_masters_use_is_what_a_run_finds(watched: Path, master: str) -> None:
    name, stored = master.lower(), read(RESULTS)
    assert list(stored) == list(RUNS)
    if name in NEAR:
        need(name)
    if name in SLOW and not os.environ.get("LINKWORK_ALL_MASTERS"):
        pytest.skip("it takes a minute: LINKWORK_ALL_MASTERS runs it")
    assert find(master, watched) == stored[master]


def test_the_code_of_the_page_on_systems_runs(tmp_path: Path) -> None:
    """All but ECCO end at the speed of the crank that ours has."""
    (section,) = re.findall(r"^## Systems$(.*?)^## ", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    (commands,) = re.findall(r"```sh\n(.*?)```", section, flags=re.DOTALL)
    runs = [["-m", "analysis.cli", *line.split()[1:]] for line in commands.splitlines()]
    runs += [["-c", code] for code in re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL)]
    speeds = []
    for run in runs:
        need(next((name for name in ("libcosimpy", "ecospy") if name in run[-1]), "fmpy"))
        printed = called(sys.executable, *run, cwd=tmp_path, timeout=120)
        # the last number of a line of nothing but numbers: masters log beside it
        speeds += re.findall(r"^[^a-zA-Z:]*?([\d.]+)[\])]*$", printed, re.MULTILINE)
    ours = run_system(wiring_of("motor-crank"), step=5e-4, stop_time=0.1)["linkage.crank.speed"][-1]
    fmpy, fixed, ecco, ecos = map(float, speeds)
    assert [fmpy, fixed, ecos] == pytest.approx([float(ours)] * 3, rel=1e-5)
    assert ecco == pytest.approx(float(ours), rel=0.02)
