"""What `analysis` offers at its top: names, examples that run, quantities as text, published sets."""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path

import pytest

import analysis

FUNCTIONS = [name for name in dir(analysis) if inspect.isfunction(getattr(analysis, name))]
#: Constructors of signals, whose sentence is example enough.
SIGNALS = {"ramp", "steps", "table"}


def run_example(name: str) -> None:
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(analysis, name), name, globs={})
    assert 2 <= len(example.examples) <= 8, f"{name} has no short example"
    assert doctest.DocTestRunner().run(example).failed == 0


@pytest.mark.parametrize("name", sorted({*FUNCTIONS, "Inputs"} - SIGNALS - {"cosimulate"}))
def test_the_example_of_a_function_runs(name: str) -> None:
    run_example(name)


def test_the_example_of_cosimulate_runs(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "build").symlink_to(fmu.parent)
    run_example("cosimulate")


def test_the_example_of_the_package_runs() -> None:
    assert doctest.testmod(analysis).failed == 0
