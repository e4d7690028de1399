"""A mesh on the GPU: one interleaved vertex buffer and the ways in which passes draw it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from skincli.gpu.context import get_context
from skincli.gpu.counters import COUNTERS
from skincli.mesh import surface
from skincli.mesh.bake import Bake
from skincli.mesh.model import Mesh

#: attribute name -> number of floats, in the order of the vertex buffer
ATTRIBUTES = {
    "in_position": 3,
    "in_normal": 3,
    "in_uv": 2,
    "in_atlas_uv": 2,
    "in_dpdu": 3,
    "in_dpdv": 3,
    "in_baked": 2,
}


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh as passes see it; buffers are made when the first draw asks for them.

    Parameters
    ----------
    mesh : positions in mm relative to its origin; they become float32 here and nowhere earlier
    baked : what was baked of the mesh, None where nobody asks for it
    """

    mesh: Mesh
    baked: Bake | None = None

    @property
    def key(self) -> str:
        """The mesh's content hash, without its place in the scene: passes work relative to it."""
        return self.mesh.key + ("" if self.baked is None else " baked")

    @cached_property
    def vertices(self) -> NDArray[np.float32]:
        """(n, 18) the attributes side by side."""
        mesh = self.mesh
        dpdu, dpdv = surface.tangents(mesh.positions, mesh.faces, mesh.uv)
        if self.baked is None:
            baked = np.tile([1.0, 0.0], (len(mesh.positions), 1))
        else:
            baked = np.column_stack([self.baked.occlusion, self.baked.curvature])
        columns = [mesh.positions, mesh.normals, mesh.uv, mesh.atlas_uv, dpdu, dpdv, baked]
        return np.concatenate(columns, axis=1).astype(np.float32)

    @cached_property
    def _vertex_buffer(self) -> moderngl.Buffer:
        return _buffer(self.vertices)

    @cached_property
    def _topologies(self) -> dict[str, _Topology]:
        return {}

    def _topology(self, name: str) -> _Topology:
        if name not in self._topologies:
            self._topologies[name] = getattr(self, f"_{name}")()
        return self._topologies[name]

    def _faces(self) -> _Topology:
        ranges = [(3 * part.start, 3 * (part.stop - part.start)) for part in self.mesh.parts]
        return _Topology(self._vertex_buffer, _buffer(self.mesh.faces.astype(np.int32)), ranges)

    def _atlas_gutter(self) -> _Topology:
        return self._gutter(self.mesh.atlas_uv, shifted=False)

    def _map_gutter(self) -> _Topology:
        return self._gutter(self.mesh.uv, shifted=True)

    def _gutter(self, uv: NDArray[np.float64], shifted: bool) -> _Topology:
        """A strip along every chart border: its outer vertices carry the border's attributes and a direction.

        Parameters
        ----------
        uv : (n, 2) in which charts are continued
        shifted : move each strip into the unit square, as `tiles` does with faces
        """
        column = list(ATTRIBUTES).index("in_uv")
        start = sum(list(ATTRIBUTES.values())[:column])
        vertices, ranges, first = [], [], 0
        for part in self.mesh.parts:
            a, b, opposite = surface.border_edges(self.mesh.faces[part.start : part.stop]).T
            along = uv[b] - uv[a]
            length = np.linalg.norm(along, axis=1, keepdims=True)
            along = along / np.where(length > 0, length, 1)
            outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
            inside = np.sum(outward * (uv[opposite] - uv[a]), axis=1, keepdims=True) > 0
            outward = np.where(inside, -outward, outward)
            # Each strip also reaches past its ends, which closes the wedge at a corner.
            zero = np.zeros_like(along)
            corners = np.stack([a, b, b, a], axis=1)
            offsets = np.stack([zero, zero, outward + along, outward - along], axis=1)
            quads = np.concatenate([self.vertices[corners], offsets.astype(np.float32)], axis=2)
            if shifted:
                quads[:, :, start : start + 2] -= np.floor((uv[a] + uv[b]) / 2)[:, None].astype(np.float32)
            vertices.append(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, quads.shape[2]))
            ranges.append((first, 6 * len(a)))
            first += 6 * len(a)
        return _Topology(_buffer(np.concatenate(vertices)), _indices(first), ranges, offsets=True)

    def _tiles(self) -> _Topology:
        """Faces moved into the unit square of their maps, several times where they cross its border."""
        vertices, ranges, first = [], [], 0
        column = sum(list(ATTRIBUTES.values())[:2])
        for part in self.mesh.parts:
            faces = self.mesh.faces[part.start : part.stop]
            index, shift = surface.raster_tiles(self.mesh.uv, faces)
            corners = self.vertices[faces[index]]
            corners[:, :, column : column + 2] += shift[:, None, :].astype(np.float32)
            vertices.append(corners.reshape(-1, corners.shape[-1]))
            ranges.append((first, 3 * len(index)))
            first += 3 * len(index)
        return _Topology(_buffer(np.concatenate(vertices)), _indices(first), ranges)

    def vertex_array(self, program: moderngl.Program, topology: str) -> moderngl.VertexArray:
        """Return the vertex array that feeds `program` ("faces", "tiles", "atlas_gutter" or "map_gutter")."""
        found = self._topology(topology)
        attributes = ATTRIBUTES | ({"in_offset": 2} if found.offsets else {})
        names = [name for name in attributes if name in program]
        layout = " ".join(f"{count}f" if name in names else f"{4 * count}x" for name, count in attributes.items())
        return get_context().vertex_array(program, [(found.vertices, layout, *names)], found.indices)

    def part_range(self, topology: str, part: int) -> tuple[int, int]:
        """Return (first index, count of indices) of a part."""
        return self._topology(topology).ranges[part]


@dataclass(frozen=True, eq=False)
class _Topology:
    """Buffers of triangles and, per part, (first index, count). Without `offsets`, in_offset reads 0."""

    vertices: moderngl.Buffer
    indices: moderngl.Buffer
    ranges: list[tuple[int, int]]
    offsets: bool = False


def _indices(count: int) -> moderngl.Buffer:
    return _buffer(np.arange(count, dtype=np.int32))


def _buffer(array: NDArray[np.float32] | NDArray[np.int32]) -> moderngl.Buffer:
    data = np.ascontiguousarray(array).tobytes()
    COUNTERS.uploads += 1
    COUNTERS.bytes_uploaded += len(data)
    return get_context().buffer(data or b"\0" * 4)
