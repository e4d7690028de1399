"""Pictures through files and back, what is refused, and files that appear whole or not at all."""

from __future__ import annotations

import logging
import os
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from skincli import images
from skincli.color import luminance, srgb_decode, srgb_encode
from skincli.errors import InputError, LimitError, OutputError

RED, ALPHA = (200, 100, 255), 128
KINDS = {
    **{"uint8": oiio.UINT8, "uint16": oiio.UINT16, "uint32": oiio.UINT32, "int16": oiio.INT16, "int32": oiio.INT32},
    **{"float16": oiio.HALF, "float32": oiio.FLOAT, "float64": oiio.DOUBLE},
}


def store(path: Path, pixels: np.ndarray, names: tuple[str, ...] | None = None, **attributes: Any) -> Path:
    """Write `pixels` as they are, in their own type, through OpenImageIO."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], KINDS[pixels.dtype.name])
    if names:
        spec.channelnames = names
        spec.alpha_channel = names.index("A") if "A" in names else -1
    for key, value in attributes.items():
        spec.attribute(key.replace("__", ":"), value)
    out: Any = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(pixels), out.geterror()
    assert out.close()
    return path


def channels_of(path: Path) -> dict[str, tuple[np.ndarray, str]]:
    """Return each channel of a file with the name of its stored type."""
    source: Any = oiio.ImageInput.open(str(path))
    spec = source.spec()
    pixels = source.read_image(oiio.FLOAT)
    formats = [str(f) for f in spec.channelformats] or [str(spec.format)] * spec.nchannels
    source.close()
    return {name: (pixels[..., i], formats[i]) for i, name in enumerate(spec.channelnames)}


def rgba8(rows: int = 2, columns: int = 3) -> np.ndarray:
    return np.full((rows, columns, 4), (*RED, ALPHA), np.uint8)


# ------------------------------------------------------------------------------------------------------------ color


def test_every_8_bit_code_is_decoded_exactly(tmp_path: Path) -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    read = images.read_color(store(tmp_path / "a.png", codes))
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read[..., :3], srgb_decode(codes / 255.0).astype(np.float32))
    assert read[..., 3].min() == 1.0


def test_16_bit_color_is_decoded_and_exr_is_not(tmp_path: Path) -> None:
    codes = np.random.default_rng(1).integers(0, 65536, (5, 7, 3), dtype=np.uint16)
    np.testing.assert_array_equal(
        images.read_color(store(tmp_path / "a.tif", codes))[..., :3], srgb_decode(codes / 65535.0).astype(np.float32)
    )
    light = (np.random.default_rng(2).random((5, 7, 3)) * 9).astype(np.float32)
    np.testing.assert_array_equal(images.read_color(store(tmp_path / "a.exr", light))[..., :3], light)
    read = images.read_environment(store(tmp_path / "a.hdr", light))
    assert read.shape == (5, 7, 3)
    np.testing.assert_allclose(read, light, atol=9 / 128)


def test_the_first_row_is_the_top(tmp_path: Path) -> None:
    picture = np.zeros((4, 2, 3), np.float32)
    picture[0] = 1.0
    images.write_png(tmp_path / "a.png", picture)
    images.write_exr(tmp_path / "a.exr", {"beauty": picture})
    for name in ("a.png", "a.exr"):
        np.testing.assert_array_equal(images.read_color(tmp_path / name)[..., :3], picture)


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.tga", "a.webp"])
def test_straight_alpha_is_read_as_stored(tmp_path: Path, name: str) -> None:
    lossless: dict[str, Any] = {"compression": "lossless:6"} if name.endswith("webp") else {}
    file = store(tmp_path / name, rgba8(), oiio__UnassociatedAlpha=1, **lossless)
    read = images.read_color(file)
    np.testing.assert_allclose(read[0, 0, :3], srgb_decode(np.array(RED) / 255), atol=1e-7)
    assert read[0, 0, 3] == pytest.approx(ALPHA / 255)


def test_associated_alpha_is_divided_out(tmp_path: Path) -> None:
    half = np.full((2, 2, 4), (0.25, 0.5, 0.0, 0.5), np.float32)
    half[1, 1] = (3.0, 2.0, 1.0, 0.0)
    read = images.read_color(store(tmp_path / "a.exr", half))
    np.testing.assert_array_equal(read[0, 0], [0.5, 1.0, 0.0, 0.5])
    np.testing.assert_array_equal(read[1, 1], half[1, 1])
    codes = np.full((2, 2, 4), (50, 100, 0, 128), np.uint8)
    read = images.read_color(store(tmp_path / "a.tif", codes))
    np.testing.assert_allclose(read[0, 0, :3], srgb_decode(np.array([100, 199, 0]) / 255), atol=1e-7)


def test_gray_and_gray_with_alpha(tmp_path: Path) -> None:
    gray = np.full((2, 3, 1), 100, np.uint8)
    linear = float(srgb_decode(100 / 255))
    np.testing.assert_allclose(images.read_color(store(tmp_path / "g.png", gray))[0, 0], [linear] * 3 + [1], atol=1e-7)
    both = np.concatenate([gray, gray // 2], axis=2)
    file = store(tmp_path / "ga.png", both, ("Y", "A"), oiio__UnassociatedAlpha=1)
    np.testing.assert_allclose(images.read_color(file)[0, 0], [linear] * 3 + [50 / 255], atol=1e-7)
    assert images.read_data(file, 1)[0, 0, 0] == pytest.approx(100 / 255)


def test_alpha_alone_is_no_color_but_is_a_mask(tmp_path: Path) -> None:
    file = store(tmp_path / "a.exr", np.full((2, 2, 1), 0.5, np.float32), ("A",))
    with pytest.raises(InputError, match="has the channels A; a color picture needs"):
        images.read_color(file)
    assert images.read_data(file, 1)[0, 0, 0] == 0.5


def test_layers_of_an_exr(tmp_path: Path) -> None:
    pixels = np.arange(6, dtype=np.float32) * np.ones((2, 2, 1), np.float32)
    file = store(tmp_path / "a.exr", pixels, ("Z", "glow.R", "R", "B", "G", "glow.G"))
    np.testing.assert_array_equal(images.read_color(file)[0, 0], [2, 4, 3, 1])
    named = store(tmp_path / "b.exr", pixels[..., 1:4], ("glow.R", "glow.G", "glow.B"))
    np.testing.assert_array_equal(images.read_color(named)[0, 0], [1, 2, 3, 1])


def test_an_exr_is_placed_into_its_display_window(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(2, 2, 3, oiio.FLOAT)
    spec.x, spec.y, spec.full_width, spec.full_height = 3, -1, 4, 3
    out: Any = oiio.ImageOutput.create("openexr")
    out.open(str(tmp_path / "a.exr"), spec)
    out.write_image(np.arange(12, dtype=np.float32).reshape(2, 2, 3) + 1)
    out.close()
    expected = np.zeros((3, 4, 3))
    expected[0, 3] = [7, 8, 9]  # the stored lower left pixel; the rest lies outside
    np.testing.assert_array_equal(images.read_environment(tmp_path / "a.exr"), expected)


# ------------------------------------------------------------------------------------------------------------- data


def test_data_is_raw(tmp_path: Path) -> None:
    codes = np.random.default_rng(3).integers(0, 65536, (4, 6, 3), dtype=np.uint16)
    raw = images.read_data(store(tmp_path / "a.png", codes), 3)
    np.testing.assert_allclose(raw, codes / 65535.0, atol=1e-7)
    np.testing.assert_allclose(images.read_data(tmp_path / "a.png", 2), codes[..., :2] / 65535.0, atol=1e-7)
    np.testing.assert_allclose(images.read_data(tmp_path / "a.png", 1)[..., 0], luminance(codes / 65535.0), atol=1e-7)
    assert images.read_data(tmp_path / "a.png", 4)[..., 3].min() == 1.0


def test_height_from_a_gray_color_file_is_its_first_channel(tmp_path: Path) -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    read = images.read_data(store(tmp_path / "a.png", codes), 1)
    np.testing.assert_array_equal(read[..., 0], codes[..., 0].astype(np.float32) / np.float32(255))


def test_a_gray_file_is_no_normal_map(tmp_path: Path) -> None:
    file = store(tmp_path / "a.png", np.zeros((2, 2, 1), np.uint8))
    with pytest.raises(InputError, match=r"mine\.png: has the channels Y; 3 channels are needed"):
        images.read_data(file, 3, label="mine.png")


def test_nonfinite_values_are_replaced_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    pixels = np.full((2, 2, 3), 3.0, np.float32)
    pixels[0, 0] = (np.nan, np.inf, -np.inf)
    pixels[1, 1, 0], pixels[1, 0, 2] = 7.0, -2.0
    file = store(tmp_path / "a.exr", pixels)
    with caplog.at_level(logging.WARNING, logger="skincli"):
        read = images.read_environment(file, label="sky.exr")
    assert read[0, 0].tolist() == [0.0, 7.0, -2.0]
    assert "sky.exr: 3 values are NaN or infinite" in caplog.text


# ---------------------------------------------------------------------------------------------------------- refusals


def png_header(width: int, height: int) -> bytes:
    """A PNG that promises much and holds nothing."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = zlib.compress(bytes(100))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def test_what_is_not_a_picture(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("not a picture")
    (tmp_path / "empty.png").touch()
    (tmp_path / "nothing.null").write_text("OpenImageIO reads this as gray, whatever it holds")
    for name, message in {
        "missing.png": "cannot be read: No such file",
        "text.png": "cannot be opened as a picture",
        "empty.png": "is empty; a picture may be bmp, .*, openexr, png, .*; convert it",
        "nothing.null": "is a null file; a picture may be",
        ".": "is a folder",
    }.items():
        with pytest.raises(InputError, match=rf"^as written: {message}"):
            images.read_color(tmp_path / name, label="as written")


