"""A region of the uv square: a rectangle or an ellipse with a soft border, mostly as a mask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from skincli.layers.base import Array, Ground, Site, Value
from skincli.layers.filtering import disk_of, soft_step
from skincli.layers.still import Still

Coordinate = Annotated[float, Field(ge=-100, le=100)]
Extent = Annotated[float, Field(gt=0, le=100)]


class Shape(IntEnum):
    """What the region is."""

    RECTANGLE = 0
    ELLIPSE = 1


class UvRegion(Still):
    """1 inside a rectangle or ellipse of the authored uv, 0 outside: a mask for parts of a mesh."""

    center: Annotated[tuple[Coordinate, ...], Field(strict=False, min_length=2, max_length=2)] = Field(
        default=(0.5, 0.5), description="middle of the region, uv"
    )
    extent: Annotated[tuple[Extent, ...], Field(strict=False, min_length=2, max_length=2)] = Field(
        default=(0.5, 0.5), description="width and height of the region, uv"
    )
    feather: float = Field(
        default=0.02,
        ge=0,
        le=100,
        description="width of the soft border, half of it inside, uv; at most the mean size of an ellipse",
    )
    shape: Literal["rectangle", "ellipse"] = Field(default="rectangle", description="outline of the region")

    def on_surface(self) -> bool:
        return self.mask is not None and self.mask.on_surface()

    def values(self, ground: Ground) -> dict[str, Value]:
        return {
            "shape": Shape[self.shape.upper()],
            "center": self.center,
            "reach": tuple(side / 2 for side in self.extent),
            "feather": self.feather / 2,
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        away, reach = site["uv"] - np.array(values["center"]), np.array(values["reach"])
        texel, feather = site["footprint_uv"][:, None], values["feather"]
        if values["shape"] == Shape.RECTANGLE:
            # The difference of two steps, so that what is narrower than a texel keeps its share of it.
            return np.prod(soft_step(away + reach, feather, texel) - soft_step(away - reach, feather, texel), axis=1)
        # Distance to the border, by the slope of the radius, which has none in the middle; as of a disk of equal area.
        scaled = away / reach
        radius = np.sqrt(np.sum(scaled**2, axis=1))
        inside = (1 - radius) * radius / np.maximum(np.sqrt(np.sum((scaled / reach) ** 2, axis=1)), 1e-6)
        inside = np.where(radius < 1e-3, reach.min(), inside)
        mean = np.sqrt(np.prod(reach))
        return disk_of(mean, min(feather, mean), texel[:, 0]).at(mean - inside)
