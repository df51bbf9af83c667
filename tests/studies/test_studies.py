"""The list of studies, how one is made, and what a verdict says."""

import csv
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis import studies
from analysis.studies.page import block
from analysis.studies.statements import (
    FAILS,
    HOLDS,
    IN_PART,
    UNJUDGED,
    Case,
    at_least,
    at_most,
    near,
    statement,
    unjudged,
)
from analysis.studies.variation import cache, varied, vary
from analysis.studies.youssef import linkage
from analysis.units import INCH
from linkwork.errors import InputError
from linkwork.slider_crank.published import parameters

from .results import check


def test_there_is_a_study_of_every_figure() -> None:
    chapters = {
        3: range(1, 15),
        4: range(2, 8),
        5: range(1, 5),
        6: range(2, 12),
        7: (2, *range(4, 13)),
        8: (4, *range(6, 22)),
    }
    asked = [f"{chapter}.{n}" for chapter, numbers in chapters.items() for n in numbers]
    ours = ["quality", "control", "rig-1-resonance", "rig-1-friction", "rig-2-forces", "conclusions", "linkage"]
    words = [f"rahman-{word}" for word in ("constant", "closure", "rates", "forces", "conclusions")]
    assert list(studies.STUDIES) == [*asked, *ours, *(f"R{n}" for n in range(5, 39)), *words]
    drawn = {*studies.ENTRIES} - {*studies.STUDIES}
    assert drawn == {"4.1", "6.1", "7.1", "7.3", "8.1", "8.2", "8.3", "8.5", "R1", "R2", "R3", "R4"}
    for number in studies.STUDIES:
        assert studies.load(number).number == number


@pytest.mark.parametrize("number", ["4.1", "R4", "R39", "5", ""])
def test_a_figure_there_is_not(number: str) -> None:
    with pytest.raises(InputError, match=f"'{number}'"):
        studies.load(number)


