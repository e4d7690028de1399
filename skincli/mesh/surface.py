"""Measures of a triangle mesh and of the map from its UV square to the surface: numpy, float64."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.mesh.model import Mesh

Floats = NDArray[np.float64]
Integers = NDArray[np.integer[Any]]

TINY_UV_AREA = 1e-12
"""A face of less UV area (a millionth of a texel of a 1024 atlas) has no usable map from UV to surface."""

MOST_TILES = 16
"""Images of one face in the repeated unit square; see `raster_tiles`."""

SPANS_AT_ONCE = 1 << 21
"""Scan-line spans held in memory together by `coverage`."""


def area_vectors(positions: Floats, faces: Integers) -> Floats:
    """Return each face's normal with the length of its area, (m, 3), in the positions' unit squared."""
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    return 0.5 * np.cross(b - a, c - a)


def face_areas(mesh: Mesh) -> Floats:
    """Return the surface area of each face, (m,) float64, mm²."""
    return np.linalg.norm(area_vectors(mesh.positions, mesh.faces), axis=1)


def uv_areas(uv: Floats, faces: Integers) -> Floats:
    """Return each face's signed area in UV, (m,) float64, in unit squares; negative where the map is mirrored."""
    a, b, c = (uv[faces[:, corner]] for corner in range(3))
    (du1, dv1), (du2, dv2) = (b - a).T, (c - a).T
    return 0.5 * (du1 * dv2 - du2 * dv1)


def angle_weighted_normals(positions: Floats, faces: Integers) -> Floats:
    """Return smooth vertex normals: the unit face normals averaged with the corner's angle as weight.

    Parameters
    ----------
    positions : (n, 3) float64
    faces : (m, 3), counter-clockwise seen from outside

    Returns
    -------
    (n, 3) float64, unit. A vertex without any face of positive area gets (0, 0, 1).

    Notes
    -----
    Thuermer and Wuethrich 1998, "Computing vertex normals from polygonal facets": unlike area weights, angles do
    not depend on how a flat neighborhood happens to be cut into triangles.
    """
    normals = _unit(area_vectors(positions, faces))
    total = np.zeros((len(positions), 3))
    for corner in range(3):
        here = faces[:, corner]
        ahead = positions[faces[:, (corner + 1) % 3]] - positions[here]
        behind = positions[faces[:, (corner + 2) % 3]] - positions[here]
        # atan2 keeps its digits at small angles, where the arc cosine of a dot product loses half of them.
        sine = np.linalg.norm(np.cross(ahead, behind), axis=1)
        angle = np.arctan2(sine, np.einsum("ij,ij->i", ahead, behind))
        total += _scatter(here, normals * angle[:, None], len(positions))
    total = _unit(total)
    total[~total.any(axis=1)] = (0.0, 0.0, 1.0)
    return total


def tangents(positions: Floats, faces: Integers, uv: Floats) -> tuple[Floats, Floats]:
    """Return the derivatives of position by u and by v at each vertex.

    They are not normalized: their lengths are mm per UV unit, which is the metric that keeps bump height and
    scattering radius physical. Mirroring keeps its sign, dpdu x dpdv then points inward; vertices that mirrored and
    unmirrored faces share must have been split (`load_mesh` does), or the two cancel.

    Parameters
    ----------
    positions : (n, 3) float64, mm
    faces : (m, 3)
    uv : (n, 2) float64

    Returns
    -------
    dpdu, dpdv : each (n, 3) float64, mm per UV unit; the mean over the adjacent faces weighted by their surface area,
        without those whose UV are degenerate or not finite; zero where none is left
    """
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    ua, ub, uc = (uv[faces[:, corner]] for corner in range(3))
    with np.errstate(invalid="ignore", over="ignore"):
        (du1, dv1), (du2, dv2) = (ub - ua).T, (uc - ua).T
        determinant = du1 * dv2 - du2 * dv1
        usable = np.abs(determinant) > 2.0 * TINY_UV_AREA
        usable &= np.isfinite(determinant)
    along, across = (b - a)[usable], (c - a)[usable]
    du1, dv1, du2, dv2, determinant = (value[usable, None] for value in (du1, dv1, du2, dv2, determinant))
    weight = 0.5 * np.linalg.norm(np.cross(along, across), axis=1, keepdims=True)
    per_face = (
        weight * (along * dv2 - across * dv1) / determinant,
        weight * (across * du1 - along * du2) / determinant,
    )
    corners = faces[usable]
    count = len(positions)
    weights = sum((_scatter(corners[:, k], weight, count) for k in range(3)), start=np.zeros((count, 1)))
    weights[weights == 0.0] = 1.0
    dpdu, dpdv = (
        sum((_scatter(corners[:, k], value, count) for k in range(3)), start=np.zeros((count, 3))) / weights
        for value in per_face
    )
    return dpdu, dpdv


def texel_size(mesh: Mesh, uv: Floats, size: int) -> float:
    """Return the mean width of a texel on the surface: the root of surface area over covered texels.

    Parameters
    ----------
    mesh : gives positions and faces
    uv : (n, 2) float64, one of the mesh's UV sets; faces on the same texels count once each
    size : texels a side of the unit square

    Returns
    -------
    mm; faces without UV area are left out on both sides

    Raises
    ------
    ValueError
        If no face has any UV area.
    """
    covered = np.abs(uv_areas(uv, mesh.faces))
    usable = covered > TINY_UV_AREA
    if not usable.any():
        raise ValueError("no face has any area in this UV set")
    return float(np.sqrt(face_areas(mesh)[usable].sum() / (covered[usable].sum() * size * size)))


