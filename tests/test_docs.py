"""The documentation repeats the code where it says so, and its code runs."""

import base64
import json
import pkgutil
import re
import shutil
import sys
import tomllib
from contextlib import redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

import pytest
import yaml

from analysis import cli
from analysis.mechanisms import PUBLISHED
from analysis.studies import STUDIES
from analysis.studies.contents import sentences
from analysis.studies.page import MOST_BYTES, quotes
from analysis.studies.statements import FAILS, HOLDS, IN_PART
from analysis.studio import PAGE, page_case
from linkwork import __version__

from .scripts import called, linkwork, script_of_docs
from .studies.results import expected

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def generate():
    return script_of_docs("generate")


def test_the_tables_of_the_documentation_are_up_to_date(generate):
    stale = [page.name for page in generate.PAGES if generate.filled(page.read_text()) != page.read_text()]
    assert stale == [], "run: make docs"


def test_the_list_of_figures_is_about_the_statements_of_the_pages(generate):
    assert generate.sentences() == generate.SENTENCES.read_text(encoding="utf-8"), "run: make docs"
    assert set(sentences()) == set(STUDIES)


def test_every_mechanism_has_its_tables(generate):
    marked = {match for page in generate.PAGES for match in generate.MARKED.findall(page.read_text())}
    assert {of for table, of in marked if table == "symbols"} == set(generate.MECHANISMS)
    assert {table for table, _ in marked} == set(generate.TABLES)


@pytest.mark.parametrize("name", ["youssef.md", "rahman.md"])
def test_every_study_is_on_the_page_of_its_figures_with_what_does_not_hold(name):
    page = (ROOT / "docs" / name).read_text()
    parts = re.split(r"^`linkwork figures (\S+)`$", page, flags=re.MULTILINE)
    ours = {number for number in STUDIES if number.startswith(("R", "rahman-")) == (name == "rahman.md")}
    assert set(parts[1::2]) == ours, "run make docs FIGURES=1"
    assert all(STUDIES[number] in page for number in ours), "run make docs FIGURES=1"
    for number, part in zip(parts[1::2], parts[2::2]):
        verdicts = {quote: outcome for quote, outcome in quotes(part) if outcome != HOLDS}
        assert len(verdicts) == len(expected(number)), "run: make docs FIGURES=1"
        for beginning, outcome in expected(number).items():
            assert [found for quote, found in verdicts.items() if quote.startswith(beginning)] == [outcome]


@pytest.mark.parametrize("name", ["youssef.md", "rahman.md"])
def test_a_sentence_is_counted_once(name):
    """No quote is another's, or a part of it; of sentences that are cut, each piece counts."""
    pieces = [
        piece.strip(' .,;:()"').lower()
        for quote, _ in quotes((ROOT / "docs" / name).read_text())
        for piece in re.split(r"\.\.\.|\[[^]]*\]", quote)
    ]
    pieces = [piece for piece in pieces if len(piece) > 20]
    twice = [a for i, a in enumerate(pieces) for j, b in enumerate(pieces) if i != j and a in b]
    assert twice == []


def test_plots_of_the_theses():
    """Each page's plots are there, small, and no others."""
    pages = "".join((ROOT / "docs" / name).read_text() for name in ("youssef.md", "rahman.md"))
    plots = re.findall(r"\]\((theses/\S+\.webp)\)", pages)
    assert len(set(plots)) == len(plots)
    assert {f"theses/{path.name}" for path in (ROOT / "docs" / "theses").iterdir()} == set(plots)
    assert all((ROOT / "docs" / plot).stat().st_size <= MOST_BYTES for plot in plots)


@pytest.mark.parametrize(("name", "last"), [("rahman.md", 9), ("youssef.md", 21)])
def test_every_erratum_has_its_test(name, last):
    """Each row of the table ends with the tests that show it, as file::name; in Rahman's studies a verdict names it."""
    page = (ROOT / "docs" / name).read_text()
    rows = re.findall(r"^\| (\d+) (\| .*`) \|$", page, flags=re.MULTILINE)
    assert [number for number, _ in rows] == [str(n + 1) for n in range(last)]
    for number, row in rows:
        assert name != "rahman.md" or re.search(
            rf"\*\*({FAILS}|{IN_PART})\*\*.*\b(erratum|errata)[ \d,and]* {number}\b", page, re.MULTILINE | re.IGNORECASE
        ), number
        tests = re.findall(r"`(tests/\S+\.py)::(\w+)(?:::(\w+))?`", row.split(" | ")[-1])
        assert tests, row
        for file, *names in tests:
            code = (ROOT / file).read_text()
            for test in filter(None, names):
                assert re.search(rf"^\s*(def|class) {test}\b", code, flags=re.MULTILINE), f"{file}: {test}"


