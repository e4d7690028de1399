"""Diffusion profiles on the Gaussians that a renderer has: which widths, and how much of each at a radius."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls
from scipy.special import ndtr

from skincli.optics.gaussians import Floats, GaussianSum

MAX_SPREAD = 4.0
"""Scattering radii are told apart up to this many times that of the optics; wider ones are this wide."""

SPREAD_STEPS = 65
"""Columns of `spread_weights`, spaced evenly in the squared ratio of radii."""

MERGED = 1.1
"""Standard deviations within this factor of each other share a level."""

MAX_LEVELS = 12
"""Beyond this many levels, more are merged."""

TOLERATED = 0.05
"""Terms narrower than any level stay where they are if no more of the narrowest would stand for their variance."""

NEIGHBORS = 8
"""Samples on each side over which a narrow Gaussian is summed; wider ones keep their variance to more than 1e-7."""

POINTS, SUM_ROW, MOMENT_ROW = 96, 1e4, 1e2
"""Distances at which edge responses are compared; how much heavier the sum and the second moment count."""


def sampled(variances: Floats, step: float) -> Floats:
    """Return the variances that Gaussians have when they are summed over samples, mm².

    One far narrower than their distance stays at its own sample.

    Parameters
    ----------
    variances : any shape, mm², >= 0
    step : mm, > 0, from sample to sample
    """
    ratio = np.asarray(variances, dtype=np.float64) / step**2
    k = np.arange(1, NEIGHBORS + 1)
    beside = np.exp(-(k**2) / (2 * np.clip(ratio, 1e-3, 2.0)[..., None]))
    found = 2 * (beside @ k**2.0) / (1 + 2 * beside.sum(axis=-1))
    return np.where(ratio < 2, found, ratio) * step**2


def levels(sums: Sequence[GaussianSum], narrowest: float, spread: bool, step: float) -> tuple[float, ...]:
    """Return the standard deviations to render, mm, ascending; light that stays where it is comes besides.

    Parameters
    ----------
    sums : of all skins
    narrowest : mm, below which nothing can be rendered
    step : mm, > 0, from sample to sample of the light
    spread : whether the scattering radius varies: then wider levels serve up to MAX_SPREAD
    """
    widths = np.sort(np.sqrt([variance for one in sums for variance in one.variances]))
    if not len(widths):
        return ()
    if spread:
        # Second moments of mixtures are right at any distance of the levels, shapes only at a small one.
        reach = widths[-1] * MAX_SPREAD
        steps = int(np.ceil(np.log2(reach / max(widths[0], narrowest))))
        widths = np.sort(np.concatenate([widths, reach / 2.0 ** np.arange(max(steps, 1))]))
    found = widths[widths >= narrowest]
    if narrowest > 0 and (not len(found) or found[0] > MERGED * narrowest):
        narrow = [_shares(one) * sampled(np.array(one.variances), step)[:, None] for one in sums]
        missed = [moment[np.array(one.variances) < narrowest**2] for one, moment in zip(sums, narrow, strict=True)]
        if max(float(one.max(initial=0.0)) for one in missed) > TOLERATED * narrowest**2:
            found = np.append(narrowest, found)
    factor = MERGED
    while True:
        # From the widest down, so that nothing is wider than all levels.
        kept: list[float] = []
        for width in found[::-1]:
            if not kept or width * factor <= kept[-1]:
                kept.append(float(width))
        if len(kept) <= MAX_LEVELS:
            return tuple(kept[::-1])
        factor *= MERGED


def spread_weights(profile: GaussianSum, widths: Sequence[float], nearest: float, steps: int = SPREAD_STEPS) -> Floats:
    """Return how much of each level makes a profile whose radius is scaled.

    Least squares of the edge response under the right sum, so that constant light passes, and second moment.

    Parameters
    ----------
    profile : normalized here
    widths : (k,) of `levels`, mm
    nearest : mm, > 0; distances below it are not told apart: half the distance of the light's samples
    steps : 1 for the profile as it is, or columns for squared ratios from 0 to MAX_SPREAD²

    Returns
    -------
    (k + 1, steps, 3), which sum to 1 over the levels; the first is light that stays where it is
    """
    ratios = np.linspace(0, MAX_SPREAD**2, steps) if steps > 1 else np.ones(1)
    result = np.zeros((len(widths) + 1, steps, 3))
    result[0] = 1.0
    # A channel that reflects nothing has no profile: its light stays.
    shares = np.reshape(_shares(profile), (-1, 3))
    colored = np.flatnonzero(shares.sum(axis=0) > 0)
    if not len(widths) or not len(colored):
        return result
    variances = np.concatenate([[0.0], np.square(widths)])
    x = np.geomspace(nearest, max(2 * nearest, 4 * widths[-1]), POINTS)
    basis = np.column_stack([np.ones(POINTS), ndtr(x[:, None] / np.array(widths))])
    for column, ratio in enumerate(ratios):
        wanted = np.minimum(sampled(np.array(profile.variances) * ratio, 2 * nearest), variances[-1])
        edge = ndtr(x[:, None] / np.sqrt(np.maximum(wanted, 1e-30))) @ shares
        moments = wanted @ shares
        for channel in colored:
            scale = MOMENT_ROW / max(float(moments[channel]), nearest**2)
            rows = np.vstack([basis, SUM_ROW * np.ones(len(variances)), scale * variances])
            aims = np.concatenate([edge[:, channel], [SUM_ROW], [scale * moments[channel]]])
            found = nnls(rows, aims)[0]
            result[:, column, channel] = found / found.sum()
    return result


def edge_error(profile: GaussianSum, widths: Sequence[float], nearest: float) -> float:
    """Return by how much the levels' edge response differs from a profile's, over all channels.

    Parameters
    ----------
    profile, widths : see spread_weights
    nearest : mm, > 0; distances from the edge below it are not told apart

    Returns
    -------
    greatest difference, as a share of the light
    """
    weights = spread_weights(profile, widths, nearest, 1)[:, 0]
    x = nearest * np.geomspace(1, 1e3, 200)
    mixed = weights[0] + ndtr(x[:, None] / np.array(widths)) @ weights[1:]
    shares = _shares(profile)
    wanted = np.maximum(sampled(np.array(profile.variances), 2 * nearest), 1e-30)
    exact = ndtr(x[:, None] / np.sqrt(wanted)) @ shares + 1 - shares.sum(axis=0)
    return float(np.abs(mixed - exact).max())


def _shares(profile: GaussianSum) -> Floats:
    """Return the weights as shares of each channel's light, (k, 3)."""
    total = profile.total()
    return np.where(total > 0, np.array(profile.weights) / np.where(total > 0, total, 1), 0.0)
