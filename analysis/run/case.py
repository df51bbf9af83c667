"""A case, as described in a case file: a mechanism, its initial state, its inputs, and the duration of the run."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..mechanisms import InitialState, Parameters, find_mechanism
from .arguments import complete_inputs, published_set, turn_durations
from .inputs import Inputs, check_run
from .masses import Mass, mass_origins


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A case: all data that a run needs, in process or through the FMU, in SI units.

    Attributes
    ----------
    title : str
    parameters, initial, inputs
        Parameters, initial state and inputs of one mechanism; by default the mechanism is at rest and nothing acts on it.
    stop_time : float
        End of the run (s), which starts at 0.
    step : float
        Time between samples, and communication step of the FMU (s).
    tolerance : float
        Tolerance of the integrator, as for `simulate`.
    masses : tuple of Mass
        The masses, each with the origin of its value; empty if the origins are not known.
    """

    title: str
    parameters: Parameters
    initial: InitialState = None
    inputs: Inputs = field(default_factory=Inputs)
    stop_time: float
    step: float = 1e-3
    tolerance: float = 1e-9
    masses: tuple[Mass, ...] = ()

    def __post_init__(self) -> None:
        # inputs and start of another mechanism are refused here, not when it is run
        _, initial = check_run(find_mechanism(self.parameters), self.inputs, self.initial)
        object.__setattr__(self, "initial", initial)


def published_case(name: str) -> Case:
    """Return the case of a published set, with its published drive and initial state.

    The run lasts three revolutions of the slowest crank, in steps of one degree of the fastest crank. Without a commanded
    speed, duration and step are those of the default experiment of the FMU.

    Raises
    ------
    UnknownNameError
        If there is no set of that name.
    """
    entry = published_set(name)
    mechanism, inputs = find_mechanism(entry.parameters), complete_inputs(entry, None)
    turn = turn_durations(inputs, mechanism)
    _, stop_time, step, _ = mechanism.experiment
    if turn is not None:
        stop_time, step = 3.0 * turn[0], turn[1] / 360.0
    return Case(
        title=entry.source,
        parameters=entry.parameters,
        initial=entry.initial,
        inputs=inputs,
        stop_time=stop_time,
        step=step,
        masses=mass_origins(entry.parameters, {}, entry, name),
    )
