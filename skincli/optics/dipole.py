"""Profiles that follow from absorption and scattering: the dipole of a half space, the multipole of layers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j0, j1, k1

from skincli.errors import InputError
from skincli.optics.gaussians import Floats, Triple

JENSEN_IOR = 1.3
"""Index of refraction that [Jensen2001] takes for all its measured materials."""

SKIN1: tuple[Triple, Triple] = ((0.032, 0.17, 0.48), (0.74, 0.88, 1.01))
SKIN2: tuple[Triple, Triple] = ((0.013, 0.070, 0.145), (1.09, 1.59, 1.79))
"""Absorption and reduced scattering, 1/mm, of the skins measured by [Jensen2001]."""

VANISHED = 30.0
"""Exponent at which what decays exponentially counts as nothing: 1e-13."""

NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(16)
FINE_NODES, FINE_WEIGHTS = np.polynomial.legendre.leggauss(80)


def internal_reflection(eta: float) -> float:
    """Return A = (1 + F) / (1 - F), where F is the mean Fresnel reflection of diffuse light at a boundary.

    Parameters
    ----------
    eta : index inside over index outside, > 0; at 1 the boundary reflects nothing and A is 1

    Notes
    -----
    Polynomials of [Egan1973], rounded as in [Jensen2001] above 1 and as in [Donner2005] below. At 1 itself the rounded
    polynomial leaves 0.0016; there F is zero.
    """
    if eta > 1:
        fresnel = -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta
    elif eta < 1:
        fresnel = -0.4399 + 0.7099 / eta - 0.3319 / eta**2 + 0.0636 / eta**3
    else:
        fresnel = 0.0
    return (1 + fresnel) / (1 - fresnel)


def _check(name: str, values: ArrayLike, least: float) -> None:
    """Refuse values that are not above `least`, or not finite."""
    array = np.asarray(values, dtype=np.float64)
    if not (np.isfinite(array) & (array > least)).all():
        raise InputError(f"{name} is {array.tolist()}; each value must be finite and above {least:g}")


@dataclass(frozen=True)
class Dipole:
    """Diffuse reflectance of a half space: a source one mean free path deep and its mirror image [Jensen2001].

    Parameters
    ----------
    sigma_a : 1/mm, > 0, absorption
    sigma_s_prime : 1/mm, > 0, reduced scattering
    eta : index of refraction inside over outside, > 0

    Raises
    ------
    InputError
        If a value is out of range.

    Notes
    -----
    Against Monte Carlo the albedo is off by 2 to 30 % at eta = 1.4, and the profile is too low close to the source.
    """

    sigma_a: Triple
    sigma_s_prime: Triple
    eta: float

    def __post_init__(self) -> None:
        _check("sigma_a", self.sigma_a, 0.0)
        _check("sigma_s_prime", self.sigma_s_prime, 0.0)
        _check("eta", self.eta, 0.0)

    @cached_property
    def transport(self) -> Floats:
        """Effective transport coefficient, (3,), 1/mm; its inverse is the diffuse mean free path."""
        return np.sqrt(3 * np.array(self.sigma_a) * (np.array(self.sigma_a) + np.array(self.sigma_s_prime)))

    @cached_property
    def _depths(self) -> Floats:
        """Depth of the source and height of its image, (2, 3), mm."""
        real = 1 / (np.array(self.sigma_a) + np.array(self.sigma_s_prime))
        return np.stack([real, real * (1 + 4 * internal_reflection(self.eta) / 3)])

    @cached_property
    def _half_albedo(self) -> Floats:
        """Half of the single-scattering albedo, (3,): what each of the two sources sends up at most."""
        return np.array(self.sigma_s_prime) * self._depths[0] / 2

    def radial(self, r: ArrayLike) -> Floats:
        """See `Profile`; r = 0 is allowed."""
        distance, z = self._distances(r)
        damped = (1 + self.transport * distance) * np.exp(-self.transport * distance)
        return self._half_albedo / (2 * math.pi) * np.sum(z * damped / distance**3, axis=-2)

    def total(self) -> Floats:
        """See `Profile`."""
        return self._half_albedo * np.sum(np.exp(-self.transport * self._depths), axis=0)

    def edge(self, x: ArrayLike) -> Floats:
        """See `Profile`: the integral of the line spread, a sum of z s K1(s p) / p with p² = x² + z²."""
        x = np.asarray(x, dtype=np.float64)[..., None, None]
        s, z = self.transport, self._depths
        # With x = z sinh u the integrand is smooth and decays doubly exponentially.
        limit = np.arcsinh(np.minimum(np.abs(x), VANISHED / s) / z)
        u = limit[..., None] * (FINE_NODES + 1) / 2
        grown = limit / 2 * ((s * z)[..., None] * k1((s * z)[..., None] * np.cosh(u)) @ FINE_WEIGHTS)
        return 0.5 * self.total() + np.sum(np.sign(x) * self._half_albedo / math.pi * grown, axis=-2)

    def spot(self, radius: ArrayLike) -> Floats:
        """See `Profile`."""
        distance, z = self._distances(radius)
        return self.total() - self._half_albedo * np.sum(z * np.exp(-self.transport * distance) / distance, axis=-2)

    def mean_square_radius(self) -> Floats:
        """Return the mean of r² under each channel's normalized profile, (3,), mm²."""
        shares = np.exp(-self.transport * self._depths)
        return np.sum(shares * 2 * self._depths / self.transport, axis=0) / np.sum(shares, axis=0)

    def _distances(self, r: ArrayLike) -> tuple[Floats, Floats]:
        """Return the distances from both sources, (..., 2, 3), and their depths, (2, 3)."""
        r = np.asarray(r, dtype=np.float64)[..., None, None]
        return np.sqrt(r**2 + self._depths**2), self._depths


