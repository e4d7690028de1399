"""Follicles: the pits from which hairs grow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import marks
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed


class Part(IntEnum):
    """What of a follicle is drawn."""

    PIT = 0
    RIM = 1
    DOT = 2


#: How far out a rim ends, and a hair's root, in radii of the pit.
RIM_REACH = 2.0
DOT_RADIUS = 0.45
#: How far along the hair the root lies from the middle of the pit, in radii.
DOT_SHIFT = 0.3
#: What makes the highest of a rim, which is the difference of two bumps, 1.
RIM_PEAK = 1.890078


class Follicles(Pattern):
    """Pits from which hairs grow, longer along the hair, with a raised rim and a dark root; layers of one seed meet."""

    part: Literal["pit", "rim", "dot"] = Field(
        default="pit", description="what is 1: the pit, the raised skin around it, or the root of the hair in it"
    )
    spacing: float = Field(default=2.0, ge=0.01, le=1000, description="mean distance between follicles, mm")
    radius: float = Field(default=0.22, gt=0, le=500, description="radius of a pit across, mm, at most half of spacing")
    elongation: float = Field(default=1.5, ge=1, le=4, description="length of a pit along the hair over its width")
    direction: marks.Direction = Field(
        default=(0.0, -1.0, 0.0), description="where the hairs point, in the space of the mesh"
    )
    jitter: Unit = Field(default=0.8, description="disorder of the follicles: 0 a lattice, 1 random")
    variation: Unit = Field(default=0.4, description="how much weaker and smaller some are: 0 equal")

    @model_validator(mode="after")
    def _fits(self) -> Follicles:
        marks.require_room("radius", self.radius, self.spacing, 0.5)
        return self

    def size(self) -> float:
        return self.spacing

    def finest(self) -> float:
        return (
            min(marks.FINEST * self.spacing, 0.5 * self.radius) if self.part == "rim" else marks.FINEST * self.spacing
        )

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        return {
            "part": Part[self.part.upper()],
            "cell": cell,
            "period": period,
            "radius": self.radius / cell,
            "elongation": self.elongation,
            "direction": marks.unit(self.direction),
            "jitter": self.jitter,
            "variation": self.variation,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        part, normal = values["part"], site["normal"]
        texel = site["footprint"] / values["cell"]
        hair = marks.along_surface(np.array(values["direction"]), normal)
        shift = DOT_SHIFT * values["radius"] if part == Part.DOT else 0.0
        largest = values["radius"] * (RIM_REACH if part == Part.RIM else 1.0)
        reach = np.sqrt(marks.widened2(largest * values["elongation"], texel)) + shift
        found = marks.find_marks(
            site["position"] / values["cell"],
            normal,
            marks.disk(normal, reach),
            values["period"],
            values["jitter"],
            values["seed"],
        )
        along = found.along + shift * hair[:, None]
        ahead = np.einsum("nmi,ni->nm", along, hair)
        distance2 = np.sum(along**2, axis=-1)

        def bump(radius: Array) -> Array:
            wide2 = marks.widened2(radius, texel[:, None])
            long2 = marks.widened2(radius * values["elongation"], texel[:, None])
            squared = ahead**2 * (1 / long2 - 1 / wide2) + distance2 / wide2
            return radius**2 * values["elongation"] / np.sqrt(wide2 * long2) * marks.bump(squared)

        radius = values["radius"] * (1 - 0.5 * values["variation"] * found.more_random()[..., 3])
        if part == Part.RIM:
            t = RIM_PEAK * (bump(RIM_REACH * radius) - bump(radius))
        else:
            t = bump(radius if part == Part.PIT else DOT_RADIUS * radius)
        untouched = np.prod(1 - found.near * (1 - values["variation"] * found.random[..., 3]) * t, axis=1)
        return 1 - untouched
