"""Checks of the parameters that are common to the analyses of the five-bar slider."""

from __future__ import annotations

from typing import Any

from linkwork.errors import InputError

from ..mechanisms import FIVE_BAR, Parameters


def require_five_bar(parameters: Parameters, what: str) -> None:
    """Raise InputError if the parameters are not those of a five-bar; ``what`` names the analysis in the message."""
    if not isinstance(parameters, FIVE_BAR.parameters):
        raise InputError(
            f"{what} is defined for five-bars only: the parameters are {type(parameters).__name__}, not FiveBarParameters"
        )


def require_no_contact_friction(p: Any, what: str) -> None:
    """Raise InputError if a five-bar's constants have contact friction; ``what`` names the analysis in the message."""
    if FIVE_BAR.is_switched_on(p):
        raise InputError(f"slider.friction_coefficient and pin.*_friction_radius must be 0: {what} cannot contain them")