def test_the_commands_of_rahmans_recommendations_run(tmp_path):
    """As the table gives them, apart from plots."""
    table = (ROOT / "docs" / "rahman.md").read_text().split("## Recommendations")[1].split("## ")[0]
    commands = set(re.findall(r"`linkwork (slider-crank [^`]*)`", table))
    assert len(commands) == 5
    for command in commands:
        linkwork(f"{command} --no-plot --force --out", tmp_path)


def test_links_in_the_documentation_lead_somewhere():
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_names_of_modules_in_the_documentation_are_right():
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")):
        for name in re.findall(r"`((?:analysis|linkwork|tests|benchmarks)\.[\w.]+)`", page.read_text()):
            assert pkgutil.resolve_name(name), page.name


def test_the_readme_fits_on_two_screens():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 110


def test_the_code_of_the_readme_runs(fmus, natives, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "build").mkdir()
    for fmu in (fmus["FiveBarSlider"], natives["FiveBarSlider-native"]):
        shutil.copy(fmu, tmp_path / "build")
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    assert len(blocks) == 4
    for block in blocks:
        assert len(block.strip().splitlines()) <= 12
        exec(compile(block, "README.md", "exec"), {"__name__": "__main__"})


#: Of the numbers on a page: what another machine or another release of IPOPT may make of them.
PAGE_TOLERANCE = 2e-2


def words_of(line):
    """The words of a line, box drawing left out."""
    return [word for word in re.sub(r"[\u2500-\u257f]", " ", line).split() if word]


def says(found, stated):
    """Whether a line says what is stated: the same words, and numbers that are nearly the same."""
    if len(found) < len(stated):
        return False
    for a, b in zip(found, stated):
        try:
            x, y = (float(word.rstrip(",;")) for word in (a, b))
        except ValueError:
            if a != b:
                return False
        else:
            # 1e-5: a hundredth of a millimetre in m
            if abs(x - y) > PAGE_TOLERANCE * abs(y) + (1e-5 if abs(y) < 1e-4 else 0.0):
                return False
    return True


def run_page(name, tmp_path, monkeypatch):
    """Run each command and each piece of Python of a page in turn; what the page then shows must be among what was printed.

    A file that the page shows with its name is written first. Python that is imported by the processes that it starts is run
    with what precedes it, as the file of a reader; all else is run in this process.

    Gives the number of commands, the number of lines checked, and the words of what was printed, line by line.
    """
    page = (ROOT / "docs" / name).read_text(encoding="utf-8")
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    python, names, printed, checked, commands = "", {"__name__": "__main__"}, [], 0, 0
    for kind, block in re.findall(r"```(python|sh|text|toml)\n(.*?)```", page, flags=re.DOTALL):
        if kind == "toml":
            # a first line that is the name of a file says that the reader saves it
            if named := re.match(r"# (\S+\.toml)\n", block):
                (tmp_path / named[1]).write_text(block, encoding="utf-8")
            continue
        if kind == "text":
            # a first line of headings is the page's own
            lines = block.strip().splitlines()
            stated = [words_of(line) for line in lines if re.search(r"\d", line) and not line.startswith("pivot  ")]
            for words in stated:
                assert any(says(found, words) for found in printed), f"the page states: {' '.join(words)}"
            checked += len(stated)
            continue
        if kind == "python":
            python += block
            if "__main__" in block:
                (script := tmp_path / "page.py").write_text(python, encoding="utf-8")
                said = [called(sys.executable, script, cwd=tmp_path)]
            else:
                with redirect_stdout(StringIO()) as output:
                    exec(compile(block, name, "exec"), names)
                said = [output.getvalue()]
        else:
            assert all(line.startswith("linkwork ") for line in block.strip().splitlines())
            said = [linkwork(line.removeprefix("linkwork ")).stdout for line in block.strip().splitlines()]
        printed += [words_of(line) for text in said for line in text.splitlines()]
        commands += len(said)
    return commands, checked, printed


