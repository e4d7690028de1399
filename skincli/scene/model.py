"""What a person writes in a scene file: every key with its meaning, unit and range.

The models describe the resolved document: a skin's name or path has already been replaced by what it stands for, see
`skincli.scene.paths.load_scene`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from skincli.errors import did_you_mean
from skincli.files import AssetPath, PicturePath
from skincli.mesh.builtin.levels import DETAILS

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
# glTF 2.0, 3.4: "The units for all linear distances are meters". The other formats do not say.
UNIT_OF_FORMAT = {".glb": "m", ".gltf": "m"}

MAX_SIZE = 16384  # texels or pixels a side: the largest texture that common drivers offer


class Written(BaseModel):
    """Base of all that is read from YAML: unknown keys refused, no silent conversion, finite numbers, read-only."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def _nonzero(vector: tuple[float, ...]) -> tuple[float, ...]:
    if math.hypot(*vector) < 1e-12:
        raise ValueError("it must not be zero")
    return vector


# Lists, not fixed tuples: their JSON Schema is understood by the YAML editors. `strict=False` lets a YAML list in;
# the items stay strict.
Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]
Triple = Field(strict=False, min_length=3, max_length=3)
Position = Annotated[tuple[Coordinate, ...], Triple]
Direction = Annotated[tuple[Coordinate, ...], Triple, AfterValidator(_nonzero)]
# Negative light is allowed: it darkens. The bound keeps products of light and skin within float32.
Color = Annotated[tuple[Annotated[float, Field(ge=-1e12, le=1e12)], ...], Triple]
PositiveColor = Annotated[tuple[Annotated[float, Field(ge=0, le=1e12)], ...], Triple]
Exposure = Annotated[float, Field(ge=-64, le=64)]
Side = Annotated[int, Field(ge=1, le=MAX_SIZE)]


def _unit(value: object) -> str | float:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if number and 0 < value <= 1e6:  # type: ignore[operator]
        return float(value)  # type: ignore[arg-type]
    if isinstance(value, str) and value in MM_PER_UNIT:
        return value
    hint = did_you_mean(value, list(MM_PER_UNIT)) if isinstance(value, str) else ""
    raise ValueError(f"it must be one of {', '.join(MM_PER_UNIT)}, or the millimetres per unit, above 0{hint}")


Unit = Annotated[
    str | float,
    BeforeValidator(_unit),
    WithJsonSchema({"anyOf": [{"enum": list(MM_PER_UNIT)}, {"type": "number", "exclusiveMinimum": 0}]}),
]


def _count(value: object) -> object:
    """Turn 259k into 259000; anything else goes on to the check for a whole number."""
    match = re.fullmatch(r"(\d{1,6})([kM])", value) if isinstance(value, str) else None
    return int(match[1]) * {"k": 1000, "M": 1_000_000}[match[2]] if match else value


class MeshSource(Written):
    """The mesh: a file and its unit, or a built-in one and its detail."""

    file: AssetPath | None = Field(
        default=None, description="obj, ply, stl, glb or gltf file, relative to the file that names it"
    )
    unit: Unit | None = Field(
        default=None, description="unit of the file's lengths: mm, cm, m, in, or millimetres per unit; glTF has m"
    )
    builtin: str | None = Field(default=None, description="name of a mesh that comes with skincli")
    detail: Annotated[int, Field(ge=1, le=20_000_000), BeforeValidator(_count)] | None = Field(
        default=None, description="triangles of the built-in mesh, about; 259k is 259000"
    )

    @model_validator(mode="after")
    def _one_source(self) -> MeshSource:
        if (self.file is None) == (self.builtin is None):
            found = "neither file nor builtin" if self.file is None else "both file and builtin"
            raise ValueError(f"{found} is given; write one of them, such as {{file: head.obj, unit: mm}}")
        if self.file is None:
            if self.unit is not None:
                raise ValueError("unit belongs to a file; a built-in mesh is in millimetres; remove unit")
            if self.builtin not in DETAILS:
                hint = did_you_mean(str(self.builtin), list(DETAILS))
                raise ValueError(
                    f"there is no built-in mesh '{self.builtin}'{hint or '.'} There are: {', '.join(DETAILS)}"
                )
            return self
        if self.detail is not None:
            raise ValueError("detail belongs to a built-in mesh; a file has the triangles it has; remove detail")
        if self.unit is None and self.file.suffix.lower() not in UNIT_OF_FORMAT:
            raise ValueError(
                f"a {self.file.suffix or 'mesh'} file does not say its unit; write unit: mm (or cm, m, in, "
                "or the millimetres per unit)"
            )
        return self

    @property
    def mm_per_unit(self) -> float:
        """Millimetres in one unit of the mesh's coordinates."""
        unit = self.unit
        if unit is None:
            unit = UNIT_OF_FORMAT[self.file.suffix.lower()] if self.file is not None else "mm"
        return MM_PER_UNIT[unit] if isinstance(unit, str) else unit


