"""Pictures: color, data, grey and normal maps, laid by uv or projected along the axes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from skincli.color import REC709_LUMA
from skincli.files import PicturePath, file_digest
from skincli.layers import hashing, histogram, remap
from skincli.layers.base import Array, Flat, Ground, Own, Pattern, Ramp, Site, Texture, Value, joint_seed
from skincli.layers.filtering import places_in_texel, places_of

#: Distance of the corners of a patch, in pictures: a patch spans about a third of the picture [Heitz2018].
PATCH = 1 / (2 * math.sqrt(3))
#: What is nearer to a texel's center than this share of the distance to the next, is there: float32 coordinates among
#: 16384 texels are not more exact, and so a map's texels that lie on the picture's become these, to the bit.
SNAP = 1 / 256
#: Texels of the picture that are averaged for one of the map, along a side; for more, a coarser level of detail is.
WIDEST = 8.0
#: Likewise for each place of a texel for which a picture is synthesized, and places along its side, at most.
WIDEST_PLACE = 2.0
PLACES = 4


class Role(IntEnum):
    """What the numbers of the picture mean."""

    COLOR = 0
    DATA = 1
    GREY = 2
    NORMAL_GL = 3
    NORMAL_DX = 4


class Tile(IntEnum):
    """What lies beyond the edge of the picture."""

    CLAMP = 0
    REPEAT = 1
    MIRROR = 2
    HISTOGRAM_PRESERVING = 3


class Projection(IntEnum):
    """How the picture is laid on the surface."""

    UV = 0
    POSITION = 1


#: How a file is read: color is decoded to linear Rec.709; of data, grey and normals the numbers are taken as they are.
Reading = Literal["color", "data", "grey", "normal"]


def _format(reading: Reading) -> str:
    # Heights in mm need more than halves; the maps that colors go into hold no more.
    return {"color": "rgba16f", "grey": "r32f"}.get(reading, "rgba32f")


@dataclass(frozen=True)
class Picture(Texture):
    """An image file that a layer samples.

    Parameters
    ----------
    file : the image
    reading : how it is read
    """

    file: Path
    reading: Reading

    @property
    def format(self) -> str:  # type: ignore[override]
        return _format(self.reading)

    @property
    def key(self) -> str:
        return f"{file_digest(self.file)} {self.reading}"

    def make(self) -> NDArray[np.float32]:
        from skincli import images  # here, for OpenImageIO takes its time to load

        if self.reading == "color":
            found = images.read_color(self.file)
        elif self.reading == "grey":
            found = images.read_data(self.file, 1)
        else:
            found = images.read_data(self.file, 4, spread=self.reading == "data")
        # What a half cannot hold would become infinite in the maps.
        return np.clip(found, -images.HALF_MAX, images.HALF_MAX)


@dataclass(frozen=True)
class Curved(Texture):
    """A grey picture that is remapped, so that means over it are means of what the curve makes of it.

    Parameters
    ----------
    picture : the picture
    range : what 0 and 1 in it mean
    curve : control points
    """

    picture: Picture
    range: tuple[float, ...]
    curve: remap.Points

    @property
    def format(self) -> str:  # type: ignore[override]
        return self.picture.format

    @property
    def key(self) -> str:
        return f"{self.picture.key} {self.range} {self.curve}"

    def make(self) -> NDArray[np.float32]:
        low, high = self.range
        t = low + (high - low) * self.picture.make().astype(np.float64)
        return remap.remap(self.curve, t).astype(np.float32)


@dataclass(frozen=True)
class Prepared(Texture):
    """What `skincli.layers.histogram` makes of a picture.

    Parameters
    ----------
    picture : the picture, as it is or remapped
    part : Gaussian values, or the table that leads from these to the picture's own
    """

    picture: Picture | Curved
    part: Literal["gaussian", "table"]

    @property
    def format(self) -> str:  # type: ignore[override]
        return self.picture.format if self.part == "gaussian" else "rgba32f"

    @property
    def key(self) -> str:
        return f"{self.picture.key} {self.part}"

    def make(self) -> NDArray[np.float32]:
        # The rows of the table are counted from its first, which the shader finds at the bottom.
        array = histogram.kept(self.picture.key, self.picture.make)[self.part]
        return array[::-1] if self.part == "table" else array


class Image(Pattern):
    """A picture as a layer. Its grey value is a pattern; its color may be written as it is; a normal map tilts."""

    kernel: ClassVar[Literal["vec4"]] = "vec4"

    file: PicturePath = Field(
        description="any picture that OpenImageIO reads: png, jpg, tif, exr, hdr, ...; relative to the file that "
        "names it"
    )
    role: Literal["color", "data", "grey", "normal_gl", "normal_dx"] = Field(
        "color",
        description="what its numbers are, whatever the file is tagged as. color: sRGB in integer files, linear in "
        "float files; data: three plain numbers; grey: one plain number; normal_gl, normal_dx: tangent-space normals, "
        "y up or y down",
    )
    channel: Literal["luminance", "red", "green", "blue", "alpha"] = Field(
        default="luminance", description="role color or data: what the pattern, 0 to 1, is taken from"
    )
    range: Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=2)] = Field(
        default=(0.0, 1.0), description="role data or grey: the values that stored 0 and 1 (black and white) mean"
    )
    tile: Literal["clamp", "repeat", "mirror", "histogram_preserving", "triplanar"] = Field(
        default="repeat",
        description="what lies beyond the edge of the picture. histogram_preserving: random patches of it, joined "
        "without a seam and without repeating, so that the whole has the colors of the picture; for pictures that "
        "look alike everywhere. triplanar: repeat, and needs tile_size",
    )
    tile_size: float | None = Field(
        default=None,
        ge=0.01,
        le=100000,
        description="side of the picture on the surface, mm, projected along the three axes and mixed by the "
        "surface's direction, whatever `tile` is; left out: it is laid by uv",
    )
    tiles: float | None = Field(
        default=None,
        ge=0.001,
        le=10000,
        description="how often the picture fits along the uv square, 1 if left out; where the map is tileable, this "
        "and tile_size are fitted so that what repeats or is mirrored does so a whole number of times",
    )
    into: (
        Annotated[
            tuple[Literal["albedo", "reflectance", "roughness", "specular", "scattering_radius"], ...],
            Field(strict=False),
        ]
        | None
    ) = Field(
        default=None,
        description="channels that receive the picture's own values: its colors or, where a channel is one number, its "
        "pattern; left out: albedo, unless the role is data or a pair is given, such as height",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Image:
        if self.tile_size is not None and self.tiles is not None:
            raise ValueError("tile_size (mm) and tiles (per uv square) are both given; write one of them")
        if self.tile == "triplanar" and self.tile_size is None:
            raise ValueError("tile: triplanar lays the picture in mm; add tile_size, the side of the picture in mm")
        if self.warp > 0 and self.tile_size is None:
            raise ValueError("warp moves what is laid in mm; write tile_size in place of tiles, or remove warp")
        if self.range != (0.0, 1.0) and self.role not in ("data", "grey"):
            raise ValueError(f"range is for the roles data and grey, and the role is {self.role}; remove one of them")
        if self.channel != "luminance" and self.role not in ("color", "data"):
            raise ValueError(
                f"channel: {self.channel} is for the roles color and data, and the role is {self.role}; choose the "
                "role data, or remove channel"
            )
        pairs = set(super().channels())
        if self.role.startswith("normal"):
            if self.tile_size is not None:
                raise ValueError("a normal map follows the uv; write tiles in place of tile_size")
            if pairs or self.into is not None:
                raise ValueError(
                    f"a normal map only tilts the surface; remove {', '.join(sorted(pairs)) or 'into'}, "
                    "or choose the role color, data or grey"
                )
        elif both := pairs & set(self.into or ()):
            raise ValueError(f"{', '.join(sorted(both))} is in `into` and has a pair of values; write one of them")
        return self

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        if self.role.startswith("normal"):
            return {"slope": Own()}
        pairs = super().channels()
        into = self.into if self.into is not None else () if pairs or self.role == "data" else ("albedo",)
        return pairs | {channel: Own() for channel in into}

    def on_surface(self) -> bool:
        return self.tile_size is not None or (self.mask is not None and self.mask.on_surface())

    def unread_in_mask(self) -> set[str]:
        return super().unread_in_mask() | {"into"}

    def size(self) -> float:
        return self.tile_size or 10.0

    def curve_is_in_texture(self) -> bool:
        return self.curve is not None and self.role == "grey"

    def values(self, ground: Ground) -> dict[str, Value]:
        # The period of a tileable map, in mm or in squares of uv, as the picture is laid.
        whole = None if ground.period is None else 1.0 if self.tile_size is None else ground.period
        endless = Ground(period=whole)
        tile = Tile.REPEAT if self.tile == "triplanar" else Tile[self.tile.upper()]
        period = self.tile_size if self.tile_size is not None else 1 / (self.tiles or 1.0)
        step, cells, seed = 1.0, 0, 0
        if tile == Tile.REPEAT:
            period, _ = endless.fit(period)
        elif tile == Tile.MIRROR:
            period = endless.fit(2 * period)[0] / 2
        elif tile == Tile.HISTOGRAM_PRESERVING:
            # Every other row of corners is moved by half a step, so that a period has an even number.
            pair, pairs = endless.fit(2 * PATCH * period)
            step, cells, seed = pair / (2 * period), 2 * pairs, joint_seed(ground.seed, self.seed)
        weights = {"red": (1, 0, 0, 0), "green": (0, 1, 0, 0), "blue": (0, 0, 1, 0), "alpha": (0, 0, 0, 1)}
        luma = (*map(float, REC709_LUMA), 0.0)
        grey = (1, 0, 0, 0) if self.role == "grey" else weights.get(self.channel, luma)
        return {
            "role": Role[self.role.upper()],
            "tile": tile,
            "projection": Projection.UV if self.tile_size is None else Projection.POSITION,
            "grey": tuple(map(float, grey)),
            "range": (0.0, 1.0) if self.curve_is_in_texture() else self.range,
            "period": period,
            "step": step,
            "cells": cells,
            "seed": seed,
        }

    def textures(self, ground: Ground) -> tuple[Texture, ...]:
        reading: Reading = "normal" if self.role in ("normal_gl", "normal_dx") else self.role  # type: ignore[assignment]
        # The shader reads single texels and looks itself for what lies beyond the edge.
        read = Picture(False, self.file, reading)
        picture: Picture | Curved = read
        if self.curve is not None and self.curve_is_in_texture():
            picture = Curved(False, read, self.range, self.curve)
        if self.tile != "histogram_preserving":
            return (picture,)
        return Prepared(False, picture, "gaussian"), Prepared(False, picture, "table")

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        if values["projection"] == Projection.UV:
            # What is laid by uv lies on a flat square.
            position = np.pad(site["uv"], ((0, 0), (0, 1)))
            normal = np.broadcast_to([0.0, 0.0, 1.0], position.shape)
            site = {**site, "position": position, "normal": normal, "footprint": site["footprint_uv"]}
        levels = histogram.levels_of(textures[0])
        if values["tile"] == Tile.HISTOGRAM_PRESERVING:
            return _value(values, _synthesize(values, site, levels, textures[1][::-1]))
        texel = site["footprint"] / values["period"]
        planes = _planes(site["position"] / values["period"])
        facing = _facing(site["normal"])
        samples = [
            share[:, None] * _plane(values, tile, texel, levels) for tile, share in zip(planes, facing, strict=True)
        ]
        return np.sum(samples, axis=0)


def _planes(tile: Array) -> list[Array]:
    """Return the place in the picture in the projections along x, y and z."""
    return [tile[:, [1, 2]], tile[:, [2, 0]], tile[:, [0, 1]]]


def _facing(normal: Array) -> Array:
    """Twin of `image_facing`: (3, n)."""
    weight = normal.T**4
    return weight / np.maximum(weight.sum(axis=0), 1e-6)


def _mean(tiling: Tile, tile: Array, texel: Array, levels: Sequence[Array], widest: float) -> Array:
    """Twin of `image_mean`: (n, 4), v upwards."""
    result = np.zeros((len(tile), 4))
    wide = np.maximum(texel * max(levels[0].shape[:2]) * (1.001 * 2 / widest), 1)
    chosen = np.minimum(np.frexp(wide)[1] - 1, len(levels) - 1)
    if tiling == Tile.CLAMP:
        inside = np.clip(tile, -1, 2)
    elif tiling == Tile.MIRROR:
        inside = 1 - np.abs(np.mod(tile, 2) - 1)
    else:
        inside = tile - np.floor(tile)
    for level in np.unique(chosen):
        at = np.flatnonzero(chosen == level)
        array = levels[level]
        channels = array.shape[2]
        size = np.array(array.shape[1::-1])
        width = np.clip(texel[at, None] * size - SNAP, 1, size)
        corner, fraction = hashing.split(inside[at] * size - 0.5 * width)
        low = np.clip((fraction - SNAP) / (1 - 2 * SNAP), 0, 1)
        high = low + width
        columns, rows = np.ceil(high.max(axis=0)).astype(int)
        total = np.zeros((len(at), channels))
        for y in range(rows):
            for x in range(columns):
                share = np.prod(np.maximum(np.minimum([x + 1, y + 1], high) - np.maximum([x, y], low), 0), axis=1)
                column, row = _index(corner + np.array([x, y]), size, tiling).T
                total += share[:, None] * array[size[1] - 1 - row, column]
        result[at, :channels] = total / np.prod(width, axis=1)[:, None]
    return result


def _index(at: NDArray[np.integer], size: NDArray[np.integer], tiling: Tile) -> NDArray[np.integer]:
    if tiling == Tile.CLAMP:
        return np.clip(at, 0, size - 1)
    if tiling == Tile.MIRROR:
        second = np.mod(at, 2 * size)
        return np.minimum(second, 2 * size - 1 - second)
    return np.mod(at, size)


def _value(values: Mapping[str, Any], color: Array) -> Array:
    """Twin of `image_value`: (n, 4)."""
    if values["role"] in (Role.NORMAL_GL, Role.NORMAL_DX):
        normal = 2 * color[:, :3] - 1
        slope = -normal[:, :2] / np.maximum(normal[:, 2:], 0.05)
        if values["role"] == Role.NORMAL_DX:
            slope = slope * np.array([1, -1])
        return np.column_stack([slope, np.zeros_like(slope)])
    low, high = values["range"]
    color = low * (1 - color) + high * color
    grey = color @ np.array(values["grey"])
    return np.column_stack([color[:, :3], grey]) if values["role"] != Role.GREY else np.repeat(grey[:, None], 4, axis=1)


def _plane(values: Mapping[str, Any], tile: Array, texel: Array, levels: Sequence[Array]) -> Array:
    """Twin of `image_plane`: (n, 4)."""
    value = _value(values, _mean(values["tile"], tile, texel, levels, WIDEST))
    if values["tile"] == Tile.MIRROR and values["role"] in (Role.NORMAL_GL, Role.NORMAL_DX):
        value[:, :2] *= 1 - 2 * (np.mod(tile, 2) >= 1)
    return value


def _synthesize(values: Mapping[str, Any], site: Site, levels: Sequence[Array], table: Array) -> Array:
    """Return (n, 4) the mean over each texel of what is synthesized, in the picture's own values."""
    along = np.empty((len(site["footprint"]), 4))
    period, side = values["period"], max(levels[0].shape[:2])
    counts = np.minimum(places_of(site["footprint"], period / side), PLACES)
    for count in np.unique(counts):
        chosen = counts == count
        position, normal, footprint = (site[key][chosen] for key in ("position", "normal", "footprint"))
        texel = footprint / (period * count)
        level = np.clip(np.log2(np.maximum(texel * side, 1)), 0, len(levels) - 1)
        left = hashing.resolved(values["step"], texel)
        facing = _facing(normal)
        found = []
        for step in places_in_texel(normal, footprint, count):
            planes = _planes((position + step) / period)
            total, power = np.zeros((len(texel), 4)), np.zeros(len(texel))
            for plane, (tile, share) in enumerate(zip(planes, facing, strict=True)):
                for weight, place in _patches(values, tile, plane):
                    weight = share * weight
                    total += weight[:, None] * _mean(values["tile"], place, texel, levels, WIDEST_PLACE)
                    power += weight**2
            total *= (left / np.sqrt(np.maximum(power, 1e-12)))[:, None]
            found.append(_restore(total, level, table))
        along[chosen] = np.mean(found, axis=0)
    axes, (lowest, highest) = table[-6:-2, 0], table[-2:, 0]
    return np.clip(along @ axes, lowest, highest)


