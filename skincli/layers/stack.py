"""A stack of layers becomes one fragment shader, or, for tests, one float64 evaluation."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import reduce
from typing import Any, Protocol

import numpy as np

from skincli.errors import LimitError
from skincli.layers import blend, hashing, remap
from skincli.layers.base import (
    Array,
    Flat,
    Ground,
    Layer,
    Own,
    Pattern,
    Ramp,
    Site,
    Texture,
    Value,
    Writing,
    joint_seed,
)
from skincli.layers.filtering import band_of, seen
from skincli.layers.pigments import CHANNEL_OF
from skincli.optics.pigments import PigmentModel

#: Channel -> GLSL type and the value before the first layer. Albedo is linear Rec.709, height mm (negative in pits),
#: reflectance, roughness and specular factors 0 to 1, the scattering radius mm, slope the rise per distance
#: along u and v.
CHANNELS: dict[str, tuple[str, tuple[float, ...]]] = {
    "albedo": ("vec3", (0.5, 0.5, 0.5)),
    "height": ("float", (0.0,)),
    "reflectance": ("float", (1.0,)),
    "roughness": ("float", (0.5,)),
    "specular": ("float", (1.0,)),
    "scattering_radius": ("vec3", (1.0, 1.0, 1.0)),
    "slope": ("vec2", (0.0, 0.0)),
}

#: Channels that take blend modes; of the others, the scattering radius is mixed and the rest are sums.
BLENDED = ("albedo", "reflectance", "roughness", "specular")

#: Textures of one skin: a program has 16 samplers, of which the map pass needs some for the Site.
MAX_TEXTURES = 12

#: Patterns of one skin, its masks' included: drivers take time to compile that grows with the square of their number.
MAX_PATTERNS = 100

#: Bytes of the uniform block that the numbers of layers may take; what is beyond becomes part of the program's text.
MAX_BLOCK = 15_000


class Pigmentation(Protocol):
    """The pigments of a skin before the first layer."""

    @property
    def model(self) -> PigmentModel:
        """What turns amounts into a color."""

    @property
    def amounts(self) -> Mapping[str, float]:
        """Amount by pigment."""


class Stack(Protocol):
    """What is fused: `skincli.scene.skin.Skin` is one."""

    @property
    def layers(self) -> Sequence[Layer]:
        """The layers, bottom to top."""

    @property
    def ground(self) -> Ground:
        """What all layers share."""

    @property
    def pigmentation(self) -> Pigmentation | None:
        """The pigments under all paint; None where albedo is paint alone."""

    @property
    def start(self) -> Mapping[str, tuple[float, ...]]:
        """Values of channels before the first layer, where they differ from those of CHANNELS."""


@dataclass(frozen=True)
class FusedSource:
    """A fragment-shader body that computes exactly the requested maps, and what it must be given.

    Parameters
    ----------
    source : GLSL text without `#version`, uniforms and samplers. It includes files of the shaders folder and defines
        `Generated generate(Site site)`, a struct with a member per channel; channels that were not requested, or that
        no layer writes, have the values from which the skin starts
    members : (name, GLSL type) of the uniform block, in order; the source reads them as `p.NAME`. Equal stacks have
        equal members: a layer that is off leaves no trace
    numbers : one value per member: a number or a tuple
    textures : (sampler name, what it samples) for each sampler2D; level of detail is chosen by the shader, so mipmaps
        are needed. Uploaded with the texture's bottom row first, so that v runs upwards
    written : the requested maps that are not constant
    start : what each requested map holds where nothing is written
    on_surface : whether any layer reads the position, normal or footprint of the site
    reads : what is read of the site beside these: "occlusion", "curvature"
    generated : (name, text) of what the source includes beside the files of the shaders folder
    """

    source: str
    members: tuple[tuple[str, str], ...]
    numbers: tuple[Value, ...]
    textures: tuple[tuple[str, Texture], ...]
    written: frozenset[str]
    start: Mapping[str, tuple[float, ...]]
    on_surface: bool
    reads: frozenset[str]
    generated: tuple[tuple[str, str], ...] = ()


def active(layers: Iterable[Layer], maps: Collection[str]) -> list[Layer]:
    """Return the layers that show in at least one of the maps, bottom to top."""
    return [layer for layer in layers if _shows(layer) and layer.writes() & set(maps)]


def _shows(layer: Layer) -> bool:
    return layer.enabled and layer.opacity > 0 and (layer.mask is None or _shows(layer.mask))


def _computed(skin: Stack, maps: Collection[str]) -> tuple[list[Layer], list[str]]:
    """Return the layers to evaluate and the channels to compute for some maps, in the order of CHANNELS."""
    channels = set(maps)
    if skin.pigmentation is not None and "albedo" in channels:
        channels |= set(CHANNEL_OF.values())
    layers = active(skin.layers, channels)
    # Whoever looks at the heights below needs those who make them.
    if any("height" in layer.reads_of() or _blends_by_height(layer) for layer in layers):
        channels.add("height")
        layers = active(skin.layers, channels)
    return layers, [channel for channel in (*CHANNELS, *CHANNEL_OF.values()) if channel in channels]


def _blends_by_height(layer: Layer) -> bool:
    return isinstance(layer, Writing) and layer.blend == "height_blend"


def _starts(skin: Stack, channels: Collection[str]) -> dict[str, tuple[float, ...]]:
    amounts = {} if skin.pigmentation is None else skin.pigmentation.amounts
    pigments = {channel: (float(amounts.get(name, 0.0)),) for name, channel in CHANNEL_OF.items()}
    plain = {name: value for name, (_, value) in CHANNELS.items()}
    starts = plain | dict(skin.start) | pigments
    if skin.pigmentation is not None and "albedo" in channels:
        below = np.array([[pigments[channel][0] for channel in CHANNEL_OF.values()]])
        starts["albedo"] = tuple(map(float, skin.pigmentation.model.albedo(np.maximum(below, 0))[0]))
    return {channel: starts[channel] for channel in channels}


def fuse(skin: Stack, maps: Collection[str]) -> FusedSource:
    """Return the shader that computes the maps of a skin.

    Parameters
    ----------
    skin : the description
    maps : names of `CHANNELS`

    Raises
    ------
    LimitError : the layers sample more than `MAX_TEXTURES` different textures, or evaluate more than `MAX_PATTERNS`
    """
    layers, channels = _computed(skin, maps)
    writer = _Writer(skin, channels)
    for index, layer in enumerate(layers):
        writer.layer(f"layer{index}", layer)
    if len(writer.samplers) > MAX_TEXTURES:
        raise LimitError(
            f"the layers of a skin sample {len(writer.samplers)} images; at most {MAX_TEXTURES} are allowed; "
            "merge some of them into one file"
        )
    if writer.patterns > MAX_PATTERNS:
        raise LimitError(
            f"the layers of a skin and their masks evaluate {writer.patterns} patterns; at most {MAX_PATTERNS} are "
            "allowed, beyond which drivers take minutes to compile them; generate a part of them to files, and lay "
            "these as image layers"
        )
    written = {channel for layer in layers for channel in layer.writes()}
    if written & set(CHANNEL_OF.values()):
        written.add("albedo")
    return FusedSource(
        writer.text(),
        tuple(writer.members),
        tuple(writer.numbers),
        tuple((name, texture) for texture, name in writer.samplers.items()),
        frozenset(written & set(maps)),
        _starts(skin, maps),
        any(layer.on_surface() for layer in layers),
        frozenset().union(*(layer.reads_of() for layer in layers)) - {"height"},
        (("generated/pigments", skin.pigmentation.model.glsl()),) if skin.pigmentation and writer.pigmented else (),
    )


@dataclass
class _Writer:
    """Collects the parts of the shader while the stack is walked."""

    skin: Stack
    channels: Sequence[str]
    kernels: dict[str, list[str]] = field(default_factory=dict)
    members: list[tuple[str, str]] = field(default_factory=list)
    numbers: list[Value] = field(default_factory=list)
    samplers: dict[Texture, str] = field(default_factory=dict)
    body: list[str] = field(default_factory=list)
    #: what is done to albedo after all pigments are laid
    paint: list[str] = field(default_factory=list)
    block: int = 0
    #: calls of layers' functions
    patterns: int = 0

    @property
    def pigmented(self) -> bool:
        """Whether albedo is made of pigments, so that paint waits until all of them are laid."""
        return self.skin.pigmentation is not None and "albedo" in self.channels

    def member(self, name: str, value: float | int | tuple[float, ...]) -> str:
        """Add a number to the uniform block and return the expression that reads it."""
        # In std140 nothing takes more than 16 bytes, and four small numbers may share them.
        self.block += 16 if isinstance(value, tuple) else 4
        if self.block > MAX_BLOCK:
            return _literal(value)
        self.members.append((name, _glsl_type(value)))
        self.numbers.append(value)
        return f"p.{name}"

    def layer(self, name: str, layer: Layer) -> None:
        """Append the statements of one layer."""
        # Evaluated once, at function scope: paint over pigments reads it again at the end.
        weight = self.weight(name, layer)
        channels = {channel: source for channel, source in layer.channels().items() if channel in self.channels}
        pattern = ""
        if layer.kernel is not None and any(not isinstance(source, Flat) for source in channels.values()):
            pattern = self.pattern(name, layer, weight if layer.mask is not None else None)
        values = {
            channel: self.value(f"{name}_{channel}", channel, source, layer, name, pattern)
            for channel, source in channels.items()
        }
        if _blends_by_height(layer):
            assert isinstance(layer, Writing)
            contrast = self.member(f"{name}_contrast", layer.contrast)
            own = values.get("height", "height")
            covered = f"{name}_covered"
            self.body.append(f"float {covered} = {weight} * height_coverage({own}, height, {contrast});")
            weight = covered
        for channel, value in values.items():
            joined = self.joined(layer, channel, value, weight)
            (self.paint if channel == "albedo" and self.pigmented else self.body).append(f"{channel} = {joined};")

    def joined(self, layer: Layer, channel: str, value: str, weight: str) -> str:
        """Return the expression for a channel after a layer."""
        by_height = _blends_by_height(layer)
        if channel in BLENDED:
            assert isinstance(layer, Writing)
            return blend.expression(layer.blending(), layer.space, channel, value, weight)
        if channel == "scattering_radius" or (channel == "height" and by_height):
            return f"mix({channel}, {value}, {weight})"
        return f"{channel} + {weight} * {value}"

    def value(self, name: str, channel: str, source: Flat | Ramp | Own, layer: Layer, of: str, pattern: str) -> str:
        """Return the expression for what a channel receives."""
        if isinstance(source, Flat):
            return self.member(name, source.value)
        if isinstance(source, Ramp):
            low, high = self.member(f"{name}_low", source.low), self.member(f"{name}_high", source.high)
            return f"mix({low}, {high}, {pattern})"
        value = f"{of}_value"
        if channel == "slope":
            return f"{value}.xy"
        if CHANNELS[channel][0] == "float":
            return pattern
        return f"{value}.rgb" if layer.kernel == "vec4" else f"vec3({pattern})"

    def weight(self, name: str, layer: Layer) -> str:
        """Return the expression for opacity times mask."""
        opacity = self.member(f"{name}_opacity", layer.opacity)
        if layer.mask is None:
            return opacity
        mask = f"{name}_mask"
        inner = self.weight(mask, layer.mask)
        pattern = self.pattern(mask, layer.mask, inner if layer.mask.mask is not None else None)
        # The numbers of a picture may lie anywhere.
        self.body.append(f"float {name}_weight = {opacity} * {inner} * clamp({pattern}, 0.0, 1.0);")
        return f"{name}_weight"

    def pattern(self, name: str, layer: Layer, weight: str | None) -> str:
        """Append the evaluation of a layer's function; return the expression for its pattern t.

        Where a weight is given, the function is called only where that is not 0.
        """
        place, value = f"{name}_site", f"{name}_value"
        pattern = value + (".w" if layer.kernel == "vec4" else "")
        self.body.append(f"{layer.kernel} {value} = {layer.kernel}(0.0);")
        band = band_of(layer, self.ground) if isinstance(layer, Pattern) else None
        if weight is not None:
            self.body.append(f"if ({weight} > 0.0)")
        self.body += ["{", f"    Site {place} = site;"]
        if isinstance(layer, Pattern) and layer.warp > 0:
            numbers = [
                self.member(f"{name}_warp_{key}", value) for key, value in warp_values(layer, self.ground).items()
            ]
            self.kernels.setdefault("", ['#include "lib/noise.glsl"'])
            self.body.append(f"    {place}.position = warp_position(site.position, {', '.join(numbers)});")
        if "height" in layer.reads:
            self.body.append(f"    {place}.height = height;")
        arguments = self.arguments(name, layer, place)
        looked = f"{layer.kind()}_layer({arguments})"
        curve = layer.curve if isinstance(layer, Pattern) and not layer.curve_is_in_texture() else None
        numbers_of_curve = {} if curve is None else remap.members(curve)
        for key, row in numbers_of_curve.items():
            self.body.append(f"    vec4 {name}_curve_{key} = {self.member(f'{name}_curve_{key}', row)};")
        if band is None:
            self.body.append(f"    {value} = {looked};")
            if curve is not None:
                self.body.append(f"    {pattern} = {remap.call(f'{name}_curve', pattern)};")
        else:
            remapped = looked if curve is None else remap.call(f"{name}_curve", looked)
            members = {key: self.member(f"{name}_{key}", numbers) for key, numbers in band.members().items()}
            mean = f"band_mean({members['mean']}, site.normal)"
            if _overrides_local(layer):
                mean += f" * {layer.kind()}_local({arguments})"
            self.kernels.setdefault("filter", ['#include "lib/filter.glsl"'])
            self.body += [
                f"    vec4 {name}_band = {members['band']};",
                f"    float {name}_shown = band_shown({name}_band, site.footprint);",
                f"    int {name}_count = {name}_shown > 0.0 ? band_places({name}_band, site.footprint) : 0;",
                f"    vec3 {name}_center = {place}.position;",
                f"    {value} = {mean};",
                f"    {place}.footprint = min(site.footprint / float(max({name}_count, 1)), {name}_band.y);",
                f"    float {name}_sum = 0.0;",
                f"    for (int i = 0; i < {name}_count * {name}_count; ++i) {{",
                f"        vec3 offset = place_in_texel(site.normal, site.footprint, i, {name}_count);",
                f"        {place}.position = {name}_center + offset;",
                f"        {name}_sum += {remapped};",
                "    }",
                f"    {name}_sum /= float(max({name}_count * {name}_count, 1));",
                f"    {value} = mix({value}, {name}_sum, {name}_shown);",
            ]
        self.body.append("}")
        return pattern

    @property
    def ground(self) -> Ground:
        """What all layers share."""
        return self.skin.ground

    def arguments(self, name: str, layer: Layer, place: str) -> str:
        """Return the arguments of a layer's function: its values, the site and its textures."""
        kind, values = layer.kind(), layer.values(self.ground)
        self.patterns += 1
        arguments = []
        for key, value in values.items():
            if isinstance(value, IntEnum):
                arguments.append(f"{kind.upper()}_{value.name}")
            else:
                arguments.append(self.member(f"{name}_{key}", value))
        if kind not in self.kernels:
            self.kernels[kind] = _declarations(kind, values)
        samplers = [
            self.samplers.setdefault(item, f"image{len(self.samplers)}") for item in layer.textures(self.ground)
        ]
        numbers = ", ".join(arguments)
        return ", ".join([f"{kind}_values({numbers})", place, *samplers])

    def text(self) -> str:
        """Return the whole source."""
        starts = _starts(self.skin, [*CHANNELS, *self.channels])
        types = {channel: kind for channel, (kind, _) in CHANNELS.items()}
        lines = ["#define TILEABLE"] if self.ground.period is not None else []
        lines += ['#include "lib/site.glsl"', '#include "lib/blend.glsl"', '#include "lib/curve.glsl"']
        lines += [line for kernel in self.kernels.values() for line in kernel]
        laid = ""
        if self.pigmented:
            lines.append('#include "lib/pigment.glsl"')
            amounts = [f"max({channel}, 0.0)" for channel in CHANNEL_OF.values()]
            laid = f"albedo = pigment_albedo(vec4({', '.join(amounts[:4])}), vec4({', '.join(amounts[4:])}));"
        lines += ["struct Generated {", *(f"    {kind} {channel};" for channel, kind in types.items()), "};"]
        lines.append("Generated generate(Site site) {")
        for channel, value in starts.items():
            kind = types.get(channel, "float")
            lines.append(f"    {kind} {channel} = {_literal(value if kind != 'float' else value[0])};")
        pigments_written = any(line.startswith("pigment_") for line in self.body)
        body = [*self.body, *([laid] if pigments_written else []), *self.paint]
        lines += [f"    {line}" for line in body]
        lines += [f"    return Generated({', '.join(CHANNELS)});", "}"]
        return "\n".join(lines) + "\n"


