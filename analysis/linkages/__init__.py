"""Planar linkages of the user's own: described in a file or in Python, compiled into mechanisms that every analysis takes."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
