"""Maps as files: their table, names, encodings and metadata; and folders of maps, ours and from elsewhere."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from skincli import images, mapset
from skincli.color import srgb_encode
from skincli.errors import InputError, LimitError, OutputError, UsageError
from skincli.mapset import MAPS, Encoding, Entry, FoundMap, Manifest, find_maps, write_manifest, write_map

PNG8, PNG16, HALF, FLOAT = (Encoding.of(depth=depth) for depth in ("8", "16", "half", "float"))  # type: ignore[arg-type]
STEP = {"uint8": 1 / 255, "uint16": 1 / 65535, "half": 2**-11, "float": 2**-23}


def sample(name: str, side: int = 8) -> np.ndarray:
    """Values that a map may have: heights of -0.3 to 0.1 mm, radii up to 2 mm, unit normals, else 0 to 1."""
    kind = MAPS[name]
    values = np.random.default_rng(1).random((side, side, kind.channels))
    if kind.scale == "signed":
        values = values * 0.4 - 0.3
    elif kind.scale == "positive":
        values = values * 2
    elif kind.scale == "direction":
        values = values * [1, 1, 0] + [-0.5, -0.5, 1]
        values /= np.linalg.norm(values, axis=2, keepdims=True)
    return values.astype(np.float32)


def stored(path: Path, channels: int) -> np.ndarray:
    return images.read_data(path, channels).astype(np.float64)


def values_of(folder: Path, name: str, entry: Entry) -> np.ndarray:
    """Return a map's values by the one formula of the manifest."""
    low, high = entry.range
    color = MAPS[name].role == "color"
    file = folder / entry.file
    read = images.read_color(file)[..., :3] if color else stored(file, MAPS[name].channels)
    return low + (high - low) * read


def spec_of(path: Path) -> Any:
    source: Any = oiio.ImageInput.open(str(path))
    spec = source.spec()
    source.close()
    return spec


def touch(folder: Path, *names: str) -> Path:
    """Make small pictures of these names, whatever their suffix says."""
    folder.mkdir(exist_ok=True)
    images.write_png(folder / "picture.png", np.full((2, 2, 3), 0.5, np.float32))
    content = (folder / "picture.png").read_bytes()
    (folder / "picture.png").unlink()
    for name in names:
        (folder / name).write_bytes(content)
    return folder


def files_of(folder: Path) -> dict[str, str]:
    return {name: found.file for name, found in find_maps(folder).maps.items()}


# ------------------------------------------------------------------------------------------------------------ table


def test_the_table_holds_together() -> None:
    words = [word for kind in MAPS.values() for word in (kind.name, *kind.synonyms)]
    assert len(set(words)) == len(words)
    for name, kind in MAPS.items():
        assert kind.name == name
        assert (kind.channels == 3) == (kind.role in ("color", "data") or name == "normal")
        assert {"16", "float"} <= set(kind.depths)
        low, high = kind.assumed
        assert low == -high if kind.scale in ("signed", "direction") else low == 0 < high
    for name in ("height", "bump", "scattering_radius"):
        assert "8" not in MAPS[name].depths
        assert MAPS[name].unit == "mm"


def test_maps_are_asked_for_by_name_or_synonym_in_any_order() -> None:
    assert mapset.parse_maps("bump, albedo") == ("albedo", "bump")
    assert mapset.parse_maps("Reflectance,radius,reflection") == ("reflection", "scattering_radius")
    assert mapset.parse_maps(",".join(MAPS)) == tuple(MAPS)


@pytest.mark.parametrize("text", ["", " , "])
def test_no_map_asked_for(text: str) -> None:
    with pytest.raises(UsageError, match=r"names no map; there are: albedo, height, .*; write them as in albedo,bump"):
        mapset.parse_maps(text)


