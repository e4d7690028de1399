"""A small scene in a folder of its own, and the command line that is run on it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from skincli import images
from skincli.cli import root

SCENE = """\
scene: 1
mesh: {file: ball.obj, unit: mm}
skin:
  size: 64
  layers:
    - color: {albedo: [0.6, 0.4, 0.3]}
    - fbm: {scale: 30, height: [-0.3, 0.3]}
    - image: {file: spots.png, opacity: 0.5}
  surface: {specular: 0.3, reflectance: 0.4}
camera: {position: [120, 40, 600], target: [0, 0, 0], fov: 30}
lights:
  - {type: directional, direction: [-0.5, -0.3, -1], irradiance: [1.5, 1.4, 1.3]}
environment: {image: sky.exr}
render: {size: [64, 48], supersample: 1, atlas: 64}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ball: Callable[..., str]) -> Path:
    """Return the working folder, with scene.yaml, ball.obj, sky.exr and spots.png in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(SCENE)
    (tmp_path / "ball.obj").write_text(ball(rows=12, columns=24, dents=0))
    rows, columns = np.mgrid[0:8, 0:16]
    sky = np.stack([1 + np.sin(columns / 3), 1 + np.cos(rows / 2), 1 + np.sin(rows + columns / 2)], axis=-1)
    images.write_exr(tmp_path / "sky.exr", {"beauty": sky.astype(np.float32)}, half=False)
    images.write_png(tmp_path / "spots.png", (sky / 2).astype(np.float32))
    return tmp_path


@pytest.fixture
def skincli() -> Callable[..., Result]:
    """Run a command line."""

    def run(*arguments: object) -> Result:
        return CliRunner().invoke(root, [str(argument) for argument in arguments])

    return run


@pytest.fixture(autouse=True)
def _memory(memory_is_freed: None) -> None:
    """Every test here makes frames."""
