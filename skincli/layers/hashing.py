"""Float64 twins of shaders/lib/{hash,noise,band}.glsl."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

CORNERS = np.array([[i & 1, (i >> 1) & 1, i >> 2] for i in range(8)])
NEIGHBORS = np.array([[i % 3, (i // 3) % 3, i // 9] for i in range(27)]) - 1


def hash_cell(cell: Cells, seed: int) -> Array:
    """Return four independent numbers in [0, 1) of each cell.

    Parameters
    ----------
    cell : (..., 3) integers; what exceeds 32 bits is cut off
    seed : likewise

    Returns
    -------
    (..., 4) multiples of 2^-24

    References
    ----------
    [Jarzynski2020, "Hash Functions for GPU Rendering", pcg4d]
    """
    mask = 0xFFFFFFFF
    words = [(cell[..., axis] & mask).astype(np.uint32) for axis in range(3)]
    words.append(np.full(words[0].shape, seed & mask, np.uint32))
    # Arrays of uint32 wrap around silently, which is what the hash is made of.
    x, y, z, w = (word * np.uint32(1664525) + np.uint32(1013904223) for word in words)
    for last in (False, True):
        x = x + y * w
        y = y + z * x
        z = z + x * y
        w = w + y * z
        if not last:
            x, y, z, w = (word ^ (word >> np.uint32(16)) for word in (x, y, z, w))
    return (np.stack([x, y, z, w], axis=-1) >> np.uint32(8)).astype(np.float64) * 2.0**-24


def split(x: Array) -> tuple[Cells, Array]:
    """Return the cell of each position, as integers, and the fraction in it."""
    whole = np.floor(x)
    return whole.astype(np.int64), x - whole


def smoothstep(low: float, high: float | Array, x: Array) -> Array:
    """Return GLSL's smoothstep."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _corner_weights(fraction: Array) -> Array:
    """Return (8, ...): the quintic weights of a cell's corners, which sum to 1."""
    far = fraction**3 * (fraction * (fraction * 6 - 15) + 10)
    return np.stack([np.prod(np.where(corner == 1, far, 1 - far), axis=-1) for corner in CORNERS])


def gradient_noise(cell: Cells, fraction: Array, seed: int) -> Array:
    """Return (n,) gradient noise, about -1 to 1, mean 0."""
    total = np.zeros(fraction.shape[:-1])
    for weight, corner in zip(_corner_weights(fraction), CORNERS, strict=True):
        gradient = 2 * hash_cell(cell + corner, seed)[..., :3] - 1
        total += weight * np.sum(gradient * (fraction - corner), axis=-1)
    return total


def value_noise(cell: Cells, fraction: Array, seed: int) -> Array:
    """Return (n, 3) independent value noises, each -1 to 1."""
    total = np.zeros(fraction.shape)
    for weight, corner in zip(_corner_weights(fraction), CORNERS, strict=True):
        total += weight[..., None] * (2 * hash_cell(cell + corner, seed)[..., :3] - 1)
    return total


def warp_cells(x: Array, amount: float, seed: int) -> Array:
    """Move x, in cells, by up to `amount` cells."""
    return x + amount * value_noise(*split(x), ~seed)


def resolved(size: float, footprint: Array) -> Array:
    """Return 1 where a feature of `size` mm is well resolved by texels of `footprint` mm, 0 where it is not."""
    return smoothstep(1, 3, size / np.maximum(footprint, 1e-9))


def levels(t: Array, ends: tuple[float, ...], blur: Array | float) -> Array:
    """Stretch t so that ends[0] becomes 0 and ends[1] 1, smoothly; half the step is at least `blur` wide."""
    low, high = ends
    half_width = np.maximum(0.5 * abs(high - low), np.maximum(blur, 1e-4))
    direction = -0.5 if high < low else 0.5
    x = np.clip(0.5 + direction * (t - 0.5 * (low + high)) / half_width, 0, 1)
    return x * x * (3 - 2 * x)
