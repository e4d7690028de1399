"""The exact diffusion at the texels that a picture reads: float64, and quick enough to be run in every bench."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skincli.mesh.texels import Texels

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

CUTOFF = 4.5
"""Standard deviations beyond which samples are left out: on a plane they hold 4e-5 of the weight."""

CELLS_PER_SIGMA = 2.0
"""Samples finer than this are summed in cells first, and by what that blurs the Gaussian is made narrower: on light of
hard edges 2e-3 relative RMSE from the sum over all samples, less on what a smooth surface receives."""

FEW = 60.0
"""Up to so many samples within reach of a target, pairs are listed; beyond, targets share their search."""

TARGET_CELL, WIDEST_CELL, TARGETS_PER_CELL = 2.5, 5.0, 64
"""Targets within a cell of this many standard deviations share their search for samples; or in a wider one, for as few
of them that searching would take longer than what is found."""

TARGETS_AT_ONCE = 4096
GROUP = 512
ROWS = 32
"""Targets whose pairs are listed together, that share their search at most, and that fit a processor's cache."""


class SeenTexels:
    """What `diffusion: exact` calls, for the texels that some pixels read; the others stay dark.

    Parameters
    ----------
    atlas_uv : (n, 2) where the pixels read the atlas, v upwards
    size : texels a side of the atlas
    """

    def __init__(self, atlas_uv: Floats, size: int) -> None:
        low = np.floor(atlas_uv * size - 0.5).astype(np.int64)
        corners = [np.clip(low + step, 0, size - 1) for step in ((0, 0), (1, 0), (0, 1), (1, 1))]
        self.read = np.zeros(size * size, dtype=bool)
        for corner in corners:
            self.read[corner[:, 1] * size + corner[:, 0]] = True

    def __call__(
        self,
        texels: Texels,
        signal: Floats,
        receiving: NDArray[np.bool_],
        variances: Sequence[float],
        weights: Sequence[Sequence[float]],
    ) -> Floats:
        """Return (m, 3) the sum of Gaussians at the receiving texels, 0 where no pixel reads them."""
        seen = receiving & self.read[texels.index]
        result = np.zeros((len(seen), 3))
        light = Light(texels, signal)
        for variance, share in zip(variances, weights, strict=True):
            result[seen] += np.asarray(share) * light.diffused(seen, math.sqrt(variance))
        return result[receiving]


class Light:
    """Light on the texels of an atlas.

    Parameters
    ----------
    texels : all that give light, and perhaps some that only receive
    signal : (n, 3) irradiance
    """

    def __init__(self, texels: Texels, signal: Floats) -> None:
        self._texels = texels
        gives = texels.areas > 0
        self._positions, self._areas = texels.positions[gives], texels.areas[gives]
        values = np.concatenate([signal[gives], np.ones((len(self._areas), 1))], axis=1) * self._areas[:, None]
        facing = np.concatenate([np.ones((len(self._areas), 1)), texels.normals[gives]], axis=1)
        self._moments = (facing[:, :, None] * values[:, None, :]).reshape(len(self._areas), -1)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._positions, balanced_tree=False)

    def diffused(self, wanted: NDArray[np.bool_], sigma: float) -> Floats:
        """Return one Gaussian of the light, normalized on the surface; see skincli.reference.surface_integral.

        Parameters
        ----------
        wanted : (n,) texels at which the result is wanted
        sigma : mm, > 0; one far narrower than a texel leaves the light where it is

        Returns
        -------
        (m, 3) float64
        """
        texels, areas = self._texels, self._areas
        targets = texels.positions[wanted]
        faces = 0.5 * np.concatenate([np.ones((len(targets), 1)), texels.normals[wanted]], axis=1)
        cell = sigma / CELLS_PER_SIGMA
        if cell**2 > 2 * areas.mean():
            positions, moments, blur = _summed(self._positions, areas, self._moments, cell)
            tree, sigma = cKDTree(positions), math.sqrt(sigma**2 - blur)
        else:
            tree, moments = self._tree, self._moments
        if math.pi * (CUTOFF * sigma) ** 2 * tree.n / areas.sum() < FEW:
            found = _listed(tree, moments, targets, faces, sigma)
        else:
            width = math.sqrt(TARGETS_PER_CELL * areas.mean())
            width = min(max(width, TARGET_CELL * sigma), WIDEST_CELL * sigma)
            found = _gathered(tree, moments, targets, faces, sigma, width)
        return found[:, :3] / found[:, 3:]


