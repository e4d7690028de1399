"""Pictures made ready for blending that keeps their histogram [Heitz2018]: Gaussian values, and the way back.

Mixtures of a picture's patches lose contrast, and so would those of any values but Gaussian ones, whose mixture is
Gaussian again and needs no more than its variance restored. So each channel is exchanged for a Gaussian one of the same
order, patches are mixed there, and a table leads back to the picture's own values.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage, special

from skincli import diskcache

Array = NDArray[np.float64]
Single = NDArray[np.float32]

#: Longer sides are reduced to this one: sorting is dear, and a patch has a third of a side.
MAX_SIDE = 2048
#: Gaussian values beyond this many standard deviations, one in 16 000, are cut off.
REACH = 4.0
#: Entries of a row of the table.
ENTRIES = 1024
#: Share of the picture at each of its edges that gives way to the picture's middle, so that opposite edges meet.
BORDER = 1 / 8
#: Scale of the neighborhood that decides between equal values, texels.
NEIGHBORHOOD = 2.0
#: Channels of smaller range than this share of the widest are taken as constant.
FLAT = 1e-6


def levels_of(pixels: Array) -> list[Array]:
    """Return the levels of detail of (h, w, c) pixels, down to 1x1: means of 2x2, the odd row or column left out."""
    levels = [np.asarray(pixels, np.float64)]
    while max(levels[-1].shape[:2]) > 1:
        height, width, channels = levels[-1].shape
        rows, columns = max(height // 2, 1), max(width // 2, 1)
        whole = levels[-1][: rows * min(height, 2), : columns * min(width, 2)]
        levels.append(whole.reshape(rows, min(height, 2), columns, min(width, 2), channels).mean(axis=(1, 3)))
    return levels


def gaussian_of(values: Array) -> Array:
    """Return (h, w) standard normal values in the order of `values`, (h, w).

    Equal values, of which masks are made, are put in the order of their neighborhoods: in a plain area the result rises
    towards the higher one beside it, so that mixtures move its border instead of making noise. What is equal in that
    too receives one value, the mean.
    """
    height, width = values.shape
    waves = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None])
    # Falls off by a power of the distance, so that it tells even the middle of a wide plain area.
    around = np.fft.irfft2(np.fft.rfft2(values) * np.exp(-2 * np.pi * NEIGHBORHOOD * waves), s=values.shape)
    around = np.round(around / max(np.ptp(values), 1e-30), 9)
    order = np.lexsort((around.ravel(), values.ravel()))
    scores = special.ndtri((np.arange(values.size) + 0.5) / values.size)
    rises = (np.diff(values.ravel()[order]) > 0) | (np.diff(around.ravel()[order]) != 0)
    starts = np.append(0, np.flatnonzero(rises) + 1)
    counts = np.diff(np.append(starts, values.size))
    result = np.empty(values.size)
    result[order] = np.repeat(np.add.reduceat(scores, starts) / counts, counts)
    return np.clip(result.reshape(values.shape), -REACH, REACH)


def join_edges(values: Array) -> Array:
    """Return (h, w) normal values whose opposite edges meet: there the middle takes their place."""
    for axis, side in enumerate(values.shape):
        away = (0.5 - np.abs((np.arange(side) + 0.5) / side - 0.5)) / BORDER
        share = np.clip(1 - away, 0, 1)
        middle = share * share * (3 - 2 * share)
        if axis == 0:
            middle = middle[:, None]
        mixed = (1 - middle) * values + middle * np.roll(values, side // 2, axis)
        values = mixed / np.hypot(1 - middle, middle)
    return values


def _inverse(values: Array, spreads: ArrayLike) -> Array:
    """Return (rows, ENTRIES): for each standard deviation in `spreads` the mean of what normal values lead back to.

    Entries are of -REACH to REACH; row by row, a value stands for normal ones spread about it.
    """
    step = 2 * REACH / (ENTRIES - 1)
    margin = round(REACH / step)
    normal = step * (np.arange(ENTRIES + 2 * margin) - margin) - REACH
    ranks = special.ndtr(normal) * values.size - 0.5
    exact = np.interp(ranks, np.arange(values.size), np.sort(values, axis=None))
    # No spread at all is taken as a hundredth of an entry, which changes nothing.
    widths = np.maximum(np.asarray(spreads) / step, 0.01)
    rows = [ndimage.gaussian_filter1d(exact, width, mode="nearest", truncate=6) for width in widths]
    return np.array(rows)[:, margin : margin + ENTRIES]


def prepare(pixels: ArrayLike) -> dict[str, Single]:
    """Return a picture as Gaussian values and the table that leads back to its own.

    Parameters
    ----------
    pixels : (h, w, 1 or 4)

    Returns
    -------
    gaussian : (h, w, 1 or 4), independent standard normal channels that repeat, in units of 2 REACH: from -0.5 to 0.5
    table : (levels + 6, ENTRIES, 4). Row l has, for the values -0.5 to 0.5 of level of detail l, the mean of the
        channel's own values: coordinates along four axes, one a channel, along which the picture's colors do not
        correlate. These axes are the next 4 rows, constant along the row; the last two are the lowest and the highest
        value of each of the picture's channels. What a picture of one channel lacks is 0

    References
    ----------
    [Heitz2018], [Deliot2019, decorrelated channels and the table of each level of detail]
    """
    from skincli import images  # here, for OpenImageIO takes its time to load

    picture = images.reduce_to(pixels, MAX_SIDE).astype(np.float64)
    height, width, channels = picture.shape
    colors = picture.reshape(-1, channels)
    axes = np.eye(channels)
    if channels > 1:
        axes = np.linalg.eigh(np.cov(colors, rowvar=False, bias=True))[1].T
        # Either direction of an axis is right; one is chosen, so that every machine makes the same picture.
        axes *= np.sign(axes[np.arange(channels), np.abs(axes).argmax(axis=1)])[:, None]
    # Rounded, so that equal colors stay equal.
    along = np.round(colors @ axes.T, 9).reshape(height, width, channels)
    extents = np.ptp(along, axis=(0, 1))
    gaussian = np.zeros(along.shape)
    for channel in range(channels):
        if extents[channel] > FLAT * extents.max():
            # Joining moves the mean a little, and the variance; so the result is put in order again.
            gaussian[..., channel] = gaussian_of(join_edges(gaussian_of(along[..., channel])))
    found = levels_of(gaussian)
    table = np.zeros((len(found) + 6, ENTRIES, 4))
    for channel in range(channels):
        left = np.array([np.mean(level[..., channel] ** 2) for level in found])
        spreads = np.sqrt(np.clip(1 - left / max(left[0], 1e-12), 0, 1))
        table[: len(found), :, channel] = _inverse(along[..., channel], spreads)
        table[len(found) + channel, :, :channels] = axes[channel]
    table[-2, :, :channels] = colors.min(axis=0)
    table[-1, :, :channels] = colors.max(axis=0)
    return {"gaussian": (gaussian / (2 * REACH)).astype(np.float32), "table": table.astype(np.float32)}


def kept(key: str, make: Callable[[], ArrayLike]) -> dict[str, Single]:
    """Return `prepare` of the pixels that `make` returns, kept on disk.

    Parameters
    ----------
    key : everything the pixels depend on
    """
    # The source is part of the key: another method makes another entry.
    digest = hashlib.blake2b(Path(__file__).read_bytes(), digest_size=16).hexdigest()
    return diskcache.arrays("histogram", f"{digest} {key}", lambda: prepare(make()))
