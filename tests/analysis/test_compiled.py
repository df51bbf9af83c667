"""The compiled code: the plant's own equations, kept on disk for the next process."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkwork
from analysis.run import compiled
from linkwork.five_bar import dynamics
from tests.fmu.runner import run_in_process
from tests.strategies import seeded


@pytest.mark.parametrize("seed", range(20))
def test_compiled_equations_are_the_plain_ones(seed: int) -> None:
    case = seeded(seed)
    p = case.parameters.constants()
    solver = compiled.solver(p)
    for inputs in (case.torque_inputs, case.speed_inputs):
        states, forces = np.array([case.state]), np.array([inputs])
        rates, values = np.empty((1, 6)), np.empty((1, 27))
        solver.derivatives(p, states, forces, rates)
        solver.outputs(p, states, forces, 0.3, values)
        assert rates[0] == pytest.approx(dynamics.derivative(case.state, inputs, p), rel=1e-11)
        plain = dynamics.outputs(case.state, inputs, 0.3, p)
        assert values[0] == pytest.approx(plain, rel=1e-11, abs=1e-14)


def test_configuration_that_does_not_exist_is_nan() -> None:
    case = seeded(1)
    states = np.array([case.state])
    states[0, 1] = 100.0
    rates = np.empty((1, 6))
    p = case.parameters.constants()
    compiled.solver(p).derivatives(p, states, np.array([case.torque_inputs]), rates)
    assert np.isnan(rates[0, 2:4]).all()


# --- The cache


def _compile_and_run() -> dict[str, Any]:
    from time import perf_counter

    begun = perf_counter()
    from analysis import Inputs, simulate, simulate_many
    from analysis.run import compiled
    from linkwork.five_bar.published import TABLE_3_1

    run = simulate(TABLE_3_1, Inputs(speed=44.0), stop_time=0.1)
    simulate_many([TABLE_3_1], Inputs(speed=44.0), stop_time=0.1)
    solver = compiled.solver(TABLE_3_1.constants())
    kernels = [solver.run, solver.run_many, solver.outputs, compiled.channels, solver.derivatives]
    return {
        "seconds": perf_counter() - begun,
        "hits": sum(sum(kernel.stats.cache_hits.values()) for kernel in kernels),
        "misses": sum(sum(kernel.stats.cache_misses.values()) for kernel in kernels),
        "folder": str(compiled.cache_folder()),
        "position": float(run["slider.position"][-1]),
    }


def test_second_process_finds_the_code_of_the_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "cache"))
    first = run_in_process(_compile_and_run, timeout=180.0)
    second = run_in_process(_compile_and_run)
    assert (first["hits"], first["misses"]) == (0, 5)
    assert (second["hits"], second["misses"]) == (5, 0)
    assert second["seconds"] < 0.5 * first["seconds"]
    assert second["position"] == first["position"]
    assert first["folder"] == second["folder"]
    assert Path(first["folder"]).parent == tmp_path / "cache"
    assert any(Path(first["folder"]).rglob("*.nbi"))


def test_cache_folder_changes_with_the_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "cache"))
    sources = tmp_path / "linkwork"
    shutil.copytree(Path(linkwork.__file__).parent, sources, ignore=shutil.ignore_patterns("__pycache__"))
    original = compiled.cache_folder()
    monkeypatch.setattr(linkwork, "__file__", str(sources / "__init__.py"))
    assert compiled.cache_folder() == original
    folders = {original}
    for name in ("five_bar/kinematics.py", "five_bar/dynamics.py", "tableau.py", "five_bar/parameters.py"):
        source = sources / name
        source.write_text(source.read_text(encoding="utf-8") + "\n", encoding="utf-8")
        folders.add(compiled.cache_folder())
    assert len(folders) == 5
    (sources / "new.py").touch()
    assert compiled.cache_folder() not in folders
    before = compiled.cache_folder()
    for name in compiled.COMPILED_MODULES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(Path(compiled.__file__).parent / name, tmp_path / name)
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "compiled.py"))
    assert compiled.cache_folder() == before
    for name in compiled.COMPILED_MODULES:
        with (tmp_path / name).open("a", encoding="utf-8") as file:
            file.write("\n")
        assert compiled.cache_folder() != before
        before = compiled.cache_folder()


def test_folder_that_cannot_be_written_to_falls_back_to_a_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "blocked"
    blocked.touch()
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(blocked / "below a file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    folder = compiled.cache_folder()
    assert folder.is_dir()
    assert folder.is_relative_to(tmp_path / "temporary")
    # the same again for the next process
    assert compiled.cache_folder() == folder


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
def test_temporary_folder_that_others_can_write_to_is_not_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "blocked"
    blocked.touch()
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(blocked))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    shared = compiled.cache_folder().parent
    assert not stat.S_IMODE(shared.stat().st_mode) & 0o022
    shared.chmod(0o777)
    other = compiled.cache_folder()
    assert other.is_dir()
    assert not other.is_relative_to(shared)
