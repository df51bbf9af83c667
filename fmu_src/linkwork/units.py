"""Conversion factors of the units in the published tables."""

from __future__ import annotations

from math import pi

RAD_S_PER_RPM = pi / 30.0
#: Centimetres in a metre. Lengths are divided by it: 57 / 100 is the float nearest to 0.57, and 57 * 0.01 is not.
CM_PER_METRE = 1e2
INCH = 0.0254
