"""What a designer sees of a solution: plots, drawing, table, report."""

from dataclasses import replace
from math import acos, cos, degrees, hypot, pi, radians, sin
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image
from shapely.geometry import LineString, MultiPoint, Point, Polygon

import analysis.synthesis as syn
from analysis import figures
from analysis.figures.synthesis import LONGEST, magnification
from analysis.files import read_points, save_drawing, save_figure
from analysis.files.drawings import Polyline
from analysis.numerics.fourier import FourierSeries
from analysis.synthesis.result import report
from analysis.synthesis.result.output import rounded_hull
from linkwork.errors import AssemblyError, InputError, ParameterError
from tests.linkages import ellipse, outline

PHI = syn.turn(24)
ELLIPSE = ellipse(24)
#: A crank-rocker near the constrained optimum of the thesis's first ellipse.
LINKAGE = syn.Linkage(
    pivot_x=0.2, pivot_y=-0.06, ground_length=0.3, crank_length=0.05, coupler_length=0.215,
    rocker_length=0.215, point_distance=0.21, ground_angle=radians(-45.0), crank_phase=radians(45.0),
    point_angle=radians(-178.0), branch=-1,
)  # fmt: skip
#: It cannot turn fully: the longest link and the shortest are more than the other two.
SWINGING = replace(LINKAGE, crank_length=0.25, ground_length=0.35)
SLIDING = replace(LINKAGE, pivot=syn.SliderMotion(FourierSeries([0.01, 0.02], [0.0, 0.01]), radians(20.0)))
#: Of plates: what is given but for the linkage.
PLATES = {"width": 0.02, "thickness": 0.005, "pin": 0.008}
GEARED = LINKAGE.with_pivot(syn.SecondCrank(0.02, 2.0, 0.3))


def timed(linkage: syn.Linkage = LINKAGE) -> syn.Solution:
    return syn.Solution.from_linkage(syn.TimedPath(points=ELLIPSE), linkage)


def untimed(closed: bool = True) -> syn.Solution:
    points = ELLIPSE if closed else ELLIPSE[:9]
    task = outline(points, closed=closed)
    return syn.Solution.from_linkage(task, LINKAGE, None if closed else np.linspace(0.1, 2.0, 9))


def rocker() -> syn.Solution:
    task = syn.RockerFunction(angle=2.0 + 0.4 * np.sin(PHI))
    return syn.Solution.from_linkage(task, replace(LINKAGE, point_distance=0.0))


def axis_of(figure, label):
    return next(axis for axis in figure.axes if axis.get_ylabel().replace("\n", " ").startswith(label))


def drawn(axis, label):
    return next(line for line in axis.lines if line.get_label().startswith(label)).get_xydata()


# Plots


def test_the_panels_of_a_path_show_target_path_errors_and_transmission_angle() -> None:
    solution = timed()
    figure = figures.plot(solution, title="ellipse")
    assert figure.get_suptitle() == "ellipse"
    linkage, task, errors, transmission = figure.axes
    assert [a.get_xlabel() for a in figure.axes] == ["x [mm]", "x [mm]", "crank rotation [deg]", "crank rotation [deg]"]
    np.testing.assert_allclose(drawn(task, "target"), 1e3 * ELLIPSE)
    path = drawn(task, "path")
    np.testing.assert_allclose(path, 1e3 * LINKAGE.path(np.linspace(0.0, 2.0 * np.pi, len(path))))
    # vectors from each target to the path, magnified by what the legend says
    vectors = drawn(task, "error").reshape(-1, 3, 2)
    label = next(line.get_label() for line in task.lines if line.get_label().startswith("error"))
    factor = float(label.split("x ")[1].rstrip(")"))
    np.testing.assert_allclose(vectors[:, 0], 1e3 * ELLIPSE)
    np.testing.assert_allclose((vectors[:, 1] - vectors[:, 0]) / factor, 1e3 * (LINKAGE.path(PHI) - ELLIPSE), atol=1e-9)
    np.testing.assert_allclose(errors.lines[0].get_ydata(), 1e3 * np.hypot(*(LINKAGE.path(PHI) - ELLIPSE).T))
    # the angle at C by the law of cosines
    x, y = transmission.lines[0].get_xydata().T
    for phi, angle in zip(np.radians(x[::90]), y[::90]):
        b = LINKAGE.pins(float(phi))["B"]
        d = LINKAGE.pins(0.0)["D"]
        l3, l4 = LINKAGE.coupler_length, LINKAGE.rocker_length
        expected = acos((l3**2 + l4**2 - hypot(b[0] - d[0], b[1] - d[1]) ** 2) / (2.0 * l3 * l4))
        assert angle == pytest.approx(degrees(expected))
    assert {text.get_text() for text in linkage.texts} == set("ABCDP")


