"""The studio as a widget: its state in Python, and in a host that does what a notebook does for anywidget."""

import re
from pathlib import Path
from typing import Any

import pytest

from analysis.mechanisms import PUBLISHED
from analysis.run import Case, Inputs
from analysis.studio import opening_state, page_state
from linkwork.errors import InputError, LinkworkError

from .test_studio import in_browser

pytest.importorskip("anywidget", reason="anywidget is not installed")
from analysis.studio import widget as widget_module
from analysis.studio.widget import Widget

KNOWN = PUBLISHED["rahman-a4-20-alpha4-232"]
INPUTS = Inputs(speed=KNOWN.crank_speed, shift_speed=0.0)
CASE = Case(title="mine", parameters=KNOWN.parameters, initial=KNOWN.initial, inputs=INPUTS, stop_time=1.0)


@pytest.mark.parametrize(
    ("what", "state"), [(None, opening_state()), (CASE, page_state(CASE))], ids=["nothing", "case"]
)
def test_a_widget_shows_what_it_is_made_of(what: Any, state: dict[str, Any]) -> None:
    widget = Widget(what, height=500)
    assert widget.state == state
    assert widget.height == 500
    assert widget.page.startswith("<!doctype html>")
    assert what is None or widget.case.parameters == CASE.parameters


def test_a_published_set_is_changed_and_held_against_its_mechanism() -> None:
    with pytest.raises(InputError, match="no published set 'table-9'"):
        Widget("table-9")
    widget = Widget("table-3.1")
    known = PUBLISHED["table-3.1"]
    assert (widget.case.parameters, widget.case.initial) == (known.parameters, known.initial)
    widget.change({"crank.length": 0.04})
    assert widget.case.parameters.crank_length == 0.04
    for bad in ({"crank.size": 1.0}, {"crank.length": float("nan")}, {"crank.length": "long"}):
        with pytest.raises(LinkworkError):
            widget.change(bad)
    assert widget.case.parameters.crank_length == 0.04


def test_the_cell_of_the_documentation_runs(capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[2] / "docs" / "studio.md").read_text(encoding="utf-8")
    (cell,) = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(cell, names)
    assert names["found"].parameters.slider_stiffness == 2000.0
    assert "PeriodicOrbit" in capsys.readouterr().out


#: What a notebook is to a widget: a model with traits, and a place on the page.
HOST = """async ([code, traits]) => {
    const listeners = {};
    window.model = {
        get: (name) => traits[name],
        set: (name, value) => { traits[name] = value; listeners[`change:${name}`]?.forEach((one) => one()); },
        save_changes: () => { window.saved = structuredClone(traits.state); },
        on: (name, one) => { (listeners[name] ??= []).push(one); },
        off: (name, one) => { listeners[name] = listeners[name].filter((other) => other !== one); },
        listeners,
    };
    const module = await import(URL.createObjectURL(new Blob([code], { type: "text/javascript" })));
    const el = document.createElement("div");
    document.body.append(el);
    window.leave = await module.default.render({ model, el });
}"""


@in_browser
def test_what_is_dragged_is_known_to_python_and_back(browser: Any) -> None:
    widget = Widget("table-3.1")
    code = Path(widget_module.__file__).with_suffix(".js").read_text(encoding="utf-8")
    host = browser.new_page(viewport={"width": 1200, "height": 900})
    host.set_default_timeout(600_000)
    host.on("pageerror", lambda error: pytest.fail(f"the page: {error}"))
    host.evaluate(HOST, [code, {"page": widget.page, "state": widget.state, "height": 850}])
    frame = host.wait_for_selector("iframe").content_frame()
    frame.wait_for_function("document.documentElement.dataset.ready")
    frame.click("#play")
    # nothing of the notebook is within reach of the page
    assert frame.evaluate("() => { try { return parent.document.title } catch { return 'closed' } }") == "closed"
    assert not frame.locator('#save option[value="link"]').count()
    # from the page
    box = frame.locator('[data-joint="C"] .pin').bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    host.mouse.move(x, y)
    host.mouse.down()
    host.mouse.move(x + 12, y - 9, steps=4)
    host.mouse.up()
    host.wait_for_function("length => window.saved?.values['coupler.length'] !== length", arg=0.15)
    saved = host.evaluate("window.saved")
    assert saved["values"]["coupler.length"] != PUBLISHED["table-3.1"].parameters.coupler_length
    widget.state = saved
    assert widget.case.parameters.coupler_length == saved["values"]["coupler.length"]
    # to the page
    widget.change({"crank.length": 0.04})
    host.evaluate("state => model.set('state', state)", widget.state)
    frame.wait_for_function("window.studio.state.values['crank.length'] === 0.04")
    host.evaluate("model.set('state', { mechanism: 'cart' })")
    frame.wait_for_function("document.getElementById('fault').textContent.includes('no mechanism')")
    host.evaluate("window.leave()")
    assert host.evaluate("model.listeners['change:state']") == []
    host.close()
