"""Fixtures of the analysis tests."""

from __future__ import annotations

from pathlib import Path

import pytest

import build_fmu


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FiveBarSlider.fmu, built once from the sources as they are."""
    return build_fmu.build("FiveBarSlider", tmp_path_factory.mktemp("fmu"))
