"""Sums of Gaussians: the published human profile, the paper's single Gaussian, and fits to any other profile."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares, nnls
from scipy.special import erf, ndtr

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

SUM_ROW = 1e4
"""How much heavier than a point of the edge the sum of the weights is; what is left of its error is scaled away."""

SMALLEST_STEP = 1e-4
"""The edge response is fitted where it lies between this and 1 minus this."""

GRID = 96
"""Points of the edge response that a fit sees; the stated error is measured on twice as many, over a wider range."""

ROUNDS, EVALUATIONS = 12, 4
"""Rounds that lower the largest error, and how far the widths are searched in each."""

FORGIVEN = 0.02
"""Importance that a point without any error keeps in the next round, as a share of that of the largest error."""


class Profile(Protocol):
    """A radially symmetric diffusion profile, mm, for R, G, B."""

    def __hash__(self) -> int:
        """Equal profiles share their fits."""

    def radial(self, r: ArrayLike) -> Floats:
        """Return R(r), (..., 3), 1/mm², at distances r > 0, (...), mm."""

    def total(self) -> Floats:
        """Return the integral of R over the plane, (3,): the albedo."""

    def edge(self, x: ArrayLike) -> Floats:
        """Return the response, (..., 3), at distance x, (...), mm, from the edge of a half plane lit on x > 0."""

    def spot(self, radius: ArrayLike) -> Floats:
        """Return the response, (..., 3), at the center of a lit disc of the given radius >= 0, (...), mm."""


def triple(values: ArrayLike) -> Triple:
    """Return R, G, B as three floats; one value serves all."""
    red, green, blue = (float(value) for value in np.broadcast_to(np.asarray(values, dtype=np.float64), 3))
    return red, green, blue


@dataclass(frozen=True)
class GaussianSum:
    """A sum of Gaussians that the three channels share: R(r) = sum of w exp(-r² / 2v) / (2 pi v).

    Parameters
    ----------
    variances : k values, mm², > 0, per axis
    weights : k triples for R, G, B; each channel's sum is its albedo
    """

    variances: tuple[float, ...]
    weights: tuple[Triple, ...]

    def radial(self, r: ArrayLike) -> Floats:
        """See `Profile`; r = 0 is allowed."""
        variances = np.array(self.variances)
        return self._mix(np.exp(-(_column(r) ** 2) / (2 * variances)) / (2 * math.pi * variances))

    def total(self) -> Floats:
        """See `Profile`."""
        return np.sum(np.array(self.weights), axis=0)

    def edge(self, x: ArrayLike) -> Floats:
        """See `Profile`."""
        return self._mix(ndtr(_column(x) / np.sqrt(self.variances)))

    def spot(self, radius: ArrayLike) -> Floats:
        """See `Profile`."""
        return self._mix(-np.expm1(-(_column(radius) ** 2) / (2 * np.array(self.variances))))

    def mean_square_radius(self) -> Floats:
        """Return the mean of r² under each channel's normalized profile, (3,), mm²."""
        return 2 * np.array(self.variances) @ np.array(self.weights) / self.total()

    def _mix(self, terms: Floats) -> Floats:
        """Return (..., 3) of (..., k)."""
        return terms @ np.reshape(self.weights, (-1, 3))


@dataclass(frozen=True)
class GaussianFit(GaussianSum):
    """A sum of Gaussians that stands for another profile.

    Parameters
    ----------
    edge_error : largest difference of the two edge responses over all channels and distances, as a share of the total
    """

    edge_error: float


HUMAN = GaussianSum(
    (0.0064, 0.0484, 0.187, 0.567, 1.99, 7.41),
    (
        (0.233, 0.455, 0.649),
        (0.100, 0.336, 0.344),
        (0.118, 0.198, 0.0),
        (0.113, 0.007, 0.007),
        (0.358, 0.004, 0.0),
        (0.078, 0.0, 0.0),
    ),
)
"""Fair human skin, normalized to a white albedo [dEon2007]."""


def single(sigma: ArrayLike, color: ArrayLike) -> GaussianSum:
    """Return one Gaussian per channel, as the seed paper blurs [Fecko2013].

    Parameters
    ----------
    sigma : (3,) or scalar, mm, > 0, standard deviation per axis
    color : (3,) or scalar, albedo in [0, 1]
    """
    variances, which = np.unique(np.square(triple(sigma)), return_inverse=True)
    weights = np.zeros((len(variances), 3))
    weights[which, range(3)] = triple(color)
    return GaussianSum(tuple(variances.tolist()), tuple(triple(row) for row in weights))


