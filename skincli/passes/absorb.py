"""What the color of the surface takes from light on its way in; the rest it takes on the way out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Input, Output, Source
from skincli.passes.seen import Tiled

#: square roots of the albedo that meet light on its way in, by what a scene says of the albedo
WAYS_IN = {"after": 0, "split": 1, "before": 2}


@dataclass(frozen=True)
class AbsorbValues(Values):
    """Square roots of the albedo that light meets, 0 to 2."""

    way_in: int


class Absorb(Tiled):
    """Irradiance times a part of the albedo (rgb) and coverage (a) [dEon2007, section 14.4.1]."""

    shader = "passes/absorb.frag"
    inputs = {"seen": Input(), "image": Input(), "albedo": Input()}
    outputs = {"absorbed": Output()}

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """Nothing is absorbed on the way in."""
        values = self.draws[0].values
        assert isinstance(values, AbsorbValues)
        return (self.source(self.draws[0], "image"), "albedo is applied after") if values.way_in == 0 else None


def twin(values: AbsorbValues, image: NDArray[np.float64], albedo: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (h, w, 4) of (h, w, 4) irradiance and (h, w, 3) or (1, 1, 3) albedo."""
    return np.concatenate([image[..., :3] * np.maximum(albedo, 0) ** (values.way_in / 2), image[..., 3:]], axis=-1)
