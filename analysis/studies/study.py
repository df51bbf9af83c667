"""Study of a figure or of statements of a thesis: its result (claim, computed columns, verdicts), and how to run it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import InputError

from ..figures import Curve, Figure
from ..files import save_figure, unknown_name, write_csv
from . import STUDIES, file_stem, is_figure
from .statements import FloatArray, Statement
from .variation import varied, words


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyResult:
    """Result of a study: the claim, the data of the plot, and the statements with their verdicts.

    Attributes
    ----------
    claim : str
        Claim or content of the figure, as far as the thesis's text tells.
    assignment : str
        Our choices in the figure, because the caption is lost; empty if there are none.
    columns : mapping
        Data of the plot by name with unit; all have the same length, padded with NaN. Empty if there is no plot.
    statements : tuple of Statement
    see : str
        Number of the figure whose statements are also about this figure; empty if there is none.
    number : str
        Number of the thesis's figure, or name of a study of our own; `Study.compute` sets it.
    """

    claim: str
    assignment: str = ""
    columns: Mapping[str, FloatArray] = field(default_factory=dict)
    statements: tuple[Statement, ...] = ()
    see: str = ""
    number: str = ""

    @property
    def title(self) -> str:
        """Return the title of the study in the list of studies."""
        return STUDIES[self.number]

    @property
    def heading(self) -> str:
        """Return the heading of the plot: the figure's number and title, and the parameters that the reader has changed."""
        changes = f"; {words()}" if words() else ""
        return (f"Fig {self.number}  {self.title}" if is_figure(self.number) else self.title) + changes


@dataclass(frozen=True, slots=True)
class Study:
    """Study of a figure of a thesis, or of statements without a figure: the functions that compute, draw and animate it.

    ``sweeps`` are the parameters whose values the study itself compares; the reader cannot set them. ``number`` is the study's
    number in the list of studies; `load` sets it.
    """

    computed: Callable[[], StudyResult]
    draw: Callable[[StudyResult], Figure] | None = None
    animate: Callable[[StudyResult, Path], Path] | None = None
    sweeps: tuple[str, ...] = ()
    number: str = ""

    def compute(self) -> StudyResult:
        """Compute the result of the study."""
        return replace(self.computed(), number=self.number)

    def make(
        self, out: str | Path = "out", changes: Mapping[str, Any] | None = None
    ) -> tuple[StudyResult, tuple[Path, ...]]:
        """Compute the study and write ``fig_<number>.png`` and ``.csv`` into a folder; return the result and the paths.

        A study without a plot writes nothing. ``changes`` maps names of the mechanism's parameters to new values: numbers in SI
        units, or texts with a unit. With changes, the names of the files end in ``_varied``.

        Raises
        ------
        InputError
            If the study itself compares values of a changed parameter, or its mechanism has no such parameter.
        """
        changes = changes or {}
        for name in changes:
            if name in self.sweeps:
                raise InputError(f"figure {self.number} compares values of {name} itself: change another parameter")
        with varied(changes) as known:
            result = self.compute()
            for name in changes:
                if not known:
                    raise InputError(
                        f"figure {self.number} has no parameters that can be changed, and so no {name}; only figures of "
                        "Youssef's chapters III and VIII and Rahman's R5 to R38 have, and analysis.youssef.slider_equation "
                        "takes all parameters for the equation of chapters IV and V"
                    )
                if name not in known:
                    raise unknown_name(name, sorted(known), f"parameter {name!r} of figure {self.number}")
            return result, self._written(result, Path(out), "_varied" if changes else "")

    def _written(self, result: StudyResult, out: Path, ending: str) -> tuple[Path, ...]:
        if self.draw is None:
            return ()
        stem = out / f"{file_stem(self.number)}{ending}"
        paths = [
            save_figure(self.draw(result), stem.with_suffix(".png")),
            write_csv(stem.with_suffix(".csv"), result.columns),
        ]
        if self.animate:
            paths.append(self.animate(result, stem.with_suffix(".gif")))
        return tuple(paths)


def pad_columns(columns: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
    """Return the columns padded with NaN to the length of the longest column."""
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    length = max(len(values) for values in arrays.values())
    return {name: np.append(v, np.full(length - len(v), np.nan)) for name, v in arrays.items()}


def result_curves(result: StudyResult, x: str, names: Mapping[str, str], **look: Any) -> list[Curve]:
    """Return columns of a result as curves over the column ``x``; ``names`` maps the name of each column to its label.

    ``look`` are further attributes that all curves share.
    """
    return [Curve(x=result.columns[x], y=result.columns[name], label=label, **look) for name, label in names.items()]
