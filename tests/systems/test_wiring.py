"""What is wired wrongly gets one sentence, what is perhaps not meant a note; files of SSP come back as they were."""

import os
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyssp_standard
import pytest
import xmlschema
from click.testing import Result

from analysis import figures, simulate
from analysis.files import read_tables
from analysis.run import read_case
from analysis.systems import (
    End,
    System,
    Wiring,
    WiringError,
    library,
    load_system,
    read_ssp,
    run_system,
    ssp_reader,
    write_ssp,
)
from analysis.systems.description import PartTable, RunTable
from analysis.systems.wiring import Part, Port
from linkwork.errors import InputError, LinkworkError, ParameterError, UnknownNameError

from .conftest import system_of, wiring_of

SCHEMAS = Path(str(pyssp_standard.__file__)).parent / "resources"


def wired(name: str, **connections: str) -> System:
    """A system of the library with connections changed: ``linkage__drive__torque="motor.shaft.turn"``."""
    system = system_of(name)
    ends = {}
    for target, source in connections.items():
        part, _, port = target.replace("__", ".").partition(".")
        ends[End(part, port)] = End(*source.split(".", 1))
    return replace(system, connections=system.connections | ends)


def test_names_need_no_quotation_marks(tmp_path: Path) -> None:
    """TOML makes tables of names with dots."""
    text = library()["motor-crank"].read_text(encoding="utf-8")
    bare = re.sub(r'"([\w.]+\.[\w.]+)" = ', r"\1 = ", text)
    assert bare != text
    (tmp_path / "bare.toml").write_text(bare, encoding="utf-8")
    found, known = load_system(tmp_path / "bare.toml"), system_of("motor-crank")
    assert (found.parts, found.connections) == (known.parts, known.connections)


@pytest.mark.parametrize(
    ("connections", "error", "message"),
    [
        ({"linkage__drive__torque": "motor.rotor.speed"}, WiringError, "rad/s and N.m; they must be the same"),
        ({"linkage__drive__torque": "motor.rotor.inertia"}, WiringError, "causality parameter, it must be an output"),
        ({"linkage__crank__speed": "motor.rotor.speed"}, WiringError, "is of causality output, it must be an input"),
        ({"linkage__drive__speed": "motor.rotor.speed"}, WiringError, "connected: only one may drive crank.angle"),
        ({"linkage__drive__torq": "motor.shaft.exerted_torque"}, UnknownNameError, r"did you mean drive\.torque"),
        ({"linkage__drive__torque": "engine.shaft.exerted_torque"}, UnknownNameError, "motor"),
    ],
)
def test_a_wrong_connection_is_refused(connections: dict[str, str], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        wired("motor-crank", **connections).wiring()


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('partner = "induction-motor"', 'partner = "diesel"', LinkworkError, "induction-motor"),
        ('partner = "induction-motor"', "", WiringError, "it must have one of case, partner, controller and fmu"),
        ('"3 N*s/m"', '"3 N"', ParameterError, "slider.damping"),
        ("slider.damping", "slider.dumping", UnknownNameError, "slider.damping"),
        ('"linkage.drive.torque"', '"linkage"', ParameterError, "a part and its variable"),
        ('step = "1 ms"', 'step = "0 ms"', ParameterError, "greater than zero"),
        ('partner = "induction-motor"', 'fmu = "nothing.fmu"', LinkworkError, "nothing.fmu"),
    ],
)
def test_a_wrong_description_is_refused(
    tmp_path: Path, old: str, new: str, error: type[Exception], message: str
) -> None:
    text = library()["motor-crank"].read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "wrong.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(error, match=message):
        load_system(tmp_path / "wrong.toml").wiring()


def test_notes_name_what_is_not_connected_and_loops() -> None:
    notes = wiring_of("motor-crank").notes()
    assert any("not connected" in note and "slider.force" in note for note in notes)
    # the torque of a shaft depends on the speed of its flange, not on its acceleration
    assert wiring_of("motor-crank").parts["motor"].feeds["shaft.exerted_torque"] == ("flangeDrive.speed",)
    assert not any("loop" in note for name in library() for note in wiring_of(name).notes())
    # an output of a crank at commanded speed that sets that speed's own rate
    own = wired("slider-tracking", linkage__drive__acceleration="linkage.crank.acceleration").wiring()
    assert any("loop linkage.crank.acceleration -> linkage.crank.acceleration" in note for note in own.notes())


