"""Find the peaks of a series of values and their prominences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def peaks(values: NDArray[np.float64]) -> list[tuple[int, float]]:
    """Return index and prominence of each peak inside a series; of a flat peak, the index of its middle.

    On each side of a peak, take the minimum between the peak and the next higher value or the end of the series: the prominence
    is the peak's height above the higher of these two minima. The results are those of `scipy.signal.find_peaks`, whose import
    takes longer than the computation of a response curve.

    >>> peaks(np.array([0.0, 3.0, 1.0, 2.0, 2.0, 0.5]))
    [(1, 2.5), (3, 1.0)]
    """
    first = np.flatnonzero(np.append(len(values) > 0, values[1:] != values[:-1]))
    last = np.append(first[1:], len(values)) - 1
    level = values[first]
    tops = 1 + np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:]))
    found = []
    for i in ((first[tops] + last[tops]) // 2).tolist():
        sides = values[i::-1], values[i:]
        lows = [side[: np.argmax(side > values[i]) or None].min() for side in sides]
        found.append((i, float(values[i] - max(lows))))
    return found
