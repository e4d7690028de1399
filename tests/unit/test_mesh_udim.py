"""Which uv count as a layout in UDIM tiles, and which as one map that repeats."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from skincli.errors import LimitError
from skincli.mesh.model import Mesh, Part
from skincli.mesh.udim import require_one_tile, tiles


def grid(*corners: tuple[float, float], side: float = 0.9, parts: int = 1) -> Mesh:
    """Return a mesh whose uv are squares of two triangles, one at each corner; each an equal run of parts."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side
    uv: NDArray[np.float64] = np.concatenate([square + corner for corner in corners])
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * index for index in range(len(corners))])
    length = len(faces) // parts
    named = tuple(Part(f"part {index}", index * length, (index + 1) * length) for index in range(parts))
    positions = np.column_stack([uv, np.zeros(len(uv))])
    return Mesh(positions, np.tile([0.0, 0, 1], (len(uv), 1)), uv, uv, faces.astype(np.int32), named)


@pytest.mark.parametrize(
    ("corners", "found"),
    [
        ([(0, 0)], [1001]),
        ([(0, 0), (1, 0), (0.05, 1.05)], [1001, 1002, 1011]),
        ([(9, 2), (9.05, 2.05)], [1030]),
        ([(0, 0), (1.5, 0)], []),  # one crosses a border: the map repeats
        ([(0, 0), (-1, 0)], []),
        ([(0, 0), (10, 0)], []),
        ([(0, 0)] * 199 + [(1, 0)], [1001]),  # fewer than one in a hundred
    ],
)
def test_tiles(corners: list[tuple[float, float]], found: list[int]) -> None:
    assert tiles(grid(*corners), [0]) == found


def test_a_face_may_touch_the_border_of_its_tile() -> None:
    assert tiles(grid((0, 0), (1, 0), side=1), [0]) == [1001, 1002]


def test_parts_that_share_maps_are_judged_together() -> None:
    mesh = grid((0, 0), (1, 0), parts=2)
    require_one_tile(mesh, [0])
    require_one_tile(mesh, [1])
    with pytest.raises(LimitError, match=r"the uv of 'part 0', 'part 1' lie in 2 UDIM tiles: 1001, 1002; .* one tile"):
        require_one_tile(mesh, [0, 1])
