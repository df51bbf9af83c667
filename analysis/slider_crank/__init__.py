"""Analyse the generalised slider-crank: force problems, mobility, tolerances, and the thesis's dual-number method."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
