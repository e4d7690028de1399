"""From a skin to map files: the generator without a scene."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import skincli
from skincli import images
from skincli.errors import LimitError
from skincli.gpu.context import get_context
from skincli.gpu.textures import beyond_memory, read_back
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import Constant, Ref
from skincli.passes.maps import Maps, MapSource
from skincli.pipeline import MAP_BYTES, file_digest, load_pictures
from skincli.scene.skin import Skin

_log = logging.getLogger("skincli")

#: file name of a map -> output of the generator
MAPS = {"albedo": "albedo", "bump": "height", "reflection": "reflectance"}


def generate(skin: Skin, size: int, maps: Collection[str] = tuple(MAPS)) -> dict[str, NDArray[np.float32]]:
    """Return the maps of a skin on a flat square of `skin.extent` mm.

    Parameters
    ----------
    skin : the description
    size : texels a side
    maps : keys of MAPS; no other is computed

    Returns
    -------
    albedo (size, size, 3) linear Rec.709; bump (size, size, 1) mm; reflection (size, size, 1) 0 to 1; top row first

    Raises
    ------
    LimitError : the driver cannot hold a texture of that size
    """
    limit = get_context().info["GL_MAX_TEXTURE_SIZE"]
    if size > limit:
        need = size * size * 20 / 1e9
        raise LimitError(
            f"maps of {size} x {size} texels are asked for ({need:.1f} GB); this driver allows {limit} a side; "
            "choose a smaller --size"
        )
    found_memory = beyond_memory(MAP_BYTES * size * size)
    if found_memory is not None:
        raise LimitError(f"maps of {size} x {size} texels are asked for: {found_memory}; choose a smaller --size")
    source = MapSource.of_skin(skin)
    loads, inputs = load_pictures(source)
    nodes = [*loads.values(), Maps("maps", (size, size), source, inputs, on_mesh=False, extent=skin.extent)]
    written = {name: Ref("maps", MAPS[name]) for name in maps if MAPS[name] in source.written}
    found = FrameGraph(nodes).run(list(written.values()))
    arrays = {}
    for name in maps:
        channels = 3 if name == "albedo" else 1
        if name in written:
            arrays[name] = read_back(found[written[name]])[..., :channels]
        else:
            neutral: Constant = Maps.neutral[MAPS[name]]
            arrays[name] = np.broadcast_to(np.array(neutral.value[:channels], np.float32), (size, size, channels))
    return arrays


def write_maps(folder: Path, skin: Skin, name: str, size: int) -> list[Path]:
    """Generate a skin's maps and write them with their manifest.

    Parameters
    ----------
    folder : made when missing
    name : what the skin is called in the manifest
    size : texels a side

    Returns
    -------
    the files, the manifest last: where it stands, the others are whole

    Raises
    ------
    OutputError : a file cannot be written
    """
    files = {map_name: folder / f"{map_name}.png" for map_name in MAPS}
    path = folder / "manifest.json"
    for file in (*files.values(), path):
        images.require_writable(file)
    if any("slope" in layer.writes() for layer in skin.layers):
        _log.warning("%s: the tilt of its normal maps is no part of bump.png", name)
    arrays = generate(skin, size)
    height = arrays["bump"]
    # A symmetric range keeps the undisplaced surface at mid-level exactly.
    half_range = float(np.abs(height).max()) or 1.0
    stored = {"albedo": arrays["albedo"], "bump": 0.5 + height / (2 * half_range), "reflection": arrays["reflection"]}
    entries: dict[str, Any] = {
        "albedo": {"color_space": "sRGB", "encodes": "linear Rec.709"},
        "bump": {"color_space": "data", "mid_level": 0.5, "unit": "mm", "range": [-half_range, half_range]},
        "reflection": {"color_space": "data", "range": [0.0, 1.0]},
    }
    for map_name, file in files.items():
        array = stored[map_name]
        images.write_png(file, array, kind="color" if map_name == "albedo" else "data", bits=16)
        pixels = hashlib.blake2b(np.ascontiguousarray(arrays[map_name]).tobytes(), digest_size=16).hexdigest()
        entries[map_name] |= {"file": file.name, "bits": 16, "pixels": pixels, "bytes": file_digest(file)}
    manifest = {
        "manifest": 1,
        "skin": name,
        "about": skin.about,
        "size": size,
        "extent_mm": skin.extent,
        "seed": skin.seed,
        "versions": {"skincli": skincli.__version__},
        "maps": entries,
    }
    images.write_text(path, json.dumps(manifest, indent=1) + "\n")
    return [*files.values(), path]
