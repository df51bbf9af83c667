"""The errors that the printed linkages of chapter VI can have, by rounding and by our readings of the text."""

from __future__ import annotations

from decimal import Decimal
from itertools import product
from math import radians

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from ...synthesis import Linkage, RockerFunction, UntimedPath, evaluate
from ...units import CM_PER_METRE
from ..statements import Case, FloatArray, near
from .problems import DEG2_PER_RAD2, PROBLEMS, WEIGHT, rocker_function

#: How a printed linkage is rounded before its error is judged.
ROUNDED = (
    "with each printed number of the linkage changed by at most half a unit of its last digit, so that the result comes "
    "nearest to the stated one"
)
#: Numbers of crank angles, in steps of whole or half degrees, that the errors of the rocker functions may refer to.
NUMBERS = tuple(n for n in range(18, 361) if 720 % n == 0)


def printed_error(name: str) -> float:
    """Return the error of the printed linkage with its misprint mended, in the unit of print."""
    return PROBLEMS[name].linkage_error(PROBLEMS[name].linkage)


def share_of_stated(name: str) -> float:
    """Return the printed linkage's error divided by the stated error, for the reading that brings this ratio nearest to 1."""
    p = PROBLEMS[name]
    assert p.error is not None
    return min(
        (error / p.error for error in errors_by_reading(name, p.linkage).values()), key=lambda share: abs(share - 1.0)
    )


def errors_by_reading(name: str, linkage: Linkage) -> dict[str, float]:
    """Return the error of a linkage (unit of print) for each reading of the text.

    Only the rocker functions have more than one reading.
    """
    if not isinstance(PROBLEMS[name].task, RockerFunction):
        return {"": PROBLEMS[name].linkage_error(linkage)}
    found: dict[str, float] = {}
    for n in NUMBERS:
        squares = DEG2_PER_RAD2 * evaluate(rocker_function(n), linkage).errors ** 2
        turned, angles, end = 360.0 * np.arange(n) / n, f"; {n} crank angles", float(squares[0])
        if name == "rocker":
            found |= {angles: squares.sum(), f"{angles} and the end of the turn": squares.sum() + end}
            continue
        for ends, within in (
            ("", (turned >= 60) & (turned <= 260)),
            (" without its ends", (turned > 60) & (turned < 260)),
        ):
            window, rest = squares[within].sum(), squares[~within].sum()
            found |= {
                f"{angles}, window{ends}": window + rest / WEIGHT,
                f"{angles} and the end of the turn, window{ends}": window + (rest + end) / WEIGHT,
                f"{angles} a turn, those within the window{ends} alone": window,
            }
    return found


def half_units(linkage: Linkage) -> FloatArray:
    """Return half a unit of the last printed digit of each dimension of a linkage (m, rad), 0 if it is not printed."""
    si = np.array([1.0 / CM_PER_METRE] * 7 + [radians(1.0)] * 3)
    digits = (Decimal(repr(round(float(x), 6))) for x in linkage.vector / si)
    return si * [0.5 * 10.0 ** int(x.as_tuple().exponent) if x else 0.0 for x in digits]


def rounding_range(name: str) -> tuple[str, float, float]:
    """Return the reading that comes nearest to the stated error, and the least and the greatest error that it allows.

    The readings are those of `errors_by_reading`. Each printed dimension may be off by up to half a unit of its last digit.
    """
    p = PROBLEMS[name]
    assert p.error is not None
    off, stated = half_units(p.linkage), p.error
    if isinstance(p.task, UntimedPath):
        # the crank's phase does not change the curve
        off[8] = 0.0

    def errors(change: ArrayLike) -> dict[str, float]:
        return errors_by_reading(name, Linkage.from_vector(p.linkage.vector + off * np.asarray(change), 1))

    # the greatest error is at a corner, the least near one or near the middle
    signs = [(-1.0, 1.0) if half else (0.0,) for half in off]
    found = {corner: errors(corner) for corner in {*product(*signs), (0.0,) * len(off)}}
    spans = {r: (min(e[r] for e in found.values()), max(e[r] for e in found.values())) for r in errors(0.0 * off)}
    reading = min(spans, key=lambda r: abs(float(np.clip(stated, *spans[r])) - stated))
    start = min(found, key=lambda corner: found[corner][reading])
    least = minimize(lambda change: errors(change)[reading], start, method="L-BFGS-B", bounds=[(-1.0, 1.0)] * len(off))
    return reading, float(least.fun), float(spans[reading][1])


def judge_stated_error(label: str, stated: str, name: str, why: str = "no rounding gives the stated value") -> Case:
    """Judge whether a stated error lies in the range of `rounding_range`."""
    reading, least, greatest = rounding_range(name)
    return near(
        f"{label}{reading}; rounding allows {least:.2f} to {greatest:.2f}",
        stated,
        np.clip(float(stated), least, greatest),
        unit=PROBLEMS[name].unit,
        why=why,
    )
