"""Read and write files: tables of numbers, curves, drawings, and TOML or JSON with units; independent of mechanisms."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
