"""What a person writes in a skin file: texture layers, how light goes through the skin, how its surface answers."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal

from pydantic import Field, field_validator

from skincli.layers import StackLayer
from skincli.layers.base import Layer
from skincli.scene.model import Side, Written

Share = Annotated[float, Field(ge=0, le=1)]
Length = Annotated[float, Field(gt=0, le=1000)]


class Optics(Written):
    """How light goes through the skin. The defaults are fair human skin [OpenPBR 1.1, Fitzpatrick type II]."""

    color: Annotated[tuple[Share, ...], Field(strict=False, min_length=3, max_length=3)] = Field(
        default=(0.799, 0.485, 0.347), description="share of the light that comes out again, linear Rec.709, 0 to 1"
    )
    radius: Annotated[tuple[Length, ...], Field(strict=False, min_length=3, max_length=3)] = Field(
        default=(0.482, 0.169, 0.109),
        description="how far red, green and blue light gets, mm; radius_kind says which length",
    )
    radius_kind: Literal["mfp", "dmfp", "d"] = Field(
        default="mfp",
        description="mfp: mean free path; dmfp: diffuse mean free path; d: the width of Burley's profile",
    )


class Surface(Written):
    """The parameters of the surface, as in the seed paper."""

    ambient: float = Field(default=1.0, ge=0, le=1000, description="factor of the ambient light")
    diffuse: float = Field(default=1.0, ge=0, le=1000, description="factor of the diffuse light")
    specular: float = Field(default=0.25, ge=0, le=1000, description="factor of the highlights")
    shininess: float = Field(
        default=20.0, ge=0, le=100000, description="exponent of the highlights; the higher, the smaller"
    )
    reflectance: float = Field(
        default=0.05, ge=0, le=1, description="share of the environment that is mirrored, 0 to 1"
    )
    bumpiness: float = Field(
        default=1.0, ge=0, le=1000, description="factor of the heights and slopes; 0 is a smooth surface"
    )
    blur: float = Field(default=8.0, ge=0, le=256, description="width of the paper's blur, texels; 0 is none")


class Skin(Written):
    """A skin: texture layers, optics and surface."""

    skin: Literal[1] = Field(description="version of the format; write skin: 1")
    about: str = Field(default="", max_length=1000, description="a sentence about the skin")
    size: Side = Field(default=2048, description="texels along a side of the generated maps, 1 to 16384")
    extent: float = Field(
        default=100.0,
        gt=0,
        le=100000,
        description="side of the flat square on which maps lie when there is no mesh, mm",
    )
    seed: int = Field(default=0, ge=0, lt=2**31, description="seed of every random pattern")
    layers: Annotated[tuple[StackLayer, ...], Field(strict=False)] = Field(
        default=(),
        description="texture layers, bottom to top; each is a mapping with one key, such as pores: {spacing: 1}",
    )
    optics: Optics = Field(default=Optics(), description="how light goes through the skin")
    surface: Surface = Field(default=Surface(), description="how the surface answers to light")

    @field_validator("layers")
    @classmethod
    def _names_differ(cls, layers: tuple[Layer, ...]) -> tuple[Layer, ...]:
        counts = Counter(layer.name for layer in layers if layer.name is not None)
        if repeated := [name for name, count in counts.items() if count > 1]:
            raise ValueError(f"more than one layer has the name {', '.join(repeated)}; give each its own name")
        return layers
