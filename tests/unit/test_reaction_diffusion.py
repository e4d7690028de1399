"""Laws of the reaction-diffusion patterns: each has the statistics that its name promises. No OpenGL."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from typing import Any, get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from skincli.layers.base import Ground, Site
from skincli.layers.hashing import hash_cell
from skincli.layers.reaction_diffusion import WAVES, Name, ReactionDiffusion, Tile, integrals, simulate
from tests.layers_kit import assert_resolution_law, assert_tileable, evaluate, flat

Array = NDArray[Any]

NAMES = get_args(Name)
SEEDS = (0, 1, 2)
#: Spots and holes stand in rows a wavelength apart, 2 / sqrt(3) wavelengths from each other along a row.
ISLANDS = WAVES**2 * np.sqrt(3) / 2


def field(pattern: Name, seed: int = 0) -> Array:
    return Tile(True, pattern, WAVES, seed, (0.0, 1.0)).field()


def components(mask: Array) -> tuple[float, float]:
    """Return the number of components in a tile, and the largest one's share of the mask, of 2 x 2 tiles."""
    labels, count = ndimage.label(np.tile(mask, (2, 2)))
    return count / 4, np.bincount(labels.ravel())[1:].max() / (4 * mask.sum())


def spectrum(t: Array) -> tuple[Array, Array, Array]:
    """Return the energy of a square that repeats, and the waves per square along x and y."""
    k = np.fft.fftfreq(len(t), 1 / len(t))
    return np.abs(np.fft.fft2(t - t.mean())) ** 2, k[None, :], k[:, None]


def waves_of(t: Array) -> float:
    """Return waves per square: the mean over the highest peak of the radially summed spectrum."""
    energy, kx, ky = spectrum(t)
    radial = np.bincount(np.rint(np.hypot(kx, ky)).astype(int).ravel(), energy.ravel())
    highest = int(radial.argmax())
    peak = np.arange(max(highest - 4, 1), highest + 5)
    return float(np.average(peak, weights=radial[peak]))


def alignment(t: Array) -> float:
    """Return 1 where waves follow one another along y, -1 along x, 0 where all directions are alike."""
    energy, kx, ky = spectrum(t)
    return float(np.sum(energy * (ky**2 - kx**2)) / np.sum(energy * (ky**2 + kx**2)))


@pytest.mark.parametrize("pattern", NAMES)
def test_the_wavelength_is_the_scale(pattern: Name) -> None:
    """In mm, as the layer lays it on a flat map."""
    layer = ReactionDiffusion(pattern=pattern, scale=2.5)
    t = evaluate(layer, flat(160, 40.0)).reshape(160, 160)
    assert 40.0 / waves_of(t) == pytest.approx(2.5, rel=0.05)


@pytest.mark.parametrize("seed", SEEDS)
def test_spots_are_many_round_islands(seed: int) -> None:
    t = field("spots", seed)
    mask = t > 0.5
    count, largest = components(mask)
    assert count == pytest.approx(ISLANDS, rel=0.15)
    assert largest < 0.02
    assert mask.mean() == pytest.approx(0.26, abs=0.04)
    assert components(~mask)[1] > 0.999
    assert abs(alignment(t)) < 0.15


@pytest.mark.parametrize("seed", SEEDS)
def test_a_net_has_many_holes_in_one_piece(seed: int) -> None:
    t = field("net", seed)
    mask = t > 0.5
    assert components(mask)[1] > 0.999
    count, largest = components(~mask)
    assert count == pytest.approx(ISLANDS, rel=0.15)
    assert largest < 0.02
    assert mask.mean() == pytest.approx(0.63, abs=0.04)
    assert abs(alignment(t)) < 0.15


@pytest.mark.parametrize("seed", SEEDS)
def test_stripes_are_long_and_follow_one_another_along_one_axis(seed: int) -> None:
    t = field("stripes", seed)
    assert alignment(t) > 0.9
    assert components(t > 0.5)[0] < 1.5 * WAVES
    assert np.mean(t > 0.5) == pytest.approx(0.5, abs=0.02)
    # Forks: no crystal of equal lines.
    crossings = np.sum(np.diff((t > 0.5).astype(int), axis=0) == 1, axis=0)
    assert np.ptp(crossings) >= 1


