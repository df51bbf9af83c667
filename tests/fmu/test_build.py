"""Building: what is in the archive, which GUID it bears, and how a failure is reported."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

import build_fmu
from analysis.export import PLATFORMS, BuildError, build, build_all, compile_library, native_fmu
from build_fmu import FMUS

from .conftest import changed_sources, model_description
from .models import MODELS, Changes, Model, each

Build = Callable[[Changes], Path]


def guid(fmu: Path) -> str:
    return model_description(fmu).get("guid")


#: Some of the variables that the page inside has to list.
LISTED = {
    "FiveBarSlider": ("slider.coulomb_friction", "drive.applied_torque", "solver.message"),
    "SliderCrank": ("groove.amplitude", "axial.applied_force", "solver.message"),
}


def test_archive(fmu: Path, model: Model) -> None:
    with ZipFile(fmu) as archive:
        assert archive.testzip() is None
        assert {entry.compress_type for entry in archive.infolist()} == {ZIP_DEFLATED}
        names = archive.namelist()
        assert names[0] == "modelDescription.xml"
        page = archive.read("documentation/index.html").decode("utf-8")
        assert archive.read("model.png").startswith(b"\x89PNG\r\n\x1a\n")
        assert "MIT License" in archive.read("documentation/licenses/license.txt").decode("utf-8")
    for variable in LISTED[model.name]:
        assert f"<td>{variable}</td>" in page
    assert {f"binaries/linux64/{model.name}.so", f"binaries/win64/{model.name}.dll"} <= set(names)
    others = [other.plant for other in MODELS.values() if other != model]
    assert not [name for name in names if name.endswith(".pyc") or any(other in name for other in others)]


def test_what_the_binaries_need_is_what_the_documentation_says(fmu: Path, model: Model) -> None:
    with ZipFile(fmu) as archive:
        linux = archive.read("binaries/linux64/libpythonfmu-export.so")
        windows = archive.read("binaries/win64/pythonfmu-export.dll")
        guards = [
            archive.read(f"binaries/{place}") for place in (f"linux64/{model.name}.so", f"win64/{model.name}.dll")
        ]
    page = (Path(__file__).parents[2] / "docs" / "fmu.md").read_text(encoding="utf-8")
    # the names of symbols' versions and of libraries stand in the files as text
    newest = max(int(minor) for minor in re.findall(rb"\0GLIBC_2\.(\d+)", linux))
    assert f"glibc 2.{newest} and" in page
    newest = max(int(minor) for minor in re.findall(rb"\0GLIBCXX_3\.4\.(\d+)", linux))
    assert f"`GLIBCXX_3.4.{newest}`" in page
    # that of the stable ABI, which has no number of a minor version
    assert {b"python3.dll", b"MSVCP140.dll"} <= set(re.findall(rb"\w+\.dll", windows))
    assert not re.search(rb"python3\d+\.dll", windows)
    assert re.findall(rb"libpython3[\w.]*", linux) == []
    # the guard needs less: the C library of RHEL 7, the system of Windows
    assert max(int(minor) for minor in re.findall(rb"\0GLIBC_2\.(\d+)", guards[0])) <= 17
    needed = set(re.findall(rb"[\w-]+\.dll", guards[1], re.IGNORECASE))
    assert needed == {b"guard.dll", b"KERNEL32.dll"}


def test_modules_inside_carry_the_hash_of_their_content(fmu: Path, model: Model, build_variant: Build) -> None:
    def modules(path: Path) -> set[str]:
        with ZipFile(path) as archive:
            tops = {Path(name).parts[1] for name in archive.namelist() if name.startswith("resources/")}
            return tops - {"pythonfmu", "slavemodule.txt", "guid.txt"}

    ours = modules(fmu)
    tags = {name.removesuffix(".py")[-8:] for name in ours}
    assert len(tags) == 1
    assert {name.removesuffix(".py")[:-9] for name in ours} == {"linkwork", "slave", model.slave}
    other = modules(build_variant({"linkwork/friction.py": ("FRICTION_SPEED = 1e-3", "FRICTION_SPEED = 2e-3")}))
    assert not ours & other


def test_two_builds_are_the_same_archive(tmp_path: Path, model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    first, second = (build(FMUS[model.name], tmp_path / name).read_bytes() for name in ("a", "b"))
    assert first == second


def changes_of(folder: str, text: str, other: str) -> dict[str, tuple[Changes, bool]]:
    """Return changes of a mechanism's sources by name, and whether each keeps the GUID, which follows the interface alone."""
    variables, shared, residual = f"linkwork/{folder}/variables.py", "linkwork/variables.py", '"closure.residual", "m"'
    return {
        "nothing": ({}, True),
        "constant": ({"linkwork/friction.py": ("FRICTION_SPEED = 1e-3", "FRICTION_SPEED = 2e-3")}, True),
        "docstring": ({f"linkwork/{folder}/dynamics.py": ('"""Compute the inertia', '"""Return the inertia')}, True),
        "description": ({variables: (text, other)}, True),
        "name": ({shared: (residual, '"closure.gap", "m"')}, False),
        "unit": ({shared: (residual, '"closure.residual", "1"')}, False),
    }


