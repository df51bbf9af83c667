"""The model description is the contract, variable by variable, and says what masters need to know."""

from __future__ import annotations

from math import pi
from pathlib import Path
from xml.etree.ElementTree import Element

import pytest
from fmpy.validation import validate_fmu

import linkwork

# The contract, written out: name, causality, type, unit, start. Starts are Table 3.1 of the thesis at 420 rpm with
# k = 1e6 dyn/cm and mu = 3e4 dyn.s/cm in SI; a "?" is an output whose start follows from the others.
CONTRACT = """
ground.length               parameter Real    m      0.1535
crank.length                parameter Real    m      0.05
coupler.length              parameter Real    m      0.15
rocker.length               parameter Real    m      0.15
crank.mass                  parameter Real    kg     0
coupler.mass                parameter Real    kg     0.209
rocker.mass                 parameter Real    kg     0.206
slider.mass                 parameter Real    kg     0.59
crank.inertia               parameter Real    kg.m2  1.25e-3
coupler.inertia             parameter Real    kg.m2  5.25e-4
rocker.inertia              parameter Real    kg.m2  3.863e-4
crank.cog_distance          parameter Real    m      0
coupler.cog_distance        parameter Real    m      0.0982
rocker.cog_distance         parameter Real    m      0.075
crank.cog_angle             parameter Real    rad    0
coupler.cog_angle           parameter Real    rad    0
rocker.cog_angle            parameter Real    rad    0
slider.guide_angle          parameter Real    rad    0
slider.stiffness            parameter Real    N/m    1000
slider.spring_free_position parameter Real    m      0
slider.damping              parameter Real    N.s/m  30
slider.coulomb_friction     parameter Real    N      0
coupler.point_distance      parameter Real    m      0
coupler.point_angle         parameter Real    rad    0
gravity                     parameter Real    m/s2   9.81
ground.inclination          parameter Real    rad    0
assembly.branch             parameter Integer -      1
drive.mode                  parameter Integer -      1
initial.crank_angle         parameter Real    rad    0
initial.crank_speed         parameter Real    rad/s  43.982297150257104
initial.slider_position     parameter Real    m      0
initial.slider_velocity     parameter Real    m/s    0
solver.tolerance            parameter Real    1      1e-9
drive.torque                input     Real    N.m    0
drive.speed                 input     Real    rad/s  43.982297150257104
drive.acceleration          input     Real    rad/s2 0
slider.force                input     Real    N      0
load.fx                     input     Real    N      0
load.fy                     input     Real    N      0
crank.angle                 output    Real    rad    0
crank.speed                 output    Real    rad/s  43.982297150257104
crank.acceleration          output    Real    rad/s2 0
coupler.angle               output    Real    rad    ?
rocker.angle                output    Real    rad    ?
slider.position             output    Real    m      0
slider.velocity             output    Real    m/s    0
slider.acceleration         output    Real    m/s2   ?
coupler.point.x             output    Real    m      0.05
coupler.point.y             output    Real    m      0
drive.applied_torque        output    Real    N.m    -1.129656931
pin.A.fx                    output    Real    N      ?
pin.A.fy                    output    Real    N      ?
pin.B.fx                    output    Real    N      ?
pin.B.fy                    output    Real    N      ?
pin.C.fx                    output    Real    N      ?
pin.C.fy                    output    Real    N      ?
pin.D.fx                    output    Real    N      ?
pin.D.fy                    output    Real    N      ?
slider.guide_force          output    Real    N      ?
energy.kinetic              output    Real    J      ?
energy.potential            output    Real    J      ?
energy.dissipated           output    Real    J      0
energy.supplied             output    Real    J      0
energy.residual             output    Real    J      0
closure.residual            output    Real    m      0
transmission.angle          output    Real    rad    ?
solver.status               output    Integer -      0
solver.message              output    String  -      -
"""
ROWS = [tuple(line.split()) for line in CONTRACT.split("\n") if line]

#: Exponents of kg, m, s and rad; the other base units of SI do not occur.
UNITS = {
    "1": (0, 0, 0, 0),
    "m": (0, 1, 0, 0),
    "m/s": (0, 1, -1, 0),
    "m/s2": (0, 1, -2, 0),
    "rad": (0, 0, 0, 1),
    "rad/s": (0, 0, -1, 1),
    "rad/s2": (0, 0, -2, 1),
    "kg": (1, 0, 0, 0),
    "kg.m2": (1, 2, 0, 0),
    "N": (1, 1, -2, 0),
    "N.m": (1, 2, -2, 0),
    "N/m": (1, 0, -2, 0),
    "N.s/m": (1, 0, -1, 0),
    "J": (1, 2, -2, 0),
}

BOUNDS = {
    **{name: (0.0, None) for name, _, _, unit, _ in ROWS if unit in ("kg", "kg.m2", "N/m", "N.s/m")},
    **{f"{link}.length": (0.0, None) for link in ("ground", "crank", "coupler", "rocker")},
    "slider.coulomb_friction": (0.0, None),
    "gravity": (0.0, None),
    "assembly.branch": (-1.0, 1.0),
    "drive.mode": (0.0, 1.0),
    "solver.tolerance": (1e-13, 1e-2),
    "coupler.angle": (-pi, pi),
    "rocker.angle": (-pi, pi),
    "energy.kinetic": (0.0, None),
    "closure.residual": (0.0, None),
    "transmission.angle": (0.0, pi),
    "solver.status": (0.0, 9.0),
}

