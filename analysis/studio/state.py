"""What the page opens with: a case, a published set, or a mechanism that shows what there is to see."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkwork.errors import InputError

from ..mechanisms import FIVE_BAR, mechanism_of
from ..run import Case
from .tables import published_values, values_of

#: What is changed in the first published set of the mechanism that the page opens with: a coupler point.
OPENING = {"coupler.point_distance": 0.105, "coupler.point_angle": 0.55}


def opening_state() -> dict[str, Any]:
    """The state that the page has where none is given."""
    name, known = next(iter(FIVE_BAR.published.items()))
    return {
        "mechanism": FIVE_BAR.name,
        "title": f"{FIVE_BAR.title}, {name} with a coupler point",
        "values": published_values(FIVE_BAR, known) | OPENING,
    }


def state_of(case: Case) -> dict[str, Any]:
    """The state of the page that a case is.

    Raises
    ------
    InputError
        If an input varies: the page has constant ones.
    """
    mechanism = mechanism_of(case.parameters)
    values = values_of(mechanism, case.parameters, case.initial)
    values |= {name: float(value) for name, value in case.inputs.modes(mechanism).items()}
    for channel in (channel for channel in mechanism.channels if channel.kind != "rate"):
        parts = case.inputs.parts(channel.argument)
        for part in parts:
            if not isinstance(part, (int, float, np.number)):
                raise InputError(
                    f"{channel.argument} is a {type(part).__name__}: the studio has inputs that are constant; linkwork run "
                    "takes the case as it is"
                )
        values[channel.name] = float(sum(parts))
    return {"mechanism": mechanism.name, "title": case.title, "values": values, "duration": case.stop_time}
