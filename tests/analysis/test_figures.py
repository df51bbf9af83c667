"""Plots, drawings and animation: that they show what they should, and refuse what they cannot."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.path import Path as Path2D
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image

from analysis import Inputs, figures, simulate, simulate_many
from analysis.figures import Curve, Panel, scheme, style
from analysis.figures.animation import gif
from analysis.figures.curves import Arrow, Label
from analysis.figures.style import COUPLER, CRANK, GROUND
from analysis.files import WritingError, save_figure
from analysis.linkages import linkage
from analysis.mechanisms import MECHANISMS
from analysis.numerics.fourier import FourierSeries
from analysis.slider import inverse_dynamics
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.slider_crank.published import SETS as SLIDER_CRANKS

from ..mechanisms import pendulum, rotor_on_cart

WITH_POINT = replace(TABLE_3_1, coupler_point_distance=0.12, coupler_point_angle=0.5)


@pytest.fixture(scope="module")
def run():
    return simulate(WITH_POINT, Inputs(speed=44.0), stop_time=0.15, step=5e-3)


def stand_clear(axis: Axes, boxes: Sequence[Bbox], curves: Sequence[Line2D] | None = None) -> None:
    """Hold that boxes of texts cover neither each other nor curves, by default all of the axes."""
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    for line in axis.lines if curves is None else curves:
        path = line.get_transform().transform_path(line.get_path())
        assert not any(path.intersects_bbox(box, filled=False) for box in boxes)


def labels_of(figure: figures.Figure) -> list[str]:
    """What the panels are of, with units."""
    return [axis.get_ylabel().replace("\n", " ") for axis in figure.axes if axis.get_ylabel()]


def test_a_run_has_its_mechanism_beside_and_no_panel_for_a_constant(run) -> None:
    figure = figures.plot(run, title="driven at a speed")
    *curves, forces, mechanism = figure.axes
    labels = ["slider position [mm]", "drive applied torque [N.m]", "transmission angle [deg]", "pin forces [N]"]
    assert labels_of(figure) == labels
    assert figure.get_supxlabel() == "Constant, not drawn: crank speed 420.2 rpm."
    np.testing.assert_allclose(curves[-1].lines[0].get_ydata(), np.degrees(run["transmission.angle"]), rtol=1e-12)
    magnitude = {line.get_label(): line.get_ydata() for line in forces.lines}
    assert list(magnitude) == ["A", "B", "C", "D"]
    np.testing.assert_allclose(magnitude["C"], np.hypot(run["pin.C.fx"], run["pin.C.fy"]), rtol=1e-12)
    # the path of P over the whole run, in cm
    paths = [line.get_xydata() for line in mechanism.lines if len(line.get_xydata()) == len(run)]
    path = 100.0 * np.column_stack([run["coupler.point.x"], run["coupler.point.y"]])
    assert any(np.allclose(one, path, rtol=1e-12) for one in paths)


def test_of_a_long_run_the_path_is_that_of_its_end(run) -> None:
    long = replace(run, time=np.arange(30_001) * 1e-3, values=np.resize(run.values, (30_001, len(run.names))))
    mechanism = figures.plot(long).axes[-1]
    assert mechanism.get_title() == "at 0 s, with the path of P over the last 20 s"
    assert max(len(line.get_xdata()) for line in mechanism.lines) == 20_000


def test_without_a_point_of_its_own_the_path_is_that_of_c() -> None:
    run = simulate(TABLE_3_1, Inputs(speed=44.0), stop_time=0.15, step=5e-3)
    mechanism = figures.plot(run).axes[-1]
    assert "path of C" in mechanism.get_title()
    (path,) = [line.get_xydata() for line in mechanism.lines if len(line.get_xydata()) == len(run)]
    # C is the rocker's length from D
    d = np.array([[TABLE_3_1.ground_length, 0.0]]) + run["slider.position"][:, None] * np.array([1.0, 0.0])
    np.testing.assert_allclose(np.hypot(*(path / 100.0 - d).T), TABLE_3_1.rocker_length, rtol=1e-9)


def test_a_run_of_a_slider_crank_has_its_joint_forces_and_its_picture() -> None:
    known = SLIDER_CRANKS["rahman-a4-10-s1-3.5"]
    run = simulate(known.parameters, Inputs(speed=known.crank_speed), initial=known.initial, stop_time=0.2, step=2e-2)
    figure = figures.plot(run)
    assert labels_of(figure)[0::4] == ["slider position [mm]", "joint forces [N]"]
    assert figure.get_supxlabel() == "Constant, not drawn: shift position 88.9 mm, crank speed 50 rpm."
    assert figure.axes[-1].collections  # the solids


@pytest.mark.parametrize(
    ("mechanism", "labels"),
    [
        (replace(pendulum.MECHANISM, drawing=None), ["pendulum angle [deg]", "pendulum speed [rpm]"]),
        (rotor_on_cart.MECHANISM, ["cart position [mm]", "rotor speed [rpm]"]),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_a_mechanism_that_nothing_draws_has_its_curves(mechanism, labels, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MECHANISMS, mechanism.name, mechanism)
    known = next(iter(mechanism.published.values()))
    run = simulate(known.parameters, initial=known.initial, stop_time=0.5, step=1e-2)
    figure = figures.plot(run)
    assert labels_of(figure) == labels
    assert len(figure.axes) == len(labels)


def test_a_run_in_which_nothing_changes_says_so(run) -> None:
    still = replace(run, values=np.broadcast_to(run.values[0], run.values.shape))
    figure = figures.plot(still)
    assert labels_of(figure) == []
    assert [text.get_text() for text in figure.axes[0].texts] == ["nothing changes in this run"]
    assert "pin force A" in figure.get_supxlabel()


def test_a_run_without_samples_says_so_and_a_single_sample_is_a_point(run) -> None:
    empty, single = (replace(run, time=run.time[:n], values=run.values[:n]) for n in (0, 1))
    figure = figures.plot(empty)
    assert "no samples" in figure.axes[0].texts[0].get_text()
    assert not figure.get_supxlabel()
    assert figures.plot(single, ["slider.position"]).axes[0].lines[0].get_marker() == "o"


@pytest.mark.parametrize(("name", "value"), [("crank.speed", 44.0), ("slider.position", 0.0)])
def test_rounding_errors_of_a_constant_are_not_magnified(run, name: str, value: float) -> None:
    values = run.values.copy()
    noise = np.random.default_rng(1).standard_normal(len(run))
    values[:, run.names.index(name)] = value + 1e-15 * noise * max(value, 1.0)
    low, high = figures.plot(replace(run, values=values), [name]).axes[0].get_ylim()
    assert high - low > 0.05 * max(abs(high), 1.0)


def test_no_label_of_a_drawing_to_scale_is_cut_off() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    curve = Curve(x=77.0 + 63.0 * np.cos(turn), y=36.0 * np.sin(turn) - 57.0, label="slider moved,\n3 harmonics")
    panel = Panel(x_label="x [mm]", y_label="y [mm]", curves=[curve], equal=True, legend_at="outside")
    figure = figures.plot_curves([panel], title="to scale", size=(6.4, 3.0))
    box = figure.axes[0].yaxis.label.get_window_extent()
    assert box.x0 > 0.02 * figure.dpi


@pytest.mark.parametrize("outputs", [None, ["slider.position", "pin.A.fx"]])
def test_many_runs_are_the_quantiles_of_those_that_last(outputs: list[str] | None) -> None:
    forces = np.array([0.0, 1.0, 2.0, 3.0, -2e3])
    runs = simulate_many("table-3.1", vary={"force": forces}, stop_time=0.1, outputs=outputs)
    assert runs.status.tolist() == [0, 0, 0, 0, 3]
    figure = figures.plot(runs, title="scattered")
    assert labels_of(figure) == ["slider position [mm]", "pin A fx [N]"][: len(figure.axes)]
    (median,) = figure.axes[0].lines
    x = 1e3 * np.array(runs.output("slider.position")[:4])
    late = np.asarray(median.get_xdata()) > 0.05
    assert np.asarray(median.get_ydata())[late] == pytest.approx(np.median(x, axis=0)[runs.time > 0.05])
    widest, _ = figure.axes[0].collections
    last = np.asarray(widest.get_paths()[0].vertices)
    last = last[last[:, 0] == 0.1, 1]
    assert (last.min(), last.max()) == pytest.approx((x[:, -1].min(), x[:, -1].max()))
    assert figure.get_supxlabel() == "5 runs; ended early, and left out from there on: 1."


def test_the_angle_of_a_link_about_half_a_turn_is_not_torn_apart_in_many_runs() -> None:
    at = np.radians(-94.5)
    bar = linkage("beside-half-a-turn", ground={"A": (0, 0), "D": (0.15 * np.cos(at), 0.15 * np.sin(at))})
    for name, ends, length in (("crank", "AB", 0.03), ("coupler", "BC", 0.15), ("rocker", "CD", 0.1)):
        bar.body(name, bar=tuple(ends), length=length, mass=0.1)
    name = bar.freedom("crank", "A", speed="60 rpm", start=at).mechanism().name
    runs = simulate_many(name, vary={"rocker.length": np.linspace(0.09, 0.11, 5)}, stop_time=0.2)
    angles = np.array(runs.output("rocker.angle"))
    assert angles[[0, -1], 0] == pytest.approx([np.pi, -np.pi], abs=0.1)
    axis = figures.plot(runs, ["rocker.angle"]).axes[0]
    (median,) = axis.lines
    every = np.degrees(angles % (2.0 * np.pi))
    assert np.asarray(median.get_ydata()) == pytest.approx(np.median(every, axis=0))
    shade = np.asarray(axis.collections[0].get_paths()[0].vertices)[:, 1]
    assert (shade.min(), shade.max()) == pytest.approx((every.min(), every.max()))


def test_a_run_that_ended_early_says_why_and_its_texts_cover_nothing(run) -> None:
    figure = figures.plot(replace(run, status=3, message="limit of assembly at t = 1 s"), title="a run")
    assert figure.get_supxlabel().splitlines()[-1] == "The run ended early: limit of assembly at t = 1 s."
    for axis in figure.axes[:-1]:
        texts = (axis.yaxis.label, axis.xaxis.label, *axis.texts)
        boxes = [text.get_window_extent() for text in texts if text.get_text()]
        legend = axis.get_legend()
        stand_clear(axis, boxes + ([legend.get_window_extent()] if legend else []))


def test_of_a_tracking_run_what_is_zero_is_said_and_not_drawn() -> None:
    time = np.linspace(0.0, 1.0, 50)
    loop = SimpleNamespace(time=time, force=np.sin(time))
    run = SimpleNamespace(loop=loop, error=1e-4 * time, point_error=1e-16 * time, method="PID")
    figure = figures.plot_tracking(run)
    assert labels_of(figure) == ["slider error [mm]", "control force [N]"]
    assert "coupler point error" in figure.get_supxlabel()


def test_outputs_have_a_panel_each(run) -> None:
    figure = figures.plot(run, ("slider.position", "drive.applied_torque"), title="a run")
    assert [axis.get_ylabel() for axis in figure.axes] == ["slider position\n[mm]", "drive applied torque\n[N.m]"]
    np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), 1e3 * run["slider.position"], rtol=1e-15)


@pytest.mark.parametrize("picture", [figures.plot, lambda result: figures.animate(result, "never.gif")])
def test_a_type_that_has_no_picture_is_named(picture) -> None:
    with pytest.raises(figures.DrawingError, match=r"type dict have no") as refused:
        picture({})
    assert refused.value.kind is dict


def test_the_drive_of_a_slider_is_over_the_rotation_of_a_crank_that_turns_either_way() -> None:
    still = FourierSeries(cos=np.zeros(1), sin=np.zeros(1))
    axis = figures.plot(inverse_dynamics(TABLE_3_1, still, -44.0)).axes[0]
    assert axis.get_xlabel() == "crank rotation [deg]"
    assert 350.0 < axis.lines[0].get_xdata()[-1] < 360.0


def test_outputs_to_plot_are_a_list(run) -> None:
    for result in (run, simulate_many([TABLE_3_1], Inputs(speed=44.0), stop_time=0.01)):
        with pytest.raises(InputError, match=r"such as \['slider.position'\]"):
            figures.plot(result, "slider.position")


def test_comparison(run) -> None:
    shifted = replace(run, time=run.time[:-1], values=run.values[:-1] + 1e-6)
    figure = figures.plot_comparison(run, shifted, ["slider.position"], title="case", labels=("a", "b"))
    both, difference = figure.axes
    assert [line.get_label() for line in both.lines] == ["a", "b"]
    np.testing.assert_allclose(difference.lines[0].get_ydata(), 1e-3, rtol=1e-6)
    assert (both.get_ylabel(), difference.get_ylabel()) == ("slider position\n[mm]", "difference\n[mm]")


@pytest.mark.parametrize(("factor", "said"), [(1.0, "identical"), (1.0 + 1e-14, "rounding only"), (1.0 + 1e-11, "")])
def test_there_is_a_column_of_differences_only_where_there_is_one(run, factor: float, said: str) -> None:
    figure = figures.plot_comparison(run, replace(run, values=factor * run.values), ["slider.position"])
    assert len(figure.axes) == (1 if said else 2)
    assert said in (figure.get_supxlabel() or "")
    assert bool(figure.get_supxlabel()) == bool(said)


@pytest.mark.parametrize(("greatest", "there"), [(6.0, {"0.5", "1", "2", "5"}), (600.0, set())])
def test_few_decades_have_plain_numbers(greatest: float, there: set[str]) -> None:
    curve = figures.Curve(x=np.array([0.45, greatest]), y=np.array([1.0, 2.0]))
    panel = Panel(x_label="x", y_label="y", curves=[curve], logarithmic="x")
    (axis,) = figures.plot_curves([panel], title="").axes
    assert (axis.get_xscale(), axis.get_yscale()) == ("log", "linear")
    assert there == {label.get_text() for label in axis.get_xticklabels()} & {"0.5", "1", "2", "5"}
    assert not any(label.get_text() for label in axis.get_xticklabels(minor=True))


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


@pytest.mark.parametrize("height", [0.0, 0.5, 1.0])
def test_names_of_places_cover_no_curve(height: float) -> None:
    x = np.linspace(0.0, 10.0, 200)
    curves = [Curve(x=x, y=height + 0.04 * np.sin(3.0 * x), label="wave"), Curve(x=[0.0, 10.0], y=[0.0, 1.0])]
    verticals = {"first place": 3.0, "second place": 3.4, "end": 9.9}
    panel = Panel(x_label="x", y_label="y", curves=curves, verticals=verticals)
    axis = figures.plot_curves([panel], title="", size=(6.4, 3.7)).axes[0]
    boxes = [text.get_window_extent() for text in axis.texts]
    assert len(boxes) == 3
    stand_clear(axis, boxes, axis.lines[:2])
    stand_clear(axis, [*boxes, axis.get_legend().get_window_extent()], ())


def test_the_look_does_not_depend_on_the_users_settings(run, tmp_path: Path) -> None:
    plain = save_figure(figures.plot(run), tmp_path / "a.png").read_bytes()
    with matplotlib.rc_context({"font.size": 20.0, "axes.grid": False, "lines.linewidth": 7.0, "xtick.labelsize": 3.0}):
        own = save_figure(figures.plot(run), tmp_path / "b.png").read_bytes()
    assert own == plain


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


def test_a_scheme_has_spring_and_damper_and_a_wall_that_the_slider_does_not_reach() -> None:
    """A spring and a damper of cup, two rods and piston have a line more, for their wall."""
    coordinates = np.array([(1.0, 0.0), (1.0, 0.02), (1.0, -0.01)])
    count, walls = [], []
    for stiffness, damping in ((0.0, 0.0), (1e3, 0.0), (1e3, 5.0)):
        parameters = replace(WITH_POINT, slider_stiffness=stiffness, slider_damping=damping)
        positions = scheme.joint_positions(MECHANISMS["five-bar"], parameters, coordinates)
        axis = figures.Figure().add_subplot()
        scheme.draw(axis, MECHANISMS["five-bar"], parameters, positions)
        count.append(len(axis.lines))
        upright = [line.get_xdata() for line in axis.lines if line.get_color() == GROUND]
        walls += [x[0] for x in upright if len(x) == 2 and x[0] == x[1]]
    assert np.diff(count).tolist() == [2, 5]
    assert walls == pytest.approx([walls[0]] * 3)
    assert walls[0] > positions["D"][:, 0].max() + 0.1 * np.ptp(positions["B"], axis=0).max()


def test_a_rotor_alone_is_drawn_though_all_its_joints_are_in_one_place() -> None:
    rotor = linkage("rotor-alone", ground={"A": (0, 0)}).body("drum", points={"A": (0, 0)}, mass=1.0, inertia=0.01)
    parameters = rotor.freedom("drum", "A", speed=10.0).mechanism().first_set.parameters
    figure = figures.plot(simulate(parameters, Inputs(speed=10.0), stop_time=0.1, step=0.01))
    widths = [np.ptp(patch.get_path().vertices[:, 0]) for axis in figure.axes for patch in axis.patches]
    assert min(widths) > 0.0


def test_animation(run, tmp_path: Path) -> None:
    path = figures.animate_linkage(WITH_POINT, run, tmp_path / "run.gif", frames=6, frames_per_second=10, title="run")
    with Image.open(path) as image:
        assert image.n_frames == 6
        assert image.info["duration"] == 100
        first = np.array(image.convert("RGB"), dtype=int)
        image.seek(5)
        last = np.array(image.convert("RGB"), dtype=int)
    assert np.abs(first - last).max() > 100


@pytest.mark.parametrize("frames", [0, 2])
def test_an_animation_that_fails_is_not_written_and_says_why(tmp_path: Path, frames: int) -> None:
    def fail() -> None:
        with gif(figures.Figure(), tmp_path / "run.gif", 10) as (_, add):
            for _ in range(frames):
                add()
            raise AssemblyError("too short")

    with pytest.raises(AssemblyError, match="too short"):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_an_animation_leaves_nothing_where_space_runs_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fill_disk(writer: PillowWriter) -> None:
        Path(writer.outfile).write_bytes(b"GIF89a")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(PillowWriter, "finish", fill_disk)
    with (
        pytest.raises(WritingError, match=r"run\.gif cannot be written: No space left"),
        gif(figures.Figure(), tmp_path / "run.gif", 10) as (_, add),
    ):
        add()
    assert list(tmp_path.iterdir()) == []


def test_leaders_of_texts_cross_no_text_and_no_arrow() -> None:
    x = np.linspace(0.0, 10.0, 200)
    places = [(5.0, 2.0), (5.1, 2.0), (5.2, 2.1), (5.3, 1.9), (2.0, 1.0), (2.1, 1.2)]
    panel = Panel(
        x_label="x",
        y_label="y",
        curves=[Curve(x=x, y=np.sin(x) + 1.5), Curve(x=x, y=4.0 - 0.3 * x)],
        y_range=(0.0, 6.0),
        labels=[Label(x=x, y=y, text=f"what happens at {x:.3f} is told") for x, y in places],
        arrows=[Arrow(x=4.0, begin=1.0, end=5.0)],
    )
    figure = figures.plot_curves([panel], title="t", size=(7.6, 4.2))
    (axis,) = figure.axes
    texts = [text for text in axis.texts if text.get_text()]
    boxes = [Text.get_window_extent(text) for text in texts]
    (arrow,) = (Path2D(axis.transData.transform([text.xyann, text.xy])) for text in axis.texts if not text.get_text())
    for text, own in zip(texts, boxes):
        point = axis.transData.transform(text.xy)
        leader = Path2D([point, np.clip(point, (own.x0, own.y0), (own.x1, own.y1))])
        assert not leader.intersects_path(arrow)
        for other in boxes:
            assert other is own or not leader.intersects_bbox(other)
            assert other is own or not own.overlaps(other)


def test_a_legend_has_room_above_curves_that_leave_it_none() -> None:
    x = np.linspace(0.0, 1.0, 400)
    curves = [Curve(x=x, y=np.sin(40.0 * x), label="a wave"), Curve(x=x, y=np.cos(37.0 * x), label="another wave")]
    axis = figures.plot_curves([Panel(x_label="x", y_label="y", curves=curves)], title="waves").axes[0]
    stand_clear(axis, [axis.get_legend().get_window_extent()])
    assert axis.get_ylim()[1] > 1.2
    assert max(axis.get_yticks()) <= 1.1


def test_ticks_that_touch_are_thinned_at_the_size_that_is_shown() -> None:
    x = np.linspace(0.0, 360.0, 9)
    panel = Panel(x_label="x [deg]", y_label="y", curves=[Curve(x=x, y=x)], x_ticks=x.tolist(), verticals={"p": 90.0})
    figure = figures.plot_curves([panel] * 3, title="t", columns=3)

    def ticks(axis):
        return [label.get_text() for label in axis.get_xticklabels()]

    assert ticks(figure.axes[0]) == [f"{tick:g}" for tick in x]
    narrow = figures.resize(figure, 6.4, 2.4)
    for axis in narrow.axes:
        stand_clear(axis, [label.get_window_extent() for label in axis.get_xticklabels()], ())
        assert ticks(axis) == ["0", "90", "180", "270", "360"]


def test_a_title_over_several_lines_has_no_word_alone() -> None:
    title = "Fig 3.13  Free motion: phase plane of the slider; Table 3.1, k = 5e5 dyn/cm"
    figure = figures.plot_curves([Panel(x_label="x", y_label="y", curves=[Curve(x=[0, 1], y=[0, 1])])], title=title)
    first, second = figure.get_suptitle().split("\n")
    assert [*first.split(), *second.split()] == title.split()
    assert abs(len(first) - len(second)) < 15


def test_an_oscillation_too_fast_to_be_drawn_is_a_band_with_its_mean(run) -> None:
    time = np.linspace(0.0, 10.0, 20001)
    position = 0.01 * np.sin(2.0 * np.pi * 50.0 * time) + 0.001 * time
    values = np.column_stack([position, time])
    fast = replace(run, time=time, values=values, names=("slider.position", "crank.angle"), parameters=None)
    figure = figures.plot(fast, ["slider.position", "crank.angle"])
    first, second = figure.axes
    (band,) = first.collections
    corners = band.get_paths()[0].vertices[:, 1]
    assert corners.min() == pytest.approx(-10.0, abs=0.1)
    assert corners.max() == pytest.approx(20.0, abs=0.1)
    (mean,) = first.lines
    np.testing.assert_allclose(mean.get_ydata(), mean.get_xdata(), atol=0.3)
    assert "Band" in figure.get_supxlabel()
    assert not second.collections
    assert "Band" not in figures.plot(fast, ["crank.angle"]).get_supxlabel()


@pytest.mark.parametrize("name", ["watt-1", "elastic-bearing"])
def test_letters_of_a_described_linkage_cover_no_line_and_no_block(name: str) -> None:
    from analysis.linkages import load_linkage

    axis = figures.plot(load_linkage(Path(__file__).parents[2] / "examples" / "linkages" / f"{name}.toml")).axes[0]
    assert len(axis.texts) > 4
    boxes = [text.get_window_extent() for text in axis.texts]
    stand_clear(axis, boxes)
    blocks = [patch.get_window_extent() for patch in axis.patches if patch.get_facecolor() == to_rgba(style.BLOCK)]
    assert len(blocks) == (2 if name == "elastic-bearing" else 0)
    assert not any(block.overlaps(box) for block in blocks for box in boxes)


def test_a_crank_in_line_with_its_coupler_is_seen() -> None:
    from analysis.linkages import load_linkage

    axis = figures.plot(load_linkage(Path(__file__).parents[2] / "examples" / "linkages" / "klann.toml")).axes[0]
    crank, coupler = ([line.get_zorder() for line in axis.lines if line.get_color() == c] for c in (CRANK, COUPLER))
    assert min(crank) > max(coupler)


def test_only_the_letter_of_its_pin_stands_on_the_block_of_a_five_bar() -> None:
    axis = figures.plot(replace(WITH_POINT, rocker_length=0.02), 5.0, 0.02).axes[0]
    (block,) = (p.get_window_extent() for p in axis.patches if p.get_facecolor() == to_rgba(style.BLOCK))
    assert [text.get_text() for text in axis.texts if text.get_window_extent().overlaps(block)] == ["D"]
