"""Studies of ours on rig 1: the motions about resonance, where it could not be run, and the influence of friction."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import Crossing, PeriodicOrbit, SpecialPoint, Sweep, sweep
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, curves_of, near, padded, text, unjudged
from .rigs import (
    FASTEST,
    GRID,
    NOTICED,
    SAME,
    SLIGHT,
    SLOWEST,
    SPLIT,
    amplitude,
    columns_of,
    curves_over_speed,
    largest_multiplier,
    marks,
    motions,
    orbit,
    over_speed,
    resonant_b,
    rig,
    rise,
    rpm,
    slider,
    turn,
)
from .runs import steady_turn

# --- rig-1-resonance: what the thesis could not reach

#: Step of the sweeps (rpm).
STEP = 10.0
#: Branches: up to 900 rpm; from there on those from the low and from the high end, and the one of twice the period.
SPECIAL = "fold and period doublings"
NAMES = ("below resonance", "lower branch", "upper branch", "period of two turns")


@cache
def swept(spring: str, rising: bool) -> Sweep:
    """Sweep the speed up or down in steps with spring B about resonance."""
    low, step = (SLOWEST, 25.0) if spring == "A" else (SPLIT, STEP)
    speeds = np.arange(low, FASTEST[spring] + 1.0, step) * RAD_S_PER_RPM
    return sweep(rig(spring), speeds if rising else speeds[::-1])


def special_points() -> list[SpecialPoint]:
    """Return the folds and period doublings of the branches about resonance with spring B."""
    return [special for branch in resonant_b().branches for special in branch.special]


def speeds_of(kind: Crossing) -> list[float]:
    """Return the speeds of special points (rpm)."""
    return [special.parameter / RAD_S_PER_RPM for special in special_points() if special.kind is kind]


def upper_orbit(speed: float) -> PeriodicOrbit:
    """Find the motion of large amplitude with spring B at a speed (rpm)."""
    upper = resonant_b().branches[1]
    near_it = upper.orbits[int(np.argmin(np.abs(rpm(upper) - speed)))]
    return orbit(rig("B"), speed, near_it.start)


def compute_rig_1() -> StudyResult:
    """Compute branches of periodic motions, and sweeps with rising and falling speed."""
    columns = columns_of(motions("A").branches[0], "spring A")
    for name, branch in zip(NAMES, motions("B").branches + resonant_b().branches):
        columns |= columns_of(branch, f"spring B; {name}")
    for name, rising in (("rising speed", True), ("falling speed", False)):
        found = swept("B", rising)
        columns[f"speed; {name} [rpm]"] = found.speed / RAD_S_PER_RPM
        columns[f"amplitude; {name} [cm]"] = CM_PER_METRE * found.amplitude.filled(np.nan)
    special = special_points()
    columns[f"speed; {SPECIAL} [rpm]"] = np.array([s.parameter for s in special]) / RAD_S_PER_RPM
    columns[f"amplitude; {SPECIAL} [cm]"] = CM_PER_METRE * np.array([s.orbit.amplitude for s in special])
    (fold,), doublings = speeds_of(Crossing.FOLD), speeds_of(Crossing.PERIOD_DOUBLING)
    (jump,) = (jump.speed / RAD_S_PER_RPM for jump in swept("B", True).jumps)
    falling = swept("B", False)
    doubled = max(s for s, turns in zip(falling.speed / RAD_S_PER_RPM, falling.turns) if turns == 2)
    up, down = (swept("A", rising).amplitude for rising in (True, False))
    apart = CM_PER_METRE * float(np.ma.abs(up - down[::-1]).filled(np.inf).max())
    upper, largest = upper_orbit(1000.0), largest_multiplier("A", SLOWEST, FASTEST["A"])
    run = steady_turn(rig("B"), 1000.0, (0.95 * float(upper.start[0]), 0.95 * float(upper.start[1])))
    beside = abs(CM_PER_METRE * upper.amplitude - run.amplitude)
    return StudyResult(
        number="rig-1-resonance",
        claim="With spring A there is one motion at each speed; with spring B resonance leans over, and two exist at a time.",
        columns=padded(columns),
        verdicts=(
            at_most("difference between sweeps with rising and falling speed; spring A", OURS, SAME, apart, "cm"),
            at_most("largest Floquet multiplier over all speeds; spring A", OURS, 1.0, largest),
            near("jump of the sweep with rising speed, at the fold; spring B", OURS, fold, jump, STEP, "rpm"),
            near(
                "two turns of the falling sweep, from the doubling; spring B",
                OURS,
                max(doublings),
                doubled,
                STEP,
                "rpm",
            ),
            at_most(
                "difference between the upper motion and a run begun beside it; spring B", OURS, SAME, beside, "cm"
            ),
        ),
    )


def draw_rig_1(result: StudyResult) -> Figure:
    """Draw the amplitude over the speed: spring A, spring B up to resonance, and the motions about resonance."""
    below = [c for n in NAMES[:2] for c in curves_over_speed(result, f"spring B; {n}", COLOURS[0])]
    about = [c for n, colour in zip(NAMES[1:], COLOURS) for c in curves_over_speed(result, f"spring B; {n}", colour, n)]
    for name, label, line, marker, colour in (
        ("rising speed", "sweep with rising speed", ":", "^", "0.45"),
        ("falling speed", "sweep with falling speed", ":", "v", "0.45"),
        (SPECIAL, SPECIAL, "", "D", COLOURS[6]),
    ):
        x, y = result.columns[f"speed; {name} [rpm]"], result.columns[f"amplitude; {name} [cm]"]
        about.append(Curve(x=x, y=y, label=label, line=line, marker=marker, colour=colour))
    panels = [
        Panel(
            x_label="crank speed [rpm]",
            y_label="amplitude of u [cm]",
            title=title,
            curves=curves,
            verticals=verticals,
            x_range=x_range,
            y_range=(0.0, top),
            legend_at="outside",
        )
        for title, curves, verticals, x_range, top in (
            ("spring A", curves_over_speed(result, "spring A", COLOURS[0]), marks("A", 1, 2, 3), (100.0, 1200.0), 4.5),
            ("spring B, up to resonance", below, marks("B", 2, 3, 4), (100.0, 1060.0), 4.5),
            ("spring B, about resonance; dashed: unstable", about, marks("B", 1), (880.0, 1300.0), 18.0),
        )
    ]
    return plot_curves(panels, title=result.heading, columns=3, size=(4.6, 3.7))


# --- rig-1-friction: what friction in proportion to the guide's force explains of figures 8.7 to 8.17

#: Coefficients of friction in the guide; those of them that are judged: a low one, and one that hides the third harmonic.
COEFFICIENTS, STRONG = (0.0, SLIGHT, 0.1, 0.2), 0.2
#: Speeds (rpm) of the figures where theory and experiment are compared, and of the turns shown.
COMPARED = {"A": (390.0, 420.0, 450.0), "B": (600.0, 660.0, 720.0)}
SHOWN = {"A": 420.0, "B": 660.0}
#: Friction radius of the pins B, C and D (m): a dry bearing of PTFE, coefficient 0.05 to 0.1, on a pin of 3 to 6 mm.
PIN_RADIUS = 3e-4


def lowered(spring: str, **changes: float) -> NDArray[np.float64]:
    """Return the relative decrease of the amplitude by changes of the rig, at the speeds of comparison."""
    speeds = COMPARED[spring]
    return np.array([1.0 - amplitude(turn(spring, w, **changes)) / amplitude(turn(spring, w)) for w in speeds])


def lag(spring: str, speed: float, coefficient: float) -> float:
    """Return the delay of the motion by friction that gives the best agreement (deg of crank angle)."""
    rough, smooth = (slider(turn(spring, speed, slider_friction_coefficient=c))[:-1] for c in (coefficient, 0.0))
    together = np.fft.irfft(np.fft.rfft(rough - rough.mean()) * np.conj(np.fft.rfft(smooth - smooth.mean())))
    shift = 360.0 / len(rough) * int(np.argmax(together))
    return (shift + 180.0) % 360.0 - 180.0


def lost_to_friction(speed: float, coefficient: float) -> float:
    """Return the work of friction in the guide relative to the damper's, over a crank cycle with spring A."""
    of = turn("A", speed, slider_friction_coefficient=coefficient)
    v = of["slider.velocity"]
    viscous = rig("A").slider_damping * np.mean(v**2)
    return float(coefficient * np.mean(np.abs(of["slider.guide_force"] * v)) / viscous)


