"""Methods of sections 7.1 and 7.4 for driving the slider, applied to a mechanism with masses.

The thesis classifies the methods and computes none: off-line (a spring, or a drive without feedback), partial-on-line
(feedback to a stored motion), and adaptive (trial cycles that correct the drive). Here each method moves the slider by the two
harmonics of Fig 7.11, at 120 rpm. The links are those printed for the weighted rocker function, as steel bars of 20 by 5 mm,
with a damper and some friction in the guide. The plant, the mechanism as built, differs from the controller's model: friction
is twice as large, coupler and slider are a tenth heavier, and a load acts on the rocker pin. Each trial cycle corrects the
stored motion by the Fourier series of the last cycle's deviation. A cam on the crank shaft drives the slider by a roller that
moves along a line through the shaft.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from itertools import product
from math import exp, pi, radians, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from linkwork.five_bar.parameters import FiveBarParameters

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...linear import Design, design_pid, linearise_orbit
from ...numerics.fourier import FourierSeries
from ...slider import TrackingController, TrackingResult, best_spring, inverse_dynamics, motion_of_plant, track
from ...synthesis import Linkage, MachineSpec, SecondCrank, turn
from ...units import CM_PER_METRE
from ..rules import ALIKE, READ, SEEN_FALL
from ..statements import FloatArray, Statement, at_least, at_most, statement, unjudged
from ..study import Study, StudyResult, pad_columns, result_curves
from .chapter_6 import ratios_to_least
from .chapter_7 import slider
from .problems import PROBLEMS
from .runs import SPEED as TURN_RPM
from .runs import steady_turn, table_3_1
from .series_2 import (
    PATH,
    PATH_SEARCHES,
    ROCKER,
    linkage_error,
    mended_path_linkage,
    path_motion,
    readings,
    rocker_motion,
)

#: Crank speed (rad/s).
SPEED = 4.0 * pi
#: Damping (N.s/m) and friction (N) in the guide.
DAMPING, FRICTION = 5.0, 2.0
#: Sampling period (s) and bandwidth (rad/s) of the controller; turns of a run.
PERIOD, BANDWIDTH, TURNS = 1e-3, 120.0, 3.0
#: Load at the pin of coupler and rocker, unknown to the controller (N).
LOAD = (-5.0, -3.0)
#: Load (N) of changed operating conditions: three times `LOAD`.
CHANGED = (-15.0, -9.0)
#: Number of trial cycles, and numbers of harmonics of the deviation that they correct.
TRIALS, HARMONICS = 6, (8, 16)
#: First step (m) of a search on the machine, and number of runs in it.
STEP, SEARCHED = 8e-3, 25
#: Gear ratios of a second crank, turns per turn of the first, and the error of links that cannot be joined.
GEARS, REFUSED = (1, -1, 2, -2), 1e6
#: Largest pressure angle of a cam (rad), the usual limit of a follower that slides, and radius of its roller (cm).
PRESSURE, ROLLER = radians(30.0), 1.0


class Machine(NamedTuple):
    """Mechanism as modelled and as built, desired slider motion over the crank angle (m), and design of the feedback."""

    model: FiveBarParameters
    plant: FiveBarParameters
    motion: FourierSeries
    design: Design


@cache
def machine() -> Machine:
    """Return the machine: the printed links in steel, with the two harmonics of Fig 7.11 as the desired slider motion."""
    linkage = rocker_motion(2).linkage
    motion = motion_of_plant(linkage)
    model = replace(
        MachineSpec(slider_damping=DAMPING, slider_coulomb_friction=FRICTION).sliding_five_bar(linkage),
        coupler_point_distance=linkage.coupler_length,
    )
    plant = replace(
        model,
        slider_coulomb_friction=2.0 * FRICTION,
        slider_mass=1.1 * model.slider_mass,
        coupler_mass=1.1 * model.coupler_mass,
    )
    smooth = replace(model, slider_coulomb_friction=0.0)
    mean = linearise_orbit(smooth, inverse_dynamics(smooth, motion, SPEED)).mean()
    return Machine(model, plant, motion, design_pid(mean, bandwidth=BANDWIDTH))


def run(
    stored: FourierSeries, *, feedback: bool = True, load: tuple[float, float] = LOAD, speed: float = SPEED
) -> TrackingResult:
    """Run the plant along a stored motion: with feedback, or without feedback under the force that the model predicts.

    ``load`` acts on the rocker pin (N); ``speed`` is the crank speed (rad/s).
    """
    m = machine()
    design = m.design if feedback else None
    controller = TrackingController(m.model, stored, PERIOD, design=design, feedforward=not feedback)
    return track(controller, crank_speed=speed, revolutions=TURNS, plant=m.plant, load=load)


@cache
def run_trials(harmonics: int) -> tuple[FloatArray, ...]:
    """Run the trial cycles; return the deviation of the slider from the desired motion over the last turn of each run (m).

    After each cycle, the Fourier series of the deviation with this number of harmonics is subtracted from the stored motion.
    """
    turn = round(2.0 * pi / (SPEED * PERIOD))
    stored, deviations = machine().motion, []
    for _ in range(TRIALS):
        loop = run(stored).loop
        # samples at equal steps, the first at a whole number of turns
        last = slice(-turn - 1, -1)
        deviations.append(loop.position[last] - machine().motion(loop.states[last, 0]))
        stored = stored + FourierSeries.from_samples(deviations[-1], harmonics) * -1.0
    return tuple(deviations)


def move_slider(series: FourierSeries) -> Linkage:
    """Return the printed links of the rocker function with the slider moved by ``series`` along the best guide."""
    linkage = rocker_motion(2).linkage
    return replace(linkage, pivot=replace(slider(linkage), series=series))


def error_on_machine(stored: FourierSeries, load: tuple[float, float] = LOAD, speed: float = SPEED) -> float:
    """Return the weighted error of the rocker function (deg2) over the last turn of a run along a stored motion; see `run`."""
    turns = round(2.0 * pi / (speed * PERIOD))
    position = run(stored, load=load, speed=speed).loop.position[-turns - 1 : -1]
    found = FourierSeries.from_samples(position, max(HARMONICS))(turn(72) + rocker_motion(2).linkage.crank_phase)
    return linkage_error(ROCKER, move_slider(FourierSeries.from_samples(found, max(HARMONICS))))


def search_on_machine() -> tuple[float, float]:
    """Minimise the weighted error of the rocker function in runs of the plant, by a downhill simplex.

    The unknowns are the mean and two harmonics of the slider motion. Returns the errors (deg2) with the slider at rest and at
    the end of the search.
    """

    def error(c: FloatArray) -> float:
        return error_on_machine(motion_of_plant(move_slider(FourierSeries(c[:3], np.append(0.0, c[3:])))))

    start = np.zeros(5)
    options = {"initial_simplex": np.vstack([start, start + STEP * np.eye(5)]), "maxfev": SEARCHED}
    return error(start), float(minimize(error, start, method="Nelder-Mead", options=options).fun)


@cache
def with_second_crank(name: str) -> Linkage:
    """Return the best linkage that has the printed links of a problem and the rocker pivot on a second, geared crank.

    The second crank turns about the printed place of the pivot. Its gear ratio is one of `GEARS`; its length and its phase are
    found by downhill simplexes.
    """
    printed = PROBLEMS[name].linkage

    def linkage(x: FloatArray, ratio: int) -> Linkage:
        return printed.with_pivot(SecondCrank(length=exp(x[0]) / CM_PER_METRE, ratio=ratio, phase=float(x[1])))

    def error(x: FloatArray, ratio: int) -> float:
        return min(linkage_error(name, linkage(x, ratio)), REFUSED)

    found = []
    for ratio, phase in product(GEARS, turn(4)):
        start = np.array([0.0, phase])
        options = {"initial_simplex": np.vstack([start, start + 0.5 * np.eye(2)]), "maxfev": 150}
        found.append((minimize(error, start, args=(ratio,), method="Nelder-Mead", options=options), ratio))
    best, ratio = min(found, key=lambda pair: pair[0].fun)
    return linkage(best.x, ratio)


class Cam(NamedTuple):
    """Plate cam: least radius of curvature of its pitch curve where this is convex (cm), and the pitch curve (cm)."""

    curvature: float
    curve: NDArray[np.complex128]


def cam(series: FourierSeries) -> Cam:
    """Return the smallest cam with a pressure angle within `PRESSURE`; ``series`` is the motion of its roller (m)."""
    angle = np.linspace(0.0, 2.0 * pi, 3601)
    slope = series.derivative()
    lift, rate, change = (CM_PER_METRE * function(angle) for function in (series, slope, slope.derivative()))
    lift = lift - lift.min()
    # |r'| / r = tan of the pressure angle
    r = (np.abs(rate) / tan(PRESSURE) - lift).max() + lift
    curvature = (r**2 + 2.0 * rate**2 - r * change) / (r**2 + rate**2) ** 1.5
    return Cam(1.0 / float(curvature.max()), r * np.exp(1j * angle))


def rms(values: FloatArray) -> float:
    """Return the root mean square of an array."""
    return float(np.sqrt(np.mean(values**2)))


def compute() -> StudyResult:
    """Compute the drive force with and without a spring, the motion with and without feedback, the trial cycles, and cams."""
    m = machine()
    drives = {"without a spring": inverse_dynamics(m.model, m.motion, SPEED)}
    drives["with the best spring"] = inverse_dynamics(best_spring(m.model, m.motion, SPEED).parameters, m.motion, SPEED)
    runs = {"feed-forward": run(m.motion, feedback=False), "feedback": run(m.motion)}
    cams = {
        "Fig 7.11": cam(slider(rocker_motion(2).linkage).series),
        "Fig 7.12": cam(slider(path_motion(2).linkage).series),
    }
    columns = {"crank angle [deg]": np.degrees(drives["without a spring"].crank_angle)}
    columns |= {f"force; {name} [N]": drive.force for name, drive in drives.items()}
    for name, found in runs.items():
        columns |= {
            f"turns; {name} [1]": found.loop.time * SPEED / (2.0 * pi),
            f"error; {name} [mm]": 1e3 * found.error,
        }
    columns["trial cycle [1]"] = np.arange(1.0, TRIALS + 1.0)
    for n in HARMONICS:
        columns[f"rms deviation; {n} harmonics [mm]"] = np.array([1e3 * rms(deviation) for deviation in run_trials(n)])
    for name, found_cam in cams.items():
        columns |= {f"cam of {name}; x [cm]": found_cam.curve.real, f"cam of {name}; y [cm]": found_cam.curve.imag}
    return StudyResult(
        claim="The slider may be driven off-line, with feedback to a stored motion, or adaptively in trial cycles.",
        assignment="The thesis computes none of them. In our example the links are steel bars of 20 by 5 mm, and a slider of "
        f"{m.model.slider_mass:.1f} kg has a damper of {DAMPING:g} N.s/m and {FRICTION:g} N of friction. It moves at "
        f"{SPEED * 30.0 / pi:.0f} rpm by the best two harmonics of Fig 7.11, with feedback every {1e3 * PERIOD:g} ms and a "
        f"bandwidth of {BANDWIDTH:g} rad/s. The machine differs from the controller's model: it has twice the friction, "
        f"coupler and slider are a tenth heavier, and there is a load of ({LOAD[0]:g}, {LOAD[1]:g}) N at the rocker's pin.",
        columns=pad_columns(columns),
        statements=(*judge_off_line(runs["feed-forward"], cams), *judge_on_line(runs["feedback"]), *judge_strategy()),
    )


def judge_off_line(open_loop: TrackingResult, cams: Mapping[str, Cam]) -> Iterator[Statement]:
    """Judge the statements on drives without feedback (7.1.1), given such a run and the cams of Fig 7.11 and 7.12."""
    on_spring = steady_turn(table_3_1(1e6), TURN_RPM)
    fixed, one_harmonic = (
        linkage_error(ROCKER, moved) for moved in (PROBLEMS[ROCKER].linkage, rocker_motion(1).linkage)
    )
    yield statement(
        "An intermittent or continuous drive coupled to the primary input by means of direct mechanical connections, "
        "an arrangement that is simple in principle but suffers from the defects of limited adaptability and "
        "mechanical complications. Examples include secondary linkages, cams and latch mechanisms.",
        "7.1.1 (a), L5301-5309",
        "smallest plate cam for the best two harmonics of Figs 7.11 and 7.12, with a pressure angle within 30 deg, the usual "
        "limit: least radius of curvature of the path of the roller's centre where this path is convex. For a secondary "
        "linkage, our example is a Scotch yoke: weighted error of the rocker function with one harmonic, relative to that "
        "with the pivot fixed",
        f"{ROLLER:g} cm, the radius of the roller, our choice; {SEEN_FALL}",
        *(at_least(f"cam of {name}", ROLLER, c.curvature, "cm") for name, c in cams.items()),
        at_most("secondary linkage", 1.0 - ALIKE, one_harmonic / fixed),
        unjudged("latch", "no example is given"),
        unjudged("simple, limited adaptability, complications", "there is no measure of them"),
    )
    yield statement(
        "A passive mechanical system embodying elements such as springs or latches whose operation depend on the "
        "pre-determined load or on inertia or other forces transmitted through the mechanism. The mode could be "
        "continuous or intermittent and its advantages and disadvantages are similar to the preceding option ...",
        "7.1.1 (b), L5311-5319",
        "range of u over a steady turn, relative to l4, for Table 3.1 with k = 1e6 dyn/cm and mu = 3e4 dyn.s/cm at 420 "
        "rpm. Only spring, damper and the forces of the links move the slider",
        f"more than {READ:g}, the accuracy to which a graph can be read",
        at_least(
            "spring, continuous", READ, np.ptp(on_spring.slider_cm) / (CM_PER_METRE * table_3_1(1e6).rocker_length)
        ),
        unjudged("latch, intermittent", "no example is given"),
        unjudged("advantages and disadvantages", "there is no measure of them"),
    )
    yield statement(
        "An independent drive of the appropriate periodic [form] maintained in correct phase with the primary input "
        "by non mechanical means, e. g. electrical signals: this offers considerable versatility although "
        "reproduction of a sufficiently accurate cyclic variation may be difficult.",
        "7.1.1 (c), L5321",
        "rms deviation of the slider, relative to its stroke, on the machine without feedback, under the force that the "
        f"controller's model needs; over {open_loop.loop.time[-1] * SPEED / (2.0 * pi):.1f} turns, until the links "
        "cannot be joined",
        f"more than {ALIKE:g}, the rule for *the same*; one example is enough for *may be*",
        at_least("no feedback", ALIKE, relative_deviation(open_loop)),
        unjudged("versatility", "there is no measure of versatility"),
    )


def relative_deviation(found: TrackingResult) -> float:
    """Return the slider's deviation (rms) in a run from the motion of Fig 7.11, relative to the stroke of this motion."""
    return rms(found.error) / float(np.ptp(machine().motion(np.linspace(0.0, 2.0 * pi, 721))))


