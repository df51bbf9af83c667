"""What the analyses of the five-bar slider presuppose of the parameters."""

from __future__ import annotations

from typing import Any

from linkwork.errors import InputError

from ..mechanisms import FIVE_BAR, Parameters


def require_five_bar(parameters: Parameters, what: str) -> None:
    """Raise InputError, with ``what`` the analysis is, if parameters are not those of a five-bar."""
    if not isinstance(parameters, FIVE_BAR.parameters):
        raise InputError(
            f"{what} is of five-bars: the parameters are {type(parameters).__name__}, not FiveBarParameters"
        )


def require_no_contact_friction(p: Any, what: str) -> None:
    """Raise InputError, with ``what`` the analysis is, if the constants of a five-bar have friction by contact forces."""
    if FIVE_BAR.switched(p):
        raise InputError(f"slider.friction_coefficient and pin.*_friction_radius must be 0: {what} cannot hold them")
