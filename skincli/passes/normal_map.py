"""A skin's relief as a tangent-space normal map, the form that other programs read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import Input, Output, Pass

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NormalMapValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    extent : side of the flat square, mm; 0 where the metric map says how the map lies on a mesh
    """

    extent: float


class NormalMap(Pass):
    """Unit normals, y up (OpenGL), in the frame that MikkTSpace defines: x along u, y perpendicular to it."""

    shader = "passes/normal_map.frag"
    inputs = {"slope": Input(), "metric_map": Input()}
    outputs = {"normal": Output()}


def twin(values: NormalMapValues, slope: Array, metric: Array) -> Array:
    """Return the normals.

    Parameters
    ----------
    slope : (h, w, 4) mm per unit of uv along u and v, and the slopes of normal maps
    metric : (h, w, 4) see skincli.passes.site.Site; not read where the map is flat

    Returns
    -------
    (h, w, 3)
    """
    if values.extent > 0:
        metric = np.broadcast_to([values.extent, 0.0, values.extent, 0.0], slope.shape)
    tangent = slope[..., 0] / np.maximum(metric[..., 0], 1e-9)
    bitangent = (slope[..., 1] - metric[..., 1] * tangent) / np.maximum(np.abs(metric[..., 2]), 1e-9)
    tilt = np.stack([tangent, bitangent], axis=-1) + slope[..., 2:4]
    tilt = np.where(metric[..., :1] > 0, tilt, 0.0)
    normal = np.concatenate([-tilt, np.ones_like(tilt[..., :1])], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)
