"""Cellular patterns: blobs, patches, cracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from functools import partial
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing
from skincli.layers.base import (
    LEVELS_FIELD,
    Array,
    Ground,
    Pattern,
    Site,
    UnitRamp,
    Value,
    joint_seed,
    pattern_mean,
)
from skincli.layers.filtering import EDGE_PER_TEXEL, sampled
from skincli.layers.fractal import PLACES, steepness


class Kind(IntEnum):
    """What is made of the feature points."""

    F1 = 0
    F2 = 1
    F2_F1 = 2
    EDGES = 3
    PATCHES = 4


#: Distance, in cells, that becomes 1: nearly no point of space lies farther.
FAR = {Kind.F1: 1.0, Kind.F2: 1.2, Kind.F2_F1: 0.75}
#: Where the lattice lies, in cells: a flat square, where z is 0, cuts cells as any other plane does.
ASIDE = np.array([0.5, 0.5, 0.25])
#: Size of what still shows in single places, in cells: where these are a cell apart they all fall on like places.
CALM = 0.7
#: A line's profile has 2/15 of the squared half width as variance, a texel 1/12.
LINE_PER_TEXEL = 0.7906


class Worley(Pattern):
    """Cells about scattered feature points [Worley1996]: blobs, lines between cells, or patches of random values.

    Feature points are sought in the 27 nearest cells. With a jitter above 0.46 a nearer one may lie farther out; even
    at jitter 1 this concerns less than 1 point of space in 10000.
    """

    scale: float = Field(default=5.0, ge=0.01, le=10000, description="mean size of a cell, mm")
    pattern: Literal["f1", "f2", "f2_f1", "edges", "patches"] = Field(
        default="f1",
        description="f1: distance to the nearest point, 1 at `scale`; f2: to the second nearest, 1 at 1.2 times that; "
        "f2_f1: their difference, 0 between cells; edges: 1 on the lines between cells; patches: a random value per "
        "cell",
    )
    jitter: float = Field(default=0.9, ge=0, le=1, description="disorder of the points: 0 a lattice, 1 random")
    width: float | None = Field(
        default=None,
        gt=0,
        le=10000,
        description="edges, patches: half the width of a line or of the border between two, mm",
    )
    levels: UnitRamp = LEVELS_FIELD

    def size(self) -> float:
        return self.scale

    @model_validator(mode="after")
    def _width_is_read(self) -> Worley:
        if self.pattern == "edges" and self.width is None:
            raise ValueError("the pattern edges needs the width of its lines in mm; add a width")
        if self.pattern not in ("edges", "patches") and self.width is not None:
            raise ValueError(f"the pattern {self.pattern} has no lines; remove width, or choose edges or patches")
        return self

    def values(self, ground: Ground) -> dict[str, Value]:
        scale, period = ground.fit(self.scale)
        kind = Kind[self.pattern.upper()]
        finest = scale / 8 * steepness(self.levels) if kind in FAR else scale / 24
        if kind == Kind.EDGES and self.width is not None:
            finest = min(finest, self.width / 2)
        values: dict[str, Value] = {
            "kind": kind,
            "scale": scale,
            "period": period,
            "jitter": self.jitter,
            "far": FAR.get(kind, 1.0),
            "width": (self.width or 0.0) / scale,
            "finest": finest,
            "levels": self.levels,
            "seed": joint_seed(ground.seed, self.seed),
        }
        return values | {"mean": pattern_mean(type(self), values, scale)}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        return sampled(site, values["finest"], PLACES, partial(_point, values))


def _point(values: Mapping[str, Any], site: Site) -> Array:
    """Twin of `worley_point`: (n,)."""
    scale, seed, normal, ends = values["scale"], values["seed"], site["normal"], values["levels"]
    cell, fraction = hashing.split(site["position"] / scale + ASIDE)
    random = hashing.hash_cell(hashing.wrap_cell(cell[:, None] + hashing.NEIGHBORS, values["period"]), seed)
    points = hashing.NEIGHBORS + 0.5 + values["jitter"] * (random[..., :3] - 0.5) - fraction[:, None]
    squared = np.sum(points**2, axis=-1)
    rows, owner = np.arange(len(squared)), np.argmin(squared, axis=1)
    texel = site["footprint"] / scale
    if values["kind"] in FAR:
        first, second = np.partition(squared, 1, axis=1)[:, :2].T
        # The mean distance over a texel is a little more than that of its center.
        near, next_ = (np.sqrt(each + texel**2 / 12) for each in (first, second))
        t = {Kind.F1: near, Kind.F2: next_, Kind.F2_F1: next_ - near}[values["kind"]] / values["far"]
        t = hashing.levels(t, ends, EDGE_PER_TEXEL * texel / values["far"])
    else:
        nearest = points[rows, owner][:, None]
        between = points - nearest
        away = np.einsum("nij,nj->ni", between, normal)
        across = np.sqrt(np.maximum(np.sum(between**2, axis=-1) - away**2, 1e-6))
        planes = 0.5 * np.sum((points + nearest) * between, axis=-1) / across
        planes[rows, owner] = 1e9
        if values["kind"] == Kind.EDGES:
            width = np.hypot(values["width"], LINE_PER_TEXEL * texel)
            t = values["width"] / width * (1 - hashing.smoothstep(0, width, planes.min(axis=1)))
            t = hashing.levels(t, ends, EDGE_PER_TEXEL * texel / width)
        else:
            # On the border to another cell its value weighs as much as the own.
            width = np.maximum(np.hypot(values["width"], EDGE_PER_TEXEL * texel), 1e-6)[:, None]
            share = 0.5 - 0.5 * hashing.smoothstep(0, width, planes)
            weight = share / (1 - share)
            weight[rows, owner] = 1
            t = np.sum(weight * hashing.levels(random[..., 3], ends, 0), axis=1) / np.sum(weight, axis=1)
    visible = hashing.resolved(CALM * scale, site["footprint"])
    return (1 - visible) * values["mean"] + visible * t
