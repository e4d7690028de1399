"""A ball, on which a skin shows every direction of light: six charts of nearly equal texels."""

from __future__ import annotations

import numpy as np

from skincli.mesh.builtin.levels import DETAILS
from skincli.mesh.model import Mesh, Part

RADIUS = 60.0

#: cells along an edge of the cube, by level of detail
_CELLS = (18, 37, 74)

#: space around each chart, in uv
_MARGIN = 0.01

#: outward axis, and the axes along which u and v grow, of each side of the cube
_SIDES = (
    ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
)


def sphere(detail: str) -> Mesh:
    """Return the ball of RADIUS mm: a cube whose sides are cut at equal angles and pushed outwards.

    Parameters
    ----------
    detail : a level of DETAILS["sphere"]
    """
    cells = _CELLS[DETAILS["sphere"].index(detail)]
    column, row = (grid.ravel() for grid in np.meshgrid(np.arange(cells + 1), np.arange(cells + 1)))
    share = np.stack([column, row], axis=1) / cells
    angle = np.tan((share - 0.5) * (np.pi / 2))
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up = first + 1, first + cells + 1
    quads = np.stack([first, right, up + 1, first, up + 1, up], axis=1).reshape(-1, 3)
    normals, uv, faces = [], [], []
    for number, axes in enumerate(_SIDES):
        outward, along, upward = (np.array(axis, float) for axis in axes)
        points = outward + angle[:, :1] * along + angle[:, 1:] * upward
        normals.append(points / np.linalg.norm(points, axis=1, keepdims=True))
        corner = np.array([number % 3, number // 3])
        uv.append((corner + _MARGIN + (1 - 2 * _MARGIN) * share) / 3)
        faces.append(quads + number * len(points))
    direction, flat = np.concatenate(normals), np.concatenate(uv)
    triangles = np.concatenate(faces).astype(np.int32)
    return Mesh(RADIUS * direction, direction, flat, flat, triangles, (Part("sphere", 0, len(triangles)),))