def test_letters_stand_clear_of_the_links_and_of_each_other() -> None:
    for solution in (timed(), timed(SLIDING), timed(GEARED), rocker()):
        axis = figures.plot(solution).axes[0]
        places = {t.get_text(): np.array(t.get_position()) for t in axis.texts}
        pins = {name: 1e3 * np.array(place) for name, place in solution.linkage.pins(0.0).items()}
        everything = np.array(list(pins.values()))
        unit = float(np.ptp(everything, axis=0).max()) / 42.0
        for name, place in places.items():
            assert np.hypot(*(place - pins[name])) < 4.0 * unit
            for start, end in ("AB", "BC", "CD"):
                along = np.linspace(pins[start], pins[end], 400)
                assert np.hypot(*(along - place).T).min() > 0.5 * unit, (name, start + end)
        names = list(places)
        for k, first in enumerate(names):
            for second in names[k + 1 :]:
                assert np.hypot(*(places[first] - places[second])) > unit


def test_a_function_of_the_rocker_is_shown_with_its_target() -> None:
    solution = rocker()
    figure = figures.plot(solution)
    panel = axis_of(figure, "rocker angle")
    np.testing.assert_allclose(drawn(panel, "target"), np.degrees(np.column_stack([PHI, 2.0 + 0.4 * np.sin(PHI)])))
    x, y = np.radians(drawn(panel, "rocker")).T
    np.testing.assert_allclose(np.exp(1j * y), np.exp(1j * solution.linkage.rocker_angle(x)))
    np.testing.assert_allclose(axis_of(figure, "error").lines[-1].get_ydata(), np.degrees(solution.evaluation.errors))
    # there is no coupler point
    assert "P" not in {text.get_text() for text in figure.axes[0].texts}


def test_a_function_of_the_slider_is_shown_over_the_crank_rotation(tmp_path: Path) -> None:
    """With the slider's position where the task has its zero."""
    made = syn.SliderCrank(
        pivot_x=-0.1, pivot_y=0.02, ground_length=0.02, crank_length=0.05, coupler_length=0.17, point_distance=0.17,
        ground_angle=-0.5 * pi, crank_phase=0.2,
    )  # fmt: skip
    at = np.radians([0.0, 30.0, 60.0, 90.0])
    position = made.path(at)[:, 0] + [1e-3, -1e-3, 2e-3, 0.0]
    solution = syn.Solution.from_linkage(syn.SliderFunction(position=position, rotation=at), made)
    figure = figures.plot(solution)
    panel = axis_of(figure, "slider position x")
    np.testing.assert_allclose(drawn(panel, "target"), np.column_stack([np.degrees(at), 1e3 * position]))
    x, y = drawn(panel, "slider").T
    np.testing.assert_allclose(x[np.isfinite(y)][[0, -1]], [0.0, 90.0], atol=0.5)
    np.testing.assert_allclose(y[np.isfinite(y)], 1e3 * made.path(np.radians(x[np.isfinite(y)]))[:, 0], atol=1e-9)
    assert sum("position" in axis.get_ylabel() for axis in figure.axes) == 1
    assert "C lies to the left of B, seen along ground_angle" in syn.report(solution)
    assert figures.animate(solution, tmp_path / "slider.gif", frames=3).exists()


@pytest.mark.parametrize(("linkage", "label"), [(SLIDING, "slider position [mm]"), (GEARED, "second crank [deg]")])
def test_a_moved_pivot_is_drawn_and_its_motion_shown(linkage, label) -> None:
    figure = figures.plot(timed(linkage))
    panel = axis_of(figure, label.split(" ")[0])
    assert panel.get_ylabel().replace("\n", " ") == label
    x, y = panel.lines[0].get_xydata().T
    pivot = linkage.pivot
    expected = 1e3 * pivot.series(np.radians(x)) if linkage is SLIDING else np.degrees(pivot.angle(np.radians(x)))
    np.testing.assert_allclose(y, expected)
    assert ("E" in {text.get_text() for text in figure.axes[0].texts}) == (linkage is GEARED)