def border_edges(faces: Integers) -> NDArray[np.int64]:
    """Return the edges that exactly one face uses, each with that face's third vertex, in that face's direction.

    These are the borders of the UV charts: seams split vertices, so in vertex indices a chart's border and the
    surface's own border look the same. With vertices welded by position only the surface's border is left.

    Parameters
    ----------
    faces : (m, 3)

    Returns
    -------
    (k, 3) vertex indices: from, to, opposite
    """
    corners = [faces, np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)]
    directed = np.stack(corners, axis=2).reshape(-1, 3).astype(np.int64)
    if not len(directed):
        return directed
    low, high = directed[:, :2].min(axis=1), directed[:, :2].max(axis=1)
    _, inverse, uses = np.unique(low * (high.max() + 1) + high, return_inverse=True, return_counts=True)
    return directed[uses[inverse] == 1]


def raster_tiles(uv: Floats, faces: Integers) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return how often, and by what shift, each face must be drawn to cover its image in the repeated unit square.

    A face inside [0, 1] is drawn once, unshifted; one across a tile's border appears once per tile its bounding
    box meets. Of a face that meets more than `MOST_TILES` tiles, only a window of them about its middle is given:
    its image overlaps itself many times over in any case.

    Parameters
    ----------
    uv : (n, 2) float64, finite
    faces : (m, 3)

    Returns
    -------
    face : (k,) indices into `faces`, ascending
    shift : (k, 2) integers to add to the face's uv
    """
    corners = uv[faces]
    first = np.floor(corners.min(axis=1))
    # A face that ends exactly on a border does not enter the next tile.
    last = np.maximum(np.ceil(corners.max(axis=1)) - 1.0, first)
    counts = last - first + 1.0
    wide = np.minimum(counts[:, 0], MOST_TILES)
    window = np.stack([wide, np.minimum(counts[:, 1], MOST_TILES // wide)], axis=1).astype(np.int64)
    first = (first + np.floor((counts - window) / 2.0)).astype(np.int64)
    tiles = window.prod(axis=1)
    face = np.repeat(np.arange(len(faces)), tiles)
    number = np.arange(len(face)) - np.repeat(np.cumsum(tiles) - tiles, tiles)
    across = window[face, 0]
    tile = first[face] + np.stack([number % across, number // across], axis=1)
    return face, -tile


def coverage(uv: Floats, faces: Integers, size: int) -> NDArray[np.int64]:
    """Return how many faces cover the center of each texel of the unit square.

    A center on the edge that two faces share counts for exactly one of them, whether or not the edge's vertices
    are the same, as long as their uv are.

    Parameters
    ----------
    uv : (n, 2) float64, finite; what lies outside [0, 1] is cut off
    faces : (m, 3)
    size : texels a side

    Returns
    -------
    (size, size) int64; row 0 lies at v = 0
    """
    triangles = uv[faces] * size
    heights = triangles[:, :, 1]
    low = first_center(heights.min(axis=1), size)
    rows = np.maximum(first_center(heights.max(axis=1), size) - low, 0)
    # Along a row, +1 where a face begins and -1 where it ends; their running sum counts faces without visiting texels.
    steps = np.zeros(size * (size + 1), dtype=np.int64)
    chunk = np.cumsum(rows) // SPANS_AT_ONCE
    for part in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(chunk)) + 1):
        face = np.repeat(part, rows[part])
        row = np.arange(len(face)) - np.repeat(np.cumsum(rows[part]) - rows[part], rows[part]) + low[face]
        begin, end = span_of_row(triangles[face], row + 0.5)
        first, stop = first_center(begin, size), first_center(end, size)
        steps += np.bincount(row * (size + 1) + first, minlength=len(steps))
        steps -= np.bincount(row * (size + 1) + stop, minlength=len(steps))
    return np.cumsum(steps.reshape(size, size + 1), axis=1)[:, :size]


def span_of_row(triangles: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return where the line at height y enters and leaves each triangle, each (k,); (k, 3, 2) triangles cross it."""
    begin, end = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for corner in range(3):
        p, q = triangles[:, corner], triangles[:, (corner + 1) % 3]
        # Both faces of an edge must compute bitwise the same crossing, so the edge always runs upward.
        upward = (p[:, 1] < q[:, 1])[:, None]
        p, q = np.where(upward, p, q), np.where(upward, q, p)
        crossed = (p[:, 1] <= y) & (y < q[:, 1])
        rise = np.where(crossed, q[:, 1] - p[:, 1], 1.0)
        x = p[:, 0] + (y - p[:, 1]) / rise * (q[:, 0] - p[:, 0])
        begin = np.where(crossed, np.minimum(begin, x), begin)
        end = np.where(crossed, np.maximum(end, x), end)
    return begin, np.maximum(end, begin)


def first_center(coordinate: Floats, size: int) -> NDArray[np.int64]:
    """Return the first texel whose center lies at or beyond `coordinate` (in texels), within 0 to size."""
    return np.clip(np.ceil(coordinate - 0.5), 0, size).astype(np.int64)


def _scatter(index: Integers, values: Floats, count: int) -> Floats:
    """Return the sums, (count, d), of the rows of `values`, (k, d), that share an index."""
    return np.stack([np.bincount(index, weights=column, minlength=count) for column in values.T], axis=1)


def _unit(vectors: Floats) -> Floats:
    """Return (n, 3) vectors at length 1; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)
