"""The figure of tolerances draws what it is given, in the units it says, and tells what a reader must know."""

from __future__ import annotations

from dataclasses import replace
from math import erf, pi, radians, sqrt, tau
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle, StepPatch

from analysis.figures.slider_crank import ToleranceScene, plot_tolerances
from analysis.slider_crank.forces import ConstantShift, force_turn
from analysis.slider_crank.tolerances import SHIFT, Tolerance, monte_carlo
from linkwork.errors import InputError
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, INCH, parameters

ANGLES = np.linspace(0.0, tau, 25)


def made(**changes: Any) -> ToleranceScene:
    """A scene of made-up numbers, each of which can be told from the others."""
    sigma = 1e-4 * (2.0 + np.cos(ANGLES))
    edges = np.linspace(-1e-3, 1e-3, 81)
    share = np.array([0.5 * (1.0 + erf(x / (3e-4 * sqrt(2.0)))) for x in edges])
    scene = ToleranceScene(
        quantity="slider.position",
        unit="m",
        angle=ANGLES,
        deviation=sigma,
        worst=4.0 * sigma,
        departures=np.array([-2.9, -1.9, 0.0, 1.9, 2.9])[:, None] * sigma,
        mean=0.1 * sigma,
        at=0,
        nominal=1.25,
        edges=edges,
        counts=(1e6 * np.diff(share)).round().astype(np.int64),
        sample_deviation=2.95e-4,
        second_deviation=3.05e-4,
        shares={"first": (0.7, 0.69), "second": (0.2998, 0.3098), "third": (0.0002, 0.0002)},
        samples=1_000_000,
        not_assembled=0,
    )
    return replace(scene, **changes)


def texts(figure: Figure) -> str:
    return "\n".join(text.get_text() for text in figure.findobj(match=lambda x: hasattr(x, "get_text")))


def panels(figure: Figure) -> tuple[Axes, Axes, Axes]:
    above, left, right = (axis for axis in figure.findobj(Axes))
    return above, left, right


def line(axis: Axes, label: str) -> Any:
    (found,) = (x for x in axis.lines if x.get_label() == label)
    return found


def test_band_over_the_turn_in_mm() -> None:
    scene = made()
    band, _, _ = panels(plot_tolerances(scene, title="A title"))
    assert band.get_ylabel() == "error of slider position [mm]"
    assert band.get_xlabel() == "crank angle [deg]"
    assert line(band, "linear, worst case").get_ydata() == pytest.approx(4e3 * scene.deviation)
    samples = line(band, "samples, 0.135 % and 99.865 %")
    assert samples.get_xdata() == pytest.approx(np.linspace(0.0, 360.0, 25))
    assert samples.get_ydata() == pytest.approx(2.9e3 * scene.deviation)
    assert line(band, "samples, 2.3 % and 97.7 %").get_ydata() == pytest.approx(1.9e3 * scene.deviation)
    assert line(band, "mean of the samples").get_ydata() == pytest.approx(1e2 * scene.deviation)
    lowest = {round(float(np.min(np.asarray(x.get_ydata()))), 12) for x in band.lines}
    assert {round(-k * 0.3, 12) for k in (1.9, 2.9, 4.0)} < lowest
    (filled,) = band.collections
    corners = filled.get_paths()[0].vertices
    assert np.asarray(corners)[:, 1].max() == pytest.approx(3e3 * scene.deviation.max())
    assert np.asarray(corners)[:, 1].min() == pytest.approx(-3e3 * scene.deviation.max())


