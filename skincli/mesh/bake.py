"""What a point of the surface knows of its surroundings: ambient occlusion by ray tracing, and mean curvature."""

from __future__ import annotations

import hashlib
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skincli import diskcache
from skincli.errors import DeviceError
from skincli.mesh import surface
from skincli.mesh.model import Mesh
from skincli.mesh.subdivide import subdivided
from skincli.mesh.surface import Floats, Integers

REACH = 40.0
"""mm. Beyond it nothing occludes: about the width of an eye socket and half that of a neck's shadow."""

SMOOTHING = 2.0
"""mm. Finer changes of curvature belong to the bump map."""

RAYS = 256
"""Per point. Leaves an RMS error of about 0.005 on the built-in meshes."""

RESOLVED, MOST_FACES = 0.6, 2 << 20
"""Curvature is averaged over triangles whose mean width (root of the area) is so many times the smoothing at most,
unless they become more than this: then a mesh and the same in four times the triangles look alike."""

LIFT = 1e-5
"""How far rays start off the surface, as a share of the mesh's extent: hundreds of float32 steps, no visible gap."""

SAME = 1e-7
"""Points nearer to each other than this share of the mesh's extent are one: seams need not agree to the last digit."""

SAME_NORMAL = 1e-4
"""Normals of one point that differ by less are one."""

RAYS_AT_ONCE = 1 << 17
"""Rays a thread holds in memory together: about 10 MB."""

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

THIN = 1e-6
"""A triangle of less area than this share of its longest edge's square has no normal worth the name."""

STEEPEST = 1e4
"""Bound of the cotangents: that of an angle of 0.006 degrees."""


@dataclass(frozen=True)
class Bake:
    """The bake of a mesh, one value per vertex; vertices that seams split have equal values.

    Parameters
    ----------
    occlusion : (n,) float64 in [0, 1], cosine-weighted share of the hemisphere about the vertex normal in which nothing
        lies within reach; 1 open, 0 closed
    curvature : (n,) float64, 1/mm, mean curvature; positive where convex: 1/r on a ball of radius r
    """

    occlusion: Floats
    curvature: Floats


def bake(
    mesh: Mesh, *, reach: float = REACH, smoothing: float = SMOOTHING, rays: int = RAYS, use_cache: bool = True
) -> Bake:
    """Return occlusion and curvature at each vertex, from the disk cache when they were baked before.

    They depend on positions, faces and normals alone: other UVs read the same entry.

    Parameters
    ----------
    mesh : in mm
    reach : mm, > 0, may be infinite; how near a surface must be to occlude
    smoothing : mm, >= 0; see `mean_curvature`
    rays : per vertex, >= 1
    use_cache : whether the disk cache is read and written

    Raises
    ------
    DeviceError
        If the ray tracer is not installed and the bake is not in the cache.
    ValueError
        If a setting is out of range.
    """
    digest = hashlib.blake2b(digest_size=16)
    # The sources are part of the key: another method makes another entry.
    for source in (__file__, surface.__file__):
        digest.update(Path(source).read_bytes())
    for array in (mesh.positions, mesh.normals, mesh.faces):
        digest.update(np.ascontiguousarray(array).tobytes())

    def make() -> diskcache.Arrays:
        return {
            "occlusion": _vertex_occlusion(mesh, reach, rays),
            "curvature": mean_curvature(_resolved(mesh, smoothing), smoothing=smoothing)[: len(mesh.positions)],
        }

    key = f"{digest.hexdigest()}:{float(reach)}:{float(smoothing)}:{int(rays)}"
    return Bake(**diskcache.arrays("bake", key, make, enabled=use_cache))


# ---------------------------------------------------------------- occlusion


