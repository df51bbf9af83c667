"""Drawings to scale: DXF and SVG, read back by other libraries."""

import re
import sys
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
import svgelements
from ezdxf import bbox

from analysis import files
from analysis.files import Circle, Dimension, Drawing, Line, Polyline, Text, save_drawing, to_dxf, to_svg  # fmt: skip
from analysis.files.drawings import UNITS
from analysis.synthesis.result.output import LAYERS
from linkwork.errors import InputError, LinkworkError, ParameterError, UnknownNameError
from tests.scripts import called

RNG = np.random.default_rng(4)
CURVE = RNG.normal(size=(72, 2)) * 0.1 + [0.3, -0.2]
TARGET = RNG.normal(size=(9, 2)) * 0.1
CRANK = Line(layer="crank", start=(0.0, 0.0), end=(0.05, 0.02))
PIN = Circle(layer="ground", centre=(0.0, 0.0), radius=0.004)
PATH = Polyline(layer="coupler-curve", points=CURVE, closed=True)
DRAWING = Drawing(
    layers=LAYERS,
    title="Four-bar <a & b>, ø 5",
    lines=(CRANK, Line(layer="ground", start=(0.0, 0.0), end=(0.4, 0.0))),
    circles=(PIN, replace(PIN, layer="slider", centre=(0.4, 0.01), radius=0.8)),
    polylines=(PATH, Polyline(layer="target", points=TARGET, closed=False)),
    texts=(Text(layer="text", position=(0.1, 0.2), height=0.005, text="l2 = 50 mm & µ < 1"),),
)


def read_dxf(text: str) -> Any:
    return ezdxf.read(StringIO(text))


@pytest.mark.parametrize(
    ("unit", "metre", "code"), [("mm", 1e-3, 4), ("cm", 1e-2, 5), ("m", 1.0, 6), ("in", 0.0254, 1)]
)
def test_dxf_reads_back(unit: str, metre: float, code: int) -> None:
    document = read_dxf(to_dxf(DRAWING, unit))
    auditor = document.audit()
    assert not auditor.errors
    assert not auditor.fixes
    assert document.header["$INSUNITS"] == code
    assert document.header["$MEASUREMENT"] == (0 if unit == "in" else 1)
    (view,) = document.viewports.get("*Active")
    # a little more than the drawing's 1.6 m, about its middle
    assert view.dxf.height * metre == pytest.approx(1.76)
    assert np.array(view.dxf.center)[:2] * metre == pytest.approx([0.4, 0.01])
    assert {layer.dxf.name for layer in document.layers} >= set(LAYERS)
    assert document.layers.get("crank").rgb == (0xC0, 0x39, 0x2B)
    assert document.layers.get("crank").dxf.lineweight == 50
    space = document.modelspace()
    assert len(space) == 7
    # by layer, whatever is drawn later over it
    ground, crank = space.query("LINE")
    assert (ground.dxf.layer, crank.dxf.layer) == ("ground", "crank")
    order = [list(LAYERS).index(e.dxf.layer) for e in space if e.dxftype() != "TEXT"]
    assert order == sorted(order)
    assert np.array(crank.dxf.end)[:2] * metre == pytest.approx([0.05, 0.02], abs=1e-9)
    assert np.array(ground.dxf.end)[:2] * metre == pytest.approx([0.4, 0.0], abs=1e-9)
    pin, slider = space.query("CIRCLE")
    assert (pin.dxf.layer, slider.dxf.layer) == ("ground", "slider")
    assert slider.dxf.radius * metre == pytest.approx(0.8)
    assert np.array(slider.dxf.center)[:2] * metre == pytest.approx([0.4, 0.01])
    curve, target = space.query("LWPOLYLINE")
    assert (curve.closed, target.closed) == (True, False)
    assert (curve.dxf.layer, target.dxf.layer) == ("coupler-curve", "target")
    assert np.array(curve.get_points("xy")) * metre == pytest.approx(CURVE, abs=1e-9)
    assert np.array(target.get_points("xy")) * metre == pytest.approx(TARGET, abs=1e-9)
    (text,) = space.query("TEXT")
    assert text.dxf.text == "l2 = 50 mm & µ < 1"
    assert text.dxf.height * metre == pytest.approx(0.005)
    assert np.array(text.dxf.insert)[:2] * metre == pytest.approx([0.1, 0.2])
    assert dict(document.header.custom_vars.properties)["Title"] == DRAWING.title


