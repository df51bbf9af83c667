"""Errors of Linkwork: each says what was wrong, with which value, and what would be right."""

from __future__ import annotations


class LinkworkError(Exception):
    """Base of every error that Linkwork raises on purpose."""


class ParameterError(LinkworkError, ValueError):
    """A parameter is missing, unknown, of the wrong sign, or not finite.

    Parameters
    ----------
    name : str
        Name of the parameter, as in the FMI contract.
    value : object
        The value that was given.
    requirement : str
        What would be right, as the end of the sentence "it must ...".
    """

    def __init__(self, name: str, value: object, requirement: str) -> None:
        self.name = name
        self.value = value
        self.requirement = requirement
        super().__init__(f"parameter {name} is {value!r}: it must {requirement}")


class AssemblyError(LinkworkError):
    """The links cannot be joined at the given crank angle and slider position."""


class InputError(LinkworkError, ValueError):
    """An input of a run is not usable: not finite, of a wrong shape, or out of order."""


class StepError(LinkworkError):
    """A communication step was asked for that cannot be taken (time, order, state)."""


class IntegrationError(LinkworkError):
    """The integrator could not meet its tolerance."""


class StateError(LinkworkError):
    """A saved state does not belong to this model or is damaged."""
