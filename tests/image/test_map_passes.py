"""The passes that follow from a relief, normal map and cavity: against their twins, and against what is known."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from skincli.generate import generate
from skincli.gpu.textures import read_back
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import Draw, Load, Node, Ref
from skincli.passes import cavity, normal_map
from skincli.passes.cavity import Cavity, CavityValues
from skincli.passes.normal_map import NormalMap, NormalMapValues
from skincli.scene.skin import Skin

Array = NDArray[np.float64]

SIDE = 48


def drawn(node: Node, output: str, inputs: Mapping[str, Array]) -> Array:
    """Return what a pass makes of some textures."""
    loads = [Load(name, name, partial(list, [array])) for name, array in inputs.items()]
    graph = FrameGraph([*loads, node])
    ref = Ref(node.name, output)
    return read_back(graph.run([ref])[ref]).astype(np.float64)


def texture(*channels: Array) -> Array:
    """Return (h, w, 4) in numbers of float32."""
    padded = [*channels, *[np.zeros_like(channels[0])] * (4 - len(channels))]
    return np.stack(padded, axis=-1).astype(np.float32).astype(np.float64)


def wired(inputs: Mapping[str, Array]) -> dict[str, Ref]:
    return {name: Ref(name, "image") for name in inputs}


@pytest.mark.parametrize("extent", [0.0, 25.0])
def test_normal_map_matches_its_twin(ctx: object, extent: float) -> None:
    random = np.random.default_rng(3)
    slope = texture(*random.normal(0, (30, 30, 0.4, 0.4), (SIDE, SIDE, 4)).transpose(2, 0, 1))
    along, skew, across = random.uniform((1, -20, -60), (60, 20, 60), (SIDE, SIDE, 3)).transpose(2, 0, 1)
    inputs = {"slope": slope, "metric_map": texture(np.where(random.random(along.shape) < 0.1, 0, along), skew, across)}
    values = NormalMapValues(extent)
    found = drawn(NormalMap("normals", (SIDE, SIDE), [Draw(values)], wired(inputs)), "normal", inputs)
    expected = normal_map.twin(values, inputs["slope"], inputs["metric_map"])
    np.testing.assert_allclose(found[..., :3], expected, atol=2e-6)


@pytest.mark.parametrize("repeats", [0, 1])
@pytest.mark.parametrize("footprint", [0.0, 0.3])
def test_cavity_matches_its_twin(ctx: object, footprint: float, repeats: int) -> None:
    random = np.random.default_rng(4)
    mm = np.where(random.random((SIDE, SIDE)) < 0.2, 0, random.uniform(0.1, 0.5, (SIDE, SIDE)))
    none = np.zeros_like(mm)
    inputs = {"height": texture(random.uniform(-1, 1, mm.shape)), "site_normal": texture(none, none, none, mm)}
    values = CavityValues(footprint, 2.0, repeats)
    node = Cavity("openness", (SIDE, SIDE), [Draw(values)], wired(inputs), defines=cavity.DEFINES)
    found = drawn(node, "cavity", inputs)[..., 0]
    expected = cavity.twin(values, inputs["height"][..., 0], footprint or inputs["site_normal"][..., 3])
    # Where a distance is half a texel, float32 may round it to the other side.
    differing = np.abs(found - expected) > 1e-5
    assert differing.mean() < 0.01
    assert expected.min() < 0.2
    assert expected.max() == 1


def made(*layers: object, maps: tuple[str, ...], **keys: object) -> dict[str, Array]:
    skin = Skin.model_validate({"skin": 1, "size": 128, "extent": 20, "layers": list(layers), **keys})
    return {name: array.astype(np.float64) for name, array in generate(skin, maps).items()}


FOLD = {"fbm": {"scale": 8, "octaves": 2, "height": [-0.6, 0.6]}}


def test_normals_are_those_of_the_heights(ctx: object) -> None:
    found = made(FOLD, maps=("height", "normal"))
    step, height = 20 / 128, found["height"][..., 0]
    # Rows run downwards, y upwards.
    slope = np.stack([np.gradient(height, step, axis=1), -np.gradient(height, step, axis=0)], axis=-1)
    normal = np.concatenate([-slope, np.ones_like(slope[..., :1])], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    np.testing.assert_allclose(found["normal"][1:-1, 1:-1], normal[1:-1, 1:-1], atol=1e-4)
    assert np.abs(normal[..., 0]).max() > 0.2


def test_cavity_is_low_in_pits_and_open_on_a_plane(ctx: object) -> None:
    pits = {"pores": {"spacing": 2, "radius": 0.6, "depth": 0.8}}
    found = made(pits, maps=("height", "cavity"))
    height, openness = found["height"], found["cavity"]
    assert openness[height < -0.5].mean() < 0.75
    assert openness[height > -0.01].mean() > 0.98
    assert made({"color": {"height": 1}}, maps=("cavity",))["cavity"].min() == 1
    near, far = (made(FOLD, maps=("cavity",), cavity_radius=radius)["cavity"].mean() for radius in (0.3, 3))
    assert far < near < 1