def test_a_wide_drawing_is_seen_whole() -> None:
    wide = Drawing(layers=LAYERS, title="wide", lines=(Line(layer="crank", start=(1.0, 0.0), end=(3.0, 0.1)),))
    (view,) = read_dxf(to_dxf(wide)).viewports.get("*Active")
    # a view twice as wide as high, and a little more
    assert view.dxf.height == pytest.approx(1100.0)


@pytest.mark.parametrize("turned", [0.0, 30.0, 90.0, 150.0, 180.0, 270.0])
def test_a_dimension_is_written_beside_its_way(turned: float) -> None:
    """By hand for a way along x, turned about the origin; the number is read from below or from the right."""
    turn = np.exp(1j * np.radians(turned))
    end = 0.4 * turn
    dimension = Dimension(layer="dimension", start=(0.0, 0.0), end=(end.real, end.imag), offset=0.1, height=0.01)
    crank = Line(layer="crank", start=dimension.start, end=dimension.end)
    drawing = Drawing(layers=LAYERS, title="a way", lines=(crank,), dimensions=(dimension,))
    root = ElementTree.fromstring(to_svg(drawing))
    (group,) = (e for e in root if e.get("id") == "dimension")

    def along(shape: Any) -> list[complex]:
        """Its numbers as points, in the frame of the way."""
        numbers = re.findall(r"-?[\d.]+(?:e-\d+)?", shape)
        return [1e-3 * complex(float(x), -float(y)) / turn for x, y in zip(numbers[::2], numbers[1::2])]

    lines = [along(" ".join(e.attrib[key] for key in ("x1", "y1", "x2", "y2"))) for e in group if "x1" in e.attrib]
    assert lines == [pytest.approx(ends, abs=1e-9) for ends in ([0.1j, 0.4 + 0.1j], [0.0, 0.1j], [0.4, 0.4 + 0.1j])]
    arrows = [along(e.attrib["d"]) for e in group if "d" in e.attrib]
    ends = ([0.01 + 0.102j, 0.1j, 0.01 + 0.098j], [0.39 + 0.098j, 0.4 + 0.1j, 0.39 + 0.102j])
    assert arrows == [pytest.approx(points, abs=1e-9) for points in ends]
    (text,) = (e for e in group if e.text and e.text.strip())
    way = (turned + 89.0) % 180.0 - 89.0
    above = 0.003j if abs(way - turned) < 1.0 else -0.003j
    assert along(f"{text.attrib['x']} {text.attrib['y']}") == pytest.approx([0.2 + 0.1j + above], abs=1e-9)
    rotation = re.match(r"rotate\((\S+)", text.attrib["transform"])
    assert rotation[1] == f"{0.0 - way:.6g}"
    # in DXF, too
    (drawn,) = read_dxf(to_dxf(drawing)).query("DIMENSION")
    (number,) = (e for e in drawn.virtual_entities() if e.dxftype() == "MTEXT")
    assert (number.get_rotation() + 89.0) % 360.0 - 89.0 == pytest.approx(way)
    at = complex(number.dxf.insert.x, number.dxf.insert.y)
    assert at / turn == pytest.approx(200.0 + 100.0j, abs=12.0)
    # arrows at both ends, as large as the letters
    arrows = [e for e in drawn.virtual_entities() if e.dxftype() == "INSERT"]
    assert [e.dxf.xscale for e in arrows] == pytest.approx([number.dxf.char_height] * 2)


