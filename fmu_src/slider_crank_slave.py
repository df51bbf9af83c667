"""The generalised slider-crank as an FMI 2.0 co-simulation slave."""

from __future__ import annotations

from linkwork.slider_crank.parameters import InitialState
from linkwork.slider_crank.plant import Plant
from linkwork.slider_crank.variables import POSITION_PARAMETERS, VARIABLES
from slave import LinkworkSlave


class SliderCrank(LinkworkSlave):
    """A spatial slider-crank whose crank turns and shifts along its axis (Rahman)."""

    description = (
        "Generalised slider-crank: offset and twisted guide, rod on ball joints, crank that turns and shifts axially"
    )
    variables = VARIABLES
    position_parameters = POSITION_PARAMETERS
    plant_class = Plant
    initial_class = InitialState
    experiment = (0.0, 2.4, 5e-3, 1e-9)  # two revolutions at 50 rpm
