"""Veins: lines that branch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.filtering import soft_step

#: Size and width of each level, relative to the one before; the size so that twice as many cells fit a period.
FINER = 0.5
THINNER = 0.62
#: Texels larger than this, in widths of the finest veins, are looked at in several places.
FINEST = 0.6


class Veins(Pattern):
    """Lines of falling width that spring from each other, end and never close into cells."""

    spacing: float = Field(default=18.0, ge=0.01, le=10000, description="mean distance between the largest, mm")
    width: float = Field(default=1.2, gt=0, le=1000, description="width of the largest, mm, at most 0.3 of spacing")
    branches: int = Field(default=2, ge=0, le=4, description="how often veins branch into thinner ones")
    branching: Unit = Field(default=0.6, description="how far branches reach from where they spring")

    @model_validator(mode="after")
    def _fits(self) -> Veins:
        if self.width > 0.3 * self.spacing:
            raise ValueError(
                f"width is {self.width:g} mm, more than 0.3 of spacing, {self.spacing:g} mm; "
                "lower width or raise spacing"
            )
        return self

    def size(self) -> float:
        return self.spacing

    def finest(self) -> float:
        return min(FINEST * self.width * THINNER**self.branches, 0.1 * self.spacing * FINER**self.branches)

    def widest(self) -> float:
        return 0.1 * self.spacing

    def values(self, ground: Ground) -> dict[str, Value]:
        spacing, period = ground.fit(self.spacing)
        return {
            "spacing": spacing,
            "period": period,
            "width": 0.5 * self.width,
            "levels": self.branches + 1,
            "branching": 0.15 + self.branching,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        normal, size, width, period = site["normal"], values["spacing"], values["width"], values["period"]
        grown, untouched = np.ones(len(normal)), np.ones(len(normal))
        for level in range(values["levels"]):
            value, slope = _noise(*hashing.split(site["position"] / size), period, values["seed"] + 7919 * level)
            slope -= np.sum(slope * normal, axis=1, keepdims=True) * normal
            steepness = np.sqrt(np.sum(slope**2, axis=1))
            away = value / np.maximum(steepness, 0.05)
            ends = hashing.smoothstep(0.25, 0.7, steepness)
            half_width = width / size
            # The variance of the line's profile is half_width² / 11, that of a texel texel² / 12.
            wide2 = half_width**2 + 11 / 12 * (site["footprint"] / size) ** 2
            line = half_width / np.sqrt(wide2) * np.maximum(1 - away**2 / wide2, 0) ** 4
            untouched = untouched * (1 - grown * ends * line)
            branching = 1 - hashing.smoothstep(0.1, values["branching"], away)
            grown = grown * ends * soft_step(away, 0.02, site["footprint"] / size) * branching
            size, width, period = size * FINER, width * THINNER, period * 2
        return 1 - untouched


def _noise(cell: NDArray[np.int64], fraction: Array, period: int, seed: int) -> tuple[Array, Array]:
    """Return (n,) gradient noise and its (n, 3) slope per cell."""
    far = fraction**3 * (fraction * (fraction * 6 - 15) + 10)
    steep = 30 * fraction**2 * (fraction - 1) ** 2
    value, slope = np.zeros(len(fraction)), np.zeros(fraction.shape)
    for corner in hashing.CORNERS:
        gradient = 2 * hashing.hash_cell(hashing.wrap_cell(cell + corner, period), seed)[:, :3] - 1
        ramp = np.sum(gradient * (fraction - corner), axis=1)
        weight = np.where(corner == 1, far, 1 - far)
        share = np.prod(weight, axis=1)
        turn = np.where(corner == 1, steep, -steep) * weight[:, [1, 2, 0]] * weight[:, [2, 0, 1]]
        value += share * ramp
        slope += share[:, None] * gradient + turn * ramp[:, None]
    return value, slope