INPUTS = {name for name, causality, *_ in ROWS if causality == "input"}
#: What each output depends on at one instant, where that is not every input. A commanded speed that jumps takes the
#: slider's velocity with it, and with it all energies but the potential and the dissipated.
OF_STATE = [
    *("crank.angle", "coupler.angle", "rocker.angle", "slider.position", "coupler.point.x", "coupler.point.y"),
    *("energy.potential", "energy.dissipated", "closure.residual", "transmission.angle"),
    *("solver.status", "solver.message"),
]
OF_SPEED = ["crank.speed", "slider.velocity", "energy.kinetic", "energy.supplied", "energy.residual"]
DEPENDENCIES = {name: set() for name in OF_STATE} | {name: {"drive.speed"} for name in OF_SPEED}


def scalars(description: Element) -> dict[str, Element]:
    return {node.get("name"): node for node in description.find("ModelVariables")}


def test_validator_finds_nothing(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []


def test_variables_are_those_of_the_contract_in_its_order(description: Element) -> None:
    assert list(scalars(description)) == [row[0] for row in ROWS]


@pytest.mark.parametrize(("name", "causality", "kind", "unit", "start"), ROWS, ids=[row[0] for row in ROWS])
def test_variable(description: Element, name: str, causality: str, kind: str, unit: str, start: str) -> None:
    node = scalars(description)[name]
    value = node[0]
    assert node.get("causality") == causality
    assert value.tag == kind
    assert node.get("variability") == {"parameter": "fixed"}.get(
        causality, "continuous" if kind == "Real" else "discrete"
    )
    assert len(node.get("description")) > 8
    assert value.get("unit", "-") == unit
    if kind == "String":
        assert value.get("start") == ""
    elif start == "?":
        assert float(value.get("start")) != 0.0
    else:
        assert float(value.get("start")) == pytest.approx(float(start), rel=1e-9, abs=1e-15)
    low, high = BOUNDS.get(name, (None, None))
    for bound, expected in (("min", low), ("max", high)):
        given = value.get(bound)
        assert (None if given is None else float(given)) == expected
        if given is not None:
            assert (float(value.get("start")) - float(given)) * (1 if bound == "min" else -1) >= 0.0
    display = {"rad": "deg", "rad/s": "rpm"}.get(unit)
    assert value.get("displayUnit") == display


def test_unit_definitions(description: Element) -> None:
    defined = {}
    displays = {}
    for node in description.find("UnitDefinitions"):
        base = node.find("BaseUnit").attrib
        assert set(base) <= {"kg", "m", "s", "rad"}, "factor and offset must stay at their defaults, 1 and 0"
        defined[node.get("name")] = tuple(int(base.get(name, 0)) for name in ("kg", "m", "s", "rad"))
        displays |= {(node.get("name"), d.get("name")): float(d.get("factor")) for d in node.findall("DisplayUnit")}
    assert defined == UNITS
    assert displays["rad", "deg"] == pytest.approx(57.29577951308232, rel=1e-15)
    assert displays["rad/s", "rpm"] == pytest.approx(9.549296585513721, rel=1e-15)
    assert displays["m", "mm"] == 1000.0


def unknowns(description: Element, part: str) -> dict[str, set[str] | None]:
    """Names an unknown depends on; None where all are meant."""
    names = list(scalars(description))
    found = {}
    for node in description.find("ModelStructure").find(part):
        listed = node.get("dependencies")
        found[names[int(node.get("index")) - 1]] = (
            None if listed is None else {names[int(i) - 1] for i in listed.split()}
        )
    return found


def test_output_dependencies(description: Element) -> None:
    outputs = [row[0] for row in ROWS if row[1] == "output"]
    assert unknowns(description, "Outputs") == {name: DEPENDENCIES.get(name, INPUTS) for name in outputs}


def test_initial_unknowns_are_all_outputs(description: Element) -> None:
    initial = unknowns(description, "InitialUnknowns")
    assert list(initial) == [row[0] for row in ROWS if row[1] == "output"]
    assert initial["crank.acceleration"] is None
    assert initial["solver.message"] == set()
    assert "initial.crank_angle" in initial["crank.angle"]
    assert "crank.mass" not in initial["crank.angle"]


def test_experiment_and_capabilities(description: Element) -> None:
    experiment = {name: float(value) for name, value in description.find("DefaultExperiment").attrib.items()}
    assert experiment == {"startTime": 0.0, "stopTime": pytest.approx(3 / 7), "stepSize": 1e-3, "tolerance": 1e-9}
    flags = dict(description.find("CoSimulation").attrib)
    assert flags.pop("modelIdentifier") == "FiveBarSlider"
    assert {name for name, value in flags.items() if value == "true"} == {
        "canHandleVariableCommunicationStepSize",
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
        "canNotUseMemoryManagementFunctions",
    }
    assert flags["needsExecutionTool"] == "false"


def test_who_made_it(description: Element) -> None:
    assert description.get("fmiVersion") == "2.0"
    assert description.get("modelName") == "FiveBarSlider"
    assert description.get("author") == "The Linkwork developers"
    assert description.get("license") == "MIT"
    assert description.get("version") == linkwork.__version__
    assert "The Linkwork developers" in description.get("copyright")
    assert "slider" in description.get("description")
    assert description.get("variableNamingConvention") == "structured"
