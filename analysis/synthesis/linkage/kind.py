"""Name the kinds of linkages that a synthesis searches. The studio's server loads this module first, so it imports little."""

from typing import Literal

#: The kinds of linkages; a kind need not be one of the mechanisms that can be simulated.
Kind = Literal["four-bar", "slider-crank", "geared-five-bar"]
