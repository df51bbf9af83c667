"""What starting costs: the package, its figures and the command import nothing heavy before it is used."""

import subprocess
import sys
from pathlib import Path

import click
import pytest

import analysis
from analysis import cli, figures

HEAVY = ("numba", "matplotlib", "scipy", "casadi", "pint", "joblib", "fmpy", "control", "shapely")


@pytest.mark.parametrize(
    "start",
    [
        "import analysis",
        "import analysis.figures",
        "import analysis.server",
        "from analysis.cli import main; main(['--version'], standalone_mode=False)",
        "from analysis.cli import main; main(['--help'], standalone_mode=False)",
    ],
)
def test_nothing_heavy_is_imported_at_the_start(start: str) -> None:
    script = f"import sys; {start}; print(*(name for name in {HEAVY} if name in sys.modules), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    assert done.stderr.split() == []


@pytest.mark.parametrize("command", ["run --published table-3.1", "resonance --published rig-2-spring-c"])
def test_no_package_of_scipy_that_takes_long_is_imported_again(command: str, tmp_path: Path) -> None:
    """Numba imports SciPy's linear algebra when it compiles, but not to read what an earlier process has compiled.

    The search for motions makes its sequence of starts with SciPy's statistics, but only once on a machine.
    """
    words = [*command.split(), "--out", str(tmp_path), "--force"]
    script = f"import sys; from analysis.cli import main; main({words}, standalone_mode=False); print(*sys.modules)"
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=True)
    assert {"scipy", "numba", "matplotlib"} <= (found := set(done.stdout.splitlines()[-1].split()))
    assert found & {"scipy.linalg", "scipy.optimize", "scipy.stats"} == set()


@pytest.mark.parametrize("package", [analysis, figures])
def test_public_names_are_all_there(package) -> None:
    assert dir(package) == sorted(package.__all__) != []
    assert all(getattr(package, name) is not None for name in package.__all__)
    with pytest.raises(AttributeError):
        package.no_such_name  # noqa: B018


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_a_command_is_the_one_of_its_module(name: str) -> None:
    listed = cli.main.commands[name]
    with listed.make_context(name, ["--help"], resilient_parsing=True) as context:
        assert context.command.name == name
        assert not isinstance(context.command, cli.LazyCommand)
        assert context.command.help
    assert len(click.Context(cli.main).get_help().splitlines()) > len(cli.COMMANDS)
