"""Errors of Linkwork: each says what was wrong, with which value, and what would be right."""

from __future__ import annotations


class LinkworkError(Exception):
    """Base of every error that Linkwork raises on purpose."""


def _shown(value: object) -> str:
    """Return the text of a value for an error message, cut to a bounded length."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits; lists inside each other without end
        return f"a {type(value).__name__} that is too long to be shown"
    return text if len(text) <= 500 else f"{text[:500]}..."


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
        super().__init__(f"parameter {name} is {_shown(value)}: it must {requirement}")


class InputError(LinkworkError, ValueError):
    """An input of a run is not usable: not finite, of a wrong shape, or out of order."""


class UnknownNameError(ParameterError, InputError):
    """An unknown name; ``known`` are the valid names, ``near`` the one that was probably meant."""

    def __init__(self, name: str, known: tuple[str, ...], near: str | None) -> None:
        self.known = known
        self.near = near
        super().__init__(name, None, f"be one of {', '.join(known)}")
        hint = f"; did you mean {near}?" if near else ""
        self.args = (f"there is no {name}{hint} (the names are {', '.join(known)})",)


class MissingParameterError(ParameterError):
    """A parameter that is needed was not given."""

    def __init__(self, name: str, others: tuple[str, ...] = ()) -> None:
        super().__init__(name, None, "be given")
        also = f", and so {'is' if len(others) == 1 else 'are'} {', '.join(others)}" if others else ""
        self.args = (f"parameter {name} is missing{also}",)


class AssemblyError(LinkworkError):
    """The links cannot be joined at the given configuration."""


class JammingError(AssemblyError):
    """Friction would jam the links, or nearly so, at the given configuration."""


class StepError(LinkworkError):
    """A communication step was asked for that cannot be taken (time, order, state)."""


class IntegrationError(LinkworkError):
    """The integrator could not meet its tolerance."""


class StateError(LinkworkError):
    """A saved state does not belong to this model or is damaged."""


class Interrupted(LinkworkError):
    """Work was interrupted from the keyboard; what had been done is kept."""
