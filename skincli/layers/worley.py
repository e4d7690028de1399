"""Cellular patterns: blobs, patches, cracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
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
)
from skincli.layers.filtering import EDGE_PER_TEXEL
from skincli.layers.fractal import steepness


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
#: A line's profile has 0.11 of the squared half width as variance, a texel 1/12.
LINE_PER_TEXEL = 0.8706


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

    def finest(self) -> float:
        if Kind[self.pattern.upper()] in FAR:
            return self.scale / (16 if self.pattern == "f2_f1" else 8) * steepness(self.levels)
        return min(self.scale / 24, self.width / 4) if self.pattern == "edges" and self.width else self.scale / 24

    def widest(self) -> float:
        return self.scale / {"edges": 24, "patches": 8}.get(self.pattern, 6)

    def grain(self) -> float:
        # Regular cells vanish sooner, and so do lines; patches, which differ most, later.
        share = {"patches": 1.7, "edges": 0.45}.get(self.pattern, 1.0)
        return share * (0.7 + 0.3 * self.jitter) * self.scale

    def values(self, ground: Ground) -> dict[str, Value]:
        scale, period = ground.fit(self.scale)
        kind = Kind[self.pattern.upper()]
        return {
            "kind": kind,
            "scale": scale,
            "period": period,
            "jitter": self.jitter,
            "far": FAR.get(kind, 1.0),
            "width": (self.width or 0.0) / scale,
            "levels": self.levels,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
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
                # A line that is widened is so much weaker, against what the levels make of no line.
                line = hashing.levels(1 - hashing.smoothstep(0, width, planes.min(axis=1)), ends, 0)
                none = hashing.levels(np.zeros(1), ends, 0)
                t = none + values["width"] / width * (line - none)
            else:
                # On the border to another cell its value weighs as much as the own.
                width = np.maximum(np.hypot(values["width"], EDGE_PER_TEXEL * texel), 1e-6)[:, None]
                share = 0.5 - 0.5 * hashing.smoothstep(0, width, planes)
                weight = share / (1 - share)
                weight[rows, owner] = 1
                t = np.sum(weight * hashing.levels(random[..., 3], ends, 0), axis=1) / np.sum(weight, axis=1)
        return t
