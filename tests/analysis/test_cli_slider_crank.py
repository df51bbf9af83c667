"""`linkwork slider-crank`: what it prints and writes, its exit codes, and what it says of wrong input."""

import re
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from matplotlib.text import Text

from analysis import cli, figures
from analysis.run import save_parameters
from analysis.slider_crank import ConstantShift, dual_dynamics, force_turn
from analysis.units import INCH
from linkwork.five_bar.published import TABLE_3_1
from linkwork.slider_crank.published import CRANK_SPEED, parameters
from tests import published_rahman as rahman

from .conftest import cells, csv


@pytest.fixture
def linkwork(linkwork):
    return lambda typed, *words, **options: linkwork(f"slider-crank {typed}", *words, **options)


class TestInfo:
    def test_strokes_dead_centres_and_greatest_shift_are_the_published_ones(self, linkwork):
        offset = 10.0
        result = linkwork("info --offset", f"{offset} in", "--shift", "0 in", "--units", "inch")
        assert "turns fully" in cells(result.output)["the crank"]
        shift = cells(result.output)["greatest constant shift for a full turn"][0]
        assert float(shift.removesuffix(" in")) == pytest.approx(rahman.GREATEST_SHIFTS_IN[offset], abs=6e-4)
        stroke = re.search(r"range 0\.00 deg to 360\.00 deg: stroke ([\d.]+) in", result.output)
        assert float(stroke[1]) == pytest.approx(rahman.STROKES_IN[offset], abs=6e-4)
        outer, inner = rahman.DEAD_CENTRES_DEG[offset]
        assert cells(result.output)[f"{outer:.2f}"][-1] == "outer"
        assert cells(result.output)[f"{inner:.2f}"][-1] == "inner"

    @pytest.mark.parametrize(
        ("words", "shown", "said"),
        [
            ("", {"shift S1": "88.9 mm", "crank a1, rod a2": "304.8 mm, 1270 mm"}, ""),
            ("--units inch", {"shift S1": "3.5 in"}, ""),
            # at 270 deg the pin is sqrt((12 c + 30)^2 + 40^2) from the guide: 50 at c = 0, 58 at c = 1
            (
                "--offset '30 in' --shift '40 in' --units inch",
                {"the crank": "does not turn fully", "least assembly margin": "-8 in at 0.00 deg"},
                "range 90.00 deg to 270.00 deg",
            ),
            (
                "--groove shaft --set 'groove.amplitude=3 in' --set groove.ratio=2 --units inch",
                {"shift S1": "made by the groove", "the crank": "turns fully"},
                "SS1 = 3 in, alpha = 2",
            ),
        ],
    )
    def test_the_table(self, linkwork, words, shown, said):
        result = linkwork(f"info {words}")
        found = cells(result.output)
        assert {name: found[name] for name in shown} == {name: [cell] for name, cell in shown.items()}
        assert said in result.output


class TestParameterFiles:
    @pytest.mark.parametrize("ending", ["toml", "json"])
    def test_a_file_is_read(self, linkwork, tmp_path, ending):
        save_parameters(tmp_path / f"mine.{ending}", replace(parameters(30.0), rod_length=1.5))
        result = linkwork("info", f"mine.{ending}", "--shift", "1 in")
        assert cells(result.output)["crank a1, rod a2"] == ["304.8 mm, 1500 mm"]
        assert cells(result.output)["shift S1"] == ["25.4 mm"]
        result = linkwork("info", f"mine.{ending}", "--set", "rod.length=2 m")
        assert cells(result.output)["crank a1, rod a2"] == ["304.8 mm, 2000 mm"]
        assert cells(result.output)["shift S1"] == ["0 mm"]

    def test_what_a_file_does_not_say_is_told(self, linkwork, tmp_path):
        save_parameters(tmp_path / "mine.toml", replace(parameters(30.0), groove_amplitude=0.01))
        said = " ".join(linkwork("forces mine.toml --points 3 --no-plot --units inch").stderr.split())
        assert "S1 = 0 in (--shift), no groove (--groove), a crank speed of 50 rpm (--speed)" in said
        assert "rpm" not in linkwork("info mine.toml").stderr
        assert linkwork("forces mine.toml --points 3 --no-plot --shift 0 --speed '1 rad/s'").stderr == ""
        assert linkwork("info mine.toml --groove shaft").stderr == ""

    def test_a_file_of_the_other_mechanism(self, linkwork, tmp_path):
        save_parameters(tmp_path / "five.toml", TABLE_3_1)
        result = linkwork("info five.toml", code=cli.WRONG)
        said = 'five.toml is of a five-bar: for a slider-crank it must begin with mechanism = "slider-crank"'
        assert said in " ".join(result.stderr.split())


