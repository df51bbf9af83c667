"""The two rigs of chapter VIII and their periodic motions over the speed, in rpm and cm.

Rig 1, with spring A or B, lies in a vertical plane. Rig 2, with spring C or D, lies in a horizontal plane, and its crank
is a twentieth of the other links. The amplitude is half the range of the slider position over a period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SETS

from ...figures import Curve
from ...periodic import (
    Branch,
    Extremum,
    PeriodicOrbit,
    Response,
    Stability,
    Turn,
    find_orbit,
    frequency_response,
    mean_effective_mass,
    natural_frequency,
)
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ALIKE
from ..statements import FloatArray
from ..study import StudyResult
from ..variation import cache, vary

LOST = "the measured curves are lost with the figures"
#: Relative rise of the amplitude up to which no one notices it on a graph.
NOTICED = ALIKE
SEEN_IN_RECORDS = f"{NOTICED:g}, the rule for *the same*, since neighbouring records are compared"
#: Coefficient of friction in the guide that reduces the amplitude slightly.
SLIGHT = 0.05
#: The rig of each spring.
RIG = {"A": 1, "B": 1, "C": 2, "D": 2}
#: Speeds of the curves (rpm). With spring B the curve is followed in two parts: up to `SPLIT`, and near resonance from there
#: on; below it the branches that come down from resonance run into the limit of assembly.
SLOWEST, SPLIT = 100.0, 900.0
FASTEST = {"A": 1200.0, "B": 1300.0, "C": 1300.0, "D": 1300.0}
#: Speeds (rpm) of the study of friction in the guide of rig 1.
GRID = {"A": np.arange(150.0, 521.0, 5.0), "B": np.arange(250.0, 821.0, 5.0)}
#: Half a unit of the last digit of the printed stiffness (N/m): 3, 11, 4 and 8 times 10^6 dyn/cm.
HALF_DIGIT = 500.0
#: Number of samples in a turn.
SAMPLES = 1440
#: Greatest steps of the continuation relative to the range of speeds: fine enough to resolve the resonance of the third
#: harmonic, and coarse where the resonance itself shortens the steps.
FINE, COARSE = 5e-3, 2e-2


@cache
def rig(spring: str, **changes: float) -> FiveBarParameters:
    """Return the parameters of the rig with a spring; ``changes`` are made after the reader's changes."""
    parameters: FiveBarParameters = replace(
        vary(SETS[f"rig-{RIG[spring]}-spring-{spring.lower()}"].parameters), **changes
    )
    return parameters


def natural_speed(spring: str, **changes: float) -> float:
    """Return the crank speed at the slider's natural frequency with the mean effective mass (rpm), with changes of the rig."""
    return natural_frequency(rig(spring, **changes)) / RAD_S_PER_RPM


def stiffness_range(spring: str) -> tuple[float, float]:
    """Return the least and the greatest stiffness (N/m) that rounds to the printed one."""
    printed = rig(spring).slider_stiffness
    return printed - HALF_DIGIT, printed + HALF_DIGIT


@cache
def response(spring: str, low: float, high: float, greatest_step: float = FINE, **changes: float) -> Response:
    """Return the periodic motions over a range of speeds (rpm), with changes of the rig; fail if a branch is lost."""
    found = frequency_response(
        rig(spring, **changes), low * RAD_S_PER_RPM, high * RAD_S_PER_RPM, greatest_step=greatest_step
    )
    assert not found.problems, found.problems
    return found


def motions(spring: str) -> Response:
    """Return the periodic motions over all speeds, with spring B up to `SPLIT`."""
    return response(spring, SLOWEST, SPLIT if spring == "B" else FASTEST[spring])


def resonant_b() -> Response:
    """Return the periodic motions with spring B near resonance: first the lower branch, then the upper branch."""
    return response("B", SPLIT, FASTEST["B"], COARSE)


def orbit(parameters: FiveBarParameters, speed: float, start: FloatArray | None = None) -> PeriodicOrbit:
    """Find the periodic motion at a speed (rpm), near the state ``start`` if it is given."""
    return find_orbit(parameters, speed=speed * RAD_S_PER_RPM, start=start)


@cache
def turn(spring: str, speed: float, **changes: float) -> Turn:
    """Return one turn of the steady motion at a speed (rpm), with changes of the rig's parameters."""
    # the motion with friction is found from the one without: a run from rest would take minutes
    start = orbit(rig(spring), speed).start if changes else None
    return orbit(rig(spring, **changes), speed, start).turn(SAMPLES)


def slider(motion: Turn) -> FloatArray:
    """Return the slider position over a turn (cm), with its first value repeated at the end."""
    u = CM_PER_METRE * motion["slider.position"]
    return np.append(u, u[0])


def complex_stiffness(p: FiveBarParameters, rates: FloatArray) -> NDArray[np.complex128]:
    """Return the complex dynamic stiffness (N/m) of the mean effective mass on spring and damper at angular speeds (rad/s).

    It is the force divided by the displacement.
    """
    return np.asarray(p.slider_stiffness - mean_effective_mass(p) * rates**2 + 1j * p.slider_damping * rates)


def amplitude(motion: Turn) -> float:
    """Return the amplitude (cm): half the range of the slider position."""
    return CM_PER_METRE * motion.amplitude


def count_sign_changes(x: FloatArray) -> int:
    """Count the changes of sign of a periodic sequence."""
    return int(np.sum(np.sign(x) != np.sign(np.roll(x, 1))))


def peaks(motion: Turn) -> int:
    """Count the maxima and minima of the slider position over a turn, both together, as the thesis does."""
    return count_sign_changes(np.diff(slider(motion)))


