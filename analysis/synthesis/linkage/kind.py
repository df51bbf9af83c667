"""The kinds of linkages that a synthesis searches. This module imports nothing heavy: the studio's server starts with it."""

from typing import Literal

#: Not each of them is a mechanism that can be run.
Kind = Literal["four-bar", "slider-crank", "geared-five-bar"]
