"""The entries of the lists of figures."""

from __future__ import annotations

from typing import NamedTuple


class Entry(NamedTuple):
    """Figure in the list of studies: its title, the module that computes it, and its place in the thesis.

    ``place`` gives the section and the lines (L) of the scanned text; it is empty for a study of ours. ``module`` is empty for
    a figure that shows a mechanism or an apparatus, where there is nothing to compute.
    """

    title: str
    module: str = ""
    place: str = ""
