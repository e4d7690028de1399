"""Pictures as layers, in float64: settings, exact texels, what is too fine, and synthesis that keeps the histogram."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy import ndimage

from skincli import images
from skincli.errors import InputError
from skincli.layers import histogram
from skincli.layers.base import Ground, Site
from skincli.layers.base import site as site_of
from skincli.layers.image import Image
from skincli.mapset import MAPS, FoundMap, MapFolder
from tests.layers_kit import evaluate, flat

Array = NDArray[Any]


def written(folder: Path, pixels: Array) -> Path:
    """Write (h, w) or (h, w, c) as plain float32 numbers."""
    path = folder / "picture.exr"
    images.write_exr(path, {"beauty": pixels}, half=False, color_space="data")
    return path


def spots(side: int = 128, size: float = 4.0) -> Array:
    """Return a picture that repeats, 0 to 1, with a skewed histogram."""
    noise = ndimage.gaussian_filter(np.random.default_rng(4).standard_normal((side, side)), size, mode="wrap")
    return ((noise - noise.min()) / np.ptp(noise)) ** 2


def grey(layer: Image, site: Site, ground: Ground | None = None) -> Array:
    return evaluate(layer, site, ground)[:, 3]


def scattered(count: int, reach: float, footprint: float = 0.0) -> Site:
    """Return points of the plane z = 0."""
    rng = np.random.default_rng(2)
    return site_of(
        np.column_stack([rng.uniform(0, reach, (count, 2)), np.zeros(count)]),
        np.tile([0.0, 0.0, 1.0], (count, 1)),
        np.full(count, footprint),
    )


# --------------------------------------------------------------------------------------------------------- settings


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tile_size": 3.0, "tiles": 2.0}, "write one of them"),
        ({"tile": "triplanar"}, "add tile_size"),
        ({"warp": 1.0}, "write tile_size"),
        ({"range": [0, 2]}, "range is for the roles data and grey"),
        ({"role": "grey", "channel": "red"}, "choose the role data"),
        ({"role": "normal_gl", "tile_size": 4.0}, "write tiles in place"),
        ({"role": "normal_dx", "height": [0, 1]}, "only tilts the surface; remove height"),
        ({"role": "normal_gl", "range": [0, 2]}, "the role is normal_gl"),
        ({"into": ["roughness"], "roughness": [0, 1]}, "roughness is in `into`"),
        ({"tile": "wrap"}, "histogram_preserving"),
        ({"into": ["height"]}, "scattering_radius"),
    ],
)
def test_what_contradicts_itself_is_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Image.model_validate({"file": "a.png", **settings})


def test_a_folder_of_maps_makes_valid_layers() -> None:
    """With its own range each, every map that a manifest can name."""
    for name, kind in MAPS.items():
        found = FoundMap(kind, "a.exr", kind.role, (-0.3, 1.7) if kind.unit else (0.0, 1.0))
        for layer in MapFolder(Path(), {name: found}).layers():
            relief = "slope" if kind.scale == "direction" else "height"
            assert Image.model_validate(layer["image"]).writes() == {kind.into or relief}


@pytest.mark.parametrize(
    ("settings", "writes"),
    [
        ({}, {"albedo"}),
        ({"role": "grey"}, {"albedo"}),
        ({"role": "data"}, set()),
        ({"height": [0, 1]}, {"height"}),
        ({"role": "data", "into": ["scattering_radius", "specular"]}, {"scattering_radius", "specular"}),
        ({"role": "normal_gl"}, {"slope"}),
    ],
)
def test_what_is_written(settings: dict[str, Any], writes: set[str]) -> None:
    assert Image.model_validate({"file": "a.png", **settings}).writes() == writes


def test_only_what_is_random_depends_on_the_seed() -> None:
    layer = Image(file=Path("a.png"), role="color", tile_size=10.0)
    assert layer.values(Ground(1)) == layer.values(Ground(2))
    random = layer.model_copy(update={"tile": "histogram_preserving"})
    assert random.values(Ground(1)) != random.values(Ground(2))
    assert random.values(Ground(1)) == random.model_copy(update={"seed": 1}).values(Ground(0))


# ------------------------------------------------------------------------------------------------------------ files


@pytest.mark.parametrize("broken", [b"", b"no picture", b"\x89PNG\r\n\x1a\n" + bytes(40)])
def test_a_broken_file_is_refused(tmp_path: Path, broken: bytes) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(broken)
    with pytest.raises(ValidationError, match="that file"):
        Image.model_validate({"file": "a.png"}, context={"base": tmp_path, "roots": ()})


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "skin.png").touch()
    with pytest.raises(ValidationError, match=r"no such file.*skin\.png"):
        Image.model_validate({"file": "skim.png"}, context={"base": tmp_path, "roots": ()})


def test_a_file_of_alpha_alone_has_no_color(tmp_path: Path) -> None:
    path = tmp_path / "alpha.exr"
    spec = oiio.ImageSpec(4, 4, 1, oiio.FLOAT)
    spec.channelnames = ("A",)
    out: Any = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_image(np.full((4, 4, 1), 0.25, np.float32))
    assert out.close()
    with pytest.raises(InputError, match=r"has the channels A; .* needs R, G and B or one gray channel"):
        Image(file=path, role="color").textures(Ground())[0].make()
    # As a mask it is what it says.
    assert grey(Image(file=path, role="grey"), flat(8, 1)) == pytest.approx(0.25)


def test_one_texel_is_a_constant(tmp_path: Path) -> None:
    path = written(tmp_path, np.full((1, 1), 0.3))
    for tile in ("clamp", "repeat", "mirror", "histogram_preserving"):
        for size in ({"tiles": 2.5}, {"tile_size": 3.0}):
            layer = Image.model_validate({"file": path, "role": "grey", "tile": tile, **size})
            assert grey(layer, flat(16, 10, 0.6)) == pytest.approx(0.3, abs=1e-6)


# --------------------------------------------------------------------------------------------------------- sampling


@pytest.mark.parametrize("side", [48, 100, 128])
def test_texels_that_lie_on_texels_are_those(tmp_path: Path, side: int) -> None:
    """To the bit, whatever the number, although float32 coordinates miss the centers."""
    pixels = np.random.default_rng(3).normal(0, 40, (side, side)).astype(np.float32)
    site = flat(side, 1)
    uv = (site["uv"].astype(np.float32) * np.float32(1 + 1e-7)).astype(np.float64)
    found = grey(Image(file=written(tmp_path, pixels), role="grey"), {**site, "uv": uv})
    np.testing.assert_array_equal(found.reshape(side, side)[::-1], pixels)


def test_range_says_what_stored_numbers_mean(tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).uniform(-1, 2, (16, 16, 3)).astype(np.float32)
    path = written(tmp_path, pixels)
    found = evaluate(Image(file=path, role="data", range=(-2.0, 6.0), channel="green"), flat(16, 1))
    expected = -2 + 8 * pixels[::-1].reshape(-1, 3).astype(np.float64)
    np.testing.assert_allclose(found, np.column_stack([expected, expected[:, 1]]), atol=1e-12)


def test_a_coarse_map_is_the_mean_of_the_picture(tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).random((64, 64))
    layer = Image(file=written(tmp_path, pixels), role="grey")
    for side, tolerance in ((32, 0.002), (8, 0.001), (1, 1e-4)):
        means = pixels.reshape(side, 64 // side, side, 64 // side).mean(axis=(1, 3))
        np.testing.assert_allclose(grey(layer, flat(side, 1)).reshape(side, side)[::-1], means, atol=tolerance)


@pytest.mark.parametrize(
    ("tile", "ratios"), [("mirror", (200, 64, 20, 7, 3)), ("histogram_preserving", (200, 20, 5, 0.4))]
)
def test_a_map_is_the_mean_of_a_finer_one(tmp_path: Path, tile: str, ratios: tuple[float, ...]) -> None:
    """Texels per picture from far above its own to below one, at no special place."""
    layer = Image.model_validate(
        {"file": written(tmp_path, spots(128, 6)), "role": "grey", "tile": tile, "tile_size": 30}
    )

    def seen(side: int, size: float) -> Array:
        site = flat(side, size, size / side)
        return grey(layer, {**site, "position": site["position"] + np.array([3.7, 9.65, 0])})

    for ratio in ratios:
        side, size = 32, 30 / ratio * 32
        coarse = seen(side, size).reshape(side, side)
        fine = seen(2 * side, size).reshape(side, 2, side, 2).mean(axis=(1, 3))
        assert np.sqrt(np.mean((coarse - fine) ** 2)) < 0.01, ratio
        assert np.abs(coarse - fine).max() < 0.05, ratio


@pytest.mark.parametrize("tile", ["repeat", "mirror", "triplanar", "histogram_preserving"])
@pytest.mark.parametrize("size", [{"tiles": 2.6}, {}, {"tile_size": 13.0}])
def test_a_tileable_map_repeats(tmp_path: Path, tile: str, size: dict[str, float]) -> None:
    if tile == "triplanar" and "tile_size" not in size:
        return
    layer = Image.model_validate({"file": written(tmp_path, spots(64, 6)), "role": "grey", "tile": tile, **size})
    side, period = 64, 30.0
    ground = Ground(seed=3, period=period)
    site = flat(side, period, period / side)
    t = grey(layer, site, ground).reshape(side, side)
    inside = max(np.abs(np.diff(t, axis=axis)).max() for axis in (0, 1))
    assert inside > 0
    for axis in (0, 1):
        assert np.abs(np.take(t, 0, axis) - np.take(t, -1, axis)).max() <= inside
    moved: Site = {
        **site,
        "position": site["position"] + np.array([period, -2 * period, 0]),
        "uv": site["uv"] + np.array([1, -2]),
    }
    np.testing.assert_allclose(grey(layer, moved, ground), t.ravel(), atol=1e-9)


# -------------------------------------------------------------------------------------------------------- histogram


def autocorrelation(field: Array, step: int) -> float:
    field = field - field.mean()
    return float(np.mean(field[:, step:] * field[:, :-step]) / np.mean(field**2))


@pytest.mark.parametrize("projected", [False, True])
def test_synthesis_keeps_the_histogram(tmp_path: Path, projected: bool) -> None:
    """Over 10 000 pictures; by one projection, and where three are mixed."""
    pixels = spots()
    layer = Image.model_validate(
        {"file": written(tmp_path, pixels), "role": "grey", "tile": "histogram_preserving", "tile_size": 2}
    )
    site = scattered(20000, 200)
    if projected:
        site = {**site, "normal": np.tile([0.48, 0.64, 0.6], (20000, 1)), "position": site["position"] + [0, 0, 7]}
    found = grey(layer, site)
    shares = np.linspace(0.02, 0.98, 25)
    np.testing.assert_allclose(np.quantile(found, shares), np.quantile(pixels, shares), atol=0.01)
    assert found.mean() == pytest.approx(pixels.mean(), abs=0.005)
    assert found.std() == pytest.approx(pixels.std(), rel=0.04)
    assert found.min() >= pixels.min() - 1e-6
    assert found.max() <= pixels.max() + 1e-6


def test_synthesis_of_a_mask_keeps_its_share(tmp_path: Path) -> None:
    """A mixture of plain areas is made of plain areas: few values lie between."""
    pixels = (spots() > 0.35).astype(float)
    layer = Image.model_validate(
        {"file": written(tmp_path, pixels), "role": "grey", "tile": "histogram_preserving", "tile_size": 2}
    )
    found = grey(layer, scattered(20000, 200))
    assert found.mean() == pytest.approx(pixels.mean(), abs=0.015)
    assert np.mean((found > 0.1) & (found < 0.9)) < 0.12


def test_synthesis_keeps_color(tmp_path: Path) -> None:
    """Mean, covariance and range of three channels that depend on one another."""
    one, two = spots(), np.roll(spots(), 40, 0)
    pixels = np.stack([0.2 + 0.6 * one, 0.1 + 0.3 * one + 0.2 * two, 0.5 - 0.4 * one], axis=-1)
    layer = Image.model_validate({"file": written(tmp_path, pixels), "tile": "histogram_preserving", "tile_size": 2})
    found = evaluate(layer, scattered(20000, 200))[:, :3]
    colors = pixels.reshape(-1, 3)
    np.testing.assert_allclose(found.mean(axis=0), colors.mean(axis=0), atol=0.004)
    np.testing.assert_allclose(np.cov(found.T), np.cov(colors.T), atol=0.06 * np.cov(colors.T).max())
    assert (found >= colors.min(axis=0) - 1e-6).all()
    assert (found <= colors.max(axis=0) + 1e-6).all()


def test_synthesis_keeps_the_size_of_features_and_does_not_repeat(tmp_path: Path) -> None:
    pixels = spots(128, 4)
    layer = Image.model_validate(
        {"file": written(tmp_path, pixels), "role": "grey", "tile": "histogram_preserving", "tile_size": 128}
    )
    found = grey(layer, flat(256, 256, 1)).reshape(256, 256)
    for step in (2, 4, 8):
        assert autocorrelation(found, step) == pytest.approx(autocorrelation(pixels, step), abs=0.08)
    assert abs(autocorrelation(found, 128)) < 0.15


def test_synthesis_hides_the_edges_of_the_picture(tmp_path: Path) -> None:
    """From white at its right edge to black at its left there would be a whole step in one texel."""
    layer = Image.model_validate(
        {
            "file": written(tmp_path, np.tile(np.linspace(0, 1, 128), (128, 1))),
            "role": "grey",
            "tile": "histogram_preserving",
            "tile_size": 128,
        }
    )
    site = scattered(8192, 0)
    along = np.arange(8192) / 16
    for line in ([along, 0 * along, 0 * along], [0.3 * along, along, 0 * along]):
        found = grey(layer, {**site, "position": np.column_stack(line)})
        assert np.ptp(found) > 0.7
        assert np.abs(np.diff(found)).max() * 16 < 0.4


def test_equal_values_are_put_in_the_order_of_their_neighborhoods() -> None:
    mask = np.zeros((64, 64))
    mask[20:40, 20:40] = 1
    normal = histogram.gaussian_of(mask)
    assert normal[mask == 1].min() > normal[mask == 0].max()
    assert normal.std() == pytest.approx(1, abs=0.01)
    # From the middle of the square to its edge, and on from there.
    assert (np.diff(normal[30, 30:62]) < 0).all()


def test_a_picture_larger_than_is_sorted_is_reduced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(histogram, "MAX_SIDE", 32)
    made = histogram.prepare(spots(96)[..., None])
    assert made["gaussian"].shape == (32, 32, 1)
    assert made["table"].shape == (6 + 6, histogram.ENTRIES, 4)
