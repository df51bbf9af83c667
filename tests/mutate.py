"""Mutation of one module or folder: does some test fail for every small change of the code?

    python -m tests.mutate fmu_src/linkwork/integrate.py analysis/files
    python -m tests.mutate --sample 40 fmu_src/linkwork analysis/files analysis/run

Cosmic Ray changes one operator or number at a time in a copy of the tree, and runs the tests that `tool.mutation.tests` of
pyproject.toml names for the module or its folder. Printed are the share of mutants that a test killed, and the survivors.
With ``--sample`` so many mutants of all modules together are drawn, always the same ones while the code stays as it is, and the
share has its Wilson interval of 95 %.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from argparse import ArgumentParser
from collections.abc import Iterator
from math import sqrt
from pathlib import Path
from random import Random
from typing import Any

import tomli_w
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import WorkerOutcome, WorkResult
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


def prepared(tree: Path, module: Path) -> Path:
    """The session of a module: its mutants, none of them tried."""
    command = f'"{sys.executable}" -m pytest -q -x -p no:cacheprovider -m "not slow and not fmu" {tests_of(module)}'
    settings = {
        "module-path": module.as_posix(),
        "timeout": SETTINGS["timeout"],
        "excluded-modules": [],
        "test-command": command,
        "distributor": {"name": "local"},
        "filters": {"operators-filter": {"exclude-operators": SETTINGS["exclude-operators"]}},
    }
    session = tree / f"{module.as_posix().replace('/', '-')}.sqlite"
    session.with_suffix(".toml").write_text(tomli_w.dumps({"cosmic-ray": settings}), encoding="utf-8")
    run(tree, "cosmic_ray.cli", "init", session.with_suffix(".toml").name, session.name)
    run(tree, "cosmic_ray.tools.filters.operators_filter", session.name, session.with_suffix(".toml").name)
    return session


def run(tree: Path, tool: str, *words: str) -> str:
    """What a tool of the environment that runs this prints, on the tree."""
    paths = os.pathsep.join([str(tree / "fmu_src"), str(tree)])
    return subprocess.run(
        [sys.executable, "-m", tool, *words],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": paths},
        text=True,
        check=True,
        stdout=subprocess.PIPE,
    ).stdout


def draw(sessions: list[Path], count: int) -> None:
    """Skip all mutants of the sessions but ``count``."""
    pending = []
    for session in sessions:
        with use_db(str(session)) as db:
            pending += [(session, item.job_id) for item in db.pending_work_items]
    kept = set(Random(1).sample(range(len(pending)), min(count, len(pending))))
    for number, (session, job) in enumerate(pending):
        if number not in kept:
            with use_db(str(session)) as db:
                db.set_result(job, WorkResult(worker_outcome=WorkerOutcome.SKIPPED))


def tried(tree: Path, session: Path, sound: set[str]) -> Iterator[tuple[bool, str]]:
    """Of each mutant of a session whether a test killed it, and its difference from the code.

    Tests that are not in ``sound`` yet must pass on the code as it is.
    """
    settings = session.with_suffix(".toml").name
    with use_db(str(session)) as db:
        if not list(db.pending_work_items):
            return
    command = tomllib.loads((tree / settings).read_text(encoding="utf-8"))["cosmic-ray"]["test-command"]
    if command not in sound:
        run(tree, "cosmic_ray.cli", "baseline", settings)
        sound.add(command)
    run(tree, "cosmic_ray.cli", "exec", settings, session.name)
    for line in run(tree, "cosmic_ray.cli", "dump", session.name).splitlines():
        _, result = json.loads(line)
        if result and result["worker_outcome"] == "normal":
            yield result["test_outcome"] == "killed", result["diff"]


def interval(killed: int, count: int) -> str:
    """Wilson's interval of 95 % for the share of all mutants of which these were drawn."""
    z = 1.96
    middle = (killed + z**2 / 2) / (count + z**2)
    half = z / (count + z**2) * sqrt(killed * (count - killed) / count + z**2 / 4)
    return f"{100 * (middle - half):.0f} to {100 * (middle + half):.0f} %"


def main() -> None:
    parser = ArgumentParser(description="Mutation of modules or folders.")
    parser.add_argument("places", nargs="*")
    parser.add_argument("--sample", type=int)
    arguments = parser.parse_args()
    console, totals, sound = Console(), [0, 0], set[str]()
    given = [Path(name) for name in arguments.places] or [Path(name) for name in SETTINGS["default"]]
    modules = [
        module.relative_to(ROOT)
        for place in given
        for module in sorted((ROOT / place).rglob("*.py") if (ROOT / place).is_dir() else [ROOT / place])
    ]
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(Path(folder))
        sessions = [prepared(tree, module) for module in modules]
        if arguments.sample is not None:
            draw(sessions, arguments.sample)
        for module, session in zip(modules, sessions):
            found = list(tried(tree, session, sound))
            if not found:
                continue
            killed = sum(dead for dead, _ in found)
            totals = [totals[0] + killed, totals[1] + len(found)]
            for dead, difference in found:
                if not dead:
                    console.print(escape(difference), highlight=False, soft_wrap=True)
            console.print(f"{module}: {killed} of {len(found)} killed")
    drawn = f", {interval(*totals)}" if arguments.sample is not None and totals[1] else ""
    console.print(f"{totals[0]} of {totals[1]} mutants killed{drawn}")


if __name__ == "__main__":
    main()
