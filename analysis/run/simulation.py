"""Run a mechanism in process: `simulate`, and the sample times and settings of runs."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, ulp
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, ParameterError
from linkwork.plant import check_tolerance

from ..files import limit, unknown_name
from ..mechanisms import InitialState, Parameters
from ..units import Amount, in_si, quantity
from .arguments import (
    complete_initial_state,
    complete_inputs,
    require_kind,
    takes_options,
    takes_published,
    usual_times,
)
from .events import Event
from .inputs import Inputs
from .prepared import Run, Settings
from .trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

#: Default of the largest number of steps of a run.
MOST_STEPS = 100_000_000
#: Default of the largest number of samples of a run: a larger one probably comes from a wrong unit and fills the memory.
_SAMPLES = 20_000_000
_TIME = "a number of seconds, or a text with its unit"
SCIPY_METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")


@in_si(stop_time="s", step="s", start_time="s")
def sample_times(stop_time: Amount, step: Amount, start_time: Amount = 0.0) -> NDArray[np.float64]:
    """Return the times from start to stop (s), each computed as start + k step; the last is the stop time.

    The last step is shorter if the run is not a whole number of steps long.

    Raises
    ------
    InputError
        If a time is not a number, the step is not positive, or the run does not end after it starts.
    """
    for name, value in (("step", step), ("stop_time", stop_time), ("start_time", start_time)):
        require_kind(value, Real, name, _TIME)
    if not (isfinite(step) and step > 0.0):
        raise InputError(f"step is {step} s: it must be a finite number greater than zero")
    if not (isfinite(stop_time) and isfinite(start_time) and stop_time > start_time):
        raise InputError(f"a run from {start_time} s to {stop_time} s: it must end after it starts")
    ratio = (stop_time - start_time) / step
    if not ratio <= (most := limit("SAMPLES", _SAMPLES)):
        raise InputError(
            f"a run from {start_time} s to {stop_time} s in steps of {step} s has {ratio:.3g} samples: at most {most} are "
            "allowed, unless the environment variable LINKWORK_MAX_SAMPLES is greater"
        )
    apart = ulp(max(abs(start_time), abs(stop_time)))
    if step < 2.0 * apart:
        raise InputError(
            f"step is {step} s, but floating-point times near {stop_time:g} s are {apart:.3g} s apart: it must be at least "
            "twice that"
        )
    whole = round(ratio)
    # a remainder larger than rounding errors (at late times, those of the times themselves) makes a last, shorter step
    count = whole if whole > 0 and abs(ratio - whole) <= max(1e-6, apart / step) else int(ratio) + 1
    times: NDArray[np.float64] = start_time + step * np.arange(count + 1, dtype=float)
    times[-1] = stop_time
    return times


class RunOptions(TypedDict, total=False):
    """Less common options of runs."""

    start_time: Amount
    max_steps: int
    progress: bool


class SolverOptions(RunOptions, total=False):
    """Options of runs, and further options of SciPy's methods."""

    first_step: float | None
    max_step: float
    min_step: float
    jac: Any
    jac_sparsity: Any
    lband: int | None
    uband: int | None
    vectorized: bool


