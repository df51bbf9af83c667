"""Rig 1: the motions about resonance, where the rig could not be run, and the effect of friction on the amplitudes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import PeriodicOrbit, SpecialPoint, Sweep, Turn, sweep
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ABOUT, ABOUT_DEG, ALIKE, SLIGHTLY
from ..statements import Case, Statement, at_least, at_most, text
from ..study import Study, StudyResult, padded, result_curves
from ..variation import cache
from .rigs import (
    FASTEST,
    GRID,
    SLIGHT,
    SLOWEST,
    SPLIT,
    amplitude,
    branch_columns,
    curves_over_speed,
    marks,
    motions,
    orbit,
    over_speed,
    resonant_b,
    rig,
    rpm,
    slider,
    turn,
)

# --- rig-1-resonance: what the thesis could not reach

#: Step of the sweeps (rpm).
STEP = 10.0
#: Highest speed (rpm) at which each spring was run, as printed; the guide was too short for greater amplitudes.
STOPPED = {"A": "500", "B": "800"}
#: Special points; branches with spring B: up to 900 rpm, beyond it from the low and the high end, and one of twice the period.
SPECIAL = "fold and period doublings"
NAMES = ("below resonance", "lower branch", "upper branch", "period of two turns")


@cache
def swept(spring: str, rising: bool) -> Sweep:
    """Sweep the speed up or down in steps: with spring A over all speeds, with spring B about resonance."""
    low, step = (SLOWEST, 25.0) if spring == "A" else (SPLIT, STEP)
    speeds = np.arange(low, FASTEST[spring] + 1.0, step) * RAD_S_PER_RPM
    return sweep(rig(spring), speeds if rising else speeds[::-1])


def special_points() -> list[SpecialPoint]:
    """Return the folds and period doublings of the branches about resonance with spring B."""
    return [special for branch in resonant_b().branches for special in branch.special]


def upper_orbit(speed: float) -> PeriodicOrbit:
    """Find the motion of large amplitude with spring B at a speed (rpm)."""
    upper = resonant_b().branches[1]
    near_it = upper.orbits[int(np.argmin(np.abs(rpm(upper) - speed)))]
    return orbit(rig("B"), speed, near_it.start)


def compute_rig_1() -> StudyResult:
    """Compute the branches of periodic motions, and sweeps with rising and falling speed."""
    columns = branch_columns(motions("A").branches[0], "spring A")
    for name, branch in zip(NAMES, motions("B").branches + resonant_b().branches):
        columns |= branch_columns(branch, f"spring B; {name}")
    for name, rising in (("rising speed", True), ("falling speed", False)):
        found = swept("B", rising)
        columns[f"speed; {name} [rpm]"] = found.speed / RAD_S_PER_RPM
        columns[f"amplitude; {name} [cm]"] = CM_PER_METRE * found.amplitude.filled(np.nan)
    special = special_points()
    columns[f"speed; {SPECIAL} [rpm]"] = np.array([s.parameter for s in special]) / RAD_S_PER_RPM
    columns[f"amplitude; {SPECIAL} [cm]"] = CM_PER_METRE * np.array([s.orbit.amplitude for s in special])
    greatest = {"A": float(motions("A").branches[0].amplitude.max()), "B": upper_orbit(1000.0).amplitude}
    resonant = float(rpm(motions("A").branches[0])[motions("A").branches[0].amplitude.argmax()])
    # at the last speed the guide was too short
    accommodated = {s: max([amplitude(of) for of in _turns_to_stop(s).values()][:-1]) for s in "AB"}
    reached = {s: _displacements(s) for s in "AB"}
    by_amplitude = [amplitude(turn(s, float(STOPPED[s]))) / accommodated[s] for s in "AB"]
    why = (
        f"with spring B it is {reached['B'][0]:.2f} cm at {STOPPED['B']} rpm, and {reached['B'][1]:.2f} cm at "
        f"{reached['B'][2]:.0f} rpm, near half the natural frequency, where the rig did run (Fig 8.16)"
    )
    return StudyResult(
        number="rig-1-resonance",
        claim="With spring A there is one motion at each speed; with spring B resonance leans over, and below its peak two "
        "stable motions exist at a time.",
        columns=padded(columns),
        statements=(
            Statement(
                "Due to practical difficulties, namely the large amplitudes of oscillations near the natural frequencies, "
                "resonance curves could not be obtained using this apparatus.",
                text("8.4.1.2, L6543"),
                "amplitude near the natural frequency over the greatest at the speeds of the next sentence, which the guide "
                f"did accommodate: with spring A the greatest of all, at {resonant:.0f} rpm; with spring B that of the upper "
                f"branch at 1000 rpm, our choice, within {ABOUT:.0%} of 1160, the rule for *near*",
                "at least 1: *large* is more than the guide did accommodate, as its length is not printed",
                tuple(at_least(f"spring {s}", 1.0, CM_PER_METRE * greatest[s] / accommodated[s]) for s in "AB"),
                "with spring B on the lower branch, which rising speed follows, it is "
                f"{amplitude(turn('B', 1000.0)) / accommodated['B']:.1f}",
            ),
            Statement(
                "However when the speed was increased to 500 RPM with spring A and 800 RPM with spring B the amplitude of "
                "slider oscillations was so large that the slider guide could not accommodate it.",
                text("8.4.1.2, L6555"),
                "greatest displacement at this speed, from the free position of the spring, over that at lower speeds, which "
                "the guide did accommodate: every 5 rpm from 240 (spring A) and 500 rpm (spring B) on, the lowest of the "
                "figures",
                "at least 1: what the guide accommodated is no more than it can",
                tuple(
                    at_least(f"spring {s}, {STOPPED[s]} rpm", 1.0, a / b, why=why) for s, (a, b, _) in reached.items()
                ),
                f"by half the range the two are {' and '.join(f'{ratio:.2f}' for ratio in by_amplitude)}",
            ),
        ),
    )


def _turns_to_stop(spring: str) -> dict[float, Turn]:
    """Return one turn of the steady motion at each of several crank speeds (rpm), by speed; ``spring`` is "A" or "B".

    The speeds go from the lowest speed of the figures to the speed at which the rig was stopped, in steps of 5 rpm.
    """
    speeds = np.arange({"A": 240.0, "B": 500.0}[spring], float(STOPPED[spring]) + 1.0, 5.0).tolist()
    return {w: turn(spring, w) for w in speeds}


def _displacements(spring: str) -> tuple[float, float, float]:
    """Return the greatest displacement (cm) at the speed where the rig was stopped, and the greatest at all lower speeds (cm).

    The third result is the speed (rpm) of the greatest displacement at lower speeds.
    """
    found = {w: float(np.abs(slider(of)).max()) for w, of in _turns_to_stop(spring).items()}
    _, there = found.popitem()
    at = max(found, key=found.__getitem__)
    return there, found[at], at


def draw_rig_1(result: StudyResult) -> Figure:
    """Draw the amplitude over the speed: spring A, spring B up to resonance, and spring B about resonance."""
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
            y_label="slider amplitude [cm]",
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

#: Coefficients of friction in the guide; the one of them that hides the third harmonic.
COEFFICIENTS, STRONG = (0.0, SLIGHT, 0.1, 0.15), 0.15
#: Speeds (rpm) of the figures where theory and experiment are compared, and of the turns shown.
COMPARED = {"A": (390.0, 420.0, 450.0), "B": (600.0, 660.0, 720.0)}
SHOWN = {"A": 420.0, "B": 660.0}
#: Friction radius of the pins B, C and D (m): a dry bearing of PTFE, coefficient 0.05 to 0.1, on a pin of 3 to 6 mm.
PIN_RADIUS = 3e-4


def lowered(spring: str, **changes: float) -> NDArray[np.float64]:
    """Return the relative decrease of the amplitude at the speeds `COMPARED` if parameters of the rig are changed."""
    speeds = COMPARED[spring]
    return np.array([1.0 - amplitude(turn(spring, w, **changes)) / amplitude(turn(spring, w)) for w in speeds])


def lag(spring: str, speed: float, coefficient: float) -> float:
    """Return the delay (deg of crank angle) of the motion with friction behind the motion without it, by correlation."""
    rough, smooth = (slider(turn(spring, speed, slider_friction_coefficient=c))[:-1] for c in (coefficient, 0.0))
    together = np.fft.irfft(np.fft.rfft(rough - rough.mean()) * np.conj(np.fft.rfft(smooth - smooth.mean())))
    shift = 360.0 / len(rough) * int(np.argmax(together))
    return (shift + 180.0) % 360.0 - 180.0


def over_damper(spring: str, speed: float, coefficient: float) -> NDArray[np.float64]:
    """Return the ratios of the guide friction to the damper's force: of work in a turn, mean force and greatest force."""
    of = turn(spring, speed, slider_friction_coefficient=coefficient)
    v = np.abs(of["slider.velocity"])
    forces = coefficient * np.abs(of["slider.guide_force"]), rig(spring).slider_damping * v
    friction, viscous = (np.array([np.mean(f * v), f.mean(), f.max()]) for f in forces)
    return np.asarray(friction / viscous)


