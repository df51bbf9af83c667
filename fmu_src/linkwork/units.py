"""Conversion factors of the units in the published tables."""

from __future__ import annotations

from math import pi

RAD_S_PER_RPM = pi / 30.0
#: A divisor, because 206 / 1000 is the float nearest to 0.206 and 206 * 0.001 is not.
CM_PER_METRE = 1e2
INCH = 0.0254