def test_the_guide_spans_the_travel_of_the_slider() -> None:
    scene = syn.LinkageScene(timed(SLIDING))
    places = np.array([SLIDING.pins(float(phi))["D"] for phi in np.linspace(0.0, 2.0 * np.pi, 400)])
    along = (scene.guide[1] - scene.guide[0]) / hypot(*(scene.guide[1] - scene.guide[0]))
    travel = (places - scene.guide[0]) @ along
    assert travel.min() == pytest.approx(0.0, abs=1e-6)
    assert travel.max() == pytest.approx(SLIDING.pivot.stroke, rel=1e-4)
    np.testing.assert_allclose(scene.guide[0] + travel[:, None] * along, places, atol=1e-12)


def test_the_block_is_drawn_as_a_rectangle_along_its_guide() -> None:
    tilted = replace(SLIDING, pivot=replace(SLIDING.pivot, guide_angle=0.5))
    drawn = syn.drawing(timed(tilted), 1.0)
    (line,) = (one for one in drawn.lines if one.layer == "guide")
    (block,) = (one for one in drawn.polylines if one.layer == "slider")
    guide = np.subtract(line.end, line.start)
    sides = np.roll(block.points, -1, axis=0) - block.points
    assert [abs(sides[k] @ sides[k - 1]) for k in range(4)] == pytest.approx([0.0] * 4, abs=1e-12)
    assert abs(sides[0] @ guide) == pytest.approx(hypot(*sides[0]) * hypot(*guide))
    assert hypot(*sides[0]) == pytest.approx(1.5 * hypot(*sides[1]))
    assert block.points.mean(axis=0) == pytest.approx(tilted.pins(1.0)["D"])


@pytest.mark.parametrize(("distance", "angle"), [(1.0, 0.0), (0.4, 0.0), (1.7, 0.0), (0.5, pi), (0.0, 0.0), (0.5, 0.7)])
@pytest.mark.parametrize("kind", ["four-bar", "slider-crank"])
def test_no_part_of_the_coupler_is_drawn_twice(kind: str, distance: float, angle: float) -> None:
    links = {"crank_length": 0.05, "coupler_length": 0.2, "point_distance": 0.2 * distance, "point_angle": angle}
    if kind == "four-bar":
        linkage = syn.Linkage(ground_length=0.25, rocker_length=0.2, **links)
    else:
        linkage = syn.SliderCrank(ground_length=0.02, **links)
    solution = syn.Solution.from_linkage(syn.TimedPath(points=linkage.path(syn.turn(12)) + 1e-3), linkage)
    drawn, pins = syn.drawing(solution, 1.0), linkage.pins(1.0)
    bare = syn.drawing(solution, 1.0, poses=1)
    lines = [LineString([line.start, line.end]) for line in drawn.lines if line.layer == "coupler"]
    outlines = [Polygon(one.points).exterior for one in drawn.polylines if one.layer == "coupler"]
    there = [LineString(one.points) for one in bare.polylines if one.layer == "poses"]
    for parts in (lines + outlines, there):
        # a tenth of a millimetre to each side
        strips = [part.buffer(1e-4, cap_style="flat") for part in parts]
        shared = sum(one.intersection(other).area for k, one in enumerate(strips) for other in strips[:k])
        assert shared < 1e-6
    assert all(min(part.distance(Point(pins[pin])) for part in lines + outlines) < 1e-12 for pin in "BCP")
    assert sum(len(one.points) for one in bare.polylines if one.layer == "poses") >= 4


def test_a_linkage_that_cannot_turn_fully_is_drawn_where_it_is_joined() -> None:
    task = syn.Motion(points=ELLIPSE[:4], angle=np.zeros(4), rotation=[-0.3, -0.1, 0.1, 0.3])
    solution = syn.Solution.from_linkage(task, SWINGING)
    scene = syn.LinkageScene(solution)
    assert not solution.verdicts.full_turn
    assert scene.curves
    assert all(np.isfinite(piece).all() for piece in scene.curves)
    assert np.isnan(scene.transmission[1]).any()
    figure = figures.plot(solution)
    assert [a.get_ylabel() for a in figure.axes if "angle [deg]" in a.get_ylabel()][-1] == "error of angle [deg]"
    # the drawing refuses what is not finite
    assert syn.drawing(solution).polylines
    with pytest.raises(AssemblyError, match="cannot be joined at a crank rotation of 3"):
        syn.drawing(solution, 3.0)


