"""What the studio computes beside the mechanism: response, stability, a motor, powers; its numbers against Python's."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.linkages import linkage
from analysis.mechanisms import PUBLISHED, find_mechanism
from analysis.periodic import Drive, frequency_response, natural_frequency, newton_orbit, steady_drive
from analysis.run import Case, InductionMotor, Inputs, load_case, read_case, simulate
from analysis.studio import page_case, page_state
from benchmarks.studio import figures_in_words, measure_page
from linkwork.five_bar.parameters import InitialState
from tests.analysis.test_linkages import coupled
from tests.analysis.test_orbits import LIGHT
from tests.analysis.test_several_freedoms import SHAKER
from tests.analysis.test_studio import _HELD, OWN, _load, _near, _saved, _varied, in_browser
from tests.analysis.test_swinging_links import yoke

RPM = np.pi / 30.0
RIG = PUBLISHED["rig-1-spring-b"]
MOTOR = InductionMotor(breakdown_torque=6.0, breakdown_slip=0.15, synchronous_speed=48.0)


def _state(speed: float) -> dict[str, Any]:
    mechanism = find_mechanism(RIG.parameters)
    inputs = Drive(speed=speed * RPM).inputs(mechanism)
    return page_state(Case(title="", parameters=RIG.parameters, inputs=inputs, stop_time=1.0))


def _explored(page: Any, which: str, ranges: Mapping[str, tuple[float, float]]) -> None:
    """Let the page compute a chart over these ranges, in the units that it shows, by the axis."""
    page.click(f'[id="tab {which}"]')
    for axis, ends in ranges.items():
        for word, end in zip(("from", "to"), ends):
            field = page.locator(f'[aria-label="{axis}: {word}"]')
            field.fill(str(end))
            field.press("Enter")
    page.wait_for_function(f"window.studio.charts.{which}.done")


@in_browser
def test_the_response_is_pythons_with_its_fold_and_what_to_avoid(page: Any) -> None:
    _load(page, _state(1020.0))
    _explored(page, "response", {"What varies": (1000.0, 1100.0)})
    branches = page.evaluate("window.studio.charts.response.branches")
    points = [point for branch in branches for point in branch if not point["kind"]]
    assert len(branches) == 2
    largest = []
    for point in points[:: len(points) // 12]:
        orbit = newton_orbit(RIG.parameters, Drive(speed=point["value"]), start=point["start"])
        _near(np.array(point["start"]) / [0.05, 5.0], orbit.start / [0.05, 5.0])
        _near(point["amplitudes"], orbit.amplitudes)
        found = np.sort_complex([complex(*pair) for pair in point["multipliers"]])
        # of a motion that grows a hundredfold a turn, errors grow as much
        np.testing.assert_allclose(found, np.sort_complex(orbit.multipliers), atol=1e-9 * max(1.0, orbit.largest**2))
        largest.append(orbit.largest)
    assert min(largest) < 0.9
    assert max(largest) > 1.5
    wanted = frequency_response(RIG.parameters, 1000.0 * RPM, 1100.0 * RPM, doublings=0)
    (fold,) = [s.parameter for branch in wanted.branches for s in branch.special if s.kind.value == "fold"]
    (found_fold,) = [p["value"] for branch in branches for p in branch if p["kind"] == "fold"]
    assert found_fold == pytest.approx(fold, rel=1e-7)
    avoided = page.evaluate("window.studio.charts.response.avoided")
    several = next(one for one in avoided if "several" in one["why"])
    theirs = next(one for one in wanted.speeds_to_avoid if "several" in one.risk.value)
    np.testing.assert_allclose([several["low"], several["high"]], [theirs.low, theirs.high], rtol=1e-5)
    words = page.locator(".told").filter(has_text="Speeds to avoid").inner_text()
    assert "1000 rpm to 1036 rpm (several stable motions" in words
    assert "rises past it" in words
    shown = page.evaluate("window.studio.charts.response.context.natural")
    assert shown == pytest.approx(natural_frequency(RIG.parameters), rel=1e-12)
    # a key goes to another speed, and the chart stays
    before = page.evaluate("window.studio.state.values['drive.speed']")
    page.locator('canvas[role="slider"]').focus()
    page.keyboard.press("ArrowRight")
    after = page.evaluate("window.studio.state.values['drive.speed']")
    assert after - before == pytest.approx(100.0 * RPM / 200.0, rel=1e-9)
    assert page.evaluate("window.studio.charts.response.done")


@in_browser
def test_where_a_motion_breaks_its_symmetry_there_is_no_fold(open_page: Any) -> None:
    """A pendulum on a yoke hangs still, or swings at the speed of the crank up to a branch point."""
    parameters = replace(yoke("yoke-in-the-page").parameters, hinge_damping=1e-4)
    mechanism = find_mechanism(parameters)
    swinging = newton_orbit(parameters, Drive(speed=6.6), start=(-0.856, 1.569))
    initial = mechanism.initial(**dict(zip(mechanism.freedoms[1].initial, swinging.start.tolist())))
    inputs = Drive(speed=6.6).inputs(mechanism)
    case = Case(title="", parameters=parameters, initial=initial, inputs=inputs, stop_time=1.0)
    page = open_page(page_state(case))
    # beside those of the house: a linkage that Python finds for a path is one of them
    assert {*OWN, mechanism.name} == set(page.evaluate("window.studio.tables.mechanisms.map((one) => one.name)"))
    _explored(page, "response", {"What varies": (6.6 / RPM, 7.2 / RPM)})
    swings, hangs = page.evaluate("window.studio.charts.response.branches")
    response = frequency_response(parameters, 6.6, 7.2, doublings=0)
    crossing = response.branches[0].special[1].parameter
    assert max(point["value"] for point in swings) == pytest.approx(crossing, rel=1e-4)
    assert not any(point["kind"] for point in [*swings, *hangs])
    assert not any(point["amplitudes"][0] for point in hangs)
    assert not page.locator(".told").filter(has_text="Fold at").count()


def _supported(law: Any, **constants: Any) -> Any:
    """A five-bar whose slider is held by a force law with kinks."""
    built = linkage("supported", ground={"A": (0, 0), "O": (0.15, 0)}, gravity=9.81)
    for name, points, length in (("crank", "AB", 0.05), ("coupler", "BC", 0.15), ("rocker", "DC", 0.15)):
        bar = {"kind": "bar", "width": "20 mm", "thickness": "5 mm", "material": "steel"}
        built.body(name, bar=(points[0], points[1]), length=length, section=bar)
    built.body("slider", points={"D": (0, 0)}, mass=0.6).slide("G", body="slider", through="O")
    built.spring("support", at="G", damping=8.0, law=law, constants=constants)
    return built.freedom("crank", "A", speed="300 rpm").freedom("slider", "G")


def _arm() -> Any:
    """An arm that hangs on a crank pin, and turns back in it once a turn."""
    # a joint of the five-bar has the same name
    built = linkage("guide", ground={"A": (0, 0)}, gravity=9.81)
    built.body("crank", bar=("A", "B"), length=0.02, mass=1.0, inertia=1e-3)
    built.body("arm", bar=("B", "C"), length=0.15, mass=1.0, inertia=2e-3).spring("hinge", at="B", damping=0.002)
    return built.freedom("crank", "A", speed="60 rpm").freedom("arm", "B", driven=False)


_PLAY = [("-6 mm", "-40 N"), ("-1 mm", "0 N"), ("1 mm", "0 N"), ("6 mm", "40 N")]


@in_browser
@pytest.mark.parametrize(
    ("built", "speeds"),
    [
        (lambda: _supported("1500*x + k*max(x - 0.002, 0)", k=1e9), (300.0,)),
        # the first motion is no guess for the second
        (lambda: _supported(_PLAY), (150.0, 300.0)),
        (lambda: coupled("coupled-in-the-page"), (60.0,)),
        (_arm, (57.3,)),
    ],
    ids=["stop", "play", "coupling", "arm"],
)
def test_motions_over_kinks_and_of_links_that_turn_are_pythons(
    open_page: Any, built: Callable[[], Any], speeds: tuple[float, ...]
) -> None:
    made = built().mechanism()
    parameters = made.first_set.parameters
    states = []
    for speed in speeds:
        inputs = Drive(speed=speed * RPM).inputs(made)
        states.append(page_state(Case(title="", parameters=parameters, inputs=inputs, stop_time=1.0)))
    page = open_page(states[0])
    found = [_load(page, state)["answer"]["orbit"] for state in states][-1]
    assert found["found"], found["sentence"]
    wanted = newton_orbit(parameters, Drive(speed=speeds[-1] * RPM), start=found["start"])
    _near(found["start"], wanted.start)
    assert max(abs(complex(*pair)) for pair in found["multipliers"]) == pytest.approx(wanted.largest, rel=1e-6)


@in_browser
def test_another_crank_turns_as_often_as_the_speeds_at_the_start_say(open_page: Any) -> None:
    example = Path(__file__).parents[2] / "examples" / "linkages" / "two-crank-five-bar.toml"
    case = load_case(example, {"rightDrive.torque": 0.0, "initial.right_speed": "240 rpm"})
    page = open_page(page_state(case))
    found = _load(page, page_state(case))["answer"]["orbit"]
    wanted = newton_orbit(
        case.parameters, steady_drive(case.parameters, case.inputs, case.initial), start=found["start"]
    )
    assert wanted.drive.ratios == {"right.angle": 2}
    _near(found["start"], wanted.start)


@in_browser
def test_every_coordinate_has_its_ranges_to_avoid(open_page: Any, tmp_path: Path) -> None:
    (tmp_path / "shaker.toml").write_text(SHAKER, encoding="utf-8")
    case = load_case(tmp_path / "shaker.toml", {"run.stop_time": 1.0})
    page = open_page(page_state(case))
    _explored(page, "response", {"What varies": (300.0, 900.0)})
    found = page.evaluate("window.studio.charts.response.avoided")
    wanted = frequency_response(case.parameters, 300.0 * RPM, 900.0 * RPM, doublings=0).speeds_to_avoid
    assert [one["why"] for one in found] == [one.words for one in wanted]
    ours = [[one["low"], one["high"]] for one in found]
    np.testing.assert_allclose(ours, [[one.low, one.high] for one in wanted], rtol=1e-3)
    # a click on the peak of the second takes its motion
    page.select_option('[aria-label="Whose amplitude is shown"]', "upright position")
    point = page.evaluate(
        "window.studio.charts.response.branches.flat().reduce((a, b) => a.amplitudes[1] > b.amplitudes[1] ? a : b)"
    )
    canvas = page.locator('canvas[role="slider"]')
    box = canvas.bounding_box()
    share = (point["value"] / RPM - 300.0) / 600.0
    canvas.click(position={"x": 58 + (box["width"] - 70) * share, "y": 10 + (box["height"] - 50) * 0.08 / 1.08})
    assert page.evaluate("window.studio.state.values['drive.speed']") == pytest.approx(point["value"], rel=1e-2)


@in_browser
@pytest.mark.parametrize(
    ("name", "change", "low", "high"),
    [
        ("rig-1-spring-b", {}, 1000.0, 1100.0),
        ("rig-1-spring-b", {"slider_damping": 12.0}, 1000.0, 1250.0),
        ("rig-2-spring-c", {}, 450.0, 700.0),
        ("table-3.1", {}, 250.0, 500.0),
    ],
)
def test_the_ranges_to_avoid_are_pythons(
    page: Any, name: str, change: dict[str, float], low: float, high: float
) -> None:
    """The page's own search for ranges is the twin of `analysis.periodic.response.advice`, for motions of one turn."""
    known = PUBLISHED[name]
    parameters = replace(known.parameters, **change)
    inputs = Drive(speed=0.5 * (low + high) * RPM).inputs(find_mechanism(parameters))
    _load(page, page_state(Case(title="", parameters=parameters, inputs=inputs, stop_time=1.0)))
    _explored(page, "response", {"What varies": (low, high)})
    found = page.evaluate("window.studio.charts.response.avoided")
    wanted = frequency_response(parameters, low * RPM, high * RPM, doublings=0).speeds_to_avoid
    ours = [[one["low"], one["high"]] for one in found]
    np.testing.assert_allclose(ours, [[one.low, one.high] for one in wanted], rtol=1e-4)


