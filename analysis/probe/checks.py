"""List the checks of the probe by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from . import places
from .context import Case, Context
from .leaks import check_leaks
from .model import Model
from .repeats import check_deserializing, check_repetition, check_restoring, check_serializing, compare_half_steps
from .sequences import list_faults, run_forbidden_call, run_legal_calls
from .values import (
    bounded_parameters,
    check_bounds,
    check_derivatives,
    check_parameter_bounds,
    check_starts,
    check_step_past_end,
)


class Check(NamedTuple):
    """A check of the probe."""

    title: str  # property of the FMU that is checked
    run: Case  # runs one case
    cases: Callable[[Model], int] | None = None  # number of cases; if None, the number of calls limits the cases
    share: float = 0.0  # share of the requested number of calls that a check without a number of cases gets
    least: Callable[[Context], int] = lambda context: 0  # number of cases that are run even if they need more calls


def _count_derivative_cases(model: Model) -> int:
    return 0 if not (model.directional and model.dependencies) else 1 if model.interface == "cs" else 3


def _can_save(model: Model) -> bool:
    return model.can_save and model.can_serialize


#: The checks by name, in the order in which they are made.
CHECKS = {
    "starts": Check(
        "parameters and inputs have their declared starts after the initialization", check_starts, lambda model: 1
    ),
    "repeat": Check(
        "the same calls give the same bits: in a new instance, after a reset, beside another instance",
        check_repetition,
        lambda model: 2,
    ),
    "restore": Check(
        "a run continued from a restored state gives the same bits, whatever came between",
        check_restoring,
        lambda model: 3 if model.can_save else 0,
    ),
    "serialize": Check(
        "a state is serialized to the same bytes each time", check_serializing, lambda model: 2 * _can_save(model)
    ),
    "deserialize": Check(
        "a run continued from those bytes in another process gives the same bits",
        check_deserializing,
        lambda model: 2 * _can_save(model),
    ),
    "split": Check(
        "one step and two halves: the largest difference", compare_half_steps, lambda model: model.interface == "cs"
    ),
    "derivatives": Check(
        "directional and adjoint derivatives against differences", check_derivatives, _count_derivative_cases
    ),
    "bounds": Check(
        "over a run with random inputs every variable keeps to its declared range", check_bounds, lambda model: 2
    ),
    "parameters": Check(
        "a parameter beyond its declared range is refused",
        check_parameter_bounds,
        lambda model: len(bounded_parameters(model)),
    ),
    "stop": Check("a step past the stop time is refused", check_step_past_end, lambda model: model.interface == "cs"),
    "leaks": Check(
        "memory does not grow over lives of instances, steps, saved states",
        check_leaks,
        lambda model: 3 if model.can_save else 2,
    ),
    "places": Check(
        "it works in folders of any name, with the resource location in every form of the standard",
        places.check_places,
        places.count,
    ),
    "legal": Check("random legal calls are accepted", run_legal_calls, share=0.5),
    "forbidden": Check(
        "a forbidden call is refused, and the instance can still be freed",
        run_forbidden_call,
        share=0.5,
        least=lambda context: len(list_faults(context)),
    ),
}
