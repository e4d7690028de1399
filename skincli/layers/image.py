"""Pictures: color, grey and normal maps, laid by uv or projected along the axes."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.color import REC709_LUMA
from skincli.files import PicturePath
from skincli.layers.base import Array, Flat, Own, Pattern, Picture, Ramp, Site, Value


class Role(IntEnum):
    """What the numbers of the picture mean."""

    COLOR = 0
    GREY = 1
    NORMAL_GL = 2
    NORMAL_DX = 3


class Tile(IntEnum):
    """What lies beyond the edge of the picture."""

    CLAMP = 0
    REPEAT = 1
    MIRROR = 2


class Projection(IntEnum):
    """How the picture is laid on the surface."""

    UV = 0
    POSITION = 1


class Image(Pattern):
    """A picture as a layer. Its grey value is a pattern; its color may be written as it is; a normal map tilts."""

    kernel: ClassVar[Literal["vec4"]] = "vec4"

    file: PicturePath = Field(description="png, jpg, tif, exr or hdr file, relative to the file that names it")
    role: Literal["color", "grey", "normal_gl", "normal_dx"] = Field(
        "color", description="color; grey: plain numbers; normal_gl, normal_dx: tangent-space normals, y up or y down"
    )
    tile: Literal["clamp", "repeat", "mirror"] = Field(
        default="repeat", description="what lies beyond the edge of the picture"
    )
    tile_size: float | None = Field(
        default=None,
        ge=0.01,
        le=100000,
        description="side of the picture on the surface, mm; left out: it is laid by uv",
    )
    tiles: float | None = Field(
        default=None, ge=0.001, le=10000, description="how often the picture fits along the uv square, 1 if left out"
    )
    into: Annotated[tuple[Literal["albedo", "reflectance"], ...], Field(strict=False)] | None = Field(
        default=None,
        description="channels that receive the picture's own color or grey value; left out: albedo, where no pair "
        "(albedo, height, reflectance) is given",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Image:
        if self.tile_size is not None and self.tiles is not None:
            raise ValueError("tile_size (mm) and tiles (per uv square) are both given; write one of them")
        pairs = set(super().channels())
        if self.role.startswith("normal"):
            if self.tile_size is not None:
                raise ValueError("a normal map follows the uv; write tiles in place of tile_size")
            if pairs or self.into is not None:
                raise ValueError(
                    f"a normal map only tilts the surface; remove {', '.join(sorted(pairs)) or 'into'}, "
                    "or choose the role color or grey"
                )
        elif both := pairs & set(self.into or ()):
            raise ValueError(f"{', '.join(sorted(both))} is in `into` and has a pair of values; write one of them")
        return self

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        if self.role.startswith("normal"):
            return {"slope": Own()}
        pairs = super().channels()
        into = self.into if self.into is not None else () if pairs else ("albedo",)
        return pairs | {channel: Own() for channel in into}

    def on_surface(self) -> bool:
        return self.tile_size is not None or (self.mask is not None and self.mask.on_surface())

    def unread_in_mask(self) -> set[str]:
        return super().unread_in_mask() | {"into"}

    def values(self, seed: int) -> dict[str, Value]:
        return {
            "role": Role[self.role.upper()],
            "tile": Tile[self.tile.upper()],
            "projection": Projection.UV if self.tile_size is None else Projection.POSITION,
            # The grey value of a color is its luminance; a grey picture has one channel.
            "grey": tuple(map(float, REC709_LUMA)) if self.role == "color" else (1.0, 0.0, 0.0),
            "period": self.tile_size if self.tile_size is not None else 1 / (self.tiles or 1.0),
        }

    def picture(self) -> Picture:
        role: Literal["color", "grey", "normal"] = "normal" if self.role.startswith("normal") else self.role  # type: ignore[assignment]
        return Picture(self.file, role, self.tile == "repeat")

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, picture: Array | None) -> Array:
        assert picture is not None
        period = values["period"]
        if values["projection"] == Projection.UV:
            return _sample(values, site["uv"] / period, site["footprint_uv"] / period, picture)
        tile, texel = site["position"] / period, site["footprint"] / period
        weight = site["normal"] ** 4
        weight = weight / np.maximum(weight.sum(axis=-1, keepdims=True), 1e-6)
        planes = ((1, 2), (2, 0), (0, 1))
        samples = (_sample(values, tile[:, list(plane)], texel, picture) for plane in planes)
        return np.sum([weight[:, i, None] * sample for i, sample in enumerate(samples)], axis=0)


def _sample(values: Mapping[str, Any], tile: Array, texel: Array, picture: Array) -> Array:
    """Twin of `image_sample` in shaders/layers/image.glsl: (n, 4)."""
    folded = 1 - np.abs(np.mod(tile, 2) - 1) if values["tile"] == Tile.MIRROR else tile
    levels = _pyramid(picture)
    level = np.clip(np.log2(np.maximum(texel * max(picture.shape[:2]), 1)), 0, len(levels) - 1)
    lower, part = np.floor(level).astype(int), level - np.floor(level)
    color = np.zeros((len(tile), 3))
    for index, array in enumerate(levels):
        share = np.where(lower == index, 1 - part, 0) + np.where(lower + 1 == index, part, 0)
        if share.any():
            color += share[:, None] * _bilinear(array, folded, values["tile"] == Tile.REPEAT)
    if values["role"] == Role.COLOR:
        return np.column_stack([color, color @ np.array(values["grey"])])
    if values["role"] == Role.GREY:
        return np.repeat(color[:, :1], 4, axis=1)
    normal = 2 * color - 1
    slope = -normal[:, :2] / np.maximum(normal[:, 2:], 0.05)
    if values["role"] == Role.NORMAL_DX:
        slope *= np.array([1, -1])
    if values["tile"] == Tile.MIRROR:
        slope *= 1 - 2 * (np.mod(tile, 2) >= 1)
    return np.column_stack([slope, np.zeros_like(slope)])


def _pyramid(picture: Array) -> list[Array]:
    """Return the levels of detail that a driver makes of a picture whose sides are powers of two: 2x2 means."""
    levels = [picture if picture.shape[2] == 3 else np.repeat(picture[..., :1], 3, axis=2)]
    while max(levels[-1].shape[:2]) > 1 and all(side == 1 or side % 2 == 0 for side in levels[-1].shape[:2]):
        height, width = levels[-1].shape[:2]
        rows, columns = max(height // 2, 1), max(width // 2, 1)
        levels.append(levels[-1].reshape(rows, height // rows, columns, width // columns, 3).mean(axis=(1, 3)))
    return levels


def _bilinear(array: Array, uv: Array, repeat: bool) -> Array:
    """Return (n, 3) samples; v runs upwards from the last row."""
    height, width = array.shape[:2]
    x, y = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    right, down = (x - column)[:, None], (y - row)[:, None]

    def at(row: Array, column: Array) -> Array:
        if repeat:
            return array[row % height, column % width]
        return array[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]

    top = (1 - right) * at(row, column) + right * at(row, column + 1)
    bottom = (1 - right) * at(row + 1, column) + right * at(row + 1, column + 1)
    return (1 - down) * top + down * bottom
