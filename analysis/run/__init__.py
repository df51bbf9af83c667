"""Run mechanisms: inputs, the compiled solver, trajectories, ensembles, co-simulation, standard checks.

The public names are listed in ``__init__.pyi``; a name is imported from its module when it is first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
