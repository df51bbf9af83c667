"""Fixtures that all tests share, the marks that go by place, and which tests go to one worker together."""

from __future__ import annotations

from pathlib import Path

import pytest

from analysis.export import build
from build_fmu import FMUS

#: Files, and the argument of `test_studies`, whose tests share results that take long, by the group they make. Run with
#: ``--dist loadgroup`` each group goes to one worker, and so does every other file.
GROUPS = {
    "test_chapter_7.py": "studies of chapter 7",
    "test_rig_studies.py": "studies of chapter 8",
    "test_rahman_studies.py": "studies of chapter R",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what builds or runs an FMU, and name the group of tests that a worker is to run."""
    for item in items:
        if "fmus" in getattr(item, "fixturenames", ()) or item.path.parent.name == "fmu":
            item.add_marker(pytest.mark.fmu)
        item.add_marker(pytest.mark.xdist_group(group(item)))


def group(item: pytest.Item) -> str:
    """Group of a test: that of its study's chapter, each page of the documentation by itself, else its file."""
    call = getattr(item, "callspec", None)
    if item.path.name == "test_studies.py" and call and "number" in call.params:
        number = call.params["number"]
        return f"studies of chapter {number.partition('.')[0] if '.' in number else number[:1]}"
    if item.path.name == "test_docs.py" and item.get_closest_marker("slow"):
        return item.name
    return GROUPS.get(item.path.name, str(item.path))


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Every FMU by its name, built from the sources as they are."""
    folder = tmp_path_factory.mktemp("fmu")
    return {name: build(mechanism, folder) for name, mechanism in FMUS.items()}
