"""A case: a mechanism, where it starts, what acts on it, and how long; what a case file holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from types import MappingProxyType

from linkwork.errors import InputError
from linkwork.five_bar import published as five_bar_published
from linkwork.five_bar.parameters import InitialState as FiveBarState
from linkwork.slider_crank import published as slider_crank_published

from ..mechanisms import InitialState, Parameters, mechanism_of
from .inputs import INPUTS_OF, Channels, Inputs, given

#: The published sets of every mechanism, by name: each has parameters, initial, crank_speed and source.
PUBLISHED: Mapping[str, five_bar_published.PublishedSet | slider_crank_published.PublishedSet] = MappingProxyType(
    {**five_bar_published.SETS, **slider_crank_published.SETS}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Everything a run needs, in process or through the FMU. SI units.

    Attributes
    ----------
    title : str
    parameters, initial, inputs
        All of one mechanism, `analysis.mechanisms`; initial and inputs are by default those of a five-bar at rest.
    stop_time : float
        End of the run (s); it starts at 0.
    step : float
        Distance of the samples, and communication step of the FMU (s).
    tolerance : float
    """

    title: str
    parameters: Parameters
    initial: InitialState = field(default_factory=FiveBarState)
    inputs: Channels = field(default_factory=Inputs)
    stop_time: float
    step: float = 1e-3
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        # inputs and start of another mechanism are told here, not when it is run
        given(mechanism_of(self.parameters), self.inputs, self.initial)


def published_case(name: str, *, revolutions: float = 3.0, steps_per_revolution: int = 360) -> Case:
    """A published set at its running speed, from where it is published to start.

    Raises
    ------
    InputError
        If there is no set of that name.
    """
    if name not in PUBLISHED:
        raise InputError(f"there is no published set {name!r}: the sets are {', '.join(PUBLISHED)}")
    entry = PUBLISHED[name]
    turn = 2.0 * pi / entry.crank_speed
    return Case(
        title=entry.source,
        parameters=entry.parameters,
        initial=entry.initial,
        inputs=INPUTS_OF[mechanism_of(entry.parameters).name](speed=entry.crank_speed),
        stop_time=revolutions * turn,
        step=turn / steps_per_revolution,
    )
