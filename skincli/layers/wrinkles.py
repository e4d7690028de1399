"""Wrinkles: furrows that run along a direction, from fine skin lines to folds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing, marks
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed

#: A furrow is seen along about this share of its length: its ends are too faint. By so much closer they follow.
SEEN = 0.6
#: Cosine of the angle between the two families of furrows.
SLANT = 0.4


class Wrinkles(Pattern):
    """Furrows about parallel to a direction, which wander, merge and end; a second family across them if wanted.

    They fade out where the surface faces along the direction, because it has no such direction there.
    """

    spacing: float = Field(default=0.6, ge=0.01, le=1000, description="mean distance between neighboring furrows, mm")
    length: float = Field(
        default=5.0, ge=0.01, le=10000, description="length of a furrow, mm, 2 to 30 times the spacing"
    )
    width: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="width of a furrow, mm, at most twice the spacing; left out: a third",
    )
    direction: marks.Direction = Field(
        default=(1.0, 0.0, 0.0), description="along which the furrows run, in the space of the mesh"
    )
    wander: Unit = Field(
        default=0.2, description="how far a furrow turns and bends aside, relative to half its length: 0 straight"
    )
    variation: Unit = Field(default=0.7, description="how much shallower some are: 0 equal, 1 down to nothing")
    cross: Unit = Field(
        default=0.0,
        description="strength of a second family across the first, as in the rhombs of skin; 0: none",
    )

    @model_validator(mode="after")
    def _fits(self) -> Wrinkles:
        if not 2 * self.spacing <= self.length <= 30 * self.spacing:
            raise ValueError(
                f"length is {self.length:g} mm where spacing is {self.spacing:g} mm; it must be 2 to 30 times that: "
                f"choose a length from {2 * self.spacing:g} to {30 * self.spacing:g} mm"
            )
        if self.width is not None and self.width > 2 * self.spacing:
            raise ValueError(
                f"width is {self.width:g} mm, more than twice the spacing, {self.spacing:g} mm; "
                "lower width or raise spacing"
            )
        return self

    def size(self) -> float:
        return self.spacing

    def finest(self) -> float:
        return marks.FINEST * math.sqrt(SEEN * self.spacing * self.length)

    def grain(self) -> float:
        return math.sqrt(SEEN * self.spacing * self.length)

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(math.sqrt(SEEN * self.spacing * self.length))
        return {
            "cell": cell,
            "period": period,
            "radius": 0.5 * (self.spacing / 3 if self.width is None else self.width) / cell,
            "reach": 0.5 * self.length / cell,
            "direction": marks.unit(self.direction),
            "slant": SLANT,
            "wander": self.wander,
            "variation": self.variation,
            "cross": self.cross,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        normal, direction = site["normal"], np.array(values["direction"])
        texel = site["footprint"] / values["cell"]
        axis = marks.along_surface(direction, normal)
        untouched = _untouched(values, site, axis, texel, values["seed"])
        if values["cross"] > 0:
            slant = values["slant"]
            other = slant * axis + np.sqrt(1 - slant**2) * np.cross(normal, axis)
            crossed = _untouched(values, site, other, texel, ~values["seed"])
            untouched = untouched * (1 + values["cross"] * (crossed - 1))
        return _lies(values, site) * (1 - untouched)

    @classmethod
    def local(cls, values: Mapping[str, Any], site: Site) -> Array:
        return _lies(values, site)


def _lies(values: Mapping[str, Any], site: Site) -> Array:
    """Return (n,): 0 where the surface faces along the direction, so that this is none of it."""
    facing = site["normal"] @ np.array(values["direction"])
    return hashing.smoothstep(0.01, 0.16, 1 - facing**2)


def _untouched(values: Mapping[str, Any], site: Site, axis: Array, texel: Array, seed: int) -> Array:
    """Return (n,): what one family of furrows leaves."""
    normal, radius, reach, wander = site["normal"], values["radius"], values["reach"], values["wander"]
    side = np.cross(normal, axis)
    wide2, long2 = marks.widened2(radius, texel), marks.widened2(reach, texel)
    found = marks.find_marks(
        site["position"] / values["cell"],
        normal,
        marks.box(normal, axis, side, np.sqrt(long2), np.sqrt(wide2) + wander * reach),
        values["period"],
        1.0,
        seed,
    )
    slant, bend, swing = np.moveaxis(2 * found.more_random()[..., :3] - 1, -1, 0)
    ahead = np.einsum("nmi,ni->nm", found.along, axis)
    u = np.clip(ahead / reach, -1, 1)
    across = np.einsum("nmi,ni->nm", found.along, side)
    across = across + wander * reach * u * (0.4 * slant + u * (0.3 * bend + u * 0.3 * swing))
    bump = marks.bump(ahead**2 / long2[:, None] + across**2 / wide2[:, None])
    strength = (radius * reach / np.sqrt(wide2 * long2))[:, None]
    return np.prod(1 - found.near * strength * (1 - values["variation"] * found.random[..., 3]) * bump, axis=1)
