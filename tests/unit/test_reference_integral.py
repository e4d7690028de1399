"""The surface integral against closed forms and against plain double loops."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from skincli.bench.scene import ring
from skincli.mesh import surface
from skincli.mesh.model import Mesh, Part
from skincli.mesh.texels import atlas_texels
from skincli.optics.gaussians import GaussianSum
from skincli.reference import responses
from skincli.reference.surface_integral import Light, Samples, mesh_samples
from skincli.reference.texels import SeenTexels, diffuse_texels, samples_of

Floats = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def plane(half: float, spacing: float, normal: Floats = UP, z: float = 0.0) -> Samples:
    """Return samples of a square of the given half width about the origin."""
    line = np.arange(-half + spacing / 2, half, spacing)
    x, y = (axis.ravel() for axis in np.meshgrid(line, line))
    positions = np.stack([x, y, np.full_like(x, z)], axis=1)
    return Samples(positions, np.tile(normal, (len(x), 1)), np.full(len(x), spacing**2))


def joined(*parts: Samples) -> Samples:
    return Samples(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("positions", "normals", "areas")))


def crumpled(count: int = 3000, seed: int = 1) -> tuple[Samples, Floats]:
    """Return samples of a wavy, folded surface with uneven areas, and a signal with hard edges."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-10, 10, (2, count))
    normals = np.stack([np.cos(x), np.sin(y), 0.3 + np.cos(x * y / 9)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = np.stack([x, y, 2 * np.sin(x) * np.cos(y)], axis=1)
    signal = np.stack([x > y, rng.uniform(size=count), np.sin(x)], axis=1).astype(np.float64)
    return Samples(positions, normals, rng.uniform(0.01, 0.3, count)), signal


def ball(subdivisions: int, radius: float) -> Mesh:
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    positions = np.array(shape.vertices)
    uv = np.zeros((len(positions), 2))
    faces = np.array(shape.faces, dtype=np.int32)
    return Mesh(positions, positions / radius, uv, uv, faces, (Part("ball", 0, len(faces)),))


def exact(samples: Samples, signal: Floats, targets: Floats, normals: Floats, sigma: float, **how: float) -> Floats:
    """Return the integral over every sample by itself."""
    return Light(samples, signal).diffused(targets, normals, sigma, **{"cells_per_sigma": np.inf, **how})


# --- the integral -----------------------------------------------------------------------------------------------------


def by_hand(samples: Samples, signal: Floats, sigma: float) -> Floats:
    """Return the integral at every sample as the equation says it."""
    apart = samples.positions[:, None] - samples.positions
    pair = np.exp(-np.sum(apart**2, axis=2) / (2 * sigma**2)) * (1 + samples.normals @ samples.normals.T) / 2
    pair *= samples.areas
    return pair @ signal / pair.sum(axis=1, keepdims=True)


@pytest.mark.parametrize("sigma", [0.4, 1.5, 40.0])
def test_it_is_the_equation(sigma: float) -> None:
    samples, signal = crumpled(700)
    found = exact(samples, signal, samples.positions, samples.normals, sigma, cutoff=9)
    np.testing.assert_allclose(found, by_hand(samples, signal, sigma), rtol=0, atol=1e-12)
    cut = exact(samples, signal, samples.positions, samples.normals, sigma)
    assert np.abs(cut - found).max() <= 1e-3 * np.ptp(signal)


@pytest.mark.parametrize("sigma", [1e-6, 1.5, 20.0])
def test_constants_pass(sigma: float) -> None:
    samples, _ = crumpled()
    constant = np.full((len(samples.areas), 3), [0.3, 1.0, 7.0])
    found = Light(samples, constant).diffused(samples.positions, samples.normals, sigma)
    np.testing.assert_allclose(found, constant, rtol=1e-12)


@pytest.mark.parametrize(("sigma", "allowed"), [(0.4, 1e-12), (12.0, 2e-3), (25.0, 2e-3)])
def test_cells_stand_for_the_samples_in_them(sigma: float, allowed: float) -> None:
    texels = atlas_texels(ring(), 192, 1)
    gives = texels.areas > 0
    light = 1 + np.sin(0.2 * texels.positions) * [1.0, 0.5, 0.2]
    light[texels.positions[:, 0] > 10] *= 0.1
    samples = samples_of(texels)
    at = samples.positions[::97], samples.normals[::97]
    found = Light(samples, light[gives]).diffused(*at, sigma)
    expected = exact(samples, light[gives], *at, sigma)
    assert (allowed > 1e-9) == (np.abs(found - expected).max() > 1e-9)  # cells were in fact used
    assert np.sqrt(np.mean((found - expected) ** 2)) <= allowed * np.sqrt(np.mean(expected**2))


def test_of_a_gaussian_between_samples_the_nearest_is_left() -> None:
    samples, signal = crumpled(500)
    own = exact(samples, signal, samples.positions, samples.normals, 1e-6)
    np.testing.assert_allclose(own, signal, atol=1e-12)
    far = samples.positions[:1] + np.array([0.0, 0.0, 500.0])
    nearest = np.argmin(np.linalg.norm(samples.positions - far, axis=1))
    found = exact(samples, signal, far, samples.normals[[nearest]], 0.1)
    np.testing.assert_allclose(found, signal[[nearest]], atol=1e-12)


def test_it_is_linear_in_light_and_knows_no_unit_of_length() -> None:
    samples, signal = crumpled()
    at = samples.positions[::10], samples.normals[::10]
    both = exact(samples, np.concatenate([signal, signal @ [[2.0], [-1.0], [5.0]]], axis=1), *at, 1.5)
    np.testing.assert_allclose(both[:, 3], both[:, :3] @ [2.0, -1.0, 5.0], atol=1e-12)
    large = Samples(1000 * samples.positions + 5e4, samples.normals, 1e6 * samples.areas)
    far = exact(large, signal, 1000 * at[0] + 5e4, at[1], 1500.0)
    np.testing.assert_allclose(far, both[:, :3], atol=1e-9)


def test_a_lit_half_plane_gives_the_profiles_edge() -> None:
    samples = plane(16.0, 0.2)
    signal = np.repeat(samples.positions[:, :1] > 0, 3, axis=1).astype(np.float64)
    x = np.array([-4.0, -1.5, -0.4, 0.0, 0.3, 1.0, 2.5])
    targets = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)
    normals = np.tile(UP, (len(x), 1))
    for sigma in (0.8, 2.0):
        profile = GaussianSum((sigma**2,), ((1.0, 1.0, 1.0),))
        found = exact(samples, signal, targets, normals, sigma)
        np.testing.assert_allclose(found, profile.edge(x), atol=3e-3)


def test_a_lit_cap_of_a_ball_gives_its_closed_form() -> None:
    """With curvature as large as skin's gets: the weight and the straight distance both count."""
    radius, angle = 10.0, 25.0
    samples = mesh_samples(ball(5, radius), 0.05)
    scale = radius / np.linalg.norm(samples.positions, axis=1)
    samples = Samples(samples.positions * scale[:, None], samples.normals, samples.areas * scale**2)
    pole = np.array([[0.0, 0.0, radius]])
    signal = (samples.positions[:, 2:] >= radius * np.cos(np.radians(angle))).astype(np.float64)
    for sigma in (2.0, 4.0, 20.0):
        found = exact(samples, signal, pole, UP[None], sigma)
        assert found[0, 0] == pytest.approx(responses.cap(sigma, radius, angle), abs=2e-3)
    assert responses.cap(2.0, radius, 180.0) == 1.0


def test_opposed_sheets_do_not_leak() -> None:
    """A thin ear: two sheets 1 mm apart, back to back, one lit, one dark; and lips: face to face."""
    for turn in (1.0, -1.0):
        lit, dark = plane(8, 0.4, turn * UP, 0.5), plane(8, 0.4, -turn * UP, -0.5)
        both = joined(lit, dark)
        signal = np.concatenate([np.ones((len(lit.areas), 1)), np.zeros((len(dark.areas), 1))])
        at = joined(plane(2, 1.0, turn * UP, 0.5), plane(2, 1.0, -turn * UP, -0.5))
        values = exact(both, signal, at.positions, at.normals, 2.0)[:, 0]
        np.testing.assert_allclose(values, np.repeat([1.0, 0.0], len(at.areas) // 2), atol=1e-12)


def test_light_goes_round_a_fold_but_not_through_it() -> None:
    """Two sheets that a half cylinder joins: what is lit on one reaches the other over the fold, and fades along it."""
    fold = np.radians(np.arange(-90, 90, 5.0) + 2.5)
    y = np.arange(-8, 8, 0.2)
    normals = np.repeat(np.stack([np.cos(fold), 0 * fold, np.sin(fold)], axis=1), len(y), axis=0)
    bend = Samples(
        normals + np.tile(y, len(fold))[:, None] * [0, 1, 0], normals, np.full(len(normals), np.radians(5) * 0.2)
    )
    upper, lower = plane(8, 0.2, UP, 1.0), plane(8, 0.2, -UP, -1.0)
    left = [
        Samples(s.positions[s.positions[:, 0] < 0], s.normals[s.positions[:, 0] < 0], s.areas[s.positions[:, 0] < 0])
        for s in (upper, lower)
    ]
    samples = joined(left[0], bend, left[1])
    signal = (samples.positions[:, 2:] > 0).astype(np.float64)
    x = np.array([0.0, -1.0, -2.0, -4.0])
    targets = np.stack([x, 0 * x, -np.ones(4)], axis=1)
    found = exact(samples, signal, targets, np.tile(-UP, (4, 1)), 1.0)[:, 0]
    assert 0.02 < found[0] < 0.2
    assert (np.diff(found) < 0).all()
    assert found[-1] < 1e-4


def test_targets_that_nothing_faces_are_named() -> None:
    samples = plane(4, 0.5)
    with pytest.raises(ValueError, match="1 of 2 targets have no sample"):
        exact(samples, samples.areas[:, None], np.zeros((2, 3)), np.stack([UP, -UP]), 1.0)


# --- samples ----------------------------------------------------------------------------------------------------------


def test_samples_of_a_mesh_have_its_area_and_lie_on_it() -> None:
    mesh = ball(3, 10.0)
    samples = mesh_samples(mesh, 0.2)
    assert samples.areas.sum() == pytest.approx(surface.face_areas(mesh).sum(), rel=1e-12)
    assert samples.areas.sum() == pytest.approx(400 * np.pi, rel=6e-3)
    assert samples.areas.max() <= 0.2
    np.testing.assert_allclose(np.linalg.norm(samples.normals, axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(samples.positions / 10, samples.normals, atol=0.02)
    # Centers of equal parts integrate what is linear exactly.
    np.testing.assert_allclose(samples.areas @ samples.positions, 0, atol=1e-8)


# --- the texels of an atlas -------------------------------------------------------------------------------------------


def test_a_sum_of_gaussians_is_the_sum_of_each() -> None:
    texels = atlas_texels(ring(), 96, 1)
    receiving = (texels.areas > 0) & (np.arange(len(texels.areas)) % 31 == 0)
    signal = 1 + np.sin(0.1 * texels.positions)
    shares = ((0.25, 0.5, 1.0), (0.75, 0.5, 0.0))
    found = diffuse_texels(texels, signal, receiving, (4.0, 30.0), shares)
    samples, at = samples_of(texels), (texels.positions[receiving], texels.normals[receiving])
    light = Light(samples, signal[texels.areas > 0])
    expected = sum(np.array(share) * light.diffused(*at, v**0.5) for v, share in zip((4.0, 30.0), shares, strict=True))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_each_texel_may_scale_the_gaussians() -> None:
    texels = atlas_texels(ring(), 48, 1)
    gives = texels.areas > 0
    receiving = gives & (np.arange(len(gives)) % 13 == 0)
    signal = 1 + np.sin(0.1 * texels.positions)
    variances, shares = (4.0, 30.0), ((0.25, 0.5, 1.0), (0.75, 0.5, 0.0))
    ratio = np.random.default_rng(3).uniform(0.2, 4, (int(receiving.sum()), 3))
    ratio[0] = 0.0
    found = diffuse_texels(texels, signal, receiving, variances, shares, ratio)
    # By hand, with no cutoff and no cells.
    samples, normals = samples_of(texels), texels.normals[receiving]
    away = np.linalg.norm(texels.positions[receiving][:, None] - samples.positions, axis=2)
    facing = (1 + normals @ samples.normals.T) / 2 * samples.areas
    expected = np.zeros_like(found)
    for channel, row in enumerate(ratio.T):
        for variance, share in zip(variances, shares, strict=True):
            width = np.maximum(row, 1e-6)[:, None]
            pair = np.exp(-(away**2) / (2 * variance * width**2)) * facing
            expected[:, channel] += share[channel] * (pair @ signal[gives][:, channel]) / pair.sum(axis=1)
    np.testing.assert_allclose(found[0], signal[receiving][0], rtol=1e-12)
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    place = np.stack([texels.index % 48, texels.index // 48], axis=1)[receiving][::29]
    seen = SeenTexels((place + 0.5) / 48, 48)(texels, signal, receiving, variances, shares, ratio)
    lit = seen.any(axis=1)
    assert len(place) <= lit.sum() < len(lit) / 2
    np.testing.assert_allclose(seen[lit], found[lit], rtol=1e-4)
    # A ratio that is the same everywhere is another Gaussian, here one wide enough for cells.
    wide = diffuse_texels(texels, signal, receiving, (30.0,), (shares[1],), np.full_like(ratio, 4.0))
    same = diffuse_texels(texels, signal, receiving, (30.0 * 16,), (shares[1],))
    np.testing.assert_allclose(wide, same, rtol=2e-3)


def test_only_texels_that_pixels_read_are_computed() -> None:
    texels = atlas_texels(ring(), 64, 1)
    receiving = texels.areas > 0
    at = np.stack([texels.index % 64, texels.index // 64], axis=1)[receiving][100:101]
    seen = SeenTexels((at + 0.5) / 64, 64)
    found = seen(texels, np.ones((len(receiving), 3)), receiving, (4.0,), ((0.25, 0.5, 1.0),))
    lit = np.flatnonzero(found.any(axis=1))
    assert 100 in lit
    assert len(lit) <= 4
    assert found[100] == pytest.approx([0.25, 0.5, 1.0])