class TestForces:
    def test_torque_given_at_the_published_spot(self, linkwork, tmp_path):
        result = linkwork("forces --torque '100 lbf*in' --units inch --points 361 --no-plot")
        columns = csv(tmp_path / "out" / "rahman-a4-10-s1-3.5-forces.csv")
        spot = rahman.SPOTS[0]
        assert columns["crank angle [deg]"][30] == pytest.approx(30.0)
        assert columns["slider position [in]"][30] == pytest.approx(spot.position_in, abs=1e-6)
        assert columns["slider force [lb]"][30] == pytest.approx(spot.slider_force_lb, abs=1e-6)
        assert "slider force sought" in result.output
        for angle in ("99.30", "285.31"):
            assert f"dead centre at {angle} deg" in result.output
            assert f"no slider force at {angle} deg" in result.output
        # clear of the poles by 10 deg
        least, at_least, greatest, at_greatest = cells(result.output)["slider force"][1:]
        for value, angle in ((least, at_least), (greatest, at_greatest)):
            assert columns["slider force [lb]"][round(float(angle))] == pytest.approx(float(value), rel=1e-5)
            assert min(abs(float(angle) - 99.30), abs(float(angle) - 285.31)) > 10.0
        position = [float(x) for x in cells(result.output)["slider position"][1::2]]
        assert position[1] - position[0] == pytest.approx(24.53, abs=2e-3)

    def test_a_load_and_a_speed(self, linkwork, tmp_path):
        result = linkwork("forces --load '-20 lbf' --speed '100 rpm' --points 13 --no-plot")
        # a constant has no angles, be it zero apart from rounding
        assert "".join(cells(result.output)["slider force"][2::2]) == ""
        assert "".join(cells(result.output)["force of the guide on the slider, j1"][2::2]) == ""
        columns = csv(tmp_path / "out" / "rahman-a4-10-s1-3.5-forces.csv")
        assert columns["slider force [N]"] == pytest.approx(-20.0 * rahman.POUND_FORCE)
        shift = ConstantShift(3.5 * INCH)
        slow = force_turn(parameters(10.0), crank_speed=CRANK_SPEED, shift=shift, angles=[radians(30.0)])
        assert columns["slider velocity [m/s]"][1] == pytest.approx(2.0 * slow.slider_velocity[0])

    def test_plots_in_the_frames_asked_for(self, linkwork, tmp_path):
        result = linkwork("forces --frame 2 --frame 4 --points 37 --torque '1 N*m' --out results")
        assert {p.name for p in (tmp_path / "results").glob("[!.]*")} == {
            "rahman-a4-10-s1-3.5-forces.csv",
            "rahman-a4-10-s1-3.5-forces-frame-2.png",
            "rahman-a4-10-s1-3.5-forces-frame-4.png",
        }
        assert "force of the crank on the rod, j2" in result.output
        assert "force of the crank on the rod, j1" not in result.output
        # statement of section 3.2: no moments on the slider
        for axis in "ijk":
            assert cells(result.output)[f"moment of the guide on the slider, {axis}4"][1::2] == ["0", "0"]

    def test_the_plot_has_gaps_at_the_dead_centres_and_is_scaled_clear_of_them(self):
        turn = force_turn(parameters(10.0), crank_speed=CRANK_SPEED, angles=np.radians(np.arange(361.0)), torque=11.3)
        figure = figures.plot(turn, 4, title="forces")
        (axis,) = [a for a in figure.axes if a.get_title() == "slider force, along -k4"]
        values = axis.lines[0].get_ydata()
        assert [int(i) for i in np.flatnonzero(np.isnan(values))] == [99, 285]
        low, high = axis.get_ylim()
        assert high - low < 0.2 * np.ptp(np.delete(values, [99, 285]))
        clear = np.delete(values, [*range(90, 109), *range(276, 295)])
        assert low < clear.min()
        assert clear.max() < high
        titles = [a.get_title() for a in figure.axes]
        # neither the axial force nor the moment of the guide, which are zero but for rounding, nor the torque that is given
        assert len(titles) == 7
        assert figure.get_supxlabel().splitlines() == [
            "Dashed: dead centre 99.3°, dead centre 285.3°.",
            "Constant, not drawn: crank torque 11.3 N.m.",
            "Zero throughout, not drawn: axial force on the crank; moment of the guide on the slider.",
        ]
        assert not any(axis.texts for axis in figure.axes)
        position = figure.axes[titles.index("slider position S4")].lines[0].get_ydata()
        assert np.isfinite(position).all()

    def test_extremes_do_not_depend_on_the_number_of_points_where_there_are_limits(self, linkwork):
        """Towards the ends of a range the forces grow without bound."""
        found = []
        for points in (721, 1441):
            result = linkwork(f"forces --set 'rod.length=30 in' --offset=-20in --shift 0 --points {points} --no-plot")
            row = cells(result.output)["force of the crank on the rod, i1"]
            found.append([float(row[1]), float(row[3])])
        assert found[0] == pytest.approx(found[1], rel=0.05)

    def test_no_curve_where_it_cannot_be_assembled(self):
        """The rod is too short from 146.4 to 213.6 deg, acos(-20/12 + 30/12): a gap in every panel."""
        mechanism = replace(parameters(-20.0), rod_length=30.0 * INCH)
        angles = np.radians(np.arange(361.0))
        turn = force_turn(mechanism, crank_speed=CRANK_SPEED, angles=angles, load=-9.0, partial=True)
        low = np.degrees(np.arccos(-10.0 / 12.0))
        assert np.degrees(turn.limits) == pytest.approx([low, 360.0 - low])
        assert [float(np.degrees(turn.angle[i])) for i in turn.breaks] == pytest.approx([146.0])
        for axis in figures.plot(turn, title="").axes:
            for line in axis.lines:
                x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
                if len(x) < 3:  # a mark
                    continue
                # every piece that is drawn is a degree long
                drawn = np.isfinite(y[1:]) & np.isfinite(y[:-1])
                assert np.diff(x)[drawn] == pytest.approx(1.0)
                assert np.isnan(y).sum() == 1
            if axis.get_title().startswith("force of the crank on the rod"):
                clear = turn.vector("crank_pin")[turn.clear()]
                assert np.ptp(axis.get_ylim()) < 1.3 * np.ptp(clear)

    def test_a_slider_without_a_lever(self, linkwork):
        """Guide and crank axis in one line: the slider stands still, whatever the crank does."""
        still = ("--twist", "180 deg", "--offset", 0)
        result = linkwork("forces", *still, "--torque", "1 N*m", "--no-plot")
        assert result.output.count("no lever on the crank") == 1
        assert "the slider has no lever on the crank at any angle" in result.output
        result = linkwork("info", *still)
        assert cells(result.output)["greatest constant shift for a full turn"] == ["any"]
        assert "no dead centres: the slider stands still" in result.output
        for command, *more in (("dual",), ("tolerances", "--quantity", "slider.load", "--samples", 9)):
            result = linkwork(command, *more, *still, "--torque", "1 N*m", "--points", 13, code=cli.WRONG)
            assert "the slider has no lever on the crank at any angle" in result.stderr
        # what the load has no part in is determined all the same
        result = linkwork("tolerances", *still, "--torque", "1", "--points", 3, "--samples", 9, "--no-plot")

    def test_a_crank_that_cannot_turn_fully(self, linkwork, tmp_path):
        result = linkwork("forces --set 'rod.length=30 in' --offset '20 in' --points 73 --no-plot --load '9 N'")
        # what grows without bound towards the ends of the range is no extreme
        end = np.degrees(np.arccos((np.sqrt(30.0**2 - 3.5**2) - 20.0) / 12.0))
        for place in (end, 360.0 - end):
            assert f"limit of assembly at {place:.2f} deg" in result.output
        for name, row in cells(result.output).items():
            for angle in filter(None, row[2::2]):  # constants have none
                assert 45.4 < float(angle) < 314.6 or name == "slider position", name
        # it does from 35.3 to 324.7 deg: 12 c + 20 is there sqrt(30^2 - 3.5^2)
        assert "the rod does not reach the guide at 16 of 73 crank angles" in " ".join(result.stderr.split())
        columns = csv(tmp_path / "out" / "slider-crank-forces.csv")
        assert len(columns["crank angle [rad]"]) == 57


