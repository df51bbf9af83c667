"""Write the tables that the documentation takes from the code, and draw its pictures.

python docs/generate.py             fills the tables between the markers of docs/*.md
python docs/generate.py --check     writes nothing, and fails if a table is out of date
python docs/generate.py --figures   fills the pages of the theses too, and draws the pictures (15 minutes on two cores)
python docs/generate.py --figures 3 R   fills only Youssef's chapter III and Rahman's figures on these pages, and draws no other
                                        pictures

A table stands between the lines ``<!-- TABLE SUBJECT: begin -->`` and ``<!-- TABLE SUBJECT: end -->``. `TABLES` has the
function that makes each TABLE; its arguments are the SUBJECT (``of``) and the text of the page.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Container, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.mechanisms import MECHANISMS
from analysis.studies.contents import SENTENCES
from linkwork.parameters import field_name
from linkwork.variables import Variable

if TYPE_CHECKING:
    from analysis.figures import Figure

HERE = Path(__file__).resolve().parent
PAGES = tuple(sorted(HERE.glob("*.md")))
MARKED = re.compile(r"<!-- (\w+) ([\w-]+): begin -->\n.*?<!-- \1 \2: end -->", re.DOTALL)


def _start(variable: Variable) -> str:
    if variable.causality in ("output", "local"):
        return ""
    return f"{variable.start:.9g}" if isinstance(variable.start, float) else str(variable.start)


def _range(variable: Variable) -> str:
    low, high = ("" if bound is None else f"{bound:g}" for bound in (variable.minimum, variable.maximum))
    return f"{low} .. {high}" if low or high else ""


def _markdown(headings: str, rows: Iterator[tuple[str, ...]]) -> str:
    """Return a table in Markdown; ``headings`` is its first line, bars included."""
    return "\n".join([headings, re.sub(r"[^|]+", " --- ", headings), *(f"| {' | '.join(row)} |" for row in rows)])


def symbols(of: str, page: str) -> str:
    """Return the table of a mechanism's FMI variables, with their symbols in the thesis and their identifiers in Python."""
    mechanism = MECHANISMS[of]

    def identifier(variable: Variable) -> str:
        if variable.name in mechanism.mechanism_variables:
            return f"`{mechanism.parameters.__name__}.{field_name(variable.name)}`"
        if variable.name.startswith("initial."):
            return f"`{mechanism.initial.__name__}.{variable.name.removeprefix('initial.')}`"
        if variable.causality == "output" and variable.kind == "Real":
            return f"`Outputs.{variable.name.replace('.', '_')}`"
        return ""

    table = mechanism.variables
    return _markdown(
        "| symbol | identifier | FMI variable | causality | unit | start | range | meaning |",
        (
            (
                f"${v.symbol}$" if v.symbol else "",
                identifier(v),
                f"`{v.name}`",
                v.causality,
                v.unit or v.kind,
                _start(v),
                _range(v),
                v.description,
            )
            for v in table
        ),
    )


def figures(of: str, page: str) -> str:
    """Compute the studies of a part of `CHAPTERS` and draw their plots; return the text with the plots and the verdicts."""
    from analysis.studies import ENTRIES, is_figure
    from analysis.studies.page import figures

    def part(number: str) -> str:
        return "R" if number.startswith(("R", "rahman-")) else number[0] if is_figure(number) else "ours"

    return figures((number for number in ENTRIES if part(number) == of), HERE)


def count(of: str, page: str) -> str:
    """Return a sentence that says how many statements on the page have each verdict."""
    from analysis.studies.page import count

    return count(page)


def rule(of: str, page: str) -> str:
    """Return the rule by which the studies judge the theses' words of degree, such as "slightly"."""
    from analysis.studies.rules import RULE

    return RULE


