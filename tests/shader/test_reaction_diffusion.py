"""The reaction-diffusion shader against its float64 twin."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest

from skincli.layers.base import Site
from skincli.layers.reaction_diffusion import Name
from tests.layers_kit import assert_twin, cloud, draw, square, stack

TOLERANCE = 1e-5


@pytest.mark.parametrize("pattern", get_args(Name))
def test_a_flat_map_is_its_twin(ctx: Any, pattern: Name) -> None:
    layer = {"pattern": pattern, "scale": 3, "height": [0, 1]}
    found = assert_twin(ctx, stack({"reaction_diffusion": layer}), square(), TOLERANCE)["height"]
    assert np.ptp(found) > 0.9


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("footprint", [0.0, 8.0])
def test_a_surface_in_space_is_its_twin(ctx: Any, axis: str, footprint: float) -> None:
    layer = {"pattern": "stripes", "scale": 3, "axis": axis, "height": [0, 1]}
    assert_twin(ctx, stack({"reaction_diffusion": layer}), cloud(20, footprint), TOLERANCE)


def test_hard_edges_are_their_twin(ctx: Any) -> None:
    layer = {"scale": 3, "levels": [0.5, 0.5], "height": [0, 1]}
    assert_twin(ctx, stack({"reaction_diffusion": layer}), cloud(20, 0.5), 2 * TOLERANCE)


def test_far_from_the_origin_distances_keep_their_size(ctx: Any) -> None:
    layer = {"scale": 4, "height": [0, 1]}
    site = square(step=0.25, start=(2.0**17, -(2.0**18), 0))
    assert_twin(ctx, stack({"reaction_diffusion": layer}), site, 0.01)


def test_a_tileable_map_is_its_twin_and_wraps(ctx: Any) -> None:
    skin = stack(
        {"reaction_diffusion": {"pattern": "net", "scale": 3, "height": [0, 1]}}, extent=16, tileable=True, domain="uv"
    )
    t = assert_twin(ctx, skin, square(), TOLERANCE)["height"].reshape(64, 64)
    for axis in (0, 1):
        across = np.abs(np.take(t, 0, axis) - np.take(t, -1, axis)).max()
        assert across <= np.abs(np.diff(t, axis=axis)).max()


def test_what_is_far_too_small_is_its_mean(ctx: Any) -> None:
    layer = {"pattern": "spots", "height": [0, 1]}
    skin = stack({"reaction_diffusion": {**layer, "scale": 0.5}})
    faded = draw(ctx, skin, square(16, 37.0))["height"]
    fine = draw(ctx, skin, square(64, 0.125))["height"]
    np.testing.assert_allclose(faded, fine.mean(), atol=0.01)


def test_a_texel_without_a_normal_stays_finite(ctx: Any) -> None:
    site = cloud(20)
    empty = Site(**{key: np.zeros_like(array) for key, array in site.items()})  # type: ignore[typeddict-item]
    found = draw(ctx, stack({"reaction_diffusion": {"height": [0, 1]}}), empty)["height"]
    assert np.isfinite(found).all()


def test_equal_tiles_are_shared(ctx: Any) -> None:
    """Two layers of one pattern sample one texture."""
    from skincli.layers.stack import fuse

    layer = {"reaction_diffusion": {"pattern": "spots", "height": [0, 1]}}
    assert len(fuse(stack(layer, layer), {"height"}).textures) == 1
