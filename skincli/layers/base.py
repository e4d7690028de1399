"""What every texture layer of the skin generator has in common, and how layers are written and checked.

A layer is a pure function of a point of the surface, the `Site`. Its settings are a pydantic model; its GLSL is one
function in `shaders/layers/NAME.glsl`, where NAME is the name of its Python file; its `twin` is the same function in
float64. Nothing else lists it: every file of this folder is read, see `skincli.layers`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from skincli.layers import hashing
from skincli.layers.blend import Blend

if TYPE_CHECKING:
    from skincli.layers import MaskLayer  # known only when all layers are: `skincli.layers` fills it in

Array = NDArray[np.float64]

#: A plain value of a shader: a number, 2 to 4 numbers, or a choice, which becomes a constant of the program.
Value = float | int | tuple[float, ...] | IntEnum

Unit = Annotated[float, Field(ge=0, le=1)]
Rgb = Annotated[tuple[Unit, ...], Field(strict=False, min_length=3, max_length=3)]
Height = Annotated[float, Field(ge=-10, le=10)]
AlbedoRamp = Annotated[tuple[Rgb, ...], Field(strict=False, min_length=2, max_length=2)]
HeightRamp = Annotated[tuple[Height, ...], Field(strict=False, min_length=2, max_length=2)]
UnitRamp = Annotated[tuple[Unit, ...], Field(strict=False, min_length=2, max_length=2)]


class Site(TypedDict):
    """The points at which a twin is evaluated; the GLSL struct of the same name in float64.

    Keys
    ----
    position : (n, 3) mm
    normal : (n, 3) unit vectors
    uv : (n, 2) authored coordinates
    footprint : (n,) mm per texel
    footprint_uv : (n,) size of a texel in uv; a shader takes it from the derivatives of uv
    """

    position: Array
    normal: Array
    uv: Array
    footprint: Array
    footprint_uv: Array


@dataclass(frozen=True)
class Flat:
    """A channel receives one value."""

    value: float | tuple[float, ...]


@dataclass(frozen=True)
class Ramp:
    """A channel receives `low` where the pattern is 0, `high` where it is 1, and a mixture between."""

    low: float | tuple[float, ...]
    high: float | tuple[float, ...]


@dataclass(frozen=True)
class Own:
    """A channel receives what the layer's function itself returns: its color, its grey value or its slopes."""


@dataclass(frozen=True)
class Picture:
    """An image file that a layer samples.

    Parameters
    ----------
    file : the image
    role : color (sRGB pictures are decoded to linear Rec.709), grey or normal (numbers are taken as they are)
    repeat : whether the sampler repeats; else it clamps to the edge
    """

    file: Path
    role: Literal["color", "grey", "normal"]
    repeat: bool