def probe(of: str, page: str) -> str:
    """Return a table for `linkwork probe`: its checks, or the calls that it makes against the standard."""
    from analysis.probe import QUESTIONABLE, WRONG
    from analysis.probe.checks import CHECKS
    from analysis.probe.faults import ACCEPT, FAULTS

    if of == "checks":
        return _markdown("| check | what it tests |", ((f"`{name}`", check.title) for name, check in CHECKS.items()))
    whats: dict[str, dict[str | None, list[str]]] = {}
    for functions, what, accepted, _ in FAULTS:
        whats.setdefault(functions, {}).setdefault(accepted, []).append(what)
    columns = (WRONG, QUESTIONABLE, None, ACCEPT)
    return _markdown(
        "| functions | wrong if accepted | questionable if accepted | only a crash counts | must be accepted |",
        (
            (
                f"`{functions.replace('|', chr(96) + ', ' + chr(96))}`",
                *("; ".join(row.get(column, ())) for column in columns),
            )
            for functions, row in whats.items()
        ),
    )


def accuracy(of: str, page: str) -> str:
    """Return the table of work and precision of a mechanism's FMUs."""
    from analysis.export.accuracy import HEADINGS, format_row, stored_rows

    return _markdown(f"| {' | '.join(HEADINGS)} |", (tuple(format_row(row)) for row in stored_rows(MECHANISMS[of])))


def race(of: str, page: str) -> str:
    """Return a table, or a list, of the searches' results in docs/race.csv; ``of`` names it."""
    from benchmarks.race import markdown, read

    return markdown(read(HERE / "race.csv"), of)


def stored(name: str, of: str, page: str) -> str:
    """Return the table of the file docs/NAME.csv of a benchmark."""
    benchmark = import_module(f"benchmarks.{name}")
    return str(benchmark.markdown(benchmark.read(HERE / f"{name}.csv")))


def commanded(of: str, page: str) -> str:
    """Return the table of docs/commanded.csv."""
    from benchmarks.tables import markdown, read

    table = read(HERE / "commanded.csv")
    return markdown(list(table[0]), (row.values() for row in table))


def sentences() -> str:
    """Return the statements of all studies on the pages of both theses, shortened, as JSON for `linkwork figures --list`."""
    from analysis.studies.page import sentences

    found = [sentences((HERE / f"{page}.md").read_text(encoding="utf-8")) for page in ("youssef", "rahman")]
    return json.dumps({**found[0], **found[1]}, indent=0, ensure_ascii=False) + "\n"


#: Parts of the pages of the theses: chapters of Youssef's thesis, Rahman's figures, and our own studies.
CHAPTERS = (*"345678", "R", "ours")
#: Functions that make a table from its subject and the text of its page; `figures` takes long.
TABLES: dict[str, Callable[[str, str], str]] = {
    "symbols": symbols, "figures": figures, "count": count, "rule": rule, "probe": probe, "race": race,
    "crossing": partial(stored, "crossing"), "accuracy": accuracy, "masters": partial(stored, "masters"), "commanded": commanded,
}  # fmt: skip


def filled(page: str, *, chapters: Container[str] = ()) -> str:
    """Return the text of a page with its tables brought up to date; of the figures, only those of ``chapters``."""

    def fill(match: re.Match[str]) -> str:
        table, of = match.groups()
        return f"<!-- {table} {of}: begin -->\n{TABLES[table](of, page)}\n<!-- {table} {of}: end -->"

    # the figures come first, because other tables count their verdicts
    page = MARKED.sub(lambda match: fill(match) if match[1] == "figures" and match[2] in chapters else match[0], page)
    return MARKED.sub(lambda match: match[0] if match[1] == "figures" else fill(match), page)


#: A picture: name of its file without the suffix, figure, dots per inch.
Picture = tuple[str, "Figure", int]