def test_content_counts_not_the_suffix(tmp_path: Path) -> None:
    store(tmp_path / "a.tga", rgba8()[..., :3]).rename(tmp_path / "a.jpg")
    np.testing.assert_allclose(
        images.read_color(tmp_path / "a.jpg")[0, 0, :3], srgb_decode(np.array(RED) / 255), atol=1e-7
    )


# How OpenImageIO writes each format that it can write, for reading it; the rest needs files of other programs.
WRITTEN: dict[str, dict[str, Any]] = {
    **{suffix: {} for suffix in ("bmp", "dpx", "ico", "iff", "jp2", "jxl", "png", "ppm", "rla", "sgi", "tga", "tif")},
    "webp": {"compression": "lossless:6"},
}


def test_no_reader_of_what_is_no_picture() -> None:
    formats = images.formats()
    assert {"png", "jpeg", "openexr", "tiff", "hdr", "targa", "webp", "bmp", "dds", "psd", "pnm"} <= formats.keys()
    assert not {"null", "term", "ffmpeg", "openvdb", "ptex"} & formats.keys()
    suffixes = [suffix for found in formats.values() for suffix in found]
    assert {".png", ".jpg", ".exr", ".tif", ".tga"} <= set(suffixes)
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in suffixes)


@pytest.mark.parametrize("suffix", WRITTEN)
def test_pictures_of_many_formats(tmp_path: Path, suffix: str) -> None:
    codes = np.random.default_rng(10).integers(0, 256, (36, 40, 3), dtype=np.uint8)
    file = store(tmp_path / f"a.{suffix}", codes, **WRITTEN[suffix])
    loss = 2 if suffix == "jxl" else 0
    np.testing.assert_allclose(images.read_data(file, 3) * 255, codes, atol=loss + 1e-4)
    expected = srgb_decode(codes / 255.0)
    np.testing.assert_allclose(images.read_color(file)[..., :3], expected, atol=loss / 100 + 1e-6)
    assert images.size_of(file) == (40, 36)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "uint32", "int16", "int32", "float16", "float32", "float64"])
