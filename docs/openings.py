"""What of the documentation opens in the studio: published sets, examples that are run, and what was found for the others.

python docs/openings.py              finds the answers to the examples that are tasks anew, for openings.json (minutes)
python docs/openings.py ellipse ...  those of these examples alone
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from analysis.mechanisms import PUBLISHED
from analysis.run import case_from, load_case
from analysis.studio import address_of, state_of

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent / "examples"
#: The first answer to each example that is a task, as a state of the page.
ANSWERS = HERE / "openings.json"
#: Asks a search for mechanisms of the FMUs alone.
OF_THE_FMUS = ("--set", 'search.kinds=["four-bar", "slider-crank"]')
#: Published sets that pages are about; examples are on the pages that name them.
SETS = {
    "fmu": ("table-3.1", "rahman-a4-10-s1-3.5"),
    "nomenclature": ("table-3.1", "rahman-a4-10-s1-3.5"),
    "coexisting-motions": ("rig-1-spring-b",),
    "linearisation": ("table-3.1",),
    "rahman": tuple(name for name in PUBLISHED if name.startswith("rahman")),
    "rig-2": ("rig-2-spring-c", "rig-2-spring-d"),
    "slider-crank": ("rahman-ideal", "rahman-a4-10-s1-3.5", "rahman-a4-20-s1-3.5"),
    "youssef": ("table-3.1", "appendix-1", "rig-1-spring-a", "rig-1-spring-b", "rig-2-spring-c", "rig-2-spring-d"),
}
#: What changes over time or angle in examples that are run, and what it is where they open: the page has constant inputs. Of a
#: torsion bar the mean of its torque (N.m).
CONSTANT = {
    "run-up": {"force": 0.0},
    "slider-crank": {"axial.speed": 0.0, "load": 0.0},
    "torsion-bar": {"drive.torque": 5.0},
}
#: The page that has them all.
ALL = "studio"


@cache
def states() -> dict[str, dict[str, Any]]:
    """All that opens, by the name of a published set or of an example."""
    found = {name: state_of(case_from({"published": name}, folder=EXAMPLES, title=name)) for name in PUBLISHED}
    found |= json.loads(ANSWERS.read_text(encoding="utf-8"))
    for path in filter(is_run, sorted(EXAMPLES.glob("*.toml"))):
        constant = CONSTANT.get(path.stem, {})
        state = state_of(load_case(path, constant))
        words = f", with constant {' and '.join(constant)}" if constant else ""
        found[path.stem] = state | {"title": state["title"] + words}
    return found


def is_run(path: Path) -> bool:
    """Whether an example is a case of `linkwork run`, and no task."""
    return not re.search(r"^\[(task|tune)\]", path.read_text(encoding="utf-8"), re.MULTILINE)


def named(page: str, text: str) -> list[str]:
    """What a page has: the sets that it is about and the examples that it names, in its order."""
    if page == ALL:
        return list(states())
    examples = dict.fromkeys(re.findall(r"examples/([\w-]+)\.toml", text))
    return [*SETS.get(page, ()), *(name for name in examples if name in states())]


def links(page: str, text: str) -> str:
    """A line of HTML with all that opens, or none."""
    known = states()
    parts = [
        f'<a href="{escape(address_of(known[name], "page.html"))}" title="{escape(known[name]["title"])}">{name}</a>'
        for name in named(page, text)
    ]
    return f'<p class="openings">Opens in the studio: {", ".join(parts)}.</p>' if parts else ""


def _answer(path: Path, folder: Path) -> dict[str, Any]:
    """The first answer to a task that is a mechanism of the FMUs; where a slider is moved, with the slider let go."""
    text = path.read_text(encoding="utf-8")
    command = "tune" if "[tune]" in text else "slider-motion" if "[tracking]" in text else "synthesize"
    words = [sys.executable, "-m", "analysis.cli", command, str(path), "--out", str(folder)]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    added = ", the slider let go" if command == "slider-motion" else ""
    if not (cases := _cases(folder)):
        subprocess.run([*words, *OF_THE_FMUS], check=True, stdout=subprocess.DEVNULL)
        cases, added = _cases(folder), ", the best that the FMUs have"
    state = state_of(load_case(cases[0], {"force": 0.0} if command == "slider-motion" else {}))
    return state | {"title": state["title"] + added}


def _cases(folder: Path) -> list[Path]:
    return [case for case in sorted(folder.glob("*.toml")) if "parameters" not in case.stem]


def main(names: list[str]) -> None:
    """Find answers anew."""
    found = json.loads(ANSWERS.read_text(encoding="utf-8")) if names else {}
    for path in sorted(EXAMPLES.glob("*.toml")):
        if not is_run(path) and path.stem in (names or [path.stem]):
            with tempfile.TemporaryDirectory() as folder:
                found[path.stem] = _answer(path, Path(folder))
    ANSWERS.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
