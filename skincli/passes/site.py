"""Where each texel of a map lies on the mesh: the domain in which patterns are evaluated without seams."""

from __future__ import annotations

from dataclasses import dataclass

from skincli.gpu.blocks import Values
from skincli.graph.node import Output, Pass


@dataclass(frozen=True)
class SiteValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    texel : 1 / side of the map in texels
    gutter : how far charts are continued beyond their border, in uv
    """

    texel: float
    gutter: float


class Site(Pass):
    """Rasterises the mesh into the maps' uv.

    position (mm, w = covered), normal (unit, w = mm per texel), baked (ambient occlusion, mean curvature in 1/mm), and
    metric: dP/du and dP/dv in mm per unit of uv, written in the tangent frame: (x, 0) and (y, z).
    """

    dear = True
    shader = "passes/site.frag"
    vertex = "passes/site.vert"
    outputs = {"position": Output(), "normal": Output(), "baked": Output("rg16f"), "metric": Output("rgba32f")}
