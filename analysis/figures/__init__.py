"""Plots and animations: the only package that draws.

``figures.plot(result)`` and ``figures.animate(result, path)`` draw any result that has a picture. ``__init__.pyi`` lists
the public names; each is imported from its module when it is first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
