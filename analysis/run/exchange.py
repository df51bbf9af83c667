"""Model exchange: integrate an FMU's derivatives with CVode of SUNDIALS, which is part of FMPy."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_int, c_void_p
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.sundials import CVodeSolver
from fmpy.sundials.cvode import sundials_cvode
from fmpy.sundials.nvector_serial import NV_DATA_S
from fmpy.sundials.sundials_types import sunrealtype
from numpy.typing import NDArray

from .fmu import FmuModel
from .inputs import Encoded
from .sampling import name_channels, release, sample

#: Largest number of CVode's steps between two samples.
MOST_STEPS = 100_000

#: Function of CVode that FMPy does not offer: sets a time, at which an input jumps, beyond which no step goes.
_set_stop_time = sundials_cvode.CVodeSetStopTime
_set_stop_time.argtypes = [c_void_p, sunrealtype]
_set_stop_time.restype = c_int

#: Return values of the functions that CVode calls.
_GOOD, _SHORTER_STEP, _NO_WAY = 0, 1, -1


class ExchangeError(Exception):
    """Error if CVode cannot continue the integration."""


class Exchange(CVodeSolver):  # type: ignore[misc]
    """An FMU in model exchange with its inputs, integrated by CVode.

    Between jumps the inputs, commanded rates and their derivatives included, are continuous functions of time and state. At a
    jump the FMU goes through event mode.

    Parameters
    ----------
    model : FmuModel
    encoded : Encoded
        The inputs.
    times : ndarray
        Times of the samples (s).
    tolerance : float
        CVode's relative tolerance; the absolute tolerance of a state is this times the nominal value of the state.
    """

    def __init__(self, model: FmuModel, encoded: Encoded, times: NDArray[np.float64], tolerance: float) -> None:
        self.model, self.encoded = model, encoded
        # CVode's time counts from the start: late times would be too coarse, by rounding, for its first steps
        self.origin = self.time = float(times[0])
        self.laws = encoded.source.laws.copy()
        # at the first and the last break nothing changes: the outer pieces extend beyond them
        breaks = encoded.source.breaks[1:-1]
        inside = breaks[(breaks > times[0]) & (breaks <= times[-1])]
        self.ends = [*inside.tolist(), np.inf]
        self.failure: Exception | None
        super().__init__(
            nx=model.states,
            # the release of a torsion bar is an event of the inputs
            nz=model.indicators + len(self.laws),
            get_x=lambda x, n: model.get_states(x),
            set_x=lambda x, n: None,
            get_dx=None,
            get_z=None,
            get_nominals=lambda x, n: model.get_nominals(x),
            set_time=None,
            input=None,
            startTime=0.0,
            relativeTolerance=tolerance,
            maxNumSteps=MOST_STEPS,
        )
        self.begin()

    @property
    def state(self) -> NDArray[np.float64]:
        """Return the states of the FMU at the present time, as CVode has them."""
        return self._array(self.px)

    def _array(self, x: Any) -> NDArray[np.float64]:
        return np.ctypeslib.as_array(x, (self.nx,))

    def inputs(self, t: float, x: NDArray[np.float64], left: bool = False) -> dict[str, float]:
        """Return all inputs by name, at a time and a state; where an input jumps, the limit from the left if ``left``."""
        return name_channels(self.encoded, sample(self.encoded, t, x, self.laws, left=left))

    def begin(self, released: Any = ()) -> bool:
        """Begin an interval of smooth inputs; return whether the FMU requests the end of the run.

        ``released`` has an entry for each torsion bar, not zero if the bar is released now.
        """
        release(self.encoded, self.state, self.laws)
        self.laws[np.flatnonzero(released), 2] = 0.0
        self.ends = [end for end in self.ends if end > self.time]
        moving = self.encoded.source.coefficients[:, :, 1].any() or self.laws[:, 2].any()
        self.still = self.encoded.steady and not moving
        ended = self.model.event(self.inputs(self.time, self.state))
        self.reset(self.time - self.origin)
        if np.isfinite(self.ends[0]):
            _set_stop_time(self.cvode_mem, self.ends[0] - self.origin)
        return ended

    def advance(self, goal: float) -> bool:
        """Integrate to the time ``goal`` or to an earlier event; return whether the run ends there.

        NotFiniteError is raised if an input is not a finite number, ExchangeError if CVode fails.
        """
        goal = min(goal, self.ends[0])
        self.failure = None
        roots = np.zeros(self.nz)
        here, there = self.time - self.origin, goal - self.origin
        reached = there
        if there - here > 16.0 * np.spacing(there):
            try:
                _, roots, reached = self.step(here, there)
            except (RuntimeError, TypeError) as error:
                raise self._reason(error) from error
        self.time = goal if reached == there else self.origin + reached
        self.put(self.time, self.px)
        return self.begin(roots[self.model.indicators :]) if roots.any() or self.time >= self.ends[0] else False

    def _reason(self, error: Exception) -> Exception:
        """Return the error to raise after a failure of CVode: the error of the inputs if the inputs caused the failure."""
        if self.failure is None or isinstance(self.failure, FMICallException):
            return ExchangeError(str(error))
        return self.failure

    def put(self, t: float, x: Any) -> None:
        """Set in the FMU the time t (s), the states x (a vector of CVode), and the inputs at this time and state."""
        self.model.put(t, x)
        if not self.still:
            self.model.set_inputs(self.inputs(t, self._array(x), left=t >= self.ends[0]))

    # Functions that CVode calls

    def _call_safely(self, work: Callable[[], None]) -> int:
        try:
            work()
        except FMICallException as error:  # the FMU has no such state
            self.failure = error
            return _SHORTER_STEP
        except Exception as error:  # raised by the inputs: it cannot pass through CVode
            self.failure = error
            return _NO_WAY
        return _GOOD

    def f(self, t: float, y: Any, ydot: Any, user_data: Any) -> int:
        """Compute the time derivatives of the states; t is CVode's time (s), which counts from the start of the run."""

        def work() -> None:
            self.put(self.origin + t, NV_DATA_S(y))
            self.model.get_derivatives(NV_DATA_S(ydot))

        return self._call_safely(work)

    def g(self, t: float, y: Any, gout: Any, user_data: Any) -> int:
        """Compute the functions whose zeros are events: the FMU's event indicators, and the release of torsion bars."""

        def work() -> None:
            x = NV_DATA_S(y)
            self.put(self.origin + t, x)
            self.model.get_indicators(gout)
            angles = self._array(x)[self.encoded.source.law_places[:, 1]]
            for n, (angle, law) in enumerate(zip(angles, self.laws), start=self.model.indicators):
                gout[n] = angle - law[1] if law[2] else 1.0

        return self._call_safely(work)
