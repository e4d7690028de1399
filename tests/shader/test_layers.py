"""The shader that a stack of layers becomes, against its float64 twin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from layers_kit import Array, Drawn, assert_resolution_law, assert_twin, cloud, draw, flat, square, stack

from skincli.layers import LAYERS
from skincli.layers.base import Pattern
from skincli.layers.base import site as site_of
from skincli.layers.stack import CHANNELS

RAMPS = {"albedo": [[0, 0.2, 0.4], [1, 0.8, 0.6]], "height": [0, 1], "reflectance": [1, 0]}


@pytest.mark.parametrize("footprint", [0.0, 6.0])
def test_fbm_is_its_twin(ctx: Any, footprint: float) -> None:
    skin = stack({"fbm": {"scale": 4, "octaves": 6, "warp": 3, "seed": 2, **RAMPS}})
    found = assert_twin(ctx, skin, cloud(20, footprint), 1e-5)
    assert np.ptp(found["height"]) > 0.5


def test_levels_of_fbm_are_their_twin(ctx: Any) -> None:
    skin = stack({"fbm": {"scale": 4, "levels": [0.7, 0.4], "height": [0, 1]}})
    found = assert_twin(ctx, skin, cloud(20), 1e-5)
    assert np.quantile(found["height"], [0.05, 0.95]) == pytest.approx([0, 1], abs=0.01)


WORLEY = [
    {"pattern": "f1"},
    {"pattern": "f1", "levels": [0.5, 0.2], "warp": 2},
    {"pattern": "edges", "width": 0.8},
    {"pattern": "patches", "width": 1.2},
]


@pytest.mark.parametrize("settings", WORLEY)
@pytest.mark.parametrize("footprint", [0.0, 9.0])
def test_worley_is_its_twin(ctx: Any, settings: dict[str, Any], footprint: float) -> None:
    skin = stack({"worley": {"scale": 6, **settings, **RAMPS}})
    found = assert_twin(ctx, skin, cloud(20, footprint), 1e-4)
    assert np.ptp(found["height"]) > 0.5


@pytest.mark.parametrize("footprint", [0.0, 3.0])
def test_pores_are_their_twin(ctx: Any, footprint: float) -> None:
    skin = stack({"color": {"albedo": [0.9, 0.8, 0.7]}}, {"pores": {"spacing": 2, "depth": 1, "tint": [0.5, 0.4, 0.3]}})
    found = assert_twin(ctx, skin, cloud(20, footprint), 1e-4)
    assert found["height"].min() < -0.6


@pytest.mark.parametrize("mode", ["normal", "multiply", "screen", "overlay"])
def test_blend_modes_are_their_twins(ctx: Any, mode: str) -> None:
    pair = {"albedo": [[0, 0, 0], [1, 1, 1]], "reflectance": [0, 1]}
    below, above = {"scale": 5, "seed": 1, **pair}, {"scale": 3, "seed": 2, "blend": mode, "opacity": 0.7, **pair}
    assert_twin(ctx, stack({"fbm": below}, {"fbm": above}), cloud(15), 1e-5)


def test_nested_masks_are_their_twins(ctx: Any) -> None:
    mask = {"worley": {"scale": 5, "opacity": 0.9, "mask": {"pores": {"spacing": 4, "radius": 2}}}}
    skin = stack({"fbm": {"scale": 6, "mask": mask, "opacity": 0.8, **RAMPS}})
    found = assert_twin(ctx, skin, cloud(15), 1e-4)
    assert np.ptp(found["height"]) > 0.1


def test_precision_does_not_fall_with_distance(ctx: Any) -> None:
    """Positions that float32 holds exactly are split exactly, however far they lie."""
    skin = stack({"fbm": {"scale": 2, **RAMPS}}, {"worley": {"scale": 4, "height": [0, 1]}})
    assert_twin(ctx, skin, square(step=0.25, start=(2.0**19, -(2.0**20), 2.0**17)), 1e-5)


def test_the_seed_of_the_skin_is_added(ctx: Any) -> None:
    layer = {"scale": 5, "height": [0, 1]}
    site = cloud(20)
    one = draw(ctx, stack({"fbm": {**layer, "seed": 3}}, seed=4), site)["height"]
    same = draw(ctx, stack({"fbm": {**layer, "seed": 7}}, seed=0), site)["height"]
    other = draw(ctx, stack({"fbm": {**layer, "seed": 4}}, seed=4), site)["height"]
    assert np.array_equal(one, same)
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.1


#: For each pattern and part the settings that are looked at; sizes are what they are by default.
RESOLUTION: list[dict[str, dict[str, Any]]] = [
    {"noise": {}},
    {"noise": {"pattern": "value"}},
    {"noise": {"pattern": "simplex"}},
    {"fbm": {}},
    {"fbm": {"levels": [0.55, 0.6]}},
    {"ridged": {}},
    {"ridged": {"octaves": 1}},
    {"billow": {}},
    {"turbulence": {}},
    {"worley": {}},
    {"worley": {"pattern": "f2"}},
    {"worley": {"pattern": "f2_f1", "levels": [0, 0.6]}},
    {"worley": {"pattern": "edges", "width": 0.5}},
    {"worley": {"pattern": "edges", "width": 0.1}},
    {"worley": {"pattern": "patches", "width": 0.5}},
    {"mottling": {}},
    {"mottling": {"net": 1}},
    {"pores": {}},
    {"pores": {"radius": 0.5, "jitter": 0}},
    {"follicles": {"radius": 1, "elongation": 3, "variation": 0}},
    {"follicles": {"part": "rim"}},
    {"follicles": {"part": "dot"}},
    {"wrinkles": {"cross": 0.5}},
    {"wrinkles": {"width": 1, "variation": 0}},
    {"veins": {"branches": 4}},
    {"freckles": {}},
    {"moles": {"radius": 12, "variation": 0.2}},
    {"moles": {"part": "dome"}},
    {"scars": {}},
    {"scars": {"part": "puckers"}},
    {"scars": {"part": "stitches"}},
    {"scales": {}},
    {"scales": {"part": "gap"}},
    {"scales": {"part": "value"}},
    {"warts": {}},
    {"warts": {"flatness": 1, "variation": 0, "clustering": 0, "diameter": 3}},
    {"papillae": {"variation": 0.1, "diameter": 8}},
    {"papillae": {"variation": 0.7, "curve": [[0.15, 0], [0.5, 1]]}},
    {"suckers": {}},
    {"suckers": {"part": "rim"}},
    {"suckers": {"part": "cup", "jitter": 1}},
    {"slime": {}},
    {"slime": {"drops": 1, "coverage": 0, "drop_size": 2}},
    {"chromatophores": {}},
    {"chromatophores": {"expansion": 1}},
    {"reaction_diffusion": {"pattern": "labyrinth"}},
    {"reaction_diffusion": {"curve": [[0.45, 0], [0.55, 1]]}},
    {"gradient": {"by": "x", "start": 5.3, "end": 5.31}},
    {"gradient": {"by": "x", "start": 5, "end": 6, "shape": "linear"}},
]
#: Where the law cannot hold: RMS and maximum that are kept to, and why.
BEYOND: list[tuple[dict[str, dict[str, Any]], float, float]] = [
    # Half of it is 0 and half 1: as large a variance as any pattern has, which places of a texel hardly tell.
    ({"fbm": {"curve": [[0.45, 0], [0.55, 1]]}}, 0.017, 0.065),
    ({"ridged": {"levels": [0.6, 0.65]}}, 0.017, 0.065),
    # Corners at which more than two values meet keep their sharpness however large the map.
    ({"worley": {"pattern": "patches"}}, 0.012, 0.13),
    # The finest octaves are nearly as strong as the coarsest, so that texels of no size are large for all.
    ({"fbm": {"gain": 0.8, "octaves": 8}}, 0.024, 0.1),
]


def assert_drawn_law(ctx: Any, layer: dict[str, dict[str, Any]], rms: float, maximum: float) -> None:
    [(kind, settings)] = layer.items()
    drawn = Drawn(ctx, stack({kind: {**settings, "height": [0, 1]}}), frozenset({"height"}))
    made = LAYERS[kind].model_validate(settings)
    assert isinstance(made, Pattern)
    assert_resolution_law(made, rms, maximum, look=lambda site: drawn(site)["height"])
    drawn.release()


@pytest.mark.parametrize("layer", RESOLUTION, ids=str)
def test_twice_the_resolution_averaged_agrees(ctx: Any, layer: dict[str, dict[str, Any]]) -> None:
    assert_drawn_law(ctx, layer, 0.01, 0.05)


@pytest.mark.parametrize(("layer", "rms", "maximum"), BEYOND, ids=str)
def test_what_cannot_agree_keeps_near(ctx: Any, layer: dict[str, Any], rms: float, maximum: float) -> None:
    assert_drawn_law(ctx, layer, rms, maximum)


@pytest.mark.parametrize("kind", ["ridged", "worley", "follicles", "freckles", "scales", "warts", "suckers", "slime"])
def test_what_is_far_too_small_is_its_mean(ctx: Any, kind: str) -> None:
    """On a flat square, which lies at one height of all lattices."""
    drawn = Drawn(ctx, stack({kind: {"height": [0, 1]}}), frozenset({"height"}))
    size = LAYERS[kind]().size()  # type: ignore[attr-defined]
    faded = drawn(flat(8, 8000 * size, 1000 * size))["height"]
    assert np.ptp(faded) < 0.002
    assert faded.mean() == pytest.approx(drawn(flat(256, 100 * size))["height"].mean(), abs=0.015)
    drawn.release()


PATTERNS = [{kind: {**settings, "height": [0, 1]}} for layer in RESOLUTION for kind, settings in layer.items()]


def picture(channels: int = 3, side: int = 32) -> Array:
    """Return a smooth picture, so that the coarse weights of a GPU's texture filter matter little."""
    v, u = np.mgrid[0:side, 0:side] / side
    waves = [np.sin(2 * np.pi * (u + v * k)) for k in (0, 1, -1)]
    return 0.5 + 0.3 * np.stack(waves[:channels], axis=-1)


