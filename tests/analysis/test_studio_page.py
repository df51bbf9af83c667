"""The studio's page in a browser: what it says in every state, how its charts and controls look, what a fault leaves."""

import re
from typing import Any

import numpy as np
import pytest

from analysis.studio import PAGE, opening_state, page_address

from .test_studio import _drag, _given, _load, _pin, _shown, in_browser

UNDO = "!document.getElementById('undo').disabled"


@pytest.fixture
def page(open_page: Any) -> Any:
    return open_page()


def _settle(page: Any) -> None:
    """Wait for the answer to the last change."""
    page.wait_for_function("window.studio.solver.id === Number(document.documentElement.dataset.answer)")


def _fill(page: Any, name: str, text: str) -> None:
    field = page.locator(f'[id="{name}"]')
    field.fill(text)
    field.press("Enter")


@in_browser
def test_curves_are_told_apart_in_the_legend_and_axes_have_names(page: Any) -> None:
    page.click('[id="tab forces"]')
    marks = page.eval_on_selector_all(".u-legend .u-marker", "all => all.map((one) => one.style.background)")
    dashes = [re.findall(r"stroke-dasharray%3D%22(.*?)%22", mark) for mark in marks]
    assert len({str(dash) for dash in dashes}) == len(marks) == 4
    plot = "window.studio.charts.charts.charts[0].plot"
    # by the keyboard a curve is hidden, and shown again
    for shown in ("false", "true"):
        page.locator(".u-legend button").nth(1).press("Enter")
        assert page.locator(".u-legend button").nth(1).get_attribute("aria-pressed") == shown
        assert page.evaluate(f"String({plot}.series[2].show)") == shown
    axis = f"{plot}.axes[0].label"
    assert page.evaluate(axis) == "crank angle [deg]"
    page.select_option("#source", "run")
    page.wait_for_function("window.studio.shown().source === 'run'")
    assert page.evaluate(axis) == "time [s]"


@in_browser
def test_marks_of_axes_are_written_as_all_numbers_in_every_language(open_page: Any) -> None:
    page = open_page(locale="de-DE")
    axes = "window.studio.charts.charts.charts.map(({ plot }) => plot.axes[1]"
    assert all(len(marks) > 1 for marks in page.evaluate(f"{axes}._values)"))
    assert page.evaluate(f"{axes}.values(plot, [0.25, -10000, 2e6]))")[0] == ["0.25", "-10000", "2e6"]


@in_browser
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_curves_have_the_colours_of_the_theme(open_page: Any, theme: str) -> None:
    page = open_page(color_scheme=theme)
    accent = page.evaluate("getComputedStyle(document.body).getPropertyValue('--accent')")
    assert page.evaluate("window.studio.charts.charts.charts[0].plot.series[1].stroke()") == accent


@in_browser
def test_the_instant_is_marked_in_charts_that_are_opened_anew(page: Any) -> None:
    page.evaluate("window.studio.go(400)")
    page.click('[id="tab power"]')
    page.wait_for_function("""() => {
      const chart = window.studio.charts.charts.charts[0];
      const at = new DOMMatrix(getComputedStyle(chart.line).transform).m41;
      return at > 0 && Math.abs(at - chart.plot.valToPos(200, 'x')) < 1;
    }""")


@in_browser
def test_no_digit_of_a_field_is_cut(page: Any) -> None:
    _load(page, opening_state())
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true })")
    cut = page.eval_on_selector_all(
        ".row:not(.idle) input[type=number]",
        "all => all.filter((one) => { one.value = '-1.2346e-5'; return one.scrollWidth > one.clientWidth })"
        ".map((one) => one.id)",
    )
    assert cut == []
    # nor does a narrow window scroll sideways
    page.set_viewport_size({"width": 320, "height": 568})
    assert page.evaluate("document.documentElement.scrollWidth") == 320