class PartLook(Written):
    """What a named part of the mesh gets of its own."""

    # The skin is validated by itself, against its own folder: see skincli.scene.paths.load_scene.
    skin: Any = Field(description="preset name, path of a skin file, or inline skin; null: the mesh file's material")


class Camera(Written):
    """A pinhole camera in the scene's millimetres."""

    position: Position = Field(description="where it stands, mm")
    target: Position = Field(description="the point at the middle of the picture, mm")
    up: Direction = Field(default=(0.0, 1.0, 0.0), description="the direction that points up in the picture")
    fov: float = Field(default=30.0, ge=0.001, lt=180, description="vertical field of view, degrees")
    exposure: Exposure = Field(default=0.0, description="brightening of the picture, EV (doublings)")

    @model_validator(mode="after")
    def _sees_something(self) -> Camera:
        view = [t - p for t, p in zip(self.target, self.position, strict=True)]
        length = math.hypot(*view)
        # Below a part in 10^9 of the coordinates the direction is rounding noise in float64.
        if length <= 1e-9 * max(1e-3, *map(abs, self.position), *map(abs, self.target)):
            raise ValueError(
                f"position and target are both {list(self.position)}, so it looks nowhere; move one of them"
            )
        (a, b, c), (x, y, z) = view, self.up
        sine = math.hypot(b * z - c * y, c * x - a * z, a * y - b * x) / (length * math.hypot(x, y, z))
        if sine < 1e-6:
            other = [0, 1, 0] if abs(z) > 0.7 * math.hypot(x, y, z) else [0, 0, 1]
            raise ValueError(
                f"it looks along its own up, {list(self.up)}, so the picture's turn is undefined; "
                f"give another up, such as {other}"
            )
        return self


class DirectionalLight(Written):
    """Parallel light, such as the sun's."""

    type: Literal["directional"] = Field(description="directional, point or spot")
    direction: Direction = Field(description="where the light travels")
    irradiance: Color = Field(description="on a surface that faces it; three numbers, linear Rec.709")


class PointLight(Written):
    """Light from a point to all sides."""

    type: Literal["point"] = Field(description="directional, point or spot")
    position: Position = Field(description="where it stands, mm")
    intensity: Color = Field(description="the irradiance it gives at 1 m; three numbers, linear Rec.709")


class SpotLight(Written):
    """Light from a point into a cone."""

    type: Literal["spot"] = Field(description="directional, point or spot")
    position: Position = Field(description="where it stands, mm")
    direction: Direction = Field(description="the axis of its cone, where the light travels")
    intensity: Color = Field(description="the irradiance it gives at 1 m on the axis; three numbers, linear Rec.709")
    angle: float = Field(gt=0, lt=180, description="full opening of the cone, degrees")
    blend: float = Field(
        default=0.0, ge=0, le=1, description="part of the cone over which the edge fades, 0 sharp, 1 all"
    )


Light = Annotated[DirectionalLight | PointLight | SpotLight, Field(discriminator="type")]


class Environment(Written):
    """Light from all around, as a latitude-longitude picture."""

    image: PicturePath = Field(description="hdr, exr or png file, relative to the file that names it")
    rotation: float = Field(
        default=0.0,
        ge=-3600,
        le=3600,
        description="turn, degrees, counter-clockwise from above; at 0 the picture's middle is -Z, right of it +X",
    )
    exposure: Exposure = Field(default=0.0, description="brightening of the environment, EV (doublings)")


