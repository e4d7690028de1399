"""`skincli render`: files, layers, the report, and what is seen of meshes that other programs have textured."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
import trimesh
from click.testing import Result
from numpy.typing import NDArray
from PIL import Image

from skincli import images
from skincli.color import srgb_decode
from skincli.graph import frame_graph
from skincli.pipeline import OUTPUTS

Run = Callable[..., Result]
Array = NDArray[Any]


def exr(path: Path) -> tuple[dict[str, str], dict[str, Array]]:
    """Return the format and the pixels of each channel."""
    source: Any = oiio.ImageInput.open(str(path))
    spec = source.spec()
    pixels = source.read_image("float")
    source.close()
    formats = {name: str(spec.channelformat(i)) for i, name in enumerate(spec.channelnames)}
    return formats, {name: pixels[..., i] for i, name in enumerate(spec.channelnames)}


def files_in(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def render(folder: Path, skincli: Run, ctx: object) -> Run:
    """Render scene.yaml; the command must do it without a word on stderr."""

    def run(*arguments: object, scene: str = "scene.yaml") -> Result:
        result = skincli("render", scene, *arguments)
        assert result.exit_code == 0, result.output
        assert not result.stderr
        return result

    return run


def test_every_output_is_a_layer_of_one_exr_or_of_its_atlas(render: Run, folder: Path) -> None:
    render("-o", "new/place/head.exr", "--outputs", ",".join(OUTPUTS))
    assert files_in(folder / "new") == {"place/head.exr", "place/head.atlas.exr"}
    letters = {1: "Y", 2: "UV", 3: "RGB", 4: "RGBA"}
    for file, room, size in (("head.exr", "view", (48, 64)), ("head.atlas.exr", "atlas", (64, 64))):
        formats, pixels = exr(folder / "new/place" / file)
        expected = {
            letter if name == "beauty" else f"{name}.{letter}": "half" if kind.color else "float"
            for name, kind in OUTPUTS.items()
            if kind.room == room
            for letter in ("Z" if name == "depth" else letters[kind.channels])
        }
        assert formats == expected
        for name, channel in pixels.items():
            assert channel.shape == size
            assert np.isfinite(channel).all(), name
            assert channel.any(), name
    formats, pixels = exr(folder / "new/place/head.exr")
    # The ball's front is 80 mm before its center, at which the camera looks from a distance of 613 mm.
    assert pixels["depth.Z"].max() < 640
    assert pixels["depth.Z"][24, 32] == pytest.approx(np.sqrt(120**2 + 40**2 + 600**2) - 80, abs=2)
    assert pixels["A"][24, 32] == 1
    assert pixels["A"][0, 0] == 0
    assert pixels["depth.Z"][0, 0] == 0


def test_an_exr_without_atlas_outputs_stands_alone(render: Run, folder: Path) -> None:
    render("-o", "a.exr", "--outputs", "depth,beauty")
    assert list(exr(folder / "a.exr")[1]) == ["R", "G", "B", "A", "depth.Z"]
    assert not list(folder.glob("*atlas*"))


def test_png_writes_one_file_per_output(render: Run, folder: Path) -> None:
    render("-o", "out/head.png", "--set", "outputs=[beauty, albedo, depth, normal, occlusion, uv, irradiance]")
    names = ("albedo", "depth", "normal", "occlusion", "uv", "irradiance")
    assert files_in(folder / "out") == {"head.png", *(f"head.{name}.png" for name in names)}
    beauty = np.asarray(Image.open(folder / "out/head.png"))
    assert (beauty.dtype, beauty.shape) == (np.uint8, (48, 64, 4))
    assert beauty[24, 32, 3] == 255
    assert beauty[0, 0, 3] == 0
    assert images.size_of(folder / "out/head.irradiance.png") == (64, 64)
    # Data are stored as they are, in 16 bits: a normal's three numbers have the length 1.
    normal = images.read_data(folder / "out/head.normal.png", 3)[24, 32] * 2 - 1
    assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-3)
    # Color is encoded: decoded, it is the albedo of the EXR file.
    render("-o", "out/head.exr", "--outputs", "albedo")
    albedo = exr(folder / "out/head.exr")[1]
    decoded = images.read_color(folder / "out/head.albedo.png")[24, 32]
    assert decoded[:3] == pytest.approx([albedo[f"albedo.{c}"][24, 32] for c in "RGB"], abs=0.01)


def test_settings_change_the_picture_and_later_ones_win(render: Run, folder: Path) -> None:
    size = ("--set", "render.size=[20, 10]", "--set", "camera.fov=20")
    render("-o", "a.exr", *size, "--set", "render.size=[32, 16]")
    render("-o", "b.exr", *size, "--set", "render.size=[32, 16]", "--set", "camera.fov=60")
    near, far = (exr(folder / name)[1]["A"] for name in ("a.exr", "b.exr"))
    assert near.shape == far.shape == (16, 32)
    assert 0 < far.sum() < near.sum()


def test_the_same_scene_gives_the_same_bytes(render: Run, folder: Path) -> None:
    outputs = ("--outputs", "beauty,depth,diffused")
    for name in ("first", "second"):
        render("-o", f"{name}.exr", *outputs)
        render("-o", f"{name}.png", *outputs)
    first = {path.name: path.read_bytes() for path in folder.glob("first.*")}
    assert len(first) == 5
    for name, data in first.items():
        assert (folder / name.replace("first", "second")).read_bytes() == data, name


@pytest.mark.parametrize("shading", ["physical", "paper"])
def test_no_skip_runs_everything_and_changes_no_byte(render: Run, folder: Path, shading: str) -> None:
    arguments = ("--outputs", "beauty,depth,diffused", "--set", f"render.shading={shading}")
    render("-o", "lazy.exr", *arguments)
    render("-o", "eager.exr", *arguments, "--no-skip", "--report", "eager.json")
    nodes = json.loads((folder / "eager.json").read_text())["frames"][0]["nodes"]
    assert {node["state"] for node in nodes} == {"ran"}
    for kind in ("exr", "atlas.exr"):
        assert (folder / f"eager.{kind}").read_bytes() == (folder / f"lazy.{kind}").read_bytes()


def test_the_report_and_explain_say_the_same(render: Run, folder: Path) -> None:
    # The mirror is off: what it alone would need is skipped, and the reason says so.
    mirror = ("--set", "skin.surface.reflectance=0")
    result = render("-o", "a.exr", "--explain", "--report", "reports/new/a.json", *mirror)
    report = json.loads((folder / "reports/new/a.json").read_text())
    assert set(report) >= {"device", "versions", "peak_bytes", "frames"}
    assert report["device"]["renderer"]
    assert set(report["versions"]) >= {"skincli", "moderngl", "numpy"}
    assert report["peak_bytes"] > 64 * 64 * 8
    (frame,) = report["frames"]
    assert frame["frame"] == 1
    assert frame["output"] == "a.exr"
    assert frame["ms"] > 0
    nodes = {node["name"]: node for node in frame["nodes"]}
    assert len(nodes) == len(frame["nodes"])
    assert {node["state"] for node in nodes.values()} == {"ran", "skipped"}
    for name, node in nodes.items():
        assert node["reason"], name
        ran = node["state"] == "ran"
        assert bool(node["key"]) is ran, name
        assert (node["ms"] is not None) is ran, name
        assert ran or node["bytes"] == 0, name
    assert nodes["compose"]["state"] == "ran"
    assert nodes["compose"]["bytes"] >= 64 * 48 * 8
    assert nodes["environment"]["state"] == nodes["reflection"]["state"] == "skipped"

    head, *lines = result.stdout.splitlines()
    assert head.split() == ["node", "state", "ms", "size", "key", "why"]
    assert len(lines) == len(nodes)
    for line, node in zip(lines, frame["nodes"], strict=True):
        assert line.startswith(node["name"])
        words = line.removeprefix(node["name"]).split()
        assert words[0] == node["state"]
        size = "x".join(map(str, node["size"]))
        assert size in words or size == "0x0"
        assert line.endswith(node["reason"])
        if node["state"] == "ran":
            assert node["key"][:8] in words
            assert f"{node['ms']:.1f}" in words


def test_without_report_nothing_is_told(render: Run) -> None:
    assert render("-o", "a.png").stdout == ""


def test_check_passes_a_good_scene(render: Run, folder: Path) -> None:
    render("-o", "a.png", "--check")
    assert (folder / "a.png").is_file()


def test_check_writes_nothing_where_a_node_left_a_nan(
    folder: Path, skincli: Run, ctx: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = "compose.beauty: 3 pixels are not finite, the first at column 1, row 2"
    monkeypatch.setattr(frame_graph, "_unfinite", lambda name, texture: found if name == "compose.beauty" else None)
    before = files_in(folder)
    result = skincli("render", "scene.yaml", "-o", "a.png", "--check", "--report", "a.json")
    assert result.exit_code == 1
    assert result.stderr == f"skincli: {found}\n"
    assert files_in(folder) == before


def test_a_name_may_be_as_long_as_the_file_system_allows(render: Run, folder: Path) -> None:
    name = "a" * (os.pathconf(folder, "PC_NAME_MAX") - 4) + ".png"
    render("-o", name)
    assert images.size_of(folder / name) == (64, 48)


def test_an_asset_root_opens_another_folder(render: Run, folder: Path) -> None:
    (folder / "scenes").mkdir()
    (folder / "assets").mkdir()
    text = (folder / "scene.yaml").read_text()
    for name in ("ball.obj", "sky.exr", "spots.png"):
        (folder / name).rename(folder / "assets" / name)
        text = text.replace(name, f"../assets/{name}")
    (folder / "scenes/scene.yaml").write_text(text)
    render("-o", "a.png", "--asset-root", "assets", scene="scenes/scene.yaml")
    assert (folder / "a.png").is_file()


def test_without_a_driver_the_exit_code_is_4(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "skincli", "render", "scene.yaml", "-o", "a.png"],
        env={
            **os.environ,
            "__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent",
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        },
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 4
    assert "no driver has registered" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "a.png").exists()


# -- meshes as other programs leave them -----------------------------------------------------------------------------

CAMERA = "camera: {position: [0, 0, 600], target: [0, 0, 0], fov: 30}\n"
FRONTAL = "ambient: [0.2, 0.2, 0.2]\nlights: [{type: directional, direction: [0, 0, -1], irradiance: [2, 2, 2]}]\n"


def ellipsoid(
    radii: tuple[float, float, float], center: tuple[float, float, float] = (0, 0, 0), rows: int = 16, columns: int = 32
) -> tuple[Array, Array, Array]:
    """Return positions, UVs and faces; u runs from the front's middle over +x around to the front again."""
    v, u = np.mgrid[0 : rows + 1, 0 : columns + 1]
    polar, around = np.pi * v / rows, 2 * np.pi * u / columns
    unit = np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], -1)
    corner = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, -1)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = [np.stack([d, b, c], -1)[:-1].reshape(-1, 3), np.stack([a, b, d], -1)[1:].reshape(-1, 3)]
    uv = np.stack([u / columns, 1 - v / rows], -1).reshape(-1, 2)
    return unit.reshape(-1, 3) * radii + np.array(center), uv, np.concatenate(faces)


