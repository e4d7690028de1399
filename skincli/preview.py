"""A contact sheet of what a skin is: its maps, a ball and a head that wear it."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skincli import images
from skincli.color import srgb_decode
from skincli.mapset import MAPS
from skincli.mesh.load import load_builtin
from skincli.pipeline import OUTPUTS, Pipeline
from skincli.scene.paths import LoadedSkin, load_scene

Array = NDArray[np.float32]

#: pixels of a panel's side
SIDE = 384

#: texels of the maps that the ball and the head wear: enough for a panel
LIT_SIZE = 1024

#: a sphere fills the picture nearly; the head looks past the camera, to show its profile, and is cut below the chin
_SITTERS: Mapping[str, str] = {
    "sphere": "{position: [0, 30, 330], target: [0, 0, 0], fov: 22}",
    "head": "{position: [170, 15, 760], target: [4, -12, 0], fov: 20}",
}

# A soft key from the upper left, a faint cold fill from the right, and a rim that parts the sitter from the ground.
_SCENE = """
scene: 1
mesh: {{builtin: {mesh}}}
camera: {camera}
ambient: [0.06, 0.06, 0.07]
lights:
  - {{type: directional, direction: [0.6, -0.55, -0.75], irradiance: [3.1, 2.95, 2.75]}}
  - {{type: directional, direction: [-0.85, -0.1, -0.4], irradiance: [0.4, 0.45, 0.55]}}
  - {{type: directional, direction: [-0.55, -0.35, 0.85], irradiance: [1.7, 1.7, 1.8]}}
environment: {{image: studio.exr}}
background: [0.02, 0.02, 0.021]
render: {{size: [{side}, {side}], atlas: 1024}}
"""


def sheet(name: str, skin: LoadedSkin, maps: Mapping[str, Array]) -> Array:
    """Return the contact sheet as a linear picture.

    Parameters
    ----------
    name : its title
    skin : the description
    maps : as `skincli.generate.generate` returns them
    """
    panels = [(_label(kind, array), _panel(kind, array)) for kind, array in maps.items()]
    panels += [(f"lit {mesh}", _lit(skin, mesh)) for mesh in _SITTERS]
    # As few empty places as can be.
    columns = min((5, 4, 3), key=lambda count: -len(panels) % count)
    return images.contact_sheet(panels, columns, title=name)


def _label(kind: str, array: Array) -> str:
    """Return a map's name, and what its black and white mean where that is measured."""
    low, high = _span(kind, array)
    unit = MAPS[kind].unit
    return kind.replace("_", " ") + (f", {low:.2g} to {high:.2g} {unit}" if unit else "")


def _span(kind: str, array: Array) -> tuple[float, float]:
    """Return the values that a panel shows black and white."""
    if MAPS[kind].scale == "direction":
        return -1.0, 1.0
    if MAPS[kind].scale == "unit":
        return 0.0, 1.0
    return (float(array.min()) if MAPS[kind].scale == "signed" else 0.0), float(array.max())


def _panel(kind: str, array: Array) -> Array:
    """Return a map as a picture of at most SIDE pixels: color as it is, numbers as codes from black to white."""
    small = images.reduce_to(array, SIDE)
    if MAPS[kind].role == "color":
        return small
    low, high = _span(kind, array)
    shown = np.clip((small - low) / max(high - low, 1e-6), 0, 1)
    return np.broadcast_to(srgb_decode(shown), (*small.shape[:2], 3)).astype(np.float32)


def _lit(skin: LoadedSkin, mesh: str) -> Array:
    """Return a picture of a built-in mesh that wears the skin."""
    with tempfile.TemporaryDirectory() as folder:
        images.write_exr(Path(folder) / "studio.exr", {"beauty": _studio()}, half=False)
        file = Path(folder) / "preview.yaml"
        file.write_text(_SCENE.format(mesh=mesh, camera=_SITTERS[mesh], side=SIDE), encoding="utf-8")
        loaded = load_scene(file, outputs=OUTPUTS)
        size = min(skin.skin.size, LIT_SIZE)
        worn = LoadedSkin(skin.skin.model_copy(update={"size": size}), skin.folder)
        pipeline = Pipeline(replace(loaded, skins={"": worn}), load_builtin(mesh, None), single=True)
        display = pipeline.run([], display=True)["display"]
    return display[..., :3]


def _studio() -> Array:
    """Return a panorama with two soft boxes over a dark floor."""
    rows, columns = np.mgrid[0:64, 0:128]
    turn, height = (columns + 0.5) * (2 * np.pi / 128), np.pi / 2 - (rows + 0.5) * (np.pi / 64)

    def box(at: float, up: float, width: float, strength: float) -> NDArray[np.float64]:
        away = (np.abs(np.angle(np.exp(1j * (turn - at)))) / width) ** 4 + (np.abs(height - up) / (0.7 * width)) ** 4
        return strength * np.exp(-away)

    light = 0.12 + 0.1 * np.maximum(np.sin(height), 0) + box(2.2, 0.6, 0.5, 5.0) + box(4.4, 0.3, 0.35, 2.5)
    return np.repeat(light[..., None], 3, axis=2).astype(np.float32)