class Layer(BaseModel):
    """One layer of a skin: what it writes, where, and how strongly."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    #: GLSL type that `NAME_layer` returns: float (the pattern t, 0 to 1), vec4 (color, and t in w; or the slopes in
    #: xy), or None where the layer needs no shader because every channel is Flat.
    kernel: ClassVar[Literal["float", "vec4"] | None] = "float"

    name: str | None = Field(
        default=None, min_length=1, max_length=64, description="name by which the layer can be reached"
    )
    enabled: bool = Field(default=True, description="false leaves the layer out")
    opacity: Unit = Field(default=1.0, description="how much of the layer shows, 0 to 1")
    mask: MaskLayer | None = Field(
        default=None, description="a pattern, such as {fbm: {scale: 20}}, whose value 0 to 1 multiplies the opacity"
    )

    @classmethod
    def kind(cls) -> str:
        """Name of the layer in YAML: the name of its Python file."""
        return cls.__module__.rpartition(".")[2]

    @abstractmethod
    def channels(self) -> dict[str, Flat | Ramp | Own]:
        """Return what each written channel (a key of `skincli.layers.stack.CHANNELS`) receives."""

    def writes(self) -> set[str]:
        """Names of the channels that the layer writes."""
        return set(self.channels())

    def blending(self) -> Blend:
        """Return how the layer joins albedo and reflectance; heights and slopes are added."""
        return "normal"

    def on_surface(self) -> bool:
        """Whether the layer or its mask asks where on the surface a texel lies; one laid by uv alone does not."""
        return self.kernel is not None or (self.mask is not None and self.mask.on_surface())

    def values(self, seed: int) -> dict[str, Value]:
        """Return the numbers that the layer's function reads, by the names they have in the shader.

        Parameters
        ----------
        seed : the skin's seed, to which the layer's own is added
        """
        return {}

    def picture(self) -> Picture | None:
        """Return the image that the layer samples, if any."""
        return None

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, picture: Array | None) -> Array:
        """Return what the layer's shader returns, in float64.

        Parameters
        ----------
        values : what `values` returned
        site : the points
        picture : (h, w, c) the image, top row first, linear; None for a layer without one

        Returns
        -------
        (n,) for a float kernel, (n, 4) for a vec4 kernel
        """
        raise AssertionError("a layer with a kernel has a twin, and no other is evaluated")

    def unread_in_mask(self) -> set[str]:
        """Names of the keys that mean nothing where the layer serves as a mask."""
        return {"name", "enabled"}


class Pattern(Layer):
    """A layer whose function is a pattern t in 0 to 1, which a pair of values turns into each channel."""

    albedo: AlbedoRamp | None = Field(
        default=None, description="colors where the pattern is 0 and 1, linear Rec.709, 0 to 1"
    )
    height: HeightRamp | None = Field(default=None, description="heights where the pattern is 0 and 1, mm, added up")
    reflectance: UnitRamp | None = Field(
        default=None, description="reflectance factors where the pattern is 0 and 1, 0 to 1"
    )
    blend: Blend = Field(default="normal", description="how albedo and reflectance join those below, in linear light")

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        pairs = {"albedo": self.albedo, "height": self.height, "reflectance": self.reflectance}
        return {channel: Ramp(*pair) for channel, pair in pairs.items() if pair is not None}

    def blending(self) -> Blend:
        return self.blend

    def unread_in_mask(self) -> set[str]:
        return super().unread_in_mask() | {"albedo", "height", "reflectance", "blend"}


Seed = Annotated[int, Field(ge=0, lt=2**31)]
SEED_FIELD: Any = Field(
    default=0, description="added to the skin's seed; equal seeds of a kind of layer give equal patterns"
)

LEVELS_FIELD: Any = Field(
    default=(0.0, 1.0),
    description="values of the raw pattern that become 0 and 1, with a smooth step between; falling order inverts",
)


def joint_seed(skin: int, layer: int) -> int:
    """Return the seed of a layer in a skin: the sum, within the range of a GLSL int."""
    return (skin + layer) % 2**31


def pattern_mean(layer: type[Layer], values: Mapping[str, Value], size: float) -> float:
    """Return the mean of a pattern, to which it fades where the texels are too large to show it.

    The mean of the twin over 8192 fixed points of a large volume, so that it holds for every remapping; its standard
    error is below 0.005. It does not depend on the seed.

    Parameters
    ----------
    layer : the class whose twin is evaluated
    values : what its shader reads, without the mean itself
    size : size of the largest features, mm
    """
    plain = {**values, "seed": 0, "mean": 0.0}
    return _pattern_mean(layer, tuple(plain.items()), size)


@cache
def _pattern_mean(layer: type[Layer], values: tuple[tuple[str, Value], ...], size: float) -> float:
    count = 8192
    random = hashing.hash_cell(np.arange(count)[:, None] * np.array([1, 0, 0]), 0)
    normal = random[:, [3, 0, 1]] - 0.5
    site = Site(
        position=random[:, :3] * 1000 * size,
        normal=normal / np.linalg.norm(normal, axis=1, keepdims=True),
        uv=random[:, :2],
        footprint=np.zeros(count),
        footprint_uv=np.zeros(count),
    )
    return float(np.mean(layer.twin(dict(values), site, None)))