@in_browser
@pytest.mark.parametrize("width", [420, 1366, 1920, 2560])
def test_charts_fill_their_frames_at_any_width(page: Any, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 1000})
    fits = """(one) => one.clientWidth - one.querySelector('.uplot').offsetWidth === 16"""
    page.wait_for_function(f"[...document.querySelectorAll('#curves figure')].every({fits})", timeout=60_000)
    across = page.evaluate("new Set([...document.querySelectorAll('#curves figure')].map((one) => one.offsetTop)).size")
    assert across == (2 if width < 1500 else 1)
    # the tabs above them are buttons of one line of text
    heights = page.eval_on_selector_all("[role=tab]", "all => all.map((one) => one.offsetHeight)")
    assert max(heights) < 40


@in_browser
def test_the_motion_that_is_shown_is_the_one_that_is_named(page: Any) -> None:
    named = "document.getElementById('source').selectedOptions[0].text"
    assert page.evaluate(named) == "periodic"
    page.select_option('[id="field drive.mode"]', label="torque")
    page.wait_for_function("window.studio.shown().source === 'run'")
    assert page.evaluate(named) == "from the start"
    assert page.evaluate("document.getElementById('source').options[0].disabled")
    assert page.inner_text("#floquet") == "Periodic motion: none found"
    assert "driven by a torque and none is given." in page.inner_text("#words")
    page.select_option('[id="field drive.mode"]', label="speed")
    page.wait_for_function("window.studio.shown().source === 'steady'")
    assert page.evaluate(named) == "periodic"
    page.select_option("#source", "run")
    page.wait_for_function("window.studio.shown().source === 'run'")
    assert page.evaluate(named) == "from the start"
    assert not page.evaluate("document.getElementById('source').options[0].disabled")


@in_browser
def test_a_chart_says_what_is_wrong_with_its_axes(page: Any) -> None:
    page.click('[id="tab stability"]')
    page.wait_for_function("window.studio.charts.stability.cells.size > 0")
    page.select_option('[aria-label="Along the height"]', "drive.speed")
    figure = page.locator("#view figure").last
    assert "Both axes are the drive speed: choose another variable for one of them." in figure.inner_text()
    page.select_option('[aria-label="Along the height"]', "slider.damping")
    page.wait_for_function("window.studio.charts.stability.cells.size > 0")
    assert "Both axes" not in figure.inner_text()
    end = page.locator('[aria-label="Along the width: from"]')
    end.fill("9000")
    end.press("Enter")
    assert "The drive speed must go from a smaller to a larger number" in figure.inner_text()
    end.fill("100")
    end.press("Enter")
    assert "smaller to a larger" not in figure.inner_text()


@in_browser
def test_what_is_refused_or_moves_nothing_is_no_step_to_be_undone(page: Any) -> None:
    x, y = _pin(page, "C")
    page.mouse.click(x, y)
    assert not page.evaluate(UNDO)
    _drag(page, "C", 5.0, 0.0)
    page.click("#undo")
    assert not page.evaluate(UNDO)
    for name in ("coupler length", "rocker length"):
        page.get_by_role("checkbox", name=name).check()
    steps = page.evaluate("window.studio.history.past.length")
    _drag(page, "C", 20.0, 0.0)
    _fill(page, "field ground.length", "900")
    assert page.evaluate("window.studio.history.past.length") == steps == 2
    # and its sentence is about what was refused last
    assert page.inner_text("#fault").startswith("The links cannot be joined at a crank angle of 0 deg")
    _drag(page, "C", 20.0, 0.0)
    assert page.inner_text("#fault") == "Coupler length and rocker length are locked"


@in_browser
def test_a_run_starts_where_links_are_dragged_to_that_cannot_be_joined_at_the_start(page: Any) -> None:
    _load(page, opening_state())
    page.evaluate("window.studio.go(220)")
    _drag(page, "C", 100.0, 400.0)
    _settle(page)
    assert page.inner_text("#words").startswith("Comes to an end")
    shown = _shown(page)["columns"]
    apart = [np.hypot(*(shown[f"{start}{axis}"] - shown[f"C{axis}"] for axis in "xy")) for start in "BD"]
    lengths = [_given(page, name) for name in ("coupler.length", "rocker.length")]
    np.testing.assert_allclose(np.array(apart).T, len(apart[0]) * [lengths], rtol=1e-9)


