"""Pictures of responses, charts and basins: what is drawn is what was computed, by Matplotlib and in pages."""

import json
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation

from analysis import figures
from analysis.figures import Curve, HeatMap, Panel, Picture, html
from analysis.figures.curves import Arrow, Label, Shade
from analysis.periodic import Basins, Crossing, Response, Risk

from .periodic_branches import branch, hysteresis, response
from .test_figures import stand_clear


@pytest.fixture(scope="module")
def folded() -> Response:
    """A curve with two folds, and a motion of twice the period with a doubling beside it."""
    x = np.linspace(99.0, 101.0, 40)
    doubling = (Crossing.PERIOD_DOUBLING, 100.0, 5.5, 19)
    return response(hysteresis(), branch(x, 5.0 + 0.5 * (x - 99.0), np.where(x < 100.0, 0.9, 1.1), [doubling], turns=2))


@pytest.fixture(scope="module")
def axes(folded: Response) -> list[Axes]:
    return figures.plot(folded, title="folded").axes


def shaded(axis: Axes) -> list[tuple[float, float]]:
    """Ranges that are shaded over the whole height."""
    boxes = [p for p in axis.patches if isinstance(p, Rectangle) and (p.get_y(), p.get_height()) == (0.0, 1.0)]
    return sorted((p.get_x(), p.get_x() + p.get_width()) for p in boxes)


def annotations(axis: Axes) -> Iterator[Annotation]:
    yield from (text for text in axis.texts if isinstance(text, Annotation))


def read(page: str) -> dict[str, Any]:
    """The figure of a page."""
    figure: dict[str, Any] = json.loads(page.rpartition('Plotly.newPlot("picture", ')[2].partition(");</script>")[0])
    return figure


# A response


def test_shaded_ranges_are_those_that_were_computed(folded: Response, axes: list[Axes]) -> None:
    expected = sorted((a.low, a.high) for a in folded.speeds_to_avoid)
    assert {a.risk for a in folded.speeds_to_avoid} >= {Risk.SEVERAL}
    for axis in axes:
        assert shaded(axis) == [pytest.approx(span) for span in expected]
    legend = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert {f"avoid: {a.risk.value}" for a in folded.speeds_to_avoid} <= set(legend)
    # not told by colour alone
    hatches = {p.get_hatch() for p in axes[0].patches if isinstance(p, Rectangle) and p.get_height() == 1.0}
    assert len(hatches) == len({a.risk for a in folded.speeds_to_avoid})


def test_arrows_go_where_the_machine_jumps(folded: Response, axes: list[Axes]) -> None:
    bare = [a for a in annotations(axes[0]) if not a.get_text()]
    arrows = {(float(a.xyann[0]), round(float(a.xyann[1]), 2), round(float(a.xy[1]), 1)) for a in bare}
    # up from 1 m at 102 to 4 m, down from 3 m at 98 to 0; in millimetres
    assert arrows == {(102.0, 1000.0, 4000.0), (98.0, 3000.0, 0.0)}
    texts = {a.get_text(): a.xy for a in annotations(axes[0]) if a.get_text()}
    assert texts["1000 mm only below 102;\nrising, it jumps to 4000 mm"] == (102.0, 1000.0)
    assert any(text.startswith("3000 mm only above 98;\nfalling, it jumps to ") for text in texts)
    assert texts["doubling, 100"] == (100.0, 5500.0)


def test_stability_and_special_points_are_told_without_colours(folded: Response, axes: list[Axes]) -> None:
    curve = folded.branches[0]
    solid, dashed = (line for line in axes[0].lines if len(line.get_xdata()) == len(curve))
    unstable = curve.largest_multiplier > 1.0
    assert (solid.get_linestyle(), dashed.get_linestyle()) == ("-", "--")
    assert (np.isnan(solid.get_ydata()) == unstable).all()
    assert dashed.get_ydata()[unstable] == pytest.approx(1e3 * curve.amplitude[unstable])
    # the dashed line meets the solid one on both sides
    assert np.isfinite(dashed.get_ydata()).sum() == unstable.sum() + 2
    marks = {line.get_marker(): line.get_xydata().tolist() for line in axes[0].lines if line.get_marker() in "sD"}
    assert marks == {"s": [[102.0, 1000.0], [98.0, 3000.0]], "D": [[100.0, 5500.0]]}
    assert next(line.get_label() for line in axes[0].lines if line.get_marker() == "$2$") == "period of 2 turns"


