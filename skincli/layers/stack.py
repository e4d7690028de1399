"""A stack of layers becomes one fragment shader, or, for tests, one float64 evaluation."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Protocol

import numpy as np

from skincli.errors import LimitError
from skincli.layers.base import Array, Flat, Layer, Own, Picture, Ramp, Site, Value
from skincli.layers.blend import MODES

#: Channel -> GLSL type and the value before the first layer. Albedo is linear Rec.709, height mm (negative in pits),
#: reflectance a factor 0 to 1, slope the rise per distance along u and v.
CHANNELS: dict[str, tuple[str, tuple[float, ...]]] = {
    "albedo": ("vec3", (0.5, 0.5, 0.5)),
    "height": ("float", (0.0,)),
    "reflectance": ("float", (1.0,)),
    "slope": ("vec2", (0.0, 0.0)),
}

#: Channels that take blend modes; the others are sums.
BLENDED = ("albedo", "reflectance")

#: Image files of one skin: a program has 16 samplers, of which the map pass needs some for the Site.
MAX_IMAGES = 12


class Stack(Protocol):
    """What is fused: `skincli.scene.skin.Skin` is one."""

    @property
    def layers(self) -> Sequence[Layer]:
        """The layers, bottom to top."""

    @property
    def seed(self) -> int:
        """Seed of the whole skin."""


@dataclass(frozen=True)
class FusedSource:
    """A fragment-shader body that computes exactly the requested maps, and what it must be given.

    Parameters
    ----------
    source : GLSL text without `#version`, uniforms and samplers. It includes files of the shaders folder and defines
        `void generate(Site site, out vec3 albedo, out float height, out float reflectance, out vec2 slope)`; channels
        that were not requested, or that no layer writes, are set to the values of `CHANNELS`. It takes derivatives of
        `site.uv`, so `generate` must be called outside of branches, with a uv that is smooth over the whole map
    members : (name, GLSL type) of the uniform block, in order; the source reads them as `p.NAME`. Equal stacks have
        equal members: a layer that is off leaves no trace
    numbers : one value per member: a number or a tuple
    images : (sampler name, what it samples) for each sampler2D; level of detail is chosen by the shader, so mipmaps
        are needed. Uploaded with the picture's bottom row first, so that v runs upwards
    written : the requested maps that at least one layer writes; the others are constant
    on_surface : whether any layer reads the position, normal or footprint of the site
    """

    source: str
    members: tuple[tuple[str, str], ...]
    numbers: tuple[Value, ...]
    images: tuple[tuple[str, Picture], ...]
    written: frozenset[str]
    on_surface: bool


def active(layers: Iterable[Layer], maps: Collection[str]) -> list[Layer]:
    """Return the layers that show in at least one of the maps, bottom to top."""
    return [layer for layer in layers if _shows(layer) and layer.writes() & set(maps)]


def _shows(layer: Layer) -> bool:
    return layer.enabled and layer.opacity > 0 and (layer.mask is None or _shows(layer.mask))


def fuse(skin: Stack, maps: Collection[str]) -> FusedSource:
    """Return the shader that computes the maps of a skin.

    Parameters
    ----------
    skin : the description
    maps : names of `CHANNELS`

    Raises
    ------
    LimitError : the layers sample more than `MAX_IMAGES` different images
    """
    writer = _Writer(skin.seed)
    layers = active(skin.layers, maps)
    for index, layer in enumerate(layers):
        writer.layer(f"layer{index}", layer, [channel for channel in CHANNELS if channel in maps])
    if len(writer.samplers) > MAX_IMAGES:
        raise LimitError(
            f"the layers of a skin sample {len(writer.samplers)} images; at most {MAX_IMAGES} are allowed; "
            "merge some of them into one file"
        )
    written = frozenset(channel for layer in layers for channel in layer.writes()) & frozenset(maps)
    images = tuple((name, picture) for picture, name in writer.samplers.items())
    on_surface = any(layer.on_surface() for layer in layers)
    return FusedSource(writer.text(), tuple(writer.members), tuple(writer.numbers), images, written, on_surface)


@dataclass
class _Writer:
    """Collects the parts of the shader while the stack is walked."""

    seed: int
    kernels: dict[str, list[str]] = field(default_factory=dict)
    members: list[tuple[str, str]] = field(default_factory=list)
    numbers: list[Value] = field(default_factory=list)
    samplers: dict[Picture, str] = field(default_factory=dict)
    body: list[str] = field(default_factory=list)

    def member(self, name: str, value: float | int | tuple[float, ...]) -> str:
        """Add a number to the uniform block and return the expression that reads it."""
        self.members.append((name, _glsl_type(value)))
        self.numbers.append(value)
        return f"p.{name}"

    def layer(self, name: str, layer: Layer, maps: Sequence[str]) -> None:
        """Append the statements of one layer."""
        self.body.append("    {")
        weight = self.weight(name, layer)
        channels = {channel: source for channel, source in layer.channels().items() if channel in maps}
        pattern = ""
        if layer.kernel is not None:
            self.body.append(f"        {layer.kernel} value = {self.call(name, layer)};")
            pattern = "value.w" if layer.kernel == "vec4" else "value"
        for channel, source in channels.items():
            value = self.value(f"{name}_{channel}", channel, source, layer, pattern)
            if channel in BLENDED:
                value = f"mix({channel}, blend_{layer.blending()}({channel}, {value}), {weight})"
                self.body.append(f"        {channel} = {value};")
            else:
                self.body.append(f"        {channel} += {weight} * {value};")
        self.body.append("    }")

    def value(self, name: str, channel: str, source: Flat | Ramp | Own, layer: Layer, pattern: str) -> str:
        """Return the expression for what a channel receives."""
        if isinstance(source, Flat):
            return self.member(name, source.value)
        if isinstance(source, Ramp):
            low, high = self.member(f"{name}_low", source.low), self.member(f"{name}_high", source.high)
            return f"mix({low}, {high}, {pattern})"
        if channel == "slope":
            return "value.xy"
        if channel != "albedo":
            return pattern
        return "value.rgb" if layer.kernel == "vec4" else "vec3(value)"

    def weight(self, name: str, layer: Layer) -> str:
        """Return the expression for opacity times mask."""
        opacity = self.member(f"{name}_opacity", layer.opacity)
        if layer.mask is None:
            return opacity
        mask = f"{name}_mask"
        pattern = self.call(mask, layer.mask) + (".w" if layer.mask.kernel == "vec4" else "")
        inner = self.weight(mask, layer.mask)
        self.body.append(f"        float {name}_weight = {opacity} * {inner} * {pattern};")
        return f"{name}_weight"

    def call(self, name: str, layer: Layer) -> str:
        """Return the call of a layer's function with its values and its image."""
        kind, values = layer.kind(), layer.values(self.seed)
        arguments = []
        for key, value in values.items():
            if isinstance(value, IntEnum):
                arguments.append(f"{kind.upper()}_{value.name}")
            else:
                arguments.append(self.member(f"{name}_{key}", value))
        if kind not in self.kernels:
            self.kernels[kind] = _declarations(kind, values)
        picture = layer.picture()
        extra = "" if picture is None else ", " + self.samplers.setdefault(picture, f"image{len(self.samplers)}")
        return f"{kind}_layer({kind}_values({', '.join(arguments)}), site{extra})"

    def text(self) -> str:
        """Return the whole source."""
        start = [
            f"    {channel} = {kind}({', '.join(repr(number) for number in value)});"
            for channel, (kind, value) in CHANNELS.items()
        ]
        signature = ", ".join(f"out {kind} {channel}" for channel, (kind, _) in CHANNELS.items())
        lines = ['#include "lib/site.glsl"', '#include "lib/blend.glsl"']
        lines += [line for kernel in self.kernels.values() for line in kernel]
        lines += [f"void generate(Site site, {signature}) {{", *start, *self.body, "}"]
        return "\n".join(lines) + "\n"


