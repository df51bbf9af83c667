"""List the mechanisms that the documentation opens in the studio: published sets, examples, and results of example tasks.

python docs/openings.py              solves all examples that are tasks, for openings.json (minutes)
python docs/openings.py ellipse ...  solves these examples only
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

from analysis.run import load_case, read_case
from analysis.studio import page_address, page_state
from linkwork import five_bar, slider_crank

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent / "examples"
#: File with the first result of each example task, as a state of the studio's page.
ANSWERS = HERE / "openings.json"
#: Options that restrict a search to the kinds of linkage for which there are FMUs.
OF_THE_FMUS = ("--set", 'search.kinds=["four-bar", "slider-crank"]')
#: Published sets of the five-bar slider and the slider-crank; sets of described linkages are not among them.
PUBLISHED = (*five_bar.published.SETS, *slider_crank.published.SETS)
#: Published sets by page; examples appear on the pages that name them.
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
#: Constant inputs for examples whose inputs vary over time or angle, since the studio has only constant inputs. A torsion
#: bar is replaced by its mean torque (N.m).
CONSTANT = {
    "run-up": {"force": 0.0},
    "slider-crank": {"axial.speed": 0.0, "load": 0.0},
    "torsion-bar": {"drive.torque": 5.0},
}
#: The documentation page that lists all mechanisms.
ALL = "studio"


@cache
def states() -> dict[str, dict[str, Any]]:
    """Return the states that the documentation opens in the studio, by the name of a published set or of an example."""
    found = {name: page_state(read_case({"published": name}, folder=EXAMPLES, title=name)) for name in PUBLISHED}
    found |= json.loads(ANSWERS.read_text(encoding="utf-8"))
    for path in filter(is_run, sorted(EXAMPLES.glob("*.toml"))):
        constant = CONSTANT.get(path.stem, {})
        state = page_state(load_case(path, constant))
        words = f", with constant {' and '.join(constant)}" if constant else ""
        found[path.stem] = state | {"title": state["title"] + words}
    return found


def is_run(path: Path) -> bool:
    """Return whether an example is a case of `linkwork run` and not a task."""
    return not re.search(r"^\[(task|tune)\]", path.read_text(encoding="utf-8"), re.MULTILINE)


def named(page: str, text: str) -> list[str]:
    """Return the names of a page's published sets and of the examples that its text mentions, in the order of the text."""
    if page == ALL:
        return list(states())
    examples = dict.fromkeys(re.findall(r"examples/([\w-]+)\.toml", text))
    return [*SETS.get(page, ()), *(name for name in examples if name in states())]


def links(page: str, text: str) -> str:
    """Return a line of HTML with links that open a page's mechanisms in the studio; empty if there are none."""
    known = states()
    parts = [
        f'<a href="{escape(page_address(known[name], "page.html"))}" title="{escape(known[name]["title"])}">{name}</a>'
        for name in named(page, text)
    ]
    return f'<p class="openings">Opens in the studio: {", ".join(parts)}.</p>' if parts else ""


def _answer(path: Path, folder: Path) -> dict[str, Any]:
    """Solve a task; return its first result that the FMUs can represent, as a state of the studio.

    If the task is a slider motion, no force moves the slider in that state.
    """
    text = path.read_text(encoding="utf-8")
    command = "tune" if "[tune]" in text else "slider-motion" if "[tracking]" in text else "synthesize"
    words = [sys.executable, "-m", "analysis.cli", command, str(path), "--out", str(folder)]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    added = ", the slider let go" if command == "slider-motion" else ""
    if not (cases := _cases(folder)):
        subprocess.run([*words, *OF_THE_FMUS], check=True, stdout=subprocess.DEVNULL)
        cases, added = _cases(folder), ", the best that the FMUs have"
    state = page_state(load_case(cases[0], {"force": 0.0} if command == "slider-motion" else {}))
    return state | {"title": state["title"] + added}


def _cases(folder: Path) -> list[Path]:
    return [case for case in sorted(folder.glob("*.toml")) if "parameters" not in case.stem]


def main(names: list[str]) -> None:
    """Solve the tasks and write openings.json."""
    found = json.loads(ANSWERS.read_text(encoding="utf-8")) if names else {}
    for path in sorted(EXAMPLES.glob("*.toml")):
        if not is_run(path) and path.stem in (names or [path.stem]):
            with tempfile.TemporaryDirectory() as folder:
                found[path.stem] = _answer(path, Path(folder))
    ANSWERS.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
