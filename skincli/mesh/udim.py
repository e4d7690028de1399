"""UV laid out in UDIM tiles, each of which wants maps of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skincli.errors import LimitError
from skincli.mesh.model import Mesh

#: tiles in a row, by the convention that numbers them 1001 + u + 10 v
COLUMNS = 10

#: share of the faces that a tile has at least: fewer are a slip of the hand, not a layout
LEAST_SHARE = 0.01


def tiles(mesh: Mesh, parts: Sequence[int]) -> list[int]:
    """Return the numbers of the UDIM tiles over which some parts of a mesh are spread, such as [1001, 1002].

    Parameters
    ----------
    mesh : its authored uv counts
    parts : indices of the parts that share their maps

    Returns
    -------
    in rising order; none where a face crosses the border of a tile, or lies beyond the ten columns or below the first
    row: such uv repeat one map
    """
    faces = np.concatenate([mesh.faces[mesh.parts[part].start : mesh.parts[part].stop] for part in parts])
    corners = mesh.uv[faces]
    tile = np.floor(corners.mean(axis=1)).astype(np.int64)
    inside = (np.abs(corners - tile[:, None] - 0.5) <= 0.5 + 1e-6).all()
    if not inside or (tile < 0).any() or (tile[:, 0] >= COLUMNS).any():
        return []
    numbers, counts = np.unique(1001 + tile[:, 0] + COLUMNS * tile[:, 1], return_counts=True)
    return [int(number) for number in numbers[counts >= LEAST_SHARE * len(faces)]]


def require_one_tile(mesh: Mesh, parts: Sequence[int]) -> None:
    """Raise a LimitError where one set of maps would have to serve several UDIM tiles."""
    found = tiles(mesh, parts)
    if len(found) > 1:
        shown = ", ".join(map(str, found[:8])) + (", ..." if len(found) > 8 else "")
        names = ", ".join(f"'{mesh.parts[part].name}'" for part in parts[:4]) + (", ..." if len(parts) > 4 else "")
        raise LimitError(
            f"the uv of {names} lie in {len(found)} UDIM tiles: {shown}; a skin's maps fill one tile; lay the uv out "
            "in one tile (0 to 1), or make each tile a part of its own"
        )
