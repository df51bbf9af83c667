"""Work and precision (`benchmarks.precision`): its pictures, and that lanes cost less."""

from analysis.numerics.vectors import LANES
from benchmarks import precision
from benchmarks.precision import ACCURACY, OURS, Point


def test_times_are_told_beside_ours_at_the_accuracy() -> None:
    ours = [Point(1e-3, 1.0), Point(0.9 * ACCURACY, 2.0), Point(1e-9, 4.0)]
    other = [Point(float("inf"), 9.0), Point(1e-4, 20.0), Point(1e-8, 40.0)]
    assert precision.least_time_at_accuracy(ours) == 2.0
    shown = precision.picture({name: {OURS: ours, "other": other} for name in ("constant-speed", "torsion-bar")})
    lines = {line.get_label(): line.get_xydata().tolist() for line in shown.axes[0].lines}
    assert lines[OURS] == [[0.5, 1e-3], [1.0, 0.9 * ACCURACY], [2.0, 1e-9]]
    # a run that failed is no point
    assert lines["other"] == [[10.0, 1e-4], [20.0, 1e-8]]


def test_a_run_costs_less_among_many_and_in_lanes() -> None:
    rows = precision.costs(100)
    assert [count for count, *_ in rows] == [1, 10, 100]
    assert rows[-1][1] < 0.5 * rows[0][1]
    assert rows[-1][1] < rows[-1][2] or LANES == 1
    precision.cost_picture(rows)
