"""The studio in a real browser: its numbers against Python's, drags, and what it is built of."""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import Result

from analysis.mechanisms import MECHANISMS, PUBLISHED, MechanismError, check, find_mechanism
from analysis.periodic import Drive, newton_orbit
from analysis.run import Case, Inputs, read_case, simulate
from analysis.studio import PAGE, is_current, opening_state, page_state
from analysis.studio.tables import published_values
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import TABLE_3_1
from tests import slider_cranks, strategies
from tests.mechanisms import pendulum
from tests.scripts import called

ROOT = Path(__file__).parents[2]
#: The mechanisms of the house: other tests describe linkages of their own.
OWN = tuple(MECHANISMS)
#: Bound of the page in bytes, and of the difference between its numbers and Python's, relative to the largest of each.
BYTES, CLOSE = 500_000, 1e-9
#: A run of 0.02 s in Python as the page makes it: a step ends at each of its 1440 rows.
_HELD: Any = {"step": 0.02 / 1440, "hold": 0.02 / 1440, "tolerance": 1e-12}

if TYPE_CHECKING:
    from playwright.sync_api import Page

in_browser = pytest.mark.slow


def _load(page: Page, state: Mapping[str, Any]) -> dict[str, Any]:
    """Let the page show a state: what it answers, its rows as columns by name."""
    with _settled(page):
        page.evaluate("state => window.studio.restore(state)", state)
    page.evaluate("window.studio.go(0)")
    return _shown(page)


@contextmanager
def _settled(page: Page) -> Iterator[None]:
    """Wait, after what is done within, for the page's answer to it; one that never comes tells what the page shows."""
    before = int(page.evaluate("document.documentElement.dataset.answer"))
    yield
    from playwright.sync_api import TimeoutError

    # asked for by time: a page that is not painted answers too
    try:
        page.wait_for_function(
            f"Number(document.documentElement.dataset.answer) > {before}"
            " && document.documentElement.dataset.settled === 'true'",
            polling=100,
        )
    except TimeoutError as error:
        shown = page.evaluate(
            "[{...document.documentElement.dataset}, location.href, document.querySelector('#fault').textContent]"
        )
        raise AssertionError(f"no answer after {before}: {shown}") from error


def _shown(page: Page) -> dict[str, Any]:
    shown = page.evaluate(
        "() => { const s = window.studio.shown();"
        " return { ...s, rows: { ...s.rows, values: Array.from(s.rows.values) }, answer: { ...s.answer, rows: 0 } } }"
    )
    mechanism = MECHANISMS[page.evaluate("window.studio.state.mechanism")]
    joints = mechanism.drawing.joints if mechanism.drawing else ()
    names = [
        "time",
        *range(mechanism.size),
        *mechanism.output_names,
        *(f"{j.name}{axis}" for j in joints for axis in "xyz"),
        "power.dissipated",
        "power.supplied",
    ]
    values = np.array(shown["rows"]["values"]).reshape(shown["rows"]["count"], len(names))
    return shown | {"columns": dict(zip(names, values.T))}


def _near(found: Any, wanted: Any) -> None:
    """Equal to within `CLOSE` of the largest."""
    wanted = np.asarray(wanted)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=CLOSE * max(1.0, float(np.abs(wanted).max(initial=0.0))))


def test_the_page_is_of_these_sources() -> None:
    assert is_current(), "the page is older than its sources: make studio"


def test_the_page_is_small_whole_and_needs_nothing_from_elsewhere() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert len(text.encode()) < BYTES
    assert "<link" not in text
    assert 'src="' not in text.split('id="tables"')[0]
    for name in OWN:
        assert f'"name":"{name}"' in text