LEAST_WEIGHT = 1e-6  # of Equation 1's two together: far smaller ones are 0 in float32


class Occlusion(Written):
    """Screen-space ambient occlusion of two radii, mixed as (high^a low^b)^(1/(a+b)), Equation 1 of the seed paper."""

    samples: Literal["hemisphere", "sphere"] = Field(
        default="hemisphere", description="where samples lie: above the surface, or all around the point"
    )
    radius_high: float = Field(default=6.0, gt=0, le=1e6, description="radius of the fine occlusion, mm")
    radius_low: float = Field(default=30.0, gt=0, le=1e6, description="radius of the coarse occlusion, mm")
    a: float = Field(default=1.0, ge=0, le=1e3, description="weight of the fine occlusion in their geometric mean")
    b: float = Field(default=2.42, ge=0, le=1e3, description="weight of the coarse occlusion")

    @model_validator(mode="after")
    def _has_weight(self) -> Occlusion:
        if self.a + self.b < LEAST_WEIGHT:
            raise ValueError(
                f"a and b are {self.a:g} and {self.b:g}; give at least one of them a weight of {LEAST_WEIGHT:g} or more"
            )
        return self


class Effects(Written):
    """Switches; an effect that is off is neither computed nor drawn."""

    blur: bool = Field(default=True, description="diffusion of light below the surface")
    specular: bool = Field(default=True, description="highlights of the lights")
    occlusion_high: bool = Field(default=True, description="fine occlusion")
    occlusion_low: bool = Field(default=True, description="coarse occlusion")
    reflection: bool = Field(default=True, description="mirror image of the environment")
    reflection_damping: bool = Field(default=True, description="darkening of the reflection by the occlusion")


DiffusionMethod = Literal["lattice", "none", "paper", "sum_of_gaussians", "screen_space", "splat", "exact"]


class Diffusion(Written):
    """How light spreads below the surface; `diffusion: METHOD` says the method alone."""

    method: DiffusionMethod | None = Field(
        default=None,
        description="lattice: on the surface in millimetres, without seams; none; paper: a blur of texels; "
        "sum_of_gaussians: in texture space with stretch maps; screen_space: in the picture; splat: discs in the "
        "picture; exact: float64 on the host, slow; left out: lattice, or paper for shading: paper",
    )
    terms: Annotated[int, Field(ge=1, le=6)] | None = Field(
        default=None, description="Gaussians that stand for the profile, 1 to 6; left out: by quality 2, 4 or 6"
    )
    albedo: Literal["after", "before", "split"] = Field(
        default="after",
        description="where the skin's color is taken: from light that comes out (after), that goes in (before), or "
        "its square root from both (split)",
    )

    @model_validator(mode="before")
    @classmethod
    def _method_alone(cls, value: object) -> object:
        return {"method": value} if isinstance(value, str) else value


Shading = Literal["physical", "paper"]
Quality = Literal["draft", "standard", "high"]

ATLAS_OF_QUALITY: dict[Quality, int] = {"draft": 1024, "standard": 2048, "high": 4096}
SUPERSAMPLE_OF_QUALITY: dict[Quality, int] = {"draft": 1, "standard": 2, "high": 3}
TERMS_OF_QUALITY: dict[Quality, int] = {"draft": 2, "standard": 4, "high": 6}
PAPER_ATLAS = 2500
PAPER_SUPERSAMPLE = 1