def _overrides_local(layer: Layer) -> bool:
    """Whether the mean of a layer's pattern differs from place to place."""
    return isinstance(layer, Pattern) and type(layer).local.__func__ is not Pattern.local.__func__  # type: ignore[attr-defined]


def _glsl_type(value: float | int | tuple[float, ...]) -> str:
    if isinstance(value, tuple):
        return f"vec{len(value)}"
    return "int" if isinstance(value, int) else "float"


def _literal(value: float | int | tuple[float, ...]) -> str:
    if isinstance(value, tuple):
        return f"vec{len(value)}({', '.join(repr(float(number)) for number in value)})"
    return f"({value!r})"


def _declarations(kind: str, values: Mapping[str, Value]) -> list[str]:
    """Return the constants of a layer's choices, the struct of its values, and the include of its function.

    A choice is a constant and not a uniform, so that the compiler drops the branches which are not taken.
    """
    choices = {type(value): None for value in values.values() if isinstance(value, IntEnum)}
    lines = [f"const int {kind.upper()}_{option.name} = {option.value};" for choice in choices for option in choice]
    types = {key: "int" if isinstance(value, IntEnum) else _glsl_type(value) for key, value in values.items()}
    lines.append(f"struct {kind}_values {{ {' '.join(f'{glsl} {key};' for key, glsl in types.items())} }};")
    return [*lines, f'#include "layers/{kind}.glsl"']


