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


def ball(scale: float = 1.0, rows: int = 32, columns: int = 64) -> str:
    """Return an OBJ file of a dented ellipsoid about 200 mm tall, with a UV seam at its back."""
    v, u = np.mgrid[0 : rows + 1, 0 : columns + 1]
    polar, around = np.pi * v / rows, 2 * np.pi * (u / columns - 0.25)
    radius = 80 + 8 * np.sin(3 * around) * np.sin(polar) ** 2
    points = np.stack(
        [radius * np.sin(polar) * np.cos(around), 100 * np.cos(polar), -radius * np.sin(polar) * np.sin(around)],
        axis=-1,
    )
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in scale * points.reshape(-1, 3)]
    lines += [f"vt {x:.9g} {y:.9g}" for x, y in np.stack([u / columns, 1 - v / rows], axis=-1).reshape(-1, 2)]
    for row in range(rows):
        for column in range(columns):
            a = row * (columns + 1) + column + 1
            b = a + columns + 1
            # At the poles one of the two has no area.
            faces = [(a + 1, b, b + 1)] * (row < rows - 1) + [(a, b, a + 1)] * (row > 0)
            lines += ["f " + " ".join(f"{i}/{i}" for i in face) for face in faces]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="session")
def scene_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
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
