"""What `analysis` offers at its top: names, examples that run, quantities as text, published sets."""

import doctest
import inspect
import pickle
import re
from base64 import b64decode
from collections.abc import Callable
from dataclasses import asdict, replace
from importlib import import_module
from io import BytesIO
from math import pi
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import analysis
from analysis import PUBLISHED, Drive, Inputs, force_turn, ramp, simulate, stability_chart, synthesis, table, variant
from analysis.periodic import basins
from analysis.run import published_case, save_parameters
from analysis.slider_crank import sensitivities
from analysis.units import _registry, quantity
from linkwork.errors import InputError, LinkworkError, MissingParameterError, ParameterError, UnknownNameError

from .conftest import run_case

FUNCTIONS = [name for name in dir(analysis) if inspect.isfunction(getattr(analysis, name))]
#: Constructors of signals, whose sentence is example enough.
SIGNALS = {"ramp", "steps", "table"}


def run_example(name: str) -> None:
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(analysis, name), name, globs={})
    assert 2 <= len(example.examples) <= 8, f"{name} has no short example"
    assert doctest.DocTestRunner().run(example).failed == 0


@pytest.mark.parametrize("name", sorted({*FUNCTIONS, "Inputs"} - SIGNALS - {"cosimulate"}))
def test_the_example_of_a_function_runs(name: str) -> None:
    run_example(name)


def test_the_example_of_cosimulate_runs(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "build").symlink_to(fmu.parent)
    run_example("cosimulate")


def test_the_example_of_the_package_runs() -> None:
    assert doctest.testmod(analysis).failed == 0


# Quantities as text and published sets


def same(one: analysis.Trajectory, other: analysis.Trajectory) -> None:
    np.testing.assert_array_equal(one.time, other.time)
    np.testing.assert_array_equal(one.values, other.values)


def test_a_published_set_brings_its_start_its_speed_and_three_turns() -> None:
    table, case = PUBLISHED["table-3.1"], published_case("table-3.1")
    run = simulate("table-3.1")
    same(run, simulate(table))
    same(run, run_case(case))
    # what is given takes the place of the set's, and only of that
    braked = simulate(table, Inputs(torque="-1 N.m"), stop_time="20 ms")
    assert braked["crank.speed"][0] == pytest.approx(44.0, abs=0.1)
    assert braked["crank.speed"][-1] < 43.9
    pushed = simulate(table, Inputs(force="20 N"), initial={"slider_position": "1 mm"}, stop_time="20 ms")
    assert np.ptp(pushed["crank.speed"]) < 1e-9
    assert pushed["slider.position"][0] == pytest.approx(1e-3)


def test_a_set_of_the_slider_crank_brings_its_shift() -> None:
    name = "rahman-a4-10-s1-3.5"
    shift = PUBLISHED[name].initial.shift_position
    assert simulate(name, stop_time="10 ms")["shift.position"] == pytest.approx(shift)
    assert analysis.find_orbit(name, Inputs(torque="100 N.m"), start=[50.0]).drive.held == {"shift.position": shift}
    turn = force_turn(name, angles=["45 deg"], load="-20 lbf")
    assert (turn.shift[0], turn.speed[0]) == pytest.approx((shift, PUBLISHED[name].crank_speed))


