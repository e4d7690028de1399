"""Responses without surface samples: of any profile by quadrature of R(r), of a Gaussian on a ball in closed form.

What profiles compute in closed form, or by way of transforms, is held against the quadratures here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skincli.optics.gaussians import Profile

Floats = NDArray[np.float64]

NEAR, FAR = 1e-11, 1e4
"""mm. Between these distances R is integrated; every profile of interest lives far inside."""

PANELS_PER_E_FOLD = 4
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(12)


def edge(profile: Profile, x: float) -> Floats:
    """Return the response at distance x from the edge of a half plane lit on x > 0.

    Parameters
    ----------
    profile : only its `radial` is used
    x : mm

    Returns
    -------
    (3,) float64, good to about 1e-9 of the profile's total
    """
    whole = spot(profile, FAR)
    if x == 0.0:
        return 0.5 * whole
    # Of the circle of radius r, 2 acos(x / r) lies beyond the edge: smooth in u, where r = x cosh u.
    u, weights = _panels(0.0, math.acosh(FAR / abs(x)))
    r = abs(x) * np.cosh(u)
    beyond = 2 * np.arctan(np.sinh(u)) * r * abs(x) * np.sinh(u) * weights @ profile.radial(r)
    return whole - beyond if x > 0 else beyond


def spot(profile: Profile, radius: float) -> Floats:
    """Return the response at the center of a lit disc.

    Parameters
    ----------
    profile : only its `radial` is used
    radius : mm, > 0

    Returns
    -------
    (3,) float64, good to about 1e-9 of the profile's total
    """
    t, weights = _panels(math.log(NEAR), math.log(radius))
    r = np.exp(t)
    return 2 * math.pi * (r**2 * weights) @ profile.radial(r)


def cap(sigma: float, radius: float, angle: ArrayLike) -> Floats:
    """Return the normalized response at the pole of a ball lit on a cap about that pole.

    The kernel is a Gaussian of the straight distance, times (1 + n.n')/2: what `surface_integral` computes by sums.

    Parameters
    ----------
    sigma : mm, > 0, standard deviation per axis
    radius : mm, > 0, of the ball
    angle : (...) degrees, 0 to 180, from the pole to the cap's rim

    Returns
    -------
    (...) float64 in [0, 1]
    """
    # With u = 1 - cos(angle) the squared distance is 2 radius² u, and the weight 1 - u/2.
    steepness = (radius / sigma) ** 2
    u = 1 - np.cos(np.radians(np.asarray(angle, dtype=np.float64)))
    return np.asarray(_cap_integral(steepness, u) / _cap_integral(steepness, np.float64(2.0)))


def _cap_integral(a: float, u: Floats | np.float64) -> Floats:
    """Return the integral of exp(-a u) (1 - u/2) from 0 to u."""
    decay = np.exp(-a * u)
    return np.asarray((1 - decay) / a - 0.5 * ((1 - decay) / a**2 - u * decay / a))


def _panels(first: float, last: float) -> tuple[Floats, Floats]:
    """Return nodes and weights of a composite Gauss-Legendre rule over [first, last]."""
    count = max(1, math.ceil((last - first) * PANELS_PER_E_FOLD))
    borders = np.linspace(first, last, count + 1)
    half = np.diff(borders)[:, None] / 2
    return (borders[:-1, None] + half * (NODES + 1)).ravel(), (half * NODE_WEIGHTS).ravel()
