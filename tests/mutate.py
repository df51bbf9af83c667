"""Test the tests of a module or folder by mutation: does some test fail for every small change of the code?

    python -m tests.mutate fmu_src/linkwork/integrate.py analysis/files
    python -m tests.mutate --sample 40 fmu_src/linkwork fmu_src/native analysis/files analysis/run

One operator or number is changed at a time in a copy of the tree. Changes of Python are made by Cosmic Ray, changes of C are
similar and made below. Then the tests run that `tool.mutation.tests` of pyproject.toml names for the module or its folder. The
output has the surviving mutants, the mutants whose tests did not end (they count as killed), and the share of killed mutants.
``--sample`` draws that many mutants of all modules together and adds the Wilson interval of 95 % for the share. The sample is
the same for the same ``--draw`` as long as the code is unchanged. Mutants are tested in the order in which they are drawn, so
that Ctrl-C ends the run with the share of a smaller sample.
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
#: in C: numbers that are neither case labels nor parts of names, and binary operators, which clang-format surrounds by spaces
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
    """A single change of a module; ``changed`` returns the changed text for the module's text."""

    module: Path
    changed: Callable[[str], str]


def tests_of(module: Path) -> str:
    """Return the command that tests a module: by the module's own entry in the settings, or by that of the nearest folder."""
    for place in (module, *module.parents):
        if (tests := SETTINGS["tests"].get(place.as_posix())) is not None:
            python = shlex.quote(sys.executable)
            return (
                f"{python} -m pytest -q -x -p no:cacheprovider -m 'not slow and not fmu' {tests} {SETTINGS['always']}"
            )
    raise SystemExit(f"tool.mutation.tests of pyproject.toml names no tests for {module}")


def copied(folder: Path) -> Path:
    """Copy all files of the repository into a folder, including changes that are not committed and new files."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def mutants(module: Path) -> Iterator[Mutant]:
    """Yield every single change of a module."""
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
    """Test a mutant; return the outcome, whether the tests did not end, and the change as a diff."""
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
    """Return Wilson's interval of 95 % for the share of killed mutants, from a sample of ``count``."""
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
