"""Plots, drawings and animation: that they show what they should, and refuse what they cannot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis import Inputs, figures, simulate
from analysis.figures import Curve, Panel
from analysis.files import save_figure
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar.published import SETS, TABLE_3_1

WITH_POINT = replace(TABLE_3_1, coupler_point_distance=0.12, coupler_point_angle=0.5)


@pytest.fixture(scope="module")
def run():
    return simulate(WITH_POINT, Inputs(speed=44.0), stop_time=0.15, step=5e-3)


def test_outputs_have_a_panel_each(run) -> None:
    figure = figures.plot(run, ("slider.position", "drive.applied_torque"), title="a run")
    assert [axis.get_ylabel() for axis in figure.axes] == ["slider.position [m]", "drive.applied_torque [N.m]"]
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_ydata(), run["slider.position"])


@pytest.mark.parametrize("picture", [figures.plot, lambda result: figures.animate(result, "never.gif")])
def test_a_type_that_has_no_picture_is_named(picture) -> None:
    with pytest.raises(figures.DrawingError, match=r"type dict have no") as refused:
        picture({})
    assert refused.value.kind is dict


def test_comparison(run) -> None:
    shifted = replace(run, time=run.time[:-1], values=run.values[:-1] + 1e-6)
    figure = figures.plot_comparison(run, shifted, ["slider.position"], title="case", labels=("a", "b"))
    both, difference = figure.axes
    assert [line.get_label() for line in both.lines] == ["a", "b"]
    np.testing.assert_allclose(difference.lines[0].get_ydata(), 1e-6, rtol=1e-6)
    assert (both.get_ylabel(), difference.get_ylabel()) == ("slider.position [m]", "difference [m]")


def test_the_look_does_not_depend_on_where_it_is_saved(run) -> None:
    axis = figures.plot(run).axes[0]
    assert axis.yaxis.get_major_ticks()[0].gridline.get_alpha() == figures.STYLE["grid.alpha"]
    assert axis.get_yticklabels()[0].get_fontsize() == figures.STYLE["font.size"]


def test_curves() -> None:
    square = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])
    panel = Panel(
        x_label="x [cm]",
        y_label="y [cm]",
        curves=[Curve(x=[0, 1], y=[0, 1], label="one"), Curve(x=[0], y=[1], line="", marker="x")],
        verticals={"here": 0.5},
        legend="heading",
        legend_at="outside",
        x_ticks=(0, 1, 2),
        equal=True,
        filled=[[square, 1.0 + square[::-1] / 3.0]],
    )
    figure = figures.plot_curves([panel] * 3, title="Fig 0", columns=2)
    assert len(figure.axes) == 3
    axis = figure.axes[0]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("x [cm]", "y [cm]")
    assert axis.get_legend().get_title().get_text() == "heading"
    assert [line.get_linestyle() for line in axis.lines] == ["-", "None", ":"]
    # the hole is free
    path = axis.patches[0].get_path()
    assert path.contains_point((0.5, 0.5))
    assert len(path.codes) == 10


def test_logarithmic_axes() -> None:
    panel = Panel(x_label="x", y_label="y", curves=[Curve(x=[1, 10], y=[1, 100])], logarithmic="xy", x_ticks=(1, 5))
    axis = figures.plot_curves([panel], title="").axes[0]
    assert (axis.get_xscale(), axis.get_yscale()) == ("log", "log")
    assert [label.get_text() for label in axis.get_xticklabels()] == ["1", "5"]


@pytest.mark.parametrize(
    "parameters",
    [
        WITH_POINT,
        replace(WITH_POINT, coupler_point_angle=0.0, assembly_branch=-1, slider_guide_angle=0.4),
        replace(TABLE_3_1, slider_stiffness=0.0),
        replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=0.0),
        SETS["rig-2-spring-c"].parameters,
    ],
    ids=["coupler point", "inclined", "no spring", "neither", "short crank"],
)
def test_drawing_holds_all_pins(parameters, tmp_path: Path) -> None:
    figure = figures.plot(parameters, 2.0, 0.003, title="still")
    axis = figure.axes[0]
    letters = {text.get_text() for text in axis.texts}
    assert {"A", "B", "C", "D", r"$\theta_2$"} <= letters
    assert ("P" in letters) == bool(parameters.coupler_point_distance)
    for text in axis.texts:
        x, y = text.get_position()
        assert axis.get_xlim()[0] < x < axis.get_xlim()[1]
        assert axis.get_ylim()[0] < y < axis.get_ylim()[1]
    path = save_figure(figure, tmp_path / "folder" / "still.png")
    assert path.stat().st_size > 5000


def test_drawing_what_cannot_be_joined() -> None:
    with pytest.raises(AssemblyError, match=r"slider position 0\.5 m"):
        figures.plot(TABLE_3_1, 0.0, 0.5)


def test_saving_twice_gives_the_same_bytes(run, tmp_path: Path) -> None:
    first = save_figure(figures.plot(run), tmp_path / "a.png").read_bytes()
    second = save_figure(figures.plot(run), tmp_path / "b.png").read_bytes()
    assert first == second


def test_animation(run, tmp_path: Path) -> None:
    path = figures.animate_linkage(WITH_POINT, run, tmp_path / "run.gif", frames=6, frames_per_second=10, title="run")
    with Image.open(path) as image:
        assert image.n_frames == 6
        assert image.info["duration"] == 100
        first = np.array(image.convert("RGB"), dtype=int)
        image.seek(5)
        last = np.array(image.convert("RGB"), dtype=int)
    assert np.abs(first - last).max() > 100


def test_animation_of_nothing(run, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least 2"):
        figures.animate_linkage(WITH_POINT, run, tmp_path / "run.gif", frames=1)
