"""Chromatophores: the pigment sacs of an octopus, one class of pigment for each layer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed
from skincli.layers.filtering import disk_of
from skincli.layers.marks import along_surface, disk, find_marks

#: How far apart the places may be in which a texel is looked at, in radii of an open sac.
FINEST = 0.16
#: How far the muscles pull the edge of an open sac out of round, as a share of its radius.
PULL = 0.15
#: Half the width of a sac's edge, as a share of its radius.
SOFTNESS = 0.12


class Chromatophores(Pattern):
    """Pigment sacs that muscles pull open, 1 within a sac [Messenger2001]; a layer for each class of pigment.

    Over a reflecting base, stack yellow, red and brown with seeds and spacings of their own and animate `expansion`.
    The sacs stay where they are; closed they are small round dots, open they are wide and ragged.
    """

    spacing: float = Field(default=1.2, ge=0.01, le=1000, description="mean distance between sacs, mm")
    closed: float = Field(default=0.1, gt=0, le=1000, description="radius of a closed sac, mm, less than open")
    open: float = Field(default=0.55, gt=0, le=1000, description="radius of an open sac, mm, at most the spacing")
    expansion: Unit = Field(default=0.5, description="how far the sacs are open: 0 closed, 1 open; made to be animated")
    variation: Unit = Field(
        default=0.5, description="how unequal sacs are in size and in when they open: 0 equal, 1 one after the other"
    )
    jitter: float = Field(default=0.6, ge=0, le=1, description="disorder of the sacs: 0 a lattice, 1 random")

    def size(self) -> float:
        return self.spacing

    @model_validator(mode="after")
    def _fits(self) -> Chromatophores:
        if not self.closed < self.open <= self.spacing:
            raise ValueError(
                f"closed is {self.closed:g} mm, open {self.open:g} mm and spacing {self.spacing:g} mm; "
                "closed must be less than open, and open at most the spacing; change one of them"
            )
        return self

    def finest(self) -> float:
        return FINEST * self.open

    def widest(self) -> float:
        return 0.3 * self.spacing

    def grain(self) -> float:
        return (0.72 + 0.54 * self.jitter) * self.spacing

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        return {
            "cell": cell,
            "period": period,
            "closed": self.closed / cell,
            "open": self.open / cell,
            "expansion": self.expansion,
            "variation": self.variation,
            "jitter": self.jitter,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        cell, texel, normal = values["cell"], site["footprint"] / values["cell"], site["normal"]
        widest = disk_of(np.array(values["open"]), np.array(SOFTNESS * values["open"]), texel)
        position, extent = site["position"] / cell, disk(normal, (1 + PULL) * widest.reach())
        marks = find_marks(position, normal, extent, values["period"], values["jitter"], values["seed"])
        variation, random = values["variation"], marks.more_random()
        opened = np.clip((1 + variation) * values["expansion"] - variation * marks.random[..., 3], 0, 1)
        radius = values["closed"] + opened * (values["open"] - values["closed"])
        radius *= np.sqrt(marks.near) * (1 - 0.5 * variation * random[..., 3])
        first = along_surface(random[..., :3] - 0.5, normal[:, None])
        distance = np.sqrt(np.maximum(marks.squared(), 1e-12))
        cosine = np.sum(marks.along * first, axis=-1) / distance
        sine = np.sum(np.cross(np.broadcast_to(normal[:, None], first.shape), first) * marks.along, axis=-1) / distance
        edge = 1 - PULL * opened * (0.6 * _five(cosine) + 0.4 * _seven(sine))
        return 1 - np.prod(1 - disk_of(radius, SOFTNESS * radius, texel[:, None]).at(distance * edge), axis=1)


def _five(x: Array) -> Array:
    """Return the cosine of five times the angle whose cosine is x."""
    return x * ((16 * x * x - 20) * x * x + 5)


def _seven(x: Array) -> Array:
    """Return the cosine of seven times the angle whose cosine is x."""
    return x * (((64 * x * x - 112) * x * x + 56) * x * x - 7)
