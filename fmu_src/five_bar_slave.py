"""The five-bar slider as an FMI 2.0 co-simulation slave."""

from __future__ import annotations

from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.plant import Plant
from linkwork.five_bar.variables import POSITION_PARAMETERS, VARIABLES
from slave import LinkworkSlave


class FiveBarSlider(LinkworkSlave):
    """A four-bar whose rocker pivot is a sprung, damped and driven slider (Youssef)."""

    description = "Five-bar slider: a four-bar linkage whose rocker pivot is a sprung, damped, controllable slider"
    variables = VARIABLES
    position_parameters = POSITION_PARAMETERS
    plant_class = Plant
    initial_class = InitialState
    experiment = (0.0, 0.4285714285714286, 1e-3, 1e-9)  # three revolutions at 420 rpm
