"""Search for linkages: scan for starts in closed form, optimise from the starts, and compute trade-offs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
