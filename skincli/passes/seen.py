"""Which tiles of the atlas the picture reads, so that no others need be computed."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, Self

from skincli.gpu.blocks import Values, Vec2
from skincli.graph.node import ONE, Draw, Input, Output, Pass, Source

#: texels along the side of a tile, where that divides the atlas
MOST = 8


@dataclass(frozen=True)
class SeenValues(Values):
    """Texels along the sides of the atlas."""

    atlas: Vec2


class Seen(Pass):
    """1 at the tiles of the atlas of which a bilinear read of the picture meets a texel."""

    shader = "passes/seen.frag"
    vertex = "passes/seen.vert"
    inputs = {"depth": Input(), "uv": Input()}
    outputs = {"seen": Output("r32f")}


def seen_node(atlas: tuple[int, int], size: tuple[int, int], depth: Source, uv: Source) -> Seen:
    """Return the node.

    Parameters
    ----------
    atlas, size : of the atlas and of the picture
    depth, uv : of the picture: above 0 where there is a surface; where it reads the atlas (zw)
    """
    draw = Draw(SeenValues((float(atlas[0]), float(atlas[1]))), points=size[0] * size[1])
    return Seen("seen", tile_extent(atlas), [draw], {"depth": depth, "uv": uv}, defines=tile_defines(atlas))


class Tiled(Pass):
    """A pass over those tiles of its target that its input `seen` names; over all of it where that is ONE."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._aim()

    def over(self, seen: Source) -> Self:
        """Return the same pass over other tiles."""
        other = copy(self)
        other.__dict__.pop("_static_digest", None)
        other.wired = {**self.wired, "seen": seen}
        other._aim()
        return other

    def _aim(self) -> None:
        whole = self.wired.get("seen") == ONE
        self.vertex = "lib/screen.vert" if whole else "lib/tiles.vert"
        points = 0 if whole else math.prod(tile_extent(self.size))
        self.draws = tuple(replace(draw, points=points) for draw in self.draws)


def tile_defines(atlas: tuple[int, int], factor: int = 1) -> tuple[tuple[str, str], ...]:
    """Return what the shaders of such a pass need to know.

    Parameters
    ----------
    atlas : of whose tiles `seen` tells
    factor : texels along the side of a block, where the target has blocks
    """
    size = blocks_extent(atlas, factor)
    columns, rows = tile_extent(size)
    tiles = ("TILE", str(_side(size))), ("TILES", f"ivec2({columns}, {rows})")
    return *tiles, ("FACTOR", str(factor)), ("SEEN_TILE", str(_side(atlas)))


def blocks_extent(atlas: tuple[int, int], factor: int) -> tuple[int, int]:
    """Return the blocks of so many texels along the sides of an atlas."""
    return -(-atlas[0] // factor), -(-atlas[1] // factor)


def tile_extent(size: tuple[int, int]) -> tuple[int, int]:
    """Return the tiles along the sides of a target."""
    return size[0] // _side(size), size[1] // _side(size)


def _side(size: tuple[int, int]) -> int:
    return math.gcd(MOST, *size)