def obj(positions: Array, uv: Array, faces: Array) -> str:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in positions] + [f"vt {u:.9f} {v:.9f}" for u, v in uv]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in faces]
    return "\n".join(lines) + "\n"


def quarters(*colors: tuple[int, int, int]) -> Image.Image:
    """Return a picture of four colors: top left, top right, bottom left, bottom right."""
    corners = np.array(colors, np.uint8).reshape(2, 2, 3)
    return Image.fromarray(corners.repeat(32, axis=0).repeat(32, axis=1))


def seen(path: Path, name: str, x: float, y: float, z: float) -> Array:
    """Return the color of an output where a point of the scene, in mm, is seen by CAMERA."""
    pixels = exr(path)[1]
    channels = "RGB" if name == "beauty" else [f"{name}.{c}" for c in "RGB"]
    picture = np.stack([pixels[c] for c in channels], axis=-1)
    height, width = picture.shape[:2]
    scale = height / 2 / np.tan(np.radians(15)) / (600 - z)
    color: Array = picture[int(height / 2 - y * scale), int(width / 2 + x * scale)]
    return color


def test_eyes_that_share_the_square_with_the_skin_keep_their_own_textures(render: Run, folder: Path) -> None:
    """Without `skin`, each part of a GLB file shows its own base color; all three use the UVs from 0 to 1."""
    skin = ((230, 180, 150), (150, 220, 150), (200, 90, 80), (90, 160, 90))
    left, right = ((20, 40, 230), (230, 220, 30)), ((250, 250, 250), (130, 20, 160))
    scene = trimesh.Scene()
    for name, radius, center, texture in (
        ("skin", (0.08, 0.1, 0.08), (0, 0, 0), quarters(*skin)),
        ("eye left", (0.02, 0.02, 0.02), (-0.03, 0.02, 0.07), quarters(left[0], left[0], left[1], left[1])),
        ("eye right", (0.02, 0.02, 0.02), (0.03, 0.02, 0.07), quarters(right[0], right[0], right[1], right[1])),
    ):
        positions, uv, faces = ellipsoid(radius, center)
        material = trimesh.visual.material.PBRMaterial(name=name, baseColorTexture=texture, metallicFactor=0)
        visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
        scene.add_geometry(trimesh.Trimesh(positions, faces, visual=visual, process=False), name, name)
    (folder / "eyes.glb").write_bytes(scene.export(file_type="glb"))
    (folder / "eyes.yaml").write_text(
        "scene: 1\nmesh: {file: eyes.glb}\nrender: {size: [160, 160], supersample: 1, atlas: 256}\n"
        f"outputs: [beauty, albedo]\n{CAMERA}{FRONTAL}"
    )
    render("-o", "eyes.exr", scene="eyes.yaml")
    for color, (x, y, z) in (
        # u begins at the front's middle and runs over +x: the picture's left half lies on the +x side.
        (skin[0], (30, 60, 60)),
        (skin[1], (-30, 60, 60)),
        (skin[2], (30, -30, 70)),
        (skin[3], (-30, -30, 70)),
        (left[0], (-30, 28, 88)),
        (left[1], (-30, 12, 88)),
        (right[0], (30, 28, 88)),
        (right[1], (30, 12, 88)),
    ):
        expected = srgb_decode(np.array(color) / 255)
        assert seen(folder / "eyes.exr", "albedo", x, y, z) == pytest.approx(expected, abs=0.004), color
        # A material of the file scatters nothing: the light that it reflects has its own color.
        beauty = seen(folder / "eyes.exr", "beauty", x, y, z)
        assert beauty.max() > 0.05
        assert beauty / beauty.max() == pytest.approx(expected / expected.max(), abs=0.02), color

    # With a skin for all, a part may keep the file's own material.
    own = ("--set", "skin={layers: [color: {albedo: [0.5, 0.25, 0.1]}]}", "--set", 'parts={"eye left": {skin: null}}')
    render("-o", "skin.exr", *own, scene="eyes.yaml")
    assert seen(folder / "skin.exr", "albedo", 30, 60, 60) == pytest.approx((0.5, 0.25, 0.1), abs=0.002)
    assert seen(folder / "skin.exr", "albedo", 30, 28, 88) == pytest.approx((0.5, 0.25, 0.1), abs=0.002)
    expected = srgb_decode(np.array(left[0]) / 255)
    assert seen(folder / "skin.exr", "albedo", -30, 28, 88) == pytest.approx(expected, abs=0.004)


