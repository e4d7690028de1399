"""Metrics on pictures whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skincli import color, metrics


def _noise(seed: int, shape: tuple[int, ...] = (24, 32, 3)) -> np.ndarray:
    return np.random.default_rng(seed).random(shape)


def test_equal_pictures_do_not_differ() -> None:
    a = _noise(1)
    assert metrics.relative_rmse(a, a) == 0.0
    assert metrics.max_abs(a, a) == 0.0
    assert metrics.p99(a, a) == 0.0
    assert metrics.share_differing(a, a, 0.0) == 0.0
    assert metrics.energy_drift(a, a) == 0.0
    mean, error = metrics.flip(a, a)
    assert mean == 0.0
    assert error.shape == (24, 32)


def test_relative_rmse_is_a_scale() -> None:
    a = _noise(2)
    assert metrics.relative_rmse(1.1 * a, a) == pytest.approx(0.1, rel=1e-12)
    assert metrics.relative_rmse(0 * a, a) == pytest.approx(1.0)
    assert metrics.relative_rmse(a, 0 * a) == math.inf
    assert metrics.relative_rmse(0 * a, 0 * a) == 0.0


def test_energy_drift_is_signed() -> None:
    a = _noise(3)
    assert metrics.energy_drift(0.75 * a, a) == pytest.approx(-0.25, rel=1e-12)
    assert metrics.energy_drift(0 * a, 0 * a) == 0.0


def test_counts_and_percentile() -> None:
    reference = np.zeros((10, 10, 3))
    test = reference.copy()
    test[0, 0, 1] = 0.5
    test[0, 1, :] = 0.01
    assert metrics.max_abs(test, reference) == 0.5
    assert metrics.share_differing(test, reference, 0.005) == pytest.approx(0.02)
    assert metrics.share_differing(test, reference, 0.01) == pytest.approx(0.01)
    error = np.arange(101.0).reshape(1, 101, 1)
    assert metrics.p99(error, 0 * error) == 99.0


def test_mask_confines_every_number() -> None:
    reference, test = _noise(4), _noise(4)
    test[:, 16:] += 1.0
    left = np.zeros((24, 32), bool)
    left[:, :16] = True
    assert metrics.relative_rmse(test, reference, left) == 0.0
    assert metrics.max_abs(test, reference, left) == 0.0
    assert metrics.max_abs(test, reference, ~left) == pytest.approx(1.0)
    assert metrics.share_differing(test, reference, 0.0, ~left) == 1.0
    assert metrics.energy_drift(test, reference, left) == 0.0
    nothing = np.zeros((24, 32), bool)
    assert math.isnan(metrics.relative_rmse(test, reference, nothing))
    assert math.isnan(metrics.flip(test, reference, nothing)[0])


def test_nonfinite_values_never_pass() -> None:
    reference = _noise(5)
    test = reference.copy()
    test[3, 4, 0], test[5, 6, 1] = np.nan, np.inf
    assert metrics.nonfinite_count(test) == 2
    assert metrics.nonfinite_count(reference) == 0
    assert math.isnan(metrics.relative_rmse(test, reference))
    assert math.isnan(metrics.max_abs(test, reference))
    assert metrics.share_differing(test, reference, 1.0) == pytest.approx(2 / (24 * 32))


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match="different shape"):
        metrics.max_abs(np.zeros((2, 2, 3)), np.zeros((2, 3, 3)))
    with pytest.raises(ValueError, match=r"\(h, w, 3\)"):
        metrics.flip(np.zeros((8, 8, 4)), np.zeros((8, 8, 4)))


def test_flip_of_known_pictures() -> None:
    black, white = np.zeros((48, 48, 3)), np.ones((48, 48, 3))
    assert metrics.flip(black, white)[0] == pytest.approx(0.967392, abs=1e-5)
    # FLIP's largest color distance is green against blue, by definition 1.
    assert metrics.flip(white * (0, 1, 0), white * (0, 0, 1))[0] == pytest.approx(1.0, abs=1e-5)
    # Clipped as a screen clips.
    assert metrics.flip(3 * white, white)[0] == 0.0


def test_flip_takes_linear_values() -> None:
    """On flat grays FLIP has a closed form in L*; it comes out only if the input is read as linear."""

    def hunt(rgb: tuple[float, float, float]) -> np.ndarray:
        lab = color.rgb_to_lab(rgb)
        return lab * np.array([1, 0.01 * lab[0], 0.01 * lab[0]])

    apart = hunt((0, 1, 0)) - hunt((0, 0, 1))
    largest = (abs(apart[0]) + math.hypot(apart[1], apart[2])) ** 0.7
    steps = color.rgb_to_lab((0.6, 0.6, 0.6))[0] - color.rgb_to_lab((0.5, 0.5, 0.5))[0]
    flat = np.ones((48, 48, 3))
    mean, _ = metrics.flip(0.6 * flat, 0.5 * flat)
    assert mean == pytest.approx(0.95 * steps**0.7 / (0.4 * largest), rel=2e-3)


def test_flip_is_symmetric_and_its_mean_is_the_maps() -> None:
    a, b = _noise(6), _noise(7)
    forth, error = metrics.flip(a, b)
    back, _ = metrics.flip(b, a)
    assert forth == pytest.approx(back, rel=1e-5)
    assert forth == pytest.approx(float(error.mean(dtype=np.float64)), rel=1e-12)
    inside = np.zeros((24, 32), bool)
    inside[4:9, 5:20] = True
    assert metrics.flip(a, b, inside)[0] == pytest.approx(float(error[inside].mean(dtype=np.float64)), rel=1e-12)
