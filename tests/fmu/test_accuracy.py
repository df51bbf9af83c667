"""The table of work and precision: it is that of the program, and a looser tolerance costs less and errs more."""

import csv
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy import simulate_fmu

from analysis import cosimulate, simulate
from analysis.export.accuracy import HEADINGS, TOLERANCES, default_rows, format_row, rows, stored_rows
from analysis.mechanisms import FIVE_BAR, MECHANISMS, SLIDER_CRANK
from analysis.run import CASES, EXPERIMENTS
from linkwork.mechanism import Mechanism
from tests.mechanisms.pendulum import MECHANISM as PENDULUM


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


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7])
def test_an_fmu_without_standard_cases_has_the_table_of_its_default_experiment(
    natives: Mapping[str, Path], tolerance: float
) -> None:
    fmu = natives["Pendulum-native"]
    with ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
        reference = archive.read(f"{EXPERIMENTS}/default-ref.csv").decode()
    table = default_rows(PENDULUM, reference)
    assert [row[0] for row in table] == list(TOLERANCES)
    for text in (*HEADINGS, *(number for row in table for number in format_row(row))):
        assert f">{text}<" in page
    heading, *lines = csv.reader(reference.splitlines())
    right = np.array(lines, dtype=float)
    end = right[-1, 0]
    found = simulate_fmu(
        str(fmu), start_values={"solver.tolerance": tolerance}, stop_time=end, step_size=end / 10, output_interval=end / 10,
        relative_tolerance=tolerance, output=heading[1:], fmi_type="CoSimulation",
    )  # fmt: skip
    row = next(row for row in table if row[0] == tolerance)
    angle = right[:, heading.index("pendulum.angle")]
    error = np.abs(found["pendulum.angle"] - angle).max() / max(1.0, np.abs(angle).max())
    assert 0.3 * row[2] < error < 1.1 * row[2]
