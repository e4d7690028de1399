"""Profiles on the Gaussians that are rendered: light and second moment are kept, edges nearly."""

from __future__ import annotations

import numpy as np
import pytest

from skincli.optics.gaussians import HUMAN, GaussianSum, fit
from skincli.optics.levels import MAX_SPREAD, SPREAD_STEPS, edge_error, levels, sampled, spread_weights
from skincli.optics.profiles import from_color

SKIN = fit(from_color((0.799, 0.485, 0.347), (0.482, 0.169, 0.109), "mfp"), 4)
BLACK = GaussianSum((1.0,), ((0.5, 0.0, 0.2),))


@pytest.mark.parametrize("profile", [SKIN, HUMAN, BLACK, GaussianSum((), ())])
@pytest.mark.parametrize("steps", [1, SPREAD_STEPS])
@pytest.mark.parametrize("widths", [(), (0.75,), (0.3, 0.75, 1.5, 6.0)])
def test_light_is_kept(profile: GaussianSum, steps: int, widths: tuple[float, ...]) -> None:
    weights = spread_weights(profile, widths, 0.1, steps)
    assert weights.shape == (len(widths) + 1, steps, 3)
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-12)


def test_the_second_moment_follows_the_radius() -> None:
    widths = levels([SKIN], 0.3, True, 0.2)
    weights = spread_weights(SKIN, widths, 0.1)
    found = np.square([0.0, *widths]) @ weights.transpose(1, 0, 2)
    ratios = np.linspace(0, MAX_SPREAD**2, SPREAD_STEPS)
    shares = np.array(SKIN.weights) / SKIN.total()
    wanted = [sampled(np.array(SKIN.variances) * ratio, 0.2) @ shares for ratio in ratios]
    np.testing.assert_allclose(found, wanted, rtol=5e-3, atol=5e-4)


@pytest.mark.parametrize("width", [0.05, 0.3, 0.45, 0.7, 1.2, 1.5, 4.0])
def test_sampled_gaussians_keep_the_variance_of_their_sum(width: float) -> None:
    step = 0.4
    at = np.arange(-60, 61)
    kernel = np.exp(-(at**2) / (2 * width**2))
    found = sampled(np.array([(width * step) ** 2]), step)
    np.testing.assert_allclose(found, (kernel * (step * at) ** 2).sum() / kernel.sum(), rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize(("narrowest", "nearest", "bound"), [(0.02, 0.01, 0.05), (0.4, 0.13, 0.05), (0.75, 0.26, 0.05)])
def test_levels_are_near_the_profile(narrowest: float, nearest: float, bound: float) -> None:
    widths = levels([SKIN], narrowest, False, 2 * nearest)
    assert min(widths) >= narrowest
    assert edge_error(SKIN, widths, nearest) < bound


def test_levels_of_many_skins_are_few() -> None:
    skins = [fit(from_color((0.8, 0.5, 0.3), (0.1 * k, 0.07 * k, 0.03 * k), "mfp"), 4) for k in range(1, 20)]
    widths = levels(skins, 0.3, True, 0.2)
    assert len(widths) <= 12
    assert widths[-1] == pytest.approx(MAX_SPREAD * max(np.sqrt(one.variances[-1]) for one in skins))
