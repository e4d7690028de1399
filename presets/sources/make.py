"""Make the source images of the presets: `python presets/sources/make.py [FOLDER]`.

Every image tiles without a seam and is drawn from a fixed seed. They hold what a sum of noises does not: the net of
furrows of human skin, the crowded pigment sacs of an octopus, the branching of veins.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse, spatial

from skincli.images import write_png

Array = NDArray[np.float64]

SIZE = 512  # texels a side


def band(seed: int, wavelength: float, width: float = 0.5, size: int = SIZE) -> Array:
    """Return (size, size) periodic noise, mean 0, deviation 1, around a wavelength in texels; width in octaves."""
    spectrum = np.fft.fft2(np.random.default_rng(seed).standard_normal((size, size)))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    octaves = np.log2(np.maximum(frequency, 1e-9) * wavelength)
    noise = np.fft.ifft2(spectrum * np.exp(-0.5 * (octaves / width) ** 2)).real
    return noise / noise.std()


def scattered(seed: int, count: int, rounds: int = 12) -> Array:
    """Return (count, 2) points of the tile [0, 1)^2, evenly but not regularly spread.

    Each round moves every point away from its nearest neighbor, by the torus metric.
    """
    points = np.random.default_rng(seed).random((count, 2))
    spacing = 1 / np.sqrt(count)
    for _ in range(rounds):
        distance, neighbor = spatial.cKDTree(points, boxsize=1).query(points, k=2)
        away = points - points[neighbor[:, 1]]
        away -= np.round(away)
        push = np.maximum(spacing - distance[:, 1], 0)[:, None] * 0.5
        points = (points + push * away / np.maximum(distance[:, 1:], 1e-9)) % 1
    return points


def borders(points: Array, x: Array, y: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the distance to the nearest border between the points' cells, in tiles, and the owner of each texel."""
    where = np.stack([x % 1, y % 1], axis=-1)
    distance, index = spatial.cKDTree(points, boxsize=1).query(where, k=4)
    first = points[index[..., 0]]
    border = np.full(x.shape, np.inf)
    for other in range(1, 4):
        between = points[index[..., other]] - first
        between -= np.round(between)
        across = np.hypot(between[..., 0], between[..., 1])
        plane = (distance[..., other] ** 2 - distance[..., 0] ** 2) / (2 * np.maximum(across, 1e-9))
        border = np.minimum(border, plane)
    return border, index[..., 0]


