"""Mutation of one module or folder: does some test fail for every small change of the code?

    python -m tests.mutate fmu_src/linkwork/integrate.py analysis/files
    python -m tests.mutate --sample 40 fmu_src/linkwork fmu_src/native analysis/files analysis/run

One operator or number is changed at a time in a copy of the tree, of Python by Cosmic Ray, of C by the same kinds of changes
below, and the tests run that `tool.mutation.tests` of pyproject.toml names for the module or its folder. Printed are the
survivors, the mutants whose tests did not end, which count as killed, and the share of mutants that a test killed. With
``--sample`` so many mutants of all modules together are drawn, the same ones for the same ``--draw`` while the code stays as
it is, and the share has its Wilson interval of 95 %. They are tried as they are drawn, so that those up to a Ctrl-C, which
ends with the share so far, are a sample too.
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
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from difflib import unified_diff
from functools import partial
from math import sqrt
from pathlib import Path
from random import Random
from typing import Any

from cosmic_ray.ast import ast_nodes, get_ast_from_path
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from cosmic_ray.testing import run_tests
from cosmic_ray.work_item import TestOutcome
from rich.console import Console
from rich.markup import escape

ROOT = Path(__file__).parents[1]
SETTINGS: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mutation"]
LEFT_OUT = re.compile("|".join(SETTINGS["exclude-operators"]))
#: in C a number that labels no case and is part of no name, and operators of two sides, which clang-format puts spaces around
IN_C = re.compile(
    r"(?<![\w.])(?<!case )(?<!case -)\d+\b(?!\.)|\d+\.\d+|(?<= )(?:[-+*/]=?|[<>=!]=|[<>]|&&|\|\|)(?= )|!(?=[\w(])|"
    r"\b(?:true|false)\b"
)
SWAPS = {
    **{"+": "-", "-": "+", "*": "/", "/": "*", "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="},
    **{
        "&&": "||",
        "||": "&&",
        "+=": "-=",
        "-=": "+=",
        "*=": "/=",
        "/=": "*=",
        "true": "false",
        "false": "true",
        "!": "",
    },
}
NO_CODE = re.compile(
    r"/\*.*?\*/|//[^\n]*|'(?:\\.|[^'\\])+'|\"(?:\\.|[^\"\\])*\"|^[ ]*#(?:\\\n|[^\n])*", re.DOTALL | re.MULTILINE
)


@dataclass(frozen=True)
class Mutant:
    """One single change of a module: its text with the change, from its text."""

    module: Path
    changed: Callable[[str], str]


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


def mutants(module: Path) -> Iterator[Mutant]:
    """Every single change of a module."""
    yield from (_of_python if module.suffix == ".py" else _of_c)(module)


def _of_python(module: Path) -> Iterator[Mutant]:
    nodes = list(ast_nodes(get_ast_from_path(module)))
    for name in operator_names():
        operator = get_operator(name)
        if LEFT_OUT.match(name) or operator.arguments():
            continue
        for number, _ in enumerate(place for node in nodes for place in operator().mutation_positions(node)):
            yield Mutant(module, partial(mutate_code, operator=operator(), occurrence=number))


def _of_c(module: Path) -> Iterator[Mutant]:
    code = NO_CODE.sub(lambda found: " " * len(found[0]), module.read_text(encoding="utf-8"))
    for found in IN_C.finditer(code):
        word = found[0]
        new = SWAPS[word] if word in SWAPS else f"({word} + 1)" if "." in word else str(int(word) + 1)
        yield Mutant(module, partial(_with, start=found.start(), end=found.end(), new=new))


def _with(text: str, start: int, end: int, new: str) -> str:
    return text[:start] + new + text[end:]


def outcome(mutant: Mutant, tests: str) -> tuple[TestOutcome, bool, str]:
    """Whether a test kills the mutant, whether the tests did not end, and the change as a diff."""
    text = mutant.module.read_text(encoding="utf-8")
    changed = mutant.changed(text)
    mutant.module.write_text(changed, encoding="utf-8")
    try:
        result, output = run_tests(tests, SETTINGS["timeout"])
    finally:
        mutant.module.write_text(text, encoding="utf-8")
    lines = unified_diff(text.split("\n"), changed.split("\n"), str(mutant.module), str(mutant.module), lineterm="")
    return result, output == "timeout", "\n".join(lines)


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
        for module in (sorted(place.rglob("*.py")) + sorted(place.rglob("*.[ch]")) if place.is_dir() else [place])
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
                tests = tests_of(mutant.module)
                if tests not in sound:  # they must pass on the code as it is
                    tried = subprocess.run(shlex.split(tests), capture_output=True, text=True)
                    if tried.returncode:
                        raise SystemExit(
                            f"{(tried.stdout + tried.stderr)[-3000:]}\nthe code as it is fails this test: {tests}"
                        )
                    sound.add(tests)
                result, endless, diff = outcome(mutant, tests)
                dead = result != TestOutcome.SURVIVED
                killed, count = killed + dead, count + 1
                if endless or not dead:
                    text = f"{'without end' if endless else 'survived'}, {count} of {len(found)}\n{diff}"
                    console.print(escape(text), highlight=False, soft_wrap=True)
        os.chdir(ROOT)
    share = f", {interval(killed, count)}" if arguments.sample is not None and count else ""
    console.print(f"{killed} of {count} mutants killed{share}")


if __name__ == "__main__":
    main()
