"""What blurring on a surface should give: the normalized integral of a Gaussian over samples of the surface itself.

    E_out(x) = sum G(|x - y|) w(x, y) E(y) dA / sum G(|x - y|) w(x, y) dA

with straight 3-D distances and w = (1 + n_x . n_y) / 2, which is smooth and vanishes between sheets that face away from
each other, so that lips, lids and thin ears do not leak. As w is a product of four numbers of x and four of y, a sample
or a cell of samples is one position and four sums.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skincli.mesh.model import Mesh
from skincli.mesh.surface import face_areas

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

CUTOFF = 4.5
"""Standard deviations beyond which samples are left out: on a plane they hold 4e-5 of the weight."""

CELLS_PER_SIGMA = 4.0
"""Samples finer than this may be summed in cells first, and by what that blurs the Gaussian is made narrower: on light
of hard edges 4e-4 relative RMSE from the sum over all samples."""

WORTHWHILE = 2.0
"""Samples that a cell must hold in the mean, or summing them costs more than it saves."""

FEW, NEIGHBORS = 4.0, 16
"""Where so few samples lie within reach in the mean, as many neighbors of each target are listed at once."""

LISTED_AT_ONCE = 1 << 13
"""Targets whose neighbors are held in memory together."""

LEAST_REACH = 3.0
"""Widths of a sample within which samples are looked for, however narrow the Gaussian: the nearest one then counts."""

GRID_CELL = 6.0
"""Widths of a sample that a cell of the grid is wide in which samples are looked up."""

PAIRS_PER_GROUP = 80_000
"""Pairs of a target and a sample that are worth a look-up in the grid."""

PRODUCTS_AT_ONCE = 1 << 18
"""Products of a matrix multiplication that fit a processor's cache, and for which a library starts no threads of its
own: these would wait for each other."""

BLOCKS_AT_ONCE = 16
"""Of such products that are made in one call: less of Python, for which threads wait as well."""

LEAST_FACING = 1e-12
"""Share of the kernel's mass below which what is left after the weight is rounding."""


@dataclass(frozen=True)
class Samples:
    """Points that stand for pieces of a surface.

    Parameters
    ----------
    positions : (n, 3) float64, mm
    normals : (n, 3) float64, unit, outward
    areas : (n,) float64, mm², > 0
    """

    positions: Floats
    normals: Floats
    areas: Floats


