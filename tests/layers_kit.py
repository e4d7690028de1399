"""What the tests of layers share: points to look at, layers drawn and computed, and the laws that all patterns obey."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.layers.base import Ground, Layer, Site, Texture
from skincli.layers.base import site as site_of
from skincli.layers.image import Picture
from skincli.layers.stack import CHANNELS, fuse, twin_stack
from skincli.scene.skin import Skin

Array = NDArray[Any]

ALL = frozenset(CHANNELS)
SIDE = 64

TRIANGLE = """#version 330 core
void main() { gl_Position = vec4(ivec2(gl_VertexID & 1, gl_VertexID >> 1) * 4 - 1, 0, 1); }
"""
MAIN = """#include "generated/layers"
void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 place = texelFetch(site_position, texel, 0);
    vec4 normal = texelFetch(site_normal, texel, 0);
    vec4 more = texelFetch(site_more, texel, 0);
    Generated made = generate(Site(place.xyz, normal.xyz, more.xy, place.w, normal.w, 0.0, more.z, more.w));
    first = vec4(made.albedo, made.height);
    second = vec4(made.scattering_radius, made.reflectance);
    third = vec4(made.slope, made.roughness, made.specular);
}
"""


def stack(*layers: dict[str, Any], seed: int = 5, **settings: Any) -> Skin:
    """Return a skin of these layers, bottom to top."""
    return Skin.model_validate({"skin": 1, "seed": seed, "layers": list(layers), **settings})


def flat(side: int, size: float, footprint: float = 0.0) -> Site:
    """Return side x side points of a square of `size` mm in the plane z = 0, first row at the bottom."""
    v, u = (np.mgrid[0:side, 0:side].reshape(2, -1) + 0.5) / side
    count = len(u)
    return site_of(
        position=np.column_stack([u, v, np.zeros(count)]) * size,
        normal=np.tile([0.0, 0.0, 1.0], (count, 1)),
        footprint=np.full(count, footprint),
        uv=np.column_stack([u, v]),
        footprint_uv=np.full(count, 1 / side),
    )


def square(side: int = SIDE, step: float = 0.25, start: tuple[float, float, float] = (0, 0, 0)) -> Site:
    """Return a flat map of side x side texels of `step` mm, first row at the bottom, in numbers of float32."""
    site = flat(side, side * step, step)
    return single({**site, "position": site["position"] + start})  # type: ignore[typeddict-item]


def cloud(reach: float, footprint: float = 0.0, seed: int = 8) -> Site:
    """Return SIDE x SIDE points all around the origin, up to `reach` mm along each axis, in numbers of float32.

    Normals have all directions, footprints are 0 to `footprint` mm, and everything else varies too.
    """
    rng = np.random.default_rng(seed)
    count = SIDE * SIDE
    normal = rng.standard_normal((count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return single(
        site_of(
            position=rng.uniform(-reach, reach, (count, 3)),
            normal=normal,
            footprint=rng.uniform(0, footprint, count),
            uv=flat(SIDE, 1)["uv"],
            footprint_uv=np.full(count, 1 / SIDE),
            occlusion=rng.uniform(0, 1, count),
            curvature=rng.uniform(-0.5, 0.5, count),
        )
    )


def single(site: Site) -> Site:
    """Return points rounded to float32, which is what a shader is given."""
    return {key: array.astype(np.float32).astype(np.float64) for key, array in site.items()}  # type: ignore[return-value, attr-defined]


def evaluate(layer: Layer, site: Site, ground: Ground | None = None) -> Array:
    """Return what a layer's twin makes of some points."""
    ground = ground or Ground()
    return layer.twin(layer.values(ground), site, [texture.make() for texture in layer.textures(ground)])


def made(textures: Iterable[Texture], pictures: Mapping[Path, Array] | None) -> dict[Texture, Array]:
    """Return the pixels of textures; those of files are given by the test."""
    return {
        texture: (pictures or {})[texture.file] if isinstance(texture, Picture) else np.asarray(texture.make())
        for texture in textures
    }


