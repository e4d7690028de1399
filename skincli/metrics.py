"""How far a picture is from its reference, as numbers.

Pictures are (h, w, c) arrays of equal shape. `mask` is (h, w), True where pixels count (usually the silhouette);
without it every pixel counts. A number over no pixels is NaN. Non-finite pixels make every mean and maximum
non-finite, so that no threshold passes by accident.
"""

from __future__ import annotations

import math

import numpy as np
import OpenImageIO as oiio  # noqa: N813
from numpy.typing import ArrayLike, NDArray

FLIP_PPD = 67.02
"""Pixels per degree of FLIP's observer: a 3840-pixel, 0.7 m wide screen seen from 0.7 m."""


def _chosen(test: ArrayLike, reference: ArrayLike, mask: ArrayLike | None) -> tuple[NDArray, NDArray]:
    """Return both pictures in float64, restricted to the mask; ValueError where their shapes differ."""
    t, r = np.asarray(test, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if t.shape != r.shape:
        raise ValueError(f"pictures of different shape cannot be compared: {t.shape} and {r.shape}")
    if mask is None:
        return t, r
    keep = np.asarray(mask, dtype=bool)
    return t[keep], r[keep]


def _error(test: ArrayLike, reference: ArrayLike, mask: ArrayLike | None) -> NDArray:
    t, r = _chosen(test, reference, mask)
    with np.errstate(invalid="ignore"):  # Inf - Inf is a NaN that the caller is meant to see
        return np.abs(t - r)


def _ratio(numerator: float, denominator: float) -> float:
    """Return the quotient, 1 for 0/0 and infinity for x/0: a black reference that is met exactly is no error."""
    if denominator == 0:
        return 1.0 if numerator == 0 else math.inf
    return numerator / denominator


def relative_rmse(test: ArrayLike, reference: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the root mean square error over the root mean square of the reference.

    Returns
    -------
    float
        0 for equal pictures; infinity where the reference is black and the test is not.
    """
    t, r = _chosen(test, reference, mask)
    if t.size == 0:
        return math.nan
    with np.errstate(invalid="ignore"):
        error = float(np.sqrt(np.mean((t - r) ** 2)))
    return 0.0 if error == 0 else _ratio(error, float(np.sqrt(np.mean(r**2))))


def max_abs(test: ArrayLike, reference: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the largest absolute difference, in the pictures' unit."""
    error = _error(test, reference, mask)
    return float(error.max()) if error.size else math.nan


def p99(test: ArrayLike, reference: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the absolute difference that 99 % of the values stay within, in the pictures' unit."""
    error = _error(test, reference, mask)
    return float(np.percentile(error, 99)) if error.size else math.nan


def share_differing(test: ArrayLike, reference: ArrayLike, tolerance: float, mask: ArrayLike | None = None) -> float:
    """Return the share of pixels, in [0, 1], in which some channel differs by more than `tolerance` or is NaN."""
    differs = ~(_error(test, reference, mask) <= tolerance)
    if differs.size == 0:
        return math.nan
    return float(differs.any(axis=-1).mean())


def nonfinite_count(picture: ArrayLike) -> int:
    """Return how many values of the picture are NaN or infinite."""
    values = np.asarray(picture)
    return int(values.size - np.count_nonzero(np.isfinite(values)))


def energy_drift(test: ArrayLike, reference: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the sum of the test over the sum of the reference, minus 1: light gained (+) or lost (-)."""
    t, r = _chosen(test, reference, mask)
    if t.size == 0:
        return math.nan
    with np.errstate(invalid="ignore"):
        return _ratio(float(t.sum()), float(r.sum())) - 1.0


def flip(test: ArrayLike, reference: ArrayLike, mask: ArrayLike | None = None) -> tuple[float, NDArray[np.float32]]:
    """Return LDR-FLIP: how strongly a person who switches between both pictures sees the difference.

    Parameters
    ----------
    test, reference : (h, w, 3) display-linear Rec.709 in [0, 1]: after exposure and display transform, before the sRGB
        curve; values outside are clipped, as a screen clips them
    mask : (h, w); only the mean obeys it, the map covers the whole picture, since FLIP filters over neighbors

    Returns
    -------
    float
        Mean FLIP inside the mask, 0 (equal) to 1; about 0.97 for black against white.
    NDArray[np.float32]
        (h, w) map of FLIP.

    Notes
    -----
    Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", HPG 2020, as OpenImageIO implements it, for
    an observer at `FLIP_PPD` pixels per degree.

    Raises
    ------
    ValueError
        The pictures differ in shape or are not (h, w, 3).
    """
    t, r = _chosen(test, reference, None)
    if t.ndim != 3 or t.shape[2] != 3:
        raise ValueError(f"FLIP compares (h, w, 3) pictures, not {t.shape}")
    difference = oiio.ImageBufAlgo.FLIP_diff(_display(r), _display(t), hdr=0, ppd=FLIP_PPD)
    if difference.has_error:
        raise ValueError(f"FLIP failed: {difference.geterror()}")
    errors = np.asarray(difference.get_pixels(oiio.FLOAT), dtype=np.float32)[..., 0]
    inside = errors if mask is None else errors[np.asarray(mask, dtype=bool)]
    return (float(inside.mean(dtype=np.float64)) if inside.size else math.nan), errors


def _display(picture: NDArray) -> oiio.ImageBuf:
    """Wrap a picture for FLIP, marked as linear: an unmarked buffer would depend on OpenImageIO's default."""
    buffer = oiio.ImageBuf(np.ascontiguousarray(np.clip(picture, 0.0, 1.0), dtype=np.float32))
    buffer.specmod().set_colorspace("lin_rec709_scene")
    return buffer