def test_pictures_of_every_depth(tmp_path: Path, kind: str) -> None:
    values = np.linspace(0, 1, 64).reshape(8, 8, 1)
    whole = np.dtype(kind).kind != "f"
    largest = np.iinfo(kind).max if whole else 1
    file = store(tmp_path / "a.tif", np.rint(values * largest).astype(kind) if whole else values.astype(kind))
    step = 1 / min(largest, 2**24) if whole else {"float16": 2**-11}.get(kind, 2**-23)
    data = images.read_data(file, 1)
    # A signed integer goes through 16 or 32 unsigned bits.
    np.testing.assert_allclose(data, values, atol=1.01 * step)
    expected = srgb_decode(values) if whole else values
    coarsest = max(step, 2 / 65535) if whole else step
    np.testing.assert_allclose(images.read_color(file)[..., :1], expected, atol=3 * coarsest)


def test_the_first_row_of_a_pfm_is_its_last_in_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.pfm").write_bytes(b"Pf\n2 3\n-1.0\n" + np.arange(6, dtype="<f4").tobytes())
    assert images.read_data(tmp_path / "a.pfm", 1)[..., 0].tolist() == [[4, 5], [2, 3], [0, 1]]


def test_a_logarithmic_scan_is_taken_as_it_is_with_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = store(tmp_path / "a.dpx", np.full((2, 2, 3), 30000, np.uint16), oiio__ColorSpace="KodakLog")
    with caplog.at_level(logging.WARNING, logger="skincli"):
        images.read_color(file)
    assert "a.dpx: is tagged KodakLog, which is not undone; convert it" in caplog.text


