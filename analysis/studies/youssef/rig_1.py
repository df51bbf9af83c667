"""Rig 1: the motions near resonance, where the rig could not be run, and the effect of friction on the amplitudes.

Speeds are in rpm; a coefficient is that of the friction in the guide.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import SpecialPoint, Sweep, sweep
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ABOUT_DEG, ALIKE, SLIGHTLY
from ..statements import FloatArray, Statement, at_least, at_most, statement, unjudged
from ..study import Study, StudyResult, pad_columns, result_curves
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
    friction_amplitudes,
    marks,
    motions,
    resonant_b,
    rig,
    slider,
    turn,
)

# --- rig-1-resonance: what the thesis could not reach

#: Step of the sweeps (rpm).
STEP = 10.0
#: Lowest speed (rpm) of the figures with each spring, and the speed at which the guide was too short, as printed.
FIRST, STOPPED = {"A": 240.0, "B": 500.0}, {"A": "500", "B": "800"}
#: Natural frequency (rpm) with each spring, as printed (L6553, L6555).
NATURAL = {"A": 580.0, "B": 1160.0}
#: Special points; branches with spring B: up to 900 rpm, beyond it from the low and the high end, and one of twice the period.
SPECIAL = "fold and period doublings"
NAMES = ("below resonance", "lower branch", "upper branch", "period of two turns")


@cache
def sweep_speed(spring: str, rising: bool) -> Sweep:
    """Sweep the speed up or down in steps: with spring A over all speeds, with spring B near resonance."""
    low, step = (SLOWEST, 25.0) if spring == "A" else (SPLIT, STEP)
    speeds = np.arange(low, FASTEST[spring] + 1.0, step) * RAD_S_PER_RPM
    return sweep(rig(spring), speeds if rising else speeds[::-1])


def special_points() -> list[SpecialPoint]:
    """Return the folds and period doublings of the branches near resonance with spring B."""
    return [special for branch in resonant_b().branches for special in branch.special]


def compute_rig_1() -> StudyResult:
    """Compute the branches of periodic motions, and sweeps with rising and falling speed."""
    columns = branch_columns(motions("A").branches[0], "spring A")
    for name, branch in zip(NAMES, motions("B").branches + resonant_b().branches):
        columns |= branch_columns(branch, f"spring B; {name}")
    for name, rising in (("rising speed", True), ("falling speed", False)):
        found = sweep_speed("B", rising)
        columns[f"speed; {name} [rpm]"] = found.speed / RAD_S_PER_RPM
        columns[f"amplitude; {name} [cm]"] = CM_PER_METRE * found.amplitude.filled(np.nan)
    special = special_points()
    columns[f"speed; {SPECIAL} [rpm]"] = np.array([s.parameter for s in special]) / RAD_S_PER_RPM
    columns[f"amplitude; {SPECIAL} [cm]"] = CM_PER_METRE * np.array([s.orbit.amplitude for s in special])
    stopped = {s: amplitude(turn(s, float(STOPPED[s]))) for s in "AB"}
    accommodated = {s: accommodated_amplitude(s) for s in "AB"}
    at, most = accommodated["B"]
    return StudyResult(
        claim="With spring A there is one motion at each speed. With spring B the resonance curve leans towards lower "
        "speeds, and from 917 to 1036 rpm two stable motions exist at the same speed.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "Due to practical difficulties, namely the large amplitudes of oscillations near the natural frequencies, "
                "resonance curves could not be obtained using this apparatus.",
                "8.4.1.2, L6543",
                "amplitude at the natural frequency, 580 and 1160 rpm (L6553), relative to the greatest amplitude that the "
                "guide did accommodate, at the lower speeds of the row at L6555",
                "at least 1: we read *large* as more than the guide did accommodate, since its length is not printed",
                *(at_least(f"spring {s}", 1.0, amplitude(turn(s, NATURAL[s])) / accommodated[s][1]) for s in "AB"),
            ),
            statement(
                "However when the speed was increased to 500 RPM with spring A and 800 RPM with spring B the amplitude of "
                "slider oscillations was so large that the slider guide could not accommodate it.",
                "8.4.1.2, L6555",
                "amplitude at this speed, relative to the greatest at lower speeds, which the guide did accommodate: every "
                "5 rpm from 240 rpm (spring A) and 500 rpm (spring B), the lowest speeds of the figures",
                "at least 1, since the guide can accommodate at least what it did accommodate",
                *(at_least(f"spring {s}, {STOPPED[s]} rpm", 1.0, stopped[s] / accommodated[s][1]) for s in "AB"),
                why=f"with spring B it is {stopped['B']:.2f} cm, but {most:.2f} cm at {at:.0f} rpm, which the rig passed: "
                "it ran at 540 and at 580 rpm (L6748)",
            ),
        ),
    )


def accommodated_amplitude(spring: str) -> tuple[float, float]:
    """Return the speed (rpm) and the size (cm) of the greatest amplitude below the speed at which the guide was too short.

    The speeds begin with the lowest of the figures, in steps of 5 rpm.
    """
    speeds = np.arange(FIRST[spring], float(STOPPED[spring]), 5.0).tolist()
    size, at = max((amplitude(turn(spring, w)), w) for w in speeds)
    return at, size


def draw_rig_1(result: StudyResult) -> Figure:
    """Draw the amplitude over the speed: spring A, spring B up to resonance, and spring B near resonance."""
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

#: Coefficients of the guide's friction in the plots.
COEFFICIENTS = (0.0, SLIGHT, 0.1, 0.15)
#: Speeds (rpm) of the figures where theory and experiment are compared, and speeds of the turns shown.
COMPARED = {"A": (390.0, 420.0, 450.0), "B": (600.0, 660.0, 720.0)}
SHOWN = {"A": 420.0, "B": 660.0}


def amplitude_decrease(coefficient: float) -> FloatArray:
    """Return the decrease of the amplitude (cm) by friction in the guide, with spring A at the speeds `COMPARED`."""
    return np.array(
        [
            amplitude(turn("A", w)) - amplitude(turn("A", w, slider_friction_coefficient=coefficient))
            for w in COMPARED["A"]
        ]
    )


def spread_beyond_constant(coefficient: float) -> float:
    """Return the variation of the amplitude's decrease with the speed, relative to constant friction.

    The variation is the greatest decrease divided by the least, with spring A at the speeds `COMPARED`; the result is the
    variation with friction by a coefficient, divided by the variation with constant friction. The constant friction
    is the coefficient times the mean of the guide's force over these turns without friction.
    """
    constant = coefficient * float(np.mean([np.abs(turn("A", w)["slider.guide_force"]).mean() for w in COMPARED["A"]]))
    even = [amplitude(turn("A", w)) - amplitude(turn("A", w, slider_coulomb_friction=constant)) for w in COMPARED["A"]]
    varying = amplitude_decrease(coefficient)
    return float(varying.max() / varying.min() * min(even) / max(even))


def slight_coefficients() -> tuple[float, float]:
    """Return the least and the greatest friction coefficient with a slight effect on the amplitude at the speeds `COMPARED`."""
    smooth = np.array([amplitude(turn("A", w)) for w in COMPARED["A"]])

    def beyond(coefficient: float, part: float) -> float:
        return float((amplitude_decrease(coefficient) / smooth).max()) - part

    ends = 0.5 * SLIGHT, 3.0 * SLIGHT
    least, most = (float(brentq(beyond, *ends, args=(part,), xtol=1e-6)) for part in (ALIKE, SLIGHTLY))
    return least, most


def lag(spring: str, speed: float, coefficient: float) -> float:
    """Return the delay (deg of crank angle) of the motion with friction behind the motion without it, by correlation."""
    rough, smooth = (slider(turn(spring, speed, slider_friction_coefficient=c))[:-1] for c in (coefficient, 0.0))
    together = np.fft.irfft(np.fft.rfft(rough - rough.mean()) * np.conj(np.fft.rfft(smooth - smooth.mean())))
    shift = 360.0 / len(rough) * int(np.argmax(together))
    return (shift + 180.0) % 360.0 - 180.0


def friction_force_ratios(speed: float, coefficient: float) -> FloatArray:
    """Return the ratio of the guide's friction to the damper's force, both as means and as maxima of a turn, with spring A."""
    steady = turn("A", speed, slider_friction_coefficient=coefficient)
    forces = (
        coefficient * np.abs(steady["slider.guide_force"]),
        rig("A").slider_damping * np.abs(steady["slider.velocity"]),
    )
    friction, viscous = (np.array([f.mean(), f.max()]) for f in forces)
    return np.asarray(friction / viscous)


def difference_from_constant(speed: float, coefficient: float) -> float:
    """Return the greatest difference of u with friction by a coefficient from u with constant friction, with spring A.

    The constant friction is the coefficient times the mean guide force over a turn without friction. The result is relative to
    the amplitude without friction.
    """
    mean = coefficient * float(np.abs(turn("A", speed)["slider.guide_force"]).mean())
    varying, even = (
        slider(turn("A", speed, **{name: value}))
        for name, value in (("slider_friction_coefficient", coefficient), ("slider_coulomb_friction", mean))
    )
    return float(np.abs(varying - even).max()) / amplitude(turn("A", speed))


def compute_friction() -> StudyResult:
    """Compute the amplitude over the speed with friction, and judge the statements on the amplitudes."""
    columns: dict[str, FloatArray] = {}
    for s in "AB":
        columns[f"speed; spring {s} [rpm]"] = GRID[s]
        for c in COEFFICIENTS:
            columns[f"amplitude; coefficient {c:g}; spring {s} [cm]"] = friction_amplitudes(s, c)
            columns[f"u; coefficient {c:g}; spring {s} [cm]"] = slider(turn(s, SHOWN[s], slider_friction_coefficient=c))
    columns["crank angle [deg]"] = np.linspace(0.0, 360.0, len(slider(turn("A", SHOWN["A"]))))
    ends = slight_coefficients()
    return StudyResult(
        claim="Friction in proportion to the guide's force lowers the amplitude slightly and hardly shifts the motion.",
        assignment="The text gives no coefficient and no measured amplitude. With spring A at 390, 420 and 450 rpm, "
        f"coefficients of {ends[0]:.3f} to {ends[1]:.3f} reduce the amplitude by {100.0 * ALIKE:g} to {100.0 * SLIGHTLY:g} %, "
        "a slight variation, at the speed at which they reduce it most. Each case takes that end of this range and that speed "
        "which are least favourable to the sentence.",
        columns=pad_columns(columns),
        statements=tuple(_friction(ends)),
    )


def _friction(ends: tuple[float, float]) -> Iterator[Statement]:
    """Judge the statements on the amplitudes, given the least and the greatest coefficient whose effect is slight."""
    each = [(w, c) for w in COMPARED["A"] for c in ends]
    force = {w: turn("A", w)["slider.guide_force"] for w in COMPARED["A"]}
    greatest = {w: np.abs(f).max() for w, f in force.items()}
    apart = max(np.abs(f - turn("A", w)["pin.D.fy"]).max() / greatest[w] for w, f in force.items())
    # by coefficient, then by measure
    rubbed = np.array([np.max([friction_force_ratios(w, c) for w in COMPARED["A"]], axis=0) for c in ends])
    yield statement(
        "[That the phase is almost in total agreement while the amplitude shows slight variations] may be explained by "
        "the fact that the frictional forces opposing the slider motion are considered solely viscous in the theory.",
        "8.4.1.1, L6486",
        "delay in crank angle, to 0.25 deg, at which the motion with friction in the guide agrees best with the motion "
        "without it",
        f"{ABOUT_DEG:g} deg, the rule for *almost*",
        at_most("shift", ABOUT_DEG, max(abs(lag("A", w, c)) for w, c in each), "deg"),
        why="the amplitude varies slightly by our choice of the coefficients",
    )
    yield statement(
        "However in practice these frictional forces are a combination of viscous and Coloumb friction forces, "
        "although in this experiment the viscous forces are dominant.",
        "8.4.1.1, L6490",
        "Coulomb friction in the guide divided by the damper's force, for the mean and for the greatest force in a turn",
        "at most 1, since the *dominant* force is the greater",
        at_most("mean force", 1.0, rubbed[:, 0].max()),
        unjudged(
            "greatest force",
            f"the ratio of the greatest forces is {rubbed[0, 1]:.2f} to {rubbed[1, 1]:.2f} within the range of coefficients",
        ),
        why="that Coulomb friction exists is taken as given",
    )
    yield statement(
        "Because a Coloumb friction force varies with the normal force and since in this experiment this normal "
        "force, which is the vertical force in the rocker-slider joint, varies with crank speed and also within a "
        "crank cycle, this explains the difference in amplitude between the theoretical and experimental motions "
        "with variation of crank speed and also within one crank cycle.",
        "8.4.1.1, L6496",
        "for the guide's force: the greatest relative to the mean in a turn; the greatest at 450 rpm relative to that "
        "at 390 rpm; its greatest difference from the vertical force in the joint, relative to the greatest. For "
        "friction: the decrease of the amplitude in cm, the greatest of the three speeds relative to the least, divided "
        "by the same ratio with one constant friction (the mean of the three); then the greatest difference of u from u "
        "with constant friction of the same mean, relative to the amplitude",
        f"the rule for *the same*: ratios that are seen exceed {1.0 + ALIKE:g}, differences that are seen exceed "
        f"{ALIKE:g}, and the force differs from the joint's by at most {ALIKE:g}",
        at_least("force, within a cycle", 1.0 + ALIKE, min(f / np.abs(force[w]).mean() for w, f in greatest.items())),
        at_least("force, with the speed", 1.0 + ALIKE, greatest[450.0] / greatest[390.0]),
        at_most("force, from the joint's", ALIKE, apart, why="the slider's weight is added to the joint's force"),
        at_least(
            "decrease, with the speed",
            1.0 + ALIKE,
            min(map(spread_beyond_constant, ends)),
            why="with a constant friction the decrease varies as much",
        ),
        at_least("difference, within a cycle", ALIKE, min(difference_from_constant(w, c) for w, c in each)),
    )
    yield statement(
        "Other factors contributing to the difference are (a) only an average estimation of the damping coefficient is "
        "considered in the theory and (b) the friction in the pin joints of the linkage is also ignored in the theory.",
        "8.4.1.1, L6508",
        why="neither the scatter of the coefficient, nor a size of the bearings, nor the sign of the difference is given",
    )
    yield statement(
        "The differences may be attributed to the same factors as previously described with spring A.",
        "8.4.1.1, L6528",
        why="the measured curves are lost, and no size of the factors is given",
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
    "rig-1-resonance": Study(compute_rig_1, draw_rig_1),
    "rig-1-friction": Study(compute_friction, draw_friction),
}