def test_histogram_beside_the_normal_estimate() -> None:
    scene = made()
    figure = plot_tolerances(scene)
    _, histogram, _ = panels(figure)
    (steps,) = (x for x in histogram.patches if isinstance(x, StepPatch))
    assert steps.get_data().values == pytest.approx(scene.counts / 1e6)
    assert steps.get_data().edges == pytest.approx(1e3 * scene.edges)
    normal = line(histogram, "linear estimate, normal")
    at_bins = np.interp(0.5e3 * (scene.edges[1:] + scene.edges[:-1]), normal.get_xdata(), normal.get_ydata())
    # the samples were made of the same distribution: 3e-4 m is the deviation at 0 deg
    assert at_bins == pytest.approx(scene.counts / 1e6, abs=5e-5)
    marks = sorted(float(np.asarray(x.get_xdata())[0]) for x in histogram.lines if x.get_linestyle() == "--")
    assert marks == pytest.approx([-0.9, 0.9])
    assert histogram.get_title().startswith("at 0 deg, nominal 1250 mm; 99.9%")
    told = texts(figure)
    for words in ("of the samples 0.295 mm", "linear 0.3 mm", "to second order 0.305 mm"):
        assert words in told


def bars(axis: Axes) -> dict[str, list[float]]:
    """Widths of the bars by the label of their place, from above."""
    labels = {i: text.get_text() for i, text in enumerate(axis.get_yticklabels())}
    found: dict[str, list[float]] = {}
    for patch in sorted((x for x in axis.patches if isinstance(x, Rectangle)), key=lambda x: -x.get_y()):
        found.setdefault(labels[round(patch.get_y() + 0.5 * patch.get_height())], []).append(patch.get_width())
    return found


def test_shares_largest_on_top() -> None:
    figure = plot_tolerances(made())
    _, _, shares = panels(figure)
    assert bars(shares) == {"first": [0.7], "second": [0.2998], "third": [0.0002]}
    assert list(bars(shares)) == ["first", "second", "third"]
    assert shares.get_title() == "share in the variance, linear"
    told = texts(figure)
    for words in ("70.0%", "30.0%", "< 0.1%"):
        assert words in told


def test_shares_to_second_order_where_they_say_something_else() -> None:
    both = plot_tolerances(made(shares={"a": (0.1, 0.6), "b": (0.9, 0.4)}))
    assert bars(panels(both)[2]) == {"a": [0.1, 0.6], "b": [0.9, 0.4]}
    nan = float("nan")
    second = plot_tolerances(made(shares={"a": (nan, 0.6), "b": (nan, 0.4)}))
    assert bars(panels(second)[2]) == {"a": [0.6], "b": [0.4]}
    assert "to second order" in texts(second)
    neither = plot_tolerances(made(shares={"a": (nan, nan)}))
    assert "no variance to first or second order" in texts(neither)


def test_foot_tells_what_must_be_known() -> None:
    assert "1,000,000 samples at each angle; all can be assembled." in texts(plot_tolerances(made()))
    told = texts(plot_tolerances(made(not_assembled=12_300, notes=("the estimate is off", "mind the gap"))))
    assert "at worst 1.23% of them cannot be assembled, and are left out." in told
    assert "The estimate is off.\nMind the gap." in told


def test_poles_are_cut_off_and_told() -> None:
    peak = 1.0 + 1e4 * np.exp(-(((ANGLES - pi) / 0.1) ** 2))
    scene = made(departures=made().departures * peak, singular=(pi,))
    band, _, _ = panels(plot_tolerances(scene))
    assert "dead centres, cut off" in band.get_xlabel()
    top = band.get_ylim()[1]
    assert 1e3 * np.median(scene.worst) < top < 20e3 * np.median(scene.worst)
    assert any(np.asarray(x.get_xdata()).tolist() == [180.0, 180.0] for x in band.lines)
    # without a peak all is shown
    whole, _, _ = panels(plot_tolerances(made()))
    assert whole.get_ylim()[1] > 1e3 * made().worst.max()


def test_forces_are_shown_in_their_unit() -> None:
    figure = plot_tolerances(made(quantity="crank_pin.fx", unit="N"))
    band, histogram, _ = panels(figure)
    assert band.get_ylabel() == histogram.get_xlabel() == "error of crank pin fx [N]"
    assert line(band, "mean of the samples").get_ydata() == pytest.approx(0.1 * made().deviation)
    assert "Tolerances: crank pin fx" in texts(figure)