@pytest.mark.parametrize("tile", ["clamp", "repeat", "mirror"])
@pytest.mark.parametrize("size", [{"tiles": 2.5}, {"tiles": 0.5}, {"tile_size": 12}])
@pytest.mark.parametrize("role", ["color", "grey"])
def test_image_is_its_twin(ctx: Any, tile: str, size: dict[str, float], role: str) -> None:
    layer = {"file": "a.png", "role": role, "tile": tile, "into": ["albedo", "reflectance"], "height": [0, 1], **size}
    pictures = {Path("a.png"): picture(3 if role == "color" else 1)}
    # A picture that is clamped or repeated has an edge, where the filter's weights, 8 bits on many GPUs, show most.
    found = assert_twin(ctx, stack({"image": layer}), cloud(10, 2.0), 0.004, pictures)
    assert np.ptp(found["height"]) > 0.25


@pytest.mark.parametrize("role", ["normal_gl", "normal_dx"])
@pytest.mark.parametrize("tile", ["repeat", "mirror"])
def test_normal_map_is_its_twin(ctx: Any, role: str, tile: str) -> None:
    skin = stack({"image": {"file": "a.png", "role": role, "tile": tile, "tiles": 2, "opacity": 0.5}})
    normals = picture()
    normals[..., 2] = 0.9
    assert_twin(ctx, skin, square(), 0.01, {Path("a.png"): normals})


