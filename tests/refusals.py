"""Calls that must be refused."""

from collections.abc import Callable
from typing import Any

import pytest


def refused(error: type[Exception], match: str, function: Callable[..., Any], /, *given: Any, **named: Any) -> None:
    """Call a function, which must raise the error with a message that matches the regular expression."""
    with pytest.raises(error, match=match):
        function(*given, **named)
