"""Fixtures of the analysis tests, and what reads the files that commands write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from analysis import cli


@pytest.fixture
def fmu(fmus: dict[str, Path]) -> Path:
    """FiveBarSlider.fmu."""
    return fmus["FiveBarSlider"]


@pytest.fixture
def linkwork(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """The command line, called with words in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def call(*words: object) -> Result:
        return CliRunner().invoke(cli.main, [str(word) for word in words], catch_exceptions=False)

    return call


def csv(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV file of numbers by their headings."""
    head = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    return dict(zip(head, np.loadtxt(path, delimiter=",", skiprows=1).T))
