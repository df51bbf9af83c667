"""Figures 3.11 to 3.14: the crank in free motion; u is the slider position.

An argument ``stiffness`` is the stiffness of the spring in dyn/cm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import InitialState

from ...figures import Curve, Figure, Panel, plot_curves
from ...periodic import natural_frequency
from ...run import Inputs, Trajectory, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, near, statement, unjudged, within
from ..study import Study, StudyResult
from ..variation import cache
from .runs import ALIKE_WORDS, SIGN, SPEED, greatest, greatest_ratio, plain, table_3_1

#: Springs of the free motion (dyn/cm).
SOFT, STIFF = 5e5, 2e6
#: Crank speed near which the thesis sees higher harmonics (rad/s).
HARMONIC_SPEED = 27.0
#: Number of crank angles at which a turn of a free crank is sampled.
SAMPLES = 1024


@cache
def coast(stiffness: float, damping: float = 3e4, rpm: float = SPEED, release: float = 0.0) -> Trajectory:
    """Simulate the mechanism of Table 3.1 without torque, released from its steady motion at a speed (rpm).

    It is released at the crank angle ``release`` (rad). The steady motion has the thesis's damper, the free motion has
    ``damping`` (dyn.s/cm).
    """
    period, speed = 60.0 / rpm, rpm * RAD_S_PER_RPM
    turns = 20.0 + release / (2.0 * pi)
    steady = simulate(table_3_1(stiffness), Inputs(speed=speed), stop_time=turns * period, step=turns * period)
    u, v = (float(steady[name][-1]) for name in ("slider.position", "slider.velocity"))
    initial = InitialState(crank_angle=release, crank_speed=speed, slider_position=u, slider_velocity=v)
    return simulate(table_3_1(stiffness, damping), initial=initial, stop_time=10.0 if damping else 4.0, step=5e-4)


@dataclass(frozen=True, slots=True)
class Turns:
    """Statistics of the whole turns of a free crank, from samples at evenly spaced crank angles.

    Attributes
    ----------
    ends : ndarray
        Time at which each turn ends (s).
    speed, speed_range : ndarray
        Mean crank speed, 2 pi divided by the time of the turn, and range of the crank speed (rad/s).
    slider, slider_range, velocity_range : ndarray
        Mean and range of the slider position (cm), and range of the slider velocity (cm/s).
    first, second : ndarray
        Amplitudes of the first and the second harmonic of the slider position over the crank angle (cm).
    energy_share : ndarray
        Relative range of the kinetic energy divided by the relative range of the squared crank speed.
    """

    ends: FloatArray
    speed: FloatArray
    speed_range: FloatArray
    slider: FloatArray
    slider_range: FloatArray
    velocity_range: FloatArray
    first: FloatArray
    second: FloatArray
    energy_share: FloatArray

    @classmethod
    def from_run(cls, run: Trajectory, start: float = 0.0) -> Turns:
        """Divide a run into turns and return their statistics; the first turn begins at the crank angle ``start`` (rad)."""
        angle = run["crank.angle"][: forward_samples(run["crank.angle"])]
        marks, both = (
            np.arange(start, angle[-1], 2.0 * pi),
            np.array([run.time, run["slider.position"]])[:, : len(angle)],
        )
        times, positions = CubicSpline(angle, both, axis=1)(marks)
        names = ("slider.position", "slider.velocity", "crank.speed", "energy.kinetic")
        u, v, w, e = (turn_by_turn(run, name, start) for name in names)
        harmonics = 2.0 * CM_PER_METRE / SAMPLES * np.abs(np.fft.rfft(u, axis=1))
        return cls(
            ends=times[1:],
            speed=2.0 * pi / np.diff(times),
            speed_range=np.ptp(w, axis=1),
            # by the trapezoidal rule: a turn does not end where it begins
            slider=CM_PER_METRE * (u.mean(axis=1) + 0.5 * np.diff(positions) / SAMPLES),
            slider_range=CM_PER_METRE * np.ptp(u, axis=1),
            velocity_range=CM_PER_METRE * np.ptp(v, axis=1),
            first=harmonics[:, 1],
            second=harmonics[:, 2],
            energy_share=np.ptp(e, axis=1) / e.mean(axis=1) / np.ptp(w * w, axis=1) * (w * w).mean(axis=1),
        )

    @property
    def shown(self) -> int:
        """Return the number of turns up to the first whose mean crank speed is below `HARMONIC_SPEED`, this turn included."""
        return 1 + int(np.argmax(self.speed < HARMONIC_SPEED))

    @property
    def resonance(self) -> float:
        """Return the mean crank speed (rad/s) at which the slider's second harmonic over the speed squared is greatest."""
        return self.speed_of_greatest(self.second / self.speed**2)

    def speed_of_greatest(self, values: FloatArray) -> float:
        """Return the mean crank speed (rad/s) at which values, one for each turn, are greatest, interpolated between turns."""
        turns = np.arange(len(values), dtype=float)
        return float(np.interp(greatest(turns, values)[0], turns, self.speed))


