"""Pores: round pits scattered over the surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import marks
from skincli.layers.base import (
    Array,
    Flat,
    Ground,
    Own,
    Pattern,
    Ramp,
    Rgb,
    Site,
    Value,
    joint_seed,
)
from skincli.layers.blend import Blend


class Pores(Pattern):
    """Round pits scattered over the surface, as follicles are; a negative depth makes bumps."""

    spacing: float = Field(default=1.0, ge=0.01, le=1000, description="mean distance between pores, mm")
    radius: float | None = Field(
        default=None,
        gt=0,
        le=500,
        description="radius of a pore, mm, at most half the spacing; left out: a quarter of it",
    )
    depth: float = Field(default=0.02, ge=-10, le=10, description="depth of the deepest pores, mm")
    jitter: float = Field(default=0.9, ge=0, le=1, description="disorder of the pores: 0 a lattice, 1 random")
    variation: float = Field(0.6, ge=0, le=1, description="how much shallower some are: 0 equal, 1 down to nothing")
    tint: Rgb | None = Field(
        default=None, description="factor of the albedo at the center of a pore, linear Rec.709, 0 to 1"
    )

    @model_validator(mode="after")
    def _fits(self) -> Pores:
        if self.radius is not None:
            marks.require_room("radius", self.radius, self.spacing, 0.5)
        return self

    def size(self) -> float:
        return self.spacing

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        own: dict[str, Flat | Ramp | Own] = {"height": Ramp(0.0, -self.depth)} if self.depth else {}
        if self.tint is not None:
            own["albedo"] = Ramp((1.0, 1.0, 1.0), self.tint)
        return own | super().channels()

    def blending(self) -> Blend:
        return "multiply" if self.tint is not None and "blend" not in self.model_fields_set else self.blend

    def unread_in_mask(self) -> set[str]:
        return super().unread_in_mask() | {"depth", "tint"}

    def finest(self) -> float:
        return marks.FINEST * self.spacing

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        return {
            "cell": cell,
            "period": period,
            "radius": (0.25 * self.spacing if self.radius is None else self.radius) / cell,
            "jitter": self.jitter,
            "variation": self.variation,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        texel = site["footprint"] / values["cell"]
        wide2 = marks.widened2(values["radius"], texel)
        found = marks.find_marks(
            site["position"] / values["cell"],
            site["normal"],
            marks.disk(site["normal"], np.sqrt(wide2)),
            values["period"],
            values["jitter"],
            values["seed"],
        )
        bowl = marks.bump(found.squared() / wide2[:, None])
        strength = values["radius"] ** 2 / wide2[:, None]
        depth = strength * found.near * bowl * (1 - values["variation"] * found.random[..., 3])
        return 1 - np.prod(1 - depth, axis=1)
