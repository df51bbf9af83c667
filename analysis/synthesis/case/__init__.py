"""Read the case files of a synthesis: their task, constraints and search."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