@in_browser
def test_a_worker_that_breaks_off_is_said_and_begun_anew(page: Any) -> None:
    page.evaluate("window.studio.solver.ask({ given: null })")
    page.wait_for_function("document.getElementById('fault').textContent.startsWith('The computation broke off')")
    _fill(page, "field crank.length", "51")
    _settle(page)
    assert page.inner_text("#fault") == ""
    assert page.evaluate("document.documentElement.dataset.settled") == "true"
    # and the worker of the charts
    page.click('[id="tab stability"]')
    page.wait_for_function("window.studio.charts.stability.cells.size > 0")
    page.evaluate("window.studio.charts.stability.explorer.ask({ grid: [1, 1] })")
    page.wait_for_function("document.getElementById('view').textContent.includes('the computation broke off')")
    _fill(page, "field crank.length", "52")
    page.wait_for_function("window.studio.charts.stability.done")
    assert page.evaluate("window.studio.charts.stability.cells.size") > 1


@in_browser
def test_a_state_that_cannot_be_shown_is_said_once_over_one_that_can(page: Any) -> None:
    state = opening_state()
    state["values"] |= {"ground.length": 0.9}
    page.goto("about:blank")
    page.goto(page_address(state, PAGE.as_uri()))
    page.wait_for_function("document.documentElement.dataset.ready")
    assert page.inner_text("body").count("cannot be joined") == 1
    assert page.inner_text("#words").startswith("Turns fully")
    assert _given(page, "ground.length") == opening_state()["values"]["ground.length"]
    # nor does one that comes later
    page.evaluate("document.getElementById('fault').textContent = ''")
    page.evaluate("address => { location.href = address }", page_address(state | {"title": "again"}, PAGE.as_uri()))
    page.wait_for_function("document.getElementById('fault').textContent")
    assert _given(page, "ground.length") == opening_state()["values"]["ground.length"]
    assert not page.evaluate(UNDO)


@in_browser
def test_what_is_rounding_is_none(page: Any) -> None:
    page.evaluate("document.getElementById('numbers').open = true")
    page.evaluate("window.studio.go(100)")
    row = page.locator("#numbers tr").filter(has_text="closure.residual")
    assert float(row.locator("td").last.get_attribute("data-value")) != 0.0
    assert row.locator("td").last.inner_text() == "0 mm"


@in_browser
def test_a_phone_scrolls_over_the_picture_and_its_controls_can_be_hit(phone: Any) -> None:
    page, touch = phone
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true })")
    for tab in ("stability", "forces"):
        page.click(f'[id="tab {tab}"]')
        small = page.eval_on_selector_all(
            "button, input, select, summary, [role=button]",
            "all => all.map((one) => [one, one.getBoundingClientRect()]).filter(([, box]) => box.width > 0"
            " && Math.min(box.width, box.height) < 24).map(([one]) => one.outerHTML)",
        )
        assert small == []
    page.evaluate("scrollTo(0, 0)")
    box = page.locator("#picture").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] - 12
    touch("Start", (x, y))
    for n in range(1, 11):
        touch("Move", (x, y - 15 * n))
    touch("End")
    # it goes on for a while after the finger is lifted
    page.wait_for_function(
        "() => { const last = window.last; window.last = scrollY; return scrollY > 50 && scrollY === last; }",
        polling=100,
    )
    # a finger that takes hold of a joint does not
    scrolled = page.evaluate("scrollY")
    before = _given(page, "coupler.point_distance")
    x, y = _pin(page, "P")
    touch("Start", (x, y))
    for n in range(1, 6):
        touch("Move", (x + 2 * n, y - 4 * n))
    np.testing.assert_allclose(_pin(page, "P"), (x + 10, y - 20), atol=0.5)
    touch("End")
    assert page.evaluate("scrollY") == scrolled
    assert _given(page, "coupler.point_distance") != before
