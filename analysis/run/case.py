"""A case: a mechanism, where it starts, what acts on it, and how long; what a case file holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

from ..mechanisms import InitialState, Parameters, mechanism_of
from .arguments import published_set
from .inputs import Inputs, given


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Everything a run needs, in process or through the FMU. SI units.

    Attributes
    ----------
    title : str
    parameters, initial, inputs
        All of one mechanism, `analysis.mechanisms`; by default it is at rest and nothing acts on it.
    stop_time : float
        End of the run (s); it starts at 0.
    step : float
        Distance of the samples, and communication step of the FMU (s).
    tolerance : float
    """

    title: str
    parameters: Parameters
    initial: InitialState = None
    inputs: Inputs = field(default_factory=Inputs)
    stop_time: float
    step: float = 1e-3
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        # inputs and start of another mechanism are refused here, not when it is run
        _, initial = given(mechanism_of(self.parameters), self.inputs, self.initial)
        object.__setattr__(self, "initial", initial)


def published_case(name: str, *, revolutions: float = 3.0, steps_per_revolution: int = 360) -> Case:
    """A published set at its running speed, from where it is published to start.

    Raises
    ------
    UnknownNameError
        If there is no set of that name.
    """
    entry = published_set(name)
    turn = 2.0 * pi / entry.crank_speed
    return Case(
        title=entry.source,
        parameters=entry.parameters,
        initial=entry.initial,
        inputs=Inputs(speed=entry.crank_speed),
        stop_time=revolutions * turn,
        step=turn / steps_per_revolution,
    )
