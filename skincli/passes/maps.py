"""The generator's fused draw: every layer of a skin evaluated at every texel, only for the maps that are wanted."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from skincli.gpu.blocks import FreeValues
from skincli.gpu.program import expand
from skincli.graph.node import Constant, Draw, Input, Output, Pass, Source, module_digest
from skincli.layers.base import Picture
from skincli.layers.stack import FusedSource, Stack, fuse

#: the pass's output -> the channel of the layers
CHANNEL = {"albedo": "albedo", "height": "height", "reflectance": "reflectance", "tangent_slope": "slope"}


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
    def images(self) -> Sequence[tuple[str, Picture]]:
        """(sampler, picture) of the fused shader."""
        return self.fused.images

    @property
    def on_surface(self) -> bool:
        """Whether any layer asks where on the surface a texel lies."""
        return self.fused.on_surface

    def inputs_of(self, output: str) -> tuple[str, ...]:
        """Names of the inputs that an output depends on."""
        alone = self.alone[output]
        pictures = {picture for _, picture in alone.images}
        samplers = tuple(name for name, picture in self.images if picture in pictures)
        return (*(("site_position", "site_normal") if alone.on_surface else ()), *samplers)


class Maps(Pass):
    """Albedo (linear Rec.709), height (mm), reflectance (0 to 1) and tangent-space slope of a skin.

    Parameters
    ----------
    source : the skin's layers
    on_mesh : whether texels lie on a mesh (site inputs) or on a flat square
    extent : side of the flat square, mm
    """

    dear = True
    shader = "passes/maps.frag"
    outputs = {
        "albedo": Output("rgba16f", mipmaps=True),
        "height": Output("r32f"),
        "reflectance": Output("r16f", mipmaps=True),
        "tangent_slope": Output("rg16f"),
    }
    #: what a map holds when no layer writes it
    neutral = {
        "albedo": Constant((0.5, 0.5, 0.5, 1.0)),
        "height": Constant((0.0, 0.0, 0.0, 0.0)),
        "reflectance": Constant((1.0, 1.0, 1.0, 1.0)),
        "tangent_slope": Constant((0.0, 0.0, 0.0, 0.0)),
    }

    def __init__(
        self,
        name: str,
        size: tuple[int, int],
        source: MapSource,
        wired: Mapping[str, Source],
        *,
        on_mesh: bool,
        extent: float,
    ) -> None:
        # Samplers differ from skin to skin: how many there are, and whether each repeats.
        self.inputs = {
            "site_position": Input(),
            "site_normal": Input(),
            **{sampler: Input("mipmap", picture.repeat) for sampler, picture in source.images},
        }
        self.map_source = source
        values = FreeValues(
            (("texel", "float"), ("extent", "float"), ("on_mesh", "int"), *source.fused.members),
            (1 / size[0], extent, int(on_mesh and source.on_surface), *source.fused.numbers),
        )
        generated = (("generated/layers", source.fused.source),)
        super().__init__(name, size, [Draw(values)], wired, generated=generated)
        self._flat_extent = "" if on_mesh else f"{extent}"

    def needed_inputs(self, output: str) -> Sequence[str]:
        """Only the images and the site that this map's own layers read."""
        return self.map_source.inputs_of(output)

    def own_digest(self, output: str) -> bytes:
        """A map's key says what the map is, not which fused draw made it."""
        alone = self.map_source.alone[output]
        text = expand(self.shader, {"generated/layers": alone.source}).text
        digest = hashlib.blake2b(module_digest(__name__) + text.encode(), digest_size=16)
        digest.update(repr((self.size, self._flat_extent, alone.members, alone.numbers)).encode())
        return digest.digest()
