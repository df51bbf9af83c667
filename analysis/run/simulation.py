"""The in-process solver: runs of a mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError
from linkwork.plant import check_tolerance

from ..mechanisms import InitialState, Parameters
from .events import Event
from .inputs import Inputs
from .prepared import Run, Settings
from .trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

SCIPY_METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")


def sample_times(stop_time: float, step: float, start_time: float = 0.0) -> NDArray[np.float64]:
    """Times start, start + step, ... up to and including the stop time, each computed as start + k step.

    The last step is shorter where the run is not a whole number of steps long.

    Raises
    ------
    InputError
        If the step is not positive, or the run does not end after it starts.
    """
    if not (isfinite(step) and step > 0.0):
        raise InputError(f"step is {step} s: it must be a finite number greater than zero")
    if not (isfinite(stop_time) and isfinite(start_time) and stop_time > start_time):
        raise InputError(f"a run from {start_time} s to {stop_time} s: it must end after it starts")
    ratio = (stop_time - start_time) / step
    whole = round(ratio)
    # what is left over, but for rounding, makes a last, shorter step
    count = whole if whole > 0 and abs(ratio - whole) <= 1e-6 else int(ratio) + 1
    times: NDArray[np.float64] = start_time + step * np.arange(count + 1, dtype=float)
    times[-1] = stop_time
    return times


def simulate(
    parameters: Parameters,
    inputs: Inputs | None = None,
    *,
    initial: InitialState | None = None,
    stop_time: float,
    step: float = 1e-3,
    start_time: float = 0.0,
    samples: ArrayLike | None = None,
    hold: float | None = None,
    method: str | type[OdeSolver] = "compiled",
    tolerance: float = 1e-9,
    events: Sequence[Event] = (),
    max_steps: int = 100_000_000,
    progress: bool = False,
    **options: Any,
) -> Trajectory:
    """Run a mechanism in process.

    Parameters
    ----------
    parameters
        Of a mechanism, such as FiveBarParameters or SliderCrankParameters.
    inputs : Inputs
        What acts on it; by default nothing does (torque drive without torque, and the slider-crank's shift held).
    initial
        That of the mechanism; by default at rest with all coordinates zero. Commanded speeds take the place of the rates.
    stop_time, start_time : float
        End and start of the run (s).
    step : float
        Distance of the recorded samples (s).
    samples : array_like, shape (n,), optional
        Times to record instead (s), increasing; the first is the start of the run, the last its end.
    hold : float, optional
        Sample and hold the inputs at multiples of this step (s), as a co-simulation master does; the crank speed then
        goes along the secant between two samples. Must be the sampling step of the recorded times.
    method : str or OdeSolver class
        ``compiled`` (DOP853 under Numba, the default), one of SciPy's (``RK23 RK45 DOP853 Radau BDF LSODA``), ``Hamming``
        (the thesis's predictor-corrector), or a class of your own.
    tolerance : float
        Bound of the local error relative to state and size of the mechanism.
    events : sequence of Event
    max_steps : int
        Steps after which a compiled run ends with solver.status 4.
    progress : bool
        Show a progress bar.
    **options
        Passed on to SciPy's ``solve_ivp``.

    Returns
    -------
    Trajectory
        A run that reaches the limit of assembly, or whose step size underflows, ends there with a status, a message and
        all data up to it.

    Raises
    ------
    ParameterError, InputError, AssemblyError
        If parameters or inputs are not usable, or the links cannot be joined at the start. An input that turns out not to
        be a finite number in the course of the run is named with the time.
    RunInterrupted
        On Ctrl-C; carries what was computed.
    """
    times = sample_times(stop_time, step, start_time) if samples is None else np.asarray(samples, float)
    run = Run(parameters, inputs, initial, settings_of(times, hold, tolerance, max_steps), tuple(events))
    if method == "compiled":
        if options:
            raise InputError(f"the compiled method takes no options, but was given {', '.join(options)}")
        return run.compiled(progress)
    from .march import solve

    return solve(run, _solver(method), options, progress)


def settings_of(times: NDArray[np.float64], hold: float | None, tolerance: float, max_steps: int) -> Settings:
    """Settings of a run, checked.

    Raises
    ------
    ParameterError, InputError
    """
    check_tolerance(tolerance)
    times = _check_samples(times)
    if hold is not None:
        _check_hold(hold, times)
    if max_steps < 1:
        raise InputError(f"max_steps is {max_steps}: it must be at least 1")
    return Settings(times=times, hold=hold or 0.0, tolerance=tolerance, max_steps=max_steps)


def _solver(method: str | type[OdeSolver]) -> str | type[OdeSolver]:
    if isinstance(method, str):
        if method == "Hamming":
            from .hamming import Hamming

            return Hamming
        if method not in SCIPY_METHODS:
            raise InputError(
                f"method is {method!r}: it must be 'compiled', 'Hamming' or one of {', '.join(SCIPY_METHODS)}"
            )
    return method


def _check_samples(times: NDArray[np.float64]) -> NDArray[np.float64]:
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise InputError("the recorded times must be at least two finite numbers, increasing")
    return np.ascontiguousarray(times)


def _check_hold(hold: float, times: NDArray[np.float64]) -> None:
    grid = times[0] + hold * np.arange(len(times))
    if not hold > 0.0 or np.any(np.abs(grid[:-1] - times[:-1]) > 1e-9 * max(hold, 1e-3 * abs(times[-1]))):
        raise InputError(f"inputs held over {hold} s: the recorded times must be the same multiples of it")
