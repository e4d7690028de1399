"""Exact diffusion over the texels of an atlas, for the pipeline to show in place of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skincli.mesh.texels import Texels
from skincli.reference.surface_integral import Light, Samples

LEAST_SIGMA = 1e-3
"""mm, of a texel whose scattering radius is 0: narrower than any texel, so that its own light is left."""


def samples_of(texels: Texels) -> Samples:
    """Return the texels that give light as samples of the surface."""
    gives = texels.areas > 0
    return Samples(texels.positions[gives], texels.normals[gives], texels.areas[gives])


def diffuse_texels(
    texels: Texels,
    signal: NDArray[np.float64],
    receiving: NDArray[np.bool_],
    variances: Sequence[float],
    weights: Sequence[Sequence[float]],
    ratio: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return a sum of Gaussians of the light on an atlas, each normalized on the surface.

    Parameters
    ----------
    texels : all that give light, and perhaps some that only receive
    signal : (n, 3) irradiance
    receiving : (n,) where the result is wanted, among those that give
    variances, weights : of a GaussianSum
    ratio : (m, 3) by which each receiving texel scales the standard deviations, by channel; None where it is 1

    Returns
    -------
    (m, 3) float64, at the receiving texels
    """
    light = Light(samples_of(texels), signal[texels.areas > 0])
    targets, normals = texels.positions[receiving], texels.normals[receiving]
    result = np.zeros((len(targets), 3))
    for variance, share in zip(variances, weights, strict=True):
        sigma = math.sqrt(variance)
        if ratio is None:
            result += np.asarray(share) * light.diffused(targets, normals, sigma)
            continue
        for channel, widths in enumerate(np.maximum(sigma * ratio, LEAST_SIGMA).T):
            result[:, channel] += share[channel] * light.diffused(targets, normals, widths)[:, channel]
    return result


class SeenTexels:
    """The same at the texels that some pixels read; the others stay dark.

    Parameters
    ----------
    atlas_uv : (n, 2) where the pixels read the atlas, v upwards
    size : texels a side of the atlas
    """

    def __init__(self, atlas_uv: NDArray[np.float64], size: int) -> None:
        low = np.floor(atlas_uv * size - 0.5).astype(np.int64)
        corners = [np.clip(low + step, 0, size - 1) for step in ((0, 0), (1, 0), (0, 1), (1, 1))]
        self.read = np.zeros(size * size, dtype=bool)
        for corner in corners:
            self.read[corner[:, 1] * size + corner[:, 0]] = True

    def __call__(
        self,
        texels: Texels,
        signal: NDArray[np.float64],
        receiving: NDArray[np.bool_],
        variances: Sequence[float],
        weights: Sequence[Sequence[float]],
        ratio: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return (m, 3), see `diffuse_texels`."""
        seen = self.read[texels.index[receiving]]
        result = np.zeros((len(seen), 3))
        ratio = None if ratio is None else ratio[seen]
        result[seen] = diffuse_texels(texels, signal, receiving & self.read[texels.index], variances, weights, ratio)
        return result
