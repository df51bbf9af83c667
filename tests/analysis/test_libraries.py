"""Dependencies: what the core alone can do, what is said where a library is missing, and that all imports are declared."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags

from analysis.libraries import MissingLibraryError, require
from tests.scripts import called

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Extras for the development, which users do not need.
DEVELOPMENT = {"masters", "docs", "bench", "continuation", "mutation", "dev", "all"}


def libraries(requirements: list[str]) -> set[str]:
    """Names of the modules of some requirements."""
    modules = {"pillow": "PIL", "cupy-cuda12x": "cupy"}
    names = {re.match(r"[\w-]+", requirement)[0] for requirement in requirements}
    return {modules.get(name, name.replace("-", "_")) for name in names} - {"linkwork"}


CORE = libraries(PROJECT["dependencies"])
EXTRAS = {name: libraries(r) for name, r in PROJECT["optional-dependencies"].items() if name not in DEVELOPMENT}


def imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module is not None:
            yield node.module.partition(".")[0]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "lazy":
            yield str(ast.literal_eval(node.args[0])).partition(".")[0]


def test_every_library_that_is_imported_is_declared_and_no_other() -> None:
    found = {name for folder in ("analysis", "fmu_src") for p in (ROOT / folder).rglob("*.py") for name in imported(p)}
    own = {"analysis", "linkwork", "slave"}
    # the first three run as programs, joblib imports dask, and Matplotlib writes animations by Pillow
    programs = {"ziglang", "nbconvert", "ipykernel"}
    assert found - sys.stdlib_module_names - own | programs | {"dask", "PIL"} == CORE.union(*EXTRAS.values())


def test_the_extra_all_has_the_others() -> None:
    (everything,) = PROJECT["optional-dependencies"]["all"]
    # of use with a graphics processor only
    assert set(re.findall(r"\w+", everything)) - {"linkwork"} == set(EXTRAS) - {"cuda"}


BLOCKED = """
import sys
for name in {blocked}:
    sys.modules[name] = None
"""
CORE_ALONE = """
from analysis import Inputs, cosimulate, figures, find_orbit, linearise, simulate
from analysis.cli import main
run = simulate("table-3.1", stop_time="20 ms")
figures.plot(run).savefig("run.png")
figures.plot(find_orbit("table-3.1")).savefig("orbit.png")
linearise("table-3.1", [0.0, 0.0, 0.0, 0.0])
for words in (
    ["run", "--published", "table-3.1", "--stop-time", "20 ms"],
    ["build", "FiveBarSlider", "--kinds", "python"],
    ["exact", {case!r}],
):
    try:
        main(words)
    except SystemExit as ended:
        assert not ended.code, words
cosimulate({fmu!r}, "table-3.1", stop_time="20 ms", step=1e-3)
"""


def run_without(missing: set[str], program: str, folder: Path) -> str:
    """What a program prints in a process in which some modules are missing."""
    return called(sys.executable, "-c", BLOCKED.format(blocked=missing) + program, cwd=folder)


def test_the_core_alone_builds_runs_checks_and_plots(fmu: Path, tmp_path: Path) -> None:
    program = CORE_ALONE.format(fmu=str(fmu), case=str(ROOT / "examples" / "five-poses.toml"))
    printed = run_without(set().union(*EXTRAS.values()), program, tmp_path)
    assert "FiveBarSlider.fmu: valid" in printed
    # without ezdxf a drawing is SVG only
    assert [path.name for path in (tmp_path / "out").glob("best.*")] == ["best.svg"]


#: What needs a library of an extra.
NEEDING = {
    "plotly": "from analysis.figures import to_html; to_html(None)",
    "control": "from analysis import linearise; linearise('table-3.1', [0.0, 0.0, 0.0, 0.0]).to_state_space()",
    "ezdxf": "from analysis.files import to_dxf; to_dxf(None)",
    "svgelements": "from analysis.files import read_points; open('a.svg', 'w').write('<svg/>'); read_points('a.svg')",
    "pandas": "from analysis import simulate; simulate('table-3.1', stop_time=0.01).to_dataframe()",
    "waitress": "import analysis.server",
    "anywidget": "import analysis.studio.widget",
    "wasmtime": "from analysis.export.component import component; component(b'')",
    "distributed": "from analysis.libraries import require; require('dask', 'distributed')",
    "pyssp-standard": "from analysis.systems.ssp import ssd; ssd.SSD",
}


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The errors of all that needs an extra, one a line, from a process in which the extras are missing."""
    program = (
        f"for code in {list(NEEDING.values())}:\n"
        "    try: exec(code)\n"
        "    except Exception as error: print(type(error).__name__, error)\n"
    )
    return run_without(set().union(*EXTRAS.values()) - {"dask"}, program, tmp_path_factory.mktemp("without"))