def judge_on_line(closed: TrackingResult) -> Iterator[Statement]:
    """Judge the statements on drives with feedback and on adaptive drives (7.1.2 to 7.3.1), given a run with feedback."""
    at_rest, least = search_on_machine()
    changes = ((CHANGED, SPEED), (LOAD, 0.5 * SPEED), (LOAD, 2.0 * SPEED))
    before = error_on_machine(machine().motion)
    cycles = [run_trials(n) for n in HARMONICS]
    left = [100.0 * rms(deviations[-1]) / rms(deviations[0]) for deviations in cycles]
    loaded, slower, faster = (error_on_machine(machine().motion, *change) / before for change in changes)
    yield statement(
        "The required motion of the input is determined as previously. This is stored as a [reference] model to which "
        "the actual motion is required to adhere by means of feedback.",
        "7.1.2, L5336",
        f"the same deviation on the same machine with feedback to the stored motion, over {TURNS:g} turns",
        f"{ALIKE:g}, the rule for *the same*; one example is enough, since the sentence describes what feedback can do",
        at_most("feedback", ALIKE, relative_deviation(closed)),
    )
    yield statement(
        "A variant of this arrangement is to take the mechanism manually through its correct path for the desired "
        "overall output and to record simultaneously and separately the values of the inputs. In practice this may be "
        "accomplished with primary input operating in its normal mode. This establishes inter alia, the necessary cyclic "
        "variation of the secondary input for reference model purposes, thus eliminating the prior calculation.",
        "7.1.2, L5346",
        why="no record is given",
    )
    yield statement(
        "Whichever the first stage may be, considerable demands will be placed on the drive to achieve the "
        "appropriate mechanical response, which clearly establishes a limit of the range of application.",
        "7.1.2, L5360; for adaptive methods, L5370",
        why="neither a drive nor a speed is named",
    )
    yield statement(
        "Trial cycles may then be completed in which the adjustable parameters of the drive are progressively changed "
        "until a satisfactory correspondence is achieved. If the adjustments are made automatically on the basis of a "
        "defined error criterion, the mechanism becomes self adaptive to its reference, and is thus a self-learning "
        "device converging to the desired output.",
        "7.1.3, L5378-5388",
        why="neither the adjustment nor the criterion is stated. In our trial cycles (plot) the first "
        f"{HARMONICS[0]} or {HARMONICS[1]} harmonics of the deviation are subtracted from the stored motion: after "
        f"{TRIALS - 1} corrections {left[0]:.0f} or {left[1]:.0f} % of the rms deviation is left",
    )
    yield statement(
        "Of these and other methods, the simplest and the most widely used is the mechanically coupled arrangement "
        "of type (7.1.1).",
        "7.1.3, L5389",
        why="no survey of mechanisms is given, and there is no measure of *simplest*",
    )
    yield statement(
        'The direct search method, however, may be used "on-line" and accommodate the dynamic '
        "considerations into its structure.",
        "7.3.1, L5853; again L5867",
        "weighted error of the rocker function over the last turn of a run of the machine with feedback: the least in "
        f"{SEARCHED} runs of a downhill simplex over two harmonics of the slider, relative to that with the slider at "
        "rest, where the simplex begins",
        f"{SEEN_FALL}; one example is enough for *may be*",
        at_most("search on the machine", 1.0 - ALIKE, least / at_rest),
    )
    yield statement(
        "With the variational method, any change in the operating conditions require a recalculation of optimum conditions.",
        "7.3.1, L5871-5873",
        "*operating conditions* is read as load and speed. Error as in the row before, with feedback to the stored "
        "motion of Fig 7.11 in place of a variational one (L5915), relative to the error before the change. The least "
        "for three changes: three times the load, half the speed, and twice the speed",
        f"more than {1.0 + ALIKE:g}, the rule for *the same*; one change that requires no recalculation refutes *any*",
        at_least("the least", 1.0 + ALIKE, min(loaded, slower, faster)),
        why=f"at half the speed the ratio is {slower:.3f}, at twice the speed {faster:.3f}. A motion calculated again would "
        "be the same, since no equation of the method contains load or speed",
    )
    yield statement(
        "The direct search merely experiments with a number of cycles, after which the controller adjusts itself, "
        "in an optimum manner, to the changes. Thus for automation purposes a heavy swing in favour of the direct search "
        "method is justified.",
        "7.3.1, L5873-5881",
        why="there is no measure of *merely*, *in an optimum manner* and *heavy swing*; a search on the machine, which "
        "does not depend on what changed before it, is judged at L5853",
    )