def _with(coefficient: float) -> list[Verdict]:
    """Judge the statements on the amplitudes with a coefficient of friction."""
    friction, words = {"slider_friction_coefficient": coefficient}, f"; coefficient {coefficient:g}"
    taken = {s: lowered(s, **friction) for s in "AB"}
    shift, ratio = max(abs(lag("A", w, coefficient)) for w in COMPARED["A"]), taken["B"].mean() / taken["A"].mean()
    work, rises = lost_to_friction(420.0, coefficient), {s: max(rise(s, coefficient, n) for n in (3, 4)) for s in "AB"}
    half, last = (np.abs(slider(turn("B", speed, **friction))).max() for speed in (570.0, 800.0))
    more, less = "" if coefficient == SLIGHT else "more than slight friction", "friction lowers spring B's less"
    hidden, remains = (
        {s: "it takes more friction" if r > NOTICED else "" for s, r in rises.items()},
        "it stays greatest at half",
    )
    fractions = "rise of the amplitude at a third and a quarter of the natural frequency, spring"
    agree, most = "8.4.1.1, L6484", taken["A"].max()
    return [
        at_most(f"amplitude taken off at 390 to 450 rpm, spring A{words}", text(agree), 0.1, most, why=more),
        at_most(f"shift of the phase at 390 to 450 rpm, spring A{words}", text(agree), 5.0, shift, "deg", why=more),
        at_most(f"work of Coulomb over viscous friction, 420 rpm{words}", text("8.4.1.1, L6494"), 1.0, work, why=more),
        at_least(f"amplitude taken off, spring B over A{words}", text("8.4.1.1, L6526"), 1.0, ratio, why=less),
        *(
            at_most(f"{fractions} {s}{words}", text("8.4.1.2, L6770"), NOTICED, value, why=hidden[s])
            for s, value in rises.items()
        ),
        at_least(f"displacement at 800 over 570 rpm, B{words}", text("8.4.1.2, L6555"), 1.0, last / half, why=remains),
    ]