def _constant_friction(force: float, speed: float) -> tuple[float, float]:
    """Compare constant friction (N) with friction by the coefficient `SLIGHT`, for spring A at a speed (rpm).

    The first result is the greatest difference of u between the two, relative to the amplitude without friction. The second is
    the relative excess of the work that constant friction does in a turn over the work of the other friction.
    """
    even, varying = (
        turn("A", speed, **{name: value})
        for name, value in (("slider_coulomb_friction", force), ("slider_friction_coefficient", SLIGHT))
    )
    work = SLIGHT * np.mean(np.abs(varying["slider.guide_force"] * varying["slider.velocity"]))
    apart = np.abs(slider(varying) - slider(even)).max()
    more = force * np.mean(np.abs(even["slider.velocity"])) / work - 1.0
    return float(apart / amplitude(turn("A", speed))), float(more)


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
    apart = min(
        np.abs(of["slider.guide_force"] - of["pin.D.fy"]).max() / force[w].max()
        for w, of in ((w, turn("A", w)) for w in COMPARED["A"])
    )
    pins = lowered("A", **{f"pin_{pin}_friction_radius": PIN_RADIUS for pin in "BCD"}).max()
    damper = lowered("A", slider_damping=1.1 * rig("A").slider_damping).max()
    taken = {(s, c): lowered(s, slider_friction_coefficient=c) for s in "AB" for c in (SLIGHT, STRONG)}
    in_cm = {(s, c): x * [amplitude(turn(s, w)) for w in COMPARED[s]] for (s, c), x in taken.items()}
    lost = in_cm["A", SLIGHT]
    just_slight, still_slight = (
        brentq(lambda c, part=part: lowered("A", slider_friction_coefficient=c).max() - part, *ends, xtol=1e-4)
        for part, ends in ((ALIKE, (0.5 * SLIGHT, SLIGHT)), (SLIGHTLY, (SLIGHT, STRONG)))
    )
    constant = {w: SLIGHT * float(force[w].mean()) for w in COMPARED["A"]}
    within = min(_constant_friction(constant[w], w)[0] for w in COMPARED["A"])
    # the constant friction that does the same work in a turn
    mean = constant[SHOWN["A"]]
    working = brentq(lambda c: _constant_friction(c, SHOWN["A"])[1], 0.5 * mean, 2.0 * mean, xtol=1e-4)
    shift, shift_slight = (max(abs(lag("A", w, c)) for w in COMPARED["A"]) for c in (SLIGHT, still_slight))
    # the most of the six speeds, by each of three measures
    rubbed = {
        c: np.max([over_damper(s, w, c) for s in "AB" for w in COMPARED[s]], axis=0)
        for c in (just_slight, still_slight)
    }
    heavy = f"the slider's weight, {rig('A').slider_mass * rig('A').gravity:.2f} N, comes on top of the joint's force"
    b_over_a = " and ".join(f"{taken['B', c].mean() / taken['A', c].mean():.2f}" for c in (SLIGHT, STRONG))
    b_over_a_cm = " and ".join(f"{in_cm['B', c].mean() / in_cm['A', c].mean():.2f}" for c in (SLIGHT, STRONG))
    return StudyResult(
        number="rig-1-friction",
        claim="Friction by the normal force in the guide, and in the pins, explains the differences of amplitude.",
        assignment=(
            f"The text gives no coefficient and no measured amplitude. A coefficient of {SLIGHT:g}, our choice, changes the "
            "amplitudes with spring A at 390 to 450 rpm slightly."
        ),
        columns=padded(columns),
        statements=(
            Statement(
                "[That the phase is almost in total agreement while the amplitude shows slight variations] may be explained by "
                "the fact that the frictional forces opposing the slider motion are considered solely viscous in the theory.",
                text("8.4.1.1, L6486"),
                "delay, to 0.25 deg, at which the motion with friction in the guide agrees best with that without, spring A, "
                f"the most of 390, 420 and 450 rpm, with a coefficient of {SLIGHT:g}: our choice, one that takes a slight part "
                f"off the amplitude ({taken['A', SLIGHT].max():.1%})",
                f"{ABOUT_DEG:g} deg, the rule for *almost*",
                (at_most("shift", ABOUT_DEG, shift, "deg"),),
                f"with {still_slight:.3f}, the greatest coefficient whose effect is still slight, as it takes {SLIGHTLY:.0%} "
                f"off the amplitude, it is {shift_slight:.2g} deg",
            ),
            Statement(
                "However in practice these frictional forces are a combination of viscous and Coloumb friction forces, "
                "although in this experiment the viscous forces are dominant.",
                text("8.4.1.1, L6490"),
                "Coulomb's friction in the guide over the damper's, by the work in a turn, the mean and the greatest force: "
                "the most of the six speeds of Fig 8.8 to 8.13, springs A and B, with the greatest coefficient whose effect "
                f"with spring A is still slight as at L6486, {still_slight:.3f}",
                "at most 1: *dominant* is the greater",
                (
                    *(at_most(what, 1.0, size) for what, size in zip(("work", "mean force"), rubbed[still_slight])),
                    Case(
                        label="greatest force",
                        computed=None,
                        why=f"by the greatest force it is {rubbed[just_slight][2]:.2f} to {rubbed[still_slight][2]:.2f} times "
                        f"the damper's for coefficients of {just_slight:.3f} to {still_slight:.3f}, which take "
                        f"{100.0 * ALIKE:g} to {100.0 * SLIGHTLY:g} % off the amplitude and are all slight",
                    ),
                ),
                "that there is Coulomb's friction is taken as given",
            ),
            Statement(
                "Because a Coloumb friction force varies with the normal force and since in this experiment this normal "
                "force, which is the vertical force in the rocker-slider joint, varies with crank speed and also within a "
                "crank cycle, this explains the difference in amplitude between the theoretical and experimental motions "
                "with variation of crank speed and also within one crank cycle.",
                text("8.4.1.1, L6496"),
                "spring A at 390, 420 and 450 rpm: greatest force of the guide in a turn over its mean, the least of the "
                "three; greatest force at 450 over that at 390 rpm; greatest difference of the force from the vertical one in "
                "the joint, relative to the greatest force, the least of the three; what friction by a coefficient of "
                f"{SLIGHT:g} takes off the amplitude, in cm, greatest over least of the three; greatest difference of u in the "
                "turn with this friction from u with constant friction of the same mean, over the amplitude, the least of the "
                "three",
                f"more than {1.0 + ALIKE:g} for a ratio and {ALIKE:g} for a difference that is seen; at most {ALIKE:g} for the "
                "force of the joint: the rule for *the same*",
                (
                    at_least("within a cycle", 1.0 + ALIKE, min(f.max() / f.mean() for f in force.values())),
                    at_least("with the speed", 1.0 + ALIKE, force[450.0].max() / force[390.0].max()),
                    at_most("from the joint's", ALIKE, apart, why=heavy),
                    at_least("taken off, with the speed", 1.0 + ALIKE, max(lost) / min(lost)),
                    at_least("within a cycle, from constant friction", ALIKE, within),
                ),
                f"friction takes off {min(lost):.3f} to {max(lost):.3f} cm; relative to the amplitude this is alike at the "
                f"three speeds, {100.0 * taken['A', SLIGHT].min():.1f} to {100.0 * taken['A', SLIGHT].max():.1f} %; from "
                f"constant friction that does the same work in a turn, {working / mean:.2f} times as strong at "
                f"{SHOWN['A']:g} rpm, u differs by {_constant_friction(working, SHOWN['A'])[0]:.2f} of the amplitude too",
            ),
            Statement(
                "Other factors contributing to the difference are (a) only an average estimation of the damping coefficient "
                "is considered in the theory and (b) the friction in the pin joints of the linkage is also ignored in the "
                "theory.",
                text("8.4.1.1, L6508"),
                why="neither the scatter of the coefficient nor a size of the bearings is given, nor which way the amplitude "
                "differs, which is said for rig 2 (L6841); 10 % more damping takes "
                f"{damper:.1%} off the amplitude with spring A, friction in the pins {pins:.1%}, with a friction radius "
                f"(coefficient times radius of the pin) of {1e3 * PIN_RADIUS:g} mm, our choice: the most of the three speeds",
            ),
            Statement(
                "The differences may be attributed to the same factors as previously described with spring A.",
                text("8.4.1.1, L6528"),
                why="of the three factors two, the scatter of the damping and the pins, have no size; the first, friction in "
                f"the guide, with one coefficient for both springs, {SLIGHT:g} and {STRONG:g}, takes off {b_over_a} times as "
                "great a share of the amplitude with B as with A, means of the three speeds; in cm the ratios are "
                f"{b_over_a_cm}: alone it does not explain why the agreement with B is poorer",
            ),
        ),
    )


