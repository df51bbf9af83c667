"""Own short forms of two functions of SciPy, whose import takes longer than what they do, against these."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks
from scipy.stats import qmc

from analysis.numerics.peaks import peaks
from analysis.numerics.sobol import sobol


@pytest.mark.parametrize("size", range(1, 12))
def test_sobol_is_that_of_scipy(size: int) -> None:
    for number in (0, 3):
        assert sobol(size, 64, number).tolist() == qmc.Sobol(size, rng=number).random(64).tolist()


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