def _glsl_type(value: float | int | tuple[float, ...]) -> str:
    if isinstance(value, tuple):
        return f"vec{len(value)}"
    return "int" if isinstance(value, int) else "float"


def _declarations(kind: str, values: Mapping[str, Value]) -> list[str]:
    """Return the constants of a layer's choices, the struct of its values, and the include of its function.

    A choice is a constant and not a uniform, so that the compiler drops the branches which are not taken.
    """
    choices = {type(value): None for value in values.values() if isinstance(value, IntEnum)}
    lines = [f"const int {kind.upper()}_{option.name} = {option.value};" for choice in choices for option in choice]
    types = {key: "int" if isinstance(value, IntEnum) else _glsl_type(value) for key, value in values.items()}
    lines.append(f"struct {kind}_values {{ {' '.join(f'{glsl} {key};' for key, glsl in types.items())} }};")
    return [*lines, f'#include "layers/{kind}.glsl"']


def twin_stack(skin: Stack, maps: Collection[str], site: Site, pictures: Mapping[Path, Array]) -> dict[str, Array]:
    """Return the maps of a skin at some points, in float64.

    Parameters
    ----------
    skin : the description
    maps : names of `CHANNELS`
    site : n points
    pictures : (h, w, c) linear pixels of each image file, top row first

    Returns
    -------
    map -> (n, 3) albedo, (n,) height in mm, (n,) reflectance, (n, 2) slope
    """
    count = len(site["position"])
    results = {channel: np.tile(np.array(CHANNELS[channel][1]), (count, 1)) for channel in maps}
    for layer in active(skin.layers, maps):
        weight = _weight(layer, skin.seed, site, pictures)[:, None]
        value = None if layer.kernel is None else _evaluate(layer, skin.seed, site, pictures)
        for channel, source in layer.channels().items():
            if channel not in results:
                continue
            below = results[channel]
            new = _value(channel, source, layer, value)
            results[channel] = (
                (1 - weight) * below + weight * MODES[layer.blending()](below, new)
                if channel in BLENDED
                else below + weight * new
            )
    return {channel: value[:, 0] if value.shape[1] == 1 else value for channel, value in results.items()}


def _evaluate(layer: Layer, seed: int, site: Site, pictures: Mapping[Path, Array]) -> Array:
    picture = layer.picture()
    return layer.twin(layer.values(seed), site, None if picture is None else pictures[picture.file])


def _weight(layer: Layer, seed: int, site: Site, pictures: Mapping[Path, Array]) -> Array:
    weight = np.full(len(site["position"]), layer.opacity)
    if layer.mask is not None:
        pattern = _evaluate(layer.mask, seed, site, pictures)
        weight = weight * _weight(layer.mask, seed, site, pictures) * (pattern if pattern.ndim == 1 else pattern[:, 3])
    return weight


def _value(channel: str, source: Flat | Ramp | Own, layer: Layer, value: Array | None) -> Array:
    """Return (n or 1, components): what a channel receives."""
    if isinstance(source, Flat):
        return np.atleast_2d(source.value)
    assert value is not None
    pattern = value[:, None] if value.ndim == 1 else value[:, 3:]
    if isinstance(source, Ramp):
        low, high = np.atleast_2d(source.low), np.atleast_2d(source.high)
        return (1 - pattern) * low + pattern * high
    if value.ndim == 1 or channel == "reflectance":
        return pattern
    return value[:, :2] if channel == "slope" else value[:, :3]
