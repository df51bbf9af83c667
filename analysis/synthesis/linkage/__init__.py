"""Model planar linkages: dimensions, motion and coupler curves, compiled; masses and pin forces."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