@pytest.fixture
def mirrored(folder: Path) -> Path:
    """A head whose halves share their UVs: u is 0 in the front's middle and 1 at the back on either side."""
    positions, uv, faces = ellipsoid((80, 100, 80))
    uv[:, 0] = 1 - np.abs(2 * uv[:, 0] - 1)
    half = faces[(positions[faces, 0] > -1e-6).all(axis=1)]
    assert 2 * len(half) == len(faces)
    other = positions * (-1, 1, 1)
    both = np.concatenate([half, half[:, ::-1] + len(positions)])
    (folder / "mirrored.obj").write_text(
        "mtllib mirrored.mtl\nusemtl own\n" + obj(np.concatenate([positions, other]), np.concatenate([uv, uv]), both)
    )
    (folder / "mirrored.mtl").write_text("newmtl own\nmap_Kd mirrored.png\n")
    # Left of the picture: front; top: forehead.
    quarters((230, 180, 150), (40, 40, 200), (200, 60, 60), (40, 160, 40)).save(folder / "mirrored.png")
    wave = np.linspace(0, 4 * np.pi, 64, endpoint=False)
    relief = 0.5 + 0.25 * np.sin(wave)[:, None] + 0.25 * np.sin(wave + 1)[None, :]
    images.write_png(folder / "relief.png", relief, kind="data", bits=16)
    tilt = np.dstack([0.5 + 0.2 * np.sin(relief * 9), 0.5 + 0.2 * np.cos(relief * 7), np.full_like(relief, 0.9)])
    images.write_png(folder / "tilt.png", tilt, kind="data", bits=16)
    (folder / "mirrored.yaml").write_text(
        "scene: 1\nmesh: {file: mirrored.obj, unit: mm}\nrender: {size: [160, 160], supersample: 1, atlas: 512}\n"
        f"outputs: [beauty, albedo, normal]\n{CAMERA}{FRONTAL}"
    )
    return folder / "mirrored.yaml"


