"""Linkwork's plants: linkages with two degrees of freedom, in plain Python.

Only the standard library is used here, because this package travels inside the FMUs.
"""

from __future__ import annotations

__version__ = "0.1.0"