def turn_by_turn(run: Trajectory, output: str, start: float) -> FloatArray:
    """Sample an output over each whole turn from the crank angle ``start`` (rad), shape (turns, SAMPLES)."""
    return sample_turns(run["crank.angle"], run[output], start)


def forward_samples(angle: FloatArray) -> int:
    """Return the number of samples of the crank angle before the crank first stands still or turns back."""
    return 1 + int(np.argmax(np.append(np.diff(angle) <= 0.0, True)))


def sample_turns(angle: FloatArray, values: FloatArray, start: float = 0.0) -> FloatArray:
    """Sample values, given at crank angles (rad), over each whole turn from the angle ``start``, shape (turns, SAMPLES).

    The values are interpolated by cubic splines; the turns end where the crank first stands still or turns back.
    """
    n = forward_samples(angle)
    angle, values = angle[:n], values[:n]
    marks = np.arange(start, angle[-1], 2.0 * pi)
    grid = marks[:-1, None] + np.linspace(0.0, 2.0 * pi, SAMPLES, endpoint=False)
    sampled: FloatArray = CubicSpline(angle, values)(grid)
    return sampled


def half_natural_frequencies(stiffness: float) -> FloatArray:
    """Return half the slider's natural frequency (rad/s) with the effective mass at each crank angle of a turn, at u = 0."""
    parameters = table_3_1(stiffness)
    p = parameters.constants()
    places = (kinematics.position(angle, 0.0, p) for angle in np.linspace(0.0, 2.0 * pi, 721).tolist())
    masses = [dynamics.inertia(g, kinematics.coefficients(g, p), p).m22 for g in places]
    return 0.5 * np.sqrt(parameters.slider_stiffness / np.array(masses))


