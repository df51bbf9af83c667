"""The result of a run: columns by name, files, data frames, plots."""

import csv
from pathlib import Path

import numpy as np
import pytest

from analysis import Inputs, Trajectory, figures, simulate
from analysis.mechanisms import FIVE_BAR
from linkwork.errors import InputError
from linkwork.five_bar import dynamics
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.five_bar.variables import OUTPUTS


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    return simulate(TABLE_3_1, Inputs(speed=SETS["table-3.1"].crank_speed), stop_time=0.1, step=1e-3)


def test_every_output_of_the_contract_is_there_by_name_with_its_unit(trajectory: Trajectory) -> None:
    assert (trajectory.names, trajectory.values.shape) == (FIVE_BAR.output_names, (101, 27))
    assert len(trajectory) == 101
    for i, name in enumerate(FIVE_BAR.output_names):
        assert np.array_equal(trajectory[name], trajectory.values[:, i])
        assert trajectory.column(name) == i
    assert dict(trajectory.units) == {v.name: v.unit for v in OUTPUTS if v.kind == "Real"}
    assert trajectory.units["pin.C.fx"] == "N"


def test_columns_are_the_outputs_of_the_equations(trajectory: Trajectory) -> None:
    p = TABLE_3_1.constants()
    start = trajectory["energy.kinetic"][0] + trajectory["energy.potential"][0]
    columns = ("crank.angle", "slider.position", "crank.speed", "slider.velocity")
    for i in (0, 50, 100):
        th2, u, w2, v = (float(trajectory[name][i]) for name in columns)
        state = (th2, u, w2, v, float(trajectory["energy.dissipated"][i]), float(trajectory["energy.supplied"][i]))
        expected = dynamics.outputs(state, dynamics.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0), start, p)
        assert trajectory.values[i] == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_counts_of_the_integrator(trajectory: Trajectory) -> None:
    counts = trajectory.statistics
    assert set(counts) == {"steps", "rejected", "evaluations", "seconds", "seconds_integrating"}
    assert 0.0 < counts["seconds_integrating"] < counts["seconds"]
    attempts = counts["steps"] + counts["rejected"]
    # twelve a step and three for its interpolant; a refused one, and the last one of an interval, spends eleven, or twelve
    assert 11 * attempts < counts["evaluations"] < 15 * attempts + 20
    assert counts["seconds"] > 0.0
    assert trajectory.source == "compiled DOP853"


def test_counts_of_short_intervals() -> None:
    inputs = Inputs(speed=SETS["table-3.1"].crank_speed)
    counts = simulate(TABLE_3_1, inputs, stop_time=0.05, step=5e-4, hold=5e-4).statistics
    assert counts["rejected"] == 0
    # each interval is one step, but for the first ones: eleven evaluations, and that at its start
    assert counts["evaluations"] == 12 * counts["steps"]


def test_output_that_does_not_exist(trajectory: Trajectory) -> None:
    with pytest.raises(InputError, match=r"no output 'slider.postion'; did you mean slider.position"):
        trajectory["slider.postion"]
    with pytest.raises(InputError, match="no output 'time'"):
        figures.plot(trajectory, ["time"])


def test_csv_has_names_and_units_and_every_digit(trajectory: Trajectory, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no folder .*new for run.csv: make it first"):
        trajectory.to_csv(tmp_path / "new" / "run.csv")
    assert not (tmp_path / "new").exists()
    path = trajectory.to_csv(tmp_path / "run.csv")
    assert path == tmp_path / "run.csv"
    with path.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    assert header[0] == "time [s]"
    assert header[1:] == [f"{v.name} [{v.unit}]" for v in OUTPUTS if v.kind == "Real"]
    numbers = np.array(rows, dtype=float)
    assert np.array_equal(numbers[:, 0], trajectory.time)
    assert np.array_equal(numbers[:, 1:], trajectory.values)
    assert [p.name for p in path.parent.iterdir()] == ["run.csv"]


def test_data_frame(trajectory: Trajectory) -> None:
    pytest.importorskip("pandas")
    frame = trajectory.to_dataframe()
    assert list(frame.columns) == list(FIVE_BAR.output_names)
    assert frame.index.name == "time"
    assert np.array_equal(frame.index.to_numpy(), trajectory.time)
    assert np.array_equal(frame["pin.B.fy"].to_numpy(), trajectory["pin.B.fy"])


def test_angles_are_unwrapped_where_their_turns_can_be_counted() -> None:
    """An angle that wraps goes on past pi; one that is sampled too rarely, a counted angle and all else stay as they are."""
    turned = np.linspace(3.0, -8.0, 12)
    wrapped = np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi
    values, names = np.column_stack([wrapped, 2.0 * np.arange(12.0), wrapped]), ("coupler.angle", "rocker.angle")
    run = Trajectory(time=np.arange(12.0), values=values, names=(*names, "slider.position"))
    np.testing.assert_allclose(run.unwrapped("coupler.angle"), turned, atol=1e-12)
    for name in ("rocker.angle", "slider.position"):
        assert np.array_equal(run.unwrapped(name), run[name])
