"""Cellular patterns: blobs, patches, cracks."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing
from skincli.layers.base import (
    LEVELS_FIELD,
    SEED_FIELD,
    Array,
    Pattern,
    Seed,
    Site,
    UnitRamp,
    Value,
    joint_seed,
    pattern_mean,
)


class Kind(IntEnum):
    """What is made of the feature points."""

    DISTANCE = 0
    EDGES = 1
    PATCHES = 2


class Worley(Pattern):
    """Cells about scattered feature points [Worley1996]: blobs, lines between cells, or patches of random values.

    Feature points are sought in the 27 nearest cells. With a jitter above 0.46 a nearer one may lie farther out; even
    at jitter 1 this concerns less than 1 point of space in 10000.
    """

    scale: float = Field(default=5.0, ge=0.01, le=10000, description="mean size of a cell, mm")
    pattern: Literal["distance", "edges", "patches"] = Field(
        default="distance",
        description="distance: to the nearest point, 1 at `scale`; edges: 1 on the lines between cells; "
        "patches: a random value per cell",
    )
    jitter: float = Field(default=0.9, ge=0, le=1, description="disorder of the points: 0 a lattice, 1 random")
    width: float | None = Field(
        default=None,
        gt=0,
        le=10000,
        description="edges, patches: half the width of a line or of the border between two, mm",
    )
    warp: float = Field(default=0.0, ge=0, le=10000, description="how far the pattern is pulled about, mm")
    levels: UnitRamp = LEVELS_FIELD
    seed: Seed = SEED_FIELD

    @model_validator(mode="after")
    def _width_is_read(self) -> Worley:
        if self.pattern == "edges" and self.width is None:
            raise ValueError("the pattern edges needs the width of its lines in mm; add a width")
        if self.pattern == "distance" and self.width is not None:
            raise ValueError("the pattern distance has no lines; remove width, or choose edges or patches")
        return self

    def values(self, seed: int) -> dict[str, Value]:
        values: dict[str, Value] = {
            "kind": Kind[self.pattern.upper()],
            "scale": self.scale,
            "jitter": self.jitter,
            "width": (self.width or 0.0) / self.scale,
            "warp": self.warp / self.scale,
            "levels": self.levels,
            "seed": joint_seed(seed, self.seed),
        }
        return values | {"mean": pattern_mean(type(self), values, self.scale)}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, picture: Array | None) -> Array:
        scale, seed, footprint, normal = values["scale"], values["seed"], site["footprint"], site["normal"]
        cell, fraction = hashing.split(hashing.warp_cells(site["position"] / scale + 0.5, values["warp"], seed))
        neighbors = cell[:, None] + hashing.NEIGHBORS
        random = hashing.hash_cell(neighbors, seed)
        points = hashing.NEIGHBORS + 0.5 + values["jitter"] * (random[..., :3] - 0.5) - fraction[:, None]
        squared = np.sum(points**2, axis=-1)
        rows, owner = np.arange(len(squared)), np.argmin(squared, axis=1)
        texel = footprint / scale
        if values["kind"] == Kind.DISTANCE:
            t = hashing.levels(np.sqrt(squared[rows, owner]), values["levels"], texel)
        else:
            nearest = points[rows, owner][:, None]
            between = points - nearest
            away = np.einsum("nij,nj->ni", between, normal)
            across = np.sqrt(np.maximum(np.sum(between**2, axis=-1) - away**2, 1e-6))
            planes = 0.5 * np.sum((points + nearest) * between, axis=-1) / across
            planes[rows, owner] = 1e9
            other = np.argmin(planes, axis=1)
            border = planes[rows, other]
            if values["kind"] == Kind.EDGES:
                width = np.maximum(values["width"], texel)
                line = values["width"] / width * (1 - hashing.smoothstep(0, width, border))
                t = hashing.levels(line, values["levels"], 0)
            else:
                share = 0.5 * (1 - hashing.smoothstep(0, np.maximum(np.maximum(texel, values["width"]), 1e-9), border))
                own, theirs = (hashing.levels(random[rows, i, 3], values["levels"], 0) for i in (owner, other))
                t = (1 - share) * own + share * theirs
        visible = hashing.resolved(scale, footprint)
        return (1 - visible) * values["mean"] + visible * t
