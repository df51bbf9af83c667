"""The experiments that every FMU carries, and running those of any FMU."""

from collections.abc import Callable, Mapping
from math import cos, sqrt
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest

from analysis.cli import CHECK_FAILED
from analysis.export.experiments import experiments
from analysis.linkages import linkage
from analysis.mechanisms import MECHANISMS
from analysis.run import EXPERIMENTS, MANIFEST, ExperimentError, verify
from linkwork.mechanism import Mechanism
from tests.mechanisms import pendulum
from tests.scripts import linkwork

from .models import MODELS, Changes, Model
from .runner import run_in_process

ROOT = Path(__file__).parents[2]
OF_MODEL = {mechanism.fmu: mechanism for mechanism in MECHANISMS.values()}


def changed(fmu: Path, target: Path, files: Mapping[str, str | None]) -> Path:
    """Copy an FMU with other files in the folder of its experiments; None leaves a file out."""
    placed = {f"{EXPERIMENTS}/{name}": text for name, text in files.items()}
    with ZipFile(fmu) as source, ZipFile(target, "w") as archive:
        for name in source.namelist():
            if name not in placed:
                archive.writestr(name, source.read(name))
        for name, text in placed.items():
            if text is not None:
                archive.writestr(name, text)
    return target


def verified(root: str, fmu: str) -> list[Any]:
    """What becomes of the experiments of an FMU."""
    import sys

    sys.path.insert(0, root)
    from analysis.run import verify

    return [
        [o.experiment, o.passed, o.message, [[d.name, d.time, d.value, d.reference, d.relative] for d in o.deviations]]
        for o in verify(fmu)
    ]


def test_every_native_fmu_passes_its_own_experiments(natives: dict[str, Path]) -> None:
    for name, fmu in natives.items():
        outcomes = list(verify(fmu))
        mechanism = OF_MODEL.get(name.partition("-")[0])
        # those of the tests have no cases of their own
        assert [o.experiment for o in outcomes] == (["default"] if mechanism is None else list(mechanism.cases))
        for outcome in outcomes:
            assert outcome.passed, (name, outcome)
            assert outcome.allowed == 1e-6
            outputs = {d.name for d in outcome.deviations}
            assert mechanism is None or outputs == {n for n in mechanism.output_names if not n.endswith(".residual")}
        with ZipFile(fmu) as archive:
            files = [i for i in archive.infolist() if i.filename.startswith(EXPERIMENTS)]
            rows = [archive.read(i).count(b"\n") for i in files if i.filename.endswith("default-in.csv")]
        assert sum(file.compress_size for file in files) < 50_000
        # inputs that do not change stand at the start and at the end alone, below their names
        assert rows == ([3] if mechanism is None else [])