def test_the_legend_counts_the_turns_of_the_crank() -> None:
    """Of a gear that is back after three turns the plain period has three."""
    x = np.linspace(99.0, 101.0, 40)
    axes = figures.plot(response(*(branch(x, n + x, 0.5, turns=n, common=3) for n in (1, 2)))).axes
    keys = [(line.get_label(), line.get_marker()) for line in axes[0].lines if "period" in str(line.get_label())]
    assert keys == [("period of 3 turns", "None"), ("period of 6 turns", "$6$")]
    assert "3 turns [mm]" in axes[1].get_ylabel()


def test_harmonics_have_their_numbers(folded: Response, axes: list[Axes]) -> None:
    harmonics = axes[1]
    assert harmonics.get_ylabel() == "harmonics of u,\none turn [mm]"
    assert harmonics.get_yscale() == "log"
    curve = folded.branches[0]
    for order, share in ((1, 900.0), (2, 100.0)):
        (letters,) = (line for line in harmonics.lines if line.get_marker() == f"${order}$")
        x, y = letters.get_data()
        assert letters.get_label() == f"harmonic {order}"
        at = np.searchsorted(curve.amplitude, y / share)
        assert curve.parameter[at.clip(0, len(curve) - 1)] == pytest.approx(x, abs=0.2)
        assert (curve.largest_multiplier[at.clip(0, len(curve) - 1)] < 1.0).all()


def test_errors_have_gaps_where_no_motion_is_stable(folded: Response) -> None:
    lower = folded.branches[0]
    _, _, errors, *_ = figures.plot_branches([lower], beside=lambda p: {"a": 1.02 * p}).axes
    (line,) = errors.lines
    x, y = line.get_data()
    gap = int(np.flatnonzero(np.isnan(x)).item())
    # of the small motion first, up to the fold at 102, and of the large one from that at 98
    assert np.nanmax(x[:gap]) == pytest.approx(102.0, abs=1e-2)
    assert np.nanmin(x[gap:]) == pytest.approx(98.0, abs=1e-2)
    order = np.flatnonzero(lower.parameter == x[3])[0]
    assert y[3] == pytest.approx(100.0 * abs(1.02 * x[3] / lower.amplitude[order] - 1.0))
    assert np.isnan(y).sum() == 1


def test_a_single_stable_motion_is_named_and_nothing_shaded() -> None:
    x = np.linspace(1.0, 2.0, 30)
    main, *_ = figures.plot(response(branch(x, 1.0 + 0.01 * x, 0.5))).axes
    assert [text.get_text() for text in main.get_legend().get_texts()] == ["stable motion"]
    assert not shaded(main)
    assert not list(annotations(main))


def test_peaks_that_stand_out_have_speed_and_amplitude() -> None:
    x = np.linspace(-1.0, 1.0, 41)
    for largest, expected in ((0.5, ["peak, 10.07: 2000 mm"]), (2.0, [])):
        main, *_ = figures.plot(response(branch(10.07 + x, 2.0 - (x - 0.0) ** 2, largest))).axes
        assert [a.get_text() for a in annotations(main) if a.get_text()] == expected


@pytest.mark.parametrize("count", [1, 12])
def test_letters_of_points_cover_neither_each_other_nor_their_curve(count: int) -> None:
    x = np.linspace(0.0, 10.0, 300)
    labels = [Label(x=place, y=np.sin(place), text=f"point {place:.2f}") for place in np.linspace(1.0, 9.0, count)]
    panel = Panel(x_label="x", y_label="y", curves=[Curve(x=x, y=np.sin(x))], labels=labels)
    figure = figures.plot_curves([panel], title="")
    (axis,) = figure.axes
    boxes = [super(Annotation, text).get_window_extent() for text in annotations(axis)]
    stand_clear(axis, boxes)
    inside = axis.get_window_extent()
    assert all(inside.x0 <= box.x0 and box.x1 <= inside.x1 for box in boxes)


# Pages