def _patches(values: Mapping[str, Any], tile: Array, plane: int) -> Iterator[tuple[Array, Array]]:
    """Twin of `image_patches`: three times the weight, (n,), and the place in the picture, (n, 2)."""
    x = tile / values["step"]
    cell, fraction = hashing.split(np.column_stack([x[:, 0] - 0.5 * x[:, 1], x[:, 1]]))
    far = fraction.sum(axis=1, keepdims=True) > 1
    near = np.where(far, 1 - fraction, fraction)
    weights = (1 - near.sum(axis=1), near[:, 0], near[:, 1])
    for weight, offset in zip(weights, ([0, 0], [1, 0], [0, 1]), strict=True):
        corner = np.where(far, 1 - np.array(offset), offset)
        row = cell[:, 1] + corner[:, 1]
        column = cell[:, 0] + corner[:, 0] + row // 2
        key = hashing.wrap_cell(np.column_stack([column, row, np.full(len(row), plane)]), values["cells"])
        away = fraction - corner
        place = values["step"] * np.column_stack([away[:, 0] + 0.5 * away[:, 1], away[:, 1]])
        yield weight**2, place + hashing.hash_cell(key, values["seed"])[:, :2]


def _restore(gaussian: Array, level: Array, table: Array) -> Array:
    """Twin of `image_restore`: (n, 4)."""
    entries = table.shape[1]
    left, right = hashing.split(np.clip(gaussian + 0.5, 0, 1) * (entries - 1))
    lower, part = hashing.split(level)
    along = np.zeros_like(gaussian)
    for row, share in ((lower, 1 - part), (lower + (part > 0), part)):
        for entry, weight in ((left, 1 - right), (np.minimum(left + 1, entries - 1), right)):
            along += share[:, None] * weight * table[row[:, None], entry, np.arange(4)]
    return along
