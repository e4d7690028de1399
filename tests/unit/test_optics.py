"""Widths of the diffusion profile against numbers worked out from the published fits."""

from __future__ import annotations

import numpy as np
import pytest

from skincli.optics.diffusion import burley_width, gaussian_sigma


def test_widths_by_the_published_fits() -> None:
    """[Christensen2015]: s = 1.9 - A + 3.5 (A - 0.8)^2 for mfp, 3.5 + 100 (A - 0.33)^4 for dmfp."""
    np.testing.assert_allclose(burley_width([1.1, 1.0, 1.0], [0.8, 0.3, 1.0], "mfp"), [1.0, 1 / 2.475, 1 / 1.04])
    np.testing.assert_allclose(burley_width([3.5, 7.0, 1.0], [0.33, 0.33, 0.83], "dmfp"), [1.0, 2.0, 1 / 9.75])
    np.testing.assert_array_equal(burley_width([1.0, 2.0, 3.0], [0.1, 0.2, 0.3], "d"), [1.0, 2.0, 3.0])


def test_the_gaussian_has_the_profiles_second_moment() -> None:
    d = 0.7
    r = np.linspace(1e-6, 60 * d, 400_001)
    profile = (np.exp(-r / d) + np.exp(-r / (3 * d))) / (8 * np.pi * d * r)
    weight = 2 * np.pi * r * profile
    assert np.trapezoid(weight, r) == pytest.approx(1, abs=1e-3)
    sigma = gaussian_sigma(np.array(d))
    assert np.trapezoid(weight * r**2, r) == pytest.approx(2 * sigma**2, rel=1e-3)
