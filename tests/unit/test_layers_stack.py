"""What the fused shader contains, without drawing it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from layers_kit import ALL, stack

from skincli.errors import LimitError
from skincli.layers.base import site
from skincli.layers.image import Picture
from skincli.layers.stack import fuse, twin_stack
from skincli.scene.skin import Skin

SITE = site(np.random.default_rng(6).uniform(-10, 10, (100, 3)), np.tile([0.0, 0.0, 1.0], (100, 1)), np.zeros(100))


def members(skin: Skin, *maps: str) -> dict[str, Any]:
    fused = fuse(skin, frozenset(maps))
    return dict(zip((name for name, _ in fused.members), fused.numbers, strict=True))


def test_only_layers_that_write_a_requested_map_are_fused() -> None:
    skin = stack({"fbm": {"height": [0, 1]}}, {"color": {"albedo": [1, 0, 0]}}, {"pores": {}})
    fused = fuse(skin, {"height"})
    assert '#include "layers/fbm.glsl"' in fused.source
    assert '#include "layers/pores.glsl"' in fused.source
    assert fused.source.count("    {") == 2
    assert fused.written == {"height"}
    assert fuse(skin, {"albedo"}).members == (("layer0_opacity", "float"), ("layer0_albedo", "vec3"))


def test_values_of_maps_that_are_not_requested_are_left_out() -> None:
    skin = stack({"fbm": {"height": [0, 1], "albedo": [[0, 0, 0], [1, 1, 1]]}})
    assert "layer0_albedo_low" not in members(skin, "height")
    assert members(skin, "height")["layer0_height_high"] == 1.0
    assert "layer0_height_low" not in members(skin, "albedo")


@pytest.mark.parametrize("off", [{"opacity": 0}, {"enabled": False}, {"mask": {"worley": {"opacity": 0}}}])
def test_a_layer_that_does_not_show_leaves_no_trace(off: dict[str, Any]) -> None:
    rest = [{"color": {"albedo": [1, 0, 0]}}, {"pores": {"tint": [0, 0, 0]}}]
    layer = {"fbm": {"albedo": [[0, 0, 0], [1, 1, 1]], **off}}
    assert fuse(stack(rest[0], layer, rest[1]), ALL) == fuse(stack(*rest), ALL)


def test_equal_effective_values_give_equal_members() -> None:
    one = fuse(stack({"fbm": {"height": [0, 1], "seed": 2, "name": "a"}}, seed=3), ALL)
    two = fuse(stack({"fbm": {"height": [0, 1], "seed": 5, "scale": 10}}, seed=0), ALL)
    assert one == two


def test_a_layer_may_appear_twice() -> None:
    fused = fuse(stack({"pores": {"spacing": 1}}, {"pores": {"spacing": 2}}), {"height"})
    assert fused.source.count("struct pores_values") == 1
    names = [name for name, _ in fused.members]
    assert len(set(names)) == len(names)


def test_a_choice_is_a_constant_and_not_a_uniform() -> None:
    fused = fuse(stack({"worley": {"pattern": "edges", "width": 1, "height": [0, 1]}}), {"height"})
    assert "const int WORLEY_EDGES = 3;" in fused.source
    assert "worley_values(WORLEY_EDGES, p.layer0_scale" in fused.source
    assert "layer0_kind" not in dict(fused.members)


def test_images_are_shared_and_named() -> None:
    grey = {"file": "a.png", "role": "grey"}
    skin = stack(
        {"image": {**grey, "height": [0, 1]}},
        {"image": {**grey, "into": ["albedo"]}},
        {"image": {**grey, "into": ["albedo"], "tile": "clamp"}},
        {"color": {"albedo": [0, 0, 0], "mask": {"image": {"file": "m.png", "role": "grey"}}}},
        {"image": {"file": "n.png", "role": "normal_dx"}},
    )
    found = fuse(skin, ALL).textures
    assert [name for name, _ in found] == ["image0", "image1", "image2"]
    assert [picture.file.name for _, picture in found if isinstance(picture, Picture)] == ["a.png", "m.png", "n.png"]
    assert fuse(skin, {"height"}).textures == found[:1]


def test_too_many_images_are_refused() -> None:
    with pytest.raises(LimitError, match="sample 13 images; at most 12 are allowed"):
        fuse(stack(*({"image": {"file": f"{i}.png"}} for i in range(13))), {"albedo"})


def test_twin_blends_from_bottom_to_top() -> None:
    skin = stack(
        {"color": {"albedo": [0.4, 0.2, 0.8], "height": 0.5, "reflectance": 0.5}},
        {"color": {"albedo": [0.5, 0.5, 0.5], "height": -0.2, "reflectance": 0.5, "blend": "multiply"}},
        {"color": {"albedo": [1, 1, 1], "opacity": 0.25}},
    )
    found = twin_stack(skin, ALL, SITE, {})
    assert found["albedo"][0] == pytest.approx([0.4, 0.325, 0.55])
    assert found["height"] == pytest.approx(np.full(100, 0.3))
    assert found["reflectance"] == pytest.approx(np.full(100, 0.25))
    assert np.all(found["slope"] == 0)


def test_a_mask_multiplies_the_opacity() -> None:
    mask = {"fbm": {"scale": 3, "opacity": 0.5}}
    masked = twin_stack(stack({"color": {"height": 2, "opacity": 0.8, "mask": mask}}), {"height"}, SITE, {})
    pattern = twin_stack(stack({"fbm": {"scale": 3, "height": [0, 1]}}), {"height"}, SITE, {})
    assert np.allclose(masked["height"], 2 * 0.8 * 0.5 * pattern["height"], atol=1e-12)
