"""Float64 twins of shaders/lib/{hash,noise,band}.glsl."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

CORNERS = np.array([[i & 1, (i >> 1) & 1, i >> 2] for i in range(8)])
#: Brings simplex noise to the range of the others; in lib/noise.glsl too.
SIMPLEX_STRETCH = 64.0
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


def wrap_cell(cell: Cells, period: int) -> Cells:
    """Return the cell that stands for `cell` where patterns repeat every `period` cells along x and y; 0: nowhere."""
    if period == 0:
        return cell
    return np.concatenate([cell[..., :2] % period, cell[..., 2:]], axis=-1)


def gradient_noise(cell: Cells, fraction: Array, period: int, seed: int) -> Array:
    """Return (n,) gradient noise, about -1 to 1, mean 0."""
    total = np.zeros(fraction.shape[:-1])
    for weight, corner in zip(_corner_weights(fraction), CORNERS, strict=True):
        gradient = 2 * hash_cell(wrap_cell(cell + corner, period), seed)[..., :3] - 1
        total += weight * np.sum(gradient * (fraction - corner), axis=-1)
    return total


def value_noise(cell: Cells, fraction: Array, period: int, seed: int) -> Array:
    """Return (n, 3) independent value noises, each -1 to 1."""
    total = np.zeros(fraction.shape)
    for weight, corner in zip(_corner_weights(fraction), CORNERS, strict=True):
        total += weight[..., None] * (2 * hash_cell(wrap_cell(cell + corner, period), seed)[..., :3] - 1)
    return total


def simplex_noise(cell: Cells, fraction: Array, period: int, seed: int) -> Array:
    """Return (n,) simplex noise, about -1 to 1, mean 0: bumps at the corners of tetrahedra.

    Parameters
    ----------
    cell, fraction : the place, split, in steps of the lattice
    period : thirds of the number of steps after which it repeats along x and y; 0: never

    References
    ----------
    [Perlin2001, "Noise Hardware"]
    """
    # The skewed place is cell + sum / 3; thirds of the cell's sum keep it exact.
    total = cell.sum(axis=-1, keepdims=True)
    carry, skewed = split(fraction + ((total % 3) + fraction.sum(axis=-1, keepdims=True)) / 3)
    steps = total // 3 + carry
    corner = cell + steps
    lag = steps.sum(axis=-1, keepdims=True)
    # From the corner, unskewed, to the place: corner - (sum of corner) / 6.
    away = fraction - steps + (total + lag) / 6
    order = np.stack(
        [
            (skewed[..., a] > skewed[..., b]).astype(int) + (skewed[..., a] >= skewed[..., c])
            for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        ],
        axis=-1,
    )
    result = np.zeros(cell.shape[:-1])
    for least in (3, 2, 1, 0):
        offset = (order >= least).astype(np.int64)
        to = away - offset + offset.sum(axis=-1, keepdims=True) / 6
        gradient = 2 * hash_cell(wrap_simplex(corner + offset, period), seed)[..., :3] - 1
        bump = np.maximum(0.5 - np.sum(to**2, axis=-1), 0) ** 4
        result += bump * np.sum(gradient * to, axis=-1)
    return SIMPLEX_STRETCH * result


def wrap_simplex(corner: Cells, period: int) -> Cells:
    """Return the corner of tetrahedra that stands for `corner` where 3 * period steps along x and y repeat."""
    if period == 0:
        return corner
    i, j, k = np.moveaxis(corner, -1, 0)
    x, y = (5 * i - j - k) // (18 * period), (5 * j - i - k) // (18 * period)
    shift = np.stack([4 * x + y, x + 4 * y, x + y], axis=-1)
    return corner - period * shift


def warp_position(position: Array, amount: float, scale: float, period: int, seed: int) -> Array:
    """Move positions, mm, by up to `amount` mm along each axis, in swirls of `scale` mm."""
    return position + amount * value_noise(*split(position / scale), period, ~seed)


def resolved(size: float, footprint: Array) -> Array:
    """Return how much of a feature of `size` mm is left in the mean over a texel of `footprint` mm, 0 to 1."""
    return np.exp(-np.minimum((footprint / max(size, 1e-9)) ** 2, 80))


def levels(t: Array, ends: tuple[float, ...], blur: Array | float) -> Array:
    """Stretch t so that ends[0] becomes 0 and ends[1] 1, smoothly; ends in falling order invert.

    Parameters
    ----------
    t : the raw pattern
    ends : what becomes 0 and 1
    blur : half the width, in t, of the step that a texel makes of a hard one
    """
    low, high = ends
    half_width = np.maximum(np.hypot(0.5 * (high - low), blur), 1e-4)
    direction = -0.5 if high < low else 0.5
    x = np.clip(0.5 + direction * (t - 0.5 * (low + high)) / half_width, 0, 1)
    return x * x * (3 - 2 * x)
