"""One value everywhere."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from skincli.layers.base import Flat, Height, Layer, Own, Ramp, Rgb, Unit
from skincli.layers.blend import Blend


class Color(Layer):
    """One value everywhere: the ground coat, a tint, or, through a mask, a spot."""

    kernel: ClassVar[None] = None

    albedo: Rgb | None = Field(default=None, description="color, linear Rec.709, 0 to 1")
    height: Height | None = Field(default=None, description="height, mm, added to those below")
    reflectance: Unit | None = Field(default=None, description="reflectance factor, 0 to 1")
    blend: Blend = Field(default="normal", description="how albedo and reflectance join those below, in linear light")

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        values = {"albedo": self.albedo, "height": self.height, "reflectance": self.reflectance}
        return {channel: Flat(value) for channel, value in values.items() if value is not None}

    def blending(self) -> Blend:
        return self.blend
