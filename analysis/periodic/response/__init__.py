"""Follow periodic motions over one parameter: branches, resonances, special points, and values that a machine should avoid."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
