"""Light averaged over texels: exact where it is smooth, looked at closely where it has an edge, and only there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from skincli.passes.irradiance import DIRECTIONAL, POINT, LightValues, averaged, light_twin

Floats = NDArray[np.float64]

#: places along a texel's side
SAMPLES = 4


class Lit:
    """A light as `averaged` asks for it, which counts the places where it was asked for."""

    def __init__(self, arriving: Callable[[Floats], Floats] | LightValues) -> None:
        self._arriving, self.asked = arriving, 0

    def __call__(self, P: Floats, N: Floats) -> tuple[Floats, Floats]:
        self.asked += len(P)
        if isinstance(self._arriving, LightValues):
            L, arriving = light_twin(self._arriving, P)
            return arriving, np.maximum(np.sum(N * L, axis=1, keepdims=True), 0) * arriving
        arriving = self._arriving(P)
        return arriving, arriving


def plane(size: int = 24) -> tuple[NDArray[np.int64], int, Floats, Floats]:
    """Return a square of texels, each 1 mm wide, with one more column and row beside it that hold nothing."""
    row, column = (axis.ravel() for axis in np.mgrid[0:size, 0:size])
    position = np.stack([column + 0.5, row + 0.5, 0.0 * row], axis=1)
    return row * (size + 1) + column, size + 1, position, np.broadcast_to([0.0, 0.0, 1.0], position.shape)


def sphere(bumps: float = 0.0, size: int = 128) -> tuple[NDArray[np.int64], int, Floats, Floats]:
    """Return texels on half a sphere of 50 mm, its normals bent at random by so much."""
    v, u = (np.pi * (axis.ravel() + 0.5) / size for axis in np.mgrid[0:size, 0:size])
    normal = np.stack([np.sin(v) * np.cos(u), np.cos(v), np.sin(v) * np.sin(u)], axis=1)
    bent = normal + bumps * np.random.default_rng(3).standard_normal(normal.shape)
    return np.arange(size**2), size, 50 * normal, bent / np.linalg.norm(bent, axis=1, keepdims=True)


def edge(angle: float, distance: float, width: float = 0.0) -> Callable[[Floats], Floats]:
    """Return light on one side of a line; it begins within so many mm."""

    def arriving(P: Floats) -> Floats:
        across = P[:, :1] * np.cos(angle) + P[:, 1:2] * np.sin(angle) - distance
        return (across > 0).astype(float) if width == 0 else np.clip(across / width + 0.5, 0, 1)

    return arriving


def test_constant_light_stays_what_it_is() -> None:
    mean = averaged(Lit(lambda P: np.full((len(P), 3), 0.7)), *plane(), SAMPLES)
    np.testing.assert_allclose(mean, 0.7, rtol=1e-14)


def test_light_that_bends_as_a_parabola_is_averaged_exactly() -> None:
    lit = Lit(lambda P: 9000 + P[:, :1] ** 2 - 3 * P[:, 1:2] ** 2 + P[:, :1] * P[:, 1:2])
    texels = plane()
    x, y = texels[2][:, :2].T
    expected = 9000 + (x**2 + 1 / 12) - 3 * (y**2 + 1 / 12) + x * y
    np.testing.assert_allclose(averaged(lit, *texels, SAMPLES)[:, 0], expected, rtol=1e-12)
    assert lit.asked == 5 * len(x)


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.8, np.pi / 2, 2.0, 4.0])
@pytest.mark.parametrize("distance", [-7.3, 3.14, 8.0, 11.2])
def test_an_edge_gives_each_texel_its_coverage(angle: float, distance: float) -> None:
    texels = plane()
    places = (np.arange(64) + 0.5) / 64 - 0.5
    moves = np.stack([*np.meshgrid(places, places), np.zeros((64, 64))], axis=-1).reshape(-1, 3)
    light = edge(angle, distance)
    covered = np.mean([light(texels[2] + move)[:, 0] for move in moves], axis=0)
    lit = Lit(light)
    apart = averaged(lit, *texels, SAMPLES)[:, 0] - covered
    assert np.abs(apart).max() <= 1 / (2 * SAMPLES) + 1e-9
    # Texels that it does not cross cost five places; all that it crosses are looked at closely.
    crossed = np.count_nonzero((covered > 0.001) & (covered < 0.999))
    closely = (lit.asked - 5 * len(covered)) / SAMPLES**2
    assert crossed <= closely <= crossed + 2 * 24


@pytest.mark.parametrize("scale", [-1.0, 1e-6, 1e6])
def test_averaging_is_linear_in_the_light(scale: float) -> None:
    light = edge(0.3, 9.0, width=2.5)
    one, other = Lit(light), Lit(lambda P: scale * light(P))
    expected, found = averaged(one, *plane(), SAMPLES), averaged(other, *plane(), SAMPLES)
    np.testing.assert_allclose(found, scale * expected, rtol=1e-9)
    assert one.asked == other.asked > 5 * len(expected)


def test_each_channel_has_its_own_edge() -> None:
    lights = edge(0.2, 6.0), edge(1.1, 15.0), lambda P: P[:, :1]
    texels = plane()
    together = averaged(Lit(lambda P: np.concatenate([light(P) for light in lights], axis=1)), *texels, SAMPLES)
    alone = np.concatenate([averaged(Lit(light), *texels, SAMPLES) for light in lights], axis=1)
    np.testing.assert_array_equal(together, alone)


@pytest.mark.parametrize("bumps", [0.0, 0.3])
@pytest.mark.parametrize(
    "light",
    [
        LightValues((1.0, 0.9, 0.8), DIRECTIONAL, direction=(-0.6, 0.0, -0.8)),
        LightValues((1.0, 0.9, 0.8), POINT, position=(90.0, 30.0, 20.0)),
    ],
    ids=["directional", "point"],
)
def test_shade_is_no_edge(light: LightValues, bumps: float) -> None:
    """Neither where a surface turns away from the light, nor where bumps do, is it looked at closely."""
    lit, texels = Lit(light), sphere(bumps)
    mean = averaged(lit, *texels, SAMPLES)
    assert (mean == 0).any()
    assert (mean > 0).any()
    assert lit.asked == 5 * len(mean)


def test_a_light_changes_smoothly_into_an_edge() -> None:
    """Between light that is looked at closely and light that is not there is no step."""
    widths = np.linspace(0.5, 8, 600)
    means = np.array([averaged(Lit(edge(0.4, 9.3, width)), *plane(12), SAMPLES)[:, 0] for width in widths])
    assert np.abs(np.diff(means, axis=0)).max() < 0.02


def test_one_place_is_the_center() -> None:
    texels = plane()
    light = edge(0.3, 9.0)
    np.testing.assert_array_equal(averaged(Lit(light), *texels, 1), light(texels[2]))


def test_texels_side_by_side_need_not_be_neighbors() -> None:
    """Neither across a gap between charts nor from one end of a row to the other is a change taken."""
    index, width = np.array([0, 1, 2, 3]), 4
    position = np.array([[0.0, 0, 0], [1, 0, 0], [101, 0, 0], [102, 0, 0]])
    normal = np.broadcast_to([0.0, 0.0, 1.0], position.shape)
    lit = Lit(lambda P: 1e5 + P[:, :1] ** 2)
    mean = averaged(lit, index, width, position, normal, SAMPLES)
    np.testing.assert_allclose(mean[:, 0], 1e5 + position[:, 0] ** 2 + 1 / 12, rtol=1e-12)
    ends = np.array([3, 4]), 4, position[[0, 2]], normal[:2]
    np.testing.assert_allclose(averaged(lit, *ends, SAMPLES)[:, 0], 1e5 + ends[2][:, 0] ** 2, rtol=1e-12)


@pytest.mark.parametrize("width", [1, 2, 3])
def test_the_end_of_a_row_is_not_beside_the_next(width: int) -> None:
    """The second row begins in space where the first one ends; texels are as wide as their own row says."""
    row, column = (axis.ravel() for axis in np.mgrid[0:2, 0:width])
    along = 10.0 * (width - 1) + 0.5
    position = np.stack([10.0 * column + along * row, 0.0 * row, 0.0 * row], axis=1)
    normal = np.broadcast_to([0.0, 0.0, 1.0], position.shape)
    lit = Lit(lambda P: 1e5 + P[:, :1] ** 2)
    mean = averaged(lit, np.arange(2 * width), width, position, normal, SAMPLES)
    wide = 10.0 if width > 1 else 0.0
    np.testing.assert_allclose(mean[:, 0], 1e5 + position[:, 0] ** 2 + (wide**2 + along**2) / 12, rtol=1e-9)