def test_many_runs_of_sets_and_parameters() -> None:
    soft = variant("table-3.1", slider_stiffness="0.8e6 dyn/cm")
    runs = analysis.simulate_many([soft, "table-3.1"], stop_time="0.05 s", step="1 ms")
    for run, name in zip((runs[0], runs[1]), (soft, "table-3.1")):
        alone = simulate(name, stop_time=0.05)["slider.position"]
        np.testing.assert_allclose(run["slider.position"], alone, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        (lambda: Inputs(speed="420 rpm").speed, 14.0 * pi),
        (lambda: Inputs(torque=(1.0, "10 lbf.in")).torque[1], 10 * 4.4482216152605 * 0.0254),
        (lambda: Drive(speed="60 rpm", forces={"slider.force": "1 kN"}).forces["slider.force"], 1000.0),
        (lambda: analysis.TorsionBar(torque="10 N.cm").torque, 0.1),
        (lambda: ramp(0.0, 1.0, "1 ms", "3 ms").breaks[3], 0.003),
        (lambda: ramp("0 rpm", "420 rpm", 0.0, "1 s").coefficients[-1, 0], 14.0 * pi),
        (lambda: analysis.steps(["0 s", "1 ms"], [0.0, "2 lbf"]).coefficients[1, 0], 2 * 4.4482216152605),
        (lambda: analysis.Harmonics("1 kN", ["2 N"], ["60 rpm"], ["180 deg"]).frequencies[0], 2.0 * pi),
        (lambda: analysis.Harmonics("1 kN", ["2 N"], ["60 rpm"], ["180 deg"]).mean, 1000.0),
        (lambda: variant("table-3.1", crank_inertia="12500 g.cm2").parameters.crank_inertia, 1.25e-3),
        (lambda: analysis.find_orbit("table-3.1", speed="300 rpm").drive.speed, 10.0 * pi),
        (lambda: analysis.Tolerance("guide.twist", half_width="0.5 deg").half_width, pi / 360.0),
        (lambda: synthesis.LargestLink(length="5 in").length, 0.127),
        (lambda: synthesis.SliderUnknown(harmonics=1, stroke="5 cm", position=("-1 cm", "2 cm")).position[0], -0.01),
        (lambda: simulate("table-3.1", samples=["0 s", "5 ms"]).time[1], 0.005),
    ],
)
def test_a_quantity_may_be_a_text_with_its_unit(text: Callable[[], float], number: float) -> None:
    assert text() == pytest.approx(number, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit"),
    [("mm", "m"), ("cm", "m"), ("in", "m"), ("deg", "rad"), ("rpm", "rad/s"), ("m/s^2", "m/s2"), ("N·m", "N.m")],
)  # fmt: skip
def test_usual_units_are_those_of_pint_to_the_last_bit(monkeypatch: pytest.MonkeyPatch, text: str, unit: str) -> None:
    """And do not wait for it."""
    spelled = text.replace("·", "*")
    base = {"m/s2": "m/s**2", "N.m": "N*m"}.get(unit, unit)
    numbers = [float(f"{n:.5g}") for n in np.random.default_rng(1).uniform(0.01, 999.0, 200)]
    expected = [float(_registry().Quantity(number, spelled).to(base).magnitude) for number in numbers]
    monkeypatch.setattr("analysis.units._registry", None)
    assert [quantity(f"{number!r} {text}", unit, "amount") for number in numbers] == expected


def test_a_range_is_in_the_unit_of_what_varies() -> None:
    damped = analysis.frequency_response("table-3.1", "2e4 dyn.s/cm", "25 N.s/m", vary="slider.damping", doublings=0)
    assert (damped.low, damped.high) == pytest.approx((20.0, 25.0))
    assert damped.branches[0].orbits[0].drive.speed == pytest.approx(14.0 * pi)


