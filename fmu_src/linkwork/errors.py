"""Errors of Linkwork: each message says what is wrong, which value was given, and what is allowed."""

from __future__ import annotations


class LinkworkError(Exception):
    """Base of every error that Linkwork raises on purpose."""


#: Greatest number of names that a message lists: of valid names if there are many, and of missing parameters.
_LISTED, _MISSING = 5, 12


def _show_value(value: object) -> str:
    """Return the text of a value for an error message, cut to a bounded length."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer with thousands of digits; endlessly nested lists
        return f"a {type(value).__name__} that is too long to be shown"
    return _cut(text)


def _cut(text: str) -> str:
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
        The words after "it must" in the message.
    """

    def __init__(self, name: str, value: object, requirement: str) -> None:
        self.name = name
        self.value = value
        self.requirement = requirement
        super().__init__(f"parameter {name} is {_show_value(value)}: it must {requirement}")


class InputError(LinkworkError, ValueError):
    """An input of a run is not usable: not finite, of a wrong shape, or out of order."""


class UnknownNameError(ParameterError, InputError):
    """A name is not valid; ``known`` are the valid names, ``near`` the valid name that was probably meant, or None.

    The message lists the valid names, or the nearest five if there are more than ten; ``words``, if given, replace the
    name in the message.
    """

    def __init__(self, name: str, known: tuple[str, ...], words: str = "") -> None:
        from difflib import get_close_matches

        self.known = known
        self.near = next(iter(get_close_matches(name, known, 1)), None)
        few = len(known) <= 10
        listed = ", ".join(known if few else get_close_matches(name, known, _LISTED, 0.0))
        super().__init__(words or name, None, f"be one of {listed}")
        hint = f"; did you mean {self.near}?" if self.near else ""
        which = "the names" if few else f"the nearest of {len(known)} names"
        self.args = (f"there is no {_cut(words or name)}{hint} ({which} are {listed})",)


class MissingParameterError(ParameterError):
    """A required parameter was not given; ``others`` are the names of the other missing parameters."""

    def __init__(self, name: str, others: tuple[str, ...] = ()) -> None:
        super().__init__(name, None, "be given")
        # all missing parameters have to be given, so that more are listed than valid names
        rest = len(others) - _MISSING
        also = f", and so {'is' if len(others) == 1 else 'are'} {', '.join(others[:_MISSING])}" if others else ""
        also += f" and {rest} more" if rest > 0 else ""
        self.args = (f"parameter {name} is missing{also}",)


class AssemblyError(LinkworkError):
    """The links cannot be joined at the given configuration."""


class JammingError(AssemblyError):
    """Friction jams the links, or nearly jams them, at the given configuration."""


class StepError(LinkworkError):
    """A communication step cannot be taken, because of its length, its start time or the state of the run."""


class IntegrationError(LinkworkError):
    """The integrator could not meet its tolerance."""


class StateError(LinkworkError):
    """A saved state does not belong to this model or is damaged."""


class Interrupted(LinkworkError):
    """Work was interrupted from the keyboard; the results so far are kept."""
