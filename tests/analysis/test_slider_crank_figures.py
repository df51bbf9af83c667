"""The figure of tolerances draws what it is given, in the units it says, and says what a reader must know."""

from dataclasses import replace
from math import erf, pi, radians, sqrt, tau
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle, StepPatch

from analysis.figures import plot
from analysis.slider_crank import SHIFT, ConstantShift, Estimate, MonteCarlo, Spread, Tolerance, force_turn, monte_carlo
from analysis.units import INCH
from linkwork.errors import InputError
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, parameters

ANGLES = np.linspace(0.0, tau, 25)
SIGMA = 1e-4 * (2.0 + np.cos(ANGLES))
EDGES = np.linspace(-1e-3, 1e-3, 81)
NOMINAL = 1.25
TOLERANCES = (Tolerance("rod.length", 1e-3), Tolerance("guide.offset", 1e-3), Tolerance("crank.mass", 1e-3))


def made(quantity: str = "slider.position", peak: Any = 1.0, shares: Any = (), **changes: Any) -> MonteCarlo:
    """Samples of made-up numbers, each of which can be told from the others; ``shares`` to first and to second order."""
    share = np.array([0.5 * (1.0 + erf(x / (3e-4 * sqrt(2.0)))) for x in EDGES])
    first, second = np.array(shares or [(0.7, 0.69), (0.2998, 0.3098), (0.0002, 0.0002)]).T
    departures = peak * np.array([-2.9, -1.9, 0.0, 1.9, 2.9])[:, None] * SIGMA
    each, array = np.ones(25), np.ma.masked_invalid
    spread = Spread(
        mean=array(NOMINAL + 0.1 * SIGMA),
        deviation=array(2.95e-4 * each),
        percentiles=array(NOMINAL + departures),
        least=array(NOMINAL - SIGMA),
        greatest=array(NOMINAL + SIGMA),
        edges=np.tile(NOMINAL + EDGES, (25, 1)),
        counts=np.tile((1e6 * np.diff(share)).round().astype(np.int64), (25, 1)),
    )
    estimate = Estimate(
        nominal=array(NOMINAL * each),
        deviation=array(SIGMA),
        worst=array(4.0 * SIGMA),
        shares=array(np.tile(first[:, None], 25)),
        second_mean=array(NOMINAL * each),
        second_deviation=array(3.05e-4 * each),
        second_shares=array(np.tile(second[:, None], 25)),
    )
    values: dict[str, Any] = {
        "turn": force_turn(parameters(10.0), crank_speed=1.0, angles=ANGLES),
        "tolerances": TOLERANCES[: len(first)],
        "samples": 1_000_000,
        "seed": 0,
        "spreads": {quantity: spread},
        "estimates": {quantity: estimate},
        "not_assembled": np.zeros(25, dtype=np.int64),
        "undetermined": np.zeros(25, dtype=np.int64),
    }
    return MonteCarlo(**values | changes)


def texts(figure: Figure) -> str:
    return "\n".join(text.get_text() for text in figure.findobj(match=lambda x: hasattr(x, "get_text")))


def panels(figure: Figure) -> tuple[Axes, Axes, Axes]:
    above, left, right = (axis for axis in figure.findobj(Axes))
    return above, left, right


def line(axis: Axes, label: str) -> Any:
    (found,) = (x for x in axis.lines if x.get_label() == label)
    return found


@pytest.mark.parametrize(
    ("quantity", "units", "name", "unit", "factor"),
    [
        ("slider.position", "SI", "slider position", "mm", 1e3),
        ("slider.position", "inch", "slider position", "in", 1.0 / INCH),
        ("crank_pin.fx", "SI", "crank pin fx", "N", 1.0),
    ],
)
def test_the_band_over_the_turn_is_in_its_unit(quantity: str, units: str, name: str, unit: str, factor: float) -> None:
    figure = plot(made(quantity), quantity, units=units)
    band, histogram, _ = panels(figure)
    assert f"Tolerances: {name}" in texts(figure)
    assert band.get_ylabel() == histogram.get_xlabel() == f"error of {name} [{unit}]"
    assert f"nominal {factor * NOMINAL:.6g} {unit}" in histogram.get_title()
    assert band.get_xlabel() == "crank angle [deg]"
    for label, times in (
        ("linear, worst case", 4.0),
        ("samples, 0.135 % and 99.865 %", 2.9),
        ("samples, 2.3 % and 97.7 %", 1.9),
        ("mean of the samples", 0.1),
    ):
        assert line(band, label).get_xdata() == pytest.approx(np.linspace(0.0, 360.0, 25))
        assert line(band, label).get_ydata() == pytest.approx(times * factor * SIGMA)
    lowest = [float(np.min(np.asarray(x.get_ydata()))) for x in band.lines]
    for times in (1.9, 2.9, 4.0):
        assert any(low == pytest.approx(-times * factor * SIGMA.max()) for low in lowest)
    (filled,) = band.collections
    heights = np.asarray(filled.get_paths()[0].vertices)[:, 1]
    assert (heights.min(), heights.max()) == pytest.approx((-3.0 * factor * SIGMA.max(), 3.0 * factor * SIGMA.max()))