def test_extents() -> None:
    (left, bottom), (right, top) = DRAWING.extents
    assert (left, bottom, right, top) == pytest.approx((-0.4, -0.79, 1.2, 0.81))
    document = read_dxf(to_dxf(DRAWING))
    box = bbox.extents(document.modelspace().query("LINE CIRCLE LWPOLYLINE"), fast=False)
    assert np.array([box.extmin, box.extmax])[:, :2] / 1e3 == pytest.approx(np.array(DRAWING.extents), abs=1e-3)
    assert np.array(document.header["$EXTMIN"]) / 1e3 == pytest.approx([left, bottom, 0.0])
    assert np.array(document.header["$EXTMAX"]) / 1e3 == pytest.approx([right, top, 0.0])


@pytest.mark.parametrize("unit", ["mm", "cm", "in"])
def test_svg_reads_back(tmp_path: Path, unit: str) -> None:
    path = save_drawing(tmp_path / "a.svg", DRAWING, unit=unit)
    for name, points, closed in (("coupler-curve", CURVE, True), ("target", TARGET, False)):
        again, found = files.read_points(path, name=name)
        assert found == closed
        assert again == pytest.approx(points, abs=1e-9)


def test_svg_has_real_size_and_layers() -> None:
    root = ElementTree.fromstring(to_svg(DRAWING))
    width, height = (float(root.attrib[key].removesuffix("mm")) for key in ("width", "height"))
    # 5 % of 1.6 m to each side
    assert (width, height) == pytest.approx((1760.0, 1760.0))
    assert [float(v) for v in root.attrib["viewBox"].split()] == pytest.approx([-480.0, -890.0, 1760.0, 1760.0])
    ns = "{http://www.w3.org/2000/svg}"
    layers = [group.get("id") for group in root.iter(f"{ns}g")]
    assert layers == ["ground", "crank", "slider", "coupler-curve", "target", "text"]
    assert root.findtext(f"{ns}title") == DRAWING.title
    text = root.find(f"{ns}g/{ns}text")
    tilted = Drawing(layers=LAYERS, title="", lines=(replace(CRANK, start=(0.01, 0.02), end=(0.03, -0.04)),))
    line = ElementTree.fromstring(to_svg(tilted)).find(f"{ns}g/{ns}line")
    assert {k: float(v) for k, v in line.attrib.items()} == pytest.approx({"x1": 10, "y1": -20, "x2": 30, "y2": 40})
    assert (float(text.attrib["x"]), float(text.attrib["y"])) == pytest.approx((100.0, -200.0))
    assert root.findtext(f"{ns}g/{ns}text") == "l2 = 50 mm & µ < 1"


def test_svg_as_svgelements_sees_it() -> None:
    drawing = svgelements.SVG.parse(StringIO(to_svg(DRAWING)))
    user = ~svgelements.Matrix(drawing.viewbox_transform)
    (curve, _) = (svgelements.Path(e) * user for e in drawing.elements() if isinstance(e, svgelements.Path))
    points = np.array([[segment.end.x, -segment.end.y] for segment in abs(curve)])
    # 72 points, and the end of the closing line
    assert points * 1e-3 == pytest.approx(np.vstack([CURVE, CURVE[:1]]), abs=1e-9)
    (circle,) = (e for e in drawing.elements() if isinstance(e, svgelements.Circle) and e.implicit_r > 1000.0)
    # 800 mm at 96 px an inch, by svgelements's own scale
    assert circle.implicit_r == pytest.approx(800.0 * 96.0 / 25.4, rel=1e-6)
    assert circle.implicit_center.y == pytest.approx((890.0 - 10.0) * 96.0 / 25.4, rel=1e-6)


def test_same_drawing_same_bytes() -> None:
    code = (
        "import hashlib; from tests.analysis.test_drawings import DRAWING, to_dxf, to_svg; "
        "print(hashlib.sha256((to_dxf(DRAWING) + to_svg(DRAWING)).encode()).hexdigest())"
    )
    here, seeds = Path(__file__).parents[2], [{"PYTHONHASHSEED": seed, "PATH": ""} for seed in ("1", "4")]
    digests = {called(sys.executable, "-c", code, env=env, cwd=here) for env in seeds}
    assert len(digests) == 1
    dxf = to_dxf(DRAWING)
    for name in ("$FINGERPRINTGUID", "$VERSIONGUID"):
        assert f"{name}\n  2\n{{00000000-0000-0000-0000-000000000000}}\n" in dxf
    for name in ("$TDCREATE", "$TDUPDATE", "$TDUCREATE", "$TDUUPDATE"):
        assert f"{name}\n 40\n0.0\n" in dxf


