"""Chart periodic motions over two parameters: grids of multipliers, stability boundaries, coexisting motions, basins."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