def test_unknown_maps_are_named_together() -> None:
    with pytest.raises(UsageError) as caught:
        mapset.parse_maps("albdo,bump,gloss")
    first, second = str(caught.value).splitlines()
    assert first.startswith("'albdo' is no map; did you mean 'albedo'?; there are: albedo,")
    assert second.startswith("'gloss' is no map")


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ({}, ("png", "16")),
        ({"format": "exr"}, ("exr", "half")),
        ({"depth": "8"}, ("png", "8")),
        ({"depth": "float"}, ("exr", "float")),
        ({"format": "exr", "depth": "float"}, ("exr", "float")),
    ],
)
def test_what_is_not_said_of_an_encoding_follows(asked: Any, expected: tuple[str, str]) -> None:
    encoding = Encoding.of(**asked)
    assert (encoding.format, encoding.depth) == expected


@pytest.mark.parametrize(("format", "depth", "other"), [("png", "half", "exr"), ("exr", "16", "png")])
def test_a_format_has_its_own_depths(format: Any, depth: Any, other: str) -> None:
    with pytest.raises(UsageError, match=rf"{format} holds no maps of depth {depth}; .* or the format {other}"):
        Encoding.of(format, depth)


# ---------------------------------------------------------------------------------------------------------- writing


@pytest.mark.parametrize("encoding", [PNG8, PNG16, HALF, FLOAT], ids=lambda encoding: encoding.depth)
@pytest.mark.parametrize("name", MAPS)
def test_a_map_returns_within_a_step(tmp_path: Path, name: str, encoding: Encoding) -> None:
    expected = sample(name)
    entry = write_map(tmp_path / mapset.file_name(name, encoding), name, expected, encoding)
    read = values_of(tmp_path, name, entry)
    low, high = entry.range
    if name == "albedo" and encoding.format == "png":
        read, expected = srgb_encode(read), srgb_encode(expected)
    biggest = max(high - low, np.abs(expected).max())
    assert np.abs(read - expected).max() <= STEP[entry.type] * biggest * 1.001
    if encoding == FLOAT and not MAPS[name].exr_scaled:
        np.testing.assert_array_equal(read, expected)


