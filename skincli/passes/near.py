"""Which part of the surface lies near what the picture sees, so that light elsewhere need not be computed.

Space about the mesh is parted into cubes. Those with texels in tiles that the picture reads are marked, with their
neighbors; wanted are the tiles of the atlas with a texel in one of them.
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

#: cubes that the three targets of Met name for each tile
NAMED = 12
DEFINES = (("NAMED", str(NAMED)),)


@dataclass(frozen=True)
class NearValues(Values):
    """The cubes; those of one z stand side by side in a texture, with x along its rows, and above them a flag.

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
    """Which cubes hold texels of each tile of the atlas that the picture reads: three times four numbers."""

    shader = "passes/met.frag"
    inputs = {"seen": Input(), "position": Input()}
    outputs = {"first": Output(), "second": Output(), "third": Output()}


class Marked(Pass):
    """1 at those cubes; a flag where a tile has texels in more than can be named."""

    shader = "passes/marked.frag"
    vertex = "passes/marked.vert"
    inputs = {name: Input() for name in Met.outputs}
    outputs = {"marked": Output("r32f")}


class Near(Pass):
    """1 at those cubes and their neighbors."""

    shader = "passes/near.frag"
    inputs = {"marked": Input()}
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


def near_nodes(atlas: tuple[int, int], values: NearValues, seen: Source, position: Source) -> list[Node]:
    """Return the nodes; the last, "wanted", has the output `wanted`.

    Parameters
    ----------
    atlas : its size
    values : see `cubes`
    seen : see skincli.passes.seen
    position : of the surface in the atlas (xyz, mm; w above 0 where there is any)
    """
    across, high, deep = (int(count) for count in values.count)
    grid, tiles, defines = (across * deep, high + 1), tile_extent(atlas), tile_defines(atlas)
    met = Met("met", tiles, [Draw(values)], {"seen": seen, "position": position}, defines=(*DEFINES, *defines))
    named: dict[str, Source] = {name: Ref("met", name) for name in Met.outputs}
    marked = Marked("marked", grid, [Draw(values, points=NAMED * math.prod(tiles))], named, defines=DEFINES)
    near = Near("near", grid, [Draw(values)], {"marked": Ref("marked", "marked")})
    found: dict[str, Source] = {"near": Ref("near", "near"), "position": position}
    return [met, marked, near, Wanted("wanted", tiles, [Draw(values)], found, defines=defines)]