@pytest.mark.parametrize(
    ("ask", "kind", "said"),
    [
        (lambda: simulate("table-3.1", stop_time="5 kg"), ParameterError, "stop_time is '5 kg'"),
        (lambda: simulate("table-3.1", stop_time="0.5"), ParameterError, "such as '0.5 s'"),
        (lambda: simulate("table-3.2"), UnknownNameError, "set 'table-3.2'; did you mean table-3.1"),
        (lambda: simulate("table-3.1", Inputs(torque=1.0)), InputError, "stop_time is missing"),
        (lambda: simulate(PUBLISHED["table-3.1"].parameters), InputError, "stop_time is missing"),
        (lambda: simulate(420), InputError, "parameters are int"),
        (lambda: simulate("torsion-bar.toml"), InputError, r"analysis.run.load_case\('torsion-bar.toml'\)"),
        (lambda: simulate("table-3.1", initial={"sped": 1.0}), UnknownNameError, "did you mean initial.crank_speed"),
        (lambda: Inputs(speed="420 N"), InputError, "speed is '420 N': it must be a number in rad/s"),
        (lambda: Inputs(force=ramp("0 rpm", "9 rpm", 0, 1)), InputError, "force is a signal in rad/s: it must be in N"),
        (lambda: Inputs(speed=analysis.Harmonics("1 N")), InputError, "speed is a signal in N: it must be in rad/s"),
        (lambda: table([0.0, 1.0], ["1 kg", 2.0]), InputError, "values of a signal"),
        (lambda: ramp(0.0, 1.0, "0 s", "1 m"), ParameterError, "to_time is '1 m'"),
        (lambda: Inputs(speed="7 Hz"), InputError, "rad/s or rpm"),
        (lambda: analysis.find_orbit("table-3.1", speed="1 m/s"), ParameterError, "speed is '1 m/s'"),
        (lambda: analysis.frequency_response("table-3.1", "1 N", "2 rpm"), ParameterError, "low is '1 N'"),
        (lambda: stability_chart("table-3.1", ranges=((1, "2 m"), (1, 2))), ParameterError, "drive.speed is '2 m'"),
        (lambda: stability_chart(PUBLISHED["table-3.1"].parameters), InputError, "give a drive"),
        (lambda: stability_chart("table-3.1", "300 rpm"), InputError, "drive is '300 rpm': give a drive"),
        (lambda: stability_chart("table-3.1", names=("drive.speed",)), ParameterError, "names is .* must be two"),
        (lambda: stability_chart("table-3.1", ranges=((1, 2),)), ParameterError, "ranges is .* must be two"),
        (lambda: stability_chart("table-3.1", ranges=(1, 2)), ParameterError, "drive.speed is 1: .* two values"),
        (lambda: stability_chart("table-3.1", points=1.5), ParameterError, "points is 1.5: .* whole number"),
        (lambda: basins("table-3.1", "500 rpm"), InputError, "drive is '500 rpm': give a drive"),
        (lambda: basins("table-3.1", Inputs(speed=50.0)), InputError, r"drive is Inputs\(speed=50.0\): give a drive"),
        (lambda: basins("table-3.1", Drive(speed=50.0), position=1), ParameterError, "position is 1: .* two values"),
        (lambda: basins("table-3.1", Drive(speed=50.0), rate=("0 m/s", "1 m")), ParameterError, "rate is '1 m'"),
        (lambda: basins("table-3.1", Drive(speed=50.0), points=1.5), ParameterError, "points is 1.5: .* whole number"),
        (lambda: Drive(speed="-300 rpm"), InputError, "above zero; for a crank that turns the other way"),
        (lambda: Drive(speed=5.0, ratios={"x": "-1/2"}), InputError, r"ratio of x is '-1/2': .* Fraction\(-1, 2\)"),
        (lambda: Drive(speed=5.0, ratios={"x": np.nan}), InputError, "ratio of x is nan: .* finite"),
        (lambda: Drive(speeds={"left.speed": -5.0}), InputError, "above zero; for a crank that turns the other way"),
        (lambda: save_parameters("never.toml", variant("table-3.1")), InputError, r"variant\(\.\.\.\)\.parameters"),
        (lambda: variant("table-3.1", slider_stifness=1.0), UnknownNameError, "did you mean slider_stiffness"),
        (lambda: variant("table-3.1", slider_stiffness="3 kg"), ParameterError, "slider_stiffness is '3 kg'"),
        (lambda: variant(analysis.FiveBarParameters, ground_length="1 m"), MissingParameterError, "and so are"),
        (lambda: variant(dict), InputError, "dict has no variants"),
        (lambda: force_turn("rahman-ideal", torque="3 N"), ParameterError, "torque is '3 N'"),
        (lambda: synthesis.CrankUnknown(ratio=1.0, length=(1, 2), harmonics="2"), ParameterError, "harmonics is '2'"),
        (lambda: simulate("table-3.1", stop_time=True), ParameterError, "stop_time is True: it must be a number in s"),
        (lambda: analysis.Tolerance("rod.length", half_width="1 deg"), ParameterError, "rod.length is '1 deg'"),
    ],
)
def test_what_is_no_such_quantity_is_refused_by_its_name(ask, kind, said) -> None:
    with pytest.raises(kind, match=said):
        ask()


