"""The sum of Gaussians from its terms, each weighted by the skin and its scattering radius at the receiving point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Input, Output, Source
from skincli.passes.seen import Tiled


@dataclass(frozen=True)
class CombineValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    level : of the term; level 0 also counts coverage
    slots : skins of the mesh; row level * slots + slot - 1 of the weights is a skin's
    most : ratio of scattering radii at the last column of the weights
    least : coverage of a term below which it says nothing
    """

    level: int
    slots: int
    most: float
    least: float


class Combine(Tiled):
    """Diffused light (rgb) and coverage (a). The columns of `weights` are spaced evenly in the squared ratio."""

    shader = "passes/combine.frag"
    additive = True
    inputs = {
        "seen": Input(),
        "term": Input(),
        "image": Input(),
        "owner": Input(),
        "spread": Input(),
        "weights": Input(),
    }
    outputs = {"blurred": Output()}

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """Light that only stays where it is."""
        if len(self.draws) == 1:
            return self.source(self.draws[0], "term"), "nothing is to be added up"
        return None


def twin(
    values: CombineValues,
    term: NDArray[np.float64],
    image: NDArray[np.float64],
    owner: NDArray[np.float64],
    spread: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return what one draw adds.

    Parameters
    ----------
    term, image, owner : (h, w, 4)
    spread : (h, w, 4) or (1, 1, 4)
    weights : (levels * slots, columns, 4), first row first

    Returns
    -------
    (h, w, 4)
    """
    slot = owner[..., 3].astype(int)
    known = term[..., 3:] > values.least
    value = np.where(known, term[..., :3] / np.where(known, term[..., 3:], 1), image[..., :3])
    rows = weights[values.level * values.slots + np.maximum(slot - 1, 0)]
    columns = weights.shape[1]
    place = np.clip(spread[..., :3] ** 2 / values.most**2, 0, 1) * (columns - 1)
    place = np.broadcast_to(place, value.shape)
    low = np.minimum(place.astype(int), max(columns - 2, 0))
    below, above = (
        np.take_along_axis(rows[..., :3], np.minimum(at, columns - 1)[..., None, :], axis=-2)[..., 0, :]
        for at in (low, low + 1)
    )
    weight = below + (place - low) * (above - below)
    result = np.concatenate([weight * value, np.full((*slot.shape, 1), float(values.level == 0))], axis=-1)
    return np.where((slot > 0)[..., None], result, 0.0)
