"""The surface integral against closed forms, against plain double loops and against its own bounds."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from skincli.mesh import surface
from skincli.mesh.model import Mesh, Part
from skincli.optics.gaussians import HUMAN, GaussianSum
from skincli.reference import responses
from skincli.reference import surface_integral as integral
from skincli.reference.surface_integral import Samples

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


def sheet(n: int = 6) -> Mesh:
    """Return a curved patch whose atlas fills a part of the square, with a face mirrored in UV."""
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [np.stack([first, first + 1, first + n + 2], 1), np.stack([first, first + n + 2, first + n + 1], 1)]
    ).astype(np.int32)
    positions = np.stack([100 * u, 80 * v, 30 * np.cos(2 * (u - 0.4)) + 20 * np.sin(v)], axis=1)
    uv = np.stack([0.9 - 0.8 * u, 0.1 + 0.8 * (v + 0.1 * u * v) / 1.1], axis=1)
    normals = surface.angle_weighted_normals(positions, faces)
    return Mesh(positions, normals, uv, uv, faces, (Part("sheet", 0, len(faces)),))


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
    found = integral.exact(samples, signal, samples.positions, samples.normals, sigma, cutoff=9)
    np.testing.assert_allclose(found.values, by_hand(samples, signal, sigma), rtol=0, atol=1e-12)
    cut = integral.exact(samples, signal, samples.positions, samples.normals, sigma)
    assert (np.abs(cut.values - found.values).max(axis=1) <= cut.bound * np.ptp(signal)).all()


@pytest.mark.parametrize("tolerance", [0.0, 1e-3, 0.1])
def test_constants_pass(tolerance: float) -> None:
    samples, _ = crumpled()
    constant = np.full((len(samples.areas), 3), [0.3, 1.0, 7.0])
    found = integral.hierarchical(samples, constant, samples.positions, samples.normals, 1.5, tolerance=tolerance)
    np.testing.assert_allclose(found.values, constant, rtol=1e-12)


def test_it_is_linear_in_light_and_knows_no_unit_of_length() -> None:
    samples, signal = crumpled()
    at = samples.positions[::10], samples.normals[::10]
    both = integral.exact(samples, np.concatenate([signal, signal @ [[2.0], [-1.0], [5.0]]], axis=1), *at, 1.5).values
    np.testing.assert_allclose(both[:, 3], both[:, :3] @ [2.0, -1.0, 5.0], atol=1e-12)
    large = Samples(1000 * samples.positions + 5e4, samples.normals, 1e6 * samples.areas)
    far = integral.exact(large, signal, 1000 * at[0] + 5e4, at[1], 1500.0)
    np.testing.assert_allclose(far.values, both[:, :3], atol=1e-9)


def test_a_lit_half_plane_gives_the_profiles_edge() -> None:
    samples = plane(16.0, 0.2)
    signal = np.repeat(samples.positions[:, :1] > 0, 3, axis=1).astype(np.float64)
    x = np.array([-4.0, -1.5, -0.4, 0.0, 0.3, 1.0, 2.5])
    targets = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)
    normals = np.tile(UP, (len(x), 1))
    for sigma in (0.8, 2.0):
        profile = GaussianSum((sigma**2,), ((1.0, 1.0, 1.0),))
        found = integral.exact(samples, signal, targets, normals, sigma)
        np.testing.assert_allclose(found.values, profile.edge(x), atol=3e-3)
        np.testing.assert_allclose(found.denominator, 2 * np.pi * sigma**2, rtol=1e-6)
    wide = GaussianSum(HUMAN.variances[3:], HUMAN.weights[3:])
    together = integral.diffuse(samples, signal, targets, normals, wide.variances, wide.weights)
    np.testing.assert_allclose(together, wide.edge(x), atol=3e-3)


def test_a_lit_cap_of_a_ball_gives_its_closed_form() -> None:
    """With curvature as large as skin's gets: the weight and the straight distance both count."""
    radius, angle = 10.0, 25.0
    samples = integral.mesh_samples(ball(5, radius), 0.4)
    scale = radius / np.linalg.norm(samples.positions, axis=1)
    samples = Samples(samples.positions * scale[:, None], samples.normals, samples.areas * scale**2)
    pole = np.array([[0.0, 0.0, radius]])
    signal = (samples.positions[:, 2:] >= radius * np.cos(np.radians(angle))).astype(np.float64)
    for sigma in (2.0, 4.0, 20.0):
        found = integral.exact(samples, signal, pole, UP[None], sigma)
        assert found.values[0, 0] == pytest.approx(responses.cap(sigma, radius, angle), abs=2e-3)
        without = integral.exact(samples, signal, pole, UP[None], sigma, weight="uniform")
        assert without.values[0, 0] < found.values[0, 0]
    assert responses.cap(2.0, radius, 180.0) == 1.0