class Light:
    """Light on samples of a surface.

    Parameters
    ----------
    samples : of the lit surface, at least one
    signal : (n, c) irradiance at the samples, any unit
    """

    def __init__(self, samples: Samples, signal: Floats) -> None:
        self._channels = signal.shape[1] + 1
        self._total = float(samples.areas.sum())
        cell = GRID_CELL * math.sqrt(self._total / len(samples.areas))
        order = np.argsort(_keys(samples.positions, cell), kind="stable")
        positions, normals, areas = samples.positions[order], samples.normals[order], samples.areas[order]
        values = np.concatenate([signal[order], np.ones((len(signal), 1))], axis=1) * areas[:, None]
        moments = (_faces(normals)[:, :, None] * values[:, None, :]).reshape(len(values), -1)
        self._grid = _Grid(positions, areas, moments, cell)
        self._summed: dict[float, tuple[_Grid, float]] = {}

    def diffused(
        self,
        targets: Floats,
        normals: Floats,
        sigma: float | Floats,
        *,
        cutoff: float = CUTOFF,
        cells_per_sigma: float = CELLS_PER_SIGMA,
    ) -> Floats:
        """Return one Gaussian of the light, normalized on the surface.

        Parameters
        ----------
        targets, normals : (m, 3) float64 each, mm and unit: where it is wanted
        sigma : mm, > 0, standard deviation per axis, or (m,) of each target its own; of one far narrower than the
            samples the nearest one is left
        cutoff : in standard deviations
        cells_per_sigma : see CELLS_PER_SIGMA; infinity sums every sample by itself

        Returns
        -------
        (m, c) float64

        Raises
        ------
        ValueError
            If all samples within reach of a target face away from it.
        """
        if np.ndim(sigma):
            # Widths of one octave share the cells of its narrowest.
            octave = np.floor(np.log2(sigma))
            found = np.zeros((len(targets), self._channels - 1))
            for step in np.unique(octave):
                at, cell = octave == step, 2.0**step / cells_per_sigma
                if cell not in self._summed:
                    self._summed[cell] = self._in_cells(cell)
                found[at] = self._over(*self._summed[cell], targets[at], normals[at], np.asarray(sigma)[at], cutoff)
            return found
        widths = np.full(len(targets), sigma)
        return self._over(*self._in_cells(float(sigma) / cells_per_sigma), targets, normals, widths, cutoff)

    def _in_cells(self, cell: float) -> tuple[_Grid, float]:
        """Return the samples, summed in cells where it is worth while, and by how much that blurs, mm²."""
        worthwhile = cell**2 * len(self._grid.areas) > WORTHWHILE * self._total
        return self._grid.summed(cell) if worthwhile else (self._grid, 0.0)

    def _over(self, grid: _Grid, blur: float, targets: Floats, normals: Floats, sigma: Floats, cutoff: float) -> Floats:
        """Return (m, c), see `diffused`, from samples that are blurred already."""
        sigma = np.sqrt(sigma**2 - blur)
        faces = 0.5 * _faces(normals)
        reach = cutoff * float(sigma.max(initial=0.0))
        if math.pi * reach**2 * len(grid.areas) < FEW * self._total and len(grid.areas) > NEIGHBORS:
            sums, faced, crowded = self._listed(grid, targets, faces, sigma, cutoff)
            at = np.flatnonzero(crowded)
        else:
            sums, faced = np.zeros((len(targets), self._channels)), np.zeros(len(targets))
            at = np.arange(len(targets))
        if len(at):
            sums[at], faced[at] = self._gathered(grid, targets[at], faces[at], sigma[at], reach)
        if lost := np.count_nonzero(~(sums[:, -1] > LEAST_FACING * faced)):
            raise ValueError(f"{lost} of {len(targets)} targets have no sample within reach that faces their way")
        return sums[:, :-1] / sums[:, -1:]

    def _listed(
        self, grid: _Grid, targets: Floats, faces: Floats, sigma: Floats, cutoff: float
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Return the sums, (m, c), the kernel's mass, (m,), and which targets have more neighbors within reach."""
        sums, faced = np.zeros((len(targets), self._channels)), np.zeros(len(targets))
        crowded = np.zeros(len(targets), dtype=bool)

        def part(first: int) -> None:
            rows = slice(first, first + LISTED_AT_ONCE)
            away, near = grid.tree.query(targets[rows], NEIGHBORS)
            kernel = np.exp((away**2 - away[:, :1] ** 2) / (-2 * sigma[rows, None] ** 2))
            gathered = np.einsum("mn,mnk->mk", kernel, grid.moments[near]).reshape(-1, 4, self._channels)
            sums[rows] = np.einsum("mk,mkc->mc", faces[rows], gathered)
            faced[rows] = gathered[:, 0, -1]
            crowded[rows] = away[:, -1] < cutoff * sigma[rows]

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for _ in pool.map(part, range(0, len(targets), LISTED_AT_ONCE)):
                pass
        return sums, faced, crowded

    def _gathered(
        self, grid: _Grid, targets: Floats, faces: Floats, sigma: Floats, reach: float
    ) -> tuple[Floats, Floats]:
        """Return the sums, (m, c), and the kernel's mass, (m,): targets that lie together against all samples near."""
        reach = max(reach, LEAST_REACH * math.sqrt(self._total / len(grid.areas)))
        # Wide groups share what they look up, narrow ones look at less: as many pairs as a look-up is worth.
        density = len(targets) * len(grid.areas) / self._total**2
        width = math.sqrt(reach**2 + math.sqrt(PAIRS_PER_GROUP / density)) - reach
        sums, faced = np.zeros((len(targets), self._channels)), np.zeros(len(targets))

        def gather(group: Indices) -> None:
            center = targets[group].mean(axis=0)
            # Distances about the group's center keep their digits wherever the mesh lies.
            x = np.concatenate([targets[group] - center, np.ones((len(group), 1))], axis=1)
            near = grid.near(center, reach + math.sqrt(np.sum(x[:, :3] ** 2, axis=1).max()))
            if not len(near):
                near = np.array([grid.tree.query(center)[1]])
            y, moments = grid.positions[near] - center, grid.moments[near]
            # The logarithm of the Gaussian, but for what all samples of a target have in common.
            x /= sigma[group, None] ** 2
            y = np.concatenate([y.T, [-0.5 * np.sum(y * y, axis=1)]])
            block = max(1, PRODUCTS_AT_ONCE // moments.size)
            for first in range(0, len(group), BLOCKS_AT_ONCE * block):
                rows = np.arange(first, min(first + BLOCKS_AT_ONCE * block, len(group)))
                # The last block is filled up with what is known already.
                rows = np.resize(rows, (math.ceil(len(rows) / block), block))
                kernel = x[rows] @ y
                # A factor that drops out keeps the nearest sample where the Gaussian has long vanished.
                kernel -= kernel.max(axis=2, keepdims=True)
                np.exp(kernel, out=kernel)
                gathered = (kernel @ moments).reshape(*rows.shape, 4, self._channels)
                rows = group[rows]
                sums[rows] = np.einsum("bmk,bmkc->bmc", faces[rows], gathered)
                faced[rows] = gathered[:, :, 0, -1]

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for _ in pool.map(gather, _groups(targets, width)):
                pass
        return sums, faced


def mesh_samples(mesh: Mesh, area: float) -> Samples:
    """Return samples at the centers of equal parts of the faces; the areas sum to the mesh's area exactly.

    Parameters
    ----------
    mesh : in mm
    area : mm², > 0; no part is larger

    Returns
    -------
    Samples with the mesh's interpolated normals, face after face
    """
    whole = face_areas(mesh)
    parts = np.maximum(np.ceil(np.sqrt(whole / area)), 1).astype(np.int64)
    areas = whole / parts**2
    first = np.cumsum(parts**2) - parts**2
    face = np.repeat(np.arange(len(parts)), parts**2)
    barycentric = np.empty((len(face), 3))
    for count in np.unique(parts):
        here = first[parts == count][:, None] + np.arange(count**2)
        barycentric[here] = _centers(int(count))
    corner = mesh.faces[face]
    positions, normals = (
        sum((barycentric[:, k, None] * values[corner[:, k]] for k in range(3)), start=np.zeros((len(face), 3)))
        for values in (mesh.positions, mesh.normals)
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return Samples(positions, normals / np.where(length > 0, length, 1.0), areas[face])


def _centers(count: int) -> Floats:
    """Return the barycentric centers, (count², 3), of the equal parts of a triangle whose edges are cut in `count`."""
    i, j = (axis.ravel() for axis in np.indices((count, count)))
    upright = np.stack([i, j], axis=1)[i + j < count] + 1 / 3
    inverted = np.stack([i, j], axis=1)[i + j < count - 1] + 2 / 3
    inner = np.concatenate([upright, inverted]) / count
    return np.column_stack([inner, 1 - inner.sum(axis=1)])


def _faces(normals: Floats) -> Floats:
    """Return four numbers per point, (n, 4); half the product of two points' numbers is the weight of the pair."""
    return np.concatenate([np.ones((len(normals), 1)), normals], axis=1)


class _Grid:
    """Samples in the order of the cells of a grid, so that those near a place are a few runs.

    Parameters
    ----------
    positions, areas : (n, 3) and (n,), see `Samples`; in the order of their keys
    moments : (n, k) what each gives
    cell : mm
    """

    def __init__(self, positions: Floats, areas: Floats, moments: Floats, cell: float) -> None:
        self.positions, self.areas, self.moments = positions, areas, moments
        self._cell, self._low = cell, positions.min(axis=0)
        self._ordered = _keys(positions, cell)

    def near(self, center: Floats, radius: float) -> Indices:
        """Return the samples within a radius of a point."""
        first, last = (
            np.floor((center - self._low + step) / self._cell).astype(np.int64) for step in (-radius, radius)
        )
        first = np.maximum(first, 0)
        i, j = (axis.ravel() for axis in np.mgrid[first[0] : last[0] + 1, first[1] : last[1] + 1])
        start, stop = (
            np.searchsorted(self._ordered, _packed(np.stack([i, j, np.full_like(i, k)], axis=1)))
            for k in (first[2], max(last[2] + 1, first[2]))
        )
        length = stop - start
        found = np.arange(int(length.sum())) + np.repeat(start - np.cumsum(length) + length, length)
        away = self.positions[found] - center
        return np.asarray(found[np.einsum("nd,nd->n", away, away) <= radius**2])

    @cached_property
    def tree(self) -> cKDTree:
        """Return the samples as a tree."""
        return cKDTree(self.positions, balanced_tree=False)

    def summed(self, cell: float) -> tuple[_Grid, float]:
        """Return the samples summed in cells, and the variance by which that blurs along the surface, mm² per axis."""
        keys = _keys(self.positions, cell)
        order = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
        positions, areas = self.positions[order], self.areas[order]
        mass = np.add.reduceat(areas, starts)
        centers = np.add.reduceat(positions * areas[:, None], starts) / mass[:, None]
        away = positions - np.repeat(centers, np.diff(starts, append=len(keys)), axis=0)
        blur = float(areas @ np.einsum("nd,nd->n", away, away) / mass.sum()) / 2
        # Column by column, for all of them at once would be copied.
        sums = np.stack([np.add.reduceat(column[order], starts) for column in self.moments.T], axis=1)
        wide = max(self._cell, GRID_CELL * cell)
        order = np.argsort(_keys(centers, wide), kind="stable")
        return _Grid(centers[order], mass[order], sums[order], wide), blur


def _keys(positions: Floats, cell: float) -> Indices:
    """Return the numbers, (n,), of the cells in which points lie."""
    return _packed(np.floor((positions - positions.min(axis=0)) / cell).astype(np.int64))


def _packed(cells: Indices) -> Indices:
    """Return one number for (n, 3) numbers of cells, none negative; it ascends with the last."""
    return np.asarray(cells @ np.array([1 << 42, 1 << 21, 1]))


def _groups(targets: Floats, cell: float) -> Iterator[Indices]:
    """Yield the indices of targets that lie in one cell."""
    key = _keys(targets, cell)
    order = np.argsort(key, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(key[order])) + 1)