def judge_strategy() -> Iterator[Statement]:
    """Judge the statements on the strategy of search (7.4)."""
    fixed, least = linkage_error(ROCKER, PROBLEMS[ROCKER].linkage), linkage_error(ROCKER, rocker_motion(2).linkage)
    fixed_path, least_path = linkage_error(PATH, PROBLEMS[PATH].linkage), linkage_error(PATH, path_motion(2).linkage)
    geared, geared_path = (linkage_error(name, with_second_crank(name)) for name in (ROCKER, PATH))
    ratios = ratios_to_least() | {
        "Fig 7.11": linkage_error(ROCKER, readings(ROCKER)[0]) / least,
        "Fig 7.12": linkage_error(PATH, mended_path_linkage()) / least_path,
    }
    yield statement(
        "The second input could be a slider as discussed in this chapter or could be another link resulting in a "
        "five bar loop.",
        "7.4, L6013",
        "error with the slider moved by its best two harmonics within the limits of the next row, relative to that with "
        "the pivot fixed, for the printed links, mended. Our example of another link is a second crank, geared to the "
        "first (L6017), which moves the rocker pivot on a circle about its printed place; we take the best length, phase "
        "and gear ratio of 1, -1, 2 and -2",
        SEEN_FALL,
        at_most("slider, Fig 7.11", 1.0 - ALIKE, least / fixed),
        at_most("slider, Fig 7.12", 1.0 - ALIKE, least_path / fixed_path),
        at_most("another link, task of Fig 7.11", 1.0 - ALIKE, geared / fixed),
        at_most("another link, task of Fig 7.12", 1.0 - ALIKE, geared_path / fixed_path),
    )
    yield statement(
        "The computer program shown in Appendix[] 5, can cope with the above defined strategy producing optimum "
        "results in each case.",
        "7.4, L6026",
        "*optimum* is read as the least error that we find. Error of the printed four-bars, mended, relative to it, as at "
        "L7026; error with the two printed series, as at L5935, relative to the least with as many harmonics and the same "
        "links. At Fig 7.11 the slider stays within l1 of the printed pivot; at Fig 7.12 its stroke is at most "
        f"{CM_PER_METRE * PATH_SEARCHES[2][1]:g} cm, more than ten times the printed one (our limits)",
        f"{1.0 + ALIKE:g}, the rule for *the same*",
        *(at_most(name, 1.0 + ALIKE, ratio, why="not an optimum") for name, ratio in ratios.items()),
        unjudged("a fifth link, further inputs", "no example is given"),
        why="with still longer strokes, the printed series of Fig 7.12 is no optimum either",
    )


