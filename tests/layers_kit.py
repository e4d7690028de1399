"""What the tests of layers share: points to look at, layers drawn and computed, and the laws that all patterns obey."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.layers.base import Ground, Layer, Pattern, Site, Texture
from skincli.layers.base import site as site_of
from skincli.layers.filtering import seen
from skincli.layers.image import Picture
from skincli.layers.stack import CHANNELS, fuse, twin_stack
from skincli.scene.skin import Skin

Array = NDArray[Any]

ALL = frozenset(CHANNELS)
OUTPUTS = ("first", "second", "third")
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
    """Return what the twin of a skin shows of a layer at some points."""
    ground = ground or Ground()
    textures = [np.asarray(texture.make(), float) for texture in layer.textures(ground)]
    if isinstance(layer, Pattern):
        return seen(layer, ground, site, textures)
    return layer.twin(layer.values(ground), site, textures)


def made(textures: Iterable[Texture], pictures: Mapping[Path, Array] | None) -> dict[Texture, Array]:
    """Return the pixels of textures; those of files are given by the test."""
    return {
        texture: (pictures or {})[texture.file] if isinstance(texture, Picture) else np.asarray(texture.make())
        for texture in textures
    }


class Drawn:
    """The fused shader of a skin, which draws any number of points; release it at the end."""

    def __init__(
        self, ctx: Any, skin: Skin, maps: frozenset[str] = ALL, pictures: Mapping[Path, Array] | None = None
    ) -> None:
        import moderngl

        from skincli.gpu.blocks import FreeValues
        from skincli.gpu.program import expand

        self.ctx, fused = ctx, fuse(skin, maps)
        values = FreeValues(fused.members, fused.numbers)
        names = ["site_position", "site_normal", "site_more", *(name for name, _ in fused.textures)]
        head = [
            "#version 330 core",
            values.layout.glsl(),
            *(f"uniform sampler2D {name};" for name in names),
            *(f"layout(location = {index}) out vec4 {name};" for index, name in enumerate(OUTPUTS)),
        ]
        body = expand("main", {"main": MAIN, "generated/layers": fused.source}).text
        self.program = ctx.program(vertex_shader=TRIANGLE, fragment_shader="\n".join(head) + "\n" + body)
        for unit, name in enumerate(names):
            if name in self.program:
                self.program[name] = unit
        pixels = made((item for _, item in fused.textures), pictures)
        self.textures = []
        for _, item in fused.textures:
            texture = self.upload(pixels[item][::-1])
            texture.build_mipmaps()
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = item.repeat
            self.textures.append(texture)
        self.block = ctx.buffer(values.packed or bytes(16))
        if fused.members:
            assert self.program["Values"].size == len(values.packed)
        self.triangle = ctx.vertex_array(self.program, [])

    def upload(self, array: Array) -> Any:
        size, channels = array.shape[1::-1], array.shape[2]
        return self.ctx.texture(size, channels, array.astype("f4").tobytes(), dtype="f4", alignment=1)

    def __call__(self, site: Site) -> dict[str, Array]:
        """Return all channels of a square of points."""
        import moderngl

        from skincli.gpu.context import rest

        side = round(len(site["position"]) ** 0.5)
        tables = (
            np.column_stack([site["position"], site["footprint"]]),
            np.column_stack([site["normal"], site["footprint_uv"]]),
            np.column_stack([site["uv"], site["occlusion"], site["curvature"]]),
        )
        places = [self.upload(table.reshape(side, side, 4)) for table in tables]
        for texture in places:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        for unit, texture in enumerate([*places, *self.textures]):
            texture.use(unit)
        targets = [self.ctx.texture((side, side), 4, dtype="f4") for _ in OUTPUTS]
        framebuffer = self.ctx.framebuffer(targets)
        self.block.bind_to_uniform_block(0)
        framebuffer.use()
        self.triangle.render(vertices=3)
        first, second, third = (np.frombuffer(each.read(), "f4").reshape(-1, 4).astype(np.float64) for each in targets)
        rest()
        for thing in (framebuffer, *targets, *places):
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

    def release(self) -> None:
        for thing in (*self.textures, self.triangle, self.block, self.program):
            thing.release()


def draw(
    ctx: Any,
    skin: Skin,
    site: Site,
    maps: frozenset[str] = ALL,
    pictures: Mapping[Path, Array] | None = None,
) -> dict[str, Array]:
    """Return the maps that the fused shader writes; all channels, whatever was asked for."""
    drawn = Drawn(ctx, skin, maps, pictures)
    found = drawn(site)
    drawn.release()
    return found


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
RATIOS = (32, 16, 11, 8, 4, 2, 1, 0.7, 0.5, 0.35, 0.25, 0.18, 0.125)


def assert_resolution_law(
    layer: Pattern,
    rms: float = 0.01,
    maximum: float = 0.05,
    ratios: Iterable[float] = RATIOS,
    look: Callable[[Site], Array] | None = None,
) -> None:
    """Twice the resolution, averaged 2x2, agrees with the lower one, whatever the size of a texel.

    Parameters
    ----------
    rms, maximum : differences that are allowed
    look : what makes the pattern of points; left out: the twin
    """
    side, broken = 24, []
    look = look or (lambda site: evaluate(layer, site))
    for ratio in ratios:
        size = layer.size() / ratio * side
        coarse, fine = (look(flat(count, size, size / count)).reshape(count, count) for count in (side, 2 * side))
        error = coarse - fine.reshape(side, 2, side, 2).mean(axis=(1, 3))
        found = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
        if found[0] > rms or found[1] > maximum:
            broken.append(f"{ratio:.3g} texels: RMS {found[0]:.4f}, maximum {found[1]:.4f}")
    assert not broken, f"{layer.kind()}: {'; '.join(broken)}"


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
