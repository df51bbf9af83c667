"""The model description is the contract, variable by variable, and says what masters need to know."""

import shutil
import subprocess
from collections.abc import Iterator
from io import BytesIO
from math import pi
from pathlib import Path
from xml.etree.ElementTree import Element

import fmpy
import matplotlib.image as mpimg
import pytest
from fmpy.model_description import read_build_description, read_model_description
from fmpy.validation import validate_fmu
from lxml import etree

import linkwork
from analysis.export import description as writer
from analysis.mechanisms import FIVE_BAR, MECHANISMS, SLIDER_CRANK
from build_fmu import FMUS
from linkwork.mechanism import Mechanism

from ..mechanisms import pendulum, rotor_on_cart
from .conftest import model_description
from .described import Scalar, read_scalars, read_unknowns, root_of
from .models import MODELS, Model, each

KINDS = writer.KINDS
#: Those that the tests have of their own, as well.
EVERY = {m.fmu: m for m in (*MECHANISMS.values(), pendulum.MECHANISM, rotor_on_cart.MECHANISM)}

#: The contracts, variable by variable: name, causality, type, unit, start.
ROWS = {
    model: [
        tuple(line.split())
        for line in (Path(__file__).parent / "contracts" / f"{model}.txt").read_text(encoding="utf-8").splitlines()
        if not line.startswith("#")
    ]
    for model in MODELS
}

#: What native FMUs have beside them.
ADDED = ("time", "power.dissipated", "power.supplied", "assembly.margin_to_limit")

#: Exponents of kg, m, s and rad; the other base units of SI do not occur.
UNITS = {
    "1": (0, 0, 0, 0), "m": (0, 1, 0, 0), "m/s": (0, 1, -1, 0), "m/s2": (0, 1, -2, 0), "rad": (0, 0, 0, 1),
    "rad/s": (0, 0, -1, 1), "rad/s2": (0, 0, -2, 1), "kg": (1, 0, 0, 0), "kg.m2": (1, 2, 0, 0), "N": (1, 1, -2, 0),
    "N.m": (1, 2, -2, 0), "N/m": (1, 0, -2, 0), "N.s/m": (1, 0, -1, 0), "J": (1, 2, -2, 0), "s": (0, 0, 1, 0),
    "W": (1, 2, -3, 0),
}  # fmt: skip

#: Bounds of what every model has, and of what one has.
COMMON_BOUNDS = {
    **{f"{link}.length": (0.0, None) for link in ("ground", "crank", "coupler", "rocker", "rod")},
    "slider.coulomb_friction": (0.0, None),
    "assembly.branch": (-1.0, 1.0),
    "drive.mode": (0.0, 1.0),
    "solver.tolerance": (1e-13, 1e-2),
    "energy.kinetic": (0.0, None),
    "closure.residual": (0.0, None),
    "solver.status": (0.0, 9.0),
}
BOUNDS = {
    "FiveBarSlider": {
        "gravity": (0.0, None),
        "slider.friction_coefficient": (0.0, None),
        **{f"pin.{pin}_friction_radius": (0.0, None) for pin in "ABCD"},
        "coupler.angle": (-2.0 * pi, 2.0 * pi),
        "rocker.angle": (-2.0 * pi, 2.0 * pi),
        "transmission.angle": (0.0, pi),
    },
    "SliderCrank": {"axial.mode": (0.0, 2.0), "transmission.angle": (0.0, pi / 2)},
}
#: Of these units no parameter may be negative, products of inertia apart.
NOT_NEGATIVE = ("kg", "kg.m2", "N/m", "N.s/m")

INPUTS = {model: {name for name, causality, *_ in rows if causality == "input"} for model, rows in ROWS.items()}


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    """Each kind of FMU in turn."""
    return request.param


@pytest.fixture(scope="module")
def roots(fmus: dict[str, Path]) -> dict[tuple[str, str], Element]:
    """Model descriptions by model and kind: that inside the Python FMU, and what the writer makes for the native ones."""
    return {
        (model, kind): model_description(fmus[model])
        if kind == "python"
        else root_of(writer.description(FMUS[model], KINDS[kind], ["all.c"]))
        for model in MODELS
        for kind in KINDS
    }


