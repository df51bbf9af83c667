"""What is installed from a wheel builds native FMUs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest

from analysis.export import SOURCES

ROOT = SOURCES.parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy of the sources."""
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "sources"
    copy.mkdir()
    for name in ("analysis", "fmu_src"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE", "build_fmu.py"):
        shutil.copy2(ROOT / name, copy)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "wheel", "--no-deps"]
    done = subprocess.run([*pip, "--wheel-dir", str(folder), str(copy)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(folder.glob("*.whl"))


@pytest.mark.slow
def test_wheel_has_all_sources(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        inside = set(archive.namelist())
    sources = {
        f"analysis/_fmu_src/{path.relative_to(SOURCES).as_posix()}"
        for path in SOURCES.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert len([name for name in sources if "/native/" in name]) > 5
    assert sources - inside == set()


@pytest.mark.slow
def test_installed_wheel_builds_native_fmus(wheel: Path, tmp_path: Path) -> None:
    # what it depends on is that of this Python: to install it all anew takes a gigabyte
    venv.create(tmp_path / "venv", with_pip=False, symlinks=True)
    python = str(tmp_path / "venv" / ("Scripts" if sys.platform == "win32" else "bin") / "python")
    ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(subprocess.run([python, "-c", ask], capture_output=True, text=True, check=True).stdout.strip())
    with ZipFile(wheel) as archive:
        archive.extractall(packages)
    others = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    (packages / "others.pth").write_text("\n".join(others))
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    run: dict[str, Any] = {"cwd": tmp_path, "capture_output": True, "text": True, "check": False, "env": environment}
    where = "import build_fmu, analysis, linkwork; print(build_fmu.__file__, analysis.__file__, linkwork.__file__)"
    found = subprocess.run([python, "-c", where], **run)
    assert found.stdout.count(str(packages)) == 3, found.stdout + found.stderr
    command = [python, "-m", "build_fmu", "--kinds", "native", "--publish", "published"]
    done = subprocess.run(command, **run)
    assert done.returncode == 0, done.stdout + done.stderr
    for model in ("FiveBarSlider", "SliderCrank"):
        assert f"{model}-native.fmu: valid" in done.stdout
        assert (tmp_path / "build" / f"{model}-native.fmu").is_file()
        assert (tmp_path / "published" / f"{model}-native" / f"{model}-native_ref.csv").is_file()
