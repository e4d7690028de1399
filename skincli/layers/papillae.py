"""Papillae: pointed, leaning bumps that an octopus raises from its skin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.marks import along_surface, disk, find_marks, require_room

#: How far apart the places may be in which a texel is looked at, in radii of a papilla.
FINEST = 0.2
#: By how many squared texels the squared radius grows, so that the variance of the cone grows by 1/12.
SPREAD = 5 / 6
#: Radius, in texels, by which a point is rounded.
ROUNDING = 0.4
#: Ridges about a base, and their depth as a share of the radius.
RIDGES, RIDGE_DEPTH = 8, 0.12


class Papillae(Pattern):
    """Sparse cones with sharp points, of very unequal height, that lean and have ridges about their base.

    The pattern is their height.
    """

    spacing: float = Field(default=8.0, ge=0.01, le=1000, description="mean distance between papillae, mm")
    diameter: float = Field(
        default=6.0, gt=0, le=1000, description="of the base of the largest, mm, at most the spacing"
    )
    variation: Unit = Field(default=0.85, description="how much lower most of them are: 0 equal, 1 down to nothing")
    lean: float = Field(
        default=0.35, ge=0, le=0.8, description="how far a point is off the middle of its base, in radii of the base"
    )
    ridges: Unit = Field(default=0.5, description="depth of the ridges about the base, 0 to 1")
    jitter: float = Field(default=0.9, ge=0, le=1, description="disorder: 0 a lattice, 1 random")

    def size(self) -> float:
        return self.spacing

    @model_validator(mode="after")
    def _fits(self) -> Papillae:
        require_room("diameter", self.diameter, self.spacing)
        return self

    def finest(self) -> float:
        return FINEST * 0.5 * self.diameter

    def widest(self) -> float:
        return 0.1 * self.spacing

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        return {
            "cell": cell,
            "period": period,
            "radius": 0.5 * self.diameter / cell,
            "variation": self.variation,
            "lean": self.lean,
            "ridges": RIDGE_DEPTH * self.ridges,
            "jitter": self.jitter,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        cell, texel, normal = values["cell"], site["footprint"] / values["cell"], site["normal"]
        reach = np.sqrt(values["radius"] ** 2 + SPREAD * texel**2)
        position, extent = site["position"] / cell, disk(normal, reach)
        marks = find_marks(position, normal, extent, values["period"], values["jitter"], values["seed"])
        random = marks.more_random()
        size = 1 - values["variation"] * (1 - marks.random[..., 3] ** 2)
        own2 = np.maximum(np.sqrt(marks.near) * (values["radius"] * (0.4 + 0.6 * size)) ** 2, 1e-6)
        radius2 = own2 + SPREAD * texel[:, None] ** 2
        radius = np.sqrt(radius2)
        heading = along_surface(random[..., :3] - 0.5, normal[:, None])
        lean = values["lean"] * random[..., 3]
        clear = 1 - hashing.smoothstep(0.1, 0.4, texel[:, None] / radius)
        rounding = ROUNDING**2 * texel[:, None] ** 2 / radius2
        # From the point to the place, in radii; the slice of the cone on which the place lies solves a quadratic.
        away = -marks.along / radius[..., None] - lean[..., None] * heading
        squared = np.sum(away**2, axis=-1)
        ahead = np.sum(away * heading, axis=-1)
        down = (lean * ahead + np.sqrt((lean * ahead) ** 2 + (1 - lean**2) * squared)) / (1 - lean**2)
        cosine2 = ahead**2 / np.maximum(squared, 1e-9)
        ridge = 2 * (8 * cosine2 * (cosine2 - 1) + 1) ** 2 - 1
        down = down + 4 * values["ridges"] * clear * ridge * down * down * np.maximum(1 - down, 0)
        up = np.maximum(1 - np.sqrt(down * down + rounding), 0)
        return 1 - np.prod(1 - np.sqrt(marks.near) * size * own2 / radius2 * up * up, axis=1)