@given(st.floats(1e-9, 1e9), st.floats(1e-6, 1e6))
@example(120.0, 1e-6)
def test_error_vectors_are_magnified_as_far_as_they_stay_short(worst: float, extent: float) -> None:
    factor = magnification(worst, extent)
    if worst <= 1e-9 * extent or worst > LONGEST * extent:
        assert factor == 1.0
        return
    assert factor * worst <= LONGEST * extent * (1.0 + 1e-9)
    digit = round(factor / 10.0 ** np.floor(np.log10(factor) + 1e-9))
    assert digit in (1, 2, 5)
    # the next greater one is too long
    assert factor * {1: 2.0, 2: 2.5, 5: 2.0}[digit] * worst > LONGEST * extent * (1.0 - 1e-9)


def test_alternatives_have_a_panel_each_under_their_errors(tmp_path) -> None:
    solutions = (timed(), timed(replace(LINKAGE, crank_length=0.048)), timed(SLIDING), timed(GEARED))
    result = syn.Synthesis(task=solutions[0].task, solutions=solutions, method="scan", seed=0, starts=4, seconds=1.0)
    figure = figures.plot(result, title="all")
    shown = [axis for axis in figure.axes if axis.get_visible()]
    assert [axis.get_title().split(":")[0] for axis in shown] == ["1", "2", "3", "4"]
    assert f"sum of squared errors {1e6 * solutions[0].error:.4g} mm²" in shown[0].get_title()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["crank", "coupler", "rocker", "target", "path"]
    with pytest.raises(InputError, match="no linkages"):
        figures.plot(replace(result, solutions=()))
    rows = np.genfromtxt(result.to_csv(tmp_path / "all.csv"), delimiter=",", names=True, deletechars="")
    np.testing.assert_allclose(rows["quality_[m2]"], [s.error for s in solutions])
    np.testing.assert_allclose(rows["crank_length_[m]"], [0.05, 0.048, 0.05, 0.05])


def test_a_trade_off_marks_limits_without_a_linkage(tmp_path) -> None:
    solutions = (None, timed(), timed(replace(LINKAGE, crank_length=0.048)))
    traded = syn.TradeOff(over="size", limit=np.array([0.1, 0.3, 1.0]), solutions=solutions)
    figure = figures.plot(traded)
    expected = ([1e6 * s.error for s in solutions[1:]], [1e3 * s.evaluation.worst for s in solutions[1:]])
    for axis, values in zip(figure.axes, expected):
        curve, none = axis.lines
        np.testing.assert_allclose(curve.get_xdata(), [100.0, 300.0, 1000.0])
        np.testing.assert_allclose(curve.get_ydata()[1:], values)
        np.testing.assert_allclose(none.get_xdata(), [100.0])
    assert figure.axes[-1].get_xlabel() == "limit of the largest link [mm]"
    rows = np.genfromtxt(traded.to_csv(tmp_path / "t.csv"), delimiter=",", names=True, deletechars="")
    np.testing.assert_allclose(rows["limit_of_largest_link_[m]"], [0.3, 1.0])
    with pytest.raises(syn.InfeasibleError, match="at any of the limits"):
        figures.plot(syn.TradeOff(over="size", limit=np.array([0.1, 0.2]), solutions=(None, None)))


@pytest.mark.parametrize("solution", [timed(SLIDING), rocker()])
def test_an_animation_is_a_turn_in_so_many_pictures(tmp_path, solution) -> None:
    path = figures.animate(solution, tmp_path / "turn.gif", title="a turn", frames=4)
    with Image.open(path) as picture:
        assert picture.n_frames == 4
    with pytest.raises(InputError, match="at least 2"):
        figures.animate(solution, path, frames=1)


# Drawing


def test_the_drawing_is_at_real_size(tmp_path) -> None:
    solution = timed()
    sheet = syn.drawing(solution, 1.0, title="ellipse")
    pins = LINKAGE.pins(1.0)
    lengths = {line.layer: hypot(line.end[0] - line.start[0], line.end[1] - line.start[1]) for line in sheet.lines}
    assert lengths == pytest.approx({"ground": 0.3, "crank": 0.05, "rocker": 0.215})
    triangle = next(p for p in sheet.polylines if p.layer == "coupler")
    np.testing.assert_allclose(triangle.points, [pins["B"], pins["C"], pins["P"]])
    assert {t.text: t.layer for t in sheet.texts} == dict.fromkeys("ABCDP", "text")
    # what is written can be read back: the curve from SVG, links from DXF in mm
    curve, closed = read_points(save_drawing(tmp_path / "a.svg", sheet), name="coupler-curve")
    assert closed
    np.testing.assert_allclose(curve, LINKAGE.path(syn.turn(len(curve))), atol=1e-9)
    document = ezdxf.readfile(save_drawing(tmp_path / "a.dxf", sheet))
    crank = next(e for e in document.modelspace() if e.dxf.layer == "crank" and e.dxftype() == "LINE")
    assert (crank.dxf.end - crank.dxf.start).magnitude == pytest.approx(50.0)
    assert sum(e.dxf.layer == "target" for e in document.modelspace()) == len(ELLIPSE)
    measured = sorted(e.get_measurement() for e in document.modelspace().query("DIMENSION"))
    assert measured == pytest.approx(sorted([300.0, 50.0, 215.0, 215.0, 210.0]))


