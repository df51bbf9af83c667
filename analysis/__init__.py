"""The analysis API of Linkwork: simulate linkages, check them against their FMUs, and study them.

>>> from analysis import Inputs, find_orbit, simulate
>>> run = simulate("table-3.1", Inputs(speed="300 rpm", force="2 N"), stop_time="0.4 s")
>>> run["slider.position"].shape
(401,)
>>> find_orbit("table-3.1", speed="420 rpm").verdict().stability.value
'stable'

Numbers are in SI; a quantity with a unit may also be a text such as "420 rpm" or "5 cm". Instead of a mechanism's parameters a
published set or its name may be given: `PUBLISHED` has the sets, `variant` changes values of a set.

``__init__.pyi`` lists the public names; each is imported from its module when it is first used. ``dir`` lists the functions and
classes to call, and the packages; classes of results and errors can be imported from here as well.
"""

from __future__ import annotations

import lazy_loader

__getattr__, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)

#: Names of results and errors, which ``dir`` does not list.
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