def test_page_has_the_same_values_to_full_precision(folded: Response) -> None:
    picture = figures.picture(folded, title="folded & <b>")
    figure = read(figures.to_html(picture))
    drawn = [(part, curve) for part in picture.parts for curve in part.curves]
    # a curve of letters has a line for its key in the legend, just before it
    lettered = [n for n, trace in enumerate(figure["data"]) if trace["mode"] == "text"]
    keys = [key for n in lettered if (key := figure["data"][n - 1])["x"] == [None]]
    assert [(key["name"], key["mode"]) for key in keys] == [(f"harmonic {n}", "lines") for n in (1, 2)]
    values = [trace for trace in figure["data"] if trace not in keys]
    assert len(values) == len(drawn)
    for trace, (part, curve) in zip(values, drawn):
        x, y = np.atleast_1d(np.asarray(curve.x, dtype=float)), np.atleast_1d(np.asarray(curve.y, dtype=float))
        finite = np.isfinite(y)
        points = [(a, b) for a, b in zip(trace["x"], trace["y"]) if b is not None]
        assert points == list(zip(x[finite].tolist(), y[finite].tolist()))
        assert trace["name"] == curve.label
        assert part.x_label in trace["hovertemplate"]
    main = figure["data"][next(n for n, (_, curve) in enumerate(drawn) if len(np.atleast_1d(curve.x)) == 400)]
    at = main["x"].index(float(folded.branches[0].parameter[3]))
    names = [row.partition(":")[0] for row in main["hovertemplate"].removesuffix("<extra></extra>").split("<br>")]
    said = dict(zip(names[2:], main["customdata"][at]))
    assert names[:2] == ["p", "amplitude of slider position u [mm]"]
    torque = 2.0 * folded.branches[0].amplitude[3]
    assert said == {
        "branch": 1, "turns in a period": 1, "stability": "stable", "largest multiplier": 0.5,
        "greatest crank torque [N.m]": torque,
    }  # fmt: skip
    spans = sorted((shape["x0"], shape["x1"]) for shape in figure["layout"]["shapes"] if shape["xref"] == "x")
    assert spans == sorted((a.low, a.high) for a in folded.speeds_to_avoid)
    assert figure["layout"]["title"]["text"] == "folded &amp; &lt;b&gt;"


def test_page_loads_nothing_and_is_the_same_each_time(folded: Response) -> None:
    page = figures.to_html(folded, title="</script>")
    assert page == figures.to_html(folded, title="</script>")
    own = page.partition("<script>")[0] + page.rpartition("</head>")[2]
    assert not any(word in own for word in ("src=", "href=", "http"))
    assert own.count("</script>") == 1
    assert "<title>&lt;/script&gt;</title>" in own


def test_page_has_all_that_a_panel_may_have() -> None:
    ring = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 2.0]])
    panel = Panel(
        x_label="x",
        y_label="two\nlines",
        curves=[Curve(x=[1.0, 2.0, 3.0], y=[1.0, np.nan, 100.0], hover={"name": ["a", "b", "c"]}, line=(0, (5, 1)))],
        verticals={"here": 2.0},
        dashed=[2.5],
        x_ticks=[1.0, 3.0],
        x_range=(1.0, 3.0),
        y_range=(0.1, 1000.0),
        logarithmic="y",
        equal=True,
        filled=[[ring]],
        shades=[Shade(low=1.0, high=1.5, label="shade"), Shade(low=2.0, high=2.5, label="shade")],
        labels=[Label(x=1.0, y=10.0, text="a\nlabel")],
        arrows=[Arrow(x=2.0, begin=1.0, end=100.0)],
    )
    figure = html.to_plotly(Picture(parts=[panel, panel], title="", columns=2, notes=["a note"]))
    area, line, *_ = figure["data"]
    assert area["x"][:4] == [0.0, 1.0, 1.0, 0.0]
    assert (line["y"], line["customdata"]) == ([1.0, None, 100.0], [("a",), ("b",), ("c",)])
    assert line["line"]["dash"] == "longdash"
    layout = figure["layout"]
    assert (layout["xaxis2"]["range"], layout["yaxis2"]["range"]) == ([1.0, 3.0], [-1.0, 3.0])
    assert (layout["xaxis2"]["tickvals"], layout["yaxis2"]["scaleanchor"]) == ([1.0, 3.0], "x2")
    assert layout["xaxis"]["domain"][1] < layout["xaxis2"]["domain"][0]
    kinds = [(shape["type"], shape["x0"], "name" in shape) for shape in layout["shapes"] if shape["xref"] == "x"]
    assert kinds == [("rect", 1.0, True), ("rect", 2.0, False), ("line", 2.0, False), ("line", 2.5, False)]
    note, arrow, label, *_ = layout["annotations"]
    assert note["text"] == "a note"
    assert (arrow["y"], arrow["ay"], arrow["ayref"]) == (2.0, 0.0, "y")
    assert (label["y"], label["text"]) == (1.0, "a<br>label")


# Maps


def map_of(values: Any, **options: Any) -> HeatMap:
    """A map over three by two points."""
    panel = Panel(x_label="x [rpm]", y_label="y", legend_at="above")
    places = {"x": np.array([1.0, 2.0, 3.0]), "y": np.array([0.0, 1.0])}
    return HeatMap(panel=panel, **places, values=np.ma.masked_invalid(values), label="z", **options)


