"""Fixtures of the analysis tests."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def fmu(fmus: dict[str, Path]) -> Path:
    """FiveBarSlider.fmu."""
    return fmus["FiveBarSlider"]