def test_circles_of_dense_targets_leave_the_curve_to_be_seen() -> None:
    dense = LINKAGE.path(np.linspace(0.0, 2.0 * np.pi, 200))
    circles = syn.drawing(syn.Solution.from_linkage(syn.TimedPath(points=dense), LINKAGE)).circles
    covered = sum(2.0 * one.radius for one in circles if one.layer == "target")
    assert 0.0 < covered < np.linalg.norm(np.diff(dense, axis=0), axis=1).sum()


@pytest.mark.parametrize("point_angle", [-178.0, 0.0, 12.0])
@pytest.mark.parametrize("rotation", [0.0, 1.0, 3.0])
def test_numbers_of_dimensions_cover_neither_each_other_nor_other_dimensions(point_angle, rotation) -> None:
    dimensions = syn.drawing(timed(replace(LINKAGE, point_angle=radians(point_angle))), rotation).dimensions
    assert len(dimensions) == 5
    for one in dimensions:
        (x0, y0), (x1, y1) = one.line
        # a circle as wide as half a number of five digits
        number = Point(0.5 * (x0 + x1), 0.5 * (y0 + y1)).buffer(1.3 * one.height)
        assert not any(number.intersects(LineString(other.line)) for other in dimensions if other is not one)


def test_targets_that_are_met_have_no_curve_of_rounding() -> None:
    task = syn.Motion(points=LINKAGE.path(PHI[:5]), angle=LINKAGE.coupler_angle(PHI[:5]), rotation=PHI[:5])
    figure = figures.plot(syn.Solution.from_linkage(task, LINKAGE))
    assert [axis for axis in figure.axes if "error" in axis.get_ylabel()] == []
    assert "rounding" in figure.get_supxlabel()
    assert len(figure.axes) == 3
    assert not any("error" in text.get_text() for a in figure.axes if (of := a.get_legend()) for text in of.get_texts())


def test_further_positions_run_through_no_number_of_a_dimension() -> None:
    case = syn.load_synthesis_case(Path(__file__).parents[2] / "examples" / "four-poses.toml")
    drawn = syn.drawing(syn.guidance(case.task, 1).solutions[0], poses=6)
    thin = [LineString(line.points) for line in drawn.polylines if line.layer == "poses"]
    assert len(thin) == 12
    for dimension in drawn.dimensions:
        (x0, y0), (x1, y1) = dimension.line
        number = Point(0.5 * (x0 + x1), 0.5 * (y0 + y1)).buffer(1.3 * dimension.height)
        assert not any(number.intersects(line) for line in thin)


def test_the_drawing_of_moved_pivots_and_of_curves() -> None:
    layers = {item.layer for item in syn.drawing(timed(SLIDING)).polylines}
    assert {"slider", "coupler-curve"} <= layers
    assert any(line.layer == "guide" for line in syn.drawing(timed(SLIDING)).lines)
    cranks = [line for line in syn.drawing(timed(GEARED)).lines if line.layer == "crank"]
    assert sorted(hypot(c.end[0] - c.start[0], c.end[1] - c.start[1]) for c in cranks) == pytest.approx([0.02, 0.05])
    for closed in (True, False):
        target = next(p for p in syn.drawing(untimed(closed)).polylines if p.layer == "target")
        assert target.closed is closed
    flat = timed(replace(LINKAGE, point_angle=0.0))
    assert not any(p.layer == "coupler" for p in syn.drawing(flat).polylines)


def test_further_positions_are_those_of_the_linkage() -> None:
    solution = timed()
    thin = [p.points for p in syn.drawing(solution, poses=4).polylines if p.layer == "poses"]
    assert len(thin) == 8
    first = solution.rotation[0]
    for number, points in enumerate(thin[::2]):
        pins = LINKAGE.pins(float(first + 0.5 * np.pi * number))
        np.testing.assert_allclose(points, [pins[name] for name in "ABCD"], atol=1e-12)


