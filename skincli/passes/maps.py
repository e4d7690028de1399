"""The generator's fused draw: every layer of a skin evaluated at every texel, only for the maps that are wanted."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from skincli.gpu.blocks import FreeValues
from skincli.gpu.program import expand
from skincli.graph.node import Constant, Draw, Input, Output, Pass, Source, module_digest
from skincli.layers.base import Texture
from skincli.layers.stack import CHANNELS, FusedSource, Stack, fuse

#: the pass's output -> the channel of the layers
CHANNEL = {"tangent_slope" if channel == "slope" else channel: channel for channel in CHANNELS}

#: what is baked of a flat square: open and without curvature
UNBAKED = Constant((1.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class MapSource:
    """A skin's layers as shaders: all maps fused, and each map alone, which decides that map's key.

    Parameters
    ----------
    fused : the shader of all maps
    alone : by output of the pass, the shader that would make it alone
    """

    fused: FusedSource
    alone: Mapping[str, FusedSource]

    @classmethod
    def of_skin(cls, skin: Stack) -> MapSource:
        """Fuse a skin's layers."""
        return cls(
            fuse(skin, set(CHANNEL.values())),
            {output: fuse(skin, {channel}) for output, channel in CHANNEL.items()},
        )

    @property
    def written(self) -> set[str]:
        """Outputs that at least one layer writes."""
        return {output for output, channel in CHANNEL.items() if channel in self.fused.written}

    @property
    def textures(self) -> Sequence[tuple[str, Texture]]:
        """(sampler, texture) of the fused shader."""
        return self.fused.textures

    @property
    def on_surface(self) -> bool:
        """Whether any layer asks where on the surface a texel lies."""
        return self.fused.on_surface

    @property
    def reads_bake(self) -> bool:
        """Whether any layer asks for the mesh's baked occlusion or curvature."""
        return bool(self.fused.reads)

    def constant(self, output: str) -> Constant:
        """Return what an output holds that no layer writes."""
        value = self.fused.start[CHANNEL[output]]
        if len(value) == 1:
            return Constant((value[0],) * 4)
        padding = (0.0, 0.0) if len(value) == 2 else (1.0,)
        return Constant((*value, *padding))

    def inputs_of(self, output: str) -> tuple[str, ...]:
        """Names of the inputs that an output depends on."""
        alone = self.alone[output]
        textures = {texture for _, texture in alone.textures}
        samplers = tuple(name for name, texture in self.textures if texture in textures)
        site = (*(("site_position", "site_normal") if alone.on_surface else ()),)
        return (*site, *(("site_baked",) if alone.reads else ()), *samplers)


class Maps(Pass):
    """A skin: albedo (linear Rec.709), height and scattering radius (mm), factors 0 to 1, tangent-space slope.

    Parameters
    ----------
    source : the skin's layers
    on_surface : whether patterns are evaluated on a mesh (site inputs) or on the flat square of uv
    extent : side of the flat square, mm
    """

    dear = True
    shader = "passes/maps.frag"
    outputs = {
        "albedo": Output("rgba16f", mipmaps=True),
        "height": Output("r32f"),
        "reflectance": Output("r16f", mipmaps=True),
        "roughness": Output("r16f", mipmaps=True),
        "specular": Output("r16f", mipmaps=True),
        "scattering_radius": Output("rgba16f", mipmaps=True),
        "tangent_slope": Output("rg16f"),
    }

    def __init__(
        self,
        name: str,
        size: tuple[int, int],
        source: MapSource,
        wired: Mapping[str, Source],
        *,
        on_surface: bool,
        extent: float,
    ) -> None:
        # Samplers differ from skin to skin: how many there are, and whether each repeats.
        self.inputs = {
            "site_position": Input(),
            "site_normal": Input(),
            "site_baked": Input(),
            **{sampler: Input("mipmap", texture.repeat) for sampler, texture in source.textures},
        }
        self.map_source = source
        values = FreeValues(
            (("texel", "float"), ("extent", "float"), ("on_surface", "int"), *source.fused.members),
            (1 / size[0], extent, int(on_surface and source.on_surface), *source.fused.numbers),
        )
        generated = (("generated/layers", source.fused.source), *source.fused.generated)
        super().__init__(name, size, [Draw(values)], {"site_baked": UNBAKED, **wired}, generated=generated)
        self._flat_extent = "" if on_surface else f"{extent}"

    def needed_inputs(self, output: str) -> Sequence[str]:
        """Only the textures and the site that this map's own layers read."""
        return self.map_source.inputs_of(output)

    def own_digest(self, output: str) -> bytes:
        """A map's key says what the map is, not which fused draw made it."""
        alone = self.map_source.alone[output]
        text = expand(self.shader, {"generated/layers": alone.source, **dict(alone.generated)}).text
        digest = hashlib.blake2b(module_digest(__name__) + text.encode(), digest_size=16)
        digest.update(repr((self.size, self._flat_extent, alone.members, alone.numbers)).encode())
        return digest.digest()
