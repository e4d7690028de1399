"""Freckles: small clustered spots of pigment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing, marks
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.filtering import Disk, disk_of

#: Size of the swirls that fray the outline of a freckle, in its radii.
RAGGED = 0.9
#: Mean radius of the edge of a freckle, and half the width of the edge, in its radii.
EDGE = 0.6
SOFTNESS = 0.4
#: How strongly gradient noise, whose deviation is about 0.2, moves the share of freckles that show.
CROWDING = 2.5


class Freckles(Pattern):
    """Small spots of ragged outline, unequal in size and darkness, that come in clusters."""

    spacing: float = Field(default=3.0, ge=0.01, le=1000, description="mean distance where they are densest, mm")
    radius: float = Field(default=1.0, gt=0, le=500, description="radius of the largest, mm, at most half of spacing")
    variation: Unit = Field(default=0.7, description="how much smaller and paler some are: 0 equal")
    irregularity: Unit = Field(default=0.5, description="how ragged their outlines are: 0 round")
    cluster: float = Field(default=20.0, ge=0.01, le=10000, description="size of the clusters, mm")
    clustering: Unit = Field(default=0.6, description="how empty the skin is between clusters: 0 evenly spread")

    @model_validator(mode="after")
    def _fits(self) -> Freckles:
        marks.require_room("radius", self.radius, self.spacing, 0.5)
        if self.cluster < 2 * self.spacing:
            raise ValueError(
                f"cluster is {self.cluster:g} mm, less than twice the spacing, {self.spacing:g} mm; "
                "raise cluster or lower spacing"
            )
        return self

    def size(self) -> float:
        return self.spacing

    def finest(self) -> float:
        return min(marks.FINEST * self.spacing, 0.3 * self.radius)

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        cluster, cluster_period = ground.fit(self.cluster)
        ragged, ragged_period = ground.fit(RAGGED * self.radius)
        return {
            "cell": cell,
            "period": period,
            "radius": self.radius / cell,
            "edge": EDGE,
            "softness": SOFTNESS,
            "variation": self.variation,
            "irregularity": 0.5 * self.irregularity,
            "ragged": ragged,
            "ragged_period": ragged_period,
            "cluster": cluster,
            "cluster_period": cluster_period,
            "clustering": CROWDING * self.clustering,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        texel = site["footprint"] / values["cell"]
        position, normal, seed = site["position"], site["normal"], values["seed"]
        crowd = _crowd(values, site)
        fray = values["irregularity"] * values["radius"]
        ragged = hashing.value_noise(*hashing.split(position / values["ragged"]), values["ragged_period"], seed + 2)
        ragged = ragged * (fray * hashing.resolved(values["ragged"], site["footprint"]))[:, None]
        ragged = ragged - np.sum(ragged * normal, axis=1, keepdims=True) * normal

        def disk(radius: Array | float, texel: Array) -> Disk:
            return disk_of(values["edge"] * radius, values["softness"] * radius, texel)

        extent = marks.disk(normal, disk(values["radius"], texel).reach() + np.sqrt(3) * fray)
        found = marks.find_marks(position / values["cell"], normal, extent, values["period"], 1.0, seed)
        more = found.more_random()
        radius = values["radius"] * (1 - values["variation"] * more[..., 3])
        shows = np.clip(4 * (crowd[:, None] - found.random[..., 3]) + 0.5, 0, 1) * (
            1 - values["variation"] * more[..., 0]
        )
        away = np.sqrt(np.sum((found.along + ragged[:, None]) ** 2, axis=-1))
        untouched = np.prod(1 - found.near * shows * disk(radius, texel[:, None]).at(away), axis=1)
        return 1 - untouched

    @classmethod
    def local(cls, values: Mapping[str, Any], site: Site) -> Array:
        return np.clip(_crowd(values, site), 0, 1)


def _crowd(values: Mapping[str, Any], site: Site) -> Array:
    """Return (n,) the share of the freckles that show, 0.5 in the middle; it may lie outside of 0 to 1."""
    cluster = hashing.split(site["position"] / values["cluster"])
    noise = hashing.gradient_noise(*cluster, values["cluster_period"], values["seed"] + 1)
    return 0.5 + values["clustering"] * hashing.resolved(values["cluster"], site["footprint"]) * noise
