"""Diffusion profiles by what a person knows of a skin: its color and radius, its medium, or its name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import iti0k0

from skincli.errors import InputError, did_you_mean
from skincli.optics.diffusion import burley_width
from skincli.optics.dipole import JENSEN_IOR, SKIN1, SKIN2, Dipole
from skincli.optics.gaussians import HUMAN, Floats, Profile, Triple, triple


@dataclass(frozen=True)
class Burley:
    """Normalized diffusion, R(r) = A (exp(-r/d) + exp(-r/3d)) / (8 pi d r) [Burley2015].

    Parameters
    ----------
    color : albedo A, in [0, 1]
    width : d, mm, > 0
    """

    color: Triple
    width: Triple

    def radial(self, r: ArrayLike) -> Floats:
        """See `Profile`; R grows without bound towards r = 0."""
        r, d = np.asarray(r, dtype=np.float64)[..., None], np.array(self.width)
        return np.array(self.color) * (np.exp(-r / d) + np.exp(-r / (3 * d))) / (8 * math.pi * d * r)

    def total(self) -> Floats:
        """See `Profile`."""
        return np.array(self.color)

    def edge(self, x: ArrayLike) -> Floats:
        """See `Profile`. The line spread is A (K0(x/d) + K0(x/3d)) / (4 pi d); this is its integral."""
        x, d = np.asarray(x, dtype=np.float64)[..., None], np.array(self.width)
        grown = _integral_of_k0(np.abs(x) / d) + 3 * _integral_of_k0(np.abs(x) / (3 * d))
        return np.array(self.color) * (0.5 + np.sign(x) * grown / (4 * math.pi))

    def spot(self, radius: ArrayLike) -> Floats:
        """See `Profile`: A times the cumulative distribution 1 - exp(-r/d)/4 - 3 exp(-r/3d)/4."""
        ratio = np.asarray(radius, dtype=np.float64)[..., None] / np.array(self.width)
        return -np.array(self.color) * (np.expm1(-ratio) + 3 * np.expm1(-ratio / 3)) / 4


PRESETS: dict[str, Profile] = {
    "human": HUMAN,
    "jensen_skin1": Dipole(*SKIN1, JENSEN_IOR),
    "jensen_skin2": Dipole(*SKIN2, JENSEN_IOR),
}
"""Profiles by name. `human` is white and takes its color from elsewhere; the others carry their own [Jensen2001]."""


def from_color(color: Sequence[float], radius: Sequence[float], radius_kind: str) -> Burley:
    """Return the normalized diffusion profile of an albedo and a length.

    Parameters
    ----------
    color : (3,) albedo in [0, 1]
    radius : (3,) mm, > 0
    radius_kind : "mfp", "dmfp" or "d"; see `burley_width`

    Raises
    ------
    InputError
        If `radius_kind` is none of these.
    """
    return Burley(triple(color), triple(burley_width(radius, color, radius_kind)))


def from_medium(sigma_a: Sequence[float], sigma_s_prime: Sequence[float], ior: float) -> Dipole:
    """Return the dipole of a half space of one medium.

    Parameters
    ----------
    sigma_a : (3,) 1/mm, > 0, absorption
    sigma_s_prime : (3,) 1/mm, > 0, reduced scattering
    ior : index of refraction against that of air, >= 1

    Raises
    ------
    InputError
        If a value is out of range.

    Notes
    -----
    An approximation, not the truth: against Monte Carlo its albedo is off by 2 to 30 % at ior 1.4.
    """
    return Dipole(triple(sigma_a), triple(sigma_s_prime), float(ior))


def preset(name: str) -> Profile:
    """Return the profile of a name in `PRESETS`.

    Raises
    ------
    InputError
        If there is no such name.
    """
    if name not in PRESETS:
        raise InputError(
            f"there is no diffusion profile '{name}'{did_you_mean(name, list(PRESETS))}; choose {', '.join(PRESETS)}"
        )
    return PRESETS[name]


def _integral_of_k0(x: Floats) -> Floats:
    """Return the integral of the Bessel function K0 from 0 to x >= 0; pi/2 at infinity."""
    # Beyond 40 the rest is below 1e-17, while the companion integral of I0 would overflow.
    return np.asarray(iti0k0(np.minimum(x, 40.0))[1])