@dataclass(frozen=True)
class Layer:
    """One layer of a `Multipole`.

    Parameters
    ----------
    sigma_a : 1/mm, > 0, absorption
    sigma_s_prime : 1/mm, > 0, reduced scattering
    thickness : mm; infinite only for the lowest layer
    ior : index of refraction against that of air, > 0
    """

    sigma_a: Triple
    sigma_s_prime: Triple
    thickness: float
    ior: float


@dataclass(frozen=True)
class Multipole:
    """Diffuse reflectance of stacked layers over nothing, as for skin [Donner2005].

    Each layer's reflectance and transmittance are sums of dipole pairs, of which the source takes 11. Their Hankel
    transforms are exponentials in geometric series, so that all pairs cost less than a few; there the layers are
    combined with all light that bounces between them. The way back is one numerical quadrature.

    Parameters
    ----------
    layers : from the top

    Raises
    ------
    InputError
        If a value is out of range, or a layer is thinner than its mean free path 1 / (sigma_a + sigma_s'): the
        method places the source that deep, which would be below the layer.
    """

    layers: tuple[Layer, ...]

    def __post_init__(self) -> None:
        if not self.layers:
            raise InputError("a multipole has no layers; give at least one")
        for number, layer in enumerate(self.layers, 1):
            name = f"layer {number}"
            _check(f"sigma_a of {name}", layer.sigma_a, 0.0)
            _check(f"sigma_s_prime of {name}", layer.sigma_s_prime, 0.0)
            _check(f"ior of {name}", layer.ior, 0.0)
            depth = 1 / (np.array(layer.sigma_a) + np.array(layer.sigma_s_prime)).min()
            if not layer.thickness >= depth:
                raise InputError(
                    f"{name} is {layer.thickness:g} mm thick, less than its mean free path, {depth:.3g} mm; "
                    "the multipole needs thicker layers: merge it with its neighbor"
                )
            if math.isinf(layer.thickness) and number < len(self.layers):
                raise InputError(f"{name} is infinitely thick, but lies above others; only the lowest may be")

    def hankel(self, k: Floats) -> Floats:
        """Return the transform of R at spatial frequencies k >= 0, (n,), rad/mm: (n, 3); at 0 it is the albedo."""
        above = [1.0, *(layer.ior for layer in self.layers)]
        below = [*(layer.ior for layer in self.layers[1:]), 1.0]
        result = np.zeros((len(k), 3))
        # From the lowest upwards: what lies below a layer is one reflectance to it.
        for layer, over, under in reversed(list(zip(self.layers, above, below, strict=False))):
            down, through = _slab(layer, layer.ior / over, layer.ior / under, k)
            up, back = _slab(layer, layer.ior / under, layer.ior / over, k) if result.any() else (down, through)
            result = down + through * result * back / (1 - up * result)
        return result

    def radial(self, r: ArrayLike) -> Floats:
        """See `Profile`; r = 0 is allowed."""
        return self._invert(r, lambda k, r: k * j0(k * r) / (2 * math.pi), np.zeros(3))

    def total(self) -> Floats:
        """See `Profile`."""
        return self.hankel(np.zeros(1))[0]

    def edge(self, x: ArrayLike) -> Floats:
        """See `Profile`."""
        x = np.asarray(x, dtype=np.float64)
        half = 0.5 * self.total()
        grown = self._invert(np.abs(x), lambda k, x: np.sin(k * x) / (math.pi * k), half)
        return half + np.sign(x)[..., None] * grown

    def spot(self, radius: ArrayLike) -> Floats:
        """See `Profile`."""
        return self._invert(radius, lambda k, r: r * j1(k * r), self.total())

    def _invert(self, r: ArrayLike, kernel: Callable[[Floats, Floats], Floats], far: Floats) -> Floats:
        """Return the integral of hankel(k) kernel(k, r) over k, (..., 3); `far` where nothing is left to add."""
        r = np.asarray(r, dtype=np.float64)
        flat = r.ravel()
        result = np.broadcast_to(far, (*flat.shape, 3)).copy()
        for which, k, weights in self._quadratures(flat):
            result[which] = kernel(k[None, :], flat[which, None]) @ (weights[:, None] * self.hankel(k))
        return result.reshape(*r.shape, 3)

    def _quadratures(self, r: Floats) -> Iterator[tuple[NDArray[np.intp], Floats, Floats]]:
        """Yield groups of similar distances with the frequencies and weights (n,) that serve them.

        Panels begin as narrow as the slowest decay asks for and widen up to three periods of the farthest distance,
        which 16 nodes integrate to 1e-12.
        """
        extinction = np.array([np.add(layer.sigma_a, layer.sigma_s_prime) for layer in self.layers])
        slowest = np.sqrt(3 * np.array([layer.sigma_a for layer in self.layers]) * extinction).min()
        highest = VANISHED * extinction[0].max()
        octave = np.ceil(np.log2(np.maximum(r * slowest, 1e-3)))
        for value in np.unique(octave[r * slowest < VANISHED]):
            which = np.flatnonzero((octave == value) & (r * slowest < VANISHED))
            widest = 6 * math.pi * slowest / 2.0**value
            grown = np.cumsum(np.minimum(slowest * 1.3 ** np.arange(200), widest))
            rest = np.arange(grown[-1] + widest, highest + widest, widest)
            borders = np.concatenate([[0.0], grown[grown < highest], rest[rest < highest], [highest]])
            half = np.diff(borders)[:, None] / 2
            yield which, (borders[:-1, None] + half * (NODES + 1)).ravel(), (half * NODE_WEIGHTS).ravel()


