"""Pictures of the slider-crank: what is drawn is where the plant has it, to one scale, and can be read."""

from dataclasses import replace
from itertools import pairwise
from math import cos, degrees, pi, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.collections import PolyCollection
from PIL import Image

from analysis.figures import animate_mechanism, plot_mechanism, plot_range, solids
from analysis.figures import slider_crank_picture as pictures
from analysis.slider_crank import constant_shift, groove_shift
from analysis.units import INCH
from linkwork.errors import AssemblyError, InputError
from linkwork.slider_crank.published import parameters
from tests import published_rahman as rahman
from tests.slider_cranks import Case, cases

OFFSET = parameters(10.0)
TWISTED = parameters(20.0, 310.0)
#: A rod too short for a full turn: the crank pin is up to 42 in from the guide.
SHORT = replace(parameters(30.0), rod_length=0.9)


def scene_of(p, angle, shift, view=pictures.VIEW, unit="in"):
    pose = pictures._pose(p, angle, shift, pictures.UNITS[unit])
    parts = pictures._parts(p, constant_shift(shift), pictures.UNITS[unit])
    return pictures._Scene(p, parts, [pose], unit, view), pose


def texts_of(figure):
    return [text.get_text() for axis in figure.axes for text in axis.texts]


class TestProjection:
    @settings(max_examples=25)
    @given(cases(), st.floats(-89.0, 89.0), st.floats(-180.0, 180.0))
    def test_links_keep_their_lengths_in_space_and_page_axes_are_orthonormal(self, case: Case, rise, turn) -> None:
        scene, pose = scene_of(case.parameters, case.state[0], case.state[1], (rise, turn), "mm")
        assert scene.view @ scene.view.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(scene.view) == pytest.approx(1.0)
        # the common normal is upright on the page, and the eye is above by the elevation
        assert scene.page([1.0, 0.0, 0.0]) == pytest.approx([0.0, cos(radians(rise))], abs=1e-12)
        p = case.parameters
        assert np.linalg.norm(pose.crank_pin - pose.centre) == pytest.approx(1e3 * p.crank_length)
        assert np.linalg.norm(pose.slider_pin - pose.crank_pin) == pytest.approx(1e3 * p.rod_length)
        # the slider pin is on the guide, at its position
        assert scene.guide_point(pose.slide) == pytest.approx(pose.slider_pin, abs=1e-6)

    def test_azimuth_turns_from_j_to_k(self) -> None:
        for view, towards in (((0.0, 0.0), (0, 1, 0)), ((0.0, 90.0), (0, 0, 1)), ((90.0, 30.0), (1, 0, 0))):
            scene, _ = scene_of(OFFSET, 0.5, 0.0, view)
            assert scene.view[2] == pytest.approx(towards, abs=1e-12)


class TestSolids:
    @pytest.mark.parametrize("origin", [np.zeros(3), np.array([3.0, -2.0, 7.0])])
    def test_faces_point_outwards_and_enclose_the_volume(self, origin) -> None:
        rows = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
        for faces, volume, tolerance in (
            (solids.box([-1.0, -2.0, 0.0], [3.0, 1.0, 2.0], rows, origin, pieces=3), 24.0, 1e-9),
            (
                solids.cylinder(origin, origin + np.array([0.0, 3.0, 4.0]), 0.5, pieces=4, sides=64),
                5.0 * pi * 0.25,
                0.01,
            ),
            (solids.ball(origin, 2.0, sides=60), 4.0 / 3.0 * pi * 8.0, 0.2),
        ):
            # divergence theorem: a third of the sum of area vector times place
            diagonals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
            outward = (0.5 * diagonals * (faces.mean(axis=1) - origin)).sum(axis=1)
            assert outward.sum() / 3.0 == pytest.approx(volume, abs=tolerance)
            assert (0.5 * diagonals).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)

    def test_only_faces_towards_the_eye_are_painted_from_back_to_front(self) -> None:
        figure = plot_mechanism(OFFSET, radians(30.0), 3.5 * INCH)
        (painted,) = [c for c in figure.axes[0].collections if isinstance(c, PolyCollection)]
        area = [
            0.5 * np.sum(v[:-1, 0] * v[1:, 1] - v[1:, 0] * v[:-1, 1]) for v in (p.vertices for p in painted.get_paths())
        ]
        assert min(area) >= -1e-9
        assert len(area) > 500


