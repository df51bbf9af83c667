"""List the checks of the probe by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from . import places
from .context import Case, Context
from .leaks import leaks
from .model import Model
from .repeats import deserialize_there, repeated, restored, serialize_here, split
from .sequences import Forbidden, legal
from .values import bounded_parameters, bounds, derivatives, out_of_bounds, past_the_end, starts


class Check(NamedTuple):
    """A check of the probe."""

    title: str  # what the check looks for
    make: Callable[[Context], Case]  # returns the function that runs one case
    cases: Callable[[Model], int] | None = None  # number of cases; without it the number of calls limits them
    share: float = 0.0  # share of the calls that the check gets if it has no number of cases


def _is(case: Case) -> Callable[[Context], Case]:
    return lambda context: case


def _derivatives(model: Model) -> int:
    return 0 if not (model.directional and model.dependencies) else 1 if model.interface == "cs" else 3


def _saves(model: Model) -> bool:
    return model.can_save and model.can_serialize


#: The checks, in the order in which they are made.
CHECKS = {
    "starts": Check(
        "parameters and inputs have their declared starts after the initialization", _is(starts), lambda model: 1
    ),
    "repeat": Check(
        "the same calls give the same bits: in a new instance, after a reset, beside another instance",
        _is(repeated),
        lambda model: 2,
    ),
    "restore": Check(
        "a run continued from a restored state gives the same bits, whatever came between",
        _is(restored),
        lambda model: 3 if model.can_save else 0,
    ),
    "serialize": Check(
        "a state becomes bytes, each time the same", _is(serialize_here), lambda model: 2 * _saves(model)
    ),
    "deserialize": Check(
        "a run continued from those bytes in another process gives the same bits",
        _is(deserialize_there),
        lambda model: 2 * _saves(model),
    ),
    "split": Check(
        "one step and two halves: the largest difference", _is(split), lambda model: model.interface == "cs"
    ),
    "derivatives": Check("directional and adjoint derivatives against differences", _is(derivatives), _derivatives),
    "bounds": Check(
        "over a run with random inputs every variable keeps to its declared range", _is(bounds), lambda model: 2
    ),
    "parameters": Check(
        "a parameter beyond its declared range is refused",
        _is(out_of_bounds),
        lambda model: len(bounded_parameters(model)),
    ),
    "stop": Check("a step past the stop time is refused", _is(past_the_end), lambda model: model.interface == "cs"),
    "leaks": Check(
        "memory does not grow over lives of instances, steps, saved states",
        _is(leaks),
        lambda model: 3 if model.can_save else 2,
    ),
    "places": Check(
        "it works in folders of any name, with resources said in every form that the standard allows",
        _is(places.places),
        places.count,
    ),
    "legal": Check("random legal calls are accepted", _is(legal), share=0.5),
    "forbidden": Check("a forbidden call is refused, and the instance can still be freed", Forbidden, share=0.5),
}