class RayScene:
    """A mesh ready for ray tracing by Embree, which computes in float32: in here it has the extent 1.

    So meshes of a micrometer and of kilometers are traced alike. Surfaces block from both sides.

    Parameters
    ----------
    mesh : positions and faces are used

    Raises
    ------
    DeviceError
        If the ray tracer is not installed.
    """

    def __init__(self, mesh: Mesh) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise DeviceError(
                f"the ray tracer for occlusion cannot be loaded ({error}); the Python package embreex is needed; "
                "install it with 'pip install embreex', on a machine for which it is offered"
            ) from None
        self.center: Floats = 0.5 * (mesh.positions.min(axis=0) + mesh.positions.max(axis=0))
        self.extent = _extent(mesh)
        # The robust mode is watertight: no ray slips through between two triangles.
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(self._scene, self._local(mesh.positions), np.ascontiguousarray(mesh.faces, dtype=np.int32))
        # The first query builds the tree, which threads must not do at the same time.
        self.blocked(self.center[None], np.array([[0.0, 0.0, 1.0]]), 1.0)

    def _local(self, points: Floats) -> NDArray[np.float32]:
        return ((points - self.center) / self.extent).astype(np.float32)

    def blocked(self, points: Floats, directions: Floats | NDArray[np.float32], reach: float) -> NDArray[np.bool_]:
        """Return whether a surface lies within `reach` along each ray; safe among threads.

        Parameters
        ----------
        points : (k, 3) mm, where rays start; on a surface, move them off by `LIFT` times `extent` at least
        directions : (k * j, 3), unit; j rays from each point, those of a point in succession
        reach : mm, may be infinite

        Returns
        -------
        (k * j,) bool
        """
        starts = np.repeat(self._local(points), len(directions) // max(len(points), 1), axis=0)
        farthest = min(reach / self.extent, float(np.finfo(np.float32).max))
        hit = self._scene.run(starts, directions.astype(np.float32, copy=False), dists=farthest, query="OCCLUDED")
        return np.asarray(hit >= 0)

    def distance(self, start: Floats, directions: Floats) -> Floats:
        """Return how far from `start`, (3,) mm, the first surface lies along (k, 3) unit directions; inf where none."""
        starts = np.repeat(self._local(start[None]), len(directions), axis=0)
        found = self._scene.run(starts, directions.astype(np.float32), query="DISTANCE").astype(np.float64)
        # A ray that hits nothing has 1e37.
        return np.where(found < 1e36, found * self.extent, math.inf)


def occlusion_at(
    mesh: Mesh,
    points: Floats,
    normals: Floats,
    *,
    reach: float = REACH,
    rays: int = RAYS,
    sides: Floats | None = None,
    seeds: Integers | None = None,
) -> Floats:
    """Return the cosine-weighted share of each point's hemisphere in which nothing lies within reach.

    Parameters
    ----------
    mesh : what occludes
    points : (k, 3) mm, on the mesh or near it
    normals : (k, 3), unit; the hemisphere's axis, such as an interpolated vertex normal
    reach : mm, > 0, may be infinite
    rays : per point, >= 1
    sides : (k, 3), unit; the way off the surface, along which rays start a little ahead of the point, such as the
        normal of the triangle; `normals` where None
    seeds : (k,) integers that turn the pattern of rays, equal where points must have the same; 0 to k - 1 where None

    Returns
    -------
    (k,) float64, multiples of 1 / rays; 1 open, 0 closed. The same for the same arguments, in any number of threads.

    Raises
    ------
    DeviceError
        If the ray tracer is not installed.
    ValueError
        If a setting is out of range.

    Notes
    -----
    Directions are a Fibonacci spiral on the disk under the hemisphere: uniform there is cosine-weighted above
    (Malley's method). A hash of the seed turns the spiral and shifts it along its radius, so that what error remains
    is noise instead of bands.
    """
    if not reach > 0.0:
        raise ValueError(f"reach is {reach} mm; above 0 is allowed")
    if rays < 1:
        raise ValueError(f"rays is {rays}; 1 or more is allowed")
    scene = RayScene(mesh)
    starts = points + LIFT * scene.extent * (normals if sides is None else sides)
    seeds = np.arange(len(points)) if seeds is None else seeds
    at_once = max(1, RAYS_AT_ONCE // rays)

    def chunk(first: int) -> Floats:
        part = slice(first, first + at_once)
        directions = _hemisphere(normals[part], seeds[part], rays)
        blocked = scene.blocked(starts[part], directions.reshape(-1, 3), reach)
        return 1.0 - blocked.reshape(-1, rays).mean(axis=1)

    # Tracing and array arithmetic let other threads run.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return np.concatenate([np.zeros(0), *pool.map(chunk, range(0, len(points), at_once))])


def _hemisphere(normals: Floats, seeds: Integers, rays: int) -> NDArray[np.float32]:
    """Return (k, rays, 3) unit directions, cosine-weighted about each normal."""
    word = _pcg(seeds)
    turn, shift = (word >> np.uint32(16)) / 2.0**16, (word & np.uint32(0xFFFF)) / 2.0**16
    number = np.arange(rays)
    square = ((number + shift[:, None]) / rays).astype(np.float32)
    angle = (2.0 * np.pi * ((number * GOLDEN) % 1.0 + turn[:, None])).astype(np.float32)
    radius = np.sqrt(square)
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - square)], axis=2)
    return np.asarray(local @ _frames(normals).astype(np.float32))


