"""Laws of the patterns, on their float64 twins: no OpenGL."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from layers_kit import evaluate, flat
from numpy.typing import NDArray

from skincli.layers import LAYERS, hashing
from skincli.layers.base import Layer, Site, site
from skincli.layers.fbm import Fbm
from skincli.layers.fractal import NOISE_DEVIATION
from skincli.layers.pores import Pores
from skincli.layers.worley import Worley

Array = NDArray[np.float64]


def test_the_hash_is_pcg4d() -> None:
    """One value worked out with unbounded integers, step by step as published."""

    def pcg4d(v: list[int]) -> list[int]:
        v = [(x * 1664525 + 1013904223) % 2**32 for x in v]
        for last in (False, True):
            for i, (j, k) in enumerate(((1, 3), (2, 0), (0, 1), (1, 2))):
                v[i] = (v[i] + v[j] * v[k]) % 2**32
            if not last:
                v = [x ^ (x >> 16) for x in v]
        return v

    [found] = hashing.hash_cell(np.array([[-3, 2**31 + 5, 77]]), 9)
    expected = pcg4d([-3 % 2**32, 2**31 + 5, 77, 9])
    assert found == pytest.approx([(x >> 8) / 2**24 for x in expected], abs=0)


def test_hashes_of_neighbors_are_uniform_and_independent() -> None:
    cells = np.stack(np.meshgrid(*[np.arange(-20, 20)] * 3), axis=-1).reshape(-1, 3)
    numbers = hashing.hash_cell(cells, 1)
    assert numbers.min() >= 0
    assert numbers.max() < 1
    assert np.allclose(numbers.mean(axis=0), 0.5, atol=0.01)
    assert np.allclose(numbers.var(axis=0), 1 / 12, atol=0.002)
    following = hashing.hash_cell(cells + np.array([1, 0, 0]), 1)
    other_seed = hashing.hash_cell(cells, 2)
    correlation = np.corrcoef(np.column_stack([numbers, following, other_seed]).T)
    assert np.abs(correlation - np.eye(12)).max() < 0.02


def test_gradient_noise_has_the_deviation_that_is_assumed() -> None:
    x = np.random.default_rng(4).random((200_000, 3)) * 1000
    noise = hashing.gradient_noise(*hashing.split(x), 0, 3)
    assert noise.mean() == pytest.approx(0, abs=0.002)
    assert noise.std() == pytest.approx(NOISE_DEVIATION, rel=0.01)


def test_noise_is_continuous_across_cells() -> None:
    x = np.array([[3.0, 0.3, 0.6], [0.2, -5.0, 0.1], [0.7, 0.7, 8.0]])
    below, above = (hashing.gradient_noise(*hashing.split(x + step), 0, 3) for step in (-1e-9, 1e-9))
    assert np.allclose(below, above, atol=1e-8)


@pytest.mark.parametrize(("ends", "expected"), [((0.2, 0.6), [0, 0, 0.5, 1]), ((0.6, 0.2), [1, 1, 0.5, 0])])
def test_levels_stretch_and_invert(ends: tuple[float, float], expected: list[float]) -> None:
    assert hashing.levels(np.array([0.1, 0.2, 0.4, 0.6]), ends, 0.0) == pytest.approx(expected)


def test_levels_are_never_steeper_than_the_blur_allows() -> None:
    t = np.linspace(0, 1, 1001)
    assert np.abs(np.diff(hashing.levels(t, (0.5, 0.5), 0.1))).max() < 0.001 * 1.5 / 0.2 * 1.001


def test_what_is_smaller_than_a_texel_fades() -> None:
    """A Gaussian, which comes nearest to what a mean over the texel leaves of a pattern."""
    ratios = np.array([0.0, 0.25, 0.5, 1, 2, 20])
    found = np.array([hashing.resolved(1.0, ratio) for ratio in ratios])
    assert np.all(np.diff(found) < 0)
    assert found[0] == 1
    assert hashing.resolved(3.0, np.array([3.0]))[0] == pytest.approx(np.exp(-1))
    assert found[-1] < 1e-30


@pytest.mark.parametrize("layer", [Fbm(scale=7), Worley(scale=7), Pores(spacing=3)])
def test_patterns_lie_in_0_to_1_and_fill_it(layer: Layer) -> None:
    t = evaluate(layer, flat(100, 200))
    assert t.min() >= 0
    assert t.max() <= 1
    assert np.ptp(t) > 0.8


def test_size_in_mm_sets_the_size_of_features() -> None:
    """A pattern of twice the scale at twice the place is the same pattern."""
    for layer in (Fbm, Worley):
        one = evaluate(layer(scale=4), flat(40, 30))
        two = evaluate(layer(scale=8), flat(40, 60))
        assert np.allclose(one, two, atol=1e-12)


def peaks(t: Array, above: float) -> int:
    """Count local maxima of a map above a value."""
    inner = t[1:-1, 1:-1]
    shifts = [np.roll(t, (i, j), (0, 1))[1:-1, 1:-1] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    return int(np.sum((inner > above) & np.all([inner > shifted for shifted in shifts], axis=0)))


def test_pores_have_the_spacing_that_is_asked_for() -> None:
    """On the flat, where no pore is farther from the surface than half the jitter, and on slanted planes."""
    layer = Pores(spacing=2, radius=0.4, variation=0, jitter=1)
    plane = flat(200, 40)
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    counts = []
    for shift in range(4):
        turned = {**plane, "position": plane["position"] @ turn.T + 100 * shift, "normal": plane["normal"] @ turn.T}
        t = evaluate(layer, Site(**turned)).reshape(200, 200)  # type: ignore[typeddict-item]
        counts.append(peaks(t, 0.5))
    assert np.mean(counts) == pytest.approx((40 / 2) ** 2, rel=0.15)


def test_pores_are_round_on_a_slanted_plane() -> None:
    """A small step changes the pattern as much along one direction of the plane as along the other."""
    layer = Pores(spacing=2, radius=0.5)
    position = np.random.default_rng(1).uniform(-50, 50, (20_000, 3))
    count = len(position)
    place = site(position, np.tile(np.array([1.0, 2.0, 2.0]) / 3, (count, 1)), np.zeros(count))
    here = evaluate(layer, place)
    changes = []
    for step in (np.array([2.0, -2.0, 1.0]) / 3, np.array([2.0, 1.0, -2.0]) / 3):
        place["position"] = position + 0.05 * step
        changes.append(np.sqrt(np.mean((evaluate(layer, place) - here) ** 2)))
    assert changes[0] > 0.01
    assert changes[0] == pytest.approx(changes[1], rel=0.1)


def test_edges_have_the_width_that_is_asked_for() -> None:
    """The area of the lines grows in proportion to their width, and their middle is 1."""
    thin, wide = (evaluate(Worley(scale=10, pattern="edges", width=w), flat(300, 60)) for w in (0.3, 0.6))
    assert thin.max() > 0.98
    assert wide.mean() / thin.mean() == pytest.approx(2, rel=0.05)


def test_patches_and_edges_of_equal_seed_meet() -> None:
    """A patch changes its value only where the lines are."""
    settings: dict[str, Any] = {"scale": 8, "width": 0.4}
    place = flat(200, 50)
    edges = evaluate(Worley(pattern="edges", **settings), place)
    patches = evaluate(Worley(pattern="patches", **settings), place).reshape(200, 200)
    change = np.abs(np.diff(patches, axis=1))
    off_the_lines = (edges.reshape(200, 200)[:, 1:] == 0) & (edges.reshape(200, 200)[:, :-1] == 0)
    assert change[off_the_lines].max() < 1e-12
    assert change.max() > 0.05


def test_the_nearest_point_is_found_in_27_cells() -> None:
    """The share of points of space whose nearest feature point lies farther out than the cells that are sought."""
    cell, fraction = hashing.split(np.random.default_rng(1).random((20_000, 3)) * 1000)
    offsets = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3), axis=-1).reshape(-1, 3)
    near, far = np.full(len(cell), np.inf), np.full(len(cell), np.inf)
    for offset in offsets:
        point = offset + hashing.hash_cell(cell + offset, 5)[:, :3] - fraction
        squared = np.sum(point**2, axis=1)
        far = np.minimum(far, squared)
        near = np.minimum(near, squared) if np.abs(offset).max() == 1 or not offset.any() else near
    assert np.mean(near != far) < 1e-4


@pytest.mark.parametrize("layer", LAYERS.values(), ids=LAYERS)
def test_each_layer_is_described(layer: type[Layer]) -> None:
    assert layer.__doc__
    for name, field in layer.model_fields.items():
        assert field.description, f"{layer.kind()}.{name} has no description"