class TestMechanism:
    def test_it_says_the_dimensions_and_the_dead_centres(self) -> None:
        said = texts_of(plot_mechanism(OFFSET, radians(30.0), 0.0, unit="in"))
        for words in ("$a_1$ = 12 in", "$a_2$ = 50 in", "$a_4$ = 10 in", "= 270°"):
            assert any(words in text for text in said), words
        for angle in rahman.DEAD_CENTRES_DEG[10.0]:
            assert said.count(f"dead centre {angle:.2f}°") == 2
        assert not any("S_1" in text for text in said)
        assert {"$i_1$", "$j_1$", "$k_1$", "$i_4$", "$j_4$", "$k_4$"} <= set(said)

    def test_the_unit_is_that_of_all_lengths(self) -> None:
        said = texts_of(plot_mechanism(OFFSET, 0.5, 0.1, unit="mm"))
        assert {"$a_4$ = 254 mm", "$S_1$ = 100 mm", "crank $a_1$ = 304.8 mm"} <= set(said)
        with pytest.raises(InputError, match=r"'ft'.* mm, cm, m, in"):
            plot_mechanism(OFFSET, 0.0, unit="ft")

    def test_one_scale_on_both_axes_and_everything_on_the_sheet(self) -> None:
        for p, shift in ((OFFSET, 0.0889), (TWISTED, 0.0), (parameters(-30.0), -0.2), (parameters(0.0), 0.0)):
            figure = plot_mechanism(p, radians(200.0), shift)
            (axis,) = figure.axes
            assert axis.get_aspect() == 1.0
            (painted,) = axis.collections
            points = np.concatenate([path.vertices for path in painted.get_paths()])
            (left, right), (low, high) = axis.get_xlim(), axis.get_ylim()
            assert (points > [left, low]).all()
            assert (points < [right, high]).all()

    def test_letters_do_not_cover_each_other(self) -> None:
        for p, angle, shift in ((OFFSET, 30.0, 0.0889), (TWISTED, 130.0, 0.0), (parameters(20.0, 232.0), 30.0, 0.0)):
            figure = plot_mechanism(p, radians(angle), shift)
            boxes = [text.get_window_extent() for text in figure.axes[0].texts if text.get_text()]
            crossing = [(a, b) for n, a in enumerate(boxes) for b in boxes[:n] if a.overlaps(b)]
            assert not crossing

    def test_paths_go_through_the_pins(self) -> None:
        """The path of the crank pin is its circle about the axis at the shift, that of the slider lies along the guide."""
        scene, _ = scene_of(OFFSET, 0.3, 3.5 * INCH)
        (part,) = scene.parts
        assert np.hypot(*part.crank_pins[:, :2].T) == pytest.approx(12.0)
        assert part.crank_pins[:, 2] == pytest.approx(3.5)
        slides = part.slider_pins[:, 1]
        assert np.ptp(slides) == pytest.approx(24.53, abs=0.002)
        assert part.slider_pins[:, [0, 2]] == pytest.approx(np.broadcast_to([-10.0, 0.0], (len(slides), 2)))
        assert not part.limits

    def test_a_groove_moves_the_path_of_the_crank_pin(self) -> None:
        p = replace(OFFSET, groove_amplitude=3.0 * INCH, groove_ratio=2.0)
        law = groove_shift(p)
        pose = pictures._pose(p, 0.4, law.at(0.4)[0], pictures.UNITS["in"])
        scene = pictures._Scene(p, pictures._parts(p, law, pictures.UNITS["in"]), [pose], "in", pictures.VIEW)
        (part,) = scene.parts
        x, y, z = part.crank_pins.T
        assert z == pytest.approx(3.0 * np.sin(2.0 * np.arctan2(y, x)), abs=1e-9)
        assert any("$S_1$ =" in text for text in texts_of(plot_mechanism(p, 0.4, law.at(0.4)[0], law=law)))

    def test_where_the_crank_cannot_turn_fully_its_limits_are_marked(self) -> None:
        # h = 0 at (12 c + 30)^2 = a2^2
        limit = degrees(np.arccos((0.9 / INCH - 30.0) / 12.0))
        said = texts_of(plot_mechanism(SHORT, pi, 0.0))
        assert said.count(f"limit {limit:.2f}°") == 2
        assert said.count(f"limit {360.0 - limit:.2f}°") == 2

    @pytest.mark.parametrize(
        ("arguments", "error", "words"),
        [
            ((SHORT, 0.0, 0.0), AssemblyError, r"1\.0668 m .* 0\.9 m .* 0\.1668 m"),
            ((OFFSET, 0.0, 1.5), AssemblyError, "m too short"),
            ((OFFSET, np.nan, 0.0), InputError, "crank angle is nan"),
            ((OFFSET, 0.0, np.inf), InputError, "shift is inf"),
        ],
    )
    def test_what_cannot_be_drawn(self, arguments, error, words) -> None:
        with pytest.raises(error, match=words):
            plot_mechanism(*arguments)


