"""The five-bar slider as an FMI 2.0 co-simulation slave."""

from __future__ import annotations

from typing import Any

from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.parameters import field_name
from linkwork.five_bar.plant import Plant
from linkwork.five_bar.variables import INPUTS, PARAMETERS, POSITION_PARAMETERS, VARIABLES
from slave import LinkworkSlave


class FiveBarSlider(LinkworkSlave):
    """A four-bar whose rocker pivot is a sprung, damped and driven slider (Youssef)."""

    description = "Five-bar slider: a four-bar linkage whose rocker pivot is a sprung, damped, controllable slider"
    variables = VARIABLES
    position_parameters = POSITION_PARAMETERS
    experiment = (0.0, 0.4285714285714286, 1e-3, 1e-9)  # three revolutions at 420 rpm

    def build(self, values: dict[str, Any], time: float, tolerance: float | None) -> Plant:
        mechanism = {}
        initial = {}
        for variable in PARAMETERS:
            name = variable.name
            if name.startswith("initial."):
                initial[name.removeprefix("initial.")] = values[name]
            elif name not in ("drive.mode", "solver.tolerance"):
                mechanism[field_name(name)] = values[name]
        own = values["solver.tolerance"]
        return Plant(
            FiveBarParameters(**mechanism),
            InitialState(**initial),
            drive_mode=values["drive.mode"],
            tolerance=own if tolerance is None else min(own, max(tolerance, 1e-13)),
            time=time,
            inputs={variable.name: values[variable.name] for variable in INPUTS},
        )

    def restore(self, saved: dict[str, Any]) -> Plant:
        return Plant.restore(saved)