def second_halves(runs: Sequence[Trajectory], start: float) -> list[FloatArray]:
    """Return the mean speeds of the later turns of each run, relative to the mean speed of its first turn.

    The later turns are the second half of the turns that all runs have; the turns begin at the crank angle ``start`` (rad).
    """
    speeds = [Turns.from_run(run, start).speed for run in runs]
    count = min(map(len, speeds))
    return [speed[count // 2 : count] / speed[0] for speed in speeds]


def damper_cases(pairs: Mapping[str, tuple[Trajectory, Trajectory]], start: float) -> tuple[Case, ...]:
    """Judge whether a free crank loses mean speed only if it has a damper.

    Each pair has a run without the damper and a run with it; turns begin at the crank angle ``start`` (rad).
    """
    cases = []
    for label, runs in pairs.items():
        free, damped = (half.max() for half in second_halves(runs, start))
        cases.append(at_least(f"without the damper; {label}", 1.0 - ALIKE, free))
        cases.append(at_most(f"with it; {label}", 1.0 - ALIKE, damped))
    return tuple(cases)


def undamped_range(pairs: Mapping[str, tuple[Trajectory, Trajectory]], start: float) -> str:
    """Return the range of the mean speed of a turn without the damper, in the runs of `damper_cases`, in words.

    The words also say after how many whole turns a run without the damper ends early.
    """
    free = np.concatenate([second_halves(runs, start)[0] for runs in pairs.values()])
    early = {label: Turns.from_run(run, start).speed.size for label, (run, _) in pairs.items() if run.status}
    ends = "".join(
        f", and with {label} the links become collinear after {count} turns" for label, count in early.items()
    )
    return (
        f"without the damper, the mean speed of a turn varies between {free.min():.2f} and {free.max():.2f} of that of the "
        f"first turn{ends}"
    )


#: What `damper_cases` measures, and its tolerance.
UNDAMPED = (
    "greatest mean crank speed of a turn, relative to that of the first turn, without the damper and with it, in the second "
    "half of the turns that both motions have"
)
LOSS = f"{ALIKE_WORDS}; a loss is more than that, and lasts"


BOTH = {f"k = {plain(k)} dyn/cm": k for k in (SOFT, STIFF)}


def _coast_result(
    claim: str, run: Trajectory, columns: Mapping[str, FloatArray], *statements: Statement
) -> StudyResult:
    """Build the result of a free motion from its columns, up to the last turn that the figure shows."""
    turns = Turns.from_run(run)
    last = int(np.searchsorted(run.time, turns.ends[turns.shown - 1]))
    return StudyResult(
        claim=claim,
        assignment="The text does not say at which crank angle the torque is removed, nor how long the motion is followed. We "
        "remove it at 0 from the steady motion, and follow the motion until the mean crank speed falls below "
        f"{HARMONIC_SPEED:g} rad/s, which the text names.",
        columns={name: values[: last + 1] for name, values in columns.items()},
        statements=statements,
    )


def free_speed(stiffness: float) -> StudyResult:
    """Compute the crank speed over the crank angle in free motion."""
    run = coast(stiffness)
    return _coast_result(
        "The speed of the free crank oscillates; the oscillation and the mean decrease.",
        run,
        {
            "turns of the crank [1]": run["crank.angle"] / (2.0 * pi),
            f"crank speed; k = {plain(stiffness)} dyn/cm [rad/s]": run["crank.speed"],
        },
        _free_swings() if stiffness == SOFT else _free_causes(),
    )


def _free_swings() -> Statement:
    """Judge what Fig 3.11 and 3.12 show according to the thesis."""
    turns = {label: Turns.from_run(coast(k)) for label, k in BOTH.items()}
    return statement(
        "Both figures show that (1) The crank speed behaviour is oscillatory (2) The amplitude of oscillations "
        "decreases with crank angle and (3) The mean position of oscillation reduces with crank angle.",
        "3.3, L2241-2251",
        "least range of the crank speed in a turn, divided by its mean; range and mean relative to the turn before, each at "
        "its greatest; all turns in 10 s (our choice)",
        f"{ALIKE:g}, the rule for *steady*; {SIGN}",
        *(
            case
            for label, t in turns.items()
            for case in (
                at_least(f"range over the mean; {label}", ALIKE, (t.speed_range / t.speed).min()),
                at_most(f"range, turn to turn; {label}", 1.0, greatest_ratio(t.speed_range)),
                at_most(f"mean, turn to turn; {label}", 1.0, greatest_ratio(t.speed)),
            )
        ),
    )


def _free_causes() -> Statement:
    """Judge the causes that the thesis gives for what Fig 3.11 and 3.12 show."""
    undamped = {label: (coast(k, 0.0), coast(k)) for label, k in BOTH.items()}
    swings = [
        at_most(f"change of the kinetic energy; {label}", 0.5, t.energy_share[: t.shown].max())
        for label, t in ((label, Turns.from_run(coast(k))) for label, k in BOTH.items())
    ]
    return statement(
        "The oscillatory behaviour of the speed is due to the non-linearities of the system and the reduction in "
        "speed is due to viscous dissipation of energy in the slider.",
        "3.3, L2253-2259",
        "*the non-linearities* are read as the change of the inertia with the position. First the relative range of the "
        f"kinetic energy in a turn divided by that of the crank speed squared, the greatest down to {HARMONIC_SPEED:g} "
        f"rad/s: this is the part of the oscillation that they do not explain. Then the {UNDAMPED}, which are followed for 4 s "
        "and for 10 s (our choice)",
        f"at most half, as *due to* says; {LOSS}",
        *swings,
        *damper_cases(undamped, 0.0),
        why=undamped_range(undamped, 0.0),
    )


def draw_free_speed(result: StudyResult) -> Figure:
    """Draw the crank speed over the crank angle."""
    turns, speed = result.columns.values()
    curve, across = Curve(x=turns, y=speed), (0.0, float(turns[-1]))
    panel = Panel(x_label="turns of the crank", y_label="crank speed [rad/s]", curves=[curve], x_range=across)
    return plot_curves([panel], title=result.heading)


def _phase_plane(stiffness: float, *statements: Statement) -> StudyResult:
    """Compute the slider's phase plane in free motion."""
    run, label = coast(stiffness), f"k = {plain(stiffness)} dyn/cm"
    return _coast_result(
        "The slider tends to u = 0 and u' = 0 with decreasing oscillations, a drift, and higher harmonics.",
        run,
        {
            f"slider position u; {label} [cm]": CM_PER_METRE * run["slider.position"],
            f"slider velocity; {label} [cm/s]": CM_PER_METRE * run["slider.velocity"],
        },
        *statements,
    )


def order_of_chords(run: Trajectory) -> float:
    """Return the order, in the sampling step, with which the distance between phase-plane curve and chords decreases."""
    turns = Turns.from_run(run)
    shown = run.time < turns.ends[turns.shown - 1]
    u, v = (run[f"slider.{name}"][shown] for name in ("position", "velocity"))
    z = u / np.ptp(u) + 1j * v / np.ptp(v)
    coarse, fine = (float(np.abs(z[n::n] + z[:-n:n] - 2.0 * z[n // 2 : -n // 2 : n]).max()) for n in (4, 2))
    return float(np.log2(coarse / fine))


def soft_phase_plane() -> StudyResult:
    """Compute the phase plane with the soft spring, and judge the statements on Fig 3.13 and 3.14."""
    turns = {label: Turns.from_run(coast(k)) for label, k in BOTH.items()}
    drift, distance = (
        a / b for a, b in zip(*((np.ptp(t.slider[: t.shown]), abs(t.slider[0])) for t in turns.values()))
    )
    tending = [
        at_most(f"{name}; {label}", 1.0, greatest_ratio(np.abs(x[2 : t.shown])))
        for label, t in turns.items()
        for name, x in (("range", t.slider_range), ("mean", t.slider), ("range of u'", t.velocity_range))
    ]
    drifts = [
        at_least(f"drift; {label}", ALIKE, np.ptp(t.slider[: t.shown]) / t.slider_range[: t.shown].max())
        for label, t in turns.items()
    ]
    return _phase_plane(
        SOFT,
        statement(
            "Due to sampling of output data straight-line segments appear on the curves. These segments should in "
            "fact be smooth curves following the line pattern of the curves and appear as straight lines only because no "
            "points were sampled between the end points of each segment.",
            "3.3, L2266-2276",
            "order, in the time between samples, of the greatest distance of the curve from the middle of a straight "
            "segment, with u and u' relative to their ranges; samples 2 and 1 ms apart (our choice)",
            "order 2, as for a smooth curve (at a corner it is 1); 0.05, since an order is a whole number",
            unjudged("straight segments", "the segments are in the drawing, which our copy lacks"),
            *(near(f"smooth; {label}", 2.0, order_of_chords(coast(k)), 0.05) for label, k in BOTH.items()),
        ),
        statement(
            "Both figures show the tendency of the phase plane plot towards the region u=[0, u'=0]. In so doing the "
            "amplitude of the oscillation decreases and a superimposed shift on the slider position, in the form of "
            "a drift towards u=[0], is noticeable.",
            "3.3, L2276-2287",
            "range of u and u' and distance of the mean of u from 0, relative to the turn before: the greatest values from "
            "the fourth turn on (our choice), since the release causes a transient. Then the drift, which is the range of "
            "the mean of u over the turns drawn, relative to the greatest range of u in a turn",
            f"{SIGN}; more than {ALIKE:g}, the rule for what is seen on a graph",
            *tending,
            *drifts,
        ),
        statement(
            "Th[e] drift is greater in Fig. (3.13) due to the value of k being smaller which puts the mean position "
            "of oscillation further away from u=[0].",
            "3.3, L2287-2293",
            "drift, as in the row before, and distance of the mean of u from 0 in the first turn, relative to those with k = "
            "2e6 dyn/cm",
            SIGN,
            at_least("drift", 1.0, drift),
            at_least("distance", 1.0, distance),
        ),
        statement(
            "Non-linear effects leading to higher harmonics in the slider motion are clearly shown in both figures.",
            "3.3, L2293-2297",
            "higher harmonics of u (root of the sum of their squares) divided by the first harmonic, the least of the turns "
            "drawn. Then this ratio divided by the ratio that the equation linear in u gives for the same motion of the crank, "
            "the greatest: *non-linear* is read as non-linear in u, since the sentence is about the slider and the thesis "
            "linearises in u (L1248-1250); the sentence at L2253 is about the crank, whose inertia changes with its angle",
            f"more than {SMALL:g}, the rule for *small*; more than {1.0 + ALIKE:g}, the rule for *the same*, for a non-linear "
            "effect",
            *(at_least(label, SMALL, drawn_harmonics(k).min()) for label, k in BOTH.items()),
            *(at_least(f"non-linear; {label}", 1.0 + ALIKE, harmonics_over_linear(k)) for label, k in BOTH.items()),
            why="the equation linear in u has these harmonics too, because the geometry of the linkage forces them",
        ),
    )


@cache
def linear_motion(stiffness: float) -> tuple[FloatArray, FloatArray]:
    """Integrate the slider's equation, linearised about u = u' = 0, along the free crank's motion; return th2 (rad), u (m)."""
    run, p, turns = coast(stiffness), table_3_1(stiffness).constants(), Turns.from_run(coast(stiffness))
    # half a turn beyond those that are drawn
    n = int(np.searchsorted(run["crank.angle"], 2.0 * pi * (turns.shown + 0.5)))
    time, crank = run.time[:n], [run[f"crank.{name}"][:n] for name in ("angle", "speed", "acceleration")]

    def acceleration(crank_state: Sequence[float], u: float, v: float) -> float:
        angle, speed, rate = crank_state
        g = kinematics.position(angle, u, p)
        inputs = dynamics.NO_INPUTS._replace(speed_drive=1.0, acceleration=rate)
        return dynamics.motion(
            g, kinematics.coefficients(g, p), (angle, u, speed, v, 0.0, 0.0), inputs, p
        ).slider_acceleration

    du, dv = 1e-6, 1e-5
    terms = CubicSpline(
        time,
        [
            (
                acceleration(at, 0.0, 0.0),
                (acceleration(at, du, 0.0) - acceleration(at, -du, 0.0)) / (2.0 * du),
                (acceleration(at, 0.0, dv) - acceleration(at, 0.0, -dv)) / (2.0 * dv),
            )
            for at in np.transpose(crank).tolist()
        ],
    )

    def derivative(t: float, y: FloatArray) -> FloatArray:
        force, by_position, by_velocity = terms(t)
        return np.array([y[1], force + by_position * y[0] + by_velocity * y[1]])

    start = [run["slider.position"][0], run["slider.velocity"][0]]
    found = solve_ivp(derivative, (0.0, time[-1]), start, t_eval=time, rtol=1e-8, atol=1e-10, max_step=2e-3)
    return crank[0], found.y[0]


def higher_harmonics(turns: FloatArray) -> FloatArray:
    """Return the root sum square of the second and all higher harmonics, relative to the first, for each row of samples."""
    sizes = np.abs(np.fft.rfft(turns, axis=1))
    ratios: FloatArray = np.linalg.norm(sizes[:, 2:], axis=1) / sizes[:, 1]
    return ratios


def drawn_harmonics(stiffness: float) -> FloatArray:
    """Return the `higher_harmonics` of u in each turn that the figure shows."""
    run = coast(stiffness)
    return higher_harmonics(turn_by_turn(run, "slider.position", 0.0))[: Turns.from_run(run).shown]


def harmonics_over_linear(stiffness: float) -> float:
    """Return the greatest ratio of `drawn_harmonics` to the higher harmonics of the linear motion in the same turn."""
    found = drawn_harmonics(stiffness)
    return float((found / higher_harmonics(sample_turns(*linear_motion(stiffness)))[: len(found)]).max())


def stiff_phase_plane() -> StudyResult:
    """Compute the phase plane with the stiff spring, whose higher harmonics the thesis explains by a resonance."""
    soft, stiff = (Turns.from_run(coast(k)) for k in (SOFT, STIFF))
    # the mean speed falls from turn to turn
    seen = [float(np.interp(-HARMONIC_SPEED, -t.speed, t.second / t.first)) for t in (stiff, soft)]
    # the speeds at which the second harmonic is greatest: over the first, and over its force
    most, resonance = stiff.speed_of_greatest(stiff.second / stiff.first), stiff.resonance
    elsewhere = [Turns.from_run(coast(STIFF, release=x), x).resonance for x in (0.5 * pi, pi, 1.5 * pi)]
    parameters, over_turn = table_3_1(STIFF), half_natural_frequencies(STIFF)
    half, about = 0.5 * natural_frequency(parameters), ABOUT * HARMONIC_SPEED
    # an oscillator with this damping ratio swings most at sqrt(1 - 2 ratio^2) of its natural frequency
    ratio = parameters.slider_damping * half / parameters.slider_stiffness
    lowered = round(1.0 - float(np.sqrt(1.0 - 2.0 * ratio**2)), 3)
    # its response at twice the speed relative to that at the speed
    share = np.linspace(0.2, 1.0, 801)
    response, twice = (np.abs(1.0 - x**2 + 2j * ratio * x) ** -1 for x in (0.5 * share, share))
    one_mass = half * float(share[(twice / response).argmax()])
    return _phase_plane(
        STIFF,
        statement(
            "However, these non-linearities are more manifested in Fig. (3.14) around the crank angular speed of 27 rad/sec.",
            "3.3, L2297-2301",
            "second harmonic of u divided by the first (our measure) at a mean crank speed of 27 rad/s, relative to that "
            "with k = 5e5 dyn/cm. Then the speeds at which this ratio, and the second harmonic divided by the speed "
            f"squared, are greatest; the motion is followed beyond the plot, down to {stiff.speed[-1]:.1f} rad/s",
            f"{SIGN}; {100 * ABOUT:g} %, the rule for *around*",
            at_least("ratio at 27 rad/s", 1.0, seen[0] / seen[1]),
            near("speed of the greatest second harmonic over the speed squared", "27", resonance, about, "rad/s"),
            near(
                "speed of the greatest ratio",
                "27",
                most,
                about,
                "rad/s",
                why=f"the ratio goes on growing down to {most:.0f} rad/s. For a single mass with this damper, under "
                f"forces that grow with the square of the speed, it would be greatest at {one_mass:.0f} rad/s, not "
                "at half the natural frequency either",
            ),
            why="the speed of the greatest second harmonic over the speed squared is at the limit: with the torque removed at "
            f"90, 180 and 270 deg, it is {elsewhere[0]:.2f}, {elsewhere[1]:.2f} and {elsewhere[2]:.2f} rad/s",
        ),
        statement(
            "This speed is in fact an approximation to half the natural frequency of the system.",
            "3.3, L2301-2305",
            "half the natural frequency, computed with the mean effective mass of a turn, at u = 0; k = 2e6 dyn/cm",
            f"{ABOUT:g}, the rule for *approximately*",
            near("", "27", half, about, "rad/s"),
        ),
        statement(
            "This suggests that the non-linearity is a second subharmonic resonance.",
            "3.3, L2305-2307",
            "*subharmonic* is read as a resonance of the second harmonic at half the natural frequency. First the mean "
            "crank speed at which this harmonic divided by the speed squared is greatest, relative to the frequency of the "
            "row before; the force of the harmonic grows with the speed squared. Then the higher harmonics relative to "
            "those by the equation linear in u, as at Fig 3.13",
            f"{lowered:.3f} below 1, by which the damper of the thesis lowers the peak of an oscillator; more than "
            f"{1.0 + ALIKE:g}, the rule for *the same*, for a non-linearity",
            within("resonance", 1.0 - lowered, 1.0, resonance / half),
            at_least("non-linearity", 1.0 + ALIKE, harmonics_over_linear(STIFF)),
            why="the equation linear in u has this resonance too: the second harmonic of the force meets the natural frequency",
        ),
        statement(
            "It is however appreciated that a natural frequency of the mechanism in study is not a sharply defined value but "
            "extends over a range. This is due to the variable mass and inertia of the mechanism experienced by the slider.",
            "3.3, L2307-2317",
            "natural frequency with the least effective mass of a turn, divided by that with the greatest, at u = 0; k = "
            "2e6 dyn/cm",
            f"more than {1.0 + ALIKE:g}, the rule for *the same*",
            at_least("", 1.0 + ALIKE, over_turn.max() / over_turn.min()),
        ),
    )


def draw_phase_plane(result: StudyResult) -> Figure:
    """Draw the slider velocity over the position, with the start S and the finish F."""
    u, v = result.columns.values()
    start = Curve(x=u[:1], y=v[:1], colour="black", line="", marker="s", label="S, start")
    finish = Curve(x=u[-1:], y=v[-1:], colour="black", line="", marker="o", label="F, finish")
    panel = Panel(
        x_label="slider position u [cm]",
        y_label="slider velocity [cm/s]",
        curves=[Curve(x=u, y=v, width=0.7), start, finish],
        legend_at="outside",
    )
    return plot_curves([panel], title=result.heading, size=(6.4, 4.6))


#: The studies of 3.11 to 3.14.
STUDIES = {
    "3.11": Study(partial(free_speed, SOFT), draw_free_speed),
    "3.12": Study(partial(free_speed, STIFF), draw_free_speed),
    "3.13": Study(soft_phase_plane, draw_phase_plane),
    "3.14": Study(stiff_phase_plane, draw_phase_plane),
}
