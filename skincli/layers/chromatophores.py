"""Chromatophores: the pigment sacs of an octopus, one class of pigment for each layer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import filtering, hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed, pattern_mean
from skincli.layers.marks import along_surface, disk, find_marks

#: How far apart the places may be in which a texel is looked at, in radii of an open sac.
FINEST = 0.2
#: Texels of these sizes, in cells, begin to show the mean alone, and show nothing else.
FIRST, LAST = 0.75, 8.0
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

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        values: dict[str, Value] = {
            "cell": cell,
            "period": period,
            "closed": self.closed / cell,
            "open": self.open / cell,
            "expansion": self.expansion,
            "variation": self.variation,
            "jitter": self.jitter,
            "seed": joint_seed(ground.seed, self.seed),
        }
        return values | {"mean": pattern_mean(type(self), values, cell)}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        texel = site["footprint"] / values["cell"]
        t = np.zeros(len(texel))
        for part in filtering.looks(site, FINEST * values["open"] * values["cell"], 4):
            t[part.chosen] = _sacs(values, part)
        shown = 1 - hashing.smoothstep(FIRST, LAST, texel)
        return (1 - shown) * values["mean"] + shown * t


def _sacs(values: Mapping[str, Any], part: filtering.Looks) -> Array:
    """Return the share that sacs cover of texels of which each is looked at in equally many places."""
    cell, texel, normal = values["cell"], part.site["footprint"] / values["cell"], part.site["normal"]
    place = texel / part.count
    widest = filtering.disk_of(np.array(values["open"]), np.array(SOFTNESS * values["open"]), place).reach()
    reach = np.where(texel < LAST, (1 + PULL) * widest + part.reach() / cell, 0)
    marks = find_marks(
        part.site["position"] / cell, normal, disk(normal, reach), values["period"], values["jitter"], values["seed"]
    )
    variation, random = values["variation"], marks.more_random()
    opened = np.clip((1 + variation) * values["expansion"] - variation * marks.random[..., 3], 0, 1)
    radius = values["closed"] + opened * (values["open"] - values["closed"])
    radius *= np.sqrt(marks.near) * (1 - 0.5 * variation * random[..., 3])
    found = filtering.disk_of(radius, SOFTNESS * radius, place[:, None])
    first = along_surface(random[..., :3] - 0.5, normal[:, None])
    t = np.zeros(len(texel))
    for step in part.steps:
        away = marks.along - step[:, None] / cell
        distance = np.sqrt(np.maximum(np.sum(away**2, axis=-1), 1e-12))
        cosine = np.sum(away * first, axis=-1) / distance
        sine = np.sum(np.cross(np.broadcast_to(normal[:, None], first.shape), first) * away, axis=-1) / distance
        edge = 1 - PULL * opened * (0.6 * _five(cosine) + 0.4 * _seven(sine))
        t += 1 - np.prod(1 - found.at(distance * edge), axis=1)
    return t / len(part.steps)


def _five(x: Array) -> Array:
    """Return the cosine of five times the angle whose cosine is x."""
    return x * ((16 * x * x - 20) * x * x + 5)


def _seven(x: Array) -> Array:
    """Return the cosine of seven times the angle whose cosine is x."""
    return x * (((64 * x * x - 112) * x * x + 56) * x * x - 7)