def test_plates_have_holes_at_the_pins_and_their_distances(tmp_path) -> None:
    cut = syn.plates(timed(), **PLATES, title="plates")
    document = ezdxf.readfile(save_drawing(tmp_path / "p.dxf", cut))
    assert not document.audit().errors
    space = document.modelspace()
    measured = sorted(round(e.get_measurement(), 6) for e in space.query("DIMENSION"))
    side = abs(0.215 - 0.21 * np.exp(1j * radians(-178.0)))
    assert measured == pytest.approx(sorted([300.0, 50.0, 215.0, 215.0, 210.0, 1e3 * side]))
    assert [e.dxf.radius for e in space.query("CIRCLE")] == pytest.approx([4.0] * 9)
    outlines = [p for p in cut.polylines if p.layer == "plate"]
    assert len(outlines) == 4
    # a plate with two holes: a rectangle between half circles
    crank = Polygon(flatten(outlines[1]))
    assert crank.area == pytest.approx(0.05 * 0.02 + np.pi * 0.01**2, rel=1e-3)
    for plate_outline in outlines:
        plate = Polygon(flatten(plate_outline))
        inside = [Point(c.centre) for c in cut.circles if plate.contains(Point(c.centre))]
        assert inside
        for hole in inside:
            assert plate.exterior.distance(hole) == pytest.approx(0.01, rel=2e-3) or len(inside) == 3
            assert plate.exterior.distance(hole) > 0.0099


@pytest.mark.parametrize("corner", [0.1 + 0.08j, 0.1 - 0.08j, 0.3 + 0.0j, 0.1 + 0.0j])
def test_a_plate_is_the_hull_of_its_pins_widened(corner: complex) -> None:
    pins = np.array([0.0j, 0.2 + 0.0j, corner])
    points, bulges = rounded_hull(pins, 0.01)
    plate = Polygon(flatten(Polyline(layer="plate", points=points, bulges=bulges, closed=True)))
    hull = MultiPoint([(z.real, z.imag) for z in pins]).convex_hull.buffer(0.01, quad_segs=64)
    assert plate.symmetric_difference(hull).area < 1e-3 * hull.area


def flatten(outline) -> np.ndarray:
    """Points along a polyline with arcs, by their centres."""
    points = outline.points @ np.array([1.0, 1j])
    out = []
    for start, bulge, end in zip(points, outline.bulges, np.roll(points, -1)):
        out.append([start])
        if bulge:
            turned = 4.0 * np.arctan(bulge)
            centre = 0.5 * (start + end) + 0.5j * (end - start) / np.tan(0.5 * turned)
            out.append(centre + (start - centre) * np.exp(1j * turned * np.linspace(0.0, 1.0, 40)[1:-1]))
    z = np.concatenate(out)
    return np.column_stack([z.real, z.imag])


def test_plates_of_other_kinds() -> None:
    texts = [t.text for t in syn.plates(timed(GEARED), **PLATES).texts]
    assert {"ground", "second crank", "crank", "coupler", "rocker"} <= {text.split(":")[0] for text in texts}
    assert any("geared 2 : 1 to the first" in text for text in texts)
    assert not any("ground" in t.text for t in syn.plates(timed(SLIDING), **PLATES).texts)
    two = syn.plates(rocker(), **PLATES)
    assert len(two.circles) == 8
    with pytest.raises(ParameterError, match="below the width"):
        syn.plates(timed(), width=0.02, thickness=0.005, pin=0.02)


def test_svg_of_plates_has_arcs_and_numbers(tmp_path) -> None:
    text = save_drawing(tmp_path / "p.svg", syn.plates(timed(), **PLATES)).read_text()
    # half circles, to the left in a drawing whose y points down
    assert "A 10 10 0 0 0" in text
    assert ">50</text>" in text
    assert ">300</text>" in text


