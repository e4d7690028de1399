"""Laws of noise, cells, gradients and regions, on their float64 twins."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from layers_kit import assert_tileable, evaluate, flat
from pydantic import ValidationError

from skincli.layers import hashing
from skincli.layers.base import Layer, site
from skincli.layers.billow import Billow
from skincli.layers.curvature import Curvature
from skincli.layers.fbm import Fbm
from skincli.layers.gradient import Gradient
from skincli.layers.noise import DEVIATION, Kind, Noise
from skincli.layers.occlusion import Occlusion
from skincli.layers.ridged import Ridged
from skincli.layers.turbulence import Turbulence
from skincli.layers.uv_region import UvRegion
from skincli.layers.worley import Worley

PATTERNS: list[Any] = [
    Noise(scale=8),
    Noise(scale=8, pattern="value"),
    Noise(scale=8, pattern="simplex"),
    Fbm(scale=8),
    Ridged(scale=8),
    Billow(scale=8),
    Turbulence(scale=8),
    Worley(scale=8),
    Worley(scale=8, pattern="f2"),
    Worley(scale=8, pattern="f2_f1"),
    Worley(scale=8, pattern="edges", width=0.8),
    Worley(scale=8, pattern="patches", width=0.8),
]


def name(layer: Layer) -> str:
    return f"{layer.kind()}-{getattr(layer, 'pattern', '')}"


@pytest.mark.parametrize("layer", PATTERNS, ids=name)
def test_patterns_lie_in_0_to_1_and_fill_it(layer: Layer) -> None:
    t = evaluate(layer, flat(150, 400))
    assert t.min() >= 0
    assert t.max() <= 1
    assert np.ptp(t) > 0.9


@pytest.mark.parametrize("layer", PATTERNS, ids=name)
def test_a_tileable_map_wraps(layer: Layer) -> None:
    assert_tileable(layer)


@pytest.mark.parametrize("layer", PATTERNS, ids=name)
def test_a_pattern_of_twice_the_scale_is_twice_as_large(layer: Any) -> None:
    larger = layer.model_copy(update={"scale": 16.0, "width": 1.6} if getattr(layer, "width", 0) else {"scale": 16.0})
    one, two = evaluate(layer, flat(40, 30, 0.5)), evaluate(larger, flat(40, 60, 1.0))
    np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.parametrize("noise", DEVIATION)
def test_noise_has_the_deviation_that_is_assumed(noise: Kind) -> None:
    x = hashing.split(np.random.default_rng(4).random((100_000, 3)) * 1000)
    function = {
        Kind.VALUE: lambda *place: hashing.value_noise(*place)[:, 0],
        Kind.GRADIENT: hashing.gradient_noise,
        Kind.SIMPLEX: hashing.simplex_noise,
    }[noise]
    values = function(*x, 0, 3)
    assert values.mean() == pytest.approx(0, abs=0.005)
    assert values.std() == pytest.approx(DEVIATION[noise], rel=0.01)


def test_simplex_noise_is_continuous() -> None:
    x = np.random.default_rng(5).uniform(-50, 50, (20_000, 3))
    step = np.random.default_rng(6).uniform(-1e-6, 1e-6, x.shape)
    here, there = (hashing.simplex_noise(*hashing.split(place), 0, 3) for place in (x, x + step))
    assert np.abs(here - there).max() < 3e-5


@pytest.mark.parametrize(("layer", "steps"), [(Ridged, "up"), (Billow, "down"), (Turbulence, "down")])
def test_creases_lie_where_the_noise_changes_its_sign(layer: Any, steps: str) -> None:
    """One octave: the ends of the range are where the gradient noise of the same seed is 0."""
    x = flat(300, 60)
    t = evaluate(layer(scale=10, octaves=1), x)
    noise = hashing.gradient_noise(*hashing.split(x["position"] / 10), 0, 0)
    near = np.abs(noise) < 0.005
    assert near.sum() > 100
    assert t[near].min() > 0.9 if steps == "up" else t[near].max() < 0.05


def test_f2_is_f1_and_the_difference() -> None:
    """With levels so wide that their smooth step tells the raw value."""

    def raw(pattern: Any, far: float) -> Any:
        t = evaluate(Worley(scale=10, pattern=pattern), flat(60, 80))
        x = np.linspace(0, 1, 100_001)
        return far * np.interp(t, x * x * (3 - 2 * x), x)

    first, second, difference = raw("f1", 1.0), raw("f2", 1.2), raw("f2_f1", 0.75)
    inside = (first < 0.99) & (second < 1.19) & (difference < 0.74)
    np.testing.assert_allclose((second - first)[inside], difference[inside], atol=1e-4)


def test_a_gradient_runs_from_start_to_end() -> None:
    places = np.array([[0.0, y, 0.0] for y in (-5, 10, 15, 20, 40)])
    line = site(places, np.tile([0.0, 0.0, 1.0], (5, 1)), np.zeros(5))
    assert evaluate(Gradient(start=10, end=20, shape="linear"), line) == pytest.approx([0, 0, 0.5, 1, 1])
    assert evaluate(Gradient(start=20, end=10, shape="linear"), line) == pytest.approx([1, 1, 0.5, 0, 0])
    assert evaluate(Gradient(start=0, end=40), line) == pytest.approx([0, 0.15625, 0.31640625, 0.5, 1])


def test_a_slope_is_the_angle_to_the_axis() -> None:
    angles = np.radians([0, 30, 60, 90, 150, 180])
    normals = np.column_stack([np.sin(angles), np.cos(angles), np.zeros(6)])
    turned = site(np.zeros((6, 3)), normals, np.zeros(6))
    rising = evaluate(Gradient(by="slope", start=0, end=180, shape="linear"), turned)
    assert rising == pytest.approx([0, 1 / 6, 1 / 3, 1 / 2, 5 / 6, 1])
    falling = evaluate(Gradient(by="slope", axis="-y", start=0, end=180, shape="linear"), turned)
    assert falling == pytest.approx(1 - rising)


def test_a_slope_beyond_180_degrees_is_refused() -> None:
    with pytest.raises(ValidationError, match="0 to 180 degrees; found 0 to 200"):
        Gradient(by="slope", start=0, end=200)
    with pytest.raises(ValidationError, match="two different values"):
        Gradient(start=3, end=3)


def region_errors(layer: UvRegion, side: int) -> float:
    coarse = evaluate(layer, flat(side, 1)).reshape(side, side)
    fine = evaluate(layer, flat(2 * side, 1)).reshape(side, 2, side, 2).mean(axis=(1, 3))
    return float(np.abs(coarse - fine).max())


@pytest.mark.parametrize("shape", ["rectangle", "ellipse"])
@pytest.mark.parametrize("feather", [0.0, 0.02, 0.2])
def test_a_region_agrees_at_twice_the_resolution(shape: Any, feather: float) -> None:
    layer = UvRegion(center=(0.47, 0.52), extent=(0.4, 0.3), feather=feather, shape=shape)
    assert max(region_errors(layer, side) for side in (4, 8, 16, 32, 64)) < 0.06


@pytest.mark.parametrize(("shape", "area"), [("rectangle", 1.0), ("ellipse", np.pi / 4)])
def test_a_region_has_the_area_that_is_asked_for(shape: Any, area: float) -> None:
    """However small it is for the texels."""
    for extent in ((0.5, 0.25), (0.1, 0.1), (0.01, 0.02)):
        layer = UvRegion(extent=extent, feather=0, shape=shape)
        assert evaluate(layer, flat(64, 1)).mean() == pytest.approx(area * extent[0] * extent[1], rel=0.08)


def test_a_region_is_where_it_is_asked_for() -> None:
    place = site(
        np.zeros((4, 3)), np.zeros((4, 3)), np.zeros(4), np.array([[0.2, 0.7], [0.3, 0.7], [0.2, 0.9], [0, 0]])
    )
    for shape in ("rectangle", "ellipse"):
        layer = UvRegion(center=(0.2, 0.7), extent=(0.2, 0.1), feather=0.01, shape=shape)  # type: ignore[arg-type]
        assert evaluate(layer, place) == pytest.approx([1, 0.5, 0, 0])


def test_baked_fields_become_patterns() -> None:
    flat_normals = np.tile([0.0, 0.0, 1.0], (5, 1))
    curved = site(np.zeros((5, 3)), flat_normals, np.zeros(5), curvature=np.array([-1, 0, 0.05, 0.1, 1]))
    assert evaluate(Curvature(), curved) == pytest.approx([0, 0, 0.5, 1, 1])
    folded = site(np.zeros((5, 3)), flat_normals, np.zeros(5), occlusion=np.array([0, 0.2, 0.5, 0.8, 1]))
    t = evaluate(Occlusion(levels=(0.8, 0.2)), folded)
    assert t == pytest.approx([1, 1, 0.5, 0, 0])
    assert all(np.diff([before, after]) <= 0 for before, after in pairwise(t))


@pytest.mark.parametrize("layer", [UvRegion, Curvature, Occlusion])
def test_what_does_not_follow_the_position_is_not_warped(layer: Any) -> None:
    with pytest.raises(ValidationError, match="remove warp"):
        layer(warp=2)


def test_what_is_read_of_the_site_is_told() -> None:
    assert Curvature().reads_of() == {"curvature"}
    assert Occlusion().reads_of() == {"occlusion"}
    assert Gradient(by="height", start=0, end=1).reads_of() == {"height"}
    assert Gradient().reads_of() == frozenset()
