"""Run a built FMU through FMPy with the inputs of `simulate`, and compare two runs."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import time as clock
from ctypes import byref
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError
from linkwork.parameters import fmi_name

from ..mechanisms import InitialState, Parameters, mechanism_of, output_units
from .events import RunInterrupted, interruptible, shown
from .inputs import Inputs
from .inputs import sample as sample_inputs
from .prepared import Run, Settings
from .simulation import sample_times
from .trajectory import Trajectory

#: Outputs that are angles in (-pi, pi]: they differ by what is left after whole turns.
PRINCIPAL_ANGLES = ("coupler.angle", "rocker.angle")


class CosimulationError(LinkworkError):
    """An FMU could not be loaded or initialised; the sentence is the FMU's own where it gave one."""


def unpacking_folder() -> str:
    """Folder to unpack an FMU in: that for temporary files, or another one if it is none that a Python FMU can read.

    An FMU is told the URI of its folder. PythonFMU's wrapper decodes "%20" in it and nothing else, and where it does not find
    its files then it ends the process.

    Raises
    ------
    CosimulationError
        If there is none.
    """
    here = tempfile.gettempdir()
    others = ("/tmp", "/var/tmp") if os.name == "posix" else (os.environ.get("PUBLIC"), "C:/Windows/Temp")
    for folder in (here, *others):
        if folder and os.access(folder, os.W_OK) and not re.search("%(?!20)", Path(folder).absolute().as_uri()):
            return folder
    raise CosimulationError(
        f"an FMU cannot be unpacked in {here}: of the characters in the folder's name PythonFMU's wrapper reads letters from a "
        "to z, digits, spaces and - . _ ~ alone; set TMPDIR to another folder"
    )


class FmuRun:
    """An instance of an FMU of Linkwork through FMPy: set inputs, step, read outputs.

    Which mechanism it must be of, the parameters say. Use as a context manager.

    Raises
    ------
    CosimulationError
        If the file is no such FMU, or its initialisation fails.
    """

    def __init__(
        self,
        fmu: str | Path,
        parameters: Parameters,
        initial: InitialState,
        *,
        modes: dict[str, int],
        tolerance: float,
        start_time: float,
        inputs: dict[str, float],
    ) -> None:
        if not Path(fmu).is_file():
            raise CosimulationError(f"there is no file {fmu}: build it with 'python build_fmu.py'")
        mechanism = mechanism_of(parameters)
        self.input_names = mechanism.input_names
        self.output_names = mechanism.output_names
        self.messages: list[str] = []
        self._folder: str | None = None
        try:
            description = read_model_description(str(fmu))
        except Exception as error:
            raise CosimulationError(f"{fmu} is not an FMU: {error}") from error
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        needed = (*self.input_names, *self.output_names, "solver.status")
        missing = [name for name in needed if name not in self._references]
        if description.coSimulation is None:
            missing.insert(0, "co-simulation")
        if missing:
            named = ", ".join(missing[:3]) + (f" and {len(missing) - 3} others" if len(missing) > 3 else "")
            raise CosimulationError(
                f"{fmu} is not a {mechanism.fmu} for co-simulation, which these parameters need, but "
                f"{description.modelName}: it has no {named}"
            )
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        addLoggerProxy(byref(self._callbacks))
        try:
            self._folder = tempfile.mkdtemp(dir=unpacking_folder())
            extract(str(fmu), self._folder)
            self._slave = FMU2Slave(
                guid=description.guid,
                unzipDirectory=self._folder,
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName="linkwork",
            )
            self._slave.instantiate(callbacks=self._callbacks, loggingOn=True)
            self._slave.setupExperiment(tolerance=tolerance, startTime=start_time)
            reals = {fmi_name(name): value for name, value in asdict(parameters).items()}
            reals |= {f"initial.{name}": value for name, value in asdict(initial).items()}
            reals |= {"solver.tolerance": tolerance} | inputs
            integers = modes | {
                v.name: int(reals.pop(v.name)) for v in mechanism.mechanism_variables.values() if v.kind == "Integer"
            }
            self._slave.setReal([self._references[name] for name in reals], [float(v) for v in reals.values()])
            self._slave.setInteger([self._references[name] for name in integers], list(integers.values()))
            self._slave.enterInitializationMode()
            self._slave.exitInitializationMode()
        except Exception as error:  # FMPy raises plain ones, too
            self.close()
            reasons = [m for m in self.messages if not m.startswith("Fatal py exception")]
            raise CosimulationError("; ".join(reasons) or f"{fmu}: {error}") from error
        self._inputs = [self._references[name] for name in self.input_names]
        self._outputs = [self._references[name] for name in self.output_names]

    def _log(self, environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode("utf-8", errors="replace"))

    def __enter__(self) -> FmuRun:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def set_inputs(self, values: dict[str, float]) -> None:
        """Set all inputs."""
        self._slave.setReal(self._inputs, [values[name] for name in self.input_names])

    def outputs(self) -> list[float]:
        """All real outputs, in the order of the contract."""
        return list(self._slave.getReal(self._outputs))

    def step(self, time: float, step: float) -> tuple[int, str]:
        """Take one communication step; returns solver.status and solver.message, 0 and an empty string where it succeeds."""
        try:
            self._slave.doStep(time, step)
        except FMICallException:
            status = self._slave.getInteger([self._references["solver.status"]])[0]
            message = self._slave.getString([self._references["solver.message"]])[0]
            return int(status), message.decode() if isinstance(message, bytes) else str(message)
        return 0, ""

    def close(self) -> None:
        """Free the instance and remove the unpacked FMU."""
        slave = self.__dict__.pop("_slave", None)
        if slave is not None and slave.component:
            slave.freeInstance()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)