@in_browser
def test_every_square_of_the_stability_chart_has_the_verdict_of_its_motion(page: Any) -> None:
    _load(page, _state(1900.0))
    _explored(page, "stability", {"Along the width": (1850.0, 2200.0), "Along the height": (5.0, 15.0)})
    squares = page.evaluate(
        "(() => { const s = window.studio.charts.stability;"
        " return [...s.cells.values()].map((one) => ({ ...one, verdict: s.verdict(one) })); })()"
    )
    assert {one["verdict"] for one in squares} == {"stable", "unstable"}
    assert {(one["column"], one["row"]) for one in squares} == {(x, y) for x in range(48) for y in range(32)}
    for one in np.random.default_rng(1).choice(squares, 12, replace=False):
        speed = RPM * (1850.0 + 350.0 * (one["column"] + 0.5) / 48)
        damping = 5.0 + 10.0 * (one["row"] + 0.5) / 32
        state = _state(1900.0)
        parameters = page_case(state | {"values": {**state["values"], "slider.damping": damping}}).parameters
        orbit = newton_orbit(parameters, Drive(speed=speed), start=one["start"])
        assert orbit.verdict().stability.value == one["verdict"]
        found = np.sort_complex([complex(*pair) for pair in one["multipliers"]])
        _near(found, np.sort_complex(orbit.multipliers))
    # a click takes the point with its verdict
    canvas = page.locator('canvas[role="application"]')
    box = canvas.bounding_box()
    column, row = next((o["column"], o["row"]) for o in squares if o["verdict"] == "unstable")
    x = 58 + (box["width"] - 70) * (column + 0.5) / 48
    canvas.click(position={"x": x, "y": 10 + (box["height"] - 50) * (1.0 - (row + 0.5) / 32)})
    page.wait_for_function("document.querySelector('#floquet b').textContent === 'unstable'")
    assert page.evaluate("window.studio.state.values['slider.damping']") == pytest.approx(5.0 + 10.0 * (row + 0.5) / 32)