def test_mirrored_halves_show_the_texture_on_both_sides(render: Run, folder: Path, mirrored: Path) -> None:
    render("-o", "mirrored.exr", scene=str(mirrored))
    for side in (-1, 1):
        for color, (x, y, z) in (((230, 180, 150), (20, 50, 66)), ((200, 60, 60), (20, -50, 66))):
            expected = srgb_decode(np.array(color) / 255)
            assert seen(folder / "mirrored.exr", "albedo", side * x, y, z) == pytest.approx(expected, abs=0.004)
            beauty = seen(folder / "mirrored.exr", "beauty", side * x, y, z)
            assert beauty / beauty.max() == pytest.approx(expected / expected.max(), abs=0.02)


@pytest.mark.parametrize(
    "layer", ["{file: relief.png, role: grey, height: [-10, 10]}", "{file: tilt.png, role: normal_gl}"]
)
def test_relief_on_mirrored_halves_is_mirrored(render: Run, folder: Path, mirrored: Path, layer: str) -> None:
    """Both halves read one map of heights or normals, and yet bump outward on either side, as each other's mirror."""
    with mirrored.open("a") as file:
        file.write(f"skin: {{size: 256, layers: [image: {layer}]}}\n")
    render("-o", "mirrored.exr", scene=str(mirrored))
    pixels = exr(folder / "mirrored.exr")[1]
    normal = np.stack([pixels[f"normal.{c}"] for c in "RGB"], axis=-1)
    covered = np.asarray(normal.astype(bool).any(axis=-1))
    inside = covered & covered[:, ::-1]
    difference = np.linalg.norm(normal - normal[:, ::-1] * (-1, 1, 1), axis=-1)[inside]
    # The rounding of the two halves' triangles differs along their edges.
    assert np.quantile(difference, 0.98) < 0.02
    plain = folder / "plain.exr"
    render("-o", plain, "--set", "skin.surface.bumpiness=0", scene=str(mirrored))
    smooth = np.stack([exr(plain)[1][f"normal.{c}"] for c in "RGB"], axis=-1)
    assert np.linalg.norm(normal - smooth, axis=-1)[inside].mean() > 0.1


