"""The analysis API of Linkwork: simulate, check against the FMU, and study linkages with two degrees of freedom.

>>> from linkwork.five_bar.published import SETS
>>> from analysis import Inputs, simulate
>>> table = SETS["table-3.1"]
>>> run = simulate(table.parameters, Inputs(speed=table.crank_speed), stop_time=0.4, step=1e-3)
>>> run["slider.position"].shape
(401,)

The names are those of ``__init__.pyi``; each is imported from its module when it is first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