def test_a_case_is_a_state_of_the_page(linkwork: Callable[..., Result], tmp_path: Path) -> None:
    linkwork("studio", "table-3.1", "--set", "slider.stiffness=2e6 dyn/cm", "--out", "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    state = json.loads(text.split('id="state">')[1].split("</script>")[0])
    assert state["mechanism"] == "five-bar"
    assert state["values"]["slider.stiffness"] == pytest.approx(2000.0, rel=1e-14)
    speeds = [state["values"][name] for name in ("drive.speed", "initial.crank_speed")]
    assert speeds == 2 * [PUBLISHED["table-3.1"].crank_speed]
    assert state["values"]["drive.mode"] == 1.0
    # all else as in the list of the page
    known = PUBLISHED["table-3.1"]
    listed = published_values(find_mechanism(known.parameters), known)
    assert {name for name, value in listed.items() if state["values"][name] != value} == {"slider.stiffness"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nothing.toml"], "nothing.toml"),
        (["--set", "drive.speed=3"], "name one"),
        ([ROOT / "examples" / "torsion-bar.toml"], "only constant inputs"),
        ([ROOT / "examples" / "ellipse.toml"], "linkwork synthesize"),
    ],
)
def test_what_the_page_cannot_open_is_said(linkwork: Callable[..., Result], words: list[Any], said: str) -> None:
    done = linkwork("studio", *words, "--out", "page.html", code=2 if "--set" in words else 1)
    assert said in done.output.replace("\n", " ")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"positions": lambda x, i, p: (0.0,)}, "1 coordinates of 2 joints"),
        ({"paths": ("Q",)}, "no joint 'Q'"),
        ({"parts": (pendulum.MECHANISM.drawing.parts[0]._replace(kind="rope"),)}, "'rope'"),  # type: ignore[union-attr]
    ],
)
def test_a_picture_that_does_not_fit_is_refused(change: dict[str, Any], said: str) -> None:
    drawing = pendulum.MECHANISM.drawing
    assert drawing is not None
    with pytest.raises(MechanismError, match=said):
        check(replace(pendulum.MECHANISM, drawing=drawing._replace(**change)))


# In the browser


@in_browser
def test_the_modules_import_nothing(page: Page) -> None:
    counts = page.evaluate(
        "async () => Promise.all(window.studio.tables.mechanisms.map(async (m) => {"
        " const packed = new Blob([Uint8Array.from(atob(m.module), (c) => c.charCodeAt(0))]).stream();"
        " const all = await new Response(packed.pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();"
        " return WebAssembly.Module.imports(await WebAssembly.compile(all)).length; }))"
    )
    assert counts == [0] * len(OWN)


def _random_five_bar(seed: int) -> Case:
    case = strategies.seeded(seed)
    i = case.torque_inputs
    drive = {"torque": i.torque} if seed % 2 else {"speed": case.state[2]}
    inputs = Inputs(**drive, force=i.force, load_x=i.load_x, load_y=i.load_y)
    return Case(title="", parameters=case.parameters, initial=case.initial, inputs=inputs, stop_time=0.02)


def _random_slider_crank(seed: int) -> Case:
    case = slider_cranks.seeded(seed)
    drive = {"torque": case.torque} if seed % 2 else {"speed": case.state[2]}
    axial = [{"axial_force": case.force}, {"shift_speed": case.state[3]}, {"groove": True}][seed % 3]
    inputs = Inputs(**drive, **axial, load=case.load)
    return Case(title="", parameters=case.parameters, initial=case.initial, inputs=inputs, stop_time=0.02)


