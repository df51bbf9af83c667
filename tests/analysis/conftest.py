"""Fixtures of the analysis tests, and a reader of the CSV files that commands write."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from analysis.files import write_text
from analysis.mechanisms import register
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
    context = browser.new_context(
        viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True, device_scale_factor=2
    )
    made = context.new_page()
    made.set_default_timeout(600_000)
    made.on("pageerror", lambda error: pytest.fail(f"the page: {error}"))
    made.goto(PAGE.as_uri())
    made.wait_for_function("document.documentElement.dataset.ready")
    made.tap("#play")
    line = context.new_cdp_session(made)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        fingers = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
        line.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": fingers})
        # the page processes moves at its next frame
        made.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")

    yield made, touch
    context.close()


def csv(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file of numbers, by their headings."""
    head = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    return dict(zip(head, np.loadtxt(path, delimiter=",", skiprows=1).T))
