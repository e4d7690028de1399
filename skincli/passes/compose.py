"""Equation 2 of the seed paper: the fusion of all that reaches the camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Input, Output, Pass


@dataclass(frozen=True)
class ComposeValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    scale : factor on the light that left the skin: 1 for `paper`, 1/pi for radiance
    tint_highlights : 1 multiplies highlights by the albedo, as the paper does; 0 leaves them white
    normalize : 1 divides the bilinear read by the share of its texels that hold a surface
    in_atlas : 1 reads the diffused light in the atlas, 0 in the picture
    way_out : square roots of the albedo that light still has to meet, 0 to 2
    """

    scale: float
    tint_highlights: float
    normalize: int
    in_atlas: int
    way_out: int


class Compose(Pass):
    """Beauty (premultiplied, a = coverage) and the diffuse light before what is left of the albedo."""

    shader = "passes/compose.frag"
    inputs = {
        "depth": Input(),
        "uv": Input(),
        "albedo": Input(),
        "occlusion": Input(),
        "specular": Input(),
        "reflection": Input(),
        "diffused": Input("linear"),
    }
    outputs = {"beauty": Output(), "diffuse": Output(needs=("depth", "uv", "diffused"))}


def twin(
    values: ComposeValues,
    diffuse: NDArray[np.float64],
    albedo: NDArray[np.float64],
    occlusion: NDArray[np.float64],
    specular: NDArray[np.float64],
    reflection: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return Equation 2 from the diffused light in picture space.

    Parameters
    ----------
    diffuse : (h, w, 4) light that left the skin, scaled, a = coverage
    albedo, specular, reflection : (h, w, 3)
    occlusion : (h, w)

    Returns
    -------
    (h, w, 4)
    """
    covered = diffuse[..., 3:]
    highlight = specular * (1 + values.tint_highlights * (albedo - 1))
    beauty = diffuse[..., :3] * occlusion[..., None] * albedo ** (values.way_out / 2) + highlight + reflection
    return np.concatenate([covered * beauty, covered], axis=-1)
