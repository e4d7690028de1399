"""Pores: round pits scattered over the surface."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing
from skincli.layers.base import (
    SEED_FIELD,
    Array,
    Flat,
    Layer,
    Own,
    Ramp,
    Rgb,
    Seed,
    Site,
    Value,
    joint_seed,
    pattern_mean,
)
from skincli.layers.blend import Blend

#: Thickness of the shell about the surface from which points are taken, in cells: the integral of its weight.
SHELL = 0.75


class Pores(Layer):
    """Round pits scattered over the surface, as follicles are; a negative depth makes bumps."""

    spacing: float = Field(default=1.0, ge=0.01, le=1000, description="mean distance between pores, mm")
    radius: float | None = Field(
        default=None,
        gt=0,
        le=500,
        description="radius of a pore, mm, at most half the spacing; left out: a third of it",
    )
    depth: float = Field(default=0.02, ge=-10, le=10, description="depth of the deepest pores, mm")
    jitter: float = Field(default=0.9, ge=0, le=1, description="disorder of the pores: 0 a lattice, 1 random")
    variation: float = Field(0.6, ge=0, le=1, description="how much shallower some are: 0 equal, 1 down to nothing")
    tint: Rgb | None = Field(
        default=None, description="factor of the albedo at the center of a pore, linear Rec.709, 0 to 1"
    )
    seed: Seed = SEED_FIELD

    @model_validator(mode="after")
    def _fits(self) -> Pores:
        if self.radius is not None and self.radius > 0.5 * self.spacing:
            raise ValueError(
                f"radius is {self.radius:g} mm, more than half of spacing, {self.spacing:g} mm; "
                "lower radius or raise spacing"
            )
        return self

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        channels: dict[str, Flat | Ramp | Own] = {"height": Ramp(0.0, -self.depth)} if self.depth else {}
        return channels if self.tint is None else channels | {"albedo": Ramp((1.0, 1.0, 1.0), self.tint)}

    def blending(self) -> Blend:
        return "multiply"

    def unread_in_mask(self) -> set[str]:
        return super().unread_in_mask() | {"depth", "tint"}

    def values(self, seed: int) -> dict[str, Value]:
        # One point per cell, of which the shell holds SHELL: so many per area that their mean distance is `spacing`.
        cell = self.spacing * math.sqrt(SHELL)
        values: dict[str, Value] = {
            "cell": cell,
            "radius": (self.spacing / 3 if self.radius is None else self.radius) / cell,
            "jitter": self.jitter,
            "variation": self.variation,
            "seed": joint_seed(seed, self.seed),
        }
        return values | {"mean": pattern_mean(type(self), values, cell)}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, picture: Array | None) -> Array:
        cell, fraction = hashing.split(site["position"] / values["cell"] + 0.5)
        random = hashing.hash_cell(cell[:, None] + hashing.NEIGHBORS, values["seed"])
        points = hashing.NEIGHBORS + 0.5 + values["jitter"] * (random[..., :3] - 0.5) - fraction[:, None]
        radius = np.clip(site["footprint"] / values["cell"], values["radius"], 0.85)[:, None]
        height = np.einsum("nij,nj->ni", points, site["normal"])
        across = np.maximum(np.sum(points**2, axis=-1) - height**2, 0)
        bowl = np.maximum(1 - across / radius**2, 0) ** 2
        near = 1 - hashing.smoothstep(0.25, 0.5, np.abs(height))
        strength = (values["radius"] / radius) ** 2
        depth = strength * near * bowl * (1 - values["variation"] * random[..., 3])
        visible = hashing.resolved(values["cell"], site["footprint"])
        return (1 - visible) * values["mean"] + visible * (1 - np.prod(1 - depth, axis=1))
