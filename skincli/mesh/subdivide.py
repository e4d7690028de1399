"""The same surface in more triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skincli.mesh.model import Mesh


def subdivided(mesh: Mesh) -> Mesh:
    """Return a mesh in which every triangle is cut into four, while no point of the surface moves.

    Its first vertices are those of the mesh.
    """
    sides = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, middle = np.unique(sides, axis=0, return_inverse=True)
    # The middles of the sides 01, 12 and 20 of every face.
    ab, bc, ca = (middle.reshape(-1, 3) + len(mesh.positions)).T
    a, b, c = mesh.faces.T
    faces = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3).astype(np.int32)
    positions, normals, uv, atlas_uv = (
        np.concatenate([array, array[edges].mean(axis=1)])
        for array in (mesh.positions, mesh.normals, mesh.uv, mesh.atlas_uv)
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    parts = tuple(replace(part, start=4 * part.start, stop=4 * part.stop) for part in mesh.parts)
    return replace(mesh, positions=positions, normals=normals, uv=uv, atlas_uv=atlas_uv, faces=faces, parts=parts)
