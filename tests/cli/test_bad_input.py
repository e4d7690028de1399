"""Bad input gives one clear message and the right exit code, and neither it nor Ctrl-C leaves anything on the disk."""

from __future__ import annotations

import errno
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
import trimesh
from click.testing import Result

import skincli as package
from skincli import images

Run = Callable[..., Result]
Change = Callable[[Path], object]

RENDER = ("render", "scene.yaml", "-o", "out/a.exr")
OUTPUTS = ("--outputs", "beauty,depth,irradiance")


def tree(folder: Path) -> dict[str, bytes | None]:
    """Return everything in a folder: the bytes of files, None for folders."""
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.fixture(autouse=True)
def _own_cache(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Hold each test to leave no temporary file behind, be it in the folder or in the cache."""
    cache = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("SKINCLI_CACHE", str(cache))
    yield
    assert [name for where in (folder, cache) for name in tree(where) if Path(name).name.startswith(".")] == []


# -- changes to the good scene ---------------------------------------------------------------------------------------


def nothing(folder: Path) -> None:
    pass


def scene(old: str, new: str) -> Change:
    """Write the scene differently."""

    def change(folder: Path) -> None:
        text = (folder / "scene.yaml").read_text()
        assert text.count(old) == 1
        (folder / "scene.yaml").write_text(text.replace(old, new))

    return change


def skin(text: str) -> Change:
    """Write another skin into the scene."""

    def change(folder: Path) -> None:
        before, rest = (folder / "scene.yaml").read_text().split("skin:", 1)
        (folder / "scene.yaml").write_text(f"{before}skin: {text}\n{rest[rest.index('camera:') :]}")

    return change


def write(name: str, content: str | bytes) -> Change:
    return lambda folder: (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)


def make(name: str) -> Change:
    """Make a folder."""
    return lambda folder: (folder / name).mkdir()


def remove(name: str) -> Change:
    return lambda folder: (folder / name).unlink()


def cut(name: str, keep: int) -> Change:
    """Keep the first bytes of a file, or all but the last."""
    return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:keep])


def mesh(name: str, content: str | bytes | Callable[[], bytes]) -> Change:
    """Exchange the mesh for another file."""

    def change(folder: Path) -> None:
        (folder / "ball.obj").unlink()
        scene("ball.obj", name)(folder)
        write(name, content() if callable(content) else content)(folder)

    return change


def layers(*written: str) -> Change:
    """Write a skin of these layers into the scene."""
    return skin(f"{{layers: [{', '.join(f'{{{layer}}}' for layer in written)}]}}")


def spots(name: str, shift: int = 0) -> Change:
    """Copy the picture, its columns moved on."""

    def change(folder: Path) -> None:
        images.write_png(folder / name, np.roll(images.read_color(folder / "spots.png"), shift, axis=1))

    return change


def alpha_alone(folder: Path) -> None:
    spec = oiio.ImageSpec(4, 4, 1, oiio.HALF)
    spec.channelnames = ("A",)
    picture = oiio.ImageBuf(spec)
    assert picture.write(str(folder / "alpha.exr"))


def wide(folder: Path) -> None:
    images.write_png(folder / "wide.png", np.zeros((1, 33000)))


def several(*changes: Change) -> Change:
    return lambda folder: [change(folder) for change in changes]


def shape(kind: str, edit: Callable[[bytearray], None] = lambda data: None) -> Callable[[], bytes]:
    """Return a maker of a small mesh file, whose bytes `edit` may spoil."""

    def make() -> bytes:
        data = bytearray(trimesh.creation.icosphere(subdivisions=1).export(file_type=kind))
        edit(data)
        return bytes(data)

    return make


def put(form: str, position: int, value: float) -> Callable[[bytearray], None]:
    """Return an edit that overwrites a number; positions below 0 count from the end."""

    def edit(data: bytearray) -> None:
        struct.pack_into(form, data, position if position >= 0 else len(data) + position, value)

    return edit


def cut_data(keep: int) -> Callable[[bytearray], None]:
    def edit(data: bytearray) -> None:
        del data[keep:]

    return edit


def link(name: str, target: str) -> Change:
    def change(folder: Path) -> None:
        (folder / name).unlink()
        (folder / name).symlink_to(target)

    return change


TRIANGLE = "v 0 0 0\nv 100 0 0\nv 0 100 0\n"
GLTF = (
    '{"asset": {"version": "2.0"}, "buffers": [{"uri": "../secret.bin", "byteLength": 36}], '
    '"bufferViews": [{"buffer": 0, "byteLength": 36}], '
    '"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", '
    '"min": [0, 0, 0], "max": [1, 1, 1]}], '
    '"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}'
)


# what is wrong -> (change to the scene's folder, further arguments, exit code, beginning of the message, part of it)
CASES: dict[str, tuple[Change, tuple[str, ...], int, str, str]] = {
    # the scene file
    "scene missing": (remove("scene.yaml"), (), 3, "scene.yaml: no such file", ""),
    "scene not UTF-8": (write("scene.yaml", b"scene: 1\n# \xe9\n"), (), 3, "scene.yaml:2:3: the byte 0xe9", "UTF-8"),
    "scene empty": (write("scene.yaml", ""), (), 3, "scene.yaml:1:1: the scene is empty", "a mapping"),
    "scene no YAML": (write("scene.yaml", "a: [1\nb: 2\n"), (), 3, "scene.yaml:2:", "not valid YAML"),
    "scene version": (scene("scene: 1", "scene: 2"), (), 3, "scene.yaml:1:8: scene is 2", "1"),
    "unknown key": (scene("lights:", "lihgts:"), (), 3, "scene.yaml:11:1: ", "did you mean 'lights'?"),
    "unknown layer": (scene("fbm:", "fmb:"), (), 3, "scene.yaml:7:", "'fbm'"),
    "unknown preset": (skin("humn"), (), 3, "scene.yaml:3:7: ", "did you mean 'human'?"),
    "unknown output": (scene("scene: 1\n", "scene: 1\noutputs: [beuaty]\n"), (), 3, "scene.yaml:2:11: ", "'beauty'"),
    "no outputs": (nothing, ("--outputs", ""), 3, "--set outputs=[]: ", "at least 1"),
    "output asked for": (nothing, ("--outputs", "uv,beuaty"), 2, "--outputs uv,beuaty: ", "did you mean 'beauty'?"),
    # values
    "wrong unit": (scene("unit: mm", "unit: mn"), (), 3, "scene.yaml:2:30: mesh.unit is 'mn'", "mm, cm, m, in"),
    "no unit": (scene(", unit: mm", ""), (), 3, "scene.yaml:2:", "does not say its unit; write unit: mm"),
    "unit 0": (scene("unit: mm", "unit: 0"), (), 3, "scene.yaml:2:30: mesh.unit is 0", "above 0"),
    "unit too large": (scene("unit: mm", "unit: 1e6"), (), 3, "ball.obj: the mesh measures 2e+08 mm", "unit"),
    "unit too small": (scene("unit: mm", "unit: 1e-7"), (), 3, "ball.obj: the mesh measures 2e-05 mm", "unit"),
    "size 0": (scene("[64, 48]", "[0, 48]"), (), 3, "scene.yaml:14:17: render.size[0] is 0", "at least 1"),
    "size 10^6": (scene("[64, 48]", "[64, 1000000]"), (), 3, "scene.yaml:14:21: render.size[1]", "at most 16384"),
    "size not whole": (scene("[64, 48]", "[64, 4.5]"), (), 3, "scene.yaml:14:21: render.size[1]", "a whole number"),
    "size of three": (scene("[64, 48]", "[64, 48, 1]"), (), 3, "scene.yaml:14:16: render.size", "it must have 2"),
    "atlas 10^6": (scene("atlas: 64", "atlas: 1000000"), (), 3, "scene.yaml:14:49: render.atlas", "at most 16384"),
    "skin size 0": (scene("size: 64\n", "size: 0\n"), (), 3, "scene.yaml:4:9: skin.size is 0", "at least 1"),
    "beyond the driver": (
        scene("supersample: 1", "supersample: 4"),
        ("--set", "render.size=[16384, 1]"),
        6,
        "a texture of 65536 x 4 is asked for",
        "this driver allows",
    ),
    "camera at its target": (
        scene("target: [0, 0, 0]", "target: [120, 40, 600]"),
        (),
        3,
        "scene.yaml:10:1: camera: position and target are both",
        "move one of them",
    ),
    "camera along its up": (scene("fov: 30", "fov: 30, up: [12, 4, 60]"), (), 3, "scene.yaml:10:1: camera", "up"),
    "fov 0": (scene("fov: 30", "fov: 0"), (), 3, "scene.yaml:10:60: camera.fov is 0", "at least 0.001"),
    "fov next to 0": (scene("fov: 30", "fov: 1e-300"), (), 3, "scene.yaml:10:60: camera.fov is 1e-300", "at least"),
    "fov 180": (scene("fov: 30", "fov: 180"), (), 3, "scene.yaml:10:60: camera.fov is 180", "less than 180"),
    "fov NaN": (scene("fov: 30", "fov: .nan"), (), 3, "scene.yaml:10:60: camera.fov is nan", "finite"),
    "light without direction": (
        scene("direction: [-0.5, -0.3, -1]", "direction: [0, 0, 0]"),
        (),
        3,
        "scene.yaml:12:",
        "must not be zero",
    ),
    "albedo of two numbers": (scene("[0.6, 0.4, 0.3]", "[0.6, 0.4]"), (), 3, "scene.yaml:6:", "3"),
    # the mesh
    "mesh missing": (remove("ball.obj"), (), 3, "scene.yaml:2:14: mesh.file is 'ball.obj'; no such file", ""),
    "mesh a folder": (several(remove("ball.obj"), make("ball.obj")), (), 3, "scene.yaml:2:14: ", "folder"),
    "mesh empty": (write("ball.obj", ""), (), 3, "ball.obj: ", "empty"),
    "mesh garbage": (write("ball.obj", "hello\nworld\n"), (), 3, "ball.obj: there is no face", "at least one triangle"),
    "mesh of bytes": (write("ball.obj", bytes(range(256)) * 9), (), 3, "ball.obj", ""),
    "no such part": (scene("lights:", "parts: {B: {skin: human}}\nlights:"), (), 3, "scene.yaml:11:9: ", "no part 'B'"),
    "no such built-in": (scene("{file: ball.obj, unit: mm}", "{builtin: hed}"), (), 3, "scene.yaml:2:", "'head'"),
    "NaN vertex": (write("ball.obj", "v 0 nan 0\n" + TRIANGLE + "f 2 3 4\n"), (), 3, "ball.obj:1: ", "finite numbers"),
    "infinite vertex": (write("ball.obj", TRIANGLE + "v 1e999 0 0\nf 1 2 3\n"), (), 3, "ball.obj:4: ", "finite"),
    "far from all": (write("ball.obj", "v 0 1e9 0\nv 9 1e9 0\nv 0 1e9 9\nf 1 2 3\n"), (), 3, "ball.obj: ", "1e+08 mm"),
    "no triangle": (write("ball.obj", TRIANGLE), (), 3, "ball.obj: ", "at least one triangle"),
    "triangles without area": (write("ball.obj", TRIANGLE + "f 1 2 2\n"), (), 3, "ball.obj: ", "non-zero area"),
    "index out of range": (write("ball.obj", TRIANGLE + "f 1 2 4\n"), (), 3, "ball.obj:4: ", "1 to 3"),
    "UV index out of range": (write("ball.obj", TRIANGLE + "vt 0 0\nf 1/1 2/1 3/2\n"), (), 3, "ball.obj:5: ", "1 to 1"),
    "material file outside": (
        write("ball.obj", "mtllib ../secret.mtl\n" + TRIANGLE + "f 1 2 3\n"),
        (),
        3,
        "ball.obj: refers to '../secret.mtl', outside",
        "--asset-root",
    ),
    "buffer outside": (mesh("ball.gltf", GLTF), (), 3, "ball.gltf: refers to '../secret.bin', outside", "--asset-root"),
    "mesh of another type": (mesh("ball.fbx", b"Kaydara FBX Binary"), (), 3, "ball.fbx: ", ".obj, .ply, .stl"),
    "GLB cut": (mesh("ball.glb", shape("glb", cut_data(-200))), (), 3, "ball.glb: ", "the file is cut"),
    "GLB text": (mesh("ball.glb", "hello"), (), 3, "ball.glb: ", "damaged"),
    "GLB index": (mesh("ball.glb", shape("glb", put("<I", 1000, 60000))), (), 3, "ball.glb: ", "has 42 vertices"),
    "STL cut": (mesh("ball.stl", shape("stl", cut_data(500))), (), 3, "ball.stl: ", "500 bytes"),
    "STL NaN": (mesh("ball.stl", shape("stl", put("<f", 100, np.nan))), (), 3, "ball.stl: ", "finite"),
    "PLY cut": (mesh("ball.ply", shape("ply", cut_data(500))), (), 3, "ball.ply: ", "the file is cut"),
    "PLY index": (mesh("ball.ply", shape("ply", put("<i", -4, 999))), (), 3, "ball.ply: ", "vertices"),
    # pictures
    "environment missing": (remove("sky.exr"), (), 3, "scene.yaml:13:22: environment.image is 'sky.exr'; no such", ""),
    "environment empty": (write("sky.exr", ""), (), 3, "scene.yaml:13:22: ", "empty; a picture may be"),
    "environment text": (write("sky.exr", "hello"), (), 3, "scene.yaml:13:22: ", "a picture may be"),
    "environment a mesh": (scene("sky.exr", "ball.obj"), (), 3, "scene.yaml:13:22: ", "a picture may be"),
    "environment cut": (cut("sky.exr", -200), (), 3, "", "sky.exr: is damaged"),
    "environment cut early": (cut("sky.exr", 100), (), 3, "scene.yaml:13:22: ", "a picture may be"),
    "environment too large": (several(wide, scene("sky.exr", "wide.png")), (), 6, "", "is 33000 x 1 pixels"),
    "layer's image missing": (remove("spots.png"), (), 3, "scene.yaml:8:21: skin.layers[2].image.file", "no such file"),
    "layer's image cut": (cut("spots.png", -100), (), 3, "", "spots.png: is damaged"),
    "layer's image text": (write("spots.png", "hello"), (), 3, "scene.yaml:8:21: skin.layers[2]", "a picture may be"),
    # layers
    "unknown mode": (
        layers("fbm: {height: [0, 1], blend: mutliply}"),
        (),
        3,
        "scene.yaml:3:47: skin.layers[0].fbm.blend is 'mutliply'",
        "did you mean 'multiply'?",
    ),
    "spacing 0": (layers("pores: {spacing: 0}"), (), 3, "scene.yaml:3:35: skin.layers[0].pores.spacing is 0", "0.01"),
    "unknown key of a layer": (layers("pores: {spacng: 1}"), (), 3, "scene.yaml:3:26: ", "did you mean 'spacing'?"),
    "mask without pattern": (layers("pores: {mask: {color: {height: 1}}}"), (), 3, "scene.yaml:3:", "no pattern"),
    "mask of itself": (
        layers("fbm: {height: [0, 1], mask: &m {fbm: {mask: *m}}}"),
        (),
        3,
        "scene.yaml:3:62: the alias *m contains itself",
        "write the value out",
    ),
    "masks deeper than any reader": (
        layers(f"fbm: {{height: [0, 1]{', mask: {fbm: {scale: 9' * 40}{'}}' * 40}}}"),
        (),
        6,
        "scene.yaml:3:",
        "64",
    ),
    "too many layers": (
        layers(*(f"fbm: {{scale: 10, seed: {seed}, height: [0, 0.01]}}" for seed in range(200))),
        (),
        6,
        "the layers of a skin and their masks evaluate 200 patterns; at most 100 are allowed",
        "lay these as image layers",
    ),
    "too many images": (
        several(
            *(spots(f"{index}.png", index) for index in range(13)),
            layers(*(f"image: {{file: {index}.png}}" for index in range(13))),
        ),
        (),
        6,
        "the layers of a skin sample 13 images; at most 12 are allowed",
        "merge some",
    ),
    "layer's image of alpha alone": (
        several(alpha_alone, layers("image: {file: alpha.exr}")),
        (),
        3,
        "",
        "alpha.exr: has the channels A; a color picture needs R, G and B or one gray channel",
    ),
    "layer's image too wide": (several(wide, layers("image: {file: wide.png}")), (), 6, "", "wide.png: is 33000 x 1"),
    # a folder of maps as a skin
    "no such folder": (skin("maps/"), (), 3, "scene.yaml:3:7: skin is 'maps/'; no such file", ""),
    "folder without maps": (several(make("maps"), skin("maps/")), (), 3, "maps: holds no map", "albedo.png"),
    "folder by a bare name": (several(make("maps"), skin("maps")), (), 3, "maps: holds no map", "albedo.png"),
    "folder outside": (skin("../"), (), 3, "scene.yaml:3:7: skin is '../'; it leads outside", "--asset-root"),
    "maps of two kinds": (
        several(make("maps"), spots("maps/a_Color.png"), spots("maps/b_Color.png"), skin("maps/")),
        (),
        3,
        "maps: holds more than one albedo map",
        "'a_Color.png' and 'b_Color.png'",
    ),
    "map cut": (
        several(make("maps"), spots("maps/a_Color.png"), cut("maps/a_Color.png", -100), skin("maps/")),
        (),
        3,
        "",
        "a_Color.png: is damaged",
    ),
    "map is text": (
        several(make("maps"), write("maps/a_Color.png", "hello"), skin("maps/")),
        (),
        3,
        "maps/a_Color.png: ",
        "a picture may be",
    ),
    "manifest broken": (
        several(make("maps"), write("maps/manifest.json", "{"), skin("maps/")),
        (),
        3,
        "maps/manifest.json: is not JSON",
        "generate the maps again",
    ),
    # paths
    "outside": (scene("ball.obj", "../ball.obj"), (), 3, "scene.yaml:2:14: mesh.file is '../ball", "leads outside"),
    "absolute": (scene("ball.obj", "/etc/x.obj"), (), 3, "scene.yaml:2:14: mesh.file is '/etc/x.obj'", "leads outside"),
    "link": (link("sky.exr", "/etc/passwd"), (), 3, "scene.yaml:13:22: ", "by a symbolic link outside"),
    "links in a circle": (link("sky.exr", "sky.exr"), (), 3, "scene.yaml:13:22: ", ""),
    "URL": (scene("sky.exr", "https://x.org/sky.exr"), (), 3, "scene.yaml:13:22: ", "not a URL"),
    "skin outside": (skin("../a.yaml"), (), 3, "scene.yaml:3:7: ", "leads outside"),
    # the command line
    "no asset root": (nothing, ("--asset-root", "no/where"), 3, "--asset-root names 'no/where'", "an existing folder"),
    "setting without =": (nothing, ("--set", "camera.fov"), 2, "--set camera.fov: there is no '='", "PATH=VALUE"),
    "setting without path": (nothing, ("--set", "=3"), 2, "--set =3: ", "is not a path"),
    "setting unknown": (nothing, ("--set", "camera.fow=3"), 3, "--set camera.fow=3: ", "did you mean 'fov'?"),
    "setting out of range": (nothing, ("--set", "camera.fov=181"), 3, "--set camera.fov=181: ", "less than 180"),
    "report below a file": (nothing, ("--report", "ball.obj/r.json"), 7, "ball.obj/r.json: ", "is not a folder"),
    "report onto a folder": (make("r.json"), ("--report", "r.json"), 7, "r.json: ", "not a file"),
    "suffix missing": (nothing, ("-o", "a"), 2, "-o a: a picture file ends in .exr or .png", "a.png"),
    "suffix wrong": (nothing, ("-o", "a.jpg"), 2, "-o a.jpg: a picture file ends in .exr or .png", "a.png"),
    "output below a file": (nothing, ("-o", "ball.obj/new/a.exr"), 7, "ball.obj/new/a.exr: ", "is not a folder"),
    "output onto a folder": (make("a.png"), ("-o", "a.png"), 7, "a.png: ", "not a file"),
    "second output onto a folder": (
        make("a.atlas.exr"),
        ("-o", "a.exr", *OUTPUTS),
        7,
        "a.atlas.exr: ",
        "not a file",
    ),
}  # fmt: skip


def refused(skincli: Run, folder: Path, code: int, *arguments: str) -> str:
    """Run a command line that must fail cleanly; return its one message."""
    before = tree(folder)
    result = skincli(*arguments)
    assert result.exit_code == code, result.output
    assert not result.stdout
    assert "Traceback" not in result.stderr
    assert "bug" not in result.stderr
    assert tree(folder) == before
    lines = result.stderr.splitlines()
    if code != 2 or lines[0].startswith("skincli: "):
        assert len(lines) == 1, result.stderr
    return lines[-1].removeprefix("skincli: ")


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_refused_cleanly(ctx: object, skincli: Run, folder: Path, name: str) -> None:
    change, arguments, code, beginning, part = CASES[name]
    change(folder)
    message = refused(skincli, folder, code, *RENDER, *arguments)
    assert message.startswith(beginning)
    assert part in message


def test_the_scene_all_cases_spoil_is_good(ctx: object, skincli: Run, folder: Path) -> None:
    result = skincli(*RENDER)
    assert (result.exit_code, result.output) == (0, "")


def test_a_folder_is_no_scene(skincli: Run, folder: Path) -> None:
    assert refused(skincli, folder, 3, "render", ".", "-o", "a.png").startswith(".: that is a folder")


@pytest.mark.parametrize("arguments", [("render", "scene.yaml"), ("render", "-o", "a.png"), ("render", "-x")])
def test_an_incomplete_command_line_is_a_usage_error(skincli: Run, folder: Path, arguments: tuple[str, ...]) -> None:
    assert refused(skincli, folder, 2, *arguments).startswith("Error: ")


def test_all_faults_of_the_scene_come_together(skincli: Run, folder: Path) -> None:
    several(scene("unit: mm", "unit: mn"), scene("lights:", "lihgts:"), remove("sky.exr"))(folder)
    result = skincli(*RENDER, "--set", "camera.fov=0")
    assert result.exit_code == 3
    places = [line.removeprefix("skincli: ").split(": ")[0] for line in result.stderr.splitlines()]
    assert places == ["scene.yaml:2:30", "scene.yaml:11:1", "scene.yaml:13:22", "--set camera.fov=0"]


def test_a_picture_of_one_pixel_and_pixels_that_are_no_numbers_are_taken(
    ctx: object, skincli: Run, folder: Path
) -> None:
    images.write_exr("sky.exr", {"beauty": np.ones((1, 1, 3), np.float32)})
    assert skincli(*RENDER, "--check").exit_code == 0
    images.write_exr("sky.exr", {"beauty": np.full((4, 8, 3), np.nan, np.float32)}, half=False)
    result = skincli(*RENDER, "--check")
    assert result.exit_code == 0
    assert "sky.exr: 96 values are NaN or infinite" in result.stderr


def test_a_layers_image_may_be_of_one_pixel_or_very_wide(ctx: object, skincli: Run, folder: Path) -> None:
    images.write_png(folder / "one.png", np.full((1, 1), 0.5))
    images.write_png(folder / "long.png", np.tile([0.25, 0.75], (1, 15000)))
    layers("image: {file: one.png, blend: multiply}", "image: {file: long.png, opacity: 0.5}")(folder)
    result = skincli("generate", "--scene", "scene.yaml", "-o", "maps", "--size", 16, "--maps", "albedo")
    assert result.exit_code == 0
    assert "a picture of 30000 x 1 is reduced" in result.stderr
    albedo = images.read_color(folder / "maps/albedo.png")[..., 0]
    assert 0.1 < albedo.min() <= albedo.max() < 0.9


#: two triangles in the tiles 1001 and 1002, one of them a part of its own or not
UDIM = """v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 60\nv 50 0 60\nv 0 50 60
vt 0 0\nvt 1 0\nvt 0 1\nvt 1 0\nvt 2 0\nvt 1 1\no first\nf 1/1 2/2 3/3\n{}f 4/4 5/5 6/6\n"""


@pytest.mark.parametrize(
    "arguments", [RENDER, ("generate", "human", "--mesh", "ball.obj", "--unit", "mm", "--size", "8", "-o", "maps")]
)
def test_udim_tiles_are_refused_unless_each_is_a_part(
    ctx: object, skincli: Run, folder: Path, arguments: tuple[str, ...]
) -> None:
    (folder / "ball.obj").write_text(UDIM.format(""))
    message = refused(skincli, folder, 6, *arguments)
    assert message.startswith("the uv of 'first' lie in 2 UDIM tiles: 1001, 1002; a skin's maps fill one tile; lay the")
    (folder / "ball.obj").write_text(UDIM.format("o second\n"))
    assert skincli(*arguments).exit_code == 0


MAPS = ("-o", "maps")
MESH = ("human", *MAPS, "--mesh")


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (MAPS, 2, "name a SKIN, such as human, or a --scene"),
        (("human", *MAPS, "--scene", "scene.yaml"), 2, "leave out SKIN and --mesh"),
        (("--scene", "scene.yaml", *MAPS, "--set", "skin=null"), 2, "there is no skin in it"),
        (("human", *MAPS, "--maps", "albdo"), 2, "did you mean 'albedo'?"),
        (("human", *MAPS, "--maps", ","), 2, "names no map"),
        (("human", *MAPS, "--format", "png", "--depth", "half"), 2, "png holds no maps of depth half"),
        (("human", *MAPS, "--unit", "mm"), 2, "belongs to a file named by --mesh"),
        ((*MESH, "ball.obj"), 2, "does not say its unit; write unit: mm"),
        ((*MESH, "ball.obj", "--unit", "mn"), 2, "it must be one of mm, cm, m, in"),
        ((*MESH, "none.obj", "--unit", "mm"), 3, "none.obj: the file does not exist"),
        ((*MESH, "builtin:hed"), 3, "did you mean 'head'?"),
        ((*MESH, "builtin:head:5k"), 3, "has no detail '5k'"),
        ((".", *MAPS), 3, ".: holds no map"),
        (("none/", *MAPS), 3, "none/: no such file"),
        (("human", *MAPS, "--size", "16384"), 6, "choose a smaller --size"),
        (("human", "-o", "ball.obj", "--preview", "--size", "8"), 7, "ball.obj/preview.png: cannot be written"),
        (("humn", "-o", "maps"), 3, "did you mean 'human'?"),
        (("none.yaml", "-o", "maps"), 3, "none.yaml: no such file"),
        (("scene.yaml", "-o", "maps"), 3, "the skin has no key 'render'"),
        (("human", "-o", "maps", "--size", "0"), 2, "--size"),
        (("human", "-o", "maps", "--size", "x"), 2, "--size"),
        (("human", "-o", "maps", "--size", "1000000"), 6, "this driver allows"),
        (("human", "-o", "maps", "--set", "skin.sed=3"), 3, "did you mean 'seed'?"),
        (("human", "-o", "maps", "--asset-root", "none"), 3, "--asset-root"),
        (("human", "-o", "ball.obj", "--size", "8"), 7, "ball.obj/albedo.png: cannot be written"),
        (("human", "-o", "ball.obj/maps", "--size", "8"), 7, "ball.obj/maps/albedo.png: cannot be written"),
        (("human", "--size", "8"), 2, "-o"),
    ],
)
def test_generate_refuses_cleanly(
    ctx: object, skincli: Run, folder: Path, arguments: tuple[str, ...], code: int, part: str
) -> None:
    before = tree(folder)
    result = skincli("generate", *arguments)
    assert result.exit_code == code
    assert part in result.stderr
    assert "Traceback" not in result.stderr
    assert tree(folder) == before


def test_a_full_disk_leaves_what_was_there(
    ctx: object, skincli: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (folder / "a.exr").write_text("older")
    before = tree(folder)
    monkeypatch.setattr(os, "fsync", full)
    result = skincli("render", "scene.yaml", "-o", "a.exr")
    assert result.exit_code == 7
    assert result.stderr.startswith("skincli: a.exr: cannot be written: No space left on device")
    assert tree(folder) == before


# -- Ctrl-C ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "moment",
    [
        "skincli.scene.paths.load_scene",
        "skincli.pipeline.load_scene_mesh",
        "skincli.graph.frame_graph.FrameGraph.run",
        "skincli.pipeline.read_back",
        "skincli.images.write_exr",
        "os.fsync",
        "os.replace",
    ],
)
def test_ctrl_c_ends_with_130_at_any_moment(
    ctx: object, skincli: Run, folder: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    (folder / "a.exr").write_text("older")
    (folder / "maps").mkdir()
    monkeypatch.setattr(moment, lambda *_, **__: signal.raise_signal(signal.SIGINT))
    before = tree(folder)
    result = skincli("render", "scene.yaml", "-o", "a.exr", "--report", "r.json", *OUTPUTS)
    assert result.exit_code == 130
    assert result.output == "skincli: interrupted\n"
    assert tree(folder) == before


def test_ctrl_c_while_generating_leaves_no_manifest(
    ctx: object, skincli: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = tree(folder)
    monkeypatch.setattr(images, "write_text", lambda *_: signal.raise_signal(signal.SIGINT))
    result = skincli("generate", "human", "-o", "maps", "--size", "8")
    assert (result.exit_code, result.stderr) == (130, "skincli: interrupted\n")
    assert set(tree(folder)) - set(before) == {"maps", "maps/albedo.png", "maps/bump.png", "maps/reflection.png"}


def test_ctrl_c_from_outside_ends_a_running_process(folder: Path) -> None:
    """The signal comes once the unwrap, which the first seconds go to, lies in the cache; drawing has begun."""
    text = (folder / "ball.obj").read_text().splitlines()
    bare = [line for line in text if not line.startswith("vt")]
    (folder / "ball.obj").write_text("\n".join(" ".join(w.split("/")[0] for w in line.split()) for line in bare))
    size = "--set=render.size=[1920, 1080]"
    before = tree(folder)
    environment: dict[str, Any] = {**os.environ, "PYTHONPATH": str(Path(package.__file__).parents[1])}
    process = subprocess.Popen(
        [sys.executable, "-m", "skincli", *RENDER, *OUTPUTS, size, "--set=render.atlas=2048", "--set=skin.size=2048"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    cache = Path(os.environ["SKINCLI_CACHE"])
    deadline = time.monotonic() + 30
    while process.poll() is None and not list(cache.glob("unwrap*")) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    output, messages = process.communicate(timeout=30)
    assert (process.returncode, output, messages) == (130, "", "skincli: interrupted\n")
    assert tree(folder) == before
