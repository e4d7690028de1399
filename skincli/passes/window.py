"""A Gaussian too narrow for the lattice: texels around and those that lists name, weighted by straight distances."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Draw, Input, Node, Output, Ref, Source
from skincli.mesh.windows import RADIUS_BITS, ROW_BITS, WindowTables, runs
from skincli.mesh.words import as_words
from skincli.passes.lattice import DEFINES, table_loads
from skincli.passes.seen import Tiled, blocks_extent, tile_defines

#: standard deviations that a Gaussian needs to have in texels, and those from which on blocks of them are summed
LEAST_SAMPLES, BLOCK_SAMPLES = 0.4, 1.5

#: what a window keeps of the variance that it is given, since it ends within reach: least error on heads
KEPT_VARIANCE = 0.97


@dataclass(frozen=True)
class WindowSourceValues(Values):
    """Texels along the side of a block."""

    factor: int


class WindowSource(Tiled):
    """Blocks of texels: irradiance times area (rgb, a = mm²), mean position (mm) and mean normal."""

    shader = "passes/window_source.frag"
    inputs = {name: Input() for name in ("seen", "image", "area", "position", "normal")}
    outputs = {
        "light": Output(needs=("seen", "image", "area")),
        "place": Output(needs=("seen", "area", "position")),
        "facing": Output(needs=("seen", "area", "normal")),
    }


@dataclass(frozen=True)
class WindowValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    factor : texels along the side of a block
    falloff : 1/mm², of exp2(-falloff * distance²)
    """

    factor: int
    falloff: float


class Window(Tiled):
    """The average about each texel (rgb); a is 1 where there is any."""

    shader = "passes/window.frag"
    inputs = {
        name: Input()
        for name in ("seen", "position", "normal", "reach", "starts", "entries", "light", "place", "facing")
    }
    outputs = {"windowed": Output()}

    def __init__(self, *arguments: Any, tables: WindowTables, **options: Any) -> None:
        super().__init__(*arguments, **options)
        #: which are drawn, for the twin
        self.tables = tables


def block_node(
    size: tuple[int, int],
    image: Source,
    area: Source,
    position: Source,
    normal: Source,
    wanted: Source,
    factor: int,
) -> WindowSource:
    """Return the node that sums blocks.

    Parameters
    ----------
    size : of the atlas
    image, area, position, normal : in the atlas: irradiance, mm² of each texel, mm with the slot, unit
    wanted : tiles of the atlas whose blocks are read
    factor : texels along the side of a block
    """
    blocks = blocks_extent(size, factor)
    inputs = {"seen": wanted, "image": image, "area": area, "position": position, "normal": normal}
    draw = Draw(WindowSourceValues(factor))
    return WindowSource(f"blocks_{factor}", blocks, [draw], inputs, defines=tile_defines(size, factor))


def window_factor(sigma: float, texel: float) -> int:
    """Return the texels along the side of the blocks of which a window is made; both in mm."""
    return max(1, int(sigma / (BLOCK_SAMPLES * texel)))


def window_nodes(
    name: str,
    size: tuple[int, int],
    blocks: WindowSource,
    position: Source,
    normal: Source,
    seen: Source,
    sigma: float,
    texel: float,
    key: str,
    tables: WindowTables,
) -> list[Node]:
    """Return the nodes of one Gaussian; the last, `name`, has the output `windowed`.

    Parameters
    ----------
    blocks : of as many texels as the tables say
    position, normal : in the atlas: mm with the slot, unit and without bumps
    seen : see skincli.passes.seen
    sigma : mm; of at least LEAST_SAMPLES texels
    texel : mean width of a texel, mm
    key, tables : of that sigma
    """
    # A block of texels is a blur by itself.
    variance = sigma**2 - (tables.factor**2 - 1) / 12 * texel**2
    loads = table_loads(name, key, {"reach": tables.reach, "starts": tables.starts, "entries": tables.entries})
    # A texel is its own block.
    own = {"place": position, "facing": normal} if tables.factor == 1 else {}
    inputs = {
        **{output: Ref(blocks.name, output) for output in blocks.outputs},
        **own,
        **{what: Ref(load.name, "image") for what, load in loads.items()},
        **{"position": position, "normal": normal, "seen": seen},
    }
    defines = (*DEFINES, ("RADIUS_BITS", str(RADIUS_BITS)), ("ROW_BITS", str(ROW_BITS)), *tile_defines(size))
    draw = Draw(WindowValues(tables.factor, KEPT_VARIANCE * math.log2(math.e) / (2 * variance)))
    return [*loads.values(), Window(name, size, [draw], inputs, defines=defines, tables=tables)]


def twin(
    values: WindowValues,
    tables: WindowTables,
    light: NDArray[np.float64],
    place: NDArray[np.float64],
    facing: NDArray[np.float64],
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the average about each texel.

    Parameters
    ----------
    light, place, facing : (blocks high, blocks wide, 4), top row first; of WindowSource
    position, normal : (h, w, 4), top row first

    Returns
    -------
    (h, w, 4)
    """
    # Blocks are counted from the lowest row.
    light, place, facing, position, normal = (image[::-1] for image in (light, place, facing, position, normal))
    row, column = (index // values.factor for index in np.indices(position.shape[:2]))
    words = as_words(tables.reach[..., 0]).astype(np.int64)[row, column]
    mask = (1 << RADIUS_BITS) - 1
    wide, high = words & mask, words >> RADIUS_BITS & mask
    padding = [(mask, mask)] * 2 + [(0, 0)]
    padded, places = np.pad(light, padding), np.pad(place, padding)
    total = np.zeros_like(position)

    def weight(places: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
        square = np.sum((places[..., :3] - at[..., :3]) ** 2, axis=-1, keepdims=True)
        return np.asarray(np.exp2(-values.falloff * square))

    for y in range(-int(high.max()), int(high.max()) + 1):
        for x in range(-int(wide.max()), int(wide.max()) + 1):
            inside = ((np.abs(y) <= high) & (np.abs(x) <= wide))[..., None]
            there = row + y + mask, column + x + mask
            total += inside * weight(places[there], position) * padded[there]
    starts = as_words(tables.starts.ravel()).astype(np.int64)
    number = (words >> 2 * RADIUS_BITS).ravel()
    texel = np.flatnonzero(number)
    first = starts[number[texel] - 1]
    count = starts[number[texel]] - first
    texel, entry = np.repeat(texel, count), runs(first, count)
    address = as_words(tables.entries.ravel()).astype(np.int64)[entry]
    rows, columns = address & (1 << ROW_BITS) - 1, address >> ROW_BITS
    at, N = position.reshape(-1, 4)[texel], normal.reshape(-1, 4)[texel]
    facing_weight = 0.5 + 0.5 * np.sum(facing[rows, columns, :3] * N[:, :3], axis=-1, keepdims=True)
    np.add.at(total.reshape(-1, 4), texel, facing_weight * weight(place[rows, columns], at) * light[rows, columns])
    known = (position[..., 3:] > 0) & (total[..., 3:] > 0)
    result = np.concatenate([total[..., :3] / np.where(known, total[..., 3:], 1), np.ones_like(known)], axis=-1)
    return np.where(known, result, 0.0)[::-1]
