"""Fourier series of real functions."""

import numpy as np
import pytest

from analysis.numerics.fourier import FourierSeries
from linkwork.errors import InputError

X = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
SERIES = FourierSeries(np.array([0.5, -1.0, 0.25]), np.array([0.0, 2.0, -0.75]))


def test_samples_and_series_are_the_same() -> None:
    again = FourierSeries.from_samples(SERIES(X), 2)
    assert again.cos == pytest.approx(SERIES.cos, abs=1e-15)
    assert again.sin == pytest.approx(SERIES.sin, abs=1e-15)
    assert FourierSeries.from_samples(SERIES(X)).order == 7


def test_value_is_the_sum() -> None:
    expected = 0.5 - np.cos(X) + 2.0 * np.sin(X) + 0.25 * np.cos(2.0 * X) - 0.75 * np.sin(2.0 * X)
    assert SERIES(X) == pytest.approx(expected, abs=1e-14)


def test_exponential_form_has_the_same_value() -> None:
    c = SERIES.exponential
    value = sum(c[k + 2] * np.exp(1j * k * X) for k in range(-2, 3))
    assert value.real == pytest.approx(SERIES(X), abs=1e-14)
    assert value.imag == pytest.approx(np.zeros(16), abs=1e-14)


def test_derivative_sum_and_product() -> None:
    slope = (SERIES(X + 1e-6) - SERIES(X - 1e-6)) / 2e-6
    assert SERIES.derivative()(X) == pytest.approx(slope, abs=1e-8)
    assert (SERIES + FourierSeries(np.arange(5.0), np.zeros(5))).order == 4
    assert (2.0 * SERIES + 1.0)(X) == pytest.approx(2.0 * SERIES(X) + 1.0)
    assert SERIES.to_order(1)(X) == pytest.approx(0.5 - np.cos(X) + 2.0 * np.sin(X), abs=1e-14)


def test_amplitudes() -> None:
    assert SERIES.amplitudes == pytest.approx([0.5, np.hypot(1.0, 2.0), np.hypot(0.25, 0.75)])


@pytest.mark.parametrize(
    ("cos", "sin", "message"), [([1.0, 2.0], [0.0], "shape"), ([np.nan], [0.0], "not finite"), ([], [], "shape")]
)
def test_bad_coefficients_are_refused(cos: list[float], sin: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        FourierSeries(np.array(cos), np.array(sin))


def test_more_harmonics_than_samples_are_refused() -> None:
    with pytest.raises(InputError, match="no more than order 7"):
        FourierSeries.from_samples(SERIES(X), 8)
