"""Exact diffusion over the texels of an atlas, for the pipeline to show in place of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skincli.mesh.texels import Texels
from skincli.reference.surface_integral import CUTOFF, Samples, hierarchical

#: what clusters of texels may change a kernel of height 1, see surface_integral.hierarchical
TOLERANCE = 1e-4


def diffuse_texels(
    texels: Texels,
    signal: NDArray[np.float64],
    receiving: NDArray[np.bool_],
    variances: Sequence[float],
    weights: Sequence[Sequence[float]],
) -> NDArray[np.float64]:
    """Return a sum of Gaussians of the light on an atlas, each normalized on the surface.

    Parameters
    ----------
    texels : all that give light, and perhaps some that only receive
    signal : (n, 3) irradiance
    receiving : (n,) where the result is wanted, among those that give
    variances, weights : of a GaussianSum

    Returns
    -------
    (m, 3) float64, at the receiving texels
    """
    gives = texels.areas > 0
    samples = Samples(texels.positions[gives], texels.normals[gives], texels.areas[gives])
    targets, normals = texels.positions[receiving], texels.normals[receiving]
    # Light whose Gaussian reaches no other texel stays where it is.
    others = cKDTree(samples.positions).query(targets, k=2)[0][:, 1]
    result = np.zeros((len(targets), 3))
    for variance, share in zip(variances, weights, strict=True):
        sigma = math.sqrt(variance)
        part = signal[receiving]
        near = others < CUTOFF * sigma
        if near.any():
            found = hierarchical(samples, signal[gives], targets[near], normals[near], sigma, tolerance=TOLERANCE)
            part[near] = found.values
        result += np.asarray(share) * part
    return result