@pytest.mark.long
def test_the_page_from_a_hand_drawn_curve_to_an_fmu_runs_and_says_what_is_so(tmp_path, monkeypatch):
    commands, checked, printed = run_page("hand-drawn-to-fmu.md", tmp_path, monkeypatch)
    assert (commands, checked) == (9, 45)
    # what the prose says
    rows = {tuple(words[:3]): words for words in printed if words[:1] == ["slider,"]}
    three = float(rows["slider,", "3", "harmonics"][3])
    fixed = next(float(words[1]) for words in printed if words[:1] == ["fixed"])
    assert three < 0.38 * fixed
    assert float(rows["slider,", "3", "harmonics"][5]) == pytest.approx(30.0, rel=0.004)
    for name in (
        "hand-drawn/best.dxf",
        "hand-drawn/solutions.csv",
        "rounded.dxf",
        "parameters.toml",
        "moved/force.csv",
    ):
        assert (tmp_path / name).exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "commands", "checked", "files"),
    [
        (
            "slider-crank.md",
            15,
            19,
            ("out/rahman-a4-10-s1-3.5.gif", "out/slider-crank-range.png", "mechanism.png", "crank.toml"),
        ),
        pytest.param("closed-form.md", 4, 2, ("out/poses.png",), marks=pytest.mark.long),
        pytest.param("synthesis-cases.md", 2, 2, ("calm/solutions.csv",), marks=pytest.mark.long),
        pytest.param("tuning.md", 3, 7, ("out/tuning-jump-tuned.png",), marks=pytest.mark.long),
        ("workers.md", 2, 2, ()),
        (
            "linkage-library.md",
            2,
            0,
            ("examples/linkages/jansen.toml", "out/jansen-linkage.png", "out/toggle-press.csv"),
        ),
        ("linkages.md", 8, 3, ("out/four-bar-linkage.png", "out/MyLinkage-native.fmu", "out/motor.png")),
        ("capture.md", 3, 4, ("out/capture.png", "out/capture-resonance.png")),
        pytest.param(
            "systems.md",
            17,
            6,
            ("out/motor-crank.ssp", "out/press-check.png", "motor-crank.ssp", "runs/samples.npy"),
            marks=pytest.mark.long,
        ),
        ("real-time.md", 2, 0, ("out/motor-tracking-host/system.h", "out/motor-tracking-host/host")),
    ],
)
def test_a_page_runs_and_says_what_is_so(page, commands, checked, files, tmp_path, monkeypatch):
    """The numbers of commands and of lines that are checked show that nothing was passed over."""
    *counts, printed = run_page(page, tmp_path, monkeypatch)
    assert counts == [commands, checked]
    assert all((tmp_path / name).exists() for name in files)
    if page == "slider-crank.md":
        assert ["the", "two", "agree"] in printed
    if page == "synthesis-cases.md":  # the force on the pins of the first linkage, by the run
        assert any(words[:1] == ["1"] and words[-3:-1] == ["on", "A"] for words in printed)


def test_pictures_of_the_documentation_are_small():
    pictures = [
        picture
        for name in ("hand-drawn", "slider-crank", "four-poses", "five-poses", "four-bar")
        for picture in (ROOT / "docs").glob(f"{name}*.png")
    ]
    assert pictures
    for picture in pictures:
        assert picture.stat().st_size < 150_000, picture.name


NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def test_there_is_a_short_notebook_without_outputs_for_each_kind_of_user():
    assert [path.stem for path in NOTEBOOKS] == ["designer", "fmu", "researcher"]
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text())["cells"]
        assert len(cells) <= 15, path.name
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells), path.name


@pytest.fixture(scope="module")
def openings():
    return script_of_docs("openings")