def warp_values(layer: Pattern, ground: Ground) -> dict[str, float | int]:
    """Return the numbers of `warp_position`: amount, size and period of the swirls, seed."""
    scale, period = ground.fit(layer.size() if layer.warp_scale is None else layer.warp_scale)
    return {"amount": layer.warp, "scale": scale, "period": period, "seed": joint_seed(ground.seed, layer.seed)}


def twin_stack(skin: Stack, maps: Collection[str], site: Site, textures: Mapping[Texture, Array]) -> dict[str, Array]:
    """Return the maps of a skin at some points, in float64.

    Parameters
    ----------
    skin : the description
    maps : names of `CHANNELS`
    site : n points
    textures : (h, w, c) pixels of each texture of the skin, top row first

    Returns
    -------
    map -> (n, 3) albedo, (n,) height in mm, (n,) reflectance, roughness and specular, (n, 3) scattering radius in mm,
    (n, 2) slope
    """
    layers, channels = _computed(skin, maps)
    count = len(site["position"])
    results = {channel: np.tile(np.array(value), (count, 1)) for channel, value in _starts(skin, channels).items()}
    pigmented = skin.pigmentation is not None and "albedo" in channels
    paint = []
    for layer in layers:
        below = site if "height" not in results else {**site, "height": results["height"][:, 0]}
        look = _Look(skin, below, textures)
        weight = look.weight(layer)[:, None]
        value = None if layer.kernel is None else look.evaluate(layer)
        new = {c: _value(c, source, layer, value) for c, source in layer.channels().items() if c in results}
        if _blends_by_height(layer):
            assert isinstance(layer, Writing)
            own = new.get("height", results["height"])
            weight = weight * blend.height_coverage(own, results["height"], layer.contrast)
        for channel, arriving in new.items():
            if channel == "albedo" and pigmented:
                paint.append((layer, arriving, weight))
            else:
                results[channel] = _joined(layer, channel, results[channel], arriving, weight)
    if pigmented:
        assert skin.pigmentation is not None
        amounts = np.concatenate([results.pop(channel) for channel in CHANNEL_OF.values()], axis=1)
        albedo = skin.pigmentation.model.albedo(np.maximum(amounts, 0))
        results["albedo"] = reduce(lambda below, step: _joined(step[0], "albedo", below, *step[1:]), paint, albedo)
    return {
        channel: results[channel][:, 0] if CHANNELS[channel][0] == "float" else results[channel] for channel in maps
    }


