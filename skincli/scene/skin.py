"""What a person writes in a skin file: texture layers, how light goes through the skin, how its surface answers."""

from __future__ import annotations

import math
from collections import Counter
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from skincli.errors import InputError
from skincli.layers import StackLayer
from skincli.layers.base import Ground, Layer
from skincli.layers.pigments import CHANNEL_OF
from skincli.optics.diffusion import burley_width, gaussian_sigma
from skincli.optics.dipole import Layer as LayerOptics
from skincli.optics.dipole import Multipole
from skincli.optics.gaussians import Profile, single, triple
from skincli.optics.pigments import PIGMENTS, PigmentModel
from skincli.optics.profiles import from_color, from_medium, preset
from skincli.scene.model import Side, Written

Share = Annotated[float, Field(ge=0, le=1)]
Length = Annotated[float, Field(gt=0, le=1000)]
Rates = Annotated[tuple[Annotated[float, Field(gt=0, le=1000)], ...], Field(strict=False, min_length=3, max_length=3)]
Index = Annotated[float, Field(ge=1, le=4)]


class OpticalLayer(Written):
    """One layer of a multipole, such as epidermis or dermis."""

    sigma_a: Rates = Field(description="absorption of red, green and blue light, 1/mm")
    sigma_s: Rates = Field(description="reduced scattering of red, green and blue light, 1/mm")
    thickness: Length | None = Field(default=None, description="mm; left out for the lowest layer: without end")
    ior: Index = Field(default=1.4, description="index of refraction")


ProfileName = Literal["burley", "gaussian", "dipole", "multipole", "human", "jensen_skin1", "jensen_skin2"]

#: what each profile reads; `profile` alone says the rest
KEYS_OF_PROFILE: dict[ProfileName, frozenset[str]] = {
    "burley": frozenset({"color", "radius", "radius_kind"}),
    "gaussian": frozenset({"color", "radius", "radius_kind"}),
    "dipole": frozenset({"sigma_a", "sigma_s", "ior"}),
    "multipole": frozenset({"layers"}),
    "human": frozenset(),
    "jensen_skin1": frozenset(),
    "jensen_skin2": frozenset(),
}


class Optics(Written):
    """How light goes through the skin. The defaults are fair human skin [OpenPBR 1.1, Fitzpatrick type II].

    Only the spread of light follows from them; its color is that of the albedo map.
    """

    profile: ProfileName = Field(
        default="burley",
        description="how light spreads: burley or gaussian, by color and radius; dipole, by sigma_a and sigma_s; "
        "multipole, by layers; or as published: human, jensen_skin1, jensen_skin2",
    )
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
    sigma_a: Rates | None = Field(default=None, description="dipole: absorption of red, green and blue light, 1/mm")
    sigma_s: Rates | None = Field(
        default=None, description="dipole: reduced scattering of red, green and blue light, 1/mm"
    )
    ior: Index = Field(default=1.4, description="dipole: index of refraction")
    layers: Annotated[tuple[OpticalLayer, ...], Field(strict=False, max_length=8)] = Field(
        default=(), description="multipole: layers of the skin from the top, such as epidermis, dermis, fat"
    )

    @model_validator(mode="after")
    def _complete(self) -> Optics:
        read = KEYS_OF_PROFILE[self.profile]
        needed = {"dipole": ("sigma_a", "sigma_s"), "multipole": ("layers",)}.get(self.profile, ())
        missing = [key for key in needed if not getattr(self, key)]
        if missing:
            raise ValueError(f"profile {self.profile} needs {' and '.join(missing)}; give {', '.join(needed)}")
        # Color and radius may stay where a preset's profile is changed; what only another profile has is a mistake.
        others = frozenset().union(*KEYS_OF_PROFILE.values()) - KEYS_OF_PROFILE["burley"] - read
        unread = sorted(key for key in others if getattr(self, key) != type(self).model_fields[key].default)
        if unread:
            raise ValueError(
                f"profile {self.profile} does not read {', '.join(unread)}; remove that, or choose another profile"
            )
        try:
            self.diffusion_profile()
        except InputError as error:
            raise ValueError(str(error)) from None
        return self

    def diffusion_profile(self) -> Profile:
        """Return the profile, of any albedo.

        Raises
        ------
        InputError : see skincli.optics.dipole.Multipole
        """
        if self.profile == "burley":
            return from_color(self.color, self.radius, self.radius_kind)
        if self.profile == "gaussian":
            return single(gaussian_sigma(burley_width(self.radius, self.color, self.radius_kind)), self.color)
        if self.profile == "dipole":
            assert self.sigma_a is not None
            assert self.sigma_s is not None
            return from_medium(self.sigma_a, self.sigma_s, self.ior)
        if self.profile == "multipole":
            return Multipole(
                tuple(
                    LayerOptics(
                        triple(layer.sigma_a), triple(layer.sigma_s), layer.thickness or math.inf, float(layer.ior)
                    )
                    for layer in self.layers
                )
            )
        return preset(self.profile)


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


