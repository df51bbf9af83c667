"""Measure coupling errors: compare co-simulations of a system at several communication steps with the system as one model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..run import show_progress
from .description import System
from .joined import JoinedSystem
from .master import SystemRun, run_system


class Way(NamedTuple):
    """A way of coupling: the master's coupling, whether rates of commanded speeds are connected, and the FMI version."""

    coupling: str
    rates: bool = True
    fmi: int = 2


#: The ways of coupling that are compared, by name.
WAYS = {
    "hold": Way("hold", rates=False),
    "acceleration": Way("hold"),
    "derivatives": Way("derivatives"),
    "updates": Way("updates", fmi=3),
    "rollback": Way("rollback"),
}
#: Steps of a decade relative to its first step; each divides the first.
_DECADE = (1.0, 0.5, 0.2)
#: Errors below this are due to the parts' own integrators, not to the coupling.
_FLOOR = 1e-8


@dataclass(frozen=True, kw_only=True)
class Convergence:
    """Errors of a system's couplings at several communication steps.

    Attributes
    ----------
    title : str
    steps : (N,) float array
        Communication steps (s), in descending order.
    errors : mapping of str to (N,) float array
        For each coupling, the greatest error of any connected output that is not an acceleration, relative to the greatest
        magnitude of this output. The error is taken at the communication points of the longest step. NaN if a part refused a
        step.
    powers : mapping of str to (N,) float array
        For each coupling, the work that the coupling added, as a fraction of the work transmitted by the power bonds; 0
        without bonds, NaN if a part refused a step.
    messages : mapping of str to str
        Message of the part that refused a step, by coupling and step.
    """

    title: str
    steps: NDArray[np.float64]
    errors: Mapping[str, NDArray[np.float64]]
    powers: Mapping[str, NDArray[np.float64]]
    messages: Mapping[str, str]

    def order(self, way: str) -> float:
        """Return the order of a coupling: the slope of log error over log step by regression; NaN with fewer than two errors.

        Errors above 0.1 are left out (the step is too long), and errors below 1e-8 (they are due to the parts' integrators).
        """
        good = np.isfinite(self.errors[way]) & (self.errors[way] > _FLOOR) & (self.errors[way] < 0.1)
        if np.count_nonzero(good) < 2:
            return float("nan")
        return float(np.polyfit(np.log(self.steps[good]), np.log(self.errors[way][good]), 1)[0])


def convergence(
    system: System,
    steps: Sequence[float] | None = None,
    *,
    decades: int = 2,
    stop_time: float | None = None,
    progress: bool = False,
) -> Convergence:
    """Run a system with several couplings and communication steps, and compare each run with that of a `JoinedSystem`.

    Parameters
    ----------
    system : System
    steps : sequence of float, optional
        Communication steps (s); each must divide the first. By default the first is the shortest of the system's step and the
        controllers' sample times, and there are three steps per decade.
    decades : int
        Number of decades of the default steps.
    stop_time : float, optional
        End of the runs (s); by default 50 times the first step, or the system's stop time if that is earlier.
    progress : bool

    Raises
    ------
    InputError
        If a step does not divide the first step, or the first step the stop time.
    WiringError
        If a part is an FMU, whose equations are not known.
    """
    if steps is None:
        periods = [m.values.get("sample_time", 1e-3) for m in system.members.values() if m.controller]
        first = min([system.run.step, *periods, system.run.stop_time])
        steps = [first * share * 0.1**n for n in range(decades) for share in _DECADE] + [first * 0.1**decades]
    stop_time = min(system.run.stop_time, 50.0 * steps[0]) if stop_time is None else stop_time
    for whole, part in [(stop_time, steps[0]), *((steps[0], step) for step in steps)]:
        if abs(whole / part - round(whole / part)) > 1e-9 * whole / part:
            raise InputError(
                f"a step of {part:g} s does not divide {whole:g} s: it must, so that the runs have common points"
            )
    right = JoinedSystem(system).run(stop_time, steps[0])
    wirings = {
        name: (system if way.rates else system.without_rates()).wiring(fmi=way.fmi) for name, way in WAYS.items()
    }
    # accelerations jump where a controller takes a sample
    wiring = next(iter(wirings.values()))
    sources = dict.fromkeys(system.connections.values())
    names = [str(s) for s in sources if not wiring.port(s).unit.endswith("/s2") and str(s) in right.values]
    errors, powers = ({way: np.full(len(steps), np.nan) for way in WAYS} for _ in range(2))
    messages = {}
    work = len(WAYS) * sum(1.0 / step for step in steps)
    with show_progress(progress, work, "couplings and steps") as show:
        done = 0.0
        for way in WAYS:
            for number, step in enumerate(steps):
                run = run_system(wirings[way], coupling=WAYS[way].coupling, step=step, stop_time=stop_time)
                done += 1.0 / step
                show(done)
                if run.status:
                    messages[f"{way}, {step:g} s"] = run.message
                    continue
                errors[way][number], powers[way][number] = _error(run, right, names), run.added_work()
    return Convergence(title=system.title, steps=np.array(steps), errors=errors, powers=powers, messages=messages)


def _error(run: SystemRun, right: SystemRun, names: Sequence[str]) -> float:
    every = round((len(run) - 1) / (len(right) - 1))
    found = []
    for name in names:
        scale = float(np.abs(right[name]).max())
        if scale > 0.0:
            found.append(float(np.abs(run[name][::every] - right[name]).max()) / scale)
    return max(found)