class TestTolerances:
    @pytest.mark.parametrize("asked", ["-30 deg", "330 deg", "1050 deg"])
    def test_the_angle_is_the_one_that_was_asked_for(self, linkwork, tmp_path, asked):
        result = linkwork("tolerances", f"--angle={asked}", "--points", 5, "--samples", 50, "--no-plot")
        assert "at 330 deg" in result.output
        columns = csv(tmp_path / "out" / "rahman-a4-10-s1-3.5-tolerances.csv")
        assert columns["crank angle [deg]"] == pytest.approx([0.0, 90.0, 180.0, 270.0, 330.0, 360.0])

    def test_an_angle_that_cannot_be_assembled_is_reported(self, linkwork):
        short = ("--set", "rod.length=30 in", "--offset", "20 in", "--shift", 0)
        result = linkwork("tolerances", *short, "--angle", 0, "--points", 37, "--samples", 50, "--no-plot")
        said = " ".join(result.stderr.split())
        assert "the mechanism cannot be assembled at 0 deg: the nearest sampled angle, 40 deg, is used" in said

    def test_an_angle_of_another_turn_under_a_groove_of_half_a_period(self, linkwork):
        half = ("--groove", "apart", "--set", "groove.amplitude=1 in", "--set", "groove.ratio=0.5")
        result = linkwork("tolerances", *half, "--angle", "390 deg", code=cli.WRONG)
        assert "give an angle from 0 to 360 deg" in " ".join(result.stderr.split())

    def test_pictures_and_notes_are_in_inches_too(self, linkwork, monkeypatch):
        drawn = []
        right = figures.plot
        monkeypatch.setattr(figures, "plot", lambda *a, **options: drawn.append(right(*a, **options)) or drawn[-1])
        arguments = (
            "tolerances", "--published", "rahman-ideal", "--tolerance", "shift.position=0.5 in", "--points", 3, "--samples",
            500,
        )  # fmt: skip
        notes = [" ".join(linkwork(*arguments, "--units", units).stderr.split()) for units in ("inch", "SI")]
        for note, figure, units in zip(notes, drawn, ("in", "mm")):
            said = re.search(rf"the linear estimate.* deviation is [\d.e-]+ {units}, to second .*", note)[0]
            foot = " ".join(" ".join(x.get_text() for x in figure.findobj(Text)).split())
            assert said[1:] in foot
            assert f"error of slider position [{units}]" in foot
        numbers = [float(re.search(r"deviation is ([\d.e-]+) ", note)[1]) for note in notes]
        assert numbers[0] * 1e3 * INCH == pytest.approx(numbers[1], rel=5e-3)

    def test_a_seed_gives_the_same_samples(self, linkwork, tmp_path):
        found = []
        for seed in (7, 7, 8):
            linkwork("tolerances --points 3 --samples 500 --seed", seed, "--no-plot")
            found.append((tmp_path / "out" / "rahman-a4-10-s1-3.5-tolerances.csv").read_bytes())
        assert found[0] == found[1] != found[2]

    def test_tolerances_and_quantities_are_chosen(self, linkwork, tmp_path):
        sought = "--quantity crank_pin.fz --quantity slider.load --torque '100 lbf*in' --points 13 --samples 1000"
        result = linkwork(f"tolerances --tolerance 'guide.twist=0.3 deg' --distribution uniform --no-plot {sought}")
        columns = csv(tmp_path / "out" / "rahman-a4-10-s1-3.5-tolerances.csv")
        slopes = csv(tmp_path / "out" / "rahman-a4-10-s1-3.5-sensitivities.csv")
        for quantity in ("crank_pin.fz", "slider.load"):
            slope = slopes[f"d {quantity} / d guide.twist [N/deg]"]
            deviation = columns[f"{quantity} linear standard deviation [N]"]
            assert deviation == pytest.approx(np.abs(slope) * 0.3 / np.sqrt(3.0))
        # the greatest value listed is clear of the dead centres
        top = next(line for line in result.output.splitlines() if "slider.load" in line and "N/deg" in line)
        angle = float(top.strip("│ ").split("│")[-1])
        assert min(abs(angle - 99.3), abs(angle - 285.3)) > 10.0

    def test_a_derivative_that_is_zero_all_over_the_turn_has_no_crank_angle(self, linkwork):
        result = linkwork("tolerances --shift '0 in' --points 9 --samples 10 --no-plot")
        top = next(line for line in result.output.splitlines() if "guide.twist" in line)
        assert [cell.strip() for cell in top.split("│")[-4:-1]] == ["0", "0", ""]