@lru_cache(maxsize=256)
def fit(profile: Profile, terms: int) -> GaussianFit:
    """Return the sum of `terms` Gaussians, shared by the channels, whose edge response is nearest to the profile's.

    Least squares over distances spaced evenly in their logarithm: the widths are searched, the weights follow from
    them (variable projection). Some rounds in which the places of large errors gain importance then take the largest
    error down (Lawson's method). The same arguments give the same digits.

    Parameters
    ----------
    profile : hashable, as all profiles here are
    terms : >= 1; a sum of no more Gaussians than that is its own fit

    Returns
    -------
    Weights are >= 0 and sum to the profile's total in each channel; variances ascend.

    Raises
    ------
    ValueError
        If `terms` is less than 1.
    """
    if terms < 1:
        raise ValueError(f"a fit needs at least one Gaussian, not {terms}")
    if isinstance(profile, GaussianSum) and len(profile.variances) <= terms:
        return GaussianFit(profile.variances, profile.weights, 0.0)
    total = profile.total()
    colored = total > 0
    near, far = _extent(profile, colored)
    x = np.geomspace(near, far, GRID)
    target = _half(profile, x, colored)
    importance = np.ones_like(target)
    found = np.linspace(math.log(near), math.log(far), terms + 2)[1:-1]
    rounds: list[tuple[float, Floats, Floats]] = []
    for evaluations in (100, *[EVALUATIONS] * ROUNDS):
        # A width far beyond the visible range would make two columns alike.
        bounds = (math.log(near) - 1.0, math.log(far) + 1.0)
        data = (x, target, importance)
        found = least_squares(_misfit, found, bounds=bounds, args=data, max_nfev=evaluations).x
        basis = _steps(x, np.exp(found))
        weights = _weights(basis, target, importance)
        error = np.abs(basis @ weights - target)
        rounds.append((float(error.max(initial=0.0)), found, weights))
        importance = importance * np.sqrt(error + FORGIVEN * error.max(initial=0.0))
        importance = importance / importance.max(initial=1e-300)
    _, found, shares = min(rounds, key=lambda entry: entry[0])
    order = np.argsort(found)
    weights = np.zeros((terms, 3))
    weights[:, colored] = shares[order] * total[colored]
    variances, rows = tuple(np.exp(2 * found[order]).tolist()), tuple(triple(row) for row in weights)
    fine = np.geomspace(near / 2, 2 * far, 2 * GRID)
    difference = _half(GaussianSum(variances, rows), fine, colored) - _half(profile, fine, colored)
    return GaussianFit(variances, rows, float(np.abs(difference).max(initial=0.0)))


def _misfit(logarithms: Floats, x: Floats, target: Floats, importance: Floats) -> Floats:
    """Return the weighted residuals of the best weights for standard deviations given by their logarithms."""
    basis = _steps(x, np.exp(logarithms))
    return (importance * (basis @ _weights(basis, target, importance) - target)).ravel()


def _column(values: ArrayLike) -> Floats:
    """Return (..., 1) float64, to be held against (k,)."""
    return np.asarray(values, dtype=np.float64)[..., None]


def _half(profile: Profile, x: Floats, colored: NDArray[np.bool_]) -> Floats:
    """Return the normalized edge response minus 1/2 of the channels that are not black; it is odd in x."""
    return profile.edge(x)[..., colored] / profile.total()[colored] - 0.5


def _steps(x: Floats, sigma: Floats) -> Floats:
    """Return `_half` of unit Gaussians, (n, k)."""
    return 0.5 * np.asarray(erf(x[:, None] / (math.sqrt(2) * sigma)))


def _extent(profile: Profile, colored: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the least and the largest distance, mm, at which an edge response is on its way between 1/2 and 1."""
    x = np.geomspace(1e-5, 1e4, 181)
    half = _half(profile, x, colored)
    moving = ((half > SMALLEST_STEP) & (half < 0.5 - SMALLEST_STEP)).any(axis=1)
    if not moving.any():
        return 1.0, 10.0
    return float(x[moving].min()), float(x[moving].max())


def _weights(basis: Floats, target: Floats, importance: Floats) -> Floats:
    """Return the weights (k, c), not negative and with unit sums, that bring the basis (n, k) nearest to the target."""
    count, channels = basis.shape[1], target.shape[1]
    found = np.empty((count, channels))
    for channel in range(channels):
        rows = np.vstack([importance[:, channel, None] * basis, np.full(count, SUM_ROW)])
        wanted = np.append(importance[:, channel] * target[:, channel], SUM_ROW)
        # Few columns, many rows: the triangular factor has the same least squares at a fraction of the cost.
        q, r = np.linalg.qr(rows)
        found[:, channel] = nnls(r, q.T @ wanted)[0]
    return found / found.sum(axis=0)
