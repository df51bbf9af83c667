"""The analysis API of Linkwork: simulate linkages, check them against their FMUs, and study them.

>>> from analysis import Inputs, find_orbit, simulate
>>> run = simulate("table-3.1", Inputs(speed="300 rpm", force="2 N"), stop_time="0.4 s")
>>> run["slider.position"].shape
(401,)
>>> find_orbit("table-3.1", speed="420 rpm").verdict().stability.value
'stable'

A number is in SI; where it has a unit, a text such as "420 rpm" or "5 cm" will do. Where parameters of a mechanism are taken, a
published set or its name will do: `PUBLISHED` has them, `variant` changes values of one.

The names are those of ``__init__.pyi``; each is imported from its module when it is first used. Those that one asks for are
listed by ``dir``, with the packages that have the rest; results and errors of a run can be imported from here too.
"""

from __future__ import annotations

import lazy_loader

__getattr__, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)

#: What one is given and does not ask for.
_RESULTS = {
    "Comparison",
    "CosimulationError",
    "Ensemble",
    "FmuRun",
    "Occurrence",
    "OutputDifference",
    "RunInterrupted",
    "Trajectory",
    "sample_times",
}
__all__ = [name for name in __all__ if name not in _RESULTS]


def __dir__() -> list[str]:
    return list(__all__)