def test_loops_of_parts_in_which_everything_depends_on_everything_are_found_soon() -> None:
    """There are 10^8 loops, as between FMUs of other tools that list no dependencies."""
    ways = [(way, causality, n) for way, causality in (("u", "input"), ("y", "output")) for n in range(8)]
    ports = {f"{way}{n}": Port(f"{way}{n}", n, causality, "Real", "", "", False) for way, causality, n in ways}
    inputs = tuple(name for name in ports if name.startswith("u"))
    feeds = {name: inputs for name in ports if name.startswith("y")}
    common: dict[str, Any] = {"fmu": Path(), "ports": ports, "values": {}, "feeds": feeds}
    parts = {name: Part(name=name, description=SimpleNamespace(unitDefinitions=()), **common) for name in "ab"}
    connections = {End(a, f"u{n}"): End(b, f"y{n}") for a, b in ("ab", "ba") for n in range(8)}
    loops = list(Wiring(title="", parts=parts, connections=connections, stop_time=1.0, step=0.1).loops())
    assert {len(loop) for loop in loops} == {3}
    assert set().union(*loops) == set(connections.values())


def test_a_controller_without_gains_is_noted(tmp_path: Path) -> None:
    text = library()["slider-tracking"].read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if "gain =" not in line]
    (tmp_path / "idle.toml").write_text("\n".join(lines), encoding="utf-8")
    assert len(lines) < len(text.splitlines())
    found = [note for note in load_system(tmp_path / "idle.toml").wiring().notes() if "gains" in note]
    assert [note.partition(": ")[2] for note in found] == ["its gains are 0: gain, integral_gain, derivative_gain"]
    assert not any("gains" in note for note in wiring_of("slider-tracking").notes())


def test_steps_longer_than_a_sample_are_noted() -> None:
    wiring = wiring_of("slider-tracking")
    assert not any("sample time" in note for note in [*wiring.notes(), *wiring.notes(0.5e-3)])
    found = [note.partition(": ") for note in wiring.notes(0.6e-3) if "sample time" in note]
    assert {name for name, _, _ in found} == {"reference", "controller"}
    assert all(said.startswith("0.0006 s between communication points are longer") for _, _, said in found)


@pytest.mark.parametrize(
    "case",
    [
        'published = "table-3.1"\nforce = "10 N"\n[drive]\nspeed = "100 rpm"',
        'published = "table-3.1"\n[drive]\ntorque = "0.5 N*m"',
        'published = "rahman-ideal"\n[drive]\nspeed = "60 rpm"\n[axial]\ngroove = true\n[groove]\namplitude = "30 mm"',
    ],
    ids=["force", "torque", "groove"],
)
def test_the_constant_inputs_of_a_case_act_in_a_system(tmp_path: Path, case: str) -> None:
    (tmp_path / "case.toml").write_text(f"{case}\n[run]\nstop_time = '20 ms'\nstep = '1 ms'", encoding="utf-8")
    read = read_case(read_tables(tmp_path / "case.toml"), folder=tmp_path)
    right = simulate(read.parameters, read.inputs, initial=read.initial, stop_time=0.02, step=1e-3)
    system = System(parts={"a": PartTable(case="case.toml")}, run=RunTable(stop_time=0.02), folder=tmp_path)
    run = run_system(system.wiring())
    assert run["a.slider.position"] == pytest.approx(right["slider.position"], rel=1e-7, abs=1e-10)