@pytest.mark.parametrize(("role", "up"), [("normal_gl", 1), ("normal_dx", -1)])
def test_normal_map_of_a_slope_gives_the_slope(ctx: Any, role: str, up: int) -> None:
    """A plane that rises 0.3 per distance along u and falls 0.4 along v."""
    normal = np.array([-0.3, 0.4 * up, 1.0]) / np.sqrt(1.25)
    pictures = {Path("n.png"): np.tile(0.5 + 0.5 * normal, (4, 4, 1))}
    slope = draw(ctx, stack({"image": {"file": "n.png", "role": role}}), square(8), pictures=pictures)["slope"]
    np.testing.assert_allclose(slope, np.tile([0.3, -0.4], (64, 1)), atol=1e-5)


def test_a_normal_that_lies_in_the_surface_stays_finite(ctx: Any) -> None:
    pictures = {Path("n.png"): np.tile([1.0, 0.5, 0.5], (4, 4, 1))}
    slope = draw(ctx, stack({"image": {"file": "n.png", "role": "normal_gl"}}), square(8), pictures=pictures)["slope"]
    np.testing.assert_allclose(slope, np.tile([-20.0, 0.0], (64, 1)), atol=1e-4)


def test_the_top_of_a_picture_lies_at_v_1(ctx: Any) -> None:
    pixels = np.zeros((4, 4, 3))
    pixels[0, 3] = (1.0, 0.0, 0.0)
    albedo = draw(ctx, stack({"image": {"file": "a.png"}}), square(4), pictures={Path("a.png"): pixels})["albedo"]
    np.testing.assert_allclose(albedo.reshape(4, 4, 3)[::-1], pixels, atol=1e-6)


def test_a_texel_without_a_normal_stays_finite(ctx: Any) -> None:
    """Outside the charts of a mesh there is no surface: the Site is all zeros there."""
    site = site_of(np.zeros((64, 3)), np.zeros((64, 3)), np.zeros(64))
    layers = [*PATTERNS, {"image": {"file": "a.png", "tile_size": 5}}]
    for channel in draw(ctx, stack(*layers), site, pictures={Path("a.png"): picture()}).values():
        assert np.isfinite(channel).all()


def test_only_the_requested_maps_are_computed(ctx: Any) -> None:
    skin = stack({"fbm": RAMPS}, {"image": {"file": "n.png", "role": "normal_gl"}})
    found = draw(ctx, skin, square(8), maps=frozenset({"height"}))
    assert np.ptp(found["height"]) > 0
    for channel in ("albedo", "reflectance", "slope"):
        assert np.all(found[channel] == CHANNELS[channel][1])


def test_a_skin_without_layers_is_constant(ctx: Any) -> None:
    skin = stack()
    found = draw(ctx, skin, square(8))
    for channel, (_, start) in CHANNELS.items():
        np.testing.assert_allclose(
            found[channel],
            np.broadcast_to(skin.start.get(channel, start), (64, len(start))).reshape(found[channel].shape),
            atol=1e-6,
        )
