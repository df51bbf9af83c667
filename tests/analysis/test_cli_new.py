"""`linkwork new`: what is written runs as it is, holds every entry there is, and its examples are taken."""

import json
import re
import tomllib
from math import pi

import pytest

from analysis.cli.new import LINKAGE, case_text, kinds
from analysis.files import Many, Quantity, Whole, entry_names
from analysis.files.template import example
from analysis.linkages.description import Body, Description, Gear, Rack, Slide, Slot, Spring
from analysis.mechanisms import MECHANISMS
from analysis.run import RunTable, case_inputs, load_case, load_parameters
from analysis.slider import TABLES as MOTION
from analysis.slider import SliderCase, load_slider_case
from analysis.synthesis import BOUNDS, KINDS, TABLES, SynthesisCase, load_synthesis_case
from analysis.tuning import TuneTable, load_tuning_case
from analysis.units import quantity
from linkwork.errors import LinkworkError

QUICK = ("--set", "search.candidates=2048", "--set", "search.starts=3", "--no-plots")
SLIDER, TUNING = "slider-motion", "tuning"
#: What is said of entries that are right by themselves, but exclude or need one another.
TOGETHER = (
    r"must (have only one of|(not )?come (together|with)|be given with)|parameter drive.speed is missing"
    r"|a (four-bar|slider-crank) cannot keep (Stroke|Grashof|MechanicalAdvantage|DeadCentre|(No)?Toggle|MaxPinForce)"
    r"|kinds must be|it is for a slider-crank|must be given by one of|has no effect"
    r"|rests twice in a turn|come to a toggle cannot turn fully|needs crank rotations, and the task gives none"
)


def load(kind, path):
    others = {SLIDER: load_slider_case, TUNING: load_tuning_case}
    loader = load_case if kind in MECHANISMS else others.get(kind, load_synthesis_case)
    return loader(path)


def sections(text):
    """Lines of entries, active or not, by table."""
    found, table = {}, ""
    for line in text.splitlines():
        if head := re.fullmatch(r"(?:# )?\[(\w+)\]", line):
            table = head[1]
            found[table] = [line]
        elif re.match(r"(?:# )?\w+ = ", line):
            found.setdefault(table, [""]).append(line)
    return found


def names(lines):
    return {line.removeprefix("# ").partition(" = ")[0] for line in lines[1:]}


@pytest.mark.parametrize("kind", [kind for kind in kinds() if kind != LINKAGE])
def test_it_holds_every_entry_there_is(kind):
    found = sections(case_text(kind, "x.toml"))
    if kind in MECHANISMS:
        mechanism = MECHANISMS[kind]
        assert names(found["run"]) == set(entry_names(RunTable))
        assert names(found["initial"]) == set(mechanism.initial_variables)
        there = {f"{table}.{name}" if table else name for table, lines in found.items() for name in names(lines)}
        assert {*mechanism.mechanism_variables, *case_inputs(mechanism)} <= there
        return
    if kind == TUNING:
        assert names(found["tune"]) == set(entry_names(TuneTable))
        return
    tables = TABLES | MOTION if kind == SLIDER else TABLES
    assert names(found["task"]) == {"kind", *entry_names(KINDS["rocker-function" if kind == SLIDER else kind])}
    assert names(found["bounds"]) == set(BOUNDS.readers)
    known = set(entry_names(SliderCase if kind == SLIDER else SynthesisCase)) - {"synthesis", "title"}
    assert set(found) - {"", "task", "bounds", "linkage"} == set(tables) - ({"trade_off"} if kind == SLIDER else set())
    assert known <= set(found)
    for table in set(tables) & set(found):
        assert names(found[table]) == set(entry_names(tables[table])), table


@pytest.mark.parametrize("kind", MECHANISMS)
def test_the_entries_of_a_run_have_defaults_and_explanations_for_its_reader(kind):
    lines = sections(case_text(kind, "x.toml"))["run"][1:]
    assert any(line.startswith("# tolerance = 1e-09 ") for line in lines)
    explained = [line.partition("  # ")[2] for line in lines]
    assert all(explained)
    assert not any("Error" in words or words.startswith("Return") for words in explained)


@pytest.mark.parametrize("kind", [kind for kind in kinds() if kind != LINKAGE])
def test_examples_behind_a_number_sign_are_taken(kind, tmp_path):
    text = case_text(kind, "x.toml")
    load(kind, write(tmp_path, text))
    for lines in sections(text).values():
        # a table that is not there comes in with all that it must have
        together = [lines] if lines[0].startswith("#") else [[line] for line in lines if line.startswith("# ")]
        for chosen in together:
            shown = [line for line in chosen if " = ..." not in line]
            changed = text
            for line in shown:
                changed = changed.replace(f"\n{line}\n", f"\n{line.removeprefix('# ')}\n", 1)
            try:
                load(kind, write(tmp_path, changed))
            except LinkworkError as error:
                if not re.search(TOGETHER, str(error)):
                    raise AssertionError(f"{shown}: {error}") from error