def test_file_endings(tmp_path: Path) -> None:
    path = save_drawing(tmp_path / "new" / "a.DXF", DRAWING, unit="m")
    assert path.read_bytes() == to_dxf(DRAWING, "m").encode()
    assert len(ezdxf.readfile(path).modelspace()) == 7
    with pytest.raises(InputError, match=r"\.dxf or \.svg"):
        save_drawing(tmp_path / "a.pdf", DRAWING)
    for ending, unit in ((".svg", "m"), (".dxf", "km")):
        with pytest.raises(ParameterError, match="unit"):
            save_drawing(tmp_path / f"b{ending}", DRAWING, unit=unit)
        assert not (tmp_path / f"b{ending}").exists()
    assert set(UNITS) == {"mm", "cm", "m", "in"}


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Line(layer="crank", start=(0.0, float("nan")), end=(1.0, 1.0)), "on layer crank: .* finite"),
        (lambda: replace(PIN, radius=0.0), "radius=0.0"),
        (lambda: replace(PIN, radius=float("inf")), "finite"),
        (lambda: Polyline(layer="target", points=np.zeros((1, 2))), r"\(n, 2\)"),
        (lambda: Polyline(layer="target", points=np.zeros((4, 3))), r"\(n, 2\)"),
        (lambda: Polyline(layer="plate", points=np.eye(2), bulges=(0.5,)), "bulges"),
        (lambda: Polyline(layer="plate", points=np.eye(2), bulges=(0.5, 1.5)), "-1 to 1"),
        (lambda: Dimension(layer="dimension", start=(0.0, 0.0), end=(0.0, 0.0), offset=0.1, height=0.1), "apart"),
        (lambda: Polyline(layer="target", points=np.array([[0, 0], [np.inf, 0]])), "finite"),
        (lambda: Text(layer="text", position=(0.0, 0.0), height=-1.0, text="a"), "height=-1.0"),
        (lambda: Text(layer="text", position=(0.0, 0.0), height=1.0, text="a\nb"), "one line"),
        (lambda: Text(layer="text", position=(0.0, 0.0), height=1.0, text=""), "one line"),
        (lambda: Drawing(layers=LAYERS, title="a\x00"), "title"),
        (lambda: Drawing(layers=LAYERS, title="a"), "nothing is drawn"),
        (lambda: Drawing(layers=LAYERS, title="a", lines=(replace(CRANK, end=CRANK.start),)), "at one point"),
    ],
)
def test_what_cannot_be_drawn_is_refused(build: Any, message: str) -> None:
    with pytest.raises(LinkworkError, match=message):
        build()


def test_unknown_layers_are_refused() -> None:
    with pytest.raises(UnknownNameError, match=r"'cranc'.* crank"):
        Drawing(layers=LAYERS, title="", lines=(Line(layer="cranc", start=(0.0, 0.0), end=(1.0, 1.0)),))


@pytest.mark.parametrize(
    ("length", "unit", "number"),
    [
        (0.0485486, "mm", "48.55"),
        (0.0485486, "m", "0.04855"),
        (0.4257e-3, "mm", "0.4257"),
        (0.6, "mm", "600"),
        (425.7390851, "mm", "425739.09"),
    ],
)
def test_the_number_of_a_dimension_is_as_exact_in_every_unit(length: float, unit: str, number: str) -> None:
    dimension = Dimension(layer="dimension", start=(0.0, 0.0), end=(length, 0.0), offset=length, height=0.1 * length)
    way = Line(layer="crank", start=dimension.start, end=dimension.end)
    drawn = read_dxf(to_dxf(Drawing(layers=LAYERS, title="a way", lines=(way,), dimensions=(dimension,)), unit))
    assert [e.dxf.text for e in drawn.query("DIMENSION")] == [number]