def furrows() -> Array:
    """Return the relief of human skin for a tile of 32 mm: plateaus 1.5 mm wide parted by furrows of two depths."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    # A gentle pull bends the furrows, which are straight otherwise.
    x = x + 0.006 * band(11, 60) + 0.002 * band(12, 16)
    y = y + 0.006 * band(13, 60) + 0.002 * band(14, 16)
    coarse, plateau = borders(scattered(15, 320), x, y)
    fine, _ = borders(scattered(16, 1700), x, y)
    rng = np.random.default_rng(17)
    depth = 0.75 + 0.25 * np.clip(band(18, 80), -1, 1)
    primary = np.exp(-((coarse / 0.0052) ** 2))
    secondary = np.exp(-((fine / 0.0036) ** 2))
    dome = np.minimum(coarse / 0.03, 1.0) ** 0.7
    relief = 0.78 + 0.1 * dome + 0.06 * (rng.random(320)[plateau] - 0.5)
    relief -= 0.62 * depth * primary + 0.24 * secondary * (1 - primary) + 0.015 * band(19, 5)
    return np.clip(ndimage.gaussian_filter(relief, 0.7, mode="wrap"), 0, 1)


def chromatophores() -> Array:
    """Return the skin of an octopus for a tile of 40 mm: pigment sacs, yellow below red below brown, linear Rec.709.

    How far the sacs are open follows a labyrinth, the usual outcome of skin patterns that form by reaction and
    diffusion; here it is a narrow band of noise, which has the same look.
    """
    labyrinth = 1 / (1 + np.exp(-2.6 * (band(31, 110, 0.28) + 0.35 * band(32, 40, 0.4))))
    color = np.empty((SIZE, SIZE, 3))
    color[:] = (0.60, 0.47, 0.36)
    color *= 1 + 0.05 * band(33, 24)[..., None]
    y, x = (np.mgrid[0:SIZE, 0:SIZE] + 0.5) / SIZE
    where = np.stack([x, y], axis=-1)
    for seed, count, radius, pigment in (
        (34, 1500, 0.0165, (0.86, 0.50, 0.14)),
        (35, 1900, 0.0150, (0.72, 0.17, 0.07)),
        (36, 1500, 0.0135, (0.26, 0.09, 0.06)),
    ):
        points = scattered(seed, count)
        rng = np.random.default_rng(seed + 100)
        cell = np.minimum((points * SIZE).astype(int), SIZE - 1)
        openness = (0.16 + 0.84 * labyrinth[cell[:, 1], cell[:, 0]]) * rng.uniform(0.55, 1.2, count)
        distance, index = spatial.cKDTree(points, boxsize=1).query(where, k=2)
        for k in (1, 0):
            reach = radius * openness[index[..., k]]
            ragged = distance[..., k] * (1 + 0.12 * band(seed + 200, 7))
            cover = 0.88 * np.clip((reach - ragged) * SIZE / 2.2 + 0.5, 0, 1)[..., None]
            color *= 1 - cover * (1 - np.array(pigment))
    return np.clip(color, 0, 1)


def veins() -> Array:
    """Return branching veins for a tile of 90 mm, 1 in the widest: shortest paths to a few roots over rough ground.

    Where many paths run together the vein is wide; the square root keeps the area of the cross-sections.
    """
    side = SIZE // 4
    rough = np.exp(1.3 * (0.9 * band(51, 14, 0.8, side) + 0.3 * band(52, 5, 0.6, side)))
    index = np.arange(side * side).reshape(side, side)
    starts, ends, costs = [], [], []
    for row, column in ((0, 1), (1, 0), (1, 1), (1, -1)):
        other = np.roll(index, (-row, -column), axis=(0, 1))
        starts.append(index.ravel())
        ends.append(other.ravel())
        costs.append(np.hypot(row, column) * (rough.ravel() + rough.ravel()[other.ravel()]))
    graph = sparse.csr_matrix((np.concatenate(costs), (np.concatenate(starts), np.concatenate(ends))))
    roots = np.random.default_rng(53).integers(0, side * side, 9)
    distance, before, _ = sparse.csgraph.dijkstra(
        graph, directed=False, indices=roots, min_only=True, return_predecessors=True
    )
    flow = np.ones(side * side)
    for node in np.argsort(-distance, kind="stable"):
        if before[node] >= 0:
            flow[before[node]] += flow[node]
    # Lines between the centers of the cells, drawn at full size, widest last.
    picture = np.zeros((SIZE, SIZE))
    for low, high, blur in ((14, 60, 0.9), (60, 300, 1.5), (300, np.inf, 2.4)):
        line = np.zeros((SIZE, SIZE))
        for node in np.flatnonzero((flow >= low) & (flow < high) & (before >= 0)):
            start = np.array(divmod(int(node), side))
            step = np.array(divmod(int(before[node]), side)) - start
            step -= side * np.round(step / side).astype(int)
            for part in np.linspace(0, 1, 9):
                row, column = np.round(4 * (start + part * step)).astype(int) % SIZE
                line[row, column] = min(1.0, np.sqrt(flow[node] / 400))
        wobble = [band(seed, 22, 0.6) * 1.6 for seed in (54, 55)]
        grid = np.mgrid[0:SIZE, 0:SIZE].astype(float)
        soft = ndimage.gaussian_filter(line, blur, mode="wrap")
        soft = ndimage.map_coordinates(soft, [grid[0] + wobble[0], grid[1] + wobble[1]], order=1, mode="grid-wrap")
        picture = np.maximum(picture, soft * blur * 2.2)
    return np.clip(picture / np.percentile(picture, 99.7), 0, 1) ** 0.8


def main(folder: Path) -> None:
    """Write all images into a folder."""
    write_png(folder / "furrows.png", furrows(), kind="data")
    write_png(folder / "chromatophores.png", chromatophores())
    write_png(folder / "veins.png", veins(), kind="data")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
