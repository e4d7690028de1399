"""What is measured: a small scene that uses every pass, a head to be timed, and the seed paper's creature."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from skincli import images
from skincli.mesh.model import Mesh, Part
from skincli.mesh.surface import angle_weighted_normals
from skincli.pipeline import OUTPUTS
from skincli.scene.paths import LoadedScene, load_scene

#: every stage is held against its twin on this; its mesh is `ring`
STAGE_SCENE = """
scene: 1
mesh: {builtin: head}  # stands in for the ring, which is made in code and no mesh to be named
skin:
  size: 256
  seed: 5
  layers:
    - color: {albedo: [0.7, 0.45, 0.35]}
    - fbm: {scale: 30, octaves: 3, albedo: [[0.5, 0.3, 0.2], [0.9, 0.7, 0.6]], height: [-0.4, 0.4], opacity: 0.7}
    - worley: {scale: 12, reflectance: [0.2, 1.0]}
  optics: {color: [0.48, 0.27, 0.2], radius: [1.8, 0.9, 0.5]}
  surface: {ambient: 0.8, diffuse: 0.9, specular: 0.7, shininess: 60, reflectance: 0.75, blur: 8}
parts:
  left:
    skin:
      size: 128
      layers:
        - color: {albedo: [0.8, 0.6, 0.5]}
        - fbm: {scale: 20, octaves: 2, height: [0, 1.5], reflectance: [0.5, 1]}
      surface: {specular: 0.3, shininess: 18, reflectance: 0.3, blur: 5}
camera: {position: [60, 210, 330], target: [0, 0, 0], fov: 30, exposure: -0.5}
ambient: [0.1, 0.08, 0.06]
lights:
  - {type: directional, direction: [-0.5, -0.6, -1], irradiance: [2.0, 1.8, 1.6]}
  - {type: point, position: [-250, 150, 120], intensity: [0.1, 0.12, 0.2]}
  - {type: spot, position: [80, 260, 120], direction: [-3, -9, -4], intensity: [0.3, 0.2, 0.2], angle: 26, blend: 0.6}
environment: {image: sky.exr, rotation: 70, exposure: -2}
render: {size: [320, 240], supersample: 1, atlas: 256, occlusion: {radius_high: 4, radius_low: 25}}
"""


#: what is timed: a head as it comes out of the box, but for textures small enough to measure in software, too
TIMED_SCENE = """
scene: 1
mesh: {builtin: head, detail: 65k}
skin: human
camera: {position: [120, 20, 600], target: [0, 0, 0], fov: 30}
lights:
  - {type: directional, direction: [-0.5, -0.3, -1], irradiance: [2.5, 2.4, 2.3]}
  - {type: point, position: [-300, 200, -200], intensity: [0.2, 0.2, 0.3]}
  - {type: spot, position: [100, 400, 300], direction: [-1, -5, -3], intensity: [0.3, 0.3, 0.3], angle: 40, blend: 0.2}
environment: {image: sky.exr, exposure: -1}
render: {size: [640, 480], atlas: 1024}
"""
TIMED_SETS = ("skin.size=512",)

#: the scene of the seed paper's table: all effects, three lights, its atlas of 2500 texels a side
PAPER_SCENE = """
scene: 1
mesh: {builtin: creature, detail: 65k}
skin: octopus
lights:
  - {type: directional, direction: [-0.5, -0.3, -1], irradiance: [1.0, 0.95, 0.9]}
  - {type: point, position: [-400, 200, 300], intensity: [0.1, 0.1, 0.15]}
  - {type: spot, position: [0, 500, 400], direction: [0, -1, -0.8], intensity: [0.3, 0.3, 0.3], angle: 40, blend: 0.2}
environment: {image: sky.exr, exposure: -1}
render: {shading: paper}
"""


def load(folder: Path, text: str, *sets: str) -> LoadedScene:
    """Write a scene and its environment into a folder and load it.

    Parameters
    ----------
    folder : must live as long as the scene is rendered
    text : the scene as YAML
    sets : settings, as --set has them
    """
    rows, columns = np.mgrid[0:64, 0:128]
    turn, height = columns * (2 * np.pi / 128), rows * (np.pi / 64)
    sky = np.stack([1.2 + np.sin(2 * turn), 1 + np.cos(height), 1 + np.sin(turn + 3 * height)], axis=-1)
    images.write_exr(folder / "sky.exr", {"beauty": sky.astype(np.float32)}, half=False)
    file = folder / "bench.yaml"
    file.write_text(text, encoding="utf-8")
    return load_scene(file, sets, outputs=OUTPUTS)


def ring(around: int = 96, across: int = 48) -> Mesh:
    """Return a lumpy ring of two halves, "right" and "left"; the left one's maps lie mirrored.

    It occludes itself, has charts with space between them, and both signs of the determinant that bumps need.

    Parameters
    ----------
    around, across : cells along the ring (even) and around its section
    """
    positions, uv, atlas_uv, faces = [], [], [], []
    half = around // 2
    for side in (0, 1):
        i, j = (grid.ravel() for grid in np.mgrid[0 : half + 1, 0 : across + 1])
        a, b = np.pi * (i / half + side), 2 * np.pi * j / across
        section = 26 * (1 + 0.12 * np.sin(5 * a) * np.cos(3 * b) + 0.08 * np.sin(9 * a + 2 * b))
        outward = 60 + section * np.cos(b)
        positions.append(np.stack([outward * np.sin(a), section * np.sin(b), outward * np.cos(a)], axis=1))
        u = i / half
        uv.append(np.stack([1 - u if side else u, j / across], axis=1))
        atlas_uv.append(np.stack([0.03 + 0.44 * u + 0.5 * side, 0.03 + 0.94 * j / across], axis=1))
        at = (np.arange(half)[:, None] * (across + 1) + np.arange(across)).ravel() + side * len(i)
        corners = [at, at + across + 1, at + across + 2, at, at + across + 2, at + 1]
        faces.append(np.stack(corners, axis=1).reshape(-1, 3))
    triangles = np.concatenate(faces).astype(np.int32)
    points = np.concatenate(positions)
    count = len(faces[0])
    return Mesh(
        points,
        angle_weighted_normals(points, triangles),
        np.concatenate(uv),
        np.concatenate(atlas_uv),
        triangles,
        (Part("right", 0, count), Part("left", count, 2 * count)),
        uv_is_unique=False,
    )
