"""Slime: a wet film that gathers in pools and drops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from skincli.layers import filtering, hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed, pattern_mean
from skincli.layers.marks import disk, find_marks

#: How far apart the places may be in which a texel is looked at, in sizes of the film's features.
FINEST = 0.06
#: Texels of these sizes, in sizes of the film's features, begin to show the mean alone, and show nothing else.
FIRST, LAST = 0.5, 6.0
#: How far the film is pulled about, in sizes of its features.
PULL = 0.5
#: Noise of this size, to both sides, is all there is.
NOISE_RANGE = 0.5
#: Half the width of the slope of a pool's edge, as noise.
SLOPE = 0.16
#: How far apart the places may be in which a texel is looked at for drops, in radii of the largest.
FINEST_DROPS = 0.3
#: Distance between drops, in diameters of the largest.
SPACING = 2.2
#: Level of the film that no noise reaches.
DRY = 9.0
#: Texels of these sizes, in distances between drops, begin to show their mean alone, and show nothing else.
FIRST_DROPS, LAST_DROPS = 0.75, 6.0


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

    def values(self, ground: Ground) -> dict[str, Value]:
        scale, period = ground.fit(self.scale)
        cell, drop_period = ground.fit(SPACING * self.drop_size)
        values: dict[str, Value] = {
            "scale": scale,
            "period": period,
            "level": (NOISE_RANGE + SLOPE) * (1 - 2 * self.coverage),
            "drops": self.drops,
            "cell": cell,
            "drop_period": drop_period,
            "radius": 0.5 * self.drop_size / cell,
            "seed": joint_seed(ground.seed, self.seed),
        }
        values["drop_mean"] = pattern_mean(type(self), {**values, "level": DRY, "drop_mean": 0.0}, cell)
        return values | {"mean": pattern_mean(type(self), values, max(scale, cell))}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        scale = values["scale"]
        t = filtering.sampled(site, FINEST * scale, 8, lambda small: _film(values, small))
        if values["drops"] > 0:
            drops = filtering.sampled(
                site, FINEST_DROPS * values["radius"] * values["cell"], 2, lambda small: _drops(values, small)
            )
            texel = site["footprint"] / values["cell"]
            shown = 1 - hashing.smoothstep(FIRST_DROPS, LAST_DROPS, texel)
            drops = (1 - shown) * values["drop_mean"] + shown * drops
            t = 1 - (1 - t) * (1 - drops)
        shown = 1 - hashing.smoothstep(FIRST, LAST, site["footprint"] / scale)
        return (1 - shown) * values["mean"] + shown * t


def _film(values: Mapping[str, Any], site: Site) -> Array:
    x = site["position"] / values["scale"]
    pull = hashing.value_noise(*hashing.split(x), values["period"], ~values["seed"])
    noise = hashing.gradient_noise(*hashing.split(x + PULL * pull), values["period"], values["seed"])
    texel = site["footprint"] / values["scale"]
    return filtering.soft_step(noise + 0.15 * pull[:, 0] - values["level"], SLOPE, texel)


def _drops(values: Mapping[str, Any], site: Site) -> Array:
    texel = site["footprint"] / values["cell"]
    widening = 2 / 3 * texel**2
    marks = find_marks(
        site["position"] / values["cell"],
        site["normal"],
        disk(site["normal"], np.where(texel < LAST_DROPS, np.sqrt(values["radius"] ** 2 + widening), 0)),
        values["drop_period"],
        0.9,
        values["seed"] ^ 0x5BD1E995,
    )
    there = np.clip(4 * (values["drops"] * 1.25 - marks.more_random()[..., 3]), 0, 1)
    own2 = marks.near * there * (values["radius"] * (0.6 + 0.4 * marks.random[..., 3])) ** 2
    radius2 = np.maximum(own2 + widening[:, None], 1e-12)
    bowl = np.maximum(1 - marks.squared() / radius2, 0)
    return 1 - np.prod(1 - own2 / radius2 * bowl * bowl, axis=1)
