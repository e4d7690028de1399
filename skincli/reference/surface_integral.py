"""What blurring on a surface should give: the normalized integral of a Gaussian over samples of the surface itself.

    E_out(x) = sum G(|x - y|) w(x, y) E(y) dA / sum G(|x - y|) w(x, y) dA

with straight 3-D distances and, by default, w = (1 + n_x . n_y) / 2, which is smooth and vanishes between sheets that
face away from each other, so that lips, lids and thin ears do not leak. As w is a product of four numbers of x and four
of y, a sample or a cluster of samples is one position and four sums.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from skincli.mesh.model import Mesh
from skincli.mesh.surface import face_areas, first_center, span_of_row, uv_areas

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Weight = Literal["facing", "uniform"]

CUTOFF = 6.0
"""Standard deviations beyond which samples are left out: on a plane they hold 1.5e-8 of the weight."""

TARGETS_AT_ONCE = 256
PAIRS_AT_ONCE = 1 << 21
"""Pairs of target and source held in memory together, at a few times 8 bytes each."""

CELLS_PER_SIGMA = 8.0
"""Finer clusters than an eighth of sigma save nothing."""

TARGET_CELL = 3.0
"""Targets within a cell of this many standard deviations share their search for samples."""

LEAST_FACING = 1e-12
"""Share of the kernel's mass below which what is left after the weight is rounding."""

BITS = 20
"""Of a cell number along an axis: three fit one 64-bit key, and a millionth of the extent is a cell."""

SPANS_AT_ONCE = 1 << 18
"""Scan-line spans of faces held in memory together by `atlas_samples`."""


@dataclass(frozen=True)
class Samples:
    """Points that stand for pieces of a surface.

    Parameters
    ----------
    positions : (n, 3) float64, mm
    normals : (n, 3) float64, unit, outward
    areas : (n,) float64, mm², >= 0
    """

    positions: Floats
    normals: Floats
    areas: Floats


@dataclass(frozen=True)
class Diffused:
    """The normalized integral at m targets.

    Parameters
    ----------
    values : (m, c) float64, in the signal's unit
    denominator : (m,) float64, mm², sum of G w dA, with G = 1 at distance 0
    bound : (m,) no value is farther than this times (greatest - least signal) from the sum over all samples
    """

    values: Floats
    denominator: Floats
    bound: Floats


def exact(
    samples: Samples,
    signal: Floats,
    targets: Floats,
    normals: Floats,
    sigma: float,
    *,
    weight: Weight = "facing",
    cutoff: float = CUTOFF,
) -> Diffused:
    """Return the integral by brute force: every pair of target and sample within the cutoff.

    Parameters
    ----------
    samples : of the lit surface
    signal : (n, c) irradiance at the samples, any unit
    targets, normals : (m, 3) float64 each, mm and unit: where it is wanted
    sigma : mm, > 0, standard deviation per axis
    weight : "facing" for (1 + n_x . n_y) / 2, "uniform" for 1
    cutoff : in standard deviations; groups of samples that lie beyond it for a whole group of targets are left out

    Returns
    -------
    Its bound is what the cutoff may cost.

    Raises
    ------
    ValueError
        If a target has no sample within reach whose weight is not zero.
    """
    return _integrate(samples, signal, targets, normals, sigma, weight, cutoff, 0.0)


def hierarchical(
    samples: Samples,
    signal: Floats,
    targets: Floats,
    normals: Floats,
    sigma: float,
    *,
    weight: Weight = "facing",
    cutoff: float = CUTOFF,
    tolerance: float = 1e-3,
) -> Diffused:
    """Return the integral with clusters of an octree in place of samples [JensenBuhler2002].

    A cluster serves where the kernel, whose peak is 1, changes across it by no more than the tolerance, less for
    clusters wider than sigma.

    Parameters
    ----------
    samples, signal, targets, normals, sigma, weight, cutoff : see `exact`
    tolerance : >= 0; at 0 this is `exact`

    Raises
    ------
    ValueError
        See `exact`.

    Notes
    -----
    The bound follows from E_out - E_out' = sum (G - G') w (E - E_out') dA / sum G w dA: over the clusters used,
    |G - G'| is at most the kernel's change, and over what is left out at most exp(-cutoff²/2).
    """
    return _integrate(samples, signal, targets, normals, sigma, weight, cutoff, tolerance)


