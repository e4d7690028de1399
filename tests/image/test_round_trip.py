"""Maps that `generate` has written, worn as a skin, look as the skin itself does; so do maps from elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from skincli import images, mapset, metrics
from skincli.generate import Ground, Order, write_maps
from skincli.mapset import Encoding
from skincli.mesh.load import load_builtin
from skincli.mesh.model import Mesh
from skincli.pipeline import OUTPUTS, Pipeline
from skincli.scene.paths import LoadedScene, load_scene, load_skin

Array = NDArray[np.float32]
Shot = Callable[[str], dict[str, Array]]

SKIN = """\
skin: 1
size: 256
seed: 4
layers:
  - color: {albedo: [0.7, 0.47, 0.36]}
  - fbm: {scale: 40, albedo: [[0.62, 0.4, 0.3], [0.8, 0.58, 0.46]], roughness: [0.35, 0.6], opacity: 0.7}
  - worley: {scale: 9, height: [-0.7, 0.3], reflectance: [0.3, 1], specular: [0.4, 1]}
optics: {color: [0.7, 0.45, 0.33], radius: [0.9, 0.4, 0.25]}
surface: {specular: 0.3, reflectance: 0.06, bumpiness: 1.2}
"""
SCENE = """\
scene: 1
mesh: {builtin: head, detail: 4k}
skin: skin.yaml
lights:
  - {type: directional, direction: [0.6, -0.5, -0.8], irradiance: [3, 2.8, 2.6]}
environment: {image: sky.exr}
render: {size: [160, 160], supersample: 1, atlas: 256}
"""
MAPS = ("albedo", "height", "reflection", "roughness", "specular")
READ = ("beauty", "albedo", "normal", "specular", "reflection")


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return load_builtin("head", "4k")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a scene, its skin and its environment."""
    path = tmp_path_factory.mktemp("round_trip")
    (path / "scene.yaml").write_text(SCENE)
    (path / "skin.yaml").write_text(SKIN)
    rows, columns = np.mgrid[0:16, 0:32]
    sky = np.stack([1 + np.sin(columns / 5), 1 + np.cos(rows / 3), 1 + np.sin(rows / 2 + columns / 4)], axis=-1)
    images.write_exr(path / "sky.exr", {"beauty": sky.astype(np.float32)}, half=False)
    return path


@pytest.fixture(scope="module")
def shot(ctx: object, folder: Path, mesh: Mesh) -> Shot:
    """Render the scene in another skin."""

    def render(skin: str) -> dict[str, Array]:
        pipeline = Pipeline(scene(folder, skin), mesh)
        try:
            return pipeline.run(READ, display=True)
        finally:
            pipeline.graph.store.clear()

    return render


@pytest.fixture(scope="module")
def direct(shot: Shot) -> dict[str, Array]:
    """The scene with the skin generated inside `render`."""
    return shot("skin.yaml")


def scene(folder: Path, skin: str, *sets: str) -> LoadedScene:
    return load_scene(folder / "scene.yaml", [f"skin={skin}", *sets], outputs=OUTPUTS)


def written(folder: Path, mesh: Mesh, name: str, order: Order) -> Path:
    """Write the maps of the scene's skin, made for its mesh."""
    skin = load_skin(str(folder / "skin.yaml")).skin
    write_maps(folder / name, skin, "own", order, Ground(mesh))
    return folder / name


def silhouette(picture: dict[str, Array]) -> NDArray[np.bool_]:
    mask: NDArray[np.bool_] = picture["beauty"][..., 3] > 0.5
    assert 0.2 < mask.mean() < 0.9
    return mask


def assert_alike(test: dict[str, Array], reference: dict[str, Array], limit: float = 0.005) -> None:
    """Assert what the display shows of both: mean FLIP inside the silhouette."""
    error, _ = metrics.flip(test["display"][..., :3], reference["display"][..., :3], silhouette(reference))
    assert error < limit