_ROD = [analysis.Tolerance("rod.length", half_width="1 mm")]


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: analysis.tolerance_effects("hanging-arm", _ROD), "turn is 'hanging-arm': give .*SliderCrank"),
        (lambda: sensitivities(PUBLISHED["table-3.1"].parameters), "turn is FiveBarParameters: give what force_turn"),
        (lambda: analysis.monte_carlo("rahman-ideal", _ROD), "turn is 'rahman-ideal': give what force_turn returns"),
        (lambda: analysis.monte_carlo(force_turn("rahman-ideal"), _ROD, samples="many"), "samples is 'many'"),
        (lambda: sensitivities(None), "turn is None: give what force_turn returns"),
        (lambda: analysis.tolerance_effects(force_turn("rahman-ideal"), _ROD[0]), "is Tolerance: give a list"),
        (lambda: analysis.tolerance_effects(force_turn("rahman-ideal"), "rod.length"), "1 is 'r': give a list"),
        (lambda: force_turn("table-3.1"), "parameters is FiveBarParameters: give SliderCrankParameters or a set"),
        (lambda: force_turn(PUBLISHED["table-3.1"].parameters), "parameters is FiveBarParameters: give SliderCrank"),
        (lambda: analysis.compare("table-3.1", "table-3.1"), "a is 'table-3.1': give a run"),
        (lambda: analysis.with_isolas("table-3.1"), "response is 'table-3.1': give what frequency_response returns"),
        (lambda: analysis.tune("table-3.1"), "wish is 'table-3.1': give a Wish"),
        (lambda: analysis.slider_motion("table-3.1", "table-3.1", None), "linkage is 'table-3.1': give a Linkage"),
        (lambda: analysis.design_lqr("table-3.1", [1.0]), "model is 'table-3.1': give a LinearModel"),
        (lambda: analysis.design_pi("table-3.1", bandwidth=1.0), "model is 'table-3.1': give a LinearModel"),
        (lambda: analysis.design_pid("table-3.1", bandwidth=1.0), "model is 'table-3.1': give a LinearModel"),
    ],
)
def test_an_argument_of_another_kind_is_refused_with_what_to_give(ask: Callable[[], object], said: str) -> None:
    with pytest.raises(LinkworkError, match=said):
        ask()


def test_a_variant_keeps_what_it_is_of() -> None:
    table = PUBLISHED["table-3.1"]
    assert variant("table-3.1") == table
    changed = variant(table, slider_mass=0.6)
    heavier = replace(table.parameters, slider_mass=0.6)
    assert changed == table._replace(parameters=heavier, source=f"{table.source}, changed")
    assert variant(table.parameters, slider_mass="600 g") == changed.parameters
    assert variant(analysis.FiveBarParameters, **asdict(table.parameters)) == table.parameters


def test_replace_and_pickle_of_what_takes_texts() -> None:
    link = synthesis.LargestLink(length="5 cm")
    assert pickle.loads(pickle.dumps(link)) == link
    assert replace(link, length="6 cm").length == pytest.approx(0.06)


# What a REPL and a notebook show


def picture_in(html: str) -> tuple[int, int]:
    """Size of the picture in an HTML text, in pixels."""
    data = re.search(r'src="data:image/png;base64,([^"]+)"', html)
    assert data
    with Image.open(BytesIO(b64decode(data[1]))) as image:
        assert len(np.unique(np.array(image.convert("L")))) > 10
        return image.size


def test_a_run_says_what_it_is_and_how_it_ended() -> None:
    run = simulate("table-3.1")
    assert repr(run).startswith("<Trajectory: 1081 samples from 0 to 0.4286 s by compiled DOP853, complete; crank.a")
    assert "slider.position -0.01071 to 0.005715 m" in repr(run)
    lost = simulate("table-3.1", Inputs(force="-2 kN"), stop_time="1 s")
    assert "ended early, limit of assembly at t = 0.0" in repr(lost)
    assert "&lt;Trajectory: 1081" in run._repr_html_()
    assert min(picture_in(run._repr_html_())) > 200
    assert "complete" in repr(simulate("table-3.1", stop_time=1e-3, step=1e-3))


