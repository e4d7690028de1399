"""Which part of the surface lies near what the picture sees, so that light elsewhere need not be computed.

Space about the mesh is parted into cubes. Those in which the picture sees a surface are marked, with their neighbors;
wanted are the tiles of the atlas with a texel in one of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values, Vec3
from skincli.graph.node import Draw, Input, Node, Output, Pass, Ref, Source
from skincli.passes.seen import tile_defines, tile_extent

#: cubes along the longest side of the mesh, at most
MOST_CUBES = 40


@dataclass(frozen=True)
class NearValues(Values):
    """The cubes; those of one z stand side by side in a texture, with x along its rows.

    Parameters
    ----------
    low : corner of the first, mm
    side : mm
    count : along each axis
    """

    low: Vec3
    side: float
    count: Vec3


class Met(Pass):
    """1 at the cubes in which the picture sees a surface."""

    shader = "passes/met.frag"
    vertex = "passes/met.vert"
    inputs = {"depth": Input(), "uv": Input(), "position": Input()}
    outputs = {"met": Output("r32f")}


class Near(Pass):
    """1 at those cubes and their neighbors."""

    shader = "passes/near.frag"
    inputs = {"met": Input()}
    outputs = {"near": Output("r32f")}


class Wanted(Pass):
    """1 at the tiles of the atlas with a texel in such a cube."""

    shader = "passes/wanted.frag"
    inputs = {"near": Input(), "position": Input()}
    outputs = {"wanted": Output("r32f")}


def cubes(positions: NDArray[np.float64], reach: float) -> NearValues:
    """Return cubes about points, such that what lies within reach of a point lies in its cube or one beside it.

    Parameters
    ----------
    positions : (n, 3) mm
    reach : mm
    """
    low, high = positions.min(axis=0), positions.max(axis=0)
    side = max(reach, float((high - low).max()) / (MOST_CUBES - 1), 1e-30)
    count = np.floor((high - low) / side) + 1
    return NearValues(tuple(map(float, low)), side, tuple(map(float, count)))


def near_nodes(
    atlas: tuple[int, int], size: tuple[int, int], values: NearValues, depth: Source, uv: Source, position: Source
) -> list[Node]:
    """Return the nodes; the last, "wanted", has the output `wanted`.

    Parameters
    ----------
    atlas, size : of the atlas and of the picture
    values : see `cubes`
    depth, uv : of the picture: above 0 where there is a surface; where it reads the atlas (zw)
    position : of the surface in the atlas (xyz, mm; w above 0 where there is any)
    """
    across, high, deep = (int(count) for count in values.count)
    grid = (across * deep, high)
    read: dict[str, Source] = {"depth": depth, "uv": uv, "position": position}
    met = Met("met", grid, [Draw(values, points=math.prod(size))], read)
    near = Near("near", grid, [Draw(values)], {"met": Ref("met", "met")})
    found: dict[str, Source] = {"near": Ref("near", "near"), "position": position}
    return [met, near, Wanted("wanted", tile_extent(atlas), [Draw(values)], found, defines=tile_defines(atlas))]
