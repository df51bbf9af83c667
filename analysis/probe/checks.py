"""The checks of the probe, by name."""

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
    """A check: what it looks for, what runs a case of it, and how many cases it has.

    Without a number of cases it has as many as the calls allow, a share of them.
    """

    title: str
    make: Callable[[Context], Case]
    cases: Callable[[Model], int] | None = None
    share: float = 0.0


def _is(case: Case) -> Callable[[Context], Case]:
    return lambda context: case


def _derivatives(model: Model) -> int:
    return 0 if not (model.directional and model.dependencies) else 1 if model.interface == "cs" else 3


#: In the order in which they are made.
CHECKS = {
    "starts": Check("start values", _is(starts), lambda model: 1),
    "repeat": Check("the same calls, the same values", _is(repeated), lambda model: 2),
    "restore": Check("restored states", _is(restored), lambda model: 3 if model.can_save else 0),
    "serialize": Check(
        "serialized states", _is(serialize_here), lambda model: 2 if model.can_save and model.can_serialize else 0
    ),
    "deserialize": Check(
        "serialized states in another process",
        _is(deserialize_there),
        lambda m: 2 if m.can_save and m.can_serialize else 0,
    ),
    "split": Check("one step and two halves", _is(split), lambda model: 1 if model.interface == "cs" else 0),
    "derivatives": Check("derivatives and differences", _is(derivatives), _derivatives),
    "bounds": Check("declared ranges over a run", _is(bounds), lambda model: 2),
    "parameters": Check(
        "parameters beyond their ranges", _is(out_of_bounds), lambda model: len(bounded_parameters(model))
    ),
    "stop": Check("a step past the stop time", _is(past_the_end), lambda model: 1 if model.interface == "cs" else 0),
    "leaks": Check("memory over lives, steps and states", _is(leaks), lambda model: 3 if model.can_save else 2),
    "places": Check("folders and resource locations", _is(places.places), places.count),
    "legal": Check("random legal calls", _is(legal), share=0.5),
    "forbidden": Check("forbidden calls", Forbidden, share=0.5),
}