class TestDual:
    @pytest.mark.parametrize(
        "arguments",
        [
            "",
            "--torque '100 lbf*in' --published rahman-a4-20-alpha4-310",
            "--load '10 lbf' --groove shaft --set 'groove.amplitude=3 in' --set groove.ratio=2",
            "--torque '5 N*m' --groove apart --set 'groove.amplitude=3 in' --set slider.damping=100 "
            "--set slider.stiffness=200 --set slider.coulomb_friction=3 --set gravity.x=-9.81",
            "--set 'rod.length=30 in' --offset '20 in' --load '7 N' --units inch",
        ],
    )
    def test_both_agree(self, linkwork, arguments):
        result = linkwork(f"dual --points 37 {arguments}")
        assert "the two agree" in result.output
        assert "FAIL" not in result.output
        length = "in" if "inch" in arguments else "mm"
        closed = re.search(rf"the loop closes to (\S+) deg and (\S+) {length} in", result.output)
        assert max(float(closed[1]), float(closed[2])) < 1e-9
        unit, largest, *_ = cells(result.output)["slider position"]
        assert unit == length
        assert 36.0 < float(largest) * (1.0 if length == "in" else 1.0 / 25.4) < 70.0

    def test_a_disagreement_is_a_failed_check(self, linkwork, monkeypatch):
        right = dual_dynamics.joint_loads

        def wrong(*arguments, **options):
            loads = right(*arguments, **options)
            return replace(loads, slider_pin=1.000001 * loads.slider_pin)

        monkeypatch.setattr(dual_dynamics, "joint_loads", wrong)
        result = linkwork("dual --points 37", code=cli.CHECK_FAILED)
        assert cells(result.output)["force of the slider on the rod"][-1] == "FAIL"
        assert cells(result.output)["force of the crank on the rod"][-1] == "pass"
        assert "check failed" in result.stderr

    def test_two_rotations_do_not_close(self, linkwork, tmp_path):
        result = linkwork("dual --two-rotations --units inch --points 181")
        assert "slider position off by up to 1.7" in " ".join(result.output.split())
        columns = csv(tmp_path / "out" / "rahman-a4-10-s1-3.5-two-rotations.csv")
        assert columns["rotation residual [deg]"].max() > 20.0
        linkwork("dual --two-rotations --published rahman-ideal --points 13")
        columns = csv(tmp_path / "out" / "rahman-ideal-two-rotations.csv")
        assert columns["rotation residual [deg]"].max() < 1e-9
        assert columns["off by [mm]"].max() < 1e-9