@pytest.mark.parametrize("kind", ["stl", "ply", "obj"])
def test_a_head_without_uvs_two_units_tall_works_at_once(render: Run, folder: Path, kind: str) -> None:
    positions, _, faces = ellipsoid((0.8, 1, 0.85), rows=26, columns=50)
    shape = trimesh.Trimesh(positions, faces, process=False)
    shape.merge_vertices(digits_vertex=6)
    assert len(shape.faces) == 2500
    shape.export(folder / f"head.{kind}")
    (folder / "head.yaml").write_text(
        f"scene: 1\nmesh: {{file: head.{kind}, unit: 115}}\nskin: human\n{FRONTAL}"
        "render: {size: [48, 48], supersample: 1, atlas: 256}\noutputs: [beauty, depth]\n"
    )
    render("-o", "head.exr", "--set", "skin.size=256", scene="head.yaml")
    _, pixels = exr(folder / "head.exr")
    covered = pixels["A"] > 0
    assert 0.2 < covered.mean() < 0.8  # framed by itself
    assert all(np.isfinite(channel).all() for channel in pixels.values())
    # Skin is lit, and redder than blue.
    assert pixels["R"][24, 24] > 1.2 * pixels["B"][24, 24] > 0.02


def test_a_report_never_overwrites_what_is_no_report(skincli: Run, folder: Path) -> None:
    before = (folder / "scene.yaml").read_bytes()
    for name in ("scene.yaml", "a.png"):
        result = skincli("render", "scene.yaml", "-o", "a.png", "--report", name)
        assert result.exit_code == 2
        assert "a report ends in .json" in result.stderr
    assert (folder / "scene.yaml").read_bytes() == before
    assert not (folder / "a.png").exists()


def test_uv_is_a_color_picture_in_png(render: Run, folder: Path) -> None:
    render("-o", "a.png", "--outputs", "uv,depth")
    assert images.read_data(folder / "a.uv.png", 3).shape == (48, 64, 3)


def test_the_report_tells_what_a_png_of_depth_spans(render: Run, folder: Path) -> None:
    render("-o", "a.png", "--outputs", "depth", "--report", "a.json")
    [low], [high] = json.loads((folder / "a.json").read_text())["frames"][0]["png_ranges_mm"]["depth"]
    assert 500 < low < high < 620
    stored = images.read_data(folder / "a.depth.png", 1)
    assert stored.max() == 1  # the nearest point
    assert stored[stored > 0].min() == pytest.approx(0.1, abs=1e-4)  # the farthest
    assert stored[0, 0] == 0
