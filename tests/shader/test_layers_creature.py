"""The shaders of scales, warts, papillae, suckers, slime and chromatophores against their float64 twins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from skincli.layers.base import site as site_of
from tests.layers_kit import assert_twin, cloud, draw, square, stack

CREATURE: dict[str, dict[str, Any]] = {
    "scales": {"scales": {"point": 0.6, "keel": 0.7}},
    "gaps": {"scales": {"part": "gap", "direction": [1, 0.5, -1], "overlap": 0.1}},
    "values": {"scales": {"part": "value", "length": 1.4}},
    "warts": {"warts": {}},
    "papillae": {"papillae": {}},
    "suckers": {"suckers": {}},
    "rims": {"suckers": {"part": "rim"}},
    "cups": {"suckers": {"part": "cup", "jitter": 1.0}},
    "slime": {"slime": {"drops": 0.8}},
    "chromatophores": {"chromatophores": {"spacing": 2.5, "open": 1.2}},
}
#: Share of points at which float32 falls on the other side of an edge that is sharper than its digits.
SHARE = 0.001


def shown(name: str) -> dict[str, Any]:
    [(kind, settings)] = CREATURE[name].items()
    return {kind: {**settings, "height": [0.0, 1.0]}}


@pytest.mark.parametrize("name", CREATURE)
def test_shader_and_twin_agree(ctx: Any, name: str) -> None:
    """On a flat map, and on surfaces of all directions with texels from none to coarse."""
    skin = stack(shown(name))
    assert_twin(ctx, skin, square(step=0.21), 1e-4, share=SHARE)
    assert_twin(ctx, skin, cloud(20, 1.5), 1e-4, share=SHARE)


def test_shaders_and_twins_agree_on_a_map_that_repeats(ctx: Any) -> None:
    skin = stack(*(shown(name) for name in CREATURE), extent=20.0, domain="uv", tileable=True)
    assert_twin(ctx, skin, square(step=20 / 64), 2e-4, share=5 * SHARE)


def test_a_texel_without_a_normal_stays_finite(ctx: Any) -> None:
    """Outside the charts of a mesh there is no surface: the Site is all zeros there."""
    site = site_of(np.zeros((64, 3)), np.zeros((64, 3)), np.zeros(64))
    for channel in draw(ctx, stack(*(shown(name) for name in CREATURE)), site).values():
        assert np.isfinite(channel).all()