def test_an_input_of_a_case_that_varies_is_refused_unless_something_takes_its_place(tmp_path: Path) -> None:
    ramp = "{ kind = 'ramp', start = '0 rpm', end = '9 rpm', from_time = '0 s', to_time = '1 s' }"
    (tmp_path / "case.toml").write_text(f"published = 'table-3.1'\n[drive]\nspeed = {ramp}", encoding="utf-8")
    part = PartTable(case="case.toml")
    with pytest.raises(WiringError, match=r"parts.a: drive.speed of its case is not constant: connect it, or give"):
        _ = System(parts={"a": part}, folder=tmp_path).members
    held = System(parts={"a": replace(part, values={"drive.speed": "3 rad/s"})}, folder=tmp_path).members["a"].values
    assert (held["drive.mode"], held["drive.speed"]) == (1.0, 3.0)
    pushed = System(parts={"a": replace(part, values={"drive.torque": "2 N*m"})}, folder=tmp_path).members["a"].values
    assert (pushed["drive.mode"], pushed["drive.torque"]) == (0.0, 2.0)
    parts = {"a": part, "motor": PartTable(partner="induction-motor")}
    wires = {End("a", "drive.torque"): End("motor", "shaft.exerted_torque")}
    motor = System(parts=parts, connections=wires, folder=tmp_path)
    assert motor.members["a"].values["drive.mode"] == 0.0


def test_a_system_given_to_a_command_for_cases_is_named(linkwork: Callable[..., Result]) -> None:
    result = linkwork("run", str(library()["slider-tracking"]), code=1)
    assert "is a system of parts: linkwork system run" in result.stderr


@pytest.mark.parametrize("command", ["run", "check", "build", "draw", "host"])
def test_a_case_given_to_a_command_for_systems_is_named(linkwork: Callable[..., Result], command: str) -> None:
    result = linkwork("system", command, str(Path(__file__).parents[2] / "examples" / "tuning.toml"), code=1)
    assert "is a case of a tuning: linkwork tune" in result.stderr


@pytest.mark.parametrize(
    ("name", "count"), [("motor-crank", 1), ("press", 3), ("two-linkages", 3), ("slider-tracking", 0)]
)
def test_efforts_and_flows_between_two_parts_are_power_bonds(name: str, count: int) -> None:
    wiring = wiring_of(name)
    bonds = wiring.bonds()
    assert len(bonds) == count
    for bond in bonds:
        assert bond.effort.part == bond.flow_to.part
        assert bond.flow.part == bond.effort_to.part
        assert (wiring.port(bond.effort).unit, wiring.port(bond.flow).unit) in (("N.m", "rad/s"), ("N", "m/s"))


def unpacked(path: Path) -> Path:
    """The folder into which an archive is unpacked."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(path.with_name("there"))
    return path.with_name("there")


def entries_of(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def archived(path: Path, entries: dict[str, Any]) -> Path:
    """Write an archive of bytes and texts by name; return its path."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return path


def values_of(wiring: Wiring) -> dict[str, dict[str, Any]]:
    return {name: dict(part.values) for name, part in wiring.parts.items()}


@pytest.mark.parametrize("name", sorted(library()))
def test_an_archive_comes_back_as_it_was_and_keeps_to_the_schemas(name: str, tmp_path: Path) -> None:
    wiring = wiring_of(name)
    path = write_ssp(wiring, tmp_path / f"{name}.ssp")
    there = unpacked(path)
    xmlschema.XMLSchema10(SCHEMAS / "SystemStructureDescription.xsd").validate(there / "SystemStructure.ssd")
    values = xmlschema.XMLSchema10(SCHEMAS / "SystemStructureParameterValues.xsd")
    for part in wiring.parts:
        values.validate(there / "resources" / f"{part}.ssv")
    again = read_ssp(path)
    assert again.connections == wiring.connections
    assert (again.stop_time, again.step) == (wiring.stop_time, wiring.step)
    assert values_of(again) == values_of(wiring)
    one, other = (run_system(each, stop_time=20.0 * wiring.step, step=wiring.step) for each in (wiring, again))
    assert all(np.array_equal(one[output], other[output]) for output in one.values)


def test_fmi_3_goes_into_an_archive_of_ssp_2(tmp_path: Path) -> None:
    wiring = system_of("motor-crank").wiring(fmi=3)
    assert {part.description.fmiVersion for part in wiring.parts.values()} == {"3.0"}
    path = write_ssp(wiring, tmp_path / "made.ssp")
    schema = xmlschema.XMLSchema10(SCHEMAS / "ssp2" / "SystemStructureDescription.xsd")
    schema.validate(unpacked(path) / "SystemStructure.ssd")
    again = read_ssp(path)
    assert values_of(again) == values_of(wiring)
    one, other = (run_system(each, stop_time=0.02) for each in (again, wiring_of("motor-crank")))
    for name in map(str, wiring.connections.values()):
        np.testing.assert_allclose(one[name], other[name], rtol=1e-7, atol=1e-9)


