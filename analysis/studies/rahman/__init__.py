"""The figures of Rahman's thesis, listed here: `table` says which shows what, `figures` computes them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ..contents import Entry
from . import table

#: Each figure by its number in the thesis with an R before it.
FIGURES: Mapping[str, Entry] = MappingProxyType(
    {number: Entry(figure.title, "rahman.figures") for number, figure in table.FIGURES.items()}
)