class Pigments(Written):
    """What colors the skin beneath all paint: amounts that the layers add to. The defaults are fair human skin."""

    base: Literal["dermis", "leucophore", "iridophore"] = Field(
        default="dermis",
        description="what scatters the light back: dermis, or an octopus's white leucophores or blue-green iridophores",
    )
    melanin: float = Field(default=0.023, ge=0, le=1, description="melanin, share of the epidermis's volume")
    eumelanin: Share = Field(default=1.0, description="brown-black share of the melanin; the rest is red-yellow")
    hemoglobin: float = Field(default=0.015, ge=0, le=1, description="blood, share of the dermis's volume")
    oxygenation: Share = Field(default=0.75, description="share of the blood that carries oxygen")
    bilirubin: float = Field(default=0.0, ge=0, le=10, description="bilirubin, g/l of the dermis")
    sulfhemoglobin: float = Field(default=0.0, ge=0, le=1, description="green blood of decay, share of the dermis")
    xanthommatin: float = Field(default=0.0, ge=0, le=10, description="yellow of chromatophores, optical density")
    reduced_xanthommatin: float = Field(default=0.0, ge=0, le=10, description="red of chromatophores, optical density")
    ommin: float = Field(default=0.0, ge=0, le=10, description="brown-black of chromatophores, optical density")
    epidermis: float = Field(default=0.07, gt=0, le=10, description="thickness of the epidermis, mm")

    @property
    def model(self) -> PigmentModel:
        """What turns amounts into a color."""
        return PigmentModel(eumelanin=self.eumelanin, epidermis=self.epidermis, base=self.base)

    @property
    def amounts(self) -> dict[str, float]:
        """Amount by pigment, before the first layer."""
        blood = {
            "oxyhemoglobin": self.hemoglobin * self.oxygenation,
            "deoxyhemoglobin": self.hemoglobin * (1 - self.oxygenation),
        }
        return {pigment.name: blood.get(pigment.name, getattr(self, pigment.name, 0.0)) for pigment in PIGMENTS}


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
    domain: Literal["object", "uv"] = Field(
        default="object",
        description="where patterns are evaluated on a mesh: object, on the surface in space, without seams; "
        "uv, on a flat square of `extent` mm",
    )
    tileable: bool = Field(default=False, description="domain uv: the maps repeat without a visible border")
    cavity_radius: float = Field(
        default=1.0, gt=0, le=1000, description="how far around a texel the cavity map looks for relief, mm"
    )
    pigments: Pigments | None = Field(
        default=None, description="what colors the skin beneath all paint; left out: albedo is paint on grey"
    )
    layers: Annotated[tuple[StackLayer, ...], Field(strict=False)] = Field(
        default=(),
        description="texture layers, bottom to top; each is a mapping with one key, such as pores: {spacing: 1}",
    )
    optics: Optics = Field(default=Optics(), description="how light goes through the skin")
    surface: Surface = Field(default=Surface(), description="how the surface answers to light")

    @property
    def ground(self) -> Ground:
        """What all layers share."""
        return Ground(self.seed, self.extent if self.tileable else None)

    @property
    def pigmentation(self) -> Pigments | None:
        """The pigments under all paint."""
        return self.pigments

    @property
    def start(self) -> dict[str, tuple[float, ...]]:
        """Values of channels before the first layer that follow from optics and surface."""
        return {"roughness": ((2 / (self.surface.shininess + 2)) ** 0.25,), "scattering_radius": self.optics.radius}

    @model_validator(mode="after")
    def _consistent(self) -> Skin:
        if self.tileable and self.domain != "uv":
            raise ValueError("tileable maps are laid by uv; add domain: uv, or remove tileable")
        if self.pigments is None and any(set(CHANNEL_OF.values()) & layer.writes() for layer in self.layers):
            raise ValueError("a layer adds pigments, but the skin has none to add to; give it pigments: {}")
        return self

    @field_validator("layers")
    @classmethod
    def _names_differ(cls, layers: tuple[Layer, ...]) -> tuple[Layer, ...]:
        counts = Counter(layer.name for layer in layers if layer.name is not None)
        if repeated := [name for name, count in counts.items() if count > 1]:
            raise ValueError(f"more than one layer has the name {', '.join(repeated)}; give each its own name")
        return layers