@in_browser
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("random", [_random_five_bar, _random_slider_crank])
def test_every_number_of_a_run_is_pythons(page: Page, random: Callable[[int], Case], seed: int) -> None:
    case = random(seed)
    mechanism = find_mechanism(case.parameters)
    found = _load(page, page_state(case) | {"source": "run"})
    columns, count = found["columns"], found["rows"]["count"]
    wanted = simulate(case.parameters, case.inputs, initial=case.initial, stop_time=0.02, **_HELD)
    assert len(wanted) == count > 1
    for name in mechanism.output_names:
        _near(columns[name], wanted[name])
    assert mechanism.drawing is not None
    p, modes = case.parameters.constants(), case.inputs.modes(mechanism)
    acting = mechanism.equations.apply_inputs(tuple(map(float, modes.values())), (0.0,) * len(mechanism.channels), p)
    last = [columns[n][-1] for n in range(mechanism.size)]
    places = [columns[f"{joint.name}{axis}"][-1] for joint in mechanism.drawing.joints for axis in "xyz"]
    _near(places, mechanism.drawing.positions(last, acting, p))
    # and in the table of the page, at an instant
    page.evaluate("document.getElementById('numbers').open = true")
    page.evaluate(f"window.studio.go({count // 2})")
    shown = page.eval_on_selector_all("#numbers td + td", "cells => cells.map((cell) => Number(cell.dataset.value))")
    assert shown == [columns[name][count // 2] for name in mechanism.output_names]


def _varied(seed: int) -> tuple[Any, Drive]:
    """The thesis's mechanism with every quantity a little different, some of them given that it does not have."""
    random, known = np.random.default_rng(seed), PUBLISHED["table-3.1"]
    names = [name for name in known.parameters.__slots__ if getattr(known.parameters, name) not in (0.0, 1)]
    values = {name: getattr(known.parameters, name) * random.uniform(0.95, 1.05) for name in names}
    angle = random.uniform(-0.2, 0.2)
    more = {"slider_coulomb_friction": 0.5, "coupler_point_distance": 0.1, "slider_guide_angle": angle}
    return replace(known.parameters, **values, **more), Drive(speed=random.uniform(25.0, 50.0))


@in_browser
@pytest.mark.parametrize("seed", range(4))
def test_the_periodic_motion_and_its_multipliers_are_pythons(page: Page, seed: int) -> None:
    parameters, drive = _varied(seed)
    mechanism = find_mechanism(parameters)
    case = Case(title="", parameters=parameters, inputs=drive.inputs(mechanism), stop_time=1.0)
    found = _load(page, page_state(case))
    orbit = newton_orbit(parameters, drive)
    turn, count = orbit.turn(720), found["rows"]["count"]
    assert (found["source"], count) == ("steady", 721)
    scale = [parameters.crank_length, parameters.crank_length * drive.speed]
    np.testing.assert_allclose(np.array(found["answer"]["orbit"]["start"]) / scale, orbit.start / scale, atol=CLOSE)
    multipliers = [complex(*pair) for pair in json.loads(page.get_attribute("#floquet", "data-multipliers") or "")]
    _near(np.sort_complex(multipliers), np.sort_complex(orbit.multipliers))
    assert page.inner_text("#floquet b") == orbit.verdict().stability.value
    for name, values in zip(turn.names, turn.values.T):
        _near(found["columns"][name][:-1], values)
    _near(found["columns"]["time"][:-1], turn.time)


def _pin(page: Page, joint: str) -> tuple[float, float]:
    box = page.locator(f'[data-joint="{joint}"] .pin').bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def _drag(page: Page, joint: str, right: float, down: float) -> tuple[float, float]:
    """Drag a joint with the mouse; how far it is from the pointer before it is let go."""
    x, y = _pin(page, joint)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right, y + down, steps=8)
    at = _pin(page, joint)
    page.mouse.up()
    return at[0] - x - right, at[1] - y - down


def _given(page: Page, name: str) -> float:
    value: float = page.evaluate("name => window.studio.state.values[name]", name)
    return value


@in_browser
def test_a_joint_follows_the_pointer_and_its_links_with_it(page: Page) -> None:
    found = _load(page, opening_state())
    at = {axis: found["columns"][f"C{axis}"][0] for axis in "xy"}
    scale = (_pin(page, "O")[0] - _pin(page, "A")[0]) / found["columns"]["Ox"][0]
    away = _drag(page, "C", 30.0, -24.0)
    np.testing.assert_allclose(away, 0.0, atol=0.1)
    first = {joint: [found["columns"][f"{joint}{axis}"][0] for axis in "xy"] for joint in "BD"}
    c = np.array([at["x"] + 30.0 / scale, at["y"] + 24.0 / scale])
    for link, joint in (("coupler", "B"), ("rocker", "D")):
        assert _given(page, f"{link}.length") == pytest.approx(np.hypot(*(c - first[joint])), rel=1e-3)
        field = page.get_attribute(f'[id="field {link}.length"]', "data-value")
        assert field is not None
        assert float(field) == _given(page, f"{link}.length")
    page.keyboard.press("Control+z")
    assert _given(page, "coupler.length") == opening_state()["values"]["coupler.length"]
    page.keyboard.press("Control+Shift+Z")
    assert _given(page, "coupler.length") != opening_state()["values"]["coupler.length"]


@in_browser
def test_links_that_cannot_be_joined_stay_where_they_can_and_the_page_says_so(page: Page) -> None:
    _load(page, opening_state())
    away = _drag(page, "B", -600.0, 0.0)
    assert away[0] > 50.0
    assert "he links cannot be joined" in page.inner_text("#fault")
    values = page.evaluate("window.studio.state.values")
    assert np.isfinite(list(values.values())).all()
    # and by its field
    _load(page, opening_state())
    field = page.locator('[id="field ground.length"]')
    field.fill("900")
    field.press("Enter")
    assert page.inner_text("#fault").startswith("The links cannot be joined at a crank angle of 0 deg")
    assert _given(page, "ground.length") == opening_state()["values"]["ground.length"]


@in_browser
def test_a_slider_that_is_pulled_is_let_go_from_there(page: Page) -> None:
    _load(page, opening_state())
    scale = (_pin(page, "O")[0] - _pin(page, "A")[0]) / opening_state()["values"]["ground.length"]
    u = _shown(page)["columns"]["slider.position"][0]
    _drag(page, "D", 20.0, 0.0)
    page.wait_for_function("window.studio.solver.id === Number(document.documentElement.dataset.answer)")
    assert _shown(page)["source"] == "run"
    assert _shown(page)["columns"]["slider.position"][0] == pytest.approx(u + 20.0 / scale, abs=1e-4)
    assert _given(page, "initial.slider_position") == pytest.approx(u + 20.0 / scale, abs=1e-4)


@in_browser
def test_everything_is_done_from_the_keyboard_too(page: Page) -> None:
    _load(page, opening_state())
    before = _given(page, "coupler.point_distance")
    page.locator('[data-joint="P"]').focus()
    page.keyboard.press("Shift+ArrowUp")
    assert _given(page, "coupler.point_distance") != before
    page.keyboard.press("a")
    assert _given(page, "assembly.branch") == -1.0
    row = page.evaluate("window.studio.shown().row")
    page.keyboard.press(".")
    assert page.evaluate("window.studio.shown().row") == row + 1
    unnamed = page.eval_on_selector_all(
        "button, input, select, [tabindex]",
        "all => all.filter((one) => !(one.getAttribute('aria-label') || one.title || one.textContent.trim()"
        " || one.labels?.length)).map((one) => one.outerHTML)",
    )
    assert unnamed == []


@in_browser
def test_a_locked_dimension_stays(page: Page) -> None:
    state = opening_state()
    _load(page, state | {"locks": ["coupler.length"]})
    _drag(page, "C", 10.0, 0.0)
    assert _given(page, "coupler.length") == state["values"]["coupler.length"]
    assert _given(page, "rocker.length") != state["values"]["rocker.length"]


def _saved(page: Page, form: str) -> Path:
    with page.expect_download() as download:
        page.select_option("#save", form)
    return Path(download.value.path())


@in_browser
@pytest.mark.parametrize(
    "case",
    [_random_five_bar(0), _random_five_bar(1), *map(_random_slider_crank, range(3))],
    ids=["speed", "torque", "pushed", "shifted", "grooved"],
)
def test_a_case_that_is_saved_is_the_case(page: Page, case: Case) -> None:
    _load(page, page_state(case) | {"source": "run"})
    read = read_case(tomllib.loads(_saved(page, "case").read_text(encoding="utf-8")), folder=Path())
    mechanism = find_mechanism(case.parameters)
    assert read.parameters == case.parameters
    assert read.inputs.modes(mechanism) == case.inputs.modes(mechanism)
    wanted, found = page_state(case), page_state(read)
    idle = {"initial." + freedom.initial[1] for freedom in mechanism.freedoms}
    for name, value in wanted["values"].items():
        assert found["values"][name] == value or name in idle, name
    end = {"stop_time": 0.005, "tolerance": 1e-12}
    again = simulate(read.parameters, read.inputs, initial=read.initial, **end)
    before = simulate(case.parameters, case.inputs, initial=case.initial, **end)
    for name in mechanism.output_names:
        _near(again[name], before[name])


@in_browser
def test_motion_drawing_and_lines_are_saved(page: Page, tmp_path: Path) -> None:
    found = _load(page, opening_state())
    table = np.genfromtxt(_saved(page, "table"), delimiter=",", names=True, deletechars="")
    np.testing.assert_array_equal(table["time"], found["columns"]["time"])
    np.testing.assert_array_equal(table["slider.position"], found["columns"]["slider.position"])
    drawing = ElementTree.parse(_saved(page, "svg")).getroot()
    assert len([one for one in drawing.iter() if one.tag.endswith("circle")]) == 7
    assert _saved(page, "png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    # of several motions the lines have that of the page, also where nothing but its start says at which speed it is
    u, rate, speed = newton_orbit(TABLE_3_1, Drive(torque=0.3), start=(0.0, 0.0, 40.0)).start
    start = InitialState(slider_position=u, slider_velocity=rate, crank_speed=speed)
    torque = Case(title="", parameters=TABLE_3_1, inputs=Inputs(torque=0.3), initial=start, stop_time=1.0)
    for state in (opening_state(), page_state(torque)):
        found = _load(page, state)
        printed = called(sys.executable, _saved(page, "python"), cwd=tmp_path)
        assert found["answer"]["orbit"]["found"], found["answer"]["orbit"]
        assert f"{2.0 * np.pi / found['answer']['orbit']['period']:.4g} rad/s" in printed
