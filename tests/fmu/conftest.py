"""The FMU under test, built once, and variants of it built from changed copies of the sources."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest

import build_fmu

#: Paths below the source root, each with a text to replace in the file and what to put there.
Changes = dict[str, tuple[str, str]]


def changed_sources(folder: Path, changes: Changes) -> Path:
    """A copy of the source root in ``folder`` with the changes made, each of them found at least once."""
    sources = folder / "fmu_src"
    shutil.copytree(build_fmu.SOURCES, sources, ignore=shutil.ignore_patterns("__pycache__"))
    for name, (old, new) in changes.items():
        path = sources / name
        text = path.read_text(encoding="utf-8")
        assert old in text, f"{name} does not contain {old!r}"
        path.write_text(text.replace(old, new), encoding="utf-8")
    return sources


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FiveBarSlider.fmu, built from the sources as they are."""
    return build_fmu.build("FiveBarSlider", tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="session")
def description(fmu: Path) -> ElementTree.Element:
    """Root of its model description."""
    return model_description(fmu)


@pytest.fixture
def build_variant(tmp_path: Path) -> Callable[[Changes], Path]:
    """Builds an FMU from changed sources, each in a folder of its own."""
    count = 0

    def build(changes: Changes) -> Path:
        nonlocal count
        count += 1
        folder = tmp_path / f"variant-{count}"
        return build_fmu.build("FiveBarSlider", folder, changed_sources(folder, changes))

    return build


def model_description(fmu: Path) -> ElementTree.Element:
    """Root of the model description of an FMU."""
    with ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))
