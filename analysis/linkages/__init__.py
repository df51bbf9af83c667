"""Planar linkages that the user describes, in a file or in Python: compiled into mechanisms that every analysis accepts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
