"""Synthesise linkages: find the dimensions of linkages that do a task, and rank them by error and defects.

>>> import numpy as np
>>> from analysis.synthesis import LargestLink, LeastTransmission, TimedPath, synthesize, turn
>>> phi = turn(72)
>>> ellipse = np.column_stack([0.20 + 0.10 * np.cos(phi), 0.15 + 0.05 * np.sin(phi)])
>>> result = synthesize(TimedPath(points=ellipse), constraints=[LargestLink(length=1.1285), LeastTransmission()])
>>> round(1e4 * result.best.error, 2)
0.44
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