def write(folder, text):
    path = folder / "x.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", MECHANISMS)
def test_a_new_run_runs_as_it_is(linkwork, tmp_path, kind):
    written = linkwork("new", kind)
    assert written.output == f"wrote {kind}.toml; next: linkwork run {kind}.toml\n"
    linkwork("run", f"{kind}.toml", "--no-plot")
    assert (tmp_path / "out" / f"{kind}.csv").is_file()


def test_a_new_linkage_is_drawn_runs_and_holds_every_entry_there_is(linkwork, tmp_path):
    assert linkwork("new", LINKAGE).output == "wrote linkage.toml; next: linkwork linkage linkage.toml\n"
    assert "coupler, rocker" in linkwork("linkage linkage.toml").output
    assert (tmp_path / "out" / "linkage-linkage.png").is_file()
    assert "def places(" in linkwork("linkage linkage.toml --equations").output
    (tmp_path / "case.toml").write_text('linkage = "linkage.toml"\n')
    assert "coupler, rocker" in linkwork("linkage case.toml").output
    linkwork("run linkage.toml --no-plot")
    text = (tmp_path / "linkage.toml").read_text()
    for kind in (Body, Slide, Slot, Gear, Rack, Spring, Description):
        for name in entry_names(kind):
            assert re.search(rf"\b{name}\b", text), (kind, name)


def test_a_linkage_says_how_an_angle_is_measured_and_which_speed_is_only_that_at_the_start(linkwork, tmp_path):
    arm = {"points": {"B": [0.0, 0.0]}, "mass": 1.0, "inertia": 0.1}
    freedoms = {"crank": {"joint": "A", "speed": 30.0}, "swing": {"joint": "B", "speed": 5.0}}
    parts = {"ground": {"A": [0.0, 0.0]}, "bodies": {"arm": arm, "crank": {"bar": ["A", "B"], "length": 0.1}}}
    (tmp_path / "arm.json").write_text(json.dumps({"linkage": {"name": "arm-on-crank", **parts, "freedoms": freedoms}}))
    said = " ".join(linkwork("linkage arm.json").output.split())
    assert "from crank at B, measured from arm to crank, not driven: starts at its speed" in said
    assert "from ground at A, driven as drive" in said


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_new_synthesis_runs_as_it_is(linkwork, kind):
    linkwork("new", kind)
    result = linkwork("synthesize", f"{kind}.toml", *QUICK)
    assert "defects" not in result.stderr


@pytest.mark.slow
def test_a_new_tuning_runs_as_it_is(linkwork):
    linkwork("new", TUNING)
    result = linkwork("tune", f"{TUNING}.toml", "--no-plot")
    assert "slider.stiffness" in result.output


@pytest.mark.slow
def test_a_new_slider_motion_runs_as_it_is(linkwork):
    linkwork("new", SLIDER)
    result = linkwork("slider-motion", f"{SLIDER}.toml", *QUICK, "--set", "slider.starts=3")
    assert "slider, 2 harmonics" in result.output


@pytest.mark.parametrize("kind", MECHANISMS)
def test_parameters_alone(linkwork, tmp_path, kind):
    linkwork("new", kind, "p.toml", "--parameters")
    published = next(iter(MECHANISMS[kind].published.values())).parameters
    made = load_parameters(tmp_path / "p.toml")
    for name in published.__slots__:
        assert getattr(made, name) == pytest.approx(getattr(published, name), rel=1e-9)
    if kind == "slider-crank":
        linkwork("slider-crank info p.toml")


def test_what_it_does_not_write(linkwork, tmp_path):
    (tmp_path / "motion.toml").write_text("mine")
    result = linkwork("new motion", code=2)
    assert "motion.toml is there already: give --force to write over it, or another name" in result.stderr
    assert (tmp_path / "motion.toml").read_text() == "mine"
    linkwork("new motion --force")
    assert tomllib.loads((tmp_path / "motion.toml").read_text())["task"]["kind"] == "motion"
    assert [line.split()[0] for line in linkwork("new").output.splitlines()] == list(kinds())


@pytest.mark.parametrize("kind", KINDS)
def test_every_entry_of_a_synthesis_is_explained_to_who_writes_it(kind):
    """Not to who reads the code, as the docstring of a function does."""
    found = sections(case_text(kind, "x.toml"))
    for line in [*found["task"][1:], *found["constraints"][1:]]:
        _, there, explained = line.partition("  # ")
        assert line.startswith("kind = ") or there, line
        assert not re.match("Read |Check |See |As in |a list$", explained), line


def test_examples_are_the_quantities_that_they_stand_for():
    assert quantity(example(Quantity("rad/s")), "rad/s", "speed") == pytest.approx(1.0)
    assert quantity(example(Quantity("rad")), "rad", "angle") == pytest.approx(pi / 6.0)
    assert example(Many(Whole(least=2))) == [2]
