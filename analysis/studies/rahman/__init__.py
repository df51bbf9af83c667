"""List of the figures of Rahman's thesis.

`table` assigns quantities to figures and `figures` computes them. `printed` has the equations exactly as the thesis prints
them, and `closure`, `rates`, `forces` and `conclusions` judge these equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ..contents import Entry
from . import table

_DRAWINGS = (
    ("Planar (ideal) slider-crank with no offset", "section 2.1, L153, L185"),
    ("Planar slider-crank with offset a4 only", "section 2.1, L154, L189"),
    ("Generalised slider-crank with all offsets", "section 2.1, L155, L191"),
    ("Planar slider-crank when the crank angle is zero", "section 2.6.1, L156, L439"),
)

#: Each figure by its number in the thesis with an R before it, then the studies without a figure.
FIGURES: Mapping[str, Entry] = MappingProxyType(
    {f"R{n}": Entry(title, place=place) for n, (title, place) in enumerate(_DRAWINGS, start=1)}
    | {number: Entry(figure.title, "rahman.figures", figure.place) for number, figure in table.FIGURES.items()}
    | {
        "rahman-closure": Entry(
            "Rahman's loop closure and its iteration", "rahman.closure", "abstract, sections 2.3 to 2.6, 3.2, 3.3"
        ),
        "rahman-rates": Entry("Rahman's rates: velocities and accelerations", "rahman.rates", "sections 2.7, 2.8, 3.2"),
        "rahman-forces": Entry(
            "Rahman's force equations, and forces in the plane at a4 = 10 in", "rahman.forces", "sections 2.8, 3.1, 3.2"
        ),
        "rahman-conclusions": Entry("Rahman's conclusions on his method", "rahman.conclusions", "sections 3.2, 3.3"),
    }
)
