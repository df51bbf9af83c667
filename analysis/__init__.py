"""The analysis API of Linkwork: simulate, check against the FMU, and study linkages with two degrees of freedom."""

from __future__ import annotations