def test_sides_of_a_value_and_what_is_missing_are_in_the_legend() -> None:
    values = [[0.5, 1.5, np.nan], [0.9, 1.1, 1.0]]
    words = np.array([["stable", "unstable", "not found"], ["stable", "unstable", "marginal"]])
    chart = map_of(values, sides=("stable", "unstable"), missing="not found", hover={"motion": words})
    (axis,) = figures.plot_curves([chart], title="").axes
    entries = dict(zip((t.get_text() for t in axis.get_legend().get_texts()), axis.get_legend().get_patches()))
    assert list(entries) == ["stable", "unstable", "not found"]
    assert [bool(patch.get_hatch()) for patch in entries.values()] == [False, True, False]
    figure = html.to_plotly(Picture(parts=[chart], title=""))
    heat, *keys = figure["data"]
    assert heat["z"] == [[0.5, 1.5, None], [0.9, 1.1, 1.0]]
    assert [[cell[0] for cell in row] for row in heat["customdata"]] == words.tolist()
    assert [key["name"] for key in keys] == ["stable", "unstable", "not found"]
    # the middle of the colours is white at 1, however the values lie
    scale = dict(heat["colorscale"])
    white = min(scale, key=lambda place: abs(heat["zmin"] + place * (heat["zmax"] - heat["zmin"]) - 1.0))
    assert min(int(scale[white][n : n + 2], 16) for n in (1, 3, 5)) > 230


def test_classes_have_colours_and_hatches_of_their_own() -> None:
    classes = {"a": "#ff0000", "b": "#00ff00", "c": "#0000ff"}
    chart = map_of([[0.0, 1.0, 1.0], [2.0, 2.0, np.nan]], classes=classes, middle=None)
    (axis,) = figures.plot_curves([chart], title="").axes
    mesh = axis.collections[0]
    assert [mesh.to_rgba(n)[:3] for n in range(3)] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    assert [t.get_text() for t in axis.get_legend().get_texts()] == ["a", "b", "c", "no value"]
    assert len({patch.get_hatch() for patch in axis.get_legend().get_patches()[:3]}) == 3
    assert not axis.child_axes
    # what is hatched is where the class is
    areas = {area.hatches[0]: area.get_paths()[0] for area in axis.collections[1:]}
    assert [area.contains_point((2.5, 0.1)) for area in areas.values()] == [True, False]
    assert [area.contains_point((1.3, 0.95)) for area in areas.values()] == [False, True]
    heat = html.to_plotly(Picture(parts=[chart], title=""))["data"][0]
    low, high = heat["zmin"], heat["zmax"]
    for n, colour in enumerate(classes.values()):
        place = (n - low) / (high - low)
        assert [step[1] for step in heat["colorscale"] if step[0] <= place][-1] == colour
    assert not heat["showscale"]


class _Motion(SimpleNamespace):
    """What is read of an orbit, which is itself alone."""

    __eq__ = object.__eq__
    __hash__ = object.__hash__


def test_basins_name_the_motion_that_a_start_ends_in() -> None:
    components = (("q", "m"), ("q'", "m/s"))
    flow = SimpleNamespace(components=components, size=2, period=2.0 * np.pi, angle_periods=np.zeros(2))
    motions = [
        _Motion(
            start=np.array([0.1 * n, 0.0]), amplitude=0.01 * n, largest=0.5, swing=("q", "m"), flow=flow, turns=turns,
            periods=turns, crank_turns=2 * turns, turn=lambda samples, turns=turns: SimpleNamespace(period=turns / 7.0),
        )
        for n, turns in ((1, 1), (2, 1), (3, 4))
    ]  # fmt: skip
    found = Basins(
        position=np.array([0.0, 1.0]),
        rate=np.array([0.0, 1.0]),
        ends=np.array([[0, 1], [-1, 0]]),
        found=SimpleNamespace(orbits=tuple(motions), stable=(motions[0], motions[2])),  # type: ignore[arg-type]
        computed=0,
    )
    picture = figures.picture(found, title="rig")
    assert picture.title == "rig: basins at 420 rpm"
    (part,) = picture.parts
    said = part.hover["it"]
    assert said[0][0] == said[1][1] == "ends in motion 1, amplitude of q 10 mm"
    assert said[0][1] == "ends in motion 2 of 8 turns, amplitude of q 30 mm"
    assert said[1][0] == "comes to the limit of assembly"
    assert list(part.classes) == [said[0][0], said[0][1], said[1][0]]
    assert part.values.tolist() == [[0, 1], [2, 0]]
    stable, unstable = part.panel.curves
    assert (list(stable.x), list(unstable.x)) == ([pytest.approx(100), pytest.approx(300)], [pytest.approx(200)])
