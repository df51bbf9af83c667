"""Read and write files: tables of numbers, curves, drawings, and TOML or JSON with units; independent of mechanisms.

``__init__.pyi`` lists the public names; each is imported from its module when it is first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
