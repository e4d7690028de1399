"""Warts: round bumps of varying size that stand in clusters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Value, joint_seed
from skincli.layers.marks import disk, find_marks, require_room

#: Share of the range of densities over which a wart grows from nothing to its full size.
GROWTH = 0.5
#: Gradient noise of this size, to both sides, makes the densities 0 and 1.
NOISE_RANGE = 0.45
#: How far apart the places may be in which a texel is looked at, in radii of a wart.
FINEST = 0.22


class Warts(Pattern):
    """Round bumps of varying size, in clusters: toads, octopuses, alien hides. The pattern is their height."""

    spacing: float = Field(default=3.0, ge=0.01, le=1000, description="mean distance between warts in a cluster, mm")
    diameter: float = Field(default=2.4, gt=0, le=1000, description="of the largest, mm, at most the spacing")
    variation: float = Field(default=0.6, ge=0, le=1, description="how much smaller some are: 0 equal, 1 to nothing")
    flatness: float = Field(default=0.3, ge=0, le=1, description="0 domes, 1 buttons with flat tops")
    jitter: float = Field(default=0.9, ge=0, le=1, description="disorder: 0 a lattice, 1 random")
    clustering: float = Field(default=0.6, ge=0, le=1, description="0 warts everywhere, 1 in clusters with bare skin")
    cluster_size: float = Field(
        default=15.0, ge=0.01, le=10000, description="size of the clusters, mm, at least three times the spacing"
    )

    def size(self) -> float:
        return self.spacing

    @model_validator(mode="after")
    def _fits(self) -> Warts:
        require_room("diameter", self.diameter, self.spacing)
        if self.clustering > 0 and self.cluster_size < 3 * self.spacing:
            raise ValueError(
                f"cluster_size is {self.cluster_size:g} mm, less than three times the spacing, {self.spacing:g} mm; "
                "raise cluster_size, or set clustering to 0"
            )
        return self

    def finest(self) -> float:
        return FINEST * 0.5 * self.diameter

    def grain(self) -> float:
        return 1.1 * self.spacing

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        cluster, cluster_period = ground.fit(self.cluster_size)
        return {
            "cell": cell,
            "period": period,
            "radius": 0.5 * self.diameter / cell,
            "variation": self.variation,
            "flatness": self.flatness,
            "spread": _spread(self.flatness),
            "jitter": self.jitter,
            "clustering": self.clustering,
            "cluster": cluster,
            "cluster_period": cluster_period,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        cell, texel = values["cell"], site["footprint"] / values["cell"]
        widening = values["spread"] * texel**2
        reach = np.sqrt(values["radius"] ** 2 + widening)
        position, normal = site["position"] / cell, site["normal"]
        marks = find_marks(position, normal, disk(normal, reach), values["period"], values["jitter"], values["seed"])
        grown = np.clip((_density(values, site)[:, None] - marks.more_random()[..., 3]) / GROWTH, 0, 1)
        size = grown * (1 - values["variation"] * marks.random[..., 3])
        own2 = np.sqrt(marks.near) * (values["radius"] * size) ** 2
        size = size * np.sqrt(marks.near)
        radius2 = np.maximum(own2 + widening[:, None], 1e-12)
        bowl = np.maximum(1 - marks.squared() / radius2, 0)
        dome = bowl * bowl * (1 + 2 * values["flatness"] * (1 - bowl))
        return 1 - np.prod(1 - size * own2 / radius2 * dome, axis=1)

    @classmethod
    def local(cls, values: Mapping[str, Any], site: Site) -> Array:
        return _grown(_density(values, site))


def _density(values: Mapping[str, Any], site: Site) -> Array:
    """Return (n,) how dense warts are: 0 to 1, and beyond by what the last need to grow."""
    noise = hashing.gradient_noise(
        *hashing.split(site["position"] / values["cluster"]), values["cluster_period"], ~values["seed"]
    )
    clear = hashing.smoothstep(0.5, 4, values["cluster"] / np.maximum(site["footprint"], 1e-9))
    density = 0.5 + clear * (hashing.smoothstep(-NOISE_RANGE, NOISE_RANGE, noise) - 0.5)
    # Beyond 1 by the range of growth, so that nothing is still growing where the density is full.
    return (1 - values["clustering"] * (1 - density)) * (1 + GROWTH)


def _spread(flatness: float) -> float:
    """Return by how many squared texels the squared radius of a wart grows, so that its variance grows by 1/12."""
    mass, moment = 1 / 3 + flatness / 6, 1 / 12 + flatness / 15
    return mass / (6 * moment)


def _grown(density: Array) -> Array:
    """Return the mean of the cubed sizes: the share of the full height that is left where the density is lower."""
    growing = (np.minimum(density, GROWTH) ** 4 - np.maximum(density - 1, 0) ** 4) / (4 * GROWTH**3)
    return np.maximum(density - GROWTH, 0) + growing