class TestPicture:
    def test_all_of_it(self, linkwork, tmp_path):
        result = linkwork("picture --range --animate --frames 2 --view '30 deg' '-60 deg'")
        name = "rahman-a4-10-s1-3.5"
        assert {p.name for p in (tmp_path / "out").glob("[!.]*")} == {f"{name}.png", f"{name}-range.png", f"{name}.gif"}
        for ending in (".png", "-range.png", ".gif"):
            assert f"wrote out/{name}{ending}" in result.output

    def test_an_animation_of_others_stays(self, linkwork, tmp_path):
        others = tmp_path / "out" / "rahman-a4-10-s1-3.5.gif"
        others.parent.mkdir()
        others.write_bytes(b"GIF89a of mine")
        assert "wrote out/rahman-a4-10-s1-3.5-2.gif" in linkwork("picture --animate --frames 2").output
        assert others.read_bytes() == b"GIF89a of mine"

    def test_it_is_of_what_was_asked_for(self, linkwork, monkeypatch):
        asked = []
        right = figures.plot
        monkeypatch.setattr(figures, "plot", lambda *a, **options: asked.append((a, options)) or right(*a, **options))
        arguments = ("--angle", "45 deg", "--groove", "apart", "--set", "groove.amplitude=2 in", "--units", "inch")
        linkwork("picture", *arguments, "--view", "30 deg", "1 rad")
        ((p, angle, shift), options) = asked[0]
        assert angle == pytest.approx(radians(45.0))
        assert shift == pytest.approx(2.0 * INCH * np.sin(radians(45.0)))
        assert p.guide_offset == pytest.approx(10.0 * INCH)
        assert options["unit"] == "in"
        assert options["view"] == pytest.approx((30.0, np.degrees(1.0)))


@pytest.mark.parametrize(
    ("units", "said"),
    [
        (["--units", "inch"], "the rod is 50 in long, 138.033 in too short"),
        (["-u", "inch"], "and shift position 3.5 in: the crank pin is 188.033 in from the guide"),
        ([], "the rod is 1270 mm long, 3506.03 mm too short"),
    ],
)
def test_the_units_of_the_output_hold_in_errors(linkwork, units, said):
    result = linkwork("info --offset '200 in'", *units, code=1)
    assert said in result.stderr
    wrong = linkwork("info --set 'rod.length=-2 in'", *units, code=1)
    assert f"parameter rod.length is {'-2 in' if units else '-50.8 mm'}: it must" in wrong.stderr
    # what the user wrote stays as it is
    assert "guide.offset is '3 N'" in linkwork("info --offset '3 N'", *units, code=1).stderr


def test_a_file_and_a_published_case_exclude_each_other(linkwork, tmp_path):
    save_parameters(tmp_path / "mine.toml", parameters(30.0))
    result = linkwork("info mine.toml --published rahman-ideal", code=2)
    assert "give either a file of parameters or --published NAME" in result.stderr
