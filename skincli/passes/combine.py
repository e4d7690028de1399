"""The sum of Gaussians from its levels, each weighted by the skin and its scattering radius at the receiving point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Draw, Input, Output, Source
from skincli.optics.levels import MAX_LEVELS, MAX_SPREAD
from skincli.passes.blur import LEAST_COVERAGE
from skincli.passes.seen import Tiled, tile_defines

#: the inputs that hold the Gaussians, narrowest first; with four others as many as a fragment shader may read
LEVELS = tuple(f"level{number}" for number in range(1, MAX_LEVELS + 1))


@dataclass(frozen=True)
class CombineValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    slots : skins of the mesh; row level * slots + slot - 1 of the weights is a skin's
    most : ratio of scattering radii at the last column of the weights
    least : coverage of a level below which it says nothing
    """

    slots: int
    most: float
    least: float


class Combine(Tiled):
    """Diffused light (rgb) and coverage (a). The columns of `weights` are spaced evenly in the squared ratio."""

    shader = "passes/combine.frag"
    inputs = {name: Input() for name in ("seen", "image", "owner", "spread", "weights", *LEVELS)}
    outputs = {"blurred": Output()}

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """Light that only stays where it is."""
        if LEVELS[0] not in self.wired:
            return self.wired["image"], "nothing is to be added up"
        return None


def combine_node(
    name: str,
    size: tuple[int, int],
    image: Source,
    levels: Sequence[Source],
    slots: int,
    owner: Source,
    spread: Source,
    weights: Source,
    seen: Source,
) -> Combine:
    """Return the node.

    Parameters
    ----------
    size : of the target
    image : the light that stays
    levels : the Gaussians, narrowest first
    slots : skins of the mesh
    owner : slot of the skin (w), 0 for none
    spread : scattering radius over that of the optics, per channel
    weights : (levels * slots, columns, 4), the light that stays first
    seen : see skincli.passes.seen
    """
    inputs = {"image": image, "owner": owner, "spread": spread, "weights": weights, "seen": seen}
    inputs |= dict(zip(LEVELS, levels, strict=False))
    draw = Draw(CombineValues(slots, MAX_SPREAD, LEAST_COVERAGE))
    added = "".join(f"    add({number}, fetch({LEVELS[number - 1]}, texel));\n" for number in range(1, len(levels) + 1))
    generated = (("generated/levels.glsl", f"void add_levels(ivec2 texel) {{\n{added}}}\n"),)
    return Combine(name, size, [draw], inputs, defines=tile_defines(size), generated=generated)


def twin(
    values: CombineValues,
    image: NDArray[np.float64],
    levels: Sequence[NDArray[np.float64]],
    owner: NDArray[np.float64],
    spread: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return diffused light and coverage.

    Parameters
    ----------
    image, levels, owner : (h, w, 4), each
    spread : (h, w, 4) or (1, 1, 4)
    weights : (levels * slots, columns, 4), first row first

    Returns
    -------
    (h, w, 4)
    """
    slot = owner[..., 3].astype(int)
    columns = weights.shape[1]
    place = np.clip(spread[..., :3] ** 2 / values.most**2, 0, 1) * (columns - 1)
    place = np.broadcast_to(place, (*slot.shape, 3))
    low = np.minimum(place.astype(int), max(columns - 2, 0))
    total = np.zeros((*slot.shape, 3))
    for level, light in enumerate([image, *levels]):
        known = light[..., 3:] > values.least
        value = np.where(known, light[..., :3] / np.where(known, light[..., 3:], 1), image[..., :3])
        rows = weights[level * values.slots + np.maximum(slot - 1, 0)]
        below, above = (
            np.take_along_axis(rows[..., :3], np.minimum(at, columns - 1)[..., None, :], axis=-2)[..., 0, :]
            for at in (low, low + 1)
        )
        total += (below + (place - low) * (above - below)) * value
    return np.where((slot > 0)[..., None], np.concatenate([total, np.ones((*slot.shape, 1))], axis=-1), 0.0)