class Render(Written):
    """How the picture is made."""

    size: Annotated[tuple[Side, ...], Field(strict=False, min_length=2, max_length=2)] = Field(
        default=(1280, 720), description="width and height of the picture, pixels"
    )
    shading: Shading = Field(default="physical", description="physical, or paper: the seed paper to the letter")
    quality: Quality = Field(default="standard", description="sets what is not given: atlas, supersample")
    atlas: Side | None = Field(default=None, description="side of the texture in which light is computed, texels")
    supersample: Annotated[int, Field(ge=1, le=4)] | None = Field(
        default=None, description="samples per pixel along each axis of the picture"
    )
    occlusion: Occlusion = Field(default=Occlusion(), description="screen-space ambient occlusion")
    effects: Effects = Field(default=Effects(), description="switches of single effects")
    diffusion: Diffusion = Field(default=Diffusion(), description="how light spreads below the surface")
    display: Literal["neutral", "srgb"] = Field(
        default="neutral", description="from scene-linear light to 8-bit pictures"
    )

    @property
    def atlas_size(self) -> int:
        """Side of the atlas in texels: as written, else by shading and quality."""
        return self.atlas or (PAPER_ATLAS if self.shading == "paper" else ATLAS_OF_QUALITY[self.quality])

    @property
    def samples_per_axis(self) -> int:
        """Samples per pixel along each axis: as written, else by shading and quality."""
        chosen = PAPER_SUPERSAMPLE if self.shading == "paper" else SUPERSAMPLE_OF_QUALITY[self.quality]
        return self.supersample or chosen

    @property
    def irradiance_samples(self) -> int:
        """Places along a texel's side where a light has an edge; the paper and drafts take the centers alone."""
        return 1 if self.shading == "paper" or self.quality == "draft" else 4

    @property
    def diffusion_method(self) -> DiffusionMethod:
        """What spreads light below the surface: as written, else by shading; none where the effect is off."""
        if not self.effects.blur:
            return "none"
        return self.diffusion.method or ("paper" if self.shading == "paper" else "lattice")

    @property
    def diffusion_terms(self) -> int:
        """Gaussians that stand for a profile: as written, else by quality."""
        return self.diffusion.terms or TERMS_OF_QUALITY[self.quality]

    @model_validator(mode="after")
    def _paper_is_the_paper(self) -> Render:
        if self.shading == "paper" and self.diffusion != Diffusion():
            raise ValueError(
                "shading: paper has the paper's own blur, after which comes albedo; remove diffusion, "
                "or write shading: physical"
            )
        return self


def check_outputs(names: Collection[str], allowed: Collection[str]) -> list[str]:
    """Return one sentence for each of `names` that is not in `allowed`; empty when all are known.

    Parameters
    ----------
    names : output names as written
    allowed : the outputs that the pipeline offers
    """
    known = ", ".join(sorted(allowed))
    return [
        f"no output has that name{did_you_mean(name, list(allowed)) or '.'} There are: {known}"
        for name in names
        if name not in allowed
    ]


def _known_output(name: str, info: ValidationInfo) -> str:
    allowed = (info.context or {}).get("outputs")
    for message in check_outputs((name,), allowed) if allowed is not None else ():
        raise ValueError(message)
    return name


OutputName = Annotated[str, AfterValidator(_known_output)]


class Scene(Written):
    """A mesh, its skins, a camera, lights, and what is to be written of them."""

    scene: Literal[1] = Field(description="version of the format; write scene: 1")
    mesh: MeshSource = Field(description="{file: head.obj, unit: mm} or {builtin: head}")
    # Validated by itself, against its own folder: see skincli.scene.paths.load_scene.
    skin: Any = Field(
        default=None,
        description="preset name, path of a skin file, or inline skin; left out: the mesh file's materials",
    )
    parts: dict[str, PartLook] = Field(default={}, description="other skins for named parts of the mesh file")
    camera: Camera | None = Field(default=None, description="left out: the whole mesh is framed from the front")
    ambient: PositiveColor = Field(
        default=(0.05, 0.05, 0.05), description="ambient light; three numbers, linear Rec.709"
    )
    lights: Annotated[tuple[Light, ...], Field(strict=False)] = Field(default=(), description="the lights")
    environment: Environment | None = Field(default=None, description="light from all around")
    background: Color | None = Field(default=None, description="linear Rec.709; left out: transparent")
    render: Render = Field(default=Render(), description="how the picture is made")
    outputs: Annotated[tuple[OutputName, ...], Field(strict=False, min_length=1, max_length=64)] = Field(
        default=("beauty",), description="names of the pictures to write"
    )

    @field_validator("outputs")
    @classmethod
    def _unique(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"each output may be named once; remove the second '{twice[0]}'")
        return names
