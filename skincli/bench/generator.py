"""The generator against the clock: each layer alone, each preset as a whole, and the least either could take."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from skincli import presets
from skincli.bench.timing import Spread, free
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import Ref
from skincli.layers.base import Layer, Pattern, site
from skincli.layers.color import Color
from skincli.layers.stack import twin_stack
from skincli.passes.maps import MapSource
from skincli.pipeline import skin_maps
from skincli.scene.paths import load_skin
from skincli.scene.skin import Skin

#: texels a side: of a single layer, of a preset, and of the small square whose twin is timed
LAYER_SIDE, PRESET_SIDE, TWIN_SIDE = 1024, 1024, 96

#: rounds behind every median, unless fewer are asked for
ROUNDS = 3

#: maps of which a preset is timed: those that are written unless others are asked for
TARGETS = ("albedo", "height", "reflectance")

#: how much longer than writing constants a preset may take
AIM = 40


def shown_layers() -> dict[str, tuple[str, Layer]]:
    """Return, for each kind of layer, the first preset that shows it and the layer as it stands there."""
    found: dict[str, tuple[str, Layer]] = {}
    for name in presets.names():
        for layer in load_skin(name).skin.layers:
            for each in _with_masks(layer):
                found.setdefault(each.kind(), (name, each))
    return found


def _with_masks(layer: Layer) -> Iterator[Layer]:
    yield layer
    if layer.mask is not None:
        yield from _with_masks(layer.mask)


def time_layers() -> list[dict[str, Any]]:
    """Time every kind of layer that a preset shows, alone, as it writes one height map of a flat square.

    Returns
    -------
    per layer: kind, preset, ms per megatexel (a Spread), and how many times longer the float64 twin takes per texel
    """
    rows = []
    for kind, (preset, layer) in sorted(shown_layers().items()):
        if not isinstance(layer, Pattern) or "slope" in layer.writes():
            continue
        alone = layer.model_copy(
            update={
                "mask": None, "albedo": None, "reflectance": None, "roughness": None, "specular": None,
                "scattering_radius": None, "pigments": None, "height": (0.0, 1.0), "blend": "normal", "opacity": 1.0,
            }
        )  # fmt: skip
        skin = Skin(skin=1, size=LAYER_SIDE, layers=()).model_copy(update={"layers": (alone,)})
        times = _maps_ms(skin, ("height",), ROUNDS)
        per_megatexel = Spread.of([ms / (LAYER_SIDE**2 / 1e6) for ms in times])
        ratio = _twin_ms(skin) / TWIN_SIDE**2 / (per_megatexel.median / 1e6)
        rows.append({"layer": kind, "preset": preset, "ms_per_megatexel": asdict(per_megatexel), "twin_ratio": ratio})
    return rows


def time_presets(rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """Time every preset's maps, and beside each round the floor: the same targets written with a constant.

    Parameters
    ----------
    rounds : behind every median

    Returns
    -------
    per preset: ms (a Spread), floor_ms (a Spread), ratio of the two (median over the rounds), ms per megatexel
    """
    floor_layer = Color(albedo=(0.5, 0.4, 0.3), height=0.1, reflectance=0.5)
    floor = Skin(skin=1, size=PRESET_SIDE, layers=()).model_copy(update={"layers": (floor_layer,)})
    rows = []
    for name in presets.names():
        skin = load_skin(name).skin.model_copy(update={"size": PRESET_SIDE})
        times, floors = _maps_ms(skin, TARGETS, rounds), _maps_ms(floor, TARGETS, rounds)
        spread = Spread.of(times)
        rows.append(
            {
                "preset": name,
                "side": PRESET_SIDE,
                "layers": len(skin.layers),
                "ms": asdict(spread),
                "floor": asdict(Spread.of(floors)),
                "to_floor": round(float(np.median(np.divide(times, floors))), 2),
                "ms_per_megatexel": round(spread.median / (PRESET_SIDE**2 / 1e6), 3),
            }
        )
    return rows


def _maps_ms(skin: Skin, outputs: Sequence[str], rounds: int) -> list[float]:
    """Return the times of the fused draw of a skin's maps on a flat square, compiled and with its textures loaded."""
    made = skin_maps("skin", skin, MapSource.of_skin(skin), None, ())
    targets = [source for output in outputs if isinstance(source := made.maps[output], Ref)]
    graph = FrameGraph(made.nodes, skip=False)
    graph.run(targets)
    times = []
    for _ in range(rounds):
        graph.run(targets, timing=True)
        times += [report.ms for report in graph.reports if report.name == "skin_maps" and report.ms is not None]
    free(graph.store)
    return times


def _twin_ms(skin: Skin) -> float:
    """Return the time of the float64 twin on a small square."""
    textures = {
        texture: np.asarray(texture.make(), float) for layer in skin.layers for texture in layer.textures(skin.ground)
    }
    v, u = (np.mgrid[0:TWIN_SIDE, 0:TWIN_SIDE].reshape(2, -1) + 0.5) / TWIN_SIDE
    count, texel = len(u), skin.extent / skin.size
    place = site(
        np.column_stack([u, v, np.zeros(count)]) * texel * TWIN_SIDE,
        np.tile([0.0, 0.0, 1.0], (count, 1)),
        np.full(count, texel),
        np.column_stack([u, v]),
        np.full(count, 1 / skin.size),
    )
    start = time.perf_counter()
    twin_stack(skin, {"height"}, place, textures)
    return (time.perf_counter() - start) * 1000