CHANGES = {
    "FiveBarSlider": changes_of("five_bar", '"Crank, A to B; greater than zero"', '"The crank, from A to B"'),
    "SliderCrank": changes_of("slider_crank", '"Rod, crank pin to slider pin', '"The rod, from pin to pin')
    | {
        "start": ({"linkwork/slider_crank/published.py": ("initial(3.5)", "initial(3.0)")}, False),
        # a mode more, or a wider bound, is another interface as well
        "bound": ({"linkwork/slider_crank/variables.py": ("        2,\n    ),", "        3,\n    ),")}, False),
    },
}


@each(CHANGES, "changes", "same")
def test_guid_changes_with_the_interface_and_only_then(
    fmu: Path, build_variant: Build, changes: Changes, same: bool
) -> None:
    assert (guid(build_variant(changes)) == guid(fmu)) is same


@pytest.mark.parametrize("missing", ["slave.py", "linkwork", "linkwork/{plant}", "linkwork/{plant}/dynamics.py"])
def test_incomplete_sources(tmp_path: Path, model: Model, missing: str) -> None:
    sources = changed_sources(tmp_path, {})
    path = sources / missing.format(plant=model.plant)
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    before = list(sys.path)
    with pytest.raises(BuildError, match=r"slave\.py|linkwork|dynamics"):
        build(FMUS[model.name], tmp_path / "build", sources)
    assert sys.path == before
    assert not (tmp_path / "build" / f"{model.name}.fmu").exists()


def test_a_model_needs_no_other(tmp_path: Path, model: Model) -> None:
    sources = changed_sources(tmp_path, {})
    for other in MODELS.values():
        if other != model:
            shutil.rmtree(sources / "linkwork" / other.plant)
    assert build(FMUS[model.name], tmp_path / "build", sources).is_file()