def draw(result: StudyResult) -> Figure:
    """Draw the drive force, the errors of the runs, and the errors of the trial cycles."""
    c = result.columns
    runs = (("feed-forward", "no feedback", COLOURS[1]), ("feedback", "feedback", COLOURS[0]))
    panels = [
        Panel(
            x_label="crank angle [deg]",
            y_label="control force [N]",
            title="force on the slider",
            curves=result_curves(
                result,
                "crank angle [deg]",
                {f"force; {name} [N]": name for name in ("without a spring", "with the best spring")},
            ),
            x_ticks=range(0, 361, 60),
        ),
        Panel(
            x_label="turns of the crank",
            y_label="error of the slider [mm]",
            title="motion followed",
            curves=[
                Curve(x=c[f"turns; {name} [1]"], y=c[f"error; {name} [mm]"], label=label, colour=colour)
                for name, label, colour in runs
            ],
            y_range=(-1.5, 1.5),
        ),
        Panel(
            x_label="trial cycle",
            y_label="rms deviation [mm]",
            title="trial cycles",
            curves=result_curves(
                result,
                "trial cycle [1]",
                {f"rms deviation; {n} harmonics [mm]": f"{n} harmonics" for n in HARMONICS},
                marker="o",
            ),
            logarithmic="y",
        ),
        Panel(
            x_label="x [cm]",
            y_label="y [cm]",
            title="cams, path of the roller's centre",
            curves=[
                Curve(x=c[f"cam of {name}; x [cm]"], y=c[f"cam of {name}; y [cm]"], label=name)
                for name in ("Fig 7.11", "Fig 7.12")
            ],
            equal=True,
            legend_at="outside",
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 2.9))


#: The study by its name.
STUDIES = {"control": Study(compute, draw)}