def test_a_single_pixel_and_a_very_wide_picture(tmp_path: Path) -> None:
    one = store(tmp_path / "one.png", np.full((1, 1, 3), 255, np.uint8))
    assert images.read_color(one).tolist() == [[[1, 1, 1, 1]]]
    wide = images.read_data(store(tmp_path / "wide.png", np.arange(30000, dtype=np.uint16)[None, :, None]), 1)
    assert wide.shape == (1, 30000, 1)
    assert images.reduce_to(wide, 16384).shape == (1, 16384, 1)


def test_gray_fills_all_channels_where_that_is_wanted(tmp_path: Path) -> None:
    file = store(tmp_path / "a.png", np.full((2, 2, 1), 51, np.uint8))
    np.testing.assert_array_equal(images.read_data(file, 3, spread=True), np.full((2, 2, 3), np.float32(51) / 255))
    rgb = store(tmp_path / "b.png", rgba8()[..., :3])
    np.testing.assert_array_equal(images.read_data(rgb, 3, spread=True), images.read_data(rgb, 3))
    two = store(tmp_path / "c.exr", np.ones((2, 2, 2), np.float32), ("U", "V"))
    with pytest.raises(InputError, match="3 channels are needed"):
        images.read_data(two, 3, spread=True)


@pytest.mark.parametrize("suffix", [*WRITTEN, "jpg", "gif", "exr", "hdr", "pfm"])
@pytest.mark.parametrize("share", [0.1, 0.6])
def test_truncated_files_are_refused(tmp_path: Path, suffix: str, share: float) -> None:
    noise = np.random.default_rng(4).integers(0, 256, (48, 48, 3), dtype=np.uint8)
    pixels = noise.astype(np.float32) / 255 if suffix in ("exr", "hdr", "pfm") else noise
    file = store(tmp_path / f"a.{suffix}", pixels)
    assert images.read_color(file).shape == (48, 48, 4)
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * share)])
    with pytest.raises(InputError, match=f"a.{suffix}: (is damaged|cannot be opened)"):
        images.read_color(file)