def harmonic(motion: Turn, order: int) -> float:
    """Return the amplitude (cm) of a harmonic of the slider position; order 1 has one cycle per turn of the crank."""
    return CM_PER_METRE * float(motion.harmonic("slider.position", order))


@cache
def speed_of_fewer_peaks(spring: str, low: float, high: float) -> float:
    """Find the speed (rpm, to 0.01), between two limits, above which the slider has two extrema per turn instead of four."""
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if peaks(turn(spring, middle)) > 2 else (low, middle)
    return 0.5 * (low + high)


def rpm(branch: Branch) -> FloatArray:
    """Return the speeds along a branch (rpm)."""
    return branch.parameter / RAD_S_PER_RPM


def only_extremum(extrema: Sequence[Extremum], low: float, high: float) -> tuple[float, float]:
    """Return speed (rpm) and amplitude (cm) of the only extremum between two speeds (rpm)."""
    (found,) = (e for e in extrema if low < e.parameter / RAD_S_PER_RPM < high)
    return found.parameter / RAD_S_PER_RPM, CM_PER_METRE * found.amplitude


def maximum_near_fraction(spring: str, order: int) -> tuple[float, float]:
    """Return speed (rpm) and amplitude (cm) of the amplitude's maximum near 1/order of the natural frequency."""
    place = natural_speed(spring) / order
    return only_extremum(motions(spring).maxima(), 0.9 * place, 1.1 * place)


def extrema_near_half(spring: str, stiffness: float) -> tuple[float, float]:
    """Return the speeds (rpm) of the amplitude's maximum near half the natural frequency and of the minimum that follows.

    ``stiffness`` is the spring's stiffness (N/m).
    """
    place = 0.5 * natural_speed(spring, slider_stiffness=stiffness)
    found = response(spring, 0.9 * place, 1.4 * place, COARSE, slider_stiffness=stiffness)
    top, _ = only_extremum(found.maxima(), 0.9 * place, 1.1 * place)
    return top, only_extremum(found.minima(), top, 1.4 * place)[0]


def peak_rise(spring: str, order: int) -> float:
    """Return the amplitude's maximum near 1/order of the natural frequency divided by the minimum that follows, minus 1.

    The result is 0 without such a maximum.
    """
    place = natural_speed(spring) / order
    found = response(spring, 0.9 * place, 1.25 * place, COARSE)
    tops = [e for e in found.maxima() if e.parameter < 1.1 * place * RAD_S_PER_RPM]
    lows = [e for e in found.minima() if tops and e.parameter > tops[0].parameter]
    return tops[0].amplitude / lows[0].amplitude - 1.0 if lows else 0.0


def overtones(motion: Turn) -> float:
    """Return the greatest of the harmonics 3 to 6 divided by the greater of the harmonics 1 and 2."""
    first, second, *higher = (harmonic(motion, n) for n in range(1, 7))
    return max(higher) / max(first, second)


@cache
def friction_amplitudes(spring: str, coefficient: float) -> FloatArray:
    """Return the amplitude (cm) at the speeds of `GRID` with a coefficient of friction in the guide."""
    return follow_amplitude(spring, GRID[spring].tolist(), slider_friction_coefficient=coefficient)


def follow_amplitude(spring: str, speeds: Sequence[float], **changes: float) -> FloatArray:
    """Return the amplitude (cm) at each speed (rpm) with changes of the rig.

    Each motion is found from the motion at the previous speed.
    """
    parameters, start, found = rig(spring, **changes), orbit(rig(spring), speeds[0]).start, []
    for speed in speeds:
        motion = orbit(parameters, speed, start)
        start = motion.start
        found.append(CM_PER_METRE * motion.amplitude)
    return np.array(found)


def branch_columns(branch: Branch, name: str) -> dict[str, FloatArray]:
    """Return the amplitude along a branch as columns, with stable and unstable parts in separate columns.

    `curves_over_speed` turns these columns into curves.
    """
    amplitude = CM_PER_METRE * branch.amplitude
    stable = np.array([verdict is Stability.STABLE for verdict in branch.stability()])
    # a dashed part begins and ends on the solid one
    beside = np.append(stable[1:], True) & np.append(True, stable[:-1])
    columns = {f"speed; {name} [rpm]": rpm(branch), f"stable; {name} [cm]": np.where(stable, amplitude, np.nan)}
    if not stable.all():
        columns[f"unstable; {name} [cm]"] = np.where(~stable | ~beside, amplitude, np.nan)
    return columns


def curves_over_speed(result: StudyResult, name: str, colour: str, label: str = "") -> list[Curve]:
    """Return the amplitude along a branch as curves, its stable part solid and its unstable part dashed."""
    speed = result.columns[f"speed; {name} [rpm]"]
    curves = [Curve(x=speed, y=result.columns[f"stable; {name} [cm]"], label=label, colour=colour)]
    if f"unstable; {name} [cm]" in result.columns:
        curves.append(Curve(x=speed, y=result.columns[f"unstable; {name} [cm]"], line="--", colour=colour))
    return curves


def marks(spring: str, *orders: int) -> Mapping[str, float]:
    """Return marks for a panel, by label: the natural frequency of the rig with this spring, divided by each order (rpm)."""
    words = {1: "natural", 2: "half of it", 3: "a third", 4: "a quarter"}
    return {f"{words[n]}, {natural_speed(spring) / n:.0f} rpm": natural_speed(spring) / n for n in orders}


def largest_multiplier(spring: str, low: float, high: float) -> float:
    """Return the greatest modulus of the Floquet multipliers over a range of speeds (rpm), both ends included."""
    (branch,) = motions(spring).branches
    within = (rpm(branch) >= low) & (rpm(branch) <= high)
    ends = (orbit(rig(spring), speed).largest for speed in (low, high))
    return max(float(branch.largest_multiplier[within].max()), *ends)