def test_other_results_say_what_they_are() -> None:
    orbit = analysis.find_orbit("table-3.1")
    assert repr(orbit) == (
        "<PeriodicOrbit: 1 turn at 43.98 rad/s (420 rpm), stable, largest Floquet multiplier "
        f"{orbit.largest:.4g}; amplitude of slider.position {orbit.amplitude:.4g} m>"
    )
    response = analysis.frequency_response("rig-2-spring-c", "500 rpm", "650 rpm", doublings=0)
    best = max(response.maxima(), key=lambda e: e.amplitude)
    assert f"greatest amplitude of slider.position {best.amplitude:.4g} m" in repr(response)
    assert " rpm); 1 branch, no problems; " in repr(response)
    chart = stability_chart("rig-2-spring-c", ranges=(("550 rpm", "560 rpm"), ("50 N.s/m", "60 N.s/m")), points=3)
    said = "<StabilityChart: drive.speed 550 to 560 rpm by slider.damping 50 to 60 N.s/m, 3 x 3 points, 0.0%"
    assert repr(chart).startswith(said)
    forces = force_turn("rahman-a4-10-s1-3.5", angles=["30 deg", "90 deg"])
    wide = [analysis.Tolerance("rod.length", half_width="0.5 mm")]
    numbers = (analysis.monte_carlo(forces, wide, samples=100), *analysis.tolerance_effects(forces, wide).values())
    for result in (orbit.turn(), forces, *numbers, sensitivities(forces)):
        assert repr(result).startswith(f"<{type(result).__name__}")
        assert len(repr(result)) < 800
    assert "standard deviations slider.position 0.000" in repr(numbers[0])
    for result in (orbit, response, response.branches[0], chart):
        assert len(repr(result)) < 400
        assert min(picture_in(result._repr_html_())) > 200
    runs = analysis.simulate_many(["table-3.1"] * 2, Inputs(force=-2e3), stop_time="1 s")
    assert repr(runs) == ("<Ensemble: 2 runs of 1001 samples from 0 to 1 s, 2 of them ended early: see messages>")
    forces = analysis.simulate_many(["table-3.1"], stop_time=0.01, outputs=["pin.A.fx"])
    assert "complete; masses" in repr(forces[0])


def test_solutions_say_what_they_are() -> None:
    phi = synthesis.turn(24)
    ellipse = np.column_stack([0.2 + 0.1 * np.cos(phi), 0.15 + 0.05 * np.sin(phi)])
    found = analysis.synthesize(synthesis.TimedPath(points=ellipse), search=synthesis.Search(starts=2))
    best = found.best
    assert f"error {best.error:.4g} m2" in repr(best)
    assert re.match(r"<Synthesis: \d solutions? of a TimedPath by scan, \d+ starts, \S+ s; the best", repr(found))
    for result in (found, best):
        assert len(repr(result)) < 400
        assert min(picture_in(result._repr_html_())) > 200


def test_a_picture_of_a_periodic_motion() -> None:
    fixed, free = analysis.find_orbit("table-3.1"), analysis.find_orbit("table-3.1", torque=0.5, start=[0.0, 0.0, 44.0])
    labels = [axis.get_ylabel() for axis in analysis.figures.plot(fixed).axes]
    assert labels == ["slider position [mm]", "drive applied torque [N.m]", "slider velocity [m/s]", "imaginary part"]
    assert "crank speed [rpm]" in [axis.get_ylabel() for axis in analysis.figures.plot(free).axes]
    angle, plane, multipliers = (analysis.figures.plot(fixed, title="an orbit").axes[n] for n in (0, 2, 3))
    x, y = angle.lines[0].get_data()
    assert (x[0], x[-1], y[-1]) == (0.0, pytest.approx(360.0), y[0])
    assert np.ptp(y) == pytest.approx(2e3 * fixed.amplitude, rel=1e-3)
    assert plane.lines[1].get_xdata()[0] == pytest.approx(1e3 * fixed.start[0])
    assert sorted(multipliers.lines[1].get_xdata()) == sorted(fixed.multipliers.real)


PACKAGES = ("run", "periodic", "linear", "youssef", "slider_crank", "slider")
#: Functions that write or check parameters, or tell where they come from.
OF_PARAMETERS = {"parameter_tables", "save_parameters", "require_five_bar", "mass_origins", "trace_masses"}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_function_takes_a_published_set_as_parameters(package: str) -> None:
    public = import_module(f"analysis.{package}")
    functions = [(name, getattr(public, name)) for name in public.__all__ if inspect.isfunction(getattr(public, name))]
    taking = {name: function for name, function in functions if "parameters" in inspect.signature(function).parameters}
    without = {name for name, function in taking.items() if function.__code__ is not simulate.__code__}
    assert without - OF_PARAMETERS == set()


def test_the_top_offers_what_one_asks_for() -> None:
    asked = "simulate simulate_many cosimulate compare find_orbit frequency_response stability_chart linearise"
    offered = {*dir(analysis)}
    assert {*asked.split(), "synthesize", "slider_motion", "force_turn", "Inputs", "figures", "PUBLISHED"} <= offered
    # results and errors of a run are there, but not offered
    assert not {"Trajectory", "RunInterrupted", "sample_times"} & {*dir(analysis)}
    assert isinstance(simulate("table-3.1"), analysis.Trajectory)
    assert len(dir(analysis)) < 53