def study_pictures() -> Iterator[Picture]:
    """Draw the pictures of rig-2.md and coexisting-motions.md."""
    from analysis import figures as draw
    from analysis.periodic import frequency_response, with_isolas
    from analysis.studies import load
    from analysis.units import RAD_S_PER_RPM
    from analysis.youssef import approximations
    from linkwork.five_bar.published import SETS

    for name, number in (
        ("rig-2-approximations", "8.19"),
        ("rig-2-harmonics", "8.21"),
        ("rig-2-forces", "rig-2-forces"),
    ):
        study = load(number)
        yield name, study.draw(study.compute()), 150
    for name, of, low, high in (
        ("rig-2-response", "rig-2-spring-c", 100.0, 1300.0),
        ("rig-1-response", "rig-1-spring-b", 850.0, 1250.0),
    ):
        rig = SETS[of]
        response = with_isolas(
            frequency_response(rig.parameters, low * RAD_S_PER_RPM, high * RAD_S_PER_RPM, doublings=3)
        )
        yield name, draw.plot(response, title=rig.source, beside=approximations(response)), 100


def hand_drawn_pictures() -> Iterator[Picture]:
    """Draw the pictures of docs/hand-drawn-to-fmu.md."""
    import numpy as np

    from analysis import figures as draw
    from analysis.slider import load_slider_case
    from analysis.synthesis import TargetPath, load_synthesis_case

    examples = HERE.parent / "examples"

    def closed(points: np.ndarray, **look: Any) -> draw.Curve:
        x, y = 1e3 * np.vstack([points, points[:1]]).T
        return draw.Curve(x=x, y=y, **look)

    def picture(title: str, *curves: draw.Curve) -> Figure:
        panel = draw.Panel(x_label="x [mm]", y_label="y [mm]", curves=curves, equal=True, legend_at="outside")
        return draw.plot_curves([panel], title=title, size=(6.4, 3.0))

    case = load_synthesis_case(examples / "hand-drawn.toml")
    drawn = closed(
        TargetPath.from_file(examples / "hand-drawn.svg").points, label="drawn", line="", marker=".", colour="0.55"
    )
    smooth = closed(case.task.path.points, label="smoothed", width=1.0)
    yield "hand-drawn-curve", picture("A curve drawn by hand", drawn, smooth), 110
    yield "hand-drawn-linkage", draw.plot(case.solve().best, title="The linkage that was found"), 90
    small = load_slider_case(examples / "hand-drawn-slider.toml")
    four_bar = small.find_four_bar()
    moved = [four_bar]
    for harmonics in small.slider.harmonics:
        moved.append(small.find_motion(four_bar, harmonics, tuple(moved[1:]), progress=False).best)
    wanted = closed(four_bar.task.path.points, label="wanted", width=3.0, colour="0.8")
    still = closed(four_bar.curve(), label="four-bar", line="--")
    moving = closed(moved[-1].curve(), label="slider moved,\n3 harmonics")
    yield "hand-drawn-moved", picture("Links of at most 150 mm", wanted, still, moving), 110
    yield "hand-drawn-motion", draw.plot(small.compute_drive(moved[-1]), title="The slider's drive at 60 rpm"), 90


def closed_form_pictures() -> Iterator[Picture]:
    """Draw the pictures of docs/closed-form.md, from the tasks in examples/."""
    from analysis.figures import plot
    from analysis.synthesis import guidance, load_synthesis_case

    for name, dpi in (("five-poses", 100), ("four-poses", 92)):
        case = load_synthesis_case(HERE.parent / "examples" / f"{name}.toml")
        # as many solutions as the command computes by default
        yield name, plot(guidance(case.task, 6), title=case.title), dpi


def linkage_pictures() -> Iterator[Picture]:
    """Draw the pictures of docs/linkages.md and docs/linkage-library.md."""
    import tempfile

    from analysis.figures import plot, plot_schemes
    from analysis.linkages import TEXT, load_linkage
    from analysis.systems import load_system, run_system

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "four-bar.toml"
        path.write_text(TEXT.replace("{file}", path.name), encoding="utf-8")
        yield "four-bar", plot(load_linkage(path)), 90
        page = (HERE / "linkages.md").read_text(encoding="utf-8")
        motor = path.with_name("motor.toml")
        motor.write_text(page.partition("```toml\n")[2].partition("```")[0], encoding="utf-8")
        yield "motor-four-bar", plot(run_system(load_system(motor).wiring())), 100
    files = sorted((HERE.parent / "examples" / "linkages").glob("*.toml"))
    yield "linkage-library", plot_schemes([load_linkage(path) for path in files]), 90


