"""The surface points that own the texels of the light's atlas, computed without GL: where static tables begin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.mesh import surface
from skincli.mesh.model import Mesh

_AROUND = [(dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy]


@dataclass(frozen=True)
class Texels:
    """Surface points at texel centers, in the order of their texels.

    Parameters
    ----------
    index : (n,) int64, row * size + column; row 0 lies at v = 0, as gl_FragCoord counts
    positions : (n, 3) float64, mm
    normals : (n, 3) float64, unit, interpolated like a shader does
    areas : (n,) float64, mm² of surface that the texel stands for; 0 in the gutter, which only receives
    """

    index: NDArray[np.int64]
    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    areas: NDArray[np.float64]


def atlas_texels(mesh: Mesh, size: int, gutter: int = 0) -> Texels:
    """Return the surface point at the center of every texel that a face of the atlas covers.

    Parameters
    ----------
    mesh : its `atlas_uv` is the atlas
    size : texels a side
    gutter : texels by which charts are continued, along the plane of the nearest covered texel's face

    Notes
    -----
    Coverage follows GL: a center on an edge that two faces share belongs to exactly one of them, and where faces
    overlap the later one wins. GL snaps vertices to 1/256 of a texel, so centers closer to an edge may differ.
    """
    covered, face = _owners(mesh.atlas_uv, mesh.faces, size)
    corners = mesh.faces[face]
    uv = mesh.atlas_uv[corners] * size
    center = np.stack([covered % size, covered // size], axis=1) + 0.5
    # Affine map of each face from texels to the barycentric weights of its second and third corner.
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    determinant = a * d - b * c
    determinant = np.where(np.abs(determinant) > 0, determinant, 1.0)
    inverse = np.stack([np.stack([d, -c], axis=1), np.stack([-b, a], axis=1)], axis=1) / determinant[:, None, None]
    weights = np.einsum("nij,nj->ni", inverse, center - uv[:, 0])

    def interpolated(values: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        first, second, third = (values[corners[:, k]] for k in range(3))
        return first + weights[:, :1] * (second - first) + weights[:, 1:] * (third - first)

    positions = interpolated(mesh.positions, weights)
    normals = _unit(interpolated(mesh.normals, weights))
    areas = surface.face_areas(mesh)[face] / (0.5 * np.abs(determinant))
    index = covered
    if gutter:
        origin, index = _dilated(covered, size, gutter)
        moved = np.stack([index % size - covered[origin] % size, index // size - covered[origin] // size], axis=1)
        step = np.einsum("nij,nj->ni", inverse[origin], moved.astype(np.float64))
        first, second, third = (mesh.positions[corners[origin, k]] for k in range(3))
        positions = positions[origin] + step[:, :1] * (second - first) + step[:, 1:] * (third - first)
        normals = normals[origin]
        areas = np.where(moved.any(axis=1), 0.0, areas[origin])
    return Texels(index, positions, normals, areas)


def _owners(
    uv: NDArray[np.float64], faces: NDArray[np.int32], size: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the covered texels, ascending, and the face that owns each: the last one that covers its center."""
    triangles = uv[faces] * size
    heights = triangles[:, :, 1]
    low = surface.first_center(heights.min(axis=1), size)
    rows = np.maximum(surface.first_center(heights.max(axis=1), size) - low, 0)
    face = np.repeat(np.arange(len(rows)), rows)
    row = _counted(rows) + low[face]
    begin, end = surface.span_of_row(triangles[face], np.asarray(row + 0.5, dtype=np.float64))
    first = surface.first_center(begin, size)
    columns = surface.first_center(end, size) - first
    owner = np.full(size * size, -1, dtype=np.int64)
    # An assignment to repeated places keeps the last value.
    owner[np.repeat(row * size + first, columns) + _counted(columns)] = np.repeat(face, columns)
    covered = np.flatnonzero(owner >= 0)
    return covered, owner[covered]


def _counted(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return 0, 1, ... count - 1 for every count, one after the other."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def _dilated(covered: NDArray[np.int64], size: int, gutter: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the texels within `gutter` steps of covered ones, ascending, and the covered one that each came from."""
    side = size + 2
    inner = (slice(1, -1), slice(1, -1))
    origin = np.full((side, side), -1, dtype=np.int64)
    origin[inner].flat[covered] = np.arange(len(covered))
    for _ in range(gutter):
        grown = origin.copy()
        for dx, dy in _AROUND:
            beside = np.roll(origin, (dy, dx), axis=(0, 1))
            grown = np.where(grown < 0, beside, grown)
        origin[inner] = grown[inner]
    flat = origin[inner].ravel()
    index = np.flatnonzero(flat >= 0)
    return flat[index], index


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
