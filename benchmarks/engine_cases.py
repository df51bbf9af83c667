"""Define the runs of the five-bar slider for which solvers and engines are timed, and measure their accuracy.

Accuracy is the largest error of the slider position at the sample times, relative to the position's largest magnitude. The
reference is the solution of `linkwork`'s reduced equations at a tolerance of 1e-13.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from math import ceil, cos, inf, isfinite, pi, sin
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from analysis import Inputs, TorsionBar, Trajectory, simulate
from linkwork.five_bar import dynamics
from linkwork.five_bar.kinematics import coefficients, link_angles, position
from linkwork.five_bar.parameters import Constants, FiveBarParameters, InitialState
from linkwork.five_bar.published import DYN_CM_PER_NEWTON_METRE, SETS


@dataclass(frozen=True, kw_only=True)
class Case:
    """A run from th2 = u = u' = 0: parameters, drive, duration (s) and number of sample intervals.

    With ``crank_speed`` (rad/s) the crank turns at that constant speed. Without it the crank starts from rest under the torsion
    bar of fig. 3.6: T = torque (1 - th2/switch_angle) until th2 reaches ``switch_angle`` (rad), then T = 0.
    """

    name: str
    parameters: FiveBarParameters
    duration: float
    samples: int
    crank_speed: float | None = None
    torque: float = 0.0
    switch_angle: float = 1.0

    def __post_init__(self) -> None:
        if self.parameters.slider_coulomb_friction != 0.0:
            raise ValueError("the engine models have no Coulomb friction in the guide")

    @cached_property
    def times(self) -> np.ndarray:
        """Sample times (s), including the start."""
        return np.linspace(0.0, self.duration, self.samples + 1)

    @property
    def start_speed(self) -> float:
        """Crank speed at the start (rad/s)."""
        return self.crank_speed or 0.0

    @cached_property
    def inputs(self) -> Inputs:
        """Inputs of a run in process, the same for every run."""
        return Inputs(speed=self.crank_speed) if self.crank_speed else Inputs(torque=TorsionBar(torque=self.torque))


def step_count(interval: float, time_step: float) -> int:
    """Return the least number of equal steps in ``interval`` that are no longer than ``time_step`` (both in s)."""
    return max(1, ceil(interval / time_step * (1.0 - 1e-9)))


_TABLE_3_1 = SETS["table-3.1"]

#: Table 3.1 at 420 rpm for three turns, and under the torsion bar of fig. 3.6 with T0 = 1e8 dyn.cm; k = 1e6, mu = 3e4 (cgs).
CASES: tuple[Case, ...] = (
    Case(
        name="constant-speed",
        parameters=_TABLE_3_1.parameters,
        crank_speed=_TABLE_3_1.crank_speed,
        duration=3 * 2.0 * pi / _TABLE_3_1.crank_speed,
        samples=36,
    ),
    Case(
        name="torsion-bar",
        parameters=_TABLE_3_1.parameters,
        torque=1e8 / DYN_CM_PER_NEWTON_METRE,
        duration=0.5,
        samples=50,
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineRun:
    """Time and accuracy of a run in an engine.

    ``seconds`` is the processor time of the integration alone, ``error`` the largest error of u at the sample times relative to
    the largest magnitude of u (infinite if the engine failed), ``steps`` the number of time steps.
    """

    seconds: float
    error: float
    label: str
    steps: int


@cache
def reference(case: Case) -> np.ndarray:
    """Compute the slider position (m) at `Case.times`, from the reduced equations by DOP853 at rtol 1e-13."""
    result = run_scipy(case, "DOP853", 1e-13, 1e-15)
    result.setflags(write=False)
    return result


def run_in_process(case: Case, tolerance: float) -> Trajectory:
    """Run a case by the compiled solver."""
    start = InitialState(crank_speed=case.start_speed)
    return simulate(case.parameters, case.inputs, initial=start, samples=case.times, tolerance=tolerance)


def run_scipy(case: Case, method: str, rtol: float, atol: float | None = None) -> np.ndarray:
    """Compute the slider position (m) by `solve_ivp` on the reduced equations in plain Python; NaN if the method fails.

    Only the four mechanical states are integrated; the torque is switched off at an event. By default ``atol`` is ``rtol``
    times the magnitudes of the states.
    """
    length = case.parameters.crank_length
    scale = np.array([1.0, length, max(1.0, case.start_speed), length * 40.0])
    p = case.parameters.constants()
    speed_drive = 0.0 if case.crank_speed is None else 1.0

    def rate(_: float, x: np.ndarray, torque: float) -> tuple[float, ...]:
        th2, u, w2, v = x.tolist()
        applied = torque * (1.0 - th2 / case.switch_angle)
        inputs = dynamics.Inputs(speed_drive, applied, 0.0, 0.0, 0.0, 0.0)
        return dynamics.derivative((th2, u, w2, v, 0.0, 0.0), inputs, p)[:4]

    def switch(_: float, x: np.ndarray, torque: float) -> float:
        return x[0] - case.switch_angle

    switch.terminal = True  # type: ignore[attr-defined]
    times, start, torque = case.times, 0.0, case.torque
    x = np.array([0.0, 0.0, case.start_speed, 0.0])
    u = [0.0]
    while len(u) < times.size:
        events = switch if torque else None
        tolerances = {"rtol": rtol, "atol": rtol * scale if atol is None else atol}
        span, left = (start, case.duration), times[len(u) :]
        leg = solve_ivp(rate, span, x, method, t_eval=left, events=events, args=(torque,), **tolerances)
        u.extend(leg.y[1])
        if leg.status != 1:
            break
        start, x, torque = leg.t_events[0][0], leg.y_events[0][0], 0.0
    return np.array(u) if len(u) == times.size else np.full(times.size, np.nan)


def relative_error(case: Case, u: np.ndarray) -> float:
    """Return the largest |u - u_ref| on the sample grid divided by the largest |u_ref|; infinite if u is not finite."""
    expected = reference(case)
    error = float(np.max(np.abs(u - expected)) / np.max(np.abs(expected)))
    return error if isfinite(error) else inf


class Start(NamedTuple):
    """Angles (rad) and rates (rad/s) of coupler and rocker that close the loop at th2 = u = u' = 0."""

    th3: float
    th4: float
    w3: float
    w4: float


def start(case: Case, p: Constants) -> Start:
    """Return the angles and rates of coupler and rocker at the start of a case."""
    g = position(0.0, 0.0, p)
    k = coefficients(g, p)
    return Start(*link_angles(g, p), k.k32 * case.start_speed, k.k42 * case.start_speed)


def centre(distance: float, angle: float) -> tuple[float, float]:
    """Return the centre of mass (x, y) in the frame of its link (m), given its distance from the origin and its angle."""
    return distance * cos(angle), distance * sin(angle)
