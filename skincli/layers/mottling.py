"""Mottling: the soft unevenness of the blood under the skin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.fractal import NOISE_DEVIATION

#: Sizes of the noises' cells, in scales: such that the places of large texels do not all meet the same spot of a cell.
LARGE = 0.9
FINE = 0.42
#: Standard deviation of the raw pattern about its middle: smoothly cut at about three of them.
DEVIATION = 0.16
#: The net: height of its lines above the middle of the range, how steeply they fall, how rounded they are.
BORDER = (0.5, 3.2, 0.0016)
#: Texels larger than this, in scales, are looked at in several places.
FINEST = 0.08


class Mottling(Pattern):
    """Soft blotches of two sizes, and the net of lines between them that cold skin shows."""

    scale: float = Field(default=15.0, ge=0.01, le=10000, description="size of the larger blotches, mm")
    detail: Unit = Field(default=0.6, description="strength of the blotches half as large, relative to the larger")
    net: Unit = Field(default=0.35, description="0: blotches; 1: a net of soft lines, the borders of the smaller ones")

    def size(self) -> float:
        return self.scale

    def finest(self) -> float:
        return FINEST * self.scale

    def grain(self) -> float:
        return FINE * self.scale

    def values(self, ground: Ground) -> dict[str, Value]:
        scale, period = ground.fit(LARGE * self.scale)
        fine, fine_period = ground.fit(FINE * self.scale)
        amplitude = DEVIATION / (NOISE_DEVIATION * math.hypot(1, self.detail))
        return {
            "scale": scale,
            "period": period,
            "fine": fine,
            "fine_period": fine_period,
            "detail": self.detail,
            "net": self.net,
            "amplitude": amplitude,
            "border": BORDER,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:

        def noise(scale: float, period: int, seed: int) -> Array:
            return hashing.gradient_noise(*hashing.split(site["position"] / scale), period, seed)

        large = noise(values["scale"], values["period"], values["seed"])
        small = noise(values["fine"], values["fine_period"], values["seed"] + 1)
        raw = values["amplitude"] * (large + values["detail"] * small)
        height, steepness, rounding = values["border"]
        border = height - steepness * np.sqrt((values["amplitude"] * small) ** 2 + rounding)
        return hashing.smoothstep(0, 1, 0.5 + (1 - values["net"]) * raw + values["net"] * border)
