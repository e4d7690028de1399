"""Slope of a height map, the form in which bump mapping filters and minifies correctly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Input, Output, Pass


@dataclass(frozen=True)
class SlopeValues(Values):
    """The pass takes no values."""


class Slope(Pass):
    """(dH/du, dH/dv) in mm per unit of uv, and the dimensionless slopes of normal maps."""

    dear = True
    shader = "passes/slope.frag"
    inputs = {"height": Input(), "tangent_slope": Input()}
    outputs = {"slope": Output("rgba32f", mipmaps=True)}


def twin(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the slope by central differences on the repeated map.

    Parameters
    ----------
    height : (h, w) mm, top row first

    Returns
    -------
    (h, w, 2) mm per unit of uv, v upward
    """
    rows, columns = height.shape
    along_u = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) * columns / 2
    along_v = (np.roll(height, 1, axis=0) - np.roll(height, -1, axis=0)) * rows / 2
    return np.stack([along_u, along_v], axis=-1)