def test_an_experiment_of_many_steps_or_of_a_sensitive_motion_is_shortened(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that a description with friction waits seconds for its FMU, 39 halvings at most, and that its FMU passes it."""

    def end(mechanism: Mechanism, longest: float) -> float:
        monkeypatch.setattr("analysis.export.experiments.LONGEST", longest)
        files = experiments.__wrapped__(mechanism)
        root = ElementTree.fromstring(next(text for name, text in files.items() if name.endswith(".exp")))
        return float(next(node.get("stopTime") for node in root.iter("TransientSimulation")))

    whole = pendulum.MECHANISM.experiment[1]
    assert end(pendulum.MECHANISM, 1e6) == whole
    assert end(pendulum.MECHANISM, 60.0) == whole * 0.5**39
    # an arm that falls on a stop: at the tolerance of the experiment 3e-5 from the reference after 0.7 s
    arm = linkage("falls", ground={"A": (0, 0)}, gravity=9.81).body("arm", bar=("A", "B"), length=0.3, mass=1.0)
    arm.spring("rub", at="A", friction=0.5, stiffness=1.0, free=0.0).spring("stop", at="A", law="-2e6*max(-x, 0)")
    assert 0.0 < end(arm.freedom("arm", "A", start=0.5, driven=False).mechanism(), 1e6) < 0.7


def test_an_experiment_of_a_microscopic_linkage_is_short() -> None:
    built = linkage("flexure", ground={"A": (0, 0)}).body("arm", bar=("A", "B"), length="40 um", mass="1 ng")
    built.spring("hinge", at="A", stiffness=4e-10, free=0.1).freedom("arm", "A", driven=False)
    files = experiments(built.mechanism())
    reference = next(text for name, text in files.items() if name.endswith("default-ref.csv")).decode().splitlines()
    last = dict(zip(reference[0].replace('"', "").split(","), map(float, reference[-1].split(","))))
    rate = sqrt(4e-10 / (1e-12 * 20e-6**2))
    assert last["arm.angle"] == pytest.approx(0.1 * (1.0 - cos(rate * last["time"])), rel=1e-6)


def test_kept_references_are_made_again_if_any_source_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []

    def make(mechanism: Mechanism) -> dict[str, bytes]:
        made.append(mechanism.name)
        return {"a.csv": str(len(made)).encode()}

    source = tmp_path / "analysis" / "units.py"
    source.parent.mkdir()
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr("analysis.export.experiments._make_experiments", make)
    monkeypatch.setattr("analysis.export.experiments.__file__", str(source.parent / "export" / "experiments.py"))
    for text, content in (("INCH = 25.4e-3", b"1"), ("INCH = 25.4e-3", b"1"), ("INCH = 0.0254", b"2")):
        source.write_text(text, encoding="utf-8")
        assert experiments.__wrapped__(MECHANISMS["slider-crank"]) == {"a.csv": content}


@pytest.mark.slow
def test_a_wrong_equation_is_found(model: Model, fmu: Path, build_variant: Callable[[Changes], Path]) -> None:
    assert all(row[1] for row in run_in_process(verified, ROOT, fmu))
    found = run_in_process(verified, ROOT, build_variant(MODELS[model.name].equation))
    failed = [row for row in found if not row[1]]
    assert failed
    name, _, value, reference, relative = failed[0][3][0]
    assert relative > 1e-6
    assert value != reference
    assert name in OF_MODEL[model.name].output_names


def test_files_are_in_the_order_of_the_schema(natives: dict[str, Path]) -> None:
    with ZipFile(natives["SliderCrank-native"]) as archive:
        manifest = ElementTree.fromstring(archive.read(MANIFEST))
        related = manifest.find("Related")
        assert related is not None
        assert related.get("role") == "experiment/smoke-test"
        root = ElementTree.fromstring(archive.read(f"{EXPERIMENTS}/{related.get('source')}"))
        for experiment in root:
            tags = [child.tag for child in experiment]
            order = ["TransientSimulation", "Parameters", "Stimuli", "References", "Annotations"]
            assert tags == [tag for tag in order if tag in tags]
            assert set(experiment.attrib) <= {"name", "description", "tolerance"}
            sources = {child.get("source") for child in experiment if "source" in child.attrib}
            assert {f"{EXPERIMENTS}/{source}" for source in sources} <= set(archive.namelist())


#: An experiment as another tool writes it: times as the text of the standard has them, no tolerance, fewer rows and variables.
OTHER = """<e:Experiments xmlns:e="urn:other" name="others">
<e:Experiment name="coast" startTime="0.0" stopTime="0.1" stepSize="0.01">
<Parameters source="sub/set.ssv"/><References source="sub/a%20b.csv"/></e:Experiment></e:Experiments>"""
SSV = """<p:ParameterSet xmlns:p="urn:p"><p:Parameters><p:Parameter name="drive.mode"><p:Integer value="1"/></p:Parameter>
</p:Parameters></p:ParameterSet>"""
LISTED = '<fmiReferences><Related role="experiment" source="other.exp"/><Related role="model" source="m.mo"/></fmiReferences>'


def of_other_make(fmu: Path, target: Path, **files: str | None) -> Path:
    made = {"fmi-ls-manifest.xml": LISTED, "other.exp": OTHER, "sub/set.ssv": SSV}
    # at a constant speed of 20 rad/s the angle is 20 t: between the steps of the reference too
    return changed(fmu, target, made | {"sub/a b.csv": "time,crank.angle\n0,0\n0.035,0.7\n0.1,2.0\n"} | files)


def test_experiments_of_another_tool(natives: dict[str, Path], tmp_path: Path) -> None:
    ssv = SSV.replace("</p:Parameters>", "").replace("</p:ParameterSet>", "")
    ssv += '<p:Parameter name="drive.speed"><p:Float64 value="20"/></p:Parameter></p:Parameters></p:ParameterSet>'
    good = of_other_make(natives["FiveBarSlider-native"], tmp_path / "a.fmu", **{"sub/set.ssv": ssv})
    (outcome,) = verify(good)
    assert (outcome.experiment, outcome.allowed, outcome.passed) == ("coast", 1e-3, True)
    table = "time,crank.angle\n0,0\n0.05,1.1\n0.1,2.0\n"
    wrong = of_other_make(
        natives["FiveBarSlider-native"], tmp_path / "b.fmu", **{"sub/set.ssv": ssv, "sub/a b.csv": table}
    )
    (outcome,) = verify(wrong)
    (deviation,) = outcome.deviations
    assert not outcome.passed
    assert (deviation.name, deviation.time, deviation.reference) == ("crank.angle", 0.05, 1.1)
    assert deviation.value == pytest.approx(1.0)
    assert deviation.relative == pytest.approx(0.05)
    assert next(verify(wrong, allowed=0.06)).passed


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"fmi-ls-manifest.xml": None}, "no experiments"),
        ({"fmi-ls-manifest.xml": "<fmiReferences/>"}, "names none"),
        ({"fmi-ls-manifest.xml": "<fmiReferences>"}, "not XML"),
        ({"other.exp": OTHER.replace("sub/set", "../../../set")}, "inside the FMU"),
        ({"other.exp": OTHER.replace('"sub/set.ssv"', '"https://a.example/set.ssv"')}, "inside the FMU"),
        ({"other.exp": OTHER.replace("<Param", "<SteadyState/><Param")}, "SteadyState"),
        ({"other.exp": OTHER.replace('"0.1"', '"soon"')}, "'soon'"),
        ({"sub/set.ssv": SSV.replace(' value="1"', "")}, "set.ssv"),
        ({"sub/a b.csv": "time,crank.angle\n0,nan\n"}, "'nan'"),
        ({"sub/a b.csv": "time,crank.angle\n0\n"}, "a b.csv"),
        ({"sub/a b.csv": f"time,crank.angle\n0,{'1' * 200_000}\n"}, "cannot be read: field larger"),
        ({"sub/a b.csv": "time,crank.angle\n1,0\n0,0\n"}, "increase"),
    ],
)  # fmt: skip
def test_experiments_that_cannot_be_read(
    natives: dict[str, Path], tmp_path: Path, files: dict[str, str | None], said: str
) -> None:
    with pytest.raises(ExperimentError, match=said):
        list(verify(of_other_make(natives["FiveBarSlider-native"], tmp_path / "a.fmu", **files)))


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"sub/a b.csv": "time,no.such\n0,0\n"}, "no.such"),
        ({"sub/a b.csv": "time,crank.angle\n0,0\n0.2,0\n"}, "ended early"),
        ({"sub/set.ssv": SSV.replace("drive.mode", "no.such")}, "no.such"),
    ],
)
def test_an_experiment_that_cannot_be_run_fails(
    natives: dict[str, Path], tmp_path: Path, files: dict[str, str], said: str
) -> None:
    fmu = of_other_make(natives["FiveBarSlider-native"], tmp_path / "a.fmu", **files)
    result = linkwork("verify", fmu, code=CHECK_FAILED)
    assert said in result.stderr


def test_an_experiment_without_reference_is_told(natives: dict[str, Path], tmp_path: Path) -> None:
    bare = OTHER.replace('<References source="sub/a%20b.csv"/>', "")
    twice = bare.replace("</e:Experiments>", bare.partition("<e:Experiment ")[1] + bare.partition("<e:Experiment ")[2])
    fmu = of_other_make(natives["FiveBarSlider-native"], tmp_path / "a.fmu", **{"other.exp": twice})
    result = linkwork("verify", fmu)
    assert "2 of 2 experiments pass" in result.stdout
    assert "note: without reference results, so that nothing was compared: coast, coast" in result.stderr


def test_the_command(natives: dict[str, Path]) -> None:
    result = linkwork("verify", natives["SliderCrank-native-fmi3"])
    assert "7 of 7 experiments pass" in result.output
    # no number is broken over two lines
    lines = linkwork("verify", natives["FiveBarSlider-native"]).output.splitlines()
    assert sum(line.startswith("│") for line in lines) == 12
    linkwork("verify --tolerance 1e-15", natives["SliderCrank-native-fmi3"], code=CHECK_FAILED)