@pytest.fixture
def description(roots: dict[tuple[str, str], Element], model: Model, kind: str) -> Element:
    """Root of the model description of a model as a kind of FMU."""
    return roots[model.name, kind]


def scalars(description: Element) -> dict[str, Scalar]:
    """The variables by name."""
    return {scalar.name: scalar for scalar in read_scalars(description)}


def test_validator_finds_nothing(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []


def written(mechanism: Mechanism, kind: str, folder: Path) -> Path:
    """All descriptions of an FMU in ``folder``, as in an unpacked archive."""
    xml = {"modelDescription.xml": writer.description(mechanism, KINDS[kind], ["all.c"])}
    if KINDS[kind].fmi == 3:
        identifier = KINDS[kind].identifier(mechanism)
        xml["sources/buildDescription.xml"] = writer.build_description(identifier, ["all.c", "equations.c"])
        xml["terminalsAndIcons/terminalsAndIcons.xml"] = writer.terminals(mechanism)
    for name, text in xml.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(text)
    return folder


@pytest.mark.parametrize("mechanism", EVERY.values(), ids=list(EVERY))
def test_validator_finds_nothing_in_what_is_written(mechanism: Mechanism, kind: str, tmp_path: Path) -> None:
    assert validate_fmu(str(written(mechanism, kind, tmp_path))) == []
    read = read_model_description(tmp_path)
    assert len(read.derivatives) == (0 if kind == "python" else mechanism.size)
    assert read.numberOfContinuousStates == len(read.derivatives)


@pytest.mark.skipif(
    not (shutil.which("VDMCheck2.sh") and shutil.which("VDMCheck3.sh")),
    reason="VDMCheck (INTO-CPS-Association/FMI-VDM-Model on GitHub) is not on the path",
)
@pytest.mark.parametrize("mechanism", EVERY.values(), ids=list(EVERY))
def test_vdmcheck_finds_nothing(mechanism: Mechanism, kind: str, tmp_path: Path) -> None:
    """A formal model of the static rules of FMI, which knows more of them than FMPy."""
    fmu = shutil.make_archive(str(tmp_path / "fmu"), "zip", written(mechanism, kind, tmp_path / "unpacked"))
    path = Path(fmu).rename(tmp_path / KINDS[kind].file_name(mechanism))
    done = subprocess.run([f"VDMCheck{KINDS[kind].fmi}.sh", path], capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode) == ("No errors found.\n", 0)


def test_what_is_written_is_the_same_each_time(
    model: Model, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    assert b"generationDateAndTime" not in writer.description(FMUS[model.name], KINDS[kind])
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    first, second = (writer.description(FMUS[model.name], KINDS[kind]) for _ in range(2))
    assert first == second
    assert b'generationDateAndTime="2023-11-14T22:13:20Z"' in first


def test_variables_are_those_of_the_contract_in_its_order(description: Element, model: Model, kind: str) -> None:
    added = () if kind == "python" else ADDED
    found = scalars(description)
    assert list(found) == [*(row[0] for row in ROWS[model.name]), *added]
    assert [scalar.reference for scalar in found.values()] == list(range(len(found)))


@each(
    {model: {row[0]: row for row in rows} for model, rows in ROWS.items()},
    "name",
    "causality",
    "type_name",
    "unit",
    "start",
)
def test_variable(
    description: Element, model: Model, kind: str, name: str, causality: str, type_name: str, unit: str, start: str
) -> None:
    scalar = scalars(description)[name]
    value = scalar.attributes
    assert value["causality"] == causality
    assert scalar.kind == type_name
    tunable = name.endswith(("stiffness", "damping", "friction", "friction_coefficient", "friction_radius"))
    kinds = {"parameter": "tunable" if tunable else "fixed"}
    assert value["variability"] == kinds.get(causality, "continuous" if type_name == "Real" else "discrete")
    assert value.get("initial") == {"parameter": "exact", "output": "approx", "local": "calculated"}.get(causality)
    assert len(value["description"]) > 8
    assert value.get("unit", "-") == unit
    if start == "-":
        assert "start" not in value
    elif start == "?":
        assert float(value["start"]) != 0.0
    else:
        # forces are sums of greater ones, to whose rounding they are zero
        zero = 1e-13 if unit == "N" else 1e-15
        assert float(value["start"]) == pytest.approx(float(start), rel=1e-9, abs=zero)
    signed = causality != "parameter" or "product" in name or unit not in NOT_NEGATIVE
    low, high = (COMMON_BOUNDS | BOUNDS[model.name]).get(name, (None if signed else 0.0, None))
    for bound, expected in (("min", low), ("max", high)):
        given = value.get(bound)
        assert (None if given is None else float(given)) == expected
        if given is not None and start != "-":
            assert (float(value["start"]) - float(given)) * (1 if bound == "min" else -1) >= 0.0
    # shafts turn in rpm; the rod's angular velocity is a vector in space
    display = None if name.startswith("rod.w") else {"rad": "deg", "rad/s": "rpm"}.get(unit)
    assert value.get("displayUnit") == display


def test_unit_definitions(description: Element, model: Model, kind: str) -> None:
    defined = {}
    displays = {}
    for node in description.find("UnitDefinitions"):
        base = node.find("BaseUnit").attrib
        assert set(base) <= {"kg", "m", "s", "rad"}, "factor and offset must stay at their defaults, 1 and 0"
        defined[node.get("name")] = tuple(int(base.get(name, 0)) for name in ("kg", "m", "s", "rad"))
        displays |= {(node.get("name"), d.get("name")): float(d.get("factor")) for d in node.findall("DisplayUnit")}
    # those that its variables use, and no others
    added = set() if kind == "python" else {"s", "W"}
    assert defined == {unit: UNITS[unit] for unit in {row[3] for row in ROWS[model.name]} - {"-"} | added}
    assert displays["rad", "deg"] == pytest.approx(57.29577951308232, rel=1e-15)
    assert displays["rad/s", "rpm"] == pytest.approx(9.549296585513721, rel=1e-15)
    assert displays["m", "mm"] == 1000.0


#: The states that are no outputs, and the derivatives.
DERIVATIVES = {
    "FiveBarSlider": ["crank.speed", "slider.velocity", "crank.acceleration", "slider.acceleration"],
    "SliderCrank": ["crank.speed", "shift.velocity", "crank.acceleration", "shift.acceleration"],
}


def test_derivatives_of_the_state_are_those_of_native_fmus(description: Element, model: Model, kind: str) -> None:
    expected = [] if kind == "python" else [*DERIVATIVES[model.name], "power.dissipated", "power.supplied"]
    assert list(read_unknowns(description, "ContinuousStateDerivative")) == expected
    number = {s.name: s.reference + (KINDS[kind].fmi == 2) for s in read_scalars(description)}
    derivative = {s.name: s.attributes.get("derivative") for s in read_scalars(description)}
    pairs = {"crank.speed": "crank.angle", "power.supplied": "energy.supplied"}
    for name, of in pairs.items():
        assert derivative.get(name) == (None if kind == "python" else str(number[of]))
    # and no others: there are masters that take every derivative for one of a state
    assert {name for name, of in derivative.items() if of is not None} == set(expected)


def test_event_indicator(description: Element, kind: str) -> None:
    listed = read_unknowns(description, "EventIndicator")
    assert list(listed) == (["assembly.margin_to_limit"] if kind == "native-fmi3" else [])
    assert description.get("numberOfEventIndicators") == ("1" if kind == "native" else None)


def test_initial_unknowns_are_all_outputs_and_derivatives(description: Element, model: Model, kind: str) -> None:
    initial = read_unknowns(description, "InitialUnknown")
    powers = [] if kind == "python" else ["power.dissipated", "power.supplied"]
    assert list(initial) == [*(row[0] for row in ROWS[model.name] if row[1] == "output"), *powers]
    assert initial["crank.acceleration"] is None
    assert "initial.crank_angle" in initial["crank.angle"]
    assert "crank.mass" not in initial["crank.angle"]


#: Stop time and step of the default experiment: three turns at 420 rpm, two at 50 rpm.
EXPERIMENTS = {"FiveBarSlider": (3 / 7, 1e-3), "SliderCrank": (2 * 60 / 50, 5e-3)}
_STATE_2 = {"canGetAndSetFMUstate", "canSerializeFMUstate"}
_STATE_3 = {
    *("canGetAndSetFMUState", "canSerializeFMUState"),
    *("providesDirectionalDerivatives", "providesAdjointDerivatives"),
}
#: Of each kind, what each interface can do.
CAPABILITIES = {
    "python": {
        "CoSimulation": _STATE_2 | {"canHandleVariableCommunicationStepSize", "canNotUseMemoryManagementFunctions"}
    },
    "native": {
        "ModelExchange": _STATE_2 | {"providesDirectionalDerivative", "completedIntegratorStepNotNeeded"},
        "CoSimulation": _STATE_2
        | {"providesDirectionalDerivative", "canHandleVariableCommunicationStepSize", "canInterpolateInputs"},
    },
    "native-fmi3": {
        "ModelExchange": _STATE_3,
        "CoSimulation": _STATE_3
        | {"canHandleVariableCommunicationStepSize", "providesIntermediateUpdate"}
        | {"mightReturnEarlyFromDoStep", "canReturnEarlyAfterIntermediateUpdate"},
    },
}
SUFFIXES = {"python": "", "native": "_native", "native-fmi3": "_native_fmi3"}


def test_experiment_and_capabilities(description: Element, model: Model, kind: str) -> None:
    experiment = {name: float(value) for name, value in description.find("DefaultExperiment").attrib.items()}
    stop, step = EXPERIMENTS[model.name]
    assert experiment == {"startTime": 0.0, "stopTime": pytest.approx(stop), "stepSize": step, "tolerance": 1e-9}
    interfaces = {node.tag: node for node in description if node.get("modelIdentifier")}
    assert list(interfaces) == list(CAPABILITIES[kind])
    for name, node in interfaces.items():
        flags = dict(node.attrib)
        assert flags.pop("modelIdentifier") == model.name + SUFFIXES[kind]
        assert {flag for flag, value in flags.items() if value == "true"} == CAPABILITIES[kind][name]
        assert flags["needsExecutionTool"] == flags["canBeInstantiatedOnlyOncePerProcess"] == "false"
        native_steps = name == "CoSimulation" and kind != "python"
        assert flags.get("maxOutputDerivativeOrder") == ("1" if native_steps else None)
        assert [file.get("name") for file in node.iter("File")] == (["all.c"] if kind == "native" else [])


def test_who_made_it(description: Element, model: Model, kind: str) -> None:
    assert description.get("fmiVersion") == ("3.0" if kind == "native-fmi3" else "2.0")
    assert description.get("modelName") == model.name
    assert description.get("author") == "The Linkwork developers"
    assert description.get("license") == "MIT"
    assert description.get("version") == linkwork.__version__
    assert "The Linkwork developers" in description.get("copyright")
    assert "slider" in description.get("description")
    assert description.get("variableNamingConvention") == "structured"
    assert description.get("generationTool").split()[0] == ("PythonFMU" if kind == "python" else "Linkwork")


def test_names_and_tokens_of_all_kinds_differ(roots: dict[tuple[str, str], Element]) -> None:
    tokens = {root.get("guid") or root.get("instantiationToken") for root in roots.values()}
    assert len(tokens - {None}) == len(roots)
    assert [kind.file_name(FIVE_BAR) for kind in KINDS.values()] == [
        "FiveBarSlider.fmu",
        "FiveBarSlider-native.fmu",
        "FiveBarSlider-native-fmi3.fmu",
    ]


def test_inputs_and_what_is_computed_take_part_in_intermediate_updates(
    roots: dict[tuple[str, str], Element], model: Model
) -> None:
    found = read_scalars(roots[model.name, "native-fmi3"])
    own = [row[0] for row in ROWS[model.name] if row[1] in ("input", "output")]
    names = [s.name for s in found if s.attributes.get("intermediateUpdate") == "true"]
    assert names == [*own, *ADDED[1:]]


CRANK = {
    **{name: f"crank.{name}" for name in ("angle", "speed", "acceleration")},
    **{"torque": "drive.torque", "applied_torque": "drive.applied_torque"},
    **{f"commanded_{name}": f"drive.{name}" for name in ("speed", "acceleration")},
}
MOTION = ("position", "velocity", "acceleration")
#: Members of the terminals of each mechanism.
TERMINALS = {
    "FiveBarSlider": {
        "crank": CRANK,
        "slider": {**{name: f"slider.{name}" for name in MOTION}, "force": "slider.force"},
        "load": {
            **{f"f{axis}": f"load.f{axis}" for axis in "xy"},
            **{axis: f"coupler.point.{axis}" for axis in "xy"},
            "angle": "coupler.angle",
        },
    },
    "SliderCrank": {
        "crank": CRANK,
        "shift": {
            **{name: f"shift.{name}" for name in MOTION},
            **{"force": "axial.force", "applied_force": "axial.applied_force"},
            **{f"commanded_{name}": f"axial.{name}" for name in ("speed", "acceleration")},
        },
        "slider": {**{name: f"slider.{name}" for name in MOTION}, "load": "slider.load"},
    },
}


def members(xml: bytes) -> Iterator[tuple[str, str, str]]:
    for terminal in root_of(xml).find("Terminals"):
        for member in terminal.findall("TerminalMemberVariable"):
            yield terminal.get("name"), member.get("memberName"), member.get("variableName")


def test_terminals_gather_what_is_connected_together(model: Model) -> None:
    found: dict[str, dict[str, str]] = {}
    for terminal, member, variable in members(writer.terminals(FMUS[model.name])):
        found.setdefault(terminal, {})[member] = variable
    assert found == TERMINALS[model.name]


#: The schema of each further file of FMI 3.0.
SCHEMAS = {
    "terminalsAndIcons/terminalsAndIcons.xml": "fmi3TerminalsAndIcons.xsd",
    "sources/buildDescription.xml": "fmi3BuildDescription.xsd",
}


@pytest.mark.parametrize("name", SCHEMAS)
@pytest.mark.parametrize("mechanism", EVERY.values(), ids=list(EVERY))
def test_further_files_of_fmi_3_follow_their_schemas(mechanism: Mechanism, name: str, tmp_path: Path) -> None:
    folder = written(mechanism, "native-fmi3", tmp_path)
    schema = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema" / "fmi3" / SCHEMAS[name]))
    schema.assertValid(etree.parse(str(folder / name)))
    variables = set(scalars(root_of((folder / "modelDescription.xml").read_bytes())))
    for _, _, variable in members(writer.terminals(mechanism)):
        assert variable in variables


def test_terminals_have_kinds_flows_and_icons(model: Model) -> None:
    files = writer.terminal_files(FMUS[model.name])
    listed = root_of(files["terminalsAndIcons/terminalsAndIcons.xml"]).find("Terminals")
    kinds = {terminal.get("name"): terminal.get("terminalKind").rpartition(".")[2] for terminal in listed}
    assert (
        kinds
        == {
            "FiveBarSlider": {"crank": "rotational", "slider": "translational", "load": "planar"},
            "SliderCrank": {"crank": "rotational", "shift": "translational", "slider": "translational"},
        }[model.name]
    )
    inflow = {m.get("variableName") for m in listed.iter("TerminalMemberVariable") if m.get("variableKind") == "inflow"}
    assert inflow == {c.name for c in FMUS[model.name].channels if c.kind == "force"}
    for terminal in listed:
        icon = files[f"terminalsAndIcons/{terminal.find('TerminalGraphicalRepresentation').get('iconBaseName')}.png"]
        assert len(mpimg.imread(BytesIO(icon), "png")) == 32


def test_build_description(tmp_path: Path) -> None:
    written(SLIDER_CRANK, "native-fmi3", tmp_path)
    (configuration,) = read_build_description(tmp_path)
    assert configuration.modelIdentifier == "SliderCrank_native_fmi3"
    (files,) = configuration.sourceFileSets
    assert (files.language, files.sourceFiles) == ("C11", ["all.c", "equations.c"])
