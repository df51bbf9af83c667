"""The entries of the lists of figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

#: What the statements of each study are about, from the pages of the theses; written by docs/generate.py.
SENTENCES = Path(__file__).with_name("sentences.json")


class Entry(NamedTuple):
    """Figure in the list of studies: its title, the module that computes it, and its place in the thesis.

    ``place`` gives the section and the lines (L) of the scanned text; it is empty for a study of ours. ``module`` is empty for
    a figure that shows a mechanism or an apparatus, where there is nothing to compute.
    """

    title: str
    module: str = ""
    place: str = ""


def sentences() -> Mapping[str, list[str]]:
    """Return the statements that each study judges, shortened, with their places, by its number."""
    found: dict[str, list[str]] = json.loads(SENTENCES.read_text(encoding="utf-8"))
    return found
