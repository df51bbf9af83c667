"""Targets: curves and functions of the crank angle, from arrays, formulas and files."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import ellipe

from analysis.files import attribute_files, read_points, write_csv
from analysis.synthesis import TargetPath, curve_distance, function_from_formula, path_from_formula
from analysis.synthesis.task.target import even_odd_area, formula
from linkwork.errors import InputError, ParameterError, UnknownNameError
from tests.refusals import refused

T = np.linspace(0.0, 2.0 * pi, 400, endpoint=False)
SQUARE = TargetPath(points=np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]), closed=True)
BENT = TargetPath(points=np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]), closed=False)


def ellipse(a: float, b: float, n: int = 400) -> TargetPath:
    t = np.linspace(0.0, 2.0 * pi, n, endpoint=False)
    return TargetPath(points=np.column_stack([a * np.cos(t), b * np.sin(t)]), closed=True)


# Curves


def test_measures_of_a_square() -> None:
    assert SQUARE.length == 8.0
    assert SQUARE.enclosed_area == pytest.approx(4.0)
    # radius of gyration of a square's outline of side 2: (integral of (1 + s^2) ds from -1 to 1) / 2
    assert SQUARE.size == pytest.approx((4.0 / 3.0) ** 0.5)


def test_measures_of_an_open_curve() -> None:
    assert BENT.length == 7.0
    centroid = np.array([(3 * 1.5 + 4 * 3) / 7, 4 * 2 / 7])
    mean_square = (quad(lambda s: s**2, 0, 3)[0] + quad(lambda s: 9 + s**2, 0, 4)[0]) / 7
    assert BENT.size**2 == pytest.approx(mean_square - centroid @ centroid)
    with pytest.raises(InputError, match="open"):
        _ = BENT.enclosed_area


def test_length_and_area_converge_to_those_of_the_ellipse() -> None:
    for n, tolerance in ((100, 1e-3), (1000, 1e-5)):
        path = ellipse(0.1, 0.05, n)
        assert path.length == pytest.approx(4.0 * 0.1 * ellipe(0.75), rel=tolerance)
        assert path.enclosed_area == pytest.approx(pi * 0.005, rel=tolerance)


@pytest.mark.parametrize("path", [SQUARE, BENT, ellipse(0.1, 0.05, 37)])
def test_resampled_points_are_equally_far_along_the_polyline(path: TargetPath) -> None:
    again = path.resample(840)
    assert again.points[0] == pytest.approx(path.points[0])
    assert curve_distance(path.points, again.points, closed=path.closed) == pytest.approx(np.zeros(840), abs=1e-12)
    steps = np.hypot(*np.diff(again.points, axis=0).T)
    step = path.length / (840 if path.closed else 839)
    # equal along the way; across a corner the chord is shorter
    assert steps.max() == pytest.approx(step)
    assert np.median(steps) == pytest.approx(step, rel=1e-3)
    if not path.closed:
        assert again.points[-1] == pytest.approx(path.points[-1])


def test_points_are_copied_and_locked() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    path = TargetPath(points=points, closed=True)
    points[0] = 7.0
    assert path.points[0] == pytest.approx([0.0, 0.0])
    with pytest.raises(ValueError, match="read-only"):
        path.points[0] = 1.0


def test_even_odd_area_where_the_curve_crosses_itself() -> None:
    eight = TargetPath(points=np.column_stack([np.sin(T), np.sin(2.0 * T)]), closed=True)
    # 4 times the integral of |x y'| over a quarter: each lobe of the Lissajous figure has 4/3
    assert eight.enclosed_area == pytest.approx(8.0 / 3.0, rel=1e-3)
    # limacon r = 1 + 2 cos t: outside pi 2 + 3 sqrt3/2 (inner loop taken out: pi + 3 sqrt 3)
    r = 1.0 + 2.0 * np.cos(T)
    limacon = np.column_stack([r * np.cos(T), r * np.sin(T)])
    assert even_odd_area(limacon) == pytest.approx(pi + 3.0 * 3.0**0.5, rel=1e-3)
    # a five-pointed star in one line: the pentagon in the middle is gone round twice
    star = np.column_stack([np.cos(4.0 * pi / 5.0 * np.arange(5)), np.sin(4.0 * pi / 5.0 * np.arange(5))])
    radius = np.cos(2 * pi / 5) / np.cos(pi / 5)
    triangles = 5 * radius * np.sin(pi / 5) * (1.0 - radius * np.cos(pi / 5))
    assert even_odd_area(star) == pytest.approx(triangles, rel=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 20), st.integers(0, 20)), min_size=4, max_size=9, unique=True))
def test_even_odd_area_of_any_polygon_is_that_of_a_count_over_a_grid(corners: list[tuple[int, int]]) -> None:
    points = np.array(corners) / 20
    grid = (np.arange(200) + 0.5) / 200
    x, y = np.meshgrid(grid, grid)
    inside = np.zeros(x.shape, dtype=bool)
    for (xa, ya), (xb, yb) in zip(points, np.roll(points, -1, axis=0)):
        # vertical rays here, horizontal ones in the code
        if xa != xb:
            inside ^= ((xa > x) != (xb > x)) & (ya + (x - xa) / (xb - xa) * (yb - ya) > y)
    assert even_odd_area(points) == pytest.approx(inside.mean(), abs=0.02)


@pytest.mark.parametrize(
    ("points", "closed", "message"),
    [
        ([[0.0, 0.0], [1.0, 1.0]], True, "2 are too few, there must be at least 3"),
        ([[0.0, 0.0]], False, "1 are too few, there must be at least 2"),
        ([0.0, 1.0, 2.0], False, r"shape is \(3,\)"),
        ([[0.0, 1.0, 2.0]] * 4, False, r"shape is \(4, 3\)"),
        ([[0.0, 1.0], [2.0]], False, "not an array of numbers"),
        ([["a", "b"], ["c", "d"]], False, "not an array of numbers"),
        ([[0.0, 0.0], [1.0, np.nan], [2.0, 0.0]], False, "1 are not finite, the first at index 1"),
        ([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 3.0]], False, "indices 1 and 2"),
        ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]], True, "indices 3 and 0: the last point repeats"),
        ([[3.0, 4.0]] * 5, True, "all 5 points of the target are the same"),
        ([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]], True, "encloses no area"),
        ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 0.5], [1.0, 0.0], [0.5, 0.0]], True, "encloses no area"),
    ],
)
def test_bad_points_are_refused(points: list[list[float]], closed: bool, message: str) -> None:
    with pytest.raises(InputError, match=message):
        TargetPath(points=points, closed=closed)


def test_a_straight_open_curve_is_a_target() -> None:
    assert TargetPath(points=np.array([[0.0, 0.0], [1.0, 1.0]]), closed=False).length == pytest.approx(2**0.5)
    with pytest.raises(InputError, match="2 points are asked for"):
        SQUARE.resample(2)


# Smoothing


def noisy(path: TargetPath, sd: float, seed: int = 3) -> TargetPath:
    noise = np.random.default_rng(seed).normal(0.0, sd, path.points.shape)
    return TargetPath(points=path.points + noise, closed=path.closed)


OPEN = path_from_formula("t/10", "0.1*sin(t)", n=120, end="2*pi - 0.5")


@pytest.mark.parametrize("true", [ellipse(0.3, 0.15, 120), OPEN], ids=["closed", "open"])
def test_smoothing_takes_most_of_the_noise_away(true: TargetPath) -> None:
    sd = 2e-3
    smooth = noisy(true, sd).smooth(200)
    assert smooth.closed == true.closed
    assert len(smooth.points) == 200
    rms = float(np.sqrt(np.mean(curve_distance(true.points, smooth.points, closed=true.closed) ** 2)))
    assert rms < 0.5 * sd
    assert smooth.length == pytest.approx(true.length, rel=0.02)


@pytest.mark.parametrize("path", [ellipse(0.3, 0.15, 9), OPEN.resample(7)], ids=["closed", "open"])
def test_without_deviation_smoothing_is_the_interpolating_spline(path: TargetPath) -> None:
    from scipy.interpolate import CubicSpline

    points = np.vstack([path.points, path.points[:1]]) if path.closed else path.points
    u = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    spline = CubicSpline(u, points, bc_type="periodic" if path.closed else "natural")
    exact = spline(np.linspace(0.0, u[-1], 500))
    smooth = path.smooth(3000, deviation=1e-9)
    assert curve_distance(smooth.points, exact, closed=path.closed).max() < 1e-6


def test_smoothing_to_a_known_deviation() -> None:
    """Of points on a circle at equal steps smoothing keeps a circle, smaller by the deviation."""
    circle = ellipse(1.0, 1.0, 90)
    smooth = circle.smooth(90, deviation=0.05)
    assert np.hypot(*smooth.points.T) == pytest.approx(np.full(90, 0.95), abs=1e-4)
    straight = TargetPath(points=np.column_stack([np.arange(9.0), [0, 1, 0, 1, 0, 1, 0, 1, 0]]), closed=False)
    line = straight.smooth(30, deviation=0.49)
    assert np.ptp(line.points[:, 1]) < 0.3
    for deviation in (2.0, 0.0, float("nan")):
        with pytest.raises(InputError, match="deviation"):
            circle.smooth(90, deviation=deviation)


def test_natural_smoothing_is_scipys() -> None:
    """At equal chord lengths and a given lambda both minimise the same integral."""
    from scipy.interpolate import make_smoothing_spline

    from analysis.synthesis.task.target import _bending

    rng = np.random.default_rng(5)
    u = np.cumsum(rng.uniform(0.5, 1.5, 25))
    y = np.sin(u / 3.0) + rng.normal(0.0, 0.1, 25)
    ours = np.linalg.solve(np.eye(25) + 2.5 * _bending(np.diff(u), False), y)
    assert ours == pytest.approx(make_smoothing_spline(u, y, lam=2.5)(u), abs=1e-10)


def test_periodic_bending_is_the_integral_over_the_spline() -> None:
    from scipy.interpolate import CubicSpline

    from analysis.synthesis.task.target import _bending

    rng = np.random.default_rng(6)
    u = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, 12))])
    y = rng.normal(size=12)
    second = CubicSpline(u, np.append(y, y[0]), bc_type="periodic").derivative(2)
    # piecewise linear: Simpson's rule is exact for its square
    a, b, m = second(u[:-1]), second(u[1:]), second(0.5 * (u[1:] + u[:-1]))
    expected = np.sum(np.diff(u) / 6.0 * (a**2 + 4.0 * m**2 + b**2))
    assert y @ _bending(np.diff(u), True) @ y == pytest.approx(expected, rel=1e-10)


def test_too_few_points_to_smooth() -> None:
    with pytest.raises(InputError, match="at least 6"):
        SQUARE.smooth(50)


# Formulas


def test_ellipse_of_the_thesis_from_a_formula() -> None:
    path = path_from_formula("20 + 10*cos(t)", "15 + 5*sin(t)", n=72, unit="cm", start=0, end=2 * pi)
    t = np.radians(5.0 * np.arange(72))
    assert path.closed
    assert path.points == pytest.approx(np.column_stack([0.2 + 0.1 * np.cos(t), 0.15 + 0.05 * np.sin(t)]), abs=1e-15)


def test_open_path_from_a_formula() -> None:
    path = path_from_formula("t", "t**2", n=11, start=-1, end="1/2 + 1/2")
    assert not path.closed
    assert path.points == pytest.approx(np.column_stack([np.linspace(-1, 1, 11), np.linspace(-1, 1, 11) ** 2]))


def test_rocker_function_of_the_thesis() -> None:
    crank_angle, angle = function_from_formula("70 + 100*abs(sin(t/2))", unit="deg")
    assert crank_angle == pytest.approx(np.radians(5.0 * np.arange(72)))
    assert np.degrees(angle[[0, 36]]) == pytest.approx([70.0, 170.0])
    assert np.degrees(angle[12]) == pytest.approx(120.0)
    crank_angle, _ = function_from_formula("t", n=5, start="pi/2", end="pi")
    assert crank_angle[[0, -1]] == pytest.approx([pi / 2, pi])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2**3**2 - -t", 512.3),
        ("7 % 4 + 1/4", 3.25),
        ("atan2(1, -1) + hypot(3, 4)", 0.75 * pi + 5.0),
        ("min(t, 2) + max(t, 2) + floor(2.7) + ceil(2.1)", 7.3),
        ("degrees(pi) + radians(180) + sign(-2)", 179.0 + pi),
        ("exp(log(2)) + sqrt(4) + asin(1) + acos(1) + atan(1) + e - tau", 4.0 + 0.75 * pi + np.e - 2 * pi),
        (" sinh(t)**2 - cosh(t)**2 + tanh(0) + tan(0) + 1e3", 999.0),
    ],
)
def test_formulas_have_the_value_of_the_mathematics(text: str, value: float) -> None:
    assert formula(text)(0.3) == pytest.approx(value)
    assert formula(text)(np.full((2, 3), 0.3)).shape == (2, 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("__import__('os').system('true')", "not allowed"),
        ("t.real", "'t.real' is not allowed"),
        ("[t for t in (1, 2)]", "not allowed"),
        ("sin(t, out=t)", "not allowed"),
        ("sin(*t)", "not allowed"),
        ("True", "'True' is not allowed"),
        ("1j", "'1j' is not allowed"),
        ("1 < 2", "not allowed"),
        ("~t", "not allowed"),
        ("t^2", r"'t \^ 2' has \^, which is no power here: write \*\*"),
        ("sinn(t)", r"'sinn\(t\)' is not known: .* did you mean sin\?"),
        ("x + 1", "'x' is not known"),
        ("atan2(t)", "1 arguments: atan2 takes 2"),
        ("2 +", "cannot be read"),
        ("", "cannot be read"),
        ("a\0b", "cannot be read"),
        ("x = 1", "cannot be read"),
        ("(" * 300 + "t" + ")" * 300, "cannot be read"),
        ("-" * 990 + "t", "cannot be read|nested"),
        ("t+" * 600 + "t", "1201 characters"),
        ("1" * 400, "too large"),
        (3.0, "must be a text"),
    ],
)
def test_what_is_no_formula_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        formula(text)


def test_values_must_be_finite() -> None:
    for text, at in (("1/(t - 1)", "t = 1"), ("sqrt(t)", "t = -1"), ("9**9**9**9", "t = -1")):
        with pytest.raises(InputError, match=at):
            formula(text)([-1.0, 0.0, 1.0] if at == "t = -1" else [0.0, 1.0])


def test_bad_ranges_and_units_are_refused() -> None:
    refused(InputError, "the end must be greater", path_from_formula, "t", "t**2", start=1.0, end=0.0)
    refused(InputError, "the end must be greater", function_from_formula, "t", end=float("inf"))
    refused(InputError, "'t' is not known", path_from_formula, "t", "t**2", end="t")
    refused(ParameterError, "unit", path_from_formula, "t", "t", unit="deg")
    refused(ParameterError, "unit", function_from_formula, "t", unit="cm")
    refused(InputError, "at least 3", path_from_formula, "cos(t)", "sin(t)", n=2)


# Files


def save(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff0,0\n1,0\n1,2.5\n",
        "x,y\n0,0\n1,0\n1,2.5",
        "﻿x; y\n0; 0\n\n1; 0\n1; 2.5\n",
        "# made by hand\nx\ty\n0\t0\n1\t0\n1\t2.5\n",
        " 0   0\n 1e0 0\n 1 , 2.5\n",
        "x;y\n0,0;0\n1,0;0,0\n1;2,5\n",
        "0,0\t0\n1,0\t0,0\n1.0,\t2.5\n",
        "x;y\nmm;mm\n0,0;0\n1,0;0,0\n1;2,5\n",
        "x [mm], y\n[mm], [mm]\n0,0\n1,0\n1,2.5\n",
        'sep=;\n"x";"y"\n"mm";"mm"\n0;0\n1;0\n1;2,5\n',
    ],
)
def test_points_from_csv(tmp_path: Path, text: str) -> None:
    points, closed = read_points(save(tmp_path, "a.csv", text), unit="mm")
    assert points == pytest.approx(1e-3 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.5]]))
    assert not closed


@pytest.mark.parametrize(
    ("header", "unit", "factor"),
    [
        ("x [mm],y [mm]", None, 1e-3),
        ("x (cm),y (cm)", None, 1e-2),
        ("# x [mm],y [mm]", None, 1e-3),
        ("# x [mm] y [mm]", None, 1e-3),
        ('"x [mm]","y [mm]"', None, 1e-3),
        ("x [mm] y [mm] # drawn", None, 1e-3),
        ("x [mm],y [mm]", "mm", 1e-3),
        ("x,y", "in", 0.0254),
        ("# drawn by hand (again)", None, 1.0),
    ],
)
def test_the_unit_in_the_header_line_holds(tmp_path: Path, header: str, unit: str | None, factor: float) -> None:
    with attribute_files("synthesize") as command:
        points, _ = read_points(save(tmp_path, "a.csv", f"{header}\n0,0\n1,0\n1,2.5\n"), unit=unit)
    # what a unit is assumed for is noted
    assert ("column 1 in m and column 2 in m" in "".join(command.notes)) == (factor == 1.0)
    assert points == pytest.approx(factor * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.5]]))


@pytest.mark.parametrize(
    ("header", "unit", "si", "message"),
    [
        ("x [mm],y [mm]", "cm", "m", "in mm by its header line, which is not the unit cm"),
        ("x [mm],y [m]", None, "m", "in m by its header line, which is not the unit mm"),
        ("x [mm],y [mm]", None, "rad", "a.csv in 'mm'"),
    ],
)
def test_units_that_contradict_each_other(tmp_path: Path, header: str, unit: str, si: str, message: str) -> None:
    with pytest.raises((InputError, ParameterError), match=message):
        read_points(save(tmp_path, "a.csv", f"{header}\n0,0\n1,0\n"), unit=unit, si=si)


def test_a_csv_that_ends_where_it_began_is_closed(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", {"x": [0.0, 1.0, 1.0, 0.0], "y": [0.0, 0.0, 1.0, 0.0]})
    target = TargetPath.from_file(path)
    assert target.closed
    assert target.enclosed_area == pytest.approx(0.5)
    assert not TargetPath.from_file(path, closed=False).closed
    points, closed = read_points(save(tmp_path, "b.csv", "1,2\n1,2\n"))
    assert (points.tolist(), closed) == ([[1.0, 2.0]] * 2, False)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y\n0,0\n1\n", "line 3: '1' is not two numbers"),
        ("0,0\n1,2,3\n", "line 2"),
        ("0,0\n1,two\n", "line 2: '1,two'"),
        ("x,y\nlength,width\n1,2\n", "in 'length'"),
        ("x [mm],y [mm]\ncm,cm\n1,2\n", "line 2: the unit 'cm'"),
        ("0,0\n1,inf\n", "line 2: '1,inf' is not finite"),
        ("0,zero\n1,1\n", "line 1"),
        ("1,234.5;2,000.0\n3;4\n", "line 1"),
        ("1 234;2 000\n3;4\n", "line 1"),
        ("\u22121,2\n3,4\n", "line 1"),
        ("x,y\n", "no points"),
        ("", "no points"),
    ],
)
def test_bad_csv_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises((InputError, ParameterError), match=message):
        read_points(save(tmp_path, "a.csv", text))


SVG = """<svg xmlns="http://www.w3.org/2000/svg" {head}>
  <circle id="pin" cx="1" cy="2" r="3"/>
  <g id="drawn" transform="translate(10, 5) scale(2)"><path id="wedge" d="M 0,0 L 10,0 10,-5 Z"/></g>
  <path id="wave" d="M 0 0 C 10 10 20 -10 30 0"/>
  <path id="two" d="M 0 0 L 1 1 M 2 2 L 3 3"/>
  <path id="empty" d=""/>