@pytest.mark.parametrize("library", NEEDING)
def test_a_missing_library_is_named_with_the_command_that_installs_it(said: str, library: str) -> None:
    assert re.search(rf"^MissingLibraryError .*pip install '{library}\b", said, re.MULTILINE), said


def test_the_sentence_names_bound_and_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = ["numpy>=1.26", "plotly>=5.24; extra == 'html'", "plotly>=5.24; extra == 'all'", "dask; extra == 'all'"]
    monkeypatch.setattr("analysis.libraries.requires", lambda name: lines)
    monkeypatch.setattr("analysis.libraries._requirements", require.__globals__["_requirements"].__wrapped__)
    error = MissingLibraryError("plotly")
    assert (error.requirement, error.extra, error.name) == ("plotly>=5.24", "html", "plotly")
    assert MissingLibraryError("numpy").extra == ""
    assert MissingLibraryError("unknown").requirement == "unknown"


def test_numba_is_bounded_as_kernels_are_linked_by_what_it_does_not_publish() -> None:
    (bound,) = (requirement for requirement in PROJECT["dependencies"] if requirement.startswith("numba"))
    assert re.fullmatch(r"numba>=0\.\d+,<0\.\d+", bound)
    # `numerics.linking` overrides these and reads those; where they are renamed it would compile twice without an error
    for kind, names in (
        (JITCodeLibrary, ("_optimize_final_module", "_finalize_final_module")),
        (Compiler, ("define_pipelines", "compile_extra")),
        (Flags, ("__eq__", "__hash__")),
    ):
        assert all(hasattr(kind, name) for name in names), kind
    assert hasattr(Flags(), "_values")


def _told(code: str, folder: Path, *paths: Path) -> str:
    """Return what a process that begins in a folder prints."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (folder, *paths)))},
    )  # fmt: skip
    return done.stdout + done.stderr


def test_linkwork_has_the_names_of_the_api_when_they_are_asked_for(tmp_path: Path) -> None:
    code = """if True:
        import sys, linkwork
        assert not hasattr(linkwork, "__wrapped__") and "analysis" not in sys.modules
        from linkwork import five_bar, simulate, slider_crank
        import analysis
        assert simulate is analysis.simulate and linkwork.periodic is analysis.periodic
        assert slider_crank is sys.modules["linkwork.slider_crank"] and not hasattr(linkwork, "simulat")
    """
    assert _told(code, tmp_path, ROOT / "fmu_src", ROOT) == ""


def test_an_analysis_of_the_users_own_is_named(tmp_path: Path) -> None:
    (tmp_path / "analysis.py").touch()
    said = _told("import linkwork; linkwork.simulate", tmp_path, ROOT / "fmu_src", ROOT)
    assert f"{tmp_path / 'analysis.py'} is imported in its place" in said


def test_inside_an_fmu_linkwork_has_no_names_of_the_api(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "fmu_src" / "linkwork", tmp_path / "linkwork_01234567")
    said = _told("import linkwork_01234567 as inside; inside.simulate", tmp_path, ROOT / "fmu_src", ROOT)
    assert "module 'linkwork_01234567' has no attribute 'simulate'" in said