def cosimulate(
    fmu: str | Path,
    parameters: Parameters,
    inputs: Inputs | None = None,
    *,
    initial: InitialState | None = None,
    stop_time: float,
    step: float = 1e-3,
    start_time: float = 0.0,
    tolerance: float = 1e-9,
    progress: bool = False,
) -> Trajectory:
    """Run an FMU of Linkwork through FMPy.

    The inputs are sampled at each communication point and held over the step, commanded speeds go along the secant:
    ``simulate(..., hold=step)`` does the same in process.

    Parameters
    ----------
    fmu : path
    parameters, inputs, initial, stop_time, start_time, tolerance, progress
        As for `simulate`.
    step : float
        Communication step (s); every one is recorded.

    Returns
    -------
    Trajectory
        A refused step ends the run with the FMU's solver.status and solver.message and all data up to it.

    Raises
    ------
    CosimulationError
        If the FMU cannot be loaded or refuses to initialise.
    InputError
        If the times are not usable, or an input is not a finite number; the sentence names the input and the time.
    """
    begun = clock.perf_counter()
    times = sample_times(stop_time, step, start_time)
    # the FMU itself judges the tolerance
    settings = Settings(times=times, hold=step, tolerance=tolerance, max_steps=1)
    prepared = Run(parameters, inputs, initial, settings)
    mechanism, encoded = prepared.mechanism, prepared.encoded
    law = encoded.law.copy()
    rows: list[list[float]] = []
    status, message = 0, ""

    def sampled(t: float, ahead: float, x: NDArray[np.float64]) -> dict[str, float]:
        u = sample_inputs(encoded, t, x, law, ahead=ahead)
        return dict(zip(mechanism.input_names, u.tolist()))

    coordinates = [mechanism.output_names.index(freedom.coordinate) for freedom in mechanism.freedoms]
    rates = [mechanism.output_names.index(freedom.rate) for freedom in mechanism.freedoms]

    def state(row: list[float]) -> NDArray[np.float64]:
        return np.array([*(row[n] for n in coordinates), *(row[n] for n in rates), 0.0, 0.0])

    x = np.array(mechanism.state(prepared.initial))
    first = sampled(times[0], times[1], x)
    run = FmuRun(
        fmu,
        parameters,
        prepared.initial,
        modes=encoded.modes,
        tolerance=tolerance,
        start_time=float(times[0]),
        inputs=first,
    )
    with run, interruptible() as interrupted, shown(progress, times[-1] - times[0], "co-simulate") as show:
        rows.append(run.outputs())
        for t, t_next in pairwise(times):
            status, message = run.step(float(t), float(t_next - t))
            if status:
                break
            # the outputs belong to the inputs that begin here: read the state, sample, set, read all
            x = state(run.outputs())
            later = t_next + step if t_next == times[-1] else times[len(rows) + 1]
            run.set_inputs(sampled(float(t_next), float(later), x))
            rows.append(run.outputs())
            show(float(t_next - times[0]))
            if interrupted:
                break
    trajectory = Trajectory(
        time=times[: len(rows)],
        values=np.array(rows),
        status=status,
        message=message,
        names=mechanism.output_names,
        source=Path(fmu).name,
        statistics={"steps": float(len(rows) - 1), "seconds": clock.perf_counter() - begun},
    )
    if interrupted:
        raise RunInterrupted(trajectory)
    return trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputDifference:
    """Difference of one output between two runs: largest and rms, in its unit, and relative to ``scale``."""

    name: str
    unit: str
    largest: float
    rms: float
    scale: float

    @property
    def relative(self) -> float:
        """Largest difference over scale; zero where both runs are zero throughout."""
        return 0.0 if self.largest == 0.0 else self.largest / self.scale


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Differences of all outputs between two runs."""

    differences: tuple[OutputDifference, ...]
    tolerance: float

    @property
    def worst(self) -> OutputDifference:
        """The output with the largest relative difference."""
        return max(self.differences, key=lambda d: d.relative)

    @property
    def agrees(self) -> bool:
        """Whether every output is within the tolerance."""
        return self.worst.relative <= self.tolerance

    def __getitem__(self, name: str) -> OutputDifference:
        for difference in self.differences:
            if difference.name == name:
                return difference
        known = ", ".join(difference.name for difference in self.differences)
        raise InputError(f"there is no output {name!r}: the outputs are {known}")


def compare(a: Trajectory, b: Trajectory, *, tolerance: float = 1e-6) -> Comparison:
    """Compare two runs output by output.

    The scale of an output is its largest magnitude in ``a``; but a quantity that is small beside its like (a force at one
    pin, the displacement of a stiff slider) is not asked for more digits than a thousandth of the largest like one
    carries, and residuals are measured against what they are the residual of.

    Two runs that ended early for the same reason at the same sample are compared on the samples they share: a solver in
    process keeps the last configuration, an FMU the last communication point.

    Raises
    ------
    InputError
        If the runs have not the same times or outputs.
    """
    if a.names != b.names:
        raise InputError("the runs cannot be compared: they have not the same outputs, and are of different mechanisms")
    n = int(np.count_nonzero(np.isin(a.time, b.time)))
    if a.status == b.status != 0 and max(len(a), len(b)) <= n + 1:
        a, b = replace(a, time=a.time[:n], values=a.values[:n]), replace(b, time=b.time[:n], values=b.values[:n])
    if len(a) == 0 or len(a) != len(b) or not np.allclose(a.time, b.time, rtol=1e-12, atol=1e-15):
        ends = [f"{len(run)} samples" + (f" to t = {run.time[-1]:.9g} s" if len(run) else "") for run in (a, b)]
        raise InputError(f"the runs cannot be compared: {ends[0]}, and {ends[1]}")
    units = output_units()
    largest = {name: float(np.max(np.abs(np.nan_to_num(a[name])), initial=0.0)) for name in a.names}
    differences = []
    for name in a.names:
        with np.errstate(invalid="ignore"):
            difference = np.abs(a[name] - b[name])
            if name in PRINCIPAL_ANGLES:
                difference = np.abs(np.remainder(difference + pi, 2.0 * pi) - pi)
        # what is not a number differs from everything
        difference[np.isnan(difference)] = np.inf
        differences.append(
            OutputDifference(
                name=name,
                unit=units[name],
                largest=float(difference.max()),
                rms=float(np.sqrt(np.mean(difference**2))),
                scale=max(largest[name], _floor(name, largest, units), np.finfo(float).tiny),
            )
        )
    return Comparison(differences=tuple(differences), tolerance=tolerance)


def _floor(name: str, largest: dict[str, float], units: dict[str, str]) -> float:
    """Least scale of an output, from the largest magnitudes of the outputs like it."""

    def like(unit: str) -> float:
        residuals = ("closure.residual", "energy.residual")
        return max((size for n, size in largest.items() if units[n] == unit and n not in residuals), default=0.0)

    if name.endswith(".angle"):
        return 1.0
    lengths, speed = like("m"), next((size for n, size in largest.items() if units[n] == "rad/s"), 0.0)
    if name == "closure.residual":
        return lengths
    if name == "energy.residual":
        # where there are no energies among the outputs, those of what turns and what is pushed
        return like("J") or like("N.m") or 1.0
    scales = {
        "m": lengths,
        "m/s": lengths * speed,
        "m/s2": lengths * speed**2,
        "rad/s": speed,
        "rad/s2": speed**2,
        "N": like("N"),
        "N.m": like("N") * lengths,
        "J": like("J"),
    }
    return 1e-3 * scales.get(units[name], 0.0)