</svg>"""
DRAWN = '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" viewBox="0 0 9 9">{}</svg>'
WEDGE = np.array([[10.0, -5.0], [30.0, -5.0], [30.0, 5.0]])


@pytest.mark.parametrize(
    ("head", "unit", "metres"),
    [
        ('width="100mm" height="50mm" viewBox="0 0 100 50"', None, 1e-3),
        ('width="10cm" height="5cm" viewBox="-20 -30 200 100"', None, 0.5e-3),
        ('width="10in" viewBox="0 0 100 50"', None, 2.54e-3),
        ('width="72pt" height="200pt" viewBox="0 0 100,50"', None, 0.254e-3),
        ('width="96" viewBox="0 0 100 50"', None, 0.254e-3),
        ('width="96px" viewBox="0 0 100 50"', None, 0.254e-3),
        ('width="100Q" height="50 Q" viewBox="0 0 100 50"', None, 0.25e-3),
        ('width="100MM" viewBox="0 0 100 50"', None, 1e-3),
        ('width="100mm" height="100mm" viewBox="0 0 100 50" preserveAspectRatio="xMidYMid slice"', None, 2e-3),
        ('width="6pc" viewBox="0 0 100 50"', None, 0.254e-3),
        ('width="100%" height="100%" viewBox="0 0 100 50"', None, 0.0254 / 96),
        ('width=".5in" height="1.2.3in" viewBox="0 0 100 50"', None, 0.0254 / 200),
        ('width="100mm" height="50mm" viewBox="0 0 100 50" preserveAspectRatio="none"', None, 1e-3),
        ('width="100mm" height="50mm"', None, 0.0254 / 96),
        ("", None, 0.0254 / 96),
        ('width="100mm" height="50mm" viewBox="5 5 50 25"', "cm", 1e-2),
    ],
)
def test_points_from_svg_have_the_documents_scale(tmp_path: Path, head: str, unit: str | None, metres: float) -> None:
    points, closed = read_points(save(tmp_path, "a.svg", SVG.format(head=head)), unit=unit)
    assert closed
    assert points == pytest.approx(metres * WEDGE, rel=1e-12, abs=1e-15)
    # the shoelace of a triangle on paper: clockwise in SVG's frame becomes what the eye sees
    x, y = points.T
    assert 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y) == pytest.approx(100.0 * metres**2)


def test_named_curves_of_svg(tmp_path: Path) -> None:
    path = save(tmp_path, "a.svg", SVG.format(head=""))
    assert read_points(path, unit="m", name="drawn")[0] == pytest.approx(WEDGE)
    pin, closed = read_points(path, unit="m", name="pin")
    assert closed
    assert np.hypot(pin[:, 0] - 1.0, pin[:, 1] + 2.0) == pytest.approx(np.full(len(pin), 3.0))
    assert TargetPath(points=pin, closed=True).enclosed_area == pytest.approx(9.0 * pi, rel=1e-3)
    wave, closed = read_points(path, unit="m", name="wave")
    assert not closed
    s = np.linspace(0.0, 1.0, 500)
    exact = np.column_stack([30.0 * s, -30.0 * s * (1 - s) * (1 - 2 * s)])
    assert curve_distance(wave, exact, closed=False).max() < 30.0 * 1e-4
    assert len(wave) < 200
    refused(UnknownNameError, "did you mean wave", read_points, path, name="waves")
    refused(InputError, "two has 2 curves", read_points, path, name="two")
    refused(InputError, "empty has 0 curves", read_points, path, name="empty")


@pytest.mark.parametrize(
    ("before", "name", "end"),
    [
        ('<mask id="m"><path d="M0 0L1 1"/></mask>', None, 7.0),
        ('<marker><path d="M0 0L1 1"/></marker>', None, 7.0),
        ('<g><symbol id="s"><path d="M0 0L1 1"/></symbol></g>', None, 7.0),
        ('<symbol id="s"><path d="M0 0L1 1"/></symbol><use href="#s" x="3"/>', None, 4.0),
        ('<mask id="m"><path id="inner" d="M0 0L1 1"/></mask>', "inner", 1.0),
        ('<g visibility="hidden"><path id="gone" d="M0 0L1 1"/></g>', None, 7.0),
        ('<g visibility="hidden"><path id="gone" d="M0 0L1 1"/></g>', "gone", 1.0),
        ('<path style="transform-origin: 50% 50%" d="M0 0L5 1"/>', None, 5.0),
        ('<path transform="rotate(90)" transform-origin="0 0px" d="M0 0L1 -5"/>', None, 5.0),
        ('<path d="m0,0a5-5.0.0 015,5z"/>', None, 0.0),
    ],
)
def test_the_first_path_that_is_seen_is_read(tmp_path: Path, before: str, name: str | None, end: float) -> None:
    path = save(tmp_path, "a.svg", DRAWN.format(f'{before}<path d="M0 0L7 1"/>'))
    points, closed = read_points(path, name=name)
    assert (points[0] if closed else points[-1])[0] == pytest.approx(1e-3 * end)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<svg", "not valid SVG"),
        ("<html/>", "not valid SVG"),
        ('<svg xmlns="http://www.w3.org/2000/svg"/>', "no path"),
        (SVG.format(head='width="9mm" height="1mm" viewBox="0 0 1 1" preserveAspectRatio="none"'), "stretched"),
        (SVG.format(head='width="9mm" height="1mm" viewBox="0 0 0 1"'), "viewBox"),
        (SVG.format(head='width="9mm" height="1mm" viewBox="0 0 one 1"'), "not valid SVG|viewBox"),
        (SVG.format(head='width="9em" viewBox="0 0 1 1"'), "'9em' wide or high"),
        (DRAWN.format('<path id="cut" d="M0 0L1 1L2"/>'), "the path cut has a mistake in its 'd', at 'L2'"),
        (DRAWN.format('<path d="M0 0L1 1X2 2L3 3"/>'), "the path has a mistake in its 'd', at 'X2 2L3 3'"),
        (DRAWN.format('<path d="M0 0a1 1 0 2 0 3 3"/>'), "mistake in its 'd', at 'a1 1 0 2 0 3 3'"),
        (DRAWN.format('<path d="L1 1 2 2"/>'), "mistake in its 'd', at 'L1 1 2 2'"),
        (DRAWN.format('<polyline points="0,0 1,1 2"/>'), "mistake in its 'points', at '2'"),
        (DRAWN.format('<path transform="rotate(90)" transform-origin="5 5" d="M0 0L1 1"/>'), "origin:5 5"),
        (DRAWN.format('<path style="transform-origin:center" transform="scale(2)" d="M0 0L1 1"/>'), "origin:center"),
        (DRAWN.format("<style>.a{transform:scale(2); transform-box: fill-box}</style>"), "transform-box: fill-box"),
    ],
)
def test_bad_svg_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_points(save(tmp_path, "a.svg", text))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    refused(InputError, "cannot be read", read_points, tmp_path / "none.csv")
    refused(InputError, r"'\.xls'", read_points, tmp_path / "a.xls")
    refused(InputError, "cannot be selected", read_points, save(tmp_path, "a.csv", "0,0\n1,1\n"), name="curve")
    refused(ParameterError, "unit", read_points, save(tmp_path, "a.csv", "0,0\n1,1\n"), unit="kg")
    for content, encoding in ((b"\xe4,0", "UTF-8"), (b"\xff\xfe0", "UTF-16")):
        (tmp_path / "b.csv").write_bytes(content)
        refused(InputError, f"it is not text in {encoding}; save it as UTF-8", read_points, tmp_path / "b.csv")