@pytest.mark.parametrize("seed", SEEDS)
def test_a_labyrinth_is_long_and_has_no_direction(seed: int) -> None:
    t = field("labyrinth", seed)
    assert abs(alignment(t)) < 0.25
    for mask in (t > 0.5, t < 0.5):
        count, largest = components(mask)
        assert count < 0.25 * ISLANDS
        assert largest > 0.05
        assert mask.mean() == pytest.approx(0.5, abs=0.02)


def test_spots_are_no_crystal() -> None:
    """Nearest neighbors stand at different distances, yet never touch."""
    labels, count = ndimage.label(field("spots") > 0.5)
    centers = np.array(ndimage.center_of_mass(labels > 0, labels, np.arange(1, count + 1))) * WAVES / len(labels)
    apart = np.hypot(*(centers[:, None] - centers[None]).T) + 99 * np.eye(count)
    inside = np.all((centers > 1) & (centers < WAVES - 1), axis=1)
    nearest = apart.min(axis=0)[inside]
    assert nearest.mean() == pytest.approx(1.0, abs=0.15)
    assert 0.04 < nearest.std() / nearest.mean() < 0.2


@pytest.mark.parametrize("pattern", NAMES)
def test_patterns_fill_0_to_1(pattern: Name) -> None:
    t = evaluate(ReactionDiffusion(pattern=pattern), flat(128, 80))
    assert 0 <= t.min() < 0.02
    assert 0.98 < t.max() <= 1


@pytest.mark.parametrize("pattern", NAMES)
def test_a_tile_repeats_without_a_line(pattern: Name) -> None:
    t = field(pattern)
    for axis in (0, 1):
        steps = np.abs(np.diff(t, axis=axis, append=np.take(t, [0], axis)))
        assert np.take(steps, -1, axis).max() <= np.take(steps, range(len(t) - 1), axis).max()
        assert np.take(steps, -1, axis).mean() < 1.5 * steps.mean() + 1e-3


@pytest.mark.parametrize("pattern", NAMES)
def test_a_tileable_map_wraps(pattern: Name) -> None:
    assert_tileable(ReactionDiffusion(pattern=pattern, scale=4))


@pytest.mark.parametrize("period", [1.0, 9.0, 41.0, 100.0, 333.0])
def test_whole_features_fit_a_period(period: float) -> None:
    layer, ground = ReactionDiffusion(scale=2), Ground(period=period)
    side: Any = layer.values(ground)["side"]
    waves = layer.textures(ground)[0].waves
    assert period / side == pytest.approx(round(period / side))
    assert waves >= 1
    if period > 20 * layer.scale:
        assert side / waves == pytest.approx(layer.scale, rel=0.05)


@pytest.mark.parametrize("pattern", NAMES)
@pytest.mark.parametrize("levels", [(0.0, 1.0), (0.5, 0.5)])
def test_a_map_is_the_mean_of_a_finer_one(pattern: Name, levels: tuple[float, float]) -> None:
    """A fifth of what is allowed, where the edges are soft: what is laid is the mean over a texel."""
    share = 0.2 if levels == (0.0, 1.0) else 1.0
    assert_resolution_law(
        ReactionDiffusion(pattern=pattern, levels=levels),
        0.01 * share,
        0.05 * share,
        [32, 16, 4, 2, 1, 0.3],
    )


def test_what_is_laid_is_the_mean_over_a_square() -> None:
    """Of waves, whose means are known; a square of no size is two texels of the tile wide, which smooths it."""
    waves = [(0, 0, 0.4, 0.0), (3, 0, 0.2, 0.3), (0, 2, 0.1, 1.0), (4, -1, 0.1, 2.0)]

    def means(u: Array, v: Array, size: float) -> Array:
        each = [
            a * np.sinc(i * size) * np.sinc(j * size) * np.cos(2 * np.pi * (i * u + j * v) + p) for i, j, a, p in waves
        ]
        return np.sum(each, axis=0)

    side = 128
    v, u = np.mgrid[0:side, 0:side] / side
    tile = integrals(means(u, v, 0.0))[::-1]
    values: dict[str, Any] = {**ReactionDiffusion().values(Ground()), "side": 10.0}
    # Where the tile lies in the plane seen along z.
    shift = np.floor(side * hash_cell(np.array([[2, 0, 0]]), values["seed"])[0, :2]) / side
    site = flat(16, 30.0)
    u, v = site["position"][:, :2].T / 10 + shift[:, None]
    for width in (0.1, 1.0, 4.0, 17.0):
        site["footprint"] = np.full(256, width)
        found = ReactionDiffusion.twin(values, site, [tile.astype(np.float64)])
        np.testing.assert_allclose(found, means(u, v, np.hypot(width / 10, 2 / side)), atol=5e-5)


