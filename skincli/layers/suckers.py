"""Suckers: rings with a cup and a hole in the middle, as on the arms of an octopus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.filtering import disk_of
from skincli.layers.marks import along_surface, disk, find_marks, require_room

#: How far apart the places may be in which a texel is looked at, in radii of a sucker.
FINEST = 0.14
#: Radius and half the width of the edge of the outer rim, the cup and the hole, as shares of the sucker's radius.
RIM, CUP, HOLE = (0.86, 0.14), (0.6, 0.1), (0.2, 0.07)
#: Height of the floor of the cup, where the rim is 1.
FLOOR = 0.35
#: How much the folds take away where they are deepest.
FOLD_DEPTH = 0.5


class Part(IntEnum):
    """What of a sucker is 1."""

    ALL = 0
    RIM = 1
    CUP = 2


class Suckers(Pattern):
    """Suckers: a rim, a cup with radial folds, and a hole in its middle."""

    spacing: float = Field(default=6.0, ge=0.01, le=1000, description="mean distance between suckers, mm")
    diameter: float = Field(default=5.0, gt=0, le=1000, description="of the largest, mm, at most the spacing")
    variation: Unit = Field(default=0.3, description="how much smaller some are: 0 equal, 1 down to nothing")
    folds: Unit = Field(default=0.5, description="depth of the sixteen folds from hole to rim, 0 to 1")
    part: Literal["all", "rim", "cup"] = Field(
        default="all",
        description="all: height, 1 on the rim, less in the cup, 0 in the hole and between suckers; rim: 1 on the rim; "
        "cup: 1 within it",
    )
    jitter: float = Field(default=0.2, ge=0, le=1, description="disorder: 0 a lattice, 1 random")

    def size(self) -> float:
        return self.spacing

    @model_validator(mode="after")
    def _fits(self) -> Suckers:
        require_room("diameter", self.diameter, self.spacing)
        return self

    def finest(self) -> float:
        return FINEST * 0.5 * self.diameter

    def widest(self) -> float:
        return self.spacing

    def grain(self) -> float:
        return (0.7 + 0.3 * self.jitter) * self.spacing

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        return {
            "part": Part[self.part.upper()],
            "cell": cell,
            "period": period,
            "radius": 0.5 * self.diameter / cell,
            "variation": self.variation,
            "folds": FOLD_DEPTH * self.folds,
            "jitter": self.jitter,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        cell, normal = values["cell"], site["normal"]
        texel = (site["footprint"] / cell)[:, None]
        widest = disk_of(np.array(values["radius"] * RIM[0]), np.array(values["radius"] * RIM[1]), texel[:, 0])
        position, extent = site["position"] / cell, disk(normal, widest.reach())
        marks = find_marks(position, normal, extent, values["period"], values["jitter"], values["seed"])
        radius = values["radius"] * np.sqrt(marks.near) * (1 - values["variation"] * marks.random[..., 3])
        rim, cup, hole = (disk_of(share * radius, softness * radius, texel) for share, softness in (RIM, CUP, HOLE))
        heading = along_surface(marks.more_random()[..., :3] - 0.5, normal[:, None])
        clear = 1 - hashing.smoothstep(0.05, 0.2, texel / np.maximum(radius, 1e-6))
        distance = np.sqrt(np.maximum(marks.squared(), 1e-12))
        cosine2 = (np.sum(marks.along * heading, axis=-1) / distance) ** 2
        eight = 2 * (8 * cosine2 * (cosine2 - 1) + 1) ** 2 - 1
        whole, inner, pit = rim.at(distance), cup.at(distance), hole.at(distance)
        if values["part"] == Part.RIM:
            own = whole - inner
        elif values["part"] == Part.CUP:
            own = inner
        else:
            own = whole - (1 - FLOOR) * inner - FLOOR * pit
        # The folds run from the hole across the cup and end on the rim.
        fold = values["folds"] * (0.5 - 0.5 * clear * (2 * eight * eight - 1)) * (1 - pit) * (0.3 + 0.7 * inner)
        return np.minimum(np.sum(np.maximum(own, 0) * (1 - fold), axis=1), 1)
