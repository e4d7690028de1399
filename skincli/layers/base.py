"""What every texture layer of the skin generator has in common, and how layers are written and checked.

A layer is a pure function of a point of the surface, the `Site`. Its settings are a pydantic model; its GLSL is one
function in `shaders/layers/NAME.glsl`, where NAME is the name of its Python file; its `twin` is the same function in
float64. Nothing else lists it: every file of this folder is read, see `skincli.layers`.
"""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, ClassVar, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, model_validator
from pydantic_core import CoreSchema

from skincli.layers.blend import Blend, Space, check_space
from skincli.layers.pigments import PigmentRamps
from skincli.layers.remap import Curve

Array = NDArray[np.float64]

#: A plain value of a shader: a number, 2 to 4 numbers, or a choice, which becomes a constant of the program.
Value = float | int | tuple[float, ...] | IntEnum

Unit = Annotated[float, Field(ge=0, le=1)]
Rgb = Annotated[tuple[Unit, ...], Field(strict=False, min_length=3, max_length=3)]
Height = Annotated[float, Field(ge=-10, le=10)]
AlbedoRamp = Annotated[tuple[Rgb, ...], Field(strict=False, min_length=2, max_length=2)]
Millimetres = Annotated[float, Field(ge=0, le=1000)]
RadiusRgb = Annotated[tuple[Millimetres, ...], Field(strict=False, min_length=3, max_length=3)]
RadiusRamp = Annotated[tuple[RadiusRgb, ...], Field(strict=False, min_length=2, max_length=2)]
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
    footprint_uv : (n,) size of a texel in uv
    height : (n,) mm, the sum of the heights of the layers below
    occlusion : (n,) baked ambient occlusion of the mesh, 1 is open; 1 on a flat square
    curvature : (n,) baked mean curvature of the mesh, 1/mm, positive where convex; 0 on a flat square
    """

    position: Array
    normal: Array
    uv: Array
    footprint: Array
    footprint_uv: Array
    height: Array
    occlusion: Array
    curvature: Array


def site(
    position: Array,
    normal: Array,
    footprint: Array,
    uv: Array | None = None,
    footprint_uv: Array | None = None,
    occlusion: Array | None = None,
    curvature: Array | None = None,
) -> Site:
    """Return a Site; what is left out is that of a flat, undisplaced place at uv 0."""
    count = len(position)
    return Site(
        position=position,
        normal=normal,
        uv=np.zeros((count, 2)) if uv is None else uv,
        footprint=footprint,
        footprint_uv=np.zeros(count) if footprint_uv is None else footprint_uv,
        height=np.zeros(count),
        occlusion=np.ones(count) if occlusion is None else occlusion,
        curvature=np.zeros(count) if curvature is None else curvature,
    )


@dataclass(frozen=True)
class Ground:
    """What the whole skin says to each of its layers.

    Parameters
    ----------
    seed : the skin's seed, to which a layer's own is added
    period : mm after which everything repeats along x and y, on a tileable flat map; None where nothing need repeat
    """

    seed: int = 0
    period: float | None = None

    def fit(self, size: float) -> tuple[float, int]:
        """Return the size of a cell, mm, so adjusted that a whole number fits the period, and that number, else 0."""
        if self.period is None:
            return size, 0
        count = max(1, round(self.period / size))
        return self.period / count, count


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
class Texture(ABC):
    """Something that a layer samples, described; its pixels are made only when they are needed.

    Parameters
    ----------
    repeat : whether the sampler repeats; else it clamps to the edge
    """

    format: ClassVar[str] = "rgba16f"

    repeat: bool

    @property
    @abstractmethod
    def key(self) -> str:
        """Everything the pixels depend on, as text."""

    @abstractmethod
    def make(self) -> Array | NDArray[np.float32]:
        """Return (h, w, c) pixels, c 1 to 4, top row first; the levels of detail are means of these."""


class _AnyLayer:
    """Validates the layer of a mask: one of all layers, which are known only when each has been defined."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return handler.generate_schema(importlib.import_module("skincli.layers").MASKING)