@pytest.mark.parametrize(("axis", "expected"), [("x", -1), ("y", 1)])
def test_the_axis_turns_stripes(axis: Any, expected: int) -> None:
    layer = ReactionDiffusion(pattern="stripes", scale=2, axis=axis)
    assert alignment(evaluate(layer, flat(128, 32)).reshape(128, 128)) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_stripes_follow_one_another_along_the_axis_on_every_side(axis: Any) -> None:
    """On the faces of a cube that contain the axis, a step along it changes the pattern, a step across hardly."""
    layer = ReactionDiffusion(pattern="stripes", scale=4, axis=axis)
    start = np.random.default_rng(3).uniform(-40, 40, (2000, 3))
    along = "xyz".index(axis)
    for facing in {0, 1, 2} - {along}:
        across = 3 - along - facing
        normal = np.tile(np.eye(3)[facing], (len(start), 1))
        site = {**flat(1, 1), "normal": normal, "footprint": np.zeros(len(start))}
        here, up, aside = (
            evaluate(layer, Site(**{**site, "position": start + step}))  # type: ignore[typeddict-item]
            for step in (np.zeros(3), 0.5 * np.eye(3)[along], 0.5 * np.eye(3)[across])
        )
        assert np.std(up - here) > 3 * np.std(aside - here)


def test_between_the_planes_the_pattern_keeps_its_contrast() -> None:
    layer = ReactionDiffusion(pattern="labyrinth", scale=4)
    position = np.random.default_rng(3).uniform(-100, 100, (4000, 3))
    deviations = []
    for direction in ([0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0]):
        normal = np.tile(np.array(direction) / np.linalg.norm(direction), (len(position), 1))
        site = {**flat(1, 1), "position": position, "normal": normal, "footprint": np.zeros(len(position))}
        deviations.append(evaluate(layer, Site(**site)).std())  # type: ignore[typeddict-item]
    # A little is lost where what is strong in both planes is cut off at 0 and 1; a plain mixture would lose 42 %.
    np.testing.assert_allclose(deviations, deviations[0], rtol=0.2)


def test_a_turning_surface_has_no_step() -> None:
    """Neither where planes come in nor where one takes over from another."""
    angle = np.linspace(0, np.pi, 4001)
    normal = np.column_stack([np.cos(angle), np.sin(angle) * 0.8, np.sin(angle) * 0.6])
    site = {**flat(1, 1), "position": 50 * normal, "normal": normal, "footprint": np.zeros(len(angle))}
    t = evaluate(ReactionDiffusion(pattern="labyrinth", scale=10), Site(**site))  # type: ignore[typeddict-item]
    assert np.abs(np.diff(t)).max() < 0.03
    assert np.ptp(t) > 0.9


def test_seeds_give_different_patterns() -> None:
    site = flat(64, 60)
    layers = {seed: ReactionDiffusion(pattern="labyrinth", scale=4, seed=seed) for seed in (3, 4, 7)}
    one, other = (evaluate(layers[seed], site) for seed in (3, 4))
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.15
    # The skin's seed is added to the layer's.
    assert layers[3].values(Ground(4)) == layers[7].values(Ground())
    assert layers[3].textures(Ground(4)) == layers[7].textures(Ground())


def test_another_process_makes_the_same_pattern() -> None:
    code = (
        "import hashlib; from skincli.layers.reaction_diffusion import simulate;"
        "print(hashlib.sha256(simulate('spots', 16, 3).round(9).tobytes()).hexdigest())"
    )
    threads = {"OMP_NUM_THREADS": "3", "OPENBLAS_NUM_THREADS": "3"}
    found = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **threads}, capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == hashlib.sha256(simulate("spots", 16, 3).round(9).tobytes()).hexdigest()


def test_a_kept_tile_is_the_one_that_was_made() -> None:
    from skincli.layers import reaction_diffusion

    first = field("net", 5)
    reaction_diffusion._activator.cache_clear()
    assert np.array_equal(field("net", 5), first)