def test_enumerations_are_written_by_the_names_of_their_items(tmp_path: Path) -> None:
    """Our own FMUs have integers for their modes; here the motor's FMU says that one is an enumeration."""
    wiring = wiring_of("motor-crank")
    part = wiring.parts["linkage"]
    mode = part.ports["drive.mode"]._replace(
        type="Enumeration", enumeration="Drive", items=((0, "torque"), (1, "speed"))
    )
    part = replace(part, ports={**part.ports, "drive.mode": mode}, values={**part.values, "drive.mode": 1.0})
    path = write_ssp(replace(wiring, parts={**wiring.parts, "linkage": part}), tmp_path / "made.ssp")
    values = unpacked(path) / "resources" / "linkage.ssv"
    xmlschema.XMLSchema10(SCHEMAS / "SystemStructureParameterValues.xsd").validate(values)
    assert '<ssv:Enumeration value="speed" name="Drive"' in values.read_text(encoding="utf-8")
    assert ssp_reader._as_number("speed", mode, "drive.mode") == 1.0
    with pytest.raises(WiringError, match="it must be a number"):
        ssp_reader._as_number("fast", mode, "drive.mode")


def test_start_values_in_other_units_are_converted_or_refused(tmp_path: Path) -> None:
    entries = entries_of(write_ssp(wiring_of("motor-crank"), tmp_path / "made.ssp"))
    text = entries["resources/linkage.ssv"].decode()
    right = wiring_of("motor-crank").parts["linkage"].values["crank.length"]
    own = f'"crank.length">\n      <ssv:Real value="{right}" unit="m"/>'
    assert own in text
    defined = '<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="1e-3"/></ssc:Unit></ssv:Units>'
    for unit, definition, fits in (
        ("mm", defined, True),
        ("kg", "</ssv:Units>", False),
        ("ell", "</ssv:Units>", False),
    ):
        given = own.replace(f'value="{right}" unit="m"', f'value="{1e3 * right}" unit="{unit}"')
        entries["resources/linkage.ssv"] = text.replace(own, given).replace("</ssv:Units>", definition).encode()
        other = archived(tmp_path / "other.ssp", entries)
        if fits:
            assert read_ssp(other).parts["linkage"].values["crank.length"] == pytest.approx(right, rel=1e-15)
        else:
            with pytest.raises(WiringError, match=f"crank.length starts with .* {unit}: it must be in m"):
                read_ssp(other)


def test_a_part_that_nothing_is_connected_to_is_kept(tmp_path: Path) -> None:
    motor = {"motor": system_of("motor-crank").parts["motor"]}
    wiring = System(parts=motor, run=RunTable(stop_time=0.01)).wiring()
    path = write_ssp(wiring, tmp_path / "made.ssp")
    assert dict(read_ssp(path).parts["motor"].values) == dict(wiring.parts["motor"].values)


COMMON = 'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0"'


def parameters(**values: str) -> str:
    """A parameter set; in names two underscores stand for a dot."""
    rows = "".join(f'<ssv:Parameter name="{k.replace("__", ".")}">{v}</ssv:Parameter>' for k, v in values.items())
    space = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    inside = f"<ssv:Parameters>{rows}</ssv:Parameters>"
    return f'<ssv:ParameterSet xmlns:ssv="{space}" {COMMON} name="set">{inside}</ssv:ParameterSet>'


def mapping(*entries: tuple[str, str, str]) -> str:
    rows = "".join(
        f'<ssm:MappingEntry source="{s}" target="{t}">{inside}</ssm:MappingEntry>' for s, t, inside in entries
    )
    space = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
    return f'<ssm:ParameterMapping xmlns:ssm="{space}" {COMMON}>{rows}</ssm:ParameterMapping>'


def bindings(*given: tuple[str, str, str]) -> str:
    """Bindings of parameters: attributes, a set, and a mapping."""
    rows = [
        f"<ssd:ParameterBinding {attributes}><ssd:ParameterValues>{values}</ssd:ParameterValues>"
        + (f"<ssd:ParameterMapping>{mapped}</ssd:ParameterMapping>" if mapped else "")
        + "</ssd:ParameterBinding>"
        for attributes, values, mapped in given
    ]
    return "".join(rows)


