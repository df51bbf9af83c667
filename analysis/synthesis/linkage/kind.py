"""Name the kinds of linkages that a synthesis searches. The studio's server loads this module first, so it imports little."""

from typing import Literal

#: Not each of them is a mechanism that can be run.
Kind = Literal["four-bar", "slider-crank", "geared-five-bar"]
