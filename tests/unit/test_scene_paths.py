"""The path grammar, --set, and scenes with the skins they name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skincli import images, resources
from skincli.errors import InputError, LimitError, SkincliError, UsageError
from skincli.scene.paths import load_scene, load_skin, locate, parse, set_value
from skincli.scene.yaml import load_text

SKIN = """skin: 1
layers:
  - pores: {spacing: 0.5}
  - worley: {name: cells, height: [0, 0.1]}
  - pores: {name: fine, spacing: 0.2}
  - fbm: {height: [0, 1]}
  - image: {file: tex.png}
"""
SCENE = """scene: 1
mesh: {file: head.obj, unit: mm}
skin: skins/wet.yaml
camera:
  position: [0, 0, 600]
  target: [0, 0, 0]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a scene, a skin file and a preset, as the working folder."""
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "scene.yaml": SCENE,
        "head.obj": "",
        "skins/wet.yaml": SKIN,
        "presets/human.yaml": "skin: 1\nlayers: [image: {file: human.png}]\nsurface: {shininess: 7}\n",
        "presets/octopus.yaml": "skin: 1\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    for name in ("skins/tex.png", "presets/human.png"):
        images.write_png(tmp_path / name, np.zeros((2, 2)))
    monkeypatch.setattr(resources, "folder", lambda name: tmp_path / name)
    return tmp_path


def refused(*sets: str, error: type[SkincliError] = InputError, scene: str = "scene.yaml", **keys: Any) -> str:
    with pytest.raises(error) as caught:
        load_scene(scene, sets, **keys)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "steps"),
    [
        ("a", ("a",)),
        ("a.b[0].c", ("a", "b", 0, "c")),
        ("a[1][22]", ("a", 1, 22)),
        ("occlusion.radius_high", ("occlusion", "radius_high")),
        ('parts["Head.001"].skin', ("parts", "Head.001", "skin")),
        ("parts['a b=c'][0]", ("parts", "a b=c", 0)),
        ("skin.layers.pores.depth", ("skin", "layers", "pores", "depth")),
        ("teilé.ü-1", ("teilé", "ü-1")),
    ],
)
def test_grammar(text: str, steps: tuple[str | int, ...]) -> None:
    assert parse(text) == steps


@pytest.mark.parametrize(
    "text", ["", ".a", "a.", "a..b", "a b", "[0]", "a[-1]", "a[x]", "a[0]b", "a[0", "a.[0]", "a=b"]
)
def test_no_paths(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a path; write keys and numbers as in camera\.fov"):
        parse(text)


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("layers[0].depth", ("layers", 0, "pores", "depth")),
        ("layers[0].pores.depth", ("layers", 0, "pores", "depth")),
        ("layers.cells.height[1]", ("layers", 1, "worley", "height", 1)),
        ("layers.fine.depth", ("layers", 2, "pores", "depth")),
        ("layers.fbm.scale", ("layers", 3, "fbm", "scale")),
        ("layers.fbm.fbm.scale", ("layers", 3, "fbm", "scale")),
        ("layers.pores", ("layers", 0)),
        ("surface.blur", ("surface", "blur")),
    ],
)
def test_layers_are_reached_by_number_name_or_kind(path: str, found: tuple[str | int, ...]) -> None:
    assert locate(load_text(SKIN, "f"), parse(path)) == found


def test_two_layers_of_a_kind_need_names() -> None:
    text = SKIN.replace("name: fine, ", "")
    with pytest.raises(
        ValueError, match=r"several layers are called 'pores'; write layers\[0\] or layers\[2\], or give"
    ):
        locate(load_text(text, "f"), parse("layers.pores.depth"))


def test_set_changes_one_value_and_leaves_the_document(folder: Path) -> None:
    document = load_text("a: &x {b: [1, 2]}\nc: *x\n", "f")
    changed = set_value(document, "c.b[1]", "1e-3", "--set c.b[1]=1e-3")
    assert changed.values == {"a": {"b": [1, 2]}, "c": {"b": [1, 0.001]}}
    assert document.values == {"a": {"b": [1, 2]}, "c": {"b": [1, 2]}}
    assert changed.mark(("c", "b", 1)) == ("--set c.b[1]=1e-3", None, None)
    assert changed.mark(("c", "b", 0)) == ("f", 1, 12)
    assert set_value(document, "d.e.f", "[no, 017]", "x").values["d"] == {"e": {"f": ["no", 17]}}


def test_sets_reach_scene_and_skin(folder: Path) -> None:
    loaded = load_scene(
        "scene.yaml",
        [
            "camera.fov=20",
            "camera.up[0]=0.25",
            "ambient[2]=0.5",
            "outputs[0]=depth",
            "render.occlusion.a=2",
            "skin.layers.fine.spacing=0.3",
            "skin.layers[1].height[1]=0.7",
            "skin.optics.radius[0]=2",
            "skin.surface={shininess: 9}",
        ],
        outputs=("beauty", "depth"),
    )
    camera = loaded.scene.camera
    assert camera is not None
    assert camera.fov == 20
    assert camera.up == (0.25, 1, 0)
    assert loaded.scene.ambient == (0.05, 0.05, 0.5)
    assert loaded.scene.outputs == ("depth",)
    assert loaded.scene.render.occlusion.a == 2
    assert loaded.scene.mesh.file == folder / "head.obj"
    skin, base = loaded.skins[""]
    assert base == folder / "skins"
    assert skin.layers[2].model_dump()["spacing"] == 0.3
    assert skin.layers[1].model_dump()["height"] == (0, 0.7)
    assert skin.layers[4].model_dump()["file"] == folder / "skins" / "tex.png"
    assert skin.optics.radius[0] == 2
    assert skin.surface.shininess == 9
    assert (loaded.label, loaded.folder, set(loaded.skins)) == ("scene.yaml", folder, {""})


def test_skins_by_preset_path_inline_and_none(folder: Path) -> None:
    parts = "parts:\n  Eye: {skin: human}\n  Tongue: {skin: {surface: {blur: 3}}}\n  'Lid.001': {skin: null}\n"
    (folder / "scene.yaml").write_text(SCENE + parts)
    loaded = load_scene("scene.yaml", ["parts.Eye.skin.surface.blur=4", 'parts["Lid.001"].skin.seed=5'])
    assert set(loaded.skins) == {"", "Eye", "Tongue", "Lid.001"}
    assert loaded.skins["Eye"].folder == folder / "presets"
    assert loaded.skins["Eye"].skin.surface.shininess == 7
    assert loaded.skins["Eye"].skin.surface.blur == 4
    assert loaded.skins["Tongue"] == (loaded.skins["Tongue"].skin, folder)
    assert loaded.skins["Tongue"].skin.surface.blur == 3
    assert loaded.skins["Lid.001"].skin.seed == 5
    assert set(load_scene("scene.yaml", ["skin=null", "parts={}"]).skins) == set()
    replaced = load_scene("scene.yaml", ["skin=human", "skin.surface.blur=2"])
    assert replaced.skins[""].skin.surface.blur == 2
    assert replaced.skins[""].skin.surface.shininess == 7


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("camera.fov=190", "camera.fov is 190; it must be less than 180"),
        ("camrea.fov=3", "the scene has no key 'camrea'; did you mean 'camera'? It has: ambient, background, camera, "
         "environment, lights, mesh, outputs, parts, render, scene, skin."),
        ("lights[0].angle=3", "lights has no items, so there is no lights[0]"),
        ("camera.position[3]=3", "camera.position has 3 items, [0] to [2], so there is no camera.position[3]"),
        ("camera.position.x=3", "camera.position has 3 items, [0] to [2]; say which one, as in camera.position[0].x"),
        ("mesh.file.name=3", "mesh.file is head.obj, so there is nothing below it; set mesh.file itself"),
        ("mesh[0]=3", "mesh has keys, not numbers; it has: file, unit"),
        ("background[0]=1", "background has no items yet; set the whole list"),
        ("skin.layers[9].depth=1", "skin.layers has 5 items, [0] to [4], so there is no skin.layers[9]"),
        ("skin.layers.finer.depth=1", "no layer is called 'finer'; did you mean 'fine'? There are: pores, cells, fine, "
         "fbm, image"),
        ("skin.layers.fine.depth=40", "skin.layers[2].pores.depth is 40; it must be at most 10"),
        ("skin=octopuss", "skin is 'octopuss'; no preset has that name; did you mean 'octopus'? There are: human, "
         "octopus. A path ends in .yaml, or in / for a folder of maps"),
        ("skin=3", "skin is 3; it must be a preset's name, a skin's path, or a mapping"),
        ("mesh.unit=!!python/name:x y", "the tag !!python/name:x is not allowed here; remove it"),
    ],
)  # fmt: skip
def test_messages_of_set(text: str, message: str, folder: Path) -> None:
    assert refused(text) == f"--set {text}: {message}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("camera.fov", "there is no '='; write PATH=VALUE, as in --set camera.fov=35"),
        ("camera..fov=3", "'camera..fov' is not a path; write keys and numbers as in camera.fov, lights[0].angle or "
         'parts["Head.001"].skin'),
    ],
)  # fmt: skip
def test_set_against_the_grammar(text: str, message: str, folder: Path) -> None:
    assert refused(text, error=UsageError) == f"--set {text}: {message}"


def test_faults_of_all_files_together(folder: Path) -> None:
    (folder / "scene.yaml").write_text(SCENE + "parts: {Eye: {skin: humn}}\nrender: {atlas: 0, atlas: 2}\nlihgts: []\n")
    (folder / "skins/wet.yaml").write_text(
        "skin: 1\nlayers:\n  - pores: {depth: -99, mask: {fbm: {scale: x}}}\n"
        "  - image: {file: ../head.obj}\n  - pors: {}\n"
    )
    found = refused("camera.fov=-1", "skin.layers[0].jitter=2", "skin.seed=-1").split("\n")
    assert [message.partition(": ")[0] for message in found] == [
        "scene.yaml:7:21",
        "scene.yaml:8:17",
        "scene.yaml:8:20",
        "scene.yaml:9:1",
        "skins/wet.yaml:3:20",
        "skins/wet.yaml:3:45",
        "skins/wet.yaml:4:19",
        "skins/wet.yaml:5:5",
        "--set camera.fov=-1",
        "--set skin.layers[0].jitter=2",
        "--set skin.seed=-1",
    ]
    assert found[4] == "skins/wet.yaml:3:20: layers[0].pores.depth is -99; it must be at least -10"
    assert "layers[0].pores.mask.fbm.scale is 'x'; it must be a number" in found[5]
    assert "leads outside the folder" in found[6]
    assert "layers[2] has no key 'pors'; did you mean 'pores'? It has: " in found[7]
    assert found[9].endswith(": skin.layers[0].pores.jitter is 2; it must be at most 1")


def test_inline_skins_are_named_from_the_scene(folder: Path) -> None:
    (folder / "scene.yaml").write_text(SCENE.replace("skins/wet.yaml", "{seed: -1}"))
    assert refused() == "scene.yaml:3:14: skin.seed is -1; it must be at least 0"


def test_one_fault_of_a_skin_that_two_parts_share_is_told_once(folder: Path) -> None:
    (folder / "scene.yaml").write_text(SCENE + "parts: {Eye: {skin: skins/wet.yaml}}")
    (folder / "skins/wet.yaml").write_text("skin: 2")
    assert refused() == "skins/wet.yaml:1:7: skin is 2; it must be 1"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "1:1: the skin is empty; it must be a mapping, key: value"),
        ("human", "1:1: the skin is 'human'; it must be a mapping, key: value"),
        ("skin: {", "1:8: this is not valid YAML: "),
    ],
)
def test_broken_skin_files_give_one_fault(text: str, message: str, folder: Path) -> None:
    (folder / "skins/wet.yaml").write_text(text)
    found = refused("skin.layers.fine.depth=1")
    assert found.startswith(f"skins/wet.yaml:{message}")
    assert "\n" not in found


def test_skin_files_keep_to_the_budgets_and_folders(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    (folder / "skins/wet.yaml").write_text("[" * 1000)
    refused(error=LimitError)
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "far.yaml").write_text("skin: 1\nlayers: [image: {file: near.png}]\n")
    images.write_png(elsewhere / "near.png", np.zeros((2, 2)))
    (folder / "scene.yaml").write_text(SCENE.replace("skins/wet.yaml", str(elsewhere / "far.yaml")))
    assert "outside the folder" in refused()
    loaded = load_scene("scene.yaml", asset_roots=[elsewhere])
    assert loaded.skins[""].skin.layers[0].model_dump()["file"] == elsewhere / "near.png"
    assert loaded.roots == (elsewhere,)


def test_a_fault_found_later_has_its_place(folder: Path) -> None:
    loaded = load_scene("scene.yaml", ["camera.fov=20"])
    assert str(loaded.fault("mesh.file", "it is empty")) == "scene.yaml:2:14: it is empty"
    assert str(loaded.fault("skin.layers[2].pores.spacing", "x")) == "skins/wet.yaml:5:34: x"
    assert str(loaded.fault("camera.fov", "x")) == "--set camera.fov=20: x"
    assert str(loaded.fault("render.atlas", "x")) == "scene.yaml:1:1: x"


def maps(folder: Path, name: str = "rock") -> Path:
    """Make a folder of maps in the style of ambientCG, 8 texels a side."""
    (folder / name).mkdir()
    for kind in ("Color", "Displacement", "Roughness"):
        images.write_png(folder / name / f"Rock_{kind}.png", np.full((8, 8), 0.5), kind="data", bits=16)
    return folder / name


@pytest.mark.parametrize("written", ["rock", "rock/", "./rock"])
def test_a_folder_of_maps_is_a_skin(folder: Path, written: str) -> None:
    place = maps(folder)
    loaded = load_scene("scene.yaml", [f"skin={written}", "skin.layers.bump.height=[-2, 2]", "skin.surface.blur=3"])
    skin, base = loaded.skins[""]
    assert base == place
    assert skin.size == 8
    assert [(layer.kind(), layer.name) for layer in skin.layers] == [
        ("image", "albedo"),
        ("image", "bump"),
        ("image", "roughness"),
    ]
    assert skin.layers[0].model_dump()["file"] == place / "Rock_Color.png"
    assert skin.layers[1].model_dump()["height"] == (-2, 2)
    assert skin.surface.blur == 3
    assert load_skin(written).skin.layers[0] == skin.layers[0]


def test_a_preset_comes_before_a_folder_of_its_name(folder: Path) -> None:
    maps(folder, "human")
    assert load_skin("human").skin.surface.shininess == 7
    assert load_skin("human/").skin.size == 8


def test_a_folder_of_maps_tells_of_itself_by_its_manifest(folder: Path) -> None:
    place = maps(folder)
    manifest = {
        "manifest": 1,
        "about": "Rock.",
        "extent_mm": 30,
        "maps": {"height": {"file": "Rock_Displacement.png", "range": [-1, 3]}},
        "optics": {"radius": [3, 2, 1]},
        "surface": {"shininess": 9},
    }
    (place / "manifest.json").write_text(json.dumps(manifest))
    skin = load_skin("rock").skin
    assert (skin.about, skin.extent, skin.optics.radius, skin.surface.shininess) == ("Rock.", 30, (3, 2, 1), 9)
    assert skin.layers[0].model_dump()["height"] == (-1, 3)
    manifest["surface"] = {"shininess": -9}
    (place / "manifest.json").write_text(json.dumps(manifest))
    assert refused("skin=rock") == "rock: surface.shininess is -9; it must be at least 0"


def test_a_folder_of_maps_stays_where_scenes_may_read(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    elsewhere = maps(tmp_path_factory.mktemp("elsewhere"))
    (folder / "link").symlink_to(elsewhere)
    for written in (str(elsewhere), "link", ".."):
        assert "outside the folder" in refused(f"skin={written}")
    assert load_scene("scene.yaml", ["skin=link"], asset_roots=[elsewhere]).skins[""].skin.size == 8
    # On the command line a person may name any.
    assert load_skin(str(elsewhere)).skin.size == 8
    assert load_skin("link").skin.size == 8