def test_the_band_of_bounded_errors_ends_at_their_worst_case() -> None:
    found = made()
    estimate = replace(found.estimates["slider.position"], worst=np.ma.masked_invalid(2.0 * SIGMA))
    band, _, _ = panels(plot(replace(found, estimates={"slider.position": estimate})))
    (filled,) = band.collections
    assert np.asarray(filled.get_paths()[0].vertices)[:, 1].max() == pytest.approx(2e3 * SIGMA.max())


def test_the_histogram_is_of_the_samples_that_can_be_assembled() -> None:
    """Samples that are left out do not make it lower than the normal curve beside it."""
    missing = np.full(25, 1_000_000)
    found = replace(made(), samples=2_000_000, not_assembled=missing)
    _, histogram, _ = panels(plot(found))
    (steps,) = (x for x in histogram.patches if isinstance(x, StepPatch))
    assert steps.get_data().values == pytest.approx(found.spreads["slider.position"].counts[0] / 1e6)
    assert "99.9% of the samples" in histogram.get_title()


def test_histogram_beside_the_normal_estimate() -> None:
    found = made()
    counts = found.spreads["slider.position"].counts[0]
    figure = plot(found)
    _, histogram, _ = panels(figure)
    (steps,) = (x for x in histogram.patches if isinstance(x, StepPatch))
    assert steps.get_data().values == pytest.approx(counts / 1e6)
    assert steps.get_data().edges == pytest.approx(1e3 * EDGES)
    normal = line(histogram, "linear estimate, normal")
    at_bins = np.interp(0.5e3 * (EDGES[1:] + EDGES[:-1]), normal.get_xdata(), normal.get_ydata())
    # the samples were made of the same distribution: 3e-4 m is the deviation at 0 deg
    assert at_bins == pytest.approx(counts / 1e6, abs=5e-5)
    marks = sorted(float(np.asarray(x.get_xdata())[0]) for x in histogram.lines if x.get_linestyle() == "--")
    assert marks == pytest.approx([-0.9, 0.9])
    assert histogram.get_title().startswith("at 0 deg, nominal 1250 mm; 99.9%")
    said = texts(figure)
    for words in ("of the samples 0.295 mm", "linear 0.3 mm", "to second order 0.305 mm"):
        assert words in said


def bars(axis: Axes) -> dict[str, list[float]]:
    """Widths of the bars by the label of their place, from above."""
    labels = {i: text.get_text() for i, text in enumerate(axis.get_yticklabels())}
    found: dict[str, list[float]] = {}
    for patch in sorted((x for x in axis.patches if isinstance(x, Rectangle)), key=lambda x: -x.get_y()):
        found.setdefault(labels[round(patch.get_y() + 0.5 * patch.get_height())], []).append(patch.get_width())
    return found


def test_shares_largest_on_top() -> None:
    figure = plot(made())
    _, _, shares = panels(figure)
    assert bars(shares) == {"rod length $a_2$": [0.7], "guide offset $a_4$": [0.2998], "crank mass $m_1$": [0.0002]}
    assert list(bars(shares)) == ["rod length $a_2$", "guide offset $a_4$", "crank mass $m_1$"]
    assert shares.get_title() == "share in the variance, linear"
    said = texts(figure)
    for words in ("70.0%", "30.0%", "< 0.1%"):
        assert words in said


def test_shares_to_second_order_where_they_say_something_else() -> None:
    both = plot(made(shares=[(0.1, 0.6), (0.9, 0.4)]))
    assert bars(panels(both)[2]) == {"rod length $a_2$": [0.1, 0.6], "guide offset $a_4$": [0.9, 0.4]}
    nan = float("nan")
    second = plot(made(shares=[(nan, 0.6), (nan, 0.4)]))
    assert bars(panels(second)[2]) == {"rod length $a_2$": [0.6], "guide offset $a_4$": [0.4]}
    assert "to second order" in texts(second)
    neither = plot(made(shares=[(nan, nan)]))
    assert "no variance to first or second order" in texts(neither)


def test_foot_says_what_must_be_known() -> None:
    assert "1,000,000 samples at each angle; all can be assembled." in texts(plot(made()))
    found = made(not_assembled=np.where(pi == ANGLES, 12_300, 0))
    said = " ".join(texts(plot(found)).split())
    assert "at worst 1.23% of them cannot be assembled, and are left out." in said
    first, second = found.notes()
    assert f" {first[0].upper()}{first[1:]}. {second[0].upper()}{second[1:]}." in said