def diffuse(
    samples: Samples,
    signal: Floats,
    targets: Floats,
    normals: Floats,
    variances: Sequence[float],
    weights: Sequence[Sequence[float]],
    *,
    tolerance: float = 0.0,
) -> Floats:
    """Return the response of a sum of Gaussians, each normalized by its own weight on the surface.

    Parameters
    ----------
    samples, targets, normals, tolerance : see `hierarchical`
    signal : (n, 3) irradiance in R, G, B
    variances, weights : of a `GaussianSum`

    Returns
    -------
    (m, 3) float64
    """
    result = np.zeros((len(targets), 3))
    for variance, share in zip(variances, weights, strict=True):
        part = hierarchical(samples, signal, targets, normals, math.sqrt(variance), tolerance=tolerance)
        result += np.asarray(share) * part.values
    return result


def energy_drift(samples: Samples, signal: Floats, diffused: Floats) -> Floats:
    """Return by what share the diffused signal holds more or less light than the signal.

    A normalized sum keeps constants, not energy: at borders and on curved or folded surfaces light is gained or lost.

    Parameters
    ----------
    samples : where both are known
    signal, diffused : (n, c)

    Returns
    -------
    (c,) sum of E_out dA / sum of E dA - 1
    """
    return np.asarray(samples.areas @ diffused / (samples.areas @ signal) - 1.0)