def test_what_would_be_read_past_is_refused(tmp_path: Path) -> None:
    entries = entries_of(write_ssp(wiring_of("motor-crank"), tmp_path / "made.ssp"))
    text = entries["SystemStructure.ssd"].decode()
    start = text.index("<ssd:Connection ")
    end = text.index("/>", start)
    changed = f'{text[:end]}><ssc:LinearTransformation factor="-1"/></ssd:Connection>{text[end + 2 :]}'
    twice = text.replace("</ssd:Connections>", f"{text[start:end]}/></ssd:Connections>")
    for wrong, message in (
        (changed, "LinearTransformation of a connection"),
        (changed.replace("Linear", "EnumerationMapping"), "EnumerationMappingTransformation of a connection"),
        (twice, "two connections"),
        ("", "no SystemStructure.ssd"),
        ("<", "is no XML"),
        (text.replace('"CoSimulation"', '"ModelExchange"', 1), "motor asks for ModelExchange"),
        (text.replace("x-fmu-sharedlibrary", "x-ssp-package", 1), "motor is of type application/x-ssp-package"),
        (text.replace("resources/motor.ssv", "resources/rotor.ssv"), "'resources/rotor.ssv': it must be a file"),
        (text.replace('<ssc:Real unit="rad/s"/>', '<ssc:Real unit="rpm"/>', 1), "is in rpm: it must be in rad/s"),
        (text.replace("<ssd:Connections>", "<ssd:SignalDictionaries/><ssd:Connections>"), "SignalDictionaries"),
        (text.replace("System>", "Syztem>").replace("ssd:System ", "ssd:Syztem "), "has no System"),
        (text.replace('<ssd:ParameterBinding source="resources/motor.ssv"/>',
                      bindings(("", parameters(fieldDrive__mode='<ssv:Real value="0.5"/>'), ""))), "a whole number"),
        (text.replace('<ssd:ParameterBinding source="resources/motor.ssv"/>',
                      bindings(("", parameters(rotor__mass='<ssv:Real value="NaN"/>'), ""))), "'NaN': it must be a number"),
    ):  # fmt: skip
        others = {name: content for name, content in entries.items() if name != "SystemStructure.ssd"}
        with pytest.raises(LinkworkError, match=message):
            read_ssp(archived(tmp_path / "wrong.ssp", others | ({"SystemStructure.ssd": wrong} if wrong else {})))
    (tmp_path / "text.ssp").write_text("no archive")
    with pytest.raises(InputError, match=r"is no \.ssp"):
        read_ssp(tmp_path / "text.ssp")


def test_start_values_of_the_whole_system_through_a_mapping(tmp_path: Path) -> None:
    entries: dict[str, Any] = dict(entries_of(write_ssp(wiring_of("motor-crank"), tmp_path / "made.ssp")))
    binding = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/all.ssv"><ssd:ParameterMapping '
        'source="resources/all.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>'
    )
    text = entries["SystemStructure.ssd"].decode()
    text = text.replace('<ssd:System name="system">', f'<ssd:System name="system">{binding}')
    entries["SystemStructure.ssd"] = text.replace('<ssd:ParameterBinding source="resources/linkage.ssv"/>', "")
    entries["resources/all.ssv"] = parameters(damper='<ssv:Real value="7"/>')
    entries["resources/all.ssm"] = mapping(("damper", "linkage.slider.damping", ""))
    mapped = read_ssp(archived(tmp_path / "mapped.ssp", entries))
    assert dict(mapped.parts["linkage"].values) == {"slider.damping": 7.0}


#: A connection with its ends in the other order.
MOTOR, LINKAGE = ("motor", "shaft.exerted_torque"), ("linkage", "drive.torque")
REVERSED = [
    (f'{side}Element="{old[0]}" {side}Connector="{old[1]}"', f'{side}Element="{new[0]}" {side}Connector="{new[1]}"')
    for side, old, new in (("start", MOTOR, LINKAGE), ("end", LINKAGE, MOTOR))
]


