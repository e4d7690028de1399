"""A Gaussian too narrow for the lattice: a window of texels, weighted by straight distances in space.

It sees no texels beyond a seam of the atlas, so it serves widths of a few texels only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Draw, Input, Output, Pass, Ref, Source
from skincli.passes.seen import Tiled, tile_defines, tiled

#: standard deviations that a Gaussian needs to have in samples, and that a window spans on each side
LEAST_SAMPLES, KEPT_SIGMAS = 1.5, 2.5


@dataclass(frozen=True)
class WindowSourceValues(Values):
    """Texels along the side of a block."""

    factor: int


class WindowSource(Pass):
    """Blocks of texels: irradiance times area (rgb, a = mm²), mean position (mm) and mean normal."""

    shader = "passes/window_source.frag"
    inputs = {"image": Input(), "area": Input(), "position": Input(), "normal": Input()}
    outputs = {
        "light": Output(needs=("image", "area")),
        "place": Output(needs=("area", "position")),
        "facing": Output(needs=("area", "normal")),
    }


@dataclass(frozen=True)
class WindowValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    factor : texels along the side of a block
    radius : blocks on each side of the middle
    falloff : 1/mm², of exp2(-falloff * distance²)
    """

    factor: int
    radius: int
    falloff: float


class Window(Tiled):
    """The average about each texel (rgb); a is 1 where there is any."""

    shader = "passes/window.frag"
    inputs = {"seen": Input(), "light": Input("bordered"), "place": Input("bordered"), "position": Input()}
    outputs = {"windowed": Output()}


def block_node(
    size: tuple[int, int], image: Source, area: Source, position: Source, normal: Source, factor: int
) -> WindowSource:
    """Return the node that sums blocks.

    Parameters
    ----------
    image, area, position, normal : in the atlas: irradiance, mm² of each texel, mm with the slot, unit
    factor : texels along the side of a block
    """
    blocks = (-(-size[0] // factor), -(-size[1] // factor))
    inputs = {"image": image, "area": area, "position": position, "normal": normal}
    return WindowSource(f"blocks_{factor}", blocks, [Draw(WindowSourceValues(factor))], inputs)


def window_factor(sigma: float, texel: float) -> int:
    """Return the texels along the side of the blocks of which a window is made; both in mm."""
    return max(1, int(sigma / (LEAST_SAMPLES * texel)))


def window_node(
    name: str, size: tuple[int, int], blocks: WindowSource, position: Source, seen: Source, sigma: float, texel: float
) -> Window:
    """Return the node of one Gaussian; its output is `windowed`.

    Parameters
    ----------
    blocks : of as many texels as `window_factor` says
    position : in the atlas, mm with the slot
    seen : see skincli.passes.seen
    sigma : mm; of at least LEAST_SAMPLES texels
    texel : mean width of a texel, mm
    """
    factor = window_factor(sigma, texel)
    # A block of texels is a blur by itself.
    variance = sigma**2 - (factor**2 - 1) / 12 * texel**2
    radius = math.ceil(KEPT_SIGMAS * sigma / (factor * texel))
    light, place = (Ref(blocks.name, output) for output in ("light", "place"))
    inputs = {"light": light, "place": place, "position": position, "seen": seen}
    values = WindowValues(factor, radius, math.log2(math.e) / (2 * variance))
    return Window(name, size, [tiled(size, values)], inputs, defines=tile_defines(size))


def twin(
    values: WindowValues, light: NDArray[np.float64], place: NDArray[np.float64], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the average about each texel.

    Parameters
    ----------
    light, place : (blocks high, blocks wide, 4), top row first; of WindowSource
    position : (h, w, 4), top row first

    Returns
    -------
    (h, w, 4)
    """
    # Blocks are counted from the lowest row.
    light, place, position = light[::-1], place[::-1], position[::-1]
    padding = [(values.radius, values.radius)] * 2 + [(0, 0)]
    light, place = np.pad(light, padding), np.pad(place, padding)
    row, column = (index // values.factor for index in np.indices(position.shape[:2]))
    total = np.zeros_like(position)
    for y in range(2 * values.radius + 1):
        for x in range(2 * values.radius + 1):
            away = place[row + y, column + x, :3] - position[..., :3]
            total += np.exp2(-values.falloff * np.sum(away**2, axis=-1, keepdims=True)) * light[row + y, column + x]
    known = (position[..., 3:] > 0) & (total[..., 3:] > 0)
    result = np.concatenate([total[..., :3] / np.where(known, total[..., 3:], 1), np.ones_like(known)], axis=-1)
    return np.where(known, result, 0.0)[::-1]