def mesh_samples(mesh: Mesh, spacing: float) -> Samples:
    """Return samples at the centers of equal parts of the faces; the areas sum to the mesh's area exactly.

    Parameters
    ----------
    mesh : in mm
    spacing : mm, > 0; no edge of a part is longer

    Returns
    -------
    Samples with the mesh's interpolated normals, face after face
    """
    corners = mesh.positions[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    parts = np.maximum(np.ceil(longest / spacing), 1).astype(np.int64)
    areas = face_areas(mesh) / parts**2
    first = np.cumsum(parts**2) - parts**2
    face = np.repeat(np.arange(len(parts)), parts**2)
    barycentric = np.empty((len(face), 3))
    for count in np.unique(parts):
        here = first[parts == count][:, None] + np.arange(count**2)
        barycentric[here] = _centers(int(count))
    return _interpolated(mesh, face, barycentric, areas[face])


def atlas_samples(mesh: Mesh, size: int) -> tuple[Samples, Indices]:
    """Return a sample for each texel of the mesh's atlas whose center a face covers.

    Parameters
    ----------
    mesh : in mm; of faces whose `atlas_uv` overlap, the first has the texel
    size : texels a side

    Returns
    -------
    samples : position and smooth normal at the texel's center; its area is the surface of one texel by the face's own
        map, |dP/du x dP/dv| / size²
    texels : (n, 2) row and column, ascending; row 0 lies at v = 0
    """
    triangles = mesh.atlas_uv[mesh.faces] * size
    heights = triangles[:, :, 1]
    low = first_center(heights.min(axis=1), size)
    rows = np.maximum(first_center(heights.max(axis=1), size) - low, 0)
    owner = np.full(size * size, len(mesh.faces), dtype=np.int64)
    for part in _runs(rows, SPANS_AT_ONCE):
        face = np.repeat(part, rows[part])
        row = _counted(rows[part]) + low[face]
        begin, end = span_of_row(triangles[face], np.asarray(row + 0.5))
        start = first_center(begin, size)
        length = first_center(end, size) - start
        texel = np.repeat(row * size + start, length) + _counted(length)
        np.minimum.at(owner, texel, np.repeat(face, length))
    texel = np.flatnonzero(owner < len(mesh.faces))
    face = owner[texel]
    texels = np.stack([texel // size, texel % size], axis=1)
    a, b, c = np.moveaxis(triangles[face], 1, 0)
    point = texels[:, ::-1] + 0.5
    signed = uv_areas(mesh.atlas_uv, mesh.faces)[face] * size**2
    second, third = 0.5 * _cross2(point - a, c - a) / signed, 0.5 * _cross2(b - a, point - a) / signed
    barycentric = np.stack([1 - second - third, second, third], axis=1)
    areas = face_areas(mesh)[face] / np.abs(signed)
    return _interpolated(mesh, face, barycentric, areas), texels


def _interpolated(mesh: Mesh, face: Indices, barycentric: Floats, areas: Floats) -> Samples:
    """Return samples at barycentric coordinates (n, 3) of faces (n,)."""
    corners = mesh.faces[face]
    positions, normals = (
        sum((barycentric[:, k, None] * values[corners[:, k]] for k in range(3)), start=np.zeros((len(face), 3)))
        for values in (mesh.positions, mesh.normals)
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return Samples(positions, normals / np.where(length > 0, length, 1.0), areas)


def _centers(count: int) -> Floats:
    """Return the barycentric centers, (count², 3), of the equal parts of a triangle whose edges are cut in `count`."""
    i, j = (axis.ravel() for axis in np.indices((count, count)))
    upright = np.stack([i, j], axis=1)[i + j < count] + 1 / 3
    inverted = np.stack([i, j], axis=1)[i + j < count - 1] + 2 / 3
    inner = np.concatenate([upright, inverted]) / count
    return np.column_stack([inner, 1 - inner.sum(axis=1)])


def _cross2(a: Floats, b: Floats) -> Floats:
    """Return the signed area of the parallelograms, (n,), of (n, 2) and (n, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _counted(lengths: Indices) -> Indices:
    """Return 0, 1, ..., length - 1 for each length, one after another."""
    return np.arange(int(lengths.sum())) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def _runs(counts: Indices, most: int) -> list[Indices]:
    """Return the indices of `counts` in runs whose counts sum to about `most`."""
    return np.split(np.arange(len(counts)), np.flatnonzero(np.diff(np.cumsum(counts) // most)) + 1)


@dataclass(frozen=True)
class _Level:
    """One level of the octree: clusters of samples that follow each other in Morton order.

    Parameters
    ----------
    positions : (k, 3) centers by area
    areas : (k,) sums of the samples' areas
    reach : (k,) greatest distance of a sample from its center
    moments : (k, 4 (c + 1)) sums over the samples, see `_moments`
    children : (k + 1,) where the children of each begin on the next finer level
    """

    positions: Floats
    areas: Floats
    reach: Floats
    moments: Floats
    children: Indices


def _faces(normals: Floats, weight: Weight) -> Floats:
    """Return four numbers per point, (n, 4); half the product of two points' numbers is the weight of the pair."""
    rest = normals if weight == "facing" else np.broadcast_to([1.0, 0.0, 0.0], normals.shape)
    return np.concatenate([np.ones((len(normals), 1)), rest], axis=1)


def _moments(samples: Samples, signal: Floats, weight: Weight) -> Floats:
    """Return what a sample gives, (n, 4 (c + 1)): its four numbers, times signal and 1, times area."""
    values = np.concatenate([signal, np.ones((len(signal), 1))], axis=1) * samples.areas[:, None]
    return (_faces(samples.normals, weight)[:, :, None] * values[:, None, :]).reshape(len(values), -1)


def _morton(positions: Floats, cell: float) -> Indices:
    """Return Morton keys, (n,), of the positions' cells, which are at least a millionth of the extent wide."""
    low = positions.min(axis=0)
    cell = max(cell, 1e-6 * float((positions.max(axis=0) - low).max()))
    cells = ((positions - low) / cell).astype(np.int64)
    key = np.zeros(len(cells), dtype=np.int64)
    for bit in range(BITS):
        for axis in range(3):
            key |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return key


def _octree(samples: Samples, moments: Floats, cell: float) -> list[_Level]:
    """Return the levels from the root to the samples; the finest cells that hold several samples are `cell` wide."""
    keys = _morton(samples.positions, cell)
    order = np.argsort(keys, kind="stable")
    keys, positions, areas = keys[order], samples.positions[order], samples.areas[order]
    begin = np.arange(len(keys))
    levels = [_Level(positions, areas, np.zeros(len(keys)), moments[order], begin[:0])]
    # Samples without area must not leave a cluster without a center.
    mass = np.maximum(areas, np.finfo(np.float64).tiny)
    while True:
        starts = np.flatnonzero(np.diff(keys, prepend=-1))
        # A level that merges little costs more than it saves.
        if 2 * len(starts) <= len(begin) or len(starts) == 1:
            centers = np.add.reduceat(positions * mass[:, None], starts) / np.add.reduceat(mass, starts)[:, None]
            away = positions - np.repeat(centers, np.diff(starts, append=len(keys)), axis=0)
            reach = np.sqrt(np.maximum.reduceat(np.sum(away**2, axis=1), starts))
            children = np.append(np.searchsorted(begin, starts), len(begin))
            summed = np.add.reduceat(levels[-1].moments, children[:-1])
            levels.append(_Level(centers, np.add.reduceat(areas, starts), reach, summed, children))
            begin = starts
        if len(starts) == 1:
            return levels[::-1]
        keys = keys >> 3


def _groups(targets: Floats, cell: float) -> Iterator[Indices]:
    """Yield indices of targets that lie in one cell, at most `TARGETS_AT_ONCE` together."""
    keys = _morton(targets, cell)
    order = np.argsort(keys, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
        yield from (group[start : start + TARGETS_AT_ONCE] for start in range(0, len(group), TARGETS_AT_ONCE))


def _sources(
    levels: list[_Level], center: Floats, radius: float, sigma: float, cutoff: float, tolerance: float
) -> Iterator[tuple[_Level, Indices, Floats]]:
    """Yield, level by level, the clusters that serve all targets within `radius` of `center`.

    The third value is by how much the kernel may change across each; samples end the list, with zeros.
    """
    nodes = np.arange(len(levels[0].positions))
    for depth, level in enumerate(levels):
        away = level.positions[nodes] - center
        distance = np.sqrt(np.einsum("nd,nd->n", away, away))
        slack = radius + level.reach[nodes]
        near = distance - slack <= cutoff * sigma
        nodes, distance, slack = nodes[near], distance[near], slack[near]
        if depth == len(levels) - 1:
            yield level, nodes, np.zeros(len(nodes))
            return
        nearest, farthest = np.maximum(distance - slack, 0.0) / sigma, (distance + slack) / sigma
        # The kernel's slope, r/sigma² exp(-r²/2 sigma²), is greatest at sigma, or where the range of r ends towards it;
        # and what is never negative changes by no more than its greatest value.
        steepest = np.clip(1.0, nearest, farthest)
        change = level.reach[nodes] / sigma * steepest * np.exp(-(steepest**2) / 2)
        change = np.minimum(change, np.exp(-(nearest**2) / 2))
        # Wide clusters must not gather more error by their area than small ones by their number.
        good = (change * np.maximum(1.0, level.areas[nodes] / sigma**2) <= tolerance) & (tolerance > 0)
        yield level, nodes[good], change[good]
        rest = nodes[~good]
        first = level.children[rest]
        count = level.children[rest + 1] - first
        nodes = np.repeat(first, count) + _counted(count)


def _integrate(
    samples: Samples,
    signal: Floats,
    targets: Floats,
    normals: Floats,
    sigma: float,
    weight: Weight,
    cutoff: float,
    tolerance: float,
) -> Diffused:
    """Return the integral; see `hierarchical`."""
    columns = signal.shape[1] + 1
    levels = _octree(samples, _moments(samples, signal, weight), sigma / CELLS_PER_SIGMA)
    sums, faced, unsure = np.zeros((len(targets), columns)), np.zeros(len(targets)), np.zeros(len(targets))
    for group in _groups(targets, TARGET_CELL * sigma):
        center = (targets[group].min(axis=0) + targets[group].max(axis=0)) / 2
        # Distances about the group's center keep their digits wherever the mesh lies.
        x = targets[group] - center
        square_x = np.sum(x * x, axis=1)[:, None]
        face = 0.5 * _faces(normals[group], weight)
        for level, nodes, change in _sources(levels, center, math.sqrt(square_x.max()), sigma, cutoff, tolerance):
            step = max(1, PAIRS_AT_ONCE // len(group))
            for start in range(0, len(nodes), step):
                part = nodes[start : start + step]
                y = level.positions[part] - center
                kernel = np.exp((square_x + np.sum(y * y, axis=1) - 2 * x @ y.T) / (-2 * sigma**2))
                moments = level.moments[part]
                gathered = (kernel @ moments).reshape(len(group), 4, columns)
                sums[group] += np.einsum("mk,mkc->mc", face, gathered)
                faced[group] += gathered[:, 0, -1]
                unsure[group] += face @ (change[start : start + step] @ moments).reshape(4, columns)[:, -1]
    denominator = sums[:, -1]
    if lost := np.count_nonzero(~(denominator > LEAST_FACING * faced)):
        raise ValueError(f"{lost} of {len(targets)} targets have no sample within reach that faces their way")
    unsure += math.exp(-(cutoff**2) / 2) * float(samples.areas.sum())
    # Both lie within the signal's range: beyond 1 the bound says nothing.
    bound = unsure / np.maximum(denominator - unsure, unsure)
    return Diffused(sums[:, :-1] / denominator[:, None], denominator, bound)