def test_an_archive_of_another_tool_is_read_by_the_rules_of_the_standard(tmp_path: Path) -> None:
    """Precedence of parameters, prefixes before mappings, FMUs of one name, ends in any order, files inside an FMU."""
    entries = entries_of(write_ssp(wiring_of("motor-crank"), tmp_path / "made.ssp"))
    text = entries["SystemStructure.ssd"].decode()
    for part, old in (("motor", "InductionMotor-native.fmu"), ("linkage", "FiveBarSlider-native.fmu")):
        entries[f"resources/{part} 1/model.fmu"] = entries.pop(f"resources/{old}")
        text = text.replace(f"resources/{old}", f"resources/{part}%201/model.fmu")
    (tmp_path / "inner.fmu").write_bytes(entries["resources/motor 1/model.fmu"])
    with zipfile.ZipFile(tmp_path / "inner.fmu", "a") as fmu:
        fmu.writestr("extra/set.ssv", parameters(shaft__damping='<ssv:Real value="0.25"/>'))
    entries["resources/motor 1/model.fmu"] = (tmp_path / "inner.fmu").read_bytes()
    linear = '<ssc:LinearTransformation factor="2" offset="1"/>'
    table = '<ssc:IntegerMappingTransformation><ssc:MapEntry source="7" target="1"/></ssc:IntegerMappingTransformation>'
    first = parameters(slider__damping='<ssv:Real value="1"/>', slider__stiffness='<ssv:Real value="100"/>')
    later = parameters(slider__damping='<ssv:Real value="2"/>', gone='<ssv:Real value="1"/>')
    own = parameters(d='<ssv:Float64 value="3"/>', mode='<ssv:Integer value="7"/>', rest='<ssv:Real value="9"/>')
    mapped = mapping(("my.d", "slider.mass", linear), ("my.mode", "drive.mode", table))
    linkage = bindings(("", first, ""), ("", later, ""), ('prefix="my."', own, mapped))
    reals = {"linkage__slider__stiffness": 500, "nowhere__x": 5, "push": 4}
    whole = parameters(**{name: f'<ssv:Real value="{value}"/>' for name, value in reals.items()})
    top = f"<ssd:ParameterBindings>{bindings(('', whole, ''))}</ssd:ParameterBindings>"
    edge = '<ssd:Connectors><ssd:Connector name="push" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>'
    inside = '<ssd:Connection startConnector="push" endElement="linkage" endConnector="slider.force"/>'
    for old, new in (
        *REVERSED,
        ('source="resources/motor.ssv"', 'source="extra/set.ssv" sourceBase="component"'),
        ('<ssd:ParameterBinding source="resources/linkage.ssv"/>', linkage),
        ('<ssd:System name="system">', f'<ssd:System name="system">{edge}{top}'),
        ("</ssd:Connections>", f"{inside}</ssd:Connections>"),
    ):
        assert old in text
        text = text.replace(old, new)
    entries["SystemStructure.ssd"] = text.encode()
    wiring = read_ssp(archived(tmp_path / "other.ssp", entries))
    assert wiring.connections == wiring_of("motor-crank").connections
    slider = {"slider.damping": 2.0, "slider.stiffness": 500.0, "slider.mass": 7.0, "slider.force": 4.0}
    values = slider | {"drive.mode": 1.0}
    assert values_of(wiring) == {"motor": {"shaft.damping": 0.25}, "linkage": values}
    assert [part.description.modelName for part in wiring.parts.values()] == ["InductionMotor", "FiveBarSlider"]
    left_out = [note for note in wiring.notes() if "left out" in note]
    assert [note.split()[2] for note in left_out] == ["linkage.gone", "nowhere.x"]


