"""Kernels of the blur: they sum to one, are as wide as asked for, and shift nothing."""

from __future__ import annotations

import numpy as np
import pytest

from skincli.passes.blur import window_taps


@pytest.mark.parametrize("width", [0, 1, 2, 3, 4.5, 8, 13, 15, 256])
def test_a_window_sums_to_one(width: float) -> None:
    taps = np.array(window_taps(width))
    np.testing.assert_allclose(taps[0] + 2 * taps[1:].sum(axis=0), 1, atol=1e-12)
    assert (taps >= 0).all()


@pytest.mark.parametrize(("width", "taps"), [(0, 1), (1, 1), (2, 3), (3, 3), (8, 9), (13, 13), (15, 15)])
def test_a_window_reads_its_width(width: float, taps: int) -> None:
    assert 2 * len(window_taps(width)) - 1 == taps


def test_an_even_window_has_half_weights_at_its_ends() -> None:
    even = np.array(window_taps(8))[:, 0]
    offsets = np.arange(5)
    full = np.exp(-0.5 * (offsets * 2 / 4) ** 2)
    np.testing.assert_allclose(even[:4] / even[0], full[:4])
    np.testing.assert_allclose(even[4] / even[0], full[4] / 2)


def test_a_wider_window_blurs_more() -> None:
    def variance(width: float) -> float:
        taps = np.array(window_taps(width))[:, 0]
        return float(2 * (taps * np.arange(len(taps)) ** 2).sum())

    spreads = [variance(width) for width in (0, 1, 2, 3, 4, 5, 8, 13, 21)]
    assert spreads[:2] == [0, 0]
    assert np.all(np.diff(spreads[1:]) > 0)