def test_the_sheet_shows_the_largest_pin_forces(tmp_path) -> None:
    solution = timed()
    forces = syn.pin_forces(solution.linkage, syn.MachineSpec(speed=6.0))
    figure = figures.plot_sheet(solution, forces, title="sheet", made="bars")
    assert tuple(figure.get_size_inches() * 25.4) == pytest.approx((297.0, 210.0))
    panel = axis_of(figure, "pin force")
    for pin, force, line in zip("ABCD", forces.force.T, panel.lines, strict=True):
        np.testing.assert_allclose(line.get_ydata(), force)
        assert line.get_label() == f"{pin}: {force.max():.3g} N at most"
    assert save_figure(figure, tmp_path / "sheet.pdf").read_bytes().startswith(b"%PDF")
    assert not any("pin force" in a.get_ylabel() for a in figures.plot_sheet(solution).axes)


# Tables and report


@pytest.mark.parametrize("closed", [True, False])
def test_the_columns_of_an_untimed_path_are_its_nearest_points(closed) -> None:
    solution = untimed(closed)
    c = solution.columns()
    made = np.column_stack([c["path x [m]"], c["path y [m]"]])
    wanted = np.column_stack([c["target x [m]"], c["target y [m]"]])
    # as far as the polygon of 360 chords is from the curve
    np.testing.assert_allclose(np.hypot(*(made - wanted).T), c["error [m]"], atol=5e-6)
    at = c["crank rotation [rad]"]
    np.testing.assert_allclose(LINKAGE.path(at), made)
    if not closed:
        assert at.min() >= 0.1
        assert at.max() <= 2.0


def test_an_open_path_may_be_judged_from_any_number_of_rotations() -> None:
    # the curve is a part of the linkage's own: the stations lie on it
    points = LINKAGE.path(np.linspace(0.1, 2.0, 9))
    task = outline(points, closed=False)
    few, many = (syn.Solution.from_linkage(task, LINKAGE, np.linspace(0.1, 2.0, n)) for n in (2, 50))
    assert syn.assess(few).dimensions == syn.assess(many).dimensions
    assert len(figures.plot_sheet(few).axes) == 4


def test_what_an_error_in_a_dimension_costs() -> None:
    solution = timed()
    d = 1e-4
    left = LINKAGE.path(PHI) - ELLIPSE
    dear = syn.costs(solution, d, radians(0.1))
    # moving the whole linkage by d: the sum of |e + d|^2 - |e|^2, the worse of the two ways
    for name, column in (("pivot_x", left[:, 0]), ("pivot_y", left[:, 1])):
        assert dear[name] == pytest.approx(len(PHI) * d * d + 2.0 * d * abs(column.sum()), rel=1e-9)
    # turning it about A by an angle
    turned = radians(0.1)
    grown = []
    for side in (-turned, turned):
        arm = LINKAGE.path(PHI) - [LINKAGE.pivot_x, LINKAGE.pivot_y]
        way = arm @ np.array([[cos(side), sin(side)], [-sin(side), cos(side)]]) - arm
        grown.append(((left + way) ** 2).sum() - (left**2).sum())
    assert dear["ground_angle"] == pytest.approx(max(grown), rel=1e-9)
    # a linkage at its limit of assembly
    tight = replace(LINKAGE, ground_length=0.215 + 0.215 - 0.05 - 1e-5)
    assert syn.costs(timed(tight), d, turned)["ground_length"] == np.inf


def test_the_report_tells_dimensions_verdicts_and_errors() -> None:
    solution = timed()
    text = syn.report(solution)
    assert str(solution.verdicts) in text
    assert f"{1e6 * solution.error:.6g} mm²" in text
    row = next(line for line in text.splitlines() if line.startswith("crank_length")).split()
    assert row[1:3] == ["50", "mm"]
    assert "rounded to 0.1 mm and 0.1 deg" in text
    stations = text.split("\n\n")[-1].splitlines()
    assert len(stations) == 1 + len(PHI)
    assert float(stations[3].split()[6]) == pytest.approx(1e3 * solution.evaluation.errors[2], abs=1e-4)
    # where the rotation is free its start is no dimension
    assert "crank_phase" not in syn.report(untimed())
    function = rocker()
    squares = (np.degrees(function.evaluation.errors) ** 2).sum()
    assert f"sum of squared errors of angle: {squares:.6g} deg²" in syn.report(function)
    shown = [line.split() for line in syn.report(function).split("\n\n")[-1].splitlines()]
    angles = np.degrees(np.column_stack(list(function.columns().values())))
    np.testing.assert_allclose([[float(cell) for cell in row[1:]] for row in shown[1:]], angles, atol=6e-5)
    assert f"slider at D: stroke {1e3 * SLIDING.pivot.stroke:.6g} mm" in syn.report(timed(SLIDING))
    assert "second crank at D: 2 turns" in syn.report(timed(GEARED))