def test_failed_build_leaves_the_old_fmu(tmp_path: Path, fmu: Path, model: Model) -> None:
    dest = tmp_path / "build"
    dest.mkdir()
    shutil.copy2(fmu, dest)
    # a name that the naming convention does not allow: what is built would not be valid
    broken = changed_sources(tmp_path, {"linkwork/variables.py": ('"closure.residual"', '"closure residual"')})
    with pytest.raises(BuildError):
        build(FMUS[model.name], dest, broken)
    assert [path.name for path in dest.iterdir()] == [fmu.name]
    assert (dest / fmu.name).read_bytes() == fmu.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["FiveBarSlider"], 0, "FiveBarSlider.fmu: valid"),
        ([], 0, "SliderCrank.fmu: valid"),
        (["SixBar"], 1, "error: there is no model 'SixBar' (the names are FiveBarSlider, SliderCrank)\n"),
        (["--no-such-option"], 2, "error: no such option '--no-such-option' (see '"),
    ],
    ids=["one", "all", "unknown", "usage"],
)
def test_exit_codes(tmp_path: Path, arguments: list[str], code: int, message: str) -> None:
    command = [sys.executable, build_fmu.__file__, *arguments, "--dest", str(tmp_path), "--kinds", "python"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == code, done.stderr
    assert message in (done.stdout if code == 0 else done.stderr)
    built = {path.stem for path in tmp_path.glob("*.fmu")}
    assert built == (set() if code else set(arguments or MODELS))


def test_a_changed_file_of_the_compilers_cache_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The compiler is a stand-in that keeps one object, as Zig keeps the C library."""
    made: list[Path] = []

    def compiler(*_: Any, env: dict[str, str], **__: Any) -> subprocess.CompletedProcess[str]:
        kept = Path(env["ZIG_GLOBAL_CACHE_DIR"], "o", "1", "libc.o")
        if not kept.exists():
            kept.parent.mkdir(parents=True)
            kept.write_bytes(b"code")
            made.append(kept)
        assert not Path(env["ZIG_LOCAL_CACHE_DIR"]).is_relative_to(tmp_path / "cache")
        return subprocess.CompletedProcess([], 0)

    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(subprocess, "run", compiler)
    for content in (b"code", b"cofe", b"code"):
        compile_library(tmp_path, ["a.c"], "a.so", "a-machine")
        made[0].write_bytes(content)
    assert [path.read_bytes() for path in made] == [b"code"] * 2
    assert capsys.readouterr().err.count("all are compiled again") == 1


def test_a_library_is_compiled_again_if_a_source_an_option_the_command_or_its_kept_file_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The compiler is a stand-in that writes how often it was called."""
    calls = 0

    def compiler(*_: Any, cwd: Path, **__: Any) -> subprocess.CompletedProcess[str]:
        nonlocal calls
        calls += 1
        (cwd / "a.so").write_text(str(calls))
        return subprocess.CompletedProcess([], 0)

    def made(options: tuple[str, ...] = ("-O2",)) -> str:
        compile_library(tmp_path / "sources", ["a.c"], "a.so", "a-machine", options, kept=True)
        return (tmp_path / "sources" / "a.so").read_text()

    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(subprocess, "run", compiler)
    (tmp_path / "sources").mkdir()
    for name in ("a.c", "a.h"):
        (tmp_path / "sources" / name).write_text("int a;")
    assert [made(), made(), made(("-Os",)), made()] == ["1", "1", "2", "1"]
    (tmp_path / "sources" / "a.h").write_text("int b;")
    assert [made(), made()] == ["3", "3"]
    for path in (tmp_path / "cache" / "libraries").iterdir():
        path.write_bytes(path.read_bytes()[:-1] + b"x")
    assert [made(), made()] == ["4", "4"]
    # the command is written in the module
    changed = tmp_path / "native_fmu.py"
    changed.write_bytes(Path(native_fmu.__file__).read_bytes() + b"\n")
    monkeypatch.setattr(native_fmu, "__file__", str(changed))
    assert [made(), made()] == ["5", "5"]


@pytest.mark.long
def test_processes_that_compile_at_the_same_time_wait_for_each_other(tmp_path: Path) -> None:
    """What Zig compiles for itself is there for none of them; the hash of a file that is half written would not hold."""
    (tmp_path / "a.c").write_text('#include <stdio.h>\nint main(void) { puts("here"); return 0; }\n', encoding="utf-8")
    code = "import sys; from analysis.export import compile_library as c; c(sys.argv[1], ['a.c'], sys.argv[2], sys.argv[3])"
    target = PLATFORMS["x86_64-windows"].target
    variables = {**os.environ, "LINKWORK_CACHE_DIR": str(tmp_path / "cache")}

    def started(name: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", code, str(tmp_path), name, target]
        return subprocess.Popen(
            command, cwd=Path(build_fmu.__file__).parent, env=variables, stderr=subprocess.PIPE, text=True
        )

    processes = [started(f"{name}.exe") for name in "abc"]
    said = [process.communicate(timeout=500)[1] for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0], said
    assert sum("Zig compiles its own libraries" in text for text in said) == 1
    assert not any("all are compiled again" in text for text in said)


def test_what_is_named_twice_is_built_once(tmp_path: Path) -> None:
    """Two compilations into the same file at a time spoil it."""
    built = list(build_all(["FiveBarSlider"] * 2, tmp_path, ["native"] * 2, ["x86_64-linux"] * 2))
    assert [made.platforms for made in built] == [("x86_64-linux",)]
