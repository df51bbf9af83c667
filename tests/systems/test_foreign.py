"""FMUs of other tools as parts of a system."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder

from analysis.systems import System, WiringError, load_system, read_ssp, run_system, write_ssp
from analysis.systems.description import PartTable, RunTable

SYSTEM = """
[parts.pump]
fmu = "Pump.fmu"
values = { displacement = 2e-6 }

[parts.linkage]
case = "rig-2-spring-d"

[connections]
"linkage.drive.torque" = "pump.torque"
"pump.omega" = "linkage.crank.speed"

[run]
stop_time = "10 ms"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("foreign")
    FmuBuilder.build_FMU(Path(__file__).with_name("pump.py"), dest=made)
    return made


def system(folder: Path, old: str = "", new: str = "") -> System:
    (folder / "system.toml").write_text(SYSTEM.replace(old, new) if old else SYSTEM, encoding="utf-8")
    return load_system(folder / "system.toml")


def test_an_fmu_without_units_takes_those_at_the_other_end(folder: Path) -> None:
    wiring = system(folder).wiring()
    (note,) = (note for note in wiring.notes() if "units" in note)
    assert "torque in N.m" in note
    assert "omega in rad/s" in note
    (bond,) = wiring.bonds()
    assert str(bond.effort) == "pump.torque"
    run = run_system(wiring)
    assert run.units["pump.torque"] == "N.m"
    # the torque is there after the first step
    work = -2e-6 * 2e5 * (run["linkage.crank.angle"][-1] - run["linkage.crank.angle"][1])
    assert run["linkage.energy.supplied"][-1] == pytest.approx(work, rel=1e-9)


def test_values_without_a_unit_go_into_an_archive_and_back(folder: Path, tmp_path: Path) -> None:
    wiring = system(folder).wiring()
    again = read_ssp(write_ssp(wiring, tmp_path / "made.ssp"))
    assert dict(again.parts["pump"].values) == {"displacement": 2e-6}
    one, other = run_system(wiring), run_system(again)
    assert all(np.array_equal(one[name], other[name]) for name in one.values)


@pytest.mark.parametrize(
    ("new", "kind"),
    [('"linkage.load.fx" = "pump.full"', "Boolean"), ('"pump.valve" = "linkage.crank.speed"', "Integer")],
)
def test_ports_that_are_not_real_are_not_connected(folder: Path, new: str, kind: str) -> None:
    with pytest.raises(WiringError, match=f"is of type {kind}: only real variables are connected"):
        system(folder, '"linkage.drive.torque" = "pump.torque"', new).wiring()


@pytest.mark.parametrize("value", ["0.5", "nan"])
def test_start_values_that_are_not_of_their_type_are_refused(folder: Path, value: str) -> None:
    with pytest.raises(WiringError, match="a whole number"):
        system(folder, "displacement = 2e-6", f"valve = {value}").wiring()


def rewrite(source: Path, target: Path, name: str, *changes: tuple[str, str]) -> Path:
    """Copy an archive with texts of one of its files replaced."""
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w") as made:
        for entry in archive.namelist():
            content = archive.read(entry)
            for old, new in changes if entry == name else ():
                assert old.encode() in content
                content = content.replace(old.encode(), new.encode())
            made.writestr(entry, content)
    return target


def test_units_of_other_names_make_a_power_bond(folder: Path) -> None:
    defined = (
        '<UnitDefinitions><Unit name="Nm"><BaseUnit kg="1" m="2" s="-2" factor="1.0000000000001"/></Unit>'
        '<Unit name="rad/s"><BaseUnit rad="1" s="-1"/></Unit></UnitDefinitions>\n\t<LogCategories>'
    )
    units = ("<Real/>", '<Real unit="Nm"/>'), ('<Real start="0"/>', '<Real start="0" unit="rad/s"/>')
    rewrite(folder / "Pump.fmu", folder / "Other.fmu", "modelDescription.xml", ("<LogCategories>", defined), *units)
    wiring = system(folder, "Pump.fmu", "Other.fmu").wiring()
    assert [str(bond.effort) for bond in wiring.bonds()] == ["pump.torque"]


def test_start_values_with_units_fit_variables_without_one(folder: Path, tmp_path: Path) -> None:
    servo = PartTable(controller="dc-servo", values={"encoder_counts": 512})
    alone = System(parts={"servo": servo}, run=RunTable(stop_time=0.01))
    end, one = "</ssv:ParameterSet>", '<ssv:Units><ssc:Unit name="1"><ssc:BaseUnit/></ssc:Unit></ssv:Units>'
    for wiring, part, old, unit in (
        (system(folder).wiring(), "pump", '<ssv:Real value="2e-06"', "m3"),
        (alone.wiring(), "servo", '<ssv:Real value="512.0"', "1"),
    ):
        made = write_ssp(wiring, tmp_path / "made.ssp")
        changes = [(old, f'{old} unit="{unit}"'), (end, one + end)]
        other = rewrite(made, tmp_path / "other.ssp", f"resources/{part}.ssv", *changes)
        assert read_ssp(other).parts[part].values == wiring.parts[part].values


@pytest.mark.parametrize(("missing", "stop_time"), [(' stopTime="0.01"', 1.0), (' startTime="0.0"', 0.01)])
def test_both_times_of_an_experiment_may_be_missing(
    folder: Path, tmp_path: Path, missing: str, stop_time: float
) -> None:
    made = write_ssp(system(folder).wiring(), tmp_path / "made.ssp")
    other = rewrite(made, tmp_path / "other.ssp", "SystemStructure.ssd", (missing, ""))
    assert read_ssp(other).stop_time == stop_time
