"""Fixtures for all tests, marks of tests by their place, and the distribution of tests to workers."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import Result
from hypothesis import settings

from analysis.export import NATIVE, NATIVE_FMI3, build, build_native
from analysis.mechanisms import MECHANISMS
from analysis.numerics.codegen import Kernel
from benchmarks.studio import chromium
from build_fmu import FMUS

from . import scripts
from .mechanisms import pendulum, rotor_on_cart

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# examples drawn by hypothesis have no time limit: the first one loads libraries, and the computer may be busy
settings.register_profile("unhurried", settings.default, deadline=None)
settings.load_profile("unhurried")

#: The call of a kernel's machine code without its check of types.
UNCHECKED = Kernel.unchecked
# in the tests the types of all arguments are checked
Kernel.unchecked = property(lambda kernel: kernel)

#: Units of work that are sent to workers: patterns of the tests' names, and the name of the unit. A unit is a file, whose tests
#: share results, or the test of one page of the documentation.
UNITS = ((r"(.*/test_docs\.py::test_the_page_.*)", r"\1"), (r"(.*?)::.*", r"\1"))


def unit(nodeid: str) -> str:
    """Return the unit of work to which a test belongs."""
    return next(match.expand(name) for pattern, name in UNITS if (match := re.fullmatch(pattern, nodeid)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Return a scheduler for ``--dist loadfile`` that sends units of work in the order in which they are collected."""
    from xdist.scheduler import LoadFileScheduling

    class Units(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return unit(nodeid)

    if config.getoption("dist") != "loadfile":
        return None
    # otherwise units with the most tests would go first, and the few long tests last
    config.option.loadscopereorder = False
    return Units(config, log)


#: Files that workers begin with: the longest, and long ones that would otherwise come last.
LONGEST = ("test_docs.py", "test_chapter_8.py", "test_coupling.py", "test_realtime.py", "test_wheel.py")

#: A test is long from this number of seconds on; the file lists the tests that were long when ``make durations`` last ran.
SECONDS, LONGER = 1.5, Path(__file__).parent / "seconds.txt"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--note-seconds", action="store_true", help=f"write {LONGER.name}: tests of {SECONDS:g} s and more"
    )


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Write the names of the long tests to `LONGER`; the time of fixtures, which tests share, does not count."""
    if terminalreporter.config.getoption("note_seconds"):
        calls = (report for report in terminalreporter.stats.get("passed", ()) if report.when == "call")
        names = sorted(
            report.nodeid for report in calls if report.duration >= SECONDS and "slow" not in report.keywords
        )
        LONGER.write_text("".join(f"{name}\n" for name in names), encoding="utf-8")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark tests that take longer, build or run an FMU, or are slow because they are long; the longest go to workers first."""
    longer = frozenset(LONGER.read_text(encoding="utf-8").splitlines())
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: item.path.name not in LONGEST)
    for item in items:
        if item.nodeid in longer:
            item.add_marker(pytest.mark.seconds)
        if item.get_closest_marker("long"):
            item.add_marker(pytest.mark.slow)
        if {"fmus", "natives"} & set(getattr(item, "fixturenames", ())) or item.path.parent.name == "fmu":
            item.add_marker(pytest.mark.fmu)


def _linkages_kept() -> Iterator[None]:
    before = dict(MECHANISMS)
    yield
    MECHANISMS.clear()
    MECHANISMS.update(before)


@pytest.fixture(autouse=True)
def linkages_of_the_test() -> Iterator[None]:
    """Forget the linkages that a test has described after the test."""
    yield from _linkages_kept()


@pytest.fixture(autouse=True, scope="module")
def linkages_of_the_module() -> Iterator[None]:
    """Forget the linkages that fixtures of a module have described after the module."""
    yield from _linkages_kept()


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return every Python FMU by its name, built from the present sources."""
    folder = tmp_path_factory.mktemp("fmu")
    return {name: build(mechanism, folder) for name, mechanism in FMUS.items()}


#: Mechanisms of the project, and mechanisms of the tests, which lack modes, commanding inputs, or energies as outputs.
NATIVE_MECHANISMS = (*FMUS.values(), rotor_on_cart.MECHANISM, pendulum.MECHANISM)


@pytest.fixture(scope="session")
def natives(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return every native FMU for this machine by the name of its file; LINKWORK_NATIVE_FMUS may name a folder of others."""
    given = os.environ.get("LINKWORK_NATIVE_FMUS")
    if given:
        return {path.stem: path for path in Path(given).glob("*.fmu")}
    folder = tmp_path_factory.mktemp("native")
    built = [build_native(mechanism, kind, folder) for mechanism in NATIVE_MECHANISMS for kind in (NATIVE, NATIVE_FMI3)]
    return {path.stem: path for path in built}


@pytest.fixture(scope="session")
def launched() -> Iterator[Callable[..., Browser]]:
    """Return a function that starts the system's Chromium with additional arguments."""
    path = chromium()
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        path = None
    if path is None:
        pytest.skip(
            "there is no Chromium here, or Playwright is not installed: apt install chromium, pip install playwright"
        )
    with sync_playwright() as playwright:
        made: list[Any] = []

        def launch(*arguments: str) -> Browser:
            made.append(playwright.chromium.launch(executable_path=path, args=["--no-sandbox", *arguments]))
            return made[-1]

        yield launch
        for one in made:
            one.close()


@pytest.fixture(scope="module")
def browser(launched: Callable[..., Browser]) -> Iterator[Browser]:
    """Return a running Chromium."""
    made = launched()
    yield made
    made.close()


@pytest.fixture
def linkwork(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Return a function that calls the command line with the given words, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return scripts.linkwork
