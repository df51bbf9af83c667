"""Native FMUs in a host without Python: where they are unpacked, what the address of their resources is, many at once."""

import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from .c_host import Unpacked, compile_host, run_host, unpack

NATIVE = ["FiveBarSlider-native", "FiveBarSlider-native-fmi3", "SliderCrank-native", "SliderCrank-native-fmi3"]
START = {"drive.mode": 0, "slider.damping": 25.0, "initial.crank_speed": 30.0}
FOLDERS = ["M\u00fcller", "with space", "a#b", "a%b", "a%20b", "(a)", "+&@'~", "\u5f00", "dots..", "-n"]
#: Forms of the address of a folder, which is in the place of the braces, and what is none.
ADDRESSES = [
    "file://{}",
    "file:{}",
    "file://localhost{}",
    "{}",
    "file:///%zz%",
    "http://somewhere/",
    "\u00fc",
    "",
    "file://" + 9999 * "a",
]


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The master in C."""
    return compile_host(tmp_path_factory.mktemp("host"))


@pytest.fixture(params=NATIVE)
def fmu(request: pytest.FixtureRequest, natives: dict[str, Path], tmp_path: Path) -> Unpacked:
    """Each native FMU."""
    return unpack(natives[request.param], tmp_path / "plain")


def run(host: Path, fmu: Unpacked, **options: Any) -> dict[str, Any]:
    found = run_host(host, fmu, START, **options)
    assert found["status"] == 0, found["logged"]
    assert found["python"] is False
    return found


@pytest.mark.parametrize("interface", ["cs", "me"])
def test_any_folder_will_do(host: Path, fmu: Unpacked, tmp_path: Path, interface: str) -> None:
    expected = run(host, fmu, interface=interface)["end"]
    for name in FOLDERS:
        folder = tmp_path / name
        shutil.copytree(fmu.folder, folder)
        moved = fmu._replace(folder=folder, library=folder / fmu.library.relative_to(fmu.folder))
        assert run(host, moved, interface=interface)["end"] == expected, name


def test_any_address_of_the_resources_will_do(host: Path, fmu: Unpacked) -> None:
    assert not (fmu.folder / "resources").exists()
    expected = run(host, fmu)["end"]
    for address in ADDRESSES:
        assert run(host, fmu, resources=address.format(fmu.folder / "resources"))["end"] == expected, address


def test_a_library_alone_will_do(host: Path, fmu: Unpacked, tmp_path: Path) -> None:
    expected = run(host, fmu)["end"]
    alone = shutil.copy(fmu.library, tmp_path)
    shutil.rmtree(fmu.folder)
    assert run(host, fmu._replace(library=Path(alone)))["end"] == expected


def test_instances_in_threads_agree(host: Path, fmu: Unpacked) -> None:
    expected = run(host, fmu)["end"]
    for interface in ("cs", "me"):
        found = run(host, fmu, interface=interface, instances=8, threads=8)
        assert found["same"], "an instance differs from the others"
        assert interface == "me" or found["end"] == expected


@pytest.mark.slow
def test_instances_in_threads_are_faster_than_one_after_the_other(host: Path, fmu: Unpacked) -> None:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if cores < 2:
        pytest.skip("there is one core")
    # enough for threads to begin and end within it; the least of several, by turns, as other processes may be busy
    one, both, threaded = [], [], []
    with ThreadPoolExecutor(2) as pool:
        for _ in range(12):
            one.append(run(host, fmu, steps=20_000, instances=8)["microseconds"])
            threaded.append(run(host, fmu, steps=20_000, instances=8, threads=8)["microseconds"])
            halves = [pool.submit(run, host, fmu, steps=20_000, instances=4) for _ in range(2)]
            both.append(max(half.result()["microseconds"] for half in halves) / 2.0)
            if len(one) > 2 and min(threaded) < 0.8 * min(one):
                return
    if min(both) > 0.8 * min(one):
        pytest.skip("two processes are no faster than one: others have the second core")
    pytest.fail(f"µs a step: in threads {min(threaded)}, one after the other {min(one)}, in processes {min(both)}")
