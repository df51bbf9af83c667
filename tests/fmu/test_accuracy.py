"""The table of work and precision: it is that of the program, and a looser tolerance costs less and errs more."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from zipfile import ZipFile

import pytest

from analysis import cosimulate, simulate
from analysis.export.accuracy import HEADINGS, TOLERANCES, format_row, rows, stored_rows
from analysis.mechanisms import FIVE_BAR, MECHANISMS, SLIDER_CRANK
from analysis.run import CASES
from linkwork.mechanism import Mechanism


@pytest.mark.parametrize("mechanism", MECHANISMS.values(), ids=list(MECHANISMS))
def test_data_are_those_of_the_program(mechanism: Mechanism) -> None:
    # machines differ in the last digits of sines, and near a reversal of friction these decide on a step
    assert [row[0] for row in stored_rows(mechanism)] == list(TOLERANCES)
    for row, now in zip(stored_rows(mechanism), rows(mechanism)):
        assert row[1] == pytest.approx(now[1], rel=0.1)
        assert row[2:] == pytest.approx(now[2:], rel=0.5)
    for loose, tight in pairwise(stored_rows(mechanism)):
        assert loose[1] < tight[1]
        assert all(a > b for a, b in zip(loose[2:], tight[2:]))


def test_an_fmu_is_within_its_table(natives: Mapping[str, Path]) -> None:
    """The error of a native FMU in co-simulation, against SciPy's integrator."""
    case = CASES["slider-crank-torque"]
    inputs = case.inputs.replace(load=-5.0)
    options = {"initial": case.initial, "stop_time": 1.2, "step": 1.2}
    right = simulate(case.parameters, inputs, method="Radau", tolerance=1e-12, **options)
    for row in stored_rows(SLIDER_CRANK)[1:4]:
        found = cosimulate(natives["SliderCrank-native"], case.parameters, inputs, tolerance=row[0], **options)
        for place, name in ((2, "crank.angle"), (3, "crank.speed"), (6, "energy.kinetic")):
            assert abs(found[name][-1] - right[name][-1]) <= 2.0 * row[place] * abs(right[name][-1])


def test_the_table_is_in_the_documentation(natives: Mapping[str, Path]) -> None:
    with ZipFile(natives["FiveBarSlider-native"]) as archive:
        page = archive.read("documentation/index.html").decode()
    for text in (*HEADINGS, *format_row(stored_rows(FIVE_BAR)[0])):
        assert f">{text}<" in page
    with ZipFile(natives["Pendulum-native"]) as archive:
        assert HEADINGS[1] not in archive.read("documentation/index.html").decode()