class TestRange:
    def test_margin_and_limits(self) -> None:
        figure = plot_range(SHORT, unit="in")
        circle, margin, slider = figure.axes
        limit = degrees(np.arccos((0.9 / INCH - 30.0) / 12.0))
        angle, values = margin.lines[0].get_data()
        # at S1 = 0 and 270 deg the distance is |a1 c + a4|
        assert values == pytest.approx(0.9 / INCH - np.abs(12.0 * np.cos(np.radians(angle)) + 30.0), abs=1e-9)
        marked = sorted({float(line.get_xdata()[0]) for line in slider.lines if line.get_linestyle() == "--"})
        assert marked == pytest.approx([limit, 360.0 - limit], abs=1e-3)
        assert {text.get_text() for text in circle.texts} >= {f"limit\n{limit:.2f}°", f"limit\n{360.0 - limit:.2f}°"}

    def test_a_full_turn_has_its_stroke_and_no_limits(self) -> None:
        figure = plot_range(parameters(30.0), unit="in")
        _, _, slider = figure.axes
        position = slider.lines[0].get_ydata()
        assert np.ptp(position) == pytest.approx(rahman.STROKES_IN[30.0], abs=1e-2)
        assert not any("limit" in text for text in texts_of(figure))

    def test_nowhere(self) -> None:
        figure = plot_range(replace(OFFSET, guide_offset=70.0 * INCH))
        assert "reaches the guide nowhere" in figure.axes[0].get_title()


class TestAnimation:
    def frames(self, path):
        with Image.open(path) as image:
            found = []
            for number in range(image.n_frames):
                image.seek(number)
                found.append(np.asarray(image.convert("L"), dtype=float))
            return found

    def test_a_turn(self, tmp_path) -> None:
        path = animate_mechanism(
            OFFSET, tmp_path / "a" / "turn.gif", law=constant_shift(0.0889), frames=4, title="turn"
        )
        found = self.frames(path)
        assert (len(found), len({frame.shape for frame in found})) == (4, 1)
        for a, b in pairwise(found):
            assert np.abs(a - b).max() > 50.0

    def test_to_and_fro_where_the_crank_cannot_turn_fully(self, tmp_path) -> None:
        """The second half is the first in the other direction."""
        found = self.frames(animate_mechanism(SHORT, tmp_path / "swing.gif", frames=4))
        assert np.abs(found[1] - found[3]).mean() < 0.05
        assert np.abs(found[0] - found[2]).mean() > 1.0

    def test_what_cannot_be_animated(self, tmp_path) -> None:
        with pytest.raises(InputError, match="in 1 frames"):
            animate_mechanism(OFFSET, tmp_path / "x.gif", frames=1)
        far = replace(OFFSET, guide_offset=70.0 * INCH)
        with pytest.raises(AssemblyError, match=r"at any crank angle; .* 0\.2032 m too short"):
            animate_mechanism(far, tmp_path / "x.gif")
        assert not (tmp_path / "x.gif").exists()
