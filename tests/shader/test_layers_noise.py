"""The shaders of noise, cells, gradients and regions against their float64 twins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from layers_kit import assert_twin, cloud, draw, evaluate, square, stack

from skincli.layers import LAYERS
from skincli.layers.base import Ground

FRACTALS = [
    {"fbm": {"scale": 6}},
    {"ridged": {"scale": 6, "octaves": 3}},
    {"billow": {"scale": 6, "gain": 0.6}},
    {"turbulence": {"scale": 6}},
    {"noise": {"scale": 6}},
    {"noise": {"scale": 6, "pattern": "value"}},
    {"noise": {"scale": 6, "pattern": "simplex"}},
]
CELLS = [
    {"worley": {"scale": 6}},
    {"worley": {"scale": 6, "pattern": "f2", "levels": [0.9, 0.4]}},
    {"worley": {"scale": 6, "pattern": "f2_f1"}},
    {"worley": {"scale": 6, "pattern": "edges", "width": 0.8}},
    {"worley": {"scale": 6, "pattern": "patches", "width": 1.2}},
]
PLACED = [
    *({"gradient": {"by": axis, "start": -10, "end": 15}} for axis in "xyz"),
    {"gradient": {"by": "x", "start": 1, "end": 0.9, "shape": "linear"}},
    {"gradient": {"by": "slope", "start": 30, "end": 120}},
    {"gradient": {"by": "slope", "axis": "-z", "start": 90, "end": 0, "shape": "linear"}},
    {"uv_region": {"center": [0.4, 0.6], "extent": [0.3, 0.6]}},
    {"uv_region": {"center": [0.4, 0.6], "extent": [0.3, 0.6], "feather": 0.3, "shape": "ellipse"}},
    {"uv_region": {"extent": [0.01, 0.002], "feather": 0, "shape": "ellipse"}},
    {"curvature": {"levels": [0.2, -0.1]}},
    {"occlusion": {"levels": [0.2, 0.7]}},
]


def with_height(layer: dict[str, Any]) -> dict[str, Any]:
    [(kind, settings)] = layer.items()
    return {kind: {**settings, "height": [0, 1]}}


@pytest.mark.parametrize("layer", [*FRACTALS, *CELLS, *PLACED])
@pytest.mark.parametrize("footprint", [0.0, 0.5, 9.0])
def test_it_is_its_twin(ctx: Any, layer: dict[str, Any], footprint: float) -> None:
    """A texel at a threshold of the number of places may be looked at in more places by one of the two."""
    tolerance = 1e-4 if "worley" in layer else 1e-5
    found = assert_twin(ctx, stack(with_height(layer)), cloud(20, footprint), tolerance, share=0.001)
    assert np.ptp(found["height"]) > 0.5 or footprint > 1 or "uv_region" in layer


@pytest.mark.parametrize("layer", [*FRACTALS, *CELLS])
def test_a_tileable_map_is_its_twin(ctx: Any, layer: dict[str, Any]) -> None:
    """One period below and above 0: the shader's wrapping of cells is that of the twin."""
    skin = stack(with_height(layer), extent=21.0, domain="uv", tileable=True)
    site = square(64, 0.75, (-21.0, -21.0, 3.0))
    found = assert_twin(ctx, skin, site, 1e-4, share=0.001)["height"]
    again = draw(ctx, skin, {**site, "position": site["position"] + np.array([21.0, -21.0, 0.0])})["height"]  # type: ignore[typeddict-item]
    assert np.mean(np.abs(found - again) > 1e-3) < 0.001


def test_simplex_noise_keeps_its_digits_far_away(ctx: Any) -> None:
    skin = stack({"noise": {"scale": 2, "pattern": "simplex", "height": [0, 1]}})
    assert_twin(ctx, skin, square(step=0.25, start=(2.0**19, -(2.0**20), 2.0**17)), 1e-5)


def test_a_gradient_by_height_sees_what_lies_below(ctx: Any) -> None:
    """Also where it masks, and not what lies above."""
    below = {"fbm": {"scale": 6, "height": [-1, 1]}}
    mask = {"gradient": {"by": "height", "start": -0.5, "end": 0.5, "shape": "linear"}}
    masked = {"color": {"reflectance": 0, "mask": mask}}
    above = {"color": {"height": 5}}
    found = assert_twin(ctx, stack(below, masked, above), cloud(20), 1e-5)
    expected = 1 - np.clip(found["height"] - 5 + 0.5, 0, 1)
    np.testing.assert_allclose(found["reflectance"], expected, atol=1e-5)


def test_a_texel_without_a_surface_stays_finite(ctx: Any) -> None:
    site = {key: np.zeros_like(array) for key, array in square(8).items()}  # type: ignore[attr-defined]
    for layer in (*FRACTALS, *CELLS, *PLACED):
        height = draw(ctx, stack(with_height(layer)), site)["height"]  # type: ignore[arg-type]
        assert np.isfinite(height).all()


def test_the_twin_of_a_seed_is_that_of_the_shader(ctx: Any) -> None:
    layer = LAYERS["ridged"](scale=6, seed=3)
    site = cloud(20)
    found = draw(ctx, stack({"ridged": {"scale": 6, "seed": 3, "height": [0, 1]}}, seed=9), site)["height"]
    np.testing.assert_allclose(found, evaluate(layer, site, Ground(seed=9)), atol=1e-5)
