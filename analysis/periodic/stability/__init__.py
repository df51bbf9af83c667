"""Compute gradients of motions with respect to all parameters, normal forms at a loss of stability, and long runs beyond it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
