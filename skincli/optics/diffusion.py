"""Lengths of the normalized diffusion profile, and the Gaussian that stands for it until the profile itself does."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skincli.errors import InputError


def burley_width(radius: Sequence[float], color: Sequence[float], kind: str) -> NDArray[np.float64]:
    """Return the width d of Burley's normalized diffusion profile, A (exp(-r/d) + exp(-r/3d)) / (8 pi d r).

    Parameters
    ----------
    radius : (3,) mm, for R, G, B
    color : (3,) surface albedo A in [0, 1]
    kind : which length `radius` is: "mfp" mean free path, "dmfp" diffuse mean free path, "d" the width itself

    Returns
    -------
    (3,) mm

    Raises
    ------
    InputError
        If `kind` is none of these.

    References
    ----------
    [Christensen2015]: diffuse transmission, s = 1.9 - A + 3.5 (A - 0.8)^2 for mfp; s = 3.5 + 100 (A - 0.33)^4 for dmfp
    """
    length, A = np.asarray(radius, float), np.asarray(color, float)
    if kind == "mfp":
        return length / (1.9 - A + 3.5 * (A - 0.8) ** 2)
    if kind == "dmfp":
        return length / (3.5 + 100 * (A - 0.33) ** 4)
    if kind == "d":
        return length
    raise InputError(f"a radius of kind '{kind}' is unknown; it must be mfp, dmfp or d")


def gaussian_sigma(width: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation (per axis) of the Gaussian with the same second moment as Burley's profile.

    The profile's mean square radius is 14 d^2, a Gaussian's is 2 sigma^2.

    Parameters
    ----------
    width : (...) mm, d of the profile

    Returns
    -------
    (...) mm
    """
    return math.sqrt(7) * width
