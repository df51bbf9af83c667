"""Mutation of one module or folder: does some test fail for every small change of the code?

    python -m tests.mutate fmu_src/linkwork/integrate.py analysis/files
    python -m tests.mutate --sample 40 fmu_src/linkwork analysis/files analysis/run

Cosmic Ray changes one operator or number at a time in a copy of the tree, and the tests run that `tool.mutation.tests` of
pyproject.toml names for the module or its folder. Printed are the survivors, the mutants whose tests did not end, which count
as killed, and the share of mutants that a test killed. With ``--sample`` so many mutants of all modules together are drawn, the
same ones for the same ``--draw`` while the code stays as it is, and the share has its Wilson interval of 95 %. They are tried
as they are drawn, so that those up to a Ctrl-C, which ends with the share so far, are a sample too.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from argparse import ArgumentParser
from collections.abc import Iterator
from contextlib import suppress
from math import sqrt
from pathlib import Path
from random import Random
from typing import Any

from cosmic_ray.ast import ast_nodes, get_ast_from_path
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.plugins import get_operator, operator_names
from cosmic_ray.work_item import MutationSpec, TestOutcome, WorkerOutcome
from rich.console import Console
from rich.markup import escape

ROOT = Path(__file__).parents[1]
SETTINGS: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mutation"]
LEFT_OUT = re.compile("|".join(SETTINGS["exclude-operators"]))


def tests_of(module: Path) -> str:
    """The command that tests a module, by its own entry in the settings, or the nearest folder's that has one."""
    for place in (module, *module.parents):
        if (tests := SETTINGS["tests"].get(place.as_posix())) is not None:
            python = shlex.quote(sys.executable)
            return (
                f"{python} -m pytest -q -x -p no:cacheprovider -m 'not slow and not fmu' {tests} {SETTINGS['always']}"
            )
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


def mutants(module: Path) -> Iterator[MutationSpec]:
    """Every single change of a module."""
    nodes = list(ast_nodes(get_ast_from_path(module)))
    for name in operator_names():
        operator = get_operator(name)
        if LEFT_OUT.match(name) or operator.arguments():
            continue
        places = (place for node in nodes for place in operator().mutation_positions(node))
        for number, (start, end) in enumerate(places):
            yield MutationSpec(module_path=module, operator_name=name, occurrence=number, start_pos=start, end_pos=end)


def interval(killed: int, count: int) -> str:
    """Wilson's interval of 95 % for the share of all mutants of which these were drawn."""
    z = 1.96
    middle = (killed + z**2 / 2) / (count + z**2)
    half = z / (count + z**2) * sqrt(killed * (count - killed) / count + z**2 / 4)
    return f"{100 * (middle - half):.0f} to {100 * (middle + half):.0f} %"


def main() -> None:
    parser = ArgumentParser(description="Mutation of modules or folders.")
    parser.add_argument("places", nargs="*", default=SETTINGS["default"])
    parser.add_argument("--sample", type=int)
    parser.add_argument("--draw", type=int, default=1)
    arguments = parser.parse_args()
    console, sound = Console(emoji=False), set[str]()
    modules = [
        module.relative_to(ROOT)
        for place in map(ROOT.joinpath, arguments.places)
        for module in (sorted(place.rglob("*.py")) if place.is_dir() else [place])
    ]
    killed = count = 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(copied(Path(folder)))
        os.environ["PYTHONPATH"] = os.pathsep.join([f"{folder}/fmu_src", folder])
        found = [mutant for module in modules for mutant in mutants(module)]
        if arguments.sample is not None:
            found = Random(arguments.draw).sample(found, min(arguments.sample, len(found)))
        with suppress(KeyboardInterrupt):
            for mutant in found:
                tests = tests_of(mutant.module_path)
                if tests not in sound:  # they must pass on the code as it is
                    tried = subprocess.run(shlex.split(tests), capture_output=True, text=True)
                    if tried.returncode:
                        raise SystemExit(
                            f"{(tried.stdout + tried.stderr)[-3000:]}\nthe code as it is fails this test: {tests}"
                        )
                    sound.add(tests)
                result = mutate_and_test([mutant], tests, SETTINGS["timeout"])
                if result.worker_outcome != WorkerOutcome.NORMAL:
                    raise SystemExit(f"{mutant} could not be tried: {result.output}")
                dead, endless = result.test_outcome != TestOutcome.SURVIVED, result.output == "timeout"
                killed, count = killed + dead, count + 1
                if endless or not dead:
                    text = f"{'without end' if endless else 'survived'}, {count} of {len(found)}\n{result.diff}"
                    console.print(escape(text), highlight=False, soft_wrap=True)
        os.chdir(ROOT)
    share = f", {interval(killed, count)}" if arguments.sample is not None and count else ""
    console.print(f"{killed} of {count} mutants killed{share}")


if __name__ == "__main__":
    main()
