"""The wheel: what is in it, and that it works where there is no checkout."""

import json
import os
import sys
import sysconfig
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement

import linkwork
from analysis.export import SOURCES
from tests.scripts import called

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.slow


#: Standard output of a command that ends well, without the checkout on its path.
output_of = partial(called, env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"})


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of a release, which `make release` names, or one built here."""
    if released := os.environ.get("LINKWORK_WHEEL"):
        return ROOT / released
    folder = tmp_path_factory.mktemp("wheel")
    output_of(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """The command of an environment that has the wheel, and the libraries of this one, called in a folder of its own."""
    folder = tmp_path_factory.mktemp("elsewhere")
    output_of(sys.executable, "-m", "venv", "--without-pip", "venv", cwd=folder)
    python = folder / "venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    output_of(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=folder)
    # a folder in a .pth file is searched last, and its own .pth files, such as a checkout's, are not read
    site = output_of(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip()
    Path(site, "libraries.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    return lambda *words: output_of(python.with_stem("linkwork"), *words, cwd=folder)


def test_the_wheel_has_two_packages_that_are_typed_and_no_other_module(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.partition("/")[0] for name in names if ".dist-info/" not in name} == {"analysis", "linkwork"}
    assert {"analysis/py.typed", "linkwork/py.typed", "analysis/_examples/run-up.toml"} <= set(names)


def test_the_wheel_has_its_bill_of_materials(wheel: Path) -> None:
    """What it carries, the page's library of curves, and what it asks for, with the versions that are asked for."""
    with ZipFile(wheel) as archive:
        (place,) = (name for name in archive.namelist() if name.endswith(".dist-info/sboms/linkwork.cdx.json"))
        bill = json.loads(archive.read(place))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = {r.name: str(r.specifier) for r in map(Requirement, project["dependencies"])}
    carried = json.loads((ROOT / "studio" / "package.json").read_text(encoding="utf-8"))["dependencies"]
    assert {c["name"]: c["properties"][0]["value"] for c in bill["components"] if "properties" in c} == asked
    assert {c["name"]: c["version"] for c in bill["components"] if "version" in c} == carried
    assert bill["metadata"]["component"]["version"] == linkwork.__version__
    assert set(bill["dependencies"][0]["dependsOn"]) == {*asked, *carried}


def test_the_wheel_has_all_sources_of_fmus(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        inside = set(archive.namelist())
    sources = {
        f"analysis/_fmu_src/{path.relative_to(SOURCES).as_posix()}"
        for path in SOURCES.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert len([name for name in sources if "/native/" in name]) > 5
    assert sources - inside == set()


def test_the_installed_wheel_builds_native_fmus_and_what_is_published_with_them(
    installed: Callable[..., str], tmp_path: Path
) -> None:
    said = installed("build", "--kinds", "native", "--dest", tmp_path, "--publish", tmp_path / "published")
    for model in ("FiveBarSlider", "SliderCrank"):
        assert f"{model}-native.fmu: valid" in said
        assert (tmp_path / f"{model}-native.fmu").is_file()
        assert (tmp_path / "published" / f"{model}-native" / f"{model}-native_ref.csv").is_file()


def test_the_installed_wheel_works_without_a_checkout(installed: Callable[..., str]) -> None:
    assert installed("--version").startswith("linkwork, version")
    assert "slider.position" in installed("run", "--published", "table-3.1", "--stop-time", "20 ms")
    examples = [path for path in (ROOT / "examples").rglob("*") if path.is_file() and path.parent.name != "__pycache__"]
    assert f"{len(examples)} files" in installed("examples")
    assert "torsion bar" in installed("run", "examples/torsion-bar.toml", "--stop-time", "20 ms", "--no-plot")
    assert "FiveBarSlider.fmu: valid" in installed("build", "FiveBarSlider", "--kinds", "python")
    assert "valid" in installed("info", "build/FiveBarSlider.fmu")