@pytest.mark.parametrize(("asked", "written"), [(PNG8, "uint16"), (HALF, "float")])
@pytest.mark.parametrize("name", ["height", "bump"])
def test_a_relief_is_never_coarse(
    tmp_path: Path, name: str, asked: Encoding, written: str, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / mapset.file_name(name, asked)
    with caplog.at_level(logging.WARNING, logger="skincli"):
        entry = write_map(file, name, sample(name), asked)
    assert entry.type == written == str(spec_of(file).format)
    assert f"{asked.depth} is too coarse for {name}; it is written as" in caplog.text


def test_a_radius_is_not_written_in_8_bits_but_in_halves(tmp_path: Path) -> None:
    assert write_map(tmp_path / "a.png", "scattering_radius", sample("scattering_radius"), PNG8).type == "uint16"
    assert write_map(tmp_path / "a.exr", "scattering_radius", sample("scattering_radius"), HALF).type == "half"


@pytest.mark.parametrize("name", ["height", "bump"])
def test_the_undisplaced_surface_is_at_mid_level(tmp_path: Path, name: str) -> None:
    height = np.zeros((2, 2), np.float32)
    height[0, 0] = -0.3
    entry = write_map(tmp_path / "a.png", name, height, PNG16)
    assert entry.mid_level == 0.5
    assert entry.range == (-np.float32(0.3), np.float32(0.3))
    codes = stored(tmp_path / "a.png", 1)[..., 0] * 65535
    np.testing.assert_allclose(codes, [[0, 32768], [32768, 32768]], atol=1e-2)
    flat = write_map(tmp_path / "flat.png", name, np.zeros((2, 2)), PNG16)
    assert flat.range == (-1, 1)


def test_exr_holds_height_in_mm_and_bump_as_grey(tmp_path: Path) -> None:
    height = sample("height")
    raw = write_map(tmp_path / "height.exr", "height", height, FLOAT)
    assert (raw.range, raw.mid_level, raw.unit) == ((0, 1), None, "mm")
    np.testing.assert_array_equal(stored(tmp_path / "height.exr", 1), height)
    bump = write_map(tmp_path / "bump.exr", "bump", height, FLOAT)
    grey = stored(tmp_path / "bump.exr", 1)
    assert bump.mid_level == 0.5
    assert 0 <= grey.min() <= grey.max() <= 1
    assert grey.min() == 0  # the lowest is farther from 0 than the highest
    assert list(spec_of(tmp_path / "bump.exr").channelnames) == ["Y"]


def test_directx_turns_y_over(tmp_path: Path) -> None:
    normal = sample("normal")
    gl = write_map(tmp_path / "gl.exr", "normal", normal, FLOAT)
    dx = write_map(tmp_path / "dx.exr", "normal", normal, FLOAT, "directx")
    assert (gl.convention, dx.convention) == ("opengl", "directx")
    first, second = stored(tmp_path / "gl.exr", 3), stored(tmp_path / "dx.exr", 3)
    np.testing.assert_allclose(first, normal * 0.5 + 0.5, atol=1e-6)
    np.testing.assert_array_equal(second[..., [0, 2]], first[..., [0, 2]])
    np.testing.assert_allclose(second[..., 1], 1 - first[..., 1], atol=1e-6)
    assert gl.pixels == dx.pixels  # the same normals
    assert gl.bytes != dx.bytes


@pytest.mark.parametrize("name", MAPS)
def test_color_metadata_is_right_in_every_file(tmp_path: Path, name: str) -> None:
    color = name == "albedo"
    for depth in ("half", "float"):
        file = tmp_path / f"{depth}.exr"
        entry = write_map(file, name, sample(name), Encoding.of(depth=depth))  # type: ignore[arg-type]
        spec = spec_of(file)
        for key in ("oiio:ColorSpace", "colorInteropID"):
            assert spec.get_string_attribute(key) == ("lin_rec709_scene" if color else "data")
        assert entry.color_space == ("linear Rec.709" if color else "data")
        assert "".join(spec.channelnames) == ("RGB" if MAPS[name].channels == 3 else "Y")
        assert str(spec.format) == entry.type
    for encoding in (PNG8, PNG16):
        entry = write_map(tmp_path / "a.png", name, sample(name), encoding)
        content = (tmp_path / "a.png").read_bytes()
        assert (b"sRGB" in content) == color
        assert color or not any(tag in content for tag in (b"gAMA", b"cHRM", b"iCCP", b"cICP"))
        assert (entry.color_space, entry.encodes) == (("sRGB", "linear Rec.709") if color else ("data", None))


@pytest.mark.parametrize("encoding", [PNG8, PNG16, HALF, FLOAT], ids=lambda encoding: encoding.depth)
def test_equal_maps_give_equal_bytes_and_hashes(
    tmp_path: Path, encoding: Encoding, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    for name in ("albedo", "height"):
        file = mapset.file_name(name, encoding)
        entries = [write_map(tmp_path / folder / file, name, sample(name), encoding) for folder in ("one", "two")]
        assert entries[0] == entries[1]
        content = (tmp_path / "one" / file).read_bytes()
        assert content == (tmp_path / "two" / file).read_bytes()
        assert entries[0].bytes == hashlib.blake2b(content, digest_size=16).hexdigest()
        assert entries[0].pixels == hashlib.blake2b(sample(name).tobytes(), digest_size=16).hexdigest()
        other = write_map(tmp_path / "three" / file, name, sample(name) * np.float32(0.5), encoding)
        assert other.pixels != entries[0].pixels


def test_a_constant_map_may_be_a_broadcast_view(tmp_path: Path) -> None:
    flat = np.broadcast_to(np.array([0.25], np.float32), (4, 4, 1))
    entry = write_map(tmp_path / "a.png", "roughness", flat, PNG16)
    assert entry.pixels == hashlib.blake2b(flat.tobytes(), digest_size=16).hexdigest()


@pytest.mark.parametrize(
    "array", [np.zeros((2, 2, 3)), np.zeros((2, 2, 2)), np.zeros(4), np.full((2, 2), np.nan), np.full((2, 2), np.inf)]
)
def test_what_is_no_height(tmp_path: Path, array: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"height has the shape \(h, w, 1\) and finite values"):
        write_map(tmp_path / "a.png", "height", array, PNG16)


def test_a_map_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"a\.png: cannot be written"):
        write_map(tmp_path / "file" / "a.png", "bump", sample("bump"), PNG16)


# ------------------------------------------------------------------------------------------------------------ names


@pytest.mark.parametrize("naming", mapset.NAMINGS)
@pytest.mark.parametrize("convention", ["opengl", "directx"])
def test_what_we_name_we_recognize(tmp_path: Path, naming: Any, convention: Any) -> None:
    names = {name: mapset.file_name(name, PNG16, naming, "old skin", convention) for name in MAPS}
    assert len(set(names.values())) == len(MAPS)
    folder = touch(tmp_path / "maps", *names.values())
    assert files_of(folder) == names
    assert find_maps(folder).maps["normal"].role == {"opengl": "normal_gl", "directx": "normal_dx"}[convention]


def test_the_names_of_both_schemes() -> None:
    assert mapset.file_name("bump", PNG16) == "bump.png"
    assert mapset.file_name("normal", FLOAT, convention="directx") == "normal_dx.exr"
    assert mapset.file_name("albedo", PNG16, "ambientcg", "human") == "human_Color.png"
    assert mapset.file_name("normal", PNG16, "ambientcg", "human", "directx") == "human_NormalDX.png"
    assert mapset.file_name("normal", PNG16, "ambientcg", "human") == "human_NormalGL.png"
    assert mapset.file_name("bump", PNG16, "ambientcg", "human") == "human_Displacement.png"
    assert mapset.file_name("cavity", HALF, "ambientcg", "human") == "human_AmbientOcclusion.exr"


FOREIGN = {
    "ambientCG": {
        "albedo": "Leather026_1K-JPG_Color.jpg",
        "bump": "Leather026_1K-JPG_Displacement.jpg",
        "normal": "Leather026_1K-JPG_NormalGL.jpg",
        "roughness": "Leather026_1K-JPG_Roughness.jpg",
        "cavity": "Leather026_1K-JPG_AmbientOcclusion.jpg",
    },
    "Substance": {
        "albedo": "head_BaseColor.png",
        "height": "head_Height.exr",
        "normal": "head_Normal_OpenGL.png",
        "roughness": "head_Roughness.png",
        "specular": "head_SpecularLevel.tif",
        "scattering_radius": "head_Scattering.png",
        "cavity": "head_Ambient_Occlusion.png",
    },
    "Substance, small": {
        "albedo": "my-head base_color.TGA",
        "normal": "my-head.normal.png",
        "scattering_radius": "my_head_sss.png",
        "cavity": "my_head_ao.png",
    },
    "Poly Haven": {
        "albedo": "hide_diff_4k.jpg",
        "bump": "hide_disp_4k.png",
        "normal": "hide_nor_gl_4k.exr",
        "roughness": "hide_rough_4k.exr",
        "cavity": "hide_ao_4k.jpg",
    },
}


@pytest.mark.parametrize("scheme", FOREIGN)
def test_folders_from_elsewhere(tmp_path: Path, scheme: str) -> None:
    names = FOREIGN[scheme]
    folder = touch(tmp_path / "maps", *names.values(), "Leather026.png", "hide_preview.jpg", "._hide_Color.png")
    (folder / "head.blend").write_text("no picture")
    (folder / "head_color.txt").write_text("no picture")
    found = find_maps(folder)
    assert files_of(folder) == names
    assert list(found.maps) == [name for name in MAPS if name in names]
    assert found.repeat
    assert found.maps["normal"].role == "normal_gl"


@pytest.mark.parametrize("ending", ["NormalDX", "normal_directx", "nor_dx_2k", "Normal-DirectX", "NRM_DX"])
def test_the_name_tells_directx(tmp_path: Path, ending: str) -> None:
    folder = touch(tmp_path / "maps", f"a_{ending}.png")
    assert find_maps(folder).maps["normal"].role == "normal_dx"


def test_the_better_of_two_is_taken(tmp_path: Path) -> None:
    folder = touch(tmp_path / "maps", "a_NormalDX.png", "a_NormalGL.png", "a_AmbientOcclusion.png", "a_cavity.png")
    assert files_of(folder) == {"normal": "a_NormalGL.png", "cavity": "a_cavity.png"}


def test_ambiguity_names_the_files_of_every_map(tmp_path: Path) -> None:
    folder = touch(tmp_path / "maps", "a_Color.png", "b_Color.png", "a_rough.png", "a_roughness_2k.exr", "bump.png")
    with pytest.raises(InputError) as caught:
        find_maps(folder, label="maps")
    assert [str(fault) for fault in caught.value.faults] == [
        f"maps: holds more than one {found}; leave one of them in the folder"
        for found in (
            "albedo map: 'a_Color.png' and 'b_Color.png'",
            "roughness map: 'a_rough.png' and 'a_roughness_2k.exr'",
        )
    ]


@pytest.mark.parametrize("names", [(), ("photo.png", "4k.png", "normality.png", "_.png")])
def test_a_folder_without_maps_says_what_is_understood(tmp_path: Path, names: tuple[str, ...]) -> None:
    folder = touch(tmp_path / "maps", *names)
    with pytest.raises(
        InputError, match=r"^maps: holds no map; .*NAME_Color\.png.*NAME_BaseColor\.png.*rename"
    ) as caught:
        find_maps(folder, label="maps")
    assert caught.value.exit_code == 3


def test_what_is_no_folder(tmp_path: Path) -> None:
    touch(tmp_path / "maps", "albedo.png")
    with pytest.raises(InputError, match=r"mapz: is no folder of maps in '.*'; did you mean 'maps'\?"):
        find_maps(tmp_path / "mapz")
    with pytest.raises(InputError, match="is no folder of maps"):
        find_maps(tmp_path / "maps" / "albedo.png")


def test_a_file_may_not_lead_out_of_the_folder(tmp_path: Path) -> None:
    folder, outside = touch(tmp_path / "maps", "bump.png"), touch(tmp_path / "outside", "secret.png")
    (folder / "albedo.png").symlink_to(outside / "secret.png")
    with pytest.raises(InputError, match=r"maps: the albedo map is 'albedo.png'; it leads by a symbolic link outside"):
        find_maps(folder, label="maps")
    assert find_maps(folder, roots=(outside,)).maps["albedo"].file == "albedo.png"
    (folder / "albedo.png").unlink()
    (folder / "albedo.png").symlink_to(folder / "bump.png")
    assert files_of(folder) == {"albedo": "albedo.png", "bump": "bump.png"}
    (outside / "manifest.json").write_text('{"manifest": 1, "maps": {"bump": {"file": "bump.png", "range": [0, 1]}}}')
    (folder / "manifest.json").symlink_to(outside / "manifest.json")
    with pytest.raises(InputError, match=r"the manifest of 'maps' is .* outside the folder"):
        find_maps(folder, label="maps")


def test_a_folder_may_itself_be_a_link(tmp_path: Path) -> None:
    touch(tmp_path / "maps", "bump.png")
    (tmp_path / "link").symlink_to(tmp_path / "maps")
    assert files_of(tmp_path / "link") == {"bump": "bump.png"}


@pytest.mark.skipif(os.name == "nt" or not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root reads everything")
def test_a_folder_that_may_not_be_read(tmp_path: Path) -> None:
    folder = touch(tmp_path / "maps", "bump.png")
    folder.chmod(0)
    try:
        with pytest.raises(InputError, match="cannot be read"):
            find_maps(folder)
    finally:
        folder.chmod(0o700)


# ----------------------------------------------------------------------------------------------------------- layers


def test_layers_of_a_folder_from_elsewhere(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    names = ("a_Color.png", "a_Displacement.png", "a_NormalGL.png", "a_Roughness.png", "a_AmbientOcclusion.png")
    folder = touch(tmp_path / "maps", *names, "a_spec.png", "a_Reflection.png", "a_SSS.png")
    with caplog.at_level(logging.WARNING, logger="skincli"):
        found = find_maps(folder, label="maps")
    repeat = {"tile": "repeat"}
    assert found.layers() == [
        {"image": {"name": "albedo", "file": "a_Color.png", "role": "color", "into": ["albedo"], **repeat}},
        {"image": {"name": "bump", "file": "a_Displacement.png", "role": "grey", "height": [-0.5, 0.5], **repeat}},
        {
            "image": {
                "name": "reflection",
                "file": "a_Reflection.png",
                "role": "grey",
                "into": ["reflectance"],
                **repeat,
            }
        },
        {"image": {"name": "roughness", "file": "a_Roughness.png", "role": "grey", "into": ["roughness"], **repeat}},
        {"image": {"name": "specular", "file": "a_spec.png", "role": "grey", "into": ["specular"], **repeat}},
        {
            "image": {
                "name": "scattering_radius",
                "file": "a_SSS.png",
                "role": "data",
                "into": ["scattering_radius"],
                **repeat,
            }
        },
    ]
    unknown = [record.getMessage() for record in caplog.records]
    assert len(unknown) == 2
    assert unknown[0].startswith(
        "maps/a_Displacement.png: its range is not known; black to white is taken as -0.5 to 0.5 mm"
    )
    assert unknown[0].endswith("--set skin.layers.bump.height=[LOW, HIGH]")
    assert unknown[1].endswith("--set skin.layers.scattering_radius.range=[LOW, HIGH]")


def test_a_relief_is_told_once(tmp_path: Path) -> None:
    folder = touch(tmp_path / "maps", "height.png", "bump.png", "normal.png")

    def relief() -> list[str]:
        return [layer["image"]["name"] for layer in find_maps(folder).layers()]

    assert relief() == ["height"]
    (folder / "height.png").unlink()
    assert relief() == ["bump"]
    (folder / "bump.png").unlink()
    assert relief() == ["normal"]
    assert find_maps(folder).layers()[0]["image"] == {
        "name": "normal",
        "file": "normal.png",
        "role": "normal_gl",
        "tile": "repeat",
    }


@pytest.mark.parametrize(("name", "reason"), [("a_arm_4k.png", "several maps"), ("a_Glossiness.png", "the opposite")])
def test_what_is_left_out_is_told(tmp_path: Path, name: str, reason: str, caplog: pytest.LogCaptureFixture) -> None:
    folder = touch(tmp_path / "maps", "a_diff_4k.png", name)
    with caplog.at_level(logging.WARNING, logger="skincli"):
        assert list(find_maps(folder).maps) == ["albedo"]
        assert f"{name}: is left out, for it" in caplog.text
        assert reason in caplog.text
        caplog.clear()
        touch(folder, "a_rough_4k.png")
        assert list(find_maps(folder).maps) == ["albedo", "roughness"]
    assert not caplog.records


# --------------------------------------------------------------------------------------------------------- manifest


@pytest.mark.parametrize("encoding", [PNG16, FLOAT], ids=lambda encoding: encoding.format)
def test_a_manifest_returns_ranges_and_conventions(
    tmp_path: Path, encoding: Encoding, caplog: pytest.LogCaptureFixture
) -> None:
    entries = {
        name: write_map(tmp_path / mapset.file_name(name, encoding), name, sample(name), encoding, "directx")
        for name in reversed(MAPS)
    }
    optics = {"radius": [1.0, 0.5, 0.3], "radius_kind": "dmfp"}
    path = write_manifest(
        tmp_path,
        Manifest(
            skin="own", about="Mine.", size=8, extent_mm=40, seed=5, maps=entries, optics=optics, surface={"blur": 3}
        ),
    )
    content = json.loads(path.read_text())
    assert (content["manifest"], content["skin"], content["size"], content["extent_mm"]) == (1, "own", 8, 40)
    assert content["versions"].keys() == {"skincli", "OpenImageIO"}
    assert "convention" not in content["maps"]["bump"]
    with caplog.at_level(logging.WARNING, logger="skincli"):
        found = find_maps(tmp_path)
    assert not caplog.records
    assert list(found.maps) == list(MAPS)
    assert (found.optics, found.surface, found.about, found.repeat) == (optics, {"blur": 3}, "Mine.", False)
    assert found.maps["normal"].role == "normal_dx"
    for name, one in found.maps.items():
        assert one == FoundMap(MAPS[name], entries[name].file, one.role, entries[name].range)
    low, high = found.maps["bump"].range
    height = low + (high - low) * stored(tmp_path / found.maps["bump"].file, 1)
    assert np.abs(height - sample("bump")).max() <= (high - low) / 65535
    layers = {layer["image"]["name"]: layer["image"] for layer in found.layers()}
    assert "bump" not in layers
    assert layers["height"]["height"] == ([low, high] if encoding == PNG16 else [0, 1])
    assert layers["scattering_radius"].get("range") == (
        list(entries["scattering_radius"].range) if encoding == PNG16 else None
    )
    assert {layer["tile"] for layer in layers.values()} == {"clamp"}


def test_a_manifest_is_byte_stable_and_may_say_more(tmp_path: Path) -> None:
    entry = write_map(tmp_path / "bump.png", "bump", sample("bump"), PNG16)
    manifest = Manifest(tileable=True, maps={"bump": entry}, versions={"driver": "x"})
    first = write_manifest(tmp_path, manifest).read_bytes()
    assert write_manifest(tmp_path, manifest).read_bytes() == first
    content = json.loads(first)
    assert content["versions"]["driver"] == "x"
    content |= {"of a later version": [1]}
    content["maps"]["bump"]["more"] = 1
    (tmp_path / "manifest.json").write_text(json.dumps(content))
    assert find_maps(tmp_path).repeat


def test_a_manifest_may_name_files_below_its_folder_and_unknown_maps(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    touch(tmp_path / "below", "x.png")
    maps = {"bump": {"file": "below/x.png", "range": [-1, 1]}, "glow": {"file": "g.png", "range": [0, 1]}}
    (tmp_path / "manifest.json").write_text(json.dumps({"manifest": 1, "maps": maps}))
    with caplog.at_level(logging.WARNING, logger="skincli"):
        assert files_of(tmp_path) == {"bump": "below/x.png"}
    assert "'glow' is no map that is known; it is left out" in caplog.text


def entry_of(file: str) -> dict[str, Any]:
    return {"file": file, "range": [0, 1]}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is not JSON: .*line 1 column 1; generate the maps again"),
        ("[" * 5000, "is not JSON: recursion"),
        ('{"manifest": 2, "maps": {}}', "manifest: Input should be 1; generate"),
        ('{"manifest": 1}', "maps: Field required"),
        ('{"manifest": 1, "maps": {}}', "names no map; there are: albedo"),
        ('{"manifest": 1, "maps": {"bump": {"file": "bump.png", "range": [0, NaN]}}}', r"bump\.range\.1: .*finite"),
        ('{"manifest": 1, "maps": {"bump": {"file": "bump.png", "range": [0]}}}', r"bump\.range\.1: Field required"),
        (json.dumps({"manifest": 1, "maps": {"bump": entry_of("bmp.png")}}), "no such file .*did you mean 'bump.png'"),
        (json.dumps({"manifest": 1, "maps": {"bump": entry_of("../secret.png")}}), "it leads outside the folder"),
        (json.dumps({"manifest": 1, "maps": {"bump": entry_of("/etc/passwd")}}), "it leads outside the folder"),
        (json.dumps({"manifest": 1, "maps": {"bump": entry_of("http://a/b.png")}}), "it must be a path, not a URL"),
    ],
)
def test_broken_manifests(tmp_path: Path, content: str, message: str) -> None:
    folder = touch(tmp_path / "maps", "bump.png")
    touch(tmp_path, "secret.png")
    (folder / "manifest.json").write_text(content)
    with pytest.raises(InputError, match=rf"^maps/manifest\.json: (maps\.)?(.*{message})"):
        find_maps(folder, label="maps")


def test_faults_of_a_manifest_come_together(tmp_path: Path) -> None:
    maps = {"bump": entry_of("a.png"), "albedo": entry_of("b.png")}
    (tmp_path / "manifest.json").write_text(json.dumps({"manifest": 1, "maps": maps}))
    with pytest.raises(InputError) as caught:
        find_maps(tmp_path)
    assert len(caught.value.faults) == 2


def test_a_manifest_beyond_reason(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text(" " * (2**20 + 1))
    with pytest.raises(LimitError, match="has 1048577 bytes; a manifest has at most 1048576"):
        find_maps(tmp_path)


def test_the_manifest_of_another_program_does_not_count(tmp_path: Path) -> None:
    folder = touch(tmp_path / "maps", "albedo.png")
    (folder / "manifest.json").write_text('{"name": "a web page"}')
    assert files_of(folder) == {"albedo": "albedo.png"}
