"""How far a coupling can be trusted: the error of a system over the communication step, against the system as one model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from .description import System
from .joined import Joined
from .master import SystemRun, run_system

#: The couplings that are compared: of the master, and whether rates of commanded speeds are connected.
WAYS = {
    "hold": ("hold", False),
    "acceleration": ("hold", True),
    "derivatives": ("derivatives", True),
    "rollback": ("rollback", True),
}


@dataclass(frozen=True, kw_only=True)
class Convergence:
    """Errors of a system's couplings over the communication step.

    Attributes
    ----------
    title : str
    steps : (N,) float array
        Communication steps (s), falling.
    errors : mapping of str to (N,) float array
        By coupling the greatest error of all connected outputs, accelerations left out, at the points of the greatest step,
        each relative to its greatest magnitude; NaN where a part refused a step.
    powers : mapping of str to (N,) float array
        By coupling the work that it brought in, as a share of the work that went through the power bonds; 0 without bonds.
    messages : mapping of str to str
        What a part said that refused a step, by coupling and step.
    """

    title: str
    steps: NDArray[np.float64]
    errors: Mapping[str, NDArray[np.float64]]
    powers: Mapping[str, NDArray[np.float64]]
    messages: Mapping[str, str]

    def order(self, way: str) -> float:
        """Return the order of a coupling, the slope of the error over the step by regression; NaN with less than two errors."""
        good = np.isfinite(self.errors[way]) & (self.errors[way] > 0.0)
        if np.count_nonzero(good) < 2:
            return float("nan")
        return float(np.polyfit(np.log(self.steps[good]), np.log(self.errors[way][good]), 1)[0])


def convergence(
    system: System,
    steps: Sequence[float] | None = None,
    *,
    stop_time: float | None = None,
    ways: Sequence[str] = tuple(WAYS),
) -> Convergence:
    """Run a system in several couplings at several steps, and compare with its equations joined.

    Parameters
    ----------
    system : System
    steps : sequence of float, optional
        Communication steps (s), each a whole fraction of the first; by default halvings of four times the system's, or of a
        controller's sample time.
    stop_time : float, optional
        By default 50 times the first step, or the system's, if that is less (s).
    ways : sequence of str
        Of `WAYS`.

    Raises
    ------
    InputError
        If a step does not divide the first, or that the stop time.
    WiringError
        If a part is an FMU, of which no equations are known.
    """
    if steps is None:
        periods = [m.values.get("sample_time", 1e-3) for m in system.members.values() if m.controller]
        steps = [min(4.0 * system.run.step, *periods, system.run.stop_time) * 0.5**n for n in range(7)]
    stop_time = min(system.run.stop_time, 50.0 * steps[0]) if stop_time is None else stop_time
    for whole, part in [(stop_time, steps[0]), *((steps[0], step) for step in steps)]:
        if abs(whole / part - round(whole / part)) > 1e-9 * whole / part:
            raise InputError(
                f"a step of {part:g} s does not divide {whole:g} s: it must, so that the runs have common points"
            )
    right = Joined(system).run(stop_time, steps[0])
    wirings = {True: system.wiring(), False: system.without_rates().wiring()}
    # accelerations leap where a controller takes a sample
    continuous = [
        s for s in dict.fromkeys(system.connections.values()) if not wirings[True].port(s).unit.endswith("/s2")
    ]
    names = [str(source) for source in continuous if str(source) in right.values]
    errors: dict[str, list[float]] = {}
    powers: dict[str, list[float]] = {}
    messages = {}
    for way in ways:
        coupling, rates = WAYS[way]
        for step in steps:
            run = run_system(wirings[rates], coupling=coupling, step=step, stop_time=stop_time)
            if run.status:
                messages[f"{way}, {step:g} s"] = run.message
            errors.setdefault(way, []).append(_error(run, right, names) if run.status == 0 else float("nan"))
            powers.setdefault(way, []).append(run.brought_in())
    return Convergence(
        title=system.title,
        steps=np.array(steps),
        errors={way: np.array(found) for way, found in errors.items()},
        powers={way: np.array(found) for way, found in powers.items()},
        messages=messages,
    )


def _error(run: SystemRun, right: SystemRun, names: Sequence[str]) -> float:
    every = round((len(run) - 1) / (len(right) - 1))
    found = []
    for name in names:
        scale = float(np.abs(right[name]).max())
        if scale > 0.0:
            found.append(float(np.abs(run[name][::every] - right[name]).max()) / scale)
    return max(found)
