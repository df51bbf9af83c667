"""The list of studies, how one is made, and what a verdict says."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis import studies
from analysis.studies.study import OURS, at_least, at_most, near, text, unjudged
from linkwork.errors import InputError

from .results import check


def test_there_is_a_study_of_every_figure() -> None:
    chapters = {3: range(2, 15), 4: range(3, 8), 5: range(1, 5), 6: range(4, 12), 7: range(2, 13), 8: range(6, 22)}
    drawings = {"7.3"}
    asked = [
        f"{chapter}.{n}" for chapter, numbers in chapters.items() for n in numbers if f"{chapter}.{n}" not in drawings
    ]
    ours = ["quality", "control", "rig-1-resonance", "rig-1-friction", "rig-2-forces", "linkage"]
    assert list(studies.YOUSSEF) == [*asked, *ours]
    words = [f"rahman-{word}" for word in ("constant", "closure", "rates", "forces")]
    assert list(studies.RAHMAN) == [f"R{n}" for n in range(5, 39)] + words
    assert list(studies.STUDIES) == [*studies.YOUSSEF, *studies.RAHMAN]
    for number in studies.STUDIES:
        assert studies.load(number).number == number


@pytest.mark.parametrize("number", ["3.1", "R4", "R39", "5", ""])
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


def test_a_verdict_says_what_it_found() -> None:
    worse = near("length", text("L12"), 2.0, 2.5, 0.1, "m")
    assert str(worse) == "length: 2 m (the thesis, line 12), computed 2.5 m: DOES NOT HOLD"
    assert str(at_least("length", OURS, 2.0, 2.5)) == "length: at least 2 (our own check), computed 2.5: holds"
    assert (
        str(unjudged("length", text("L12"), "no scale")) == "length (the thesis, line 12): cannot be judged: no scale"
    )
    assert not at_most("length", OURS, 2.0, 2.5).holds


@pytest.mark.slow
def test_the_study_of_the_linkage() -> None:
    check("linkage")
