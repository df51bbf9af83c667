"""Fixtures of the analysis tests, and readers of the tables that commands print and of the CSV files that they write."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from csv import reader
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZipFile

import numpy as np
import pytest

from analysis.files import write_text
from analysis.mechanisms import register
from analysis.run import Case, Trajectory, simulate
from analysis.studio import PAGE, make_page
from tests.mechanisms import pendulum, rotor_on_cart, torsion

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture
def fmu(fmus: dict[str, Path]) -> Path:
    """Return the path of FiveBarSlider.fmu."""
    return fmus["FiveBarSlider"]


@pytest.fixture(scope="module")
def registered() -> None:
    """Register the mechanisms of the tests for a module."""
    for module in (pendulum, rotor_on_cart, torsion):
        register(module.MECHANISM)


def copied(fmu: Path, target: Path, change: Callable[[str, bytes], bytes | None]) -> Path:
    """Copy an FMU with ``change(name, content)`` for the content of each member; None leaves the member out."""
    with ZipFile(fmu) as archive, ZipFile(target, "w") as copy:
        for name in archive.namelist():
            if (content := change(name, archive.read(name))) is not None:
                copy.writestr(name, content)
    return target


def opened(browser: Browser, path: Path, **options: Any) -> Page:
    """Open a page of the studio, paused; an error of the page fails the test. ``options`` are those of the browser."""
    made = browser.new_page(**{"viewport": {"width": 1400, "height": 1000}} | options)
    made.set_default_timeout(600_000)
    made.on("pageerror", lambda error: pytest.fail(f"the page: {error}"))
    made.goto(path.as_uri())
    made.wait_for_function("document.documentElement.dataset.ready")
    made.click("#play")
    return made


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    """The built page, opened as a file."""
    made = opened(browser, PAGE)
    yield made
    made.close()


@pytest.fixture
def open_page(browser: Browser, tmp_path: Path) -> Iterator[Callable[..., Page]]:
    """Return a function that opens the built page, or one with the mechanism of a state, and `opened`'s options."""
    pages: list[Page] = []

    def open_one(state: Mapping[str, Any] | None = None, **options: Any) -> Page:
        path = PAGE if state is None else write_text(tmp_path / "page.html", make_page(state))
        pages.append(opened(browser, path, **options))
        return pages[-1]

    yield open_one
    for page in pages:
        page.close()


@pytest.fixture
def phone(browser: Browser) -> Iterator[Any]:
    """Return the studio's page on a phone, paused, and `touch(kind, points)`, which touches it with one or two fingers."""
    screen = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2}
    made = opened(browser, PAGE, has_touch=True, is_mobile=True, **screen)
    line = made.context.new_cdp_session(made)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        fingers = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
        line.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": fingers})
        # the page processes moves at its next frame
        made.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")

    yield made, touch
    made.close()


def marked(mark: str, values: Iterable[Any]) -> Iterator[Any]:
    """Mark the values of a parametrized test as "slow" or "long"; a tuple has the values of several parameters."""
    for value in values:
        yield pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=getattr(pytest.mark, mark))


def run_case(case: Case, **options: Any) -> Trajectory:
    """Run a case in this process; ``options`` of `simulate` replace those of the case."""
    own = {"initial": case.initial, "stop_time": case.stop_time, "step": case.step}
    return simulate(case.parameters, case.inputs, **own | options)


def cells(output: str) -> dict[str, list[str]]:
    """Return the cells of each row of printed tables, by the first cell of the row."""
    lines = ([cell.strip() for cell in line.strip("│").split("│")] for line in output.splitlines() if "│" in line)
    return {first: rest for first, *rest in lines}


def csv(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file of numbers, by their headings."""
    head = next(reader(path.read_text(encoding="utf-8").splitlines()))
    return dict(zip(head, np.loadtxt(path, delimiter=",", skiprows=1).T))
