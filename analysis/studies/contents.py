"""Define the entries of the lists of figures of both theses, and read the statements that each study judges."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

#: File of the statements of each study, shortened, from the pages of the theses; docs/generate.py writes it.
SENTENCES = Path(__file__).with_name("sentences.json")


class Entry(NamedTuple):
    """Figure or study in the list: its title, the module that computes it, and its place in the thesis.

    ``place`` gives the section and the lines (L) of the scanned text; it is empty for a study of our own. ``module`` is empty
    for a figure that shows a mechanism or an apparatus, where there is nothing to compute.
    """

    title: str
    module: str = ""
    place: str = ""


def sentences() -> Mapping[str, list[str]]:
    """Return the statements that each study judges, by the number of the study.

    Each statement is shortened and has its place in the thesis.
    """
    found: dict[str, list[str]] = json.loads(SENTENCES.read_text(encoding="utf-8"))
    return found