@in_browser
def test_no_motion_passes_over_a_change_point(page: Any) -> None:
    # the slider is at rest where the change point is at no simple fraction of a turn
    u, inputs, limit = 0.03, Drive(speed=40.0).inputs(find_mechanism(LIGHT)), 0.05 + np.hypot(0.2, 0.03) - 0.19
    aside = replace(LIGHT, gravity=0.0, slider_guide_angle=np.pi / 2.0, slider_spring_free_position=u)
    for rocker, found in ((limit, False), (limit + 2e-4, True)):
        parameters, start = replace(aside, rocker_length=rocker), InitialState(slider_position=u, crank_speed=40.0)
        case = Case(title="", parameters=parameters, inputs=inputs, initial=start, stop_time=0.1)
        orbit = _load(page, page_state(case))["answer"]["orbit"]
        assert orbit["found"] == found
        assert ("the links cannot be joined" in orbit["sentence"]) != found


@in_browser
def test_a_motor_drives_the_crank_as_in_python(page: Any) -> None:
    parameters, _ = _varied(2)
    mechanism = find_mechanism(parameters)
    inputs = Inputs(torque=(0.2, MOTOR), force=3.0)
    case = Case(title="motor", parameters=parameters, inputs=inputs, stop_time=0.02)
    run = _load(page, page_state(case) | {"source": "run"})
    # a motor's torque follows the speed: nothing is held over a step
    wanted = simulate(parameters, inputs, stop_time=0.02, step=_HELD["step"], tolerance=_HELD["tolerance"])
    for name in mechanism.output_names:
        _near(run["columns"][name], wanted[name])
    found = _load(page, page_state(case))
    orbit = newton_orbit(parameters, steady_drive(parameters, inputs))
    assert found["source"] == "steady"
    _near(found["answer"]["orbit"]["start"], orbit.start)
    multipliers = [complex(*pair) for pair in found["answer"]["orbit"]["multipliers"]]
    _near(np.sort_complex(multipliers), np.sort_complex(orbit.multipliers))
    # over the speed of its field
    field = MOTOR.synchronous_speed / RPM
    _explored(page, "response", {"What varies": (0.95 * field, 1.05 * field)})
    points = page.evaluate("window.studio.charts.response.branches.flat()")
    assert len(points) > 8
    for point in points[:: len(points) // 4]:
        motor = InductionMotor(
            breakdown_torque=MOTOR.breakdown_torque,
            breakdown_slip=MOTOR.breakdown_slip,
            synchronous_speed=point["value"],
        )
        varied = steady_drive(parameters, Inputs(torque=(0.2, motor), force=3.0))
        again = newton_orbit(parameters, varied, start=point["start"])
        np.testing.assert_allclose(point["start"], again.start, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(point["amplitudes"], again.amplitudes, rtol=1e-8)
    read = read_case(tomllib.loads(_saved(page, "case").read_text(encoding="utf-8")), folder=Path())
    assert read.inputs.parts("torque") == case.inputs.parts("torque")
    again_of = page_case(page_state(case))
    assert again_of.inputs.parts("torque") == case.inputs.parts("torque")


@in_browser
def test_powers_are_those_of_the_equations_and_the_envelope_has_the_greatest_force(page: Any) -> None:
    parameters, drive = _varied(1)
    mechanism = find_mechanism(parameters)
    found = _load(
        page, page_state(Case(title="", parameters=parameters, inputs=drive.inputs(mechanism), stop_time=1.0))
    )
    columns, equations = found["columns"], mechanism.equations
    p = parameters.constants()
    modes = tuple(map(float, drive.inputs(mechanism).modes(mechanism).values()))
    channels = [drive.speed if c.kind == "command" else 0.0 for c in mechanism.channels]
    for row in (0, 100, 500):
        x = [columns[n][row] for n in range(mechanism.size)]
        rates = equations.derivative(x, equations.apply_inputs(modes, channels, p), p)
        _near([columns["power.dissipated"][row], columns["power.supplied"][row]], rates[-2:])
    _near(columns["power.supplied"], columns["drive.applied_torque"] * columns["crank.speed"])
    page.click('[id="tab forces"]')
    page.select_option('[aria-label="Joint"]', label="pin C")
    greatest = float(np.hypot(columns["pin.C.fx"], columns["pin.C.fy"]).max())
    said = page.locator(".told").filter(has_text="Greatest").inner_text()
    assert float(said.split()[1]) == pytest.approx(greatest, rel=1e-3)
    for tab in ("motion", "power"):
        page.click(f'[id="tab {tab}"]')
        assert page.locator("#curves figure").count() == 2


@in_browser
def test_dragging_goes_on_while_a_chart_is_computed(browser: Any, record_property: Any) -> None:
    found = measure_page(browser, 3.0)
    record_property("studio", figures_in_words(found))
    # on a machine that does other work too: what would be computed in the page's own thread takes seconds
    assert found.frame[0] < 100.0
    assert found.work[1] < 50.0
    assert found.squares > 1