def test_written_files(tmp_path: Path) -> None:
    found, paths = studies.make("3.5", tmp_path / "out")
    assert paths == (tmp_path / "out" / "fig_3_5.png", tmp_path / "out" / "fig_3_5.csv")
    assert (tmp_path / "out" / "fig_3_5.png").stat().st_size > 10_000
    with (tmp_path / "out" / "fig_3_5.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == list(found.columns)
    np.testing.assert_array_equal(np.array(rows[1:], float), np.column_stack(list(found.columns.values())))


@pytest.mark.slow
def test_the_linkage_is_animated(tmp_path: Path) -> None:
    _, paths = studies.make("linkage", tmp_path)
    assert [path.name for path in paths] == ["linkage.png", "linkage.csv", "linkage.gif"]
    with Image.open(paths[2]) as image:
        assert image.n_frames == 72


class TestVariation:
    """Parameters of a study that its reader varies."""

    def test_the_curves_are_those_of_the_changed_mechanism(self, tmp_path: Path) -> None:
        changed, paths = studies.make("R6", tmp_path, {"rod.length": "45 in"})
        assert [path.name for path in paths] == ["fig_R6_varied.png", "fig_R6_varied.csv"]
        assert changed.columns["S4; ideal [in]"][0] == pytest.approx((45.0**2 - 12.0**2) ** 0.5)
        # and the next is the thesis's again
        plain, _ = studies.make("R6", tmp_path)
        assert plain.columns["S4; ideal [in]"][0] == pytest.approx((50.0**2 - 12.0**2) ** 0.5)

    @pytest.mark.parametrize(
        ("number", "name", "words"),
        [
            ("R6", "rod.lenght", "did you mean rod.length"),
            ("R6", "guide.twist", "compares values of guide.twist itself"),
            ("3.5", "slider.stiffness", "compares values of slider.stiffness itself"),
            ("rahman-forces", "rod.length", "has no parameters that can be changed"),
            ("4.5", "crank.length", "slider_equation takes all parameters for the equation of chapters IV"),
        ],
    )
    def test_a_parameter_without_meaning_is_refused(self, tmp_path: Path, number: str, name: str, words: str) -> None:
        with pytest.raises(InputError, match=words):
            studies.make(number, tmp_path, {name: 1.0})

    def test_the_readers_spring_stands_alone_in_figure_3_4(self, tmp_path: Path) -> None:
        """Its statements compare the thesis's three springs, so that there are none."""
        found, _ = studies.make("3.4", tmp_path, {"slider.stiffness": "7.5e5 dyn/cm"})
        names = [name for name in found.columns if name.startswith("slider position")]
        assert names == ["slider position u; k = 7.5e5 dyn/cm [cm]"]
        assert found.statements == ()

    def test_what_is_kept_is_kept_by_the_changes(self) -> None:
        """A function that is called with the same arguments gives the changed mechanism's result, and tells its parameters."""

        @cache
        def rod() -> float:
            return vary(parameters()).rod_length

        for changes, length in (({}, 50.0 * INCH), ({"rod.length": 1.0}, 1.0), ({}, 50.0 * INCH)):
            for _ in range(2):
                with varied(changes) as known:
                    assert rod() == pytest.approx(length)
                assert "rod.length" in known


class TestStatements:
    PLACE = "3.2, L12"
    SHORT, LONG = near("short", "2.0", 2.04, unit="m"), near("long", "2.0", 2.06, unit="m", why="it sags")

    def test_a_printed_number_is_judged_to_half_a_unit_of_its_last_digit(self) -> None:
        assert (self.SHORT.lower, self.SHORT.upper) == pytest.approx((1.95, 2.05))
        assert self.SHORT.holds
        assert not self.LONG.holds
        assert near("", "1e4", 1.6e4).lower == 0.5e4
        assert (self.SHORT.stated, near("", 2.0, 2.04, 0.1).stated) == ("2.0", "")

    @pytest.mark.parametrize(
        ("cases", "outcome"),
        [
            ((SHORT,), HOLDS),
            ((SHORT, LONG), IN_PART),
            ((LONG,), FAILS),
            ((), UNJUDGED),
            ((unjudged("lost", "no scale"), SHORT), IN_PART),
        ],
    )
    def test_one_verdict_for_all_cases(self, cases: tuple[Case, ...], outcome: str) -> None:
        assert statement("It is 2.0 m long.", self.PLACE, "", "", *cases).outcome == outcome

    def test_the_terminal_says_statement_verdict_and_cases(self) -> None:
        both = statement("It is 2.0 m long.", self.PLACE, "length", "half a unit", self.SHORT, self.LONG)
        assert str(both).splitlines() == [
            '"It is 2.0 m long." (the thesis, 3.2, line 12)',
            "  HOLDS IN PART: 1 of 2 cases; it sags",
            "    short: holds; stated 2.0 m; allowed 1.95 to 2.05; computed 2.04 m",
            "    long: does not hold; stated 2.0 m; allowed 1.95 to 2.05; computed 2.06 m",
        ]
        lost = statement("It is long.", self.PLACE, why="no scale")
        assert str(lost).splitlines()[1] == "  CANNOT BE JUDGED: no scale"

    def test_bounds(self) -> None:
        assert at_least("", 1.0, 1.0).allowed == "at least 1"
        assert not at_most("", "2.0", 2.5).holds

    def test_a_rounding_error_has_one_digit(self) -> None:
        assert [at_most("", 1e-9, x, "m").found for x in (-8.108e-16, 0.0, 1.2342e-9)] == [
            "-8e-16 m",
            "0 m",
            "1.234e-09 m",
        ]

    def test_bars_do_not_break_the_page(self) -> None:
        """A single case stands in the line of the verdict, several in a table."""
        one = statement("|x| is 2.", self.PLACE, "|x|", "", at_most("", "2", 3.0, why="|x| grows"))
        assert list(block(one))[-2:] == ["**Does not hold**: stated 2; allowed at most 2; computed 3; |x| grows.", ""]
        two = statement("|x| is 2.", self.PLACE, "|x|", "", self.SHORT, near("|x|", "1", 1.0))
        assert list(block(two))[-2] == r"| \|x\| | 1 | 0.5 to 1.5 | 1 | holds |"


@pytest.mark.slow
def test_the_study_of_the_linkage() -> None:
    check("linkage")
    assert linkage.run()["closure.residual"].max() < 1e-12
