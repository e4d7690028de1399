"""Moles: sparse dark spots, some of them raised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import marks
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.filtering import Disk, disk_of


class Part(IntEnum):
    """What of a mole is drawn."""

    SPOT = 0
    DOME = 1


#: Mean radius of the edge of a spot, and half the width of the edge, in radii of a mole.
EDGE = 0.75
SOFTNESS = 0.25


class Moles(Pattern):
    """Sparse, nearly round spots of even darkness, some of them raised into domes; layers of one seed meet."""

    part: Literal["spot", "dome"] = Field(
        default="spot", description="what is 1: the dark spot, or the top of the domes of those that are raised"
    )
    spacing: float = Field(default=25.0, ge=0.01, le=10000, description="mean distance between moles, mm")
    radius: float = Field(default=2.0, gt=0, le=5000, description="radius of the largest, mm, at most half of spacing")
    variation: Unit = Field(default=0.7, description="how much smaller and paler some are: 0 equal")
    irregularity: Unit = Field(default=0.4, description="how far they are from round")
    raised: Unit = Field(default=0.6, description="share of the moles that are raised; dome only")
    jitter: Unit = Field(default=1.0, description="disorder of the moles: 0 a lattice, 1 random")

    @model_validator(mode="after")
    def _fits(self) -> Moles:
        marks.require_room("radius", self.radius, self.spacing, 0.5)
        return self

    def size(self) -> float:
        return self.spacing

    def finest(self) -> float:
        return min(marks.FINEST * self.spacing, 0.5 * self.radius)

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        return {
            "part": Part[self.part.upper()],
            "cell": cell,
            "period": period,
            "radius": self.radius / cell,
            "variation": self.variation,
            "edge": EDGE,
            "softness": SOFTNESS,
            "irregularity": self.irregularity,
            "raised": self.raised,
            "jitter": self.jitter,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        texel = site["footprint"] / values["cell"]
        spot = values["part"] == Part.SPOT

        def disk(radius: Array, texel: Array) -> Disk:
            return disk_of(values["edge"] * radius, values["softness"] * radius, texel)

        largest = np.full(len(texel), values["radius"])
        reach = disk(largest, texel).reach() if spot else np.sqrt(marks.widened2(largest, texel))
        found = marks.find_marks(
            site["position"] / values["cell"],
            site["normal"],
            marks.disk(site["normal"], marks.OUT_OF_ROUND * reach),
            values["period"],
            values["jitter"],
            values["seed"],
        )
        more = found.more_random()
        pull, radius = 2 * more[..., :3] - 1, values["radius"] * (1 - values["variation"] * more[..., 3])
        if spot:
            disks = disk(radius, texel[:, None])
            border = np.maximum(disks.reach(), 1e-9)
            squared = marks.out_of_round(found.along / border[..., None], pull, values["irregularity"])
            t = (1 - 0.5 * values["variation"] * found.random[..., 3]) * disks.at(border * np.sqrt(squared))
        else:
            wide2 = np.maximum(marks.widened2(radius, texel[:, None]), 1e-12)
            squared = marks.out_of_round(found.along / np.sqrt(wide2)[..., None], pull, values["irregularity"])
            raised = np.clip(4 * (values["raised"] - found.random[..., 3]), 0, 1)
            t = radius**2 / wide2 * raised * marks.bump(squared)
        return 1 - np.prod(1 - found.near * t, axis=1)
