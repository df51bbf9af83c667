"""Find periodic motions of a driven mechanism, one or all of them, with their Floquet multipliers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
