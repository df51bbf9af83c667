"""Fixtures for each FMU under test in turn, and for variants of it built from changed copies of the sources."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest

from analysis.export import SOURCES, build
from build_fmu import FMUS

from .models import MODELS, Changes, Model


def changed_sources(folder: Path, changes: Changes) -> Path:
    """Copy the source root into ``folder`` and make the changes; each text to replace must occur."""
    sources = folder / "fmu_src"
    shutil.copytree(SOURCES, sources, ignore=shutil.ignore_patterns("__pycache__"))
    for name, (old, new) in changes.items():
        path = sources / name
        text = path.read_text(encoding="utf-8")
        assert old in text, f"{name} does not contain {old!r}"
        path.write_text(text.replace(old, new), encoding="utf-8")
    return sources


@pytest.fixture(params=list(MODELS))
def model(request: pytest.FixtureRequest) -> Model:
    """Return the model under test; the test runs once for each model."""
    return MODELS[request.param]


@pytest.fixture
def fmu(fmus: dict[str, Path], model: Model) -> Path:
    """Return the FMU of the model under test."""
    return fmus[model.name]


@pytest.fixture(scope="session")
def five_bar(fmus: dict[str, Path]) -> Path:
    """Return FiveBarSlider.fmu, for tests of its mechanics."""
    return fmus["FiveBarSlider"]


@pytest.fixture
def description(fmu: Path) -> ElementTree.Element:
    """Return the root of the model description of the FMU under test."""
    return model_description(fmu)


@pytest.fixture
def build_variant(tmp_path: Path, model: Model) -> Callable[[Changes], Path]:
    """Return a function that builds the FMU under test from changed sources, each time in a folder of its own."""
    count = 0

    def variant(changes: Changes) -> Path:
        nonlocal count
        count += 1
        folder = tmp_path / f"variant-{count}"
        return build(FMUS[model.name], folder, changed_sources(folder, changes))

    return variant


def model_description(fmu: Path) -> ElementTree.Element:
    """Return the root of the model description of an FMU."""
    with ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))
