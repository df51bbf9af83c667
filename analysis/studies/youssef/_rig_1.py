"""What Fig 8.7 to 8.17 share: the steady motion of rig 1 over the crank speed.

The curves over the speed are those of the periodic orbits, by continuation. The steady turns of Fig 8.7 to 8.13 are run to
from rest for eight seconds, which makes them a check of the orbits: the damper alone would bring a deviation down by exp(-46)
in that time. It takes longest with spring A at 1050 rpm, where the periodic effective mass comes near to unsettling the
motion. How much the last two turns differ goes with every result.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from linkwork.five_bar.published import RAD_S_PER_RPM

from ...figures import Figure, Panel, plot_curves
from ...periodic import Response, natural_frequency
from ..study import ASSIGNED, OURS, StudyResult, Verdict, at_most, curves_of
from ._orbits import COARSE, FINE, between, response
from ._runs import rig_1, steady_turn

#: Speeds of the curves (rpm).
SLOWEST, FASTEST = 100.0, 1200.0
#: With spring B the curve is followed in two parts (rpm): up to the lower, and about resonance from there on. Below 900 rpm the
#: branches that come down from resonance run into the limit of assembly.
SPLIT, FASTEST_B = 900.0, 1300.0
#: Change from turn to turn (cm) up to which a motion counts as steady.
STEADY = 1e-4


def natural_speed(spring: str) -> float:
    """Crank speed at the slider's natural frequency with the mean effective mass (rpm)."""
    return natural_frequency(rig_1(spring)) / RAD_S_PER_RPM


def slow(spring: str, friction: float = 0.0) -> Response:
    """Periodic motions with spring ``a`` over all speeds, with ``b`` up to `SPLIT`; friction in N."""
    step = COARSE if friction else FINE
    return response(rig_1(spring, friction), SLOWEST, FASTEST if spring == "a" else SPLIT, step)


def resonant_b() -> Response:
    """Periodic motions with spring B about resonance: the lower branch first, then the upper one."""
    return response(rig_1("b"), SPLIT, FASTEST_B, COARSE)


def local_maximum(spring: str) -> float:
    """Speed of the greatest amplitude about half the natural frequency (rpm)."""
    half = 0.5 * natural_speed(spring)
    return between(slow(spring).maxima(), 0.9 * half, 1.1 * half)[0]


@cache
def speed_of_fewer_peaks(spring: str, low: float, high: float) -> float:
    """Speed above which the slider has two peaks a turn instead of four (rpm), to 0.1 rpm."""
    while high - low > 0.1:
        middle = 0.5 * (low + high)
        if steady_turn(rig_1(spring), middle).peaks > 2:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def turns_result(number: str, claim: str, spring: str, speeds: Sequence[float], *verdicts: Verdict) -> StudyResult:
    """The steady turns at several speeds (rpm) as the result of a study."""
    turns = {speed: steady_turn(rig_1(spring), float(speed)) for speed in speeds}
    columns = {"crank angle [deg]": next(iter(turns.values())).angle_deg}
    columns |= {f"slider position u at {speed:g} rpm [cm]": turn.slider_cm for speed, turn in turns.items()}
    change = max(turn.change for turn in turns.values())
    steady = at_most("change of u from one turn to the next", OURS, STEADY, change, "cm")
    return StudyResult(
        number=number,
        claim=claim,
        assignment=ASSIGNED,
        columns=columns,
        verdicts=(*verdicts, steady),
    )


def draw_turns(result: StudyResult) -> Figure:
    """The turns over the crank angle."""
    names = {name: name.split(" at ")[1].split(" [")[0] for name in result.columns if " at " in name}
    panel = Panel(
        x_label="crank angle [deg]",
        y_label="slider position u [cm]",
        curves=curves_of(result, "crank angle [deg]", names),
        legend_at="outside",
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 45),
    )
    return plot_curves([panel], title=result.heading)