def test_parts_of_systems_inside_a_system_are_parts(tmp_path: Path) -> None:
    """The linkage within a system of its own, whose connectors the outer connections meet; parameters by their paths."""
    entries = entries_of(write_ssp(wiring_of("motor-crank"), tmp_path / "made.ssp"))
    text = entries["SystemStructure.ssd"].decode()
    start, end = text.index('<ssd:Component name="linkage"'), text.index("</ssd:Elements>")
    ports = (("drive.torque", "turn", "input"), ("crank.speed", "w", "output"), ("crank.acceleration", "a", "output"))
    edges = [f'<ssd:Connector name="{edge}" kind="{kind}"/>' for _, edge, kind in (*ports, ("", "push", "input"))]
    wire = '<ssd:Connection startElement="linkage" startConnector='
    inside = [f'{wire}"{port}" endConnector="{edge}"/>' for port, edge, _ in ports]
    own = bindings(("", parameters(push='<ssv:Real value="3"/>', linkage__slider__damping='<ssv:Real value="5"/>'), ""))
    whole = bindings(("", parameters(machine__linkage__slider__damping='<ssv:Real value="7"/>'), ""))
    inner = (
        f'<ssd:System name="machine"><ssd:Connectors>{"".join(edges)}</ssd:Connectors><ssd:ParameterBindings>{own}'
        f"</ssd:ParameterBindings><ssd:Elements>{text[start:end]}</ssd:Elements><ssd:Connections>{''.join(inside)}"
        '<ssd:Connection startConnector="push" endElement="linkage" endConnector="slider.force"/>'
        "</ssd:Connections></ssd:System>"
    )
    outer = text[end:]
    for port, edge, _ in ports:
        outer = outer.replace(f'="{port}"', f'="{edge}"')
    # an input of the whole system, of which the value of the inner system is none: it stays within that system
    shared = (
        '<ssd:Connection startConnector="all" endElement="machine" endConnector="push"/>'
        '<ssd:Connection startConnector="all" endElement="motor" endConnector="rotor.torque"/></ssd:Connections>'
    )
    text = text[:start] + inner + outer.replace('="linkage"', '="machine"').replace("</ssd:Connections>", shared)
    top = (
        '<ssd:System name="system"><ssd:Connectors><ssd:Connector name="all" kind="input"/></ssd:Connectors>'
        f"<ssd:ParameterBindings>{whole}</ssd:ParameterBindings>"
    )
    entries["SystemStructure.ssd"] = text.replace('<ssd:System name="system">', top).encode()
    wiring, flat = read_ssp(archived(tmp_path / "nested.ssp", entries)), wiring_of("motor-crank")
    named = {str(t).replace("machine_", ""): str(s).replace("machine_", "") for t, s in wiring.connections.items()}
    assert named == {str(t): str(s) for t, s in flat.connections.items()}
    values = dict(flat.parts["linkage"].values) | {"slider.force": 3.0, "slider.damping": 7.0}
    assert values_of(wiring) == {"motor": dict(flat.parts["motor"].values), "machine_linkage": values}
    assert run_system(wiring, stop_time=2e-3).status == 0


def test_the_commands(linkwork: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "motor-crank" in linkwork("system", "new").output
    wrote = linkwork("system", "new", "motor-crank")
    assert wrote.output == "wrote motor-crank.toml; next: linkwork system run motor-crank.toml\n"
    for words in (
        ("build", "motor-crank.toml"),
        ("draw", "motor-crank.toml"),
        ("run", "out/motor-crank.ssp", "--stop", "0.05 s", "--step", "1 ms", "--coupling", "rollback"),
        ("check", "motor-crank.toml", "--stop", "0.04 s"),
        ("check", "out/motor-crank.ssp"),
    ):
        linkwork("system", *words)
    written = {f"motor-crank{end}" for end in (".ssp", "-diagram.png", ".csv", ".png", "-check.png")}
    assert written <= set(os.listdir("out"))
    header = Path("out/motor-crank.csv").read_text().splitlines()[0]
    assert header.startswith("time [s],motor.field.angle [rad],")
    assert header.endswith("[W]")
    linkwork("system", "new", "motor-cranc", code=1)
    linkwork("system", "run", "motor-crank.toml", "--stop", "0.05 s", "--coupling", "hole", code=1)


def test_the_diagram_has_each_connection_and_no_part_on_another() -> None:
    for name in library():
        figure = figures.plot(wiring_of(name))
        texts = [text.get_text() for text in figure.axes[0].texts]
        assert set(wiring_of(name).parts) <= set(texts)
        boxes = [patch.get_window_extent() for patch in figure.axes[0].patches if patch.get_zorder() == 3]
        assert not any(a.overlaps(b) for n, a in enumerate(boxes) for b in boxes[:n])
