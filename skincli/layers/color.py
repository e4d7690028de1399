"""One value everywhere."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from skincli.layers.base import RAMPS, Flat, Height, Own, RadiusRgb, Ramp, Rgb, Unit, Writing
from skincli.layers.pigments import PigmentAmounts


class Color(Writing):
    """One value everywhere: the ground coat, a tint, or, through a mask, a spot."""

    kernel: ClassVar[None] = None

    albedo: Rgb | None = Field(default=None, description="color, linear Rec.709, 0 to 1")
    height: Height | None = Field(default=None, description="height, mm, added to those below")
    reflectance: Unit | None = Field(default=None, description="reflectance factor, 0 to 1")
    roughness: Unit | None = Field(default=None, description="roughness, 0 to 1")
    specular: Unit | None = Field(default=None, description="factor of the highlights, 0 to 1")
    scattering_radius: RadiusRgb | None = Field(
        default=None, description="scattering radius, mm; see optics.radius_kind"
    )
    pigments: PigmentAmounts | None = Field(default=None, description="amounts of pigment, added to those below")

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        values = {channel: getattr(self, channel) for channel in RAMPS}
        values |= {} if self.pigments is None else self.pigments.pairs()
        return {channel: Flat(value) for channel, value in values.items() if value is not None}