def test_scene_of_a_monte_carlo() -> None:
    turn = force_turn(
        parameters(10.0), crank_speed=CRANK_SPEED, shift=ConstantShift(3.5 * INCH), angles=ANGLES, torque=CRANK_TORQUE
    )
    tolerances = [Tolerance("guide.offset", 5e-4), Tolerance(SHIFT, 5e-4, distribution="uniform")]
    found = monte_carlo(turn, tolerances, samples=3000, quantities=("slider.position", "slider.load"))
    scene = found.scene("slider.position", radians(31.0))
    assert np.degrees(ANGLES[scene.at]) == pytest.approx(30.0)
    assert scene.nominal == turn.slider_position[scene.at]
    spread, linear = found.spreads["slider.position"], found.estimates["slider.position"]
    assert scene.departures == pytest.approx((spread.percentiles - linear.nominal).data)
    assert scene.edges == pytest.approx(spread.edges[scene.at] - scene.nominal)
    assert sum(share for share, _ in scene.shares.values()) == pytest.approx(1.0)
    assert list(scene.shares) == ["guide.offset $a_4$", "shift.position $S_1$"]
    assert scene.singular == ()
    load = found.scene("slider.load")
    assert load.singular == pytest.approx([c.crank_angle for c in turn.singularities])
    for drawn in (scene, load):
        assert len(panels(plot_tolerances(drawn))) == 3


def test_next_to_a_dead_centre_there_is_no_estimate_to_draw() -> None:
    common: dict[str, Any] = {"crank_speed": CRANK_SPEED, "shift": ConstantShift(3.5 * INCH)}
    centre = force_turn(parameters(10.0), **common).dead_centres[0].crank_angle
    turn = force_turn(parameters(10.0), angles=[0.5, 1.0, centre + 1e-5], torque=CRANK_TORQUE, **common)
    found = monte_carlo(turn, [Tolerance("guide.offset", 5e-4)], samples=2000, quantities=("slider.load",))
    figure = plot_tolerances(found.scene("slider.load", centre))
    assert "no variance: a dead centre is within the tolerances" in texts(figure)
    assert "linear estimate" not in texts(figure)
    _, histogram, _ = panels(figure)
    assert "linear estimate: no spread" not in [x.get_label() for x in histogram.lines]


def test_where_the_linear_estimate_has_no_spread() -> None:
    turn = force_turn(parameters(0.0), crank_speed=CRANK_SPEED, angles=ANGLES)
    scene = monte_carlo(turn, [Tolerance(SHIFT, 5e-3)], samples=3000).scene("slider.position", 0.5 * pi)
    figure = plot_tolerances(scene)
    assert "linear estimate: no spread" in texts(figure)
    assert "linear 0 mm" in texts(figure)
    assert "its first derivatives vanish" in texts(figure)


def test_other_units() -> None:
    figure = plot_tolerances(made(), shown=("in", 1.0 / 0.0254))
    band, histogram, _ = panels(figure)
    assert band.get_ylabel() == histogram.get_xlabel() == "error of slider position [in]"
    assert line(band, "mean of the samples").get_ydata() == pytest.approx(0.1 * made().deviation / 0.0254)
    assert "nominal 49.2126 in" in histogram.get_title()


def test_angles_that_were_left_out_are_a_gap() -> None:
    kept = np.delete(np.arange(25), [4, 5, 6, 7])
    scene = made()
    cut = {name: getattr(scene, name)[..., kept] for name in ("angle", "deviation", "worst", "departures", "mean")}
    band, _, _ = panels(plot_tolerances(replace(scene, **cut, breaks=(3,))))
    for label in ("linear, worst case", "samples, 0.135 % and 99.865 %", "mean of the samples"):
        drawn = line(band, label)
        assert np.flatnonzero(np.isnan(drawn.get_ydata())).tolist() == [4]
        assert np.delete(np.asarray(drawn.get_xdata()), 4) == pytest.approx(np.degrees(cut["angle"]))
    (filled,) = band.collections
    assert len(filled.get_paths()) == 2


def test_one_angle_is_no_band() -> None:
    with pytest.raises(InputError, match="two angles at least, not 1"):
        plot_tolerances(made(angle=np.array([0.3])))
