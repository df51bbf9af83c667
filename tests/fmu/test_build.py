"""Building: what is in the archive, which GUID it bears, and how a failure is told."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

import build_fmu
from build_fmu import BuildError

from .conftest import Changes, changed_sources, model_description

Build = Callable[[Changes], Path]


def guid(fmu: Path) -> str:
    return model_description(fmu).get("guid")


def test_archive(fmu: Path) -> None:
    with ZipFile(fmu) as archive:
        assert archive.testzip() is None
        assert {entry.compress_type for entry in archive.infolist()} == {ZIP_DEFLATED}
        names = archive.namelist()
        assert names[0] == "modelDescription.xml"
        page = archive.read("documentation/index.html").decode("utf-8")
        assert archive.read("model.png").startswith(b"\x89PNG\r\n\x1a\n")
        assert "MIT License" in archive.read("documentation/licenses/license.txt").decode("utf-8")
    for variable in ("slider.coulomb_friction", "drive.applied_torque", "solver.message"):
        assert f"<td>{variable}</td>" in page
    assert {"binaries/linux64/FiveBarSlider.so", "binaries/win64/FiveBarSlider.dll"} <= set(names)
    assert not [name for name in names if name.endswith(".pyc") or "slider_crank" in name]


def test_modules_inside_carry_the_hash_of_their_content(fmu: Path, build_variant: Build) -> None:
    def modules(path: Path) -> set[str]:
        with ZipFile(path) as archive:
            return {Path(name).parts[1] for name in archive.namelist() if name.startswith("resources/")} - {
                "pythonfmu",
                "slavemodule.txt",
            }

    ours = modules(fmu)
    tags = {name.removesuffix(".py")[-8:] for name in ours}
    assert len(tags) == 1
    assert {name.removesuffix(".py")[:-9] for name in ours} == {"linkwork", "slave", "five_bar_slave"}
    other = modules(
        build_variant({"linkwork/friction.py": ("FRICTION_SPEED = 1e-3", "FRICTION_SPEED = 2e-3")})
    )
    assert not ours & other


def test_two_builds_are_the_same_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    first, second = (build_fmu.build("FiveBarSlider", tmp_path / name).read_bytes() for name in ("a", "b"))
    assert first == second


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({}, True),
        ({"linkwork/five_bar/dynamics.py": ('"""Inertia matrix; the crank', '"""The inertia matrix; the crank')}, True),
        ({"linkwork/friction.py": ("FRICTION_SPEED = 1e-3", "FRICTION_SPEED = 2e-3")}, True),
        ({"linkwork/five_bar/variables.py": ('"Crank, A to B; greater than zero"', '"The crank, from A to B"')}, True),
        ({"linkwork/five_bar/variables.py": ('"closure.residual", "m"', '"closure.gap", "m"')}, False),
        ({"linkwork/five_bar/variables.py": ('"closure.residual", "m"', '"closure.residual", "1"')}, False),
    ],
    ids=["nothing", "docstring", "constant", "description", "name", "unit"],
)
def test_guid_changes_with_the_interface_and_only_then(
    fmu: Path, build_variant: Build, changes: Changes, same: bool
) -> None:
    assert (guid(build_variant(changes)) == guid(fmu)) is same


def test_unknown_model(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="no model 'SixBar': the models are FiveBarSlider"):
        build_fmu.build("SixBar", tmp_path)


@pytest.mark.parametrize("missing", ["five_bar_slave.py", "slave.py", "linkwork", "linkwork/five_bar/dynamics.py"])
def test_incomplete_sources(tmp_path: Path, missing: str) -> None:
    sources = changed_sources(tmp_path, {})
    path = sources / missing
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    before = list(sys.path)
    with pytest.raises(BuildError, match=r"five_bar_slave\.py|slave\.py|linkwork|dynamics"):
        build_fmu.build("FiveBarSlider", tmp_path / "build", sources)
    assert sys.path == before
    assert not (tmp_path / "build" / "FiveBarSlider.fmu").exists()


def test_failed_build_leaves_the_old_fmu(tmp_path: Path, fmu: Path) -> None:
    dest = tmp_path / "build"
    dest.mkdir()
    shutil.copy2(fmu, dest)
    # outputs and variables out of step: what is built would not be valid
    broken = changed_sources(tmp_path, {"linkwork/variables.py": ('"kg.m2": Unit(kg=1, m=2)', '"kg.m3": Unit(kg=1)')})
    with pytest.raises(BuildError):
        build_fmu.build("FiveBarSlider", dest, broken)
    assert [path.name for path in dest.iterdir()] == ["FiveBarSlider.fmu"]
    assert (dest / "FiveBarSlider.fmu").read_bytes() == fmu.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["FiveBarSlider"], 0, "FiveBarSlider.fmu: valid"),
        (["SixBar"], 1, "error: there is no model 'SixBar'"),
        (["--no-such-option"], 2, "usage:"),
    ],
    ids=["good", "unknown", "usage"],
)
def test_exit_codes(tmp_path: Path, arguments: list[str], code: int, told: str) -> None:
    done = subprocess.run(
        [sys.executable, str(Path(build_fmu.__file__)), "--dest", str(tmp_path), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == code, done.stderr
    assert told in (done.stdout if code == 0 else done.stderr)
    assert (tmp_path / "FiveBarSlider.fmu").is_file() is (code == 0)