def draw(
    ctx: Any,
    skin: Skin,
    site: Site,
    maps: frozenset[str] = ALL,
    pictures: Mapping[Path, Array] | None = None,
) -> dict[str, Array]:
    """Return the maps that the fused shader writes; all channels, whatever was asked for."""
    import moderngl

    from skincli.gpu.blocks import FreeValues
    from skincli.gpu.context import rest
    from skincli.gpu.program import expand

    fused = fuse(skin, maps)
    values = FreeValues(fused.members, fused.numbers)
    names = ["site_position", "site_normal", "site_more", *(name for name, _ in fused.textures)]
    outputs = ("first", "second", "third")
    head = [
        "#version 330 core",
        values.layout.glsl(),
        *(f"uniform sampler2D {name};" for name in names),
        *(f"layout(location = {index}) out vec4 {name};" for index, name in enumerate(outputs)),
    ]
    body = expand("main", {"main": MAIN, "generated/layers": fused.source}).text
    program = ctx.program(vertex_shader=TRIANGLE, fragment_shader="\n".join(head) + "\n" + body)
    side = round(len(site["position"]) ** 0.5)

    def upload(array: Array) -> Any:
        return ctx.texture(array.shape[1::-1], array.shape[2], array.astype("f4").tobytes(), dtype="f4", alignment=1)

    tables = (
        np.column_stack([site["position"], site["footprint"]]),
        np.column_stack([site["normal"], site["footprint_uv"]]),
        np.column_stack([site["uv"], site["occlusion"], site["curvature"]]),
    )
    textures = [upload(table.reshape(side, side, 4)) for table in tables]
    for texture in textures:
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    pixels = made((item for _, item in fused.textures), pictures)
    for _, item in fused.textures:
        texture = upload(pixels[item][::-1])
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = item.repeat
        textures.append(texture)
    targets = [ctx.texture((side, side), 4, dtype="f4") for _ in outputs]
    framebuffer = ctx.framebuffer(targets)
    for unit, (name, texture) in enumerate(zip(names, textures, strict=True)):
        if name in program:
            program[name] = unit
        texture.use(unit)
    block = ctx.buffer(values.packed or bytes(16))
    if fused.members:
        assert program["Values"].size == len(values.packed)
        block.bind_to_uniform_block(0)
    framebuffer.use()
    triangle = ctx.vertex_array(program, [])
    triangle.render(vertices=3)
    first, second, third = (np.frombuffer(target.read(), "f4").reshape(-1, 4).astype(np.float64) for target in targets)
    rest()
    for thing in (framebuffer, *targets, *textures, triangle, block, program):
        thing.release()
    return {
        "albedo": first[:, :3],
        "height": first[:, 3],
        "scattering_radius": second[:, :3],
        "reflectance": second[:, 3],
        "slope": third[:, :2],
        "roughness": third[:, 2],
        "specular": third[:, 3],
    }


def assert_twin(
    ctx: Any,
    skin: Skin,
    site: Site,
    tolerance: float,
    pictures: Mapping[Path, Array] | None = None,
    share: float = 0.0,
) -> dict[str, Array]:
    """Hold the fused shader against its twin; return what the shader drew.

    Parameters
    ----------
    tolerance : largest difference of any channel
    pictures : (h, w, c) pixels of the files that the layers name
    share : share of the points that may differ by more, where float32 falls on the other side of a threshold
    """
    found = draw(ctx, skin, site, pictures=pictures)
    expected = twin_stack(skin, ALL, site, made((item for _, item in fuse(skin, ALL).textures), pictures))
    for channel, value in expected.items():
        error = np.abs(found[channel] - value).reshape(len(value), -1).max(axis=1)
        assert np.mean(error > tolerance) <= share, f"{channel}: {error.max():.2g} at most, {tolerance:g} allowed"
    return found


#: Size of a layer's features in texels: from far above a texel to far below.
RATIOS = tuple(2.0**step for step in range(6, -5, -1))


def resolution_errors(layer: Layer, ratio: float, side: int = 14) -> tuple[float, float]:
    """Return how far a map is from one of twice the resolution, averaged 2x2: RMS and maximum.

    Parameters
    ----------
    ratio : size of the layer's features, texels
    side : texels along a side of the coarser map
    """
    size = layer.size() / ratio * side  # type: ignore[attr-defined]
    coarse = evaluate(layer, flat(side, size, size / side)).reshape(side, side)
    fine = evaluate(layer, flat(2 * side, size, size / (2 * side))).reshape(side, 2, side, 2).mean(axis=(1, 3))
    return float(np.sqrt(np.mean((coarse - fine) ** 2))), float(np.abs(coarse - fine).max())


def assert_resolution_law(
    layer: Layer, rms: float = 0.01, maximum: float = 0.05, ratios: Iterable[float] = RATIOS
) -> None:
    """Twice the resolution, averaged 2x2, agrees with the lower one, whatever the size of a texel."""
    found = {ratio: resolution_errors(layer, ratio) for ratio in ratios}
    broken = {ratio: errors for ratio, errors in found.items() if errors[0] > rms or errors[1] > maximum}
    told = "; ".join(f"{ratio:.3g} texels: RMS {a:.4f}, maximum {b:.4f}" for ratio, (a, b) in broken.items())
    assert not broken, f"{layer.kind()}: {told}"


def assert_tileable(layer: Layer, period: float = 30.0, side: int = 96) -> None:
    """A map that repeats has no step at its border that is larger than those inside."""
    ground = Ground(seed=3, period=period)
    t = evaluate(layer, flat(side, period, period / side), ground).reshape(side, side)
    for axis in (0, 1):
        inside = np.abs(np.diff(t, axis=axis)).max()
        across = np.abs(np.take(t, 0, axis) - np.take(t, -1, axis)).max()
        assert inside > 0
        assert across <= 1.25 * inside
    site = flat(side, period, period / side)
    moved: Site = {**site, "position": site["position"] + np.array([period, -2 * period, 0])}  # type: ignore[typeddict-item]
    np.testing.assert_allclose(evaluate(layer, moved, ground), t.ravel(), atol=1e-9)