def _joined(layer: Layer, channel: str, below: Array, new: Array, weight: Array) -> Array:
    if channel in BLENDED:
        assert isinstance(layer, Writing)
        return blend.apply_in(layer.space, layer.blending(), below, np.broadcast_to(new, below.shape), weight)
    if channel == "scattering_radius" or (channel == "height" and _blends_by_height(layer)):
        return (1 - weight) * below + weight * new
    return below + weight * new


@dataclass(frozen=True)
class _Look:
    """The points of a twin and what its layers may sample."""

    skin: Stack
    site: Site
    textures: Mapping[Texture, Array]

    def evaluate(self, layer: Layer) -> Array:
        """Return (n,) or (n, 4): a layer's function, with its pattern remapped."""
        site = self.site
        if isinstance(layer, Pattern) and layer.warp > 0:
            numbers: Any = warp_values(layer, self.skin.ground)
            site = {**site, "position": hashing.warp_position(site["position"], **numbers)}
        textures = [self.textures[item] for item in layer.textures(self.skin.ground)]
        if isinstance(layer, Pattern):
            return seen(layer, self.skin.ground, site, textures)
        return layer.twin(layer.values(self.skin.ground), site, textures)

    def weight(self, layer: Layer) -> Array:
        """Return (n,) opacity times mask."""
        weight = np.full(len(self.site["position"]), layer.opacity)
        if layer.mask is not None:
            pattern = self.evaluate(layer.mask)
            share = np.clip(pattern if pattern.ndim == 1 else pattern[:, 3], 0, 1)
            weight = weight * self.weight(layer.mask) * share
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
    if channel == "slope":
        return value[:, :2]
    if CHANNELS[channel][0] == "float" or value.ndim == 1:
        return pattern
    return value[:, :3]