def test_poles_are_cut_off_and_reported() -> None:
    peak = 1.0 + 1e4 * np.exp(-(((ANGLES - pi) / 0.1) ** 2))
    torque = force_turn(parameters(0.0), crank_speed=1.0, angles=ANGLES, torque=1.0)
    found = made("slider.load", peak, turn=torque)
    band, _, _ = panels(plot(found, "slider.load"))
    assert "dead centres, cut off" in band.get_xlabel()
    top = band.get_ylim()[1]
    assert 4.0 * np.median(SIGMA) < top < 80.0 * np.median(SIGMA)
    assert any(np.asarray(x.get_xdata()).tolist() == [90.0, 90.0] for x in band.lines)
    # without a peak all is shown
    whole, _, _ = panels(plot(made()))
    assert whole.get_ylim()[1] > 4e3 * SIGMA.max()


def test_samples_of_a_monte_carlo() -> None:
    given = {"crank_speed": CRANK_SPEED, "shift": ConstantShift(3.5 * INCH)}
    turn = force_turn(parameters(10.0), **given, angles=ANGLES, torque=CRANK_TORQUE)
    tolerances = [Tolerance("guide.offset", 5e-4), Tolerance(SHIFT, 5e-4, distribution="uniform")]
    found = monte_carlo(turn, tolerances, samples=3000, quantities=("slider.position", "slider.load"))
    at = found.place("slider.position", radians(31.0))
    assert np.degrees(ANGLES[at]) == pytest.approx(30.0)
    spread, linear = found.spreads["slider.position"], found.estimates["slider.position"]
    band, histogram, shares = panels(plot(found, "slider.position", radians(31.0)))
    drawn = line(band, "samples, 0.135 % and 99.865 %").get_ydata()
    assert drawn == pytest.approx(1e3 * (spread.percentiles[-1] - linear.nominal).data)
    (steps,) = (x for x in histogram.patches if isinstance(x, StepPatch))
    assert steps.get_data().edges == pytest.approx(1e3 * (spread.edges[at] - turn.slider_position[at]))
    widths = bars(shares)
    assert sum(width for (width, *_) in widths.values()) == pytest.approx(1.0)
    assert set(widths) == {"guide offset $a_4$", "shift position $S_1$"}
    assert found.poles("slider.position") == ()
    assert found.poles("slider.load") == pytest.approx([c.crank_angle for c in turn.singularities])
    assert len(panels(plot(found, "slider.load"))) == 3


def test_next_to_a_dead_centre_there_is_no_estimate_to_draw() -> None:
    common: dict[str, Any] = {"crank_speed": CRANK_SPEED, "shift": ConstantShift(3.5 * INCH)}
    centre = force_turn(parameters(10.0), **common).dead_centres[0].crank_angle
    turn = force_turn(parameters(10.0), angles=[0.5, 1.0, centre + 1e-5], torque=CRANK_TORQUE, **common)
    found = monte_carlo(turn, [Tolerance("guide.offset", 5e-4)], samples=2000, quantities=("slider.load",))
    figure = plot(found, "slider.load", centre)
    assert "no variance: a dead centre is within the tolerances" in texts(figure)
    assert "linear estimate" not in texts(figure)
    _, histogram, _ = panels(figure)
    assert "linear estimate: no spread" not in [x.get_label() for x in histogram.lines]


def test_angles_that_were_left_out_are_a_gap() -> None:
    """A rod too short from 146.4 to 213.6 deg: five of the angles in steps of 15 deg."""
    short = replace(parameters(-20.0), rod_length=30.0 * INCH)
    turn = force_turn(short, crank_speed=1.0, angles=ANGLES, partial=True)
    found = monte_carlo(turn, [Tolerance("rod.length", 1e-5)], samples=100)
    band, _, _ = panels(plot(found))
    assert np.degrees(turn.unreachable) == pytest.approx([150.0, 165.0, 180.0, 195.0, 210.0])
    for label in ("linear, worst case", "samples, 0.135 % and 99.865 %", "mean of the samples"):
        drawn = line(band, label)
        assert np.flatnonzero(np.isnan(drawn.get_ydata())).tolist() == [10]
        assert np.delete(np.asarray(drawn.get_xdata()), 10) == pytest.approx(np.degrees(turn.angle))
    (filled,) = band.collections
    assert len(filled.get_paths()) == 2


def test_one_angle_is_no_band() -> None:
    turn = force_turn(parameters(10.0), crank_speed=1.0, angles=[0.3])
    with pytest.raises(InputError, match="two angles at least, not 1"):
        plot(monte_carlo(turn, TOLERANCES[:1], samples=2))
