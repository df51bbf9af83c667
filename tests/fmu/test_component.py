"""FMUs as WebAssembly components: the interface of FMI-LS-WASM, the native FMU's numbers, its refusals and its saved states."""

from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy import extract
from fmpy.fmi1 import FMICallException

from analysis import Inputs, cosimulate
from analysis.export import NATIVE, NATIVE_FMI3, WASM, BuildError, build_all, build_native, rebuild
from analysis.run.component import ComponentSlave, component_path
from analysis.run.experiments import ExperimentError, verify
from analysis.run.fmu import CosimulationError, read_description
from linkwork import five_bar, slider_crank
from tests.mechanisms import pendulum

wasmtime = pytest.importorskip("wasmtime")
pytestmark = pytest.mark.fmu
MECHANISMS = {m.MECHANISM.fmu: m.MECHANISM for m in (five_bar, slider_crank, pendulum)}
TABLE_3_1 = five_bar.MECHANISM.published["table-3.1"].parameters


@pytest.fixture(scope="module")
def webs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Of each mechanism the FMU that is a component alone."""
    folder = tmp_path_factory.mktemp("web")
    return {name: build_native(mechanism, NATIVE_FMI3, folder, [WASM]) for name, mechanism in MECHANISMS.items()}


@pytest.fixture
def slave(webs: dict[str, Path], tmp_path: Path) -> ComponentSlave:
    return made(webs["FiveBarSlider"], tmp_path)


def made(fmu: Path, folder: Path, token: str | None = None) -> ComponentSlave:
    description = read_description(fmu)
    extract(str(fmu), str(folder))
    identifier = description.coSimulation.modelIdentifier
    return ComponentSlave(token or description.guid, str(folder), identifier, "one")


@pytest.mark.parametrize("interface", ["co-simulation", "model-exchange"])
@pytest.mark.parametrize("name", ["FiveBarSlider", "SliderCrank"])
def test_it_runs_like_the_native_one(
    natives: dict[str, Path], webs: dict[str, Path], name: str, interface: str
) -> None:
    mechanism = MECHANISMS[name]
    parameters = next(iter(mechanism.published.values())).parameters
    native, web = (
        cosimulate(fmu, parameters, Inputs(speed=20.0), stop_time=0.3, step=0.01, interface=interface)
        for fmu in (natives[f"{name}-native-fmi3"], webs[name])
    )
    assert (web.status, web.message) == (native.status, native.message)
    # sine and cosine of another C library differ by a unit in the last place
    difference, largest = (np.abs(values).max(axis=0) for values in (web.values - native.values, native.values))
    assert difference.max() < 1e-12 * largest.max()
    states = [list(native.names).index(name) for freedom in mechanism.freedoms for name in freedom[:2]]
    assert (difference[states] <= 1e-12 * largest[states]).all()


def test_the_archive_is_that_of_the_layered_standard(webs: dict[str, Path]) -> None:
    with ZipFile(webs["FiveBarSlider"]) as archive:
        names = archive.namelist()
        (binary,) = (name for name in names if name.startswith("binaries/"))
        content = archive.read(binary)
        manifest = archive.read("extra/org.modelica.fmi-ls-wasm/manifest.xml").decode()
    assert Path(binary) == component_path("", read_description(webs["FiveBarSlider"]).coSimulation.modelIdentifier)
    assert 'fmi-ls-name="org.modelica.fmi-ls-wasm"' in manifest
    engine = wasmtime.Engine()
    kind = wasmtime.component.Component(engine, content).type
    assert sorted(kind.imports(engine)) == ["fmi:fmi3/callbacks@3.0.0", "fmi:fmi3/types@3.0.0"]
    names = [f"fmi:fmi3/{name}@3.0.0" for name in ("co-simulation", "common", "model-exchange")]
    assert sorted(kind.exports(engine)) == names


def test_its_own_sources_build_it_again(webs: dict[str, Path]) -> None:
    found = list(rebuild(webs["FiveBarSlider"]))
    assert [compared.same for compared in found] == [True] * 2


def test_a_saved_state_is_restored_and_a_damaged_one_refused(slave: ComponentSlave) -> None:
    heard: list[bytes] = []
    slave.instantiate(loggingOn=True, logMessage=heard.append)
    slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    slave.doStep(0.0, 0.01)
    kept = slave.getFmuState()
    ends = []
    for _ in range(2):
        slave.doStep(0.01, 0.02)
        ends.append(slave.getFmuState())
        slave.setFmuState(kept)
    assert ends[0] == ends[1]
    place = next(n for n, letter in enumerate(kept) if chr(letter).isdigit() and n > len(kept) // 2)
    damaged = kept[:place] + bytes([ord("1") if kept[place] != ord("1") else ord("2")]) + kept[place + 1 :]
    with pytest.raises(FMICallException):
        slave.setFmuState(damaged)
    with pytest.raises(FMICallException):
        slave.doStep(5.0, 0.1)
    assert b"gap" in heard[-1]
    assert slave.getFloat32([]) == []
    with pytest.raises(FMICallException):
        slave.getFloat32([1])
    slave.freeInstance()


@pytest.mark.slow
def test_memory_of_calls_and_instances_is_given_back(webs: dict[str, Path], tmp_path: Path) -> None:
    """2100 calls of 1000 values each take 17 MB in all, where 4 MiB are allowed."""
    slave = made(webs["Pendulum"], tmp_path)
    slave._store.set_limits(memory_size=4 << 20)
    for _ in range(3):
        slave.instantiate()
        for _ in range(700):
            assert len(slave.getFloat64([0] * 1000)) == 1000
        slave.freeInstance()


def test_a_wrong_token_is_refused_in_words(webs: dict[str, Path], tmp_path: Path) -> None:
    slave = made(webs["Pendulum"], tmp_path, token="another")
    heard: list[bytes] = []
    with pytest.raises(FMICallException):
        slave.instantiate(loggingOn=True, logMessage=heard.append)
    assert b"token is another" in heard[0]


def test_fmi_2_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=r"FiveBarSlider-native\.fmu cannot be for wasm32-wasip2.*FMI 3\.0"):
        build_native(five_bar.MECHANISM, NATIVE, tmp_path, [WASM])


@pytest.mark.slow
def test_fmi_2_is_left_out_where_there_are_other_platforms(tmp_path: Path) -> None:
    built = list(build_all(["FiveBarSlider"], tmp_path, ["native", "native-fmi3"], [WASM, "x86_64-linux"]))
    assert [made.platforms for made in built] == [("x86_64-linux",), (WASM, "x86_64-linux")]


def test_experiments_are_refused_in_a_sentence(webs: dict[str, Path]) -> None:
    with pytest.raises(ExperimentError, match=r"only a WebAssembly component.*linkwork check"):
        list(verify(webs["FiveBarSlider"]))


def test_an_fmu_of_a_wrong_mechanism_is_named(webs: dict[str, Path]) -> None:
    with pytest.raises(CosimulationError, match="is not a FiveBarSlider"):
        cosimulate(webs["Pendulum"], TABLE_3_1, Inputs(speed=20.0), stop_time=0.1, step=0.01)