def test_every_published_set_and_example_opens_in_the_studio(openings):
    """A task with its answer, which `docs/openings.py` finds. The pages that are about them have the links."""
    examples = {path.stem for path in (ROOT / "examples").glob("*.toml")}
    assert {*openings.states()} == {*PUBLISHED, *examples}
    for name, state in openings.states().items():
        assert page_case(state).title == state["title"], name
    pages = {page.stem: page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md")}
    assert {*openings.SETS} <= {*pages}
    shown = {name for page, text in pages.items() if page != "studio" for name in openings.named(page, text)}
    assert shown == {*openings.states()}
    for page, text in pages.items():
        for address in re.findall('href="([^"]+)"', openings.links(page, text)):
            kept = base64.urlsafe_b64decode(address.partition("#state=")[2] + "==")
            assert page_case(json.loads(kept)).parameters


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built without a warning: its links lead somewhere, its notebooks run, every page is in its contents."""
    folder = tmp_path_factory.mktemp("docs")
    build = [sys.executable, "-m", "sphinx", "--quiet", "--fail-on-warning", "--keep-going"]
    called(*build, "-d", folder / "doctrees", ROOT / "docs", folder / "site")
    return folder / "site"


@pytest.mark.long
@pytest.mark.fmu
def test_pages_of_the_site_fit_their_windows_and_long_ones_have_contents(site, browser):
    """On a phone and on three desktops, light and dark."""
    look = (ROOT / "tests" / "layout.js").read_text(encoding="utf-8")
    page = browser.new_page()
    wrong = []
    for path in sorted(site.rglob("*.html")):
        if path.name == "page.html" or "_static" in path.parts:
            continue
        page.goto(path.as_uri())
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            for width in (390, 1280, 1440, 1920):
                page.set_viewport_size({"width": width, "height": 1000})
                wrong += [(path.name, scheme, width, flaw) for flaw in page.evaluate(look)]
        # those of the index and of the names of the API are lists themselves
        lists = ("genindex", "py-modindex", "index", "analysis")
        if path.stem not in lists and page.evaluate("document.querySelector('.content').scrollHeight") > 4000:
            assert page.locator(".toc-tree li").count() > 2, path.name
    assert wrong == []


@pytest.mark.slow
@pytest.mark.fmu
def test_the_site_needs_no_network(site):
    """All that it loads is its own."""
    pages = {path.relative_to(site).as_posix(): path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    loaded = re.compile(r"""<(?:script|img|link)[^>]+(?:src|href)=["'](?:https?:)?//""")
    assert [name for name, page in pages.items() if loaded.search(page)] == []
    assert pages["page.html"] == PAGE.read_text(encoding="utf-8")
    assert 'href="page.html#state=' in pages["rig-2.html"]
    assert "<mover>" in pages["nomenclature.html"]  # a formula
    assert "simulate" in pages["reference/analysis.run.html"]
    assert "--published" in pages["reference/commands.html"]
    for path in NOTEBOOKS:
        assert "data:image" in (page := pages[f"notebooks/{path.stem}.html"]) or "_images/" in page


def test_every_claim_of_the_paper_has_a_command_that_is_there():
    rows = [line.split("|") for line in (ROOT / "paper" / "paper.md").read_text().splitlines() if line.startswith("| ")]
    commands = [row[2].strip().strip("`").split() for row in rows[2:]]
    assert len(commands) >= 5
    for words in commands:
        match words:
            case ["linkwork", name, *_]:
                assert name in cli.COMMANDS, words
            case ["python", "-m", "pytest", place]:
                assert (ROOT / place).exists(), words
            case ["python", "-m", module]:
                assert find_spec(module), words
            case _:
                pytest.fail(f"no command: {words}")


def test_the_numbers_of_the_paper_are_those_of_the_pages():
    paper = " ".join((ROOT / "paper" / "paper.md").read_text().split())
    for page, words in (
        ("youssef", "Of {} statements of the first thesis {} hold, {} hold in part, {} do not"),
        ("rahman", "of {} of the second {} hold, {} hold in part, {} do not"),
    ):
        counts = re.search(
            r"Of (\d+) statements of the thesis (\d+) hold, (\d+) hold in part, (\d+) do not",
            (ROOT / "docs" / f"{page}.md").read_text(),
        )
        assert words.format(*counts.groups()) in paper
    solvers = (ROOT / "docs" / "solvers.md").read_text()
    assert "0.091 ms" in paper
    assert "0.091 ms" in solvers


def test_the_conda_recipe_has_the_version_and_the_requirements_of_the_package():
    recipe = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert recipe["package"]["version"] == __version__
    run = {requirement.replace(" ", "") for requirement in recipe["requirements"]["run"]}
    assert run == {f"python{project['requires-python']}", *project["dependencies"]}


def test_rattler_build_renders_the_conda_recipe():
    rattler = pytest.importorskip("rattler_build")
    recipe = rattler.Stage0Recipe.from_file(str(ROOT / "packaging" / "conda" / "recipe.yaml"))
    (variant,) = recipe.render(rattler.VariantConfig(), rattler.RenderConfig())
    package = variant.recipe.package
    assert (package.name, package.version) == ("linkwork", __version__)


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert (citation["title"], citation["version"]) == ("Linkwork", __version__)
    assert {"cff-version", "message", "authors"} <= set(citation)