def compute_friction() -> StudyResult:
    """Compute the amplitude over the speed with friction, and judge the statements on the amplitudes."""
    columns: dict[str, NDArray[np.float64]] = {}
    for s in "AB":
        columns[f"speed; spring {s} [rpm]"] = GRID[s]
        for c in COEFFICIENTS:
            columns[f"amplitude; coefficient {c:g}; spring {s} [cm]"] = over_speed(s, c)
            columns[f"u; coefficient {c:g}; spring {s} [cm]"] = slider(turn(s, SHOWN[s], slider_friction_coefficient=c))
    columns["crank angle [deg]"] = np.linspace(0.0, 360.0, len(slider(turn("A", SHOWN["A"]))))
    force = {speed: np.abs(turn("A", speed)["slider.guide_force"]) for speed in COMPARED["A"]}
    within, over = force[420.0].max() / force[420.0].mean(), force[450.0].max() / force[390.0].max()
    joint = turn("A", 420.0)
    weight = np.abs(joint["slider.guide_force"] - joint["pin.D.fy"]).max()
    pins = lowered("A", **{f"pin_{pin}_friction_radius": PIN_RADIUS for pin in "BCD"}).max()
    damper = lowered("A", slider_damping=1.1 * rig("A").slider_damping).max()
    whole = sum(all(verdict.holds for verdict in _with(c)) for c in COEFFICIENTS[1:])
    tried = f"coefficients, of {', '.join(f'{c:g}' for c in COEFFICIENTS[1:])}, with which all of the following holds"
    carried = f"the slider's weight is {rig('A').slider_mass * rig('A').gravity:.2f} N"
    why = f"its scatter is not given; 10 % more takes {damper:.1%} off the amplitude"
    why_pins = f"no size is given; {1e3 * PIN_RADIUS:g} mm in pins B to D take {pins:.1%} off the amplitude"
    return StudyResult(
        number="rig-1-friction",
        claim="Friction by the normal force in the guide, and in the pins, explains the differences of amplitude.",
        assignment=(
            "The text gives no coefficient and no measured amplitude. Slight variations are at most 10 % here, total agreement "
            f"in phase is 5 deg, and a rise of the amplitude by less than {NOTICED:.0%} is not noticed."
        ),
        columns=padded(columns),
        verdicts=(
            at_least(
                "greatest force of the guide in a cycle over its mean, 420 rpm", text("8.4.1.1, L6496"), 1.1, within
            ),
            at_least("greatest force of the guide at 450 over 390 rpm", text("8.4.1.1, L6496"), 1.1, over),
            at_most(
                "force of the guide less the joint's, 420 rpm", text("8.4.1.1, L6498"), 0.1, weight, "N", why=carried
            ),
            at_least(tried, text("8.4.1.1, L6486"), 1.0, whole, why="what hides one departure makes another"),
            *_with(SLIGHT),
            *_with(STRONG),
            unjudged("the average of the damping coefficient contributes", text("8.4.1.1, L6510"), why),
            unjudged("friction in the pins contributes", text("8.4.1.1, L6512"), why_pins),
        ),
    )


def draw_friction(result: StudyResult) -> Figure:
    """Draw the amplitude over the speed and a turn, one curve a coefficient."""
    panels = []
    for s, speed in SHOWN.items():
        verticals = {words: place for words, place in marks(s, 2, 3, 4).items() if place > GRID[s][0]}
        for what, x, x_label, title, lines in (
            ("amplitude", f"speed; spring {s} [rpm]", "crank speed [rpm]", f"spring {s}", verticals),
            ("u", "crank angle [deg]", "crank angle [deg]", f"spring {s}, {speed:g} rpm", None),
        ):
            names = {f"{what}; coefficient {c:g}; spring {s} [cm]": f"{c:g}" for c in COEFFICIENTS}
            panels.append(
                Panel(
                    x_label=x_label,
                    y_label="amplitude of u [cm]" if lines else "slider position u [cm]",
                    title=title,
                    curves=curves_of(result, x, names),
                    verticals=lines,
                    legend="coefficient",
                    legend_at="best" if lines else "outside",
                    x_ticks=None if lines else range(0, 361, 45),
                )
            )
    return plot_curves(panels, title=result.heading, columns=2, size=(5.2, 3.6))


STUDIES = (
    Study("rig-1-resonance", compute_rig_1, draw_rig_1),
    Study("rig-1-friction", compute_friction, draw_friction),
)
