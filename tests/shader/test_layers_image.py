"""Pictures as layers: the shader against its twin, and what goes through files unchanged."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from skincli import images
from skincli.layers.base import Ground, Site
from skincli.layers.image import Image, Picture
from skincli.layers.stack import fuse
from skincli.pipeline import _texels
from tests.layers_kit import ALL, assert_twin, cloud, draw, flat, single, square, stack

Array = NDArray[Any]

#: Smooth, so 1e-5; a little more where a picture's steps, one per texel, are seen through float32 coordinates.
TOLERANCE = 2e-5


def picture(channels: int, side: int = 32) -> Array:
    """Return (side, side, channels) smooth noise that repeats, 0 to 1."""
    noise = np.random.default_rng(6).standard_normal((side, side, channels))
    noise = ndimage.gaussian_filter(noise, (2, 2, 0), mode="wrap")
    return ((noise - noise.min()) / np.ptp(noise)).astype(np.float32)


@pytest.mark.parametrize("tile", ["clamp", "repeat", "mirror", "triplanar"])
@pytest.mark.parametrize("size", [{"tiles": 2.5}, {"tiles": 0.5}, {"tile_size": 12}])
@pytest.mark.parametrize("role", ["color", "grey"])
def test_image_is_its_twin(ctx: Any, tile: str, size: dict[str, float], role: str) -> None:
    if tile == "triplanar" and "tile_size" not in size:
        return
    layer = {"file": "a.png", "role": role, "tile": tile, "into": ["albedo", "roughness"], "height": [0, 1], **size}
    pictures = {Path("a.png"): picture(4 if role == "color" else 1)}
    found = assert_twin(ctx, stack({"image": layer}), cloud(10, 4.0), TOLERANCE, pictures)
    assert np.ptp(found["height"]) > 0.25


def test_data_is_its_twin(ctx: Any) -> None:
    layer = {
        "file": "a.png",
        "role": "data",
        "range": [-1, 3],
        "channel": "alpha",
        "into": ["scattering_radius", "specular"],
        "tiles": 1.5,
    }
    found = assert_twin(ctx, stack({"image": layer}), square(), TOLERANCE * 4, {Path("a.png"): picture(4)})
    assert np.ptp(found["scattering_radius"]) > 2


@pytest.mark.parametrize("role", ["normal_gl", "normal_dx"])
@pytest.mark.parametrize("tile", ["repeat", "mirror"])
def test_normal_map_is_its_twin(ctx: Any, role: str, tile: str) -> None:
    skin = stack({"image": {"file": "a.png", "role": role, "tile": tile, "tiles": 2, "opacity": 0.5}})
    normals = picture(4)
    normals[..., 2] = 0.9
    assert_twin(ctx, skin, square(), 1e-4, {Path("a.png"): normals})


@pytest.mark.parametrize("size", [{"tiles": 3.3}, {"tile_size": 9}])
@pytest.mark.parametrize(("role", "footprint"), [("color", 0.0), ("grey", 0.2), ("grey", 6.0)])
def test_synthesis_is_its_twin(ctx: Any, tmp_path: Path, role: str, size: dict[str, float], footprint: float) -> None:
    path = tmp_path / "a.exr"
    images.write_exr(path, {"beauty": picture(3 if role == "color" else 1, 64)}, half=False)
    layer = {"file": str(path), "role": role, "tile": "histogram_preserving", "into": ["albedo"], "height": [0, 1]}
    found = assert_twin(ctx, stack({"image": {**layer, **size}}), cloud(20, footprint), 2e-4, share=0.001)
    assert np.ptp(found["height"]) > 0.1


def test_tileable_synthesis_is_its_twin(ctx: Any, tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    images.write_exr(path, {"beauty": picture(1, 64)}, half=False)
    layer = {"file": str(path), "role": "grey", "tile": "histogram_preserving", "tile_size": 7, "height": [0, 1]}
    skin = stack({"image": layer}, tileable=True, domain="uv", extent=16.0)
    assert_twin(ctx, skin, square(step=0.25), 2e-4, share=0.001)


@pytest.mark.parametrize("side", [48, 64])
def test_a_map_goes_through_a_float_file_unchanged(ctx: Any, tmp_path: Path, side: int) -> None:
    """To the bit: float32 heights far from 0 to 1, negative ones too, and the halves of all other maps."""
    rng = np.random.default_rng(9)
    maps: dict[str, Array] = {
        "height": rng.normal(0, 3, (side, side, 1)).astype(np.float32),
        "scattering_radius": rng.uniform(0, 30, (side, side, 3)).astype(np.float16),
        "albedo": rng.random((side, side, 3)).astype(np.float16),
        "roughness": rng.random((side, side, 1)).astype(np.float16),
    }
    roles: dict[str, dict[str, Any]] = {
        "height": {"role": "grey", "height": [0, 1]},
        "scattering_radius": {"role": "data", "into": ["scattering_radius"]},
        "albedo": {"role": "color", "into": ["albedo"]},
        "roughness": {"role": "grey", "into": ["roughness"]},
    }
    layers: list[dict[str, Any]] = []
    for name, pixels in maps.items():
        images.write_exr(tmp_path / f"{name}.exr", {"beauty": pixels}, half=False)
        layers.append({"image": {"file": str(tmp_path / f"{name}.exr"), **roles[name]}})
    skin = stack(*layers)
    loaded = {item.file: item.make() for _, item in fuse(skin, ALL).textures if isinstance(item, Picture)}
    found = draw(ctx, skin, single(flat(side, 20.0, 20.0 / side)), pictures=loaded)
    for name, pixels in maps.items():
        stored = found[name].astype(pixels.dtype).reshape(pixels.shape)[::-1]
        np.testing.assert_array_equal(stored, pixels, err_msg=name)


@pytest.mark.parametrize(("role", "up"), [("normal_gl", 1), ("normal_dx", -1)])
def test_normal_map_of_a_slope_gives_the_slope(ctx: Any, role: str, up: int) -> None:
    """A plane that rises 0.3 per distance along u and falls 0.4 along v."""
    normal = np.array([-0.3, 0.4 * up, 1.0, 0.0]) / np.sqrt(1.25)
    pictures = {Path("n.png"): np.tile(0.5 + 0.5 * normal, (4, 4, 1))}
    slope = draw(ctx, stack({"image": {"file": "n.png", "role": role}}), square(8), pictures=pictures)["slope"]
    np.testing.assert_allclose(slope, np.tile([0.3, -0.4], (64, 1)), atol=1e-5)


def test_a_texel_without_a_normal_stays_finite(ctx: Any, tmp_path: Path) -> None:
    """Outside the charts of a mesh there is no surface: the Site is all zeros there."""
    images.write_exr(tmp_path / "a.exr", {"beauty": picture(3)}, half=False)
    nowhere: Site = {key: np.zeros_like(array) for key, array in cloud(1).items()}  # type: ignore[assignment]
    for tile in ("repeat", "histogram_preserving"):
        layer = {"file": str(tmp_path / "a.exr"), "tile": tile, "tile_size": 5}
        found = draw(ctx, stack({"image": layer}), nowhere, pictures={tmp_path / "a.exr": picture(4)})
        assert all(np.isfinite(channel).all() for channel in found.values())


def test_a_picture_wider_than_the_driver_allows_keeps_its_mean(
    ctx: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
    width = min(30000, images.MAX_SIDE)
    if width <= limit:
        pytest.skip("this driver holds a picture of 30000 texels")
    pixels = np.random.default_rng(5).random((2, width, 1))
    images.write_exr(tmp_path / "wide.exr", {"beauty": pixels}, half=False)
    texture = Image(file=tmp_path / "wide.exr", role="grey").textures(Ground())[0]
    with caplog.at_level(logging.INFO, "skincli"):
        [reduced] = _texels(texture)
    assert reduced.shape == (2, limit, 1)
    np.testing.assert_allclose(reduced.mean(axis=(1, 2)), pixels.mean(axis=(1, 2)), atol=1e-6)
    assert f"{width} x 2" in caplog.text