@takes_published(inputs=complete_inputs, initial=complete_initial_state)
@takes_options(SolverOptions)
@in_si(stop_time="s", step="s", start_time="s", samples="s", hold="s")
def simulate(
    parameters: Parameters,
    inputs: Inputs | None = None,
    *,
    initial: InitialState | None = None,
    stop_time: Amount = None,
    step: Amount = None,
    samples: ArrayLike | None = None,
    hold: Amount = None,
    method: str | type[OdeSolver] = "compiled",
    tolerance: float = 1e-9,
    events: Sequence[Event] = (),
    **options: Unpack[SolverOptions],
) -> Trajectory:
    """Run a mechanism in process.

    Parameters
    ----------
    parameters
        Parameters of a mechanism, such as FiveBarParameters or SliderCrankParameters; or a published set or its name, such as
        "table-3.1". A published set also gives the initial state, and the crank speed unless the inputs drive the crank. See
        also `variant`.
    inputs : Inputs
        What acts on the mechanism; by default nothing: a crank is free, the slider-crank's shift is held, and a coordinate
        of a described linkage is held at rest if the file gives a speed for it. With a published set a coordinate has the
        speed of the set; ``torque=0.0`` frees the crank.
    initial
        Initial state of the mechanism, or a mapping such as {"crank_speed": "420 rpm"}; by default at rest with all
        coordinates zero. Commanded speeds replace the rates in it.
    stop_time : float or str, optional
        End of the run, in s or as text with its unit, such as "0.5 s", like all times. By default three revolutions, if
        the crank has a constant speed.
    step : float or str, optional
        Time between recorded samples: by default 1 ms, or without ``stop_time`` 1/360 of a revolution.
    samples : array_like, shape (n,), optional
        Times to record (s) in place of ``step``, increasing; the run starts at the first and ends at the last.
    hold : float or str, optional
        Sample and hold the inputs at multiples of this step (s), as a co-simulation master does; a commanded speed then
        changes linearly between two samples. It must be the step of the recorded times.
    method : str or OdeSolver class
        ``compiled`` (DOP853 under Numba, the default), ``balanced`` (the same, but after each step the rates are scaled to
        restore the energy balance, for long runs without commanded speeds), one of SciPy's (``RK23 RK45 DOP853 Radau BDF
        LSODA``), ``Hamming`` (the thesis's predictor-corrector), or a class of your own.
    tolerance : float
        Bound of the local error, relative to the state and the size of the mechanism.
    events : sequence of Event

    Other Parameters
    ----------------
    start_time : float or str
        Start of the run; 0 by default.
    max_steps : int
        Number of steps after which a compiled run ends with solver.status 4; 1e8 by default. A stiff run ends already after
        1e6 steps if it would need more than a tenth of ``max_steps``.
    progress : bool
        Show a progress bar.
    first_step, max_step, min_step, jac, jac_sparsity, lband, uband, vectorized
        Options of SciPy's ``solve_ivp``, if the method has them. A class of your own may have other options.

    Returns
    -------
    Trajectory
        A run that reaches the limit of assembly, or whose step size underflows, ends there with a status, a message and all
        data up to that time.

    Raises
    ------
    ParameterError, InputError, AssemblyError
        If parameters or inputs are not usable, or the links cannot be joined at the start. If an input is not a finite number
        later in the run, the message names the input and the time.
    RunInterrupted
        On Ctrl-C; the error has the results so far.

    Examples
    --------
    >>> from analysis import Inputs, simulate
    >>> run = simulate("table-3.1")
    >>> print(f"{1e3 * run['slider.position'].min():.2f} mm at {len(run)} samples up to {run.time[-1]:.3f} s")
    -10.71 mm at 1081 samples up to 0.429 s
    >>> simulate("table-3.1", Inputs(torque="2 N.m"), stop_time="20 ms", step="1 ms")["crank.speed"].shape
    (21,)
    """
    start_time, progress = options.pop("start_time", 0.0), options.pop("progress", False)
    if samples is None:
        times = sample_times(*usual_times(parameters, inputs, stop_time, step), start_time)
    else:
        times = _check_samples(np.asarray(samples, float))
    settings = check_settings(times, hold, tolerance, options.pop("max_steps", MOST_STEPS))
    run = Run(parameters, inputs, initial, settings, tuple(events))
    if method in ("compiled", "balanced"):
        if options:
            raise InputError(f"the {method} method takes no options, but was given {', '.join(options)}")
        return run.solve_compiled(progress, method == "balanced")
    if method == "Hamming":
        from .hamming import Hamming

        method = Hamming
    elif isinstance(method, str) and method not in SCIPY_METHODS:
        raise unknown_name(method, ("compiled", "balanced", "Hamming", *SCIPY_METHODS), f"method {method!r}")
    from .march import solve

    return solve(run, method, dict(options), progress)


def check_settings(times: NDArray[np.float64], hold: float | None, tolerance: float, max_steps: Any) -> Settings:
    """Check the settings of a run and return them as `Settings`.

    Raises
    ------
    ParameterError, InputError
        If a setting is not usable.
    """
    tolerance = quantity(tolerance, "1", "solver.tolerance")
    check_tolerance(tolerance)
    if hold is not None:
        require_kind(hold, Real, "hold", _TIME)
        grid = times[0] + hold * np.arange(len(times))
        if not hold > 0.0 or np.any(np.abs(grid[:-1] - times[:-1]) > 1e-9 * max(hold, 1e-3 * abs(times[-1]))):
            raise InputError(f"inputs are held over {hold} s: the recorded times must be {hold} s apart")
    if isinstance(max_steps, bool) or not isinstance(max_steps, Integral) or max_steps < 1:
        raise ParameterError("max_steps", max_steps, "be a whole number, at least 1")
    return Settings(times=times, hold=hold or 0.0, tolerance=tolerance, max_steps=int(max_steps))


def _check_samples(times: NDArray[np.float64]) -> NDArray[np.float64]:
    # increasing numbers between finite ends are finite
    increasing = times.ndim == 1 and len(times) > 1 and (times[1:] > times[:-1]).all()
    if not (increasing and isfinite(times[0]) and isfinite(times[-1])):
        raise InputError("the recorded times must be at least two finite numbers, increasing")
    return np.ascontiguousarray(times)