@pytest.mark.parametrize(("width", "height"), [(40000, 4), (20000, 20000)])
def test_the_header_is_checked_before_anything_is_decoded(tmp_path: Path, width: int, height: int) -> None:
    (tmp_path / "bomb.png").write_bytes(png_header(width, height))
    # OpenImageIO refuses the more blatant promises itself.
    with pytest.raises((LimitError, InputError), match=f"is {width} x {height}|header claims a"):
        images.read_color(tmp_path / "bomb.png")


def test_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = store(tmp_path / "a.png", rgba8(40, 30))
    monkeypatch.setattr(images, "MAX_SIDE", 39)
    with pytest.raises(LimitError, match=r"is 30 x 40 pixels, .* at most 39 a side"):
        images.read_color(file)
    monkeypatch.setattr(images, "MAX_SIDE", 40)
    monkeypatch.setattr(images, "MAX_MEGABYTES", 0.01)
    with pytest.raises(LimitError, match="scale it down"):
        images.read_data(file, 1)


def test_parts_and_depth(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    spec = oiio.ImageSpec(2, 2, 3, oiio.FLOAT)
    out: Any = oiio.ImageOutput.create("openexr")
    out.open(str(tmp_path / "parts.exr"), (spec, spec))
    out.write_image(np.ones((2, 2, 3), np.float32))
    out.open(str(tmp_path / "parts.exr"), spec, "AppendSubimage")
    out.write_image(np.zeros((2, 2, 3), np.float32))
    out.close()
    with caplog.at_level(logging.WARNING, logger="skincli"):
        assert images.read_color(tmp_path / "parts.exr").min() == 1.0
    assert "has several parts; the first is used" in caplog.text

    deep = oiio.ImageSpec(2, 2, 3, oiio.FLOAT)
    deep.deep = True
    samples = oiio.DeepData()
    samples.init(deep)
    out.open(str(tmp_path / "deep.exr"), deep)
    out.write_deep_image(samples)
    out.close()
    with pytest.raises(InputError, match="is a deep picture; only flat ones"):
        images.read_color(tmp_path / "deep.exr")


# ---------------------------------------------------------------------------------------------------------- writing


def test_exr_holds_layers_in_their_own_precision(tmp_path: Path) -> None:
    draw = np.random.default_rng(5)
    layers = {
        "beauty": draw.random((6, 5, 3), np.float32) * 40,
        "normal": draw.random((6, 5, 3), np.float32) - 0.5,
        "depth": draw.random((6, 5), np.float32) * 1e6,
        "uv": draw.random((6, 5, 2), np.float32),
        "occlusion": draw.random((6, 5, 1), np.float32),
    }
    file = tmp_path / "deep" / "er" / "a.exr"
    images.write_exr(file, layers, half={"depth": False, "uv": False}, attributes={"skincli:scene": "octopus"})
    stored = channels_of(file)
    assert {name: kind for name, (_, kind) in stored.items()} == {
        **dict.fromkeys(["R", "G", "B", "normal.R", "normal.G", "normal.B", "occlusion.Y"], "half"),
        **dict.fromkeys(["depth.Z", "uv.U", "uv.V"], "float"),
    }
    np.testing.assert_array_equal(stored["depth.Z"][0], layers["depth"])
    np.testing.assert_array_equal(stored["uv.V"][0], layers["uv"][..., 1])
    for i, name in enumerate("RGB"):
        np.testing.assert_array_equal(stored[name][0], layers["beauty"][..., i].astype(np.float16))
    source: Any = oiio.ImageInput.open(str(file))
    assert source.spec().get_string_attribute("skincli:scene") == "octopus"
    source.close()


@pytest.mark.parametrize("half", [True, False])
def test_an_exr_of_one_precision_has_it(tmp_path: Path, half: bool) -> None:
    images.write_exr(tmp_path / "a.exr", {"beauty": np.full((2, 2, 3), 0.3)}, half=half)
    assert {kind for _, kind in channels_of(tmp_path / "a.exr").values()} == {"half" if half else "float"}


@pytest.mark.parametrize("space", ["lin_rec709_scene", "data"])
def test_an_exr_says_what_its_numbers_are(tmp_path: Path, space: Any) -> None:
    images.write_exr(tmp_path / "a.exr", {"beauty": np.zeros((2, 2, 3))}, color_space=space)
    source: Any = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    spec = source.spec()
    source.close()
    assert spec.get_string_attribute("oiio:ColorSpace") == spec.get_string_attribute("colorInteropID") == space


def test_float_exr_returns_exactly(tmp_path: Path) -> None:
    picture = np.random.default_rng(6).normal(size=(8, 9, 3)).astype(np.float32) * 1e5
    images.write_exr(tmp_path / "a.exr", {"beauty": picture}, half=False)
    np.testing.assert_array_equal(images.read_color(tmp_path / "a.exr")[..., :3], picture)


def test_exr_stores_associated_alpha(tmp_path: Path) -> None:
    picture = np.full((2, 2, 4), (0.8, 0.4, 0.2, 0.5), np.float32)
    images.write_exr(tmp_path / "a.exr", {"beauty": picture}, half=False)
    assert channels_of(tmp_path / "a.exr")["R"][0][0, 0] == np.float32(0.4)
    np.testing.assert_allclose(images.read_color(tmp_path / "a.exr"), picture, rtol=1e-7)


def test_half_clamps_and_counts(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    picture = np.zeros((2, 2, 3), np.float32)
    picture[0, 0] = (1e6, -1e6, np.inf)
    with caplog.at_level(logging.WARNING, logger="skincli"):
        images.write_exr(tmp_path / "a.exr", {"beauty": picture, "depth": picture[..., 0]}, half={"depth": False})
    assert images.read_color(tmp_path / "a.exr")[0, 0, :3].tolist() == [65504, -65504, 65504]
    assert channels_of(tmp_path / "a.exr")["depth.Z"][0][0, 0] == 1e6
    assert "a.exr: values beyond +-65504 were clamped to it: 3 of beauty" in caplog.text


def test_layers_must_be_pictures_of_one_size(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="dimensions"):
        images.write_exr(tmp_path / "a.exr", {"beauty": np.zeros((2, 2, 3)), "depth": np.zeros((2, 3))})
    with pytest.raises(ValueError, match="a picture has the shape"):
        images.write_png(tmp_path / "a.png", np.zeros((2, 2, 5)))
    assert list(tmp_path.iterdir()) == []


def test_equal_pictures_give_equal_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = np.random.default_rng(7).random((40, 50, 4), np.float32)

    def both(name: str) -> bytes:
        images.write_exr(tmp_path / f"{name}.exr", {"beauty": picture, "depth": picture[..., 0]})
        images.write_png(tmp_path / f"{name}.png", picture)
        return (tmp_path / f"{name}.exr").read_bytes() + (tmp_path / f"{name}.png").read_bytes()

    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    first = both("a")
    assert b"1970:01:01 00:00:00" in first
    assert both("b") == first
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    assert b"2001:09:09 01:46:40" in both("c")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(InputError, match="SOURCE_DATE_EPOCH is 'yesterday'; it must be whole seconds"):
        both("d")


@pytest.mark.parametrize("kind", ["color", "data"])
def test_16_bit_png_returns_within_half_a_step(tmp_path: Path, kind: Any) -> None:
    picture = np.random.default_rng(8).random((16, 16, 4), np.float32)
    images.write_png(tmp_path / "a.png", picture, kind=kind, bits=16)
    if kind == "data":
        read, expected = images.read_data(tmp_path / "a.png", 4), picture.astype(np.float64)
    else:
        read, expected = images.read_color(tmp_path / "a.png"), picture.astype(np.float64)
        read = np.concatenate([srgb_encode(read[..., :3]), read[..., 3:]], axis=2)
        expected[..., :3] = srgb_encode(expected[..., :3])
    assert np.abs(read - expected).max() <= 0.5 / 65535 + 2e-7


def test_png_tags(tmp_path: Path) -> None:
    picture = np.full((4, 4, 3), 0.5, np.float32)
    tags = (b"sRGB", b"gAMA", b"cHRM", b"iCCP", b"cICP")
    for bits in (8, 16):
        images.write_png(tmp_path / "color.png", picture, bits=bits)
        assert b"sRGB" in (tmp_path / "color.png").read_bytes()
        images.write_png(tmp_path / "data.png", picture, kind="data", bits=bits)
        data = (tmp_path / "data.png").read_bytes()
        assert not [tag for tag in tags if tag in data]


def test_png_data_is_clipped_and_not_dithered(tmp_path: Path) -> None:
    picture = np.full((32, 32), 100.4 / 255, np.float32)
    picture[0, :3] = (-1, 2, np.nan)
    images.write_png(tmp_path / "a.png", picture, kind="data")
    codes = np.rint(images.read_data(tmp_path / "a.png", 1)[..., 0] * 255)
    assert codes[0, :3].tolist() == [0, 255, 0]
    assert set(codes[1:].ravel()) == {100.0}


def test_png_alpha_is_straight_and_linear(tmp_path: Path) -> None:
    picture = np.full((4, 4, 4), (1.0, 0.0, 1.0, 0.5), np.float32)
    picture[..., 3] = 102 / 255
    images.write_png(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(images.read_color(tmp_path / "a.png"), picture)
    images.write_png(tmp_path / "b.png", picture[..., 2:])
    np.testing.assert_array_equal(images.read_color(tmp_path / "b.png")[0, 0], [1, 1, 1, np.float32(102 / 255)])


def test_dither_keeps_the_mean_and_what_8_bits_hold(tmp_path: Path) -> None:
    exact = np.float32(srgb_decode(np.arange(256) / 255)).reshape(1, 256, 1) * np.ones((300, 1, 3), np.float32)
    images.write_png(tmp_path / "a.png", exact)
    np.testing.assert_array_equal(images.read_color(tmp_path / "a.png")[..., :3], exact)

    level = 10.3 / 255
    flat = np.full((256, 128, 3), srgb_decode(level), np.float32)
    images.write_png(tmp_path / "b.png", flat)
    codes = np.rint(images.read_data(tmp_path / "b.png", 3) * 255)
    assert set(codes.ravel()) == {10.0, 11.0}
    deviation = np.sqrt(0.3 * 0.7 / (256 * 128))
    assert np.abs(codes.mean(axis=(0, 1)) - 10.3).max() < 4 * deviation + 1 / 256
    assert abs(np.corrcoef(codes[..., 0].ravel(), codes[..., 1].ravel())[0, 1]) < 4 / 128
    assert abs(np.corrcoef(codes[:, 1:, 0].ravel(), codes[:, :-1, 0].ravel())[0, 1]) < 4 / 128
    assert abs(np.corrcoef(codes[:128].ravel(), codes[128:].ravel())[0, 1]) < 4 / 128  # the bands do not repeat
    images.write_png(tmp_path / "c.png", flat, dither_seed=1)
    assert (tmp_path / "c.png").read_bytes() != (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize("kind", [RuntimeError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path, kind: type[BaseException]) -> None:
    target = tmp_path / "a.txt"
    images.write_text(target, "old\n")
    with pytest.raises(kind), images.atomic(target) as temporary:  # noqa: PT012
        assert temporary.suffix == ".txt"
        assert temporary.parent == tmp_path
        temporary.write_text("new")
        raise kind
    assert target.read_text() == "old\n"
    assert list(tmp_path.iterdir()) == [target]
    images.write_text(target, "new\n")
    assert target.read_bytes() == b"new\n"


def test_what_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder.png").mkdir()
    picture = np.zeros((2, 2, 3))
    for target in (tmp_path / "file" / "a.png", tmp_path / "folder.png", tmp_path / ("x" * 300 + ".png")):
        with pytest.raises(OutputError, match=r"\.png: cannot be written: .*; choose a place") as caught:
            images.write_png(target, picture)
        assert caught.value.faults[0].file == str(target)
        assert caught.value.exit_code == 7
    with pytest.raises(OutputError, match="not a file"):
        images.write_text(os.devnull, "")
    assert Path(os.devnull).is_char_device()
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder.png"}


# ---------------------------------------------------------------------------------------------------------- previews


def test_resize_keeps_a_flat_picture_and_the_mean() -> None:
    np.testing.assert_allclose(images.resize(np.full((9, 7, 3), 0.3), 20, 5), 0.3, atol=1e-6)
    noise = np.random.default_rng(9).random((64, 64, 1), np.float32)
    small = images.resize(noise, 16, 16)
    assert small.shape == (16, 16, 1)
    assert small.mean() == pytest.approx(noise.mean(), rel=0.01)
    spot = np.zeros((64, 64, 1), np.float32)
    spot[32, 32] = 1000.0
    assert images.resize(spot, 16, 16).min() >= 0


@pytest.mark.parametrize(("height", "width", "side"), [(7, 5, 3), (10, 3, 4), (64, 48, 16), (3, 1000, 333)])
def test_reducing_keeps_the_mean_and_shrinks_only_what_is_too_long(height: int, width: int, side: int) -> None:
    noise = np.random.default_rng(11).random((height, width, 3), np.float32)
    small = images.reduce_to(noise, side)
    assert small.shape == (min(height, side), min(width, side), 3)
    assert small.dtype == np.float32
    np.testing.assert_allclose(small.mean(axis=(0, 1)), noise.mean(axis=(0, 1)), rtol=1e-5)
    np.testing.assert_allclose(images.reduce_to(np.full((height, width), 0.3), side), 0.3, rtol=1e-6)


def test_reducing_averages_areas() -> None:
    halved = images.reduce_to(np.arange(16, dtype=np.float32).reshape(4, 4), 2)[..., 0]
    assert halved.tolist() == [[2.5, 4.5], [10.5, 12.5]]
    np.testing.assert_allclose(images.reduce_to(np.array([[0.0, 3.0, 6.0]]), 2)[0, :, 0], [1.0, 5.0], rtol=1e-6)
    same = np.ones((3, 3, 1), np.float32)
    np.testing.assert_array_equal(images.reduce_to(same, 3), same)


def test_contact_sheet_holds_the_panels_and_their_labels() -> None:
    first, second = np.full((20, 60, 3), (0.9, 0.1, 0.2)), np.full((10, 30, 3), (0.1, 0.2, 0.9))
    sheet = images.contact_sheet([("one", first), ("two", second), ("one", first)], 2)
    assert np.count_nonzero((sheet == np.float32(first[0, 0])).all(axis=2)) == 2 * 20 * 60
    assert np.count_nonzero((sheet == np.float32(second[0, 0])).all(axis=2)) == 10 * 30
    ink = (sheet == sheet[..., :1]).all(axis=2) & (sheet[..., 0] > 0.3)
    rows, columns = np.nonzero(ink)
    assert rows.min() > 20
    letters = ink[:, columns.min() : columns.min() + 36]
    top, bottom = letters[: sheet.shape[0] // 2], letters[sheet.shape[0] // 2 :]
    assert np.count_nonzero(top) == np.count_nonzero(bottom) > 100
    titled = images.contact_sheet([("one", first)], 3, title="A title that is far too long for the sheet")
    assert titled.shape[0] > images.contact_sheet([("one", first)], 3).shape[0]
    assert titled.shape[1] == 60 + 2 * 8


def test_every_ascii_letter_has_its_own_dots() -> None:
    letters = [images._letters(chr(code)).tobytes() for code in range(32, 127)]
    assert len(set(letters)) == 95
    assert images._letters("\u00b5").any()
