"""Find the least change of parameters that keeps a range of speeds free of resonance, jumps and instability."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
