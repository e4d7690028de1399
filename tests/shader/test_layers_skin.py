"""The layers of skin against their float64 twins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.layers_kit import assert_twin, cloud, draw, site_of, square, stack

LAYERS: list[dict[str, Any]] = [
    {"pores": {"spacing": 2, "depth": 0}},
    {"follicles": {"spacing": 2}},
    {"follicles": {"spacing": 2, "part": "rim", "direction": [1, 0.5, 0.2]}},
    {"follicles": {"spacing": 2, "part": "dot"}},
    {"wrinkles": {"spacing": 2, "length": 12}},
    {"wrinkles": {"spacing": 2, "length": 8, "cross": 0.6, "direction": [0.3, 1, 0.2]}},
    {"veins": {"spacing": 5, "width": 0.8}},
    {"freckles": {"spacing": 2, "radius": 0.8, "cluster": 9}},
    {"moles": {"spacing": 4, "radius": 1.5}},
    {"moles": {"spacing": 4, "radius": 1.5, "part": "dome"}},
    {"mottling": {"scale": 5}},
    {"scars": {"spacing": 4, "length": 6, "width": 1}},
    {"scars": {"spacing": 4, "length": 6, "width": 1, "part": "puckers"}},
    {"scars": {"spacing": 4, "length": 6, "width": 1, "part": "stitches"}},
]


def raised(layer: dict[str, Any]) -> dict[str, Any]:
    [(name, settings)] = layer.items()
    return {name: {**settings, "height": [0, 1]}}


def names(layer: dict[str, Any]) -> str:
    [(name, settings)] = layer.items()
    return "-".join([name, *(str(settings[key]) for key in ("part", "cross") if key in settings)])


@pytest.mark.parametrize("layer", LAYERS, ids=names)
def test_each_is_its_twin(ctx: Any, layer: dict[str, Any]) -> None:
    tolerance = 1e-5 if "mottling" in layer else 1e-4
    found = assert_twin(ctx, stack(raised(layer)), cloud(12, 1.5), tolerance, share=0.001)["height"]
    assert found.min() >= -1e-6
    assert found.max() <= 1 + 1e-6
    assert np.ptp(found) > 0.3


@pytest.mark.parametrize("layer", LAYERS, ids=names)
def test_each_is_its_twin_on_a_tile(ctx: Any, layer: dict[str, Any]) -> None:
    skin = stack(raised(layer), domain="uv", extent=16, tileable=True)
    assert_twin(ctx, skin, square(step=0.25), 1e-4, share=0.001)


def test_a_texel_without_a_normal_stays_finite(ctx: Any) -> None:
    """Outside the charts of a mesh there is no surface: the Site is all zeros there."""
    nowhere = site_of(np.zeros((16, 3)), np.zeros((16, 3)), np.zeros(16))
    for layer in LAYERS:
        assert np.isfinite(draw(ctx, stack(raised(layer)), nowhere)["height"]).all()