def draw_friction(result: StudyResult) -> Figure:
    """Draw the amplitude over the speed, and u over a turn, one curve for each coefficient of friction."""
    panels = []
    for s, speed in SHOWN.items():
        verticals = {words: place for words, place in marks(s, 2, 3, 4).items() if place > GRID[s][0]}
        for what, x, x_label, title, lines in (
            ("amplitude", f"speed; spring {s} [rpm]", "crank speed [rpm]", f"spring {s}", verticals),
            ("u", "crank angle [deg]", "crank angle [deg]", f"spring {s}, {speed:g} rpm", None),
        ):
            # the panel on the right has the legend for both
            names = {f"{what}; coefficient {c:g}; spring {s} [cm]": "" if lines else f"{c:g}" for c in COEFFICIENTS}
            panels.append(
                Panel(
                    x_label=x_label,
                    y_label="slider amplitude [cm]" if lines else "slider position u [cm]",
                    title=title,
                    curves=result_curves(result, x, names),
                    verticals=lines,
                    legend="coefficient",
                    legend_at="outside",
                    x_ticks=None if lines else range(0, 361, 90),
                )
            )
    return plot_curves(panels, title=result.heading, columns=2, size=(5.2, 3.6))


#: The studies by their names.
STUDIES = {
    "rig-1-resonance": Study("rig-1-resonance", compute_rig_1, draw_rig_1),
    "rig-1-friction": Study("rig-1-friction", compute_friction, draw_friction),
}
