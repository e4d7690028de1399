"""Diffusion by splats [Shah2009]: points of the surface, each a disc in the picture that carries its light around.

What a pixel receives is divided by what discs of light 1 would give, so that constant light passes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skincli.gpu.blocks import Mat4, Values, Vec2, Vec3
from skincli.gpu.geometry import Geometry
from skincli.graph.node import Draw, Input, Output, Pass, Ref, Source
from skincli.mesh.model import Mesh, Part
from skincli.mesh.texels import Texels
from skincli.passes.camera import View3D

#: points at most; standard deviations that a disc spans
MAX_SPLATS, KEPT_SIGMAS = 1 << 18, 3.0

#: what a Gaussian's standard deviation needs to be, in mean distances of points
LEAST_SPACING = 1.0


@dataclass(frozen=True)
class SplatValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    clip, eye, right, up, forward, tan_half, size : the camera and the picture
    sigma, reach : of the Gaussian and of the disc, mm
    """

    clip: Mat4
    eye: Vec3
    sigma: float
    right: Vec3
    reach: float
    up: Vec3
    forward: Vec3
    tan_half: Vec2
    size: Vec2


class SplatDiffusion(Pass):
    """Sums of light times weight (rgb) and of weight (a)."""

    shader = "passes/splat_diffusion.frag"
    vertex = "passes/splat_diffusion.vert"
    additive = True
    inputs = {"image": Input(), "depth": Input()}
    outputs = {"splatted": Output()}


def spacing(texels: Texels) -> float:
    """Return the mean distance of points, mm, as far apart as MAX_SPLATS and the texels allow."""
    giving = texels.areas[texels.areas > 0]
    return math.sqrt(float(giving.sum()) / min(MAX_SPLATS, len(giving)))


def quads(texels: Texels, size: int) -> Geometry:
    """Return points that share the surface evenly, each as a quad.

    Parameters
    ----------
    texels : of the atlas
    size : texels a side
    """
    gives = np.flatnonzero(texels.areas > 0)
    upto = np.cumsum(texels.areas[gives])
    count = min(MAX_SPLATS, len(gives))
    # One point in the middle of each of `count` equal shares of the area, texel after texel.
    chosen = gives[np.searchsorted(upto, (np.arange(count) + 0.5) * (upto[-1] / count))]
    index = texels.index[chosen]
    uv = (np.stack([index % size, index // size], axis=1) + 0.5) / size
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    uv = np.repeat(uv, 4, axis=0)
    first = 4 * np.arange(count)[:, None]
    faces = (first[:, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    positions = np.repeat(texels.positions[chosen], 4, axis=0)
    part = Part("points", 0, len(faces))
    return Geometry(Mesh(positions, np.tile(corners, (count, 1)), uv, uv, faces, (part,)))


def splat_values(widths: Sequence[float], view: View3D, size: tuple[int, int]) -> dict[str, SplatValues]:
    """Return the values of each node of `splat_nodes`, which change with the camera."""
    pixels = (float(size[0]), float(size[1]))
    return {
        f"diffused_{number}": SplatValues(
            view.clip, view.eye, width, view.right, KEPT_SIGMAS * width, view.up, view.forward, view.tan_half, pixels
        )
        for number, width in enumerate(widths)
    }


def splat_nodes(
    size: tuple[int, int], image: Source, depth: Source, points: Geometry, values: Mapping[str, SplatValues]
) -> tuple[list[Pass], list[Ref]]:
    """Return the nodes of Gaussians in the picture, and where each is found.

    Parameters
    ----------
    image : irradiance (rgb) and coverage (a) in the atlas
    depth : mm along the view axis, 0 for none
    points : of `quads`
    values : of `splat_values`
    """
    inputs = {"image": image, "depth": depth}
    nodes: list[Pass] = [
        SplatDiffusion(name, size, [Draw(block, {}, "faces", 0)], inputs, geometry=points)
        for name, block in values.items()
    ]
    return nodes, [Ref(node.name, "splatted") for node in nodes]