def _slab(layer: Layer, eta_near: float, eta_far: float, k: Floats) -> tuple[Floats, Floats]:
    """Return the transforms, (n, 3) each, of what a slab lit from one side reflects and lets through."""
    sigma_a, sigma_s = np.array(layer.sigma_a), np.array(layer.sigma_s_prime)
    depth = 1 / (sigma_a + sigma_s)
    s = np.sqrt(3 * sigma_a / depth + k[:, None] ** 2)
    near, far = (2 * internal_reflection(eta) * depth / 3 for eta in (eta_near, eta_far))
    strength = sigma_s * depth / 2
    direct, mirrored = depth, depth + 2 * near
    if math.isinf(layer.thickness):
        return strength * (np.exp(-direct * s) + np.exp(-mirrored * s)), np.zeros_like(s)
    thickness, period = layer.thickness, 2 * (layer.thickness + near + far)
    # The pairs repeat with this period: above the slab and below it they are geometric series.
    series = -1 / np.expm1(-period * s)
    reflected = np.exp(-direct * s) - np.exp((direct - period) * s)
    reflected += np.exp(-mirrored * s) - np.exp((mirrored - period) * s)
    passed = np.exp(-(thickness - direct) * s) - np.exp((thickness - direct - period) * s)
    passed += np.exp((thickness + mirrored - period) * s) - np.exp(-(thickness + mirrored) * s)
    return strength * reflected * series, strength * passed * series
