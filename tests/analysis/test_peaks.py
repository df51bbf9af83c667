"""The own short form of SciPy's `find_peaks`, whose import takes longer than a response, against SciPy's."""

import numpy as np
import pytest
from scipy.signal import find_peaks

from analysis.numerics.peaks import peaks


@pytest.mark.parametrize("seed", range(20))
def test_peaks_are_those_of_scipy(seed: int) -> None:
    # few different values: many are equal, flat peaks and ends among them
    values = np.random.default_rng(seed).integers(0, 6, size=60).astype(float)
    places, properties = find_peaks(values, prominence=0.0)
    assert len(places) > 3
    assert peaks(values) == list(zip(places.tolist(), properties["prominences"].tolist()))


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 2.0, 2.0]])
def test_no_peak(values: list[float]) -> None:
    assert peaks(np.array(values)) == []