def _pcg(words: Integers) -> NDArray[np.uint32]:
    """Return the hash PCG-RXS-M-XS 32 of integers [Jarzynski2020]."""
    state = words.astype(np.uint32) * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    return (word >> np.uint32(22)) ^ word


def _frames(normals: Floats) -> Floats:
    """Return (k, 3, 3): two tangents and the normal as rows, right-handed [Duff2017]."""
    x, y, z = normals.T
    sign = np.where(z < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    tangent = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    bitangent = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([tangent, bitangent, normals], axis=1)


def _vertex_occlusion(mesh: Mesh, reach: float, rays: int) -> Floats:
    """Return the occlusion at each vertex, (n,)."""
    points, point = _weld(mesh)
    # Rays start where the surface itself leaves room, on the outer side of every face that meets in the point: along
    # a normal of one wall only, the vertex of a corner would stay in the plane of the other.
    sides = surface.angle_weighted_normals(points, point[mesh.faces])[point]
    # A sheet welded to its own back side has no outer side of its own.
    facing = np.einsum("ij,ij->i", sides, mesh.normals) > 0.0
    sides = np.where(facing[:, None], sides, mesh.normals)
    places = (points[point] - points[:1]) / _extent(mesh)
    first, group = _groups(np.hstack([places, mesh.normals * (SAME / SAME_NORMAL)]))
    # One pattern of rays per point, whatever the normal: nearly equal normals of a seam get nearly equal values.
    values = occlusion_at(
        mesh, mesh.positions[first], mesh.normals[first], reach=reach, rays=rays, sides=sides[first], seeds=point[first]
    )
    return values[group]


# ---------------------------------------------------------------- curvature


def mean_curvature(mesh: Mesh, *, smoothing: float = SMOOTHING) -> Floats:
    """Return the mean curvature at each vertex, averaged over its surroundings on the surface.

    Parameters
    ----------
    mesh : positions and faces are used; its own normals are not, for hard edges are curved too
    smoothing : mm, >= 0; standard deviation of the average's weights, along each direction in the surface

    Returns
    -------
    (n,) float64, 1/mm; positive where convex, 1/r on a ball of radius r; 0 on vertices without faces

    Raises
    ------
    ValueError
        If smoothing is negative or not finite.

    Notes
    -----
    Twice the mean curvature is the divergence of the unit normal. With the normal linear on each triangle its integral
    there is the sum of normal times gradient of the hat function times area, in which no area divides, so borders need
    no special case. Vertex normals are those of [Max1999], which make the curvature of any triangulated ball exact; by
    angle or area as weights it is some percent off. The average is heat flow over the surface [Desbrun1999]: two
    implicit steps with the cotangent Laplacian and lumped areas, together of variance `smoothing`² by each direction;
    nothing flows across the surface's border.
    """
    if not (smoothing >= 0.0 and math.isfinite(smoothing)):
        raise ValueError(f"smoothing is {smoothing} mm; a finite length of 0 or more is allowed")
    points, point = _weld(mesh)
    faces = point[mesh.faces]
    # Edge k runs from corner k to the next.
    edges = points[np.roll(faces, -1, axis=1)] - points[faces]
    squares = np.einsum("ijk,ijk->ij", edges, edges)
    vectors = surface.area_vectors(points, faces)
    area = np.linalg.norm(vectors, axis=1)
    solid = area > THIN * squares.max(axis=1, initial=0.0)

    def gather(faces: Integers, per_corner: Floats) -> Floats:
        """Return the sums at each point, (p,), of values per face and corner, (m, 3)."""
        sums = np.bincount(faces.ravel(), weights=per_corner.ravel(), minlength=len(points))
        return sums.astype(np.float64, copy=False)

    areas = gather(faces, np.repeat(area[:, None] / 3.0, 3, axis=1))
    corners, edges, squares, vectors, area = (values[solid] for values in (faces, edges, squares, vectors, area))
    weights = 1.0 / (squares * np.roll(squares, 1, axis=1))
    normals = np.stack([gather(corners, weights * axis[:, None]) for axis in vectors.T], axis=1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(length > 0.0, length, 1.0)
    # The gradient of a corner's hat function times the area: half the edge opposite, turned into the triangle.
    inward = 0.5 * np.cross((vectors / area[:, None])[:, None], np.roll(edges, -1, axis=1))
    divergence = np.einsum("ijk,ijk->i", normals[corners], inward)
    curvature = gather(corners, np.repeat(divergence[:, None] / 6.0, 3, axis=1)) / np.where(areas > 0.0, areas, 1.0)
    if smoothing > 0.0:
        curvature = _diffuse(points, faces, areas, curvature, 0.5 * smoothing**2)
    return curvature[point]


def _resolved(mesh: Mesh, smoothing: float) -> Mesh:
    """Return a mesh, or the same surface in triangles so small that the average does not depend on their size."""
    while True:
        area = surface.face_areas(mesh)
        width = math.sqrt(float(area.sum()) / max(len(area), 1))
        if width <= RESOLVED * smoothing or smoothing == 0.0 or 4 * len(area) > MOST_FACES:
            return mesh
        mesh = subdivided(mesh)


def _diffuse(points: Floats, faces: Integers, areas: Floats, values: Floats, time: float) -> Floats:
    """Return `values`, (n,), after heat flow for `time` (mm²; half the variance) in two implicit steps."""
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import cg

    rows, columns, weights = [], [], []
    for corner in range(3):
        here, ahead, behind = (faces[:, (corner + k) % 3] for k in range(3))
        a, b = points[ahead] - points[here], points[behind] - points[here]
        sine = np.linalg.norm(np.cross(a, b), axis=1)
        cosine = np.einsum("ij,ij->i", a, b)
        # Negative cotangents would let heat flow from cold to warm, boundless ones leave the solver no digits.
        cotangent = np.clip(cosine / np.maximum(sine, np.abs(cosine) / STEEPEST + np.finfo(float).tiny), 0.0, STEEPEST)
        rows += [ahead, behind]
        columns += [behind, ahead]
        weights += [0.5 * cotangent, 0.5 * cotangent]
    count = len(points)
    flow = coo_array(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=(count, count)
    ).tocsr()
    diagonal = areas + 0.5 * time * flow.sum(axis=1)
    # A point without faces has none of either.
    diagonal[diagonal == 0.0] = 1.0
    step, scaling = diags_array(diagonal) - 0.5 * time * flow, diags_array(1.0 / diagonal)
    for _ in range(2):
        # The matrix is diagonally dominant: conjugate gradients settle within a few hundred rounds.
        values, _ = cg(step, areas * values, x0=values, rtol=1e-9, M=scaling)
    return values


def _weld(mesh: Mesh) -> tuple[Floats, NDArray[np.int64]]:
    """Return the mesh's different positions, (p, 3), and each vertex's, (n,)."""
    first, point = _groups((mesh.positions - mesh.positions[:1]) / _extent(mesh))
    return mesh.positions[first], point


def _groups(rows: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first row of each group of rows within `SAME` of each other, and each row's group, (n,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(rows).query_pairs(SAME, output_type="ndarray")
    count = len(rows)
    near = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, group = connected_components(near, directed=False)
    _, first = np.unique(group, return_index=True)
    return first, group.astype(np.int64)


def _extent(mesh: Mesh) -> float:
    """Return the longest side of the bounding box, mm; 1 where there is none."""
    return float(np.ptp(mesh.positions, axis=0).max()) or 1.0
