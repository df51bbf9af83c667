"""Linear models of a mechanism, and control of a coordinate designed on them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
