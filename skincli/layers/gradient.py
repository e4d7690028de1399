"""A gradient: along an axis of the object, by the height of what lies below, or by the slope of the surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers.base import Array, Ground, Pattern, Site, Value
from skincli.layers.filtering import EDGE_PER_TEXEL


class By(IntEnum):
    """What the gradient follows."""

    AXIS = 0
    HEIGHT = 1
    SLOPE = 2


class Shape(IntEnum):
    """How it runs from 0 to 1."""

    LINEAR = 0
    SMOOTH = 1


#: Texels that are smaller, in halves of the way from 0 to 1, see a line and not its ends: differences lose digits.
WIDE = 0.02

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


class Gradient(Pattern):
    """0 at `start`, 1 at `end`: along an axis, by the height of the layers below, or by the slope of the surface."""

    reads: ClassVar[frozenset[str]] = frozenset({"height"})

    by: Literal["x", "y", "z", "height", "slope"] = Field(
        default="y",
        description="x, y, z: the place along an axis of the mesh, mm; height: the sum of the heights of the layers "
        "below, mm; slope: the angle between the surface and an axis, degrees",
    )
    start: float = Field(
        default=0.0, ge=-100000, le=100000, description="where it is 0, mm or degrees; may be larger than end"
    )
    end: float = Field(default=100.0, ge=-100000, le=100000, description="where it is 1, mm or degrees")
    axis: Literal["x", "y", "z", "-x", "-y", "-z"] = Field(
        default="y", description="slope: the axis from which the direction of the surface is measured, 0 to 180 degrees"
    )
    shape: Literal["linear", "smooth"] = Field(default="smooth", description="how it runs from 0 to 1")

    @model_validator(mode="after")
    def _runs(self) -> Gradient:
        if self.start == self.end:
            raise ValueError(f"start and end are both {self.start:g}; a gradient needs two different values")
        if self.by == "slope" and not (0 <= self.start <= 180 and 0 <= self.end <= 180):
            raise ValueError(
                f"a slope runs from 0 to 180 degrees; found {self.start:g} to {self.end:g}; change start or end"
            )
        if self.by in ("height", "slope") and (self.warp > 0 or self.warp_scale is not None):
            raise ValueError(f"a gradient by {self.by} does not follow the position, which warp moves; remove warp")
        return self

    def reads_of(self) -> frozenset[str]:
        masks = frozenset() if self.mask is None else self.mask.reads_of()
        return masks | (self.reads if self.by == "height" else frozenset())

    def size(self) -> float:
        return abs(self.end - self.start)

    def values(self, ground: Ground) -> dict[str, Value]:
        letter = self.axis[-1] if self.by == "slope" else self.by
        sign = -1.0 if self.by == "slope" and self.axis.startswith("-") else 1.0
        return {
            "by": By[self.by.upper()] if self.by in ("height", "slope") else By.AXIS,
            "shape": Shape[self.shape.upper()],
            "axis": tuple(sign * number for number in AXES.get(letter, (0.0, 0.0, 0.0))),
            "middle": (self.start + self.end) / 2,
            "reach": abs(self.end - self.start) / 2,
            "sense": 0.5 if self.end > self.start else -0.5,
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        axis, normal = np.array(values["axis"]), site["normal"]
        across = np.linalg.norm(np.cross(normal, axis), axis=-1)
        texel = np.zeros(len(across))
        if values["by"] == By.HEIGHT:
            place = site["height"]
        elif values["by"] == By.AXIS:
            place, texel = site["position"] @ axis, site["footprint"] * across
        else:
            # By the arc tangent, which is exact at every angle, as an arc cosine is not.
            place = np.degrees(np.arctan2(across, normal @ axis))
        away = 2 * values["sense"] * (place - values["middle"])
        if values["shape"] == Shape.SMOOTH:
            t = np.clip(0.5 + 0.5 * away / np.hypot(values["reach"], EDGE_PER_TEXEL * texel), 0, 1)
            return t * t * (3 - 2 * t)
        wide = texel / values["reach"]
        x = np.clip(away / values["reach"], -1 - 0.5 * wide, 1 + 0.5 * wide)
        mean = (_integral(x + 0.5 * wide) - _integral(x - 0.5 * wide)) / np.maximum(wide, WIDE)
        return np.where(wide < WIDE, np.clip(0.5 + 0.5 * x, 0, 1), mean)


def _integral(x: Array) -> Array:
    """Return the integral of a line that runs from 0 at -1 to 1 at 1."""
    return 0.25 * (np.clip(x, -1, 1) + 1) ** 2 + np.maximum(x - 1, 0)
