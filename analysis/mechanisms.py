"""The mechanisms there are: one line each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from linkwork import five_bar, slider_crank
from linkwork.errors import InputError
from linkwork.mechanism import Mechanism

FIVE_BAR = five_bar.MECHANISM
SLIDER_CRANK = slider_crank.MECHANISM

#: By name; one more is registered by ``MECHANISMS[mechanism.name] = mechanism``.
MECHANISMS: dict[str, Mechanism] = {mechanism.name: mechanism for mechanism in (FIVE_BAR, SLIDER_CRANK)}


class _Published(Mapping[str, Any]):
    def __getitem__(self, name: str) -> Any:
        for mechanism in MECHANISMS.values():
            if name in mechanism.published:
                return mechanism.published[name]
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return (name for mechanism in MECHANISMS.values() for name in mechanism.published)

    def __len__(self) -> int:
        return sum(len(mechanism.published) for mechanism in MECHANISMS.values())


#: The published sets of every mechanism, by name: each has parameters, initial, crank_speed and source.
PUBLISHED: Mapping[str, Any] = _Published()

#: Parameters of a mechanism and its state at the start: instances of `Mechanism.parameters` and `Mechanism.initial`.
Parameters = Any
InitialState = Any


def mechanism_of(parameters: Parameters) -> Mechanism:
    """The mechanism that parameters belong to.

    Raises
    ------
    InputError
        If they are those of none.
    """
    for mechanism in MECHANISMS.values():
        if isinstance(parameters, mechanism.parameters):
            return mechanism
    kinds = ", ".join(mechanism.parameters.__name__ for mechanism in MECHANISMS.values())
    raise InputError(f"parameters are {type(parameters).__name__}: they must be one of {kinds}")


def output_units() -> dict[str, str]:
    """Unit of every real output of every mechanism; outputs of one name have one unit (a test holds them to it)."""
    return {
        v.name: v.unit
        for mechanism in MECHANISMS.values()
        for v in mechanism.variables
        if v.causality == "output" and v.kind == "Real"
    }


def require_five_bar(parameters: Parameters, what: str) -> None:
    """Make sure that parameters are those of a five-bar, for an analysis that is of five-bars alone.

    Raises
    ------
    InputError
        If they are not, with ``what`` the analysis is.
    """
    if not isinstance(parameters, FIVE_BAR.parameters):
        raise InputError(
            f"{what} is of five-bars: the parameters are {type(parameters).__name__}, not FiveBarParameters"
        )