def test_opposed_sheets_do_not_leak() -> None:
    """A thin ear: two sheets 1 mm apart, back to back, one lit, one dark; and lips: face to face."""
    for turn in (1.0, -1.0):
        lit, dark = plane(8, 0.4, turn * UP, 0.5), plane(8, 0.4, -turn * UP, -0.5)
        both = joined(lit, dark)
        signal = np.concatenate([np.ones((len(lit.areas), 1)), np.zeros((len(dark.areas), 1))])
        at = joined(plane(2, 1.0, turn * UP, 0.5), plane(2, 1.0, -turn * UP, -0.5))
        values = integral.exact(both, signal, at.positions, at.normals, 2.0).values[:, 0]
        np.testing.assert_allclose(values, np.repeat([1.0, 0.0], len(at.areas) // 2), atol=1e-12)
        leaked = integral.exact(both, signal, at.positions, at.normals, 2.0, weight="uniform").values[:, 0]
        assert leaked[-1] > 0.4


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
    found = integral.exact(samples, signal, targets, np.tile(-UP, (4, 1)), 1.0).values[:, 0]
    assert 0.02 < found[0] < 0.2
    assert (np.diff(found) < 0).all()
    assert found[-1] < 1e-4


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2, 0.1])
def test_clusters_stay_within_their_bound(tolerance: float) -> None:
    samples, signal = crumpled(20000)
    at = samples.positions[::40], samples.normals[::40]
    for sigma in (1.0, 5.0):
        truth = integral.exact(samples, signal, *at, sigma, cutoff=9)
        found = integral.hierarchical(samples, signal, *at, sigma, tolerance=tolerance)
        error = np.abs(found.values - truth.values).max(axis=1)
        assert (error <= (found.bound + truth.bound) * np.ptp(signal)).all()
        assert error.max() > 1e-12  # clusters were in fact used
        if tolerance == 1e-3:
            assert np.median(found.bound) < 0.02
            assert error.max() < 1e-3


def test_targets_that_nothing_faces_are_named() -> None:
    samples = plane(4, 0.5)
    with pytest.raises(ValueError, match="1 of 2 targets have no sample"):
        integral.exact(samples, samples.areas[:, None], np.zeros((2, 3)), np.stack([UP, -UP]), 1.0)


def test_drift_of_energy_is_told() -> None:
    """A normalized sum keeps the light of a plane's middle, but not that of its border."""
    samples = plane(10, 0.5)
    for center, least, most in ((0.0, 0.0, 1e-4), (9.5, 0.02, 0.5)):
        signal = np.exp(-np.sum((samples.positions[:, :2] - [center, 0]) ** 2, axis=1) / 2)[:, None]
        found = integral.exact(samples, signal, samples.positions, samples.normals, 1.5)
        drift = integral.energy_drift(samples, signal, found.values)
        assert drift.shape == (1,)
        assert least < abs(drift[0]) < most
    np.testing.assert_allclose(integral.energy_drift(samples, signal, 1.25 * signal), 0.25)


# --- samples ----------------------------------------------------------------------------------------------------------


def test_samples_of_a_mesh_have_its_area_and_lie_on_it() -> None:
    mesh = ball(3, 10.0)
    samples = integral.mesh_samples(mesh, 0.7)
    assert samples.areas.sum() == pytest.approx(surface.face_areas(mesh).sum(), rel=1e-12)
    assert samples.areas.sum() == pytest.approx(400 * np.pi, rel=6e-3)
    assert samples.areas.max() < 0.7**2 / 2
    np.testing.assert_allclose(np.linalg.norm(samples.normals, axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(samples.positions / 10, samples.normals, atol=0.02)
    # Centers of equal parts integrate what is linear exactly.
    np.testing.assert_allclose(samples.areas @ samples.positions, 0, atol=1e-8)


def test_samples_of_an_atlas_sum_to_the_meshs_area_and_know_their_texels() -> None:
    mesh = sheet()
    area = surface.face_areas(mesh).sum()
    for size, most in ((64, 3e-2), (512, 4e-3)):  # a border of half a texel
        samples, texels = integral.atlas_samples(mesh, size)
        assert samples.areas.sum() == pytest.approx(area, rel=most)
        covered = surface.coverage(mesh.atlas_uv, mesh.faces, size)
        np.testing.assert_array_equal(np.argwhere(covered > 0), texels)
        # The atlas is linear in u by construction: x = 100 u, with uv's u = 0.9 - 0.8 u.
        u = (texels[:, 1] + 0.5) / size
        np.testing.assert_allclose(samples.positions[:, 0], 100 * (0.9 - u) / 0.8, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(samples.normals, axis=1), 1, rtol=1e-12)


def test_a_texel_belongs_to_the_first_of_overlapping_faces() -> None:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5], [1, 0, 5], [0, 1, 5]])
    uv = np.tile([[0.0, 0], [1, 0], [0, 1]], (2, 1))
    faces = np.array([[3, 4, 5], [0, 1, 2]], dtype=np.int32)
    mesh = Mesh(positions, np.tile(UP, (6, 1)), uv, uv, faces, (Part("two", 0, 2),))
    samples, texels = integral.atlas_samples(mesh, 8)
    assert len(np.unique(texels, axis=0)) == len(texels)
    np.testing.assert_array_equal(samples.positions[:, 2], 5)