class Layer(BaseModel):
    """One layer of a skin: what it writes, where, and how strongly."""

    # Each layer holds all others, as masks: they are put together once, for the skin, rather than once per layer.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False, defer_build=True)

    #: GLSL type that `NAME_layer` returns: float (the pattern t, 0 to 1), vec4 (color, and t in w; or the slopes in
    #: xy), or None where the layer needs no shader because every channel is Flat.
    kernel: ClassVar[Literal["float", "vec4"] | None] = "float"
    #: what it reads of the Site beside position, normal, uv and footprint: "height", "occlusion", "curvature"
    reads: ClassVar[frozenset[str]] = frozenset()

    name: str | None = Field(
        default=None, min_length=1, max_length=64, description="name by which the layer can be reached"
    )
    enabled: bool = Field(default=True, description="false leaves the layer out")
    opacity: Unit = Field(default=1.0, description="how much of the layer shows, 0 to 1")
    mask: Annotated[Layer, _AnyLayer()] | None = Field(
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

    def on_surface(self) -> bool:
        """Whether the layer or its mask asks where on the surface a texel lies; one laid by uv alone does not."""
        return self.kernel is not None or (self.mask is not None and self.mask.on_surface())

    def reads_of(self) -> frozenset[str]:
        """Return what the layer and its masks read of the site beside position, normal, uv and footprint."""
        return self.reads | (self.mask.reads_of() if self.mask is not None else frozenset())

    def values(self, ground: Ground) -> dict[str, Value]:
        """Return the numbers that the layer's function reads, by the names they have in the shader."""
        return {}

    def textures(self, ground: Ground) -> tuple[Texture, ...]:
        """Return what the layer samples; its function takes a sampler for each, in this order."""
        return ()

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        """Return what the layer's shader returns, in float64.

        Parameters
        ----------
        values : what `values` returned
        site : the points
        textures : (h, w, c) pixels of each of the layer's textures, top row first

        Returns
        -------
        (n,) for a float kernel, (n, 4) for a vec4 kernel
        """
        raise AssertionError("a layer with a kernel has a twin, and no other is evaluated")

    def unread_in_mask(self) -> set[str]:
        """Names of the keys that mean nothing where the layer serves as a mask."""
        return {"name", "enabled"}


Seed = Annotated[int, Field(ge=0, lt=2**31)]


class Writing(Layer):
    """A layer that writes colors and factors, which join those below by a blend mode."""

    blend: Blend = Field(
        default="normal", description="how albedo, reflectance, roughness and specular join those below"
    )
    space: Space = Field(
        default="linear",
        description="what is blended: linear light, or sRGB-encoded values, as picture editors do",
    )
    contrast: float = Field(
        default=0.1,
        gt=0,
        le=10,
        description="height_blend: difference of height over which one layer gives way to the other, mm",
    )

    @model_validator(mode="after")
    def _blends_there(self) -> Writing:
        check_space(self.blend, self.space)
        return self

    def blending(self) -> Blend:
        """Return how the layer joins albedo and factors."""
        return self.blend

    def unread_in_mask(self) -> set[str]:
        return super().unread_in_mask() | {"blend", "space", "contrast"}


class Pattern(Writing):
    """A layer whose function is a pattern t in 0 to 1, which a pair of values turns into each channel."""

    albedo: AlbedoRamp | None = Field(
        default=None, description="colors where the pattern is 0 and 1, linear Rec.709, 0 to 1"
    )
    height: HeightRamp | None = Field(default=None, description="heights where the pattern is 0 and 1, mm, added up")
    reflectance: UnitRamp | None = Field(
        default=None, description="reflectance factors where the pattern is 0 and 1, 0 to 1"
    )
    roughness: UnitRamp | None = Field(default=None, description="roughness where the pattern is 0 and 1, 0 to 1")
    specular: UnitRamp | None = Field(
        default=None, description="factors of the highlights where the pattern is 0 and 1, 0 to 1"
    )
    scattering_radius: RadiusRamp | None = Field(
        default=None, description="scattering radii where the pattern is 0 and 1, mm, mixed; see optics.radius_kind"
    )
    pigments: PigmentRamps | None = Field(
        default=None, description="amounts of pigment where the pattern is 0 and 1, added to those below"
    )
    warp: float = Field(default=0.0, ge=0, le=10000, description="how far the pattern is pulled about, mm")
    warp_scale: float | None = Field(
        default=None,
        ge=0.01,
        le=10000,
        description="size of the swirls by which it is pulled about, mm; left out: that of the pattern",
    )
    curve: Curve | None = Field(
        default=None, description="remaps the pattern: 2 to 8 points [[from, to], ...], both 0 to 1, joined smoothly"
    )
    seed: Seed = Field(
        default=0, description="added to the skin's seed; equal seeds of a kind of layer give equal patterns"
    )

    @abstractmethod
    def size(self) -> float:
        """Return the size of the pattern's largest features, mm."""

    def finest(self) -> float | None:
        """Return the size of a texel, mm, that one place stands for well enough.

        Texels that are larger are looked at in several places, and fade to the mean of the pattern, which is measured.
        None: the layer's function averages over texels of any size by itself.
        """
        return None

    def curve_is_in_texture(self) -> bool:
        """Whether the layer's texture holds what its curve makes of the pattern; else what is looked up is remapped."""
        return False

    def widest(self) -> float:
        """Return the size of a texel, mm, up to which the function's own average over a texel keeps the mean."""
        return WIDEST * self.grain()

    def grain(self) -> float:
        """Return the size, mm, of which features no longer show in texels that are many times as large."""
        return self.size()

    @classmethod
    def local(cls, values: Mapping[str, Any], site: Site) -> Array:
        """Return (n,) by how much the mean of the pattern differs from place to place: a factor.

        The twin of the shader's `NAME_local(NAME_values p, Site site)`, which a layer that overrides this has.
        """
        return np.ones(len(site["footprint"]))

    def channels(self) -> dict[str, Flat | Ramp | Own]:
        pairs = {channel: getattr(self, channel) for channel in RAMPS}
        pairs |= {} if self.pigments is None else self.pigments.pairs()
        return {channel: Ramp(*pair) for channel, pair in pairs.items() if pair is not None}

    def unread_in_mask(self) -> set[str]:
        return super().unread_in_mask() | {*RAMPS, "pigments"}


#: Size of a texel, in sizes of its features, up to which most patterns' own average keeps their mean.
WIDEST = 0.3

#: channels to which a pattern gives a pair of values
RAMPS = ("albedo", "height", "reflectance", "roughness", "specular", "scattering_radius")

LEVELS_FIELD: Any = Field(
    default=(0.0, 1.0),
    description="values of the raw pattern that become 0 and 1, with a smooth step between; falling order inverts",
)


def joint_seed(skin: int, layer: int) -> int:
    """Return the seed of a layer in a skin: the sum, within the range of a GLSL int."""
    return (skin + layer) % 2**31