def _summed(positions: Floats, areas: Floats, moments: Floats, cell: float) -> tuple[Floats, Floats, float]:
    """Return the samples summed in cells, and the variance by which that blurs along the surface, mm² per axis."""
    key = np.floor((positions - positions.min(axis=0)) / cell).astype(np.int64)
    _, own = np.unique(key @ np.array([1 << 42, 1 << 21, 1]), return_inverse=True)
    count = int(own.max()) + 1
    mass = np.bincount(own, areas, count)
    centers = np.stack([np.bincount(own, areas * axis, count) for axis in positions.T], axis=1) / mass[:, None]
    away = np.sum((positions - centers[own]) ** 2, axis=1)
    blur = float(areas @ away / areas.sum()) / 2
    sums = np.stack([np.bincount(own, column, count) for column in moments.T], axis=1).astype(np.float64)
    return centers, sums, blur


def _listed(tree: cKDTree, moments: Floats, targets: Floats, faces: Floats, sigma: float) -> Floats:
    """Return (m, 4) sums, pair by pair."""
    # The nearest sample counts however far it lies: of a Gaussian between samples it is all that is left.
    (nearest, others), own = (found.T for found in tree.query(targets, k=2, workers=-1))
    nearest, own = nearest.copy(), own[0]
    sums = np.einsum("nk,nkc->nc", faces, moments[own].reshape(-1, 4, 4))
    crowded = np.flatnonzero(others**2 - nearest**2 < (CUTOFF * sigma) ** 2)

    def part(first: int) -> None:
        at = crowded[first : first + TARGETS_AT_ONCE]
        near = cKDTree(targets[at]).sparse_distance_matrix(tree, CUTOFF * sigma, output_type="ndarray")
        i, j, distance = near["i"], near["j"], near["v"]
        kernel = np.exp((nearest[at][i] ** 2 - distance**2) / (2 * sigma**2))
        pairs = np.einsum("nk,nkc->nc", faces[at][i], moments[j].reshape(-1, 4, 4)) * kernel[:, None]
        gathered = np.stack([np.bincount(i, column, len(at)) for column in pairs.T], axis=1)
        known = gathered[:, 3] > 0
        sums[at[known]] = gathered[known]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in pool.map(part, range(0, len(crowded), TARGETS_AT_ONCE)):
            pass
    return sums


def _gathered(tree: cKDTree, moments: Floats, targets: Floats, faces: Floats, sigma: float, cell: float) -> Floats:
    """Return (m, 4) sums, the targets of a cell held against all samples about it."""
    sums = np.zeros((len(targets), 4))
    positions = np.asarray(tree.data)

    def gather(group: Indices) -> None:
        center = (targets[group].min(axis=0) + targets[group].max(axis=0)) / 2
        x = targets[group] - center
        square = np.sum(x * x, axis=1)
        near = np.array(tree.query_ball_point(center, CUTOFF * sigma + math.sqrt(square.max())), dtype=np.int64)
        y = positions[near] - center
        square_y, own = np.sum(y * y, axis=1), moments[near]
        for first in range(0, len(group), ROWS):
            rows = slice(first, first + ROWS)
            kernel = np.exp((square[rows, None] + square_y - 2 * x[rows] @ y.T) / (-2 * sigma**2))
            gathered = (kernel @ own).reshape(-1, 4, 4)
            sums[group[rows]] = np.einsum("mk,mkc->mc", faces[group[rows]], gathered)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in pool.map(gather, _groups(targets, cell)):
            pass
    return sums


def _groups(targets: Floats, cell: float) -> Iterator[Indices]:
    """Yield indices of targets that lie in one cell, at most GROUP together."""
    key = np.floor((targets - targets.min(axis=0)) / cell).astype(np.int64) @ np.array([1 << 42, 1 << 21, 1])
    order = np.argsort(key, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
        yield from (group[first : first + GROUP] for first in range(0, len(group), GROUP))
