"""Slime: a wet film that gathers in pools and drops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.filtering import soft_step
from skincli.layers.marks import disk, find_marks

#: How far apart the places may be in which a texel is looked at, in sizes of the film's features.
FINEST = 0.06
#: How far the film is pulled about, in sizes of its features.
PULL = 0.5
#: Noise of this size, to both sides, is all there is.
NOISE_RANGE = 0.5
#: Half the width of the slope of a pool's edge, as noise.
SLOPE = 0.16
#: How far apart the places may be in which a texel is looked at for drops, in radii of the largest.
FINEST_DROPS = 0.5
#: Distance between drops, in diameters of the largest.
SPACING = 2.2


class Slime(Pattern):
    """A wet film: 1 in pools and on drops, thinning out at their edges, 0 on dry skin.

    Give it a raised `reflectance` and a lowered `roughness` where the pattern is 1. With `blend: height_blend` and a
    `height` above the skin's it also levels what lies below.
    """

    scale: float = Field(default=8.0, ge=0.01, le=10000, description="size of the pools, mm")
    coverage: Unit = Field(default=0.5, description="how much of the skin the film covers: 0 none, 0.5 half, 1 all")
    drops: Unit = Field(default=0.4, description="how many drops stand on the dry skin: 0 none, 1 as many as find room")
    drop_size: float = Field(default=0.9, ge=0.01, le=1000, description="diameter of the largest drops, mm")

    def size(self) -> float:
        return self.scale

    def finest(self) -> float:
        return min(FINEST * self.scale, FINEST_DROPS * 0.5 * self.drop_size) if self.drops > 0 else FINEST * self.scale

    def widest(self) -> float:
        return 2 * FINEST * self.scale

    def grain(self) -> float:
        # Half of it is 1 and half 0: such contrast must fade slowly.
        return 2.1 * self.scale

    def values(self, ground: Ground) -> dict[str, Value]:
        scale, period = ground.fit(self.scale)
        cell, drop_period = ground.fit(SPACING * self.drop_size)
        return {
            "scale": scale,
            "period": period,
            "level": (NOISE_RANGE + SLOPE) * (1 - 2 * self.coverage),
            "drops": self.drops,
            "cell": cell,
            "drop_period": drop_period,
            "radius": 0.5 * self.drop_size / cell,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        t = _film(values, site)
        return t if values["drops"] == 0 else 1 - (1 - t) * (1 - _drops(values, site))


def _film(values: Mapping[str, Any], site: Site) -> Array:
    x = site["position"] / values["scale"]
    pull = hashing.value_noise(*hashing.split(x), values["period"], ~values["seed"])
    noise = hashing.gradient_noise(*hashing.split(x + PULL * pull), values["period"], values["seed"])
    texel = site["footprint"] / values["scale"]
    return soft_step(noise + 0.15 * pull[:, 0] - values["level"], SLOPE, texel)


def _drops(values: Mapping[str, Any], site: Site) -> Array:
    texel = site["footprint"] / values["cell"]
    widening = 2 / 3 * texel**2
    marks = find_marks(
        site["position"] / values["cell"],
        site["normal"],
        disk(site["normal"], np.sqrt(values["radius"] ** 2 + widening)),
        values["drop_period"],
        0.9,
        values["seed"] ^ 0x5BD1E995,
    )
    there = np.clip(4 * (values["drops"] * 1.25 - marks.more_random()[..., 3]), 0, 1)
    own2 = marks.near * there * (values["radius"] * (0.6 + 0.4 * marks.random[..., 3])) ** 2
    radius2 = np.maximum(own2 + widening[:, None], 1e-12)
    bowl = np.maximum(1 - marks.squared() / radius2, 0)
    return 1 - np.prod(1 - own2 / radius2 * bowl * bowl, axis=1)
