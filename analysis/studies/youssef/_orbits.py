"""What Fig 8.14 to 8.21 share: the periodic motions of a rig over the speed, in rpm and cm.

The amplitude is half the distance between the least and the greatest slider position over a period.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM

from ...figures import Curve
from ...periodic import Branch, Extremum, PeriodicOrbit, Response, Stability, find_orbit, frequency_response
from ..study import OURS, StudyResult, Verdict, at_most
from ._runs import SETTLING_TIME, steady_turn

#: Difference (cm) up to which a run and an orbit, or two sweeps, count as the same motion.
SAME = 1e-4
#: Harmonics shown.
ORDERS = (1, 2, 3)


#: Greatest steps of the continuation: a two hundredth of the range of speeds, so that the resonance of the third harmonic
#: is not stepped over; and a fiftieth, where resonance itself or friction makes for shorter steps.
FINE, COARSE = 5e-3, 2e-2


@cache
def response(parameters: FiveBarParameters, low: float, high: float, greatest_step: float = FINE) -> Response:
    """The periodic motions over a range of speeds (rpm), no branch of it lost."""
    found = frequency_response(parameters, low * RAD_S_PER_RPM, high * RAD_S_PER_RPM, greatest_step=greatest_step)
    assert not found.problems, found.problems
    return found


def orbit(parameters: FiveBarParameters, speed: float, start: NDArray[np.float64] | None = None) -> PeriodicOrbit:
    """The periodic motion at a speed (rpm), the one near a start if one is given."""
    return find_orbit(parameters, speed=speed * RAD_S_PER_RPM, start=start)


def rpm(branch: Branch) -> NDArray[np.float64]:
    """Speeds along a branch (rpm)."""
    return branch.parameter / RAD_S_PER_RPM


def between(extrema: Sequence[Extremum], low: float, high: float) -> tuple[float, float]:
    """Speed (rpm) and amplitude (cm) of the one extremum between two speeds (rpm)."""
    (found,) = (e for e in extrema if low < e.parameter / RAD_S_PER_RPM < high)
    return found.parameter / RAD_S_PER_RPM, CM_PER_METRE * found.amplitude


def columns_of(branch: Branch, name: str) -> dict[str, NDArray[np.float64]]:
    """Amplitude along a branch as columns, its stable and, if it has one, its unstable part; see `curves_over_speed`."""
    amplitude = CM_PER_METRE * branch.amplitude
    stable = np.array([verdict is Stability.STABLE for verdict in branch.stability()])
    # a dashed part begins and ends on the solid one
    beside = np.append(stable[1:], True) & np.append(True, stable[:-1])
    columns = {f"speed; {name} [rpm]": rpm(branch), f"stable; {name} [cm]": np.where(stable, amplitude, np.nan)}
    if not stable.all():
        columns[f"unstable; {name} [cm]"] = np.where(~stable | ~beside, amplitude, np.nan)
    return columns


def curves_over_speed(result: StudyResult, name: str, colour: str, label: str = "") -> list[Curve]:
    """Amplitude along a branch, its stable part solid and its unstable one dashed."""
    speed = result.columns[f"speed; {name} [rpm]"]
    curves = [Curve(x=speed, y=result.columns[f"stable; {name} [cm]"], label=label, colour=colour)]
    if f"unstable; {name} [cm]" in result.columns:
        curves.append(Curve(x=speed, y=result.columns[f"unstable; {name} [cm]"], line="--", colour=colour))
    return curves


def highest(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Place of the greatest of samples, by the parabola through it and its neighbours."""
    i = int(np.clip(np.argmax(y), 1, len(y) - 2))
    before, after = np.diff(y[i - 1 : i + 2]) / np.diff(x[i - 1 : i + 2])
    return float(0.5 * (x[i - 1] + x[i]) - 0.5 * before * (x[i + 1] - x[i - 1]) / (after - before))


def disturbed_verdict(found: PeriodicOrbit, factor: float, name: str) -> Verdict:
    """That a run begun at an orbit's start times a factor comes back to it."""
    u, v = (factor * found.start).tolist()
    assert found.drive.speed is not None
    run = steady_turn(found.parameters, found.drive.speed / RAD_S_PER_RPM, (u, v))
    difference = abs(CM_PER_METRE * found.amplitude - run.amplitude)
    return at_most(f"difference between an orbit and a run begun beside it; {name}", OURS, SAME, difference, "cm")


def runs_verdict(parameters: FiveBarParameters, speeds: Sequence[float]) -> Verdict:
    """That runs from rest at u = 0 end in the orbits, at a few speeds (rpm)."""
    differences = [
        abs(CM_PER_METRE * orbit(parameters, speed).amplitude - steady_turn(parameters, speed).amplitude)
        for speed in speeds
    ]
    return at_most(
        f"difference between orbits and runs of {SETTLING_TIME:g} s from rest at "
        f"{', '.join(f'{speed:g}' for speed in speeds)} rpm",
        OURS,
        SAME,
        max(differences),
        "cm",
    )


def multiplier_verdict(found: Response) -> Verdict:
    """That small deviations die out at every speed."""
    largest = max(float(branch.largest_multiplier.max()) for branch in found.branches)
    return at_most("largest Floquet multiplier over all speeds", OURS, 1.0, largest)