def test_float_exr_gives_the_same_pixels(folder: Path, mesh: Mesh, shot: Shot, direct: dict[str, Array]) -> None:
    written(folder, mesh, "exr", Order(MAPS, Encoding("exr", "float")))
    found = shot("exr/")
    for name in READ:
        np.testing.assert_array_equal(found[name], direct[name], err_msg=name)


def test_png_looks_the_same(folder: Path, mesh: Mesh, shot: Shot, direct: dict[str, Array]) -> None:
    written(folder, mesh, "png", Order(MAPS))
    assert_alike(shot("png/"), direct)


def test_the_maps_that_are_written_by_default_look_the_same_where_they_say_all(
    folder: Path, mesh: Mesh, shot: Shot
) -> None:
    changes = ["skin.layers.fbm.roughness=null", "skin.layers.worley.specular=null"]
    skin = load_skin(str(folder / "skin.yaml"), changes)
    write_maps(folder / "default", skin.skin, "own", ground=Ground(mesh))
    plain = Pipeline(replace(scene(folder, "skin.yaml"), skins={"": skin}), mesh).run(READ, display=True)
    assert_alike(shot("default"), plain)


def test_ambientcg_naming_is_read_without_a_manifest(
    folder: Path, mesh: Mesh, direct: dict[str, Array], caplog: pytest.LogCaptureFixture
) -> None:
    place = written(folder, mesh, "Skin004_2K", Order(MAPS, naming="ambientcg"))
    low, high = mapset.find_maps(place).maps["height"].range
    manifest = place / mapset.MANIFEST
    manifest.unlink()
    (place / "Skin004_2K.png").write_bytes((place / "own_Color.png").read_bytes())  # a picture of it, not a map
    surface = "{specular: 0.3, reflectance: 0.06, bumpiness: 1.2}"
    loaded = scene(
        folder,
        "Skin004_2K/",
        f"skin.layers.height.height=[{low!r}, {high!r}]",
        f"skin.surface={surface}",
        "skin.optics={color: [0.7, 0.45, 0.33], radius: [0.9, 0.4, 0.25]}",
    )
    assert "black to white is taken as -0.5 to 0.5 mm" in caplog.text
    assert loaded.skins[""].skin.size == 256
    assert_alike(Pipeline(loaded, mesh).run(READ, display=True), direct)


def test_substance_naming_is_read(folder: Path, mesh: Mesh, direct: dict[str, Array]) -> None:
    place = written(folder, mesh, "substance", Order(("albedo", "normal", "roughness"), convention="directx"))
    (place / mapset.MANIFEST).unlink()
    words = {"albedo": "BaseColor", "normal_dx": "NormalDirectX", "roughness": "Roughness"}
    for name, word in words.items():
        (place / f"{name}.png").rename(place / f"Head_{word}.png")
    loaded = scene(folder, "substance/", "skin.surface.bumpiness=1.2")
    layers = {layer.name: layer.model_dump() for layer in loaded.skins[""].skin.layers}
    assert {name: layer["role"] for name, layer in layers.items()} == {
        "albedo": "color",
        "normal": "normal_dx",
        "roughness": "grey",
    }
    found = Pipeline(loaded, mesh).run(READ)
    mask = silhouette(direct)
    assert np.abs(found["albedo"] - direct["albedo"])[mask].mean() < 1e-3
    # The normal map stands for the relief: it tilts as the height did.
    smooth = Pipeline(scene(folder, "substance/", "skin.surface.bumpiness=0"), mesh).run(("normal",))
    assert degrees_apart(found["normal"], direct["normal"])[mask].mean() < 0.5
    assert degrees_apart(smooth["normal"], direct["normal"])[mask].mean() > 2


def degrees_apart(one: Array, other: Array) -> Array:
    return np.degrees(np.arccos(np.clip(np.sum(one * other, axis=-1), -1, 1)))
