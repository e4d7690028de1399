"""Texture-space G-buffer: the surface point that owns each texel of the light's atlas, with its bumped normal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values, Vec3
from skincli.graph.node import ZERO, Constant, Input, Output, Pass


@dataclass(frozen=True)
class AtlasValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    bumpiness : factor on the height, 1 is physical
    slot : 1-based number of the part's skin
    gutter : how far charts are continued beyond their border, in atlas uv
    gives : 1 where the texels are a piece of the surface, 0 in the gutter, which only receives
    radius : scattering radius of the part's optics, mm
    """

    bumpiness: float
    slot: float
    gutter: float
    gives: float
    radius: Vec3


class Atlas(Pass):
    """Position (mm, w = slot of the skin, 0 uncovered) and bumped normal; frame_n is the normal without bumps.

    metric : mm² of surface that a texel gives light from (x), texels per mm along both axes (y, z), coverage (w)
    spread : the scattering radius over that of the optics; frame_u and frame_v are for inspection
    """

    shader = "passes/atlas.frag"
    vertex = "passes/atlas.vert"
    inputs = {name: Input("mipmap", repeat=True) for name in ("slope", "albedo_map", "radius_map")}
    outputs = {
        "position": Output(needs=()),
        "normal": Output(needs=("slope",)),
        "frame_n": Output(needs=()),
        "frame_u": Output(needs=("slope",)),
        "frame_v": Output(needs=("slope",)),
        "metric": Output(needs=()),
        "albedo": Output(needs=("albedo_map",)),
        "spread": Output(needs=("radius_map",)),
    }

    def ignores(self) -> Mapping[str, tuple[Constant, str]]:
        """Without bumpiness the slope has no effect, and the normal stays bit by bit."""
        flat = all(draw.values.bumpiness == 0 for draw in self.draws)  # type: ignore[attr-defined]
        return {"slope": (ZERO, "bumpiness is 0")} if flat else {}


def twin(
    normal: NDArray[np.float64], dpdu: NDArray[np.float64], dpdv: NDArray[np.float64], slope: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the bumped normal by the surface gradient [Mikkelsen2010].

    Parameters
    ----------
    normal : (..., 3) unit
    dpdu, dpdv : (..., 3) mm per unit of uv
    slope : (..., 2) mm per unit of uv, bumpiness included

    Returns
    -------
    (..., 3) unit
    """
    along_u = np.cross(dpdv, normal)
    along_v = np.cross(normal, dpdu)
    determinant = np.sum(dpdu * along_u, axis=-1, keepdims=True)
    gradient = np.sign(determinant) * (slope[..., :1] * along_u + slope[..., 1:] * along_v)
    bumped = np.abs(determinant) * normal - gradient
    length = np.linalg.norm(bumped, axis=-1, keepdims=True)
    flat = np.all(gradient == 0, axis=-1, keepdims=True) | (length == 0)
    return np.where(flat, normal, bumped / np.where(length == 0, 1, length))
