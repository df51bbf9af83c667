"""Mutation of one module or folder: does some test fail for every small change of the code?

    python -m tests.mutate fmu_src/linkwork/integrate.py analysis/files

Cosmic Ray changes one operator or number at a time in a copy of the tree, and runs the tests that `tool.mutation.tests` of
pyproject.toml names for the module or its folder. Printed are the share of mutants that a test killed, and the survivors.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tomli_w
from rich.console import Console
from rich.markup import escape

ROOT = Path(__file__).parents[1]
SETTINGS: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mutation"]


def tests_of(module: Path) -> str:
    """The tests of a module: those of its own entry in the settings, or of the nearest folder's that has one."""
    for place in (module, *module.parents):
        if (tests := SETTINGS["tests"].get(place.as_posix())) is not None:
            return str(tests)
    raise SystemExit(f"tool.mutation.tests of pyproject.toml names no tests for {module}")


def copied(folder: Path) -> Path:
    """The tree as git would have it, with what is not committed yet."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def mutate(tree: Path, module: Path) -> Iterator[tuple[bool, str]]:
    """Of each mutant whether a test killed it, and its difference from the code."""
    command = f'"{sys.executable}" -m pytest -q -x -p no:cacheprovider -m "not slow and not fmu" {tests_of(module)}'
    settings = {
        "module-path": module.as_posix(),
        "timeout": SETTINGS["timeout"],
        "excluded-modules": [],
        "test-command": command,
        "distributor": {"name": "local"},
        "filters": {"operators-filter": {"exclude-operators": SETTINGS["exclude-operators"]}},
    }
    (tree / "mutation.toml").write_text(tomli_w.dumps({"cosmic-ray": settings}), encoding="utf-8")
    session = tree / "mutation.sqlite"
    session.unlink(missing_ok=True)
    paths = os.pathsep.join([str(tree / "fmu_src"), str(tree)])
    options: dict[str, Any] = {"cwd": tree, "env": {**os.environ, "PYTHONPATH": paths}, "text": True, "check": True}

    def run(tool: str, *words: str) -> str:
        # the tools of the environment that runs this
        line = [sys.executable, "-m", tool, *words]
        return subprocess.run(line, **options, stdout=subprocess.PIPE).stdout

    run("cosmic_ray.cli", "baseline", "mutation.toml")
    run("cosmic_ray.cli", "init", "mutation.toml", session.name)
    run("cosmic_ray.tools.filters.operators_filter", session.name, "mutation.toml")
    run("cosmic_ray.cli", "exec", "mutation.toml", session.name)
    for line in run("cosmic_ray.cli", "dump", session.name).splitlines():
        _, result = json.loads(line)
        if result and result["worker_outcome"] == "normal":
            yield result["test_outcome"] == "killed", result["diff"]


def main() -> None:
    console, totals = Console(), [0, 0]
    given = [Path(name) for name in sys.argv[1:]] or [Path(name) for name in SETTINGS["default"]]
    modules = [
        module.relative_to(ROOT)
        for place in given
        for module in sorted((ROOT / place).rglob("*.py") if (ROOT / place).is_dir() else [ROOT / place])
    ]
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(Path(folder))
        for module in modules:
            found = list(mutate(tree, module))
            killed = sum(dead for dead, _ in found)
            totals = [totals[0] + killed, totals[1] + len(found)]
            for dead, difference in found:
                if not dead:
                    console.print(escape(difference), highlight=False, soft_wrap=True)
            console.print(f"{module}: {killed} of {len(found)} killed")
    console.print(f"{totals[0]} of {totals[1]} mutants killed")


if __name__ == "__main__":
    main()
