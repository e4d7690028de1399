"""A small scene that uses every pass, made in code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from skincli import images
from skincli.mesh.model import Mesh
from skincli.pipeline import OUTPUTS, Pipeline, load_scene_mesh
from skincli.scene.paths import LoadedScene, load_scene

SCENE = """
scene: 1
mesh: {file: ball.obj, unit: mm}
skin:
  size: 256
  layers:
    - color: {albedo: [0.6, 0.4, 0.3]}
    - fbm: {scale: 30, albedo: [[0.5, 0.3, 0.2], [0.8, 0.6, 0.5]], height: [-0.3, 0.3], opacity: 0.5}
    - worley: {scale: 12, reflectance: [0.2, 1.0]}
  surface: {specular: 0.3, shininess: 20, reflectance: 0.4, blur: 5}
camera: {position: [120, 40, 600], target: [0, 0, 0], fov: 30}
lights:
  - {type: directional, direction: [-0.5, -0.3, -1], irradiance: [1.5, 1.4, 1.3]}
  - {type: point, position: [-300, 200, 100], intensity: [0.1, 0.1, 0.2]}
  - {type: spot, position: [0, 400, 300], direction: [0, -1, -0.6], intensity: [0.4, 0.3, 0.3], angle: 40, blend: 0.2}
environment: {image: sky.exr}
render: {size: [160, 120], supersample: 1, atlas: 256}
"""


@pytest.fixture(scope="session")
def scene_folder(tmp_path_factory: pytest.TempPathFactory, ball: Callable[..., str]) -> Path:
    """A folder with scene.yaml and its environment."""
    folder = tmp_path_factory.mktemp("scene")
    (folder / "scene.yaml").write_text(SCENE)
    (folder / "ball.obj").write_text(ball())
    (folder / "ball_in_metres.obj").write_text(ball(0.001))
    rows, columns = np.mgrid[0:32, 0:64]
    sky = np.stack([1 + np.sin(columns / 9), 1 + np.cos(rows / 5), 1 + np.sin(rows / 3 + columns / 7)], axis=-1)
    images.write_exr(folder / "sky.exr", {"beauty": sky.astype(np.float32)}, half=False)
    return folder


@pytest.fixture(scope="session")
def load(scene_folder: Path) -> Callable[..., LoadedScene]:
    """Load the scene with settings, as --set has them."""

    def loaded(*sets: str) -> LoadedScene:
        return load_scene(scene_folder / "scene.yaml", sets, outputs=OUTPUTS)

    return loaded


@pytest.fixture(scope="session")
def mesh(load: Callable[..., LoadedScene]) -> Mesh:
    """The scene's mesh."""
    return load_scene_mesh(load())


@pytest.fixture
def pipeline(ctx: object, load: Callable[..., LoadedScene], mesh: Mesh) -> Callable[..., Pipeline]:
    """Make a pipeline of the scene with settings."""

    def make(*sets: str, skip: bool = True, of: Mesh | None = None) -> Pipeline:
        return Pipeline(load(*sets), of or mesh, skip=skip)

    return make


@pytest.fixture(autouse=True)
def _memory(memory_is_freed: None) -> None:
    """Every test here makes frames."""