def test_the_least_mechanical_advantage_lies_between_targets_that_are_dead_centres() -> None:
    swing = syn.synthesize(syn.QuickSwing(swing="110 deg", time_ratio=1.05), constraints=[]).best
    turned = np.linspace(0.0, 2.0 * pi, 4001)
    fastest = np.abs(np.gradient(np.unwrap(swing.linkage.rocker_angle(turned)), turned)).max()
    assert f"per torque on the crank: at least {1.0 / fastest:.3g} during the task" in syn.report(swing)
    # the slow part takes 1.1/2.1 of a turn, clockwise if the swing is
    for way in (1, -1):
        swing = syn.synthesize(syn.QuickSwing(swing=f"{60 * way} deg", time_ratio=1.1), constraints=[]).best
        assert f"rocker at rest at crank rotations of 0.00, {way * 360 * 1.1 / 2.1:.2f} deg" in syn.report(swing)


@pytest.mark.parametrize(("direction", "other"), [(1.0, "57.30"), (-1.0, "-302.70")])
@pytest.mark.parametrize("zero", [0.0, 1e-9, 2.0 * pi - 1e-9])
def test_a_rotation_of_zero_is_not_printed_as_a_turn(direction: float, other: str, zero: float) -> None:
    line = report._rotation_line("rocker at rest", (zero, 1.0), direction)
    assert line == f"\nrocker at rest at crank rotations of 0.00, {other} deg"


def test_a_crank_that_cannot_turn_on_has_no_advantage_in_its_toggle() -> None:
    rocker = replace(LINKAGE, crank_length=0.9 * LINKAGE.ground_length, coupler_length=0.8 * LINKAGE.rocker_length)
    at = np.linspace(0.0, 2.0 * pi, 24, endpoint=False)
    assert not rocker.turns_fully
    solution = syn.Solution.from_linkage(syn.RockerFunction(angle=np.sin(at), rotation=at), rocker)
    assert "per torque on the crank: at least 0 during the task" in syn.report(solution)


@pytest.mark.parametrize("turns", [-1, 0, 2])
def test_a_rocker_is_drawn_and_listed_in_the_turn_of_its_targets(turns: int) -> None:
    at = np.radians([0.0, 20.0, 40.0, 60.0])
    task = syn.RockerFunction(angle=LINKAGE.rocker_angle(at) + 2.0 * pi * turns, rotation=at)
    solution = syn.Solution.from_linkage(task, LINKAGE)
    np.testing.assert_allclose(solution.columns()["rocker angle [rad]"], task.angle, atol=1e-9)
    drawn = syn.LinkageScene(solution).function
    assert drawn is not None
    np.testing.assert_allclose(np.interp(at, *drawn), np.asarray(task.angle), atol=1e-4)


def test_free_rotations_start_near_zero_and_equal_errors_lie_within_the_picture() -> None:
    """As those of a straight line that is given by its two ends."""
    at = np.array([0.5, 1.2])
    ends = LINKAGE.path(at) + np.array([[1e-3, 0.0], [-1.0001e-3, 0.0]])
    task = outline(ends, closed=False)
    solution = syn.Solution.from_linkage(task, LINKAGE, at + 4.0 * pi)
    np.testing.assert_allclose(solution.rotation, at, atol=1e-14)
    panel = axis_of(figures.plot(solution), "error")
    assert panel.get_ylim()[1] > 1.04e3 * solution.evaluation.worst


def test_plates_too_short_for_their_holes_say_so() -> None:
    short = timed(replace(LINKAGE, crank_length=0.007))
    assert syn.crowded_plates(short, 0.008) == ("crank",)
    assert syn.crowded_plates(short, 0.006) == ()
    texts = [t.text for t in syn.plates(short, **PLATES).texts]
    assert [text.partition(":")[0] for text in texts if "overlap" in text] == ["crank"]


def test_the_largest_link_is_what_the_constraint_bounds() -> None:
    """The coupler plate from B to P counts, where the task has points."""
    long = replace(LINKAGE, point_distance=2.0 * LINKAGE.largest_link)
    found = syn.Solution.from_linkage(syn.TimedPath(points=long.path(syn.turn(12))), long)
    assert f"largest link {1e3 * long.point_distance:.6g} mm" in syn.report(found)
    angle = syn.RockerFunction(angle=long.rocker_angle(syn.turn(12)))
    assert syn.Solution.from_linkage(angle, long).largest_link == LINKAGE.largest_link