def race_pictures() -> Iterator[Picture]:
    """Draw the picture of docs/synthesis-race.md."""
    from benchmarks.race import picture, read

    yield "race", picture(read(HERE / "race.csv")), 100


def system_pictures() -> Iterator[Picture]:
    """Draw the pictures of docs/systems.md."""
    from analysis import figures as draw
    from analysis.systems import convergence, library, load_system, run_system

    names = {"motor-crank": ["motor.shaft.exerted_torque", "linkage.crank.speed"],
             "press": ["flywheel.shaft.exerted_torque", "press.crank.speed", "load.contact.exerted_force"]}  # fmt: skip
    for name, outputs in names.items():
        run = run_system(load_system(library()[name]).wiring(), coupling="derivatives")
        yield f"system-{name}", draw.plot(run, outputs), 100
    found = convergence(load_system(library()["press"]))
    yield "system-check", draw.plot(found), 90


def slider_crank_pictures() -> Iterator[Picture]:
    """Draw the pictures of docs/slider-crank.md."""
    from dataclasses import replace
    from math import radians

    import numpy as np

    from analysis.figures import plot_mechanism, plot_range, plot_tolerances
    from analysis.slider_crank import Tolerance, force_turn, monte_carlo
    from analysis.units import INCH
    from linkwork.slider_crank.published import CRANK_SPEED, SETS, parameters

    case = SETS["rahman-a4-10-s1-3.5"]
    shift = case.initial.shift_position
    yield "slider-crank", plot_mechanism(case.parameters, radians(30.0), shift, unit="in", title=case.source), 110
    short = replace(parameters(20.0), rod_length=30.0 * INCH)
    yield "slider-crank-range", plot_range(short, unit="in", title="A rod of 30 in at a4 = 20 in, S1 = 0"), 90
    turn = force_turn(parameters(20.0), crank_speed=CRANK_SPEED, angles=np.linspace(0.0, 2.0 * np.pi, 73))
    names = ("crank.length", "rod.length", "guide.offset", "shift.position")
    allowed = [Tolerance(name, half_width=0.25e-3) for name in names]
    allowed.append(Tolerance("guide.twist", half_width=radians(0.1)))
    found = monte_carlo(turn, allowed, samples=100_000)
    title = "Lengths within 0.25 mm and the twist within 0.1 deg, a4 = 20 in, S1 = 0"
    yield "slider-crank-tolerances", plot_tolerances(found, angle=radians(30.0), title=title), 90


def save_picture(figure: Figure, path: Path, dpi: int) -> None:
    """Save a figure as a picture of 256 colours, which takes a third of the bytes."""
    from PIL import Image

    from analysis.files import save_figure

    save_figure(figure, path, dpi=dpi)
    with Image.open(path) as image:
        # the other methods lose a colour that occurs only in a legend
        way = Image.Quantize.MAXCOVERAGE
        few = image.convert("RGB").quantize(256, method=way, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


def main(arguments: list[str]) -> int:
    """Bring the pages up to date, or check them, as the command line asks; return the exit code."""
    with_figures, *chosen = arguments if "--figures" in arguments else ("",)
    chapters = chosen or CHAPTERS if with_figures else ()
    if with_figures and not chosen:
        for pictures in (
            study_pictures,
            hand_drawn_pictures,
            closed_form_pictures,
            linkage_pictures,
            race_pictures,
            system_pictures,
            slider_crank_pictures,
        ):
            for name, figure, dpi in pictures():
                save_picture(figure, HERE / f"{name}.png", dpi)
    stale = []
    # the statements are listed last, from the pages
    for path in (*PAGES, SENTENCES):
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        new = sentences() if path == SENTENCES else filled(text, chapters=chapters)
        if new != text:
            stale.append(path.name)
            if "--check" not in arguments:
                path.write_text(new, encoding="utf-8")
    if stale and "--check" in arguments:
        sys.exit(f"out of date, run python docs/generate.py: {', '.join(stale)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
